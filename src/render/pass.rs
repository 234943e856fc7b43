//! One pass over a film: a sample of every pixel, tile by tile on all threads.

use super::share::share;
use super::{Cancel, ClassTable, Outputs};
use crate::film::Crop;
use crate::integrator::{SensorJob, Workspace, sample_and_merge};
use crate::spectrum::LaneResponse;
use crate::transport::{Contribution, Counters, PassSettings, PhotonMap, Target};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};
use std::time::Instant;

/// Side of a tile in pixels.
const TILE: u32 = 8;

/// Tiles of a pass that are done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tiles {
    /// Index of the pass.
    pub pass: u32,
    /// Tiles done, 1 or more.
    pub done: u64,
    /// Tiles of a pass.
    pub all: u64,
}

/// Told of each tile, by whichever thread has finished it.
pub type TileObserver = dyn Fn(Tiles) + Send + Sync;

/// Communication of a pass with the outside, between its pixels.
#[derive(Default)]
pub(super) struct Watch<'a> {
    /// Ends the work on the pass before its last pixel.
    pub cancel: Option<&'a Cancel>,
    /// When the work on the pass ends, though never before its first pixel.
    pub pause_at: Option<Instant>,
    /// Told of each tile.
    pub observer: Option<&'a TileObserver>,
}

impl Watch<'_> {
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(Cancel::is_requested)
    }

    fn is_pause_due(&self) -> bool {
        self.pause_at.is_some_and(|at| Instant::now() >= at)
    }
}

/// Results of a pass besides its films.
#[derive(Debug, Default)]
pub(super) struct PassCounts {
    pub counters: Counters,
    /// Of the render, then of its companions.
    pub tables: Vec<ClassTable>,
    /// Bytes of its photon map; 0 without merging.
    pub photon_bytes: u64,
}

impl PassCounts {
    /// Adds those of a thread.
    pub fn add(&mut self, local: Local) {
        self.counters.add(&local.workspace.counters);
        let count = self.tables.len().max(local.tables.len());
        self.tables.resize_with(count, ClassTable::default);
        for (sum, table) in self.tables.iter_mut().zip(local.tables) {
            sum.merge(table);
        }
    }
}

/// A pass in flight: what is done of it.
#[derive(Debug)]
pub(super) struct Flight {
    /// Index of the pass.
    pub index: u32,
    /// Pixels done of each tile, in reading order both.
    pub done: Vec<u16>,
    pub counts: PassCounts,
}

impl Flight {
    /// A pass that has not begun.
    pub fn new(index: u32, crop: &Crop) -> Self {
        Self {
            index,
            done: vec![0; tile_count(crop) as usize],
            counts: PassCounts::default(),
        }
    }

    pub fn has_begun(&self) -> bool {
        self.done.iter().any(|&pixels| pixels > 0)
    }
}

/// A pass of which some pixels are done, and their sums.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnfinishedPass {
    /// Index of the pass.
    pub pass: u32,
    /// Pixels done of each tile of 8 x 8 pixels, in reading order both.
    pub done: Vec<u16>,
    /// Sums that these pixels have added to the image, of the half of the pass
    /// ([`Film::sums_of_half`](crate::film::Film::sums_of_half)); then to those of companions.
    pub sums: Vec<i128>,
}

/// Number of tiles of a film.
#[must_use]
pub fn tile_count(crop: &Crop) -> u64 {
    u64::from(crop.width().div_ceil(TILE)) * u64::from(crop.height().div_ceil(TILE))
}

/// Numbers of pixels of the tiles of a film, in reading order.
pub fn tile_pixels(crop: &Crop) -> impl Iterator<Item = u16> + use<> {
    // at most 8 x 8
    tiles(*crop).map(|tile| tile.pixels() as u16)
}

/// Buffers and sums of one thread during a pass.
#[derive(Default)]
pub(super) struct Local {
    pub workspace: Workspace,
    pub values: Vec<f64>,
    pub tables: Vec<ClassTable>,
}

