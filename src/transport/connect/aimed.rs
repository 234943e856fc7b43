//! Bridges: two ends joined by a chain of specular vertices that is solved for.

use super::end::{EndLabel, Receiver};
use super::{Candidate, Joiner, Numerator, Segment};
use crate::bsdf::{Bsdf, Label};
use crate::geometry::{EndPoint, Ray, SurfaceId, SurfacePoint};
use crate::light::{LightId, LightKind};
use crate::medium::Region;
use crate::sampler::Draw;
use crate::scene::chains::ChainKind;
use crate::spectrum::SampledSpectrum;
use crate::transport::aim::trail::{self, Place, Placed, Trail};
use crate::transport::aim::{Bounce, Far, MAX_CHAIN, Points, differential, placed, solve};
use crate::transport::contribution::Target;
use crate::transport::density::{Departure, Edge, EdgeDensity, NO_COLUMN, PathView, VertexDensity};
use crate::transport::subpath::Subpath;
use crate::transport::throughput::Throughput;
use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};

/// Most chains of one kind between two ends: more have not been seen.
const MOST_CHAINS: usize = 16;

/// A point of a light that chains lead to.
#[derive(Clone, Copy)]
struct Start {
    id: LightId,
    x0: EndPoint,
    /// Its density as light is emitted, the choice of the light included.
    pdf: f64,
    region: Region,
}

/// The end x_a.
enum LightEnd<'p> {
    Start,
    Vertex(&'p Subpath, usize),
}

/// The end x_b.
enum SensorEnd<'p> {
    /// A point of the sensor, and the numbers that chose it.
    Sensor(EndPoint, DVec2),
    Vertex(&'p Subpath, usize),
}

/// Both ends of the chains of one search.
struct Ends<'p> {
    start: Start,
    light: LightEnd<'p>,
    sensor: SensorEnd<'p>,
    margin: f64,
}

/// What is known of one end once the direction to the chain is.
struct Reached {
    /// All factors of this side but those of lanes, and those.
    weight: Throughput,
    /// Density of the direction towards the chain.
    across: Departure,
    /// Density of the vertex before this end from the other side.
    behind: EdgeDensity,
    /// Jacobian from solid angle at the chain to the measure of this end.
    factor: f64,
    target: Target,
    surface: Option<SurfaceId>,
    point: EndPoint,
    /// Density of a point of the sensor.
    own: f64,
}

/// A specular vertex that was solved for.
struct Solved {
    place: Place,
    label: Label,
    dispersive: bool,
    /// Probabilities of the label for ω⁻ and for ω⁺.
    forward: f64,
    backward: f64,
}

