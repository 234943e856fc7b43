//! Statistics of a render: what was computed, what it cost, and the table of path classes and
//! strategies.

use crate::render::bias::BiasEstimate;
use crate::render::clock::cpu_seconds;
use crate::render::forecast::Forecast;
use crate::render::stop::StopReason;
use crate::render::table::ClassShare;
use crate::render::{ErrorEstimate, Flux, Render, SharedWavelengths, Total};
use crate::scene::effects::Effect;
use crate::transport::{Counters, StepCount};
use serde_json::{Value, json};
use std::time::Duration;

/// Hits below which a class of paths is not to be trusted: its share is known to 10 % at best.
pub const FEW_HITS: u64 = 100;

/// The cones of a regularized render.
#[derive(Clone, Copy, Debug)]
pub struct EpsilonStats {
    /// Half-aperture of the first pass done, in radians.
    pub first: f64,
    /// Of the last.
    pub last: f64,
    /// Mean of ε² over the passes.
    pub mean_square: f64,
    /// Estimated bias, where the render tells it.
    pub bias: Option<BiasEstimate>,
}

impl EpsilonStats {
    fn new(render: &Render) -> Option<Self> {
        let passes = render.passes();
        Some(Self {
            first: render.epsilon_of_pass(*passes.iter().min()?)?,
            last: render.epsilon_of_pass(*passes.iter().max()?)?,
            mean_square: render.mean_epsilon_squared()?,
            bias: render.bias(),
        })
    }

    fn json(&self) -> Value {
        json!({
            "first": self.first,
            "last": self.last,
            "mean_square": self.mean_square,
            "relative_bias": self.bias.map(|b| b.relative),
            "relative_bias_noise": self.bias.map(|b| b.noise),
        })
    }
}

/// Figures of merging.
#[derive(Clone, Copy, Debug)]
pub struct MergeStats {
    /// Radius of the first pass done, in meters.
    pub radius_first: f64,
    /// Of the last.
    pub radius_last: f64,
    /// Bytes of the largest map of photons.
    pub bytes: u64,
    /// Bytes of a stored vertex, its place in the index included.
    pub bytes_per_vertex: u64,
    /// Stored vertices of a light sub-path, on average.
    pub vertices_per_path: f64,
    /// Wavelengths that passes shared. (Each pass also has one time.)
    pub wavelengths: SharedWavelengths,
}

impl MergeStats {
    fn new(render: &Render) -> Option<Self> {
        let passes = render.passes();
        let counters = render.counters();
        Some(Self {
            radius_first: render.radius_of_pass(*passes.iter().min()?)?,
            radius_last: render.radius_of_pass(*passes.iter().max()?)?,
            bytes: render.photon_bytes(),
            bytes_per_vertex: render.bytes_per_photon()?,
            vertices_per_path: counters.photons as f64 / counters.paths.max(1) as f64,
            wavelengths: render.shared_wavelengths()?,
        })
    }

    fn json(&self, counters: &Counters, passes: usize) -> Value {
        json!({
            "radius_first": self.radius_first,
            "radius_last": self.radius_last,
            "light_vertices": counters.photons,
            "light_vertices_per_path": self.vertices_per_path,
            "light_vertices_found": counters.photons_found,
            "bytes_per_light_vertex": self.bytes_per_vertex,
            "bytes": self.bytes,
            "distinct_wavelengths": self.wavelengths.distinct,
            "largest_gap_nm": self.wavelengths.largest_gap_nm,
            "distinct_times": passes,
        })
    }
}

/// Numbers of one sensor's render.
#[derive(Debug)]
pub struct SensorStats {
    /// Name of the sensor.
    pub name: String,
    /// Indices of the passes, resumed ones included.
    pub passes: Vec<u32>,
    /// Rendered pixels: columns and rows.
    pub size: [u32; 2],
    /// Why it ended.
    pub stop: StopReason,
    /// Wall time.
    pub wall: Duration,
    /// CPU time of all threads.
    pub cpu_seconds: Option<f64>,
    /// Counts of this run.
    pub counters: Counters,
    /// Contributions left out because they were infinite or not a number.
    pub non_finite: u64,
    /// Contributions left out because they were too large.
    pub saturated: u64,
    /// Estimated error.
    pub error: Option<ErrorEstimate>,
    /// Flux through a detector.
    pub flux: Option<Flux>,
    /// A smaller relative error, and what it would take.
    pub forecast: Option<(f64, Forecast)>,
    /// Classes of paths with few hits, where the table of classes is kept.
    pub rarely_hit: Vec<ClassShare>,
    /// Cones, if the sensor was regularized.
    pub epsilon: Option<EpsilonStats>,
    /// Photons, if there were any.
    pub merging: Option<MergeStats>,
    /// Markov chains, resumed ones included, if there were any.
    pub chains: Option<u64>,
    regularization: Effect,
    table: Vec<Value>,
}

