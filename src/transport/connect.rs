//! Joining sub-paths: every strategy's contribution and weight, computed together.
//!
//! [`at_light`] and [`at_sensor`] hold the strategies that end there (s or t <= 1); here is what all share, and the inner pairs.
//!
//! The order of work is from cheap to dear: kernels, weight, roulette on the weighted value, and only then the shadow ray.

mod at_light;
mod at_photon;
mod at_sensor;

pub use at_photon::Photons;

use super::class::PathClass;
use super::context::{Counters, PathContext};
use super::contribution::{Contribution, Target};
use super::density::{Edge, EdgeDensity, PathView, VertexDensity};
use super::mis::{Multipliers, Technique, delivers_to_all, denominator};
use super::subpath::{Subpath, Vertex};
use super::techniques::Techniques;
use crate::bsdf::{BsdfEval, Label, LaneDensity};
use crate::geometry::{EndPoint, Ray};
use crate::light::{HitMeasure, Light, LightId};
use crate::medium::Region;
use crate::sampler::StreamSampler;
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use glam::DVec3;

/// Joins the two sub-paths of one sample and collects what they give.
#[derive(Debug)]
pub struct Joiner<'a> {
    /// What the path pair shares.
    pub context: &'a PathContext<'a>,
    /// Which strategies are executed.
    pub techniques: &'a Techniques<'a>,
    /// At most this many scattering vertices on a path.
    pub max_depth: usize,
    /// Neither lights without extent nor this camera have an image of each other in mirrors: paths of specular vertices alone
    /// between them are left out.
    pub hide_points: bool,
    /// Also compute the raw (unweighted) value of each contribution.
    pub with_raw: bool,
    /// Each photon that is merged gives a contribution of its own; else one camera vertex gives one.
    pub detailed: bool,
    /// Numbers for connections.
    pub numbers: StreamSampler,
    /// Counts.
    pub counters: &'a mut Counters,
    /// Contributions found.
    pub out: &'a mut Vec<Contribution>,
    /// Buffers.
    pub scratch: &'a mut Scratch,
}

/// Buffers that joining reuses from sample to sample.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Densities of a light sub-path with its arrival at the detector.
    arrival: Vec<VertexDensity>,
    /// Products of densities over the end of a path.
    suffix: Vec<f64>,
}

/// The two directional densities of an evaluated vertex.
fn densities(eval: &BsdfEval) -> (EdgeDensity, EdgeDensity) {
    let lanes = |l: &LaneDensity| l.lanes;
    (
        EdgeDensity {
            hero: eval.pdf_camera,
            lanes: eval.columns.as_ref().map(|c| lanes(&c.0)),
        },
        EdgeDensity {
            hero: eval.pdf_light,
            lanes: eval.columns.as_ref().map(|c| lanes(&c.1)),
        },
    )
}

/// What turns a density of direction at x₁ (towards the light, at `distance`) into a density of x₀.
#[must_use]
pub fn light_end_factor(light: &Light, x0: &EndPoint, toward: DVec3, distance: f64) -> f64 {
    match light.hit_measure() {
        HitMeasure::Area => x0.cos(toward) / (distance * distance),
        HitMeasure::SolidAngle => 1.0,
        HitMeasure::Never => 0.0,
    }
}

/// The labels an end of the joining edge can have, at most one of each kind.
#[derive(Clone, Copy, Debug)]
enum EndKind {
    NonSpecular,
    Specular,
}

impl EndKind {
    const ALL: [Self; 2] = [Self::NonSpecular, Self::Specular];
}

/// How an end of the joining edge scatters under one label.
struct EndKernel {
    label: Label,
    dispersive: bool,
    /// `g`; `A g` of a specular label.
    kernel: SampledSpectrum,
    /// Density of ω⁺ given ω⁻; the label's probability of a specular one.
    forward: EdgeDensity,
    /// Density of ω⁻ given ω⁺.
    backward: EdgeDensity,
}

/// A numerator, still without its weight: what all lanes share and each lane's factor.
struct Numerator {
    scale: f64,
    lanes: SampledSpectrum,
}

/// Who made a path, and what it needs to be counted.
struct Strategy<'p> {
    view: PathView<'p>,
    target: Target,
}

