//! Materials: parameters over a surface, turned into a [`Bsdf`] at a point and at the wavelengths of a path.

use crate::bsdf::conductor::{Conductor, Metal, Mirror};
use crate::bsdf::dielectric::Dielectric;
use crate::bsdf::diffuse::Diffuse;
use crate::bsdf::microfacet::Ggx;
use crate::bsdf::rough_dielectric::RoughDielectric;
use crate::bsdf::thin::Thin;
use crate::bsdf::{Bsdf, Interface, Lobe};
use crate::geometry::SurfacePoint;
use crate::spectrum::{Curve, Ior, SampledSpectrum, SampledWavelengths};
use arrayvec::ArrayVec;

/// GGX roughness below which a lobe is built as smooth: the peak's density would outgrow what connections can use.
pub const SMOOTH_ALPHA: f64 = 1e-3;

/// Relative difference of indices below which a rough dielectric interface is built as smooth: refraction is then
/// undone to within rounding, and there is no half vector to speak of.
const MATCHED: f64 = 1e-6;

/// Index of a material in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u32);

/// One lobe's parameters.
#[derive(Clone, Debug)]
pub enum LobeSpec {
    /// Lambertian, both sides.
    Diffuse {
        /// Reflectance in [0, 1].
        reflectance: Curve,
    },
    /// Perfect mirror, both sides.
    Mirror {
        /// Reflectance in [0, 1].
        reflectance: Curve,
    },
    /// Metal. `alpha` (GGX, x and y) of 0 is a smooth metal (a specular lobe).
    Conductor {
        /// Complex index.
        ior: Ior,
        /// GGX roughness along the two tangents, 0..1.
        alpha: [f64; 2],
        /// Factor on the reflectance.
        tint: Curve,
    },
    /// Interface between the two media of the surface. `alpha` of 0 is smooth; below 1e-3 it is built as smooth.
    Dielectric {
        /// GGX roughness along the two tangents, 0..1.
        alpha: [f64; 2],
        /// Factor on reflection.
        reflect_tint: Curve,
        /// Factor on transmission.
        transmit_tint: Curve,
    },
    /// Thin glass sheet (window, soap bubble wall) of index `ior` against the medium around it: incoherent sum of inner
    /// reflections, straight transmission, no change of medium.
    Thin {
        /// Index of the sheet.
        ior: Ior,
        /// Factor on transmission.
        transmit_tint: Curve,
    },
}

