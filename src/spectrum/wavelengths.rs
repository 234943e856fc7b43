//! The wavelengths of one path, and the distribution they are drawn from.

use super::MAX_LANES;

/// The wavelengths of one path: lane 0 is the hero, the others are its rotations in primary space.
///
/// Immutable for the life of a path: lanes die on a sub-path, never here.
#[derive(Clone, Copy, Debug)]
pub struct SampledWavelengths {
    lambda_nm: [f64; MAX_LANES],
    /// Density with respect to the wavelength measure: a probability at an atom, per nm elsewhere.
    pdf: [f64; MAX_LANES],
    /// Bit j: lane j sits on an atom (an emission line).
    atoms: u8,
    count: u8,
}

impl SampledWavelengths {
    /// Number of lanes in use: 1, 4 or 8.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count as usize
    }

    /// Wavelength of lane `lane` in nanometres.
    #[must_use]
    pub fn lambda_nm(&self, lane: usize) -> f64 {
        self.lambda_nm[lane]
    }

    /// Density of lane `lane`: a probability at an atom, per nanometre elsewhere.
    #[must_use]
    pub fn pdf(&self, lane: usize) -> f64 {
        self.pdf[lane]
    }

    /// Whether lane `lane` sits on an emission line.
    #[must_use]
    pub fn is_line(&self, lane: usize) -> bool {
        self.atoms & (1 << lane) != 0
    }

    /// How many lanes have exactly the wavelength of `lane` (itself included): 1 unless lanes coincide on an atom.
    #[must_use]
    pub fn multiplicity(&self, lane: usize) -> usize {
        let n = self.count();
        (0..n).filter(|&k| self.lambda_nm[k] == self.lambda_nm[lane]).count()
    }
}

/// The distribution `p_λ` of wavelengths over the measure Lebesgue + atoms.
#[derive(Clone, Debug)]
pub struct WavelengthDistribution {
    // H1: piecewise CDF (<= 1 nm cells) with jumps at atoms
}

impl WavelengthDistribution {
    /// `count` lanes at `frac(u + j / count)`, j = 0, 1, ... of the inverse CDF. `u` in [0, 1).
    #[must_use]
    pub fn sample(&self, _u: f64, _count: usize) -> SampledWavelengths {
        todo!()
    }
    // H1: constructors: uniform(range), scene(emitters, range), lines(list); density(lambda), atoms(), range_nm()
}
