//! The integrators: which strategies each executes. Nothing else knows their names.

use crate::camera::CameraKind;
use crate::scene::settings::{Aiming, IntegratorKind};
use crate::scene::{Scene, Settings};
use crate::transport::strategies::{Aims, Merge, MergeRule, StrategySet};

/// Probability of trying a pair of inner vertices, where nothing says which is best.
pub const PAIR_PROBABILITY: f64 = 0.25;

/// The strategies that the settings of a render ask for, for one sensor, without regularization and
/// before any photons. `splat_samples`: light sub-paths per pass / pixels of the full film.
#[must_use]
pub fn strategies(
    settings: &Settings,
    splat_samples: f64,
    hittable_sensor: bool,
) -> StrategySet<'_> {
    let none = StrategySet {
        hits: false,
        direct: false,
        direct_to_detector: false,
        splats: false,
        arrivals: false,
        pairs: 0.0,
        merge: None,
        heuristic: settings.heuristic,
        factors: None,
        light_paths: 1.0,
        splat_samples,
        hittable_sensor,
        cone: None,
        single: None,
        bias_weight: 1.0,
        aims: Aims::NONE,
        fans: false,
        tries: None,
        disabled: &settings.disabled,
    };
    let every = StrategySet {
        hits: true,
        direct: true,
        direct_to_detector: true,
        splats: true,
        arrivals: true,
        pairs: settings.pair_probability.unwrap_or(PAIR_PROBABILITY),
        ..none
    };
    let merge = |rule, alone| {
        Some(Merge {
            samples: 0.0,
            rule,
            alone,
        })
    };
    // beside merging: paths that hit, and a detector's view of lights that cannot be hit
    let merged_alone = |rule| StrategySet {
        hits: true,
        direct_to_detector: true,
        arrivals: true,
        merge: merge(rule, true),
        ..none
    };
    let mut strategies = match settings.integrator {
        IntegratorKind::Path => StrategySet {
            hits: true,
            direct: true,
            direct_to_detector: true,
            ..none
        },
        IntegratorKind::Light => StrategySet {
            splats: true,
            arrivals: true,
            ..none
        },
        IntegratorKind::Bdpt | IntegratorKind::Pssmlt => every,
        IntegratorKind::Vcm => StrategySet {
            merge: merge(MergeRule::Every, false),
            ..every
        },
        IntegratorKind::Bpm => merged_alone(MergeRule::Every),
        IntegratorKind::Ppm => merged_alone(MergeRule::FirstFromSensor),
    };
    if !settings.integrator.merges() {
        strategies.set_light_paths(settings.light_paths.unwrap_or(1.0));
    }
    strategies
}

/// Whether camera sub-paths go on with all wavelengths from the first rough vertex behind
/// dispersion: by default in the sum of all strategies, where the way from the sensor is known to
/// be open or not.
#[must_use]
pub fn fans(settings: &Settings, scene: &Scene, sensor: usize) -> bool {
    let camera = &scene.sensors[sensor].camera.kind;
    settings.aim == Aiming::Auto
        && settings.integrator == IntegratorKind::Bdpt
        && matches!(camera, CameraKind::Perspective(_))
        && scene.media.iter().any(|medium| medium.ior.is_dispersive())
        && !scene.has_coverage
        && scene.sequences.is_none()
}

/// The chains that are solved for: none with merging. By default only in the sum of all strategies,
/// and those that lead to where no other leads well: a vertex behind what is specular seen through
/// what is specular.
#[must_use]
pub fn aims(settings: &Settings, scene: &Scene, sensor: usize) -> Aims {
    let integrator = settings.integrator;
    let is_on = match settings.aim {
        Aiming::Off => false,
        Aiming::Auto => matches!(integrator, IntegratorKind::Bdpt | IntegratorKind::Pssmlt),
        Aiming::All => !integrator.merges(),
    };
    // a chain from a point of a detector would land elsewhere than on that point's pixel
    let is_far = scene.sensors[sensor].camera.far_field().is_some();
    // a chain is drawn by its surfaces, whatever sequence the sample has
    if !is_on || is_far || scene.sequences.is_some() || scene.chains().kinds().is_empty() {
        return Aims::NONE;
    }
    let camera = &scene.sensors[sensor].camera.kind;
    let from_light = integrator != IntegratorKind::Path;
    let from_camera = integrator != IntegratorKind::Light;
    let can_splat = from_light && matches!(camera, CameraKind::Perspective(_));
    let all = settings.aim == Aiming::All;
    Aims {
        light: from_camera,
        sensor: can_splat,
        through: can_splat,
        light_everywhere: all,
        sensor_everywhere: all,
    }
}
