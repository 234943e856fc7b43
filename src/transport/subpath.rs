//! Sub-paths: contiguous, reusable, complete enough to be joined by any strategy.

use super::aim::fan::Fan;
use super::context::PathContext;
use super::density::{Column, EdgeDensity, NO_COLUMN, VertexDensity};
use super::regularize::{Cone, SpecularKernel, specular_kernel};
use super::throughput::Throughput;
use crate::bsdf::lobe::dielectric::Dielectric;
use crate::bsdf::{Bsdf, BsdfEval, BsdfSample, Interface, Label, Lobe, Side};
use crate::geometry::{EndPoint, InstanceId, SurfaceId};
use crate::light::LightId;
use crate::math::frame::Frame;
use crate::medium::{MediumId, MediumStack};
use glam::{DVec2, DVec3};

/// A scattering vertex of a sub-path. Its lobes are held by the sub-path: [`Subpath::scatterer`].
#[derive(Clone, Debug)]
pub struct Vertex {
    /// Position.
    pub p: DVec3,
    /// Unit geometric normal.
    pub ng: DVec3,
    /// Basis around the shading normal, its z axis.
    pub frame: Frame,
    /// Face and instance.
    pub id: SurfaceId,
    /// The media on the side the normal points to, and on the other.
    pub media: [MediumId; 2],
    /// The stacks there, by their place in the sub-path.
    pub(super) stacks: [u32; 2],
    /// Unit direction towards the previous vertex.
    pub toward_previous: DVec3,
    /// Distance to the previous vertex; infinite if that is a light at infinity.
    pub distance: f64,
    /// Weight up to and including the arrival here, in basic units.
    pub throughput: Throughput,
    /// First of its lobes in the sub-path.
    pub(super) first_lobe: u32,
    /// Number of its lobes.
    pub(super) lobes: u8,
    /// Some lobe is non-specular: the vertex can be connected.
    pub has_non_specular: bool,
    /// Some lobe is specular.
    pub has_specular: bool,
    /// All lobes send light alike in all directions.
    pub is_lambertian: bool,
}

// an upper bound on what a walk writes and a connection reads per vertex: four lines of cache
const _: () = assert!(size_of::<Vertex>() < 256);

impl Vertex {
    /// The vertex as an end point.
    #[must_use]
    pub fn end_point(&self) -> EndPoint {
        EndPoint {
            n: self.ng,
            surface: Some(self.id),
            ..EndPoint::at(self.p)
        }
    }

    /// Cosine between `w` and the geometric normal, which conversions of densities to area take.
    #[must_use]
    pub fn cos(&self, w: DVec3) -> f64 {
        w.dot(self.ng).abs()
    }

    /// Cosine between `w` and the shading normal, which kernels take.
    #[must_use]
    pub fn shading_cos(&self, w: DVec3) -> f64 {
        w.dot(self.frame.z).abs()
    }

    /// The medium in which unit direction `w` leaves the vertex.
    #[must_use]
    pub fn medium(&self, w: DVec3) -> MediumId {
        self.media[self.side(w)]
    }

    /// 0 on the side the normal points to, 1 on the other.
    fn side(&self, w: DVec3) -> usize {
        usize::from(self.ng.dot(w) < 0.0)
    }

    /// Whether the geometric and the shading normal agree about the side of `w`. Where they do not,
    /// nothing is scattered.
    #[must_use]
    pub fn sides_agree(&self, w: DVec3) -> bool {
        self.ng.dot(w) * self.frame.z.dot(w) > 0.0
    }

    /// `|ω⁻·n_s| / |ω⁻·n_g|`: what interpolated normals put on every vertex, always for the light
    /// side's direction. [theory (1.10)]
    #[must_use]
    pub fn light_side_correction(&self, w_light: DVec3) -> f64 {
        if self.frame.z == self.ng {
            1.0
        } else {
            (w_light.dot(self.frame.z) / w_light.dot(self.ng)).abs()
        }
    }
}

/// Scattering at a vertex between unit directions of world space.
#[derive(Clone, Copy, Debug)]
pub struct Scatterer<'a> {
    frame: &'a Frame,
    /// Lobes and indices, in the local frame.
    pub bsdf: Bsdf<'a>,
}

