//! Plots as inline SVG: curves on logarithmic axes with the spread of their seeds, a slope guide,
//! and keys that tell them apart without color.

use crate::report::html::escape;
use crate::report::svg::{self, Axis, COLORS, Diagram};
use glam::DVec2;
use std::fmt::Write as _;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 380.0;
/// Free space left, right, above, below.
const MARGIN: [f64; 4] = [64.0, 14.0, 12.0, 46.0];
/// Height of a line of the legend in a file.
const LINE: f64 = 20.0;

/// A curve: for each abscissa the mean, and the least and largest of the seeds.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Name of the variant.
    pub id: String,
    /// Name for readers.
    pub label: String,
    /// Abscissa, mean, least, largest.
    pub points: Vec<[f64; 4]>,
}

/// A plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Name in the page and of its file.
    pub id: String,
    /// Text of the horizontal axis.
    pub x: &'static str,
    /// Text of the vertical axis.
    pub y: &'static str,
    /// Logarithmic ordinate (the abscissa always is).
    pub log_y: bool,
    /// Slope of the guide in logarithms.
    pub slope: Option<f64>,
    /// The curves.
    pub curves: Vec<Curve>,
}

impl Plot {
    /// The rectangle of the curves with its axes; `None` where there is no point to show.
    fn diagram(&self) -> Option<Diagram> {
        let points = || self.curves.iter().flat_map(|c| c.points.iter());
        let [left, right, top, bottom] = MARGIN;
        Some(Diagram {
            corner: DVec2::new(left, top),
            size: DVec2::new(WIDTH - left - right, HEIGHT - top - bottom),
            x: Axis::over(points().map(|p| p[0]), true)?,
            y: Axis::over(points().flat_map(|p| p[1..].iter().copied()), self.log_y)?,
        })
    }

    /// Whether there is anything to draw.
    #[must_use]
    pub fn has_points(&self) -> bool {
        self.diagram().is_some()
    }

    fn title(&self) -> String {
        format!("{} against {}", self.y, self.x)
    }

    /// The plot with its legend, as elements of a page.
    #[must_use]
    pub fn figure(&self) -> String {
        let start = format!(
            r#"<svg id="{}" class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{}">"#,
            self.id,
            escape(&self.title())
        );
        format!("{start}{}</svg>{}", self.drawing(), self.legend())
    }

    /// The plot with its legend as an SVG file.
    #[must_use]
    pub fn file(&self) -> String {
        let height = HEIGHT + LINE * self.curves.len() as f64 + 8.0;
        let mut svg = svg::head(WIDTH, height, &self.title()) + &self.drawing();
        for (i, curve) in self.curves.iter().enumerate() {
            let at = DVec2::new(MARGIN[0] + 6.0, HEIGHT + LINE * i as f64 + 8.0);
            let sign = format!(
                r#"<g stroke="{}" fill="none">{}</g>"#,
                svg::color(i),
                mark(i, at)
            );
            svg += &svg::key(&sign, at, &curve.label);
        }
        svg + "</svg>\n"
    }

