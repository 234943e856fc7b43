//! path = light = bdpt, in total and per path class, and every strategy alone.
//!
//! A comparison resolves 0.15 % of the mean unless its scene says otherwise and fails beyond 4.5
//! standard errors of the difference (p = 7e-6 each; with the fewer than 60 comparisons here p =
//! 4e-4 for the family). Every scene also shows that a 2 % error in the weight of its main strategy
//! would have been seen in its class.

use super::harness::{Estimate, Measured, measure, scene, test_scale, with};
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path, Pssmlt};
use abbe::scene::{Scene, Settings};
use std::sync::Arc;

pub struct Case {
    pub name: &'static str,
    pub text: &'static str,
    pub batches: u32,
    /// Passes of path, light, bdpt.
    pub passes: [u32; 3],
    pub classes: &'static [&'static str],
    /// The camera sees mirrors or smooth glass, in which light tracing shows nothing: of its image,
    /// classes are compared that reach the camera from a rough surface.
    pub specular_in_view: bool,
    /// Largest standard error of a difference, as a share of the mean.
    pub resolution: f64,
}

pub const LIMIT: f64 = 4.5;

pub fn compare(name: &str, what: &str, a: &Estimate, b: &Estimate, resolution: f64) {
    let error = a.error.hypot(b.error);
    let mean = 0.5 * (a.mean + b.mean);
    println!(
        "{name} {what}: {:.6} and {:.6}, standard error {:.2e} of the mean, at most {resolution:.1e}",
        a.mean,
        b.mean,
        error / mean
    );
    assert!(
        error <= resolution * mean,
        "{name} {what}: standard error {:.2e} of the mean, wanted {resolution:.1e}",
        error / mean
    );
    let deviation = a.deviation(b);
    assert!(
        deviation < LIMIT,
        "{name} {what}: {a:?} and {b:?} are {deviation:.1} standard errors apart"
    );
}

/// A 2 % error planted in the weight of the strategy that carries most, of the classes that are
/// compared, must be seen in its class.
fn assert_planted_error_is_seen(case: &Case, reference: &Measured, bdpt: &Measured) {
    let name = case.name;
    let compared = |class: &str| case.classes.iter().position(|c| *c == class);
    let (key, i, most) = bdpt
        .strategies
        .iter()
        .filter_map(|(key, (_, weighted))| Some((key, compared(&key.0)?, weighted)))
        .max_by(|a, b| a.2.mean.total_cmp(&b.2.mean))
        .expect("invariant: a lit scene has strategies");
    let (reference, found) = (&reference.classes[i], &bdpt.classes[i]);
    let planted = Estimate {
        mean: found.mean + 0.02 * most.mean,
        error: found.error,
    };
    let moved = 0.02 * most.mean / reference.error.hypot(found.error);
    println!("{name}: 2 % in {key:?} is {moved:.1} standard errors");
    assert!(
        planted.deviation(reference) > LIMIT || moved > LIMIT,
        "{name}: a 2 % error in the weight of {key:?} moves the mean by only {moved:.1} standard errors"
    );
}

