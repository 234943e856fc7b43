//! Bytes of a glTF file: URIs, buffers, views, accessors. Nothing is allocated before it is known
//! to be there.

use super::{Fault, hashed};
use crate::io::files;
use gltf::json::accessor::{ComponentType, GenericComponentType, IndexComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root, accessor, buffer};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Largest buffer file.
const MAX_BUFFER_BYTES: u64 = 4 << 30;
/// Most elements of an accessor that has no bytes behind it (it is 0 but for its sparse values).
const MAX_ZEROS: usize = 1 << 24;

/// The bytes of all buffers.
pub struct Buffers<'a> {
    root: &'a Root,
    buffers: Vec<Cow<'a, [u8]>>,
    /// Files that they come from.
    pub files: Vec<PathBuf>,
    /// Hash of those that come from other files.
    pub hash: u64,
}

/// Bytes that a URI refers to, and the path of a file that held them. `what` names the URI's owner
/// in messages.
pub fn read_uri(
    folder: &Path,
    uri: &str,
    what: &str,
    limit: u64,
) -> Result<(Option<PathBuf>, Vec<u8>), Fault> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, body) = data
            .split_once(',')
            .ok_or_else(|| Fault::new(format!("{what}: the data: URI has no comma")))?;
        if !kind.ends_with(";base64") {
            return Err(Fault::new(format!("{what}: the data: URI is not base64")));
        }
        return base64(body.as_bytes())
            .map(|bytes| (None, bytes))
            .ok_or_else(|| Fault::new(format!("{what}: the data: URI is not valid base64")));
    }
    let shown: String = uri.chars().take(80).collect();
    let scheme = uri.split_once(':').is_some_and(|(s, _)| {
        !s.is_empty()
            && s.bytes()
                .all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b))
    });
    if scheme {
        return Err(Fault::new(format!(
            "{what}: URI \"{shown}\" is not read (allowed: data:, or a relative path into the folder of the file)"
        )));
    }
    let name = percent_decoded(uri)
        .ok_or_else(|| Fault::new(format!("{what}: URI \"{shown}\" is not valid")))?;
    match files::read(folder, &name, limit) {
        Ok((path, bytes)) => Ok((Some(path), bytes)),
        Err(problem) => Err(Fault::new(format!("{what}: {problem}"))),
    }
}

fn percent_decoded(uri: &str) -> Option<String> {
    let mut out = Vec::with_capacity(uri.len());
    let mut bytes = uri.bytes();
    while let Some(b) = bytes.next() {
        if b == b'%' {
            let digits = [bytes.next()?, bytes.next()?].map(char::from);
            let value = digits[0].to_digit(16)? * 16 + digits[1].to_digit(16)?;
            out.push(value as u8);
        } else {
            out.push(b);
        }
    }
    // a NUL never is part of a name
    String::from_utf8(out).ok().filter(|s| !s.contains('\0'))
}

fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let text = text.trim_ascii();
    let end = text.iter().rposition(|&b| b != b'=').map_or(0, |i| i + 1);
    let mut out = Vec::with_capacity(end / 4 * 3 + 3);
    let (mut bits, mut count) = (0u32, 0);
    for &b in &text[..end] {
        let digit = match b {
            b'A'..=b'Z' => b - b'A',
            b'a'..=b'z' => b - b'a' + 26,
            b'0'..=b'9' => b - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(digit);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
        }
    }
    Some(out)
}

/// The numbers of an accessor, still as bytes.
struct Elements<'b> {
    bytes: &'b [u8],
    stride: usize,
    count: usize,
}

