//! Bands: what sharing wavelengths and times in a pass does, photon merging beside bidirectional
//! path tracing.
//!
//! After figure 6 and table 1 of Bouchard, Iehl, Ostromoukhov and Poulin, "Improving Robustness of
//! Monte-Carlo Global Illumination with Directional Regularization" (2013). All renders have the
//! box filter, so that the errors of pixels are independent where paths are. Renders that merge are
//! without regularization, as are those of `bdpt` but the one that shows it.

mod view;

use super::ReportError;
use super::compare::{ColorLines, Xyz, bands};
use crate::film::{Crop, Filter};
use crate::io::loaded::{self, Loaded};
use crate::math::banding::Banding;
use crate::math::image_error::image_error;
use crate::render::session::NO_LIMIT;
use crate::render::{Progress, Render, Session, SessionOptions, SharedWavelengths};
use crate::scene::effects::EffectKind;
use std::ops::{ControlFlow, Range};
use std::path::PathBuf;
use std::sync::Arc;

/// The comparison asked for.
#[derive(Clone, Debug)]
pub struct BandingStudy {
    /// The scene file.
    pub scene: PathBuf,
    /// Keys of the scene file that all renders replace.
    pub overrides: Vec<(String, String)>,
    /// The sensor; `None`: the first.
    pub sensor: Option<String>,
    /// Numbers of passes after which images are compared, in any order.
    pub passes: Vec<u32>,
    /// Passes of the reference.
    pub reference_passes: u32,
    /// Renders of each method, at least 1.
    pub seeds: u32,
    /// Where colors run.
    pub lines: ColorLines,
}

/// A way to render the scene; each is a column of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Method {
    /// Merging; all paths of a pass share their wavelengths.
    Vcm,
    /// The same with the wavelengths of successive passes kept apart.
    VcmStratified,
    /// Without merging, after as many passes.
    BdptPasses,
    /// Without merging, after the CPU time that merging took.
    BdptTime,
    /// The same with regularization in place of solved chains.
    RegularizedTime,
}

impl Method {
    fn name(self) -> &'static str {
        match self {
            Self::Vcm => "vcm",
            Self::VcmStratified => "vcm, stratified passes",
            Self::BdptPasses => "bdpt, as many passes",
            Self::BdptTime => "bdpt, as much time",
            Self::RegularizedTime => "bdpt regularized, as much time",
        }
    }

    /// Integrator, sharing, regularization, aims.
    fn keys(self) -> [(&'static str, &'static str); 4] {
        let [integrator, sharing, regularize, aim] = match self {
            Self::Vcm => ["vcm", "hero", "off", "off"],
            Self::VcmStratified => ["vcm", "stratified", "off", "off"],
            Self::BdptPasses | Self::BdptTime => ["bdpt", "hero", "off", "auto"],
            Self::RegularizedTime => ["bdpt", "hero", "mis", "off"],
        };
        [
            ("render.integrator", integrator),
            ("render.sharing", sharing),
            ("render.regularize", regularize),
            ("render.aim", aim),
        ]
    }
}

/// One image.
#[derive(Debug)]
struct Shot {
    passes: usize,
    /// CPU seconds of all threads.
    seconds: f64,
    xyz: Xyz,
    shared: Option<SharedWavelengths>,
}

/// Measures of the image of a seed.
#[derive(Debug)]
struct Measured {
    passes: usize,
    seconds: f64,
    bands: [Banding; 3],
    rel_mse: f64,
}

/// A method at one place in the list of passes: the image of the first seed, measures of all.
#[derive(Debug)]
struct Row {
    method: Method,
    image: Xyz,
    shared: Option<SharedWavelengths>,
    measured: Vec<Measured>,
}

/// Memory of light vertices.
#[derive(Clone, Copy, Debug, Default)]
struct Memory {
    bytes_per_vertex: u64,
    vertices_per_path: f64,
}

/// Choices that all renders of the comparison have in common.
struct Plan<'a> {
    study: &'a BandingStudy,
    /// Keys of the scene file that all of them replace.
    overrides: Vec<(String, String)>,
    sensor: usize,
    crop: Crop,
    /// Numbers of passes, ascending.
    passes: Vec<u32>,
}

