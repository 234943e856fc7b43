//! Fresnel reflectance, and Snell's law (Born and Wolf, Principles of Optics, 1.5 and 14.2).
//!
//! Invariant: equal indices give exactly R = 0 and a straight ray; total internal reflection
//! exactly R = 1.

use crate::optics::Polarization;
use crate::spectrum::MAX_LANES;
use glam::DVec3;
use wide::f64x4;

/// `n² - 1` for n = `eta_t / eta_i`, without cancellation when the indices are nearly equal.
fn index_contrast(eta_i: f64, eta_t: f64) -> f64 {
    (eta_t - eta_i) * (eta_t + eta_i) / (eta_i * eta_i)
}

/// Reflectance in [0, 1] of the interface from index `eta_i` to `eta_t` for unpolarized light;
/// `cos_i` in [0, 1] is on the side of `eta_i`.
#[must_use]
pub fn dielectric(cos_i: f64, eta_i: f64, eta_t: f64) -> f64 {
    dielectric_for(Polarization::Average, cos_i, eta_i, eta_t)
}

/// The same for light of a polarization.
///
/// With n = η_t/η_i and g² = n² - 1 + cos², the amplitudes are written as r_s = -(n² - 1)/(cos +
/// g)² and r_p = (n² - 1)((n² + 1) cos² - 1)/(n² cos + g)²: no difference of near-equal numbers but
/// the one that Brewster's angle is.
#[must_use]
#[inline]
pub fn dielectric_for(polarization: Polarization, cos_i: f64, eta_i: f64, eta_t: f64) -> f64 {
    let contrast = index_contrast(eta_i, eta_t);
    if contrast == 0.0 {
        return 0.0;
    }
    let g2 = contrast + cos_i * cos_i;
    if g2 <= 0.0 || cos_i <= 0.0 {
        return 1.0;
    }
    let g = g2.sqrt();
    let n2 = 1.0 + contrast;
    let (sum_s, sum_p) = (cos_i + g, n2 * cos_i + g);
    let r_s = contrast / (sum_s * sum_s);
    let r_p = contrast * ((n2 + 1.0) * cos_i * cos_i - 1.0) / (sum_p * sum_p);
    polarization.of(r_s * r_s, r_p * r_p).min(1.0)
}

/// The same in each of the first `count` lanes, 0 in the others.
#[must_use]
#[inline]
pub fn dielectric_lanes(
    polarization: Polarization,
    cos_i: f64,
    eta_i: &[f64; MAX_LANES],
    eta_t: &[f64; MAX_LANES],
    count: usize,
) -> [f64; MAX_LANES] {
    let mut out = [0.0; MAX_LANES];
    if count == 1 {
        out[0] = dielectric_for(polarization, cos_i, eta_i[0], eta_t[0]);
        return out;
    }
    let (cos, one) = (f64x4::splat(cos_i), f64x4::ONE);
    let cos2 = cos * cos;
    for first in (0..count).step_by(4) {
        let four = |eta: &[f64; MAX_LANES]| f64x4::from(std::array::from_fn(|i| eta[first + i]));
        let (near, far) = (four(eta_i), four(eta_t));
        // as for one lane, operation by operation
        let contrast = (far - near) * (far + near) / (near * near);
        let g2 = contrast + cos2;
        let g = g2.sqrt();
        let n2 = one + contrast;
        let (sum_s, sum_p) = (cos + g, n2 * cos + g);
        let r_s = contrast / (sum_s * sum_s);
        let r_p = contrast * ((n2 + one) * cos * cos - one) / (sum_p * sum_p);
        let r = match polarization {
            Polarization::Average => (r_s * r_s + r_p * r_p) * 0.5,
            Polarization::S => r_s * r_s,
            Polarization::P => r_p * r_p,
        };
        // numbers that are none are those of total reflection, or of a direction along the surface
        let total = g2.simd_le(f64x4::ZERO) | cos.simd_le(f64x4::ZERO);
        let r = total.select(one, r.fast_min(one));
        let r = contrast.simd_eq(f64x4::ZERO).select(f64x4::ZERO, r);
        let used = (count - first).min(4);
        out[first..first + used].copy_from_slice(&r.to_array()[..used]);
    }
    out
}

