//! Wavefront OBJ as a model: one mesh per material, materials from the MTL files beside it.
//!
//! | key | taken as |
//! |---|---|
//! | `Kd`, `map_Kd` | color of the diffuse base, or of the metal |
//! | `Ks` | where not black and `illum` is not 0 or 1: a GGX layer over the base |
//! | `Pr`, or else `Ns` | roughness: GGX alpha `Pr²`, `√(2/(Ns + 2))` |
//! | `Pm` | share of metal |
//! | `Ni` | index (1.5 where it is absent or below 1; a layer needs one above 1) |
//! | `illum` 6, 7, or 4, 9 with `d` below 0.5 | glass: a solid where the mesh is closed, else a thin sheet |
//! | `d`, `Tr` (1 - d), `map_d` | coverage of all else |
//! | `Ke` | emission, as `emission = [r, g, b]` of a scene file |
//! | `norm` | normal map |

mod material;
mod statements;

use super::files;
use super::image_file::{self, Encoding, MAX_IMAGE_BYTES};
use super::model::Model;
use super::obj::parse::{Group, Parsed, parse as parse_obj};
use super::obj::{Arrays, arrays};
use super::origin::{Placed, placed};
use crate::geometry::{Mesh, MeshError, Shape, Transform};
use crate::material::{LobeSpec, Material, MaterialId};
use crate::math::hash::{combine, hash_bytes};
use crate::medium::{Boundary, Medium, MediumId};
use crate::scene::description::ObjectDescription;
use crate::spectrum::{Curve, Ior};
use crate::texture::{Image, ImageTexture};
use glam::{DAffine3, DVec3};
use statements::{At, Materials, RawMaterial};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

/// Largest MTL file.
const MAX_MTL_BYTES: u64 = 16 << 20;

/// Reads any bytes as an OBJ file without others beside it: must not panic.
pub fn fuzz_model(bytes: &[u8]) {
    // the outcome does not matter
    _ = read(bytes, Path::new("/nonexistent"), DAffine3::IDENTITY);
}

/// Reads any bytes as an MTL file: must not panic.
pub fn fuzz_mtl(bytes: &[u8]) {
    let mut reader = Reader::new(Path::new("/nonexistent"));
    for material in statements::parse(bytes).materials {
        let source = (material, "fuzz.mtl".to_owned());
        reader.material(&source, true);
    }
}

/// A mesh without materials: light gray, diffuse. `origin`: its zero in the coordinates that
/// `to_world` takes.
#[must_use]
pub fn plain(mesh: Mesh, origin: DVec3, path: &Path, to_world: DAffine3) -> Model {
    let gray = LobeSpec::Diffuse {
        reflectance: Curve::Constant(0.7).into(),
    };
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    Model {
        materials: vec![Material {
            lobes: vec![(1.0.into(), gray)],
            ..Material::default()
        }],
        material_names: vec!["default".to_owned()],
        objects: vec![ObjectDescription {
            name: name.into_owned(),
            shape: Shape::Mesh(Arc::new(mesh)),
            transform: Transform::fixed(to_world * DAffine3::from_translation(origin)),
            material: MaterialId(0),
            boundary: Boundary::None,
            emission: None,
        }],
        ..Model::default()
    }
}

/// A material and the file that it stands in.
type Source = (RawMaterial, String);

struct Reader<'a> {
    folder: &'a Path,
    model: Model,
    /// Decoded images by name and encoding; `None` where one could not be read.
    images: BTreeMap<(String, bool), Option<Arc<Image>>>,
}

