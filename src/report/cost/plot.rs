//! Plots as inline SVG: curves on logarithmic axes with the spread of their seeds, a slope guide,
//! and keys that tell them apart without color.

use crate::report::html::escape;
use std::fmt::Write as _;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 380.0;
/// Free space left, right, above, below.
const MARGIN: [f64; 4] = [64.0, 14.0, 12.0, 46.0];
/// Height of a line of the legend in a file.
const LINE: f64 = 20.0;
/// Colors that most eyes tell apart (Okabe and Ito), then the same dashed.
const COLORS: [&str; 8] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#555555", "#8c6d1f",
];

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

/// An axis: range and scale.
#[derive(Clone, Copy)]
struct Axis {
    low: f64,
    high: f64,
    log: bool,
}

impl Axis {
    fn over(values: impl Iterator<Item = f64>, log: bool) -> Option<Self> {
        let usable = values.filter(|v| v.is_finite() && (!log || *v > 0.0));
        let (low, high) = usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
        if low > high {
            return None;
        }
        Some(if log {
            Self {
                low: low.log10() - 0.08,
                high: (high.log10() + 0.08).max(low.log10() + 0.3),
                log,
            }
        } else {
            let pad = (0.05 * (high - low)).max(1e-3 * high.abs()).max(1e-12);
            Self {
                low: low - pad,
                high: high + pad,
                log,
            }
        })
    }

    /// Share of the axis at which a value is.
    fn at(self, value: f64) -> f64 {
        let value = if self.log { value.log10() } else { value };
        (value - self.low) / (self.high - self.low)
    }

    /// Values with a mark, and its text.
    fn ticks(self) -> Vec<(f64, String)> {
        let span = self.high - self.low;
        if !self.log {
            let step = 10_f64.powf((span / 4.0).log10().floor());
            let step = step
                * if span / step > 12.0 {
                    5.0
                } else if span / step > 6.0 {
                    2.0
                } else {
                    1.0
                };
            let first = (self.low / step).ceil() as i64;
            let last = (self.high / step).floor() as i64;
            return (first..=last)
                .map(|i| i as f64 * step)
                .map(|v| (v, number(v)))
                .collect();
        }
        let digits: &[f64] = if span < 1.3 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let every = (span / 8.0).ceil().max(1.0) as usize;
        let powers = (self.low.floor() as i32..=self.high.ceil() as i32).step_by(every);
        powers
            .flat_map(|p| digits.iter().map(move |d| d * 10_f64.powi(p)))
            .filter(|v| (0.0..=1.0).contains(&self.at(*v)))
            .map(|v| (v, number(v)))
            .collect()
    }
}

/// A number with few digits.
fn number(v: f64) -> String {
    if v == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e5).contains(&v.abs()) {
        // rounds what binary fractions add
        format!("{}", (v * 1e9).round() / 1e9)
    } else {
        format!("{v:.0e}")
    }
}

impl Plot {
    fn axes(&self) -> Option<(Axis, Axis)> {
        let points = || self.curves.iter().flat_map(|c| c.points.iter());
        let xs = Axis::over(points().map(|p| p[0]), true)?;
        let ys = Axis::over(points().flat_map(|p| p[1..].iter().copied()), self.log_y)?;
        Some((xs, ys))
    }

    /// Whether there is anything to draw.
    #[must_use]
    pub fn has_points(&self) -> bool {
        self.axes().is_some()
    }

    /// The plot with its legend, as elements of a page.
    #[must_use]
    pub fn figure(&self) -> String {
        let start = format!(
            r#"<svg id="{}" class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{} against {}">"#,
            self.id,
            escape(self.y),
            escape(self.x)
        );
        format!("{start}{}</svg>{}", self.drawing(), self.legend())
    }

