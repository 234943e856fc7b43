//! Directional regularization: the cone that stands in for a specular delta where a path is joined, and the kernel inside it.
//!
//! Bouchard, Iehl, Ostromoukhov and Poulin, "Improving Robustness of Monte-Carlo Global Illumination with Directional
//! Regularization" (2013), eq. 4: at a connection the delta of a mirror or smooth dielectric is replaced by 1/A within a cone of
//! half-aperture ε. Kernels here come without their 1/A, which the weights carry (`mis`), so it is never formed.
//!
//! Invariant: the kernel is one symmetric function of the two directions, whichever sub-path asks. The cone lives in the denser
//! medium (refraction from the rarer one always exists) and the cosine is the mean of both sides of the cone, so that the albedo
//! never exceeds that of the surface, not even at grazing.

use crate::bsdf::{Bsdf, Label, Lobe, fresnel};
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use glam::DVec3;

/// The cone that stands in for a specular delta at connections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Half-aperture in radians, measured in the denser medium.
    pub epsilon: f64,
    /// Its solid angle A in steradians.
    pub area: f64,
    /// Square of the chord between its axis and its rim, on the unit sphere.
    chord_squared: f64,
}

impl Cone {
    /// Of half-aperture `epsilon` in radians, 0 < ε <= π.
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

    /// Whether two unit directions are within ε of each other. By the chord: a cosine near 1 has no digits left.
    #[must_use]
    pub fn contains(&self, axis: DVec3, w: DVec3) -> bool {
        axis.distance_squared(w) < self.chord_squared
    }
}

/// Half-aperture of pass `index` = 0, 1, ...: max(ε_min, ε₁ (index + 1)^(−1/6)), for which squared bias and variance of one
/// regularized vertex fall alike (both as n^(−2/3)).
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

/// The kernel of the specular label between local unit directions ω⁻ and ω⁺ (z = shading normal), `None` outside the cones of all
/// lanes or where there is no such label.
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
    // transmittance at the rarer side's angle; the rarer side differs between lanes only where dispersion curves cross
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
