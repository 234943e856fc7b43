//! Continuous spectra: a number for every wavelength.
//!
//! Tables interpolate linearly between their knots and hold their end values, so every curve is
//! defined at every wavelength. Planck's law uses the exact SI constants of 2019; the sigmoid is
//! the reflectance model of Jakob and Hanika, "A Low-Dimensional Function Space for Efficient
//! Spectral Upsampling" (2019).

use std::sync::Arc;

use super::{SampledSpectrum, SampledWavelengths};

/// A smooth or tabulated function of the wavelength in nanometers. Cheap to clone: tables are
/// shared.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// The same value everywhere.
    Constant(f64),
    /// Values at `first_nm + i * step_nm`, with `step_nm > 0` and at least one value.
    Regular {
        /// Wavelength of the first value.
        first_nm: f64,
        /// Distance between values.
        step_nm: f64,
        /// The values.
        values: Arc<[f64]>,
    },
    /// Values at increasing wavelengths; both lists have the same length, at least 1.
    Table {
        /// The knots, strictly increasing.
        nm: Arc<[f64]>,
        /// The value at each knot.
        values: Arc<[f64]>,
    },
    /// Planck spectral radiance of a black body, W m^-2 sr^-1 nm^-1, times `scale`.
    Blackbody {
        /// Temperature in kelvin, positive.
        temp_k: f64,
        /// Factor on the radiance.
        scale: f64,
    },
    /// `s(c0 t^2 + c1 t + c2)` with `s(x) = 1/2 + x / (2 sqrt(1 + x^2))` and `t = (lambda - 360) /
    /// 470`: in (0, 1).
    Sigmoid {
        /// The polynomial, highest power first.
        c: [f64; 3],
    },
    /// A curve times a number.
    Scaled {
        /// The number.
        factor: f64,
        /// The curve.
        curve: Box<Curve>,
    },
    /// The product of two curves.
    Product(Box<Curve>, Box<Curve>),
}

impl Curve {
    /// A table; the evenly spaced form is chosen where the knots are exactly evenly spaced.
    ///
    /// `nm` strictly increasing, finite, as long as `values` and not empty (the readers of
    /// [`library`](super::library) guarantee it).
    #[must_use]
    pub fn table(nm: &[f64], values: &[f64]) -> Self {
        debug_assert!(!nm.is_empty() && nm.len() == values.len());
        debug_assert!(nm.windows(2).all(|w| w[0] < w[1]));
        if nm.len() > 1 {
            let (first_nm, step_nm) = (nm[0], nm[1] - nm[0]);
            if nm
                .iter()
                .enumerate()
                .all(|(i, &l)| l == first_nm + i as f64 * step_nm)
            {
                return Self::Regular {
                    first_nm,
                    step_nm,
                    values: values.into(),
                };
            }
        }
        Self::Table {
            nm: nm.into(),
            values: values.into(),
        }
    }

    /// This curve times `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Constant(v) => Self::Constant(v * factor),
            Self::Blackbody { temp_k, scale } => Self::Blackbody {
                temp_k,
                scale: scale * factor,
            },
            Self::Scaled { factor: f, curve } => Self::Scaled {
                factor: f * factor,
                curve,
            },
            curve => Self::Scaled {
                factor,
                curve: Box::new(curve),
            },
        }
    }

    /// The value at `lambda_nm`. Tables interpolate linearly and hold their end values.
    #[must_use]
    pub fn eval(&self, lambda_nm: f64) -> f64 {
        match self {
            Self::Constant(v) => *v,
            Self::Regular {
                first_nm,
                step_nm,
                values,
            } => {
                let x = ((lambda_nm - first_nm) / step_nm).clamp(0.0, (values.len() - 1) as f64);
                let i = (x as usize).min(values.len().saturating_sub(2));
                let next = values[(i + 1).min(values.len() - 1)];
                lerp(values[i], next, x - i as f64)
            }
            Self::Table { nm, values } => {
                let i = nm.partition_point(|&l| l <= lambda_nm);
                if i == 0 {
                    values[0]
                } else if i == nm.len() {
                    values[i - 1]
                } else {
                    let t = (lambda_nm - nm[i - 1]) / (nm[i] - nm[i - 1]);
                    lerp(values[i - 1], values[i], t)
                }
            }
            Self::Blackbody { temp_k, scale } => scale * planck(lambda_nm, *temp_k),
            Self::Sigmoid { c } => sigmoid(c, lambda_nm),
            Self::Scaled { factor, curve } => factor * curve.eval(lambda_nm),
            Self::Product(a, b) => a.eval(lambda_nm) * b.eval(lambda_nm),
        }
    }

    /// The values at the wavelengths of a path; 0 in the lanes not in use.
    #[must_use]
    #[inline]
    pub fn sample(&self, wavelengths: &SampledWavelengths) -> SampledSpectrum {
        if let Self::Constant(v) = self {
            return SampledSpectrum::splat(*v as f32);
        }
        self.sample_varying(wavelengths)
    }

    fn sample_varying(&self, wavelengths: &SampledWavelengths) -> SampledSpectrum {
        let at = |lane| self.eval(wavelengths.lambda_nm(lane)) as f32;
        SampledSpectrum::of_lanes(wavelengths.count(), at)
    }

    /// Appends the wavelengths where a table bends.
    pub fn append_knots_nm(&self, out: &mut Vec<f64>) {
        match self {
            Self::Regular {
                first_nm,
                step_nm,
                values,
            } => {
                out.extend((0..values.len()).map(|i| first_nm + i as f64 * step_nm));
            }
            Self::Table { nm, .. } => out.extend(nm.iter()),
            Self::Scaled { curve, .. } => curve.append_knots_nm(out),
            Self::Product(a, b) => {
                a.append_knots_nm(out);
                b.append_knots_nm(out);
            }
            Self::Constant(_) | Self::Blackbody { .. } | Self::Sigmoid { .. } => {}
        }
    }

    /// The wavelengths where a table bends, in no order.
    #[must_use]
    pub fn knots_nm(&self) -> Vec<f64> {
        let mut out = Vec::new();
        self.append_knots_nm(&mut out);
        out
    }

    /// Ends of the table in nanometers, of the inner ones of a product; `None` where there is no
    /// table.
    #[must_use]
    pub fn table_range_nm(&self) -> Option<[f64; 2]> {
        match self {
            Self::Regular {
                first_nm,
                step_nm,
                values,
            } => Some([*first_nm, first_nm + step_nm * (values.len() - 1) as f64]),
            Self::Table { nm, .. } => Some([nm[0], nm[nm.len() - 1]]),
            Self::Scaled { curve, .. } => curve.table_range_nm(),
            Self::Product(a, b) => match (a.table_range_nm(), b.table_range_nm()) {
                (Some(a), Some(b)) => Some([a[0].max(b[0]), a[1].min(b[1])]),
                (one, other) => one.or(other),
            },
            Self::Constant(_) | Self::Blackbody { .. } | Self::Sigmoid { .. } => None,
        }
    }

    /// Smallest and largest value over 360..830 nm, looked up every nanometer and at the knots.
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        let mut nm: Vec<f64> = (360..=830).map(f64::from).collect();
        self.append_knots_nm(&mut nm);
        nm.iter()
            .filter(|l| (360.0..=830.0).contains(*l))
            .map(|&l| self.eval(l))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            })
    }
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// The sigmoid reflectance of [`Curve::Sigmoid`].
fn sigmoid(c: &[f64; 3], lambda_nm: f64) -> f64 {
    let t = (lambda_nm - 360.0) / 470.0;
    let x = (c[0] * t + c[1]) * t + c[2];
    0.5 + 0.5 * x / (1.0 + x * x).sqrt()
}

