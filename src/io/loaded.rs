//! A scene file, read and built: the scene, its settings, and the scale of its images.

use super::scene_file::{self, LoadedScene, OutputUnits, SceneFileErrors};
use crate::scene::frozen::Frozen;
use crate::scene::{Scene, Settings};
use crate::spectrum::{SensorResponse, SpectralChannels};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Why a scene file gives no scene, or not the sensor asked for.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// A scene file with problems, one line each.
    #[error("{0}")]
    SceneFile(#[from] SceneFileErrors),
    /// A sensor that the scene does not have.
    #[error("unknown sensor \"{name}\" (the scene has: {there})")]
    Sensor {
        /// Asked for.
        name: String,
        /// The sensors of the scene, with commas between.
        there: String,
    },
}

impl LoadError {
    /// Whether the request is wrong for this scene, rather than the scene.
    #[must_use]
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::Sensor { .. })
    }
}

/// A loaded scene.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Arc<Scene>,
    /// How it is rendered.
    pub settings: Settings,
    /// Scale of the image.
    pub units: OutputUnits,
    /// Things that are legal but surely not meant.
    pub warnings: Vec<String>,
    /// Files that were read.
    pub files: Vec<PathBuf>,
}

/// Reads and builds a scene.
///
/// # Errors
/// Where the file has problems, or its parts make no scene.
pub fn load(path: &Path, overrides: &[(String, String)]) -> Result<Loaded, LoadError> {
    load_frozen(path, overrides, None)
}

/// Reads and builds a scene without one of its effects.
///
/// # Errors
/// As [`load`].
pub fn load_frozen(
    path: &Path,
    overrides: &[(String, String)],
    frozen: Option<Frozen>,
) -> Result<Loaded, LoadError> {
    let mut file = scene_file::load(path, overrides)?;
    if let Some(frozen) = frozen {
        file.description.freeze(frozen);
    }
    Ok(build(file, path)?)
}

/// Builds a scene that was read from the file `path`, or whatever stands for it in messages.
///
/// # Errors
/// Where its parts make no scene.
pub fn build(file: LoadedScene, path: &Path) -> Result<Loaded, SceneFileErrors> {
    let places = &file.places;
    let mut scene =
        Scene::build(file.description).map_err(|error| places.build_error(path, &error))?;
    if let Some(chains) = &file.chains {
        (scene.keep_chains(chains)).map_err(|error| places.chain_error(path, &error))?;
    }
    let mut warnings = file.warnings;
    warnings.extend(scene.notes.iter().cloned());
    Ok(Loaded {
        scene: Arc::new(scene),
        settings: file.settings,
        units: file.units,
        warnings,
        files: file.files,
    })
}

impl Loaded {
    /// The sensor of that name, the first without one.
    ///
    /// # Errors
    /// Where there is no such sensor.
    pub fn sensor(&self, name: Option<&str>) -> Result<usize, LoadError> {
        let Some(name) = name else {
            return Ok(0);
        };
        self.scene.sensor_index(name).ok_or_else(|| {
            let names: Vec<&str> = self.scene.sensors.iter().map(|s| s.name.as_str()).collect();
            LoadError::Sensor {
                name: name.to_owned(),
                there: names.join(", "),
            }
        })
    }

    /// Channels of a spectral image of so many bins over the range of wavelengths, and of each
    /// line.
    #[must_use]
    pub fn spectral_channels(&self, bins: u16) -> SpectralChannels {
        let lines = self.scene.wavelengths.atoms().map(|(nm, _)| nm).collect();
        let range_nm = self.scene.wavelength_settings.range_nm;
        SpectralChannels::new(range_nm, usize::from(bins), lines)
    }

    /// Response of the main image.
    #[must_use]
    pub fn response(&self) -> SensorResponse {
        match self.units {
            OutputUnits::Radiance => SensorResponse::Xyz,
            OutputUnits::Photometric => SensorResponse::Photometric,
        }
    }
}
