//! From the lanes of a path to the channels of an image.
//!
//! A lane's contribution already holds the average over lanes (its weights count the lanes that
//! reach it), so channels sum over lanes with no further factor but the density of the wavelength:
//! a probability at an emission line, per nanometre elsewhere.

use super::cie::{self, N_Y};
use super::{MAX_LANES, SampledWavelengths};

/// Luminous efficacy of 540 THz, lm/W (SI definition of the candela).
pub const MAX_EFFICACY_LM_PER_W: f64 = 683.0;

/// Importance of power that no eye sees, as a share of that of visible power
/// ([`SensorResponse::importance`]).
const INVISIBLE: f64 = 0.01;

/// Quantity that the three channels of an image measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorResponse {
    /// CIE XYZ, scaled so that a constant unit spectrum has Y = 1.
    Xyz,
    /// CIE XYZ in photometric units: Y in lm per unit of power (cd/m² from radiance, lx from
    /// irradiance).
    Photometric,
}

impl SensorResponse {
    /// The response to the wavelengths of one path.
    #[must_use]
    pub fn at(self, wavelengths: &SampledWavelengths) -> LaneResponse {
        let mut xyz = [[0.0; 3]; MAX_LANES];
        for (lane, xyz) in xyz.iter_mut().enumerate().take(wavelengths.count()) {
            *xyz = self
                .of(wavelengths.lambda_nm(lane))
                .map(|response| response / wavelengths.pdf(lane));
        }
        LaneResponse {
            wavelengths: *wavelengths,
            xyz,
            mean: xyz.map(|[x, y, z]| (x + y + z) / 3.0),
        }
    }

    /// Lumens (or lux, or cd/m²) that a Y of 1 stands for.
    #[must_use]
    pub fn photometric_unit(self) -> f64 {
        match self {
            Self::Xyz => MAX_EFFICACY_LM_PER_W * N_Y,
            Self::Photometric => 1.0,
        }
    }

    /// One number above 0 for a path's contributions wherever there are any: their brightness,
    /// and a hundredth of what power that no eye sees would be worth at its best.
    #[must_use]
    pub fn importance(self, response: &LaneResponse, contributions: &[f64; MAX_LANES]) -> f64 {
        let LaneResponse { wavelengths, .. } = response;
        let power = |lane: usize| contributions[lane] / wavelengths.pdf(lane);
        let power: f64 = (0..wavelengths.count()).map(power).sum();
        response.brightness(contributions) + INVISIBLE * self.scale() * power
    }

    fn scale(self) -> f64 {
        match self {
            Self::Xyz => 1.0 / N_Y,
            Self::Photometric => MAX_EFFICACY_LM_PER_W,
        }
    }

    /// X, Y and Z of unit power at a wavelength.
    fn of(self, lambda_nm: f64) -> [f64; 3] {
        let scale = self.scale();
        cie::cmf(lambda_nm).map(|matching| scale * matching)
    }
}

/// The wavelengths of one path, and what a unit contribution in each of its lanes adds to X, Y and
/// Z.
#[derive(Clone, Copy, Debug)]
pub struct LaneResponse {
    /// The wavelengths.
    pub wavelengths: SampledWavelengths,
    xyz: [[f64; 3]; MAX_LANES],
    mean: [f64; MAX_LANES],
}

impl LaneResponse {
    /// X, Y and Z of a path's contributions, one per lane.
    #[must_use]
    pub fn xyz(&self, contributions: &[f64; MAX_LANES]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let lanes = self.xyz.iter().zip(contributions);
        for (response, contribution) in lanes.take(self.wavelengths.count()) {
            for (channel, response) in sum.iter_mut().zip(response) {
                *channel += response * contribution;
            }
        }
        sum
    }

    /// One number for a path's contributions, to compare them by: the mean of X, Y and Z.
    #[must_use]
    pub fn brightness(&self, contributions: &[f64; MAX_LANES]) -> f64 {
        let lanes = contributions.iter().zip(&self.mean);
        lanes.map(|(value, response)| value * response).sum()
    }
}

/// Power by wavelength: equal bins for the continuous part of spectra, then one channel for each
/// emission line.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralChannels {
    range_nm: [f64; 2],
    bins: usize,
    lines_nm: Vec<f64>,
}

impl SpectralChannels {
    /// `bins` equal bins over `range_nm` (mean per nanometre in each; none where the range is a
    /// single wavelength) and a channel (power) for each of `lines_nm`.
    #[must_use]
    pub fn new(range_nm: [f64; 2], bins: usize, mut lines_nm: Vec<f64>) -> Self {
        lines_nm.sort_by(f64::total_cmp);
        lines_nm.dedup();
        Self {
            range_nm,
            bins: if range_nm[0] < range_nm[1] { bins } else { 0 },
            lines_nm,
        }
    }

    /// Range of the bins, in nanometres.
    #[must_use]
    pub fn range_nm(&self) -> [f64; 2] {
        self.range_nm
    }

    /// Centres of the bins, in nanometres.
    pub fn bin_centers_nm(&self) -> impl Iterator<Item = f64> {
        let (start, width) = (self.range_nm[0], self.bin_width_nm());
        (0..self.bins).map(move |i| start + (i as f64 + 0.5) * width)
    }

