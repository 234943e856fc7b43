//! Wavefront OBJ as a model: one mesh per material, materials from the MTL files beside it.
//!
//! | key | taken as |
//! |---|---|
//! | `Kd`, `map_Kd` | color of the diffuse base, or of the metal |
//! | `Ks` | where not black: a GGX layer over the base |
//! | `Pr`, or else `Ns` | roughness: GGX alpha `Pr²`, `√(2/(Ns + 2))` |
//! | `Pm` | share of metal |
//! | `Ni` | index (1.5 where it is absent or not above 1) |
//! | `illum` 6, 7, or 4, 9 with `d` below 0.5 | glass: a solid where the mesh is closed, else a thin sheet |
//! | `d`, `Tr` (1 - d), `map_d` | coverage of all else |
//! | `Ke` | emission, as `emission = [r, g, b]` of a scene file |
//! | `norm` | normal map |

use super::files;
use super::image_file::{self, MAX_IMAGE_BYTES};
use super::model::Model;
use crate::bsdf::coated::Coat;
use crate::geometry::{Mesh, MeshError, Shape, Transform};
use crate::material::{Coverage, LobeSpec, Material, MaterialId, NormalMap};
use crate::math::hash::combine;
use crate::medium::{Boundary, Medium, MediumId};
use crate::scene::description::{AreaEmission, ObjectDescription};
use crate::spectrum::{Curve, Emission, Ior, upsample};
use crate::texture::{Image, ImageTexture, ScalarTexture, SpectrumTexture};
use glam::DAffine3;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// Largest MTL file.
const MAX_MTL_BYTES: u64 = 16 << 20;
/// Keys that are understood beside those that tobj reads.
const UNDERSTOOD: [&str; 4] = ["Pr", "Pm", "Tr", "norm"];

/// Reads any bytes as an OBJ file without others beside it: must not panic.
pub fn fuzz_model(bytes: &[u8]) {
    // the outcome does not matter
    _ = read(bytes, Path::new("/nonexistent"), DAffine3::IDENTITY);
}

/// Materials, and their indices by name.
type MaterialFile = (Vec<tobj::Material>, HashMap<String, usize>);

/// Reads an MTL file. Colors are looked at first: tobj takes for granted that each has three numbers.
fn read_mtl(bytes: &[u8]) -> Result<MaterialFile, String> {
    let text = String::from_utf8_lossy(bytes);
    for (i, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        let is_color = words
            .next()
            .is_some_and(|k| ["Ka", "Kd", "Ks", "Ke"].contains(&k));
        if is_color && words.take(3).count() < 3 {
            return Err(format!("line {}: a color needs three numbers", i + 1));
        }
    }
    tobj::load_mtl_buf(&mut text.as_bytes()).map_err(|e| e.to_string())
}

/// Reads any bytes as an MTL file: must not panic.
pub fn fuzz_mtl(bytes: &[u8]) {
    if let Ok((materials, _)) = read_mtl(bytes) {
        let mut reader = Reader {
            folder: Path::new("/nonexistent"),
            model: Model::default(),
            images: BTreeMap::new(),
        };
        for material in &materials {
            // the outcome does not matter
            _ = reader.material(material, true);
        }
    }
}

/// A mesh without materials: light gray, diffuse.
#[must_use]
pub fn plain(mesh: Mesh, path: &Path, to_world: DAffine3) -> Model {
    let gray = LobeSpec::Diffuse {
        reflectance: Curve::Constant(0.7).into(),
    };
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    Model {
        materials: vec![Material {
            lobes: vec![(1.0.into(), gray)],
            ..Material::default()
        }],
        objects: vec![ObjectDescription {
            name: name.into_owned(),
            shape: Shape::Mesh(Arc::new(mesh)),
            transform: Transform::fixed(to_world),
            material: MaterialId(0),
            boundary: Boundary::None,
            emission: None,
        }],
        ..Model::default()
    }
}

struct Reader<'a> {
    folder: &'a Path,
    model: Model,
    /// Decoded images by name and encoding; `None` where one could not be read.
    images: BTreeMap<(String, bool), Option<Arc<Image>>>,
}

