//! Summary of a render in words: effects before, a closing summary after.

use super::memory::Need;
use super::usage::bytes_text;
use crate::medium::Boundary;
use crate::render::forecast::Forecast;
use crate::render::{Flux, PhotonMemory, RadiusChoice, Render};
use crate::report::readable::{counted, duration, percent};
use crate::report::statistics::{FEW_HITS, SensorStats};
use crate::scene::Scene;
use crate::scene::effects::Effect;
use std::fmt::Write as _;
use std::path::Path;

/// Share of the light below which rarely hit classes are not told.
const TOLD_SHARE: f64 = 1e-3;
/// Classes that are named.
const TOLD_CLASSES: usize = 5;

/// The effects of a scene, one line each.
#[must_use]
pub fn effects(effects: &[Effect]) -> String {
    let line = |e: &Effect| {
        format!(
            "  {:<14} {:<4} {}\n",
            e.kind,
            if e.on { "on" } else { "off" },
            e.reason
        )
    };
    format!("effects\n{}", effects.iter().map(line).collect::<String>())
}

/// Whether and with which cones a render is regularized.
#[must_use]
pub fn regularization(render: &Render) -> String {
    let mut text = effects(&[render.regularization().effect()])
        .trim_start_matches("effects\n")
        .to_owned();
    if let Some(choice) = render.epsilon() {
        _ = writeln!(
            text,
            "  {:<14} {:<4} {:.5} rad in pass 0: {}",
            "epsilon", "", choice.epsilon, choice.reason
        );
    }
    if let Some(found) = render.tries() {
        _ = writeln!(text, "  {:<14} {:<4} {found}", "aims", "");
    }
    if let Some(found) = render.factors() {
        _ = writeln!(text, "  {:<14} {:<4} {found}", "weights", "");
    }
    if let Some(found) = render.choices().effort {
        _ = writeln!(text, "  {:<14} {:<4} {found}", "effort", "");
    }
    text
}

/// Memory that a render will take.
#[must_use]
pub fn memory(need: &Need) -> String {
    format!("  {:<14} {:<4} {}\n", "memory", "", need.text())
}

/// Effects and memory of a render in one line.
#[must_use]
pub fn in_short(render: &Render, need: &Need) -> String {
    let own = render.regularization().effect();
    let effects = render.scene().effects.iter().chain([&own]);
    let on: Vec<String> = effects
        .filter(|e| e.on)
        .map(|e| e.kind.to_string())
        .collect();
    let on = if on.is_empty() {
        "no effects".to_owned()
    } else {
        on.join(", ")
    };
    let memory = bytes_text(need.total());
    format!("{on}; memory {memory} (-v tells why)\n")
}

/// Radius and memory of a render that merges photons.
#[must_use]
pub fn merging(radius: &RadiusChoice, memory: &PhotonMemory) -> String {
    format!(
        "  {:<14} {:<4} {:.4e} m in pass 0: {}\n  {:<14} {:<4} about {} in a pass: {:.2} vertices of {} B for each of {} light paths\n",
        "radius",
        "",
        radius.radius,
        radius.reason,
        "photons",
        "",
        bytes_text(memory.bytes()),
        memory.vertices_per_path,
        memory.bytes_per_vertex,
        memory.paths,
    )
}

