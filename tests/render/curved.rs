//! Bent detectors: irradiance and flux of a point in the center, integrators against each other.

use crate::harness::{measure, scene, with};
use abbe::io::exr::MetadataValue;
use abbe::io::image;
use abbe::render::{OutputRequest, Render};
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path};
use abbe::spectrum::SpectralChannels;

/// A point in the center of a sphere of 20 mm lights all of a detector on it alike, I/R², and by
/// the solid angle of the detector.
#[test]
fn a_sphere_about_a_point_is_lit_evenly() {
    let text = r#"
unit = "mm"
[[sensor]]
resolution = [24, 16]
detector = { center = [3, -2, -20], u = [12, 0, 0], v = [0, 8, 0], radius = 20 }
[[light]]
point = { position = [3, -2, 0], intensity = { lines = [[555, 1]] } }
"#;
    let (scene, settings) = scene(text);
    let request = OutputRequest {
        spectral: Some(SpectralChannels::new([555.0; 2], 0, vec![555.0])),
        ..OutputRequest::default()
    };
    let crop = scene.sensors[0].whole_film();
    let radius = 0.02_f64;
    // of a sphere over a rectangle, by strips
    let n = 100_000;
    let strip = |i: i32| {
        let x = 0.6 * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
        2.0 * (0.4 / (1.0 - x * x).sqrt()).asin()
    };
    let solid_angle = 1.2 / f64::from(n) * (0..n).map(strip).sum::<f64>();
    let seen = |integrator, passes| {
        let mut render = Render::new(&scene, 0, &with(&settings, integrator), crop, &request);
        (0..passes).for_each(|pass| render.add_pass(pass));
        let flux = render.flux().expect("a detector").lines_w[0].1;
        let values = &render.outputs().spectral.as_ref().expect("is kept").1;
        let told = image::spectral_of(&render, false).expect("is kept");
        let told = told.metadata.get("flux:555nm").cloned();
        (flux, values.image(u64::from(passes)), told)
    };
    // each pixel sees the point, without noise but for the place in it
    let (flux, values, told) = seen(Path, 2);
    let expected = 1.0 / (radius * radius);
    for value in &values {
        assert!((value / expected - 1.0).abs() < 1e-6, "{value} {expected}");
    }
    assert!(
        (flux.value / solid_angle - 1.0).abs() < 1e-5,
        "{flux:?} {solid_angle}"
    );
    // the image tells what the render does
    let Some(MetadataValue::Text(told)) = told else {
        panic!("no flux");
    };
    let told: f64 = told
        .split(' ')
        .next()
        .and_then(|n| n.parse().ok())
        .expect("a number");
    assert!((told / flux.value - 1.0).abs() < 1e-12, "{told} {flux:?}");
    // one of 24 paths arrives
    let (flux, ..) = seen(Light, 256);
    let error = flux.error.expect("both halves");
    assert!(error < 0.03 * solid_angle, "{flux:?}");
    assert!(
        (flux.value - solid_angle).abs() < 4.5 * error,
        "{flux:?} {solid_angle}"
    );
}

const LAMP: &str = r#"
unit = "mm"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [8, 8]
detector = { center = [1, 0, 10], u = [-6, 0, 0], v = [0, 5, 0], RADIUS }
[[object]]
sphere = { center = [0, 0, 4], radius = 1.5 }
material = "white"
[material.white]
diffuse = { reflectance = 0.8 }
[[object]]
disk = { center = [0, 0, -2], normal = [0, 0, 1], radius = 3 }
emission = { value = 1 }
"#;

/// Hollow, bulging and bent one way, before a lamp and a ball: from the lamp, from the detector and
/// by both the same.
#[test]
fn integrators_agree_on_bent_detectors() {
    for radius in ["radius = 9", "radius = [-12, -9]", "radius = [0, 8.5]"] {
        let (scene, settings) = scene(&LAMP.replace("RADIUS", radius));
        let of =
            |integrator, passes| measure(&scene, &with(&settings, integrator), 16, passes, &[]).y;
        let path = of(Path, 32);
        assert!(path.error < 0.01 * path.mean, "{radius}: {path:?}");
        for (integrator, passes) in [(Light, 128), (Bdpt, 32)] {
            let other = of(integrator, passes);
            println!("{radius}: path {path:?}, {integrator:?} {other:?}");
            assert!(other.error < 0.01 * other.mean, "{radius}: {other:?}");
            assert!(path.deviation(&other) < 4.5, "{radius}: {path:?} {other:?}");
        }
    }
}
