//! Rendering: passes over tiles on all threads, stop rules, and what is kept of the contributions.

pub mod bias;
pub mod choices;
pub mod clock;
mod companions;
pub mod effort;
pub mod epsilon;
pub mod error;
pub mod expression;
pub mod flux;
pub mod forecast;
pub mod guides;
pub mod look;
pub mod memory;
pub mod merging;
pub mod metropolis;
pub mod outputs;
pub mod pass;
pub mod pilot;
pub mod session;
mod share;
pub mod stop;
pub mod table;
pub mod tries;
pub mod variance;

pub use choices::Choices;
pub use companions::shared_order;
pub use effort::EffortChoice;
pub use epsilon::EpsilonChoice;
pub use error::ErrorEstimate;
pub use expression::PathExpression;
pub use flux::{Flux, PixelMeasure, Total};
pub use merging::{PhotonMemory, RadiusChoice, SharedWavelengths};
pub use outputs::{OutputRequest, Outputs};
pub use pass::{TileObserver, Tiles, UnfinishedPass};
pub use session::{Progress, Session, SessionError, SessionOptions};
pub use stop::{Cancel, StopReason, StopRules};
pub use table::ClassTable;
pub use tries::TriesChoice;
pub use variance::{PilotPasses, VarianceFactors};

use crate::film::{AddSumsError, Crop};
use crate::integrator::SensorJob;
use crate::scene::regularization::Decision;
use crate::scene::{Scene, Settings};
use crate::transport::photons::bytes_per_vertex;
use crate::transport::regularize::scheduled_epsilon;
use crate::transport::{Cone, Counters, PassSettings, PhotonMap};
use pass::{Flight, Watch};
use std::sync::Arc;

/// The render of one sensor: its films, and the passes they hold. [`Session`] adds passes until it
/// is time to stop.
#[derive(Debug)]
pub struct Render {
    scene: Arc<Scene>,
    sensor: usize,
    settings: Settings,
    crop: Crop,
    request: OutputRequest,
    regularization: Decision,
    outputs: Outputs,
    choices: Choices,
    /// Detectors that its light sub-paths fill as well.
    companions: Vec<Self>,
    /// Bytes of the largest photon map so far.
    photon_bytes: u64,
    /// Global indices of the passes done.
    passes: Vec<u32>,
    counters: Counters,
    table: ClassTable,
}

impl Render {
    /// Prepares the render of a sensor over part of its film: the pilots run.
    #[must_use]
    pub fn new(
        scene: &Arc<Scene>,
        sensor: usize,
        settings: &Settings,
        crop: Crop,
        request: &OutputRequest,
    ) -> Self {
        let pilot = PilotPasses::of(settings.spp);
        Self::with_pilot(scene, sensor, settings, crop, request, pilot)
    }

    /// Prepares a render whose variance factors are found by a pilot of this length: that of the
    /// render whose passes this one adds to.
    #[must_use]
    pub fn with_pilot(
        scene: &Arc<Scene>,
        sensor: usize,
        settings: &Settings,
        crop: Crop,
        request: &OutputRequest,
        pilot: PilotPasses,
    ) -> Self {
        let frame = frame(scene, sensor, settings, &crop, request);
        let choices = Choices::find(frame, crop, request.response, pilot);
        Self::chosen(scene, sensor, settings, crop, request, choices)
    }

    /// Prepares a render by choices that were made for it before. `None` where they are those of
    /// another one.
    #[must_use]
    pub fn with_choices(
        scene: &Arc<Scene>,
        sensor: usize,
        settings: &Settings,
        crop: Crop,
        request: &OutputRequest,
        choices: Choices,
    ) -> Option<Self> {
        let frame = frame(scene, sensor, settings, &crop, request);
        choices
            .fit(&frame, crop)
            .then(|| Self::chosen(scene, sensor, settings, crop, request, choices))
    }

