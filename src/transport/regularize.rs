//! Directional regularization: the cone that stands in for a specular delta where a path is joined,
//! and the kernel inside it.
//!
//! Bouchard, Iehl, Ostromoukhov and Poulin, "Improving Robustness of Monte-Carlo Global
//! Illumination with Directional Regularization" (2013), eq. 4: at a connection the delta of a
//! mirror or smooth dielectric is replaced by 1/A within a cone of half-aperture ε. Kernels here
//! come without their 1/A, which the weights carry (`mis`), so it is never formed.
//!
//! Invariant: the kernel is one symmetric function of the two directions, whichever sub-path asks.
//! The cone lives in the denser medium (refraction from the rarer one always exists) and the cosine
//! is the mean of both sides of the cone, so that the albedo never exceeds that of the surface, not
//! even at grazing.

use crate::bsdf::{Bsdf, Label, Lobe, fresnel};
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use glam::DVec3;

/// The cone that stands in for a specular delta at connections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Half-aperture in radians, measured in the denser medium.
    pub epsilon: f64,
    /// Solid angle A in steradians.
    pub area: f64,
    /// Square of the chord between its axis and its rim, on the unit sphere.
    chord_squared: f64,
}

impl Cone {
    /// Of half-aperture `epsilon` in radians, 0 < ε <= π. [theory (5.1)]
    #[must_use]
    pub fn new(epsilon: f64) -> Self {
        let chord = 2.0 * (0.5 * epsilon).sin();
        Self {
            epsilon,
            // not 2π (1 − cos ε), of which nothing is left below 1e-8
            area: std::f64::consts::PI * chord * chord,
            chord_squared: chord * chord,
        }
    }

    /// Whether two unit directions are within ε of each other. By the chord: a cosine near 1 has no
    /// digits left. [theory (5.1)]
    #[must_use]
    pub fn contains(&self, axis: DVec3, w: DVec3) -> bool {
        axis.distance_squared(w) < self.chord_squared
    }
}

/// Half-aperture of pass `index` = 0, 1, ...: max(ε_min, ε₁ (index + 1)^(−1/6)), for which squared
/// bias and variance of one regularized vertex fall alike (both as n^(−2/3)). [theory (7.2)]
#[must_use]
pub fn scheduled_epsilon(epsilon_first: f64, epsilon_min: f64, index: u32) -> f64 {
    let shrunk = epsilon_first * (f64::from(index) + 1.0).powf(-1.0 / 6.0);
    shrunk.max(epsilon_min)
}

/// A specular label at the end of a connection.
#[derive(Clone, Copy, Debug)]
pub struct SpecularKernel {
    /// Which label the sides of the two directions select.
    pub label: Label,
    /// `A g` per lane: 0 in lanes whose cone misses.
    pub kernel: SampledSpectrum,
    /// Each lane has its own refracted direction.
    pub dispersive: bool,
}

/// The kernel of the specular label between local unit directions ω⁻ and ω⁺ (z = shading normal),
/// `None` outside the cones of all lanes or where there is no such label.
#[must_use]
pub fn specular_kernel(
    bsdf: &Bsdf,
    w_light: DVec3,
    w_camera: DVec3,
    cone: &Cone,
) -> Option<SpecularKernel> {
    let sides = w_light.z * w_camera.z;
    if sides > 0.0 {
        reflected(bsdf, w_light, w_camera, cone)
    } else if sides < 0.0 {
        transmitted(bsdf, w_light, w_camera, cone)
    } else {
        None
    }
}

/// Kernel of specular reflection. [theory (5.2)]
fn reflected(bsdf: &Bsdf, w_light: DVec3, w_camera: DVec3, cone: &Cone) -> Option<SpecularKernel> {
    let mirrored = DVec3::new(-w_light.x, -w_light.y, w_light.z);
    if !cone.contains(mirrored, w_camera) {
        return None;
    }
    let above = w_light.z > 0.0;
    let cos = 0.5 * (w_light.z.abs() + w_camera.z.abs());
    let label = Label::SpecularReflect;
    let eta = bsdf.interface.near(above);
    let reflectance = bsdf.specular(label, cos, above);
    finished(bsdf, label, false, |k| {
        f64::from(reflectance[k]) / (cos * eta[k] * eta[k])
    })
}

