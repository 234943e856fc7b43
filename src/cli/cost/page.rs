//! The report: one HTML page with its data, plots and pictures inside. It asks for nothing from anywhere.

use super::super::CliError;
use super::super::args::CostGroup;
use super::super::readable::percent;
use super::measure::{Measured, TARGETS};
use super::pictures::{self, Picture};
use super::plot::{Curve, Plot, escape};
use super::words::time_to;
use super::{Outcomes, Reference};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;

const TEMPLATE: &str = include_str!("page.html");

/// The page.
///
/// # Errors
/// Where an image cannot be read.
pub fn page(
    data: &Value,
    folder: &Path,
    reference: &Reference,
    results: &[Outcomes],
) -> Result<String, CliError> {
    let pictures = all_pictures(folder, reference, results)?;
    let title = data["scene"].as_str().unwrap_or_default();
    let parts = [
        ("TITLE", escape(title)),
        ("CARD", card(data)),
        ("SENTENCES", list(data)),
        ("TABLE", table(results)),
        ("PLOTS", plots(results)),
        ("BRIGHTEST", pictures::BRIGHTEST.to_string()),
        ("FULL_ERROR", percent(pictures::FULL_ERROR)),
        ("PICTURES", script(&serde_json::json!(pictures))),
        ("DATA", script(data)),
    ];
    let mut page = String::new();
    let mut rest = TEMPLATE;
    // what is put in is not searched again
    while let Some((before, after)) = rest.split_once("{{") {
        page.push_str(before);
        let Some((name, after)) = after.split_once("}}") else {
            break;
        };
        let part = parts.iter().find(|p| p.0 == name);
        page.push_str(part.map_or("", |p| &p.1));
        rest = after;
    }
    Ok(page + rest)
}

