//! Lambertian emission from the surface of an instance.
//!
//! Radiance is the same in every direction of an emitting side, and over the whole surface but for
//! a pattern. Points are drawn by world area (a mesh is one light with one area table), directions
//! by the cosine.

use super::{DirectSample, EmissionSample, factor, unit_from_to};
use crate::geometry::area::AreaSample;
use crate::geometry::{
    AccelAt, AreaSampler, DirectionalDensity, EndPoint, Instance, InstanceId, SurfacePoint,
};
use crate::math::{frame::Frame, sampling};
use crate::texture::SpectrumTexture;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Emission of radiance from an instance: W/(m² sr nm), and W/(m² sr) per line.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// The surface that emits.
    pub instance: InstanceId,
    /// Factor on the radiance over the surface; `None`: 1.
    pub pattern: Option<SpectrumTexture>,
    /// Sampler of points of the surface.
    pub sampler: AreaSampler,
    /// Whether the back emits as well as the side of the geometric normal.
    pub two_sided: bool,
}

impl AreaLight {
    fn surface<'a>(&self, geometry: &AccelAt<'a>) -> &'a Instance {
        geometry.accel().instance(self.instance)
    }

    /// A point of the surface.
    pub(crate) fn sample(&self, geometry: &AccelAt, u_face: f64, u: DVec2) -> AreaSample {
        let instance = self.surface(geometry);
        self.sampler
            .sample(instance, self.instance, geometry.moment(), u_face, u)
    }

    /// Integral of the cosine over the directions in which a point emits, in steradians.
    pub(super) fn reach(&self) -> f64 {
        PI * self.sides()
    }

    fn sides(&self) -> f64 {
        if self.two_sided { 2.0 } else { 1.0 }
    }

    /// Flux per unit radiance.
    pub(super) fn flux_factor(&self, geometry: &AccelAt) -> f64 {
        let mean = self.pattern.as_ref().map_or(1.0, SpectrumTexture::mean);
        PI * self.surface(geometry).area(geometry.moment()) * self.sides() * mean
    }

    /// Cosine towards `direction` (away from the light) where that side emits, else 0.
    pub(super) fn emitting_cos(&self, ng: DVec3, direction: DVec3) -> f64 {
        let cos = ng.dot(direction);
        if self.two_sided {
            cos.abs()
        } else {
            cos.max(0.0)
        }
    }

    pub(super) fn sample_emission(
        &self,
        geometry: &AccelAt,
        u_face: f64,
        u_pos: DVec2,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        let sample = self.sample(geometry, u_face, u_pos);
        let (side, u_dir) = self.choose_side(u_dir);
        let local = sampling::cosine_hemisphere(u_dir.into());
        let direction = Frame::from_z(sample.point.ng * side)
            .to_outer(local)
            .normalize();
        let pdf_direction = self.direction_density(sample.point.ng, direction);
        (sample.pdf_a > 0.0 && pdf_direction > 0.0).then(|| EmissionSample {
            x0: EndPoint::on(&sample.point),
            origin: sample.point.p,
            direction,
            pdf_x0: sample.pdf_a,
            pdf_direction: DirectionalDensity::SolidAngle(pdf_direction),
            weight: factor(PI * self.sides() / sample.pdf_a),
        })
    }

    /// Which side a direction number asks for, and the number made uniform again.
    fn choose_side(&self, u: DVec2) -> (f64, DVec2) {
        if !self.two_sided {
            (1.0, u)
        } else if u.x < 0.5 {
            (1.0, DVec2::new(2.0 * u.x, u.y))
        } else {
            (-1.0, DVec2::new(2.0 * u.x - 1.0, u.y))
        }
    }

    /// Density per solid angle of the emitted direction.
    fn direction_density(&self, ng: DVec3, direction: DVec3) -> f64 {
        sampling::cosine_hemisphere_pdf(self.emitting_cos(ng, direction)) / self.sides()
    }

    pub(super) fn emission_density(
        &self,
        geometry: &AccelAt,
        x0: &EndPoint,
        direction: DVec3,
    ) -> (f64, DirectionalDensity) {
        let pdf = self.direction_density(x0.n, direction);
        (
            self.area_density(geometry, x0),
            DirectionalDensity::SolidAngle(pdf),
        )
    }

    fn area_density(&self, geometry: &AccelAt, x0: &EndPoint) -> f64 {
        let own = |point: &SurfacePoint| point.id.instance == self.instance;
        let Some(point) = x0.surface_point().filter(own) else {
            return 0.0;
        };
        self.sampler
            .pdf(self.surface(geometry), &point, geometry.moment())
    }

    #[inline]
    pub(super) fn sample_direct(
        &self,
        geometry: &AccelAt,
        x1: DVec3,
        u_face: f64,
        u: DVec2,
    ) -> Option<DirectSample> {
        let sample = self.sample(geometry, u_face, u);
        let (toward, distance) = unit_from_to(x1, sample.point.p)?;
        let cos = self.emitting_cos(sample.point.ng, -toward);
        (sample.pdf_a > 0.0 && cos > 0.0).then(|| DirectSample {
            x0: EndPoint::on(&sample.point),
            toward,
            distance,
            pdf: sample.pdf_a,
            value: factor(cos / (distance * distance * sample.pdf_a)),
        })
    }

    pub(super) fn direct_density(&self, geometry: &AccelAt, x1: DVec3, x0: &EndPoint) -> f64 {
        if self.emitting_cos(x0.n, x1 - x0.p) > 0.0 {
            self.area_density(geometry, x0)
        } else {
            0.0
        }
    }
}
