//! One pass over a film: a sample of every pixel, tile by tile on all threads.

use super::{Cancel, ClassTable, Outputs};
use crate::film::Crop;
use crate::integrator::{SensorJob, Workspace, sample_and_merge};
use crate::transport::{Counters, PassSettings, PhotonMap, Target};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};

/// Side of a tile in pixels.
const TILE: u32 = 16;

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

/// Communication of a pass with the outside, between its tiles.
#[derive(Default)]
pub(super) struct Watch<'a> {
    /// Ends the pass before its last tile.
    pub cancel: Option<&'a Cancel>,
    /// Told of each tile.
    pub observer: Option<&'a TileObserver>,
}

impl Watch<'_> {
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(Cancel::is_requested)
    }
}

/// Results of a pass besides its films.
#[derive(Debug, Default)]
pub(super) struct PassCounts {
    pub counters: Counters,
    pub table: ClassTable,
    /// Bytes of its photon map; 0 without merging.
    pub photon_bytes: u64,
}

/// Buffers and sums of one thread during a pass.
#[derive(Default)]
struct Local {
    workspace: Workspace,
    values: Vec<f64>,
    table: ClassTable,
}

/// Adds a sample of every pixel to `outputs`. `None` where the pass was cancelled: then some tiles
/// are missing.
pub(super) fn render_tiles(
    frame: &SensorJob,
    pass: &PassSettings,
    photons: Option<&PhotonMap>,
    outputs: &Outputs,
    watch: &Watch,
) -> Option<(Counters, ClassTable)> {
    let half = (pass.index & 1) as usize;
    let tiles = tiles(&outputs.image.crop());
    let (done, all) = (AtomicU64::new(0), tiles.len() as u64);
    let render_tile = |mut local: Local, tile: Crop| {
        if watch.is_cancelled() {
            return None;
        }
        for y in tile.y0..tile.y1 {
            for x in tile.x0..tile.x1 {
                let paths = (frame, pass, photons);
                render_pixel(paths, outputs, (x, y), half, &mut local);
            }
        }
        if let Some(observer) = watch.observer {
            let done = done.fetch_add(1, SeqCst) + 1;
            let pass = pass.index;
            observer(Tiles { pass, done, all });
        }
        Some(local)
    };
    let local = tiles
        .into_par_iter()
        .try_fold(Local::default, render_tile)
        .try_reduce(Local::default, |mut a, b| {
            a.workspace.counters.add(&b.workspace.counters);
            a.table.merge(b.table);
            Some(a)
        })?;
    Some((local.workspace.counters, local.table))
}

/// The tiles of a film, in reading order.
fn tiles(crop: &Crop) -> Vec<Crop> {
    let mut out = Vec::new();
    for y0 in (crop.y0..crop.y1).step_by(TILE as usize) {
        for x0 in (crop.x0..crop.x1).step_by(TILE as usize) {
            out.push(Crop {
                x0,
                y0,
                x1: (x0 + TILE).min(crop.x1),
                y1: (y0 + TILE).min(crop.y1),
            });
        }
    }
    out
}

fn render_pixel(
    (frame, pass, photons): (&SensorJob, &PassSettings, Option<&PhotonMap>),
    outputs: &Outputs,
    (x, y): (u32, u32),
    half: usize,
    local: &mut Local,
) {
    let Local {
        workspace,
        values,
        table,
    } = local;
    let response = sample_and_merge(frame, pass, photons, (x, y), outputs.response, workspace);
    // splats one by one, the pixel's own contributions as one sum
    let mut own = [0.0; 3];
    for contribution in &workspace.contributions {
        let xyz = response.xyz(&contribution.lanes);
        match contribution.target {
            Target::OwnPixel => own.iter_mut().zip(xyz).for_each(|(sum, more)| *sum += more),
            Target::Splat(raster) => outputs.image.add_splat(raster, half, &xyz),
        }
        if frame.with_raw {
            let share = match contribution.target {
                Target::OwnPixel => 1.0,
                Target::Splat(raster) => outputs.image.coverage(raster),
            };
            if share > 0.0 {
                table.add(contribution, share, &response);
            }
        }
    }
    outputs.image.add_pixel(x, y, half, &own);
    outputs.add_extras(&workspace.contributions, &response, (x, y), half, values);
}
