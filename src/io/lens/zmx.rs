//! Zemax OpticStudio lens files (`.zmx`), sequential.
//!
//! One keyword a line; `SURF` begins a surface. Read: STANDARD, EVENASPH, ODDASPHE, TOROIDAL and
//! COORDBRK surfaces (a missing TYPE is STANDARD), circular, annular and rectangular apertures,
//! glasses by the catalogs of GCAT, mirrors, model glasses.

use super::glass;
use super::{LensError, MAX_COEFFICIENTS, MAX_SURFACES, number};
use crate::optics::{
    Aperture, Break, FieldKind, Interaction, LensSurface, Medium, Outline, Prescription, Profile,
    Surface, SystemAperture, Wavelength,
};
use crate::spectrum::Library;
use glam::{DVec2, DVec3};

/// Keywords that do not bear on rays: remarks, drawing, tolerances, settings of analyses.
const PASSED_OVER: [&str; 44] = [
    "VERS", "MODE", "NOTE", "SDMA", "TYCO", "FWGN", "ENVD", "HIDE", "SLAB", "POPS", "FLAP", "MEMA",
    "BLNK", "TOL", "MNUM", "MOFF", "TOLS", "GFAC", "GSTD", "RAIM", "PUSH", "RSCE", "RWRE", "DWGN",
    "COFN", "PFIL", "LANG", "PICB", "EFFL", "GLRS", "SCBD", "SDSR", "SCOL", "ROPD", "CFIG", "PRIM",
    "FIMP", "NSCD", "TAPR", "PZUP", "LDSZ", "FLDR", "PKUP", "WWGT",
];
/// Keywords that would change rays if their numbers were not zero: vignetting factors.
const VIGNETTING: [&str; 5] = ["VDXN", "VDYN", "VCXN", "VCYN", "VANN"];

/// A surface as its lines say it.
struct Row {
    line: usize,
    type_line: usize,
    kind: String,
    comment: String,
    curvature: f64,
    thickness: f64,
    conic: f64,
    parameters: Vec<f64>,
    glass: Option<(usize, Vec<String>)>,
    semi_diameter: f64,
    outline: Option<Outline>,
    center: DVec2,
    is_stop: bool,
}

impl Row {
    fn new(line: usize) -> Self {
        Self {
            line,
            type_line: line,
            kind: String::from("STANDARD"),
            comment: String::new(),
            curvature: 0.0,
            thickness: 0.0,
            conic: 0.0,
            parameters: Vec::new(),
            glass: None,
            semi_diameter: 0.0,
            outline: None,
            center: DVec2::ZERO,
            is_stop: false,
        }
    }

    fn parameter(&self, i: usize) -> f64 {
        self.parameters.get(i - 1).copied().unwrap_or(0.0)
    }
}

/// Space before the surfaces.
struct Header {
    name: String,
    notes: Vec<String>,
    /// Millimeters per unit.
    unit: f64,
    aperture: Option<SystemAperture>,
    catalogs: Vec<String>,
    field_kind: FieldKind,
    counts: [usize; 2],
    fields: [Vec<f64>; 2],
    wavelengths: Vec<Wavelength>,
    primary: usize,
}