/// Kernel of specular transmission, each lane with its own refracted axis. [theory (5.3)]
fn transmitted(
    bsdf: &Bsdf,
    w_light: DVec3,
    w_camera: DVec3,
    cone: &Cone,
) -> Option<SpecularKernel> {
    let interface = &bsdf.interface;
    let label = Label::SpecularTransmit;
    let (upper, lower) = if w_light.z > 0.0 {
        (w_light, w_camera)
    } else {
        (w_camera, w_light)
    };
    if bsdf.lobes.iter().any(|(_, l)| matches!(l, Lobe::Thin(_))) {
        // straight through, between equal media
        if !cone.contains(-upper, lower) {
            return None;
        }
        let cos = 0.5 * (upper.z - lower.z);
        let transmittance = bsdf.specular(label, cos, true);
        let eta = interface.near(true);
        return finished(bsdf, label, false, |k| {
            f64::from(transmittance[k]) / (cos * eta[k] * eta[k])
        });
    }
    // one lane stands for all unless each has a direction of its own
    let lanes = if interface.dispersive {
        interface.count
    } else {
        1
    };
    // (rare side is above, mean cosine) of the lanes within their cones
    let mut inside = [None; MAX_LANES];
    for (k, lane) in inside.iter_mut().enumerate().take(lanes) {
        let (above, below) = (interface.eta_above[k], interface.eta_below[k]);
        // equal indices: the rarer side is the one the normal points to
        let rare_above = above <= below;
        let (rare, dense, normal, eta_rare, eta_dense) = if rare_above {
            (upper, lower, DVec3::Z, above, below)
        } else {
            (lower, upper, -DVec3::Z, below, above)
        };
        let Some(axis) = fresnel::refract(rare, normal, eta_rare, eta_dense) else {
            continue;
        };
        if cone.contains(axis, dense) {
            *lane = Some((rare_above, 0.5 * (dense.z.abs() + axis.z.abs())));
        }
    }
    if lanes == 1 {
        let first = inside[0];
        inside[1..interface.count].fill(first);
    }
    // transmittance at the rarer side's angle; the rarer side differs between lanes only where
    // dispersion curves cross
    let transmittance = |rare_above: bool| {
        inside[..interface.count]
            .iter()
            .flatten()
            .any(|lane| lane.0 == rare_above)
            .then(|| {
                let rare = if rare_above { upper } else { lower };
                bsdf.specular(label, rare.z.abs(), rare_above)
            })
    };
    let (from_above, from_below) = (transmittance(true), transmittance(false));
    finished(bsdf, label, interface.dispersive, |k| {
        let Some((rare_above, cos)) = inside[k] else {
            return 0.0;
        };
        let (t, eta_dense) = if rare_above {
            (from_above, interface.eta_below[k])
        } else {
            (from_below, interface.eta_above[k])
        };
        t.map_or(0.0, |t| f64::from(t[k]) / (cos * eta_dense * eta_dense))
    })
}

