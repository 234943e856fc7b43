//! Statements of MTL files (Wavefront, "MTL material format"; `Pr`, `Pm` and `norm` of the
//! extension for physically based shading), each parsed by tobj.
//!
//! tobj reads a file whole or not at all, and says no line. Statements are therefore handed to it
//! one by one, after lines are joined and comments and encodings dealt with: a statement that is
//! not understood costs that statement, and every note carries its line.

use crate::io::obj::text::{Statement, Statements};

/// A value and the line that says it.
#[derive(Clone, Debug, PartialEq)]
pub struct At<T> {
    pub line: usize,
    pub value: T,
}

/// A material as its file says it; `None`: not said.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMaterial {
    pub name: String,
    pub line: usize,
    pub diffuse: Option<[f64; 3]>,
    pub specular: Option<[f64; 3]>,
    pub emission: Option<[f64; 3]>,
    pub shininess: Option<f64>,
    pub index: Option<At<f64>>,
    pub illumination: Option<u8>,
    pub dissolve: Option<f64>,
    pub transparency: Option<f64>,
    pub roughness: Option<f64>,
    pub metal: Option<f64>,
    pub diffuse_map: Option<At<String>>,
    pub dissolve_map: Option<At<String>>,
    pub normal_map: Option<At<String>>,
}

/// The materials of a file, and what was not understood.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Materials {
    pub materials: Vec<RawMaterial>,
    pub notes: Vec<At<String>>,
}

/// Options of textures that take a fixed number of words.
const OPTIONS: [(&str, usize); 10] = [
    ("-blendu", 1),
    ("-blendv", 1),
    ("-bm", 1),
    ("-boost", 1),
    ("-cc", 1),
    ("-clamp", 1),
    ("-imfchan", 1),
    ("-mm", 2),
    ("-texres", 1),
    ("-type", 1),
];

/// Reads any bytes.
pub fn parse(bytes: &[u8]) -> Materials {
    let mut all = Materials::default();
    for statement in Statements::new(bytes) {
        let line = statement.line;
        if statement.key == "newmtl" {
            let name = statement.rest.to_string();
            if all.materials.iter().any(|m| m.name == name) {
                all.note(line, format!("material \"{name}\" is defined again"));
            }
            all.materials.push(RawMaterial {
                name,
                line,
                ..RawMaterial::default()
            });
            continue;
        }
        let Some(mut material) = all.materials.pop() else {
            all.note(
                line,
                "a statement before the first newmtl: ignored".to_owned(),
            );
            continue;
        };
        for note in material.take(&statement) {
            all.note(line, format!("material \"{}\": {note}", material.name));
        }
        all.materials.push(material);
    }
    all
}

impl Materials {
    fn note(&mut self, line: usize, value: String) {
        self.notes.push(At { line, value });
    }
}

/// A statement as tobj reads it, in a material of its own.
fn alone(key: &str, rest: &str) -> Option<tobj::Material> {
    let text = format!("newmtl alone\n{key} {rest}\n");
    let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes()).ok()?;
    materials.into_iter().next()
}

/// The finite numbers of a statement.
fn numbers(key: &str, rest: &str) -> Option<Vec<f64>> {
    let material = alone(key, rest)?;
    let one = |value: Option<f64>| value.map(|v| vec![v]);
    let values = match key {
        "Kd" => material.diffuse.map(Vec::from),
        "Ks" => material.specular.map(Vec::from),
        "Ke" => material.emissive.map(Vec::from),
        "Ni" => one(material.optical_density),
        "Ns" => one(material.shininess),
        "d" => one(material.dissolve),
        other => {
            let words = material.unknown_param.get(other)?.split_whitespace();
            words.map(|w| w.parse().ok()).collect()
        }
    }?;
    Some(values).filter(|all| all.iter().all(|v| v.is_finite()))
}

/// A number held to its range, with what is said where it was outside.
fn held(key: &str, value: f64, [low, high]: [f64; 2]) -> (f64, Option<String>) {
    let held = value.clamp(low, high);
    let note = (held != value)
        .then(|| format!("{key} {value} is taken as {held} (allowed: {low} to {high})"));
    (held, note)
}

