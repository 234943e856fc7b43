//! Spots as a table, as JSON and as a drawing.

use super::{SHARES, Spot, Spots};
use crate::report::html::escape;
use glam::DVec2;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// Lines of the drawing, told apart also by the color blind (Okabe and Ito).
const COLORS: [&str; 7] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000",
];

/// The table.
#[must_use]
pub fn text(found: &Spots) -> String {
    let w = found.window;
    let mut text = format!(
        "window {},{},{},{} of pixels of {} x {} um\n\n{:<24} {:>13} {:>11} {:>11} {:>10} {:>10} {:>10}",
        w.x0,
        w.y0,
        w.x1,
        w.y1,
        1e3 * found.pitch_mm.x,
        1e3 * found.pitch_mm.y,
        "spot",
        format!("power {}", found.unit),
        "x mm",
        "y mm",
        "rms um",
        "rms x um",
        "rms y um",
    );
    for share in SHARES {
        _ = write!(text, " {:>9}", format!("{}% um", 100.0 * share));
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
    }
    _ = write!(text, "\n{:<24}", "modulation, cycles/mm");
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
        }
    }
    text
}

/// As JSON: lengths in millimeters.
#[must_use]
pub fn json(found: &Spots) -> Value {
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
        })
    };
    let w = found.window;
    json!({
        "window": [w.x0, w.y0, w.x1, w.y1],
        "pixel": found.pitch_mm.to_array(),
        "power_unit": found.unit,
        "spots": found.spots.iter().map(spot).collect::<Vec<_>>(),
    })
}

/// Width and height of a diagram in the drawing, pixels.
const SIZE: DVec2 = DVec2::new(380.0, 260.0);
const MARGIN: f64 = 50.0;

/// One diagram: both axes begin at 0.
struct Diagram {
    corner: DVec2,
    /// Largest values of the axes.
    most: DVec2,
}

impl Diagram {
    fn at(&self, p: DVec2) -> DVec2 {
        let p = p / self.most * SIZE;
        self.corner + DVec2::new(p.x, SIZE.y - p.y)
    }

    fn frame(&self, title: &str, along: &str) -> String {
        let DVec2 { x, y } = self.corner;
        let mut svg = format!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#999\"/>\n\
             <text x=\"{x:.1}\" y=\"{:.1}\">{title}</text>\n<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{along}</text>\n",
            SIZE.x,
            SIZE.y,
            y - 8.0,
            x + SIZE.x,
            y + SIZE.y + 30.0
        );
        for i in 0..=4 {
            let share = 0.25 * f64::from(i);
            let value = format!("{:.3e}", share * self.most.x);
            let value: f64 = value.parse().unwrap_or(0.0);
            let tick = self.at(DVec2::new(share * self.most.x, 0.0));
            let left = self.at(DVec2::new(0.0, share * self.most.y));
            _ = writeln!(
                svg,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{value}</text>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\
                 <path d=\"M{:.1},{:.1}h{}\" stroke=\"#eee\"/>",
                tick.x,
                tick.y + 15.0,
                left.x - 5.0,
                left.y + 4.0,
                share * self.most.y,
                left.x,
                left.y,
                SIZE.x
            );
        }
        svg
    }

    fn curve(&self, points: impl Iterator<Item = DVec2>, style: &str) -> String {
        let points: Vec<String> = points
            .map(|p| self.at(p))
            .map(|p| format!("{:.2},{:.2}", p.x, p.y))
            .collect();
        format!(
            "<polyline points=\"{}\" fill=\"none\" stroke-width=\"1.4\" {style}/>\n",
            points.join(" ")
        )
    }
}

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
    let energy = Diagram {
        corner: DVec2::new(MARGIN, 70.0),
        most: DVec2::new(1e3 * radius, 1.0),
    };
    let transfer = Diagram {
        corner: DVec2::new(2.0 * MARGIN + SIZE.x + 20.0, 70.0),
        most: DVec2::new(frequency, 1.0),
    };
    let width = 3.0 * MARGIN + 2.0 * SIZE.x + 20.0;
    let height = 70.0 + SIZE.y + 50.0 + 18.0 * found.spots.len() as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <title>{0}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n<text x=\"12\" y=\"24\" font-size=\"14\">{0}</text>\n",
        escape(title)
    );
    svg += &energy.frame("encircled energy", "radius, \u{b5}m");
    svg += &transfer.frame("modulation transfer: x solid, y dashed", "cycles/mm");
    for (i, spot) in found.spots.iter().enumerate() {
        let color = COLORS[i % COLORS.len()];
        let stroke = format!("stroke=\"{color}\"");
        let within = spot.energy.iter().filter(|p| p.0 <= radius);
        let points = within.map(|p| DVec2::new(1e3 * p.0, p.1.clamp(0.0, 1.0)));
        svg += &energy.curve(std::iter::once(DVec2::ZERO).chain(points), &stroke);
        for (axis, dash) in ["", " stroke-dasharray=\"5 3\""].into_iter().enumerate() {
            let points = spot.modulation.iter();
            let points = points.map(|m| DVec2::new(m.per_mm, m.contrast[axis].min(1.0)));
            let points = std::iter::once(DVec2::Y).chain(points);
            svg += &transfer.curve(points, &format!("{stroke}{dash}"));
        }
        let y = 70.0 + SIZE.y + 50.0 + 18.0 * i as f64;
        _ = writeln!(
            svg,
            "<circle cx=\"{MARGIN}\" cy=\"{:.1}\" r=\"4\" fill=\"{color}\"/><text x=\"{}\" y=\"{y:.1}\">{}: rms radius {:.3} \u{b5}m</text>",
            y - 4.0,
            MARGIN + 10.0,
            escape(&spot.name),
            1e3 * spot.rms_radius_mm()
        );
    }
    svg + "</svg>\n"
}
