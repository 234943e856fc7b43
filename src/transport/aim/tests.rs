//! Solvers against rays that are traced through the same surfaces: every traced chain is found,
//! what is found obeys the law of refraction, and the Jacobian is that of finite differences.

mod hard;
mod shapes;

use super::differential::jacobian;
use super::surface::Surface;
use super::{Bounce, Far, Points, Prims, solve};
use crate::math::frame::Frame;
use crate::math::hash::{random_bits, unit_f64};
use crate::math::sampling::uniform_sphere;
use glam::DVec3;
use shapes::{cap, ellipsoid, pebble};

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 += 1;
        unit_f64(random_bits(19, self.0))
    }

    fn direction(&mut self) -> DVec3 {
        uniform_sphere([self.next(), self.next()])
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// A family of chains in units of 1 about the origin.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// Random planes with these labels (transmits).
    Planes(&'static [bool]),
    /// Planes 1e-6 rad from parallel.
    Slab,
    /// In, so many inner reflections, out.
    Across(usize),
    /// From a point inside out, the light inside or outside.
    Through {
        light_inside: bool,
    },
    Mirror {
        sphere: bool,
        inside: bool,
    },
    /// So many reflections inside a mirror.
    Around {
        sphere: bool,
        count: usize,
    },
    /// Into an ellipsoid, so many inner reflections, out.
    AcrossEllipsoid(usize),
    /// Off an ellipsoid.
    OffEllipsoid,
    /// Through two caps of spheres, one behind the other.
    Lens,
    /// Through a mesh with interpolated normals.
    AcrossMesh,
    /// Off such a mesh.
    OffMesh,
}

/// Kinds whose solver may miss chains, and the least share of those traced that it has to find.
const SHOT: [(Kind, f64); 6] = [
    (Kind::AcrossEllipsoid(0), 0.8),
    (Kind::AcrossEllipsoid(1), 0.75),
    (Kind::OffEllipsoid, 0.98),
    (Kind::Lens, 0.85),
    (Kind::AcrossMesh, 0.8),
    (Kind::OffMesh, 0.98),
];

const KINDS: [Kind; 18] = [
    Kind::Planes(&[true]),
    Kind::Planes(&[false]),
    Kind::Planes(&[true, true]),
    Kind::Planes(&[true, false, true]),
    Kind::Planes(&[true, true, true, true]),
    Kind::Planes(&[false, true, false, false]),
    Kind::Slab,
    Kind::Across(0),
    Kind::Across(1),
    Kind::Through { light_inside: true },
    Kind::Through {
        light_inside: false,
    },
    Kind::Mirror {
        sphere: true,
        inside: false,
    },
    Kind::Mirror {
        sphere: true,
        inside: true,
    },
    Kind::Mirror {
        sphere: false,
        inside: false,
    },
    Kind::Mirror {
        sphere: false,
        inside: true,
    },
    Kind::Around {
        sphere: true,
        count: 2,
    },
    Kind::Around {
        sphere: false,
        count: 2,
    },
    Kind::Around {
        sphere: false,
        count: 4,
    },
];

/// A chain that a ray was traced through.
#[derive(Debug)]
struct Traced {
    bounces: Vec<Bounce<'static>>,
    eta: Vec<f64>,
    points: Points,
    prims: Prims,
    far: Far,
    to: DVec3,
}

impl Traced {
    /// With the triangles that it lies on.
    fn on(&self, prims: &Prims) -> Vec<Bounce<'static>> {
        (self.bounces.iter().zip(prims))
            .map(|(b, &prim)| b.at(prim))
            .collect()
    }
}

/// Places units in the world.
#[derive(Clone, Copy, Debug)]
struct World {
    scale: f64,
    offset: DVec3,
}

impl World {
    fn point(&self, p: DVec3) -> DVec3 {
        self.offset + p * self.scale
    }
}

