//! `[model.material.NAME]` and `[model.interior]`: materials that take the place of those of a
//! model, by their names in its file.

use super::document::Node;
use super::error::Problem;
use super::keys::{Built, Form, Keys, Spec, Table, Value};
use super::material::MaterialKeys;
use super::object::{MediumUse, no_interior};
use super::reader::{Definitions, Reader, definitions};
use super::value::{At, MediumName};
use crate::geometry::Shape;
use crate::io::model::Model;
use crate::material::{LobeSpec, Material, MaterialId};
use crate::medium::{Boundary, Medium, MediumId};
use std::ops::Range as Span;

/// `[model.material.NAME]`, each with its place.
#[derive(Default)]
pub struct Replacements(Definitions<At<(Material, Option<Span<usize>>)>>);

impl Value for Replacements {
    fn form() -> Form {
        Form::Map(Box::new(Form::Table(MaterialKeys::KIND)))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let read = definitions(node, cx, |_, node, cx| {
            let Built(value) = Built::<MaterialKeys>::read(node, spec, cx)?;
            let at = node.span();
            Some(At { value, at })
        });
        read.map(Self)
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self::default())
    }

    fn default_text() -> Option<String> {
        Some("those of the file".to_owned())
    }
}

/// `[model.interior]`: media inside closed meshes, by the names of their materials.
#[derive(Default)]
pub struct Interiors(Definitions<At<MediumUse>>);

impl Value for Interiors {
    fn form() -> Form {
        Form::Map(Box::new(MediumName::form()))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        definitions(node, cx, |_, node, cx| At::read(node, spec, cx)).map(Self)
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self::default())
    }

    fn default_text() -> Option<String> {
        Some("those of the file".to_owned())
    }
}

/// Whether both sides of a surface need a medium.
fn is_dielectric(material: &Material) -> bool {
    let is = |lobe: &(_, LobeSpec)| matches!(lobe.1, LobeSpec::Dielectric { .. });
    material.lobes.iter().any(is)
}

fn has_texture_coordinates(shape: &Shape) -> bool {
    match shape {
        Shape::Mesh(mesh) => mesh.has_texture_coordinates(),
        Shape::Deforming(mesh) => mesh.has_texture_coordinates(),
        _ => true,
    }
}

/// Replaces materials of a model, and what is inside its meshes; `media` are those of the scene.
pub fn replace(
    model: &mut Model,
    replacements: Replacements,
    interiors: Interiors,
    media: &[Medium],
    cx: &mut Reader<'_>,
) {
    for (name, given) in replacements.0 {
        let Some(At { value, at }) = given else {
            continue;
        };
        let (material, image_at) = value;
        let interior = interiors.0.get(&name).and_then(Option::as_ref);
        let ids = named(model, &name, &at, cx);
        for object in model
            .objects
            .iter_mut()
            .filter(|o| ids.contains(&o.material))
        {
            let solid = matches!(object.boundary, Boundary::Solid { .. });
            let conflict = if is_dielectric(&material) {
                (!solid && interior.is_none()).then(|| {
                    format!(
                        "material \"{name}\" is dielectric: \"{}\" needs a medium inside \
                         (model.interior)",
                        object.name
                    )
                })
            } else {
                object.boundary = Boundary::None;
                (material.coverage.is_some() && object.emission.is_some()).then(|| {
                    format!(
                        "material \"{name}\" has a coverage, which \"{}\" cannot have: it emits",
                        object.name
                    )
                })
            };
            if let Some(message) = conflict {
                cx.conflict(&at, message);
            }
            if let Some(at) = &image_at
                && !has_texture_coordinates(&object.shape)
            {
                cx.conflict(at, "a texture on a mesh without texture coordinates");
            }
        }
        for id in ids {
            model.materials[id.0 as usize] = material.clone();
        }
    }
    for (name, given) in interiors.0 {
        let Some(At { value, at }) = given else {
            continue;
        };
        fill(model, &name, value.0, &at, media, cx);
    }
}

/// The materials of a name; reports a name that the model does not have.
fn named(model: &Model, name: &str, at: &Span<usize>, cx: &mut Reader<'_>) -> Vec<MaterialId> {
    let names = model.material_names.iter();
    let ids: Vec<MaterialId> = (names.clone().zip(0..))
        .filter(|(own, _)| *own == name)
        .map(|(_, id)| MaterialId(id))
        .collect();
    if ids.is_empty() {
        let mut known: Vec<&str> = names.map(String::as_str).collect();
        known.sort_unstable();
        known.dedup();
        cx.error(at, || {
            Problem::unknown("material of the model", name, known)
        });
    }
    ids
}

