//! `unit` and the `[render]` table.

use super::document::Node;
use super::keys::{Build, Built, Form, Keys, POSITIVE, Range, Spec, Table, Value, keys};
use super::reader::Reader;
use super::sensor::FILTER_RADIUS;
use super::sequence::SequenceChoice;
use super::value::{At, ChainName, Lanes, Length, number};
use crate::light::casters::Casters;
use crate::math::named::named;
use crate::optics::Polarization;
use crate::scene::description::{WavelengthChoice, WavelengthSettings};
use crate::scene::settings::{
    Aiming, FilterKind, Heuristic, IntegratorKind, Merging, Metropolis, OutputUnits,
    Regularization, Regularize, Settings, Sharing, SingleRule,
};
use std::f64::consts::FRAC_PI_2;
use toml::de::DeValue;

const PASSES: Range = Range::closed(1.0, u32::MAX as f64, "1 to 4294967295");
const SEED: Range = Range::closed(0.0, i64::MAX as f64, "0 to 2^63 - 1");
const DEPTH: Range = Range::closed(0.0, 65_535.0, "0 to 65535, or leave it out for no limit");
const PROBABILITY: Range = Range::above(0.0, 1.0, "above 0, at most 1");
const LIGHT_PATHS: Range = Range::above(0.0, 16.0, "above 0, at most 16");
const MUTATIONS: Range = Range::closed(1.0, 1_000_000.0, "1 to 1000000");
const UNIFORM: Range = Range::closed(0.01, 0.99, "0.01 to 0.99");
const SHARE: Range = Range::closed(0.0, Casters::LARGEST_SHARE, "0 to 0.9");
const WAVELENGTH: Range = Range::closed(100.0, 20_000.0, "100 to 20000 nm");
const CONE: Range = Range::closed(1e-9, FRAC_PI_2, "1e-9 to pi/2 radians, or \"auto\"");
const LEAST_CONE: Range = Range::closed(0.0, FRAC_PI_2, "0 to pi/2 radians");
/// The observer's range.
pub const VISIBLE_NM: [f64; 2] = [360.0, 830.0];

named! {
    /// The unit of lengths in the file.
    pub enum LengthUnit {
        Meter = "m": "Meters",
        Centimeter = "cm": "Centimeters",
        Millimeter = "mm": "Millimeters",
        Micrometer = "um": "Micrometers",
    }
}

impl LengthUnit {
    /// Metres per unit.
    pub fn in_m(self) -> f64 {
        match self {
            Self::Meter => 1.0,
            Self::Centimeter => 1e-2,
            Self::Millimeter => 1e-3,
            Self::Micrometer => 1e-6,
        }
    }
}

/// The unit, in which all lengths are read from then on.
pub struct Unit;

impl Value for Unit {
    fn form() -> Form {
        LengthUnit::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        cx.unit_m = LengthUnit::read(node, spec, cx)?.in_m();
        Some(Self)
    }

    fn show(&self) -> String {
        LengthUnit::Meter.show()
    }
}

named! {
    /// A value that is found from the scene.
    pub enum Automatic {
        Auto = "auto": "Found from the scene",
    }
}

/// A number that `"auto"` leaves to the program; `ANGLE`: in radians.
#[derive(Clone, Copy, Debug)]
pub struct OrAuto<const ANGLE: bool>(Option<f64>);

impl<const ANGLE: bool> Value for OrAuto<ANGLE> {
    fn form() -> Form {
        Form::Any(vec![f64::form(), Automatic::form()])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        if node.get_ref().is_str() {
            return Automatic::read(node, spec, cx).map(|_| Self(None));
        }
        let expected = if ANGLE {
            "an angle in radians or \"auto\""
        } else {
            "a number or \"auto\""
        };
        number(node, spec, expected, cx).map(|v| Self(Some(v)))
    }

    fn show(&self) -> String {
        Automatic::Auto.show()
    }
}

named! {
    /// Distributions of wavelengths.
    pub enum WavelengthName {
        Scene = "scene": "By what the emitters send to the eye",
        Uniform = "uniform": "All alike",
        Visible = "visible": "By the observer's sensitivity",
        Even = "even": "All alike, and emission lines alike",
    }
}

