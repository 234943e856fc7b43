//! Homogeneous media, and the stack of nested solids a sub-path is inside of.

use crate::geometry::InstanceId;
use crate::spectrum::{Curve, Ior, MAX_LANES, SampledSpectrum, SampledWavelengths};

/// Index of a medium in the scene. 0 is the ambient medium.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MediumId(pub u32);

impl MediumId {
    /// The medium of everything unless a solid says otherwise (air, n = 1, unless the scene names
    /// another).
    pub const AMBIENT: Self = Self(0);
}

/// A clear or absorbing medium.
#[derive(Clone, Debug)]
pub struct Medium {
    /// Name, for messages.
    pub name: String,
    /// Refractive index.
    pub ior: Ior,
    /// Absorption coefficient in 1/m beyond what the index's k gives (0 for none).
    pub absorption: Option<Curve>,
    /// Whether the k table of `ior` absorbs too (Beer-Lambert, α = 4πk/λ).
    pub use_k: bool,
}

/// A medium at the wavelengths of a path.
#[derive(Clone, Copy, Debug)]
pub struct MediumLanes {
    /// Refractive index per lane.
    pub eta: [f64; MAX_LANES],
    /// Absorption coefficient per lane in 1/m; `None` for a clear medium.
    pub absorption: Option<[f64; MAX_LANES]>,
    /// The index varies with wavelength.
    pub dispersive: bool,
}

impl Medium {
    /// Index and absorption at the wavelengths of a path.
    #[must_use]
    pub fn sample(&self, wavelengths: &SampledWavelengths) -> MediumLanes {
        let n = wavelengths.count();
        let eta = std::array::from_fn(|j| {
            if j < n {
                self.ior.n(wavelengths.lambda_nm(j))
            } else {
                1.0
            }
        });
        let uses_k = self.use_k && self.ior.is_absorbing();
        let absorption = (uses_k || self.absorption.is_some()).then(|| {
            std::array::from_fn(|j| {
                if j >= n {
                    return 0.0;
                }
                let nm = wavelengths.lambda_nm(j);
                let from_k = if uses_k {
                    4.0 * std::f64::consts::PI * self.ior.k(nm) / (nm * 1e-9)
                } else {
                    0.0
                };
                from_k + self.absorption.as_ref().map_or(0.0, |a| a.eval(nm))
            })
        });
        MediumLanes {
            eta,
            absorption,
            dispersive: self.ior.is_dispersive(),
        }
    }
}

impl MediumLanes {
    /// Beer-Lambert transmittance over `distance` (m); 1 over an infinite one, for light from
    /// infinity is given as it arrives.
    #[must_use]
    pub fn transmittance(&self, distance: f64) -> SampledSpectrum {
        match &self.absorption {
            Some(a) if distance.is_finite() => SampledSpectrum::from_fn(|j| {
                // also in the lanes that are not in use
                if a[j] == 0.0 {
                    1.0
                } else {
                    (-a[j] * distance).exp() as f32
                }
            }),
            _ => SampledSpectrum::ONE,
        }
    }
}

/// Precedence of a solid where solids overlap: the larger wins; ties are broken by the instance, so
/// that the order is total and does not depend on the direction of travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Rank {
    /// The scene's number; larger wins.
    pub priority: i32,
    /// The solid.
    pub solid: InstanceId,
}

/// How a surface separates media.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Boundary {
    /// No boundary (opaque surfaces, thin sheets, sensors).
    None,
    /// Boundary of a solid filled with a medium.
    Solid {
        /// Medium that fills the solid.
        medium: MediumId,
        /// Precedence of the solid.
        priority: i32,
    },
    /// Surface that names the media on both sides (lens surfaces).
    Interface {
        /// On the side the geometric normal points to.
        above: MediumId,
        /// On the other side.
        below: MediumId,
    },
}

/// The solids a point is inside of. The one of highest rank is the medium there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MediumStack {
    /// Sorted by rank, highest last; those beyond `count` are [`NO_SOLID`]. No `ArrayVec`: that is
    /// copied element by element, and walks copy a stack at every surface.
    nested: [(Rank, MediumId); MOST_NESTED],
    /// How many solids there are.
    count: u32,
    /// Where no solid is.
    outside: MediumId,
}

