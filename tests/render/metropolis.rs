//! Metropolis sampling: the same means as bdpt by class, in camera and detector, with motion,
//! dispersion, splats and pairs; the same bytes whoever renders which passes.
//!
//! Comparisons fail beyond 4.5 standard errors of the difference (p = 7e-6 each), which the spread
//! of independent batches tells.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking"
)]

use super::equality::compare;
use super::harness::{Estimate, Measured, full_crop, measure, scene, test_scale, with};
use abbe::io::part::{self, Resumed, merge_each};
use abbe::render::{Cancel, OutputRequest, PathExpression, Render, Session, SessionOptions};
use abbe::scene::settings::IntegratorKind::{Bdpt, Pssmlt};
use abbe::scene::settings::Metropolis;
use abbe::scene::{Scene, Settings};
use abbe::spectrum::SpectralChannels;
use std::ops::Range;
use std::sync::Arc;

/// A moving sphere of flint over a floor in a room, and a detector in the wall.
const SCENE: &str = r#"
[render]
max_depth = 5
spp = 4
[[sensor]]
resolution = [16, 12]
perspective = { eye = [0, 1.2, 3.4], target = [0, 0.6, 0], fov_deg = 50 }
shutter = [0, 1]
[[sensor]]
resolution = [12, 8]
detector = { center = [0.4, 0.01, 0.6], u = [0.3, 0, 0], v = [0, 0, -0.2] }
[medium.flint]
glass = "schott:N-SF11"
[material.white]
diffuse = { reflectance = 0.6 }
[material.clear]
dielectric = {}
[[object]]
box = { min = [-2, 0, -2], max = [2, 3, 4] }
material = "white"
[[object]]
sphere = { center = [0, 0.6, 0], radius = 0.5 }
material = "clear"
interior = "flint"
motion = [{ keys = [{ time = 0, translate = [-0.3, 0, 0] }, { time = 1, translate = [0.3, 0.2, 0.2] }] }]
[[object]]
quad = { center = [0, 2.9, 0], u = [0.6, 0, 0], v = [0, 0, 0.6] }
emission = { name = "D65", luminance = 5 }
"#;

const CLASSES: [&str; 3] = ["LDE", "LDDE", "LDSSE"];

fn pssmlt(settings: &Settings, mutations: u32, uniform: f64) -> Settings {
    Settings {
        metropolis: Metropolis { mutations, uniform },
        ..with(settings, Pssmlt)
    }
}

fn compare_all(name: &str, found: &Measured, expected: &Measured, resolution: f64) {
    compare(name, "Y", &found.y, &expected.y, resolution);
    for (class, (a, b)) in CLASSES
        .iter()
        .zip(found.classes.iter().zip(&expected.classes))
    {
        assert!(b.mean > 0.0, "{name}: class {class} is empty");
        compare(name, class, a, b, 10.0 * resolution);
    }
}

#[test]
fn pssmlt_has_the_means_of_bdpt() {
    let (scene, settings) = scene(SCENE);
    let (batches, scale) = (16, test_scale());
    let bdpt = measure(
        &scene,
        &with(&settings, Bdpt),
        batches,
        16 * scale,
        &CLASSES,
    );
    // chains from few and from most of the samples, short and long
    for (mutations, uniform, passes) in [(64, 0.1, 2), (16, 0.75, 4)] {
        let settings = pssmlt(&settings, mutations, uniform);
        let found = measure(&scene, &settings, batches, passes * scale, &CLASSES);
        let name = format!("{mutations} mutations, {uniform} uniform");
        compare_all(&name, &found, &bdpt, 0.02);
    }
}

fn part_of(scene: &Arc<Scene>, settings: &Settings, passes: Range<u32>) -> part::Part {
    part::of(&session(scene, settings, passes))
}

fn session(scene: &Arc<Scene>, settings: &Settings, passes: Range<u32>) -> Session {
    let options = SessionOptions {
        passes: Some(passes),
        ..SessionOptions::default()
    };
    let mut session = Session::new(Arc::clone(scene), settings, options).unwrap();
    session.run();
    session
}

