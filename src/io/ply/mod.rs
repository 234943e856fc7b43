//! PLY meshes: ASCII, binary little- and big-endian (G. Turk, "The PLY Polygon File Format", 1994).
//!
//! Read are the vertices' positions, normals and texture coordinates, the faces with the
//! coordinates of their corners, and triangle strips; other properties and elements are passed
//! over. Polygons become triangle fans. Counts are checked against the bytes there are before
//! anything is allocated.

mod body;
mod header;

use super::obj::Loaded;
use super::origin::{Placed, placed};
use crate::geometry::Mesh;
use body::Body;
use header::{Element, Format, Property, header};

/// Parses any bytes: must not panic.
pub fn fuzz_ply(bytes: &[u8]) {
    // the outcome does not matter
    _ = read(bytes);
}

/// Contents of the elements.
#[derive(Default)]
struct Arrays {
    positions: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    triangles: Vec<[u32; 3]>,
    /// Texture coordinates of the corners of each triangle, where faces have some.
    corner_uvs: Vec<[[f32; 2]; 3]>,
    /// Whether the vertices have been read, so that indices can be compared with them.
    complete: bool,
    /// Faces of fewer than three corners.
    small: usize,
    /// Faces whose list of texture coordinates does not fit their corners.
    unfit: usize,
}

/// Reads the bytes of a file.
///
/// # Errors
/// Fault, in words.
pub fn read(bytes: &[u8]) -> Result<Loaded, String> {
    let (arrays, notes) = elements(bytes)?;
    arrays.mesh(notes)
}

fn elements(bytes: &[u8]) -> Result<(Arrays, Vec<String>), String> {
    let header = header(bytes)?;
    let format = header.format;
    let mut body = Body::new(format, header.body, header.lines);
    let mut arrays = Arrays::default();
    let mut notes: Vec<String> = (header.textures.iter())
        .map(|(line, name)| format!("line {line}: texture \"{name}\" is not read"))
        .collect();
    for element in &header.elements {
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
        let colored = element.properties.iter().any(|p| p.name == "red");
        if colored && element.count > 0 {
            notes.push(format!("{} colors are not read", element.name));
        }
        match element.name.as_str() {
            "vertex" => arrays.vertices(element, &mut body)?,
            "face" => arrays.faces(element, &mut body)?,
            "tristrips" => arrays.strips(element, &mut body)?,
            name => {
                if element.count > 0 {
                    notes.push(format!("element \"{name}\" is not read"));
                }
                for _ in 0..element.count {
                    // nothing stands in the file for an element without properties
                    if element.properties.is_empty() {
                        break;
                    }
                    body.begin()?;
                    for property in &element.properties {
                        body.skip(property)?;
                    }
                    body.end();
                }
            }
        }
    }
    if let Some((count, line)) = body.longer {
        notes.push(format!(
            "line {line}: more numbers than the element has ({count} lines in all)"
        ));
    }
    notes.extend(body.leftover());
    Ok((arrays, notes))
}

/// The index of a property among `names`, where it is no list.
fn slot(property: &Property, names: &[&[&str]]) -> Option<usize> {
    let of = |n: &[&str]| n.contains(&property.name.as_str());
    names
        .iter()
        .position(|n| of(n))
        .filter(|_| property.list.is_none())
}

impl Arrays {
    /// Reads the vertices: x y z, nx ny nz, and u v (s t, texture_u texture_v).
    fn vertices(&mut self, element: &Element, body: &mut Body) -> Result<(), String> {
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
        let slots: Vec<Option<usize>> = (element.properties.iter())
            .map(|p| slot(p, &NAMES))
            .collect();
        let has = |range: std::ops::Range<usize>| range.clone().all(|i| slots.contains(&Some(i)));
        if !has(0..3) {
            return Err("element \"vertex\" has no x, y, z".to_owned());
        }
        let (has_normals, has_uvs) = (has(3..6), has(6..8));
        self.positions.reserve(element.count);
        for _ in 0..element.count {
            body.begin()?;
            let mut values = [0.0f64; 8];
            for (property, slot) in element.properties.iter().zip(&slots) {
                match slot {
                    Some(i) => values[*i] = body.next(property.kind)?,
                    None => body.skip(property)?,
                }
            }
            let [x, y, z, rest @ ..] = values;
            if let Some(bad) = [x, y, z].iter().find(|v| !(**v as f32).is_finite()) {
                let index = self.positions.len();
                return Err(match body.format {
                    Format::Ascii => body.fault(&format!("a coordinate is {bad}")),
                    _ => format!("vertex {index}: a coordinate is {bad}"),
                });
            }
            body.end();
            let [nx, ny, nz, u, v] = rest.map(|v| v as f32);
            self.positions.push([x, y, z]);
            if has_normals {
                self.normals.push([nx, ny, nz]);
            }
            if has_uvs {
                self.uvs.push([u, v]);
            }
        }
        self.complete = true;
        Ok(())
    }

