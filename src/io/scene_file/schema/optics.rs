//! `[medium.NAME]` and `[material.NAME]`.

use super::At;
use super::spectrum::Spectrum;
use super::texture::{Scalar, TextureSource};
use serde::Deserialize;

/// Exactly one of the first five keys gives the index.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Medium {
    pub glass: Option<At<String>>,
    pub ior: Option<At<f64>>,
    pub cauchy: Option<At<Vec<f64>>>,
    pub sellmeier: Option<At<Vec<[f64; 2]>>>,
    pub file: Option<At<String>>,
    #[serde(default)]
    pub extrapolate: bool,
    pub absorption: Option<At<Absorption>>,
    pub use_k: Option<bool>,
}

/// Either what is left of white light after a distance, or the coefficient in 1/m.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Absorption {
    pub color: Option<At<Spectrum>>,
    pub distance: Option<At<f64>>,
    pub coefficient: Option<At<Spectrum>>,
}

/// One lobe, a mixture, or nothing (black).
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    pub diffuse: Option<At<Diffuse>>,
    pub mirror: Option<At<Mirror>>,
    pub conductor: Option<At<Conductor>>,
    pub dielectric: Option<At<Dielectric>>,
    pub thin: Option<At<Thin>>,
    pub coated: Option<At<Coated>>,
    pub normal: Option<At<NormalMap>>,
    pub coverage: Option<At<Scalar>>,
    pub cutoff: Option<At<f64>>,
    pub mix: Option<At<Vec<At<Lobe>>>>,
}

/// One lobe of a mixture.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lobe {
    pub weight: At<Scalar>,
    pub diffuse: Option<At<Diffuse>>,
    pub mirror: Option<At<Mirror>>,
    pub conductor: Option<At<Conductor>>,
    pub dielectric: Option<At<Dielectric>>,
    pub thin: Option<At<Thin>>,
    pub coated: Option<At<Coated>>,
}

/// A diffuse base under a dielectric layer.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coated {
    pub reflectance: At<Spectrum>,
    pub ior: Option<At<f64>>,
    pub roughness: Option<At<Scalar>>,
}

/// A normal map: the image, and a factor on how far it bends.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NormalMap {
    pub texture: At<TextureSource>,
    pub scale: Option<At<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diffuse {
    pub reflectance: At<Spectrum>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mirror {
    pub reflectance: Option<At<Spectrum>>,
}

/// `metal`, or `eta` and `k`, or `color`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Conductor {
    pub metal: Option<At<String>>,
    pub eta: Option<At<f64>>,
    pub k: Option<At<f64>>,
    pub color: Option<At<Spectrum>>,
    pub roughness: Option<At<Scalar>>,
    pub tint: Option<At<Spectrum>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dielectric {
    pub roughness: Option<At<Scalar>>,
    pub reflect_tint: Option<At<Spectrum>>,
    pub transmit_tint: Option<At<Spectrum>>,
}

/// `ior` or `glass`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thin {
    pub ior: Option<At<f64>>,
    pub glass: Option<At<String>>,
    pub transmit_tint: Option<At<Spectrum>>,
}
