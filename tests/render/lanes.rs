//! The number of wavelengths per path changes the noise, never the mean.
//!
//! X, Y and Z of 1, 4 and 8 lanes are compared pairwise: 45 comparisons at 4.5 standard errors (p =
//! 7e-6 each, 3e-4 for the family).

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking"
)]

use super::harness::{Estimate, full_crop, scene, test_scale};
use abbe::io::scene_file::load;
use abbe::math::hash::combine;
use abbe::render::{OutputRequest, Render};
use abbe::scene::{Scene, Settings};
use std::path::Path;
use std::sync::Arc;

const LIMIT: f64 = 4.5;

/// Images of independent seeds, with `lanes` wavelengths per path.
fn images(
    scene: &Arc<Scene>,
    settings: &Settings,
    lanes: usize,
    batches: u32,
    passes: u32,
) -> Vec<Vec<f64>> {
    (0..batches)
        .map(|batch| {
            let seed = combine(settings.seed, u64::from(batch) + 1);
            let settings = Settings {
                seed,
                lanes,
                ..settings.clone()
            };
            let request = OutputRequest::default();
            let mut render = Render::new(scene, 0, &settings, full_crop(scene), &request);
            (0..passes).for_each(|pass| render.add_pass(pass));
            assert_eq!(render.counters().non_finite, 0);
            render.outputs().image.image(u64::from(passes))
        })
        .collect()
}

/// Mean of one channel over the film.
fn channel(images: &[Vec<f64>], c: usize) -> Estimate {
    let mean = |image: &Vec<f64>| {
        let values = image.iter().skip(c).step_by(3);
        values.sum::<f64>() / (image.len() / 3) as f64
    };
    Estimate::from_batches(&images.iter().map(mean).collect::<Vec<_>>())
}

/// `passes` for 1, 4 and 8 lanes; `resolution`: largest standard error of a difference, as a share
/// of the mean.
fn agree(name: &str, text: &str, passes: [u32; 3], resolution: f64) {
    let (scene, settings) = scene(text);
    let found: Vec<[Estimate; 3]> = [1, 4, 8]
        .into_iter()
        .zip(passes)
        .map(|(lanes, passes)| {
            let images = images(&scene, &settings, lanes, 16, passes * test_scale());
            [0, 1, 2].map(|c| channel(&images, c))
        })
        .collect();
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        for c in 0..3 {
            let (p, q) = (&found[a][c], &found[b][c]);
            let error = p.error.hypot(q.error) / (0.5 * (p.mean + q.mean));
            let what = format!("{name}, {} of lane counts {a} and {b}", ["X", "Y", "Z"][c]);
            println!(
                "{what}: {:.9} {:.9}, error {error:.1e}, {:.1} sigma",
                p.mean,
                q.mean,
                p.deviation(q)
            );
            assert!(
                error < resolution,
                "{what}: standard error {error:.1e} of the mean, wanted {resolution:.0e}"
            );
            assert!(p.deviation(q) < LIMIT, "{what}: {p:?} and {q:?}");
        }
    }
}

const VIEW: &str = r#"
[render]
max_depth = 6
[[sensor]]
resolution = [12, 12]
perspective = { eye = [0, 1.5, 4], target = [0, 0.5, 0], fov_deg = 40 }
[medium.flint]
glass = "schott:N-SF66"
[medium.amber]
glass = "schott:N-SF66"
absorption = { color = [0.8, 0.4, 0.1], distance = 0.5 }
[material.white]
diffuse = { reflectance = 0.7 }
[material.clear]
dielectric = {}
[material.frost]
dielectric = { roughness = 0.25 }
[material.partly]
mix = [{ weight = 0.4, dielectric = {} }, { weight = 0.3, dielectric = { roughness = 0.4 } }, { weight = 0.3, diffuse = { reflectance = [0.9, 0.5, 0.2] } }]
[[object]]
quad = { center = [0, 0, 0], u = [0, 0, 3], v = [3, 0, 0] }
material = "white"
"#;

fn ball(material: &str, medium: &str) -> String {
    format!(
        "[[object]]\nsphere = {{ center = [0, 0.7, 0], radius = 0.6 }}\nmaterial = \"{material}\"\ninterior = \"{medium}\"\n"
    )
}

fn lamp(emission: &str) -> String {
    format!(
        "[[object]]\nsphere = {{ center = [0.6, 2.6, 0.3], radius = 0.5 }}\nmaterial = \"white\"\nemission = {emission}\n"
    )
}

#[test]
fn smooth_dispersive_glass() {
    agree(
        "clear",
        &[VIEW, &ball("clear", "flint"), &lamp("\"D65\"")].concat(),
        [150, 80, 80],
        0.015,
    );
}

#[test]
fn rough_dispersive_glass() {
    agree(
        "frost",
        &[VIEW, &ball("frost", "flint"), &lamp("\"D65\"")].concat(),
        [150, 80, 80],
        0.015,
    );
}

