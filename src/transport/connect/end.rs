//! The two ends of a joining edge, and the one function that joins them.
//!
//! An end is a vertex of a sub-path, or an end point drawn for this edge. Each is asked the same
//! three things: under which labels it scatters along the edge and how, the density of direction
//! that it sends along it, and the measure in which it receives one. The four densities that only
//! the joint knows are products of what one end sends and the other receives.

use super::{Candidate, Joiner, Numerator};
use crate::bsdf::{BsdfEval, Label};
use crate::geometry::{EndPoint, Ray};
use crate::light::{HitMeasure, Light, LightId};
use crate::medium::MediumStack;
use crate::spectrum::SampledSpectrum;
use crate::transport::aim::trail::Trail;
use crate::transport::contribution::Target;
use crate::transport::density::{Column, Departure, Edge, EdgeDensity, PathView, VertexDensity};
use crate::transport::subpath::{Subpath, Vertex};
use crate::transport::throughput::Throughput;
use glam::DVec3;

/// The measure in which a vertex has its density, for an edge that arrives there.
#[derive(Clone, Copy, Debug)]
pub enum Receiver {
    /// Area, at `cos` between its geometric normal and the edge.
    Area {
        /// |cos θ|.
        cos: f64,
    },
    /// Solid angle at the other end of the edge: an environment.
    SolidAngle,
    /// None: it cannot be hit.
    Never,
}

impl Receiver {
    /// A point x₀ of a light, seen along unit direction `w`.
    #[must_use]
    pub fn of_light(light: &Light, x0: &EndPoint, w: DVec3) -> Self {
        match light.hit_measure() {
            HitMeasure::Area => Self::Area { cos: x0.cos(w) },
            HitMeasure::SolidAngle => Self::SolidAngle,
            HitMeasure::Never => Self::Never,
        }
    }

    /// A point of a sensor that can be hit or not, seen along unit direction `w`.
    #[must_use]
    pub fn of_sensor(hittable: bool, x_sensor: &EndPoint, w: DVec3) -> Self {
        if hittable {
            Self::Area {
                cos: x_sensor.cos(w),
            }
        } else {
            Self::Never
        }
    }

    /// Jacobian from solid angle at `distance` to this measure; 0 where it cannot be hit.
    #[must_use]
    pub fn factor(self, distance: f64) -> f64 {
        match self {
            Self::Area { cos } => cos / (distance * distance),
            Self::SolidAngle => 1.0,
            Self::Never => 0.0,
        }
    }

    /// Density of the vertex when the other end, at `distance`, sends a direction to it.
    fn density(self, sent: &Departure, distance: f64) -> EdgeDensity {
        match self {
            Self::Area { cos } => sent.area_density(cos, distance * distance),
            _ => sent.solid_angle().scaled(self.factor(distance)),
        }
    }
}

/// Scattering of an end under one of its labels.
#[derive(Debug)]
pub(super) struct EndLabel {
    pub label: Label,
    dispersive: bool,
    /// `g`; `A g` of a specular label; 1 of an end point.
    pub kernel: SampledSpectrum,
    /// Density of the direction along the edge, given the one to the vertex before; the label's
    /// probability of a specular one.
    pub across: Departure,
    /// Density of the direction to the vertex before, given the one along the edge.
    pub behind: EdgeDensity,
}

/// The labels that an end is tried under: at most the non-specular one and the specular one that
/// the sides select.
#[derive(Debug)]
pub(super) struct EndLabels {
    pub rough: Option<EndLabel>,
    pub specular: Option<EndLabel>,
}

impl EndLabels {
    pub fn is_empty(&self) -> bool {
        self.rough.is_none() && self.specular.is_none()
    }

    fn iter(&self) -> impl Iterator<Item = &EndLabel> {
        self.rough.iter().chain(&self.specular)
    }
}

/// An end point without a vertex before it: its density, and that of the direction along the edge.
pub(super) struct EndStart {
    density: VertexDensity,
    labels: EndLabels,
}

impl EndStart {
    pub fn new(pdf: f64, across: Departure) -> Self {
        Self {
            density: VertexDensity::new(pdf),
            labels: EndLabels {
                rough: Some(EndLabel {
                    label: Label::NonSpecular,
                    dispersive: false,
                    kernel: SampledSpectrum::ONE,
                    across,
                    behind: EdgeDensity::default(),
                }),
                specular: None,
            },
        }
    }
}

