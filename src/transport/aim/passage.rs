//! Light along a chain that is known: what its vertices let through, and what is in its way.

use super::trail::Place;
use super::{Bounce, MAX_CHAIN, Points, Prims, placed};
use crate::bsdf::lobe::dielectric::Dielectric;
use crate::bsdf::{Bsdf, Label, Lobe};
use crate::geometry::{Face, Ray, SurfaceId};
use crate::medium::MediumStack;
use crate::scene::chains::{ChainKind, ChainLink};
use crate::scene::crossing::resolve;
use crate::spectrum::SampledSpectrum;
use crate::transport::context::{Counters, PathContext};
use arrayvec::ArrayVec;
use glam::DVec3;

/// Segments of a chain from the light to the sensor: unit directions and lengths.
pub type Segments = ArrayVec<(DVec3, f64), { MAX_CHAIN + 1 }>;

/// Faces that the points of a chain lie on; `None` where one is beside its own.
#[must_use]
pub fn faces(
    context: &PathContext,
    kind: &ChainKind,
    points: &Points,
    prims: &Prims,
) -> Option<ArrayVec<SurfaceId, MAX_CHAIN>> {
    let scene = context.scene;
    let face = |(i, link): (usize, &ChainLink)| {
        let instance = scene.accel.instance(link.id.instance);
        let facets = scene.chains().facets(link.id.instance);
        let placement = instance.transform.at(context.moment());
        placed::face_at(instance, facets, link.id, &placement, (points[i], prims[i]))
    };
    kind.iter().enumerate().map(face).collect()
}

/// Segments of a chain, of which `first` leads to its first point, and the last to `to`.
#[must_use]
pub fn segments(first: (DVec3, f64), points: &Points, to: DVec3) -> Segments {
    let ends = points.iter().skip(1).chain([&to]);
    let between = points.iter().zip(ends).map(|(p, end)| {
        let v = *end - *p;
        (v.normalize(), v.length())
    });
    std::iter::once(first).chain(between).collect()
}

/// The segments as rays from the sensor's side on, from a point there on a surface, up to a surface
/// at the light's end.
#[must_use]
pub fn rays(
    segments: &Segments,
    points: &Points,
    faces: &[SurfaceId],
    (to, on_sensor): (DVec3, Option<SurfaceId>),
    on_light: Option<SurfaceId>,
) -> ArrayVec<Ray, { MAX_CHAIN + 1 }> {
    let ray = |(i, &(w, length)): (usize, &(DVec3, f64))| {
        let (from, surface) = match points.get(i) {
            Some(&p) => (p, Some(faces[i])),
            None => (to, on_sensor),
        };
        let end = i.checked_sub(1).map_or(on_light, |i| Some(faces[i]));
        Ray::leaving(from, -w, surface).ending(length, end)
    };
    segments.iter().enumerate().rev().map(ray).collect()
}

/// A specular vertex that was solved for.
pub struct Solved {
    /// Where it is.
    pub place: Place,
    /// Reflects or transmits.
    pub label: Label,
    /// Bends each wavelength its own way.
    pub dispersive: bool,
    /// Probability of the label for ω⁻.
    pub forward: f64,
    /// Probability of the label for ω⁺.
    pub backward: f64,
}

/// A specular vertex of a chain, on face `id` between its two segments (unit directions from the
/// light on, and lengths), and its reflectance or transmittance. `lobes` is overwritten.
#[must_use]
pub fn solved(
    context: &PathContext,
    lobes: &mut Vec<(f32, Lobe)>,
    (link, bounce): (&ChainLink, &Bounce),
    at: (SurfaceId, DVec3),
    segments: &[(DVec3, f64)],
) -> (Solved, SampledSpectrum) {
    let (place, value, backward) = toward_sensor(context, lobes, (link, bounce), at, segments[1].0);
    let interface = context.interface(link.media, link.id.instance);
    let label = label(link);
    let bsdf = Bsdf { lobes, interface };
    let w_light = local(bounce.surface.normal(place.p), -segments[0].0);
    let vertex = Solved {
        place,
        label,
        dispersive: link.transmits && interface.dispersive,
        forward: bsdf.label_probability(label, w_light),
        backward,
    };
    (vertex, value)
}

/// The same of what is asked on the way from the sensor, which unit direction `w` leads to: place,
/// reflectance or transmittance, and probability of the label.
#[must_use]
pub fn toward_sensor(
    context: &PathContext,
    lobes: &mut Vec<(f32, Lobe)>,
    (link, bounce): (&ChainLink, &Bounce),
    (id, p): (SurfaceId, DVec3),
    w: DVec3,
) -> (Place, SampledSpectrum, f64) {
    let scene = context.scene;
    let interface = context.interface(link.media, link.id.instance);
    let object = scene.object(link.id.instance);
    lobes.clear();
    if object.is_smooth_interface {
        lobes.push((1.0, Lobe::Dielectric(Dielectric::CLEAR)));
    } else {
        let uv = scene.geometry.texture_coordinates(id, p);
        let material = scene.material(object.material);
        material.push_lobes(uv, &context.wavelengths, &interface, lobes);
    }
    let bsdf = Bsdf { lobes, interface };
    let label = label(link);
    let w_sensor = local(bounce.surface.normal(p), w);
    let value = bsdf.specular(label, w_sensor.z.abs(), w_sensor.z > 0.0);
    let place = Place {
        p,
        ng: bounce.surface.face_normal(p),
        id,
        media: link.media,
    };
    (place, value, bsdf.label_probability(label, w_sensor))
}

fn label(link: &ChainLink) -> Label {
    if link.transmits {
        Label::SpecularTransmit
    } else {
        Label::SpecularReflect
    }
}

/// A unit direction in a frame around normal `n`.
fn local(n: DVec3, w: DVec3) -> DVec3 {
    let z = w.dot(n);
    DVec3::new((1.0 - z * z).max(0.0).sqrt(), 0.0, z)
}

/// Transmittance of the segments of a chain, given from the sensor's side on, the first in the
/// solids of `stack`; 0 also where a vertex of the chain is not between the media it is solved for.
#[must_use]
pub fn visibility(
    context: &PathContext,
    chain: &[Place],
    segments: &[Ray],
    stack: &MediumStack,
    counters: &mut Counters,
) -> f64 {
    let scene = context.scene;
    let (mut open, mut stack) = (1.0, *stack);
    for (i, ray) in segments.iter().enumerate() {
        counters.shadow_rays += 1;
        let (share, arrived) = scene.carry(ray, &stack);
        open *= share;
        if open == 0.0 {
            return 0.0;
        }
        let (Some(next), Some(place)) = (segments.get(i + 1), chain.iter().rev().nth(i)) else {
            break;
        };
        let face = Face {
            point: place.surface_point(),
            folded: false,
        };
        let Ok(crossing) = resolve(&scene.objects, &[face], &arrived, ray.d) else {
            return 0.0;
        };
        let from_above = ray.d.dot(place.ng) < 0.0;
        let behind = crossing.behind.unwrap_or(arrived);
        let sides = [arrived.medium(), behind.medium()];
        if sides != [usize::from(!from_above), usize::from(from_above)].map(|k| place.media[k]) {
            return 0.0;
        }
        let transmits = (next.d.dot(place.ng) < 0.0) == from_above;
        stack = if transmits { behind } else { arrived };
    }
    open
}
