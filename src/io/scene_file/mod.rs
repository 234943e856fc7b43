//! Scene files (TOML): text -> document -> scene description, by keys.
//!
//! One file per kind of thing declares its keys ([`keys`]) and makes the renderer's own type of
//! them. Every problem of a file is found in one go and carries its place, names of the library and
//! meshes included. Each file is read once: bytes, hash, contents. `docs/scene-files.md` is the
//! reference of every key.

mod aim;
mod coating;
mod document;
mod error;
mod film;
mod keys;
mod lens;
mod light;
mod material;
mod medium;
mod mesh;
mod model;
mod motion;
mod object;
mod reader;
pub mod reference;
mod render;
mod replacement;
mod scene;
mod sensor;
mod sequence;
mod shape;
mod spectrum;
#[cfg(test)]
mod tests;
mod texture;
mod transform;
mod value;

pub use crate::scene::settings::OutputUnits;
pub use error::{Place, Problem, SceneFileError, SceneFileErrors};

use crate::io::atomic::folder;
use crate::io::convert::shortest_scene;
use crate::io::files;
use crate::io::model_file::ModelKind;
use crate::scene::chains::UnknownChain;
use crate::scene::description::SceneDescription;
use crate::scene::settings::Settings;
use crate::scene::{BuildError, Subject};
use document::Source;
use std::fmt::Display;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A scene file, read.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// Description to build the scene from.
    pub description: SceneDescription,
    /// The `[render]` table over the defaults.
    pub settings: Settings,
    /// Scale of the output image.
    pub units: OutputUnits,
    /// Kinds of chains that are solved for; `None`: all.
    pub chains: Option<Vec<String>>,
    /// Warnings of what is legal but surely not meant, one line each.
    pub warnings: Vec<String>,
    /// Where the parts of the description stand in the file.
    pub places: Places,
    /// Files that were read, its own included.
    pub files: Vec<PathBuf>,
}

/// Places of the objects, lights and sensors of a scene file, by their index in the description,
/// and of the chains that are solved for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Places {
    objects: Vec<Place>,
    lights: Vec<Place>,
    sensors: Vec<Place>,
    chains: Option<Place>,
}

impl Places {
    /// The problem of a description that is no scene, at its place in the file (the file as a whole
    /// for parts that models brought).
    #[must_use]
    pub fn build_error(&self, path: &Path, error: &BuildError) -> SceneFileErrors {
        let place = error.subject().and_then(|subject| match subject {
            Subject::Emission(i) | Subject::Object(i) => self.objects.get(i),
            Subject::Light(i) => self.lights.get(i),
            Subject::Sensor(i) => self.sensors.get(i),
        });
        Self::problem(path, place, error)
    }

    /// The same of a kind of chains that the scene does not have.
    #[must_use]
    pub fn chain_error(&self, path: &Path, error: &UnknownChain) -> SceneFileErrors {
        Self::problem(path, self.chains.as_ref(), error)
    }

    fn problem(path: &Path, place: Option<&Place>, error: &dyn Display) -> SceneFileErrors {
        SceneFileErrors::one(
            &path.display().to_string(),
            place.cloned().unwrap_or(Place::File),
            Problem::Conflict(error.to_string()),
        )
    }
}

/// Length of a text in bytes up to which it is asked whether it is TOML.
const MOST_ASKED: usize = 1 << 20;

/// Reads a scene file, or a model as the scene it makes by itself, with `overrides` (dotted key,
/// value) applied.
///
/// # Errors
/// All problems of the file.
pub fn load(path: &Path, overrides: &[(String, String)]) -> Result<LoadedScene, SceneFileErrors> {
    let name = path.display().to_string();
    let whole = |problem| SceneFileErrors::whole_file(&name, problem);
    let mut scene = match ModelKind::of(path) {
        Some(kind) => {
            let file = path.file_name().unwrap_or_default().to_string_lossy();
            let text = shortest_scene(kind, &file);
            read_str(&text, &name, folder(path), overrides).map_err(SceneFileErrors::of_model)?
        }
        None => {
            let named = path.extension().is_none_or(|e| e == "toml");
            let foreign = || {
                let message = "is no scene file (TOML), and its ending is none of a model's \
                               (allowed: .toml, .gltf, .glb, .obj, .ply)";
                whole(Problem::Form(message.to_owned()))
            };
            let bytes = read_scene_bytes(path).map_err(whole)?;
            let text = String::from_utf8(bytes).map_err(|e| {
                if !named {
                    return foreign();
                }
                let at = e.utf8_error().valid_up_to();
                whole(Problem::Form(format!("not UTF-8 at byte {at}")))
            })?;
            read_str(&text, &name, folder(path), overrides).map_err(|errors| {
                if named || text.len() > MOST_ASKED || text.parse::<toml::Table>().is_ok() {
                    return errors;
                }
                foreign()
            })?
        }
    };
    scene.files.push(path.to_owned());
    Ok(scene)
}

/// Reads a scene from text; files it names are looked for in `folder`.
///
/// # Errors
/// All problems of the text.
pub fn parse_str(text: &str, folder: &Path) -> Result<LoadedScene, SceneFileErrors> {
    read_str(text, "scene", folder, &[])
}

/// As [`parse_str`], with `overrides` applied; `name` stands for the file in messages.
///
/// # Errors
/// All problems of the text.
pub fn read_str(
    text: &str,
    name: &str,
    folder: &Path,
    overrides: &[(String, String)],
) -> Result<LoadedScene, SceneFileErrors> {
    read_source(&Source::new(name, text, overrides), Some(folder))
}

fn read_source(source: &Source, folder: Option<&Path>) -> Result<LoadedScene, SceneFileErrors> {
    let mut document = document::parse(source)?;
    document::apply_overrides(&mut document, source)?;
    scene::read(&document, source, folder)
}

fn read_scene_bytes(path: &Path) -> Result<Vec<u8>, Problem> {
    files::read_regular(path, files::MAX_SCENE_BYTES).map_err(|e| match e.kind() {
        ErrorKind::NotFound => Problem::no_file(),
        _ => Problem::Form(e.to_string()),
    })
}

/// Reads any bytes as a scene file whose files are all missing: must not panic.
pub fn fuzz_scene(bytes: &[u8]) {
    if let Ok(text) = std::str::from_utf8(bytes) {
        // the outcome does not matter
        _ = read_source(&Source::new("fuzz", text, &[]), None);
    }
}
