//! Photon merging: the mean of bidirectional path tracing, by every mode and every technique alone;
//! what it finds that nothing else does; and the bands it draws.
//!
//! Merging is biased by its radius: on the mean of a film by what the disc of radius r covers
//! beyond the edges of a surface. Radii here are chosen so that this stays below `BIAS`, which
//! comes on top of 4.5 standard errors (p = 7e-6 each).

use super::harness::{Estimate, Measured, full_crop, measure, scene, test_scale, with};
use abbe::film::Crop;
use abbe::math::banding::{Axis, banding};
use abbe::math::stats::Moments;
use abbe::render::{OutputRequest, Render};
use abbe::scene::settings::IntegratorKind::{self, Bdpt, Bpm, Ppm, Vcm};
use abbe::scene::settings::{Aiming, Heuristic, Regularize, Sharing};
use abbe::scene::{Scene, Settings};
use std::ops::Range;
use std::sync::Arc;

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
shutter = [0, 1]
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

const MOVING: &str = room!(
    "max_depth = 4\nwavelengths = { line_nm = 550 }\nmerge_radius = 0.03\nsharing = \"stratified\"",
    r#"
[[object]]
sphere = { center = [0, 0.5, 0], radius = 0.3 }
material = "floor"
motion = [{ keys = [{ time = 0, translate = [-0.5, 0, 0] }, { time = 1, translate = [0.5, 0.3, 0] }] }]
[[object]]
sphere = { center = [0, 0.5, 0.3], radius = 0.2 }
material = "glass"
interior = "flint"
motion = [{ keys = [{ time = 0, translate = [0.6, 0, 0] }, { time = 1, translate = [-0.6, 0, 0] }] }]
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
    assert!(
        error <= resolution * b.mean,
        "{what}: {a:?} and {b:?} tell nothing"
    );
    assert!(
        apart < LIMIT * error + BIAS * b.mean,
        "{what}: {a:?} and {b:?}"
    );
}

fn run(
    scene: &Arc<Scene>,
    settings: &Settings,
    kind: IntegratorKind,
    passes: u32,
    classes: &[&str],
) -> Measured {
    measure(
        scene,
        &with(settings, kind),
        8,
        passes * test_scale(),
        classes,
    )
}

/// Every class that merging makes, by each of its merges alone, is what another technique makes of
/// it alone.
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
        let Some(((_, bs, bt), (best, _))) = best else {
            continue;
        };
        compared += 1;
        let allowed = LIMIT * raw.error.hypot(best.error) + 5.0 * BIAS * best.mean;
        assert!(
            (raw.mean - best.mean).abs() < allowed,
            "{what} {class}: merging ({s}, {t}) alone gives {raw:?}, ({bs}, {bt}) gives {best:?}"
        );
    }
    println!("{what}: {compared} merges compared");
    assert!(
        compared >= 3,
        "{what}: only {compared} merges could be compared"
    );
}