/// Reads a lens.
///
/// # Errors
/// The first line that is not understood, a glass that is not known, or a file without surfaces.
pub fn parse(text: &str, library: &Library) -> Result<Prescription, LensError> {
    let mut header = Header {
        name: String::new(),
        notes: Vec::new(),
        unit: 1.0,
        aperture: None,
        catalogs: Vec::new(),
        field_kind: FieldKind::AngleDeg,
        counts: [0, 0],
        fields: [Vec::new(), Vec::new()],
        wavelengths: Vec::new(),
        primary: 0,
    };
    let mut rows: Vec<Row> = Vec::new();
    for (i, text) in text.lines().enumerate() {
        let line = i + 1;
        let words: Vec<&str> = text.split_whitespace().collect();
        let Some((&keyword, values)) = words.split_first() else {
            continue;
        };
        if keyword == "SURF" {
            if rows.len() == MAX_SURFACES {
                return Err(LensError::new(
                    line,
                    format!("more than {MAX_SURFACES} surfaces"),
                ));
            }
            rows.push(Row::new(line));
            continue;
        }
        let known = match rows.last_mut() {
            Some(row) => {
                row_line(row, keyword, values, line)?
                    || header_line(&mut header, keyword, values, text, line)?
            }
            None => header_line(&mut header, keyword, values, text, line)?,
        };
        if known || PASSED_OVER.contains(&keyword) {
            continue;
        }
        if VIGNETTING.contains(&keyword) {
            if values
                .iter()
                .any(|v| v.parse::<f64>().is_ok_and(|v| v != 0.0))
            {
                header.notes.push(format!("line {line}: vignetting factors ({keyword}) are passed over: apertures vignette"));
            }
            continue;
        }
        let note = format!("keyword {keyword} is passed over");
        if !header.notes.iter().any(|n| n.contains(&note)) && header.notes.len() < 100 {
            header.notes.push(format!("line {line}: {note}"));
        }
    }
    assemble(header, &rows, library)
}

fn first(values: &[&str], line: usize) -> Result<f64, LensError> {
    match values.first() {
        Some(word) => number(word, line),
        None => Err(LensError::new(line, "a number is missing")),
    }
}

/// A number that may be written INFINITY.
fn distance(values: &[&str], line: usize) -> Result<f64, LensError> {
    match values.first() {
        Some(word) if word.eq_ignore_ascii_case("INFINITY") => Ok(f64::INFINITY),
        _ => first(values, line),
    }
}

fn index(values: &[&str], most: usize, line: usize) -> Result<usize, LensError> {
    let value = values.first().and_then(|v| v.parse::<usize>().ok());
    match value {
        Some(i) if (1..=most).contains(&i) => Ok(i),
        _ => Err(LensError::new(
            line,
            format!("a whole number from 1 to {most} is expected"),
        )),
    }
}

/// A line of a surface; false if it is none.
fn row_line(row: &mut Row, keyword: &str, values: &[&str], line: usize) -> Result<bool, LensError> {
    let pair = || -> Result<[f64; 2], LensError> {
        Ok([
            first(values, line)?,
            first(values.get(1..).unwrap_or_default(), line)?,
        ])
    };
    match keyword {
        "TYPE" => {
            row.kind = values.first().unwrap_or(&"STANDARD").to_string();
            row.type_line = line;
        }
        "COMM" => row.comment = values.join(" "),
        "CURV" => row.curvature = first(values, line)?,
        "DISZ" => row.thickness = distance(values, line)?,
        "CONI" => row.conic = first(values, line)?,
        "PARM" => {
            let i = index(values, MAX_COEFFICIENTS, line)?;
            let value = first(&values[1..], line)?;
            if row.parameters.len() < i {
                row.parameters.resize(i, 0.0);
            }
            row.parameters[i - 1] = value;
        }
        "XDAT" => {
            if values.get(1).is_some_and(|v| v.parse::<f64>() != Ok(0.0)) {
                return Err(LensError::new(
                    line,
                    "extra data of a surface (XDAT) is not read",
                ));
            }
        }
        "GLAS" => row.glass = Some((line, values.iter().map(|v| (*v).to_owned()).collect())),
        "DIAM" => row.semi_diameter = first(values, line)?.abs(),
        "STOP" => row.is_stop = true,
        "CLAP" => {
            let [inner, outer] = pair()?;
            row.outline = Some(if inner > 0.0 {
                Outline::Annulus { inner, outer }
            } else {
                Outline::Circle { radius: outer }
            });
        }
        "SQAP" => {
            row.outline = Some(Outline::Rectangle {
                half: pair()?.into(),
            });
        }
        "OBDC" => row.center = pair()?.into(),
        "OBSC" | "SQOB" | "ELAP" | "ELOB" | "UDAP" | "UDOB" | "SPID" | "GRTG" => {
            return Err(LensError::new(
                line,
                format!("{keyword} is not read (apertures: DIAM, CLAP, SQAP)"),
            ));
        }
        _ => return Ok(false),
    }
    Ok(true)
}

