//! Fans: the chains by which every wavelength of a path goes from one point of the sensor to one
//! point of the scene, or out of it in one direction.
//!
//! A camera sub-path that was bent by dispersion carries its hero's wavelength alone, for the
//! others bend elsewhere. But from the first rough vertex behind, each of the others has a chain of
//! its own back to the same point of the sensor, which it reaches from another direction: it is
//! seen at another place of the film. Where all are known, any of the wavelengths could have
//! brought the walk to that vertex as its hero, and all go on from it together.
//!
//! Chains are followed from wavelength to wavelength, in their order, by Newton's method, and only
//! where its first step, forth and back, leads near the other chain: whoever of them starts finds
//! the same fan.

use super::passage;
use super::trail::{Place, chain_link, is_dispersive, places};
use super::{Bounce, Far, MAX_CHAIN, Points, Prims, differential, shooting};
use crate::bsdf::Lobe;
use crate::camera::CameraKind;
use crate::medium::MediumId;
use crate::scene::chains::ChainKind;
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use crate::transport::context::{Counters, PathContext};
use crate::transport::density::{Column, Departure};
use crate::transport::subpath::{Subpath, Vertex};
use crate::transport::throughput::Throughput;
use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};

/// Distance from a chain at which the first step towards it may arrive, in units of the way.
const STRAY: f64 = 0.25;
/// Angle at the sensor up to which two directions are one, in radians.
const SAME: f64 = 1e-8;

/// Place of a camera sub-path on the film, and what is sampled there.
#[derive(Clone, Copy)]
pub struct FilmPoint<'a> {
    /// In raster coordinates.
    pub raster: DVec2,
    /// Numbers of the point on the lens.
    pub u_lens: DVec2,
    /// How far outside the film samples are of use, in pixels.
    pub margin: f64,
    /// Expected number of camera sub-paths of a pass per pixel area at a raster position: 1 well
    /// inside of what is rendered.
    pub density: &'a dyn Fn(DVec2) -> f64,
}

/// Chains of all wavelengths of a path between the sensor and a vertex of a camera sub-path.
#[derive(Clone, Copy, Debug)]
pub struct Fan {
    /// The vertex where they meet, the first that is not specular; one past the last where they
    /// leave the scene together.
    pub vertex: usize,
    /// Where on the film each lane is seen.
    pub rasters: [DVec2; MAX_LANES],
    /// Mean of these, the same for whichever lane was the hero.
    pub raster: DVec2,
    /// Expected number of times that heroes bring a walk to the vertex, over that of lane j's walk
    /// and over the number of lanes: in place of 1 where lanes share one chain.
    pub shares: Column,
    /// Weight up to and including the arrival, of each lane along its own chain; 0 of lanes that
    /// have none.
    pub throughput: Throughput,
}

/// Light that the chain of one lane brings.
struct Member {
    raster: DVec2,
    /// Density of the meeting, per area or solid angle, where lane j's wavelength is the hero.
    density: f64,
    /// Weight along the chain.
    weight: f64,
}

/// The chain of one lane.
struct Chain {
    points: Points,
    prims: Prims,
    /// Solid angle at the sensor per area across its first segment at the vertex.
    jacobian: f64,
}

/// Where the lanes of a fan meet.
#[derive(Clone, Copy)]
pub enum Meeting<'a> {
    /// At the last vertex of the walk.
    Vertex(&'a Vertex),
    /// Infinitely far away in this unit direction, in which the walk has left the scene through a
    /// medium.
    Escape(DVec3, MediumId),
}

impl Meeting<'_> {
    fn far(&self) -> Far {
        match self {
            Self::Vertex(vertex) => Far::Point(vertex.p),
            Self::Escape(direction, _) => Far::Direction(*direction),
        }
    }

    /// The segment from there to a point, as unit direction and length.
    fn segment(&self, to: DVec3) -> (DVec3, f64) {
        match self {
            Self::Vertex(vertex) => {
                let length = to.distance(vertex.p);
                ((to - vertex.p) / length, length)
            }
            Self::Escape(direction, _) => (-*direction, f64::INFINITY),
        }
    }

    /// Cosine that a density has where unit direction `w` leaves it in `medium`; `None` where that
    /// is another one.
    fn cos(&self, w: DVec3, medium: MediumId) -> Option<f64> {
        match self {
            Self::Vertex(vertex) => {
                let leaves = vertex.sides_agree(w) && vertex.medium(w) == medium;
                leaves.then(|| vertex.cos(w))
            }
            Self::Escape(_, through) => (*through == medium).then_some(1.0),
        }
    }
}

