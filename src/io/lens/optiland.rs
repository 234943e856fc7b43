//! Lenses as optiland writes them: JSON with surfaces placed in the coordinates of the system.
//!
//! The numbers Infinity and NaN, which JSON has not, are read. Rotations are right-handed, about x,
//! then y, then z of the system. Errors name the surface, and the line where JSON itself is broken.

use super::glass;
use super::{LensError, MAX_COEFFICIENTS, MAX_SURFACES};
use crate::optics::prescription::Frame;
use crate::optics::{
    Aperture, Break, FieldKind, Interaction, LensSurface, Medium, Outline, Prescription, Profile,
    Surface, SystemAperture, Wavelength,
};
use crate::spectrum::{Ior, Library};
use glam::{DMat3, DVec3, EulerRot};
use serde_json::Value;

type Found<T> = Result<T, String>;

/// Reads a lens.
///
/// # Errors
/// If it is not JSON of this form, or holds what is not read.
pub fn parse(text: &str, library: &Library) -> Result<Prescription, LensError> {
    let json: Value = serde_json::from_str(&quoted_infinities(text))
        .map_err(|e| LensError::new(e.line().max(1), e.to_string()))?;
    prescription(&json, library).map_err(|message| LensError::new(1, message))
}

/// Infinity and NaN outside of strings become strings.
fn quoted_infinities(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    let (mut in_string, mut escaped) = (false, false);
    while let Some(c) = rest.chars().next() {
        let word = ["-Infinity", "Infinity", "NaN"]
            .into_iter()
            .find(|w| !in_string && rest.starts_with(w));
        if let Some(word) = word {
            out.push('"');
            out.push_str(word);
            out.push('"');
            rest = &rest[word.len()..];
            continue;
        }
        if c == '"' && !escaped {
            in_string = !in_string;
        }
        escaped = c == '\\' && !escaped;
        out.push(c);
        rest = &rest[c.len_utf8()..];
    }
    out
}

/// A number; infinite ones are strings by now.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::String(s) => s.parse().ok(),
        Value::Array(list) if list.len() == 1 => number(&list[0]),
        other => other.as_f64(),
    }
}

fn get(value: &Value, key: &str) -> Found<f64> {
    number(&value[key]).ok_or_else(|| format!("`{key}` is not a number"))
}

fn finite(value: &Value, key: &str) -> Found<f64> {
    match get(value, key)? {
        v if v.is_finite() => Ok(v),
        v => Err(format!("`{key}` is {v} (a finite number)")),
    }
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_default()
}

fn list<'a>(value: &'a Value, what: &str) -> Found<&'a [Value]> {
    let list = value
        .as_array()
        .ok_or_else(|| format!("no list of {what}"))?;
    if list.len() > MAX_SURFACES {
        return Err(format!("more than {MAX_SURFACES} {what}"));
    }
    Ok(list)
}

