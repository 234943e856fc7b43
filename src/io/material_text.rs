//! Materials and lights of a model as text of scene files, for whoever wants to change them. Colors
//! are written in linear sRGB, to four digits.

use crate::light::{Light, LightKind};
use crate::material::{LobeSpec, Material};
use crate::spectrum::xyz::{emission_to_xyz, reflectance_to_xyz, xyz_to_linear_srgb};
use crate::spectrum::{Curve, Emission, illuminant};
use crate::texture::{ScalarTexture, SpectrumTexture};
use glam::DVec3;

/// A number to four digits.
fn digits(value: f64) -> String {
    // what rounding left of 0 is 0
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    format!("{}", rounded + 0.0)
}

fn list(values: [f64; 3]) -> String {
    format!("[{}]", values.map(digits).join(", "))
}

/// A reflectance; `None` for an image.
fn color(spectrum: &SpectrumTexture) -> Option<String> {
    match spectrum {
        SpectrumTexture::Uniform(Curve::Constant(value)) => Some(digits(*value)),
        SpectrumTexture::Uniform(curve) => {
            let rgb = xyz_to_linear_srgb(reflectance_to_xyz(curve, illuminant::d65()));
            Some(list(rgb.map(|v| v.clamp(0.0, 1.0))))
        }
        SpectrumTexture::Image { .. } => None,
    }
}

/// A key for a color, left out where it is 1.
fn tint(key: &str, spectrum: &SpectrumTexture) -> Option<String> {
    let value = color(spectrum)?;
    Some(match value.as_str() {
        "1" => String::new(),
        value => format!("{key} = {value}"),
    })
}

/// The key of a roughness, left out where it is 0; `None` for an image.
fn roughness(alpha: &[ScalarTexture; 2]) -> Option<String> {
    let [x, y] = [digits(alpha[0].constant()?), digits(alpha[1].constant()?)];
    Some(match (x.as_str(), y.as_str()) {
        ("0", "0") => String::new(),
        (x, y) if x == y => format!("roughness = {x}"),
        (x, y) => format!("roughness = [{x}, {y}]"),
    })
}

fn table(name: &str, keys: &[String]) -> String {
    let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
    let keys: Vec<&str> = keys.into_iter().filter(|key| !key.is_empty()).collect();
    match keys.as_slice() {
        [] => format!("{name} = {{}}"),
        keys => format!("{name} = {{ {} }}", keys.join(", ")),
    }
}

/// A lobe and how many of the list it stands for; `None` where the keys of scene files cannot say
/// it.
fn lobe(lobes: &[(ScalarTexture, LobeSpec)]) -> Option<(String, usize)> {
    let whole = |name: &str, keys: &[String]| Some((table(name, keys), 1));
    match &lobes.first()?.1 {
        LobeSpec::Diffuse { reflectance } => whole(
            "diffuse",
            &[format!("reflectance = {}", color(reflectance)?)],
        ),
        LobeSpec::Mirror { reflectance } => whole("mirror", &[tint("reflectance", reflectance)?]),
        LobeSpec::ColoredMetal { color: c, alpha } => whole(
            "conductor",
            &[format!("color = {}", color(c)?), roughness(alpha)?],
        ),
        LobeSpec::Dielectric {
            alpha,
            reflect_tint,
            transmit_tint,
        } => whole(
            "dielectric",
            &[
                roughness(alpha)?,
                tint("reflect_tint", reflect_tint)?,
                tint("transmit_tint", transmit_tint)?,
            ],
        ),
        LobeSpec::Thin { ior, transmit_tint } if !ior.is_dispersive() => whole(
            "thin",
            &[
                format!("ior = {}", digits(ior.n(587.56))),
                tint("transmit_tint", transmit_tint)?,
            ],
        ),
        LobeSpec::CoatedDiffuse { .. } | LobeSpec::Coat { .. } => coated(lobes.get(..2)?),
        LobeSpec::Thin { .. } | LobeSpec::Conductor { .. } => None,
    }
}

/// A base and the layer over it, in either order.
fn coated(pair: &[(ScalarTexture, LobeSpec)]) -> Option<(String, usize)> {
    let [(weight, a), (other, b)] = pair else {
        return None;
    };
    let (base, layer) = match a {
        LobeSpec::Coat { .. } => (b, a),
        _ => (a, b),
    };
    let LobeSpec::CoatedDiffuse {
        reflectance,
        coat,
        strength,
        alpha,
    } = base
    else {
        return None;
    };
    let LobeSpec::Coat { tint, .. } = layer else {
        return None;
    };
    let same = weight.constant() == other.constant();
    let plain = strength.constant() == Some(1.0) && color(tint)? == "1";
    (same && plain).then_some(())?;
    let keys = [
        format!("reflectance = {}", color(reflectance)?),
        format!("ior = {}", digits(coat.index)),
        roughness(alpha)?,
    ];
    Some((table("coated", &keys), 2))
}