/// Most solids that nest.
const MOST_NESTED: usize = 6;
/// Filler of a stack.
const NO_SOLID: (Rank, MediumId) = (
    Rank {
        priority: 0,
        solid: InstanceId(0),
    },
    MediumId(0),
);

impl MediumStack {
    /// In no solid.
    #[must_use]
    pub fn new(outside: MediumId) -> Self {
        Self {
            nested: [NO_SOLID; MOST_NESTED],
            count: 0,
            outside,
        }
    }

    /// The solids, highest rank last.
    fn solids(&self) -> &[(Rank, MediumId)] {
        &self.nested[..self.count as usize]
    }

    /// The medium here.
    #[must_use]
    pub fn medium(&self) -> MediumId {
        self.solids().last().map_or(self.outside, |s| s.1)
    }

    /// The rank of the solid whose medium this is; `None` outside all solids.
    #[must_use]
    pub fn rank(&self) -> Option<Rank> {
        self.solids().last().map(|s| s.0)
    }

    /// The stack after crossing `boundary` of `solid`. `entering`: travelling against the geometric
    /// normal. `None` if more than [`MOST_NESTED`] solids nest.
    #[must_use]
    pub fn crossed(&self, boundary: Boundary, solid: InstanceId, entering: bool) -> Option<Self> {
        let mut next = *self;
        let count = self.count as usize;
        match boundary {
            Boundary::None => {}
            Boundary::Solid { medium, priority } => {
                let rank = Rank { priority, solid };
                if entering {
                    let at = self.solids().partition_point(|s| s.0 < rank);
                    if self.solids().get(at).is_none_or(|s| s.0 != rank) {
                        if count == MOST_NESTED {
                            return None;
                        }
                        next.nested.copy_within(at..count, at + 1);
                        next.nested[at] = (rank, medium);
                        next.count += 1;
                    }
                } else if let Some(at) = self.solids().iter().position(|s| s.0 == rank) {
                    next.nested.copy_within(at + 1..count, at);
                    next.nested[count - 1] = NO_SOLID;
                    next.count -= 1;
                }
            }
            Boundary::Interface { above, below } => {
                next.outside = if entering { below } else { above }
            }
        }
        Some(next)
    }
}

impl MediumStack {
    /// Whether `boundary` of `solid` can be met here from this side: solids are left only from
    /// inside, and interfaces name the medium that is really there.
    #[must_use]
    pub fn agrees(&self, boundary: Boundary, solid: InstanceId, entering: bool) -> bool {
        match boundary {
            Boundary::None => true,
            Boundary::Solid { .. } => self.solids().iter().any(|s| s.0.solid == solid) != entering,
            Boundary::Interface { above, below } => {
                self.count > 0 || self.outside == if entering { above } else { below }
            }
        }
    }
}

/// Absorption coefficient in 1/m that leaves `transmittance` after `distance_m`, at every nanometer
/// of the range and at the points of its table.
#[must_use]
pub fn absorption_of(transmittance: &Curve, distance_m: f64, [low, high]: [f64; 2]) -> Curve {
    // what lets nothing through over the distance lets 1e-6 through, so that coefficients stay
    // finite
    let coefficient = |nm: f64| -transmittance.eval(nm).max(1e-6).ln() / distance_m;
    if let Curve::Constant(_) = transmittance {
        return Curve::Constant(coefficient(low));
    }
    let steps = (high - low).ceil().max(1.0) as usize;
    let even = (0..=steps).map(|i| low + (high - low) * i as f64 / steps as f64);
    let inside = |l: &f64| (low..=high).contains(l);
    let mut nm: Vec<f64> = even
        .chain(transmittance.knots_nm().into_iter().filter(inside))
        .collect();
    nm.sort_by(f64::total_cmp);
    nm.dedup();
    let values: Vec<f64> = nm.iter().map(|&nm| coefficient(nm)).collect();
    Curve::table(&nm, &values)
}
