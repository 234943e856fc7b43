//! Coatings by name, of materials of the library.
//!
//! Designs are the textbook ones: a quarter wave of magnesium fluoride; a V-coat of two layers
//! solved for no reflection at one wavelength; quarter-half-quarter for the visible range (Macleod,
//! Thin-Film Optical Filters, 4th ed., chapter 4); opaque metals, bare and under a half wave of
//! silica.

use super::coating::{Layer, Stack, Thickness};
use crate::spectrum::{Ior, Library, LibraryError};

/// Names of the built-in coatings.
pub const NAMES: [&str; 7] = [
    "MgF2",
    "V-coat",
    "broadband",
    "aluminium",
    "protected-aluminium",
    "silver",
    "protected-silver",
];
/// Wavelength that the built-in coatings are made for, nanometers.
pub const DESIGN_NM: f64 = 550.0;
/// Index of the glass that the V-coat is solved for: N-BK7 at the design wavelength.
const CROWN: f64 = 1.5185;

/// A built-in coating, as light from air meets it; names in any case. `None` if there is none of
/// this name.
///
/// # Errors
/// If the library has lost one of the materials.
pub fn named(name: &str, library: &Library) -> Result<Option<Stack>, LibraryError> {
    let Some(name) = NAMES.iter().find(|n| n.eq_ignore_ascii_case(name.trim())) else {
        return Ok(None);
    };
    let quarters = |material: &str, count: f64| {
        let at_nm = DESIGN_NM;
        library.ior(material).map(|ior| Layer {
            ior,
            thickness: Thickness::QuarterWaves { count, at_nm },
        })
    };
    let (low, middle, high) = (
        "material:MGF2-O",
        "material:SAPPHIRE-O",
        "material:CUBIC-ZIRCONIA",
    );
    let (layers, backing) = match *name {
        "MgF2" => (vec![quarters(low, 1.0)?], None),
        "V-coat" => (v_coat(library.ior(low)?, library.ior(high)?), None),
        "broadband" => {
            let layers = vec![
                quarters(low, 1.0)?,
                quarters(high, 2.0)?,
                quarters(middle, 1.0)?,
            ];
            (layers, None)
        }
        metal => {
            let symbol = if metal.contains("silver") {
                "metal:Ag"
            } else {
                "metal:Al"
            };
            let cover = if metal.starts_with("protected") {
                vec![quarters("material:FUSED-SILICA", 2.0)?]
            } else {
                Vec::new()
            };
            (cover, Some(library.ior(symbol)?))
        }
    };
    Ok(Some(Stack {
        name: (*name).to_owned(),
        layers,
        backing,
    }))
}

/// Two layers, the outer of low index, without reflection at the design wavelength on crown glass:
/// tan^2 of both phase thicknesses from the condition that real and imaginary part of the
/// admittance match (Macleod, equations 4.3 and 4.4).
fn v_coat(outer: Ior, inner: Ior) -> Vec<Layer> {
    let (n1, n2, ns) = (outer.n(DESIGN_NM), inner.n(DESIGN_NM), CROWN);
    let tan1_squared =
        (ns - 1.0) * (n2 * n2 - ns) * n1 * n1 / ((n1 * n1 * ns - n2 * n2) * (ns - n1 * n1));
    let tan1 = tan1_squared.max(0.0).sqrt();
    // of the two solutions the one with a thin inner layer: phases of opposite sign of the tangent
    let tan2 = n1 * n2 * (ns - 1.0) / ((n1 * n1 * ns - n2 * n2) * tan1);
    let phase = |tan: f64| tan.atan().rem_euclid(std::f64::consts::PI);
    let layer = |ior: Ior, n: f64, phase: f64| Layer {
        ior,
        thickness: Thickness::Nm(phase * DESIGN_NM / (std::f64::consts::TAU * n)),
    };
    let (one, two) = (phase(tan1), phase(tan2));
    let thin = phase(-tan2);
    if thin < two {
        vec![layer(outer, n1, phase(-tan1)), layer(inner, n2, thin)]
    } else {
        vec![layer(outer, n1, one), layer(inner, n2, two)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::coating::interface;
    use super::*;

    fn reflectance(name: &str, lambda_nm: f64, n: f64) -> f64 {
        let stack = named(name, Library::embedded()).unwrap().unwrap();
        interface(Some(&stack), lambda_nm, 1.0, n, 1.0).r
    }

    #[test]
    fn coatings_do_what_they_are_for() {
        let bare = interface(None, DESIGN_NM, 1.0, CROWN, 1.0).r;
        assert!((bare - 0.0424).abs() < 1e-4);
        assert!((0.012..0.014).contains(&reflectance("mgf2", DESIGN_NM, CROWN)));
        assert!(reflectance("V-coat", DESIGN_NM, CROWN) < 1e-20);
        assert!(reflectance("V-coat", 420.0, CROWN) > 0.01);
        for nm in [450.0, 500.0, 550.0, 600.0, 650.0] {
            assert!(reflectance("broadband", nm, CROWN) < 0.01, "{nm}");
        }
        assert!((0.90..0.93).contains(&reflectance("aluminium", DESIGN_NM, CROWN)));
        assert!(reflectance("silver", DESIGN_NM, CROWN) > 0.95);
        for name in NAMES {
            assert!(named(name, Library::embedded()).unwrap().is_some());
        }
        assert_eq!(named("gold leaf", Library::embedded()).unwrap(), None);
    }
}
