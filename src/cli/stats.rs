//! The file of `--stats`: statistics of a run as JSON.

use super::CliError;
use super::usage::peak_memory_bytes;
use crate::io::atomic::write_atomic;
use crate::io::identity::VERSION;
use crate::io::loaded::Loaded;
use crate::report::statistics::SensorStats;
use serde_json::json;
use std::io::Write;
use std::path::Path;

/// Writes the statistics of a run.
///
/// # Errors
/// Where the file cannot be written.
pub fn write(
    path: &Path,
    loaded: &Loaded,
    threads: usize,
    sensors: &[SensorStats],
) -> Result<(), CliError> {
    let value = json!({
        "version": VERSION,
        "scene_hash": format!("{:016x}", loaded.scene.hash),
        "integrator": loaded.settings.integrator.to_string(),
        "seed": loaded.settings.seed,
        "lanes": loaded.settings.lanes,
        "threads": threads,
        "effects": loaded.scene.effects,
        "peak_memory_bytes": peak_memory_bytes(),
        "sensors": sensors.iter().map(SensorStats::json).collect::<Vec<_>>(),
    });
    Ok(write_atomic(path, |w| writeln!(w, "{value:#}"))?)
}