/// The kernel of all lanes, `None` where it is 0.
fn finished(
    bsdf: &Bsdf,
    label: Label,
    dispersive: bool,
    lane: impl Fn(usize) -> f64,
) -> Option<SpecularKernel> {
    let count = bsdf.interface.count;
    let mut kernel = SampledSpectrum::ZERO;
    for k in 0..count {
        kernel[k] = lane(k) as f32;
    }
    (!kernel.is_black(count)).then_some(SpecularKernel {
        label,
        kernel,
        dispersive,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::Interface;
    use crate::bsdf::albedo::NO_ALBEDOS;
    use crate::bsdf::lobe::conductor::Mirror;
    use crate::bsdf::lobe::dielectric::Dielectric;
    use crate::math::frame::Frame;
    use crate::math::sampling::uniform_cone;
    use proptest::prelude::*;

    /// Indices that live as long as the tests.
    fn kept(eta: [f64; MAX_LANES]) -> &'static [f64; MAX_LANES] {
        Box::leak(Box::new(eta))
    }

    fn bsdf(lobe: Lobe, eta_above: f64, eta_below: f64) -> Bsdf<'static> {
        Bsdf {
            lobes: vec![(1.0, lobe)].leak(),
            interface: Interface {
                eta_above: kept([eta_above; MAX_LANES]),
                eta_below: kept([eta_below; MAX_LANES]),
                count: 4,
                dispersive: false,
                coating: None,
                polarization: crate::optics::Polarization::Average,
                albedos: &NO_ALBEDOS,
            },
        }
    }

    fn mirror() -> Bsdf<'static> {
        bsdf(
            Lobe::Mirror(Mirror::Perfect(SampledSpectrum::ONE)),
            1.3,
            1.0,
        )
    }

    fn glass(eta_above: f64, eta_below: f64) -> Bsdf<'static> {
        bsdf(
            Lobe::Dielectric(Dielectric {
                reflect_tint: SampledSpectrum::ONE,
                transmit_tint: SampledSpectrum::ONE,
            }),
            eta_above,
            eta_below,
        )
    }

    /// ∫ g η² |cos| dω over one side of all directions near `axis`, in units of 1: what one given
    /// direction loses to there.
    fn albedo(bsdf: &Bsdf, given: DVec3, axis: DVec3, wide: f64, cone: &Cone) -> f64 {
        let frame = Frame::from_z(axis);
        let one_minus_cos = 1.0 - wide.cos();
        let n = 400;
        let mut sum = 0.0;
        for i in 0..n * n {
            let u = [
                (f64::from(i % n) + 0.5) / f64::from(n),
                (f64::from(i / n) + 0.5) / f64::from(n),
            ];
            let w = frame.to_outer(uniform_cone(u, one_minus_cos));
            if let Some(found) = specular_kernel(bsdf, given, w, cone) {
                let eta = bsdf.interface.near(w.z > 0.0)[0];
                sum += f64::from(found.kernel[0]) * eta * eta * w.z.abs();
            }
        }
        sum / f64::from(n * n) * (2.0 * std::f64::consts::PI * one_minus_cos / cone.area)
    }

    fn at_elevation(alpha: f64) -> DVec3 {
        DVec3::new(alpha.cos(), 0.0, alpha.sin())
    }

    #[test]
    fn a_grazing_mirror_never_gains() {
        let cone = Cone::new(0.04);
        for (elevation, expected) in [
            (0.01, 0.958),
            (0.1, 0.841),
            (0.3, 0.803),
            (1.0, 0.928),
            (2.0, 0.984),
            (5.0, 0.997),
            (20.0, 0.9997),
        ] {
            let w = at_elevation(elevation * cone.epsilon);
            let axis = DVec3::new(-w.x, -w.y, w.z);
            // a little wider than the cone, which must cut itself
            let found = albedo(&mirror(), w, axis, 1.2 * cone.epsilon, &cone);
            // 160000 points of a lattice see the rim to about 1e-3
            assert!((found - expected).abs() < 3e-3, "{elevation}: {found}");
            assert!(found < 1.0 + 2e-3, "{elevation}: {found}");
        }
    }

    #[test]
    fn refraction_keeps_its_energy_from_both_sides() {
        let cone = Cone::new(0.04);
        for (above, below) in [(1.0, 1.5), (1.5, 1.0), (1.0, 2.4)] {
            let bsdf = glass(above, below);
            for degrees in [10.0_f64, 45.0, 80.0] {
                let rare = at_elevation((90.0 - degrees).to_radians());
                let rare = if above < below {
                    rare
                } else {
                    DVec3::new(rare.x, 0.0, -rare.z)
                };
                let normal = if above < below { DVec3::Z } else { -DVec3::Z };
                let (eta_rare, eta_dense) = (f64::min(above, below), f64::max(above, below));
                let dense = fresnel::refract(rare, normal, eta_rare, eta_dense).unwrap();
                let t = 1.0 - fresnel::dielectric(rare.z.abs(), eta_rare, eta_dense);
                let from_rare = albedo(&bsdf, rare, dense, 1.2 * cone.epsilon, &cone);
                assert!(
                    (from_rare / t - 1.0).abs() < 3e-3,
                    "{degrees}: {from_rare} for {t}"
                );
                // seen from the denser side the cone's image is stretched towards the surface
                let stretch = eta_dense / eta_rare * dense.z.abs() / rare.z.abs();
                let wide = (2.0 * stretch * cone.epsilon).min(0.9);
                let from_dense = albedo(&bsdf, dense, rare, wide, &cone);
                assert!(from_dense < 1.01, "{degrees}: {from_dense}");
                if degrees < 50.0 {
                    assert!(
                        (from_dense / t - 1.0).abs() < 1e-2,
                        "{degrees}: {from_dense} for {t}"
                    );
                }
            }
        }
    }

    #[test]
    fn each_lane_has_its_own_cone() {
        let mut bsdf = glass(1.0, 1.7);
        bsdf.interface.dispersive = true;
        bsdf.interface.eta_below = kept(std::array::from_fn(|k| 1.7 + 0.03 * k as f64));
        let rare = at_elevation(0.5);
        let toward =
            |k: usize| fresnel::refract(rare, DVec3::Z, 1.0, bsdf.interface.eta_below[k]).unwrap();
        let narrow = Cone::new(1e-3);
        for k in 0..4 {
            let found = specular_kernel(&bsdf, toward(k), rare, &narrow).unwrap();
            let alive: Vec<bool> = (0..4).map(|j| found.kernel[j] > 0.0).collect();
            assert_eq!(alive, (0..4).map(|j| j == k).collect::<Vec<_>>());
            assert!(found.dispersive);
        }
        let wide = specular_kernel(&bsdf, toward(1), rare, &Cone::new(0.1)).unwrap();
        assert!((0..4).all(|j| wide.kernel[j] > 0.0));
    }

    #[test]
    fn tiny_cones_keep_their_digits() {
        for epsilon in [1e-8, 1e-6, 1e-3] {
            let cone = Cone::new(epsilon);
            let exact = std::f64::consts::PI * epsilon * epsilon * (1.0 - epsilon * epsilon / 12.0);
            assert!((cone.area / exact - 1.0).abs() < 1e-12);
            let w = at_elevation(0.7);
            let off = |angle: f64| at_elevation(0.7 + angle);
            assert!(cone.contains(w, off(0.99 * epsilon)));
            assert!(!cone.contains(w, off(1.01 * epsilon)));
        }
    }

    #[test]
    fn the_schedule_shrinks_by_the_sixth_root() {
        assert_eq!(scheduled_epsilon(0.04, 0.0, 0), 0.04);
        assert!((scheduled_epsilon(0.04, 0.0, 63) - 0.02).abs() < 1e-15);
        assert_eq!(scheduled_epsilon(0.04, 0.03, 63), 0.03);
        let n = 1000;
        let mean = (0..n)
            .map(|i| scheduled_epsilon(1.0, 0.0, i).powi(2))
            .sum::<f64>()
            / f64::from(n);
        // 1.5 n^(−1/3) less the end correction
        assert!((mean - 0.1491).abs() < 1e-4, "{mean}");
    }

    proptest! {
        #[test]
        fn the_kernel_is_symmetric(
            a in 0.0..1.0_f64, b in 0.0..1.0_f64, du in 0.0..1.0_f64, dv in 0.0..1.0_f64,
            eta in 1.0..2.5_f64, epsilon in 1e-3..1.0_f64, through in any::<bool>(),
        ) {
            let cone = Cone::new(epsilon);
            let w = uniform_cone([a, b], 1.0);
            let bsdf = glass(1.0, eta);
            let axis = if through {
                fresnel::refract(w, DVec3::Z, 1.0, eta).unwrap()
            } else {
                DVec3::new(-w.x, -w.y, w.z)
            };
            let other = Frame::from_z(axis).to_outer(uniform_cone([du, dv], 2.0 * (1.0 - epsilon.cos())));
            let (one, two) = (
                specular_kernel(&bsdf, w, other, &cone),
                specular_kernel(&bsdf, other, w, &cone),
            );
            prop_assert_eq!(one.is_some(), two.is_some());
            if let (Some(one), Some(two)) = (one, two) {
                prop_assert_eq!(one.label, two.label);
                prop_assert!((one.kernel[0] / two.kernel[0] - 1.0).abs() < 1e-5);
            }
        }
    }
}
