//! The immutable scene: everything the transport needs, validated when it is built.

pub mod build;
pub mod description;
pub mod effects;
pub mod frozen;
pub mod moving;
pub mod probe;
pub mod regularization;
pub mod settings;

pub use build::BuildError;
pub use description::SceneDescription;
pub use settings::Settings;

use crate::camera::Camera;
use crate::film::Filter;
use crate::geometry::{Accel, Shutter};
use crate::light::selection::LightSelection;
use crate::light::{Light, LightContext, LightId};
use crate::material::{Material, MaterialId};
use crate::medium::{Boundary, Medium, MediumStack};
use crate::spectrum::WavelengthDistribution;
use effects::Effect;
use glam::DVec3;

/// What a surface is, besides its geometry. Index = instance id.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name for messages.
    pub name: String,
    /// What it is made of.
    pub material: MaterialId,
    /// How it separates media.
    pub boundary: Boundary,
    /// The light it is.
    pub light: Option<LightId>,
    /// The sensor it is, by index.
    pub sensor: Option<usize>,
    /// A sensor that lets light through.
    pub transparent_sensor: bool,
    /// Crossing it without a change of medium is no vertex.
    pub clear: bool,
}

/// A sensor in the scene.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Name.
    pub name: String,
    /// The camera or detector.
    pub camera: Camera,
    /// Reconstruction filter.
    pub filter: Filter,
    /// When it measures.
    pub shutter: Shutter,
    /// The solids it is in.
    pub stack: MediumStack,
}

/// Everything the transport needs.
#[derive(Debug)]
pub struct Scene {
    /// Geometry.
    pub accel: Accel,
    /// Per instance.
    pub objects: Vec<Object>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Media; \[0\] is the ambient one.
    pub media: Vec<Medium>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Names of the lights, for messages.
    pub light_names: Vec<String>,
    /// The solids each light is in.
    pub light_stacks: Vec<MediumStack>,
    /// The lights that escaping camera paths find.
    pub environments: Vec<LightId>,
    /// Choice of lights.
    pub selection: LightSelection,
    /// Sensors.
    pub sensors: Vec<Sensor>,
    /// Distribution of wavelengths.
    pub wavelengths: WavelengthDistribution,
    /// Centre of the bounding sphere.
    pub center: DVec3,
    /// Radius of the bounding sphere in metres.
    pub radius: f64,
    /// Whether anything moves: only then do paths draw a time.
    pub is_moving: bool,
    /// What the scene calls for.
    pub effects: Vec<Effect>,
    /// Hash of the scene file and the files it refers to.
    pub hash: u64,
}

impl Scene {
    /// What lights need to know, at a moment.
    #[must_use]
    pub fn light_context(&self, time: f64) -> LightContext<'_> {
        LightContext {
            accel: &self.accel,
            center: self.center,
            radius: self.radius,
            time,
        }
    }

    /// Index of the sensor called `name`.
    #[must_use]
    pub fn sensor_index(&self, name: &str) -> Option<usize> {
        self.sensors.iter().position(|s| s.name == name)
    }
}
