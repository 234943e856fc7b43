//! The statements of an OBJ file as vertices and faces (Wavefront, "Object Files", appendix B1 of
//! the Advanced Visualizer manual).
//!
//! A statement that is not understood costs that statement, and a note with its line; numbers and
//! indices of vertices and faces must be right.

use super::text::{Statement, Statements};
use std::collections::BTreeMap;

/// No texture coordinate or no normal.
pub const NONE: u32 = u32::MAX;
/// Most vertices, so that an index and [`NONE`] fit.
const MAX_VERTICES: usize = (1 << 31) - 1;
/// Most corners of all faces.
const MAX_CORNERS: usize = 1 << 30;

/// A message and the line it is about.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {message}")]
pub struct AtLine {
    /// Line, from 1.
    pub line: usize,
    /// Fault at the place.
    pub message: String,
}

/// A corner of a face: indices of its position, texture coordinates and normal.
pub type Corner = [u32; 3];

/// Faces with one name and material.
#[derive(Clone, Debug, Default)]
pub struct Group {
    /// Of the object or group they stand in.
    pub name: String,
    /// Name of their material and the line that says it.
    pub material: Option<(String, usize)>,
    /// Corners of all faces, one after the other.
    pub corners: Vec<Corner>,
    /// Per face: its number of corners, and its line.
    pub faces: Vec<(u32, u32)>,
}

/// Contents of a file.
#[derive(Clone, Debug, Default)]
pub struct Parsed {
    /// Positions as the file says them.
    pub positions: Vec<[f64; 3]>,
    /// Texture coordinates.
    pub uvs: Vec<[f32; 2]>,
    /// Normals.
    pub normals: Vec<[f32; 3]>,
    /// Faces in their order.
    pub groups: Vec<Group>,
    /// Names of material files, as they are written, with their lines.
    pub libraries: Vec<(String, usize)>,
    /// Notes on what was not understood.
    pub notes: Vec<String>,
}

/// How often something was passed over, and the first line of it.
#[derive(Default)]
struct Passed(BTreeMap<String, (usize, usize)>);

impl Passed {
    fn add(&mut self, what: &str, line: usize) {
        // a file of other things than statements has a new key on every line
        if self.0.len() < 20 || self.0.contains_key(what) {
            let entry = self.0.entry(what.to_owned()).or_insert((0, line));
            entry.0 += 1;
        }
    }

    fn notes(self) -> Vec<String> {
        let mut all: Vec<_> = self
            .0
            .into_iter()
            .map(|(what, (n, line))| (line, n, what))
            .collect();
        all.sort();
        all.into_iter()
            .map(|(line, n, what)| match n {
                1 => format!("line {line}: {what}"),
                _ => format!("line {line}: {what} ({n} times in all)"),
            })
            .collect()
    }
}

/// A key shown in a message: of bounded length, nothing that controls a terminal.
fn shown(text: &str) -> String {
    let clean = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    text.chars().take(40).map(clean).collect()
}