impl Scatterer<'_> {
    /// Value and densities of the non-specular label: [`Bsdf::eval`].
    #[must_use]
    #[inline]
    pub fn eval(&self, w_light: DVec3, w_camera: DVec3) -> BsdfEval {
        self.bsdf
            .eval(self.frame.to_local(w_light), self.frame.to_local(w_camera))
    }

    /// The kernel of the specular label that the sides of both directions select, and the
    /// probabilities of that label for ω⁻ and for ω⁺. `None` outside the cone.
    #[must_use]
    pub fn specular(
        &self,
        w_light: DVec3,
        w_camera: DVec3,
        cone: &Cone,
    ) -> Option<(SpecularKernel, [f64; 2])> {
        let directions = [w_light, w_camera].map(|w| self.frame.to_local(w));
        let found = specular_kernel(&self.bsdf, directions[0], directions[1], cone)?;
        let probability = |w| self.bsdf.label_probability(found.label, w);
        Some((found, directions.map(probability)))
    }

    /// Draws the direction of side `generate` for the `given` one, from the label and two numbers:
    /// [`Bsdf::sample`], but in world space.
    #[must_use]
    #[inline(always)]
    pub fn sample(&self, given: DVec3, generate: Side, u: [f64; 3]) -> Option<BsdfSample> {
        if let Some(found) = self.bsdf.sample_clear(given, self.frame.z, u[0]) {
            return found;
        }
        let local = self.frame.to_local(given);
        let mut sample = self.bsdf.sample_lobes(local, generate, u)?;
        sample.w = self.frame.to_outer(sample.w);
        Some(sample)
    }

    /// The same for a specular label that is given: [`Bsdf::sample_label`].
    #[must_use]
    pub fn sample_label(&self, given: DVec3, label: Label) -> Option<BsdfSample> {
        let mut sample = self.bsdf.sample_label(self.frame.to_local(given), label)?;
        sample.w = self.frame.to_outer(sample.w);
        Some(sample)
    }
}

/// A camera sub-path's arrival at a surface that emits.
#[derive(Clone, Copy, Debug)]
pub struct LightHit {
    /// Index of the vertex there.
    pub vertex: usize,
    /// The light.
    pub light: LightId,
    /// Texture coordinates of the point.
    pub uv: DVec2,
}

/// A light sub-path's arrival at a detector.
#[derive(Clone, Debug)]
pub struct SensorHit {
    /// The detector: which sensor of the scene, by index.
    pub sensor: usize,
    /// Number of scattering vertices before.
    pub depth: usize,
    /// The point on the detector, as an end point.
    pub x_sensor: EndPoint,
    /// Where on the film.
    pub raster: DVec2,
    /// `W_e` there.
    pub importance: f64,
    /// Unit direction back along the arriving segment.
    pub toward_previous: DVec3,
    /// Length of the arriving segment.
    pub distance: f64,
    /// Medium of the arriving segment.
    pub medium: MediumId,
    /// Density of the point.
    pub density: VertexDensity,
    /// Weight up to and including the arrival.
    pub throughput: Throughput,
}

/// A scattering vertex of a whole path: how it scatters, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// Label.
    pub label: Label,
    /// The surface.
    pub surface: InstanceId,
}

/// A sub-path's escape from the scene. Its density (per solid angle) is the last one of the
/// sub-path.
#[derive(Clone, Copy, Debug)]
pub struct Escape {
    /// Unit direction of travel.
    pub direction: DVec3,
    /// Medium of the last segment.
    pub medium: MediumId,
    /// Weight.
    pub throughput: Throughput,
}

/// A sub-path from a light or from the sensor. Vertex i of `vertices` has its densities in
/// `densities[i + 1]`; `densities[0]` belongs to the end point.
#[derive(Clone, Debug)]
pub struct Subpath {
    /// Where it starts.
    pub origin: EndPoint,
    /// The light it starts from (light sub-paths).
    pub light: Option<LightId>,
    /// Density of that start by direct sampling from the first vertex, known once that is (light
    /// sub-paths).
    pub direct: f64,
    /// Scattering vertices.
    pub vertices: Vec<Vertex>,
    /// Densities of all vertices, the start included.
    pub densities: Vec<VertexDensity>,
    /// Per-lane densities of the vertices that have them.
    pub columns: Vec<Column>,
    /// (weight, lobe) pairs of all vertices.
    pub lobes: Vec<(f32, Lobe)>,
    /// The one that all clear smooth interfaces share, once there is any.
    pub(super) clear: Option<u32>,
    /// The solids around each part of it, the start first.
    pub(super) stacks: Vec<MediumStack>,
    /// Emitting surfaces that a camera sub-path arrived at, in its order.
    pub light_hits: Vec<LightHit>,
    /// Detector hits of a light sub-path.
    pub sensor_hits: Vec<SensorHit>,
    /// Escape from the scene, if it left.
    pub escape: Option<Escape>,
    /// Chains of all wavelengths to one of its vertices (camera sub-paths).
    pub fan: Option<Fan>,
    /// A buffer for lobes.
    pub(super) spare: Vec<(f32, Lobe)>,
}

impl Default for Subpath {
    fn default() -> Self {
        Self {
            origin: EndPoint::NONE,
            light: None,
            direct: 0.0,
            vertices: Vec::new(),
            densities: Vec::new(),
            columns: Vec::new(),
            lobes: Vec::new(),
            clear: None,
            stacks: Vec::new(),
            light_hits: Vec::new(),
            sensor_hits: Vec::new(),
            escape: None,
            fan: None,
            spare: Vec::new(),
        }
    }
}