/// JSON that is safe inside a script element.
fn script(value: &Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

fn all_pictures(
    folder: &Path,
    reference: &Reference,
    results: &[Outcomes],
) -> Result<Vec<Picture>, CliError> {
    let exposure = pictures::exposure(reference);
    let first = pictures::picture("reference", "reference", &reference.path, exposure, None)?;
    let mut all: Vec<Picture> = first.into_iter().collect();
    for result in results {
        // the last image of the first seed
        let seed = result.points.first().map(|p| p.seed);
        let Some(last) = result.points.iter().rfind(|p| Some(p.seed) == seed) else {
            continue;
        };
        let (id, label) = (&result.variant.id, &result.variant.label);
        let path = folder.join(&last.image);
        all.extend(pictures::picture(
            id,
            label,
            &path,
            exposure,
            Some(reference),
        )?);
    }
    Ok(all)
}

fn card(data: &Value) -> String {
    let text = |v: &Value| match v {
        Value::String(s) => s.clone(),
        Value::Null => "not known".to_owned(),
        Value::Array(a) if a.is_empty() => "none".to_owned(),
        Value::Array(a) => a
            .iter()
            .map(|v| v.as_str().map_or_else(|| v.to_string(), str::to_owned))
            .collect::<Vec<_>>()
            .join(", "),
        other => other.to_string(),
    };
    let on: Vec<Value> = data["effects"].as_array().map_or_else(Vec::new, |effects| {
        let on = effects.iter().filter(|e| e["on"] == true);
        on.map(|e| e["name"].clone()).collect()
    });
    let effects = Value::Array(on);
    let rows = [
        ("scene", &data["scene"]),
        ("hash", &data["scene_hash"]),
        ("sensor", &data["sensor"]),
        ("pixels", &data["size"]),
        ("media", &data["media"]),
        ("lights", &data["lights"]),
        ("effects", &effects),
        ("keys replaced", &data["overrides"]),
        ("seeds", &data["seeds"]),
        ("seconds per cell", &data["budget_seconds"]),
        ("version", &data["version"]),
        ("processor", &data["cpu"]),
        ("threads", &data["threads"]),
        ("reference", &data["reference"]["origin"]),
    ];
    let row = |(name, value): &(&str, &Value)| {
        format!("<dt>{name}</dt><dd>{}</dd>", escape(&text(value)))
    };
    rows.iter().map(row).collect()
}

fn list(data: &Value) -> String {
    let sentences = data["sentences"].as_array().into_iter().flatten();
    sentences
        .filter_map(Value::as_str)
        .map(|s| format!("<li>{}</li>", escape(s)))
        .collect()
}

fn table(results: &[Outcomes]) -> String {
    let mut html = "<tr><th>variant</th><th>CPU s per sample</th><th>CPU s to variance 1</th><th>error at the end</th><th>bias</th>"
        .to_owned();
    for target in TARGETS {
        _ = write!(html, "<th>to {}</th>", percent(target));
    }
    html += "</tr>";
    for result in results {
        let s = &result.summary;
        let bias = if s.bias > s.bias_noise {
            percent(s.bias)
        } else {
            format!("below {}", percent(s.bias_noise))
        };
        let with_error = |v: super::measure::Spread| match v.error {
            Some(e) => format!("{:.3} ± {:.1} %", v.mean, 100.0 * e / v.mean),
            None => format!("{:.3}", v.mean),
        };
        _ = write!(
            html,
            "<tr><th>{}</th><td>{}</td><td>{}</td><td>{}</td><td>{bias}</td>",
            escape(&result.variant.label),
            with_error(s.pass_seconds),
            with_error(s.unit_variance_seconds),
            percent(s.final_error.mean)
        );
        for time in &s.time_to {
            _ = write!(html, "<td>{}</td>", time_to(time));
        }
        html += "</tr>";
    }
    html
}

/// A curve over the passes that all seeds have.
fn curve(
    result: &Outcomes,
    x: impl Fn(&Measured) -> f64,
    y: impl Fn(&Measured) -> Option<f64>,
) -> Curve {
    let seeds = result
        .points
        .iter()
        .map(|p| p.seed)
        .collect::<std::collections::BTreeSet<_>>();
    let mut passes: Vec<u32> = result.points.iter().map(|p| p.passes).collect();
    passes.sort_unstable();
    passes.dedup();
    let point = |n: u32| {
        let here = || result.points.iter().filter(|p| p.passes == n);
        let values: Vec<f64> = here().filter_map(&y).collect();
        if values.len() < seeds.len() {
            return None;
        }
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let xs: Vec<f64> = here().map(&x).collect();
        let (low, high) = (
            values.iter().copied().fold(f64::INFINITY, f64::min),
            values.iter().copied().fold(0.0, f64::max),
        );
        Some([mean(&xs), mean(&values), low, high])
    };
    Curve {
        id: result.variant.id.clone(),
        label: result.variant.label.clone(),
        points: passes.into_iter().filter_map(point).collect(),
    }
}

fn plots(results: &[Outcomes]) -> String {
    const TIME: &str = "CPU time (s)";
    let cpu = |p: &Measured| p.cpu_seconds;
    let passes = |p: &Measured| f64::from(p.passes);
    let section = |group: CostGroup, title: &str| {
        let chosen: Vec<&Outcomes> = results
            .iter()
            .filter(|r| r.variant.group.is_none_or(|g| g == group))
            .collect();
        if !chosen.iter().any(|r| r.variant.group.is_some()) {
            return String::new();
        }
        let curves = |x: &dyn Fn(&Measured) -> f64, y: &dyn Fn(&Measured) -> Option<f64>| {
            chosen.iter().map(|r| curve(r, x, y)).collect::<Vec<_>>()
        };
        let plot = |id, x, y, slope, curves| Plot {
            id,
            x,
            y,
            log_y: true,
            slope,
            curves,
        };
        let rel_mse: &dyn Fn(&Measured) -> Option<f64> = &|p| Some(p.errors.rel_mse);
        let all = match group {
            CostGroup::Methods => vec![
                plot(
                    "methods-time",
                    TIME,
                    "relMSE",
                    Some(-1.0),
                    curves(&cpu, rel_mse),
                ),
                plot(
                    "methods-samples",
                    "samples per pixel",
                    "relMSE",
                    Some(-1.0),
                    curves(&passes, rel_mse),
                ),
                plot(
                    "methods-trimmed",
                    TIME,
                    "relMSE without the worst 0.1 %",
                    Some(-1.0),
                    curves(&cpu, &|p| Some(p.errors.trimmed_rel_mse)),
                ),
                plot(
                    "methods-log",
                    TIME,
                    "log-RMSE",
                    Some(-0.5),
                    curves(&cpu, &|p| Some(p.errors.log_rmse)),
                ),
                Plot {
                    log_y: false,
                    ..plot(
                        "methods-probe",
                        TIME,
                        "value of the probed pixel",
                        None,
                        curves(&cpu, &|p| p.probe),
                    )
                },
            ],
            CostGroup::Effects => vec![
                plot(
                    "effects-time",
                    TIME,
                    "relMSE",
                    Some(-1.0),
                    curves(&cpu, rel_mse),
                ),
                plot(
                    "effects-noise",
                    TIME,
                    "relative variance",
                    Some(-1.0),
                    curves(&cpu, &|p| Some(p.errors.rel_variance)),
                ),
            ],
            CostGroup::Settings => vec![
                plot(
                    "settings-time",
                    TIME,
                    "relMSE",
                    Some(-1.0),
                    curves(&cpu, rel_mse),
                ),
                plot(
                    "settings-noise",
                    TIME,
                    "relative variance",
                    Some(-1.0),
                    curves(&cpu, &|p| Some(p.errors.rel_variance)),
                ),
            ],
        };
        let figures: String = all
            .iter()
            .map(Plot::svg)
            .filter(|svg| !svg.is_empty())
            .map(|svg| format!("<figure>{svg}</figure>"))
            .collect();
        format!("<h2>{title}</h2><div class=\"plots\">{figures}</div>")
    };
    [
        (
            CostGroup::Methods,
            "Methods: error against time and samples",
        ),
        (
            CostGroup::Effects,
            "Effects: what each costs, and the error of leaving it out",
        ),
        (CostGroup::Settings, "Settings"),
    ]
    .map(|(group, title)| section(group, title))
    .concat()
}
