//! Standard errors of the figures of a spot, to first order in the noise of the pixels.
//!
//! A figure f(v) of pixels v that err independently with variances σᵢ² has the variance
//! Σ (∂f/∂vᵢ)² σᵢ². Of σᵢ² one sample is known, the square of the pixel's noise
//! ([`Film::noise`](crate::film::Film::noise)), so that with n lit pixels the error is itself known
//! to about 1/√(2n).

use super::{Frame, SHARES, Spot};
use glam::DVec2;
use std::f64::consts::{PI, TAU};

/// Standard errors of the figures of a [`Spot`], in their units.
#[derive(Clone, Debug)]
pub struct SpotErrors {
    /// Of the power.
    pub power: f64,
    /// Of the centroid, millimeters along x and y.
    pub centroid_mm: DVec2,
    /// Of the root mean square radius, millimeters.
    pub rms_radius_mm: f64,
    /// Of the root mean square distances along x and y, millimeters.
    pub rms_mm: DVec2,
    /// Of the radii that hold the [`SHARES`] of the power, millimeters.
    pub encircled_mm: [f64; 3],
    /// Of the modulation transfer at each frequency, along x and y.
    pub modulation: Vec<[f64; 2]>,
}

/// A spot with what its derivatives are made of.
struct Derivatives<'a> {
    frame: &'a Frame,
    values: &'a [f64],
    noise: &'a [f64],
    /// Pixels whose mean has been taken from all, where it has.
    border: Option<Vec<bool>>,
    sum: f64,
    spot: &'a Spot,
}

impl Frame {
    /// Errors of a spot that was measured of `values`, from which the mean of the border was taken
    /// before if there was a `background`.
    pub(super) fn errors(
        &self,
        spot: &Spot,
        values: &[f64],
        noise: &[f64],
        background: bool,
    ) -> SpotErrors {
        let border = background.then(|| super::border(self.window).collect());
        let derivatives = Derivatives {
            frame: self,
            values,
            noise,
            border,
            sum: values.iter().sum(),
            spot,
        };
        derivatives.errors()
    }
}

