//! Functions of the angle to the normal: tabulated, integrated exactly, and drawn from.
//!
//! A profile is linear between knots in the cosine. Its integrals are those of just that function,
//! and blends of profiles are blends of their integrals: what is normalized by them conserves
//! energy at every point between the knots of a table, not at the knots alone.

use arrayvec::ArrayVec;
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, FRAC_2_PI, FRAC_PI_2, TAU};

/// Knots of a profile, at cosines (i / (KNOTS - 1))²: closest at grazing angles.
const KNOTS: usize = 64;
/// Azimuths of an anisotropic pattern, over the quarter of a turn that repeats.
const AZIMUTHS: usize = 17;

fn knot(i: usize) -> f64 {
    let x = i as f64 / (KNOTS - 1) as f64;
    x * x
}

/// The interval between knots that the cosine `cos` in [0, 1] is in, and the fraction of it below.
fn interval(cos: f64) -> (usize, f64) {
    let i = ((cos.sqrt() * (KNOTS - 1) as f64) as usize).min(KNOTS - 2);
    (i, (cos - knot(i)) / (knot(i + 1) - knot(i)))
}

/// A function of the cosine in [0, 1].
#[derive(Clone, Debug)]
struct Profile {
    values: [f64; KNOTS],
    /// ∫ f(c) 2c dc from 0 to each knot.
    integrals: [f64; KNOTS],
}

impl Profile {
    fn new(values: [f64; KNOTS]) -> Self {
        let mut integrals = [0.0; KNOTS];
        for i in 1..KNOTS {
            let (a, b) = (knot(i - 1), knot(i));
            let of_linear = values[i - 1] * (2.0 * a + b) + values[i] * (a + 2.0 * b);
            integrals[i] = integrals[i - 1] + of_linear * (b - a) / 3.0;
        }
        Self { values, integrals }
    }

    fn at(&self, (i, t): (usize, f64)) -> f64 {
        self.values[i] + t * (self.values[i + 1] - self.values[i])
    }
}

/// A function of a direction, the same for (±x, ±y, ±z).
#[derive(Clone, Debug)]
pub struct Pattern {
    /// From the x axis to the y axis; none where all are alike.
    azimuths: Vec<Profile>,
    /// The mean over the azimuths.
    mean: Profile,
}

impl Pattern {
    /// Tabulates `f` of unit vectors with z > 0.
    pub fn new(isotropic: bool, f: impl Fn(DVec3) -> f64) -> Self {
        let profile = |azimuth: f64| {
            let (y, x) = azimuth.sin_cos();
            Profile::new(std::array::from_fn(|i| {
                let cos = knot(i).max(1e-6);
                let sin = (1.0 - cos * cos).max(0.0).sqrt();
                f(DVec3::new(sin * x, sin * y, cos))
            }))
        };
        if isotropic {
            return Self {
                azimuths: Vec::new(),
                mean: profile(0.0),
            };
        }
        let steps = (AZIMUTHS - 1) as f64;
        let azimuths: Vec<Profile> = (0..AZIMUTHS)
            .map(|j| profile(j as f64 / steps * FRAC_PI_2))
            .collect();
        let mean = std::array::from_fn(|i| {
            let ends = 0.5 * (azimuths[0].values[i] + azimuths[AZIMUTHS - 1].values[i]);
            let inner = &azimuths[1..AZIMUTHS - 1];
            (ends + inner.iter().map(|p| p.values[i]).sum::<f64>()) / steps
        });
        Self {
            azimuths,
            mean: Profile::new(mean),
        }
    }

    fn at(&self, w: DVec3, interval: (usize, f64)) -> f64 {
        if self.azimuths.is_empty() {
            return self.mean.at(interval);
        }
        let x = w.y.abs().atan2(w.x.abs()) * FRAC_2_PI * (AZIMUTHS - 1) as f64;
        let j = (x as usize).min(AZIMUTHS - 2);
        let [a, b] = [j, j + 1].map(|j| self.azimuths[j].at(interval));
        a + (x - j as f64) * (b - a)
    }
}

/// Patterns and their shares: a point between the knots of a table.
pub type Corners<T> = ArrayVec<(T, f64), 4>;

/// A weighted sum of patterns.
#[derive(Clone, Debug)]
pub struct Blend<'a>(pub Corners<&'a Pattern>);

impl Blend<'_> {
    /// The value for a unit vector on either side.
    #[must_use]
    pub fn at(&self, w: DVec3) -> f64 {
        let interval = interval(w.z.abs().min(1.0));
        self.0.iter().map(|(p, s)| s * p.at(w, interval)).sum()
    }

    /// The integral from grazing to knot `i`.
    fn integral(&self, i: usize) -> f64 {
        self.0.iter().map(|(p, s)| s * p.mean.integrals[i]).sum()
    }

    /// The mean over the hemisphere, weighted by the cosine.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.integral(KNOTS - 1)
    }

    /// A direction above the surface with [`Blend::density`].
    #[must_use]
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        let below = u[0] * self.mean();
        let (mut low, mut high) = (0, KNOTS - 1);
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if self.integral(middle) <= below {
                low = middle;
            } else {
                high = middle;
            }
        }
        let (from, to) = (self.integral(low), self.integral(high));
        let t = ((below - from) / (to - from)).clamp(0.0, 1.0);
        let (a, b) = (knot(low), knot(high));
        let cos2 = a * a + t * (b * b - a * a);
        let sin = (1.0 - cos2).max(0.0).sqrt();
        let (y, x) = (TAU * u[1]).sin_cos();
        DVec3::new(sin * x, sin * y, cos2.sqrt())
    }

    /// Density per solid angle of [`Blend::sample`] at a unit vector on either side: proportional
    /// to the cosine between knots, and to the pattern from one interval to the next.
    #[must_use]
    pub fn density(&self, w: DVec3) -> f64 {
        let cos = w.z.abs().min(1.0);
        let (i, _) = interval(cos);
        let (a, b) = (knot(i), knot(i + 1));
        let share = (self.integral(i + 1) - self.integral(i)) / self.mean();
        share * cos * FRAC_1_PI / (b * b - a * a)
    }
}
