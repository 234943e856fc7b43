//! Models and textures: texels land where they should, and all strategies see the same textured,
//! bent, half-open, transmissive surfaces.

use super::gltf::Builder;
use super::harness::{Estimate, full_crop, measure, scene_in, test_scale, with};
use abbe::render::{OutputRequest, Render};
use abbe::scene::settings::{IntegratorKind, Regularization, Regularize};
use abbe::scene::{Scene, Settings};
use abbe::spectrum::xyz::xyz_to_linear_srgb;
use serde_json::json;
use std::path::Path;
use std::sync::Arc;

/// Linear sRGB of every pixel after some passes.
fn picture(scene: &Arc<Scene>, settings: &Settings, passes: u32) -> Vec<[f64; 3]> {
    let mut render = Render::new(
        scene,
        0,
        settings,
        full_crop(scene),
        &OutputRequest::default(),
    );
    for pass in 0..passes {
        render.add_pass(pass);
    }
    let xyz = render.outputs().image.image(u64::from(passes));
    xyz.as_chunks::<3>()
        .0
        .iter()
        .map(|p| xyz_to_linear_srgb(*p))
        .collect()
}

/// 2 x 2: red, green above blue, white.
const TEXELS: [[u8; 4]; 4] = [
    [255, 0, 0, 255],
    [0, 255, 0, 255],
    [0, 0, 255, 255],
    [255; 4],
];
const COLORS: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];

fn assert_texels(what: &str, pixels: &[[f64; 3]], white: f64) {
    for (i, (pixel, want)) in pixels.iter().zip(COLORS).enumerate() {
        for c in 0..3 {
            let got = pixel[c] / white;
            // 400 samples of four wavelengths: below 2 % of white
            assert!((got - want[c]).abs() < 0.05, "{what}, pixel {i}: {pixel:?}");
        }
    }
}

#[test]
fn a_known_texel_lands_on_the_known_pixel() {
    let folder = tempfile::tempdir().expect("folder");
    let mut b = Builder::default();
    let texture = b.texture(2, 2, &TEXELS, true);
    let black = b.material(json!({
        "emissiveTexture": { "index": texture },
        "emissiveFactor": [1, 1, 1],
        "pbrMetallicRoughness": { "baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0 },
        "extensions": { "KHR_materials_specular": { "specularFactor": 0 } },
    }));
    b.quad([-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], black);
    b.root.insert("cameras".into(), json!([{ "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 9 } }]));
    b.node(json!({ "camera": 0, "translation": [0, 0, 2] }));
    std::fs::write(folder.path().join("m.glb"), b.glb()).expect("file");
    let mut encoder = png::Encoder::new(
        std::fs::File::create(folder.path().join("t.png")).expect("file"),
        2,
        2,
    );
    encoder.set_color(png::ColorType::Rgba);
    encoder
        .write_header()
        .expect("header")
        .write_image_data(TEXELS.as_flattened())
        .expect("data");

    let render = "[render]\nintegrator = \"path\"\nfilter = \"box\"\n";
    let dark = "[[light]]\npoint = { position = [0, 0, 9], intensity = 1e-12 }\n";
    let model = format!(
        "{render}units = \"photometric\"\n[[model]]\ngltf = \"m.glb\"\nresolution = [2, 2]\n{dark}"
    );
    let (scene, settings) = scene_in(folder.path(), &model);
    // an emissive factor of 1 is one candela per square meter
    let nit = abbe::io::gltf::PER_NIT;
    assert_texels("glTF", &picture(&scene, &settings, 400), nit);

    let sensor = "[[sensor]]\nresolution = [2, 2]\northographic = { eye = [0, 0, 2], target = [0, 0, 0], height = 2 }\n";
    let surface = |texture: &str| {
        format!(
            "{render}{sensor}[[object]]\nquad = {{ center = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }}\nemission = {{ texture = {texture} }}\n"
        )
    };
    let nearest = surface("{ file = \"t.png\", filter = \"nearest\" }");
    let (scene, settings) = scene_in(folder.path(), &nearest);
    assert_texels("scene file", &picture(&scene, &settings, 400), 1.0);
    // a quarter turn carries the upper left texel to another corner, four of them back
    let turned = surface(
        "{ file = \"t.png\", filter = \"nearest\", rotate_deg = 360, scale = [2, 2], offset = [-0.5, -0.5], wrap = \"clamp\" }",
    );
    let (scene, settings) = scene_in(folder.path(), &turned);
    assert_texels("scaled", &picture(&scene, &settings, 400), 1.0);
}

/// A room's worth of everything: texture, bent normals, a half-open sheet, a lamp with a pattern, a
/// tinted solid of glass.
fn everything(roughness: f64) -> Vec<u8> {
    let mut b = Builder::default();
    let checks = b.texture(
        2,
        2,
        &[
            [230, 120, 60, 255],
            [60, 160, 220, 255],
            [200; 4],
            [90, 200, 90, 255],
        ],
        false,
    );
    let bumps = b.texture(
        2,
        2,
        &[
            [170, 128, 230, 255],
            [90, 150, 230, 255],
            [128, 80, 230, 255],
            [128, 128, 255, 255],
        ],
        false,
    );
    let open = b.texture(2, 1, &[[200, 200, 200, 60], [200, 200, 200, 220]], false);
    let stripes = b.texture(2, 1, &[[255, 220, 180, 255], [60, 80, 255, 255]], false);
    let floor = b.material(json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": checks }, "metallicFactor": 0.25, "roughnessFactor": 0.7 },
        "normalTexture": { "index": bumps },
    }));
    let sheet = b.material(json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": open }, "metallicFactor": 0 , "roughnessFactor": 0.8 },
        "alphaMode": "BLEND", "doubleSided": true,
    }));
    let lamp = b.material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0 },
        "emissiveTexture": { "index": stripes }, "emissiveFactor": [1, 1, 1],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 5e5 } },
    }));
    let glass = b.material(json!({
        "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": roughness },
        "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": 1 },
            "KHR_materials_ior": { "ior": 1.4 },
            "KHR_materials_volume": { "thicknessFactor": 1, "attenuationColor": [0.5, 0.8, 0.9], "attenuationDistance": 0.5 },
        },
    }));
    b.quad([-1.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, -2.0], floor);
    b.quad([-1.0, 0.0, -0.9], [2.0, 0.0, 0.0], [0.0, 1.5, 0.0], floor);
    b.quad([-0.7, 1.0, 0.5], [1.4, 0.0, 0.0], [0.0, 0.0, -1.4], sheet);
    b.quad([-0.5, 1.8, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], lamp);
    b.cube([-0.35, 0.1, -0.45], [0.35, 0.55, 0.15], glass);
    b.root.insert("cameras".into(), json!([{ "type": "perspective", "perspective": { "yfov": 0.7, "aspectRatio": 1.333_333, "znear": 0.1 } }]));
    b.node(json!({ "camera": 0, "translation": [0, 1.2, 3], "rotation": [-0.15, 0, 0, 0.9887] }));
    b.glb()
}

