//! Sequential tracing of real rays: surface after surface in the order of the prescription, or
//! along a route that turns back in between.

use super::prescription::{Frame, Interaction, Prescription};
use super::surface::LensSurface;
use glam::{DMat3, DVec3};

/// A ray: a point and a unit direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// A point of it, millimeters.
    pub o: DVec3,
    /// Unit direction.
    pub d: DVec3,
}

/// Encounter with a surface on the way through a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passage {
    /// Index of the surface.
    pub surface: usize,
    /// Light comes from the side of the image.
    pub backward: bool,
    /// Light is reflected.
    pub reflects: bool,
}

/// Event of a ray at a surface, in the space of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Index of the surface; on a route that of the passage.
    pub surface: usize,
    /// Where it was met.
    pub point: DVec3,
    /// Unit normal there, on the side of +z.
    pub normal: DVec3,
    /// Direction before.
    pub incoming: DVec3,
    /// Direction after.
    pub outgoing: DVec3,
    /// Distance from the last surface (from the origin of the ray at the first), millimeters.
    pub distance: f64,
}

/// Why a ray does not reach the image; with the index of the surface or passage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lost {
    /// The ray misses the surface.
    Missed(usize),
    /// The ray is outside the clear aperture.
    Clipped(usize),
    /// Total internal reflection.
    TotalReflection(usize),
}

#[derive(Clone, Debug)]
struct Step<'a> {
    shape: &'a LensSurface,
    /// Local axes of the last surface to those of this one, if they differ.
    rotation: Option<DMat3>,
    /// This vertex in the frame of the last surface.
    offset: DVec3,
    /// n before over n after.
    ratio: f64,
    reflects: bool,
}

/// A prescription at one wavelength, ready to trace.
#[derive(Clone, Debug)]
pub struct System<'a> {
    steps: Vec<Step<'a>>,
    route: Vec<Passage>,
    /// Frame of each passage.
    frames: Vec<Frame>,
    /// Index of the object space, then after each passage.
    indices: Vec<f64>,
}

impl<'a> System<'a> {
    /// A valid prescription at a wavelength in nanometers.
    #[must_use]
    pub fn new(prescription: &'a Prescription, lambda_nm: f64) -> Self {
        let surfaces = prescription.surfaces.iter().enumerate();
        let forward = surfaces.map(|(i, surface)| Passage {
            surface: i,
            backward: false,
            reflects: surface.interaction == Interaction::Reflect,
        });
        Self::along(prescription, lambda_nm, forward.collect())
    }

    /// The system along a route, each of whose passages begins where the one before it ends; the
    /// last is that of the image.
    #[must_use]
    pub fn along(prescription: &'a Prescription, lambda_nm: f64, route: Vec<Passage>) -> Self {
        let all = prescription.frames();
        let mut last = Frame::SYSTEM;
        let mut n = prescription.object_medium.ior.n(lambda_nm);
        let mut indices = vec![n];
        let mut steps = Vec::with_capacity(route.len());
        let mut frames = Vec::with_capacity(route.len());
        for passage in &route {
            let frame = &all[passage.surface];
            let surface = &prescription.surfaces[passage.surface];
            let reflects = passage.reflects;
            let next = if reflects {
                n
            } else {
                prescription.behind(passage).ior.n(lambda_nm)
            };
            frames.push(*frame);
            let turn = frame.rotation.transpose() * last.rotation;
            steps.push(Step {
                shape: &surface.shape,
                rotation: (turn != DMat3::IDENTITY).then_some(turn),
                offset: last.to_local(frame.origin),
                ratio: n / next,
                reflects,
            });
            n = next;
            indices.push(n);
            last = *frame;
        }
        Self {
            steps,
            route,
            frames,
            indices,
        }
    }

    /// Passages in the order of the light.
    #[must_use]
    pub fn route(&self) -> &[Passage] {
        &self.route
    }

    /// Index of the object space, then after each surface (or passage).
    #[must_use]
    pub fn indices(&self) -> &[f64] {
        &self.indices
    }

    /// Frame of each surface (or passage).
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Follows a ray, given in the system, through all surfaces. `visit` sees what happens at each,
    /// in its space; with `clip`, apertures stop rays. Returns the ray at the image, in the space
    /// of the image.
    ///
    /// # Errors
    /// Where and why the ray is lost.
    pub fn trace(&self, ray: Ray, clip: bool, mut visit: impl FnMut(&Event)) -> Result<Ray, Lost> {
        let Ray { mut o, mut d } = ray;
        let image = self.steps.len() - 1;
        for (i, step) in self.steps.iter().enumerate() {
            o -= step.offset;
            if let Some(turn) = step.rotation {
                (o, d) = (turn * o, turn * d);
            }
            let hit = step.shape.sequential(o, d).ok_or(Lost::Missed(i))?;
            let p = hit.point;
            if clip && i < image && !step.shape.aperture.contains(p.x, p.y) {
                return Err(Lost::Clipped(i));
            }
            let out = bend(d, hit.normal, step).ok_or(Lost::TotalReflection(i))?;
            visit(&Event {
                surface: i,
                point: p,
                normal: hit.normal,
                incoming: d,
                outgoing: out,
                distance: hit.t,
            });
            (o, d) = (p, out);
        }
        Ok(Ray { o, d })
    }

    /// The points of a ray at all surfaces it reaches, in the system, and whether it reaches the
    /// image.
    #[must_use]
    pub fn path(&self, ray: Ray, clip: bool) -> (Vec<DVec3>, bool) {
        let mut points = Vec::with_capacity(self.steps.len());
        let visit = |e: &Event| points.push(self.frames[e.surface].to_system(e.point));
        let arrived = self.trace(ray, clip, visit).is_ok();
        (points, arrived)
    }
}

/// Direction after the surface: the law of reflection, or Snell's in vector form. None where it is
/// totally reflected.
fn bend(d: DVec3, normal: DVec3, step: &Step) -> Option<DVec3> {
    let cos = d.dot(normal);
    if step.reflects {
        return Some(d - normal * (2.0 * cos));
    }
    let ratio = step.ratio;
    if ratio == 1.0 {
        return Some(d);
    }
    let cos2 = 1.0 - ratio * ratio * (1.0 - cos * cos);
    if cos2 < 0.0 {
        return None;
    }
    let along = cos2.sqrt().copysign(cos) - ratio * cos;
    Some((d * ratio + normal * along).normalize())
}
