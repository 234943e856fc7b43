//! Faces that chains go over: one that is smooth, with the media on its sides.

use super::ChainLink;
use crate::geometry::{AccelAt, Mesh, Placement, Shape, SurfaceId};
use crate::medium::MediumId;
use crate::optics::{LensSurface, Profile};
use crate::scene::{Scene, probe};
use glam::{DVec2, DVec3};

/// Triangles of a facet or of a mesh that are looked at.
const SAMPLED_TRIANGLES: usize = 8;
/// Relative height up to which a point lies in the plane of a face.
const ROUNDING: f64 = 1e-9;

/// A point on a face with its normal, in object space, and the triangle or other part it is on.
pub(super) type Sample = (DVec3, DVec3, u32);

/// A face with what it can do.
pub(super) struct Face {
    pub id: SurfaceId,
    pub shape: FaceShape,
    pub reflects: bool,
    pub transmits: bool,
    pub media: Vec<[MediumId; 2]>,
    /// Points on it, in the world, and its normal at the first.
    points: Vec<DVec3>,
    normal: DVec3,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum FaceShape {
    Flat,
    Ball,
    Tube,
    Lens,
    Smooth,
}

/// Points of a facet.
pub(super) fn facet_samples(mesh: &Mesh, triangles: &[u32]) -> Vec<Sample> {
    let of = |&prim: &u32| {
        let [a, b, c] = mesh.corners(prim, 0.0);
        let (middle, n) = ((a + b + c) / 3.0, mesh.geometric_normal(prim, 0.0));
        let near = [a, b, c].map(|corner| middle.lerp(corner, 0.9));
        [middle, near[0], near[1], near[2]].map(|p| (p, n, prim))
    };
    let some = triangles.iter().take(SAMPLED_TRIANGLES);
    some.flat_map(of).collect()
}

/// Points of a mesh that is one face.
pub(super) fn mesh_samples(mesh: &Mesh) -> Vec<Sample> {
    let count = mesh.triangle_count();
    let step = count.div_ceil(SAMPLED_TRIANGLES);
    let of = |prim: usize| {
        let prim = prim as u32;
        let [a, b, c] = mesh.corners(prim, 0.0);
        ((a + b + c) / 3.0, mesh.geometric_normal(prim, 0.0), prim)
    };
    (0..count).step_by(step).map(of).collect()
}

/// Points of face `prim` of other shapes.
pub(super) fn samples(shape: &Shape, prim: u32) -> Vec<Sample> {
    let points = points(shape, prim).into_iter();
    points.map(|(p, n)| (p, n, prim)).collect()
}

/// Points of face `prim` with their normals.
fn points(shape: &Shape, prim: u32) -> Vec<(DVec3, DVec3)> {
    let square = [
        (0.0, 0.0),
        (0.9, 0.9),
        (-0.9, 0.9),
        (0.9, -0.9),
        (-0.9, -0.9),
    ];
    let round = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
    match shape {
        Shape::Sphere => [1.0, -1.0]
            .into_iter()
            .flat_map(|s| DVec3::AXES.map(|a| (a * s, a * s)))
            .collect(),
        Shape::Cylinder => [-0.9, 0.9]
            .into_iter()
            .flat_map(|z| round.map(|(x, y)| (DVec3::new(x, y, z), DVec3::new(x, y, 0.0))))
            .collect(),
        Shape::Quad => square
            .map(|(x, y)| (DVec3::new(x, y, 0.0), DVec3::Z))
            .into(),
        Shape::Disk { inner } => {
            let r = 0.5 * (inner + 1.0);
            round
                .map(|(x, y)| (DVec3::new(x, y, 0.0) * r, DVec3::Z))
                .into()
        }
        Shape::Box => {
            let Some(n) = shape.face_normal(prim) else {
                return Vec::new();
            };
            let (u, v) = n.any_orthonormal_pair();
            square.map(|(x, y)| (n + u * x + v * y, n)).into()
        }
        // aspheric surfaces have no solver
        Shape::Lens(lens) if matches!(lens.surface().profile, Profile::Conic { .. }) => {
            let LensSurface {
                profile, aperture, ..
            } = lens.surface();
            let r = 0.5 * aperture.extent();
            round
                .map(|(x, y)| {
                    let p = aperture.center + DVec2::new(x, y) * r;
                    let [z, zx, zy] = profile.sag_and_slopes(p.x, p.y);
                    (p.extend(z), DVec3::new(-zx, -zy, 1.0).normalize())
                })
                .into()
        }
        Shape::Mesh(_) | Shape::Deforming(_) | Shape::Lens(_) => Vec::new(),
    }
}

impl Face {
    pub fn new(
        scene: &Scene,
        geometry: &AccelAt,
        id: SurfaceId,
        [reflects, transmits]: [bool; 2],
        (samples, is_smooth): (&[Sample], bool),
        placement: &Placement,
    ) -> Option<Self> {
        let object = scene.object(id.instance);
        let shape = &geometry.accel().instance(id.instance).shape;
        let world = |&(p, n, prim): &Sample| {
            (
                placement.to_world.transform_point3(p),
                placement.normal_to_world(n),
                prim,
            )
        };
        let points: Vec<Sample> = samples.iter().map(world).collect();
        let mut media: Vec<[MediumId; 2]> = Vec::new();
        for &(p, n, prim) in &points {
            let (ambient, on) = (MediumId::AMBIENT, SurfaceId { prim, ..id });
            let Some(above) = probe::stack_at(geometry, &scene.objects, p, n, Some(on), ambient)
            else {
                continue;
            };
            let Some(below) = above.crossed(object.boundary, id.instance, true) else {
                continue;
            };
            let pair = [above.medium(), below.medium()];
            if !media.contains(&pair) {
                media.push(pair);
            }
        }
        Some(Self {
            id,
            shape: match shape {
                Shape::Sphere => FaceShape::Ball,
                Shape::Cylinder => FaceShape::Tube,
                Shape::Lens(_) => FaceShape::Lens,
                Shape::Mesh(_) if is_smooth => FaceShape::Smooth,
                _ => FaceShape::Flat,
            },
            reflects,
            transmits,
            media,
            normal: points.first()?.1,
            points: points.into_iter().map(|p| p.0).collect(),
        })
    }

