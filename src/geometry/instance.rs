//! One placed shape: bounds, area, and sampling by area.
//!
//! A map with matrix M stretches the area about a point with unit object normal n by |det M| |M^-T n|. Points are sampled uniformly over the
//! object-space area, so the density per world area is 1 / (object area · stretch) under any affine map.

use super::motion::Placement;
use super::shape::{AreaSample, LocalPoint};
use super::{Shape, SurfaceId, SurfacePoint, Transform};
use glam::{DMat3, DVec2, DVec3};
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
            return self.shape.area() * stretch(DVec3::Z);
        }
        let steps = |n: u32| (0..n).map(move |i| (f64::from(i) + 0.5) / f64::from(n));
        let ring = |u: f64, z: f64| {
            let (sin, cos) = (TAU * u).sin_cos();
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * cos, r * sin, z)
        };
        match &self.shape {
            Shape::Disk { .. } | Shape::Quad => self.shape.area() * stretch(DVec3::Z),
            Shape::Box => DVec3::AXES.iter().map(|&n| 8.0 * stretch(n)).sum(),
            Shape::Cylinder => {
                let n = AREA_STEPS * AREA_STEPS;
                steps(n).map(|u| stretch(ring(u, 0.0))).sum::<f64>() / f64::from(n)
                    * self.shape.area()
            }
            Shape::Sphere => {
                let sum: f64 = steps(AREA_STEPS)
                    .flat_map(|v| steps(AREA_STEPS).map(move |u| ring(u, 1.0 - 2.0 * v)))
                    .map(stretch)
                    .sum();
                sum / f64::from(AREA_STEPS).powi(2) * self.shape.area()
            }
            Shape::Mesh(mesh) => mesh.mapped_area(placement.to_world.matrix3),
        }
    }

    /// A point by area: `u` in [0,1)², `u_face` chooses the face or triangle. Takes constant time (the first call on
    /// a mesh builds its table of areas).
    #[must_use]
    pub fn sample_area(&self, id: InstanceId, time: f64, u_face: f64, u: DVec2) -> AreaSample {
        let placement = self.transform.at(time);
        let point = to_world(id, &placement, &self.shape.sample(u_face, u));
        AreaSample {
            point,
            pdf_a: self.density(&placement, point.ng),
        }
    }

    /// The density per world area with which `sample_area` generates `point`.
    #[must_use]
    pub fn pdf_area(&self, point: &SurfacePoint, time: f64) -> f64 {
        self.density(&self.transform.at(time), point.ng)
    }

    fn density(&self, placement: &Placement, ng: DVec3) -> f64 {
        1.0 / (self.shape.area() * area_stretch(placement, ng))
    }

    /// World bounds over the whole shutter.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let Transform::Static(placement) = &self.transform;
        let rows = placement.to_world.matrix3.transpose();
        let rows = [rows.x_axis, rows.y_axis, rows.z_axis];
        let (mut middle, mut half) = (DVec3::ZERO, DVec3::ONE);
        let reach = |f: &dyn Fn(DVec3) -> f64| DVec3::from(rows.map(f));
        let half = match &self.shape {
            Shape::Sphere => reach(&|r| r.length()),
            Shape::Disk { .. } => reach(&|r| r.truncate().length()),
            Shape::Quad => reach(&|r| r.x.abs() + r.y.abs()),
            Shape::Cylinder => reach(&|r| r.truncate().length() + r.z.abs()),
            Shape::Box | Shape::Mesh(_) => {
                if let Shape::Mesh(mesh) = &self.shape {
                    let (low, high) = mesh.bounds();
                    (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
                }
                reach(&|r| r.abs().dot(half))
            }
        };
        let middle = placement.to_world.transform_point3(middle);
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
