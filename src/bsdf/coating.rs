//! Coatings of smooth interfaces, at the wavelengths of a path.
//!
//! Where a layer absorbs, less is reflected from one side than from the other; what passes is the
//! same both ways (Macleod, Thin-Film Optical Filters, 4th ed., section 2.9).

use crate::optics::coating::{self, Response};
use crate::optics::{Polarization, Stack};
use crate::spectrum::SampledWavelengths;
use num_complex::Complex64;

/// The layers between the two media of a surface, per lane. Buffers are kept from path to path.
#[derive(Clone, Debug, Default)]
pub struct CoatingLanes {
    lambda_nm: Vec<f64>,
    /// Index and thickness in nanometers of each layer as light from above meets them, lane by
    /// lane.
    layers: Vec<(Complex64, f64)>,
    /// Index of each layer that does not absorb, and its phase at normal incidence over the index.
    clear: Vec<(f64, f64)>,
    /// Layers per lane.
    count: usize,
    absorbs: bool,
}

impl CoatingLanes {
    /// Layers, given as light from above meets them, at the wavelengths of a path.
    #[must_use]
    pub fn new(stack: &Stack, wavelengths: &SampledWavelengths) -> Self {
        let mut lanes = Self::default();
        lanes.update(Some(stack), wavelengths);
        lanes
    }

    /// Takes the layers of a stack, or none, at the wavelengths of a path.
    pub fn update(&mut self, stack: Option<&Stack>, wavelengths: &SampledWavelengths) {
        self.lambda_nm.clear();
        self.layers.clear();
        self.clear.clear();
        let Some(stack) = stack else {
            return;
        };
        for k in 0..wavelengths.count() {
            let nm = wavelengths.lambda_nm(k);
            self.lambda_nm.push(nm);
            let known = self.layers.len();
            self.layers.extend(stack.layers_at(nm));
            let added = self.layers[known..].iter();
            self.clear
                .extend(added.map(|(n, thickness)| (n.re, coating::phase(*thickness, nm))));
        }
        self.count = stack.layers.len();
        self.absorbs = self.layers.iter().any(|(n, _)| n.im != 0.0);
    }

    /// Whether a layer absorbs, at any of the wavelengths.
    pub(super) fn absorbs(&self) -> bool {
        self.absorbs
    }

