//! `abbe cost`: what accuracy costs in time. Renders a matrix of variants of a scene, measures their errors against time, and
//! writes tables, images and a report that needs nothing but a browser.
//!
//! Seeds are the outer loop, so that whatever slows the machine for a while slows all variants.

mod cell;
mod layers;
mod matrix;
mod measure;
mod page;
mod pictures;
mod plot;
mod words;

use super::args::{CostGroup, CostOptions};
use super::interrupt;
use super::load::{self, Loaded};
use super::readable::duration;
use super::stats::effects_json;
use super::{CliError, Outcome, print, threads};
use crate::io::atomic::{FileError, write_atomic};
use crate::io::identity::VERSION;
use crate::math::image_error::mean_relative_square;
use cell::{Cell, Plan};
use matrix::{Base, Variant};
use measure::{Luminance, Measured, Summary};
use serde_json::{Value, json};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The reference has this many times the time of a cell.
const REFERENCE_BUDGETS: f64 = 8.0;
/// Seeds of the cells count from 1; the reference has one that no cell has.
const REFERENCE_SEED: u64 = 1_000_003;

/// A variant with all that was measured of it.
#[derive(Debug)]
struct Outcomes {
    variant: Variant,
    points: Vec<Measured>,
    summary: Summary,
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
    fn new(path: PathBuf, origin: String) -> Result<Self, CliError> {
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

/// Runs the command.
pub fn run(options: &CostOptions) -> Result<Outcome, CliError> {
    let overrides = &options.overrides.set;
    let loaded = load::load(&options.scene, overrides)?;
    let sensor = sensor(options, &loaded)?;
    let folder = options.output.clone().unwrap_or_else(|| {
        let mut name = options.scene.file_stem().unwrap_or_default().to_owned();
        name.push(".cost");
        name.into()
    });
    std::fs::create_dir_all(&folder).map_err(|e| FileError::new(&folder, e))?;
    let interrupt = interrupt::listen()?;
    let pool = threads::pool(options.threads)?;
    let plan = Plan {
        scene: &options.scene,
        overrides: overrides.clone(),
        sensor,
        folder: &folder,
        interrupt,
    };
    pool.install(|| report(options, &loaded, &plan))
}

fn sensor(options: &CostOptions, loaded: &Loaded) -> Result<usize, CliError> {
    let scene = &loaded.scene;
    let sensor = loaded.sensor(options.sensor.as_deref())?;
    let size = scene.sensors[sensor].camera.resolution();
    match options.probe {
        Some([x, y]) if x >= size.width || y >= size.height => Err(CliError::Usage(format!(
            "probe {x},{y} is beyond sensor \"{}\" of {} x {} pixels",
            scene.sensors[sensor].name, size.width, size.height
        ))),
        _ => Ok(sensor),
    }
}

fn report(options: &CostOptions, loaded: &Loaded, plan: &Plan) -> Result<Outcome, CliError> {
    let say = |text: &str| {
        if !options.quiet {
            print(text);
        }
    };
    let base = Base::new(loaded, plan.sensor);
    let variants = base.variants(&options.vary);
    let cells = variants.len() * options.seeds as usize;
    // and the strategies one by one
    let others = 1.0
        + if options.reference.is_some() {
            0.0
        } else {
            REFERENCE_BUDGETS
        };
    say(&format!(
        "{} variants, {} seeds, {} each: about {} in all\n",
        variants.len(),
        options.seeds,
        duration(options.budget),
        duration((cells as f64 + others) * options.budget)
    ));
    let reference = match &options.reference {
        Some(path) => Reference::new(path.clone(), format!("{}", path.display()))?,
        None => {
            let variant = base.reference();
            let budget = REFERENCE_BUDGETS * options.budget;
            let Some((cell, rendered)) = plan.cell(&variant, REFERENCE_SEED, budget)? else {
                return Ok(interrupted(&say));
            };
            say(&format!(
                "  reference: {}{}\n",
                variant.label,
                kept(rendered)
            ));
            let last = cell.snapshots.last().map(|s| plan.folder.join(&s.image));
            let path = last.ok_or_else(|| CliError::Failed("there is no reference".to_owned()))?;
            Reference::new(path, variant.label)?
        }
    };
    let mut measured: Vec<(Variant, Vec<Measured>)> =
        variants.into_iter().map(|v| (v, Vec::new())).collect();
    for seed in 1..=u64::from(options.seeds) {
        let mut failed = Vec::new();
        for (variant, points) in &mut measured {
            let cell: Cell = match plan.cell(variant, seed, options.budget) {
                Ok(Some((cell, rendered))) => {
                    say(&format!(
                        "  seed {seed}: {}{}\n",
                        variant.label,
                        kept(rendered)
                    ));
                    cell
                }
                Ok(None) => return Ok(interrupted(&say)),
                // such as a filter that does not go with the scene's other keys
                Err(CliError::SceneFile(problems)) if !variant.groups.is_empty() => {
                    say(&format!("  left out: {}: {problems}\n", variant.label));
                    failed.push(variant.id.clone());
                    continue;
                }
                Err(error) => return Err(error),
            };
            points.extend(measure::measure(
                plan.folder,
                &cell,
                &reference.image,
                options.probe,
            )?);
        }
        measured.retain(|(variant, _)| !failed.contains(&variant.id));
    }
    let strategies = match plan.cell(&base.layers(), 1, options.budget) {
        Ok(Some((cell, rendered))) => {
            say(&format!("  strategies{}\n", kept(rendered)));
            let last = cell.snapshots.last();
            last.map(|s| layers::section(&plan.folder.join(&s.image)))
                .transpose()?
        }
        Ok(None) => return Ok(interrupted(&say)),
        // such as a detector whose resolution follows from its pitch
        Err(CliError::SceneFile(problems)) => {
            say(&format!("  left out: strategies: {problems}\n"));
            None
        }
        Err(error) => return Err(error),
    };
    let floor = reference.variance.unwrap_or(0.0);
    let equal_seconds = measured
        .iter()
        .map(|(_, points)| measure::common_seconds(points))
        .fold(f64::INFINITY, f64::min);
    let results: Vec<Outcomes> = measured
        .into_iter()
        .map(|(variant, points)| Outcomes {
            summary: measure::summarize(&points, floor, equal_seconds),
            variant,
            points,
        })
        .collect();
    let mut data = data(options, loaded, plan, &reference, &results);
    data["equal_time_seconds"] = json!(equal_seconds);
    let path = |name: &str| plan.folder.join(name);
    write_atomic(&path("cost.csv"), |w| w.write_all(csv(&results).as_bytes()))?;
    write_atomic(&path("cost.json"), |w| writeln!(w, "{data:#}"))?;
    for plot in page::plots(&results) {
        let file = format!("{}.svg", plot.id);
        write_atomic(&path(&file), |w| w.write_all(plot.file().as_bytes()))?;
    }
    let strategies = strategies.unwrap_or_default();
    let html = page::page(&data, plan.folder, &reference, &results, strategies)?;
    write_atomic(&path("report.html"), |w| w.write_all(html.as_bytes()))?;
    for sentence in words::sentences(&results, reference.variance) {
        say(&format!("{sentence}\n"));
    }
    say(&format!("{}\n", path("report.html").display()));
    Ok(Outcome::Done)
}

fn kept(rendered: bool) -> &'static str {
    if rendered {
        ""
    } else {
        " (as rendered before)"
    }
}

fn interrupted(say: &impl Fn(&str)) -> Outcome {
    say("interrupted; the same command goes on from the cells that are done\n");
    Outcome::Interrupted
}

/// The table of all points.
fn csv(results: &[Outcomes]) -> String {
    let mut text = "variant,seed,passes,cpu_seconds,wall_seconds,rel_mse,trimmed_rel_mse,log_rmse,rel_variance,mean_ratio,probe,image\n"
        .to_owned();
    for result in results {
        for p in &result.points {
            let e = &p.errors;
            let row = [
                result.variant.id.clone(),
                p.seed.to_string(),
                p.passes.to_string(),
                p.cpu_seconds.to_string(),
                p.wall_seconds.to_string(),
                e.rel_mse.to_string(),
                e.trimmed_rel_mse.to_string(),
                e.log_rmse.to_string(),
                e.rel_variance.to_string(),
                e.mean_ratio.to_string(),
                p.probe.map(|v| v.to_string()).unwrap_or_default(),
                p.image.clone(),
            ];
            text.push_str(&row.join(","));
            text.push('\n');
        }
    }
    text
}

/// All that the report says, as data.
fn data(
    options: &CostOptions,
    loaded: &Loaded,
    plan: &Plan,
    reference: &Reference,
    results: &[Outcomes],
) -> Value {
    let scene = &loaded.scene;
    let sensor = &scene.sensors[plan.sensor];
    let size = sensor.camera.resolution();
    let group = |g: &CostGroup| match g {
        CostGroup::Methods => "methods",
        CostGroup::Effects => "effects",
        CostGroup::Settings => "settings",
    };
    let variants: Vec<Value> = results
        .iter()
        .map(|r| {
            json!({
                "id": r.variant.id,
                "label": r.variant.label,
                "groups": r.variant.groups.iter().map(group).collect::<Vec<_>>(),
                "keys": r.variant.overrides,
                "summary": r.summary,
                "points": r.points,
            })
        })
        .collect();
    let file = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned());
    json!({
        "version": VERSION,
        "scene": file(&options.scene),
        "scene_hash": format!("{:016x}", scene.hash),
        "sensor": sensor.name,
        "size": [size.width, size.height],
        "media": scene.media.iter().map(|m| format!("{}: {}", m.name, m.ior.name())).collect::<Vec<_>>(),
        "lights": scene.light_names,
        "effects": effects_json(&scene.effects),
        "cpu": cpu_name(),
        "threads": rayon::current_num_threads(),
        "budget_seconds": options.budget,
        "seeds": options.seeds,
        "overrides": options.overrides.set,
        "probe": options.probe,
        "reference": {
            "image": file(&reference.path),
            "origin": reference.origin,
            "relative_error": reference.variance.map(f64::sqrt),
        },
        "sentences": words::sentences(results, reference.variance),
        "variants": variants,
    })
}

/// Name of the processor, where the system tells it (Linux).
fn cpu_name() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
