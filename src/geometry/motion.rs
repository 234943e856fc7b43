//! Placement of instances, lights and cameras over the shutter.
//!
//! A thing that moves is placed by a chain of maps, the outermost first, some of which are keyed: a
//! hierarchy of nodes. A product of keyed maps is not itself a keyed map, so the chain is kept and
//! multiplied at the time asked for.
//!
//! Bounds over time: a path x(t) whose second derivative does not exceed B strays from the chord
//! between its ends by at most B h²/8 in a step of length h. For the product of the chain B follows
//! link by link from bounds of M and of its first two derivatives by the product rule, for all
//! points within a radius at once, so that no case (turns beyond half a turn, scaling while
//! turning, a center far away) is special.

use super::moment::Moment;
use super::pose::{Pose, product_rule};
use super::shutter::Shutter;
use crate::math::frame::normalized;
use glam::{DAffine3, DMat3, DVec3};
use std::borrow::Cow;

/// An affine map with its inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// From the object's own space to the world.
    pub to_world: DAffine3,
    /// From the world to the object's own space.
    pub to_object: DAffine3,
    /// Unit world normal of what lies across the z axis of that space, as flat shapes do.
    up: DVec3,
}

impl Placement {
    /// That of a thing whose own space is the world.
    pub const IDENTITY: Self = Self {
        to_world: DAffine3::IDENTITY,
        to_object: DAffine3::IDENTITY,
        up: DVec3::Z,
    };

    /// The placement of an invertible map.
    #[must_use]
    pub fn new(to_world: DAffine3) -> Self {
        let to_object = to_world.inverse();
        Self {
            to_world,
            to_object,
            up: (to_object.matrix3.transpose() * DVec3::Z).normalize(),
        }
    }

    /// A unit world normal from an object-space normal (inverse transpose).
    #[must_use]
    pub fn normal_to_world(&self, n: DVec3) -> DVec3 {
        if n == DVec3::Z {
            return self.up;
        }
        normalized(self.to_object.matrix3.transpose() * n)
    }
}

/// Where a thing is at each moment of the shutter.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "most things rest, and every ray that meets one reads its placement"
)]
pub enum Transform {
    /// At rest.
    Static(Placement),
    /// In motion.
    Moving(Box<Motion>),
}

impl From<Placement> for Transform {
    fn from(placement: Placement) -> Self {
        Self::Static(placement)
    }
}

impl Transform {
    /// A thing that does not move.
    #[must_use]
    pub fn fixed(to_world: DAffine3) -> Self {
        Self::Static(Placement::new(to_world))
    }

    /// A thing placed by a chain of maps, the outermost first, over `shutter`; before and after, it
    /// stays where it is at the ends. A thing that does not move within the shutter is static.
    #[must_use]
    pub fn chain(links: &[Link], shutter: Shutter) -> Self {
        let motion = Motion::new(links, shutter);
        let fixed = motion
            .links
            .iter()
            .all(|link| matches!(link, Link::Fixed(_)));
        if fixed || shutter.is_instant() {
            Self::fixed(product(links, shutter.open_s, false))
        } else {
            Self::Moving(Box::new(motion))
        }
    }

    /// This placement, inside a hierarchy of moving `parents` (the outermost first), over
    /// `shutter`.
    #[must_use]
    pub fn under(&self, parents: &[Link], shutter: Shutter) -> Self {
        let mut links = parents.to_vec();
        match self {
            Self::Static(placement) => links.push(Link::Fixed(placement.to_world)),
            Self::Moving(motion) => links.extend(motion.links.iter().cloned()),
        }
        Self::chain(&links, shutter)
    }

    /// This placement after another map, which comes first.
    #[must_use]
    pub fn inside(&self, map: DAffine3) -> Self {
        match self {
            Self::Static(placement) => Self::fixed(placement.to_world * map),
            Self::Moving(motion) => {
                let mut motion = motion.clone();
                motion.links.push(Link::Fixed(map));
                Self::Moving(motion)
            }
        }
    }

