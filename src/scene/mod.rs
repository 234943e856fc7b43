//! The immutable scene: everything the transport needs, validated when it is built.

pub mod build;
pub mod description;
pub mod effects;
pub mod frozen;
pub mod moving;
pub mod probe;
pub mod regularization;
pub mod settings;

pub use build::{BuildError, Subject};
pub use description::SceneDescription;
pub use settings::Settings;

use crate::camera::Camera;
use crate::film::{Crop, Filter};
use crate::geometry::{Accel, InstanceId, Ray, Shutter, SurfacePoint};
use crate::light::selection::LightSelection;
use crate::light::{Light, LightContext, LightId};
use crate::material::{Material, MaterialId};
use crate::medium::{Boundary, Medium, MediumStack};
use crate::spectrum::WavelengthDistribution;
use crate::texture::Image;
use effects::Effect;
use glam::DVec3;
use std::sync::Arc;

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
    /// It is there only in part: its material has a coverage.
    pub covered: bool,
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
    /// Whether any object is there only in part.
    pub has_coverage: bool,
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

    /// What an object is made of.
    fn material_of(&self, id: InstanceId) -> &Material {
        &self.materials[self.objects[id.0 as usize].material.0 as usize]
    }

    /// The share of the surface that is there at a point, in [0, 1].
    #[must_use]
    pub fn coverage(&self, point: &SurfacePoint) -> f64 {
        let material = self.material_of(point.id.instance);
        material.coverage.as_ref().map_or(1.0, |c| c.at(point.uv))
    }

    /// The product of what the objects with a coverage leave open along a segment.
    #[must_use]
    pub fn uncovered(&self, ray: &Ray) -> f64 {
        let (mut ray, mut open) = (*ray, 1.0);
        while open > 0.0
            && let Some(hit) = self
                .accel
                .closest(&ray, |id| self.objects[id.0 as usize].covered)
        {
            let point = self.accel.surface(&ray, &hit);
            open *= 1.0 - self.coverage(&point);
            ray = Ray {
                o: point.p,
                t_max: ray.t_max - hit.t,
                start: Some(point.id),
                ..ray
            };
        }
        open
    }

    /// The point with the shading normal of its material: the one place where normals are bent, for all strategies.
    #[must_use]
    pub fn shading_point(&self, mut point: SurfacePoint, time: f64) -> SurfacePoint {
        if let Some(map) = &self.material_of(point.id.instance).normal {
            point.ns = map.normal(&point, self.accel.tangents(&point, time));
        }
        point
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

    /// Index of the sensor called `name`.
    #[must_use]
    pub fn sensor_index(&self, name: &str) -> Option<usize> {
        self.sensors.iter().position(|s| s.name == name)
    }
}
