//! Readers of spectrum files: CSV tables and TOML catalogs of refractive indices (formats:
//! `spectra/README.md`).
//!
//! Files come from outside: every number is checked, sizes are capped, and errors say where.

use serde::Deserialize;
use thiserror::Error;

use super::{Curve, Ior};

/// Largest file read, bytes.
pub const MAX_FILE_BYTES: usize = 16 << 20;
/// Most rows of a table.
pub const MAX_ROWS: usize = 100_000;
/// Most columns of a table.
const MAX_COLUMNS: usize = 256;

/// Fault of a spectrum file, and its place (both counted from 1).
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{line}:{column}: {message}")]
pub struct SpectrumFileError {
    /// Line of the file.
    pub line: usize,
    /// Column of the line, in characters.
    pub column: usize,
    /// Fault, and what is allowed.
    pub message: String,
}

pub(super) fn error<T>(
    line: usize,
    column: usize,
    message: impl Into<String>,
) -> Result<T, SpectrumFileError> {
    Err(SpectrumFileError {
        line,
        column,
        message: message.into(),
    })
}

/// Reads a CSV file with one value column: `nm,value`.
///
/// # Errors
/// If the file is too large, has no rows, more than one value column, a field that is not a finite
/// number, or wavelengths that are not positive and strictly increasing.
pub fn parse_curve_csv(text: &str) -> Result<Curve, SpectrumFileError> {
    let table = parse_table(text)?;
    match table.columns.as_slice() {
        [(_, values)] => Ok(Curve::table(&table.nm, values)),
        columns => {
            let message = format!(
                "{} value columns (a spectrum has one: nm,value)",
                columns.len()
            );
            error(table.first_line, 1, message)
        }
    }
}

/// Reads any bytes as a table: must not panic.
pub fn fuzz_curve(bytes: &[u8]) {
    // the outcome does not matter
    _ = parse_curve_csv(&String::from_utf8_lossy(bytes));
}

/// Reads any bytes as a catalog of refractive indices: must not panic.
pub fn fuzz_glass(bytes: &[u8]) {
    // the outcome does not matter
    _ = parse_glass_toml(&String::from_utf8_lossy(bytes));
}

/// A CSV file as read: wavelengths and named columns of the same length.
pub(super) struct Table {
    pub nm: Vec<f64>,
    pub columns: Vec<(String, Vec<f64>)>,
    first_line: usize,
}

