//! The `[render]` table.

use super::super::error::Problem;
use super::super::schema::{
    At, Epsilon, HeuristicName, IntegratorName, NameOr, RegularizeName, Render, SharingName,
    SingleRuleName, WavelengthName, WavelengthTable, Wavelengths,
};
use super::{Allowed, Checker, POSITIVE};
use crate::scene::description::{WavelengthChoice, WavelengthSettings};
use crate::scene::settings::{
    Heuristic, IntegratorKind, Merging, Regularization, Regularize, Settings, Sharing, SingleRule,
};

const PROBABILITY: Allowed = Allowed {
    text: "above 0, at most 1",
    test: |v| v > 0.0 && v <= 1.0,
};
const WAVELENGTH: Allowed = Allowed {
    text: "100 to 20000 nm",
    test: |v| (100.0..=20_000.0).contains(&v),
};
const CONE: Allowed = Allowed {
    text: "1e-9 to pi/2 radians, or \"auto\"",
    test: |v| (1e-9..=std::f64::consts::FRAC_PI_2).contains(&v),
};
const LEAST_CONE: Allowed = Allowed {
    text: "0 to pi/2 radians",
    test: |v| (0.0..=std::f64::consts::FRAC_PI_2).contains(&v),
};
/// The observer's range.
const VISIBLE_NM: [f64; 2] = [360.0, 830.0];

