//! The closed set of lobes, and what a mixture asks of each.

use super::coated::CoatedDiffuse;
use super::conductor::{Conductor, Mirror};
use super::dielectric::Dielectric;
use super::diffuse::Diffuse;
use super::rough_dielectric::RoughDielectric;
use super::thin::Thin;
use super::{BsdfEval, Interface, Label};
use crate::spectrum::SampledSpectrum;
use glam::DVec3;

/// One scattering lobe with its parameters at a point and at the path's wavelengths.
#[derive(Clone, Copy, Debug)]
pub enum Lobe {
    /// Lambertian reflection.
    Diffuse(Diffuse),
    /// Lambertian reflection under a dielectric layer.
    Coated(CoatedDiffuse),
    /// Perfect mirror (reflectance per lane) or smooth conductor.
    Mirror(Mirror),
    /// GGX conductor.
    Conductor(Conductor),
    /// Smooth dielectric interface between the two media of the surface.
    Dielectric(Dielectric),
    /// GGX dielectric interface.
    RoughDielectric(RoughDielectric),
    /// Thin sheet: reflects and passes straight, between equal media.
    Thin(Thin),
}

impl Lobe {
    /// Whether the lobe scatters into exact directions only.
    #[must_use]
    pub fn is_specular(&self) -> bool {
        matches!(self, Self::Mirror(_) | Self::Dielectric(_) | Self::Thin(_))
    }

    pub(super) fn eval(
        &self,
        w_light: DVec3,
        w_camera: DVec3,
        interface: &Interface,
    ) -> Option<BsdfEval> {
        match self {
            Self::Diffuse(lobe) => lobe.eval(w_light, w_camera, interface),
            Self::Coated(lobe) => lobe.eval(w_light, w_camera, interface),
            Self::Conductor(lobe) => lobe.eval(w_light, w_camera, interface),
            Self::RoughDielectric(lobe) => lobe.eval(w_light, w_camera, interface),
            Self::Mirror(_) | Self::Dielectric(_) | Self::Thin(_) => None,
        }
    }

    /// Probability of `label` once the lobe is chosen, for a direction at cosine `cos` on the side
    /// `above`.
    pub(super) fn label_probability(
        &self,
        label: Label,
        cos: f64,
        above: bool,
        interface: &Interface,
    ) -> f64 {
        let reflect = match self {
            Self::Diffuse(_) | Self::Coated(_) | Self::Conductor(_) | Self::RoughDielectric(_) => {
                return if label == Label::NonSpecular {
                    1.0
                } else {
                    0.0
                };
            }
            Self::Mirror(_) => 1.0,
            Self::Dielectric(_) => interface.mean_reflectance(cos, above),
            Self::Thin(lobe) => {
                let lane = |k| lobe.lane_reflectance(k, cos, above, interface);
                (0..interface.count).map(lane).sum::<f64>() / interface.count as f64
            }
        };
        match label {
            Label::NonSpecular => 0.0,
            Label::SpecularReflect => reflect,
            Label::SpecularTransmit => 1.0 - reflect,
        }
    }

    /// Reflectance or transmittance of a specular label, tint included.
    pub(super) fn specular(
        &self,
        label: Label,
        cos: f64,
        above: bool,
        interface: &Interface,
    ) -> SampledSpectrum {
        match (label, self) {
            (Label::SpecularReflect, Self::Mirror(lobe)) => lobe.reflectance(cos, above, interface),
            (Label::SpecularReflect, Self::Dielectric(lobe)) => {
                lobe.reflectance(cos, above, interface)
            }
            (Label::SpecularReflect, Self::Thin(lobe)) => {
                interface.lanes(|k| lobe.lane_reflectance(k, cos, above, interface))
            }
            (Label::SpecularTransmit, Self::Dielectric(lobe)) => {
                lobe.transmittance(cos, above, interface)
            }
            (Label::SpecularTransmit, Self::Thin(lobe)) => {
                lobe.transmittance(cos, above, interface)
            }
            _ => SampledSpectrum::ZERO,
        }
    }
}
