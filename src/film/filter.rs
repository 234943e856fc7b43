//! Reconstruction filters.
//!
//! A filter is a density over the offset from a pixel's centre, in pixels, that integrates to 1.
//! Camera samples are drawn from it and count with weight 1; splats are multiplied by it. None is
//! negative, so weights stay a partition of unity and images have no negative ringing.

use super::Crop;
use glam::DVec2;
use std::f64::consts::TAU;
use std::ops::Range;

/// Columns in reach whose part of a Gaussian is computed once for all rows.
const MOST_COLUMNS: usize = 16;

/// A non-negative, normalized pixel filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// The pixel itself.
    Box,
    /// A product of two triangles.
    Tent {
        /// Half the base, in pixels, > 0.
        radius: f64,
    },
    /// A round Gaussian, cut off at `radius`.
    Gaussian {
        /// Standard deviation in pixels, > 0.
        sigma: f64,
        /// Reach in pixels, > 0.
        radius: f64,
    },
}

impl Default for Filter {
    /// A Gaussian of half a pixel, cut off where it has fallen to 1.1 %.
    fn default() -> Self {
        Self::Gaussian {
            sigma: 0.5,
            radius: 1.5,
        }
    }
}

impl Filter {
    /// Largest offset in x or y with a value, in pixels.
    #[must_use]
    pub fn radius(&self) -> f64 {
        match *self {
            Self::Box => 0.5,
            Self::Tent { radius } | Self::Gaussian { radius, .. } => radius,
        }
    }

    /// How far outside the film a splat still reaches a pixel, in pixels.
    #[must_use]
    pub fn margin(&self) -> f64 {
        (self.radius() - 0.5).max(0.0)
    }

    /// Density per pixel area at an offset from the pixel's centre.
    #[must_use]
    pub fn eval(&self, offset: DVec2) -> f64 {
        match *self {
            Self::Box => {
                if offset.abs().max_element() <= 0.5 {
                    1.0
                } else {
                    0.0
                }
            }
            Self::Tent { radius } => {
                let side = (1.0 - offset.abs() / radius).max(DVec2::ZERO) / radius;
                side.x * side.y
            }
            Self::Gaussian { sigma, radius } => {
                let r2 = offset.length_squared();
                if r2 > radius * radius {
                    return 0.0;
                }
                let variance = sigma * sigma;
                (-0.5 * r2 / variance).exp() / (TAU * variance * gaussian_mass(sigma, radius))
            }
        }
    }

    /// The columns and rows of a crop in reach of a finite raster position.
    fn reached(&self, raster: DVec2, crop: &Crop) -> (Range<u32>, Range<u32>) {
        // pixels whose offset is in [-radius, radius): exactly one for the box
        let reach = |raster: f64, first: u32, end: u32| {
            let low = (raster - 0.5 - self.radius()).floor() + 1.0;
            let high = (raster - 0.5 + self.radius()).floor() + 1.0;
            // saturating casts: far positions give an empty range
            (low.max(0.0) as u32).max(first)..(high.max(0.0) as u32).min(end)
        };
        (
            reach(raster.x, crop.x0, crop.x1),
            reach(raster.y, crop.y0, crop.y1),
        )
    }

    /// Calls `each` with column, row and the filter of every pixel of a crop that has a finite
    /// raster position in its reach, row by row.
    #[inline]
    pub fn spread(&self, raster: DVec2, crop: &Crop, mut each: impl FnMut(u32, u32, f64)) {
        let (columns, rows) = self.reached(raster, crop);
        let offset = |position: f64, pixel: u32| position - (f64::from(pixel) + 0.5);
        let Self::Gaussian { sigma, radius } = *self else {
            for y in rows {
                for x in columns.clone() {
                    let offset = DVec2::new(offset(raster.x, x), offset(raster.y, y));
                    each(x, y, self.eval(offset));
                }
            }
            return;
        };
        // a product of two, but for the cut: exponentials of columns and rows, not of pixels
        let bell = |v: f64| (-0.5 * (v * v) / (sigma * sigma)).exp();
        let mut of_columns = [0.0; MOST_COLUMNS];
        for (x, of) in columns.clone().zip(&mut of_columns) {
            *of = bell(offset(raster.x, x));
        }
        let peak = 1.0 / (TAU * sigma * sigma * gaussian_mass(sigma, radius));
        for y in rows {
            let dy = offset(raster.y, y);
            let of_row = peak * bell(dy);
            for (i, x) in columns.clone().enumerate() {
                let dx = offset(raster.x, x);
                let weight = if dx * dx + dy * dy > radius * radius {
                    0.0
                } else {
                    of_row * of_columns.get(i).copied().unwrap_or_else(|| bell(dx))
                };
                each(x, y, weight);
            }
        }
    }

    /// Sum over the pixels of a crop: the share of a splat that lands there, and the density of
    /// samples when each pixel draws one. 1 well inside, less at the border, 0 out of reach.
    #[must_use]
    pub fn coverage(&self, raster: DVec2, crop: &Crop) -> f64 {
        let mut sum = 0.0;
        self.spread(raster, crop, |_, _, weight| sum += weight);
        sum
    }