/// Fills the meshes of a material with a medium of the scene.
fn fill(
    model: &mut Model,
    name: &str,
    medium: MediumId,
    at: &Span<usize>,
    media: &[Medium],
    cx: &mut Reader<'_>,
) {
    let ids = named(model, name, at, cx);
    let Some(medium) = media.get(medium.0 as usize).filter(|_| !ids.is_empty()) else {
        return;
    };
    model.media.push(medium.clone());
    let medium = MediumId(model.media.len() as u32 - 1);
    if !ids
        .iter()
        .any(|id| is_dielectric(&model.materials[id.0 as usize]))
    {
        let message = format!("material \"{name}\" lets nothing pass: it needs a dielectric");
        cx.conflict(at, message);
    }
    for object in model
        .objects
        .iter_mut()
        .filter(|o| ids.contains(&o.material))
    {
        if let Some(message) = no_interior(&object.shape) {
            cx.conflict(at, format!("\"{}\": {message}", object.name));
        }
        object.boundary = Boundary::Solid {
            medium,
            priority: 0,
        };
    }
}

#[cfg(test)]
mod tests {
    use crate::io::scene_file::parse_str;
    use crate::material::LobeSpec;
    use crate::medium::Boundary;

    /// A tetrahedron, closed, and a triangle.
    const OBJ: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl crystal\n\
                       f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\nusemtl sheet\nf 1 2 3\n";
    const SCENE: &str = "[[model]]\nobj = \"a.obj\"\n[medium.flint]\nglass = \"N-SF11\"\n";

    fn read(more: &str) -> Result<crate::io::scene_file::LoadedScene, String> {
        let folder = tempfile::tempdir().expect("folder");
        let mtl = "newmtl crystal\nKd 1 1 1\nnewmtl sheet\nKd 0.5 0.5 0.5\n";
        std::fs::write(folder.path().join("m.mtl"), mtl).expect("file");
        std::fs::write(folder.path().join("a.obj"), OBJ).expect("file");
        parse_str(
            &SCENE.replace("[medium", &format!("{more}\n[medium")),
            folder.path(),
        )
        .map_err(|e| e.to_string())
    }

    #[test]
    fn a_material_of_a_model_becomes_glass() {
        let more =
            "[model.material.crystal]\ndielectric = {}\n[model.interior]\ncrystal = \"flint\"";
        let scene = read(more).unwrap_or_else(|e| panic!("{e}")).description;
        let object = |name: &str| {
            scene
                .objects
                .iter()
                .find(|o| o.name == name)
                .expect("there")
        };
        let crystal = object("crystal");
        let lobes = &scene.materials[crystal.material.0 as usize].lobes;
        assert!(matches!(lobes[..], [(_, LobeSpec::Dielectric { .. })]));
        let Boundary::Solid { medium, .. } = crystal.boundary else {
            panic!("{:?}", crystal.boundary);
        };
        assert_eq!(scene.media[medium.0 as usize].name, "flint");
        // the other one is as it was
        let sheet = object("sheet");
        assert_eq!(sheet.boundary, Boundary::None);
        let lobes = &scene.materials[sheet.material.0 as usize].lobes;
        assert!(
            lobes
                .iter()
                .all(|l| !matches!(l.1, LobeSpec::Dielectric { .. }))
        );
    }

    #[test]
    fn what_does_not_fit_the_model_is_told() {
        for (more, expected) in [
            (
                "[model.material.cristal]\nmirror = {}",
                "scene:3:1: unknown material of the model \"cristal\" (did you mean \"crystal\"?)",
            ),
            (
                "[model.material.wood]\nmirror = {}",
                "unknown material of the model \"wood\" (known: crystal, sheet)",
            ),
            (
                "[model.interior]\nwood = \"flint\"",
                "scene:4:8: unknown material of the model \"wood\" (known: crystal, sheet)",
            ),
            (
                "[model.material.crystal]\ndielectric = {}",
                "material \"crystal\" is dielectric: \"crystal\" needs a medium inside (model.interior)",
            ),
            (
                "[model.interior]\ncrystal = \"flint\"",
                "material \"crystal\" lets nothing pass: it needs a dielectric",
            ),
            (
                "[model.material.sheet]\ndielectric = {}\n[model.interior]\nsheet = \"flint\"",
                "scene:6:9: \"sheet\": the mesh is not closed, so it has no interior",
            ),
            (
                "[model.interior]\ncrystal = \"oil\"",
                "unknown medium \"oil\" (known: ambient, flint)",
            ),
            (
                "[model.material.crystal]\ndiffuse = { reflectance = 2 }",
                "reflectance",
            ),
        ] {
            let message = read(more)
                .err()
                .unwrap_or_else(|| panic!("is read: {more}"));
            assert!(message.contains(expected), "{more}\n{message}");
        }
    }
}