/// The micro-normals of a rough lobe, `None` for a smooth one.
fn roughness(alpha: [f64; 2]) -> Option<Ggx> {
    (alpha[0].max(alpha[1]) >= SMOOTH_ALPHA).then(|| Ggx {
        alpha: alpha.map(|a| a.clamp(SMOOTH_ALPHA, 1.0)),
    })
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

impl LobeSpec {
    fn build(&self, wavelengths: &SampledWavelengths, interface: &Interface) -> Lobe {
        match self {
            Self::Diffuse { reflectance } => Lobe::Diffuse(Diffuse {
                reflectance: reflectance.sample(wavelengths),
            }),
            Self::Mirror { reflectance } => {
                Lobe::Mirror(Mirror::Perfect(reflectance.sample(wavelengths)))
            }
            Self::Conductor { ior, alpha, tint } => {
                let metal = Metal {
                    n: per_lane(wavelengths, |nm| ior.n(nm)),
                    k: per_lane(wavelengths, |nm| ior.k(nm)),
                    tint: tint.sample(wavelengths),
                };
                match roughness(*alpha) {
                    Some(ggx) => Lobe::Conductor(Conductor { ggx, metal }),
                    None => Lobe::Mirror(Mirror::Metal(metal)),
                }
            }
            Self::Dielectric {
                alpha,
                reflect_tint,
                transmit_tint,
            } => {
                let reflect_tint = reflect_tint.sample(wavelengths);
                let transmit_tint = transmit_tint.sample(wavelengths);
                match roughness(*alpha) {
                    Some(ggx) if !is_matched(interface) => Lobe::RoughDielectric(RoughDielectric {
                        ggx,
                        reflect_tint,
                        transmit_tint,
                    }),
                    _ => Lobe::Dielectric(Dielectric {
                        reflect_tint,
                        transmit_tint,
                    }),
                }
            }
            Self::Thin { ior, transmit_tint } => Lobe::Thin(Thin {
                n: per_lane(wavelengths, |nm| ior.n(nm)),
                transmit_tint: transmit_tint.sample(wavelengths),
            }),
        }
    }

    fn is_specular(&self) -> bool {
        match self {
            Self::Diffuse { .. } => false,
            Self::Mirror { .. } | Self::Thin { .. } => true,
            Self::Conductor { alpha, .. } | Self::Dielectric { alpha, .. } => {
                roughness(*alpha).is_none()
            }
        }
    }
}

/// A mixture of weighted lobes (at most 4; no lobe: black).
///
/// A thin sheet and a dielectric interface do not mix: their exact transmissions have one label and two directions.
#[derive(Clone, Debug, Default)]
pub struct Material {
    /// (weight in 0..1, lobe); the weights' sum is at most 1.
    pub lobes: Vec<(f64, LobeSpec)>,
}

impl Material {
    /// The bsdf at a point. Lobes of weight 0 are left out, and any beyond the fourth.
    #[must_use]
    pub fn bsdf(
        &self,
        _point: &SurfacePoint,
        wavelengths: &SampledWavelengths,
        interface: &Interface,
    ) -> Bsdf {
        let lobes: ArrayVec<_, 4> = self
            .lobes
            .iter()
            .filter(|(weight, _)| *weight > 0.0)
            .take(4)
            .map(|(weight, spec)| (*weight as f32, spec.build(wavelengths, interface)))
            .collect();
        Bsdf {
            lobes,
            interface: *interface,
        }
    }

    /// Whether light crosses the surface without any vertex when the media on both sides are the same: a pure dielectric
    /// interface of full weight.
    #[must_use]
    pub fn is_clear_interface(&self) -> bool {
        match self.lobes.as_slice() {
            [(weight, LobeSpec::Dielectric { transmit_tint, .. })] => {
                *weight == 1.0 && *transmit_tint == Curve::Constant(1.0)
            }
            _ => false,
        }
    }

    /// Whether any lobe is specular (smooth) by its roughness. A rough interface between media of the same index is
    /// also built as smooth, which only the [`Bsdf`] knows.
    #[must_use]
    pub fn has_specular(&self) -> bool {
        self.lobes
            .iter()
            .any(|(weight, spec)| *weight > 0.0 && spec.is_specular())
    }

    /// Whether any lobe needs a medium on each side (dielectric).
    #[must_use]
    pub fn needs_interior(&self) -> bool {
        self.lobes
            .iter()
            .any(|(_, spec)| matches!(spec, LobeSpec::Dielectric { .. }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dielectric(alpha: f64, transmit: f64) -> LobeSpec {
        LobeSpec::Dielectric {
            alpha: [alpha; 2],
            reflect_tint: Curve::Constant(1.0),
            transmit_tint: Curve::Constant(transmit),
        }
    }

    fn material(lobe: LobeSpec) -> Material {
        Material {
            lobes: vec![(1.0, lobe)],
        }
    }

    #[test]
    fn small_roughness_is_smooth() {
        assert!(material(dielectric(0.0, 1.0)).has_specular());
        assert!(material(dielectric(9.9e-4, 1.0)).has_specular());
        assert!(!material(dielectric(1e-3, 1.0)).has_specular());
        assert_eq!(
            roughness([0.0, 0.5]),
            Some(Ggx {
                alpha: [SMOOTH_ALPHA, 0.5]
            })
        );
    }

    #[test]
    fn interfaces_are_recognized() {
        assert!(material(dielectric(0.0, 1.0)).is_clear_interface());
        assert!(!material(dielectric(0.0, 0.9)).is_clear_interface());
        let mirror = LobeSpec::Mirror {
            reflectance: Curve::Constant(1.0),
        };
        assert!(material(dielectric(0.3, 1.0)).needs_interior());
        assert!(!material(mirror.clone()).needs_interior());
        assert!(!material(mirror).is_clear_interface());
        assert!(
            !Material {
                lobes: vec![(0.5, dielectric(0.0, 1.0))]
            }
            .is_clear_interface()
        );
        assert!(!Material::default().has_specular());
    }

    #[test]
    fn matched_media_are_recognized_in_every_lane() {
        let mut interface = Interface {
            eta_above: [1.4; 8],
            eta_below: [1.4; 8],
            count: 4,
            dispersive: false,
        };
        assert!(is_matched(&interface));
        interface.eta_below[3] = 1.41;
        assert!(!is_matched(&interface));
        interface.count = 3;
        assert!(is_matched(&interface));
    }
}
