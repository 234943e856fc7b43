//! The studio: what is looked at, the thread that renders it, and the files it is made of.

use super::super::args::ViewOptions;
use super::CliError;
use super::settings::{self, Chosen};
use super::source::{Found, Source};
use super::stage::{Stage, Subject};
use crate::io::exr::ExrImage;
use crate::io::identity;
use crate::io::layers::{self, Layer};
use crate::io::loaded::{self, Loaded};
use crate::render::forecast::Forecast;
use crate::render::guides::Guide;
use crate::render::look::Look;
use crate::render::{Cancel, Progress, Session, SessionOptions};
use crate::report::readable::counted;
use rayon::ThreadPool;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

/// How often files are looked at for changes.
const LOOK: Duration = Duration::from_millis(400);
/// Side of the blocks of the first look, pixels.
const BLOCK: u32 = 4;
/// Bins of the spectrum of a pixel, as far as they take no more memory than this in all; a pixel
/// takes 64 bytes a bin.
const BINS: u64 = 24;
const SPECTRAL_BYTES: u64 = 512 << 20;

/// Images that stay as they are, to compare with.
#[derive(Debug)]
pub struct Snapshot {
    pub image: ExrImage,
    /// Settings and passes in words.
    pub text: String,
}

/// How far the render is.
#[derive(Clone, Debug, Default)]
struct Standing {
    /// Loading, preparing, rendering or done.
    phase: &'static str,
    all: u64,
    passes: u64,
    error: Option<f64>,
    forecast: Option<(f64, f64)>,
    elapsed: f64,
}

#[derive(Debug, Default)]
struct Shared {
    stage: Option<Arc<Stage>>,
    standing: Standing,
    /// Why the file as it is now cannot be shown.
    problem: Option<String>,
    snapshot: Option<Arc<Snapshot>>,
    /// Settings that the page has chosen, over those of the file.
    chosen: Option<Chosen>,
    /// Files of the stage.
    files: Vec<PathBuf>,
    /// Whether there is something new to be done.
    wanted: Option<Wanted>,
    /// Ends what is rendered now.
    cancel: Cancel,
    version: u64,
}

/// Work for the thread that renders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    /// The scene as it is, from its first pass on.
    Render,
    /// The file as it is now.
    Load,
}

/// The studio.
#[derive(Debug)]
pub struct Studio {
    path: PathBuf,
    source: Source,
    /// The reference that the command line names, and its columns and rows.
    against: Option<(PathBuf, (u32, u32))>,
    overrides: Vec<(String, String)>,
    sensor: Option<String>,
    /// Layers that the command line asks for.
    aov: Vec<Layer>,
    shared: Mutex<Shared>,
    changed: Condvar,
}

impl Studio {
    /// A studio with what the command line names.
    ///
    /// # Errors
    /// There is no such file.
    pub fn open(options: &ViewOptions) -> Result<Self, CliError> {
        let path = &options.path;
        let source = Source::of(path)?;
        let (mut against, mut snapshot) = (None, None);
        if let Some(path) = &options.against {
            let image = Found::of_file(path)?.image;
            against = Some((path.clone(), (image.crop.width(), image.crop.height())));
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let text = format!("reference: {name}");
            snapshot = Some(Arc::new(Snapshot { image, text }));
        }
        Ok(Self {
            path: path.clone(),
            source,
            against,
            overrides: options.scene_overrides(),
            sensor: options.sensor.clone(),
            aov: options.aov.clone(),
            shared: Mutex::new(Shared {
                wanted: Some(Wanted::Load),
                files: vec![source.watched(path)],
                snapshot,
                standing: Standing {
                    phase: "loading",
                    ..Standing::default()
                },
                ..Shared::default()
            }),
            changed: Condvar::new(),
        })
    }

