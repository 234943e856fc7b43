//! Solvers where digits run out: scales, places far from the origin, indices next to and far from
//! 1, ends next to a surface or on an axis, grazing and critical angles.

use super::{KINDS, Kind, Random, Traced, UNIT, World, check, distance, random_chain, trace};
use crate::transport::aim::differential::jacobian;
use crate::transport::aim::surface::Surface;
use crate::transport::aim::{Bounce, Far, Points, solve};
use glam::DVec3;

const WORLDS: [World; 3] = [
    World {
        scale: 1e-6,
        offset: DVec3::ZERO,
    },
    World {
        scale: 1e6,
        offset: DVec3::ZERO,
    },
    World {
        scale: 1.0,
        offset: DVec3::new(6e3, -8e3, 100.0),
    },
];

#[test]
fn hard_cases_are_found() {
    for kind in KINDS {
        for world in WORLDS {
            // at 1e4 radii a position has 2e-12 of them, of which a fold leaves the root
            check(kind, &world, 1.5, 1e-3, 1e-5, 300);
        }
        for index in [1.0 + 1e-9, 4.0] {
            check(kind, &UNIT, index, 1e-9, 1e-5, 1000);
        }
    }
}

/// Densities of a walk beside the bridge, per steradian at x_b, where x_a has density 1 per area or
/// steradian.
const WALKS: [f64; 3] = [1e-2, 1.0, 1e2];

/// How far from 1 the weights are of the bridge, which solves for the chain, and of a walk, which
/// has traced it.
fn error_of_sum(solved: f64, traced: f64) -> f64 {
    WALKS
        .map(|walk| (solved / (solved + walk) + walk / (traced + walk) - 1.0).abs())
        .into_iter()
        .fold(0.0, f64::max)
}

impl Traced {
    /// Area at x_a per solid angle at x_b through `points`, in units of the world; from infinity a
    /// solid angle.
    fn area(&self, points: &Points, far: &Far, to: DVec3, scale: f64) -> f64 {
        let area = 1.0 / jacobian(&self.bounces, points, &self.eta, far, to);
        match far {
            Far::Point(_) => area / (scale * scale),
            Far::Direction(_) => area,
        }
    }

    /// The chain between these ends that is nearest to the traced one.
    fn nearest(&self, far: &Far, to: DVec3) -> Option<Points> {
        let mut nearest: Option<Points> = None;
        solve(&self.bounces, &self.eta, far, to, |points, _| {
            let is_nearer =
                |other: &Points| distance(points, &self.points) < distance(other, &self.points);
            if nearest.as_ref().is_none_or(is_nearer) {
                nearest = Some(points.clone());
            }
        });
        nearest
    }

    /// Largest change of the weights where the ends move by the digits that positions have in the
    /// world. Infinite where these decide whether there is a chain.
    fn change_by_rounding(&self, world: &World, random: &mut Random) -> f64 {
        let Some(points) = self.nearest(&self.far, self.to) else {
            return f64::INFINITY;
        };
        let solved = self.area(&points, &self.far, self.to, world.scale);
        let digit = f64::EPSILON * (world.offset.length() + 8.0 * world.scale);
        let mut most: f64 = 0.0;
        for _ in 0..8 {
            let to = self.to + random.direction() * digit;
            let far = match self.far {
                Far::Point(x) => Far::Point(x + random.direction() * digit),
                Far::Direction(w) => {
                    Far::Direction((w + random.direction() * f64::EPSILON).normalize())
                }
            };
            let Some(points) = self.nearest(&far, to) else {
                return f64::INFINITY;
            };
            let moved = self.area(&points, &far, to, world.scale);
            most = most.max(error_of_sum(moved, solved));
        }
        most
    }

    /// Asserts that weights sum to 1, within 1e-9 or what the digits of the ends leave. Whether it
    /// is 1e-9.
    fn assert_sums_to_one(&self, what: &str, world: &World, random: &mut Random) -> bool {
        let digits = 16.0 * self.change_by_rounding(world, random);
        let Some(points) = self.nearest(&self.far, self.to) else {
            // callers judge how many
            return false;
        };
        let [solved, traced] = [&points, &self.points]
            .map(|points| self.area(points, &self.far, self.to, world.scale));
        assert!(!solved.is_nan() && !traced.is_nan(), "{what}: {self:?}");
        let error = error_of_sum(solved, traced);
        assert!(
            error < digits.max(1e-9),
            "{what}: the sum of weights is off by {error:e}, digits {digits:e}: {self:?}"
        );
        digits < 1e-9
    }
}

