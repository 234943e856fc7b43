//! One placed shape: bounds, area, and sampling by area.
//!
//! A map with matrix M stretches the area about a point with unit object normal n by |det M| |M^-T n|. Points are sampled uniformly over the
//! object-space area, so the density per world area is 1 / (object area · stretch) under any affine map.

use super::motion::Placement;
use super::shape::{AreaSample, LocalPoint};
use super::{Shape, SurfaceId, SurfacePoint, Transform};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::f64::consts::TAU;

/// Index of an instance in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstanceId(pub u32);

/// A shape placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The surface in its own space.
    pub shape: Shape,
    /// Where it is.
    pub transform: Transform,
}

/// Points per axis of the quadrature for curved shapes under maps that are not similarities.
const AREA_STEPS: u32 = 256;

impl Instance {
    /// World area at `time`. Exact, except for spheres and cylinders under unequal scaling: relative error below 1e-4
    /// for ratios of the axes up to 100. Takes time linear in the triangles of a mesh under unequal scaling.
    #[must_use]
    pub fn area(&self, time: f64) -> f64 {
        let placement = self.transform.at(time);
        let stretch = |n: DVec3| area_stretch(&placement, placement.normal_to_world(n));
        if is_similarity(placement.to_world.matrix3) {
            return self.shape.area(time) * stretch(DVec3::Z);
        }
        let steps = |n: u32| (0..n).map(move |i| (f64::from(i) + 0.5) / f64::from(n));
        let ring = |u: f64, z: f64| {
            let (sin, cos) = (TAU * u).sin_cos();
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
            Shape::Mesh(mesh) => mesh.mapped_area(placement.to_world.matrix3),
            Shape::Deforming(mesh) => mesh.mapped_area(placement.to_world.matrix3, time),
        }
    }

    /// A point by area: `u` in [0,1)², `u_face` chooses the face or triangle. Takes constant time (the first call on
    /// a mesh builds its table of areas).
    #[must_use]
    pub fn sample_area(&self, id: InstanceId, time: f64, u_face: f64, u: DVec2) -> AreaSample {
        let placement = self.transform.at(time);
        let point = to_world(id, &placement, &self.shape.sample(u_face, u, time));
        AreaSample {
            point,
            pdf_a: self.density(&placement, &point, time),
        }
    }

    /// The density per world area with which `sample_area` generates `point`.
    #[must_use]
    pub fn pdf_area(&self, point: &SurfacePoint, time: f64) -> f64 {
        self.density(&self.transform.at(time), point, time)
    }

    fn density(&self, placement: &Placement, point: &SurfacePoint, time: f64) -> f64 {
        let area = self.shape.inverse_density(point.id.prim, time);
        1.0 / (area * area_stretch(placement, point.ng))
    }

    /// Whether it moves or changes its form while the shutter is open.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.transform.is_moving() || matches!(self.shape, Shape::Deforming(_))
    }

    /// World bounds over the whole shutter.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let extent = self.shape.bounds();
        let radius = extent.0.abs().max(extent.1.abs()).length();
        self.transform
            .swept(radius, |to_world| self.placed_bounds(to_world))
    }

    /// World bounds under one map.
    fn placed_bounds(&self, to_world: &DAffine3) -> (DVec3, DVec3) {
        let rows = to_world.matrix3.transpose();
        let rows = [rows.x_axis, rows.y_axis, rows.z_axis];
        let (mut middle, mut half) = (DVec3::ZERO, DVec3::ONE);
        let reach = |f: &dyn Fn(DVec3) -> f64| DVec3::from(rows.map(f));
        let half = match &self.shape {
            Shape::Sphere => reach(&|r| r.length()),
            Shape::Disk { .. } => reach(&|r| r.truncate().length()),
            Shape::Quad => reach(&|r| r.x.abs() + r.y.abs()),
            Shape::Cylinder => reach(&|r| r.truncate().length() + r.z.abs()),
            Shape::Box => reach(&|r| r.abs().dot(half)),
            Shape::Mesh(_) | Shape::Deforming(_) => {
                let (low, high) = self.shape.bounds();
                (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
                reach(&|r| r.abs().dot(half))
            }
        };
        let middle = to_world.transform_point3(middle);
        (middle - half, middle + half)
    }
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

/// A point of the shape, in the world.
pub(super) fn to_world(id: InstanceId, placement: &Placement, point: &LocalPoint) -> SurfacePoint {
    let ng = placement.normal_to_world(point.ng);
    let ns = match point.ns.map(|n| placement.normal_to_world(n)) {
        Some(ns) if ns.is_finite() => {
            let side = ns.dot(ng);
            if side > 0.0 {
                ns
            } else if side < 0.0 {
                -ns
            } else {
                ng
            }
        }
        _ => ng,
    };
    SurfacePoint {
        p: placement.to_world.transform_point3(point.p),
        ng,
        ns,
        uv: point.uv,
        id: SurfaceId {
            instance: id,
            prim: point.prim,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::super::Mesh;
    use super::*;
    use glam::{DAffine3, DQuat, dvec3};
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

    fn shapes() -> [Shape; 6] {
        let disk = Shape::Disk { inner: 0.4 };
        [
            Shape::Sphere,
            disk,
            Shape::Quad,
            Shape::Cylinder,
            Shape::Box,
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
    fn the_density_of_area_samples_integrates_to_one_over_the_world_area() {
        for shape in shapes() {
            for scale in [DVec3::ONE, DVec3::splat(1e-3), dvec3(1.0, 3.0, -0.2)] {
                let instance = placed(shape.clone(), scale);
                let n = 200;
                let mut area = 0.0;
                for (u_face, u) in grid(n) {
                    let s = instance.sample_area(ID, 0.0, u_face, u);
                    let pdf = instance.pdf_area(&s.point, 0.0);
                    assert!((pdf / s.pdf_a - 1.0).abs() < 1e-12);
                    area += 1.0 / s.pdf_a;
                }
                let estimate = area / f64::from(n * n);
                let exact = instance.area(0.0);
                // A grid of 40000 points: the quadrature and the choice of faces err by less than 1e-3.
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
            let mut count = [0u32; 64];
            let random = |i: u64| crate::math::hash::unit_f64(crate::math::hash::random_bits(5, i));
            for i in 0..n {
                let u = DVec2::new(random(3 * i), random(3 * i + 1));
                let s = instance.sample_area(ID, 0.0, random(3 * i + 2), u);
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
                let inside = instance.transform.at(0.0).to_world.transform_point3(inside);
                for (u_face, u) in grid(20) {
                    let point = instance.sample_area(ID, 0.0, u_face, u).point;
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
                let (low, high) = instance.bounds();
                let size = (high - low).length();
                let (mut seen_low, mut seen_high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
                for (u_face, u) in grid(200) {
                    let p = instance.sample_area(ID, 0.0, u_face, u).point.p;
                    seen_low = seen_low.min(p);
                    seen_high = seen_high.max(p);
                }
                assert!((seen_low - low).min_element() > -1e-12 * size, "{shape:?}");
                assert!(
                    (high - seen_high).min_element() > -1e-12 * size,
                    "{shape:?}"
                );
                if !matches!(shape, Shape::Mesh(_)) {
                    assert!((seen_low - low).max_element() < 0.03 * size, "{shape:?}");
                }
            }
        }
    }
}
