//! Models: what a file of another program holds (glTF, OBJ with MTL, PLY), as parts of a scene.
//!
//! A model brings surfaces and materials, and what lights and cameras its file has;
//! [`Model::add_to`] puts it into a scene. Where a scene has no camera or light at all,
//! [`standard_camera`] and [`studio`] stand in.

use crate::camera::Camera;
use crate::camera::Resolution;
use crate::film::Filter;
use crate::geometry::{Instance, Shutter, Transform};
use crate::light::Light;
use crate::light::environment_image::EnvironmentImage;
use crate::material::{Material, MaterialId};
use crate::medium::{Boundary, Medium, MediumId};
use crate::scene::description::{
    LightDescription, ObjectDescription, SceneDescription, SensorDescription,
};
use crate::spectrum::Emission;
use crate::texture::Image;
use glam::{DAffine3, DMat3, DVec3};
use std::path::PathBuf;
use std::sync::Arc;

/// Most pixels of an image: the sums of 2^28 pixels take 26 GB.
pub const MAX_PIXELS: u64 = 1 << 28;
/// Largest model file.
pub const MAX_MODEL_BYTES: u64 = 2 << 30;

/// How a camera of a model projects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole.
    Perspective {
        /// Full vertical field of view.
        fov_rad: f64,
        /// Width by height of the picture, where the file says it.
        aspect: Option<f64>,
    },
    /// Parallel.
    Orthographic {
        /// Full height of the picture, meters.
        height: f64,
        /// Width by height of the picture.
        aspect: f64,
    },
}

/// A camera of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelCamera {
    /// Name in the file.
    pub name: String,
    /// Pose over the shutter: looks along -z, +y up.
    pub transform: Transform,
    /// How it projects.
    pub projection: Projection,
}

/// A model. Ids of materials and media count from 0 within it.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Media of its solids.
    pub media: Vec<Medium>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Name of each material in the file; several may have the same.
    pub material_names: Vec<String>,
    /// Surfaces, in the world.
    pub objects: Vec<ObjectDescription>,
    /// Lights that are no surfaces, in the world.
    pub lights: Vec<LightDescription>,
    /// Cameras, in the world.
    pub cameras: Vec<ModelCamera>,
    /// Whether it means to be lit by what it brings: it has lights, or its format knows no others
    /// than surfaces that emit. (Files of glTF without lights expect surroundings, glowing parts or
    /// not.)
    pub lit: bool,
    /// Whether animations play, whether or not they show in the time asked for.
    pub animated: bool,
    /// Notes on what was not understood or taken otherwise than the file may mean, one line each.
    pub notes: Vec<String>,
    /// Files that were read beside its own.
    pub files: Vec<PathBuf>,
    /// Hash of the files it was read from.
    pub hash: u64,
}

/// Where and when a model is shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Staging {
    /// To the world, meters.
    pub to_world: DAffine3,
    /// The moment of its animations at the time 0 of the scene, in seconds.
    pub at_s: f64,
    /// The animation that plays, by name or number; `None`: all, but those that move what an
    /// earlier one moves.
    pub animation: Option<String>,
    /// The time for which any shutter is open.
    pub shutter: Shutter,
}

impl Model {
    /// Adds all but the cameras to a scene.
    pub fn add_to(self, scene: &mut SceneDescription) {
        let media = scene.media.len() as u32;
        let materials = scene.materials.len() as u32;
        scene.media.extend(self.media);
        scene.materials.extend(self.materials);
        scene.objects.extend(self.objects.into_iter().map(|mut o| {
            o.material = MaterialId(o.material.0 + materials);
            if let Boundary::Solid { medium, .. } = &mut o.boundary {
                *medium = MediumId(medium.0 + media);
            }
            o
        }));
        scene.lights.extend(self.lights);
    }
}

impl ModelCamera {
    /// The sensor, as high as `resolution` and as wide as its own proportions ask for.
    #[must_use]
    pub fn sensor(
        &self,
        resolution: Resolution,
        filter: Filter,
        shutter: Shutter,
    ) -> SensorDescription {
        let aspect = match self.projection {
            Projection::Perspective { aspect, .. } => aspect,
            Projection::Orthographic { aspect, .. } => Some(aspect),
        };
        let width = aspect.map_or(resolution.width, |a| {
            let most = (MAX_PIXELS / u64::from(resolution.height)).min(1 << 16) as u32;
            ((f64::from(resolution.height) * a).round() as u32).clamp(1, most)
        });
        let resolution = Resolution {
            width,
            ..resolution
        };
        let transform = self.transform.clone();
        let camera = match self.projection {
            Projection::Perspective { fov_rad, .. } => {
                Camera::perspective(transform, resolution, fov_rad, None)
            }
            Projection::Orthographic { height, aspect } => {
                Camera::orthographic(transform, resolution, height * aspect)
            }
        };
        SensorDescription {
            name: self.name.clone(),
            camera,
            filter,
            shutter,
        }
    }
}