/// The images and their bands.
#[derive(Debug)]
pub struct Findings {
    /// By place in the list of passes, then method.
    rows: Vec<Row>,
    methods: Vec<Method>,
    memory: Memory,
    size: (u32, u32),
    passes: Vec<u32>,
    title: String,
    seeds: u32,
    reference_passes: u32,
}

impl BandingStudy {
    /// Renders everything and measures it.
    ///
    /// # Errors
    /// Where the scene does not load, or the region is not on its film or has no bands.
    pub fn run(&self) -> Result<Findings, ReportError> {
        let plan = Plan::new(self)?;
        // another seed: its errors must not be those of the images
        let loaded = plan.load(Method::BdptPasses, 1)?;
        let mut session = plan.session(&loaded, 0..self.reference_passes)?;
        session.run();
        let reference = image(&session.render());
        let methods = plan.methods(&loaded);
        let mut rows: Vec<Row> = Vec::new();
        let mut memory = None;
        for seed in (0..u64::from(self.seeds) + 1).filter(|seed| *seed != 1) {
            let (merged, vertices) = plan.merging(Method::Vcm, seed)?;
            memory.get_or_insert(vertices);
            let times: Vec<f64> = merged.iter().map(|shot| shot.seconds).collect();
            let mut columns = vec![merged];
            for &method in &methods[1..] {
                columns.push(match method {
                    Method::Vcm | Method::VcmStratified => plan.merging(method, seed)?.0,
                    Method::BdptPasses => plan.by_passes(method, seed)?,
                    Method::BdptTime | Method::RegularizedTime => {
                        plan.by_time(method, seed, &times)?
                    }
                });
            }
            let mut columns: Vec<_> = columns.into_iter().map(Vec::into_iter).collect();
            let lines = (0..plan.passes.len()).flat_map(|_| 0..methods.len());
            for (place, column) in lines.enumerate() {
                let Some(shot) = columns[column].next() else {
                    continue;
                };
                let measured = plan.measure(&shot, &reference)?;
                match rows.get_mut(place) {
                    Some(row) => row.measured.push(measured),
                    None => rows.push(Row {
                        method: methods[column],
                        image: shot.xyz,
                        shared: shot.shared,
                        measured: vec![measured],
                    }),
                }
            }
        }
        let title = self.scene.file_stem().unwrap_or_default();
        Ok(Findings {
            rows,
            methods,
            memory: memory.unwrap_or_default(),
            size: (plan.crop.width(), plan.crop.height()),
            passes: plan.passes,
            title: title.to_string_lossy().into_owned(),
            seeds: self.seeds,
            reference_passes: self.reference_passes,
        })
    }
}

fn image(render: &Render) -> Xyz {
    let crop = render.crop();
    Xyz {
        size: (crop.width(), crop.height()),
        values: render.xyz(),
        of: [None, None],
    }
}

impl<'a> Plan<'a> {
    /// Finds the sensor; what is wrong with the options is found before anything is rendered.
    fn new(study: &'a BandingStudy) -> Result<Self, ReportError> {
        let fixed = [("render.filter".to_owned(), "box".to_owned())];
        let mut overrides: Vec<_> = study.overrides.iter().cloned().chain(fixed).collect();
        let loaded = loaded::load(&study.scene, &overrides)?;
        let sensor = loaded.sensor(study.sensor.as_deref())?;
        let seen_by = &loaded.scene.sensors[sensor];
        if seen_by.filter != Filter::Box {
            // it has a filter of its own
            overrides.push((format!("sensor.{sensor}.filter"), "box".to_owned()));
        }
        let crop = seen_by.whole_film();
        study.lines.region((crop.width(), crop.height()))?;
        let mut passes = study.passes.clone();
        passes.sort_unstable();
        passes.dedup();
        Ok(Self {
            study,
            overrides,
            sensor,
            crop,
            passes,
        })
    }

    /// The columns of the comparison; regularization has its own where anything is smooth.
    fn methods(&self, loaded: &Loaded) -> Vec<Method> {
        use Method::{BdptPasses, BdptTime, RegularizedTime, Vcm, VcmStratified};
        let mut methods = vec![Vcm, VcmStratified, BdptPasses, BdptTime];
        let camera = &loaded.scene.sensors[self.sensor].camera;
        if loaded.scene.has_effect(EffectKind::Specular) && !camera.is_hittable() {
            methods.push(RegularizedTime);
        }
        methods
    }