fn component_size(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

fn multiplicity(kind: Type) -> usize {
    match kind {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 | Type::Mat2 => 4,
        Type::Mat3 => 9,
        Type::Mat4 => 16,
    }
}

/// One number; integers as they are, or to 0..1 and -1..1 where `normalized`.
fn number(bytes: &[u8], component: ComponentType, normalized: bool) -> f32 {
    let (value, scale) = match (component, bytes) {
        (ComponentType::I8, &[b, ..]) => (f32::from(b as i8), 127.0),
        (ComponentType::U8, &[b, ..]) => (f32::from(b), 255.0),
        (ComponentType::I16, &[a, b, ..]) => (f32::from(i16::from_le_bytes([a, b])), 32767.0),
        (ComponentType::U16, &[a, b, ..]) => (f32::from(u16::from_le_bytes([a, b])), 65535.0),
        (ComponentType::U32, &[a, b, c, d, ..]) => {
            (u32::from_le_bytes([a, b, c, d]) as f32, 4_294_967_295.0)
        }
        (ComponentType::F32, &[a, b, c, d, ..]) => return f32::from_le_bytes([a, b, c, d]),
        _ => return 0.0,
    };
    if normalized {
        (value / scale).max(-1.0)
    } else {
        value
    }
}

fn index(bytes: &[u8], component: ComponentType) -> u32 {
    match (component, bytes) {
        (ComponentType::U8, &[b, ..]) => b.into(),
        (ComponentType::U16, &[a, b, ..]) => u16::from_le_bytes([a, b]).into(),
        (_, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]),
        _ => 0,
    }
}