/// Reflectance in [0, 1] of a metal of index `n + i k` seen from index `eta_i` at `cos_i` in [0,
/// 1], for light of a polarization.
#[must_use]
#[inline]
pub fn conductor(polarization: Polarization, cos_i: f64, eta_i: f64, n: f64, k: f64) -> f64 {
    let (n, k) = (n / eta_i, k / eta_i);
    let cos2 = cos_i * cos_i;
    let sin2 = 1.0 - cos2;
    let real = n * n - k * k - sin2;
    // a² + b² = |(n + i k)² - sin²|, a its root's real part
    let modulus = real.hypot(2.0 * n * k);
    let a = (0.5 * (modulus + real)).max(0.0).sqrt();
    let s_sum = modulus + cos2;
    let s_mix = 2.0 * a * cos_i;
    let r_s = (s_sum - s_mix) / (s_sum + s_mix);
    let p_sum = cos2 * modulus + sin2 * sin2;
    let p_mix = s_mix * sin2;
    let r_p = r_s * (p_sum - p_mix) / (p_sum + p_mix);
    let r = polarization.of(r_s, r_p);
    // 0/0: grazing incidence on a "metal" that is the medium itself
    if r.is_finite() {
        r.clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// The refraction of `w` (unit, pointing away from the surface, on the side of the unit vector `m`)
/// through the plane normal to `m`, again pointing away. `None` at total internal reflection.
#[must_use]
pub fn refract(w: DVec3, m: DVec3, eta_i: f64, eta_t: f64) -> Option<DVec3> {
    let cos_i = w.dot(m);
    let g2 = index_contrast(eta_i, eta_t) + cos_i * cos_i;
    if g2 <= 0.0 {
        return None;
    }
    let ratio = eta_i / eta_t;
    Some(ratio * ((cos_i - g2.sqrt()) * m - w))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BK7: f64 = 1.5168;

    #[test]
    fn known_values() {
        assert!((dielectric(1.0, 1.0, 1.5) - 0.04).abs() < 1e-15);
        assert!((dielectric(1.0, 1.5, 1.0) - 0.04).abs() < 1e-15);
        // Brewster: R_p = 0, so R = R_s/2 with r_s = cos(2 theta)
        let brewster = 56.603_83_f64.to_radians();
        let r_s = (2.0 * brewster).cos();
        assert!((dielectric(brewster.cos(), 1.0, BK7) - 0.5 * r_s * r_s).abs() < 1e-7);
        // total reflection sets in at 41.24519 degrees; R has a vertical tangent there
        let at = |degrees: f64| dielectric(degrees.to_radians().cos(), BK7, 1.0);
        assert_eq!(at(41.245_192), 1.0);
        assert!(at(41.245_188) < 1.0);
        assert_eq!(dielectric(0.0, 1.0, 1.5), 1.0);
        for cos in [0.0, 1e-9, 0.3, 1.0] {
            assert_eq!(dielectric(cos, 1.333, 1.333), 0.0);
        }
        // silver-like n + ik at normal incidence: ((n-1)² + k²)/((n+1)² + k²)
        let want = (0.95_f64.powi(2) + 9.0) / (1.05_f64.powi(2) + 9.0);
        assert!((conductor(Polarization::Average, 1.0, 1.0, 0.05, 3.0) - want).abs() < 1e-14);
        assert!((conductor(Polarization::Average, 0.0, 1.0, 0.05, 3.0) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn lanes_have_the_bits_of_each() {
        let near = [1.0, 1.5, 1.62, 1.5, 1.33, 2.0, 1.0, 1.7];
        let far = [1.5, 1.0, 1.5, 1.5, 1.0, 1.2, 1.0, 1.71];
        for polarization in [Polarization::Average, Polarization::S, Polarization::P] {
            for cos in [0.0, 1e-3, 0.3, 0.7, 0.75, 1.0] {
                for count in [1, 4, 8] {
                    let lanes = dielectric_lanes(polarization, cos, &near, &far, count);
                    for (k, lane) in lanes.iter().enumerate() {
                        let one = dielectric_for(polarization, cos, near[k], far[k]);
                        let want = if k < count { one } else { 0.0 };
                        assert_eq!(lane.to_bits(), want.to_bits(), "{cos} {count} {k}");
                    }
                }
            }
        }
    }

    #[test]
    fn equal_indices_go_straight() {
        let w = DVec3::new(0.6, 0.0, 0.8);
        assert_eq!(refract(w, DVec3::Z, 1.7, 1.7), Some(-w));
    }

    proptest! {
        #[test]
        fn metal_without_extinction_is_a_dielectric(cos in 0.01..1.0_f64, n in 1.01..3.0_f64) {
            prop_assert!((conductor(Polarization::Average, cos, 1.2, n, 0.0) - dielectric(cos, 1.2, n)).abs() < 1e-9);
        }

        #[test]
        fn refraction_obeys_snell_and_reverses(
            cos in 0.001..1.0_f64, phi in 0.0..6.0_f64, eta_i in 1.0..2.5_f64, eta_t in 1.0..2.5_f64,
        ) {
            let sin = (1.0 - cos * cos).sqrt();
            let w = DVec3::new(sin * phi.cos(), sin * phi.sin(), cos);
            match refract(w, DVec3::Z, eta_i, eta_t) {
                None => prop_assert!(sin * eta_i / eta_t > 1.0 - 1e-9),
                Some(t) => {
                    prop_assert!((t.length() - 1.0).abs() < 1e-12 && t.z < 0.0);
                    prop_assert!((eta_i * w.truncate() + eta_t * t.truncate()).length() < 1e-12);
                    if t.z < -1e-3 {
                        let back = refract(t, -DVec3::Z, eta_t, eta_i).unwrap();
                        prop_assert!((back - w).length() < 1e-9);
                        let (r, r_back) = (dielectric(cos, eta_i, eta_t), dielectric(-t.z, eta_t, eta_i));
                        prop_assert!((r - r_back).abs() < 1e-9);
                    }
                }
            }
        }
    }
}
