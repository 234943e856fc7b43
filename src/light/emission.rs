//! Starts of light sub-paths: as each kind of light sends them, mixed with those toward casters.

use super::casters::{Casters, Choice, Reach, Targets};
use super::directional::DirectionalLight;
use super::environment::EnvironmentLight;
use super::point::PointLight;
use super::{EmissionSample, Light, LightKind, placed_axis};
use crate::geometry::{AccelAt, DirectionalDensity, EndPoint};
use crate::spectrum::SampledWavelengths;
use glam::{DVec2, DVec3};

impl Light {
    /// Starts a light sub-path. `u_face` picks a face or triangle, `u_pos` the position, `u_dir`
    /// the direction. `None` where there is no light to start from; of no weight where nothing
    /// leaves in the direction drawn.
    #[must_use]
    pub fn sample_emission(
        &self,
        geometry: &AccelAt,
        casters: &Casters,
        wavelengths: &SampledWavelengths,
        u_face: f64,
        u_pos: DVec2,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        let mut sample = self.start(geometry, casters, u_face, u_pos, u_dir)?;
        sample.weight *= self.emission.sample(wavelengths);
        if let Some(pattern) = self.pattern_at(geometry, &sample.x0, wavelengths) {
            sample.weight *= pattern;
        }
        Some(sample)
    }

    /// x₀ alone, as a sub-path starts from it, and its density.
    #[must_use]
    pub fn sample_start(
        &self,
        geometry: &AccelAt,
        u_face: f64,
        u_x0: DVec2,
    ) -> Option<(EndPoint, f64)> {
        // a point, or a direction where it is infinitely far away
        let sample = self.own_start(geometry, u_face, u_x0, u_x0)?;
        Some((sample.x0, sample.pdf_x0))
    }

    /// [`Light::sample_emission`] for unit emission.
    pub(super) fn start(
        &self,
        geometry: &AccelAt,
        casters: &Casters,
        u_face: f64,
        u_pos: DVec2,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        let sample = self.own_start(geometry, u_face, u_pos, u_dir)?;
        let Some(targets) = self.targets(geometry, casters, &sample.x0) else {
            return Some(sample);
        };
        let is_parallel = sample.x0.infinite;
        let u = if is_parallel { u_pos } else { u_dir };
        let mut sample = match targets.choose(geometry, sample.direction, u) {
            Choice::Own(x) => {
                let u = DVec2::new(x, u.y);
                let (u_pos, u_dir) = if is_parallel { (u, u_dir) } else { (u_pos, u) };
                self.own_start(geometry, u_face, u_pos, u_dir)?
            }
            Choice::Toward(direction) => EmissionSample {
                direction,
                pdf_direction: self.own_density(geometry, &sample.x0, direction).1,
                ..sample
            },
            Choice::Through(origin) => EmissionSample { origin, ..sample },
        };
        let own = sample.pdf_direction;
        sample.pdf_direction = targets.density(own, sample.direction, sample.origin);
        // each kind is sampled in proportion to what it sends: nothing where a target is out of its
        // reach, but x₀ is a point of the light all the same
        sample.weight *= if own.value() > 0.0 {
            (own.value() / sample.pdf_direction.value()) as f32
        } else {
            0.0
        };
        Some(sample)
    }

    /// Directions over which it sends light from `x0`; `None` where nothing is to be aimed: beams
    /// go one way, and what glass and mirrors make of a sky that is the same everywhere is as
    /// smooth as the sky, which camera sub-paths hit.
    fn reach(&self, geometry: &AccelAt, x0: &EndPoint) -> Option<Reach> {
        let (extent, cone) = match &self.kind {
            LightKind::Area(light) => (light.reach(), (!light.two_sided).then_some((x0.n, 0.0))),
            LightKind::Point(_) => (PointLight::FLUX_FACTOR, None),
            LightKind::Spot(light) => {
                let axis = placed_axis(&self.placement(geometry));
                (light.flux_factor(), light.cone_cos().map(|cos| (axis, cos)))
            }
            LightKind::Directional(_)
            | LightKind::Environment(EnvironmentLight { image: Some(_) }) => {
                (DirectionalLight::flux_factor(geometry), None)
            }
            LightKind::Environment(EnvironmentLight { image: None }) | LightKind::Beam(_) => {
                return None;
            }
        };
        Some(Reach { extent, cone })
    }

    /// Casters that it can be aimed at from `x0`.
    fn targets(&self, geometry: &AccelAt, casters: &Casters, x0: &EndPoint) -> Option<Targets> {
        if casters.count() == 0 {
            return None;
        }
        casters.seen(x0, &self.reach(geometry, x0)?)
    }

    /// `start` without casters.
    fn own_start(
        &self,
        geometry: &AccelAt,
        u_face: f64,
        u_pos: DVec2,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        let place = self.placement(geometry);
        match &self.kind {
            LightKind::Area(light) => light.sample_emission(geometry, u_face, u_pos, u_dir),
            LightKind::Point(_) => Some(PointLight::sample_emission(&place, u_dir)),
            LightKind::Spot(light) => light.sample_emission(&place, u_dir),
            LightKind::Directional(_) => DirectionalLight::sample_emission(geometry, &place, u_pos),
            LightKind::Beam(light) => Some(light.sample_emission(&place, u_pos)),
            LightKind::Environment(light) => {
                let turn = self.turn(geometry);
                light.sample_emission(geometry, turn.as_deref(), u_face, u_pos, u_dir)
            }
        }
    }

    /// Density of `x0` (as `EmissionSample::pdf_x0`) and of leaving it in `direction` (unit, away
    /// from the light) along the line to `x1`.
    #[must_use]
    pub fn emission_density(
        &self,
        geometry: &AccelAt,
        casters: &Casters,
        x0: &EndPoint,
        direction: DVec3,
        x1: DVec3,
    ) -> (f64, DirectionalDensity) {
        let (pdf_x0, own) = self.own_density(geometry, x0, direction);
        match self.targets(geometry, casters, x0) {
            Some(targets) => (pdf_x0, targets.density(own, direction, x1)),
            None => (pdf_x0, own),
        }
    }

    /// `emission_density` without casters.
    fn own_density(
        &self,
        geometry: &AccelAt,
        x0: &EndPoint,
        direction: DVec3,
    ) -> (f64, DirectionalDensity) {
        use DirectionalDensity::{Perpendicular, SolidAngle};
        match &self.kind {
            LightKind::Area(light) => light.emission_density(geometry, x0, direction),
            LightKind::Point(_) => (1.0, SolidAngle(PointLight::DIRECTION_PDF)),
            LightKind::Spot(light) => (
                1.0,
                SolidAngle(light.direction_density(&self.placement(geometry), direction)),
            ),
            LightKind::Directional(_) => (
                1.0,
                Perpendicular(1.0 / DirectionalLight::flux_factor(geometry)),
            ),
            LightKind::Beam(light) => (1.0, light.density(&self.placement(geometry), x0.p)),
            LightKind::Environment(light) => (
                light.direction_pdf(self.turn(geometry).as_deref(), direction),
                EnvironmentLight::disk_density(geometry),
            ),
        }
    }
}
