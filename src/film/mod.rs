//! The film: sums per pixel that do not depend on the order of addition.
//!
//! Passes of even and odd number go into two halves, whose difference tells the error. All values are sums; dividing by
//! the number of passes gives the image.

pub mod filter;
pub mod fixed;
pub mod sensor_response;

pub use filter::Filter;
pub use sensor_response::{SensorResponse, SpectralChannels};

use fixed::{FixedSum, Unrepresentable};
use glam::DVec2;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The part of the film that is rendered, in pixels: x0 <= x < x1, y0 <= y < y1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl Crop {
    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        u64::from(self.width()) * u64::from(self.height())
    }

    /// Number of columns.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.x1 - self.x0
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.y1 - self.y0
    }

    /// Whether the pixel is part of it.
    #[must_use]
    pub fn contains(&self, x: u32, y: u32) -> bool {
        (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y)
    }

    /// Position of a pixel of the crop, row by row.
    fn index(&self, x: u32, y: u32) -> usize {
        (y - self.y0) as usize * self.width() as usize + (x - self.x0) as usize
    }
}

/// How many contributions were left out. A correct render has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejected {
    /// Infinite or not a number.
    pub not_finite: u64,
    /// Too large to add (see [`fixed::MAX_VALUE`]), or made a sum overflow.
    pub saturated: u64,
}

/// Why sums cannot be added to a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AddSumsError {
    /// They belong to a film of another size.
    #[error("the film has {expected} sums, the part has {found}")]
    Length {
        /// Sums of the film.
        expected: usize,
        /// Sums given.
        found: usize,
    },
    /// Some sum would leave the range of 128 bits.
    #[error("sum {index} overflows")]
    Overflow {
        /// Position in [`Film::sums`].
        index: usize,
    },
}

/// Half width of the window over which the error estimate is averaged, in pixels.
const ERROR_WINDOW: u32 = 3;

/// Sums of one image with `channels` channels (3 for XYZ), in two halves (even and odd passes).
///
/// Threads add concurrently; each value is rounded to a 128-bit fixed-point integer, so any order gives the same bits.
/// A contribution with a value that cannot be added is left out as a whole and counted.
#[derive(Debug)]
pub struct Film {
    crop: Crop,
    filter: Filter,
    channels: usize,
    /// By half, row, column, channel.
    sums: Vec<FixedSum>,
    not_finite: AtomicU64,
    saturated: AtomicU64,
}

impl Film {
    /// An empty film.
    #[must_use]
    pub fn new(crop: Crop, filter: Filter, channels: usize) -> Self {
        let count = 2 * crop.pixels() as usize * channels;
        Self {
            crop,
            filter,
            channels,
            sums: (0..count).map(|_| FixedSum::default()).collect(),
            not_finite: AtomicU64::new(0),
            saturated: AtomicU64::new(0),
        }
    }

    /// The part of the film that is held.
    #[must_use]
    pub fn crop(&self) -> Crop {
        self.crop
    }

    /// The reconstruction filter.
    #[must_use]
    pub fn filter(&self) -> &Filter {
        &self.filter
    }

    /// Number of channels.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// How many contributions were left out so far.
    #[must_use]
    pub fn rejected(&self) -> Rejected {
        Rejected {
            not_finite: self.not_finite.load(Relaxed),
            saturated: self.saturated.load(Relaxed),
        }
    }

    /// Adds to one pixel (absolute film coordinates; nothing happens outside the crop) of half `half` (0 or 1). One value
    /// per channel.
    pub fn add_pixel(&self, x: u32, y: u32, half: usize, values: &[f64]) {
        if self.crop.contains(x, y) {
            self.add_scaled(x, y, half, values, 1.0);
        }
    }

