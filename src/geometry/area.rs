//! Sampling of placed shapes by area, for those that emit.
//!
//! A map with matrix M stretches the area about a point with unit object normal n by |det M| |M^-T
//! n|. Points are sampled uniformly over the area in object space (of a deforming mesh: over each
//! triangle), so the density per world area is 1 / (object area · stretch) under any affine map.

use super::analytic;
use super::instance::{flat_to_world, to_world};
use super::motion::{Placement, Transform};
use super::shape::LocalPoint;
use super::{Instance, InstanceId, Moment, Shape, SurfacePoint};
use crate::math::angle::sin_cos_turns;
use crate::math::distribution::AliasTable;
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// A point sampled on a shape by area.
#[derive(Clone, Copy, Debug)]
pub struct AreaSample {
    /// The point, in world space.
    pub point: SurfacePoint,
    /// Density per world area.
    pub pdf_a: f64,
}

/// Table that sampling a shape by area takes beside the shape.
#[derive(Clone, Debug, Default)]
pub struct AreaSampler {
    /// Triangles of a mesh by area: their mean area over the keys of a mesh that changes its form.
    triangles: Option<Arc<AliasTable>>,
    /// Density per world area, where it is known to be the same all over and all the time.
    uniform: Option<f64>,
}

/// Points per axis of the quadrature for curved shapes under maps that are not similarities.
const AREA_STEPS: u32 = 256;

impl Shape {
    /// Area in object space at `time` (takes time linear in the triangles of a deforming mesh).
    #[must_use]
    pub fn area(&self, time: f64) -> f64 {
        match self {
            Self::Sphere | Self::Cylinder => 4.0 * PI,
            Self::Disk { inner } => PI * (1.0 - inner * inner),
            Self::Quad => 4.0,
            Self::Box => 24.0,
            Self::Lens(lens) => lens.area(|_| 1.0),
            Self::Mesh(mesh) => mesh.area(),
            Self::Deforming(mesh) => mesh.mapped_area(DMat3::IDENTITY, time),
        }
    }
}

impl Instance {
    /// World area at a moment. Exact, except for lens surfaces, and spheres and cylinders under
    /// unequal scaling: relative error below 1e-4 for ratios of the axes up to 100. Takes time
    /// linear in the triangles of a mesh under unequal scaling.
    #[must_use]
    pub fn area<'a>(&'a self, moment: impl Into<Moment<'a>>) -> f64 {
        let moment = moment.into();
        let (placement, time) = (self.transform.at(moment), moment.time());
        let stretch = |n: DVec3| area_stretch(&placement, placement.normal_to_world(n));
        if is_similarity(placement.to_world.matrix3) {
            return self.shape.area(time) * stretch(DVec3::Z);
        }
        let steps = |n: u32| (0..n).map(move |i| (f64::from(i) + 0.5) / f64::from(n));
        let ring = |u: f64, z: f64| {
            let (sin, cos) = sin_cos_turns(u);
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * cos, r * sin, z)
        };
        match &self.shape {
            Shape::Disk { .. } | Shape::Quad => self.shape.area(time) * stretch(DVec3::Z),
            Shape::Box => DVec3::AXES.iter().map(|&n| 8.0 * stretch(n)).sum(),
            Shape::Cylinder => {
                let n = AREA_STEPS * AREA_STEPS;
                steps(n).map(|u| stretch(ring(u, 0.0))).sum::<f64>() / f64::from(n)
                    * self.shape.area(time)
            }
            Shape::Sphere => {
                let sum: f64 = steps(AREA_STEPS)
                    .flat_map(|v| steps(AREA_STEPS).map(move |u| ring(u, 1.0 - 2.0 * v)))
                    .map(stretch)
                    .sum();
                sum / f64::from(AREA_STEPS).powi(2) * self.shape.area(time)
            }
            Shape::Lens(lens) => lens.area(stretch),
            Shape::Mesh(mesh) => mesh.mapped_area(placement.to_world.matrix3, time),
            Shape::Deforming(mesh) => mesh.mapped_area(placement.to_world.matrix3, time),
        }
    }
}

