//! Lobes of a material: parameters over a surface, and the lobe they make at a point.
//!
//! All that a material asks of one of its lobes is asked here.

use crate::bsdf::albedo::{Alphas, Needs};
use crate::bsdf::lobe::coated::{Coat, CoatedDiffuse};
use crate::bsdf::lobe::conductor::{Conductor, Metal, Mirror};
use crate::bsdf::lobe::dielectric::Dielectric;
use crate::bsdf::lobe::diffuse::Diffuse;
use crate::bsdf::lobe::rough_dielectric::RoughDielectric;
use crate::bsdf::lobe::thin::Thin;
use crate::bsdf::microfacet::Ggx;
use crate::bsdf::{Interface, Lobe};
use crate::spectrum::{Ior, SampledSpectrum, SampledWavelengths};
use crate::texture::{Image, ScalarTexture, SpectrumTexture};
use glam::DVec2;
use std::sync::Arc;

/// GGX roughness below which a lobe is built as smooth: the peak's density would outgrow what
/// connections can use.
pub const SMOOTH_ALPHA: f64 = 1e-3;
/// GGX roughness up to which a surface casts caustics.
const NARROW_ALPHA: f64 = 0.3;

/// Relative difference of indices below which a rough dielectric interface is built as smooth:
/// refraction is then undone to within rounding, and there is no half vector to speak of.
const MATCHED: f64 = 1e-6;

/// Share of its weight with which the layer of a coat is drawn: it reflects a few percent, and is
/// drawn not much more often.
const COAT_SHARE: f64 = 0.25;

/// One lobe's parameters.
#[derive(Clone, Debug)]
pub enum LobeSpec {
    /// Lambertian, both sides.
    Diffuse {
        /// Reflectance in [0, 1].
        reflectance: SpectrumTexture,
    },
    /// Perfect mirror, both sides.
    Mirror {
        /// Reflectance in [0, 1].
        reflectance: SpectrumTexture,
    },
    /// Metal. `alpha` (GGX, x and y) of 0 is a smooth metal (a specular lobe).
    Conductor {
        /// Complex index.
        ior: Ior,
        /// GGX roughness along the two tangents, 0..1.
        alpha: [ScalarTexture; 2],
        /// Factor on the reflectance.
        tint: SpectrumTexture,
    },
    /// Metal known by its color only: index 1 + i k with the k that gives this reflectance at
    /// normal incidence.
    ColoredMetal {
        /// Reflectance at normal incidence in [0, 1].
        color: SpectrumTexture,
        /// GGX roughness along the two tangents, 0..1.
        alpha: [ScalarTexture; 2],
    },
    /// Interface between the two media of the surface. `alpha` of 0 is smooth; below 1e-3 it is
    /// built as smooth.
    Dielectric {
        /// GGX roughness along the two tangents, 0..1.
        alpha: [ScalarTexture; 2],
        /// Factor on reflection.
        reflect_tint: SpectrumTexture,
        /// Factor on transmission.
        transmit_tint: SpectrumTexture,
    },
    /// Thin glass sheet (window, soap bubble wall) of index `ior` against the medium around it:
    /// incoherent sum of inner reflections, straight transmission, no change of medium.
    Thin {
        /// Index of the sheet.
        ior: Ior,
        /// Factor on transmission.
        transmit_tint: SpectrumTexture,
    },
    /// Lambertian under a dielectric layer, without the layer's own reflection.
    CoatedDiffuse {
        /// Reflectance of the base in [0, 1].
        reflectance: SpectrumTexture,
        /// The layer.
        coat: Coat,
        /// Strength of the layer's reflection, 0..1.
        strength: ScalarTexture,
        /// GGX roughness of the layer along the two tangents, 0..1.
        alpha: [ScalarTexture; 2],
    },
    /// The reflection by a dielectric layer alone. With `CoatedDiffuse` of the same layer at the
    /// same weight it does not count towards the sum of the weights.
    Coat {
        /// Index relative to what is around.
        index: f64,
        /// GGX roughness along the two tangents, 0..1.
        alpha: [ScalarTexture; 2],
        /// Factor on the reflectance.
        tint: SpectrumTexture,
    },
}

