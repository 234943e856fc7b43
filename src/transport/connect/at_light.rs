//! Strategies that end on a light: camera sub-paths that hit one (s = 0) or are connected to one (s = 1).

use super::{EndKind, Joiner, Strategy, light_end_factor};
use crate::geometry::{EndPoint, Ray, SurfacePoint};
use crate::light::{HitMeasure, LightId};
use crate::medium::MediumId;
use crate::spectrum::SampledSpectrum;
use crate::transport::contribution::Target;
use crate::transport::density::{Edge, EdgeDensity, PathView, VertexDensity};
use crate::transport::subpath::{LightHit, Subpath};
use crate::transport::throughput::Throughput;
use glam::{DVec2, DVec3};

impl Joiner<'_> {
    /// s = 0: the camera sub-path arrived at a light.
    pub fn hit_light(&mut self, camera: &Subpath, hit: &LightHit) {
        let vertex = &camera.vertices[hit.vertex];
        let t = hit.vertex + 2;
        if !self.wants(0, t) {
            return;
        }
        let point = SurfacePoint {
            p: vertex.p,
            ng: vertex.ng,
            ns: vertex.frame.z,
            uv: hit.uv,
            id: vertex.id,
        };
        let radiance = self.light(hit.light).radiance(
            &point,
            vertex.toward_previous,
            self.context.wavelengths(),
        );
        if radiance.is_black(self.context.count()) {
            return;
        }
        let medium = vertex.region(vertex.toward_previous).medium;
        self.arrive_at_light(
            camera,
            (t, hit.light, vertex.end_point(), medium),
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
            let radiance = self.light(id).escaped_radiance(
                escape.direction,
                self.context.time,
                self.context.wavelengths(),
            );
            if radiance.is_black(self.context.count()) {
                continue;
            }
            let x0 = EndPoint {
                p: DVec3::ZERO,
                n: -escape.direction,
                surface: None,
                infinite: true,
            };
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
                let vertex = &camera.vertices[before];
                (vertex.p, vertex.cos(leaving), 1.0)
            }
            None => {
                let hittable = f64::from(u8::from(self.techniques.hittable_sensor));
                (camera.origin.p, camera.origin.cos(leaving), hittable)
            }
        };
        let (pf0, pf1) = self.emission(id, &x0, leaving, cos, distance);
        let direct = if t == 2 && !self.techniques.hittable_sensor {
            // strategy (1, 1) of an image camera splats starts on area lights only
            if self.light(id).hit_measure() == HitMeasure::Area {
                pf0
            } else {
                0.0
            }
        } else {
            self.context.direct_density(id, x1, &x0)
        };
        let edge = Edge {
            camera_end: EdgeDensity::uniform(pf0),
            camera_before: EdgeDensity::uniform(pf1 * factor),
            ..Edge::default()
        };
        let strategy = Strategy {
            view: PathView {
                light: &[],
                camera: &camera.densities[..t],
                light_columns: &[],
                camera_columns: &camera.columns,
                edge,
                direct,
                hittable_light: true,
            },
            target: Target::OwnPixel,
        };
        let inverse_eta2 = SampledSpectrum::ONE / self.context.eta_squared(medium);
        let numerator = Self::numerator(
            &[&throughput.lanes, radiance, &inverse_eta2],
            throughput.scale,
        );
        self.finish(&numerator, &strategy, None);
    }

    /// s = 1: camera vertex `j` is connected to a light.
    pub fn direct(&mut self, camera: &Subpath, j: usize) {
        let vertex = &camera.vertices[j];
        if !self.wants(1, j + 2) || !self.is_connectible(vertex) {
            return;
        }
        let u = self.numbers.next4();
        let scene = self.context.scene;
        let Some((id, probability, u0)) = scene.selection.sample(u[0]) else {
            return;
        };
        let light_context = self.context.light_context();
        let Some(direct) = self.light(id).sample_direct(
            &light_context,
            self.context.wavelengths(),
            vertex.p,
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
        if direct.value.is_black(self.context.count()) {
            return;
        }
        let cos = vertex.cos(direct.toward);
        let factor = light_end_factor(self.light(id), &direct.x0, direct.toward, direct.distance);
        let ray = Ray::leaving(vertex.p, direct.toward, self.context.time, Some(vertex.id))
            .ending(direct.distance, direct.x0.surface);
        for kind in EndKind::ALL {
            let Some(end) = self.end(kind, camera, j, direct.toward, vertex.toward_previous) else {
                continue;
            };
            let (pf0, pf1) = self.emission(id, &direct.x0, -direct.toward, cos, direct.distance);
            let edge = Edge {
                light_end: end.backward.scaled(factor),
                camera_end: EdgeDensity::uniform(pf1),
                camera_before: self.camera_before(camera, j, &end.forward),
                camera_label: end.label,
                camera_dispersive: end.dispersive,
                length: direct.distance as f32,
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
                    hittable_light: self.is_hittable(Some(id)),
                },
                target: Target::OwnPixel,
            };
            let medium = self.context.medium(region.medium);
            let numerator = Self::numerator(
                &[
                    &vertex.throughput.lanes,
                    &end.kernel,
                    &direct.value,
                    &medium.transmittance(direct.distance),
                ],
                vertex.throughput.scale * vertex.shading_cos(direct.toward) / probability,
            );
            self.finish(&numerator, &strategy, Some((&ray, region)));
        }
    }

    /// (1, 1) on a detector: its point is connected straight to a light. `weight` is the camera sample's, `own` the density of x_k.
    pub fn direct_to_detector(&mut self, camera: &Subpath, weight: f64) {
        if !self.wants(1, 1) || !self.techniques.hittable_sensor {
            return;
        }
        let u = self.numbers.next4();
        let scene = self.context.scene;
        let Some((id, probability, u0)) = scene.selection.sample(u[0]) else {
            return;
        };
        let xk = camera.origin;
        let Some(direct) = self.light(id).sample_direct(
            &self.context.light_context(),
            self.context.wavelengths(),
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
        let (_, direction_density) = scene.sensors[self.context.sensor].camera.density(
            &xk,
            direct.toward,
            self.context.time,
        );
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
                hittable_light: self.is_hittable(Some(id)),
            },
            target: Target::OwnPixel,
        };
        let medium = self.context.medium(camera.region.medium);
        // the sample's weight is W_e π / pdf: without the π of its direction it is W_e / pdf
        let scale = weight / std::f64::consts::PI * cos / probability;
        let numerator = Self::numerator(
            &[&direct.value, &medium.transmittance(direct.distance)],
            scale,
        );
        let ray = Ray::leaving(xk.p, direct.toward, self.context.time, xk.surface)
            .ending(direct.distance, direct.x0.surface);
        self.finish(&numerator, &strategy, Some((&ray, &camera.region)));
    }
}