/// Gives the scene and what bdpt found.
pub fn run(case: &Case) -> (Arc<Scene>, Settings, Measured) {
    let (scene, settings) = scene(case.text);
    let scale = test_scale();
    let [path, light, bdpt] = [
        (Path, case.passes[0]),
        (Light, case.passes[1]),
        (Bdpt, case.passes[2]),
    ]
    .map(|(kind, passes)| {
        (passes > 0).then(|| {
            measure(
                &scene,
                &with(&settings, kind),
                case.batches,
                passes * scale,
                case.classes,
            )
        })
    });
    let bdpt = bdpt.expect("invariant: every case runs bdpt");
    for (what, other) in [("path", path), ("light", light)] {
        let Some(other) = other else { continue };
        let blind = what == "light" && case.specular_in_view;
        if !blind {
            compare(case.name, what, &other.y, &bdpt.y, case.resolution);
        }
        for (class, (a, b)) in case
            .classes
            .iter()
            .zip(other.classes.iter().zip(&bdpt.classes))
        {
            assert!(b.mean > 0.0, "{}: class {class} is empty", case.name);
            if blind && class.ends_with("SE") {
                continue;
            }
            // a class is a part of the image: it resolves less of itself
            compare(
                case.name,
                &format!("{what} {class}"),
                a,
                b,
                20.0 * case.resolution,
            );
        }
        if what == "path" {
            assert_planted_error_is_seen(case, &other, &bdpt);
        }
    }
    if std::env::var_os("ABBE_TEST_METROPOLIS").is_some() {
        metropolis_agrees(case, (&scene, &settings), &bdpt);
    }
    strategies_agree(
        case.name,
        &bdpt,
        scene.lights.iter().any(abbe::light::Light::is_delta),
    );
    (scene, settings, bdpt)
}

/// Metropolis sampling of the same samples has their mean. Chains of separate batches are
/// independent, so the spread of batches is an honest error; it is larger, for their samples are
/// not.
fn metropolis_agrees(case: &Case, (scene, settings): (&Arc<Scene>, &Settings), bdpt: &Measured) {
    let passes = case.passes[2] * test_scale();
    let settings = with(settings, Pssmlt);
    let found = measure(scene, &settings, case.batches, passes, case.classes);
    compare(
        case.name,
        "pssmlt",
        &found.y,
        &bdpt.y,
        4.0 * case.resolution,
    );
    for (class, (a, b)) in case
        .classes
        .iter()
        .zip(found.classes.iter().zip(&bdpt.classes))
    {
        let what = format!("pssmlt {class}");
        compare(case.name, &what, a, b, 40.0 * case.resolution);
    }
}

/// Every strategy alone, unweighted, estimates the same number for a class.
///
/// A pair of inner vertices that nearly touch contributes without bound (1/d²), so the spread of a
/// few batches says too little about strategies s, t >= 2: they get 3 % of the mean beside their
/// standard error. Where a class has light that camera paths cannot hit, s = 0 misses it by design
/// and is left out.
fn strategies_agree(name: &str, bdpt: &Measured, has_delta_lights: bool) {
    let known: Vec<_> = bdpt
        .strategies
        .iter()
        .filter(|(key, (raw, _))| {
            let finds_all = key.1 > 0 || !has_delta_lights;
            // a strategy with few hits has no standard error to speak of
            finds_all && raw.error <= 0.03 * raw.mean
        })
        .map(|((class, s, t), (raw, _))| (class, *s, *t, *raw))
        .collect();
    let mut compared = 0;
    for &(class, s, t, raw) in &known {
        let relative = |e: &Estimate| e.error / e.mean;
        let best = known
            .iter()
            .filter(|other| other.0 == class && !(other.1 >= 2 && other.2 >= 2))
            .min_by(|a, b| relative(&a.3).total_cmp(&relative(&b.3)));
        let Some(&(_, best_s, best_t, best)) = best else {
            continue;
        };
        if (best_s, best_t) == (s, t) {
            continue;
        }
        compared += 1;
        let unbounded = if s >= 2 && t >= 2 {
            0.03 * best.mean
        } else {
            0.0
        };
        let allowed = LIMIT * raw.error.hypot(best.error) + unbounded;
        assert!(
            (raw.mean - best.mean).abs() < allowed,
            "{name} {class}: strategy ({s}, {t}) alone gives {raw:?}, ({best_s}, {best_t}) gives {best:?}, allowed {allowed:.2e}"
        );
    }
    println!("{name}: {compared} strategies compared");
    assert!(
        compared >= 2,
        "{name}: only {compared} strategies could be compared"
    );
}

