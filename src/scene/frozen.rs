//! A scene with one effect left out, to see what the effect costs and what it buys.

use super::description::SceneDescription;
use crate::geometry::Shutter;
use crate::spectrum::ior::LINE_D_NM;

/// An effect to leave out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frozen {
    /// Every index is that at the d line (587.56 nm) for all wavelengths.
    Dispersion,
    /// Every shutter opens for the moment in the middle of the time for which it was open.
    Motion,
}

impl SceneDescription {
    /// Leaves an effect out.
    pub fn freeze(&mut self, frozen: Frozen) {
        match frozen {
            Frozen::Dispersion => {
                for medium in &mut self.media {
                    medium.ior = medium.ior.constant_as_at(LINE_D_NM);
                }
            }
            Frozen::Motion => {
                for sensor in &mut self.sensors {
                    let middle = sensor.shutter.at(0.5);
                    sensor.shutter = Shutter {
                        open_s: middle,
                        close_s: middle,
                    };
                }
            }
        }
    }
}
