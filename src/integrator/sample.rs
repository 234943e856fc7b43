//! One sample of one pixel: a light sub-path, a camera sub-path, and the strategies the integrator
//! executes.
//!
//! Integrators differ only in which strategies they execute ([`StrategySet::samples`]) and so in
//! which sub-paths they need; the walk, the connections and the weights are the same code.

use super::{Companion, aims, fans, strategies};
use crate::bsdf::Side;
use crate::film::Crop;
use crate::geometry::{EndPoint, Placements, Ray};
use crate::sampler::{Draw, Pixels, Primary, Sampler};
use crate::scene::regularization::{Decision, Mode, decide};
use crate::scene::settings::Sharing;
use crate::scene::{Scene, Settings};
use crate::spectrum::{LaneResponse, SampledSpectrum, SensorResponse};
use crate::transport::aim::fan::FilmPoint;
use crate::transport::aim::tries::Origin;
use crate::transport::connect::{AimTally, Joiner, Photons, Receiver, Scratch};
use crate::transport::context::{Held, SharedSample};
use crate::transport::strategies::Merge;
use crate::transport::subpath::{Event, Vertex};
use crate::transport::walk::{Start, walk};
use crate::transport::{
    Contribution, Counters, MediaMemory, PassSettings, PathContext, PhotonMap, StrategySet,
    Subpath, Throughput,
};
use glam::DVec2;
use std::borrow::Cow;
use std::mem;

/// Light sub-paths that a sample traces. Whatever it is, the strategies that take them count in the
/// weights as often as the strategies say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightWalks {
    /// As many as the strategies say.
    AsOften,
    /// None, as if none had left its light (pilots).
    Never,
    /// One (pilots).
    Once,
}

/// Job of rendering a sensor: what all its samples share.
#[derive(Clone, Debug)]
pub struct SensorJob<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The sensor, by index.
    pub sensor: usize,
    /// Render settings.
    pub settings: &'a Settings,
    /// Executed strategies.
    pub strategies: StrategySet<'a>,
    /// Whether passes come with a cone.
    pub regularization: Decision,
    /// Also compute raw values (for tables of strategies).
    pub with_raw: bool,
    /// Note every merged photon on its own (for what is kept by path class).
    pub detailed: bool,
    /// Light sub-paths that are traced.
    pub light_walks: LightWalks,
    /// The part of the film that is rendered.
    crop: Crop,
    /// Detectors that the light sub-paths of this job fill as well.
    companions: Vec<Companion<'a>>,
    /// Their sensors, by index.
    companion_sensors: Vec<usize>,
    /// Light sub-paths of a pass, by the wavelength of its set that is their hero.
    paths_by_hero: Vec<u64>,
}

impl<'a> SensorJob<'a> {
    /// For a sensor of the scene, over part of its film.
    #[must_use]
    pub fn new(
        scene: &'a Scene,
        sensor: usize,
        settings: &'a Settings,
        crop: &Crop,
        with_raw: bool,
    ) -> Self {
        let camera = &scene.sensors[sensor].camera;
        let resolution = camera.resolution();
        let film = f64::from(resolution.width) * f64::from(resolution.height);
        let splat_samples = crop.pixels() as f64 / film;
        let mut strategies = strategies(settings, splat_samples, camera.is_hittable());
        // the point of a camera sub-path joined to a light does not land on its own pixel
        strategies.direct_to_detector &= camera.far_field().is_none();
        let decision = decide(scene, sensor, settings);
        if let Some(Mode::Single(rule)) = decision.mode {
            strategies.single = Some(rule);
        }
        strategies.aims = aims(settings, scene, sensor);
        strategies.fans = lanes(scene, settings) > 1 && fans(settings, scene, sensor);
        strategies.bias_weight = settings.regularization.bias_weight;
        let heroes = match settings.merging.sharing {
            Sharing::Set if strategies.merge.is_some() => lanes(scene, settings) as u32,
            _ => 1,
        };
        Self {
            scene,
            sensor,
            settings,
            strategies,
            regularization: decision,
            with_raw,
            detailed: with_raw,
            light_walks: LightWalks::AsOften,
            crop: *crop,
            companions: Vec::new(),
            companion_sensors: Vec::new(),
            paths_by_hero: paths_by_hero(crop, heroes),
        }
    }

    /// Has its light sub-paths fill other detectors as well.
    pub fn set_companions(&mut self, companions: Vec<Companion<'a>>) {
        self.companion_sensors = companions.iter().map(Companion::sensor).collect();
        self.companions = companions;
    }

