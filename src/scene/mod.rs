//! The immutable scene: everything the transport needs, validated when it is built.

mod albedo;
pub mod at;
pub mod build;
pub mod builder;
pub mod chains;
pub mod crossing;
pub mod description;
pub mod effects;
pub mod frozen;
pub mod lens;
pub mod moving;
pub mod probe;
pub mod regularization;
pub mod sequence;
pub mod settings;

pub use at::SceneAt;
pub use build::{BuildError, Subject};
pub use builder::{SceneBuilder, SceneBuilderError};
pub use description::{SceneDescription, WavelengthSettings};
pub use lens::{LensAssembly, LensBuildError};
pub use sequence::Sequences;
pub use settings::Settings;

use crate::bsdf::albedo::AlbedoTables;
use crate::camera::Camera;
use crate::film::{Crop, Filter};
use crate::geometry::contact::Region;
use crate::geometry::{Accel, Contact, InstanceId, Shutter, SurfacePoint};
use crate::light::casters::Casters;
use crate::light::selection::LightSelection;
use crate::light::{Light, LightId};
use crate::material::{Material, MaterialId};
use crate::medium::{Boundary, Medium, MediumId, MediumStack};
use crate::optics::Polarization;
use crate::spectrum::WavelengthDistribution;
use crate::texture::Image;
use chains::{Chains, UnknownChain};
use effects::{Effect, EffectKind};
use glam::DVec3;
use std::sync::{Arc, OnceLock};

/// Effect of a face on a segment between two points in one medium that meets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// In the way.
    Blocked,
    /// In the way if the medium changes there, which the solids around it decide.
    Depends,
    /// Not in the way.
    Free,
}

/// Surface besides its geometry: material, media, emission. Index = instance id.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name for messages.
    pub name: String,
    /// Material of the surface.
    pub material: MaterialId,
    /// How it separates media.
    pub boundary: Boundary,
    /// The light it is.
    pub light: Option<LightId>,
    /// The sensor it is, by index.
    pub sensor: Option<usize>,
    /// A sensor that lets light through.
    pub transparent_sensor: bool,
    /// The material is an interface, which light crosses from one medium into another.
    pub is_interface: bool,
    /// The material is a smooth interface and no more.
    pub is_smooth_interface: bool,
    /// Clear interface: walks skip it where the medium does not change.
    pub clear: bool,
    /// Opacity varies: its material has a coverage map.
    pub has_alpha: bool,
    /// A material that bends shading normals.
    pub has_normal_map: bool,
    /// Effect of the faces on a segment that meets one.
    pub passage: Passage,
    /// Where other surfaces may be in the same place.
    pub contacts: Vec<Region>,
    /// A sensor that lets light through, and that nothing touches: rays pass it as if it were not
    /// there, and are asked afterward.
    pub is_passed: bool,
}

impl Object {
    /// Whether other surfaces may be in the place `p` of its own.
    #[must_use]
    #[inline]
    pub fn may_touch(&self, p: DVec3) -> bool {
        self.contacts.iter().any(|region| region.contains(p))
    }
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

impl Sensor {
    /// All pixels of its film.
    #[must_use]
    pub fn whole_film(&self) -> Crop {
        let size = self.camera.resolution();
        Crop::whole(size.width, size.height)
    }
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
    /// Albedos of the rough lobes of the materials.
    pub albedos: AlbedoTables,
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
    /// Mirrors and glass, toward which lights send more.
    pub casters: Casters,
    /// Sensors.
    pub sensors: Vec<Sensor>,
    /// Distribution of wavelengths.
    pub wavelengths: WavelengthDistribution,
    /// The choice that it follows from.
    pub wavelength_settings: WavelengthSettings,
    /// Number of motions, whose placements a moment remembers.
    pub motions: usize,
    /// Whether anything moves: only then do paths draw a time.
    pub is_moving: bool,
    /// Effects that the scene calls for.
    pub effects: Vec<Effect>,
    /// Chains, once somebody has asked for them.
    chains: OnceLock<Chains>,
    /// Detectors that rays pass ([`Object::is_passed`]), with their sensors.
    pub passed: Vec<(InstanceId, usize)>,
    /// Whether any object is there only in part.
    pub has_coverage: bool,
    /// Polarization that smooth surfaces are computed for.
    pub polarization: Polarization,
    /// Sequences of surfaces that all paths are held to, if they are.
    pub sequences: Option<Sequences>,
    /// Surfaces that touch, or may touch.
    pub contacts: Vec<Contact>,
    /// Notes on what was put right when the scene was built.
    pub notes: Vec<String>,
    /// Power of two about which the values of its films lie; 0 but for extremely bright or dim
    /// lights.
    pub film_exponent: i32,
    /// Hash of the scene file and the files it refers to.
    pub hash: u64,
}

impl Scene {
    /// Chains of smooth surfaces that can be solved for. They are looked for when first asked for:
    /// most renders have no use for them.
    #[must_use]
    pub fn chains(&self) -> &Chains {
        self.chains.get_or_init(|| Chains::of(self))
    }

    /// Keeps the chains of these kinds alone, each by its [`Chains::name`].
    ///
    /// # Errors
    /// A name that no kind has; all are kept then.
    pub fn keep_chains(&mut self, names: &[String]) -> Result<(), UnknownChain> {
        let kept = self.chains().only(self, names)?;
        self.chains = OnceLock::from(kept);
        Ok(())
    }

    /// The object of an instance.
    #[must_use]
    #[inline]
    pub fn object(&self, id: InstanceId) -> &Object {
        &self.objects[id.0 as usize]
    }

    /// The material of this id.
    #[must_use]
    #[inline]
    pub fn material(&self, id: MaterialId) -> &Material {
        &self.materials[id.0 as usize]
    }

    /// The medium of this id.
    #[must_use]
    pub fn medium(&self, id: MediumId) -> &Medium {
        &self.media[id.0 as usize]
    }

    /// The light of this id.
    #[must_use]
    #[inline]
    pub fn light(&self, id: LightId) -> &Light {
        &self.lights[id.0 as usize]
    }

    /// The solids a light is in.
    #[must_use]
    pub fn light_stack(&self, id: LightId) -> &MediumStack {
        &self.light_stacks[id.0 as usize]
    }

    /// The material of an instance.
    fn material_of(&self, id: InstanceId) -> &Material {
        self.material(self.object(id).material)
    }

    /// The share of the surface that is there at a point, in [0, 1].
    #[must_use]
    pub fn coverage(&self, point: &SurfacePoint) -> f64 {
        let material = self.material_of(point.id.instance);
        material.coverage.as_ref().map_or(1.0, |c| c.at(point.uv))
    }

    /// The images of all materials and lights, each once.
    #[must_use]
    pub fn images(&self) -> Vec<Arc<Image>> {
        let mut all = Vec::new();
        self.materials
            .iter()
            .for_each(|m| m.append_images(&mut all));
        self.lights.iter().for_each(|l| l.append_images(&mut all));
        all.sort_by_key(Arc::as_ptr);
        all.dedup_by_key(|image| Arc::as_ptr(image));
        all
    }

    /// Whether the scene calls for an effect.
    #[must_use]
    pub fn has_effect(&self, kind: EffectKind) -> bool {
        self.effects.iter().any(|e| e.kind == kind && e.on)
    }

    /// Index of the sensor called `name`.
    #[must_use]
    pub fn sensor_index(&self, name: &str) -> Option<usize> {
        self.sensors.iter().position(|s| s.name == name)
    }
}
