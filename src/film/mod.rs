//! The film: sums per pixel that do not depend on the order of addition.
//!
//! Passes of even and odd number go into two halves, whose difference tells the error. All values
//! are sums; dividing by the number of passes gives the image.

pub mod filter;
pub mod fixed;
pub mod sources;

pub use filter::Filter;
pub use sources::{Blocks, Sources};

use fixed::Unrepresentable;
use glam::DVec2;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};

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
    /// All of a film of `width` x `height` pixels.
    #[must_use]
    pub fn whole(width: u32, height: u32) -> Self {
        Self {
            x0: 0,
            y0: 0,
            x1: width,
            y1: height,
        }
    }

    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        u64::from(self.width()) * u64::from(self.height())
    }

    /// Number of columns.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.x1 - self.x0
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.y1 - self.y0
    }

    /// Whether the pixel is part of it.
    #[must_use]
    pub fn contains(&self, x: u32, y: u32) -> bool {
        (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y)
    }

    /// Position of a pixel of the crop, row by row.
    fn index(&self, x: u32, y: u32) -> usize {
        (y - self.y0) as usize * self.width() as usize + (x - self.x0) as usize
    }
}

/// How many contributions were left out. A correct render has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejected {
    /// Infinite or not a number.
    pub not_finite: u64,
    /// Too large to add (see [`fixed::MAX_VALUE`]), or made a sum overflow.
    pub saturated: u64,
}

/// Why sums cannot be added to a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AddSumsError {
    /// They belong to a film of another size.
    #[error("the film has {expected} sums, the part has {found}")]
    Length {
        /// Sums of the film.
        expected: usize,
        /// Sums given.
        found: usize,
    },
    /// Some sum would leave the range of 128 bits.
    #[error("sum {index} overflows")]
    Overflow {
        /// Position among the sums given.
        index: usize,
    },
}

/// Half width of the window over which the error estimate is averaged, in pixels.
const ERROR_WINDOW: u32 = 3;

/// Sums of one image with `channels` channels (3 for XYZ), in two halves (even and odd passes).
///
/// Threads add concurrently, row by row; each value is rounded to a 128-bit fixed-point integer, so
/// any order gives the same bits. A contribution with a value that cannot be added is left out as a
/// whole and counted.
#[derive(Debug)]
pub struct Film {
    crop: Crop,
    filter: Filter,
    channels: usize,
    /// Value of 2⁶⁴ in the sums, a power of two.
    unit: f64,
    /// By half and row; in each, sums by column and channel. A splat takes one lock per row, where
    /// sums that are atomic each took one per channel. Behind the rows of a half stand its sums by
    /// blocks of sources, each by channel.
    rows: Vec<Mutex<Box<[i128]>>>,
    sources: Option<Sources>,
    not_finite: AtomicU64,
    saturated: AtomicU64,
}

impl Film {
    /// An empty film.
    #[must_use]
    pub fn new(crop: Crop, filter: Filter, channels: usize) -> Self {
        let row = || Mutex::new(vec![0; crop.width() as usize * channels].into());
        Self {
            crop,
            filter,
            channels,
            unit: 1.0,
            rows: (0..2 * crop.height()).map(|_| row()).collect(),
            sources: None,
            not_finite: AtomicU64::new(0),
            saturated: AtomicU64::new(0),
        }
    }

    /// The same for values about 2 to the power of `exponent` times larger: sums count multiples of
    /// 2^(exponent − 64). (−512 to 512, on an empty film.)
    #[must_use]
    pub fn with_exponent(self, exponent: i32) -> Self {
        let unit = f64::from(exponent).exp2();
        Self { unit, ..self }
    }

    /// The same with sums by the pixels whose samples have brought the light. (An empty film.)
    #[must_use]
    pub fn with_sources(self, sources: Sources) -> Self {
        let blocks = sources.blocks.count();
        Self {
            sources: Some(sources),
            ..self.with_block_sums(blocks)
        }
    }

    /// The same with room for the sums of another film by so many blocks of sources. (An empty
    /// film.)
    #[must_use]
    pub fn with_block_sums(mut self, blocks: u32) -> Self {
        let channels = self.channels;
        let sums = || (0..blocks).map(|_| Mutex::new(vec![0; channels].into()));
        let odd = self.rows.split_off(self.rows.len() / 2);
        self.rows.extend(sums());
        self.rows.extend(odd);
        self.rows.extend(sums());
        self
    }

    /// Number of blocks of sources by which light is summed up.
    #[must_use]
    pub fn blocks(&self) -> u32 {
        (self.rows.len() / 2) as u32 - self.crop.height()
    }

    /// The part of the film that is held.
    #[must_use]
    pub fn crop(&self) -> Crop {
        self.crop
    }

