//! Segments together against each by itself, among shapes of all kinds: the same answers.

use super::*;
use crate::geometry::deforming::{self, KeyFrame};
use crate::geometry::pose::{Pose, Rotation};
use crate::geometry::track::{Interpolation, Track};
use crate::geometry::{
    Accel, Instance, LensShape, Link, Mesh, Moment, Placements, Shutter, Transform,
};
use crate::math::hash::{random_bits, unit_f64};
use crate::math::sampling::uniform_sphere;
use crate::optics::{Aperture, LensSurface, Profile};
use glam::{DAffine3, DQuat, DVec3};
use std::f64::consts::TAU;
use std::sync::Arc;

const SHUTTER: Shutter = Shutter {
    open_s: 0.0,
    close_s: 1.0,
};
/// Instances that move.
const MOVING: usize = 2;

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 += 1;
        unit_f64(random_bits(23, self.0))
    }

    fn direction(&mut self) -> DVec3 {
        uniform_sphere([self.unit(), self.unit()])
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 3.0 - 1.5
    }

    fn map(&mut self) -> DAffine3 {
        let size = DVec3::new(self.unit(), self.unit(), self.unit()) * 0.3 + 0.2;
        let turn = DQuat::from_axis_angle(self.direction(), TAU * self.unit());
        DAffine3::from_scale_rotation_translation(size, turn, self.point() * 0.8)
    }
}

/// A thousand triangles of no order within the unit cube.
fn triangles(random: &mut Random) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut positions = Vec::new();
    for _ in 0..1000 {
        let middle = random.point() / 1.5;
        let mut corner = || middle + random.direction() * 0.05;
        positions.extend([corner(), corner(), corner()].map(|p| p.as_vec3().to_array()));
    }
    let indices = (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    (positions, indices)
}

/// Three of each kind of shape, and a mesh that moves as a whole and one that also changes its
/// form.
fn scene(random: &mut Random) -> Accel {
    let (positions, indices) = triangles(random);
    let mesh = Mesh::new(&positions, None, None, indices.clone()).expect("a mesh");
    let mesh = Shape::Mesh(Arc::new(mesh));
    let frame = |time_s: f64, random: &mut Random| KeyFrame {
        time_s,
        positions: positions
            .iter()
            .map(|p| p.map(|x| x + 0.1 * random.unit() as f32))
            .collect(),
        normals: None,
    };
    let frames = [0.0, 0.4, 1.0].map(|time_s| frame(time_s, random));
    let changing = deforming::shape(&frames, None, indices, SHUTTER).expect("a mesh");
    let lens = LensSurface::new(Profile::sphere(2.0), Aperture::circle(1.0));
    let shapes = [
        mesh.clone(),
        changing.clone(),
        Shape::Sphere,
        Shape::Disk { inner: 0.3 },
        Shape::Quad,
        Shape::Cylinder,
        Shape::Box,
        Shape::Lens(Arc::new(LensShape::new(lens).expect("a lens"))),
    ];
    let still = |shape: Shape, random: &mut Random| Instance {
        shape,
        transform: Transform::fixed(random.map()),
    };
    let mut instances: Vec<_> = shapes
        .iter()
        .flat_map(|shape| vec![shape.clone(); 3])
        .map(|shape| still(shape, random))
        .collect();
    for shape in [mesh, changing] {
        let turn = Track::new(&[(0.0, 0.0), (1.0, 2.0)], Interpolation::Linear);
        let spin = Link::Keyed(Pose {
            rotation: Some(Rotation::Spin {
                axis: random.direction(),
                angle_rad: turn.expect("a track"),
            }),
            ..Pose::default()
        });
        let transform = Transform::chain(&[Link::Fixed(random.map()), spin], SHUTTER);
        instances.push(Instance { shape, transform });
    }
    let mut next = 0;
    for instance in &mut instances {
        instance.transform.enumerate(&mut next);
    }
    assert_eq!(next, MOVING);
    Accel::build(instances)
}

/// Segments between two hits, from one on, or up to one, from anywhere; some are no segments.
fn segment(at: &AccelAt, random: &mut Random) -> Ray {
    let mut end = || {
        let from = random.point();
        let ray = Ray::new(from, random.direction());
        let hit = at.closest(&ray, |_| true);
        let kind = (random.unit() * 20.0) as u32;
        (
            hit.map_or((from, None), |hit| (at.surface(&ray, &hit).p, Some(hit.id))),
            kind,
        )
    };
    let ((a, start), kind) = end();
    let ((b, end), _) = end();
    let length = (b - a).length();
    match kind {
        0 => Ray::new(a, DVec3::NAN),
        1 => Ray::new(a * 1e3, (a - b) / length),
        2..8 => Ray::leaving(a, (b - a) / length, start),
        _ => Ray::leaving(a, (b - a) / length, start).ending(length, end),
    }
}

fn compare<'a>(accel: &'a Accel, moment: Moment<'a>, random: &mut Random) -> [usize; 2] {
    let at = accel.at(moment);
    let mut counts = [0; 2];
    for count in [0, 1, 2, 7, MOST, MOST + 1, 50, 200] {
        let segments: Vec<Ray> = (0..count).map(|_| segment(&at, random)).collect();
        let (hides, passes) = (random.unit() * 0.3, random.unit());
        let has = |stream, InstanceId(id): InstanceId, share: f64| {
            unit_f64(random_bits(stream, u64::from(id))) < share
        };
        let visible = |id| !has(1, id, hides);
        let stops = |id| !has(2, id, passes);
        // what was known before is no answer
        let mut stopped = vec![true; count];
        let mut last = vec![false; count];
        let ask = |i: usize, id: InstanceId| {
            assert!(visible(id) && !last[i], "not asked about");
            last[i] = stops(id);
            last[i]
        };
        at.any_each(&segments, visible, ask, &mut stopped);
        let mut occluded = vec![true; count];
        at.occluded_each(&segments, visible, &mut occluded);
        for (i, ray) in segments.iter().enumerate() {
            assert_eq!(occluded[i], at.occluded(ray, visible), "{ray:?}");
            assert_eq!(stopped[i], at.any(ray, visible, stops), "{ray:?}");
            counts[usize::from(stopped[i])] += 1;
        }
    }
    counts
}

#[test]
fn many_segments_are_answered_like_each_by_itself() {
    let mut random = Random(0);
    let mut placements = Placements::default();
    let mut counts = [0; 2];
    for _ in 0..4 {
        let accel = scene(&mut random);
        let meshes = accel.instances().iter().filter(|i| i.shape.takes_turns());
        assert_eq!(meshes.count(), 6 + MOVING);
        for _ in 0..5 {
            let time = random.unit();
            // with and without a memory for placements
            for moment in [placements.at(time, MOVING), Moment::from(time)] {
                let [open, stopped] = compare(&accel, moment, &mut random);
                counts = [counts[0] + open, counts[1] + stopped];
            }
        }
    }
    assert!(counts.iter().all(|&count| count > 2000), "{counts:?}");
}

#[test]
fn nothing_is_in_the_way_where_nothing_is() {
    let accel = Accel::build(Vec::new());
    let mut occluded = [true; 3];
    let segments = [Ray::new(DVec3::ZERO, DVec3::X); 3];
    accel
        .at(0.0)
        .occluded_each(&segments, |_| true, &mut occluded);
    assert_eq!(occluded, [false; 3]);
}
