//! Disks that lights and detectors are aimed at.

use super::keys::{Build, POSITIVE, Table, keys};
use super::reader::Reader;
use super::value::{Length, Point};
use glam::DVec3;

keys! {
    /// A disk at right angles to the way to its center.
    AimKeys = "aim" {
        /// Center of the disk.
        target: Point;
        /// Radius of the disk.
        radius: Length, in POSITIVE;
    }
}

/// A disk to aim at.
#[derive(Clone, Copy, Debug)]
pub struct Disk {
    /// Center.
    pub target: DVec3,
    /// Radius in meters.
    pub radius_m: f64,
}

impl Build for AimKeys {
    type Output = Disk;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Disk> {
        table.sound(cx)?;
        Some(Disk {
            target: self.target.0,
            radius_m: self.radius.0,
        })
    }
}
