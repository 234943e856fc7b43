//! Which effects a scene calls for, and which of its elements does.

use super::Scene;

/// One effect, on or off, with its reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Effect {
    /// Such as "dispersion" or "absorption".
    pub name: &'static str,
    /// Whether it is computed.
    pub on: bool,
    /// The element that called for it, or why none did.
    pub reason: String,
}

fn effect(name: &'static str, found: Option<String>, none: &str) -> Effect {
    Effect {
        name,
        on: found.is_some(),
        reason: found.unwrap_or_else(|| none.to_owned()),
    }
}

/// All effects of a scene.
#[must_use]
pub fn find_effects(scene: &Scene) -> Vec<Effect> {
    let dispersive = scene.media.iter().find(|m| m.ior.is_dispersive());
    let absorbing = scene
        .media
        .iter()
        .find(|m| m.absorption.is_some() || (m.use_k && m.ior.is_absorbing()));
    let specular = scene
        .objects
        .iter()
        .find(|o| scene.material(o.material).has_specular());
    let moving = scene.moving().first().map(|&m| scene.name_of(m));
    let lines = scene
        .lights
        .iter()
        .position(|l| !l.emission.lines.is_empty());
    let hidden: Vec<&str> = scene
        .lights
        .iter()
        .zip(&scene.light_names)
        .filter(|(l, _)| l.is_delta() && l.as_area().is_none())
        .map(|(_, name)| name.as_str())
        .collect();
    vec![
        effect(
            "dispersion",
            dispersive.map(|m| {
                format!(
                    "medium \"{}\" has an index that varies with wavelength",
                    m.name
                )
            }),
            "no medium has an index that varies with wavelength",
        ),
        effect(
            "absorption",
            absorbing.map(|m| format!("medium \"{}\" absorbs", m.name)),
            "no medium absorbs",
        ),
        effect(
            "specular",
            specular.map(|o| format!("object \"{}\" has a mirror or smooth glass", o.name)),
            "no surface is a mirror or smooth glass",
        ),
        effect(
            "motion",
            moving.map(|(kind, name)| format!("{kind} \"{name}\" moves")),
            "nothing moves while a shutter is open",
        ),
        effect(
            "lines",
            lines.map(|i| format!("light \"{}\" has emission lines", scene.light_names[i])),
            "no light has emission lines",
        ),
        effect(
            "delta lights",
            (!hidden.is_empty()).then(|| format!("camera paths cannot hit {}", hidden.join(", "))),
            "every light can be hit by camera paths",
        ),
    ]
}
