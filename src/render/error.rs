//! The estimated error of a render: what the halves of its passes disagree on, without the few
//! pixels that a lucky path made far too bright.
//!
//! Squared noise has heavy tails: in most scenes a handful of pixels holds more of it than all
//! others together, so that its plain mean jumps with every such path and tells nothing of the
//! image as a whole, nor of what more passes would do. As in [`crate::math::image_error`], the
//! worst 0.1 % of the pixels are left out; what they add is told beside it.

use crate::film::Film;
use crate::math::image_error::TRIMMED_SHARE;

/// Error of an image, relative to the mean of Y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorEstimate {
    /// Root mean square over the pixels of the standard error of Y, without the worst 0.1 % of the
    /// pixels, over the mean of Y.
    pub relative: f64,
    /// The same with all pixels.
    pub of_all_pixels: f64,
    /// (Σv)²/Σv² of the squares v behind `relative`: how many pixels carry it. Its square is known
    /// to about √(2/(3n)).
    pub effective_pixels: f64,
}

/// The error of the mean of `even` and `odd` passes. `None` before both halves have a pass or while
/// the image is black.
#[must_use]
pub fn error_estimate(image: &Film, even: u64, odd: u64) -> Option<ErrorEstimate> {
    let noise = image.noise(1, even, odd)?;
    let values = image.image(even + odd);
    let count = noise.len() as f64;
    let mean = values.iter().skip(1).step_by(image.channels()).sum::<f64>() / count;
    if mean <= 0.0 {
        return None;
    }
    let mut squares: Vec<f64> = noise.iter().map(|v| v * v).collect();
    let all = squares.iter().sum::<f64>();
    let kept = squares.len() - (TRIMMED_SHARE * count) as usize;
    if kept < squares.len() {
        squares.select_nth_unstable_by(kept, f64::total_cmp);
    }
    let squares = &squares[..kept];
    let sum = squares.iter().sum::<f64>();
    Some(ErrorEstimate {
        relative: (sum / kept as f64).sqrt() / mean,
        of_all_pixels: (all / count).sqrt() / mean,
        effective_pixels: if sum > 0.0 {
            sum * sum / squares.iter().map(|v| v * v).sum::<f64>()
        } else {
            count
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Crop, Filter};
    use crate::math::hash::{random_bits, unit_f64};

    /// Two passes of uniform noise of variance 1/12 about 2, with an excess at one pixel.
    fn film(excess: f64) -> Film {
        let film = Film::new(Crop::whole(60, 50), Filter::Box, 3);
        for i in 0..60 * 50 {
            for half in 0..2 {
                let noise = unit_f64(random_bits(5, u64::from(2 * i) + half)) - 0.5;
                let lucky = if i == 1234 && half == 0 { excess } else { 0.0 };
                film.add_pixel(i % 60, i / 60, half as usize, &[2.0 + noise + lucky; 3]);
            }
        }
        film
    }

    #[test]
    fn one_lucky_path_does_not_count() {
        let none = error_estimate(&film(0.0), 1, 1).expect("both halves");
        // 3000 squares: their mean is known to 2.3 %, its root to half of it; three pixels of large
        // ones are left out
        let expected = (1.0_f64 / 24.0).sqrt() / 2.0;
        assert!((none.relative / expected - 1.0).abs() < 0.05, "{none:?}");
        assert!(none.relative < none.of_all_pixels);
        // squares of a difference of two uniform numbers: (1/6)²/(1/15) of them count
        assert!(
            (none.effective_pixels / 1250.0 - 1.0).abs() < 0.1,
            "{none:?}"
        );
        let one = error_estimate(&film(1000.0), 1, 1).expect("both halves");
        // its own pixel brightens the mean by a sixth
        assert!((one.relative * 2.1667 / (none.relative * 2.0) - 1.0).abs() < 0.01);
        assert!(one.of_all_pixels > 20.0 * one.relative, "{one:?}");
        assert_eq!(error_estimate(&film(0.0), 2, 0), None);
    }
}
