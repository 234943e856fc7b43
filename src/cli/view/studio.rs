//! The studio: what is looked at, the thread that renders it, and the files it is made of.

use super::super::args::ViewOptions;
use super::CliError;
use super::settings;
use crate::io::exr::ExrImage;
use crate::io::image;
use crate::io::layers::{self, Layer};
use crate::io::loaded::{self, Loaded};
use crate::io::model_file::ModelKind;
use crate::io::{identity, part};
use crate::math::named::Named;
use crate::render::forecast::Forecast;
use crate::render::look::Look;
use crate::render::session::View;
use crate::render::{Cancel, Render, Session, SessionOptions};
use crate::scene::Settings;
use crate::spectrum::SensorResponse;
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

/// Subject of the page: a first look, a render or an image.
#[derive(Debug)]
pub enum Subject {
    /// The first look at a render that is being prepared.
    Look(Look),
    /// A render, with the look at it until its first pass is done.
    Render { view: View, look: Look },
    /// An image of a file.
    Image(ExrImage),
}

/// Something to look at, and what is known of it.
#[derive(Debug)]
pub struct Stage {
    /// Grows with every stage.
    pub version: u64,
    /// File and sensor.
    pub name: String,
    pub subject: Subject,
    /// Columns and rows of the picture.
    size: (u32, u32),
    /// Settings of a render.
    settings: Option<Settings>,
    /// Whether irradiance is measured.
    pub is_detector: bool,
    /// cd/m² or lux that a Y of 1 stands for.
    pub unit: f64,
}

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
    chosen: Option<Settings>,
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
    overrides: Vec<(String, String)>,
    sensor: Option<String>,
    shared: Mutex<Shared>,
    changed: Condvar,
}

/// Whether a file holds an image rather than a scene.
fn is_image(path: &Path) -> bool {
    let is_exr = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    is_exr || ModelKind::of(path).is_none() && part::is_part(path).unwrap_or(false)
}

