//! The file of a part, little-endian: magic `abbepart`, u32 version, u32 header length, header
//! (JSON), sums (i128, film by film, half by half, row by row, channels innermost, those by blocks
//! of a half behind its rows); of an unfinished pass, where the header names one, the sums of its
//! half and u16 pixels done of each tile; u64 checksum of everything before it.
//!
//! A packed file has the same numbers by the thousands, the first byte of each, then the second one
//! and so on, through DEFLATE (RFC 1951): the sums of a few passes leave most of their 128 bits
//! alone.
//!
//! Files are read as streams: memory holds the sums once.

use super::{Part, PartError, PartHeader};
use crate::io::atomic::{FileError, write_atomic};
use crate::io::files::open_regular;
use crate::math::hash::ByteHash;
use crate::render::UnfinishedPass;
use crate::render::pass::tile_count;
use flate2::Compression;
use flate2::bufread::DeflateDecoder;
use flate2::write::DeflateEncoder;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::path::Path;

const MAGIC: [u8; 8] = *b"abbepart";
/// 1 hashed settings by the names of this program's code, and its sums took random numbers in their
/// order of use. 2 did not say how the variance factors of its weights were found. 3 had whole
/// passes only. 4, and 5 that were packed, had no sums by sources, and other wavelengths.
pub(super) const VERSION: u32 = 6;
/// The same, packed.
const PACKED: u32 = 7;
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
/// Bytes that DEFLATE makes of one at most: 258 of two bits.
const MOST_OF_A_BYTE: u64 = 1032;

/// Whether a file is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Plain,
    Packed,
}

/// Writes a part.
///
/// # Errors
/// The file cannot be written, or the sums do not fit the header.
pub fn write(path: &Path, part: &Part) -> Result<(), PartError> {
    write_as(path, part, Form::Plain)
}

/// Writes a part in a half to a fiftieth of the bytes, by what the sensor sees.
///
/// # Errors
/// As [`write()`].
pub fn write_packed(path: &Path, part: &Part) -> Result<(), PartError> {
    write_as(path, part, Form::Packed)
}

fn write_as(path: &Path, part: &Part, form: Form) -> Result<(), PartError> {
    let header = header_bytes(part).map_err(|message| PartError::Format {
        path: path.to_owned(),
        message,
    })?;
    Ok(write_atomic(path, |w| encode(part, &header, form, w))?)
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
    read_as(path, |_| Ok(()))
}

/// Reads a part if its header is as it has to be, which is asked before there is room for its sums.
///
/// # Errors
/// The file cannot be read, is not a valid part, or has another header.
pub fn read_as(
    path: &Path,
    check: impl FnOnce(&PartHeader) -> Result<(), PartError>,
) -> Result<Part, PartError> {
    let file_error = |e| PartError::from(FileError::new(path, e));
    let (file, bytes) = open_regular(path, MAX_PART_BYTES).map_err(file_error)?;
    let reader = BufReader::with_capacity(1 << 20, file);
    decode(reader, bytes, check).map_err(|fault| match fault {
        Fault::File(e) => file_error(e),
        Fault::Other(e) => e,
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

pub(super) fn encode(part: &Part, header: &[u8], form: Form, w: &mut impl Write) -> io::Result<()> {
    let plain = body_bytes(&part.header).ok_or(io::ErrorKind::FileTooLarge)?;
    let (version, packed, body) = match form {
        Form::Plain => (VERSION, Vec::new(), plain),
        Form::Packed => {
            let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
            put_body(part, form, |bytes| encoder.write_all(bytes))?;
            let packed = encoder.finish()?;
            let size = packed.len() as u64;
            (PACKED, packed, size)
        }
    };
    let mut hash = ByteHash::new((PREFIX + header.len()) as u64 + body);
    let mut put = |bytes: &[u8]| {
        hash.add(bytes);
        w.write_all(bytes)
    };
    put(&MAGIC)?;
    put(&version.to_le_bytes())?;
    put(&(header.len() as u32).to_le_bytes())?;
    put(header)?;
    match form {
        Form::Plain => put_body(part, form, put)?,
        Form::Packed => put(&packed)?,
    }
    w.write_all(&hash.finish().to_le_bytes())
}

/// Puts all numbers.
fn put_body(
    part: &Part,
    form: Form,
    mut put: impl FnMut(&[u8]) -> io::Result<()>,
) -> io::Result<()> {
    put_numbers(&part.sums, i128::to_le_bytes, form, &mut put)?;
    let Some(unfinished) = &part.unfinished else {
        return Ok(());
    };
    put_numbers(&unfinished.sums, i128::to_le_bytes, form, &mut put)?;
    put_numbers(&unfinished.done, u16::to_le_bytes, form, &mut put)
}

fn put_numbers<const N: usize, T: Copy>(
    numbers: &[T],
    bytes_of: impl Fn(T) -> [u8; N],
    form: Form,
    put: &mut impl FnMut(&[u8]) -> io::Result<()>,
) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(CHUNK * N);
    numbers.chunks(CHUNK).try_for_each(|chunk| {
        bytes.clear();
        match form {
            Form::Plain => bytes.extend(chunk.iter().flat_map(|n| bytes_of(*n))),
            Form::Packed => {
                let place = |k: usize| chunk.iter().map(move |n| (*n, k));
                bytes.extend((0..N).flat_map(place).map(|(n, k)| bytes_of(n)[k]));
            }
        }
        put(&bytes)
    })
}

/// Fault of a file that is read.
#[derive(Debug)]
pub(super) enum Fault {
    /// The file system.
    File(io::Error),
    /// The content, in words.
    Format(String),
    /// The header is another one.
    Other(PartError),
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

impl From<PartError> for Fault {
    fn from(e: PartError) -> Self {
        Self::Other(e)
    }
}

/// Bytes of a file, hashed as they are read.
struct Hashed<R> {
    reader: R,
    hash: ByteHash,
}

impl<R: BufRead> BufRead for Hashed<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.reader.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        // what was filled is there without reading
        if let Ok(bytes) = self.reader.fill_buf() {
            self.hash.add(&bytes[..count]);
        }
        self.reader.consume(count);
    }
}

impl<R: BufRead> Read for Hashed<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(bytes)?;
        self.consume(count);
        Ok(count)
    }
}

