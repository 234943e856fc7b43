//! What a cost report compares: the scene as it is, other methods, the scene without each of its effects, other settings.

use super::super::args::CostGroup;
use super::super::load::{Loaded, integrator_name};
use crate::film::Filter;
use crate::render::{EpsilonChoice, OutputRequest, Render};
use crate::scene::effects::Effect;
use crate::scene::frozen::Frozen;
use crate::scene::regularization::{Decision, decide};
use crate::scene::settings::IntegratorKind;

/// Name of the variant that all others are compared with.
pub const BASE: &str = "scene";
/// Depth that stands for half of no limit.
const HALF_OF_UNLIMITED: u32 = 6;

/// Cones of the reference as a share of those of the scene.
const REFERENCE_CONES: f64 = 0.25;

/// One way to render the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Name in files and tables: letters, digits and hyphens.
    pub id: String,
    /// Name for readers.
    pub label: String,
    /// Which part of the report it belongs to; `None`: the scene as it is.
    pub group: Option<CostGroup>,
    /// Keys of the scene file that differ.
    pub overrides: Vec<(String, String)>,
    /// The effect left out of the scene, where no key does it.
    pub frozen: Option<Frozen>,
}

impl Variant {
    fn new(id: &str, label: &str, group: CostGroup, overrides: &[(&str, &str)]) -> Self {
        let own = |(key, value): &(&str, &str)| (format!("render.{key}"), (*value).to_owned());
        Self {
            id: id.to_owned(),
            label: label.to_owned(),
            group: Some(group),
            overrides: overrides.iter().map(own).collect(),
            frozen: None,
        }
    }

    fn frozen(id: &str, label: &str, frozen: Frozen) -> Self {
        Self {
            frozen: Some(frozen),
            ..Self::new(id, label, CostGroup::Effects, &[])
        }
    }
}

/// What the matrix depends on.
#[derive(Debug)]
pub struct Base<'a> {
    loaded: &'a Loaded,
    sensor: usize,
    regularization: Decision,
    epsilon: Option<EpsilonChoice>,
}

impl<'a> Base<'a> {
    /// The scene as it is, seen by one sensor.
    #[must_use]
    pub fn new(loaded: &'a Loaded, sensor: usize) -> Self {
        let regularization = decide(&loaded.scene, sensor, &loaded.settings);
        let epsilon = regularization.mode.is_some().then(|| {
            let crop = loaded.scene.sensors[sensor].whole_film();
            let request = OutputRequest::default();
            let render = Render::new(&loaded.scene, sensor, &loaded.settings, crop, &request);
            render.epsilon().cloned()
        });
        Self {
            loaded,
            sensor,
            regularization,
            epsilon: epsilon.flatten(),
        }
    }

    fn effect(&self, name: &str) -> bool {
        let on = |e: &Effect| e.name == name && e.on;
        self.loaded.scene.effects.iter().any(on)
    }

    fn regularized(&self) -> bool {
        self.regularization.mode.is_some()
    }

    /// All variants of the groups asked for, the scene as it is first.
    #[must_use]
    pub fn variants(&self, groups: &[CostGroup]) -> Vec<Variant> {
        let mut variants = vec![Variant {
            id: BASE.to_owned(),
            label: self.label(),
            group: None,
            overrides: Vec::new(),
            frozen: None,
        }];
        for group in groups {
            variants.extend(match group {
                CostGroup::Methods => self.methods(),
                CostGroup::Effects => self.effects(),
                CostGroup::Settings => self.settings(),
            });
        }
        variants
    }

    fn label(&self) -> String {
        let mode = if self.regularized() {
            ", regularized"
        } else {
            ""
        };
        let name = integrator_name(self.loaded.settings.integrator);
        format!("the scene as it is ({name}{mode})")
    }

    fn methods(&self) -> Vec<Variant> {
        // a further integrator is a further line here
        let names = ["path", "light", "bdpt", "vcm"];
        let same = |name: &str, regularized: bool| {
            name == integrator_name(self.loaded.settings.integrator)
                && regularized == self.regularized()
        };
        let mut methods = Vec::new();
        for name in names {
            if !same(name, false) {
                let keys = [("integrator", name), ("regularize", "off")];
                methods.push(Variant::new(name, name, CostGroup::Methods, &keys));
            }
            if name == "vcm" {
                let keys = [
                    ("integrator", name),
                    ("regularize", "off"),
                    ("sharing", "stratified"),
                ];
                let (id, label) = ("vcm-stratified", "vcm, stratified passes");
                methods.push(Variant::new(id, label, CostGroup::Methods, &keys));
            }
            if self.effect("specular") && ["bdpt", "vcm"].contains(&name) && !same(name, true) {
                let (id, label) = (format!("{name}-mis"), format!("{name}, regularized"));
                let keys = [("integrator", name), ("regularize", "mis")];
                methods.push(Variant::new(&id, &label, CostGroup::Methods, &keys));
            }
        }
        methods
    }

