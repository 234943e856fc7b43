//! The scene at one moment: all that a path asks of it.

use super::Scene;
use crate::bsdf::albedo::AlbedoTables;
use crate::geometry::{AccelAt, Hit, InstanceId, Moment, Placements, Ray, SurfacePoint};
use glam::DVec3;
use std::ops::Deref;

/// The scene at one moment. What does not depend on the moment is reached through it.
#[derive(Clone, Copy, Debug)]
pub struct SceneAt<'a> {
    scene: &'a Scene,
    /// Geometry at the moment: all that lights need to know.
    pub geometry: AccelAt<'a>,
}

impl Scene {
    /// The scene at `time` (seconds), which remembers placements of moving things in `placements`.
    #[must_use]
    pub fn at<'a>(&'a self, time: f64, placements: &'a mut Placements) -> SceneAt<'a> {
        SceneAt {
            scene: self,
            geometry: self.accel.at(placements.at(time, self.motions)),
        }
    }
}

impl Deref for SceneAt<'_> {
    type Target = Scene;

    fn deref(&self) -> &Scene {
        self.scene
    }
}

impl<'a> SceneAt<'a> {
    /// The moment.
    #[must_use]
    pub fn moment(&self) -> Moment<'a> {
        self.geometry.moment()
    }

    /// Albedos of rough lobes.
    #[must_use]
    pub fn albedos(&self) -> &'a AlbedoTables {
        &self.scene.albedos
    }

    /// The closest hit among the instances for which `visible` says true.
    #[must_use]
    #[inline]
    pub fn closest(&self, ray: &Ray, visible: impl Fn(InstanceId) -> bool) -> Option<Hit> {
        self.geometry.closest(ray, visible)
    }

    /// The same, and the point that is hit.
    #[must_use]
    #[inline]
    pub fn closest_point(
        &self,
        ray: &Ray,
        visible: impl Fn(InstanceId) -> bool,
    ) -> Option<(Hit, Option<SurfacePoint>)> {
        self.geometry.closest_point(ray, visible)
    }

    /// The point with the shading normal of its material: the one place where normals are bent, for
    /// all strategies.
    #[must_use]
    pub fn shading_point(&self, mut point: SurfacePoint) -> SurfacePoint {
        point.ns = self.shading_normal(&point);
        point
    }

    /// That normal.
    #[must_use]
    #[inline]
    pub fn shading_normal(&self, point: &SurfacePoint) -> DVec3 {
        let object = self.object(point.id.instance);
        if !object.has_normal_map {
            return point.ns;
        }
        let map = self.material(object.material).normal.as_ref();
        map.map_or(point.ns, |map| {
            map.normal(point, self.geometry.tangents(point))
        })
    }
}
