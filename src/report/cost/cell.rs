//! One cell of the matrix, a variant with a seed: rendered for its time or passes, its image kept
//! at doubling numbers of passes.
//!
//! A finished cell is a JSON file that names its images. A cell whose file is there and was made
//! with the same scene, settings and length is not rendered again: an interrupted report goes on
//! where it stopped.

use super::data::Extent;
use super::light::{self, ClassLight};
use super::matrix::{Detail, Variant};
use crate::io::exr::{self, Channel};
use crate::io::identity::{VERSION, settings_hash};
use crate::io::image;
use crate::io::layers::{self, Layer};
use crate::io::loaded::{self, Loaded};
use crate::math::hash::hash_bytes;
use crate::render::{Cancel, OutputRequest, Render, Session, SessionOptions, StopReason};
use crate::report::{ReportError, json};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The layer that holds one sample of the standard error of Y per pixel: the scaled difference of
/// the halves.
pub const NOISE_CHANNEL: &str = "noise.Y";
/// Limit on the passes of a cell, for scenes of a few pixels.
pub const MOST_PASSES: u32 = 1 << 20;

/// The image of a cell after some passes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// File, in the folder of the report.
    pub image: String,
    /// Passes.
    pub passes: u32,
    /// CPU seconds of all threads (wall seconds where the system does not tell), without those
    /// spent on writing files.
    pub cpu_seconds: f64,
    /// Wall seconds, likewise.
    pub wall_seconds: f64,
}

/// A finished cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Hash of all that it depends on.
    key: String,
    /// Seed.
    pub seed: u64,
    /// Rays of both kinds.
    pub rays: u64,
    /// Images, by passes.
    pub snapshots: Vec<Snapshot>,
    /// Light by class, where it is kept.
    pub classes: Vec<ClassLight>,
}

/// How cells are rendered.
#[derive(Debug)]
pub struct Plan<'a> {
    /// The scene file.
    pub scene: &'a Path,
    /// Keys replaced for all variants.
    pub overrides: &'a [(String, String)],
    /// The sensor.
    pub sensor: usize,
    /// Where files go.
    pub folder: &'a Path,
    /// Threads that render.
    pub threads: usize,
    /// Asked for between passes.
    pub cancel: &'a Cancel,
}

impl Plan<'_> {
    /// The cell, from its file or rendered; `None` where it was cancelled. The flag tells whether
    /// it was rendered.
    ///
    /// # Errors
    /// Where the scene does not load or a file cannot be written.
    pub fn cell(
        &self,
        variant: &Variant,
        seed: u64,
        extent: Extent,
    ) -> Result<Option<(Cell, bool)>, ReportError> {
        let mut overrides = self.overrides.to_vec();
        overrides.extend(variant.overrides.iter().cloned());
        overrides.push(("render.seed".to_owned(), seed.to_string()));
        let loaded = loaded::load_frozen(self.scene, &overrides, variant.frozen)?;
        let key = format!(
            "{VERSION} {:016x} {:016x} {:?} {:?} {seed} {extent:?} {} {}",
            loaded.scene.hash,
            settings_hash(
                &loaded.scene,
                self.sensor,
                &loaded.settings,
                loaded.response()
            ),
            variant.frozen,
            variant.detail,
            self.threads,
            self.sensor,
        );
        let key = format!("{:016x}", hash_bytes(key.as_bytes()));
        let stem = format!("{}-{seed}", variant.id);
        let file = self.folder.join(format!("{stem}.json"));
        if let Some(cell) = self.finished(&file, &key) {
            return Ok(Some((cell, false)));
        }
        let Some(mut cell) = self.render(&loaded, &stem, extent, variant.detail)? else {
            return Ok(None);
        };
        (cell.key, cell.seed) = (key, seed);
        json::write(&file, &cell)?;
        Ok(Some((cell, true)))
    }

    /// The cell of a file, if it is whole and of the same key.
    fn finished(&self, file: &Path, key: &str) -> Option<Cell> {
        let cell: Cell = json::read(file, "a cell").ok()?;
        let there = |s: &Snapshot| self.folder.join(&s.image).is_file();
        (cell.key == key && !cell.snapshots.is_empty() && cell.snapshots.iter().all(there))
            .then_some(cell)
    }

    /// The last image of a cell.
    ///
    /// # Errors
    /// Where it has none.
    pub fn last_image(&self, cell: &Cell) -> Result<PathBuf, ReportError> {
        let last = cell.snapshots.last().ok_or(ReportError::NoReference)?;
        Ok(self.folder.join(&last.image))
    }

    fn render(
        &self,
        loaded: &Loaded,
        stem: &str,
        extent: Extent,
        detail: Detail,
    ) -> Result<Option<Cell>, ReportError> {
        let layers = detail == Detail::Strategies;
        let options = SessionOptions {
            sensor: self.sensor,
            outputs: OutputRequest {
                response: loaded.response(),
                strategies: layers,
                shares: layers,
                class_table: detail == Detail::Classes,
                ..OutputRequest::default()
            },
            passes: Some(0..MOST_PASSES),
            cancel: self.cancel.clone(),
            ..SessionOptions::default()
        };
        let mut session = Session::new(Arc::clone(&loaded.scene), &loaded.settings, options)?;
        let mut cell = Cell::default();
        let stop = session.run_with(|session, progress| {
            if progress.stop == Some(StopReason::Interrupted) {
                return Ok(ControlFlow::Break(()));
            }
            cell.rays = progress.rays;
            let passes = progress.passes as u32;
            // pilots do not count: a curve that began with them would seem to fall faster than it
            // does
            let cpu_seconds = progress.time.cpu_seconds();
            // two passes at least: the noise is told from halves; CPU time, so that others on the
            // machine take nothing from a cell
            let used = cpu_seconds / self.threads as f64;
            let last = passes == MOST_PASSES || passes >= 2 && extent.is_reached(passes, used);
            if last || detail == Detail::Image && passes >= 2 && passes.is_power_of_two() {
                let image = format!("{stem}-{passes}.exr");
                self.write(&image, &session.render(), last)?;
                cell.snapshots.push(Snapshot {
                    image,
                    passes,
                    cpu_seconds: microseconds(cpu_seconds),
                    wall_seconds: microseconds(progress.time.wall.as_secs_f64()),
                });
            }
            Ok::<_, ReportError>(if last {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            })
        })?;
        cell.classes = light::of_render(&session.render());
        Ok((stop != StopReason::Interrupted).then_some(cell))
    }

    /// Writes the image: all of XYZ at the end of a cell, Y alone before, and a sample of its
    /// noise.
    fn write(&self, name: &str, render: &Render, whole: bool) -> Result<(), ReportError> {
        let mut image = image::of(render);
        // what was not kept is not added
        let kept = [Layer::Strategies, Layer::Regularized];
        layers::add(&mut image, &kept, render, &[]);
        if !whole {
            image.channels.retain(|c| c.name == "Y");
        }
        let [even, odd] = render.pass_counts();
        let noise = render.outputs().image.noise(1, even, odd);
        image.channels.push(Channel {
            name: NOISE_CHANNEL.to_owned(),
            values: noise.into_iter().flatten().map(|v| v as f32).collect(),
        });
        Ok(exr::write(&self.folder.join(name), &image)?)
    }
}

/// Rounded, so that what is read from a file is what was written.
fn microseconds(seconds: f64) -> f64 {
    (seconds * 1e6).round() / 1e6
}
