//! Rims: where the clear part of a surface ends, and what continues it.

use super::LensBuildError;
use super::parts::{Builder, bad};
use crate::optics::{LensSurface, Outline, Profile};
use glam::DVec2;
use std::f64::consts::TAU;

/// Misalignment within a group that counts as rounding, millimeters and radians.
pub(super) const ALIGNED: f64 = 1e-9;
/// Points of a rim, and circles of a flange, that are looked at.
const SAMPLES: u32 = 64;

/// The rim of a round surface.
pub(super) struct Rim {
    /// Radius; 0 of a rectangle.
    pub radius: f64,
    /// Vertex of the surface along the axis.
    pub vertex: f64,
    /// Least and greatest place along the axis.
    pub low: f64,
    pub high: f64,
}

impl Builder<'_> {
    /// The flange that continues a narrower surface must be attached to it, and must not cross its
    /// neighbors.
    pub(super) fn check_flange(
        &self,
        rims: &[Rim],
        k: usize,
        i: usize,
        first: usize,
        radius: f64,
    ) -> Result<(), LensBuildError> {
        let rim = &rims[k];
        let outer = self.barrel.filter(|_| k == 0).unwrap_or(radius);
        if rim.radius >= outer {
            return Ok(());
        }
        if rim.high - rim.low > ALIGNED {
            return bad(
                i,
                format!(
                    "semi-diameter {} mm, and {outer} mm around it: the rim is not flat (allowed: \
                     the same)",
                    rim.radius
                ),
            );
        }
        let sense = if self.forward[first] { 1.0 } else { -1.0 };
        for (other, side) in [(k.wrapping_sub(1), -1.0), (k + 1, 1.0)] {
            let Some(next) = rims.get(other) else {
                continue;
            };
            if matches!(self.surface(first + other).profile, Profile::Toroid { .. }) {
                continue;
            }
            for step in 0..=SAMPLES {
                let share = f64::from(step) / f64::from(SAMPLES);
                let r = rim.radius + (radius - rim.radius) * share;
                let z = if r <= next.radius {
                    next.vertex + self.surface(first + other).profile.sag(r, 0.0)
                } else {
                    next.low
                };
                if (z - rim.low) * side * sense < -ALIGNED {
                    return bad(
                        i,
                        format!(
                            "its flange at {r:.4} mm from the axis crosses surface {} (allowed: \
                             another semi-diameter)",
                            first + other + 1
                        ),
                    );
                }
            }
        }
        Ok(())
    }

    /// The rim of a surface whose vertex is at `vertex` along the axis.
    pub(super) fn rim(&self, i: usize, vertex: f64) -> Rim {
        let LensSurface {
            profile, aperture, ..
        } = self.surface(i);
        let points = (0..SAMPLES).map(|k| {
            let turn = f64::from(k) / f64::from(SAMPLES);
            let at = match aperture.outline {
                Outline::Rectangle { half } => {
                    // along the four sides
                    let along = (turn * 4.0).fract() * 2.0 - 1.0;
                    match k * 4 / SAMPLES {
                        0 => half * DVec2::new(1.0, along),
                        1 => half * DVec2::new(along, 1.0),
                        2 => half * DVec2::new(-1.0, along),
                        _ => half * DVec2::new(along, -1.0),
                    }
                }
                _ => DVec2::from_angle(TAU * turn) * aperture.radius().unwrap_or(0.0),
            };
            let p = aperture.center + at;
            vertex + profile.sag(p.x, p.y)
        });
        let ends = points.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| {
            (low.min(z), high.max(z))
        });
        Rim {
            radius: aperture.radius().unwrap_or(0.0),
            vertex,
            low: ends.0,
            high: ends.1,
        }
    }
}