    /// The placement at a moment.
    #[must_use]
    #[inline]
    pub fn at<'a>(&'a self, moment: impl Into<Moment<'a>>) -> Cow<'a, Placement> {
        match self {
            Self::Static(placement) => Cow::Borrowed(placement),
            Self::Moving(motion) => motion.placement(moment.into()),
        }
    }

    /// Calls `ask` with the placement at a moment. One branch tells whether the thing moves; a
    /// `Cow` has one for every number that is read.
    #[inline(always)]
    pub(super) fn with<R>(&self, moment: Moment, ask: impl FnOnce(&Placement) -> R) -> R {
        let moving;
        ask(match self {
            Self::Static(placement) => placement,
            Self::Moving(motion) => {
                moving = motion.placement(moment);
                &moving
            }
        })
    }

    /// The placement at a moment, where it is kept as long as that.
    #[inline]
    pub(super) fn lasting<'a>(&'a self, moment: Moment<'a>) -> Option<&'a Placement> {
        match self {
            Self::Static(placement) => Some(placement),
            Self::Moving(motion) => match motion.placement(moment) {
                Cow::Borrowed(placement) => Some(placement),
                Cow::Owned(_) => None,
            },
        }
    }

    /// Gives a thing that moves the next number, by which moments remember its placement.
    pub fn enumerate(&mut self, next: &mut usize) {
        if let Self::Moving(motion) = self {
            motion.number = Some(*next);
            *next += 1;
        }
    }

    /// Whether the thing moves while the shutter is open.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        matches!(self, Self::Moving(_))
    }

    /// The union over the shutter of boxes that hold a shape: `placed` gives the box under one map,
    /// and no point of the shape is farther than `radius` from the origin of its own space.
    #[must_use]
    pub fn swept(
        &self,
        radius: f64,
        placed: impl Fn(&DAffine3) -> (DVec3, DVec3),
    ) -> (DVec3, DVec3) {
        match self {
            Self::Static(placement) => placed(&placement.to_world),
            Self::Moving(motion) => motion.swept(radius, placed),
        }
    }
}

/// One map of a chain.
#[derive(Clone, Debug, PartialEq)]
pub enum Link {
    /// Constant.
    Fixed(DAffine3),
    /// Keyed in its parts.
    Keyed(Pose),
}

/// A chain of maps with at least one that changes within the shutter.
#[derive(Clone, Debug)]
pub struct Motion {
    links: Vec<Link>,
    shutter: Shutter,
    /// Number among the motions of a scene, see [`Transform::enumerate`].
    number: Option<usize>,
}

impl PartialEq for Motion {
    fn eq(&self, other: &Self) -> bool {
        self.links == other.links && self.shutter == other.shutter
    }
}

/// The product of a chain at `time`; at a step after it, or before it if `before`.
fn product(links: &[Link], time: f64, before: bool) -> DAffine3 {
    let map = |link: &Link| match link {
        Link::Fixed(map) => *map,
        Link::Keyed(pose) => pose.at(time, before),
    };
    links
        .iter()
        .map(map)
        .reduce(|outer, inner| outer * inner)
        .unwrap_or(DAffine3::IDENTITY)
}

/// Most steps that bounds are taken over between two keys, and between all together.
const MOST_STEPS: [usize; 2] = [4096, 65_536];
/// How far a point may stray from its chord, as a share of the size of the thing: by so much bounds
/// are too wide.
const SLACK: f64 = 1.0 / 64.0;

impl Motion {
    /// The chain with all neighbors that do not change within the shutter made one.
    fn new(links: &[Link], shutter: Shutter) -> Self {
        let mut merged: Vec<Link> = Vec::with_capacity(links.len());
        for link in links {
            let still = match link {
                Link::Fixed(map) => Some(*map),
                Link::Keyed(pose) if pose.varies(shutter) => None,
                Link::Keyed(pose) => Some(pose.at(shutter.open_s, false)),
            };
            match (still, merged.last_mut()) {
                (Some(map), Some(Link::Fixed(last))) => *last *= map,
                (Some(map), _) => merged.push(Link::Fixed(map)),
                (None, _) => merged.push(link.clone()),
            }
        }
        Self {
            links: merged,
            shutter,
            number: None,
        }
    }