/// A chain with its name: bounces, indices of its segments, and both ends.
type Case = (&'static str, Vec<Bounce<'static>>, Vec<f64>, DVec3, DVec3);

/// Asserts of random chains of a kind that weights sum to 1. Share of them for which this is within
/// 1e-9.
fn sums_to_one(kind: Kind, world: &World, index: f64, near: f64, rounds: usize) -> f64 {
    let mut random = Random(11);
    let (mut exact, mut all) = (0, 0_u32);
    for round in 0..rounds {
        if let Some(chain) = random_chain(kind, world, index, near, &mut random) {
            let what = format!("{kind:?} {index} {world:?} {round}");
            exact += usize::from(chain.assert_sums_to_one(&what, world, &mut random));
            all += 1;
        }
    }
    assert!(all > 5, "{kind:?}: {all}");
    exact as f64 / f64::from(all)
}

#[test]
fn weights_sum_to_one_at_any_scale_and_index() {
    for kind in KINDS {
        for world in WORLDS {
            let share = sums_to_one(kind, &world, 1.5, 0.1, 2500);
            let least = if world.offset == DVec3::ZERO {
                0.95
            } else {
                0.5
            };
            assert!(share > least, "{kind:?} {world:?}: {share}");
        }
        for index in [1.0 + 1e-9, 4.0] {
            let share = sums_to_one(kind, &UNIT, index, 0.1, 2500);
            assert!(share > 0.95, "{kind:?} {index}: {share}");
            // ends 1e-9 from a surface have half the digits of a direction
            sums_to_one(kind, &UNIT, index, 1e-9, 2500);
        }
    }
}

/// Chains that graze a surface or leave it at the critical angle, up to `delta` of the sine, cosine
/// or distance.
fn edge_chains(delta: f64) -> Vec<(&'static str, Traced)> {
    let n = 1.5;
    let plane = |z: f64, normal: DVec3| Surface::Plane {
        origin: DVec3::Z * z,
        normal,
    };
    let ball = Surface::Sphere {
        center: DVec3::ZERO,
        radius: 1.0,
    };
    let ring = Surface::Cylinder {
        center: DVec3::ZERO,
        axis: DVec3::Z,
        radius: 1.0,
        half_length: 1.0,
    };
    let bounce = |surface: Surface<'static>, transmits: bool, from_above: bool| Bounce {
        surface,
        transmits,
        from_above,
    };
    let sine = |s: f64| ((1.0 - s) * (1.0 + s)).sqrt();
    let critical = (1.0 - delta) / n;
    // passes a unit circle at the distance 1 − delta from its center
    let h = (1.0 - delta) / 3.0;
    let past = DVec3::new(-sine(h), h, 0.0);
    let along = DVec3::new(sine(delta), 0.0, -delta);
    let slope = DVec3::Z * -0.1;
    let leaning = (DVec3::X * 1e-6 - DVec3::Z).normalize();
    let out = critical / 0.9;
    let [up, aside] = [DVec3::Z, DVec3::X * 3.0];
    let near = DVec3::X * (1.0 - delta);
    let cases: [Case; 11] = [
        (
            "critical, plane",
            vec![bounce(plane(0.0, up), true, false)],
            vec![1.0, n],
            up,
            DVec3::new(critical, 0.0, -sine(critical)),
        ),
        (
            "grazing, plane",
            vec![bounce(plane(0.0, up), true, false)],
            vec![n, 1.0],
            up * delta,
            along,
        ),
        (
            "grazing, plane mirror",
            vec![bounce(plane(0.0, up), false, true)],
            vec![1.0, 1.0],
            up * delta,
            along,
        ),
        (
            "grazing, slab",
            vec![
                bounce(plane(-0.2, leaning), true, true),
                bounce(plane(0.0, up), true, false),
            ],
            vec![1.0, n, 1.0],
            up * delta,
            along,
        ),
        (
            "grazing, across",
            vec![bounce(ball, true, true), bounce(ball, true, false)],
            vec![1.0, n, 1.0],
            aside,
            past,
        ),
        (
            "grazing, into a ball",
            vec![bounce(ball, true, false)],
            vec![n, 1.0],
            aside,
            past,
        ),
        (
            "critical, out of a ball",
            vec![bounce(ball, true, true)],
            vec![1.0, n],
            DVec3::X * 0.9,
            DVec3::new(sine(out), out, 0.0),
        ),
        (
            "grazing, mirror ball",
            vec![bounce(ball, false, true)],
            vec![1.0, 1.0],
            aside,
            past,
        ),
        (
            "grazing, in a mirror ball",
            vec![bounce(ball, false, false)],
            vec![1.0, 1.0],
            near,
            DVec3::Y,
        ),
        (
            "grazing, mirror ring",
            vec![bounce(ring, false, true)],
            vec![1.0, 1.0],
            aside,
            past + slope,
        ),
        (
            "grazing, in a mirror ring",
            vec![bounce(ring, false, false)],
            vec![1.0, 1.0],
            near,
            DVec3::Y + slope,
        ),
    ];
    let traced = cases
        .into_iter()
        .filter_map(|(what, bounces, eta, to, direction)| {
            let ((points, prims), o, d) = trace(&bounces, &eta, to, direction.normalize())?;
            let first = &bounces[0];
            // where it starts inside something round, not as far as halfway through, where it is on
            // the fold
            let length = match first.surface {
                Surface::Plane { .. } => 1.0,
                _ if first.from_above => 1.0,
                Surface::Sphere { .. } => -0.7 * o.dot(d),
                Surface::Cylinder { .. } => -0.7 * o.with_z(0.0).dot(d.with_z(0.0)),
                _ => unreachable!(),
            };
            let far = Far::Point(o + d * length);
            let chain = Traced {
                bounces,
                eta,
                points,
                prims,
                far,
                to,
            };
            Some((what, chain))
        });
    traced.collect()
}

