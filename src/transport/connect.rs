//! Joining sub-paths: every strategy's contribution and weight, computed together.
//!
//! The order of work is from cheap to dear: kernels, weight, roulette on the weighted value, and only then the shadow ray.

use super::class::PathClass;
use super::context::{Counters, PathContext};
use super::contribution::{Contribution, Target};
use super::density::{Edge, EdgeDensity, PathView, VertexDensity};
use super::mis::{denominator, multiplier};
use super::subpath::{SensorHit, Subpath};
use super::techniques::Techniques;
use super::throughput::Throughput;
use crate::bsdf::{BsdfEval, LaneDensity};
use crate::geometry::{EndPoint, Ray, SurfacePoint};
use crate::light::{HitMeasure, Light, LightId};
use crate::medium::{MediumId, Region};
use crate::sampler::StreamSampler;
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use glam::{DVec2, DVec3};

/// Joins the two sub-paths of one sample and collects what they give.
#[derive(Debug)]
pub struct Joiner<'a> {
    /// What the path pair shares.
    pub context: &'a PathContext<'a>,
    /// Which strategies are executed.
    pub techniques: &'a Techniques,
    /// At most this many scattering vertices on a path.
    pub max_depth: usize,
    /// Also compute the raw (unweighted) value of each contribution.
    pub with_raw: bool,
    /// Numbers for connections.
    pub numbers: StreamSampler,
    /// Counts.
    pub counters: &'a mut Counters,
    /// Contributions found.
    pub out: &'a mut Vec<Contribution>,
    /// Scratch: densities of a light sub-path with its arrival at the detector.
    pub arrival: &'a mut Vec<VertexDensity>,
}

/// The two directional densities of an evaluated vertex.
fn densities(eval: &BsdfEval) -> (EdgeDensity, EdgeDensity) {
    let lanes = |l: &LaneDensity| l.lanes;
    (
        EdgeDensity { hero: eval.pdf_camera, lanes: eval.columns.as_ref().map(|c| lanes(&c.0)) },
        EdgeDensity { hero: eval.pdf_light, lanes: eval.columns.as_ref().map(|c| lanes(&c.1)) },
    )
}

/// A surface point as an end point.
#[must_use]
pub fn end_point(point: &SurfacePoint) -> EndPoint {
    EndPoint { p: point.p, n: point.ng, surface: Some(point.id), infinite: false }
}

/// What turns a density of direction at x₁ (towards the light, at `distance`) into a density of x₀.
#[must_use]
pub fn light_end_factor(light: &Light, x0: &EndPoint, toward: DVec3, distance: f64) -> f64 {
    match light.hit_measure() {
        HitMeasure::Area => x0.cos(toward) / (distance * distance),
        HitMeasure::SolidAngle => 1.0,
        HitMeasure::Never => 0.0,
    }
}

/// A numerator, still without its weight: what all lanes share and each lane's factor.
struct Numerator {
    scale: f64,
    lanes: SampledSpectrum,
}

/// Who made a path, and what it needs to be counted.
struct Strategy<'p> {
    view: PathView<'p>,
    target: Target,
    class: PathClass,
}

impl<'a> Joiner<'a> {
    /// Whether strategy (s, t) is executed and allowed by the depth limit.
    fn wants(&self, s: usize, t: usize) -> bool {
        s + t <= self.max_depth.saturating_add(2) && self.techniques.samples(s, t) > 0.0
    }