/// The micro-normals of a rough lobe, `None` for a smooth one. A roughness from an image is never
/// smooth: whether a lobe is specular is a property of the material, not of the texel.
fn roughness(alpha: &[ScalarTexture; 2], uv: DVec2) -> Option<Ggx> {
    if is_smooth(alpha) {
        return None;
    }
    Some(Ggx {
        alpha: [&alpha[0], &alpha[1]].map(|a| a.eval(uv).clamp(SMOOTH_ALPHA, 1.0)),
    })
}

fn is_smooth(alpha: &[ScalarTexture; 2]) -> bool {
    alpha
        .iter()
        .all(|a| a.constant().is_some_and(|a| a < SMOOTH_ALPHA))
}

/// Whether the two media have the same index in every lane.
fn is_matched(interface: &Interface) -> bool {
    (0..interface.count).all(|k| {
        let (a, b) = (interface.eta_above[k], interface.eta_below[k]);
        (a - b).abs() <= MATCHED * a
    })
}

/// `f` of the wavelength of each lane in use, 1 in the others.
fn per_lane(wavelengths: &SampledWavelengths, f: impl Fn(f64) -> f64) -> SampledSpectrum {
    let mut out = SampledSpectrum::ONE;
    for lane in 0..wavelengths.count() {
        out[lane] = f(wavelengths.lambda_nm(lane)) as f32;
    }
    out
}

/// Adds the roughnesses that `alpha` takes on a surface. Two that differ from place to place are
/// looked up as one, and not where they are two.
fn add_alphas(alpha: &[ScalarTexture; 2], out: &mut Alphas) {
    match [&alpha[0], &alpha[1]].map(ScalarTexture::constant) {
        [Some(_), Some(_)] => {
            if let Some(ggx) = roughness(alpha, DVec2::ZERO) {
                out.add(ggx.alpha);
            }
        }
        _ => out.add_range([0.0, 1.0]),
    }
}

pub(super) fn unit_scalar(what: &str, value: &ScalarTexture) -> Result<(), String> {
    let outside = value.constant().filter(|v| !(0.0..=1.0).contains(v));
    outside.map_or(Ok(()), |v| Err(format!("{what} is {v} (allowed: 0 to 1)")))
}

fn unit_spectrum(what: &str, value: &SpectrumTexture) -> Result<(), String> {
    let SpectrumTexture::Uniform(curve) = value else {
        return Ok(());
    };
    let (least, most) = curve.bounds();
    if least >= 0.0 && most <= 1.0 {
        return Ok(());
    }
    Err(format!(
        "{what} reaches from {least} to {most} (allowed: 0 to 1)"
    ))
}

impl LobeSpec {
    /// Reflectance at a point, if it is Lambertian and no more.
    #[inline]
    pub(super) fn lambertian(
        &self,
        uv: DVec2,
        wavelengths: &SampledWavelengths,
    ) -> Option<SampledSpectrum> {
        match self {
            Self::Diffuse { reflectance } => Some(reflectance.sample(uv, wavelengths)),
            _ => None,
        }
    }

