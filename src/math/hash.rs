//! Counter-based random numbers: a pure function of a key and a counter; and hashes of bytes.

/// The finalizer of SplitMix64 (Steele, Lea, Flood 2014): a bijection of the 64-bit integers whose
/// output bits pass statistical tests when the input counts upwards.
#[must_use]
pub const fn mix64(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A key that depends on every bit of both words, in this order.
#[must_use]
pub const fn combine(a: u64, b: u64) -> u64 {
    mix64(mix64(a.wrapping_add(0x9e37_79b9_7f4a_7c15)) ^ b.wrapping_mul(0xd6e8_feb8_6659_fd93))
}

/// Number `counter` of the stream `key`, as 64 random bits.
#[must_use]
pub const fn random_bits(key: u64, counter: u64) -> u64 {
    mix64(key.wrapping_add(counter.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
}

/// The top 53 of 64 random bits as a number in [0, 1).
#[must_use]
pub fn unit_f64(bits: u64) -> f64 {
    // 2^-53; the shifted integer is exact in f64
    (bits >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
}

/// A hash of a string of bytes, its length included.
#[must_use]
pub fn hash_bytes(bytes: &[u8]) -> u64 {
    bytes.chunks(8).fold(bytes.len() as u64, |hash, chunk| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        combine(hash, u64::from_le_bytes(word))
    })
}
