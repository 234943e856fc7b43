//! Placement of instances, lights and cameras over the shutter.

use glam::{DAffine3, DVec3};

/// An affine map with its inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// From the object's own space to the world.
    pub to_world: DAffine3,
    /// From the world to the object's own space.
    pub to_object: DAffine3,
}

impl Placement {
    /// The placement of an invertible map.
    #[must_use]
    pub fn new(to_world: DAffine3) -> Self {
        Self {
            to_world,
            to_object: to_world.inverse(),
        }
    }

    /// A unit world normal from an object-space normal (inverse transpose).
    #[must_use]
    pub fn normal_to_world(&self, n: DVec3) -> DVec3 {
        (self.to_object.matrix3.transpose() * n).normalize()
    }
}

/// Where a thing is at each moment of the shutter.
#[derive(Clone, Debug, PartialEq)]
pub enum Transform {
    /// It does not move.
    Static(Placement),
}

impl Transform {
    /// A thing that does not move.
    #[must_use]
    pub fn fixed(to_world: DAffine3) -> Self {
        Self::Static(Placement::new(to_world))
    }

    /// The placement at `time`, a fraction of the shutter.
    #[must_use]
    #[inline]
    pub fn at(&self, _time: f64) -> Placement {
        match self {
            Self::Static(p) => *p,
        }
    }

    /// Whether the thing moves while the shutter is open.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        match self {
            Self::Static(_) => false,
        }
    }
}
