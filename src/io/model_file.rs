//! The kinds of model files, and reading one of whatever kind.

use super::atomic::folder;
use super::files::read_regular;
use super::gltf::read as read_gltf;
use super::model::{MAX_MODEL_BYTES, Model, Staging};
use super::{mtl, ply};
use std::path::Path;

/// The kinds of model files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelKind {
    /// glTF 2.0, text or binary.
    Gltf,
    /// Wavefront OBJ with its MTL files.
    Obj,
    /// Polygon file format.
    Ply,
}

impl ModelKind {
    /// The kind of a file by its extension.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "gltf" | "glb" => Some(Self::Gltf),
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            _ => None,
        }
    }

    /// The key of a scene file that names such a file.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Gltf => "gltf",
            Self::Obj => "obj",
            Self::Ply => "ply",
        }
    }
}

/// Reads a model; files it names are looked for in its folder.
///
/// # Errors
/// Fault, in words, without the file's name.
pub fn load(path: &Path, kind: ModelKind, staging: &Staging) -> Result<Model, String> {
    let bytes = read_regular(path, MAX_MODEL_BYTES).map_err(|e| e.to_string())?;
    read(&bytes, path, kind, staging)
}

/// Reads a model from the bytes of its file.
///
/// # Errors
/// As [`load`].
pub fn read(
    bytes: &[u8],
    path: &Path,
    kind: ModelKind,
    staging: &Staging,
) -> Result<Model, String> {
    let to_world = staging.to_world;
    let folder = folder(path);
    match kind {
        ModelKind::Gltf => read_gltf(bytes, folder, staging),
        ModelKind::Obj => mtl::read(bytes, folder, to_world),
        ModelKind::Ply => ply::read(bytes).map(|loaded| Model {
            notes: loaded.notes,
            ..mtl::plain(loaded.mesh, loaded.origin, path, to_world)
        }),
    }
    .map(|mut model| {
        let emits = model.objects.iter().any(|o| o.emission.is_some());
        model.lit = !model.lights.is_empty() || kind == ModelKind::Obj && emits;
        model
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_by_extension() {
        assert_eq!(ModelKind::of(Path::new("a/b.GLB")), Some(ModelKind::Gltf));
        assert_eq!(ModelKind::of(Path::new("b.ply")), Some(ModelKind::Ply));
        assert_eq!(ModelKind::of(Path::new("b.toml")), None);
    }
}
