//! Rendering: passes over tiles on all threads, stop rules, and what is kept of the contributions.

pub mod bias;
pub mod epsilon;
pub mod error;
pub mod forecast;
pub mod guides;
pub mod merging;
pub mod outputs;
pub mod pilot;
pub mod stop;
pub mod table;

pub use epsilon::EpsilonChoice;
pub use error::ErrorEstimate;
pub use merging::{PhotonMemory, RadiusChoice, SharedWavelengths};
pub use outputs::{OutputRequest, Outputs};
pub use table::ClassTable;

use crate::film::{AddSumsError, Crop};
use crate::integrator::{Frame, Workspace, sample_and_merge};
use crate::scene::regularization::Decision;
use crate::scene::{Scene, Settings};
use crate::transport::photons::bytes_per_vertex;
use crate::transport::regularize::scheduled_epsilon;
use crate::transport::{Cone, Counters, PassSettings, PhotonMap, Target};
use rayon::prelude::*;

/// Side of a tile in pixels.
const TILE: u32 = 16;

/// The render of one sensor: passes are added one by one.
#[derive(Debug)]
pub struct Render<'a> {
    frame: Frame<'a>,
    crop: Crop,
    outputs: Outputs,
    /// ε₁ of regularized renders.
    epsilon: Option<EpsilonChoice>,
    /// r₁ of renders with merging.
    radius: Option<RadiusChoice>,
    /// Bytes of the largest photon map so far.
    photon_bytes: u64,
    /// Roulette threshold of this seed and scene, from the pilot.
    roulette_threshold: f64,
    /// Global indices of the passes done.
    passes: Vec<u32>,
    counters: Counters,
    table: ClassTable,
}

/// What one thread collects during a pass.
#[derive(Default)]
struct Local {
    workspace: Workspace,
    values: Vec<f64>,
    table: ClassTable,
}

impl<'a> Render<'a> {
    /// Prepares the render of a sensor over part of its film.
    #[must_use]
    pub fn new(
        scene: &'a Scene,
        sensor: usize,
        settings: &'a Settings,
        crop: Crop,
        request: &OutputRequest,
    ) -> Self {
        let mut frame = Frame::new(scene, sensor, settings, &crop, request.class_table);
        frame.detailed |= request.strategies || !request.classes.is_empty();
        let outputs = Outputs::new(request, crop, scene.sensors[sensor].filter);
        let epsilon = frame
            .regularization
            .mode
            .map(|_| epsilon::choose(&frame, outputs.response));
        let cone = epsilon.as_ref().map(|e| Cone::new(e.epsilon));
        let merges = frame.strategies.merge.is_some();
        let radius = merges.then(|| merging::choose_radius(&frame, outputs.response));
        let roulette_threshold = pilot::roulette_threshold(&frame, cone, outputs.response);
        Self {
            frame,
            crop,
            outputs,
            epsilon,
            radius,
            photon_bytes: 0,
            roulette_threshold,
            passes: Vec::new(),
            counters: Counters::default(),
            table: ClassTable::default(),
        }
    }

    /// The settings of pass `index`.
    #[must_use]
    pub fn pass_settings(&self, index: u32) -> PassSettings {
        PassSettings {
            index,
            cone: self.epsilon_of_pass(index).map(Cone::new),
            merge_radius: self.radius_of_pass(index),
            shared: self
                .radius
                .as_ref()
                .map(|_| merging::shared_sample(&self.frame, index)),
            roulette_threshold: self.roulette_threshold,
        }
    }

    /// Radius of merging in pass `index` in metres, `None` without merging.
    #[must_use]
    pub fn radius_of_pass(&self, index: u32) -> Option<f64> {
        let first = self.radius.as_ref()?.radius;
        Some(merging::scheduled_radius(&self.frame, first, index))
    }

    /// r₁ and its reason, where photons are merged.
    #[must_use]
    pub fn radius(&self) -> Option<&RadiusChoice> {
        self.radius.as_ref()
    }

    /// What the photons of a pass will take, where they are merged: an estimate from a short run.
    #[must_use]
    pub fn photon_memory(&self) -> Option<PhotonMemory> {
        self.radius
            .is_some()
            .then(|| merging::memory(&self.frame, &self.crop))
    }

    /// Bytes of a stored photon, its place in the index included, where photons are merged.
    #[must_use]
    pub fn bytes_per_photon(&self) -> Option<u64> {
        self.radius.as_ref()?;
        Some(bytes_per_vertex(self.frame.lanes()) as u64)
    }

    /// Bytes of the largest photon map so far; 0 without merging.
    #[must_use]
    pub fn photon_bytes(&self) -> u64 {
        self.photon_bytes
    }

    /// The wavelengths that the passes done shared; `None` where each path has its own.
    #[must_use]
    pub fn shared_wavelengths(&self) -> Option<SharedWavelengths> {
        self.radius.as_ref()?;
        let distribution = &self.frame.scene.wavelengths;
        let heroes = self.passes.iter().flat_map(|&index| {
            let shared = merging::shared_sample(&self.frame, index);
            let set = distribution.sample(shared.u_wavelength, self.frame.lanes());
            (0..shared.heroes as usize).map(move |j| set.lambda_nm(j))
        });
        Some(SharedWavelengths::new(
            heroes.collect(),
            distribution.range_nm(),
        ))
    }

