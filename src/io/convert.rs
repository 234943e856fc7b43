//! Scene files written from models: the model stays a file of its own; cameras and stand-in lights
//! become editable text, materials and lights text behind `#`, so that what nobody changes stays as
//! the model has it.

use super::material_text;
use super::model::{Model, ModelCamera, Projection, standard_camera};
use super::model_file::ModelKind;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// The smallest scene file with the model `file`: its own cameras and lights, or those that stand
/// in.
#[must_use]
pub fn shortest_scene(kind: ModelKind, file: &str) -> String {
    format!("{}{}", header(kind), model_table(kind, file))
}

/// A scene file with the model `file` (a path relative to the scene's) whose cameras are written
/// out, and its materials and lights behind `#`.
#[must_use]
pub fn scene_text(model: &Model, kind: ModelKind, file: &str) -> String {
    let mut text = format!(
        "# The model {}. Keys: docs/scene-files.md.\n{}\n{}",
        quoted(file),
        header(kind),
        model_table(kind, file)
    );
    text += &materials(model);
    let standard;
    let cameras = if model.cameras.is_empty() {
        standard = [standard_camera(&model.objects)];
        &standard[..]
    } else {
        &model.cameras
    };
    for (i, camera) in cameras.iter().enumerate() {
        text += &sensor_table(camera, i, cameras.len() > 1);
    }
    if !model.lit {
        let radiance = match kind {
            ModelKind::Gltf => super::gltf::PER_NIT,
            ModelKind::Obj | ModelKind::Ply => 1.0,
        };
        _ = write!(
            text,
            "\n# The model has no light.\n[[light]]\nenvironment = {{ image = \"builtin:studio\", radiance = {{ rgb = [1, 1, 1], scale = {radiance:e} }} }}\n"
        );
    }
    text + &lights(model)
}

/// Materials behind `#`.
fn materials(model: &Model) -> String {
    let mut text = "\n# The materials of the model. Without the # in front, these lines replace one, and can be changed;\n\
                    # [model.interior] fills closed meshes with a [medium.NAME].\n"
        .to_owned();
    let mut names = BTreeSet::new();
    for (material, name) in model.materials.iter().zip(&model.material_names) {
        if !names.insert(name) {
            continue;
        }
        match material_text::material(material) {
            Some(keys) => {
                _ = writeln!(text, "# [model.material.{}]", quoted(name));
                for line in keys.lines() {
                    _ = writeln!(text, "# {line}");
                }
            }
            None => {
                let name = quoted(name);
                _ = writeln!(
                    text,
                    "# {name} has images, or a glass of its own: its keys are up to you."
                );
            }
        }
    }
    text
}

/// Lights behind `#`.
fn lights(model: &Model) -> String {
    if model.lights.is_empty() {
        return String::new();
    }
    let mut text = "\n# The lights of the model, as they are at 0 s. To change them, set `lights = false` under [[model]] and\n\
                    # take away the # here. (The edge of a spot falls a little otherwise.)\n"
        .to_owned();
    for light in &model.lights {
        if let Some(keys) = material_text::light(&light.light) {
            let name = quoted(&light.name);
            _ = write!(text, "# [[light]]\n# name = {name}\n# {keys}\n");
        }
    }
    text
}

/// glTF counts in candela, lux and nit: the picture is in cd/m².
fn header(kind: ModelKind) -> &'static str {
    match kind {
        ModelKind::Gltf => "[render]\nunits = \"photometric\"\n",
        ModelKind::Obj | ModelKind::Ply => "[render]\n",
    }
}

fn model_table(kind: ModelKind, file: &str) -> String {
    format!("[[model]]\n{} = {}\n", kind.key(), quoted(file))
}

/// A TOML string.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => _ = write!(out, "\\u{:04X}", c as u32),
            c => out.push(c),
        }
    }
    out + "\""
}

