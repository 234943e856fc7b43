//! A scene file as the commands need it: the built scene, its settings, and what they say of the image.

use super::CliError;
use super::args::VERSION;
use crate::film::Filter;
use crate::io::part::{PartHeader, PassRange};
use crate::io::scene_file::{self, OutputUnits};
use crate::math::hash::hash_bytes;
use crate::render::{EpsilonChoice, RadiusChoice, Render};
use crate::scene::description::{WavelengthChoice, WavelengthSettings};
use crate::scene::frozen::Frozen;
use crate::scene::settings::{Heuristic, IntegratorKind, Regularize, Sharing};
use crate::scene::{Scene, Settings};
use crate::spectrum::SensorResponse;
use std::collections::BTreeMap;
use std::path::Path;

/// A loaded scene.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// How it is rendered.
    pub settings: Settings,
    /// Scale of the image.
    pub units: OutputUnits,
    /// Working range of wavelengths in nanometers.
    pub range_nm: [f64; 2],
    /// What is legal but surely not meant.
    pub warnings: Vec<String>,
    wavelengths: WavelengthSettings,
}

/// Reads and builds a scene.
pub fn load(path: &Path, overrides: &[(String, String)]) -> Result<Loaded, CliError> {
    load_frozen(path, overrides, None)
}

/// Reads and builds a scene without one of its effects.
pub fn load_frozen(
    path: &Path,
    overrides: &[(String, String)],
    frozen: Option<Frozen>,
) -> Result<Loaded, CliError> {
    let mut file = scene_file::load(path, overrides)?;
    if let Some(frozen) = frozen {
        file.description.freeze(frozen);
    }
    let wavelengths = file.description.wavelengths.clone();
    let scene = Scene::build(file.description).map_err(|source| CliError::Build {
        path: path.to_owned(),
        source,
    })?;
    Ok(Loaded {
        scene,
        settings: file.settings,
        units: file.units,
        range_nm: wavelengths.range_nm,
        warnings: file.warnings,
        wavelengths,
    })
}

/// Name of an integrator.
#[must_use]
pub fn integrator_name(kind: IntegratorKind) -> &'static str {
    match kind {
        IntegratorKind::Path => "path",
        IntegratorKind::Light => "light",
        IntegratorKind::Bdpt => "bdpt",
        IntegratorKind::Vcm => "vcm",
        IntegratorKind::Bpm => "bpm",
        IntegratorKind::Ppm => "ppm",
    }
}

fn filter_name(filter: &Filter) -> String {
    match filter {
        Filter::Box => "box".to_owned(),
        Filter::Tent { radius } => format!("tent, radius {radius} pixels"),
        Filter::Gaussian { sigma, radius } => {
            format!("gaussian, sigma {sigma}, radius {radius} pixels")
        }
    }
}

fn wavelengths_name(settings: &WavelengthSettings) -> String {
    let [low, high] = settings.range_nm;
    match &settings.choice {
        WavelengthChoice::Scene => format!("scene, {low}..{high} nm"),
        WavelengthChoice::Uniform => format!("uniform, {low}..{high} nm"),
        WavelengthChoice::Visible => format!("visible, {low}..{high} nm"),
        WavelengthChoice::Lines(lines) => {
            let lines: Vec<String> = lines.iter().map(f64::to_string).collect();
            format!("lines {} nm", lines.join(", "))
        }
    }
}

impl Loaded {
    /// The sensor of that name, the first without one.
    ///
    /// # Errors
    /// Where there is no such sensor.
    pub fn sensor(&self, name: Option<&str>) -> Result<usize, CliError> {
        let Some(name) = name else {
            return Ok(0);
        };
        self.scene.sensor_index(name).ok_or_else(|| {
            let names: Vec<&str> = self.scene.sensors.iter().map(|s| s.name.as_str()).collect();
            CliError::Usage(format!(
                "unknown sensor \"{name}\" (the scene has: {})",
                names.join(", ")
            ))
        })
    }

    /// Response of the main image.
    #[must_use]
    pub fn response(&self) -> SensorResponse {
        match self.units {
            OutputUnits::Radiance => SensorResponse::Xyz,
            OutputUnits::Photometric => SensorResponse::Photometric,
        }
    }