/// Where a ray that leaves triangle `from` of a mesh meets a surface from the side `above`, and the
/// triangle that it meets.
fn meet(
    surface: &Surface,
    o: DVec3,
    d: DVec3,
    above: bool,
    from: Option<u32>,
) -> Option<(DVec3, u32)> {
    if let Surface::Mesh(_) = surface {
        let (t, prim) = surface.meet(o, d, above, from)?;
        return Some((surface.at(prim).settle(o + d * t), prim));
    }
    let quadratic = |o: DVec3, d: DVec3, radius: f64| {
        let d2 = d.length_squared();
        let nearest = -o.dot(d) / d2;
        let half = ((radius * radius - (o + d * nearest).length_squared()) / d2).sqrt();
        if above {
            nearest - half
        } else {
            nearest + half
        }
    };
    let t = match *surface {
        Surface::Plane { origin, normal } => {
            let approach = d.dot(normal);
            if (approach < 0.0) != above {
                return None;
            }
            (origin - o).dot(normal) / approach
        }
        Surface::Sphere { center, radius } => quadratic(o - center, d, radius),
        Surface::Cylinder {
            center,
            axis,
            radius,
            ..
        } => quadratic((o - center).reject_from(axis), d.reject_from(axis), radius),
        Surface::Quadric(_) => surface.meet(o, d, above, None)?.0,
        Surface::Mesh(_) | Surface::Triangle(_) => unreachable!(),
    };
    let p = o + d * t;
    let p = (t > 0.0).then(|| match *surface {
        // back onto it, as a hit is
        Surface::Plane { origin, normal } => p - normal * (p - origin).dot(normal),
        Surface::Sphere { center, radius } => center + (p - center).normalize() * radius,
        Surface::Cylinder {
            center,
            axis,
            radius,
            ..
        } => {
            let (along, across) = (
                (p - center).project_onto(axis),
                (p - center).reject_from(axis),
            );
            center + along + across.normalize() * radius
        }
        _ => surface.settle(p),
    });
    p.map(|p| (p, 0))
}

/// Traces from the sensor's end. Points from the light with their triangles, and the last ray.
fn trace(
    bounces: &[Bounce],
    eta: &[f64],
    to: DVec3,
    direction: DVec3,
) -> Option<((Points, Prims), DVec3, DVec3)> {
    let (mut o, mut d) = (to, direction);
    let (mut points, mut prims) = (Vec::new(), Vec::new());
    for (i, bounce) in bounces.iter().enumerate().rev() {
        let (p, prim) = meet(
            &bounce.surface,
            o,
            d,
            bounce.to_above(),
            prims.last().copied(),
        )?;
        let bounce = bounce.at(prim);
        let n = bounce.surface.normal(p);
        let n = if bounce.to_above() { n } else { -n };
        let cos = -d.dot(n);
        if cos <= 0.0 {
            return None;
        }
        d = if bounce.transmits {
            let e = eta[i + 1] / eta[i];
            let k = 1.0 - e * e * (1.0 - cos * cos);
            if k <= 0.0 {
                return None;
            }
            (e * d + (e * cos - k.sqrt()) * n).normalize()
        } else {
            (d + 2.0 * cos * n).normalize()
        };
        // where the normals of a triangle disagree about the side, nothing goes on
        if (d.dot(bounce.surface.face_normal(p)) > 0.0) != bounce.from_above {
            return None;
        }
        o = p;
        points.push(p);
        prims.push(prim);
    }
    points.reverse();
    prims.reverse();
    let on = (points.into_iter().collect(), prims.into_iter().collect());
    Some((on, o, d))
}

