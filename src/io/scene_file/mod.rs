//! Scene files (TOML): text -> document -> schema -> checked plan -> scene description.
//!
//! Every problem of a file is found in one go and carries its place: syntax by the parser, keys and types by
//! [`document::read_all`], values and names by [`check`](check::check), library names and meshes by [`resolve`].
//! `scenes/README.md` is the reference of every key.

mod check;
pub mod document;
mod error;
mod plan;
mod resolve;
mod schema;

pub use error::{Place, Problem, SceneFileError, SceneFileErrors};
pub use schema::OutputUnits;

use crate::io::atomic::folder;
use crate::io::convert::shortest_scene;
use crate::io::files::{self, FileProblem};
use crate::io::model_file::ModelKind;
use crate::math::hash::combine;
use crate::scene::description::SceneDescription;
use crate::scene::settings::Settings;
use check::Names;
use document::Source;
use plan::Plan;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// A scene file, read.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// What to build the scene from.
    pub description: SceneDescription,
    /// The `[render]` table over the defaults.
    pub settings: Settings,
    /// Scale of the output image.
    pub units: OutputUnits,
    /// What is legal but surely not meant, one line each.
    pub warnings: Vec<String>,
}

/// A checked scene file: all that can be said without the libraries of spectra and glasses and without reading meshes.
#[derive(Clone, Debug)]
pub struct CheckedScene {
    plan: Plan,
    /// Hash of what the file says (without `[render]`) and of the files it names.
    pub hash: u64,
    /// As in [`LoadedScene`].
    pub warnings: Vec<String>,
    source: Source,
}

/// Reads a scene file, or a model as the scene it makes by itself, with `overrides` (dotted key, value) applied.
///
/// # Errors
/// All problems of the file.
pub fn load(path: &Path, overrides: &[(String, String)]) -> Result<LoadedScene, SceneFileErrors> {
    let name = path.display().to_string();
    let text = match ModelKind::of(path) {
        Some(kind) => {
            let file = path.file_name().unwrap_or_default().to_string_lossy();
            shortest_scene(kind, &file)
        }
        None => {
            read_scene_text(path).map_err(|problem| SceneFileErrors::whole_file(&name, problem))?
        }
    };
    finish(check_str(&text, &name, folder(path), overrides)?)
}

/// Reads a scene from text; files it names are looked for in `folder`.
///
/// # Errors
/// All problems of the text.
pub fn parse_str(text: &str, folder: &Path) -> Result<LoadedScene, SceneFileErrors> {
    finish(check_str(text, "scene", folder, &[])?)
}

/// Everything but [`resolve`]: `name` stands for the file in messages.
///
/// # Errors
/// All problems of the text.
pub fn check_str(
    text: &str,
    name: &str,
    folder: &Path,
    overrides: &[(String, String)],
) -> Result<CheckedScene, SceneFileErrors> {
    let source = Source::new(name, text, overrides);
    let (plan, hash, warnings) = check_source(&source, folder).map_err(|errors| {
        SceneFileErrors::from_unsorted(errors).unwrap_or_else(|| {
            SceneFileErrors::whole_file(name, Problem::Form("nothing could be read".to_owned()))
        })
    })?;
    Ok(CheckedScene {
        plan,
        hash,
        warnings,
        source,
    })
}

fn check_source(
    source: &Source,
    folder: &Path,
) -> Result<(Plan, u64, Vec<String>), Vec<SceneFileError>> {
    let mut document = document::parse(source)?;
    document::apply_overrides(&mut document, source)?;
    let names = Names {
        spectra: document::names(&document, "spectrum"),
        media: document::names(&document, "medium"),
        materials: document::names(&document, "material"),
        meshes: document::names(&document, "mesh"),
    };
    let mut errors = Vec::new();
    let (file, incomplete) = document::read_all(&document, source, &mut errors);
    let Some(file) = file else { return Err(errors) };
    let (plan, mut checker) = check::check(&file, source, folder, &names);
    // that a table lacks what was taken out of it is no news
    let follows = |e: &SceneFileError| {
        matches!(e.problem, Problem::Conflict(_)) && incomplete.contains(&e.place)
    };
    checker.errors.retain(|e| !follows(e));
    errors.append(&mut checker.errors);
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut hash = document::scene_hash(&document);
    for path in &checker.files {
        // a file that vanished since it was checked is reported when it is read
        hash = combine(hash, hash_file(path).unwrap_or(0));
    }
    Ok((plan, hash, checker.warnings))
}

fn finish(checked: CheckedScene) -> Result<LoadedScene, SceneFileErrors> {
    let CheckedScene {
        plan,
        hash,
        mut warnings,
        source,
    } = checked;
    let (settings, units) = (plan.settings.clone(), plan.units);
    let (description, notes) = resolve::resolve(&plan, hash, &source)?;
    warnings.extend(notes);
    Ok(LoadedScene {
        description,
        settings,
        units,
        warnings,
    })
}

fn read_scene_text(path: &Path) -> Result<String, Problem> {
    let name = path.display().to_string();
    let bad = |message: String| {
        Problem::from(FileProblem::Bad {
            path: name.clone(),
            message,
        })
    };
    let file = File::open(path).map_err(|e| bad(e.to_string()))?;
    let mut bytes = Vec::new();
    file.take(files::MAX_SCENE_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(|e| bad(e.to_string()))?;
    if bytes.len() as u64 > files::MAX_SCENE_BYTES {
        let size = path.metadata().map_or(bytes.len() as u64, |m| m.len());
        return Err(FileProblem::TooLarge {
            path: name,
            bytes: size,
            limit: files::MAX_SCENE_BYTES,
        }
        .into());
    }
    String::from_utf8(bytes).map_err(|e| {
        bad(format!(
            "not UTF-8 at byte {}",
            e.utf8_error().valid_up_to()
        ))
    })
}

fn hash_file(path: &Path) -> std::io::Result<u64> {
    let mut file = File::open(path)?;
    let mut block = vec![0; 1 << 16];
    let mut hash = 0;
    loop {
        // blocks are filled, so that the hash does not depend on how the system cuts the file
        let mut filled = 0;
        while filled < block.len() {
            match file.read(&mut block[filled..])? {
                0 => break,
                n => filled += n,
            }
        }
        if filled == 0 {
            return Ok(hash);
        }
        hash = combine(hash, crate::math::hash::hash_bytes(&block[..filled]));
    }
}

/// Checks any bytes as a scene file: must not panic. Files are not looked for.
pub fn fuzz_scene(bytes: &[u8]) {
    if let Ok(text) = std::str::from_utf8(bytes) {
        // the outcome does not matter
        _ = check_str(text, "fuzz", Path::new("/nonexistent"), &[]);
    }
}
