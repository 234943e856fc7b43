//! Part files: the exact sums of a film after some passes, to be added to others or resumed.
//!
//! Layout, little-endian: magic `abbepart`, u32 version, u32 header length, header (JSON), sums
//! (i128, half by half, row by row, channels innermost), u64 checksum of everything before it.
//! Integer sums: any order of merging gives the same bits.

use super::atomic::{FileError, write_atomic};
use super::files::read_regular;
use super::identity;
use crate::film::Crop;
use crate::math::hash::hash_bytes;
use crate::render::{PilotPasses, Render, Session};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

const MAGIC: [u8; 8] = *b"abbepart";
/// 1 hashed settings by the names of this program's code, and its sums took random numbers in their
/// order of use. 2 did not say how the variance factors of its weights were found.
const VERSION: u32 = 3;
/// Before the header: magic, version, header length.
const PREFIX: usize = 16;
const CHECKSUM: usize = 8;
/// Bytes of one sum.
const SUM: usize = 16;
const MAX_HEADER_BYTES: usize = 1 << 20;
const MAX_PART_BYTES: u64 = 64 << 30;
/// The two half buffers of a film.
const HALVES: u64 = 2;
const MAX_CHANNELS: u32 = 4096;

/// Passes `start..end` that were rendered with one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassRange {
    /// Seed.
    pub seed: u64,
    /// First pass.
    pub start: u64,
    /// One past the last pass.
    pub end: u64,
}

/// Quantity that the sums are of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartHeader {
    /// Program version, for messages.
    pub version: String,
    /// Hash of the scene.
    pub scene_hash: u64,
    /// Hash of all settings that change the estimate but seed and passes.
    pub settings_hash: u64,
    /// Name of the sensor.
    pub sensor: String,
    /// Columns of the whole film.
    pub width: u32,
    /// Rows of the whole film.
    pub height: u32,
    /// Rendered part: x0, y0, x1, y1.
    pub crop: [u32; 4],
    /// Channels per pixel.
    pub channels: u32,
    /// Passes per group of the pilot that found the variance factors of the weights; 0: by rule, or
    /// none.
    pub pilot: u32,
    /// Settings as the image tells them: attribute and text.
    pub image: BTreeMap<String, String>,
    /// Passes in the sums: sorted, disjoint, not touching.
    pub passes: Vec<PassRange>,
}

impl PartHeader {
    /// The rendered part of the film.
    #[must_use]
    pub fn crop(&self) -> Crop {
        let [x0, y0, x1, y1] = self.crop;
        Crop { x0, y0, x1, y1 }
    }

    /// Number of passes in the sums.
    #[must_use]
    pub fn pass_count(&self) -> u64 {
        self.passes
            .iter()
            .map(|p| p.end - p.start)
            .fold(0, u64::saturating_add)
    }

    /// Number of sums; `None` beyond 64 bits.
    fn sum_count(&self) -> Option<u64> {
        self.crop()
            .pixels()
            .checked_mul(u64::from(self.channels))?
            .checked_mul(HALVES)
    }

    fn check(&self) -> Result<(), &'static str> {
        let [x0, y0, x1, y1] = self.crop;
        if x0 >= x1 || y0 >= y1 || x1 > self.width || y1 > self.height {
            return Err("the crop is empty or outside the film");
        }
        if self.channels == 0 || self.channels > MAX_CHANNELS {
            return Err("the number of channels is not 1 to 4096");
        }
        if self.passes.iter().any(|p| p.start >= p.end) {
            return Err("a range of passes is empty");
        }
        // passes are counted in 32 bits
        if self.passes.iter().any(|p| p.end > u64::from(u32::MAX)) {
            return Err("a pass is beyond 2^32 - 2");
        }
        let apart = |w: &[PassRange]| {
            w[0].seed < w[1].seed || w[0].seed == w[1].seed && w[0].end < w[1].start
        };
        if !self.passes.windows(2).all(apart) {
            return Err("ranges of passes are not sorted and apart");
        }
        Ok(())
    }
}

/// A part: header and sums.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Quantity that the sums are of.
    pub header: PartHeader,
    /// Fixed-point sums, half by half, row by row, channels innermost.
    pub sums: Vec<i128>,
}