/// Ends and surfaces of all chains of a fan.
struct Ways<'a> {
    context: &'a PathContext<'a>,
    path: &'a Subpath,
    meeting: Meeting<'a>,
    kind: ChainKind,
    bounces: ArrayVec<Bounce<'a>, MAX_CHAIN>,
    /// Indices of the segments, by lane.
    eta: ArrayVec<ArrayVec<f64, { MAX_CHAIN + 1 }>, MAX_LANES>,
    far: Far,
    to: DVec3,
}

/// The fan of a camera sub-path whose vertices before the meeting are all specular, some of them
/// dispersive; a vertex there sends light alike in all directions. `arrived` is the walk's weight.
/// `None` where its surfaces cannot be followed. `lobes` is overwritten.
pub fn open(
    context: &PathContext,
    (path, meeting): (&Subpath, Meeting),
    arrived: Throughput,
    film: &FilmPoint,
    lobes: &mut Vec<(f32, Lobe)>,
    counters: &mut Counters,
) -> Option<Fan> {
    let vertex = match meeting {
        Meeting::Vertex(_) => path.vertices.len() - 1,
        Meeting::Escape(..) => path.vertices.len(),
    };
    let camera = &context.scene.sensors[context.sensor].camera;
    if vertex > MAX_CHAIN || !matches!(camera.kind, CameraKind::Perspective(_)) {
        return None;
    }
    let (ways, hero) = Ways::of_walk(context, path, meeting, vertex)?;
    let count = context.count();
    let lambda = |j: usize| context.wavelengths.lambda_nm(j);
    let mut order: ArrayVec<usize, MAX_LANES> = (0..count).collect();
    order.sort_by(|&a, &b| lambda(a).total_cmp(&lambda(b)));
    let start = order.iter().position(|&j| j == 0)?;

    let mut known: [Option<Member>; MAX_LANES] = [const { None }; MAX_LANES];
    let of_hero = ways.member(film, &hero, 0, lobes, None)?;
    // what roulette has left out of the formula
    let kept = arrived.scale * f64::from(arrived.lanes[0]) / of_hero.weight;
    if !(kept.is_finite() && kept > 0.0) {
        return None;
    }
    known[0] = Some(of_hero);
    for side in [1, -1] {
        let mut at = start;
        let mut last: Option<Chain> = None;
        while let Some(next) = at.checked_add_signed(side).filter(|&i| i < count) {
            let (from, lane) = (order[at], order[next]);
            let Some(chain) = ways.step((from, lane), last.as_ref().unwrap_or(&hero)) else {
                break;
            };
            known[lane] = ways.member(film, &chain, lane, lobes, Some(&mut *counters));
            at = next;
            last = Some(chain);
        }
    }

    let sampled: [f64; MAX_LANES] = std::array::from_fn(|h| {
        let density = |of: &Member| (film.density)(of.raster);
        known[h].as_ref().map_or(0.0, density)
    });
    // a lane's own walk lands on its pixel, those of others beside it
    let density = |h: usize, j: usize| {
        let Some(of) = &known[h] else { return 0.0 };
        let of_lane = lambda(h) == lambda(j);
        of.density * if of_lane { 1.0 } else { sampled[h] }
    };
    let mut fan = Fan {
        vertex,
        rasters: [film.raster; MAX_LANES],
        raster: DVec2::ZERO,
        shares: [1.0; MAX_LANES],
        throughput: Throughput::splat(0.0),
    };
    let mut weights = [0.0; MAX_LANES];
    let mut members = 0.0;
    for j in 0..count {
        let Some(of) = &known[j] else { continue };
        fan.rasters[j] = of.raster;
        fan.raster += of.raster;
        members += 1.0;
        weights[j] = of.weight * kept;
        let all: f64 = (0..count).map(|h| density(h, j)).sum();
        fan.shares[j] = all / (of.density * count as f64);
    }
    fan.raster /= members;
    let scale = weights.iter().copied().fold(0.0, f64::max);
    fan.throughput = Throughput {
        scale,
        lanes: SampledSpectrum::from_fn(|j| (weights[j] / scale) as f32),
    };
    Some(fan)
}

