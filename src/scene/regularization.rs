//! Whether connections at specular vertices are made for a sensor, and why.

use super::effects::Effect;
use super::settings::{Regularize, Settings, SingleRule};
use super::{Object, Scene};

/// How specular vertices are connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// By every strategy.
    Mis,
    /// Only where no unbiased strategy exists, by one strategy.
    Single(SingleRule),
}

/// What was decided for one sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// `None`: specular vertices are not connectible.
    pub mode: Option<Mode>,
    /// The element or setting that decided.
    pub reason: String,
}

impl Decision {
    /// As an effect of the render.
    #[must_use]
    pub fn effect(&self) -> Effect {
        Effect {
            name: "regularization",
            on: self.mode.is_some(),
            reason: self.reason.clone(),
        }
    }
}

/// Decides for a sensor.
#[must_use]
pub fn decide(scene: &Scene, sensor: usize, settings: &Settings) -> Decision {
    let off = |reason: &str| Decision {
        mode: None,
        reason: reason.to_owned(),
    };
    let regularization = &settings.regularization;
    if settings.integrator.only_merges() {
        return off("the integrator makes no connections");
    }
    if regularization.mode == Regularize::Off {
        return off("switched off");
    }
    let specular = |o: &&Object| scene.material(o.material).has_specular() && o.sensor.is_none();
    let Some(object) = scene.objects.iter().find(specular) else {
        return off("no surface is a mirror or smooth glass");
    };
    match regularization.mode {
        Regularize::Single => Decision {
            mode: Some(Mode::Single(regularization.single_rule)),
            reason: "asked for, only where nothing else makes a path".to_owned(),
        },
        Regularize::Mis => Decision {
            mode: Some(Mode::Mis),
            reason: "asked for".to_owned(),
        },
        Regularize::Auto | Regularize::Off => {
            let sensor = &scene.sensors[sensor];
            if sensor.camera.is_hittable() {
                off(&format!(
                    "detector \"{}\" can be hit by every class of light paths, without bias",
                    sensor.name
                ))
            } else if settings.integrator.merges() {
                off("photon merging makes these paths, too; ask for mis to have both")
            } else if !settings.integrator.connects_pairs() {
                off("only integrators that connect two sub-paths switch it on by themselves")
            } else {
                Decision {
                    mode: Some(Mode::Mis),
                    reason: format!(
                        "object \"{}\" is a mirror or smooth glass, and no light path can hit camera \"{}\"",
                        object.name, sensor.name
                    ),
                }
            }
        }
    }
}
