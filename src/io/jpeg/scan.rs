//! Scans: the blocks of one or several components, whole or by bands and bits (T.81, annexes F and
//! G).

use super::bits::{Bits, Huffman};
use super::segments::{Segments, ZIGZAG};
use super::{Component, Frame};

/// A component in a scan.
pub struct Part {
    pub component: usize,
    dc: usize,
    ac: usize,
}

/// A scan header.
pub struct Scan {
    pub parts: Vec<Part>,
    /// First and last coefficient, in zigzag order.
    band: [usize; 2],
    /// Bits that were and that are still to come.
    high: u8,
    low: u8,
}

/// Most blocks of a unit (T.81, B.2.3).
const MAX_UNIT: usize = 10;

impl Scan {
    pub fn parse(body: &[u8], frame: &Frame) -> Result<Self, String> {
        let damaged = || "a scan header is damaged".to_owned();
        let (&count, rest) = body.split_first().ok_or_else(damaged)?;
        let (named, rest) = rest
            .split_at_checked(2 * usize::from(count))
            .ok_or_else(damaged)?;
        let mut parts: Vec<Part> = Vec::new();
        for &[id, tables] in named.as_chunks::<2>().0 {
            let component = frame.components.iter().position(|c| c.id == id);
            let component = component.ok_or_else(damaged)?;
            if parts.iter().any(|p| p.component == component) {
                return Err(damaged());
            }
            parts.push(Part {
                component,
                dc: (tables >> 4).into(),
                ac: (tables & 15).into(),
            });
        }
        let &[first, last, bits, ..] = rest else {
            return Err(damaged());
        };
        let (high, low) = (bits >> 4, bits & 15);
        let unit = |p: &Part| frame.components[p.component].h * frame.components[p.component].v;
        let blocks: usize = parts.iter().map(unit).sum();
        if parts.is_empty() || parts.len() > 1 && blocks > MAX_UNIT {
            return Err(damaged());
        }
        let band = [first.into(), last.into()];
        if !frame.progressive {
            // some writers leave zeros here
            let band = [0, 63];
            return Ok(Self {
                parts,
                band,
                high: 0,
                low: 0,
            });
        }
        let dc = first == 0;
        let ordered = last <= 63 && first <= last && (!dc || last == 0);
        if !ordered || !dc && parts.len() > 1 || low > 13 || high > 0 && high != low + 1 {
            return Err(damaged());
        }
        Ok(Self {
            parts,
            band,
            high,
            low,
        })
    }

    /// Notes the bits that a component gets; refused where they do not follow those that it had.
    fn enter(&self, component: &mut Component) -> Result<(), String> {
        for bits in &mut component.missing_bits[self.band[0]..=self.band[1]] {
            let follows = match self.high {
                0 => *bits < 0,
                high => *bits == high as i8,
            };
            if !follows {
                return Err("its scans are out of order".to_owned());
            }
            *bits = self.low as i8;
        }
        Ok(())
    }
}

/// State that the blocks of a component share while a scan is read.
struct Decoder<'t> {
    dc: Option<&'t Huffman>,
    ac: Option<&'t Huffman>,
    prediction: i32,
}

/// Decodes a scan that begins at `start`; gives where its data end.
pub fn decode(
    scan: &Scan,
    frame: &mut Frame,
    segments: &Segments,
    bytes: &[u8],
    start: usize,
) -> Result<usize, String> {
    let mut decoders = Vec::new();
    for part in &scan.parts {
        scan.enter(&mut frame.components[part.component])?;
        decoders.push(Decoder {
            dc: segments.dc.get(part.dc).and_then(Option::as_ref),
            ac: segments.ac.get(part.ac).and_then(Option::as_ref),
            prediction: 0,
        });
    }
    let units = match scan.parts.as_slice() {
        [only] => frame.components[only.component].own_blocks,
        _ => [
            frame.width.div_ceil(8 * frame.h_max),
            frame.height.div_ceil(8 * frame.v_max),
        ],
    };
    let mut bits = Bits::new(bytes, start);
    let mut run = 0;
    let mut restarts = 0u8;
    for unit in 0..units[0] * units[1] {
        if segments.restart > 0 && unit > 0 && unit % segments.restart == 0 {
            let at = bits.marker()?;
            if bytes.get(at..at + 2) != Some(&[0xff, 0xd0 + restarts]) {
                return Err("a restart marker is missing".to_owned());
            }
            restarts = (restarts + 1) % 8;
            bits = Bits::new(bytes, at + 2);
            run = 0;
            for decoder in &mut decoders {
                decoder.prediction = 0;
            }
        }
        let (column, row) = (unit % units[0], unit / units[0]);
        for (part, decoder) in scan.parts.iter().zip(&mut decoders) {
            let component = &mut frame.components[part.component];
            let (h, v) = match scan.parts.len() {
                1 => (1, 1),
                _ => (component.h, component.v),
            };
            for j in 0..v {
                for i in 0..h {
                    let at = (row * v + j) * component.stride + column * h + i;
                    let block = &mut component.blocks[at];
                    if frame.progressive {
                        decoder.step(scan, &mut bits, &mut run, block)?;
                    } else {
                        decoder.whole(&mut bits, block)?;
                    }
                }
            }
        }
    }
    bits.marker()
}

