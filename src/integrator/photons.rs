//! The first phase of a pass with merging: light sub-paths, before any camera sub-path.

use super::sample::{Frame, begin, start_light};
use crate::medium::MediumLanes;
use crate::spectrum::SensorResponse;
use crate::transport::{Counters, PassSettings, PhotonBuffer, Subpath};

/// Traces light sub-paths and stores their vertices, with the buffers of one thread.
#[derive(Debug, Default)]
pub struct PhotonTracer {
    media: Vec<MediumLanes>,
    light: Subpath,
    /// Counts of this thread.
    pub counters: Counters,
}

impl PhotonTracer {
    /// Adds what the light sub-path of one pixel leaves.
    pub fn trace(
        &mut self,
        frame: &Frame,
        pass: &PassSettings,
        pixel: (u32, u32),
        buffer: &mut PhotonBuffer,
    ) {
        // what paths are worth to a sensor is of no use here
        let response = SensorResponse::Xyz;
        let (sampler, context) = begin(frame, pass, pixel, response, &mut self.media);
        let (light, counters) = (&mut self.light, &mut self.counters);
        if start_light(&context, light, frame.max_depth(), &sampler, counters) {
            let before = buffer.len();
            let width = frame.scene.sensors[frame.sensor].camera.resolution().width;
            let path = pixel.1 * width + pixel.0;
            let strategies = frame.strategies_of(pass, pixel);
            buffer.add(&context, &strategies, light, path);
            counters.photons += (buffer.len() - before) as u64;
        }
    }
}
