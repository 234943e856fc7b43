//! Diffuse reflection under a dielectric layer, without the reflection by the layer itself (another
//! lobe).
//!
//! g = ρ/(π η²) T(ω⁻) T(ω⁺) / (1 - R̄) with T = 1 - R of the layer and R̄ the mean of R over the
//! hemisphere: symmetric, and under a layer of full strength a white base and the layer reflect
//! together exactly what arrives (the coupling of Ashikhmin and Shirley 2000, with the exact
//! reflectance in place of Schlick's). R is Fresnel's for a smooth layer; for a rough one it is
//! what its facets reflect at once: what they send to other facets, of which few reflect, goes to
//! the base.

use crate::bsdf::albedo::profile::Blend;
use crate::bsdf::microfacet::Ggx;
use crate::bsdf::{BsdfEval, Interface, cosine_on_side, fresnel};
use crate::math::sampling::cosine_hemisphere_pdf;
use crate::spectrum::SampledSpectrum;
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;

/// A dielectric layer over something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    /// Index relative to what is around.
    pub index: f64,
    /// Factor on the layer's reflectance, 0..1.
    pub strength: f64,
    /// Mean reflectance of the layer over the hemisphere (cosine-weighted), without the strength.
    mean: f64,
}

impl Coat {
    /// A layer of relative `index` (> 0) whose reflectance is multiplied by `strength` in 0..1.
    #[must_use]
    pub fn new(index: f64, strength: f64) -> Self {
        // midpoints in cos²: ∫ R 2 cos dcos; the square root at grazing angles costs 1e-4 at this
        // many
        const STEPS: u32 = 512;
        let at = |i: u32| {
            fresnel::dielectric(((f64::from(i) + 0.5) / f64::from(STEPS)).sqrt(), 1.0, index)
        };
        let mean = (0..STEPS).map(at).sum::<f64>() / f64::from(STEPS);
        Self {
            index,
            strength,
            mean,
        }
    }

    /// The same layer of another strength.
    #[must_use]
    pub fn with_strength(self, strength: f64) -> Self {
        Self { strength, ..self }
    }

    /// Transmittance of the smooth layer at cosine `cos`.
    fn transmittance(&self, cos: f64) -> f64 {
        1.0 - self.strength * fresnel::dielectric(cos, 1.0, self.index)
    }

    /// Share of the light from `w_light` that reaches a base and leaves it to `w_camera`, from all
    /// that a white base sends back.
    fn passed(&self, w_light: DVec3, w_camera: DVec3, rough: Option<&Blend>) -> f64 {
        let Some(reflected) = rough else {
            let [a, b] = [w_light, w_camera].map(|w| self.transmittance(w.z.abs()));
            return a * b / (1.0 - self.strength * self.mean);
        };
        let [a, b] = [w_light, w_camera].map(|w| 1.0 - self.strength * reflected.at(w));
        a * b / (1.0 - self.strength * reflected.mean())
    }
}

/// Lambertian reflection under a layer.
#[derive(Clone, Copy, Debug)]
pub struct CoatedDiffuse {
    /// Reflectance of the base in [0, 1] per lane.
    pub reflectance: SampledSpectrum,
    /// The layer.
    pub coat: Coat,
    /// Facets of a rough layer; `None`: as under a smooth one.
    pub rough: Option<Ggx>,
}

impl CoatedDiffuse {
    pub(super) fn eval(
        &self,
        w_light: DVec3,
        w_camera: DVec3,
        interface: &Interface,
    ) -> Option<BsdfEval> {
        let cos_camera = cosine_on_side(w_camera, w_light)?;
        let cos_light = w_light.z.abs();
        let eta = interface.near(w_light.z > 0.0);
        let layer = |ggx: &Ggx| interface.albedos.reflected_by_layer(ggx, self.coat.index);
        let rough = self.rough.as_ref().and_then(layer);
        let passed = self.coat.passed(w_light, w_camera, rough.as_ref());
        let mut eval = BsdfEval::BLACK;
        eval.g = interface.lanes(|k| FRAC_1_PI * passed / (eta[k] * eta[k])) * self.reflectance;
        eval.pdf_camera = cosine_hemisphere_pdf(cos_camera);
        eval.pdf_light = cosine_hemisphere_pdf(cos_light);
        Some(eval)
    }

    /// Reflectance at normal incidence.
    pub(super) fn albedo(&self) -> SampledSpectrum {
        self.reflectance * self.coat.transmittance(1.0) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::albedo::NO_ALBEDOS;
    use crate::spectrum::MAX_LANES;

    #[test]
    fn layer_and_white_base_reflect_all_together() {
        let interface = Interface {
            eta_above: &[1.0; MAX_LANES],
            eta_below: &[1.0; MAX_LANES],
            count: 1,
            dispersive: false,
            coating: None,
            polarization: crate::optics::Polarization::Average,
            albedos: &NO_ALBEDOS,
        };
        for (index, strength) in [(1.5, 1.0), (2.4, 1.0), (1.5, 0.3)] {
            let coat = Coat::new(index, strength);
            let lobe = CoatedDiffuse {
                reflectance: SampledSpectrum::ONE,
                coat,
                rough: None,
            };
            for cos in [0.1_f64, 0.5, 1.0] {
                let w = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let n = 20_000;
                let sum: f64 = (0..n)
                    .map(|i| {
                        let c = ((f64::from(i) + 0.5) / f64::from(n)).sqrt();
                        let other = DVec3::new(0.0, (1.0 - c * c).sqrt(), c);
                        lobe.eval(w, other, &interface)
                            .map_or(0.0, |e| f64::from(e.g[0]))
                    })
                    .sum();
                let diffuse = sum * std::f64::consts::PI / f64::from(n);
                let layer = strength * fresnel::dielectric(cos, 1.0, index);
                assert!(
                    (diffuse + layer - 1.0).abs() < 5e-4,
                    "{index} {cos}: {diffuse} {layer}"
                );
            }
        }
    }
}
