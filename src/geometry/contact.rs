//! Contacts: where surfaces of two instances may be in the same place over an area, found once for
//! a scene.
//!
//! Rays ask for the other faces in a place ([`AccelAt::coincident`]) only inside the boxes found
//! here, so that a scene in which nothing touches pays nothing. Boxes therefore hold all contacts
//! of an area, and may hold more: for flat faces they are exact, two spheres or cylinders are
//! compared as wholes, and where something moves, or where comparing all faces would take too long,
//! all that the bounds share counts. A flat face and a curved one, or two curved ones that are not
//! the same, share no area.
//!
//! [`AccelAt::coincident`]: super::AccelAt::coincident

use super::coincident::{MOST_FACES, coincidence_distance};
use super::motion::Placement;
use super::{Accel, Instance, InstanceId, Ray, Shape, analytic};
use crate::optics::Outline;
use arrayvec::ArrayVec;
use glam::{DAffine3, DVec2, DVec3};

/// How much farther apart faces are taken to touch here than rays find them in the same place:
/// boxes hold the rest.
const MARGIN: f64 = 4.0;
/// Most faces listed, and most pairs of them compared, in a whole scene.
const BUDGET: usize = 20_000_000;
/// Most pairs of instances whose bounds have something in common.
const MOST_OVERLAPS: usize = 1 << 25;
/// Most pairs of instances that touch.
pub const MOST_CONTACTS: usize = 1_000_000;

/// A box in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Least coordinates.
    pub low: DVec3,
    /// Largest coordinates.
    pub high: DVec3,
}

impl Region {
    fn new((low, high): (DVec3, DVec3)) -> Self {
        Self { low, high }
    }

    fn around(points: &[DVec3]) -> Self {
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let grow = |(low, high): (DVec3, DVec3), p: &DVec3| (low.min(*p), high.max(*p));
        Self::new(points.iter().fold(start, grow))
    }

    /// Whether it holds `p`.
    #[must_use]
    #[inline]
    pub fn contains(&self, p: DVec3) -> bool {
        p.cmpge(self.low).all() && p.cmple(self.high).all()
    }

    /// Intersection of both, each grown by `margin` in all directions.
    #[must_use]
    pub fn common(&self, other: &Self, margin: f64) -> Option<Self> {
        let low = self.low.max(other.low) - margin;
        let high = self.high.min(other.high) + margin;
        low.cmple(high).all().then_some(Self { low, high })
    }

    /// The box around both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }
}

/// Most regions kept apart; beyond, they become one.
const MOST_REGIONS: usize = 8;

/// Adds a region to those where something touches; regions that overlap become one.
pub fn add_region(regions: &mut Vec<Region>, mut region: Region) {
    while let Some(i) = regions
        .iter()
        .position(|r| r.common(&region, 0.0).is_some())
    {
        region = region.union(&regions.swap_remove(i));
    }
    regions.push(region);
    if regions.len() > MOST_REGIONS {
        let all = regions.drain(..).reduce(|a, b| a.union(&b));
        regions.extend(all);
    }
}

/// Two instances that touch, or may touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// The instances, the earlier one first.
    pub pair: [InstanceId; 2],
    /// Where.
    pub regions: Vec<Region>,
    /// Whether they are known to touch; else it was not looked at closely.
    pub certain: bool,
}

/// Too many instances are in one place; two of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyContacts(pub [InstanceId; 2]);

/// All contacts of a scene, whose `overlaps` are known.
///
/// # Errors
/// There are more than [`MOST_CONTACTS`].
pub fn contacts(
    accel: &Accel,
    overlaps: &[[InstanceId; 2]],
) -> Result<Vec<Contact>, TooManyContacts> {
    let (mut budget, mut found) = (BUDGET, Vec::new());
    for &pair in overlaps {
        if let Some(contact) = contact(accel, pair, &mut budget) {
            if found.len() == MOST_CONTACTS {
                return Err(TooManyContacts(pair));
            }
            found.push(contact);
        }
    }
    Ok(found)
}

/// Two of the surfaces in a place where more touch than are told apart ([`MOST_FACES`]). It is
/// looked for in the middle and at the lowest corner of each contact that is known.
#[must_use]
pub fn crowd(accel: &Accel, contacts: &[Contact]) -> Option<[InstanceId; 2]> {
    let mut partners = vec![0; accel.instances().len()];
    let certain = || contacts.iter().filter(|contact| contact.certain);
    for id in certain().flat_map(|contact| contact.pair) {
        partners[id.0 as usize] += 1;
    }
    let crowded = certain().filter(|contact| {
        let enough = |id: InstanceId| partners[id.0 as usize] >= MOST_FACES;
        let mut inside = contact.regions.iter().flat_map(|region| {
            let extent = region.high - region.low;
            [0.5, 1e-6].map(|share| (region.low + share * extent, extent))
        });
        contact.pair.into_iter().all(enough)
            && inside.any(|(p, extent)| is_crowded(accel, contact.pair[1], p, extent))
    });
    crowded.map(|contact| contact.pair).next()
}