    fn chosen(
        scene: &Arc<Scene>,
        sensor: usize,
        settings: &Settings,
        crop: Crop,
        request: &OutputRequest,
        choices: Choices,
    ) -> Self {
        let outputs = empty_outputs((scene, sensor), settings, request, &crop, &crop);
        let regularization = frame(scene, sensor, settings, &crop, request).regularization;
        Self {
            scene: Arc::clone(scene),
            sensor,
            settings: settings.clone(),
            crop,
            request: request.clone(),
            regularization,
            outputs,
            choices,
            companions: Vec::new(),
            photon_bytes: 0,
            passes: Vec::new(),
            counters: Counters::default(),
            table: ClassTable::default(),
        }
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The sensor, by index.
    #[must_use]
    pub fn sensor(&self) -> usize {
        self.sensor
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    fn frame(&self) -> SensorJob<'_> {
        let Self {
            scene,
            settings,
            crop,
            request,
            ..
        } = self;
        let mut frame = frame(scene, self.sensor, settings, crop, request);
        let choices = &self.choices;
        frame.strategies.tries = choices.tries.as_ref().map(|found| &found.tries);
        frame.strategies.factors = choices.factors.as_ref().map(|found| &found.factors);
        if let Some(effort) = &choices.effort {
            frame
                .strategies
                .set_effort(effort.light_paths, effort.pairs);
        }
        frame
    }

    /// Results of its pilots.
    #[must_use]
    pub fn choices(&self) -> &Choices {
        &self.choices
    }

    /// How often kinds of chains are solved for, where any are.
    #[must_use]
    pub fn tries(&self) -> Option<&TriesChoice> {
        self.choices.tries.as_ref()
    }

    /// Variance factors of the weights, where they have any.
    #[must_use]
    pub fn factors(&self) -> Option<&VarianceFactors> {
        self.choices.factors.as_ref()
    }

    /// Weights by other variance factors than those found: for tests and studies, before the first
    /// pass.
    pub fn set_factors(&mut self, factors: Option<VarianceFactors>) {
        self.choices.factors = factors;
    }

    /// Takes another effort than the one found: for tests and studies, before the first pass.
    pub fn set_effort(&mut self, effort: EffortChoice) {
        self.choices.effort = Some(effort);
    }

    /// The settings of pass `index`.
    #[must_use]
    pub fn pass_settings(&self, index: u32) -> PassSettings {
        self.settings_of(&self.frame(), index)
    }

    fn settings_of(&self, frame: &SensorJob, index: u32) -> PassSettings {
        let merges = self.choices.radius.is_some();
        PassSettings {
            index,
            cone: self.epsilon_of_pass(index).map(Cone::new),
            merge_radius: self.radius_of_pass(index),
            shared: merges.then(|| merging::shared_sample(frame, index)),
            roulette_threshold: self.choices.roulette_threshold,
        }
    }

    /// Whether a pass that is not whole is of no use: where its photons or the brightness of its
    /// samples would have to be kept with it.
    pub(super) fn keeps_whole_passes_only(&self) -> bool {
        self.choices.radius.is_some() || self.choices.brightness.is_some()
    }

    /// Number of Markov chains that the passes done have run, where they run any.
    #[must_use]
    pub fn chains(&self) -> Option<u64> {
        self.choices.brightness?;
        let of_pass = metropolis::chains(&self.settings.metropolis, self.crop.pixels());
        Some(of_pass * self.passes.len() as u64)
    }

    /// Radius of merging in pass `index` in meters, `None` without merging.
    #[must_use]
    pub fn radius_of_pass(&self, index: u32) -> Option<f64> {
        let first = self.choices.radius.as_ref()?.radius;
        let merging = &self.settings.merging;
        let scene_radius = self.scene.accel.radius();
        Some(merging::scheduled_radius(
            merging,
            scene_radius,
            first,
            index,
        ))
    }

    /// r₁ and its reason, where photons are merged.
    #[must_use]
    pub fn radius(&self) -> Option<&RadiusChoice> {
        self.choices.radius.as_ref()
    }

    /// Memory of the photons of a pass, where they are merged: an estimate from a short run.
    #[must_use]
    pub fn photon_memory(&self) -> Option<PhotonMemory> {
        self.choices
            .radius
            .is_some()
            .then(|| merging::memory(&self.frame(), &self.crop))
    }

    /// Bytes of a stored photon, its place in the index included, where photons are merged.
    #[must_use]
    pub fn bytes_per_photon(&self) -> Option<u64> {
        self.choices.radius.as_ref()?;
        Some(bytes_per_vertex(self.frame().lanes()) as u64)
    }

    /// Bytes of the largest photon map so far; 0 without merging.
    #[must_use]
    pub fn photon_bytes(&self) -> u64 {
        self.photon_bytes
    }

    /// The wavelengths that the passes done shared; `None` where each path has its own.
    #[must_use]
    pub fn shared_wavelengths(&self) -> Option<SharedWavelengths> {
        self.choices.radius.as_ref()?;
        let (frame, distribution) = (self.frame(), &self.scene.wavelengths);
        let heroes = self.passes.iter().flat_map(|&index| {
            let shared = merging::shared_sample(&frame, index);
            let set = distribution.sample(shared.u_wavelength, frame.lanes());
            (0..shared.heroes as usize).map(move |j| set.lambda_nm(j))
        });
        Some(SharedWavelengths::new(
            heroes.collect(),
            distribution.range_nm(),
        ))
    }

    /// Half-aperture of pass `index` in radians, `None` without regularization. The schedule is a
    /// function of the global index; to tell the bias, an odd pass uses the even one's before it
    /// over √2.
    #[must_use]
    pub fn epsilon_of_pass(&self, index: u32) -> Option<f64> {
        let first = self.choices.epsilon.as_ref()?.epsilon;
        let settings = &self.settings.regularization;
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
        let sensor = &self.scene.sensors[self.sensor];
        let settings = &self.settings.regularization;
        settings
            .bias_estimate
            .unwrap_or_else(|| sensor.camera.is_hittable())
    }

    /// Whether specular vertices are connectible, and why.
    #[must_use]
    pub fn regularization(&self) -> &Decision {
        &self.regularization
    }

    /// ε₁ and its reason, where there is one.
    #[must_use]
    pub fn epsilon(&self) -> Option<&EpsilonChoice> {
        self.choices.epsilon.as_ref()
    }

    /// Mean of ε² over the passes done, in steradians: the bias of the image is in proportion to
    /// it.
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
        self.add_watched(index, None);
    }