/// Planck's law: spectral radiance in W m^-2 sr^-1 nm^-1.
fn planck(lambda_nm: f64, temp_k: f64) -> f64 {
    const H: f64 = 6.626_070_15e-34;
    const C: f64 = 299_792_458.0;
    const K: f64 = 1.380_649e-23;
    let lambda_m = lambda_nm * 1e-9;
    2.0 * H * C * C / lambda_m.powi(5) / (H * C / (lambda_m * K * temp_k)).exp_m1() * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_interpolate_and_hold_their_ends() {
        let regular = Curve::table(&[400.0, 410.0, 420.0], &[1.0, 3.0, 2.0]);
        let table = Curve::table(&[400.0, 410.0, 425.0], &[1.0, 3.0, 1.5]);
        assert!(matches!(regular, Curve::Regular { .. }));
        assert!(matches!(table, Curve::Table { .. }));
        for (lambda, want) in [
            (390.0, 1.0),
            (400.0, 1.0),
            (405.0, 2.0),
            (410.0, 3.0),
            (415.0, 2.5),
            (420.0, 2.0),
        ] {
            assert!((regular.eval(lambda) - want).abs() < 1e-12, "{lambda}");
            assert!((table.eval(lambda) - want).abs() < 1e-12, "{lambda}");
        }
        assert_eq!(regular.eval(900.0), 2.0);
        assert_eq!(table.eval(900.0), 1.5);
        let single = Curve::table(&[500.0], &[7.0]);
        assert_eq!(
            (single.eval(1.0), single.eval(500.0), single.eval(900.0)),
            (7.0, 7.0, 7.0)
        );
    }

    #[test]
    fn planck_obeys_stefan_boltzmann_and_wien() {
        // Integral of the radiance over all wavelengths: sigma T^4 / pi.
        let body = Curve::Blackbody {
            temp_k: 5000.0,
            scale: 1.0,
        };
        let (n, low, high) = (200_000, 50.0_f64.ln(), 1e6_f64.ln());
        let step = (high - low) / f64::from(n);
        let total: f64 = (0..n)
            .map(|i| {
                let lambda = (low + (f64::from(i) + 0.5) * step).exp();
                body.eval(lambda) * lambda * step
            })
            .sum();
        let want = 5.670_374_419e-8 * 5000.0_f64.powi(4) / std::f64::consts::PI;
        assert!((total / want - 1.0).abs() < 1e-6, "{total} {want}");
        // Wien: the largest radiance at 2.897771955e6 nm K / T.
        let peak = 2.897_771_955e6 / 5000.0;
        assert!(body.eval(peak) > body.eval(peak * 1.001));
        assert!(body.eval(peak) > body.eval(peak / 1.001));
    }

    #[test]
    fn sigmoid_stays_in_the_unit_interval() {
        for c in [
            [0.0, 0.0, 0.0],
            [1e100, -1e100, 3.0],
            [-400.0, 300.0, -30.0],
        ] {
            let curve = Curve::Sigmoid { c };
            assert!((360..=830).all(|l| (0.0..=1.0).contains(&curve.eval(f64::from(l)))));
        }
        assert_eq!(Curve::Sigmoid { c: [0.0; 3] }.eval(500.0), 0.5);
    }

    #[test]
    fn products_and_factors() {
        let table = Curve::table(&[400.0, 500.0], &[1.0, 2.0]);
        let product = Curve::Product(Box::new(table.clone()), Box::new(Curve::Constant(3.0)));
        assert!((product.scaled(2.0).scaled(0.5).eval(450.0) - 4.5).abs() < 1e-12);
        let mut knots = Vec::new();
        table.scaled(2.0).append_knots_nm(&mut knots);
        assert_eq!(knots, [400.0, 500.0]);
    }
}