/// Whether more surfaces than are told apart are where `id` is met across the thinnest side of a
/// box of this extent.
fn is_crowded(accel: &Accel, id: InstanceId, p: DVec3, extent: DVec3) -> bool {
    let axis = DVec3::AXES
        .into_iter()
        .min_by(|a, b| a.dot(extent).total_cmp(&b.dot(extent)))
        .unwrap_or(DVec3::Z);
    let reach = p.abs().max_element() * 1e-6 + extent.max_element() * 1e-3;
    let ray = Ray::new(p - axis * reach, axis).ending(2.0 * reach, None);
    let accel = accel.at(0.0);
    let hit = accel.closest(&ray, |met| met == id);
    hit.is_some_and(|hit| accel.coincident(&accel.surface(&ray, &hit)).len() > MOST_FACES)
}

/// Pairs of instances whose bounds have something in common, the earlier one first.
///
/// # Errors
/// There are more than any scene has whose parts are apart.
pub fn overlaps(instances: &[Instance]) -> Result<Vec<[InstanceId; 2]>, TooManyContacts> {
    let boxes: Vec<Region> = instances.iter().map(|i| Region::new(i.bounds())).collect();
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    order.sort_by(|&a, &b| boxes[a as usize].low.x.total_cmp(&boxes[b as usize].low.x));
    let (mut active, mut found): (Vec<u32>, _) = (Vec::new(), Vec::new());
    for b in order {
        let region = boxes[b as usize];
        let margin = margin(&region);
        active.retain(|&a| boxes[a as usize].high.x + margin >= region.low.x);
        for &a in &active {
            if boxes[a as usize].common(&region, margin).is_some() {
                let pair = [InstanceId(a.min(b)), InstanceId(a.max(b))];
                if found.len() == MOST_OVERLAPS {
                    return Err(TooManyContacts(pair));
                }
                found.push(pair);
            }
        }
        active.push(b);
    }
    found.sort_unstable();
    Ok(found)
}

/// More than the rounding error of a coordinate of a box.
fn margin(region: &Region) -> f64 {
    256.0 * f64::EPSILON * region.low.abs().max(region.high.abs()).max_element()
}

fn contact(accel: &Accel, pair: [InstanceId; 2], budget: &mut usize) -> Option<Contact> {
    let [a, b] = pair.map(|id| accel.instance(id));
    let [box_a, box_b] = [a, b].map(|i| Region::new(i.bounds()));
    let common = box_a.common(&box_b, margin(&box_a).max(margin(&box_b)))?;
    let found = |regions, certain| {
        Some(Contact {
            pair,
            regions,
            certain,
        })
    };
    if a.is_moving() || b.is_moving() {
        return found(vec![common], false);
    }
    if is_curved(&a.shape) || is_curved(&b.shape) {
        return (is_same_surface(a, b))
            .then_some(())
            .and_then(|()| found(vec![common], true));
    }
    let (Some(mut few), Some(mut many)) = (
        Polygon::all(a, &common, budget),
        Polygon::all(b, &common, budget),
    ) else {
        return found(vec![common], false);
    };
    if few.len() > many.len() {
        std::mem::swap(&mut few, &mut many);
    }
    many.sort_by(|a, b| a.region.low.x.total_cmp(&b.region.low.x));
    let widest = many.iter().map(|p| p.region.high.x - p.region.low.x);
    let widest = widest.fold(0.0, f64::max);
    let mut regions = Vec::new();
    for face in &few {
        let near = face.region.low.x - widest - face.distance * 2.0;
        let first = many.partition_point(|p| p.region.low.x < near);
        for other in &many[first..] {
            if other.region.low.x > face.region.high.x + face.distance + other.distance {
                break;
            }
            if *budget == 0 {
                return found(vec![common], false);
            }
            *budget -= 1;
            if let Some(region) = face.touch(other) {
                add_region(&mut regions, region);
            }
        }
    }
    (!regions.is_empty()).then(|| found(regions, true))?
}

fn is_curved(shape: &Shape) -> bool {
    match shape {
        Shape::Sphere | Shape::Cylinder => true,
        Shape::Lens(lens) => !lens.surface().profile.is_plane(),
        _ => false,
    }
}

