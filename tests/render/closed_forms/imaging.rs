//! Where light goes: prisms, lenses, and benches far from the origin.

use crate::harness::{Estimate, line_images, mean, scene_in};
use glam::DVec2;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// The folder of the prism's mesh.
fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// Where the light of one line fell: flux, centroid and rms radius about it, in the detector's
/// length unit (x along u, y along v).
#[derive(Debug)]
struct Spot {
    flux: f64,
    x: f64,
    y: f64,
    rms: f64,
}

/// Reads the spot of the scene's only line on its first sensor, a square of `n` x `n` pixels with
/// edge `edge`.
fn spot(text: &str, n: usize, edge: f64, passes: u32) -> Spot {
    let (scene, settings) = scene_in(&scenes(), text);
    let image = line_images(&scene, 0, &settings, 1, passes)
        .remove(0)
        .remove(0);
    let pitch = edge / n as f64;
    let at = |i: usize| {
        let (column, row) = (i % n, i / n);
        (
            (column as f64 + 0.5) * pitch - 0.5 * edge,
            0.5 * edge - (row as f64 + 0.5) * pitch,
        )
    };
    let total: f64 = image.iter().sum();
    let average = |f: &dyn Fn(f64, f64) -> f64| {
        image
            .iter()
            .enumerate()
            .map(|(i, v)| v * f(at(i).0, at(i).1))
            .sum::<f64>()
            / total
    };
    let (x, y) = (average(&|x, _| x), average(&|_, y| y));
    let square = average(&|px, py| (px - x).powi(2) + (py - y).powi(2));
    // a pixel spreads what falls on it over pitch²/12 in each direction (Sheppard's correction)
    let rms = (square - pitch * pitch / 6.0).max(0.0).sqrt();
    Spot {
        flux: mean(&image) * edge * edge,
        x,
        y,
        rms,
    }
}

/// Minimum deviation of 60° prisms, D = 2 asin(n sin 30°) - 60°: a thin beam lands within 0.01 mm
/// on 1 m.
#[test]
fn prism_deviation() {
    let bk7 = [
        (435.8343, 1.526_684_6, 39.519_479),
        (486.1327, 1.522_376_3, 39.138_109),
        (546.0740, 1.518_722_0, 38.815_792),
        (587.5618, 1.516_800_0, 38.646_699),
        (656.2725, 1.514_322_3, 38.429_137),
    ];
    let sf10 = [
        (435.8343, 1.761_914_2, 63.516_071),
        (486.1327, 1.746_430_5, 61.668_900),
        (546.0740, 1.734_298_9, 60.258_116),
        (587.5618, 1.728_277_1, 59.568_964),
        (656.2725, 1.720_906_2, 58.734_986),
    ];
    for (glass, table) in [("N-BK7", bk7), ("N-SF10", sf10)] {
        for (line, index, degrees) in table {
            let deviation = f64::to_radians(degrees);
            assert!((2.0 * (0.5_f64 * index).asin() - PI / 3.0 - deviation).abs() < 3e-7);
            let (sin, cos) = (0.5 * deviation).sin_cos();
            // in at the middle of the left face, level through the glass, out at the middle of the
            // right face
            let text = PRISM
                .replace("GLASS", glass)
                .replace("LINE", &line.to_string())
                .replace(
                    "POSITION",
                    &format!("[{}, {}, 0]", -7.5 - 20.0 * cos, -20.0 * sin),
                )
                .replace("DIRECTION", &format!("[{cos}, {sin}, 0]"))
                .replace(
                    "CENTER",
                    &format!("[{}, {}, 0]", 7.5 + 1000.0 * cos, -1000.0 * sin),
                )
                .replace("NORMAL", &format!("[-{cos}, {sin}, 0]"));
            let spot = spot(&text, 32, 0.1, 4);
            let distance = spot.x.hypot(spot.y);
            println!("{glass} prism at {line} nm: off by {distance:.5} mm on 1 m");
            assert!(
                distance < 0.01,
                "{glass} at {line} nm: off by {distance} mm: {spot:?}"
            );
            // nothing fell beside the detector: two refractions at minimum deviation (light that is
            // reflected once around the prism leaves the same way, and is left out by the depth)
            let incidence = PI / 6.0 + 0.5 * deviation;
            let (a, b) = (incidence, PI / 6.0);
            let t = 1.0
                - 0.5
                    * (((a - b).sin() / (a + b).sin()).powi(2)
                        + ((a - b).tan() / (a + b).tan()).powi(2));
            let expected = t * t * PI * 0.002 * 0.002;
            // 4096 paths that arrive or not
            let error = expected * ((1.0 - t * t) / (t * t) / 4096.0).sqrt();
            assert!(
                (spot.flux - expected).abs() < 4.5 * error,
                "{glass} at {line} nm: {spot:?}, expected {expected}"
            );
        }
    }
}

