//! Lambertian reflection, alike on both sides.

use crate::bsdf::{BsdfEval, BsdfSample, Interface, Label, cosine_on_side};
use crate::math::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;

/// Lambertian reflection.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Reflectance in [0, 1] per lane.
    pub reflectance: SampledSpectrum,
}

impl Diffuse {
    #[inline]
    pub(in crate::bsdf) fn eval(
        &self,
        w_light: DVec3,
        w_camera: DVec3,
        interface: &Interface,
    ) -> BsdfEval {
        let Some(cos_camera) = cosine_on_side(w_camera, w_light) else {
            return BsdfEval::BLACK;
        };
        let eta = interface.near(w_light.z > 0.0);
        let share = if *eta == [1.0; MAX_LANES] {
            SampledSpectrum::splat(FRAC_1_PI as f32)
        } else {
            interface.lanes(|k| FRAC_1_PI / (eta[k] * eta[k]))
        };
        BsdfEval {
            g: share * self.reflectance,
            pdf_camera: cosine_hemisphere_pdf(cos_camera),
            pdf_light: cosine_hemisphere_pdf(w_light.z.abs()),
            columns: None,
        }
    }

    /// A direction drawn on the side of one at height `given` above the surface. Cosine and density
    /// cancel in its weight, which is the reflectance. `None` along the surface.
    #[inline]
    pub(in crate::bsdf) fn sample(&self, given: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let up = cosine_hemisphere(u);
        if given == 0.0 || up.z <= 0.0 {
            return None;
        }
        Some(BsdfSample {
            w: DVec3::new(up.x, up.y, up.z.copysign(given)),
            label: Label::NonSpecular,
            weight: self.reflectance,
            pdf: cosine_hemisphere_pdf(up.z),
            pdf_reverse: cosine_hemisphere_pdf(given.abs()),
            dispersive: false,
            columns: None,
        })
    }

    /// A direction above the surface.
    pub(super) fn generate(u: [f64; 2]) -> DVec3 {
        cosine_hemisphere(u)
    }
}
