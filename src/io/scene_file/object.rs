//! `[[object]]`: a shape, where it is, what it is made of, what it separates and what it emits.

use super::document::Node;
use super::keys::{Build, Built, Form, Given, Keys, Range, Spec, Table, Value, first_given, keys};
use super::material::MaterialFacts;
use super::mesh::MeshSource;
use super::motion::Motion;
use super::reader::Reader;
use super::shape::{BoxKeys, CylinderKeys, DiskKeys, Placed, QuadKeys, SphereKeys};
use super::spectrum::SurfaceEmission;
use super::transform::Steps;
use super::value::{At, MaterialName, MediumName, Name, items};
use crate::geometry::{Shape, Transform};
use crate::material::MaterialId;
use crate::medium::{Boundary, MediumId};
use crate::scene::Subject;
use crate::scene::description::{AreaEmission, ObjectDescription};
use glam::{DAffine3, DVec3};
use std::collections::BTreeSet;

const PRIORITY: Range = Range::closed(i32::MIN as f64, i32::MAX as f64, "-2^31 to 2^31 - 1");

keys! {
    /// A surface of exactly one shape.
    ObjectKeys = "object" {
        /// Name for messages and for `--set`, unique.
        name: Option<At<Name>>, or "`object 0`, ...";
        /// A sphere.
        sphere: Option<Given<SphereKeys>>;
        /// A disk, with or without a hole.
        disk: Option<Given<DiskKeys>>;
        /// A parallelogram.
        quad: Option<Given<QuadKeys>>;
        /// The side of a cylinder.
        cylinder: Option<Given<CylinderKeys>>;
        /// A box along the axes.
        r#box as "box": Option<Given<BoxKeys>>;
        /// A mesh, read once for all objects that use the same.
        mesh: Option<MeshSource>;
        /// Material of the surface.
        material: Option<MaterialUse>, or "black";
        /// Steps that place it, applied in order.
        transform: Steps;
        /// Motion after that.
        motion: Motion<true>;
        /// The medium of a closed shape (sphere, box, closed mesh).
        interior: Option<At<MediumUse>>, or "none";
        /// With `interior`: where solids overlap, the larger wins, of equal ones the later object.
        priority: Option<i64>, in PRIORITY, or "0";
        /// Media on both sides of an open surface such as that of a lens, instead of `interior`.
        interface: Option<InterfaceKeys>, or "none";
        /// Radiance.
        emission: Option<SurfaceEmission>, unit "W/(m² sr nm)", or "none";
        /// With `emission`: emits from the back too.
        two_sided: Option<bool>, or "false";
        /// With `emission`: the medium in front of it; checked, and needed only where solids are
        /// open.
        medium: Option<MediumUse>, or "what is there";
    }
}

keys! {
    /// The media of an open surface.
    InterfaceKeys = "interface" {
        /// On the side of the normal.
        above: Option<MediumUse>, or "the ambient one";
        /// Behind.
        below: Option<MediumUse>, or "the ambient one";
    }
}

impl Value for InterfaceKeys {
    fn form() -> Form {
        Form::Table(Self::KIND)
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let table = Table::of(node, Self::NAMES, cx)?;
        Self::from_table(&table, cx)
    }
}

const SHAPES: [&str; 6] = ["sphere", "disk", "quad", "cylinder", "box", "mesh"];

/// A material of the file.
pub struct MaterialUse {
    name: String,
    /// `None` where its definition is wrong.
    pub facts: Option<MaterialFacts>,
}

impl Value for MaterialUse {
    fn form() -> Form {
        MaterialName::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let MaterialName(name) = MaterialName::read(node, spec, cx)?;
        let facts = cx.defined("material", &name, &node.span(), |cx| &cx.materials);
        Some(Self {
            name,
            facts: facts.flatten(),
        })
    }
}

/// A medium of the file.
#[derive(Clone, Copy)]
pub struct MediumUse(pub MediumId);

