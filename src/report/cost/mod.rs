//! The cost of accuracy in time. Renders a matrix of variants of a scene, measures their errors
//! against time, and writes tables, images and a page that needs nothing but a browser.
//!
//! Seeds are the outer loop, so that whatever slows the machine for a while slows all variants.

mod cell;
mod data;
mod layers;
mod light;
mod matrix;
mod measure;
mod page;
mod pictures;
mod plot;
mod words;

pub use cell::MOST_PASSES;
pub use data::{Extent, Group, Outcome, ReferenceNote, Report};
pub use light::{ClassLight, ClassMissed, Missed};
pub use measure::{Measured, Measures, Spread, Summary, TimeTo};

use super::{ReportError, json};
use crate::io::atomic::{FileError, write_atomic};
use crate::io::identity::VERSION;
use crate::io::loaded::{self, LoadError, Loaded};
use crate::io::scene_file::SceneFileErrors;
use crate::math::image_error::mean_relative_square;
use crate::render::Cancel;
use cell::{Cell, Plan};
use matrix::{Base, Variant};
use measure::Luminance;
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Length of the reference, in cells.
pub const REFERENCE_CELLS: u32 = 8;
/// Seeds of the cells count from 1; the reference has one that no cell has.
const REFERENCE_SEED: u64 = 1_000_003;
/// Name of the page in the folder of a report.
pub const PAGE: &str = "report.html";

/// The report asked for.
#[derive(Clone, Debug)]
pub struct Request {
    /// The scene file.
    pub scene: PathBuf,
    /// Keys replaced for all variants.
    pub overrides: Vec<(String, String)>,
    /// The sensor; `None`: the first.
    pub sensor: Option<String>,
    /// The image that errors are measured against; `None`: one is rendered.
    pub reference: Option<PathBuf>,
    /// Length of a cell.
    pub extent: Extent,
    /// Seeds per variant.
    pub seeds: u32,
    /// Where files go.
    pub folder: PathBuf,
    /// Parts of the matrix.
    pub vary: Vec<Group>,
    /// The pixel whose value is plotted.
    pub probe: Option<[u32; 2]>,
}

/// Endings of the files of a study.
const WRITTEN: [&str; 5] = ["csv", "exr", "html", "json", "svg"];

/// A step of a study that is done.
#[derive(Debug)]
pub enum Event<'a> {
    /// The matrix is known.
    Begins {
        /// Variants.
        variants: usize,
        /// Length of all cells and the reference, in cells.
        cells: u32,
    },
    /// A cell is there.
    Cell {
        /// Seed of the cell; `None` for the reference and the strategies.
        seed: Option<u64>,
        /// Name for readers.
        label: &'a str,
        /// Whether it was rendered now, and not before.
        rendered: bool,
    },
    /// A variant does not go with the scene's other keys.
    LeftOut {
        /// Name for readers.
        label: &'a str,
        /// Why.
        problems: &'a SceneFileErrors,
    },
}

/// The image that errors are measured against.
#[derive(Debug)]
struct Reference {
    path: PathBuf,
    image: Luminance,
    /// How it was made.
    origin: String,
    /// Relative variance of its own, where it is known.
    variance: Option<f64>,
}

impl Reference {
    fn new(path: PathBuf, origin: String) -> Result<Self, ReportError> {
        let image = Luminance::read(&path)?;
        let noise = image.noise.as_ref();
        let variance = noise.map(|n| mean_relative_square(n, &image.y));
        Ok(Self {
            path,
            image,
            origin,
            variance,
        })
    }
}

/// A report in the making.
#[derive(Debug)]
pub struct Study {
    request: Request,
    loaded: Loaded,
    sensor: usize,
}

/// The cell, or `None` where the study was cancelled or the variant left out.
enum Made {
    Cell(Cell),
    LeftOut,
    Cancelled,
}

impl Study {
    /// Loads the scene.
    ///
    /// # Errors
    /// Where it does not load, or has no such sensor or pixel, or the folder cannot be made.
    pub fn new(request: Request) -> Result<Self, ReportError> {
        let loaded = loaded::load(&request.scene, &request.overrides)?;
        let sensor = loaded.sensor(request.sensor.as_deref())?;
        let seen_by = &loaded.scene.sensors[sensor];
        let size = seen_by.camera.resolution();
        if let Some([x, y]) = request
            .probe
            .filter(|p| p[0] >= size.width || p[1] >= size.height)
        {
            return Err(ReportError::Probe {
                x,
                y,
                sensor: seen_by.name.clone(),
                width: size.width,
                height: size.height,
            });
        }
        let folder = &request.folder;
        spare_inputs(folder, loaded.files.iter().chain(&request.reference))?;
        std::fs::create_dir_all(folder).map_err(|e| FileError::new(folder, e))?;
        Ok(Self {
            request,
            loaded,
            sensor,
        })
    }

