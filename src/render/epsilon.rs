//! The half-aperture ε₁ of the first pass's cone, found from the scene.
//!
//! First a geometric prior: a cone of half-aperture ε at a specular vertex blurs by ε d at distance
//! d, and a blur of some pixels in the first pass shrinks below one as passes are added; on the
//! other hand a cone need not be narrower than the lights seen from there. Then two short renders
//! with the same random numbers, at ε and ε/√2: their difference is half the squared-law bias b ε²
//! of a region, and what regularized strategies scatter about their mean is the variance v/ε². Of
//! both follows ε₁ = (v/(6 b²))^(1/6), the minimum of the mean squared error under the schedule ε₁
//! n^(−1/6), whatever the number of passes. The sixth root forgives a crude estimate.
//!
//! Invariant: a function of scene and settings without the seed, so that all parts of a render
//! agree.

use crate::bsdf::Label;
use crate::film::Crop;
use crate::integrator::{SensorJob, Workspace, sample_pixel};
use crate::light::LightId;
use crate::math::exact;
use crate::scene::Settings;
use crate::spectrum::SensorResponse;
use crate::transport::{Cone, PassSettings, Subpath, Target};
use glam::DVec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// ε of the authors' images, used where the scene says nothing.
const FALLBACK: f64 = 0.04;
/// Blur of the first pass in pixels.
pub const BLUR_PIXELS: f64 = 8.0;
/// Limits of ε₁, in radians. Above, the weights' own bias is a few percent.
const RANGE: [f64; 2] = [1e-4, 0.08];
/// How far the two renders may move it, as factors.
const REFINEMENT: [f64; 2] = [0.5, 4.0];
/// A squared bias of so many standard errors counts as found.
const RESOLVED: f64 = 3.0;
/// One pixel in 4 × 4 is sampled.
const STRIDE: u32 = 4;
/// Passes of each of the two renders.
const PASSES: u32 = 4;
/// Side of a region in pixels.
const REGION: u32 = 64;
/// Index of the first pass of the pilot, which no render reaches.
const FIRST_PASS: u32 = u32::MAX - 16;

/// A choice of ε₁.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpsilonChoice {
    /// Half-aperture in radians.
    #[serde(with = "exact")]
    pub epsilon: f64,
    /// How it was found.
    pub reason: EpsilonReason,
}

/// How ε₁ was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum EpsilonReason {
    /// The scene says it.
    Given,
    /// No path of the pilot joins a specular surface to another one.
    NoSpecularNeighbor,
    /// By geometry, then by two short renders.
    Found {
        /// The larger of the geometric bounds.
        prior: Prior,
        /// That bound in radians.
        #[serde(with = "exact")]
        prior_rad: f64,
        /// Result of the renders with it.
        refinement: Refinement,
    },
}

/// Geometric bounds of ε₁.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Prior {
    /// Half the angular radius of the lights.
    Lights,
    /// A blur of [`BLUR_PIXELS`].
    Blur,
}

/// Results of the two short renders.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Refinement {
    /// Nothing was regularized.
    Nothing,
    /// Squared bias and variance balance at this half-aperture in radians.
    Balance(#[serde(with = "exact")] f64),
    /// The bias is lost in noise.
    LostInNoise,
}

/// Chooses ε₁ for a sensor.
#[must_use]
pub fn choose(frame: &SensorJob, response: SensorResponse) -> EpsilonChoice {
    if let Some(epsilon) = frame.settings.regularization.epsilon {
        return EpsilonChoice {
            epsilon,
            reason: EpsilonReason::Given,
        };
    }
    let settings = Settings {
        seed: 0,
        ..frame.settings.clone()
    };
    let whole = frame.scene.sensors[frame.sensor].whole_film();
    let mut job = SensorJob::new(frame.scene, frame.sensor, &settings, &whole, false);
    job.strategies.tries = frame.strategies.tries;
    let pilot = Pilot {
        frame: job,
        response,
        film: whole,
    };
    match pilot.prior() {
        None => EpsilonChoice {
            epsilon: FALLBACK,
            reason: EpsilonReason::NoSpecularNeighbor,
        },
        Some((prior_rad, prior)) => pilot.refined(prior_rad, prior),
    }
}

