//! Gaps between surfaces that face each other on one axis, as in a stack of lenses: found once for
//! a scene, so that most rays that leave such a surface ask the next one alone.
//!
//! A gap is what lies between two surfaces of revolution, a conic or a plane each, within a
//! cylinder about their axis, where nothing else is but rings about the axis. A segment with its
//! ends on both surfaces and inside the cylinder stays in the cylinder, which is convex. Where it
//! meets neither surface, continued without an edge, in between, it stays in the gap; where it
//! also passes through the holes of all rings, nothing is in its way. Any other ray is left to the
//! tree: what is found here is what the tree finds.

use super::instance::placed_box;
use super::ray::LocalRay;
use super::{Hit, Instance, InstanceId, Ray, Shape, SurfaceId, Transform};
use crate::math::predicates::transformed_error;
use crate::optics::{Outline, Profile};
use arrayvec::ArrayVec;
use glam::{DAffine3, DVec2, DVec3};

/// Most rings in a gap.
const MOST_RINGS: usize = 6;
/// Most comparisons of instances with gaps.
const BUDGET: usize = 10_000_000;
/// Steps of the square of the distance from the axis in which surfaces are told apart.
const STEPS: u32 = 256;
/// Error that places and lengths may have, in units of the size of a gap: far more than rounding.
const SLACK: f64 = 1e-7;

/// Space between two surfaces, in the space of the second one.
#[derive(Clone, Debug, PartialEq)]
struct Gap {
    /// The surface on the other side.
    to: InstanceId,
    to_object: DAffine3,
    /// Direction of its axis in the world, of any length.
    axis: DVec3,
    /// Bound of the rounding error of where rays start that leave the first surface in the gap.
    start_error: f64,
    /// Curvature and conic constant of the first surface and where its vertex is on the axis; of
    /// the second one, whose vertex is at 0.
    from_shape: (f64, f64, f64),
    to_shape: (f64, f64),
    /// Square of the radius of the cylinder.
    radius_squared: f64,
    rings: ArrayVec<Ring, MOST_RINGS>,
}

/// A flat ring about the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ring {
    z: f64,
    /// Square of the radius of its hole, less a little.
    hole_squared: f64,
}

/// All gaps of a scene.
#[derive(Debug, Default)]
pub(super) struct Gaps {
    gaps: Vec<Gap>,
    /// Of each instance, which gap is on the side of its +z and of its -z; [`NONE`]: none.
    of: Vec<[u32; 2]>,
}

const NONE: u32 = u32::MAX;

/// A conic about the axis of a gap.
struct Cap {
    z: f64,
    profile: Profile,
    /// Distance from the axis within which it is there.
    reach: f64,
}

impl Gaps {
    /// Those between the instances.
    pub fn new(instances: &[Instance]) -> Self {
        let lenses: Vec<usize> = (0..instances.len())
            .filter(|&i| matches!(instances[i].shape, Shape::Lens(_)) && is_at_rest(&instances[i]))
            .collect();
        let mut out = Self::default();
        if lenses.is_empty() {
            return out;
        }
        let mut budget = BUDGET;
        for (i, from) in instances.iter().enumerate() {
            let may_start = matches!(from.shape, Shape::Lens(_) | Shape::Quad) && is_at_rest(from);
            if !may_start {
                continue;
            }
            let mut nearest: [Option<(f64, usize)>; 2] = [None; 2];
            for &j in &lenses {
                if i == j || !spend(&mut budget, 1) {
                    continue;
                }
                let Some(cap) = cap_in(from, &instances[j]) else {
                    continue;
                };
                // the second surface lies on this side of the first
                let side = usize::from(cap.z > 0.0);
                let is_nearer = |&(z, _): &(f64, usize)| cap.z.abs() < z;
                if cap.z != 0.0 && nearest[side].as_ref().is_none_or(is_nearer) {
                    nearest[side] = Some((cap.z.abs(), j));
                }
            }
            for (side, found) in nearest.into_iter().enumerate() {
                let Some((_, j)) = found else { continue };
                if !spend(&mut budget, instances.len()) {
                    return out;
                }
                if let Some(gap) = gap(instances, i, j) {
                    out.of.resize(instances.len(), [NONE; 2]);
                    out.of[i][side] = out.gaps.len() as u32;
                    out.gaps.push(gap);
                }
            }
        }
        out
    }