/// Whether two curved shapes are pieces of one surface: the map from one to the other keeps what
/// makes them.
fn is_same_surface(a: &Instance, b: &Instance) -> bool {
    let (from, to) = (a.transform.at(0.0), b.transform.at(0.0));
    let map = to.to_object * from.to_world;
    let m = map.matrix3;
    // far from the origin, the map is known to the rounding of the place
    let far = from.to_world.translation.abs().max_element();
    let size = from.to_world.matrix3.x_axis.length();
    let tolerance = 1e3 * f64::EPSILON * (1.0 + far / size);
    let is_zero = |x: f64| x.abs() <= tolerance;
    let (x, y, z, t) = (m.x_axis, m.y_axis, m.z_axis, map.translation);
    match (&a.shape, &b.shape) {
        (Shape::Sphere, Shape::Sphere) => {
            is_zero(t.length())
                && [x, y, z].iter().all(|v| is_zero(v.length() - 1.0))
                && [x.dot(y), y.dot(z), z.dot(x)].into_iter().all(is_zero)
        }
        (Shape::Cylinder, Shape::Cylinder) => {
            let around = DVec2::new(t.x, t.y).length() + DVec2::new(z.x, z.y).length();
            let (x, y) = (x.truncate(), y.truncate());
            is_zero(around)
                && is_zero(x.length() - 1.0)
                && is_zero(y.length() - 1.0)
                && is_zero(x.dot(y))
        }
        (Shape::Lens(a), Shape::Lens(b)) => {
            let kept = (x - DVec3::X).length() + (y - DVec3::Y).length() + (z - DVec3::Z).length();
            // the map is in millimeters here, the rounding in units of the shape
            let moved = t.length() / a.extent();
            a.surface().profile == b.surface().profile && is_zero(kept) && is_zero(moved)
        }
        _ => false,
    }
}

/// A flat convex face in the world.
struct Polygon {
    corners: ArrayVec<DVec3, 4>,
    normal: DVec3,
    region: Region,
    /// Within which another face touches it.
    distance: f64,
    /// The part of it that is there, where that is round.
    ring: Option<Ring>,
}

/// Area between two circles about one center.
#[derive(Clone, Copy, Debug)]
struct Ring {
    center: DVec3,
    inner: f64,
    outer: f64,
}

impl Ring {
    /// That of a flat shape in the world, where it is one and stays round.
    fn of(shape: &Shape, to_world: &DAffine3) -> Option<Self> {
        let (center, inner, outer) = match shape {
            Shape::Disk { inner } => (DVec2::ZERO, *inner, 1.0),
            Shape::Lens(lens) => {
                let aperture = &lens.surface().aperture;
                let (inner, outer) = match aperture.outline {
                    Outline::Circle { radius } => (0.0, radius),
                    Outline::Annulus { inner, outer } => (inner, outer),
                    Outline::Open | Outline::Rectangle { .. } => return None,
                };
                (aperture.center, inner, outer)
            }
            _ => return None,
        };
        let (x, y) = (to_world.matrix3.x_axis, to_world.matrix3.y_axis);
        let size = x.length();
        let tolerance = 64.0 * f64::EPSILON * size;
        let is_round = (y.length() - size).abs() <= tolerance && x.dot(y).abs() <= tolerance * size;
        is_round.then(|| Self {
            center: to_world.transform_point3(center.extend(0.0)),
            inner: size * inner,
            outer: size * outer,
        })
    }

    /// Whether two in one plane have no area in common.
    fn is_apart(&self, other: &Self, distance: f64) -> bool {
        let between = self.center.distance(other.center);
        let in_hole = |a: &Self, b: &Self| between + a.outer <= b.inner + distance;
        between + distance >= self.outer + other.outer
            || in_hole(self, other)
            || in_hole(other, self)
    }
}