impl AreaSampler {
    /// The sampler of a shape. Takes time and memory linear in the triangles of a mesh; copies
    /// share the memory.
    #[must_use]
    pub fn new(shape: &Shape) -> Self {
        let table = match shape {
            Shape::Mesh(mesh) => mesh.area_table(),
            Shape::Deforming(mesh) => mesh.area_table(),
            _ => None,
        };
        Self {
            triangles: table.map(Arc::new),
            uniform: None,
        }
    }

    /// The same for this instance alone: where it rests and is stretched alike all over, the
    /// density is computed once.
    #[must_use]
    pub fn placed(self, instance: &Instance) -> Self {
        let is_even = match (&instance.transform, &instance.shape) {
            (Transform::Moving(_), _) | (_, Shape::Lens(_) | Shape::Deforming(_)) => false,
            (_, Shape::Quad | Shape::Disk { .. }) => true,
            (Transform::Static(placement), _) => is_similarity(placement.to_world.matrix3),
        };
        Self {
            uniform: is_even.then(|| 1.0 / instance.area(0.0)),
            ..self
        }
    }

    /// The table by which triangles are chosen, which samplers of one mesh may share.
    #[must_use]
    pub fn table(&self) -> Option<&Arc<AliasTable>> {
        self.triangles.as_ref()
    }

    /// A point of `instance`, whose shape this is the sampler of: `u` in [0,1)², `u_face` chooses
    /// the face or triangle. Takes constant time.
    #[must_use]
    pub fn sample<'a>(
        &self,
        instance: &'a Instance,
        id: InstanceId,
        moment: impl Into<Moment<'a>>,
        u_face: f64,
        u: DVec2,
    ) -> AreaSample {
        let moment = moment.into();
        let time = moment.time();
        instance.transform.with(moment, |placement| {
            let point = if let Shape::Quad = instance.shape {
                flat_to_world(id, placement, on_square(u))
            } else {
                let local = self.object_point(&instance.shape, u_face, u, time);
                to_world(id, placement, &local)
            };
            AreaSample {
                point,
                pdf_a: self.density(instance, placement, &point, time),
            }
        })
    }

    /// The density per world area with which `sample` generates `point`.
    #[must_use]
    pub fn pdf<'a>(
        &self,
        instance: &'a Instance,
        point: &SurfacePoint,
        moment: impl Into<Moment<'a>>,
    ) -> f64 {
        let moment = moment.into();
        let placement = instance.transform.at(moment);
        self.density(instance, &placement, point, moment.time())
    }

    fn density(
        &self,
        instance: &Instance,
        placement: &Placement,
        point: &SurfacePoint,
        time: f64,
    ) -> f64 {
        if let Some(density) = self.uniform {
            return density;
        }
        let stretch = area_stretch(placement, point.ng);
        if let Shape::Lens(lens) = &instance.shape {
            // uniform in the area seen along the axis
            let n = (placement.to_world.matrix3.transpose() * point.ng).normalize();
            return n.z.abs() / (lens.projected_area() * stretch);
        }
        let area = self.inverse_density(&instance.shape, point.id.prim, time);
        1.0 / (area * stretch)
    }

    /// Triangle chosen by `u_face`.
    fn triangle(&self, u_face: f64) -> u32 {
        let choose = |table: &Arc<AliasTable>| table.sample(u_face).index as u32;
        self.triangles.as_ref().map_or(0, choose)
    }

    /// A point in object space; `u_face` chooses the face, `u` the point on it.
    #[inline]
    fn object_point(&self, shape: &Shape, u_face: f64, u: DVec2, time: f64) -> LocalPoint {
        let ring = |r: f64, z: f64| {
            let (sin, cos) = sin_cos_turns(u.y);
            DVec3::new(r * cos, r * sin, z)
        };
        let s = u.x.sqrt();
        let on_triangle = DVec2::new(s * (1.0 - u.y), s * u.y);
        let (prim, p) = match shape {
            Shape::Sphere => {
                let z = 1.0 - 2.0 * u.x;
                (0, ring((1.0 - z * z).max(0.0).sqrt(), z))
            }
            Shape::Disk { inner } => {
                let i2 = inner * inner;
                (0, ring((i2 + u.x * (1.0 - i2)).sqrt(), 0.0))
            }
            Shape::Quad => (0, on_square(u)),
            Shape::Cylinder => (0, ring(1.0, 2.0 * u.x - 1.0)),
            Shape::Box => {
                let face = ((u_face * 6.0) as u32).min(5);
                let axis = (face / 2) as usize;
                let mut p = analytic::cube_normal(face);
                p[(axis + 1) % 3] = 2.0 * u.x - 1.0;
                p[(axis + 2) % 3] = 2.0 * u.y - 1.0;
                (face, p)
            }
            Shape::Lens(lens) => (0, lens.sample(u)),
            Shape::Mesh(mesh) => return mesh.local_point(self.triangle(u_face), on_triangle, time),
            Shape::Deforming(mesh) => {
                return mesh.local_point(self.triangle(u_face), on_triangle, time);
            }
        };
        shape.local_point(prim, p, DVec2::ZERO, time)
    }

    /// 1 / the density per object area with which points of face `prim` are sampled: the area,
    /// except of a deforming mesh, where it is infinite while the triangle has no area.
    #[inline]
    fn inverse_density(&self, shape: &Shape, prim: u32, time: f64) -> f64 {
        match (shape, &self.triangles) {
            (Shape::Deforming(mesh), Some(table)) => {
                let area = mesh.area_of(prim, time);
                if area > 0.0 {
                    area / table.pmf(prim as usize)
                } else {
                    f64::INFINITY
                }
            }
            _ => shape.area(time),
        }
    }
}

