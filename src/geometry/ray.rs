//! Rays.

use super::SurfaceId;
use glam::DVec3;

/// A ray or a segment at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin in world space.
    pub o: DVec3,
    /// Unit direction.
    pub d: DVec3,
    /// Hits are in (0, `t_max`); infinite for an open ray.
    pub t_max: f64,
    /// Moment as a fraction of the shutter, in [0, 1].
    pub time: f64,
    /// The face and root the origin lies on: never hit again; hits of other faces within the rounding error of the
    /// origin are ignored.
    pub start: Option<SurfaceId>,
    /// The same for the far end of a segment (at `t_max`).
    pub end: Option<SurfaceId>,
}

impl Ray {
    /// An open ray from a point of free space.
    #[must_use]
    pub fn new(o: DVec3, d: DVec3, time: f64) -> Self {
        Self { o, d, t_max: f64::INFINITY, time, start: None, end: None }
    }

    /// An open ray that leaves the surface `start` (if any).
    #[must_use]
    pub fn leaving(o: DVec3, d: DVec3, time: f64, start: Option<SurfaceId>) -> Self {
        Self { start, ..Self::new(o, d, time) }
    }
}
