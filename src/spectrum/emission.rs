//! Emission spectra: a continuous part per nanometer and exact lines.
//!
//! Lines are atoms of the wavelength measure, never narrow boxes. Invariant: the lines are sorted
//! by wavelength without repetition, so that a bitwise lookup finds the one line at a wavelength.

use super::{Curve, SampledSpectrum, SampledWavelengths, cie, illuminant, integrate, upsample};

/// A fifth of the mean of x + y + z over 360..830 nm: how much a wavelength matters that the
/// observer does not see.
const UNSEEN_RESPONSE: f64 = 0.2 * 3.0 * cie::N_Y / (cie::LAST_NM - cie::FIRST_NM);

/// One emission line: all its power at one wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Wavelength in nanometers.
    pub lambda_nm: f64,
    /// Power of the line, in the continuous part's unit times nanometers.
    pub value: f64,
}

/// Emission of a light: the sum of a continuous part and of lines, times `scale`.
///
/// The two parts live on different parts of the wavelength measure (Lebesgue + one atom per line):
/// at an atom only lines emit, elsewhere only the continuous part does. They are never added.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Emission {
    /// Per nanometer.
    pub continuous: Option<Curve>,
    /// Sorted by wavelength, without repetition.
    pub lines: Vec<Line>,
    /// Factor on both parts.
    pub scale: f64,
}

impl Emission {
    /// A continuous spectrum.
    #[must_use]
    pub fn from_curve(curve: Curve) -> Self {
        Self {
            continuous: Some(curve),
            lines: Vec::new(),
            scale: 1.0,
        }
    }

    /// Lines in any order; lines at bitwise the same wavelength are added.
    #[must_use]
    pub fn from_lines(mut lines: Vec<Line>) -> Self {
        lines.sort_by(|a, b| a.lambda_nm.total_cmp(&b.lambda_nm));
        lines.dedup_by(|next, kept| {
            let same = next.lambda_nm == kept.lambda_nm;
            if same {
                kept.value += next.value;
            }
            same
        });
        Self {
            continuous: None,
            lines,
            scale: 1.0,
        }
    }

    /// Linear sRGB as emission: a smooth spectrum times D65. `[1, 1, 1]` has Y = 1 and the XYZ of
    /// sRGB white; components are >= 0 and may exceed 1.
    #[must_use]
    pub fn from_rgb(rgb: [f64; 3]) -> Self {
        let max = rgb.iter().copied().fold(0.0, f64::max);
        if max <= 0.0 {
            return Self::default();
        }
        // Half of full reflectance keeps the fit away from the bounds.
        let reflectance = upsample::reflectance(rgb.map(|v| 0.5 * v / max));
        let d65 = illuminant::d65()
            .clone()
            .scaled(2.0 * max * illuminant::d65_unit_factor());
        Self::from_curve(Curve::Product(Box::new(reflectance), Box::new(d65)))
    }

