//! Lambertian reflection, alike on both sides.

use crate::bsdf::{BsdfEval, Interface, cosine_on_side};
use crate::math::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::spectrum::SampledSpectrum;
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;

/// Lambertian reflection.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Reflectance in [0, 1] per lane.
    pub reflectance: SampledSpectrum,
}

impl Diffuse {
    pub(super) fn eval(&self, w_light: DVec3, w_camera: DVec3, interface: &Interface) -> BsdfEval {
        let Some(cos_camera) = cosine_on_side(w_camera, w_light) else {
            return BsdfEval::BLACK;
        };
        let eta = interface.near(w_light.z > 0.0);
        BsdfEval {
            g: interface.lanes(|k| FRAC_1_PI / (eta[k] * eta[k])) * self.reflectance,
            pdf_camera: cosine_hemisphere_pdf(cos_camera),
            pdf_light: cosine_hemisphere_pdf(w_light.z.abs()),
            columns: None,
        }
    }

    /// A direction above the surface.
    pub(super) fn generate(u: [f64; 2]) -> DVec3 {
        cosine_hemisphere(u)
    }
}
