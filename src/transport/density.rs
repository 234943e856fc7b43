//! Densities of the vertices of a path, as every strategy needs them.
//!
//! A path x₀ … x_{n−1} runs from the light to the sensor. `pf_i` is the density of x_i when it is
//! generated from the light side, `pr_i` when it is generated from the sensor side. The 1/A of
//! specular vertices is left out of both (their label probability q stands alone), so every density
//! is a finite number and deltas need no flags.

use super::aim::tries::Origin;
use crate::bsdf::{BsdfEval, Label, LaneDensity};
use crate::geometry::DirectionalDensity;
use crate::light::LightId;
use crate::spectrum::MAX_LANES;
use glam::DVec2;

/// Per-lane densities of one vertex.
pub type Column = [f64; MAX_LANES];

/// Marks the absence of a column.
pub const NO_COLUMN: u32 = u32::MAX;

/// Densities and label of one vertex of a sub-path, as the weights need them.
#[derive(Clone, Copy, Debug)]
pub struct VertexDensity {
    /// Hero's density of this vertex as it was generated, from its own side.
    pub own: f64,
    /// Hero's density had it been generated from the opposite side. Known once two further vertices
    /// exist.
    pub other: f64,
    /// Index of the per-lane version of `own` in the sub-path's columns, or [`NO_COLUMN`] where all
    /// lanes agree.
    pub own_column: u32,
    /// The same for `other`.
    pub other_column: u32,
    /// Distance to the vertex generated before; infinite from a light at infinity. f32 suffices:
    /// only compared.
    pub length: f32,
    /// Label drawn here (end points: non-specular).
    pub label: Label,
    /// A specular transmission whose direction depends on wavelength.
    pub dispersive: bool,
}

impl VertexDensity {
    /// A vertex of known own density, nothing else known yet.
    #[must_use]
    pub fn new(own: f64) -> Self {
        Self {
            own,
            other: 0.0,
            own_column: NO_COLUMN,
            other_column: NO_COLUMN,
            length: f32::INFINITY,
            label: Label::NonSpecular,
            dispersive: false,
        }
    }
}

/// A density with its per-lane version where lanes differ.
#[derive(Clone, Copy, Debug, Default)]
pub struct EdgeDensity {
    /// Hero's.
    pub hero: f64,
    /// Every lane's.
    pub lanes: Option<Column>,
}

impl EdgeDensity {
    /// The same for all lanes.
    #[must_use]
    pub fn uniform(hero: f64) -> Self {
        Self { hero, lanes: None }
    }

    /// Every lane's where there are any.
    #[must_use]
    pub fn with_lanes(hero: f64, lanes: Option<&LaneDensity>) -> Self {
        Self {
            hero,
            lanes: lanes.map(|l| l.lanes),
        }
    }

    /// Densities of direction of an evaluated vertex: ω⁺ given ω⁻, and ω⁻ given ω⁺.
    #[must_use]
    pub fn of(eval: &BsdfEval) -> (Self, Self) {
        let columns = eval.columns.as_ref();
        (
            Self::with_lanes(eval.pdf_camera, columns.map(|c| &c.0)),
            Self::with_lanes(eval.pdf_light, columns.map(|c| &c.1)),
        )
    }

    /// Times a geometric factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            hero: self.hero * factor,
            lanes: self.lanes.map(|l| l.map(|v| v * factor)),
        }
    }
}

/// Density of the direction in which an edge leaves a vertex.
#[derive(Clone, Copy, Debug)]
pub enum Departure {
    /// An end point of a path.
    Start(DirectionalDensity),
    /// A scattering vertex, per solid angle.
    Scattered(EdgeDensity),
}

impl Departure {
    /// Area density of the next vertex, at distance² `d2`, whose geometric normal makes `cos` with
    /// the edge. [theory (2.1)]
    #[must_use]
    pub fn area_density(&self, cos: f64, d2: f64) -> EdgeDensity {
        match self {
            Self::Start(pdf) => EdgeDensity::uniform(pdf.area_density(cos, d2)),
            Self::Scattered(pdf) => pdf.scaled(cos / d2),
        }
    }

    /// Density of the direction itself.
    #[must_use]
    pub fn solid_angle(&self) -> EdgeDensity {
        match self {
            Self::Start(
                DirectionalDensity::SolidAngle(pdf) | DirectionalDensity::Perpendicular(pdf),
            ) => EdgeDensity::uniform(*pdf),
            Self::Scattered(pdf) => *pdf,
        }
    }
}