impl Studio {
    /// A studio with what the command line names.
    ///
    /// # Errors
    /// There is no such file.
    pub fn open(options: &ViewOptions) -> Result<Self, CliError> {
        let path = &options.path;
        if !path.is_file() {
            return Err(CliError::file(path, "there is no such file"));
        }
        Ok(Self {
            path: path.clone(),
            overrides: options.scene_overrides(),
            sensor: options.sensor.clone(),
            shared: Mutex::new(Shared {
                wanted: Some(Wanted::Load),
                files: vec![path.clone()],
                standing: Standing {
                    phase: "loading",
                    ..Standing::default()
                },
                ..Shared::default()
            }),
            changed: Condvar::new(),
        })
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
                let (settings, passes) = (render.settings(), render.passes().len());
                format!(
                    "{}, regularize {}, aim {}, {} lanes, {passes} passes",
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
        let settings = stage.and_then(|stage| stage.settings.as_ref());
        let settings = settings.ok_or("nothing is rendered")?;
        shared.chosen = Some(settings::changed(settings, body)?);
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
        if !is_image(&self.path) {
            let loaded = loaded::load(&self.path, &self.overrides);
            let mut shared = self.shared();
            if let Ok(loaded) = &loaded {
                shared.files.clone_from(&loaded.files);
            }
            return Ok(Some(loaded?));
        }
        let image = image::read(&self.path)?;
        if image.xyz().is_none() {
            let message = "has no channels X, Y and Z";
            return Err(CliError::file(&self.path, message));
        }
        let text = |name: &str| match image.metadata.get(name) {
            Some(crate::io::exr::MetadataValue::Text(text)) => text.as_str(),
            _ => "",
        };
        let response = if text("unit").starts_with("photometric") {
            SensorResponse::Photometric
        } else {
            SensorResponse::Xyz
        };
        let stage = Stage {
            version: self.next_version(),
            name: self.name(),
            size: (image.crop.width(), image.crop.height()),
            settings: None,
            is_detector: text(identity::SENSOR_KIND) == identity::DETECTOR,
            unit: response.photometric_unit(),
            subject: Subject::Image(image),
        };
        self.show(stage);
        let mut shared = self.shared();
        shared.problem = None;
        shared.standing.phase = "image";
        Ok(None)
    }

    fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
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
        let settings = match chosen {
            // the file may have changed all else
            Some(chosen) => Settings {
                integrator: chosen.integrator,
                aim: chosen.aim,
                lanes: chosen.lanes,
                regularization: crate::scene::settings::Regularization {
                    mode: chosen.regularization.mode,
                    epsilon: chosen.regularization.epsilon,
                    ..loaded.settings.regularization
                },
                ..loaded.settings.clone()
            },
            None => loaded.settings.clone(),
        };
        {
            let mut shared = self.shared();
            shared.standing = Standing {
                phase: "preparing",
                all: u64::from(settings.spp),
                ..Standing::default()
            };
        }
        let film = loaded.scene.sensors[sensor].whole_film();
        let (pixels, response) = (film.pixels(), loaded.response());
        let first_look = || Look::new(&loaded.scene, sensor, &settings, response, BLOCK);
        let look = pool.install(first_look);
        let version = self.next_version();
        let stage = |subject: Subject| Stage {
            version,
            name: format!("{}: {}", self.name(), loaded.scene.sensors[sensor].name),
            size: (film.width(), film.height()),
            is_detector: identity::is_detector(&loaded.scene, sensor),
            unit: response.photometric_unit(),
            settings: Some(settings.clone()),
            subject,
        };
        self.show(stage(Subject::Look(look.clone())));
        let bins = (SPECTRAL_BYTES / 64 / pixels).min(BINS) as u16;
        let options = SessionOptions {
            sensor,
            outputs: layers::request(loaded, &[], (bins > 2).then_some(bins), false)
                .map_err(CliError::Usage)?,
            cancel: cancel.clone(),
            live: true,
            ..SessionOptions::default()
        };
        let scene = Arc::clone(&loaded.scene);
        let begun = pool.install(|| Session::new(scene, &settings, options));
        let mut session = begun?;
        let view = session.view();
        self.show(stage(Subject::Render { view, look }));
        self.shared().standing.phase = "rendering";
        loop {
            let state = pool.install(|| session.step());
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

impl Stage {
    /// The image as the command line writes it. `None` before the first pass.
    pub fn image(&self) -> Option<ExrImage> {
        match &self.subject {
            Subject::Look(_) => None,
            Subject::Image(image) => Some(image.clone()),
            Subject::Render { view, .. } => {
                let render = view.read();
                (!render.passes().is_empty()).then(|| image::of(&render))
            }
        }
    }

    /// The image with its standard error, in the layer `error`.
    pub fn image_with_error(&self) -> Option<ExrImage> {
        let mut image = self.image()?;
        if let Subject::Render { view, .. } = &self.subject {
            layers::add(&mut image, &[Layer::Error], &view.read(), &[]);
        }
        Some(image)
    }

    /// Layers that can be shown, besides the picture itself.
    fn layers(&self) -> Vec<String> {
        match &self.subject {
            Subject::Look(_) | Subject::Render { .. } => vec!["error".to_owned()],
            Subject::Image(image) => {
                let names = image.channels.iter();
                let names = names.filter_map(|c| Some(c.name.rsplit_once('.')?.0.to_owned()));
                let mut names: Vec<String> = names.collect();
                names.sort();
                names.dedup();
                names
            }
        }
    }

    fn facts(&self) -> Value {
        let (width, height) = self.size;
        json!({
            "version": self.version,
            "name": self.name,
            "width": width,
            "height": height,
            "renders": self.settings.is_some(),
            "detector": self.is_detector,
            "layers": self.layers(),
            "settings": self.settings.as_ref().map(settings::shown),
            "choices": settings::choices(),
            "tones": crate::develop::ToneCurve::ALL.iter().map(|t| t.as_str()).collect::<Vec<_>>(),
        })
    }

    /// A pixel from the top left: XYZ, luminance and spectrum.
    pub fn pixel(&self, x: u32, y: u32) -> Option<Value> {
        let (width, height) = self.size;
        if x >= width || y >= height {
            return None;
        }
        let (xyz, spectrum) = match &self.subject {
            Subject::Image(image) => {
                let index = y as usize * width as usize + x as usize;
                let value = |name: &str| Some(f64::from(*image.channel(name)?.get(index)?));
                (["X", "Y", "Z"].map(|name| value(name).unwrap_or(0.0)), None)
            }
            Subject::Look(_) => return None,
            Subject::Render { view, .. } => render_pixel(&view.read(), x, y)?,
        };
        Some(json!({
            "x": x,
            "y": y,
            "xyz": xyz,
            "luminance": xyz[1] * self.unit,
            "unit": if self.is_detector { "lx" } else { "cd/m²" },
            "spectrum": spectrum,
        }))
    }
}

/// XYZ and spectrum of a pixel of a render.
fn render_pixel(render: &Render, x: u32, y: u32) -> Option<([f64; 3], Option<Value>)> {
    let crop = render.crop();
    let (x, y) = (crop.x0 + x, crop.y0 + y);
    let passes = render.passes().len() as u64;
    let xyz = render.outputs().image.pixel(x, y, passes)?;
    let spectrum = render.outputs().spectral.as_ref().and_then(|(channels, film)| {
        let values = film.pixel(x, y, passes)?;
        let nm: Vec<f64> = channels.bin_centers_nm().collect();
        let (bins, lines) = values.split_at(nm.len());
        Some(json!({ "nm": nm, "values": bins, "lines_nm": channels.lines_nm(), "lines": lines }))
    });
    Some((<[f64; 3]>::try_from(xyz).ok()?, spectrum))
}
