//! Scattering at a surface point, in units of basic radiance (L/η²): one symmetric kernel, no
//! transport mode.
//!
//! Directions are unit vectors in the local shading frame (z = shading normal), pointing away from
//! the surface. ω⁻ points towards the light side of the path, ω⁺ towards the camera side. `g = f /
//! η₊²` is symmetric.

pub mod albedo;
pub mod coating;
pub mod fresnel;
pub mod interface;
pub mod lobe;
pub mod microfacet;
pub mod multiscatter;

pub use coating::CoatingLanes;
pub use interface::Interface;
pub use lobe::Lobe;

use crate::spectrum::{MAX_LANES, SampledSpectrum};
use glam::DVec3;
use lobe::dielectric::Dielectric;

/// Kind of scattering at an interior vertex of a path. A path is a list of vertices *and* labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Label {
    /// Any non-specular scattering (diffuse, glossy, rough transmission).
    NonSpecular,
    /// Exact mirror reflection.
    SpecularReflect,
    /// Exact refraction, or straight passage through a thin sheet.
    SpecularTransmit,
}

impl Label {
    /// Whether the label is one of the two specular ones.
    #[must_use]
    pub fn is_specular(self) -> bool {
        self != Self::NonSpecular
    }
}

/// Which end of the path a sampled direction leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// ω⁻ is generated (camera sub-paths).
    Light,
    /// ω⁺ is generated (light sub-paths).
    Camera,
}

/// `|cos|` of `w` when both directions are strictly on the same side of the surface.
fn cosine_on_side(w: DVec3, other: DVec3) -> Option<f64> {
    (w.z * other.z > 0.0).then_some(w.z.abs())
}

/// A density that may depend on the lane (rough dispersive transmission only; then it is per-lane).
///
/// For everything else all lanes have the hero's density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneDensity {
    /// The density of each lane; \[0\] is the hero's. Lanes not in use are never read.
    pub lanes: [f64; MAX_LANES],
}

impl LaneDensity {
    fn add(&mut self, f: impl Fn(usize) -> f64) {
        for (k, lane) in self.lanes.iter_mut().enumerate() {
            *lane += f(k);
        }
    }
}

/// Value and densities of the non-specular label for one pair of directions.
#[derive(Clone, Copy, Debug)]
pub struct BsdfEval {
    /// `g = f / η₊²`, per lane.
    pub g: SampledSpectrum,
    /// Hero's solid-angle density of generating ω⁺ given ω⁻ (the D→ of a light walk), label
    /// probability included.
    pub pdf_camera: f64,
    /// Hero's solid-angle density of generating ω⁻ given ω⁺ (the D← of a camera walk), label
    /// probability included.
    pub pdf_light: f64,
    /// Per-lane versions of (`pdf_camera`, `pdf_light`) where they differ from the hero's.
    pub columns: Option<(LaneDensity, LaneDensity)>,
}

impl BsdfEval {
    /// Nothing scattered, never sampled.
    pub const BLACK: Self = Self {
        g: SampledSpectrum::ZERO,
        pdf_camera: 0.0,
        pdf_light: 0.0,
        columns: None,
    };
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// The direction, local frame.
    pub w: DVec3,
    /// The label drawn.
    pub label: Label,
    /// Throughput factor in basic units, per lane: `g η² |cos θ| / pdf` for the non-specular label
    /// (cos and η² of the generated side, hero's pdf), `R/q` or `T/q` for a specular one. A
    /// dispersive transmission leaves only the hero and lanes of exactly its wavelength alive (the
    /// caller does that, from `dispersive`).
    pub weight: SampledSpectrum,
    /// Density of the generated direction: per solid angle for the non-specular label, the label's
    /// probability `q` for a specular one (its delta is left out).
    pub pdf: f64,
    /// The same with the roles of the two directions exchanged.
    pub pdf_reverse: f64,
    /// A specular transmission whose direction depends on the wavelength.
    pub dispersive: bool,
    /// Per-lane versions of (`pdf`, `pdf_reverse`) where they differ from the hero's.
    pub columns: Option<(LaneDensity, LaneDensity)>,
}

