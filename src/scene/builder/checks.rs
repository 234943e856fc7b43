//! Checks of the parts of a scene, before they are put together.

use super::{SceneBuilderError, SceneDescription};
use crate::geometry::Transform;
use crate::light::{Light, LightKind};
use crate::material::{LobeSpec, Material, MaterialId};
use crate::medium::{Boundary, MediumId};
use crate::scene::description::{ObjectDescription, SensorDescription, WavelengthChoice};
use crate::spectrum::Emission;
use crate::texture::{ScalarTexture, SpectrumTexture};

/// Most lobes of a material.
const MAX_LOBES: usize = 4;
/// Most columns or rows of a film.
const MAX_PIXELS: u32 = 1 << 16;

type Checked = Result<(), String>;

/// Fails with the first part that is not possible.
pub(super) fn check(scene: &SceneDescription) -> Result<(), SceneBuilderError> {
    if scene.sensors.is_empty() {
        return Err(SceneBuilderError::NoSensor);
    }
    let range = scene.wavelengths.range_nm;
    part("wavelengths", "range", wavelengths(scene))?;
    for medium in &scene.media {
        let index = medium.ior.validate(range).map_err(|e| e.to_string());
        part("medium", &medium.name, index.map(|_| ()))?;
    }
    for (i, material) in scene.materials.iter().enumerate() {
        part("material", &i.to_string(), self::material(material, range))?;
    }
    for object in &scene.objects {
        part("object", &object.name, self::object(object, scene))?;
    }
    for light in &scene.lights {
        part("light", &light.name, self::light(&light.light))?;
    }
    for sensor in &scene.sensors {
        part("sensor", &sensor.name, self::sensor(sensor))?;
    }
    Ok(())
}

fn part(what: &'static str, name: &str, checked: Checked) -> Result<(), SceneBuilderError> {
    checked.map_err(|problem| SceneBuilderError::Part {
        what,
        name: name.to_owned(),
        problem,
    })
}

fn require(holds: bool, problem: impl Into<String>) -> Checked {
    if holds { Ok(()) } else { Err(problem.into()) }
}

