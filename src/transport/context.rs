//! Shared state of a pass and of a path pair, and counters.

use super::regularize::Cone;
use crate::bsdf::{CoatingLanes, Interface};
use crate::geometry::{EndPoint, InstanceId, Moment, Ray};
use crate::light::LightId;
use crate::medium::{Medium, MediumId, MediumKind, MediumLanes, MediumStack};
use crate::scene::sequence::Sequence;
use crate::scene::{Scene, SceneAt};
use crate::spectrum::{LaneResponse, SampledSpectrum, SampledWavelengths};
use glam::DVec3;

/// Wavelength and time that all paths of a pass share (merging needs both sub-paths to agree).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SharedSample {
    /// Primary wavelength number in [0, 1).
    pub u_wavelength: f64,
    /// The first so many wavelengths of the set take turns as heroes over the pixels; only paths of
    /// one hero are merged.
    pub heroes: u32,
    /// Fraction of the shutter.
    pub time: f64,
}

impl SharedSample {
    /// Which wavelength of the set is the hero of a pixel's paths: neighbors differ.
    #[must_use]
    pub fn hero(&self, (x, y): (u32, u32)) -> u32 {
        x.wrapping_add(y.wrapping_mul(3)) % self.heroes
    }
}

/// Settings shared by all paths of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassSettings {
    /// Global pass index.
    pub index: u32,
    /// Regularization of specular vertices at connections; `None`: they are not connectible.
    pub cone: Option<Cone>,
    /// Radius of photon merging in meters; `None`: no merging.
    pub merge_radius: Option<f64>,
    /// Wavelength and time for all paths; `None`: each path pair draws its own.
    pub shared: Option<SharedSample>,
    /// Weighted contributions below this much of Y meet Russian roulette before their shadow ray;
    /// 0: none do. Quiet cells of the film have a smaller one
    /// ([`Factors::roulette_bound`](super::Factors::roulette_bound)).
    pub roulette_threshold: f64,
}

/// Counters of a render, kept per thread and added up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Rays that look for the closest hit.
    pub closest_rays: u64,
    /// Rays that look for any hit.
    pub shadow_rays: u64,
    /// Path pairs.
    pub paths: u64,
    /// Connections whose kernels were evaluated.
    pub connections_tried: u64,
    /// Connections that contributed.
    pub connections_made: u64,
    /// Searches for chains between two ends; they are connections tried, too.
    pub chains_tried: u64,
    /// Chains that they found.
    pub chains_found: u64,
    /// Photons stored.
    pub photons: u64,
    /// Photons found near camera vertices.
    pub photons_found: u64,
    /// Contributions dropped because they were not finite.
    pub non_finite: u64,
    /// Chains solved for that their own path does not count: none, if solvers are right.
    pub lost_bridges: u64,
    /// Surfaces met from a side on which the walk was not: a solid left that was never entered, an
    /// interface whose named medium is not the one around.
    pub medium_mismatches: u64,
    /// Of the objects these surfaces belong to, the first in the scene.
    pub mismatched: Option<InstanceId>,
    /// Sub-paths cut because more solids were nested than a stack holds.
    pub nesting_overflows: u64,
    /// Small and large steps of Markov chains, whose samples are none of the path pairs.
    pub steps: [StepCount; 2],
}

/// Steps of Markov chains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCount {
    /// Steps tried.
    pub tried: u64,
    /// Steps accepted.
    pub accepted: u64,
}

impl StepCount {
    /// Counts one.
    pub fn count(&mut self, is_accepted: bool) {
        self.tried += 1;
        self.accepted += u64::from(is_accepted);
    }

    /// Share of those accepted; 0 without any.
    #[must_use]
    pub fn acceptance(&self) -> f64 {
        self.accepted as f64 / self.tried.max(1) as f64
    }
}

impl Counters {
    /// Notes a surface of `instance` that was met from an unexpected side.
    pub fn add_mismatch(&mut self, instance: InstanceId) {
        self.medium_mismatches += 1;
        self.mismatched = first(self.mismatched, Some(instance));
    }

