//! Merging: a camera vertex takes the photons around it for its own.

use super::Joiner;
use crate::bsdf::BsdfEval;
use crate::light::LightId;
use crate::spectrum::MAX_LANES;
use crate::transport::class::PathClass;
use crate::transport::context::Counters;
use crate::transport::contribution::{Contribution, Target};
use crate::transport::density::{Edge, EdgeDensity, NO_COLUMN, PathView};
use crate::transport::merge::{MergeSide, is_separable, merge_factors, side_terms};
use crate::transport::mis::{Multipliers, merge_denominator};
use crate::transport::photons::PhotonMap;
use crate::transport::subpath::Subpath;

/// The photons of a pass, and how to have the whole sub-path of one.
pub struct Photons<'a> {
    /// The map.
    pub map: &'a PhotonMap,
    /// Whether the sub-path of this number is one to be merged with; `None`: all are.
    pub accepts: Option<&'a dyn Fn(u32) -> bool>,
    /// Traces the sub-path of this number again.
    pub retrace: &'a dyn Fn(u32, &mut Subpath, &mut Counters),
    /// Where to.
    pub retraced: &'a mut Subpath,
}

/// Contribution of camera vertex `j` with photons of light sub-paths of any length.
fn merged(lanes: [f64; MAX_LANES], j: usize) -> Contribution {
    Contribution {
        t: j as u32 + 2,
        merged: true,
        class: PathClass::new(),
        ..Contribution::sum(Target::OwnPixel, lanes)
    }
}

impl Joiner<'_> {
    /// Merges camera vertex `j` with all photons near it.
    pub fn gather(&mut self, photons: &mut Photons, camera: &Subpath, j: usize) {
        let vertex = &camera.vertices[j];
        let first_only = self.strategies.merges_first_only();
        let specular = |i: usize| camera.densities[i + 1].label.is_specular();
        // a sequence has specular vertices alone
        if self.context.held.is_some()
            || j + 1 > self.max_depth
            || !vertex.has_non_specular
            || !vertex.sides_agree(vertex.toward_previous)
            || first_only && !(0..j).all(specular)
        {
            return;
        }
        let own = &camera.densities[..j + 2];
        let factor = self.before_factor(camera, j);
        let sensor = side_terms(own, factor, MergeSide::Sensor, self.strategies);
        let columns = own.iter().any(|v| v.own_column != NO_COLUMN)
            || own[..j].iter().any(|v| v.other_column != NO_COLUMN);
        let whole = columns || !is_separable(self.strategies);
        let (count, samples) = (self.context.count(), self.strategies.merge_samples());
        let scatterer = camera.scatterer(j, self.context);
        let (map, accepts) = (photons.map, photons.accepts);
        let (mut found, mut sum) = (false, [0.0; MAX_LANES]);
        map.for_each_near(vertex.p, |photon| {
            let depth = photon.depth();
            if depth + 1 + j > self.max_depth || !accepts.is_none_or(|f| f(photon.path())) {
                return;
            }
            let w = photon.toward_previous();
            if !vertex.sides_agree(w) {
                return;
            }
            self.counters.photons_found += 1;
            let eval = scatterer.eval(w, vertex.toward_previous);
            if eval.g.is_black(count) {
                return;
            }
            let terms = photon.terms();
            let factors = if whole || photon.has_columns() || eval.columns.is_some() {
                (photons.retrace)(photon.path(), photons.retraced, self.counters);
                self.whole_path_factors(photons.retraced, depth, (camera, j), &eval)
            } else {
                let toward = (eval.pdf_light, eval.pdf_camera);
                let (own, waves) = (self.strategies, &self.context.wavelengths);
                merge_factors(&terms, &sensor, toward, own, waves)
            };
            let scale = vertex.throughput.scale * vertex.light_side_correction(w);
            let (mut values, mut lanes) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
            for (k, weight) in photon.weight().enumerate() {
                let numerator = vertex.throughput.lanes[k] * weight * eval.g[k];
                values[k] = scale * f64::from(numerator);
                lanes[k] = values[k] * factors[k];
            }
            if !lanes.iter().all(|v| v.is_finite()) {
                self.counters.non_finite += 1;
                return;
            }
            if self.detailed {
                let mut class = photon.class();
                class.push(false);
                (0..j).rev().for_each(|i| class.push(specular(i)));
                let whole_set = !sensor.dispersive && !terms.dispersive;
                self.out.push(Contribution {
                    raw: if self.with_raw {
                        self.raw(|k| values[k], samples, whole_set, 1.0)
                    } else {
                        [0.0; MAX_LANES]
                    },
                    s: depth as u32 + 2,
                    class,
                    ..merged(lanes, j)
                });
            } else {
                found = true;
                for (total, lane) in sum.iter_mut().zip(lanes) {
                    *total += lane;
                }
            }
        });
        if found {
            self.out.push(merged(sum, j));
        }
    }

    /// The factors of all lanes by the sum over the whole path: where densities differ between
    /// lanes, or techniques depend on more than one side tells.
    fn whole_path_factors(
        &mut self,
        light: &Subpath,
        i: usize,
        (camera, j): (&Subpath, usize),
        eval: &BsdfEval,
    ) -> [f64; MAX_LANES] {
        let mut factors = [0.0; MAX_LANES];
        if i >= light.vertices.len() {
            return factors;
        }
        let (forward, backward) = EdgeDensity::of(eval);
        // the merged vertex is the last of the light sub-path, and that before it on the camera
        // sub-path is joined to it
        let behind = &camera.densities[j];
        let edge = Edge {
            light_end: camera.own_density(j + 1),
            light_before: backward.scaled(self.before_factor(light, i)),
            camera_end: forward.scaled(self.before_factor(camera, j)),
            camera_before: match j.checked_sub(1) {
                Some(before) => camera.other_density(before),
                None => EdgeDensity::default(),
            },
            camera_label: behind.label,
            camera_dispersive: behind.dispersive,
            length: camera.densities[j + 1].length,
            ..Edge::default()
        };
        let view = PathView {
            light: &light.densities[..i + 2],
            camera: &camera.densities[..=j],
            light_columns: &light.columns,
            camera_columns: &camera.columns,
            edge,
            direct: light.direct,
            hittable_light: self.is_hittable(light.light),
            bridges: [None; 2],
            made: None,
            fan: None,
            emitter: light.light.unwrap_or(LightId(0)),
            raster: self.raster,
        };
        let multipliers = Multipliers::new(&view, self.strategies);
        let weights = merge_denominator(
            &multipliers,
            &self.context.wavelengths,
            &mut self.scratch.suffix,
        );
        for (k, factor) in factors.iter_mut().enumerate().take(self.context.count()) {
            *factor = weights.factor(k);
        }
        factors
    }
}
