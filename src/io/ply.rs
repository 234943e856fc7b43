//! PLY meshes: ASCII, binary little- and big-endian (G. Turk, "The PLY Polygon File Format", 1994).
//!
//! Read are the vertices' positions, normals and texture coordinates and the faces; other properties and elements are
//! passed over. Polygons become triangle fans. Counts are checked against the bytes there are before anything is
//! allocated.

use crate::geometry::Mesh;

/// Most properties of an element.
const MAX_PROPERTIES: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Ascii,
    Little,
    Big,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Clone, Debug)]
struct Property {
    name: String,
    kind: Scalar,
    /// Type of the count of a list.
    list: Option<Scalar>,
}

#[derive(Clone, Debug)]
struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

/// Numbers one after the other, in any of the formats.
struct Body<'a> {
    format: Format,
    rest: &'a [u8],
}

impl Body<'_> {
    fn next(&mut self, kind: Scalar) -> Result<f64, String> {
        if self.format == Format::Ascii {
            let start = self.rest.trim_ascii_start();
            let end = start
                .iter()
                .position(u8::is_ascii_whitespace)
                .unwrap_or(start.len());
            let (word, rest) = start.split_at(end);
            self.rest = rest;
            if word.is_empty() {
                return Err("the file ends before its last element".to_owned());
            }
            let number = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
            return number.ok_or_else(|| {
                let shown = String::from_utf8_lossy(&word[..word.len().min(40)]);
                format!("\"{shown}\" is not a number")
            });
        }
        let size = kind.size();
        let (bytes, rest) = self
            .rest
            .split_at_checked(size)
            .ok_or_else(|| "the file ends before its last element".to_owned())?;
        self.rest = rest;
        let mut b = [0; 8];
        b[..size].copy_from_slice(bytes);
        if self.format == Format::Big {
            b[..size].reverse();
        }
        let [a0, a1, a2, a3, ..] = b;
        Ok(match kind {
            Scalar::I8 => f64::from(a0 as i8),
            Scalar::U8 => f64::from(a0),
            Scalar::I16 => f64::from(i16::from_le_bytes([a0, a1])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a0, a1])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a0, a1, a2, a3])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a0, a1, a2, a3])),
            Scalar::F32 => f64::from(f32::from_le_bytes([a0, a1, a2, a3])),
            Scalar::F64 => f64::from_le_bytes(b),
        })
    }

    /// A whole number from 0.
    fn whole(&mut self, kind: Scalar, what: &str) -> Result<u32, String> {
        let value = self.next(kind)?;
        if value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value) {
            Ok(value as u32)
        } else {
            Err(format!("{what} is {value} (allowed: whole numbers from 0)"))
        }
    }
}

/// Parses any bytes: must not panic.
pub fn fuzz_ply(bytes: &[u8]) {
    // the outcome does not matter
    _ = read(bytes);
}

/// Reads the bytes of a file.
///
/// # Errors
/// What is wrong, in words.
pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let (format, elements, body) = header(bytes)?;
    let mut body = Body { format, rest: body };
    let (mut positions, mut normals, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
    let mut triangles = Vec::new();
    for element in &elements {
        // an element takes at least so many bytes
        let least: usize = element
            .properties
            .iter()
            .map(|p| match (format, p.list) {
                (Format::Ascii, _) => 2,
                (_, Some(count)) => count.size(),
                (_, None) => p.kind.size(),
            })
            .sum();
        let needed = element.count.saturating_mul(least);
        // the last number of a text may end the file
        if needed > body.rest.len().saturating_add(1) {
            return Err(format!(
                "claims {} of element \"{}\", {} bytes are left: truncated or damaged",
                element.count,
                element.name,
                body.rest.len()
            ));
        }
        match element.name.as_str() {
            "vertex" => vertices(element, &mut body, &mut positions, &mut normals, &mut uvs)?,
            "face" => faces(element, &mut body, &mut triangles)?,
            _ => {
                for _ in 0..element.count {
                    for property in &element.properties {
                        skip(property, &mut body)?;
                    }
                    if element.properties.is_empty() {
                        break;
                    }
                }
            }
        }
    }
    if triangles.is_empty() {
        return Err("no faces".to_owned());
    }
    let some = |v: Vec<[f32; 3]>| (!v.is_empty()).then_some(v);
    let uvs = (!uvs.is_empty()).then_some(uvs);
    Mesh::new(&positions, some(normals), uvs, triangles).map_err(|e| e.to_string())
}

