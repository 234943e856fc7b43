//! CODE V command sequences (`.seq`): rotationally symmetric surfaces, decenters and tilts.
//!
//! Commands end at `;` or the end of a line, `&` continues a line, `!` begins a remark. Tilts ADE
//! and BDE are left-handed, CDE is right-handed; DAR undoes a decenter after the surface, BEN tilts
//! again after a mirror. Asphere A is that of r^4.

use super::glass;
use super::{LensError, MAX_SURFACES, number};
use crate::optics::{
    Aperture, Break, FieldKind, Interaction, LensSurface, Medium, Outline, Prescription, Profile,
    Surface, SystemAperture, Wavelength,
};
use crate::spectrum::Library;
use glam::DVec3;

/// Commands that do not bear on rays.
const PASSED_OVER: [&str; 15] = [
    "RDM", "LEN", "GO", "INI", "SLB", "CA", "THC", "CUC", "GLC", "KC", "CCY", "WTF", "PIM", "GL1",
    "OUT",
];
/// Letters of the coefficients of r^4, r^6, ...
const LETTERS: &str = "ABCDEFGHJ";
/// Most values of a list command.
const MAX_VALUES: usize = 100;

struct Row {
    line: usize,
    radius_or_curvature: f64,
    thickness: f64,
    medium: Option<Medium>,
    mirror: bool,
    conic: f64,
    even: Vec<f64>,
    semi_diameter: Option<f64>,
    decenter: DVec3,
    tilt_deg: DVec3,
    returns: bool,
    bends: bool,
    label: String,
}

struct Reader<'a> {
    library: &'a Library,
    name: String,
    notes: Vec<String>,
    unit: f64,
    uses_radii: bool,
    aperture: Option<SystemAperture>,
    wavelengths_nm: Vec<f64>,
    weights: Vec<f64>,
    reference: usize,
    field_kind: FieldKind,
    fields: [Vec<f64>; 2],
    rows: Vec<Row>,
    stop: Option<usize>,
    saw_image: bool,
}

/// Reads a lens.
///
/// # Errors
/// The first command that is not read, a glass that is not known, or a file without surfaces.
pub fn parse(text: &str, library: &Library) -> Result<Prescription, LensError> {
    let mut reader = Reader {
        library,
        name: String::new(),
        notes: Vec::new(),
        unit: 1.0,
        uses_radii: false,
        aperture: None,
        wavelengths_nm: Vec::new(),
        weights: Vec::new(),
        reference: 1,
        field_kind: FieldKind::AngleDeg,
        fields: [Vec::new(), Vec::new()],
        rows: Vec::new(),
        stop: None,
        saw_image: false,
    };
    for (line, command) in commands(text) {
        let words: Vec<&str> = command.split_whitespace().collect();
        if let Some((&name, values)) = words.split_first() {
            reader.command(&name.to_uppercase(), values, &command, line)?;
        }
    }
    reader.finish()
}

/// Commands with the line each begins at.
fn commands(text: &str) -> Vec<(usize, String)> {
    let mut out = Vec::new();
    let mut open = (0, String::new());
    for (i, line) in text.lines().enumerate() {
        let code = line.split('!').next().unwrap_or("").trim_end();
        let (code, goes_on) = match code.strip_suffix('&') {
            Some(code) => (code, true),
            None => (code, false),
        };
        if open.1.is_empty() {
            open.0 = i + 1;
        }
        open.1.push_str(code);
        open.1.push(' ');
        if goes_on {
            continue;
        }
        let (start, whole) = std::mem::take(&mut open);
        let mut quoted = None;
        let mut command = String::new();
        for c in whole.chars() {
            match (c, quoted) {
                (';', None) => out.push((start, std::mem::take(&mut command))),
                ('\'' | '"', None) => quoted = Some(c),
                (c, Some(q)) if c == q => quoted = None,
                _ => {}
            }
            if c != ';' || quoted.is_some() {
                command.push(c);
            }
        }
        out.push((start, command));
    }
    if !open.1.is_empty() {
        out.push(open);
    }
    out
}

