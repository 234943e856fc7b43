//! Companions of a render: detectors that its light sub-paths fill as well, so that several planes
//! of one bench cost one render.

use super::{Choices, ClassTable, Outputs, PilotPasses, Render, SessionError};
use crate::film::AddSumsError;
use crate::integrator::{Companion, SensorJob};
use crate::scene::Scene;
use crate::scene::settings::IntegratorKind;
use std::cmp::Reverse;

/// All sensors of a scene as they share light sub-paths: the one with most pixels leads.
#[must_use]
pub fn shared_order(scene: &Scene) -> Vec<usize> {
    let mut all: Vec<usize> = (0..scene.sensors.len()).collect();
    all.sort_by_key(|&sensor| Reverse(scene.sensors[sensor].whole_film().pixels()));
    all
}

impl Render {
    /// The detectors that its light sub-paths fill as well. Their films hold the same passes as its
    /// own. Rays are counted with this render alone; a companion counts one path per pixel and
    /// pass, so that sums over it are divided as those of any render are.
    #[must_use]
    pub fn companions(&self) -> &[Self] {
        &self.companions
    }

    /// This render, then its companions.
    pub fn and_companions(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.companions)
    }

    /// Adds detectors to be filled, before the first pass, with the results of their pilots where
    /// these have run before.
    pub(super) fn add_companions(
        &mut self,
        sensors: &[usize],
        choices: Option<Vec<Choices>>,
        pilot: PilotPasses,
    ) -> Result<(), SessionError> {
        if choices.as_ref().is_some_and(|c| c.len() != sensors.len()) {
            return Err(SessionError::Choices);
        }
        let mut choices = choices.map(Vec::into_iter);
        for &sensor in sensors {
            let (index, count) = (sensor, self.scene.sensors.len());
            if index >= count {
                return Err(SessionError::Sensor { index, count });
            }
            if let Some(reason) = self.refusal(sensor) {
                let name = |sensor: usize| self.scene.sensors[sensor].name.clone();
                return Err(SessionError::Companion {
                    lead: name(self.sensor),
                    name: name(sensor),
                    reason,
                });
            }
            let crop = self.scene.sensors[sensor].whole_film();
            let (scene, settings, request) = (&self.scene, &self.settings, &self.request);
            let mut companion = match choices.as_mut().and_then(Iterator::next) {
                Some(found) => Self::with_choices(scene, sensor, settings, crop, request, found)
                    .ok_or(SessionError::Choices)?,
                None => Self::with_pilot(scene, sensor, settings, crop, request, pilot),
            };
            // its light is that of the samples of this render's pixels
            companion.outputs = companion.empty_outputs(&self.crop);
            self.companions.push(companion);
        }
        Ok(())
    }

    /// Why the light sub-paths cannot fill a sensor.
    fn refusal(&self, sensor: usize) -> Option<&'static str> {
        let sensors = &self.scene.sensors;
        let (ours, theirs) = (&sensors[self.sensor], &sensors[sensor]);
        if self.settings.integrator != IntegratorKind::Light {
            Some(
                "only light tracing can, for camera sub-paths belong to one sensor \
                 (render.integrator = \"light\", or each by itself)",
            )
        } else if self.and_companions().any(|r| r.sensor == sensor) {
            Some("they are one")
        } else if !ours.camera.is_hittable() || !theirs.camera.is_hittable() {
            Some("both must be detectors")
        } else if ours.shutter != theirs.shutter {
            Some("their shutters differ")
        } else {
            None
        }
    }

    /// The companions of a pass.
    pub(super) fn companions_of<'a>(&'a self, lead: &SensorJob, pass: u32) -> Vec<Companion<'a>> {
        let companion = |render: &'a Self| {
            let job = render.frame();
            let settings = render.settings_of(&job, pass);
            Companion::new(job, settings, lead, &self.crop)
        };
        self.companions.iter().map(companion).collect()
    }

    /// Adds the image sums of passes that were done before, of this render and then of each
    /// companion.
    ///
    /// # Errors
    /// Where the sums are of other films or overflow.
    pub(super) fn restore_all(
        &mut self,
        passes: &[u32],
        sums: &[i128],
    ) -> Result<(), AddSumsError> {
        let films = self.films().into_iter().flat_map(Outputs::part_films);
        let counts: Vec<usize> = films.map(|film| 2 * film.sums_per_half()).collect();
        let each = split(sums, &counts)?;
        let renders = std::iter::once(&mut self.outputs);
        let companions = self.companions.iter_mut().map(|r| &mut r.outputs);
        let films = renders.chain(companions).flat_map(Outputs::part_films_mut);
        for (film, sums) in films.zip(each) {
            film.add_sums(sums)?;
        }
        self.passes.extend(passes);
        for companion in &mut self.companions {
            companion.passes.extend(passes);
        }
        Ok(())
    }

    /// Films of this render and of its companions.
    pub(super) fn films(&self) -> Vec<&Outputs> {
        self.and_companions().map(|r| &r.outputs).collect()
    }

    /// Moves films of a pass into its own and those of its companions.
    pub(super) fn take(&mut self, films: &mut [Outputs]) {
        let renders = std::iter::once(&mut self.outputs);
        let companions = self.companions.iter_mut().map(|r| &mut r.outputs);
        for (outputs, film) in renders.chain(companions).zip(films) {
            outputs.take(film);
        }
    }

    /// Counts a pass that the companions' films hold.
    pub(super) fn count_companions(
        &mut self,
        pass: u32,
        mut tables: impl Iterator<Item = ClassTable>,
    ) {
        for companion in &mut self.companions {
            companion.passes.push(pass);
            companion.counters.paths += companion.crop.pixels();
            companion.table.merge(tables.next().unwrap_or_default());
        }
    }

    /// Estimated relative error of the image, or of the companion's that has the largest. Images
    /// that are black have none.
    #[must_use]
    pub fn largest_error(&self) -> Option<f64> {
        let errors = self.and_companions().filter_map(|r| r.error());
        errors.map(|e| e.relative).reduce(f64::max)
    }
}

/// Sums of all films, film by film.
pub(super) fn split<'a>(
    mut sums: &'a [i128],
    counts: &[usize],
) -> Result<Vec<&'a [i128]>, AddSumsError> {
    let (expected, found) = (counts.iter().sum(), sums.len());
    if expected != found {
        return Err(AddSumsError::Length { expected, found });
    }
    let film = |count: &usize| {
        let (film, rest) = sums.split_at(*count);
        sums = rest;
        film
    };
    Ok(counts.iter().map(film).collect())
}
