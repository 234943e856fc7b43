//! A scene has no size: with all lengths, intensities and absorption scaled together the image is
//! the same. (The absorption that a catalogue states for its glasses is left out: it has a length
//! of its own.)
//!
//! A power of two changes no rounding, so it must leave every bit; other factors change only
//! rounding.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking"
)]

use super::harness::full_crop;
use abbe::film::Film;
use abbe::io::scene_file::parse_str;
use abbe::io::{image, part};
use abbe::render::{OutputRequest, Render, Session, SessionOptions};
use abbe::scene::settings::Aiming;
use abbe::scene::{Scene, Settings};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

const PASSES: u32 = 4;

/// A scene with dispersive absorbing glass, a mesh, an area light and a point light, all lengths
/// times `k`.
fn text(sensor: Sensor, k: f64) -> String {
    let v = |x: f64, y: f64, z: f64| format!("[{:e}, {:e}, {:e}]", x * k, y * k, z * k);
    let mut out = String::from("[render]\nmax_depth = 6\n[[sensor]]\nresolution = [20, 16]\n");
    let (eye, target) = (v(0.0, 1.5, 4.0), v(0.0, 0.6, 0.0));
    match sensor {
        Sensor::Lens => writeln!(
            out,
            "perspective = {{ eye = {eye}, target = {target}, fov_deg = 45, aperture_radius = {:e}, focus_distance = {:e} }}",
            0.125 * k,
            4.0 * k
        ),
        Sensor::Orthographic => {
            writeln!(out, "orthographic = {{ eye = {eye}, target = {target}, height = {:e} }}", 3.0 * k)
        }
        Sensor::Detector => writeln!(
            out,
            "detector = {{ center = {}, u = {}, v = {}, transparent = true }}",
            v(0.1, 0.02, 0.2),
            v(1.0, 0.0, 0.0),
            v(0.0, 0.0, -0.8)
        ),
    }
    .unwrap();
    write!(
        out,
        r#"
[medium.flint]
glass = "schott:N-SF11"
use_k = false
absorption = {{ coefficient = {:e} }}
[medium.amber]
ior = 1.5
absorption = {{ color = [0.9, 0.5, 0.2], distance = {:e} }}
[material.white]
diffuse = {{ reflectance = 0.7 }}
[material.clear]
dielectric = {{}}
[material.frost]
dielectric = {{ roughness = 0.2 }}
[[object]]
quad = {{ center = [0, 0, 0], u = {}, v = {} }}
material = "white"
[[object]]
sphere = {{ center = {}, radius = {:e} }}
material = "clear"
interior = "flint"
[[object]]
mesh = {{ obj = "assets/brilliant.obj" }}
transform = [{{ scale = {:e} }}, {{ rotate = {{ axis = [0.3, 1, 0], deg = 20 }} }}, {{ translate = {} }}]
material = "frost"
interior = "amber"
[[object]]
sphere = {{ center = {}, radius = {:e} }}
emission = "D65"
[[light]]
point = {{ position = {}, intensity = {:e} }}
[[light]]
environment = {{ radiance = 0.05 }}
"#,
        0.5 / k,
        0.5 * k,
        v(0.0, 0.0, 3.0),
        v(3.0, 0.0, 0.0),
        v(-0.5, 0.7, 0.0),
        0.6 * k,
        0.5 * k,
        v(0.8, 0.6, 0.3),
        v(0.6, 2.4, 0.3),
        0.3 * k,
        v(-1.0, 2.0, 1.0),
        0.7 * k * k,
    )
    .unwrap();
    out
}

#[derive(Clone, Copy, Debug)]
enum Sensor {
    Lens,
    Orthographic,
    Detector,
}

/// The sums, the image and the standard error of its Y.
fn render(sensor: Sensor, aim: Aiming, k: f64) -> (Vec<i128>, Vec<f64>, Vec<f64>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let loaded = parse_str(&text(sensor, k), &folder).unwrap_or_else(|e| panic!("{e}"));
    let (scene, settings) = (
        Arc::new(Scene::build(loaded.description).unwrap()),
        Settings {
            aim,
            ..loaded.settings
        },
    );
    let request = OutputRequest::default();
    let mut render = Render::new(&scene, 0, &settings, full_crop(&scene), &request);
    (0..PASSES).for_each(|pass| render.add_pass(pass));
    assert_eq!(render.counters().non_finite, 0);
    assert_eq!(render.counters().medium_mismatches, 0);
    assert_eq!(render.counters().lost_bridges, 0);
    let film: &Film = &render.outputs().image;
    let half = u64::from(PASSES) / 2;
    (
        film.sums(),
        film.image(u64::from(PASSES)),
        film.standard_error(1, half, half).unwrap(),
    )
}

