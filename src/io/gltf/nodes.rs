//! The node hierarchy of a glTF file: meshes, lights and cameras with their places in the world.

use super::material::{Converted, PER_NIT, coordinate_set, has_volume};
use super::{Fault, MAX_TRIANGLES, Reader};
use crate::geometry::{Mesh, Shape, Transform};
use crate::io::model::{ModelCamera, Projection};
use crate::light::Light;
use crate::light::directional::DirectionalLight;
use crate::light::point::PointLight;
use crate::light::spot::SpotLight;
use crate::material::MaterialId;
use crate::medium::{Boundary, MediumId};
use crate::scene::description::{AreaEmission, LightDescription, ObjectDescription};
use crate::spectrum::Emission;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf::json::camera::Camera;
use gltf::json::extensions::scene::khr_lights_punctual::{Light as Punctual, Type as LightType};
use gltf::json::material::Material as Source;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest coordinate of a placement.
const LARGEST: f64 = 1e30;

/// All primitives of one material of a mesh.
struct Part {
    mesh: Arc<Mesh>,
    material: MaterialId,
    boundary: Boundary,
    emission: Option<AreaEmission>,
}

/// A material in the model: its id, what it emits, and the medium that fills its meshes.
type Known = (MaterialId, Option<AreaEmission>, Option<MediumId>);

/// What has been made of meshes and materials so far.
#[derive(Default)]
struct Made {
    parts: BTreeMap<usize, Vec<Part>>,
    /// By material (`None`: the default one) and whether it fills a solid.
    materials: BTreeMap<(Option<usize>, bool), Known>,
    triangles: usize,
}

/// The arrays of a mesh while its primitives are joined.
#[derive(Default)]
struct Arrays {
    positions: Vec<[f32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
    uvs: Option<Vec<[f32; 2]>>,
    triangles: Vec<[u32; 3]>,
}

impl Reader<'_> {
    /// Reads the default scene (the first one, or all roots where there is none).
    pub fn scene(&mut self, to_world: DAffine3) -> Result<(), Fault> {
        let root = self.root;
        let chosen = root.scene.map_or(0, |s| s.value());
        let roots: Vec<usize> = match root.scenes.get(chosen) {
            Some(scene) => scene.nodes.iter().map(|n| n.value()).collect(),
            None if root.scenes.is_empty() => {
                let mut is_child = vec![false; root.nodes.len()];
                for child in root.nodes.iter().flat_map(|n| n.children.iter().flatten()) {
                    if let Some(c) = is_child.get_mut(child.value()) {
                        *c = true;
                    }
                }
                (0..root.nodes.len()).filter(|&i| !is_child[i]).collect()
            }
            None => return Err(Fault::missing("scene", chosen)),
        };
        if root.scenes.len() > 1 {
            self.note(format!(
                "{} scenes: number {chosen} is read",
                root.scenes.len()
            ));
        }
        let mut made = Made::default();
        let mut seen = vec![false; root.nodes.len()];
        let mut open: Vec<(usize, DAffine3)> =
            roots.into_iter().rev().map(|n| (n, to_world)).collect();
        while let Some((i, parent)) = open.pop() {
            let node = root.nodes.get(i).ok_or_else(|| Fault::missing("node", i))?;
            if std::mem::replace(&mut seen[i], true) {
                return Err(Fault::new(format!(
                    "node {i} is reached twice: the hierarchy is no tree"
                )));
            }
            let world = parent * local(node, i)?;
            if !finite(&world) {
                return Err(Fault::new(format!(
                    "the transform of node {i} is not finite"
                )));
            }
            self.node(node, i, world, &mut made)?;
            let children = node.children.iter().flatten().rev();
            open.extend(children.map(|c| (c.value(), world)));
        }
        if self.model.objects.is_empty() {
            return Err(Fault::new("the scene has no triangles"));
        }
        Ok(())
    }

