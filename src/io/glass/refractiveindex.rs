//! Materials of the refractiveindex.info database: the part of its YAML that bears on n and k.
//!
//! A file has a list `DATA` of entries: `type: formula 1` to `9` with `wavelength_range` and
//! `coefficients`, or `type: tabulated n`, `k` or `nk` with a block `data` of rows, wavelengths in
//! micrometers. All other keys are passed over.

use super::{CatalogError, number};
use crate::spectrum::{Curve, Ior};

/// Most rows of all tables of a file.
const MAX_ROWS: usize = 100_000;

/// One entry of `DATA`.
struct Entry<'a> {
    line: usize,
    kind: &'a str,
    range: Option<[f64; 2]>,
    coefficients: Vec<f64>,
    rows: Vec<(usize, Vec<f64>)>,
}

/// Reads a material.
///
/// # Errors
/// If there is no index in it or an entry is not well formed, with the line.
pub fn parse(text: &str) -> Result<Ior, CatalogError> {
    let entries = entries(text)?;
    let error = |line: usize, message: &str| CatalogError {
        line,
        message: message.to_owned(),
    };
    let mut index: Option<Ior> = None;
    let mut extinction: Option<Curve> = None;
    for entry in &entries {
        let words: Vec<&str> = entry.kind.split_whitespace().collect();
        let new = match words.as_slice() {
            ["formula", n] => {
                let number: u8 = n
                    .parse()
                    .map_err(|_| error(entry.line, "formulas are 1 to 9"))?;
                let [low, high] = entry
                    .range
                    .ok_or_else(|| error(entry.line, "a formula needs a wavelength_range"))?;
                let range_nm = [to_nm(low), to_nm(high)];
                let ior = Ior::formula(number, entry.coefficients.clone(), range_nm);
                Some(ior.map_err(|e| error(entry.line, &e.to_string()))?)
            }
            ["tabulated", kind @ ("n" | "k" | "nk")] => {
                let width = kind.len() + 1;
                let (nm, columns) = table(entry, width)?;
                let column = |i: usize| -> Vec<f64> { columns.iter().map(|c| c[i]).collect() };
                match *kind {
                    "k" => {
                        extinction = Some(Curve::table(&nm, &column(0)));
                        None
                    }
                    "n" => Some(Ior::table(&nm, &column(0), &vec![0.0; nm.len()]).without_k()),
                    _ => Some(Ior::table(&nm, &column(0), &column(1))),
                }
            }
            _ => {
                let message = format!(
                    "type `{}` (formula 1 to 9, tabulated n, k or nk)",
                    entry.kind
                );
                return Err(error(entry.line, &message));
            }
        };
        if let Some(new) = new
            && index.replace(new).is_some()
        {
            return Err(error(entry.line, "a second refractive index"));
        }
    }
    let index = index.ok_or_else(|| error(1, "no refractive index (an entry of DATA)"))?;
    Ok(match extinction {
        Some(k) => index.with_k(k),
        None => index,
    })
}

fn to_nm(um: f64) -> f64 {
    (um * 1e6).round() / 1e3
}

