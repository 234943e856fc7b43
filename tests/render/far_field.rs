//! Detectors over directions, and those that take light from a cone alone, against closed forms.

use crate::harness::{Estimate, line_images, measure, scene, scene_in, with};
use crate::lens::lenses;
use abbe::scene::settings::IntegratorKind;
use abbe::spectrum::Library;
use glam::DVec2;
use std::f64::consts::PI;

const INTEGRATORS: [IntegratorKind; 3] = [
    IntegratorKind::Path,
    IntegratorKind::Light,
    IntegratorKind::Bdpt,
];

/// A Lambertian lamp has the intensity L A cos θ.
#[test]
fn intensity_of_a_lamp() {
    let text = r#"
[[sensor]]
resolution = [24, 16]
detector = { center = [0, 0, 0], u = [2, 0, 0], v = [0, 2, 0], far_field_deg = [60, 40] }
[[object]]
quad = { center = [0.3, 0.2, 0.5], u = [0, 0.5, 0], v = [0.5, 0, 0] }
emission = 3.0
"#;
    let (scene, settings) = scene(text);
    let half = DVec2::new(30.0, 20.0).map(f64::to_radians);
    // mean of cos θ over the film, by the midpoint rule
    let n = 400;
    let cosine = |i: i32| {
        let at = DVec2::new(f64::from(i % n), f64::from(i / n)) + 0.5;
        ((at / f64::from(n) * 2.0 - 1.0) * half).length().cos()
    };
    let average = (0..n * n).map(cosine).sum::<f64>() / f64::from(n * n);
    for integrator in INTEGRATORS {
        let found = measure(&scene, &with(&settings, integrator), 16, 24, &[]);
        found
            .y
            .assert_is(&format!("{integrator:?}"), 3.0 * average, 0.01);
    }
}

/// Light of all kinds of paths by direction: from the light, from the detector and by both the
/// same, class by class.
#[test]
fn integrators_agree_by_direction() {
    let text = r#"
[render]
max_depth = 4
[[sensor]]
resolution = [8, 6]
detector = { center = [0, 0, 0], u = [0.5, 0, 0], v = [0, 0.5, 0], far_field_deg = [80, 60], flip = true }
[medium.flint]
glass = "schott:N-SF11"
[material.white]
diffuse = { reflectance = 0.7 }
[material.clear]
dielectric = {}
[[object]]
sphere = { center = [0.3, 0, 1], radius = 0.4 }
material = "clear"
interior = "flint"
[[object]]
quad = { center = [0, 0, 2], u = [0, 1.5, 0], v = [1.5, 0, 0] }
material = "white"
[[object]]
quad = { center = [-0.6, 0.5, 0.8], u = [0.2, 0, 0], v = [0, 0, 0.2] }
emission = 4.0
two_sided = true
"#;
    let (scene, settings) = scene(text);
    let classes = ["LE", "LDE", "LS+E", "LS+DE", "LDS+E"];
    let of = |integrator| {
        // half of the light goes to the glass
        let passes = if integrator == IntegratorKind::Light {
            192
        } else {
            96
        };
        measure(&scene, &with(&settings, integrator), 16, passes, &classes)
    };
    let [path, light, bdpt] = INTEGRATORS.map(of);
    for other in [&light, &bdpt] {
        println!("path {:?}, other {:?}", path.y, other.y);
        assert!(path.y.error < 0.03 * path.y.mean && other.y.error < 0.03 * other.y.mean);
        assert!(
            path.y.deviation(&other.y) < 4.5,
            "{:?} {:?}",
            path.y,
            other.y
        );
        for (class, (a, b)) in classes.iter().zip(path.classes.iter().zip(&other.classes)) {
            println!("{class}: path {a:?}, other {b:?}");
            assert!(a.mean > 0.0 && a.deviation(b) < 4.5, "{class}: {a:?} {b:?}");
        }
    }
}

/// A detector that takes a cone of half angle A measures π sin² A of a lamp that fills it.
#[test]
fn acceptance_of_a_cone() {
    let text = r#"
[[sensor]]
resolution = [4, 4]
detector = { center = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0], acceptance_deg = 25 }
[[object]]
quad = { center = [0, 0, 1], u = [0, 1.5, 0], v = [1.5, 0, 0] }
emission = 2.0
[[light]]
point = { position = [0, 0, 0.8], intensity = 5 }
[[light]]
point = { position = [3, 0, 0.5], intensity = 5 }
"#;
    let (scene, settings) = scene(text);
    // the point above shines on all of it, the one beside is not accepted
    let n = 200;
    let from_point = |i: i32| {
        let at = DVec2::new(f64::from(i % n), f64::from(i / n)) + 0.5;
        let squared = (at / f64::from(n) * 2.0 - 1.0).length_squared() + 0.64;
        let cos = 0.8 / squared.sqrt();
        if cos > 25f64.to_radians().cos() {
            5.0 * cos / squared
        } else {
            0.0
        }
    };
    let point = (0..n * n).map(from_point).sum::<f64>() / f64::from(n * n);
    let expected = 2.0 * PI * 25f64.to_radians().sin().powi(2) + point;
    for integrator in INTEGRATORS {
        let found = measure(&scene, &with(&settings, integrator), 16, 1024, &[]);
        found
            .y
            .assert_is(&format!("{integrator:?}"), expected, 0.015);
    }
}

