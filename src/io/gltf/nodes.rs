//! The node hierarchy of a glTF file: meshes, lights and cameras with their places in the world.

use super::animation::AllMoves;
use super::deform::{self, Deformation};
use super::glass::has_volume;
use super::hierarchy::{Hierarchy, Place, rigid};
use super::material::{Converted, PER_NIT, coordinate_set};
use super::mesh::Arrays;
use super::{Fault, MAX_TRIANGLES, Reader};
use crate::geometry::deforming::DeformingError;
use crate::geometry::{Mesh, MeshError, Shape, Shutter, Transform};
use crate::io::model::{Model, ModelCamera, Projection};
use crate::light::Light;
use crate::light::spot::{Falloff, SpotLight};
use crate::material::MaterialId;
use crate::medium::{Boundary, MediumId};
use crate::scene::description::{AreaEmission, LightDescription, ObjectDescription};
use crate::spectrum::Emission;
use glam::DAffine3;
use gltf::json::camera::Camera;
use gltf::json::extensions::scene::khr_lights_punctual::{Light as Punctual, Type as LightType};
use gltf::json::material::Material as Source;
use gltf::json::validation::Checked;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

/// All primitives of one material of a mesh.
#[derive(Clone)]
struct Part {
    shape: Shape,
    material: MaterialId,
    boundary: Boundary,
    emission: Option<AreaEmission>,
}

/// A material in the model: its id, what it emits, and the medium that fills its meshes.
type Known = (MaterialId, Option<AreaEmission>, Option<MediumId>);

/// The arrays of a mesh by material.
type ByMaterial = Vec<(Option<usize>, Arrays)>;

/// Meshes and materials made so far.
#[derive(Default)]
struct Made {
    /// Of meshes as they are in the file.
    parts: BTreeMap<usize, Vec<Part>>,
    /// Of meshes that are deformed, differently for each of their nodes.
    arrays: BTreeMap<usize, Rc<ByMaterial>>,
    /// By material (`None`: the default one) and whether it fills a solid.
    materials: BTreeMap<(Option<usize>, bool), Known>,
    triangles: usize,
}

