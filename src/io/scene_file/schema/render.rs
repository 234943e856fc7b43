//! `unit` and the `[render]` table.

use super::{At, NameOr};
use serde::Deserialize;
use serde::de::{Deserializer, Visitor};
use std::fmt;

#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub enum LengthUnit {
    #[default]
    #[serde(rename = "m")]
    Meter,
    #[serde(rename = "cm")]
    Centimeter,
    #[serde(rename = "mm")]
    Millimeter,
    #[serde(rename = "um")]
    Micrometer,
}

impl LengthUnit {
    /// Metres per unit.
    pub fn in_m(self) -> f64 {
        match self {
            Self::Meter => 1.0,
            Self::Centimeter => 1e-2,
            Self::Millimeter => 1e-3,
            Self::Micrometer => 1e-6,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Render {
    pub integrator: Option<IntegratorName>,
    pub spp: Option<At<i64>>,
    pub seed: Option<At<i64>>,
    pub lanes: Option<At<i64>>,
    pub max_depth: Option<At<i64>>,
    pub heuristic: Option<HeuristicName>,
    pub filter: Option<FilterName>,
    pub filter_radius: Option<At<f64>>,
    pub pair_probability: Option<At<f64>>,
    pub wavelengths: Option<At<Wavelengths>>,
    pub units: Option<OutputUnits>,
    pub regularize: Option<RegularizeName>,
    pub single_rule: Option<SingleRuleName>,
    pub epsilon: Option<At<Epsilon>>,
    pub epsilon_min: Option<At<f64>>,
    pub bias_weight: Option<At<f64>>,
    pub bias_estimate: Option<bool>,
    pub show_point_lights: Option<bool>,
    pub merge_radius: Option<At<f64>>,
    pub merge_alpha: Option<At<f64>>,
    pub sharing: Option<SharingName>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RegularizeName {
    Auto,
    Off,
    Single,
    Mis,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SingleRuleName {
    ShortestEdge,
    Camera,
    Light,
}

/// A half-aperture in radians, or a name that must be `auto`.
#[derive(Clone, Debug)]
pub enum Epsilon {
    Radians(f64),
    Name(String),
}

impl<'de> Deserialize<'de> for Epsilon {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrName;
        impl Visitor<'_> for NumberOrName {
            type Value = Epsilon;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an angle in radians or \"auto\"")
            }
            fn visit_f64<E>(self, value: f64) -> Result<Epsilon, E> {
                Ok(Epsilon::Radians(value))
            }
            fn visit_i64<E>(self, value: i64) -> Result<Epsilon, E> {
                Ok(Epsilon::Radians(value as f64))
            }
            fn visit_str<E>(self, name: &str) -> Result<Epsilon, E> {
                Ok(Epsilon::Name(name.to_owned()))
            }
        }
        deserializer.deserialize_any(NumberOrName)
    }
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum IntegratorName {
    Path,
    Light,
    Bdpt,
    Vcm,
    Bpm,
    Ppm,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SharingName {
    Hero,
    Set,
    Stratified,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HeuristicName {
    Balance,
    Power2,
}

/// Reconstruction filters: none has negative parts, for splats are weighted by them.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum FilterName {
    Box,
    Tent,
    Gaussian,
}

/// Scale of the output image.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum OutputUnits {
    /// Unit equal-energy radiance gives Y = 1.
    #[default]
    Radiance,
    /// Y in cd/m² (683 lm/W).
    Photometric,
}

pub type Wavelengths = NameOr<WavelengthTable>;

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WavelengthName {
    Scene,
    Uniform,
    Visible,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WavelengthTable {
    pub choice: Option<At<WavelengthName>>,
    pub range_nm: Option<At<[f64; 2]>>,
    pub line_nm: Option<At<f64>>,
    pub lines_nm: Option<At<Vec<f64>>>,
}
