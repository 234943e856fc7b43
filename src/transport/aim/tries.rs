//! Tries: the probability with which each kind of chain is solved for, by where it is solved from.
//!
//! Invariant: a function of the kind and of the labels of the path, never of its throughput or its
//! place, so that all strategies of a path agree how often its bridges are tried.

use std::collections::BTreeMap;

/// Vertices that aim alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Starts on lights, at the sensor.
    Start,
    /// Non-specular vertices of camera sub-paths at lights, of light sub-paths at the sensor.
    Vertex {
        /// Of a light sub-path.
        at_sensor: bool,
        /// The first non-specular one of its sub-path.
        first: bool,
        /// Reached over a specular one.
        after_specular: bool,
    },
}

impl Origin {
    /// Number of origins.
    pub const COUNT: usize = 9;

    /// All of them, in the order of their numbers.
    pub fn all() -> impl Iterator<Item = Self> {
        let vertex = |bits: usize| Self::Vertex {
            at_sensor: bits & 1 != 0,
            first: bits & 2 != 0,
            after_specular: bits & 4 != 0,
        };
        std::iter::once(Self::Start).chain((0..Self::COUNT - 1).map(vertex))
    }

    /// Index among all.
    #[must_use]
    pub fn number(self) -> usize {
        match self {
            Self::Start => 0,
            Self::Vertex {
                at_sensor,
                first,
                after_specular,
            } => {
                1 + usize::from(at_sensor)
                    + 2 * usize::from(first)
                    + 4 * usize::from(after_specular)
            }
        }
    }

    /// Whether nothing else than a bridge makes such paths without a cone: what lies beyond is lit
    /// and seen through specular vertices.
    #[must_use]
    pub fn is_needed(self) -> bool {
        matches!(
            self,
            Self::Vertex {
                after_specular: true,
                ..
            }
        )
    }
}

/// Kinds that an origin tries with one probability.
#[derive(Clone, Debug, PartialEq)]
struct Group {
    share: f64,
    kinds: Vec<u32>,
}

impl Group {
    /// The kinds that are tried by who drew `u` in [0, 1): evenly spaced, so that each is tried
    /// with the probability of all, and as many as they are on average.
    fn drawn(&self, u: f64) -> impl Iterator<Item = usize> {
        let at = move |i: usize| ((i as f64 + 1.0 - u) / self.share).ceil() as usize;
        (0..)
            .map(move |i| at(i).max(1) - 1)
            .take_while(|&at| at < self.kinds.len())
            .map(|at| self.kinds[at] as usize)
    }
}

/// Probabilities by origin and kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Tries {
    kinds: usize,
    /// Origin by origin.
    shares: Vec<f32>,
    /// Groups of kinds that an origin tries at all.
    tried: Vec<Vec<Group>>,
}

impl Tries {
    /// Of `kinds` kinds, from their shares in [0, 1] origin by origin.
    ///
    /// # Errors
    /// The number of shares that is wanted, where there are others or one is not in its range.
    pub fn new(kinds: usize, shares: Vec<f32>) -> Result<Self, usize> {
        let wanted = Origin::COUNT * kinds;
        if shares.len() != wanted || !shares.iter().all(|s| (0.0..=1.0).contains(s)) {
            return Err(wanted);
        }
        let groups = |origin: usize| {
            let mut groups: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
            for (kind, share) in (0u32..).zip(&shares[origin * kinds..(origin + 1) * kinds]) {
                if *share > 0.0 {
                    groups.entry(share.to_bits()).or_default().push(kind);
                }
            }
            let group = |(share, kinds)| Group {
                share: f64::from(f32::from_bits(share)),
                kinds,
            };
            groups.into_iter().map(group).collect()
        };
        Ok(Self {
            kinds,
            tried: (0..Origin::COUNT).map(groups).collect(),
            shares,
        })
    }

    /// Number of kinds.
    #[must_use]
    pub fn kinds(&self) -> usize {
        self.kinds
    }

    /// All probabilities, origin by origin.
    #[must_use]
    pub fn shares(&self) -> &[f32] {
        &self.shares
    }

    /// Probability of a kind.
    #[must_use]
    pub fn share(&self, origin: Origin, kind: usize) -> f64 {
        f64::from(self.shares[origin.number() * self.kinds + kind])
    }

    /// Whether an origin tries any.
    #[must_use]
    pub fn has_any(&self, origin: Origin) -> bool {
        !self.tried[origin.number()].is_empty()
    }

    /// Kinds, by index, that are tried by the vertex that drew `u` in [0, 1). One number serves
    /// all: kinds of one probability are taken at even steps from where it says, each probability
    /// from `u` shifted by its own multiple of the golden ratio.
    pub fn drawn(&self, origin: Origin, u: f64) -> impl Iterator<Item = usize> {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let groups = self.tried[origin.number()].iter().enumerate();
        groups.flat_map(move |(i, group)| group.drawn((u + GOLDEN * i as f64).fract()))
    }
}

#[cfg(test)]
mod tests {
    use super::{Origin, Tries};

    #[test]
    fn origins_are_numbered_in_order() {
        let numbers: Vec<usize> = Origin::all().map(Origin::number).collect();
        assert_eq!(numbers, (0..Origin::COUNT).collect::<Vec<_>>());
        assert_eq!(Origin::all().filter(|o| o.is_needed()).count(), 4);
    }

    #[test]
    fn kinds_are_tried_as_often_as_their_shares_say() {
        let shares: Vec<f32> = (0..Origin::COUNT * 6)
            .map(|i| [1.0, 0.125, 0.0, 0.125, 0.3, 0.125][i % 6])
            .collect();
        let tries = Tries::new(6, shares).expect("six for each");
        assert_eq!(Tries::new(3, vec![1.0]), Err(27));
        assert_eq!(Tries::new(1, vec![2.0; 9]), Err(9));
        for origin in Origin::all() {
            let mut counts = [0; 6];
            for i in 0..8000 {
                let mut drawn: Vec<usize> = tries.drawn(origin, f64::from(i) / 8000.0).collect();
                drawn.iter().for_each(|&kind| counts[kind] += 1);
                drawn.dedup();
                assert!(drawn.len() <= 5);
            }
            assert_eq!(counts, [8000, 1000, 0, 1000, 2400, 1000]);
        }
    }

    #[test]
    fn nothing_is_drawn_where_nothing_is_tried() {
        let tries = Tries::new(2, vec![0.0; 18]).expect("two for each");
        for origin in Origin::all() {
            assert!(!tries.has_any(origin));
            assert_eq!(tries.drawn(origin, 0.5).count(), 0);
        }
    }
}
