//! Wavefront OBJ files, read with tobj.
//!
//! Polygons become triangle fans; points, lines and materials are ignored. Missing normals stay missing (flat shading). Whatever the bytes,
//! the result is valid meshes or an error that names the file.

use crate::geometry::{Mesh, MeshError};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Largest file read, in bytes (some 40 million triangles).
const MAX_BYTES: u64 = 2 << 30;

/// One object or group of a file.
#[derive(Debug)]
pub struct ObjModel {
    /// Its name in the file.
    pub name: String,
    /// Its triangles; [`Mesh::dropped`] tells how many had no area.
    pub mesh: Mesh,
}

/// Why an OBJ file was not read. Every message starts with the file.
#[derive(Debug, thiserror::Error)]
pub enum ObjError {
    /// The file cannot be opened or is not a file.
    #[error("{}: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is larger than is read.
    #[error("{}: {bytes} bytes (at most {MAX_BYTES} are read)", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
    },
    /// A line is not OBJ.
    #[error("{}: not a valid OBJ file: {source}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// What tobj said.
        source: tobj::LoadError,
    },
    /// An object is no valid mesh.
    #[error("{}: object `{name}`: {source}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// The object.
        name: String,
        /// What is wrong.
        source: MeshError,
    },
    /// No object has a face.
    #[error("{}: no faces", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Reads all objects of a file that have faces.
///
/// # Errors
/// [`ObjError`] if the file cannot be read, is too large, is malformed, has no faces, or has an object without any
/// face of nonzero area.
pub fn load(path: impl AsRef<Path>) -> Result<Vec<ObjModel>, ObjError> {
    let path = path.as_ref();
    let open = |source| ObjError::Open {
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(open)?;
    let bytes = file.metadata().map_err(open)?.len();
    if bytes > MAX_BYTES {
        return Err(ObjError::TooLarge {
            path: path.to_owned(),
            bytes,
        });
    }
    parse(&mut BufReader::new(file), path)
}

/// Parses arbitrary bytes and drops the result: the entry point for fuzzing. Never panics.
pub fn fuzz_obj(bytes: &[u8]) {
    let mut reader = bytes;
    drop(parse(&mut reader, Path::new("fuzz.obj")));
}

/// Reads OBJ text; `path` is for messages.
fn parse(reader: &mut impl BufRead, path: &Path) -> Result<Vec<ObjModel>, ObjError> {
    let options = tobj::LoadOptions {
        triangulate: true,
        single_index: true,
        ignore_points: true,
        ignore_lines: true,
    };
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) =
        tobj::load_obj_buf(reader, &options, no_materials).map_err(|source| ObjError::Syntax {
            path: path.to_owned(),
            source,
        })?;
    let meshes: Vec<ObjModel> = models
        .into_iter()
        .filter(|model| !model.mesh.indices.is_empty())
        .map(|model| {
            let tobj::Model { mesh, name } = model;
            match to_mesh(&mesh) {
                Ok(mesh) => Ok(ObjModel { name, mesh }),
                Err(source) => Err(ObjError::Mesh {
                    path: path.to_owned(),
                    name,
                    source,
                }),
            }
        })
        .collect::<Result<_, _>>()?;
    if meshes.is_empty() {
        return Err(ObjError::Empty {
            path: path.to_owned(),
        });
    }
    Ok(meshes)
}

fn to_mesh(mesh: &tobj::Mesh) -> Result<Mesh, MeshError> {
    let positions = groups(&mesh.positions);
    // Attributes given for some faces only are no attributes of the mesh.
    let normals = Some(groups(&mesh.normals)).filter(|n| n.len() == positions.len());
    let uvs = Some(groups(&mesh.texcoords)).filter(|n| n.len() == positions.len());
    Mesh::new(&positions, normals, uvs, groups(&mesh.indices))
}

/// Splits a flat array; an incomplete last group is dropped.
fn groups<T: Copy, const N: usize>(flat: &[T]) -> Vec<[T; N]> {
    flat.as_chunks::<N>().0.to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<ObjModel>, ObjError> {
        parse(&mut text.as_bytes(), Path::new("some.obj"))
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn polygons_become_triangles_and_normals_stay_missing() {
        let models = read(&format!("o square\n{SQUARE}f 1 2 3 4\n")).expect("valid");
        assert_eq!((models.len(), models[0].name.as_str()), (1, "square"));
        assert_eq!(models[0].mesh.triangle_count(), 2);
        assert!((models[0].mesh.area() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn negative_indices_count_from_the_end_and_lines_are_ignored() {
        let models = read(&format!("{SQUARE}f -4 -3 -2\nl 1 2\np 3\n")).expect("valid");
        assert_eq!(models[0].mesh.triangle_count(), 1);
        assert_eq!(models[0].mesh.dropped(), 0);
    }

    #[test]
    fn faces_without_area_are_dropped_and_counted() {
        let models = read(&format!("{SQUARE}f 1 2 3\nf 1 2 2\nf 1 1 1\n")).expect("valid");
        assert_eq!(
            (models[0].mesh.triangle_count(), models[0].mesh.dropped()),
            (1, 2)
        );
    }

    #[test]
    fn bad_files_are_errors_that_name_the_file() {
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
            let message = read(bad).expect_err(bad).to_string();
            assert!(message.starts_with("some.obj: "), "{bad}: {message}");
        }
        let message = load("/nonexistent/a.obj")
            .expect_err("no such file")
            .to_string();
        assert!(message.contains("a.obj"), "{message}");
        assert!(load(std::env::temp_dir()).is_err());
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
}
