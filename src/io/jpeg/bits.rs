//! Bits of a scan and the Huffman codes in them.

/// Bits that a table looks up at once.
const FAST: u32 = 9;

/// Reads bits up to the next marker.
pub struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    held: u64,
    count: u32,
}

/// A scan that ends before its last block.
pub const CUT: &str = "a scan is cut short";

impl<'a> Bits<'a> {
    pub fn new(bytes: &'a [u8], at: usize) -> Self {
        Self {
            bytes,
            at,
            held: 0,
            count: 0,
        }
    }

    fn fill(&mut self) {
        while self.count <= 56 {
            let Some(&byte) = self.bytes.get(self.at) else {
                return;
            };
            if byte == 0xff {
                // a zero follows a byte of data, else it is a marker
                if self.bytes.get(self.at + 1) != Some(&0) {
                    return;
                }
                self.at += 1;
            }
            self.at += 1;
            self.held |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    fn drop(&mut self, n: u32) -> Result<(), String> {
        if n > self.count {
            return Err(CUT.to_owned());
        }
        self.held <<= n;
        self.count -= n;
        Ok(())
    }

    /// The next `n` bits, at most 16.
    pub fn take(&mut self, n: u32) -> Result<i32, String> {
        if n == 0 {
            return Ok(0);
        }
        if self.count < n {
            self.fill();
        }
        let value = (self.held >> (64 - n)) as i32;
        self.drop(n)?;
        Ok(value)
    }

    /// A number of `n` bits with its sign (T.81, F.2.2.1).
    pub fn signed(&mut self, n: u32) -> Result<i32, String> {
        let value = self.take(n)?;
        Ok(if n > 0 && value < 1 << (n - 1) {
            value - (1 << n) + 1
        } else {
            value
        })
    }

    /// The next symbol of a code.
    pub fn symbol(&mut self, code: &Huffman) -> Result<u8, String> {
        if self.count < 16 {
            self.fill();
        }
        let (length, symbol) = code.fast[(self.held >> (64 - FAST)) as usize];
        if length > 0 {
            self.drop(length.into())?;
            return Ok(symbol);
        }
        let ahead = (self.held >> 48) as u32;
        for length in FAST + 1..=16 {
            let word = ahead >> (16 - length);
            if let Some(index) = code.index(word, length) {
                self.drop(length)?;
                return Ok(code.symbols[index]);
            }
        }
        Err(if self.count < 16 {
            CUT
        } else {
            "a code that no table has"
        }
        .to_owned())
    }

    /// Where the marker after the bits stands: padding is passed over.
    ///
    /// # Errors
    /// More data is there than blocks.
    pub fn marker(&self) -> Result<usize, String> {
        if self.count >= 8 || self.bytes.get(self.at).is_some_and(|&b| b != 0xff) {
            return Err("a scan has more data than blocks".to_owned());
        }
        Ok(self.at)
    }
}

/// A Huffman code (T.81, annex C).
#[derive(Clone, Debug)]
pub struct Huffman {
    /// Length and symbol by the next bits; length 0: a longer code.
    fast: Vec<(u8, u8)>,
    symbols: Vec<u8>,
    /// By length: the first code, its index, and how many there are.
    ranges: [(u32, usize, u32); 17],
}

impl Huffman {
    /// The code with `counts[i]` words of length i + 1.
    pub fn new(counts: &[u8; 16], symbols: &[u8]) -> Result<Self, String> {
        let mut fast = vec![(0, 0); 1 << FAST];
        let mut ranges = [(0, 0, 0); 17];
        let (mut word, mut index) = (0u32, 0usize);
        for (length, &count) in (1u32..).zip(counts) {
            ranges[length as usize] = (word, index, count.into());
            for _ in 0..count {
                if word >> length != 0 {
                    return Err("a Huffman table with too many codes".to_owned());
                }
                if length <= FAST {
                    let first = (word << (FAST - length)) as usize;
                    let same = 1usize << (FAST - length);
                    fast[first..first + same].fill((length as u8, symbols[index]));
                }
                word += 1;
                index += 1;
            }
            word <<= 1;
        }
        Ok(Self {
            fast,
            symbols: symbols.to_vec(),
            ranges,
        })
    }

    fn index(&self, word: u32, length: u32) -> Option<usize> {
        let (first, index, count) = self.ranges[length as usize];
        let offset = word.checked_sub(first)?;
        (offset < count).then(|| index + offset as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_all_lengths() {
        // 0, 10, and one code of 12 bits: 110000000000
        let mut counts = [0; 16];
        (counts[0], counts[1], counts[11]) = (1, 1, 1);
        let code = Huffman::new(&counts, &[7, 8, 9]).expect("valid");
        let bytes = [0b0101_1000, 0b0000_0000, 0xff, 0x00, 0xff, 0xd9];
        let mut bits = Bits::new(&bytes, 0);
        let symbols: Vec<u8> = (0..3).map(|_| bits.symbol(&code).expect("there")).collect();
        assert_eq!(symbols, [7, 8, 9]);
        // the rest of the second byte, then a byte with its stuffed zero
        assert_eq!(bits.take(9), Ok(0b0_1111_1111));
        assert_eq!(bits.take(1), Err(CUT.to_owned()));
        assert_eq!(bits.marker(), Ok(4));
        counts[0] = 3;
        assert!(Huffman::new(&counts, &[0; 8]).is_err());
    }

    #[test]
    fn signs() {
        let mut bits = Bits::new(&[0b0101_1000], 0);
        assert_eq!(bits.signed(2), Ok(-2));
        assert_eq!(bits.signed(2), Ok(-2));
        assert_eq!(bits.signed(1), Ok(1));
        assert_eq!(bits.signed(0), Ok(0));
    }
}