/// A random chain of a kind; `index` is that of glass. `near`: how near to the surface ends may be.
fn random_chain(
    kind: Kind,
    world: &World,
    index: f64,
    near: f64,
    random: &mut Random,
) -> Option<Traced> {
    let unit_sphere = Surface::Sphere {
        center: world.point(DVec3::ZERO),
        radius: world.scale,
    };
    let bounce = |surface: Surface<'static>, transmits: bool, from_above: bool| Bounce {
        surface,
        transmits,
        from_above,
    };
    let (mut bounces, mut eta) = (Vec::new(), Vec::new());
    // where the ray starts and what it is aimed at, in units
    let (start, aim);
    let log_near = |random: &mut Random| near.powf(random.next());
    match kind {
        Kind::Planes(labels) => {
            let mut indices = vec![1.0];
            let tilt = random.direction() * 0.4;
            for (i, &transmits) in labels.iter().enumerate() {
                let normal = (DVec3::Z + tilt + random.direction() * 0.3).normalize();
                let origin = DVec3::new(0.0, 0.0, i as f64 * random.between(0.3, 1.0));
                let surface = Surface::Plane {
                    origin: world.point(origin),
                    normal,
                };
                bounces.push(bounce(surface, transmits, true));
                let before = indices[i];
                let flipped = if before == 1.0 { index } else { 1.0 };
                indices.push(if transmits { flipped } else { before });
            }
            eta = indices;
            start = random.direction() * random.between(0.5, 4.0);
            aim = random.direction() * 0.3;
        }
        Kind::Slab => {
            let tilt = DVec3::new(random.next(), random.next(), 0.0) * 1e-6;
            for (z, normal, from_above) in [
                (0.3, DVec3::Z, true),
                (-0.2, (tilt - DVec3::Z).normalize(), false),
            ] {
                let origin = world.point(DVec3::Z * z);
                bounces.push(bounce(Surface::Plane { origin, normal }, true, from_above));
            }
            eta.extend([1.0, index, 1.0]);
            start = random.direction() * random.between(0.5, 4.0);
            aim = random.direction() * 0.2;
        }
        Kind::Across(inner) => {
            bounces.push(bounce(unit_sphere, true, true));
            bounces.extend((0..inner).map(|_| bounce(unit_sphere, false, false)));
            bounces.push(bounce(unit_sphere, true, false));
            eta.push(1.0);
            eta.extend(vec![index; inner + 1]);
            eta.push(1.0);
            start = random.direction() * (1.0 + 3.0 * log_near(random));
            aim = random.direction() * random.next().cbrt();
        }
        Kind::Through { light_inside } => {
            bounces.push(bounce(unit_sphere, true, !light_inside));
            eta.extend(if light_inside {
                [index, 1.0]
            } else {
                [1.0, index]
            });
            let r = if light_inside {
                1.0 + 3.0 * log_near(random)
            } else {
                random.next().cbrt()
            };
            start = random.direction() * r;
            aim = random.direction() * random.next().cbrt();
        }
        Kind::AcrossEllipsoid(_) | Kind::OffEllipsoid | Kind::AcrossMesh | Kind::OffMesh => {
            let surface = match kind {
                Kind::AcrossMesh | Kind::OffMesh => pebble(world, random),
                _ => ellipsoid(world, random),
            };
            let inner = match kind {
                Kind::AcrossEllipsoid(inner) => Some(inner),
                Kind::AcrossMesh => Some(0),
                _ => None,
            };
            if let Some(inner) = inner {
                bounces.push(bounce(surface, true, true));
                bounces.extend((0..inner).map(|_| bounce(surface, false, false)));
                bounces.push(bounce(surface, true, false));
                eta.push(1.0);
                eta.extend(vec![index; inner + 1]);
                eta.push(1.0);
            } else {
                bounces.push(bounce(surface, false, true));
                eta.extend([1.0; 2]);
            }
            start = random.direction() * (1.0 + 3.0 * log_near(random));
            aim = random.direction() * 0.5 * random.next().cbrt();
        }
        Kind::Lens => {
            for (c, z, from_above) in [(-0.4, 0.2, true), (0.6, -0.1, true)] {
                bounces.push(bounce(cap(world, c, z), true, from_above));
            }
            eta.extend([1.0, index, 1.0]);
            let across = random.direction() * 0.6;
            start = DVec3::new(across.x, across.y, -random.between(0.5, 4.0));
            aim = random.direction() * 0.5;
        }
        Kind::Mirror { .. } | Kind::Around { .. } => {
            let (sphere, inside, count) = match kind {
                Kind::Mirror { sphere, inside } => (sphere, inside, 1),
                Kind::Around { sphere, count } => (sphere, true, count),
                _ => unreachable!(),
            };
            let axis = random.direction();
            let surface = if sphere {
                unit_sphere
            } else {
                Surface::Cylinder {
                    center: world.point(DVec3::ZERO),
                    axis,
                    radius: world.scale,
                    half_length: world.scale,
                }
            };
            bounces.extend(vec![bounce(surface, false, !inside); count]);
            eta.extend(vec![1.0; count + 1]);
            // into a ring also over its rim
            let far = if inside {
                random.between(0.0, 2.0)
            } else {
                1.0 + 3.0 * log_near(random)
            };
            let across = random.direction().reject_from(axis).normalize() * far;
            start = if sphere {
                random.direction() * far
            } else {
                across + axis * random.next()
            };
            aim = random.direction() * random.next().cbrt();
        }
    }
    let to = world.point(start);
    let direction = (world.point(aim) - to).try_normalize()?;
    if matches!(kind, Kind::Planes(_)) {
        // met from the side on which the ray is
        for i in (0..bounces.len()).rev() {
            let (_, _, d) = trace(&bounces[i + 1..], &eta[i + 1..], to, direction)?;
            let to_above = d.dot(bounces[i].surface.normal(to)) < 0.0;
            bounces[i].from_above = to_above != bounces[i].transmits;
        }
    }
    let ((points, prims), o, d) = trace(&bounces, &eta, to, direction)?;
    // along a ring positions lose digits
    if (points.iter()).any(|p| p.distance(world.point(DVec3::ZERO)) > 8.0 * world.scale) {
        return None;
    }
    let far = if random.next() < 0.2 && !matches!(kind, Kind::Through { light_inside: true }) {
        Far::Direction(d)
    } else {
        let mut length = 4.0 * log_near(random);
        if matches!(kind, Kind::Through { light_inside: true }) {
            // to the other side of the ball at most
            let chord = -2.0 * (o - world.point(DVec3::ZERO)).dot(d) / world.scale;
            length = chord * random.next();
        }
        Far::Point(o + d * length * world.scale)
    };
    // ends of infinite surfaces are on their sides by construction, but for planes behind planes
    Some(Traced {
        bounces,
        eta,
        points,
        prims,
        far,
        to,
    })
}

