//! One placed shape.

use super::shape::AreaSample;
use super::{Shape, SurfacePoint, Transform};
use glam::{DVec2, DVec3};

/// Index of an instance in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstanceId(pub u32);

/// A shape placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The surface in its own space.
    pub shape: Shape,
    /// Where it is.
    pub transform: Transform,
}

#[allow(unused_variables)]
impl Instance {
    /// World area at `time`.
    #[must_use]
    pub fn area(&self, time: f64) -> f64 {
        todo!()
    }

    /// A point by area: `u` in [0,1)², `u_face` chooses the face or triangle.
    #[must_use]
    pub fn sample_area(&self, id: InstanceId, time: f64, u_face: f64, u: DVec2) -> AreaSample {
        todo!()
    }

    /// The density per world area with which `sample_area` generates `point`.
    #[must_use]
    pub fn pdf_area(&self, point: &SurfacePoint, time: f64) -> f64 {
        todo!()
    }

    /// World bounds over the whole shutter.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        todo!()
    }
}