    /// A studio that shows what another command renders.
    pub fn beside(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            source: Source::Scene,
            overrides: Vec::new(),
            sensor: None,
            aov: Vec::new(),
            against: None,
            shared: Mutex::new(Shared {
                standing: Standing {
                    phase: "loading",
                    ..Standing::default()
                },
                ..Shared::default()
            }),
            changed: Condvar::new(),
        }
    }

    /// Shows a render of another command, whose settings stay as they are.
    pub fn watch_render(
        &self,
        loaded: &Loaded,
        session: &Session,
        layers: &[Layer],
        guides: &[Guide],
    ) {
        let (sensor, crop) = {
            let render = session.render();
            (render.sensor(), render.crop())
        };
        self.show(Stage {
            version: self.next_version(),
            name: self.name_of(loaded, sensor),
            size: (crop.width(), crop.height()),
            pitch_m: identity::pixel_pitch(&loaded.scene, sensor),
            is_detector: identity::is_detector(&loaded.scene, sensor),
            unit_name: identity::photometric_unit_of(&loaded.scene, sensor),
            unit: loaded.response().photometric_unit(),
            chosen: None,
            layers: layers.to_vec(),
            guides: guides.to_vec(),
            subject: Subject::Render {
                view: session.view(),
                look: None,
            },
        });
        self.shared().standing = Standing {
            phase: "rendering",
            ..Standing::default()
        };
    }

    /// Takes note of how far a render is.
    pub fn follow(&self, session: &Session, state: &Progress) {
        let error = session.render().error().map(|e| e.relative);
        let forecast = match session.forecast(None) {
            Some((target, Forecast::Takes { time, .. })) => Some((target, time.as_secs_f64())),
            _ => None,
        };
        let mut shared = self.shared();
        let standing = &mut shared.standing;
        standing.passes = state.passes;
        standing.elapsed = state.elapsed.as_secs_f64();
        standing.error = error;
        standing.forecast = forecast;
        if state.stop.is_some() {
            standing.phase = "done";
        }
    }

    fn shared(&self) -> MutexGuard<'_, Shared> {
        // a poisoned lock means that a thread has panicked between two whole states
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The picture and what belongs to it; `None` until there is one.
    pub fn stage(&self) -> Option<Arc<Stage>> {
        self.shared().stage.clone()
    }

    /// The snapshot, where one was taken.
    pub fn snapshot(&self) -> Option<Arc<Snapshot>> {
        self.shared().snapshot.clone()
    }

    /// Keeps the picture as it is now. `None` before there is one.
    pub fn take_snapshot(&self) -> Option<()> {
        let stage = self.stage()?;
        let image = stage.image()?;
        let text = match &stage.subject {
            Subject::Look(_) => return None,
            Subject::Image(_) => stage.name.clone(),
            Subject::Render { view, .. } => {
                let render = view.read();
                let settings = render.settings();
                let passes = counted(render.passes().len() as u64, "pass", "passes");
                format!(
                    "{}, regularize {}, aim {}, {} lanes, {passes}",
                    settings.integrator, settings.regularization.mode, settings.aim, settings.lanes
                )
            }
        };
        self.shared().snapshot = Some(Arc::new(Snapshot { image, text }));
        Some(())
    }

    /// Renders anew with other settings.
    ///
    /// # Errors
    /// A value that is not allowed, or there is no render.
    pub fn set(&self, body: &[u8]) -> Result<(), String> {
        let mut shared = self.shared();
        let stage = shared.stage.as_ref();
        let chosen = stage.and_then(|stage| stage.chosen.as_ref());
        let chosen = chosen.ok_or("nothing is rendered")?;
        shared.chosen = Some(settings::changed(chosen, body)?);
        // a file that has changed is read all the same
        shared.wanted = shared.wanted.or(Some(Wanted::Render));
        shared.cancel.request();
        self.changed.notify_all();
        Ok(())
    }

    /// How things stand, for the page.
    pub fn state(&self) -> Value {
        let shared = self.shared();
        let Standing {
            phase,
            all,
            passes,
            error,
            forecast,
            elapsed,
        } = shared.standing.clone();
        let mut state = json!({
            "phase": phase,
            "passes": passes,
            "all": all,
            "error": error,
            "forecast": forecast.map(|(target, seconds)| json!({ "error": target, "seconds": seconds })),
            "elapsed": elapsed,
            "problem": shared.problem,
            "snapshot": shared.snapshot.as_ref().map(|s| &s.text),
        });
        if let Some(stage) = &shared.stage {
            state["stage"] = stage.facts();
        }
        state
    }

    /// Renders whatever is wanted, for as long as the process lives.
    pub fn work(&self, pool: &ThreadPool) {
        let mut scene: Option<Loaded> = None;
        loop {
            let (wanted, cancel) = self.next();
            if wanted == Wanted::Load || scene.is_none() {
                self.shared().standing.phase = "loading";
                match self.load() {
                    Ok(Some(loaded)) => scene = Some(loaded),
                    Ok(None) => {
                        scene = None;
                        continue;
                    }
                    Err(error) => {
                        let mut shared = self.shared();
                        shared.problem = Some(error.to_string());
                        shared.standing.phase = "stopped";
                        continue;
                    }
                }
            }
            if let Some(loaded) = &scene {
                let rendered = self.render(loaded, &cancel, pool);
                let mut shared = self.shared();
                if rendered.is_err() {
                    shared.standing.phase = "stopped";
                }
                shared.problem = rendered.err().map(|e| e.to_string());
            }
        }
    }

    fn next(&self) -> (Wanted, Cancel) {
        let mut shared = self.shared();
        loop {
            if let Some(wanted) = shared.wanted.take() {
                shared.cancel = Cancel::default();
                return (wanted, shared.cancel.clone());
            }
            let waited = self.changed.wait(shared);
            shared = waited.unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Reads the scene. `None` where the file is an image, which is shown at once.
    fn load(&self) -> Result<Option<Loaded>, CliError> {
        let found = match self.source {
            Source::Scene => {
                let loaded = loaded::load(&self.path, &self.overrides);
                let mut shared = self.shared();
                if let Ok(loaded) = &loaded {
                    shared.files.clone_from(&loaded.files);
                }
                return Ok(Some(loaded?));
            }
            Source::Image => Found::of_file(&self.path)?,
            Source::Job => Found::of_job(&self.path)?,
        };
        let stage = Stage::of_image(self.next_version(), self.name(), found.image);
        self.check_reference(stage.size)?;
        self.show(stage);
        let mut shared = self.shared();
        shared.problem = None;
        shared.standing = Standing {
            phase: "image",
            passes: found.passes,
            all: found.all,
            ..Standing::default()
        };
        Ok(None)
    }

    /// Whether the reference of the command line fits a picture of this size.
    fn check_reference(&self, size: (u32, u32)) -> Result<(), CliError> {
        let Some((path, found)) = self.against.as_ref().filter(|(_, found)| *found != size) else {
            return Ok(());
        };
        let (found, size) = ([found.0, found.1], [size.0, size.1]);
        let message = format!(
            "has {} x {} pixels, the picture {} x {}",
            found[0], found[1], size[0], size[1]
        );
        Err(CliError::file(path, message))
    }

    fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }

    fn name_of(&self, loaded: &Loaded, sensor: usize) -> String {
        format!("{}: {}", self.name(), loaded.scene.sensors[sensor].name)
    }

    fn next_version(&self) -> u64 {
        let mut shared = self.shared();
        shared.version += 1;
        shared.version
    }

    fn show(&self, stage: Stage) {
        self.shared().stage = Some(Arc::new(stage));
    }

    /// Renders to the last pass, or until something else is wanted.
    fn render(&self, loaded: &Loaded, cancel: &Cancel, pool: &ThreadPool) -> Result<(), CliError> {
        let sensor = loaded.sensor(self.sensor.as_deref())?;
        let chosen = self.shared().chosen.clone();
        let chosen = match chosen {
            Some(chosen) => chosen.over(&loaded.settings),
            None => Chosen::of(&loaded.settings, &self.aov),
        };
        let (settings, layers) = (&chosen.settings, chosen.layers(&self.aov));
        {
            let mut shared = self.shared();
            shared.standing = Standing {
                phase: "preparing",
                all: u64::from(settings.spp),
                ..Standing::default()
            };
        }
        let film = loaded.scene.sensors[sensor].whole_film();
        self.check_reference((film.width(), film.height()))?;
        let (pixels, response) = (film.pixels(), loaded.response());
        let first_look = || Look::new(&loaded.scene, sensor, settings, response, BLOCK);
        let look = pool.install(first_look);
        let version = self.next_version();
        let stage = |subject: Subject, guides: Vec<Guide>| Stage {
            version,
            name: self.name_of(loaded, sensor),
            size: (film.width(), film.height()),
            pitch_m: identity::pixel_pitch(&loaded.scene, sensor),
            is_detector: identity::is_detector(&loaded.scene, sensor),
            unit_name: identity::photometric_unit_of(&loaded.scene, sensor),
            unit: response.photometric_unit(),
            chosen: Some(chosen.clone()),
            layers: layers.clone(),
            guides,
            subject,
        };
        self.show(stage(Subject::Look(look.clone()), Vec::new()));
        let bins = (SPECTRAL_BYTES / 64 / pixels).min(BINS) as u16;
        let options = SessionOptions {
            sensor,
            outputs: layers::request(loaded, &layers, (bins > 2).then_some(bins), false)
                .map_err(CliError::Usage)?,
            cancel: cancel.clone(),
            live: true,
            ..SessionOptions::default()
        };
        let scene = Arc::clone(&loaded.scene);
        let begun = pool.install(|| Session::new(scene, settings, options));
        let mut session = begun?;
        let guides = {
            let render = session.render();
            layers::check(&layers, &render).map_err(|e| CliError::Usage(e.to_owned()))?;
            pool.install(|| layers::guides_for(&layers, &render))
        };
        let (view, look) = (session.view(), Some(look));
        self.show(stage(Subject::Render { view, look }, guides));
        self.shared().standing.phase = "rendering";
        loop {
            let state = pool.install(|| session.step());
            self.follow(&session, &state);
            if state.stop.is_some() {
                return Ok(());
            }
        }
    }

    /// Looks for changes of files, for as long as the process lives.
    pub fn watch(&self) {
        let mut before: Vec<(PathBuf, Option<(SystemTime, u64)>)> = Vec::new();
        loop {
            let files = self.shared().files.clone();
            let now: Vec<_> = files
                .into_iter()
                .map(|path| {
                    let found = path.metadata().ok();
                    let stamp = found.and_then(|m| Some((m.modified().ok()?, m.len())));
                    (path, stamp)
                })
                .collect();
            // files that are named anew have not changed
            let changed = now.iter().any(|(path, stamp)| {
                let known = before.iter().find(|(other, _)| other == path);
                known.is_some_and(|(_, old)| old != stamp) && stamp.is_some()
            });
            before = now;
            if changed {
                let mut shared = self.shared();
                shared.wanted = Some(Wanted::Load);
                shared.cancel.request();
                self.changed.notify_all();
            }
            std::thread::sleep(LOOK);
        }
    }
}
