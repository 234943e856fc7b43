//! Lenses as objects of a scene: each surface of a prescription becomes an interface that names the
//! media on both sides, cemented ones included, and what is not clear becomes black.
//!
//! Surfaces with glass between them are a group, closed by an edge around it. The edge has the
//! radius of the widest aperture; narrower ones are continued by flat flanges. A surface between
//! equal media is a diaphragm: a black plane with a hole. Air is the ambient medium of the scene.

mod parts;
mod rims;

use super::description::{ObjectDescription, SceneDescription};
use crate::geometry::{Shape, Transform};
use crate::material::{Material, MaterialId};
use crate::medium::{Boundary, Medium, MediumId};
use crate::optics::{Prescription, Stack};
use crate::spectrum::Ior;
use glam::{DAffine3, DVec3};
use std::sync::Arc;
use thiserror::Error;

/// Metres per millimeter.
const MM: f64 = 1e-3;

/// Prescription that cannot stand in a scene.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("surface {surface}: {message}")]
pub struct LensBuildError {
    /// The surface, counted from 1.
    pub surface: usize,
    /// Problem, and what is allowed.
    pub message: String,
}

/// Role of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// Interface between media, by index (`None`: air): on the side of +z, and of -z; and its
    /// coating, by index.
    Interface {
        above: Option<usize>,
        below: Option<usize>,
        coating: Option<usize>,
    },
    Mirror,
    Black,
    /// Rim of glass.
    Edge,
}

#[derive(Clone, Debug)]
struct Part {
    name: String,
    shape: Shape,
    /// From the space of the shape to that of the lens, millimeters.
    to_lens: DAffine3,
    role: Role,
}

/// A lens in parts, millimeters; light enters along +z, the vertex of the first surface is near the
/// origin.
#[derive(Clone, Debug)]
pub struct LensAssembly {
    parts: Vec<Part>,
    glasses: Vec<Ior>,
    /// Layers as light from the side of +z meets them.
    coatings: Vec<Arc<Stack>>,
}

impl LensAssembly {
    /// The parts of a valid prescription, but for its image. `barrel_mm`: radius of a black tube
    /// around all of it that holds its groups.
    ///
    /// # Errors
    /// Where a surface has no edge, glass cannot be closed, or something does not fit.
    pub fn new(lens: &Prescription, barrel_mm: Option<f64>) -> Result<Self, LensBuildError> {
        parts::Builder::new(lens, barrel_mm)?.build()
    }

    /// Glasses of the lens.
    #[must_use]
    pub fn glasses(&self) -> &[Ior] {
        &self.glasses
    }

    /// Adds the lens to a scene, as objects named after it, of a black material and of one for the
    /// edges and flanges of its glass; `place` makes the transform of a part
    /// from its map to the space of the lens in meters. Takes time and memory linear in its parts.
    pub fn add_to(
        self,
        scene: &mut SceneDescription,
        name: &str,
        [black, edge]: [MaterialId; 2],
        place: impl Fn(DAffine3) -> Transform,
    ) {
        let media: Vec<MediumId> = self
            .glasses
            .into_iter()
            .map(|ior| medium(&mut scene.media, ior))
            .collect();
        let of = |side: Option<usize>| side.map_or(MediumId::AMBIENT, |i| media[i]);
        let mut mirror = None;
        let mut interfaces = vec![None; self.coatings.len() + 1];
        for part in self.parts {
            let (material, boundary) = match part.role {
                Role::Black => (black, Boundary::None),
                Role::Edge => (edge, Boundary::None),
                Role::Mirror => {
                    let id =
                        mirror.get_or_insert_with(|| add_material(scene, Material::mirror(1.0)));
                    (*id, Boundary::None)
                }
                Role::Interface {
                    above,
                    below,
                    coating,
                } => {
                    let id = interfaces[coating.map_or(0, |i| i + 1)].get_or_insert_with(|| {
                        let material = coating.map_or_else(
                            || Material::interface(0.0),
                            |i| Material::coated_interface(Arc::clone(&self.coatings[i])),
                        );
                        add_material(scene, material)
                    });
                    let (above, below) = (of(above), of(below));
                    (*id, Boundary::Interface { above, below })
                }
            };
            let to_meters = DAffine3::from_scale(DVec3::splat(MM));
            scene.objects.push(ObjectDescription {
                name: format!("{name}: {}", part.name),
                shape: part.shape,
                transform: place(to_meters * part.to_lens),
                material,
                boundary,
                emission: None,
            });
        }
    }
}

/// The medium of a glass, with its absorption; lenses share those that are equal.
fn medium(media: &mut Vec<Medium>, ior: Ior) -> MediumId {
    let same = |m: &Medium| m.use_k && m.absorption.is_none() && m.ior == ior;
    // not the first: the ambient medium may be of this glass, and is not known as one of a lens
    let known = media.iter().skip(1).position(same).map(|i| i + 1);
    let index = known.unwrap_or_else(|| {
        media.push(Medium {
            name: ior.name().to_owned(),
            ior,
            absorption: None,
            use_k: true,
        });
        media.len() - 1
    });
    MediumId(index as u32)
}

fn add_material(scene: &mut SceneDescription, material: Material) -> MaterialId {
    let id = MaterialId(scene.materials.len() as u32);
    scene.materials.push(material);
    id
}