/// Reads a CSV file with any number of value columns.
pub(super) fn parse_table(text: &str) -> Result<Table, SpectrumFileError> {
    if text.len() > MAX_FILE_BYTES {
        return error(
            1,
            1,
            format!("the file is larger than {MAX_FILE_BYTES} bytes"),
        );
    }
    let mut table = Table {
        nm: Vec::new(),
        columns: Vec::new(),
        first_line: 1,
    };
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    for (i, line) in text.lines().enumerate() {
        let number = i + 1;
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let fields: Vec<&str> = line.split(',').collect();
        if table.columns.is_empty() {
            table.first_line = number;
            if !(2..=MAX_COLUMNS).contains(&fields.len()) {
                let message = format!("{} columns (nm and 1 to {})", fields.len(), MAX_COLUMNS - 1);
                return error(number, 1, message);
            }
            if fields[0].trim().parse::<f64>().is_err() {
                if fields[0].trim() != "nm" {
                    return error(number, 1, "the header begins with `nm`");
                }
                let name = |f: &&str| (f.trim().to_owned(), Vec::new());
                table.columns = fields[1..].iter().map(name).collect();
                continue;
            }
            let name = |_: &&str| (String::from("value"), Vec::new());
            table.columns = fields[1..].iter().map(name).collect();
        }
        if fields.len() != table.columns.len() + 1 {
            let (have, want) = (fields.len(), table.columns.len() + 1);
            return error(
                number,
                1,
                format!("{have} fields where {want} are expected"),
            );
        }
        if table.nm.len() == MAX_ROWS {
            return error(number, 1, format!("more than {MAX_ROWS} rows"));
        }
        let mut column = 1;
        for (j, field) in fields.iter().enumerate() {
            let value = match field.trim().parse::<f64>() {
                Ok(v) if v.is_finite() => v,
                _ => {
                    return error(
                        number,
                        column,
                        format!("`{}` is not a finite number", field.trim()),
                    );
                }
            };
            column += field.chars().count() + 1;
            if j > 0 {
                table.columns[j - 1].1.push(value);
            } else if value <= 0.0 {
                return error(number, 1, format!("wavelength {value} nm (greater than 0)"));
            } else if let Some(&last) = table.nm.last().filter(|&&last| last >= value) {
                let message =
                    format!("wavelength {value} nm after {last} nm (strictly increasing)");
                return error(number, 1, message);
            } else {
                table.nm.push(value);
            }
        }
    }
    if table.nm.is_empty() {
        return error(1, 1, "no rows (nm,value)");
    }
    Ok(table)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Catalog {
    catalog: String,
    #[serde(default)]
    glass: Vec<toml::Spanned<Glass>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Glass {
    name: String,
    #[serde(default)]
    source: String,
    #[serde(default)]
    note: String,
    formula: Option<u8>,
    coefficients: Option<Vec<f64>>,
    range_um: Option<[f64; 2]>,
    k_um: Option<Vec<[f64; 2]>>,
    nk_um: Option<Vec<[f64; 3]>>,
    #[serde(default)]
    extrapolate: bool,
}

/// Reads a TOML catalog of refractive indices; each is named `catalog:name`.
///
/// # Errors
/// If the file is too large or not of the documented form, or a table or formula in it is not
/// usable.
pub fn parse_glass_toml(text: &str) -> Result<Vec<Ior>, SpectrumFileError> {
    if text.len() > MAX_FILE_BYTES {
        return error(
            1,
            1,
            format!("the file is larger than {MAX_FILE_BYTES} bytes"),
        );
    }
    let place = |offset: usize| {
        let before = text.get(..offset).unwrap_or(text);
        let line = before.matches('\n').count() + 1;
        let column = before
            .rsplit('\n')
            .next()
            .unwrap_or_default()
            .chars()
            .count()
            + 1;
        (line, column)
    };
    let at = |offset: usize, message: String| {
        let (line, column) = place(offset);
        SpectrumFileError {
            line,
            column,
            message,
        }
    };
    let catalog: Catalog = toml::from_str(text)
        .map_err(|e| at(e.span().map_or(0, |s| s.start), e.message().to_owned()))?;
    let read = |glass: toml::Spanned<Glass>| {
        let offset = glass.span().start;
        let glass = glass.into_inner();
        let name = format!("{}:{}", catalog.catalog, glass.name);
        glass_to_ior(glass, &name).map_err(|message| at(offset, format!("{name}: {message}")))
    };
    catalog.glass.into_iter().map(read).collect()
}

fn glass_to_ior(glass: Glass, name: &str) -> Result<Ior, String> {
    let to_nm = |um: f64| (um * 1e6).round() / 1e3;
    let ior = match (
        glass.formula,
        glass.coefficients,
        glass.range_um,
        glass.nk_um,
    ) {
        (Some(number), Some(coefficients), Some(range), None) => {
            Ior::formula(number, coefficients, range.map(to_nm)).map_err(|e| e.to_string())?
        }
        (None, None, None, Some(rows)) => {
            if glass.k_um.is_some() {
                return Err(String::from("`nk_um` holds k already, no `k_um` beside it"));
            }
            let (um, rest): (Vec<f64>, Vec<[f64; 2]>) =
                rows.iter().map(|r| (r[0], [r[1], r[2]])).unzip();
            check_um(&um)?;
            if rest
                .iter()
                .any(|[n, k]| !(n.is_finite() && *n > 0.0 && k.is_finite() && *k >= 0.0))
            {
                return Err(String::from("n must be greater than 0 and k at least 0"));
            }
            let nm: Vec<f64> = um.iter().map(|&l| to_nm(l)).collect();
            let (n, k): (Vec<f64>, Vec<f64>) = rest.iter().map(|r| (r[0], r[1])).unzip();
            Ior::table(&nm, &n, &k).with_extrapolation(glass.extrapolate)
        }
        _ => {
            return Err(String::from(
                "either `formula`, `coefficients` and `range_um`, or `nk_um` is needed",
            ));
        }
    };
    let ior = match glass.k_um {
        None => ior,
        Some(rows) => {
            let (um, k): (Vec<f64>, Vec<f64>) = rows.iter().map(|r| (r[0], r[1])).unzip();
            check_um(&um)?;
            if k.iter().any(|k| !(k.is_finite() && *k >= 0.0)) {
                return Err(String::from("k must be at least 0"));
            }
            let nm: Vec<f64> = um.iter().map(|&l| to_nm(l)).collect();
            ior.with_k(Curve::table(&nm, &k))
        }
    };
    let source = match glass.note.as_str() {
        "" => glass.source,
        note => format!("{} ({note})", glass.source),
    };
    Ok(ior.named(name, source))
}

fn check_um(um: &[f64]) -> Result<(), String> {
    if um.is_empty() || um.len() > MAX_ROWS {
        return Err(format!("a table has 1 to {MAX_ROWS} rows"));
    }
    // At least 1e-3 nm apart: the precision wavelengths are kept at.
    let increasing = um.windows(2).all(|w| w[1] - w[0] >= 0.999e-6);
    if !increasing || um.iter().any(|l| !(l.is_finite() && *l >= 1e-3)) {
        return Err(String::from(
            "wavelengths must be strictly increasing micrometers",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_with_and_without_header() {
        for text in [
            "# c\nnm,value\n400, 1\n500,3\n",
            "400,1\n\n500,3",
            "\u{feff}400,1\r\n500,3\r\n",
        ] {
            assert_eq!(parse_curve_csv(text).unwrap().eval(450.0), 2.0);
        }
        let table = parse_table("nm,a,b\n400,1,2\n").unwrap();
        assert_eq!(table.columns[1], (String::from("b"), vec![2.0]));
    }

    #[test]
    fn bad_csv_says_where() {
        for (text, line, column) in [
            ("", 1, 1),
            ("# only a comment\n", 1, 1),
            ("nm,value\n", 1, 1),
            ("400,1\n500,NaN\n", 2, 5),
            ("400,1\n500,inf\n", 2, 5),
            ("400,1\n500,\n", 2, 5),
            ("nm,value\n400,1\n400,2\n", 3, 1),
            ("400,1\n300,2\n", 2, 1),
            ("-1,1\n", 1, 1),
            ("400,1\n500\n", 2, 1),
            ("400,1\n500,1,2\n", 2, 1),
            ("lambda,value\n400,1\n", 1, 1),
            ("nm,a,b\n400,1,2\n", 1, 1),
            ("400\n", 1, 1),
            ("\0\u{ff}", 1, 1),
        ] {
            let e = parse_curve_csv(text).unwrap_err();
            assert_eq!((e.line, e.column), (line, column), "{text:?}: {e}");
        }
        let long: String = (1..=MAX_ROWS + 1).map(|i| format!("{i},1\n")).collect();
        assert_eq!(parse_curve_csv(&long).unwrap_err().line, MAX_ROWS + 1);
    }

    #[test]
    fn toml_formula_and_table() {
        let text = "catalog = \"my\"\n[[glass]]\nname = \"A\"\nformula = 5\ncoefficients = [1.5]\n\
                    range_um = [0.4, 0.7]\nk_um = [[0.5, 1e-6]]\n[[glass]]\nname = \"B\"\n\
                    nk_um = [[0.4, 1.5, 0], [0.6, 1.7, 1e-3]]\n";
        let glasses = parse_glass_toml(text).unwrap();
        assert_eq!(glasses[0].name(), "my:A");
        assert_eq!((glasses[0].n(500.0), glasses[0].k(800.0)), (1.5, 1e-6));
        assert!((glasses[1].n(500.0) - 1.6).abs() < 1e-12);
        assert_eq!(glasses[1].fitted_range_nm(), Some([400.0, 600.0]));
    }

    #[test]
    fn bad_toml_says_where() {
        let entry = |rest: &str| format!("catalog = \"my\"\n[[glass]]\nname = \"A\"\n{rest}\n");
        for (text, line) in [
            (entry(""), 2),
            (
                entry("formula = 10\ncoefficients = [1.0]\nrange_um = [0.4, 0.7]"),
                2,
            ),
            (
                entry("formula = 2\ncoefficients = [1.0, 2.0]\nrange_um = [0.4, 0.7]"),
                2,
            ),
            (
                entry("formula = 2\ncoefficients = [nan]\nrange_um = [0.4, 0.7]"),
                2,
            ),
            (entry("nk_um = []"), 2),
            (entry("nk_um = [[0.4, 1.5, 0.0], [0.4, 1.5, 0.0]]"), 2),
            (entry("nk_um = [[0.4, -1.5, 0.0]]"), 2),
            (entry("colour = 1"), 4),
            (entry("formula = \"two\""), 4),
            (String::from("catalog = 3"), 1),
        ] {
            let e = parse_glass_toml(&text).unwrap_err();
            assert_eq!(e.line, line, "{text}: {e}");
        }
    }
}
