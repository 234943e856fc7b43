//! How far an image is from a reference: the measures of the field.
//!
//! relMSE as in Rousselle et al., Adaptive Sampling and Reconstruction using Greedy Error
//! Minimization (2011), section 6; trimmed as is usual for images with fireflies.

/// Added to the squared reference, so that black pixels do not divide by zero.
const REL_MSE_OFFSET: f64 = 0.01;
/// Added before the logarithm.
const LOG_OFFSET: f64 = 0.01;
/// Share of the pixels, the worst, left out of the trimmed relMSE.
pub const TRIMMED_SHARE: f64 = 0.001;
/// A firefly exceeds the reference at its pixel by more than this many times the largest reference
/// value around it (or the mean of the reference, where that is larger).
const FIREFLY_FACTOR: f64 = 5.0;
/// Pixels to each side that count as around.
const NEIGHBORHOOD: usize = 1;

/// Errors of one channel of an image against a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageError {
    /// Mean of (I − R)²/(R² + 0.01).
    pub rel_mse: f64,
    /// The same without the worst 0.1 % of the pixels.
    pub trimmed_rel_mse: f64,
    /// √ mean (I − R)².
    pub rmse: f64,
    /// √ mean (ln(I + 0.01) − ln(R + 0.01))², negative values counted as 0.
    pub log_rmse: f64,
    /// Mean of I / mean of R; not a number where R is black.
    pub mean_ratio: f64,
    /// Pixels where I − R > 5 max(R over 3 × 3 pixels, mean of R).
    pub fireflies: u64,
}

/// Compares two images of `width` columns, row by row, of the same length > 0.
#[must_use]
pub fn image_error(image: &[f64], reference: &[f64], width: usize) -> ImageError {
    debug_assert!(
        image.len() == reference.len() && !image.is_empty() && image.len().is_multiple_of(width)
    );
    let pairs = || image.iter().copied().zip(reference.iter().copied());
    let count = image.len() as f64;
    let mut relative: Vec<f64> = pairs()
        .map(|(i, r)| (i - r).powi(2) / (r * r + REL_MSE_OFFSET))
        .collect();
    let rel_mse = relative.iter().sum::<f64>() / count;
    // images too small for one pixel to be 0.1 % lose none
    let kept = relative.len() - (TRIMMED_SHARE * count) as usize;
    relative.sort_by(f64::total_cmp);
    let log = |v: f64| (v.max(0.0) + LOG_OFFSET).ln();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    ImageError {
        rel_mse,
        trimmed_rel_mse: relative[..kept].iter().sum::<f64>() / kept as f64,
        rmse: (pairs().map(|(i, r)| (i - r).powi(2)).sum::<f64>() / count).sqrt(),
        log_rmse: (pairs().map(|(i, r)| (log(i) - log(r)).powi(2)).sum::<f64>() / count).sqrt(),
        mean_ratio: mean(image) / mean(reference),
        fireflies: fireflies(image, reference, width, mean(reference)),
    }
}

/// Mean of v²/(R² + 0.01): of differences their relMSE, of standard errors the relative variance. 0
/// without values.
#[must_use]
pub fn mean_relative_square(values: &[f64], reference: &[f64]) -> f64 {
    let squares = values
        .iter()
        .zip(reference)
        .map(|(v, r)| v * v / (r * r + REL_MSE_OFFSET));
    squares.sum::<f64>() / values.len().max(1) as f64
}

fn fireflies(image: &[f64], reference: &[f64], width: usize, mean: f64) -> u64 {
    let height = reference.len() / width;
    let around =
        |at: usize, end: usize| at.saturating_sub(NEIGHBORHOOD)..(at + NEIGHBORHOOD + 1).min(end);
    let is_firefly = |index: usize| {
        let excess = image[index] - reference[index];
        // most pixels are decided without looking around
        excess > FIREFLY_FACTOR * mean && {
            let (x, y) = (index % width, index / width);
            let rows =
                around(y, height).flat_map(|row| &reference[row * width..][around(x, width)]);
            excess > FIREFLY_FACTOR * rows.copied().fold(mean, f64::max)
        }
    };
    (0..image.len()).filter(|&i| is_firefly(i)).count() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_images_have_no_error() {
        let image = [0.0, 1.0, 2.0, 3.0];
        let error = image_error(&image, &image, 2);
        let none = ImageError {
            rel_mse: 0.0,
            trimmed_rel_mse: 0.0,
            rmse: 0.0,
            log_rmse: 0.0,
            mean_ratio: 1.0,
            fireflies: 0,
        };
        assert_eq!(error, none);
    }

    #[test]
    fn values_by_hand() {
        // (0.5² / 1.01 + 1² / 4.01) / 2
        let error = image_error(&[1.5, 1.0], &[1.0, 2.0], 2);
        assert!((error.rel_mse - (0.25 / 1.01 + 1.0 / 4.01) / 2.0).abs() < 1e-15);
        assert!((error.rmse - (1.25_f64 / 2.0).sqrt()).abs() < 1e-15);
        let logs = (1.51_f64 / 1.01).ln().powi(2) + (2.01_f64 / 1.01).ln().powi(2);
        assert!((error.log_rmse - (logs / 2.0).sqrt()).abs() < 1e-15);
        assert!((error.mean_ratio - 2.5 / 3.0).abs() < 1e-15);
        let differences = mean_relative_square(&[0.5, -1.0], &[1.0, 2.0]);
        assert!((differences - error.rel_mse).abs() < 1e-15);
    }

    #[test]
    fn one_firefly_is_found_and_trimmed() {
        let reference = vec![1.0; 2000];
        let mut image = reference.clone();
        image[777] = 7.0;
        image[778] = 5.9;
        let error = image_error(&image, &reference, 50);
        assert_eq!(error.fireflies, 1);
        assert_eq!(error.trimmed_rel_mse, 0.0);
        assert!((error.rel_mse - (36.0 + 4.9 * 4.9) / 1.01 / 2000.0).abs() < 1e-12);
    }

    #[test]
    fn a_bright_neighbor_excuses() {
        let mut reference = vec![0.1; 100];
        reference[55] = 100.0;
        let mut image = reference.clone();
        for index in [54, 44, 66, 53] {
            image[index] = 90.0;
        }
        assert_eq!(image_error(&image, &reference, 10).fireflies, 1);
    }
}
