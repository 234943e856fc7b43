//! Wavefront OBJ files, read with tobj.
//!
//! All objects and groups of a file are one mesh. Polygons become triangle fans; points, lines and materials are ignored. Missing normals stay missing (flat shading). Whatever the bytes,
//! the result is valid meshes or an error.

use crate::geometry::deforming::{self, DeformingError, KeyFrame};
use crate::geometry::{Mesh, MeshError, Shape, Shutter};
use std::io::{BufRead, BufReader, Read};

/// Faces handed to tobj at a time: it keeps a hundred bytes for each until their group ends.
const GROUP_FACES: usize = 1 << 15;

/// Why an OBJ file was not read, without its name.
#[derive(Debug, thiserror::Error)]
pub enum ObjError {
    /// A line is not OBJ.
    #[error("not a valid OBJ file: {0}")]
    Syntax(tobj::LoadError),
    /// The triangles are no valid mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// No object has a face.
    #[error("no faces")]
    Empty,
}

/// Reads the bytes of a file; [`Mesh::dropped`] tells how many of its triangles had no area.
///
/// # Errors
/// [`ObjError`] if they are malformed or have no face of nonzero area.
pub fn read(bytes: &[u8]) -> Result<Mesh, ObjError> {
    read_arrays(bytes)?.mesh()
}

/// Parses arbitrary bytes and drops the result: the entry point for fuzzing. Never panics.
pub fn fuzz_obj(bytes: &[u8]) {
    drop(read(bytes));
}

/// Reads the vertices and faces of the bytes of a file.
///
/// # Errors
/// [`ObjError`] if they are malformed or have no face.
pub fn read_arrays(mut bytes: &[u8]) -> Result<Arrays, ObjError> {
    let options = tobj::LoadOptions {
        triangulate: true,
        single_index: true,
        ignore_points: true,
        ignore_lines: true,
    };
    let no_materials = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(
        &mut BufReader::new(Grouped::new(&mut bytes)),
        &options,
        no_materials,
    )
    .map_err(ObjError::Syntax)?;
    let mut all = Arrays {
        normals: Some(Vec::new()),
        uvs: Some(Vec::new()),
        ..Arrays::default()
    };
    // at once, so that no outgrown piece is left in the middle of what is freed below
    let total = |of: fn(&tobj::Mesh) -> usize| models.iter().map(|m| of(&m.mesh)).sum::<usize>();
    all.positions
        .reserve_exact(total(|m| m.positions.len() / 3));
    all.triangles.reserve_exact(total(|m| m.indices.len() / 3));
    for model in models {
        all.append(&model.mesh);
    }
    if all.triangles.is_empty() {
        return Err(ObjError::Empty);
    }
    Ok(all)
}

/// The mesh of several files, one per moment (seconds, ascending), over `shutter`. All have the same faces in the same order;
/// texture coordinates are those of the first.
///
/// # Errors
/// [`FramesError`] if the faces differ, or a frame is no mesh.
pub fn deforming(mut frames: Vec<(f64, Arrays)>, shutter: Shutter) -> Result<Shape, FramesError> {
    let Some((_, first)) = frames.first() else {
        return Err(FramesError::Mesh(DeformingError::NotAscending));
    };
    let expected = first.triangles.len();
    if let Some(frame) = frames.iter().position(|f| f.1.triangles.len() != expected) {
        let count = frames[frame].1.triangles.len();
        return Err(FramesError::Faces {
            frame,
            count,
            expected,
        });
    }
    // programs that write OBJ merge equal normals, so that a vertex of one file may be several of another
    if frames
        .iter()
        .any(|f| f.1.triangles != frames[0].1.triangles)
    {
        for (_, arrays) in &mut frames {
            arrays.unroll();
        }
    }
    let (uvs, triangles) = (
        frames[0].1.uvs.take(),
        std::mem::take(&mut frames[0].1.triangles),
    );
    let frames: Vec<_> = frames
        .into_iter()
        .map(|(time_s, arrays)| KeyFrame {
            time_s,
            positions: arrays.positions,
            normals: arrays.normals,
        })
        .collect();
    deforming::shape(&frames, uvs, triangles, shutter).map_err(FramesError::Mesh)
}