impl WavelengthName {
    fn over(self, range_nm: [f64; 2]) -> WavelengthSettings {
        let choice = match self {
            Self::Scene => WavelengthChoice::Scene,
            Self::Uniform => WavelengthChoice::Uniform,
            Self::Visible => WavelengthChoice::Visible,
            Self::Even => WavelengthChoice::Even,
        };
        WavelengthSettings { choice, range_nm }
    }
}

keys! {
    /// Wavelengths: `range_nm` (with `choice`), `line_nm` or `lines_nm`. With lines only these
    /// wavelengths exist: emission lines at exactly these, and of continuous light a band of 1 nm
    /// about each.
    WavelengthKeys = "wavelengths" {
        /// The distribution, with `range_nm`.
        choice: Option<WavelengthName>, or "`\"scene\"`";
        /// [a, b], a < b.
        range_nm: Option<At<[f64; 2]>>, in WAVELENGTH, unit "nm", or "[360, 830]";
        /// One wavelength.
        line_nm: Option<f64>, in WAVELENGTH, unit "nm";
        /// A list of wavelengths.
        lines_nm: Option<At<Vec<f64>>>, in WAVELENGTH, unit "nm";
    }
}

impl Build for WavelengthKeys {
    type Output = WavelengthSettings;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<WavelengthSettings> {
        let Self {
            choice,
            range_nm,
            line_nm,
            lines_nm,
        } = self;
        match (choice, &range_nm, line_nm, lines_nm) {
            (None, None, Some(line), None) => Some(lines(vec![line])),
            (None, None, None, Some(At { mut value, at })) => {
                value.sort_by(f64::total_cmp);
                value.dedup();
                if value.is_empty() {
                    let message = "lines_nm is empty (allowed: a list of wavelengths in nm)";
                    cx.conflict(&at, message);
                }
                Some(lines(value))
            }
            (choice, range, None, None) if choice.is_some() || range.is_some() => {
                if let Some(At { value: [a, b], at }) = range
                    && a >= b
                {
                    cx.conflict(at, "range_nm is empty (allowed: [a, b] with a < b)");
                }
                let range_nm = range.as_ref().map_or(VISIBLE_NM, |r| r.value);
                Some(choice.unwrap_or(WavelengthName::Scene).over(range_nm))
            }
            _ => {
                let message = "wavelengths needs one of range_nm (with choice), line_nm, lines_nm";
                cx.conflict(&table.at, message);
                None
            }
        }
    }
}

fn lines(nm: Vec<f64>) -> WavelengthSettings {
    let range_nm = [
        nm.first().copied().unwrap_or(VISIBLE_NM[0]),
        nm.last().copied().unwrap_or(VISIBLE_NM[1]),
    ];
    WavelengthSettings {
        choice: WavelengthChoice::Lines(nm),
        range_nm,
    }
}

/// Which wavelengths are drawn: a name over the visible range, or a table.
pub struct Wavelengths(WavelengthSettings);

impl Value for Wavelengths {
    fn form() -> Form {
        Form::Any(vec![
            WavelengthName::form(),
            Form::Table(WavelengthKeys::KIND),
        ])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let before = cx.error_count();
        let read = match node.get_ref() {
            DeValue::String(_) => {
                WavelengthName::read(node, spec, cx).map(|name| name.over(VISIBLE_NM))
            }
            DeValue::Table(_) => Built::<WavelengthKeys>::read(node, spec, cx).map(|b| b.0),
            _ => {
                cx.wrong_type(node, "a name or a table");
                None
            }
        };
        // until then indices are not looked at for want of a range
        cx.range_nm = None;
        let read = read.filter(|_| cx.error_count() == before)?;
        cx.range_nm = Some(read.range_nm);
        Some(Self(read))
    }

    fn show(&self) -> String {
        WavelengthName::Scene.show()
    }
}