    /// An offset drawn from the filter, `u` in [0,1)².
    #[must_use]
    pub fn sample(&self, u: DVec2) -> DVec2 {
        match *self {
            Self::Box => u - 0.5,
            Self::Tent { radius } => {
                let side = |u: f64| {
                    if u < 0.5 {
                        (2.0 * u).sqrt() - 1.0
                    } else {
                        1.0 - (2.0 - 2.0 * u).sqrt()
                    }
                };
                radius * DVec2::new(side(u.x), side(u.y))
            }
            Self::Gaussian { sigma, radius } => {
                // Box and Muller 1958, with the distance's distribution cut off
                let r = sigma * (-2.0 * (-u.x * gaussian_mass(sigma, radius)).ln_1p()).sqrt();
                r * DVec2::from_angle(TAU * u.y)
            }
        }
    }
}

/// Share of a round Gaussian within `radius`.
fn gaussian_mass(sigma: f64, radius: f64) -> f64 {
    -(-0.5 * (radius / sigma).powi(2)).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    const FILTERS: [Filter; 5] = [
        Filter::Box,
        Filter::Tent { radius: 1.0 },
        Filter::Tent { radius: 2.3 },
        Filter::Gaussian {
            sigma: 0.5,
            radius: 1.5,
        },
        Filter::Gaussian {
            sigma: 1.0,
            radius: 1.0,
        },
    ];

    /// Integral of the filter over a rectangle, midpoint rule.
    fn integral(filter: &Filter, low: DVec2, size: DVec2, cells: usize) -> f64 {
        let step = size / cells as f64;
        let mut sum = 0.0;
        for y in 0..cells {
            for x in 0..cells {
                sum += filter.eval(low + step * (DVec2::new(x as f64, y as f64) + 0.5));
            }
        }
        sum * step.x * step.y
    }

    #[test]
    fn integrates_to_one() {
        for filter in FILTERS {
            let r = filter.radius();
            let total = integral(&filter, DVec2::splat(-r), DVec2::splat(2.0 * r), 2000);
            // the cut-off circle of the wide Gaussian limits the midpoint rule
            assert!((total - 1.0).abs() < 1e-4, "{filter:?}: {total}");
        }
    }

    #[test]
    fn samples_follow_the_density() {
        const CELLS: usize = 10;
        let samples = 200_000_u64;
        for (k, filter) in FILTERS.into_iter().enumerate() {
            let r = filter.radius();
            let mut counts = [0.0_f64; CELLS * CELLS];
            for i in 0..samples {
                let u = |j| unit_f64(random_bits(17 + k as u64, 2 * i + j));
                let offset = filter.sample(DVec2::new(u(0), u(1)));
                let cell = (offset + r) / (2.0 * r) * CELLS as f64;
                assert!(filter.eval(offset) > 0.0);
                counts[cell.y as usize * CELLS + cell.x as usize] += 1.0;
            }
            let width = DVec2::splat(2.0 * r / CELLS as f64);
            let (mut statistic, mut used) = (0.0, 0);
            for (i, count) in counts.iter().enumerate() {
                let low = DVec2::new((i % CELLS) as f64, (i / CELLS) as f64) * width - r;
                let expected = integral(&filter, low, width, 200) * samples as f64;
                if expected >= 10.0 {
                    statistic += (count - expected).powi(2) / expected;
                    used += 1;
                }
            }
            let chi = ChiSquared::new(f64::from(used - 1)).unwrap();
            let p = 1.0 - chi.cdf(statistic);
            assert!(p > 1e-4, "{filter:?}: p = {p}, seed {}", 17 + k);
        }
    }

    #[test]
    fn splats_meet_the_density_of_every_pixel_in_reach() {
        let crop = Crop::whole(40, 40);
        let wide = Filter::Gaussian {
            sigma: 4.0,
            radius: 12.0,
        };
        for filter in FILTERS.into_iter().chain([wide]) {
            for i in 0..50 {
                let [x, y] = [0, 1].map(|j| unit_f64(random_bits(5, 2 * i + j)) * 44.0 - 2.0);
                let raster = DVec2::new(x, y);
                let mut found = vec![0.0; 1600];
                filter.spread(raster, &crop, |x, y, weight| {
                    found[(40 * y + x) as usize] += weight;
                });
                for (pixel, found) in (0_u32..).zip(found) {
                    let center = DVec2::new(f64::from(pixel % 40), f64::from(pixel / 40)) + 0.5;
                    let expected = filter.eval(raster - center);
                    assert!(
                        (found - expected).abs() <= 1e-14 * expected,
                        "{filter:?} {raster} {pixel}: {found} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn margin_is_the_reach_beyond_the_film() {
        assert_eq!(Filter::Box.margin(), 0.0);
        assert_eq!(Filter::Tent { radius: 2.0 }.margin(), 1.5);
        assert_eq!(Filter::Tent { radius: 0.25 }.margin(), 0.0);
    }
}