fn table(table: Option<&Huffman>) -> Result<&Huffman, String> {
    table.ok_or_else(|| "a Huffman table is missing".to_owned())
}

fn outside() -> String {
    "a block has more than 64 coefficients".to_owned()
}

impl Decoder<'_> {
    fn dc(&mut self, bits: &mut Bits) -> Result<i32, String> {
        let size = bits.symbol(table(self.dc)?)?;
        if size > 15 {
            return Err("a difference of more than 15 bits".to_owned());
        }
        self.prediction = self.prediction.wrapping_add(bits.signed(size.into())?);
        Ok(self.prediction)
    }

    fn whole(&mut self, bits: &mut Bits, block: &mut [i16; 64]) -> Result<(), String> {
        block[0] = self.dc(bits)? as i16;
        let ac = table(self.ac)?;
        let mut k = 1;
        while k < 64 {
            let symbol = bits.symbol(ac)?;
            let (zeros, size) = (usize::from(symbol >> 4), u32::from(symbol & 15));
            if size == 0 {
                if zeros < 15 {
                    break;
                }
                k += 16;
                continue;
            }
            k += zeros;
            let place = *ZIGZAG.get(k).ok_or_else(outside)?;
            block[place] = bits.signed(size)? as i16;
            k += 1;
        }
        if k > 64 { Err(outside()) } else { Ok(()) }
    }

    /// One block of a scan of some coefficients and bits. `run`: blocks without further ones, from
    /// a code before.
    fn step(
        &mut self,
        scan: &Scan,
        bits: &mut Bits,
        run: &mut u32,
        block: &mut [i16; 64],
    ) -> Result<(), String> {
        match (scan.band[0] == 0, scan.high == 0) {
            (true, true) => block[0] = self.dc(bits)?.wrapping_shl(scan.low.into()) as i16,
            (true, false) => block[0] |= (bits.take(1)? << scan.low) as i16,
            (false, true) => return self.first_bits(scan, bits, run, block),
            (false, false) => return self.next_bit(scan, bits, run, block),
        }
        Ok(())
    }

    fn first_bits(
        &self,
        scan: &Scan,
        bits: &mut Bits,
        run: &mut u32,
        block: &mut [i16; 64],
    ) -> Result<(), String> {
        if *run > 0 {
            *run -= 1;
            return Ok(());
        }
        let ac = table(self.ac)?;
        let mut k = scan.band[0];
        while k <= scan.band[1] {
            let symbol = bits.symbol(ac)?;
            let (zeros, size) = (symbol >> 4, symbol & 15);
            if size == 0 {
                if zeros < 15 {
                    *run = (1 << zeros) - 1 + bits.take(zeros.into())? as u32;
                    return Ok(());
                }
                k += 16;
                continue;
            }
            k += usize::from(zeros);
            if k > scan.band[1] {
                return Err(outside());
            }
            block[ZIGZAG[k]] = bits.signed(size.into())?.wrapping_shl(scan.low.into()) as i16;
            k += 1;
        }
        Ok(())
    }

    fn next_bit(
        &self,
        scan: &Scan,
        bits: &mut Bits,
        run: &mut u32,
        block: &mut [i16; 64],
    ) -> Result<(), String> {
        let bit = 1i16 << scan.low;
        let correct = |value: &mut i16, bits: &mut Bits| -> Result<(), String> {
            if bits.take(1)? != 0 && *value & bit == 0 {
                *value = value.wrapping_add(if *value < 0 { -bit } else { bit });
            }
            Ok(())
        };
        let mut k = scan.band[0];
        if *run == 0 {
            let ac = table(self.ac)?;
            while k <= scan.band[1] {
                let symbol = bits.symbol(ac)?;
                let (mut zeros, size) = (symbol >> 4, symbol & 15);
                let mut new = 0;
                match size {
                    0 if zeros < 15 => {
                        *run = (1 << zeros) + bits.take(zeros.into())? as u32;
                        break;
                    }
                    0 => {}
                    1 => new = if bits.take(1)? != 0 { bit } else { -bit },
                    _ => return Err("a new coefficient of more than one bit".to_owned()),
                }
                while k <= scan.band[1] {
                    let value = &mut block[ZIGZAG[k]];
                    k += 1;
                    if *value != 0 {
                        correct(value, bits)?;
                    } else if zeros == 0 {
                        *value = new;
                        break;
                    } else {
                        zeros -= 1;
                    }
                }
            }
        }
        if *run > 0 {
            for place in ZIGZAG.get(k..=scan.band[1]).unwrap_or_default() {
                let value = &mut block[*place];
                if *value != 0 {
                    correct(value, bits)?;
                }
            }
            *run -= 1;
        }
        Ok(())
    }
}
