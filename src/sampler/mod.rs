//! Random numbers: pure functions of (seed, sensor, pixel, pass, name of the draw).
//!
//! Each decision of a sample has a name and asks for its numbers by it ([`Draw`]), in any order and
//! whatever else was decided: the same vertex has the same dimensions of the low-discrepancy
//! sequence in every pass, and a point of primary sample space ([`Primary`]) takes the same place.
//!
//! Wavelengths have a sequence of their own, over pixels and passes at once: one digital net in
//! base 2 (Niederreiter, "Point sets and sequences with small discrepancy", 1987), scrambled as a
//! whole (Owen 1995). Any aligned block of 2^p pixels in Morton order, which leaves no number out,
//! over any aligned 2^q passes of a half has one wavelength in each of 2^(p+q) strata. Which pixel
//! of a block has which is left to chance, block within block (as Ahmed and Wonka, "Screen-space
//! blue-noise diffusion of Monte Carlo sampling error via hierarchical ordering of pixels", 2020):
//! columns and rows have no color of their own.
//!
//! Times are stratified over the passes of a pixel, and together with its wavelengths: the pairs of
//! any aligned 2^q passes of a half lie one in each of 2^q boxes, whatever their shape (the
//! (0,2)-sequence of Sobol').

pub mod primary;
mod sobol;

pub use primary::{Pixels, Primary};

use crate::math::hash::{combine, permuted, random_bits, unit_f64};
use primary::Name;
use sobol_burley::parts::owen_scramble_rev;

/// A decision of one sample that takes random numbers. The first few of each kind are stratified
/// over the passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Draw {
    /// Film position and lens: two numbers each.
    Film,
    /// Scattering at camera vertex i: label, direction (two); of the first, Russian roulette of the
    /// walk.
    Camera(usize),
    /// The light that a light sub-path starts from, and the point on it (two).
    LightStart,
    /// First direction of a light sub-path: two.
    LightDirection,
    /// Scattering at light vertex i, as [`Draw::Camera`].
    Light(usize),
    /// The light that camera vertex j - 1 is connected to, and the point on it (two); 0: the point
    /// of a detector.
    Direct(usize),
    /// Point of the sensor that light vertex i - 1 is connected to: two; 0: the start of the light
    /// sub-path.
    Lens(usize),
    /// Which light vertices are joined to which camera vertices: one number.
    Pairs,
    /// Whether a camera sub-path passes the nth partly covered surface after as many vertices:
    /// (vertices, n).
    CameraCoverage(usize, usize),
    /// The same for a light sub-path.
    LightCoverage(usize, usize),
    /// Russian roulette before the shadow ray of strategy (s, t) under one of four pairs of labels:
    /// (s, t, labels).
    Roulette(usize, usize, usize),
    /// The light that camera vertex j aims at through chains, and the point on it (two).
    AimLight(usize),
    /// Point of the sensor that light vertex i - 1 aims at through chains: two; 0: the start of the
    /// light sub-path.
    AimLens(usize),
    /// Which kinds of chains are tried from camera vertex j (2 j) and from light vertex i - 1
    /// (2 i + 1; 1: the start of the light sub-path).
    AimTries(usize),
    /// The sequence of surfaces that the sample's paths are held to, of Markov chains.
    Sequence,
}

/// Draws of a kind that are stratified over the passes: the first so many vertices.
const STRATIFIED: usize = 12;

/// Numbers of a draw, and where they stand in low-discrepancy sequences.
struct Place {
    kind: u64,
    /// Number of its own within the kind.
    index: u64,
    /// Set of four dimensions, if the draw is stratified over the passes.
    set: Option<u32>,
    /// The sets of the kind belong to one sequence, so that draws are stratified together; else
    /// each draw has a sequence of its own.
    joint: bool,
}

