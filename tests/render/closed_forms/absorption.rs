//! Beer and Lambert: what a medium leaves of light.

use crate::harness::{assert_close, line_images, line_mean, scene};
use abbe::io::scene_file::parse_str;
use abbe::scene::Scene;
use std::f64::consts::PI;

/// A beam through 4 mm of an absorbing medium of index 1: no reflection, so no noise.
#[test]
fn slab_of_index_one() {
    let cases = [
        ("color = 0.5, distance = 4", 0.5),
        ("color = 0.5, distance = 10", 0.5_f64.powf(0.4)),
        ("coefficient = 250", (-1.0_f64).exp()),
        ("color = 1, distance = 1", 1.0),
    ];
    for (absorption, expected) in cases {
        let medium = format!("ior = 1\nabsorption = {{ {absorption} }}");
        let (beam, settings) = scene(&BEAM.replace("MEDIUM", &medium));
        let flux = line_mean(&beam, 0, &settings, 2, 4).scaled(16.0 / PI);
        assert_close(&format!("beam, {absorption}"), flux.mean, expected, 1e-6);
        // an image of a lamp through the slab
        let (lamp, settings) = scene(&LAMP.replace("MEDIUM", &medium));
        for pixel in &line_images(&lamp, 0, &settings, 1, 2)[0][0] {
            assert_close(&format!("image, {absorption}"), *pixel, expected, 1e-5);
        }
    }
}

/// α = 4πk/λ from a table of n and k.
#[test]
fn extinction_of_a_table() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("dye.csv"), "nm,n,k\n400,1,1e-5\n500,1,2e-5\n600,1,4e-5\n").unwrap();
    let alpha = 4.0 * PI * 3e-5 / 550e-9;
    for (use_k, expected) in [("true", (-alpha * 4e-3).exp()), ("false", 1.0)] {
        let text = BEAM.replace("MEDIUM", &format!("file = \"dye.csv\"\nuse_k = {use_k}"));
        let loaded = parse_str(&text, folder.path()).unwrap_or_else(|e| panic!("{e}"));
        let scene = Scene::build(loaded.description).unwrap();
        let beam = line_mean(&scene, 0, &loaded.settings, 2, 4).scaled(16.0 / PI);
        assert_close("beam through a table's k", beam.mean, expected, 1e-6);
    }
}

const BEAM: &str = r#"
unit = "mm"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [32, 32]
detector = { center = [0, 0, 8], u = [-2, 0, 0], v = [0, 2, 0] }
[medium.dye]
MEDIUM
[material.clear]
dielectric = {}
[[object]]
box = { min = [-20, -20, -2], max = [20, 20, 2] }
material = "clear"
interior = "dye"
[[light]]
beam = { position = [0, 0, -8], direction = [0, 0, 1], radius = 1, irradiance = 1 }
"#;

const LAMP: &str = r#"
unit = "mm"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [8, 8]
orthographic = { eye = [0, 0, 8], target = [0, 0, 0], height = 2 }
[medium.dye]
MEDIUM
[material.clear]
dielectric = {}
[[object]]
box = { min = [-20, -20, -2], max = [20, 20, 2] }
material = "clear"
interior = "dye"
[[object]]
quad = { center = [0, 0, -6], u = [3, 0, 0], v = [0, 3, 0] }
emission = 1
"#;