const PRISM: &str = r#"
unit = "mm"
[render]
integrator = "light"
max_depth = 2
wavelengths = { line_nm = LINE }
[[sensor]]
resolution = [32, 32]
detector = { center = CENTER, normal = NORMAL, width = 0.1, height = 0.1, up = [0, 0, 1] }
[medium.glass]
glass = "schott:GLASS"
use_k = false
[material.clear]
dielectric = {}
[[object]]
mesh = { obj = "assets/prism.obj" }
material = "clear"
interior = "glass"
[[light]]
beam = { position = POSITION, direction = DIRECTION, radius = 0.002, irradiance = 1 }
"#;

/// A lamp of five lines through a prism at minimum deviation for one of them: each lands where a
/// ray traced by hand does, as bright as Fresnel's two surfaces leave it.
#[test]
fn line_lamp_through_a_prism() {
    // of N-SF10, ascending wavelengths
    let indices = [
        1.761_914_2,
        1.746_430_5,
        1.734_298_9,
        1.728_277_1,
        1.720_906_2,
    ];
    let (sin, cos) = (0.5 * 59.568_964_f64.to_radians()).sin_cos();
    let text = LAMP
        .replace(
            "POSITION",
            &format!("[{}, {}, 0]", -7.5 - 20.0 * cos, -20.0 * sin),
        )
        .replace("DIRECTION", &format!("[{cos}, {sin}, 0]"))
        .replace(
            "CENTER",
            &format!("[{}, {}, 0]", 7.5 + 1000.0 * cos, -1000.0 * sin),
        )
        .replace("ALONG", &format!("[{}, {}, 0]", -80.0 * sin, -80.0 * cos));
    let (scene, settings) = scene_in(&scenes(), &text);
    let batches = line_images(&scene, 0, &settings, 32, 1);
    for (i, index) in indices.into_iter().enumerate() {
        let (position, transmittance) = through_prism(index, DVec2::new(cos, sin));
        let pitch = 160.0 / 16384.0;
        let centroid = |image: &[f64]| {
            let at = |k: usize| (k as f64 + 0.5) * pitch - 80.0;
            let moment: f64 = image.iter().enumerate().map(|(k, v)| v * at(k)).sum();
            moment / image.iter().sum::<f64>()
        };
        let found = mean(
            &batches
                .iter()
                .map(|images| centroid(&images[i]))
                .collect::<Vec<_>>(),
        );
        assert!(
            (found - position).abs() < 0.01,
            "line {i} at {found} mm, expected {position}"
        );
        // the detector is 160 mm by 1 mm
        let flux: Vec<f64> = batches
            .iter()
            .map(|images| 160.0 * mean(&images[i]))
            .collect();
        let expected = (i + 1) as f64 * transmittance * PI * 0.05 * 0.05;
        Estimate::from_batches(&flux).assert_is(&format!("flux of line {i}"), expected, 1e-2);
    }
}

/// Where a ray that enters the prism of [`LAMP`] along `d` lands, from the middle of the detector,
/// and its transmittance.
fn through_prism(index: f64, d: DVec2) -> (f64, f64) {
    // sides through (-7.5, 0) and (7.5, 0), outward normals at 150° and 30°
    let (left, right) = (
        DVec2::from_angle(5.0 * PI / 6.0),
        DVec2::from_angle(PI / 6.0),
    );
    let refract = |d: DVec2, normal: DVec2, ratio: f64| {
        let cos_i = -d.dot(normal);
        let cos_t = (1.0 - ratio * ratio * (1.0 - cos_i * cos_i)).sqrt();
        let r_s = (ratio * cos_i - cos_t) / (ratio * cos_i + cos_t);
        let r_p = (cos_i - ratio * cos_t) / (cos_i + ratio * cos_t);
        (
            ratio * d + (ratio * cos_i - cos_t) * normal,
            1.0 - 0.5 * (r_s * r_s + r_p * r_p),
        )
    };
    let (entry, middle) = (DVec2::new(-7.5, 0.0), DVec2::new(7.5, 0.0));
    let (inside, t_in) = refract(d, left, 1.0 / index);
    let exit = entry + inside * ((middle - entry).dot(right) / inside.dot(right));
    let (out, t_out) = refract(inside, -right, index);
    // the detector is normal to the exit at minimum deviation, which mirrors the entrance
    let axis = DVec2::new(d.x, -d.y);
    let center = middle + 1000.0 * axis;
    let hit = exit + out * ((center - exit).dot(axis) / out.dot(axis));
    ((hit - center).dot(DVec2::new(-d.y, -d.x)), t_in * t_out)
}