/// The vertices and faces of one material.
#[derive(Default)]
struct Arrays {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    triangles: Vec<[u32; 3]>,
    names: Vec<String>,
}

/// Reads an OBJ file with its materials, which are in `folder`.
///
/// # Errors
/// What is wrong, in words, without the file's name.
pub fn read(bytes: &[u8], folder: &Path, to_world: DAffine3) -> Result<Model, String> {
    let options = tobj::LoadOptions {
        triangulate: true,
        single_index: true,
        ignore_points: true,
        ignore_lines: true,
    };
    // the reader of materials takes a function that must not change anything
    let notes = RefCell::new(Vec::new());
    let hash = Cell::new(0);
    let (models, materials) = tobj::load_obj_buf(&mut &*bytes, &options, |name: &Path| {
        let text = name.to_string_lossy().replace('\\', "/");
        let read = files::read(folder, &text, MAX_MTL_BYTES).map_err(|e| e.to_string());
        let read = read.and_then(|bytes| {
            let own = crate::math::hash::hash_bytes(&bytes);
            hash.set(combine(hash.get(), own));
            read_mtl(&bytes).map_err(|message| format!("file \"{text}\": {message}"))
        });
        read.map_err(|message| {
            let note = format!("materials are not read: {message}");
            notes.borrow_mut().push(note);
            tobj::LoadError::MaterialParseError
        })
    })
    .map_err(|e| format!("not a valid OBJ file: {e}"))?;
    let materials = materials.unwrap_or_default();
    let mut by_material: BTreeMap<Option<usize>, Arrays> = BTreeMap::new();
    for model in models {
        let id = model.mesh.material_id.filter(|&i| i < materials.len());
        by_material
            .entry(id)
            .or_default()
            .append(&model.mesh, model.name);
    }
    let mut reader = Reader {
        folder,
        model: Model {
            notes: notes.into_inner(),
            hash: hash.get(),
            ..Model::default()
        },
        images: BTreeMap::new(),
    };
    for (id, arrays) in by_material {
        reader.object(id.map(|i| &materials[i]), arrays, to_world)?;
    }
    if reader.model.objects.is_empty() {
        return Err("no faces".to_owned());
    }
    Ok(reader.model)
}

impl Arrays {
    fn append(&mut self, mesh: &tobj::Mesh, name: String) {
        let first = self.positions.len() as u32;
        let old = self.positions.len();
        self.positions
            .extend_from_slice(mesh.positions.as_chunks::<3>().0);
        // what only some objects have is no attribute of the mesh
        if self.normals.len() == old {
            self.normals
                .extend_from_slice(mesh.normals.as_chunks::<3>().0);
        }
        if self.uvs.len() == old {
            self.uvs
                .extend_from_slice(mesh.texcoords.as_chunks::<2>().0);
        }
        let triangles = mesh.indices.as_chunks::<3>().0.iter();
        self.triangles
            .extend(triangles.map(|t| t.map(|v| v.wrapping_add(first))));
        self.names.push(name);
    }
}

/// A material's parts.
struct Converted {
    material: Material,
    emission: Option<AreaEmission>,
    /// Index of the glass that fills a closed mesh.
    interior: Option<f64>,
}