    /// Adds a splat at a raster position: every pixel p in the filter's reach gets value × f_p(raster) × pixel area.
    /// Positions outside the film count as far as they reach into it.
    pub fn add_splat(&self, raster: DVec2, half: usize, values: &[f64]) {
        if !raster.is_finite() {
            self.not_finite.fetch_add(1, Relaxed);
            return;
        }
        // pixels whose offset is in [-radius, radius): exactly one for the box
        let reach = |raster: f64, first: u32, end: u32| {
            let low = (raster - 0.5 - self.filter.radius()).floor() + 1.0;
            let high = (raster - 0.5 + self.filter.radius()).floor() + 1.0;
            // saturating casts: far positions give an empty range
            (low.max(0.0) as u32).max(first)..(high.max(0.0) as u32).min(end)
        };
        for y in reach(raster.y, self.crop.y0, self.crop.y1) {
            for x in reach(raster.x, self.crop.x0, self.crop.x1) {
                let center = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
                let weight = self.filter.eval(raster - center);
                if weight > 0.0 {
                    self.add_scaled(x, y, half, values, weight);
                }
            }
        }
    }

    fn add_scaled(&self, x: u32, y: u32, half: usize, values: &[f64], scale: f64) {
        debug_assert!(values.len() == self.channels && half < 2);
        for &value in values {
            match fixed::quantize(value * scale) {
                Ok(_) => {}
                Err(Unrepresentable::NotFinite) => {
                    self.not_finite.fetch_add(1, Relaxed);
                    return;
                }
                Err(Unrepresentable::TooLarge) => {
                    self.saturated.fetch_add(1, Relaxed);
                    return;
                }
            }
        }
        let pixel = half * self.crop.pixels() as usize + self.crop.index(x, y);
        for (sum, &value) in self.sums[pixel * self.channels..].iter().zip(values) {
            if let Ok(value) = fixed::quantize(value * scale)
                && !sum.add(value)
            {
                self.saturated.fetch_add(1, Relaxed);
            }
        }
    }

    fn half_sums(&self, half: usize) -> &[FixedSum] {
        let length = self.sums.len() / 2;
        &self.sums[half * length..(half + 1) * length]
    }

    /// Sum of both halves / number of passes, per pixel and channel, row by row. Black without passes.
    #[must_use]
    pub fn image(&self, passes: u64) -> Vec<f64> {
        let scale = mean_scale(passes);
        self.half_sums(0)
            .iter()
            .zip(self.half_sums(1))
            .map(|(even, odd)| (fixed::to_f64(even.get()) + fixed::to_f64(odd.get())) * scale)
            .collect()
    }

    /// The images of the even and of the odd passes alone, as [`Film::image`].
    #[must_use]
    pub fn half_images(&self, passes_even: u64, passes_odd: u64) -> [Vec<f64>; 2] {
        [(0, passes_even), (1, passes_odd)].map(|(half, passes)| {
            let scale = mean_scale(passes);
            self.half_sums(half)
                .iter()
                .map(|sum| fixed::to_f64(sum.get()) * scale)
                .collect()
        })
    }

    /// Standard error of one channel of [`Film::image`] per pixel, row by row: from the difference of the halves, its
    /// square averaged over 7 × 7 pixels (fewer at the border). `None` while a half has no passes.
    ///
    /// With pₑ and pₒ passes, Var(E − O) = σ²(1/pₑ + 1/pₒ) and the image has variance σ²/(pₑ + pₒ), so the factor
    /// between them is pₑ pₒ/(pₑ + pₒ)².
    #[must_use]
    pub fn standard_error(
        &self,
        channel: usize,
        passes_even: u64,
        passes_odd: u64,
    ) -> Option<Vec<f64>> {
        if passes_even == 0 || passes_odd == 0 || channel >= self.channels {
            return None;
        }
        let [even, odd] = self.half_images(passes_even, passes_odd);
        let share = passes_even as f64 / (passes_even + passes_odd) as f64;
        let variance: Vec<f64> = even
            .iter()
            .zip(&odd)
            .skip(channel)
            .step_by(self.channels)
            .map(|(e, o)| (e - o).powi(2) * share * (1.0 - share))
            .collect();
        let Crop { x0, y0, x1, y1 } = self.crop;
        let window = |at: u32, first: u32, end: u32| {
            at.saturating_sub(ERROR_WINDOW).max(first)..at.saturating_add(ERROR_WINDOW + 1).min(end)
        };
        let mut errors = Vec::with_capacity(variance.len());
        for y in y0..y1 {
            for x in x0..x1 {
                let (mut sum, mut count) = (0.0, 0.0);
                for wy in window(y, y0, y1) {
                    for wx in window(x, x0, x1) {
                        sum += variance[self.crop.index(wx, wy)];
                        count += 1.0;
                    }
                }
                errors.push(f64::sqrt(sum / count));
            }
        }
        Some(errors)
    }

