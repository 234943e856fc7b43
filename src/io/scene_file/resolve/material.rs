//! Materials and their textures.

use super::super::plan::{
    LobePlan, MaterialPlan, ScalarPlan, SpectrumPlan, SpectrumSource, TexturePlan,
};
use super::Resolver;
use crate::bsdf::coated::Coat;
use crate::io::image_file::{self, Encoding};
use crate::material::{Coverage, LobeSpec, Material, NormalMap};
use crate::spectrum::Curve;
use crate::texture::{Filter, Image, ImageTexture, ScalarTexture, SpectrumTexture};
use std::ops::Range;
use std::sync::Arc;

impl Resolver<'_> {
    pub(super) fn material(&mut self, plan: &MaterialPlan) -> Material {
        let mut material = Material::default();
        for (weight, lobe) in &plan.lobes {
            let weight = self.scalar(weight);
            let lobe = self.lobe(lobe);
            if let LobeSpec::CoatedDiffuse { coat, .. } = &lobe.0 {
                let layer = LobeSpec::Coat {
                    index: coat.index,
                    alpha: lobe.1,
                    tint: Curve::Constant(1.0).into(),
                };
                material.lobes.push((weight.clone(), layer));
            }
            material.lobes.push((weight, lobe.0));
        }
        if let Some((texture, scale)) = &plan.normal {
            material.normal = self.texture(texture).map(|texture| NormalMap {
                texture,
                scale: *scale,
            });
        }
        if let Some((alpha, cutoff)) = &plan.coverage {
            material.coverage = Some(Coverage {
                alpha: self.scalar(alpha),
                cutoff: *cutoff,
            });
        }
        material
    }

    /// The image of a file, decoded once for each encoding.
    pub(super) fn image(&mut self, plan: &TexturePlan) -> Option<Arc<Image>> {
        let pyramid = matches!(plan.filter, Filter::Mipmap { .. });
        let key = (plan.path.clone(), plan.srgb, pyramid);
        if let Some(image) = self.images.get(&key) {
            return image.clone();
        }
        let encoding = if plan.srgb {
            Encoding::Stated
        } else {
            Encoding::Linear
        };
        let read = std::fs::read(&plan.path)
            .map_err(|e| e.to_string())
            .and_then(|bytes| image_file::decode(&bytes, encoding));
        let image = match read {
            Ok(decoded) => {
                let notes = decoded.notes.into_iter();
                self.notes
                    .extend(notes.map(|n| format!("{}: {n}", plan.name)));
                let image = decoded.image;
                Some(Arc::new(if pyramid { image.with_pyramid() } else { image }))
            }
            Err(message) => {
                self.bad_file(&plan.at, &plan.name, message);
                None
            }
        };
        self.images.insert(key, image.clone());
        image
    }

    pub(super) fn texture(&mut self, plan: &TexturePlan) -> Option<ImageTexture> {
        Some(ImageTexture {
            image: self.image(plan)?,
            map: plan.map,
            wrap: [plan.wrap; 2],
            filter: plan.filter,
        })
    }

    /// Holds the texels that stand for a key to its limit of 1.
    fn hold(&mut self, plan: &TexturePlan, image: &Image, factor: f64, channels: Range<usize>) {
        // a rounding above 1 is no fault of the file
        let limit = (1.0 + 1e-6) / factor.max(f64::MIN_POSITIVE);
        if let Some((count, [column, row])) = image.above(limit as f32, channels) {
            let texels = if count == 1 { "texel is" } else { "texels are" };
            let message = format!(
                "{count} {texels} above 1 after the factor {factor} (allowed: 0 to 1), the first at column {column}, row {row}"
            );
            self.bad_file(&plan.at, &plan.name, message);
        }
    }

    pub(super) fn scalar(&mut self, plan: &ScalarPlan) -> ScalarTexture {
        match plan {
            ScalarPlan::Constant(value) => (*value).into(),
            ScalarPlan::Image {
                texture,
                channel,
                factor,
            } => match self.texture(texture) {
                None => (*factor).into(),
                Some(read) => {
                    self.hold(texture, &read.image, *factor, *channel..*channel + 1);
                    ScalarTexture::Image {
                        texture: read,
                        channel: *channel,
                    }
                    .times(*factor)
                }
            },
        }
    }

    /// A spectrum of a surface that may not exceed 1.
    fn surface(&mut self, plan: &SpectrumPlan) -> SpectrumTexture {
        let SpectrumSource::Texture(texture) = &plan.source else {
            return self.reflectance(plan).into();
        };
        match self.texture(texture) {
            None => Curve::Constant(0.0).into(),
            Some(read) => {
                self.hold(texture, &read.image, plan.scale, 0..3);
                SpectrumTexture::Image {
                    texture: read,
                    factor: [plan.scale as f32; 3],
                }
            }
        }
    }

    /// A lobe; the roughness of a coat belongs to the layer, which the caller makes.
    fn lobe(&mut self, plan: &LobePlan) -> (LobeSpec, [ScalarTexture; 2]) {
        let mut layer = [0.0.into(), 0.0.into()];
        let lobe = match plan {
            LobePlan::Diffuse { reflectance } => LobeSpec::Diffuse {
                reflectance: self.surface(reflectance),
            },
            LobePlan::Mirror { reflectance } => LobeSpec::Mirror {
                reflectance: self.surface(reflectance),
            },
            LobePlan::Conductor { ior, alpha, tint } => LobeSpec::Conductor {
                ior: self.ior(ior, true),
                alpha: self.alpha(alpha),
                tint: self.surface(tint),
            },
            LobePlan::ColoredMetal { color, alpha } => LobeSpec::ColoredMetal {
                color: self.surface(color),
                alpha: self.alpha(alpha),
            },
            LobePlan::Coated {
                reflectance,
                index,
                alpha,
            } => {
                layer = self.alpha(alpha);
                LobeSpec::CoatedDiffuse {
                    reflectance: self.surface(reflectance),
                    coat: Coat::new(*index, 1.0),
                    strength: 1.0.into(),
                }
            }
            LobePlan::Dielectric {
                alpha,
                reflect_tint,
                transmit_tint,
            } => LobeSpec::Dielectric {
                alpha: self.alpha(alpha),
                reflect_tint: self.surface(reflect_tint),
                transmit_tint: self.surface(transmit_tint),
            },
            LobePlan::Thin { ior, transmit_tint } => LobeSpec::Thin {
                ior: self.ior(ior, false),
                transmit_tint: self.surface(transmit_tint),
            },
        };
        (lobe, layer)
    }

    fn alpha(&mut self, plan: &[ScalarPlan; 2]) -> [ScalarTexture; 2] {
        [self.scalar(&plan[0]), self.scalar(&plan[1])]
    }
}
