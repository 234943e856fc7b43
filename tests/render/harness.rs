//! Renders small scenes in independent batches, so that every number comes with its standard error.

use abbe::film::{Crop, Film};
use abbe::io::scene_file::parse_str;
use abbe::math::hash::combine;
use abbe::math::named::Named;
use abbe::render::{Choices, OutputRequest, PathExpression, Render};
use abbe::scene::settings::{Heuristic, IntegratorKind, Regularize};
use abbe::scene::{Scene, Settings};
use abbe::spectrum::SpectralChannels;
use rayon::prelude::*;
use regex::Regex;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// A mean with its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

impl Estimate {
    pub fn from_batches(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Self {
            mean,
            error: (variance / n).sqrt(),
        }
    }

    /// The same in another unit.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            mean: self.mean * factor,
            error: self.error * factor,
        }
    }

    /// How many standard errors lie between two estimates.
    pub fn deviation(&self, other: &Self) -> f64 {
        (self.mean - other.mean).abs() / self.error.hypot(other.error)
    }

    /// Fails if the estimate is more than 4.5 standard errors from an exact value (p = 7e-6), or
    /// too coarse to tell.
    pub fn assert_is(&self, what: &str, expected: f64, resolution: f64) {
        println!(
            "{what}: {:.6} for {expected:.6}, standard error {:.1e} of it, at most {resolution:.1e}",
            self.mean,
            self.error / expected.abs()
        );
        assert!(
            self.error <= resolution * expected.abs(),
            "{what}: {self:?} does not resolve {resolution} of {expected}"
        );
        let deviation = (self.mean - expected).abs() / self.error.max(1e-300);
        assert!(
            deviation < 4.5,
            "{what}: {self:?}, expected {expected} ({deviation:.1} standard errors)"
        );
    }
}

/// Multiplies sample counts: `ABBE_TEST_SCALE`.
pub fn test_scale() -> u32 {
    std::env::var("ABBE_TEST_SCALE")
        .ok()
        .and_then(|v| v.parse().ok())
        .unwrap_or(1)
}

/// The weights of `ABBE_TEST_WEIGHTS`.
fn other_weights() -> Option<Heuristic> {
    let weights = std::env::var("ABBE_TEST_WEIGHTS").ok()?;
    Some(Heuristic::named(&weights).expect("a name of weights"))
}

pub fn scene(text: &str) -> (Arc<Scene>, Settings) {
    scene_in(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/render"),
        text,
    )
}

/// A scene whose files lie in `folder`. `ABBE_TEST_WEIGHTS` replaces the weights.
pub fn scene_in(folder: &Path, text: &str) -> (Arc<Scene>, Settings) {
    let mut loaded = parse_str(text, folder).unwrap_or_else(|e| panic!("{e}"));
    // what is compared with exact numbers must ask for a bias to get one
    let regularization = &mut loaded.settings.regularization;
    if regularization.mode == Regularize::Auto {
        regularization.mode = Regularize::Off;
    }
    if let Some(weights) = other_weights() {
        loaded.settings.heuristic = weights;
    }
    (
        Arc::new(Scene::build(loaded.description).unwrap_or_else(|e| panic!("{e}"))),
        loaded.settings,
    )
}

pub fn full_crop(scene: &Scene) -> Crop {
    scene.sensors[0].whole_film()
}

/// Measurement of one series of batches.
#[derive(Debug)]
pub struct Measured {
    /// Mean of Y over the film.
    pub y: Estimate,
    /// Weighted mean of Y per class expression asked for.
    pub classes: Vec<Estimate>,
    /// Raw and weighted mean per (class, s, t).
    pub strategies: BTreeMap<(String, u32, u32), (Estimate, Estimate)>,
}

/// One batch: mean Y, per class, and per strategy (raw, weighted).
type Batch = (f64, Vec<f64>, BTreeMap<(String, u32, u32), (f64, f64)>);

/// Renders `batches` independent images of `passes` passes each, in parallel.
pub fn measure(
    scene: &Arc<Scene>,
    settings: &Settings,
    batches: u32,
    passes: u32,
    classes: &[&str],
) -> Measured {
    measure_under(scene, settings, (batches, passes), classes, |_| ())
}

/// The same, after `change` of what pilots found.
pub fn measure_under(
    scene: &Arc<Scene>,
    settings: &Settings,
    (batches, passes): (u32, u32),
    classes: &[&str],
    change: impl Fn(&mut Choices),
) -> Measured {
    let valid = "invariant: tests give valid expressions";
    let classes: Vec<PathExpression> = classes
        .iter()
        .map(|c| PathExpression::new(&format!("^{c}$"), scene).expect(valid))
        .collect();
    // the table holds what films of the classes would, at less cost; it does not know surfaces
    let needs_films = classes.iter().any(PathExpression::needs_events);
    let request = OutputRequest {
        classes: if needs_films {
            classes.clone()
        } else {
            Vec::new()
        },
        class_table: true,
        ..OutputRequest::default()
    };
    // what pilots find does not depend on the seed
    let first = Render::new(scene, 0, settings, full_crop(scene), &request);
    let mut choices = first.choices().clone();
    if other_weights().is_some() {
        // strategies of small weights are compared alone: all of their shadow rays are needed
        choices.roulette_threshold = 0.0;
    }
    change(&mut choices);
    let all: Vec<Batch> = (0..batches)
        .into_par_iter()
        .map(|batch| {
            one_batch(
                scene,
                settings,
                (batch, &choices, &request),
                passes,
                &classes,
            )
        })
        .collect();
    let y: Vec<f64> = all.iter().map(|b| b.0).collect();
    let per_class: Vec<Vec<f64>> = (0..classes.len())
        .map(|i| all.iter().map(|b| b.1[i]).collect())
        .collect();
    let mut per_strategy: BTreeMap<(String, u32, u32), Vec<(f64, f64)>> = BTreeMap::new();
    for (i, batch) in all.iter().enumerate() {
        for (key, value) in &batch.2 {
            per_strategy
                .entry(key.clone())
                .or_insert_with(|| vec![(0.0, 0.0); all.len()])[i] = *value;
        }
    }
    let split = |values: Vec<(f64, f64)>| {
        let raw: Vec<f64> = values.iter().map(|v| v.0).collect();
        let weighted: Vec<f64> = values.iter().map(|v| v.1).collect();
        (
            Estimate::from_batches(&raw),
            Estimate::from_batches(&weighted),
        )
    };
    Measured {
        y: Estimate::from_batches(&y),
        classes: per_class
            .iter()
            .map(|v| Estimate::from_batches(v))
            .collect(),
        strategies: per_strategy
            .into_iter()
            .map(|(k, v)| (k, split(v)))
            .collect(),
    }
}

