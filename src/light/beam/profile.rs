//! Irradiance across a beam, relative to that on its axis or to the values of a table, and how
//! points are drawn by it.
//!
//! Uniform and Gaussian beams are drawn in proportion to their irradiance. Any other is cut into
//! rings, which are drawn by their flux, and points of a ring by area: what is left of the profile
//! within a ring is the weight of the point.

use std::f64::consts::PI;

/// Rings of equal area up to where the profile has fallen to nothing.
const RINGS: u32 = 1024;
/// Twice the power of r / waist from which on a super-Gaussian counts as nothing: 1e-12 of the
/// axis.
const NOTHING: f64 = 27.6;
/// Nodes and weights of Gauss and Legendre's rule of eight points over -1..1, the positive half.
const GAUSS: [[f64; 2]; 4] = [
    [0.183_434_642_495_649_8, 0.362_683_783_378_362],
    [0.525_532_409_916_329, 0.313_706_645_877_887_27],
    [0.796_666_477_413_626_7, 0.222_381_034_453_374_48],
    [0.960_289_856_497_536_3, 0.101_228_536_290_376_26],
];

/// A function of the distance from the axis.
#[derive(Clone, Debug, PartialEq)]
enum Radial {
    /// `exp(-2 (r / waist)^order)`.
    SuperGaussian { waist_m: f64, order: f64 },
    /// Linear between knots (distance in meters, value), the first at 0.
    Table(Vec<[f64; 2]>),
}

impl Radial {
    fn at(&self, r: f64) -> f64 {
        match self {
            Self::SuperGaussian { waist_m, order } => (-2.0 * (r / waist_m).powf(*order)).exp(),
            Self::Table(knots) => {
                let i = knots.partition_point(|k| k[0] <= r);
                let i = i.clamp(1, knots.len() - 1);
                let [[a, low], [b, high]] = [knots[i - 1], knots[i]];
                low + (high - low) * ((r - a) / (b - a)).clamp(0.0, 1.0)
            }
        }
    }

    /// Integral over the ring between two squared distances, in which no knot lies.
    fn flux(&self, from: f64, to: f64) -> f64 {
        match self {
            Self::SuperGaussian { .. } => {
                // over r, in which it is smooth on the axis too
                let [a, b] = [from.sqrt(), to.sqrt()];
                let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
                let pair = |[node, weight]: [f64; 2]| {
                    let at = |r: f64| r * self.at(r);
                    weight * (at(middle - node * half) + at(middle + node * half))
                };
                2.0 * PI * half * GAUSS.map(pair).into_iter().sum::<f64>()
            }
            Self::Table(_) => {
                // linear in r: 2π ∫ (p + q (r - a)) r dr, about the middle of the ring
                let [a, b] = [from.sqrt(), to.sqrt()];
                let [low, high] = [self.at(a), self.at(b)];
                let middle = 0.5 * (a + b);
                let width = b - a;
                2.0 * PI * width * (0.5 * (low + high) * middle + (high - low) * width / 12.0)
            }
        }
    }
}

/// A profile cut into rings.
#[derive(Clone, Debug, PartialEq)]
pub struct RingProfile {
    radial: Radial,
    /// Squared radii between rings, ascending: 0 first, that of the aperture last.
    squares: Vec<f64>,
    /// Flux within each of these radii per unit of the profile, m².
    within: Vec<f64>,
}

/// Why a table is no profile of a beam.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProfileError {
    /// Fewer than two rows.
    #[error("a profile has at least two rows [distance, value]")]
    Short,
    /// The first row is not that of the axis.
    #[error("a profile begins on the axis, at distance 0")]
    NoAxis,
    /// Distances do not ascend.
    #[error("distances of a profile must increase from row to row")]
    Order,
    /// A value is negative, too large, or not a number.
    #[error("values of a profile are numbers from 0 to 1e6")]
    Value,
    /// The table ends inside the beam.
    #[error(
        "the profile ends within the radius of the beam (allowed: a last distance of at least the radius)"
    )]
    Ends,
    /// No light at all within the aperture.
    #[error("the profile is 0 all over the beam")]
    Dark,
}

