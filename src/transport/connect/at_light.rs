//! Strategies that end on a light: camera sub-paths that hit one (s = 0) or are connected to one (s
//! = 1).

use super::end::{End, EndLabels, EndStart, Receiver};
use super::{Candidate, Joiner, Numerator};
use crate::bsdf::BsdfEval;
use crate::geometry::{EndPoint, Ray, SurfacePoint};
use crate::light::{DirectSample, HitMeasure, LightId};
use crate::medium::MediumId;
use crate::sampler::Draw;
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use crate::transport::aim::trail::Trail;
use crate::transport::contribution::{Contribution, Target};
use crate::transport::density::{Departure, Edge, EdgeDensity, PathView, VertexDensity};
use crate::transport::mis::direct_weight;
use crate::transport::subpath::{LightHit, Subpath};
use crate::transport::throughput::Throughput;
use glam::{DVec2, DVec3};

/// A camera sub-path's arrival at a light.
struct LightArrival {
    /// Vertices from the sensor, x₀ included.
    t: usize,
    id: LightId,
    x0: EndPoint,
    /// Medium of the arriving segment.
    medium: MediumId,
    /// Unit direction in which the light leaves x₀.
    leaving: DVec3,
    distance: f64,
    radiance: SampledSpectrum,
    throughput: Throughput,
}

