//! Plane mirrors: reflectance, and images behind them.

use crate::harness::{line_mean, measure, scene, test_scale, with};
use abbe::scene::settings::IntegratorKind::{Bdpt, Light};
use std::f64::consts::PI;

/// A beam between parallel mirrors of R = .99 that leaves after 50 reflections: .99^50 = .6050060671.
#[test]
fn fifty_reflections() {
    // 0.1 m forward from mirror to mirror: the 50th hit is at x = 4.95, the detector catches the light half way to the 51st
    let (scene, settings) = scene(FIFTY);
    let flux = 0.06 * 0.06 / (PI * 1e-4);
    let measured = line_mean(&scene, 0, &settings, 32, 4 * test_scale()).scaled(flux);
    measured.assert_is("50 mirrors", 0.605_006_067_1, 2.6e-3);
    // all of it took 50 reflections
    let measured = measure(&scene, &settings, 2, 1, &["LS{50}E"]);
    assert!(measured.y.mean > 0.0);
    assert_eq!(measured.classes[0].mean, measured.y.mean);
}

const FIFTY: &str = r#"
[render]
integrator = "light"
wavelengths = { line_nm = 587.5618 }
[[sensor]]
resolution = [32, 32]
detector = { center = [5, 0.5, 0], u = [0, 0, 0.03], v = [0.03, 0, 0] }
[material.silver]
mirror = { reflectance = 0.99 }
[[object]]
quad = { center = [2.5, 0, 0], u = [2.5, 0, 0], v = [0, 0, 1] }
material = "silver"
[[object]]
quad = { center = [2.5, 1, 0], u = [2.5, 0, 0], v = [0, 0, 1] }
material = "silver"
[[light]]
beam = { position = [0, 0.5, 0], direction = [0.1, -1, 0], radius = 0.01, irradiance = 1 }
"#;

/// Point light I, mirror R, detector: E = R I cosθ'/d'² with the light's mirror image.
#[test]
fn point_light_in_a_mirror() {
    let (scene, settings) = scene(POINT);
    // the image of (0, 1, -1.2) in y = 0 is (0, -1, -1.2); the detector is the square of half edge h in the plane z = 0
    let h = 0.4;
    let n = 200;
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let x = h * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
            let y = 1.0 + h * (2.0 * (f64::from(j) + 0.5) / f64::from(n) - 1.0);
            let d2 = x * x + (y + 1.0) * (y + 1.0) + 1.2 * 1.2;
            sum += 0.7 * 3.0 * 1.2 / (d2 * d2.sqrt());
        }
    }
    let expected = sum / f64::from(n * n);
    for (kind, passes) in [(Light, 60), (Bdpt, 60)] {
        let measured = line_mean(&scene, 0, &with(&settings, kind), 32, passes * test_scale());
        measured.assert_is(&format!("mirrored point light by {kind:?}"), expected, 1.5e-2);
    }
}

const POINT: &str = r#"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [32, 32]
detector = { center = [0, 1, 0], u = [-0.4, 0, 0], v = [0, 0.4, 0] }
[material.silver]
mirror = { reflectance = 0.7 }
[[object]]
quad = { center = [0, 0, 0], u = [0, 0, 5], v = [5, 0, 0] }
material = "silver"
[[object]]
disk = { center = [0, 1, -0.6], normal = [0, 0, 1], radius = 0.45 }
[[light]]
point = { position = [0, 1, -1.2], intensity = 3 }
"#;
