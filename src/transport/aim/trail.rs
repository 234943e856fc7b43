//! A finished path as a list of places, and the bridges that could have made it.

use super::surface::Surface;
use super::tries::Origin;
use super::{Bounce, Far, MAX_CHAIN, differential, is_complete, is_solvable, solve};
use crate::geometry::{EndPoint, InstanceId, SurfaceId, SurfacePoint};
use crate::light::LightKind;
use crate::medium::MediumId;
use crate::scene::chains::{ChainKind, ChainLink, Chains};
use crate::transport::context::PathContext;
use crate::transport::density::{Bridge, PathView};
use crate::transport::strategies::StrategySet;
use crate::transport::subpath::Vertex;
use arrayvec::ArrayVec;
use glam::DVec3;

/// Distance up to which two chains are one, in units of their last segment.
const SAME: f64 = 1e-5;

/// Where a scattering vertex is.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Position.
    pub p: DVec3,
    /// Unit geometric normal.
    pub ng: DVec3,
    /// Face and instance.
    pub id: SurfaceId,
    /// The media on the side the normal points to, and on the other.
    pub media: [MediumId; 2],
}

impl Place {
    /// The place as a point of its surface, without texture coordinates.
    #[must_use]
    pub fn surface_point(&self) -> SurfacePoint {
        SurfacePoint::flat(self.p, self.ng, self.id)
    }
}

impl From<&Vertex> for Place {
    fn from(vertex: &Vertex) -> Self {
        Self {
            p: vertex.p,
            ng: vertex.ng,
            id: vertex.id,
            media: vertex.media,
        }
    }
}

/// The places of a path from the light to the sensor.
#[derive(Clone, Copy, Debug)]
pub struct Trail<'p> {
    /// x₀.
    pub x0: EndPoint,
    /// Vertices from the light, in their order.
    pub light: &'p [Vertex],
    /// Those of a chain solved for.
    pub chain: &'p [Place],
    /// Vertices from the sensor, in their order.
    pub camera: &'p [Vertex],
    /// The end on the sensor.
    pub x_sensor: EndPoint,
}

impl Trail<'_> {
    /// Scattering vertex i of the path, 1 <= i < n − 1.
    fn place(&self, i: usize) -> Place {
        match self.vertex(i) {
            Some(vertex) => vertex.into(),
            None => self.chain[i - 1 - self.light.len()],
        }
    }

    /// Scattering vertex i, 1 <= i < n − 1, if a walk has come there.
    fn vertex(&self, i: usize) -> Option<&Vertex> {
        let i = i - 1;
        if i < self.light.len() {
            return Some(&self.light[i]);
        }
        let beyond = (i - self.light.len()).checked_sub(self.chain.len())?;
        Some(&self.camera[self.camera.len() - 1 - beyond])
    }

    /// Whether scattering vertex i sends light alike in all directions.
    pub(in crate::transport) fn is_lambertian(&self, i: usize) -> bool {
        self.vertex(i).is_some_and(|vertex| vertex.is_lambertian)
    }

    /// The surface of scattering vertex i.
    pub(in crate::transport) fn surface(&self, i: usize) -> InstanceId {
        self.place(i).id.instance
    }

    fn len(&self) -> usize {
        self.light.len() + self.chain.len() + self.camera.len() + 2
    }

    fn position(&self, i: usize) -> DVec3 {
        match i {
            0 => self.x0.p,
            _ if i + 1 == self.len() => self.x_sensor.p,
            _ => self.place(i).p,
        }
    }

    fn far(&self, a: usize) -> Far {
        if a == 0 && self.x0.parallel {
            Far::Direction(-self.x0.n)
        } else {
            Far::Point(self.position(a))
        }
    }
}

/// Vertices of a chain as solvers want them, and the indices of its segments.
pub type Placed<'s> = (
    ArrayVec<Bounce<'s>, MAX_CHAIN>,
    ArrayVec<f64, { MAX_CHAIN + 1 }>,
);