impl RingProfile {
    /// `exp(-2 (r / waist)^order)` within an aperture: at `order` 2 a Gaussian, flatter with
    /// steeper edges above it. All lengths in meters, > 0; `order` in 1 to 100.
    #[must_use]
    pub fn super_gaussian(radius_m: f64, waist_m: f64, order: f64) -> Self {
        let radial = Radial::SuperGaussian { waist_m, order };
        let end = waist_m * (0.5 * NOTHING).powf(order.recip());
        let mut squares = steps(end.min(radius_m).powi(2));
        if end < radius_m {
            squares.push(radius_m * radius_m);
        }
        Self::of(radial, squares)
    }

    /// A table of rows (distance from the axis in meters, value), linear in between.
    ///
    /// # Errors
    /// Where it is none, does not reach `radius_m`, or is dark within it.
    pub fn table(radius_m: f64, rows: &[[f64; 2]]) -> Result<Self, ProfileError> {
        if rows.len() < 2 {
            return Err(ProfileError::Short);
        }
        if rows[0][0] != 0.0 {
            return Err(ProfileError::NoAxis);
        }
        if !rows.windows(2).all(|w| w[0][0] < w[1][0]) {
            return Err(ProfileError::Order);
        }
        if !rows.iter().all(|row| (0.0..=1e6).contains(&row[1])) {
            return Err(ProfileError::Value);
        }
        let last = rows[rows.len() - 1][0];
        // a radius in another unit may be off by a rounding
        if last < radius_m * (1.0 - 1e-12) {
            return Err(ProfileError::Ends);
        }
        let mut squares = steps(radius_m * radius_m);
        let inner = rows.iter().map(|row| row[0] * row[0]);
        squares.extend(inner.filter(|square| *square < radius_m * radius_m));
        squares.sort_by(f64::total_cmp);
        squares.dedup();
        let profile = Self::of(Radial::Table(rows.to_vec()), squares);
        if profile.flux() > 0.0 {
            Ok(profile)
        } else {
            Err(ProfileError::Dark)
        }
    }

    fn of(radial: Radial, squares: Vec<f64>) -> Self {
        let mut sum = 0.0;
        let rings = squares.windows(2).map(|ring| {
            sum += radial.flux(ring[0], ring[1]);
            sum
        });
        let within = std::iter::once(0.0).chain(rings).collect();
        Self {
            radial,
            squares,
            within,
        }
    }

    /// Flux through the aperture per unit of the profile, m².
    #[must_use]
    pub fn flux(&self) -> f64 {
        self.within[self.within.len() - 1]
    }

    /// Value at a squared distance from the axis.
    #[must_use]
    pub fn at(&self, square: f64) -> f64 {
        self.radial.at(square.sqrt())
    }

    /// Density per area with which points at a squared distance are drawn, 1/m².
    #[must_use]
    pub fn density(&self, square: f64) -> f64 {
        let ring = self.squares.partition_point(|s| *s <= square);
        let ring = ring.clamp(1, self.squares.len() - 1);
        let area = PI * (self.squares[ring] - self.squares[ring - 1]);
        (self.within[ring] - self.within[ring - 1]) / (self.flux() * area)
    }

    /// Squared distance of a number in [0, 1).
    #[must_use]
    pub fn draw(&self, u: f64) -> f64 {
        let target = u * self.flux();
        // the last rings may have no flux, to which a number near 1 must not lead
        let lit = self.within.partition_point(|f| *f < self.flux());
        let ring = self.within.partition_point(|f| *f <= target);
        let ring = ring.min(lit).clamp(1, self.squares.len() - 1);
        let [low, high] = [self.within[ring - 1], self.within[ring]];
        let [inner, outer] = [self.squares[ring - 1], self.squares[ring]];
        let square = inner + (outer - inner) * ((target - low) / (high - low));
        square.clamp(inner, outer.next_down())
    }
}

