//! The random walk: one function for light and camera sub-paths.
//!
//! A camera walk generates ω⁻ at each vertex, a light walk ω⁺. In basic radiance the throughput
//! factor is the same for both, but for interpolated normals, whose correction always belongs to
//! the light side.

use super::aim::fan::{self, FilmPoint, Meeting};
use super::context::{Counters, PathContext};
use super::density::{Departure, EdgeDensity, VertexDensity};
use super::subpath::{Escape, LightHit, SensorHit, Subpath, Vertex};
use super::throughput::Throughput;
use crate::bsdf::{BsdfSample, Lobe, Side};
use crate::geometry::{DirectionalDensity, EndPoint, Faces, Ray, SurfacePoint};
use crate::math::frame::Frame;
use crate::medium::{MediumId, MediumStack};
use crate::sampler::{Draw, Sampler};
use crate::scene::Scene;
use crate::scene::crossing::{cross_alone, resolve};
use glam::DVec3;
use std::mem;

/// From how many vertices on a sub-path whose weight does not fall is killed now and then, so that
/// every walk ends.
const ENDLESS_AFTER: usize = 64;
/// Survival there.
const ENDLESS_SURVIVAL: f64 = 0.95;
/// Vertices at which roulette is not played yet.
const ROULETTE_AFTER: usize = 2;
/// Survival of a camera walk per weight relative to its start: a vertex of it is joined to lights,
/// which brings more than a vertex of a light walk, and what a killed walk would have brought is
/// noise of its pixel.
const CAMERA_SURVIVAL: f64 = 2.0;

/// Start of a walk.
#[derive(Clone, Copy)]
pub struct Start<'a> {
    /// First ray.
    pub ray: Ray,
    /// The solids its origin is in.
    pub stack: MediumStack,
    /// Weight along the first ray.
    pub throughput: Throughput,
    /// Density of the first direction.
    pub pdf: DirectionalDensity,
    /// Length of the first segment does not count (the start lies at infinity).
    pub infinite: bool,
    /// The side its directions lead to: `Side::Light` for a camera walk.
    pub generate: Side,
    /// At most this many scattering vertices.
    pub max_vertices: usize,
    /// Ends at the first vertex that scatters under a non-specular label.
    pub specular_only: bool,
    /// Where on the film a camera walk is, if all its wavelengths go on from the first rough vertex
    /// behind dispersion.
    pub film: Option<FilmPoint<'a>>,
}

/// Where the lobes of a vertex are, and what is among them.
struct VertexLobes {
    first: u32,
    count: u8,
    has_non_specular: bool,
    has_specular: bool,
    is_lambertian: bool,
}

impl VertexLobes {
    #[inline]
    fn new(first: usize, lobes: &[(f32, Lobe)]) -> Self {
        if let [(_, Lobe::Diffuse(_))] = lobes {
            // most surfaces
            return Self {
                first: first as u32,
                count: 1,
                has_non_specular: true,
                has_specular: false,
                is_lambertian: true,
            };
        }
        Self {
            first: first as u32,
            count: lobes.len() as u8,
            has_non_specular: lobes.iter().any(|(_, lobe)| !lobe.is_specular()),
            has_specular: lobes.iter().any(|(_, lobe)| lobe.is_specular()),
            is_lambertian: lobes
                .iter()
                .all(|(_, lobe)| matches!(lobe, Lobe::Diffuse(_))),
        }
    }
}

