//! Wavefront OBJ files.
//!
//! For [`read`] all objects and groups of a file are one mesh; `io::mtl` makes a mesh for each
//! material. Polygons become triangle fans; points and lines are ignored. Missing normals stay
//! missing (flat shading). Whatever the bytes, the result is valid meshes or an error that names
//! the file and the line.

mod arrays;
pub mod parse;
pub mod text;

use super::origin::{Placed, placed};
use crate::geometry::deforming::{self, DeformingError, KeyFrame};
use crate::geometry::{Mesh, MeshError, Shape, Shutter};
pub use arrays::{Arrays, arrays};
use glam::DVec3;
use parse::AtLine;

/// Why an OBJ file was not read, without its name.
#[derive(Debug, thiserror::Error)]
pub enum ObjError {
    /// A line is not OBJ.
    #[error(transparent)]
    Syntax(#[from] AtLine),
    /// The triangles are no valid mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// No object has a face.
    #[error("no faces")]
    Empty,
}

/// A mesh of a file.
#[derive(Debug)]
pub struct Loaded {
    /// Triangles, about `origin`.
    pub mesh: Mesh,
    /// Zero of the mesh in the coordinates of the file.
    pub origin: DVec3,
    /// Notes on what was not understood, one line each.
    pub notes: Vec<String>,
}

/// Reads the bytes of a file; [`Mesh::dropped`] tells how many of its triangles had no area.
///
/// # Errors
/// [`ObjError`] if they are malformed or have no face of nonzero area.
pub fn read(bytes: &[u8]) -> Result<Loaded, ObjError> {
    let (arrays, mut notes) = read_arrays(bytes)?;
    let Placed {
        origin,
        positions,
        note,
    } = placed(&arrays.positions, &arrays.triangles);
    notes.extend(note);
    Ok(Loaded {
        mesh: Mesh::new(&positions, arrays.normals, arrays.uvs, arrays.triangles)?,
        origin,
        notes,
    })
}

/// Parses arbitrary bytes and drops the result: the entry point for fuzzing. Never panics.
pub fn fuzz_obj(bytes: &[u8]) {
    drop(read(bytes));
}

/// Reads the vertices and faces of the bytes of a file, and what was not understood.
///
/// # Errors
/// [`ObjError`] if they are malformed or have no face.
pub fn read_arrays(bytes: &[u8]) -> Result<(Arrays, Vec<String>), ObjError> {
    let parsed = parse::parse(bytes)?;
    let (arrays, note) = arrays(&parsed, parsed.groups.iter());
    if arrays.triangles.is_empty() {
        return Err(ObjError::Empty);
    }
    let mut notes = parsed.notes;
    notes.extend(note);
    Ok((arrays, notes))
}

/// The mesh of several files, one per moment (seconds, ascending), over `shutter`. All have the
/// same faces in the same order; texture coordinates are those of the first. Beside it, where its
/// zero is in the coordinates of the files.
///
/// # Errors
/// [`FramesError`] if the faces differ, or a frame is no mesh.
pub fn deforming(
    mut frames: Vec<(f64, Arrays)>,
    shutter: Shutter,
) -> Result<(Shape, DVec3), FramesError> {
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
    // programs that write OBJ merge equal normals, so that a vertex of one file may be several of
    // another
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
    let origin = placed(&frames[0].1.positions, &triangles).origin;
    let frames: Vec<_> = frames
        .into_iter()
        .map(|(time_s, arrays)| KeyFrame {
            time_s,
            positions: arrays.about(origin),
            normals: arrays.normals,
        })
        .collect();
    let shape = deforming::shape(&frames, uvs, triangles, shutter).map_err(FramesError::Mesh)?;
    Ok((shape, origin))
}

/// Why files are not the frames of one mesh.
#[derive(Debug, thiserror::Error)]
pub enum FramesError {
    /// A file has other faces than the first.
    #[error("the number of triangles is {count}, that of the first frame {expected}")]
    Faces {
        /// Which frame, from 0.
        frame: usize,
        /// Number of its triangles.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Mesh, ObjError> {
        super::read(text.as_bytes()).map(|loaded| loaded.mesh)
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
        read_arrays(text.as_bytes()).expect("valid").0
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
        match deforming(frames, shutter).expect("same faces").0 {
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
        assert_eq!(
            error.to_string(),
            "the number of triangles is 1, that of the first frame 2"
        );
    }
}