    /// The reconstruction filter.
    #[must_use]
    pub fn filter(&self) -> &Filter {
        &self.filter
    }

    /// Number of channels.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// How many contributions were left out so far.
    #[must_use]
    pub fn rejected(&self) -> Rejected {
        Rejected {
            not_finite: self.not_finite.load(Relaxed),
            saturated: self.saturated.load(Relaxed),
        }
    }

    /// Adds to one pixel (absolute film coordinates; nothing happens outside the crop) of half
    /// `half` (0 or 1). One value per channel.
    pub fn add_pixel(&self, x: u32, y: u32, half: usize, values: &[f64]) {
        // nothing is what many samples bring, and changes no sum
        if values.iter().all(|v| *v == 0.0) {
            return;
        }
        if self.crop.contains(x, y) && self.add_scaled(&mut self.row(half, y), x, values, 1.0) {
            self.add_to_block((x, y), half, values, self.measure(x, y));
        }
    }

    /// Adds a splat at a raster position, of a sample of the pixel `source`: every pixel p in the
    /// filter's reach gets value × f_p(raster) × pixel area. Positions outside the film count as
    /// far as they reach into it.
    pub fn add_splat(&self, raster: DVec2, source: (u32, u32), half: usize, values: &[f64]) {
        if !raster.is_finite() {
            self.not_finite.fetch_add(1, Relaxed);
            return;
        }
        let mut landed = 0.0;
        let mut row: Option<(u32, MutexGuard<_>)> = None;
        self.filter.spread(raster, &self.crop, |x, y, weight| {
            if weight > 0.0 {
                if row.as_ref().is_none_or(|(of, _)| *of != y) {
                    // one at a time, for others hold theirs
                    drop(row.take());
                    row = Some((y, self.row(half, y)));
                }
                if let Some((_, row)) = &mut row
                    && self.add_scaled(row, x, values, weight)
                {
                    landed += weight * self.measure(x, y);
                }
            }
        });
        drop(row);
        if landed > 0.0 {
            self.add_to_block(source, half, values, landed);
        }
    }

    /// How much of a splat lands on the film: 1 well inside, less at the border, 0 out of reach.
    #[must_use]
    pub fn coverage(&self, raster: DVec2) -> f64 {
        self.filter.coverage(raster, &self.crop)
    }