    /// The scene as one method renders it; `seed` is added to the scene's.
    fn load(&self, method: Method, seed: u64) -> Result<Loaded, ReportError> {
        let method = method
            .keys()
            .map(|(key, value)| (key.to_owned(), value.to_owned()));
        let overrides: Vec<_> = self.overrides.iter().cloned().chain(method).collect();
        let mut loaded = loaded::load(&self.study.scene, &overrides)?;
        loaded.settings.seed = loaded.settings.seed.wrapping_add(seed);
        Ok(loaded)
    }

    fn session(&self, loaded: &Loaded, passes: Range<u32>) -> Result<Session, ReportError> {
        let options = SessionOptions {
            sensor: self.sensor,
            passes: Some(passes),
            ..SessionOptions::default()
        };
        let scene = Arc::clone(&loaded.scene);
        Ok(Session::new(scene, &loaded.settings, options)?)
    }

    /// Images with merging after each number of passes, ascending.
    fn merging(&self, method: Method, seed: u64) -> Result<(Vec<Shot>, Memory), ReportError> {
        let loaded = self.load(method, seed)?;
        let last = self.passes.last().copied().unwrap_or(0);
        let mut session = self.session(&loaded, 0..last)?;
        let mut shots = Vec::new();
        session.run_with(|session, progress| {
            if self.passes.contains(&(progress.passes as u32)) {
                let render = session.render();
                shots.push(Shot {
                    passes: progress.passes as usize,
                    seconds: progress.time.cpu_seconds(),
                    xyz: image(&render),
                    shared: render.shared_wavelengths(),
                });
            }
            Ok::<_, ReportError>(ControlFlow::Continue(()))
        })?;
        let render = session.render();
        let counters = render.counters();
        let memory = Memory {
            bytes_per_vertex: render.bytes_per_photon().unwrap_or(0),
            vertices_per_path: counters.photons as f64 / counters.paths.max(1) as f64,
        };
        Ok((shots, memory))
    }

    /// Images without merging after each number of passes, ascending.
    fn by_passes(&self, method: Method, seed: u64) -> Result<Vec<Shot>, ReportError> {
        let loaded = self.load(method, seed)?;
        let last = self.passes.last().copied().unwrap_or(0);
        let mut session = self.session(&loaded, 0..last)?;
        let mut shots = Vec::new();
        session.run_with(|session, progress| {
            if self.passes.contains(&(progress.passes as u32)) {
                shots.push(shot(session, progress));
            }
            Ok::<_, ReportError>(ControlFlow::Continue(()))
        })?;
        Ok(shots)
    }

    /// Images without merging after each of these CPU times, ascending.
    fn by_time(&self, method: Method, seed: u64, times: &[f64]) -> Result<Vec<Shot>, ReportError> {
        let loaded = self.load(method, seed)?;
        let mut session = self.session(&loaded, 0..NO_LIMIT)?;
        let mut shots = Vec::new();
        session.run_with(|session, progress| {
            let seconds = progress.time.cpu_seconds();
            while times.get(shots.len()).is_some_and(|time| *time <= seconds) {
                shots.push(shot(session, progress));
            }
            Ok::<_, ReportError>(if shots.len() == times.len() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            })
        })?;
        Ok(shots)
    }

    fn measure(&self, shot: &Shot, reference: &Xyz) -> Result<Measured, ReportError> {
        let width = self.crop.width() as usize;
        let error = image_error(&shot.xyz.channel(1), &reference.channel(1), width);
        Ok(Measured {
            passes: shot.passes,
            seconds: shot.seconds,
            bands: bands(&shot.xyz, Some(reference), &self.study.lines)?,
            rel_mse: error.rel_mse,
        })
    }
}

/// An image without merging.
fn shot(session: &Session, progress: &Progress) -> Shot {
    Shot {
        passes: progress.passes as usize,
        seconds: progress.time.cpu_seconds(),
        xyz: image(&session.render()),
        shared: None,
    }
}
