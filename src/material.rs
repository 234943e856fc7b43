//! Materials: parameters over a surface, turned into lobes at a point and at the wavelengths of a
//! path.

use crate::bsdf::albedo::{Alphas, Needs};
use crate::bsdf::coated::{Coat, CoatedDiffuse};
use crate::bsdf::conductor::{Conductor, Metal, Mirror};
use crate::bsdf::dielectric::Dielectric;
use crate::bsdf::diffuse::Diffuse;
use crate::bsdf::microfacet::Ggx;
use crate::bsdf::rough_dielectric::RoughDielectric;
use crate::bsdf::thin::Thin;
use crate::bsdf::{Interface, Lobe};
use crate::geometry::SurfacePoint;
use crate::spectrum::{Ior, SampledSpectrum, SampledWavelengths};
use crate::texture::{Image, ImageTexture, ScalarTexture, SpectrumTexture};
use glam::{DVec2, DVec3};
use std::sync::Arc;

/// GGX roughness below which a lobe is built as smooth: the peak's density would outgrow what
/// connections can use.
pub const SMOOTH_ALPHA: f64 = 1e-3;

/// Relative difference of indices below which a rough dielectric interface is built as smooth:
/// refraction is then undone to within rounding, and there is no half vector to speak of.
const MATCHED: f64 = 1e-6;

/// Index of a material in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u32);

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
fn add_needs(alpha: &[ScalarTexture; 2], out: &mut Alphas) {
    match [&alpha[0], &alpha[1]].map(ScalarTexture::constant) {
        [Some(_), Some(_)] => {
            if let Some(ggx) = roughness(alpha, DVec2::ZERO) {
                out.add(ggx.alpha);
            }
        }
        _ => out.add_range([0.0, 1.0]),
    }
}

