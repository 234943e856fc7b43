//! Memory: what a render will take, against what is allowed or there.

use super::CliError;
use super::usage::bytes_text;
use crate::render::PhotonMemory;
use crate::render::memory::{geometry_bytes, texture_bytes};
use crate::scene::Scene;
use std::fs::read_to_string;

/// Whether films, meshes, textures and photons fit into `max_memory`, or without it into what this
/// machine lets the process have.
///
/// # Errors
/// They do not.
pub fn within_limit(
    max_memory: Option<u64>,
    film_bytes: u64,
    scene: &Scene,
    photons: Option<&PhotonMemory>,
) -> Result<(), CliError> {
    let photon_bytes = photons.map_or(0, PhotonMemory::bytes);
    let needed = film_bytes
        .saturating_add(geometry_bytes(scene))
        .saturating_add(texture_bytes(scene))
        .saturating_add(photon_bytes);
    let (limit, whose) = match max_memory {
        Some(limit) => (limit, "--max-memory allows"),
        None => (of_machine(), "this machine has"),
    };
    if needed <= limit {
        return Ok(());
    }
    let what = if photons.is_some() {
        "films, meshes, textures and photons"
    } else {
        "films, meshes and textures"
    };
    let (needed, limit) = (bytes_text(needed), bytes_text(limit));
    Err(CliError::Failed(format!(
        "{what} need {needed}, {whose} {limit}"
    )))
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
