//! Refractive index and extinction of a material as functions of wavelength.
//!
//! Formulas 1 to 9 are those of the refractiveindex.info database, wavelength in micrometers. A
//! formula may be evaluated beyond its fitted range inside 360..830 nm; a table only on request;
//! nothing reaches further.

use thiserror::Error;

use super::Curve;

/// Fraunhofer d line (He), nanometers.
pub const LINE_D_NM: f64 = 587.5618;
/// Fraunhofer F line (H), nanometers.
pub const LINE_F_NM: f64 = 486.1327;
/// Fraunhofer C line (H), nanometers.
pub const LINE_C_NM: f64 = 656.2725;

/// The largest refractive index that is taken for one.
pub const MOST_INDEX: f64 = 10.0;

/// Why a refractive index cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum IorError {
    /// The wavelength range leaves both the data and what may be extrapolated.
    #[error(
        "{name} has data for {low_nm:.0}..{high_nm:.0} nm only, {lambda_nm} nm is asked for{hint}"
    )]
    OutsideData {
        /// The material.
        name: String,
        /// First wavelength of the data.
        low_nm: f64,
        /// Last wavelength of the data.
        high_nm: f64,
        /// A wavelength outside.
        lambda_nm: f64,
        /// Remedy, in words.
        hint: &'static str,
    },
    /// The index is not finite, too small or too large.
    #[error("{name} has the refractive index {n} at {lambda_nm} nm (allowed: {allowed})")]
    NotPhysical {
        /// The material.
        name: String,
        /// The wavelength.
        lambda_nm: f64,
        /// The index there.
        n: f64,
        /// The indices allowed.
        allowed: &'static str,
    },
    /// A formula that does not exist or has the wrong number of coefficients.
    #[error("{0}")]
    BadFormula(String),
}

#[derive(Clone, Debug, PartialEq)]
enum Dispersion {
    Constant(f64),
    /// refractiveindex.info formula 1..=9 and its coefficients, as many as it takes.
    Formula(u8, Vec<f64>),
    /// n against nanometers.
    Table(Curve),
}

/// A complex refractive index n + i k; real catalog glasses are relative to air.
#[derive(Clone, Debug, PartialEq)]
pub struct Ior {
    name: String,
    source: String,
    dispersion: Dispersion,
    /// Where n was fitted or tabulated; `None`: everywhere.
    range_nm: Option<[f64; 2]>,
    /// Extinction coefficient against nanometers.
    k: Option<Curve>,
    /// Whether a table may be used beyond its ends.
    extrapolate: bool,
}

impl Ior {
    fn new(dispersion: Dispersion, range_nm: Option<[f64; 2]>) -> Self {
        Self {
            name: String::from("unnamed"),
            source: String::new(),
            dispersion,
            range_nm,
            k: None,
            extrapolate: false,
        }
    }

    /// A wavelength-independent real index.
    #[must_use]
    pub fn constant(n: f64) -> Self {
        Self::new(Dispersion::Constant(n), None).named(format!("n = {n}"), "")
    }

    /// The same material without dispersion: everywhere the index it has at `lambda_nm`; k stays
    /// what it is.
    #[must_use]
    pub fn constant_as_at(&self, lambda_nm: f64) -> Self {
        Self {
            dispersion: Dispersion::Constant(self.n(lambda_nm)),
            ..self.clone()
        }
    }

    /// A refractiveindex.info formula (1 to 9, wavelengths in micrometers), fitted over `range_nm`
    /// (nanometers).
    ///
    /// # Errors
    /// If there is no such formula or it does not take that many coefficients.
    pub fn formula(
        number: u8,
        coefficients: Vec<f64>,
        range_nm: [f64; 2],
    ) -> Result<Self, IorError> {
        let bad = |text: String| Err(IorError::BadFormula(text));
        let count = coefficients.len();
        let (fits, rule) = match number {
            1..=3 | 5 | 6 => (!count.is_multiple_of(2), "1, 3, 5, ..."),
            4 => (!count.is_multiple_of(2) && count >= 9, "9, 11, 13, ..."),
            7 => ((3..=6).contains(&count), "3 to 6"),
            8 => (count == 4, "4"),
            9 => (count == 6, "6"),
            _ => return bad(format!("there is no dispersion formula {number} (1 to 9)")),
        };
        if !fits {
            return bad(format!(
                "formula {number} takes {rule} coefficients, not {count}"
            ));
        }
        if coefficients.iter().any(|c| !c.is_finite()) {
            return bad(String::from("coefficients must be finite numbers"));
        }
        let [low, high] = range_nm;
        if !(low.is_finite() && high.is_finite() && 0.0 < low && low < high) {
            return bad(format!("{low}..{high} nm is not a wavelength range"));
        }
        Ok(Self::new(
            Dispersion::Formula(number, coefficients),
            Some(range_nm),
        ))
    }