    /// Every way to be a vertex of a chain under one label.
    pub fn links(&self, transmits: bool) -> impl Iterator<Item = ChainLink> {
        let can = if transmits {
            self.transmits
        } else {
            self.reflects
        };
        let bends = move |m: &&[MediumId; 2]| !transmits || m[0] != m[1];
        let pairs = self.media.iter().filter(bends).filter(move |_| can);
        pairs.flat_map(move |&media| {
            [true, false].map(|from_above| ChainLink {
                id: self.id,
                transmits,
                from_above,
                media,
            })
        })
    }

    /// Whether any point of a box in the world is before this flat face, on the side `above`.
    pub fn has_before(&self, (low, high): (DVec3, DVec3), above: bool) -> bool {
        let (middle, half) = ((low + high) / 2.0 - self.points[0], (high - low) / 2.0);
        let height = middle.dot(self.normal);
        let height = if above { height } else { -height };
        height + half.dot(self.normal.abs()) > ROUNDING * (middle.abs() + half).length()
    }

    /// Whether light that leaves this flat face by a link can go straight to another one and meet
    /// it by another.
    pub fn leads_to(&self, by: &ChainLink, other: &Self, link: &ChainLink) -> bool {
        self.id != other.id
            && by.after() == link.before()
            && self.faces(by.from_above != by.transmits, other, link.from_above)
    }

    /// Whether light can go from this flat face, left on the side `above`, straight to a point of
    /// another one that meets it on the side `met_above`.
    fn faces(&self, above: bool, other: &Self, met_above: bool) -> bool {
        let is_before = |from: &Self, p: &DVec3, above: bool| {
            let height = (*p - from.points[0]).dot(from.normal);
            if above { height > 0.0 } else { height < 0.0 }
        };
        other.points.iter().any(|p| is_before(self, p, above))
            && self.points.iter().any(|p| is_before(other, p, met_above))
    }
}
