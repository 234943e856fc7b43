//! Sensors: where camera sub-paths begin and where light paths are measured.
//!
//! Raster coordinates are in pixels, (0, 0) the top left corner of the film, x to the right, y down. `W_e` averages over the
//! whole film (pixel value = film integral over the pixel × number of pixels).

pub mod detector;
pub mod orthographic;
pub mod perspective;

use crate::geometry::{DirectionalDensity, EndPoint, SurfacePoint, Transform};
use glam::{DVec2, DVec3};

/// Film size in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
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
    /// Throughput after the first direction without the medium's η²: `W_e cosθ_k/(pdf_xk p_ω)`: 1 for cameras, π for detectors.
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
    /// `W_e |cosθ_k|/(d² pdf_xk)`; orthographic: `W_e` = 1/A_film: everything of the connection but the scattering point's own
    /// cosine and kernel, η², visibility and absorption.
    pub importance: f64,
}

/// A camera or detector.
#[derive(Clone, Debug)]
pub enum Camera {
    /// Pinhole or thin lens.
    Perspective(perspective::Perspective),
    /// Parallel projection.
    Orthographic(orthographic::Orthographic),
    /// A real receiving surface that measures irradiance.
    Detector(detector::Detector),
}

#[allow(unused_variables)]
impl Camera {
    /// Film size in pixels.
    #[must_use]
    pub fn resolution(&self) -> Resolution {
        todo!()
    }

    /// Where the camera is over the shutter.
    #[must_use]
    pub fn transform(&self) -> &Transform {
        todo!()
    }

    /// Starts a camera sub-path at a raster position.
    #[must_use]
    pub fn sample_ray(&self, raster: DVec2, u_lens: DVec2, time: f64) -> CameraSample {
        todo!()
    }

    /// Connects a point to the sensor, with a lens or detector point chosen by `u_lens`. `margin` (pixels) widens the film by
    /// the filter's reach. `None` where the point is not seen.
    #[must_use]
    pub fn sample_connection(&self, x: DVec3, u_lens: DVec2, time: f64, margin: f64) -> Option<SensorConnection> {
        todo!()
    }

    /// Density of `xk` and of leaving it in unit `direction` (into the scene); (0, SolidAngle(0)) outside the film.
    #[must_use]
    pub fn density(&self, xk: &EndPoint, direction: DVec3, time: f64) -> (f64, DirectionalDensity) {
        todo!()
    }

    /// A light path that hits the sensor (t = 0): raster position and `W_e` (1/A_det) where `toward_scene` (unit, back along
    /// the arriving ray) is on the accepting side. `None` for every sensor but a detector.
    #[must_use]
    pub fn arrive(&self, point: &SurfacePoint, toward_scene: DVec3) -> Option<(DVec2, f64)> {
        todo!()
    }

    /// Whether light paths can hit it (detector).
    #[must_use]
    pub fn is_hittable(&self) -> bool {
        matches!(self, Self::Detector(_))
    }

    /// Whether its position is a single point or direction per pixel (pinhole, orthographic).
    #[must_use]
    pub fn is_delta(&self) -> bool {
        todo!()
    }
}
