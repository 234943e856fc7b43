//! `abbe glass`: a refractive index at the Fraunhofer lines.

use super::args::GlassOptions;
use super::{CliError, Outcome, print};
use crate::spectrum::{Ior, Library, LibraryError};
use serde_json::json;
use std::fmt::Write as _;

/// Spectral lines at which glass is specified: letter, source, nanometers (ISO 7944 and the Schott
/// catalog).
const LINES: [(&str, &str, f64); 13] = [
    ("i", "Hg", 365.0146),
    ("h", "Hg", 404.6561),
    ("g", "Hg", 435.8343),
    ("F'", "Cd", 479.9914),
    ("F", "H", 486.1327),
    ("e", "Hg", 546.0740),
    ("d", "He", 587.5618),
    ("D", "Na", 589.2938),
    ("C'", "Cd", 643.8469),
    ("C", "H", 656.2725),
    ("r", "He", 706.5188),
    ("A'", "K", 768.1949),
    ("s", "Cs", 852.1101),
];
/// Where a formula may be used beyond the range it was fitted over.
const VISIBLE_NM: [f64; 2] = [360.0, 830.0];

/// Most names found by a search that are shown.
const MAX_FOUND: usize = 12;

/// Runs the command.
pub fn run(options: &GlassOptions) -> Result<Outcome, CliError> {
    let library = super::lens::library(&options.glass_path)?;
    let Some(name) = &options.name else {
        print(&list(&library, options.json))?;
        return Ok(Outcome::Done);
    };
    let ior = library.ior(name).map_err(|e| unknown(&library, name, e))?;
    print(&if options.json {
        json_text(&ior)
    } else {
        table(&ior)
    })?;
    Ok(Outcome::Done)
}

/// The error of a name that is none, with the glasses whose name or description holds it, and the
/// catalogs.
fn unknown(library: &Library, name: &str, error: LibraryError) -> CliError {
    if !matches!(error, LibraryError::Unknown { .. }) {
        return error.into();
    }
    let found: Vec<&str> = library.search(name).map(Ior::name).collect();
    let mut text = error.to_string();
    if !found.is_empty() {
        let first = &found[..found.len().min(MAX_FOUND)];
        _ = write!(text, "\n`{name}` is found in: {}", first.join(", "));
        if found.len() > MAX_FOUND {
            _ = write!(text, " and {} more", found.len() - MAX_FOUND);
        }
    }
    _ = write!(text, "\ncatalogs: {}", library.catalogs().join(", "));
    CliError::Failed(text)
}

fn list(library: &Library, as_json: bool) -> String {
    if as_json {
        let all: Vec<_> = library.glasses().map(summary).collect();
        return format!("{:#}\n", json!(all));
    }
    let row = |ior: &Ior| {
        format!(
            "{:<28} n_d {:<8}  V_d {}\n",
            ior.name(),
            index_d(ior),
            abbe_number(ior)
        )
    };
    library.glasses().map(row).collect()
}

/// The lines at which the material has an index.
fn lines(ior: &Ior) -> impl Iterator<Item = (&'static str, &'static str, f64, f64)> {
    let usable = |nm: f64| ior.validate_conductor([nm, nm]).is_ok();
    LINES
        .iter()
        .filter(move |l| usable(l.2))
        .map(|&(letter, source, nm)| (letter, source, nm, ior.n(nm)))
}

/// n_d, or a dash where the material is not defined there.
pub fn index_d(ior: &Ior) -> String {
    let at_d = lines(ior).find(|l| l.0 == "d");
    at_d.map_or_else(|| "-".to_owned(), |l| format!("{:.6}", l.3))
}

/// V_d, or a dash where there is none.
pub fn abbe_number(ior: &Ior) -> String {
    let v = ior.abbe_number();
    if v.is_finite() {
        format!("{v:.2}")
    } else {
        "-".to_owned()
    }
}

/// Where the index is used beyond its data between 360 and 830 nm.
pub fn extrapolated(ior: &Ior) -> Vec<[f64; 2]> {
    ior.validate_conductor(VISIBLE_NM).unwrap_or_default()
}

fn range_text([low, high]: [f64; 2]) -> String {
    format!("{low:.0}..{high:.0} nm")
}

fn table(ior: &Ior) -> String {
    let mut text = format!("{}\n", ior.name());
    for (letter, source, nm, n) in lines(ior) {
        _ = write!(text, "  n_{letter:<3}{source:<3} {nm:>9.4} nm  {n:.6}");
        _ = if ior.has_k() {
            writeln!(text, "  k {:.3e}", ior.k(nm))
        } else {
            writeln!(text)
        };
    }
    _ = writeln!(text, "  V_d     {}", abbe_number(ior));
    _ = writeln!(
        text,
        "  range   {}",
        ior.fitted_range_nm()
            .map_or_else(|| "any".to_owned(), range_text)
    );
    let beyond: Vec<String> = extrapolated(ior).into_iter().map(range_text).collect();
    if !beyond.is_empty() {
        _ = writeln!(
            text,
            "  beyond  {} (formula used outside the range it was fitted over)",
            beyond.join(", ")
        );
    }
    if !ior.has_k() {
        _ = writeln!(text, "  k       none: clear");
    }
    if !ior.source().is_empty() {
        _ = writeln!(text, "  source  {}", ior.source());
    }
    text
}

/// Facts of a glass without its lines.
pub fn summary(ior: &Ior) -> serde_json::Value {
    json!({
        "name": ior.name(),
        "n_d": lines(ior).find(|l| l.0 == "d").map(|l| l.3),
        "V_d": Some(ior.abbe_number()).filter(|v| v.is_finite()),
        "range_nm": ior.fitted_range_nm(),
        "extrapolated_nm": extrapolated(ior),
        "has_k": ior.has_k(),
        "source": ior.source(),
    })
}

fn json_text(ior: &Ior) -> String {
    let mut value = summary(ior);
    let row = |(letter, source, nm, n)| json!({ "line": letter, "source": source, "nm": nm, "n": n, "k": ior.k(nm) });
    value["lines"] = lines(ior).map(row).collect();
    format!("{value:#}\n")
}