    /// The placement at a moment, which is moved into the shutter.
    #[inline]
    fn placement<'a>(&self, moment: Moment<'a>) -> Cow<'a, Placement> {
        let compute = || self.compute(moment.time());
        match self.number.and_then(|number| moment.slot(number)) {
            Some(slot) => Cow::Borrowed(slot.get_or_init(compute)),
            None => Cow::Owned(compute()),
        }
    }

    #[cold]
    fn compute(&self, time: f64) -> Placement {
        let time = time.max(self.shutter.open_s).min(self.shutter.close_s);
        Placement::new(product(&self.links, time, false))
    }

    /// Bounds of |x|, |x'| and |x''| over `a..b` (without a key inside) for all points at most
    /// `radius` from the origin.
    fn derivatives(&self, a: f64, b: f64, radius: f64) -> [f64; 3] {
        let mut x = [radius, 0.0, 0.0];
        for link in self.links.iter().rev() {
            let (linear, offset) = match link {
                Link::Fixed(map) => (
                    [norm_bound(map.matrix3), 0.0, 0.0],
                    [map.translation.length(), 0.0, 0.0],
                ),
                Link::Keyed(pose) => pose.bounds(a, b),
            };
            let moved = product_rule(linear, x);
            x = [0, 1, 2].map(|i| moved[i] + offset[i]);
        }
        x
    }

    /// Bounds over the shutter, see [`Transform::swept`].
    fn swept(&self, radius: f64, placed: impl Fn(&DAffine3) -> (DVec3, DVec3)) -> (DVec3, DVec3) {
        let Shutter { open_s, close_s } = self.shutter;
        let mut breaks = vec![open_s, close_s];
        for link in &self.links {
            if let Link::Keyed(pose) = link {
                breaks.extend(pose.times().filter(|t| (open_s..close_s).contains(t)));
            }
        }
        breaks.sort_unstable_by(f64::total_cmp);
        breaks.dedup();
        // a step may be due at the very end
        let (mut low, mut high) = placed(&product(&self.links, close_s, false));
        let mut add = |(l, h): (DVec3, DVec3), slack: f64| {
            low = low.min(l - slack);
            high = high.max(h + slack);
        };
        let most = MOST_STEPS[0].min(MOST_STEPS[1] / breaks.len()) as f64;
        for pair in breaks.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let start = placed(&product(&self.links, a, false));
            let size = (start.1 - start.0).length().max(f64::MIN_POSITIVE);
            let bend = self.derivatives(a, b, radius)[2];
            let steps = ((b - a) * (bend / (8.0 * SLACK * size)).sqrt()).ceil();
            // the largest of what is not a number and 1 is 1
            let steps = steps.min(most).max(1.0) as u32;
            let at = |i: u32| {
                if i == steps {
                    b
                } else {
                    a + (b - a) * f64::from(i) / f64::from(steps)
                }
            };
            for i in 0..steps {
                let (s, e) = (at(i), at(i + 1));
                let [reach, _, bend] = self.derivatives(s, e, radius);
                let slack = bend * (e - s) * (e - s) / 8.0;
                if slack.is_finite() {
                    add(placed(&product(&self.links, s, false)), slack);
                    add(placed(&product(&self.links, e, true)), slack);
                } else {
                    add((DVec3::ZERO, DVec3::ZERO), reach);
                }
            }
        }
        (low, high)
    }
}

