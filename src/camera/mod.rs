//! Sensors: where camera sub-paths begin and where light paths are measured.
//!
//! Raster coordinates are in pixels, (0, 0) the top left corner of the film, x to the right, y
//! down. `W_e` averages over the whole film (pixel value = film integral over the pixel × number of
//! pixels). Raster positions outside the film by a filter radius are as good as those inside:
//! densities continue there.
//!
//! `W_e` and densities follow Veach 1997, section 8.3, and Pharr, Jakob and Humphreys 2016, section
//! 16.1.

pub mod curved;
pub mod detector;
pub mod far_field;
pub mod orthographic;
pub mod perspective;

use crate::geometry::{
    DirectionalDensity, EndPoint, Link, Moment, Shutter, SurfacePoint, Transform,
};
use curved::Curved;
use detector::{Detector, Toward};
use far_field::FarField;
use glam::{DAffine3, DVec2, DVec3};
use orthographic::Orthographic;
use perspective::{Perspective, ThinLens};
use std::sync::Arc;

/// Film size in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Resolution {
    /// Columns and rows as numbers.
    #[must_use]
    pub fn size(self) -> DVec2 {
        DVec2::new(f64::from(self.width), f64::from(self.height))
    }

    /// Width over height.
    #[must_use]
    pub fn aspect(self) -> f64 {
        f64::from(self.width) / f64::from(self.height)
    }

    /// From raster coordinates to -1..1 over the film, x to the right and y up.
    fn raster_to_unit(self, raster: DVec2) -> DVec2 {
        (2.0 * raster / self.size() - 1.0) * DVec2::new(1.0, -1.0)
    }

    /// The inverse of `raster_to_unit`.
    fn unit_to_raster(self, unit: DVec2) -> DVec2 {
        (unit * DVec2::new(1.0, -1.0) + 1.0) * 0.5 * self.size()
    }

    /// Whether a raster position lies on the film widened by `margin` pixels.
    fn contains(self, raster: DVec2, margin: f64) -> bool {
        raster.cmpge(DVec2::splat(-margin)).all() && raster.cmple(self.size() + margin).all()
    }
}

/// The start of a camera sub-path with its first direction.
#[derive(Clone, Copy, Debug)]
pub struct CameraSample {
    /// x_k: on the lens, pinhole or detector.
    pub xk: EndPoint,
    /// Unit direction into the scene.
    pub direction: DVec3,
    /// Density of x_k: 1 for a pinhole and an orthographic camera, per area otherwise.
    pub pdf_xk: f64,
    /// Density of the direction.
    pub pdf_direction: DirectionalDensity,
    /// Throughput after the first direction without the medium's η²: `W_e cosθ_k/(pdf_xk p_ω)`: 1
    /// for cameras, π for detectors.
    pub weight: f64,
}

/// A direct connection (t = 1) from a scattering point to the sensor.
#[derive(Clone, Copy, Debug)]
pub struct SensorConnection {
    /// x_k.
    pub xk: EndPoint,
    /// Unit direction from the scattering point towards x_k.
    pub toward: DVec3,
    /// Distance to x_k (to the film plane for an orthographic camera).
    pub distance: f64,
    /// Density of x_k.
    pub pdf_xk: f64,
    /// Where it lands, in raster coordinates (may lie outside the film by a filter radius).
    pub raster: DVec2,
    /// `W_e |cosθ_k|/(d² pdf_xk)`; orthographic: `W_e` = 1/A_film: everything of the connection but
    /// the scattering point's own cosine and kernel, η², visibility and absorption.
    pub importance: f64,
}

/// How wide a pixel is along the rays through it.
#[derive(Clone, Copy, Debug)]
pub struct PixelWidth {
    /// At the sensor, in meters.
    offset: f64,
    /// Growth per length: the angle between the rays of neighboring pixels, in radians.
    angle: f64,
}

impl PixelWidth {
    /// After a path of `length` meters.
    #[must_use]
    pub fn at(&self, length: f64) -> f64 {
        self.offset + self.angle * length
    }
}

/// A camera or detector.
#[derive(Clone, Debug)]
pub struct Camera {
    transform: Transform,
    resolution: Resolution,
    /// The way it projects.
    pub kind: CameraKind,
}

/// The kinds of cameras.
#[derive(Clone, Debug)]
pub enum CameraKind {
    /// Pinhole or thin lens.
    Perspective(Perspective),
    /// Parallel projection.
    Orthographic(Orthographic),
    /// A real receiving surface that measures irradiance.
    Detector(Detector),
}

