//! The markers of a file and what their segments say (T.81, annex B).

use super::bits::Huffman;
use super::scan::{self, Scan};
use super::{Component, Frame};

/// Places of coefficients in zigzag order (T.81, figure A.6).
pub const ZIGZAG: [usize; 64] = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20,
    13, 6, 7, 14, 21, 28, 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59,
    52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63,
];
/// Most scans: a file of a progressive image has some ten.
const MAX_SCANS: usize = 500;

/// Colors by Adobe's marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adobe {
    pub transform: u8,
}

/// The pieces of an ICC profile by their number from 1.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    pieces: Vec<(u8, Vec<u8>)>,
    of: u8,
}

impl Profile {
    pub fn assemble(mut self) -> Result<Option<Vec<u8>>, String> {
        if self.pieces.is_empty() {
            return Ok(None);
        }
        self.pieces.sort_by_key(|p| p.0);
        let numbers = self.pieces.iter().map(|p| p.0);
        if !numbers.eq(1..=self.of) {
            return Err("pieces of its ICC profile are missing".to_owned());
        }
        Ok(Some(self.pieces.into_iter().flat_map(|p| p.1).collect()))
    }
}

/// All that was read.
#[derive(Default)]
pub struct Segments {
    pub frame: Option<Frame>,
    pub jfif: bool,
    pub adobe: Option<Adobe>,
    pub profile: Profile,
    quantization: [Option<[u16; 64]>; 4],
    pub dc: [Option<Huffman>; 4],
    pub ac: [Option<Huffman>; 4],
    /// Units between restart markers; 0: none.
    pub restart: usize,
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let pair = bytes.get(at..)?.first_chunk::<2>()?;
    Some(u16::from_be_bytes(*pair).into())
}

fn cut() -> String {
    "it is cut short".to_owned()
}

impl Segments {
    pub fn read(
        bytes: &[u8],
        accept: impl Fn(u64, u64) -> Result<(), String>,
    ) -> Result<Self, String> {
        let mut all = Self::default();
        let mut at = 2;
        let mut scans = 0;
        loop {
            // markers may be preceded by any number of fill bytes; other bytes between segments say
            // nothing
            while *bytes.get(at).ok_or_else(cut)? != 0xff {
                at += 1;
            }
            while *bytes.get(at).ok_or_else(cut)? == 0xff {
                at += 1;
            }
            let marker = bytes[at];
            at += 1;
            match marker {
                0xd9 => return Ok(all),
                // no segment follows these
                0x00 | 0x01 | 0xd0..=0xd8 => continue,
                _ => {}
            }
            let length = word(bytes, at).ok_or_else(cut)?;
            let end = at + length;
            let body = bytes.get(at + 2..end).ok_or_else(cut)?;
            at = end;
            match marker {
                0xc0..=0xc2 => all.frame(body, marker == 0xc2, &accept)?,
                0xc4 => all.huffman(body)?,
                0xda => {
                    scans += 1;
                    if scans > MAX_SCANS {
                        return Err(format!("more than {MAX_SCANS} scans"));
                    }
                    at = all.scan(body, bytes, end)?;
                }
                0xdb => all.quantization(body)?,
                0xdd => all.restart = word(body, 0).ok_or_else(cut)?,
                0xe0 if body.starts_with(b"JFIF\0") => all.jfif = true,
                0xe2 if body.starts_with(b"ICC_PROFILE\0") => {
                    if let Some(&[number, of, ref piece @ ..]) = body.get(12..) {
                        all.profile.of = of;
                        all.profile.pieces.push((number, piece.to_vec()));
                    }
                }
                0xee if body.starts_with(b"Adobe") => {
                    all.adobe = body.get(11).map(|&transform| Adobe { transform });
                }
                0xe0..=0xef | 0xfe => {}
                other => return Err(refused(other)),
            }
        }
    }