fn header(bytes: &[u8]) -> Result<(Format, Vec<Element>, &[u8]), String> {
    let mut rest = bytes;
    let mut number = 0;
    let mut line = || -> Result<(usize, String), String> {
        let end = rest
            .iter()
            .take(4096)
            .position(|&b| b == b'\n')
            .ok_or_else(|| "the header has no end".to_owned())?;
        let text = String::from_utf8_lossy(&rest[..end]).trim().to_owned();
        rest = &rest[end + 1..];
        number += 1;
        Ok((number, text))
    };
    let (_, magic) = line().map_err(|_| "not a PLY file".to_owned())?;
    if magic != "ply" {
        return Err("not a PLY file".to_owned());
    }
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let (number, text) = line()?;
        let bad = || format!("line {number}: \"{text}\" is not understood");
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            ["format", kind, "1.0"] => {
                format = Some(match *kind {
                    "ascii" => Format::Ascii,
                    "binary_little_endian" => Format::Little,
                    "binary_big_endian" => Format::Big,
                    _ => return Err(bad()),
                });
            }
            [] | ["comment" | "obj_info", ..] => {}
            ["element", name, count] => elements.push(Element {
                name: (*name).to_owned(),
                count: count.parse().map_err(|_| bad())?,
                properties: Vec::new(),
            }),
            ["property", rest @ ..] => {
                let (list, kind, name) = match *rest {
                    ["list", count, kind, name] => (
                        Some(Scalar::parse(count).ok_or_else(bad)?),
                        Scalar::parse(kind).ok_or_else(bad)?,
                        name,
                    ),
                    [kind, name] => (None, Scalar::parse(kind).ok_or_else(bad)?, name),
                    _ => return Err(bad()),
                };
                let element = elements.last_mut().ok_or_else(bad)?;
                if element.properties.len() >= MAX_PROPERTIES {
                    return Err(format!(
                        "line {number}: more than {MAX_PROPERTIES} properties"
                    ));
                }
                element.properties.push(Property {
                    name: name.to_owned(),
                    kind,
                    list,
                });
            }
            ["end_header"] => break,
            _ => return Err(bad()),
        }
    }
    let format = format.ok_or_else(|| "the header names no format".to_owned())?;
    Ok((format, elements, rest))
}

fn skip(property: &Property, body: &mut Body) -> Result<(), String> {
    let count = match property.list {
        None => 1,
        Some(kind) => body.whole(kind, "the length of a list")?,
    };
    for _ in 0..count {
        body.next(property.kind)?;
    }
    Ok(())
}

/// Reads the vertices: x y z, nx ny nz, and u v (s t, texture_u texture_v).
fn vertices(
    element: &Element,
    body: &mut Body,
    positions: &mut Vec<[f32; 3]>,
    normals: &mut Vec<[f32; 3]>,
    uvs: &mut Vec<[f32; 2]>,
) -> Result<(), String> {
    const NAMES: [&[&str]; 8] = [
        &["x"],
        &["y"],
        &["z"],
        &["nx"],
        &["ny"],
        &["nz"],
        &["u", "s", "texture_u", "s0"],
        &["v", "t", "texture_v", "t0"],
    ];
    let slot = |p: &Property| {
        (p.list.is_none())
            .then(|| NAMES.iter().position(|n| n.contains(&p.name.as_str())))
            .flatten()
    };
    let slots: Vec<Option<usize>> = element.properties.iter().map(slot).collect();
    let has = |range: std::ops::Range<usize>| range.clone().all(|i| slots.contains(&Some(i)));
    if !has(0..3) {
        return Err("element \"vertex\" has no x, y, z".to_owned());
    }
    let (has_normals, has_uvs) = (has(3..6), has(6..8));
    positions.reserve(element.count);
    for _ in 0..element.count {
        let mut values = [0.0f32; 8];
        for (property, slot) in element.properties.iter().zip(&slots) {
            match slot {
                Some(i) => values[*i] = body.next(property.kind)? as f32,
                None => skip(property, body)?,
            }
        }
        let [x, y, z, nx, ny, nz, u, v] = values;
        positions.push([x, y, z]);
        if has_normals {
            normals.push([nx, ny, nz]);
        }
        if has_uvs {
            uvs.push([u, v]);
        }
    }
    Ok(())
}