fn is_positive(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

fn wavelengths(scene: &SceneDescription) -> Checked {
    let [low, high] = scene.wavelengths.range_nm;
    require(
        is_positive(low) && high > low && high.is_finite(),
        format!("{low} to {high} nm (allowed: 0 < low < high)"),
    )?;
    match &scene.wavelengths.choice {
        WavelengthChoice::Lines(lines) => require(
            !lines.is_empty() && lines.iter().all(|&nm| is_positive(nm)),
            "its lines are not one or more positive wavelengths",
        ),
        _ => Ok(()),
    }
}

fn unit_scalar(what: &str, value: &ScalarTexture) -> Checked {
    let outside = value.constant().filter(|v| !(0.0..=1.0).contains(v));
    outside.map_or(Ok(()), |v| Err(format!("{what} is {v} (allowed: 0 to 1)")))
}

fn unit_spectrum(what: &str, value: &SpectrumTexture) -> Checked {
    let SpectrumTexture::Uniform(curve) = value else {
        return Ok(());
    };
    let (least, most) = curve.bounds();
    require(
        least >= 0.0 && most <= 1.0,
        format!("{what} reaches from {least} to {most} (allowed: 0 to 1)"),
    )
}

fn material(material: &Material, range_nm: [f64; 2]) -> Checked {
    let count = material.lobes.len();
    require(
        count <= MAX_LOBES,
        format!("{count} lobes (allowed: at most {MAX_LOBES})"),
    )?;
    let mut sum = 0.0;
    for (weight, lobe) in &material.lobes {
        unit_scalar("a weight", weight)?;
        if !matches!(lobe, LobeSpec::Coat { .. }) {
            sum += weight.constant().unwrap_or(0.0);
        }
        self::lobe(lobe, range_nm)?;
    }
    require(
        sum <= 1.0 + 1e-9,
        format!("the sum of the weights is {sum} (allowed: at most 1)"),
    )
}

fn lobe(lobe: &LobeSpec, range_nm: [f64; 2]) -> Checked {
    let roughness =
        |alpha: &[ScalarTexture; 2]| alpha.iter().try_for_each(|a| unit_scalar("a roughness", a));
    match lobe {
        LobeSpec::Diffuse { reflectance } | LobeSpec::Mirror { reflectance } => {
            unit_spectrum("the reflectance", reflectance)
        }
        LobeSpec::CoatedDiffuse {
            reflectance,
            strength,
            ..
        } => {
            unit_scalar("the strength of the coat", strength)?;
            unit_spectrum("the reflectance", reflectance)
        }
        LobeSpec::Conductor { ior, alpha, tint } => {
            ior.validate_conductor(range_nm)
                .map_err(|e| e.to_string())?;
            roughness(alpha)?;
            unit_spectrum("the tint", tint)
        }
        LobeSpec::ColoredMetal { color, alpha } => {
            roughness(alpha)?;
            unit_spectrum("the color", color)
        }
        LobeSpec::Dielectric {
            alpha,
            reflect_tint,
            transmit_tint,
        } => {
            roughness(alpha)?;
            unit_spectrum("the tint of reflection", reflect_tint)?;
            unit_spectrum("the tint of transmission", transmit_tint)
        }
        LobeSpec::Thin { ior, transmit_tint } => {
            ior.validate(range_nm).map_err(|e| e.to_string())?;
            unit_spectrum("the tint", transmit_tint)
        }
        LobeSpec::Coat { index, alpha, tint } => {
            require(*index >= 1.0, format!("index {index} (allowed: 1 or more)"))?;
            roughness(alpha)?;
            unit_spectrum("the tint", tint)
        }
    }
}

/// A map that can be undone.
fn placement(transform: &Transform, time: f64) -> Checked {
    let placement = transform.at(time);
    let (there, back) = (placement.to_world, placement.to_object);
    require(
        there.is_finite() && back.is_finite() && there.matrix3.determinant() != 0.0,
        "its place is not finite or has no extent (is a size 0, or are two directions parallel?)",
    )
}

fn emission(emission: &Emission) -> Checked {
    let least = emission.continuous.as_ref().map_or(0.0, |c| c.bounds().0);
    let mut lines = emission.lines.iter();
    require(
        emission.scale >= 0.0
            && emission.scale.is_finite()
            && least >= 0.0
            && lines.all(|l| l.value >= 0.0 && l.value.is_finite() && is_positive(l.lambda_nm)),
        "its emission is negative or not finite",
    )
}

fn object(object: &ObjectDescription, scene: &SceneDescription) -> Checked {
    placement(&object.transform, 0.0)?;
    let MaterialId(material) = object.material;
    let count = scene.materials.len();
    let Some(material) = scene.materials.get(material as usize) else {
        return Err(format!(
            "material {material} is of another builder: this one has {count}"
        ));
    };
    let medium = |MediumId(id): MediumId| {
        let count = scene.media.len();
        require(
            (id as usize) < count,
            format!("medium {id} is of another builder: this one has {count}"),
        )
    };
    match object.boundary {
        Boundary::None => require(
            !material.needs_interior(),
            "its material is an interface, which needs the media on both sides: fill it, or name them",
        )?,
        Boundary::Solid { medium: inside, .. } => {
            medium(inside)?;
            require(
                object.shape.is_closed(),
                "its shape is not closed, so it has no inside (allowed: a sphere, a box, a closed mesh)",
            )?;
        }
        Boundary::Interface { above, below } => {
            medium(above)?;
            medium(below)?;
        }
    }
    match &object.emission {
        Some(area) => emission(&area.radiance),
        None => Ok(()),
    }
}

fn light(light: &Light) -> Checked {
    emission(&light.emission)?;
    match &light.kind {
        LightKind::Area(_) => {
            return Err("a surface that emits is an object with emission".to_owned());
        }
        LightKind::Beam(beam) => {
            let radius = beam.radius_m;
            require(
                is_positive(radius),
                format!("radius {radius} m (allowed: above 0)"),
            )?;
        }
        LightKind::Spot(spot) => {
            let (inner, outer) = (spot.falloff_start_rad, spot.cone_rad);
            require(
                outer > 0.0 && outer <= std::f64::consts::PI && (0.0..=outer).contains(&inner),
                format!("a cone from {inner} to {outer} rad (allowed: 0 <= inner <= outer <= π)"),
            )?;
        }
        LightKind::Point(_) | LightKind::Directional(_) | LightKind::Environment(_) => {}
    }
    let transform = light.transform.as_ref();
    transform.map_or(Ok(()), |t| placement(t, 0.0))
}

fn sensor(sensor: &SensorDescription) -> Checked {
    let size = sensor.camera.resolution();
    let allowed = 1..=MAX_PIXELS;
    require(
        allowed.contains(&size.width) && allowed.contains(&size.height),
        format!(
            "{} x {} pixels (allowed: 1 to {MAX_PIXELS} each)",
            size.width, size.height
        ),
    )?;
    let (open, close) = (sensor.shutter.open_s, sensor.shutter.close_s);
    require(
        open.is_finite() && close.is_finite() && open <= close,
        format!("a shutter from {open} to {close} s (allowed: finite, in this order)"),
    )?;
    placement(sensor.camera.transform(), open)?;
    require(
        sensor.camera.has_extent(),
        "its film or field of view has no extent (allowed: a width above 0, an angle between 0 and π)",
    )
}