    /// The same light, `factor` times as strong.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.scale *= factor;
        self
    }

    /// The same light scaled to luminance `y` (Y of [`super::xyz::emission_to_xyz`]); unchanged if
    /// it has none.
    #[must_use]
    pub fn with_luminance(self, y: f64) -> Self {
        let own = super::xyz::emission_to_xyz(&self)[1];
        if own > 0.0 {
            self.scaled(y / own)
        } else {
            self
        }
    }

    /// Power over 360 to 830 nm, lines anywhere included: the integral of the spectrum, in its unit
    /// times nanometers.
    #[must_use]
    pub fn power(&self) -> f64 {
        let smooth = self.continuous.as_ref().map_or(0.0, |curve| {
            let knots = curve.knots_nm();
            let [power] = integrate([cie::FIRST_NM, cie::LAST_NM], &knots, |l| [curve.eval(l)]);
            power
        });
        self.scale * (smooth + self.lines.iter().map(|l| l.value).sum::<f64>())
    }

    /// The same light scaled to this [`Emission::power`]; unchanged if it has none.
    #[must_use]
    pub fn with_power(self, power: f64) -> Self {
        let own = self.power();
        if own > 0.0 {
            self.scaled(power / own)
        } else {
            self
        }
    }

    /// Remainder of this light when only the wavelengths `lines_nm` exist: its own lines among
    /// them, and elsewhere its continuous part as the power of a 1 nm wide band.
    #[must_use]
    pub fn restricted_to_lines(&self, lines_nm: &[f64]) -> Self {
        let line = |&lambda_nm: &f64| {
            let own = self
                .lines
                .iter()
                .find(|l| l.lambda_nm == lambda_nm)
                .map(|l| l.value);
            let value = own.or(self.continuous.as_ref().map(|c| c.eval(lambda_nm)));
            value.map(|value| Line { lambda_nm, value })
        };
        let lines = lines_nm.iter().filter_map(line).collect();
        Self {
            scale: self.scale,
            ..Self::from_lines(lines)
        }
    }

    /// Largest value of both parts over 360..830 nm and the points of tables, with the scale.
    #[must_use]
    pub fn largest(&self) -> f64 {
        let smooth = self.continuous.as_ref().map_or(0.0, |c| c.bounds().1);
        let lines = self.lines.iter().map(|l| l.value);
        self.scale * lines.fold(smooth, f64::max)
    }

    /// Density per nanometer of the continuous part at `lambda_nm`, with the scale.
    #[must_use]
    pub fn density(&self, lambda_nm: f64) -> f64 {
        self.continuous
            .as_ref()
            .map_or(0.0, |c| self.scale * c.eval(lambda_nm))
    }

    /// Power of the line at exactly `lambda_nm`, with the scale; 0 where there is none.
    #[must_use]
    pub fn line_power(&self, lambda_nm: f64) -> f64 {
        let found = self
            .lines
            .binary_search_by(|l| l.lambda_nm.total_cmp(&lambda_nm));
        found.map_or(0.0, |i| self.scale * self.lines[i].value)
    }

    /// The values at the wavelengths of a path (line power at atoms, density elsewhere).
    #[must_use]
    pub fn sample(&self, wavelengths: &SampledWavelengths) -> SampledSpectrum {
        if let Some(Curve::Constant(value)) = &self.continuous
            && !wavelengths.has_lines()
        {
            return SampledSpectrum::splat((self.scale * value) as f32);
        }
        SampledSpectrum::of_lanes(wavelengths.count(), |lane| {
            let lambda_nm = wavelengths.lambda_nm(lane);
            let value = if wavelengths.is_line(lane) {
                self.line_power(lambda_nm)
            } else {
                self.density(lambda_nm)
            };
            value as f32
        })
    }

    /// Power over `range_nm` by which lights and wavelengths are chosen, never a result: the
    /// integral against x + y + z, and of the plain spectrum with a fifth of the observer's mean,
    /// so that light which only detectors see is chosen too. In the unit of the values times
    /// nanometers.
    #[must_use]
    pub fn sampling_power(&self, range_nm: [f64; 2]) -> f64 {
        let response = |l: f64| cie::cmf_sum(l) + UNSEEN_RESPONSE;
        let smooth = self.continuous.as_ref().map_or(0.0, |curve| {
            let mut knots = curve.knots_nm();
            knots.extend([cie::FIRST_NM, cie::LAST_NM]);
            let [power] = integrate(range_nm, &knots, |l| [curve.eval(l).max(0.0) * response(l)]);
            power
        });
        let inside = |line: &&Line| (range_nm[0]..=range_nm[1]).contains(&line.lambda_nm);
        let lines: f64 = self
            .lines
            .iter()
            .filter(inside)
            .map(|l| l.value * response(l.lambda_nm))
            .sum();
        self.scale * (smooth + lines)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{WavelengthDistribution, xyz};
    use super::*;

    const VISIBLE: [f64; 2] = [360.0, 830.0];

    #[test]
    fn a_peak_narrower_than_a_nanometer_has_its_energy() {
        for (nm, width) in [(532.0, 0.1), (532.5, 0.4), (550.013, 1e-3)] {
            for floor in [0.0, 0.01] {
                let curve = Curve::table(
                    &[360.0, nm - width, nm, nm + width, 830.0],
                    &[floor, floor, floor + 1.0 / width, floor, floor],
                );
                let emission = Emission::from_curve(curve);
                let around = |f: fn(f64) -> f64| {
                    // the observer is linear on both sides of the peak, or bends at it
                    let mean = |a: f64, b: f64| 0.5 * (f(a) + f(b));
                    0.5 * (mean(nm, nm - 2.0 / 3.0 * width) + mean(nm, nm + 2.0 / 3.0 * width))
                };
                let want = around(|l| cie::cmf(l)[1]) / cie::N_Y + floor;
                let y = xyz::emission_to_xyz(&emission)[1];
                assert!(
                    (y / want - 1.0).abs() < 1e-6,
                    "{nm} {width} {floor}: {y} {want}"
                );
                let bright = emission.clone().with_luminance(1.0);
                assert!((xyz::emission_to_xyz(&bright)[1] - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn light_that_nobody_sees_has_power() {
        let infrared = Emission::from_lines(vec![Line {
            lambda_nm: 1064.0,
            value: 1.0,
        }]);
        assert_eq!(infrared.sampling_power(VISIBLE), 0.0);
        assert!(infrared.sampling_power([360.0, 1100.0]) > 0.0);
    }

    #[test]
    fn white_rgb_is_srgb_white_with_unit_luminance() {
        for factor in [1.0, 7.5] {
            let got = xyz::emission_to_xyz(&Emission::from_rgb([factor; 3]));
            let want = xyz::linear_srgb_to_xyz([factor; 3]);
            for c in 0..3 {
                assert!((got[c] / want[c] - 1.0).abs() < 1e-3, "{got:?} {want:?}");
            }
            assert!((got[1] - factor).abs() < 1e-9);
        }
        assert_eq!(Emission::from_rgb([0.0; 3]).sampling_power(VISIBLE), 0.0);
    }

    #[test]
    fn rgb_emission_keeps_its_color_above_one() {
        let rgb = [4.0, 0.3, 0.05];
        let got = xyz::xyz_to_linear_srgb(xyz::emission_to_xyz(&Emission::from_rgb(rgb)));
        for c in 0..3 {
            assert!((got[c] - rgb[c]).abs() < 4e-3, "{got:?}");
        }
    }

    #[test]
    fn lines_emit_only_at_atoms_and_the_rest_only_elsewhere() {
        let line = |lambda_nm, value| Line { lambda_nm, value };
        let mut both =
            Emission::from_lines(vec![line(600.0, 1.0), line(500.0, 2.0), line(600.0, 3.0)]);
        assert_eq!(both.lines, [line(500.0, 2.0), line(600.0, 4.0)]);
        both.continuous = Some(Curve::Constant(0.25));
        both = both.scaled(2.0);
        let distribution = WavelengthDistribution::scene(&[(both.clone(), 1.0)], [400.0, 700.0]);
        let (mut at_lines, mut elsewhere) = (0, 0);
        for i in 0..500 {
            let wavelengths = distribution.sample((f64::from(i) + 0.5) / 500.0, 4);
            let values = both.sample(&wavelengths);
            for lane in 0..4 {
                if wavelengths.is_line(lane) {
                    at_lines += 1;
                    let want = if wavelengths.lambda_nm(lane) == 500.0 {
                        4.0
                    } else {
                        8.0
                    };
                    assert_eq!(values[lane], want);
                } else {
                    elsewhere += 1;
                    assert_eq!(values[lane], 0.5);
                }
            }
        }
        assert!(at_lines > 0 && elsewhere > 0);
        let at = |nm| cie::cmf_sum(nm) + UNSEEN_RESPONSE;
        let seen: f64 = (360..830).map(|l| cie::cmf_sum(f64::from(l) + 0.5)).sum();
        let want =
            2.0 * (2.0 * at(500.0) + 4.0 * at(600.0)) + 0.5 * (seen + 470.0 * UNSEEN_RESPONSE);
        let power = both.sampling_power(VISIBLE);
        assert!((power / want - 1.0).abs() < 1e-12, "{power} {want}");
        let only = both.restricted_to_lines(&[500.0, 550.0]);
        assert_eq!((only.line_power(500.0), only.line_power(550.0)), (4.0, 0.5));
        assert_eq!(only.line_power(600.0), 0.0);
        assert!((xyz::emission_to_xyz(&both.with_luminance(3.0))[1] - 3.0).abs() < 1e-12);
    }
}