impl SensorStats {
    /// At the end of a render that began `wall` ago.
    #[must_use]
    pub fn new(
        name: &str,
        render: &Render,
        stop: StopReason,
        wall: Duration,
        cpu_start: Option<f64>,
    ) -> Self {
        let crop = render.crop();
        let outputs = render.outputs();
        let rejected = outputs.image.rejected();
        let counters = *render.counters();
        // a pass is one sample per pixel, and sums over all pixels are divided by their number
        let mean = |sum: f64| sum / counters.paths.max(1) as f64;
        let rows = render.table().rows().map(|((class, s, t), row)| {
            json!({
                "class": class.to_string(),
                "s": s,
                "t": t,
                "hits": row.hits,
                "raw_mean": mean(row.raw),
                "weighted_mean": mean(row.weighted),
            })
        });
        Self {
            name: name.to_owned(),
            passes: render.passes().to_vec(),
            size: [crop.x1 - crop.x0, crop.y1 - crop.y0],
            stop,
            wall,
            cpu_seconds: cpu_start.and_then(|start| Some(cpu_seconds()? - start)),
            non_finite: counters.non_finite + rejected.not_finite,
            saturated: rejected.saturated,
            error: render.error(),
            flux: render.flux(),
            forecast: None,
            rarely_hit: render.table().rarely_hit(FEW_HITS),
            epsilon: EpsilonStats::new(render),
            merging: MergeStats::new(render),
            chains: render.chains(),
            regularization: render.regularization().effect(),
            table: rows.collect(),
            counters,
        }
    }

    /// Rays of both kinds.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.counters.closest_rays + self.counters.shadow_rays
    }

    /// As JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        let c = &self.counters;
        json!({
            "name": self.name,
            "size": self.size,
            "passes": self.passes.len(),
            "first_pass": self.passes.iter().min(),
            "last_pass": self.passes.iter().max(),
            "stopped_because": self.stop.text(),
            "wall_seconds": self.wall.as_secs_f64(),
            "cpu_seconds": self.cpu_seconds,
            "closest_rays": c.closest_rays,
            "shadow_rays": c.shadow_rays,
            "rays_per_second": self.rays() as f64 / self.wall.as_secs_f64().max(1e-9),
            "paths": c.paths,
            "connections_tried": c.connections_tried,
            "connections_made": c.connections_made,
            "chains_tried": c.chains_tried,
            "chains_found": c.chains_found,
            "non_finite": self.non_finite,
            "saturated": self.saturated,
            "medium_mismatches": c.medium_mismatches,
            "nesting_overflows": c.nesting_overflows,
            "relative_error": self.error.map(|e| e.relative),
            "relative_error_of_all_pixels": self.error.map(|e| e.of_all_pixels),
            "flux": self.flux.as_ref().map(flux_json),
            "forecast": self.forecast.map(forecast_json),
            "rarely_hit": self.rarely_hit.iter().map(class_json).collect::<Vec<_>>(),
            "regularization": self.regularization,
            "epsilon": self.epsilon.as_ref().map(EpsilonStats::json),
            "metropolis": self.chains.map(|chains| chains_json(chains, c)),
            "merging": self.merging.as_ref().map(|m| m.json(c, self.passes.len())),
            "classes": self.table,
        })
    }
}

fn chains_json(chains: u64, counters: &Counters) -> Value {
    let steps = |s: &StepCount| json!({ "tried": s.tried, "accepted": s.accepted });
    let [small, large] = &counters.steps;
    json!({ "chains": chains, "small_steps": steps(small), "large_steps": steps(large) })
}

fn forecast_json((target, forecast): (f64, Forecast)) -> Value {
    let (passes, seconds) = match forecast {
        Forecast::Takes { passes, time } => (Some(passes), Some(time.as_secs_f64())),
        Forecast::Unknown | Forecast::Unsteady => (None, None),
    };
    json!({
        "relative_error": target,
        "passes": passes,
        "seconds": seconds,
        "unsteady": forecast == Forecast::Unsteady,
    })
}

fn flux_json(flux: &Flux) -> Value {
    let total = |t: &Total| json!({ "value": t.value, "standard_error": t.error });
    let line = |(nm, watts): &(f64, Total)| {
        let Total { value, error } = watts;
        json!({ "nm": nm, "value": value, "standard_error": error })
    };
    let class = |(class, lumens): &(String, Total)| {
        let Total { value, error } = lumens;
        json!({ "class": class, "value": value, "standard_error": error })
    };
    json!({
        "luminous_lm": total(&flux.luminous_lm),
        "lines_w": flux.lines_w.iter().map(line).collect::<Vec<_>>(),
        "continuum_w": flux.continuum_w.as_ref().map(total),
        "classes_lm": flux.classes_lm.iter().map(class).collect::<Vec<_>>(),
    })
}

fn class_json(class: &ClassShare) -> Value {
    json!({ "class": class.class.to_string(), "hits": class.hits, "share": class.share })
}
