//! `[[model]]`: files of other programs with all they hold.

use super::document::Node;
use super::keys::{Build, Built, Form, Keys, Spec, Table, Value, keys};
use super::reader::Reader;
use super::replacement::{Interiors, Replacements, replace};
use super::sensor::{DEFAULT_RESOLUTION, EDGE, Size};
use super::transform::Steps;
use super::value::{AnimationName, At, FileName, items};
use crate::geometry::Shutter;
use crate::io::gltf::PER_NIT;
use crate::io::model::{self, MAX_MODEL_BYTES, Model, ModelCamera, Staging};
use crate::io::model_file::{self, ModelKind};
use crate::math::hash::combine;
use crate::medium::Medium;
use crate::scene::description::{LightDescription, SceneDescription, SensorDescription};
use crate::scene::settings::OutputUnits;
use crate::spectrum::Emission;
use glam::{DAffine3, DMat3, DVec3};
use std::path::PathBuf;

keys! {
    /// A file of another program with all it holds, by exactly one of `gltf`, `obj` and `ply`.
    ModelKeys = "model" {
        /// glTF 2.0 (`.gltf`, `.glb`), in meters.
        gltf: Option<At<FileName>>;
        /// Wavefront OBJ with its MTL files, in the file's unit.
        obj: Option<At<FileName>>;
        /// PLY, ASCII or binary, in the file's unit; light gray.
        ply: Option<At<FileName>>;
        /// Steps that place it, applied in order.
        transform: Steps;
        /// With `gltf`: the moment of its animations at the time 0 of the scene.
        at: Option<f64>, unit "seconds", or "0";
        /// With `gltf`: name or number (from 0) of the only animation that plays.
        animation: Option<AnimationName>, or "all, but those that move what an earlier one moves";
        /// Columns and rows of its cameras, at most 2^28 pixels in all; the width follows the
        /// camera's own proportions.
        resolution: Size, in EDGE, unit "pixels", default DEFAULT_RESOLUTION;
        /// The `shutter` of its cameras.
        shutter: Shutter, unit "seconds", default Shutter::default();
        /// Whether its lights (`KHR_lights_punctual`) are taken.
        lights: bool, default true;
        /// Materials that take the place of those of the file, by the names they have there.
        material: Replacements;
        /// Media inside closed meshes of the file, by the names of their materials, which must be
        /// `dielectric`.
        interior: Interiors;
    }
}

/// A model whose file has been found but not read: when its animations show is known once all
/// shutters are.
pub struct Unread {
    file: At<FileName>,
    path: PathBuf,
    kind: ModelKind,
    staging: Staging,
    size: Size,
    lights: bool,
    materials: Replacements,
    interiors: Interiors,
}

impl Build for ModelKeys {
    type Output = Unread;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Unread> {
        let chosen = table.exactly_one(&["gltf", "obj", "ply"], "model", cx)?;
        let (file, kind, unit_m) = match chosen {
            "gltf" => (self.gltf?, ModelKind::Gltf, 1.0),
            "obj" => (self.obj?, ModelKind::Obj, cx.unit_m),
            _ => (self.ply?, ModelKind::Ply, cx.unit_m),
        };
        let path = cx.find(&file, MAX_MODEL_BYTES);
        let to_world = self.transform.0 * DAffine3::from_scale(DVec3::splat(unit_m));
        let volume = to_world.matrix3.determinant().abs();
        if volume.is_nan() || volume < f64::MIN_POSITIVE {
            let message =
                "the model has no volume after its transform (allowed: an invertible transform)";
            cx.conflict(&table.at, message);
        }
        for key in ["at", "animation"] {
            if table.get(key).is_some() && kind != ModelKind::Gltf {
                cx.conflict(&table.span(key), format!("{key} is for gltf only"));
            }
        }
        table.sound(cx)?;
        Some(Unread {
            file,
            path: path?,
            kind,
            staging: Staging {
                to_world,
                at_s: self.at.unwrap_or(0.0),
                animation: self.animation.map(|a| a.0),
                shutter: self.shutter,
            },
            size: self.resolution,
            lights: self.lights,
            materials: self.material,
            interiors: self.interior,
        })
    }
}