impl Joiner<'_> {
    /// Whether any bridge of `n` vertices at most could end at the vertex.
    fn aims_from(&self, path: &Subpath, i: usize, far_enough: bool) -> bool {
        let vertex = &path.vertices[i];
        // one more end, and a chain of at least one vertex
        i + 2 <= self.max_depth
            && vertex.has_non_specular
            && vertex.sides_agree(vertex.toward_previous)
            && far_enough
    }

    /// Camera vertex `j` aims at a light through chains.
    pub fn aim_at_light(&mut self, camera: &Subpath, j: usize) {
        let aims = self.strategies.aims;
        let after_specular = j >= 1 && camera.densities[j].label.is_specular();
        if !aims.light || !self.aims_from(camera, j, aims.light_everywhere || after_specular) {
            return;
        }
        let context = self.context;
        let regions = &camera.vertices[j].regions;
        let mut start = None;
        for kind in context.scene.chains.kinds() {
            let (first, last) = (&kind[0], &kind[kind.len() - 1]);
            if !regions.contains(&last.after()) || j + 1 + kind.len() > self.max_depth {
                continue;
            }
            if start.is_none() {
                let Some(drawn) = self.draw_start(Draw::AimLight(j)) else {
                    return;
                };
                start = Some(drawn);
            }
            let Some(start) = start.filter(|s| s.region == first.before()) else {
                continue;
            };
            let ends = Ends {
                start,
                light: LightEnd::Start,
                sensor: SensorEnd::Vertex(camera, j),
                margin: 0.0,
            };
            self.aim(&ends, kind);
        }
    }

    /// Light vertex `i` aims at the sensor through chains.
    pub fn aim_at_sensor(&mut self, light: &Subpath, i: usize, margin: f64) {
        let aims = self.strategies.aims;
        let (Some(id), true) = (light.light, aims.sensor) else {
            return;
        };
        let after_specular = i >= 1 && light.densities[i].label.is_specular();
        let everywhere = aims.sensor_everywhere || after_specular;
        if !self.aims_from(light, i, everywhere || self.context.count() > 1) {
            return;
        }
        let context = self.context;
        let regions = &light.vertices[i].regions;
        let start = Start {
            id,
            x0: light.origin,
            pdf: light.densities[0].own,
            region: light.region,
        };
        let mut point = None;
        for kind in context.scene.chains.kinds() {
            let (first, last) = (&kind[0], &kind[kind.len() - 1]);
            if !regions.contains(&first.before())
                || last.after() != self.sensor_region()
                || i + 1 + kind.len() > self.max_depth
                || !everywhere && !trail::is_dispersive(context, kind)
            {
                continue;
            }
            let (x_sensor, u) = *point.get_or_insert_with(|| self.draw_lens(i + 1));
            let ends = Ends {
                start,
                light: LightEnd::Vertex(light, i),
                sensor: SensorEnd::Sensor(x_sensor, u),
                margin,
            };
            self.aim(&ends, kind);
        }
    }

    /// The start of the light sub-path, on an area light, aims at the sensor through chains.
    pub fn aim_through(&mut self, light: &Subpath, margin: f64) {
        let (Some(id), true) = (light.light, self.strategies.aims.through) else {
            return;
        };
        if !matches!(self.light(id).kind, LightKind::Area(_)) {
            return;
        }
        let context = self.context;
        let start = Start {
            id,
            x0: light.origin,
            pdf: light.densities[0].own,
            region: light.region,
        };
        let mut point = None;
        for kind in context.scene.chains.kinds() {
            let (first, last) = (&kind[0], &kind[kind.len() - 1]);
            if start.region != first.before()
                || last.after() != self.sensor_region()
                || kind.len() > self.max_depth
            {
                continue;
            }
            let (x_sensor, u) = *point.get_or_insert_with(|| self.draw_lens(0));
            let ends = Ends {
                start,
                light: LightEnd::Start,
                sensor: SensorEnd::Sensor(x_sensor, u),
                margin,
            };
            self.aim(&ends, kind);
        }
    }

    fn sensor_region(&self) -> Region {
        self.context.scene.sensors[self.context.sensor]
            .stack
            .region()
    }

    /// A start on a light, as light is emitted.
    fn draw_start(&self, draw: Draw) -> Option<Start> {
        let u = self.sampler.set(draw);
        let scene = self.context.scene;
        let (id, probability, u0) = scene.selection.sample(u[0])?;
        let light = self.light(id);
        if !trail::is_aimed_at(&light.kind) {
            return None;
        }
        let sample = light.sample_emission(
            &scene.geometry,
            &self.context.wavelengths,
            u0,
            DVec2::new(u[1], u[2]),
            DVec2::splat(0.5),
        )?;
        Some(Start {
            id,
            x0: sample.x0,
            pdf: probability * sample.pdf_x0,
            region: scene.light_stack(id).region(),
        })
    }

    /// A point of the lens, and the numbers that chose it.
    fn draw_lens(&self, i: usize) -> (EndPoint, DVec2) {
        let camera = &self.context.scene.sensors[self.context.sensor].camera;
        let u = if camera.is_delta() {
            DVec2::ZERO
        } else {
            let [u, v, _, _] = self.sampler.set(Draw::AimLens(i));
            DVec2::new(u, v)
        };
        let middle = camera.resolution().size() * 0.5;
        (camera.sample_ray(middle, u, self.context.moment()).xk, u)
    }

    /// All chains of a kind between two ends, each lane its own where they disperse.
    fn aim(&mut self, ends: &Ends, kind: &ChainKind) {
        let lanes = if trail::is_dispersive(self.context, kind) {
            self.context.count()
        } else {
            1
        };
        let far = match ends.light {
            LightEnd::Vertex(path, i) => Far::Point(path.vertices[i].p),
            LightEnd::Start if ends.start.x0.infinite => Far::Direction(-ends.start.x0.n),
            LightEnd::Start => Far::Point(ends.start.x0.p),
        };
        let to = match ends.sensor {
            SensorEnd::Vertex(path, j) => path.vertices[j].p,
            SensorEnd::Sensor(x, _) => x.p,
        };
        for lane in 0..lanes {
            let alive = |path: &Subpath, i: usize| path.vertices[i].throughput.lanes[lane] > 0.0;
            let dead = match (&ends.light, &ends.sensor) {
                (LightEnd::Vertex(path, i), _) => !alive(path, *i),
                (_, SensorEnd::Vertex(path, j)) => !alive(path, *j),
                _ => false,
            };
            if lanes > 1 && dead {
                continue;
            }
            let Some(chain) = trail::place(self.context, kind, lane) else {
                continue;
            };
            if is_hopeless(&chain.0, &far, to) {
                continue;
            }
            self.counters.connections_tried += 1;
            let mut found: ArrayVec<Points, MOST_CHAINS> = ArrayVec::new();
            solve(&chain.0, &chain.1, &far, to, |points| {
                // beyond so many the path has no bridge that counts, but there never are
                let _ = found.try_push(points.clone());
            });
            let only = (lanes > 1).then_some(lane);
            for points in &found {
                self.bridge(ends, kind, &chain, points, (&far, to), only);
            }
        }
    }

    /// The contribution of one chain.
    fn bridge(
        &mut self,
        ends: &Ends,
        kind: &ChainKind,
        (bounces, eta): &Placed,
        points: &Points,
        (far, to): (&Far, DVec3),
        only: Option<usize>,
    ) -> Option<()> {
        let context = self.context;
        let scene = context.scene;
        let m = points.len();
        for (link, &p) in kind.iter().zip(points) {
            let instance = scene.accel.instance(link.id.instance);
            let placement = instance.transform.at(context.moment());
            if !placed::is_on_face(instance, link.id, &placement, p) {
                return None;
            }
        }
        // unit directions and lengths of the segments, from the light to the sensor
        let mut segments: ArrayVec<(DVec3, f64), { MAX_CHAIN + 1 }> = ArrayVec::new();
        segments.push(match *far {
            Far::Point(x) => ((points[0] - x).normalize(), x.distance(points[0])),
            Far::Direction(w) => (-w, f64::INFINITY),
        });
        for i in 0..m {
            let v = points.get(i + 1).copied().unwrap_or(to) - points[i];
            segments.push((v.normalize(), v.length()));
        }
        let (first, last) = (segments[0], segments[m]);
        let at_light = self.reach_light(ends, first, points[0], kind[0].before())?;
        let at_sensor = self.reach_sensor(ends, last, points[m - 1], kind[m - 1].after())?;

        let jacobian = differential::jacobian(bounces, points, eta, far, to);
        let media = [kind[0].before(), kind[m - 1].after()].map(|r| context.eta_squared(r.medium));
        let mut lanes = at_light.weight.lanes * at_sensor.weight.lanes * media[1];
        if matches!(ends.light, LightEnd::Start) {
            lanes = lanes * (SampledSpectrum::ONE / media[0]);
        }
        let mut solved: ArrayVec<Solved, MAX_CHAIN> = ArrayVec::new();
        for (i, (link, bounce)) in kind.iter().zip(bounces).enumerate() {
            let (vertex, value) = self.solved(link, bounce, points[i], &segments[i..i + 2]);
            lanes *= value;
            lanes *= context
                .medium(link.before().medium)
                .transmittance(segments[i].1);
            solved.push(vertex);
        }
        lanes *= context
            .medium(kind[m - 1].after().medium)
            .transmittance(last.1);
        if let Some(lane) = only {
            lanes = SampledSpectrum::from_fn(|k| if k == lane { lanes[k] } else { 0.0 });
        }
        if lanes.is_black(context.count()) {
            return None;
        }
        let numerator = Numerator {
            scale: at_light.weight.scale * at_sensor.weight.scale * jacobian,
            lanes,
        };

        let mut shadow: ArrayVec<Segment, { MAX_CHAIN + 1 }> = ArrayVec::new();
        for i in (0..=m).rev() {
            let (w, length) = segments[i];
            let (from, surface) = match points.get(i) {
                Some(&p) => (p, Some(kind[i].id)),
                None => (to, at_sensor.surface),
            };
            let end = i
                .checked_sub(1)
                .map_or(at_light.surface, |i| Some(kind[i].id));
            let region = kind
                .get(i)
                .map_or(kind[m - 1].after(), |link| link.before());
            shadow.push((Ray::leaving(from, -w, surface).ending(length, end), region));
        }

        let mut densities = std::mem::take(&mut self.scratch.bridged);
        let mut columns = std::mem::take(&mut self.scratch.columns);
        densities.clear();
        columns.clear();
        let edge = ends.densities(
            (&at_light, &at_sensor),
            (&solved, &segments),
            &mut densities,
            &mut columns,
        );
        let own_sensor = [VertexDensity::new(at_sensor.own)];
        let (camera, camera_columns, vertices): (&[VertexDensity], &[_], _) = match ends.sensor {
            SensorEnd::Vertex(path, j) => (
                &path.densities[..j + 2],
                &path.columns[..],
                &path.vertices[..=j],
            ),
            SensorEnd::Sensor(..) => (&own_sensor, &[], &[][..]),
        };
        let a = densities.len() - 1 - m;
        let direct = match ends.light {
            LightEnd::Start => context.direct_density(ends.start.id, points[0], &ends.start.x0),
            LightEnd::Vertex(path, _) => path.direct,
        };
        let places: ArrayVec<Place, MAX_CHAIN> = solved.iter().map(|s| s.place).collect();
        let candidate = Candidate {
            view: PathView {
                light: &densities,
                camera,
                light_columns: &columns,
                camera_columns,
                edge,
                direct,
                hittable_light: self.is_hittable(Some(ends.start.id)),
                bridges: [None; 2],
                made: None,
            },
            trail: Trail {
                x0: ends.start.x0,
                light: match ends.light {
                    LightEnd::Start => &[],
                    LightEnd::Vertex(path, i) => &path.vertices[..=i],
                },
                chain: &places,
                camera: vertices,
                x_sensor: match ends.sensor {
                    SensorEnd::Vertex(path, _) => path.origin,
                    SensorEnd::Sensor(..) => at_sensor.point,
                },
            },
            light: Some(ends.start.id),
            bridge: Some((a, a + 1 + m)),
            lane: only.unwrap_or(0),
            target: at_sensor.target,
        };
        self.finish(&numerator, &candidate, &shadow);
        self.scratch.bridged = densities;
        self.scratch.columns = columns;
        Some(())
    }

    /// A specular vertex of a chain between its two segments, and its reflectance or transmittance.
    fn solved(
        &mut self,
        link: &crate::scene::chains::ChainLink,
        bounce: &Bounce,
        p: DVec3,
        segments: &[(DVec3, f64)],
    ) -> (Solved, SampledSpectrum) {
        let context = self.context;
        let scene = context.scene;
        let ng = bounce.surface.normal(p);
        let interface = context.interface(&link.regions);
        let uv = scene.geometry.texture_coordinates(link.id, p);
        self.scratch.lobes.clear();
        scene
            .material(scene.object(link.id.instance).material)
            .push_lobes(
                uv,
                &context.wavelengths,
                &interface,
                &mut self.scratch.lobes,
            );
        let bsdf = Bsdf {
            lobes: &self.scratch.lobes,
            interface,
        };
        let label = if link.transmits {
            Label::SpecularTransmit
        } else {
            Label::SpecularReflect
        };
        let local = |w: DVec3| {
            let z = w.dot(ng);
            DVec3::new((1.0 - z * z).max(0.0).sqrt(), 0.0, z)
        };
        let (w_light, w_sensor) = (local(-segments[0].0), local(segments[1].0));
        let value = bsdf.specular(label, w_sensor.z.abs(), w_sensor.z > 0.0);
        let vertex = Solved {
            place: Place {
                p,
                ng,
                id: link.id,
                regions: link.regions,
            },
            label,
            dispersive: link.transmits && interface.dispersive,
            forward: bsdf.label_probability(label, w_light),
            backward: bsdf.label_probability(label, w_sensor),
        };
        (vertex, value)
    }

    /// The light's end, which the chain leaves in unit direction `w` over `length` to `p`.
    fn reach_light(
        &self,
        ends: &Ends,
        (w, length): (DVec3, f64),
        p: DVec3,
        region: Region,
    ) -> Option<Reached> {
        match ends.light {
            LightEnd::Vertex(path, i) => {
                let vertex = &path.vertices[i];
                let label = self.reach_vertex(path, i, w, region)?;
                let cos = vertex.cos(w);
                let correction = vertex.light_side_correction(vertex.toward_previous);
                Some(Reached {
                    weight: vertex
                        .throughput
                        .times(&label.kernel)
                        .scaled(cos * correction),
                    across: label.across,
                    behind: label.behind.scaled(self.before_factor(path, i)),
                    factor: cos / (length * length),
                    target: Target::OwnPixel,
                    surface: Some(vertex.id),
                    point: vertex.end_point(),
                    own: 0.0,
                })
            }
            LightEnd::Start => {
                let Start { id, x0, pdf, .. } = ends.start;
                let (light, context) = (self.light(id), self.context);
                let value = match &light.kind {
                    LightKind::Area(_) => {
                        let surface = x0.surface?;
                        let uv = if light.has_pattern() {
                            context.scene.geometry.texture_coordinates(surface, x0.p)
                        } else {
                            DVec2::ZERO
                        };
                        let point = SurfacePoint {
                            p: x0.p,
                            ng: x0.n,
                            ns: x0.n,
                            uv,
                            id: surface,
                        };
                        light.radiance(&point, w, &context.wavelengths)
                    }
                    _ => {
                        let geometry = &context.scene.geometry;
                        let waves = &context.wavelengths;
                        let sample = light.sample_direct(geometry, waves, p, 0.0, DVec2::ZERO)?;
                        let d2 = if x0.infinite { 1.0 } else { length * length };
                        sample.value * d2 as f32
                    }
                };
                if value.is_black(context.count()) {
                    return None;
                }
                let cos = if x0.infinite { 1.0 } else { x0.cos(w) };
                let (_, direction) = self.emission(id, &x0, w);
                Some(Reached {
                    weight: Throughput::splat(cos / pdf).times(&value),
                    across: Departure::Start(direction),
                    behind: EdgeDensity::default(),
                    factor: Receiver::of_light(light, &x0, w).factor(length),
                    target: Target::OwnPixel,
                    surface: x0.surface,
                    point: x0,
                    own: pdf,
                })
            }
        }
    }

    /// The sensor's end, at which the chain arrives in unit direction `w` over `length` from `p`.
    fn reach_sensor(
        &self,
        ends: &Ends,
        (w, length): (DVec3, f64),
        p: DVec3,
        region: Region,
    ) -> Option<Reached> {
        match ends.sensor {
            SensorEnd::Vertex(path, j) => {
                let vertex = &path.vertices[j];
                let label = self.reach_vertex(path, j, -w, region)?;
                Some(Reached {
                    weight: vertex
                        .throughput
                        .times(&label.kernel)
                        .scaled(vertex.shading_cos(w)),
                    across: label.across,
                    behind: label.behind.scaled(self.before_factor(path, j)),
                    factor: vertex.cos(w) / (length * length),
                    target: Target::OwnPixel,
                    surface: Some(vertex.id),
                    point: vertex.end_point(),
                    own: 0.0,
                })
            }
            SensorEnd::Sensor(_, u) => {
                let sensor = &self.context.scene.sensors[self.context.sensor];
                let moment = self.context.moment();
                let drawn = sensor.camera.sample_connection(p, u, moment, ends.margin)?;
                let (_, direction) = sensor.camera.density(-w, moment);
                Some(Reached {
                    weight: Throughput::splat(drawn.importance * length * length),
                    across: Departure::Start(direction),
                    behind: EdgeDensity::default(),
                    // an image camera receives nothing
                    factor: 0.0,
                    target: Target::Splat(drawn.raster),
                    surface: drawn.xk.surface,
                    point: drawn.xk,
                    own: drawn.pdf_xk,
                })
            }
        }
    }

    /// Vertex `i`, left in unit direction `w` into `region`, under its non-specular label.
    fn reach_vertex(&self, path: &Subpath, i: usize, w: DVec3, region: Region) -> Option<EndLabel> {
        let vertex = &path.vertices[i];
        if !vertex.sides_agree(w) || *vertex.region(w) != region {
            return None;
        }
        self.rough_label(path, i, w)
    }
}