fn distance(a: &Points, b: &Points) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| a.distance(*b))
        .fold(0.0, f64::max)
}

/// Sine between what the law of refraction wants and what is there, times the index.
fn residual(chain: &Traced, points: &Points, prims: &Prims) -> f64 {
    let mut worst: f64 = 0.0;
    for (i, (&p, bounce)) in points.iter().zip(&chain.on(prims)).enumerate() {
        let before = match i.checked_sub(1) {
            Some(j) => (points[j] - p).normalize(),
            None => chain.far.direction_from(p),
        };
        let after = (points.get(i + 1).copied().unwrap_or(chain.to) - p).normalize();
        let n = bounce.surface.normal(p);
        let sum = before * chain.eta[i] + after * chain.eta[i + 1];
        worst = worst.max(sum.reject_from(n).length());
    }
    worst
}

/// Every chain that is traced is found, and all that is found obeys the law; returns the number of
/// chains traced.
fn check(kind: Kind, world: &World, index: f64, near: f64, tolerance: f64, rounds: usize) -> usize {
    let mut random = Random((index * 1e6) as u64);
    let mut traced = 0;
    for round in 0..rounds {
        let Some(chain) = random_chain(kind, world, index, near, &mut random) else {
            continue;
        };
        traced += 1;
        let mut nearest = f64::INFINITY;
        let mut all: Vec<Points> = Vec::new();
        solve(
            &chain.bounces,
            &chain.eta,
            &chain.far,
            chain.to,
            |points, _| {
                assert!(points.iter().all(|p| p.is_finite()), "{kind:?}");
                nearest = nearest.min(distance(points, &chain.points));
                // none twice
                let apart = |p: &Points| distance(p, points) > 1e-12 * world.scale;
                assert!(
                    all.iter().all(apart),
                    "{kind:?} {round}: {all:?} {points:?}"
                );
                all.push(points.clone());
            },
        );
        assert!(
            nearest < tolerance * world.scale,
            "{kind:?} {index} {world:?} {round}: missed by {nearest}, {} found, {chain:?}",
            all.len()
        );
        let shortest = |points: &Points| {
            let mut ends: Vec<DVec3> = points.to_vec();
            ends.push(chain.to);
            if let Far::Point(x) = chain.far {
                ends.insert(0, x);
            }
            ends.windows(2)
                .map(|w| w[0].distance(w[1]))
                .fold(f64::INFINITY, f64::min)
        };
        for points in &all {
            // the digits that positions have, as angles
            let size = world.offset.length() + 8.0 * world.scale;
            let digits = 1e-10 + 1e-13 * size / shortest(points);
            let r = residual(&chain, points, &chain.prims);
            assert!(
                r < digits,
                "{kind:?} {index} {round}: residual {r}, {digits} {points:?} {chain:?}"
            );
        }
    }
    traced
}

/// A solver that may miss chains finds at least `least` of those traced, and what it finds obeys
/// the law of refraction.
fn check_shot(kind: Kind, least: f64, world: &World, index: f64) {
    let mut random = Random((index * 1e6) as u64);
    let (mut traced, mut met) = (0, 0);
    for round in 0..2000 {
        let Some(chain) = random_chain(kind, world, index, 1e-2, &mut random) else {
            continue;
        };
        traced += 1;
        let mut nearest = f64::INFINITY;
        solve(
            &chain.bounces,
            &chain.eta,
            &chain.far,
            chain.to,
            |points, prims| {
                nearest = nearest.min(distance(points, &chain.points));
                let r = residual(&chain, points, prims);
                assert!(r < 1e-7, "{kind:?} {index} {round}: residual {r}");
            },
        );
        met += usize::from(nearest < 1e-5 * world.scale);
    }
    let share = f64::from(met as u32) / f64::from(traced as u32);
    assert!(
        traced > 300 && share >= least,
        "{kind:?} {index}: {met} of {traced}"
    );
}