#[test]
fn threads_parts_and_resumed_renders_have_the_same_bytes() {
    let (scene, settings) = scene(SCENE);
    let settings = pssmlt(&settings, 32, 0.25);
    let whole = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| part_of(&scene, &settings, 0..5))
    });
    assert!(whole[0] == whole[1]);
    let parts = [3..5, 0..1, 1..3].map(|passes| Ok(part_of(&scene, &settings, passes)));
    assert!(merge_each::<part::PartError>(parts).unwrap() == whole[0]);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part");
    part::write(&path, &part_of(&scene, &settings, 0..2)).unwrap();
    let options = SessionOptions {
        passes: Some(0..5),
        live: true,
        ..SessionOptions::default()
    };
    let mut resumed = Session::new(Arc::clone(&scene), &settings, options).unwrap();
    Resumed::read(&path).unwrap().restore(&mut resumed).unwrap();
    resumed.run();
    assert!(part::of(&resumed) == whole[0]);

    // other chains, other render
    let other = part_of(&scene, &pssmlt(&settings, 33, 0.25), 5..6);
    let [one, _] = whole;
    let error = merge_each::<part::PartError>([Ok(one), Ok(other)]).unwrap_err();
    assert!(error.to_string().contains("settings"), "{error}");
}

#[test]
fn a_cancelled_pass_leaves_nothing_and_is_done_again() {
    let (scene, settings) = scene(SCENE);
    let settings = pssmlt(&settings, 32, 0.25);
    let cancel = Cancel::default();
    let options = SessionOptions {
        passes: Some(0..2),
        live: true,
        cancel: cancel.clone(),
        ..SessionOptions::default()
    };
    let mut session = Session::new(Arc::clone(&scene), &settings, options).unwrap();
    let asked = cancel.clone();
    // 12 rows and 18 chains: in the middle of the chains
    session.observe(move |done| {
        assert_eq!(done.all, 30);
        if done.done == 16 {
            asked.request();
        }
    });
    assert_eq!(session.step().pass, None);
    assert!(
        session
            .render()
            .outputs()
            .image
            .sums()
            .iter()
            .all(|v| *v == 0)
    );
    assert!(session.unfinished().is_none());
    cancel.clear();
    session.observe(|_| {});
    session.run();
    assert!(part::of(&session) == part_of(&scene, &settings, 0..2));
}

/// Sums of layers and classes over the film.
fn totals(render: &Render) -> [f64; 4] {
    let passes = render.passes().len() as u64;
    let outputs = render.outputs();
    let total = |film: &abbe::film::Film| film.image(passes).iter().sum::<f64>();
    let strategies = outputs.strategies.as_ref().unwrap().read().unwrap();
    let [plain, regularized] = outputs.shares.as_ref().unwrap();
    [
        total(&outputs.image),
        strategies.values().map(total).sum(),
        outputs.classes.iter().map(|(_, film)| total(film)).sum(),
        total(plain) + total(regularized),
    ]
}

#[test]
fn layers_add_up_to_the_image_and_spectra_have_what_no_eye_sees() {
    let infrared = SCENE.replace(
        "max_depth = 5",
        "max_depth = 5\nwavelengths = { choice = \"uniform\", range_nm = [500, 1100] }",
    );
    let infrared = infrared.replace("{ name = \"D65\", luminance = 5 }", "5");
    let (scene, settings) = scene(&infrared);
    let settings = pssmlt(&settings, 64, 0.1);
    let request = OutputRequest {
        spectral: Some(SpectralChannels::new([500.0, 1100.0], 2, Vec::new())),
        strategies: true,
        classes: vec![PathExpression::new("L.*E", &scene).unwrap()],
        shares: true,
        class_table: true,
        ..OutputRequest::default()
    };
    let crop = full_crop(&scene);
    let render = |settings: &Settings, passes: u32| {
        let mut render = Render::new(&scene, 0, settings, crop, &request);
        (0..passes).for_each(|pass| render.add_pass(pass));
        render
    };
    let found = render(&settings, 8);
    let [image, layers @ ..] = totals(&found);
    for layer in layers {
        assert!((layer / image - 1.0).abs() < 1e-9, "{layer} of {image}");
    }
    let pixels = crop.pixels() as f64 * 8.0;
    let weighted: f64 = found.table().rows().map(|row| row.1.weighted).sum();
    let y: f64 = found.xyz().iter().skip(1).step_by(3).sum();
    // splats lose at the border what the table does not count
    assert!((weighted * crop.pixels() as f64 / (pixels * y) - 1.0).abs() < 1e-9);
    assert_eq!(found.counters().paths, 8 * crop.pixels());

    // the bin beyond 800 nm, against bdpt: both by halves of the passes
    let bin = |render: &Render| {
        let (_, film) = render.outputs().spectral.as_ref().unwrap();
        film.image(render.passes().len() as u64)
            .iter()
            .skip(1)
            .step_by(2)
            .sum::<f64>()
    };
    let batch = |kind: &Settings, passes| {
        let seeds = (0..8).map(|seed| {
            bin(&render(
                &Settings {
                    seed,
                    ..kind.clone()
                },
                passes,
            ))
        });
        Estimate::from_batches(&seeds.collect::<Vec<_>>())
    };
    let [a, b] = [batch(&settings, 1), batch(&with(&settings, Bdpt), 8)];
    compare("infrared", "bin", &a, &b, 0.2);
}

