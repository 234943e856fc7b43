//! The refractive indices on the two sides of a surface.
//!
//! Invariant: without `dispersive` the ratio of the two indices is the same in all lanes.

use super::albedo::AlbedoTables;
use super::{CoatingLanes, fresnel};
use crate::optics::Polarization;
use crate::spectrum::{MAX_LANES, SampledSpectrum};

/// Refractive indices on the two sides of a surface, per lane.
#[derive(Clone, Copy, Debug)]
pub struct Interface<'a> {
    /// On the side the normal points to.
    pub eta_above: &'a [f64; MAX_LANES],
    /// On the other side.
    pub eta_below: &'a [f64; MAX_LANES],
    /// Lanes in use.
    pub count: usize,
    /// The ratio of the two indices differs between wavelengths.
    pub dispersive: bool,
    /// Layers between the two media, on smooth interfaces.
    pub coating: Option<&'a CoatingLanes>,
    /// Polarization that smooth surfaces are computed for.
    pub polarization: Polarization,
    /// Albedos of the rough lobes there are.
    pub albedos: &'a AlbedoTables,
}

impl<'a> Interface<'a> {
    /// Indices on the side `above` (or not) the normal.
    pub(crate) fn near(&self, above: bool) -> &'a [f64; MAX_LANES] {
        if above {
            self.eta_above
        } else {
            self.eta_below
        }
    }

    /// Indices on the side `above`, then on the other.
    pub(crate) fn sides(&self, above: bool) -> (&'a [f64; MAX_LANES], &'a [f64; MAX_LANES]) {
        (self.near(above), self.near(!above))
    }

    /// `f` of each lane in use, 0 in the others.
    #[inline]
    pub(super) fn lanes(&self, mut f: impl FnMut(usize) -> f64) -> SampledSpectrum {
        SampledSpectrum::of_lanes(self.count, |k| f(k) as f32)
    }

    /// Indices above and below, averaged over the lanes in use: the same whichever lane is the
    /// hero.
    pub(super) fn mean_indices(&self) -> [f64; 2] {
        if !self.dispersive {
            return [self.eta_above[0], self.eta_below[0]];
        }
        [self.eta_above, self.eta_below]
            .map(|eta| eta[..self.count].iter().sum::<f64>() / self.count as f64)
    }

    /// Fresnel reflectance between two indices at cosine `cos` on the side of the first.
    pub(super) fn reflectance(&self, cos: f64, [near, far]: [f64; 2]) -> f64 {
        fresnel::dielectric_for(self.polarization, cos, near, far)
    }

    /// Reflectance and transmittance of the smooth interface in lane `k` at cosine `cos` on the
    /// side `above`, with its coating.
    #[inline]
    pub(super) fn response(&self, k: usize, cos: f64, above: bool) -> [f64; 2] {
        let (near, far) = self.sides(above);
        let indices = [near[k], far[k]];
        match self.coating {
            None => {
                let r = self.reflectance(cos, indices);
                [r, 1.0 - r]
            }
            Some(coating) => {
                let response = coating.response(k, cos, above, indices, self.polarization);
                [response.r, response.t]
            }
        }
    }

    /// Probability of choosing reflection at the smooth interface: the share of what is reflected
    /// in what is not absorbed, over all lanes, the same whichever lane is the hero.
    pub(super) fn reflection_probability(&self, cos: f64, above: bool) -> f64 {
        if self.coating.is_none() {
            return self.mean_reflectance(cos, above);
        }
        self.reflected_share(&self.responses(cos, above))
    }

    /// Reflectance and transmittance in each lane in use, 0 in the others.
    #[inline]
    pub(super) fn responses(&self, cos: f64, above: bool) -> [[f64; 2]; MAX_LANES] {
        let mut out = [[0.0; 2]; MAX_LANES];
        if self.coating.is_some() {
            for (k, out) in out.iter_mut().enumerate().take(self.count) {
                *out = self.response(k, cos, above);
            }
            return out;
        }
        let reflected = self.reflectances(cos, above, self.count);
        for (out, r) in out.iter_mut().zip(reflected).take(self.count) {
            *out = [r, 1.0 - r];
        }
        out
    }

    /// Fresnel reflectance of the first `count` lanes.
    fn reflectances(&self, cos: f64, above: bool, count: usize) -> [f64; MAX_LANES] {
        let (near, far) = self.sides(above);
        fresnel::dielectric_lanes(self.polarization, cos, near, far, count)
    }

    /// Share of what is reflected in what is not absorbed, over all lanes: what
    /// [`Interface::reflection_probability`] makes of these responses.
    pub(super) fn reflected_share(&self, responses: &[[f64; 2]; MAX_LANES]) -> f64 {
        if self.coating.is_none() {
            let lanes = if self.dispersive { self.count } else { 1 };
            let sum: f64 = responses[..lanes].iter().map(|[r, _]| r).sum();
            return sum / lanes as f64;
        }
        let lanes = responses[..self.count].iter();
        let [r, t] = lanes.fold([0.0; 2], |sum, [r, t]| [sum[0] + r, sum[1] + t]);
        if t > 0.0 { r / (r + t) } else { 1.0 }
    }

    /// Whether light that is refracted comes back the same way with the same probability: what
    /// passes is the same from both sides, and so is what is reflected where no layer absorbs; but
    /// only along the way of each lane itself.
    pub(super) fn is_reciprocal(&self) -> bool {
        let one_way = self.count == 1 || !self.dispersive;
        one_way && self.coating.is_none_or(|coating| !coating.absorbs())
    }

    /// Fresnel reflectance at cosine `cos` on the side `above`, averaged over the lanes in use: the
    /// probability of choosing reflection, the same whichever lane is the hero.
    pub(super) fn mean_reflectance(&self, cos: f64, above: bool) -> f64 {
        // without dispersion the ratio of the indices, hence the reflectance, is that of the hero
        let lanes = if self.dispersive { self.count } else { 1 };
        let reflected = self.reflectances(cos, above, lanes);
        reflected[..lanes].iter().sum::<f64>() / lanes as f64
    }
}