struct Pilot<'a> {
    frame: SensorJob<'a>,
    response: SensorResponse,
    film: Crop,
}

/// Sums over one region of the film, or over all.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// Brightness of all contributions, ε minus ε/√2.
    difference: f64,
    /// Squares of regularized contributions at ε.
    squares: f64,
}

impl Pilot<'_> {
    /// The sampled pixels.
    fn pixels(&self, pass: u32) -> Vec<(u32, u32)> {
        // another pixel of each 4 × 4 in each pass
        let (dx, dy) = [(0, 0), (2, 2), (2, 0), (0, 2)][pass as usize % 4];
        let along = |first: u32, end: u32| (first..end).step_by(STRIDE as usize);
        along(dy, self.film.y1)
            .flat_map(|y| along(dx, self.film.x1).map(move |x| (x, y)))
            .collect()
    }

    /// ε by geometry, with its reason.
    fn prior(&self) -> Option<(f64, Prior)> {
        let pass = PassSettings {
            index: FIRST_PASS,
            ..PassSettings::default()
        };
        let found: Vec<(f64, f64)> = self
            .pixels(0)
            .into_par_iter()
            .map_init(Workspace::default, |workspace, pixel| {
                sample_pixel(&self.frame, &pass, pixel, self.response, workspace);
                self.of_subpath(workspace.camera_subpath(), pixel)
            })
            .flatten_iter()
            .collect();
        if found.is_empty() {
            return None;
        }
        let quantile = |values: &mut Vec<f64>, q: f64| {
            values.sort_by(f64::total_cmp);
            values[((values.len() - 1) as f64 * q) as usize]
        };
        let mut by_pixel: Vec<f64> = found.iter().map(|f| f.0).collect();
        let mut by_light: Vec<f64> = found.iter().map(|f| f.1).collect();
        let pixel = quantile(&mut by_pixel, 0.25);
        let light = quantile(&mut by_light, 0.5);
        let prior = if light > pixel {
            Prior::Lights
        } else {
            Prior::Blur
        };
        Some((light.max(pixel).clamp(RANGE[0], RANGE[1]), prior))
    }

    /// For every specular vertex beside a non-specular one: ε by the blur in pixels, and by the
    /// light seen from there.
    fn of_subpath(&self, path: &Subpath, (x, y): (u32, u32)) -> Vec<(f64, f64)> {
        let sensor = &self.frame.scene.sensors[self.frame.sensor];
        let time = sensor.shutter.at(0.5);
        let raster = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let width = sensor.camera.pixel_width(raster, time.into());
        let specular = |i: usize| path.densities[i + 1].label != Label::NonSpecular;
        let mut found = Vec::new();
        let mut length = 0.0;
        for i in 0..path.vertices.len() {
            let vertex = &path.vertices[i];
            length += vertex.distance;
            let Some(j) = i.checked_sub(1) else { continue };
            if specular(i) == specular(j) || !vertex.distance.is_finite() {
                continue;
            }
            // the non-specular one is where the blur is seen
            let (s, along) = if specular(i) {
                (i, length - vertex.distance)
            } else {
                (j, length)
            };
            found.push((
                BLUR_PIXELS * 0.5 * width.at(along) / vertex.distance,
                0.5 * self.light_angle(path.vertices[s].p),
            ));
        }
        found
    }

    /// Angular radius of the lights seen from a point, weighted by their power.
    fn light_angle(&self, p: glam::DVec3) -> f64 {
        let scene = self.frame.scene;
        let time = scene.sensors[self.frame.sensor].shutter.at(0.5);
        let geometry = scene.accel.at(time);
        scene
            .lights
            .iter()
            .enumerate()
            .map(|(i, light)| {
                scene.selection.probability(LightId(i as u32)) * light.angular_radius(&geometry, p)
            })
            .sum()
    }

    /// The prior, moved to where squared bias and variance balance.
    fn refined(&self, prior_rad: f64, prior: Prior) -> EpsilonChoice {
        let found = |epsilon, refinement| EpsilonChoice {
            epsilon,
            reason: EpsilonReason::Found {
                prior,
                prior_rad,
                refinement,
            },
        };
        let columns = self.film.x1.div_ceil(REGION);
        let regions = (columns * self.film.y1.div_ceil(REGION)) as usize;
        let passes: Vec<Vec<Sums>> = (0..PASSES)
            .map(|pass| self.pass(pass, prior_rad, columns, regions))
            .collect();
        // values per pixel and pass; regions at the border are smaller, and dimmer, which does no
        // harm
        let samples = f64::from(REGION * REGION / (STRIDE * STRIDE));
        let n = f64::from(PASSES);
        let mut bias = 0.0;
        let mut noise = 0.0;
        let mut variance = 0.0;
        for r in 0..regions {
            let values: Vec<f64> = passes.iter().map(|p| p[r].difference / samples).collect();
            let mean = values.iter().sum::<f64>() / n;
            let of_mean = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
            bias += mean * mean - of_mean;
            noise += of_mean * of_mean;
            variance += passes.iter().map(|p| p[r].squares).sum::<f64>() / (samples * n);
        }
        let count = regions as f64;
        let scale = 4.0 / prior_rad.powi(4);
        let variance = variance / count * prior_rad * prior_rad;
        if variance == 0.0 {
            return found(prior_rad, Refinement::Nothing);
        }
        let [low, high] = REFINEMENT;
        let most = (prior_rad * high).min(RANGE[1]).max(prior_rad);
        let (best, refinement) = if bias > RESOLVED * noise.sqrt() {
            let best = (variance / (6.0 * scale * bias / count)).powf(1.0 / 6.0);
            (best, Refinement::Balance(best))
        } else {
            (most, Refinement::LostInNoise)
        };
        found(best.clamp(prior_rad * low, most), refinement)
    }

    /// One pass at both cones, by region.
    fn pass(&self, pass: u32, prior: f64, columns: u32, regions: usize) -> Vec<Sums> {
        let settings = [prior, prior / std::f64::consts::SQRT_2].map(|epsilon| PassSettings {
            index: FIRST_PASS + pass,
            cone: Some(Cone::new(epsilon)),
            ..PassSettings::default()
        });
        let region = |x: f64, y: f64| {
            let inside =
                x >= 0.0 && y >= 0.0 && x < f64::from(self.film.x1) && y < f64::from(self.film.y1);
            inside.then(|| (y as u32 / REGION * columns + x as u32 / REGION) as usize)
        };
        // rows one by one in order, so that sums do not depend on threads
        let parts: Vec<Vec<(usize, Sums)>> = self
            .pixels(pass)
            .into_par_iter()
            .map_init(Workspace::default, |workspace, (x, y)| {
                let mut out = Vec::new();
                for (settings, sign) in settings.iter().zip([1.0, -1.0]) {
                    let response =
                        sample_pixel(&self.frame, settings, (x, y), self.response, workspace);
                    for contribution in &workspace.contributions {
                        let at = match contribution.target {
                            Target::OwnPixel => region(f64::from(x), f64::from(y)),
                            Target::Splat(raster) => region(raster.x, raster.y),
                        };
                        let Some(at) = at else { continue };
                        let value = response.brightness(&contribution.lanes);
                        let counts = sign > 0.0 && contribution.regularized > 0;
                        out.push((
                            at,
                            Sums {
                                difference: sign * value,
                                squares: if counts { value * value } else { 0.0 },
                            },
                        ));
                    }
                }
                out
            })
            .collect();
        let mut sums = vec![Sums::default(); regions];
        for (at, part) in parts.into_iter().flatten() {
            sums[at].difference += part.difference;
            sums[at].squares += part.squares;
        }
        sums
    }
}
