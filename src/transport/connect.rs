//! Joining sub-paths: every strategy's contribution and weight, computed together.
//!
//! [`at_light`] and [`at_sensor`] hold the strategies that end there (s or t <= 1); here is what
//! all share, and the inner pairs.
//!
//! The order of work is from cheap to dear: kernels, weight, roulette on the weighted value, and
//! only then the shadow ray.

mod aimed;
mod at_light;
mod at_photon;
mod at_sensor;
mod end;

pub use at_photon::Photons;
pub use end::Receiver;

use super::aim::fan::Fan;
use super::aim::trail::{Trail, bridges};
use super::aim::{MAX_CHAIN, passage};
use super::class::PathClass;
use super::context::{Counters, PathContext};
use super::contribution::{Aimed, Contribution, Target};
use super::density::{Bridge, Column, Fanned, PathView, VertexDensity};
use super::mis::{
    Denominator, Multipliers, Technique, camera_share, denominator, serves_all_lanes,
};
use super::strategies::StrategySet;
use super::subpath::{Event, Subpath, Vertex};
use crate::bsdf::Lobe;
use crate::geometry::{DirectionalDensity, EndPoint, Ray};
use crate::light::{HitMeasure, Light, LightId, LightKind};
use crate::medium::MediumStack;
use crate::sampler::{Draw, Sampler};
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use end::EndLabels;
use glam::{DVec2, DVec3};

/// Joins the two sub-paths of one sample and collects what they give.
#[derive(Debug)]
pub struct Joiner<'a> {
    /// Shared state of the path pair.
    pub context: &'a PathContext<'a>,
    /// Which strategies are executed.
    pub strategies: &'a StrategySet<'a>,
    /// At most this many scattering vertices on a path.
    pub max_depth: usize,
    /// Where on the film the camera sub-path starts.
    pub raster: DVec2,
    /// All-specular paths between a delta light and a pinhole are left out: an image of measure
    /// zero.
    pub skip_point_images: bool,
    /// Also compute the raw (unweighted) value of each contribution.
    pub with_raw: bool,
    /// Contributions have their class, and each photon that is merged gives one of its own; else
    /// one camera vertex gives one.
    pub detailed: bool,
    /// Chains by which all wavelengths go to a vertex of the camera sub-path.
    pub fan: Option<Fan>,
    /// Random numbers of the sample.
    pub sampler: Sampler<'a>,
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
    /// Densities of a path up to the end of a chain that was solved for, and their columns.
    bridged: Vec<VertexDensity>,
    columns: Vec<Column>,
    /// Lobes of a vertex of such a chain.
    lobes: Vec<(f32, Lobe)>,
    /// Vertices of the paths of a sample, see [`Contribution::events`].
    pub events: Vec<Event>,
    /// Cost of aims, by origin and kind; empty: not counted.
    pub tally: Vec<AimTally>,
    /// Light that each lane has brought by its own chain to the sensor, if it is not the hero's.
    beside: [f64; MAX_LANES],
}

/// Cost of the chains of one kind from one origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AimTally {
    /// Searches.
    pub solved: u64,
    /// Chains that they found, whatever is in their way.
    pub found: u64,
    /// Shadow rays along these.
    pub rays: u64,
}

/// A numerator, still without its weight: the factor of all lanes and each lane's own.
struct Numerator {
    scale: f64,
    lanes: SampledSpectrum,
}

/// A complete path as its strategy sees it, and the pixel it lands on.
struct Candidate<'p> {
    view: PathView<'p>,
    trail: Trail<'p>,
    /// Ends (a, b) of the chain that was solved for, if one was.
    bridge: Option<(usize, usize)>,
    /// Wavelength whose path this is.
    lane: usize,
    target: Target,
    /// Transmittance of its segments, where that is known already.
    open: Option<f64>,
}

impl<'a> Joiner<'a> {
    /// Whether strategy (s, t) is executed and allowed by the depth limit.
    fn wants(&self, s: usize, t: usize) -> bool {
        s + t <= self.max_depth.saturating_add(2)
            && self.strategies.samples(Technique::Join(s), s + t, false) > 0.0
    }

    /// Whether a joining edge may end at the vertex.
    fn is_connectible(&self, vertex: &Vertex) -> bool {
        vertex.has_non_specular || self.is_regularized(vertex)
    }

