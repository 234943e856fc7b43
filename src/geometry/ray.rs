//! Rays, in the world and in the own space of an instance.
//!
//! Invariant: which hits count near the ends of a ray follows from the faces it names and from the
//! rounding error of its end points, never from a length.

use super::{InstanceId, SurfaceId};
use crate::math::predicates::transformed_error;
use glam::{DAffine3, DVec3};

/// A ray or a segment.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin in world space.
    pub o: DVec3,
    /// Unit direction.
    pub d: DVec3,
    /// Hits are in (0, `t_max`); infinite for an open ray.
    pub t_max: f64,
    /// The face and root the origin lies on: never hit again; hits of other faces within the
    /// rounding error of the origin are ignored.
    pub start: Option<SurfaceId>,
    /// The same for the far end of a segment (at `t_max`).
    pub end: Option<SurfaceId>,
}

impl Ray {
    /// An open ray from a point of free space.
    #[must_use]
    pub fn new(o: DVec3, d: DVec3) -> Self {
        Self {
            o,
            d,
            t_max: f64::INFINITY,
            start: None,
            end: None,
        }
    }

    /// An open ray that leaves the surface `start` (if any).
    #[must_use]
    pub fn leaving(o: DVec3, d: DVec3, start: Option<SurfaceId>) -> Self {
        Self {
            start,
            ..Self::new(o, d)
        }
    }

    /// Whether one of its ends lies on the instance.
    #[inline(always)]
    pub(super) fn ends_on(&self, id: InstanceId) -> bool {
        let on = |s: Option<SurfaceId>| s.is_some_and(|s| s.instance == id);
        on(self.start) || on(self.end)
    }

    /// The segment of `length` that ends on the surface `end` (if any).
    #[must_use]
    pub fn ending(self, length: f64, end: Option<SurfaceId>) -> Self {
        Self {
            t_max: length,
            end,
            ..self
        }
    }
}

/// A ray in the own space of one instance; its parameter is still the distance in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalRay<'a> {
    /// Origin.
    pub o: DVec3,
    /// Direction, of any length.
    pub d: DVec3,
    /// Hits are in (0, `t_max`).
    pub t_max: f64,
    /// The face of this instance the origin lies on.
    pub start: Option<u32>,
    /// The face of this instance the far end lies on.
    pub end: Option<u32>,
    /// Where the far end is (`t_max` shrinks as hits are found, this does not).
    pub t_end: f64,
    world: &'a Ray,
    to_object: &'a DAffine3,
    extent: f64,
    /// Bound of the rounding error of the origin, where one is known; else infinite.
    start_error: f64,
}

impl<'a> LocalRay<'a> {
    /// `ray` as the instance `id` at `to_object` sees it, where only hits before `t_max` matter and
    /// the shape has coordinates up to `extent`.
    #[inline]
    pub fn new(
        ray: &'a Ray,
        id: InstanceId,
        to_object: &'a DAffine3,
        t_max: f64,
        extent: f64,
    ) -> Self {
        let prim = |s: Option<SurfaceId>| s.filter(|s| s.instance == id).map(|s| s.prim);
        Self {
            o: to_object.transform_point3(ray.o),
            d: to_object.transform_vector3(ray.d),
            t_max,
            start: prim(ray.start),
            end: prim(ray.end),
            t_end: ray.t_max,
            world: ray,
            to_object,
            extent,
            start_error: f64::INFINITY,
        }
    }

    /// An open ray that starts on another instance, with its origin and direction in the space of
    /// this one and a bound of the rounding error of that origin.
    #[inline]
    pub fn across(
        ray: &'a Ray,
        (o, d): (DVec3, DVec3),
        to_object: &'a DAffine3,
        extent: f64,
        start_error: f64,
    ) -> Self {
        Self {
            o,
            d,
            t_max: ray.t_max,
            start: None,
            end: None,
            t_end: ray.t_max,
            world: ray,
            to_object,
            extent,
            start_error,
        }
    }

    /// Point at the parameter `t`.
    #[inline]
    pub fn at(&self, t: f64) -> DVec3 {
        self.o + self.d * t
    }

    /// Whether a hit at `t` is one of those that matter, if it counts.
    #[inline]
    pub fn reaches(&self, t: f64) -> bool {
        t > 0.0 && t < self.t_max
    }

    /// Whether a face that is named neither as start nor as end counts when hit at `t`, where the
    /// ray nears it by `approach` per unit of `t` (|d·n|). Faces nearer to an end of the ray than
    /// the rounding error of that end are its neighbors, and do not. Few rays come to ask, so that
    /// the error waits until then.
    #[inline(always)]
    pub fn counts(&self, t: f64, approach: impl FnOnce() -> f64) -> bool {
        let Ray { start, end, .. } = self.world;
        self.reaches(t) && (start.is_none() && end.is_none() || self.is_far(t, approach()))
    }

    /// The answer of [`LocalRay::is_apart`], from the bound of the error where that suffices.
    #[inline(always)]
    fn is_far(&self, t: f64, approach: f64) -> bool {
        let is_known = self.world.end.is_none() && t * approach >= self.start_error;
        is_known || self.is_apart(t, approach)
    }

    /// Whether a face is farther from both ends of the ray than the rounding errors of these.
    fn is_apart(&self, t: f64, approach: f64) -> bool {
        let Ray {
            o, d, start, end, ..
        } = *self.world;
        let error = |magnitude| transformed_error(self.to_object, magnitude, self.extent);
        let far = || (o + d * self.t_end).abs().max(o.abs());
        (start.is_none() || t * approach >= error(o.abs()))
            && (end.is_none() || (self.t_end - t) * approach >= error(far()))
    }
}