    /// The exact sums in units of 2⁻⁶⁴, by half, row, column and channel.
    #[must_use]
    pub fn sums(&self) -> Vec<i128> {
        self.sums.iter().map(FixedSum::get).collect()
    }

    /// Adds the sums of another film of the same size.
    ///
    /// # Errors
    /// Where the number of sums differs or one would overflow; the film is then unchanged.
    pub fn add_sums(&mut self, sums: &[i128]) -> Result<(), AddSumsError> {
        if sums.len() != self.sums.len() {
            return Err(AddSumsError::Length {
                expected: self.sums.len(),
                found: sums.len(),
            });
        }
        let total = |(index, (sum, &more)): (usize, (&FixedSum, &i128))| {
            sum.get()
                .checked_add(more)
                .ok_or(AddSumsError::Overflow { index })
        };
        let totals: Vec<i128> = self
            .sums
            .iter()
            .zip(sums)
            .enumerate()
            .map(total)
            .collect::<Result<_, _>>()?;
        for (sum, total) in self.sums.iter_mut().zip(totals) {
            sum.set(total);
        }
        Ok(())
    }
}

fn mean_scale(passes: u64) -> f64 {
    if passes == 0 {
        0.0
    } else {
        1.0 / passes as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};

    const CROP: Crop = Crop {
        x0: 2,
        y0: 1,
        x1: 6,
        y1: 4,
    };

    fn random(i: u64) -> f64 {
        unit_f64(random_bits(5, i))
    }

    #[test]
    fn any_order_and_any_threads_give_the_same_bits() {
        let add = |film: &Film, i: u64| {
            let raster = DVec2::new(8.0 * random(3 * i), 5.0 * random(3 * i + 1));
            // ten orders of magnitude: f64 sums would differ
            let value = 10.0_f64.powf(10.0 * random(3 * i + 2) - 5.0);
            film.add_splat(raster, (i % 2) as usize, &[value, 0.1 * value]);
        };
        let new = || {
            Film::new(
                CROP,
                Filter::Gaussian {
                    sigma: 0.5,
                    radius: 1.5,
                },
                2,
            )
        };
        let count = 4000;
        let (forward, backward, threaded) = (new(), new(), new());
        (0..count).for_each(|i| add(&forward, i));
        (0..count).rev().for_each(|i| add(&backward, i));
        std::thread::scope(|scope| {
            for part in 0..4 {
                let (film, add) = (&threaded, &add);
                scope.spawn(move || (part..count).step_by(4).for_each(|i| add(film, i)));
            }
        });
        assert_eq!(forward.sums(), backward.sums());
        assert_eq!(forward.sums(), threaded.sums());
        assert!(forward.sums().iter().all(|&s| s > 0));
        // two parts of disjoint contributions add up to the whole
        let (mut left, right) = (new(), new());
        (0..1500).for_each(|i| add(&left, i));
        (1500..count).for_each(|i| add(&right, i));
        left.add_sums(&right.sums()).unwrap();
        assert_eq!(left.sums(), forward.sums());
        assert_eq!(forward.rejected(), Rejected::default());
    }

    #[test]
    fn box_splats_land_in_one_pixel() {
        let film = Film::new(CROP, Filter::Box, 1);
        for (raster, index) in [
            (DVec2::new(2.0, 1.0), Some(0)),
            (DVec2::new(5.999, 3.999), Some(11)),
            (DVec2::new(3.0, 2.0), Some(5)),
            (DVec2::new(6.0, 2.0), None),
            (DVec2::new(1.999, 2.0), None),
            (DVec2::new(-1e300, 1e300), None),
        ] {
            let before = film.sums();
            film.add_splat(raster, 0, &[1.0]);
            let changed: Vec<usize> = (0..before.len())
                .filter(|&i| film.sums()[i] != before[i])
                .collect();
            assert_eq!(changed, index.into_iter().collect::<Vec<_>>(), "{raster}");
        }
    }

    #[test]
    fn a_uniform_field_of_splats_is_flat_to_the_corners() {
        let crop = Crop {
            x0: 0,
            y0: 0,
            x1: 4,
            y1: 3,
        };
        for filter in [
            Filter::Box,
            Filter::Tent { radius: 1.5 },
            Filter::Gaussian {
                sigma: 0.5,
                radius: 2.0,
            },
        ] {
            let film = Film::new(crop, filter, 1);
            // a regular grid over the film widened by the margin, one unit per pixel area
            let (per_pixel, margin) = (40, filter.margin().ceil() as i32);
            let step = 1.0 / f64::from(per_pixel);
            for y in -margin * per_pixel..(3 + margin) * per_pixel {
                for x in -margin * per_pixel..(4 + margin) * per_pixel {
                    let raster = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) * step;
                    film.add_splat(raster, 0, &[step * step]);
                }
            }
            for value in film.image(1) {
                // midpoint rule with 40 points per pixel
                assert!((value - 1.0).abs() < 1e-3, "{filter:?}: {value}");
            }
        }
    }

    #[test]
    fn images_are_means_over_passes() {
        let film = Film::new(CROP, Filter::Box, 2);
        film.add_pixel(3, 2, 0, &[3.0, 30.0]);
        film.add_pixel(3, 2, 1, &[1.0, 10.0]);
        film.add_pixel(0, 0, 0, &[7.0, 7.0]);
        let at = 2 * (4 + 1);
        let image = film.image(4);
        assert_eq!((image[at], image[at + 1]), (1.0, 10.0));
        assert_eq!(image.iter().sum::<f64>(), 11.0);
        let [even, odd] = film.half_images(3, 1);
        assert_eq!((even[at], odd[at]), (1.0, 1.0));
        assert!(film.image(0).iter().all(|&v| v == 0.0));
    }

    #[test]
    fn standard_error_predicts_the_spread() {
        // 5 even and 4 odd passes of uniform noise on a constant image
        let crop = Crop {
            x0: 0,
            y0: 0,
            x1: 60,
            y1: 60,
        };
        let film = Film::new(crop, Filter::Box, 1);
        let mut i = 0;
        for pass in 0..9 {
            for y in 0..60 {
                for x in 0..60 {
                    film.add_pixel(x, y, pass % 2, &[random(1_000_000 + i)]);
                    i += 1;
                }
            }
        }
        let errors = film.standard_error(0, 5, 4).unwrap();
        let mean = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        let expected = 1.0 / 12.0 / 9.0;
        // 3600 squares of normal numbers: relative error sqrt(2/3600) = 2.4 %
        assert!((mean / expected - 1.0).abs() < 0.1, "{}", mean / expected);
        assert!(film.standard_error(0, 1, 0).is_none());
        assert!(film.standard_error(1, 5, 4).is_none());
    }

    #[test]
    fn bad_values_are_counted_and_left_out() {
        let film = Film::new(CROP, Filter::Box, 2);
        film.add_pixel(2, 1, 0, &[1.0, f64::NAN]);
        film.add_splat(DVec2::new(2.5, 1.5), 0, &[f64::INFINITY, 1.0]);
        film.add_splat(DVec2::new(f64::NAN, 1.5), 0, &[1.0, 1.0]);
        film.add_pixel(2, 1, 1, &[1e300, 1.0]);
        assert_eq!(
            film.rejected(),
            Rejected {
                not_finite: 3,
                saturated: 1
            }
        );
        assert!(film.sums().iter().all(|&s| s == 0));
    }

    #[test]
    fn sums_of_other_films_are_refused() {
        let mut film = Film::new(CROP, Filter::Box, 1);
        let expected = film.sums().len();
        let error = film.add_sums(&[1, 2]).unwrap_err();
        assert_eq!(error, AddSumsError::Length { expected, found: 2 });
        film.add_pixel(3, 1, 0, &[1.0]);
        let before = film.sums();
        let error = film.add_sums(&vec![i128::MAX; expected]).unwrap_err();
        assert_eq!(error, AddSumsError::Overflow { index: 1 });
        assert_eq!(film.sums(), before);
    }
}
