//! Lights given by their power, and beams of several fields: all of it arrives where it is aimed.

use crate::harness::{scene, test_scale, with};
use abbe::render::{Flux, OutputRequest, Render};
use abbe::scene::settings::IntegratorKind::{self, Light, Path};
use abbe::spectrum::{SpectralChannels, xyz};
use std::f64::consts::PI;

/// Flux through the only detector.
fn flux(text: &str, integrator: IntegratorKind, passes: u32) -> Flux {
    let (scene, settings) = scene(text);
    let request = OutputRequest {
        spectral: Some(SpectralChannels::new([555.0; 2], 0, vec![555.0])),
        ..OutputRequest::default()
    };
    let crop = scene.sensors[0].whole_film();
    let mut render = Render::new(&scene, 0, &with(&settings, integrator), crop, &request);
    (0..passes * test_scale()).for_each(|pass| render.add_pass(pass));
    render.flux().expect("a detector")
}

const BEAMS: &str = r#"
unit = "mm"
[[sensor]]
resolution = [32, 32]
detector = { center = [0, 0, 0], u = [HALF, 0, 0], v = [0, HALF, 0] }
[[light]]
name = "star"
[light.beam]
position = [0, 0, 300]
direction = [0, 0, -1]
radius = 40
waist = 30
before = 150
fields_deg = FIELDS
irradiance = { lines = [[555, 1]] }
power_w = 2
"#;

/// Two Gaussian beams of 2 W each that cross in the pupil: 4 W arrive, and the one on the axis has
/// 2 P / (π w²) / (1 - exp(-2 R² / w²)) in its middle.
#[test]
fn beams_of_given_power() {
    let text = BEAMS.replace("HALF", "300").replace("FIELDS", "[0, 25]");
    // each light path brings the same: exact but for the rounding of a lane
    let all = flux(&text, Light, 4).lines_w[0].1;
    assert!((all.value / 4.0 - 1.0).abs() < 1e-6, "{all:?}");
    let connected = flux(&text, Path, 64).lines_w[0].1;
    let error = connected.error.expect("both halves");
    assert!(error < 0.02 * 4.0, "{connected:?}");
    assert!((connected.value - 4.0).abs() < 4.5 * error, "{connected:?}");
    let half_mm = 0.1;
    let text = BEAMS.replace("HALF", "0.1").replace("FIELDS", "[0]");
    let middle = flux(&text, Path, 2).lines_w[0].1.value / (2.0 * half_mm * 1e-3_f64).powi(2);
    let peak = 4.0 / (PI * 0.03_f64.powi(2)) / (1.0 - (-2.0 * 16.0 / 9.0_f64).exp());
    // the irradiance falls by 2 r²/w² = 4e-5 at most
    assert!((middle / peak - 1.0).abs() < 4e-5, "{middle} {peak}");
}

/// A lamp of 300 lm aimed at a disk: a detector around the disk has all of it.
#[test]
fn a_point_aimed_at_a_disk() {
    let text = r#"
[[sensor]]
resolution = [16, 16]
detector = { center = [0, 0, 0], u = [0.0501, 0, 0], v = [0, 0.0501, 0] }
[[light]]
[light.spot]
position = [0, 0, 0.8]
aim = { target = [0, 0, 0], radius = 0.05 }
intensity = { lines = [[555, 1]] }
power_lm = 300
"#;
    let found = flux(text, Light, 2).luminous_lm;
    assert!((found.value / 300.0 - 1.0).abs() < 1e-6, "{found:?}");
    // of a square within the disk, the intensity is the same over the cone: the share of the
    // solid angle 4 atan(a²/(d √(2a² + d²))) of a square of half edge a in that of the cone
    let (a, d, radius) = (0.03_f64, 0.8_f64, 0.05_f64);
    let square = 4.0 * (a * a / (d * (2.0 * a * a + d * d).sqrt())).atan();
    let cone = 2.0 * PI * (1.0 - d / d.hypot(radius));
    let part = flux(&text.replace("0.0501", "0.03"), Path, 64).luminous_lm;
    let error = part.error.expect("both halves");
    let expected = 300.0 * square / cone;
    assert!(error < 1e-3 * expected, "{part:?}");
    assert!(
        (part.value - expected).abs() < 4.5 * error,
        "{part:?} {expected}"
    );
}