keys! {
    /// Metropolis sampling.
    MetropolisKeys = "metropolis" {
        /// Mutations of a chain.
        mutations: i64, in MUTATIONS, default i64::from(Metropolis::default().mutations);
        /// Share of the samples that are ordinary ones, one per pixel and pass; chains take the
        /// others.
        uniform: f64, in UNIFORM, default Metropolis::default().uniform;
    }
}

impl Build for MetropolisKeys {
    type Output = Metropolis;

    fn build(self, _: &Table<'_>, _: &mut Reader<'_>) -> Option<Metropolis> {
        Some(Metropolis {
            mutations: self.mutations as u32,
            uniform: self.uniform,
        })
    }
}

keys! {
    /// How the scene is rendered.
    RenderKeys = "render" {
        /// The algorithm.
        integrator: IntegratorKind, default Settings::default().integrator;
        /// Samples per pixel: passes.
        spp: i64, in PASSES, default i64::from(Settings::default().spp);
        /// Seed of all random numbers.
        seed: i64, in SEED, default 0;
        /// Wavelengths per path.
        lanes: Lanes, default Lanes(Settings::default().lanes);
        /// Scattering vertices of the whole path, at most.
        max_depth: Option<i64>, in DEPTH, or "no limit (Russian roulette)";
        /// Weighting of strategies.
        weights: Heuristic, default Settings::default().heuristic;
        /// Probability of trying a connection between two inner vertices.
        pair_probability: OrAuto<false>, in PROBABILITY, default OrAuto(None);
        /// Light sub-paths per camera sub-path, without merging; a fraction is a probability.
        light_paths: OrAuto<false>, in LIGHT_PATHS, default OrAuto(None);
        /// Share of the light sub-paths that start toward mirrors and glass.
        caster_share: f64, in SHARE, default Casters::SHARE;
        /// Whether mirrors and smooth glass are connectible within a small cone.
        regularize: Regularize, default Regularization::default().mode;
        /// Which chains of mirrors and smooth glass are solved for.
        aim: Aiming, default Settings::default().aim;
        /// The kinds of chains that `aim` means: R (reflects) or T (transmits) and the object of
        /// each surface from the light to the sensor, as `abbe info` lists them.
        chains: Option<At<Vec<ChainName>>>, or "all there are";
        /// Half-aperture of the first pass's cone; pass p has ε (p + 1)^(-1/6).
        epsilon: OrAuto<true>, in CONE, unit "radians", default OrAuto(None);
        /// Least half-aperture.
        epsilon_min: f64, in LEAST_CONE, unit "radians", default Regularization::default().epsilon_min;
        /// The strategy of `regularize = "single"`.
        single_rule: SingleRule, default Regularization::default().single_rule;
        /// Factor per specular joint on a strategy's weight, for paths that have unbiased
        /// strategies too.
        bias_weight: f64, in PROBABILITY, default Regularization::default().bias_weight;
        /// Whether odd passes use cones of ε/√2, so that the halves tell the bias.
        bias_estimate: Option<bool>, or "for detectors";
        /// Images of lights without extent in mirrors, as discs of radius ε.
        show_point_lights: bool, default Settings::default().show_point_lights;
        /// Reconstruction filter; σ of the Gaussian is a third of the radius.
        filter: Option<FilterKind>, or "`\"gaussian\"`; of detectors `\"box\"`";
        /// Radius of the filter; the box has none.
        filter_radius: Option<f64>, in FILTER_RADIUS, unit "pixels", or "tent 1, Gaussian 1.5";
        /// Wavelengths to draw: a name over 360..830 nm, or a table.
        wavelengths: Option<Wavelengths>, or "`\"scene\"`";
        /// Polarization that smooth surfaces are computed for, each against its own plane of
        /// incidence; other than `"average"` only where no surface is rough or coated paint.
        fresnel: Polarization, default Polarization::Average;
        /// Sequences of smooth surfaces that all paths are held to, by what light does at each and
        /// where, from the light `L` to the sensor `E`. All else is left out of the image.
        sequences: Option<At<SequenceChoice>>, or "all paths";
        /// Scale of the image.
        units: OutputUnits, default OutputUnits::Radiance;
        /// Radius of the first pass within which photons are merged.
        merge_radius: Option<Length>, in POSITIVE, or "two pixels at the median distance of what the camera sees; 0.003 of the scene's radius for detectors";
        /// The radius of pass i = 0, 1, ... is that of pass 0 times (i + 1)^(-(1 - alpha)/2), at
        /// least 1e-5 of the scene's radius.
        merge_alpha: f64, in PROBABILITY, default Merging::default().alpha;
        /// Wavelengths and time that the paths of a pass share where photons are merged. With
        /// `"stratified"` the error estimated from even and odd passes is only a guide.
        sharing: Sharing, default Merging::default().sharing;
        /// Chains of `integrator = "pssmlt"`.
        metropolis: Option<Built<MetropolisKeys>>;
    }
}

