//! `unit` and the `[render]` table.

use super::{At, NameOr};
use serde::Deserialize;

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
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum IntegratorName {
    Path,
    Light,
    Bdpt,
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