impl Reader<'_> {
    fn command(
        &mut self,
        name: &str,
        values: &[&str],
        text: &str,
        line: usize,
    ) -> Result<(), LensError> {
        let bad = |message: String| LensError::new(line, message);
        let list = || -> Result<Vec<f64>, LensError> {
            if values.len() > MAX_VALUES {
                return Err(LensError::new(
                    line,
                    format!("more than {MAX_VALUES} numbers"),
                ));
            }
            values.iter().map(|v| number(v, line)).collect()
        };
        let one = || match values.first() {
            Some(word) => number(word, line),
            None => Err(LensError::new(line, "a number is missing")),
        };
        if name.starts_with('S')
            && (name[1..].is_empty()
                || name == "SO"
                || name == "SI"
                || name[1..].bytes().all(|b| b.is_ascii_digit()))
        {
            return self.surface(name, values, line);
        }
        match name {
            "TITLE" | "TIT" => {
                let quotes = ['\'', '"', ' '];
                let title = text
                    .trim()
                    .split_once(char::is_whitespace)
                    .map_or("", |p| p.1);
                self.name = title.trim().trim_matches(quotes).to_owned();
            }
            "DIM" => {
                self.unit = match values.first().map(|v| v.to_uppercase()).as_deref() {
                    Some("M" | "MM") => 1.0,
                    Some("C" | "CM") => 10.0,
                    Some("I" | "IN") => 25.4,
                    other => {
                        return Err(bad(format!(
                            "DIM {} (M, C or I)",
                            other.unwrap_or_default()
                        )));
                    }
                }
            }
            "EPD" => self.aperture = Some(SystemAperture::EntrancePupil(one()? * self.unit)),
            "FNO" => self.aperture = Some(SystemAperture::FNumber(one()?)),
            "NAO" => self.aperture = Some(SystemAperture::ObjectNa(one()?)),
            "WL" => self.wavelengths_nm = list()?,
            "WTW" => self.weights = list()?,
            "REF" => self.reference = one()?.clamp(1.0, 100.0) as usize,
            "XAN" | "XOB" | "XIM" | "YAN" | "YOB" | "YIM" => {
                self.field_kind = match &name[1..] {
                    "AN" => FieldKind::AngleDeg,
                    "OB" => FieldKind::ObjectHeight,
                    _ => FieldKind::ImageHeight,
                };
                let scale = if name.ends_with("AN") { 1.0 } else { self.unit };
                let values = list()?.into_iter().map(|v| v * scale).collect();
                self.fields[usize::from(name.starts_with('Y'))] = values;
            }
            "RDM" => self.uses_radii = values.first() != Some(&"N"),
            name if PASSED_OVER.contains(&name) => {
                if name == "SLB"
                    && let Some(row) = self.rows.last_mut()
                {
                    row.label = values.join(" ").trim_matches(['\'', '"']).to_owned();
                }
            }
            "VUX" | "VUY" | "VLX" | "VLY" => {
                if list()?.iter().any(|&v| v != 0.0) {
                    self.notes.push(format!("line {line}: vignetting factors ({name}) are passed over: apertures vignette"));
                }
            }
            _ => return self.surface_data(name, values, line),
        }
        Ok(())
    }

    fn surface(&mut self, name: &str, values: &[&str], line: usize) -> Result<(), LensError> {
        let &[radius, thickness, ref glass @ ..] = values else {
            return Err(LensError::new(
                line,
                format!("{name} takes a radius and a thickness"),
            ));
        };
        if self.rows.len() == MAX_SURFACES {
            return Err(LensError::new(
                line,
                format!("more than {MAX_SURFACES} surfaces"),
            ));
        }
        if self.saw_image {
            return Err(LensError::new(line, "a surface after the image (SI)"));
        }
        self.saw_image = name == "SI";
        let (medium, mirror) = match glass.first() {
            None => (None, false),
            Some(word) if word.eq_ignore_ascii_case("AIR") => (None, false),
            Some(word) if word.eq_ignore_ascii_case("REFL") => (None, true),
            Some(word) => (Some(self.glass(word, line)?), false),
        };
        self.rows.push(Row {
            line,
            radius_or_curvature: number(radius, line)?,
            thickness: number(thickness, line)?,
            medium,
            mirror,
            conic: 0.0,
            even: Vec::new(),
            semi_diameter: None,
            decenter: DVec3::ZERO,
            tilt_deg: DVec3::ZERO,
            returns: false,
            bends: false,
            label: String::new(),
        });
        Ok(())
    }

    fn glass(&mut self, word: &str, line: usize) -> Result<Medium, LensError> {
        let word = word.trim_matches(['\'', '"']);
        let (name, catalog) = match word.split_once('_') {
            Some((name, catalog)) => (name, Some(catalog)),
            None => (word, None),
        };
        // six digits are a code of n_d - 1 and V_d: 517642, 517642.251 or 517.642
        let digits: String = name.chars().filter(char::is_ascii_digit).collect();
        let is_code = digits.len() >= 6 && name.chars().all(|c| c.is_ascii_digit() || c == '.');
        let medium = if is_code && catalog.is_none() {
            let part = |from: usize| digits[from..from + 3].parse::<f64>().unwrap_or(0.0);
            let (n_d, v_d) = (1.0 + part(0) / 1000.0, part(3) / 10.0);
            self.notes.push(format!("line {line}: glass code {word} as a model glass of n_d {n_d} and V_d {v_d}, n = a + b / lambda^2"));
            glass::model(n_d, v_d)
        } else {
            glass::plain_named(name, catalog, self.library)
        };
        medium.map_err(|message| LensError::new(line, message))
    }

    /// A command about the last surface.
    fn surface_data(&mut self, name: &str, values: &[&str], line: usize) -> Result<(), LensError> {
        let unit = self.unit;
        let count = self.rows.len();
        let Some(row) = self.rows.last_mut() else {
            return Err(LensError::new(
                line,
                format!("{name} is not read, or stands before the first surface"),
            ));
        };
        let one = || match values.first() {
            Some(word) => number(word, line),
            None => Err(LensError::new(line, format!("{name} takes a number"))),
        };
        match name {
            "STO" => {
                if count < 2 {
                    return Err(LensError::new(line, "the object cannot be the stop"));
                }
                self.stop = Some(count - 2);
            }
            "CON" | "ASP" | "SPH" | "XTO" => {
                if name == "XTO" {
                    return Err(LensError::new(line, "surfaces are SPH, CON or ASP"));
                }
            }
            "K" => row.conic = one()?,
            "CUY" => {
                row.radius_or_curvature = if self.uses_radii {
                    1.0 / one()?
                } else {
                    one()?
                }
            }
            "RDY" => {
                row.radius_or_curvature = if self.uses_radii {
                    one()?
                } else {
                    1.0 / one()?
                }
            }
            "THI" => row.thickness = one()?,
            "CIR" => {
                // EDG is the ground edge, OBS an obscuration
                match values {
                    [word] => row.semi_diameter = Some(number(word, line)?.abs() * unit),
                    [kind, _] if kind.eq_ignore_ascii_case("EDG") => {}
                    _ => {
                        return Err(LensError::new(
                            line,
                            "CIR takes a radius, or EDG and a radius",
                        ));
                    }
                }
            }
            "XDE" => row.decenter.x = one()? * unit,
            "YDE" => row.decenter.y = one()? * unit,
            "ZDE" => row.decenter.z = one()? * unit,
            "ADE" => row.tilt_deg.x = -one()?,
            "BDE" => row.tilt_deg.y = -one()?,
            "CDE" => row.tilt_deg.z = one()?,
            "DAR" => row.returns = true,
            "BEN" => row.bends = true,
            letter if letter.len() == 1 && LETTERS.contains(letter) => {
                let power = LETTERS.find(letter).unwrap_or(0);
                // a coefficient of r^p has the dimension of length^(1 - p)
                let exponent = 4 + 2 * i32::try_from(power).unwrap_or(0);
                let value = one()? * unit.powi(1 - exponent);
                if row.even.len() < power + 2 {
                    row.even.resize(power + 2, 0.0);
                }
                row.even[power + 1] = value;
            }
            _ => {
                let known = "S, STO, K, CON, ASP, A to J, CIR, XDE to CDE, DAR, BEN";
                return Err(LensError::new(
                    line,
                    format!("command {name} is not read (of surfaces: {known})"),
                ));
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Prescription, LensError> {
        let last_line = self.rows.last().map_or(1, |r| r.line);
        if self.rows.len() < 3 || !self.saw_image {
            return Err(LensError::new(
                last_line,
                "an object (SO), surfaces (S) and an image (SI) are needed",
            ));
        }
        let stop = self
            .stop
            .ok_or_else(|| LensError::new(1, "no surface is the stop (STO)"))?;
        let object = self.rows.remove(0);
        let object_distance =
            (object.thickness.abs() < 1e10).then_some(object.thickness * self.unit);
        let object_medium = object.medium.clone().unwrap_or_else(Medium::air);
        let mut medium = object_medium.clone();
        let count = self.rows.len();
        let mut surfaces = Vec::with_capacity(count);
        for (i, row) in self.rows.iter().enumerate() {
            let curvature = match (self.uses_radii, row.radius_or_curvature) {
                (true, 0.0) => 0.0,
                (true, radius) => 1.0 / (radius * self.unit),
                (false, curvature) => curvature / self.unit,
            };
            let conic = row.conic;
            let profile = if row.even.is_empty() {
                Profile::Conic { curvature, conic }
            } else {
                let even = row.even.clone();
                Profile::EvenAsphere {
                    curvature,
                    conic,
                    even,
                }
            };
            if !row.mirror {
                medium = row.medium.clone().unwrap_or_else(Medium::air);
            }
            let moved = row.decenter != DVec3::ZERO || row.tilt_deg != DVec3::ZERO;
            let before = Break {
                decenter: row.decenter,
                tilt_deg: row.tilt_deg,
                reversed: false,
                thickness: 0.0,
            };
            let bend = Break {
                decenter: DVec3::ZERO,
                ..before
            };
            let after = match (row.returns, row.bends) {
                (true, _) => vec![before.inverse()],
                (_, true) => vec![bend],
                _ => Vec::new(),
            };
            let outline = row
                .semi_diameter
                .map_or(Outline::Open, |radius| Outline::Circle { radius });
            let aperture = Aperture {
                outline,
                ..Aperture::OPEN
            };
            surfaces.push(Surface {
                comment: row.label.clone(),
                shape: LensSurface::new(profile, aperture),
                thickness: if i + 1 == count {
                    0.0
                } else {
                    row.thickness * self.unit
                },
                medium: medium.clone(),
                interaction: if row.mirror {
                    Interaction::Reflect
                } else {
                    Interaction::Refract
                },
                coating: None,
                before: if moved { vec![before] } else { Vec::new() },
                after: if moved { after } else { Vec::new() },
                line: row.line,
            });
        }
        let count = self.fields[0].len().max(self.fields[1].len()).max(1);
        let field = |axis: usize, i: usize| self.fields[axis].get(i).copied().unwrap_or(0.0);
        let fields = (0..count).map(|i| [field(0, i), field(1, i)]).collect();
        let weight = |i: usize| self.weights.get(i).copied().unwrap_or(1.0);
        let of = |(i, &nm): (usize, &f64)| Wavelength {
            nm,
            weight: weight(i),
        };
        let mut wavelengths: Vec<Wavelength> =
            self.wavelengths_nm.iter().enumerate().map(of).collect();
        let mut primary = (self.reference - 1).min(wavelengths.len().saturating_sub(1));
        if wavelengths.is_empty() {
            self.notes.push("no wavelengths: F, d and C".to_owned());
            (wavelengths, primary) = (Prescription::default_wavelengths(), 1);
        }
        Ok(Prescription {
            name: self.name,
            notes: self.notes,
            wavelengths,
            primary,
            aperture: self.aperture.unwrap_or(SystemAperture::StopSize),
            field_kind: self.field_kind,
            fields,
            object_distance,
            object_medium,
            surfaces,
            stop,
        })
    }
}
