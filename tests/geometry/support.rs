//! Shapes, placements and random numbers for the tests of geometry.

use abbe::geometry::{Accel, Instance, Mesh, Shape, Transform};
use abbe::math::hash;
use glam::{DAffine3, DMat3, DQuat, DVec3, dvec3};
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::Arc;

/// A fixed stream of random numbers.
pub struct Random(u64, u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed, 0)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.1 += 1;
        hash::unit_f64(hash::random_bits(self.0, self.1))
    }

    pub fn index(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    pub fn direction(&mut self) -> DVec3 {
        let z = 1.0 - 2.0 * self.unit();
        let (sin, cos) = (TAU * self.unit()).sin_cos();
        let r = (1.0 - z * z).sqrt();
        dvec3(r * cos, r * sin, z)
    }

    pub fn rotation(&mut self) -> DMat3 {
        let turn = TAU * self.unit();
        DMat3::from_quat(DQuat::from_axis_angle(self.direction(), turn))
    }
}

/// An icosphere of radius 1 with 20 · 4^level triangles and its edges.
pub fn icosphere(level: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut p: Vec<DVec3> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        p.extend([dvec3(0.0, a, b), dvec3(a, b, 0.0), dvec3(b, 0.0, a)]);
    }
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let near = |i: usize, j: usize| (p[i].distance(p[j]) - 2.0).abs() < 1e-9;
                if near(a, b) && near(b, c) && near(a, c) {
                    let out = (p[b] - p[a]).cross(p[c] - p[a]).dot(p[a]) > 0.0;
                    let (b, c) = if out { (b, c) } else { (c, b) };
                    faces.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    for v in &mut p {
        *v = v.normalize();
    }
    for _ in 0..level {
        let mut middle = HashMap::new();
        let mut split = |a: u32, b: u32, p: &mut Vec<DVec3>| {
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                p.push((p[a as usize] + p[b as usize]).normalize());
                p.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (
                    split(a, b, &mut p),
                    split(b, c, &mut p),
                    split(c, a, &mut p),
                );
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (p, faces)
}

pub fn mesh(points: &[DVec3], faces: &[[u32; 3]]) -> Mesh {
    let positions: Vec<[f32; 3]> = points.iter().map(|p| p.as_vec3().to_array()).collect();
    Mesh::new(&positions, None, None, faces.to_vec()).expect("a valid mesh")
}

pub fn ball(level: u32) -> Shape {
    let (points, faces) = icosphere(level);
    Shape::Mesh(Arc::new(mesh(&points, &faces)))
}

pub fn scene(parts: &[(&Shape, DAffine3)]) -> Accel {
    let instance = |(shape, to_world): &(&Shape, DAffine3)| Instance {
        shape: (*shape).clone(),
        transform: Transform::fixed(*to_world),
    };
    Accel::build(parts.iter().map(instance).collect())
}
