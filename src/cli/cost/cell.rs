//! One cell of the matrix, a variant with a seed: rendered for its time, its image kept at doubling numbers of passes.
//!
//! A finished cell is a JSON file that names its images. A cell whose file is there and was made with the same scene, settings
//! and time is not rendered again: an interrupted report goes on where it stopped.

use super::super::args::Aov;
use super::super::image_output::{add_layers, xyz_image};
use super::super::interrupt::Interrupt;
use super::super::load::{self, Loaded};
use super::super::usage::Clock;
use super::super::{CliError, args::VERSION};
use super::matrix::Variant;
use crate::io::atomic::write_atomic;
use crate::io::exr::{self, Channel};
use crate::math::hash::hash_bytes;
use crate::render::{OutputRequest, Render};
use serde::{Deserialize, Serialize};
use std::io::Write as _;
use std::path::Path;

/// The layer that holds one sample of the standard error of Y per pixel: the scaled difference of the halves.
pub const NOISE_CHANNEL: &str = "noise.Y";
/// A limit on the passes of a cell, for scenes of a few pixels.
const MOST_PASSES: u32 = 1 << 20;

/// The image of a cell after some passes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Its file, in the folder of the report.
    pub image: String,
    /// Passes.
    pub passes: u32,
    /// CPU seconds of all threads (wall seconds where the system does not tell), without those spent on writing files.
    pub cpu_seconds: f64,
    /// Wall seconds, likewise.
    pub wall_seconds: f64,
}

/// A finished cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Hash of all that it depends on.
    key: String,
    /// Its seed.
    pub seed: u64,
    /// Rays of both kinds.
    pub rays: u64,
    /// Its images, by passes.
    pub snapshots: Vec<Snapshot>,
}

/// How cells are rendered.
#[derive(Debug)]
pub struct Plan<'a> {
    /// The scene file.
    pub scene: &'a Path,
    /// Keys replaced for all variants.
    pub overrides: Vec<(String, String)>,
    /// The sensor.
    pub sensor: usize,
    /// Where files go.
    pub folder: &'a Path,
    /// Asked for between passes.
    pub interrupt: Interrupt,
}

impl Plan<'_> {
    /// The cell, from its file or rendered; `None` where an interrupt came first. The flag tells whether it was rendered.
    ///
    /// # Errors
    /// Where the scene does not load or a file cannot be written.
    pub fn cell(
        &self,
        variant: &Variant,
        seed: u64,
        seconds: f64,
    ) -> Result<Option<(Cell, bool)>, CliError> {
        let mut overrides = self.overrides.clone();
        overrides.extend(variant.overrides.iter().cloned());
        overrides.push(("render.seed".to_owned(), seed.to_string()));
        let loaded = load::load_frozen(self.scene, &overrides, variant.frozen)?;
        let key = format!(
            "{VERSION} {:016x} {:016x} {:?} {} {seed} {seconds:?} {} {}",
            loaded.scene.hash,
            loaded.settings_hash(self.sensor),
            variant.frozen,
            variant.layers,
            rayon::current_num_threads(),
            self.sensor,
        );
        let key = format!("{:016x}", hash_bytes(key.as_bytes()));
        let stem = format!("{}-{seed}", variant.id);
        let file = self.folder.join(format!("{stem}.json"));
        if let Some(cell) = self.finished(&file, &key) {
            return Ok(Some((cell, false)));
        }
        let Some((rays, snapshots)) = self.render(&loaded, &stem, seconds, variant.layers)? else {
            return Ok(None);
        };
        let cell = Cell {
            key,
            seed,
            rays,
            snapshots,
        };
        let value = serde_json::to_string_pretty(&cell)
            .map_err(|e| CliError::file(&file, e.to_string()))?;
        write_atomic(&file, |w| writeln!(w, "{value}"))?;
        Ok(Some((cell, true)))
    }

    /// The cell of a file, if it is whole and of the same key.
    fn finished(&self, file: &Path, key: &str) -> Option<Cell> {
        let cell: Cell = serde_json::from_str(&std::fs::read_to_string(file).ok()?).ok()?;
        let there = |s: &Snapshot| self.folder.join(&s.image).is_file();
        (cell.key == key && !cell.snapshots.is_empty() && cell.snapshots.iter().all(there))
            .then_some(cell)
    }

    fn render(
        &self,
        loaded: &Loaded,
        stem: &str,
        seconds: f64,
        layers: bool,
    ) -> Result<Option<(u64, Vec<Snapshot>)>, CliError> {
        let crop = loaded.scene.sensors[self.sensor].whole_film();
        let request = OutputRequest {
            response: loaded.response(),
            strategies: layers,
            shares: layers,
            ..OutputRequest::default()
        };
        let mut render = Render::new(&loaded.scene, self.sensor, &loaded.settings, crop, &request);
        // pilots are over: a curve that began with them would seem to fall faster than it does
        let mut clock = Clock::start();
        let mut snapshots: Vec<Snapshot> = Vec::new();
        for pass in 0..MOST_PASSES {
            render.add_pass(pass);
            if self.interrupt.is_set() {
                return Ok(None);
            }
            let passes = pass + 1;
            let (cpu_seconds, wall_seconds) = clock.read();
            // two passes at least: the noise is told from halves; CPU time, so that others on the machine take nothing from a cell
            let used = cpu_seconds / rayon::current_num_threads() as f64;
            let last = passes == MOST_PASSES || passes >= 2 && used >= seconds;
            if last || !layers && passes >= 2 && passes.is_power_of_two() {
                let image = format!("{stem}-{passes}.exr");
                self.write(&image, loaded, &render, last)?;
                snapshots.push(Snapshot {
                    image,
                    passes,
                    cpu_seconds: microseconds(cpu_seconds),
                    wall_seconds: microseconds(wall_seconds),
                });
                clock.skip_since((cpu_seconds, wall_seconds));
            }
            if last {
                break;
            }
        }
        let counters = render.counters();
        Ok(Some((
            counters.closest_rays + counters.shadow_rays,
            snapshots,
        )))
    }

    /// Writes the image: all of XYZ at the end of a cell, Y alone before, and a sample of its noise.
    fn write(
        &self,
        name: &str,
        loaded: &Loaded,
        render: &Render,
        whole: bool,
    ) -> Result<(), CliError> {
        let header = loaded.header(self.sensor, render);
        let mut image = xyz_image(&render.outputs().image, &header);
        // what was not kept is not added
        add_layers(
            &mut image,
            &[Aov::Strategies, Aov::Regularized],
            render,
            &[],
        );
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
