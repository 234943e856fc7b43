//! Choosing one of many lights in constant time.
//!
//! Vose's alias method (1991): column i of n equally likely ones holds light i below a threshold and its alias above.

use super::LightId;

/// Share of the probability that is spread evenly over all lights.
const UNIFORM_SHARE: f64 = 0.1;

/// Chooses lights in proportion to their power (alias table), with a uniform share of 10 % so that no light is starved.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightSelection {
    columns: Vec<Column>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Column {
    /// Probability of the light with the column's index.
    probability: f64,
    /// Share of the column that is its own light's.
    threshold: f64,
    /// The light of the rest.
    alias: u32,
}

impl LightSelection {
    /// From the lights' powers (any common unit; non-finite or negative counts as 0). All equal if no power is left.
    #[must_use]
    pub fn new(powers: &[f64]) -> Self {
        let usable = |p: f64| if p.is_finite() && p > 0.0 { p } else { 0.0 };
        // dividing by the largest first keeps the sum finite
        let largest = powers.iter().copied().map(usable).fold(0.0, f64::max);
        let count = powers.len() as f64;
        let total: f64 = powers.iter().map(|&p| usable(p) / largest).sum();
        let mut columns: Vec<Column> = (0_u32..)
            .zip(powers)
            .map(|(alias, &p)| {
                let share = if largest > 0.0 {
                    usable(p) / largest / total
                } else {
                    1.0 / count
                };
                let probability = UNIFORM_SHARE / count + (1.0 - UNIFORM_SHARE) * share;
                Column {
                    probability,
                    threshold: probability * count,
                    alias,
                }
            })
            .collect();
        let (mut under, mut over): (Vec<usize>, Vec<usize>) =
            (0..columns.len()).partition(|&i| columns[i].threshold < 1.0);
        while let (Some(&small), Some(&large)) = (under.last(), over.last()) {
            under.pop();
            columns[small].alias = large as u32;
            columns[large].threshold -= 1.0 - columns[small].threshold;
            if columns[large].threshold < 1.0 {
                over.pop();
                under.push(large);
            }
        }
        // what rounding left over is full
        for i in under.into_iter().chain(over) {
            columns[i].threshold = 1.0;
        }
        Self { columns }
    }

    /// A light and its probability, from `u` in [0,1); also `u` made uniform again. `None` without lights.
    #[must_use]
    pub fn sample(&self, u: f64) -> Option<(LightId, f64, f64)> {
        let scaled = u * self.columns.len() as f64;
        let index = (scaled as usize).min(self.columns.len().checked_sub(1)?);
        let column = self.columns[index];
        let rest = scaled - index as f64;
        let (light, u) = if rest < column.threshold {
            (index as u32, rest / column.threshold)
        } else {
            (
                column.alias,
                (rest - column.threshold) / (1.0 - column.threshold),
            )
        };
        let probability = self.columns[light as usize].probability;
        Some((
            LightId(light),
            probability,
            u.clamp(0.0, 1.0_f64.next_down()),
        ))
    }

    /// Probability of a light; 0 for a light that is not in the table.
    #[must_use]
    pub fn probability(&self, light: LightId) -> f64 {
        self.columns
            .get(light.0 as usize)
            .map_or(0.0, |c| c.probability)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Probability of each light under the table itself, column by column.
    fn by_columns(selection: &LightSelection) -> Vec<f64> {
        let n = selection.columns.len();
        let mut p = vec![0.0; n];
        for (i, c) in selection.columns.iter().enumerate() {
            p[i] += c.threshold / n as f64;
            p[c.alias as usize] += (1.0 - c.threshold) / n as f64;
        }
        p
    }

    proptest! {
        #[test]
        fn table_holds_the_stated_probabilities(powers in prop::collection::vec(0.0..1e6_f64, 1..40)) {
            let selection = LightSelection::new(&powers);
            let total: f64 = powers.iter().sum();
            let mut sum = 0.0;
            for (i, p) in by_columns(&selection).into_iter().enumerate() {
                let stated = selection.probability(LightId(i as u32));
                prop_assert!((p - stated).abs() < 1e-12);
                let n = powers.len() as f64;
                let share = if total > 0.0 { powers[i] / total } else { 1.0 / n };
                prop_assert!((stated - (0.1 / n + 0.9 * share)).abs() < 1e-12);
                sum += stated;
            }
            prop_assert!((sum - 1.0).abs() < 1e-12);
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
