//! A render session: the loop over passes. It knows which pass is next, when to stop, when to save,
//! and what is known of the error.
//!
//! Invariant: outside of [`Session::step`] the films hold whole passes only. In a live session they
//! do at any time: a pass is traced into films of its own, which are added when it is complete. One
//! that is cancelled or paused is gone on with by the next step, pixel by pixel; with photons
//! or Markov chains, for which more would have to be kept, it is dropped.

use super::clock::PassTime;
use super::companions;
use super::forecast::{ErrorHistory, Forecast};
use super::pass::{Flight, TileObserver, Tiles, UnfinishedPass, Watch, tile_count, tile_pixels};
use super::{Cancel, Choices, OutputRequest, Outputs, PilotPasses, Render, StopReason, StopRules};
use crate::film::{AddSumsError, Crop, Film};
use crate::scene::{Scene, Settings};
use std::cell::LazyCell;
use std::collections::BTreeSet;
use std::ops::{ControlFlow, Range};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::{Duration, Instant};

/// One past the last pass of a render that no number of passes limits.
pub const NO_LIMIT: u32 = u32::MAX - 1;

/// Choices of a session.
#[derive(Clone, Debug, Default)]
pub struct SessionOptions {
    /// The sensor, by index.
    pub sensor: usize,
    /// The rendered part of the film; `None`: all of it.
    pub crop: Option<Crop>,
    /// Detectors that the same light sub-paths fill as well, by index, all of their films
    /// ([`Render::companions`]): for light tracing alone.
    pub companions: Vec<usize>,
    /// Films to keep.
    pub outputs: OutputRequest,
    /// Global indices of the passes; `None`: as many as the settings say. See [`NO_LIMIT`].
    pub passes: Option<Range<u32>>,
    /// Ends besides the last pass.
    pub stop: StopRules,
    /// Length of the pilot that finds the variance factors; `None`: by the settings.
    pub pilot: Option<PilotPasses>,
    /// Results of the pilots, where they have run before; `None`: they run.
    pub choices: Option<Choices>,
    /// The same of each companion.
    pub companion_choices: Option<Vec<Choices>>,
    /// Ends the session from outside: between passes, or in a live session between pixels.
    pub cancel: Cancel,
    /// Readers never wait for a pass, nor see one that is not whole: each is traced into films of
    /// its own, which takes the memory of the films twice.
    pub live: bool,
    /// [`Progress::save_is_due`] comes up so that no more than this much time is lost; `None`:
    /// never.
    pub save_interval: Option<Duration>,
    /// Passes of a live session that last longer than that pause for it, so that what is done of
    /// them ([`Session::unfinished`]) can be saved.
    pub pauses: bool,
}

/// Why a session cannot begin.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SessionError {
    /// No such sensor.
    #[error("sensor {index} does not exist: the scene has {count}")]
    Sensor {
        /// Asked for.
        index: usize,
        /// Sensors of the scene.
        count: usize,
    },
    /// A part of the film that is empty or not on it.
    #[error("a crop of columns {}..{} and rows {}..{} is not on a film of {width} x {height} pixels", .crop.x0, .crop.x1, .crop.y0, .crop.y1)]
    Crop {
        /// Asked for.
        crop: Crop,
        /// Columns of the film.
        width: u32,
        /// Rows of the film.
        height: u32,
    },
    /// Choices that were made for another render.
    #[error("the results of the pilots are those of another render")]
    Choices,
    /// A detector that light sub-paths of another cannot fill.
    #[error("sensors \"{lead}\" and \"{name}\" cannot share light sub-paths: {reason}")]
    Companion {
        /// The sensor whose light sub-paths are traced.
        lead: String,
        /// The one that cannot share them.
        name: String,
        /// Reason, and how it must be.
        reason: &'static str,
    },
}

/// State of a session after a pass.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// The pass that was added; `None` where there was none left or it was cancelled.
    pub pass: Option<u32>,
    /// Passes that the session has added.
    pub added: u64,
    /// Passes in the films, restored ones included.
    pub passes: u64,
    /// Rays of both kinds.
    pub rays: u64,
    /// Wall time since the session began.
    pub elapsed: Duration,
    /// Time spent on passes alone: no pilots, nothing that happens between steps.
    pub time: PassTime,
    /// Time to write what there is.
    pub save_is_due: bool,
    /// Ended, and why.
    pub stop: Option<StopReason>,
}

