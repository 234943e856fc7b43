//! Photon merging over the passes of a render: radius, wavelengths and times that a pass shares,
//! memory.
//!
//! The radius shrinks as r₁ i^(−(1−α)/2) with the global index i = 1, 2, ... of the pass, so that
//! passes stay independent (Knaus and Zwicker, "Progressive Photon Mapping: A Probabilistic
//! Approach", 2011); α = 2/3 balances squared bias and variance (Kaplanyan and Dachsbacher,
//! "Adaptive Progressive Photon Mapping", 2013).
//!
//! Invariant: r₁ is a function of scene and settings without the seed, so that all parts of a
//! render agree.

use super::pilot::{PASS, SAMPLES, lattice};
use crate::film::Crop;
use crate::integrator::{PhotonTracer, SensorJob, Workspace, sample_pixel};
use crate::math::exact;
use crate::math::hash::{combine, random_bits, unit_f64};
use crate::scene::Settings;
use crate::scene::settings::{Merging, Sharing};
use crate::spectrum::SensorResponse;
use crate::transport::context::SharedSample;
use crate::transport::photons::bytes_per_vertex;
use crate::transport::{Counters, PassSettings, PhotonBuffer, PhotonMap};
use glam::DVec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// r₁ in widths of a pixel, where the camera sees something.
pub const PIXELS: f64 = 2.0;
/// r₁ as a share of the scene's radius elsewhere, as in SmallVCM.
pub const SHARE: f64 = 0.003;
/// No radius is smaller than this share of the scene's radius, which positions of photons resolve.
const LEAST_SHARE: f64 = 1e-5;
/// Pixels whose light sub-paths one thread traces in one go.
const RUN: usize = 32;
/// Parts of a pass's light sub-paths, of which one is in memory twice for a moment, and light
/// sub-paths of one at least: threads wait for each other at the end of each.
const BATCHES: usize = 64;
const LEAST_BATCH: usize = 32 * RUN;
/// Passes whose light sub-paths tell how many vertices are stored.
const PILOT_PASSES: u32 = 4;

/// A choice of r₁.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RadiusChoice {
    /// Radius of the first pass in meters.
    #[serde(with = "exact")]
    pub radius: f64,
    /// How it was found.
    pub reason: RadiusReason,
}

/// How r₁ was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RadiusReason {
    /// The scene says it.
    Given,
    /// [`PIXELS`] at the distance of what the camera sees.
    Pixels,
    /// [`SHARE`] of the radius of the scene.
    Scene,
}

/// Memory that merging will hold during a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonMemory {
    /// Stored vertices per light sub-path, from a pilot.
    pub vertices_per_path: f64,
    /// Light sub-paths of a pass.
    pub paths: u64,
    /// Bytes per stored vertex.
    pub bytes_per_vertex: u64,
}

impl PhotonMemory {
    /// Whether the index has numbers for so many, with a margin for what the pilot did not see.
    #[must_use]
    pub fn is_addressable(&self) -> bool {
        1.1 * self.vertices_per_path * (self.paths as f64) < f64::from(u32::MAX)
    }

    /// Bytes in all, at most at once.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (self.vertices_per_path * self.paths as f64 * self.bytes_per_vertex as f64) as u64
    }
}

/// The wavelengths that were heroes of all paths of some pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedWavelengths {
    /// How many there are.
    pub distinct: usize,
    /// Widest part of the working range without one, in nanometers.
    pub largest_gap_nm: f64,
}

impl SharedWavelengths {
    /// Of wavelengths within a range.
    #[must_use]
    pub fn new(mut heroes_nm: Vec<f64>, range_nm: [f64; 2]) -> Self {
        heroes_nm.sort_by(f64::total_cmp);
        heroes_nm.dedup();
        let distinct = heroes_nm.len();
        heroes_nm.insert(0, range_nm[0]);
        heroes_nm.push(range_nm[1]);
        Self {
            distinct,
            largest_gap_nm: heroes_nm
                .windows(2)
                .map(|w| w[1] - w[0])
                .fold(0.0, f64::max),
        }
    }
}

/// Chooses r₁ for a sensor.
#[must_use]
pub fn choose_radius(frame: &SensorJob, response: SensorResponse) -> RadiusChoice {
    let scene = frame.scene;
    if let Some(radius) = frame.settings.merging.radius {
        return RadiusChoice {
            radius,
            reason: RadiusReason::Given,
        };
    }
    let camera = &scene.sensors[frame.sensor].camera;
    let mut widths = Vec::new();
    if !camera.is_hittable() {
        let settings = Settings {
            seed: 0,
            ..frame.settings.clone()
        };
        let whole = scene.sensors[frame.sensor].whole_film();
        let pilot = SensorJob::new(scene, frame.sensor, &settings, &whole, false);
        let pass = PassSettings {
            index: PASS,
            ..PassSettings::default()
        };
        let mut workspace = Workspace::default();
        for (x, y) in lattice(&whole) {
            sample_pixel(&pilot, &pass, (x, y), response, &mut workspace);
            let raster = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let time = scene.sensors[frame.sensor].shutter.at(0.5);
            let width = camera.pixel_width(raster, time.into());
            let mut length = 0.0;
            for vertex in &workspace.camera_subpath().vertices {
                length += vertex.distance;
                if vertex.has_non_specular {
                    widths.push(width.at(length));
                    break;
                }
            }
        }
    }
    widths.sort_by(f64::total_cmp);
    match widths.get(widths.len() / 2) {
        Some(width) => RadiusChoice {
            radius: PIXELS * width,
            reason: RadiusReason::Pixels,
        },
        None => RadiusChoice {
            radius: SHARE * scene.accel.radius(),
            reason: RadiusReason::Scene,
        },
    }
}