#[test]
fn most_chains_over_curved_surfaces_are_found() {
    for (kind, least) in SHOT {
        for index in [1.5, 1.77] {
            check_shot(kind, least, &UNIT, index);
        }
    }
}

const UNIT: World = World {
    scale: 1.0,
    offset: DVec3::ZERO,
};

#[test]
fn every_traced_chain_is_found() {
    for kind in KINDS {
        for index in [1.5, 1.0 / 1.5, 1.77, 4.0] {
            if matches!(kind, Kind::Across(_)) && index < 1.0 {
                continue;
            }
            let traced = check(kind, &UNIT, index, 1e-2, 1e-6, 2500);
            assert!(traced > 5, "{kind:?}: {traced}");
        }
    }
}

/// Area across the last ray per solid angle at the sensor's end, by differences of the fourth
/// order.
fn area_by_differences(chain: &Traced) -> Option<f64> {
    let frame = Frame::from_z((*chain.points.last()? - chain.to).normalize());
    let last = chain.far.direction_from(chain.points[0]);
    let at = |x: f64, y: f64| {
        let d = frame.to_outer(DVec3::new(x.sin(), y.sin(), 1.0).normalize());
        let ((_, prims), o, d) = trace(&chain.bounces, &chain.eta, chain.to, d)?;
        // over an edge the normal turns otherwise
        if prims != chain.prims {
            return None;
        }
        Some(match chain.far {
            Far::Point(p) => o + d * ((p - o).dot(last) / d.dot(last)),
            Far::Direction(_) => d,
        })
    };
    let h = 1e-4;
    let derivative = |f: &dyn Fn(f64) -> Option<DVec3>| {
        Some((8.0 * (f(h)? - f(-h)?) - (f(2.0 * h)? - f(-2.0 * h)?)) / (12.0 * h))
    };
    let (x, y) = (derivative(&|t| at(t, 0.0))?, derivative(&|t| at(0.0, t))?);
    Some(x.cross(y).dot(last).abs())
}

#[test]
fn jacobian_is_that_of_finite_differences_and_reciprocal() {
    let mut random = Random(5);
    for kind in KINDS.into_iter().chain(SHOT.map(|s| s.0)) {
        let mut checked = 0;
        for _ in 0..1000 {
            let Some(chain) = random_chain(kind, &UNIT, 1.5, 0.3, &mut random) else {
                continue;
            };
            let on = chain.on(&chain.prims);
            let j = jacobian(&on, &chain.points, &chain.eta, &chain.far, chain.to);
            let Some(area) = area_by_differences(&chain) else {
                continue;
            };
            // near a fold, a difference of products of order one; near grazing, high derivatives
            let steep = chain
                .points
                .iter()
                .zip(&on)
                .enumerate()
                .all(|(i, (&p, b))| {
                    let after = chain.points.get(i + 1).copied().unwrap_or(chain.to) - p;
                    let before = chain.far.direction_from(p);
                    let n = b.surface.normal(p);
                    after.normalize().dot(n).abs() > 0.2 && (i > 0 || before.dot(n).abs() > 0.2)
                });
            // over a sharp edge of an ellipsoid as well
            let is_shot = matches!(on[0].surface, Surface::Quadric(_) | Surface::Triangle(_));
            let is_magnified = is_shot && area > 30.0;
            if !steep || is_magnified {
                continue;
            }
            checked += 1;
            assert!(
                (1.0 / j - area).abs() < 1e-6 * (1.0 + area),
                "{kind:?}: {} {area}",
                1.0 / j
            );
            // reversible only where light is scattered at the normal of the surface itself
            let is_eikonal = !matches!(on[0].surface, Surface::Triangle(_));
            if let (Far::Point(x), true) = (chain.far, is_eikonal) {
                let reversed: Vec<Bounce> = chain
                    .bounces
                    .iter()
                    .rev()
                    .map(|b| Bounce {
                        from_above: b.to_above(),
                        ..*b
                    })
                    .collect();
                let points: Points = chain.points.iter().rev().copied().collect();
                let eta: Vec<f64> = chain.eta.iter().rev().copied().collect();
                let back = jacobian(&reversed, &points, &eta, &Far::Point(chain.to), x);
                let (a, b) = (chain.eta[0].powi(2), chain.eta.last().unwrap().powi(2));
                assert!(
                    (a / j - b / back).abs() < 1e-9 * (1.0 + area),
                    "{kind:?}: {} {}",
                    a / j,
                    b / back
                );
            }
        }
        assert!(checked > 10, "{kind:?}: {checked}");
    }
}
