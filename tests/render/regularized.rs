//! Directional regularization: each strategy alone, the weighted sum, lanes through dispersive
//! glass, what only it can see.
//!
//! Strategies that join at specular vertices are compared raw (unweighted) with the unbiased mean:
//! at half-apertures for which the squared-law bias is below what the sample count resolves (1 %; 2
//! % of paths with two specular vertices; 10 % of joints at both). Limits are 4.5 standard errors
//! (p = 7e-6 each).

use super::harness::{full_crop, measure, scene, test_scale, with};
use abbe::render::{OutputRequest, Render};
use abbe::scene::Settings;
use abbe::scene::settings::Regularize::{Mis, Off, Single};
use abbe::scene::settings::{Aiming, IntegratorKind, Regularization, Regularize};

const LIMIT: f64 = 4.5;

/// With cones of one half-aperture for all passes.
pub fn regularized(settings: &Settings, mode: Regularize, epsilon: f64) -> Settings {
    Settings {
        regularization: Regularization {
            mode,
            epsilon: Some(epsilon),
            epsilon_min: epsilon,
            bias_estimate: Some(false),
            ..settings.regularization
        },
        // what is solved for leaves nothing to regularize
        aim: Aiming::Off,
        ..settings.clone()
    }
}

/// Specular ends of strategy `s` on a path of a class such as `LSSE`.
fn joined_specular(class: &str, s: u32) -> usize {
    let labels: Vec<char> = class.chars().collect();
    let s = s as usize;
    if s == 0 || s == labels.len() {
        0
    } else {
        labels[s - 1..=s].iter().filter(|&&c| c == 'S').count()
    }
}

struct Case {
    name: &'static str,
    text: &'static str,
    class: &'static str,
    epsilon: f64,
    passes: u32,
}

/// Every regularized strategy of the class alone agrees with the unbiased mean.
fn raw_strategies_agree(case: &Case) {
    let (scene, settings) = scene(case.text);
    let passes = case.passes * test_scale();
    // the sum of all strategies is far less noisy than the worst of them alone
    let truth = measure(&scene, &settings, 24, passes.div_ceil(4), &[case.class]).classes[0];
    let settings = regularized(&settings, Mis, case.epsilon);
    let found = measure(&scene, &settings, 24, passes, &[case.class]);
    let mut seen = 0;
    for ((class, s, t), (raw, _)) in &found.strategies {
        let joined = joined_specular(class, *s);
        if class != case.class {
            continue;
        }
        println!(
            "{}: ({s}, {t}) alone {:.4e} ± {:.1e}, unbiased {:.4e} ± {:.1e}",
            case.name, raw.mean, raw.error, truth.mean, truth.error
        );
        let resolution = match (joined, class.len()) {
            (2, _) => 0.1,
            (_, 3) => 0.01,
            _ => 0.02,
        };
        assert!(
            raw.error <= resolution * truth.mean,
            "{}: ({s}, {t}) does not resolve {resolution}",
            case.name
        );
        let deviation = raw.deviation(&truth);
        assert!(
            deviation < LIMIT,
            "{}: ({s}, {t}) alone gives {raw:?}, the unbiased mean is {truth:?}: {deviation:.1} standard errors",
            case.name
        );
        seen += usize::from(joined > 0);
    }
    assert_eq!(
        seen,
        case.class.len() - 1,
        "{}: every joint of the class is made",
        case.name
    );
}

const MIRROR: &str = r#"
[render]
max_depth = 1
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [8, 8]
detector = { center = [0.5, 1, 0], u = [0.2, 0, 0], v = [0, 0, 0.2] }
[material.mirror]
mirror = { reflectance = 0.9 }
[[object]]
quad = { center = [0, 0, 0], u = [9, 0, 0], v = [0, 0, -9] }
material = "mirror"
[[object]]
disk = { center = [-0.5, 1.2, 0], normal = [0, -1, 0], radius = 0.3 }
emission = 1
"#;

#[test]
fn each_strategy_alone_over_a_mirror() {
    raw_strategies_agree(&Case {
        name: "mirror",
        text: MIRROR,
        class: "LSE",
        epsilon: 0.2,
        passes: 1400,
    });
}

