//! Checks of the parts of a scene, before they are put together.

use super::{SceneBuilderError, SceneDescription};
use crate::geometry::Transform;
use crate::light::beam::BeamProfile;
use crate::light::casters::Casters;
use crate::light::{Light, LightKind};
use crate::material::MaterialId;
use crate::medium::{Boundary, MediumId};
use crate::scene::description::{ObjectDescription, SensorDescription, WavelengthChoice};
use crate::spectrum::Emission;

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
    part("casters", "share", caster_share(scene.caster_share))?;
    for medium in &scene.media {
        let index = medium.ior.validate(range).map_err(|e| e.to_string());
        part("medium", &medium.name, index.map(|_| ()))?;
    }
    for (i, material) in scene.materials.iter().enumerate() {
        part("material", &i.to_string(), material.validate(range))?;
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

fn caster_share(share: f64) -> Checked {
    let largest = Casters::LARGEST_SHARE;
    require(
        (0.0..=largest).contains(&share),
        format!("{share} (allowed: 0 to {largest})"),
    )
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
            if let BeamProfile::Gaussian { waist_m: waist } = beam.profile {
                require(
                    is_positive(waist),
                    format!("waist {waist} m (allowed: above 0)"),
                )?;
            }
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
