//! Errors of the images of a cell against the reference, and what they say of the variant.

use super::cell::{Cell, NOISE_CHANNEL};
use crate::io::exr;
use crate::math::convergence::{Point, Reach, error_at, reach};
use crate::math::image_error::{image_error, mean_relative_square};
use crate::math::stats::Moments;
use crate::report::compare::check_size;
use crate::report::{ReportError, json};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

/// Relative errors whose cost is told.
pub const TARGETS: [f64; 3] = [0.1, 0.03, 0.01];

/// Luminance of an image.
#[derive(Clone, Debug)]
pub struct Luminance {
    /// Columns and rows.
    pub size: (u32, u32),
    /// Y per pixel.
    pub y: Vec<f64>,
    /// One sample of its standard error per pixel.
    pub noise: Option<Vec<f64>>,
}

impl Luminance {
    /// Reads the channels Y and, where it is there, `noise.Y`.
    ///
    /// # Errors
    /// Where the file cannot be read, has no Y, or values that are not finite.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        let image = exr::read(path)?;
        let channel = |name: &str| -> Option<Vec<f64>> {
            Some(image.channel(name)?.iter().map(|v| f64::from(*v)).collect())
        };
        let y = channel("Y").ok_or_else(|| ReportError::file(path, "has no channel Y"))?;
        let noise = channel(NOISE_CHANNEL).or_else(|| channel("error.Y"));
        if y.iter()
            .chain(noise.iter().flatten())
            .any(|v| !v.is_finite())
        {
            return Err(ReportError::file(path, "has values that are not finite"));
        }
        Ok(Self {
            size: (image.crop.width(), image.crop.height()),
            y,
            noise,
        })
    }
}

/// Errors of one image. All are of Y.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// Mean of (I − R)²/(R² + 0.01).
    pub rel_mse: f64,
    /// The same without the worst 0.1 % of the pixels.
    pub trimmed_rel_mse: f64,
    /// Of the logarithms.
    pub log_rmse: f64,
    /// Mean of Var(I)/(R² + 0.01), from the halves of the passes.
    pub rel_variance: f64,
    /// Mean of I / mean of R.
    #[serde(deserialize_with = "json::number")]
    pub mean_ratio: f64,
}

/// A point of a curve: an image, what it took, and how far it is off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Seed.
    pub seed: u64,
    /// File of the image.
    pub image: String,
    /// Passes.
    pub passes: u32,
    /// CPU seconds.
    pub cpu_seconds: f64,
    /// Wall seconds.
    pub wall_seconds: f64,
    /// Errors.
    #[serde(flatten)]
    pub errors: Measures,
    /// Value of the probed pixel.
    pub probe: Option<f64>,
}

/// Measures every image of a cell.
///
/// # Errors
/// Where an image cannot be read or is not of the reference's size.
pub fn measure(
    folder: &Path,
    cell: &Cell,
    reference: &Luminance,
    probe: Option<[u32; 2]>,
) -> Result<Vec<Measured>, ReportError> {
    let point = |snapshot: &super::cell::Snapshot| {
        let path = folder.join(&snapshot.image);
        let image = Luminance::read(&path)?;
        check_size(&path, image.size, reference.size)?;
        let errors = image_error(&image.y, &reference.y, image.size.0 as usize);
        let noise = image.noise.unwrap_or_default();
        Ok(Measured {
            seed: cell.seed,
            image: snapshot.image.clone(),
            passes: snapshot.passes,
            cpu_seconds: snapshot.cpu_seconds,
            wall_seconds: snapshot.wall_seconds,
            errors: Measures {
                rel_mse: errors.rel_mse,
                trimmed_rel_mse: errors.trimmed_rel_mse,
                log_rmse: errors.log_rmse,
                mean_ratio: errors.mean_ratio,
                rel_variance: mean_relative_square(&noise, &reference.y),
            },
            probe: probe.map(|[x, y]| image.y[(y * image.size.0 + x) as usize]),
        })
    };
    cell.snapshots.iter().map(point).collect()
}

/// A mean over seeds and its standard error (`None` for a single seed).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Mean.
    #[serde(deserialize_with = "json::number")]
    pub mean: f64,
    /// Standard error of the mean.
    pub error: Option<f64>,
}

impl Spread {
    /// Of the values of the seeds.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut moments = Moments::default();
        for value in values {
            moments.push(value);
        }
        Self {
            mean: moments.mean,
            error: (moments.count > 1).then(|| moments.standard_error()),
        }
    }
}

/// When a variant reaches an error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum TimeTo {
    /// Within what was measured.
    Measured {
        /// CPU seconds.
        cpu_seconds: f64,
    },
    /// If the error goes on falling as it did.
    Extrapolated {
        /// CPU seconds.
        cpu_seconds: f64,
    },
    /// The bias or the error of the reference is in the way.
    NotClaimed,
    /// The error does not fall steadily.
    Unsteady,
}

