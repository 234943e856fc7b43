//! `abbe render`: loads, renders each sensor pass by pass, writes images, statistics and part
//! files.

use super::args::RenderOptions;
use super::ending;
use super::image_output::{of_sensor, preview_path};
use super::interrupt::{self, Interrupts};
use super::memory::{self, Need};
use super::progress::{Progress, Waiting};
use super::save::{self, Saver, Targets};
use super::stats;
use super::tev::Viewer;
#[cfg(feature = "view")]
use super::view::Page;
use super::{CliError, Outcome, print, summary, tell, threads};
use crate::film::Crop;
use crate::io::destination::Claims;
use crate::io::layers::{self, Layer};
use crate::io::loaded::{self, Loaded};
use crate::io::part::Resumed;
use crate::render::clock::cpu_seconds;
use crate::render::guides::Guide;
use crate::render::memory::{film_bytes, saving_bytes};
use crate::render::session::NO_LIMIT;
use crate::render::{
    OutputRequest, PhotonMemory, Render, Session, SessionOptions, StopReason, StopRules,
};
use crate::report::statistics::SensorStats;
use crate::spectrum::SpectralChannels;
use rayon::ThreadPool;
use std::cell::RefCell;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Samples, and passes of small films, after which an image that is all black is worth a word.
const SAMPLES_TO_SEE: u64 = 1 << 16;
const PASSES_TO_SEE: u64 = 16;

/// Parts that all sensors share.
struct Job<'a> {
    options: &'a RenderOptions,
    loaded: &'a Loaded,
    request: OutputRequest,
    passes: Range<u32>,
    rules: StopRules,
    interrupts: Interrupts,
    pool: &'a ThreadPool,
    /// Without photons.
    need: Need,
    #[cfg(feature = "view")]
    page: Option<Page>,
    /// Whether all that was said could be: if not, the render goes on.
    printed: RefCell<Result<(), CliError>>,
}

/// A sensor that is rendered, and where its files go.
struct Film<'a> {
    sensor: usize,
    crop: Crop,
    targets: &'a Targets,
}

/// A session before its first pass.
struct Begun {
    session: Session,
    /// Of its sensor and each companion.
    guides: Vec<Vec<Guide>>,
    photons: Option<PhotonMemory>,
}

/// Runs the command.
pub fn run(options: &RenderOptions) -> Result<Outcome, CliError> {
    options.moment.check(&options.scene)?;
    let waiting = Waiting::new(
        format!("loading {}", options.scene.display()),
        options.quiet,
    );
    let load = || loaded::load(&options.scene, &options.scene_overrides());
    let loaded = memory::guarded(options.max_memory, load)??;
    drop(waiting);
    let sensors = chosen_sensors(options, &loaded)?;
    let targets: Vec<Targets> = sensors
        .iter()
        .map(|&s| targets(options, &loaded, s, sensors.len() > 1))
        .collect();
    check_targets(options, &loaded, &targets)?;
    let crops = sensors
        .iter()
        .map(|&s| crop(options, &loaded, s))
        .collect::<Result<Vec<_>, _>>()?;
    let class_table = options.stats.is_some();
    let request = layers::request(&loaded, &options.aov, options.spectral, class_table)
        .map_err(CliError::Usage)?;
    let _part = save::take_part(options)?;
    let need = need(options, &loaded, &request, &crops);
    need.check(options.max_memory)?;
    // from here on: the first output says that an interrupt is safe
    let interrupts = interrupt::listen()?;
    if !options.quiet {
        for warning in &loaded.warnings {
            tell(&format!("warning: {warning}"));
        }
    }
    let pool = threads::pool(options.threads)?;
    let endless =
        options.spp.is_none() && (options.time.is_some() || options.target_error.is_some());
    let job = Job {
        options,
        request,
        passes: options.passes.clone().unwrap_or(
            0..if endless {
                NO_LIMIT
            } else {
                loaded.settings.spp
            },
        ),
        rules: StopRules {
            time: options.time.map(duration),
            target_error: options.target_error,
        },
        interrupts,
        loaded: &loaded,
        pool: &pool,
        need,
        #[cfg(feature = "view")]
        page: options
            .view
            .then(|| Page::open(&options.scene))
            .transpose()?,
        printed: RefCell::new(Ok(())),
    };
    job.explain(|| summary::effects(&loaded.scene.effects));
    let threads = pool.current_num_threads();
    let (outcome, sensor_stats) = job.render_all(&sensors, &crops, &targets)?;
    if let Some(path) = &options.stats {
        stats::write(path, &loaded, threads, &sensor_stats)?;
    }
    job.printed.into_inner().map(|()| outcome)
}