    /// Number of wavelengths of a shared set that take turns as heroes.
    #[must_use]
    pub fn heroes(&self) -> u32 {
        self.paths_by_hero.len() as u32
    }

    /// The strategies of a pass for the paths of one pixel.
    pub(super) fn strategies_of(
        &self,
        pass: &PassSettings,
        pixel: (u32, u32),
    ) -> Cow<'_, StrategySet<'a>> {
        if pass.cone == self.strategies.cone && self.strategies.merge.is_none() {
            return Cow::Borrowed(&self.strategies);
        }
        let samples = match (pass.merge_radius, &pass.shared) {
            (Some(radius), Some(shared)) => {
                let paths = self.paths_by_hero[shared.hero(pixel) as usize];
                std::f64::consts::PI * radius * radius * paths as f64
            }
            _ => 0.0,
        };
        Cow::Owned(StrategySet {
            cone: pass.cone,
            merge: self.strategies.merge.map(|m| Merge { samples, ..m }),
            ..self.strategies
        })
    }

    pub(super) fn max_depth(&self) -> usize {
        let limit = self.settings.max_depth;
        limit.map_or(usize::MAX - 8, |d| d as usize)
    }

    /// Wavelengths per path.
    #[must_use]
    pub fn lanes(&self) -> usize {
        lanes(self.scene, self.settings)
    }

    /// The numbers of one pixel in a pass.
    pub(super) fn sampler(&self, pass: &PassSettings, (x, y): (u32, u32)) -> Sampler<'static> {
        let width = self.scene.sensors[self.sensor].camera.resolution().width;
        let pixel = u64::from(y) * u64::from(width) + u64::from(x);
        Sampler::new(self.settings.seed, self.sensor as u32, pixel, pass.index)
    }

    /// The primary wavelength number of a pixel's sample.
    fn wavelength_number(&self, sampler: &Sampler, pixel: (u32, u32)) -> f64 {
        let size = self.scene.sensors[self.sensor].camera.resolution();
        sampler.wavelength(pixel, (size.width, size.height), self.settings.seed)
    }

    /// The number of the sequence that a pixel's sample is held to.
    fn sequence_number(&self, sampler: &Sampler, pixel: (u32, u32)) -> f64 {
        if self.settings.integrator.runs_chains() {
            // a chain goes on from the numbers of an ordinary sample
            return sampler.set(Draw::Sequence)[0];
        }
        let size = self.scene.sensors[self.sensor].camera.resolution();
        sampler.choice(pixel, (size.width, size.height), self.settings.seed)
    }

    /// The sample of a pixel in a pass as a point from which a Markov chain over the pixels of
    /// `crop` goes on.
    #[must_use]
    pub fn primary(&self, pass: &PassSettings, pixel: (u32, u32), crop: &Crop) -> Primary {
        let sampler = self.sampler(pass, pixel);
        let pixels = Pixels {
            first: [crop.x0, crop.y0],
            size: [crop.width(), crop.height()],
        };
        Primary::of_sample(
            sampler,
            pixel,
            self.wavelength_number(&sampler, pixel),
            pixels,
        )
    }
}

fn lanes(scene: &Scene, settings: &Settings) -> usize {
    if scene.wavelengths.is_single() {
        1
    } else {
        settings.lanes
    }
}

/// Pixels of the crop by their hero.
fn paths_by_hero(crop: &Crop, heroes: u32) -> Vec<u64> {
    let shared = SharedSample {
        heroes,
        ..SharedSample::default()
    };
    let mut counts = vec![0; heroes as usize];
    if heroes == 1 {
        counts[0] = crop.pixels();
    } else {
        for pixel in (crop.y0..crop.y1).flat_map(|y| (crop.x0..crop.x1).map(move |x| (x, y))) {
            counts[shared.hero(pixel) as usize] += 1;
        }
    }
    counts
}

/// Buffers that one thread reuses from sample to sample.
#[derive(Debug, Default)]
pub struct Workspace {
    placements: Placements,
    media: MediaMemory,
    light: Subpath,
    camera: Subpath,
    scratch: Scratch,
    retraced: Subpath,
    /// Contributions of the last sample.
    pub contributions: Vec<Contribution>,
    /// Those of the companions of the job, in their order.
    pub companions: Vec<Vec<Contribution>>,
    /// Counts of this thread.
    pub counters: Counters,
}

