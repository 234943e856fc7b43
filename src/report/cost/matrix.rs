//! Variants that a cost report compares: the scene as it is, other methods, the scene without each
//! of its effects, other settings.

use super::data::Group;
use crate::film::Filter;
use crate::integrator::{SensorJob, aims};
use crate::io::loaded::Loaded;
use crate::math::named::Named;
use crate::render::{EpsilonChoice, epsilon};
use crate::scene::Settings;
use crate::scene::effects::EffectKind;
use crate::scene::frozen::Frozen;
use crate::scene::regularization::{Decision, Mode, decide};
use crate::scene::settings::{Aiming, Heuristic, IntegratorKind, Regularize};

/// Name of the variant that all others are compared with.
pub const BASE: &str = "scene";
/// Depth that stands for half of no limit.
const HALF_OF_UNLIMITED: u32 = 6;

/// Columns of the images of single strategies.
const LAYERS_WIDTH: u32 = 160;
/// Scattering vertices of paths whose strategies are shown one by one.
const LAYERS_DEPTH: u32 = 6;

/// Cones of the reference as a share of those of the scene.
const REFERENCE_CONES: f64 = 0.25;

/// One way to render the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Name in files and tables: letters, digits and hyphens.
    pub id: String,
    /// Name for readers.
    pub label: String,
    /// The parts of the report it belongs to; none: the scene as it is.
    pub groups: Vec<Group>,
    /// Keys of the scene file that differ.
    pub overrides: Vec<(String, String)>,
    /// The effect left out of the scene, where no key does it.
    pub frozen: Option<Frozen>,
    /// Things kept besides its images.
    pub detail: Detail,
}

/// Things that a cell keeps besides images of all light. They take time, so that cells that are
/// timed keep nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Detail {
    /// Nothing.
    Image,
    /// One layer per strategy, in its last image.
    Strategies,
    /// The table of classes of paths.
    Classes,
}

impl Variant {
    fn new(id: &str, label: &str, group: Group, overrides: &[(&str, &str)]) -> Self {
        let own = |(key, value): &(&str, &str)| (format!("render.{key}"), (*value).to_owned());
        Self {
            id: id.to_owned(),
            label: label.to_owned(),
            groups: vec![group],
            overrides: overrides.iter().map(own).collect(),
            frozen: None,
            detail: Detail::Image,
        }
    }

    /// A method, without anything else that differs.
    fn method(id: &str, label: &str, group: Group, method: Method) -> Self {
        Self::new(id, label, group, &method.keys())
    }

    /// The same with its light by class of paths; `None` where it is not compared by it.
    #[must_use]
    pub fn by_class(&self) -> Option<Self> {
        (self.is_base() || self.groups.contains(&Group::Methods)).then(|| Self {
            id: format!("{}-light", self.id),
            label: format!("{}: light by class", self.label),
            detail: Detail::Classes,
            ..self.clone()
        })
    }

    /// Whether this is the scene as it is.
    #[must_use]
    pub fn is_base(&self) -> bool {
        self.id == BASE
    }

    fn frozen(id: &str, label: &str, frozen: Frozen) -> Self {
        Self {
            frozen: Some(frozen),
            ..Self::new(id, label, Group::Effects, &[])
        }
    }
}

/// An integrator, how it is regularized, and whether it solves for chains.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Method {
    integrator: IntegratorKind,
    regularize: Regularize,
    aim: Aiming,
}

impl Method {
    /// One that solves for no chains.
    fn new(integrator: IntegratorKind, regularize: Regularize) -> Self {
        Self {
            integrator,
            regularize,
            aim: Aiming::Off,
        }
    }

    /// Keys of the scene file that choose it.
    fn keys(self) -> [(&'static str, &'static str); 3] {
        [
            ("integrator", self.integrator.as_str()),
            ("regularize", self.regularize.as_str()),
            ("aim", self.aim.as_str()),
        ]
    }

    /// Names in files and for readers.
    fn names(self) -> [String; 2] {
        let [(_, integrator), (_, mode), _] = self.keys();
        let (mut id, mut label) = (integrator.to_owned(), integrator.to_owned());
        match self.regularize {
            Regularize::Off => {}
            Regularize::Mis => {
                id += "-mis";
                label += ", regularized";
            }
            _ => {
                id += &format!("-{mode}");
                label += &format!(", regularized ({mode})");
            }
        }
        if self.aim != Aiming::Off {
            id += "-aimed";
            label += ", aimed";
        }
        [id, label]
    }
}

/// The cones that a scene calls for under the given settings.
fn cones(loaded: &Loaded, sensor: usize, settings: &Settings) -> EpsilonChoice {
    let whole = loaded.scene.sensors[sensor].whole_film();
    let frame = SensorJob::new(&loaded.scene, sensor, settings, &whole, false);
    epsilon::choose(&frame, loaded.response())
}

