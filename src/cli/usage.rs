//! What the process has used: CPU time and memory, where the system tells (Linux), and what a render will need.

use crate::film::fixed::FixedSum;
use crate::geometry::{Instance, Shape};
use crate::light::Light;
use crate::scene::Scene;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// Unit of times in `/proc/self/stat` (USER_HZ, which the kernel fixes at 100 for user space).
const TICKS_PER_SECOND: f64 = 100.0;

/// CPU seconds of all threads so far.
#[must_use]
pub fn cpu_seconds() -> Option<f64> {
    parse_cpu_seconds(&std::fs::read_to_string("/proc/self/stat").ok()?)
}

fn parse_cpu_seconds(stat: &str) -> Option<f64> {
    // the second field, the command in parentheses, may hold blanks; utime and stime are fields 14 and 15
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|t| t.parse::<f64>().ok());
    Some((ticks(11)? + ticks(12)?) / TICKS_PER_SECOND)
}

/// CPU time of all threads (wall time where the system does not tell) and wall time, without what was spent on other things.
pub struct Clock {
    wall: Instant,
    cpu: Option<f64>,
    skipped: (f64, f64),
}

impl Clock {
    /// Starts now.
    #[must_use]
    pub fn start() -> Self {
        Self {
            wall: Instant::now(),
            cpu: cpu_seconds(),
            skipped: (0.0, 0.0),
        }
    }

    fn raw(&self) -> (f64, f64) {
        let wall = self.wall.elapsed().as_secs_f64();
        let cpu = self.cpu.and_then(|start| Some(cpu_seconds()? - start));
        (cpu.unwrap_or(wall), wall)
    }

    /// CPU and wall seconds that count. The system counts CPU time in steps, so that the first may be 0: half a step then.
    #[must_use]
    pub fn read(&self) -> (f64, f64) {
        let (cpu, wall) = self.raw();
        ((cpu - self.skipped.0).max(0.005), wall - self.skipped.1)
    }

    /// What has passed since `reading` does not count.
    pub fn skip_since(&mut self, reading: (f64, f64)) {
        let (cpu, wall) = self.read();
        self.skipped.0 += (cpu - reading.0).max(0.0);
        self.skipped.1 += wall - reading.1;
    }
}

/// Largest resident memory so far, in bytes.
#[must_use]
pub fn peak_memory_bytes() -> Option<u64> {
    parse_peak_memory(&std::fs::read_to_string("/proc/self/status").ok()?)
}

fn parse_peak_memory(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim()
        .strip_suffix("kB")?
        .trim()
        .parse::<u64>()
        .ok()?
        .checked_mul(1024)
}

/// Bytes of a film: two halves of a sum per channel.
#[must_use]
pub fn film_bytes(pixels: u64, channels: u64) -> u64 {
    pixels
        .saturating_mul(channels)
        .saturating_mul(2 * size_of::<FixedSum>() as u64)
}

/// Bytes of the meshes of a scene and of the tables of those that emit, shared ones once.
#[must_use]
pub fn geometry_bytes(scene: &Scene) -> u64 {
    let mesh = |instance: &Instance| match &instance.shape {
        Shape::Mesh(mesh) => Some((Arc::as_ptr(mesh).cast::<()>(), mesh.bytes())),
        Shape::Deforming(mesh) => Some((Arc::as_ptr(mesh).cast(), mesh.bytes())),
        _ => None,
    };
    let table = |light: &Light| {
        let table = light.as_area()?.sampler.table()?;
        Some((Arc::as_ptr(table).cast(), table.bytes()))
    };
    let meshes = scene.accel.instances().iter().filter_map(mesh);
    let tables = scene.lights.iter().filter_map(table);
    let each: BTreeMap<_, _> = meshes.chain(tables).collect();
    each.values().sum::<usize>() as u64
}

/// Bytes of the images of a scene, shared ones once, and of the tables that draw from environments.
#[must_use]
pub fn texture_bytes(scene: &Scene) -> u64 {
    let images: usize = scene.images().iter().map(|i| i.bytes()).sum();
    let table = |light: &Light| {
        let image = light.as_environment().and_then(|e| e.image.as_ref());
        image.map_or(0, |i| i.table_bytes())
    };
    (images + scene.lights.iter().map(table).sum::<usize>()) as u64
}

/// A number of bytes for reading.
#[must_use]
pub fn bytes_text(bytes: u64) -> String {
    const UNITS: [&str; 4] = ["KiB", "MiB", "GiB", "TiB"];
    if bytes < 1024 {
        return format!("{bytes} B");
    }
    let power = (bytes.ilog2() / 10).min(4);
    format!(
        "{:.1} {}",
        bytes as f64 / f64::from(10 * power).exp2(),
        UNITS[power as usize - 1]
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_proc() {
        let stat = "7 (a b) c) R 1 7 7 0 -1 4 88 0 0 0 150 50 0 0 20 0 1 0 100 0 0";
        assert_eq!(parse_cpu_seconds(stat), Some(2.0));
        assert_eq!(parse_cpu_seconds("7 (a) R 1"), None);
        assert_eq!(
            parse_peak_memory("VmPeak:\t 9 kB\nVmHWM:\t    2048 kB\n"),
            Some(2 << 20)
        );
        assert_eq!(parse_peak_memory("VmPeak:\t 9 kB\n"), None);
    }

    #[test]
    fn bytes_in_words() {
        let cases = [
            (0, "0 B"),
            (1023, "1023 B"),
            (1024, "1.0 KiB"),
            (3 << 19, "1.5 MiB"),
            (5 << 30, "5.0 GiB"),
        ];
        for (bytes, text) in cases {
            assert_eq!(bytes_text(bytes), text);
        }
        assert_eq!(bytes_text(u64::MAX), "16777216.0 TiB");
    }
}
