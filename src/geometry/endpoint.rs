//! The first vertex of a sub-path, on a light or a sensor, as lights and cameras describe it.

use super::{SurfaceId, SurfacePoint};
use glam::DVec3;

/// A point of a light or sensor. Where light leaves in one direction alone `n` is that direction;
/// for lights at infinity `p` is meaningless.
#[derive(Clone, Copy, Debug)]
pub struct EndPoint {
    /// Position in world space.
    pub p: DVec3,
    /// Unit normal of the emitting or receiving side (area lights, detectors, lenses); zero for
    /// point lights and pinholes.
    pub n: DVec3,
    /// The face, if it is part of the scene's geometry.
    pub surface: Option<SurfaceId>,
    /// At infinity: directional light or environment.
    pub infinite: bool,
    /// Light leaves in the direction `n` alone: at infinity, or a point of a beam.
    pub parallel: bool,
}

impl EndPoint {
    /// Stands for an end that a sub-path does not have.
    pub const NONE: Self = Self {
        p: DVec3::ZERO,
        n: DVec3::ZERO,
        surface: None,
        infinite: false,
        parallel: false,
    };

    /// A point of the scene's geometry.
    #[must_use]
    pub fn on(point: &SurfacePoint) -> Self {
        Self {
            p: point.p,
            n: point.ng,
            surface: Some(point.id),
            ..Self::NONE
        }
    }

    /// The point of the scene's geometry that it is, without texture coordinates; `None` where it
    /// is none.
    #[must_use]
    pub fn surface_point(&self) -> Option<SurfacePoint> {
        let point = |id| SurfacePoint::flat(self.p, self.n, id);
        self.surface.map(point)
    }

    /// A point without extent.
    #[must_use]
    pub fn at(p: DVec3) -> Self {
        Self { p, ..Self::NONE }
    }

    /// A light at infinity whose light travels along the unit vector `direction`.
    #[must_use]
    pub fn toward_infinity(direction: DVec3) -> Self {
        Self {
            n: direction,
            infinite: true,
            parallel: true,
            ..Self::NONE
        }
    }

    /// A point of a beam whose light travels along the unit vector `direction`.
    #[must_use]
    pub fn in_beam(p: DVec3, direction: DVec3) -> Self {
        Self {
            p,
            n: direction,
            parallel: true,
            ..Self::NONE
        }
    }

    /// |cos| between the end point's normal and `w`; 1 where it has no normal or sends
    /// parallel light.
    #[must_use]
    pub fn cos(&self, w: DVec3) -> f64 {
        if self.parallel || self.n == DVec3::ZERO {
            1.0
        } else {
            self.n.dot(w).abs()
        }
    }
}

/// Density of the direction in which a sub-path leaves its end point, which fixes the area density
/// of the next vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DirectionalDensity {
    /// Per steradian at the end point: area density `pdf · cosθ / d²` at the next vertex.
    SolidAngle(f64),
    /// Per area perpendicular to the (fixed or already counted) direction: area density `pdf ·
    /// cosθ` at the next vertex.
    Perpendicular(f64),
}

impl DirectionalDensity {
    /// Another density in the same measure.
    #[must_use]
    pub fn map(self, change: impl FnOnce(f64) -> f64) -> Self {
        match self {
            Self::SolidAngle(pdf) => Self::SolidAngle(change(pdf)),
            Self::Perpendicular(pdf) => Self::Perpendicular(change(pdf)),
        }
    }

    /// The density, in its own measure.
    #[must_use]
    pub fn value(self) -> f64 {
        let (Self::SolidAngle(pdf) | Self::Perpendicular(pdf)) = self;
        pdf
    }

    /// Area density at the next vertex, at distance² `d2`, whose normal makes `cos` (absolute
    /// value) with the segment.
    #[must_use]
    pub fn area_density(self, cos: f64, d2: f64) -> f64 {
        match self {
            Self::SolidAngle(pdf) => pdf * cos / d2,
            Self::Perpendicular(pdf) => pdf * cos,
        }
    }
}
