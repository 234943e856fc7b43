//! Chromatic adaptation: the color that appears white.

use crate::spectrum::Curve;
use crate::spectrum::library::Library;
use crate::spectrum::xyz::{curve_to_xyz, emission_to_xyz, linear_srgb_to_xyz};
use glam::{DMat3, DVec3};
use std::str::FromStr;

/// The white of the displays, D65 with Y = 1 (IEC 61966-2-1: x = 0.3127, y = 0.3290).
const DISPLAY_WHITE: [f64; 3] = [0.950_455_927, 1.0, 1.089_057_751];

/// The color of a scene that is shown as white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum White {
    /// D65, the white of the display: nothing is changed.
    Unadapted,
    /// The mean color of the picture ("gray world").
    Scene,
    /// A color, XYZ with any Y above 0.
    Color([f64; 3]),
}

impl FromStr for White {
    type Err = String;

    /// `none`, `scene`, a color in linear sRGB, a temperature, or a spectrum by name.
    fn from_str(text: &str) -> Result<Self, String> {
        let allowed = "expected none, scene, a color R,G,B (linear sRGB), a temperature such as 3200K, or the name of a spectrum such as D50";
        let positive = |text: &str| {
            let value = text.trim().parse().ok();
            value.filter(|v: &f64| v.is_finite() && *v > 0.0)
        };
        match text {
            "none" => return Ok(Self::Unadapted),
            "scene" => return Ok(Self::Scene),
            _ => {}
        }
        let xyz = if text.contains(',') {
            let rgb: Option<Vec<f64>> = text.split(',').map(positive).collect();
            let rgb = rgb.and_then(|rgb| <[f64; 3]>::try_from(rgb).ok());
            linear_srgb_to_xyz(rgb.ok_or(allowed)?)
        } else if let Some(Some(temp_k)) = text.strip_suffix('K').map(positive) {
            if !(1000.0..=100_000.0).contains(&temp_k) {
                return Err("expected a temperature from 1000K to 100000K".to_owned());
            }
            curve_to_xyz(&Curve::Blackbody { temp_k, scale: 1.0 })
        } else {
            let spectrum = Library::embedded().emission(text);
            emission_to_xyz(&spectrum.map_err(|e| format!("{e}; {allowed}"))?)
        };
        Ok(Self::Color(xyz))
    }
}

impl White {
    /// The adaptation for a picture.
    #[must_use]
    pub fn adaptation(self, xyz: impl Iterator<Item = [f64; 3]>) -> Adaptation {
        let white = match self {
            Self::Unadapted => return Adaptation(DMat3::IDENTITY),
            Self::Scene => xyz.map(DVec3::from_array).sum(),
            Self::Color(white) => DVec3::from_array(white),
        };
        Adaptation::new(white / white.y).unwrap_or(Adaptation(DMat3::IDENTITY))
    }
}

/// A linear chromatic adaptation to the white of the displays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation(DMat3);

impl Adaptation {
    /// Von Kries' adaptation in the cone space of Bradford (Lam 1985; ICC.1:2022, annex E) from a
    /// white with Y = 1; `None` for one that no light has.
    fn new(white: DVec3) -> Option<Self> {
        let cones = DMat3::from_cols_array_2d(&[
            [0.8951, -0.7502, 0.0389],
            [0.2664, 1.7135, -0.0685],
            [-0.1614, 0.0367, 1.0296],
        ]);
        let (from, to) = (cones * white, cones * DVec3::from_array(DISPLAY_WHITE));
        let scale = to / from;
        let sound = scale.is_finite() && scale.cmpgt(DVec3::ZERO).all();
        sound.then(|| Self(cones.inverse() * DMat3::from_diagonal(scale) * cones))
    }

    /// XYZ as it appears under the white of the displays.
    #[must_use]
    pub fn apply(&self, xyz: [f64; 3]) -> [f64; 3] {
        (self.0 * DVec3::from_array(xyz)).to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_becomes_white() {
        let a = [1.0985, 1.0, 0.3558];
        for white in [White::Color(a), White::Color(a.map(|v| 7.0 * v))] {
            let shown = white.adaptation(std::iter::empty()).apply(a);
            for (x, w) in shown.iter().zip(DISPLAY_WHITE) {
                assert!((x - w).abs() < 1e-12, "{shown:?}");
            }
        }
        let picture = [[1.0, 0.5, 0.2], [0.2, 0.5, 1.0]];
        let shown = White::Scene
            .adaptation(picture.into_iter())
            .apply([1.2, 1.0, 1.2]);
        assert!((shown[0] - DISPLAY_WHITE[0]).abs() < 1e-12, "{shown:?}");
    }

    #[test]
    fn a_black_picture_has_no_white() {
        assert_eq!(
            White::Scene
                .adaptation([[0.0; 3]].into_iter())
                .apply([1.0; 3]),
            [1.0; 3]
        );
    }
}