/// Random walk from `start`: appends vertices to the freshly restarted `path`. `end_factor` is the
/// Jacobian from solid angle at the first vertex to the measure of the start.
///
/// One number plays roulette at all vertices: where the walk survives, it is below the probability,
/// and divided by that it is uniform again. Stratified over the passes, it gives every length of
/// path its share of them; numbers of their own for each vertex leave that to chance.
pub fn walk(
    context: &PathContext,
    path: &mut Subpath,
    start: Start,
    sampler: &Sampler,
    counters: &mut Counters,
    end_factor: impl Fn(&Vertex) -> f64,
) {
    let scene = context.scene;
    let Start {
        mut ray,
        mut stack,
        mut throughput,
        pdf,
        infinite,
        generate,
        max_vertices,
        specular_only,
        mut film,
    } = start;
    let reference = throughput.max_lane(context.count());
    let keep = match generate {
        Side::Light => CAMERA_SURVIVAL,
        Side::Camera => 1.0,
    };
    let has_passed = !scene.passed.is_empty();
    let has_reverse = match generate {
        Side::Light => context.asked.from_light,
        Side::Camera => context.asked.from_sensor,
    };
    let mut travel = Departure::Start(pdf);
    let mut roulette = 0.0;
    // by dispersion
    let mut bent = false;
    // distance passed since the last vertex, through surfaces that are none
    let mut passed = if infinite { f64::INFINITY } else { 0.0 };
    // what it is in, and what the surface it has come to leads into, where that is another stack
    let mut medium = stack.medium();
    let (mut behind, mut changes);
    // where the sub-path has the present stack
    let mut here = 0;
    // partly covered surfaces met since then
    let mut crossings = 0;
    loop {
        counters.closest_rays += 1;
        let is_visible = |id| !has_passed || !scene.object(id).is_passed;
        let found = scene.closest_point(&ray, is_visible);
        if has_passed && generate == Side::Camera {
            let length = found.map_or(f64::INFINITY, |(hit, _)| hit.t);
            for &(id, sensor) in &scene.passed {
                if !context.reads(sensor) {
                    continue;
                }
                scene
                    .geometry
                    .hits_of(&ray.ending(length, None), id, |hit| {
                        let point = scene.geometry.surface(&ray, &hit);
                        record_sensor_hit(
                            context,
                            sensor,
                            path,
                            &point,
                            ray.d,
                            passed + hit.t,
                            &stack,
                            &travel,
                            throughput,
                        );
                    });
            }
        }
        let Some((hit, point)) = found else {
            let own = travel.solid_angle();
            let mut density = VertexDensity::new(own.hero);
            density.own_column = path.store_column(&own);
            path.densities.push(density);
            if let Some(film) = &film
                && bent
            {
                let escape = Some((ray.d, medium));
                throughput = open_fan(context, path, escape, throughput, film, counters);
            }
            path.escape = Some(Escape {
                direction: ray.d,
                medium,
                throughput,
            });
            return;
        };
        let mut point = match point {
            Some(point) => point,
            None => scene.geometry.surface(&ray, &hit),
        };
        let distance = passed + hit.t;
        // most surfaces have their place for themselves
        let mut gathered = Faces::new();
        let is_simple = scene.is_simple(&point);
        if !is_simple {
            gathered.extend(scene.faces_at(&point));
            // what is not there, or senses and lets pass, is no part of the crossing
            gathered.retain(|face| {
                let object = scene.object(face.point.id.instance);
                if object.transparent_sensor {
                    if let (Some(sensor), Side::Camera) = (object.sensor, generate)
                        && context.reads(sensor)
                    {
                        record_sensor_hit(
                            context,
                            sensor,
                            path,
                            &face.point,
                            ray.d,
                            distance,
                            &stack,
                            &travel,
                            throughput,
                        );
                    }
                    return false;
                }
                if !object.has_alpha {
                    return true;
                }
                let vertices = path.vertices.len();
                let draw = match generate {
                    Side::Light => Draw::CameraCoverage(vertices, crossings),
                    Side::Camera => Draw::LightCoverage(vertices, crossings),
                };
                crossings += 1;
                !passes_through_opening(&scene, &face.point, || sampler.number(draw))
            });
            if gathered.is_empty() {
                ray = Ray::leaving(point.p, ray.d, Some(point.id));
                passed = distance;
                continue;
            }
        }
        behind = stack;
        let (clear, mismatch);
        let mut met = None;
        if is_simple {
            let Ok(alone) = cross_alone(&scene.objects, &point, ray.d, &mut behind) else {
                counters.nesting_overflows += 1;
                return;
            };
            (mismatch, changes) = (alone.mismatch, alone.changes);
            clear = alone.clear && (!changes || behind.medium() == medium);
        } else {
            let Ok(crossing) = resolve(&scene.objects, &gathered, &stack, ray.d) else {
                counters.nesting_overflows += 1;
                return;
            };
            (clear, mismatch) = (crossing.clear, crossing.mismatch);
            changes = crossing.behind.is_some();
            behind = crossing.behind.unwrap_or(stack);
            met = Some(crossing.met);
        }
        if let Some(instance) = mismatch {
            counters.add_mismatch(instance);
        }
        if clear {
            ray = Ray::leaving(point.p, ray.d, Some(point.id));
            passed = distance;
            if changes {
                (stack, medium) = (behind, behind.medium());
                here = path.store_stack(&stack);
            }
            continue;
        }
        if let Some(met) = met {
            point = gathered[met].point;
        }
        let object = scene.object(point.id.instance);
        let entering = ray.d.dot(point.ng) < 0.0;
        if let Some(sensor) = object.sensor {
            if generate == Side::Camera && context.reads(sensor) {
                record_sensor_hit(
                    context, sensor, path, &point, ray.d, distance, &stack, &travel, throughput,
                );
            }
            return;
        }
        if path.vertices.len() >= max_vertices {
            return;
        }
        let index = path.vertices.len();
        let step = context.held.and_then(|h| h.sequence.step(generate, index));
        if let Some(held) = context.held {
            let goes_on = match step {
                Some(step) => step.is_on(point.id.instance),
                // behind all of its sequence a camera sub-path may have arrived at a light
                None => {
                    index == held.sequence.count()
                        && generate == Side::Light
                        && object.light.is_some()
                }
            };
            if !goes_on {
                return;
            }
        }

        let filled = context.medium(medium);
        if !filled.is_clear() {
            throughput = throughput.times(&filled.transmittance(distance, context.count()));
        }
        let geometric_cos = ray.d.dot(point.ng).abs();
        let own = travel.area_density(geometric_cos, distance * distance);
        let there = if changes {
            path.store_stack(&behind)
        } else {
            here
        };
        let (mut media, mut stacks) = ([medium, behind.medium()], [here, there]);
        if !entering {
            media.reverse();
            stacks.reverse();
        }
        let ns = scene.shading_normal(&point);
        if let (Some(light), Side::Light) = (object.light, generate) {
            path.light_hits.push(LightHit {
                vertex: index,
                light,
                uv: point.uv,
            });
        }
        let interface = context.interface(media, point.id.instance);
        let lobes = if object.is_smooth_interface {
            VertexLobes {
                first: path.clear_lobe(),
                count: 1,
                has_non_specular: false,
                has_specular: true,
                is_lambertian: false,
            }
        } else {
            let first = path.lobes.len();
            scene.material(object.material).push_lobes(
                point.uv,
                &context.wavelengths,
                &interface,
                &mut path.lobes,
            );
            VertexLobes::new(first, &path.lobes[first..])
        };
        path.vertices.push(Vertex {
            p: point.p,
            ng: point.ng,
            frame: Frame::from_z(ns),
            id: point.id,
            media,
            stacks,
            toward_previous: -ray.d,
            distance,
            throughput,
            first_lobe: lobes.first,
            lobes: lobes.count,
            has_non_specular: lobes.has_non_specular,
            has_specular: lobes.has_specular,
            is_lambertian: lobes.is_lambertian,
        });
        let mut density = VertexDensity::new(own.hero);
        density.own_column = path.store_column(&own);
        density.length = distance as f32;
        path.densities.push(density);
        if let Some(film) = &film
            && bent
            && lobes.is_lambertian
        {
            let opened = open_fan(context, path, None, throughput, film, counters);
            path.vertices[index].throughput = opened;
        }

        // An end of the walk leaves its last vertex as an end point of connections.
        let vertex = &path.vertices[index];
        if !vertex.sides_agree(vertex.toward_previous) {
            return;
        }
        let draw = match generate {
            Side::Light => Draw::Camera(index),
            Side::Camera => Draw::Light(index),
        };
        let given = vertex.toward_previous;
        let [u_label, u_x, u_y, u_roulette] = sampler.set(draw);
        let scatterer = path.scatterer_between(index, interface);
        let sampled = match (step, context.held) {
            (Some(step), _) => scatterer.sample_label(given, step.label),
            (None, Some(_)) => None,
            (None, None) => scatterer.sample(given, generate, [u_label, u_x, u_y]),
        };
        let Some(sample) = sampled else {
            return;
        };
        let w = sample.w;
        if !vertex.sides_agree(w) {
            return;
        }
        throughput = next_throughput(context, vertex, &sample, w, generate);
        if has_reverse {
            let reverse =
                EdgeDensity::with_lanes(sample.pdf_reverse, sample.columns.as_ref().map(|c| &c.1));
            finish_previous(path, index, &reverse, &end_factor);
        }
        let density = &mut path.densities[index + 1];
        density.label = sample.label;
        density.dispersive = sample.dispersive;
        bent |= sample.dispersive;
        if !sample.label.is_specular() {
            film = None;
        }
        if specular_only && !sample.label.is_specular() {
            return;
        }
        // what is held to a sequence ends with it, however faint
        let played = if step.is_some() { 0 } else { index };
        let weight = throughput.max_lane(context.count()) / reference;
        let survival = survival(played, keep * weight);
        if index == 0 {
            roulette = u_roulette;
        }
        if roulette >= survival {
            return;
        }
        // below 1 whatever rounds
        roulette = (roulette / survival).min(1.0 - f64::EPSILON);
        throughput = throughput.scaled(1.0 / survival);
        let vertex = &path.vertices[index];
        if changes && (w.dot(vertex.ng) > 0.0) != (vertex.toward_previous.dot(vertex.ng) > 0.0) {
            (stack, medium) = (behind, behind.medium());
            here = there;
        }
        travel = Departure::Scattered(EdgeDensity::with_lanes(
            sample.pdf,
            sample.columns.as_ref().map(|c| &c.0),
        ));
        ray = Ray::leaving(vertex.p, w, Some(vertex.id));
        passed = 0.0;
        crossings = 0;
    }
}