    fn index(&self, value: u32, body: &Body) -> Result<u32, String> {
        let there = self.positions.len();
        if self.complete && value as usize >= there {
            let message = format!("a face refers to vertex {value}, but there are {there}");
            return Err(body.fault(&message));
        }
        Ok(value)
    }

    fn faces(&mut self, element: &Element, body: &mut Body) -> Result<(), String> {
        let named =
            |p: &Property, names: &[&str]| p.list.is_some() && names.contains(&p.name.as_str());
        let is_corners = |p: &Property| named(p, &["vertex_indices", "vertex_index"]);
        let is_uvs = |p: &Property| named(p, &["texcoord"]);
        if !element.properties.iter().any(is_corners) {
            return Err("element \"face\" has no list vertex_indices".to_owned());
        }
        let has_uvs = element.properties.iter().any(is_uvs);
        let (mut corners, mut uvs) = (Vec::new(), Vec::new());
        for _ in 0..element.count {
            body.begin()?;
            corners.clear();
            uvs.clear();
            for property in &element.properties {
                match property.list {
                    Some(count) if is_corners(property) => {
                        let n = body.whole(count, "the number of corners of a face")?;
                        for _ in 0..n {
                            let v = body.whole(property.kind, "a vertex index")?;
                            corners.push(self.index(v, body)?);
                        }
                    }
                    Some(count) if is_uvs(property) => {
                        let n = body.whole(count, "the length of a list")?;
                        for _ in 0..n {
                            uvs.push(body.next(property.kind)? as f32);
                        }
                    }
                    _ => body.skip(property)?,
                }
            }
            body.end();
            self.small += usize::from(corners.len() < 3);
            let fits = uvs.len() == 2 * corners.len();
            self.unfit += usize::from(has_uvs && !fits);
            let uv = |i: usize| {
                if fits {
                    [uvs[2 * i], uvs[2 * i + 1]]
                } else {
                    [0.0; 2]
                }
            };
            for i in 2..corners.len() {
                self.triangles
                    .push([corners[0], corners[i - 1], corners[i]]);
                if has_uvs {
                    self.corner_uvs.push([uv(0), uv(i - 1), uv(i)]);
                }
            }
        }
        Ok(())
    }