/// Reads an OBJ file with its materials, which are in `folder`.
///
/// # Errors
/// Fault, in words, without the file's name.
pub fn read(bytes: &[u8], folder: &Path, to_world: DAffine3) -> Result<Model, String> {
    let parsed = parse_obj(bytes).map_err(|error| error.to_string())?;
    let mut reader = Reader::new(folder);
    reader.model.notes.clone_from(&parsed.notes);
    let materials = reader.libraries(&parsed);
    // the last definition of a name counts, as it does for those that read on
    let by_name: BTreeMap<&str, usize> = (materials.iter().enumerate())
        .map(|(i, m)| (m.0.name.as_str(), i))
        .collect();
    let mut groups: BTreeMap<Option<usize>, Vec<&Group>> = BTreeMap::new();
    let mut unknown = BTreeSet::new();
    for group in &parsed.groups {
        let mut id = None;
        if let Some((name, line)) = &group.material {
            id = by_name.get(name.as_str()).copied();
            if id.is_none() && unknown.insert(name.as_str()) {
                let shown = statements::shown(name);
                reader.note(format!(
                    "line {line}: material \"{shown}\" is in no material file: light gray is used"
                ));
            }
        }
        groups.entry(id).or_default().push(group);
    }
    for (id, groups) in groups {
        let (arrays, note) = arrays(&parsed, groups.iter().copied());
        reader.model.notes.extend(note);
        let name = groups.first().map_or("", |g| g.name.as_str());
        reader.object(id.map(|i| &materials[i]), name, arrays, to_world)?;
    }
    if reader.model.objects.is_empty() {
        return Err("no faces".to_owned());
    }
    Ok(reader.model)
}

impl<'a> Reader<'a> {
    fn new(folder: &'a Path) -> Self {
        Self {
            folder,
            model: Model::default(),
            images: BTreeMap::new(),
        }
    }

    fn note(&mut self, text: String) {
        self.model.notes.push(text);
    }

    /// The materials of all files that the model names.
    fn libraries(&mut self, parsed: &Parsed) -> Vec<Source> {
        let mut materials = Vec::new();
        let mut seen = BTreeSet::new();
        for (text, line) in &parsed.libraries {
            let text = text.replace('\\', "/");
            // a line may name several files, or one whose name holds blanks
            let whole = files::find(self.folder, &text, MAX_MTL_BYTES).is_ok();
            let names: Vec<&str> = if whole {
                vec![&text]
            } else {
                text.split_whitespace().collect()
            };
            if names.is_empty() {
                self.note(format!("line {line}: mtllib names no file"));
            }
            for name in names {
                if !seen.insert(name.to_owned()) {
                    continue;
                }
                match files::read(self.folder, name, MAX_MTL_BYTES) {
                    Ok((path, bytes)) => {
                        self.model.files.push(path);
                        self.model.hash = combine(self.model.hash, hash_bytes(&bytes));
                        let Materials {
                            materials: own,
                            notes,
                        } = statements::parse(&bytes);
                        for At { line, value } in notes {
                            self.note(format!("{name}:{line}: {value}"));
                        }
                        materials.extend(own.into_iter().map(|m| (m, name.to_owned())));
                    }
                    Err(problem) => {
                        self.note(format!("line {line}: materials are not read: {problem}"));
                    }
                }
            }
        }
        materials
    }

    fn object(
        &mut self,
        source: Option<&Source>,
        group: &str,
        arrays: Arrays,
        to_world: DAffine3,
    ) -> Result<(), String> {
        let Placed {
            origin,
            positions,
            note,
        } = placed(&arrays.positions, &arrays.triangles);
        self.model.notes.extend(note);
        let has_uvs = arrays.uvs.is_some();
        let mesh = match Mesh::new(&positions, arrays.normals, arrays.uvs, arrays.triangles) {
            Ok(mesh) => mesh,
            Err(MeshError::Empty { given }) => {
                self.note(format!("none of {given} triangles has an area: ignored"));
                return Ok(());
            }
            Err(error) => return Err(error.to_string()),
        };
        let Some(source) = source else {
            let plain = plain(mesh, origin, Path::new("default"), to_world);
            let id = self.model.materials.len() as u32;
            self.model.materials.extend(plain.materials);
            self.model.material_names.extend(plain.material_names);
            let objects = plain.objects.into_iter().map(|o| ObjectDescription {
                name: group.to_owned(),
                material: MaterialId(id),
                ..o
            });
            self.model.objects.extend(objects);
            return Ok(());
        };
        let name = source.0.name.clone();
        let converted = self.material(source, mesh.is_closed());
        let mut images = Vec::new();
        converted.material.append_images(&mut images);
        if !has_uvs && !images.is_empty() {
            self.note(format!(
                "material \"{name}\" has textures, but its faces have no texture coordinates"
            ));
        }
        let boundary = match converted.interior {
            None => Boundary::None,
            Some(index) => {
                self.model.media.push(Medium {
                    name: name.clone(),
                    ior: Ior::constant(index),
                    absorption: None,
                    use_k: false,
                });
                Boundary::Solid {
                    medium: MediumId(self.model.media.len() as u32 - 1),
                    priority: 0,
                }
            }
        };
        self.model.materials.push(converted.material);
        self.model.material_names.push(name.clone());
        self.model.objects.push(ObjectDescription {
            name,
            shape: Shape::Mesh(Arc::new(mesh)),
            transform: Transform::fixed(to_world * DAffine3::from_translation(origin)),
            material: MaterialId(self.model.materials.len() as u32 - 1),
            boundary,
            emission: converted.emission,
        });
        Ok(())
    }