#[test]
fn every_mode_has_the_mean_of_bdpt() {
    let (scene, settings) = scene(MIXED);
    let classes = ["LDE", "LDDE", "LDSE"];
    let bdpt = run(&scene, &settings, Bdpt, 40, &classes);
    for (kind, passes) in [(Vcm, 40), (Bpm, 100), (Ppm, 100)] {
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
    let bdpt = run(&scene, &settings, Bdpt, 30, &[]);
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
    for (what, settings, kind, passes) in [
        ("vcm", &settings, Vcm, 8),
        ("vcm, squares", &power, Vcm, 8),
        ("vcm, heroes in turn", &set, Vcm, 24),
        ("ppm", &settings, Ppm, 24),
    ] {
        let merged = run(&scene, settings, kind, passes, &[]);
        agree(what, &merged.y, &bdpt.y, 0.02);
    }
}

#[test]
fn things_that_move_are_merged_at_the_moment_of_the_pass() {
    let (scene, settings) = scene(MOVING);
    let bdpt = run(&scene, &settings, Bdpt, 40, &[]);
    for (kind, passes) in [(Vcm, 30), (Bpm, 50), (Ppm, 50)] {
        let merged = run(&scene, &settings, kind, passes, &[]);
        agree(&format!("moving, {kind:?}"), &merged.y, &bdpt.y, 0.015);
    }
}

#[test]
fn classic_scenes_look_the_same_in_all_modes() {
    for (what, text) in [
        (
            "ceiling",
            include_str!("../../scenes/smallvcm_ceiling.toml"),
        ),
        ("point", include_str!("../../scenes/smallvcm_point.toml")),
        ("sun", include_str!("../../scenes/smallvcm_sun.toml")),
        (
            "background",
            include_str!("../../scenes/smallvcm_background.toml"),
        ),
    ] {
        let text = text.replace("resolution = [512, 512]", "resolution = [24, 24]");
        let (scene, mut settings) = scene(&text);
        settings.merging.radius = Some(0.02);
        settings.merging.sharing = Sharing::Stratified;
        let bdpt = run(&scene, &settings, Bdpt, 8, &[]);
        // a glossy floor is hard for merging alone
        for (kind, passes, resolution) in [(Vcm, 4, 0.05), (Bpm, 48, 0.12), (Ppm, 90, 0.12)] {
            let merged = run(&scene, &settings, kind, passes, &[]);
            agree(&format!("{what}, {kind:?}"), &merged.y, &bdpt.y, resolution);
        }
    }
}

#[test]
fn rough_dispersive_glass_is_merged_by_the_sum_over_whole_paths() {
    let (scene, settings) = scene(ROUGH);
    let bdpt = run(&scene, &settings, Bdpt, 30, &[]);
    let vcm = run(&scene, &settings, Vcm, 20, &[]);
    agree("rough glass", &vcm.y, &bdpt.y, 0.015);
}

#[test]
fn paths_between_specular_surfaces_are_merged_and_regularized_alike() {
    let text = include_str!("../../scenes/bench/sds_point.toml")
        .replace("resolution = [400, 300]", "resolution = [48, 36]");
    let (scene, settings) = scene(&text);
    let crop = full_crop(&scene);
    let mean = |kind, mode, aim, passes| {
        let mut settings = with(&settings, kind);
        settings.aim = aim;
        settings.regularization.mode = mode;
        settings.regularization.epsilon = Some(0.02);
        settings.merging.radius = Some(0.08);
        let batches: Vec<f64> = (0..6)
            .map(|seed| {
                settings.seed = seed;
                mean_y(&scene, &settings, crop, passes)
            })
            .collect();
        Estimate::from_batches(&batches)
    };
    let sampled = mean(Bdpt, Regularize::Off, Aiming::Off, 4);
    assert_eq!(sampled.mean, 0.0, "no sampled strategy makes these paths");
    let merged = mean(Vcm, Regularize::Off, Aiming::Off, 12);
    let regularized = mean(Bdpt, Regularize::Mis, Aiming::Off, 240);
    let hybrid = mean(Vcm, Regularize::Mis, Aiming::Off, 12);
    let solved = mean(Bdpt, Regularize::Off, Aiming::Auto, 4);
    assert!(merged.mean > 0.0 && merged.error < 0.03 * merged.mean);
    for (what, other) in [
        ("regularized", regularized),
        ("both", hybrid),
        ("solved", solved),
    ] {
        let error = merged.error.hypot(other.error);
        // merging and cones blur, which moves little over the border of the film
        let allowed = LIMIT * error + 0.01 * merged.mean;
        assert!(
            (merged.mean - other.mean).abs() < allowed,
            "{what}: {other:?}, merged {merged:?}"
        );
        assert!(error < 0.1 * merged.mean, "{what}: {other:?} tells nothing");
    }
}

fn mean_y(scene: &Arc<Scene>, settings: &Settings, crop: Crop, passes: u32) -> f64 {
    let mut render = Render::new(scene, 0, settings, crop, &OutputRequest::default());
    (0..passes).for_each(|pass| render.add_pass(pass));
    let image = render.outputs().image.image(u64::from(passes));
    image.iter().skip(1).step_by(3).sum::<f64>() / crop.pixels() as f64
}

fn image(scene: &Arc<Scene>, settings: &Settings, passes: u32) -> Vec<f64> {
    let mut render = Render::new(
        scene,
        0,
        settings,
        full_crop(scene),
        &OutputRequest::default(),
    );
    (0..passes).for_each(|pass| render.add_pass(pass));
    render.outputs().image.image(u64::from(passes))
}

/// Mean square error of Y relative to the reference, over seeds.
fn square_errors(
    scene: &Arc<Scene>,
    settings: &Settings,
    (passes, seeds): (u32, u64),
    reference: &[f64],
) -> Moments {
    let mut errors = Moments::default();
    for seed in 1..=seeds {
        let found = image(
            scene,
            &Settings {
                seed,
                ..settings.clone()
            },
            passes,
        );
        let square = |(a, b): (&f64, &f64)| (a - b).powi(2) / (b * b);
        let mut squares: Vec<f64> = channel(&found, 1)
            .iter()
            .zip(reference)
            .map(square)
            .collect();
        // without the worst hundredth of the pixels: single photons that weigh much decide their
        // mean
        squares.sort_by(f64::total_cmp);
        squares.truncate(squares.len() - squares.len() / 100);
        errors.push(squares.iter().sum::<f64>() / squares.len() as f64);
    }
    errors
}

#[test]
fn the_error_falls_with_passes() {
    let (scene, mut settings) = scene(MIXED);
    let reference = channel(&image(&scene, &with(&settings, Bdpt), 500), 1);
    let vcm = with(&settings, Vcm);
    let few = square_errors(&scene, &vcm, (2, 4), &reference).mean;
    let many = square_errors(&scene, &vcm, (64, 2), &reference).mean;
    // the variance of strategies that merge nothing falls 32-fold, that of merging 32^(2/3) =
    // 10-fold
    println!(
        "mean square error {few:.3e} after 2 passes, {many:.3e} after 64: {:.1}-fold",
        few / many
    );
    assert!(few / many > 8.0, "{few} and {many}");

    // with merging alone both shares fall as N^(-2/3): the variance by the mean of r^(-2) over N,
    // the squared bias by the square of the mean of r^2. For finite N the sums themselves say how
    // fast.
    settings.merging.radius = Some(0.1);
    settings.integrator = Ppm;
    let mean = |passes: u32, power: f64| {
        let sum: f64 = (1..=passes).map(|i| f64::from(i).powf(power)).sum();
        sum / f64::from(passes)
    };
    let variance = |passes| mean(passes, 1.0 / 3.0) / f64::from(passes);
    let bias = |passes| mean(passes, -1.0 / 3.0).powi(2);
    let span = f64::ln(96.0 / 6.0);
    let slope = |few: f64, many: f64| (many / few).ln() / span;
    let expected = [slope(variance(6), variance(96)), slope(bias(6), bias(96))];
    let few = square_errors(&scene, &settings, (6, 16), &reference);
    let many = square_errors(&scene, &settings, (96, 4), &reference);
    let found = slope(few.mean, many.mean);
    let relative = |m: &Moments| m.standard_error() / m.mean;
    let error = relative(&few).hypot(relative(&many)) / span;
    println!("slope {found:.3} with a standard error of {error:.3}, expected {expected:.3?}");
    assert!(error < 0.05, "{error} tells nothing");
    assert!(
        found > expected[0] - 4.5 * error && found < expected[1] + 4.5 * error,
        "{found}, expected {expected:?}"
    );
}

fn channel(image: &[f64], c: usize) -> Vec<f64> {
    image.iter().skip(c).step_by(3).copied().collect()
}

/// F-ratios after two passes, of some seeds: with merging the largest of the channels, without it
/// each of them.
fn bands_of_two_passes(
    (scene, settings): (&Arc<Scene>, &Settings),
    reference_passes: u32,
    (region, axis): ((Range<usize>, Range<usize>), Axis),
    channels: &[usize],
    seeds: u64,
) -> (Moments, Moments) {
    let width = full_crop(scene).width() as usize;
    let render = |kind, seed, passes| {
        image(
            scene,
            &Settings {
                seed,
                ..with(settings, kind)
            },
            passes,
        )
    };
    let reference = render(Bdpt, 77, reference_passes);
    let f_ratios = |kind, seed| -> Vec<f64> {
        let found = render(kind, seed, 2);
        let of = |&c: &usize| {
            let expected = channel(&reference, c);
            let found = channel(&found, c);
            let bands = banding(&found, Some(&expected), width, region.clone(), axis);
            bands.expect("noise").f_ratio
        };
        channels.iter().map(of).collect()
    };
    let (mut shared, mut without) = (Moments::default(), Moments::default());
    for seed in 1..=seeds {
        let vcm = f_ratios(Vcm, seed);
        let bdpt = f_ratios(Bdpt, seed);
        println!("seed {seed}: vcm {vcm:.2?}, bdpt {bdpt:.2?}");
        let strongest = vcm.iter().copied().fold(0.0, f64::max);
        assert!(strongest > 4.0, "{vcm:?}");
        shared.push(strongest);
        bdpt.iter().for_each(|&f| without.push(f));
    }
    (shared, without)
}

fn only_merging_has_bands((shared, without): (Moments, Moments)) {
    // two wavelengths, or two moments, are two bands, more or less apart
    assert!(shared.mean > 10.0, "{shared:?}");
    let interval = without.mean - 1.96 * without.standard_error();
    assert!(interval < 1.3 && without.mean < 2.0, "{without:?}");
}

#[test]
fn a_dispersive_lens_has_bands_where_passes_share_their_wavelengths() {
    let text = include_str!("../../scenes/dispersive_lens.toml").replace(
        "resolution = [640, 400]",
        "resolution = [320, 200]\nfilter = \"box\"",
    );
    let (scene, settings) = scene(&text);
    // the apex of the inner, colored border of the ring, where lines of one color are upright
    let apex = ((150..190, 108..124), Axis::X);
    only_merging_has_bands(bands_of_two_passes(
        (&scene, &settings),
        24,
        apex,
        &[0, 1, 2],
        3,
    ));
}

#[test]
fn a_moving_shadow_has_bands_where_passes_share_their_time() {
    let text = include_str!("../../scenes/moving_lens.toml")
        .replace(
            "resolution = [640, 400]",
            "resolution = [160, 100]\nfilter = \"box\"",
        )
        // color shall not play a part
        .replace("spp = 128", "wavelengths = { line_nm = 550 }");
    let (scene, settings) = scene(&text);
    // the far border of the card's shadow, which comes nearer from line to line
    let border = ((80..155, 24..42), Axis::Y);
    only_merging_has_bands(bands_of_two_passes(
        (&scene, &settings),
        48,
        border,
        &[1],
        5,
    ));
}

#[test]
fn merging_gives_the_same_bytes_for_any_threads_and_parts() {
    for (text, kind, sharing) in [
        (DISPERSIVE, Vcm, Sharing::Set),
        (ROUGH, Bpm, Sharing::Hero),
        (MIXED, Ppm, Sharing::Stratified),
    ] {
        let (scene, mut settings) = scene(text);
        settings.integrator = kind;
        settings.merging.sharing = sharing;
        settings.regularization.mode = Regularize::Mis;
        let crop = full_crop(&scene);
        let sums = |threads: usize, parts: &[std::ops::Range<u32>]| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| {
                let mut total: Vec<i128> = Vec::new();
                for part in parts {
                    let mut render =
                        Render::new(&scene, 0, &settings, crop, &OutputRequest::default());
                    part.clone().for_each(|pass| render.add_pass(pass));
                    let found = render.outputs().image.sums();
                    total = if total.is_empty() {
                        found
                    } else {
                        total.iter().zip(found).map(|(a, b)| a + b).collect()
                    };
                }
                total
            })
        };
        let whole = std::slice::from_ref(&(0..3));
        let one = sums(1, whole);
        assert!(one.iter().any(|&v| v != 0));
        assert!(one == sums(3, whole), "{kind:?}: threads");
        assert!(one == sums(2, &[2..3, 0..1, 1..2]), "{kind:?}: parts");
    }
}

#[test]
fn nothing_is_stored_without_merging() {
    let (scene, settings) = scene(MIXED);
    let settings = with(&settings, Bdpt);
    let mut render = Render::new(
        &scene,
        0,
        &settings,
        full_crop(&scene),
        &OutputRequest::default(),
    );
    render.add_pass(0);
    assert_eq!((render.photon_bytes(), render.counters().photons), (0, 0));
    assert!(render.photon_memory().is_none() && render.radius().is_none());
    assert!(render.pass_settings(5).shared.is_none());
}
