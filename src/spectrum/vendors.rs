//! Reader of `glass/vendors.txt`: many glasses in little space, one a line (format:
//! `spectra/README.md`).

use super::read::{MAX_FILE_BYTES, SpectrumFileError, error};
use super::{Curve, Ior};

/// Most wavelengths of a `k_um` line.
const MAX_GRID: usize = 256;

/// Reads the glasses of a file; each is named `catalog:name`.
///
/// # Errors
/// If the file is too large or a line is not of the documented form.
pub(super) fn parse_vendors(text: &str) -> Result<Vec<Ior>, SpectrumFileError> {
    if text.len() > MAX_FILE_BYTES {
        return error(
            1,
            1,
            format!("the file is larger than {MAX_FILE_BYTES} bytes"),
        );
    }
    let (mut source, mut catalog, mut grid_nm) = ("", "", Vec::new());
    let mut glasses = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let bad = |message: String| error(i + 1, 1, message);
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        if line.contains('|') {
            match glass(line, catalog, source, &grid_nm) {
                Ok(ior) => glasses.push(ior),
                Err(message) => return bad(message),
            }
            continue;
        }
        match line.split_once(' ') {
            Some(("source", text)) => source = text,
            Some(("catalog", name)) => catalog = name,
            Some(("k_um", list)) => match numbers(list) {
                Ok(um) if um.len() <= MAX_GRID && um.windows(2).all(|w| w[0] < w[1]) => {
                    grid_nm = um.iter().map(|&um| to_nm(um)).collect();
                }
                Ok(_) => {
                    return bad(format!(
                        "k_um takes up to {MAX_GRID} increasing wavelengths"
                    ));
                }
                Err(message) => return bad(message),
            },
            _ => return bad("a line is `source`, `catalog`, `k_um` or a glass".to_owned()),
        }
    }
    Ok(glasses)
}

fn to_nm(um: f64) -> f64 {
    (um * 1e6).round() / 1e3
}

fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let one = |word: &str| match word.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(format!("`{word}` is not a finite number")),
    };
    text.split_whitespace().map(one).collect()
}

fn glass(line: &str, catalog: &str, source: &str, grid_nm: &[f64]) -> Result<Ior, String> {
    let fields: Vec<&str> = line.split('|').collect();
    let &[name, formula, range, coefficients, k] = fields.as_slice() else {
        return Err(format!(
            "{} fields where 5 are expected: name|formula|range|coefficients|k",
            fields.len()
        ));
    };
    let number: u8 = formula
        .parse()
        .map_err(|_| format!("`{formula}` is not a formula"))?;
    let &[low, high] = numbers(range)?.as_slice() else {
        return Err("the range has two wavelengths".to_owned());
    };
    let ior = Ior::formula(number, numbers(coefficients)?, [to_nm(low), to_nm(high)])
        .map_err(|e| e.to_string())?;
    let ks: Vec<&str> = k.split(',').collect();
    if ks.len() > grid_nm.len() {
        return Err(format!(
            "{} values of k for {} wavelengths",
            ks.len(),
            grid_nm.len()
        ));
    }
    let (mut nm, mut values) = (Vec::new(), Vec::new());
    for (&at, text) in grid_nm.iter().zip(ks).filter(|(_, text)| !text.is_empty()) {
        let value: u64 = text
            .parse()
            .map_err(|_| format!("`{text}` is not a whole number"))?;
        nm.push(at);
        values.push(value as f64 * 1e-12);
    }
    let ior = if nm.is_empty() {
        ior
    } else {
        ior.with_k(Curve::table(&nm, &values))
    };
    Ok(ior.named(
        format!("{catalog}:{name}"),
        format!("{source}, specs/{catalog}/optical/{name}.yml"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "source db\ncatalog maker\nk_um 0.4 0.5 0.6\n";

    #[test]
    fn a_glass_is_read() {
        let text = format!("{HEAD}G-1|3|0.4 0.7|2.25 0.01 -2|,2000,4000\n");
        let glasses = parse_vendors(&text).unwrap();
        assert_eq!(glasses[0].name(), "maker:G-1");
        assert_eq!(glasses[0].fitted_range_nm(), Some([400.0, 700.0]));
        assert!((glasses[0].n(500.0) - (2.25f64 + 0.04).sqrt()).abs() < 1e-14);
        assert!((glasses[0].k(550.0) - 3e-9).abs() < 1e-20 && glasses[0].k(400.0) > 1.9e-9);
    }

    #[test]
    fn bad_lines_say_where() {
        for (line, message) in [
            ("nonsense", "a line is `source`"),
            ("G|3|0.4 0.7|2.25", "4 fields"),
            ("G|x|0.4 0.7|2.25|", "not a formula"),
            ("G|3|0.4|2.25|", "two wavelengths"),
            ("G|3|0.7 0.4|2.25|", "not a wavelength range"),
            ("G|3|0.4 0.7|nan|", "not a finite number"),
            ("G|3|0.4 0.7|2.25|1,2,3,4", "4 values of k"),
            ("G|3|0.4 0.7|2.25|-1", "not a whole number"),
            ("k_um 0.5 0.4", "increasing"),
        ] {
            let e = parse_vendors(&format!("{HEAD}{line}\n")).unwrap_err();
            assert_eq!(e.line, 4, "{line}");
            assert!(e.message.contains(message), "{line}: {e}");
        }
    }
}