impl<'a> Buffers<'a> {
    /// Reads all buffers. `chunk` is the binary chunk of a GLB file, the buffer without a URI.
    pub fn read(root: &'a Root, folder: &Path, chunk: Option<&'a [u8]>) -> Result<Self, Fault> {
        let mut buffers = Vec::with_capacity(root.buffers.len());
        let (mut hash, mut files) = (0, Vec::new());
        for (i, buffer) in root.buffers.iter().enumerate() {
            let what = format!("buffer {i}");
            let length = buffer.byte_length.0;
            let mut bytes: Cow<'a, [u8]> = match (&buffer.uri, chunk) {
                (Some(uri), _) => {
                    let (path, bytes) = read_uri(folder, uri, &what, MAX_BUFFER_BYTES)?;
                    files.extend(path);
                    hash = hashed(hash, &bytes);
                    bytes.into()
                }
                (None, Some(chunk)) if i == 0 => chunk.into(),
                // a buffer that an extension fills: its views say so when they are used
                (None, _) => Vec::new().into(),
            };
            if (bytes.len() as u64) < length && (buffer.uri.is_some() || i == 0 && chunk.is_some())
            {
                return Err(Fault::new(format!(
                    "{what} has {} bytes, but byteLength is {length}: the file is truncated",
                    bytes.len()
                )));
            }
            let length = usize::try_from(length)
                .unwrap_or(usize::MAX)
                .min(bytes.len());
            match &mut bytes {
                Cow::Borrowed(all) => *all = &all[..length],
                Cow::Owned(all) => all.truncate(length),
            }
            buffers.push(bytes);
        }
        Ok(Self {
            root,
            buffers,
            files,
            hash,
        })
    }

    /// The bytes of a buffer view, and their stride.
    pub fn view(&self, view: Index<buffer::View>) -> Result<(&[u8], Option<usize>), Fault> {
        let i = view.value();
        let view = self
            .root
            .buffer_views
            .get(i)
            .ok_or_else(|| Fault::missing("buffer view", i))?;
        let buffer = view.buffer.value();
        let bytes = self
            .buffers
            .get(buffer)
            .ok_or_else(|| Fault::missing("buffer", buffer))?;
        let start = view.byte_offset.map_or(0, |o| o.0);
        let end = start.checked_add(view.byte_length.0);
        let range =
            end.and_then(|end| bytes.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?));
        let range = range.ok_or_else(|| {
            Fault::new(format!(
                "buffer view {i}: bytes {start} to {} of buffer {buffer}, which has {}",
                start.saturating_add(view.byte_length.0),
                bytes.len()
            ))
        })?;
        Ok((range, view.byte_stride.map(|s| s.0)))
    }

    /// `count` elements of `size` bytes from `offset` of a view.
    fn elements(
        &self,
        what: &str,
        view: Index<buffer::View>,
        offset: u64,
        (count, size): (u64, usize),
    ) -> Result<Elements<'_>, Fault> {
        let (bytes, stride) = self.view(view)?;
        let stride = stride.unwrap_or(size);
        let beyond = || {
            Fault::new(format!(
                "{what} claims {count} elements of {size} bytes, but buffer view {} has {} bytes",
                view.value(),
                bytes.len()
            ))
        };
        if stride < size {
            return Err(Fault::new(format!(
                "{what}: a stride of {stride} bytes for elements of {size}"
            )));
        }
        let offset = usize::try_from(offset).map_err(|_| beyond())?;
        let bytes = bytes.get(offset..).ok_or_else(beyond)?;
        let count_here = usize::try_from(count).map_err(|_| beyond())?;
        let needed = count_here
            .checked_sub(1)
            .map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size));
        if needed.is_none_or(|n| n > bytes.len()) {
            return Err(beyond());
        }
        Ok(Elements {
            bytes,
            stride,
            count: count_here,
        })
    }

    fn accessor(
        &self,
        id: Index<accessor::Accessor>,
    ) -> Result<(&'a accessor::Accessor, ComponentType, Type), Fault> {
        let i = id.value();
        let accessor = self
            .root
            .accessors
            .get(i)
            .ok_or_else(|| Fault::missing("accessor", i))?;
        match (accessor.component_type, accessor.type_) {
            (Checked::Valid(GenericComponentType(component)), Checked::Valid(kind)) => {
                Ok((accessor, component, kind))
            }
            _ => Err(Fault::new(format!(
                "accessor {i}: unknown type of its components or elements"
            ))),
        }
    }

    /// Elements of an accessor, as it claims.
    pub fn count(&self, id: Index<accessor::Accessor>) -> Result<u64, Fault> {
        Ok(self.accessor(id)?.0.count.0)
    }

    /// An accessor of `N` numbers per element; sparse values included.
    pub fn vectors<const N: usize>(
        &self,
        id: Index<accessor::Accessor>,
    ) -> Result<Vec<[f32; N]>, Fault> {
        let (accessor, component, kind) = self.accessor(id)?;
        let what = format!("accessor {}", id.value());
        if multiplicity(kind) != N {
            return Err(Fault::new(format!(
                "{what} has elements of {} numbers (needed: {N})",
                multiplicity(kind)
            )));
        }
        let width = component_size(component);
        let element = |bytes: &[u8]| -> [f32; N] {
            std::array::from_fn(|k| {
                number(
                    bytes.get(k * width..).unwrap_or_default(),
                    component,
                    accessor.normalized,
                )
            })
        };
        let read = |e: &Elements| -> Vec<[f32; N]> {
            (0..e.count)
                .map(|i| element(&e.bytes[i * e.stride..]))
                .collect()
        };
        let offset = accessor.byte_offset.map_or(0, |o| o.0);
        let count = accessor.count.0;
        let mut values = match accessor.buffer_view {
            Some(view) => read(&self.elements(&what, view, offset, (count, N * width))?),
            None => vec![[0.0; N]; zeros(&what, count)?],
        };
        if let Some(sparse) = &accessor.sparse {
            let what = format!("{what}, sparse");
            let n = sparse.count.0;
            let Checked::Valid(IndexComponentType(kind)) = sparse.indices.component_type else {
                return Err(Fault::new(format!("{what}: unknown type of indices")));
            };
            let places = self.elements(
                &what,
                sparse.indices.buffer_view,
                sparse.indices.byte_offset.0,
                (n, component_size(kind)),
            )?;
            let replacements = self.elements(
                &what,
                sparse.values.buffer_view,
                sparse.values.byte_offset.0,
                (n, N * width),
            )?;
            for i in 0..places.count {
                let at = index(&places.bytes[i * places.stride..], kind) as usize;
                let value = element(&replacements.bytes[i * replacements.stride..]);
                *values
                    .get_mut(at)
                    .ok_or_else(|| Fault::new(format!("{what}: element {at} of {count}")))? = value;
            }
        }
        Ok(values)
    }

    /// An accessor of whole numbers.
    pub fn indices(&self, id: Index<accessor::Accessor>) -> Result<Vec<u32>, Fault> {
        let (accessor, component, kind) = self.accessor(id)?;
        let what = format!("accessor {}", id.value());
        let whole = matches!(
            component,
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32
        );
        if kind != Type::Scalar || !whole || accessor.sparse.is_some() {
            return Err(Fault::new(format!(
                "{what} is no list of indices (needed: unsigned scalars)"
            )));
        }
        let Some(view) = accessor.buffer_view else {
            return Ok(vec![0; zeros(&what, accessor.count.0)?]);
        };
        let offset = accessor.byte_offset.map_or(0, |o| o.0);
        let size = component_size(component);
        let e = self.elements(&what, view, offset, (accessor.count.0, size))?;
        Ok((0..e.count)
            .map(|i| index(&e.bytes[i * e.stride..], component))
            .collect())
    }
}

