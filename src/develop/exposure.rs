//! Exposure: the power of two by which a picture is brightened.

/// Share of the pixels that are no darker than the middle tone.
const MIDDLE_PERCENTILE: f64 = 0.5;
/// Luminance of the middle tone: the gray of 18 %.
const MIDDLE: f64 = 0.18;
/// Percentile that is still to be told from white, and its luminance.
const BRIGHT_PERCENTILE: f64 = 0.98;
const BRIGHT: f64 = 1.0;

/// How bright a picture is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// By percentiles of the luminance of all pixels that are not black: the median becomes 0.18,
    /// but the percentile 98 at most 1.
    Auto,
    /// The largest luminance becomes 1.
    Peak,
    /// A number of stops: values times 2 to its power.
    Stops(f64),
}

impl Exposure {
    /// The stops for a picture of these luminances; 0 for a black one.
    #[must_use]
    pub fn stops(self, luminances: impl Iterator<Item = f64>) -> f64 {
        let gain = match self {
            Self::Stops(stops) => return stops,
            Self::Peak => luminances.max_by(f64::total_cmp).map(|y| 1.0 / y),
            Self::Auto => {
                let mut luminance: Vec<f64> = luminances.filter(|&y| y > 0.0).collect();
                luminance.sort_unstable_by(f64::total_cmp);
                let percentile = |share: f64| {
                    let last = luminance.len().checked_sub(1)?;
                    luminance
                        .get((share * last as f64).round() as usize)
                        .copied()
                };
                percentile(MIDDLE_PERCENTILE)
                    .zip(percentile(BRIGHT_PERCENTILE))
                    .map(|(middle, bright)| (MIDDLE / middle).min(BRIGHT / bright))
            }
        };
        gain.filter(|g| g.is_finite() && *g > 0.0)
            .map_or(0.0, f64::log2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_middle_gray_unless_much_would_be_white() {
        let even = Exposure::Auto.stops([0.1, 0.2, 0.3].into_iter());
        assert!((0.2 * even.exp2() - 0.18).abs() < 1e-12);
        // a spectrum on a dark floor: a tenth of the picture, 1000 times as bright
        let mut floor = vec![1e-3; 90];
        floor.extend([1.0; 10]);
        let stops = Exposure::Auto.stops(floor.iter().copied());
        assert!(stops.abs() < 1e-12, "{stops}");
        // black pixels around do not count
        floor.extend([0.0; 900]);
        assert!((Exposure::Auto.stops(floor.iter().copied()) - stops).abs() < 1e-12);
    }

    #[test]
    fn the_peak_is_white_and_black_stays_black() {
        assert_eq!(Exposure::Peak.stops([0.0, 0.25].into_iter()), 2.0);
        for exposure in [Exposure::Auto, Exposure::Peak, Exposure::Stops(0.0)] {
            assert_eq!(exposure.stops([0.0].into_iter()), 0.0);
            assert_eq!(exposure.stops(std::iter::empty()), 0.0);
        }
    }
}
