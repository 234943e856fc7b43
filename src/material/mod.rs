//! Materials: parameters over a surface, turned into lobes at a point and at the wavelengths of a
//! path.

mod lobe;

pub use lobe::{LobeSpec, SMOOTH_ALPHA};

use crate::bsdf::albedo::Needs;
use crate::bsdf::lobe::diffuse::Diffuse;
use crate::bsdf::{Interface, Lobe};
use crate::geometry::SurfacePoint;
use crate::optics::Stack;
use crate::spectrum::{Ior, SampledWavelengths};
use crate::texture::{Image, ImageTexture, ScalarTexture, SpectrumTexture};
use glam::{DVec2, DVec3};
use std::sync::Arc;

/// Most lobes of a material.
pub const MAX_LOBES: usize = 4;

/// Most layers of a coating.
pub const MAX_LAYERS: usize = 100;
/// Thickest layer of a coating, in nanometers: beyond, layers are no longer coherent.
pub const MAX_LAYER_NM: f64 = 1e5;

/// Index of a material in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u32);

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
    /// Layers on the smooth dielectric interface that it is, as light from the side of the normal
    /// meets them.
    pub coating: Option<Arc<Stack>>,
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

    /// The smooth interface under a coating, whose layers are given as light from the side of the
    /// normal meets them.
    #[must_use]
    pub fn coated_interface(coating: Arc<Stack>) -> Self {
        Self {
            coating: Some(coating),
            ..Self::interface(0.0)
        }
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
        let end = out.len() + MAX_LOBES;
        for (weight, spec) in &self.lobes {
            let weight = weight.eval(uv).clamp(0.0, 1.0) * spec.share();
            if weight > 0.0 && out.len() < end {
                let weight = weight as f32;
                // the commonest lobe is put together where it stays
                if let Some(reflectance) = spec.lambertian(uv, wavelengths) {
                    out.push((weight, Lobe::Diffuse(Diffuse { reflectance })));
                } else {
                    out.push((weight, spec.build(uv, wavelengths, interface, multiple)));
                }
            }
        }
    }

    /// Adds what its rough lobes look up. The indices of dielectric interfaces are for the caller
    /// to add, who knows the media; whether there are any rough ones is told.
    pub fn add_needs(&self, needs: &mut Needs) -> bool {
        let lobes = self.lobes.iter().filter(|_| !self.single_scattering);
        lobes.fold(false, |any, (_, lobe)| lobe.add_needs(needs) || any)
    }

    /// Whether light crosses the surface without any vertex when the media on both sides are the
    /// same: a pure dielectric interface of full weight.
    #[must_use]
    pub fn is_clear_interface(&self) -> bool {
        if self.coating.is_some() {
            return false;
        }
        match self.lobes.as_slice() {
            [(weight, LobeSpec::Dielectric { transmit_tint, .. })] => {
                weight.constant() == Some(1.0) && transmit_tint.is_constant(1.0)
            }
            _ => false,
        }
    }

    /// Whether it is the smooth interface between the media on both sides and no more, coated or
    /// not: its one lobe is
    /// [`Dielectric::CLEAR`](crate::bsdf::lobe::dielectric::Dielectric::CLEAR) everywhere.
    #[must_use]
    pub fn is_smooth_interface(&self) -> bool {
        let [(weight, lobe)] = self.lobes.as_slice() else {
            return false;
        };
        let is_clear = |reflect: &SpectrumTexture, transmit: &SpectrumTexture| {
            reflect.is_constant(1.0) && transmit.is_constant(1.0)
        };
        weight.constant() == Some(1.0)
            && lobe.is_specular()
            && matches!(lobe, LobeSpec::Dielectric { reflect_tint, transmit_tint, .. }
                if is_clear(reflect_tint, transmit_tint))
    }

    /// Whether it reflects and whether it refracts as a smooth surface, where nothing about it is
    /// rough, bent, thin or left open; else `None`.
    #[must_use]
    pub fn smooth_labels(&self) -> Option<[bool; 2]> {
        let mut labels = [false; 2];
        for (_, lobe) in &self.lobes {
            match lobe {
                LobeSpec::Dielectric { .. } => labels = [true; 2],
                LobeSpec::Mirror { .. }
                | LobeSpec::Conductor { .. }
                | LobeSpec::ColoredMetal { .. } => labels[0] = true,
                _ => return None,
            }
            if !lobe.is_specular() {
                return None;
            }
        }
        let is_plain = self.normal.is_none() && self.coverage.is_none();
        (is_plain && labels[0]).then_some(labels)
    }

    /// Whether any lobe is specular (smooth) by its roughness. A rough interface between media of
    /// the same index is also built as smooth, which only its [`Lobe`] tells.
    #[must_use]
    pub fn has_specular(&self) -> bool {
        self.lobes_there().any(LobeSpec::is_specular)
    }

    /// Whether it may cast a caustic: it reflects or refracts into a narrow cone.
    #[must_use]
    pub fn casts(&self) -> bool {
        self.lobes_there().any(LobeSpec::is_narrow)
    }

    /// The lobes that have any weight.
    fn lobes_there(&self) -> impl Iterator<Item = &LobeSpec> {
        let there = |(weight, _): &&(ScalarTexture, LobeSpec)| weight.constant() != Some(0.0);
        self.lobes.iter().filter(there).map(|(_, spec)| spec)
    }

    /// Whether its reflectances can be told for one polarization: those of facets and of layers of
    /// paint are for unpolarized light.
    #[must_use]
    pub fn keeps_polarization(&self) -> bool {
        let is_known =
            |spec: &LobeSpec| matches!(spec, LobeSpec::Diffuse { .. }) || spec.is_specular();
        self.lobes_there().all(is_known)
    }

    /// Whether any lobe needs a medium on each side (dielectric).
    #[must_use]
    pub fn needs_interior(&self) -> bool {
        self.lobes
            .iter()
            .any(|(_, spec)| matches!(spec, LobeSpec::Dielectric { .. }))
    }

    /// Checks the lobes over a range of wavelengths in nm: parameters within their ranges, weights
    /// of at most 1 in sum.
    ///
    /// # Errors
    /// The first thing that is wrong, with what is allowed.
    pub fn validate(&self, range_nm: [f64; 2]) -> Result<(), String> {
        let count = self.lobes.len();
        if count > MAX_LOBES {
            return Err(format!("{count} lobes (allowed: at most {MAX_LOBES})"));
        }
        let mut sum = 0.0;
        for (weight, lobe) in &self.lobes {
            lobe::unit_scalar("a weight", weight)?;
            if lobe.counts() {
                sum += weight.constant().unwrap_or(0.0);
            }
            lobe.validate(range_nm)?;
        }
        if let Some(coating) = &self.coating {
            self.check_coating(coating, range_nm)?;
        }
        if sum > 1.0 + 1e-9 {
            return Err(format!(
                "the sum of the weights is {sum} (allowed: at most 1)"
            ));
        }
        Ok(())
    }

    /// Checks that it can carry a coating, and the layers over a range of wavelengths in nm.
    ///
    /// # Errors
    /// The first thing that is wrong, with what is allowed.
    pub fn check_coating(&self, coating: &Stack, range_nm: [f64; 2]) -> Result<(), String> {
        let is_smooth_interface =
            |spec: &LobeSpec| matches!(spec, LobeSpec::Dielectric { .. }) && spec.is_specular();
        if !self.lobes.iter().all(|(_, spec)| is_smooth_interface(spec)) {
            return Err("a coating is on a smooth dielectric interface only".to_owned());
        }
        if coating.backing.is_some() {
            let name = &coating.name;
            return Err(format!(
                "the coating {name} is a mirror on a metal, which lets nothing into the glass"
            ));
        }
        let count = coating.layers.len();
        if count > MAX_LAYERS {
            return Err(format!("{count} layers (allowed: at most {MAX_LAYERS})"));
        }
        coating.layers.iter().try_for_each(|layer| {
            let nm = layer.thickness_nm();
            if !(0.0..=MAX_LAYER_NM).contains(&nm) {
                return Err(format!(
                    "a layer of {nm} nm (allowed: 0 to {MAX_LAYER_NM} nm)"
                ));
            }
            let valid = layer.ior.validate_conductor(range_nm);
            valid.map(|_| ()).map_err(|error| error.to_string())
        })
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