fn zeros(what: &str, count: u64) -> Result<usize, Fault> {
    usize::try_from(count)
        .ok()
        .filter(|&n| n <= MAX_ZEROS)
        .ok_or_else(|| {
            Fault::new(format!(
                "{what} claims {count} elements without bytes behind them (allowed: at most {MAX_ZEROS})"
            ))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_standard() {
        for (text, bytes) in [
            ("", &b""[..]),
            ("Zg==", b"f"),
            ("Zm8=", b"fo"),
            ("Zm9v", b"foo"),
            ("Zm9vYmFy", b"foobar"),
        ] {
            assert_eq!(base64(text.as_bytes()).as_deref(), Some(bytes));
        }
        assert_eq!(base64(b"Zm9*"), None);
    }

    #[test]
    fn uris_stay_in_the_folder() {
        let folder = tempfile::tempdir().expect("folder");
        std::fs::write(folder.path().join("a b.bin"), [1, 2]).expect("file");
        let read = |uri: &str| {
            read_uri(folder.path(), uri, "buffer 0", 10)
                .map(|read| read.1)
                .map_err(|f| f.0)
        };
        assert_eq!(read("a%20b.bin").as_deref(), Ok(&[1, 2][..]));
        assert_eq!(
            read("data:application/octet-stream;base64,AQI=").as_deref(),
            Ok(&[1, 2][..])
        );
        for (uri, message) in [
            (
                "file:///etc/passwd",
                "URI \"file:///etc/passwd\" is not read",
            ),
            ("https://example.org/x.bin", "is not read"),
            ("/etc/passwd", "is outside the scene's folder"),
            ("../x.bin", "is outside the scene's folder"),
            ("%2e%2e/x.bin", "is outside the scene's folder"),
            ("data:,abc", "is not base64"),
            ("data:;base64,***", "is not valid base64"),
            ("b.bin", "not found"),
        ] {
            let error = read(uri).expect_err(uri);
            assert!(
                error.starts_with("buffer 0: ") && error.contains(message),
                "{error}"
            );
        }
    }

    #[test]
    fn numbers_of_every_kind() {
        assert_eq!(number(&[0x80], ComponentType::I8, true), -1.0);
        assert_eq!(number(&[255], ComponentType::U8, true), 1.0);
        assert_eq!(number(&[0, 1], ComponentType::U16, false), 256.0);
        assert_eq!(
            number(&1.5f32.to_le_bytes(), ComponentType::F32, false),
            1.5
        );
        assert_eq!(number(&[], ComponentType::F32, false), 0.0);
        assert_eq!(index(&[1, 2, 0, 0], ComponentType::U32), 513);
    }
}
