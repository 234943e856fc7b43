//! Scenes at the limits of what arithmetic and sampling bear.
//!
//! Part of the test group `hard_cases`, whose table is in `docs/validation.md`.

use crate::harness::{full_crop, line_mean, scene, test_scale, with};
use abbe::film::Rejected;
use abbe::render::{OutputRequest, Render};
use abbe::scene::Scene;
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path};
use abbe::scene::settings::{Regularize, Settings};
use std::sync::Arc;

/// Renders a few passes: every value must be finite and not negative, and nothing may have been
/// left out. The mean of Y.
fn sane(what: &str, scene: &Arc<Scene>, settings: &Settings, passes: u32) -> f64 {
    let request = OutputRequest::default();
    let mut render = Render::new(scene, 0, settings, full_crop(scene), &request);
    (0..passes).for_each(|pass| render.add_pass(pass));
    let film = &render.outputs().image;
    assert_eq!(render.counters().non_finite, 0, "{what}: not finite");
    assert_eq!(render.counters().nesting_overflows, 0, "{what}");
    assert_eq!(render.counters().medium_mismatches, 0, "{what}");
    assert_eq!(film.rejected(), Rejected::default(), "{what}");
    let image = film.image(u64::from(passes));
    let bad = image.iter().filter(|v| !v.is_finite()).count();
    assert_eq!(bad, 0, "{what}: pixels that are not finite");
    image.iter().skip(1).step_by(3).sum::<f64>() * 3.0 / image.len() as f64
}

/// Cones of every size between nothing and a half space, in both modes: nothing is infinite or not
/// a number.
#[test]
fn cones_of_any_size_are_finite() {
    let (scene, settings) = scene(BALLS);
    for epsilon in [1e-8, 1e-6, 1e-4, 1e-2, 0.5, std::f64::consts::FRAC_PI_2] {
        for mode in [Regularize::Mis, Regularize::Single] {
            let mut settings = with(&settings, Bdpt);
            settings.regularization.mode = mode;
            settings.regularization.epsilon = Some(epsilon);
            let mean = sane(
                &format!("{mode:?}, epsilon {epsilon}"),
                &scene,
                &settings,
                6,
            );
            assert!(mean > 0.0, "{mode:?}, epsilon {epsilon}: black");
        }
    }
}

/// Glass around a point light, glass that touches glass, a mirror, a rough ball: every kind of end
/// of a connection.
const BALLS: &str = r#"
[[sensor]]
resolution = [16, 12]
perspective = { eye = [0, 1, 4], target = [0, 0.3, 0], fov_deg = 45 }
[medium.flint]
glass = "schott:N-SF11"
[material.white]
diffuse = { reflectance = 0.7 }
[material.clear]
dielectric = {}
[material.frost]
dielectric = { roughness = 0.1 }
[material.silver]
mirror = { reflectance = 0.9 }
[[object]]
quad = { center = [0, -0.5, 0], u = [0, 0, 3], v = [3, 0, 0] }
material = "white"
[[object]]
quad = { center = [0, 0, -2], u = [3, 0, 0], v = [0, 3, 0] }
material = "silver"
[[object]]
sphere = { center = [-0.5, 0, 0], radius = 0.5 }
material = "clear"
interior = "flint"
[[object]]
sphere = { center = [0.5, 0, 0], radius = 0.5 }
material = "clear"
interior = "flint"
[[object]]
sphere = { center = [0, 1.2, 0], radius = 0.4 }
material = "frost"
interior = "flint"
[[object]]
disk = { center = [1, 2.5, 1], normal = [0, -1, 0], radius = 0.2 }
emission = 20
[[light]]
point = { position = [-0.5, 0, 0], intensity = 1 }
"#;

/// A light of constant power that shrinks becomes a point light: E = P / (π h²) beneath a
/// Lambertian one.
#[test]
fn a_tiny_light_of_constant_power_is_a_point() {
    for radius in [1e-1, 1e-3, 1e-6, 1e-9_f64] {
        let radiance = 1.0 / (std::f64::consts::PI * radius * radius);
        let text = SHRINKING
            .replace("RADIUS", &format!("{radius:e}"))
            .replace("RADIANCE", &format!("{radiance:e}"));
        let (scene, settings) = scene(&text);
        for kind in [Path, Bdpt] {
            let settings = with(&settings, kind);
            let measured = line_mean(&scene, 0, &settings, 16, 4 * test_scale());
            // π L a² / (a² + h²), over a square of 2 mm
            let expected = 1.0 / (radius * radius + 4.0);
            let what = format!("light of radius {radius} by {kind:?}");
            assert!(
                (measured.mean / expected - 1.0).abs() < 1e-5 + 4.5 * measured.error / expected,
                "{what}: {measured:?}, expected {expected}"
            );
            assert!(measured.error < 1e-3 * expected, "{what}: {measured:?}");
            sane(&what, &scene, &settings, 2);
        }
    }
}