impl Derivatives<'_> {
    fn errors(&self) -> SpotErrors {
        let frequencies = self.spot.modulation.iter();
        let modulation = frequencies.map(|m| [0, 1].map(|axis| self.modulation(m.per_mm, axis)));
        let along = |axis: usize| self.error(|i| self.off(i)[axis] / self.sum);
        let square = |of: &dyn Fn(DVec2) -> f64, mean: f64| {
            self.error(|i| (of(self.off(i)) - mean) / self.sum)
        };
        let own = self.frame.pitch_mm * self.frame.pitch_mm / 12.0;
        let mean = self.spot.rms_mm * self.spot.rms_mm + own;
        let squares = [0, 1].map(|axis| square(&|off| off[axis] * off[axis], mean[axis]));
        let radius = square(&DVec2::length_squared, mean.element_sum());
        SpotErrors {
            power: self.error(|_| self.frame.pixel_measure),
            centroid_mm: DVec2::new(along(0), along(1)),
            rms_radius_mm: of_root(radius, self.spot.rms_radius_mm()),
            rms_mm: DVec2::from_array([0, 1].map(|i| of_root(squares[i], self.spot.rms_mm[i]))),
            encircled_mm: [0, 1, 2].map(|i| self.encircled(SHARES[i], self.spot.encircled_mm[i])),
            modulation: modulation.collect(),
        }
    }

    /// Distance of the middle of a pixel from the centroid, millimeters.
    fn off(&self, i: usize) -> DVec2 {
        self.frame.to_mm(self.frame.pixel(i)) - self.spot.centroid_mm
    }

    /// Error of a figure with these derivatives by the values of the pixels.
    fn error(&self, derivative: impl Fn(usize) -> f64) -> f64 {
        let count = self.values.len();
        // the mean of the border is in all values
        let shared = self.border.as_ref().map_or(0.0, |border| {
            let pixels = border.iter().filter(|b| **b).count() as f64;
            (0..count).map(&derivative).sum::<f64>() / pixels
        });
        let is_border = |i: usize| self.border.as_ref().is_some_and(|border| border[i]);
        let term = |i: usize| {
            let of_border = if is_border(i) { shared } else { 0.0 };
            ((derivative(i) - of_border) * self.noise[i]).powi(2)
        };
        (0..count).map(term).sum::<f64>().sqrt()
    }

    /// Share of a pixel within `radius` of a point that lies `moved` from the centroid.
    fn inside(&self, i: usize, radius: f64, moved: DVec2) -> f64 {
        const SIDE: u32 = super::SUB;
        let (middle, pitch) = (self.off(i) - moved, self.frame.pitch_mm);
        let (distance, reach) = (middle.length(), 0.5 * pitch.length());
        if distance > radius + reach {
            return 0.0;
        }
        if distance + reach < radius {
            return 1.0;
        }
        let offset = |k: u32| (f64::from(k) + 0.5) / f64::from(SIDE) - 0.5;
        let points = (0..SIDE * SIDE).filter(|k| {
            let within = DVec2::new(offset(k % SIDE), offset(k / SIDE));
            (middle + within * pitch).length() <= radius
        });
        points.count() as f64 / f64::from(SIDE * SIDE)
    }

    fn share_within(&self, radius: f64, moved: DVec2) -> f64 {
        let lit = self.values.iter().enumerate().filter(|(_, v)| **v != 0.0);
        let inside = lit.map(|(i, v)| v * self.inside(i, radius, moved));
        inside.sum::<f64>() / self.sum
    }

    /// Of the radius that holds a share: the error of the share within it, over its growth with the
    /// radius. The centroid about which it is drawn errs with it.
    fn encircled(&self, share: f64, radius: f64) -> f64 {
        let step = (0.05 * radius).max(0.5 * self.frame.pitch_mm.max_element());
        let within = |radius, moved| self.share_within(radius, moved);
        let low = (radius - step).max(0.0);
        let growth =
            (within(radius + step, DVec2::ZERO) - within(low, DVec2::ZERO)) / (radius + step - low);
        let slope = [DVec2::X, DVec2::Y].map(|axis| {
            let moved = axis * step;
            (within(radius, moved) - within(radius, -moved)) / (2.0 * step)
        });
        let slope = DVec2::from_array(slope);
        let of_share = self.error(|i| {
            let inside = self.inside(i, radius, DVec2::ZERO);
            (inside - share + slope.dot(self.off(i))) / self.sum
        });
        of_share / growth
    }

    fn modulation(&self, per_mm: f64, axis: usize) -> f64 {
        let phase = |i: usize| {
            let along = self.frame.to_mm(self.frame.pixel(i))[axis];
            DVec2::from_angle(TAU * per_mm * along)
        };
        let waves = self.values.iter().enumerate().map(|(i, v)| *v * phase(i));
        let mean = waves.sum::<DVec2>() / self.sum;
        let (contrast, toward) = (mean.length(), mean.normalize_or_zero());
        let own = PI * per_mm * self.frame.pitch_mm[axis];
        let own = if own == 0.0 { 1.0 } else { own.sin() / own };
        self.error(|i| (phase(i).dot(toward) - contrast) / self.sum) / own.abs()
    }
}