/// Opens the fan of a walk that has come to its last vertex, or has left the scene in a direction
/// through a medium. The weight with which all lanes go on, `arrived` where there is none.
fn open_fan(
    context: &PathContext,
    path: &mut Subpath,
    escape: Option<(DVec3, MediumId)>,
    arrived: Throughput,
    film: &FilmPoint,
    counters: &mut Counters,
) -> Throughput {
    let mut spare = mem::take(&mut path.spare);
    let met = match escape {
        Some((direction, medium)) => Meeting::Escape(direction, medium),
        None => Meeting::Vertex(&path.vertices[path.vertices.len() - 1]),
    };
    path.fan = fan::open(context, (path, met), arrived, film, &mut spare, counters);
    path.spare = spare;
    path.fan.map_or(arrived, |fan| fan.throughput)
}

/// Stochastic alpha test: whether a walk goes straight on at a surface that covers only in part,
/// with the probability of what it leaves open, which is also the factor of the segment. Both
/// cancel in the throughput, and weights leave them out on both sides.
fn passes_through_opening(scene: &Scene, point: &SurfacePoint, u: impl FnOnce() -> f64) -> bool {
    let coverage = scene.coverage(point);
    coverage == 0.0 || coverage < 1.0 && u() >= coverage
}

/// Probability of going on after vertex `index`, `weight` where this is below 1. It may depend
/// on anything, since the weights of strategies leave it out on both sides. A weight that is not a
/// number ends the walk.
fn survival(index: usize, weight: f64) -> f64 {
    if index < ROULETTE_AFTER {
        return if weight > 0.0 { 1.0 } else { 0.0 };
    }
    let most = if index < ENDLESS_AFTER {
        1.0
    } else {
        ENDLESS_SURVIVAL
    };
    if weight > 0.0 { weight.min(most) } else { 0.0 }
}