impl Subpath {
    /// Empties it for a new start, in the solids of `stack`; buffers are kept.
    pub fn restart(
        &mut self,
        origin: EndPoint,
        stack: &MediumStack,
        light: Option<LightId>,
        pdf: f64,
    ) {
        self.origin = origin;
        self.stacks.clear();
        self.stacks.push(*stack);
        self.light = light;
        self.direct = 0.0;
        self.vertices.clear();
        self.densities.clear();
        self.columns.clear();
        self.lobes.clear();
        self.clear = None;
        self.light_hits.clear();
        self.sensor_hits.clear();
        self.escape = None;
        self.fan = None;
        self.densities.push(VertexDensity::new(pdf));
    }

    /// Arrivals at one detector of the scene, from the light on.
    pub fn hits_of(&self, sensor: usize) -> impl Iterator<Item = &SensorHit> {
        self.sensor_hits.iter().filter(move |h| h.sensor == sensor)
    }

    /// Of two things, the one `before` a vertex and the one `after` it on this sub-path, that of
    /// the light side first.
    #[must_use]
    pub fn ordered<T>(&self, before: T, after: T) -> (T, T) {
        if self.light.is_some() {
            (before, after)
        } else {
            (after, before)
        }
    }

    /// The solids its start is in.
    #[must_use]
    pub fn start_stack(&self) -> &MediumStack {
        &self.stacks[0]
    }

    /// The solids in which unit direction `w` leaves vertex `i`.
    #[must_use]
    pub fn stack(&self, i: usize, w: DVec3) -> &MediumStack {
        let vertex = &self.vertices[i];
        &self.stacks[vertex.stacks[vertex.side(w)] as usize]
    }

    /// Scattering at vertex `i`.
    #[must_use]
    #[inline(always)]
    pub fn scatterer<'a>(&'a self, i: usize, context: &PathContext<'a>) -> Scatterer<'a> {
        let vertex = &self.vertices[i];
        self.scatterer_between(i, context.interface(vertex.media, vertex.id.instance))
    }

    /// The same where the interface of the vertex is known.
    #[must_use]
    #[inline(always)]
    pub(super) fn scatterer_between<'a>(
        &'a self,
        i: usize,
        interface: Interface<'a>,
    ) -> Scatterer<'a> {
        let vertex = &self.vertices[i];
        let first = vertex.first_lobe as usize;
        Scatterer {
            frame: &vertex.frame,
            bsdf: Bsdf {
                lobes: &self.lobes[first..first + usize::from(vertex.lobes)],
                interface,
            },
        }
    }

    /// Density of vertex `i` (0: the end point) from its own side, of all lanes.
    #[must_use]
    pub fn own_density(&self, i: usize) -> EdgeDensity {
        let density = &self.densities[i];
        self.with_column(density.own, density.own_column)
    }

    /// Density of vertex `i` from the other side; it is known once the sub-path has two further
    /// vertices.
    #[must_use]
    pub fn other_density(&self, i: usize) -> EdgeDensity {
        let density = &self.densities[i];
        self.with_column(density.other, density.other_column)
    }

    fn with_column(&self, hero: f64, column: u32) -> EdgeDensity {
        EdgeDensity {
            hero,
            lanes: self.columns.get(column as usize).copied(),
        }
    }

    /// Jacobian from solid angle at vertex `i` to the measure of the vertex before it; `at_end`
    /// gives it for the start.
    #[must_use]
    pub fn factor_before(&self, i: usize, at_end: impl FnOnce() -> f64) -> f64 {
        let vertex = &self.vertices[i];
        match i.checked_sub(1) {
            Some(previous) => {
                let cos = self.vertices[previous].cos(vertex.toward_previous);
                cos / (vertex.distance * vertex.distance)
            }
            None => at_end(),
        }
    }

    /// Stores the solids of a part of the sub-path; where.
    #[inline]
    pub(super) fn store_stack(&mut self, stack: &MediumStack) -> u32 {
        self.stacks.push(*stack);
        (self.stacks.len() - 1) as u32
    }

    /// The lobe of a clear smooth interface; where.
    #[inline]
    pub(super) fn clear_lobe(&mut self) -> u32 {
        let lobes = &mut self.lobes;
        *self.clear.get_or_insert_with(|| {
            lobes.push((1.0, Lobe::Dielectric(Dielectric::CLEAR)));
            (lobes.len() - 1) as u32
        })
    }

    /// Stores a density's columns, if it has any.
    pub fn store_column(&mut self, density: &EdgeDensity) -> u32 {
        match density.lanes {
            None => NO_COLUMN,
            Some(lanes) => {
                self.columns.push(lanes);
                (self.columns.len() - 1) as u32
            }
        }
    }
}