/// A kind of chain at the moment and at the wavelength of `lane` of a path; `None` where a shape is
/// out of round.
#[must_use]
pub fn place<'s>(context: &'s PathContext, kind: &[ChainLink], lane: usize) -> Option<Placed<'s>> {
    let index = |medium: MediumId| context.medium(medium).eta[lane];
    let bounces = places(context, kind)?;
    let first = index(kind.first()?.before());
    let after = kind.iter().map(|link| index(link.after()));
    let eta: ArrayVec<f64, { MAX_CHAIN + 1 }> = std::iter::once(first).chain(after).collect();
    is_solvable(&bounces, &eta).then_some((bounces, eta))
}

/// Surfaces of a kind of chain at the moment of a path; `None` where one is out of round.
#[must_use]
pub fn places<'s>(
    context: &'s PathContext,
    kind: &[ChainLink],
) -> Option<ArrayVec<Bounce<'s>, MAX_CHAIN>> {
    let bounce = |link: &ChainLink| {
        let instance = context.scene.accel.instance(link.id.instance);
        let placement = instance.transform.at(context.moment());
        let facets = context.scene.chains().facets(link.id.instance);
        Some(Bounce {
            surface: Surface::of(instance, facets, link.id, &placement)?,
            transmits: link.transmits,
            from_above: link.from_above,
        })
    };
    kind.iter().map(bounce).collect()
}

/// A vertex between two directions, not normalized, as a link of a chain.
#[must_use]
pub fn chain_link(
    chains: &Chains,
    place: &Place,
    toward_light: DVec3,
    toward_sensor: DVec3,
) -> ChainLink {
    let from_above = toward_light.dot(place.ng) > 0.0;
    ChainLink {
        id: chains.face(place.id),
        transmits: (toward_sensor.dot(place.ng) > 0.0) != from_above,
        from_above,
        media: place.media,
    }
}

/// Whether a chain bends each wavelength its own way.
#[must_use]
pub fn is_dispersive(context: &PathContext, kind: &[ChainLink]) -> bool {
    let disperses = |link: &ChainLink| {
        link.transmits && context.interface(link.media, link.id.instance).dispersive
    };
    kind.iter().any(disperses)
}

/// The bridges of a path: of the chain at its light and of that at its sensor, where they are
/// tried. `light` is what it starts from; `lane` is the wavelength whose path this is.
#[must_use]
pub fn bridges(
    context: &PathContext,
    strategies: &StrategySet,
    view: &PathView,
    trail: &Trail,
    light: &LightKind,
    lane: usize,
) -> [Option<Bridge>; 2] {
    let n = view.len();
    let none = [None; 2];
    if n < 3 || context.scene.chains().kinds().is_empty() {
        return none;
    }
    let aims = &strategies.aims;
    let specular = |i: usize| (1..n - 1).contains(&i) && view.is_specular(i);
    let bridge = |origin: Origin, (a, b), samples: f64, wanted: &dyn Fn(&ChainKind) -> bool| {
        let chains = context.scene.chains();
        let links = links(chains, trail, a, b)?;
        let kind = chains.find(&links)?;
        let samples = samples * strategies.tried(origin, kind);
        if samples == 0.0 || !wanted(&links) {
            return None;
        }
        // what is met where surfaces touch is no surface of the list
        let is_alone = |i| context.scene.is_simple(&trail.place(i).surface_point());
        if !(a + 1..b).all(is_alone) {
            return None;
        }
        let (bounces, eta) = place(context, &links, lane)?;
        if !is_complete(&bounces) && !is_found(view, trail, (a, b), &bounces, &eta) {
            return None;
        }
        let k = factor(trail, a, b, &bounces, &eta);
        Some(Bridge {
            a,
            b,
            k,
            samples,
            kind: kind as u32,
            origin,
        })
    };
    let always = |_: &ChainKind| true;
    let splats = strategies.splat_samples;
    let first = (1..n).find(|&i| !specular(i)).unwrap_or(n - 1);
    if first == n - 1 {
        let through = aims.through && matches!(light, LightKind::Area(_));
        let found = through.then(|| bridge(Origin::Start, (0, n - 1), splats, &always));
        return [found.flatten(), None];
    }
    let last = (0..n - 1).rev().find(|&i| !specular(i)).unwrap_or(0);
    let at_light = aims.light && first >= 2 && (aims.light_everywhere || specular(first + 1));
    let at_sensor = aims.sensor && last + 2 < n;
    let after_specular = specular(last - 1);
    let near = aims.sensor_everywhere || after_specular;
    // where a camera sub-path brings all lanes, chains to the sensor have nothing to add
    let has_fan = strategies.fans && trail.is_lambertian(last);
    let wanted =
        |kind: &ChainKind| near || context.count() > 1 && !has_fan && is_dispersive(context, kind);
    let by_camera = Origin::Vertex {
        at_sensor: false,
        first: (first + 1..n - 1).all(specular),
        after_specular: specular(first + 1),
    };
    let by_light = Origin::Vertex {
        at_sensor: true,
        first: (1..last).all(specular),
        after_specular,
    };
    let at_light = at_light.then(|| bridge(by_camera, (0, first), 1.0, &always));
    let at_sensor = at_sensor.then(|| bridge(by_light, (last, n - 1), splats, &wanted));
    [at_light.flatten(), at_sensor.flatten()]
}