/// A point of a light drawn from a point that it lights.
struct DirectLight {
    id: LightId,
    /// Of the choice of this light.
    probability: f64,
    sample: DirectSample,
}

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
            &self.context.wavelengths,
        );
        if radiance.is_black(self.context.count()) {
            return;
        }
        let medium = vertex.medium(vertex.toward_previous);
        let arrival = LightArrival {
            t,
            id: hit.light,
            x0: vertex.end_point(),
            medium,
            leaving: vertex.toward_previous,
            distance: vertex.distance,
            radiance,
            throughput: vertex.throughput,
        };
        self.arrive_at_light(camera, &arrival);
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
                &self.context.scene.geometry,
                escape.direction,
                &self.context.wavelengths,
            );
            if radiance.is_black(self.context.count()) {
                continue;
            }
            let x0 = EndPoint::toward_infinity(-escape.direction);
            let arrival = LightArrival {
                t,
                id,
                x0,
                medium: escape.medium,
                leaving: -escape.direction,
                distance: f64::INFINITY,
                radiance,
                throughput: escape.throughput,
            };
            self.arrive_at_light(camera, &arrival);
        }
    }

    /// The common part of s = 0.
    fn arrive_at_light(&mut self, camera: &Subpath, arrival: &LightArrival) {
        self.counters.connections_tried += 1;
        let (t, id, x0, leaving) = (arrival.t, arrival.id, &arrival.x0, arrival.leaving);
        // x₁: the camera vertex before, or the point of the sensor
        let (x1, cos, factor) = match t.checked_sub(3) {
            Some(before) => {
                let vertex = &camera.vertices[before];
                (vertex.p, vertex.cos(leaving), 1.0)
            }
            None => {
                let hittable = f64::from(u8::from(self.strategies.hittable_sensor));
                (camera.origin.p, camera.origin.cos(leaving), hittable)
            }
        };
        let (pf0, direction) = self.emission(id, x0, leaving, x1);
        let pf1 = direction.area_density(cos, arrival.distance * arrival.distance);
        let direct = if t == 2 && !self.strategies.hittable_sensor {
            // strategy (1, 1) of an image camera splats starts on area lights only
            if self.light(id).hit_measure() == HitMeasure::Area {
                pf0
            } else {
                0.0
            }
        } else {
            self.context.direct_density(id, x1, x0)
        };
        let edge = Edge {
            camera_end: EdgeDensity::uniform(pf0),
            camera_before: EdgeDensity::uniform(pf1 * factor),
            ..Edge::default()
        };
        let candidate = Candidate {
            view: PathView {
                light: &[],
                camera: &camera.densities[..t],
                light_columns: &[],
                camera_columns: &camera.columns,
                edge,
                direct,
                hittable_light: true,
                bridges: [None; 2],
                made: None,
                fan: None,
                emitter: id,
                raster: self.raster,
            },
            trail: Trail {
                x0: arrival.x0,
                light: &[],
                chain: &[],
                camera: &camera.vertices[..t - 2],
                x_sensor: camera.origin,
            },
            bridge: None,
            lane: 0,
            target: Target::OwnPixel,
            open: None,
        };
        let inverse_eta2 = SampledSpectrum::ONE / self.context.eta_squared(arrival.medium);
        let numerator = Numerator {
            scale: arrival.throughput.scale,
            lanes: arrival.throughput.lanes * arrival.radiance * inverse_eta2,
        };
        self.finish(&numerator, &candidate, &[], camera.start_stack());
    }

    /// Draws a point of a light to be joined to `p`.
    #[inline(always)]
    fn draw_light(&self, p: DVec3, draw: Draw) -> Option<DirectLight> {
        let u = self.sampler.set(draw);
        let (id, probability, u0) = self.context.scene.selection.sample(u[0])?;
        let mut sample = self.light(id).sample_direct(
            &self.context.scene.geometry,
            &self.context.wavelengths,
            p,
            u0,
            DVec2::new(u[1], u[2]),
        )?;
        let exposure = self.context.scene.exposure(&sample.x0);
        if exposure != 1.0 {
            sample.value *= exposure as f32;
        }
        Some(DirectLight {
            id,
            probability,
            sample,
        })
    }

    /// s = 1: joins the drawn point of a light to the end `camera`.
    fn join_light(&mut self, drawn: &DirectLight, camera: &End) {
        let DirectSample { x0, toward, .. } = drawn.sample;
        let (pf0, direction) = self.emission(drawn.id, &x0, -toward, camera.point.p);
        let start = EndStart::new(pf0, Departure::Start(direction));
        let receiver = Receiver::of_light(self.light(drawn.id), &x0, toward);
        let light = End {
            drawn: true,
            emission: Some((drawn.sample.value, drawn.probability)),
            direct: drawn.probability * drawn.sample.pdf,
            hittable: self.is_hittable(Some(drawn.id)),
            emitter: drawn.id,
            ..End::start(&start, x0, camera.stack, receiver)
        };
        self.join(&light, camera, (-toward, drawn.sample.distance), true);
    }

    /// s = 1: camera vertex `j` is connected to a light.
    #[inline]
    pub fn direct(&mut self, camera: &Subpath, j: usize) {
        if self.is_connectible(&camera.vertices[j]) && self.wants(1, j + 2) {
            self.connect_to_light(camera, j);
        }
    }

    fn connect_to_light(&mut self, camera: &Subpath, j: usize) {
        let vertex = &camera.vertices[j];
        let Some(drawn) = self.draw_light(vertex.p, Draw::Direct(j + 1)) else {
            return;
        };
        let w = drawn.sample.toward;
        if !vertex.sides_agree(w)
            || !vertex.sides_agree(vertex.toward_previous)
            || vertex.medium(w) != self.light_medium(drawn.id)
        {
            return;
        }
        self.counters.connections_tried += 1;
        if drawn.sample.value.is_black(self.context.count()) {
            return;
        }
        let mut rough = None;
        if vertex.has_non_specular {
            let scatterer = camera.scatterer(j, self.context);
            let eval = scatterer.eval(w, vertex.toward_previous);
            if self.has_two_terms(camera, j, &eval) {
                self.join_with_two_terms(camera, j, &drawn, &eval);
                return;
            }
            rough = self.label_of(camera, &eval);
        }
        let labels = EndLabels {
            rough,
            specular: self.specular_label(camera, j, w),
        };
        if !labels.is_empty() {
            let end = self.vertex_end(camera, j, w, &labels);
            self.join_light(&drawn, &end);
        }
    }

    /// Whether a path that is joined to a light at vertex `j` is made by that and by hitting the
    /// light alone, with one density for all lanes, and nobody asks what it is like.
    fn has_two_terms(&self, camera: &Subpath, j: usize, eval: &BsdfEval) -> bool {
        if !self.strategies.has_two_terms(&self.context.asked)
            || self.with_raw
            || self.detailed
            || self.context.held.is_some()
        {
            return false;
        }
        let is_specular = |v: &VertexDensity| v.label.is_specular();
        let may_be_regularized = self.strategies.cone.is_some()
            && (camera.vertices[j].has_specular || camera.densities[1..=j].iter().any(is_specular));
        !may_be_regularized && camera.columns.is_empty() && eval.columns.is_none()
    }

    /// [`Joiner::join_light`] where [`Joiner::has_two_terms`]: the same value and weight, but no
    /// more of the path is looked at than its end.
    fn join_with_two_terms(
        &mut self,
        camera: &Subpath,
        j: usize,
        drawn: &DirectLight,
        eval: &BsdfEval,
    ) {
        let count = self.context.count();
        if eval.g.is_black(count) {
            return;
        }
        let vertex = &camera.vertices[j];
        let DirectSample {
            x0,
            toward: w,
            distance,
            pdf,
            value,
        } = drawn.sample;
        let receiver = Receiver::of_light(self.light(drawn.id), &x0, w);
        let hit = eval.pdf_light * receiver.factor(distance);
        let weight = direct_weight(self.strategies, hit / (drawn.probability * pdf));
        let medium = self.context.medium(vertex.medium(w));
        let mut spectrum = vertex.throughput.lanes * eval.g * value;
        if !medium.is_clear() {
            spectrum *= medium.transmittance(distance, count);
        }
        let scale = vertex.throughput.scale * vertex.shading_cos(w) * weight / drawn.probability;
        let mut lanes = [0.0; MAX_LANES];
        if camera.densities[1..=j].iter().any(|v| v.dispersive) {
            // each hero has made its own
            for (k, lane) in lanes.iter_mut().enumerate().take(count) {
                let heroes = self.context.wavelengths.multiplicity(k) as f64;
                *lane = scale / heroes * f64::from(spectrum[k]);
            }
        } else {
            let scale = scale / count as f64;
            for (k, lane) in lanes.iter_mut().enumerate().take(count) {
                *lane = scale * f64::from(spectrum[k]);
            }
        }
        let Some(brightness) = self.finite_brightness(&lanes) else {
            return;
        };
        let t = j + 2;
        let Some(survival) = self.survival(brightness, self.raster, Draw::Roulette(1, t, 0)) else {
            return;
        };
        let ray = Ray::leaving(vertex.p, w, Some(vertex.id)).ending(distance, x0.surface);
        let stack = camera.stack(j, w);
        let open = self.context.visibility(&ray, stack, self.counters);
        if open == 0.0 {
            return;
        }
        self.counters.connections_made += 1;
        let scale = open / survival;
        if scale != 1.0 {
            lanes.iter_mut().for_each(|lane| *lane *= scale);
        }
        self.out.push(Contribution {
            s: 1,
            t: t as u32,
            emitter: drawn.id,
            ..Contribution::sum(Target::OwnPixel, lanes)
        });
    }

    /// (1, 1) on a detector: its point is connected straight to a light. `weight` is that of the
    /// point, `W_e` over its density.
    pub fn direct_to_detector(&mut self, camera: &Subpath, weight: f64) {
        if !self.wants(1, 1) || !self.strategies.hittable_sensor {
            return;
        }
        let x_sensor = camera.origin;
        let Some(drawn) = self.draw_light(x_sensor.p, Draw::Direct(0)) else {
            return;
        };
        let w = drawn.sample.toward;
        let cos = w.dot(x_sensor.n);
        if cos <= 0.0 || camera.start_stack().medium() != self.light_medium(drawn.id) {
            return;
        }
        self.counters.connections_tried += 1;
        // asked first: from a film in a camera, all but nothing is open
        let surface = drawn.sample.x0.surface;
        let ray = Ray::leaving(x_sensor.p, w, x_sensor.surface);
        let ray = ray.ending(drawn.sample.distance, surface);
        let stack = camera.start_stack();
        let open = self.context.visibility(&ray, stack, self.counters);
        if open == 0.0 {
            return;
        }
        let sensor = &self.context.scene.sensors[self.context.sensor];
        let (_, direction) = sensor.camera.density(x_sensor.p, w, self.context.moment());
        let density = direction.area_density(1.0, 1.0);
        if density <= 0.0 {
            // light that it does not accept
            return;
        }
        let across = EdgeDensity::uniform(density);
        let start = EndStart::new(camera.densities[0].own, Departure::Scattered(across));
        let receiver = Receiver::Area { cos };
        let end = End {
            weight: Throughput::splat(weight),
            cos,
            open: Some(open),
            ..End::start(&start, x_sensor, stack, receiver)
        };
        self.join_light(&drawn, &end);
    }

    fn light_medium(&self, id: LightId) -> MediumId {
        self.context.scene.light_stack(id).medium()
    }
}