    /// Axes and curves; nothing where there is no point.
    fn drawing(&self) -> String {
        let Some(diagram) = self.diagram() else {
            return String::new();
        };
        let mut svg = diagram.grid(self.x, self.y, MARGIN[0] - 13.0);
        if let Some(slope) = self.slope {
            svg += &self.guide(slope, &diagram);
        }
        for (i, curve) in self.curves.iter().enumerate() {
            let dash = if i < COLORS.len() {
                ""
            } else {
                r#" stroke-dasharray="6 4""#
            };
            let place = |p: &[f64; 4]| [1, 2, 3].map(|j| diagram.at(DVec2::new(p[0], p[j])));
            let places = curve.points.iter().map(place);
            let places: Vec<[DVec2; 3]> = places.filter(|p| p[0].is_finite()).collect();
            let means = curve.points.iter().map(|p| DVec2::new(p[0], p[1]));
            _ = write!(
                svg,
                r#"<g class="curve" data-id="{}" stroke="{}" fill="none"><title>{}</title>{}"#,
                escape(&curve.id),
                svg::color(i),
                escape(&curve.label),
                diagram.line(means, &format!(r#"stroke-width="2"{dash}"#))
            );
            for [at, least, most] in places {
                if least.is_finite() && most.y < least.y {
                    _ = write!(
                        svg,
                        r#"<path d="M{:.1} {:.1}V{:.1}" opacity=".5"/>"#,
                        at.x, least.y, most.y
                    );
                }
                svg += &mark(i, at);
            }
            svg += "</g>";
        }
        svg
    }

    /// A line of the given slope from the start of the first curve, down to the axis at most.
    fn guide(&self, slope: f64, diagram: &Diagram) -> String {
        let Some(first) = self.curves.first().and_then(|c| c.points.first()) else {
            return String::new();
        };
        let last = self.curves[0].points[self.curves[0].points.len() - 1];
        let lowest = 10_f64.powf(diagram.y.low);
        let end_y = (first[1] * (last[0] / first[0]).powf(slope)).max(lowest);
        let end_x = first[0] * (end_y / first[1]).powf(1.0 / slope);
        let from = diagram.at(DVec2::new(first[0], first[1]));
        let to = diagram.at(DVec2::new(end_x, end_y));
        format!(
            r#"<path class="guide" d="M{:.1} {:.1}L{:.1} {:.1}"/>{}"#,
            from.x,
            from.y,
            to.x,
            to.y,
            svg::text(to - DVec2::new(0.0, 5.0), "end", &format!("slope {slope}"))
        )
    }

    fn legend(&self) -> String {
        let items = self.curves.iter().enumerate().map(|(i, curve)| {
            format!(
                r#"<li><svg class="key" viewBox="0 0 12 12" stroke="{}" fill="none">{}</svg>{}</li>"#,
                svg::color(i),
                mark(i, DVec2::splat(6.0)),
                escape(&curve.label)
            )
        });
        format!(r#"<ul class="legend">{}</ul>"#, items.collect::<String>())
    }
}

/// The mark of curve `i`.
fn mark(i: usize, at: DVec2) -> String {
    let (DVec2 { x, y }, color) = (at, svg::color(i));
    match i % 4 {
        0 => format!(r#"<circle cx="{x:.1}" cy="{y:.1}" r="3.2" fill="{color}"/>"#),
        1 => format!(
            r#"<rect x="{:.1}" y="{:.1}" width="6" height="6" fill="{color}"/>"#,
            x - 3.0,
            y - 3.0
        ),
        2 => format!(
            r#"<path d="M{x:.1} {:.1}l4 7h-8z" fill="{color}"/>"#,
            y - 4.0
        ),
        _ => format!(
            r#"<path d="M{:.1} {:.1}l7 7m0 -7l-7 7" stroke-width="2"/>"#,
            x - 3.5,
            y - 3.5
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_in_logarithms_is_straight() {
        let plot = Plot {
            id: "p".to_owned(),
            x: "time",
            y: "a < b",
            log_y: true,
            slope: Some(-1.0),
            curves: vec![Curve {
                id: "one".to_owned(),
                label: "one & only".to_owned(),
                points: [1.0, 10.0, 100.0]
                    .map(|x| [x, 1.0 / x, 0.9 / x, 1.1 / x])
                    .to_vec(),
            }],
        };
        let svg = plot.figure();
        let points = svg
            .split("polyline points=\"")
            .nth(1)
            .and_then(|s| s.split('"').next());
        let xy: Vec<f64> = points
            .expect("a curve")
            .split([' ', ','])
            .map(|n| n.parse().expect("number"))
            .collect();
        assert!(
            (xy[0] + xy[4] - 2.0 * xy[2]).abs() < 0.2 && (xy[1] + xy[5] - 2.0 * xy[3]).abs() < 0.2
        );
        assert!(
            svg.contains("a &lt; b") && svg.contains("one &amp; only") && svg.contains("slope -1")
        );
        let file = plot.file();
        assert!(file.starts_with("<svg xmlns=") && file.contains("one &amp; only</text>"));
        let empty = Plot {
            curves: Vec::new(),
            ..plot
        };
        assert!(!empty.has_points());
    }

    #[test]
    fn the_guide_ends_at_the_axis() {
        let plot = Plot {
            id: "p".to_owned(),
            x: "time",
            y: "error",
            log_y: true,
            slope: Some(-0.5),
            curves: vec![Curve {
                id: "flat".to_owned(),
                label: "flat".to_owned(),
                points: [1.0, 100.0].map(|x| [x, 2.0, 1.9, 2.1]).to_vec(),
            }],
        };
        let svg = plot.figure();
        let guide = svg.split("class=\"guide\" d=\"M").nth(1).expect("a guide");
        let path = guide.split('"').next().expect("its path");
        let numbers: Vec<f64> = path
            .split([' ', 'L'])
            .map(|n| n.parse().expect("number"))
            .collect();
        assert!(
            numbers[0] < numbers[2] && numbers[1] < numbers[3],
            "it falls: {path}"
        );
        assert!(numbers[3] <= HEIGHT - MARGIN[3] + 0.1, "{path}");
    }
}