/// Weight after scattering at `vertex` into `w`, in basic units. [theory (1.7), (1.8), (1.10)]
fn next_throughput(
    context: &PathContext,
    vertex: &Vertex,
    sample: &BsdfSample,
    w: DVec3,
    generate: Side,
) -> Throughput {
    let mut next = vertex.throughput.times(&sample.weight);
    if sample.dispersive && context.count() > 1 {
        next.lanes *= context.hero_lanes();
    }
    if vertex.frame.z == vertex.ng {
        return next;
    }
    match generate {
        Side::Light => next,
        // the correction of the light side's direction, which a light walk arrives from, and the
        // measure of the other
        Side::Camera => next.scaled(
            vertex.light_side_correction(vertex.toward_previous) / vertex.light_side_correction(w),
        ),
    }
}

/// Once the direction after vertex `index` is known, the vertex before it has its density from the
/// other side. [theory (2.1)]
fn finish_previous(
    path: &mut Subpath,
    index: usize,
    reverse: &EdgeDensity,
    end_factor: &impl Fn(&Vertex) -> f64,
) {
    let factor = path.factor_before(index, || end_factor(&path.vertices[index]));
    let other = reverse.scaled(factor);
    let column = path.store_column(&other);
    path.densities[index].other = other.hero;
    path.densities[index].other_column = column;
}

/// Notes a light sub-path's arrival at a detector, be it the one that is being rendered or not.
#[allow(clippy::too_many_arguments)]
fn record_sensor_hit(
    context: &PathContext,
    sensor: usize,
    path: &mut Subpath,
    point: &SurfacePoint,
    direction: DVec3,
    distance: f64,
    stack: &MediumStack,
    travel: &Departure,
    throughput: Throughput,
) {
    let camera = &context.scene.sensors[sensor].camera;
    let Some((raster, importance)) = camera.arrive(point, -direction, context.moment()) else {
        return;
    };
    let own = travel.area_density(direction.dot(point.ng).abs(), distance * distance);
    let mut density = VertexDensity::new(own.hero);
    density.own_column = path.store_column(&own);
    density.length = distance as f32;
    let medium = context.medium(stack.medium());
    path.sensor_hits.push(SensorHit {
        sensor,
        depth: path.vertices.len(),
        x_sensor: EndPoint::on(point),
        raster,
        importance,
        toward_previous: -direction,
        distance,
        medium: stack.medium(),
        density,
        throughput: throughput.times(&medium.transmittance(distance, context.count())),
    });
}