impl Workspace {
    /// Counts from now on what chains cost that are solved for: of each kind from each origin.
    pub fn count_aims(&mut self, kinds: usize) {
        self.scratch.tally.clear();
        let all = Origin::COUNT * kinds;
        self.scratch.tally.resize(all, AimTally::default());
    }

    /// These costs, origin by origin.
    #[must_use]
    pub fn aims(&self) -> &[AimTally] {
        &self.scratch.tally
    }

    /// Vertices of the paths of the last sample, see [`Contribution::events`].
    #[must_use]
    pub fn events(&self) -> &[Event] {
        &self.scratch.events
    }

    /// Contributions and vertices of the last sample, which leaves these buffers to the next one.
    pub fn exchange(
        &mut self,
        (contributions, events): (Vec<Contribution>, Vec<Event>),
    ) -> (Vec<Contribution>, Vec<Event>) {
        let last = mem::replace(&mut self.contributions, contributions);
        (last, mem::replace(&mut self.scratch.events, events))
    }

    /// The last sample's camera sub-path.
    #[must_use]
    pub fn camera_subpath(&self) -> &Subpath {
        &self.camera
    }
}

/// Wavelengths and media of one pixel's paths in a pass.
#[inline(always)]
pub(super) fn begin<'a>(
    job: &'a SensorJob<'a>,
    pass: &'a PassSettings,
    (sampler, pixel): (&Sampler, (u32, u32)),
    response: SensorResponse,
    placements: &'a mut Placements,
    media: &'a mut MediaMemory,
) -> PathContext<'a> {
    let scene = job.scene;
    let lanes = job.lanes();
    let u_wavelength = match &pass.shared {
        None => job.wavelength_number(sampler, pixel),
        Some(shared) => {
            let turn = f64::from(shared.hero(pixel)) / lanes as f64;
            (shared.u_wavelength + turn).fract()
        }
    };
    let wavelengths = scene.wavelengths.sample(u_wavelength, lanes);
    let sensor = &scene.sensors[job.sensor];
    let time = if scene.is_moving && !sensor.shutter.is_instant() {
        let u = pass
            .shared
            .map_or_else(|| sampler.time(), |shared| shared.time);
        sensor.shutter.at(u)
    } else {
        sensor.shutter.open_s
    };
    let media = media.at(scene, &wavelengths);
    let held = scene.sequences.as_ref().map(|sequences| Held {
        sequence: sequences.draw(job.sequence_number(sampler, pixel)),
        weight: sequences.all().len() as f64,
    });
    PathContext {
        scene: scene.at(time, placements),
        sensor: job.sensor,
        companions: &job.companion_sensors,
        pass,
        media,
        response: response.at(&wavelengths),
        wavelengths,
        held,
        asked: job.strategies.asked(),
    }
}

/// Computes one sample of pixel (x, y) into the workspace, without merging. The contributions are
/// in `workspace.contributions`, to be turned into film values by what is returned.
pub fn sample_pixel(
    job: &SensorJob,
    pass: &PassSettings,
    pixel: (u32, u32),
    response: SensorResponse,
    workspace: &mut Workspace,
) -> LaneResponse {
    let unmerged = PassSettings {
        merge_radius: None,
        ..*pass
    };
    sample_and_merge(job, &unmerged, None, pixel, response, workspace)
}

/// The same, and the camera sub-path is merged with the photons of its pass.
pub fn sample_and_merge(
    job: &SensorJob,
    pass: &PassSettings,
    photons: Option<&PhotonMap>,
    pixel: (u32, u32),
    response: SensorResponse,
    workspace: &mut Workspace,
) -> LaneResponse {
    workspace.counters.paths += 1;
    let numbers = (job.sampler(pass, pixel), pixel);
    sample(job, pass, photons, numbers, response, workspace)
}

/// The sample of the point of a Markov chain, or of the one that it tries, without merging. It is
/// not counted as a path of its pixel.
pub fn sample_primary(
    job: &SensorJob,
    pass: &PassSettings,
    point: &Primary,
    response: SensorResponse,
    workspace: &mut Workspace,
) -> LaneResponse {
    let numbers = (point.sampler(), point.pixel());
    sample(job, pass, None, numbers, response, workspace)
}