/// Makes the names of sensors unique and fit for file names.
pub fn name_sensors(sensors: &mut [SensorDescription]) {
    let fit = |c: char| {
        if c.is_alphanumeric() || "-_.".contains(c) {
            c
        } else {
            '-'
        }
    };
    for i in 0..sensors.len() {
        let name: String = sensors[i].name.chars().take(48).map(fit).collect();
        let name = name.trim_start_matches('.');
        let numbered = |k: usize| format!("{name}-{k}").trim_start_matches('-').to_owned();
        let free = |n: &String| !n.is_empty() && sensors[..i].iter().all(|s| s.name != *n);
        let own = std::iter::once(name.to_owned());
        let new = own.chain((i..).map(numbered)).find(free);
        sensors[i].name = new.expect("invariant: one of all numbers is free");
    }
}

/// A camera that sees all of `objects` from the front, a little from the right and from above.
#[must_use]
pub fn standard_camera(objects: &[ObjectDescription]) -> ModelCamera {
    const FOV_RAD: f64 = 0.6;
    let bounds = objects
        .iter()
        .map(|o| {
            Instance {
                shape: o.shape.clone(),
                transform: o.transform.clone(),
            }
            .bounds()
        })
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let (low, high) = bounds.unwrap_or((DVec3::NEG_ONE, DVec3::ONE));
    let (center, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let back = DVec3::new(0.45, 0.3, 1.0).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    // every corner of the bounds inside a picture of 4 by 3, with some room
    let reach = 0.85 * (FOV_RAD / 2.0).tan();
    let distance = (0..8)
        .map(|i| {
            let sign = |bit: u32| if i & bit == 0 { 1.0 } else { -1.0 };
            let corner = half * DVec3::new(sign(1), sign(2), sign(4));
            let side = corner.dot(up).abs().max(corner.dot(right).abs() * 0.75);
            corner.dot(back) + side / reach
        })
        .fold(f64::MIN_POSITIVE, f64::max);
    ModelCamera {
        name: "camera".to_owned(),
        transform: Transform::fixed(DAffine3 {
            matrix3: DMat3::from_cols(right, up, back),
            translation: center + back * distance,
        }),
        projection: Projection::Perspective {
            fov_rad: FOV_RAD,
            aspect: None,
        },
    }
}

/// The surroundings of models without light: a gray room with a large soft lamp at the upper left
/// and a strip behind, of mean luminance near that of `white`.
#[must_use]
pub fn studio(white: Emission, to_world: DMat3) -> Light {
    const WIDTH: u32 = 128;
    const HEIGHT: u32 = 64;
    let texel = |x: u32, y: u32| {
        // degrees right of -z, and above the horizon
        let right = (f64::from(x) + 0.5) / f64::from(WIDTH) * 360.0 - 180.0;
        let up = 90.0 - (f64::from(y) + 0.5) / f64::from(HEIGHT) * 180.0;
        // the camera looks along -z, so that what is behind it is near 180 degrees
        let lamp = (35.0..70.0).contains(&up) && (-165.0..-105.0).contains(&right);
        let strip = (5.0..50.0).contains(&up) && (35.0..50.0).contains(&right);
        let room = 0.35 + 0.25 * (up / 90.0);
        let value = if lamp {
            9.0
        } else if strip {
            6.0
        } else {
            room
        };
        [value as f32; 3]
    };
    let values = (0..HEIGHT)
        .flat_map(|y| (0..WIDTH).map(move |x| texel(x, y)))
        .collect();
    let image = Image::from_floats(WIDTH, HEIGHT, values)
        .ok()
        .and_then(|image| EnvironmentImage::new(Arc::new(image), to_world));
    Light::environment(white, image.map(Arc::new))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Shape;

    #[test]
    fn the_standard_camera_sees_the_model() {
        let object = ObjectDescription {
            name: "ball".to_owned(),
            shape: Shape::Sphere,
            transform: Transform::fixed(DAffine3::from_translation(DVec3::new(5.0, 0.0, 0.0))),
            material: MaterialId(0),
            boundary: Boundary::None,
            emission: None,
        };
        let camera = standard_camera(&[object]);
        let center = camera
            .transform
            .at(0.0)
            .to_object
            .transform_point3(DVec3::new(5.0, 0.0, 0.0));
        assert!(center.truncate().length() < 1e-9 && center.z < -3.0);
    }
}
