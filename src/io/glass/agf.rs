//! AGF glass catalogs.
//!
//! Records of two letters: `NM` name and formula, `CD` its coefficients, `LD` the range in
//! micrometers, `IT` internal transmittance (wavelength, transmittance, thickness in millimeters);
//! all others do not bear on n and k. Each of the thirteen dispersion formulas is one of those of
//! refractiveindex.info with its coefficients in another order.

use super::{CatalogError, number};
use crate::spectrum::{Curve, Ior};

/// Most glasses of a catalog.
const MAX_GLASSES: usize = 20_000;
/// Most rows of internal transmittance of a glass.
const MAX_ROWS: usize = 10_000;
/// Extinction where nothing passes: a transmittance of 0 stands for less than this.
const LEAST_TRANSMITTANCE: f64 = 1e-5;

struct Record<'a> {
    line: usize,
    name: &'a str,
    formula: u8,
    coefficients: Vec<f64>,
    range_nm: Option<[f64; 2]>,
    /// Nanometers and extinction.
    k: Vec<(f64, f64)>,
}

/// Reads a catalog; glasses are named `catalog:NAME`.
///
/// # Errors
/// If a record is not well formed, with its line.
pub fn parse(text: &str, catalog: &str) -> Result<Vec<Ior>, CatalogError> {
    let mut glasses = Vec::new();
    let mut open: Option<Record> = None;
    for (i, text) in text.lines().enumerate() {
        let line = i + 1;
        let bad = |message: String| CatalogError { line, message };
        let (tag, rest) = text.trim_end().split_at_checked(2).unwrap_or((text, ""));
        let words: Vec<&str> = rest.split_whitespace().collect();
        if tag == "NM" {
            if let Some(record) = open.take() {
                glasses.push(finish(record, catalog)?);
            }
            if glasses.len() == MAX_GLASSES {
                return Err(bad(format!("more than {MAX_GLASSES} glasses")));
            }
            let (Some(name), Some(formula)) = (words.first(), words.get(1)) else {
                return Err(bad("NM takes a name and the number of a formula".to_owned()));
            };
            let value = number(formula, line)?;
            if !(1.0..=13.0).contains(&value) || value.fract() != 0.0 {
                return Err(bad(format!("dispersion formula {formula} (1 to 13)")));
            }
            open = Some(Record {
                line,
                name,
                formula: value as u8,
                coefficients: Vec::new(),
                range_nm: None,
                k: Vec::new(),
            });
            continue;
        }
        if !matches!(tag, "CD" | "LD" | "IT") {
            continue;
        }
        let Some(record) = &mut open else {
            return Err(bad(format!("{tag} before the first NM")));
        };
        match tag {
            "CD" => {
                if words.len() > 16 {
                    return Err(bad(format!("{} coefficients (up to 16)", words.len())));
                }
                record.coefficients = words
                    .iter()
                    .map(|w| number(w, line))
                    .collect::<Result<_, _>>()?;
            }
            "LD" => {
                let (Some(low), Some(high)) = (words.first(), words.get(1)) else {
                    return Err(bad("LD takes the first and last wavelength".to_owned()));
                };
                record.range_nm = Some([number(low, line)? * 1e3, number(high, line)? * 1e3]);
            }
            _ => {
                // rows of fewer numbers stand for wavelengths without data
                let &[um, transmittance, mm, ..] = words.as_slice() else {
                    continue;
                };
                let (um, transmittance, mm) = (
                    number(um, line)?,
                    number(transmittance, line)?,
                    number(mm, line)?,
                );
                if mm == 0.0 {
                    continue;
                }
                if !(um > 0.0 && mm > 0.0 && (0.0..=1.0).contains(&transmittance)) {
                    return Err(bad(format!(
                        "internal transmittance {transmittance} of {mm} mm at {um} um (0 to 1, thickness and wavelength greater than 0)"
                    )));
                }
                if record.k.len() == MAX_ROWS {
                    return Err(bad(format!("more than {MAX_ROWS} rows of IT")));
                }
                // T = exp(-4 pi k d / lambda)
                let depth = -transmittance.max(LEAST_TRANSMITTANCE).ln();
                let k = depth * um * 1e-3 / (4.0 * std::f64::consts::PI * mm);
                record.k.push((um * 1e3, k));
            }
        }
    }
    if let Some(record) = open {
        glasses.push(finish(record, catalog)?);
    }
    if glasses.is_empty() {
        return Err(CatalogError {
            line: 1,
            message: "no glass (NM records)".to_owned(),
        });
    }
    Ok(glasses)
}