fn one_batch(
    scene: &Arc<Scene>,
    settings: &Settings,
    (batch, choices, request): (u32, &Choices, &OutputRequest),
    passes: u32,
    classes: &[PathExpression],
) -> Batch {
    let settings = Settings {
        seed: combine(settings.seed, u64::from(batch) + 1),
        ..settings.clone()
    };
    let crop = full_crop(scene);
    let mut render = Render::with_choices(scene, 0, &settings, crop, request, choices.clone())
        .expect("invariant: choices of another seed fit");
    for pass in 0..passes {
        render.add_pass(pass);
    }
    assert_eq!(
        render.counters().non_finite,
        0,
        "contributions that are not finite"
    );
    assert_eq!(
        render.counters().medium_mismatches,
        0,
        "surfaces met from the wrong medium"
    );
    assert_eq!(
        render.counters().lost_bridges,
        0,
        "chains solved for that their own paths do not count"
    );
    let pixels = crop.pixels() as f64;
    let mean_y = |film: &Film| {
        let image = film.image(u64::from(passes));
        image.iter().skip(1).step_by(3).sum::<f64>() / pixels
    };
    let norm = pixels * f64::from(passes);
    let strategies: BTreeMap<_, _> = render
        .table()
        .rows()
        .map(|(&(class, s, t), row)| {
            let means = (row.raw / norm, row.weighted / norm);
            ((class.to_string(), s, t), means)
        })
        .collect();
    let of_class = |class: &PathExpression| {
        let class = Regex::new(class.source()).expect("compiled before");
        let rows = strategies.iter().filter(|(key, _)| class.is_match(&key.0));
        rows.map(|(_, (_, weighted))| weighted).sum()
    };
    let outputs = render.outputs();
    let of_classes = if classes.iter().any(PathExpression::needs_events) {
        outputs
            .classes
            .iter()
            .map(|(_, film)| mean_y(film))
            .collect()
    } else {
        classes.iter().map(of_class).collect()
    };
    (mean_y(&outputs.image), of_classes, strategies)
}

pub fn with(settings: &Settings, integrator: IntegratorKind) -> Settings {
    Settings {
        integrator,
        ..settings.clone()
    }
}

/// Independent images of one sensor, `[batch][line][pixel]`: the power of each of the scene's
/// emission lines, ascending.
pub fn line_images(
    scene: &Arc<Scene>,
    sensor: usize,
    settings: &Settings,
    batches: u32,
    passes: u32,
) -> Vec<Vec<Vec<f64>>> {
    let lines: Vec<f64> = scene.wavelengths.atoms().map(|atom| atom.0).collect();
    let count = lines.len();
    let crop = scene.sensors[sensor].whole_film();
    let channels = SpectralChannels::new([360.0, 830.0], 0, lines);
    let request = OutputRequest {
        spectral: Some(channels),
        ..OutputRequest::default()
    };
    (0..batches)
        .into_par_iter()
        .map(|batch| {
            let seed = combine(settings.seed, u64::from(batch) + 1);
            let settings = Settings {
                seed,
                ..settings.clone()
            };
            let mut render = Render::new(scene, sensor, &settings, crop, &request);
            for pass in 0..passes {
                render.add_pass(pass);
            }
            assert_eq!(
                render.counters().non_finite,
                0,
                "contributions that are not finite"
            );
            assert_eq!(
                render.counters().medium_mismatches,
                0,
                "surfaces met from the wrong medium"
            );
            let (_, film) = render.outputs().spectral.as_ref().expect("asked for above");
            let image = film.image(u64::from(passes));
            (0..count)
                .map(|line| image.iter().skip(line).step_by(count).copied().collect())
                .collect()
        })
        .collect()
}

/// Mean over the film of the only line of [`line_images`].
pub fn line_mean(
    scene: &Arc<Scene>,
    sensor: usize,
    settings: &Settings,
    batches: u32,
    passes: u32,
) -> Estimate {
    let images = line_images(scene, sensor, settings, batches, passes);
    let means: Vec<f64> = images.iter().map(|image| mean(&image[0])).collect();
    Estimate::from_batches(&means)
}

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Fails unless `value` is `expected` to a relative `tolerance`: for what is free of noise.
pub fn assert_close(what: &str, value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance * expected.abs(),
        "{what}: {value}, expected {expected} within {tolerance:e} of it"
    );
}

/// Y of a unit of power at 555 nm: 1/∫ȳ, with ȳ(555 nm) = 1.
pub const Y_OF_555_NM: f64 = 1.0 / 106.856_895;