/// Adds a sample of every pixel that is not done yet to `films`, the render's own and those of its
/// companions. Whether the pass is whole then: not where it was cancelled or paused.
pub(super) fn render_tiles(
    frame: &SensorJob,
    pass: &PassSettings,
    photons: Option<&PhotonMap>,
    films: &[&Outputs],
    watch: &Watch,
    flight: &mut Flight,
) -> bool {
    let half = (pass.index & 1) as usize;
    let tiles: Vec<Crop> = tiles(films[0].image.crop()).collect();
    let is_whole = |(tile, done): (&Crop, &u16)| u64::from(*done) == tile.pixels();
    let (all, whole) = (tiles.len() as u64, tiles.iter().zip(&flight.done));
    let whole = AtomicU64::new(whole.filter(|pair| is_whole(*pair)).count() as u64);
    let has_added = AtomicBool::new(false);
    let render_tile = |local: &mut Local, (tile, done): (&Crop, &mut u16)| {
        if is_whole((tile, done)) {
            return;
        }
        while !is_whole((tile, done)) {
            // a pause that is due at once would end in no progress at all
            if watch.is_cancelled() || has_added.load(SeqCst) && watch.is_pause_due() {
                return;
            }
            let at = u32::from(*done);
            let pixel = (tile.x0 + at % tile.width(), tile.y0 + at / tile.width());
            render_pixel((frame, pass, photons), films, pixel, half, local);
            *done += 1;
            has_added.store(true, SeqCst);
        }
        if let Some(observer) = watch.observer {
            let done = whole.fetch_add(1, SeqCst) + 1;
            let pass = pass.index;
            observer(Tiles { pass, done, all });
        }
    };
    let work = tiles.iter().zip(&mut flight.done);
    for local in share(work, Local::default, render_tile) {
        flight.counts.add(local);
    }
    tiles.iter().zip(&flight.done).all(is_whole)
}

/// The tiles of a film, in reading order.
fn tiles(crop: Crop) -> impl Iterator<Item = Crop> {
    let along = |first: u32, end: u32| (first..end).step_by(TILE as usize);
    along(crop.y0, crop.y1).flat_map(move |y0| {
        along(crop.x0, crop.x1).map(move |x0| Crop {
            x0,
            y0,
            x1: x0.saturating_add(TILE).min(crop.x1),
            y1: y0.saturating_add(TILE).min(crop.y1),
        })
    })
}

fn render_pixel(
    (frame, pass, photons): (&SensorJob, &PassSettings, Option<&PhotonMap>),
    films: &[&Outputs],
    pixel: (u32, u32),
    half: usize,
    local: &mut Local,
) {
    let Local {
        workspace,
        values,
        tables,
    } = local;
    let response = sample_and_merge(frame, pass, photons, pixel, films[0].response, workspace);
    tables.resize_with(films.len(), ClassTable::default);
    let companions = workspace.companions.iter();
    let contributions = std::iter::once(&workspace.contributions).chain(companions);
    for ((contributions, outputs), table) in contributions.zip(films).zip(tables) {
        let table = frame.with_raw.then_some(table);
        add_sample(contributions, &response, outputs, pixel, half, table);
        let events = workspace.events();
        outputs.add_extras((contributions, events), &response, pixel, half, values);
    }
}

/// Adds a sample to the main image of a film, and to the table where one is kept.
pub(super) fn add_sample(
    contributions: &[Contribution],
    response: &LaneResponse,
    outputs: &Outputs,
    pixel: (u32, u32),
    half: usize,
    mut table: Option<&mut ClassTable>,
) {
    // splats one by one, the pixel's own contributions as one sum
    let mut own = [0.0; 3];
    for contribution in contributions {
        let xyz = response.xyz(&contribution.lanes);
        match contribution.target {
            Target::OwnPixel => own.iter_mut().zip(xyz).for_each(|(sum, more)| *sum += more),
            Target::Splat(raster) => outputs.image.add_splat(raster, pixel, half, &xyz),
        }
        if let Some(table) = &mut table {
            let share = match contribution.target {
                Target::OwnPixel => 1.0,
                Target::Splat(raster) => outputs.image.coverage(raster),
            };
            if share > 0.0 {
                table.add(contribution, share, response);
            }
        }
    }
    outputs.image.add_pixel(pixel.0, pixel.1, half, &own);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_a_film() {
        for (x0, y0, x1, y1) in [(3, 5, 4, 6), (0, 0, 16, 33), (7, 1, 50, 17)] {
            let crop = Crop { x0, y0, x1, y1 };
            assert_eq!(tiles(crop).count() as u64, tile_count(&crop));
            assert_eq!(
                tile_pixels(&crop).map(u64::from).sum::<u64>(),
                crop.pixels()
            );
        }
        // no more than a number is made of what a file may claim
        assert_eq!(tile_count(&Crop::whole(u32::MAX, u32::MAX)), 1 << 58);
    }
}