const PROFILE: &str = r#"
unit = "mm"
[[sensor]]
resolution = [16, 16]
detector = { center = [AT, 0, 0], u = [HALF, 0, 0], v = [0, HALF, 0] }
[[light]]
[light.beam]
position = [0, 0, 300]
direction = [0, 0, -1]
radius = 40
PROFILE
irradiance = { lines = [[555, 1]] }
power_w = 2
"#;

/// A super-Gaussian beam and one by a table bring their power, and it is where the profile says.
#[test]
fn beams_of_any_profile() {
    let flat_top = |r: f64| (-2.0 * (r / 30.0).powi(8)).exp();
    let ring = |r: f64| {
        if r < 20.0 {
            0.2 + 0.8 / 15.0 * (r - 5.0).max(0.0)
        } else {
            1.5 - 0.025 * r
        }
    };
    let cases: [(&str, &dyn Fn(f64) -> f64); 2] = [
        ("waist = 30\norder = 8", &flat_top),
        ("profile = [[0, 0.2], [5, 0.2], [20, 1], [40, 0.5]]", &ring),
    ];
    for (keys, profile) in cases {
        let n = 200_000;
        let ring = |i: u32| {
            let r = 40.0 * (f64::from(i) + 0.5) / f64::from(n);
            2.0 * PI * r * profile(r) * 40.0 / f64::from(n)
        };
        let area_mm2: f64 = (0..n).map(ring).sum();
        let text = |at: &str, half: &str| {
            let text = PROFILE.replace("PROFILE", keys).replace("AT", at);
            text.replace("HALF", half)
        };
        for integrator in [Light, Path] {
            let all = flux(&text("0", "50"), integrator, 64).lines_w[0].1;
            let error = all.error.expect("both halves");
            println!("{keys}, {integrator:?}: {all:?}");
            assert!(error < 0.01 * 2.0, "{all:?}");
            assert!((all.value - 2.0).abs() < 4.5 * error, "{all:?}");
        }
        // rings hold the profile nearly as it is: each light path brings nearly the same
        let all = flux(&text("0", "50"), Light, 64).lines_w[0].1;
        assert!((all.value / 2.0 - 1.0).abs() < 1e-4, "{all:?}");
        for (at, r) in [("0", 0.0), ("20", 20.0), ("29", 29.0)] {
            let here = flux(&text(at, "0.01"), Path, 4).lines_w[0].1.value;
            let expected = 2.0 * profile(r) / area_mm2 * 0.02 * 0.02;
            // over 0.01 mm the steepest profile changes by 1.4e-3 of itself, to both sides alike
            assert!(
                (here / expected - 1.0).abs() < 1e-3,
                "{at}: {here} {expected}"
            );
        }
    }
}

/// A flat band of 2 W has the luminous flux of the observer's mean over it.
#[test]
fn flat_bands_have_the_same_power_per_nanometer() {
    let text = PROFILE
        .replace("PROFILE", "")
        .replace("AT", "0")
        .replace("HALF", "50")
        .replace("{ lines = [[555, 1]] }", "{ band_nm = [601.5, 611.25] }");
    let (scene, settings) = scene(&text);
    let crop = scene.sensors[0].whole_film();
    let request = OutputRequest::default();
    let mut render = Render::new(&scene, 0, &with(&settings, Light), crop, &request);
    (0..64 * test_scale()).for_each(|pass| render.add_pass(pass));
    let found = render.flux().expect("a detector").luminous_lm;
    let n = 1000;
    let y = |i: u32| xyz::cmf(601.5 + 9.75 * (f64::from(i) + 0.5) / f64::from(n))[1];
    let mean = (0..n).map(y).sum::<f64>() / f64::from(n);
    let expected = 2.0 * 683.0 * mean;
    let error = found.error.expect("both halves");
    println!("{found:?} for {expected}");
    assert!(error < 0.01 * expected, "{found:?}");
    assert!(
        (found.value - expected).abs() < 4.5 * error,
        "{found:?} {expected}"
    );
}