/// Read access to a render from other threads, while it goes on.
#[derive(Clone, Debug)]
pub struct View(Arc<RwLock<Render>>);

impl View {
    /// The render, at a number of whole passes. Waits for the end of a pass unless the session is
    /// live. The session cannot go on while it is held.
    pub fn read(&self) -> RwLockReadGuard<'_, Render> {
        // a poisoned lock means that a render thread has panicked; the sums stay consistent
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, Render> {
        self.0.write().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The render of one sensor, pass by pass, until it is time to stop.
pub struct Session {
    view: View,
    /// Films of the pass in flight of a live session, those of companions after the session's own.
    staging: Option<Vec<Outputs>>,
    /// Content of these films.
    flight: Option<Flight>,
    passes: Range<u32>,
    /// Done out of their order.
    restored: BTreeSet<u32>,
    stop: StopRules,
    cancel: Cancel,
    observer: Option<Box<TileObserver>>,
    history: ErrorHistory,
    save_interval: Option<Duration>,
    pauses: bool,
    added: u64,
    began: Instant,
    saved: Instant,
    save_was_due: bool,
    time: PassTime,
}

impl Session {
    /// Begins a session: the pilots run.
    ///
    /// # Errors
    /// Where the scene has no such sensor, its film no such part, or the choices are another's.
    pub fn new(
        scene: impl Into<Arc<Scene>>,
        settings: &Settings,
        options: SessionOptions,
    ) -> Result<Self, SessionError> {
        let (scene, began) = (scene.into(), Instant::now());
        let count = scene.sensors.len();
        let index = options.sensor;
        let sensor = scene.sensors.get(index);
        let sensor = sensor.ok_or(SessionError::Sensor { index, count })?;
        let whole = sensor.whole_film();
        let crop = options.crop.unwrap_or(whole);
        let is_on_film = crop.x0 < crop.x1 && crop.y0 < crop.y1;
        if !is_on_film || crop.x1 > whole.x1 || crop.y1 > whole.y1 {
            let (width, height) = (whole.x1, whole.y1);
            return Err(SessionError::Crop {
                crop,
                width,
                height,
            });
        }
        let passes = options.passes.unwrap_or(0..settings.spp);
        let outputs = &options.outputs;
        let pilot = options.pilot.unwrap_or(PilotPasses::of(settings.spp));
        let mut render = match options.choices {
            Some(choices) => Render::with_choices(&scene, index, settings, crop, outputs, choices)
                .ok_or(SessionError::Choices)?,
            None => Render::with_pilot(&scene, index, settings, crop, outputs, pilot),
        };
        render.add_companions(&options.companions, options.companion_choices, pilot)?;
        Ok(Self {
            staging: options.live.then(|| render.empty_films()),
            flight: None,
            view: View(Arc::new(RwLock::new(render))),
            // a range that ends before it begins is empty
            passes: passes.start..passes.end.max(passes.start),
            restored: BTreeSet::new(),
            stop: options.stop,
            cancel: options.cancel,
            observer: None,
            history: ErrorHistory::default(),
            save_interval: options.save_interval,
            pauses: options.pauses,
            added: 0,
            began,
            saved: Instant::now(),
            save_was_due: false,
            time: PassTime::default(),
        })
    }

    /// The render so far.
    pub fn render(&self) -> RwLockReadGuard<'_, Render> {
        self.view.read()
    }

    /// Access for other threads.
    #[must_use]
    pub fn view(&self) -> View {
        self.view.clone()
    }

    /// From now on `observer` is told of each tile, by the thread that has finished it.
    pub fn observe(&mut self, observer: impl Fn(Tiles) + Send + Sync + 'static) {
        self.observer = Some(Box::new(observer));
    }

    /// Adds the image sums of passes that were done before, of the sensor and then of each
    /// companion; they will not be done again.
    ///
    /// # Errors
    /// Where the sums are of another film or overflow.
    pub fn restore(&mut self, passes: &[u32], sums: &[i128]) -> Result<(), AddSumsError> {
        self.view.write().restore_all(passes, sums)?;
        self.restored.extend(passes);
        self.skip_restored();
        Ok(())
    }

    /// Restores a pass that was not whole, with which the next step goes on if it is among those of
    /// the session. From now on passes have films of their own, as in a live session.
    ///
    /// # Errors
    /// Where it is of another film.
    pub fn restore_unfinished(&mut self, pass: UnfinishedPass) -> Result<(), AddSumsError> {
        let UnfinishedPass { pass, done, sums } = pass;
        let render = self.view.read();
        let (crop, mut films) = (render.crop(), render.empty_films());
        let (expected, found) = (tile_count(&crop) as usize, done.len());
        let within = |(all, done): (u16, &u16)| *done <= all;
        let fits = expected == found && tile_pixels(&crop).zip(&done).all(within);
        if !fits {
            return Err(AddSumsError::Length { expected, found });
        }
        let all = films.iter().flat_map(Outputs::part_films);
        let counts: Vec<usize> = all.map(Film::sums_per_half).collect();
        let all = films.iter_mut().flat_map(Outputs::part_films_mut);
        for (film, sums) in all.zip(companions::split(&sums, &counts)?) {
            film.add_sums_to_half(pass as usize & 1, sums)?;
        }
        self.staging = Some(films);
        self.flight = Some(Flight {
            done,
            ..Flight::new(pass, &crop)
        });
        Ok(())
    }

    /// The pass that is not whole, if there is one, with what is done of it.
    #[must_use]
    pub fn unfinished(&self) -> Option<UnfinishedPass> {
        let (flight, films) = (self.flight.as_ref()?, self.staging.as_ref()?);
        Some(UnfinishedPass {
            pass: flight.index,
            done: flight.done.clone(),
            sums: films
                .iter()
                .flat_map(Outputs::part_films)
                .flat_map(|film| film.sums_of_half(flight.index as usize & 1))
                .collect(),
        })
    }

    /// An unfinished pass that is not among those of the session: the first of them drops what is
    /// done of it.
    #[must_use]
    pub fn stranded(&self) -> Option<u32> {
        let index = self.flight.as_ref()?.index;
        (!self.passes.is_empty() && !self.is_to_come(index)).then_some(index)
    }

    fn is_to_come(&self, pass: u32) -> bool {
        self.passes.contains(&pass) && !self.restored.contains(&pass)
    }

    /// First and last pass that neither the restored ones nor those to come hold, though they hold
    /// passes before and after.
    #[must_use]
    pub fn gap(&self) -> Option<(u32, u32)> {
        let last = *self.restored.last()?;
        if self.passes.is_empty() {
            return None;
        }
        let first = *self.restored.first()?;
        // the first pass to come may be behind all restored ones, or the last before them
        let (end, start) = if self.passes.start > last {
            (last.checked_add(1)?, self.passes.start)
        } else {
            (self.passes.end, first)
        };
        (end < start).then(|| (end, start - 1))
    }

    /// Number of passes that are left, if nothing ends the session before.
    #[must_use]
    pub fn passes_left(&self) -> u64 {
        let all = u64::from(self.passes.end - self.passes.start);
        all - self.restored.range(self.passes.clone()).count() as u64
    }

    /// Adds the next pass, or what can be done of it, and says how things stand.
    pub fn step(&mut self) -> Progress {
        if std::mem::take(&mut self.save_was_due) {
            self.saved = Instant::now();
        }
        if self.passes.is_empty() {
            return self.progress(None, false, Some(StopReason::Passes));
        }
        // what has begun comes first
        let begun = self.flight.as_ref().map(|flight| flight.index);
        let begun = begun.filter(|&pass| self.is_to_come(pass));
        let (pass, start) = (begun.unwrap_or(self.passes.start), Instant::now());
        let mut time = self.time;
        let is_added = time.measure(|| self.add(pass));
        self.time = time;
        if !is_added {
            let is_cancelled = self.cancel.is_requested();
            self.save_was_due = !is_cancelled;
            let stop = is_cancelled.then_some(StopReason::Interrupted);
            return self.progress(None, self.save_was_due, stop);
        }
        self.restored.insert(pass);
        self.added += 1;
        self.skip_restored();
        let stop = self.reason_to_stop();
        let would_lose = self.saved.elapsed() + start.elapsed();
        let is_late = self.save_interval.is_some_and(|most| would_lose >= most);
        self.save_was_due = is_late && stop.is_none();
        self.progress(Some(pass), self.save_was_due, stop)
    }

    /// Adds passes until it is time to stop.
    pub fn run(&mut self) -> StopReason {
        loop {
            if let Some(reason) = self.step().stop {
                return reason;
            }
        }
    }

    /// Adds passes until it is time to stop or `after_pass`, which is called after each, breaks.
    ///
    /// # Errors
    /// The first of `after_pass`.
    pub fn run_with<E>(
        &mut self,
        mut after_pass: impl FnMut(&Self, &Progress) -> Result<ControlFlow<()>, E>,
    ) -> Result<StopReason, E> {
        loop {
            let progress = self.step();
            let goes_on = progress.pass.is_none() || after_pass(self, &progress)?.is_continue();
            match progress.stop {
                Some(reason) => return Ok(reason),
                None if !goes_on => return Ok(StopReason::Driver),
                None => {}
            }
        }
    }

    /// A smaller error and the passes and time it takes in all: `target` where the error is above
    /// it, else half the error. `None` while the error is unknown, or without a pass of this
    /// session.
    #[must_use]
    pub fn forecast(&self, target: Option<f64>) -> Option<(f64, Forecast)> {
        let render = self.render();
        let error = render.error().filter(|_| self.added > 0)?;
        let target = target.filter(|&t| t < error.relative);
        let target = target.unwrap_or(0.5 * error.relative);
        let per_pass = self.time.wall.div_f64(self.added as f64);
        let passes = render.passes().len() as u64;
        let forecast = self.history.forecast(passes, &error, per_pass, target);
        Some((target, forecast))
    }

    /// Changes how much time may be lost, see [`SessionOptions::save_interval`].
    pub fn set_save_interval(&mut self, interval: Option<Duration>) {
        self.save_interval = interval;
    }

    /// Wall time since the session began.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }

    /// Keeps the error where it belongs to the history, and tells whether the pass just added is
    /// the last one.
    fn reason_to_stop(&mut self) -> Option<StopReason> {
        let render = self.view.read();
        let passes = render.passes().len();
        let error = LazyCell::new(|| render.largest_error());
        self.history.after_pass(passes as u64, || *error);
        if self.passes.is_empty() {
            // a request to stop during the last pass changes nothing
            Some(StopReason::Passes)
        } else if self.cancel.is_requested() {
            Some(StopReason::Interrupted)
        } else {
            self.stop.check(passes, self.began.elapsed(), || *error)
        }
    }

    fn skip_restored(&mut self) {
        while !self.passes.is_empty() && self.restored.contains(&self.passes.start) {
            self.passes.start += 1;
        }
    }

    /// Whether the pass was added: not if it was cancelled or paused.
    fn add(&mut self, pass: u32) -> bool {
        let observer = self.observer.as_deref();
        let Some(staging) = &mut self.staging else {
            self.view.write().add_watched(pass, observer);
            return true;
        };
        let render = self.view.read();
        let whole_only = render.keeps_whole_passes_only();
        let interval = self.save_interval.filter(|_| self.pauses && !whole_only);
        let watch = Watch {
            cancel: Some(&self.cancel),
            pause_at: interval.and_then(|most| self.saved.checked_add(most)),
            observer,
        };
        let begun = self.flight.take();
        let is_other = |flight: &Flight| flight.index != pass || render.chains().is_some();
        let is_other = begun.as_ref().is_some_and(is_other);
        if is_other {
            *staging = render.empty_films();
        }
        let begun = begun.filter(|_| !is_other);
        let mut flight = begun.unwrap_or_else(|| Flight::new(pass, &render.crop()));
        if !render.trace(&mut flight, &staging.iter().collect::<Vec<_>>(), &watch) {
            if whole_only {
                *staging = render.empty_films();
            } else if flight.has_begun() {
                self.flight = Some(flight);
            }
            return false;
        }
        drop(render);
        let mut render = self.view.write();
        render.take(staging);
        render.count(flight);
        true
    }

    fn progress(&self, pass: Option<u32>, save_is_due: bool, stop: Option<StopReason>) -> Progress {
        let render = self.render();
        let counters = render.counters();
        Progress {
            pass,
            added: self.added,
            passes: render.passes().len() as u64,
            rays: counters.closest_rays + counters.shadow_rays,
            elapsed: self.began.elapsed(),
            time: self.time,
            save_is_due,
            stop,
        }
    }
}