/// The scene as it is, which the matrix follows from.
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
        let epsilon = regularization
            .mode
            .map(|_| cones(loaded, sensor, &loaded.settings));
        Self {
            loaded,
            sensor,
            regularization,
            epsilon,
        }
    }

    fn has(&self, effect: EffectKind) -> bool {
        self.loaded.scene.has_effect(effect)
    }

    fn regularized(&self) -> bool {
        self.regularization.mode.is_some()
    }

    /// All variants of the groups asked for, the scene as it is first.
    #[must_use]
    pub fn variants(&self, groups: &[Group]) -> Vec<Variant> {
        let mut scene = Variant::new(BASE, &self.label(), Group::Methods, &[]);
        scene.groups.clear();
        let all = [
            self.methods(),
            self.effects(),
            self.lanes(),
            self.settings(),
        ];
        let asked_for = all.into_iter().flatten().filter_map(|mut variant| {
            variant.groups.retain(|g| groups.contains(g));
            (!variant.groups.is_empty()).then_some(variant)
        });
        std::iter::once(scene).chain(asked_for).collect()
    }

    fn label(&self) -> String {
        let mode = if self.regularized() {
            ", regularized"
        } else {
            ""
        };
        let name = self.loaded.settings.integrator.as_str();
        format!("the scene as it is ({name}{mode})")
    }

    fn methods(&self) -> Vec<Variant> {
        use IntegratorKind::{Bdpt, Light, Path, Pssmlt, Vcm};
        use Regularize::{Mis, Off, Single};
        // a further integrator is a further line here
        let mut methods = vec![(Path, Off), (Light, Off), (Bdpt, Off), (Vcm, Off)];
        methods.push((Pssmlt, Off));
        if self.has(EffectKind::Specular) {
            methods.splice(3..3, [(Bdpt, Single), (Bdpt, Mis)]);
            methods.extend([(Vcm, Mis), (Pssmlt, Mis)]);
        }
        let mut methods: Vec<Method> = methods
            .into_iter()
            .map(|(i, r)| Method::new(i, r))
            .collect();
        if self.has_chains() {
            let aimed = |regularize| Method {
                aim: Aiming::Auto,
                ..Method::new(Bdpt, regularize)
            };
            methods.extend([aimed(Off), aimed(Mis)]);
        }
        let own = self.method(self.loaded.settings.integrator);
        let variant = |method: Method| {
            let [id, label] = method.names();
            Variant::method(&id, &label, Group::Methods, method)
        };
        let mut variants: Vec<Variant> = methods
            .into_iter()
            .filter(|m| *m != own)
            .map(variant)
            .collect();
        let (id, label) = ("vcm-stratified", "vcm, stratified passes");
        let mut stratified = Variant::method(id, label, Group::Methods, Method::new(Vcm, Off));
        let sharing = ("render.sharing".to_owned(), "stratified".to_owned());
        stratified.overrides.push(sharing);
        variants.push(stratified);
        variants
    }

    /// Whether anything is smooth that chains are solved for on.
    fn has_chains(&self) -> bool {
        self.has(EffectKind::Specular) && !self.loaded.scene.chains().kinds().is_empty()
    }

    /// An integrator with what the scene as it is asks for besides.
    fn method(&self, integrator: IntegratorKind) -> Method {
        let settings = &self.loaded.settings;
        let aimed = aims(settings, &self.loaded.scene, self.sensor).any();
        Method {
            integrator,
            regularize: self.mode(),
            aim: if aimed { settings.aim } else { Aiming::Off },
        }
    }

    /// The mode of regularization of the scene as it is.
    fn mode(&self) -> Regularize {
        match self.regularization.mode {
            None => Regularize::Off,
            Some(Mode::Mis) => Regularize::Mis,
            Some(Mode::Single(_)) => Regularize::Single,
        }
    }

    fn effects(&self) -> Vec<Variant> {
        let mut effects = Vec::new();
        if self.has(EffectKind::Dispersion) {
            let label = "without dispersion (all indices as at 587.56 nm)";
            effects.push(Variant::frozen("no-dispersion", label, Frozen::Dispersion));
        }
        if self.has(EffectKind::Motion) {
            let label = "without motion (the middle of the shutter)";
            effects.push(Variant::frozen("no-motion", label, Frozen::Motion));
        }
        let group = Group::Effects;
        if self.regularized() {
            let keys = [("regularize", Regularize::Off.as_str())];
            let label = "without regularization";
            effects.push(Variant::new("no-regularization", label, group, &keys));
        }
        if self.method(self.loaded.settings.integrator).aim != Aiming::Off {
            let keys = [("aim", Aiming::Off.as_str())];
            let label = "without solved chains";
            effects.push(Variant::new("no-aims", label, group, &keys));
        }
        let method = self.loaded.settings.integrator;
        if method != IntegratorKind::Path && self.loaded.scene.casters.count() > 0 {
            let keys = [("caster_share", "0")];
            let label = "without light sent toward mirrors and glass";
            effects.push(Variant::new("no-casters", label, group, &keys));
        }
        let merging = if method.merges() {
            Some(("no-merging", IntegratorKind::Bdpt, "without merging (bdpt)"))
        } else if method == IntegratorKind::Bdpt {
            Some(("merging", IntegratorKind::Vcm, "with merging (vcm)"))
        } else {
            None
        };
        if let Some((id, integrator, label)) = merging {
            let method = self.method(integrator);
            effects.push(Variant::method(id, label, group, method));
        }
        let depth = self.loaded.settings.max_depth;
        let half = depth.map_or(HALF_OF_UNLIMITED, |d| d / 2);
        let label = format!("at most {half} scattering vertices");
        let keys = [("max_depth", &*half.to_string())];
        effects.push(Variant::new("half-depth", &label, group, &keys));
        effects
    }

    fn lanes(&self) -> Vec<Variant> {
        let own = self.loaded.settings.lanes.to_string();
        let others = ["1", "4", "8"].into_iter().filter(|lanes| *lanes != own);
        let variant = |lanes| {
            let (id, label) = (
                format!("lanes-{lanes}"),
                match lanes {
                    "1" => "1 wavelength per path".to_owned(),
                    _ => format!("{lanes} wavelengths per path"),
                },
            );
            let keys = [("lanes", lanes)];
            let mut variant = Variant::new(&id, &label, Group::Effects, &keys);
            variant.groups.push(Group::Settings);
            variant
        };
        others.map(variant).collect()
    }

    fn settings(&self) -> Vec<Variant> {
        let group = Group::Settings;
        let mut settings = Vec::new();
        if let Some(depth) = self.loaded.settings.max_depth.filter(|&d| d > 0) {
            let double = depth.saturating_mul(2).min(u32::from(u16::MAX));
            let label = format!("at most {double} scattering vertices");
            let keys = [("max_depth", &*double.to_string())];
            settings.push(Variant::new("double-depth", &label, group, &keys));
        }
        let own = self.loaded.settings.heuristic;
        if self.loaded.settings.integrator == IntegratorKind::Bdpt {
            for weights in Heuristic::ALL.iter().filter(|h| **h != own) {
                let (id, label) = (format!("weights-{weights}"), format!("{weights} weights"));
                let keys = [("weights", weights.as_str())];
                settings.push(Variant::new(&id, &label, group, &keys));
            }
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

    /// The estimator of the reference: another one than that of the scene, but none that is blind
    /// for what the scene shows. Where regularization is called for, or merging stands in for it,
    /// unbiased methods miss paths without any sign of it in their noise; smaller cones are noisy
    /// instead, and honest about it.
    #[must_use]
    pub fn reference(&self) -> Variant {
        let hittable = self.loaded.scene.sensors[self.sensor].camera.is_hittable();
        let method = self.loaded.settings.integrator;
        let cones = if self.epsilon.is_none()
            && method.merges()
            && self.has(EffectKind::Specular)
            && !hittable
        {
            let mut settings = self.loaded.settings.clone();
            settings.regularization.mode = Regularize::Mis;
            Some(cones(self.loaded, self.sensor, &settings))
        } else {
            self.epsilon.clone()
        };
        let (integrator, label) = if cones.is_some() {
            (IntegratorKind::Bdpt, "")
        } else if hittable {
            (IntegratorKind::Light, "light tracing, unbiased")
        } else if method == IntegratorKind::Path || method.merges() {
            let label = "bdpt without regularization, unbiased";
            (IntegratorKind::Bdpt, label)
        } else {
            (IntegratorKind::Path, "path tracing, unbiased")
        };
        let mode = match cones {
            Some(_) => Regularize::Mis,
            None => Regularize::Off,
        };
        let method = Method {
            regularize: mode,
            ..self.method(integrator)
        };
        let mut reference = Variant::method("reference", label, Group::Methods, method);
        reference.groups.clear();
        if let Some(choice) = cones {
            let epsilon = choice.epsilon * REFERENCE_CONES;
            let key = "render.epsilon".to_owned();
            reference.overrides.push((key, format!("{epsilon:?}")));
            reference.label = format!(
                "bdpt, regularized with cones of {epsilon:.2e} rad, a quarter of those chosen for the scene: a sixteenth of the bias, and more noise"
            );
        }
        reference
    }

    /// The scene as it is with one layer per strategy, small, since there are many strategies.
    #[must_use]
    pub fn layers(&self) -> Variant {
        let size = self.loaded.scene.sensors[self.sensor].camera.resolution();
        let depth = self.loaded.settings.max_depth.unwrap_or(LAYERS_DEPTH);
        let depth = depth.min(LAYERS_DEPTH).to_string();
        let keys = [("max_depth", &*depth)];
        let mut layers = Variant::new("layers", "strategies", Group::Methods, &keys);
        layers.groups.clear();
        layers.detail = Detail::Strategies;
        if size.width > LAYERS_WIDTH {
            let height =
                (u64::from(size.height) * u64::from(LAYERS_WIDTH)).div_ceil(u64::from(size.width));
            let key = format!("sensor.{}.resolution", self.sensor);
            layers
                .overrides
                .push((key, format!("[{LAYERS_WIDTH}, {height}]")));
        }
        if let Some(choice) = &self.epsilon {
            // larger pixels would ask for larger cones
            let key = "render.epsilon".to_owned();
            layers
                .overrides
                .push((key, format!("{:?}", choice.epsilon)));
        }
        layers
    }
}
