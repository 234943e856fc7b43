//! Knowledge of the ends and the vertices of a bridge once its chain is solved.

use super::super::Joiner;
use super::super::end::{EndLabel, Receiver};
use super::{Ends, LightEnd, SensorEnd, Start};
use crate::bsdf::Label;
use crate::geometry::{EndPoint, SurfaceId};
use crate::light::LightKind;
use crate::medium::{MediumId, MediumStack};
use crate::transport::aim::passage::Solved;
use crate::transport::contribution::Target;
use crate::transport::density::{Column, Departure, Edge, EdgeDensity, NO_COLUMN, VertexDensity};
use crate::transport::subpath::Subpath;
use crate::transport::throughput::Throughput;
use glam::{DVec2, DVec3};

/// Knowledge of one end once the direction to the chain is.
pub(super) struct Reached {
    /// All factors of this side but those of lanes, and those.
    pub weight: Throughput,
    /// Density of the direction towards the chain.
    pub across: Departure,
    /// Density of the vertex before this end from the other side.
    pub behind: EdgeDensity,
    /// Jacobian from solid angle at the chain to the measure of this end.
    pub factor: f64,
    pub target: Target,
    pub surface: Option<SurfaceId>,
    pub point: EndPoint,
    /// The solids that the chain is in there.
    pub stack: MediumStack,
    /// Density of a point of the sensor.
    pub own: f64,
}

impl Joiner<'_> {
    /// The light's end, which the chain leaves in unit direction `w` over `length` to `p`.
    pub(super) fn reach_light(
        &self,
        ends: &Ends,
        (w, length): (DVec3, f64),
        p: DVec3,
        medium: MediumId,
    ) -> Option<Reached> {
        match ends.light {
            LightEnd::Vertex(path, i) => {
                let vertex = &path.vertices[i];
                let label = self.reach_vertex(path, i, w, medium)?;
                let cos = vertex.cos(w);
                let correction = vertex.light_side_correction(vertex.toward_previous);
                Some(Reached {
                    weight: vertex
                        .throughput
                        .times(&label.kernel)
                        .scaled(cos * correction),
                    across: label.across,
                    behind: label.behind.scaled(self.before_factor(path, i)),
                    factor: cos / (length * length),
                    target: Target::OwnPixel,
                    surface: Some(vertex.id),
                    point: vertex.end_point(),
                    stack: *path.stack(i, w),
                    own: 0.0,
                })
            }
            LightEnd::Start => {
                let Start {
                    id, mut x0, pdf, ..
                } = ends.start;
                let (light, context) = (self.light(id), self.context);
                let (geometry, waves) = (&context.scene.geometry, &context.wavelengths);
                let value = match self.emitted(id, &x0, w) {
                    Some(radiance) => radiance,
                    None if matches!(light.kind, LightKind::Environment(_)) => {
                        light.escaped_radiance(geometry, -w, waves)
                    }
                    None => {
                        let sample = light.sample_direct(geometry, waves, p, 0.0, DVec2::ZERO)?;
                        let d2 = if x0.parallel { 1.0 } else { length * length };
                        x0 = sample.x0;
                        sample.value * d2 as f32
                    }
                };
                if value.is_black(context.count()) {
                    return None;
                }
                let cos = x0.cos(w);
                let (_, direction) = self.emission(id, &x0, w, p);
                Some(Reached {
                    weight: Throughput::splat(cos / pdf).times(&value),
                    across: Departure::Start(direction),
                    behind: EdgeDensity::default(),
                    factor: Receiver::of_light(light, &x0, w).factor(length),
                    target: Target::OwnPixel,
                    surface: x0.surface,
                    point: x0,
                    stack: ends.start.stack,
                    own: pdf,
                })
            }
        }
    }

    /// The sensor's end, at which the chain arrives in unit direction `w` over `length` from `p`.
    pub(super) fn reach_sensor(
        &self,
        ends: &Ends,
        (w, length): (DVec3, f64),
        p: DVec3,
        medium: MediumId,
    ) -> Option<Reached> {
        match ends.sensor {
            SensorEnd::Vertex(path, j) => {
                let vertex = &path.vertices[j];
                let label = self.reach_vertex(path, j, -w, medium)?;
                Some(Reached {
                    weight: vertex
                        .throughput
                        .times(&label.kernel)
                        .scaled(vertex.shading_cos(w)),
                    across: label.across,
                    behind: label.behind.scaled(self.before_factor(path, j)),
                    factor: vertex.cos(w) / (length * length),
                    target: Target::OwnPixel,
                    surface: Some(vertex.id),
                    point: vertex.end_point(),
                    stack: *path.stack(j, -w),
                    own: 0.0,
                })
            }
            SensorEnd::Sensor(_, u) => {
                let sensor = &self.context.scene.sensors[self.context.sensor];
                let moment = self.context.moment();
                let drawn = sensor.camera.sample_connection(p, u, moment, ends.margin)?;
                let (_, direction) = sensor.camera.density(drawn.xk.p, -w, moment);
                Some(Reached {
                    weight: Throughput::splat(drawn.importance * length * length),
                    across: Departure::Start(direction),
                    behind: EdgeDensity::default(),
                    // an image camera receives nothing
                    factor: 0.0,
                    target: Target::Splat(drawn.raster),
                    surface: drawn.xk.surface,
                    point: drawn.xk,
                    stack: sensor.stack,
                    own: drawn.pdf_xk,
                })
            }
        }
    }

    /// Vertex `i`, left in unit direction `w` into `medium`, under its non-specular label.
    fn reach_vertex(
        &self,
        path: &Subpath,
        i: usize,
        w: DVec3,
        medium: MediumId,
    ) -> Option<EndLabel> {
        let vertex = &path.vertices[i];
        if !vertex.sides_agree(w) || vertex.medium(w) != medium {
            return None;
        }
        self.rough_label(path, i, w)
    }
}

