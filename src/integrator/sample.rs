//! One sample of one pixel: a light sub-path, a camera sub-path, and the strategies the integrator executes.
//!
//! `path`, `light` and `bdpt` differ only in which strategies they execute ([`Techniques::samples`]) and so in which sub-paths they
//! need; the walk, the connections and the weights are the same code.

use crate::bsdf::Side;
use crate::film::{Crop, SensorResponse};
use crate::geometry::{EndPoint, Ray};
use crate::medium::MediumLanes;
use crate::sampler::{Sampler, Stream};
use crate::scene::regularization::{Decision, Mode, decide};
use crate::scene::settings::IntegratorKind;
use crate::scene::{Scene, Settings};
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use crate::transport::connect::{Joiner, light_end_factor};
use crate::transport::subpath::Vertex;
use crate::transport::walk::{Start, walk};
use crate::transport::{
    Contribution, Counters, PassSettings, PathContext, Subpath, Techniques, Throughput,
    VertexDensity,
};
use glam::{DVec2, DVec3};

/// What all samples of a sensor share.
#[derive(Clone, Debug)]
pub struct Frame<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The sensor, by index.
    pub sensor: usize,
    /// Render settings.
    pub settings: &'a Settings,
    /// Executed strategies.
    pub techniques: Techniques<'a>,
    /// Whether passes come with a cone.
    pub regularization: Decision,
    /// Also compute raw values (for tables of strategies).
    pub with_raw: bool,
}

impl<'a> Frame<'a> {
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
        let mut techniques =
            Techniques::new(settings, crop.pixels() as f64 / film, camera.is_hittable());
        let decision = decide(scene, sensor, settings);
        if let Some(Mode::Single(rule)) = decision.mode {
            techniques.single = Some(rule);
        }
        techniques.bias_weight = settings.regularization.bias_weight;
        Self {
            scene,
            sensor,
            settings,
            techniques,
            regularization: decision,
            with_raw,
        }
    }
}

/// Buffers that one thread reuses from sample to sample.
#[derive(Debug, Default)]
pub struct Workspace {
    media: Vec<MediumLanes>,
    light: Subpath,
    camera: Subpath,
    arrival: Vec<VertexDensity>,
    /// What the last sample gave.
    pub contributions: Vec<Contribution>,
    /// Counts of this thread.
    pub counters: Counters,
}

impl Workspace {
    /// The last sample's camera sub-path.
    #[must_use]
    pub fn camera_subpath(&self) -> &Subpath {
        &self.camera
    }
}