impl Value for MediumUse {
    fn form() -> Form {
        MediumName::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let MediumName(name) = MediumName::read(node, spec, cx)?;
        if !cx.media.contains_key(&name) && cx.library.ior(&name).is_ok() {
            let message = format!(
                "\"{name}\" is a glass, not a medium (write [medium.NAME] with glass = \"{name}\", \
                 and NAME here)"
            );
            cx.conflict(&node.span(), message);
            return Some(Self(MediumId::AMBIENT));
        }
        let found = cx.defined("medium", &name, &node.span(), |cx| &cx.media);
        Some(Self(found.unwrap_or(MediumId::AMBIENT)))
    }
}

/// An object that has no name yet, unless it was given one.
pub struct Unnamed {
    name: Option<String>,
    object: ObjectDescription,
    medium: Option<MediumId>,
}

impl Build for ObjectKeys {
    type Output = Unnamed;

    fn build(mut self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Unnamed> {
        let material = self.material.as_ref().and_then(|m| m.facts.clone());
        let boundary = self.boundary(table, cx);
        let shape = table
            .exactly_one(&SHAPES, "object", cx)
            .and_then(|_| self.shape(cx));
        self.check_sides(material.as_ref(), boundary, shape.as_ref(), table, cx);
        if let (Some((shape, _)), Some(at)) = (&shape, self.image_at(material.as_ref())) {
            let has_coordinates = match shape {
                Shape::Mesh(mesh) => mesh.has_texture_coordinates(),
                Shape::Deforming(mesh) => mesh.has_texture_coordinates(),
                _ => true,
            };
            if !has_coordinates {
                cx.conflict(&at, "a texture on a mesh without texture coordinates");
            }
        }
        let (shape, local) = shape?;
        table.sound(cx)?;
        let to_world = self.transform.0 * local;
        let volume = to_world.matrix3.determinant().abs();
        if !to_world.matrix3.is_finite() || volume < f64::MIN_POSITIVE {
            let message = "the object has no volume or area after its transform (allowed: an \
                           invertible transform)";
            cx.conflict(&table.at, message);
            return None;
        }
        let fixed = Transform::fixed(to_world);
        let transform = if self.motion.0.is_empty() {
            fixed
        } else {
            fixed.under(&self.motion.0, cx.shutter.unwrap_or_default())
        };
        let two_sided = self.two_sided.unwrap_or(false);
        Some(Unnamed {
            name: self.name.map(|n| n.value.0),
            medium: self.medium.map(|m| m.0),
            object: ObjectDescription {
                name: String::new(),
                shape,
                transform,
                material: material.map_or(MaterialId(cx.black), |m| m.id),
                boundary,
                emission: self.emission.map(|e| AreaEmission {
                    radiance: e.radiance,
                    pattern: e.pattern,
                    two_sided,
                }),
            },
        })
    }
}

impl ObjectKeys {
    fn shape(&mut self, cx: &Reader<'_>) -> Option<Placed> {
        if let Some(mesh) = self.mesh.take() {
            // the vertices are in the file's unit
            let (shape, local) = mesh.0?;
            let to_meters = DAffine3::from_scale(DVec3::splat(cx.unit_m));
            return Some((shape, to_meters * local));
        }
        first_given([
            self.sphere.take().map(|g| g.0),
            self.disk.take().map(|g| g.0),
            self.quad.take().map(|g| g.0),
            self.cylinder.take().map(|g| g.0),
            self.r#box.take().map(|g| g.0),
        ])?
    }

    fn boundary(&self, table: &Table<'_>, cx: &mut Reader<'_>) -> Boundary {
        if self.priority.is_some() && self.interior.is_none() {
            let message = "priority is for objects with interior only";
            cx.conflict(&table.span("priority"), message);
        }
        match (&self.interior, &self.interface) {
            (None, None) => Boundary::None,
            (Some(interior), None) => Boundary::Solid {
                medium: interior.value.0,
                priority: self.priority.unwrap_or(0) as i32,
            },
            (None, Some(interface)) => Boundary::Interface {
                above: interface.above.map_or(MediumId::AMBIENT, |m| m.0),
                below: interface.below.map_or(MediumId::AMBIENT, |m| m.0),
            },
            (Some(_), Some(_)) => {
                let message = "an object has either interior or interface, not both";
                cx.conflict(&table.at, message);
                Boundary::None
            }
        }
    }