    /// Whether there are any.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.gaps.is_empty()
    }

    /// Where an open ray that leaves an instance likely ends: the surface across the gap on this
    /// side, and what [`Crossing::is_free`] is asked then.
    #[inline(always)]
    pub fn ahead<'a>(&'a self, ray: &Ray, from: InstanceId) -> Option<Crossing<'a>> {
        let sides = self.of.get(from.0 as usize)?;
        if *sides == [NONE; 2] {
            return None;
        }
        // both gaps, where there are two, are about one axis
        let any = if sides[0] == NONE { sides[1] } else { sides[0] };
        let side = usize::from(self.gaps[any as usize].axis.dot(ray.d) < 0.0);
        let gap = self.gaps.get(sides[side] as usize)?;
        Some(Crossing {
            gap,
            o: gap.to_object.transform_point3(ray.o),
            d: gap.to_object.transform_vector3(ray.d),
        })
    }
}

/// A ray that leaves the first surface of a gap, in the space of the second one.
pub(super) struct Crossing<'a> {
    gap: &'a Gap,
    o: DVec3,
    d: DVec3,
}

impl Crossing<'_> {
    /// The surface on the other side.
    pub fn to(&self) -> InstanceId {
        self.gap.to
    }

    /// The hit of that surface at `t`.
    #[inline]
    pub fn hit(&self, t: f64) -> Hit {
        let id = SurfaceId {
            instance: self.gap.to,
            prim: 0,
        };
        let uv = DVec2::ZERO;
        Hit { t, id, uv }
    }

    /// Point of the ray in the space of that surface.
    #[inline]
    pub fn at(&self, t: f64) -> DVec3 {
        self.o + self.d * t
    }

    /// Curvature and conic constant of that surface.
    #[inline]
    pub fn shape(&self) -> (f64, f64) {
        self.gap.to_shape
    }

    /// The ray as that surface sees it.
    #[inline(always)]
    pub fn local<'a>(&'a self, ray: &'a Ray, extent: f64) -> LocalRay<'a> {
        let Gap {
            to_object,
            start_error,
            ..
        } = &self.gap;
        LocalRay::across(ray, (self.o, self.d), to_object, extent, *start_error)
    }

    /// Whether nothing is in the way to the hit of that surface at `t`.
    #[inline(always)]
    pub fn is_free(&self, t: f64) -> bool {
        let Gap {
            from_shape: (from_c, from_k, from_z),
            to_shape: (to_c, to_k),
            radius_squared,
            ..
        } = *self.gap;
        let (o, d) = (self.o, self.d);
        let flat = |p: DVec3| p.x * p.x + p.y * p.y;
        if !(flat(o) < radius_squared && flat(o + d * t) < radius_squared) {
            return false;
        }
        let apart = |other: f64| other < -SLACK * t || other > t * (1.0 + SLACK);
        // of the roots of both surfaces one is known each: where the ray starts, and where it ends
        let own = sum_of_roots(from_c, from_k, o - DVec3::Z * from_z, d);
        let next = sum_of_roots(to_c, to_k, o, d) - t;
        apart(own) && apart(next) && self.passes_rings(t)
    }

    /// Whether the way to `t` leads through the holes of all rings.
    #[inline(always)]
    fn passes_rings(&self, t: f64) -> bool {
        let (o, d) = (self.o, self.d);
        for ring in &self.gap.rings {
            let at = (ring.z - o.z) / d.z;
            let passes = at < -SLACK * t || at > t * (1.0 + SLACK);
            let p = o + d * at;
            if !(passes || p.x * p.x + p.y * p.y < ring.hole_squared) {
                return false;
            }
        }
        true
    }
}

/// Sum of both distances at which a line meets the quadric of curvature `c` and conic constant `k`
/// about the origin; infinite, of either sign, for a plane.
#[inline(always)]
fn sum_of_roots(c: f64, k: f64, o: DVec3, d: DVec3) -> f64 {
    let a = c * (d.length_squared() + k * d.z * d.z);
    let b = c * (o.dot(d) + k * o.z * d.z) - d.z;
    -2.0 * b / a
}

fn spend(budget: &mut usize, cost: usize) -> bool {
    let left = budget.checked_sub(cost);
    *budget = left.unwrap_or(0);
    left.is_some()
}

fn is_at_rest(instance: &Instance) -> bool {
    matches!(instance.transform, Transform::Static(_))
}

