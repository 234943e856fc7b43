//! glTF 2.0 (`.gltf`, `.glb`), read through the typed JSON of the `gltf` crate.
//!
//! The crate's own walk over a file trusts its indices; here every index, range and count is
//! checked as it is used, so that whatever the bytes, the result is a model or a [`Fault`].
//! Candela, lux and nit are photometric, shaped by D65.

mod animation;
mod buffers;
mod deform;
mod glass;
mod hierarchy;
mod material;
mod mesh;
mod nodes;

use super::model::{Model, Staging};
use crate::geometry::Shutter;
use crate::math::hash::combine;
use buffers::Buffers;
use gltf::json::Root;
pub use material::PER_NIT;
use std::collections::BTreeSet;
use std::path::Path;

/// Extensions that are understood, fully or as far as pictures need them.
const UNDERSTOOD: [&str; 12] = [
    "KHR_lights_punctual",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    // changes nothing that is read
    "KHR_materials_variants",
    "KHR_xmp_json_ld",
];
/// Most triangles of all meshes together.
const MAX_TRIANGLES: usize = 100 << 20;

/// Fault of a file, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault(pub String);

impl Fault {
    fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }

    fn missing(what: &str, index: usize) -> Self {
        Self(format!("{what} {index} does not exist"))
    }
}

/// State of a reading: what it needs and gathers.
struct Reader<'a> {
    root: &'a Root,
    buffers: &'a Buffers<'a>,
    folder: &'a Path,
    staging: &'a Staging,
    model: Model,
    /// Notes already in the model: each is said once.
    said: BTreeSet<String>,
    images: material::Images,
    /// Places of vertices that were computed for morph targets and skins.
    places: usize,
}

impl Reader<'_> {
    fn note(&mut self, text: String) {
        if self.said.insert(text.clone()) {
            self.model.notes.push(text);
        }
    }
}

/// Reads the bytes of a file whose URIs are relative to `folder`, placed in space and time by
/// `staging`.
///
/// # Errors
/// Fault, in words, without the file's name.
pub fn read(bytes: &[u8], folder: &Path, staging: &Staging) -> Result<Model, String> {
    parse(bytes, folder, staging).map_err(|fault| fault.0)
}

/// Reads any bytes as a file without others beside it: must not panic.
pub fn fuzz_gltf(bytes: &[u8]) {
    let staging = Staging {
        at_s: 0.25,
        shutter: Shutter {
            open_s: 0.0,
            close_s: 0.5,
        },
        ..Staging::default()
    };
    // the outcome does not matter
    _ = read(bytes, Path::new("/nonexistent"), &staging);
}

fn parse(bytes: &[u8], folder: &Path, staging: &Staging) -> Result<Model, Fault> {
    let (json, chunk) = container(bytes)?;
    let root = Root::from_slice(json).map_err(|e| Fault::new(format!("not glTF: {e}")))?;
    let lacking: Vec<&str> = root
        .extensions_required
        .iter()
        .map(String::as_str)
        .filter(|e| !UNDERSTOOD.contains(e))
        .collect();
    if !lacking.is_empty() {
        return Err(Fault::new(format!(
            "the file requires extensions that are not supported: {}",
            lacking.join(", ")
        )));
    }
    let version = root.asset.min_version.as_deref().unwrap_or("2.0");
    if !root.asset.version.starts_with("2.") || !version.starts_with("2.") {
        return Err(Fault::new(format!(
            "glTF version \"{}\" (supported: 2)",
            root.asset.version
        )));
    }
    let buffers = Buffers::read(&root, folder, chunk)?;
    let mut reader = Reader {
        root: &root,
        buffers: &buffers,
        folder,
        staging,
        model: Model {
            files: buffers.files.clone(),
            hash: buffers.hash,
            ..Model::default()
        },
        said: BTreeSet::new(),
        images: material::Images::default(),
        places: 0,
    };
    for extension in &root.extensions_used {
        if !UNDERSTOOD.contains(&extension.as_str()) {
            reader.note(format!("extension {extension} is not understood: ignored"));
        }
    }
    reader.scene()?;
    Ok(reader.model)
}

/// The JSON text and the binary chunk of a file.
fn container(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Fault> {
    let word = |at: usize| {
        let b = bytes.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    };
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let truncated = || Fault::new("truncated GLB file");
    let (version, length) = (
        word(4).ok_or_else(truncated)?,
        word(8).ok_or_else(truncated)? as usize,
    );
    if version != 2 {
        return Err(Fault::new(format!("GLB version {version} (supported: 2)")));
    }
    if length > bytes.len() {
        return Err(Fault::new(format!(
            "truncated GLB file: {} bytes of {length}",
            bytes.len()
        )));
    }
    let chunk = |at: usize| -> Result<&[u8], Fault> {
        let size = word(at).ok_or_else(truncated)? as usize;
        let start = at.checked_add(8).ok_or_else(truncated)?;
        let end = start.checked_add(size).ok_or_else(truncated)?;
        bytes.get(start..end).ok_or_else(|| {
            Fault::new(format!(
                "truncated GLB file: a chunk of {size} bytes at byte {at}, the file has {}",
                bytes.len()
            ))
        })
    };
    let is =
        |at: usize, kind: &[u8; 4]| word(at.saturating_add(4)) == Some(u32::from_le_bytes(*kind));
    if !is(12, b"JSON") {
        return Err(Fault::new("the first GLB chunk is not JSON"));
    }
    let json = chunk(12)?;
    let mut end = 20 + json.len();
    loop {
        // chunks are padded to words; some writers leave that out, and the next one follows
        // directly
        let padded = end.next_multiple_of(4);
        let next = if is(padded, b"BIN\0") || !is(end, b"BIN\0") {
            padded
        } else {
            end
        };
        if next.saturating_add(8) > bytes.len() {
            return Ok((json, None));
        }
        let found = chunk(next)?;
        if is(next, b"BIN\0") {
            return Ok((json, Some(found)));
        }
        // chunks of unknown types are to be ignored (glTF 2.0, 4.4.3.1)
        end = next + 8 + found.len();
    }
}

/// A hash of further bytes.
fn hashed(hash: u64, bytes: &[u8]) -> u64 {
    combine(hash, crate::math::hash::hash_bytes(bytes))
}