    /// Half-aperture of pass `index` in radians, `None` without regularization. The schedule is a function of the global index; to
    /// tell the bias, an odd pass uses the even one's before it over √2.
    #[must_use]
    pub fn epsilon_of_pass(&self, index: u32) -> Option<f64> {
        let first = self.epsilon.as_ref()?.epsilon;
        let settings = &self.frame.settings.regularization;
        let scheduled = |i| scheduled_epsilon(first, settings.epsilon_min, i);
        Some(if self.tells_bias() && index & 1 == 1 {
            scheduled(index - 1) * std::f64::consts::FRAC_1_SQRT_2
        } else {
            scheduled(index)
        })
    }

    /// Whether a regularized render alternates between two cones, so that its halves tell the bias.
    #[must_use]
    pub fn tells_bias(&self) -> bool {
        let sensor = &self.frame.scene.sensors[self.frame.sensor];
        let settings = &self.frame.settings.regularization;
        settings
            .bias_estimate
            .unwrap_or_else(|| sensor.camera.is_hittable())
    }

    /// Whether specular vertices are connectible, and why.
    #[must_use]
    pub fn regularization(&self) -> &Decision {
        &self.frame.regularization
    }

    /// ε₁ and its reason, where there is one.
    #[must_use]
    pub fn epsilon(&self) -> Option<&EpsilonChoice> {
        self.epsilon.as_ref()
    }

    /// Mean of ε² over the passes done, in steradians: the bias of the image is in proportion to it.
    #[must_use]
    pub fn mean_epsilon_squared(&self) -> Option<f64> {
        let squares: Option<Vec<f64>> = self
            .passes
            .iter()
            .map(|&p| Some(self.epsilon_of_pass(p)?.powi(2)))
            .collect();
        let squares = squares?;
        Some(squares.iter().sum::<f64>() / squares.len().max(1) as f64)
    }

    /// Adds pass `index`: one sample per pixel.
    pub fn add_pass(&mut self, index: u32) {
        let mut pass = self.pass_settings(index);
        let half = (index & 1) as usize;
        let mut photons = None;
        if self.radius.is_some() {
            let (map, counters) = merging::trace_photons(&self.frame, &pass, &self.crop);
            self.counters.add(&counters);
            self.photon_bytes = self
                .photon_bytes
                .max(map.as_ref().map_or(0, PhotonMap::bytes));
            if map.is_none() {
                // too many for the index: weights must know that nothing is merged
                pass.merge_radius = None;
            }
            photons = map;
        }
        let (frame, outputs) = (&self.frame, &self.outputs);
        let local = tiles(&self.crop)
            .into_par_iter()
            .fold(Local::default, |mut local, tile| {
                for y in tile.y0..tile.y1 {
                    for x in tile.x0..tile.x1 {
                        render_pixel(
                            (frame, &pass, photons.as_ref()),
                            outputs,
                            (x, y),
                            half,
                            &mut local,
                        );
                    }
                }
                local
            })
            .reduce(Local::default, |mut a, b| {
                a.workspace.counters.add(&b.workspace.counters);
                a.table.merge(b.table);
                a
            });
        self.counters.add(&local.workspace.counters);
        self.table.merge(local.table);
        self.passes.push(index);
    }

    /// Adds the image sums of passes that were done before.
    ///
    /// # Errors
    /// Where the sums are of another film or overflow.
    pub fn restore(&mut self, passes: &[u32], sums: &[i128]) -> Result<(), AddSumsError> {
        self.outputs.image.add_sums(sums)?;
        self.passes.extend(passes);
        Ok(())
    }

    /// Global indices of the passes done, in the order they were done.
    #[must_use]
    pub fn passes(&self) -> &[u32] {
        &self.passes
    }

    /// Numbers of even and odd passes done.
    #[must_use]
    pub fn pass_counts(&self) -> [u64; 2] {
        let odd = self.passes.iter().filter(|&&p| p & 1 == 1).count() as u64;
        [self.passes.len() as u64 - odd, odd]
    }

    /// What was kept.
    #[must_use]
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// The rendered part of the film.
    #[must_use]
    pub fn crop(&self) -> Crop {
        self.crop
    }

    /// Counts of all threads.
    #[must_use]
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Sums per path class and strategy (empty unless asked for).
    #[must_use]
    pub fn table(&self) -> &ClassTable {
        &self.table
    }

    /// Estimated bias of regularization, where the passes alternate between two cones.
    #[must_use]
    pub fn bias(&self) -> Option<bias::BiasEstimate> {
        self.epsilon.as_ref().filter(|_| self.tells_bias())?;
        let [even, odd] = self.pass_counts();
        bias::bias_estimate(&self.outputs.image, even, odd)
    }

    /// Estimated error of the image. `None` before both halves of the passes have one or while the image is black.
    #[must_use]
    pub fn error(&self) -> Option<ErrorEstimate> {
        let [even, odd] = self.pass_counts();
        error::error_estimate(&self.outputs.image, even, odd)
    }
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
    (frame, pass, photons): (&Frame, &PassSettings, Option<&PhotonMap>),
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