    /// Whether there is no coating.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.lambda_nm.is_empty()
    }

    /// Response in lane `k` to light of a polarization at cosine `cos` in the medium of index
    /// `near`, on the side `above` or not, before the medium of index `far`.
    #[inline]
    pub(super) fn response(
        &self,
        k: usize,
        cos: f64,
        above: bool,
        [near, far]: [f64; 2],
        polarization: Polarization,
    ) -> Response {
        let count = self.count;
        let range = k * count..(k + 1) * count;
        if !self.absorbs {
            let layers = self.clear[range.clone()].iter().copied();
            let found = if above {
                coating::response_of_clear(layers, near, far, cos)
            } else {
                coating::response_of_clear(layers.rev(), near, far, cos)
            };
            if let Some(found) = found {
                return Response::of_clear(found, polarization);
            }
        }
        let layers = self.layers[range].iter().copied();
        let (nm, far) = (self.lambda_nm[k], Complex64::from(far));
        if above {
            coating::response(&layers, nm, near, far, cos, polarization)
        } else {
            coating::response(&layers.rev(), nm, near, far, cos, polarization)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::albedo::NO_ALBEDOS;
    use crate::bsdf::lobe::dielectric::Dielectric;
    use crate::bsdf::{Bsdf, Interface, Label, Lobe, Side, fresnel};
    use crate::optics::Layer;
    use crate::optics::coating::Thickness;
    use crate::spectrum::{Ior, Library, MAX_LANES, SampledSpectrum, WavelengthDistribution};
    use glam::DVec3;

    fn layer(ior: Ior, nm: f64) -> Layer {
        let thickness = Thickness::Nm(nm);
        Layer { ior, thickness }
    }

    #[test]
    fn energy_is_kept_and_what_passes_is_the_same_both_ways() {
        let silver = Library::embedded().ior("metal:Ag").expect("in the library");
        let stack = Stack {
            name: "silver".to_owned(),
            layers: vec![layer(Ior::constant(1.38), 120.0), layer(silver, 15.0)],
            backing: None,
        };
        let wavelengths = WavelengthDistribution::uniform([400.0, 700.0]).sample(0.3, 4);
        let (air, glass) = ([1.0; MAX_LANES], [1.5, 1.52, 1.55, 1.6, 1.0, 1.0, 1.0, 1.0]);
        let lanes = CoatingLanes::new(&stack, &wavelengths);
        let interface = Interface {
            eta_above: &air,
            eta_below: &glass,
            count: 4,
            dispersive: true,
            coating: Some(&lanes),
            polarization: Polarization::Average,
            albedos: &NO_ALBEDOS,
        };
        let lobes = [(
            1.0,
            Lobe::Dielectric(Dielectric {
                reflect_tint: SampledSpectrum::ONE,
                transmit_tint: SampledSpectrum::ONE,
            }),
        )];
        let bsdf = Bsdf {
            lobes: &lobes,
            interface,
        };
        let mut largest_difference = 0.0_f64;
        for degrees in [0.0_f64, 20.0, 50.0, 80.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            for (k, &n) in glass.iter().enumerate().take(4) {
                let below = (1.0 - (sin / n).powi(2)).sqrt();
                let [r_above, t_above] = interface.response(k, cos, true);
                let [r_below, t_below] = interface.response(k, below, false);
                assert!((t_above - t_below).abs() < 1e-12, "{degrees} {k}");
                let nm = wavelengths.lambda_nm(k);
                let want = coating::interface(Some(&stack), nm, 1.0, n, cos);
                assert!((r_above - want.r).abs() < 1e-12 && (t_above - want.t).abs() < 1e-12);
                assert!((r_above + t_above + want.a - 1.0).abs() < 1e-12);
                largest_difference = largest_difference.max((r_above - r_below).abs());
            }
            // what is drawn stands for what is there: the mean over labels is R + T
            for (given, above) in [
                (DVec3::new(sin, 0.0, cos), true),
                (
                    DVec3::new(0.4 * sin, 0.0, -(1.0 - 0.16 * sin * sin).sqrt()),
                    false,
                ),
            ] {
                let probability = |label| bsdf.label_probability(label, given);
                let sum =
                    probability(Label::SpecularReflect) + probability(Label::SpecularTransmit);
                assert!((sum - 1.0).abs() < 1e-15);
                for u in [0.001, 0.999] {
                    let sample = bsdf
                        .sample(given, Side::Camera, [u, 0.5, 0.5])
                        .expect("goes on");
                    let k = 0;
                    let index = usize::from(sample.label == Label::SpecularTransmit);
                    let want = interface.response(k, given.z.abs(), above)[index];
                    let found = f64::from(sample.weight[k]) * sample.pdf;
                    assert!((found - want).abs() < 1e-6, "{degrees} {found} {want}");
                    let back = bsdf.label_probability(sample.label, sample.w);
                    assert_eq!(sample.pdf_reverse, back);
                }
            }
        }
        // far beyond rounding: the sides of a stack that absorbs are not alike
        assert!(largest_difference > 1e-3, "{largest_difference}");
    }

    #[test]
    fn no_layer_is_no_coating() {
        let stack = Stack {
            name: String::new(),
            layers: vec![layer(Ior::constant(1.4), 0.0)],
            backing: None,
        };
        let wavelengths = WavelengthDistribution::uniform([400.0, 700.0]).sample(0.3, 4);
        let lanes = CoatingLanes::new(&stack, &wavelengths);
        for cos in [0.1, 0.5, 0.7, 1.0] {
            for (above, indices) in [(true, [1.0, 1.5]), (false, [1.5, 1.0])] {
                let bare = fresnel::dielectric(cos, indices[0], indices[1]);
                let found = lanes.response(1, cos, above, indices, Polarization::Average);
                assert!((found.r - bare).abs() < 1e-14 && (found.t + bare - 1.0).abs() < 1e-14);
            }
        }
    }
}
