//! Motions and shutters.

use super::super::plan::{LightPlan, ObjectPlan, SensorPlan};
use super::super::schema::{At, InterpolationName, Motion, MotionKey, Scale};
use super::{Checker, FINITE};
use crate::geometry::pose::{Arcs, Pose, Rotation};
use crate::geometry::track::{Interpolation, Track, TrackError};
use crate::geometry::{Link, Shutter};
use glam::{DAffine3, DQuat, DVec3};

/// Most keys of a motion.
const MAX_KEYS: usize = 65_536;

/// What a motion may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum May {
    /// Anything.
    Scale,
    /// Move and turn.
    KeepSize,
}

impl Checker<'_> {
    pub(super) fn shutter(&mut self, shutter: Option<&At<[f64; 2]>>) -> Shutter {
        let Some(shutter) = shutter else {
            return Shutter::default();
        };
        let [open_s, close_s] = *shutter.get_ref();
        for time in [open_s, close_s] {
            self.number_at("shutter", time, &shutter.span(), FINITE);
        }
        if close_s < open_s {
            self.conflict(
                &shutter.span(),
                "the shutter closes before it opens (allowed: [open, close], open <= close)",
            );
        }
        Shutter { open_s, close_s }
    }

    /// Warns of motion that no shutter sees.
    pub(super) fn still_motion(
        &mut self,
        objects: &[ObjectPlan],
        lights: &[LightPlan],
        sensors: &[SensorPlan],
    ) {
        let moves = self.meshes.iter().any(|m| m.frames.len() > 1)
            || objects.iter().any(|o| !o.motion.is_empty())
            || lights.iter().any(|l| !l.motion.is_empty())
            || sensors.iter().any(|s| !s.motion.is_empty());
        if moves && sensors.iter().all(|s| s.shutter.is_instant()) {
            self.warnings.push(
                "things move, but every shutter is open for a moment only: nothing is blurred"
                    .to_owned(),
            );
        }
    }

    /// The chain of a list of motions, of which the first is applied first.
    pub(super) fn motion(&mut self, motions: &[At<Motion>], may: May) -> Vec<Link> {
        let mut links = Vec::new();
        for motion in motions.iter().rev() {
            let about = motion.get_ref().about.as_ref();
            let about = about.map_or(DVec3::ZERO, |p| self.point("about", p));
            let Some(pose) = self.pose(motion, may) else {
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
        links
    }

    fn pose(&mut self, motion: &At<Motion>, may: May) -> Option<Pose> {
        let errors_before = self.errors.len();
        let m = motion.get_ref();
        let keys = m.keys.get_ref();
        if keys.is_empty() || keys.len() > MAX_KEYS {
            let message = format!("{} keys (allowed: 1 to {MAX_KEYS})", keys.len());
            self.conflict(&m.keys.span(), message);
            return None;
        }
        let mut times: Vec<f64> = Vec::with_capacity(keys.len());
        for key in keys {
            let time = self.number("time", &key.get_ref().time, FINITE);
            if times.last().is_some_and(|&last| time <= last) {
                self.conflict(
                    &key.get_ref().time.span(),
                    "time is not above that of the key before",
                );
            }
            times.push(time);
            let named = key.get_ref();
            if named.translate.is_none() && named.rotate.is_none() && named.scale.is_none() {
                self.conflict(
                    &key.span(),
                    "the key says nothing (allowed: at least one of translate, rotate, scale)",
                );
            }
        }
        let keys: Vec<(f64, &MotionKey)> = times
            .iter()
            .zip(keys)
            .map(|(&t, key)| (t, key.get_ref()))
            .collect();
        let interpolation = match m.interpolation {
            InterpolationName::Step => Interpolation::Step,
            InterpolationName::Linear => Interpolation::Linear,
            InterpolationName::Cubic => Interpolation::Cubic,
        };
        let mut translations = Vec::new();
        let mut turns = Vec::new();
        let mut scales = Vec::new();
        for (time, key) in keys {
            if let Some(t) = &key.translate {
                translations.push((time, self.point("translate", t)));
            }
            if let Some(r) = &key.rotate {
                let at = r.span();
                let deg = self.number_at("deg", r.get_ref().deg, &at, FINITE);
                let axis = self.direction("axis", &At::new(at, r.get_ref().axis));
                turns.push((time, axis, deg.to_radians()));
            }
            if let Some(s) = &key.scale {
                let factors = match *s.get_ref() {
                    Scale::Uniform(s) => [s; 3],
                    Scale::PerAxis(s) => s,
                };
                for factor in factors {
                    self.number_at("scale", factor, &s.span(), FINITE);
                }
                if may == May::KeepSize {
                    self.conflict(
                        &s.span(),
                        "lights and sensors do not change their size (allowed: scale for objects)",
                    );
                }
                scales.push((time, DVec3::from_array(factors)));
            }
        }
        if self.errors.len() > errors_before {
            return None;
        }
        match pose(&translations, &turns, &scales, interpolation) {
            Ok(pose) if pose.is_invertible() => Some(pose),
            Ok(_) => {
                let message = "scale passes through 0 (allowed: factors that keep their sign)";
                self.conflict(&m.keys.span(), message);
                None
            }
            Err(error) => {
                self.conflict(&m.keys.span(), error.to_string());
                None
            }
        }
    }
}

fn pose(
    translations: &[(f64, DVec3)],
    turns: &[(f64, DVec3, f64)],
    scales: &[(f64, DVec3)],
    interpolation: Interpolation,
) -> Result<Pose, TrackError> {
    let track = |keys: &[(f64, DVec3)]| {
        (!keys.is_empty())
            .then(|| Track::new(keys, interpolation))
            .transpose()
    };
    Ok(Pose {
        translation: track(translations)?,
        rotation: rotation(turns, interpolation)?,
        scale: track(scales)?,
    })
}

/// About one axis: by as much as the keys say. About several: from orientation to orientation.
fn rotation(
    turns: &[(f64, DVec3, f64)],
    interpolation: Interpolation,
) -> Result<Option<Rotation>, TrackError> {
    let Some(&(_, axis, _)) = turns.first() else {
        return Ok(None);
    };
    if turns.iter().all(|turn| turn.1 == axis) {
        let angles: Vec<(f64, f64)> = turns.iter().map(|turn| (turn.0, turn.2)).collect();
        let angle_rad = Track::new(&angles, interpolation)?;
        return Ok(Some(Rotation::Spin { axis, angle_rad }));
    }
    let orientations: Vec<(f64, DQuat)> = turns
        .iter()
        .map(|turn| (turn.0, DQuat::from_axis_angle(turn.1, turn.2)))
        .collect();
    Ok(Some(Rotation::Arcs(Arcs::new(
        &orientations,
        interpolation,
    )?)))
}
