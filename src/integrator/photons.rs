//! The first phase of a pass with merging: light sub-paths, before any camera sub-path.

use super::sample::{SensorJob, begin, start_light};
use crate::geometry::Placements;
use crate::spectrum::SensorResponse;
use crate::transport::{Counters, MediaMemory, PassSettings, PhotonBuffer, Subpath};

/// Traces light sub-paths and stores their vertices, with the buffers of one thread.
#[derive(Debug, Default)]
pub struct PhotonTracer {
    placements: Placements,
    media: MediaMemory,
    light: Subpath,
    /// Counts of this thread.
    pub counters: Counters,
}

impl PhotonTracer {
    /// Adds what the light sub-path of one pixel leaves.
    pub fn trace(
        &mut self,
        job: &SensorJob,
        pass: &PassSettings,
        pixel: (u32, u32),
        buffer: &mut PhotonBuffer,
    ) {
        // what paths are worth to a sensor is of no use here
        let response = SensorResponse::Xyz;
        let (placements, media) = (&mut self.placements, &mut self.media);
        let sampler = job.sampler(pass, pixel);
        let numbers = (&sampler, pixel);
        let context = begin(job, pass, numbers, response, placements, media);
        let (light, counters) = (&mut self.light, &mut self.counters);
        if start_light(&context, light, job.max_depth(), &sampler, counters) {
            let before = buffer.len();
            let width = job.scene.sensors[job.sensor].camera.resolution().width;
            let path = pixel.1 * width + pixel.0;
            let strategies = job.strategies_of(pass, pixel);
            buffer.add(&context, &strategies, light, path);
            counters.photons += (buffer.len() - before) as u64;
        }
    }
}