/// So many numbers of `N` bytes. Their count has been compared with the size of the file.
fn numbers<const N: usize, T>(
    reader: &mut impl Read,
    count: u64,
    form: Form,
    number: impl Fn([u8; N]) -> T,
) -> Result<Vec<T>, Fault> {
    let mut left = usize::try_from(count).map_err(|_| "more sums than this machine holds")?;
    let mut numbers = Vec::with_capacity(left);
    let mut bytes = vec![0; CHUNK * N];
    while left > 0 {
        let now = left.min(CHUNK);
        let bytes = &mut bytes[..now * N];
        reader.read_exact(bytes)?;
        let byte = |i: usize, k: usize| match form {
            Form::Plain => bytes[i * N + k],
            Form::Packed => bytes[k * now + i],
        };
        numbers.extend((0..now).map(|i| number(std::array::from_fn(|k| byte(i, k)))));
        left -= now;
    }
    Ok(numbers)
}

/// A part from a file of so many bytes.
pub(super) fn decode(
    reader: impl BufRead,
    bytes: u64,
    check: impl FnOnce(&PartHeader) -> Result<(), PartError>,
) -> Result<Part, Fault> {
    let hashed = bytes.checked_sub(CHECKSUM);
    let hash = ByteHash::new(hashed.ok_or("the file is cut short")?);
    let mut source = Hashed { reader, hash };
    let mut prefix = [0; PREFIX];
    source.read_exact(&mut prefix)?;
    if prefix[..8] != MAGIC {
        return Err("no part file begins like this".into());
    }
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| prefix[at + i]));
    let form = match word(8) {
        VERSION => Form::Plain,
        PACKED => Form::Packed,
        found => {
            let advice = if found < VERSION {
                ": render the passes again"
            } else {
                ""
            };
            let own = format!("this program reads versions {VERSION} and {PACKED}{advice}");
            return Err(format!("version {found}, {own}").into());
        }
    };
    let header_len = word(12) as usize;
    if header_len > MAX_HEADER_BYTES {
        return Err(
            format!("a header of {header_len} bytes, allowed: at most {MAX_HEADER_BYTES}").into(),
        );
    }
    let mut header = vec![0; header_len];
    source.read_exact(&mut header)?;
    let header: PartHeader = serde_json::from_slice(&header).map_err(|e| format!("header: {e}"))?;
    header.check()?;
    check(&header)?;
    // the count is bounded by the file's own size before anything of it is allocated
    let beside = (PREFIX + header_len) as u64 + CHECKSUM;
    let body = bytes.checked_sub(beside).ok_or("the file is cut short")?;
    let Some(expected) = body_bytes(&header) else {
        return Err("the header promises more sums than any file holds".into());
    };
    let most = match form {
        Form::Plain => body,
        Form::Packed => body.saturating_mul(MOST_OF_A_BYTE),
    };
    if most < expected {
        return Err("the file is cut short".into());
    }
    let part = match form {
        Form::Plain if body > expected => return Err("there is more after the last sum".into()),
        Form::Plain => body_of(header, form, &mut source)?,
        Form::Packed => {
            let mut packed = (&mut source).take(body);
            let mut decoder = DeflateDecoder::new(&mut packed);
            let part = body_of(header, form, &mut decoder).map_err(unpacked)?;
            // the end of the last block is read with what follows the last number
            let more = decoder.read(&mut [0]).map_err(|e| unpacked(e.into()))?;
            drop(decoder);
            if more > 0 || packed.limit() > 0 {
                return Err("there is more after the last sum".into());
            }
            part
        }
    };
    let mut checksum = [0; CHECKSUM as usize];
    source.reader.read_exact(&mut checksum)?;
    if source.hash.finish().to_le_bytes() != checksum {
        return Err("the checksum does not match: the file is damaged".into());
    }
    part.check()?;
    Ok(part)
}

/// A fault while packed numbers were read: what is no DEFLATE is not the disk's.
fn unpacked(fault: Fault) -> Fault {
    match fault {
        Fault::File(e) if matches!(e.kind(), ErrorKind::InvalidInput | ErrorKind::InvalidData) => {
            "the packed sums are damaged".into()
        }
        fault => fault,
    }
}

/// A part from its header and what reads its numbers.
fn body_of(header: PartHeader, form: Form, reader: &mut impl Read) -> Result<Part, Fault> {
    let count = header.sum_count().ok_or("more sums than any file holds")?;
    let sums = numbers(reader, count, form, i128::from_le_bytes)?;
    let unfinished = match header.unfinished {
        None => None,
        Some(name) => {
            let tiles = tile_count(&header.crop());
            Some(UnfinishedPass {
                pass: name.pass,
                sums: numbers(reader, count / 2, form, i128::from_le_bytes)?,
                done: numbers(reader, tiles, form, u16::from_le_bytes)?,
            })
        }
    };
    Ok(Part {
        header,
        sums,
        unfinished,
    })
}

/// Decodes any bytes as a part: must not panic.
pub fn fuzz_part(bytes: &[u8]) {
    _ = decode(bytes, bytes.len() as u64, |_| Ok(()));
}
