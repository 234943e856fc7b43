//! The film: sums per pixel that do not depend on the order of addition.

pub mod filter;
pub mod fixed;
pub mod sensor_response;

pub use filter::Filter;
pub use sensor_response::SensorResponse;

use glam::DVec2;

/// The part of the film that is rendered, in pixels: x0 <= x < x1, y0 <= y < y1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl Crop {
    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        u64::from(self.x1 - self.x0) * u64::from(self.y1 - self.y0)
    }
}

/// Sums of one image with `channels` channels (3 for XYZ), in two halves (even and odd passes).
///
/// Threads add concurrently; each value is rounded to a 128-bit fixed-point integer, so any order gives the same bits.
#[derive(Debug)]
pub struct Film {
    // H4
}

#[allow(unused_variables)]
impl Film {
    /// An empty film.
    #[must_use]
    pub fn new(crop: Crop, filter: Filter, channels: usize) -> Self {
        todo!()
    }

    /// Adds to one pixel (absolute film coordinates inside the crop) of half `half` (0 or 1).
    pub fn add_pixel(&self, x: u32, y: u32, half: usize, values: &[f64]) {
        todo!()
    }

    /// Adds a splat at a raster position: every pixel p in the filter's reach gets value × f_p(raster) × pixel area.
    pub fn add_splat(&self, raster: DVec2, half: usize, values: &[f64]) {
        todo!()
    }

    /// Sum of both halves / number of passes, per pixel and channel, row by row.
    #[must_use]
    pub fn image(&self, passes: u64) -> Vec<f64> {
        todo!()
    }
}