const SHRINKING: &str = r#"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [8, 8]
detector = { center = [0, 0, 0], u = [0.001, 0, 0], v = [0, 0.001, 0] }
[[object]]
disk = { center = [0, 0, 2], normal = [0, 0, -1], radius = RADIUS }
emission = RADIANCE
"#;

/// Two slabs that overlap or touch are one; apart, even by 1e-7 m, they are two with air between
/// them. Nothing is infinite, and no ray goes on forever.
#[test]
fn surfaces_at_no_distance() {
    // (1 - R) / (1 + (2m - 1) R) of m slabs with R = 0.04 per face
    let (one, two) = (0.96 / 1.04, 0.96 / 1.12);
    let mean = |second: &str, kind| {
        let (scene, settings) = scene(&SLABS.replace("SECOND", second));
        let settings = with(&settings, kind);
        sane(second, &scene, &settings, 100 * test_scale())
    };
    let apart = mean("1.1", Light);
    for (second, expected) in [
        ("0.9", one),
        ("1.0", one),
        ("1.0000000000000002", one),
        ("1.0000001", two),
    ] {
        for kind in [Light, Bdpt] {
            let through = two * mean(second, kind) / apart;
            println!("second slab at {second}: {through}");
            // of 20 000 paths that meet the detector, each passes or not: 4.5 standard errors of
            // 0.0025 each, of both images
            assert!(
                (through - expected).abs() < 0.016,
                "second slab at {second} by {kind:?}: {through}, expected {expected}"
            );
        }
    }
}

const SLABS: &str = r#"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [16, 16]
detector = { center = [0, 0, 3], u = [-2, 0, 0], v = [0, 2, 0] }
[medium.a]
ior = 1.5
[medium.b]
ior = 1.5
[material.clear]
dielectric = {}
[[object]]
box = { min = [-3, -3, 0.5], max = [3, 3, 1.0] }
material = "clear"
interior = "a"
[[object]]
box = { min = [-3, -3, SECOND], max = [3, 3, 2] }
material = "clear"
interior = "b"
[[light]]
beam = { position = [0, 0, -4], direction = [0, 0, 1], radius = 1, irradiance = 1 }
"#;

/// Lobes whose probability is exactly 0: no 0/0.
#[test]
fn lobes_that_do_nothing() {
    for material in [
        "mirror = { reflectance = 0 }",
        "dielectric = { reflect_tint = 0 }",
        "dielectric = { transmit_tint = 0 }",
        "dielectric = { reflect_tint = 0, transmit_tint = 0 }",
        "diffuse = { reflectance = 0 }",
        "thin = { ior = 1 }",
        "mix = [{ weight = 0, diffuse = { reflectance = 1 } }, { weight = 1, mirror = { reflectance = 0 } }]",
    ] {
        for index in ["ior = 1", "ior = 1.5"] {
            let solid = material.starts_with("dielectric");
            let text = NOTHING
                .replace("MATERIAL", material)
                .replace("INDEX", index)
                .replace("INTERIOR", if solid { "interior = \"some\"" } else { "" });
            let (scene, settings) = scene(&text);
            for mode in [Regularize::Off, Regularize::Mis] {
                let mut settings = with(&settings, Bdpt);
                settings.regularization.mode = mode;
                let mean = sane(
                    &format!("{material}, {index}, {mode:?}"),
                    &scene,
                    &settings,
                    4,
                );
                assert!(mean > 0.0, "{material}: the floor is lit");
            }
        }
    }
}

const NOTHING: &str = r#"
[[sensor]]
resolution = [12, 9]
perspective = { eye = [0, 1, 4], target = [0, 0, 0], fov_deg = 45 }
[medium.some]
INDEX
[material.white]
diffuse = { reflectance = 0.7 }
[material.odd]
MATERIAL
[[object]]
quad = { center = [0, -0.6, 0], u = [0, 0, 3], v = [3, 0, 0] }
material = "white"
[[object]]
sphere = { radius = 0.5 }
material = "odd"
INTERIOR
[[object]]
disk = { center = [0, 2, 0], normal = [0, -1, 0], radius = 0.3 }
emission = 5
"#;