/// Parses a file.
///
/// # Errors
/// A vertex or face is wrong.
pub fn parse(bytes: &[u8]) -> Result<Parsed, AtLine> {
    let mut parsed = Parsed::default();
    let mut passed = Passed::default();
    let mut group = Group {
        name: "unnamed_object".to_owned(),
        ..Group::default()
    };
    let mut corners = 0;
    for statement in Statements::new(bytes) {
        let line = statement.line;
        match &*statement.key {
            "v" => {
                let values = numbers(&statement)?;
                let [x, y, z, rest @ ..] = values.as_slice() else {
                    return Err(wrong(&statement, "three numbers"));
                };
                match rest {
                    [] => {}
                    [w] if *w == 1.0 => {}
                    [_] => passed.add("weights of vertices are not read", line),
                    _ => passed.add("vertex colors are not read", line),
                }
                parsed.positions.push([*x, *y, *z]);
                if parsed.positions.len() > MAX_VERTICES {
                    return Err(wrong(&statement, "fewer vertices"));
                }
            }
            "vt" => match numbers(&statement)?.as_slice() {
                [] => return Err(wrong(&statement, "one to three numbers")),
                [u] => parsed.uvs.push([*u as f32, 0.0]),
                [u, v, ..] => parsed.uvs.push([*u as f32, *v as f32]),
            },
            "vn" => match numbers(&statement)?.as_slice() {
                [x, y, z, ..] => parsed.normals.push([*x as f32, *y as f32, *z as f32]),
                _ => return Err(wrong(&statement, "three numbers")),
            },
            "f" | "fo" => {
                let before = group.corners.len();
                for word in plain(&statement.rest).split_ascii_whitespace() {
                    let corner = corner(word, &parsed);
                    group.corners.push(corner.ok_or_else(|| AtLine {
                        line,
                        message: format!(
                            "face corner \"{}\" (allowed: v, v/vt, v//vn or v/vt/vn, whole numbers other than 0)",
                            shown(word)
                        ),
                    })?);
                }
                let count = group.corners.len() - before;
                if count < 3 {
                    group.corners.truncate(before);
                    passed.add("a face of fewer than three corners is left out", line);
                    continue;
                }
                corners += count;
                if corners > MAX_CORNERS {
                    return Err(wrong(&statement, "fewer faces"));
                }
                group.faces.push((count as u32, line as u32));
            }
            "o" | "g" => next(&mut parsed, &mut group, |g| {
                g.name = if statement.rest.is_empty() {
                    "unnamed_object".to_owned()
                } else {
                    statement.rest.to_string()
                };
            }),
            "usemtl" => next(&mut parsed, &mut group, |g| {
                let name = statement.rest.to_string();
                g.material = (!name.is_empty()).then_some((name, line));
            }),
            "mtllib" => parsed.libraries.push((statement.rest.to_string(), line)),
            "l" | "p" => passed.add("lines and points are no surfaces: ignored", line),
            // how faces are grouped and shaded elsewhere
            "s" | "mg" | "lod" | "shadow_obj" | "trace_obj" | "usemap" | "maplib" | "bevel"
            | "c_interp" | "d_interp" => {}
            other => passed.add(&format!("\"{}\" is not read", shown(other)), line),
        }
    }
    next(&mut parsed, &mut group, |_| {});
    check(&parsed)?;
    parsed.notes = passed.notes();
    Ok(parsed)
}

/// Ends a group and begins one that differs from it by `change`.
fn next(parsed: &mut Parsed, group: &mut Group, change: impl FnOnce(&mut Group)) {
    let mut new = Group {
        name: group.name.clone(),
        material: group.material.clone(),
        ..Group::default()
    };
    change(&mut new);
    let old = std::mem::replace(group, new);
    if !old.faces.is_empty() {
        parsed.groups.push(old);
    }
}

fn wrong(statement: &Statement, needed: &str) -> AtLine {
    AtLine {
        line: statement.line,
        message: format!(
            "\"{} {}\" (needed: {needed})",
            shown(&statement.key),
            shown(&statement.rest)
        ),
    }
}

/// Without what follows a `#` directly after a number.
fn plain(text: &str) -> &str {
    text.split('#').next().unwrap_or_default()
}

fn numbers(statement: &Statement) -> Result<arrayvec::ArrayVec<f64, 8>, AtLine> {
    let mut values = arrayvec::ArrayVec::new();
    for word in plain(&statement.rest).split_ascii_whitespace().take(8) {
        let value = word.parse().ok().filter(|v: &f64| (*v as f32).is_finite());
        values.push(value.ok_or_else(|| AtLine {
            line: statement.line,
            message: format!("\"{}\" is not a finite number", shown(word)),
        })?);
    }
    Ok(values)
}

