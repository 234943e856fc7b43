//! Spot diagrams and ray fans as SVG.

use super::report::Report;
use crate::optics::analysis::Beams;
use crate::optics::{FieldKind, Prescription};
use crate::report::svg;
use glam::DVec2;
use std::fmt::Write as _;

/// Side of one diagram, pixels.
const SIDE: f64 = 220.0;
const GAP: f64 = 46.0;

/// Keys of the wavelengths, in one line.
fn legend(lens: &Prescription) -> String {
    let of = |(i, nm): (usize, f64)| {
        let at = DVec2::new(16.0 + 110.0 * i as f64, 36.0);
        svg::key(&svg::dot(i, at), at, &format!("{nm:.2} nm"))
    };
    let wavelengths = lens.wavelengths.iter().map(|w| w.nm);
    wavelengths.enumerate().map(of).collect()
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

/// Spots of all fields, at the image and at the best focus, about the centroid of all wavelengths.
#[must_use]
pub fn spots(lens: &Prescription, report: &Report) -> String {
    let focuses = [("image", 0.0), ("best focus", report.focus[1])];
    let width = 24.0 + (SIDE + 20.0) * lens.fields.len() as f64;
    let height = 70.0 + (SIDE + GAP) * 2.0;
    let mut svg = svg::titled(width.max(480.0), height, &format!("{}: spots", lens.name));
    svg += &legend(lens);
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
        let box_mm = svg::round_up(2.0 * reach.fold(1e-6, f64::max));
        for (field, list) in all.iter().enumerate() {
            let x0 = 12.0 + (SIDE + 20.0) * field as f64;
            let y0 = 56.0 + (SIDE + GAP) * row as f64;
            let center = centroid(list);
            svg += &svg::frame(DVec2::new(x0, y0), DVec2::splat(SIDE));
            for (i, p) in list {
                let at = (*p - center) / box_mm * SIDE;
                let color = svg::color(*i);
                _ = writeln!(
                    svg,
                    "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"0.9\" fill=\"{color}\"/>",
                    x0 + SIDE / 2.0 + at.x,
                    y0 + SIDE / 2.0 - at.y
                );
            }
            let told = format!(
                "{}, {name}, box {} \u{b5}m",
                field_name(lens, field),
                (box_mm * 1e6).round() / 1e3
            );
            svg += &svg::text(DVec2::new(x0, y0 + SIDE + 16.0), "start", &told);
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
    let mut svg = svg::titled(
        width.max(480.0),
        70.0 + (SIDE + GAP) * 2.0,
        &format!("{}: ray fans", lens.name),
    );
    svg += &legend(lens);
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
        let scale = svg::round_up(all.map(f64::abs).fold(1e-6, f64::max));
        for (field, fans) in curves.iter().enumerate() {
            let x0 = 12.0 + (SIDE + 20.0) * field as f64;
            let y0 = 56.0 + (SIDE + GAP) * row as f64;
            let (xm, ym) = (x0 + SIDE / 2.0, y0 + SIDE / 2.0);
            svg += &svg::frame(DVec2::new(x0, y0), DVec2::splat(SIDE));
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
                let color = svg::color(i);
                _ = writeln!(
                    svg,
                    "<path d=\"{d}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.3\"/>"
                );
            }
            let told = format!(
                "{}, {name}, \u{b1}{} \u{b5}m",
                field_name(lens, field),
                (scale * 1e6).round() / 1e3
            );
            svg += &svg::text(DVec2::new(x0, y0 + SIDE + 16.0), "start", &told);
        }
    }
    svg + "</svg>\n"
}