/// Why files are not the frames of one mesh.
#[derive(Debug, thiserror::Error)]
pub enum FramesError {
    /// A file has other faces than the first.
    #[error("{count} triangles where the first frame has {expected}")]
    Faces {
        /// Which frame, from 0.
        frame: usize,
        /// Its triangles.
        count: usize,
        /// Those of the first.
        expected: usize,
    },
    /// The frames are no mesh.
    #[error("{0}")]
    Mesh(DeformingError),
}

impl FramesError {
    /// Which frame, from 0.
    #[must_use]
    pub fn frame(&self) -> usize {
        match self {
            Self::Faces { frame, .. }
            | Self::Mesh(
                DeformingError::Mesh { frame, .. } | DeformingError::WrongCount { frame, .. },
            ) => *frame,
            Self::Mesh(DeformingError::NotAscending) => 0,
        }
    }
}

/// OBJ text with a group started every [`GROUP_FACES`] faces.
struct Grouped<R> {
    reader: R,
    line: Vec<u8>,
    /// How much of the line was handed out.
    at: usize,
    faces: usize,
}

impl<R> Grouped<R> {
    fn new(reader: R) -> Self {
        let line = Vec::new();
        Self {
            reader,
            line,
            at: 0,
            faces: 0,
        }
    }
}

impl<R: BufRead> Read for Grouped<R> {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        if self.at == self.line.len() {
            self.line.clear();
            self.at = 0;
            self.reader.read_until(b'\n', &mut self.line)?;
            self.faces += usize::from(self.line.starts_with(b"f"));
            if self.faces == GROUP_FACES && self.line.ends_with(b"\n") {
                self.line.extend(b"g\n");
                self.faces = 0;
            }
        }
        let read = (&self.line[self.at..]).read(out)?;
        self.at += read;
        Ok(read)
    }
}

/// The vertices and faces of a file: all its objects.
#[derive(Debug, Default)]
pub struct Arrays {
    positions: Vec<[f32; 3]>,
    /// `None` once an object has vertices without one: attributes of some faces only are no attributes of the mesh.
    normals: Option<Vec<[f32; 3]>>,
    uvs: Option<Vec<[f32; 2]>>,
    triangles: Vec<[u32; 3]>,
}

impl Arrays {
    /// The mesh of these.
    fn mesh(self) -> Result<Mesh, ObjError> {
        let mesh = Mesh::new(&self.positions, self.normals, self.uvs, self.triangles)?;
        Ok(mesh)
    }