/// Borders of rings of equal area.
fn steps(square: f64) -> Vec<f64> {
    let step = |i| square * f64::from(i) / f64::from(RINGS);
    (0..=RINGS).map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of order 2 a super-Gaussian is a Gaussian; of any other its flux is that of a fine sum.
    #[test]
    fn fluxes_are_integrals() {
        let gaussian = |w: f64, r: f64| 0.5 * PI * w * w * -(-2.0 * (r / w).powi(2)).exp_m1();
        for (radius, waist) in [(0.02, 0.015), (0.02, 1.0), (0.02, 1e-4)] {
            let profile = RingProfile::super_gaussian(radius, waist, 2.0);
            let expected = gaussian(waist, radius);
            // 1e-12 of it counts as nothing
            let off = profile.flux() / expected - 1.0;
            assert!(off.abs() < 1e-11, "{waist}: {off}");
        }
        for order in [1.0, 3.5, 10.0, 100.0] {
            let profile = RingProfile::super_gaussian(1.0, 0.7, order);
            let n = 4_000_000;
            let ring = |i: u32| {
                let r = (f64::from(i) + 0.5) / f64::from(n);
                2.0 * PI * r * (-2.0 * (r / 0.7).powf(order)).exp() / f64::from(n)
            };
            let expected: f64 = (0..n).map(ring).sum();
            let off = profile.flux() / expected - 1.0;
            assert!(off.abs() < 1e-10, "{order}: {off}");
        }
        // a cone, and a hole in it: π r²/3 less twice the triangle's moment
        let cone = RingProfile::table(2.0, &[[0.0, 1.0], [2.0, 0.0]]).expect("a profile");
        assert!((cone.flux() / (PI * 4.0 / 3.0) - 1.0).abs() < 1e-13);
        let cut = RingProfile::table(1.0, &[[0.0, 1.0], [2.0, 0.0]]).expect("a profile");
        assert!((cut.flux() / (2.0 * PI * (0.5 - 1.0 / 6.0)) - 1.0).abs() < 1e-13);
    }

    /// Points fall within a radius by its share of the flux, and density times weight is the
    /// profile everywhere.
    #[test]
    fn points_are_drawn_by_density() {
        let table = [[0.0, 0.2], [0.3, 1.0], [0.31, 0.0], [0.5, 0.0], [1.0, 0.7]];
        for profile in [
            RingProfile::super_gaussian(1.0, 0.6, 8.0),
            RingProfile::super_gaussian(1.0, 0.01, 4.0),
            RingProfile::table(1.0, &table).expect("a profile"),
        ] {
            let n = 200_000;
            let u = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
            let weight = |square: f64| {
                let density = profile.density(square);
                assert!(density > 0.0, "{square}");
                profile.at(square) / density
            };
            let drawn: Vec<[f64; 2]> = (0..n)
                .map(|i| profile.draw(u(i)))
                .map(|square| [square, weight(square)])
                .collect();
            assert!(drawn.iter().all(|d| (0.0..=1.0).contains(&d[0])));
            for radius in [0.005_f64, 0.3, 0.55, 0.8, 1.0] {
                let within = drawn.iter().filter(|d| d[0] <= radius * radius);
                let found = within.map(|d| d[1]).sum::<f64>() / f64::from(n);
                let part = match &profile.radial {
                    Radial::SuperGaussian { waist_m, order } => {
                        RingProfile::super_gaussian(radius, *waist_m, *order).flux()
                    }
                    Radial::Table(rows) => {
                        RingProfile::table(radius, rows).expect("a profile").flux()
                    }
                };
                // one number of the last ring on either side
                let tolerance = 1e-4 * profile.flux();
                assert!((found - part).abs() < tolerance, "{radius}: {found} {part}");
            }
        }
    }

    #[test]
    fn tables_that_are_none_are_refused() {
        for (rows, error) in [
            (&[[0.0, 1.0]][..], ProfileError::Short),
            (&[[0.1, 1.0], [1.0, 1.0]], ProfileError::NoAxis),
            (&[[0.0, 1.0], [0.0, 1.0]], ProfileError::Order),
            (&[[0.0, 1.0], [f64::NAN, 1.0]], ProfileError::Order),
            (&[[0.0, -1.0], [1.0, 1.0]], ProfileError::Value),
            (&[[0.0, 1.0], [0.9, 1.0]], ProfileError::Ends),
            (&[[0.0, 0.0], [1.0, 0.0], [2.0, 1.0]], ProfileError::Dark),
        ] {
            assert_eq!(RingProfile::table(1.0, rows), Err(error), "{rows:?}");
        }
    }
}