    /// Renders what is not there yet, measures it, and writes the files of the report; `None` where
    /// it was cancelled. The same study goes on from the cells that are done.
    ///
    /// # Errors
    /// Where a file cannot be read or written.
    pub fn run(
        &self,
        threads: usize,
        cancel: &Cancel,
        tell: &mut dyn FnMut(Event),
    ) -> Result<Option<Report>, ReportError> {
        let request = &self.request;
        let plan = Plan {
            scene: &request.scene,
            overrides: &request.overrides,
            sensor: self.sensor,
            folder: &request.folder,
            threads,
            cancel,
        };
        let base = Base::new(&self.loaded, self.sensor);
        let variants = base.variants(&request.vary);
        let cells = variants.len() as u32 * request.seeds;
        let by_class: Vec<(String, Variant)> = match request.vary.contains(&Group::Methods) {
            true => variants
                .iter()
                .filter_map(|v| Some((v.id.clone(), v.by_class()?)))
                .collect(),
            false => Vec::new(),
        };
        // and the strategies one by one
        let others =
            1 + by_class.len() as u32 + request.reference.as_ref().map_or(REFERENCE_CELLS, |_| 0);
        tell(Event::Begins {
            variants: variants.len(),
            cells: cells + others,
        });
        let Some(reference) = self.reference(&plan, &base, tell)? else {
            return Ok(None);
        };
        let mut measured: Vec<(Variant, Vec<Measured>)> =
            variants.into_iter().map(|v| (v, Vec::new())).collect();
        for seed in 1..=u64::from(request.seeds) {
            let mut failed = Vec::new();
            for (variant, points) in &mut measured {
                match self.cell(&plan, variant, Some(seed), tell)? {
                    Made::Cell(cell) => {
                        let (image, probe) = (&reference.image, request.probe);
                        points.extend(measure::measure(plan.folder, &cell, image, probe)?);
                    }
                    Made::LeftOut => failed.push(variant.id.clone()),
                    Made::Cancelled => return Ok(None),
                }
            }
            measured.retain(|(variant, _)| !failed.contains(&variant.id));
        }
        let mut light: Vec<(String, Vec<ClassLight>)> = Vec::new();
        for (id, variant) in &by_class {
            match self.cell(&plan, variant, None, tell)? {
                Made::Cell(cell) => light.push((id.clone(), cell.classes)),
                Made::LeftOut => {}
                Made::Cancelled => return Ok(None),
            }
        }
        let strategies = match self.cell(&plan, &base.layers(), None, tell)? {
            Made::Cell(cell) => layers::section(&plan.last_image(&cell)?)?,
            Made::LeftOut => String::new(),
            Made::Cancelled => return Ok(None),
        };
        let report = self.report(threads, &reference, measured, &light);
        self.write(&report, &reference, &strategies)?;
        Ok(Some(report))
    }

    /// The reference, read or rendered; `None` where it was cancelled.
    fn reference(
        &self,
        plan: &Plan,
        base: &Base,
        tell: &mut dyn FnMut(Event),
    ) -> Result<Option<Reference>, ReportError> {
        if let Some(path) = &self.request.reference {
            // reports are passed on: they hold no folders of this machine
            return Reference::new(path.clone(), file_name(path)).map(Some);
        }
        let variant = base.reference();
        let extent = self.request.extent.times(REFERENCE_CELLS);
        let Some((cell, rendered)) = plan.cell(&variant, REFERENCE_SEED, extent)? else {
            return Ok(None);
        };
        tell(Event::Cell {
            seed: None,
            label: &format!("reference: {}", variant.label),
            rendered,
        });
        Reference::new(plan.last_image(&cell)?, variant.label).map(Some)
    }