fn sample(
    job: &SensorJob,
    pass: &PassSettings,
    photons: Option<&PhotonMap>,
    (sampler, (x, y)): (Sampler, (u32, u32)),
    response: SensorResponse,
    workspace: &mut Workspace,
) -> LaneResponse {
    let scene = job.scene;
    let settings = job.settings;
    let sensor = &scene.sensors[job.sensor];
    let Workspace {
        placements,
        media,
        light,
        camera,
        scratch,
        retraced,
        contributions,
        companions,
        counters,
    } = workspace;
    contributions.clear();
    scratch.events.clear();
    companions.resize_with(job.companions.len(), Vec::new);
    companions.iter_mut().for_each(Vec::clear);
    let context = begin(job, pass, (&sampler, (x, y)), response, placements, media);
    let max_depth = job.max_depth();
    let strategies = &*job.strategies_of(pass, (x, y));
    let (raster, exposure) = if strategies.wants_camera_start() {
        start_camera(
            &context,
            job,
            strategies,
            camera,
            (&sampler, (x, y)),
            counters,
        )
    } else {
        // nothing asks where on the film it would be
        camera.restart(EndPoint::NONE, &sensor.stack, None, 0.0);
        (DVec2::ZERO, 0.0)
    };
    let margin = sensor.filter.margin();
    let mut joiner = Joiner {
        context: &context,
        strategies,
        max_depth,
        raster,
        skip_point_images: !settings.show_point_lights && sensor.camera.is_delta(),
        with_raw: job.with_raw,
        detailed: job.detailed,
        fan: camera.fan,
        sampler,
        counters,
        out: contributions,
        scratch,
    };
    // of a detector, W_e is the density of its points
    joiner.direct_to_detector(camera, exposure);
    let mut hits = camera.light_hits.iter().peekable();
    for j in 0..camera.vertices.len() {
        if let Some(hit) = hits.next_if(|hit| hit.vertex == j) {
            joiner.hit_light(camera, hit);
        }
        joiner.direct(camera, j);
        if strategies.aims.light {
            joiner.aim_at_light(camera, j);
        }
    }
    joiner.hit_environment(camera);
    let light_paths = match job.light_walks {
        _ if !strategies.wants_light_walk() => 0,
        LightWalks::Never => 0,
        LightWalks::Once => 1,
        LightWalks::AsOften => light_paths_of(&sampler, strategies.light_paths),
    };
    for path in 0..light_paths {
        // the first takes the numbers of the sample, any others have their own
        joiner.sampler = sampler.fork(path);
        if !start_light(&context, light, max_depth, &joiner.sampler, joiner.counters) {
            continue;
        }
        joiner.start_to_sensor(light, margin);
        joiner.aim_through(light, margin);
        for i in 0..light.vertices.len() {
            joiner.to_sensor(light, i, margin);
            joiner.aim_at_sensor(light, i, margin);
        }
        for hit in light.hits_of(job.sensor) {
            joiner.hit_sensor(light, hit);
        }
        if strategies.pairs > 0.0 {
            joiner.pairs(light, camera);
        }
        for (companion, out) in job.companions.iter().zip(&mut *companions) {
            companion.join(&mut joiner, light, (x, y), out);
        }
    }
    joiner.end_of_camera();
    joiner.sampler = sampler;
    if let (Some(map), Some(shared)) = (photons, &pass.shared) {
        let width = sensor.camera.resolution().width;
        let pixel_of = |path: u32| (path % width, path / width);
        let hero = shared.hero((x, y));
        let is_same_hero = |path| shared.hero(pixel_of(path)) == hero;
        let mut photons = Photons {
            map,
            accepts: (shared.heroes > 1).then_some(&is_same_hero),
            retrace: &|path, subpath, counters| {
                let sampler = job.sampler(pass, pixel_of(path));
                start_light(&context, subpath, max_depth, &sampler, counters);
            },
            retraced,
        };
        for j in 0..camera.vertices.len() {
            joiner.gather(&mut photons, camera, j);
        }
    }
    context.response
}

/// Traces the camera sub-path of a pixel. Where on the film it starts, and the exposure of its
/// point.
fn start_camera(
    context: &PathContext,
    job: &SensorJob,
    strategies: &StrategySet,
    path: &mut Subpath,
    (sampler, (x, y)): (&Sampler, (u32, u32)),
    counters: &mut Counters,
) -> (DVec2, f64) {
    let sensor = &job.scene.sensors[job.sensor];
    let [u_film_x, u_film_y, u_lens_x, u_lens_y] = sampler.set(Draw::Film);
    let offset = sensor.filter.sample(DVec2::new(u_film_x, u_film_y));
    let raster = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) + offset;
    let lens = DVec2::new(u_lens_x, u_lens_y);
    let exposure = walk_from(
        context,
        job,
        strategies,
        path,
        (raster, lens),
        sampler,
        counters,
    );
    (raster, exposure)
}