    /// Adds another thread's counts.
    pub fn add(&mut self, other: &Self) {
        self.closest_rays += other.closest_rays;
        self.shadow_rays += other.shadow_rays;
        self.paths += other.paths;
        self.connections_tried += other.connections_tried;
        self.connections_made += other.connections_made;
        self.chains_tried += other.chains_tried;
        self.chains_found += other.chains_found;
        self.photons += other.photons;
        self.photons_found += other.photons_found;
        self.non_finite += other.non_finite;
        self.lost_bridges += other.lost_bridges;
        self.medium_mismatches += other.medium_mismatches;
        self.mismatched = first(self.mismatched, other.mismatched);
        self.nesting_overflows += other.nesting_overflows;
        for (ours, theirs) in self.steps.iter_mut().zip(other.steps) {
            ours.tried += theirs.tried;
            ours.accepted += theirs.accepted;
        }
    }
}

/// The first of two instances, either of which may be missing.
fn first(a: Option<InstanceId>, b: Option<InstanceId>) -> Option<InstanceId> {
    a.into_iter().chain(b).min()
}

/// Media and coatings of a scene at the wavelengths of a path.
#[derive(Debug, Default)]
pub struct MediaLanes {
    /// Lanes in use.
    count: usize,
    media: Vec<MediumLanes>,
    /// Of each material; empty where none has a coating.
    coatings: Vec<CoatingLanes>,
}

/// Properties of media and materials of a scene at all wavelengths.
#[derive(Debug, Default)]
struct Kinds {
    media: Vec<MediumKind>,
    /// Materials that have a coating.
    coated: Vec<usize>,
}

/// Sets of wavelengths that are remembered.
const REMEMBERED: usize = 16;

/// Memory for media and coatings of a scene: paths whose wavelengths are all emission lines have
/// one of a few sets of them, each of which is looked up once. A memory serves one scene only.
#[derive(Debug, Default)]
pub struct MediaMemory {
    sets: Vec<(SampledWavelengths, MediaLanes)>,
    /// The next one that another takes the place of.
    next: usize,
    /// Those of a path whose wavelengths are not remembered.
    others: MediaLanes,
    kinds: Option<Kinds>,
}

impl MediaMemory {
    /// Those of `scene` at the wavelengths of a path.
    pub fn at(&mut self, scene: &Scene, wavelengths: &SampledWavelengths) -> &MediaLanes {
        let kinds = self.kinds.get_or_insert_with(|| Kinds::of(scene));
        if !wavelengths.are_lines() {
            self.others.update(scene, kinds, wavelengths);
            return &self.others;
        }
        let known = |(known, _): &(SampledWavelengths, _)| known.are_those_of(wavelengths);
        if let Some(found) = self.sets.iter().position(known) {
            return &self.sets[found].1;
        }
        let place = self.next;
        self.next = (place + 1) % REMEMBERED;
        if place >= self.sets.len() {
            self.sets.push((*wavelengths, MediaLanes::default()));
        }
        let (known, lanes) = &mut self.sets[place];
        *known = *wavelengths;
        lanes.update(scene, kinds, wavelengths);
        lanes
    }
}

impl MediaLanes {
    /// Looks everything up at other wavelengths.
    fn update(&mut self, scene: &Scene, kinds: &Kinds, wavelengths: &SampledWavelengths) {
        let media = || scene.media.iter().zip(&kinds.media);
        if self.count != wavelengths.count() {
            self.count = wavelengths.count();
            self.media.clear();
            self.media
                .extend(media().map(|(medium, kind)| medium.sample_as(*kind, wavelengths)));
        } else {
            // of air and the like nothing changes
            for (lanes, (medium, kind)) in self.media.iter_mut().zip(media()) {
                if kind.varies {
                    *lanes = medium.sample_as(*kind, wavelengths);
                }
            }
        }
        if kinds.coated.is_empty() {
            return;
        }
        let count = scene.materials.len();
        self.coatings.resize_with(count, CoatingLanes::default);
        for &i in &kinds.coated {
            self.coatings[i].update(scene.materials[i].coating.as_deref(), wavelengths);
        }
    }
}

impl Kinds {
    fn of(scene: &Scene) -> Self {
        let is_coated = |&i: &usize| scene.materials[i].coating.is_some();
        Self {
            media: scene.media.iter().map(Medium::kind).collect(),
            coated: (0..scene.materials.len()).filter(is_coated).collect(),
        }
    }
}

/// The sequence of surfaces that the paths of a sample are held to.
#[derive(Clone, Copy, Debug)]
pub struct Held<'a> {
    /// The sequence.
    pub sequence: &'a Sequence,
    /// Inverse of the probability with which it was drawn.
    pub weight: f64,
}