fn header_line(
    header: &mut Header,
    keyword: &str,
    values: &[&str],
    text: &str,
    line: usize,
) -> Result<bool, LensError> {
    let list = || -> Result<Vec<f64>, LensError> {
        if values.len() > 100 {
            return Err(LensError::new(line, "more than 100 numbers"));
        }
        values.iter().map(|v| number(v, line)).collect()
    };
    match keyword {
        "MODE" if values.first().is_some_and(|m| *m != "SEQ") => {
            return Err(LensError::new(
                line,
                "only sequential files are read (MODE SEQ)",
            ));
        }
        "NAME" => {
            header.name = text
                .trim_start()
                .trim_start_matches("NAME")
                .trim()
                .to_owned();
        }
        "UNIT" => {
            header.unit = match values.first().copied() {
                Some("MM") => 1.0,
                Some("CM") => 10.0,
                Some("IN" | "INCH") => 25.4,
                Some("METER" | "M") => 1000.0,
                other => {
                    let unit = other.unwrap_or_default();
                    return Err(LensError::new(
                        line,
                        format!("unit `{unit}` (MM, CM, IN, METER)"),
                    ));
                }
            }
        }
        "ENPD" => header.aperture = Some(SystemAperture::EntrancePupil(first(values, line)?)),
        "FNUM" => header.aperture = Some(SystemAperture::FNumber(first(values, line)?)),
        "OBNA" => header.aperture = Some(SystemAperture::ObjectNa(first(values, line)?)),
        "FLOA" => header.aperture = Some(SystemAperture::StopSize),
        "GCAT" => header.catalogs = values.iter().take(100).map(|v| (*v).to_owned()).collect(),
        "FTYP" => {
            header.field_kind = match values.first().copied() {
                Some("0") | None => FieldKind::AngleDeg,
                Some("1") => FieldKind::ObjectHeight,
                Some("2") => FieldKind::ImageHeight,
                Some(other) => {
                    return Err(LensError::new(
                        line,
                        format!(
                            "field type {other} (0 angle, 1 object height, 2 paraxial image height)"
                        ),
                    ));
                }
            };
            let count = |i: usize| values.get(i).and_then(|v| v.parse().ok()).unwrap_or(0);
            header.counts = [count(2), count(3)];
        }
        "XFLN" | "XFLD" => header.fields[0] = list()?,
        "YFLN" | "YFLD" => header.fields[1] = list()?,
        "WAVM" => {
            // a count of wavelengths may come before or after them: all are kept until the end
            let i = index(values, 100, line)?;
            let nm = first(values.get(1..).unwrap_or_default(), line)? * 1e3;
            let weight = values.get(2).map_or(Ok(1.0), |w| number(w, line))?;
            let unset = Wavelength {
                nm: 0.0,
                weight: 0.0,
            };
            if header.wavelengths.len() < i {
                header.wavelengths.resize(i, unset);
            }
            header.wavelengths[i - 1] = Wavelength { nm, weight };
        }
        "WAVL" => {
            let of = |um: f64| Wavelength {
                nm: um * 1e3,
                weight: 1.0,
            };
            header.wavelengths = list()?.into_iter().map(of).collect();
        }
        "PWAV" => header.primary = index(values, 100, line)? - 1,
        _ => return Ok(false),
    }
    Ok(true)
}

