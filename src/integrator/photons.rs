//! The first phase of a pass with merging: all light sub-paths, before any camera sub-path.

use super::sample::{Frame, begin, start_light};
use crate::film::{Crop, SensorResponse};
use crate::medium::MediumLanes;
use crate::transport::{Counters, PassSettings, PhotonBuffer, PhotonMap, Subpath};
use rayon::prelude::*;

/// Buffers of one thread.
#[derive(Default)]
struct Tracing {
    media: Vec<MediumLanes>,
    light: Subpath,
}

impl Tracing {
    /// Adds what the light sub-path of one pixel leaves.
    fn trace(
        &mut self,
        frame: &Frame,
        pass: &PassSettings,
        pixel: (u32, u32),
        buffer: &mut PhotonBuffer,
        counters: &mut Counters,
    ) {
        // what paths are worth to a sensor is of no use here
        let response = SensorResponse::Xyz;
        let (sampler, context) = begin(frame, pass, pixel, &response, &mut self.media);
        let light = &mut self.light;
        if start_light(&context, light, frame.max_depth(), &sampler, counters) {
            let width = frame.scene.sensors[frame.sensor].camera.resolution().width;
            let path = pixel.1 * width + pixel.0;
            let techniques = frame.techniques_of(pass, pixel);
            buffer.add(&context, &techniques, light, path);
        }
    }
}

/// Traces the light sub-paths of all pixels of the crop and stores their vertices. The order of the photons is that of the pixels,
/// whatever the threads. `None` where there are more than fit.
#[must_use]
pub fn trace_photons(
    frame: &Frame,
    pass: &PassSettings,
    crop: &Crop,
) -> (Option<PhotonMap>, Counters) {
    let radius = pass.merge_radius.unwrap_or(0.0);
    let rows: Vec<(PhotonBuffer, Counters)> = (crop.y0..crop.y1)
        .into_par_iter()
        .map_init(Tracing::default, |tracing, y| {
            let mut buffer = PhotonBuffer::default();
            let mut counters = Counters::default();
            for x in crop.x0..crop.x1 {
                tracing.trace(frame, pass, (x, y), &mut buffer, &mut counters);
            }
            (buffer, counters)
        })
        .collect();
    let mut counters = Counters::default();
    let mut buffers = Vec::with_capacity(rows.len());
    for (buffer, row) in rows {
        counters.photons += buffer.len() as u64;
        counters.add(&row);
        buffers.push(buffer);
    }
    let map = PhotonMap::build(buffers, frame.lanes(), frame.scene.center, radius);
    (map, counters)
}

/// Vertices that the light sub-paths of the given pixels would leave.
#[must_use]
pub fn count_photons(
    frame: &Frame,
    pass: &PassSettings,
    pixels: impl Iterator<Item = (u32, u32)>,
) -> usize {
    let mut tracing = Tracing::default();
    let mut buffer = PhotonBuffer::default();
    let mut counters = Counters::default();
    for pixel in pixels {
        tracing.trace(frame, pass, pixel, &mut buffer, &mut counters);
    }
    buffer.len()
}
