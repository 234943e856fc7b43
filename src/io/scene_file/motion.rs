//! `motion` of objects, lights and sensors, and `shutter`.

use super::document::Node;
use super::keys::{Form, Keys, Spec, Table, Value, keys};
use super::reader::Reader;
use super::transform::Turn;
use super::value::{At, Factors, Point, items};
use crate::geometry::pose::{Arcs, Pose, Rotation};
use crate::geometry::track::{Interpolation, Track, TrackError};
use crate::geometry::{Link, Shutter};
use crate::math::named::named;
use glam::{DAffine3, DQuat, DVec3};

/// Most keys of a motion.
const MAX_KEYS: usize = 65_536;

impl Value for Shutter {
    fn form() -> Form {
        <[f64; 2]>::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let [open_s, close_s] = <[f64; 2]>::read(node, spec, cx)?;
        if close_s < open_s {
            let message =
                "the shutter closes before it opens (allowed: [open, close], open <= close)";
            cx.conflict(&node.span(), message);
        }
        Some(Self { open_s, close_s })
    }

    fn show(&self) -> String {
        format!("[{}, {}]", self.open_s, self.close_s)
    }
}

named! {
    /// How values between keys are found.
    pub enum InterpolationName {
        Step = "step": "Stays as it is until the next key",
        Linear = "linear": "On straight lines",
        Cubic = "cubic": "Splines through the keys (Catmull and Rom)",
    }
}

/// The chain of a list of motions, of which the first is applied first. Only objects may be scaled.
#[derive(Debug, Default)]
pub struct Motion<const SCALES: bool>(pub Vec<Link>);

impl<const SCALES: bool> Value for Motion<SCALES> {
    fn form() -> Form {
        Form::List(Box::new(Form::Table(MotionKeys::KIND)))
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let mut links = Vec::new();
        for motion in items(node, "an array", cx)?.into_iter().rev() {
            let Some((about, pose)) = read_motion(motion, SCALES, cx) else {
                continue;
            };
            if about == DVec3::ZERO {
                links.push(Link::Keyed(pose));
            } else {
                links.push(Link::Fixed(DAffine3::from_translation(about)));
                links.push(Link::Keyed(pose));
                links.push(Link::Fixed(DAffine3::from_translation(-about)));
            }
        }
        cx.moves |= !links.is_empty();
        Some(Self(links))
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self::default())
    }

    fn default_text() -> Option<String> {
        Some("at rest".to_owned())
    }
}

keys! {
    /// A motion after a thing has been placed. What a key does not name, it says nothing about.
    MotionKeys = "motion" {
        /// 1 to 65536 keys at ascending times. Before the first and after the last, things stay as
        /// they are there.
        keys: At<Moments>;
        /// The point that `rotate` and `scale` leave where it is.
        about: Point, default Point(DVec3::ZERO);
        /// How values between keys are found.
        interpolation: InterpolationName, default InterpolationName::Linear;
    }
}

keys! {
    /// A key of a motion, with at least one of `translate`, `rotate` and `scale`. Things are
    /// scaled, then turned about `about`, then moved.
    MomentKeys = "moment" {
        /// The moment.
        time: At<f64>, unit "seconds";
        /// Moves.
        translate: Option<Point>;
        /// Turns: where all keys name the same axis, by any angle, many turns too; where they
        /// differ, the shortest way from orientation to orientation.
        rotate: Option<Turn>;
        /// Scales objects; must not pass through 0.
        scale: Option<At<Factors>>;
    }
}

/// The keys of a motion that can be read.
pub struct Moments(Vec<MomentKeys>);

