//! Spectral images: against the emitters, and against XYZ.

use crate::lamps::WALL;
use crate::rendered::{Rendered, lamp, render, settings};
use abbe::render::OutputRequest;
use abbe::spectrum::{Library, SpectralChannels, WavelengthDistribution, xyz};
use std::fmt::Write;

/// Width of the bins below in nm.
const WIDTH_NM: f64 = 10.0;
/// Bins of 10 nm over 360..830 nm.
const BINS: usize = 47;

fn request(lines_nm: &[f64]) -> OutputRequest {
    let channels = SpectralChannels::new([360.0, 830.0], BINS, lines_nm.to_vec());
    OutputRequest {
        spectral: Some(channels),
        ..OutputRequest::default()
    }
}

fn mean(image: &Rendered) -> Vec<f64> {
    let count = image.spectral.len() as f64;
    (0..image.spectral[0].len())
        .map(|c| image.spectral.iter().map(|p| p[c]).sum::<f64>() / count)
        .collect()
}

/// A camera that sees nothing but the sky.
fn sky(radiance: &[&str], wavelengths: &str, spp: u32) -> String {
    let mut scene = settings(spp)
        + &format!("wavelengths = \"{wavelengths}\"\n")
        + "[[sensor]]\nresolution = [32, 32]\northographic = { eye = [0, 0, 1], target = [0, 0, 0], height = 1 }\n";
    for spectrum in radiance {
        write!(
            scene,
            "[[light]]\nenvironment = {{ radiance = {spectrum} }}\n"
        )
        .unwrap();
    }
    scene
}

#[test]
fn equal_energy_is_one_in_every_bin() {
    let range = [360.0, 830.0];
    for (name, distribution) in [
        ("uniform", WavelengthDistribution::uniform(range)),
        ("visible", WavelengthDistribution::visible(range)),
        ("scene", WavelengthDistribution::visible(range)),
    ] {
        let image = render(&sky(&["1.0"], name, 16), &request(&[]));
        let samples = f64::from(32 * 32 * 16 * 4);
        for (i, value) in mean(&image).into_iter().enumerate() {
            let first = range[0] + WIDTH_NM * i as f64;
            let density = [0.01, 0.5, 0.99].map(|t| distribution.density(first + t * WIDTH_NM));
            let least = density.into_iter().fold(f64::INFINITY, f64::min);
            // two halves of four lanes each miss or gain up to one sample at both ends, 1.6
            // altogether (standard deviation)
            let tolerance = 8.0 / (samples * least * WIDTH_NM);
            assert!(
                (value - 1.0).abs() < tolerance,
                "{name}, {first} nm: {value}, tolerance {tolerance}"
            );
        }
    }
}

#[test]
fn lines_have_channels_of_their_own() {
    let radiance = ["1.0", "{ lines = [[546.0735, 20], [632.8, 30]] }"];
    for wavelengths in ["uniform", "scene"] {
        let channels = mean(&render(
            &sky(&radiance, wavelengths, 16),
            &request(&[546.0735, 632.8]),
        ));
        let (bins, lines) = channels.split_at(BINS);
        // a line in its bin would add 2 or 3
        assert!(bins.iter().all(|bin| (bin - 1.0).abs() < 0.03), "{bins:?}");
        for (line, power) in lines.iter().zip([20.0, 30.0]) {
            assert!((line / power - 1.0).abs() < 0.005, "{lines:?}");
        }
    }
}

/// XYZ from the bins: each stands for the observer's mean over it.
fn integrate(bins: &[f64]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (i, value) in bins.iter().enumerate() {
        let first = 360 + WIDTH_NM as usize * i;
        // trapezoids of 1 nm
        for nm in first..=first + WIDTH_NM as usize {
            let share = if nm == first || nm == first + WIDTH_NM as usize {
                0.5
            } else {
                1.0
            };
            let cmf = xyz::cmf(nm as f64);
            sum = std::array::from_fn(|c| sum[c] + share * cmf[c] * value / xyz::N_Y);
        }
    }
    sum
}

#[test]
fn the_spectral_image_integrates_to_xyz() {
    // Bins forget what is within 10 nm: in smooth light little, under bands of 5 nm more.
    for (name, tolerance) in [("E", 5e-4), ("A", 1.5e-3), ("D65", 1.5e-3), ("F2", 6e-3)] {
        let scene = settings(16) + &lamp(&format!("name = \"{name}\"")) + WALL;
        let image = render(&scene, &request(&[]));
        let (got, want) = (integrate(&mean(&image)), image.mean(0..32, 0..32));
        for c in 0..3 {
            assert!(
                (got[c] / want[c] - 1.0).abs() < tolerance,
                "{name}: {got:?} {want:?}"
            );
        }
    }
}

#[test]
fn the_lines_of_a_spectral_image_sum_to_xyz() {
    let lines: Vec<f64> = Library::embedded()
        .emission("Hg")
        .unwrap()
        .lines
        .iter()
        .map(|l| l.lambda_nm)
        .collect();
    let scene = settings(1) + &lamp("name = \"Hg\"") + WALL;
    let image = render(&scene, &request(&lines));
    for (pixel, want) in image.spectral.iter().zip(&image.xyz) {
        assert!(pixel[..BINS].iter().all(|bin| *bin == 0.0));
        let mut sum = [0.0; 3];
        for (power, nm) in pixel[BINS..].iter().zip(&lines) {
            let cmf = xyz::cmf(*nm);
            sum = std::array::from_fn(|c| sum[c] + power * cmf[c] / xyz::N_Y);
        }
        for c in 0..3 {
            // the same samples, twice rounded
            assert!(
                (sum[c] - want[c]).abs() < 1e-7 * (1.0 + want[c]),
                "{sum:?} {want:?}"
            );
        }
    }
}
