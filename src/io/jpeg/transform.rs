//! The inverse cosine transform of a block in integers.
//!
//! C. Loeffler, A. Ligtenberg, G. Moschytz, "Practical Fast 1-D DCT Algorithms with 11
//! Multiplications", ICASSP 1989, with constants of 13 bits, and 2 bits more between the columns
//! and the rows: the arithmetic of libjpeg's accurate integer transform, so that results are the
//! same to the bit.

const BITS: u32 = 13;
const BETWEEN: u32 = 2;

/// A constant in 13 bits.
const fn fixed(value: f64) -> i64 {
    (value * (1 << BITS) as f64 + 0.5) as i64
}

/// Eight outputs, scaled by 2^13.
fn line(v: [i64; 8]) -> [i64; 8] {
    // even part: a rotation of 2 and 6, a butterfly of 0 and 4
    let turn = (v[2] + v[6]) * fixed(0.541_196_100);
    let low = turn - v[6] * fixed(1.847_759_065);
    let high = turn + v[2] * fixed(0.765_366_865);
    let (sum, difference) = ((v[0] + v[4]) << BITS, (v[0] - v[4]) << BITS);
    let even = [sum + high, difference + low, difference - low, sum - high];
    // odd part
    let [a, b, c, d] = [v[7], v[5], v[3], v[1]];
    let all = (a + c + b + d) * fixed(1.175_875_602);
    let ad = -(a + d) * fixed(0.899_976_223);
    let bc = -(b + c) * fixed(2.562_915_447);
    let ac = all - (a + c) * fixed(1.961_570_560);
    let bd = all - (b + d) * fixed(0.390_180_644);
    let odd = [
        d * fixed(1.501_321_110) + ad + bd,
        c * fixed(3.072_711_026) + bc + ac,
        b * fixed(2.053_119_869) + bc + bd,
        a * fixed(0.298_631_336) + ad + ac,
    ];
    std::array::from_fn(|i| {
        if i < 4 {
            even[i] + odd[i]
        } else {
            even[7 - i] - odd[7 - i]
        }
    })
}

fn rounded(value: i64, bits: u32) -> i64 {
    (value + (1 << (bits - 1))) >> bits
}

/// The samples of a block from its coefficients in natural order.
pub fn samples(block: &[i16; 64], quantization: &[u16; 64]) -> [u8; 64] {
    let mut columns = [[0i64; 8]; 8];
    for (x, column) in columns.iter_mut().enumerate() {
        let input = std::array::from_fn(|y| {
            let i = 8 * y + x;
            i64::from(block[i]) * i64::from(quantization[i])
        });
        *column = line(input).map(|v| rounded(v, BITS - BETWEEN));
    }
    let mut out = [0; 64];
    for (y, row) in out.as_chunks_mut::<8>().0.iter_mut().enumerate() {
        let values = line(std::array::from_fn(|x| columns[x][y]));
        *row = values.map(|v| (rounded(v, BITS + BETWEEN + 3) + 128).clamp(0, 255) as u8);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn agrees_with_the_definition() {
        let mut block = [0i16; 64];
        for (i, v) in block.iter_mut().enumerate() {
            *v = ((i * 7919 % 61) as i16 - 30) / (1 + i as i16 / 8);
        }
        let quantization = std::array::from_fn(|i| 1 + i as u16 / 4);
        let found = samples(&block, &quantization);
        for (i, &value) in found.iter().enumerate() {
            let (x, y) = ((i % 8) as f64, (i / 8) as f64);
            // T.81, A.3.3
            let mut sum = 0.0;
            for (k, &c) in block.iter().enumerate() {
                let (u, v) = ((k % 8) as f64, (k / 8) as f64);
                let norm = |f: f64| if f == 0.0 { 0.5f64.sqrt() } else { 1.0 };
                sum += 0.25
                    * norm(u)
                    * norm(v)
                    * f64::from(c)
                    * f64::from(quantization[k])
                    * ((2.0 * x + 1.0) * u * PI / 16.0).cos()
                    * ((2.0 * y + 1.0) * v * PI / 16.0).cos();
            }
            let exact = (sum + 128.0).clamp(0.0, 255.0);
            assert!(
                (f64::from(value) - exact).abs() <= 1.0,
                "{i}: {value} {exact}"
            );
        }
    }
}
