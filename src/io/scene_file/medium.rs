//! `[medium.NAME]`: refractive indices and absorption.

use super::document::Node;
use super::error::Problem;
use super::keys::{Build, Built, FINITE, Form, Keys, POSITIVE, Range, Spec, Table, Value, keys};
use super::reader::{Reader, definitions};
use super::spectrum::{Coefficient, Transmittance};
use super::value::{At, FileName, GlassName, Length};
use crate::medium::{Medium, MediumId, absorption_of};
use crate::spectrum::{Curve, Ior};
use std::ops::Range as Span;

/// Range of a refractive index.
pub const INDEX: Range = Range::closed(1.0, 10.0, "1 to 10");

keys! {
    /// A medium, its index given by exactly one of the first five keys.
    MediumKeys = "medium" {
        /// A glass such as `"schott:N-SF11"` or `"WATER"`; `abbe glass --list` lists them.
        glass: Option<At<GlassName>>;
        /// The same index at all wavelengths.
        ior: Option<f64>, in INDEX;
        /// [A, B, C, ...]: n = A + B/λ² + C/λ⁴ ..., 1 to 6 numbers.
        cauchy: Option<At<Vec<f64>>>, in FINITE, unit "λ in µm";
        /// [[B, C], ...]: n² = 1 + Σ Bλ²/(λ² - C), 1 to 6 terms.
        sellmeier: Option<At<Vec<[f64; 2]>>>, in FINITE, unit "1, µm²";
        /// CSV of `nm,n` or `nm,n,k`, nm > 0, n 1 to 10, k >= 0.
        file: Option<At<FileName>>;
        /// With `file`: also beyond the table.
        extrapolate: bool, default false;
        /// Whether k of the index absorbs (α = 4πk/λ).
        use_k: bool, default true;
        /// Absorption beyond that of the index.
        absorption: Option<Built<AbsorptionKeys>>, or "none";
    }
}

keys! {
    /// Absorption: either `color` and `distance`, or `coefficient`.
    AbsorptionKeys = "absorption" {
        /// Color of white light after `distance`, within 0 and 1.
        color: Option<Transmittance>;
        /// The distance.
        distance: Option<Length>, in POSITIVE;
        /// Coefficient, not as [r, g, b].
        coefficient: Option<Coefficient>, unit "1/m";
    }
}

impl Build for AbsorptionKeys {
    type Output = Curve;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Curve> {
        match (self.color, self.distance, self.coefficient) {
            (Some(color), Some(distance), None) => {
                table.sound(cx)?;
                // where the file does not say its range in a readable way, nothing is built
                cx.range_nm
                    .map(|range_nm| absorption_of(&color.0, distance.0, range_nm))
            }
            (None, None, Some(coefficient)) => Some(coefficient.0),
            _ => {
                let message = "absorption needs either color and distance, or coefficient (1/m)";
                cx.conflict(&table.at, message);
                None
            }
        }
    }
}

/// `[medium.NAME]`, which are known by name from then on. The first is the ambient one.
#[derive(Debug)]
pub struct Media(pub Vec<Medium>);

impl Media {
    /// Puts the ambient medium in front and makes the names known.
    fn known(mut media: Vec<Medium>, cx: &mut Reader<'_>) -> Self {
        let ambient = cx.ambient.take();
        let chosen = ambient
            .as_ref()
            .and_then(|name| media.iter().position(|m| m.name == name.value.0));
        if let (None, Some(name)) = (chosen, &ambient) {
            let known = media.iter().map(|m| m.name.as_str());
            cx.error(&name.at, || {
                Problem::unknown("medium", &name.value.0, known)
            });
        }
        let vacuum = || Medium {
            name: "ambient".to_owned(),
            ior: Ior::constant(1.0),
            absorption: None,
            use_k: false,
        };
        let first = chosen.map_or_else(vacuum, |i| media.remove(i));
        media.insert(0, first);
        let ids = media.iter().enumerate();
        cx.media = ids
            .map(|(i, medium)| (medium.name.clone(), MediumId(i as u32)))
            .collect();
        Self(media)
    }
}

impl Value for Media {
    fn form() -> Form {
        Form::Map(Box::new(Form::Table(MediumKeys::KIND)))
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let mut media = Vec::new();
        definitions(node, cx, |name, node, cx| {
            let (ior, use_k, absorption) =
                medium(node, cx).unwrap_or_else(|| (Ior::constant(1.0), true, None));
            media.push(Medium {
                name: name.to_owned(),
                ior,
                absorption,
                use_k,
            });
            Some(())
        })?;
        Some(Self::known(media, cx))
    }

