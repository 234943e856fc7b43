//! RGB to smooth, bounded reflectance spectra.
//!
//! The sigmoid of a quadratic of Jakob and Hanika, "A Low-Dimensional Function Space for Efficient
//! Spectral Upsampling" (2019). Instead of a precomputed table, the three coefficients are solved
//! for each color, by Newton steps along the straight line from medium gray (coefficients 0) to the
//! color. Deterministic.

use std::sync::LazyLock;

use glam::{DMat3, DVec3};

use super::{Curve, SampledSpectrum, SampledWavelengths, cie, embedded, illuminant, xyz};

/// Weight of every nanometer from 360 to 830 in linear sRGB under D65; each channel sums to 1.
static WEIGHTS: LazyLock<Vec<DVec3>> = LazyLock::new(|| {
    let weights: Vec<DVec3> = (360..=830)
        .map(f64::from)
        .map(|l| {
            let d65 = illuminant::d65().eval(l);
            DVec3::from(xyz::xyz_to_linear_srgb(cie::cmf(l).map(|w| w * d65)))
        })
        .collect();
    let sum: DVec3 = weights.iter().sum();
    weights.into_iter().map(|w| w / sum).collect()
});

/// Smooth reflectances with the linear sRGB `[1, 0, 0]`, `[0, 1, 0]`, `[0, 0, 1]` under D65, which
/// add up to 1 (after Mallett and Yuksel, EGSR 2019).
static PRIMARIES: LazyLock<[Curve; 3]> = LazyLock::new(|| {
    let mut columns = embedded::embedded_columns("reflectance/srgb.csv").into_iter();
    std::array::from_fn(|_| columns.next().map_or(Curve::Constant(0.0), |c| c.1))
});

/// A smooth spectrum of linear sRGB `rgb` (under D65, white at `[1, 1, 1]`) at the wavelengths of a
/// path: within 0..1 for `rgb` within 0..1, and linear in `rgb`, so that filtering an image filters
/// its spectra. Cheap enough for every texel looked up; [`reflectance`] is the smoother choice for
/// a single color.
#[must_use]
pub fn rgb_lanes(rgb: [f32; 3], wavelengths: &SampledWavelengths) -> SampledSpectrum {
    if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
        return SampledSpectrum::splat(rgb[0]);
    }
    let mut out = SampledSpectrum::ZERO;
    for lane in 0..wavelengths.count() {
        let nm = wavelengths.lambda_nm(lane);
        out[lane] = rgb
            .iter()
            .zip(&*PRIMARIES)
            .map(|(&v, primary)| v * primary.eval(nm) as f32)
            .sum();
    }
    out
}

/// How near the color a step of the walk must come before the next.
const CLOSE: f64 = 1e-9;
/// Kept from the walls 0 and 1, which a sigmoid reaches only at infinity.
const MARGIN: f64 = 2e-5;

/// A smooth spectrum within [0, 1] whose linear sRGB under D65, with white at `[1, 1, 1]`, is `rgb`
/// (clamped to [0, 1]) to better than 1e-3. Grays are constant.
#[must_use]
pub fn reflectance(rgb: [f64; 3]) -> Curve {
    let rgb = rgb.map(|v| v.clamp(0.0, 1.0));
    if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
        return Curve::Constant(rgb[0]);
    }
    let color = DVec3::from(rgb).clamp(DVec3::splat(MARGIN), DVec3::splat(1.0 - MARGIN));
    let gray = DVec3::splat(0.5);
    let (mut c, mut done, mut step) = (DVec3::ZERO, 0.0, 0.25);
    while done < 1.0 && step > 1e-7 {
        let next = f64::min(done + step, 1.0);
        let (trial, error) = newton(c, gray.lerp(color, next));
        if error < CLOSE {
            (c, done, step) = (trial, next, step * 2.0);
        } else {
            step *= 0.5;
        }
    }
    Curve::Sigmoid { c: c.to_array() }
}