/// The four densities that exist only once two sub-paths are joined, and the labels of the joined
/// vertices.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// `pr_{s−1}`: the last light vertex generated from the sensor side.
    pub light_end: EdgeDensity,
    /// `pr_{s−2}`.
    pub light_before: EdgeDensity,
    /// `pf_s`: the last camera vertex generated from the light side.
    pub camera_end: EdgeDensity,
    /// `pf_{s+1}`.
    pub camera_before: EdgeDensity,
    /// Label of x_{s−1} on this path.
    pub light_label: Label,
    /// Label of x_s on this path.
    pub camera_label: Label,
    /// Length of the joining edge.
    pub length: f32,
    /// x_{s−1} is a regularized transmission whose direction depends on wavelength.
    pub light_dispersive: bool,
    /// The same for x_s.
    pub camera_dispersive: bool,
}

impl Default for Edge {
    fn default() -> Self {
        Self {
            light_end: EdgeDensity::default(),
            light_before: EdgeDensity::default(),
            camera_end: EdgeDensity::default(),
            camera_before: EdgeDensity::default(),
            light_label: Label::NonSpecular,
            camera_label: Label::NonSpecular,
            length: f32::INFINITY,
            light_dispersive: false,
            camera_dispersive: false,
        }
    }
}

/// A chain of specular vertices x_{a+1} … x_{b−1} that can be solved for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bridge {
    /// Last vertex made from the light side.
    pub a: usize,
    /// First vertex made from the sensor side.
    pub b: usize,
    /// Density of the chain in units in which specular densities leave out 1/A: the true one is 1.
    pub k: f64,
    /// Times it is tried per pixel and pass.
    pub samples: f64,
    /// Kind of its chain, by index.
    pub kind: u32,
    /// Where it is solved from.
    pub origin: Origin,
}

/// The chain of specular vertices x_{at+1} … x_{n−2} of a path whose lanes each have their own
/// ([`Fan`](super::aim::fan::Fan)): it disperses, and still all lanes go on from x_at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fanned {
    /// Vertex where the lanes meet.
    pub at: usize,
    /// Factor by lane in place of 1, where lanes share one chain.
    pub shares: Column,
}

/// A full path as the strategy that made it sees it: two sub-paths and the edge between them.
#[derive(Clone, Copy, Debug)]
pub struct PathView<'a> {
    /// x₀ … x_{s−1}, in this order. `own` = pf, `other` = pr.
    pub light: &'a [VertexDensity],
    /// x_{n−1} … x_s, in this order. `own` = pr, `other` = pf.
    pub camera: &'a [VertexDensity],
    /// Columns of the light sub-path.
    pub light_columns: &'a [Column],
    /// Columns of the camera sub-path.
    pub camera_columns: &'a [Column],
    /// Densities and labels that only the joint has.
    pub edge: Edge,
    /// Density of x₀ under the direct sampling of strategy s = 1.
    pub direct: f64,
    /// Camera sub-paths can hit the light.
    pub hittable_light: bool,
    /// Those of its chains, at the light and at the sensor, that are solved for.
    pub bridges: [Option<Bridge>; 2],
    /// The one of these that made the path; the edge is then the last one of its chain.
    pub made: Option<Bridge>,
    /// Chain at the sensor, where lanes have their own.
    pub fan: Option<Fanned>,
    /// The light of x₀.
    pub emitter: LightId,
    /// Where on the film the path is seen.
    pub raster: DVec2,
}