impl CameraKind {
    /// Name in messages.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Perspective(_) => "perspective",
            Self::Orthographic(_) => "orthographic",
            Self::Detector(_) => "detector",
        }
    }
}

impl Camera {
    /// A camera with the full vertical field of view `fov_y_rad` (0 < fov < π) placed by a rigid
    /// motion; square pixels. Without a lens it is a pinhole.
    #[must_use]
    pub fn perspective(
        transform: Transform,
        resolution: Resolution,
        fov_y_rad: f64,
        lens: Option<ThinLens>,
    ) -> Self {
        let kind = CameraKind::Perspective(Perspective::new(resolution, fov_y_rad, lens));
        Self {
            transform,
            resolution,
            kind,
        }
    }

    /// A camera of parallel rays with a film `width_m` meters wide (> 0), placed by a rigid motion;
    /// square pixels.
    #[must_use]
    pub fn orthographic(transform: Transform, resolution: Resolution, width_m: f64) -> Self {
        let kind = CameraKind::Orthographic(Orthographic::new(resolution, width_m));
        Self {
            transform,
            resolution,
            kind,
        }
    }

    /// A detector of `width_m` × `height_m` meters (> 0) at rest: centred on the origin of the
    /// rigid motion `pose`, u along its x axis and v along its y axis. It lets light through if
    /// `transparent`, else it absorbs it.
    #[must_use]
    pub fn detector(
        pose: DAffine3,
        width_m: f64,
        height_m: f64,
        resolution: Resolution,
        transparent: bool,
    ) -> Self {
        let scale = DVec3::new(0.5 * width_m, 0.5 * height_m, 1.0);
        Self {
            transform: Transform::fixed(pose * DAffine3::from_scale(scale)),
            resolution,
            kind: CameraKind::Detector(Detector {
                transparent,
                ..Detector::default()
            }),
        }
    }

    /// The same detector with most of its camera sub-paths toward a disk at rest, or the exit pupil
    /// of a lens; any other camera as it is.
    #[must_use]
    pub fn aimed(mut self, aim: Toward) -> Self {
        if let CameraKind::Detector(detector) = &mut self.kind {
            detector.aim = Some(aim);
        }
        self
    }

    /// The same detector with columns against u, as seen from behind; any other camera as it is.
    #[must_use]
    pub fn flipped(mut self) -> Self {
        if let CameraKind::Detector(detector) = &mut self.kind {
            detector.flipped = true;
        }
        self
    }

    /// The same detector, whose film is over directions; any other camera as it is.
    #[must_use]
    pub fn by_direction(mut self, field: FarField) -> Self {
        if let CameraKind::Detector(detector) = &mut self.kind {
            detector.far_field = Some(field);
        }
        self
    }

    /// The same detector, which measures light within this angle, (0, π/2) radians, of its normal
    /// alone; any other camera as it is.
    #[must_use]
    pub fn accepting(mut self, half_angle_rad: f64) -> Self {
        if let CameraKind::Detector(detector) = &mut self.kind {
            detector.acceptance_rad = Some(half_angle_rad);
        }
        self
    }

    /// The same detector, bent; any other camera as it is. The surface must be one over its
    /// rectangle.
    #[must_use]
    pub fn bent(mut self, curved: Curved) -> Self {
        if let CameraKind::Detector(detector) = &mut self.kind {
            detector.curved = Some(Arc::new(curved));
        }
        self
    }

    /// The same camera elsewhere.
    #[must_use]
    pub fn at(mut self, transform: Transform) -> Self {
        self.transform = transform;
        self
    }

    /// Whether the film has a finite extent.
    #[must_use]
    pub fn has_extent(&self) -> bool {
        match &self.kind {
            CameraKind::Perspective(camera) => camera.has_extent(),
            CameraKind::Orthographic(camera) => camera.has_extent(),
            // its extent is that of its transform
            CameraKind::Detector(_) => true,
        }
    }

    /// Film size in pixels.
    #[must_use]
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// Placement over the shutter (of a detector: the map of the square -1..1 to its surface).
    #[must_use]
    pub fn transform(&self) -> &Transform {
        &self.transform
    }

    /// Numbers its motion, see [`Transform::enumerate`].
    pub fn enumerate_motion(&mut self, next: &mut usize) {
        self.transform.enumerate(next);
    }

    /// The same sensor inside a hierarchy of moving `parents` (the outermost first; without scale)
    /// over `shutter`.
    #[must_use]
    pub fn under(mut self, parents: &[Link], shutter: Shutter) -> Self {
        self.transform = self.transform.under(parents, shutter);
        self
    }