    /// The lobe at a point; with `multiple` scattering between facets or without.
    pub(super) fn build(
        &self,
        uv: DVec2,
        wavelengths: &SampledWavelengths,
        interface: &Interface,
        multiple: bool,
    ) -> Lobe {
        let at = |texture: &SpectrumTexture| texture.sample(uv, wavelengths);
        let reflector = |metal: Metal, ggx: Option<Ggx>| match ggx {
            Some(ggx) if multiple => Lobe::Conductor(Conductor::new(ggx, metal, interface)),
            Some(ggx) => Lobe::Conductor(Conductor::single(ggx, metal)),
            None => Lobe::Mirror(Mirror::Metal(metal)),
        };
        match self {
            Self::Diffuse { reflectance } => Lobe::Diffuse(Diffuse {
                reflectance: at(reflectance),
            }),
            Self::Mirror { reflectance } => Lobe::Mirror(Mirror::Perfect(at(reflectance))),
            Self::Conductor { ior, alpha, tint } => {
                let metal = Metal {
                    n: per_lane(wavelengths, |nm| ior.n(nm)),
                    k: per_lane(wavelengths, |nm| ior.k(nm)),
                    tint: at(tint),
                };
                reflector(metal, roughness(alpha, uv))
            }
            Self::ColoredMetal { color, alpha } => {
                // R = k²/(4 + k²) of an index 1 + i k seen from index 1
                let k = at(color).map(|r| {
                    let r = r.clamp(0.0, 0.9999);
                    2.0 * (r / (1.0 - r)).sqrt()
                });
                let metal = Metal {
                    n: SampledSpectrum::ONE,
                    k,
                    tint: SampledSpectrum::ONE,
                };
                reflector(metal, roughness(alpha, uv))
            }
            Self::Dielectric {
                alpha,
                reflect_tint,
                transmit_tint,
            } => {
                let reflect_tint = at(reflect_tint);
                let transmit_tint = at(transmit_tint);
                match roughness(alpha, uv) {
                    Some(ggx) if !is_matched(interface) => Lobe::RoughDielectric(RoughDielectric {
                        ggx,
                        reflect_tint,
                        transmit_tint,
                        multiple,
                    }),
                    _ => Lobe::Dielectric(Dielectric {
                        reflect_tint,
                        transmit_tint,
                    }),
                }
            }
            Self::Thin { ior, transmit_tint } => Lobe::Thin(Thin {
                n: per_lane(wavelengths, |nm| ior.n(nm)),
                transmit_tint: at(transmit_tint),
            }),
            Self::CoatedDiffuse {
                reflectance,
                coat,
                strength,
                alpha,
            } => Lobe::Coated(CoatedDiffuse {
                reflectance: at(reflectance),
                coat: coat.with_strength(strength.eval(uv).clamp(0.0, 1.0)),
                rough: if multiple { roughness(alpha, uv) } else { None },
            }),
            Self::Coat { index, alpha, tint } => {
                let metal = Metal {
                    n: SampledSpectrum::from_fn(|k| (index * interface.eta_above[k]) as f32),
                    k: SampledSpectrum::ZERO,
                    tint: at(tint) * (1.0 / COAT_SHARE) as f32,
                };
                // what its facets hold back is light of the base
                match roughness(alpha, uv) {
                    Some(ggx) => Lobe::Conductor(Conductor::single(ggx, metal)),
                    None => Lobe::Mirror(Mirror::Metal(metal)),
                }
            }
        }
    }

    /// The share of its weight with which it is drawn.
    pub(super) fn share(&self) -> f64 {
        match self {
            Self::Coat { .. } => COAT_SHARE,
            _ => 1.0,
        }
    }

    /// Whether its weight counts towards the sum of the weights.
    pub(super) fn counts(&self) -> bool {
        !matches!(self, Self::Coat { .. })
    }

    /// Adds what it looks up if it is rough; whether it is a rough interface is told.
    pub(super) fn add_needs(&self, needs: &mut Needs) -> bool {
        match self {
            Self::Conductor { alpha, .. } | Self::ColoredMetal { alpha, .. } => {
                add_alphas(alpha, &mut needs.reflectors);
            }
            Self::Dielectric { alpha, .. } if !is_smooth(alpha) => {
                add_alphas(alpha, &mut needs.interfaces);
                return true;
            }
            Self::CoatedDiffuse { alpha, coat, .. } if !is_smooth(alpha) => {
                add_alphas(alpha, &mut needs.layers);
                needs.layer_indices.push(coat.index);
            }
            _ => {}
        }
        false
    }

    pub(super) fn is_specular(&self) -> bool {
        self.sends_as(is_smooth)
    }

    /// Whether it sends light into a narrow cone: smooth, or somewhere not rougher than
    /// [`NARROW_ALPHA`].
    pub(super) fn is_narrow(&self) -> bool {
        let is_narrow = |a: &ScalarTexture| a.constant().is_none_or(|a| a <= NARROW_ALPHA);
        self.sends_as(|alpha| alpha.iter().any(is_narrow))
    }

    /// Whether `holds` for its roughness; a mirror and a thin sheet have none, and always do.
    fn sends_as(&self, holds: impl Fn(&[ScalarTexture; 2]) -> bool) -> bool {
        match self {
            Self::Diffuse { .. } | Self::CoatedDiffuse { .. } => false,
            Self::Mirror { .. } | Self::Thin { .. } => true,
            Self::Conductor { alpha, .. }
            | Self::ColoredMetal { alpha, .. }
            | Self::Coat { alpha, .. }
            | Self::Dielectric { alpha, .. } => holds(alpha),
        }
    }

