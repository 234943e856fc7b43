//! The file of a part, little-endian: magic `abbepart`, u32 version, u32 header length, header
//! (JSON), sums (i128, half by half, row by row, channels innermost); of an unfinished pass, where
//! the header names one, the sums of its half and u16 pixels done of each tile; u64 checksum of
//! everything before it.
//!
//! Files are read and written as streams: memory holds the sums once.

use super::{Part, PartError, PartHeader};
use crate::io::atomic::{FileError, write_atomic};
use crate::io::files::open_regular;
use crate::math::hash::ByteHash;
use crate::render::UnfinishedPass;
use crate::render::pass::tile_count;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

const MAGIC: [u8; 8] = *b"abbepart";
/// 1 hashed settings by the names of this program's code, and its sums took random numbers in their
/// order of use. 2 did not say how the variance factors of its weights were found. 3 had whole
/// passes only.
pub(super) const VERSION: u32 = 4;
/// Before the header: magic, version, header length.
const PREFIX: usize = 16;
const CHECKSUM: u64 = 8;
/// Bytes of one sum, and of the number of pixels done of a tile.
const SUM: u64 = 16;
const DONE: u64 = 2;
const MAX_HEADER_BYTES: usize = 1 << 20;
const MAX_PART_BYTES: u64 = 64 << 30;
/// Numbers that are read at once.
const CHUNK: usize = 1 << 12;

/// Writes a part.
///
/// # Errors
/// The file cannot be written, or the sums do not fit the header.
pub fn write(path: &Path, part: &Part) -> Result<(), PartError> {
    let header = header_bytes(part).map_err(|message| PartError::Format {
        path: path.to_owned(),
        message,
    })?;
    Ok(write_atomic(path, |w| encode(part, &header, w))?)
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
    let (file, bytes) = open_regular(path, MAX_PART_BYTES).map_err(file_error)?;
    decode(BufReader::with_capacity(1 << 20, file), bytes).map_err(|fault| match fault {
        Fault::File(e) => file_error(e),
        Fault::Format(message) => PartError::Format {
            path: path.to_owned(),
            message,
        },
    })
}

pub(super) fn header_bytes(part: &Part) -> Result<Vec<u8>, String> {
    part.check()?;
    let mut header = serde_json::to_vec(&part.header).map_err(|e| e.to_string())?;
    // sums on whole words are hashed twice as fast
    let words = (PREFIX + header.len()).next_multiple_of(8);
    header.resize(words - PREFIX, b' ');
    if header.len() > MAX_HEADER_BYTES {
        return Err("the header is too long".to_owned());
    }
    Ok(header)
}

/// Bytes behind the header, the checksum left out; `None` beyond 64 bits.
fn body_bytes(header: &PartHeader) -> Option<u64> {
    let whole = header.sum_count()?.checked_mul(SUM)?;
    if header.unfinished.is_none() {
        return Some(whole);
    }
    let done = tile_count(&header.crop()).checked_mul(DONE)?;
    whole.checked_add(done)?.checked_add(whole / 2)
}

pub(super) fn encode(part: &Part, header: &[u8], w: &mut impl Write) -> io::Result<()> {
    let body = body_bytes(&part.header).ok_or(io::ErrorKind::FileTooLarge)?;
    let mut hash = ByteHash::new((PREFIX + header.len()) as u64 + body);
    let mut put = |bytes: &[u8]| {
        hash.add(bytes);
        w.write_all(bytes)
    };
    put(&MAGIC)?;
    put(&VERSION.to_le_bytes())?;
    put(&(header.len() as u32).to_le_bytes())?;
    put(header)?;
    let unfinished = part.unfinished.as_ref();
    let (done, sums) = unfinished.map_or((&[][..], &[][..]), |u| (&u.done[..], &u.sums[..]));
    let mut bytes = Vec::with_capacity(CHUNK * SUM as usize);
    let mut put_sums = |sums: &[i128]| {
        sums.chunks(CHUNK).try_for_each(|chunk| {
            bytes.clear();
            bytes.extend(chunk.iter().flat_map(|sum| sum.to_le_bytes()));
            put(&bytes)
        })
    };
    put_sums(&part.sums)?;
    put_sums(sums)?;
    done.iter().try_for_each(|d| put(&d.to_le_bytes()))?;
    w.write_all(&hash.finish().to_le_bytes())
}