/// A closed room about the unit of length, seen from inside.
macro_rules! room {
    ($settings:literal, $contents:literal) => {
        concat!(
            "[render]\n",
            $settings,
            r#"
[[sensor]]
resolution = [16, 16]
filter = "gaussian"
perspective = { eye = [0, 1, 0.95], target = [0, 0.9, 0], fov_deg = 80, aperture_radius = 0.02, focus_distance = 1 }
[material.white]
diffuse = { reflectance = 0.6 }
[material.red]
diffuse = { reflectance = [0.6, 0.1, 0.1] }
[material.glass]
dielectric = {}
[material.rough]
dielectric = { roughness = 0.3 }
[material.metal]
conductor = { metal = "Au", roughness = 0.3 }
[material.floor]
mix = [{ weight = 0.5, diffuse = { reflectance = [0.1, 0.6, 0.1] } }, { weight = 0.5, conductor = { metal = "Cu", roughness = 0.2 } }]
[material.half_mirror]
mix = [{ weight = 0.4, mirror = {} }, { weight = 0.5, diffuse = { reflectance = 0.9 } }]
[medium.flint]
glass = "schott:N-SF11"
[medium.crown]
glass = "schott:N-BK7"
absorption = { color = [0.3, 0.8, 0.9], distance = 0.5 }
[[object]]
box = { min = [-1, 0, -1], max = [1, 2, 1] }
material = "white"
"#,
            $contents
        )
    };
}

#[test]
fn diffuse_room_with_large_and_small_light() {
    run(&Case {
        name: "diffuse room",
        text: room!(
            "max_depth = 4",
            r#"
[[object]]
sphere = { center = [0.3, 0.4, 0], radius = 0.4 }
material = "red"
[[object]]
quad = { center = [0, 1.98, 0], u = [0.5, 0, 0], v = [0, 0, 0.5] }
emission = 5
[[object]]
sphere = { center = [-0.6, 0.6, 0.3], radius = 0.1 }
material = "white"
emission = { name = "D65", luminance = 4 }
"#
        ),
        batches: 16,
        passes: [230, 210, 110],
        classes: &["LE", "LDE", "LDDE", "LDDDE"],
        specular_in_view: false,
        resolution: 1.5e-3,
    });
}

#[test]
fn interpolated_normals_and_rough_metal() {
    run(&Case {
        name: "interpolated normals",
        text: room!(
            "max_depth = 4",
            r#"
[[object]]
mesh = { obj = "assets/smooth_sphere.obj" }
transform = [{ scale = [0.5, 0.4, 0.5] }, { translate = [-0.3, 0.5, -0.2] }]
material = "white"
[[object]]
mesh = { obj = "assets/smooth_sphere.obj" }
transform = [{ scale = 0.3 }, { translate = [0.5, 0.4, 0.2] }]
material = "metal"
[[object]]
quad = { center = [0, 1.98, 0], u = [0.6, 0, 0], v = [0, 0, 0.6] }
emission = 5
"#
        ),
        batches: 16,
        passes: [80, 340, 90],
        classes: &["LDE", "LDDE"],
        specular_in_view: false,
        resolution: 1.5e-3,
    });
}

#[test]
fn dispersive_and_absorbing_glass_under_a_large_light() {
    run(&Case {
        name: "dispersion",
        text: room!(
            "max_depth = 6",
            r#"
[[object]]
sphere = { center = [0.35, 0.45, 0.1], radius = 0.4 }
material = "glass"
interior = "flint"
[[object]]
box = { min = [-0.3, -0.3, -0.3], max = [0.3, 0.3, 0.3] }
transform = [{ rotate = { axis = [0.3, 1, 0], deg = 30 } }, { translate = [-0.45, 0.5, 0] }]
material = "glass"
interior = "crown"
[[object]]
quad = { center = [0, 1.98, 0], u = [0.8, 0, 0], v = [0, 0, 0.8] }
emission = 3
"#
        ),
        batches: 16,
        passes: [140, 40, 56],
        classes: &["LDE", "LDDE", "LDSSE"],
        specular_in_view: true,
        resolution: 2.5e-3,
    });
}