/// A mixture of weighted lobes between two media. Weights are at most 1 in sum; what is missing is
/// absorbed.
///
/// All lobes of a label act as one: whichever of them generated the direction, value, density and
/// label probability are sums over all, so they depend on the directions and the label alone.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<'a> {
    /// (weight, lobe); the selection probability of a lobe is its weight over the sum. None: black.
    pub lobes: &'a [(f32, Lobe)],
    /// Refractive indices of the two sides.
    pub interface: Interface<'a>,
}

impl Bsdf<'_> {
    /// Whether there is any non-specular lobe: the vertex can be connected.
    #[must_use]
    pub fn has_non_specular(&self) -> bool {
        self.lobes.iter().any(|(_, lobe)| !lobe.is_specular())
    }

    /// Whether there is any specular lobe.
    #[must_use]
    pub fn has_specular(&self) -> bool {
        self.lobes.iter().any(|(_, lobe)| lobe.is_specular())
    }

    /// Sum of the lobes' weights.
    fn total_weight(&self) -> f64 {
        self.lobes
            .iter()
            .map(|&(weight, _)| f64::from(weight))
            .sum()
    }

    /// Probability that scattering from direction `w` (of either side) draws `label`: Σ sel_i
    /// q_i(label). A function of the vertex, the direction and the set of lanes, not of which lane
    /// is the hero.
    #[must_use]
    pub fn label_probability(&self, label: Label, w: DVec3) -> f64 {
        let (cos, above) = (w.z.abs(), w.z > 0.0);
        let mut sum = 0.0;
        for (weight, lobe) in self.lobes {
            sum += f64::from(*weight) * lobe.label_probability(label, cos, above, &self.interface);
        }
        if sum > 0.0 {
            sum / self.total_weight()
        } else {
            0.0
        }
    }

    /// Reflectance ([`Label::SpecularReflect`]) or transmittance ([`Label::SpecularTransmit`]) per
    /// lane, weights and tints included, of the specular lobes for light at cosine `cos` in [0, 1]
    /// on the side `above` the normal (or below). 0 for the non-specular label.
    #[must_use]
    pub fn specular(&self, label: Label, cos: f64, above: bool) -> SampledSpectrum {
        let mut sum = SampledSpectrum::ZERO;
        for (weight, lobe) in self.lobes {
            sum += lobe.specular(label, cos, above, &self.interface) * *weight;
        }
        sum
    }

    /// The non-specular label for given directions. Both densities come with the value: they cannot
    /// disagree.
    #[must_use]
    #[inline]
    pub fn eval(&self, w_light: DVec3, w_camera: DVec3) -> BsdfEval {
        match self.lobes {
            [(weight, Lobe::Diffuse(lobe))] => {
                let mut eval = lobe.eval(w_light, w_camera, &self.interface);
                eval.g *= *weight;
                eval
            }
            _ => self.eval_mixture(w_light, w_camera),
        }
    }

    fn eval_mixture(&self, w_light: DVec3, w_camera: DVec3) -> BsdfEval {
        if let [(weight, lobe)] = self.lobes {
            // no sums to keep
            let mut eval = lobe.eval(w_light, w_camera, &self.interface);
            eval.g *= *weight;
            return eval;
        }
        let mut sum = BsdfEval::BLACK;
        let scale = 1.0 / self.total_weight();
        for (weight, lobe) in self.lobes {
            let eval = lobe.eval(w_light, w_camera, &self.interface);
            let selection = f64::from(*weight) * scale;
            sum.g += eval.g * *weight;
            if let Some((camera, light)) = eval.columns {
                // what other lobes gave so far is the same in all lanes
                let columns = sum.columns.get_or_insert((
                    LaneDensity {
                        lanes: [sum.pdf_camera; MAX_LANES],
                    },
                    LaneDensity {
                        lanes: [sum.pdf_light; MAX_LANES],
                    },
                ));
                columns.0.add(|k| camera.lanes[k] * selection);
                columns.1.add(|k| light.lanes[k] * selection);
            } else if let Some(columns) = &mut sum.columns {
                columns.0.add(|_| eval.pdf_camera * selection);
                columns.1.add(|_| eval.pdf_light * selection);
            }
            sum.pdf_camera += eval.pdf_camera * selection;
            sum.pdf_light += eval.pdf_light * selection;
        }
        sum
    }

    /// Generates the direction of side `generate` from the `given` one. `u`: label/lobe choice,
    /// then two for the direction. `None` when the sample fails (GGX below the surface, nothing to
    /// scatter).
    #[must_use]
    #[inline]
    pub fn sample(&self, given: DVec3, generate: Side, u: [f64; 3]) -> Option<BsdfSample> {
        self.sample_clear(given, DVec3::Z, u[0])
            .unwrap_or_else(|| self.sample_lobes(given, generate, u))
    }

    /// The same where [`Bsdf::sample_clear`] gives nothing to take.
    #[inline(always)]
    pub(crate) fn sample_lobes(
        &self,
        given: DVec3,
        generate: Side,
        u: [f64; 3],
    ) -> Option<BsdfSample> {
        match self.lobes {
            [(weight, Lobe::Diffuse(lobe))] => lobe.sample(given.z, [u[1], u[2]]).map(|sample| {
                let weight = sample.weight * *weight;
                BsdfSample { weight, ..sample }
            }),
            _ => self.sample_mixture(given, generate, u),
        }
    }

    #[inline(never)]
    fn sample_mixture(&self, given: DVec3, generate: Side, u: [f64; 3]) -> Option<BsdfSample> {
        let (lobe, rest) = self.choose_lobe(u[0])?;
        let above = given.z > 0.0;
        let cos = given.z.abs();
        if let [(weight, Lobe::Dielectric(lobe))] = self.lobes {
            return self.sample_interface(lobe, *weight, (given, DVec3::Z), rest);
        }
        if lobe.is_specular() {
            let q = lobe.label_probability(Label::SpecularReflect, cos, above, &self.interface);
            let label = if rest < q {
                Label::SpecularReflect
            } else {
                Label::SpecularTransmit
            };
            return self.sample_specular(lobe, label, given);
        }
        // the lobes generate for a given direction above the surface
        let up = if above {
            given
        } else {
            DVec3::new(given.x, given.y, -given.z)
        };
        let w = lobe.generate(up, above, [rest, u[1], u[2]], &self.interface)?;
        let w = if above { w } else { DVec3::new(w.x, w.y, -w.z) };
        self.sample_non_specular(given, w, generate)
    }

    /// The direction of a specular label that is taken whatever its probability: density 1 from
    /// both sides, with the reflectance or transmittance as weight. `None` where there is no such
    /// direction, or no light goes there.
    #[must_use]
    pub fn sample_label(&self, given: DVec3, label: Label) -> Option<BsdfSample> {
        let (cos, above) = (given.z.abs(), given.z > 0.0);
        let has = |lobe: &&Lobe| {
            lobe.is_specular() && lobe.label_probability(label, cos, above, &self.interface) > 0.0
        };
        let lobe = self.lobes.iter().map(|(_, lobe)| lobe).find(has)?;
        let sample = self.sample_specular(lobe, label, given)?;
        Some(BsdfSample {
            weight: self.specular(label, cos, above),
            pdf: 1.0,
            pdf_reverse: 1.0,
            ..sample
        })
    }

    /// The lobe that `u` falls on, and `u` stretched over it again, below 1.
    fn choose_lobe(&self, u: f64) -> Option<(&Lobe, f64)> {
        let mut rest = u * self.total_weight();
        let mut chosen = None;
        for (weight, lobe) in self.lobes {
            let weight = f64::from(*weight);
            if weight <= 0.0 {
                continue;
            }
            if rest < weight {
                return Some((lobe, (rest / weight).min(1.0 - f64::EPSILON)));
            }
            // rounding may leave a little beyond the last lobe
            chosen = Some((lobe, 1.0 - f64::EPSILON));
            rest -= weight;
        }
        chosen
    }

    /// The same in any frame where a clear smooth interface of this `normal` is alone; `None` where
    /// it is not.
    #[inline]
    pub fn sample_clear(&self, given: DVec3, normal: DVec3, u: f64) -> Option<Option<BsdfSample>> {
        let [(1.0, Lobe::Dielectric(lobe))] = self.lobes else {
            return None;
        };
        let u = u.min(1.0 - f64::EPSILON);
        Some(self.sample_interface(lobe, 1.0, (given, normal), u))
    }

    /// A direction of a smooth interface that is alone, in the frame of its normal: it is asked
    /// once for choice, density and weight.
    fn sample_interface(
        &self,
        lobe: &Dielectric,
        weight: f32,
        (given, normal): (DVec3, DVec3),
        u: f64,
    ) -> Option<BsdfSample> {
        let height = given.dot(normal);
        let above = height > 0.0;
        let responses = self.interface.responses(height.abs(), above);
        let reflected = self.interface.reflected_share(&responses);
        let (label, pdf, tint) = if u < reflected {
            (Label::SpecularReflect, reflected, lobe.reflect_tint)
        } else {
            (Label::SpecularTransmit, 1.0 - reflected, lobe.transmit_tint)
        };
        let transmits = label == Label::SpecularTransmit;
        let w = if transmits {
            let (near, far) = self.interface.sides(above);
            let normal = if above { normal } else { -normal };
            fresnel::refract(given, normal, near[0], far[0])?
        } else {
            normal * (2.0 * height) - given
        };
        let behind = w.dot(normal);
        if behind == 0.0 {
            return None;
        }
        let shares = self
            .interface
            .lanes(|k| responses[k][usize::from(transmits)]);
        let pdf_reverse = if !transmits || self.interface.is_reciprocal() {
            pdf
        } else {
            self.label_probability(label, DVec3::Z * behind)
        };
        Some(BsdfSample {
            w,
            label,
            weight: shares * tint * weight * (1.0 / pdf) as f32,
            pdf,
            pdf_reverse,
            dispersive: transmits && self.interface.dispersive,
            columns: None,
        })
    }

    /// The other direction of a specular label. `None` at total reflection, and along the surface.
    fn specular_direction(&self, given: DVec3, transmits: bool, refracts: bool) -> Option<DVec3> {
        let above = given.z > 0.0;
        let w = if refracts {
            let (near, far) = self.interface.sides(above);
            let normal = if above { DVec3::Z } else { -DVec3::Z };
            fresnel::refract(given, normal, near[0], far[0])?
        } else if transmits {
            -given
        } else {
            DVec3::new(-given.x, -given.y, given.z)
        };
        (w.z != 0.0).then_some(w)
    }

    fn sample_specular(&self, lobe: &Lobe, label: Label, given: DVec3) -> Option<BsdfSample> {
        let above = given.z > 0.0;
        let transmits = label == Label::SpecularTransmit;
        let refracts = transmits && matches!(lobe, Lobe::Dielectric(_));
        let w = self.specular_direction(given, transmits, refracts)?;
        let pdf = self.label_probability(label, given);
        Some(BsdfSample {
            w,
            label,
            weight: self.specular(label, given.z.abs(), above) * (1.0 / pdf) as f32,
            pdf,
            pdf_reverse: self.label_probability(label, w),
            dispersive: refracts && self.interface.dispersive,
            columns: None,
        })
    }

    fn sample_non_specular(&self, given: DVec3, w: DVec3, generate: Side) -> Option<BsdfSample> {
        let (pdf, pdf_reverse, columns, g) = match generate {
            Side::Camera => {
                let e = self.eval(given, w);
                (e.pdf_camera, e.pdf_light, e.columns, e.g)
            }
            Side::Light => {
                let e = self.eval(w, given);
                (
                    e.pdf_light,
                    e.pdf_camera,
                    e.columns.map(|(camera, light)| (light, camera)),
                    e.g,
                )
            }
        };
        if pdf <= 0.0 || !pdf.is_finite() {
            return None;
        }
        let eta = self.interface.near(w.z > 0.0);
        let projected = w.z.abs() / pdf;
        let weight = self
            .interface
            .lanes(|k| f64::from(g[k]) * eta[k] * eta[k] * projected);
        Some(BsdfSample {
            w,
            label: Label::NonSpecular,
            weight,
            pdf,
            pdf_reverse,
            dispersive: false,
            columns,
        })
    }

    /// Colour for the preview AOV: the share scattered at normal incidence from above, transmission
    /// included (clear glass is white), per lane.
    #[must_use]
    pub fn albedo(&self) -> SampledSpectrum {
        let mut sum = SampledSpectrum::ZERO;
        for (weight, lobe) in self.lobes {
            sum += lobe.albedo(&self.interface) * *weight;
        }
        sum
    }
}

#[cfg(test)]
mod tests;