/// A corner by its words; indices from 1, or from the end where negative.
fn corner(word: &str, parsed: &Parsed) -> Option<Corner> {
    let mut words = word.split('/');
    let mut index = |count: usize| -> Option<u32> {
        match words.next() {
            None | Some("") => Some(NONE),
            Some(text) => {
                let number: i64 = text.parse().ok()?;
                let index = match number {
                    0 => return None,
                    1.. => number - 1,
                    _ => i64::try_from(count).ok()? + number,
                };
                u32::try_from(index).ok().filter(|&i| i < NONE)
            }
        }
    };
    let corner = [
        index(parsed.positions.len())?,
        index(parsed.uvs.len())?,
        index(parsed.normals.len())?,
    ];
    (corner[0] != NONE && words.next().is_none()).then_some(corner)
}

/// Indices may run ahead of what they refer to, but not beyond it.
fn check(parsed: &Parsed) -> Result<(), AtLine> {
    let counts = [
        ("vertex", parsed.positions.len()),
        ("texture coordinates", parsed.uvs.len()),
        ("normal", parsed.normals.len()),
    ];
    for group in &parsed.groups {
        let mut corners = group.corners.iter();
        for &(count, line) in &group.faces {
            for corner in corners.by_ref().take(count as usize) {
                for (&index, (what, there)) in corner.iter().zip(counts) {
                    if index != NONE && index as usize >= there {
                        return Err(AtLine {
                            line: line as usize,
                            message: format!(
                                "a face refers to {what} {}, but there are {there}",
                                u64::from(index) + 1
                            ),
                        });
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

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn what_is_passed_over_is_said_with_its_first_line() {
        let text = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 1 1 0\nl 1 2 3 4\np 1\nfrob 1\nf 1 2\nf 1 2 3\nusemtl\n";
        let parsed = parse(text.as_bytes()).expect("valid");
        assert_eq!(parsed.groups.len(), 1);
        assert_eq!(
            parsed.notes,
            [
                "line 1: vertex colors are not read (2 times in all)",
                "line 4: lines and points are no surfaces: ignored (2 times in all)",
                "line 6: \"frob\" is not read",
                "line 7: a face of fewer than three corners is left out",
            ]
        );
    }

    #[test]
    fn groups_begin_where_a_name_or_a_material_changes() {
        let text = format!("{SQUARE}o a\nf 1 2 3\nusemtl red\nf -4 -3 -2\nusemtl \nf 1 2 4\n");
        let parsed = parse(text.as_bytes()).expect("valid");
        let of = |i: usize| {
            let g: &Group = &parsed.groups[i];
            (g.name.as_str(), g.material.as_ref().map(|m| m.0.as_str()))
        };
        assert_eq!(
            [of(0), of(1), of(2)],
            [("a", None), ("a", Some("red")), ("a", None)]
        );
        assert_eq!(parsed.groups[0].corners, parsed.groups[1].corners);
    }

    #[test]
    fn faults_name_their_line() {
        for (text, message) in [
            ("v 0 0", "line 1: \"v 0 0\" (needed: three numbers)"),
            ("\nv 0 0 x", "line 2: \"x\" is not a finite number"),
            ("v 0 0 1e39", "line 1: \"1e39\" is not a finite number"),
            (
                "v 0 0 0\nf 1 1 9",
                "line 2: a face refers to vertex 9, but there are 1",
            ),
            (
                "v 0 0 0\nf 1/1 1/1 1/1",
                "line 2: a face refers to texture coordinates 1, but there are 0",
            ),
            (
                "f 0 1 2",
                "line 1: face corner \"0\" (allowed: v, v/vt, v//vn or v/vt/vn, whole numbers other than 0)",
            ),
            (
                "f 1 2 -1",
                "line 1: face corner \"-1\" (allowed: v, v/vt, v//vn or v/vt/vn, whole numbers other than 0)",
            ),
        ] {
            let error = parse(text.as_bytes()).expect_err(text);
            assert_eq!(error.to_string(), message);
        }
    }
}
