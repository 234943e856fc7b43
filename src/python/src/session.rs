//! Renders that go on pass by pass.

use super::attend::{attend, pool};
use super::image::Image;
use super::scene::{Overrides, Scene};
use abbe::film::Crop;
use abbe::io::image;
use abbe::io::layers::{self, Layer};
use abbe::io::loaded::Loaded;
use abbe::render::clock::cpu_seconds;
use abbe::render::guides::Guide;
use abbe::render::session::NO_LIMIT;
use abbe::render::{Cancel, SessionOptions, StopReason, StopRules};
use abbe::report::statistics::SensorStats;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::ThreadPool;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};
use std::time::Duration;

/// Steps that a pass counts in what is done of a render.
const STEPS: u64 = 1000;

/// Tiles done, as the threads that render tell.
#[derive(Default)]
struct Done {
    /// Passes added, in steps.
    passes: AtomicU64,
    /// Of the pass in flight.
    tiles: AtomicU64,
}

/// A render of one sensor.
#[pyclass(module = "abbe")]
pub struct Session {
    session: abbe::render::Session,
    loaded: Arc<Loaded>,
    layers: Vec<Layer>,
    guides: Vec<Guide>,
    cancel: Cancel,
    pool: ThreadPool,
    done: Arc<Done>,
    /// Passes to do, where their number is known.
    goal: Option<u64>,
    time: Option<Duration>,
    target_error: Option<f64>,
    cpu_start: Option<f64>,
    stop: Option<StopReason>,
}

/// Seconds as a duration; a number too large for one is as good as no limit.
fn duration(seconds: f64) -> PyResult<Duration> {
    if seconds.is_nan() || seconds <= 0.0 {
        let message = format!("a time of {seconds} s (allowed: above 0)");
        return Err(PyValueError::new_err(message));
    }
    Ok(Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX))
}

