//! Lens surfaces as shapes: what [`crate::optics::LensSurface`] knows about lines, for the ends of
//! rays and segments.
//!
//! The space of the shape is that of the prescription (millimeters, vertex at the origin, axis
//! along z); the transform of the instance scales it. The search for the first hit is that of lens
//! traces, so both meet the same points.

use super::analytic::FaceHit;
use super::ray::LocalRay;
use super::shape::LocalPoint;
use crate::optics::surface::{conic_roots, conic_slope};
use crate::optics::{LensSurface, Outline, Profile};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Points per axis of the quadrature for areas.
const AREA_STEPS: u32 = 256;

/// A lens surface that ends at its clear aperture. The normal is on the side of +z.
#[derive(Clone, Debug, PartialEq)]
pub struct LensShape {
    surface: LensSurface,
    low: DVec3,
    high: DVec3,
    /// Largest coordinate.
    extent: f64,
}

impl LensShape {
    /// The part of a surface within its aperture; `None` where the aperture has no edge or is not
    /// possible, or the surface does not reach as far.
    #[must_use]
    pub fn new(surface: LensSurface) -> Option<Self> {
        let reach = surface.aperture.extent();
        let is_possible = surface.aperture.is_valid()
            && surface.profile.is_finite()
            && reach.is_finite()
            && reach <= surface.profile.domain_radius();
        if !is_possible {
            return None;
        }
        let [bottom, top] = surface.sag_range()?;
        // rounding of points on the edge of the domain
        let slack = 64.0 * f64::EPSILON * (reach + bottom.abs().max(top.abs()));
        let low = DVec3::new(-reach, -reach, bottom) - slack;
        let high = DVec3::new(reach, reach, top) + slack;
        let extent = low.abs().max(high.abs()).max_element();
        Some(Self {
            surface,
            low,
            high,
            extent,
        })
    }

    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &LensSurface {
        &self.surface
    }

    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        (self.low, self.high)
    }

    #[inline]
    pub(super) fn extent(&self) -> f64 {
        self.extent
    }

    /// The first hit of a ray. An end that lies on the surface is no hit, every other crossing of
    /// the surface is one.
    pub(super) fn hit(&self, ray: &LocalRay) -> Option<FaceHit> {
        if let Profile::Conic { curvature, conic } = self.surface.profile {
            return self.conic_hit((curvature, conic), ray);
        }
        let length = ray.d.length();
        let d = ray.d / length;
        let is_end = ray.start.is_some() || ray.end.is_some();
        let mut own = [ray.start.map(|_| 0.0), ray.end.map(|_| ray.t_end * length)];
        let mut from = 0.0;
        loop {
            let range = [from, ray.t_max * length];
            let hit = self.surface.first_hit_but(ray.o, d, range, own)?;
            let t = hit.t / length;
            // the other crossings of the surface that an end lies on are told from the end however
            // flat the chord is
            let approach = || {
                if is_end {
                    length
                } else {
                    hit.normal.dot(ray.d).abs()
                }
            };
            if ray.counts(t, approach) {
                return Some((t, 0));
            }
            // neighbors of an end do not count, what lies behind them does
            from = hit.t;
            own[0] = Some(from);
        }
    }

    /// The same of a conic of this curvature and conic constant, without roots of lengths on the
    /// way to it.
    #[inline(always)]
    pub(super) fn conic_hit(
        &self,
        (curvature, conic): (f64, f64),
        ray: &LocalRay,
    ) -> Option<FaceHit> {
        let own = [ray.start.map(|_| 0.0), ray.end.map(|_| ray.t_end)];
        let line = (ray.o, ray.d, ray.d.length_squared());
        for t in conic_roots(curvature, conic, line, own) {
            if !ray.reaches(t) {
                continue;
            }
            let point = ray.at(t);
            if !self.surface.aperture.contains(point.x, point.y) {
                continue;
            }
            let Some(slope) = conic_slope(curvature, conic, point) else {
                continue;
            };
            // the other crossings of the surface that an end lies on are told from the end however
            // flat the chord is
            let approach = || {
                if ray.start.is_some() || ray.end.is_some() {
                    line.2.sqrt()
                } else {
                    slope.dot(ray.d).abs() / slope.length()
                }
            };
            if ray.counts(t, approach) {
                return Some((t, 0));
            }
        }
        None
    }

    /// Point nearest to `p`, which lies next to the surface, and a normal of any length there.
    #[inline]
    pub(super) fn point(&self, prim: u32, p: DVec3) -> LocalPoint {
        let (p, slope) = self.nearest(p);
        LocalPoint {
            p,
            ng: slope,
            ns: None,
            uv: self.uv(p),
            prim,
        }
    }

    /// The point nearest to `p`, which lies next to the surface, and a normal there, of any length.
    #[inline(always)]
    fn nearest(&self, p: DVec3) -> (DVec3, DVec3) {
        let (above, slope) = self.height(p);
        let q = p - slope * (above / slope.length_squared());
        (q, self.height(q).1)
    }

    /// A function that is 0 on the surface, and its gradient.
    #[inline(always)]
    fn height(&self, p: DVec3) -> (f64, DVec3) {
        if let Profile::Conic { curvature, conic } = self.surface.profile {
            // z - c (r^2 + (1 + k) z^2) / 2: without the root that ends where the surface does
            let square = p.truncate().length_squared() + (1.0 + conic) * p.z * p.z;
            let up = 1.0 - curvature * (1.0 + conic) * p.z;
            let slope = DVec3::new(-curvature * p.x, -curvature * p.y, up);
            return (p.z - 0.5 * curvature * square, slope);
        }
        let [z, zx, zy] = self.surface.profile.sag_and_slopes(p.x, p.y);
        (p.z - z, DVec3::new(-zx, -zy, 1.0))
    }

    /// Texture coordinates: those of the square around the aperture.
    pub(super) fn uv(&self, p: DVec3) -> DVec2 {
        (p.truncate() / self.surface.aperture.extent() + 1.0) / 2.0
    }

    /// Derivatives of the position by the texture coordinates; `None` where the surface is upright.
    pub(super) fn tangents(&self, p: DVec3) -> Option<[DVec3; 2]> {
        let n = self.nearest(p).1;
        let side = 2.0 * self.surface.aperture.extent();
        let x = DVec3::new(1.0, 0.0, -n.x / n.z) * side;
        let y = DVec3::new(0.0, 1.0, -n.y / n.z) * side;
        (x.is_finite() && y.is_finite()).then_some([x, y])
    }

    /// Area seen along the axis.
    pub(super) fn projected_area(&self) -> f64 {
        match self.surface.aperture.outline {
            Outline::Open => f64::INFINITY,
            Outline::Circle { radius } => PI * radius * radius,
            Outline::Annulus { inner, outer } => PI * (outer * outer - inner * inner),
            Outline::Rectangle { half } => 4.0 * half.x * half.y,
        }
    }

    /// A point by `u` in [0,1)², uniform in the area seen along the axis.
    pub(super) fn sample(&self, u: DVec2) -> DVec3 {
        let ring = |inner: f64, outer: f64| {
            let r2 = inner * inner + u.x * (outer * outer - inner * inner);
            DVec2::from_angle(TAU * u.y) * r2.sqrt()
        };
        let flat = match self.surface.aperture.outline {
            Outline::Open => DVec2::ZERO,
            Outline::Circle { radius } => ring(0.0, radius),
            Outline::Annulus { inner, outer } => ring(inner, outer),
            Outline::Rectangle { half } => (u * 2.0 - 1.0) * half,
        };
        let at = flat + self.surface.aperture.center;
        at.extend(self.surface.profile.sag(at.x, at.y))
    }

    /// Area under a map that stretches it by `stretch` where the unit normal is the argument, by
    /// quadrature.
    pub(super) fn area(&self, stretch: impl Fn(DVec3) -> f64) -> f64 {
        let step = |i: u32| (f64::from(i) + 0.5) / f64::from(AREA_STEPS);
        let cells = (0..AREA_STEPS).flat_map(|i| (0..AREA_STEPS).map(move |j| (i, j)));
        let sum: f64 = cells
            .map(|(i, j)| {
                let n = self.nearest(self.sample(DVec2::new(step(i), step(j)))).1;
                let n = n.normalize();
                stretch(n) / n.z
            })
            .sum();
        sum * self.projected_area() / f64::from(AREA_STEPS).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Accel, Instance, InstanceId, Ray, Shape, SurfaceId, Transform};
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};
    use crate::optics::Aperture;
    use glam::{DAffine3, DQuat, dvec3};
    use std::sync::Arc;

    fn cap(profile: Profile, radius: f64) -> LensShape {
        LensShape::new(LensSurface::new(profile, Aperture::circle(radius))).expect("possible")
    }

    fn placed(shape: &LensShape, map: DAffine3) -> Accel {
        Accel::build(vec![Instance {
            shape: Shape::Lens(Arc::new(shape.clone())),
            transform: Transform::fixed(map),
        }])
    }

    fn profiles() -> [Profile; 4] {
        let (curvature, conic) = (1.0 / 25.0, -0.6);
        [
            Profile::sphere(-30.0),
            Profile::Conic { curvature, conic },
            Profile::EvenAsphere {
                curvature,
                conic,
                even: vec![0.0, 1e-5],
            },
            Profile::PLANE,
        ]
    }

    #[test]
    fn segments_between_two_points_of_a_convex_surface_do_not_meet_it() {
        for profile in profiles().into_iter().take(3) {
            // meters per millimeter, and distance from the origin
            for (scale, far) in [(1e-3, 0.0), (1e-3, 10.0), (1e-6, 1e-2), (1.0, 1e4)] {
                let shape = cap(profile.clone(), 12.0);
                let turn = DQuat::from_rotation_x(0.4);
                let place = dvec3(far, -far, 2.0 * far);
                let size = DVec3::splat(scale);
                let map = DAffine3::from_scale_rotation_translation(size, turn, place);
                let accel = placed(&shape, map);
                let here = Some(SurfaceId {
                    instance: InstanceId(0),
                    prim: 0,
                });
                for i in 0..200u64 {
                    let u = |k: u64| unit_f64(random_bits(i, k));
                    let point = |k| map.transform_point3(shape.sample(DVec2::new(u(k), u(k + 1))));
                    let (a, b) = (point(0), point(2));
                    let length = (b - a).length();
                    let open = Ray::leaving(a, (b - a) / length, here);
                    let at = accel.at(0.0);
                    let segment = open.ending(length, here);
                    assert!(
                        !at.occluded(&segment, |_| true),
                        "{profile:?} {scale} {far}"
                    );
                    let Some(hit) = at.closest(&open, |_| true) else {
                        // the other point may lie beyond the aperture by a rounding
                        let r = map.inverse().transform_point3(b).truncate().length();
                        assert!(r > 12.0 - 1e-6, "{profile:?} {scale} {far}: lost at {r}");
                        continue;
                    };
                    // along a chord that leaves the surface by the sine s, points known to d are
                    // found to d / s; s is at least chord / (2 radius), here chord / 60
                    let known = 64.0 * f64::EPSILON * (3.0 * far + 12.0 * scale);
                    let bound = known * (1.0 + 60.0 * scale / length);
                    let error = (hit.t - length).abs();
                    assert!(error <= bound, "{profile:?} {scale} {far}: {error} {bound}");
                }
            }
        }
    }

    #[test]
    fn rays_meet_what_lens_traces_meet_and_points_stay_on_the_surface() {
        for profile in profiles() {
            let shape = cap(profile.clone(), 12.0);
            let turn = DQuat::from_rotation_y(0.7);
            let (size, place) = (DVec3::splat(1e-3), dvec3(3.0, -5.0, 8.0));
            let map = DAffine3::from_scale_rotation_translation(size, turn, place);
            let accel = placed(&shape, map);
            let (mut met, mut passed) = (0, 0);
            for i in 0..400u64 {
                let u = |k: u64| unit_f64(random_bits(i, k)) * 2.0 - 1.0;
                let o = dvec3(20.0 * u(0), 20.0 * u(1), -60.0);
                let d = (dvec3(14.0 * u(2), 14.0 * u(3), 0.0) - o).normalize();
                let range = [0.0, f64::INFINITY];
                let expected = shape.surface.first_hit(o, d, range, false);
                let ray = Ray::new(map.transform_point3(o), turn * d);
                let found = accel.at(0.0).closest(&ray, |_| true);
                assert_eq!(expected.is_some(), found.is_some(), "{profile:?} {o} {d}");
                let (Some(expected), Some(found)) = (expected, found) else {
                    passed += 1;
                    continue;
                };
                met += 1;
                let point = accel.at(0.0).surface(&ray, &found);
                let local = map.inverse().transform_point3(point.p);
                // millimeters at 10 m: 32 roundings of 1e4 mm
                assert!((local - expected.point).length() < 1e-10);
                assert!((turn.inverse() * point.ng - expected.normal).length() < 1e-11);
            }
            assert!(met > 100 && passed > 50, "{met} {passed}");
        }
    }

    #[test]
    fn apertures_without_an_edge_or_beyond_the_surface_are_no_shapes() {
        let new = |profile, aperture| LensShape::new(LensSurface::new(profile, aperture));
        assert!(new(Profile::sphere(10.0), Aperture::OPEN).is_none());
        assert!(new(Profile::sphere(10.0), Aperture::circle(10.1)).is_none());
        assert!(new(Profile::sphere(10.0), Aperture::circle(9.9)).is_some());
        assert!(new(Profile::sphere(f64::NAN), Aperture::circle(1.0)).is_none());
    }

    #[test]
    fn areas_are_those_of_spherical_caps() {
        let (radius, a) = (30.0f64, 12.0f64);
        let height = radius - (radius * radius - a * a).sqrt();
        let exact = TAU * radius * height;
        let area = cap(Profile::sphere(-radius), a).area(|_| 1.0);
        // the midpoint rule over 256 steps of a smooth function of r^2
        assert!((area / exact - 1.0).abs() < 1e-5, "{area} {exact}");
    }
}
