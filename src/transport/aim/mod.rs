//! Aimed connections: the specular chains between two end points, solved.
//!
//! A chain is a list of smooth surfaces, each of which reflects or transmits, with the indices of
//! the segments between them. The solvers here are functions of that, the end points and the
//! placements alone: no random numbers, no visibility, no bounds of facets. All but the last are
//! *complete*: they find every chain there is, so that whoever meets a chain on a path made
//! otherwise knows that its solver would have found it.
//!
//! Planes: mirrors unfold, and Fermat's path length is convex in the positions on what transmits.
//! Spheres: a chain lies in the plane of its end points and the center, where one number decides
//! it. Mirrors that are circles in cross-section: Alhazen's problem, a quartic; inside, several
//! reflections by one number again. Any other surface of the second degree, and meshes with
//! interpolated normals: shooting, which has to be asked what it finds.

mod around;
pub mod ball;
pub mod circle;
pub mod differential;
pub mod fan;
pub mod passage;
pub mod placed;
pub mod planes;
pub mod quadric;
mod roots;
mod shooting;
pub mod smooth;
pub mod surface;
#[cfg(test)]
mod tests;
pub mod trail;
pub mod tries;
mod unfolded;

use arrayvec::ArrayVec;
use glam::DVec3;
use surface::Surface;

pub use crate::scene::chains::MAX_CHAIN;

/// Positions of the specular vertices, from the light to the sensor.
pub type Points = ArrayVec<DVec3, MAX_CHAIN>;

/// Triangles of meshes that the specular vertices lie on; 0 where a surface is none.
pub type Prims = ArrayVec<u32, MAX_CHAIN>;

/// The end of a chain on the light side, x_a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Far {
    /// A point.
    Point(DVec3),
    /// Infinitely far away in this unit direction.
    Direction(DVec3),
}

impl Far {
    /// Unit direction from `p` towards it.
    #[must_use]
    pub fn direction_from(&self, p: DVec3) -> DVec3 {
        match *self {
            Self::Point(x) => (x - p).normalize(),
            Self::Direction(w) => w,
        }
    }
}

/// A specular vertex of a chain.
#[derive(Clone, Copy, Debug)]
pub struct Bounce<'s> {
    /// Surface that it lies on.
    pub surface: Surface<'s>,
    /// Transmits; else reflects.
    pub transmits: bool,
    /// The segment on the light side is on the side that the normal points to.
    pub from_above: bool,
}

impl Bounce<'_> {
    /// Whether the segment on the sensor side is on the side that the normal points to.
    #[must_use]
    pub fn to_above(&self) -> bool {
        self.from_above != self.transmits
    }

    /// The same where the chain is known to lie on triangle `prim`, if the surface is a mesh.
    #[must_use]
    pub fn at(&self, prim: u32) -> Self {
        Self {
            surface: self.surface.at(prim),
            ..*self
        }
    }

    /// Whether unit directions towards both neighbors are on the sides that the label says.
    fn has_sides(&self, p: DVec3, toward_light: DVec3, toward_sensor: DVec3) -> bool {
        let normals = self.surface.normals(p);
        let is_side = |w: DVec3, above: bool| {
            let is_there = |n: DVec3| {
                if above {
                    w.dot(n) > 0.0
                } else {
                    w.dot(n) < 0.0
                }
            };
            normals.into_iter().all(is_there)
        };
        is_side(toward_light, self.from_above) && is_side(toward_sensor, self.to_above())
    }
}

