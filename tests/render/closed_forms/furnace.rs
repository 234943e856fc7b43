//! Furnaces: in uniform light everything that absorbs nothing is invisible.

use crate::equality::compare;
use crate::harness::{assert_close, line_images, line_mean, measure, scene, test_scale, with};
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path};
use std::f64::consts::PI;

/// Every path has weight 1 at a single wavelength, so every pixel is 1 but for the rounding of the
/// lanes.
#[test]
fn clear_sphere_in_uniform_light_is_invisible() {
    for index in [
        "ior = 1.5",
        "ior = 2.4",
        "glass = \"schott:N-SF11\"\nuse_k = false",
    ] {
        let text = FURNACE
            .replace("INDEX", index)
            .replace("WAVELENGTHS", "{ line_nm = 550 }");
        let (scene, settings) = scene(&text);
        for kind in [Path, Bdpt] {
            for pixel in &line_images(&scene, 0, &with(&settings, kind), 1, 4)[0][0] {
                assert_close(index, *pixel, 1.0, 1e-5);
            }
        }
    }
}

/// The same in white light, where the lanes of a dispersive path die: the mean is kept.
#[test]
fn dispersive_sphere_in_white_light_is_invisible() {
    let (scene, settings) = scene(
        &FURNACE
            .replace("INDEX", "glass = \"schott:N-SF11\"\nuse_k = false")
            .replace("WAVELENGTHS", "\"scene\""),
    );
    for kind in [Path, Bdpt] {
        let measured = measure(&scene, &with(&settings, kind), 32, 4 * test_scale(), &[]);
        measured.y.assert_is("white furnace", 1.0, 2e-3);
    }
}

const FURNACE: &str = r#"
[render]
wavelengths = WAVELENGTHS
[[sensor]]
resolution = [24, 24]
perspective = { eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 34 }
[medium.glass]
INDEX
[material.clear]
dielectric = {}
[[object]]
sphere = { radius = 1 }
material = "clear"
interior = "glass"
[[light]]
environment = { radiance = 1 }
"#;

/// Radiance η² and irradiance πη² inside glass. The sensors stand where no direction is totally
/// reflected, and the detector lets pass what comes back, so that nothing is lost.
#[test]
fn light_is_denser_inside_glass() {
    let (scene, settings) = scene(INSIDE);
    let eta2 = 1.5 * 1.5;
    for kind in [Path, Bdpt] {
        for pixel in &line_images(&scene, 1, &with(&settings, kind), 1, 4)[0][0] {
            assert_close("radiance in glass", *pixel, eta2, 1e-5);
        }
    }
    for pixel in &line_images(&scene, 0, &with(&settings, Path), 1, 4)[0][0] {
        assert_close("irradiance in glass", *pixel, PI * eta2, 1e-5);
    }
    for (kind, passes) in [(Light, 1500), (Bdpt, 60)] {
        let irradiance = line_mean(&scene, 0, &with(&settings, kind), 32, passes * test_scale());
        irradiance.assert_is(&format!("irradiance in glass by {kind:?}"), PI * eta2, 1e-2);
    }
}

const INSIDE: &str = r#"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
name = "meter"
resolution = [4, 4]
detector = { center = [0.3, 0, 0], u = [0.2, 0, 0], v = [0, 0.2, 0], transparent = true }
[[sensor]]
name = "eye"
resolution = [8, 8]
perspective = { eye = [-0.4, 0.1, 0], target = [1, 0, 0.2], fov_deg = 80 }
[medium.glass]
ior = 1.5
[material.clear]
dielectric = {}
[[object]]
sphere = { radius = 1 }
material = "clear"
interior = "glass"
[[light]]
environment = { radiance = 1 }
"#;

/// Inside a closed surface of emission E and reflectance ρ the radiance is E/(1-ρ) everywhere.
#[test]
fn closed_diffuse_furnace() {
    let (scene, settings) = scene(CLOSED);
    for (kind, passes) in [(Path, 8), (Light, 60), (Bdpt, 8)] {
        let radiance = line_mean(&scene, 0, &with(&settings, kind), 32, passes * test_scale());
        radiance.assert_is(
            &format!("diffuse furnace by {kind:?}"),
            0.8 / (1.0 - 0.6),
            7e-3,
        );
    }
}

const CLOSED: &str = r#"
[render]
wavelengths = { line_nm = 550 }
pair_probability = 1
[[sensor]]
resolution = [16, 16]
perspective = { eye = [0.3, 0.2, 0.1], target = [1, 0, 0], fov_deg = 100 }
[material.wall]
diffuse = { reflectance = 0.6 }
[[object]]
sphere = { radius = 1 }
material = "wall"
emission = 0.8
two_sided = true
"#;

/// A rough ball that absorbs nothing is invisible too, to 1 %, whatever finds the light; when light
/// of several facets is lost it is not.
#[test]
fn rough_ball_in_uniform_light_is_invisible() {
    let cases = [
        (
            "conductor = { color = 1, roughness = 1 }",
            "",
            [16, 256, 16],
        ),
        (
            "dielectric = { roughness = 0.6 }",
            "interior = \"glass\"",
            [140, 1000, 200],
        ),
        (
            "coated = { reflectance = 1, roughness = 0.7, ior = 1.8 }",
            "",
            [16, 256, 16],
        ),
    ];
    for (lobe, interior, passes) in cases {
        let text = ROUGH.replace("LOBE", lobe).replace("INTERIOR", interior);
        let (lossless, settings) = scene(&text);
        let radiance = |scene, kind, passes: u32| {
            let radiance = line_mean(scene, 0, &with(&settings, kind), 16, passes * test_scale());
            println!("{lobe} by {kind:?}: {radiance:?}");
            radiance
        };
        let [path, light, bdpt] = [(Path, passes[0]), (Light, passes[1]), (Bdpt, passes[2])]
            .map(|(kind, passes)| radiance(&lossless, kind, passes));
        for found in [path, bdpt] {
            assert!(found.error < 2.5e-3, "{lobe}: {found:?}");
            assert!((found.mean - 1.0).abs() < 0.01, "{lobe}: {found:?}");
        }
        compare(lobe, "path and bdpt", &path, &bdpt, 4e-3);
        compare(lobe, "path and light", &path, &light, 1.5e-2);
        let (losing, _) = scene(&text.replace("material.m]", "material.m]\nmultiscatter = false"));
        let single = radiance(&losing, Path, passes[0]);
        assert!(single.mean < 0.97, "{lobe}: {single:?}");
    }
}

const ROUGH: &str = r#"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [8, 8]
filter = "box"
perspective = { eye = [0, 0, 10], target = [0, 0, 0], fov_deg = 8 }
[medium.glass]
ior = 1.5
[material.m]
LOBE
[[object]]
sphere = { radius = 1 }
material = "m"
INTERIOR
[[light]]
environment = { radiance = 1 }
"#;
