//! Spectra: one source, values fit for their use.

use super::super::error::Problem;
use super::super::plan::{SpectrumPlan, SpectrumSource};
use super::super::schema::{At, Encoding, Spectrum, SpectrumTable};
use super::{Checker, FINITE, NON_NEGATIVE, POSITIVE, Span};
use crate::io::files::FileProblem;

/// What a spectrum is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// Within 0 and 1: a transmittance of a medium.
    Fraction,
    /// Within 0 and 1, may be an image: a reflectance, a tint.
    Surface,
    /// As `Emission`, may be an image.
    SurfaceEmission,
    /// Not negative, may have lines.
    Emission,
    /// Not negative, per metre.
    Coefficient,
}

impl Checker<'_> {
    /// A spectrum where one is used.
    pub(super) fn spectrum(
        &mut self,
        what: &str,
        spectrum: &At<Spectrum>,
        used_as: Use,
    ) -> SpectrumPlan {
        let mut plan = match spectrum.get_ref() {
            Spectrum::Name(name) if self.names.spectra.contains(name) => {
                // a definition that could not be read has been reported already
                self.spectra
                    .get(name)
                    .cloned()
                    .unwrap_or_else(|| SpectrumPlan::constant(0.0))
            }
            _ => self.spectrum_definition(what, spectrum),
        };
        plan.at = spectrum.span();
        self.check_use(what, &plan, used_as);
        plan
    }

    /// A factor in 0..1, 1 where none is given.
    pub(super) fn fraction(&mut self, what: &str, spectrum: Option<&At<Spectrum>>) -> SpectrumPlan {
        spectrum.map_or_else(
            || SpectrumPlan::constant(1.0),
            |s| self.spectrum(what, s, Use::Surface),
        )
    }

    /// A spectrum where it is defined: legal for at least one use.
    pub(super) fn spectrum_definition(
        &mut self,
        what: &str,
        spectrum: &At<Spectrum>,
    ) -> SpectrumPlan {
        let at = spectrum.span();
        let plain = |source| SpectrumPlan {
            source,
            scale: 1.0,
            luminance: None,
            at: at.clone(),
        };
        match spectrum.get_ref() {
            Spectrum::Number(v) => plain(SpectrumSource::Constant(self.number_at(
                what,
                *v,
                &at,
                NON_NEGATIVE,
            ))),
            Spectrum::Rgb(rgb) => plain(self.rgb(what, *rgb, &at)),
            Spectrum::Name(name) => plain(SpectrumSource::Library(name.clone())),
            Spectrum::Table(table) => {
                let source = self
                    .spectrum_source(table, &at)
                    .unwrap_or(SpectrumSource::Constant(0.0));
                let scale = table
                    .scale
                    .as_ref()
                    .map_or(1.0, |s| self.number("scale", s, NON_NEGATIVE));
                let luminance = table
                    .luminance
                    .as_ref()
                    .map(|l| self.number("luminance", l, NON_NEGATIVE));
                if let (Some(scale), Some(_)) = (&table.scale, luminance) {
                    self.conflict(&scale.span(), "scale and luminance exclude each other");
                }
                SpectrumPlan {
                    source,
                    scale,
                    luminance,
                    at,
                }
            }
        }
    }

    fn spectrum_source(&mut self, table: &SpectrumTable, at: &Span) -> Option<SpectrumSource> {
        let choices = [
            ("value", table.value.is_some()),
            ("rgb", table.rgb.is_some()),
            ("name", table.name.is_some()),
            ("file", table.file.is_some()),
            ("blackbody_k", table.blackbody_k.is_some()),
            ("lines", table.lines.is_some()),
            ("texture", table.texture.is_some()),
        ];
        self.exactly_one(at, "spectrum", &choices)?;
        if let Some(value) = &table.value {
            return Some(SpectrumSource::Constant(self.number(
                "value",
                value,
                NON_NEGATIVE,
            )));
        }
        if let Some(rgb) = &table.rgb {
            return Some(self.rgb("rgb", *rgb.get_ref(), &rgb.span()));
        }
        if let Some(name) = &table.name {
            return Some(SpectrumSource::Library(name.get_ref().clone()));
        }
        if let Some(file) = &table.file {
            let rows = self.csv::<2>(file);
            if let Some(row) = rows.iter().find(|r| r[0] <= 0.0 || r[1] < 0.0) {
                let message = format!(
                    "row {}, {} (allowed: wavelengths > 0 in nm, values >= 0)",
                    row[0], row[1]
                );
                self.error(
                    &file.span(),
                    FileProblem::Bad {
                        path: file.get_ref().clone(),
                        message,
                    }
                    .into(),
                );
            }
            return Some(SpectrumSource::Table(rows));
        }
        if let Some(temp_k) = &table.blackbody_k {
            let allowed = super::Allowed {
                text: "100 to 1e6 kelvin",
                test: |v| (100.0..=1e6).contains(&v),
            };
            return Some(SpectrumSource::Blackbody(self.number(
                "blackbody_k",
                temp_k,
                allowed,
            )));
        }
        if let Some(texture) = &table.texture {
            let plan = self.texture(texture, Encoding::Srgb)?;
            return Some(SpectrumSource::Texture(Box::new(plan)));
        }
        let lines = table.lines.as_ref()?;
        Some(SpectrumSource::Lines(self.lines(lines)))
    }

    fn lines(&mut self, lines: &At<Vec<[f64; 2]>>) -> Vec<[f64; 2]> {
        let at = lines.span();
        let mut sorted = lines.get_ref().clone();
        for [nm, power] in &sorted {
            self.number_at("wavelength of a line", *nm, &at, POSITIVE);
            self.number_at("power of a line", *power, &at, NON_NEGATIVE);
        }
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
        if sorted.is_empty() {
            self.conflict(&at, "lines is empty (allowed: a list of [nm, power])");
        }
        if let Some(pair) = sorted.windows(2).find(|p| p[0][0] == p[1][0]) {
            self.conflict(&at, format!("line {} nm is given twice", pair[0][0]));
        }
        sorted
    }

    fn rgb(&mut self, what: &str, rgb: [f64; 3], at: &Span) -> SpectrumSource {
        for value in rgb {
            self.number_at(what, value, at, NON_NEGATIVE);
        }
        SpectrumSource::Rgb(rgb)
    }

    fn check_use(&mut self, what: &str, plan: &SpectrumPlan, used_as: Use) {
        let is_texture = matches!(plan.source, SpectrumSource::Texture(_));
        if is_texture && !matches!(used_as, Use::Surface | Use::SurfaceEmission) {
            self.conflict(
                &plan.at,
                format!("{what} cannot be a texture (allowed on materials and on the emission of objects)"),
            );
        }
        if is_texture && plan.luminance.is_some() {
            self.conflict(
                &plan.at,
                "a texture has no luminance of its own (use scale)",
            );
        }
        if matches!(used_as, Use::Emission | Use::SurfaceEmission) {
            return;
        }
        if matches!(
            plan.source,
            SpectrumSource::Lines(_) | SpectrumSource::Blackbody(_)
        ) {
            self.conflict(
                &plan.at,
                format!("{what} cannot be a spectrum of lines or a blackbody (these are emission)"),
            );
        }
        if plan.luminance.is_some() {
            self.conflict(
                &plan.at,
                format!("{what} has no luminance (luminance scales emission)"),
            );
        }
        if used_as == Use::Coefficient {
            if matches!(plan.source, SpectrumSource::Rgb(_)) {
                self.conflict(
                    &plan.at,
                    format!("{what} cannot be [r, g, b] (use color and distance)"),
                );
            }
            return;
        }
        let largest = match &plan.source {
            SpectrumSource::Constant(v) => *v,
            SpectrumSource::Rgb(rgb) => rgb.iter().copied().fold(0.0, f64::max),
            SpectrumSource::Table(rows) => rows.iter().map(|r| r[1]).fold(0.0, f64::max),
            // texels reach 1
            SpectrumSource::Texture(_) => 1.0,
            // known once the library is asked
            _ => 0.0,
        } * plan.scale;
        // what is not finite has been reported where it is defined
        if (FINITE.test)(largest) && largest > 1.0 {
            let value = largest.to_string();
            self.error(
                &plan.at,
                Problem::Range {
                    what: what.to_owned(),
                    value,
                    allowed: "0 to 1",
                },
            );
        }
    }
}
