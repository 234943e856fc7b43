//! Materials of a glTF file: metallic-roughness and its extensions, as mixtures of the lobes there are.
//!
//! A dielectric is a diffuse base under a GGX layer; a metal reflects its base color at normal incidence. Transmission is
//! a solid where the material has a thickness and its mesh is closed, else a thin sheet.

use super::buffers::read_uri;
use super::{Fault, Reader, hashed};
use crate::bsdf::coated::Coat;
use crate::io::image_file::{self, MAX_IMAGE_BYTES};
use crate::material::{Coverage, LobeSpec, Material, NormalMap};
use crate::medium::{Medium, absorption_of};
use crate::scene::description::AreaEmission;
use crate::spectrum::{Curve, Emission, Ior, Library, upsample};
use crate::texture::{Filter, Image, ImageTexture, ScalarTexture, SpectrumTexture, Wrap};
use glam::{DAffine2, DMat2, DVec2};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::{AlphaMode, Material as Source};
use gltf::json::texture::{Info, MagFilter, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{Index, texture};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Radiance with Y = 1 in cd/m²: glTF counts in nit.
pub const PER_NIT: f64 = 1.0 / (683.0 * crate::spectrum::cie::N_Y);
/// Range in which a Cauchy formula is taken to hold.
const RANGE_NM: [f64; 2] = [100.0, 20_000.0];

/// Images decoded so far, by number and encoding.
#[derive(Default)]
pub struct Images {
    decoded: BTreeMap<(usize, bool), Arc<Image>>,
}

/// A material on one kind of mesh.
pub struct Converted {
    /// Its lobes.
    pub material: Material,
    /// What it emits.
    pub emission: Option<AreaEmission>,
    /// What fills the mesh.
    pub interior: Option<Medium>,
}

/// Whether the material fills the inside of a closed mesh.
pub fn has_volume(source: &Source) -> bool {
    let extensions = source.extensions.as_ref();
    let transmits = extensions
        .and_then(|e| e.transmission.as_ref())
        .is_some_and(|t| t.transmission_factor.0 > 0.0);
    let thick = extensions
        .and_then(|e| e.volume.as_ref())
        .is_some_and(|v| v.thickness_factor.0 > 0.0);
    transmits && thick
}

/// The set of texture coordinates that the material uses first.
pub fn coordinate_set(source: &Source) -> u32 {
    coordinate_sets(source).next().unwrap_or(0)
}

/// The sets of texture coordinates of the textures of a material.
fn coordinate_sets(source: &Source) -> impl Iterator<Item = u32> {
    let pbr = &source.pbr_metallic_roughness;
    let of = |info: Option<&Info>| {
        info.map(|i| {
            transform_of(i)
                .and_then(|t| t.tex_coord)
                .unwrap_or(i.tex_coord)
        })
    };
    [
        of(pbr.base_color_texture.as_ref()),
        source.normal_texture.as_ref().map(|n| n.tex_coord),
        of(pbr.metallic_roughness_texture.as_ref()),
        of(source.emissive_texture.as_ref()),
    ]
    .into_iter()
    .flatten()
}

fn transform_of(info: &Info) -> Option<&TextureTransform> {
    info.extensions.as_ref()?.texture_transform.as_ref()
}

fn finite(value: f32, what: &str) -> Result<f64, Fault> {
    if value.is_finite() {
        Ok(value.into())
    } else {
        Err(Fault::new(format!("{what} is not finite")))
    }
}

/// A factor of 0..1.
fn fraction(value: f32, what: &str) -> Result<f64, Fault> {
    Ok(finite(value, what)?.clamp(0.0, 1.0))
}

impl Reader<'_> {
    fn image(&mut self, index: usize, srgb: bool) -> Result<Arc<Image>, Fault> {
        if let Some(image) = self.images.decoded.get(&(index, srgb)) {
            return Ok(image.clone());
        }
        let source = self
            .root
            .images
            .get(index)
            .ok_or_else(|| Fault::missing("image", index))?;
        let what = format!("image {index}");
        let held;
        let bytes = match (&source.uri, source.buffer_view) {
            (Some(uri), _) => {
                held = read_uri(self.folder, uri, &what, MAX_IMAGE_BYTES)?;
                &held
            }
            (None, Some(view)) => self.buffers.view(view)?.0,
            (None, None) => return Err(Fault::new(format!("{what} has no bytes"))),
        };
        let decoded = image_file::decode(bytes, srgb)
            .map_err(|message| Fault::new(format!("{what}: {message}")))?;
        self.model.hash = hashed(self.model.hash, bytes);
        let decoded = Arc::new(decoded);
        self.images.decoded.insert((index, srgb), decoded.clone());
        Ok(decoded)
    }

    fn texture(
        &mut self,
        index: Index<texture::Texture>,
        transform: Option<&TextureTransform>,
        srgb: bool,
    ) -> Result<ImageTexture, Fault> {
        let i = index.value();
        let source = self
            .root
            .textures
            .get(i)
            .ok_or_else(|| Fault::missing("texture", i))?;
        let image = self.image(source.source.value(), srgb)?;
        let sampler = match source.sampler {
            None => None,
            Some(s) => Some(
                self.root
                    .samplers
                    .get(s.value())
                    .ok_or_else(|| Fault::missing("sampler", s.value()))?,
            ),
        };
        let wrap = |mode: Checked<WrappingMode>| match mode {
            Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
            Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let nearest = sampler
            .and_then(|s| s.mag_filter)
            .is_some_and(|f| matches!(f, Checked::Valid(MagFilter::Nearest)));
        Ok(ImageTexture {
            map: coordinate_map(transform)?,
            wrap: sampler.map_or([Wrap::Repeat; 2], |s| [wrap(s.wrap_s), wrap(s.wrap_t)]),
            filter: if nearest {
                Filter::Nearest
            } else {
                Filter::Bilinear
            },
            ..ImageTexture::new(image)
        })
    }

    fn info(&mut self, info: &Info, srgb: bool) -> Result<ImageTexture, Fault> {
        self.texture(info.index, transform_of(info), srgb)
    }

    /// One channel of a texture, or 1.
    fn scalar(
        &mut self,
        factor: f64,
        info: Option<&Info>,
        channel: usize,
    ) -> Result<ScalarTexture, Fault> {
        let Some(info) = info else {
            return Ok(factor.into());
        };
        let texture = self.info(info, false)?;
        Ok(ScalarTexture::Image { texture, channel }.times(factor))
    }

    /// The color of a factor and a texture.
    fn color(&mut self, factor: [f32; 3], info: Option<&Info>) -> Result<SpectrumTexture, Fault> {
        for value in factor {
            finite(value, "a color factor")?;
        }
        let factor = factor.map(|v| v.clamp(0.0, 1.0));
        match info {
            None => Ok(upsample::reflectance(factor.map(f64::from)).into()),
            Some(info) => Ok(SpectrumTexture::Image {
                texture: self.info(info, true)?,
                factor,
            }),
        }
    }

    /// A material for meshes that are `closed` or not.
    pub fn material(
        &mut self,
        source: &Source,
        name: &str,
        closed: bool,
    ) -> Result<Converted, Fault> {
        let set = coordinate_set(source);
        if coordinate_sets(source).any(|other| other != set) {
            self.note(format!(
                "material \"{name}\": its textures use several sets of coordinates: all are taken from TEXCOORD_{set}"
            ));
        }
        let pbr = &source.pbr_metallic_roughness;
        let extensions = source.extensions.as_ref();
        for other in extensions.iter().flat_map(|e| e.others.keys()) {
            if other != "KHR_materials_dispersion" {
                self.note(format!(
                    "material \"{name}\": {other} is not understood: ignored"
                ));
            }
        }
        if source.occlusion_texture.is_some() {
            self.note(
                "occlusion textures are not read: light itself finds what is occluded".into(),
            );
        }
        if extensions.is_some_and(|e| e.unlit.is_some()) {
            self.note(format!("material \"{name}\" is unlit: rendered as diffuse"));
        }
        let [r, g, b, a] = pbr.base_color_factor.0;
        let base = self.color([r, g, b], pbr.base_color_texture.as_ref())?;
        let mr = pbr.metallic_roughness_texture.as_ref();
        let metallic = self.scalar(fraction(pbr.metallic_factor.0, "metallicFactor")?, mr, 2)?;
        let roughness = self.scalar(fraction(pbr.roughness_factor.0, "roughnessFactor")?, mr, 1)?;
        let alpha = roughness.clone().times(roughness);
        let alpha = [alpha.clone(), alpha];
        let index = match extensions.and_then(|e| e.ior.as_ref()) {
            None => 1.5,
            Some(ior) => {
                let n = finite(ior.ior.0, "ior")?;
                if !(1.0..=10.0).contains(&n) {
                    self.note(format!(
                        "material \"{name}\": ior {n} is taken as 1.5 (allowed: 1 to 10)"
                    ));
                    1.5
                } else {
                    n
                }
            }
        };
        let transmission = match extensions.and_then(|e| e.transmission.as_ref()) {
            None => ScalarTexture::Constant(0.0),
            Some(t) => self.scalar(
                fraction(t.transmission_factor.0, "transmissionFactor")?,
                t.transmission_texture.as_ref(),
                0,
            )?,
        };
        let mut converted = Converted {
            material: Material::default(),
            emission: self.emission(source)?,
            interior: None,
        };
        let dielectric = metallic.complement();
        let opaque = dielectric.clone().times(transmission.complement());
        let transparent = dielectric.times(transmission);
        let unlit = extensions.is_some_and(|e| e.unlit.is_some());
        let lobes = &mut converted.material.lobes;
        if unlit {
            lobes.push((1.0.into(), LobeSpec::Diffuse { reflectance: base }));
        } else {
            let (strength, tint) = self.specular(source)?;
            lobes.push((
                opaque.clone(),
                LobeSpec::CoatedDiffuse {
                    reflectance: base.clone(),
                    coat: Coat::new(index, 1.0),
                    strength: strength.clone(),
                    alpha: alpha.clone(),
                },
            ));
            lobes.push((
                opaque.times(strength),
                LobeSpec::Coat {
                    index,
                    alpha: alpha.clone(),
                    tint,
                },
            ));
            lobes.push((
                metallic,
                LobeSpec::ColoredMetal {
                    color: base.clone(),
                    alpha: alpha.clone(),
                },
            ));
            if transparent.constant() != Some(0.0) {
                let glass = self.glass(source, name, index)?;
                if closed && has_volume(source) {
                    converted.interior = Some(self.interior(source, name, glass)?);
                    lobes.push((
                        transparent,
                        LobeSpec::Dielectric {
                            alpha,
                            reflect_tint: Curve::Constant(1.0).into(),
                            transmit_tint: base,
                        },
                    ));
                } else {
                    if has_volume(source) {
                        self.note(format!("material \"{name}\" has a volume, but a mesh of it is not closed: rendered as a thin sheet"));
                    }
                    if alpha[0].constant() != Some(0.0) {
                        self.note(format!("material \"{name}\": thin sheets are smooth, its roughness applies to reflection only"));
                    }
                    lobes.push((
                        transparent,
                        LobeSpec::Thin {
                            ior: glass,
                            transmit_tint: base,
                        },
                    ));
                }
            }
        }
        converted
            .material
            .lobes
            .retain(|(weight, _)| weight.constant() != Some(0.0));
        if let Some(normal) = &source.normal_texture {
            let transform: Option<TextureTransform> = normal
                .extensions
                .as_ref()
                .and_then(|e| e.others.get("KHR_texture_transform"))
                .and_then(|v| serde_json::from_value(v.clone()).ok());
            converted.material.normal = Some(NormalMap {
                texture: self.texture(normal.index, transform.as_ref(), false)?,
                scale: finite(normal.scale, "the scale of a normal texture")?,
            });
        }
        let cutoff = match source.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => Some(Some(finite(
                source.alpha_cutoff.map_or(0.5, |c| c.0),
                "alphaCutoff",
            )?)),
            Checked::Valid(AlphaMode::Blend) => Some(None),
            _ => None,
        };
        if let Some(cutoff) = cutoff {
            let coverage = self.scalar_of_alpha(
                fraction(a, "the base color's alpha")?,
                pbr.base_color_texture.as_ref(),
            )?;
            if converted.emission.is_some() || converted.interior.is_some() {
                self.note(format!(
                    "material \"{name}\" emits or has a volume: its alpha is not read"
                ));
            } else if coverage.constant() != Some(1.0) {
                converted.material.coverage = Some(Coverage {
                    alpha: coverage,
                    cutoff,
                });
            }
        }
        Ok(converted)
    }

    /// The coverage in the base color's texture (the same image as its color).
    fn scalar_of_alpha(
        &mut self,
        factor: f64,
        info: Option<&Info>,
    ) -> Result<ScalarTexture, Fault> {
        let Some(info) = info else {
            return Ok(factor.into());
        };
        let texture = self.info(info, true)?;
        Ok(ScalarTexture::Image {
            texture,
            channel: 3,
        }
        .times(factor))
    }

    /// Strength and tint of the layer's reflection.
    fn specular(&mut self, source: &Source) -> Result<(ScalarTexture, SpectrumTexture), Fault> {
        let white = || Curve::Constant(1.0).into();
        let Some(specular) = source.extensions.as_ref().and_then(|e| e.specular.as_ref()) else {
            return Ok((1.0.into(), white()));
        };
        let strength = self.scalar(
            fraction(specular.specular_factor.0, "specularFactor")?,
            specular.specular_texture.as_ref(),
            3,
        )?;
        let tint = self.color(
            specular.specular_color_factor.0,
            specular.specular_color_texture.as_ref(),
        )?;
        Ok((strength, tint))
    }

    fn emission(&mut self, source: &Source) -> Result<Option<AreaEmission>, Fault> {
        let strength = match source
            .extensions
            .as_ref()
            .and_then(|e| e.emissive_strength.as_ref())
        {
            None => 1.0,
            Some(e) => finite(e.emissive_strength.0, "emissiveStrength")?.max(0.0),
        };
        let factor = source.emissive_factor.0;
        for value in factor {
            finite(value, "emissiveFactor")?;
        }
        let factor = factor.map(|v| v.max(0.0));
        let largest = factor.iter().copied().fold(0.0, f32::max);
        if largest == 0.0 || strength == 0.0 {
            return Ok(None);
        }
        let nit = strength * PER_NIT;
        let two_sided = source.double_sided;
        let Some(info) = &source.emissive_texture else {
            let radiance = Emission::from_rgb(factor.map(|v| f64::from(v) * nit));
            return Ok(Some(AreaEmission {
                radiance,
                pattern: None,
                two_sided,
            }));
        };
        let pattern = SpectrumTexture::Image {
            texture: self.info(info, true)?,
            factor: factor.map(|v| v / largest),
        };
        Ok((pattern.mean() > 0.0).then(|| AreaEmission {
            radiance: Emission::from_rgb([f64::from(largest) * nit; 3]),
            pattern: Some(pattern),
            two_sided,
        }))
    }

    /// The glass: a real one by name, else the file's index with the dispersion it gives.
    fn glass(&mut self, source: &Source, name: &str, index: f64) -> Result<Ior, Fault> {
        let extras: Option<serde_json::Value> = source
            .extras
            .as_ref()
            .and_then(|e| serde_json::from_str(e.get()).ok());
        if let Some(glass) = extras.as_ref().and_then(|e| e.get("glass")?.as_str()) {
            return Library::embedded()
                .ior(glass)
                .map_err(|e| Fault::new(format!("material \"{name}\", extras.glass: {e}")));
        }
        let dispersion = source
            .extensions
            .as_ref()
            .and_then(|e| {
                e.others
                    .get("KHR_materials_dispersion")?
                    .get("dispersion")?
                    .as_f64()
            })
            .unwrap_or(0.0);
        if dispersion <= 0.0 || index == 1.0 {
            return Ok(Ior::constant(index));
        }
        let abbe = 20.0 / dispersion;
        let coefficients = cauchy(index, abbe);
        // the file's own digits
        let shown = index as f32;
        self.note(format!(
            "material \"{name}\": a Cauchy glass with n_d {shown} and V_d {abbe:.1}, all that the file gives (extras.glass names a real one)"
        ));
        let ior = Ior::formula(5, vec![coefficients[0], coefficients[1], -2.0], RANGE_NM)
            .map_err(|e| Fault::new(format!("material \"{name}\": {e}")))?;
        ior.validate([360.0, 830.0])
            .map_err(|e| Fault::new(format!("material \"{name}\": {e}")))?;
        Ok(ior.named(format!("n_d {shown}, V_d {abbe:.1}"), "the model"))
    }

    fn interior(&mut self, source: &Source, name: &str, ior: Ior) -> Result<Medium, Fault> {
        let mut absorption = None;
        if let Some(volume) = source.extensions.as_ref().and_then(|e| e.volume.as_ref()) {
            let distance = f64::from(volume.attenuation_distance.0);
            let color = volume.attenuation_color.0;
            for value in color {
                finite(value, "attenuationColor")?;
            }
            if distance.is_finite() && distance > 0.0 && color != [1.0; 3] {
                let transmittance = upsample::reflectance(color.map(f64::from));
                absorption = Some(absorption_of(&transmittance, distance, [360.0, 830.0]));
            }
        }
        Ok(Medium {
            name: name.to_owned(),
            ior,
            absorption,
            use_k: true,
        })
    }
}