/// The closing summary of one sensor; `preview` is what is to be said of it.
#[must_use]
pub fn sensor(image: &Path, preview: Option<&str>, stats: &SensorStats, scene: &Scene) -> String {
    let [width, height] = stats.size;
    let mut text = format!(
        "{}: {width} x {height} pixels, {}, {}\n",
        image.display(),
        counted(stats.passes.len() as u64, "pass", "passes"),
        stats.stop.text()
    );
    if let Some(preview) = preview {
        _ = writeln!(text, "  preview   {preview}");
    }
    let wall = stats.wall.as_secs_f64();
    let cpu = stats
        .cpu_seconds
        .map_or_else(String::new, |s| format!(", {s:.2} s CPU"));
    _ = writeln!(text, "  time      {wall:.2} s{cpu}");
    let millions = stats.rays() as f64 * 1e-6;
    // those of detectors that are filled together are counted with the first
    if millions > 0.0 {
        let rate = millions / wall.max(1e-9);
        _ = writeln!(
            text,
            "  rays      {millions:.3} million, {rate:.3} million/s"
        );
    }
    let error = stats.error.map_or_else(
        || "unknown".to_owned(),
        |e| {
            format!(
                "{:.2} % (estimated, relative; {:.2} % with the worst 0.1 % of the pixels)",
                100.0 * e.relative,
                100.0 * e.of_all_pixels
            )
        },
    );
    _ = writeln!(text, "  error     {error}");
    text += &stats.flux.as_ref().map_or_else(String::new, flux);
    text += &accuracy(stats);
    text += &rarely_hit(stats);
    if let Some(epsilon) = &stats.epsilon {
        _ = writeln!(
            text,
            "  epsilon   {:.5} to {:.5} rad, mean square {:.3e}",
            epsilon.first, epsilon.last, epsilon.mean_square
        );
        if let Some(bias) = epsilon.bias {
            _ = writeln!(
                text,
                "  bias      {:.2} % (of regions of 16 x 16 pixels, relative to the mean; noise {:.2} %)",
                100.0 * bias.relative,
                100.0 * bias.noise
            );
        }
    }
    if let Some(merging) = &stats.merging {
        _ = writeln!(
            text,
            "  radius    {:.4e} to {:.4e} m\n  photons   {} ({:.2} per light path, {} B each)\n  shared    {} wavelengths, largest gap {:.1} nm",
            merging.radius_first,
            merging.radius_last,
            bytes_text(merging.bytes),
            merging.vertices_per_path,
            merging.bytes_per_vertex,
            merging.wavelengths.distinct,
            merging.wavelengths.largest_gap_nm,
        );
    }
    if let Some(chains) = stats.chains {
        let [small, large] = &stats.counters.steps;
        _ = writeln!(
            text,
            "  chains    {}; of {} large steps {} were accepted, of {} small ones {}",
            chains,
            large.tried,
            percent(large.acceptance()),
            small.tried,
            percent(small.acceptance()),
        );
    }
    let unexpected = unexpected(stats, scene);
    let trouble = [
        (
            stats.non_finite,
            "contributions were not finite and left out",
        ),
        (stats.saturated, "contributions were too large and left out"),
        (stats.counters.medium_mismatches, unexpected.as_str()),
        (
            stats.counters.nesting_overflows,
            "paths were cut because too many solids are nested",
        ),
    ];
    for (count, what) in trouble.iter().filter(|t| t.0 > 0) {
        _ = writeln!(text, "  warning   {count} {what}");
    }
    text
}

/// Flux through a detector.
fn flux(flux: &Flux) -> String {
    let mut text = format!("  flux      {} lm\n", flux.luminous_lm);
    if let Some(watts) = &flux.continuum_w {
        _ = writeln!(text, "            {} W besides lines", watts);
    }
    for (nm, watts) in &flux.lines_w {
        _ = writeln!(text, "            {watts} W at {nm} nm");
    }
    for (class, lumens) in &flux.classes_lm {
        _ = writeln!(text, "            {lumens} lm of {class}");
    }
    text
}

/// Whose surfaces were met from an unexpected medium, and why that may be.
fn unexpected(stats: &SensorStats, scene: &Scene) -> String {
    let mut text = "surfaces were met from an unexpected medium".to_owned();
    if let Some(id) = stats.counters.mismatched {
        let object = scene.object(id);
        let cause = match object.boundary {
            Boundary::Interface { .. } => {
                "is what it names as the medium on each side really there?"
            }
            _ => "does its mesh cross itself, or does a light or sensor reach into it?",
        };
        _ = write!(text, ", such as those of \"{}\" ({cause})", object.name);
    }
    text
}

/// Time that a smaller error would take.
fn accuracy(stats: &SensorStats) -> String {
    let (Some(error), Some((target, forecast))) = (stats.error, stats.forecast) else {
        return String::new();
    };
    let now = format!(
        "{} now ({})",
        percent(error.relative),
        duration(stats.wall.as_secs_f64())
    );
    match forecast {
        Forecast::Unknown => String::new(),
        Forecast::Unsteady => {
            format!(
                "  accuracy  {now}; unsteady: the error does not fall evenly, its future is not known\n"
            )
        }
        Forecast::Takes { time, .. } => format!(
            "  accuracy  {now}; {} would take about {}\n",
            percent(target),
            duration(time.as_secs_f64())
        ),
    }
}

/// The classes of paths whose share of the image is not to be trusted.
fn rarely_hit(stats: &SensorStats) -> String {
    let share: f64 = stats.rarely_hit.iter().map(|c| c.share).sum();
    if share < TOLD_SHARE {
        return String::new();
    }
    let brightest: Vec<String> = stats
        .rarely_hit
        .iter()
        .take(TOLD_CLASSES)
        .map(|c| format!("{} {}", c.class, percent(c.share)))
        .collect();
    format!(
        "  classes   {} of the light is in {} classes of paths with fewer than {FEW_HITS} hits each, whatever the error says: {}\n",
        percent(share),
        stats.rarely_hit.len(),
        brightest.join(", ")
    )
}