/// Whether an end is on the wrong side of the first surface it would meet.
fn is_hopeless(bounces: &[Bounce], far: &Far, to: DVec3) -> bool {
    use crate::transport::aim::surface::Surface;
    let is_wrong = |surface: &Surface, x: DVec3, above: bool| match *surface {
        Surface::Plane { origin, normal } => ((x - origin).dot(normal) > 0.0) != above,
        Surface::Sphere { center, radius } => above && x.distance_squared(center) < radius * radius,
        Surface::Cylinder { .. } => false,
    };
    let (first, last) = (&bounces[0], &bounces[bounces.len() - 1]);
    let lost = match (*far, first.surface) {
        (Far::Point(x), _) => is_wrong(&first.surface, x, first.from_above),
        (Far::Direction(w), Surface::Plane { normal, .. }) => {
            (w.dot(normal) > 0.0) != first.from_above
        }
        _ => false,
    };
    lost || is_wrong(&last.surface, to, last.to_above())
}

impl Ends<'_> {
    /// The densities of x₀ … x_{b−1} as if they all had been made from the light, and the edge to x_b.
    fn densities(
        &self,
        (light, sensor): (&Reached, &Reached),
        (solved, segments): (&[Solved], &[(DVec3, f64)]),
        out: &mut Vec<VertexDensity>,
        columns: &mut Vec<crate::transport::density::Column>,
    ) -> Edge {
        let m = solved.len();
        let cos = |i: usize, w: DVec3| solved[i].place.ng.dot(w).abs();
        let d2 = |i: usize| segments[i].1 * segments[i].1;
        // of the chain's vertex i from the sensor side: what x_{i+1} sends there
        let from_sensor = |i: usize| {
            let (w, d2) = (segments[i + 1].0, d2(i + 1));
            match solved.get(i + 1) {
                Some(next) => EdgeDensity::uniform(next.backward * cos(i, w) / d2),
                None => sensor.across.area_density(cos(i, w), d2),
            }
        };
        let from_light = |i: usize| {
            let (w, d2) = (segments[i].0, d2(i));
            match i.checked_sub(1) {
                Some(before) => EdgeDensity::uniform(solved[before].forward * cos(i, w) / d2),
                None => light.across.area_density(cos(i, w), d2),
            }
        };
        let at_light = solved[0].backward * light.factor;
        if let LightEnd::Vertex(path, i) = self.light {
            out.extend_from_slice(&path.densities[..i + 2]);
            columns.extend_from_slice(&path.columns);
            let (own, before) = (&mut out[i..], &light.behind);
            own[0].other = before.hero;
            own[0].other_column = store(columns, before);
            own[1].other = at_light;
            own[1].other_column = NO_COLUMN;
            own[1].label = Label::NonSpecular;
            own[1].dispersive = false;
        } else {
            let mut start = VertexDensity::new(light.own);
            start.other = at_light;
            out.push(start);
        }
        for (i, vertex) in solved.iter().enumerate() {
            let (own, other) = (from_light(i), from_sensor(i));
            let mut density = VertexDensity::new(own.hero);
            density.own_column = store(columns, &own);
            density.other = other.hero;
            density.other_column = store(columns, &other);
            density.length = segments[i].1 as f32;
            density.label = vertex.label;
            density.dispersive = vertex.dispersive;
            out.push(density);
        }
        let end = &solved[m - 1];
        Edge {
            light_end: from_sensor(m - 1),
            light_before: match m.checked_sub(2) {
                Some(before) => from_sensor(before),
                None => EdgeDensity::uniform(at_light),
            },
            camera_end: EdgeDensity::uniform(end.forward * sensor.factor),
            camera_before: sensor.behind,
            light_label: end.label,
            camera_label: Label::NonSpecular,
            length: segments[m].1 as f32,
            light_dispersive: end.dispersive,
            camera_dispersive: false,
        }
    }
}

fn store(columns: &mut Vec<crate::transport::density::Column>, density: &EdgeDensity) -> u32 {
    match density.lanes {
        None => NO_COLUMN,
        Some(lanes) => {
            columns.push(lanes);
            (columns.len() - 1) as u32
        }
    }
}