fn check(sensor: Sensor, aim: Aiming) {
    let (sums, image, errors) = render(sensor, aim, 1.0);
    let lit = image.iter().filter(|&&v| v > 0.0).count();
    assert!(
        lit * 4 > image.len() * 3,
        "{sensor:?}: {lit} of {} values are not zero",
        image.len()
    );
    for exponent in [-20, 20] {
        let (scaled, other, _) = render(sensor, aim, 2.0_f64.powi(exponent));
        let different = image.iter().zip(&other).filter(|(a, b)| a != b).count();
        assert!(
            sums == scaled,
            "{sensor:?}, 2^{exponent}: {different} of {} values differ",
            image.len()
        );
    }
    for k in [1e-6, 1e6] {
        let (_, scaled, _) = render(sensor, aim, k);
        // the same random numbers: few paths take another turn
        let same = image
            .iter()
            .zip(&scaled)
            .filter(|(a, b)| (*a - *b).abs() <= 1e-5 * a.abs())
            .count();
        let mean = |i: &[f64]| i.iter().skip(1).step_by(3).sum::<f64>() / (i.len() / 3) as f64;
        let error = errors.iter().map(|e| e * e).sum::<f64>().sqrt() / errors.len() as f64;
        println!(
            "{sensor:?} x {k:e}: {same} of {} values are the same, means {} and {} ± {error}",
            image.len(),
            mean(&image),
            mean(&scaled)
        );
        assert!(
            (mean(&image) - mean(&scaled)).abs() < 4.5 * error,
            "{sensor:?}: the mean changes with scale {k}"
        );
        assert!(
            same * 100 >= image.len() * 98,
            "{sensor:?}: scale {k} changes all but {same} of {} values",
            image.len()
        );
    }
}

#[test]
fn through_a_thin_lens() {
    check(Sensor::Lens, Aiming::Off);
}

#[test]
fn in_parallel_projection() {
    check(Sensor::Orthographic, Aiming::Off);
}

#[test]
fn on_a_detector() {
    check(Sensor::Detector, Aiming::Off);
}

#[test]
fn through_chains_that_are_solved_for() {
    check(Sensor::Lens, Aiming::All);
}

/// A lamp and a wall, in the unit `k` of radiance.
fn lit(k: f64, light: &str) -> Arc<Scene> {
    let text = format!(
        "[[sensor]]\nresolution = [12, 8]\nperspective = {{ eye = [0, 1, 4], target = [0, 0.6, 0], fov_deg = 45 }}\n\
         [material.white]\ndiffuse = {{ reflectance = 0.7 }}\n\
         [[object]]\nquad = {{ center = [0, 0, 0], u = [0, 0, 3], v = [3, 0, 0] }}\nmaterial = \"white\"\n\
         {}",
        light.replace("POWER", &format!("{k:e}"))
    );
    let loaded = parse_str(&text, Path::new("/nonexistent")).unwrap_or_else(|e| panic!("{e}"));
    Arc::new(Scene::build(loaded.description).unwrap())
}

/// No light is too bright or too dim for the sums of a film.
#[test]
fn extreme_lights_have_an_exponent() {
    let lamp = "[[object]]\nquad = { center = [0, 2, 0], u = [0.3, 0, 0], v = [0, 0, 0.3] }\nemission = POWER\n";
    let point = "[[light]]\npoint = { position = [0, 2, 0], intensity = POWER }\n";
    for light in [lamp, point] {
        let rendered = |k: f64| {
            let scene = lit(k, light);
            let options = SessionOptions {
                passes: Some(0..4),
                ..SessionOptions::default()
            };
            let exponent = scene.film_exponent;
            let mut session = Session::new(scene, &Settings::default(), options).unwrap();
            session.run();
            let part = part::of(&session);
            let render = session.render();
            let rejected = render.outputs().image.rejected();
            assert_eq!((rejected.saturated, rejected.not_finite), (0, 0), "{k:e}");
            let image = image::of(&render);
            assert!(image::of_part(&part).unwrap() == image, "{k:e}");
            (exponent, part.sums, image.xyz().unwrap())
        };
        let (exponent, sums, plain) = rendered(1.0);
        assert_eq!(exponent, 0);
        assert!(sums.iter().any(|s| *s > 0));
        // powers of two change no rounding
        for power in [-90, 90] {
            let k = 2.0_f64.powi(power);
            let (exponent, scaled, image) = rendered(k);
            assert!((exponent - power).abs() < 20, "{exponent}");
            let value = |s: &i128| *s as f64 * 2.0_f64.powi(exponent - power);
            let near = |(a, b): (&i128, &i128)| {
                // what is rounded away is less than a unit for each sample
                (*a as f64 - value(b)).abs()
                    <= 1e-12 * *a as f64 + 64.0 * 2.0_f64.powi(exponent - power).max(1.0)
            };
            assert!(sums.iter().zip(&scaled).all(near), "2^{power}");
            let near = |(a, b): (&f64, &f64)| (a * k - b).abs() <= 1e-6 * b;
            assert!(plain.iter().zip(&image).all(near), "2^{power}");
        }
    }
}