    fn node(
        &mut self,
        node: &Node,
        i: usize,
        world: DAffine3,
        made: &mut Made,
    ) -> Result<(), Fault> {
        let name = node.name.clone().unwrap_or_else(|| format!("node {i}"));
        if let Some(mesh) = node.mesh {
            if node.skin.is_some() {
                self.note("skins are not read: meshes keep their rest pose".into());
            }
            self.mesh(mesh.value(), &name, world, made)?;
        }
        if let Some(camera) = node.camera {
            let source = self
                .root
                .cameras
                .get(camera.value())
                .ok_or_else(|| Fault::missing("camera", camera.value()))?;
            if let Some(projection) = projection(source) {
                self.model.cameras.push(ModelCamera {
                    name: source.name.clone().unwrap_or(name.clone()),
                    to_world: rigid(&world),
                    projection,
                });
            } else {
                self.note(format!(
                    "camera \"{name}\" has no valid projection: ignored"
                ));
            }
        }
        let Some(extensions) = &node.extensions else {
            return Ok(());
        };
        for other in extensions.others.keys() {
            self.note(format!("{other} of nodes is not understood: ignored"));
        }
        if let Some(light) = &extensions.khr_lights_punctual {
            let index = light.light.value();
            let lights = self
                .root
                .extensions
                .as_ref()
                .and_then(|e| e.khr_lights_punctual.as_ref());
            let source = lights
                .and_then(|l| l.lights.get(index))
                .ok_or_else(|| Fault::missing("light", index))?;
            self.light(source, &name, world)?;
        }
        Ok(())
    }

    fn light(&mut self, source: &Punctual, name: &str, world: DAffine3) -> Result<(), Fault> {
        let values = source.color.iter().chain([&source.intensity]);
        if !values.clone().all(|v| v.is_finite() && *v >= 0.0) {
            return Err(Fault::new(format!(
                "light \"{name}\": color or intensity is not a finite number >= 0"
            )));
        }
        let scale = f64::from(source.intensity) * PER_NIT;
        let emission = Emission::from_rgb(source.color.map(|c| f64::from(c) * scale));
        let position = world.translation;
        let Some(direction) = (-world.matrix3.z_axis).try_normalize() else {
            return Err(Fault::new(format!("light \"{name}\" has no direction")));
        };
        let light = match source.type_ {
            Checked::Valid(LightType::Point) => Light::Point(PointLight::at(position, emission)),
            Checked::Valid(LightType::Directional) => {
                Light::Directional(DirectionalLight::along(direction, emission))
            }
            Checked::Valid(LightType::Spot) => {
                let cone = source.spot.clone().unwrap_or_default();
                let outer = f64::from(cone.outer_cone_angle);
                let inner = f64::from(cone.inner_cone_angle);
                if !(outer > 0.0 && outer <= std::f64::consts::PI && (0.0..=outer).contains(&inner))
                {
                    return Err(Fault::new(format!(
                        "light \"{name}\": cone angles {inner} and {outer} (allowed: 0 <= inner <= outer, outer > 0)"
                    )));
                }
                Light::Spot(SpotLight::aimed(
                    position, direction, emission, outer, inner,
                ))
            }
            Checked::Invalid => {
                self.note(format!("light \"{name}\" is of an unknown kind: ignored"));
                return Ok(());
            }
        };
        self.model.lights.push(LightDescription {
            name: name.to_owned(),
            light,
        });
        Ok(())
    }

    /// Adds the objects of a mesh.
    fn mesh(
        &mut self,
        index: usize,
        name: &str,
        world: DAffine3,
        made: &mut Made,
    ) -> Result<(), Fault> {
        if world.matrix3.determinant().abs() < f64::MIN_POSITIVE {
            self.note(format!("\"{name}\" is scaled to nothing: ignored"));
            return Ok(());
        }
        if !made.parts.contains_key(&index) {
            let parts = self.parts(index, made)?;
            made.parts.insert(index, parts);
        }
        let parts = &made.parts[&index];
        for (i, part) in parts.iter().enumerate() {
            self.model.objects.push(ObjectDescription {
                name: if parts.len() == 1 {
                    name.to_owned()
                } else {
                    format!("{name}, part {i}")
                },
                shape: Shape::Mesh(part.mesh.clone()),
                transform: Transform::fixed(world),
                material: part.material,
                boundary: part.boundary,
                emission: part.emission.clone(),
            });
        }
        Ok(())
    }