/// Whether there is a solver for the shapes and labels of a chain, at the indices `eta` of its
/// segments from the light to the sensor (one more than vertices).
#[must_use]
pub fn is_solvable(bounces: &[Bounce], eta: &[f64]) -> bool {
    debug_assert_eq!(eta.len(), bounces.len() + 1);
    if bounces.is_empty() || bounces.len() > MAX_CHAIN {
        return false;
    }
    let is_plane = |b: &Bounce| matches!(b.surface, Surface::Plane { .. });
    if bounces.iter().all(is_plane) {
        return true;
    }
    if is_around(bounces) || !is_complete(bounces) {
        return true;
    }
    match bounces {
        [only] => match only.surface {
            Surface::Cylinder { .. } => !only.transmits,
            Surface::Plane { .. }
            | Surface::Sphere { .. }
            | Surface::Quadric(_)
            | Surface::Mesh(_)
            | Surface::Triangle(_) => true,
        },
        [first, inner @ .., last] => {
            matches!(first.surface, Surface::Sphere { .. })
                && first.transmits
                && first.from_above
                && last.transmits
                && !last.from_above
                && inner.iter().all(|b| !b.transmits && !b.from_above)
                && bounces.iter().all(|b| b.surface == first.surface)
                // only then is the total deflection known to have one minimum
                && eta[1] > eta[0]
                && eta[0] == eta[bounces.len()]
        }
        [] => false,
    }
}

/// Whether the solver of these shapes finds every chain.
#[must_use]
pub fn is_complete(bounces: &[Bounce]) -> bool {
    let is_shot = |b: &Bounce| {
        matches!(
            b.surface,
            Surface::Quadric(_) | Surface::Mesh(_) | Surface::Triangle(_)
        )
    };
    !bounces.iter().any(is_shot)
}

/// Whether a chain is reflected inside one sphere or cylinder alone.
fn is_around(bounces: &[Bounce]) -> bool {
    let inside = |b: &Bounce| !b.transmits && !b.from_above && b.surface == bounces[0].surface;
    !matches!(bounces[0].surface, Surface::Plane { .. }) && bounces.iter().all(inside)
}

/// Calls `found` with every chain between `far` and `to`, and the triangles that it lies on. Facets
/// are as large as their planes; whether a chain lies on them is for the caller to see. Nothing
/// where [`is_solvable`] says no.
pub fn solve(
    bounces: &[Bounce],
    eta: &[f64],
    far: &Far,
    to: DVec3,
    mut found: impl FnMut(&Points, &Prims),
) {
    if !is_solvable(bounces, eta) {
        return;
    }
    let mut on = |points: &Points, prims: &Prims| {
        if has_sides(bounces, (points, prims), far, to) {
            found(points, prims);
        }
    };
    if !is_complete(bounces) {
        return shooting::solve(bounces, eta, far, to, on);
    }
    let whole: Prims = bounces.iter().map(|_| 0).collect();
    let mut checked = |points: &Points| on(points, &whole);
    match (bounces, bounces[0].surface) {
        (_, Surface::Plane { .. }) => {
            let refractions = bounces.iter().filter(|b| b.transmits).count();
            let solve = if refractions <= 1 {
                unfolded::solve
            } else {
                planes::solve
            };
            if let Some(points) = solve(bounces, eta, far, to) {
                checked(&points);
            }
        }
        ([first, ..], _) if !first.transmits => {
            circle::solve(first, bounces.len(), far, to, checked);
        }
        (_, Surface::Sphere { center, radius }) => {
            let ball = ball::Ball { center, radius };
            match bounces {
                [only] => {
                    // the index inside over the one outside
                    let [light, sensor] = [eta[0], eta[1]];
                    if only.from_above {
                        ball.through(sensor / light, to, far, checked);
                    } else if let Far::Point(inside) = *far {
                        ball.through(light / sensor, inside, &Far::Point(to), checked);
                    }
                }
                _ => ball.across(eta[1] / eta[0], bounces.len() - 1, far, to, checked),
            }
        }
        (
            _,
            Surface::Cylinder { .. }
            | Surface::Quadric(_)
            | Surface::Mesh(_)
            | Surface::Triangle(_),
        ) => {}
    }
}

/// Whether every vertex has its neighbors on the sides that its label says.
fn has_sides(bounces: &[Bounce], (points, prims): (&Points, &Prims), far: &Far, to: DVec3) -> bool {
    points.iter().zip(bounces).enumerate().all(|(i, (&p, b))| {
        let toward_light = match i.checked_sub(1) {
            Some(before) => points[before] - p,
            None => far.direction_from(p),
        };
        let toward_sensor = points.get(i + 1).copied().unwrap_or(to) - p;
        b.at(prims[i]).has_sides(p, toward_light, toward_sensor)
    })
}