    fn effects(&self) -> Vec<Variant> {
        let mut effects = Vec::new();
        if self.effect("dispersion") {
            let label = "without dispersion (all indices as at 587.56 nm)";
            effects.push(Variant::frozen("no-dispersion", label, Frozen::Dispersion));
        }
        if self.effect("motion") {
            let label = "without motion (the middle of the shutter)";
            effects.push(Variant::frozen("no-motion", label, Frozen::Motion));
        }
        let group = CostGroup::Effects;
        if self.regularized() {
            let keys = [("regularize", "off")];
            let label = "without regularization";
            effects.push(Variant::new("no-regularization", label, group, &keys));
        }
        let depth = self.loaded.settings.max_depth;
        let half = depth.map_or(HALF_OF_UNLIMITED, |d| d / 2);
        let label = format!("at most {half} scattering vertices");
        let keys = [("max_depth", &*half.to_string())];
        effects.push(Variant::new("half-depth", &label, group, &keys));
        effects
    }

    fn settings(&self) -> Vec<Variant> {
        let group = CostGroup::Settings;
        let mut settings = Vec::new();
        for lanes in ["1", "4", "8"] {
            if lanes != self.loaded.settings.lanes.to_string() {
                let label = format!("{lanes} wavelengths per path");
                let keys = [("lanes", lanes)];
                settings.push(Variant::new(
                    &format!("lanes-{lanes}"),
                    &label,
                    group,
                    &keys,
                ));
            }
        }
        if let Some(depth) = self.loaded.settings.max_depth.filter(|&d| d > 0) {
            let double = depth.saturating_mul(2).min(u32::from(u16::MAX));
            let label = format!("at most {double} scattering vertices");
            let keys = [("max_depth", &*double.to_string())];
            settings.push(Variant::new("double-depth", &label, group, &keys));
        }
        if let Some(choice) = &self.epsilon {
            for (id, factor) in [("epsilon-quarter", 0.25), ("epsilon-fourfold", 4.0)] {
                let epsilon = (choice.epsilon * factor).min(std::f64::consts::FRAC_PI_2);
                let label = format!("first cone {epsilon:.2e} rad (not {:.2e})", choice.epsilon);
                let keys = [("epsilon", &*format!("{epsilon:?}"))];
                settings.push(Variant::new(id, &label, group, &keys));
            }
        }
        let sensor = &self.loaded.scene.sensors[self.sensor];
        if !sensor.camera.is_hittable() {
            let here = match sensor.filter {
                Filter::Box => "box",
                Filter::Tent { .. } => "tent",
                Filter::Gaussian { .. } => "gaussian",
            };
            for filter in ["box", "tent", "gaussian"]
                .into_iter()
                .filter(|f| *f != here)
            {
                let mut variant = Variant::new(filter, &format!("{filter} filter"), group, &[]);
                let key = |name| format!("sensor.{}.{name}", self.sensor);
                variant.overrides = vec![(key("filter"), filter.to_owned())];
                settings.push(variant);
            }
        }
        settings
    }

    /// The estimator of the reference: another one than that of the scene, but none that is blind for what the scene shows. Where
    /// regularization is called for, unbiased methods miss paths without any sign of it in their noise; smaller cones are noisy
    /// instead, and honest about it.
    #[must_use]
    pub fn reference(&self) -> Variant {
        let sensor = &self.loaded.scene.sensors[self.sensor];
        let (integrator, label) = if self.regularized() {
            ("bdpt", "")
        } else if sensor.camera.is_hittable() {
            ("light", "light tracing, unbiased")
        } else if self.loaded.settings.integrator == IntegratorKind::Path {
            ("bdpt", "bdpt without regularization, unbiased")
        } else {
            ("path", "path tracing, unbiased")
        };
        let mode = if self.regularized() { "mis" } else { "off" };
        let keys = [("integrator", integrator), ("regularize", mode)];
        let mut reference = Variant::new("reference", label, CostGroup::Methods, &keys);
        reference.group = None;
        if let Some(choice) = &self.epsilon {
            let epsilon = choice.epsilon * REFERENCE_CONES;
            let key = "render.epsilon".to_owned();
            reference.overrides.push((key, format!("{epsilon:?}")));
            reference.label = format!(
                "bdpt, regularized with cones of {epsilon:.2e} rad, a quarter of the scene's: a sixteenth of the bias, and more noise"
            );
        }
        reference
    }
}