/// The keys of `[material.NAME]` that make a material, one a line; `None` where they cannot: an
/// image, a glass of its own, a tinted layer.
#[must_use]
pub fn material(material: &Material) -> Option<String> {
    if material.normal.is_some() || material.lobes.is_empty() {
        return None;
    }
    let mut rest = material.lobes.as_slice();
    let mut lobes = Vec::new();
    while let Some((weight, _)) = rest.first() {
        let (text, count) = lobe(rest)?;
        lobes.push((digits(weight.constant()?), text));
        rest = &rest[count..];
    }
    let mut text = match lobes.as_slice() {
        [(weight, lobe)] if weight == "1" => format!("{lobe}\n"),
        lobes => {
            let each = lobes.iter();
            let each: Vec<String> = each
                .map(|(weight, lobe)| format!("{{ weight = {weight}, {lobe} }}"))
                .collect();
            format!("mix = [{}]\n", each.join(", "))
        }
    };
    if let Some(coverage) = &material.coverage {
        text += &format!("coverage = {}\n", digits(coverage.alpha.constant()?));
        if let Some(cutoff) = coverage.cutoff {
            text += &format!("cutoff = {}\n", digits(cutoff));
        }
    }
    Some(text)
}

/// An emission by its color.
fn emission(emission: &Emission) -> String {
    let rgb = xyz_to_linear_srgb(emission_to_xyz(emission)).map(|v| v.max(0.0));
    let most = rgb.into_iter().fold(f64::MIN_POSITIVE, f64::max);
    let (rgb, scale) = (list(rgb.map(|v| v / most)), digits(most));
    format!("{{ rgb = {rgb}, scale = {scale} }}")
}

/// The key of `[[light]]` that makes a light, in meters; `None` for lights that turn with an image.
#[must_use]
pub fn light(light: &Light) -> Option<String> {
    let to_world = light.transform.as_ref()?.at(0.0).to_world;
    let position = format!("position = {}", list(to_world.translation.to_array()));
    let axis = to_world.transform_vector3(DVec3::Z).normalize_or_zero();
    let direction = format!("direction = {}", list(axis.to_array()));
    let intensity = format!("intensity = {}", emission(&light.emission));
    Some(match &light.kind {
        LightKind::Point(_) => table("point", &[position, intensity]),
        LightKind::Spot(cone) => {
            let degrees = |key: &str, angle: f64| format!("{key} = {}", digits(angle.to_degrees()));
            // scene files have no cone that falls from its axis on
            let inner = cone.falloff_start_rad.max(1e-3);
            let keys = [
                position,
                direction,
                degrees("outer_deg", cone.cone_rad),
                degrees("inner_deg", inner),
                intensity,
            ];
            table("spot", &keys)
        }
        LightKind::Directional(_) => {
            let irradiance = format!("irradiance = {}", emission(&light.emission));
            table("directional", &[direction, irradiance])
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::scene_file::parse_str;
    use crate::spectrum::upsample;
    use std::path::Path;

    fn read(keys: &str) -> Material {
        let scene = format!(
            "[[sensor]]\nname = \"a\"\nperspective = {{ eye = [0, 0, 1], target = [0, 0, 0], fov_deg = 30 }}\n\
             [material.a]\n{keys}"
        );
        let scene = parse_str(&scene, Path::new(".")).unwrap_or_else(|e| panic!("{e}\n{scene}"));
        scene.description.materials[0].clone()
    }

    #[test]
    fn materials_say_themselves() {
        for keys in [
            "diffuse = { reflectance = [0.8, 0.2, 0.1] }\n",
            "mirror = {}\n",
            "conductor = { color = [0.9, 0.6, 0.3], roughness = 0.2 }\n",
            "dielectric = { roughness = [0.1, 0.3], transmit_tint = [0.7, 0.8, 0.9] }\n",
            "thin = { ior = 1.5 }\n",
            "coated = { reflectance = 0.4, ior = 1.5, roughness = 0.25 }\n",
            "mix = [{ weight = 0.25, diffuse = { reflectance = 0.5 } }, { weight = 0.75, coated = { reflectance = 0.1, ior = 1.4 } }]\n",
            "diffuse = { reflectance = 0.5 }\ncoverage = 0.5\ncutoff = 0.25\n",
        ] {
            let said = material(&read(keys)).unwrap_or_else(|| panic!("{keys}"));
            // colors come back to within the fit of their spectra
            let near = |a: &str, b: &str| {
                let number = |t: &str| t.trim_matches(['[', ']', ',']).parse::<f64>().ok();
                a == b
                    || number(a)
                        .zip(number(b))
                        .is_some_and(|(a, b)| (a - b).abs() < 2e-3)
            };
            let (said_words, words) = (said.split_whitespace(), keys.split_whitespace());
            assert_eq!(
                said_words.clone().count(),
                words.clone().count(),
                "{said}{keys}"
            );
            assert!(
                said_words.zip(words).all(|(a, b)| near(a, b)),
                "{said}{keys}"
            );
        }
        // a dispersive sheet has no number for its index
        assert!(material(&read("thin = { glass = \"N-BK7\" }\n")).is_none());
        assert!(material(&read("conductor = { metal = \"Ag\" }\n")).is_none());
    }

    #[test]
    fn numbers_have_four_digits() {
        let texts = [0.0, -0.0, 1.0, 0.123_456, 12_345.6, 1e-9].map(digits);
        assert_eq!(texts, ["0", "0", "1", "0.1235", "12350", "0.000000001"]);
        let red = SpectrumTexture::Uniform(upsample::reflectance([0.5, 0.1, 0.1]));
        assert!(
            color(&red).is_some_and(|text| text.starts_with("[0.")),
            "{red:?}"
        );
    }
}
