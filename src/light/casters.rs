//! Casters of caustics: the mirrors and glass of a scene, smooth or nearly so, toward which lights
//! send more of their sub-paths.
//!
//! Light that a small glass focuses onto a table is found by light sub-paths that meet the glass,
//! and of those of a lamp above hardly any do. So a share of the sub-paths starts toward balls
//! around these things (Jensen's projection maps, 1996, by shape instead of by cells). The density
//! of a direction is that of the mixture, whoever asks for it, so that weights know what is sent
//! where. [theory (2.12)]

use crate::geometry::{AccelAt, DirectionalDensity, EndPoint};
use crate::math::{frame::Frame, sampling};
use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Most balls: more things are put together.
const MOST_BALLS: usize = 16;
/// Balls are one where that around both is not larger than this times the smaller.
const NEAR: f64 = 1.25;
/// Largest part of what a light sends that a ball may take up, for it to be worth aiming at.
const LARGEST: f64 = 0.5;

/// A ball around casters, over the whole shutter. A tight one is worth more than one that holds
/// every last bit of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    center: DVec3,
    radius: f64,
}

impl Ball {
    /// Around a box, in meters.
    #[must_use]
    pub fn around((low, high): (DVec3, DVec3)) -> Self {
        Self {
            center: 0.5 * (low + high),
            radius: 0.5 * low.distance(high),
        }
    }

    /// Around a ball that has, or moves within, this box.
    #[must_use]
    pub fn around_round((low, high): (DVec3, DVec3)) -> Self {
        let half = 0.5 * (high - low);
        let own = half.min_element();
        Self {
            center: 0.5 * (low + high),
            radius: own + (half - own).length(),
        }
    }

    /// The smallest around two.
    fn union(self, other: Self) -> Self {
        let apart = self.center.distance(other.center);
        if apart + other.radius <= self.radius {
            return self;
        }
        if apart + self.radius <= other.radius {
            return other;
        }
        let radius = 0.5 * (apart + self.radius + other.radius);
        let along = (other.center - self.center) / apart;
        Self {
            center: self.center + along * (radius - self.radius),
            radius,
        }
    }
}

/// The balls that lights send more to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Casters {
    share: f64,
    balls: Vec<Ball>,
}

impl Casters {
    /// Share of the light sub-paths that start toward casters, unless told otherwise.
    pub const SHARE: f64 = 0.5;
    /// Largest share: of all else a tenth of the light sub-paths is left.
    pub const LARGEST_SHARE: f64 = 0.9;

    /// Of things in these balls; a `share` of 0 to [`Self::LARGEST_SHARE`] of what a light sends
    /// goes toward those that it can be aimed at.
    #[must_use]
    pub fn new(share: f64, mut balls: Vec<Ball>) -> Self {
        let mut groups = vec![];
        if share > 0.0 {
            group(&mut balls, MOST_BALLS, &mut groups);
        }
        merge_near(&mut groups);
        Self {
            share,
            balls: groups,
        }
    }

    /// Number of balls.
    #[must_use]
    pub fn count(&self) -> usize {
        self.balls.len()
    }

    /// Share of the light sub-paths that start toward them.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Those that light of this reach can be aimed at from `x0`; `None` where there are none.
    pub(super) fn seen(&self, x0: &EndPoint, reach: &Reach) -> Option<Targets> {
        let share = self.share;
        let mut all = ArrayVec::new();
        for ball in &self.balls {
            let target = if x0.infinite {
                let (center, radius) = (ball.center, ball.radius);
                Some(Target::Disk { center, radius })
            } else {
                cone(x0.p, reach, ball)
            };
            let worth = |t: &Target| t.extent() > 0.0 && t.extent() <= LARGEST * reach.extent;
            all.extend(target.filter(worth));
        }
        (!all.is_empty()).then_some(Targets { share, all })
    }
}

/// Puts balls together until there are `most`, by where they are.
fn group(balls: &mut [Ball], most: usize, groups: &mut Vec<Ball>) {
    let Some((&first, rest)) = balls.split_first() else {
        return;
    };
    if rest.is_empty() || most == 1 {
        groups.push(rest.iter().fold(first, |all, &ball| all.union(ball)));
        return;
    }
    let (low, high) = (rest.iter()).fold((first.center, first.center), |(low, high), ball| {
        (low.min(ball.center), high.max(ball.center))
    });
    let extent = high - low;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b]));
    let axis = axis.unwrap_or(0);
    balls.sort_by(|a, b| a.center[axis].total_cmp(&b.center[axis]));
    let (left, right) = balls.split_at_mut(balls.len() / 2);
    group(left, most / 2, groups);
    group(right, most - most / 2, groups);
}

