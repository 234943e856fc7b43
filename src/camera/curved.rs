//! Bent detectors: spheres, cylinders and toroids, such as a retina or the curved focal surface of
//! a lens.
//!
//! The film is the rectangle in the tangent plane of the middle, and a place of it stands for the
//! point of the surface before or behind it, along the normal of that plane. What is measured is
//! irradiance on the surface itself: a pixel has the area of the part of it that is before or
//! behind the pixel, which is larger than that of the pixel by the mean of 1/cos of its slope.

use super::Resolution;
use crate::geometry::LensShape;
use crate::optics::{Aperture, LensSurface, Outline, Profile};
use glam::{DAffine3, DVec2, DVec3};
use std::ops::Range;
use std::sync::Arc;

/// Metres per millimeter, the unit of surfaces.
const MM: f64 = 1e-3;
/// Points along each side of a pixel at which its slope is looked at (Gauss and Legendre's rule of
/// two points).
const GAUSS: f64 = 0.577_350_269_189_625_8;

/// A surface over the rectangle of a detector.
#[derive(Clone, Debug, PartialEq)]
pub struct Curved {
    /// Radii along u and v in meters; 0: flat.
    radii_m: [f64; 2],
    /// Half width and half height of the rectangle in meters.
    half_m: DVec2,
    profile: Profile,
    shape: Arc<LensShape>,
}

impl Curved {
    /// A surface of these radii along u and v in meters, positive where the center lies on the side
    /// that measures, 0 where it is straight, over a rectangle of these half edges in meters.
    /// `None` where it does not reach as far, and where it is flat.
    #[must_use]
    pub fn new(radii_m: [f64; 2], half_m: DVec2) -> Option<Self> {
        let curvature = |radius: f64| if radius == 0.0 { 0.0 } else { MM / radius };
        let [x, y] = radii_m.map(curvature);
        let profile = if x == y {
            Profile::Conic {
                curvature: x,
                conic: 0.0,
            }
        } else {
            Profile::Toroid {
                curvature_x: x,
                curvature_y: y,
                conic_y: 0.0,
                even_y: Vec::new(),
            }
        };
        let aperture = Aperture {
            outline: Outline::Rectangle { half: half_m / MM },
            center: DVec2::ZERO,
        };
        let shape = LensShape::new(LensSurface::new(profile.clone(), aperture))?;
        // at the edge of a hemisphere the slope has no bound
        let [.., slope_x, slope_y] = profile.sag_and_slopes(half_m.x / MM, half_m.y / MM);
        let is_steep = !(slope_x.abs() < 1e6 && slope_y.abs() < 1e6);
        (!profile.is_plane() && !is_steep).then(|| Self {
            radii_m,
            half_m,
            profile,
            shape: Arc::new(shape),
        })
    }

    /// Radii along u and v in meters.
    #[must_use]
    pub fn radii_m(&self) -> [f64; 2] {
        self.radii_m
    }

    /// The surface as a shape, in millimeters about the middle.
    #[must_use]
    pub fn shape(&self) -> Arc<LensShape> {
        Arc::clone(&self.shape)
    }

    /// From the space of the shape to that of the square -1..1 which the rectangle is the image of.
    #[must_use]
    pub fn to_square(&self) -> DAffine3 {
        DAffine3::from_scale((MM / self.half_m).extend(MM))
    }

    /// Height over the tangent plane in meters, and slopes along u and v, at a place in meters from
    /// the middle.
    #[must_use]
    pub fn at(&self, place_m: DVec2) -> (f64, DVec2) {
        let [sag, x, y] = self.profile.sag_and_slopes(place_m.x / MM, place_m.y / MM);
        (sag * MM, DVec2::new(x, y))
    }

    /// Area over that of the tangent plane at a place in meters from the middle.
    #[must_use]
    pub fn stretch(&self, place_m: DVec2) -> f64 {
        (1.0 + self.at(place_m).1.length_squared()).sqrt()
    }

    /// Areas of the parts of the surface of pixels, as multiples of the areas of the pixels, row by
    /// row from the top.
    #[must_use]
    pub fn stretches(
        &self,
        resolution: Resolution,
        columns: Range<u32>,
        rows: Range<u32>,
    ) -> Vec<f64> {
        let pixel = |x: u32, y: u32| {
            let middle = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
            let at = |dx: f64, dy: f64| {
                let raster = middle + 0.5 * GAUSS * DVec2::new(dx, dy);
                self.stretch(resolution.raster_to_unit(raster) * self.half_m)
            };
            0.25 * (at(-1.0, -1.0) + at(1.0, -1.0) + at(-1.0, 1.0) + at(1.0, 1.0))
        };
        rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
            .map(|(x, y)| pixel(x, y))
            .collect()
    }
}

/// Unit normal of a surface with these slopes over a plane along `axes` (u, v, normal).
pub(super) fn normal(axes: [DVec3; 3], slopes: DVec2) -> DVec3 {
    let [u, v, n] = axes;
    (n - slopes.x * u - slopes.y * v).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const RESOLUTION: Resolution = Resolution {
        width: 200,
        height: 100,
    };

    /// Areas of all pixels add up to those of a cylinder and of a sphere over a rectangle.
    #[test]
    fn pixels_add_up() {
        let half = DVec2::new(0.01, 0.006);
        let sum = |radii| {
            let curved = Curved::new(radii, half).expect("a surface");
            let all = curved.stretches(RESOLUTION, 0..200, 0..100);
            all.iter().sum::<f64>() / 20_000.0 * 4.0 * half.x * half.y
        };
        let radius = 0.0125;
        let cylinder = 2.0 * radius * (half.x / radius).asin() * 2.0 * half.y;
        assert!((sum([radius, 0.0]) / cylinder - 1.0).abs() < 1e-7);
        let cylinder = 2.0 * radius * (half.y / radius).asin() * 2.0 * half.x;
        assert!((sum([0.0, -radius]) / cylinder - 1.0).abs() < 1e-7);
        // of a sphere by strips: R ∫ 2 asin(b/√(R² - x²)) dx
        let n = 100_000;
        let strip = |i: i32| {
            let x = half.x * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
            2.0 * (half.y / (radius * radius - x * x).sqrt()).asin()
        };
        let sphere = radius * 2.0 * half.x / f64::from(n) * (0..n).map(strip).sum::<f64>();
        assert!((sum([-radius; 2]) / sphere - 1.0).abs() < 1e-6);
        assert!(sphere < TAU * radius * radius);
    }

    #[test]
    fn surfaces_that_do_not_reach_are_none() {
        let half = DVec2::new(0.03, 0.04);
        for (radii, is_there) in [
            ([0.06; 2], true),
            ([-0.051; 2], true),
            ([0.05; 2], false),
            ([0.02, 0.0], false),
            ([0.0; 2], false),
        ] {
            assert_eq!(Curved::new(radii, half).is_some(), is_there, "{radii:?}");
        }
    }

    /// The sag has the sign of the radius.
    #[test]
    fn centers_lie_on_the_side_of_the_sign() {
        let curved = Curved::new([0.05; 2], DVec2::splat(0.02)).expect("a sphere");
        let place = DVec2::new(0.01, -0.013);
        let (sag, slopes) = curved.at(place);
        let p = place.extend(sag);
        assert!(((p - DVec3::Z * 0.05).length() - 0.05).abs() < 1e-16);
        let n = normal([DVec3::X, DVec3::Y, DVec3::Z], slopes);
        assert!((n - (DVec3::Z * 0.05 - p) / 0.05).length() < 1e-14);
        assert!((curved.stretch(place) - 1.0 / n.z).abs() < 1e-14);
    }
}
