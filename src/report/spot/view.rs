//! Spots as a table, as JSON and as a drawing.

use super::{SHARES, Spot, SpotErrors, Spots};
use crate::report::svg::{self, Axis, Diagram};
use glam::DVec2;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// Head of a line with the standard errors of the one above it.
const STANDARD_ERROR: &str = "  standard error";
const NO_ERRORS: &str = "\nno standard errors: they need a render with --aov noise, two passes or \
                         more, and the filter \"box\"\n";

/// Units of centroids, and of radii, which are thousandths of it.
fn units(found: &Spots) -> [&'static str; 2] {
    if found.is_angular {
        ["deg", "mdeg"]
    } else {
        ["mm", "um"]
    }
}

/// The table.
#[must_use]
pub fn text(found: &Spots) -> String {
    let w = found.window;
    let [long, short] = units(found);
    let mut text = format!(
        "window {},{},{},{} of pixels of {} x {} {short}\n\n{:<24} {:>13} {:>11} {:>11} {:>10} {:>10} {:>10}",
        w.x0,
        w.y0,
        w.x1,
        w.y1,
        1e3 * found.pitch_mm.x,
        1e3 * found.pitch_mm.y,
        "spot",
        format!("power {}", found.unit),
        format!("x {long}"),
        format!("y {long}"),
        format!("rms {short}"),
        format!("rms x {short}"),
        format!("rms y {short}"),
    );
    for share in SHARES {
        _ = write!(text, " {:>9}", format!("{}% {short}", 100.0 * share));
    }
    text.push('\n');
    for spot in &found.spots {
        let c = spot.centroid_mm;
        let rms = 1e3 * spot.rms_mm;
        _ = write!(
            text,
            "{:<24} {:>13.6e} {:>11.6} {:>11.6} {:>10.4} {:>10.4} {:>10.4}",
            spot.name,
            spot.power,
            c.x,
            c.y,
            1e3 * spot.rms_radius_mm(),
            rms.x,
            rms.y
        );
        for radius in spot.encircled_mm {
            _ = write!(text, " {:>9.3}", 1e3 * radius);
        }
        text.push('\n');
        let Some(errors) = &spot.errors else {
            continue;
        };
        let (c, rms) = (errors.centroid_mm, 1e3 * errors.rms_mm);
        _ = write!(
            text,
            "{:<24} {:>13.1e} {:>11.6} {:>11.6} {:>10.4} {:>10.4} {:>10.4}",
            STANDARD_ERROR,
            errors.power,
            c.x,
            c.y,
            1e3 * errors.rms_radius_mm,
            rms.x,
            rms.y
        );
        for radius in errors.encircled_mm {
            _ = write!(text, " {:>9.3}", 1e3 * radius);
        }
        text.push('\n');
    }
    _ = write!(text, "\n{:<24}", format!("modulation, cycles/{long}"));
    let first = found.spots.first().map_or(&[][..], |s| &s.modulation);
    for m in first {
        _ = write!(text, " {:>7.4}", m.per_mm);
    }
    text.push('\n');
    for spot in &found.spots {
        for (axis, name) in ["x", "y"].into_iter().enumerate() {
            _ = write!(text, "{:<24}", format!("{} {name}", spot.name));
            for m in &spot.modulation {
                _ = write!(text, " {:>7.4}", m.contrast[axis]);
            }
            text.push('\n');
            let Some(errors) = &spot.errors else {
                continue;
            };
            _ = write!(text, "{STANDARD_ERROR:<24}");
            for error in &errors.modulation {
                _ = write!(text, " {:>7.4}", error[axis]);
            }
            text.push('\n');
        }
    }
    if found.spots.iter().all(|s| s.errors.is_none()) {
        text += NO_ERRORS;
    }
    text
}

/// As JSON: lengths in millimeters, or degrees of a film over directions.
#[must_use]
pub fn json(found: &Spots) -> Value {
    let errors = |e: &SpotErrors| {
        json!({
            "power": e.power,
            "centroid": e.centroid_mm.to_array(),
            "rms": e.rms_radius_mm,
            "rms_xy": e.rms_mm.to_array(),
            "encircled": e.encircled_mm,
            "modulation": e.modulation.iter().map(|[x, y]| json!({ "x": x, "y": y })).collect::<Vec<_>>(),
        })
    };
    let spot = |s: &Spot| {
        let shares = SHARES.iter().zip(s.encircled_mm);
        json!({
            "name": s.name,
            "wavelength_nm": s.lambda_nm,
            "power": s.power,
            "centroid": s.centroid_mm.to_array(),
            "centroid_px": s.centroid_px.to_array(),
            "rms": s.rms_radius_mm(),
            "rms_xy": s.rms_mm.to_array(),
            "encircled": shares.map(|(share, r)| json!({ "share": share, "radius": r })).collect::<Vec<_>>(),
            "modulation": s.modulation.iter().map(|m| json!({ "per_mm": m.per_mm, "x": m.contrast[0], "y": m.contrast[1] })).collect::<Vec<_>>(),
            "standard_error": s.errors.as_ref().map(errors),
        })
    };
    let w = found.window;
    json!({
        "window": [w.x0, w.y0, w.x1, w.y1],
        "pixel": found.pitch_mm.to_array(),
        "length_unit": units(found)[0],
        "power_unit": found.unit,
        "spots": found.spots.iter().map(spot).collect::<Vec<_>>(),
    })
}

