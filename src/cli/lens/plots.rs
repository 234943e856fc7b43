//! Spot diagrams and ray fans as SVG.

use super::drawing::COLORS;
use super::report::Report;
use crate::optics::analysis::Beams;
use crate::optics::{FieldKind, Prescription};
use crate::report::html::escape;
use glam::DVec2;
use std::fmt::Write as _;

/// Side of one diagram, pixels.
const SIDE: f64 = 220.0;
const GAP: f64 = 46.0;

fn head(width: f64, height: f64, title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<title>{0}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n<text x=\"12\" y=\"20\" font-size=\"14\">{0}</text>\n",
        escape(title)
    )
}

/// A line of wavelengths with their colors.
fn legend(lens: &Prescription, y: f64) -> String {
    let mut svg = String::new();
    for (i, wavelength) in lens.wavelengths.iter().enumerate() {
        let x = 12.0 + 110.0 * i as f64;
        let color = COLORS[i % COLORS.len()];
        _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{:.1}\" r=\"4\" fill=\"{color}\"/><text x=\"{:.1}\" y=\"{y:.1}\">{:.2} nm</text>",
            y - 4.0,
            x + 8.0,
            wavelength.nm
        );
    }
    svg
}

fn field_name(lens: &Prescription, field: usize) -> String {
    let [x, y] = lens.fields[field];
    let unit = match lens.field_kind {
        FieldKind::AngleDeg => "\u{b0}",
        _ => " mm",
    };
    if x == 0.0 {
        format!("{y}{unit}")
    } else {
        format!("{x}{unit}, {y}{unit}")
    }
}

/// A round number not below `value`: 1, 2 or 5 times a power of ten.
fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-12).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * power);
    steps.into_iter().find(|s| *s >= value).unwrap_or(value)
}

/// Spots of all fields, at the image and at the best focus, about the centroid of all wavelengths.
#[must_use]
pub fn spots(lens: &Prescription, report: &Report) -> String {
    let focuses = [("image", 0.0), ("best focus", report.focus[1])];
    let width = 24.0 + (SIDE + 20.0) * lens.fields.len() as f64;
    let height = 70.0 + (SIDE + GAP) * 2.0;
    let mut svg = head(width.max(480.0), height, &format!("{}: spots", lens.name));
    svg += &legend(lens, 40.0);
    for (row, (name, dz)) in focuses.into_iter().enumerate() {
        let points = |field: usize| -> Vec<(usize, DVec2)> {
            let these = report.spots.iter().filter(|s| s.field == field).enumerate();
            these
                .flat_map(|(i, s)| s.spot.points(dz).into_iter().map(move |p| (i, p)))
                .collect()
        };
        let all: Vec<Vec<(usize, DVec2)>> = (0..lens.fields.len()).map(points).collect();
        let centroid = |list: &[(usize, DVec2)]| {
            list.iter().map(|p| p.1).sum::<DVec2>() / list.len().max(1) as f64
        };
        let reach = all.iter().flat_map(|list| {
            let center = centroid(list);
            list.iter().map(move |p| (p.1 - center).abs().max_element())
        });
        // one scale for a row, so that fields can be compared
        let box_mm = round_up(2.0 * reach.fold(1e-6, f64::max));
        for (field, list) in all.iter().enumerate() {
            let x0 = 12.0 + (SIDE + 20.0) * field as f64;
            let y0 = 56.0 + (SIDE + GAP) * row as f64;
            let center = centroid(list);
            _ = writeln!(
                svg,
                "<rect x=\"{x0:.1}\" y=\"{y0:.1}\" width=\"{SIDE}\" height=\"{SIDE}\" fill=\"none\" stroke=\"#999\"/>"
            );
            for (i, p) in list {
                let at = (*p - center) / box_mm * SIDE;
                let color = COLORS[i % COLORS.len()];
                _ = writeln!(
                    svg,
                    "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"0.9\" fill=\"{color}\"/>",
                    x0 + SIDE / 2.0 + at.x,
                    y0 + SIDE / 2.0 - at.y
                );
            }
            _ = writeln!(
                svg,
                "<text x=\"{x0:.1}\" y=\"{:.1}\">{}, {name}, box {} \u{b5}m</text>",
                y0 + SIDE + 16.0,
                field_name(lens, field),
                (box_mm * 1e6).round() / 1e3
            );
        }
    }
    svg + "</svg>\n"
}

/// Place in the pupil and aberration, where the ray arrives.
type Fan = Vec<(f64, Option<f64>)>;

/// Transverse aberrations against the place in the pupil, tangential (y) and sagittal (x), per
/// field.
#[must_use]
pub fn fans(lens: &Prescription) -> String {
    let beams: Vec<Beams> = lens
        .wavelengths
        .iter()
        .map(|w| Beams::new(lens, w.nm))
        .collect();
    let axes = [("tangential, y", DVec2::Y), ("sagittal, x", DVec2::X)];
    let width = 24.0 + (SIDE + 20.0) * lens.fields.len() as f64;
    let mut svg = head(
        width.max(480.0),
        70.0 + (SIDE + GAP) * 2.0,
        &format!("{}: ray fans", lens.name),
    );
    svg += &legend(lens, 40.0);
    for (row, (name, axis)) in axes.into_iter().enumerate() {
        let curves: Vec<Vec<Fan>> = lens
            .fields
            .iter()
            .map(|&field| {
                let one = |b: &Beams| {
                    let fan = b.fan(field, axis, 41);
                    fan.into_iter()
                        .map(|(s, p)| (s, p.map(|p| p.dot(axis))))
                        .collect()
                };
                beams.iter().map(one).collect()
            })
            .collect();
        let all = curves.iter().flatten().flatten().filter_map(|p| p.1);
        let scale = round_up(all.map(f64::abs).fold(1e-6, f64::max));
        for (field, fans) in curves.iter().enumerate() {
            let x0 = 12.0 + (SIDE + 20.0) * field as f64;
            let y0 = 56.0 + (SIDE + GAP) * row as f64;
            let (xm, ym) = (x0 + SIDE / 2.0, y0 + SIDE / 2.0);
            _ = writeln!(
                svg,
                "<rect x=\"{x0:.1}\" y=\"{y0:.1}\" width=\"{SIDE}\" height=\"{SIDE}\" fill=\"none\" stroke=\"#999\"/>"
            );
            _ = writeln!(
                svg,
                "<path d=\"M{x0:.1},{ym:.1}h{SIDE}M{xm:.1},{y0:.1}v{SIDE}\" stroke=\"#ccc\"/>"
            );
            for (i, fan) in fans.iter().enumerate() {
                let mut d = String::new();
                let mut pen_down = false;
                for (share, value) in fan {
                    if let Some(value) = value {
                        let command = if pen_down { "L" } else { "M" };
                        _ = write!(
                            d,
                            "{command}{:.2},{:.2}",
                            xm + share * SIDE / 2.0,
                            ym - value / scale * SIDE / 2.0
                        );
                    }
                    pen_down = value.is_some();
                }
                let color = COLORS[i % COLORS.len()];
                _ = writeln!(
                    svg,
                    "<path d=\"{d}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.3\"/>"
                );
            }
            _ = writeln!(
                svg,
                "<text x=\"{x0:.1}\" y=\"{:.1}\">{}, {name}, \u{b1}{} \u{b5}m</text>",
                y0 + SIDE + 16.0,
                field_name(lens, field),
                (scale * 1e6).round() / 1e3
            );
        }
    }
    svg + "</svg>\n"
}