fn value_error(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

#[pymethods]
impl Session {
    /// Begins a render: its pilots run.
    #[new]
    #[pyo3(signature = (scene, settings, *, spp, seed, sensor, passes, time, target_error, crop, layers, spectral, threads))]
    #[allow(clippy::too_many_arguments, reason = "Python names them")]
    fn new(
        py: Python,
        scene: &Scene,
        settings: Overrides,
        spp: Option<u32>,
        seed: Option<u64>,
        sensor: Option<&str>,
        passes: Option<(u32, u32)>,
        time: Option<f64>,
        target_error: Option<f64>,
        crop: Option<(u32, u32, u32, u32)>,
        layers: Vec<String>,
        spectral: Option<u16>,
        threads: usize,
    ) -> PyResult<Self> {
        let loaded = scene.loaded(py, settings)?;
        let mut settings = loaded.settings.clone();
        settings.spp = spp.unwrap_or(settings.spp);
        settings.seed = seed.unwrap_or(settings.seed);
        let layers = layers.iter().map(|name| {
            let wrong = |e: String| value_error(format!("layer \"{name}\": {e}"));
            name.parse().map_err(wrong)
        });
        let layers = layers.collect::<PyResult<Vec<Layer>>>()?;
        let is_endless = spp.is_none() && (time.is_some() || target_error.is_some());
        let passes = match passes {
            Some((start, end)) if start < end && end <= NO_LIMIT => start..end,
            Some((start, end)) => {
                let wrong = format!("passes ({start}, {end}) (allowed: (A, B) with A < B)");
                return Err(value_error(wrong));
            }
            None if is_endless => 0..NO_LIMIT,
            None => 0..settings.spp,
        };
        let goal = (passes.end < NO_LIMIT).then(|| u64::from(passes.end - passes.start));
        let time = time.map(duration).transpose()?;
        let cancel = Cancel::default();
        let options = SessionOptions {
            sensor: loaded.sensor(sensor).map_err(value_error)?,
            crop: crop.map(|(x0, y0, x1, y1)| Crop { x0, y0, x1, y1 }),
            outputs: layers::request(&loaded, &layers, spectral, false).map_err(value_error)?,
            passes: Some(passes),
            stop: StopRules { time, target_error },
            cancel: cancel.clone(),
            live: true,
            ..SessionOptions::default()
        };
        let (pool, cpu_start) = (pool(threads)?, cpu_seconds());
        let begin = || {
            let scene = Arc::clone(&loaded.scene);
            let session = abbe::render::Session::new(scene, &settings, options)?;
            let guides = layers::guides_for(&layers, &session.render());
            Ok((session, guides))
        };
        // pilots cannot be cancelled, but they are short
        let (begun, raised) = attend(py, &pool, begin, |_| Ok(()), || ());
        if let Some(error) = raised {
            return Err(error);
        }
        let begun: Result<_, abbe::render::SessionError> = begun;
        let (mut session, guides) = begun.map_err(value_error)?;
        let done = Arc::new(Done::default());
        let told = Arc::clone(&done);
        session.observe(move |tiles| told.tiles.store(STEPS * tiles.done / tiles.all, SeqCst));
        Ok(Self {
            session,
            loaded,
            layers,
            guides,
            cancel,
            pool,
            done,
            goal,
            time,
            target_error,
            cpu_start,
            stop: None,
        })
    }

    /// Adds passes until it is time to stop, or this many. `tell` is called about five times a
    /// second with the share that is done (0 to 1, or None), passes, relative error (or None) and
    /// seconds. Whatever it or a signal raises stops the render within a pixel and is raised again;
    /// whole passes are kept, and the next call goes on with the one that is not.
    #[pyo3(signature = (passes = None, tell = None))]
    fn run(&mut self, py: Python, passes: Option<u64>, tell: Option<Py<PyAny>>) -> PyResult<()> {
        self.cancel.clear();
        let Self {
            session,
            pool,
            cancel,
            done,
            goal,
            time,
            ..
        } = self;
        let view = session.view();
        let began = session.elapsed();
        let (clock, mut known) = (std::time::Instant::now(), (0, None));
        let mut left = passes;
        let work = || {
            session.run_with(|_, progress| {
                done.passes.store(STEPS * progress.added, SeqCst);
                done.tiles.store(0, SeqCst);
                left = left.map(|n| n.saturating_sub(1));
                let goes_on = left != Some(0);
                Ok::<_, std::convert::Infallible>(if goes_on {
                    ControlFlow::Continue(())
                } else {
                    ControlFlow::Break(())
                })
            })
        };
        let mut turn = 0_u32;
        let watch = |py: Python| {
            let Some(tell) = &tell else {
                return Ok(());
            };
            turn += 1;
            if turn % 4 != 1 {
                return Ok(());
            }
            let elapsed = began + clock.elapsed();
            let (count, error) = py.detach(|| {
                let render = view.read();
                let count = render.passes().len();
                if known.0 != count {
                    known = (count, render.error().map(|e| e.relative));
                }
                known
            });
            let steps = done.passes.load(SeqCst) + done.tiles.load(SeqCst);
            let of_passes = goal.map(|goal| steps as f64 / (STEPS * goal.max(1)) as f64);
            let of_time = time.map(|time| elapsed.as_secs_f64() / time.as_secs_f64());
            let share = of_passes.into_iter().chain(of_time).reduce(f64::max);
            let share = share.map(|s| s.min(1.0));
            tell.call1(py, (share, count, error, elapsed.as_secs_f64()))?;
            Ok(())
        };
        let (outcome, raised) = attend(py, pool, work, watch, || _ = cancel.request());
        let Ok(stop) = outcome;
        self.stop = match stop {
            StopReason::Driver => None,
            stop => Some(stop),
        };
        raised.map_or(Ok(()), Err)
    }

    /// Why it ended, or None while it goes on.
    #[getter]
    fn stop(&self) -> Option<&'static str> {
        self.stop.map(StopReason::text)
    }

    /// Whole passes.
    #[getter]
    fn passes(&self) -> usize {
        self.session.render().passes().len()
    }

    /// The image so far.
    fn image(&self, py: Python) -> PyResult<Image> {
        py.detach(|| {
            let render = self.session.render();
            if render.passes().is_empty() {
                return Err(value_error("no pass is whole: there is no image"));
            }
            let mut xyz = image::of(&render);
            layers::add(&mut xyz, &self.layers, &render, &self.guides);
            let with_noise = self.layers.iter().any(|l| matches!(l, Layer::Noise));
            let stop = self.stop.unwrap_or(StopReason::Driver);
            let name = &self.loaded.scene.sensors[render.sensor()].name;
            let elapsed = self.session.elapsed();
            let mut stats = SensorStats::new(name, &render, stop, elapsed, self.cpu_start);
            stats.forecast = self.session.forecast(self.target_error);
            let error = render.error().map(|e| e.relative);
            Ok(Image::new(
                xyz,
                image::spectral_of(&render, with_noise),
                error,
                stats.json().to_string(),
            ))
        })
    }
}