#[test]
fn rough_dispersive_glass() {
    run(&Case {
        name: "rough glass",
        text: room!(
            "max_depth = 5",
            r#"
[[object]]
sphere = { center = [0, 0.6, 0], radius = 0.5 }
material = "rough"
interior = "flint"
[[object]]
quad = { center = [0, 1.98, 0], u = [0.6, 0, 0], v = [0, 0, 0.6] }
emission = 4
"#
        ),
        batches: 16,
        passes: [75, 530, 64],
        classes: &["LDE", "LDDE", "LDDDE"],
        specular_in_view: false,
        resolution: 2e-3,
    });
}

#[test]
fn mixtures_of_lobes() {
    run(&Case {
        name: "mixtures",
        text: room!(
            "max_depth = 4",
            r#"
[[object]]
quad = { center = [0, 0.02, 0], u = [0, 0, 0.9], v = [0.9, 0, 0] }
material = "floor"
[[object]]
quad = { center = [-0.5, 0.6, -0.5], u = [0.4, 0, -0.1], v = [0, 0.5, 0] }
material = "half_mirror"
[[object]]
quad = { center = [0, 1.98, 0], u = [0.7, 0, 0], v = [0, 0, 0.7] }
emission = 4
"#
        ),
        batches: 16,
        passes: [70, 45, 30],
        classes: &["LDE", "LDDE", "LDSE", "LSDE"],
        specular_in_view: true,
        resolution: 2e-3,
    });
}

#[test]
fn environment_and_lights_of_every_kind_on_a_detector() {
    run(&Case {
        name: "detector",
        text: r#"
[render]
max_depth = 3
[[sensor]]
resolution = [8, 8]
detector = { center = [0, 0, 0], u = [0.5, 0, 0], v = [0, 0, -0.5] }
[material.white]
diffuse = { reflectance = 0.7 }
[[object]]
quad = { center = [-0.8, 0.6, 0], u = [0, 0, -0.6], v = [0, 0.6, 0] }
material = "white"
[[object]]
sphere = { center = [0.6, 0.7, 0], radius = 0.2 }
material = "white"
[[object]]
disk = { center = [0, 1.5, 0], normal = [0, -1, 0], radius = 0.3 }
emission = 3
[[light]]
environment = { radiance = 0.3 }
[[light]]
point = { position = [0.3, 0.9, 0.5], intensity = 0.3 }
[[light]]
spot = { position = [-0.3, 1.2, 0.4], direction = [0.2, -1, 0], inner_deg = 10, outer_deg = 40, intensity = 1 }
[[light]]
directional = { direction = [0.3, -1, 0.2], irradiance = 0.5 }
[[light]]
beam = { position = [0, 2, 0.2], direction = [-0.1, -1, 0], radius = 0.2, irradiance = 2 }
"#,
        batches: 16,
        passes: [800, 3300, 500],
        classes: &["LE", "LDE", "LDDE"],
        specular_in_view: false,
        resolution: 1.5e-3,
    });
}

#[test]
fn nested_media() {
    run(&Case {
        name: "nested media",
        text: room!(
            "max_depth = 8",
            r#"
[medium.water]
ior = 1.33
[[object]]
box = { min = [-0.5, 0.2, -0.4], max = [0.5, 1.0, 0.4] }
material = "rough"
interior = "water"
[[object]]
sphere = { center = [0.2, 0.6, 0], radius = 0.5 }
material = "rough"
interior = "crown"
priority = 2
[[object]]
sphere = { center = [0.2, 0.6, 0], radius = 0.2 }
material = "red"
[[object]]
quad = { center = [0, 1.98, 0], u = [0.8, 0, 0], v = [0, 0, 0.8] }
emission = 3
"#
        ),
        batches: 16,
        passes: [160, 0, 44],
        classes: &["LDE", "LDDE", "LDDDE"],
        specular_in_view: false,
        resolution: 2.5e-3,
    });
}