/// The point of a quad in its own space.
fn on_square(u: DVec2) -> DVec3 {
    (u * 2.0 - 1.0).extend(0.0)
}

/// World area per object area where the unit world normal is `ng`.
fn area_stretch(placement: &Placement, ng: DVec3) -> f64 {
    let m = placement.to_world.matrix3;
    m.determinant().abs() / (m.transpose() * ng).length()
}

/// Whether `m` scales all directions alike (to rounding).
fn is_similarity(m: DMat3) -> bool {
    let gram = m.transpose() * m;
    let scale = gram.x_axis.x;
    let odd = gram - DMat3::from_diagonal(DVec3::splat(scale));
    odd.to_cols_array()
        .iter()
        .all(|x| x.abs() <= 16.0 * f64::EPSILON * scale)
}

#[cfg(test)]
mod tests {
    use super::super::{LensShape, Mesh, Transform};
    use super::*;
    use crate::optics::{Aperture, LensSurface, Profile};
    use glam::{DAffine3, DQuat, dvec3};
    use std::f64::consts::TAU;
    use std::sync::Arc;

    const ID: InstanceId = InstanceId(0);

    fn tetrahedron() -> Shape {
        let p = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 2.0, 0.0],
            [0.0, 0.0, 0.5f32],
        ];
        let t = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        Shape::Mesh(Arc::new(Mesh::new(&p, None, None, t).expect("valid")))
    }

    fn lens() -> Shape {
        let surface = LensSurface::new(Profile::sphere(2.0), Aperture::circle(1.0));
        Shape::Lens(Arc::new(LensShape::new(surface).expect("possible")))
    }

    fn shapes() -> [Shape; 7] {
        let disk = Shape::Disk { inner: 0.4 };
        [
            Shape::Sphere,
            disk,
            Shape::Quad,
            Shape::Cylinder,
            Shape::Box,
            lens(),
            tetrahedron(),
        ]
    }

    fn placed(shape: Shape, scale: DVec3) -> Instance {
        let turn = DQuat::from_axis_angle(dvec3(1.0, 2.0, -0.5).normalize(), 0.7);
        let to_world =
            DAffine3::from_scale_rotation_translation(scale, turn, dvec3(3.0, -1.0, 2.0));
        Instance {
            shape,
            transform: Transform::fixed(to_world),
        }
    }

    fn grid(n: u32) -> impl Iterator<Item = (f64, DVec2)> {
        let at = move |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        // The face is chosen by a third number, from a sequence that knows nothing of the grid.
        (0..n * n).map(move |i| {
            let face = (f64::from(i) * 0.618_033_988_749_894_9).fract();
            (face, DVec2::new(at(i / n), at(i % n)))
        })
    }

    #[test]
    fn a_density_computed_once_is_that_of_every_point() {
        let mut known = 0;
        for shape in shapes() {
            for scale in [DVec3::ONE, DVec3::splat(1e-3), dvec3(1.0, 3.0, -0.2)] {
                let instance = placed(shape.clone(), scale);
                let sampler = AreaSampler::new(&instance.shape);
                let once = sampler.clone().placed(&instance);
                known += usize::from(once.uniform.is_some());
                for (u_face, u) in grid(20) {
                    let of = |s: &AreaSampler| s.sample(&instance, ID, 0.0, u_face, u);
                    let (each, once) = (of(&sampler), of(&once));
                    assert_eq!(each.point.p, once.point.p);
                    let error = (each.pdf_a / once.pdf_a - 1.0).abs();
                    assert!(error < 1e-12, "{shape:?} {scale}: {error}");
                }
            }
        }
        // all but lens surfaces under two scales, flat ones under the third
        assert_eq!(known, 6 + 6 + 2);
    }

    #[test]
    fn the_density_of_area_samples_integrates_to_one_over_the_world_area() {
        for shape in shapes() {
            for scale in [DVec3::ONE, DVec3::splat(1e-3), dvec3(1.0, 3.0, -0.2)] {
                let instance = placed(shape.clone(), scale);
                let sampler = AreaSampler::new(&instance.shape);
                let n = 200;
                let mut area = 0.0;
                for (u_face, u) in grid(n) {
                    let s = sampler.sample(&instance, ID, 0.0, u_face, u);
                    let pdf = sampler.pdf(&instance, &s.point, 0.0);
                    assert!((pdf / s.pdf_a - 1.0).abs() < 1e-12);
                    area += 1.0 / s.pdf_a;
                }
                let estimate = area / f64::from(n * n);
                let exact = instance.area(0.0);
                // A grid of 40000 points: the quadrature and the choice of faces err by less than
                // 1e-3.
                assert!(
                    (estimate / exact - 1.0).abs() < 1e-3,
                    "{shape:?} {scale}: {estimate} {exact}"
                );
            }
        }
    }

    #[test]
    fn spheroids_have_their_closed_area() {
        // Oblate spheroid with half axes 2, 2, 0.5.
        let e = (1.0f64 - 0.0625).sqrt();
        let exact = TAU * 4.0 * (1.0 + (1.0 - e * e) / e * e.atanh());
        let area = placed(Shape::Sphere, dvec3(2.0, 2.0, 0.5)).area(0.0);
        assert!((area / exact - 1.0).abs() < 1e-4, "{area} {exact}");
        let flat = placed(Shape::Disk { inner: 0.5 }, dvec3(2.0, 3.0, 7.0)).area(0.0);
        assert!((flat - std::f64::consts::PI * 6.0 * 0.75).abs() < 1e-12);
    }

    #[test]
    fn samples_are_uniform_under_a_similarity() {
        // Chi-square over 64 equal cells; 99.99 % quantile of 63 degrees of freedom: 112.
        let n = 64_000u64;
        let cell = |shape: &Shape, p: DVec3| -> usize {
            let turn = (p.y.atan2(p.x) / TAU + 0.5).clamp(0.0, 0.999_999);
            let along = match shape {
                Shape::Disk { inner } => {
                    (p.truncate().length_squared() - inner * inner) / (1.0 - inner * inner)
                }
                Shape::Quad => {
                    return ((p.x + 1.0) * 4.0) as usize * 8 + ((p.y + 1.0) * 4.0) as usize;
                }
                _ => (p.z + 1.0) / 2.0,
            };
            (turn * 8.0) as usize * 8 + (along.clamp(0.0, 0.999_999) * 8.0) as usize
        };
        for shape in [
            Shape::Sphere,
            Shape::Disk { inner: 0.4 },
            Shape::Quad,
            Shape::Cylinder,
        ] {
            let instance = placed(shape.clone(), DVec3::splat(3.0));
            let sampler = AreaSampler::new(&instance.shape);
            let mut count = [0u32; 64];
            let random = |i: u64| crate::math::hash::unit_f64(crate::math::hash::random_bits(5, i));
            for i in 0..n {
                let u = DVec2::new(random(3 * i), random(3 * i + 1));
                let s = sampler.sample(&instance, ID, 0.0, random(3 * i + 2), u);
                let p = instance
                    .transform
                    .at(0.0)
                    .to_object
                    .transform_point3(s.point.p);
                count[cell(&shape, p)] += 1;
            }
            let expected = n as f64 / 64.0;
            let chi2: f64 = count
                .iter()
                .map(|&c| (f64::from(c) - expected).powi(2) / expected)
                .sum();
            assert!(chi2 < 112.0, "{shape:?}: {chi2}");
        }
    }

    #[test]
    fn normals_point_outward_under_mirrored_maps() {
        for shape in [Shape::Sphere, Shape::Box, Shape::Cylinder, tetrahedron()] {
            let inside = match shape {
                Shape::Mesh(_) => dvec3(0.1, 0.2, 0.05),
                _ => DVec3::ZERO,
            };
            for scale in [DVec3::ONE, dvec3(-1.0, 2.0, 0.5), dvec3(-1.0, -1.0, -3.0)] {
                let instance = placed(shape.clone(), scale);
                let sampler = AreaSampler::new(&instance.shape);
                let inside = instance.transform.at(0.0).to_world.transform_point3(inside);
                for (u_face, u) in grid(20) {
                    let point = sampler.sample(&instance, ID, 0.0, u_face, u).point;
                    assert!((point.ng.length() - 1.0).abs() < 1e-12);
                    let out = point.p - inside;
                    assert!(point.ng.dot(out) > 0.0, "{shape:?} {scale}");
                }
            }
        }
    }

    #[test]
    fn bounds_hold_the_surface_and_touch_it() {
        for shape in shapes() {
            for scale in [DVec3::ONE, dvec3(1.0, 3.0, -0.2)] {
                let instance = placed(shape.clone(), scale);
                let sampler = AreaSampler::new(&instance.shape);
                let (low, high) = instance.bounds();
                let size = (high - low).length();
                let (mut seen_low, mut seen_high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
                for (u_face, u) in grid(200) {
                    let p = sampler.sample(&instance, ID, 0.0, u_face, u).point.p;
                    seen_low = seen_low.min(p);
                    seen_high = seen_high.max(p);
                }
                assert!((seen_low - low).min_element() > -1e-12 * size, "{shape:?}");
                assert!(
                    (high - seen_high).min_element() > -1e-12 * size,
                    "{shape:?}"
                );
                // of meshes and lens surfaces, the placed box of their own box
                if !matches!(shape, Shape::Mesh(_) | Shape::Lens(_)) {
                    assert!((seen_low - low).max_element() < 0.03 * size, "{shape:?}");
                }
            }
        }
    }
}