/// Puts balls together that are in about the same place.
fn merge_near(balls: &mut Vec<Ball>) {
    let pair = |balls: &[Ball]| {
        (0..balls.len()).find_map(|i| {
            (i + 1..balls.len()).find_map(|j| {
                let both = balls[i].union(balls[j]);
                // a small thing in a large one stays what it is
                let smaller = balls[i].radius.min(balls[j].radius);
                (both.radius <= NEAR * smaller).then_some((i, j, both))
            })
        })
    };
    while let Some((i, j, both)) = pair(balls) {
        balls[i] = both;
        balls.swap_remove(j);
    }
}

/// Directions, or lines, over which a light sends what it does from one start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// Flux per unit of its emission and of the measure of x₀: steradians, or for light from
    /// infinity square meters.
    pub extent: f64,
    /// Axis of the cone outside of which it sends nothing, and the cosine of its half-angle, at
    /// most a right one; `None`: it sends everywhere.
    pub cone: Option<(DVec3, f64)>,
}

impl Reach {
    /// Whether a ball is outside of the cone, with its apex at the start.
    fn misses(&self, ball: &Ball, v: DVec3) -> bool {
        self.cone.is_some_and(|(axis, cos)| {
            let along = v.dot(axis);
            let across = (v - along * axis).length();
            let sin = (1.0 - cos * cos).max(0.0).sqrt();
            across * cos - along * sin >= ball.radius
        })
    }
}

/// The cone from `p` around a ball; `None` from inside, and where no light goes there.
fn cone(p: DVec3, reach: &Reach, ball: &Ball) -> Option<Target> {
    let v = ball.center - p;
    let distance = v.length();
    if distance <= ball.radius || reach.misses(ball, v) {
        return None;
    }
    let sin = ball.radius / distance;
    let cos = (1.0 - sin * sin).max(0.0).sqrt();
    Some(Target::Cone {
        axis: v / distance,
        one_minus_cos: sin * sin / (1.0 + cos),
    })
}

/// A set of directions from a point, or of parallel lines.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Target {
    Cone { axis: DVec3, one_minus_cos: f64 },
    Disk { center: DVec3, radius: f64 },
}

impl Target {
    /// Solid angle in steradians, or area in square meters.
    fn extent(&self) -> f64 {
        match self {
            Self::Cone { one_minus_cos, .. } => 1.0 / sampling::uniform_cone_pdf(*one_minus_cos),
            Self::Disk { radius, .. } => PI * radius * radius,
        }
    }

    /// Whether it holds the line through `p` in unit direction `w`.
    fn holds(&self, w: DVec3, p: DVec3) -> bool {
        match *self {
            Self::Cone {
                axis,
                one_minus_cos,
            } => sampling::one_minus_cos(w, axis) <= one_minus_cos,
            Self::Disk { center, radius } => {
                (p - center).reject_from_normalized(w).length_squared() <= radius * radius
            }
        }
    }
}

/// Start of a sub-path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Choice {
    /// As the light itself sends it, by this number in place of the one that chose.
    Own(f64),
    /// In this direction.
    Toward(DVec3),
    /// Along the line through this point.
    Through(DVec3),
}

/// The casters that light from one start is aimed at: at least one.
#[derive(Clone, Debug)]
pub(super) struct Targets {
    share: f64,
    all: ArrayVec<Target, MOST_BALLS>,
}

impl Targets {
    /// Chooses by `u`; `direction` is that of light from infinity.
    pub fn choose(&self, geometry: &AccelAt, direction: DVec3, u: DVec2) -> Choice {
        if u.x >= self.share {
            return Choice::Own((u.x - self.share) / (1.0 - self.share));
        }
        let scaled = u.x / self.share * self.all.len() as f64;
        let i = (scaled as usize).min(self.all.len() - 1);
        let u = [scaled - i as f64, u.y];
        match self.all[i] {
            Target::Cone {
                axis,
                one_minus_cos,
            } => {
                let w = sampling::uniform_cone(u, one_minus_cos);
                Choice::Toward(Frame::from_z(axis).to_outer(w).normalize())
            }
            Target::Disk { center, radius } => {
                let p = sampling::disk(u).extend(0.0);
                let p = center + radius * Frame::from_z(direction).to_outer(p);
                // as far back as all light from infinity starts
                let accel = geometry.accel();
                let back = (p - accel.center()).dot(direction) + accel.radius();
                Choice::Through(p - back * direction)
            }
        }
    }