impl Polygon {
    /// The faces of an instance that reach into `part`; `None` if that takes more than the budget.
    fn all(instance: &Instance, part: &Region, budget: &mut usize) -> Option<Vec<Self>> {
        let placement = instance.transform.at(0.0);
        let extent = instance.shape.extent();
        let mut faces = Vec::new();
        let ring = Ring::of(&instance.shape, &placement.to_world);
        let mut add = |corners: &[DVec3]| {
            let corners: ArrayVec<_, 4> = corners
                .iter()
                .map(|&p| placement.to_world.transform_point3(p))
                .collect();
            if let Some(face) = Self::new(corners, &placement, extent, ring)
                && face.region.common(part, face.distance).is_some()
            {
                faces.push(face);
            }
        };
        let square =
            |x: DVec3, y: DVec3, at: DVec3| [at - x - y, at + x - y, at + x + y, at - x + y];
        match &instance.shape {
            // of a disk, the square around it
            Shape::Disk { .. } | Shape::Quad => add(&square(DVec3::X, DVec3::Y, DVec3::ZERO)),
            // of a plane, the square around its aperture
            Shape::Lens(lens) => {
                let reach = lens.surface().aperture.extent();
                add(&square(DVec3::X * reach, DVec3::Y * reach, DVec3::ZERO));
            }
            Shape::Box => {
                for face in 0..6u32 {
                    let axis = (face / 2) as usize;
                    let (x, y) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
                    add(&square(x, y, analytic::cube_normal(face)));
                }
            }
            Shape::Mesh(mesh) => {
                let count = mesh.triangle_count();
                *budget = budget.checked_sub(count)?;
                (0..count as u32).for_each(|prim| add(&mesh.corners(prim, 0.0)));
            }
            Shape::Deforming(_) | Shape::Sphere | Shape::Cylinder => {}
        }
        Some(faces)
    }

    fn new(
        corners: ArrayVec<DVec3, 4>,
        placement: &Placement,
        extent: f64,
        ring: Option<Ring>,
    ) -> Option<Self> {
        let [a, b, c] = [corners[0], corners[1], corners[2]];
        let normal = (b - a).cross(c - a).try_normalize()?;
        let region = Region::around(&corners);
        let magnitude = region.low.abs().max(region.high.abs());
        let distance = MARGIN * coincidence_distance(placement, extent, magnitude, normal);
        Some(Self {
            corners,
            normal,
            region,
            distance,
            ring,
        })
    }

    /// Where two faces share an area.
    fn touch(&self, other: &Self) -> Option<Region> {
        let distance = self.distance + other.distance;
        let region = self.region.common(&other.region, distance)?;
        let flush = |a: &Self, b: &Self| {
            let off = |p: &DVec3| (*p - a.corners[0]).dot(a.normal).abs();
            b.corners.iter().map(off).fold(0.0, f64::max) <= distance
        };
        let rings_apart = || {
            let rings = self.ring.as_ref().zip(other.ring.as_ref());
            rings.is_some_and(|(a, b)| a.is_apart(b, distance))
        };
        let shares = (flush(self, other) || flush(other, self))
            && !self.is_apart(other, distance)
            && !other.is_apart(self, distance)
            && !rings_apart();
        shares.then_some(region)
    }