    /// Wavelengths of the line channels, ascending; their channels follow the bins.
    #[must_use]
    pub fn lines_nm(&self) -> &[f64] {
        &self.lines_nm
    }

    /// Width of a bin in nanometres.
    #[must_use]
    pub fn bin_width_nm(&self) -> f64 {
        (self.range_nm[1] - self.range_nm[0]) / self.bins as f64
    }

    /// The channel of a wavelength and its width (1 for a line). `None` outside the range or for an
    /// unknown line.
    fn channel(&self, lambda_nm: f64, is_line: bool) -> Option<(usize, f64)> {
        if is_line {
            let line = self
                .lines_nm
                .binary_search_by(|l| l.total_cmp(&lambda_nm))
                .ok()?;
            return Some((self.bins + line, 1.0));
        }
        let [start, end] = self.range_nm;
        if self.bins == 0 || !(start..=end).contains(&lambda_nm) {
            return None;
        }
        let width = self.bin_width_nm();
        Some((
            ((lambda_nm - start) / width).min(self.bins as f64 - 1.0) as usize,
            width,
        ))
    }

    /// Number of channels: the bins, then the lines.
    #[must_use]
    pub fn count(&self) -> usize {
        self.bins + self.lines_nm.len()
    }

    /// Adds a path's contributions, one per lane in use, to the channels.
    pub fn add(
        &self,
        wavelengths: &SampledWavelengths,
        contributions: &[f64],
        channels: &mut [f64],
    ) {
        for (lane, &contribution) in contributions.iter().enumerate().take(wavelengths.count()) {
            self.add_one(
                wavelengths.lambda_nm(lane),
                wavelengths.is_line(lane),
                contribution / wavelengths.pdf(lane),
                channels,
            );
        }
    }

    /// Adds an estimate of the spectrum's integral that was made at one wavelength.
    fn add_one(&self, lambda_nm: f64, is_line: bool, value: f64, channels: &mut [f64]) {
        if let Some((channel, width)) = self.channel(lambda_nm, is_line) {
            channels[channel] += value / width;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::WavelengthDistribution;
    use super::*;

    #[test]
    fn lanes_sum_to_the_integral() {
        // each of 4 lanes holds a quarter of a unit spectrum, whatever the wavelengths are drawn
        // from
        for distribution in [
            WavelengthDistribution::uniform([360.0, 830.0]),
            WavelengthDistribution::visible([360.0, 830.0]),
        ] {
            let passes = 4000;
            let mut xyz = [0.0; 3];
            for i in 0..passes {
                let u = (f64::from(i) + 0.5) / f64::from(passes);
                let wavelengths = distribution.sample(u, 4);
                let path = SensorResponse::Xyz.at(&wavelengths).xyz(&[0.25; MAX_LANES]);
                (0..3).for_each(|c| xyz[c] += path[c]);
            }
            let y = xyz[1] / f64::from(passes);
            // midpoint rule in primary space: error far below the 1e-4 allowed
            assert!((y - 1.0).abs() < 1e-4, "{y}");
        }
        let line = WavelengthDistribution::lines(&[587.5618]);
        let channels = SpectralChannels::new([400.0, 700.0], 3, vec![587.5618]);
        let mut out = [0.0; 4];
        channels.add(&line.sample(0.3, 1), &[2.5], &mut out);
        assert_eq!(out, [0.0, 0.0, 0.0, 2.5]);
    }

    #[test]
    fn constant_unit_spectrum_reads_one() {
        let (mut relative, mut photometric) = ([0.0f64; 3], [0.0f64; 3]);
        // the rectangle sum over the table, each wavelength standing for 1 nm
        for nm in 360..=830 {
            for (response, sum) in [
                (SensorResponse::Xyz, &mut relative),
                (SensorResponse::Photometric, &mut photometric),
            ] {
                let added = response.of(f64::from(nm));
                (0..3).for_each(|c| sum[c] += added[c]);
            }
        }
        assert!((relative[1] - 1.0).abs() < 1e-12, "{relative:?}");
        // an equal-energy stimulus is white within 4 digits
        assert!((relative[0] - 1.0).abs() < 1e-3 && (relative[2] - 1.0).abs() < 1e-3);
        assert!((photometric[1] - 683.0 * N_Y).abs() < 1e-6);
    }

    #[test]
    fn bins_and_lines_have_channels_of_their_own() {
        let spectral = SpectralChannels::new([400.0, 700.0], 3, vec![589.0, 546.1, 589.0]);
        let centers: Vec<f64> = spectral.bin_centers_nm().collect();
        assert_eq!(centers, [450.0, 550.0, 650.0]);
        assert_eq!(spectral.lines_nm(), [546.1, 589.0]);
        assert_eq!(spectral.count(), 5);
        let mut out = [0.0; 5];
        spectral.add_one(400.0, false, 100.0, &mut out);
        spectral.add_one(550.0, false, 200.0, &mut out);
        spectral.add_one(700.0, false, 300.0, &mut out);
        spectral.add_one(700.1, false, 1e9, &mut out);
        spectral.add_one(546.1, true, 5.0, &mut out);
        spectral.add_one(546.1, false, 100.0, &mut out);
        spectral.add_one(600.0, true, 1e9, &mut out);
        assert_eq!(out, [1.0, 3.0, 3.0, 5.0, 0.0]);
    }
}