    /// An image that a line of `file` names; a missing one is noted.
    fn texture(
        &mut self,
        named: Option<&At<String>>,
        file: &str,
        srgb: bool,
    ) -> Option<ImageTexture> {
        let At { line, value } = named?;
        let name = value.replace('\\', "/");
        if !self.images.contains_key(&(name.clone(), srgb)) {
            let encoding = if srgb {
                Encoding::Stated
            } else {
                Encoding::Linear
            };
            let read = files::read(self.folder, &name, MAX_IMAGE_BYTES)
                .map_err(|problem| problem.to_string())
                .and_then(|(path, bytes)| {
                    self.model.files.push(path);
                    self.model.hash = combine(self.model.hash, hash_bytes(&bytes));
                    image_file::decode(&bytes, encoding)
                        .map_err(|e| format!("file \"{name}\": {e}"))
                });
            let image = match read {
                Ok(decoded) => {
                    for note in decoded.notes {
                        self.note(format!("{name}: {note}"));
                    }
                    Some(Arc::new(decoded.image))
                }
                Err(message) => {
                    self.note(format!("{file}:{line}: texture is not read: {message}"));
                    None
                }
            };
            self.images.insert((name.clone(), srgb), image);
        }
        let image = self.images.get(&(name, srgb))?.clone()?;
        Some(ImageTexture::new(image))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJ: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1 2 3\nusemtl lamp\nf 1 3 4\n";

    #[test]
    fn one_mesh_per_material() {
        let folder = tempfile::tempdir().expect("folder");
        let mtl = "newmtl red\nKd 1 0 0\nd 0.25\nTs 3\nnewmtl lamp\nKe 2 2 2\n";
        std::fs::write(folder.path().join("m.mtl"), mtl).expect("file");
        let model = read(OBJ.as_bytes(), folder.path(), DAffine3::IDENTITY).expect("valid");
        assert_eq!(model.objects.len(), 2);
        let covered = |i: usize| model.materials[i].coverage.is_some();
        let red = model
            .objects
            .iter()
            .position(|o| o.name == "red")
            .expect("there");
        assert!(covered(red) && !covered(1 - red));
        assert!(model.objects[1 - red].emission.is_some());
        assert_eq!(model.notes, ["m.mtl:4: material \"red\": Ts is not read"]);
    }

    #[test]
    fn missing_and_forbidden_files_are_noted() {
        let folder = tempfile::tempdir().expect("folder");
        let model = read(OBJ.as_bytes(), folder.path(), DAffine3::IDENTITY).expect("valid");
        assert!(
            model.notes[0].contains("file \"m.mtl\" not found"),
            "{:?}",
            model.notes
        );
        let escape = OBJ.replace("m.mtl", "../m.mtl");
        let model = read(escape.as_bytes(), folder.path(), DAffine3::IDENTITY).expect("valid");
        assert!(
            model.notes[0].contains("outside the scene's folder"),
            "{:?}",
            model.notes
        );
        std::fs::write(folder.path().join("m.mtl"), "newmtl red\nKd 1 0\n").expect("file");
        let model = read(OBJ.as_bytes(), folder.path(), DAffine3::IDENTITY).expect("valid");
        assert_eq!(
            model.notes,
            [
                "m.mtl:2: material \"red\": \"Kd 1 0\" is not understood: ignored",
                "line 8: material \"lamp\" is in no material file: light gray is used"
            ]
        );
        assert_eq!(
            read(b"v 0 0 0\n", folder.path(), DAffine3::IDENTITY)
                .err()
                .as_deref(),
            Some("no faces")
        );
    }
}