/// Fault of a file that is read.
#[derive(Debug)]
pub(super) enum Fault {
    /// The file system.
    File(io::Error),
    /// The content, in words.
    Format(String),
}

impl From<&str> for Fault {
    fn from(message: &str) -> Self {
        Self::Format(message.to_owned())
    }
}

impl From<String> for Fault {
    fn from(message: String) -> Self {
        Self::Format(message)
    }
}

impl From<io::Error> for Fault {
    fn from(e: io::Error) -> Self {
        if e.kind() == io::ErrorKind::UnexpectedEof {
            "the file is cut short".into()
        } else {
            Self::File(e)
        }
    }
}

/// Bytes of a file, hashed as they are read.
struct Source<R> {
    reader: R,
    hash: ByteHash,
}

impl<R: Read> Source<R> {
    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), Fault> {
        self.reader.read_exact(bytes)?;
        self.hash.add(bytes);
        Ok(())
    }

    /// So many numbers of `N` bytes. Their count has been compared with the size of the file.
    fn numbers<const N: usize, T>(
        &mut self,
        count: u64,
        number: impl Fn([u8; N]) -> T,
    ) -> Result<Vec<T>, Fault> {
        let mut left = usize::try_from(count).map_err(|_| "more sums than this machine holds")?;
        let mut numbers = Vec::with_capacity(left);
        let mut chunk = [[0; N]; CHUNK];
        while left > 0 {
            let now = left.min(CHUNK);
            self.fill(chunk[..now].as_flattened_mut())?;
            numbers.extend(chunk[..now].iter().map(|bytes| number(*bytes)));
            left -= now;
        }
        Ok(numbers)
    }
}

/// A part from a file of so many bytes.
pub(super) fn decode(reader: impl Read, bytes: u64) -> Result<Part, Fault> {
    let hashed = bytes.checked_sub(CHECKSUM);
    let hash = ByteHash::new(hashed.ok_or("the file is cut short")?);
    let mut source = Source { reader, hash };
    let mut prefix = [0; PREFIX];
    source.fill(&mut prefix)?;
    if prefix[..8] != MAGIC {
        return Err("no part file begins like this".into());
    }
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| prefix[at + i]));
    if word(8) != VERSION {
        let advice = if word(8) < VERSION {
            ": render the passes again"
        } else {
            ""
        };
        let found = word(8);
        return Err(
            format!("version {found}, this program reads version {VERSION}{advice}").into(),
        );
    }
    let header_len = word(12) as usize;
    if header_len > MAX_HEADER_BYTES {
        return Err(
            format!("a header of {header_len} bytes, allowed: at most {MAX_HEADER_BYTES}").into(),
        );
    }
    let mut header = vec![0; header_len];
    source.fill(&mut header)?;
    let header: PartHeader = serde_json::from_slice(&header).map_err(|e| format!("header: {e}"))?;
    header.check()?;
    // the count is bounded by the file's own size before anything of it is allocated
    let beside = (PREFIX + header_len) as u64 + CHECKSUM;
    let expected = body_bytes(&header).and_then(|n| n.checked_add(beside));
    let (Some(count), Some(expected)) = (header.sum_count(), expected) else {
        return Err("the header promises more sums than any file holds".into());
    };
    if bytes < expected {
        return Err("the file is cut short".into());
    }
    if bytes > expected {
        return Err("there is more after the last sum".into());
    }
    let sums = source.numbers(count, i128::from_le_bytes)?;
    let unfinished = match header.unfinished {
        None => None,
        Some(name) => {
            let tiles = tile_count(&header.crop());
            Some(UnfinishedPass {
                pass: name.pass,
                sums: source.numbers(count / 2, i128::from_le_bytes)?,
                done: source.numbers(tiles, u16::from_le_bytes)?,
            })
        }
    };
    let mut checksum = [0; CHECKSUM as usize];
    source.reader.read_exact(&mut checksum)?;
    if source.hash.finish().to_le_bytes() != checksum {
        return Err("the checksum does not match: the file is damaged".into());
    }
    let part = Part {
        header,
        sums,
        unfinished,
    };
    part.check()?;
    Ok(part)
}

/// Decodes any bytes as a part: must not panic.
pub fn fuzz_part(bytes: &[u8]) {
    _ = decode(bytes, bytes.len() as u64);
}