/// Newton's method with step halving from `c`; the coefficients reached and the largest error left.
fn newton(mut c: DVec3, target: DVec3) -> (DVec3, f64) {
    let (mut residual, mut jacobian) = evaluate(c, target);
    for _ in 0..12 {
        if residual.abs().max_element() < CLOSE {
            break;
        }
        let delta = -(jacobian.inverse() * residual);
        if !delta.is_finite() {
            break;
        }
        let mut length = 1.0;
        let better = loop {
            let (trial_residual, trial_jacobian) = evaluate(c + delta * length, target);
            if trial_residual.length_squared() < residual.length_squared() {
                break Some((c + delta * length, trial_residual, trial_jacobian));
            }
            length *= 0.5;
            if length < 1e-3 {
                break None;
            }
        };
        match better {
            Some(next) => (c, residual, jacobian) = next,
            None => break,
        }
    }
    (c, residual.abs().max_element())
}

/// Linear sRGB of the coefficients minus `target`, and its derivative.
fn evaluate(c: DVec3, target: DVec3) -> (DVec3, DMat3) {
    let mut rgb = DVec3::ZERO;
    let mut columns = [DVec3::ZERO; 3];
    for (i, &w) in WEIGHTS.iter().enumerate() {
        let t = i as f64 / 470.0;
        let x = (c.x * t + c.y) * t + c.z;
        // The sigmoid of x and its derivative.
        let h2 = 1.0 + x * x;
        let h = h2.sqrt();
        let slope = w * (0.5 / (h * h2));
        rgb += w * (0.5 + 0.5 * x / h);
        columns[0] += slope * (t * t);
        columns[1] += slope * t;
        columns[2] += slope;
    }
    (
        rgb - target,
        DMat3::from_cols(columns[0], columns[1], columns[2]),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear_srgb(curve: &Curve) -> DVec3 {
        WEIGHTS
            .iter()
            .enumerate()
            .map(|(i, &w)| w * curve.eval(360.0 + i as f64))
            .sum()
    }

    #[test]
    fn every_corner_edge_and_inner_color_comes_back() {
        let levels = [0.0, 1e-3, 0.02, 0.2, 0.5, 0.9, 0.999, 1.0];
        for r in levels {
            for g in levels {
                for b in levels {
                    let curve = reflectance([r, g, b]);
                    let error = (linear_srgb(&curve) - DVec3::new(r, g, b))
                        .abs()
                        .max_element();
                    assert!(error < 1e-3, "{r} {g} {b}: {error} {curve:?}");
                    let (low, high) = curve.bounds();
                    assert!(low >= 0.0 && high <= 1.0);
                }
            }
        }
    }

    #[test]
    fn primaries_add_up_to_one_and_have_their_colors() {
        for (i, primary) in PRIMARIES.iter().enumerate() {
            let error = (linear_srgb(primary) - DVec3::AXES[i]).abs().max_element();
            assert!(error < 1e-5, "{i}: {error}");
            let (low, high) = primary.bounds();
            assert!(low >= 0.0 && high <= 1.0);
        }
        for l in 360..=830 {
            let sum: f64 = PRIMARIES.iter().map(|p| p.eval(f64::from(l))).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{l}: {sum}");
        }
    }

    #[test]
    fn the_round_trip_holds_with_standard_matrices_too() {
        let rgb = [0.8, 0.1, 0.3];
        let xyz = xyz::reflectance_to_xyz(&reflectance(rgb), illuminant::d65());
        let back = xyz::xyz_to_linear_srgb(xyz);
        for c in 0..3 {
            assert!((back[c] - rgb[c]).abs() < 1e-3, "{back:?}");
        }
        assert_eq!(reflectance(rgb), reflectance(rgb));
        assert_eq!(reflectance([0.3; 3]), Curve::Constant(0.3));
        assert_eq!(reflectance([-1.0, -2.0, -3.0]), Curve::Constant(0.0));
    }
}
