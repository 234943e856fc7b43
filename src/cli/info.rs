//! `abbe info`: what a scene holds, what it calls for and why.

use super::args::InfoOptions;
use super::load::{Loaded, load};
use super::usage::{bytes_text, film_bytes, geometry_bytes, texture_bytes};
use super::{CliError, Outcome, glass, print, stats, summary};
use crate::camera::Camera;
use crate::geometry::Shape;
use crate::light::Light;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Runs the command.
pub fn run(options: &InfoOptions) -> Result<Outcome, CliError> {
    let loaded = load(&options.scene, &options.overrides.set)?;
    for warning in &loaded.warnings {
        eprintln!("warning: {warning}");
    }
    print(&if options.json {
        format!("{:#}\n", to_json(&loaded))
    } else {
        to_text(&loaded)
    });
    Ok(Outcome::Done)
}

fn camera_kind(camera: &Camera) -> &'static str {
    match camera {
        Camera::Perspective(_) => "perspective",
        Camera::Orthographic(_) => "orthographic",
        Camera::Detector(_) => "detector",
    }
}

fn shape_kind(shape: &Shape) -> &'static str {
    match shape {
        Shape::Sphere => "sphere",
        Shape::Disk { .. } => "disk",
        Shape::Quad => "quad",
        Shape::Cylinder => "cylinder",
        Shape::Box => "box",
        Shape::Mesh(_) => "mesh",
    }
}

fn light_kind(light: &Light) -> &'static str {
    match light {
        Light::Area(_) => "area",
        Light::Point(_) => "point",
        Light::Spot(_) => "spot",
        Light::Directional(_) => "directional",
        Light::Beam(_) => "beam",
        Light::Environment(_) => "environment",
    }
}

/// Numbers of objects by kind of shape, detectors left out.
fn shapes(loaded: &Loaded) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    for (instance, object) in loaded
        .scene
        .accel
        .instances()
        .iter()
        .zip(&loaded.scene.objects)
    {
        if object.sensor.is_none() {
            *counts.entry(shape_kind(&instance.shape)).or_default() += 1;
        }
    }
    counts
}

fn triangles(loaded: &Loaded) -> usize {
    let count = |shape: &Shape| {
        if let Shape::Mesh(mesh) = shape {
            mesh.triangle_count()
        } else {
            0
        }
    };
    loaded
        .scene
        .accel
        .instances()
        .iter()
        .map(|i| count(&i.shape))
        .sum()
}

/// Bytes of the XYZ films of all sensors, each in full.
fn films_bytes(loaded: &Loaded) -> u64 {
    let sizes = loaded.scene.sensors.iter().map(|s| s.camera.resolution());
    sizes
        .map(|r| film_bytes(u64::from(r.width) * u64::from(r.height), 3))
        .sum()
}

fn to_text(loaded: &Loaded) -> String {
    let scene = &loaded.scene;
    let mut text = String::from("sensors\n");
    for sensor in &scene.sensors {
        let size = sensor.camera.resolution();
        _ = writeln!(
            text,
            "  {:<13} {}, {} x {} pixels",
            sensor.name,
            camera_kind(&sensor.camera),
            size.width,
            size.height
        );
    }
    text += "objects\n";
    for (kind, count) in shapes(loaded) {
        let triangles = if kind == "mesh" {
            format!(", {} triangles", triangles(loaded))
        } else {
            String::new()
        };
        _ = writeln!(text, "  {kind:<13} {count}{triangles}");
    }
    text += "lights\n";
    for (light, name) in scene.lights.iter().zip(&scene.light_names) {
        let hidden = if light.is_delta() {
            ", only light paths can start there"
        } else {
            ""
        };
        _ = writeln!(text, "  {name:<13} {}{hidden}", light_kind(light));
    }
    text += "media\n";
    for medium in &scene.media {
        let ior = &medium.ior;
        _ = write!(
            text,
            "  {:<13} {}, n_d {}, V_d {}",
            medium.name,
            ior.name(),
            glass::index_d(ior),
            glass::abbe_number(ior)
        );
        let range = ior.fitted_range_nm().map_or_else(String::new, |[a, b]| {
            format!(", fitted over {a:.0}..{b:.0} nm")
        });
        _ = write!(text, "{range}");
        for [a, b] in extrapolated(loaded, ior) {
            _ = write!(text, ", extrapolated over {a:.0}..{b:.0} nm");
        }
        text.push('\n');
    }
    text += &summary::effects(&scene.effects);
    let (films, meshes) = (films_bytes(loaded), geometry_bytes(scene));
    let images = scene.images();
    _ = writeln!(
        text,
        "memory\n  films         {}\n  meshes        {}\n  textures      {}, {} images",
        bytes_text(films),
        bytes_text(meshes),
        bytes_text(texture_bytes(scene)),
        images.len()
    );
    text
}

/// Where the scene's wavelengths leave the data of an index.
fn extrapolated(loaded: &Loaded, ior: &crate::spectrum::Ior) -> Vec<[f64; 2]> {
    ior.validate(loaded.range_nm).unwrap_or_default()
}

fn to_json(loaded: &Loaded) -> Value {
    let scene = &loaded.scene;
    let sensors = scene.sensors.iter().map(|sensor| {
        let size = sensor.camera.resolution();
        json!({ "name": sensor.name, "kind": camera_kind(&sensor.camera), "width": size.width, "height": size.height })
    });
    let lights = scene.lights.iter().zip(&scene.light_names).map(|(light, name)| {
        json!({ "name": name, "kind": light_kind(light), "only_light_paths": light.is_delta() })
    });
    let media = scene.media.iter().map(|medium| {
        let mut value = glass::summary(&medium.ior);
        value["extrapolated_nm"] = json!(extrapolated(loaded, &medium.ior));
        json!({ "name": medium.name, "index": value })
    });
    json!({
        "scene_hash": format!("{:016x}", scene.hash),
        "sensors": sensors.collect::<Vec<_>>(),
        "objects": shapes(loaded),
        "triangles": triangles(loaded),
        "lights": lights.collect::<Vec<_>>(),
        "media": media.collect::<Vec<_>>(),
        "effects": stats::effects_json(loaded),
        "memory_bytes": { "films": films_bytes(loaded), "meshes": geometry_bytes(scene), "textures": texture_bytes(scene) },
    })
}
