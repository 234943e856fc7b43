//! Tries: the probability with which each kind of chain is solved for, by where it is solved from.
//!
//! Invariant: a function of the kind and of the labels of the path, never of its throughput or its
//! place, so that all strategies of a path agree how often its bridges are tried.

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

/// Probabilities by origin and kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Tries {
    kinds: usize,
    /// Origin by origin.
    shares: Vec<f32>,
    /// Kinds that an origin tries at all.
    tried: Vec<Vec<u32>>,
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
        let tried = |origin: usize| {
            let of = &shares[origin * kinds..(origin + 1) * kinds];
            (0u32..)
                .zip(of)
                .filter(|t| *t.1 > 0.0)
                .map(|t| t.0)
                .collect()
        };
        Ok(Self {
            kinds,
            tried: (0..Origin::COUNT).map(tried).collect(),
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

    /// Kinds that are tried at all, by index.
    #[must_use]
    pub fn tried(&self, origin: Origin) -> &[u32] {
        &self.tried[origin.number()]
    }

    /// Whether a kind is tried by the vertex that drew `u` in [0, 1). One number serves all kinds:
    /// each takes it shifted by its own multiple of the golden ratio.
    #[must_use]
    pub fn is_tried(&self, origin: Origin, kind: usize, u: f64) -> bool {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        (u + GOLDEN * kind as f64).fract() < self.share(origin, kind)
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
        let shares: Vec<f32> = (0..Origin::COUNT * 3)
            .map(|i| [1.0, 0.125, 0.0][i % 3])
            .collect();
        let tries = Tries::new(3, shares).expect("three for each");
        assert_eq!(Tries::new(3, vec![1.0]), Err(27));
        assert_eq!(Tries::new(1, vec![2.0; 9]), Err(9));
        for origin in Origin::all() {
            assert_eq!(tries.tried(origin), [0, 1]);
            let count = |kind| {
                (0..1000)
                    .filter(|i| tries.is_tried(origin, kind, f64::from(*i) * 1e-3))
                    .count()
            };
            assert_eq!([0, 1, 2].map(count), [1000, 125, 0]);
        }
    }
}