    fn light(&self, id: LightId) -> &'a Light {
        &self.context.scene.lights[id.0 as usize]
    }

    /// η² T_L T_C ... : a numerator from two throughputs and the kernels between them.
    fn numerator(parts: &[&SampledSpectrum], scale: f64) -> Numerator {
        let mut lanes = SampledSpectrum::ONE;
        for part in parts {
            lanes *= **part;
        }
        Numerator { scale, lanes }
    }

    /// Weighs, plays roulette, looks, and notes the contribution.
    fn finish(&mut self, numerator: &Numerator, strategy: &Strategy, segment: Option<(&Ray, &Region)>) {
        let count = self.context.count();
        let weights = denominator(&strategy.view, self.techniques, &self.context.wavelengths);
        let mut lanes = [0.0; MAX_LANES];
        for (j, lane) in lanes.iter_mut().enumerate().take(count) {
            let value = numerator.scale * f64::from(numerator.lanes[j]);
            if value != 0.0 {
                *lane = value * weights.factor(j);
            }
        }
        if !lanes.iter().all(|v| v.is_finite()) {
            self.counters.non_finite += 1;
            return;
        }
        let mut survival = 1.0;
        if let Some((ray, region)) = segment {
            let threshold = self.context.pass.roulette_threshold;
            if threshold > 0.0 {
                let brightness = self.context.brightness(&lanes);
                if brightness < threshold {
                    survival = brightness / threshold;
                    if self.numbers.next4()[0] >= survival {
                        return;
                    }
                }
            }
            if !self.context.is_visible(ray, region, self.counters) {
                return;
            }
        }
        self.counters.connections_made += 1;
        let s = strategy.view.s();
        let t = strategy.view.camera.len();
        let mut raw = [0.0; MAX_LANES];
        if self.with_raw {
            let alone = multiplier(&strategy.view, self.techniques, s);
            let dispersed = (0..strategy.view.len()).any(|i| strategy.view.is_dispersive(i));
            for (j, value) in raw.iter_mut().enumerate().take(count) {
                let techniques = if dispersed { self.context.wavelengths.multiplicity(j) } else { count };
                let lane = numerator.scale * f64::from(numerator.lanes[j]);
                *value = lane / (alone * techniques as f64 * survival);
            }
        }
        for lane in &mut lanes {
            *lane /= survival;
        }
        self.out.push(Contribution {
            target: strategy.target,
            lanes,
            raw,
            s: s as u32,
            t: t as u32,
            class: strategy.class,
        });
    }

    /// Density `pf` of the vertex before camera vertex `j` (x_k for j = 0), from the density of direction at `j`.
    fn camera_before(&self, camera: &Subpath, j: usize, forward: &EdgeDensity) -> EdgeDensity {
        let vertex = &camera.vertices[j];
        let factor = match j.checked_sub(1) {
            Some(previous) => {
                vertex.toward_previous.dot(camera.vertices[previous].point.ng).abs()
                    / (vertex.distance * vertex.distance)
            }
            None => self.sensor_end_factor(&camera.origin, vertex.toward_previous, vertex.distance),
        };
        forward.scaled(factor)
    }

    /// Density `pr` of the vertex before light vertex `i` (x₀ for i = 0), from the density of direction at `i`.
    fn light_before(&self, light: &Subpath, i: usize, reverse: &EdgeDensity) -> EdgeDensity {
        let vertex = &light.vertices[i];
        let factor = match i.checked_sub(1) {
            Some(previous) => {
                vertex.toward_previous.dot(light.vertices[previous].point.ng).abs()
                    / (vertex.distance * vertex.distance)
            }
            None => match light.light {
                Some(id) => {
                    light_end_factor(self.light(id), &light.origin, vertex.toward_previous, vertex.distance)
                }
                None => 0.0,
            },
        };
        reverse.scaled(factor)
    }

    /// What turns a density of direction towards the sensor into a density of x_k: 0 where it cannot be hit.
    #[must_use]
    pub fn sensor_end_factor(&self, xk: &EndPoint, toward: DVec3, distance: f64) -> f64 {
        if self.techniques.hittable_sensor { xk.cos(toward) / (distance * distance) } else { 0.0 }
    }

    /// Density of x₀ by direct sampling from `x1`, selection included.
    #[must_use]
    pub fn direct_density(&self, id: LightId, x1: DVec3, x0: &EndPoint) -> f64 {
        let scene = self.context.scene;
        scene.selection.probability(id)
            * self.light(id).direct_density(&self.context.light_context(), x1, x0)
    }

    /// Emission densities of x₀ and of the next vertex, whose cosine to the segment is `cos`: (`pf_0`, `pf_1`).
    fn emission(&self, id: LightId, x0: &EndPoint, direction: DVec3, cos: f64, distance: f64) -> (f64, f64) {
        let (pdf_x0, pdf_direction) =
            self.light(id).emission_density(&self.context.light_context(), x0, direction);
        let next = pdf_direction.area_density(cos, distance * distance);
        (self.context.scene.selection.probability(id) * pdf_x0, next)
    }

    fn class_of(light: Option<(&Subpath, usize)>, camera: Option<(&Subpath, usize)>, edge: &Edge) -> PathClass {
        // `n` scattering vertices of each sub-path take part; the last of each carries the edge's label
        let mut class = PathClass::new();
        if let Some((path, n)) = light {
            for i in 0..n {
                let label = if i + 1 == n { edge.light_label } else { path.densities[i + 1].label };
                class.push(label.is_specular());
            }
        }
        if let Some((path, n)) = camera {
            for i in (0..n).rev() {
                let label = if i + 1 == n { edge.camera_label } else { path.densities[i + 1].label };
                class.push(label.is_specular());
            }
        }
        class
    }

    /// s = 0: camera vertex `j` is on a light.
    pub fn hit_light(&mut self, camera: &Subpath, j: usize) {
        let vertex = &camera.vertices[j];
        let Some(id) = vertex.light else { return };
        let t = j + 2;
        if !self.wants(0, t) {
            return;
        }
        let radiance =
            self.light(id).radiance(&vertex.point, vertex.toward_previous, &self.context.wavelengths);
        if radiance.is_black(self.context.count()) {
            return;
        }
        let medium = vertex.region(vertex.toward_previous).medium;
        self.arrive_at_light(
            camera,
            (t, id, end_point(&vertex.point), medium),
            vertex.toward_previous,
            vertex.distance,
            &radiance,
            vertex.throughput,
        );
    }

    /// s = 0: the camera sub-path left the scene towards an environment.
    pub fn hit_environment(&mut self, camera: &Subpath) {
        let Some(escape) = camera.escape else { return };
        let t = camera.vertices.len() + 2;
        if !self.wants(0, t) {
            return;
        }
        for &id in &self.context.scene.environments {
            let radiance = self.light(id).escaped_radiance(escape.direction, &self.context.wavelengths);
            if radiance.is_black(self.context.count()) {
                continue;
            }
            let x0 = EndPoint { p: DVec3::ZERO, n: -escape.direction, surface: None, infinite: true };
            self.arrive_at_light(
                camera,
                (t, id, x0, escape.medium),
                -escape.direction,
                f64::INFINITY,
                &radiance,
                escape.throughput,
            );
        }
    }

    /// The common part of s = 0. `leaving` is the direction in which the light leaves x₀.
    fn arrive_at_light(
        &mut self,
        camera: &Subpath,
        (t, id, x0, medium): (usize, LightId, EndPoint, MediumId),
        leaving: DVec3,
        distance: f64,
        radiance: &SampledSpectrum,
        throughput: Throughput,
    ) {
        self.counters.connections_tried += 1;
        // x₁: the camera vertex before, or x_k
        let (x1, cos, factor) = match t.checked_sub(3) {
            Some(before) => {
                let point = &camera.vertices[before].point;
                (point.p, leaving.dot(point.ng).abs(), 1.0)
            }
            None => {
                let hittable = f64::from(u8::from(self.techniques.hittable_sensor));
                (camera.origin.p, camera.origin.cos(leaving), hittable)
            }
        };
        let (pf0, pf1) = self.emission(id, &x0, leaving, cos, distance);
        let direct = if t == 2 && !self.techniques.hittable_sensor {
            // strategy (1, 1) of an image camera splats starts on area lights only
            if self.light(id).hit_measure() == HitMeasure::Area { pf0 } else { 0.0 }
        } else {
            self.direct_density(id, x1, &x0)
        };
        let edge = Edge {
            camera_end: EdgeDensity::uniform(pf0),
            camera_before: EdgeDensity::uniform(pf1 * factor),
            ..Edge::default()
        };
        let mut class = PathClass::new();
        for density in camera.densities[1..t - 1].iter().rev() {
            class.push(density.label.is_specular());
        }
        let strategy = Strategy {
            view: PathView {
                light: &[],
                camera: &camera.densities[..t],
                light_columns: &[],
                camera_columns: &camera.columns,
                edge,
                direct,
            },
            target: Target::OwnPixel,
            class,
        };
        let inverse_eta2 = SampledSpectrum::ONE / self.context.eta_squared(medium);
        let numerator = Self::numerator(&[&throughput.lanes, radiance, &inverse_eta2], throughput.scale);
        self.finish(&numerator, &strategy, None);
    }

    /// s = 1: camera vertex `j` is connected to a light.
    pub fn direct(&mut self, camera: &Subpath, j: usize) {
        let vertex = &camera.vertices[j];
        if !self.wants(1, j + 2) || !vertex.bsdf.has_non_specular() {
            return;
        }
        let u = self.numbers.next4();
        let scene = self.context.scene;
        let Some((id, probability, u0)) = scene.selection.sample(u[0]) else { return };
        let light_context = self.context.light_context();
        let Some(direct) = self.light(id).sample_direct(
            &light_context,
            &self.context.wavelengths,
            vertex.point.p,
            u0,
            DVec2::new(u[1], u[2]),
        ) else {
            return;
        };
        if !vertex.sides_agree(direct.toward) || !vertex.sides_agree(vertex.toward_previous) {
            return;
        }
        let region = vertex.region(direct.toward);
        if region.medium != scene.light_stacks[id.0 as usize].medium() {
            return;
        }
        self.counters.connections_tried += 1;
        let eval = vertex.bsdf.eval(
            vertex.frame.to_local(direct.toward),
            vertex.frame.to_local(vertex.toward_previous),
        );
        if eval.g.is_black(self.context.count()) || direct.value.is_black(self.context.count()) {
            return;
        }
        let (forward, backward) = densities(&eval);
        let cos = direct.toward.dot(vertex.point.ng).abs();
        let (pf0, pf1) = self.emission(id, &direct.x0, -direct.toward, cos, direct.distance);
        let factor = light_end_factor(self.light(id), &direct.x0, direct.toward, direct.distance);
        let edge = Edge {
            light_end: backward.scaled(factor),
            camera_end: EdgeDensity::uniform(pf1),
            camera_before: self.camera_before(camera, j, &forward),
            ..Edge::default()
        };
        let start = [VertexDensity::new(pf0)];
        let strategy = Strategy {
            view: PathView {
                light: &start,
                camera: &camera.densities[..j + 2],
                light_columns: &[],
                camera_columns: &camera.columns,
                edge,
                direct: probability * direct.pdf,
            },
            target: Target::OwnPixel,
            class: Self::class_of(None, Some((camera, j + 1)), &edge),
        };
        let transmittance = if direct.distance.is_finite() {
            self.context.medium(region.medium).transmittance(direct.distance)
        } else {
            SampledSpectrum::ONE
        };
        let numerator = Self::numerator(
            &[&vertex.throughput.lanes, &eval.g, &direct.value, &transmittance],
            vertex.throughput.scale * direct.toward.dot(vertex.point.ns).abs() / probability,
        );
        let ray = Ray {
            t_max: direct.distance,
            end: direct.x0.surface,
            ..Ray::leaving(vertex.point.p, direct.toward, self.context.time, Some(vertex.point.id))
        };
        self.finish(&numerator, &strategy, Some((&ray, region)));
    }

    /// (1, 1) on a detector: its point is connected straight to a light. `weight` is the camera sample's, `own` the density of x_k.
    pub fn direct_to_detector(&mut self, camera: &Subpath, weight: f64) {
        if !self.wants(1, 1) || !self.techniques.hittable_sensor {
            return;
        }
        let u = self.numbers.next4();
        let scene = self.context.scene;
        let Some((id, probability, u0)) = scene.selection.sample(u[0]) else { return };
        let xk = camera.origin;
        let Some(direct) = self.light(id).sample_direct(
            &self.context.light_context(),
            &self.context.wavelengths,
            xk.p,
            u0,
            DVec2::new(u[1], u[2]),
        ) else {
            return;
        };
        let cos = direct.toward.dot(xk.n);
        if cos <= 0.0 {
            return;
        }
        if camera.region.medium != scene.light_stacks[id.0 as usize].medium() {
            return;
        }
        self.counters.connections_tried += 1;
        let (pf0, pfk) = self.emission(id, &direct.x0, -direct.toward, cos, direct.distance);
        let (_, direction_density) =
            scene.sensors[self.context.sensor].camera.density(&xk, direct.toward, self.context.time);
        let factor = light_end_factor(self.light(id), &direct.x0, direct.toward, direct.distance);
        let edge = Edge {
            light_end: EdgeDensity::uniform(direction_density.area_density(1.0, 1.0) * factor),
            camera_end: EdgeDensity::uniform(pfk),
            ..Edge::default()
        };
        let start = [VertexDensity::new(pf0)];
        let strategy = Strategy {
            view: PathView {
                light: &start,
                camera: &camera.densities[..1],
                light_columns: &[],
                camera_columns: &camera.columns,
                edge,
                direct: probability * direct.pdf,
            },
            target: Target::OwnPixel,
            class: PathClass::new(),
        };
        let transmittance = if direct.distance.is_finite() {
            self.context.medium(camera.region.medium).transmittance(direct.distance)
        } else {
            SampledSpectrum::ONE
        };
        // the sample's weight is W_e π / pdf: without the π of its direction it is W_e / pdf
        let scale = weight / std::f64::consts::PI * cos / probability;
        let numerator = Self::numerator(&[&direct.value, &transmittance], scale);
        let ray = Ray {
            t_max: direct.distance,
            end: direct.x0.surface,
            ..Ray::leaving(xk.p, direct.toward, self.context.time, xk.surface)
        };
        self.finish(&numerator, &strategy, Some((&ray, &camera.region)));
    }

    /// t = 1: light vertex `i` is connected to the sensor.
    pub fn to_sensor(&mut self, light: &Subpath, i: usize, margin: f64) {
        let vertex = &light.vertices[i];
        if !self.wants(i + 2, 1) || !vertex.bsdf.has_non_specular() {
            return;
        }
        let u = self.numbers.next4();
        let scene = self.context.scene;
        let sensor = &scene.sensors[self.context.sensor];
        let Some(connection) =
            sensor.camera.sample_connection(vertex.point.p, DVec2::new(u[0], u[1]), self.context.time, margin)
        else {
            return;
        };
        let toward = connection.toward;
        if !vertex.sides_agree(toward) || !vertex.sides_agree(vertex.toward_previous) {
            return;
        }
        let region = vertex.region(toward);
        if region.medium != sensor.stack.medium() {
            return;
        }
        self.counters.connections_tried += 1;
        let eval =
            vertex.bsdf.eval(vertex.frame.to_local(vertex.toward_previous), vertex.frame.to_local(toward));
        if eval.g.is_black(self.context.count()) {
            return;
        }
        let (forward, backward) = densities(&eval);
        let cos = toward.dot(vertex.point.ng).abs();
        let d2 = connection.distance * connection.distance;
        let (_, direction_density) = sensor.camera.density(&connection.xk, -toward, self.context.time);
        let edge = Edge {
            light_end: EdgeDensity::uniform(direction_density.area_density(cos, d2)),
            light_before: self.light_before(light, i, &backward),
            camera_end: forward.scaled(self.sensor_end_factor(&connection.xk, toward, connection.distance)),
            ..Edge::default()
        };
        let end = [VertexDensity::new(connection.pdf_xk)];
        let strategy = Strategy {
            view: PathView {
                light: &light.densities[..i + 2],
                camera: &end,
                light_columns: &light.columns,
                camera_columns: &[],
                edge,
                direct: self.direct_of(light),
            },
            target: Target::Splat(connection.raster),
            class: Self::class_of(Some((light, i + 1)), None, &edge),
        };
        let medium = self.context.medium(region.medium);
        let numerator = Self::numerator(
            &[
                &vertex.throughput.lanes,
                &eval.g,
                &self.context.eta_squared(region.medium),
                &medium.transmittance(connection.distance),
            ],
            vertex.throughput.scale
                * connection.importance
                * cos
                * vertex.light_side_correction(vertex.toward_previous),
        );
        let ray = Ray {
            t_max: connection.distance,
            end: connection.xk.surface,
            ..Ray::leaving(vertex.point.p, toward, self.context.time, Some(vertex.point.id))
        };
        self.finish(&numerator, &strategy, Some((&ray, region)));
    }

    /// (1, 1) of image cameras: the start of the light sub-path, on an area light, is seen directly.
    pub fn start_to_sensor(&mut self, light: &Subpath, margin: f64) {
        let Some(id) = light.light else { return };
        if !self.wants(1, 1)
            || self.techniques.hittable_sensor
            || self.light(id).hit_measure() != HitMeasure::Area
        {
            return;
        }
        let Some(surface) = light.origin.surface else { return };
        let u = self.numbers.next4();
        let scene = self.context.scene;
        let sensor = &scene.sensors[self.context.sensor];
        let Some(connection) =
            sensor.camera.sample_connection(light.origin.p, DVec2::new(u[0], u[1]), self.context.time, margin)
        else {
            return;
        };
        let toward = connection.toward;
        let normal = light.origin.n;
        let point = SurfacePoint { p: light.origin.p, ng: normal, ns: normal, uv: DVec2::ZERO, id: surface };
        let radiance = self.light(id).radiance(&point, toward, &self.context.wavelengths);
        if radiance.is_black(self.context.count()) {
            return;
        }
        if light.region.medium != sensor.stack.medium() {
            return;
        }
        self.counters.connections_tried += 1;
        let cos = toward.dot(normal).abs();
        let d2 = connection.distance * connection.distance;
        let (_, direction_density) = sensor.camera.density(&connection.xk, -toward, self.context.time);
        let edge = Edge {
            light_end: EdgeDensity::uniform(direction_density.area_density(cos, d2)),
            ..Edge::default()
        };
        let pf0 = light.densities[0].own;
        let end = [VertexDensity::new(connection.pdf_xk)];
        let strategy = Strategy {
            view: PathView {
                light: &light.densities[..1],
                camera: &end,
                light_columns: &[],
                camera_columns: &[],
                edge,
                direct: pf0,
            },
            target: Target::Splat(connection.raster),
            class: PathClass::new(),
        };
        let transmittance = self.context.medium(light.region.medium).transmittance(connection.distance);
        let numerator = Self::numerator(&[&radiance, &transmittance], connection.importance * cos / pf0);
        let ray = Ray {
            t_max: connection.distance,
            end: connection.xk.surface,
            ..Ray::leaving(light.origin.p, toward, self.context.time, light.origin.surface)
        };
        self.finish(&numerator, &strategy, Some((&ray, &light.region)));
    }

    /// Density of the light sub-path's start by direct sampling from its first vertex.
    fn direct_of(&self, light: &Subpath) -> f64 {
        match (light.light, light.vertices.first()) {
            (Some(id), Some(first)) => self.direct_density(id, first.point.p, &light.origin),
            _ => 0.0,
        }
    }

    /// t = 0: the light sub-path arrived at the detector.
    pub fn hit_sensor(&mut self, light: &Subpath, hit: &SensorHit) {
        let n = hit.depth + 2;
        let Some(id) = light.light else { return };
        if !self.wants(n, 0) {
            return;
        }
        self.counters.connections_tried += 1;
        let sensor = &self.context.scene.sensors[self.context.sensor];
        let (pdf_xk, direction_density) =
            sensor.camera.density(&hit.xk, hit.toward_previous, self.context.time);
        // x_{k-1}: the last light vertex, or x₀
        let (before, direct) = match hit.depth.checked_sub(1) {
            Some(i) => {
                let cos = hit.toward_previous.dot(light.vertices[i].point.ng).abs();
                (direction_density.area_density(cos, hit.distance * hit.distance), self.direct_of(light))
            }
            None => {
                let factor =
                    light_end_factor(self.light(id), &light.origin, hit.toward_previous, hit.distance);
                (
                    direction_density.area_density(1.0, 1.0) * factor,
                    self.direct_density(id, hit.xk.p, &light.origin),
                )
            }
        };
        let mut columns = light.columns.clone();
        let mut end = VertexDensity::new(hit.own.hero);
        if let Some(lanes) = hit.own.lanes {
            end.own_column = columns.len() as u32;
            columns.push(lanes);
        }
        self.arrival.clear();
        self.arrival.extend_from_slice(&light.densities[..=hit.depth]);
        self.arrival.push(end);
        let arrival = std::mem::take(self.arrival);
        let edge = Edge {
            light_end: EdgeDensity::uniform(pdf_xk),
            light_before: EdgeDensity::uniform(before),
            ..Edge::default()
        };
        let mut class = PathClass::new();
        for density in &light.densities[1..=hit.depth] {
            class.push(density.label.is_specular());
        }
        let strategy = Strategy {
            view: PathView {
                light: &arrival,
                camera: &[],
                light_columns: &columns,
                camera_columns: &[],
                edge,
                direct,
            },
            target: Target::Splat(hit.raster),
            class,
        };
        let numerator =
            Self::numerator(&[&hit.throughput.lanes], hit.throughput.scale * hit.importance);
        self.finish(&numerator, &strategy, None);
        *self.arrival = arrival;
    }

    /// s, t >= 2: light vertex `i` is connected to camera vertex `j`.
    pub fn pair(&mut self, light: &Subpath, i: usize, camera: &Subpath, j: usize) {
        let (a, b) = (&light.vertices[i], &camera.vertices[j]);
        let offset = b.point.p - a.point.p;
        let d2 = offset.length_squared();
        if d2 == 0.0 {
            return;
        }
        let distance = d2.sqrt();
        let w = offset / distance;
        if !(a.sides_agree(w) && b.sides_agree(-w))
            || !a.sides_agree(a.toward_previous)
            || !b.sides_agree(b.toward_previous)
        {
            return;
        }
        let region = a.region(w);
        if region.medium != b.region(-w).medium {
            // most such pairs are simply on different sides of an interface: no path joins them
            return;
        }
        self.counters.connections_tried += 1;
        let at_a = a.bsdf.eval(a.frame.to_local(a.toward_previous), a.frame.to_local(w));
        if at_a.g.is_black(self.context.count()) {
            return;
        }
        let at_b = b.bsdf.eval(b.frame.to_local(-w), b.frame.to_local(b.toward_previous));
        if at_b.g.is_black(self.context.count()) {
            return;
        }
        let (forward_a, backward_a) = densities(&at_a);
        let (forward_b, backward_b) = densities(&at_b);
        let cos_a = w.dot(a.point.ng).abs();
        let cos_b = w.dot(b.point.ng).abs();
        let edge = Edge {
            light_end: backward_b.scaled(cos_a / d2),
            light_before: self.light_before(light, i, &backward_a),
            camera_end: forward_a.scaled(cos_b / d2),
            camera_before: self.camera_before(camera, j, &forward_b),
            ..Edge::default()
        };
        let strategy = Strategy {
            view: PathView {
                light: &light.densities[..i + 2],
                camera: &camera.densities[..j + 2],
                light_columns: &light.columns,
                camera_columns: &camera.columns,
                edge,
                direct: self.direct_of(light),
            },
            target: Target::OwnPixel,
            class: Self::class_of(Some((light, i + 1)), Some((camera, j + 1)), &edge),
        };
        let numerator = Self::numerator(
            &[
                &a.throughput.lanes,
                &b.throughput.lanes,
                &at_a.g,
                &at_b.g,
                &self.context.eta_squared(region.medium),
                &self.context.medium(region.medium).transmittance(distance),
            ],
            a.throughput.scale
                * b.throughput.scale
                * cos_a
                * a.light_side_correction(a.toward_previous)
                * w.dot(b.point.ns).abs()
                / d2,
        );
        let ray = Ray {
            t_max: distance,
            end: Some(b.point.id),
            ..Ray::leaving(a.point.p, w, self.context.time, Some(a.point.id))
        };
        self.finish(&numerator, &strategy, Some((&ray, region)));
    }

    /// All pairs s, t >= 2 that the depth limit and the choice of pairs allow.
    pub fn pairs(&mut self, light: &Subpath, camera: &Subpath) {
        let mut numbers: [f64; 4] = [0.0; 4];
        let mut used = 4;
        for i in 0..light.vertices.len() {
            if !light.vertices[i].bsdf.has_non_specular() {
                continue;
            }
            for j in 0..camera.vertices.len() {
                let (s, t) = (i + 2, j + 2);
                if s + t > self.max_depth.saturating_add(2) {
                    break;
                }
                if !camera.vertices[j].bsdf.has_non_specular() {
                    continue;
                }
                let probability = self.techniques.samples(s, t);
                if probability < 1.0 {
                    if used == 4 {
                        numbers = self.numbers.next4();
                        used = 0;
                    }
                    used += 1;
                    if numbers[used - 1] >= probability {
                        continue;
                    }
                }
                self.pair(light, i, camera, j);
            }
        }
    }
}