/// How the scene is rendered.
pub struct Rendering {
    /// The settings.
    pub settings: Settings,
    /// Scale of the image.
    pub units: OutputUnits,
    /// Wavelengths.
    pub wavelengths: WavelengthSettings,
    /// Polarization that smooth surfaces are computed for.
    pub polarization: Polarization,
    /// Sequences of surfaces that all paths are held to.
    pub sequences: Option<At<SequenceChoice>>,
    /// Kinds of chains that are solved for; `None`: all.
    pub chains: Option<At<Vec<ChainName>>>,
    /// Share of the light sub-paths that start toward mirrors and glass.
    pub caster_share: f64,
}

impl Default for Rendering {
    fn default() -> Self {
        Self {
            settings: Settings::default(),
            units: OutputUnits::Radiance,
            wavelengths: WavelengthName::Scene.over(VISIBLE_NM),
            polarization: Polarization::Average,
            sequences: None,
            chains: None,
            caster_share: Casters::SHARE,
        }
    }
}

impl RenderKeys {
    /// Paths that are held to sequences have neither photons nor cones nor chains solved for.
    fn check_sequences(&self, cx: &mut Reader<'_>) {
        let Some(At { at, .. }) = &self.sequences else {
            return;
        };
        let other = if self.integrator.merges() || self.integrator.runs_chains() {
            "integrator = \"path\", \"light\" or \"bdpt\""
        } else if matches!(self.regularize, Regularize::Single | Regularize::Mis) {
            "regularize = \"off\""
        } else if self.aim == Aiming::All {
            "aim = \"off\""
        } else {
            return;
        };
        cx.conflict(
            at,
            format!("paths held to sequences are made by walks alone (allowed with them: {other})"),
        );
    }
}

impl Build for RenderKeys {
    type Output = Rendering;

    fn build(self, _: &Table<'_>, cx: &mut Reader<'_>) -> Option<Rendering> {
        cx.filter = (self.filter, self.filter_radius);
        self.check_sequences(cx);
        let settings = Settings {
            integrator: self.integrator,
            spp: self.spp as u32,
            seed: self.seed as u64,
            lanes: self.lanes.0,
            max_depth: self.max_depth.map(|depth| depth as u32),
            heuristic: self.weights,
            pair_probability: self.pair_probability.0,
            light_paths: self.light_paths.0,
            regularization: Regularization {
                mode: self.regularize,
                single_rule: self.single_rule,
                epsilon: self.epsilon.0,
                epsilon_min: self.epsilon_min,
                bias_weight: self.bias_weight,
                bias_estimate: self.bias_estimate,
            },
            aim: self.aim,
            merging: Merging {
                radius: self.merge_radius.map(|radius| radius.0),
                alpha: self.merge_alpha,
                sharing: self.sharing,
            },
            metropolis: self.metropolis.map_or_else(Metropolis::default, |m| m.0),
            show_point_lights: self.show_point_lights,
            ..Settings::default()
        };
        let wavelengths = self
            .wavelengths
            .map_or(WavelengthName::Scene.over(VISIBLE_NM), |w| w.0);
        Some(Rendering {
            settings,
            units: self.units,
            wavelengths,
            polarization: self.fresnel,
            sequences: self.sequences,
            chains: self.chains,
            caster_share: self.caster_share,
        })
    }
}