    /// A solid needs a closed shape, a dielectric a medium on each side, a material with coverage
    /// neither, and only what emits has sides to emit from.
    fn check_sides(
        &self,
        material: Option<&MaterialFacts>,
        boundary: Boundary,
        shape: Option<&Placed>,
        table: &Table<'_>,
        cx: &mut Reader<'_>,
    ) {
        if let (Some(interior), Some((shape, _))) = (&self.interior, shape)
            && let Some(message) = no_interior(shape)
        {
            cx.conflict(&interior.at, message);
        }
        if self.medium.is_some() && self.emission.is_none() {
            let message = "medium is for objects with emission only";
            cx.conflict(&table.span("medium"), message);
        }
        if self.two_sided.is_some() && self.emission.is_none() {
            let message = "two_sided is for objects with emission only";
            cx.conflict(&table.span("two_sided"), message);
        }
        let (Some(name), Some(material)) = (&self.material, material) else {
            return;
        };
        if material.is_dielectric && self.interior.is_none() && self.interface.is_none() {
            let name = &name.name;
            let message = format!(
                "material \"{name}\" is dielectric: the object needs interior or interface"
            );
            cx.conflict(&table.span("material"), message);
        }
        let cut = self.emission.is_some() || boundary != Boundary::None;
        if material.has_coverage && cut {
            let name = &name.name;
            let message = format!(
                "material \"{name}\" has a coverage, which objects with emission, interior or \
                 interface cannot have"
            );
            cx.conflict(&table.span("material"), message);
        }
    }

    /// Where the object has an image, if it has one.
    fn image_at(&self, material: Option<&MaterialFacts>) -> Option<std::ops::Range<usize>> {
        let emission = self.emission.as_ref().and_then(|e| e.image_at.clone());
        emission.or_else(|| material?.image_at.clone())
    }
}

/// Why a shape has no interior; `None` where it has one.
pub fn no_interior(shape: &Shape) -> Option<String> {
    match shape {
        Shape::Disk { .. } | Shape::Quad | Shape::Cylinder => (!shape.is_closed()).then(|| {
            "interior needs a closed shape (allowed: sphere, box, a closed mesh; for others name \
             both sides with interface)"
                .to_owned()
        }),
        _ => shape.open_edge().map(|[a, b]| {
            let text = |p: DVec3| format!("[{}, {}, {}]", p.x, p.y, p.z);
            format!(
                "the mesh is not closed, so it has no interior (every edge needs two triangles \
                 that run through it in opposite directions; that from {} to {} has not)",
                text(a),
                text(b)
            )
        }),
    }
}

/// `[[object]]`, each with its place.
#[derive(Debug, Default)]
pub struct Objects(pub Vec<At<ObjectDescription>>);

impl Value for Objects {
    fn form() -> Form {
        Form::List(Box::new(Form::Table(ObjectKeys::KIND)))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        cx.files_before_objects = cx.file_hashes.len();
        let mut objects = Vec::new();
        let mut names = BTreeSet::new();
        for (i, item) in items(node, "an array", cx)?.into_iter().enumerate() {
            let Some(read) = Built::<ObjectKeys>::read(item, spec, cx) else {
                continue;
            };
            let Unnamed {
                name,
                mut object,
                medium,
            } = read.0;
            let subject = Subject::Emission(objects.len());
            cx.named_media.extend(medium.map(|m| (subject, m)));
            if let Some(name) = &name
                && !names.insert(name.clone())
            {
                let at = item.get_ref().get("name").map_or(item.span(), |n| n.span());
                cx.conflict(&at, format!("object \"{name}\" is defined twice"));
            }
            object.name = name.unwrap_or_else(|| format!("object {i}"));
            if object.material.0 == cx.black && object.emission.is_none() {
                let warning = format!(
                    "{} has no material and no emission: it is black",
                    object.name
                );
                cx.warnings.push(warning);
            }
            objects.push(At {
                value: object,
                at: item.span(),
            });
        }
        Some(Self(objects))
    }

    fn absent(_: &Table<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        cx.files_before_objects = cx.file_hashes.len();
        Some(Self::default())
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}