impl PathView<'_> {
    /// Vertices from the light.
    #[must_use]
    pub fn s(&self) -> usize {
        self.light.len()
    }

    /// All vertices.
    #[must_use]
    pub fn len(&self) -> usize {
        self.light.len() + self.camera.len()
    }

    /// Density with which the executed technique generated x_i; 1 for the vertices of a chain
    /// solved for.
    #[must_use]
    pub fn generated(&self, i: usize) -> f64 {
        match self.made {
            Some(bridge) if i <= bridge.a => self.pf(i),
            Some(bridge) if i < bridge.b => 1.0,
            Some(_) => self.pr(i),
            None if i == 0 && self.s() == 1 => self.direct,
            None if i < self.s() => self.pf(i),
            None => self.pr(i),
        }
    }

    /// Whether there is no vertex at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Hero's `pf_i`.
    #[must_use]
    pub fn pf(&self, i: usize) -> f64 {
        let s = self.s();
        if i < s {
            return self.light[i].own;
        }
        match i - s {
            0 => self.edge.camera_end.hero,
            1 => self.edge.camera_before.hero,
            _ => self.camera[self.len() - 1 - i].other,
        }
    }

    /// Hero's `pr_i`.
    #[must_use]
    pub fn pr(&self, i: usize) -> f64 {
        let s = self.s();
        if i >= s {
            return self.camera[self.len() - 1 - i].own;
        }
        match s - 1 - i {
            0 => self.edge.light_end.hero,
            1 => self.edge.light_before.hero,
            _ => self.light[i].other,
        }
    }

    /// Lane `k`'s `pf_i`.
    #[must_use]
    pub fn pf_lane(&self, i: usize, k: usize) -> f64 {
        let s = self.s();
        let stored = |hero: f64, column: u32, columns: &[Column]| {
            if column == NO_COLUMN {
                hero
            } else {
                columns[column as usize][k]
            }
        };
        if i < s {
            let v = &self.light[i];
            return stored(v.own, v.own_column, self.light_columns);
        }
        match i - s {
            0 => self.edge.camera_end.lane(k),
            1 => self.edge.camera_before.lane(k),
            _ => {
                let v = &self.camera[self.len() - 1 - i];
                stored(v.other, v.other_column, self.camera_columns)
            }
        }
    }

    /// Lane `k`'s `pr_i`.
    #[must_use]
    pub fn pr_lane(&self, i: usize, k: usize) -> f64 {
        let s = self.s();
        let stored = |hero: f64, column: u32, columns: &[Column]| {
            if column == NO_COLUMN {
                hero
            } else {
                columns[column as usize][k]
            }
        };
        if i >= s {
            let v = &self.camera[self.len() - 1 - i];
            return stored(v.own, v.own_column, self.camera_columns);
        }
        match s - 1 - i {
            0 => self.edge.light_end.lane(k),
            1 => self.edge.light_before.lane(k),
            _ => {
                let v = &self.light[i];
                stored(v.other, v.other_column, self.light_columns)
            }
        }
    }

    /// Whether any density of the path differs between lanes.
    #[must_use]
    pub fn has_columns(&self) -> bool {
        let edge = &self.edge;
        let has = |v: &VertexDensity| v.own_column != NO_COLUMN || v.other_column != NO_COLUMN;
        edge.light_end.lanes.is_some()
            || edge.light_before.lanes.is_some()
            || edge.camera_end.lanes.is_some()
            || edge.camera_before.lanes.is_some()
            || !self.light_columns.is_empty() && self.light.iter().any(has)
            || !self.camera_columns.is_empty() && self.camera.iter().any(has)
    }

    /// Length of the edge from x_{i−1} to x_i, 1 <= i < n.
    #[must_use]
    pub fn edge_length(&self, i: usize) -> f32 {
        match i.cmp(&self.s()) {
            std::cmp::Ordering::Less => self.light[i].length,
            std::cmp::Ordering::Equal => self.edge.length,
            std::cmp::Ordering::Greater => self.camera[self.len() - i].length,
        }
    }

    /// Whether any vertex is specular.
    #[must_use]
    pub fn has_specular(&self) -> bool {
        let inner = |path: &[VertexDensity]| {
            let joined = path.len().saturating_sub(1);
            path[..joined].iter().any(|v| v.label.is_specular())
        };
        if self.light.is_empty() || self.camera.is_empty() {
            return self
                .light
                .iter()
                .chain(self.camera)
                .any(|v| v.label.is_specular());
        }
        self.edge.light_label.is_specular()
            || self.edge.camera_label.is_specular()
            || inner(self.light)
            || inner(self.camera)
    }

    /// Whether every scattering vertex is specular, of at least one.
    #[must_use]
    pub fn is_all_specular(&self) -> bool {
        let end = self.len() - 1;
        end > 1 && (1..end).all(|i| self.is_specular(i))
    }

    /// Number of vertices that are dispersive in the sense of [`Self::is_dispersive`].
    #[must_use]
    pub fn dispersive_count(&self) -> usize {
        (0..self.len()).filter(|&i| self.is_dispersive(i)).count()
    }

    /// Label of x_i.
    #[must_use]
    pub fn label(&self, i: usize) -> Label {
        let s = self.s();
        if i + 1 == s {
            self.edge.light_label
        } else if i == s {
            self.edge.camera_label
        } else if i < s {
            self.light[i].label
        } else {
            self.camera[self.len() - 1 - i].label
        }
    }

    /// Whether x_i carries a specular label.
    #[must_use]
    pub fn is_specular(&self, i: usize) -> bool {
        self.label(i).is_specular()
    }

    /// Whether x_i bends each lane its own way, and is met by the hero's alone.
    #[must_use]
    pub fn is_dispersive(&self, i: usize) -> bool {
        if self.fan.is_some_and(|fan| i > fan.at) {
            return false;
        }
        let s = self.s();
        if i + 1 == s {
            self.edge.light_dispersive
        } else if i == s {
            self.edge.camera_dispersive
        } else if i < s {
            self.light[i].dispersive
        } else {
            self.camera[self.len() - 1 - i].dispersive
        }
    }
}

impl EdgeDensity {
    fn lane(&self, k: usize) -> f64 {
        self.lanes.map_or(self.hero, |l| l[k])
    }
}