    /// The sums of a row of a half, for this thread alone.
    fn row(&self, half: usize, y: u32) -> MutexGuard<'_, Box<[i128]>> {
        debug_assert!(half < 2);
        lock(&self.half(half)[(y - self.crop.y0) as usize])
    }

    /// Rows and blocks of a half.
    fn half(&self, half: usize) -> &[Mutex<Box<[i128]>>] {
        let length = self.rows.len() / 2;
        &self.rows[half * length..(half + 1) * length]
    }

    /// Measure of a pixel of the crop in sums by sources.
    fn measure(&self, x: u32, y: u32) -> f64 {
        let measures = self.sources.as_ref().and_then(|s| s.measures.as_ref());
        measures.map_or(1.0, |all| all[self.crop.index(x, y)])
    }

    /// Adds to the block of a source what the film has got.
    fn add_to_block(&self, source: (u32, u32), half: usize, values: &[f64], scale: f64) {
        let block = self.sources.as_ref().and_then(|s| s.blocks.at(source));
        if let Some(block) = block {
            let sums = &self.half(half)[(self.crop.height() + block) as usize];
            self.add_scaled(&mut lock(sums), self.crop.x0, values, scale);
        }
    }

    /// Adds values to sums. Whether that can be: none is added where one cannot.
    fn add_scaled(&self, row: &mut [i128], x: u32, values: &[f64], scale: f64) -> bool {
        debug_assert!(values.len() == self.channels);
        let scale = scale / self.unit;
        for &value in values {
            match fixed::check(value * scale) {
                Ok(()) => {}
                Err(Unrepresentable::NotFinite) => {
                    self.not_finite.fetch_add(1, Relaxed);
                    return false;
                }
                Err(Unrepresentable::TooLarge) => {
                    self.saturated.fetch_add(1, Relaxed);
                    return false;
                }
            }
        }
        let first = (x - self.crop.x0) as usize * self.channels;
        for (sum, &value) in row[first..].iter_mut().zip(values) {
            match fixed::quantize(value * scale).map(|value| sum.checked_add(value)) {
                Ok(Some(total)) => *sum = total,
                _ => {
                    self.saturated.fetch_add(1, Relaxed);
                }
            }
        }
        true
    }

    /// Number of channels of all pixels.
    fn value_count(&self) -> usize {
        self.crop.pixels() as usize * self.channels
    }

    /// Number of sums of one half, those by sources included.
    #[must_use]
    pub fn sums_per_half(&self) -> usize {
        self.value_count() + self.blocks() as usize * self.channels
    }

    /// The sums of the pixels of one half, row by row.
    fn pixel_sums(&self, half: usize) -> impl Iterator<Item = i128> {
        copied(&self.half(half)[..self.crop.height() as usize])
    }

    /// Sum of both halves / number of passes, per pixel and channel, row by row. Black without
    /// passes.
    #[must_use]
    pub fn image(&self, passes: u64) -> Vec<f64> {
        let scale = mean_scale(passes) * self.unit;
        let pairs = self.pixel_sums(0).zip(self.pixel_sums(1));
        let mean = |(even, odd)| (fixed::to_f64(even) + fixed::to_f64(odd)) * scale;
        collected(self.value_count(), pairs.map(mean))
    }

    /// The channels of one pixel of [`Film::image`] (absolute film coordinates); `None` outside the
    /// crop.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32, passes: u64) -> Option<Vec<f64>> {
        if !self.crop.contains(x, y) {
            return None;
        }
        let first = (x - self.crop.x0) as usize * self.channels;
        let channels = first..first + self.channels;
        let scale = mean_scale(passes) * self.unit;
        let sums = |half| self.row(half, y)[channels.clone()].to_vec();
        let sums = sums(0).into_iter().zip(sums(1));
        let mean = |(even, odd)| (fixed::to_f64(even) + fixed::to_f64(odd)) * scale;
        Some(sums.map(mean).collect())
    }

    /// Image of the even passes minus that of the odd ones, one channel per pixel, row by row.
    /// `None` while a half has no passes.
    #[must_use]
    pub fn half_difference(
        &self,
        channel: usize,
        passes_even: u64,
        passes_odd: u64,
    ) -> Option<Vec<f64>> {
        if passes_even == 0 || passes_odd == 0 || channel >= self.channels {
            return None;
        }
        let values = |half| {
            self.pixel_sums(half)
                .skip(channel)
                .step_by(self.channels)
                .map(fixed::to_f64)
        };
        let [even, odd] = [passes_even, passes_odd].map(|n| mean_scale(n) * self.unit);
        let pairs = values(0).zip(values(1));
        let pixels = self.crop.pixels() as usize;
        Some(collected(pixels, pairs.map(|(e, o)| e * even - o * odd)))
    }

    /// One sample of the standard error of [`Film::image`] per pixel of one channel, with a sign:
    /// its square has the variance of the image as its mean. `None` while a half has no passes.
    ///
    /// With pₑ and pₒ passes, Var(E − O) = σ²(1/pₑ + 1/pₒ) and the image has variance σ²/(pₑ + pₒ),
    /// so the factor between them is pₑ pₒ/(pₑ + pₒ)².
    #[must_use]
    pub fn noise(&self, channel: usize, passes_even: u64, passes_odd: u64) -> Option<Vec<f64>> {
        let mut noise = self.half_difference(channel, passes_even, passes_odd)?;
        let scale = difference_scale(passes_even, passes_odd);
        noise.iter_mut().for_each(|d| *d *= scale);
        Some(noise)
    }

    /// Standard error of one channel of [`Film::image`] per pixel, row by row: the square of
    /// [`Film::noise`] averaged over 7 × 7 pixels (fewer at the border). `None` while a half has no
    /// passes.
    #[must_use]
    pub fn standard_error(
        &self,
        channel: usize,
        passes_even: u64,
        passes_odd: u64,
    ) -> Option<Vec<f64>> {
        let noise = self.noise(channel, passes_even, passes_odd)?;
        let Crop { x0, y0, x1, y1 } = self.crop;
        let window = |at: u32, first: u32, end: u32| {
            at.saturating_sub(ERROR_WINDOW).max(first)..at.saturating_add(ERROR_WINDOW + 1).min(end)
        };
        let mut errors = Vec::with_capacity(noise.len());
        for y in y0..y1 {
            for x in x0..x1 {
                let (mut sum, mut count) = (0.0, 0.0);
                for wy in window(y, y0, y1) {
                    for wx in window(x, x0, x1) {
                        sum += noise[self.crop.index(wx, wy)].powi(2);
                        count += 1.0;
                    }
                }
                errors.push(f64::sqrt(sum / count));
            }
        }
        Some(errors)
    }

    /// Standard error of the sum of [`Film::image`] over all pixels, each times its measure, and
    /// over these channels: blocks of sources are independent, and as far as they are not, the
    /// error is smaller. `None` while a half has no passes, and of films without sums by sources.
    #[must_use]
    pub fn error_of_total(&self, channels: Range<usize>, [even, odd]: [u64; 2]) -> Option<f64> {
        if self.blocks() == 0 || even == 0 || odd == 0 {
            return None;
        }
        let total = |block: &Mutex<Box<[i128]>>, passes: u64| {
            let sums = &lock(block)[channels.clone()];
            sums.iter().map(|sum| fixed::to_f64(*sum)).sum::<f64>() * mean_scale(passes)
        };
        let first = self.crop.height() as usize;
        let pairs = self.half(0)[first..].iter().zip(&self.half(1)[first..]);
        let squares = pairs.map(|(e, o)| (total(e, even) - total(o, odd)).powi(2));
        Some(self.unit * difference_scale(even, odd) * squares.sum::<f64>().sqrt())
    }

    /// The exact sums in units of 2^(exponent − 64), by half, row, column and channel; behind the
    /// rows of each half those by sources.
    #[must_use]
    pub fn sums(&self) -> Vec<i128> {
        collected(2 * self.sums_per_half(), copied(&self.rows))
    }

    /// Those of one half (0 or 1).
    #[must_use]
    pub fn sums_of_half(&self, half: usize) -> Vec<i128> {
        collected(self.sums_per_half(), copied(self.half(half)))
    }

    /// Adds the sums of another film of the same size.
    ///
    /// # Errors
    /// Where the number of sums differs or one would overflow; the film is then unchanged.
    pub fn add_sums(&mut self, sums: &[i128]) -> Result<(), AddSumsError> {
        add_all(&mut self.rows, sums)
    }

    /// Adds the sums of one half (0 or 1) of another film of the same size.
    ///
    /// # Errors
    /// As [`Film::add_sums`].
    pub fn add_sums_to_half(&mut self, half: usize, sums: &[i128]) -> Result<(), AddSumsError> {
        let length = self.rows.len() / 2;
        add_all(&mut self.rows[half * length..(half + 1) * length], sums)
    }

    /// Moves the sums and counts of another film of the same size into this one and leaves it
    /// empty. A sum that would overflow stays as it was and counts as saturated.
    pub fn take(&mut self, other: &mut Self) {
        debug_assert!(self.rows.len() == other.rows.len());
        let theirs = other.rows.iter_mut().flat_map(exclusive);
        let ours = self.rows.iter_mut().flat_map(exclusive);
        for (sum, more) in ours.zip(theirs) {
            match sum.checked_add(std::mem::take(more)) {
                Some(total) => *sum = total,
                None => *self.saturated.get_mut() += 1,
            }
        }
        *self.not_finite.get_mut() += std::mem::take(other.not_finite.get_mut());
        *self.saturated.get_mut() += std::mem::take(other.saturated.get_mut());
    }
}

