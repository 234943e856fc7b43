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

/// Place of `i` in a random permutation of 0..`n`, one for each key: a bijection of the numbers of
/// as many bits, again and again until it leads into the range (Black and Rogaway 2002). `i < n`.
#[must_use]
pub fn permuted(i: u64, n: u64, key: u64) -> u64 {
    debug_assert!(i < n && n <= 1 << 62);
    let bits = u64::BITS - n.saturating_sub(1).leading_zeros();
    if bits == 0 {
        return 0;
    }
    let mask = u64::MAX >> (u64::BITS - bits);
    // odd factors, sums and shifts to the right are bijections of so many bits
    let shift = bits.div_ceil(2);
    let mut x = i;
    loop {
        for round in 0..4 {
            let word = random_bits(key, round);
            x = x.wrapping_add(word) & mask;
            x ^= x >> shift;
            x = x.wrapping_mul(word >> 32 | 1) & mask;
            x ^= x >> shift;
        }
        if x < n {
            return x;
        }
    }
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
    let mut hash = ByteHash::new(bytes.len() as u64);
    hash.add(bytes);
    hash.finish()
}

/// [`hash_bytes`] of bytes that come piece by piece.
#[derive(Clone, Debug)]
pub struct ByteHash {
    hash: u64,
    /// Bytes that are not a whole word yet.
    word: [u8; 8],
    filled: usize,
}

impl ByteHash {
    /// For so many bytes in all.
    #[must_use]
    pub fn new(length: u64) -> Self {
        Self {
            hash: length,
            word: [0; 8],
            filled: 0,
        }
    }

    /// Adds the next bytes.
    pub fn add(&mut self, mut bytes: &[u8]) {
        if self.filled == 0 {
            let (words, rest) = bytes.as_chunks();
            for word in words {
                self.hash = combine(self.hash, u64::from_le_bytes(*word));
            }
            bytes = rest;
        }
        while !bytes.is_empty() {
            let (now, rest) = bytes.split_at(bytes.len().min(8 - self.filled));
            self.word[self.filled..self.filled + now.len()].copy_from_slice(now);
            self.filled += now.len();
            bytes = rest;
            if self.filled == 8 {
                self.end_word();
            }
        }
    }

    fn end_word(&mut self) {
        self.hash = combine(self.hash, u64::from_le_bytes(self.word));
        (self.word, self.filled) = ([0; 8], 0);
    }

    /// The hash of all bytes.
    #[must_use]
    pub fn finish(mut self) -> u64 {
        if self.filled > 0 {
            self.end_word();
        }
        self.hash
    }
}