    fn absent(_: &Table<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        Some(Self::known(Vec::new(), cx))
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}

/// Index, whether its k absorbs, and further absorption.
fn medium(node: Node<'_>, cx: &mut Reader<'_>) -> Option<(Ior, bool, Option<Curve>)> {
    let table = Table::of(node, MediumKeys::NAMES, cx)?;
    let keys = MediumKeys::from_table(&table, cx)?;
    table.exactly_one(&MediumKeys::NAMES[..5], "medium", cx)?;
    if keys.extrapolate && keys.file.is_none() {
        cx.conflict(
            &table.span("extrapolate"),
            "extrapolate is for tables (file) only",
        );
    }
    let given = [
        keys.glass
            .as_ref()
            .map(|glass| library_index(&glass.value.0, &glass.at, false, cx)),
        keys.ior.map(|n| Some(Ior::constant(n))),
        keys.cauchy.as_ref().map(|c| cauchy(c, cx)),
        keys.sellmeier.as_ref().map(|s| sellmeier(s, cx)),
        keys.file
            .as_ref()
            .map(|file| tabulated(file, keys.extrapolate, cx)),
    ];
    let ior = given.into_iter().flatten().next()??;
    Some((ior, keys.use_k, keys.absorption.map(|a| a.0)))
}

/// An index that is given at all wavelengths of the scene.
pub fn validated(ior: Ior, conductor: bool, at: &Span<usize>, cx: &mut Reader<'_>) -> Ior {
    if let Some(range_nm) = cx.range_nm {
        let valid = if conductor {
            ior.validate_conductor(range_nm)
        } else {
            ior.validate(range_nm)
        };
        if let Err(error) = valid {
            cx.conflict(at, error.to_string());
        }
    }
    ior
}

/// The index of a glass or metal of the library.
pub fn library_index(
    name: &str,
    at: &Span<usize>,
    conductor: bool,
    cx: &mut Reader<'_>,
) -> Option<Ior> {
    match cx.library.ior(name) {
        Ok(ior) => Some(validated(ior, conductor, at, cx)),
        Err(error) => {
            cx.not_in_library(at, error);
            None
        }
    }
}

fn cauchy(given: &At<Vec<f64>>, cx: &mut Reader<'_>) -> Option<Ior> {
    let c = &given.value;
    if c.is_empty() || c.len() > 6 {
        let message = "cauchy needs 1 to 6 coefficients (of λ in µm to the powers 0, -2, -4, ...)";
        cx.conflict(&given.at, message);
        return None;
    }
    let mut coefficients = vec![c[0]];
    for (i, value) in c.iter().enumerate().skip(1) {
        coefficients.extend([*value, -2.0 * i as f64]);
    }
    formula(5, coefficients, "Cauchy", &given.at, cx)
}

fn sellmeier(given: &At<Vec<[f64; 2]>>, cx: &mut Reader<'_>) -> Option<Ior> {
    let terms = &given.value;
    if terms.is_empty() || terms.len() > 6 {
        let message = "sellmeier needs 1 to 6 terms [B, C] (C in µm²)";
        cx.conflict(&given.at, message);
        return None;
    }
    let constant = std::iter::once(0.0);
    let coefficients = constant.chain(terms.iter().flatten().copied()).collect();
    formula(2, coefficients, "Sellmeier", &given.at, cx)
}

/// A formula of the scene file: fitted by its author to the whole working range, as far as anyone
/// knows.
fn formula(
    number: u8,
    coefficients: Vec<f64>,
    name: &str,
    at: &Span<usize>,
    cx: &mut Reader<'_>,
) -> Option<Ior> {
    let range_nm = cx
        .range_nm
        .filter(|_| coefficients.iter().all(|c| FINITE.contains(*c)))?;
    match Ior::formula(number, coefficients, range_nm) {
        Ok(ior) => Some(validated(ior.named(name, "the scene file"), false, at, cx)),
        Err(error) => {
            cx.conflict(at, error.to_string());
            None
        }
    }
}

fn tabulated(file: &At<FileName>, extrapolate: bool, cx: &mut Reader<'_>) -> Option<Ior> {
    let rows = cx.csv::<3>(file)?;
    let wrong = |r: &&[f64; 3]| r[0] <= 0.0 || !INDEX.contains(r[1]) || r[2] < 0.0;
    if let Some([nm, n, k]) = rows.iter().find(wrong) {
        let allowed = "(allowed: nm > 0, n from 1 to 10, k >= 0)";
        cx.bad_file(file, format!("row {nm}, {n}, {k} {allowed}"));
        return None;
    }
    let column = |i: usize| rows.iter().map(|r| r[i]).collect::<Vec<f64>>();
    let ior = Ior::table(&column(0), &column(1), &column(2)).with_extrapolation(extrapolate);
    let ior = ior.named("the table", "the scene file");
    Some(validated(ior, false, &file.at, cx))
}