/// Why parts could not be read, written or merged.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// The file system.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not a part file, or a broken one.
    #[error("{}: not a valid part file ({message})", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Fault, in words.
        message: String,
    },
    /// A render that is not the one that the part is of.
    #[error("{}: cannot resume: {message}", path.display())]
    Resume {
        /// The file.
        path: PathBuf,
        /// Fault, in words.
        message: String,
    },
    /// Parts that do not belong together.
    #[error("parts differ in {what}: {first} and {second}")]
    Mismatch {
        /// Setting that differs.
        what: &'static str,
        /// In the first part.
        first: String,
        /// In the other one.
        second: String,
    },
    /// The same passes twice.
    #[error("passes {}..{} of seed {} are in more than one part", .0.start, .0.end, .0.seed)]
    Overlap(PassRange),
    /// Nothing to merge.
    #[error("no parts to merge")]
    Empty,
    /// Sums left the range of 128 bits.
    #[error("the sums overflow")]
    Overflow,
}

/// The part that a render has done.
#[must_use]
pub fn of(render: &Render) -> Part {
    Part {
        header: identity::header(render),
        sums: render.outputs().image.sums(),
    }
}

/// Continues a session with the passes of a part file.
///
/// # Errors
/// The file cannot be read, is not a valid part, or one of another render.
pub fn resume(session: &mut Session, path: &Path) -> Result<(), PartError> {
    let refused = |message: String| PartError::Resume {
        path: path.to_owned(),
        message,
    };
    let Part { header, sums } = read(path)?;
    {
        // weights as they were, also where this render is longer
        let pilot = session.render().factors().map(|found| found.passes);
        if pilot.is_some_and(|passes| passes.0 != header.pilot) {
            let passes = PilotPasses::known(header.pilot)
                .ok_or_else(|| refused(format!("it names a pilot of {} passes", header.pilot)))?;
            session.repeat_pilot(passes);
        }
    }
    let (expected, seed) = {
        let render = session.render();
        (identity::header(&render), render.settings().seed)
    };
    if header.passes.iter().any(|p| p.seed != seed) {
        return Err(refused(format!(
            "it holds passes of another seed than {seed}"
        )));
    }
    let expected = PartHeader {
        passes: header.passes.clone(),
        ..expected
    };
    if header != expected {
        let what = [
            ("version of the program", header.version == expected.version),
            ("scene", header.scene_hash == expected.scene_hash),
            ("sensor", header.sensor == expected.sensor),
            ("crop", header.crop == expected.crop),
        ];
        let what = what.iter().find(|w| !w.1).map_or("settings", |w| w.0);
        return Err(refused(format!("it was made with another {what}")));
    }
    let ranges = header.passes.iter().map(|p| p.start..p.end);
    let passes: Vec<u32> = ranges.flatten().map(|p| p as u32).collect();
    session
        .restore(&passes, &sums)
        .map_err(|e| refused(e.to_string()))
}

/// Writes a part.
///
/// # Errors
/// The file cannot be written, or the sums do not fit the header.
pub fn write(path: &Path, part: &Part) -> Result<(), PartError> {
    let bytes = encode(part).map_err(|message| PartError::Format {
        path: path.to_owned(),
        message,
    })?;
    Ok(write_atomic(path, |w| w.write_all(&bytes))?)
}

/// Whether a file begins as a part does.
///
/// # Errors
/// The file cannot be opened or read.
pub fn is_part(path: &Path) -> Result<bool, PartError> {
    let begin = || {
        let mut first = Vec::new();
        // a pipe is not even opened: that would wait for a writer
        if !path.metadata()?.is_file() {
            return Ok(false);
        }
        let file = std::fs::File::open(path)?;
        file.take(MAGIC.len() as u64).read_to_end(&mut first)?;
        Ok(first == MAGIC)
    };
    begin().map_err(|e| PartError::from(FileError::new(path, e)))
}

/// Reads a part.
///
/// # Errors
/// The file cannot be read or is not a valid part.
pub fn read(path: &Path) -> Result<Part, PartError> {
    let file_error = |e| PartError::from(FileError::new(path, e));
    let bytes = read_regular(path, MAX_PART_BYTES).map_err(file_error)?;
    decode(&bytes).map_err(|message| PartError::Format {
        path: path.to_owned(),
        message,
    })
}

fn encode(part: &Part) -> Result<Vec<u8>, String> {
    part.header.check()?;
    if part.header.sum_count() != Some(part.sums.len() as u64) {
        return Err(format!("{} sums do not fit the header", part.sums.len()));
    }
    let header = serde_json::to_vec(&part.header).map_err(|e| e.to_string())?;
    let header_len = u32::try_from(header.len()).map_err(|_| "the header is too long")?;
    let mut bytes = Vec::with_capacity(PREFIX + header.len() + SUM * part.sums.len() + CHECKSUM);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(header_len.to_le_bytes());
    bytes.extend(header);
    bytes.extend(part.sums.iter().flat_map(|s| s.to_le_bytes()));
    bytes.extend(hash_bytes(&bytes).to_le_bytes());
    Ok(bytes)
}