fn assemble(
    mut header: Header,
    rows: &[Row],
    library: &Library,
) -> Result<Prescription, LensError> {
    let last_line = rows.last().map_or(1, |r| r.line);
    if rows.len() < 3 {
        let message = format!(
            "{} surfaces (SURF; object, lens and image make at least 3)",
            rows.len()
        );
        return Err(LensError::new(last_line, message));
    }
    let unit = header.unit;
    let mut object_distance = None;
    let mut object_medium = Medium::air();
    let mut surfaces: Vec<Surface> = Vec::new();
    let mut pending: Vec<Break> = Vec::new();
    let mut stop = None;
    let mut medium = Medium::air();
    for (i, row) in rows.iter().enumerate() {
        let is_image = i + 1 == rows.len();
        if i == 0 {
            profile(row, unit)?;
            if row.thickness.is_finite() {
                object_distance = Some(row.thickness * unit);
            }
            if let Some(Found::Medium(found)) = medium_of(row, &mut header, library)? {
                object_medium = found.clone();
                medium = found;
            }
            continue;
        }
        if !row.thickness.is_finite() && !is_image {
            return Err(LensError::new(
                row.line,
                format!("surface {i} has an infinite thickness (only the object may)"),
            ));
        }
        let thickness = if is_image { 0.0 } else { row.thickness * unit };
        if row.kind == "COORDBRK" {
            pending.push(Break {
                decenter: DVec3::new(row.parameter(1), row.parameter(2), 0.0) * unit,
                tilt_deg: DVec3::new(row.parameter(3), row.parameter(4), row.parameter(5)),
                reversed: row.parameter(6) != 0.0,
                thickness,
            });
            continue;
        }
        let profile = profile(row, unit)?;
        let mut interaction = Interaction::Refract;
        match medium_of(row, &mut header, library)? {
            None => medium = Medium::air(),
            Some(Found::Mirror) => interaction = Interaction::Reflect,
            Some(Found::Medium(found)) => medium = found,
        }
        if row.is_stop {
            stop = Some(surfaces.len());
        }
        let radius = row.semi_diameter * unit;
        let outline = match row.outline {
            Some(Outline::Circle { radius }) => Outline::Circle {
                radius: radius * unit,
            },
            Some(Outline::Annulus { inner, outer }) => {
                let (inner, outer) = (inner * unit, outer * unit);
                Outline::Annulus { inner, outer }
            }
            Some(Outline::Rectangle { half }) => Outline::Rectangle { half: half * unit },
            _ if radius > 0.0 => Outline::Circle { radius },
            _ => Outline::Open,
        };
        let center = row.center * unit;
        surfaces.push(Surface {
            comment: row.comment.clone(),
            shape: LensSurface::new(profile, Aperture { outline, center }),
            thickness,
            medium: medium.clone(),
            interaction,
            coating: None,
            before: std::mem::take(&mut pending),
            after: Vec::new(),
            line: row.line,
        });
    }
    if !pending.is_empty() {
        return Err(LensError::new(
            last_line,
            "the last surface is a COORDBRK (the image is expected)",
        ));
    }
    let stop = stop.ok_or_else(|| LensError::new(1, "no surface is the STOP"))?;
    let aperture = header.aperture.map(|a| match a {
        SystemAperture::EntrancePupil(d) => SystemAperture::EntrancePupil(d * unit),
        other => other,
    });
    let fields = fields(&header, unit);
    let (wavelengths, primary) = wavelengths(&mut header)?;
    Ok(Prescription {
        name: header.name,
        notes: header.notes,
        wavelengths,
        primary,
        aperture: aperture.unwrap_or(SystemAperture::StopSize),
        field_kind: header.field_kind,
        fields,
        object_distance,
        object_medium,
        surfaces,
        stop,
    })
}