    fn add_watched(&mut self, index: u32, observer: Option<&TileObserver>) {
        let watch = Watch {
            observer,
            ..Watch::default()
        };
        let mut flight = Flight::new(index, &self.crop);
        if self.trace(&mut flight, &self.films(), &watch) {
            self.count(flight);
        }
    }

    /// Traces what is missing of a pass into films, which need not be its own. Whether it is whole
    /// then: not where it was cancelled or paused.
    fn trace(&self, flight: &mut Flight, films: &[&Outputs], watch: &Watch) -> bool {
        let mut frame = self.frame();
        let companions = self.companions_of(&frame, flight.index);
        frame.set_companions(companions);
        let mut pass = self.settings_of(&frame, flight.index);
        if let Some(constant) = self.choices.brightness {
            let counts = &mut flight.counts;
            return metropolis::render_pass(&frame, &pass, constant.0, films[0], watch, counts);
        }
        let mut photons = None;
        if self.choices.radius.is_some() {
            let cancelled = || watch.is_cancelled();
            let Some((map, counters)) =
                merging::trace_photons(&frame, &pass, &self.crop, cancelled)
            else {
                return false;
            };
            flight.counts.counters.add(&counters);
            flight.counts.photon_bytes = map.as_ref().map_or(0, PhotonMap::bytes);
            if map.is_none() {
                // too many for the index: weights must know that nothing is merged
                pass.merge_radius = None;
            }
            photons = map;
        }
        pass::render_tiles(&frame, &pass, photons.as_ref(), films, watch, flight)
    }

    /// Films as those of this render and its companions, without a pass.
    fn empty_films(&self) -> Vec<Outputs> {
        let empty = |render: &Self| render.empty_outputs(&self.crop);
        self.and_companions().map(empty).collect()
    }

    /// Films as its own, without a pass, for light of the samples of these pixels.
    fn empty_outputs(&self, sources: &Crop) -> Outputs {
        let of = (&*self.scene, self.sensor);
        empty_outputs(of, &self.settings, &self.request, &self.crop, sources)
    }

    /// Counts a whole pass, which the films hold.
    fn count(&mut self, flight: Flight) {
        let counts = flight.counts;
        self.counters.add(&counts.counters);
        self.photon_bytes = self.photon_bytes.max(counts.photon_bytes);
        self.passes.push(flight.index);
        let mut tables = counts.tables.into_iter();
        self.table.merge(tables.next().unwrap_or_default());
        self.count_companions(flight.index, tables);
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

    /// Outputs that were kept.
    #[must_use]
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// X, Y and Z of each pixel, row by row: the mean of the passes.
    #[must_use]
    pub fn xyz(&self) -> Vec<f64> {
        self.outputs.image.image(self.passes.len() as u64)
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
        self.choices
            .epsilon
            .as_ref()
            .filter(|_| self.tells_bias())?;
        let [even, odd] = self.pass_counts();
        bias::bias_estimate(&self.outputs.image, even, odd)
    }

    /// Flux through the rendered part of a detector; `None` for cameras.
    #[must_use]
    pub fn flux(&self) -> Option<Flux> {
        let sensor = &self.scene.sensors[self.sensor];
        let pixels = PixelMeasure::of(sensor, &self.crop)?;
        Some(Flux::new(&self.outputs, &pixels, self.pass_counts()))
    }

    /// Estimated error of the image. `None` before both halves of the passes have one, or 32 Markov
    /// chains where these draw samples, and while the image is black.
    #[must_use]
    pub fn error(&self) -> Option<ErrorEstimate> {
        let [even, odd] = self.pass_counts();
        let error = error::error_estimate(&self.outputs.image, even, odd)?;
        let Some(chains) = self.chains() else {
            return Some(error);
        };
        // halves share no chain, so that the spread between chains is in their difference; but no
        // more than these are independent
        (chains >= metropolis::LEAST_CHAINS_FOR_ERROR).then(|| ErrorEstimate {
            effective_pixels: error.effective_pixels.min(chains as f64),
            ..error
        })
    }
}

/// Films of a part of a sensor's film, without a pass, for light of the samples of the pixels of
/// `sources`.
fn empty_outputs(
    (scene, sensor): (&Scene, usize),
    settings: &Settings,
    request: &OutputRequest,
    crop: &Crop,
    sources: &Crop,
) -> Outputs {
    let (sensor, exponent) = (&scene.sensors[sensor], scene.film_exponent);
    let sources = flux::sources(sensor, settings.integrator, crop, sources);
    Outputs::new(request, *crop, sensor.filter, exponent, sources.as_ref())
}

/// The common part of all samples of a render.
fn frame<'a>(
    scene: &'a Scene,
    sensor: usize,
    settings: &'a Settings,
    crop: &Crop,
    request: &OutputRequest,
) -> SensorJob<'a> {
    let mut frame = SensorJob::new(scene, sensor, settings, crop, request.class_table);
    frame.detailed |= request.strategies || !request.classes.is_empty();
    frame
}