fn decode(bytes: &[u8]) -> Result<Part, String> {
    let truncated = || "the file is cut short".to_owned();
    let (prefix, rest) = bytes.split_at_checked(PREFIX).ok_or_else(truncated)?;
    if prefix[..8] != MAGIC {
        return Err("no part file begins like this".to_owned());
    }
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| prefix[at + i]));
    if word(8) != VERSION {
        let advice = if word(8) < VERSION {
            ": render the passes again"
        } else {
            ""
        };
        return Err(format!(
            "version {}, this program reads version {VERSION}{advice}",
            word(8)
        ));
    }
    let header_len = word(12) as usize;
    if header_len > MAX_HEADER_BYTES {
        return Err(format!(
            "a header of {header_len} bytes, allowed: at most {MAX_HEADER_BYTES}"
        ));
    }
    let (header, rest) = rest.split_at_checked(header_len).ok_or_else(truncated)?;
    let header: PartHeader = serde_json::from_slice(header).map_err(|e| format!("header: {e}"))?;
    header.check()?;
    // the count is bounded by the file's own size before anything of it is allocated
    let expected = header
        .sum_count()
        .and_then(|n| n.checked_mul(SUM as u64))
        .and_then(|n| n.checked_add(CHECKSUM as u64));
    let expected = expected.ok_or("the header promises more sums than any file holds")?;
    if (rest.len() as u64) < expected {
        return Err(truncated());
    }
    if rest.len() as u64 > expected {
        return Err("there is more after the last sum".to_owned());
    }
    let (body, checksum) = bytes.split_at(bytes.len() - CHECKSUM);
    if hash_bytes(body).to_le_bytes() != checksum {
        return Err("the checksum does not match: the file is damaged".to_owned());
    }
    let (sums, _) = rest[..rest.len() - CHECKSUM].as_chunks::<SUM>();
    Ok(Part {
        header,
        sums: sums.iter().map(|s| i128::from_le_bytes(*s)).collect(),
    })
}

/// Adds up parts of disjoint passes of the same scene, settings, sensor and crop. The order does
/// not matter.
///
/// # Errors
/// Parts that differ, overlap, or whose sums overflow.
pub fn merge(parts: impl IntoIterator<Item = Part>) -> Result<Part, PartError> {
    let mut parts = parts.into_iter();
    let mut total = parts.next().ok_or(PartError::Empty)?;
    for part in parts {
        check_same(&total.header, &part.header)?;
        for (sum, more) in total.sums.iter_mut().zip(&part.sums) {
            *sum = sum.checked_add(*more).ok_or(PartError::Overflow)?;
        }
        total.header.passes = join(&total.header.passes, &part.header.passes)?;
    }
    Ok(total)
}

fn check_same(a: &PartHeader, b: &PartHeader) -> Result<(), PartError> {
    let differ = |what, first: String, second: String| {
        if first == second {
            Ok(())
        } else {
            Err(PartError::Mismatch {
                what,
                first,
                second,
            })
        }
    };
    differ(
        "scene (hash)",
        format!("{:016x}", a.scene_hash),
        format!("{:016x}", b.scene_hash),
    )?;
    differ(
        "settings (hash)",
        format!("{:016x}", a.settings_hash),
        format!("{:016x}", b.settings_hash),
    )?;
    differ("sensor", a.sensor.clone(), b.sensor.clone())?;
    differ(
        "size",
        format!("{} x {}", a.width, a.height),
        format!("{} x {}", b.width, b.height),
    )?;
    differ("crop", format!("{:?}", a.crop), format!("{:?}", b.crop))?;
    differ("channels", a.channels.to_string(), b.channels.to_string())?;
    differ(
        "passes of the pilot",
        a.pilot.to_string(),
        b.pilot.to_string(),
    )
}

