//! Materials of a glTF file: metallic-roughness and its extensions, as mixtures of the lobes there
//! are.
//!
//! A dielectric is a diffuse base under a GGX layer; a metal reflects its base color at normal
//! incidence. Transmission is a solid where the material has a thickness and its mesh is closed,
//! else a thin sheet.

use super::buffers::read_uri;
use super::glass::has_volume;
use super::{Fault, Reader, hashed};
use crate::bsdf::lobe::coated::Coat;
use crate::io::image_file::{self, Encoding, MAX_IMAGE_BYTES};
use crate::material::{Coverage, LobeSpec, Material, NormalMap};
use crate::medium::Medium;
use crate::scene::description::AreaEmission;
use crate::spectrum::{Curve, Emission, upsample};
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
/// Reflectance at normal incidence from which a layer is a mirror.
const MIRROR: f64 = 0.98;

/// Images decoded so far, by number and encoding.
#[derive(Default)]
pub struct Images {
    decoded: BTreeMap<(usize, bool), Arc<Image>>,
}

/// A material on one kind of mesh.
pub struct Converted {
    /// Lobes of the material.
    pub material: Material,
    /// Emission of the surface.
    pub emission: Option<AreaEmission>,
    /// Medium that fills the mesh.
    pub interior: Option<Medium>,
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

pub fn finite(value: f32, what: &str) -> Result<f64, Fault> {
    if value.is_finite() {
        Ok(value.into())
    } else {
        Err(Fault::new(format!("{what} is not finite")))
    }
}

impl Reader<'_> {
    /// A factor of 0..1.
    fn fraction(&mut self, value: f32, what: &str) -> Result<f64, Fault> {
        let value = finite(value, what)?;
        let held = value.clamp(0.0, 1.0);
        if held != value {
            self.note(format!(
                "{what} {value} is taken as {held} (allowed: 0 to 1)"
            ));
        }
        Ok(held)
    }

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
                let path;
                (path, held) = read_uri(self.folder, uri, &what, MAX_IMAGE_BYTES)?;
                self.model.files.extend(path);
                &held
            }
            (None, Some(view)) => self.buffers.view(view)?.0,
            (None, None) => return Err(Fault::new(format!("{what} has no bytes"))),
        };
        let encoding = if srgb {
            Encoding::Srgb
        } else {
            Encoding::Linear
        };
        let decoded = image_file::decode(bytes, encoding)
            .map_err(|message| Fault::new(format!("{what}: {message}")))?;
        self.model.hash = hashed(self.model.hash, bytes);
        for note in decoded.notes {
            self.note(format!("{what}: {note}"));
        }
        let decoded = Arc::new(decoded.image);
        self.images.decoded.insert((index, srgb), decoded.clone());
        Ok(decoded)
    }

    fn texture(
        &mut self,
        index: Index<texture::Texture>,
        transform: Option<&TextureTransform>,
        srgb: bool,
    ) -> Result<Option<ImageTexture>, Fault> {
        let i = index.value();
        let source = self
            .root
            .textures
            .get(i)
            .ok_or_else(|| Fault::missing("texture", i))?;
        // what the typed JSON has where the file has no source
        if source.source.value() == u32::MAX as usize {
            let others = source.extensions.as_ref().map(|e| e.others.keys());
            let named: Vec<String> = others.into_iter().flatten().cloned().collect();
            let named = match named.as_slice() {
                [] => "it has no image".to_owned(),
                names => format!("its image is named by {} only", names.join(", ")),
            };
            self.note(format!("texture {i} is not read: {named}"));
            return Ok(None);
        }
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
        Ok(Some(ImageTexture {
            map: coordinate_map(transform)?,
            wrap: sampler.map_or([Wrap::Repeat; 2], |s| [wrap(s.wrap_s), wrap(s.wrap_t)]),
            filter: if nearest {
                Filter::Nearest
            } else {
                Filter::Bilinear
            },
            ..ImageTexture::new(image)
        }))
    }

    /// The texture, where there is one and it has an image.
    fn info(&mut self, info: Option<&Info>, srgb: bool) -> Result<Option<ImageTexture>, Fault> {
        match info {
            None => Ok(None),
            Some(info) => self.texture(info.index, transform_of(info), srgb),
        }
    }

    /// One channel of a texture, or 1.
    fn scalar(
        &mut self,
        factor: f64,
        info: Option<&Info>,
        channel: usize,
    ) -> Result<ScalarTexture, Fault> {
        Ok(match self.info(info, false)? {
            None => factor.into(),
            Some(texture) => ScalarTexture::Image { texture, channel }.times(factor),
        })
    }

    /// The color of a factor and a texture.
    fn color(&mut self, factor: [f32; 3], info: Option<&Info>) -> Result<SpectrumTexture, Fault> {
        let mut held = factor;
        for value in &mut held {
            self.fraction(*value, "a color factor")?;
            *value = value.clamp(0.0, 1.0);
        }
        Ok(match self.info(info, true)? {
            None => upsample::reflectance(held.map(f64::from)).into(),
            Some(texture) => SpectrumTexture::Image {
                texture,
                factor: held,
            },
        })
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
        let metallic = self.fraction(pbr.metallic_factor.0, "metallicFactor")?;
        let metallic = self.scalar(metallic, mr, 2)?;
        let roughness = self.fraction(pbr.roughness_factor.0, "roughnessFactor")?;
        let roughness = self.scalar(roughness, mr, 1)?;
        let alpha = roughness.clone().times(roughness);
        let alpha = [alpha.clone(), alpha];
        let index = match extensions.and_then(|e| e.ior.as_ref()) {
            None => 1.5,
            Some(ior) => {
                let n = finite(ior.ior.0, "ior")?;
                // 0 stands for an infinite index (KHR_materials_ior)
                if n == 0.0 {
                    f64::INFINITY
                } else if !(1.0..=10.0).contains(&n) {
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
            Some(t) => {
                let factor = self.fraction(t.transmission_factor.0, "transmissionFactor")?;
                self.scalar(factor, t.transmission_texture.as_ref(), 0)?
            }
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
        if unlit || transparent.constant() == Some(0.0) {
            self.misplaced_glass(&source.extras, &format!("material \"{name}\""));
        }
        let lobes = &mut converted.material.lobes;
        if unlit {
            lobes.push((1.0.into(), LobeSpec::Diffuse { reflectance: base }));
        } else {
            let (strength, layer, tint) = self.specular(source, index)?;
            if layer.is_finite() {
                lobes.push((
                    opaque.clone(),
                    LobeSpec::CoatedDiffuse {
                        reflectance: base.clone(),
                        coat: Coat::new(layer, 1.0),
                        strength: strength.clone(),
                        alpha: alpha.clone(),
                    },
                ));
                lobes.push((
                    opaque.times(strength),
                    LobeSpec::Coat {
                        index: layer,
                        alpha: alpha.clone(),
                        tint,
                    },
                ));
            } else {
                // nothing reaches the base below a layer that reflects all
                let reflectance = base.clone();
                let bare = opaque.clone().times(strength.complement());
                lobes.push((bare, LobeSpec::Diffuse { reflectance }));
                let alpha = alpha.clone();
                let mirror = LobeSpec::ColoredMetal { color: tint, alpha };
                lobes.push((opaque.times(strength), mirror));
            }
            lobes.push((
                metallic,
                LobeSpec::ColoredMetal {
                    color: base.clone(),
                    alpha: alpha.clone(),
                },
            ));
            if transparent.constant() != Some(0.0) {
                let explicit = extensions.is_some_and(|e| e.volume.is_some());
                let glass_index = if index.is_finite() {
                    index
                } else {
                    self.note(format!(
                        "material \"{name}\": ior 0 is taken as 10 where it transmits"
                    ));
                    10.0
                };
                let glass = self.glass(source, name, glass_index)?;
                if closed && has_volume(source) {
                    if !explicit {
                        self.note(format!("material \"{name}\" transmits and says nothing of a volume: closed meshes of it are solid (a KHR_materials_volume with thicknessFactor 0 makes thin sheets of them)"));
                    }
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
                    if explicit && has_volume(source) {
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
            let scale = finite(normal.scale, "the scale of a normal texture")?;
            let texture = self.texture(normal.index, transform.as_ref(), false)?;
            converted.material.normal = texture.map(|texture| NormalMap { texture, scale });
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
            let factor = self.fraction(a, "the base color's alpha")?;
            let coverage = self.scalar_of_alpha(factor, pbr.base_color_texture.as_ref())?;
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
        Ok(match self.info(info, true)? {
            None => factor.into(),
            Some(texture) => ScalarTexture::Image {
                texture,
                channel: 3,
            }
            .times(factor),
        })
    }

    /// Strength, index and tint of the layer's reflection, for a material of index `index`. The
    /// index is infinite where the layer reflects all at normal incidence, but for its tint.
    fn specular(
        &mut self,
        source: &Source,
        index: f64,
    ) -> Result<(ScalarTexture, f64, SpectrumTexture), Fault> {
        let white = || Curve::Constant(1.0).into();
        let Some(specular) = source.extensions.as_ref().and_then(|e| e.specular.as_ref()) else {
            return Ok((1.0.into(), index, white()));
        };
        let strength = self.fraction(specular.specular_factor.0, "specularFactor")?;
        let strength = self.scalar(strength, specular.specular_texture.as_ref(), 3)?;
        let mut color = specular.specular_color_factor.0;
        for value in color {
            finite(value, "specularColorFactor")?;
        }
        let (index, scale) = layer(index, color.iter().copied().fold(0.0, f32::max).into());
        color = color.map(|v| (f64::from(v) * scale) as f32);
        let tint = self.color(color, specular.specular_color_texture.as_ref())?;
        Ok((strength, index, tint))
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
        let texture = self.info(source.emissive_texture.as_ref(), true)?;
        let Some(texture) = texture else {
            let radiance = Emission::from_rgb(factor.map(|v| f64::from(v) * nit));
            return Ok(Some(AreaEmission {
                radiance,
                pattern: None,
                two_sided,
            }));
        };
        let pattern = SpectrumTexture::Image {
            texture,
            factor: factor.map(|v| v / largest),
        };
        Ok((pattern.mean() > 0.0).then(|| AreaEmission {
            radiance: Emission::from_rgb([f64::from(largest) * nit; 3]),
            pattern: Some(pattern),
            two_sided,
        }))
    }
}

/// The index of a layer whose reflectance at normal incidence is that of `index`, times `strength`
/// where that is above 1 or the index is infinite (KHR_materials_specular: no more than 1), and the
/// factor that is left for its tint.
fn layer(index: f64, strength: f64) -> (f64, f64) {
    if index.is_finite() && strength <= 1.0 || strength <= 0.0 {
        return (if index.is_finite() { index } else { 1.5 }, 1.0);
    }
    let root = if index.is_finite() {
        (index - 1.0) / (index + 1.0)
    } else {
        1.0
    };
    let reflectance = (root * root * strength).min(1.0);
    if reflectance > MIRROR {
        return (f64::INFINITY, reflectance / strength);
    }
    let root = reflectance.sqrt();
    ((1.0 + root) / (1.0 - root), 1.0 / strength)
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
    fn layers_reflect_what_the_file_says() {
        let normal = |n: f64| ((n - 1.0) / (n + 1.0)).powi(2);
        assert_eq!(layer(1.5, 0.5), (1.5, 1.0));
        let (n, scale) = layer(1.5, 4.0);
        assert!((normal(n) - 0.16).abs() < 1e-12 && scale == 0.25);
        let (n, scale) = layer(f64::INFINITY, 0.5);
        assert!((normal(n) - 0.5).abs() < 1e-12 && scale == 2.0);
        assert_eq!(layer(f64::INFINITY, 1.0), (f64::INFINITY, 1.0));
        assert_eq!(layer(1.5, 100.0), (f64::INFINITY, 0.01));
        assert_eq!(layer(f64::INFINITY, 0.0), (1.5, 1.0));
    }

    #[test]
    fn coordinates_run_downward_in_the_file() {
        let map = coordinate_map(None).expect("valid");
        assert_eq!(map.transform_point2(DVec2::ZERO), DVec2::new(0.0, 1.0));
        assert_eq!(map.transform_point2(DVec2::ONE), DVec2::new(1.0, 0.0));
    }
}