fn faces(element: &Element, body: &mut Body, triangles: &mut Vec<[u32; 3]>) -> Result<(), String> {
    let names = ["vertex_indices", "vertex_index"];
    let is_list = |p: &Property| p.list.is_some() && names.contains(&p.name.as_str());
    if !element.properties.iter().any(is_list) {
        return Err("element \"face\" has no list vertex_indices".to_owned());
    }
    for _ in 0..element.count {
        for property in &element.properties {
            let Some(count) = property.list.filter(|_| is_list(property)) else {
                skip(property, body)?;
                continue;
            };
            let n = body.whole(count, "the number of corners of a face")?;
            let mut fan = [0; 2];
            for i in 0..n {
                let v = body.whole(property.kind, "a vertex index")?;
                match i {
                    0 | 1 => fan[i as usize] = v,
                    _ => {
                        triangles.push([fan[0], fan[1], v]);
                        fan[1] = v;
                    }
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
                          property list uchar int vertex_indices\nend_header\n";

    fn binary(big: bool) -> Vec<u8> {
        let kind = if big { "big" } else { "little" };
        let mut bytes = format!("ply\nformat binary_{kind}_endian 1.0\n{HEADER}").into_bytes();
        for v in [
            0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0,
        ] {
            bytes.extend(if big {
                v.to_be_bytes()
            } else {
                v.to_le_bytes()
            });
        }
        bytes.push(4);
        for i in 0..4i32 {
            bytes.extend(if big {
                i.to_be_bytes()
            } else {
                i.to_le_bytes()
            });
        }
        bytes
    }

    #[test]
    fn all_three_formats_say_the_same() {
        let ascii = format!(
            "ply\nformat ascii 1.0\ncomment a square\n{HEADER}0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3"
        );
        for bytes in [ascii.into_bytes(), binary(false), binary(true)] {
            let mesh = read(&bytes).expect("valid");
            assert_eq!(mesh.triangle_count(), 2);
            assert!((mesh.area() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn faults_are_named() {
        let text = |body: &str| format!("ply\nformat ascii 1.0\n{HEADER}{body}");
        let huge = text("").replace("vertex 4", "vertex 1000000000");
        for (file, message) in [
            ("plx\n".to_owned(), "not a PLY file"),
            (
                "ply\nformat ascii 1.0\n".to_owned(),
                "the header has no end",
            ),
            (
                "ply\nformat utf8 1.0\nend_header\n".to_owned(),
                "line 2: \"format utf8 1.0\" is not understood",
            ),
            ("ply\nend_header\n".to_owned(), "the header names no format"),
            (
                huge,
                "claims 1000000000 of element \"vertex\", 0 bytes are left: truncated or damaged",
            ),
            (
                text("0 0 0\n1 0 0\n1 1 0\n0 1 x\n3 0 1 2"),
                "\"x\" is not a number",
            ),
            (
                text("0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 9"),
                "triangle 0 refers to vertex 9, but there are 4",
            ),
            (
                text("0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 -2"),
                "a vertex index is -2 (allowed: whole numbers from 0)",
            ),
            (
                text("nan 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2"),
                "position 0 is not finite",
            ),
            (
                text("0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1"),
                "the file ends before its last element",
            ),
        ] {
            assert_eq!(
                read(file.as_bytes()).err().as_deref(),
                Some(message),
                "{file}"
            );
        }
    }
}
