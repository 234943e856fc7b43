//! `abbe new`: commented scenes to begin with.

use super::args::{NewOptions, Template};
use super::{CliError, Outcome, print};
use std::fs::File;
use std::io::{ErrorKind, Write as _};
use std::path::Path;

/// Stands in templates for the name of the file beside the scene.
const COMPANION: &str = "{companion}";

impl Template {
    /// Text of the scene, and of the mesh beside it where it needs one.
    fn texts(self) -> (&'static str, Option<&'static str>) {
        match self {
            Self::Lens => (include_str!("lens.toml"), None),
            Self::Prism => (include_str!("prism.toml"), Some(include_str!("prism.obj"))),
            Self::Room => (include_str!("room.toml"), None),
            Self::Model => (include_str!("model.toml"), Some(include_str!("model.obj"))),
        }
    }
}

/// Runs the command.
pub fn run(options: &NewOptions) -> Result<Outcome, CliError> {
    let path = &options.file;
    let ending = path.extension().is_some_and(|e| e == "toml");
    // a scene names files in quotes, relative to its own folder
    let stem = path.file_stem().and_then(|s| s.to_str());
    let stem = stem.filter(|s| !s.contains(['"', '\\']) && !s.contains(char::is_control));
    let (true, Some(stem)) = (ending, stem) else {
        let message = "is no name for a scene file (allowed: NAME.toml)";
        return Err(CliError::file(path, message));
    };
    let (scene, mesh) = options.template.texts();
    let companion = format!("{stem}.obj");
    let mut files = vec![(path.clone(), scene.replace(COMPANION, &companion))];
    files.extend(mesh.map(|text| (path.with_file_name(&companion), text.to_owned())));
    for (path, _) in &files {
        if path.symlink_metadata().is_ok() {
            return Err(taken(path));
        }
    }
    for (path, text) in &files {
        write_new(path, text)?;
    }
    if !options.quiet {
        let names: Vec<String> = files.iter().map(|f| f.0.display().to_string()).collect();
        let next = format!("abbe render {}", path.display());
        print(&format!("{}: next {next}\n", names.join(", ")))?;
    }
    Ok(Outcome::Done)
}

fn taken(path: &Path) -> CliError {
    CliError::file(path, "is there already (allowed: the name of a new file)")
}

/// Writes a file that must not be there yet.
fn write_new(path: &Path, text: &str) -> Result<(), CliError> {
    let written = File::create_new(path).and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|e| match e.kind() {
        ErrorKind::AlreadyExists => taken(path),
        ErrorKind::NotFound => CliError::file(path, "the folder does not exist"),
        _ => CliError::file(path, e.to_string()),
    })
}