/// Error of a root from that of its square.
fn of_root(error: f64, root: f64) -> f64 {
    if root > 0.0 {
        0.5 * error / root
    } else {
        error.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{SpotRequest, Spots, measure};
    use super::*;
    use crate::film::Crop;
    use crate::io::exr::{Channel, ExrImage, ImageMetadata, MetadataValue};
    use crate::io::identity::PIXEL_PITCH;
    use crate::math::hash::{random_bits, unit_f64};
    use std::path::Path;

    const SIDE: u32 = 24;
    const RAYS: u64 = 1200;
    const IMAGES: u64 = 240;

    /// Two halves of rays at random in an ellipse off the middle, and some anywhere.
    fn image(seed: u64, background: bool) -> ExrImage {
        let mut halves = [(); 2].map(|()| vec![0.0f32; (SIDE * SIDE) as usize]);
        for ray in 0..RAYS {
            let u = |k: u64| unit_f64(random_bits(seed, 8 * ray + k));
            let at = if background && u(4) < 0.2 {
                DVec2::new(u(2), u(3))
            } else {
                let ring = DVec2::from_angle(TAU * u(0)) * u(1).sqrt();
                DVec2::new(0.47, 0.55) + ring * DVec2::new(0.3, 0.2)
            };
            let [x, y] = (at * f64::from(SIDE)).to_array().map(|v| v as u32);
            // the number of rays is that of a Poisson distribution, near enough: each may be absent
            if u(5) < 0.5 {
                halves[usize::from(u(6) < 0.5)][(y * SIDE + x) as usize] += 1.0;
            }
        }
        let [even, odd] = halves;
        let pairs = || even.iter().zip(&odd);
        let channel = |name: &str, values: Vec<f32>| Channel {
            name: name.to_owned(),
            values,
        };
        let text = |name: &str, text: &str| (name.to_owned(), MetadataValue::Text(text.to_owned()));
        ExrImage {
            width: SIDE,
            height: SIDE,
            crop: Crop::whole(SIDE, SIDE),
            channels: vec![
                channel("Y", pairs().map(|(a, b)| a + b).collect()),
                channel("noise.Y", pairs().map(|(a, b)| a - b).collect()),
            ],
            metadata: ImageMetadata {
                entries: vec![text(PIXEL_PITCH, "0.00001 x 0.00001 m")],
            },
        }
    }

    fn figures(spot: &Spot) -> Vec<f64> {
        let c = spot.centroid_mm;
        let mut all = vec![c.x, c.y, spot.rms_radius_mm(), spot.rms_mm.x, spot.rms_mm.y];
        all.extend(spot.encircled_mm);
        all.extend(spot.modulation.iter().flat_map(|m| m.contrast));
        all
    }

    fn errors(spot: &Spot) -> Vec<f64> {
        let errors = spot.errors.as_ref().expect("noise is known");
        let c = errors.centroid_mm;
        let rms = errors.rms_mm;
        let mut all = vec![c.x, c.y, errors.rms_radius_mm, rms.x, rms.y];
        all.extend(errors.encircled_mm);
        all.extend(errors.modulation.iter().flatten());
        all
    }

    /// Figures of many images scatter as the errors say that each tells.
    #[test]
    fn errors_are_the_scatter_of_figures() {
        for background in [false, true] {
            let request = SpotRequest {
                background,
                frequencies: vec![2.0, 5.0],
                ..SpotRequest::default()
            };
            let of = |seed| {
                let found: Spots =
                    measure(Path::new("image"), &image(seed, background), &request).expect("light");
                (figures(&found.spots[0]), errors(&found.spots[0]))
            };
            let all: Vec<_> = (0..IMAGES).map(of).collect();
            for figure in 0..all[0].0.len() {
                let n = IMAGES as f64;
                let mean = all.iter().map(|(f, _)| f[figure]).sum::<f64>() / n;
                let off = |(f, _): &(Vec<f64>, Vec<f64>)| (f[figure] - mean).powi(2);
                let scatter = (all.iter().map(off).sum::<f64>() / (n - 1.0)).sqrt();
                let told = all.iter().map(|(_, e)| e[figure].powi(2)).sum::<f64>() / n;
                let ratio = told.sqrt() / scatter;
                println!(
                    "background {background}, figure {figure}: {scatter:.3e}, ratio {ratio:.3}"
                );
                // the scatter is known to 1/sqrt(2n) = 4.6 %: four of them
                assert!((0.82..1.22).contains(&ratio), "{figure}: {ratio}");
            }
        }
    }
}
