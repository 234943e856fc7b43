//! Scenes made in Rust: parts are added one by one, and named by handles.
//!
//! Lengths are meters, angles radians, wavelengths nanometers. Parts are checked when the scene is
//! built, so that every problem names its part.

mod checks;
mod parts;

pub use parts::look_at;

use super::description::{
    LightDescription, ObjectDescription, SceneDescription, SensorDescription, WavelengthChoice,
    WavelengthSettings,
};
use super::{BuildError, Scene, Sequences};
use crate::camera::Camera;
use crate::film::Filter;
use crate::geometry::{Shape, Shutter, Transform};
use crate::light::Light;
use crate::light::casters::Casters;
use crate::material::{Material, MaterialId};
use crate::math::hash::combine;
use crate::medium::{Boundary, Medium, MediumId};
use crate::optics::Polarization;
use crate::spectrum::library::{Library, LibraryError};
use crate::spectrum::{Emission, Ior};
use glam::DAffine3;
use std::fmt::Write;

/// Wavelengths of scenes that do not say otherwise, in nanometers.
const RANGE_NM: [f64; 2] = [360.0, 830.0];

/// Why parts make no scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneBuilderError {
    /// A part that is not possible.
    #[error("{what} \"{name}\": {problem}")]
    Part {
        /// Such as "object".
        what: &'static str,
        /// Name.
        name: String,
        /// Fault of the value, and what is allowed.
        problem: String,
    },
    /// No sensor.
    #[error("the scene has no sensor")]
    NoSensor,
    /// Parts that are possible one by one but not together.
    #[error(transparent)]
    Scene(#[from] BuildError),
}

/// A scene in the making.
///
/// Begins with air everywhere and with a black material, [`SceneBuilder::BLACK`], which surfaces
/// have until they are given another. Handles belong to the builder that gave them.
#[derive(Clone, Debug)]
pub struct SceneBuilder {
    description: SceneDescription,
    identity: Option<String>,
}

impl Default for SceneBuilder {
    fn default() -> Self {
        Self::new()
    }
}

impl SceneBuilder {
    /// Absorbs everything.
    pub const BLACK: MaterialId = MaterialId(0);

    /// Nothing but air.
    #[must_use]
    pub fn new() -> Self {
        Self {
            description: SceneDescription {
                media: vec![clear("ambient", Ior::constant(1.0))],
                materials: vec![Material::default()],
                objects: Vec::new(),
                lights: Vec::new(),
                sensors: Vec::new(),
                named_media: Vec::new(),
                wavelengths: WavelengthSettings {
                    choice: WavelengthChoice::Scene,
                    range_nm: RANGE_NM,
                },
                polarization: Polarization::Average,
                sequences: None,
                caster_share: Casters::SHARE,
                ambient: MediumId::AMBIENT,
                hash: 0,
            },
            identity: None,
        }
    }

    /// Adds a medium.
    pub fn medium(&mut self, medium: Medium) -> MediumId {
        let id = MediumId(self.description.media.len() as u32);
        self.description.media.push(medium);
        id
    }

    /// Adds a clear medium of a refractive index.
    pub fn clear(&mut self, name: &str, ior: Ior) -> MediumId {
        self.medium(clear(name, ior))
    }

    /// Adds a clear glass of the library, such as `schott:N-SF11`.
    ///
    /// # Errors
    /// Where the library has none of this name, or several.
    pub fn glass(&mut self, name: &str) -> Result<MediumId, LibraryError> {
        let ior = Library::embedded().ior(name)?;
        Ok(self.clear(name, ior))
    }

    /// Replaces the medium outside of all solids.
    pub fn ambient(&mut self, medium: Medium) {
        self.description.media[0] = medium;
    }

    /// Adds a material.
    pub fn material(&mut self, material: Material) -> MaterialId {
        let id = MaterialId(self.description.materials.len() as u32);
        self.description.materials.push(material);
        id
    }

    /// Adds a surface of any shape: black, without an inside, and dark until told otherwise.
    pub fn object(
        &mut self,
        name: &str,
        shape: Shape,
        transform: Transform,
    ) -> &mut ObjectDescription {
        push(
            &mut self.description.objects,
            ObjectDescription {
                name: name.to_owned(),
                shape,
                transform,
                material: Self::BLACK,
                boundary: Boundary::None,
                emission: None,
            },
        )
    }

    /// Adds a light that is not a surface. ([`ObjectDescription::emits`] makes lights of surfaces.)
    pub fn light(&mut self, name: &str, light: Light) {
        self.description.lights.push(LightDescription {
            name: name.to_owned(),
            light,
        });
    }

    /// Adds a camera or detector, which measures for the moment 0 s. Cameras have the default
    /// filter, detectors that of the pixel.
    pub fn sensor(&mut self, name: &str, camera: Camera) -> &mut SensorDescription {
        let filter = if camera.is_hittable() {
            Filter::Box
        } else {
            Filter::default()
        };
        push(
            &mut self.description.sensors,
            SensorDescription {
                name: name.to_owned(),
                camera,
                filter,
                shutter: Shutter::default(),
            },
        )
    }

    /// Replaces the choice of wavelengths: by the emitters within 360 to 830 nm unless told
    /// otherwise.
    pub fn wavelengths(&mut self, wavelengths: WavelengthSettings) {
        self.description.wavelengths = wavelengths;
    }

    /// Polarization that smooth surfaces are computed for: unpolarized light unless told otherwise.
    pub fn polarization(&mut self, polarization: Polarization) {
        self.description.polarization = polarization;
    }

    /// Share of the light sub-paths that start toward mirrors and glass, in 0 to
    /// [`Casters::LARGEST_SHARE`]: [`Casters::SHARE`] unless told otherwise.
    pub fn caster_share(&mut self, share: f64) {
        self.description.caster_share = share;
    }

    /// Holds all paths to sequences of surfaces, such as `L T("front") R("back") R("front")
    /// T("back") E`, over the objects added so far.
    ///
    /// # Errors
    /// Fault, in words: see [`Sequences::listed`].
    pub fn sequences(&mut self, expressions: &[&str]) -> Result<(), String> {
        let sequences = Sequences::listed(expressions, &self.description.objects)?;
        self.description.sequences = Some(sequences);
        Ok(())
    }

    /// Name by which parts of renders are known to be of the same scene. Without one, it is the
    /// scene's content, of which large images and meshes take a while to read.
    pub fn identity(&mut self, name: &str) {
        self.identity = Some(name.to_owned());
    }

    /// Builds the scene.
    ///
    /// # Errors
    /// The first part that is not possible, by name; or what is wrong with all of them together.
    pub fn build(mut self) -> Result<Scene, SceneBuilderError> {
        checks::check(&self.description)?;
        let mut hash = TextHash::default();
        let written = match &self.identity {
            Some(name) => hash.write_str(name),
            None => write!(hash, "{:?}", self.description),
        };
        debug_assert!(written.is_ok(), "a hash takes any text");
        self.description.hash = hash.0;
        Ok(Scene::build(self.description)?)
    }
}

fn clear(name: &str, ior: Ior) -> Medium {
    Medium {
        name: name.to_owned(),
        ior,
        absorption: None,
        use_k: false,
    }
}

fn push<T>(all: &mut Vec<T>, one: T) -> &mut T {
    let index = all.len();
    all.push(one);
    &mut all[index]
}

/// Hash of a text that is never kept.
#[derive(Default)]
struct TextHash(u64);

impl Write for TextHash {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        for chunk in text.as_bytes().chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.0 = combine(self.0, u64::from_le_bytes(word));
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests;