    /// Whether a joining edge may end at the vertex under a specular label.
    fn is_regularized(&self, vertex: &Vertex) -> bool {
        self.strategies.cone.is_some() && vertex.has_specular
    }

    fn light(&self, id: LightId) -> &'a Light {
        self.context.scene.light(id)
    }

    /// Applies the MIS weight, Russian roulette and the visibility test, then records the
    /// contribution. [theory (3.1)]
    ///
    /// `segments` are the rays that must reach their ends, from the sensor's side on where they are
    /// those of a chain; the first starts in the solids of `stack`.
    fn finish(
        &mut self,
        numerator: &Numerator,
        candidate: &Candidate,
        segments: &[Ray],
        stack: &MediumStack,
    ) {
        let mut seen;
        let mut view = &candidate.view;
        let mut scale = numerator.scale;
        let mut alive = numerator.lanes;
        if let Some(held) = self.context.held {
            let vertex = |i| (view.label(i + 1), candidate.trail.surface(i + 1));
            if !held.sequence.holds(view.len().saturating_sub(2), vertex) {
                return;
            }
            scale *= held.weight;
        }
        let opened = self.fan.filter(|fan| view.camera.len() >= fan.vertex + 2);
        if self.strategies.fans && view.has_specular() {
            seen = *view;
            seen.fan = self.fanned(view, &candidate.trail, opened.as_ref());
            match (&seen.fan, &opened) {
                (Some(_), Some(fan)) => seen.raster = fan.raster,
                // the path of a lane that is no hero's counts on nobody else
                (None, Some(_)) => alive *= self.context.hero_lanes(),
                _ => {}
            }
            view = &seen;
        }
        let beside = opened.filter(|_| view.fan.is_some());
        let mut aimed;
        if self.strategies.aims.any() {
            aimed = *view;
            let (kind, trail) = (&self.light(aimed.emitter).kind, &candidate.trail);
            aimed.bridges = bridges(
                self.context,
                self.strategies,
                view,
                trail,
                kind,
                candidate.lane,
            );
            if let Some(ends) = candidate.bridge {
                let is_it = |bridge: &&Bridge| (bridge.a, bridge.b) == ends;
                aimed.made = aimed.bridges.iter().flatten().find(is_it).copied();
                if aimed.made.is_none() {
                    self.counters.lost_bridges += 1;
                    return;
                }
            }
            view = &aimed;
        }
        if self.skip_point_images && !view.hittable_light && view.is_all_specular() {
            return;
        }
        #[cfg(test)]
        if view.made.is_none() {
            super::record::record(view, self.strategies, segments.first());
        }
        let count = self.context.count();
        let multipliers = Multipliers::new(view, self.strategies);
        let weights = denominator(
            &multipliers,
            &self.context.wavelengths,
            &mut self.scratch.suffix,
        );
        if weights.numerator == 0.0 && !self.with_raw {
            return;
        }
        let mut lanes = [0.0; MAX_LANES];
        for (j, lane) in lanes.iter_mut().enumerate().take(count) {
            let value = scale * f64::from(alive[j]);
            if value != 0.0 {
                *lane = value * weights.factor(j);
            }
        }
        let Some(brightness) = self.finite_brightness(&lanes) else {
            return;
        };
        let mut survival = 1.0;
        if !segments.is_empty() {
            let labels = [view.edge.light_label, view.edge.camera_label];
            let [a, b] = labels.map(|label| usize::from(label.is_specular()));
            let solved = usize::from(view.made.is_some()) << 20;
            let draw = Draw::Roulette(view.s(), view.camera.len(), 2 * a + b + solved);
            let Some(played) = self.survival(brightness, view.raster, draw) else {
                return;
            };
            survival = played;
            let open = if let Some(open) = candidate.open {
                open
            } else if candidate.bridge.is_some() {
                passage::visibility(
                    self.context,
                    candidate.trail.chain,
                    segments,
                    stack,
                    self.counters,
                )
            } else {
                let visibility = |ray| self.context.visibility(ray, stack, self.counters);
                segments.iter().map(visibility).product()
            };
            if open == 0.0 {
                return;
            }
            survival /= open;
        }
        self.counters.connections_made += 1;
        let s = view.s();
        let made = Technique::of(view);
        let events = self.note_events(view, &candidate.trail);
        let (raw, camera_share) = if self.with_raw {
            let shared = serves_all_lanes(view, view.dispersive_count(), made);
            let value = |j| scale * f64::from(alive[j]) / weights.share_of(shared, j);
            let raw = self.raw(value, multipliers.plain(made), shared, survival);
            (raw, camera_share(&multipliers) as f32)
        } else {
            ([0.0; MAX_LANES], 0.0)
        };
        for lane in &mut lanes {
            *lane /= survival;
        }
        let found = Contribution {
            target: candidate.target,
            lanes,
            raw,
            camera_share,
            s: view.made.map_or(s, |bridge| bridge.a + 1) as u32,
            t: view.camera.len() as u32,
            regularized: match view.made {
                Some(_) => 0,
                None => multipliers.regularized(s) as u8,
            },
            merged: false,
            beside: false,
            aimed: view
                .made
                .as_ref()
                .map(|made| self.aimed(made, view, &multipliers, &weights, candidate.lane)),
            emitter: view.emitter,
            class: if self.detailed {
                PathClass::of(view)
            } else {
                PathClass::default()
            },
            events,
        };
        match &beside {
            Some(fan) => self.spread(fan, found),
            None => self.out.push(found),
        }
    }

    /// Brightness of a contribution; `None`, and counted, if a lane is not finite, which no
    /// response turns into a number.
    #[inline]
    fn finite_brightness(&mut self, lanes: &[f64; MAX_LANES]) -> Option<f64> {
        let brightness = self.context.response.brightness(lanes);
        if !brightness.is_finite() {
            self.counters.non_finite += 1;
            return None;
        }
        Some(brightness)
    }

    /// Russian roulette before the shadow rays of a contribution: the probability with which it
    /// goes on, `None` where it does not.
    #[inline]
    fn survival(&self, brightness: f64, raster: DVec2, draw: Draw) -> Option<f64> {
        let bound = self.strategies.factors.map(|f| f.roulette_bound(raster));
        let threshold = self.context.pass.roulette_threshold;
        let threshold = bound.map_or(threshold, |bound| threshold.min(bound));
        if brightness < threshold {
            let survival = brightness / threshold;
            return (self.sampler.number(draw) < survival).then_some(survival);
        }
        Some(1.0)
    }

    /// Chain of a path at its sensor, if that belongs to a fan: its lanes meet in a direction of
    /// the environment, or at a vertex that sends light alike in all directions and is not itself
    /// lit by way of what is specular, for bridges from the sensor make these.
    fn fanned(&self, view: &PathView, trail: &Trail, opened: Option<&Fan>) -> Option<Fanned> {
        let end = view.len() - 1;
        let specular = |i: usize| (1..end).contains(&i) && view.is_specular(i);
        let at = (1..end).rev().find(|&i| !specular(i));
        let is_met = match at {
            Some(at) => !specular(at - 1) && trail.is_lambertian(at),
            // seen straight through, with nothing else that makes it
            None => matches!(self.light(view.emitter).kind, LightKind::Environment(_)),
        };
        let at = at.unwrap_or(0);
        let mut chain = at + 1..end;
        let is_fan = is_met
            && (1..=MAX_CHAIN).contains(&chain.len())
            && chain.any(|i| view.is_dispersive(i));
        let waves = &self.context.wavelengths;
        let alone = |j: usize| waves.multiplicity(j) as f64 / waves.count() as f64;
        is_fan.then(|| Fanned {
            at,
            shares: opened.map_or_else(
                || std::array::from_fn(|j| if j < waves.count() { alone(j) } else { 1.0 }),
                |fan| fan.shares,
            ),
        })
    }

    /// Records what lanes bring by chains of their own: the hero's to the pixel, others beside it.
    fn spread(&mut self, fan: &Fan, found: Contribution) {
        let hero = self.context.hero_lanes();
        let only = |values: &[f64; MAX_LANES], is_kept: &dyn Fn(usize) -> bool| {
            std::array::from_fn(|j| if is_kept(j) { values[j] } else { 0.0 })
        };
        for j in (0..self.context.count()).filter(|&j| hero[j] == 0.0) {
            if self.detailed {
                if found.lanes[j] != 0.0 || found.raw[j] != 0.0 {
                    self.out.push(Contribution {
                        target: Target::Splat(fan.rasters[j]),
                        lanes: only(&found.lanes, &|k| k == j),
                        raw: only(&found.raw, &|k| k == j),
                        beside: true,
                        ..found
                    });
                }
            } else {
                self.scratch.beside[j] += found.lanes[j];
            }
        }
        self.out.push(Contribution {
            lanes: only(&found.lanes, &|k| hero[k] != 0.0),
            raw: only(&found.raw, &|k| hero[k] != 0.0),
            ..found
        });
    }

    /// Records the sums of what lanes have brought beside the pixel.
    pub fn end_of_camera(&mut self) {
        let Some(fan) = &self.fan else { return };
        for j in 0..self.context.count() {
            let sum = std::mem::take(&mut self.scratch.beside[j]);
            if sum != 0.0 {
                let lanes = std::array::from_fn(|k| if k == j { sum } else { 0.0 });
                self.out.push(Contribution {
                    beside: true,
                    ..Contribution::sum(Target::Splat(fan.rasters[j]), lanes)
                });
            }
        }
    }

    /// Notes the scattering vertices of a path, where paths are told apart.
    fn note_events(&mut self, view: &PathView, trail: &Trail) -> [u32; 2] {
        if !self.detailed {
            return [0; 2];
        }
        let events = &mut self.scratch.events;
        let first = events.len();
        events.extend((1..view.len().saturating_sub(1)).map(|i| Event {
            label: view.label(i),
            surface: trail.surface(i),
        }));
        [first as u32, events.len() as u32]
    }

    /// How a bridge made a contribution.
    fn aimed(
        &self,
        made: &Bridge,
        view: &PathView,
        multipliers: &Multipliers,
        weights: &Denominator,
        lane: usize,
    ) -> Aimed {
        let technique = Technique::Bridge(made.a, made.b);
        let waves = &self.context.wavelengths;
        let heroes = if serves_all_lanes(view, view.dispersive_count(), technique) {
            self.context.count()
        } else {
            waves.multiplicity(lane)
        };
        let power = |value| self.strategies.heuristic.power(value);
        let share = weights.share_of(heroes == self.context.count(), lane);
        let term = power(multipliers.of(technique)) * heroes as f64 * share;
        Aimed {
            kind: made.kind,
            origin: made.origin,
            weight: (term / weights.sum(lane)) as f32,
        }
    }

    /// The estimate of a technique alone, executed `samples` times, from its numerators `value`,
    /// which all lanes share or only those of one wavelength.
    fn raw(
        &self,
        value: impl Fn(usize) -> f64,
        samples: f64,
        shared: bool,
        survival: f64,
    ) -> [f64; MAX_LANES] {
        let mut raw = [0.0; MAX_LANES];
        let count = self.context.count();
        for (j, raw) in raw.iter_mut().enumerate().take(count) {
            let heroes = if shared {
                count
            } else {
                self.context.wavelengths.multiplicity(j)
            };
            *raw = value(j) / (samples * heroes as f64 * survival);
        }
        raw
    }

    /// Emission densities of x₀ and of the direction in which its light leaves for x₁; 0 where no
    /// technique emits light.
    fn emission(
        &self,
        id: LightId,
        x0: &EndPoint,
        direction: DVec3,
        x1: DVec3,
    ) -> (f64, DirectionalDensity) {
        if !self.context.asked.from_light {
            return (0.0, DirectionalDensity::SolidAngle(0.0));
        }
        let scene = self.context.scene;
        let (pdf_x0, pdf_direction) =
            self.light(id)
                .emission_density(&scene.geometry, &scene.casters, x0, direction, x1);
        (scene.selection.probability(id) * pdf_x0, pdf_direction)
    }

    /// Radiance that a point x₀ of an area light sends in unit direction `w`, where nothing in its
    /// place takes it; `None` for other lights.
    fn emitted(&self, id: LightId, x0: &EndPoint, w: DVec3) -> Option<SampledSpectrum> {
        let (light, scene) = (self.light(id), &self.context.scene);
        let mut point = x0.surface_point()?;
        if light.has_pattern() {
            point.uv = scene.geometry.texture_coordinates(point.id, point.p);
        }
        let radiance = light.radiance(&point, w, &self.context.wavelengths);
        Some(radiance * scene.exposure(x0) as f32)
    }

    /// Whether camera sub-paths can hit the light of a light sub-path.
    fn is_hittable(&self, id: Option<LightId>) -> bool {
        id.is_some_and(|id| self.light(id).hit_measure() != HitMeasure::Never)
    }

    /// s, t >= 2: light vertex `i` is connected to camera vertex `j`. `with_rough_pair`: also under
    /// the two non-specular labels (chosen with `pair_probability`).
    fn pair(
        &mut self,
        light: &Subpath,
        i: usize,
        camera: &Subpath,
        j: usize,
        with_rough_pair: bool,
    ) {
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
        if a.medium(w) != b.medium(-w) {
            // most such pairs are simply on different sides of an interface: no path joins them
            return;
        }
        self.counters.connections_tried += 1;
        // the labels of one end that are worth trying depend on those of the other; a missed cone
        // ends it early
        let mut labels_b = EndLabels {
            rough: None,
            specular: self.specular_label(camera, j, -w),
        };
        let wants_rough = with_rough_pair || labels_b.specular.is_some();
        let labels_a = EndLabels {
            rough: wants_rough.then(|| self.rough_label(light, i, w)).flatten(),
            specular: self.specular_label(light, i, w),
        };
        if labels_a.is_empty() {
            return;
        }
        if with_rough_pair || labels_a.specular.is_some() {
            labels_b.rough = self.rough_label(camera, j, -w);
        }
        if labels_b.is_empty() {
            return;
        }
        let at_a = self.vertex_end(light, i, w, &labels_a);
        let at_b = self.vertex_end(camera, j, -w, &labels_b);
        self.join(&at_a, &at_b, (w, distance), with_rough_pair);
    }

    /// All pairs s, t >= 2 that the depth limit and the choice of pairs allow. One number chooses
    /// them all: neighbors on the grid of pairs take turns, so that neither a vertex nor, as the
    /// number is stratified, a few passes in a row have many or none by chance.
    pub fn pairs(&mut self, light: &Subpath, camera: &Subpath) {
        let mut drawn = None;
        for i in 0..light.vertices.len() {
            let a = &light.vertices[i];
            let (rough_a, specular_a) = (a.has_non_specular, self.is_regularized(a));
            if !rough_a && !specular_a {
                continue;
            }
            for j in 0..camera.vertices.len() {
                let (s, t) = (i + 2, j + 2);
                if s + t > self.max_depth.saturating_add(2) {
                    break;
                }
                let b = &camera.vertices[j];
                let mut with_rough_pair = rough_a && b.has_non_specular;
                let allowed = self.strategies.samples(Technique::Join(s), s + t, false) > 0.0;
                let probability = if allowed { self.strategies.pairs } else { 0.0 };
                if with_rough_pair && probability < 1.0 {
                    let [u, ..] = *drawn.get_or_insert_with(|| self.sampler.set(Draw::Pairs));
                    with_rough_pair = takes_turn((i, j), probability, u);
                }
                if with_rough_pair || allowed && (specular_a || self.is_regularized(b)) {
                    self.pair(light, i, camera, j, with_rough_pair);
                }
            }
        }
    }
}