fn finish(mut record: Record, catalog: &str) -> Result<Ior, CatalogError> {
    let name = format!("{catalog}:{}", record.name);
    let bad = |message: String| CatalogError {
        line: record.line,
        message: format!("{name}: {message}"),
    };
    let range = record
        .range_nm
        .ok_or_else(|| bad("no LD record: the range is not known".to_owned()))?;
    if record.coefficients.is_empty() {
        return Err(bad("no CD record".to_owned()));
    }
    let ior =
        formula(record.formula, &record.coefficients, range).map_err(|e| bad(e.to_string()))?;
    record.k.sort_by(|a, b| a.0.total_cmp(&b.0));
    record.k.dedup_by(|a, b| a.0 == b.0);
    let (nm, k): (Vec<f64>, Vec<f64>) = record.k.into_iter().unzip();
    let ior = if nm.is_empty() {
        ior
    } else {
        ior.with_k(Curve::table(&nm, &k))
    };
    Ok(ior.named(name, "AGF catalog"))
}

/// An AGF dispersion formula, 1 to 13, wavelengths in micrometers; missing coefficients are 0.
///
/// # Errors
/// If there is no such formula, or the range is none.
pub fn formula(
    number: u8,
    coefficients: &[f64],
    range_nm: [f64; 2],
) -> Result<Ior, crate::spectrum::IorError> {
    let c = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
    // n^2 as a sum of powers of the wavelength
    let powers = |exponents: &[f64]| {
        let terms = exponents
            .iter()
            .enumerate()
            .flat_map(|(i, &e)| [c(i + 1), e]);
        (3, std::iter::once(c(0)).chain(terms).collect())
    };
    let sellmeier = |terms: usize| {
        let pairs = (0..2 * terms).map(c);
        (2, std::iter::once(0.0).chain(pairs).collect())
    };
    let (kind, list): (u8, Vec<f64>) = match number {
        1 => powers(&[2.0, -2.0, -4.0, -6.0, -8.0]),
        2 => sellmeier(3),
        3 => (7, (0..6).map(c).collect()),
        // n^2 - 1 = A + B1 L^2 / (L^2 - l1^2) + B2 / (L^2 - l2^2)
        4 => (
            4,
            vec![1.0 + c(0), c(1), 2.0, c(2), 2.0, c(3), 0.0, c(4), 2.0],
        ),
        5 => (5, vec![c(0), c(1), -1.0, c(2), -3.5]),
        6 => sellmeier(4),
        7 => (
            4,
            vec![c(0), c(1), 0.0, c(2), 1.0, 0.0, 0.0, 0.0, 0.0, -c(3), 2.0],
        ),
        8 => (
            4,
            vec![c(0), c(1), 2.0, c(2), 1.0, 0.0, 0.0, 0.0, 0.0, -c(3), 2.0],
        ),
        9 => (4, vec![c(0), c(1), 2.0, c(2), 1.0, c(3), 2.0, c(4), 1.0]),
        10 => powers(&[2.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0]),
        11 => sellmeier(5),
        12 => powers(&[2.0, -2.0, -4.0, -6.0, -8.0, 4.0, 6.0]),
        13 => powers(&[2.0, 4.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0]),
        other => {
            return Err(crate::spectrum::IorError::BadFormula(format!(
                "there is no dispersion formula {other} (1 to 13)"
            )));
        }
    };
    Ior::formula(kind, list, range_nm)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The formulas as they are printed, at wavelength `l` in micrometers.
    fn printed(number: u8, a: &[f64], l: f64) -> f64 {
        let l2 = l * l;
        let even = |i: i32| l.powi(i);
        let sellmeier = |terms: usize| {
            let pairs = a[..2 * terms].chunks(2);
            (1.0 + pairs.map(|p| p[0] * l2 / (l2 - p[1])).sum::<f64>()).sqrt()
        };
        let sum = |exponents: &[i32]| {
            let terms = exponents.iter().zip(a).map(|(&e, a)| a * even(e));
            terms.sum::<f64>().sqrt()
        };
        match number {
            1 => sum(&[0, 2, -2, -4, -6, -8]),
            2 => sellmeier(3),
            3 => {
                let h = 1.0 / (l2 - 0.028);
                a[0] + a[1] * h + a[2] * h * h + a[3] * l2 + a[4] * even(4) + a[5] * even(6)
            }
            4 => (1.0 + a[0] + a[1] * l2 / (l2 - a[2] * a[2]) + a[3] / (l2 - a[4] * a[4])).sqrt(),
            5 => a[0] + a[1] / l + a[2] / l.powf(3.5),
            6 => sellmeier(4),
            7 => (a[0] + a[1] / (l2 - a[2]) - a[3] * l2).sqrt(),
            8 => (a[0] + a[1] * l2 / (l2 - a[2]) - a[3] * l2).sqrt(),
            9 => (a[0] + a[1] * l2 / (l2 - a[2]) + a[3] * l2 / (l2 - a[4])).sqrt(),
            10 => sum(&[0, 2, -2, -4, -6, -8, -10, -12]),
            11 => sellmeier(5),
            12 => sum(&[0, 2, -2, -4, -6, -8, 4, 6]),
            _ => sum(&[0, 2, 4, -2, -4, -6, -8, -10, -12]),
        }
    }

    #[test]
    fn thirteen_formulas() {
        for number in 1..=13 {
            // small numbers in all places, so that one in the wrong place shows
            let mut a: Vec<f64> = (0..10).map(|i| 1e-3 * f64::from(i + 1)).collect();
            a[0] = match number {
                3 | 5 => 1.5,
                2 | 4 | 6 | 11 => 0.9,
                _ => 2.2,
            };
            for l in [0.45, 0.5876, 1.1] {
                let ior = formula(number, &a, [400.0, 1200.0]).unwrap();
                let expected = printed(number, &a, l);
                assert!(
                    (ior.n(l * 1e3) - expected).abs() < 1e-13,
                    "formula {number} at {l}"
                );
            }
        }
        assert!(formula(14, &[1.0], [400.0, 700.0]).is_err());
    }

    #[test]
    fn internal_transmittance_becomes_k() {
        let text = "CC remark\nNM G 2 517642 1.5168 64.17 0\nED 7.1 8.3 2.51 -0.0009 0\n\
                    CD 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653 0 0 0 0\n\
                    LD 0.3 2.5\nIT 0.5 0.99 10\nIT 0.4 0.95 10\nIT 0.6\n";
        let glasses = parse(text, "mine").unwrap();
        let glass = &glasses[0];
        assert_eq!(glass.name(), "mine:G");
        assert!((glass.n(587.5618) - 1.5168).abs() < 1e-6);
        for (nm, t) in [(500.0, 0.99f64), (400.0, 0.95)] {
            let depth = 4.0 * std::f64::consts::PI * glass.k(nm) * 10.0 / (nm * 1e-6);
            assert!(((-depth).exp() - t).abs() < 1e-14);
        }
    }

    #[test]
    fn bad_catalogs_say_where() {
        for (text, line, part) in [
            ("", 1, "no glass"),
            ("CD 1 2\n", 1, "before the first NM"),
            ("NM G\n", 1, "takes a name"),
            ("NM G 14\n", 1, "1 to 13"),
            ("NM G 2.5\n", 1, "1 to 13"),
            ("CC x\nNM G 2\nCD 1 x\n", 3, "`x` is not a finite number"),
            ("NM G 2\nLD 0.4\n", 2, "first and last"),
            ("NM G 2\nLD 0.4 0.7\n", 1, "no CD"),
            ("NM G 2\nCD 1\n", 1, "no LD"),
            ("NM G 2\nCD 1\nLD 0.7 0.4\n", 1, "not a wavelength range"),
            (
                "NM G 2\nCD 1\nLD 0.4 0.7\nIT 0.5 1.2 10\n",
                4,
                "internal transmittance",
            ),
        ] {
            let e = parse(text, "c").unwrap_err();
            assert_eq!(e.line, line, "{text:?}: {e}");
            assert!(e.message.contains(part), "{text:?}: {e}");
        }
    }
}