    /// Whether an edge of this face has the other face beyond it.
    fn is_apart(&self, other: &Self, distance: f64) -> bool {
        let ends = self.corners.iter().zip(self.corners.iter().cycle().skip(1));
        ends.into_iter().any(|(&a, &b)| {
            let Some(outward) = (b - a).cross(self.normal).try_normalize() else {
                return false;
            };
            let beyond = |p: &DVec3| (*p - a).dot(outward) >= -distance;
            other.corners.iter().all(beyond)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Mesh, Transform};
    use super::*;
    use glam::{DAffine3, DMat3, DQuat, dvec3};
    use std::sync::Arc;

    fn found(parts: &[(Shape, DAffine3)]) -> Vec<Contact> {
        let place = |(shape, map): &(Shape, DAffine3)| Instance {
            shape: shape.clone(),
            transform: Transform::fixed(*map),
        };
        let accel = Accel::build(parts.iter().map(place).collect());
        let overlaps = overlaps(accel.instances()).expect("few");
        contacts(&accel, &overlaps).expect("few")
    }

    #[test]
    fn rings_touch_where_they_share_an_area() {
        let disk = |inner| Shape::Disk { inner };
        let pair = |inner: f64, x: f64, size: f64| {
            let (one, two) = (at(0.2, 0.0, 3.0, 1.0), at(0.2 + x, 0.0, 3.0, size));
            found(&[(disk(inner), one), (disk(0.0), two)]).len()
        };
        // in the hole up to its edge, and beyond
        assert_eq!((pair(0.5, 0.0, 0.5), pair(0.5, 0.0, 0.501)), (0, 1));
        assert_eq!((pair(0.5, 0.2, 0.3), pair(0.5, 0.21, 0.3)), (0, 1));
        // side by side where the squares around them are not
        assert_eq!((pair(0.0, 1.5, 0.5), pair(0.0, 1.49, 0.5)), (0, 1));
        // a map that makes them oval is not looked at so closely
        let oval = DAffine3::from_scale(dvec3(0.4, 0.5, 1.0));
        let flat = [(disk(0.6), at(0.0, 0.0, 0.0, 1.0)), (disk(0.0), oval)];
        assert_eq!(found(&flat).len(), 1);
    }

    fn at(x: f64, y: f64, z: f64, scale: f64) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(
            DVec3::splat(scale),
            DQuat::IDENTITY,
            dvec3(x, y, z),
        )
    }

    #[test]
    fn flat_faces_touch_where_they_share_an_area() {
        for (scale, off) in [(1.0, 0.0), (1e-3, 1e4), (1e3, 1e4)] {
            let turned = DQuat::from_rotation_y(0.3);
            let frame = DAffine3::from_scale_rotation_translation(
                DVec3::splat(scale),
                turned,
                DVec3::splat(off),
            );
            let pair = |z: f64| {
                let block = frame * at(0.3, 0.1, z, 1.0);
                found(&[
                    (Shape::Quad, frame * at(0.0, 0.0, 0.0, 5.0)),
                    (Shape::Box, block),
                ])
            };
            let touching = pair(1.0);
            assert_eq!(touching.len(), 1, "{scale} {off}");
            assert!(touching[0].certain);
            let p = frame.transform_point3(dvec3(0.3, 0.1, 0.0));
            assert!(touching[0].regions[0].contains(p));
            assert!(!touching[0].regions[0].contains(frame.transform_point3(dvec3(4.0, 0.0, 0.0))));
            let gap = 1e-9f64.max(1e-9 * off / scale);
            assert!(pair(1.0 + gap).is_empty(), "{scale} {off}");
            assert!(pair(1.0 - gap).is_empty(), "{scale} {off}");
            // neighbors in one plane share an edge only
            let tile = |x: f64| (Shape::Quad, frame * at(x, 0.0, 0.0, 1.0));
            assert!(found(&[tile(0.0), tile(2.0)]).is_empty());
            assert_eq!(found(&[tile(0.0), tile(1.9)]).len(), 1);
        }
    }

    #[test]
    fn curved_surfaces_touch_where_they_are_the_same() {
        let ball = |map| (Shape::Sphere, map);
        let turned = DAffine3::from_quat(DQuat::from_rotation_x(1.0));
        assert_eq!(
            found(&[
                ball(at(3.0, 0.0, 0.0, 2.0)),
                ball(at(3.0, 0.0, 0.0, 2.0) * turned)
            ])
            .len(),
            1
        );
        assert!(found(&[ball(at(0.0, 0.0, 0.0, 2.0)), ball(at(0.0, 0.0, 0.1, 2.0))]).is_empty());
        assert!(
            found(&[
                ball(at(0.0, 0.0, 1.0, 1.0)),
                (Shape::Quad, DAffine3::IDENTITY)
            ])
            .is_empty()
        );
        let longer = DAffine3::from_mat3(DMat3::from_diagonal(dvec3(1.0, 1.0, 3.0)));
        let tube = |map| (Shape::Cylinder, map);
        assert_eq!(found(&[tube(DAffine3::IDENTITY), tube(longer)]).len(), 1);
    }

    #[test]
    fn triangles_are_compared_one_by_one() {
        let triangle = |p: [[f32; 3]; 3]| {
            let mesh = Mesh::new(&p, None, None, vec![[0, 1, 2]]).expect("valid");
            (Shape::Mesh(Arc::new(mesh)), DAffine3::IDENTITY)
        };
        let low = triangle([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let high = triangle([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        let across = triangle([[0.5, 0.5, 0.0], [1.0, 1.0, 0.0], [0.0, 0.5, 0.0]]);
        assert!(found(&[low.clone(), high.clone()]).is_empty());
        assert_eq!(found(&[low, across.clone()]).len(), 1);
        assert_eq!(found(&[high, across]).len(), 1);
    }

    #[test]
    fn what_touches_in_two_places_leaves_the_way_between_them() {
        let corners = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
        let p = [corners(-4.0), corners(3.0)].concat();
        let mesh = Mesh::new(&p, None, None, vec![[0, 1, 2], [3, 4, 5]]).expect("valid");
        let floor = (Shape::Quad, at(0.0, 0.0, 0.0, 5.0));
        let touching = found(&[floor, (Shape::Mesh(Arc::new(mesh)), DAffine3::IDENTITY)]);
        let held = |p: DVec3| touching[0].regions.iter().any(|r| r.contains(p));
        assert!(held(dvec3(-3.8, 0.1, 0.0)) && held(dvec3(3.2, 0.1, 0.0)));
        assert!(!held(dvec3(0.0, 0.1, 0.0)));
    }
}