/// Traces the camera sub-path from a place on the film and one on the lens, by its numbers. The
/// exposure of its point.
fn walk_from(
    context: &PathContext,
    job: &SensorJob,
    strategies: &StrategySet,
    path: &mut Subpath,
    (raster, u_lens): (DVec2, DVec2),
    sampler: &Sampler,
    counters: &mut Counters,
) -> f64 {
    let sensor = &job.scene.sensors[job.sensor];
    let start = sensor.camera.sample_ray(raster, u_lens, context.moment());
    let exposure = context.scene.exposure(&start.xk);
    let weight = start.weight * exposure;
    let density = |raster: DVec2| sensor.filter.coverage(raster, &job.crop);
    let film = FilmPoint {
        raster,
        u_lens,
        margin: sensor.filter.margin(),
        density: &density,
    };
    path.restart(start.xk, &sensor.stack, None, start.pdf_xk);
    if strategies.wants_camera_walk() {
        let eta2 = context.eta_squared(sensor.stack.medium());
        let hittable = job.strategies.hittable_sensor;
        let x_sensor = start.xk;
        walk(
            context,
            path,
            Start {
                ray: Ray::leaving(x_sensor.p, start.direction, x_sensor.surface),
                stack: sensor.stack,
                throughput: Throughput::splat(weight).times(&eta2),
                pdf: start.pdf_direction,
                infinite: false,
                generate: Side::Light,
                max_vertices: job.max_depth() + 1,
                specular_only: strategies.ends_at_first_rough(),
                film: strategies.fans.then_some(film),
            },
            sampler,
            counters,
            |first: &Vertex| {
                Receiver::of_sensor(hittable, &x_sensor, first.toward_previous)
                    .factor(first.distance)
            },
        );
    }
    exposure
}

/// Number of light sub-paths of a sample, `expected` in the mean.
fn light_paths_of(sampler: &Sampler, expected: f64) -> u32 {
    let (sure, chance) = (expected.floor(), expected.fract());
    let [.., u] = if chance > 0.0 {
        sampler.set(Draw::LightStart)
    } else {
        [1.0; 4]
    };
    sure as u32 + u32::from(u < chance)
}

/// Traces a light sub-path. `false` where no light was started.
pub(super) fn start_light(
    context: &PathContext,
    path: &mut Subpath,
    max_depth: usize,
    sampler: &Sampler,
    counters: &mut Counters,
) -> bool {
    let scene = context.scene;
    let [u_light, u_x, u_y, _] = sampler.set(Draw::LightStart);
    let [d_x, d_y, _, _] = sampler.set(Draw::LightDirection);
    let Some((id, probability, u_face)) = scene.selection.sample(u_light) else {
        return false;
    };
    let light = scene.light(id);
    let Some(emission) = light.sample_emission(
        &scene.geometry,
        &scene.casters,
        &context.wavelengths,
        u_face,
        DVec2::new(u_x, u_y),
        DVec2::new(d_x, d_y),
    ) else {
        return false;
    };
    let stack = scene.light_stack(id);
    path.restart(emission.x0, stack, Some(id), probability * emission.pdf_x0);
    let x0 = emission.x0;
    let exposure = scene.exposure(&x0);
    if exposure == 0.0 {
        return false;
    }
    let weight: SampledSpectrum = emission.weight;
    if weight.is_black(context.count()) {
        // x₀ is joined all the same
        return true;
    }
    walk(
        context,
        path,
        Start {
            ray: Ray::leaving(emission.origin, emission.direction, x0.surface),
            stack: *stack,
            throughput: Throughput::splat(exposure / probability).times(&weight),
            pdf: emission.pdf_direction,
            infinite: x0.infinite,
            generate: Side::Camera,
            max_vertices: max_depth,
            specular_only: false,
            film: None,
        },
        sampler,
        counters,
        |first: &Vertex| {
            Receiver::of_light(light, &x0, first.toward_previous).factor(first.distance)
        },
    );
    if let Some(first) = path.vertices.first() {
        path.direct = context.direct_density(id, first.p, &x0);
    }
    true
}

#[cfg(test)]
mod definition;
#[cfg(test)]
mod fans;
#[cfg(test)]
mod two_terms;