impl Value for Moments {
    fn form() -> Form {
        Form::List(Box::new(Form::Table(MomentKeys::KIND)))
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let list = items(node, "an array", cx)?;
        if list.is_empty() || list.len() > MAX_KEYS {
            let message = format!("{} keys (allowed: 1 to {MAX_KEYS})", list.len());
            cx.conflict(&node.span(), message);
            return None;
        }
        let mut keys: Vec<MomentKeys> = Vec::with_capacity(list.len());
        for item in list {
            let Some(table) = Table::of(item, MomentKeys::NAMES, cx) else {
                continue;
            };
            let Some(key) = MomentKeys::from_table(&table, cx) else {
                continue;
            };
            if keys
                .last()
                .is_some_and(|last| key.time.value <= last.time.value)
            {
                cx.conflict(&key.time.at, "time is not above that of the key before");
            }
            if key.translate.is_none() && key.rotate.is_none() && key.scale.is_none() {
                let message =
                    "the key says nothing (allowed: at least one of translate, rotate, scale)";
                cx.conflict(&table.at, message);
            }
            keys.push(key);
        }
        Some(Self(keys))
    }
}

/// The fixed point and the pose over time.
fn read_motion(node: Node<'_>, scales: bool, cx: &mut Reader<'_>) -> Option<(DVec3, Pose)> {
    let table = Table::of(node, MotionKeys::NAMES, cx)?;
    let motion = MotionKeys::from_table(&table, cx)?;
    let Moments(keys) = motion.keys.value;
    if !scales {
        for key in &keys {
            if let Some(scale) = &key.scale {
                let message =
                    "lights and sensors do not change their size (allowed: scale for objects)";
                cx.conflict(&scale.at, message);
            }
        }
    }
    table.sound(cx)?;
    let interpolation = match motion.interpolation {
        InterpolationName::Step => Interpolation::Step,
        InterpolationName::Linear => Interpolation::Linear,
        InterpolationName::Cubic => Interpolation::Cubic,
    };
    let message = match pose(&keys, interpolation) {
        Ok(pose) if pose.is_invertible() => return Some((motion.about.0, pose)),
        Ok(_) => "scale passes through 0 (allowed: factors that keep their sign)".to_owned(),
        Err(error) => error.to_string(),
    };
    cx.conflict(&motion.keys.at, message);
    None
}

fn pose(keys: &[MomentKeys], interpolation: Interpolation) -> Result<Pose, TrackError> {
    let track = |value: fn(&MomentKeys) -> Option<DVec3>| {
        let named = |key: &MomentKeys| Some((key.time.value, value(key)?));
        let values: Vec<(f64, DVec3)> = keys.iter().filter_map(named).collect();
        (!values.is_empty())
            .then(|| Track::new(&values, interpolation))
            .transpose()
    };
    let turn = |key: &MomentKeys| Some((key.time.value, key.rotate?));
    let turns: Vec<(f64, Turn)> = keys.iter().filter_map(turn).collect();
    Ok(Pose {
        translation: track(|key| key.translate.map(|t| t.0))?,
        rotation: rotation(&turns, interpolation)?,
        scale: track(|key| key.scale.as_ref().map(|s| s.value.0))?,
    })
}

/// About one axis: by as much as the keys say. About several: from orientation to orientation.
fn rotation(
    turns: &[(f64, Turn)],
    interpolation: Interpolation,
) -> Result<Option<Rotation>, TrackError> {
    let Some(&(_, Turn { axis, .. })) = turns.first() else {
        return Ok(None);
    };
    if turns.iter().all(|(_, turn)| turn.axis == axis) {
        let angles: Vec<(f64, f64)> = turns.iter().map(|(time, turn)| (*time, turn.rad)).collect();
        let angle_rad = Track::new(&angles, interpolation)?;
        return Ok(Some(Rotation::Spin { axis, angle_rad }));
    }
    let orientations: Vec<(f64, DQuat)> = turns
        .iter()
        .map(|(time, turn)| (*time, DQuat::from_axis_angle(turn.axis, turn.rad)))
        .collect();
    let arcs = Arcs::new(&orientations, interpolation)?;
    Ok(Some(Rotation::Arcs(arcs)))
}