    pub(super) fn append_images(&self, out: &mut Vec<Arc<Image>>) {
        let (spectra, alpha): ([Option<&SpectrumTexture>; 2], Option<&[ScalarTexture; 2]>) =
            match self {
                Self::Diffuse { reflectance } | Self::Mirror { reflectance } => {
                    ([Some(reflectance), None], None)
                }
                Self::CoatedDiffuse {
                    reflectance,
                    strength,
                    alpha,
                    ..
                } => {
                    strength.append_images(out);
                    ([Some(reflectance), None], Some(alpha))
                }
                Self::Conductor { tint, alpha, .. } | Self::Coat { tint, alpha, .. } => {
                    ([Some(tint), None], Some(alpha))
                }
                Self::ColoredMetal { color, alpha } => ([Some(color), None], Some(alpha)),
                Self::Dielectric {
                    alpha,
                    reflect_tint,
                    transmit_tint,
                } => ([Some(reflect_tint), Some(transmit_tint)], Some(alpha)),
                Self::Thin { transmit_tint, .. } => ([Some(transmit_tint), None], None),
            };
        spectra
            .into_iter()
            .flatten()
            .for_each(|s| s.append_images(out));
        alpha
            .into_iter()
            .flatten()
            .for_each(|a| a.append_images(out));
    }

    /// Checks its parameters over a range of wavelengths in nm.
    ///
    /// # Errors
    /// The first thing that is wrong, with what is allowed.
    pub(super) fn validate(&self, range_nm: [f64; 2]) -> Result<(), String> {
        let roughness = |alpha: &[ScalarTexture; 2]| {
            alpha.iter().try_for_each(|a| unit_scalar("a roughness", a))
        };
        match self {
            Self::Diffuse { reflectance } | Self::Mirror { reflectance } => {
                unit_spectrum("the reflectance", reflectance)
            }
            Self::CoatedDiffuse {
                reflectance,
                strength,
                ..
            } => {
                unit_scalar("the strength of the coat", strength)?;
                unit_spectrum("the reflectance", reflectance)
            }
            Self::Conductor { ior, alpha, tint } => {
                ior.validate_conductor(range_nm)
                    .map_err(|e| e.to_string())?;
                roughness(alpha)?;
                unit_spectrum("the tint", tint)
            }
            Self::ColoredMetal { color, alpha } => {
                roughness(alpha)?;
                unit_spectrum("the color", color)
            }
            Self::Dielectric {
                alpha,
                reflect_tint,
                transmit_tint,
            } => {
                roughness(alpha)?;
                unit_spectrum("the tint of reflection", reflect_tint)?;
                unit_spectrum("the tint of transmission", transmit_tint)
            }
            Self::Thin { ior, transmit_tint } => {
                ior.validate(range_nm).map_err(|e| e.to_string())?;
                unit_spectrum("the tint", transmit_tint)
            }
            Self::Coat { index, alpha, tint } => {
                if *index < 1.0 {
                    return Err(format!("index {index} (allowed: 1 or more)"));
                }
                roughness(alpha)?;
                unit_spectrum("the tint", tint)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::albedo::NO_ALBEDOS;

    #[test]
    fn one_small_roughness_is_raised() {
        assert_eq!(
            roughness(&[0.0.into(), 0.5.into()], DVec2::ZERO),
            Some(Ggx {
                alpha: [SMOOTH_ALPHA, 0.5]
            })
        );
    }

    #[test]
    fn matched_media_are_recognized_in_every_lane() {
        let (above, mut below) = ([1.4; 8], [1.4; 8]);
        let is_matched = |below: &[f64; 8], count| {
            is_matched(&Interface {
                eta_above: &above,
                eta_below: below,
                count,
                dispersive: false,
                coating: None,
                polarization: crate::optics::Polarization::Average,
                albedos: &NO_ALBEDOS,
            })
        };
        assert!(is_matched(&below, 4));
        below[3] = 1.41;
        assert!(!is_matched(&below, 4));
        assert!(is_matched(&below, 3));
    }
}
