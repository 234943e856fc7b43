//! Memory: what a render will take, against what is allowed or there.

use super::usage::{bytes_text, resident_bytes};
use super::{CliError, tell};
use crate::render::memory::{geometry_bytes, object_bytes, texture_bytes};
use crate::scene::Scene;
use std::fs::read_to_string;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::time::Duration;

/// How often memory is looked at while a scene is loaded.
const LOOK: Duration = Duration::from_millis(20);

/// Memory that a render needs at once, in bytes.
#[derive(Clone, Copy, Debug)]
pub struct Need {
    /// The program with its scene.
    pub loaded: u64,
    /// Films, those of the pass in flight included.
    pub films: u64,
    /// Copies for writing.
    pub saving: u64,
    /// Photons, where they are merged and known.
    pub photons: u64,
}

impl Need {
    /// All of it.
    #[must_use]
    pub fn total(&self) -> u64 {
        let rest = [self.films, self.saving, self.photons];
        rest.into_iter().fold(self.loaded, u64::saturating_add)
    }

    /// In words, part by part.
    #[must_use]
    pub fn text(&self) -> String {
        let parts = [
            ("films", self.films),
            ("saving", self.saving),
            ("photons", self.photons),
        ];
        let parts = parts.iter().filter(|(_, bytes)| *bytes > 0);
        let rest = parts.map(|(what, bytes)| format!(", {what} {}", bytes_text(*bytes)));
        let loaded = bytes_text(self.loaded);
        format!("program and scene {loaded}{}", rest.collect::<String>())
    }

    /// Whether it fits into `max_memory`, or without it into what this machine lets the process
    /// have.
    ///
    /// # Errors
    /// Where it does not.
    pub fn check(&self, max_memory: Option<u64>) -> Result<(), CliError> {
        let (limit, whose) = limit(max_memory);
        if self.total() <= limit {
            return Ok(());
        }
        Err(CliError::Failed(format!(
            "{}: together {}, {whose} {}",
            self.text(),
            bytes_text(self.total()),
            bytes_text(limit)
        )))
    }
}

/// Bytes that the process holds with a scene; by the scene alone where the system does not tell.
#[must_use]
pub fn loaded_bytes(scene: &Scene) -> u64 {
    let counted = geometry_bytes(scene) + texture_bytes(scene) + object_bytes(scene);
    resident_bytes().unwrap_or(counted)
}

/// Loads something, and ends the process where that takes more than `max_memory`, or without it
/// than this machine lets it have: nothing is lost yet.
///
/// # Errors
/// Where it takes more.
pub fn guarded<T>(max_memory: Option<u64>, load: impl FnOnce() -> T) -> Result<T, CliError> {
    let (limit, whose) = limit(max_memory);
    let excess = || {
        let resident = resident_bytes().filter(|bytes| *bytes > limit)?;
        let (resident, limit) = (bytes_text(resident), bytes_text(limit));
        Some(format!("loading takes {resident}, {whose} {limit}"))
    };
    let is_loaded = AtomicBool::new(false);
    let loaded = std::thread::scope(|scope| {
        let watch = scope.spawn(|| {
            while !is_loaded.load(SeqCst) {
                if let Some(message) = excess() {
                    tell(&format!("error: {message}"));
                    std::process::exit(1);
                }
                std::thread::park_timeout(LOOK);
            }
        });
        let loaded = load();
        is_loaded.store(true, SeqCst);
        watch.thread().unpark();
        loaded
    });
    match excess() {
        None => Ok(loaded),
        Some(message) => Err(CliError::Failed(message)),
    }
}

/// The limit in bytes, and whose it is.
fn limit(max_memory: Option<u64>) -> (u64, &'static str) {
    match max_memory {
        Some(limit) => (limit, "--max-memory allows"),
        None => (of_machine(), "this machine has"),
    }
}

/// Bytes that this process can have: the memory of the machine, of its control group, and its own
/// address space; no limit where the system does not say.
fn of_machine() -> u64 {
    let limits = [
        read_to_string("/proc/meminfo").ok().and_then(|t| total(&t)),
        read_to_string("/proc/self/limits")
            .ok()
            .and_then(|t| address_space(&t)),
        control_group(),
    ];
    limits.into_iter().flatten().min().unwrap_or(u64::MAX)
}

/// `MemTotal` of `/proc/meminfo`, in kB there.
fn total(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|l| l.strip_prefix("MemTotal:"))?;
    let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    kilobytes.checked_mul(1024)
}

/// The soft limit on the address space of `/proc/self/limits`, if there is one.
fn address_space(limits: &str) -> Option<u64> {
    let mut lines = limits.lines();
    let line = lines.find_map(|l| l.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// `memory.max` of the control group of this process (version 2), if there is one.
fn control_group() -> Option<u64> {
    let groups = read_to_string("/proc/self/cgroup").ok()?;
    let group = groups.lines().find_map(|l| l.strip_prefix("0::/"))?;
    let file = format!("/sys/fs/cgroup/{group}/memory.max");
    read_to_string(file).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_of_the_system_are_read() {
        let meminfo = "MemTotal:       24551234 kB\nMemFree: 1 kB\n";
        assert_eq!(total(meminfo), Some(24_551_234 * 1024));
        assert_eq!(total("MemTotal: much"), None);
        let limits =
            "Limit  Soft Limit  Hard Limit  Units\nMax address space  6000000 unlimited bytes\n";
        assert_eq!(address_space(limits), Some(6_000_000));
        let none = "Max address space  unlimited  unlimited  bytes\n";
        assert_eq!(address_space(none), None);
    }
}