#[test]
fn grazing_and_critical_angles_are_found() {
    let mut random = Random(13);
    for exponent in 1..=12 {
        let delta = 10.0_f64.powi(-exponent);
        let chains = edge_chains(delta);
        assert!(exponent > 6 || chains.len() == 11, "{delta}");
        for (what, chain) in chains {
            let what = format!("{what}, {delta:e}");
            chain.assert_sums_to_one(&what, &UNIT, &mut random);
            if exponent <= 6 {
                let found = chain.nearest(&chain.far, chain.to);
                let missed = found.map_or(f64::INFINITY, |p| distance(&p, &chain.points));
                assert!(missed < 1e-6, "{what}: missed by {missed}, {chain:?}");
            }
        }
    }
}

#[test]
fn degenerate_ends_give_no_nonsense() {
    let ball = Surface::Sphere {
        center: DVec3::ZERO,
        radius: 1.0,
    };
    let enter = Bounce {
        surface: ball,
        transmits: true,
        from_above: true,
    };
    let leave = Bounce {
        from_above: false,
        ..enter
    };
    let ring = Surface::Cylinder {
        center: DVec3::ZERO,
        axis: DVec3::Z,
        radius: 1.0,
        half_length: 1.0,
    };
    let mirror = Bounce {
        surface: ring,
        transmits: false,
        from_above: false,
    };
    let points = [
        DVec3::ZERO,
        DVec3::X * 1e-9,
        DVec3::X,
        DVec3::X * (1.0 + 1e-9),
        DVec3::X * 3.0,
        DVec3::X * -3.0,
        DVec3::Z * 2.0,
        DVec3::Z * -2.0,
    ];
    let chains: [(&[Bounce], &[f64]); 4] = [
        (&[enter, leave], &[1.0, 1.5, 1.0]),
        (&[enter], &[1.0, 1.5]),
        (&[leave], &[1.5, 1.0]),
        (&[mirror], &[1.0, 1.0]),
    ];
    for (bounces, eta) in chains {
        for a in points {
            for to in points {
                for far in [
                    Far::Point(a),
                    Far::Direction(DVec3::X),
                    Far::Direction(DVec3::Z),
                ] {
                    solve(bounces, eta, &far, to, |found, _| {
                        assert!(found.iter().all(|p| p.is_finite()));
                        let mut ends = found.to_vec();
                        ends.push(to);
                        if let Far::Point(x) = far {
                            ends.insert(0, x);
                        }
                        // what meets an end has no direction
                        if ends.windows(2).all(|w| w[0] != w[1]) {
                            let j = jacobian(bounces, found, eta, &far, to);
                            assert!(!j.is_nan(), "{bounces:?} {far:?} {to}");
                        }
                    });
                }
            }
        }
    }
}