    /// The parts of a mesh: primitives of one material are one mesh, so that a solid may be made of several.
    fn parts(&mut self, index: usize, made: &mut Made) -> Result<Vec<Part>, Fault> {
        let root = self.root;
        let mesh = root
            .meshes
            .get(index)
            .ok_or_else(|| Fault::missing("mesh", index))?;
        let mut by_material: BTreeMap<Option<usize>, Option<Arrays>> = BTreeMap::new();
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let what = format!("mesh {index}, primitive {i}");
            let id = primitive.material.map(|m| m.value());
            let source = self.source(id)?;
            let Some(arrays) = self.primitive(primitive, coordinate_set(&source), &what)? else {
                continue;
            };
            made.triangles += arrays.triangles.len();
            if made.triangles > MAX_TRIANGLES {
                return Err(Fault::new(format!(
                    "more than {MAX_TRIANGLES} triangles in the meshes of the file"
                )));
            }
            let joined = by_material.entry(id).or_default();
            *joined = Some(match joined.take() {
                None => arrays,
                Some(mut first) => {
                    first.append(arrays);
                    first
                }
            });
        }
        let mut parts = Vec::new();
        for (id, arrays) in by_material {
            let Some(arrays) = arrays else { continue };
            let what = mesh.name.clone().unwrap_or_else(|| format!("mesh {index}"));
            let has_uvs = arrays.uvs.is_some();
            let given = arrays.triangles.len();
            let mesh = match Mesh::new(
                &arrays.positions,
                arrays.normals,
                arrays.uvs,
                arrays.triangles,
            ) {
                Ok(mesh) => mesh,
                Err(crate::geometry::MeshError::Empty { .. }) => {
                    self.note(format!(
                        "\"{what}\": none of {given} triangles has an area: ignored"
                    ));
                    continue;
                }
                Err(error) => return Err(Fault::new(format!("\"{what}\": {error}"))),
            };
            let source = self.source(id)?;
            let solid = has_volume(&source) && mesh.is_closed();
            let (material, emission, medium) = self.converted(id, &source, solid, made)?;
            let mut images = Vec::new();
            self.model.materials[material.0 as usize].append_images(&mut images);
            if !has_uvs && !images.is_empty() {
                self.note(format!(
                    "\"{what}\" has textures but no texture coordinates"
                ));
            }
            let boundary = medium.map_or(Boundary::None, |medium| Boundary::Solid {
                medium,
                priority: 0,
            });
            parts.push(Part {
                mesh: Arc::new(mesh),
                material,
                boundary,
                emission,
            });
        }
        Ok(parts)
    }

    fn source(&self, id: Option<usize>) -> Result<Source, Fault> {
        match id {
            None => Ok(Source::default()),
            Some(i) => self
                .root
                .materials
                .get(i)
                .cloned()
                .ok_or_else(|| Fault::missing("material", i)),
        }
    }

    fn converted(
        &mut self,
        id: Option<usize>,
        source: &Source,
        solid: bool,
        made: &mut Made,
    ) -> Result<Known, Fault> {
        if let Some(known) = made.materials.get(&(id, solid)) {
            return Ok(known.clone());
        }
        let name = match (&source.name, id) {
            (Some(name), _) => name.clone(),
            (None, Some(i)) => format!("material {i}"),
            (None, None) => "default".to_owned(),
        };
        let Converted {
            material,
            emission,
            interior,
        } = self.material(source, &name, solid)?;
        let medium = interior.map(|medium| {
            self.model.media.push(medium);
            MediumId(self.model.media.len() as u32 - 1)
        });
        self.model.materials.push(material);
        let new = (
            MaterialId(self.model.materials.len() as u32 - 1),
            emission,
            medium,
        );
        made.materials.insert((id, solid), new.clone());
        Ok(new)
    }

    /// `None` for points and lines.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        set: u32,
        what: &str,
    ) -> Result<Option<Arrays>, Fault> {
        let Checked::Valid(mode) = primitive.mode else {
            return Err(Fault::new(format!("{what}: unknown mode")));
        };
        if !matches!(
            mode,
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        ) {
            self.note(format!("{what} is made of points or lines: ignored"));
            return Ok(None);
        }
        if let Some(extensions) = &primitive.extensions
            && let Some(name) = extensions
                .others
                .keys()
                .find(|k| *k != "KHR_materials_variants")
        {
            self.note(format!("{what}: {name} is not understood: ignored"));
        }
        if primitive.targets.as_ref().is_some_and(|t| !t.is_empty()) {
            self.note("morph targets are not read: meshes keep their rest shape".into());
        }
        let find =
            |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(positions) = find(Semantic::Positions) else {
            return Err(Fault::new(format!("{what} has no POSITION")));
        };
        if find(Semantic::Colors(0)).is_some() {
            self.note("vertex colors are not read".into());
        }
        let positions = self.buffers.vectors::<3>(positions)?;
        let normals = match find(Semantic::Normals) {
            None => None,
            Some(id) => Some(self.buffers.vectors::<3>(id)?),
        };
        let uvs = match find(Semantic::TexCoords(set)) {
            None => None,
            Some(id) => Some(self.buffers.vectors::<2>(id)?),
        };
        let indices = match primitive.indices {
            Some(id) => self.buffers.indices(id)?,
            None => (0..u32::try_from(positions.len()).unwrap_or(u32::MAX)).collect(),
        };
        for (array, length) in [
            ("NORMAL", normals.as_ref().map(Vec::len)),
            ("TEXCOORD", uvs.as_ref().map(Vec::len)),
        ] {
            if length.is_some_and(|n| n != positions.len()) {
                return Err(Fault::new(format!(
                    "{what}: {array} has {} entries for {} positions",
                    length.unwrap_or(0),
                    positions.len()
                )));
            }
        }
        if let Some(bad) = indices.iter().find(|&&v| v as usize >= positions.len()) {
            return Err(Fault::new(format!(
                "{what}: index {bad} of {} positions",
                positions.len()
            )));
        }
        let triangles = match mode {
            Mode::TriangleStrip => indices
                .windows(3)
                .enumerate()
                .map(|(i, w)| {
                    if i % 2 == 0 {
                        [w[0], w[1], w[2]]
                    } else {
                        [w[1], w[0], w[2]]
                    }
                })
                .collect(),
            Mode::TriangleFan => indices
                .get(1..)
                .unwrap_or_default()
                .windows(2)
                .map(|w| [indices[0], w[0], w[1]])
                .collect(),
            _ => indices.as_chunks::<3>().0.to_vec(),
        };
        Ok(Some(Arrays {
            positions,
            normals,
            uvs,
            triangles,
        }))
    }
}