fn sensor_table(camera: &ModelCamera, index: usize, several: bool) -> String {
    let to_world = camera.transform.at(0.0).to_world;
    let m = to_world.matrix3;
    let list = |v: glam::DVec3| {
        // what rounding left of 0 is 0
        let [x, y, z] = (v * 1e9).round().to_array().map(|x| x / 1e9 + 0.0);
        format!("[{x}, {y}, {z}]")
    };
    let eye = to_world.translation;
    let view = format!(
        "eye = {}, target = {}, up = {}",
        list(eye),
        list(eye - m.z_axis),
        list(m.y_axis)
    );
    let (kind, aspect) = match camera.projection {
        Projection::Perspective { fov_rad, aspect } => (
            format!(
                "perspective = {{ {view}, fov_deg = {} }}",
                fov_rad.to_degrees()
            ),
            aspect,
        ),
        Projection::Orthographic { height, aspect } => (
            format!("orthographic = {{ {view}, height = {height} }}"),
            Some(aspect),
        ),
    };
    let width = aspect.map_or(640.0, |a| (480.0 * a).round().clamp(1.0, 65536.0));
    let name = if several {
        format!("name = \"camera-{index}\"\n")
    } else {
        String::new()
    };
    format!("\n[[sensor]]\n{name}resolution = [{width}, 480]\n{kind}\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::model::Staging;
    use crate::io::model_file::load;
    use crate::io::scene_file::parse_str;
    use crate::light::Light;
    use crate::scene::description::LightDescription;
    use crate::spectrum::Emission;

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a \"b\".obj");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("file");
        let model = load(&path, ModelKind::Obj, &Staging::default()).expect("valid");
        for text in [
            scene_text(&model, ModelKind::Obj, "a \"b\".obj"),
            shortest_scene(ModelKind::Obj, "a \"b\".obj"),
        ] {
            let scene = parse_str(&text, folder.path()).unwrap_or_else(|e| panic!("{e}\n{text}"));
            assert_eq!(scene.description.objects.len(), 1);
            assert_eq!(scene.description.sensors.len(), 1);
            assert_eq!(scene.description.lights.len(), 1);
        }
    }

    /// The text with what stands behind `#` in force, as far as it is no prose.
    fn uncommented(text: &str) -> String {
        let line = |line: &str| {
            let code = line.strip_prefix("# ").filter(|l| {
                l.starts_with("[model.material") || l.starts_with("[[light]]") || l.contains(" = {")
            });
            let name = line.strip_prefix("# ").filter(|l| l.starts_with("name = "));
            code.or(name).unwrap_or(line).to_owned() + "\n"
        };
        text.lines().map(line).collect()
    }

    #[test]
    fn materials_and_lights_can_be_taken_over() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a.obj");
        std::fs::write(
            &path,
            "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a \\ b\nf 1 2 3\n",
        )
        .expect("file");
        let mtl = "newmtl a \\ b\nKd 0.2 0.4 0.6\nKs 0.5 0.5 0.5\nNs 40\n";
        std::fs::write(folder.path().join("a.mtl"), mtl).expect("file");
        let mut model = load(&path, ModelKind::Obj, &Staging::default()).expect("valid");
        let key = Light::point(
            glam::DVec3::new(1.0, 2.0, 3.0),
            Emission::from_rgb([2.0, 1.0, 0.5]),
        );
        model.lights.push(LightDescription {
            name: "key".to_owned(),
            light: key,
        });
        model.lit = true;
        let text = uncommented(&scene_text(&model, ModelKind::Obj, "a.obj"));
        let scene = parse_str(&text, folder.path()).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let scene = scene.description;
        let [light] = &scene.lights[..] else {
            panic!("{text}");
        };
        assert_eq!(light.name, "key");
        let xyz = crate::spectrum::xyz::emission_to_xyz;
        let expected = xyz(&model.lights[0].light.emission);
        for (value, expected) in xyz(&light.light.emission).iter().zip(expected) {
            assert!(
                (value / expected - 1.0).abs() < 2e-3,
                "{value} {expected}\n{text}"
            );
        }
        let material = &scene.materials[scene.objects[0].material.0 as usize];
        assert_eq!(
            material.lobes.len(),
            model.materials[0].lobes.len(),
            "{text}"
        );
    }
}
