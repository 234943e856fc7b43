//! Random numbers: pure functions of (seed, sensor, pixel, pass, stream, dimension).
//!
//! Numbers come in sets of four from named streams, so that the length of one sub-path never shifts the numbers of another
//! and a Metropolis sampler can take the same place.

use crate::math::hash::{combine, random_bits, unit_f64};

/// Who consumes the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Film position and lens, then wavelength and time.
    Base = 0,
    /// The camera sub-path: one set per vertex.
    Camera = 1,
    /// The light sub-path: two sets to start, then one per vertex.
    Light = 2,
    /// Direct connections and the choice of pairs: as many sets as connections ask for.
    Connect = 3,
}

/// All streams of one sample.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    key: u64,
    /// Index within the low-discrepancy sequence, and the key of its scrambling (the same for all indices of a pixel).
    index: u32,
    scramble: u64,
    /// Even or odd pass.
    half: u32,
}

/// Sets of a stream that come from the low-discrepancy sequence; later ones are independent.
const SOBOL_SETS: u32 = 12;

impl Sampler {
    /// The numbers of pass `pass` of a pixel. Even and odd passes are scrambled independently, so that the two halves of the
    /// passes are independent estimates.
    #[must_use]
    pub fn new(seed: u64, sensor: u32, pixel: u64, pass: u32) -> Self {
        let half = u64::from(pass & 1);
        let index = pass >> 1;
        // the sequence has 2^16 elements; beyond, a new scrambling starts
        let epoch = u64::from(index >> 16);
        let pixel_key = combine(combine(seed, u64::from(sensor)), pixel);
        let scramble = combine(pixel_key, (epoch << 1) | half);
        Self { key: combine(pixel_key, u64::from(pass) | 1 << 40), index: index & 0xffff, scramble, half: pass & 1 }
    }

    /// The primary wavelength number of pixel `(x, y)`, stratified over passes (one low-discrepancy sequence for all pixels) and over
    /// neighboring pixels (each rotates it by a plane lattice of the plastic number).
    #[must_use]
    pub fn wavelength(&self, (x, y): (u32, u32), seed: u64) -> f64 {
        // the same for all pixels, but not for the two halves of the passes
        let common = combine(combine(seed, 0x5741_5645), u64::from(self.half));
        let sequence = f64::from(sobol_burley::sample(self.index, 0, common as u32));
        let rotation = f64::from(x) * 0.754_877_666_246_692_8 + f64::from(y) * 0.569_840_290_998_053_3;
        // the hash fills the bits that the sequence leaves
        let fine = unit_f64(random_bits(self.key, u64::MAX)) * (1.0 / 65_536.0);
        (sequence + rotation + fine + unit_f64(random_bits(common, 1))).fract()
    }

    /// The numbers of one stream, from its start.
    #[must_use]
    pub fn stream(&self, stream: Stream) -> StreamSampler {
        StreamSampler {
            key: combine(self.key, stream as u64),
            index: self.index,
            scramble: combine(self.scramble, stream as u64) as u32,
            first_set: stream as u32 * SOBOL_SETS,
            set: 0,
        }
    }
}

/// The numbers of one stream, in sets of four.
#[derive(Clone, Copy, Debug)]
pub struct StreamSampler {
    key: u64,
    index: u32,
    scramble: u32,
    first_set: u32,
    set: u32,
}

impl StreamSampler {
    /// The next four numbers, each in [0, 1) with 53 random bits.
    #[must_use]
    pub fn next4(&mut self) -> [f64; 4] {
        let set = self.set;
        self.set += 1;
        let counter = u64::from(set) * 4;
        let fine: [f64; 4] = std::array::from_fn(|i| unit_f64(random_bits(self.key, counter + i as u64)));
        if set >= SOBOL_SETS {
            return fine;
        }
        // the sequence gives the leading 24 bits, the hash the rest
        let leading = sobol_burley::sample_4d(self.index, self.first_set + set, self.scramble);
        std::array::from_fn(|i| f64::from(leading[i]) + fine[i] * (1.0 / 16_777_216.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_in_range_and_depend_on_every_part_of_the_key() {
        let first = |seed, sensor, pixel, pass, stream| {
            let u = Sampler::new(seed, sensor, pixel, pass).stream(stream).next4();
            assert!(u.iter().all(|&x| (0.0..1.0).contains(&x)));
            u
        };
        let base = first(1, 0, 5, 2, Stream::Camera);
        assert_eq!(base, first(1, 0, 5, 2, Stream::Camera));
        for other in [
            first(2, 0, 5, 2, Stream::Camera),
            first(1, 1, 5, 2, Stream::Camera),
            first(1, 0, 6, 2, Stream::Camera),
            first(1, 0, 5, 3, Stream::Camera),
            first(1, 0, 5, 2, Stream::Light),
        ] {
            assert_ne!(base, other);
        }
    }

    #[test]
    fn each_half_of_the_passes_is_stratified() {
        for half in 0..2 {
            let mut cells = [0; 64];
            for i in 0..64 {
                let u = Sampler::new(9, 0, 77, 2 * i + half).stream(Stream::Base).next4();
                cells[(u[0] * 64.0) as usize] += 1;
            }
            assert_eq!(cells, [1; 64]);
        }
    }
}