impl RawMaterial {
    /// Takes a statement in; gives what is to be said of it.
    fn take(&mut self, statement: &Statement) -> Vec<String> {
        let (key, rest, line) = (&*statement.key, &*statement.rest, statement.line);
        let not_understood = || {
            vec![format!(
                "\"{key} {}\" is not understood: ignored",
                shown(rest)
            )]
        };
        let unit = [0.0, 1.0];
        let mut notes = Vec::new();
        match key {
            "Kd" | "Ks" | "Ke" => {
                // one number is a gray; tobj panics at two
                let words = match rest.split_whitespace().count() {
                    1 => [rest; 3].join(" "),
                    3 => rest.to_owned(),
                    _ => return not_understood(),
                };
                let Some(&[r, g, b]) = numbers(key, &words).as_deref() else {
                    return not_understood();
                };
                let color = [r, g, b];
                let range = if key == "Kd" { unit } else { [0.0, f64::MAX] };
                let color = color.map(|v| {
                    let (v, note) = held(key, v, range);
                    notes.extend(note);
                    v
                });
                match key {
                    "Kd" => self.diffuse = Some(color),
                    "Ks" => self.specular = Some(color),
                    _ => self.emission = Some(color),
                }
            }
            "d" => {
                let (halo, text) = match rest.strip_prefix("-halo") {
                    Some(text) => (true, text),
                    None => (false, rest),
                };
                let Some(&[value]) = numbers(key, text).as_deref() else {
                    return not_understood();
                };
                let (value, note) = held(key, value, unit);
                notes.extend(note);
                if halo {
                    notes.push(format!("-halo is not read: d {value} from all sides"));
                }
                self.dissolve = Some(value);
            }
            "Tr" | "Pr" | "Pm" | "Ns" | "Ni" => {
                let Some(&[value, ..]) = numbers(key, rest).as_deref() else {
                    return not_understood();
                };
                let range = match key {
                    "Ns" => [0.0, f64::MAX],
                    "Ni" => [0.0, 10.0],
                    _ => unit,
                };
                let (value, note) = held(key, value, range);
                notes.extend(note);
                match key {
                    "Tr" => self.transparency = Some(value),
                    "Pr" => self.roughness = Some(value),
                    "Pm" => self.metal = Some(value),
                    "Ns" => self.shininess = Some(value),
                    _ => self.index = Some(At { line, value }),
                }
            }
            "illum" => match alone(key, rest).and_then(|m| m.illumination_model) {
                Some(model @ 0..=9) => self.illumination = Some(model),
                Some(10) => {
                    self.illumination = Some(10);
                    notes.push(
                        "illum 10 (shadows on what is not seen) is rendered as illum 1".into(),
                    );
                }
                _ => {
                    return vec![format!(
                        "illum {} is not understood (allowed: 0 to 10)",
                        shown(rest)
                    )];
                }
            },
            "map_Kd" | "map_d" | "norm" => {
                let (name, options) = texture_name(rest);
                if name.is_empty() {
                    return not_understood();
                }
                if !options.is_empty() {
                    notes.push(format!("options {} of {key} are not read", shown(&options)));
                }
                let value = Some(At { line, value: name });
                match key {
                    "map_Kd" => self.diffuse_map = value,
                    "map_d" => self.dissolve_map = value,
                    _ => self.normal_map = value,
                }
            }
            // the light from all around is what is rendered
            "Ka" => {}
            other => notes.push(format!("{} is not read", shown(other))),
        }
        notes
    }
}

/// The name of a texture, which may hold blanks, and the options before it.
fn texture_name(text: &str) -> (String, String) {
    let mut rest = text.trim();
    let start = rest;
    let next = |rest: &str| {
        let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
        (rest[..end].to_owned(), end)
    };
    while rest.starts_with('-') {
        let (option, end) = next(rest);
        let most = match OPTIONS.iter().find(|o| o.0 == option) {
            Some(&(_, count)) => count,
            None if ["-o", "-s", "-t"].contains(&option.as_str()) => 3,
            None => break,
        };
        rest = rest[end..].trim_start();
        for _ in 0..most {
            let (word, end) = next(rest);
            // one to three numbers follow -o, -s and -t
            if most == 3 && word.parse::<f64>().is_err() {
                break;
            }
            rest = rest[end..].trim_start();
        }
    }
    let options = start[..start.len() - rest.len()].trim().to_owned();
    (rest.to_owned(), options)
}

/// Text of a file in a message: of bounded length, nothing that controls a terminal.
pub fn shown(text: &str) -> String {
    let clean = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    text.chars().take(60).map(clean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn notes(text: &str) -> Vec<String> {
        let all = parse(text.as_bytes());
        all.notes
            .iter()
            .map(|n| format!("{}: {}", n.line, n.value))
            .collect()
    }

    #[test]
    fn one_odd_statement_costs_that_statement() {
        let text = "Ka 1\nnewmtl a\nKd 0.5\nKs spectral x.rfl\nd -halo 0.6\nNs nan\nillum 11\nTs 3\nmap_Kd\nKa 0\nPr 3\n";
        assert_eq!(
            notes(text),
            [
                "1: a statement before the first newmtl: ignored",
                "4: material \"a\": \"Ks spectral x.rfl\" is not understood: ignored",
                "5: material \"a\": -halo is not read: d 0.6 from all sides",
                "6: material \"a\": \"Ns nan\" is not understood: ignored",
                "7: material \"a\": illum 11 is not understood (allowed: 0 to 10)",
                "8: material \"a\": Ts is not read",
                "9: material \"a\": \"map_Kd \" is not understood: ignored",
                "11: material \"a\": Pr 3 is taken as 1 (allowed: 0 to 1)",
            ]
        );
        let all = parse(text.as_bytes());
        assert_eq!(all.materials[0].diffuse, Some([0.5; 3]));
        assert_eq!(all.materials[0].dissolve, Some(0.6));
    }

    #[test]
    fn names_of_textures_may_follow_options_and_hold_blanks() {
        for (text, name, options) in [
            ("a.png", "a.png", ""),
            ("my wood.png", "my wood.png", ""),
            ("-s 1 2 -clamp on 3 d.png", "3 d.png", "-s 1 2 -clamp on"),
            ("-mm 0 1 -o 1 1 1 a b.png", "a b.png", "-mm 0 1 -o 1 1 1"),
            ("-unknown.png", "-unknown.png", ""),
            ("-bm", "", "-bm"),
        ] {
            assert_eq!(texture_name(text), (name.to_owned(), options.to_owned()));
        }
    }
}