const LAMP: &str = r#"
unit = "mm"
[render]
integrator = "light"
max_depth = 2
[[sensor]]
resolution = [16384, 1]
detector = { center = CENTER, u = ALONG, v = [0, 0, 0.5] }
[spectrum.lamp]
lines = [[435.8343, 1], [486.1327, 2], [546.074, 3], [587.5618, 4], [656.2725, 5]]
[medium.glass]
glass = "schott:N-SF10"
use_k = false
[material.clear]
dielectric = {}
[[object]]
mesh = { obj = "assets/prism.obj" }
material = "clear"
interior = "glass"
[[light]]
beam = { position = POSITION, direction = DIRECTION, radius = 0.05, irradiance = "lamp" }
"#;

/// A ball of diameter D focuses thin beams at nD/(4(n-1)) from its centre. The focus is where the
/// cone between two detectors is narrowest: both see the same rays, so their noise cancels.
#[test]
fn ball_lens_focus() {
    let cases = [
        ("glass = \"schott:N-BK7\"", 0.733_746),
        ("ior = 1.5", 0.75),
        ("ior = 1.8", 1.8 / 3.2),
    ];
    for (index, per_diameter) in cases {
        let focus = 10.0 * per_diameter;
        let side = 0.06 * focus;
        // the beam's radius shrinks as 0.002 δ/f
        let edge = 0.000_4;
        let [before, after] = [focus - side, focus + side].map(|z| {
            let text = BALL
                .replace("INDEX", index)
                .replace("PLANE", &z.to_string());
            spot(&text, 64, edge, 4).rms
        });
        let found = focus - side + 2.0 * side * before / (before + after);
        println!(
            "{index}: best focus off by {:.1e} of itself",
            found / focus - 1.0
        );
        assert!(
            (found / focus - 1.0).abs() < 1e-4,
            "{index}: focus at {found}, expected {focus}"
        );
        // uniform disc: rms = radius/√2
        let expected = 0.002 * 0.06 / f64::sqrt(2.0);
        assert!(
            (before / expected - 1.0).abs() < 0.02,
            "{index}: rms {before}, expected {expected}"
        );
    }
}

const BALL: &str = r#"
unit = "mm"
[render]
integrator = "light"
wavelengths = { line_nm = 587.5618 }
[[sensor]]
resolution = [64, 64]
detector = { center = [0, 0, PLANE], u = [-0.0002, 0, 0], v = [0, 0.0002, 0] }
[medium.glass]
INDEX
[material.clear]
dielectric = {}
[[object]]
sphere = { radius = 5 }
material = "clear"
interior = "glass"
[[light]]
beam = { position = [0, 0, -20], direction = [0, 0, 1], radius = 0.002, irradiance = 1 }
"#;

/// The same bench 10 m from the origin, and with its light 10 m before the lens: the same spot.
#[test]
fn lens_far_from_the_origin() {
    let bench = |offset: [f64; 3], before: f64| {
        let [x, y, z] = offset;
        let text = BENCH
            .replace("LENS", &format!("[{x}, {y}, {z}]"))
            .replace("METER", &format!("[{x}, {y}, {}]", z + 9.0))
            .replace("LIGHT", &format!("[{}, {y}, {}]", x + 1.0, z - before));
        spot(&text, 128, 2.0, 4)
    };
    let here = bench([0.0; 3], 20.0);
    assert!(here.rms > 0.01 && here.rms < 0.5, "{here:?}");
    let cases = [
        ([0.0, 0.0, 10_000.0], 20.0),
        ([10_000.0, -7_000.0, 3_000.0], 20.0),
        ([0.0; 3], 10_000.0),
    ];
    for (offset, before) in cases {
        let there = bench(offset, before);
        println!("at {offset:?} mm, light {before} mm before: {there:?}");
        let distance = (there.x - here.x).hypot(there.y - here.y);
        assert!(
            distance < 1e-6 * here.rms,
            "at {offset:?}: {there:?}, at the origin {here:?}"
        );
        assert!(
            (there.rms / here.rms - 1.0).abs() < 1e-6,
            "at {offset:?}: {there:?}, at the origin {here:?}"
        );
        assert!(
            (there.flux / here.flux - 1.0).abs() < 1e-6,
            "at {offset:?}: {there:?}, at the origin {here:?}"
        );
    }
}

const BENCH: &str = r#"
unit = "mm"
[render]
integrator = "light"
wavelengths = { line_nm = 587.5618 }
[[sensor]]
resolution = [128, 128]
detector = { center = METER, u = [-1, 0, 0], v = [0, 1, 0] }
[medium.glass]
glass = "schott:N-BK7"
[material.clear]
dielectric = {}
[[object]]
sphere = { radius = 5 }
transform = [{ scale = [1, 1, 0.8] }, { translate = LENS }]
material = "clear"
interior = "glass"
[[light]]
beam = { position = LIGHT, direction = [0, 0, 1], radius = 2, irradiance = 1 }
"#;
