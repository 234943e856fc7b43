//! The page of a report: HTML with its data, plots and pictures inside. It asks for nothing from
//! anywhere.

use super::Reference;
use super::data::{Extent, Group, Outcome, Report};
use super::matrix::BASE;
use super::measure::{Measured, Spread, TARGETS, by_passes, mean};
use super::pictures::{self, Picture};
use super::plot::{Curve, Plot};
use super::words::{remains, time_to, times};
use crate::math::named::Named;
use crate::report::ReportError;
use crate::report::html::{self, escape, row};
use crate::report::readable::percent;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;

const TEMPLATE: &str = include_str!("page.html");

/// The page.
///
/// # Errors
/// Where an image cannot be read.
pub fn page(
    report: &Report,
    folder: &Path,
    reference: &Reference,
    strategies: &str,
) -> Result<String, ReportError> {
    let results = &report.variants;
    let pictures = all_pictures(folder, reference, results)?;
    let bad = |e: serde_json::Error| ReportError::file(folder, e.to_string());
    let parts = [
        ("STYLE", html::STYLE.to_owned()),
        ("TITLE", escape(&report.scene)),
        ("CARD", card(report)),
        ("SENTENCES", list(&report.sentences)),
        ("TABLE", table(results)),
        ("SECTIONS", sections(results)),
        ("STRATEGIES", strategies.to_owned()),
        ("BRIGHTEST", pictures::BRIGHTEST.to_string()),
        ("FULL_ERROR", percent(pictures::FULL_ERROR)),
        ("PICTURES", script(&pictures).map_err(bad)?),
        ("DATA", script(report).map_err(bad)?),
    ];
    Ok(html::filled(TEMPLATE, &parts))
}

/// JSON that is safe inside a script element.
fn script(value: &impl Serialize) -> serde_json::Result<String> {
    Ok(serde_json::to_string(value)?.replace('<', "\\u003c"))
}