    fn frame(
        &mut self,
        body: &[u8],
        progressive: bool,
        accept: impl Fn(u64, u64) -> Result<(), String>,
    ) -> Result<(), String> {
        if self.frame.is_some() {
            return Err("a second frame".to_owned());
        }
        let &[bits, _, _, _, _, count, ref rest @ ..] = body else {
            return Err(cut());
        };
        if bits != 8 {
            return Err(format!("{bits} bits a sample (allowed: 8)"));
        }
        let (height, width) = (
            word(body, 1).ok_or_else(cut)?,
            word(body, 3).ok_or_else(cut)?,
        );
        if height == 0 {
            return Err("its height stands after the first scan (DNL): not read".to_owned());
        }
        accept(width as u64, height as u64)?;
        let (described, _) = rest.as_chunks::<3>();
        if described.len() != usize::from(count) || !matches!(count, 1 | 3 | 4) {
            return Err(format!("{count} components (allowed: 1, 3, 4)"));
        }
        let factors = |both: u8| (usize::from(both >> 4), usize::from(both & 15));
        let h_max = described.iter().map(|c| factors(c[1]).0).max().unwrap_or(1);
        let v_max = described.iter().map(|c| factors(c[1]).1).max().unwrap_or(1);
        let mut components: Vec<Component> = Vec::new();
        for &[id, both, table] in described {
            let (mut h, mut v) = factors(both);
            if !(1..=4).contains(&h) || !(1..=4).contains(&v) {
                return Err(format!("sampling factors {h} and {v} (allowed: 1 to 4)"));
            }
            if h_max % h != 0 || v_max % v != 0 {
                return Err(format!(
                    "sampling factors {h} x {v} beside {h_max} x {v_max}: fractions are not read"
                ));
            }
            if components.iter().any(|c| c.id == id) || table > 3 {
                return Err("its frame header is damaged".to_owned());
            }
            // a single component has blocks in plain order, whatever its factors
            let (h_all, v_all) = if count == 1 {
                (h, v) = (1, 1);
                (1, 1)
            } else {
                (h_max, v_max)
            };
            let own = |size: usize, f: usize, all: usize| (size * f).div_ceil(all).div_ceil(8);
            let units = |size: usize, all: usize| size.div_ceil(8 * all);
            let stride = units(width, h_all) * h;
            let rows = units(height, v_all) * v;
            components.push(Component {
                id,
                h,
                v,
                table: table.into(),
                own_blocks: [own(width, h, h_all), own(height, v, v_all)],
                stride,
                blocks: vec![[0; 64]; stride * rows],
                quantization: None,
                missing_bits: [-1; 64],
            });
        }
        let one = components.len() == 1;
        self.frame = Some(Frame {
            progressive,
            width,
            height,
            h_max: if one { 1 } else { h_max },
            v_max: if one { 1 } else { v_max },
            components,
        });
        Ok(())
    }

    fn huffman(&mut self, mut body: &[u8]) -> Result<(), String> {
        while !body.is_empty() {
            let (head, rest) = body.split_first_chunk::<17>().ok_or_else(cut)?;
            let [which, counts @ ..] = *head;
            let total: usize = counts.iter().map(|&c| usize::from(c)).sum();
            let (symbols, rest) = rest.split_at_checked(total).ok_or_else(cut)?;
            body = rest;
            let tables = if which >> 4 == 0 {
                &mut self.dc
            } else {
                &mut self.ac
            };
            *tables
                .get_mut(usize::from(which & 15))
                .filter(|_| which >> 4 < 2)
                .ok_or("a Huffman table of an unknown number")? =
                Some(Huffman::new(&counts, symbols)?);
        }
        Ok(())
    }

    fn quantization(&mut self, mut body: &[u8]) -> Result<(), String> {
        while let Some((&which, rest)) = body.split_first() {
            let wide = which >> 4 != 0;
            let size = if wide { 128 } else { 64 };
            let (values, rest) = rest.split_at_checked(size).ok_or_else(cut)?;
            body = rest;
            let mut table = [0; 64];
            for (i, place) in ZIGZAG.into_iter().enumerate() {
                table[place] = if wide {
                    u16::from_be_bytes([values[2 * i], values[2 * i + 1]])
                } else {
                    values[i].into()
                };
            }
            *self
                .quantization
                .get_mut(usize::from(which & 15))
                .ok_or("a quantization table of an unknown number")? = Some(table);
        }
        Ok(())
    }

    /// Decodes a scan whose data begin at `start`; gives where they end.
    fn scan(&mut self, body: &[u8], bytes: &[u8], start: usize) -> Result<usize, String> {
        let mut frame = self.frame.take().ok_or("a scan before the frame")?;
        let scan = Scan::parse(body, &frame)?;
        for part in &scan.parts {
            let component = &mut frame.components[part.component];
            if component.quantization.is_none() {
                let table = self.quantization[component.table];
                component.quantization = Some(table.ok_or("a quantization table is missing")?);
            }
        }
        let end = scan::decode(&scan, &mut frame, self, bytes, start)?;
        self.frame = Some(frame);
        Ok(end)
    }
}

/// A marker of a frame that is not read, by name.
fn refused(marker: u8) -> String {
    match marker {
        0xc3 => "lossless JPEG is not read".to_owned(),
        0xc5..=0xc7 => "hierarchical JPEG is not read".to_owned(),
        0xc9..=0xcf => "JPEG with arithmetic code is not read".to_owned(),
        0xdc => "its height stands after the first scan (DNL): not read".to_owned(),
        0xf7 => "JPEG-LS is not read".to_owned(),
        other => format!("marker {other:02x} is not read"),
    }
}