    /// Gives every corner of every triangle a vertex of its own.
    fn unroll(&mut self) {
        let corners = self.triangles.as_flattened();
        let each = |v: &u32| *v as usize;
        if corners.iter().any(|v| each(v) >= self.positions.len()) {
            // refused as a mesh later
            return;
        }
        self.positions = corners.iter().map(|v| self.positions[each(v)]).collect();
        if let Some(normals) = &mut self.normals {
            *normals = corners.iter().map(|v| normals[each(v)]).collect();
        }
        if let Some(uvs) = &mut self.uvs {
            *uvs = corners.iter().map(|v| uvs[each(v)]).collect();
        }
        self.triangles = (0..self.triangles.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
    }

    fn append(&mut self, mesh: &tobj::Mesh) {
        if mesh.indices.is_empty() {
            return;
        }
        let first = self.positions.len() as u32;
        let positions = groups(&mesh.positions);
        extend(&mut self.normals, groups(&mesh.normals), positions.len());
        extend(&mut self.uvs, groups(&mesh.texcoords), positions.len());
        self.positions.extend(positions);
        self.triangles.extend(
            groups::<u32, 3>(&mesh.indices)
                .iter()
                .map(|t| t.map(|v| v.wrapping_add(first))),
        );
    }
}

fn extend<T>(all: &mut Option<Vec<T>>, more: Vec<T>, expected: usize) {
    match all {
        Some(values) if more.len() == expected => values.extend(more),
        _ => *all = None,
    }
}

/// Splits a flat array; an incomplete last group is dropped.
fn groups<T: Copy, const N: usize>(flat: &[T]) -> Vec<[T; N]> {
    flat.as_chunks::<N>().0.to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Mesh, ObjError> {
        super::read(text.as_bytes())
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn polygons_become_triangles_and_normals_stay_missing() {
        let mesh = read(&format!("o square\n{SQUARE}f 1 2 3 4\n")).expect("valid");
        assert_eq!(mesh.triangle_count(), 2);
        assert!((mesh.area() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn objects_and_groups_are_one_mesh() {
        let mesh = read(&format!("{SQUARE}o a\nf 1 2 3\no b\nf 1 3 4\n")).expect("valid");
        assert_eq!(mesh.triangle_count(), 2);
        assert!((mesh.area() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_groups_handed_to_tobj_are_one_mesh() {
        let faces = 2 * GROUP_FACES + 7;
        let normals = "vn 0 0 1\n";
        let text = format!(
            "{SQUARE}{normals}{}f -4//1 -2//1 -1//1",
            "f 1//1 2//1 3//1\n".repeat(faces - 1)
        );
        let mesh = read(&text).expect("valid");
        assert_eq!((mesh.triangle_count(), mesh.dropped()), (faces, 0));
        assert!((mesh.area() - faces as f64 / 2.0).abs() < 1e-6);
    }

    #[test]
    fn negative_indices_count_from_the_end_and_lines_are_ignored() {
        let mesh = read(&format!("{SQUARE}f -4 -3 -2\nl 1 2\np 3\n")).expect("valid");
        assert_eq!(mesh.triangle_count(), 1);
        assert_eq!(mesh.dropped(), 0);
    }

    #[test]
    fn faces_without_area_are_dropped_and_counted() {
        let mesh = read(&format!("{SQUARE}f 1 2 3\nf 1 2 2\nf 1 1 1\n")).expect("valid");
        assert_eq!((mesh.triangle_count(), mesh.dropped()), (1, 2));
    }

    #[test]
    fn bad_files_are_errors() {
        for bad in [
            "",
            "f 1 2 3\n",
            "v 0 0\n",
            "v 0 0 0\nf 1 1 1\n",
            "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn garbled_bytes_never_panic() {
        let good = format!(
            "{SQUARE}vn 0 0 1\nvt 0 0\ng a\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1//1 -2//1 1//1\n"
        );
        for i in 0..good.len() {
            fuzz_obj(&good.as_bytes()[..i]);
            for byte in [0u8, b'-', b'9', b'/', b' ', b'\n', b'e', 0xff] {
                let mut bytes = good.clone().into_bytes();
                bytes[i] = byte;
                fuzz_obj(&bytes);
            }
        }
    }

    fn arrays(text: &str) -> Arrays {
        read_arrays(text.as_bytes()).expect("valid")
    }

    #[test]
    fn frames_may_share_normals_in_different_ways_but_not_have_other_faces() {
        let shutter = Shutter {
            open_s: 0.0,
            close_s: 1.0,
        };
        let shared =
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n";
        let split = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 0\nvn 0 0 1\nvn 0 1 1\nf 1//1 2//1 3//1\nf 1//2 3//2 4//2\n";
        let frames = vec![(0.0, arrays(shared)), (1.0, arrays(split))];
        match deforming(frames, shutter).expect("same faces") {
            Shape::Deforming(mesh) => {
                assert_eq!(mesh.triangle_count(), 2);
                // the mesh orders its triangles anew
                let moved = glam::dvec3(1.0, 1.0, 0.5);
                assert!((0..2).all(|i| mesh.corners(i, 0.5).contains(&moved)));
            }
            other => panic!("{other:?}"),
        }
        let fewer = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
        let frames = vec![(0.0, arrays(shared)), (1.0, arrays(fewer))];
        let error = deforming(frames, shutter).expect_err("one face is missing");
        assert_eq!(error.frame(), 1);
        assert_eq!(error.to_string(), "1 triangles where the first frame has 2");
    }
}