/// From the space of an instance to that of another, both at rest.
fn map_between(from: &Instance, to: &Instance) -> Option<DAffine3> {
    match (&from.transform, &to.transform) {
        (Transform::Static(from), Transform::Static(to)) => Some(to.to_object * from.to_world),
        _ => None,
    }
}

/// Whether a map keeps the axis z, and what is round about it.
fn keeps_axis(map: &DAffine3, size: f64) -> bool {
    let m = map.matrix3;
    let (scale, tolerance) = (m.x_axis.length(), 1e-3 * SLACK);
    let is_zero = |x: f64| x.abs() <= tolerance * scale;
    let round = is_zero(m.y_axis.length() - scale) && is_zero(m.x_axis.dot(m.y_axis) / scale);
    let upright = is_zero(m.z_axis.x) && is_zero(m.z_axis.y);
    let level = is_zero(m.x_axis.z) && is_zero(m.y_axis.z);
    let along = map.translation.truncate().length() <= tolerance * size;
    round && upright && level && along
}

/// A conic lens surface or a rectangle across the axis, in the space of another lens surface.
fn cap_in(instance: &Instance, of: &Instance) -> Option<Cap> {
    let map = map_between(instance, of)?;
    let Shape::Lens(other) = &of.shape else {
        return None;
    };
    let z = map.translation.z;
    let size = other.extent();
    if !matches!(other.surface().profile, Profile::Conic { .. }) {
        return None;
    }
    match &instance.shape {
        Shape::Lens(lens) => {
            let surface = lens.surface();
            let is_same = (map.matrix3.x_axis - DVec3::X).length() <= 1e-3 * SLACK
                && (map.matrix3.z_axis - DVec3::Z).length() <= 1e-3 * SLACK;
            let is_conic = matches!(surface.profile, Profile::Conic { .. });
            (is_same && is_conic && keeps_axis(&map, size)).then(|| Cap {
                z,
                profile: surface.profile.clone(),
                reach: surface.aperture.extent(),
            })
        }
        Shape::Quad => {
            let (x, y) = (map.matrix3.x_axis, map.matrix3.y_axis);
            let is_level = |v: DVec3| v.z.abs() <= 1e-3 * SLACK * v.length();
            let corner = |a: f64, b: f64| (map.translation + x * a + y * b).truncate().length();
            let reach = corner(1.0, 1.0)
                .max(corner(1.0, -1.0))
                .max(corner(-1.0, 1.0))
                .max(corner(-1.0, -1.0));
            (is_level(x) && is_level(y) && x.cross(y).length() > 0.0).then_some(Cap {
                z,
                profile: Profile::PLANE,
                reach,
            })
        }
        _ => None,
    }
}

/// The gap from instance `i` to the lens surface `j`, if it is one.
fn gap(instances: &[Instance], i: usize, j: usize) -> Option<Gap> {
    let to = &instances[j];
    let from = cap_in(&instances[i], to)?;
    let Shape::Lens(lens) = &to.shape else {
        return None;
    };
    let second = Cap {
        z: 0.0,
        profile: lens.surface().profile.clone(),
        reach: lens.surface().aperture.extent(),
    };
    let domain = from
        .profile
        .domain_radius()
        .min(second.profile.domain_radius());
    let others = || (0..instances.len()).filter(|&k| k != i && k != j);
    // which side of the second surface the first one is on, everywhere: to the edge of the wider
    // one, or of the narrower one
    let behind = from.z < 0.0;
    let widths = [from.reach.max(second.reach), from.reach.min(second.reach)];
    let mut radius = widths
        .map(|width| width.min(domain * (1.0 - SLACK)))
        .into_iter()
        .find(|&r| r > 0.0 && is_beyond(&from, &second, r, [0.0, r], SLACK * r, behind))?;
    let margin = SLACK * radius;
    let bounds = |cap: &Cap| {
        let sag = cap.profile.sag_between([0.0, radius * radius]);
        [cap.z + sag[0], cap.z + sag[1]]
    };
    let (a, b) = (bounds(&from), bounds(&second));
    let low = DVec3::new(-radius, -radius, a[0].min(b[0])) - margin;
    let high = DVec3::new(radius, radius, a[1].max(b[1])) + margin;
    let near: Vec<&Instance> = others()
        .map(|k| &instances[k])
        .filter(|other| reaches_into(other, to, low, high))
        .collect();
    let size = radius;
    for other in &near {
        if let Some(tube) = tube_in(other, to, size) {
            radius = radius.min(tube * (1.0 - SLACK));
        }
    }
    let mut rings = ArrayVec::new();
    for other in near {
        if tube_in(other, to, size).is_some() {
            continue;
        }
        let (cap, hole) = round_in(other, to)?;
        let span = [hole, cap.reach];
        let is_outside = hole >= radius + margin
            || is_beyond(&cap, &from, radius, span, margin, behind)
            || is_beyond(&cap, &second, radius, span, margin, !behind);
        if is_outside {
            continue;
        }
        if !cap.profile.is_plane() || hole <= margin {
            return None;
        }
        let ring = Ring {
            z: cap.z,
            hole_squared: (hole - margin) * (hole - margin),
        };
        rings.try_push(ring).ok()?;
    }
    let Transform::Static(placement) = &to.transform else {
        return None;
    };
    let (from_c, from_k) = from.profile.base();
    let (middle, half) = placed_box(&placement.to_world, (low, high));
    let farthest = middle.abs() + half;
    Some(Gap {
        to: InstanceId(j as u32),
        to_object: placement.to_object,
        axis: placement.to_object.matrix3.transpose().z_axis,
        start_error: 2.0 * transformed_error(&placement.to_object, farthest, lens.extent()),
        from_shape: (from_c, from_k, from.z),
        to_shape: second.profile.base(),
        radius_squared: radius * radius,
        rings,
    })
}