/// n = A + B/λ² (µm) with index `n_d` at 587.56 nm and Abbe number `v_d`.
fn cauchy(n_d: f64, v_d: f64) -> [f64; 2] {
    const D: f64 = 0.587_561_8;
    const F: f64 = 0.486_132_7;
    const C: f64 = 0.656_272_5;
    let b = (n_d - 1.0) / v_d / (F.powi(-2) - C.powi(-2));
    [n_d - b * D.powi(-2), b]
}

/// From the coordinates of the file (v downward) to those of an image here (v upward).
fn coordinate_map(transform: Option<&TextureTransform>) -> Result<DAffine2, Fault> {
    let flip = DAffine2::from_mat2_translation(
        DMat2::from_diagonal(DVec2::new(1.0, -1.0)),
        DVec2::new(0.0, 1.0),
    );
    let Some(t) = transform else {
        return Ok(flip);
    };
    let (sin, cos) = finite(t.rotation.0, "the rotation of a texture")?.sin_cos();
    let [su, sv] = t.scale.0.map(f64::from);
    let map = DAffine2::from_mat2_translation(
        DMat2::from_cols(DVec2::new(cos, -sin) * su, DVec2::new(sin, cos) * sv),
        DVec2::from(t.offset.0.map(f64::from)),
    );
    if !map.is_finite() {
        return Err(Fault::new("the transform of a texture is not finite"));
    }
    Ok(flip * map)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cauchy_has_the_index_and_abbe_number_asked_for() {
        let [a, b] = cauchy(1.6, 30.0);
        let n = |um: f64| a + b / (um * um);
        assert!((n(0.587_561_8) - 1.6).abs() < 1e-12);
        let v = (n(0.587_561_8) - 1.0) / (n(0.486_132_7) - n(0.656_272_5));
        assert!((v - 30.0).abs() < 1e-9);
    }

    #[test]
    fn coordinates_run_downward_in_the_file() {
        let map = coordinate_map(None).expect("valid");
        assert_eq!(map.transform_point2(DVec2::ZERO), DVec2::new(0.0, 1.0));
        assert_eq!(map.transform_point2(DVec2::ONE), DVec2::new(1.0, 0.0));
    }
}
