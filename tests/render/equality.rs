//! path = light = bdpt, in total and per path class, and every strategy alone.
//!
//! A comparison resolves 0.15 % of the mean unless its scene says otherwise and fails beyond 4.5 standard errors of the difference
//! (p = 7e-6 each; with the fewer than 60 comparisons here p = 4e-4 for the family). Every scene also shows that a 2 % error in
//! the weight of its main strategy would have been seen.

use super::harness::{Estimate, Measured, measure, scene, test_scale, with};
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path};

struct Case {
    name: &'static str,
    text: &'static str,
    batches: u32,
    /// Passes of path, light, bdpt.
    passes: [u32; 3],
    classes: &'static [&'static str],
    /// Largest standard error of a difference, as a share of the mean.
    resolution: f64,
}

const LIMIT: f64 = 4.5;

fn compare(name: &str, what: &str, a: &Estimate, b: &Estimate, resolution: f64) {
    let error = a.error.hypot(b.error);
    let mean = 0.5 * (a.mean + b.mean);
    println!("{name} {what}: {:.6} and {:.6}, standard error {:.2e} of the mean", a.mean, b.mean, error / mean);
    assert!(error <= resolution * mean, "{name} {what}: standard error {:.2e} of the mean, wanted {resolution:.1e}", error / mean);
    let deviation = a.deviation(b);
    assert!(deviation < LIMIT, "{name} {what}: {a:?} and {b:?} are {deviation:.1} standard errors apart");
}

/// A 2 % error planted in the weight of the strategy that carries most must be seen.
fn assert_planted_error_is_seen(name: &str, reference: &Estimate, bdpt: &Measured) {
    let (key, (_, most)) = bdpt
        .strategies
        .iter()
        .max_by(|a, b| a.1.1.mean.total_cmp(&b.1.1.mean))
        .expect("invariant: a lit scene has strategies");
    let planted = Estimate { mean: bdpt.y.mean + 0.02 * most.mean, error: bdpt.y.error };
    let moved = 0.02 * most.mean / reference.error.hypot(bdpt.y.error);
    println!("{name}: 2 % in {key:?} is {moved:.1} standard errors");
    assert!(
        planted.deviation(reference) > LIMIT || moved > LIMIT,
        "{name}: a 2 % error in the weight of {key:?} moves the mean by only {moved:.1} standard errors"
    );
}

fn run(case: &Case) {
    let (scene, settings) = scene(case.text);
    let scale = test_scale();
    let [path, light, bdpt] = [(Path, case.passes[0]), (Light, case.passes[1]), (Bdpt, case.passes[2])].map(
        |(kind, passes)| {
            (passes > 0).then(|| measure(&scene, &with(&settings, kind), case.batches, passes * scale, case.classes))
        },
    );
    let bdpt = bdpt.expect("invariant: every case runs bdpt");
    for (what, other) in [("path", path), ("light", light)] {
        let Some(other) = other else { continue };
        compare(case.name, what, &other.y, &bdpt.y, case.resolution);
        for (class, (a, b)) in case.classes.iter().zip(other.classes.iter().zip(&bdpt.classes)) {
            assert!(b.mean > 0.0, "{}: class {class} is empty", case.name);
            // a class is a part of the image: it resolves less of itself
            compare(case.name, &format!("{what} {class}"), a, b, 20.0 * case.resolution);
        }
        if what == "path" || case.passes[0] == 0 {
            assert_planted_error_is_seen(case.name, &other.y, &bdpt);
        }
    }
    strategies_agree(case.name, &bdpt);
}

/// Every strategy alone, unweighted, estimates the same number for a class.
fn strategies_agree(name: &str, bdpt: &Measured) {
    let mut compared = 0;
    for ((class, s, t), (raw, _)) in &bdpt.strategies {
        // the strategy that knows the class best
        let best = bdpt
            .strategies
            .iter()
            .filter(|(key, _)| key.0 == *class)
            .min_by(|a, b| (a.1.0.error / a.1.0.mean).total_cmp(&(b.1.0.error / b.1.0.mean)))
            .map(|(key, value)| (key, value.0))
            .expect("invariant: the class has this strategy");
        // a strategy with few hits has no standard error to speak of
        if (best.0.1, best.0.2) == (*s, *t) || raw.error > 0.1 * raw.mean {
            continue;
        }
        compared += 1;
        let deviation = raw.deviation(&best.1);
        assert!(
            deviation < LIMIT,
            "{name} {class}: strategy ({s}, {t}) alone gives {raw:?}, {:?} gives {:?}: {deviation:.1} standard errors",
            best.0,
            best.1
        );
    }
    println!("{name}: {compared} strategies compared");
    assert!(compared >= 2, "{name}: only {compared} strategies could be compared");
}

#[test]
fn diffuse_box_with_large_and_small_light() {
    run(&Case {
        name: "box",
        text: BOX,
        batches: 16,
        passes: [60, 200, 24],
        classes: &["LDE", "LDDE", "LDDDE"],
        resolution: 1.5e-3,
    });
}

const BOX: &str = r#"
[render]
max_depth = 5
[[sensor]]
resolution = [16, 16]
filter = "gaussian"
perspective = { eye = [0, 1, 0.95], target = [0, 0.9, 0], fov_deg = 80 }
[material.white]
diffuse = { reflectance = 0.7 }
[material.red]
diffuse = { reflectance = [0.6, 0.1, 0.1] }
[[object]]
box = { min = [-1, 0, -1], max = [1, 2, 1] }
material = "white"
[[object]]
sphere = { center = [0.3, 0.4, 0], radius = 0.4 }
material = "red"
[[object]]
quad = { center = [0, 1.98, 0], u = [0.5, 0, 0], v = [0, 0, 0.5] }
emission = 5
[[object]]
sphere = { center = [-0.6, 0.6, 0.3], radius = 0.05 }
material = "white"
emission = "D65"
"#;
