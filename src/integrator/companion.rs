//! Companions: detectors that the light sub-paths of another detector's job fill as well.
//!
//! Arrivals of a light sub-path and connections to it (t <= 1) need no camera sub-path, so one set
//! of light sub-paths serves any number of detectors. Each has weights of its
//! own: its strategies are executed as often per pixel of its film as the job traces light
//! sub-paths.

use super::SensorJob;
use crate::film::Crop;
use crate::transport::connect::Joiner;
use crate::transport::{Contribution, PassSettings, PathContext, Subpath};
use glam::DVec2;

/// A further detector of a job, in one pass.
#[derive(Clone, Debug)]
pub struct Companion<'a> {
    job: SensorJob<'a>,
    pass: PassSettings,
}

impl<'a> Companion<'a> {
    /// Makes the job of a detector one that is filled by the light sub-paths of `lead`, which
    /// samples the pixels of `crop`. Only the strategies of light sub-paths may be executed.
    #[must_use]
    pub fn new(mut job: SensorJob<'a>, pass: PassSettings, lead: &SensorJob, crop: &Crop) -> Self {
        debug_assert!(!job.strategies.wants_camera_walk() && !job.strategies.direct_to_detector);
        let film = job.scene.sensors[job.sensor].whole_film().pixels() as f64;
        let paths = lead.strategies.light_paths;
        job.strategies.light_paths = paths;
        job.strategies.splat_samples = paths * crop.pixels() as f64 / film;
        Self { job, pass }
    }

    /// The detector, by index.
    pub(super) fn sensor(&self) -> usize {
        self.job.sensor
    }

    /// Whether each contribution is noted with its raw value.
    #[must_use]
    pub fn with_raw(&self) -> bool {
        self.job.with_raw
    }

    /// Adds what a light sub-path of the lead's sample of a pixel gives this detector.
    pub(super) fn join(
        &self,
        lead: &mut Joiner,
        light: &Subpath,
        pixel: (u32, u32),
        out: &mut Vec<Contribution>,
    ) {
        let sensor = &self.job.scene.sensors[self.job.sensor];
        let context = PathContext {
            scene: lead.context.scene,
            sensor: self.job.sensor,
            pass: &self.pass,
            ..*lead.context
        };
        let strategies = self.job.strategies_of(&self.pass, pixel);
        let margin = sensor.filter.margin();
        let mut joiner = Joiner {
            context: &context,
            strategies: &strategies,
            max_depth: self.job.max_depth(),
            raster: DVec2::ZERO,
            skip_point_images: false,
            with_raw: self.job.with_raw,
            detailed: self.job.detailed,
            fan: None,
            sampler: lead.sampler,
            counters: &mut *lead.counters,
            out,
            scratch: &mut *lead.scratch,
        };
        for i in 0..light.vertices.len() {
            joiner.to_sensor(light, i, margin);
        }
        for hit in light.hits_of(self.job.sensor) {
            joiner.hit_sensor(light, hit);
        }
    }
}
