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

/// Properties of a medium that hold at all wavelengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MediumKind {
    /// The k table of its index absorbs.
    uses_k: bool,
    /// The index varies with wavelength.
    dispersive: bool,
    /// Index or absorption varies with wavelength, or light is absorbed at all.
    pub varies: bool,
}

impl Medium {
    /// Properties at all wavelengths, which its tables are searched for.
    #[must_use]
    pub fn kind(&self) -> MediumKind {
        let uses_k = self.use_k && self.ior.is_absorbing();
        let dispersive = self.ior.is_dispersive();
        MediumKind {
            uses_k,
            dispersive,
            varies: dispersive || uses_k || self.absorption.is_some(),
        }
    }

    /// Index and absorption at the wavelengths of a path.
    #[must_use]
    pub fn sample(&self, wavelengths: &SampledWavelengths) -> MediumLanes {
        self.sample_as(self.kind(), wavelengths)
    }

    /// The same of a medium whose kind is known.
    #[must_use]
    pub fn sample_as(&self, kind: MediumKind, wavelengths: &SampledWavelengths) -> MediumLanes {
        let used = 0..wavelengths.count();
        let mut eta = [1.0; MAX_LANES];
        for j in used.clone() {
            eta[j] = self.ior.n(wavelengths.lambda_nm(j));
        }
        let absorption = (kind.uses_k || self.absorption.is_some()).then(|| {
            let mut lanes = [0.0; MAX_LANES];
            for j in used {
                let nm = wavelengths.lambda_nm(j);
                let from_k = if kind.uses_k {
                    4.0 * std::f64::consts::PI * self.ior.k(nm) / (nm * 1e-9)
                } else {
                    0.0
                };
                lanes[j] = from_k + self.absorption.as_ref().map_or(0.0, |a| a.eval(nm));
            }
            lanes
        });
        MediumLanes {
            eta,
            absorption,
            dispersive: kind.dispersive,
        }
    }
}

impl MediumLanes {
    /// Whether nothing is absorbed, however long the way.
    #[must_use]
    #[inline]
    pub fn is_clear(&self) -> bool {
        self.absorption.is_none()
    }

    /// Transmittance over `distance` (m) in the first `count` lanes (Beer-Lambert); 1 over an
    /// infinite one, for light from infinity is given as it arrives.
    #[must_use]
    #[inline]
    pub fn transmittance(&self, distance: f64, count: usize) -> SampledSpectrum {
        let mut out = SampledSpectrum::ONE;
        if let Some(a) = &self.absorption
            && distance.is_finite()
        {
            for (out, a) in out.0.iter_mut().zip(a).take(count) {
                *out = (-a * distance).exp() as f32;
            }
        }
        out
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

    /// The stack after crossing `boundary` of `solid`: [`MediumStack::cross`].
    #[must_use]
    #[inline]
    pub fn crossed(&self, boundary: Boundary, solid: InstanceId, entering: bool) -> Option<Self> {
        let mut next = *self;
        next.cross(boundary, solid, entering).then_some(next)
    }

    /// Crosses `boundary` of `solid`. `entering`: travelling against the geometric normal. `false`
    /// if more than [`MOST_NESTED`] solids nest.
    #[inline]
    pub fn cross(&mut self, boundary: Boundary, solid: InstanceId, entering: bool) -> bool {
        match boundary {
            Boundary::None => true,
            Boundary::Solid { medium, priority } => {
                self.cross_solid((Rank { priority, solid }, medium), entering)
            }
            Boundary::Interface { above, below } => {
                self.outside = if entering { below } else { above };
                true
            }
        }
    }

    fn cross_solid(&mut self, (rank, medium): (Rank, MediumId), entering: bool) -> bool {
        let count = self.count as usize;
        if entering {
            let at = self.solids().partition_point(|s| s.0 < rank);
            if self.solids().get(at).is_none_or(|s| s.0 != rank) {
                if count == MOST_NESTED {
                    return false;
                }
                self.nested.copy_within(at..count, at + 1);
                self.nested[at] = (rank, medium);
                self.count += 1;
            }
        } else if let Some(at) = self.solids().iter().position(|s| s.0 == rank) {
            self.nested.copy_within(at + 1..count, at);
            self.nested[count - 1] = NO_SOLID;
            self.count -= 1;
        }
        true
    }
}

impl MediumStack {
    /// Whether `boundary` of `solid` can be met here from this side: solids are left only from
    /// inside, and interfaces name the medium that is really there.
    #[must_use]
    #[inline]
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