fn room(folder: &Path, roughness: f64) -> (Arc<Scene>, Settings) {
    std::fs::write(folder.join("room.glb"), everything(roughness)).expect("file");
    let text = "[render]\nmax_depth = 6\nfilter = \"box\"\npair_probability = 1\n[[model]]\ngltf = \"room.glb\"\nresolution = [16, 12]\n\
                [[light]]\nenvironment = { radiance = 0.05 }\n";
    scene_in(folder, text)
}

fn agree(what: &str, a: &Estimate, b: &Estimate, resolution: f64) {
    let error = a.error.hypot(b.error);
    println!(
        "{what}: {:.5e} and {:.5e}, standard error {:.1e} of the mean",
        a.mean,
        b.mean,
        error / a.mean
    );
    assert!(
        error <= resolution * a.mean,
        "{what}: {a:?} {b:?} do not resolve {resolution}"
    );
    assert!((a.mean - b.mean).abs() < 4.5 * error, "{what}: {a:?} {b:?}");
}

#[test]
fn path_is_bdpt_on_a_textured_bent_and_transmissive_model() {
    let folder = tempfile::tempdir().expect("folder");
    let (scene, settings) = room(folder.path(), 0.5);
    assert!(scene.has_coverage && scene.materials.iter().any(|m| m.normal.is_some()));
    assert_eq!(scene.media.len(), 2);
    let off = Settings {
        regularization: Regularization {
            mode: Regularize::Off,
            ..settings.regularization
        },
        ..settings
    };
    let n = test_scale();
    let path = measure(
        &scene,
        &with(&off, IntegratorKind::Path),
        24,
        60 * n,
        &["LDE", "LDDE"],
    );
    let bdpt = measure(
        &scene,
        &with(&off, IntegratorKind::Bdpt),
        24,
        30 * n,
        &["LDE", "LDDE"],
    );
    let light = measure(
        &scene,
        &with(&off, IntegratorKind::Light),
        24,
        60 * n,
        &["LDE", "LDDE"],
    );
    agree("path, bdpt", &path.y, &bdpt.y, 0.004);
    for (i, class) in ["LDE", "LDDE"].iter().enumerate() {
        agree(class, &path.classes[i], &bdpt.classes[i], 0.02);
        agree(class, &light.classes[i], &bdpt.classes[i], 0.03);
    }
}

#[test]
fn regularized_smooth_glass_of_a_model_agrees_with_path() {
    let folder = tempfile::tempdir().expect("folder");
    let (scene, settings) = room(folder.path(), 0.0);
    let n = test_scale();
    let path = measure(
        &scene,
        &with(&settings, IntegratorKind::Path),
        24,
        60 * n,
        &["LDE"],
    );
    let regularized = Settings {
        regularization: Regularization {
            mode: Regularize::Mis,
            epsilon: Some(0.01),
            epsilon_min: 0.01,
            ..settings.regularization
        },
        ..settings
    };
    let bdpt = measure(
        &scene,
        &with(&regularized, IntegratorKind::Bdpt),
        24,
        30 * n,
        &["LDE"],
    );
    agree("path, regularized bdpt", &path.y, &bdpt.y, 0.006);
    agree("LDE", &path.classes[0], &bdpt.classes[0], 0.02);
}
