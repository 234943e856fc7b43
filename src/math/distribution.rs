//! Discrete distributions sampled in constant time.
//!
//! Alias tables after Walker (1977), built in linear time by Vose's method (1991). The random
//! number that chose an entry is stretched back to [0, 1), so that one number serves the choice and
//! what follows.

/// A choice from an [`AliasTable`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AliasSample {
    /// The entry chosen.
    pub index: usize,
    /// Uniform in [0, 1), independent of the choice.
    pub u: f64,
    /// Probability of the entry.
    pub pmf: f64,
}

#[derive(Clone, Copy, Debug)]
struct Bin {
    /// Share of the bin that stays with its own entry.
    keep: f64,
    /// The entry that takes the rest.
    alias: u32,
}

/// Chooses among entries in proportion to their weights, in constant time.
#[derive(Clone, Debug)]
pub struct AliasTable {
    bins: Vec<Bin>,
    pmf: Vec<f64>,
    total: f64,
}

impl AliasTable {
    /// A table over `weights`; `None` if one is negative or not finite, if all are zero, or if
    /// there are none (or more than `u32` can number).
    #[must_use]
    pub fn new(weights: &[f64]) -> Option<Self> {
        let n = weights.len();
        u32::try_from(n).ok()?;
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) || weights.iter().any(|&w| w < 0.0) {
            return None;
        }
        let pmf: Vec<f64> = weights.iter().map(|w| w / total).collect();
        let mut bins: Vec<Bin> = (0u32..)
            .zip(&pmf)
            .map(|(i, p)| Bin {
                keep: p * n as f64,
                alias: i,
            })
            .collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) =
            (0..n).partition(|&i| bins[i].keep < 1.0);
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            bins[s].alias = l as u32;
            bins[l].keep -= 1.0 - bins[s].keep;
            if bins[l].keep < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        // What rounding left over is full, unless it can never be chosen.
        let heaviest = (0..n).max_by(|&a, &b| pmf[a].total_cmp(&pmf[b]))?;
        for i in small.into_iter().chain(large) {
            if pmf[i] > 0.0 {
                bins[i].keep = 1.0;
            } else {
                bins[i].alias = heaviest as u32;
            }
        }
        Some(Self { bins, pmf, total })
    }

    /// Memory held, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.bins.as_slice()) + size_of_val(self.pmf.as_slice())
    }

    /// Sum of the weights.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Probability of entry `index`.
    #[must_use]
    pub fn pmf(&self, index: usize) -> f64 {
        self.pmf[index]
    }

    /// Chooses by `u` in [0, 1).
    #[must_use]
    #[inline]
    pub fn sample(&self, u: f64) -> AliasSample {
        if self.bins.len() == 1 {
            return AliasSample {
                index: 0,
                u: u.clamp(0.0, ONE_MINUS),
                pmf: self.pmf[0],
            };
        }
        let scaled = u * self.bins.len() as f64;
        let own = (scaled as usize).min(self.bins.len() - 1);
        let rest = (scaled - own as f64).clamp(0.0, ONE_MINUS);
        let bin = self.bins[own];
        let (index, v) = if rest < bin.keep {
            (own, rest / bin.keep)
        } else {
            (bin.alias as usize, (rest - bin.keep) / (1.0 - bin.keep))
        };
        AliasSample {
            index,
            u: v.min(ONE_MINUS),
            pmf: self.pmf[index],
        }
    }
}

/// The largest f64 below 1.
const ONE_MINUS: f64 = 1.0 - f64::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_what_is_no_distribution() {
        for bad in [
            &[][..],
            &[0.0, 0.0],
            &[1.0, -1.0],
            &[1.0, f64::NAN],
            &[f64::INFINITY],
        ] {
            assert!(AliasTable::new(bad).is_none(), "{bad:?}");
        }
    }

    #[test]
    fn an_even_grid_of_numbers_reproduces_the_weights_and_stays_even() {
        let weights = [3.0, 0.0, 1.0, 0.25, 7.5, 1e-3, 0.0, 2.0];
        let table = AliasTable::new(&weights).expect("valid weights");
        let n = 200_000;
        let mut count = [0usize; 8];
        let mut sum = [0.0; 8];
        for i in 0..n {
            let s = table.sample((f64::from(i) + 0.5) / f64::from(n));
            assert!((0.0..1.0).contains(&s.u) && s.pmf == table.pmf(s.index));
            count[s.index] += 1;
            sum[s.index] += s.u;
        }
        for i in 0..8 {
            let p = weights[i] / table.total();
            // At most two grid points are misplaced at each end of the (at most 8) pieces of an
            // entry.
            assert!(
                (count[i] as f64 - p * f64::from(n)).abs() <= 16.0,
                "{i}: {}",
                count[i]
            );
            if count[i] > 1000 {
                assert!((sum[i] / count[i] as f64 - 0.5).abs() < 1e-2);
            }
        }
        assert_eq!((count[1], count[6]), (0, 0));
    }

    #[test]
    fn the_ends_of_the_range_choose_possible_entries() {
        for weights in [&[0.0, 1.0][..], &[1.0, 0.0], &[0.0, 1.0, 0.0], &[1.0]] {
            let table = AliasTable::new(weights).expect("valid weights");
            for u in [0.0, 0.5, ONE_MINUS] {
                assert!(table.sample(u).pmf > 0.0);
            }
        }
    }
}