    /// Strips of triangles; -1 ends one within a list.
    fn strips(&mut self, element: &Element, body: &mut Body) -> Result<(), String> {
        for _ in 0..element.count {
            body.begin()?;
            for property in &element.properties {
                let Some(count) = property
                    .list
                    .filter(|_| property.name.starts_with("vertex_ind"))
                else {
                    body.skip(property)?;
                    continue;
                };
                let n = body.whole(count, "the length of a strip")?;
                let mut last: [u32; 2] = [0; 2];
                let mut length = 0usize;
                for _ in 0..n {
                    let value = body.next(property.kind)?;
                    if value == -1.0 {
                        length = 0;
                        continue;
                    }
                    if value.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&value) {
                        return Err(body.fault(&format!(
                            "a vertex index is {value} (allowed: whole numbers from 0, -1 between strips)"
                        )));
                    }
                    let v = self.index(value as u32, body)?;
                    length += 1;
                    if length >= 3 {
                        let [a, b] = last;
                        // every second triangle runs the other way
                        let triangle = if length.is_multiple_of(2) {
                            [b, a, v]
                        } else {
                            [a, b, v]
                        };
                        self.triangles.push(triangle);
                    }
                    last = [last[1], v];
                }
            }
            body.end();
        }
        Ok(())
    }

    fn mesh(mut self, mut notes: Vec<String>) -> Result<Loaded, String> {
        if self.small > 0 {
            notes.push(format!(
                "{} faces of fewer than three corners are left out",
                self.small
            ));
        }
        if self.unfit > 0 {
            notes.push(format!(
                "{} faces have texture coordinates that do not fit their corners: 0, 0 is taken",
                self.unfit
            ));
        }
        if self.triangles.is_empty() {
            return Err("no faces".to_owned());
        }
        let there = self.positions.len();
        if let Some(v) = self
            .triangles
            .as_flattened()
            .iter()
            .find(|v| **v as usize >= there)
        {
            return Err(format!(
                "a face refers to vertex {v}, but there are {there}"
            ));
        }
        if self.corner_uvs.len() == self.triangles.len() {
            self.unroll();
        }
        let Placed {
            origin,
            positions,
            note,
        } = placed(&self.positions, &self.triangles);
        notes.extend(note);
        let normals = (!self.normals.is_empty()).then_some(self.normals);
        let uvs = (!self.uvs.is_empty()).then_some(self.uvs);
        let mesh =
            Mesh::new(&positions, normals, uvs, self.triangles).map_err(|e| e.to_string())?;
        Ok(Loaded {
            mesh,
            origin,
            notes,
        })
    }

    /// Gives every corner a vertex of its own, with its texture coordinates.
    fn unroll(&mut self) {
        let corners = self.triangles.as_flattened();
        self.positions = corners
            .iter()
            .map(|&v| self.positions[v as usize])
            .collect();
        if !self.normals.is_empty() {
            self.normals = corners.iter().map(|&v| self.normals[v as usize]).collect();
        }
        self.uvs = self.corner_uvs.as_flattened().to_vec();
        self.triangles = (0..self.triangles.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
    }
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
            let loaded = read(&bytes).expect("valid");
            assert_eq!(loaded.notes, [""; 0]);
            let mesh = loaded.mesh;
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
                "line 13: \"x\" is not a number",
            ),
            (
                text("0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 9"),
                "line 14: a face refers to vertex 9, but there are 4",
            ),
            (
                text("0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 -2"),
                "line 14: a vertex index is -2 (allowed: whole numbers from 0)",
            ),
            (
                text("nan 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2"),
                "line 10: a coordinate is NaN",
            ),
            (
                text("0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1"),
                "line 14: fewer numbers than the element has",
            ),
            (
                text("0 0 0\n1 0 0\n1 1 0\n\n0 1\n0\n3 0 1 2"),
                "line 14: fewer numbers than the element has",
            ),
            (
                text("0 0 0\n1 0 0\n1 1 0\n0 1 0 4 4\n"),
                "claims 1 of element \"face\", 0 bytes are left: truncated or damaged",
            ),
        ] {
            assert_eq!(
                read(file.as_bytes()).map(|_| ()).err().as_deref(),
                Some(message),
                "{file}"
            );
        }
    }

    #[test]
    fn what_is_more_than_declared_is_said() {
        let text = format!(
            "ply\nformat ascii 1.0\ncomment TextureFile wood.png\n{HEADER}0 0 0\n1 0 0 9\n1 1 0 9\n0 1 0\n3 0 1 2 7 7\n1 2\n"
        );
        let loaded = read(text.as_bytes()).expect("valid");
        assert_eq!(loaded.mesh.triangle_count(), 1);
        assert_eq!(
            loaded.notes,
            [
                "line 3: texture \"wood.png\" is not read",
                "line 12: more numbers than the element has (3 lines in all)",
                "line 16: more lines than elements: not read"
            ]
        );
        let mut bytes = binary(false);
        bytes.push(7);
        let notes = read(&bytes).expect("valid").notes;
        assert_eq!(notes, ["1 bytes after the last element are not read"]);
    }

    #[test]
    fn strips_and_coordinates_of_corners() {
        let vertices = "element vertex 4\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\n";
        let corners = "0 0 0 1\n1 0 0 1\n0 1 0 1\n1 1 0 1\n";
        let strips = format!(
            "ply\nformat ascii 1.0\n{vertices}element tristrips 1\nproperty list int int vertex_indices\nend_header\n{corners}8 0 1 2 3 -1 0 1 2\n"
        );
        let loaded = read(strips.as_bytes()).expect("valid");
        assert_eq!(loaded.mesh.triangle_count(), 3);
        assert_eq!(loaded.notes, ["vertex colors are not read"]);
        let wedges = format!(
            "ply\nformat ascii 1.0\n{vertices}element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n{corners}4 0 1 3 2 8 0 0 1 0 1 1 0 1\n"
        );
        let (mut arrays, _) = elements(wedges.as_bytes()).expect("valid");
        arrays.unroll();
        assert_eq!(arrays.positions.len(), 6);
        // coordinates are the positions
        for (p, uv) in arrays.positions.iter().zip(&arrays.uvs) {
            assert_eq!([p[0], p[1]], uv.map(f64::from));
        }
    }
}