    /// The detector, if it is one.
    #[must_use]
    pub fn as_detector(&self) -> Option<&Detector> {
        match &self.kind {
            CameraKind::Detector(detector) => Some(detector),
            _ => None,
        }
    }

    /// The directions that its film shows; `None` where it is over places.
    #[must_use]
    pub fn far_field(&self) -> Option<&FarField> {
        self.as_detector()?.far_field.as_ref()
    }

    /// The surface of a detector that is bent.
    #[must_use]
    pub fn curved(&self) -> Option<&Curved> {
        self.as_detector()?.curved.as_deref()
    }

    /// Area of the rectangle of a detector in m²; `None` for cameras.
    #[must_use]
    pub fn detector_area(&self, moment: Moment) -> Option<f64> {
        self.as_detector()?;
        Some(Detector::area(&self.transform.at(moment)))
    }

    /// Starts a camera sub-path at a raster position. `u_lens` chooses the lens point, or a
    /// detector's direction.
    #[must_use]
    pub fn sample_ray(&self, raster: DVec2, u_lens: DVec2, moment: Moment) -> CameraSample {
        let (place, resolution) = (&*self.transform.at(moment), self.resolution);
        match &self.kind {
            CameraKind::Perspective(camera) => camera.sample_ray(place, resolution, raster, u_lens),
            CameraKind::Orthographic(camera) => camera.sample_ray(place, resolution, raster),
            CameraKind::Detector(camera) => camera.sample_ray(place, resolution, raster, u_lens),
        }
    }

    /// Width of the pixel at a raster position.
    #[must_use]
    pub fn pixel_width(&self, raster: DVec2, moment: Moment) -> PixelWidth {
        let at = |raster| self.sample_ray(raster, DVec2::splat(0.5), moment);
        let (here, next) = (at(raster), at(raster + DVec2::X));
        PixelWidth {
            offset: here.xk.p.distance(next.xk.p),
            angle: here.direction.angle_between(next.direction),
        }
    }

    /// Connects a point to the sensor, with a lens or detector point chosen by `u_lens`. `margin`
    /// (pixels) widens the film by the filter's reach (a detector is never wider than its surface).
    /// `None` where the point is not seen.
    #[must_use]
    pub fn sample_connection(
        &self,
        x: DVec3,
        u_lens: DVec2,
        moment: Moment,
        margin: f64,
    ) -> Option<SensorConnection> {
        let (place, resolution) = (&*self.transform.at(moment), self.resolution);
        match &self.kind {
            CameraKind::Perspective(camera) => {
                camera.sample_connection(place, resolution, x, u_lens, margin)
            }
            CameraKind::Orthographic(camera) => {
                camera.sample_connection(place, resolution, x, margin)
            }
            CameraKind::Detector(camera) => {
                camera.sample_connection(place, resolution, x, u_lens, margin)
            }
        }
    }

    /// Density of the point `p` of this sensor and of leaving it in unit `direction` (into the
    /// scene).
    /// The density of the direction is 0 behind the sensor; it continues outside the film.
    #[must_use]
    pub fn density(&self, p: DVec3, direction: DVec3, moment: Moment) -> (f64, DirectionalDensity) {
        let place = &*self.transform.at(moment);
        match &self.kind {
            CameraKind::Perspective(camera) => camera.density(place, direction),
            CameraKind::Orthographic(camera) => camera.density(),
            CameraKind::Detector(camera) => camera.density(place, p, direction),
        }
    }

    /// A light path that hits the sensor (t = 0): raster position and `W_e` (1/A_det) where
    /// `toward_scene` (unit, back along the arriving ray) is on the accepting side. `None` for
    /// every sensor but a detector, and for points of other surfaces.
    #[must_use]
    pub fn arrive(
        &self,
        point: &SurfacePoint,
        toward_scene: DVec3,
        moment: Moment,
    ) -> Option<(DVec2, f64)> {
        let detector = self.as_detector()?;
        let place = &*self.transform.at(moment);
        detector.arrive(place, self.resolution, point, toward_scene)
    }

    /// Whether light paths can hit it: a detector.
    #[must_use]
    pub fn is_hittable(&self) -> bool {
        self.as_detector().is_some()
    }

    /// Whether its position is a single point or direction per pixel (pinhole, orthographic).
    #[must_use]
    pub fn is_delta(&self) -> bool {
        match &self.kind {
            CameraKind::Perspective(camera) => camera.lens().is_none(),
            CameraKind::Orthographic(_) => true,
            CameraKind::Detector(_) => false,
        }
    }
}

#[cfg(test)]
mod tests;