/// Whether a solver that may miss chains finds that between x_a and x_b; where the path joins
/// specular vertices of it, which then are near a chain, whether it finds any.
fn is_found(
    view: &PathView,
    trail: &Trail,
    (a, b): (usize, usize),
    bounces: &[Bounce],
    eta: &[f64],
) -> bool {
    if trail.light.len() == a && trail.chain.len() == bounces.len() {
        return true;
    }
    let s = view.s();
    let is_near = [s.wrapping_sub(1), s]
        .iter()
        .any(|i| (a + 1..b).contains(i));
    let mut is_found = false;
    let (far, to) = (trail.far(a), trail.position(b));
    solve(bounces, eta, &far, to, |points, _| {
        let size = to.distance(points[points.len() - 1]);
        let is_same = |(i, p): (usize, &DVec3)| p.distance(trail.place(a + 1 + i).p) < SAME * size;
        is_found |= is_near || points.iter().enumerate().all(is_same);
    });
    is_found
}

/// The links of the chain between x_a and x_b; `None` where it is too long.
fn links(chains: &Chains, trail: &Trail, a: usize, b: usize) -> Option<ChainKind> {
    if b - a - 1 > MAX_CHAIN {
        return None;
    }
    let far = trail.far(a);
    let link = |i: usize| {
        let place = trail.place(i);
        let toward_light = if i == a + 1 {
            far.direction_from(place.p)
        } else {
            trail.position(i - 1) - place.p
        };
        let toward_sensor = trail.position(i + 1) - place.p;
        chain_link(chains, &place, toward_light, toward_sensor)
    };
    Some((a + 1..b).map(link).collect())
}

/// K of a chain: its density where specular vertices leave out 1/A, over its true one. [theory
/// (9.1)]
fn factor(trail: &Trail, a: usize, b: usize, bounces: &[Bounce], eta: &[f64]) -> f64 {
    let far = trail.far(a);
    let points: ArrayVec<DVec3, MAX_CHAIN> = (a + 1..b).map(|i| trail.place(i).p).collect();
    let on = (a + 1..b)
        .zip(bounces)
        .map(|(i, b)| b.at(trail.place(i).id.prim));
    let on: ArrayVec<Bounce, MAX_CHAIN> = on.collect();
    let jacobian = differential::jacobian(&on, &points, eta, &far, trail.position(b));
    // of the segment at x_a the cosine is in both
    let mut product = match far {
        Far::Point(x) => 1.0 / x.distance_squared(points[0]),
        Far::Direction(_) => 1.0,
    };
    for i in a + 1..b {
        let place = trail.place(i);
        let step = trail.position(i + 1) - place.p;
        let d2 = step.length_squared();
        product *= step.dot(place.ng).abs() / (d2 * d2.sqrt());
    }
    product / jacobian
}
