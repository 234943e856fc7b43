//! The spectrum on a detector: white light through a plate of colored glass, and the transmittance
//! that the plate has by Fresnel and Beer-Lambert.
//!
//!     cargo run --release --example detector_spectrum

#![allow(clippy::print_stdout, reason = "a program that prints its results")]

use abbe::glam::DVec3;
use abbe::light::Light;
use abbe::material::Material;
use abbe::medium::Medium;
use abbe::render::{OutputRequest, Session, SessionOptions};
use abbe::scene::description::{WavelengthChoice, WavelengthSettings};
use abbe::scene::settings::IntegratorKind;
use abbe::scene::{SceneBuilder, Settings};
use abbe::spectrum::{Curve, Emission, Ior, SpectralChannels};
use std::error::Error;

/// Working range in nanometers, and bins of the spectrum.
const RANGE_NM: [f64; 2] = [400.0, 700.0];
const BINS: usize = 12;
/// Index and thickness (meters) of the plate.
const INDEX: f64 = 1.5;
const THICKNESS: f64 = 2e-3;
/// Columns and rows of the detector.
const PIXELS: u32 = 24;
const PASSES: u32 = 64;

/// Absorption coefficient in 1/m: red passes.
fn absorption() -> Curve {
    Curve::table(&[400.0, 550.0, 650.0, 700.0], &[900.0, 600.0, 30.0, 10.0])
}

/// Mean irradiance per nanometer in each bin behind the plate, W/(m² nm), and the centers of the
/// bins.
fn measured() -> Result<Vec<(f64, f64)>, Box<dyn Error>> {
    let mut scene = SceneBuilder::new();
    let glass = scene.medium(Medium {
        name: "red glass".to_owned(),
        ior: Ior::constant(INDEX),
        absorption: Some(absorption()),
        use_k: false,
    });
    let clear = scene.material(Material::interface(0.0));
    scene
        .cuboid("plate", [-0.05, -0.05, 0.0], [0.05, 0.05, THICKNESS])
        .of(clear)
        .filled_with(glass);
    // a beam of 1 W/(m² nm), wider than the detector
    let white = Emission::from_curve(Curve::Constant(1.0));
    scene.light(
        "beam",
        Light::beam(DVec3::Z * 0.1, DVec3::NEG_Z, white, 0.02),
    );
    let (u, v) = (DVec3::X * 0.01, DVec3::Y * 0.01);
    scene.detector("screen", [PIXELS; 2], DVec3::NEG_Z * 0.1, u, v);
    scene.wavelengths(WavelengthSettings {
        choice: WavelengthChoice::Uniform,
        range_nm: RANGE_NM,
    });
    let settings = Settings {
        integrator: IntegratorKind::Bdpt,
        spp: PASSES,
        ..Settings::default()
    };
    let outputs = OutputRequest {
        spectral: Some(SpectralChannels::new(RANGE_NM, BINS, Vec::new())),
        ..OutputRequest::default()
    };
    let options = SessionOptions {
        outputs,
        ..SessionOptions::default()
    };
    let mut session = Session::new(scene.build()?, &settings, options)?;
    session.run();
    let render = session.render();
    let (channels, film) = render
        .outputs()
        .spectral
        .as_ref()
        .ok_or("no spectral film")?;
    let image = film.image(render.passes().len() as u64);
    let pixels = f64::from(PIXELS * PIXELS);
    let mean = |bin: usize| image.iter().skip(bin).step_by(BINS).sum::<f64>() / pixels;
    let bins = channels.bin_centers_nm().enumerate();
    Ok(bins.map(|(bin, nm)| (nm, mean(bin))).collect())
}

/// Transmittance of the plate, with all reflections inside it.
fn transmittance(nm: f64) -> f64 {
    let reflected = ((INDEX - 1.0) / (INDEX + 1.0)).powi(2);
    let inside = (-absorption().eval(nm) * THICKNESS).exp();
    (1.0 - reflected).powi(2) * inside / (1.0 - (reflected * inside).powi(2))
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("    nm  measured  expected");
    for (nm, value) in measured()? {
        println!("{nm:>6.1}  {value:>8.4}  {:>8.4}", transmittance(nm));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plate_transmits_as_fresnel_and_beer_say() {
        let half = 0.5 * (RANGE_NM[1] - RANGE_NM[0]) / BINS as f64;
        for (nm, value) in measured().expect("renders") {
            // Simpson's rule over the bin: the curves are nearly straight in it
            let at = |share: f64| transmittance(nm + share * half);
            let expected = (at(-1.0) + 4.0 * at(0.0) + at(1.0)) / 6.0;
            // of n lanes that land in the bin, each passes both faces or not: the relative error of
            // the mean is at most √((1 − T₀)/(T₀ n)) with T₀ = 0.92 of the clear plate; 5 of them,
            // and 1 % for the kinks of the table
            let lanes = f64::from(PIXELS * PIXELS * PASSES * 4) / BINS as f64;
            let tolerance = 5.0 * (0.08 / 0.92 / lanes).sqrt() + 0.01;
            assert!(
                (value / expected - 1.0).abs() < tolerance,
                "{nm} nm: {value} for {expected}, within {tolerance} of it"
            );
        }
    }
}
