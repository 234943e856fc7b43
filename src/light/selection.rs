//! Choosing one of many lights in constant time.

use super::LightId;
use crate::math::distribution::AliasTable;

/// Share of the probability that is spread evenly over all lights.
const UNIFORM_SHARE: f64 = 0.1;

/// Chooses lights in proportion to their power (alias table), with a uniform share of 10 % so that
/// no light is starved.
#[derive(Clone, Debug, Default)]
pub struct LightSelection {
    table: Option<AliasTable>,
    count: usize,
}

impl LightSelection {
    /// From the lights' powers (any common unit; non-finite or negative counts as 0). All equal if
    /// no power is left.
    #[must_use]
    pub fn new(powers: &[f64]) -> Self {
        let usable = |p: f64| if p.is_finite() && p > 0.0 { p } else { 0.0 };
        // dividing by the largest first keeps the sum finite
        let largest = powers.iter().copied().map(usable).fold(0.0, f64::max);
        let count = powers.len();
        let relative = |p: f64| {
            if largest > 0.0 {
                usable(p) / largest
            } else {
                1.0
            }
        };
        let total: f64 = powers.iter().copied().map(relative).sum();
        let probabilities: Vec<f64> = powers
            .iter()
            .map(|&p| UNIFORM_SHARE / count as f64 + (1.0 - UNIFORM_SHARE) * relative(p) / total)
            .collect();
        Self {
            table: AliasTable::new(&probabilities),
            count,
        }
    }

    /// A light and its probability, from `u` in [0,1); also `u` made uniform again. `None` without
    /// lights.
    #[must_use]
    pub fn sample(&self, u: f64) -> Option<(LightId, f64, f64)> {
        let sample = self.table.as_ref()?.sample(u);
        Some((LightId(sample.index as u32), sample.pmf, sample.u))
    }

    /// Probability of a light; 0 for a light that is not in the table.
    #[must_use]
    pub fn probability(&self, light: LightId) -> f64 {
        let index = light.0 as usize;
        self.table
            .as_ref()
            .filter(|_| index < self.count)
            .map_or(0.0, |table| table.pmf(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn probabilities_are_power_and_a_uniform_share(powers in prop::collection::vec(0.0..1e6_f64, 1..40)) {
            let selection = LightSelection::new(&powers);
            let total: f64 = powers.iter().sum();
            let n = powers.len() as f64;
            for (i, power) in powers.iter().enumerate() {
                let stated = selection.probability(LightId(i as u32));
                let share = if total > 0.0 { power / total } else { 1.0 / n };
                prop_assert!((stated - (0.1 / n + 0.9 * share)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn remapped_number_is_uniform_for_every_light() {
        let selection = LightSelection::new(&[1.0, 5.0, 0.2, 0.0, 2.0]);
        let mut counts = [[0_u32; 10]; 5];
        let n = 1_000_000;
        for i in 0..n {
            let (light, _, u) = selection
                .sample((f64::from(i) + 0.5) / f64::from(n))
                .unwrap();
            counts[light.0 as usize][(u * 10.0) as usize] += 1;
        }
        for (light, cells) in counts.iter().enumerate() {
            let expected = selection.probability(LightId(light as u32)) * f64::from(n) / 10.0;
            for &c in cells {
                // a regular grid of u misses each cell by at most one per column it lies in
                assert!(
                    (f64::from(c) - expected).abs() <= 10.0,
                    "light {light}: {c} / {expected}"
                );
            }
        }
    }

    #[test]
    fn odd_powers_are_harmless() {
        assert!(LightSelection::new(&[]).sample(0.5).is_none());
        assert_eq!(LightSelection::default().probability(LightId(0)), 0.0);
        let dark = LightSelection::new(&[0.0, f64::NAN, -1.0, f64::INFINITY]);
        for i in 0..4 {
            assert_eq!(dark.probability(LightId(i)), 0.25);
        }
        let huge = LightSelection::new(&[1e308, 1e308, 1e308]);
        assert!((huge.probability(LightId(2)) - 1.0 / 3.0).abs() < 1e-15);
        let (_, _, u) = huge.sample(1.0_f64.next_down()).unwrap();
        assert!(u < 1.0);
    }
}