/// Radius of pass `index` = 0, 1, ... in meters, in a scene of the radius `scene_radius`.
#[must_use]
pub fn scheduled_radius(merging: &Merging, scene_radius: f64, first: f64, index: u32) -> f64 {
    let exponent = -0.5 * (1.0 - merging.alpha);
    let radius = first * (f64::from(index) + 1.0).powf(exponent);
    radius.max(LEAST_SHARE * scene_radius)
}

/// Wavelength and time of pass `index`.
#[must_use]
pub fn shared_sample(frame: &SensorJob, index: u32) -> SharedSample {
    let key = combine(
        combine(frame.settings.seed, 0x5348_4152),
        frame.sensor as u64,
    );
    let random = |i: u64| unit_f64(random_bits(key, i));
    let (u_wavelength, time) = match frame.settings.merging.sharing {
        Sharing::Hero | Sharing::Set => {
            let i = 2 * u64::from(index);
            (random(i), random(i + 1))
        }
        // multiples of the golden ratio and of √2 - 1, from a random start
        Sharing::Stratified => {
            let along = |start: f64, step: f64| (start + f64::from(index) * step).fract();
            (
                along(random(0), 0.618_033_988_749_894_9),
                along(random(1), std::f64::consts::SQRT_2 - 1.0),
            )
        }
    };
    SharedSample {
        u_wavelength,
        heroes: frame.heroes(),
        time,
    }
}

/// Traces the light sub-paths of all pixels of the crop and stores their vertices. The order of the
/// photons is that of the pixels, whatever the threads. No map where there are more than fit;
/// nothing at all where `is_cancelled` says so.
pub fn trace_photons(
    frame: &SensorJob,
    pass: &PassSettings,
    crop: &Crop,
    is_cancelled: impl Fn() -> bool + Sync,
) -> Option<(Option<PhotonMap>, Counters)> {
    let (width, pixels) = (crop.width() as usize, crop.pixels() as usize);
    let batch = pixels.div_ceil(BATCHES).next_multiple_of(RUN);
    let batch = batch.max(LEAST_BATCH);
    let batches = pixels.div_ceil(batch);
    let (mut all, mut counters) = (PhotonBuffer::default(), Counters::default());
    for start in (0..pixels).step_by(batch) {
        if is_cancelled() {
            return None;
        }
        let runs: Vec<(PhotonBuffer, Counters)> = (start..pixels.min(start + batch))
            .into_par_iter()
            .step_by(RUN)
            .with_max_len(4)
            .map_init(PhotonTracer::default, |tracer, first| {
                let mut buffer = PhotonBuffer::default();
                tracer.counters = Counters::default();
                for i in first..pixels.min(first + RUN) {
                    if is_cancelled() {
                        break;
                    }
                    let pixel = (crop.x0 + (i % width) as u32, crop.y0 + (i / width) as u32);
                    tracer.trace(frame, pass, pixel, &mut buffer);
                }
                (buffer, tracer.counters)
            })
            .collect();
        for (buffer, run) in &runs {
            all.append(buffer);
            counters.add(run);
        }
        if start == 0 {
            // batches differ; room that is not used takes no memory
            all.reserve_times(batches + batches / 8);
        }
    }
    if is_cancelled() {
        return None;
    }
    let radius = pass.merge_radius.unwrap_or(0.0);
    let center = frame.scene.accel.center();
    let map = PhotonMap::build(all, frame.lanes(), center, radius, &is_cancelled);
    (!is_cancelled()).then_some((map, counters))
}

/// Memory that the passes of a render over part of the film will hold.
#[must_use]
pub fn memory(frame: &SensorJob, crop: &Crop) -> PhotonMemory {
    let (mut tracer, mut buffer) = (PhotonTracer::default(), PhotonBuffer::default());
    for index in PASS - (PILOT_PASSES - 1)..=PASS {
        let pass = PassSettings {
            index,
            shared: Some(shared_sample(frame, index)),
            ..PassSettings::default()
        };
        for pixel in lattice(crop) {
            tracer.trace(frame, &pass, pixel, &mut buffer);
        }
    }
    PhotonMemory {
        vertices_per_path: buffer.len() as f64 / f64::from(SAMPLES * PILOT_PASSES),
        paths: crop.pixels(),
        bytes_per_vertex: bytes_per_vertex(frame.lanes()) as u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_reach_to_the_ends_of_the_range() {
        let found = SharedWavelengths::new(vec![500.0, 420.0, 500.0], [400.0, 700.0]);
        assert_eq!((found.distinct, found.largest_gap_nm), (2, 200.0));
    }
}