impl Reader<'_> {
    fn object(
        &mut self,
        source: Option<&tobj::Material>,
        arrays: Arrays,
        to_world: DAffine3,
    ) -> Result<(), String> {
        if arrays.triangles.is_empty() {
            return Ok(());
        }
        let n = arrays.positions.len();
        let normals = (arrays.normals.len() == n).then_some(arrays.normals);
        let uvs = (arrays.uvs.len() == n).then_some(arrays.uvs);
        let has_uvs = uvs.is_some();
        let mesh = match Mesh::new(&arrays.positions, normals, uvs, arrays.triangles) {
            Ok(mesh) => mesh,
            Err(MeshError::Empty { given }) => {
                let text = format!("none of {given} triangles has an area: ignored");
                self.model.notes.push(text);
                return Ok(());
            }
            Err(error) => return Err(error.to_string()),
        };
        let (name, converted) = match source {
            None => {
                let plain = plain(mesh, Path::new("default"), to_world);
                let id = self.model.materials.len() as u32;
                self.model.materials.extend(plain.materials);
                self.model
                    .objects
                    .extend(plain.objects.into_iter().map(|o| ObjectDescription {
                        name: arrays.names.first().cloned().unwrap_or_default(),
                        material: MaterialId(id),
                        ..o
                    }));
                return Ok(());
            }
            Some(m) => (m.name.clone(), self.material(m, mesh.is_closed())),
        };
        let mut images = Vec::new();
        converted.material.append_images(&mut images);
        if !has_uvs && !images.is_empty() {
            let text = format!(
                "material \"{name}\" has textures, but its faces have no texture coordinates"
            );
            self.model.notes.push(text);
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
        self.model.objects.push(ObjectDescription {
            name,
            shape: Shape::Mesh(Arc::new(mesh)),
            transform: Transform::fixed(to_world),
            material: MaterialId(self.model.materials.len() as u32 - 1),
            boundary,
            emission: converted.emission,
        });
        Ok(())
    }

    /// An image a material names; a missing one is noted.
    fn texture(&mut self, named: &str, srgb: bool) -> Option<ImageTexture> {
        // options come before the name
        let name = if named.starts_with('-') {
            self.model
                .notes
                .push(format!("options of \"{named}\" are not read"));
            named.split_whitespace().last()?
        } else {
            named.trim()
        };
        let name = name.replace('\\', "/");
        if !self.images.contains_key(&(name.clone(), srgb)) {
            let read = files::read(self.folder, &name, MAX_IMAGE_BYTES)
                .map_err(|problem| problem.to_string())
                .and_then(|bytes| {
                    let hash = crate::math::hash::hash_bytes(&bytes);
                    self.model.hash = combine(self.model.hash, hash);
                    image_file::decode(&bytes, srgb).map_err(|e| format!("file \"{name}\": {e}"))
                });
            let image = read
                .map_err(|message| {
                    let text = format!("texture is not read: {message}");
                    self.model.notes.push(text);
                })
                .ok()
                .map(Arc::new);
            self.images.insert((name.clone(), srgb), image);
        }
        let image = self.images.get(&(name, srgb))?.clone()?;
        Some(ImageTexture::new(image))
    }

    fn material(&mut self, m: &tobj::Material, closed: bool) -> Converted {
        let name = &m.name;
        let mut ignored: Vec<&str> = m
            .unknown_param
            .keys()
            .map(String::as_str)
            .filter(|k| !UNDERSTOOD.contains(k))
            .collect();
        if m.ambient_texture.is_some() {
            ignored.push("map_Ka");
        }
        if m.specular_texture.is_some() {
            ignored.push("map_Ks");
        }
        if m.shininess_texture.is_some() {
            ignored.push("map_Ns");
        }
        if m.normal_texture.is_some() {
            ignored.push("map_Bump");
        }
        if !ignored.is_empty() {
            ignored.sort_unstable();
            let text = format!("material \"{name}\": {} not read", ignored.join(", "));
            self.model.notes.push(text);
        }
        let number = |key: &str| {
            let text = m.unknown_param.get(key)?;
            let value: f64 = text.split_whitespace().next()?.parse().ok()?;
            value.is_finite().then_some(value)
        };
        let unit = |v: Option<f32>| {
            v.filter(|v| v.is_finite())
                .map(|v| f64::from(v).clamp(0.0, 1.0))
        };
        let color = m.diffuse.unwrap_or([0.7; 3]).map(|v| {
            if v.is_finite() {
                v.clamp(0.0, 1.0)
            } else {
                0.0
            }
        });
        let base = match m
            .diffuse_texture
            .as_ref()
            .and_then(|t| self.texture(t, true))
        {
            // many files leave Kd black or gray beside a texture; a black one would hide it
            Some(texture) => SpectrumTexture::Image {
                texture,
                factor: if color == [0.0; 3] { [1.0; 3] } else { color },
            },
            None => upsample::reflectance(color.map(f64::from)).into(),
        };
        let shininess = m.shininess.filter(|n| n.is_finite() && *n >= 0.0);
        let alpha = match (number("Pr"), shininess) {
            (Some(pr), _) => pr.clamp(0.0, 1.0).powi(2),
            (None, Some(ns)) => (2.0 / (f64::from(ns) + 2.0)).sqrt(),
            (None, None) => 0.5,
        };
        let alpha: [ScalarTexture; 2] = [alpha.into(), alpha.into()];
        let index = m
            .optical_density
            .map(f64::from)
            .filter(|n| *n > 1.0 && *n <= 10.0)
            .unwrap_or(1.5);
        let metal = number("Pm").unwrap_or(0.0).clamp(0.0, 1.0);
        let cover = unit(m.dissolve).unwrap_or(1.0 - number("Tr").unwrap_or(0.0).clamp(0.0, 1.0));
        let glass = matches!(
            (m.illumination_model, cover < 0.5),
            (Some(6 | 7), _) | (Some(4 | 9), true)
        );
        let shiny =
            m.specular.is_some_and(|s| s.iter().any(|v| *v > 0.0)) || number("Pr").is_some();
        let mut converted = Converted {
            material: Material::default(),
            emission: None,
            interior: None,
        };
        let lobes = &mut converted.material.lobes;
        let white = || Curve::Constant(1.0).into();
        if glass && closed {
            converted.interior = Some(index);
            let lobe = LobeSpec::Dielectric {
                alpha: if number("Pr").is_some() {
                    alpha
                } else {
                    [0.0.into(), 0.0.into()]
                },
                reflect_tint: white(),
                transmit_tint: white(),
            };
            lobes.push((1.0.into(), lobe));
        } else if glass {
            let lobe = LobeSpec::Thin {
                ior: Ior::constant(index),
                transmit_tint: white(),
            };
            lobes.push((1.0.into(), lobe));
        } else {
            let opaque = ScalarTexture::Constant(1.0 - metal);
            if metal < 1.0 && shiny {
                let coat = LobeSpec::CoatedDiffuse {
                    reflectance: base.clone(),
                    coat: Coat::new(index, 1.0),
                    strength: 1.0.into(),
                    alpha: alpha.clone(),
                };
                lobes.push((opaque.clone(), coat));
                let layer = LobeSpec::Coat {
                    index,
                    alpha: alpha.clone(),
                    tint: white(),
                };
                lobes.push((opaque, layer));
            } else if metal < 1.0 {
                let reflectance = base.clone();
                lobes.push((opaque, LobeSpec::Diffuse { reflectance }));
            }
            if metal > 0.0 {
                lobes.push((metal.into(), LobeSpec::ColoredMetal { color: base, alpha }));
            }
        }
        if let Some(rgb) = m.emissive
            && rgb.iter().all(|v| v.is_finite() && *v >= 0.0)
            && rgb != [0.0; 3]
        {
            converted.emission = Some(AreaEmission {
                radiance: Emission::from_rgb(rgb.map(f64::from)),
                pattern: None,
                two_sided: true,
            });
        }
        if let Some(texture) = m
            .unknown_param
            .get("norm")
            .and_then(|t| self.texture(t, false))
        {
            converted.material.normal = Some(NormalMap {
                texture,
                scale: 1.0,
            });
        }
        let mask = m
            .dissolve_texture
            .as_ref()
            .and_then(|t| self.texture(t, false));
        if !glass && converted.emission.is_none() && (cover < 1.0 || mask.is_some()) {
            let alpha = match mask {
                None => cover.into(),
                Some(texture) => ScalarTexture::Image {
                    texture,
                    channel: 0,
                },
            };
            converted.material.coverage = Some(Coverage {
                alpha,
                cutoff: None,
            });
        }
        converted
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
        assert_eq!(model.notes, ["material \"red\": Ts not read"]);
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
        let note = "materials are not read: file \"m.mtl\": line 2: a color needs three numbers";
        assert_eq!(model.notes, [note]);
        assert_eq!(
            read(b"v 0 0 0\n", folder.path(), DAffine3::IDENTITY)
                .err()
                .as_deref(),
            Some("no faces")
        );
    }
}