fn prescription(json: &Value, library: &Library) -> Found<Prescription> {
    let rows = list(&json["surface_group"]["surfaces"], "surfaces")?;
    if rows.len() < 3 {
        return Err(format!(
            "{} surfaces (object, lens and image make at least 3)",
            rows.len()
        ));
    }
    let mut notes = Vec::new();
    let at = |i: usize| move |message: String| format!("surface {i}: {message}");
    let mut medium = material(&rows[0]["material_post"], library, &mut notes).map_err(at(0))?;
    let object_medium = medium.clone();
    let object_z = get(&rows[0]["geometry"]["cs"], "z").map_err(at(0))?;
    let mut surfaces: Vec<Surface> = Vec::new();
    let mut stop = None;
    let mut last = Frame::SYSTEM;
    let mut first_z = 0.0;
    for (i, row) in rows.iter().enumerate().skip(1) {
        if !matches!(text(row, "type"), "Surface" | "ImageSurface") {
            return Err(format!(
                "surface {i}: type `{}` is not read",
                text(row, "type")
            ));
        }
        let geometry = &row["geometry"];
        let mut frame = frame(&geometry["cs"]).map_err(at(i))?;
        if i == 1 {
            first_z = frame.origin.z;
        }
        frame.origin.z -= first_z;
        let mut before = Vec::new();
        let turn = last.rotation.transpose() * frame.rotation;
        let offset = last.to_local(frame.origin);
        let along_axis =
            turn.abs_diff_eq(DMat3::IDENTITY, 1e-15) && offset.truncate().length() < 1e-12;
        match surfaces.last_mut() {
            Some(previous) if along_axis => previous.thickness = offset.z,
            _ if along_axis && offset.z == 0.0 => {}
            _ => {
                let (x, y, z) = turn.to_euler(EulerRot::XYZ);
                before.push(Break {
                    decenter: offset,
                    tilt_deg: DVec3::new(x, y, z) * (180.0 / std::f64::consts::PI),
                    reversed: false,
                    thickness: 0.0,
                });
            }
        }
        last = frame;
        let is_mirror = row["interaction_model"]["is_reflective"].as_bool() == Some(true)
            || text(&row["material_post"], "type") == "Mirror";
        if !row["interaction_model"]["coating"].is_null() {
            notes.push(format!("surface {i}: its coating is passed over"));
        }
        if !is_mirror {
            medium = material(&row["material_post"], library, &mut notes).map_err(at(i))?;
        }
        if row["is_stop"].as_bool() == Some(true) {
            stop = Some(surfaces.len());
        }
        let shape = LensSurface::new(
            profile(geometry).map_err(at(i))?,
            aperture(&row["aperture"]).map_err(at(i))?,
        );
        let interaction = if is_mirror {
            Interaction::Reflect
        } else {
            Interaction::Refract
        };
        surfaces.push(Surface {
            comment: text(row, "comment").to_owned(),
            shape,
            thickness: 0.0,
            medium: medium.clone(),
            interaction,
            coating: None,
            before,
            after: Vec::new(),
            line: 0,
        });
    }
    let (wavelengths, primary) = wavelengths(json)?;
    let (field_kind, fields) = fields(json)?;
    Ok(Prescription {
        name: text(json, "name").to_owned(),
        notes,
        wavelengths,
        primary,
        aperture: system_aperture(&json["aperture"])?,
        field_kind,
        fields,
        object_distance: object_z.is_finite().then_some(first_z - object_z),
        object_medium,
        surfaces,
        stop: stop.ok_or("no surface is the stop")?,
    })
}

fn frame(cs: &Value) -> Found<Frame> {
    let origin = DVec3::new(finite(cs, "x")?, finite(cs, "y")?, finite(cs, "z")?);
    let [x, y, z] = [finite(cs, "rx")?, finite(cs, "ry")?, finite(cs, "rz")?];
    if !cs["reference_cs"].is_null() {
        return Err("nested coordinate systems are not read".to_owned());
    }
    let rotation =
        DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x);
    Ok(Frame { rotation, origin })
}

fn coefficients(geometry: &Value, key: &str) -> Found<Vec<f64>> {
    let Some(list) = geometry[key].as_array() else {
        return Ok(Vec::new());
    };
    if list.len() > MAX_COEFFICIENTS {
        return Err(format!("more than {MAX_COEFFICIENTS} coefficients"));
    }
    let one = |v: &Value| number(v).filter(|v| v.is_finite());
    let all: Option<Vec<f64>> = list.iter().map(one).collect();
    all.ok_or_else(|| "coefficients must be finite numbers".to_owned())
}

fn curvature(geometry: &Value, key: &str) -> Found<f64> {
    match get(geometry, key)? {
        radius if radius == 0.0 || radius.is_nan() => Err(format!("`{key}` is {radius} (not 0)")),
        radius => Ok(1.0 / radius),
    }
}

fn profile(geometry: &Value) -> Found<Profile> {
    let conic = match &geometry["conic"] {
        Value::Null => 0.0,
        _ => finite(geometry, "conic")?,
    };
    Ok(match text(geometry, "type") {
        "Plane" => Profile::PLANE,
        "StandardGeometry" => Profile::Conic {
            curvature: curvature(geometry, "radius")?,
            conic,
        },
        "EvenAsphere" => Profile::EvenAsphere {
            curvature: curvature(geometry, "radius")?,
            conic,
            even: coefficients(geometry, "coefficients")?,
        },
        "OddAsphere" => Profile::OddAsphere {
            curvature: curvature(geometry, "radius")?,
            conic,
            powers: coefficients(geometry, "coefficients")?,
        },
        "ToroidalGeometry" => Profile::Toroid {
            curvature_x: curvature(geometry, "radius_x")?,
            curvature_y: curvature(geometry, "radius_y")?,
            conic_y: conic,
            even_y: coefficients(geometry, "coeffs_poly_y")?,
        },
        other => {
            let allowed = "Plane, StandardGeometry, EvenAsphere, OddAsphere, ToroidalGeometry";
            return Err(format!("geometry `{other}` is not read ({allowed})"));
        }
    })
}

