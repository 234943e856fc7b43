//! Chains over curved surfaces for which there is no closed form, found by shooting.
//!
//! A ray from the sensor's end is traced through the surfaces; its differentials by direction say
//! where it must start for the light's end (Newton's method on two angles). From a few starts this
//! finds most chains and not all: a path may have a chain that its solver misses. It is a function
//! of the surfaces and the ends alone, so that whoever meets a chain can ask whether it is found.

use super::differential::Differential;
use super::surface::Surface;
use super::{Bounce, Far, MAX_CHAIN, Points, Prims};
use arrayvec::ArrayVec;
use glam::{DMat3, DVec3};

/// Newton steps of a start.
const MOST_STEPS: usize = 12;
/// Halvings of a step.
const MOST_HALVINGS: usize = 3;
/// Longest step in radians.
const LONGEST: f64 = 0.5;
/// Starts of a search: more find more chains, and take more time than those are worth.
const MOST_STARTS: usize = 2;
/// Miss, as an angle, up to which a chain is one; and the largest of a step that ends the search.
const TOLERANCE: f64 = 1e-10;
/// Steps from one chain to another near it, and the miss, as an angle, with which it is one.
const MOST_FOLLOWING: usize = 6;
const NEAR: f64 = 1e-8;
/// Chains that are as near as this, as angles at the sensor's end, are one.
const SAME: f64 = 1e-6;

/// A ray that was shot through a chain.
struct Shot {
    points: Points,
    prims: Prims,
    /// By how much it misses the light's end, perpendicular to it.
    miss: DVec3,
    /// Derivatives of where it passes by the two angles at its start.
    moves: [DVec3; 2],
    /// Length to which a miss is to be compared.
    length: f64,
}

/// Calls `found` with the chains that are found.
pub(super) fn solve(
    bounces: &[Bounce],
    eta: &[f64],
    far: &Far,
    to: DVec3,
    mut found: impl FnMut(&Points, &Prims),
) {
    let mut known: ArrayVec<DVec3, MOST_STARTS> = ArrayVec::new();
    for start in starts(bounces, eta, far, to) {
        let Some((points, prims)) = converge(bounces, eta, far, to, start) else {
            continue;
        };
        let direction = (points[points.len() - 1] - to).normalize();
        if known.iter().all(|k| k.distance(direction) > SAME) {
            known.push(direction);
            found(&points, &prims);
        }
    }
}

/// A chain that was found from another one near it.
pub(super) struct Followed {
    pub points: Points,
    pub prims: Prims,
    /// Direction at the sensor's end to which the first step led.
    pub first: DVec3,
    /// Solid angle there per area at the light's end, as `differential::jacobian` has it.
    pub jacobian: f64,
}

/// A chain near another one: that at the indices `eta` which leaves the sensor's end near unit
/// direction `start`, by Newton's method.
pub(super) fn follow(
    bounces: &[Bounce],
    eta: &[f64],
    far: &Far,
    to: DVec3,
    start: DVec3,
) -> Option<Followed> {
    let mut direction = start;
    let mut first = None;
    let mut off = f64::INFINITY;
    for _ in 0..MOST_FOLLOWING {
        let shot = shoot(bounces, eta, far, to, direction)?;
        let miss = shot.miss.length();
        // near a fold steps lead away
        if miss >= off {
            return None;
        }
        off = miss;
        let stepped = stepped(direction, step(&shot)?);
        let first = *first.get_or_insert(stepped);
        if miss <= NEAR * shot.length {
            let is_there = super::has_sides(bounces, (&shot.points, &shot.prims), far, to);
            let [a, b] = shot.moves;
            return is_there.then(|| Followed {
                first,
                // both are across the last segment
                jacobian: 1.0 / a.cross(b).length(),
                points: shot.points,
                prims: shot.prims,
            });
        }
        direction = stepped;
    }
    None
}

/// Where the first step from unit direction `start` leads.
pub(super) fn first_step(
    bounces: &[Bounce],
    eta: &[f64],
    far: &Far,
    to: DVec3,
    start: DVec3,
) -> Option<DVec3> {
    let shot = shoot(bounces, eta, far, to, start)?;
    Some(stepped(start, step(&shot)?))
}

/// A direction after a small step of two angles.
fn stepped(direction: DVec3, [x, y]: [f64; 2]) -> DVec3 {
    let (u, v) = direction.any_orthonormal_pair();
    (direction + u * x + v * y).normalize()
}

/// Directions at the sensor's end from which chains are looked for: those of the chains that a
/// sphere in place of an ellipsoid has, that straight to the light's end, and that to the last
/// surface's point of reference.
fn starts(bounces: &[Bounce], eta: &[f64], far: &Far, to: DVec3) -> ArrayVec<DVec3, MOST_STARTS> {
    let mut starts = ArrayVec::new();
    let mut push = |w: DVec3| {
        if let Some(w) = w.try_normalize() {
            // beyond so many they do not pay
            let _ = starts.try_push(w);
        }
    };
    if let Some(round) = Round::of(bounces) {
        round.solve(bounces, eta, far, to, |p| push(p - to));
    }
    push(far.direction_from(to));
    match &bounces[bounces.len() - 1].surface {
        Surface::Quadric(quadric) => push(quadric.reference() - to),
        Surface::Mesh(mesh) => push(mesh.reference() - to),
        _ => {}
    }
    starts
}

/// The space in which the one ellipsoid of a chain is the unit sphere.
struct Round {
    center: DVec3,
    to_round: DMat3,
}

impl Round {
    fn of(bounces: &[Bounce]) -> Option<Self> {
        let Surface::Quadric(first) = &bounces[0].surface else {
            return None;
        };
        let is_one = bounces.iter().all(|b| b.surface == bounces[0].surface);
        let to_round = first.sphere_map().filter(|_| is_one)?;
        Some(Self {
            center: first.reference(),
            to_round,
        })
    }

