//! Metals and mirrors: reflection only, alike on both sides.

use super::microfacet::Ggx;
use super::{BsdfEval, Interface, cosine_on_side, fresnel};
use crate::spectrum::SampledSpectrum;
use glam::DVec3;

/// Fresnel reflection by a metal.
#[derive(Clone, Copy, Debug)]
pub struct Metal {
    /// Real part of the index per lane.
    pub n: SampledSpectrum,
    /// Extinction coefficient per lane.
    pub k: SampledSpectrum,
    /// Factor on the reflectance per lane.
    pub tint: SampledSpectrum,
}

impl Metal {
    /// Reflectance of one lane, tint included, at cosine `cos` in a medium of index `eta`.
    fn reflectance(&self, lane: usize, cos: f64, eta: f64) -> f64 {
        let (n, k) = (f64::from(self.n[lane]), f64::from(self.k[lane]));
        fresnel::conductor(cos, eta, n, k) * f64::from(self.tint[lane])
    }
}

/// A smooth reflector.
#[derive(Clone, Copy, Debug)]
pub enum Mirror {
    /// Reflectance per lane, the same at all angles.
    Perfect(SampledSpectrum),
    /// Smooth metal.
    Metal(Metal),
}

impl Mirror {
    /// Reflectance per lane at cosine `cos`, on the side `above`.
    pub(super) fn reflectance(
        &self,
        cos: f64,
        above: bool,
        interface: &Interface,
    ) -> SampledSpectrum {
        match self {
            Self::Perfect(reflectance) => *reflectance,
            Self::Metal(metal) => {
                interface.lanes(|k| metal.reflectance(k, cos, interface.near(above)[k]))
            }
        }
    }
}

/// A rough metal (GGX).
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    /// Micro-normals.
    pub ggx: Ggx,
    /// Reflection at each facet.
    pub metal: Metal,
}

impl Conductor {
    pub(super) fn eval(
        &self,
        w_light: DVec3,
        w_camera: DVec3,
        interface: &Interface,
    ) -> Option<BsdfEval> {
        cosine_on_side(w_camera, w_light)?;
        let m = (w_light + w_camera).try_normalize()?;
        let cos = w_light.dot(m).clamp(0.0, 1.0);
        let eta = interface.near(w_light.z > 0.0);
        let geometry = 0.25 * self.ggx.d(m) * self.ggx.g2_over_cosines(w_light, w_camera);
        let mut eval = BsdfEval::BLACK;
        eval.g = interface
            .lanes(|k| geometry * self.metal.reflectance(k, cos, eta[k]) / (eta[k] * eta[k]));
        let jacobian = 0.25 / cos;
        eval.pdf_camera = self.ggx.visible_pdf(w_light, m) * jacobian;
        eval.pdf_light = self.ggx.visible_pdf(w_camera, m) * jacobian;
        Some(eval)
    }

    /// A direction for `given` above the surface. `None` when the facet sends it below: elsewhere
    /// in a mixture that direction would be taken for a transmission.
    pub(super) fn generate(&self, given: DVec3, u: [f64; 2]) -> Option<DVec3> {
        let m = self.ggx.sample_visible(given, u);
        let w = 2.0 * given.dot(m) * m - given;
        (w.z > 0.0).then_some(w)
    }
}
