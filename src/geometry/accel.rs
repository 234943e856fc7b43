//! The two-level tree: instances over shapes and meshes.

use super::{Hit, Instance, InstanceId, Ray, SurfacePoint};
use glam::DVec3;

/// All instances of a scene, ready for ray queries.
#[derive(Debug)]
pub struct Accel {
    // H2: private: instances, TLAS CwBvh over padded instance boxes
}

#[allow(unused_variables)]
impl Accel {
    /// Builds the tree over the instances.
    #[must_use]
    pub fn build(instances: Vec<Instance>) -> Self {
        todo!()
    }

    /// The instances, by id.
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        todo!()
    }

    /// World bounds over the whole shutter; `None` without any instance.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        todo!()
    }

    /// The closest hit among the instances for which `visible` says true.
    #[must_use]
    pub fn closest(&self, ray: &Ray, visible: impl Fn(InstanceId) -> bool) -> Option<Hit> {
        todo!()
    }

    /// Whether any instance for which `opaque` says true is hit.
    #[must_use]
    pub fn occluded(&self, ray: &Ray, opaque: impl Fn(InstanceId) -> bool) -> bool {
        todo!()
    }

    /// Full local geometry of a hit: position refined onto the surface, normals, uv.
    #[must_use]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        todo!()
    }
}