impl Ends<'_> {
    /// The densities of x₀ … x_{b−1} as if they all had been made from the light, and the edge to
    /// x_b.
    pub(super) fn densities(
        &self,
        (light, sensor): (&Reached, &Reached),
        (solved, segments): (&[Solved], &[(DVec3, f64)]),
        out: &mut Vec<VertexDensity>,
        columns: &mut Vec<Column>,
    ) -> Edge {
        let m = solved.len();
        let cos = |i: usize, w: DVec3| solved[i].place.ng.dot(w).abs();
        let d2 = |i: usize| segments[i].1 * segments[i].1;
        // of the chain's vertex i from the sensor side: what x_{i+1} sends there
        let from_sensor = |i: usize| {
            let (w, d2) = (segments[i + 1].0, d2(i + 1));
            match solved.get(i + 1) {
                Some(next) => EdgeDensity::uniform(next.backward * cos(i, w) / d2),
                None => sensor.across.area_density(cos(i, w), d2),
            }
        };
        let from_light = |i: usize| {
            let (w, d2) = (segments[i].0, d2(i));
            match i.checked_sub(1) {
                Some(before) => EdgeDensity::uniform(solved[before].forward * cos(i, w) / d2),
                None => light.across.area_density(cos(i, w), d2),
            }
        };
        let at_light = solved[0].backward * light.factor;
        if let LightEnd::Vertex(path, i) = self.light {
            out.extend_from_slice(&path.densities[..i + 2]);
            columns.extend_from_slice(&path.columns);
            let (own, before) = (&mut out[i..], &light.behind);
            own[0].other = before.hero;
            own[0].other_column = store(columns, before);
            own[1].other = at_light;
            own[1].other_column = NO_COLUMN;
            own[1].label = Label::NonSpecular;
            own[1].dispersive = false;
        } else {
            let mut start = VertexDensity::new(light.own);
            start.other = at_light;
            out.push(start);
        }
        for (i, vertex) in solved.iter().enumerate() {
            let (own, other) = (from_light(i), from_sensor(i));
            let mut density = VertexDensity::new(own.hero);
            density.own_column = store(columns, &own);
            density.other = other.hero;
            density.other_column = store(columns, &other);
            density.length = segments[i].1 as f32;
            density.label = vertex.label;
            density.dispersive = vertex.dispersive;
            out.push(density);
        }
        let end = &solved[m - 1];
        Edge {
            light_end: from_sensor(m - 1),
            light_before: match m.checked_sub(2) {
                Some(before) => from_sensor(before),
                None => EdgeDensity::uniform(at_light),
            },
            camera_end: EdgeDensity::uniform(end.forward * sensor.factor),
            camera_before: sensor.behind,
            light_label: end.label,
            camera_label: Label::NonSpecular,
            length: segments[m].1 as f32,
            light_dispersive: end.dispersive,
            camera_dispersive: false,
        }
    }
}

fn store(columns: &mut Vec<Column>, density: &EdgeDensity) -> u32 {
    match density.lanes {
        None => NO_COLUMN,
        Some(lanes) => {
            columns.push(lanes);
            (columns.len() - 1) as u32
        }
    }
}