impl Draw {
    #[inline]
    fn place(self) -> Place {
        let two = |a: usize, b: usize| (a as u64) << 26 | b as u64;
        // a walk is one path through a space of many dimensions
        let walk = |kind, set: usize| Place {
            kind,
            index: set as u64,
            set: (set < STRATIFIED).then_some(set as u32),
            joint: true,
        };
        // what is drawn at a vertex of a walk: later dimensions of Sobol' are worse than random
        // numbers in many of their planes, the first four are not (padding, Burley 2020)
        let alone = |kind, index: u64, stratified: bool| Place {
            kind,
            index,
            set: stratified.then_some(0),
            joint: false,
        };
        match self {
            Self::Film => alone(0, 0, true),
            Self::Camera(i) => walk(1, i),
            Self::LightStart => walk(2, 0),
            Self::LightDirection => walk(2, 1),
            Self::Light(i) => walk(2, i + 2),
            Self::Direct(j) => alone(3, j as u64, j < STRATIFIED),
            Self::Lens(i) => alone(4, i as u64, i < STRATIFIED),
            Self::Pairs => alone(5, 0, true),
            Self::CameraCoverage(vertices, n) => alone(6, two(vertices, n), false),
            Self::LightCoverage(vertices, n) => alone(7, two(vertices, n), false),
            Self::Roulette(s, t, labels) => alone(8, two(s, 4 * t + labels), false),
            Self::AimLight(j) => alone(9, j as u64, j < STRATIFIED),
            Self::AimLens(i) => alone(10, i as u64, i < STRATIFIED),
            Self::AimTries(i) => alone(11, i as u64, false),
            Self::Sequence => alone(12, 0, true),
        }
    }
}

impl Draw {
    /// A number that no other draw has; the last two bits are free.
    fn code(self) -> u64 {
        let Place { kind, index, .. } = self.place();
        kind << 58 | index << 2
    }
}

/// All numbers of one sample.
#[derive(Clone, Copy, Debug)]
pub struct Sampler<'a> {
    key: u64,
    /// Index within the low-discrepancy sequence, and the key of its scrambling (the same for all
    /// indices of a pixel).
    index: u32,
    scramble: u64,
    pass: u32,
    /// The point of a Markov chain whose numbers these are, for light sub-path `index`.
    primary: Option<&'a Primary>,
}

