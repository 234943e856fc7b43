//! The bias of regularization without a reference: where odd passes use cones of ε/√2, the
//! squared-law bias of the even passes is twice the difference of the two halves of an image
//! (Richardson's extrapolation to ε = 0).

use crate::film::Film;

/// Side of the regions over which differences are averaged, in pixels.
const REGION: usize = 16;

/// Bias of the even passes' image, estimated from its halves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasEstimate {
    /// Root mean square over regions of 16 × 16 pixels, relative to the mean of the image, with the
    /// noise's share taken off.
    pub relative: f64,
    /// Value that noise alone would give.
    pub noise: f64,
}

/// Twice the difference of the halves of channel Y, per pixel. `None` while a half has no passes.
#[must_use]
pub fn bias_image(image: &Film, even: u64, odd: u64) -> Option<Vec<f64>> {
    let mut bias = image.half_difference(1, even, odd)?;
    bias.iter_mut().for_each(|d| *d *= 2.0);
    Some(bias)
}

/// The estimate for a whole image.
#[must_use]
pub fn bias_estimate(image: &Film, even: u64, odd: u64) -> Option<BiasEstimate> {
    let bias = bias_image(image, even, odd)?;
    let values = image.image(even + odd);
    let mean = values.iter().skip(1).step_by(3).sum::<f64>() / bias.len() as f64;
    if mean <= 0.0 {
        return None;
    }
    let width = image.crop().width() as usize;
    let mut regions = std::collections::BTreeMap::new();
    for (i, value) in bias.iter().enumerate() {
        let region = (i / width / REGION, i % width / REGION);
        let (sum, squares, count) = regions.entry(region).or_insert((0.0, 0.0, 0.0));
        *sum += value;
        *squares += value * value;
        *count += 1.0;
    }
    // of regions of independent pixels, the mean's variance is the sum of squares over the square
    // of the count
    let (mut found, mut noise) = (0.0, 0.0);
    for (sum, squares, count) in regions.values() {
        let own = squares / (count * count);
        found += (sum / count) * (sum / count) - own;
        noise += own;
    }
    let n = regions.len() as f64;
    Some(BiasEstimate {
        relative: (found / n).max(0.0).sqrt() / mean,
        noise: (noise / n).sqrt() / mean,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Crop, Filter};
    use crate::math::hash::{random_bits, unit_f64};

    #[test]
    fn a_planted_bias_is_found_and_noise_is_not() {
        let crop = Crop::whole(64, 64);
        let estimate = |planted: f64| {
            let film = Film::new(crop, Filter::Box, 3);
            for i in 0..64 * 64 {
                let (x, y) = (i % 64, i / 64);
                for half in 0..2 {
                    let noise = unit_f64(random_bits(7, u64::from(2 * i) + half)) - 0.5;
                    // a bias b at ε is b/2 at ε/√2
                    let bias = if x < 32 { planted } else { -planted };
                    let value = 1.0 + noise + bias * if half == 0 { 1.0 } else { 0.5 };
                    film.add_pixel(x, y, half as usize, &[value; 3]);
                }
            }
            bias_estimate(&film, 1, 1).unwrap()
        };
        // 256 pixels of uniform noise: 2 √(2/12/256) = 0.051 per region
        let none = estimate(0.0);
        assert!((none.noise - 0.051).abs() < 0.005, "{none:?}");
        assert!(none.relative < 0.04, "{none:?}");
        let some = estimate(0.2);
        assert!((some.relative - 0.2).abs() < 0.04, "{some:?}");
    }
}
