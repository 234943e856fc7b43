//! Sub-paths: contiguous, reusable, complete enough to be joined by any strategy.

use super::density::{Column, EdgeDensity, NO_COLUMN, VertexDensity};
use super::throughput::Throughput;
use crate::bsdf::Bsdf;
use crate::geometry::{EndPoint, SurfacePoint};
use crate::light::LightId;
use crate::math::frame::Frame;
use crate::medium::{MediumId, Region};
use glam::{DVec2, DVec3};

/// A scattering vertex of a sub-path.
#[derive(Clone, Debug)]
pub struct Vertex {
    /// Local geometry.
    pub point: SurfacePoint,
    /// Basis around the shading normal.
    pub frame: Frame,
    /// What scatters there.
    pub bsdf: Bsdf,
    /// The media on the side the normal points to, and on the other.
    pub regions: [Region; 2],
    /// Unit direction towards the previous vertex.
    pub toward_previous: DVec3,
    /// Distance to the previous vertex; infinite if that is a light at infinity.
    pub distance: f64,
    /// Weight up to and including the arrival here, in basic units.
    pub throughput: Throughput,
    /// The light this surface is, if it emits.
    pub light: Option<LightId>,
}

impl Vertex {
    /// The region in which unit direction `w` leaves the vertex.
    #[must_use]
    pub fn region(&self, w: DVec3) -> &Region {
        &self.regions[usize::from(self.point.ng.dot(w) < 0.0)]
    }

    /// Whether the geometric and the shading normal agree about the side of `w`. Where they do not, nothing is scattered.
    #[must_use]
    pub fn sides_agree(&self, w: DVec3) -> bool {
        self.point.ng.dot(w) * self.point.ns.dot(w) > 0.0
    }

    /// `|ω⁻·n_s| / |ω⁻·n_g|`: what interpolated normals put on every vertex, always for the light side's direction.
    #[must_use]
    pub fn light_side_correction(&self, w_light: DVec3) -> f64 {
        if self.point.ns == self.point.ng {
            1.0
        } else {
            (w_light.dot(self.point.ns) / w_light.dot(self.point.ng)).abs()
        }
    }
}

/// A light sub-path's arrival at a detector.
#[derive(Clone, Debug)]
pub struct SensorHit {
    /// How many scattering vertices came before.
    pub depth: usize,
    /// The point on the detector, as an end point.
    pub xk: EndPoint,
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

/// A sub-path's escape from the scene. Its density (per solid angle) is the last one of the sub-path.
#[derive(Clone, Copy, Debug)]
pub struct Escape {
    /// Unit direction of travel.
    pub direction: DVec3,
    /// Medium of the last segment.
    pub medium: MediumId,
    /// Weight.
    pub throughput: Throughput,
}

/// A sub-path from a light or from the sensor. Vertex i of `vertices` has its densities in `densities[i + 1]`; `densities[0]`
/// belongs to the end point.
#[derive(Clone, Debug)]
pub struct Subpath {
    /// Where it starts.
    pub origin: EndPoint,
    /// Medium at the start.
    pub region: Region,
    /// The light it starts from (light sub-paths).
    pub light: Option<LightId>,
    /// Density of that start by direct sampling from the first vertex, known once that is (light sub-paths).
    pub direct: f64,
    /// Scattering vertices.
    pub vertices: Vec<Vertex>,
    /// Densities of all vertices, the start included.
    pub densities: Vec<VertexDensity>,
    /// Per-lane densities of the vertices that have them.
    pub columns: Vec<Column>,
    /// Detector hits of a light sub-path.
    pub sensor_hits: Vec<SensorHit>,
    /// How it left the scene, if it did.
    pub escape: Option<Escape>,
}

impl Default for Subpath {
    fn default() -> Self {
        Self {
            origin: EndPoint {
                p: DVec3::ZERO,
                n: DVec3::ZERO,
                surface: None,
                infinite: false,
            },
            region: Region {
                medium: MediumId::AMBIENT,
                rank: None,
            },
            light: None,
            direct: 0.0,
            vertices: Vec::new(),
            densities: Vec::new(),
            columns: Vec::new(),
            sensor_hits: Vec::new(),
            escape: None,
        }
    }
}

impl Subpath {
    /// Empties it for a new start; buffers are kept.
    pub fn restart(&mut self, origin: EndPoint, region: Region, light: Option<LightId>, pdf: f64) {
        self.origin = origin;
        self.region = region;
        self.light = light;
        self.direct = 0.0;
        self.vertices.clear();
        self.densities.clear();
        self.columns.clear();
        self.sensor_hits.clear();
        self.escape = None;
        self.densities.push(VertexDensity::new(pdf));
    }

    /// Density of vertex `i` (0: the end point) from its own side, of all lanes.
    #[must_use]
    pub fn own_density(&self, i: usize) -> EdgeDensity {
        let density = &self.densities[i];
        self.with_column(density.own, density.own_column)
    }

    /// Density of vertex `i` from the other side; it is known once the sub-path has two further vertices.
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

    /// What turns a density of direction at vertex `i` into a density of the vertex before it; `at_end` says so of the start.
    #[must_use]
    pub fn factor_before(&self, i: usize, at_end: impl FnOnce() -> f64) -> f64 {
        let vertex = &self.vertices[i];
        match i.checked_sub(1) {
            Some(previous) => {
                let normal = self.vertices[previous].point.ng;
                vertex.toward_previous.dot(normal).abs() / (vertex.distance * vertex.distance)
            }
            None => at_end(),
        }
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
