//! Seidel sums and the two chromatic sums, surface by surface (Welford, Aberrations of Optical
//! Systems, 1986, chapters 8, 9).

use super::paraxial::Paraxial;
use super::prescription::Prescription;
use crate::spectrum::ior::{LINE_C_NM, LINE_F_NM};
use std::ops::AddAssign;

/// Seidel sums in millimeters, of the largest field and the full aperture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seidel {
    /// Spherical aberration, coma, astigmatism, Petzval curvature, distortion: S_I to S_V.
    pub s: [f64; 5],
    /// Longitudinal and lateral color between F and C: C_I, C_II.
    pub c: [f64; 2],
}

impl AddAssign for Seidel {
    fn add_assign(&mut self, other: Self) {
        for (a, b) in self.s.iter_mut().zip(other.s) {
            *a += b;
        }
        for (a, b) in self.c.iter_mut().zip(other.c) {
            *a += b;
        }
    }
}

/// The contribution of each surface before the image, at the primary wavelength.
#[must_use]
pub fn seidel(prescription: &Prescription) -> Vec<Seidel> {
    let paraxial = Paraxial::new(prescription, prescription.primary_nm());
    let blue = Paraxial::new(prescription, LINE_F_NM);
    let red = Paraxial::new(prescription, LINE_C_NM);
    let last = prescription.last();
    let (start, start_chief) = (
        paraxial.marginal(),
        paraxial.chief(paraxial.largest_field()),
    );
    let marginal = paraxial.trace(start, last);
    let chief = paraxial.trace(start_chief, last);
    let lagrange = start.nu * start_chief.y - start_chief.nu * start.y;
    let mut out = Vec::with_capacity(last + 1);
    for i in 0..=last {
        let (n0, n1) = (paraxial.n[i], paraxial.n[i + 1]);
        let c = paraxial.c[i];
        let (y, y_chief) = (marginal[i].y, chief[i].y);
        let before = |list: &[super::paraxial::ParaxialRay], first: f64| match i {
            0 => first,
            i => list[i - 1].nu,
        };
        let (nu, nu_chief) = (before(&marginal, start.nu), before(&chief, start_chief.nu));
        // refraction invariants n i of both rays
        let (a, a_chief) = (nu + n0 * y * c, nu_chief + n0 * y_chief * c);
        let delta_u_over_n = marginal[i].nu / (n1 * n1) - nu / (n0 * n0);
        let delta_inverse = 1.0 / n1 - 1.0 / n0;
        let delta_inverse2 = 1.0 / (n1 * n1) - 1.0 / (n0 * n0);
        let asphere = 8.0 * prescription.surfaces[i].shape.profile.fourth_order() * (n1 - n0);
        let petzval = -lagrange * lagrange * c * delta_inverse;
        let distortion = -a_chief.powi(3) * y * delta_inverse2
            - a_chief * c * delta_inverse * y_chief * (lagrange - a_chief * y);
        let spread = |paraxial: &Paraxial, i: usize| paraxial.n[i];
        let delta_n = |i: usize| spread(&blue, i) - spread(&red, i);
        let color = delta_n(i + 1) / n1 - delta_n(i) / n0;
        out.push(Seidel {
            s: [
                -a * a * y * delta_u_over_n + asphere * y.powi(4),
                -a * a_chief * y * delta_u_over_n + asphere * y.powi(3) * y_chief,
                -a_chief * a_chief * y * delta_u_over_n + asphere * (y * y_chief).powi(2),
                petzval,
                distortion + asphere * y * y_chief.powi(3),
            ],
            c: [a * y * color, a_chief * y * color],
        });
    }
    out
}

/// Sums over all surfaces.
#[must_use]
pub fn total(surfaces: &[Seidel]) -> Seidel {
    let mut sum = Seidel::default();
    for &one in surfaces {
        sum += one;
    }
    sum
}