/// Measures of a variant as a whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// CPU seconds per pass.
    pub pass_seconds: Spread,
    /// Time (CPU seconds) to a relative variance of 1: variance times time. Small is efficient.
    pub unit_variance_seconds: Spread,
    /// Relative error √relMSE at the end.
    pub final_error: Spread,
    /// Relative error √relMSE after the CPU seconds that every variant had.
    pub equal_time_error: Spread,
    /// The same as `final_error` without the worst 0.1 % of the pixels.
    pub trimmed_error: Spread,
    /// Log-RMSE at the end.
    pub log_rmse: Spread,
    /// Mean of the image over that of the reference, at the end.
    #[serde(deserialize_with = "json::number")]
    pub mean_ratio: f64,
    /// √max(0, MSE − variance), relative: what more samples do not take away.
    pub bias: f64,
    /// Bias that the spread of the seeds (or, with one seed, the noise) would let appear where
    /// there is none.
    pub bias_noise: f64,
    /// CPU seconds to relative errors of 10 %, 3 % and 1 %.
    pub time_to: [TimeTo; 3],
}

/// The points of a variant after each number of passes that all its seeds have.
pub fn by_passes(points: &[Measured]) -> Vec<(u32, Vec<&Measured>)> {
    let seeds: BTreeSet<u64> = points.iter().map(|p| p.seed).collect();
    let passes: BTreeSet<u32> = points.iter().map(|p| p.passes).collect();
    let at = |n| {
        (
            n,
            points.iter().filter(|p| p.passes == n).collect::<Vec<_>>(),
        )
    };
    let all = passes.into_iter().map(at);
    all.filter(|(_, here)| here.len() == seeds.len()).collect()
}

/// Mean of a value of some points.
pub fn mean(points: &[&Measured], of: impl Fn(&Measured) -> f64) -> f64 {
    points.iter().map(|p| of(p)).sum::<f64>() / points.len() as f64
}

/// The points of a variant's seeds at equal passes, averaged: CPU seconds and relative error
/// √relMSE.
#[must_use]
pub fn mean_curve(points: &[Measured]) -> Vec<Point> {
    let doubling = by_passes(points).into_iter();
    doubling
        .filter(|(passes, _)| passes.is_power_of_two())
        .map(|(_, here)| Point {
            work: mean(&here, |p| p.cpu_seconds),
            error: mean(&here, |p| p.errors.rel_mse).sqrt(),
        })
        .collect()
}

/// The points of each seed.
fn by_seed(points: &[Measured]) -> impl Iterator<Item = &[Measured]> {
    points.chunk_by(|a, b| a.seed == b.seed)
}

/// The CPU seconds that every seed had at its end.
#[must_use]
pub fn common_seconds(points: &[Measured]) -> f64 {
    let ends = by_seed(points).filter_map(|seed| seed.last());
    ends.map(|p| p.cpu_seconds).fold(f64::INFINITY, f64::min)
}

/// Sums up a variant. `floor` is the relative variance of the reference, where it is known;
/// `equal_seconds` are the CPU seconds at which variants are compared.
#[must_use]
pub fn summarize(points: &[Measured], floor: f64, equal_seconds: f64) -> Summary {
    let last: Vec<&Measured> = by_seed(points).filter_map(|seed| seed.last()).collect();
    let at_equal_time = by_seed(points).filter_map(|seed| {
        let curve: Vec<Point> = seed
            .iter()
            .map(|p| Point {
                work: p.cpu_seconds,
                error: p.errors.rel_mse.sqrt(),
            })
            .collect();
        error_at(&curve, equal_seconds)
    });
    let spread = |f: &dyn Fn(&Measured) -> f64| Spread::of(last.iter().map(|p| f(p)));
    let square = spread(&|p| p.errors.rel_mse - p.errors.rel_variance - floor);
    let variance = spread(&|p| p.errors.rel_variance).mean;
    let noise = square.error.map_or(variance + floor, |e| 2.0 * e);
    let bias_square = square.mean.max(0.0);
    let curve = mean_curve(points);
    let limit = (floor + bias_square.max(0.0) * f64::from(u8::from(square.mean > noise))).sqrt();
    let time_to = TARGETS.map(|target| {
        if target < limit {
            return TimeTo::NotClaimed;
        }
        match reach(&curve, target) {
            Reach::Within(cpu_seconds) => TimeTo::Measured { cpu_seconds },
            Reach::Beyond(cpu_seconds) => TimeTo::Extrapolated { cpu_seconds },
            Reach::Unknown => TimeTo::Unsteady,
        }
    });
    Summary {
        pass_seconds: spread(&|p| p.cpu_seconds / f64::from(p.passes)),
        unit_variance_seconds: spread(&|p| p.errors.rel_variance * p.cpu_seconds),
        final_error: spread(&|p| p.errors.rel_mse.sqrt()),
        equal_time_error: Spread::of(at_equal_time),
        trimmed_error: spread(&|p| p.errors.trimmed_rel_mse.sqrt()),
        log_rmse: spread(&|p| p.errors.log_rmse),
        mean_ratio: spread(&|p| p.errors.mean_ratio).mean,
        bias: bias_square.sqrt(),
        bias_noise: noise.sqrt(),
        time_to,
    }
}
