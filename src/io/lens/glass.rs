//! Media of lens files: glasses by name and catalog, model glasses by index and Abbe number.

use crate::optics::Medium;
use crate::spectrum::ior::{LINE_C_NM, LINE_D_NM, LINE_F_NM};
use crate::spectrum::{Ior, Library};

/// A glass by name, in the first of `catalogs` that has it.
pub(super) fn named(name: &str, catalogs: &[String], library: &Library) -> Result<Medium, String> {
    library
        .glass_in(name, catalogs)
        .map(Medium::new)
        .map_err(|e| e.to_string())
}

/// A glass by the name CODE V gives it, without hyphens and other signs: `NBK7`.
pub(super) fn plain_named(
    name: &str,
    catalog: Option<&str>,
    library: &Library,
) -> Result<Medium, String> {
    let plain = |text: &str| -> String {
        let kept = text.chars().filter(char::is_ascii_alphanumeric);
        kept.map(|c| c.to_ascii_lowercase()).collect()
    };
    let wanted = plain(name);
    let matches: Vec<&Ior> = library
        .glasses()
        .filter(|ior| {
            let (of, glass) = ior.name().split_once(':').unwrap_or(("", ior.name()));
            plain(glass) == wanted && catalog.is_none_or(|c| c.eq_ignore_ascii_case(of))
        })
        .collect();
    match matches.as_slice() {
        [one] => Ok(Medium::new((*one).clone())),
        [] => {
            let full = catalog.map_or(name.to_owned(), |c| format!("{}:{name}", c.to_lowercase()));
            library
                .ior(&full)
                .map(Medium::new)
                .map_err(|e| e.to_string())
        }
        several => {
            let names: Vec<&str> = several.iter().map(|g| g.name()).collect();
            Err(format!(
                "`{name}` is in several catalogs: {}",
                names.join(", ")
            ))
        }
    }
}

/// A glass that only its index and Abbe number are known of: n = a + b / lambda^2 through both.
///
/// # Errors
/// If the numbers are those of no glass.
pub(super) fn model(n_d: f64, v_d: f64) -> Result<Medium, String> {
    if !((1.0..=5.0).contains(&n_d) && (v_d == 0.0 || (5.0..=200.0).contains(&v_d))) {
        return Err(format!(
            "a model glass of n_d {n_d} and V_d {v_d} (1 to 5, and 5 to 200 or 0 for no dispersion)"
        ));
    }
    let name = format!("model n_d {n_d} V_d {v_d}");
    if v_d == 0.0 {
        return Ok(Medium::new(Ior::constant(n_d).named(name, "")));
    }
    let inverse2 = |nm: f64| (nm * 1e-3).powi(-2);
    let b = (n_d - 1.0) / v_d / (inverse2(LINE_F_NM) - inverse2(LINE_C_NM));
    let a = n_d - b * inverse2(LINE_D_NM);
    Ok(Medium::new(Ior::cauchy(a, b, 0.0).named(name, "")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_without_hyphens() {
        let library = Library::embedded();
        let name = |n: &str, c| plain_named(n, c, library).map(|m| m.ior.name().to_owned());
        assert_eq!(name("NBK7", Some("SCHOTT")).unwrap(), "schott:N-BK7");
        assert_eq!(name("SLAH79", None).unwrap(), "ohara:S-LAH79");
        assert!(name("F2", None).unwrap_err().contains("several"));
        assert!(name("NBK9", Some("schott")).unwrap_err().contains("N-BK"));
    }

    #[test]
    fn a_model_glass_has_its_index_and_abbe_number() {
        let ior = model(1.62, 36.4).unwrap().ior;
        assert!((ior.n(LINE_D_NM) - 1.62).abs() < 1e-14);
        assert!((ior.abbe_number() - 36.4).abs() < 1e-9);
        assert!(model(0.5, 60.0).is_err() && model(1.5, f64::NAN).is_err());
    }
}