#[test]
fn errors_are_those_of_independent_chains() {
    // without glass: a caustic would leave the squares of a few seeds to speak for all
    let diffuse = SCENE.replace("\"clear\"\ninterior = \"flint\"", "\"white\"");
    assert!(diffuse.len() < SCENE.len());
    let (scene, settings) = scene(&diffuse);
    let settings = pssmlt(&settings, 64, 0.25);
    let (seeds, passes) = (24, 4);
    let render = |seed: u64| {
        let settings = Settings {
            seed,
            ..settings.clone()
        };
        let crop = full_crop(&scene);
        let mut render = Render::new(&scene, 0, &settings, crop, &OutputRequest::default());
        (0..passes).for_each(|pass| render.add_pass(pass));
        render
    };
    let renders: Vec<Render> = (0..seeds).map(render).collect();
    let y = |render: &Render| -> Vec<f64> { render.xyz().into_iter().skip(1).step_by(3).collect() };
    let images: Vec<Vec<f64>> = renders.iter().map(y).collect();
    let (n, pixels) = (images.len() as f64, images[0].len());
    let mean: Vec<f64> = (0..pixels)
        .map(|i| images.iter().map(|image| image[i]).sum::<f64>() / n)
        .collect();
    let estimated: Vec<f64> = renders
        .iter()
        .zip(&images)
        .map(|(render, image)| {
            assert_eq!(render.chains(), Some(36));
            let error = render.error().unwrap();
            assert!(error.effective_pixels <= 36.0);
            (error.of_all_pixels * image.iter().sum::<f64>() / pixels as f64).powi(2)
        })
        .collect();
    let found: Vec<f64> = images
        .iter()
        .map(|image| {
            let squares = image.iter().zip(&mean).map(|(v, mean)| (v - mean).powi(2));
            squares.sum::<f64>() / pixels as f64 * n / (n - 1.0)
        })
        .collect();
    let [estimated, found] = [estimated, found].map(|v| Estimate::from_batches(&v));
    compare("error", "squared", &estimated, &found, 0.3);

    // two passes have 18 chains: too few to tell
    let short = session(&scene, &settings, 0..2);
    assert!(short.render().error().is_none());
}

#[test]
fn a_detector_has_a_flux_without_an_error() {
    let (scene, settings) = scene(SCENE);
    let flux = |settings: &Settings, passes: u32| {
        let crop = scene.sensors[1].whole_film();
        let mut render = Render::new(&scene, 1, settings, crop, &OutputRequest::default());
        (0..passes).for_each(|pass| render.add_pass(pass));
        render.flux().unwrap().luminous_lm
    };
    let batches = |settings: &Settings, passes: u32| {
        let of = |seed| {
            let total = flux(
                &Settings {
                    seed,
                    ..settings.clone()
                },
                passes,
            );
            assert_eq!(total.error.is_some(), settings.integrator == Bdpt);
            total.value
        };
        Estimate::from_batches(&(0..16).map(of).collect::<Vec<_>>())
    };
    let found = batches(&pssmlt(&settings, 64, 0.2), 4);
    let expected = batches(&with(&settings, Bdpt), 20);
    compare("detector", "flux", &found, &expected, 0.05);
}