    /// The plot with its legend as an SVG file.
    #[must_use]
    pub fn file(&self) -> String {
        let height = HEIGHT + LINE * self.curves.len() as f64 + 8.0;
        let mut svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}"><style>text{{font:13px sans-serif;fill:#333;stroke:none}}.grid{{stroke:#e2e2e2}}.guide{{stroke:#999;stroke-dasharray:2 4;fill:none}}</style><rect width="100%" height="100%" fill="#fff"/>{}"##,
            self.drawing()
        );
        for (i, curve) in self.curves.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let y = HEIGHT + LINE * i as f64 + 8.0;
            _ = write!(
                svg,
                r#"<g stroke="{color}" fill="none">{}</g><text x="{:.1}" y="{:.1}">{}</text>"#,
                mark(i, MARGIN[0] + 6.0, y, color),
                MARGIN[0] + 18.0,
                y + 4.5,
                escape(&curve.label)
            );
        }
        svg + "</svg>\n"
    }

    /// Axes and curves; nothing where there is no point.
    fn drawing(&self) -> String {
        let Some((xs, ys)) = self.axes() else {
            return String::new();
        };
        let [left, right, top, bottom] = MARGIN;
        let px = |x: f64| left + xs.at(x) * (WIDTH - left - right);
        let py = |y: f64| HEIGHT - bottom - ys.at(y) * (HEIGHT - top - bottom);
        let mut svg = String::new();
        let (x0, x1, y0, y1) = (left, WIDTH - right, HEIGHT - bottom, top);
        for (value, text) in xs.ticks() {
            let x = px(value);
            _ = write!(
                svg,
                r#"<path class="grid" d="M{x:.1} {y0}V{y1}"/><text x="{x:.1}" y="{:.1}" text-anchor="middle">{text}</text>"#,
                y0 + 17.0
            );
        }
        for (value, text) in ys.ticks() {
            let y = py(value);
            _ = write!(
                svg,
                r#"<path class="grid" d="M{x0} {y:.1}H{x1}"/><text x="{:.1}" y="{:.1}" text-anchor="end">{text}</text>"#,
                x0 - 6.0,
                y + 4.0
            );
        }
        _ = write!(
            svg,
            r#"<text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text><text transform="translate(13 {:.1}) rotate(-90)" text-anchor="middle">{}</text>"#,
            0.5 * (x0 + x1),
            HEIGHT - 8.0,
            escape(self.x),
            0.5 * (y0 + y1),
            escape(self.y)
        );
        if let Some(slope) = self.slope {
            svg += &self.guide(slope, 10_f64.powf(ys.low), px, py);
        }
        for (i, curve) in self.curves.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let dash = if i < COLORS.len() {
                ""
            } else {
                r#" stroke-dasharray="6 4""#
            };
            let usable = |p: &&[f64; 4]| xs.at(p[0]).is_finite() && ys.at(p[1]).is_finite();
            let line: Vec<String> = curve
                .points
                .iter()
                .filter(usable)
                .map(|p| format!("{:.1},{:.1}", px(p[0]), py(p[1])))
                .collect();
            _ = write!(
                svg,
                r#"<g class="curve" data-id="{}" stroke="{color}" fill="none"><title>{}</title><polyline points="{}" stroke-width="2"{dash}/>"#,
                escape(&curve.id),
                escape(&curve.label),
                line.join(" ")
            );
            for p in curve.points.iter().filter(usable) {
                let (x, y) = (px(p[0]), py(p[1]));
                if ys.at(p[2]).is_finite() && p[3] > p[2] {
                    _ = write!(
                        svg,
                        r#"<path d="M{x:.1} {:.1}V{:.1}" opacity=".5"/>"#,
                        py(p[2]),
                        py(p[3])
                    );
                }
                svg += &mark(i, x, y, color);
            }
            svg += "</g>";
        }
        svg
    }

    /// A line of the given slope from the start of the first curve, down to `lowest` at most.
    fn guide(
        &self,
        slope: f64,
        lowest: f64,
        px: impl Fn(f64) -> f64,
        py: impl Fn(f64) -> f64,
    ) -> String {
        let Some(first) = self.curves.first().and_then(|c| c.points.first()) else {
            return String::new();
        };
        let last = self.curves[0].points[self.curves[0].points.len() - 1];
        let end_y = (first[1] * (last[0] / first[0]).powf(slope)).max(lowest);
        let end_x = first[0] * (end_y / first[1]).powf(1.0 / slope);
        format!(
            r#"<path class="guide" d="M{:.1} {:.1}L{:.1} {:.1}"/><text x="{:.1}" y="{:.1}" text-anchor="end">slope {slope}</text>"#,
            px(first[0]),
            py(first[1]),
            px(end_x),
            py(end_y),
            px(end_x),
            py(end_y) - 5.0
        )
    }

    fn legend(&self) -> String {
        let items = self.curves.iter().enumerate().map(|(i, curve)| {
            let color = COLORS[i % COLORS.len()];
            format!(
                r#"<li><svg class="key" viewBox="0 0 12 12" stroke="{color}" fill="none">{}</svg>{}</li>"#,
                mark(i, 6.0, 6.0, color),
                escape(&curve.label)
            )
        });
        format!(r#"<ul class="legend">{}</ul>"#, items.collect::<String>())
    }
}

/// The mark of curve `i`.
fn mark(i: usize, x: f64, y: f64, color: &str) -> String {
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

    #[test]
    fn ticks_are_round_numbers() {
        let texts = |low: f64, high: f64, log| {
            let axis = Axis::over([low, high].into_iter(), log).expect("range");
            axis.ticks().into_iter().map(|t| t.1).collect::<Vec<_>>()
        };
        assert_eq!(texts(0.1, 100.0, true), ["0.1", "1", "10", "100"]);
        assert_eq!(texts(1.0, 5.0, true), ["1", "2", "5"]);
        assert!((2..12).contains(&texts(0.31, 0.37, false).len()));
    }
}