    /// The cell of a variant. One whose keys do not go with the scene's others, such as a filter or
    /// a resolution, is left out.
    fn cell(
        &self,
        plan: &Plan,
        variant: &Variant,
        seed: Option<u64>,
        tell: &mut dyn FnMut(Event),
    ) -> Result<Made, ReportError> {
        let label = &variant.label;
        match plan.cell(variant, seed.unwrap_or(1), self.request.extent) {
            Ok(Some((cell, rendered))) => {
                tell(Event::Cell {
                    seed,
                    label,
                    rendered,
                });
                Ok(Made::Cell(cell))
            }
            Ok(None) => Ok(Made::Cancelled),
            Err(ReportError::Load(LoadError::SceneFile(problems))) if !variant.is_base() => {
                let problems = &problems;
                tell(Event::LeftOut { label, problems });
                Ok(Made::LeftOut)
            }
            Err(error) => Err(error),
        }
    }

    fn report(
        &self,
        threads: usize,
        reference: &Reference,
        measured: Vec<(Variant, Vec<Measured>)>,
        light: &[(String, Vec<ClassLight>)],
    ) -> Report {
        let (request, scene) = (&self.request, &self.loaded.scene);
        let sensor = &scene.sensors[self.sensor];
        let size = sensor.camera.resolution();
        let equal_time_seconds = measured
            .iter()
            .map(|(_, points)| measure::common_seconds(points))
            .fold(f64::INFINITY, f64::min);
        let floor = reference.variance.unwrap_or(0.0);
        let tables: Vec<&[ClassLight]> = light.iter().map(|(_, table)| &table[..]).collect();
        let names = light.iter().map(|(id, _)| id.clone());
        let mut missed: BTreeMap<String, Missed> = names.zip(light::missed(&tables)).collect();
        let mut outcome = |(variant, points): (Variant, Vec<Measured>)| Outcome {
            missed: missed.remove(&variant.id),
            id: variant.id,
            label: variant.label,
            groups: variant.groups,
            keys: variant.overrides,
            summary: measure::summarize(&points, floor, equal_time_seconds),
            points,
        };
        let variants: Vec<Outcome> = measured.into_iter().map(&mut outcome).collect();
        let media = scene.media.iter();
        Report {
            version: VERSION.to_owned(),
            scene: file_name(&request.scene),
            scene_hash: format!("{:016x}", scene.hash),
            sensor: sensor.name.clone(),
            size: [size.width, size.height],
            media: media
                .map(|m| format!("{}: {}", m.name, m.ior.name()))
                .collect(),
            lights: scene.light_names.clone(),
            effects: scene.effects.clone(),
            cpu: cpu_name(),
            threads,
            extent: request.extent,
            seeds: request.seeds,
            overrides: request.overrides.clone(),
            probe: request.probe,
            reference: ReferenceNote {
                image: file_name(&reference.path),
                origin: reference.origin.clone(),
                relative_error: reference.variance.map(f64::sqrt),
            },
            equal_time_seconds,
            sentences: words::sentences(&variants, reference.variance),
            variants,
        }
    }

    /// Writes the views of a report.
    fn write(
        &self,
        report: &Report,
        reference: &Reference,
        strategies: &str,
    ) -> Result<(), ReportError> {
        let folder = &self.request.folder;
        let write = |name: &str, text: &str| {
            write_atomic(&folder.join(name), |w| w.write_all(text.as_bytes()))
        };
        write("cost.csv", &report.csv())?;
        json::write(&folder.join("cost.json"), report)?;
        for plot in page::plots(&report.variants) {
            write(&format!("{}.svg", plot.id), &plot.file())?;
        }
        write(PAGE, &page::page(report, folder, reference, strategies)?)?;
        Ok(())
    }
}

/// Refuses a folder in which what is read has a name that a study might write.
fn spare_inputs<'a>(
    folder: &Path,
    inputs: impl Iterator<Item = &'a PathBuf>,
) -> Result<(), ReportError> {
    let Ok(folder) = folder.canonicalize() else {
        // it is not there yet
        return Ok(());
    };
    for input in inputs {
        let Ok(file) = input.canonicalize() else {
            continue;
        };
        let ending = file.extension().unwrap_or_default().to_string_lossy();
        if file.parent() == Some(&folder) && WRITTEN.contains(&ending.to_lowercase().as_str()) {
            return Err(ReportError::File {
                path: input.clone(),
                message: "is read by this command and in the folder that it writes to \
                          (allowed: a folder of its own)"
                    .to_owned(),
            });
        }
    }
    Ok(())
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Name of the processor, where the system tells it (Linux).
fn cpu_name() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