/// `[[model]]`. Where there is no sensor, their shutters are those of the scene.
#[derive(Default)]
pub struct Models {
    /// How many there are, also of those that are wrong.
    pub count: usize,
}

impl Value for Models {
    fn form() -> Form {
        Form::List(Box::new(Form::Table(ModelKeys::KIND)))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let list = items(node, "an array", cx)?;
        let count = list.len();
        let read: Vec<Unread> = list
            .into_iter()
            .filter_map(|item| Built::<ModelKeys>::read(item, spec, cx))
            .map(|built| built.0)
            .collect();
        let shutters = read.iter().map(|model| model.staging.shutter);
        cx.shutter = cx.shutter.or(shutters.reduce(Shutter::union));
        cx.models = read;
        Some(Self { count })
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self::default())
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}

impl Models {
    /// Reads the files of the models; what is legal but not understood is noted. `media`: those of
    /// the scene.
    pub fn load(media: &[Medium], cx: &mut Reader<'_>) -> Loaded {
        let unread = std::mem::take(&mut cx.models);
        // in the hash of the scene, models stand before objects
        let files_of_objects = cx.file_hashes.split_off(cx.files_before_objects);
        let first = unread.first().map(|m| (m.size, m.staging.shutter));
        let mut all = Loaded {
            models: Vec::new(),
            cameras: Vec::new(),
            first,
        };
        let shutter = cx.shutter.unwrap_or_default();
        for unread in unread {
            let own_shutter = unread.staging.shutter;
            let staging = Staging {
                shutter,
                ..unread.staging
            };
            let Some(bytes) = cx.bytes(&unread.file, &unread.path) else {
                continue;
            };
            let mut model = match model_file::read(&bytes, &unread.path, unread.kind, &staging) {
                Ok(model) => model,
                Err(message) => {
                    cx.bad_file(&unread.file, message);
                    continue;
                }
            };
            if !unread.lights {
                model.lights.clear();
                model.lit = false;
            }
            replace(&mut model, unread.materials, unread.interiors, media, cx);
            cx.file_notes(&unread.file, std::mem::take(&mut model.notes));
            cx.model_files.append(&mut model.files);
            let filter = cx.film_filter(None, None, false);
            let sensor = |c: &ModelCamera| c.sensor(unread.size.resolution(), filter, own_shutter);
            all.cameras.extend(model.cameras.iter().map(sensor));
            all.models.push(model);
        }
        cx.file_hashes.extend(files_of_objects);
        all
    }
}

/// Models that have been read.
pub struct Loaded {
    models: Vec<Model>,
    cameras: Vec<SensorDescription>,
    /// Size and shutter of the first.
    first: Option<(Size, Shutter)>,
}

impl Loaded {
    /// Adds the models to a scene, and what it lacks: their cameras where it has no sensor or one
    /// that sees all of it, and a studio where there is no light.
    pub fn add_to(mut self, scene: &mut SceneDescription, units: OutputUnits, cx: &mut Reader<'_>) {
        let emits = scene.objects.iter().any(|o| o.emission.is_some());
        let mut lit = emits || !scene.lights.is_empty();
        for model in self.models {
            lit |= model.lit;
            scene.hash = combine(scene.hash, model.hash);
            model.add_to(scene);
        }
        let Some((size, shutter)) = self.first else {
            return;
        };
        if scene.sensors.is_empty() {
            if self.cameras.is_empty() {
                cx.notes
                    .push("no camera: one that sees all of the model is used".to_owned());
                let filter = cx.film_filter(None, None, false);
                let camera = model::standard_camera(&scene.objects);
                self.cameras
                    .push(camera.sensor(size.resolution(), filter, shutter));
            }
            model::name_sensors(&mut self.cameras);
            scene.sensors = self.cameras;
        }
        if !lit {
            cx.notes
                .push("no light: a studio of built-in lamps is used".to_owned());
            let level = match units {
                OutputUnits::Radiance => 1.0,
                OutputUnits::Photometric => PER_NIT,
            };
            scene.lights.push(LightDescription {
                name: "studio".to_owned(),
                light: model::studio(Emission::from_rgb([level; 3]), DMat3::IDENTITY),
            });
        }
    }
}
