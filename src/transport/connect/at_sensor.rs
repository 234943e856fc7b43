//! Strategies that end on the sensor: light sub-paths that hit it (t = 0) or are connected to it (t
//! = 1).

use super::end::{End, EndStart, Receiver};
use super::{Candidate, Joiner, Numerator};
use crate::camera::SensorConnection;
use crate::light::HitMeasure;
use crate::medium::MediumId;
use crate::sampler::Draw;
use crate::transport::aim::trail::Trail;
use crate::transport::contribution::Target;
use crate::transport::density::{Departure, Edge, EdgeDensity, PathView};
use crate::transport::subpath::{SensorHit, Subpath};
use crate::transport::throughput::Throughput;
use glam::{DVec2, DVec3};

impl Joiner<'_> {
    /// Draws a point of the sensor to be joined to `p`; numbers are drawn only where it has more
    /// than one.
    fn draw_sensor(&self, p: DVec3, draw: Draw, margin: f64) -> Option<SensorConnection> {
        let camera = &self.context.scene.sensors[self.context.sensor].camera;
        let u_lens = if camera.is_delta() {
            DVec2::ZERO
        } else {
            let [u, v, _, _] = self.sampler.set(draw);
            DVec2::new(u, v)
        };
        let mut drawn = camera.sample_connection(p, u_lens, self.context.moment(), margin)?;
        drawn.importance *= self.context.scene.exposure(&drawn.xk);
        (drawn.importance > 0.0).then_some(drawn)
    }

    /// t = 1: joins the end `light` to the drawn point of the sensor.
    fn join_sensor(&mut self, light: &End, drawn: &SensorConnection) {
        let (x_sensor, toward) = (drawn.xk, drawn.toward);
        let sensor = &self.context.scene.sensors[self.context.sensor];
        let (_, direction) = sensor
            .camera
            .density(x_sensor.p, -toward, self.context.moment());
        let start = EndStart::new(drawn.pdf_xk, Departure::Start(direction));
        let receiver = Receiver::of_sensor(self.strategies.hittable_sensor, &x_sensor, toward);
        let camera = End {
            drawn: true,
            weight: Throughput::splat(drawn.importance),
            target: Target::Splat(drawn.raster),
            ..End::start(&start, x_sensor, light.stack, receiver)
        };
        self.join(light, &camera, (toward, drawn.distance), true);
    }

    /// t = 1: light vertex `i` is connected to the sensor.
    pub fn to_sensor(&mut self, light: &Subpath, i: usize, margin: f64) {
        let vertex = &light.vertices[i];
        if !self.is_connectible(vertex) || !self.wants(i + 2, 1) {
            return;
        }
        let Some(drawn) = self.draw_sensor(vertex.p, Draw::Lens(i + 1), margin) else {
            return;
        };
        let w = drawn.toward;
        if !vertex.sides_agree(w)
            || !vertex.sides_agree(vertex.toward_previous)
            || vertex.medium(w) != self.sensor_medium()
        {
            return;
        }
        self.counters.connections_tried += 1;
        let labels = self.labels(light, i, w);
        if !labels.is_empty() {
            let end = self.vertex_end(light, i, w, &labels);
            self.join_sensor(&end, &drawn);
        }
    }

    /// (1, 1) of image cameras: the start of the light sub-path, on an area light, is seen
    /// directly.
    pub fn start_to_sensor(&mut self, light: &Subpath, margin: f64) {
        let (Some(id), x0) = (light.light, light.origin) else {
            return;
        };
        if !self.wants(1, 1)
            || self.strategies.hittable_sensor
            || self.light(id).hit_measure() != HitMeasure::Area
        {
            return;
        }
        let Some(drawn) = self.draw_sensor(x0.p, Draw::Lens(0), margin) else {
            return;
        };
        let (context, toward) = (self.context, drawn.toward);
        let Some(radiance) = self.emitted(id, &x0, toward) else {
            return;
        };
        if radiance.is_black(context.count())
            || light.start_stack().medium() != self.sensor_medium()
        {
            return;
        }
        self.counters.connections_tried += 1;
        let pf0 = light.densities[0].own;
        // an image camera receives nothing, whatever is sent
        let unseen = Departure::Scattered(EdgeDensity::default());
        let start = EndStart::new(pf0, unseen);
        let cos = x0.cos(toward);
        let end = End {
            cos,
            emission: Some((radiance, pf0)),
            direct: pf0,
            hittable: true,
            emitter: id,
            ..End::start(&start, x0, light.start_stack(), Receiver::Area { cos })
        };
        self.join_sensor(&end, &drawn);
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
            sensor
                .camera
                .density(hit.x_sensor.p, hit.toward_previous, self.context.moment());
        // x_{k-1}: the last light vertex, or x₀
        let (before, direct) = match hit.depth.checked_sub(1) {
            Some(i) => {
                let cos = light.vertices[i].cos(hit.toward_previous);
                (
                    direction_density.area_density(cos, hit.distance * hit.distance),
                    light.direct,
                )
            }
            None => {
                let toward = hit.toward_previous;
                let receiver = Receiver::of_light(self.light(id), &light.origin, toward);
                (
                    direction_density.area_density(1.0, 1.0) * receiver.factor(hit.distance),
                    self.context
                        .direct_density(id, hit.x_sensor.p, &light.origin),
                )
            }
        };
        let mut arrival = std::mem::take(&mut self.scratch.arrival);
        arrival.clear();
        arrival.extend_from_slice(&light.densities[..=hit.depth]);
        arrival.push(hit.density);
        let edge = Edge {
            light_end: EdgeDensity::uniform(pdf_xk),
            light_before: EdgeDensity::uniform(before),
            ..Edge::default()
        };
        let candidate = Candidate {
            view: PathView {
                light: &arrival,
                camera: &[],
                light_columns: &light.columns,
                camera_columns: &[],
                edge,
                direct,
                hittable_light: self.is_hittable(light.light),
                bridges: [None; 2],
                made: None,
                fan: None,
                emitter: id,
                raster: hit.raster,
            },
            trail: Trail {
                x0: light.origin,
                light: &light.vertices[..hit.depth],
                chain: &[],
                camera: &[],
                x_sensor: hit.x_sensor,
            },
            bridge: None,
            lane: 0,
            target: Target::Splat(hit.raster),
            open: None,
        };
        let numerator = Numerator {
            scale: hit.throughput.scale * hit.importance,
            lanes: hit.throughput.lanes,
        };
        self.finish(&numerator, &candidate, &[], light.start_stack());
        self.scratch.arrival = arrival;
    }

    pub(super) fn sensor_medium(&self) -> MediumId {
        self.context.scene.sensors[self.context.sensor]
            .stack
            .medium()
    }
}