impl Reader<'_> {
    /// Reads the default scene (the first one, or all roots where there is none).
    pub fn scene(&mut self) -> Result<(), Fault> {
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
        let moves = self.moves()?;
        let hierarchy = Hierarchy::read(self, &roots, &moves)?;
        let mut made = Made::default();
        for &i in &hierarchy.order {
            self.node(i, &hierarchy, &moves, &mut made)?;
        }
        let Model {
            objects,
            lights,
            cameras,
            ..
        } = &self.model;
        if objects.is_empty() && lights.is_empty() && cameras.is_empty() {
            return Err(Fault::new("the scene has no triangles, lights or cameras"));
        }
        Ok(())
    }

    fn node(
        &mut self,
        i: usize,
        hierarchy: &Hierarchy,
        moves: &AllMoves,
        made: &mut Made,
    ) -> Result<(), Fault> {
        let node = &self.root.nodes[i];
        let Some(place) = hierarchy.place(i) else {
            return Ok(());
        };
        let name = node.name.clone().unwrap_or_else(|| format!("node {i}"));
        self.misplaced_glass(&node.extras, &format!("node \"{name}\""));
        if let Some(mesh) = node.mesh {
            let weights = moves.get(&i).and_then(|m| m.weights.as_ref());
            match self.deformation(node, i, weights, hierarchy)? {
                None => self.mesh(mesh.value(), &name, place, hierarchy, made)?,
                Some(deformation) => {
                    let at = (mesh.value(), place);
                    self.deformed_mesh(at, &name, &deformation, hierarchy, made)?;
                }
            }
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
                    transform: camera_transform(place, hierarchy, self.staging.shutter),
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
            self.light(source, &name, place, hierarchy)?;
        }
        Ok(())
    }

    fn light(
        &mut self,
        source: &Punctual,
        name: &str,
        place: Place,
        hierarchy: &Hierarchy,
    ) -> Result<(), Fault> {
        let values = source.color.iter().chain([&source.intensity]);
        if !values.clone().all(|v| v.is_finite() && *v >= 0.0) {
            return Err(Fault::new(format!(
                "light \"{name}\": color or intensity is not a finite number >= 0"
            )));
        }
        let scale = f64::from(source.intensity) * PER_NIT;
        let emission = Emission::from_rgb(source.color.map(|c| f64::from(c) * scale));
        let links = hierarchy.rigid_links(place);
        // what moves is made where its own space is that of its node
        let world = match links {
            None => hierarchy.opening(place),
            Some(_) => DAffine3::IDENTITY,
        };
        let position = world.translation;
        let Some(direction) = (-world.matrix3.z_axis).try_normalize() else {
            return Err(Fault::new(format!("light \"{name}\" has no direction")));
        };
        let light = match source.type_ {
            Checked::Valid(LightType::Point) => Light::point(position, emission),
            Checked::Valid(LightType::Directional) => Light::directional(direction, emission),
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
                let cone = SpotLight {
                    cone_rad: outer,
                    falloff_start_rad: inner,
                    falloff: Falloff::Square,
                };
                Light::spot(position, direction, emission, cone)
            }
            Checked::Invalid => {
                self.note(format!("light \"{name}\" is of an unknown kind: ignored"));
                return Ok(());
            }
        };
        self.model.lights.push(LightDescription {
            name: name.to_owned(),
            light: match links {
                None => light,
                Some(links) => light.under(&links, self.staging.shutter),
            },
        });
        Ok(())
    }

    /// Adds the objects of a mesh as it is in the file.
    fn mesh(
        &mut self,
        index: usize,
        name: &str,
        place: Place,
        hierarchy: &Hierarchy,
        made: &mut Made,
    ) -> Result<(), Fault> {
        let Some(transform) = hierarchy.transform(place) else {
            self.note(format!("\"{name}\" is scaled to nothing: ignored"));
            return Ok(());
        };
        if !made.parts.contains_key(&index) {
            let mut parts = Vec::new();
            for (id, arrays) in self.arrays(index, made)? {
                let (given, has_uvs) = (arrays.triangles.len(), arrays.uvs.is_some());
                let mesh = Mesh::new(
                    &arrays.positions,
                    arrays.normals,
                    arrays.uvs,
                    arrays.triangles,
                );
                let shape = mesh.map(|mesh| Shape::Mesh(Arc::new(mesh)));
                parts.extend(self.part(index, id, shape, (given, has_uvs), made)?);
            }
            made.parts.insert(index, parts);
        }
        self.place(&made.parts[&index], name, &transform);
        Ok(())
    }

    /// Adds the objects of a mesh with morph targets or a skin.
    fn deformed_mesh(
        &mut self,
        (index, place): (usize, Place),
        name: &str,
        deformation: &Deformation,
        hierarchy: &Hierarchy,
        made: &mut Made,
    ) -> Result<(), Fault> {
        if !made.arrays.contains_key(&index) {
            let arrays = Rc::new(self.arrays(index, made)?);
            made.arrays.insert(index, arrays);
        }
        let all = made.arrays[&index].clone();
        let what = format!("mesh {index}");
        let mut parts = Vec::new();
        for (id, arrays) in all.iter() {
            let frames = self.deformed(arrays, deformation, hierarchy, &what)?;
            let shape = deform::shape(&frames, arrays, self.staging.shutter);
            let shape = match shape {
                Ok(shape) => Ok(shape),
                Err(DeformingError::Mesh { source, .. }) => Err(source),
                Err(error) => return Err(Fault::new(format!("{what}: {error}"))),
            };
            let given = (arrays.triangles.len(), arrays.uvs.is_some());
            let skinned = deformation.skin.is_some() && !arrays.joints.is_empty();
            if deformation.skin.is_some() && !skinned {
                self.note(format!("{what} has a skin but no JOINTS_0 and WEIGHTS_0"));
            }
            parts.extend(
                self.part(index, *id, shape, given, made)?
                    .map(|p| (p, skinned)),
            );
        }
        for (part, skinned) in parts {
            // joints take the vertices along: where the node itself is does not matter
            let transform = if skinned {
                Some(Transform::fixed(self.staging.to_world))
            } else {
                hierarchy.transform(place)
            };
            match transform {
                Some(transform) => self.place(&[part], name, &transform),
                None => self.note(format!("\"{name}\" is scaled to nothing: ignored")),
            }
        }
        Ok(())
    }

    fn place(&mut self, parts: &[Part], name: &str, transform: &Transform) {
        for (i, part) in parts.iter().enumerate() {
            self.model.objects.push(ObjectDescription {
                name: if parts.len() == 1 {
                    name.to_owned()
                } else {
                    format!("{name}, part {i}")
                },
                shape: part.shape.clone(),
                transform: transform.clone(),
                material: part.material,
                boundary: part.boundary,
                emission: part.emission.clone(),
            });
        }
    }

    /// The arrays of a mesh: primitives of one material are one, so that a solid may be made of
    /// several.
    fn arrays(&mut self, index: usize, made: &mut Made) -> Result<ByMaterial, Fault> {
        let root = self.root;
        let mesh = root
            .meshes
            .get(index)
            .ok_or_else(|| Fault::missing("mesh", index))?;
        self.misplaced_glass(&mesh.extras, &format!("mesh {index}"));
        let mut by_material: BTreeMap<Option<usize>, Option<Arrays>> = BTreeMap::new();
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let what = format!("mesh {index}, primitive {i}");
            self.misplaced_glass(&primitive.extras, &what);
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
        let some = |(id, arrays): (_, Option<Arrays>)| Some((id, arrays?));
        Ok(by_material.into_iter().filter_map(some).collect())
    }

    /// A shape with its material; `None` if it has no area. `given`: its triangles, and whether it
    /// has texture coordinates.
    fn part(
        &mut self,
        index: usize,
        id: Option<usize>,
        shape: Result<Shape, MeshError>,
        (given, has_uvs): (usize, bool),
        made: &mut Made,
    ) -> Result<Option<Part>, Fault> {
        let name = &self.root.meshes[index].name;
        let what = name.clone().unwrap_or_else(|| format!("mesh {index}"));
        let shape = match shape {
            Ok(shape) => shape,
            Err(MeshError::Empty { .. }) => {
                self.note(format!(
                    "\"{what}\": none of {given} triangles has an area: ignored"
                ));
                return Ok(None);
            }
            Err(error) => return Err(Fault::new(format!("\"{what}\": {error}"))),
        };
        let source = self.source(id)?;
        let solid = has_volume(&source) && shape.is_closed();
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
        Ok(Some(Part {
            shape,
            material,
            boundary,
            emission,
        }))
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
        self.model.material_names.push(name);
        let new = (
            MaterialId(self.model.materials.len() as u32 - 1),
            emission,
            medium,
        );
        made.materials.insert((id, solid), new.clone());
        Ok(new)
    }
}

/// Where a camera is over the shutter.
fn camera_transform(place: Place, hierarchy: &Hierarchy, shutter: Shutter) -> Transform {
    match hierarchy.rigid_links(place) {
        None => Transform::fixed(rigid(&hierarchy.opening(place))),
        Some(links) => Transform::chain(&links, shutter),
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
