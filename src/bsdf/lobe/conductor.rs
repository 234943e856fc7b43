//! Metals and mirrors: reflection only, alike on both sides.

use crate::bsdf::microfacet::Ggx;
use crate::bsdf::multiscatter::{Reflection, share_left};
use crate::bsdf::{BsdfEval, Interface, cosine_on_side, fresnel};
use crate::optics::Polarization;
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
    /// Reflectance of one lane for unpolarized light, tint included, at cosine `cos` in a medium of
    /// index `eta`.
    fn reflectance(&self, lane: usize, cos: f64, eta: f64) -> f64 {
        self.reflectance_for(Polarization::Average, lane, cos, eta)
    }

    /// The same for light of a polarization.
    fn reflectance_for(&self, polarization: Polarization, lane: usize, cos: f64, eta: f64) -> f64 {
        let (n, k) = (f64::from(self.n[lane]), f64::from(self.k[lane]));
        fresnel::conductor(polarization, cos, eta, n, k) * f64::from(self.tint[lane])
    }

    /// Shares per lane that are left of the light that facets of mean loss `lost` hold back on the
    /// side `above`.
    fn shares_left(&self, lost: f64, above: bool, interface: &Interface) -> SampledSpectrum {
        let eta = interface.near(above);
        interface.lanes(|k| share_left(lost, |cos| self.reflectance(k, cos, eta[k])))
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
                let (eta, polarization) = (interface.near(above), interface.polarization);
                interface.lanes(|k| metal.reflectance_for(polarization, k, cos, eta[k]))
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
    /// Share per lane that is left above of light after more than one facet; `None`: it is lost.
    multiple: Option<SampledSpectrum>,
}

impl Conductor {
    /// A metal whose light leaves after one facet or not at all.
    #[must_use]
    pub fn single(ggx: Ggx, metal: Metal) -> Self {
        Self {
            ggx,
            metal,
            multiple: None,
        }
    }

    /// A metal with multiple scattering, where the tables of `interface` have its roughness.
    #[must_use]
    pub fn new(ggx: Ggx, metal: Metal, interface: &Interface) -> Self {
        let lost = interface.albedos.lost_by_reflector(&ggx);
        Self {
            multiple: lost.map(|lost| metal.shares_left(lost.mean(), true, interface)),
            ..Self::single(ggx, metal)
        }
    }

    fn multiple<'a>(&self, interface: &Interface<'a>) -> Option<Reflection<'a>> {
        self.multiple?;
        Reflection::new(interface.albedos, &self.ggx)
    }

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
        if let (Some(multiple), Some(above)) = (self.multiple(interface), self.multiple) {
            let kernel = multiple.kernel(w_light, w_camera);
            let is_like_above = w_light.z > 0.0 || interface.eta_above == interface.eta_below;
            let share = if is_like_above {
                above
            } else {
                self.metal.shares_left(multiple.lost(), false, interface)
            };
            eval.g += interface.lanes(|k| kernel / (eta[k] * eta[k])) * share;
            let mix = |single: f64, given: DVec3, generated: DVec3| {
                let p = multiple.probability(given);
                single + p * (multiple.density(generated) - single)
            };
            eval.pdf_camera = mix(eval.pdf_camera, w_light, w_camera);
            eval.pdf_light = mix(eval.pdf_light, w_camera, w_light);
        }
        Some(eval)
    }

    /// A direction for `given` above the surface. `None` when the facet sends it below: elsewhere
    /// in a mixture that direction would be taken for a transmission.
    pub(super) fn generate(
        &self,
        given: DVec3,
        interface: &Interface,
        u: [f64; 3],
    ) -> Option<DVec3> {
        let [choice, x, y] = u;
        if let Some(multiple) = self.multiple(interface)
            && choice < multiple.probability(given)
        {
            return Some(multiple.generate([x, y]));
        }
        let m = self.ggx.sample_visible(given, [x, y]);
        let w = 2.0 * given.dot(m) * m - given;
        (w.z > 0.0).then_some(w)
    }
}
