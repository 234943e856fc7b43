//! Directions as places of a film: light by the angle at which it arrives, as on a screen so far
//! away that only its direction tells where it lands.
//!
//! The distance from the middle of the film is the angle to the normal of the detector (azimuthal
//! equidistant projection), so that angles are read off along both axes and from the middle
//! outward. A film of 2 hx × 2 hy rad spans solid angles of 4 hx hy sin θ/θ per share of its area.

use super::Resolution;
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

/// The directions that a film shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FarField {
    /// Angles from the normal to the middles of the right and upper sides, radians, in (0, π/2).
    pub half_rad: DVec2,
}

/// sin θ/θ.
fn sinc(theta: f64) -> f64 {
    if theta < 1e-9 {
        1.0
    } else {
        theta.sin() / theta
    }
}

impl FarField {
    /// Place in the square -1..1 of light that travels along a unit vector, given along u, v and
    /// the normal of the side that it arrives on. `None` where it does not arrive there.
    #[must_use]
    pub fn place(&self, travel: DVec3) -> Option<DVec2> {
        if travel.z >= 0.0 {
            return None;
        }
        let sin = travel.truncate().length();
        let theta = sin.atan2(-travel.z);
        Some(travel.truncate() / (sinc(theta) * self.half_rad))
    }

    /// The way that light travels which lands at a place of the square. `None` where none can.
    #[must_use]
    pub fn travel(&self, place: DVec2) -> Option<DVec3> {
        let angles = place * self.half_rad;
        let theta = angles.length();
        let travel = (angles * sinc(theta)).extend(-theta.cos());
        (theta < FRAC_PI_2).then_some(travel)
    }

    /// Solid angle per share of the film's area at a place of the square, steradians.
    #[must_use]
    pub fn solid_angle(&self, place: DVec2) -> f64 {
        let [x, y] = self.half_rad.to_array();
        4.0 * x * y * sinc((place * self.half_rad).length())
    }

    /// Solid angles of pixels of a film, row by row, in steradians; 0 where no light can arrive.
    #[must_use]
    pub fn pixels(
        &self,
        resolution: Resolution,
        columns: Range<u32>,
        rows: Range<u32>,
    ) -> Vec<f64> {
        let count = resolution.size().x * resolution.size().y;
        let pixel = |x: u32, y: u32| {
            let raster = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
            let place = resolution.raster_to_unit(raster);
            let is_open = self.travel(place).is_some();
            if is_open {
                self.solid_angle(place) / count
            } else {
                0.0
            }
        };
        rows.flat_map(|y| columns.clone().map(move |x| pixel(x, y)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIELD: FarField = FarField {
        half_rad: DVec2::new(1.2, 0.7),
    };

    #[test]
    fn places_are_angles_and_come_back() {
        for place in [DVec2::ZERO, DVec2::new(0.3, -0.9), DVec2::new(-1e-8, 1e-9)] {
            let travel = FIELD.travel(place).expect("within a right angle");
            assert!((travel.length() - 1.0).abs() < 1e-15);
            let back = FIELD.place(travel).expect("arrives");
            assert!((back - place).length() < 1e-14, "{place} {back}");
            let theta = (-travel.z).min(1.0).acos();
            assert!((theta - (place * FIELD.half_rad).length()).abs() < 1e-7);
        }
        assert_eq!(FIELD.travel(DVec2::ONE * 1.5), None);
        assert_eq!(FIELD.place(DVec3::Z), None);
    }

    /// The solid angles of all pixels of a film that shows a cap are that of the cap.
    #[test]
    fn pixels_add_up() {
        let cap = FarField {
            half_rad: DVec2::splat(1.0),
        };
        let (width, height) = (400, 400);
        let resolution = Resolution { width, height };
        let all = cap.pixels(resolution, 0..width, 0..height);
        let within = all.iter().enumerate().filter(|(i, _)| {
            let at = DVec2::new((i % 400) as f64, (i / 400) as f64) + 0.5;
            (at / 200.0 - 1.0).length() < 1.0
        });
        let sum: f64 = within.map(|(_, sr)| sr).sum();
        let exact = std::f64::consts::TAU * (1.0 - 1f64.cos());
        // 1250 pixels at the border, each in or out
        assert!((sum / exact - 1.0).abs() < 1e-3, "{sum} {exact}");
    }
}