/// Which densities from the other side enter weights: those with which no technique makes a vertex
/// are left 0, and so are the terms that have them, which would be 0 for not being executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AskedDensities {
    /// Of vertices of camera sub-paths, had light brought them forth.
    pub from_light: bool,
    /// Of vertices of light sub-paths, had the sensor brought them forth.
    pub from_sensor: bool,
}

/// Shared state of one path pair.
#[derive(Debug)]
pub struct PathContext<'a> {
    /// The scene.
    pub scene: SceneAt<'a>,
    /// The sensor, by index.
    pub sensor: usize,
    /// Others that its light sub-paths fill as well.
    pub companions: &'a [usize],
    /// The pass.
    pub pass: &'a PassSettings,
    /// Every medium of the scene at these wavelengths.
    pub media: &'a MediaLanes,
    /// Wavelengths of its lanes.
    pub wavelengths: SampledWavelengths,
    /// Response of the sensor's channels to each lane.
    pub response: LaneResponse,
    /// The sequence that its paths are held to, if they are.
    pub held: Option<Held<'a>>,
    /// Which densities the techniques ask for.
    pub asked: AskedDensities,
}

impl<'a> PathContext<'a> {
    /// The moment of this path.
    #[must_use]
    pub fn moment(&self) -> Moment<'_> {
        self.scene.moment()
    }

    /// Whether arrivals at a sensor are of use.
    #[must_use]
    pub fn reads(&self, sensor: usize) -> bool {
        sensor == self.sensor || self.companions.contains(&sensor)
    }

    /// Lanes in use.
    #[must_use]
    pub fn count(&self) -> usize {
        self.wavelengths.count()
    }

    /// Density of x₀ by direct sampling from `x1`, selection included.
    #[must_use]
    pub fn direct_density(&self, id: LightId, x1: DVec3, x0: &EndPoint) -> f64 {
        let light = self.scene.light(id);
        self.scene.selection.probability(id) * light.direct_density(&self.scene.geometry, x1, x0)
    }

    /// A medium at the path's wavelengths.
    #[must_use]
    #[inline]
    pub fn medium(&self, id: MediumId) -> &MediumLanes {
        &self.media.media[id.0 as usize]
    }

    /// Indices on both sides of a surface of an instance between `media`, above the normal, then
    /// below, and the coating between them.
    #[must_use]
    #[inline(always)]
    pub fn interface(&self, media: [MediumId; 2], on: InstanceId) -> Interface<'a> {
        let MediaLanes {
            media: all,
            coatings,
            ..
        } = self.media;
        let [above, below] = media.map(|id| &all[id.0 as usize]);
        let coating = if coatings.is_empty() {
            None
        } else {
            Some(&coatings[self.scene.object(on).material.0 as usize]).filter(|c| !c.is_none())
        };
        Interface {
            eta_above: &above.eta,
            eta_below: &below.eta,
            count: self.count(),
            dispersive: (above.dispersive || below.dispersive) && media[0] != media[1],
            coating,
            polarization: self.scene.polarization,
            albedos: self.scene.albedos(),
        }
    }

    /// η² of a medium, per lane.
    #[must_use]
    pub fn eta_squared(&self, id: MediumId) -> SampledSpectrum {
        let eta = &self.medium(id).eta;
        SampledSpectrum::from_fn(|j| (eta[j] * eta[j]) as f32)
    }

    /// Transmittance of a shadow segment that starts in the solids of `stack`: 0 if occluded, in
    /// between where surfaces cover it partly.
    #[must_use]
    pub fn visibility(&self, ray: &Ray, stack: &MediumStack, counters: &mut Counters) -> f64 {
        counters.shadow_rays += 1;
        self.scene.visibility(ray, stack)
    }

    /// The lanes that stay alive when the hero's direction was taken through a dispersive
    /// interface: those of exactly its wavelength. [theory (4.3)]
    #[must_use]
    pub fn hero_lanes(&self) -> SampledSpectrum {
        let hero = self.wavelengths.lambda_nm(0);
        let n = self.count();
        SampledSpectrum::from_fn(|j| {
            if j < n && self.wavelengths.lambda_nm(j) == hero {
                1.0
            } else {
                0.0
            }
        })
    }
}