/// Computes one sample of pixel (x, y) into the workspace. Returns its wavelengths' context-free part: the contributions are in
/// `workspace.contributions`, to be turned into film values by `response` at the returned wavelengths.
pub fn sample_pixel(
    frame: &Frame,
    pass: &PassSettings,
    (x, y): (u32, u32),
    response: &SensorResponse,
    workspace: &mut Workspace,
) -> crate::spectrum::SampledWavelengths {
    let scene = frame.scene;
    let settings = frame.settings;
    let sensor = &scene.sensors[frame.sensor];
    let resolution = sensor.camera.resolution();
    let (width, height) = (resolution.width, resolution.height);
    let pixel = u64::from(y) * u64::from(width) + u64::from(x);
    let sampler = Sampler::new(settings.seed, frame.sensor as u32, pixel, pass.index);
    let mut base = sampler.stream(Stream::Base);
    let [u_film_x, u_film_y, u_lens_x, u_lens_y] = base.next4();

    let lanes = if scene.wavelengths.is_single() {
        1
    } else {
        settings.lanes
    };
    let u_wavelength = pass.shared.map_or_else(
        || sampler.wavelength((x, y), (width, height), settings.seed),
        |shared| shared.u_wavelength,
    );
    let wavelengths = scene.wavelengths.sample(u_wavelength, lanes);
    let time = if scene.is_moving && !sensor.shutter.is_instant() {
        let u = pass
            .shared
            .map_or_else(|| sampler.time(), |shared| shared.time);
        sensor.shutter.at(u)
    } else {
        sensor.shutter.open_s
    };
    let Workspace {
        media,
        light,
        camera,
        arrival,
        contributions,
        counters,
    } = workspace;
    contributions.clear();
    counters.paths += 1;
    media.clear();
    media.extend(scene.media.iter().map(|m| m.sample(&wavelengths)));
    let mut weights = [0.0; MAX_LANES];
    for (j, weight) in weights.iter_mut().enumerate().take(lanes) {
        *weight = response.brightness(&wavelengths, j);
    }
    let context = PathContext {
        scene,
        sensor: frame.sensor,
        pass,
        wavelengths,
        media,
        time,
        response: weights,
    };
    let max_depth = settings.max_depth.map_or(usize::MAX - 8, |d| d as usize);

    let offset = sensor.filter.sample(DVec2::new(u_film_x, u_film_y));
    let raster = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) + offset;
    let start = sensor
        .camera
        .sample_ray(raster, DVec2::new(u_lens_x, u_lens_y), context.time);
    camera.restart(start.xk, sensor.stack.region(), None, start.pdf_xk);
    if settings.integrator != IntegratorKind::Light {
        let eta2 = context.eta_squared(sensor.stack.medium());
        let hittable = frame.techniques.hittable_sensor;
        let xk = start.xk;
        walk(
            &context,
            camera,
            Start {
                ray: Ray::leaving(xk.p, start.direction, context.time, xk.surface),
                stack: sensor.stack.clone(),
                throughput: Throughput::splat(start.weight).times(&eta2),
                pdf: start.pdf_direction,
                infinite: false,
                generate: Side::Light,
                max_vertices: max_depth + 1,
            },
            &mut sampler.stream(Stream::Camera),
            counters,
            |first: &Vertex| {
                if hittable {
                    xk.cos(first.toward_previous) / (first.distance * first.distance)
                } else {
                    0.0
                }
            },
        );
    }
    if settings.integrator == IntegratorKind::Path
        || !start_light(&context, light, max_depth, &sampler, counters)
    {
        light.restart(
            EndPoint {
                p: DVec3::ZERO,
                n: DVec3::ZERO,
                surface: None,
                infinite: false,
            },
            sensor.stack.region(),
            None,
            0.0,
        );
    }

    let margin = sensor.filter.margin();
    let techniques = Techniques {
        cone: pass.cone,
        ..frame.techniques
    };
    let mut joiner = Joiner {
        context: &context,
        techniques: &techniques,
        max_depth,
        hide_points: !settings.show_point_lights && sensor.camera.is_delta(),
        with_raw: frame.with_raw,
        numbers: sampler.stream(Stream::Connect),
        counters,
        out: contributions,
        arrival,
    };
    joiner.direct_to_detector(camera, start.weight);
    for j in 0..camera.vertices.len() {
        joiner.hit_light(camera, j);
        joiner.direct(camera, j);
    }
    joiner.hit_environment(camera);
    joiner.start_to_sensor(light, margin);
    for i in 0..light.vertices.len() {
        joiner.to_sensor(light, i, margin);
    }
    for hit in &light.sensor_hits {
        joiner.hit_sensor(light, hit);
    }
    if settings.integrator == IntegratorKind::Bdpt {
        joiner.pairs(light, camera);
    }
    wavelengths
}

/// Traces a light sub-path. `false` where no light was started.
fn start_light(
    context: &PathContext,
    path: &mut Subpath,
    max_depth: usize,
    sampler: &Sampler,
    counters: &mut Counters,
) -> bool {
    let scene = context.scene;
    let mut numbers = sampler.stream(Stream::Light);
    let [u_light, u_x, u_y, _] = numbers.next4();
    let [d_x, d_y, _, _] = numbers.next4();
    let Some((id, probability, u_face)) = scene.selection.sample(u_light) else {
        return false;
    };
    let light = &scene.lights[id.0 as usize];
    let Some(emission) = light.sample_emission(
        &context.light_context(),
        &context.wavelengths,
        u_face,
        DVec2::new(u_x, u_y),
        DVec2::new(d_x, d_y),
    ) else {
        return false;
    };
    let stack = &scene.light_stacks[id.0 as usize];
    path.restart(
        emission.x0,
        stack.region(),
        Some(id),
        probability * emission.pdf_x0,
    );
    let x0 = emission.x0;
    let weight: SampledSpectrum = emission.weight;
    walk(
        context,
        path,
        Start {
            ray: Ray::leaving(
                emission.origin,
                emission.direction,
                context.time,
                x0.surface,
            ),
            stack: stack.clone(),
            throughput: Throughput::splat(1.0 / probability).times(&weight),
            pdf: emission.pdf_direction,
            infinite: x0.infinite,
            generate: Side::Camera,
            max_vertices: max_depth,
        },
        &mut numbers,
        counters,
        |first: &Vertex| light_end_factor(light, &x0, first.toward_previous, first.distance),
    );
    true
}

#[cfg(test)]
mod definition;
