//! Photon merging: the mean of bidirectional path tracing, by every mode and every technique alone; what it finds that nothing else
//! does; and the bands it draws.
//!
//! Merging is biased by its radius: on the mean of a film by what the disc of radius r covers beyond the edges of a surface. Radii
//! here are chosen so that this stays below `BIAS`, which comes on top of 4.5 standard errors (p = 7e-6 each).

use super::harness::{Estimate, Measured, full_crop, measure, scene, test_scale, with};
use abbe::film::Crop;
use abbe::math::banding::{Axis, banding};
use abbe::math::stats::Moments;
use abbe::render::{OutputRequest, Render};
use abbe::scene::settings::IntegratorKind::{self, Bdpt, Bpm, Ppm, Vcm};
use abbe::scene::settings::{Heuristic, Regularize, Sharing};
use abbe::scene::{Scene, Settings};

const LIMIT: f64 = 4.5;
/// Share of the mean.
const BIAS: f64 = 0.006;

macro_rules! room {
    ($settings:literal, $contents:literal) => {
        concat!(
            "[render]\nfilter = \"box\"\n",
            $settings,
            r#"
[[sensor]]
resolution = [24, 24]
perspective = { eye = [0, 1, 0.95], target = [0, 0.9, 0], fov_deg = 80, aperture_radius = 0.02, focus_distance = 1 }
[material.white]
diffuse = { reflectance = 0.6 }
[material.glass]
dielectric = {}
[material.rough]
dielectric = { roughness = 0.3 }
[material.floor]
mix = [{ weight = 0.5, diffuse = { reflectance = 0.4 } }, { weight = 0.4, conductor = { metal = "Cu", roughness = 0.3 } }]
[material.half_mirror]
mix = [{ weight = 0.4, mirror = {} }, { weight = 0.5, diffuse = { reflectance = 0.9 } }]
[medium.flint]
glass = "schott:N-SF11"
[[object]]
box = { min = [-1, 0, -1], max = [1, 2, 1] }
material = "white"
[[object]]
quad = { center = [0, 1.9, 0], u = [0.6, 0, 0], v = [0, 0, 0.6] }
emission = 4
"#,
            $contents
        )
    };
}

const MIXED: &str = room!(
    "max_depth = 4\nwavelengths = { line_nm = 550 }\nmerge_radius = 0.03",
    r#"
[[object]]
quad = { center = [0, 0.02, 0], u = [0, 0, 0.9], v = [0.9, 0, 0] }
material = "floor"
[[object]]
quad = { center = [-0.5, 0.6, -0.5], u = [0.4, 0, -0.1], v = [0, 0.5, 0] }
material = "half_mirror"
[[object]]
mesh = { obj = "assets/smooth_sphere.obj" }
transform = [{ scale = [0.4, 0.35, 0.4] }, { translate = [0.4, 0.5, -0.2] }]
material = "white"
"#
);

const DISPERSIVE: &str = room!(
    "max_depth = 5\nlanes = 4\nmerge_radius = 0.03\nsharing = \"stratified\"",
    r#"
[[object]]
sphere = { center = [0.2, 0.6, 0.1], radius = 0.45 }
material = "glass"
interior = "flint"
"#
);

const ROUGH: &str = room!(
    "max_depth = 4\nlanes = 4\nmerge_radius = 0.04\nsharing = \"stratified\"",
    r#"
[[object]]
sphere = { center = [0, 0.6, 0], radius = 0.5 }
material = "rough"
interior = "flint"
"#
);

fn agree(what: &str, a: &Estimate, b: &Estimate, resolution: f64) {
    let error = a.error.hypot(b.error);
    let apart = (a.mean - b.mean).abs();
    println!(
        "{what}: {:.5} and {:.5}, {:+.2} % with a standard error of {:.2} %",
        a.mean,
        b.mean,
        100.0 * (a.mean / b.mean - 1.0),
        100.0 * error / b.mean
    );
    assert!(error <= resolution * b.mean, "{what}: {a:?} and {b:?} tell nothing");
    assert!(apart < LIMIT * error + BIAS * b.mean, "{what}: {a:?} and {b:?}");
}

fn run(scene: &Scene, settings: &Settings, kind: IntegratorKind, passes: u32, classes: &[&str]) -> Measured {
    measure(scene, &with(settings, kind), 8, passes * test_scale(), classes)
}

/// Every class that merging makes, by each of its merges alone, is what another technique makes of it alone.
fn merges_agree_alone(what: &str, vcm: &Measured) {
    let mut compared = 0;
    for ((class, s, t), (raw, _)) in &vcm.strategies {
        let vertices = class.len() as u32;
        if s + t != vertices + 1 || raw.error > 0.03 * raw.mean {
            continue;
        }
        let others = vcm.strategies.iter().filter(|((c, s, t), (raw, _))| {
            c == class && s + t == vertices && (*s <= 1 || *t <= 1) && raw.error <= 0.02 * raw.mean
        });
        let best = others.min_by(|a, b| a.1.0.error.total_cmp(&b.1.0.error));
        let Some(((_, bs, bt), (best, _))) = best else { continue };
        compared += 1;
        let allowed = LIMIT * raw.error.hypot(best.error) + 5.0 * BIAS * best.mean;
        assert!(
            (raw.mean - best.mean).abs() < allowed,
            "{what} {class}: merging ({s}, {t}) alone gives {raw:?}, ({bs}, {bt}) gives {best:?}"
        );
    }
    println!("{what}: {compared} merges compared");
    assert!(compared >= 3, "{what}: only {compared} merges could be compared");
}

#[test]
fn every_mode_has_the_mean_of_bdpt() {
    let (scene, settings) = scene(MIXED);
    let classes = ["LDE", "LDDE", "LDSE", "LSDE"];
    let bdpt = run(&scene, &settings, Bdpt, 60, &classes);
    for (kind, passes) in [(Vcm, 60), (Bpm, 100), (Ppm, 100)] {
        let merged = run(&scene, &settings, kind, passes, &classes);
        agree(&format!("{kind:?}"), &merged.y, &bdpt.y, 0.01);
        for (class, (a, b)) in classes.iter().zip(merged.classes.iter().zip(&bdpt.classes)) {
            agree(&format!("{kind:?} {class}"), a, b, 0.06);
        }
        if kind == Vcm {
            merges_agree_alone("mixed room", &merged);
        }
    }
}

#[test]
fn dispersive_glass_and_the_power_heuristic_have_the_same_mean() {
    let (scene, settings) = scene(DISPERSIVE);
    let bdpt = run(&scene, &settings, Bdpt, 100, &[]);
    let power = Settings {
        heuristic: Heuristic::Power2,
        ..settings.clone()
    };
    let set = Settings {
        merging: abbe::scene::settings::Merging {
            sharing: Sharing::Set,
            ..settings.merging
        },
        ..settings.clone()
    };
    for (what, settings, kind) in [
        ("vcm", &settings, Vcm),
        ("vcm, squares", &power, Vcm),
        ("vcm, heroes in turn", &set, Vcm),
        ("ppm", &settings, Ppm),
    ] {
        let merged = run(&scene, settings, kind, 64, &[]);
        agree(what, &merged.y, &bdpt.y, 0.015);
    }
}

#[test]
fn rough_dispersive_glass_is_merged_by_the_sum_over_whole_paths() {
    let (scene, settings) = scene(ROUGH);
    let bdpt = run(&scene, &settings, Bdpt, 60, &[]);
    let vcm = run(&scene, &settings, Vcm, 40, &[]);
    agree("rough glass", &vcm.y, &bdpt.y, 0.015);
}