impl<'a> Ways<'a> {
    /// Those of the chain that the walk has taken, and this.
    fn of_walk(
        context: &'a PathContext<'a>,
        path: &'a Subpath,
        meeting: Meeting<'a>,
        count: usize,
    ) -> Option<(Self, Chain)> {
        let specular = &path.vertices[..count];
        let chains = context.scene.chains();
        let mut kind = ChainKind::new();
        let (mut points, mut prims) = (Points::new(), Prims::new());
        for (i, vertex) in specular.iter().enumerate().rev() {
            let toward_light = match specular.get(i + 1) {
                Some(next) => next.p - vertex.p,
                None => meeting.far().direction_from(vertex.p),
            };
            let place = Place::from(vertex);
            let is_simple = context.scene.is_simple(&place.surface_point());
            if !is_simple || context.scene.object(vertex.id.instance).has_normal_map {
                return None;
            }
            let toward_sensor = vertex.toward_previous;
            kind.push(chain_link(chains, &place, toward_light, toward_sensor));
            points.push(vertex.p);
            prims.push(vertex.id.prim);
        }
        if !is_dispersive(context, &kind) {
            return None;
        }
        let indices = |lane: usize| {
            let index = |medium: MediumId| context.medium(medium).eta[lane];
            let mut eta = ArrayVec::new();
            eta.push(index(kind[0].before()));
            eta.extend(kind.iter().map(|link| index(link.after())));
            eta
        };
        let ways = Self {
            context,
            path,
            bounces: places(context, &kind)?,
            eta: (0..context.count()).map(indices).collect(),
            far: meeting.far(),
            to: path.origin.p,
            meeting,
            kind,
        };
        let mut on = ways.bounces.clone();
        for (bounce, &prim) in on.iter_mut().zip(&prims) {
            *bounce = bounce.at(prim);
        }
        let jacobian = differential::jacobian(&on, &points, &ways.eta[0], &ways.far, ways.to);
        let chain = Chain {
            points,
            prims,
            jacobian,
        };
        Some((ways, chain))
    }

    /// The chain at the wavelength of one lane from that at another's, where each leads to the
    /// other: the first steps of both arrive, in the main, where the other is.
    fn step(&self, (from, lane): (usize, usize), chain: &Chain) -> Option<Chain> {
        let (bounces, far, to) = (&self.bounces, &self.far, self.to);
        let direction = |points: &Points| (points[points.len() - 1] - to).normalize();
        let start = direction(&chain.points);
        let found = shooting::follow(bounces, &self.eta[lane], far, to, start)?;
        let end = direction(&found.points);
        let apart = STRAY * start.distance(end) + SAME;
        if found.first.distance(end) > apart {
            return None;
        }
        let back = shooting::first_step(bounces, &self.eta[from], far, to, end)?;
        (back.distance(start) <= apart).then_some(Chain {
            points: found.points,
            prims: found.prims,
            jacobian: found.jacobian,
        })
    }

    /// Weight and density of a chain; `None` where it leaves its faces, something is in its way
    /// (asked only with `counters`), or the film does not see it.
    fn member(
        &self,
        film: &FilmPoint,
        chain: &Chain,
        lane: usize,
        lobes: &mut Vec<(f32, Lobe)>,
        counters: Option<&mut Counters>,
    ) -> Option<Member> {
        let Self {
            context, path, to, ..
        } = *self;
        let scene = context.scene;
        let sensor = &scene.sensors[context.sensor];
        let (kind, points) = (&self.kind, &chain.points);
        let m = points.len();

        let faces = passage::faces(context, kind, points, &chain.prims)?;
        let segments = passage::segments(self.meeting.segment(points[0]), points, to);
        let cos = self.meeting.cos(segments[0].0, kind[0].before())?;
        let (camera, moment) = (&sensor.camera, context.moment());
        let seen = camera.sample_connection(points[m - 1], film.u_lens, moment, film.margin)?;
        let (_, direction) = camera.density(to, -segments[m].0, moment);

        let mut weight = f64::from(context.eta_squared(sensor.stack.medium())[lane]);
        let mut density = Departure::Start(direction).solid_angle().hero;
        let transmittance = |medium: MediumId, length: f64| {
            let medium = context.medium(medium);
            if medium.is_clear() {
                return 1.0;
            }
            f64::from(medium.transmittance(length, context.count())[lane])
        };
        let mut all: ArrayVec<Place, MAX_CHAIN> = ArrayVec::new();
        for (i, (link, bounce)) in kind.iter().zip(&self.bounces).enumerate() {
            let bounce = &bounce.at(chain.prims[i]);
            let (place, value, label) = passage::toward_sensor(
                context,
                lobes,
                (link, bounce),
                (faces[i], points[i]),
                segments[i + 1].0,
            );
            // of the walk's own they are known to be
            if counters.is_some() && !scene.is_simple(&place.surface_point()) {
                return None;
            }
            let open = transmittance(link.before(), segments[i].1);
            weight *= f64::from(value[lane]) / label * open;
            density *= label;
            all.push(place);
        }
        weight *= transmittance(kind[m - 1].after(), segments[m].1);
        density *= chain.jacobian * cos;
        if !(density.is_finite() && weight.is_finite() && density > 0.0 && weight > 0.0) {
            return None;
        }
        if let Some(counters) = counters {
            let met = match self.meeting {
                Meeting::Vertex(vertex) => Some(vertex.id),
                Meeting::Escape(..) => None,
            };
            let start = (to, path.origin.surface);
            let rays = passage::rays(&segments, points, &faces, start, met);
            if passage::visibility(context, &all, &rays, path.start_stack(), counters) == 0.0 {
                return None;
            }
        }
        Some(Member {
            raster: seen.raster,
            density,
            weight,
        })
    }
}
