//! Whether connections at specular vertices are made for a sensor, and why.

use super::effects::{Effect, EffectKind};
use super::settings::{Aiming, Regularize, Settings, SingleRule};
use super::{Object, Scene};

/// How specular vertices are connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// By every strategy.
    Mis,
    /// Only where no unbiased strategy exists, by one strategy.
    Single(SingleRule),
}

/// Decision for one sensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decision {
    /// `None`: specular vertices are not connectible.
    pub mode: Option<Mode>,
    /// The element or setting that decided.
    pub reason: Reason,
}

impl Decision {
    /// As an effect of the render.
    #[must_use]
    pub fn effect(&self) -> Effect {
        Effect {
            kind: EffectKind::Regularization,
            on: self.mode.is_some(),
            reason: self.to_string(),
        }
    }
}

/// Why a sensor is regularized or not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The integrator makes no connections.
    NoConnections,
    /// Switched off.
    SwitchedOff,
    /// Paths are held to sequences of surfaces.
    Sequences,
    /// No surface is a mirror or smooth glass.
    NothingSpecular,
    /// Asked for, by [`Mode`].
    AskedFor,
    /// A detector is hit by every class of light paths.
    HittableDetector {
        /// Name.
        detector: String,
    },
    /// Photon merging makes the same paths.
    Merging,
    /// The integrator does not connect two sub-paths.
    OneSubpath,
    /// Chains that are solved for make every path that only a cone would make.
    Chains,
    /// A camera that no light path hits, in a scene with a specular surface.
    Specular {
        /// The first specular object, by name.
        object: String,
        /// The camera, by name.
        camera: String,
    },
}

/// Whether the chains from a light to the first non-specular vertex are solved for on every path.
fn makes_all_by_chains(scene: &Scene, settings: &Settings) -> bool {
    // one of the scattering vertices is not specular
    let longest = (settings.max_depth).map_or(usize::MAX, |depth| depth.saturating_sub(1) as usize);
    settings.aim != Aiming::Off && scene.chains().length_listed() >= longest
}

/// Decides for a sensor.
#[must_use]
pub fn decide(scene: &Scene, sensor: usize, settings: &Settings) -> Decision {
    let off = |reason| Decision { mode: None, reason };
    let on = |mode, reason| Decision {
        mode: Some(mode),
        reason,
    };
    let regularization = &settings.regularization;
    if settings.integrator.only_merges() {
        return off(Reason::NoConnections);
    }
    if regularization.mode == Regularize::Off {
        return off(Reason::SwitchedOff);
    }
    if scene.sequences.is_some() {
        return off(Reason::Sequences);
    }
    let specular = |o: &&Object| scene.material(o.material).has_specular() && o.sensor.is_none();
    let Some(object) = scene.objects.iter().find(specular) else {
        return off(Reason::NothingSpecular);
    };
    match regularization.mode {
        Regularize::Single => on(Mode::Single(regularization.single_rule), Reason::AskedFor),
        Regularize::Mis => on(Mode::Mis, Reason::AskedFor),
        Regularize::Auto | Regularize::Off => {
            let sensor = &scene.sensors[sensor];
            if sensor.camera.is_hittable() {
                let detector = sensor.name.clone();
                off(Reason::HittableDetector { detector })
            } else if settings.integrator.merges() {
                off(Reason::Merging)
            } else if !settings.integrator.connects_pairs() {
                off(Reason::OneSubpath)
            } else if makes_all_by_chains(scene, settings) {
                off(Reason::Chains)
            } else {
                let (object, camera) = (object.name.clone(), sensor.name.clone());
                on(Mode::Mis, Reason::Specular { object, camera })
            }
        }
    }
}
