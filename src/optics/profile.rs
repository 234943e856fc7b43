//! Shapes of lens surfaces: the sag z(x, y) over the tangent plane of the vertex, its slopes and
//! its domain.
//!
//! With curvature c and conic constant k the base is z = c r^2 / (1 + sqrt(1 - (1 + k) c^2 r^2));
//! aspheres add powers of r (Malacara and Malacara, Handbook of Optical Design, 2nd ed., appendix
//! 2).

use super::interval::Interval;

/// The shape of a surface. Lengths in millimeters, curvatures in 1/mm.
#[derive(Clone, Debug, PartialEq)]
pub enum Profile {
    /// A plane, a sphere or a conic of revolution.
    Conic {
        /// Curvature of the vertex.
        curvature: f64,
        /// Conic constant: 0 sphere, -1 paraboloid.
        conic: f64,
    },
    /// A conic plus even powers of r.
    EvenAsphere {
        /// Curvature of the conic.
        curvature: f64,
        /// Conic constant.
        conic: f64,
        /// Coefficients of r^2, r^4, r^6, ...
        even: Vec<f64>,
    },
    /// A conic plus all powers of r.
    OddAsphere {
        /// Curvature of the conic.
        curvature: f64,
        /// Conic constant.
        conic: f64,
        /// Coefficients of r, r^2, r^3, ...
        powers: Vec<f64>,
    },
    /// A curve in the yz plane rotated about a line parallel to y: toroids, cylinders (curvature 0
    /// across x or along y).
    Toroid {
        /// Curvature of the vertex along x, that of the rotation.
        curvature_x: f64,
        /// Curvature of the curve in the yz plane.
        curvature_y: f64,
        /// Conic constant of that curve.
        conic_y: f64,
        /// Coefficients of y^2, y^4, ... of that curve.
        even_y: Vec<f64>,
    },
}

/// Sag of a conic and its derivative by u = r^2; NaN beyond its domain.
fn conic_sag(c: f64, k: f64, u: f64) -> (f64, f64) {
    let root = (1.0 - (1.0 + k) * c * c * u).sqrt();
    (c * u / (1.0 + root), 0.5 * c / root)
}

/// Sum of a_i u^(i + 1), and its derivative.
fn power_sum(a: &[f64], u: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for &a in a.iter().rev() {
        slope = slope * u + value;
        value = value * u + a;
    }
    (value * u, slope * u + value)
}

/// Ranges of the same over an interval that is not negative: each power is monotone there.
fn power_range(a: &[f64], u: Interval) -> (Interval, Interval) {
    let (mut value, mut slope) = (Interval::point(0.0), Interval::point(0.0));
    let (mut lo, mut hi) = (1.0, 1.0);
    for (i, &a) in a.iter().enumerate() {
        slope = slope + Interval::new(lo, hi).scaled(a * (i + 1) as f64);
        (lo, hi) = (lo * u.lo, hi * u.hi);
        value = value + Interval::new(lo, hi).scaled(a);
    }
    (value, slope)
}

impl Profile {
    /// The plane.
    pub const PLANE: Self = Self::Conic {
        curvature: 0.0,
        conic: 0.0,
    };

    /// A sphere by its signed radius; 0 or infinite: the plane, as lens files write it.
    #[must_use]
    pub fn sphere(radius: f64) -> Self {
        let curvature = if radius == 0.0 { 0.0 } else { 1.0 / radius };
        Self::Conic {
            curvature,
            conic: 0.0,
        }
    }

    /// Whether it is the plane.
    #[must_use]
    pub fn is_plane(&self) -> bool {
        matches!(self, Self::Conic { curvature, .. } if *curvature == 0.0)
    }

    /// Curvature and conic constant of the base (along y for a toroid).
    #[must_use]
    pub fn base(&self) -> (f64, f64) {
        match self {
            Self::Conic { curvature, conic }
            | Self::EvenAsphere {
                curvature, conic, ..
            }
            | Self::OddAsphere {
                curvature, conic, ..
            } => (*curvature, *conic),
            Self::Toroid {
                curvature_y,
                conic_y,
                ..
            } => (*curvature_y, *conic_y),
        }
    }

    /// Curvature at the vertex in the yz plane, the r^2 term included: that of paraxial rays.
    #[must_use]
    pub fn vertex_curvature(&self) -> f64 {
        let second = match self {
            Self::Conic { .. } => 0.0,
            Self::EvenAsphere { even, .. } | Self::Toroid { even_y: even, .. } => {
                even.first().copied().unwrap_or(0.0)
            }
            Self::OddAsphere { powers, .. } => powers.get(1).copied().unwrap_or(0.0),
        };
        self.base().0 + 2.0 * second
    }