impl Sampler<'_> {
    /// The numbers of pass `pass` of a pixel. Even and odd passes are scrambled independently, so
    /// that the two halves of the passes are independent estimates.
    #[must_use]
    pub fn new(seed: u64, sensor: u32, pixel: u64, pass: u32) -> Self {
        let half = u64::from(pass & 1);
        let index = pass >> 1;
        // the sequence has 2^16 elements; beyond, a new scrambling starts
        let epoch = u64::from(index >> 16);
        let pixel_key = combine(combine(seed, u64::from(sensor)), pixel);
        let scramble = combine(pixel_key, (epoch << 1) | half);
        Self {
            key: combine(pixel_key, u64::from(pass) | 1 << 40),
            index: index & 0xffff,
            scramble,
            pass,
            primary: None,
        }
    }

    /// The numbers of the nth light sub-path of the sample, those of the sample for the first.
    #[must_use]
    pub fn fork(&self, n: u32) -> Self {
        if n == 0 {
            return *self;
        }
        if self.primary.is_some() {
            return Self { index: n, ..*self };
        }
        Self {
            key: combine(self.key, u64::from(n)),
            scramble: combine(self.scramble, u64::from(n)),
            ..*self
        }
    }

    /// The primary wavelength number of a pixel of a film of `size` columns and rows, stratified
    /// over neighboring pixels and passes together.
    #[must_use]
    pub fn wavelength(&self, pixel: (u32, u32), size: (u32, u32), seed: u64) -> f64 {
        if let Some(primary) = self.primary {
            return primary.number(Name::Wavelength);
        }
        // the same for all pixels, but not for the two halves of the passes
        let common = combine(combine(seed, 0x5741_5645), u64::from(self.pass & 1));
        // bit r is binary digit r + 1 of the number
        let digits =
            shuffled(morton_rank(pixel, size), (common >> 32) as u32) ^ pascal(self.pass >> 1);
        let stratum = owen_scramble_rev(digits, common as u32).reverse_bits();
        // the hash fills the bits that the net leaves
        (f64::from(stratum) + unit_f64(random_bits(self.key, u64::MAX))) * (1.0 / 4_294_967_296.0)
    }

    /// The number by which a pixel's sample chooses among a few things, in [0, 1): over the pixels
    /// of a film of `size` columns and rows, every pass has one in each of as many strata. That of
    /// a pixel is the same in an even pass and the odd one behind it, so that the halves of the
    /// passes differ by the places within strata alone, as the mean of both does from the truth.
    /// Points of Markov chains have their own.
    #[must_use]
    pub fn choice(&self, pixel: (u32, u32), size: (u32, u32), seed: u64) -> f64 {
        if self.primary.is_some() {
            return self.set(Draw::Sequence)[0];
        }
        let pixels = u64::from(size.0) * u64::from(size.1);
        let rank = u64::from(pixel.1) * u64::from(size.0) + u64::from(pixel.0);
        let common = combine(combine(seed, 0x5345_5155), u64::from(self.pass >> 1));
        let stratum = permuted(rank, pixels, common) as f64;
        let within = unit_f64(random_bits(self.key, u64::MAX - 2));
        // rounding must not lead to 1
        ((stratum + within) / pixels as f64).min(1.0 - f64::EPSILON)
    }

    /// The number of the moment in the shutter, in [0, 1).
    #[must_use]
    pub fn time(&self) -> f64 {
        if let Some(primary) = self.primary {
            return primary.number(Name::Time);
        }
        let scramble = combine(self.scramble, 0x7469_6d65) as u32;
        let stratum = owen_scramble_rev(pascal_transposed(self.index), scramble).reverse_bits();
        (f64::from(stratum) + unit_f64(random_bits(self.key, u64::MAX - 1)))
            * (1.0 / 4_294_967_296.0)
    }

    /// Four numbers, each in [0, 1) with 53 random bits.
    #[must_use]
    #[inline]
    pub fn set(&self, draw: Draw) -> [f64; 4] {
        if let Some(primary) = self.primary {
            return primary.set(self.index, draw);
        }
        let place = draw.place();
        let Place { kind, index, .. } = place;
        let Some(set) = place.set else {
            return std::array::from_fn(|i| unit_f64(self.bits(kind, index, i as u64)));
        };
        // the sequence gives the leading 23 bits, the hash the rest; its seed shuffles and
        // scrambles
        let sequence = kind << 56 | if place.joint { 0 } else { index };
        let scramble = combine(self.scramble, sequence) as u32;
        let leading = sobol::sample(self.index, set, scramble);
        let fine = [self.bits(kind, index, 0), self.bits(kind, index, 1)];
        std::array::from_fn(|i| {
            let fine = fine[i / 2] >> (32 * (i % 2)) & 0x3fff_ffff;
            f64::from(leading[i]) + fine as f64 * (1.0 / 9_007_199_254_740_992.0)
        })
    }

    /// One number in [0, 1) for a draw that is never stratified.
    #[must_use]
    pub fn number(&self, draw: Draw) -> f64 {
        if let Some(primary) = self.primary {
            return primary.set(self.index, draw)[0];
        }
        let Place { kind, index, .. } = draw.place();
        unit_f64(self.bits(kind, index, 0))
    }

    #[inline]
    fn bits(&self, kind: u64, index: u64, component: u64) -> u64 {
        random_bits(self.key, kind << 58 | index << 2 | component)
    }
}

