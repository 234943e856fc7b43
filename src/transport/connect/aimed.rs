//! Bridges: two ends joined by a chain of specular vertices that is solved for.

mod reach;

use super::{Candidate, Joiner, Numerator};
use crate::geometry::EndPoint;
use crate::light::{LightId, LightKind};
use crate::medium::MediumStack;
use crate::sampler::{Draw, Sampler};
use crate::scene::chains::ChainKind;
use crate::spectrum::SampledSpectrum;
use crate::transport::aim::passage::{self, Solved};
use crate::transport::aim::surface::Surface;
use crate::transport::aim::trail::{self, Place, Placed, Trail};
use crate::transport::aim::tries::{Origin, Tries};
use crate::transport::aim::{Bounce, Far, MAX_CHAIN, Points, Prims, differential, solve};
use crate::transport::contribution::Target;
use crate::transport::density::{PathView, VertexDensity};
use crate::transport::subpath::Subpath;
use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};

/// Most chains of one kind between two ends: more have not been seen.
const MOST_CHAINS: usize = 16;

/// A point of a light that chains lead to.
#[derive(Clone, Copy)]
struct Start {
    id: LightId,
    x0: EndPoint,
    /// Density of the point as light is emitted, the choice of the light included.
    pdf: f64,
    stack: MediumStack,
}

impl Start {
    /// The start of a light sub-path on the light `id`.
    fn of(light: &Subpath, id: LightId) -> Self {
        Self {
            id,
            x0: light.origin,
            pdf: light.densities[0].own,
            stack: *light.start_stack(),
        }
    }
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

/// Chains tried from an origin.
struct TriesFrom<'a> {
    tries: Option<&'a Tries>,
    sampler: Sampler<'a>,
    origin: Origin,
    listed: usize,
}

impl<'a> TriesFrom<'a> {
    /// Kinds, by index, that this sample tries; `draw` numbers the vertex.
    fn kinds(self, draw: usize) -> impl Iterator<Item = usize> + use<'a> {
        let Self { tries, origin, .. } = self;
        let all = if tries.is_some() { 0 } else { self.listed };
        let drawn = tries.filter(|tries| tries.has_any(origin)).map(|tries| {
            let u = self.sampler.number(Draw::AimTries(draw));
            tries.drawn(origin, u)
        });
        (0..all).chain(drawn.into_iter().flatten())
    }
}

/// Vertex `i` of a sub-path as one that aims.
fn origin(path: &Subpath, i: usize, at_sensor: bool) -> Origin {
    let before = &path.densities[1..=i];
    Origin::Vertex {
        at_sensor,
        first: before.iter().all(|d| d.label.is_specular()),
        after_specular: before.last().is_some_and(|d| d.label.is_specular()),
    }
}