    /// The density of the line through `p` in unit direction `w`, of which the light itself has
    /// `own`.
    pub fn density(&self, own: DirectionalDensity, w: DVec3, p: DVec3) -> DirectionalDensity {
        let toward = |t: &Target| if t.holds(w, p) { 1.0 / t.extent() } else { 0.0 };
        let mean = self.all.iter().map(toward).sum::<f64>() / self.all.len() as f64;
        own.map(|own| (1.0 - self.share) * own + self.share * mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(center: DVec3, radius: f64) -> Ball {
        Ball { center, radius }
    }

    fn hundred() -> Vec<Ball> {
        let place = |i: u32| {
            let i = f64::from(i);
            DVec3::new(i % 10.0, (0.1 * i).floor(), (0.7 * i).sin())
        };
        (0..100).map(|i| around(place(i), 0.01)).collect()
    }

    #[test]
    fn balls_are_few_and_hold_all() {
        let casters = Casters::new(0.5, hundred());
        assert!((2..=MOST_BALLS).contains(&casters.count()), "{casters:?}");
        for small in hundred() {
            let holds = |ball: &Ball| {
                small.center.distance(ball.center) + small.radius <= ball.radius * (1.0 + 1e-12)
            };
            assert!(casters.balls.iter().any(holds), "{small:?}");
        }
        // a lens of several surfaces is one, what stands on a mirror is not of it
        let surfaces = |radii: [f64; 3]| {
            let places = [0.0, 0.01, 0.02].map(|z| DVec3::Z * z);
            places
                .into_iter()
                .zip(radii)
                .map(|(p, r)| around(p, r))
                .collect()
        };
        assert_eq!(Casters::new(0.5, surfaces([0.1; 3])).count(), 1);
        assert_eq!(Casters::new(0.5, surfaces([1.0, 0.1, 0.02])).count(), 3);
        assert_eq!(Casters::new(0.0, surfaces([0.1; 3])).count(), 0);
    }

    #[test]
    fn a_ball_in_its_box_is_that_ball() {
        let (low, high) = (DVec3::new(-1.0, 2.0, 3.0), DVec3::new(1.0, 4.0, 5.0));
        assert_eq!(
            Ball::around_round((low, high)),
            around(DVec3::new(0.0, 3.0, 4.0), 1.0)
        );
        // moved by 3 along x
        let moved = Ball::around_round((low, high + 3.0 * DVec3::X));
        assert_eq!(moved, around(DVec3::new(1.5, 3.0, 4.0), 2.5));
        assert_eq!(Ball::around((low, high)).radius, 3.0_f64.sqrt());
    }

    #[test]
    fn light_is_aimed_at_what_it_can_be_aimed_at() {
        let (above, below) = (around(DVec3::Z, 0.1), around(DVec3::NEG_Z, 0.1));
        let (inside, large) = (around(DVec3::ZERO, 0.1), around(DVec3::Z * 3.0, 2.8));
        let seen = |balls: &[Ball], x0, extent, cone| {
            let reach = Reach { extent, cone };
            let found = Casters::new(0.5, balls.to_vec()).seen(&x0, &reach);
            found.map_or(0, |targets| targets.all.len())
        };
        let origin = EndPoint::at(DVec3::ZERO);
        assert_eq!(seen(&[above, below], origin, 4.0 * PI, None), 2);
        assert_eq!(seen(&[inside], origin, 4.0 * PI, None), 0);
        // a third of the sphere
        assert_eq!(seen(&[large], origin, 4.0 * PI, None), 1);
        assert_eq!(seen(&[large], origin, PI, None), 0);
        // to one side, and into a cone of 30 degrees
        assert_eq!(seen(&[above, below], origin, PI, Some((DVec3::Z, 0.0))), 1);
        let beside = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            around(DVec3::new(sin, 0.0, cos), 0.1)
        };
        let narrow = Some((DVec3::Z, 0.75_f64.sqrt()));
        // the ball has 5.7 degrees
        for (degrees, expected) in [(0.0, 1), (35.0, 1), (36.0, 0), (180.0, 0)] {
            let found = seen(&[beside(degrees)], origin, PI, narrow);
            assert_eq!(found, expected, "{degrees}");
        }
        let sun = EndPoint::toward_infinity(DVec3::Z);
        assert_eq!(seen(&[above, inside], sun, 1.0, None), 2);
        assert_eq!(seen(&[above, inside], sun, 0.05, None), 0);
    }
}
