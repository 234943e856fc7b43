//! `abbe convert`: an editable scene file that refers to a model.

use super::args::ConvertOptions;
use super::{CliError, Outcome, ending, print, tell};
use crate::io::atomic::{folder, write_atomic};
use crate::io::convert::scene_text;
use crate::io::destination::Claims;
use crate::io::model::Staging;
use crate::io::model_file::{self, ModelKind};
use crate::report::readable::counted;
use std::io::Write as _;
use std::path::Path;

/// Runs the command.
pub fn run(options: &ConvertOptions) -> Result<Outcome, CliError> {
    let path = &options.model;
    let kind = ModelKind::of(path)
        .ok_or_else(|| CliError::file(path, "not a model (allowed: .gltf, .glb, .obj, .ply)"))?;
    let name = name_from(&options.output, path)?;
    let read = model_file::load(path, kind, &Staging::default())
        .map_err(|message| CliError::file(path, message))?;
    let inputs = [path].into_iter().chain(&read.files);
    Claims::of_inputs(inputs).output(&options.output)?;
    ending::check(&options.output, "scenes are TOML files", &["toml"])?;
    if options.output.exists() && !options.overwrite {
        let message = "is there already (allowed: the name of a new file, or --overwrite)";
        return Err(CliError::file(&options.output, message));
    }
    for note in &read.notes {
        tell(&format!("warning: {note}"));
    }
    if read.animated && !read.cameras.is_empty() {
        tell("warning: cameras are written as they are at 0 s of the animations");
    }
    let text = scene_text(&read, kind, &name);
    write_atomic(&options.output, |file| file.write_all(text.as_bytes()))?;
    if !options.quiet {
        print(&format!(
            "{}: {}, {}, {} of {name}\n",
            options.output.display(),
            counted(read.objects.len() as u64, "object", "objects"),
            counted(read.cameras.len() as u64, "camera", "cameras"),
            counted(read.lights.len() as u64, "light", "lights")
        ))?;
    }
    Ok(Outcome::Done)
}

/// The model's path as the scene file must name it: in the scene's folder or below.
fn name_from(scene: &Path, model: &Path) -> Result<String, CliError> {
    let absolute = |path: &Path| {
        path.canonicalize()
            .map_err(|e| CliError::file(path, e.to_string()))
    };
    let (folder, inside) = (absolute(folder(scene))?, absolute(model)?);
    let relative = inside.strip_prefix(&folder).map_err(|_| {
        CliError::file(
            scene,
            format!(
                "the scene must lie in the folder of {} or above it",
                model.display()
            ),
        )
    })?;
    Ok(relative.to_string_lossy().replace('\\', "/"))
}
