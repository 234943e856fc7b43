//! Clear apertures of surfaces, and the holes of stops.

use glam::DVec2;

/// Outline of a clear aperture about its center, millimeters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline {
    /// No edge is given: all of the surface.
    Open,
    /// Within a radius.
    Circle {
        /// Semi-diameter.
        radius: f64,
    },
    /// Between two radii.
    Annulus {
        /// Radius of the obscuration.
        inner: f64,
        /// Semi-diameter.
        outer: f64,
    },
    /// A rectangle along x and y.
    Rectangle {
        /// Half width and half height.
        half: DVec2,
    },
}

/// A clear aperture: what lies inside takes part, what lies outside absorbs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aperture {
    /// The outline.
    pub outline: Outline,
    /// Center of the outline, measured from the vertex, millimeters.
    pub center: DVec2,
}

impl Aperture {
    /// No edge.
    pub const OPEN: Self = Self {
        outline: Outline::Open,
        center: DVec2::ZERO,
    };

    /// A circle about the vertex.
    #[must_use]
    pub fn circle(radius: f64) -> Self {
        Self {
            outline: Outline::Circle { radius },
            center: DVec2::ZERO,
        }
    }

    /// Whether a point of the surface lies inside (edges do).
    #[must_use]
    #[inline]
    pub fn contains(&self, x: f64, y: f64) -> bool {
        let p = DVec2::new(x, y) - self.center;
        match self.outline {
            Outline::Open => true,
            Outline::Circle { radius } => p.length_squared() <= radius * radius,
            Outline::Annulus { inner, outer } => {
                (inner * inner..=outer * outer).contains(&p.length_squared())
            }
            Outline::Rectangle { half } => p.abs().cmple(half).all(),
        }
    }

    /// Greatest distance of an inside point from the vertex; infinite if there is no edge.
    #[must_use]
    pub fn extent(&self) -> f64 {
        match self.outline {
            Outline::Open => f64::INFINITY,
            Outline::Circle { radius } => self.center.length() + radius,
            Outline::Annulus { outer, .. } => self.center.length() + outer,
            Outline::Rectangle { half } => (self.center.abs() + half).length(),
        }
    }

    /// Semi-diameter of a circular outline.
    #[must_use]
    pub fn radius(&self) -> Option<f64> {
        match self.outline {
            Outline::Circle { radius } => Some(radius),
            Outline::Annulus { outer, .. } => Some(outer),
            _ => None,
        }
    }

    /// Whether its numbers are usable: finite, positive, inner below outer.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let size = match self.outline {
            Outline::Open => true,
            Outline::Circle { radius } => radius > 0.0 && radius.is_finite(),
            Outline::Annulus { inner, outer } => 0.0 <= inner && inner < outer && outer.is_finite(),
            Outline::Rectangle { half } => half.is_finite() && half.min_element() > 0.0,
        };
        size && self.center.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn insides_and_extents() {
        let off = |outline| Aperture {
            outline,
            center: DVec2::new(3.0, 4.0),
        };
        let circle = off(Outline::Circle { radius: 2.0 });
        assert!(circle.contains(3.0, 6.0) && !circle.contains(0.0, 0.0));
        assert_eq!(circle.extent(), 7.0);
        let ring = off(Outline::Annulus {
            inner: 1.0,
            outer: 2.0,
        });
        assert!(!ring.contains(3.0, 4.5) && ring.contains(3.0, 5.5));
        let half = DVec2::new(1.0, 2.0);
        let rectangle = off(Outline::Rectangle { half });
        assert!(rectangle.contains(4.0, 6.0) && !rectangle.contains(4.1, 4.0));
        assert_eq!(rectangle.extent(), 52f64.sqrt());
        assert!(Aperture::OPEN.contains(1e9, 0.0) && Aperture::OPEN.extent().is_infinite());
        assert!(!Aperture::circle(f64::NAN).is_valid() && !Aperture::circle(0.0).is_valid());
    }
}
