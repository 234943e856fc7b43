//! `motion` of objects, lights and sensors.

use super::At;
use super::transform::{Rotation, Scale};
use serde::Deserialize;

/// What moves a thing after it has been placed.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    pub about: Option<At<[f64; 3]>>,
    #[serde(default)]
    pub interpolation: InterpolationName,
    pub keys: At<Vec<At<MotionKey>>>,
}

/// What a key does not name, it says nothing about.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionKey {
    pub time: At<f64>,
    pub translate: Option<At<[f64; 3]>>,
    pub rotate: Option<At<Rotation>>,
    pub scale: Option<At<Scale>>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum InterpolationName {
    Step,
    #[default]
    Linear,
    Cubic,
}
