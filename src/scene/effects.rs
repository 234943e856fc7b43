//! Which effects a scene calls for, and which of its elements does.

use super::Scene;
use crate::math::named::named;
use serde::{Deserialize, Serialize};

named! {
    /// Phenomena that cost time where a scene has them.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum EffectKind {
        /// Refractive indices that vary with wavelength.
        Dispersion = "dispersion": "Refractive indices that vary with wavelength",
        /// Absorption in media.
        Absorption = "absorption": "Absorption in media",
        /// Mirrors and smooth glass.
        Specular = "specular": "Mirrors and smooth glass",
        /// Motion while a shutter is open.
        Motion = "motion": "Motion while a shutter is open",
        /// Emission lines.
        Lines = "lines": "Emission lines",
        /// Lights that no camera path can hit.
        #[serde(rename = "delta lights")]
        DeltaLights = "delta lights": "Lights that no camera path can hit",
        /// Connections at specular vertices.
        Regularization = "regularization": "Connections at specular vertices",
    }
}

/// One effect, on or off, with its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Effect {
    /// The phenomenon.
    #[serde(rename = "name")]
    pub kind: EffectKind,
    /// Whether it is computed.
    pub on: bool,
    /// The element that called for it, or why none did.
    pub reason: String,
}

fn effect(kind: EffectKind, found: Option<String>, none: &str) -> Effect {
    Effect {
        kind,
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
            EffectKind::Dispersion,
            dispersive.map(|m| {
                format!(
                    "medium \"{}\" has an index that varies with wavelength",
                    m.name
                )
            }),
            "no medium has an index that varies with wavelength",
        ),
        effect(
            EffectKind::Absorption,
            absorbing.map(|m| format!("medium \"{}\" absorbs", m.name)),
            "no medium absorbs",
        ),
        effect(
            EffectKind::Specular,
            specular.map(|o| format!("object \"{}\" has a mirror or smooth glass", o.name)),
            "no surface is a mirror or smooth glass",
        ),
        effect(
            EffectKind::Motion,
            moving.map(|(kind, name)| format!("{kind} \"{name}\" moves")),
            "nothing moves while a shutter is open",
        ),
        effect(
            EffectKind::Lines,
            lines.map(|i| format!("light \"{}\" has emission lines", scene.light_names[i])),
            "no light has emission lines",
        ),
        effect(
            EffectKind::DeltaLights,
            (!hidden.is_empty()).then(|| format!("camera paths cannot hit {}", hidden.join(", "))),
            "every light can be hit by camera paths",
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::EffectKind;
    use crate::math::named::Named;

    #[test]
    fn files_have_the_names() {
        for &kind in EffectKind::ALL {
            let text = format!("\"{kind}\"");
            assert_eq!(serde_json::to_string(&kind).ok().as_ref(), Some(&text));
            assert_eq!(serde_json::from_str(&text).ok(), Some(kind));
        }
    }
}
