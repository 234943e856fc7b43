//! `[mesh.NAME]` and `mesh` of objects: a file, or one per moment.

use super::document::Node;
use super::keys::{Build, Built, Form, Keys, Spec, Table, Value, keys};
use super::reader::{MeshKey, Reader, definitions};
use super::shape::Placed;
use super::value::{At, FileName};
use crate::geometry::Shape;
use crate::io::files::MAX_OBJ_BYTES;
use crate::io::obj::{self, Loaded};
use crate::io::ply;
use glam::DAffine3;
use std::path::PathBuf;
use std::sync::Arc;
use toml::de::DeValue;

/// Most frames of a mesh.
const MAX_FRAMES: usize = 1024;

keys! {
    /// A mesh by exactly one key. Normals of the file are interpolated, without them facets are
    /// flat; its materials are not read.
    MeshKeys = "mesh" {
        /// Wavefront OBJ, at most 2 GB, in the file's unit.
        obj: Option<At<FileName>>;
        /// PLY, ASCII or binary, at most 2 GB, in the file's unit.
        ply: Option<At<FileName>>;
        /// 1 to 1024 moments, at ascending times, with the same faces in the same order. Vertices
        /// and normals are interpolated linearly; texture coordinates are those of the first.
        frames: Option<At<Vec<FrameKeys>>>;
    }
}

keys! {
    /// The form of a mesh at one moment.
    FrameKeys = "frame" {
        /// The moment.
        time: At<f64>, unit "seconds";
        /// Wavefront OBJ.
        obj: At<FileName>;
    }
}

impl Value for FrameKeys {
    fn form() -> Form {
        Form::Table(Self::KIND)
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let table = Table::of(node, Self::NAMES, cx)?;
        Self::from_table(&table, cx)
    }
}

impl Build for MeshKeys {
    type Output = Placed;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Placed> {
        match (&self.obj, &self.ply, &self.frames) {
            (Some(file), None, None) => still(file, cx, |bytes| {
                obj::read(bytes).map_err(|e| e.to_string())
            }),
            (None, Some(file), None) => still(file, cx, ply::read),
            (None, None, Some(frames)) => deforming(frames, table, cx),
            _ => {
                cx.conflict(&table.at, "a mesh needs one of obj, ply and frames");
                None
            }
        }
    }
}

/// A mesh that has been read for the same files; `make` reads it otherwise.
fn once(
    key: MeshKey,
    cx: &mut Reader<'_>,
    make: impl FnOnce(&mut Reader<'_>) -> Option<Placed>,
) -> Option<Placed> {
    if let Some(placed) = cx.mesh_files.get(&key).cloned() {
        for (_, path) in &key {
            cx.named_again(path);
        }
        return placed;
    }
    let placed = make(cx);
    cx.mesh_files.insert(key, placed.clone());
    placed
}

fn still(
    file: &At<FileName>,
    cx: &mut Reader<'_>,
    read: impl FnOnce(&[u8]) -> Result<Loaded, String>,
) -> Option<Placed> {
    let path = cx.find(file, MAX_OBJ_BYTES)?;
    once(vec![(0, path.clone())], cx, |cx| {
        let bytes = cx.bytes(file, &path)?;
        match read(&bytes) {
            Ok(loaded) => {
                cx.file_notes(file, loaded.notes);
                let local = DAffine3::from_translation(loaded.origin);
                Some((Shape::Mesh(Arc::new(loaded.mesh)), local))
            }
            Err(message) => {
                cx.bad_file(file, message);
                None
            }
        }
    })
}

fn deforming(
    frames: &At<Vec<FrameKeys>>,
    table: &Table<'_>,
    cx: &mut Reader<'_>,
) -> Option<Placed> {
    let At { value: frames, at } = frames;
    if frames.is_empty() || frames.len() > MAX_FRAMES {
        let message = format!("{} frames (allowed: 1 to {MAX_FRAMES})", frames.len());
        cx.conflict(at, message);
        return None;
    }
    for pair in frames.windows(2) {
        if pair[1].time.value <= pair[0].time.value {
            let message = "time is not above that of the frame before";
            cx.conflict(&pair[1].time.at, message);
        }
    }
    let paths: Vec<Option<PathBuf>> = frames
        .iter()
        .map(|frame| cx.find(&frame.obj, MAX_OBJ_BYTES))
        .collect();
    let paths: Vec<PathBuf> = paths.into_iter().collect::<Option<_>>()?;
    table.sound(cx)?;
    if let ([frame], [_]) = (frames.as_slice(), paths.as_slice()) {
        return still(&frame.obj, cx, |bytes| {
            obj::read(bytes).map_err(|e| e.to_string())
        });
    }
    cx.moves = true;
    let times = frames.iter().map(|frame| frame.time.value.to_bits());
    let key = times.zip(paths.iter().cloned()).collect();
    once(key, cx, |cx| {
        let mut arrays = Vec::with_capacity(frames.len());
        for (frame, path) in frames.iter().zip(&paths) {
            let Some(bytes) = cx.bytes(&frame.obj, path) else {
                continue;
            };
            match obj::read_arrays(&bytes) {
                Ok((read, notes)) => {
                    cx.file_notes(&frame.obj, notes);
                    arrays.push((frame.time.value, read));
                }
                Err(error) => cx.bad_file(&frame.obj, error.to_string()),
            }
        }
        if arrays.len() < frames.len() {
            return None;
        }
        match obj::deforming(arrays, cx.shutter.unwrap_or_default()) {
            Ok((shape, origin)) => Some((shape, DAffine3::from_translation(origin))),
            Err(error) => {
                let frame = &frames[error.frame().min(frames.len() - 1)];
                cx.bad_file(&frame.obj, error.to_string());
                None
            }
        }
    })
}

/// `[mesh.NAME]`, which are known by name from then on.
#[derive(Debug)]
pub struct Meshes;

impl Value for Meshes {
    fn form() -> Form {
        Form::Map(Box::new(Form::Table(MeshKeys::KIND)))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let read = |_: &str, node: Node<'_>, cx: &mut Reader<'_>| {
            Built::<MeshKeys>::read(node, spec, cx).map(|built| built.0)
        };
        cx.meshes = definitions(node, cx, read)?;
        Some(Self)
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self)
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}

/// A mesh by name or by its keys; `None` where it could not be read, which has been reported.
#[derive(Debug)]
pub struct MeshSource(pub Option<Placed>);

impl Value for MeshSource {
    fn form() -> Form {
        let name = Form::Text("a `[mesh.NAME]`");
        Form::Any(vec![name, Form::Table(MeshKeys::KIND)])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        match node.get_ref() {
            DeValue::String(name) => {
                let found = cx.defined("mesh", name, &node.span(), |cx| &cx.meshes);
                Some(Self(found.flatten()))
            }
            DeValue::Table(_) => {
                let built = Built::<MeshKeys>::read(node, spec, cx);
                Some(Self(built.map(|b| b.0)))
            }
            _ => {
                cx.wrong_type(node, "a name or a table");
                None
            }
        }
    }
}
