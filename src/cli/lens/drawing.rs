//! Cross-section of a lens in its yz plane with traced rays, as SVG.

use crate::optics::analysis::Beams;
use crate::optics::{Interaction, Prescription, System};
use crate::report::html::escape;
use crate::report::svg;
use glam::{DVec2, DVec3};
use std::fmt::Write as _;

/// Width of the drawing, pixels.
const WIDTH: f64 = 960.0;
const MARGIN: f64 = 30.0;

/// The drawing.
#[must_use]
pub fn cross_section(lens: &Prescription) -> String {
    let beams = Beams::new(lens, lens.primary_nm());
    let (rays, heights) = rays(lens, &beams);
    let frames = beams.system.frames();
    // without a semi-diameter, a surface is drawn as far as rays reach
    let reach: Vec<f64> = lens
        .surfaces
        .iter()
        .zip(&heights)
        .map(|(s, &height)| {
            let extent = s.shape.aperture.extent();
            let extent = if extent.is_finite() {
                extent
            } else {
                1.05 * height
            };
            extent.min(s.shape.profile.domain_radius()).max(1e-6)
        })
        .collect();
    let curve = |i: usize| -> Vec<DVec2> {
        let at = |j: i32| {
            let y = reach[i] * f64::from(j) / 24.0;
            let sag = lens.surfaces[i].shape.profile.sag(0.0, y);
            let p = frames[i].to_system(DVec3::new(0.0, y, sag));
            DVec2::new(p.z, -p.y)
        };
        (-24..=24).map(at).filter(|p| p.is_finite()).collect()
    };
    let curves: Vec<Vec<DVec2>> = (0..lens.surfaces.len()).map(curve).collect();
    let points = curves
        .iter()
        .flatten()
        .chain(rays.iter().flat_map(|r| &r.1));
    let (mut low, mut high) = (DVec2::MAX, DVec2::MIN);
    for &p in points {
        (low, high) = (low.min(p), high.max(p));
    }
    let size = (high - low).max(DVec2::splat(1e-9));
    let scale = ((WIDTH - 2.0 * MARGIN) / size.x).min(700.0 / size.y);
    let height = size.y * scale + 2.0 * MARGIN + 24.0;
    let width = size.x * scale + 2.0 * MARGIN;
    let place = |p: DVec2| (p - low) * scale + DVec2::splat(MARGIN);
    let path = |points: &[DVec2]| {
        let mut d = String::new();
        for (i, &p) in points.iter().enumerate() {
            let p = place(p);
            _ = write!(d, "{}{:.2},{:.2}", if i == 0 { "M" } else { "L" }, p.x, p.y);
        }
        d
    };
    let mut svg = svg::head(width, height, &lens.name);
    for i in 0..lens.surfaces.len() - 1 {
        let solid = !lens.surfaces[i].medium.is_air()
            && lens.surfaces[i].interaction == Interaction::Refract;
        if solid {
            let outline: Vec<DVec2> = curves[i]
                .iter()
                .chain(curves[i + 1].iter().rev())
                .copied()
                .collect();
            _ = writeln!(
                svg,
                "<path d=\"{}Z\" fill=\"#cfe3f2\" fill-opacity=\"0.7\" stroke=\"#456\" stroke-width=\"1\"/>",
                path(&outline)
            );
        }
    }
    for (i, surface) in lens.surfaces.iter().enumerate() {
        let is_image = i + 1 == lens.surfaces.len();
        let stroke = match surface.interaction {
            Interaction::Reflect => "stroke=\"#222\" stroke-width=\"3\"",
            Interaction::Refract if is_image => "stroke=\"#222\" stroke-width=\"1.5\"",
            Interaction::Refract => "stroke=\"#456\" stroke-width=\"1\"",
        };
        if i == lens.stop && surface.medium.is_air() && surface.shape.profile.is_plane() {
            // a stop that is no lens surface: its blades
            let ends = [curves[i].first(), curves[i].last()];
            for (end, sign) in ends.into_iter().flatten().zip([1.0, -1.0]) {
                let out = (*curves[i].last().unwrap_or(end) - curves[i][0]) * (-0.15 * sign);
                _ = writeln!(
                    svg,
                    "<path d=\"{}\" stroke=\"#222\" stroke-width=\"3\"/>",
                    path(&[*end, *end + out])
                );
            }
        } else {
            _ = writeln!(
                svg,
                "<path d=\"{}\" fill=\"none\" {stroke}/>",
                path(&curves[i])
            );
        }
    }
    for (field, points) in &rays {
        let color = svg::color(*field);
        _ = writeln!(
            svg,
            "<path d=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"0.8\"/>",
            path(points)
        );
    }
    _ = writeln!(
        svg,
        "<text x=\"{MARGIN}\" y=\"{:.1}\">{}: {:.1} mm from first surface to image, {:.1} nm</text>\n</svg>",
        height - 10.0,
        escape(&lens.name),
        (0..lens.surfaces.len() - 1)
            .map(|i| lens.axial_distance(i).abs())
            .sum::<f64>(),
        lens.primary_nm()
    );
    svg
}

type Lines = Vec<(usize, Vec<DVec2>)>;

/// Five rays of each field in the plane of the drawing, and how far they reach on each surface.
fn rays(lens: &Prescription, beams: &Beams) -> (Lines, Vec<f64>) {
    let system: &System = &beams.system;
    let mut heights = vec![0.0f64; lens.surfaces.len()];
    let mut lines = Vec::new();
    let total: f64 = (0..lens.surfaces.len() - 1)
        .map(|i| lens.axial_distance(i).abs())
        .sum();
    for (index, &field) in lens.fields.iter().enumerate() {
        for share in [-1.0, -0.5, 0.0, 0.5, 1.0] {
            let Some(ray) = beams.aimed(field, DVec2::Y * share) else {
                continue;
            };
            // a ray at the very edge may be clipped by rounding: drawings do not clip
            let mut reached = Vec::new();
            let ended = system.trace(ray, false, |e| {
                let r = e.point.truncate().length();
                heights[e.surface] = heights[e.surface].max(r);
                reached.push(system.frames()[e.surface].to_system(e.point));
            });
            if ended.is_err() || reached.is_empty() {
                continue;
            }
            let first = reached[0];
            let back = match lens.object_distance {
                Some(d) if d.abs() < 2.0 * total => ray.o,
                _ => first - ray.d * (0.15 * total / ray.d.z.max(0.1)),
            };
            let flat = |p: DVec3| DVec2::new(p.z, -p.y);
            let points = std::iter::once(back).chain(reached).map(flat).collect();
            lines.push((index, points));
        }
    }
    (lines, heights)
}