impl Arrays {
    /// Joins another primitive; what only one of them has is dropped.
    fn append(&mut self, other: Self) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.normals = both(self.normals.take(), other.normals);
        self.uvs = both(self.uvs.take(), other.uvs);
        let shifted = other.triangles.iter().map(|t| t.map(|v| v + first));
        self.triangles.extend(shifted);
    }
}

fn both<T>(a: Option<Vec<T>>, b: Option<Vec<T>>) -> Option<Vec<T>> {
    let (mut a, b) = (a?, b?);
    a.extend(b);
    Some(a)
}

/// The placement of a node in its parent.
fn local(node: &Node, i: usize) -> Result<DAffine3, Fault> {
    let map = match &node.matrix {
        Some(matrix) => DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from))),
        None => {
            let vector = |v: Option<[f32; 3]>, default: DVec3| {
                v.map_or(default, |v| DVec3::from(v.map(f64::from)))
            };
            let rotation = node
                .rotation
                .map_or(DQuat::IDENTITY, |r| DQuat::from_array(r.0.map(f64::from)));
            let length = rotation.length();
            if !(length > 0.0 && length.is_finite()) {
                return Err(Fault::new(format!(
                    "the transform of node {i} is not finite"
                )));
            }
            DAffine3::from_scale_rotation_translation(
                vector(node.scale, DVec3::ONE),
                rotation / length,
                vector(node.translation, DVec3::ZERO),
            )
        }
    };
    if finite(&map) {
        Ok(map)
    } else {
        Err(Fault::new(format!(
            "the transform of node {i} is not finite"
        )))
    }
}

fn finite(map: &DAffine3) -> bool {
    map.to_cols_array().iter().all(|v| v.abs() <= LARGEST)
}

/// The nearest rigid motion: cameras do not scale what they see.
fn rigid(world: &DAffine3) -> DAffine3 {
    let back = world.matrix3.z_axis.normalize_or(DVec3::Z);
    let up = world.matrix3.y_axis;
    let right = up
        .cross(back)
        .try_normalize()
        .unwrap_or_else(|| back.any_orthonormal_vector());
    DAffine3 {
        matrix3: glam::DMat3::from_cols(right, back.cross(right), back),
        translation: world.translation,
    }
}

fn projection(camera: &Camera) -> Option<Projection> {
    if let Some(p) = &camera.perspective {
        let fov_rad = f64::from(p.yfov);
        let aspect = p
            .aspect_ratio
            .map(f64::from)
            .filter(|a| a.is_finite() && *a > 0.0);
        return (fov_rad > 0.0 && fov_rad < std::f64::consts::PI)
            .then_some(Projection::Perspective { fov_rad, aspect });
    }
    let o = camera.orthographic.as_ref()?;
    let (x, y) = (f64::from(o.xmag), f64::from(o.ymag));
    (x.is_finite() && y.is_finite() && x > 0.0 && y > 0.0).then_some(Projection::Orthographic {
        height: 2.0 * y,
        aspect: x / y,
    })
}
