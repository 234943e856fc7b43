//! Merging: a camera vertex takes the photons around it for its own.

use super::{Joiner, densities};
use crate::bsdf::BsdfEval;
use crate::scene::settings::IntegratorKind;
use crate::spectrum::{MAX_LANES, SampledSpectrum};
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
    /// Whether the sub-path of this number is one to be merged with.
    pub accepts: &'a dyn Fn(u32) -> bool,
    /// Traces the sub-path of this number again.
    pub retrace: &'a dyn Fn(u32, &mut Subpath, &mut Counters),
    /// Where to.
    pub retraced: &'a mut Subpath,
}

impl Joiner<'_> {
    /// Merges camera vertex `j` with all photons near it.
    pub fn gather(&mut self, photons: &mut Photons, camera: &Subpath, j: usize) {
        let vertex = &camera.vertices[j];
        let first_only = self.techniques.kind == IntegratorKind::Ppm;
        let specular = |i: usize| camera.densities[i + 1].label.is_specular();
        if j + 1 > self.max_depth
            || !vertex.bsdf.has_non_specular()
            || !vertex.sides_agree(vertex.toward_previous)
            || first_only && !(0..j).all(specular)
        {
            return;
        }
        let own = &camera.densities[..j + 2];
        let factor = self.camera_before_factor(camera, j);
        let sensor = side_terms(own, factor, MergeSide::Sensor, self.techniques);
        let columns = own.iter().any(|v| v.own_column != NO_COLUMN)
            || own[..j].iter().any(|v| v.other_column != NO_COLUMN);
        let whole = columns || !is_separable(self.techniques);
        let count = self.context.count();
        let w_camera = vertex.frame.to_local(vertex.toward_previous);
        let (map, accepts) = (photons.map, photons.accepts);
        let mut sum: Option<Contribution> = None;
        map.for_each_near(vertex.point.p, |photon, weight| {
            let depth = photon.depth();
            let w = photon.toward_previous();
            if depth + 1 + j > self.max_depth || !accepts(photon.path()) || !vertex.sides_agree(w) {
                return;
            }
            self.counters.photons_found += 1;
            let eval = vertex.bsdf.eval(vertex.frame.to_local(w), w_camera);
            if eval.g.is_black(count) {
                return;
            }
            let factors = if whole || photon.has_columns() || eval.columns.is_some() {
                (photons.retrace)(photon.path(), photons.retraced, self.counters);
                self.whole_path_factors(photons.retraced, depth, (camera, j), &eval)
            } else {
                let toward = (eval.pdf_light, eval.pdf_camera);
                let (own, waves) = (self.techniques, &self.context.wavelengths);
                merge_factors(&photon.terms(), &sensor, toward, own, waves)
            };
            let numerator = vertex.throughput.lanes * *weight * eval.g;
            let scale = vertex.throughput.scale * vertex.light_side_correction(w);
            let mut lanes = [0.0; MAX_LANES];
            for (k, lane) in lanes.iter_mut().enumerate().take(count) {
                *lane = scale * f64::from(numerator[k]) * factors[k];
            }
            if !lanes.iter().all(|v| v.is_finite()) {
                self.counters.non_finite += 1;
                return;
            }
            let whole_set = !sensor.dispersive && !photon.terms().dispersive;
            let contribution = Contribution {
                target: Target::OwnPixel,
                lanes,
                raw: self.raw_merge(scale, &numerator, whole_set),
                s: depth as u32 + 2,
                t: j as u32 + 2,
                regularized: 0,
                merged: true,
                class: PathClass::new(),
            };
            if self.detailed {
                let mut class = photon.class();
                class.push(false);
                (0..j).rev().for_each(|i| class.push(specular(i)));
                self.out.push(Contribution {
                    class,
                    ..contribution
                });
            } else if let Some(sum) = &mut sum {
                for (total, lane) in sum.lanes.iter_mut().zip(lanes) {
                    *total += lane;
                }
            } else {
                sum = Some(contribution);
            }
        });
        self.out.extend(sum);
    }

    /// What merging alone would estimate.
    fn raw_merge(
        &self,
        scale: f64,
        numerator: &SampledSpectrum,
        whole_set: bool,
    ) -> [f64; MAX_LANES] {
        let mut raw = [0.0; MAX_LANES];
        if self.with_raw {
            let count = self.context.count();
            for (k, value) in raw.iter_mut().enumerate().take(count) {
                let techniques = if whole_set {
                    count
                } else {
                    self.context.wavelengths.multiplicity(k)
                };
                *value =
                    scale * f64::from(numerator[k]) / (self.techniques.merging * techniques as f64);
            }
        }
        raw
    }

    /// The factors of all lanes by the sum over the whole path: where densities differ between lanes, or techniques depend on more
    /// than one side tells.
    fn whole_path_factors(
        &self,
        light: &Subpath,
        i: usize,
        (camera, j): (&Subpath, usize),
        eval: &BsdfEval,
    ) -> [f64; MAX_LANES] {
        let mut factors = [0.0; MAX_LANES];
        if i >= light.vertices.len() {
            return factors;
        }
        let (forward, backward) = densities(eval);
        // the merged vertex is the last of the light sub-path, and that before it on the camera sub-path is joined to it
        let behind = &camera.densities[j];
        let edge = Edge {
            light_end: camera.own_density(j + 1),
            light_before: self.light_before(light, i, &backward),
            camera_end: self.camera_before(camera, j, &forward),
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
            direct: self.direct_of(light),
            hittable_light: self.is_hittable(light.light),
        };
        let multipliers = Multipliers::new(&view, self.techniques);
        let weights = merge_denominator(&multipliers, &self.context.wavelengths);
        for (k, factor) in factors.iter_mut().enumerate().take(self.context.count()) {
            *factor = weights.factor(k);
        }
        factors
    }
}