const TWO_MIRRORS: &str = r#"
[render]
max_depth = 2
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [8, 8]
detector = { center = [1.2, 1, 0], u = [0.4, 0, 0], v = [0, 0, -0.4] }
[material.mirror]
mirror = {}
[[object]]
quad = { center = [0, 0, 0], u = [9, 0, 0], v = [0, 0, -9] }
material = "mirror"
[[object]]
quad = { center = [0, 2, 0], u = [9, 0, 0], v = [0, 0, 9] }
material = "mirror"
[[object]]
disk = { center = [-1.2, 1.2, 0], normal = [0, -1, 0], radius = 0.5 }
emission = 1
"#;

#[test]
fn each_strategy_alone_between_two_mirrors() {
    raw_strategies_agree(&Case {
        name: "two mirrors",
        text: TWO_MIRRORS,
        class: "LSSE",
        epsilon: 0.2,
        passes: 1000,
    });
}

const INTERFACE: &str = r#"
[render]
max_depth = 1
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [8, 8]
detector = { center = [0, METER, 0], u = [0, 0, 0.4], v = [0.4, 0, 0] }
[medium.glass]
ior = 1.5
[material.clear]
dielectric = {}
[[object]]
box = { min = [-9, -9, -9], max = [9, 0, 9] }
material = "clear"
interior = "glass"
[[object]]
quad = { center = [0, LIGHT }
emission = 1
"#;

#[test]
fn each_strategy_alone_into_glass_and_out_of_it() {
    let into = INTERFACE
        .replace("LIGHT", "0.9, 0], u = [0.5, 0, 0], v = [0, 0, 0.5]")
        .replace("METER", "-0.7");
    let out = INTERFACE
        .replace("LIGHT", "-0.7, 0], u = [0, 0, 0.5], v = [0.5, 0, 0]")
        .replace("METER", "0.9")
        .replace(
            "u = [0, 0, 0.4], v = [0.4, 0, 0]",
            "u = [0.4, 0, 0], v = [0, 0, 0.4]",
        );
    for (name, text) in [("into glass", into), ("out of glass", out)] {
        raw_strategies_agree(&Case {
            name,
            text: text.leak(),
            class: "LSE",
            epsilon: 0.2,
            passes: 1100,
        });
    }
}

/// The weights adapt to what is executed: whichever strategies are missing, the others make the
/// whole class. (One alone has the weight 1: see above.)
#[test]
fn every_subset_of_strategies_has_the_same_mean() {
    let text = INTERFACE
        .replace("LIGHT", "0.9, 0], u = [0.5, 0, 0], v = [0, 0, 0.5]")
        .replace("METER", "-0.7");
    let (scene, settings) = scene(&text);
    let passes = 32 * test_scale();
    let truth = measure(&scene, &settings, 24, 6 * passes, &["LSE"]).classes[0];
    let settings = regularized(&settings, Mis, 0.1);
    for subset in (1..16_u32).filter(|s| s.count_ones() > 1) {
        let disabled = (0..4)
            .filter(|s| subset >> s & 1 == 0)
            .map(|s| (s, 3 - s))
            .collect();
        let settings = Settings {
            disabled,
            ..settings.clone()
        };
        // neither end is hit: cones are all there is, and noisier
        let passes = if subset == 0b0110 {
            12 * passes
        } else {
            passes
        };
        let found = measure(&scene, &settings, 24, passes, &["LSE"]).classes[0];
        let deviation = found.deviation(&truth);
        println!("subset {subset:04b}: {found:?} for {truth:?}, {deviation:.1} standard errors");
        assert!(
            found.error <= 0.02 * truth.mean && deviation < LIMIT,
            "strategies {subset:04b}: {found:?}, the unbiased mean is {truth:?}"
        );
    }
}

const FLINT: &str = r#"
[render]
max_depth = 1
wavelengths = "uniform"
[[sensor]]
resolution = [8, 8]
detector = { center = [0, -0.7, 0], u = [0, 0, 0.4], v = [0.4, 0, 0] }
[medium.flint]
glass = "schott:N-SF11"
use_k = false
[material.clear]
dielectric = {}
[[object]]
box = { min = [-9, -9, -9], max = [9, 0, 9] }
material = "clear"
interior = "flint"
[[object]]
quad = { center = [0.5, 0.9, 0], u = [0.3, 0, 0], v = [0, 0, 0.3] }
emission = 1
"#;

/// All lanes cross the flint at a joint, only the hero's where it is scattered at. A rule that
/// counts what does not deliver would lose a quarter of the energy of the weighted sum here.
#[test]
fn lanes_cross_dispersive_glass() {
    let (scene, settings) = scene(FLINT);
    let passes = 340 * test_scale();
    for lanes in [1, 4, 8] {
        let settings = Settings {
            lanes,
            ..settings.clone()
        };
        let truth = measure(&scene, &settings, 24, passes, &["LSE"]).classes[0];
        let found = measure(
            &scene,
            &regularized(&settings, Mis, 0.2),
            24,
            passes,
            &["LSE"],
        );
        for (key, (raw, _)) in &found.strategies {
            println!("{lanes} lanes, {key:?} alone: {raw:?}, unbiased {truth:?}");
            let allowed = LIMIT * raw.error.hypot(truth.error) + 0.01 * truth.mean;
            assert!(
                raw.error < 0.03 * truth.mean && (raw.mean - truth.mean).abs() < allowed,
                "{lanes} lanes, {key:?} alone: {raw:?}, unbiased {truth:?}"
            );
        }
        // the weights' own bias at this width is a few percent, lost energy would be a quarter
        let total = found.classes[0].mean / truth.mean;
        println!("{lanes} lanes, all: {total}");
        assert!((total - 1.0).abs() < 0.06, "{lanes} lanes: {total}");
        let narrow = measure(
            &scene,
            &regularized(&settings, Mis, 0.02),
            24,
            passes,
            &["LSE"],
        )
        .classes[0];
        let deviation = narrow.deviation(&truth);
        assert!(
            deviation < LIMIT,
            "{lanes} lanes: {narrow:?}, unbiased {truth:?}"
        );
    }
}

const POINT_MIRROR: &str = r#"
[render]
integrator = "path"
max_depth = 1
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [32, 32]
detector = { center = [0, 1, 0], u = [1e-4, 0, 0], v = [0, 0, 1e-4] }
[material.mirror]
mirror = {}
[[object]]
quad = { center = [0, 0, 0], u = [99, 0, 0], v = [0, 0, -99] }
material = "mirror"
[[light]]
point = { position = [0.6, 1.2, 0], intensity = 1 }
"#;

/// Mean squared error of the pixels, which are independent estimates of one number: E = I cosθ/d²
/// of the mirror image.
fn squared_errors(settings: &Settings, counts: &[u32]) -> Vec<f64> {
    let (scene, _) = scene(POINT_MIRROR);
    let d2 = 2.2_f64.powi(2) + 0.6 * 0.6;
    let expected = 2.2 / d2.powf(1.5);
    // Y of one line of unit power is its observer value over that of the equal-energy white
    let unit = abbe::spectrum::xyz::cmf(555.0)[1] / abbe::spectrum::xyz::N_Y;
    let crop = full_crop(&scene);
    let mut sums = vec![0.0; crop.pixels() as usize];
    let mut done = 0;
    counts
        .iter()
        .map(|&count| {
            while done < count {
                // a seed for each pass: stratified passes would converge faster than the law says
                let settings = Settings {
                    seed: u64::from(done),
                    ..settings.clone()
                };
                let request = OutputRequest::default();
                let mut render = Render::new(&scene, 0, &settings, crop, &request);
                render.add_pass(done);
                let image = render.outputs().image.image(1);
                for (sum, y) in sums.iter_mut().zip(image.iter().skip(1).step_by(3)) {
                    *sum += y / unit / expected;
                }
                done += 1;
            }
            let error = |sum: &f64| (sum / f64::from(count) - 1.0).powi(2);
            sums.iter().map(error).sum::<f64>() / sums.len() as f64
        })
        .collect()
}

/// No unbiased strategy of the camera reaches a point light over a mirror. With the schedule the
/// squared error falls as N^(−2/3); with one half-aperture it stays at the square of the bias.
#[test]
fn shrinking_cones_converge_and_constant_ones_do_not() {
    let (_, settings) = scene(POINT_MIRROR);
    let counts = [8, 64, 512];
    let mut shrinking = regularized(&settings, Mis, 0.6);
    shrinking.regularization.epsilon_min = 0.0;
    let errors = squared_errors(&shrinking, &counts);
    let slope = (errors[2] / errors[0]).ln() / (f64::from(counts[2]) / f64::from(counts[0])).ln();
    println!("squared errors {errors:?}, slope {slope:.3}");
    assert!((-0.8..-0.5).contains(&slope), "slope {slope}: {errors:?}");

    // bias b ε² with equal b: the floors of ε and ε/2 differ by 16
    let floor = |epsilon: f64| {
        let errors = squared_errors(&regularized(&settings, Mis, epsilon), &[128, 512]);
        // error² = floor + v/N
        (4.0 * errors[1] - errors[0]) / 3.0
    };
    let (wide, narrow) = (floor(1.2), floor(0.6));
    println!("floors {wide:.3e} and {narrow:.3e}");
    let ratio = wide / narrow;
    assert!((8.0..32.0).contains(&ratio), "floors differ by {ratio}");
}

const BEHIND_GLASS: &str = r#"
[render]
max_depth = 6
[[sensor]]
resolution = [8, 8]
filter = "box"
perspective = { eye = [0, 2.2, 3], target = [0, 0, 0], fov_deg = 30 }
[medium.glass]
ior = 1.5
[material.clear]
dielectric = {}
[material.floor]
diffuse = { reflectance = 0.6 }
[[object]]
quad = { center = [0, 0, 0], u = [9, 0, 0], v = [0, 0, -9] }
material = "floor"
[[object]]
box = { min = [-9, 0.5, -9], max = [9, 0.8, 9] }
material = "clear"
interior = "glass"
LIGHT
"#;

const AREA: &str =
    "[[object]]\nquad = { center = [0, 2, 0], u = [0.4, 0, 0], v = [0, 0, 0.4] }\nemission = 5";
const POINT: &str = "[[light]]\npoint = { position = [0, 2, 0], intensity = 5 }";

/// Where an unbiased image exists, the weighted sum converges to it.
#[test]
fn the_weighted_sum_converges_to_the_unbiased_image() {
    let (scene, settings) = scene(&BEHIND_GLASS.replace("LIGHT", AREA));
    let passes = 300 * test_scale();
    let truth = measure(
        &scene,
        &with(&settings, IntegratorKind::Path),
        24,
        passes,
        &[],
    )
    .y;
    for (epsilon, allowed) in [(0.2, 0.1), (0.05, 0.02), (0.01, 0.0)] {
        let found = measure(
            &scene,
            &regularized(&settings, Mis, epsilon),
            24,
            passes,
            &[],
        )
        .y;
        println!("epsilon {epsilon}: {found:?} for {truth:?}");
        let limit = LIMIT * found.error.hypot(truth.error) + allowed * truth.mean;
        assert!(
            found.error < 0.01 * truth.mean && (found.mean - truth.mean).abs() < limit,
            "epsilon {epsilon}: {found:?}, unbiased {truth:?}"
        );
    }
}

/// A point light behind glass, seen through glass: nothing without cones, something with them, less
/// noise with all strategies.
#[test]
fn a_point_light_behind_glass_is_seen_only_by_regularization() {
    let (scene, settings) = scene(&BEHIND_GLASS.replace("LIGHT", POINT));
    let passes = 60 * test_scale();
    let class = "LSSDSSE";
    let of = |settings: &Settings| measure(&scene, settings, 24, passes, &[class]).classes[0];
    assert_eq!(of(&regularized(&settings, Off, 0.1)).mean, 0.0);
    let all = of(&regularized(&settings, Mis, 0.1));
    let single = of(&regularized(&settings, Single, 0.1));
    println!("mis {all:?}, single {single:?}");
    let deviation = all.deviation(&single);
    assert!(
        deviation < LIMIT && all.error < 0.05 * all.mean,
        "mis {all:?}, single {single:?}"
    );
    assert!(
        all.error < single.error,
        "all strategies together are less noisy than one: {all:?}, {single:?}"
    );
}