/// The number of a pixel of a film in Morton order, in which near pixels have near numbers and none
/// is left out: where a film is no square of a power of two, strips at its ends would otherwise
/// have the same leading digits, and all their pixels nearly the same wavelengths.
fn morton_rank((x, y): (u32, u32), (width, height): (u32, u32)) -> u32 {
    let [x, y, width, height] = [x, y, width, height].map(u64::from);
    let mut bits = u64::BITS - (width.max(height) - 1).leading_zeros();
    // corner of the square that holds the pixel, and pixels before it
    let (mut left, mut top, mut rank) = (0, 0, 0);
    loop {
        let side = 1 << bits;
        let is_inside = left + side <= width && top + side <= height;
        if bits == 0 || is_inside && bits <= 16 {
            let low = side - 1;
            // films have fewer pixels; beyond, numbers come again
            return (rank as u32).wrapping_add(morton((x & low) as u32, (y & low) as u32));
        }
        bits -= 1;
        let half = side / 2;
        let within = |first: u64, end: u64| end.saturating_sub(first).min(half);
        let columns = [left, left + half].map(|first| within(first, width));
        let mut rows = within(top, height);
        if y & half != 0 {
            rank += rows * (columns[0] + columns[1]);
            top += half;
            rows = within(top, height);
        }
        if x & half != 0 {
            rank += rows * columns[0];
            left += half;
        }
    }
}

/// A number whose every bit is flipped or not by what the bits above it are (Owen 1995): aligned
/// blocks stay aligned blocks, and which of its halves is first is left to chance. In the order of
/// Morton itself every fourth column would have the same wavelengths.
fn shuffled(rank: u32, key: u32) -> u32 {
    owen_scramble_rev(rank.reverse_bits(), key).reverse_bits()
}

/// The lower 16 bits of both, interleaved.
fn morton(x: u32, y: u32) -> u32 {
    let spread = |v: u32| {
        let v = v & 0xffff;
        let v = (v | v << 8) & 0x00ff_00ff;
        let v = (v | v << 4) & 0x0f0f_0f0f;
        let v = (v | v << 2) & 0x3333_3333;
        (v | v << 1) & 0x5555_5555
    };
    spread(x) | spread(y) << 1
}

/// Pascal's triangle modulo 2 times the bits of `n`: bit r of the product is the parity of C(r, c)
/// over the set bits c of `n`.
///
/// The triangle's minors of q rows in sequence and the first q columns are all 1 (Vandermonde), so
/// that beside the identity, which holds p digits for 2^p pixels, it gives 2^q passes all values of
/// the next q digits. C(r, c) is odd where c is a subset of r (Lucas), which makes the product a
/// sum over subsets.
fn pascal(n: u32) -> u32 {
    let n = n ^ (n & 0x5555_5555) << 1;
    let n = n ^ (n & 0x3333_3333) << 2;
    let n = n ^ (n & 0x0f0f_0f0f) << 4;
    let n = n ^ (n & 0x00ff_00ff) << 8;
    n ^ n << 16
}

