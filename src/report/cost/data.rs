//! The report as data, of which page, tables and plots are views; `cost.json` is this.

use super::light::Missed;
use super::measure::{Measured, Summary};
use crate::math::named::named;
use crate::report::{ReportError, json};
use crate::scene::effects::Effect;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::Path;

named! {
    /// Parts of the matrix.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Group {
        /// Integrators and modes of regularization.
        Methods = "methods": "Integrators and modes of regularization",
        /// The scene without one of its effects each.
        Effects = "effects": "The scene without one of its effects each",
        /// Other values of one setting each.
        Settings = "settings": "Other values of one setting each",
    }
}

/// Length of a cell: a time, or passes, which are the same on every machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Extent {
    /// CPU seconds on every thread.
    #[serde(rename = "budget_seconds")]
    Seconds(f64),
    /// Passes, each of one sample per pixel; at least 2.
    #[serde(rename = "spp")]
    Passes(u32),
}

impl Extent {
    /// That many times as much.
    #[must_use]
    pub fn times(self, factor: u32) -> Self {
        match self {
            Self::Seconds(seconds) => Self::Seconds(seconds * f64::from(factor)),
            Self::Passes(passes) => Self::Passes(passes.saturating_mul(factor)),
        }
    }

    /// Whether a cell of so many passes, which took so many CPU seconds on every thread, is done.
    #[must_use]
    pub fn is_reached(self, passes: u32, seconds: f64) -> bool {
        match self {
            Self::Seconds(budget) => seconds >= budget,
            Self::Passes(all) => passes >= all,
        }
    }
}

/// The image that errors are measured against.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceNote {
    /// Name of its file.
    pub image: String,
    /// How it was made.
    pub origin: String,
    /// Relative error of its own, where it is known.
    pub relative_error: Option<f64>,
}

/// A variant with all that was measured of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Name in files and tables: letters, digits and hyphens.
    pub id: String,
    /// Name for readers.
    pub label: String,
    /// The parts of the report it belongs to; none: the scene as it is.
    pub groups: Vec<Group>,
    /// Keys of the scene file that differ.
    pub keys: Vec<(String, String)>,
    /// Measures of the variant as a whole.
    pub summary: Summary,
    /// Light that it misses; of methods and the scene as it is, where methods are compared.
    pub missed: Option<Missed>,
    /// Measures of each image.
    pub points: Vec<Measured>,
}

/// A report on the cost of accuracy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of the program.
    pub version: String,
    /// Name of the scene file.
    pub scene: String,
    /// Hash of the scene, hexadecimal.
    pub scene_hash: String,
    /// Name of the sensor.
    pub sensor: String,
    /// Columns and rows of the images.
    pub size: [u32; 2],
    /// Media with their indices.
    pub media: Vec<String>,
    /// Names of the lights.
    pub lights: Vec<String>,
    /// Effects of the scene.
    pub effects: Vec<Effect>,
    /// Name of the processor, where the system tells it.
    pub cpu: Option<String>,
    /// Threads.
    pub threads: usize,
    /// Length of a cell.
    #[serde(flatten)]
    pub extent: Extent,
    /// Seeds per variant.
    pub seeds: u32,
    /// Keys of the scene file replaced for all variants.
    pub overrides: Vec<(String, String)>,
    /// The pixel whose value is plotted.
    pub probe: Option<[u32; 2]>,
    /// The reference.
    pub reference: ReferenceNote,
    /// CPU seconds after which variants are compared.
    pub equal_time_seconds: f64,
    /// The findings in words.
    pub sentences: Vec<String>,
    /// The variants, the scene as it is first.
    pub variants: Vec<Outcome>,
}

impl Report {
    /// Reads a `cost.json`.
    ///
    /// # Errors
    /// Where the file cannot be read or is something else.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        json::read(path, "what `abbe cost` writes")
    }

    /// The table of all points.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = "variant,seed,passes,cpu_seconds,wall_seconds,rel_mse,trimmed_rel_mse,log_rmse,rel_variance,mean_ratio,probe,image\n"
            .to_owned();
        for variant in &self.variants {
            for p in &variant.points {
                let e = &p.errors;
                let probe = p.probe.map(|v| v.to_string()).unwrap_or_default();
                _ = writeln!(
                    text,
                    "{},{},{},{},{},{},{},{},{},{},{probe},{}",
                    variant.id,
                    p.seed,
                    p.passes,
                    p.cpu_seconds,
                    p.wall_seconds,
                    e.rel_mse,
                    e.trimmed_rel_mse,
                    e.log_rmse,
                    e.rel_variance,
                    e.mean_ratio,
                    p.image
                );
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::Group;
    use crate::math::named::Named;

    #[test]
    fn files_have_the_names() {
        for &group in Group::ALL {
            let text = format!("\"{group}\"");
            assert_eq!(serde_json::to_string(&group).ok(), Some(text));
        }
    }
}