/// The union of two lists of ranges: sorted, touching ranges joined.
fn join(a: &[PassRange], b: &[PassRange]) -> Result<Vec<PassRange>, PartError> {
    let mut all: Vec<PassRange> = a.iter().chain(b).copied().collect();
    all.sort_unstable();
    let mut joined: Vec<PassRange> = Vec::new();
    for range in all {
        match joined.last_mut().filter(|last| last.seed == range.seed) {
            Some(last) if range.start < last.end => {
                return Err(PartError::Overlap(PassRange {
                    end: range.end.min(last.end),
                    ..range
                }));
            }
            Some(last) if range.start == last.end => last.end = range.end,
            _ => joined.push(range),
        }
    }
    Ok(joined)
}

/// Decodes any bytes as a part: must not panic.
pub fn fuzz_part(bytes: &[u8]) {
    _ = decode(bytes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn part(seed: u64, start: u64, end: u64, value: i128) -> Part {
        let header = PartHeader {
            version: "0.1.0".to_owned(),
            scene_hash: 1,
            settings_hash: 2,
            sensor: "main".to_owned(),
            width: 4,
            height: 3,
            crop: [1, 0, 3, 2],
            channels: 3,
            pilot: 0,
            image: BTreeMap::from([("integrator".to_owned(), "bdpt".to_owned())]),
            passes: vec![PassRange { seed, start, end }],
        };
        Part {
            header,
            sums: (0..24).map(|i| value + i).collect(),
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("a.part");
        let p = part(u64::MAX, 0, 8, i128::MIN);
        write(&path, &p).expect("writes");
        assert_eq!(read(&path).expect("reads"), p);
    }

    proptest! {
        #[test]
        fn merging_is_order_free(values in proptest::collection::vec(-1_000_000_i128..1_000_000, 4), swap in 0..24_usize) {
            let mut parts: Vec<Part> =
                values.iter().enumerate().map(|(i, v)| part(i as u64 / 3, 4 * i as u64, 4 * i as u64 + 4, *v)).collect();
            let ordered = merge(parts.clone()).expect("disjoint");
            let last = parts.remove(swap % 4);
            parts.insert(swap % 3, last);
            prop_assert_eq!(&merge(parts).expect("disjoint"), &ordered);
            let expected = [PassRange { seed: 0, start: 0, end: 12 }, PassRange { seed: 1, start: 12, end: 16 }];
            prop_assert_eq!(&ordered.header.passes[..], &expected[..]);
            prop_assert_eq!(ordered.sums[5], values.iter().sum::<i128>() + 20);
            prop_assert_eq!(ordered.header.pass_count(), 16);
        }
    }

    #[test]
    fn overlap_and_strangers_are_refused() {
        let text = |a: &Part, b: &Part| {
            merge([a.clone(), b.clone()])
                .expect_err("refused")
                .to_string()
        };
        let a = part(7, 0, 8, 0);
        assert_eq!(
            text(&a, &part(7, 6, 10, 0)),
            "passes 6..8 of seed 7 are in more than one part"
        );
        assert!(
            merge([a.clone(), part(8, 6, 10, 0)]).is_ok(),
            "another seed is other passes"
        );
        let mut b = part(7, 8, 9, 0);
        b.header.scene_hash = 0x10;
        assert_eq!(
            text(&a, &b),
            "parts differ in scene (hash): 0000000000000001 and 0000000000000010"
        );
        assert!(matches!(
            merge([part(1, 0, 1, i128::MAX - 23), part(1, 1, 2, 1)]),
            Err(PartError::Overflow)
        ));
        assert!(matches!(merge([]), Err(PartError::Empty)));
    }

    #[test]
    fn other_versions_are_refused_by_name() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("old.part");
        let mut bytes = encode(&part(1, 0, 2, 5)).expect("valid");
        bytes[8..12].copy_from_slice(&2_u32.to_le_bytes());
        std::fs::write(&path, bytes).expect("writes");
        let message = read(&path).expect_err("refused").to_string();
        let expected = format!(
            "{}: not a valid part file (version 2, this program reads version 3: render the passes again)",
            path.display()
        );
        assert_eq!(message, expected);
    }

    #[test]
    fn damage_is_noticed() {
        let bytes = encode(&part(1, 0, 2, 5)).expect("valid");
        assert!(decode(&bytes).is_ok());
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "cut to {length}");
        }
        for i in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[i] ^= 1;
            assert!(decode(&damaged).is_err(), "byte {i}");
        }
        let mut bomb = part(1, 0, 2, 5);
        (bomb.header.width, bomb.header.height, bomb.header.crop) =
            (u32::MAX, u32::MAX, [0, 0, u32::MAX, u32::MAX]);
        assert!(encode(&bomb).is_err());
    }
}