impl<'a> Joiner<'a> {
    /// Whether strategy (s, t) is executed and allowed by the depth limit.
    fn wants(&self, s: usize, t: usize) -> bool {
        s + t <= self.max_depth.saturating_add(2) && self.techniques.samples(s, t, false) > 0.0
    }

    /// Whether a joining edge may end at the vertex.
    fn is_connectible(&self, vertex: &Vertex) -> bool {
        vertex.has_non_specular || self.is_regularized(vertex)
    }

    /// Whether a joining edge may end at the vertex under a specular label.
    fn is_regularized(&self, vertex: &Vertex) -> bool {
        self.techniques.cone.is_some() && vertex.has_specular
    }

    /// How a vertex scatters between ω⁻ and ω⁺ under its non-specular label.
    fn non_specular_end(
        &self,
        path: &Subpath,
        i: usize,
        w_light: DVec3,
        w_camera: DVec3,
    ) -> Option<EndKernel> {
        if !path.vertices[i].has_non_specular {
            return None;
        }
        let eval = path.scatterer(i, self.context).eval(w_light, w_camera);
        if eval.g.is_black(self.context.count()) {
            return None;
        }
        let (forward, backward) = densities(&eval);
        Some(EndKernel {
            label: Label::NonSpecular,
            dispersive: false,
            kernel: eval.g,
            forward,
            backward,
        })
    }

    /// The same under the specular label of the two directions' sides, within the cone.
    fn specular_end(
        &self,
        path: &Subpath,
        i: usize,
        w_light: DVec3,
        w_camera: DVec3,
    ) -> Option<EndKernel> {
        let cone = self.techniques.cone.as_ref()?;
        if !path.vertices[i].has_specular {
            return None;
        }
        let scatterer = path.scatterer(i, self.context);
        let (found, probabilities) = scatterer.specular(w_light, w_camera, cone)?;
        let [forward, backward] = probabilities.map(EdgeDensity::uniform);
        Some(EndKernel {
            label: found.label,
            dispersive: found.dispersive,
            kernel: found.kernel,
            forward,
            backward,
        })
    }

    /// How a vertex scatters between ω⁻ and ω⁺ under its label of a kind.
    fn end(
        &self,
        kind: EndKind,
        path: &Subpath,
        i: usize,
        w_light: DVec3,
        w_camera: DVec3,
    ) -> Option<EndKernel> {
        match kind {
            EndKind::NonSpecular => self.non_specular_end(path, i, w_light, w_camera),
            EndKind::Specular => self.specular_end(path, i, w_light, w_camera),
        }
    }