impl<'a> Joiner<'a> {
    fn tries(&self, origin: Origin) -> TriesFrom<'a> {
        TriesFrom {
            tries: self.strategies.tries,
            sampler: self.sampler,
            origin,
            listed: self.context.scene.chains().kinds().len(),
        }
    }

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
        if !aims.light {
            return;
        }
        let origin = origin(camera, j, false);
        if !self.aims_from(camera, j, aims.light_everywhere || origin.is_needed()) {
            return;
        }
        let context = self.context;
        let media = &camera.vertices[j].media;
        let mut start = None;
        for kind in self.tries(origin).kinds(2 * j) {
            let links = &context.scene.chains().kinds()[kind];
            let (first, last) = (&links[0], &links[links.len() - 1]);
            if !media.contains(&last.after()) || j + 1 + links.len() > self.max_depth {
                continue;
            }
            if start.is_none() {
                let Some(drawn) = self.draw_start(Draw::AimLight(j)) else {
                    return;
                };
                start = Some(drawn);
            }
            let Some(start) = start.filter(|s| s.stack.medium() == first.before()) else {
                continue;
            };
            let ends = Ends {
                start,
                light: LightEnd::Start,
                sensor: SensorEnd::Vertex(camera, j),
                margin: 0.0,
            };
            self.aim(&ends, kind, origin);
        }
    }

    /// Light vertex `i` aims at the sensor through chains.
    pub fn aim_at_sensor(&mut self, light: &Subpath, i: usize, margin: f64) {
        let aims = self.strategies.aims;
        let (Some(id), true) = (light.light, aims.sensor) else {
            return;
        };
        let origin = origin(light, i, true);
        let everywhere = aims.sensor_everywhere || origin.is_needed();
        let has_fan = self.strategies.fans && light.vertices[i].is_lambertian;
        if !self.aims_from(light, i, everywhere || self.context.count() > 1 && !has_fan) {
            return;
        }
        let context = self.context;
        let media = &light.vertices[i].media;
        let start = Start::of(light, id);
        let mut point = None;
        for kind in self.tries(origin).kinds(2 * i + 3) {
            let links = &context.scene.chains().kinds()[kind];
            let (first, last) = (&links[0], &links[links.len() - 1]);
            if !media.contains(&first.before())
                || last.after() != self.sensor_medium()
                || i + 1 + links.len() > self.max_depth
                || !everywhere && !trail::is_dispersive(context, links)
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
            self.aim(&ends, kind, origin);
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
        let start = Start::of(light, id);
        let mut point = None;
        for kind in self.tries(Origin::Start).kinds(1) {
            let links = &context.scene.chains().kinds()[kind];
            let (first, last) = (&links[0], &links[links.len() - 1]);
            if start.stack.medium() != first.before()
                || last.after() != self.sensor_medium()
                || links.len() > self.max_depth
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
            self.aim(&ends, kind, Origin::Start);
        }
    }

    /// A start on a light, as light is emitted.
    fn draw_start(&self, draw: Draw) -> Option<Start> {
        let u = self.sampler.set(draw);
        let scene = self.context.scene;
        let (id, probability, u0) = scene.selection.sample(u[0])?;
        let light = self.light(id);
        let u_x0 = DVec2::new(u[1], u[2]);
        let (x0, pdf_x0) = light.sample_start(&scene.geometry, u0, u_x0)?;
        Some(Start {
            id,
            x0,
            pdf: probability * pdf_x0,
            stack: *scene.light_stack(id),
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
    fn aim(&mut self, ends: &Ends, kind: usize, origin: Origin) {
        let kinds = self.context.scene.chains().kinds();
        let at = origin.number() * kinds.len() + kind;
        let rays = self.counters.shadow_rays;
        let (solved, found) = self.aim_lanes(ends, &kinds[kind]);
        self.counters.chains_tried += solved;
        self.counters.chains_found += found;
        if let Some(tally) = self.scratch.tally.get_mut(at) {
            tally.solved += solved;
            tally.found += found;
            tally.rays += self.counters.shadow_rays - rays;
        }
    }

    /// The same; numbers of searches and of chains found.
    fn aim_lanes(&mut self, ends: &Ends, kind: &ChainKind) -> (u64, u64) {
        let mut counts = (0, 0);
        let lanes = if trail::is_dispersive(self.context, kind) {
            self.context.count()
        } else {
            1
        };
        let far = match ends.light {
            LightEnd::Vertex(path, i) => Far::Point(path.vertices[i].p),
            LightEnd::Start if ends.start.x0.parallel => Far::Direction(-ends.start.x0.n),
            LightEnd::Start => Far::Point(ends.start.x0.p),
        };
        let to = match ends.sensor {
            SensorEnd::Vertex(path, j) => path.vertices[j].p,
            SensorEnd::Sensor(x, _) => x.p,
        };
        // of what is lit through chains, the sensor sees one wavelength through its own
        let hero = match (&self.fan, &ends.sensor) {
            (Some(fan), SensorEnd::Vertex(_, j)) if fan.vertex == *j => self.context.hero_lanes(),
            _ => SampledSpectrum::ONE,
        };
        for lane in 0..lanes {
            let alive = |path: &Subpath, i: usize| {
                path.vertices[i].throughput.lanes[lane] * hero[lane] > 0.0
            };
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
            counts.0 += 1;
            let mut found: ArrayVec<(Points, Prims), MOST_CHAINS> = ArrayVec::new();
            solve(&chain.0, &chain.1, &far, to, |points, prims| {
                // beyond so many the path has no bridge that counts, but there never are
                let _ = found.try_push((points.clone(), prims.clone()));
            });
            let only = (lanes > 1).then_some(lane);
            counts.1 += found.len() as u64;
            for at in &found {
                self.bridge(ends, kind, &chain, at, (&far, to), only);
            }
        }
        counts
    }

    /// The contribution of one chain.
    fn bridge(
        &mut self,
        ends: &Ends,
        kind: &ChainKind,
        (bounces, eta): &Placed,
        (points, prims): &(Points, Prims),
        (far, to): (&Far, DVec3),
        only: Option<usize>,
    ) -> Option<()> {
        let context = self.context;
        let scene = context.scene;
        let m = points.len();
        let faces = passage::faces(context, kind, points, prims)?;
        let on: ArrayVec<Bounce, MAX_CHAIN> = (bounces.iter().zip(prims))
            .map(|(bounce, &prim)| bounce.at(prim))
            .collect();
        let first = match *far {
            Far::Point(x) => ((points[0] - x).normalize(), x.distance(points[0])),
            Far::Direction(w) => (-w, f64::INFINITY),
        };
        let mut segments = passage::segments(first, points, to);
        let last = segments[m];
        let at_light = self.reach_light(ends, segments[0], points[0], kind[0].before())?;
        let x0 = match ends.light {
            // in a beam it is known only now
            LightEnd::Start => at_light.point,
            LightEnd::Vertex(..) => ends.start.x0,
        };
        if matches!(far, Far::Direction(_)) && !x0.infinite {
            segments[0].1 = x0.p.distance(points[0]);
        }
        let at_sensor = self.reach_sensor(ends, last, points[m - 1], kind[m - 1].after())?;

        let jacobian = differential::jacobian(&on, points, eta, far, to);
        let media =
            [kind[0].before(), kind[m - 1].after()].map(|medium| context.eta_squared(medium));
        let mut lanes = at_light.weight.lanes * at_sensor.weight.lanes * media[1];
        if matches!(ends.light, LightEnd::Start) {
            lanes *= SampledSpectrum::ONE / media[0];
        }
        let mut solved: ArrayVec<Solved, MAX_CHAIN> = ArrayVec::new();
        for (i, (link, bounce)) in kind.iter().zip(&on).enumerate() {
            let at = (faces[i], points[i]);
            let (vertex, value) = passage::solved(
                context,
                &mut self.scratch.lobes,
                (link, bounce),
                at,
                &segments[i..i + 2],
            );
            lanes *= value;
            lanes *= context
                .medium(link.before())
                .transmittance(segments[i].1, context.count());
            solved.push(vertex);
        }
        lanes *= context
            .medium(kind[m - 1].after())
            .transmittance(last.1, context.count());
        if let Some(lane) = only {
            lanes = SampledSpectrum::from_fn(|k| if k == lane { lanes[k] } else { 0.0 });
        }
        if lanes.is_black(context.count()) {
            return None;
        }
        let is_alone = |s: &Solved| scene.is_simple(&s.place.surface_point());
        if !solved.iter().all(is_alone) {
            return None;
        }
        let numerator = Numerator {
            scale: at_light.weight.scale * at_sensor.weight.scale * jacobian,
            lanes,
        };

        let sensor_end = (to, at_sensor.surface);
        let shadow = passage::rays(&segments, points, &faces, sensor_end, at_light.surface);

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
            LightEnd::Start => context.direct_density(ends.start.id, points[0], &x0),
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
                fan: None,
                emitter: ends.start.id,
                raster: match at_sensor.target {
                    Target::OwnPixel => self.raster,
                    Target::Splat(raster) => raster,
                },
            },
            trail: Trail {
                x0,
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
            bridge: Some((a, a + 1 + m)),
            lane: only.unwrap_or(0),
            target: at_sensor.target,
            open: None,
        };
        self.finish(&numerator, &candidate, &shadow, &at_sensor.stack);
        self.scratch.bridged = densities;
        self.scratch.columns = columns;
        Some(())
    }
}

/// Whether an end is on the wrong side of the first surface it would meet, or outside of one that
/// it would meet from the inside.
fn is_hopeless(bounces: &[Bounce], far: &Far, to: DVec3) -> bool {
    let (first, last) = (&bounces[0], &bounces[bounces.len() - 1]);
    let is_wrong = |surface: &Surface, x: DVec3, above: bool| {
        let is_other_side = surface
            .is_above(x)
            .is_some_and(|is_above| is_above != above);
        is_other_side || !above && surface.hides_inside_from(x)
    };
    let lost = match (*far, first.surface) {
        (Far::Point(x), _) => is_wrong(&first.surface, x, first.from_above),
        (Far::Direction(w), Surface::Plane { normal, .. }) => {
            (w.dot(normal) > 0.0) != first.from_above
        }
        _ => false,
    };
    lost || is_wrong(&last.surface, to, last.to_above())
}