/// Width and height of a diagram in the drawing, pixels.
const SIZE: DVec2 = DVec2::new(380.0, 260.0);
/// Free space left of a diagram.
const LEFT: f64 = 60.0;
/// Heights of what stands above the diagrams, below them, and of a line of the legend.
const ABOVE: f64 = 60.0;
const BELOW: f64 = 62.0;
const LINE: f64 = 18.0;

/// Encircled energy and modulation transfer of all spots as SVG.
#[must_use]
pub fn drawing(found: &Spots, title: &str) -> String {
    let widest = |s: &Spot| s.energy.last().map_or(0.0, |p| p.0);
    let radius = found
        .spots
        .iter()
        .map(|s| 3.0 * s.encircled_mm[2].min(widest(s) / 3.0));
    let radius = radius.fold(1e-9, f64::max);
    let frequencies = found.spots.iter().flat_map(|s| &s.modulation);
    let frequency = frequencies.map(|m| m.per_mm).fold(1e-9, f64::max);
    let diagram = |place: f64, most: f64| Diagram {
        corner: DVec2::new(LEFT + place * (SIZE.x + LEFT), ABOVE),
        size: SIZE,
        x: Axis::up_to(most),
        y: Axis::up_to(1.0),
    };
    let energy = diagram(0.0, 1e3 * radius);
    let transfer = diagram(1.0, frequency);
    let height = ABOVE + SIZE.y + BELOW + LINE * found.spots.len() as f64;
    let mut svg = svg::titled(2.0 * (SIZE.x + LEFT) + 20.0, height, title);
    let [long, short] = units(found);
    let short = short.replace("um", "\u{b5}m");
    for (diagram, name, along, up) in [
        (
            energy,
            "encircled energy",
            format!("radius, {short}"),
            "share of the power",
        ),
        (
            transfer,
            "modulation transfer: x solid, y dashed",
            format!("cycles/{long}"),
            "contrast",
        ),
    ] {
        svg += &diagram.grid(&along, up, 40.0);
        svg += &svg::frame(diagram.corner, SIZE);
        svg += &svg::text(diagram.corner - DVec2::new(0.0, 8.0), "start", name);
    }
    for (i, spot) in found.spots.iter().enumerate() {
        let stroke = format!("stroke=\"{}\" stroke-width=\"1.4\"", svg::color(i));
        let within = spot.energy.iter().filter(|p| p.0 <= radius);
        let points = within.map(|p| DVec2::new(1e3 * p.0, p.1.clamp(0.0, 1.0)));
        svg += &energy.line(std::iter::once(DVec2::ZERO).chain(points), &stroke);
        for (axis, dash) in ["", " stroke-dasharray=\"5 3\""].into_iter().enumerate() {
            let points = spot.modulation.iter();
            let points = points.map(|m| DVec2::new(m.per_mm, m.contrast[axis].min(1.0)));
            let points = std::iter::once(DVec2::Y).chain(points);
            svg += &transfer.line(points, &format!("{stroke}{dash}"));
            let errors = spot.errors.iter().flat_map(|e| &e.modulation);
            for (m, error) in spot.modulation.iter().zip(errors) {
                let end = |sign: f64| {
                    let contrast = m.contrast[axis] + sign * error[axis];
                    DVec2::new(m.per_mm, contrast.clamp(0.0, 1.0))
                };
                svg += &transfer.line([end(-1.0), end(1.0)].into_iter(), &stroke);
            }
        }
        let at = DVec2::new(LEFT, ABOVE + SIZE.y + BELOW - 4.0 + LINE * i as f64);
        let rms = 1e3 * spot.rms_radius_mm();
        let error = spot.errors.as_ref().map_or_else(String::new, |e| {
            format!(" \u{b1} {:.3}", 1e3 * e.rms_radius_mm)
        });
        let told = format!("{}: rms radius {rms:.3}{error} {short}", spot.name);
        svg += &svg::key(&svg::dot(i, at), at, &told);
    }
    svg + "</svg>\n"
}