/// The transpose of Pascal's triangle modulo 2 times the bits of `n`: sums over supersets. The
/// first b rows of this and the first a of Pascal's triangle are independent over the first a + b
/// columns.
fn pascal_transposed(n: u32) -> u32 {
    let n = n ^ (n >> 1) & 0x5555_5555;
    let n = n ^ (n >> 2) & 0x3333_3333;
    let n = n ^ (n >> 4) & 0x0f0f_0f0f;
    let n = n ^ (n >> 8) & 0x00ff_00ff;
    n ^ n >> 16
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn numbers_are_in_range_and_depend_on_every_part_of_the_key() {
        let first = |seed, sensor, pixel, pass, draw| {
            let u = Sampler::new(seed, sensor, pixel, pass).set(draw);
            assert!(u.iter().all(|&x| (0.0..1.0).contains(&x)));
            u
        };
        let base = first(1, 0, 5, 2, Draw::Camera(0));
        assert_eq!(base, first(1, 0, 5, 2, Draw::Camera(0)));
        for other in [
            first(2, 0, 5, 2, Draw::Camera(0)),
            first(1, 1, 5, 2, Draw::Camera(0)),
            first(1, 0, 6, 2, Draw::Camera(0)),
            first(1, 0, 5, 3, Draw::Camera(0)),
            first(1, 0, 5, 2, Draw::Light(0)),
        ] {
            assert_ne!(base, other);
        }
    }

    /// Every draw of sub-paths of up to 40 vertices.
    fn draws() -> Vec<Draw> {
        let mut all = vec![
            Draw::Film,
            Draw::LightStart,
            Draw::LightDirection,
            Draw::Pairs,
            Draw::Sequence,
        ];
        for i in 0..40 {
            all.extend([
                Draw::Camera(i),
                Draw::Light(i),
                Draw::Direct(i),
                Draw::Lens(i),
            ]);
            for j in 0..40 {
                all.extend([Draw::CameraCoverage(i, j), Draw::LightCoverage(i, j)]);
                all.extend((0..4).map(|labels| Draw::Roulette(i, j, labels)));
            }
        }
        all
    }

    #[test]
    fn no_two_draws_share_their_numbers() {
        let sampler = Sampler::new(1, 0, 5, 2);
        let all = draws();
        let (mut numbers, mut places) = (HashSet::new(), HashSet::new());
        for &draw in &all {
            let Place { kind, index, .. } = draw.place();
            assert!(kind < 63 && index < 1 << 56, "{draw:?}");
            assert!(places.insert((kind, index)), "{draw:?}");
            numbers.extend(sampler.set(draw).map(f64::to_bits));
        }
        assert_eq!(numbers.len(), 4 * all.len());
    }

    #[test]
    fn ranks_leave_no_number_out() {
        for size in [
            (1, 1),
            (32, 32),
            (33, 31),
            (200, 150),
            (37, 1),
            (1, 5),
            (70, 129),
        ] {
            let pixels = || (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
            let mut met = vec![false; (size.0 * size.1) as usize];
            for pixel in pixels() {
                let rank = morton_rank(pixel, size);
                assert!(
                    !std::mem::replace(&mut met[rank as usize], true),
                    "{pixel:?}"
                );
                if size == (32, 32) {
                    assert_eq!(rank, morton(pixel.0, pixel.1));
                }
            }
            // squares inside have their pixels in sequence
            if size.0 >= 4 && size.1 >= 4 {
                let first = morton_rank((size.0 / 4 * 4 - 4, 0), size);
                let last = morton_rank((size.0 / 4 * 4 - 1, 3), size);
                assert_eq!(last, first + 15);
            }
        }
        // the whole range of films
        for size in [(65_536, 65_536), (u32::MAX, 1), (1, u32::MAX), (100_000, 3)] {
            assert_eq!(morton_rank((0, 0), size), 0);
            let last = (u64::from(size.0) * u64::from(size.1) - 1) as u32;
            assert_eq!(morton_rank((size.0 - 1, size.1 - 1), size), last);
        }
    }

    /// A third of the spectrum gets a third of the samples of a film, whatever its shape: strips at
    /// its ends no more or less.
    #[test]
    fn wavelengths_are_spread_evenly_over_a_film() {
        for size in [(32, 32), (33, 31), (50, 38), (129, 9), (77, 1)] {
            for seed in 0..20 {
                let pixels = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
                let of_pixel = |(x, y): (u32, u32)| {
                    let pixel = u64::from(y * size.0 + x);
                    (0..8).filter(move |&pass| {
                        let sampler = Sampler::new(seed, 0, pixel, pass);
                        sampler.wavelength((x, y), size, seed) < 1.0 / 3.0
                    })
                };
                let below: usize = pixels.map(|p| of_pixel(p).count()).sum();
                let expected = f64::from(size.0 * size.1) * 8.0 / 3.0;
                // a standard deviation is 1 (random numbers: 17 to 42)
                let off = below as f64 - expected;
                assert!(off.abs() < 6.0, "{size:?}, {seed}: {off}");
            }
        }
    }

    /// Four lanes leave of a number its place within a quarter: this is no more alike along columns
    /// and rows than random numbers are, else images have stripes.
    #[test]
    fn columns_and_rows_have_no_colors_of_their_own() {
        let side = 64;
        let (mut columns, mut rows, mut lines) = (0.0, 0.0, 0.0);
        for (seed, pass) in (0..8).flat_map(|seed| [(seed, 0), (seed, 5)]) {
            let wave = |x, y| {
                let sampler = Sampler::new(seed, 0, u64::from(y * side + x), pass);
                let u = sampler.wavelength((x, y), (side, side), seed);
                (8.0 * std::f64::consts::PI * u).cos()
            };
            for line in 0..side {
                columns += (0..side).map(|y| wave(line, y)).sum::<f64>().powi(2);
                rows += (0..side).map(|x| wave(x, line)).sum::<f64>().powi(2);
                lines += 1.0;
            }
        }
        // of random numbers half a pixel each, of 1024 lines within 0.044: five standard deviations
        let share = 2.0 / f64::from(side) / lines;
        let (columns, rows) = (share * columns, share * rows);
        assert!(columns < 1.22 && rows < 1.22, "{columns} {rows}");
    }

    #[test]
    fn choices_of_a_pass_have_equal_shares() {
        let size = (13, 7);
        let pixels = || (0..7).flat_map(|y| (0..13).map(move |x| (x, y)));
        for (seed, pass) in [(1, 0), (1, 1), (77, 5)] {
            let mut strata = vec![0; 91];
            for (x, y) in pixels() {
                let rank = u64::from(y * 13 + x);
                let of_pass = |pass| Sampler::new(seed, 0, rank, pass).choice((x, y), size, seed);
                let (u, beside) = (of_pass(pass), of_pass(pass ^ 1));
                assert!((0.0..1.0).contains(&u));
                strata[(91.0 * u) as usize] += 1;
                // its twin in the other half has the stratum, not the place
                assert_eq!((91.0 * u) as usize, (91.0 * beside) as usize);
                assert_ne!(u, beside);
            }
            assert!(strata.iter().all(|n| *n == 1), "{strata:?}");
        }
        // of one pixel over pairs of passes, halves are as likely as not: 5 standard deviations
        let low = (0..4000).map(|pair| 2 * pair).filter(|&pass| {
            let sampler = Sampler::new(3, 0, 40, pass);
            sampler.choice((1, 3), size, 3) < 0.5
        });
        assert!((low.count() as f64 - 2000.0).abs() < 5.0 * 31.6);
    }

    #[test]
    fn each_half_of_the_passes_is_stratified() {
        for half in 0..2 {
            for draw in [
                Draw::Film,
                Draw::LightStart,
                Draw::Direct(1),
                Draw::Lens(11),
            ] {
                // 64 strata of each number, and 8 x 8 of the first two
                let (mut single, mut planes) = ([[0; 64]; 4], [0; 64]);
                for i in 0..64 {
                    let u = Sampler::new(9, 0, 77, 2 * i + half).set(draw);
                    for (cells, u) in single.iter_mut().zip(u) {
                        cells[(u * 64.0) as usize] += 1;
                    }
                    planes[(u[0] * 8.0) as usize * 8 + (u[1] * 8.0) as usize] += 1;
                }
                assert_eq!((single, planes), ([[1; 64]; 4], [1; 64]), "{draw:?}");
            }
        }
    }

    #[test]
    fn a_vertex_has_its_own_strata_whatever_other_vertices_draw() {
        // 64 passes of one half; the light sample of vertex 3 falls once into each of 64 strata
        let mut cells = [0; 64];
        for i in 0..64 {
            let sampler = Sampler::new(3, 0, 12, 2 * i);
            for j in 0..i as usize % 3 {
                let _ = sampler.set(Draw::Direct(j));
            }
            cells[(sampler.set(Draw::Direct(3))[1] * 64.0) as usize] += 1;
        }
        assert_eq!(cells, [1; 64]);
    }

    /// Strata (of 2^(p+q)) hit by the wavelengths of 2^p pixels over 2^q passes, from aligned
    /// starts.
    fn strata((p, q): (u32, u32), (x0, y0): (u32, u32), n0: u32, half: u32, seed: u64) -> Vec<u32> {
        let (columns, rows) = (1 << p.div_ceil(2), 1 << (p / 2));
        let count = 1 << (p + q);
        let mut hit = vec![0; count];
        for n in n0..n0 + (1 << q) {
            for (x, y) in (y0..y0 + rows).flat_map(|y| (x0..x0 + columns).map(move |x| (x, y))) {
                let sampler =
                    Sampler::new(seed, 0, u64::from(y) * 1000 + u64::from(x), 2 * n + half);
                let u = sampler.wavelength((x, y), (4096, 4096), seed);
                assert!((0.0..1.0).contains(&u));
                hit[(u * count as f64) as usize] += 1;
            }
        }
        hit
    }

    #[test]
    fn wavelengths_are_stratified_over_pixels_and_passes_together() {
        for p in 0..=8 {
            for q in 0..=8 {
                for (start, n0, half, seed) in [((0, 0), 0, 0, 1), ((48, 592), 256 * 5, 1, 99)] {
                    let hit = strata((p, q), start, n0, half, seed);
                    assert!(hit.iter().all(|&h| h == 1), "2^{p} pixels, 2^{q} passes");
                }
            }
        }
    }

    #[test]
    fn times_and_wavelengths_of_a_pixel_are_stratified_together() {
        for (start, half, seed) in [(0, 0, 1), (256, 1, 99)] {
            for a in 0..=8 {
                // boxes of 2^-a by 2^-(8 - a)
                let (columns, rows) = (1 << a, 1 << (8 - a));
                let mut hit = vec![0; 256];
                for n in start..start + 256 {
                    let sampler = Sampler::new(seed, 0, 77, 2 * n + half);
                    let (u, v) = (sampler.wavelength((7, 5), (64, 64), seed), sampler.time());
                    assert!((0.0..1.0).contains(&v));
                    let cell = |u: f64, count: usize| (u * count as f64) as usize;
                    hit[cell(u, columns) * rows + cell(v, rows)] += 1;
                }
                assert!(hit.iter().all(|&h| h == 1), "{columns} x {rows}: {hit:?}");
            }
        }
    }

    #[test]
    fn one_pass_of_a_single_row_has_all_wavelengths() {
        let mut hit = vec![0; 64];
        for x in 0..64 {
            let u = Sampler::new(5, 0, u64::from(x), 0).wavelength((x, 0), (64, 1), 5);
            hit[(u * 64.0) as usize] += 1;
        }
        assert_eq!(hit, [1; 64]);
    }

    #[test]
    fn wavelengths_of_a_pixel_are_uniform_over_seeds_and_the_halves_are_independent() {
        let (seeds, cells) = (64_000, 8);
        let mut joint = vec![0.0; cells * cells];
        for seed in 0..seeds {
            let u = [0, 1].map(|pass| {
                Sampler::new(seed, 0, 123, pass).wavelength((3, 2), (64, 64), seed) * cells as f64
            });
            joint[u[0] as usize * cells + u[1] as usize] += 1.0;
        }
        // chi-squared with 63 degrees of freedom: 5 standard deviations above the mean
        let expected = seeds as f64 / joint.len() as f64;
        let chi2: f64 = joint
            .iter()
            .map(|n: &f64| (n - expected).powi(2) / expected)
            .sum();
        assert!(chi2 < 63.0 + 5.0 * 126_f64.sqrt(), "{chi2}");
    }
}
