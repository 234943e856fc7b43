//! The polarization that reflectances are computed for.

use crate::math::named::named;

named! {
    /// Polarization of the electric field against the plane of incidence.
    pub enum Polarization {
        /// The mean of both: unpolarized light.
        Average = "average": "Unpolarized: the mean of both polarizations",
        /// Perpendicular to the plane of incidence.
        S = "s": "Perpendicular to the plane of incidence, at every surface",
        /// In the plane of incidence.
        P = "p": "In the plane of incidence, at every surface",
    }
}

impl Polarization {
    /// The part that counts of a quantity that differs between the two.
    #[must_use]
    #[inline]
    pub fn of(self, s: f64, p: f64) -> f64 {
        match self {
            Self::Average => 0.5 * (s + p),
            Self::S => s,
            Self::P => p,
        }
    }
}