/// Light turned by a sphere of water after one and two reflections, whose edge is the ray of least
/// deviation (Descartes): within 0.01 degrees of it by the directions of its light.
#[test]
fn rainbow_angles() {
    for nm in [486.1327, 587.5618, 656.2725] {
        let index = Library::embedded()
            .ior("material:WATER")
            .expect("known")
            .n(nm);
        for reflections in [1, 2] {
            let k = f64::from(reflections + 1);
            // cos² i = (n² - 1)/(k² - 1)
            let incidence = ((index * index - 1.0) / (k * k - 1.0)).sqrt().acos();
            let refraction = (incidence.sin() / index).asin();
            let deviation = 2.0 * incidence - 2.0 * k * refraction + f64::from(reflections) * PI;
            // angle between the light and the way back to the sun
            let angle = (deviation - PI).abs();
            // the detector looks along the rainbow ray, up in its picture toward larger angles
            let side = if reflections == 1 { -1.0 } else { 1.0 };
            let text = RAINBOW
                .replace("DEPTH", &(reflections + 2).to_string())
                .replace("LINE", &nm.to_string())
                .replace("ENTRY", &(side * incidence.sin()).to_string())
                .replace(
                    "CENTER",
                    &format!("[0, {}, {}]", 100.0 * angle.sin(), -100.0 * angle.cos()),
                )
                .replace(
                    "UP",
                    &format!("[0, {}, {}]", 300.0 * angle.cos(), 300.0 * angle.sin()),
                );
            let (scene, settings) = scene_in(&lenses(), &text);
            let image = line_images(&scene, 0, &settings, 1, 2).remove(0).remove(0);
            // the angle to the way back of each pixel's light, and the outermost that is lit
            let lit = (0..image.len()).filter(|&i| image[i] > 0.0);
            let angles = lit.clone().map(|i| {
                let x = ((i % 200) as f64 + 0.5 - 100.0) * 0.02f64.to_radians();
                let y = (150.0 - (i / 200) as f64 - 0.5) * 0.002f64.to_radians();
                let theta = x.hypot(y);
                let travel = DVec2::new(theta.cos(), theta.sin() / theta * y);
                DVec2::from_angle(angle).rotate(travel).x.acos()
            });
            assert!(lit.count() > 30, "too little light to tell");
            let edge = if reflections == 1 {
                angles.fold(0.0, f64::max)
            } else {
                angles.fold(PI, f64::min)
            };
            let off = (edge - angle).to_degrees();
            println!(
                "{nm} nm, {reflections} reflections: {:.4} degrees, edge off by {off:.4}",
                angle.to_degrees()
            );
            assert!(off.abs() < 0.01, "{nm} {reflections}: {off}");
        }
    }
}

const RAINBOW: &str = r#"
unit = "mm"
[render]
integrator = "light"
max_depth = DEPTH
wavelengths = { line_nm = LINE }
[[sensor]]
resolution = [200, 300]
detector = { center = CENTER, u = [300, 0, 0], v = UP, far_field_deg = [4, 0.6] }
[medium.water]
glass = "material:WATER"
use_k = false
[material.clear]
dielectric = {}
[[object]]
sphere = { radius = 1 }
material = "clear"
interior = "water"
[[light]]
beam = { position = [0, ENTRY, -3], direction = [0, 0, 1], radius = 0.05, irradiance = 1 }
"#;

/// Flux of a detector by place and by direction: the same.
#[test]
fn flux_is_the_same_by_place_and_by_direction() {
    let text = r#"
unit = "mm"
[render]
integrator = "light"
[[sensor]]
resolution = [32, 32]
detector = { center = [0, 0, 30], u = [-4, 0, 0], v = [0, 4, 0]KIND }
[[lens]]
surface = [
    { radius = 40, thickness = 4, glass = "schott:N-SF66", semi_diameter = 8 },
    { radius = -60, semi_diameter = 8 },
]
[[light]]
beam = { position = [1, 0, -5], direction = [0, 0, 1], radius = 3, irradiance = 1 }
"#;
    let flux = |kind: &str| {
        let (scene, settings) = scene_in(&lenses(), &text.replace("KIND", kind));
        let batch = |seed: u64| {
            let settings = abbe::scene::Settings {
                seed,
                spp: 8,
                ..settings.clone()
            };
            let options = abbe::render::SessionOptions::default();
            let session = abbe::render::Session::new(scene.clone(), &settings, options);
            let mut session = session.expect("begins");
            session.run();
            let flux = session.render().flux().expect("a detector");
            flux.luminous_lm.value
        };
        Estimate::from_batches(&(0..8).map(batch).collect::<Vec<_>>())
    };
    let (place, direction) = (flux(""), flux(", far_field_deg = [120, 120]"));
    println!("{place:?} {direction:?}");
    assert!(place.error < 0.01 * place.mean && direction.error < 0.01 * direction.mean);
    assert!(place.deviation(&direction) < 4.5, "{place:?} {direction:?}");
}