/// An end of a joining edge.
pub(super) struct End<'p> {
    /// Scattering vertices of the sub-path up to here, and its start.
    pub vertices: &'p [Vertex],
    pub start: EndPoint,
    /// Densities of the sub-path up to here.
    pub path: &'p [VertexDensity],
    pub columns: &'p [Column],
    pub labels: &'p EndLabels,
    pub point: EndPoint,
    /// The solids the edge is in at this end.
    pub stack: &'p MediumStack,
    pub receiver: Receiver,
    /// Jacobian from solid angle here to the measure of the vertex before; 0 where there is none.
    pub before: f64,
    /// Weight of everything on this side of the edge.
    pub weight: Throughput,
    /// Cosine of this end in the numerator: geometric on the light side, shading on the sensor
    /// side; 1 where the weight has it.
    pub cos: f64,
    /// `light_side_correction` of a vertex of a light sub-path, else 1.
    pub correction: f64,
    /// A point drawn from the other end, whose weight holds 1/d² of the edge.
    pub drawn: bool,
    /// A point on a light: its emission, in which η² of the edge cancels, and the probability of
    /// having it.
    pub emission: Option<(SampledSpectrum, f64)>,
    /// Light side: density of x₀ by direct sampling.
    pub direct: f64,
    /// Light side: camera sub-paths can hit x₀.
    pub hittable: bool,
    /// Light side: the light of x₀.
    pub emitter: LightId,
    /// Sensor side: the pixel.
    pub target: Target,
    /// Transmittance of the edge, where that is known already.
    pub open: Option<f64>,
}

impl<'p> End<'p> {
    /// An end point of weight 1.
    pub fn start(
        start: &'p EndStart,
        point: EndPoint,
        stack: &'p MediumStack,
        receiver: Receiver,
    ) -> Self {
        Self {
            vertices: &[],
            start: point,
            path: std::slice::from_ref(&start.density),
            columns: &[],
            labels: &start.labels,
            point,
            stack,
            receiver,
            before: 0.0,
            weight: Throughput::splat(1.0),
            cos: 1.0,
            correction: 1.0,
            drawn: false,
            emission: None,
            direct: 0.0,
            hittable: false,
            emitter: LightId(0),
            target: Target::OwnPixel,
            open: None,
        }
    }
}