/// Whether a pair of vertices is one of the share `probability` that number `u` chooses: of a
/// quarter, every fourth in each row and column of the grid.
fn takes_turn((i, j): (usize, usize), probability: f64, u: f64) -> bool {
    (u + (3 * i + j) as f64 * probability).fract() < probability
}

#[cfg(test)]
mod tests {
    use super::takes_turn;

    #[test]
    fn every_pair_has_its_turn_as_often_as_is_asked() {
        let numbers = |count: u32| (0..count).map(move |k| (f64::from(k) + 0.5) / f64::from(count));
        for (probability, i, j) in [(0.25, 0, 0), (0.25, 3, 5), (0.7, 2, 9), (0.05, 40, 63)] {
            let tried = numbers(1000).filter(|&u| takes_turn((i, j), probability, u));
            let share = tried.count() as f64 / 1000.0;
            // one number more or less at each end of what is chosen
            assert!(
                (share - probability).abs() <= 0.002,
                "{share} {probability}"
            );
        }
        // of a quarter, one of four neighbors in any row and column, whatever the number
        for u in numbers(64) {
            for at in 0..5 {
                let row = (at..at + 4).filter(|&j| takes_turn((2, j), 0.25, u));
                let column = (at..at + 4).filter(|&i| takes_turn((i, 1), 0.25, u));
                assert_eq!((row.count(), column.count()), (1, 1));
            }
        }
    }
}
