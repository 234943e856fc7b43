//! Materials of MTL files as mixtures of the lobes there are.

use super::statements::RawMaterial;
use super::{Reader, Source};
use crate::bsdf::lobe::coated::Coat;
use crate::material::{Coverage, LobeSpec, Material, NormalMap};
use crate::scene::description::AreaEmission;
use crate::spectrum::{Curve, Emission, Ior, upsample};
use crate::texture::{ScalarTexture, SpectrumTexture};

/// Index where a file says none.
const GLASS: f64 = 1.5;

/// A material's parts.
#[derive(Default)]
pub struct Converted {
    pub material: Material,
    pub emission: Option<AreaEmission>,
    /// Index of the glass that fills a closed mesh.
    pub interior: Option<f64>,
}

/// GGX alpha in both directions.
fn roughness(m: &RawMaterial) -> f64 {
    match (m.roughness, m.shininess) {
        (Some(pr), _) => pr.powi(2),
        (None, Some(ns)) => (2.0 / (ns + 2.0)).sqrt(),
        (None, None) => 0.5,
    }
}

impl Reader<'_> {
    /// The material for a mesh that is `closed` or not.
    pub fn material(&mut self, (m, file): &Source, closed: bool) -> Converted {
        let name = &m.name;
        let color = m.diffuse.unwrap_or([0.7; 3]).map(|v| v as f32);
        let base = match self.texture(m.diffuse_map.as_ref(), file, true) {
            // many files leave Kd black or gray beside a texture; a black one would hide it
            Some(texture) => SpectrumTexture::Image {
                texture,
                factor: if color == [0.0; 3] { [1.0; 3] } else { color },
            },
            None => upsample::reflectance(color.map(f64::from)).into(),
        };
        let alpha: [ScalarTexture; 2] = [roughness(m).into(), roughness(m).into()];
        let metal = m.metal.unwrap_or(0.0);
        let cover = m.dissolve.unwrap_or(1.0 - m.transparency.unwrap_or(0.0));
        let glass = matches!(
            (m.illumination, cover < 0.5),
            (Some(6 | 7), _) | (Some(4 | 9), true)
        );
        let highlight = !matches!(m.illumination, Some(0 | 1 | 10))
            && m.specular.is_some_and(|s| s.iter().any(|v| *v > 0.0));
        let shiny = highlight || m.roughness.is_some();
        let index = match &m.index {
            Some(ni) if ni.value >= 1.0 && (glass || ni.value > 1.0) => ni.value,
            Some(ni) if glass || shiny && metal < 1.0 => {
                self.note(format!(
                    "{file}:{}: material \"{name}\": Ni {} is taken as {GLASS} (allowed: {})",
                    ni.line,
                    ni.value,
                    if glass { "1 to 10" } else { "above 1, to 10" }
                ));
                GLASS
            }
            _ => GLASS,
        };
        let mut converted = Converted::default();
        let lobes = &mut converted.material.lobes;
        let white = || Curve::Constant(1.0).into();
        if glass && closed {
            converted.interior = Some(index);
            let alpha = match m.roughness {
                Some(_) => alpha,
                None => [0.0.into(), 0.0.into()],
            };
            let lobe = LobeSpec::Dielectric {
                alpha,
                reflect_tint: white(),
                transmit_tint: white(),
            };
            lobes.push((1.0.into(), lobe));
        } else if glass {
            let lobe = LobeSpec::Thin {
                ior: Ior::constant(index),
                transmit_tint: white(),
            };
            lobes.push((1.0.into(), lobe));
        } else {
            let opaque = ScalarTexture::Constant(1.0 - metal);
            if metal < 1.0 && shiny {
                let coat = LobeSpec::CoatedDiffuse {
                    reflectance: base.clone(),
                    coat: Coat::new(index, 1.0),
                    strength: 1.0.into(),
                    alpha: alpha.clone(),
                };
                lobes.push((opaque.clone(), coat));
                let layer = LobeSpec::Coat {
                    index,
                    alpha: alpha.clone(),
                    tint: white(),
                };
                lobes.push((opaque, layer));
            } else if metal < 1.0 {
                let reflectance = base.clone();
                lobes.push((opaque, LobeSpec::Diffuse { reflectance }));
            }
            if metal > 0.0 {
                lobes.push((metal.into(), LobeSpec::ColoredMetal { color: base, alpha }));
            }
        }
        if let Some(rgb) = m.emission.filter(|rgb| *rgb != [0.0; 3]) {
            converted.emission = Some(AreaEmission {
                // the file's numbers in single precision
                radiance: Emission::from_rgb(rgb.map(|v| f64::from(v as f32))),
                pattern: None,
                two_sided: true,
            });
        }
        let normal = self.texture(m.normal_map.as_ref(), file, false);
        converted.material.normal = normal.map(|texture| NormalMap {
            texture,
            scale: 1.0,
        });
        let mask = self.texture(m.dissolve_map.as_ref(), file, false);
        if !glass && converted.emission.is_none() && (cover < 1.0 || mask.is_some()) {
            let alpha = match mask {
                None => cover.into(),
                Some(texture) => ScalarTexture::Image {
                    texture,
                    channel: 0,
                },
            };
            converted.material.coverage = Some(Coverage {
                alpha,
                cutoff: None,
            });
        }
        converted
    }
}