fn all_pictures(
    folder: &Path,
    reference: &Reference,
    results: &[Outcome],
) -> Result<Vec<Picture>, ReportError> {
    let exposure = pictures::exposure(reference);
    let first = pictures::picture("reference", "reference", &reference.path, exposure, None)?;
    let mut all: Vec<Picture> = first.into_iter().collect();
    for result in results {
        // the last image of the first seed
        let seed = result.points.first().map(|p| p.seed);
        let Some(last) = result.points.iter().rfind(|p| Some(p.seed) == seed) else {
            continue;
        };
        let (id, label) = (&result.id, &result.label);
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

fn card(report: &Report) -> String {
    let list = |items: Vec<String>| match items.is_empty() {
        true => "none".to_owned(),
        false => items.join(", "),
    };
    let on = report.effects.iter().filter(|e| e.on);
    let replaced = report.overrides.iter();
    let [width, height] = report.size;
    let (extent, length) = match report.extent {
        Extent::Seconds(seconds) => ("seconds per cell", seconds.to_string()),
        Extent::Passes(passes) => ("passes per cell", passes.to_string()),
    };
    let cpu = report.cpu.as_deref().unwrap_or("not known");
    let rows = [
        ("scene", report.scene.clone()),
        ("hash", report.scene_hash.clone()),
        ("sensor", report.sensor.clone()),
        ("pixels", format!("{width}, {height}")),
        ("media", list(report.media.clone())),
        ("lights", list(report.lights.clone())),
        ("effects", list(on.map(|e| e.kind.to_string()).collect())),
        (
            "keys replaced",
            list(replaced.map(|(k, v)| format!("{k} = {v}")).collect()),
        ),
        ("seeds", report.seeds.to_string()),
        (extent, length),
        ("version", report.version.clone()),
        ("processor", cpu.to_owned()),
        ("threads", report.threads.to_string()),
        ("reference", report.reference.origin.clone()),
    ];
    let row = |(name, value): &(&str, String)| format!("<dt>{name}</dt><dd>{}</dd>", escape(value));
    rows.iter().map(row).collect()
}

fn list(sentences: &[String]) -> String {
    let item = |s: &String| format!("<li>{}</li>", escape(s));
    sentences.iter().map(item).collect()
}

/// A table cell with a mean and, where there are several seeds, its standard error.
fn with_error(v: Spread) -> String {
    match v.error {
        Some(e) => format!("{:.3} ± {:.1} %", v.mean, 100.0 * e / v.mean),
        None => format!("{:.3}", v.mean),
    }
}

/// Share of the light that was never found, and of that found too rarely to be trusted.
fn light_missed(result: &Outcome) -> String {
    let Some(missed) = &result.missed else {
        return "&ndash;".to_owned();
    };
    match missed.shares() {
        [0.0, 0.0] => "none".to_owned(),
        [never, 0.0] => percent(never),
        [never, rarely] => format!("{}, rarely found {}", percent(never), percent(rarely)),
    }
}

fn table(results: &[Outcome]) -> String {
    let mut html = "<tr><th>variant</th><th>light missed</th><th>CPU s per sample</th><th>CPU s to variance 1</th><th>error at the end</th><th>in equal time</th><th>without the worst 0.1 %</th><th>log-RMSE</th><th>bias</th>"
        .to_owned();
    for target in TARGETS {
        _ = write!(html, "<th>to {}</th>", percent(target));
    }
    html += "</tr>";
    for result in results {
        let s = &result.summary;
        let cells = [
            light_missed(result),
            with_error(s.pass_seconds),
            with_error(s.unit_variance_seconds),
            percent(s.final_error.mean),
            percent(s.equal_time_error.mean),
            percent(s.trimmed_error.mean),
            format!("{:.4}", s.log_rmse.mean),
            remains(s),
        ];
        html += &row(
            &result.label,
            cells.into_iter().chain(s.time_to.map(time_to)),
        );
    }
    html
}

/// Cost of each effect, and error of leaving it out, against the scene as it is.
fn effects_table(results: &[Outcome]) -> String {
    let Some(base) = results.iter().find(|r| r.id == BASE) else {
        return String::new();
    };
    let mut html = "<div class=\"scroll\"><table id=\"effects\"><tr><th>the scene, but</th><th>time per sample</th><th>time to equal noise</th><th>error in equal time</th><th>error beyond noise</th></tr>"
        .to_owned();
    let of_effects = |r: &&Outcome| r.groups.contains(&Group::Effects);
    for result in results.iter().filter(of_effects) {
        let (s, b) = (&result.summary, &base.summary);
        let cells = [
            times(s.pass_seconds, b.pass_seconds),
            times(s.unit_variance_seconds, b.unit_variance_seconds),
            times(s.equal_time_error, b.equal_time_error),
            remains(s),
        ];
        html += &row(&result.label, cells);
    }
    html + "</table></div>"
}

/// A curve over the passes that all seeds have.
fn curve(
    result: &Outcome,
    x: impl Fn(&Measured) -> f64,
    y: impl Fn(&Measured) -> Option<f64>,
) -> Curve {
    let point = |(_, here): (u32, Vec<&Measured>)| {
        let values: Option<Vec<f64>> = here.iter().map(|p| y(p)).collect();
        let values = values?;
        let extreme = |f: fn(f64, f64) -> f64, start| values.iter().copied().fold(start, f);
        Some([
            mean(&here, &x),
            values.iter().sum::<f64>() / values.len() as f64,
            extreme(f64::min, f64::INFINITY),
            extreme(f64::max, 0.0),
        ])
    };
    Curve {
        id: result.id.clone(),
        label: result.label.clone(),
        points: by_passes(&result.points)
            .into_iter()
            .filter_map(point)
            .collect(),
    }
}

/// The groups of variants with their headings.
const SECTIONS: [(Group, &str); 3] = [
    (Group::Methods, "Methods: error against time and samples"),
    (
        Group::Effects,
        "Effects: what each costs, and the error of leaving it out",
    ),
    (Group::Settings, "Settings"),
];

/// The variants of a group, the scene as it is among them; none where there is no other.
fn chosen(results: &[Outcome], group: Group) -> Vec<&Outcome> {
    let of_group = |r: &&Outcome| r.groups.is_empty() || r.groups.contains(&group);
    let chosen: Vec<&Outcome> = results.iter().filter(of_group).collect();
    if chosen.iter().all(|r| r.groups.is_empty()) {
        return Vec::new();
    }
    chosen
}

/// All plots of the report that have points.
#[must_use]
pub fn plots(results: &[Outcome]) -> Vec<Plot> {
    let sections = SECTIONS.iter();
    sections
        .flat_map(|(group, _)| section_plots(&chosen(results, *group), group.as_str()))
        .collect()
}

fn section_plots(chosen: &[&Outcome], name: &str) -> Vec<Plot> {
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

fn sections(results: &[Outcome]) -> String {
    let section = |(group, title): &(Group, &str)| {
        let chosen = chosen(results, *group);
        if chosen.is_empty() {
            return String::new();
        }
        let table = if *group == Group::Effects {
            effects_table(results)
        } else {
            String::new()
        };
        let figures: String = section_plots(&chosen, group.as_str())
            .iter()
            .map(|plot| format!("<figure>{}</figure>", plot.figure()))
            .collect();
        format!("<h2>{title}</h2>{table}<div class=\"plots\">{figures}</div>")
    };
    SECTIONS.iter().map(section).collect()
}