/// Whether, at all distances from the axis in `span` and within `radius`, one surface lies on the
/// far side of another: at smaller z where `below`, else at larger ones.
fn is_beyond(
    cap: &Cap,
    other: &Cap,
    radius: f64,
    span: [f64; 2],
    margin: f64,
    below: bool,
) -> bool {
    let [inner, outer] = [span[0], span[1].min(radius)].map(|r| r * r);
    let step = (outer - inner) / f64::from(STEPS);
    (0..STEPS).all(|i| {
        let u = [i, i + 1].map(|i| inner + step * f64::from(i));
        let sag = |cap: &Cap| cap.profile.sag_between(u).map(|sag| cap.z + sag);
        let (one, two) = (sag(cap), sag(other));
        if below {
            one[1] + margin < two[0]
        } else {
            one[0] > two[1] + margin
        }
    })
}

/// Radius of a cylinder about the axis of a lens surface, where that is all of an instance; `size`
/// is that of the gap.
fn tube_in(instance: &Instance, of: &Instance, size: f64) -> Option<f64> {
    if !matches!(instance.shape, Shape::Cylinder) {
        return None;
    }
    let map = map_between(instance, of)?;
    keeps_axis(&map, size).then(|| map.matrix3.x_axis.length())
}

/// A conic or a plane about the axis of a lens surface, and the radius of its hole.
fn round_in(instance: &Instance, of: &Instance) -> Option<(Cap, f64)> {
    match &instance.shape {
        Shape::Lens(lens) => {
            let aperture = &lens.surface().aperture;
            let hole = match aperture.outline {
                Outline::Circle { .. } => 0.0,
                Outline::Annulus { inner, .. } => inner,
                Outline::Open | Outline::Rectangle { .. } => return None,
            };
            if aperture.center != DVec2::ZERO {
                return None;
            }
            Some((cap_in(instance, of)?, hole))
        }
        Shape::Disk { inner } => {
            let map = map_between(instance, of)?;
            let Shape::Lens(lens) = &of.shape else {
                return None;
            };
            let reach = map.matrix3.x_axis.length();
            keeps_axis(&map, lens.extent()).then_some((
                Cap {
                    z: map.translation.z,
                    profile: Profile::PLANE,
                    reach,
                },
                inner * reach,
            ))
        }
        _ => None,
    }
}

/// Whether the bounds of an instance reach into a box in the space of another.
fn reaches_into(instance: &Instance, of: &Instance, low: DVec3, high: DVec3) -> bool {
    let Transform::Static(placement) = &of.transform else {
        return true;
    };
    let (middle, reach) = placed_box(&placement.to_world, (low, high));
    let (from, to) = instance.bounds();
    let slack = SLACK * reach.max_element();
    (from - slack).cmple(middle + reach).all() && (to + slack).cmpge(middle - reach).all()
}

#[cfg(test)]
mod tests;
