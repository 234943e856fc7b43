//! The Owen-scrambled Sobol' sequence of `sobol_burley`, four dimensions at a time: the same
//! numbers, with the generator matrices applied to four digits of an index at once.

use super::STRATIFIED;
use sobol_burley::parts::{
    Int4, hash, hash_int4, owen_scramble_int4_rev, owen_scramble_rev, sobol_int4_rev,
};
use std::sync::LazyLock;

/// Sums of columns of the matrices of a set, for each value of each four of the sixteen digits of
/// an index.
type Table = [[Int4; 16]; 4];

static TABLES: LazyLock<Vec<Table>> = LazyLock::new(|| (0..STRATIFIED as u32).map(table).collect());

fn table(set: u32) -> Table {
    std::array::from_fn(|four| {
        std::array::from_fn(|digits| sobol_int4_rev((digits as u32) << (16 + 4 * four), set))
    })
}

/// Four dimensions of element `index` (below 2^16) of the sequence scrambled by `seed`: what
/// [`sobol_burley::sample_4d`] gives.
#[inline]
pub(super) fn sample(index: u32, set: u32, seed: u32) -> [f32; 4] {
    let shuffled = owen_scramble_rev(index.reverse_bits(), hash(seed ^ 0x79c6_8e4a));
    let table = &TABLES[set as usize];
    let four = |i: usize| table[i][(shuffled >> (16 + 4 * i) & 15) as usize];
    let digits = four(0) ^ four(1) ^ four(2) ^ four(3);
    let key: Int4 = [seed.wrapping_mul(0x9c8f_2d3b) ^ set; 4].into();
    let key = key ^ [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8].into();
    owen_scramble_int4_rev(digits, hash_int4(key))
        .reverse_bits()
        .to_f32_norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::random_bits;

    #[test]
    fn numbers_are_those_of_the_plain_sequence() {
        for case in 0..20_000u64 {
            let bits = random_bits(case, 1);
            let index = bits as u32 & 0xffff;
            let (set, seed) = (case as u32 % STRATIFIED as u32, (bits >> 32) as u32);
            let want = sobol_burley::sample_4d(index, set, seed);
            assert_eq!(sample(index, set, seed), want, "{index} {set} {seed}");
        }
    }
}
