//! Test harness: does a sampler of directions have the density it claims?
//!
//! The sphere is cut into cells of equal (θ, φ); counts per cell are compared with the density's
//! integral over the cell (adaptive Gauss-Legendre quadrature). A failed sample is a cell of its
//! own, expected to hold what the density lacks to 1.

use super::hash::{random_bits, unit_f64};
use super::stats::chi_square_test;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

const THETA_CELLS: usize = 16;
const PHI_CELLS: usize = 24;
const NODES: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Numbers `3 i .. 3 i + 3` of the stream `seed`.
pub fn uniforms(seed: u64, i: u64) -> [f64; 3] {
    std::array::from_fn(|k| unit_f64(random_bits(seed, 3 * i + k as u64)))
}

fn gauss(pdf: &dyn Fn(DVec3) -> f64, lo: [f64; 2], size: [f64; 2]) -> f64 {
    let mut sum = 0.0;
    for (x, wx) in NODES {
        let (sin, cos) = (lo[0] + x * size[0]).sin_cos();
        for (y, wy) in NODES {
            let (sin_phi, cos_phi) = (lo[1] + y * size[1]).sin_cos();
            sum += wx * wy * sin * pdf(DVec3::new(sin * cos_phi, sin * sin_phi, cos));
        }
    }
    sum * size[0] * size[1]
}

fn integrate(
    pdf: &dyn Fn(DVec3) -> f64,
    lo: [f64; 2],
    size: [f64; 2],
    coarse: f64,
    depth: u32,
) -> f64 {
    let half = [0.5 * size[0], 0.5 * size[1]];
    let corners = [
        [0.0, 0.0],
        [half[0], 0.0],
        [0.0, half[1]],
        [half[0], half[1]],
    ]
    .map(|d| [lo[0] + d[0], lo[1] + d[1]]);
    let parts = corners.map(|c| gauss(pdf, c, half));
    let fine: f64 = parts.iter().sum();
    if depth == 0 || (fine - coarse).abs() < 1e-6 {
        return fine;
    }
    (0..4)
        .map(|i| integrate(pdf, corners[i], half, parts[i], depth - 1))
        .sum()
}

/// Integral of a density over each cell of the sphere.
pub fn integrate_cells(pdf: &dyn Fn(DVec3) -> f64) -> Vec<f64> {
    let size = [PI / THETA_CELLS as f64, TAU / PHI_CELLS as f64];
    (0..THETA_CELLS * PHI_CELLS)
        .map(|c| {
            let lo = [
                (c / PHI_CELLS) as f64 * size[0],
                (c % PHI_CELLS) as f64 * size[1],
            ];
            integrate(pdf, lo, size, gauss(pdf, lo, size), 5)
        })
        .collect()
}

/// p-value of `count` samples against `pdf` (per solid angle). 0 when the density integrates to
/// more than 1.
pub fn sphere_p_value(
    seed: u64,
    count: u64,
    mut sample: impl FnMut([f64; 3]) -> Option<DVec3>,
    pdf: &dyn Fn(DVec3) -> f64,
) -> f64 {
    let mut expected = integrate_cells(pdf);
    let total: f64 = expected.iter().sum();
    if total > 1.0 + 1e-3 {
        return 0.0;
    }
    expected.push((1.0 - total).max(1e-4));
    let mut observed = vec![0.0; expected.len()];
    for i in 0..count {
        let cell = sample(uniforms(seed, i)).map_or(expected.len() - 1, |w| {
            let theta = w.truncate().length().atan2(w.z) / PI * THETA_CELLS as f64;
            let phi = w.y.atan2(w.x).rem_euclid(TAU) / TAU * PHI_CELLS as f64;
            (theta as usize).min(THETA_CELLS - 1) * PHI_CELLS + (phi as usize).min(PHI_CELLS - 1)
        });
        observed[cell] += 1.0;
    }
    let expected: Vec<f64> = expected.iter().map(|e| e * count as f64).collect();
    chi_square_test(&observed, &expected)
}