/// A bound of the factor by which `m` stretches any vector: exact for rotations and scalings along
/// the axes.
fn norm_bound(m: DMat3) -> f64 {
    let gram = m.transpose() * m;
    let row_sum = |row: DVec3| row.abs().element_sum();
    row_sum(gram.x_axis)
        .max(row_sum(gram.y_axis))
        .max(row_sum(gram.z_axis))
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::moment::Placements;
    use super::super::pose::Rotation;
    use super::super::track::{Interpolation, Track};
    use super::*;
    use glam::{DQuat, dvec3};

    const SHUTTER: Shutter = Shutter {
        open_s: 0.0,
        close_s: 2.0,
    };

    fn slide() -> Link {
        let keys = [
            (0.0, DVec3::ZERO),
            (1.0, dvec3(1.0, 0.0, 0.0)),
            (3.0, dvec3(1.0, 4.0, 0.0)),
        ];
        Link::Keyed(Pose {
            translation: Some(Track::new(&keys, Interpolation::Linear).expect("valid")),
            ..Pose::default()
        })
    }

    #[test]
    fn a_chain_multiplies_from_the_outside_and_is_held_at_the_ends() {
        let turn = DAffine3::from_quat(DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2));
        let transform = Transform::chain(&[Link::Fixed(turn), slide()], SHUTTER);
        let at = |t: f64| transform.at(t).to_world.translation;
        assert!(transform.is_moving());
        assert!((at(0.5) - dvec3(0.0, 0.5, 0.0)).length() < 1e-15);
        // beyond the shutter it stays, even where keys go on
        assert!((at(2.5) - at(2.0)).length() == 0.0);
        assert!((at(2.0) - dvec3(-2.0, 1.0, 0.0)).length() < 1e-15);
    }

    #[test]
    fn kept_placements_are_those_of_the_thing_and_the_moment_asked_for() {
        let mut count = 0;
        let things: Vec<_> = (0..40)
            .map(|i| {
                let shift = DAffine3::from_translation(DVec3::Y * f64::from(i));
                let mut thing = Transform::chain(&[Link::Fixed(shift), slide()], SHUTTER);
                thing.enumerate(&mut count);
                thing
            })
            .collect();
        assert_eq!(count, 40);
        let mut placements = Placements::default();
        for time in [0.25, 0.5, 0.5, 0.25] {
            let moment = placements.at(time, count);
            for (i, thing) in things.iter().enumerate() {
                for at in [moment, moment, time.into()] {
                    let at = thing.at(at).to_world.translation;
                    assert_eq!(at, dvec3(time, i as f64, 0.0));
                }
                assert!(moment.slot(i).is_some_and(|slot| slot.get().is_some()));
            }
        }
    }

    #[test]
    fn what_does_not_move_within_the_shutter_is_static() {
        let late = Shutter {
            open_s: 3.0,
            close_s: 9.0,
        };
        let instant = Shutter {
            open_s: 0.5,
            close_s: 0.5,
        };
        assert!(!Transform::chain(&[slide()], late).is_moving());
        let moving = Transform::chain(&[slide()], SHUTTER);
        let still = Transform::chain(&[slide()], instant);
        assert!(moving.is_moving() && !still.is_moving());
        assert_eq!(still.at(0.0), moving.at(0.5));
        assert_eq!(
            still.at(0.0),
            Transform::fixed(moving.at(0.5).to_world).at(0.0)
        );
    }

    #[test]
    fn a_point_on_a_wheel_is_bounded_by_the_wheel() {
        // three and a half turns of a point at distance 1000: bounds must be the circle, hardly
        // more
        let turns = Rotation::Spin {
            axis: DVec3::Z,
            angle_rad: Track::new(&[(0.0, 0.0), (2.0, 22.0)], Interpolation::Linear)
                .expect("valid"),
        };
        let wheel = Link::Keyed(Pose {
            rotation: Some(turns),
            ..Pose::default()
        });
        let out = Link::Fixed(DAffine3::from_translation(dvec3(1000.0, 0.0, 0.0)));
        let transform = Transform::chain(&[wheel, out], SHUTTER);
        let unit = |m: &DAffine3| (m.translation - 1.0, m.translation + 1.0);
        let (low, high) = transform.swept(3f64.sqrt(), unit);
        for (edge, exact) in [
            (-low.x, 1001.0),
            (high.x, 1001.0),
            (-low.y, 1001.0),
            (high.y, 1001.0),
            (-low.z, 1.0),
        ] {
            assert!(edge >= exact && edge < exact + 0.1, "{edge} {exact}");
        }
    }
}
