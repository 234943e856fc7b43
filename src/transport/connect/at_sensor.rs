//! Strategies that end on the sensor: light sub-paths that hit it (t = 0) or are connected to it (t = 1).

use super::{EndKind, Joiner, Strategy, light_end_factor};
use crate::camera::SensorConnection;
use crate::geometry::{Ray, SurfacePoint};
use crate::light::HitMeasure;
use crate::transport::contribution::Target;
use crate::transport::density::{Edge, EdgeDensity, PathView, VertexDensity};
use crate::transport::subpath::{SensorHit, Subpath};
use glam::{DVec2, DVec3};

impl Joiner<'_> {
    /// Connects `p` to a point of the sensor; numbers are drawn only where it has more than one.
    fn sample_sensor(&mut self, p: DVec3, margin: f64) -> Option<SensorConnection> {
        let camera = &self.context.scene.sensors[self.context.sensor].camera;
        let u_lens = if camera.is_delta() {
            DVec2::ZERO
        } else {
            let [u, v, _, _] = self.numbers.next4();
            DVec2::new(u, v)
        };
        camera.sample_connection(p, u_lens, self.context.time, margin)
    }

    /// t = 1: light vertex `i` is connected to the sensor.
    pub fn to_sensor(&mut self, light: &Subpath, i: usize, margin: f64) {
        let vertex = &light.vertices[i];
        if !self.wants(i + 2, 1) || !self.is_connectible(vertex) {
            return;
        }
        let Some(connection) = self.sample_sensor(vertex.p, margin) else {
            return;
        };
        let scene = self.context.scene;
        let sensor = &scene.sensors[self.context.sensor];
        let toward = connection.toward;
        if !vertex.sides_agree(toward) || !vertex.sides_agree(vertex.toward_previous) {
            return;
        }
        let region = vertex.region(toward);
        if region.medium != sensor.stack.medium() {
            return;
        }
        self.counters.connections_tried += 1;
        let cos = vertex.cos(toward);
        let d2 = connection.distance * connection.distance;
        let ray = Ray::leaving(vertex.p, toward, self.context.time, Some(vertex.id))
            .ending(connection.distance, connection.xk.surface);
        for kind in EndKind::ALL {
            let Some(end) = self.end(kind, light, i, vertex.toward_previous, toward) else {
                continue;
            };
            let (_, direction_density) =
                sensor
                    .camera
                    .density(&connection.xk, -toward, self.context.time);
            let edge = Edge {
                light_end: EdgeDensity::uniform(direction_density.area_density(cos, d2)),
                light_before: self.light_before(light, i, &end.backward),
                camera_end: end.forward.scaled(self.sensor_end_factor(
                    &connection.xk,
                    toward,
                    connection.distance,
                )),
                light_label: end.label,
                light_dispersive: end.dispersive,
                length: connection.distance as f32,
                ..Edge::default()
            };
            let last = [VertexDensity::new(connection.pdf_xk)];
            let strategy = Strategy {
                view: PathView {
                    light: &light.densities[..i + 2],
                    camera: &last,
                    light_columns: &light.columns,
                    camera_columns: &[],
                    edge,
                    direct: light.direct,
                    hittable_light: self.is_hittable(light.light),
                },
                target: Target::Splat(connection.raster),
            };
            let medium = self.context.medium(region.medium);
            let numerator = Self::numerator(
                &[
                    &vertex.throughput.lanes,
                    &end.kernel,
                    &self.context.eta_squared(region.medium),
                    &medium.transmittance(connection.distance),
                ],
                vertex.throughput.scale
                    * connection.importance
                    * cos
                    * vertex.light_side_correction(vertex.toward_previous),
            );
            self.finish(&numerator, &strategy, Some((&ray, region)));
        }
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
        let Some(surface) = light.origin.surface else {
            return;
        };
        let Some(connection) = self.sample_sensor(light.origin.p, margin) else {
            return;
        };
        let scene = self.context.scene;
        let sensor = &scene.sensors[self.context.sensor];
        let toward = connection.toward;
        let normal = light.origin.n;
        let uv = if self.light(id).has_pattern() {
            scene
                .accel
                .texture_coordinates(surface, light.origin.p, self.context.time)
        } else {
            DVec2::ZERO
        };
        let point = SurfacePoint {
            p: light.origin.p,
            ng: normal,
            ns: normal,
            uv,
            id: surface,
        };
        let radiance = self
            .light(id)
            .radiance(&point, toward, self.context.wavelengths());
        if radiance.is_black(self.context.count()) {
            return;
        }
        if light.region.medium != sensor.stack.medium() {
            return;
        }
        self.counters.connections_tried += 1;
        let cos = toward.dot(normal).abs();
        let d2 = connection.distance * connection.distance;
        let (_, direction_density) =
            sensor
                .camera
                .density(&connection.xk, -toward, self.context.time);
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
                hittable_light: true,
            },
            target: Target::Splat(connection.raster),
        };
        let transmittance = self
            .context
            .medium(light.region.medium)
            .transmittance(connection.distance);
        let numerator = Self::numerator(
            &[&radiance, &transmittance],
            connection.importance * cos / pf0,
        );
        let ray = Ray::leaving(
            light.origin.p,
            toward,
            self.context.time,
            light.origin.surface,
        )
        .ending(connection.distance, connection.xk.surface);
        self.finish(&numerator, &strategy, Some((&ray, &light.region)));
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
                .density(&hit.xk, hit.toward_previous, self.context.time);
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
                let factor = light_end_factor(
                    self.light(id),
                    &light.origin,
                    hit.toward_previous,
                    hit.distance,
                );
                (
                    direction_density.area_density(1.0, 1.0) * factor,
                    self.context.direct_density(id, hit.xk.p, &light.origin),
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
        let strategy = Strategy {
            view: PathView {
                light: &arrival,
                camera: &[],
                light_columns: &light.columns,
                camera_columns: &[],
                edge,
                direct,
                hittable_light: self.is_hittable(light.light),
            },
            target: Target::Splat(hit.raster),
        };
        let numerator = Self::numerator(
            &[&hit.throughput.lanes],
            hit.throughput.scale * hit.importance,
        );
        self.finish(&numerator, &strategy, None);
        self.scratch.arrival = arrival;
    }
}
