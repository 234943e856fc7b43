//! Plane mirrors: reflectance, and images behind them.

use crate::harness::{
    Estimate, assert_close, line_images, line_mean, mean, measure, scene, test_scale, with,
};
use crate::regularized::regularized;
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path};
use abbe::scene::settings::Regularize::{Mis, Off};
use glam::{DVec2, DVec3, dvec2, dvec3};
use std::f64::consts::PI;

/// A beam between parallel mirrors of R = .99 that leaves after 50 reflections: .99^50 =
/// .6050060671.
#[test]
fn fifty_reflections() {
    // 0.1 m forward from mirror to mirror: the 50th hit is at x = 4.95, the detector catches the
    // light half way to the 51st
    let (scene, settings) = scene(FIFTY);
    let flux = 0.06 * 0.06 / (PI * 1e-4);
    let measured = line_mean(&scene, 0, &settings, 32, 4 * test_scale()).scaled(flux);
    measured.assert_is("50 mirrors", 0.605_006_067_1, 2.6e-3);
    // all of it took 50 reflections
    let measured = measure(&scene, &settings, 2, 1, &["LS{50}E"]);
    assert!(measured.y.mean > 0.0);
    let (of_class, all) = (measured.classes[0].mean, measured.y.mean);
    assert_close("fifty reflections alone", of_class, all, 1e-12);
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

/// Point light I (the whole, or a cone of it), mirror R, detector: E = R I cosθ'/d'² with the
/// light's mirror image.
#[test]
fn point_light_in_a_mirror() {
    // the image of (0, 1, -1.2) in y = 0 is (0, -1, -1.2); the detector is the square of half edge
    // h in the plane z = 0
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
    for (light, kind, passes, resolution) in [
        ("point", Light, 30, 2e-2),
        ("spot", Light, 10, 8e-3),
        ("spot", Bdpt, 10, 8e-3),
    ] {
        let narrow = "spot = { direction = [0, -2, 1.2], outer_deg = 25, ";
        let text = if light == "spot" {
            POINT.replace("point = { ", narrow)
        } else {
            POINT.to_owned()
        };
        let (scene, settings) = scene(&text);
        let measured = line_mean(&scene, 0, &with(&settings, kind), 32, passes * test_scale());
        measured.assert_is(
            &format!("mirrored {light} light by {kind:?}"),
            expected,
            resolution,
        );
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

/// A point light seen by a pinhole in a mirror, whose image of finite flux and no extent a cone
/// spreads over a disc.
///
/// Both strategies of light, mirror, pinhole join at the mirror, so that what they estimate is
/// exactly the integral over the mirror of I/b² cosθ₁ · R/(A c̄) · cosθ₁'/a² · 1/(A_film cos³θ)
/// within the cone: no bias is left to allow for.
#[test]
fn the_image_of_a_point_light_in_a_mirror_is_a_disc_if_asked_for() {
    let shown = SEEN.replace("[render]", "[render]\nshow_point_lights = true");
    let epsilon = 0.05;
    let expected = SeenInMirror::integrated(epsilon);
    // the flux is that of the mirror image, but for terms of the order of ε²
    let image = dvec3(0.3, -1.0, -1.0);
    let toward = image - EYE;
    let cos = toward.normalize().dot((TARGET - EYE).normalize());
    let exact = 0.7 * 3.0 / (toward.length_squared() * film_area() * cos.powi(3));
    assert!((expected.flux / exact - 1.0).abs() < 2.0 * epsilon * epsilon);
    // and the disc is ε b/(a + b) wide, seen from the pinhole, b of the a + b meters being those
    // from the mirror to the light
    let beyond = 1.0 / (EYE.y + 1.0);
    let width = epsilon * beyond * f64::from(SIDE) / (2.0 * HALF_WIDTH);
    assert!((expected.radius / width - 1.0).abs() < 0.15);

    for (kind, passes) in [(Bdpt, 8), (Path, 8), (Light, 8)] {
        // from the light alone few paths of all directions come near the mirror's cone: there it
        // shines nowhere else
        let narrow = "spot = { direction = [-0.15, -0.9, 1], outer_deg = 6, ";
        let text = match kind {
            Light => shown.replace("point = { ", narrow),
            _ => shown.clone(),
        };
        let (scene, settings) = scene(&text);
        let settings = with(&regularized(&settings, Mis, epsilon), kind);
        let images = line_images(&scene, 0, &settings, 32, passes * test_scale());
        let of = |f: fn(&SeenInMirror) -> f64| {
            let values: Vec<f64> = images.iter().map(|i| f(&SeenInMirror::of(&i[0]))).collect();
            Estimate::from_batches(&values)
        };
        let name = |what: &str| format!("{what} of a mirrored point light by {kind:?}");
        of(|seen| seen.flux).assert_is(&name("flux"), expected.flux, 1e-2);
        of(|seen| seen.center.x).assert_is(&name("column"), expected.center.x, 1e-3);
        of(|seen| seen.center.y).assert_is(&name("row"), expected.center.y, 1e-3);
        for image in &images {
            let farthest = SeenInMirror::of(&image[0]).radius;
            // from the disc's center to the far corner of a pixel that its rim touches
            let most = expected.radius + 1.5;
            assert!(farthest > 1.0 && farthest < most, "{kind:?}: {farthest}");
        }
    }
    // without the key, and without cones, there is nothing
    for (text, mode) in [(SEEN, Mis), (&shown, Off)] {
        let (scene, settings) = scene(text);
        let settings = regularized(&settings, mode, epsilon);
        let images = line_images(&scene, 0, &settings, 2, 4);
        assert!(images.iter().flatten().flatten().all(|&v| v == 0.0));
    }
}

/// Mirrored light in an image: mean over the film, center of mass in pixels, distance of the
/// farthest light from it.
struct SeenInMirror {
    flux: f64,
    center: DVec2,
    radius: f64,
}

impl SeenInMirror {
    fn from_points(points: &[(DVec2, f64)], flux: f64) -> Self {
        let total: f64 = points.iter().map(|p| p.1).sum();
        let center = points.iter().map(|&(at, value)| at * value).sum::<DVec2>() / total;
        let radius = points.iter().map(|p| p.0.distance(center));
        Self {
            flux,
            center,
            radius: radius.fold(0.0, f64::max),
        }
    }

    /// As rendered.
    fn of(image: &[f64]) -> Self {
        let side = SIDE as usize;
        let at = |i: usize| dvec2((i % side) as f64 + 0.5, (i / side) as f64 + 0.5);
        let lit = |(i, &value): (usize, &f64)| (value > 0.0).then(|| (at(i), value));
        let points: Vec<_> = image.iter().enumerate().filter_map(lit).collect();
        Self::from_points(&points, mean(image))
    }

    /// By the midpoint rule over the mirror.
    fn integrated(epsilon: f64) -> Self {
        let light = dvec3(0.3, 1.0, -1.0);
        let forward = (TARGET - EYE).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let up = right.cross(forward);
        let chord = 2.0 * (0.5 * epsilon).sin();
        let (n, step) = (800_i32, 0.4 / 800.0);
        // where the line from the pinhole to the mirror image meets the mirror
        let middle = EYE + (dvec3(0.3, -1.0, -1.0) - EYE) * (EYE.y / (EYE.y + 1.0));
        let mut points = Vec::new();
        for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
            let offset = |i: i32| (f64::from(i - n / 2) + 0.5) * step;
            let x1 = middle + dvec3(offset(i), 0.0, offset(j));
            let (a, b) = (EYE - x1, light - x1);
            let (w_camera, w_light) = (a.normalize(), b.normalize());
            let mirrored = dvec3(-w_light.x, w_light.y, -w_light.z);
            if mirrored.distance(w_camera) >= chord {
                continue;
            }
            let kernel = 0.7 / (0.5 * (w_light.y + w_camera.y) * PI * chord * chord);
            let cos = -w_camera.dot(forward);
            let geometry = w_light.y * w_camera.y / (a.length_squared() * b.length_squared());
            let value = 3.0 * kernel * geometry / (film_area() * cos.powi(3));
            let raster = dvec2(-w_camera.dot(right), w_camera.dot(up)) / (cos * HALF_WIDTH);
            points.push((0.5 * f64::from(SIDE) * (raster + 1.0), value * step * step));
        }
        let flux = points.iter().map(|p| p.1).sum();
        Self::from_points(&points, flux)
    }
}

const EYE: DVec3 = dvec3(0.0, 0.8, 1.0);
const TARGET: DVec3 = dvec3(0.2, -1.0, -0.9);
/// Pixels along a side of the film.
const SIDE: u32 = 48;
/// Half the width of the film at unit distance: the tangent of half of 20 degrees.
const HALF_WIDTH: f64 = 0.176_326_980_708_464_97;

fn film_area() -> f64 {
    4.0 * HALF_WIDTH * HALF_WIDTH
}

const SEEN: &str = r#"
[render]
filter = "box"
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [48, 48]
perspective = { eye = [0, 0.8, 1], target = [0.2, -1, -0.9], fov_deg = 20 }
[material.silver]
mirror = { reflectance = 0.7 }
[[object]]
quad = { center = [0, 0, 0], u = [0, 0, 5], v = [5, 0, 0] }
material = "silver"
[[light]]
point = { position = [0.3, 1, -1], intensity = 3 }
"#;
