//! A whole scene file. Its parts are read in the order in which they need each other: the unit of
//! lengths and the wavelengths first, then the shutters of sensors, what others refer to by name,
//! and the shutters of models; all motion is laid out over those.

use super::document::{Node, Source, scene_hash};
use super::error::SceneFileErrors;
use super::keys::{Form, Given, Keys, Spec, Table, Value, keys};
use super::lens::Lenses;
use super::light::Lights;
use super::material::Materials;
use super::medium::Media;
use super::mesh::Meshes;
use super::model::{Loaded, Models};
use super::object::Objects;
use super::reader::Reader;
use super::render::{RenderKeys, Unit};
use super::sensor::{Pending, Sensors};
use super::sequence::{lens_names, resolve};
use super::spectrum::Spectra;
use super::value::{At, MediumName};
use super::{LoadedScene, Places};
use crate::math::hash::combine;
use crate::medium::MediumId;
use crate::scene::Subject;
use crate::scene::description::SceneDescription;
use std::path::Path;
use toml::de::DeTable;

keys! {
    /// A scene file.
    SceneKeys = "scene" {
        /// The unit of lengths.
        unit: Unit, default Unit;
        /// How the scene is rendered.
        render: Option<Given<RenderKeys>>;
        /// Medium where no solid is.
        ambient: Ambient, or "vacuum, n = 1";
        /// Cameras and detectors. At least one, but for scenes with a model: there the model's
        /// cameras, or one that sees all of it, stand in.
        sensor: Sensors;
        /// Spectra by name.
        spectrum: Spectra;
        /// Media by name.
        medium: Media;
        /// Materials by name.
        material: Materials;
        /// Files of other programs.
        model: Models;
        /// Meshes by name.
        mesh: Meshes;
        /// Surfaces.
        object: Objects;
        /// Lenses, each with all its surfaces.
        lens: Lenses;
        /// Lights that are no surfaces.
        light: Lights;
    }
}

/// The name of the ambient medium, which is looked up once media are known.
pub struct Ambient;

impl Value for Ambient {
    fn form() -> Form {
        MediumName::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        cx.ambient = Some(At::read(node, spec, cx)?);
        Some(Self)
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self)
    }
}

/// Reads a document; files it names are looked for in `folder`, if there is one.
///
/// # Errors
/// All its problems.
pub fn read(
    document: &DeTable<'_>,
    source: &Source,
    folder: Option<&Path>,
) -> Result<LoadedScene, SceneFileErrors> {
    let mut cx = Reader::new(source, folder);
    let table = Table::new(document, 0..0, SceneKeys::NAMES, &mut cx);
    let keys = SceneKeys::from_table(&table, &mut cx);
    let media = keys.as_ref().map_or(&[][..], |keys| &keys.medium.0);
    let models = Models::load(media, &mut cx);
    let scene = keys.and_then(|keys| keys.scene(models, scene_hash(document), &mut cx));
    match (scene, cx.into_errors()) {
        (Some(scene), None) => Ok(scene),
        (_, Some(errors)) => Err(errors),
        (None, None) => unreachable!("invariant: what cannot be read is reported"),
    }
}

impl SceneKeys {
    fn scene(self, models: Loaded, hash_of_text: u64, cx: &mut Reader<'_>) -> Option<LoadedScene> {
        // what others refer to by name has been left with the reader
        let Self {
            unit: Unit,
            ambient: Ambient,
            spectrum: Spectra,
            mesh: Meshes,
            sensor: Sensors { count, read },
            ..
        } = self;
        if count == 0 && self.model.count == 0 {
            let message = "the scene has no sensor (allowed: at least one [[sensor]])";
            cx.conflict(&(0..0), message);
        }
        for (index, named) in std::mem::take(&mut cx.sensor_media) {
            let found = cx.defined("medium", &named.value.0, &named.at, |cx| &cx.media);
            let subject = Subject::Sensor(index);
            cx.named_media.extend(found.map(|id| (subject, id)));
        }
        if cx.error_count() > 0 {
            return None;
        }
        let shutter = cx.shutter.unwrap_or_default();
        let mut read = read;
        for pending in &mut read {
            let Some(film) = &pending.film else { continue };
            let camera = &mut pending.sensor.value.camera;
            let found = self.lens.find(&film.lens.value);
            let made = found.and_then(|lens| film.camera(camera.resolution(), lens, shutter));
            match made {
                Ok(placed) => *camera = placed,
                Err(message) => cx.conflict(&film.lens.at, message),
            }
        }
        if cx.error_count() > 0 {
            return None;
        }
        let rendering = self.render.and_then(|given| given.0).unwrap_or_default();
        let place = |at: &std::ops::Range<usize>| cx.place(at.start);
        let mut places = Places {
            objects: self.object.0.iter().map(|o| place(&o.at)).collect(),
            lights: self.light.0.iter().map(|l| place(&l.at)).collect(),
            sensors: read.iter().map(|s| place(&s.sensor.at)).collect(),
            chains: rendering.chains.as_ref().map(|c| place(&c.at)),
        };
        let is_instant = |s: &Pending| s.sensor.value.shutter.is_instant();
        if cx.moves && read.iter().all(is_instant) {
            let warning =
                "things move, but every shutter is open for a moment only: nothing is blurred";
            cx.warnings.push(warning.to_owned());
        }
        let sensors = read.into_iter().map(|pending| {
            let mut sensor = pending.sensor.value;
            if !pending.motion.is_empty() {
                sensor.camera = sensor.camera.under(&pending.motion, shutter);
            }
            sensor
        });
        let file_hashes = cx.file_hashes.iter();
        let mut description = SceneDescription {
            media: self.medium.0,
            materials: self.material.0,
            objects: self.object.0.into_iter().map(|o| o.value).collect(),
            lights: self.light.0.into_iter().map(|l| l.value).collect(),
            sensors: sensors.collect(),
            named_media: std::mem::take(&mut cx.named_media),
            wavelengths: rendering.wavelengths,
            polarization: rendering.polarization,
            sequences: None,
            caster_share: rendering.caster_share,
            ambient: MediumId::AMBIENT,
            hash: file_hashes.fold(hash_of_text, |hash, &file| combine(hash, file)),
        };
        let lenses = lens_names(&self.lens);
        for lens in self.lens.0 {
            let at = cx.place(lens.at.start);
            lens.value.add_to(&mut description, cx);
            places.objects.resize(description.objects.len(), at);
        }
        models.add_to(&mut description, rendering.units, cx);
        if let Some(choice) = &rendering.sequences {
            description.sequences = resolve(choice, &description, &lenses, cx);
        }
        let mut warnings = std::mem::take(&mut cx.warnings);
        warnings.append(&mut cx.notes);
        Some(LoadedScene {
            description,
            settings: rendering.settings,
            units: rendering.units,
            chains: (rendering.chains)
                .map(|chains| chains.value.into_iter().map(|name| name.0).collect()),
            warnings,
            places,
            files: cx.files(),
        })
    }
}