impl LobeSpec {
    /// The lobe at a point; with `multiple` scattering between facets or without.
    fn build(
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

    fn is_specular(&self) -> bool {
        match self {
            Self::Diffuse { .. } | Self::CoatedDiffuse { .. } => false,
            Self::Mirror { .. } | Self::Thin { .. } => true,
            Self::Conductor { alpha, .. }
            | Self::ColoredMetal { alpha, .. }
            | Self::Coat { alpha, .. }
            | Self::Dielectric { alpha, .. } => is_smooth(alpha),
        }
    }

    fn append_images(&self, out: &mut Vec<Arc<Image>>) {
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
}

/// Normals from an image: red, green, blue are x, y, z of -1..1 along the directions of growing u
/// and v and the normal.
#[derive(Clone, Debug)]
pub struct NormalMap {
    /// The image, linear.
    pub texture: ImageTexture,
    /// Factor on x and y.
    pub scale: f64,
}

impl NormalMap {
    /// The shading normal at `point`, whose derivatives by its texture coordinates are `tangents`:
    /// on the side of the geometric normal. Where the map leaves that side, or there are no
    /// tangents, the normal stays as it is.
    #[must_use]
    pub fn normal(&self, point: &SurfacePoint, tangents: Option<[DVec3; 2]>) -> DVec3 {
        let Some([du, dv]) = tangents else {
            return point.ns;
        };
        // derivatives by the coordinates of the image
        let inverse = self.texture.map.matrix2.inverse();
        let along = |c: DVec2| {
            let d = du * c.x + dv * c.y;
            (d - point.ns * d.dot(point.ns)).try_normalize()
        };
        let (Some(x), Some(y)) = (along(inverse.x_axis), along(inverse.y_axis)) else {
            return point.ns;
        };
        let texel = self.texture.eval(point.uv);
        let [a, b, c] = [texel[0], texel[1], texel[2]].map(|v| 2.0 * f64::from(v) - 1.0);
        let bent = x * (a * self.scale) + y * (b * self.scale) + point.ns * c;
        match bent.try_normalize() {
            Some(n) if n.dot(point.ng) > 0.0 => n,
            _ => point.ns,
        }
    }
}

/// Which share of a surface is there: what is not lets light pass straight, as transmittance of the
/// segment.
#[derive(Clone, Debug)]
pub struct Coverage {
    /// Coverage, 0..1.
    pub alpha: ScalarTexture,
    /// All or nothing: there from this coverage on.
    pub cutoff: Option<f64>,
}

impl Coverage {
    /// The share at texture coordinates `uv`, in [0, 1].
    #[must_use]
    pub fn at(&self, uv: DVec2) -> f64 {
        let alpha = self.alpha.eval(uv).clamp(0.0, 1.0);
        match self.cutoff {
            Some(cutoff) => f64::from(u8::from(alpha >= cutoff)),
            None => alpha,
        }
    }
}

/// A mixture of weighted lobes (at most 4; no lobe: black).
///
/// A thin sheet and a dielectric interface do not mix: their exact transmissions have one label and
/// two directions.
#[derive(Clone, Debug, Default)]
pub struct Material {
    /// (weight in 0..1, lobe); the weights' sum is at most 1.
    pub lobes: Vec<(ScalarTexture, LobeSpec)>,
    /// Bends the shading normal.
    pub normal: Option<NormalMap>,
    /// Where the surface is there; `None`: everywhere. Only for surfaces that separate no media and
    /// emit nothing.
    pub coverage: Option<Coverage>,
    /// Light that facets of a rough lobe send to other facets is lost, instead of leaving after
    /// several.
    pub single_scattering: bool,
}

impl Material {
    /// A mixture of lobes, by weight.
    #[must_use]
    pub fn mix<const N: usize>(lobes: [(f64, LobeSpec); N]) -> Self {
        Self {
            lobes: lobes.map(|(weight, lobe)| (weight.into(), lobe)).into(),
            ..Self::default()
        }
    }

    /// A Lambertian surface.
    #[must_use]
    pub fn diffuse(reflectance: impl Into<SpectrumTexture>) -> Self {
        let reflectance = reflectance.into();
        Self::mix([(1.0, LobeSpec::Diffuse { reflectance })])
    }

    /// A perfect mirror.
    #[must_use]
    pub fn mirror(reflectance: impl Into<SpectrumTexture>) -> Self {
        let reflectance = reflectance.into();
        Self::mix([(1.0, LobeSpec::Mirror { reflectance })])
    }

    /// A metal of GGX roughness `alpha` (0: smooth).
    #[must_use]
    pub fn metal(ior: Ior, alpha: f64) -> Self {
        let (alpha, tint) = ([alpha.into(), alpha.into()], 1.0.into());
        Self::mix([(1.0, LobeSpec::Conductor { ior, alpha, tint })])
    }

    /// The interface between the media on both sides of a surface, of GGX roughness `alpha` (0:
    /// smooth).
    #[must_use]
    pub fn interface(alpha: f64) -> Self {
        let lobe = LobeSpec::Dielectric {
            alpha: [alpha.into(), alpha.into()],
            reflect_tint: 1.0.into(),
            transmit_tint: 1.0.into(),
        };
        Self::mix([(1.0, lobe)])
    }

    /// Appends the (weight, lobe) pairs of the point with texture coordinates `uv`. Lobes of weight
    /// 0 are left out, and any beyond the fourth.
    pub fn push_lobes(
        &self,
        uv: DVec2,
        wavelengths: &SampledWavelengths,
        interface: &Interface,
        out: &mut Vec<(f32, Lobe)>,
    ) {
        let multiple = !self.single_scattering;
        let lobes = self
            .lobes
            .iter()
            .map(|(weight, spec)| {
                let share = match spec {
                    LobeSpec::Coat { .. } => COAT_SHARE,
                    _ => 1.0,
                };
                (weight.eval(uv).clamp(0.0, 1.0) * share, spec)
            })
            .filter(|(weight, _)| *weight > 0.0)
            .take(4)
            .map(|(weight, spec)| {
                (
                    weight as f32,
                    spec.build(uv, wavelengths, interface, multiple),
                )
            });
        out.extend(lobes);
    }

    /// Adds what its rough lobes look up. The indices of dielectric interfaces are for the caller
    /// to add, who knows the media; whether there are any rough ones is told.
    pub fn add_needs(&self, needs: &mut Needs) -> bool {
        let mut is_rough_interface = false;
        for (_, lobe) in self.lobes.iter().filter(|_| !self.single_scattering) {
            match lobe {
                LobeSpec::Conductor { alpha, .. } | LobeSpec::ColoredMetal { alpha, .. } => {
                    add_needs(alpha, &mut needs.reflectors);
                }
                LobeSpec::Dielectric { alpha, .. } if !is_smooth(alpha) => {
                    add_needs(alpha, &mut needs.interfaces);
                    is_rough_interface = true;
                }
                LobeSpec::CoatedDiffuse { alpha, coat, .. } if !is_smooth(alpha) => {
                    add_needs(alpha, &mut needs.layers);
                    needs.layer_indices.push(coat.index);
                }
                _ => {}
            }
        }
        is_rough_interface
    }

    /// Whether light crosses the surface without any vertex when the media on both sides are the
    /// same: a pure dielectric interface of full weight.
    #[must_use]
    pub fn is_clear_interface(&self) -> bool {
        match self.lobes.as_slice() {
            [(weight, LobeSpec::Dielectric { transmit_tint, .. })] => {
                weight.constant() == Some(1.0) && transmit_tint.is_constant(1.0)
            }
            _ => false,
        }
    }

    /// Whether any lobe is specular (smooth) by its roughness. A rough interface between media of
    /// the same index is also built as smooth, which only its [`Lobe`] tells.
    #[must_use]
    pub fn has_specular(&self) -> bool {
        self.lobes
            .iter()
            .any(|(weight, spec)| weight.constant() != Some(0.0) && spec.is_specular())
    }

    /// Whether any lobe needs a medium on each side (dielectric).
    #[must_use]
    pub fn needs_interior(&self) -> bool {
        self.lobes
            .iter()
            .any(|(_, spec)| matches!(spec, LobeSpec::Dielectric { .. }))
    }

    /// Appends the images it refers to, with repetitions.
    pub fn append_images(&self, out: &mut Vec<Arc<Image>>) {
        for (weight, lobe) in &self.lobes {
            weight.append_images(out);
            lobe.append_images(out);
        }
        out.extend(self.normal.iter().map(|n| n.texture.image.clone()));
        if let Some(coverage) = &self.coverage {
            coverage.alpha.append_images(out);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::albedo::NO_ALBEDOS;
    use crate::geometry::{InstanceId, SurfaceId};
    use crate::spectrum::Curve;

    fn dielectric(alpha: f64, transmit: f64) -> LobeSpec {
        LobeSpec::Dielectric {
            alpha: [alpha.into(), alpha.into()],
            reflect_tint: Curve::Constant(1.0).into(),
            transmit_tint: Curve::Constant(transmit).into(),
        }
    }

    fn material(lobe: LobeSpec) -> Material {
        Material {
            lobes: vec![(1.0.into(), lobe)],
            ..Material::default()
        }
    }

    #[test]
    fn small_roughness_is_smooth() {
        assert!(material(dielectric(0.0, 1.0)).has_specular());
        assert!(material(dielectric(9.9e-4, 1.0)).has_specular());
        assert!(!material(dielectric(1e-3, 1.0)).has_specular());
        assert_eq!(
            roughness(&[0.0.into(), 0.5.into()], DVec2::ZERO),
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
            reflectance: Curve::Constant(1.0).into(),
        };
        assert!(material(dielectric(0.3, 1.0)).needs_interior());
        assert!(!material(mirror.clone()).needs_interior());
        assert!(!material(mirror).is_clear_interface());
        assert!(
            !Material {
                lobes: vec![(0.5.into(), dielectric(0.0, 1.0))],
                ..Material::default()
            }
            .is_clear_interface()
        );
        assert!(!Material::default().has_specular());
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
                albedos: &NO_ALBEDOS,
            })
        };
        assert!(is_matched(&below, 4));
        below[3] = 1.41;
        assert!(!is_matched(&below, 4));
        assert!(is_matched(&below, 3));
    }

    #[test]
    fn flat_normals_bend_nothing_and_others_towards_growing_coordinates() {
        let bent = |texel: [u8; 4], map: glam::DAffine2| {
            let image = Image::from_bytes(1, 1, vec![texel], false).expect("valid");
            let texture = ImageTexture {
                map,
                ..ImageTexture::new(Arc::new(image))
            };
            let id = SurfaceId {
                instance: InstanceId(0),
                prim: 0,
            };
            let point = SurfacePoint {
                p: DVec3::ZERO,
                ng: DVec3::Z,
                ns: DVec3::Z,
                uv: DVec2::ZERO,
                id,
            };
            NormalMap {
                texture,
                scale: 1.0,
            }
            .normal(&point, Some([DVec3::X, DVec3::Y * 3.0]))
        };
        let identity = glam::DAffine2::IDENTITY;
        let flat = bent([128, 128, 255, 255], identity);
        assert!((flat - DVec3::Z).length() < 0.01);
        assert!(bent([255, 128, 200, 255], identity).x > 0.8);
        assert!(bent([128, 255, 200, 255], identity).y > 0.8);
        let flipped = glam::DAffine2::from_scale(DVec2::new(1.0, -1.0));
        assert!(bent([128, 255, 200, 255], flipped).y < -0.8);
        // a normal below the surface is not taken
        assert_eq!(bent([255, 128, 0, 255], identity), DVec3::Z);
    }

    #[test]
    fn masks_are_all_or_nothing() {
        let coverage = |alpha: f64, cutoff| Coverage {
            alpha: alpha.into(),
            cutoff,
        };
        assert_eq!(coverage(0.3, None).at(DVec2::ZERO), 0.3);
        assert_eq!(coverage(0.3, Some(0.5)).at(DVec2::ZERO), 0.0);
        assert_eq!(coverage(0.5, Some(0.5)).at(DVec2::ZERO), 1.0);
    }
}
