//! Shapes, cameras and detectors where they are, by the numbers that describe them.

use super::{Boundary, Camera, DAffine3, Emission, MaterialId, MediumId, SceneBuilder};
use super::{ObjectDescription, SensorDescription, Shape, Transform};
use crate::camera::Resolution;
use crate::camera::perspective::ThinLens;
use crate::geometry::Mesh;
use crate::scene::description::AreaEmission;
use glam::{DMat3, DQuat, DVec3};
use std::sync::Arc;

/// The rigid motion of a camera at `eye` that sees `target` in the middle of its film and `up`
/// upwards.
#[must_use]
pub fn look_at(eye: impl Into<DVec3>, target: impl Into<DVec3>, up: impl Into<DVec3>) -> DAffine3 {
    let eye = eye.into();
    let forward = (target.into() - eye).normalize();
    let right = forward.cross(up.into()).normalize();
    DAffine3::from_mat3_translation(DMat3::from_cols(right, right.cross(forward), -forward), eye)
}

fn placed(axes: DMat3, center: DVec3) -> Transform {
    Transform::fixed(DAffine3::from_mat3_translation(axes, center))
}

fn pixels([width, height]: [u32; 2]) -> Resolution {
    Resolution { width, height }
}

impl SceneBuilder {
    /// Adds a sphere.
    pub fn sphere(
        &mut self,
        name: &str,
        center: impl Into<DVec3>,
        radius: f64,
    ) -> &mut ObjectDescription {
        let axes = DMat3::from_diagonal(DVec3::splat(radius));
        self.object(name, Shape::Sphere, placed(axes, center.into()))
    }

    /// Adds a box between two corners, with its edges along the axes.
    pub fn cuboid(
        &mut self,
        name: &str,
        min: impl Into<DVec3>,
        max: impl Into<DVec3>,
    ) -> &mut ObjectDescription {
        let (min, max) = (min.into(), max.into());
        let axes = DMat3::from_diagonal(0.5 * (max - min));
        self.object(name, Shape::Box, placed(axes, 0.5 * (min + max)))
    }

    /// Adds a parallelogram: `u` and `v` lead from its center to the middle of two sides, its
    /// normal is along u × v.
    pub fn quad(
        &mut self,
        name: &str,
        center: impl Into<DVec3>,
        u: impl Into<DVec3>,
        v: impl Into<DVec3>,
    ) -> &mut ObjectDescription {
        let (u, v) = (u.into(), v.into());
        let normal = u.cross(v);
        // as long as the sides, so that the map is well conditioned
        let normal = normal.normalize() * normal.length().sqrt();
        let axes = DMat3::from_cols(u, v, normal);
        self.object(name, Shape::Quad, placed(axes, center.into()))
    }

    /// Adds a disk.
    pub fn disk(
        &mut self,
        name: &str,
        center: impl Into<DVec3>,
        normal: impl Into<DVec3>,
        radius: f64,
    ) -> &mut ObjectDescription {
        let turn = DQuat::from_rotation_arc(DVec3::Z, normal.into().normalize());
        let axes = DMat3::from_quat(turn) * DMat3::from_diagonal(DVec3::splat(radius));
        let shape = Shape::Disk { inner: 0.0 };
        self.object(name, shape, placed(axes, center.into()))
    }

    /// Adds a mesh, placed by an invertible map.
    pub fn mesh(
        &mut self,
        name: &str,
        mesh: impl Into<Arc<Mesh>>,
        to_world: DAffine3,
    ) -> &mut ObjectDescription {
        self.object(name, Shape::Mesh(mesh.into()), Transform::fixed(to_world))
    }

    /// Adds a pinhole camera of columns × rows pixels, placed by [`look_at`], with the full
    /// vertical field of view `fov_y_rad`.
    pub fn pinhole(
        &mut self,
        name: &str,
        resolution: [u32; 2],
        view: DAffine3,
        fov_y_rad: f64,
    ) -> &mut SensorDescription {
        self.perspective(name, resolution, view, fov_y_rad, None)
    }

    /// Adds a camera with a lens of finite aperture.
    pub fn thin_lens(
        &mut self,
        name: &str,
        resolution: [u32; 2],
        view: DAffine3,
        fov_y_rad: f64,
        lens: ThinLens,
    ) -> &mut SensorDescription {
        self.perspective(name, resolution, view, fov_y_rad, Some(lens))
    }

    fn perspective(
        &mut self,
        name: &str,
        resolution: [u32; 2],
        view: DAffine3,
        fov_y_rad: f64,
        lens: Option<ThinLens>,
    ) -> &mut SensorDescription {
        let view = Transform::fixed(view);
        // an angle that no camera has is told by `build`, with the other problems
        let possible = fov_y_rad > 0.0 && fov_y_rad < std::f64::consts::PI;
        let fov_y_rad = if possible { fov_y_rad } else { f64::NAN };
        let camera = Camera::perspective(view, pixels(resolution), fov_y_rad, lens);
        self.sensor(name, camera)
    }

    /// Adds a camera of parallel projection, with a film `width_m` wide.
    pub fn orthographic(
        &mut self,
        name: &str,
        resolution: [u32; 2],
        view: DAffine3,
        width_m: f64,
    ) -> &mut SensorDescription {
        let view = Transform::fixed(view);
        self.sensor(
            name,
            Camera::orthographic(view, pixels(resolution), width_m),
        )
    }

    /// Adds a rectangular detector, which absorbs: `u` and `v` lead from its center to the middle
    /// of the right and of the upper side, at right angles; it measures what arrives on the side of
    /// u × v.
    pub fn detector(
        &mut self,
        name: &str,
        resolution: [u32; 2],
        center: impl Into<DVec3>,
        u: impl Into<DVec3>,
        v: impl Into<DVec3>,
    ) -> &mut SensorDescription {
        let (u, v) = (u.into(), v.into());
        let axes = DMat3::from_cols(u.normalize(), v.normalize(), u.cross(v).normalize());
        let pose = DAffine3::from_mat3_translation(axes, center.into());
        let (width_m, height_m) = (2.0 * u.length(), 2.0 * v.length());
        let camera = Camera::detector(pose, width_m, height_m, pixels(resolution), false);
        self.sensor(name, camera)
    }
}

impl ObjectDescription {
    /// Gives it a material.
    pub fn of(&mut self, material: MaterialId) -> &mut Self {
        self.material = material;
        self
    }

    /// Fills a closed shape with a medium.
    pub fn filled_with(&mut self, medium: MediumId) -> &mut Self {
        let priority = 0;
        self.boundary = Boundary::Solid { medium, priority };
        self
    }

    /// Names the media on the side of the geometric normal and behind it.
    pub fn between(&mut self, above: MediumId, below: MediumId) -> &mut Self {
        self.boundary = Boundary::Interface { above, below };
        self
    }

    /// Makes it a light of a radiance (W/(m² sr nm), and W/(m² sr) per line), on the side of its
    /// normal.
    pub fn emits(&mut self, radiance: Emission) -> &mut Self {
        self.emission = Some(AreaEmission {
            radiance,
            pattern: None,
            two_sided: false,
        });
        self
    }
}
