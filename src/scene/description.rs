//! Scene description: what a scene file says, with names resolved; the input of construction.

use super::Subject;
use super::sequence::Sequences;
use crate::camera::Camera;
use crate::film::Filter;
use crate::geometry::{Shape, Shutter, Transform};
use crate::light::Light;
use crate::material::{Material, MaterialId};
use crate::medium::{Boundary, Medium, MediumId};
use crate::optics::Polarization;
use crate::spectrum::Emission;
use crate::texture::SpectrumTexture;

/// A placed surface.
#[derive(Clone, Debug)]
pub struct ObjectDescription {
    /// Name for messages, as the file has it (or its position in the file).
    pub name: String,
    /// The surface.
    pub shape: Shape,
    /// Where it is (meters).
    pub transform: Transform,
    /// Material of the surface.
    pub material: MaterialId,
    /// How it separates media.
    pub boundary: Boundary,
    /// Emission, if there is any.
    pub emission: Option<AreaEmission>,
}

/// Emission of a surface.
#[derive(Clone, Debug)]
pub struct AreaEmission {
    /// Radiance, W/(m² sr nm) and W/(m² sr) per line, in the scene's radiometric scale.
    pub radiance: Emission,
    /// Factor on the radiance over the surface.
    pub pattern: Option<SpectrumTexture>,
    /// Emits from the back of the surface too.
    pub two_sided: bool,
}

/// A light that is not a surface (every kind but `Light::Area`).
#[derive(Clone, Debug)]
pub struct LightDescription {
    /// Name for messages.
    pub name: String,
    /// The light.
    pub light: Light,
}

/// A sensor.
#[derive(Clone, Debug)]
pub struct SensorDescription {
    /// Name, used for choosing it and for output file names.
    pub name: String,
    /// The camera or detector.
    pub camera: Camera,
    /// Reconstruction filter (detectors: box of one pixel).
    pub filter: Filter,
    /// When it measures. What moves has its motion over the union of the shutters of all sensors.
    pub shutter: Shutter,
}

/// Which wavelengths a render draws.
#[derive(Clone, Debug, PartialEq)]
pub enum WavelengthChoice {
    /// By what the scene's emitters send to the observer (0.2 uniform + 0.8 emission × (x̄+ȳ+z̄)).
    Scene,
    /// Uniform over the range.
    Uniform,
    /// By the observer alone (x̄+ȳ+z̄).
    Visible,
    /// Uniform over the range, and each emission line of the scene as often as any other.
    Even,
    /// Exactly these lines, in nanometres.
    Lines(Vec<f64>),
}

/// Which wavelengths a render draws, and from which range.
#[derive(Clone, Debug, PartialEq)]
pub struct WavelengthSettings {
    /// The distribution.
    pub choice: WavelengthChoice,
    /// Working range in nanometres (360..830 unless the scene says otherwise).
    pub range_nm: [f64; 2],
}

/// A whole scene, names resolved.
#[derive(Clone, Debug)]
pub struct SceneDescription {
    /// Media; \[0\] is the ambient one.
    pub media: Vec<Medium>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Surfaces.
    pub objects: Vec<ObjectDescription>,
    /// Lights other than emitting surfaces.
    pub lights: Vec<LightDescription>,
    /// Sensors, at least one.
    pub sensors: Vec<SensorDescription>,
    /// Media said to be around an emission, a light or a sensor; else they are looked for.
    pub named_media: Vec<(Subject, MediumId)>,
    /// Wavelengths.
    pub wavelengths: WavelengthSettings,
    /// Polarization that smooth surfaces are computed for.
    pub polarization: Polarization,
    /// Sequences of surfaces that all paths are held to, by the objects above; `None`: they are
    /// not.
    pub sequences: Option<Sequences>,
    /// Share of the light sub-paths that start toward mirrors and glass, in 0 to 0.9.
    pub caster_share: f64,
    /// Medium id of the ambient medium (always 0).
    pub ambient: MediumId,
    /// Hash of the scene file and all files it refers to.
    pub hash: u64,
}