#[test]
fn line_lamps_whose_wavelengths_coincide() {
    agree(
        "lines",
        &[VIEW, &ball("clear", "flint"), &lamp("\"Hg\"")].concat(),
        [150, 80, 80],
        0.02,
    );
}

#[test]
fn mixtures_of_smooth_and_rough() {
    agree(
        "mixture",
        &[VIEW, &ball("partly", "flint"), &lamp("\"D65\"")].concat(),
        [150, 80, 80],
        0.015,
    );
}

#[test]
fn absorbing_glass() {
    agree(
        "absorption",
        &[VIEW, &ball("clear", "amber"), &lamp("\"D65\"")].concat(),
        [150, 80, 80],
        0.015,
    );
}

/// A wall and a sky behind dispersive glass, lit from the camera's side.
const BEHIND: &str = r#"
[render]
max_depth = 6
[[sensor]]
resolution = [16, 16]
perspective = { eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 28 }
[medium.flint]
glass = "schott:N-SF11"
[material.clear]
dielectric = {}
[material.wall]
diffuse = { reflectance = 0.5 }
[[object]]
quad = { center = [2.5, 0, -3], u = [3, 0, 0], v = [0, 6, 0] }
material = "wall"
[[object]]
disk = { center = [4, 4, 2], normal = [-4, -4, -5], radius = 0.4 }
emission = { name = "D65", luminance = 800 }
[[light]]
environment = { radiance = 5e-5 }
"#;

fn big_ball() -> String {
    "[[object]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"clear\"\ninterior = \"flint\"\n"
        .to_owned()
}

#[test]
fn wall_and_sky_behind_a_ball_and_a_block() {
    let block = "[[object]]\nbox = { min = [-0.7, -0.7, -0.4], max = [0.7, 0.7, 0.4] }\ntransform = [{ rotate = { axis = [1, 2, 0], deg = 35 } }]\nmaterial = \"clear\"\ninterior = \"flint\"\n";
    for (name, glass) in [("ball", big_ball()), ("block", block.to_owned())] {
        agree(name, &[BEHIND, &glass].concat(), [150, 80, 80], 0.015);
    }
}

#[test]
fn wavelengths_that_leave_the_film_or_are_hidden() {
    // a film about as wide as the spectrum of a point of the wall, with a bar across it before the
    // ball: of some chains from a point the film has few, and of those the bar hides some
    let view = BEHIND
        .replace("fov_deg = 28", "fov_deg = 0.6")
        .replace("target = [0, 0, 0]", "target = [0.35, 0, 0]");
    let bar = "[[object]]\nquad = { center = [0.175, 0, 2], u = [0.003, 0, 0], v = [0, 0.1, 0] }\nmaterial = \"wall\"\n";
    let text = [&view, &*big_ball(), bar].concat();
    agree("narrow", &text, [150, 80, 80], 0.015);
}

#[test]
fn wavelengths_go_on_together_behind_dispersive_glass() {
    // a wall alone, and the ball alone on the film
    let text = BEHIND
        .replace("fov_deg = 28", "fov_deg = 22")
        .replace("center = [2.5, 0, -3]", "center = [0, 0, -3]");
    let (scene, settings) = scene(&[&text, &*big_ball()].concat());
    let [one, four] = [1, 4].map(|lanes| {
        let all = chroma_variance(&images(&scene, &settings, lanes, 16, 4));
        all.iter().sum::<f64>()
    });
    println!("chroma variance of 4 lanes: {:.4} of that of 1", four / one);
    // variances of 16 images in 256 pixels: 2 % each
    assert!(four <= 0.1 * one, "{four} {one}");
}

/// Variance of X - Y and Z - Y between images, per pixel.
fn chroma_variance(images: &[Vec<f64>]) -> Vec<f64> {
    let n = images.len() as f64;
    let variance = |i: usize, c: usize| {
        let values: Vec<f64> = images.iter().map(|m| m[3 * i + c] - m[3 * i + 1]).collect();
        let mean = values.iter().sum::<f64>() / n;
        values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)
    };
    (0..images[0].len() / 3)
        .map(|i| variance(i, 0) + variance(i, 2))
        .collect()
}

#[test]
fn four_lanes_have_far_less_chroma_noise_than_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.toml");
    let small = [("sensor.0.resolution".to_owned(), "[24, 24]".to_owned())];
    let loaded = load(&path, &small).unwrap_or_else(|e| panic!("{e}"));
    let scene = Arc::new(Scene::build(loaded.description).unwrap());
    let [one, four] =
        [1, 4].map(|lanes| chroma_variance(&images(&scene, &loaded.settings, lanes, 8, 16)));
    // the median pixel: the few that see a caustic through the dispersive ball have one lane
    // whatever was asked for
    let mut ratios: Vec<f64> = one
        .iter()
        .zip(&four)
        .map(|(one, four)| four / one)
        .collect();
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    println!("chroma variance of 4 lanes: {median:.3} of that of 1");
    assert!(median <= 0.4, "{median}");
}