/// Seconds as a duration; a number too large for one is as good as no limit.
fn duration(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

fn chosen_sensors(options: &RenderOptions, loaded: &Loaded) -> Result<Vec<usize>, CliError> {
    let scene = &loaded.scene;
    let sensors = match &options.sensor {
        None => (0..scene.sensors.len()).collect(),
        name => vec![loaded.sensor(name.as_deref())?],
    };
    if options.part.is_some() && sensors.len() > 1 && !options.together {
        return Err(CliError::Usage(format!(
            "--part holds one sensor, the scene has {}: add --sensor NAME (or --together, for \
             detectors and the integrator light)",
            sensors.len()
        )));
    }
    Ok(sensors)
}

fn targets(options: &RenderOptions, loaded: &Loaded, sensor: usize, several: bool) -> Targets {
    let own_name = || {
        let mut name = options.scene.file_stem().unwrap_or_default().to_owned();
        name.push(".exr");
        PathBuf::from(name)
    };
    let mut image = options.output.clone().unwrap_or_else(own_name);
    if several {
        image = of_sensor(&image, &loaded.scene.sensors[sensor].name);
    }
    Targets {
        preview: (!options.no_preview).then(|| preview_path(&image)),
        spectral: options
            .spectral
            .map(|_| image.with_extension("spectral.exr")),
        image,
    }
}

/// All places are tried before hours are spent, and none of them may be what was read.
fn check_targets(
    options: &RenderOptions,
    loaded: &Loaded,
    targets: &[Targets],
) -> Result<(), CliError> {
    for target in targets {
        ending::image(&target.image)?;
    }
    let mut claims = Claims::of_inputs(&loaded.files);
    let images = targets
        .iter()
        .flat_map(|t| [Some(&t.image), t.preview.as_ref(), t.spectral.as_ref()]);
    let all = images.chain([options.part.as_ref(), options.stats.as_ref()]);
    for path in all.flatten() {
        claims.output(path)?;
    }
    if let Some(path) = &options.stats {
        ending::check(path, "statistics are JSON files", &["json"])?;
    }
    Ok(())
}

fn crop(options: &RenderOptions, loaded: &Loaded, sensor: usize) -> Result<Crop, CliError> {
    let sensor = &loaded.scene.sensors[sensor];
    let size = sensor.camera.resolution();
    match options.crop {
        None => Ok(sensor.whole_film()),
        Some(crop) if crop.x1 <= size.width && crop.y1 <= size.height => Ok(crop),
        Some(crop) => Err(CliError::Usage(format!(
            "crop {},{},{},{} reaches beyond sensor \"{}\" of {} x {} pixels",
            crop.x0, crop.y0, crop.x1, crop.y1, sensor.name, size.width, size.height
        ))),
    }
}

fn need(options: &RenderOptions, loaded: &Loaded, request: &OutputRequest, crops: &[Crop]) -> Need {
    // sensors are rendered one after the other, or together, and saved one after the other
    let pixels = crops.iter().map(Crop::pixels).max().unwrap_or(0);
    let at_once = if options.together {
        crops.iter().map(Crop::pixels).fold(0, u64::saturating_add)
    } else {
        pixels
    };
    let spectral = request.spectral.as_ref();
    let spectral = spectral.map_or(0, SpectralChannels::count) as u64;
    let has_noise = options.aov.iter().any(|l| matches!(l, Layer::Noise));
    let spectral_saved = spectral * (1 + u64::from(has_noise));
    Need {
        loaded: memory::loaded_bytes(&loaded.scene),
        // those of the pass in flight, too
        films: film_bytes(at_once, request).saturating_mul(2),
        // at most three channels a layer; a part holds all that is rendered at once
        saving: saving_bytes(
            if options.part.is_some() {
                at_once
            } else {
                pixels
            },
            spectral_saved + 3 * options.aov.len() as u64,
            if options.part.is_some() {
                3 + spectral
            } else {
                0
            },
        ),
        photons: 0,
    }
}

impl Job<'_> {
    fn say(&self, text: impl FnOnce() -> String) {
        let mut printed = self.printed.borrow_mut();
        if !self.options.quiet && printed.is_ok() {
            *printed = print(&text());
        }
    }

    /// Says why things are as they are, where that is asked for.
    fn explain(&self, text: impl FnOnce() -> String) {
        if self.options.verbose {
            self.say(text);
        }
    }

    fn render_all(
        &self,
        sensors: &[usize],
        crops: &[Crop],
        targets: &[Targets],
    ) -> Result<(Outcome, Vec<SensorStats>), CliError> {
        let mut all = Vec::new();
        let each = sensors.iter().zip(crops).zip(targets);
        let mut each: Vec<Film> = each
            .map(|((&sensor, &crop), targets)| Film {
                sensor,
                crop,
                targets,
            })
            .collect();
        // the first leads, the others follow in their order
        each.sort_by_key(|film| {
            std::cmp::Reverse(film.crop.pixels() * u64::from(self.options.together))
        });
        let at_once = if self.options.together { each.len() } else { 1 };
        for films in each.chunks(at_once) {
            let stats = self.render_films(films)?;
            let is_whole = |s: &SensorStats| s.stop != StopReason::Interrupted;
            let goes_on = !stats.is_empty() && stats.iter().all(is_whole);
            all.extend(stats);
            if !goes_on {
                return Ok((Outcome::Interrupted, all));
            }
        }
        Ok((Outcome::Done, all))
    }

    /// Renders a sensor, and its companions with it. No statistics where an interrupt comes before
    /// the first pass.
    fn render_films(&self, films: &[Film]) -> Result<Vec<SensorStats>, CliError> {
        let Self {
            options, loaded, ..
        } = self;
        let cpu_start = cpu_seconds();
        let name_of = |film: &Film| &loaded.scene.sensors[film.sensor].name;
        let names: Vec<&str> = films.iter().map(|film| name_of(film).as_str()).collect();
        let name = names.join(", ");
        let viewer = |name: &&str| {
            let at = options.tev.as_ref()?;
            Some(Viewer::connect(at, name))
        };
        let mut viewers: Vec<Viewer> = names.iter().filter_map(viewer).collect::<Result<_, _>>()?;
        let waiting = Waiting::new(format!("{name}: preparing"), options.quiet);
        let begun = self.begin(films);
        drop(waiting);
        let Some(begun) = begun else {
            tell("interrupted before the first pass: there is nothing to save");
            return Ok(Vec::new());
        };
        let Begun {
            mut session,
            guides,
            photons,
        } = begun?;
        if options.resume {
            warn_of_gaps(&session);
        }
        if session.passes_left() == 0 && session.render().passes().is_empty() {
            return Err(CliError::Failed("there is no pass to render".to_owned()));
        }
        self.tell_choices(&session, photons.as_ref())?;
        let progress = Arc::new(Progress::new(&name, &session, self.rules, options.quiet));
        let bar = Arc::clone(&progress);
        session.observe(move |tiles| bar.tile(tiles));
        #[cfg(feature = "view")]
        if let Some(page) = &self.page {
            page.show(loaded, &session, &options.aov, &guides[0]);
        }
        let passes_to_see = (SAMPLES_TO_SEE / films[0].crop.pixels()).clamp(1, PASSES_TO_SEE);
        let targets: Vec<&Targets> = films.iter().map(|film| film.targets).collect();
        let mut saver = Saver::new(options, &targets, &guides, &self.interrupts);
        let stop = loop {
            let state = self.pool.install(|| session.step());
            if state.pass.is_some() {
                progress.pass(&state, &session);
            }
            #[cfg(feature = "view")]
            if let Some(page) = &self.page {
                page.follow(&session, &state);
            }
            for (viewer, render) in viewers.iter_mut().zip(session.render().and_companions()) {
                viewer.show(render, state.stop.is_some());
            }
            if state.pass.is_some() && state.passes == passes_to_see {
                session
                    .render()
                    .and_companions()
                    .for_each(|render| self.warn_of_black(render));
            }
            if state.save_is_due {
                let could = saver.save(&mut session);
                progress.saved(&session, could);
            }
            if let Some(reason) = state.stop {
                break reason;
            }
        };
        progress.clear();
        let previews = saver.finish(&session)?;
        let render = session.render();
        if render.passes().is_empty() {
            tell(if options.part.is_some() {
                "no pass is whole: the part holds what is done, there is no image (--resume goes on)"
            } else {
                "no pass is whole: there is no image (with --part FILE what is done would be kept)"
            });
        } else if (render.passes().len() as u64) < passes_to_see {
            render
                .and_companions()
                .for_each(|render| self.warn_of_black(render));
        }
        let each = render.and_companions().zip(films).zip(previews);
        let of = |((render, film), preview): ((&Render, &Film), Option<String>)| {
            let mut stats =
                SensorStats::new(name_of(film), render, stop, session.elapsed(), cpu_start);
            if film.sensor == films[0].sensor {
                stats.forecast = session.forecast(options.target_error);
            }
            if !render.passes().is_empty() {
                let (image, preview) = (&film.targets.image, preview.as_deref());
                self.say(|| summary::sensor(image, preview, &stats, &loaded.scene));
            }
            stats
        };
        Ok(each.map(of).collect())
    }

    /// A session of a sensor and its companions, with the passes of the part to go on with and the
    /// first hits that layers ask for. `None` where an interrupt comes before it is ready.
    fn begin(&self, films: &[Film]) -> Option<Result<Begun, CliError>> {
        let options = self.options;
        let session_options = SessionOptions {
            sensor: films[0].sensor,
            companions: films[1..].iter().map(|film| film.sensor).collect(),
            crop: Some(films[0].crop),
            outputs: self.request.clone(),
            passes: Some(self.passes.clone()),
            stop: self.rules,
            cancel: self.interrupts.cancel().clone(),
            live: true,
            save_interval: Some(save::first_interval(options)),
            pauses: options.part.is_some(),
            ..SessionOptions::default()
        };
        let part = options.part.clone();
        let part = part.filter(|path| options.resume && path.exists());
        let (scene, settings) = (Arc::clone(&self.loaded.scene), self.loaded.settings.clone());
        let layers = options.aov.clone();
        self.interrupts.unless_interrupted(self.pool, move || {
            let resumed = part.map(|path| Resumed::read(&path)).transpose()?;
            let session_options = SessionOptions {
                pilot: resumed.as_ref().map(|part| part.pilot),
                ..session_options
            };
            let mut session = Session::new(scene, &settings, session_options)?;
            if let Some(part) = resumed {
                part.restore(&mut session)?;
            }
            let guides = session
                .render()
                .and_companions()
                .map(|render| layers::guides_for(&layers, render))
                .collect();
            let photons = session.render().photon_memory();
            Ok(Begun {
                session,
                guides,
                photons,
            })
        })
    }

    /// Tells what the pilots have chosen, and checks what depends on it.
    fn tell_choices(
        &self,
        session: &Session,
        photons: Option<&PhotonMemory>,
    ) -> Result<(), CliError> {
        let (options, render) = (self.options, session.render());
        let checked = layers::check(&options.aov, &render);
        checked.map_err(|e| CliError::Usage(e.to_owned()))?;
        self.explain(|| summary::regularization(&render));
        let need = Need {
            photons: photons.map_or(0, PhotonMemory::bytes),
            ..self.need
        };
        if let (Some(radius), Some(memory)) = (render.radius(), photons) {
            self.explain(|| summary::merging(radius, memory));
            need.check(options.max_memory)?;
            if !memory.is_addressable() {
                return Err(CliError::Failed(
                    "a pass would have more than 4 billion photons: render with a smaller --crop"
                        .to_owned(),
                ));
            }
        }
        self.explain(|| summary::memory(&need));
        if !options.verbose {
            self.say(|| summary::in_short(&render, &need));
        }
        Ok(())
    }

    /// Warns of an image without any light: even where nothing else is printed, since hours may
    /// follow.
    fn warn_of_black(&self, render: &Render) {
        if render.xyz().iter().all(|v| *v == 0.0) {
            let sensor = &self.loaded.scene.sensors[render.sensor()];
            tell(&format!(
                "warning: the image of sensor \"{}\" is black: no light has reached it (is it inside \
                 of a body, behind one, or turned away from all light?)",
                sensor.name
            ));
        }
    }
}

/// Warns of passes that a resumed render leaves out.
fn warn_of_gaps(session: &Session) {
    if let Some((first, last)) = session.gap() {
        let passes = if first == last {
            format!("pass {first}")
        } else {
            format!("passes {first} to {last}")
        };
        tell(&format!(
            "warning: {passes} will be missing between those of the part and these: render them too"
        ));
    }
    if let Some(pass) = session.stranded() {
        tell(&format!(
            "warning: pass {pass} of the part is not whole and not among these: what is done of it is dropped"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn huge_times_are_no_limit() {
        assert_eq!(duration(1e300), Duration::MAX);
        assert_eq!(duration(1.5), Duration::from_millis(1500));
    }
}
