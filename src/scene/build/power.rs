//! Powers of the lights of a scene, and what follows from them: the choice of lights and of
//! wavelengths, and the exponent of films.

use super::{BuildError, Builder, Moments};
use crate::geometry::Accel;
use crate::light::{Light, LightKind};
use crate::scene::description::{WavelengthChoice, WavelengthSettings};
use crate::spectrum::{Curve, Emission, WavelengthDistribution, cie};

/// Brightness up to which, as a power of two and its inverse, films need no exponent: beyond it
/// contributions come near the limits of their sums.
const PLAIN: i32 = 28;
/// Range of an emission of 1 that is as bright as an exponent of 0.
const VISIBLE_NM: [f64; 2] = [cie::FIRST_NM, cie::LAST_NM];
/// How much brighter than at the distance of the scene's radius things near a point light are, as a
/// power of two.
const NEAR: i32 = 16;

impl Builder {
    /// The mean flux of each light per unit of its emission, over the moments.
    pub(super) fn fluxes(&self, accel: &Accel, moments: &Moments) -> Vec<f64> {
        let mean_flux = |light: &Light| {
            let fluxes = moments.all.iter().map(|&t| light.flux_factor(&accel.at(t)));
            fluxes.sum::<f64>() / moments.all.len() as f64
        };
        self.lights.iter().map(mean_flux).collect()
    }

    /// The power of each light by which it is chosen, over the working range.
    pub(super) fn powers(
        &self,
        fluxes: &[f64],
        range_nm: [f64; 2],
    ) -> Result<Vec<f64>, BuildError> {
        let mut powers = Vec::with_capacity(fluxes.len());
        let mut known: Option<(&Emission, f64)> = None;
        for (light, flux) in self.lights.iter().zip(fluxes) {
            // many lights are often alike
            let same = known.filter(|(emission, _)| **emission == light.emission);
            let power = same.map_or_else(
                || light.emission.sampling_power(range_nm),
                |(_, power)| power,
            );
            known = Some((&light.emission, power));
            powers.push(flux * power);
        }
        if !powers.iter().any(|&p| p > 0.0) {
            return Err(BuildError::NoLight);
        }
        Ok(powers)
    }

    /// The exponent of films: 0 unless the brightest light is extremely bright or dim.
    pub(super) fn film_exponent(&self, accel: &Accel, fluxes: &[f64], powers: &[f64]) -> i32 {
        // whatever the working range, which may be a line
        let white = Emission::from_curve(Curve::Constant(1.0)).sampling_power(VISIBLE_NM);
        let near = f64::from(NEAR).exp2() / accel.radius().powi(2);
        let brightness = |((light, flux), power): ((&Light, &f64), &f64)| {
            // of an emission of 1: a radiance or irradiance, or what a point lights
            let unit = match light.kind {
                LightKind::Point(_) | LightKind::Spot(_) | LightKind::Beam(_) => flux * near,
                _ => 1.0,
            };
            // a light without flux has no power
            if *flux > 0.0 {
                power / flux * unit / white
            } else {
                0.0
            }
        };
        let lights = self.lights.iter().zip(fluxes).zip(powers);
        let brightest = lights.map(brightness).fold(0.0, f64::max);
        // what is beyond would not fit a double either
        let exponent = brightest.log2().round().clamp(-512.0, 512.0) as i32;
        if exponent.abs() <= PLAIN { 0 } else { exponent }
    }
}

/// The distribution of wavelengths for these lights.
pub(super) fn distribution(
    settings: &WavelengthSettings,
    lights: &[Light],
    fluxes: &[f64],
) -> WavelengthDistribution {
    if let WavelengthChoice::Lines(lines) = &settings.choice {
        return WavelengthDistribution::lines(lines);
    }
    let emitters: Vec<(Emission, f64)> = lights
        .iter()
        .zip(fluxes)
        .map(|(light, &flux)| (light.emission.clone(), flux))
        .collect();
    let scene = WavelengthDistribution::scene(&emitters, settings.range_nm);
    match &settings.choice {
        WavelengthChoice::Uniform => {
            WavelengthDistribution::uniform(settings.range_nm).with_atoms_of(&scene)
        }
        WavelengthChoice::Even => {
            let lines = scene.with_equal_atoms();
            WavelengthDistribution::uniform(settings.range_nm).with_atoms_of(&lines)
        }
        WavelengthChoice::Visible => {
            WavelengthDistribution::visible(settings.range_nm).with_atoms_of(&scene)
        }
        _ => scene,
    }
}