/// Wavelengths in nanometers, and the other columns of each row. Rows may descend.
fn table(entry: &Entry, width: usize) -> Result<(Vec<f64>, Vec<Vec<f64>>), CatalogError> {
    let mut rows = Vec::with_capacity(entry.rows.len());
    for (line, row) in &entry.rows {
        let bad = |message: String| CatalogError {
            line: *line,
            message,
        };
        if row.len() != width {
            return Err(bad(format!(
                "{} numbers where {width} are expected",
                row.len()
            )));
        }
        if row[0] < 1e-3 || row[1..].iter().any(|&v| v < 0.0) {
            return Err(bad(
                "wavelengths must be at least 0.001 um, n and k at least 0".to_owned(),
            ));
        }
        rows.push((to_nm(row[0]), row[1..].to_vec()));
    }
    if rows.is_empty() {
        return Err(CatalogError {
            line: entry.line,
            message: "a table needs at least one row of data".to_owned(),
        });
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    rows.dedup_by(|a, b| a.0 == b.0);
    Ok(rows.into_iter().unzip())
}

/// The entries of `DATA`.
fn entries(text: &str) -> Result<Vec<Entry<'_>>, CatalogError> {
    let mut out: Vec<Entry> = Vec::new();
    let (mut in_data, mut rows_deeper_than) = (false, None);
    let mut total = 0;
    for (i, full) in text.lines().enumerate() {
        let line = i + 1;
        let bad = |message: &str| CatalogError {
            line,
            message: message.to_owned(),
        };
        let content = full.trim();
        let indent = full.len() - full.trim_start().len();
        if content.is_empty() || content.starts_with('#') {
            continue;
        }
        if indent == 0 && !content.starts_with('-') {
            in_data = content == "DATA:";
            rows_deeper_than = None;
            continue;
        }
        if !in_data {
            continue;
        }
        if let Some(depth) = rows_deeper_than {
            if indent > depth {
                let words: Result<Vec<f64>, _> = content
                    .split_whitespace()
                    .map(|w| number(w, line))
                    .collect();
                total += 1;
                if total > MAX_ROWS {
                    return Err(bad("more than 100000 rows"));
                }
                let entry = out.last_mut().ok_or_else(|| bad("data before a type"))?;
                entry.rows.push((line, words?));
                continue;
            }
            rows_deeper_than = None;
        }
        let key_value = match content.strip_prefix('-') {
            Some(rest) => {
                out.push(Entry {
                    line,
                    kind: "",
                    range: None,
                    coefficients: Vec::new(),
                    rows: Vec::new(),
                });
                rest.trim_start()
            }
            None => content,
        };
        let (key, value) = key_value
            .split_once(':')
            .ok_or_else(|| bad("`key: value` is expected"))?;
        let value = value.trim();
        let entry = out
            .last_mut()
            .ok_or_else(|| bad("DATA is a list: its entries begin with `-`"))?;
        let numbers = |text: &str| -> Result<Vec<f64>, CatalogError> {
            text.split_whitespace().map(|w| number(w, line)).collect()
        };
        match key.trim() {
            "type" => entry.kind = value.trim_matches(['"', '\'']),
            "wavelength_range" | "range" => match numbers(value)?.as_slice() {
                &[low, high] => entry.range = Some([low, high]),
                _ => return Err(bad("a range has two wavelengths")),
            },
            "coefficients" => {
                entry.coefficients = numbers(value)?;
                if entry.coefficients.len() > 100 {
                    return Err(bad("more than 100 coefficients"));
                }
            }
            "data" => {
                if !value.starts_with('|') {
                    return Err(bad("data is a block that begins with `|`"));
                }
                rows_deeper_than = Some(indent);
            }
            _ => {}
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formula_with_a_table_of_k() {
        let text = "# cc0\nREFERENCES: |\n    <a href=\"x\">DATA: y</a>\nDATA:\n  - type: formula 2\n    wavelength_range: 0.3 2.5\n    \
                    coefficients: 0 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653\n  \
                    - type: tabulated k\n    data: |\n        0.400 1.0E-08\n        0.600 3.0E-08\nCONDITIONS:\n    temperature: 293\n";
        let ior = parse(text).unwrap();
        assert!((ior.n(587.5618) - 1.5168).abs() < 1e-6);
        assert!((ior.k(500.0) - 2e-8).abs() < 1e-20);
        assert_eq!(ior.fitted_range_nm(), Some([300.0, 2500.0]));
    }

    #[test]
    fn tables() {
        let nk = parse("DATA:\n  - type: tabulated nk\n    data: |\n        0.6 1.7 0.1\n        0.4 1.5 0.2\n").unwrap();
        assert!((nk.n(500.0) - 1.6).abs() < 1e-14 && (nk.k(400.0) - 0.2).abs() < 1e-15);
        let n = parse("DATA:\n- type: tabulated n\n  data: |\n   0.4 1.5\n   0.6 1.7\n").unwrap();
        assert!((n.n(500.0) - 1.6).abs() < 1e-14 && !n.has_k());
    }

    #[test]
    fn bad_files_say_where() {
        for (text, line, part) in [
            ("", 1, "no refractive index"),
            ("DATA:\n  type: formula 1\n", 2, "list"),
            (
                "DATA:\n  - type: formula 12\n    range: 0.4 0.7\n",
                2,
                "1 to 9",
            ),
            (
                "DATA:\n  - type: formula 1\n    coefficients: 1\n",
                2,
                "wavelength_range",
            ),
            (
                "DATA:\n  - type: formula 1\n    range: 0.4 x\n",
                3,
                "finite number",
            ),
            ("DATA:\n  - type: tabulated q\n", 2, "tabulated n, k or nk"),
            (
                "DATA:\n  - type: tabulated n\n    data: |\n        0.4 1.5 2\n",
                4,
                "3 numbers where 2",
            ),
            (
                "DATA:\n  - type: tabulated n\n    data: |\n        0.4 -1\n",
                4,
                "at least 0",
            ),
            ("DATA:\n  - type: tabulated n\n", 2, "at least one row"),
            (
                "DATA:\n  - type: tabulated n\n    data: 0.4 1.5\n",
                3,
                "block",
            ),
            ("DATA:\n  - nothing\n", 2, "key: value"),
        ] {
            let e = parse(text).unwrap_err();
            assert_eq!(e.line, line, "{text:?}: {e}");
            assert!(e.message.contains(part), "{text:?}: {e}");
        }
    }
}