    /// Cauchy's `n = a + b / lambda^2 + c / lambda^4`, wavelength in micrometers, used everywhere.
    #[must_use]
    pub fn cauchy(a: f64, b: f64, c: f64) -> Self {
        let coefficients = vec![a, b, -2.0, c, -4.0];
        Self::new(Dispersion::Formula(5, coefficients), None).named(String::from("Cauchy"), "")
    }

    /// Tables of n and k at the same wavelengths: nanometers, strictly increasing, at least one.
    #[must_use]
    pub fn table(nm: &[f64], n: &[f64], k: &[f64]) -> Self {
        let range = [nm[0], nm[nm.len() - 1]];
        Self::new(Dispersion::Table(Curve::table(nm, n)), Some(range)).with_k(Curve::table(nm, k))
    }

    /// The same with an extinction coefficient against nanometers.
    #[must_use]
    pub fn with_k(self, k: Curve) -> Self {
        Self { k: Some(k), ..self }
    }

    /// The same without an extinction coefficient: clear.
    #[must_use]
    pub fn without_k(self) -> Self {
        Self { k: None, ..self }
    }

    /// The same under another name, with its provenance.
    #[must_use]
    pub fn named(self, name: impl Into<String>, source: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            source: source.into(),
            ..self
        }
    }

    /// The same, with tables held at their end values beyond them (inside 360..830 nm).
    #[must_use]
    pub fn with_extrapolation(self, extrapolate: bool) -> Self {
        Self {
            extrapolate,
            ..self
        }
    }

    /// Name, with catalog if it has one: `schott:N-BK7`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where the numbers come from; may be empty.
    #[must_use]
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Where n was fitted or tabulated, nanometers; `None`: everywhere.
    #[must_use]
    pub fn fitted_range_nm(&self) -> Option<[f64; 2]> {
        self.range_nm
    }

    /// The index n at `lambda_nm`. Finite and >= 1 over the working range (checked when the scene
    /// is built).
    #[must_use]
    pub fn n(&self, lambda_nm: f64) -> f64 {
        match &self.dispersion {
            Dispersion::Constant(n) => *n,
            Dispersion::Formula(number, c) => formula(*number, c, lambda_nm * 1e-3),
            Dispersion::Table(curve) => curve.eval(lambda_nm),
        }
    }

    /// The extinction coefficient k at `lambda_nm` (0 where the material has no k table; end values
    /// held).
    #[must_use]
    pub fn k(&self, lambda_nm: f64) -> f64 {
        self.k.as_ref().map_or(0.0, |k| k.eval(lambda_nm))
    }

    /// Whether n varies with wavelength.
    #[must_use]
    pub fn is_dispersive(&self) -> bool {
        match &self.dispersion {
            Dispersion::Constant(_) => false,
            Dispersion::Formula(7..=9, c) => c.iter().skip(1).any(|&b| b != 0.0),
            Dispersion::Formula(_, c) => c.iter().skip(1).step_by(2).any(|&b| b != 0.0),
            Dispersion::Table(Curve::Regular { values, .. } | Curve::Table { values, .. }) => {
                values.iter().any(|&n| n != values[0])
            }
            Dispersion::Table(_) => false,
        }
    }

    /// Whether there is a k table with a non-zero entry.
    #[must_use]
    pub fn is_absorbing(&self) -> bool {
        match &self.k {
            Some(Curve::Regular { values, .. } | Curve::Table { values, .. }) => {
                values.iter().any(|&k| k != 0.0)
            }
            Some(Curve::Constant(k)) => *k != 0.0,
            Some(_) => true,
            None => false,
        }
    }

    /// Whether the material comes with extinction data; a glass without is treated as clear.
    #[must_use]
    pub fn has_k(&self) -> bool {
        self.k.is_some()
    }

    /// Abbe number V_d = (n_d - 1) / (n_F - n_C); infinite without dispersion.
    #[must_use]
    pub fn abbe_number(&self) -> f64 {
        if !self.is_dispersive() {
            return f64::INFINITY;
        }
        (self.n(LINE_D_NM) - 1.0) / (self.n(LINE_F_NM) - self.n(LINE_C_NM))
    }

    /// Checks a material that light is refracted into: n in 1..=10 over `range_nm` (nanometers).
    ///
    /// Returns the stretches of the range (none, one or two) that lie beyond the fitted range.
    ///
    /// # Errors
    /// Where there is neither data nor an allowed extrapolation, or n is not in 1..=10.
    pub fn validate(&self, range_nm: [f64; 2]) -> Result<Vec<[f64; 2]>, IorError> {
        self.check(range_nm, |n| (1.0..=MOST_INDEX).contains(&n), "1 to 10")
    }

    /// Checks a material that only reflects: as [`Self::validate`], with any n in (0, 10] (metals
    /// have n < 1).
    ///
    /// # Errors
    /// Where there is neither data nor an allowed extrapolation, or n is not in (0, 10].
    pub fn validate_conductor(&self, range_nm: [f64; 2]) -> Result<Vec<[f64; 2]>, IorError> {
        self.check(
            range_nm,
            |n| n > 0.0 && n <= MOST_INDEX,
            "above 0, up to 10",
        )
    }

    fn check(
        &self,
        range_nm: [f64; 2],
        physical: impl Fn(f64) -> bool,
        allowed: &'static str,
    ) -> Result<Vec<[f64; 2]>, IorError> {
        let [low, high] = range_nm;
        let [first, last] = self.range_nm.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let is_table = matches!(self.dispersion, Dispersion::Table(_));
        let steps = (high - low).ceil().max(1.0);
        let even = (0..=steps as usize).map(|i| low + (high - low) * (i as f64 / steps));
        let knots = match &self.dispersion {
            Dispersion::Table(curve) => curve.knots_nm(),
            _ => Vec::new(),
        };
        let inside = |l: &f64| (low..=high).contains(l);
        for lambda_nm in even.chain(knots.into_iter().filter(inside)) {
            let fitted = (first..=last).contains(&lambda_nm);
            let may_extrapolate =
                (360.0..=830.0).contains(&lambda_nm) && (!is_table || self.extrapolate);
            if !fitted && !may_extrapolate {
                let hint = match (is_table && !self.extrapolate, lambda_nm) {
                    (true, _) if (360.0..=830.0).contains(&lambda_nm) => {
                        " (extrapolate = true holds the end values)"
                    }
                    _ => "",
                };
                let (name, low_nm, high_nm) = (self.name.clone(), first, last);
                return Err(IorError::OutsideData {
                    name,
                    low_nm,
                    high_nm,
                    lambda_nm,
                    hint,
                });
            }
            let n = self.n(lambda_nm);
            if !physical(n) {
                let name = self.name.clone();
                return Err(IorError::NotPhysical {
                    name,
                    lambda_nm,
                    n,
                    allowed,
                });
            }
        }
        let below = (low < first).then(|| [low, high.min(first)]);
        let above = (high > last).then(|| [low.max(last), high]);
        Ok(below.into_iter().chain(above).collect())
    }
}