fn profile(row: &Row, unit: f64) -> Result<Profile, LensError> {
    let curvature = row.curvature / unit;
    let conic = row.conic;
    // a coefficient of r^p has the dimension of length^(1 - p)
    let powers = |first: i32, step: i32, from: usize| -> Vec<f64> {
        let list = row.parameters.get(from..).unwrap_or_default();
        let exponent = |i: usize| first + step * i32::try_from(i).unwrap_or(0);
        let scaled = list
            .iter()
            .enumerate()
            .map(|(i, a)| a * unit.powi(1 - exponent(i)));
        let mut out: Vec<f64> = scaled.collect();
        while out.last() == Some(&0.0) {
            out.pop();
        }
        out
    };
    Ok(match row.kind.as_str() {
        "STANDARD" => Profile::Conic { curvature, conic },
        "EVENASPH" => {
            let even = powers(2, 2, 0);
            Profile::EvenAsphere {
                curvature,
                conic,
                even,
            }
        }
        "ODDASPHE" => {
            let powers = powers(1, 1, 0);
            Profile::OddAsphere {
                curvature,
                conic,
                powers,
            }
        }
        "TOROIDAL" => {
            let radius = row.parameter(1) * unit;
            Profile::Toroid {
                curvature_x: if radius == 0.0 { 0.0 } else { 1.0 / radius },
                curvature_y: curvature,
                conic_y: conic,
                even_y: powers(2, 2, 1),
            }
        }
        other => {
            let allowed = "STANDARD, EVENASPH, ODDASPHE, TOROIDAL, COORDBRK";
            return Err(LensError::new(
                row.type_line,
                format!("surface type {other} is not read ({allowed})"),
            ));
        }
    })
}

enum Found {
    Mirror,
    Medium(Medium),
}

fn medium_of(
    row: &Row,
    header: &mut Header,
    library: &Library,
) -> Result<Option<Found>, LensError> {
    let Some((line, words)) = &row.glass else {
        return Ok(None);
    };
    let name = words.first().map_or("", String::as_str);
    if name.eq_ignore_ascii_case("MIRROR") {
        return Ok(Some(Found::Mirror));
    }
    let value = |i: usize| words.get(i).map_or(Ok(0.0), |w| number(w, *line));
    let is_model = name == "___BLANK" || words.get(1).is_some_and(|w| w == "1");
    let medium = if is_model {
        let (n_d, v_d) = (value(3)?, value(4)?);
        header.notes.push(format!(
            "line {line}: a model glass of n_d {n_d} and V_d {v_d}, as n = a + b / lambda^2"
        ));
        glass::model(n_d, v_d)
    } else {
        glass::named(name, &header.catalogs, library)
    };
    medium
        .map(|m| Some(Found::Medium(m)))
        .map_err(|message| LensError::new(*line, message))
}

fn fields(header: &Header, unit: f64) -> Vec<[f64; 2]> {
    let at = |axis: usize, i: usize| header.fields[axis].get(i).copied().unwrap_or(0.0);
    let given = header.fields[0].len().max(header.fields[1].len());
    let used = (0..given).rposition(|i| at(0, i) != 0.0 || at(1, i) != 0.0);
    let count = match header.counts[0] {
        0 => used.map_or(1, |i| i + 1),
        n => n.clamp(1, given.max(1)),
    };
    let scale = match header.field_kind {
        FieldKind::AngleDeg => 1.0,
        _ => unit,
    };
    (0..count)
        .map(|i| [at(0, i) * scale, at(1, i) * scale])
        .collect()
}

fn wavelengths(header: &mut Header) -> Result<(Vec<Wavelength>, usize), LensError> {
    let mut list = std::mem::take(&mut header.wavelengths);
    match header.counts[1] {
        0 => {
            // the rest of the table repeats one entry
            let distinct = |i: usize| (0..i).all(|j| list[j].nm != list[i].nm);
            let count = (0..list.len()).take_while(|&i| distinct(i)).count();
            list.truncate(count);
        }
        n => list.truncate(n),
    }
    list.retain(|w| w.nm > 0.0);
    if list.is_empty() {
        header.notes.push("no wavelengths: F, d and C".to_owned());
        return Ok((Prescription::default_wavelengths(), 1));
    }
    if list.iter().all(|w| w.weight == 0.0) {
        for wavelength in &mut list {
            wavelength.weight = 1.0;
        }
    }
    let primary = header.primary.min(list.len() - 1);
    Ok((list, primary))
}