    /// Calls `found` with the last point of each chain that the sphere has, back in the world.
    fn solve(
        &self,
        bounces: &[Bounce],
        eta: &[f64],
        far: &Far,
        to: DVec3,
        mut found: impl FnMut(DVec3),
    ) {
        let sphere = Surface::Sphere {
            center: DVec3::ZERO,
            radius: 1.0,
        };
        let round = |b: &Bounce| Bounce {
            surface: sphere,
            ..*b
        };
        let bounces: ArrayVec<Bounce, MAX_CHAIN> = bounces.iter().map(round).collect();
        let point = |p: DVec3| self.to_round * (p - self.center);
        let far = match *far {
            Far::Point(x) => Far::Point(point(x)),
            Far::Direction(w) => Far::Direction((self.to_round * w).normalize()),
        };
        let back = self.to_round.inverse();
        super::solve(&bounces, eta, &far, point(to), |points, _| {
            found(self.center + back * points[points.len() - 1]);
        });
    }
}

/// Newton's method from a direction.
fn converge(
    bounces: &[Bounce],
    eta: &[f64],
    far: &Far,
    to: DVec3,
    start: DVec3,
) -> Option<(Points, Prims)> {
    let mut direction = start;
    let mut shot = shoot(bounces, eta, far, to, direction)?;
    for _ in 0..MOST_STEPS {
        let off = shot.miss.length();
        let [x, y] = step(&shot)?;
        let length = x.hypot(y);
        if !length.is_finite() {
            return None;
        }
        let (u, v) = direction.any_orthonormal_pair();
        let along = (u * x + v * y) / length.max(f64::MIN_POSITIVE);
        let mut angle = length.min(LONGEST);
        let is_last = off <= TOLERANCE * shot.length && length <= TOLERANCE;
        let mut better = None;
        for _ in 0..=MOST_HALVINGS {
            let turned = (direction * angle.cos() + along * angle.sin()).normalize();
            match shoot(bounces, eta, far, to, turned) {
                Some(next) if next.miss.length() < off => {
                    better = Some((turned, next));
                    break;
                }
                _ if is_last => break,
                _ => angle *= 0.5,
            }
        }
        match better {
            Some((turned, next)) => (direction, shot) = (turned, next),
            // as near as rounding lets it
            None => break,
        }
        if is_last {
            break;
        }
    }
    (shot.miss.length() <= TOLERANCE * shot.length).then_some((shot.points, shot.prims))
}

/// The two angles that make up for the miss, to first order.
fn step(shot: &Shot) -> Option<[f64; 2]> {
    let [a, b] = shot.moves;
    let (aa, ab, bb) = (a.length_squared(), a.dot(b), b.length_squared());
    let (am, bm) = (a.dot(shot.miss), b.dot(shot.miss));
    let determinant = aa * bb - ab * ab;
    (determinant > 0.0).then(|| {
        [
            (bb * am - ab * bm) / determinant,
            (aa * bm - ab * am) / determinant,
        ]
    })
}

/// Traces a ray from the sensor's end; `None` where it leaves the chain.
fn shoot(bounces: &[Bounce], eta: &[f64], far: &Far, to: DVec3, start: DVec3) -> Option<Shot> {
    let (mut o, mut d) = (to, start);
    let (mut points, mut prims) = (Points::new(), Prims::new());
    let mut ray = Differential::leaving(d);
    let mut length = 0.0;
    for (i, bounce) in bounces.iter().enumerate().rev() {
        let above = bounce.to_above();
        let is_mesh = matches!(bounce.surface, Surface::Mesh(_));
        let is_left = || (bounces.get(i + 1)).is_some_and(|b| b.surface == bounce.surface);
        let left = prims.last().copied().filter(|_| is_mesh && is_left());
        let (t, prim) = bounce.surface.meet(o, d, above, left)?;
        // most surfaces are what they are, and no small thing to copy
        let on_triangle;
        let bounce = if is_mesh {
            on_triangle = bounce.at(prim);
            &on_triangle
        } else {
            bounce
        };
        let p = bounce.surface.settle(o + d * t);
        let [normal, face] = bounce.surface.normals(p);
        let n = if above { normal } else { -normal };
        let cos = -d.dot(n);
        if cos <= 0.0 {
            return None;
        }
        let next = if bounce.transmits {
            let e = eta[i + 1] / eta[i];
            let rest = 1.0 - e * e * (1.0 - cos * cos);
            if rest <= 0.0 {
                return None;
            }
            (e * d + (e * cos - rest.sqrt()) * n).normalize()
        } else {
            (d + 2.0 * cos * n).normalize()
        };
        // where the two normals disagree about the side, nothing goes on
        if (next.dot(face) > 0.0) != bounce.from_above {
            return None;
        }
        ray.advance(t, face);
        ray.scatter(bounce, (p, normal), [eta[i + 1], eta[i]], next);
        length += t;
        (o, d) = (p, next);
        points.push(p);
        prims.push(prim);
    }
    points.reverse();
    prims.reverse();
    Some(match *far {
        Far::Point(x) => {
            let v = x - o;
            let along = v.dot(d);
            if along <= 0.0 {
                return None;
            }
            ray.advance(along, d);
            Shot {
                points,
                prims,
                miss: v - d * along,
                moves: ray.p,
                length: length + along,
            }
        }
        Far::Direction(w) => {
            let along = w.dot(d);
            if along <= 0.0 {
                return None;
            }
            Shot {
                points,
                prims,
                miss: w - d * along,
                moves: ray.d,
                length: 1.0,
            }
        }
    })
}
