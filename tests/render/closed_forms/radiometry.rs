//! Irradiance under a disc, directly and in a mirror.

use crate::harness::{Y_OF_555_NM, line_mean, measure, scene, test_scale, with};
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path};
use std::f64::consts::PI;

/// Irradiance of a uniform disc of radius `a` and radiance 1 on the parallel plane at distance `h`,
/// at `rho` from the axis (Walsh 1926); on the axis it is π a²/(a² + h²).
fn under_disc(a: f64, h: f64, rho: f64) -> f64 {
    let (a2, h2, rho2) = (a * a, h * h, rho * rho);
    let sum = h2 + rho2 + a2;
    0.5 * PI * (1.0 - (h2 + rho2 - a2) / (sum * sum - 4.0 * a2 * rho2).sqrt())
}

/// Mean over a square of half edge `half` about the axis.
fn under_disc_on_square(a: f64, h: f64, half: f64) -> f64 {
    let n = 200;
    let at = |i: u32| half * (f64::from(i) + 0.5) / f64::from(n);
    let sum: f64 = (0..n * n)
        .map(|k| under_disc(a, h, at(k / n).hypot(at(k % n))))
        .sum();
    sum / f64::from(n * n)
}

#[test]
fn disc_light() {
    assert!((under_disc(0.5, 2.0, 0.0) - PI * 0.25 / 4.25).abs() < 1e-15);
    // on the axis
    let (tiny, settings) = scene(&DISC.replace("HALF", "0.001"));
    for kind in [Path, Bdpt] {
        let measured = line_mean(&tiny, 0, &with(&settings, kind), 32, 16 * test_scale());
        measured.assert_is(
            &format!("disc on the axis by {kind:?}"),
            PI * 0.25 / 4.25,
            1e-3,
        );
    }
    // over a square large enough for light paths to find
    let (wide, settings) = scene(&DISC.replace("HALF", "0.6"));
    let expected = under_disc_on_square(0.5, 2.0, 0.6);
    for (kind, passes) in [(Path, 16), (Light, 100), (Bdpt, 16)] {
        let measured = line_mean(&wide, 0, &with(&settings, kind), 32, passes * test_scale());
        measured.assert_is(&format!("disc over a square by {kind:?}"), expected, 4e-3);
    }
}

const DISC: &str = r#"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [16, 16]
detector = { center = [0, 0, 0], u = [HALF, 0, 0], v = [0, HALF, 0] }
[[object]]
disk = { center = [0, 0, 2], normal = [0, 0, -1], radius = 0.5 }
emission = 1
"#;

/// The same light around a corner: a mirror of R = .9 at 45°, with the disc 1 m after it and the
/// detector 1 m before it.
#[test]
fn disc_light_in_a_mirror() {
    let (scene, settings) = scene(MIRRORED);
    let expected = 0.9 * under_disc_on_square(0.5, 2.0, 0.2);
    for (kind, passes) in [(Path, 30), (Light, 120), (Bdpt, 30)] {
        let measured = measure(
            &scene,
            &with(&settings, kind),
            32,
            passes * test_scale(),
            &["LSE"],
        );
        measured.classes[0].scaled(1.0 / Y_OF_555_NM).assert_is(
            &format!("disc in a mirror by {kind:?}"),
            expected,
            1.5e-2,
        );
    }
}

const MIRRORED: &str = r#"
[render]
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [16, 16]
detector = { center = [0, 0, 0], u = [0.2, 0, 0], v = [0, 0.2, 0] }
[material.silver]
mirror = { reflectance = 0.9 }
[[object]]
quad = { center = [0, 0, 1], u = [1.2, 0, 1.2], v = [0, 1.5, 0] }
material = "silver"
[[object]]
disk = { center = [1, 0, 1], normal = [-1, 0, 0], radius = 0.5 }
emission = 1
"#;