/// n by refractiveindex.info formula `number` at `um` micrometers.
fn formula(number: u8, c: &[f64], um: f64) -> f64 {
    let um2 = um * um;
    let pairs = |from: usize| c[from..].chunks_exact(2).map(|p| (p[0], p[1]));
    let powers = |from: usize| pairs(from).map(|(b, e)| b * um.powf(e)).sum::<f64>();
    match number {
        1 => (1.0 + c[0] + pairs(1).map(|(b, l)| b * um2 / (um2 - l * l)).sum::<f64>()).sqrt(),
        2 => (1.0 + c[0] + pairs(1).map(|(b, l2)| b * um2 / (um2 - l2)).sum::<f64>()).sqrt(),
        3 => (c[0] + powers(1)).sqrt(),
        4 => {
            let pole = |t: &[f64]| match t[0] {
                0.0 => 0.0,
                b => b * um.powf(t[1]) / (um2 - t[2].powf(t[3])),
            };
            (c[0] + pole(&c[1..5]) + pole(&c[5..9]) + powers(9)).sqrt()
        }
        5 => c[0] + powers(1),
        6 => 1.0 + c[0] + pairs(1).map(|(b, a)| b / (a - 1.0 / um2)).sum::<f64>(),
        7 => {
            let l = 1.0 / (um2 - 0.028);
            let powers = c[3..].iter().rev().fold(0.0, |sum, &c| (sum + c) * um2);
            c[0] + (c[1] + c[2] * l) * l + powers
        }
        8 => {
            let x = c[0] + c[1] * um2 / (um2 - c[2]) + c[3] * um2;
            ((1.0 + 2.0 * x) / (1.0 - x)).sqrt()
        }
        _ => {
            let d = um - c[4];
            (c[0] + c[1] / (um2 - c[2]) + c[3] * d / (d * d + c[5])).sqrt()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::library::Library;
    use super::*;

    const VISIBLE: [f64; 2] = [360.0, 830.0];

    fn glass(name: &str) -> Ior {
        Library::embedded().ior(name).unwrap()
    }

    #[test]
    fn indices_match_the_catalogs() {
        // n_d and V_d as printed in the Schott, Ohara and Hikari catalogs and the papers behind the
        // others.
        for (name, n_d, v_d) in [
            ("N-BK7", 1.516_800, 64.17),
            ("SF10", 1.728_25, 28.41),
            ("N-SF11", 1.784_72, 25.68),
            ("S-FPL53", 1.438_75, 94.93),
            ("hikari:SK16", 1.620_41, 60.3),
            ("FUSED-SILICA", 1.458_46, 67.82),
            ("CAF2", 1.433_85, 95.2),
            ("DIAMOND", 2.417_5, 55.3),
            ("WATER", 1.333_4, 55.8),
            ("RUTILE-O", 2.613, 9.9),
        ] {
            let ior = glass(name);
            let (n, v) = (ior.n(LINE_D_NM), ior.abbe_number());
            assert!(
                (n - n_d).abs() < 2e-3 && (v / v_d - 1.0).abs() < 0.01,
                "{name} {n} {v}"
            );
        }
    }

    #[test]
    fn bk7_and_sf10_to_seven_digits() {
        let (bk7, sf10) = (glass("N-BK7"), glass("schott:N-SF10"));
        for (lambda, n_bk7, n_sf10) in [
            (435.8343, 1.526_684_6, 1.761_914_2),
            (LINE_F_NM, 1.522_376_3, 1.746_430_5),
            (546.0740, 1.518_722_0, 1.734_298_9),
            (LINE_D_NM, 1.516_800_0, 1.728_277_1),
            (LINE_C_NM, 1.514_322_3, 1.720_906_2),
        ] {
            assert!(
                (bk7.n(lambda) - n_bk7).abs() < 1e-7,
                "{lambda} {}",
                bk7.n(lambda)
            );
            assert!(
                (sf10.n(lambda) - n_sf10).abs() < 1e-7,
                "{lambda} {}",
                sf10.n(lambda)
            );
        }
        assert!((bk7.abbe_number() - 64.1673).abs() < 1e-4);
        assert!((sf10.abbe_number() - 28.5326).abs() < 1e-4);
    }

    #[test]
    fn formulas_agree_with_each_other() {
        let range = [300.0, 2000.0];
        // Formula 1 with l = 0.1 is formula 2 with l^2 = 0.01; formula 4 holds the same term plus
        // powers.
        let one = Ior::formula(1, vec![0.0, 1.2, 0.1], range).unwrap();
        let two = Ior::formula(2, vec![0.0, 1.2, 0.01], range).unwrap();
        let four = vec![1.0, 1.2, 2.0, 0.1, 2.0, 0.0, 0.0, 0.0, 0.0];
        let four = Ior::formula(4, four, range).unwrap();
        let three = Ior::formula(3, vec![2.25, 0.01, -2.0], range).unwrap();
        let five = Ior::formula(5, vec![1.5, 0.01, -2.0], range).unwrap();
        let six = Ior::formula(6, vec![0.1, 0.5, 4.0], range).unwrap();
        for lambda in [400.0, 587.0, 1000.0] {
            let um2: f64 = lambda * lambda * 1e-6;
            assert!((one.n(lambda) - two.n(lambda)).abs() < 1e-14);
            assert!((one.n(lambda) - four.n(lambda)).abs() < 1e-14);
            assert!((three.n(lambda).powi(2) - 2.25 - 0.01 / um2).abs() < 1e-12);
            assert!((five.n(lambda) - 1.5 - 0.01 / um2).abs() < 1e-14);
            assert!((six.n(lambda) - 1.1 - 0.5 / (4.0 - 1.0 / um2)).abs() < 1e-14);
            assert!((Ior::cauchy(1.5, 0.01, 0.0).n(lambda) - five.n(lambda)).abs() < 1e-14);
        }
        // 7 by hand at 500 nm, 8 and 9 where they are a constant
        let seven = Ior::formula(7, vec![1.5, 0.01, 0.001, -0.02, 0.003], range).unwrap();
        let l = 1.0 / (0.25 - 0.028);
        let n = 1.5 + 0.01 * l + 0.001 * l * l - 0.02 * 0.25 + 0.003 * 0.0625;
        assert!((seven.n(500.0) - n).abs() < 1e-14);
        let eight = Ior::formula(8, vec![0.25, 0.0, 0.01, 0.0], range).unwrap();
        assert!((eight.n(500.0) - 2f64.sqrt()).abs() < 1e-14);
        let nine = Ior::formula(9, vec![2.25, 0.01, 0.01, 0.0, 0.1, 0.2], range).unwrap();
        assert!((nine.n(500.0).powi(2) - 2.25 - 0.01 / 0.24).abs() < 1e-13);
        for (number, c) in [
            (0, vec![1.0]),
            (10, vec![1.0]),
            (7, vec![1.0]),
            (8, vec![1.0]),
            (9, vec![1.0; 5]),
            (2, vec![1.0, 2.0]),
            (4, vec![1.0]),
        ] {
            assert!(Ior::formula(number, c, range).is_err());
        }
        assert!(Ior::formula(1, vec![f64::NAN], range).is_err());
        assert!(Ior::formula(1, vec![0.0], [500.0, 400.0]).is_err());
    }

    #[test]
    fn every_glass_is_usable_over_the_visible_range() {
        let glasses: Vec<_> = Library::embedded().glasses().collect();
        assert_eq!(
            glasses
                .iter()
                .filter(|g| !g.name().starts_with("metal:"))
                .count(),
            1044
        );
        for ior in glasses {
            if ior.name().starts_with("metal:") {
                assert_eq!(
                    ior.validate_conductor(VISIBLE),
                    Ok(vec![]),
                    "{}",
                    ior.name()
                );
                assert!(ior.k(550.0) > 1.0);
            } else {
                assert!(ior.validate(VISIBLE).is_ok(), "{}", ior.name());
                assert!(
                    ior.is_dispersive() && ior.abbe_number() > 5.0,
                    "{}",
                    ior.name()
                );
            }
            assert!(!ior.source().is_empty());
        }
    }

    #[test]
    fn the_fitted_range_is_kept_or_named() {
        let sf11 = glass("N-SF11");
        assert_eq!(sf11.validate(VISIBLE), Ok(vec![[360.0, 370.0]]));
        assert_eq!(sf11.validate([400.0, 2400.0]), Ok(vec![]));
        assert!(matches!(
            sf11.validate([340.0, 500.0]),
            Err(IorError::OutsideData { .. })
        ));
        let table = Ior::table(&[400.0, 700.0], &[1.5, 1.4], &[0.0, 1e-6]);
        assert!(matches!(
            table.validate(VISIBLE),
            Err(IorError::OutsideData { .. })
        ));
        let held = table.clone().with_extrapolation(true);
        assert_eq!(
            held.validate(VISIBLE),
            Ok(vec![[360.0, 400.0], [700.0, 830.0]])
        );
        assert!(held.validate([350.0, 500.0]).is_err());
        assert_eq!((held.n(360.0), held.k(900.0)), (1.5, 1e-6));
        assert!(table.is_dispersive() && table.is_absorbing());
        assert!(matches!(
            Ior::constant(0.9).validate(VISIBLE),
            Err(IorError::NotPhysical { .. })
        ));
        assert!(Ior::constant(f64::NAN).validate(VISIBLE).is_err());
        assert!(Ior::constant(0.9).validate_conductor(VISIBLE).is_ok());
        let flat = Ior::constant(1.5);
        assert!(!flat.is_dispersive() && !flat.is_absorbing() && flat.abbe_number().is_infinite());
        assert!(glass("N-BK7").is_absorbing() && !glass("CAF2").has_k());
    }
}
