//! The report: one HTML page with its data, plots and pictures inside. It asks for nothing from anywhere.

use super::super::CliError;
use super::super::args::CostGroup;
use super::super::html::escape;
use super::super::readable::percent;
use super::matrix::BASE;
use super::measure::{Measured, Spread, TARGETS};
use super::pictures::{self, Picture};
use super::plot::{Curve, Plot};
use super::words::{remains, time_to, times};
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
    strategies: String,
) -> Result<String, CliError> {
    let pictures = all_pictures(folder, reference, results)?;
    let title = data["scene"].as_str().unwrap_or_default();
    let parts = [
        ("TITLE", escape(title)),
        ("CARD", card(data)),
        ("SENTENCES", list(data)),
        ("TABLE", table(results)),
        ("SECTIONS", sections(results)),
        ("STRATEGIES", strategies),
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

/// A table cell with a mean and, where there are several seeds, its standard error.
fn with_error(v: Spread) -> String {
    match v.error {
        Some(e) => format!("{:.3} ± {:.1} %", v.mean, 100.0 * e / v.mean),
        None => format!("{:.3}", v.mean),
    }
}

fn table(results: &[Outcomes]) -> String {
    let mut html = "<tr><th>variant</th><th>CPU s per sample</th><th>CPU s to variance 1</th><th>error at the end</th><th>in equal time</th><th>without the worst 0.1 %</th><th>log-RMSE</th><th>bias</th>"
        .to_owned();
    for target in TARGETS {
        _ = write!(html, "<th>to {}</th>", percent(target));
    }
    html += "</tr>";
    for result in results {
        let s = &result.summary;
        _ = write!(
            html,
            "<tr><th>{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.4}</td><td>{}</td>",
            escape(&result.variant.label),
            with_error(s.pass_seconds),
            with_error(s.unit_variance_seconds),
            percent(s.final_error.mean),
            percent(s.equal_time_error.mean),
            percent(s.trimmed_error.mean),
            s.log_rmse.mean,
            remains(s),
        );
        for time in &s.time_to {
            _ = write!(html, "<td>{}</td>", time_to(time));
        }
        html += "</tr>";
    }
    html
}

/// What each effect costs and buys, against the scene as it is.
fn effects_table(results: &[Outcomes]) -> String {
    let Some(base) = results.iter().find(|r| r.variant.id == BASE) else {
        return String::new();
    };
    let mut html = "<div class=\"scroll\"><table id=\"effects\"><tr><th>the scene, but</th><th>time per sample</th><th>time to equal noise</th><th>error in equal time</th><th>error beyond noise</th></tr>"
        .to_owned();
    let of_effects = |r: &&Outcomes| r.variant.groups.contains(&CostGroup::Effects);
    for result in results.iter().filter(of_effects) {
        let (s, b) = (&result.summary, &base.summary);
        _ = write!(
            html,
            "<tr><th>{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&result.variant.label),
            times(s.pass_seconds, b.pass_seconds),
            times(s.unit_variance_seconds, b.unit_variance_seconds),
            times(s.equal_time_error, b.equal_time_error),
            remains(s),
        );
    }
    html + "</table></div>"
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

/// The groups of variants with their headings.
const SECTIONS: [(CostGroup, &str, &str); 3] = [
    (
        CostGroup::Methods,
        "methods",
        "Methods: error against time and samples",
    ),
    (
        CostGroup::Effects,
        "effects",
        "Effects: what each costs, and the error of leaving it out",
    ),
    (CostGroup::Settings, "settings", "Settings"),
];

/// The variants of a group, the scene as it is among them; none where there is no other.
fn chosen(results: &[Outcomes], group: CostGroup) -> Vec<&Outcomes> {
    let of_group = |r: &&Outcomes| r.variant.groups.is_empty() || r.variant.groups.contains(&group);
    let chosen: Vec<&Outcomes> = results.iter().filter(of_group).collect();
    if chosen.iter().all(|r| r.variant.groups.is_empty()) {
        return Vec::new();
    }
    chosen
}

/// All plots of the report that have points.
#[must_use]
pub fn plots(results: &[Outcomes]) -> Vec<Plot> {
    let sections = SECTIONS.iter();
    sections
        .flat_map(|(group, name, _)| section_plots(&chosen(results, *group), name))
        .collect()
}

fn section_plots(chosen: &[&Outcomes], name: &str) -> Vec<Plot> {
    const TIME: &str = "CPU time (s)";
    type Value = fn(&Measured) -> Option<f64>;
    let cpu: fn(&Measured) -> f64 = |p| p.cpu_seconds;
    let passes: fn(&Measured) -> f64 = |p| f64::from(p.passes);
    let rel_mse: Value = |p| Some(p.errors.rel_mse);
    let trimmed: Value = |p| Some(p.errors.trimmed_rel_mse);
    let log_rmse: Value = |p| Some(p.errors.log_rmse);
    let variance: Value = |p| Some(p.errors.rel_variance);
    let probe: Value = |p| p.probe;
    let trimmed_name = "relMSE without the worst 0.1 %";
    let all = [
        ("time", TIME, "relMSE", Some(-1.0), cpu, rel_mse),
        (
            "samples",
            "samples per pixel",
            "relMSE",
            Some(-1.0),
            passes,
            rel_mse,
        ),
        ("trimmed", TIME, trimmed_name, Some(-1.0), cpu, trimmed),
        ("log", TIME, "log-RMSE", Some(-0.5), cpu, log_rmse),
        (
            "noise",
            TIME,
            "relative variance",
            Some(-1.0),
            cpu,
            variance,
        ),
        ("probe", TIME, "value of the probed pixel", None, cpu, probe),
    ];
    let plots = all.map(|(id, x, y, slope, at, value)| Plot {
        id: format!("{name}-{id}"),
        x,
        y,
        // a value may be 0
        log_y: slope.is_some(),
        slope,
        curves: chosen.iter().map(|r| curve(r, at, value)).collect(),
    });
    plots.into_iter().filter(Plot::has_points).collect()
}

fn sections(results: &[Outcomes]) -> String {
    let section = |(group, name, title): &(CostGroup, &str, &str)| {
        let chosen = chosen(results, *group);
        if chosen.is_empty() {
            return String::new();
        }
        let table = if *group == CostGroup::Effects {
            effects_table(results)
        } else {
            String::new()
        };
        let figures: String = section_plots(&chosen, name)
            .iter()
            .map(|plot| format!("<figure>{}</figure>", plot.figure()))
            .collect();
        format!("<h2>{title}</h2>{table}<div class=\"plots\">{figures}</div>")
    };
    SECTIONS.iter().map(section).collect()
}