    /// What an image, or a part, says of the render that it is of.
    #[must_use]
    pub fn header(&self, sensor: usize, render: &Render) -> PartHeader {
        let crop = render.crop();
        let size = self.scene.sensors[sensor].camera.resolution();
        let mut image = self.image_attributes(sensor);
        if let Some(epsilon) = render.epsilon() {
            image.extend(self.epsilon_attributes(epsilon, render.tells_bias()));
        }
        if let Some(radius) = render.radius() {
            image.extend(self.merging_attributes(radius));
        }
        PartHeader {
            version: VERSION.to_owned(),
            scene_hash: self.scene.hash,
            settings_hash: self.settings_hash(sensor),
            sensor: self.scene.sensors[sensor].name.clone(),
            width: size.width,
            height: size.height,
            crop: [crop.x0, crop.y0, crop.x1, crop.y1],
            channels: 3,
            image,
            passes: pass_ranges(render.passes(), self.settings.seed),
        }
    }

    /// What the image says of how it was made: attribute and text.
    fn image_attributes(&self, sensor: usize) -> BTreeMap<String, String> {
        let settings = &self.settings;
        let unit = match self.units {
            OutputUnits::Radiance => "radiance, unit equal-energy radiance has Y = 1",
            OutputUnits::Photometric => "photometric, 683 lm/W",
        };
        let heuristic = match settings.heuristic {
            Heuristic::Balance => "balance",
            Heuristic::Power2 => "power2",
        };
        let regularize = match settings.regularization.mode {
            Regularize::Auto => "auto",
            Regularize::Off => "off",
            Regularize::Single => "single",
            Regularize::Mis => "mis",
        };
        let max_depth = settings
            .max_depth
            .map_or_else(|| "unlimited".to_owned(), |d| d.to_string());
        [
            (
                "integrator",
                integrator_name(settings.integrator).to_owned(),
            ),
            ("heuristic", heuristic.to_owned()),
            ("regularize", regularize.to_owned()),
            ("lanes", settings.lanes.to_string()),
            ("maxDepth", max_depth),
            ("filter", filter_name(&self.scene.sensors[sensor].filter)),
            ("wavelengths", wavelengths_name(&self.wavelengths)),
            ("observer", "CIE 1931 2 degree".to_owned()),
            ("unit", unit.to_owned()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }

    /// What the image says of the cones it was made with.
    fn epsilon_attributes(
        &self,
        epsilon: &EpsilonChoice,
        tells_bias: bool,
    ) -> BTreeMap<String, String> {
        let settings = &self.settings.regularization;
        let odd = if tells_bias {
            ", of odd passes the one before's over sqrt 2"
        } else {
            ""
        };
        let schedule = format!(
            "max({}, {} (pass + 1)^(-1/6)) rad{odd}",
            settings.epsilon_min, epsilon.epsilon
        );
        [
            ("epsilonFirst", epsilon.epsilon.to_string()),
            ("epsilonReason", epsilon.reason.clone()),
            ("epsilonSchedule", schedule),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }

    /// What the image says of merging.
    fn merging_attributes(&self, radius: &RadiusChoice) -> BTreeMap<String, String> {
        let merging = &self.settings.merging;
        let sharing = match merging.sharing {
            Sharing::Hero => "hero",
            Sharing::Set => "set",
            Sharing::Stratified => "stratified",
        };
        let exponent = -0.5 * (1.0 - merging.alpha);
        [
            ("mergeRadiusFirst", format!("{} m", radius.radius)),
            ("mergeRadiusReason", radius.reason.clone()),
            (
                "mergeRadiusSchedule",
                format!("{} (pass + 1)^({exponent:.6}) m", radius.radius),
            ),
            ("sharing", sharing.to_owned()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }

    /// Hash of all that changes the estimate but seed and passes.
    #[must_use]
    pub fn settings_hash(&self, sensor: usize) -> u64 {
        // the debug text names every setting, also those that the image does not
        let settings = Settings {
            spp: 0,
            seed: 0,
            ..self.settings.clone()
        };
        hash_bytes(format!("{settings:?} {:?}", self.image_attributes(sensor)).as_bytes())
    }
}

/// Passes in any order as ranges, sorted and apart.
fn pass_ranges(passes: &[u32], seed: u64) -> Vec<PassRange> {
    let mut sorted: Vec<u64> = passes.iter().copied().map(u64::from).collect();
    sorted.sort_unstable();
    let mut ranges: Vec<PassRange> = Vec::new();
    for pass in sorted {
        match ranges.last_mut().filter(|r| r.end == pass) {
            Some(range) => range.end += 1,
            None => ranges.push(PassRange {
                seed,
                start: pass,
                end: pass + 1,
            }),
        }
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_become_ranges() {
        let range = |start, end| PassRange {
            seed: 7,
            start,
            end,
        };
        assert_eq!(pass_ranges(&[], 7), []);
        assert_eq!(
            pass_ranges(&[5, 0, 1, 2, 6, 9], 7),
            [range(0, 3), range(5, 7), range(9, 10)]
        );
    }
}