    /// Coefficient of r^4 (y^4 for a toroid) beyond that of the sphere of the vertex curvature.
    #[must_use]
    pub fn fourth_order(&self) -> f64 {
        let (c, k) = self.base();
        let fourth = match self {
            Self::Conic { .. } => 0.0,
            Self::EvenAsphere { even, .. } | Self::Toroid { even_y: even, .. } => {
                even.get(1).copied().unwrap_or(0.0)
            }
            Self::OddAsphere { powers, .. } => powers.get(3).copied().unwrap_or(0.0),
        };
        ((1.0 + k) * c.powi(3) - self.vertex_curvature().powi(3)) / 8.0 + fourth
    }

    /// Distance from the vertex up to which there is a surface, in the directions where it is
    /// least.
    #[must_use]
    pub fn domain_radius(&self) -> f64 {
        let conic = |c: f64, k: f64| {
            let under = (1.0 + k) * c * c;
            if under > 0.0 {
                under.sqrt().recip()
            } else {
                f64::INFINITY
            }
        };
        let (c, k) = self.base();
        match self {
            Self::Toroid { curvature_x, .. } => conic(c, k).min(conic(*curvature_x, 0.0)),
            _ => conic(c, k),
        }
    }

    /// All numbers of the shape are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let (c, k) = self.base();
        let rest = match self {
            Self::Conic { .. } => true,
            Self::EvenAsphere { even: a, .. } | Self::OddAsphere { powers: a, .. } => {
                a.iter().all(|a| a.is_finite())
            }
            Self::Toroid {
                curvature_x,
                even_y,
                ..
            } => curvature_x.is_finite() && even_y.iter().all(|a| a.is_finite()),
        };
        c.is_finite() && k.is_finite() && rest
    }

    /// The sag at a point; NaN where there is no surface.
    #[must_use]
    pub fn sag(&self, x: f64, y: f64) -> f64 {
        self.sag_and_slopes(x, y)[0]
    }

    /// Sag, its derivative along x and along y; NaN where there is no surface.
    #[must_use]
    pub fn sag_and_slopes(&self, x: f64, y: f64) -> [f64; 3] {
        let u = x * x + y * y;
        let (c, k) = self.base();
        match self {
            Self::Conic { .. } => {
                let (z, du) = conic_sag(c, k, u);
                [z, 2.0 * x * du, 2.0 * y * du]
            }
            Self::EvenAsphere { even, .. } => {
                let (z, du) = conic_sag(c, k, u);
                let (p, dp) = power_sum(even, u);
                [z + p, 2.0 * x * (du + dp), 2.0 * y * (du + dp)]
            }
            Self::OddAsphere { powers, .. } => {
                let r = u.sqrt();
                let (z, du) = conic_sag(c, k, u);
                let (p, dp) = power_sum(powers, r);
                // a cone has no slope at its tip: the mean of all directions is 0
                let by_r = if r > 0.0 { dp / r } else { 0.0 };
                [z + p, x * (2.0 * du + by_r), y * (2.0 * du + by_r)]
            }
            Self::Toroid {
                curvature_x: cx,
                even_y,
                ..
            } => {
                let v = y * y;
                let (z, dv) = conic_sag(c, k, v);
                let (p, dp) = power_sum(even_y, v);
                let (g, slope) = (z + p, 2.0 * y * (dv + dp));
                let rim = 1.0 - cx * g;
                let root = (rim * rim - cx * cx * x * x).sqrt();
                let sag = (g * (2.0 - cx * g) + cx * x * x) / (1.0 + root);
                [sag, cx * x / root, slope * rim / root]
            }
        }
    }

    /// Bounds of the sag within `radius` of the vertex.
    pub(super) fn sag_bounds(&self, radius: f64) -> Interval {
        let across = Interval::new(-radius, radius);
        self.bounds(Interval::new(0.0, radius * radius), across, across)
            .0
    }

    /// Least and greatest sag of a conic where the square of the distance from the axis is between
    /// two numbers, in order and not negative.
    pub(crate) fn sag_between(&self, squares: [f64; 2]) -> [f64; 2] {
        let across = Interval::new(-squares[1].sqrt(), squares[1].sqrt());
        let sag = self.bounds(Interval::new(squares[0], squares[1]), across, across);
        [sag.0.lo, sag.0.hi]
    }

    /// Bounds of sag and slopes: of z, and of the derivatives by u = r^2 (`Conic`, `EvenAsphere`),
    /// by u and r (`OddAsphere`), or by x and y (`Toroid`), over points with r^2 in `u`, x in `x`
    /// and y in `y`.
    pub(super) fn bounds(
        &self,
        u: Interval,
        x: Interval,
        y: Interval,
    ) -> (Interval, [Interval; 2]) {
        let (c, k) = self.base();
        let conic = |u: Interval| {
            let (z0, s0) = conic_sag(c, k, u.lo);
            let (z1, s1) = conic_sag(c, k, u.hi);
            let limit = |s: f64| {
                if s.is_nan() {
                    c.signum() * f64::INFINITY
                } else {
                    s
                }
            };
            let edge = |z: f64| if z.is_nan() { c.recip() / (1.0 + k) } else { z };
            (Interval::new(z0, edge(z1)), Interval::new(s0, limit(s1)))
        };
        let none = Interval::point(0.0);
        match self {
            Self::Conic { .. } => {
                let (z, du) = conic(u);
                (z, [du, none])
            }
            Self::EvenAsphere { even, .. } => {
                let ((z, du), (p, dp)) = (conic(u), power_range(even, u));
                (z + p, [du + dp, none])
            }
            Self::OddAsphere { powers, .. } => {
                let ((z, du), (p, dp)) = (conic(u), power_range(powers, u.sqrt()));
                (z + p, [du, dp])
            }
            Self::Toroid {
                curvature_x: cx,
                even_y,
                ..
            } => {
                let v = y.square();
                let ((z, dv), (p, dp)) = (conic(v), power_range(even_y, v));
                let g = z + p;
                let slope = y.scaled(2.0) * (dv + dp);
                let one = Interval::point(1.0);
                let rim = one - g.scaled(*cx);
                let root = (rim.square() - x.square().scaled(cx * cx)).sqrt();
                let over = root.recip_positive();
                let top = g * (one + rim) + x.square().scaled(*cx);
                (
                    top * (one + root).recip_positive(),
                    [x.scaled(*cx) * over, slope * rim * over],
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Vec<Profile> {
        let (curvature, conic) = (0.02, -0.7);
        vec![
            Profile::PLANE,
            Profile::sphere(-40.0),
            Profile::Conic { curvature, conic },
            Profile::EvenAsphere {
                curvature,
                conic,
                even: vec![1e-3, -2e-5, 3e-8],
            },
            Profile::OddAsphere {
                curvature,
                conic,
                powers: vec![0.01, 1e-3, -2e-4, 1e-6],
            },
            Profile::Toroid {
                curvature_x: -0.03,
                curvature_y: 0.02,
                conic_y: 0.4,
                even_y: vec![1e-4, 1e-6],
            },
            Profile::Toroid {
                curvature_x: 0.0,
                curvature_y: 0.05,
                conic_y: 0.0,
                even_y: vec![],
            },
        ]
    }

    #[test]
    fn slopes_are_those_of_the_sag_and_bounds_enclose_both() {
        let h = 1e-6;
        for profile in all() {
            for i in 0..200 {
                let angle = f64::from(i) * 2.4;
                let r = 8.0 * (f64::from(i) / 200.0).sqrt() + 0.01;
                let (x, y) = (r * angle.cos(), r * angle.sin());
                let [z, zx, zy] = profile.sag_and_slopes(x, y);
                let dx = (profile.sag(x + h, y) - profile.sag(x - h, y)) / (2.0 * h);
                let dy = (profile.sag(x, y + h) - profile.sag(x, y - h)) / (2.0 * h);
                assert!(
                    (zx - dx).abs() < 1e-8 && (zy - dy).abs() < 1e-8,
                    "{profile:?} {x} {y}"
                );
                let box_x = Interval::new(x - 0.3, x + 0.1);
                let box_y = Interval::new(y - 0.2, y + 0.2);
                let u = box_x.square() + box_y.square();
                let (bounds, [a, b]) = profile.bounds(u, box_x, box_y);
                assert!(
                    bounds.lo - 1e-12 <= z && z <= bounds.hi + 1e-12,
                    "{profile:?}"
                );
                if matches!(profile, Profile::Toroid { .. }) {
                    assert!(a.lo <= zx && zx <= a.hi && b.lo <= zy && zy <= b.hi);
                }
            }
        }
    }

    #[test]
    fn a_torus_is_a_rotated_circle() {
        // distance from the axis of rotation x = 0, z = R is |R - g(y)|
        let (rx, ry) = (-30.0, 50.0);
        let torus = Profile::Toroid {
            curvature_x: 1.0 / rx,
            curvature_y: 1.0 / ry,
            conic_y: 0.0,
            even_y: vec![],
        };
        for (x, y) in [(0.0, 0.0), (5.0, 0.0), (0.0, 7.0), (-4.0, 9.0)] {
            let z = torus.sag(x, y);
            let g = ry - (ry * ry - y * y).sqrt();
            assert!(((z - rx).hypot(x) - (rx - g).abs()).abs() < 1e-12);
        }
    }

    #[test]
    fn the_fourth_order_term_is_the_limit_of_the_sag() {
        for profile in &all()[1..4] {
            let r = 0.5;
            let sphere = Profile::Conic {
                curvature: profile.vertex_curvature(),
                conic: 0.0,
            };
            let ratio = (profile.sag(0.0, r) - sphere.sag(0.0, r)) / r.powi(4);
            assert!(
                (ratio - profile.fourth_order()).abs() < 1e-7,
                "{profile:?} {ratio}"
            );
        }
    }
}