fn aperture(value: &Value) -> Found<Aperture> {
    match text(value, "type") {
        "" if value.is_null() => Ok(Aperture::OPEN),
        "RadialAperture" => {
            let outer = finite(value, "r_max")?;
            let inner = finite(value, "r_min")?;
            let outline = match inner {
                0.0 => Outline::Circle { radius: outer },
                inner => Outline::Annulus { inner, outer },
            };
            Ok(Aperture {
                outline,
                ..Aperture::OPEN
            })
        }
        other => Err(format!("aperture `{other}` is not read (RadialAperture)")),
    }
}

fn material(value: &Value, library: &Library, notes: &mut Vec<String>) -> Found<Medium> {
    match text(value, "type") {
        "IdealMaterial" => {
            let n = finite(value, "index")?;
            if n == 1.0 {
                return Ok(Medium::air());
            }
            Ok(Medium::new(Ior::constant(n)))
        }
        "Material" => {
            let catalog = [&value["catalog"], &value["reference"]];
            let catalogs: Vec<String> = catalog
                .into_iter()
                .filter_map(Value::as_str)
                .map(str::to_owned)
                .collect();
            glass::named(text(value, "name"), &catalogs, library)
        }
        "AbbeMaterial" => {
            let (n_d, v_d) = (finite(value, "index")?, finite(value, "abbe")?);
            notes.push(format!(
                "a model glass of n_d {n_d} and V_d {v_d}, as n = a + b / lambda^2"
            ));
            glass::model(n_d, v_d)
        }
        "Mirror" => Ok(Medium::air()),
        other => Err(format!(
            "material `{other}` is not read (IdealMaterial, Material, AbbeMaterial, Mirror)"
        )),
    }
}

fn system_aperture(value: &Value) -> Found<SystemAperture> {
    let size = || finite(value, "value");
    match text(value, "type") {
        "EPD" => Ok(SystemAperture::EntrancePupil(size()?)),
        "imageFNO" => Ok(SystemAperture::FNumber(size()?)),
        "objectNA" => Ok(SystemAperture::ObjectNa(size()?)),
        "float_by_stop_size" => Ok(SystemAperture::StopSize),
        other => Err(format!(
            "aperture `{other}` is not read (EPD, imageFNO, objectNA, float_by_stop_size)"
        )),
    }
}

fn wavelengths(json: &Value) -> Found<(Vec<Wavelength>, usize)> {
    let rows = list(&json["wavelengths"]["wavelengths"], "wavelengths")?;
    let mut out = Vec::with_capacity(rows.len());
    for row in rows {
        let nm = match text(row, "unit") {
            "um" | "" => 1e3,
            "nm" => 1.0,
            "mm" => 1e6,
            other => return Err(format!("unit of wavelength `{other}` (um, nm, mm)")),
        };
        let weight = match &row["weight"] {
            Value::Null => 1.0,
            _ => finite(row, "weight")?,
        };
        // the product of a decimal and a power of ten, as if the decimal had been written in
        // nanometers
        let nm = (finite(row, "value")? * nm * 1e6).round() / 1e6;
        out.push(Wavelength { nm, weight });
    }
    let primary = rows
        .iter()
        .position(|r| r["is_primary"].as_bool() == Some(true));
    Ok((out, primary.unwrap_or(0)))
}

fn fields(json: &Value) -> Found<(FieldKind, Vec<[f64; 2]>)> {
    let fields = &json["fields"];
    let kind = match text(&fields["field_definition"], "field_type") {
        "AngleField" => FieldKind::AngleDeg,
        "ObjectHeightField" => FieldKind::ObjectHeight,
        "ParaxialImageHeightField" => FieldKind::ImageHeight,
        other => {
            let allowed = "AngleField, ObjectHeightField, ParaxialImageHeightField";
            return Err(format!("field `{other}` is not read ({allowed})"));
        }
    };
    let rows = list(&fields["fields"], "fields")?;
    let one = |row: &Value| Ok([finite(row, "x")?, finite(row, "y")?]);
    Ok((kind, rows.iter().map(one).collect::<Found<_>>()?))
}