impl Joiner<'_> {
    /// Jacobian from solid angle at vertex `i` to the measure of the vertex before it, the start of
    /// the sub-path included.
    pub fn before_factor(&self, path: &Subpath, i: usize) -> f64 {
        path.factor_before(i, || {
            let vertex = &path.vertices[i];
            let (start, w) = (&path.origin, vertex.toward_previous);
            let receiver = match path.light {
                Some(id) => Receiver::of_light(self.light(id), start, w),
                None => Receiver::of_sensor(self.strategies.hittable_sensor, start, w),
            };
            receiver.factor(vertex.distance)
        })
    }

    /// Vertex `i` as an end whose edge leaves in unit direction `w`.
    pub(super) fn vertex_end<'p>(
        &self,
        path: &'p Subpath,
        i: usize,
        w: DVec3,
        labels: &'p EndLabels,
    ) -> End<'p> {
        let vertex = &path.vertices[i];
        let geometric_cos = vertex.cos(w);
        let (cos, correction) = match path.light {
            Some(_) => (
                geometric_cos,
                vertex.light_side_correction(vertex.toward_previous),
            ),
            None => (vertex.shading_cos(w), 1.0),
        };
        End {
            vertices: &path.vertices[..=i],
            start: path.origin,
            path: &path.densities[..i + 2],
            columns: &path.columns,
            labels,
            point: vertex.end_point(),
            stack: path.stack(i, w),
            receiver: Receiver::Area { cos: geometric_cos },
            before: self.before_factor(path, i),
            weight: vertex.throughput,
            cos,
            correction,
            drawn: false,
            emission: None,
            direct: path.direct,
            hittable: self.is_hittable(path.light),
            emitter: path.light.unwrap_or(LightId(0)),
            target: Target::OwnPixel,
            open: None,
        }
    }

    /// Scattering at vertex `i` into unit direction `w` under its non-specular label.
    pub(super) fn rough_label(&self, path: &Subpath, i: usize, w: DVec3) -> Option<EndLabel> {
        if !path.vertices[i].has_non_specular {
            return None;
        }
        let (w_light, w_camera) = path.ordered(path.vertices[i].toward_previous, w);
        let eval = path.scatterer(i, self.context).eval(w_light, w_camera);
        self.label_of(path, &eval)
    }

    /// The non-specular label of a vertex of `path` that scatters so.
    pub(super) fn label_of(&self, path: &Subpath, eval: &BsdfEval) -> Option<EndLabel> {
        let (forward, backward) = EdgeDensity::of(eval);
        let (behind, across) = path.ordered(backward, forward);
        (!eval.g.is_black(self.context.count())).then_some(EndLabel {
            label: Label::NonSpecular,
            dispersive: false,
            kernel: eval.g,
            across: Departure::Scattered(across),
            behind,
        })
    }

    /// The same under the specular label of the two directions' sides, within the cone.
    pub(super) fn specular_label(&self, path: &Subpath, i: usize, w: DVec3) -> Option<EndLabel> {
        let cone = self.strategies.cone.as_ref()?;
        if !path.vertices[i].has_specular {
            return None;
        }
        let (w_light, w_camera) = path.ordered(path.vertices[i].toward_previous, w);
        let scatterer = path.scatterer(i, self.context);
        let (found, [forward, backward]) = scatterer.specular(w_light, w_camera, cone)?;
        let (behind, across) = path.ordered(backward, forward);
        Some(EndLabel {
            label: found.label,
            dispersive: found.dispersive,
            kernel: found.kernel,
            across: Departure::Scattered(EdgeDensity::uniform(across)),
            behind: EdgeDensity::uniform(behind),
        })
    }

    /// Every label under which vertex `i` scatters into unit direction `w`.
    pub(super) fn labels(&self, path: &Subpath, i: usize, w: DVec3) -> EndLabels {
        EndLabels {
            rough: self.rough_label(path, i, w),
            specular: self.specular_label(path, i, w),
        }
    }

    /// Joins two ends by an edge of unit direction `w`, from the light to the sensor, and length
    /// `distance`, under all their labels; under non-specular ones of both only `with_rough_pair`.
    /// [theory (1.9), (3.7)]
    pub(super) fn join(
        &mut self,
        light: &End,
        camera: &End,
        (w, distance): (DVec3, f64),
        with_rough_pair: bool,
    ) {
        // a point drawn for the edge may lie at infinity: the ray leaves the end that was there
        // before
        let (from, to, w) = if light.drawn {
            (camera, light, -w)
        } else {
            (light, camera, w)
        };
        let ray =
            Ray::leaving(from.point.p, w, from.point.surface).ending(distance, to.point.surface);
        let medium = from.stack.medium();
        let (value, probability) = match light.emission {
            Some(emission) => emission,
            None => (self.context.eta_squared(medium), 1.0),
        };
        let divisor = if light.drawn || camera.drawn {
            probability
        } else {
            distance * distance
        };
        let scale =
            light.weight.scale * camera.weight.scale * light.cos * light.correction * camera.cos
                / divisor;
        let count = self.context.count();
        let transmittance = self.context.medium(medium).transmittance(distance, count);
        let pairs = light
            .labels
            .iter()
            .flat_map(|a| camera.labels.iter().map(move |b| (a, b)));
        for (a, b) in pairs {
            if !(with_rough_pair || a.label.is_specular() || b.label.is_specular()) {
                continue;
            }
            let view = PathView {
                light: light.path,
                camera: camera.path,
                light_columns: light.columns,
                camera_columns: camera.columns,
                edge: Edge {
                    light_end: light.receiver.density(&b.across, distance),
                    light_before: a.behind.scaled(light.before),
                    camera_end: camera.receiver.density(&a.across, distance),
                    camera_before: b.behind.scaled(camera.before),
                    light_label: a.label,
                    camera_label: b.label,
                    length: distance as f32,
                    light_dispersive: a.dispersive,
                    camera_dispersive: b.dispersive,
                },
                direct: light.direct,
                hittable_light: light.hittable,
                bridges: [None; 2],
                made: None,
                fan: None,
                emitter: light.emitter,
                raster: match camera.target {
                    Target::OwnPixel => self.raster,
                    Target::Splat(raster) => raster,
                },
            };
            let numerator = Numerator {
                scale,
                lanes: light.weight.lanes
                    * camera.weight.lanes
                    * a.kernel
                    * b.kernel
                    * value
                    * transmittance,
            };
            let candidate = Candidate {
                view,
                trail: Trail {
                    x0: light.start,
                    light: light.vertices,
                    chain: &[],
                    camera: camera.vertices,
                    x_sensor: camera.start,
                },
                bridge: None,
                lane: 0,
                target: camera.target,
                open: light.open.or(camera.open),
            };
            self.finish(&numerator, &candidate, &[ray], from.stack);
        }
    }
}