/// So many values. Rows do not tell their number beforehand, and a vector that grows by doubling
/// would take three times its memory for a moment.
fn collected<T>(count: usize, values: impl Iterator<Item = T>) -> Vec<T> {
    let mut all = Vec::with_capacity(count);
    all.extend(values);
    all
}

/// The sums of a row. No thread stops between two sums of one pixel but for a defect that ends the
/// render.
fn lock(row: &Mutex<Box<[i128]>>) -> MutexGuard<'_, Box<[i128]>> {
    row.lock().unwrap_or_else(PoisonError::into_inner)
}

fn exclusive(row: &mut Mutex<Box<[i128]>>) -> &mut [i128] {
    row.get_mut().unwrap_or_else(PoisonError::into_inner)
}

fn add_all(rows: &mut [Mutex<Box<[i128]>>], more: &[i128]) -> Result<(), AddSumsError> {
    let expected = rows.iter_mut().map(|row| exclusive(row).len()).sum();
    if expected != more.len() {
        let found = more.len();
        return Err(AddSumsError::Length { expected, found });
    }
    let ours = rows.iter_mut().flat_map(exclusive);
    let is_in_range = |(sum, &more): (&mut i128, &i128)| sum.checked_add(more).is_some();
    if let Some(index) = ours.zip(more).position(|pair| !is_in_range(pair)) {
        return Err(AddSumsError::Overflow { index });
    }
    let ours = rows.iter_mut().flat_map(exclusive);
    ours.zip(more).for_each(|(sum, more)| *sum += more);
    Ok(())
}

/// The sums of rows. One row at a time, so that threads that add wait for no longer.
fn copied(rows: &[Mutex<Box<[i128]>>]) -> impl Iterator<Item = i128> {
    rows.iter().flat_map(|row| lock(row).clone())
}

/// Standard error of a mean of so many even and odd passes over that of the difference of the
/// halves, see [`Film::noise`].
fn difference_scale(even: u64, odd: u64) -> f64 {
    let share = even as f64 / (even + odd) as f64;
    (share * (1.0 - share)).sqrt()
}

fn mean_scale(passes: u64) -> f64 {
    if passes == 0 {
        0.0
    } else {
        1.0 / passes as f64
    }
}

#[cfg(test)]
mod tests;