    fn light(&self, id: LightId) -> &'a Light {
        &self.context.scene.lights[id.0 as usize]
    }

    /// η² T_L T_C ... : a numerator from two throughputs and the kernels between them.
    fn numerator(parts: &[&SampledSpectrum], scale: f64) -> Numerator {
        let mut lanes = SampledSpectrum::ONE;
        for part in parts {
            lanes *= **part;
        }
        Numerator { scale, lanes }
    }

    /// Weighs, plays roulette, looks, and notes the contribution.
    fn finish(
        &mut self,
        numerator: &Numerator,
        strategy: &Strategy,
        segment: Option<(&Ray, &Region)>,
    ) {
        let view = &strategy.view;
        if self.hide_points && !view.hittable_light && PathClass::of(view).is_all_specular() {
            return;
        }
        #[cfg(test)]
        super::record::record(view, self.techniques, segment.map(|(ray, _)| ray));
        let count = self.context.count();
        let multipliers = Multipliers::new(view, self.techniques);
        let weights = denominator(
            &multipliers,
            self.context.wavelengths(),
            &mut self.scratch.suffix,
        );
        if weights.numerator == 0.0 && !self.with_raw {
            return;
        }
        let mut lanes = [0.0; MAX_LANES];
        for (j, lane) in lanes.iter_mut().enumerate().take(count) {
            let value = numerator.scale * f64::from(numerator.lanes[j]);
            if value != 0.0 {
                *lane = value * weights.factor(j);
            }
        }
        if !lanes.iter().all(|v| v.is_finite()) {
            self.counters.non_finite += 1;
            return;
        }
        let mut survival = 1.0;
        if let Some((ray, region)) = segment {
            let threshold = self.context.pass.roulette_threshold;
            if threshold > 0.0 {
                let brightness = self.context.response.brightness(&lanes);
                if brightness < threshold {
                    survival = brightness / threshold;
                    if self.numbers.next4()[0] >= survival {
                        return;
                    }
                }
            }
            let visibility = self.context.visibility(ray, region, self.counters);
            if visibility == 0.0 {
                return;
            }
            survival /= visibility;
        }
        self.counters.connections_made += 1;
        let s = view.s();
        let mut raw = [0.0; MAX_LANES];
        if self.with_raw {
            let alone = multipliers.plain(s);
            let shared = delivers_to_all(view, view.dispersive_count(), Technique::Join(s));
            for (j, value) in raw.iter_mut().enumerate().take(count) {
                let techniques = if shared {
                    count
                } else {
                    self.context.wavelengths().multiplicity(j)
                };
                let lane = numerator.scale * f64::from(numerator.lanes[j]);
                *value = lane / (alone * techniques as f64 * survival);
            }
        }
        for lane in &mut lanes {
            *lane /= survival;
        }
        self.out.push(Contribution {
            target: strategy.target,
            lanes,
            raw,
            s: s as u32,
            t: view.camera.len() as u32,
            regularized: multipliers.regularized(s) as u8,
            merged: false,
            class: PathClass::of(view),
        });
    }

    /// Density `pf` of the vertex before camera vertex `j` (x_k for j = 0), from the density of direction at `j`.
    fn camera_before(&self, camera: &Subpath, j: usize, forward: &EdgeDensity) -> EdgeDensity {
        forward.scaled(self.camera_before_factor(camera, j))
    }

    /// What turns a density of direction at camera vertex `j` into the density of the vertex before it.
    #[must_use]
    pub fn camera_before_factor(&self, camera: &Subpath, j: usize) -> f64 {
        let vertex = &camera.vertices[j];
        camera.factor_before(j, || {
            self.sensor_end_factor(&camera.origin, vertex.toward_previous, vertex.distance)
        })
    }

    /// Density `pr` of the vertex before light vertex `i` (x₀ for i = 0), from the density of direction at `i`.
    fn light_before(&self, light: &Subpath, i: usize, reverse: &EdgeDensity) -> EdgeDensity {
        let vertex = &light.vertices[i];
        let factor = light.factor_before(i, || match light.light {
            Some(id) => light_end_factor(
                self.light(id),
                &light.origin,
                vertex.toward_previous,
                vertex.distance,
            ),
            None => 0.0,
        });
        reverse.scaled(factor)
    }

    /// What turns a density of direction towards the sensor into a density of x_k: 0 where it cannot be hit.
    #[must_use]
    pub fn sensor_end_factor(&self, xk: &EndPoint, toward: DVec3, distance: f64) -> f64 {
        if self.techniques.hittable_sensor {
            xk.cos(toward) / (distance * distance)
        } else {
            0.0
        }
    }

    /// Emission densities of x₀ and of the next vertex, whose cosine to the segment is `cos`: (`pf_0`, `pf_1`).
    fn emission(
        &self,
        id: LightId,
        x0: &EndPoint,
        direction: DVec3,
        cos: f64,
        distance: f64,
    ) -> (f64, f64) {
        let (pdf_x0, pdf_direction) =
            self.light(id)
                .emission_density(&self.context.light_context(), x0, direction);
        let next = pdf_direction.area_density(cos, distance * distance);
        (self.context.scene.selection.probability(id) * pdf_x0, next)
    }

    /// Whether camera sub-paths can hit the light of a light sub-path.
    fn is_hittable(&self, id: Option<LightId>) -> bool {
        id.is_some_and(|id| self.light(id).hit_measure() != HitMeasure::Never)
    }

    /// s, t >= 2: light vertex `i` is connected to camera vertex `j`; under non-specular labels of both only if `plain`.
    pub fn pair(&mut self, light: &Subpath, i: usize, camera: &Subpath, j: usize, plain: bool) {
        let (a, b) = (&light.vertices[i], &camera.vertices[j]);
        let offset = b.p - a.p;
        let d2 = offset.length_squared();
        if d2 == 0.0 {
            return;
        }
        let distance = d2.sqrt();
        let w = offset / distance;
        let sides_agree = a.sides_agree(w)
            && b.sides_agree(-w)
            && a.sides_agree(a.toward_previous)
            && b.sides_agree(b.toward_previous);
        if !sides_agree {
            return;
        }
        let region = a.region(w);
        if region.medium != b.region(-w).medium {
            // most such pairs are simply on different sides of an interface: no path joins them
            return;
        }
        self.counters.connections_tried += 1;
        // the labels of one end that are worth trying depend on those of the other; a missed cone ends it early
        let specular_b = self.specular_end(camera, j, -w, b.toward_previous);
        let non_specular_a = if plain || specular_b.is_some() {
            self.non_specular_end(light, i, a.toward_previous, w)
        } else {
            None
        };
        let specular_a = self.specular_end(light, i, a.toward_previous, w);
        if non_specular_a.is_none() && specular_a.is_none() {
            return;
        }
        let non_specular_b = if plain || specular_a.is_some() {
            self.non_specular_end(camera, j, -w, b.toward_previous)
        } else {
            None
        };
        for at_a in non_specular_a.iter().chain(&specular_a) {
            for at_b in non_specular_b.iter().chain(&specular_b) {
                let regularized = at_a.label.is_specular() || at_b.label.is_specular();
                if plain || regularized {
                    self.join((light, i, at_a), (camera, j, at_b), (w, distance), *region);
                }
            }
        }
    }

    /// One pair of labels of a pair of vertices, whose edge is `w`, from light to camera, and `distance` long.
    fn join(
        &mut self,
        (light, i, at_a): (&Subpath, usize, &EndKernel),
        (camera, j, at_b): (&Subpath, usize, &EndKernel),
        (w, distance): (DVec3, f64),
        region: Region,
    ) {
        let (a, b) = (&light.vertices[i], &camera.vertices[j]);
        let d2 = distance * distance;
        let cos_a = a.cos(w);
        let cos_b = b.cos(w);
        let edge = Edge {
            light_end: at_b.backward.scaled(cos_a / d2),
            light_before: self.light_before(light, i, &at_a.backward),
            camera_end: at_a.forward.scaled(cos_b / d2),
            camera_before: self.camera_before(camera, j, &at_b.forward),
            light_label: at_a.label,
            camera_label: at_b.label,
            length: distance as f32,
            light_dispersive: at_a.dispersive,
            camera_dispersive: at_b.dispersive,
        };
        let strategy = Strategy {
            view: PathView {
                light: &light.densities[..i + 2],
                camera: &camera.densities[..j + 2],
                light_columns: &light.columns,
                camera_columns: &camera.columns,
                edge,
                direct: light.direct,
                hittable_light: self.is_hittable(light.light),
            },
            target: Target::OwnPixel,
        };
        let numerator = Self::numerator(
            &[
                &a.throughput.lanes,
                &b.throughput.lanes,
                &at_a.kernel,
                &at_b.kernel,
                &self.context.eta_squared(region.medium),
                &self.context.medium(region.medium).transmittance(distance),
            ],
            a.throughput.scale
                * b.throughput.scale
                * cos_a
                * a.light_side_correction(a.toward_previous)
                * b.shading_cos(w)
                / d2,
        );
        let ray = Ray::leaving(a.p, w, self.context.time, Some(a.id)).ending(distance, Some(b.id));
        self.finish(&numerator, &strategy, Some((&ray, &region)));
    }

    /// All pairs s, t >= 2 that the depth limit and the choice of pairs allow.
    pub fn pairs(&mut self, light: &Subpath, camera: &Subpath) {
        let mut numbers: [f64; 4] = [0.0; 4];
        let mut used = 4;
        for i in 0..light.vertices.len() {
            let a = &light.vertices[i];
            let (plain_a, specular_a) = (a.has_non_specular, self.is_regularized(a));
            if !plain_a && !specular_a {
                continue;
            }
            for j in 0..camera.vertices.len() {
                let (s, t) = (i + 2, j + 2);
                if s + t > self.max_depth.saturating_add(2) {
                    break;
                }
                let b = &camera.vertices[j];
                let mut plain = plain_a && b.has_non_specular;
                let probability = self.techniques.samples(s, t, false);
                if plain && probability < 1.0 {
                    if used == 4 {
                        numbers = self.numbers.next4();
                        used = 0;
                    }
                    used += 1;
                    plain = numbers[used - 1] < probability;
                }
                let allowed = probability > 0.0;
                if plain || allowed && (specular_a || self.is_regularized(b)) {
                    self.pair(light, i, camera, j, plain);
                }
            }
        }
    }
}
