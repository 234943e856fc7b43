//! A scene file as the commands need it: the built scene and its settings.

use super::CliError;
use crate::io::scene_file::{self, OutputUnits};
use crate::scene::frozen::Frozen;
use crate::scene::{Scene, Settings};
use crate::spectrum::SensorResponse;
use std::path::Path;
use std::sync::Arc;

/// A loaded scene.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Arc<Scene>,
    /// How it is rendered.
    pub settings: Settings,
    /// Scale of the image.
    pub units: OutputUnits,
    /// What is legal but surely not meant.
    pub warnings: Vec<String>,
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
    let scene = Scene::build(file.description).map_err(|source| CliError::Build {
        path: path.to_owned(),
        source,
    })?;
    Ok(Loaded {
        scene: Arc::new(scene),
        settings: file.settings,
        units: file.units,
        warnings: file.warnings,
    })
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
}