impl Checker<'_> {
    pub(super) fn render(&mut self, render: &Render) -> (Settings, WavelengthSettings) {
        let defaults = Settings::default();
        let settings = Settings {
            integrator: render.integrator.map_or(defaults.integrator, |i| match i {
                IntegratorName::Path => IntegratorKind::Path,
                IntegratorName::Light => IntegratorKind::Light,
                IntegratorName::Bdpt => IntegratorKind::Bdpt,
                IntegratorName::Vcm => IntegratorKind::Vcm,
                IntegratorName::Bpm => IntegratorKind::Bpm,
                IntegratorName::Ppm => IntegratorKind::Ppm,
            }),
            spp: render.spp.as_ref().map_or(defaults.spp, |v| {
                self.integer("spp", v, 1, i64::from(u32::MAX), "1 to 4294967295") as u32
            }),
            seed: render.seed.as_ref().map_or(defaults.seed, |v| {
                self.integer("seed", v, 0, i64::MAX, "0 to 2^63 - 1") as u64
            }),
            lanes: render
                .lanes
                .as_ref()
                .map_or(defaults.lanes, |v| self.lanes(v)),
            max_depth: render.max_depth.as_ref().map(|v| {
                self.integer(
                    "max_depth",
                    v,
                    0,
                    65_535,
                    "0 to 65535, or leave it out for no limit",
                ) as u32
            }),
            heuristic: render.heuristic.map_or(defaults.heuristic, |h| match h {
                HeuristicName::Balance => Heuristic::Balance,
                HeuristicName::Power2 => Heuristic::Power2,
            }),
            pair_probability: render
                .pair_probability
                .as_ref()
                .map_or(defaults.pair_probability, |p| {
                    self.number("pair_probability", p, PROBABILITY)
                }),
            regularization: self.regularization(render),
            merging: self.merging(render),
            show_point_lights: render
                .show_point_lights
                .unwrap_or(defaults.show_point_lights),
            ..defaults
        };
        let wavelengths = render.wavelengths.as_ref().map(|w| self.wavelengths(w));
        (
            settings,
            wavelengths.unwrap_or(WavelengthSettings {
                choice: WavelengthChoice::Scene,
                range_nm: VISIBLE_NM,
            }),
        )
    }

    fn regularization(&mut self, render: &Render) -> Regularization {
        let defaults = Regularization::default();
        Regularization {
            mode: render.regularize.map_or(defaults.mode, |m| match m {
                RegularizeName::Auto => Regularize::Auto,
                RegularizeName::Off => Regularize::Off,
                RegularizeName::Single => Regularize::Single,
                RegularizeName::Mis => Regularize::Mis,
            }),
            single_rule: render
                .single_rule
                .map_or(defaults.single_rule, |r| match r {
                    SingleRuleName::ShortestEdge => SingleRule::ShortestEdge,
                    SingleRuleName::Camera => SingleRule::Camera,
                    SingleRuleName::Light => SingleRule::Light,
                }),
            epsilon: render.epsilon.as_ref().and_then(|e| match e.get_ref() {
                Epsilon::Radians(radians) => {
                    Some(self.number_at("epsilon", *radians, &e.span(), CONE))
                }
                Epsilon::Name(name) => {
                    if name != "auto" {
                        self.error(&e.span(), Problem::unknown("value", name, ["auto"]));
                    }
                    None
                }
            }),
            epsilon_min: render
                .epsilon_min
                .as_ref()
                .map_or(defaults.epsilon_min, |v| {
                    self.number("epsilon_min", v, LEAST_CONE)
                }),
            bias_weight: render
                .bias_weight
                .as_ref()
                .map_or(defaults.bias_weight, |v| {
                    self.number("bias_weight", v, PROBABILITY)
                }),
            bias_estimate: render.bias_estimate,
        }
    }

    fn merging(&mut self, render: &Render) -> Merging {
        let defaults = Merging::default();
        Merging {
            radius: render
                .merge_radius
                .as_ref()
                .map(|r| self.length("merge_radius", r, POSITIVE)),
            alpha: render.merge_alpha.as_ref().map_or(defaults.alpha, |a| {
                self.number("merge_alpha", a, PROBABILITY)
            }),
            sharing: render.sharing.map_or(defaults.sharing, |s| match s {
                SharingName::Hero => Sharing::Hero,
                SharingName::Set => Sharing::Set,
                SharingName::Stratified => Sharing::Stratified,
            }),
        }
    }

    fn lanes(&mut self, lanes: &At<i64>) -> usize {
        match lanes.get_ref() {
            1 => 1,
            4 => 4,
            8 => 8,
            other => {
                let value = other.to_string();
                self.error(
                    &lanes.span(),
                    Problem::Range {
                        what: "lanes".to_owned(),
                        value,
                        allowed: "1, 4 or 8",
                    },
                );
                4
            }
        }
    }

    fn wavelengths(&mut self, wavelengths: &At<Wavelengths>) -> WavelengthSettings {
        let at = wavelengths.span();
        let table = match wavelengths.get_ref() {
            NameOr::Table(table) => table,
            NameOr::Name(name) => {
                let choice = match name.as_str() {
                    "scene" => WavelengthChoice::Scene,
                    "uniform" => WavelengthChoice::Uniform,
                    "visible" => WavelengthChoice::Visible,
                    other => {
                        self.error(
                            &at,
                            Problem::unknown("value", other, ["scene", "uniform", "visible"]),
                        );
                        WavelengthChoice::Scene
                    }
                };
                return WavelengthSettings {
                    choice,
                    range_nm: VISIBLE_NM,
                };
            }
        };
        match table {
            WavelengthTable {
                choice: None,
                range_nm: None,
                line_nm: Some(line),
                lines_nm: None,
            } => {
                self.number("line_nm", line, WAVELENGTH);
                lines(vec![*line.get_ref()])
            }
            WavelengthTable {
                choice: None,
                range_nm: None,
                line_nm: None,
                lines_nm: Some(list),
            } => {
                let mut sorted = list.get_ref().clone();
                sorted
                    .iter()
                    .for_each(|nm| _ = self.number_at("lines_nm", *nm, &list.span(), WAVELENGTH));
                sorted.sort_by(f64::total_cmp);
                sorted.dedup();
                if sorted.is_empty() {
                    self.conflict(
                        &list.span(),
                        "lines_nm is empty (allowed: a list of wavelengths in nm)",
                    );
                }
                lines(sorted)
            }
            WavelengthTable {
                choice,
                range_nm,
                line_nm: None,
                lines_nm: None,
            } if choice.is_some() || range_nm.is_some() => {
                let range = range_nm.as_ref().map_or(VISIBLE_NM, |r| {
                    r.get_ref()
                        .iter()
                        .for_each(|nm| _ = self.number_at("range_nm", *nm, &r.span(), WAVELENGTH));
                    if r.get_ref()[0] >= r.get_ref()[1] {
                        self.conflict(&r.span(), "range_nm is empty (allowed: [a, b] with a < b)");
                    }
                    *r.get_ref()
                });
                let choice = match choice.as_ref().map(At::get_ref) {
                    Some(WavelengthName::Scene) | None => WavelengthChoice::Scene,
                    Some(WavelengthName::Uniform) => WavelengthChoice::Uniform,
                    Some(WavelengthName::Visible) => WavelengthChoice::Visible,
                };
                WavelengthSettings {
                    choice,
                    range_nm: range,
                }
            }
            _ => {
                self.conflict(
                    &at,
                    "wavelengths needs one of range_nm (with choice), line_nm, lines_nm",
                );
                lines(Vec::new())
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
