//! Parts of drawings as SVG that reports share: the head of a file, colors and keys of a legend,
//! round numbers, axes and diagrams.

use super::html::escape;
use glam::DVec2;
use std::fmt::Write as _;

/// Colors that most eyes tell apart, those who see fewer of them included (Okabe and Ito).
pub const COLORS: [&str; 8] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#555555", "#8c6d1f",
];

/// Color of the i-th thing of a drawing.
#[must_use]
pub fn color(i: usize) -> &'static str {
    COLORS[i % COLORS.len()]
}

/// Head of a file of that many pixels, which shrinks with its window, and its title as text that
/// readers of the screen are told. `</svg>` ends the file.
#[must_use]
pub fn head(width: f64, height: f64, title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {width:.1} {height:.1}\" style=\"max-width:100%;height:auto\">\n\
         <title>{}</title>\n\
         <style>text{{font:13px sans-serif;fill:#333;stroke:none}}.title{{font-size:14px}}\
         .grid{{stroke:#e2e2e2}}.frame{{stroke:#999;fill:none}}\
         .guide{{stroke:#999;stroke-dasharray:2 4;fill:none}}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
        escape(title)
    )
}

/// Head of a file with its title above the drawing, which has 28 pixels less.
#[must_use]
pub fn titled(width: f64, height: f64, title: &str) -> String {
    format!(
        "{}<text class=\"title\" x=\"12\" y=\"20\">{}</text>\n",
        head(width, height, title),
        escape(title)
    )
}

/// Text, made safe.
#[must_use]
pub fn text(at: DVec2, anchor: &str, text: &str) -> String {
    format!(
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{}</text>",
        at.x,
        at.y,
        escape(text)
    )
}

/// Line of a legend: a sign around a point, and its text.
#[must_use]
pub fn key(sign: &str, at: DVec2, of: &str) -> String {
    format!("{sign}{}\n", text(at + DVec2::new(12.0, 4.5), "start", of))
}

/// Sign of the i-th thing of a drawing that is told by its color alone.
#[must_use]
pub fn dot(i: usize, at: DVec2) -> String {
    let DVec2 { x, y } = at;
    format!(
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{}\"/>",
        color(i)
    )
}

/// Frame of a rectangle.
#[must_use]
pub fn frame(corner: DVec2, size: DVec2) -> String {
    let (DVec2 { x, y }, DVec2 { x: w, y: h }) = (corner, size);
    format!(
        "<rect class=\"frame\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\"/>\n"
    )
}

/// Round number not below `value`: 1, 2 or 5 times a power of ten.
#[must_use]
pub fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-12).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * power);
    steps.into_iter().find(|s| *s >= value).unwrap_or(value)
}

/// Round number not above `value`: 1, 2 or 5 times a power of ten.
#[must_use]
pub fn round_down(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-12).log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|s| s * power);
    steps.into_iter().rfind(|s| *s <= value).unwrap_or(value)
}

/// Text of a number that has few digits.
#[must_use]
pub fn number(v: f64) -> String {
    if v == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e5).contains(&v.abs()) {
        // rounds what binary fractions add
        format!("{}", (v * 1e9).round() / 1e9)
    } else {
        let rounded: f64 = format!("{v:.5e}").parse().unwrap_or(v);
        format!("{rounded:e}")
    }
}

/// Axis: range (of decadic logarithms where it is logarithmic) and scale.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// Beginning.
    pub low: f64,
    /// End.
    pub high: f64,
    /// Whether it is logarithmic.
    pub log: bool,
}

impl Axis {
    /// Axis from 0 to a value above it.
    #[must_use]
    pub fn up_to(high: f64) -> Self {
        Self {
            low: 0.0,
            high,
            log: false,
        }
    }

    /// Axis over values and a little more; `None` where none of them can be shown.
    #[must_use]
    pub fn over(values: impl Iterator<Item = f64>, log: bool) -> Option<Self> {
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
    #[must_use]
    pub fn at(self, value: f64) -> f64 {
        let value = if self.log { value.log10() } else { value };
        (value - self.low) / (self.high - self.low)
    }

    /// Round values with a mark, and their texts.
    #[must_use]
    pub fn ticks(self) -> Vec<(f64, String)> {
        let span = self.high - self.low;
        if !self.log {
            // 1, 2 or 5 times a power of ten, of which three to eight go into the axis
            let step = 10_f64.powf((span / 4.0).log10().floor());
            let step = step
                * if span / step > 16.0 {
                    5.0
                } else if span / step > 8.0 {
                    2.0
                } else {
                    1.0
                };
            // an end that is round, too, may miss it by its last bit
            let first = (self.low / step - 1e-9).ceil() as i64;
            let last = (self.high / step + 1e-9).floor() as i64;
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

/// Diagram: a rectangle with an axis along its lower side and one along its left.
#[derive(Clone, Copy, Debug)]
pub struct Diagram {
    /// Upper left corner, pixels.
    pub corner: DVec2,
    /// Width and height, pixels.
    pub size: DVec2,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
}

impl Diagram {
    /// Place of a pair of values in the drawing. Not finite where an axis cannot show one.
    #[must_use]
    pub fn at(&self, p: DVec2) -> DVec2 {
        let share = DVec2::new(self.x.at(p.x), 1.0 - self.y.at(p.y));
        self.corner + share * self.size
    }

    /// Lines and numbers at round values, and the names of the axes; that of the vertical one
    /// stands so many pixels left of the rectangle.
    #[must_use]
    pub fn grid(&self, x_name: &str, y_name: &str, left: f64) -> String {
        let (low, high) = (self.corner, self.corner + self.size);
        let mut svg = String::new();
        for (value, label) in self.x.ticks() {
            let x = low.x + self.x.at(value) * self.size.x;
            let at = DVec2::new(x, high.y + 17.0);
            _ = write!(
                svg,
                r#"<path class="grid" d="M{x:.1} {:.1}V{:.1}"/>{}"#,
                high.y,
                low.y,
                text(at, "middle", &label)
            );
        }
        for (value, label) in self.y.ticks() {
            let y = high.y - self.y.at(value) * self.size.y;
            let at = DVec2::new(low.x - 6.0, y + 4.0);
            _ = write!(
                svg,
                r#"<path class="grid" d="M{:.1} {y:.1}H{:.1}"/>{}"#,
                low.x,
                high.x,
                text(at, "end", &label)
            );
        }
        let middle = 0.5 * (low + high);
        _ = write!(
            svg,
            r#"{}<text transform="translate({:.1} {:.1}) rotate(-90)" text-anchor="middle">{}</text>"#,
            text(DVec2::new(middle.x, high.y + 38.0), "middle", x_name),
            low.x - left,
            middle.y,
            escape(y_name)
        );
        svg
    }

    /// Line through pairs of values; those that the axes cannot show are left out.
    #[must_use]
    pub fn line(&self, points: impl Iterator<Item = DVec2>, style: &str) -> String {
        let shown = points.map(|p| self.at(p)).filter(|p| p.is_finite());
        let shown: Vec<String> = shown.map(|p| format!("{:.1},{:.1}", p.x, p.y)).collect();
        let points = shown.join(" ");
        format!(r#"<polyline points="{points}" fill="none" {style}/>"#)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers() {
        let texts = |low: f64, high: f64, log| {
            let axis = Axis::over([low, high].into_iter(), log).expect("range");
            axis.ticks().into_iter().map(|t| t.1).collect::<Vec<_>>()
        };
        assert_eq!(texts(0.1, 100.0, true), ["0.1", "1", "10", "100"]);
        assert_eq!(texts(1.0, 5.0, true), ["1", "2", "5"]);
        assert!((2..12).contains(&texts(0.31, 0.37, false).len()));
        let up_to = |high| Axis::up_to(high).ticks().into_iter().map(|t| t.1);
        assert!(up_to(1.0).eq(["0", "0.2", "0.4", "0.6", "0.8", "1"]));
        assert!(up_to(13.436).eq(["0", "2", "4", "6", "8", "10", "12"]));
        // ends that are round are there, and small numbers stay apart
        assert!(up_to(0.6).eq(["0", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6"]));
        assert!(up_to(5e-4).eq(["0", "1e-4", "2e-4", "3e-4", "4e-4", "5e-4"]));
        assert!(up_to(5.5e-4).next_back().is_some_and(|t| t == "5e-4"));
        for high in (1..=2000).map(|i| f64::from(i) * 0.0137) {
            let ticks = Axis::up_to(high).ticks();
            assert!((4..=9).contains(&ticks.len()), "{high}: {ticks:?}");
            for (value, label) in ticks {
                assert!(label.len() <= 6, "{high}: {label}");
                let told: f64 = label.parse().expect("a number");
                assert!((told - value).abs() <= 1e-9 * high, "{high}: {label}");
            }
        }
    }

    #[test]
    fn round_numbers_are_the_next_ones() {
        for (value, expected) in [
            (0.9, 1.0),
            (1.0, 1.0),
            (1.1, 2.0),
            (3.0, 5.0),
            (700.0, 1000.0),
        ] {
            assert!(
                (round_up(value) - expected).abs() < 1e-9 * expected,
                "{value}"
            );
        }
        for (value, expected) in [(0.9, 0.5), (1.0, 1.0), (4.9, 2.0), (0.057, 0.05)] {
            let difference: f64 = round_down(value) - expected;
            assert!(difference.abs() < 1e-9 * expected, "{value}");
        }
    }

    #[test]
    fn a_value_is_between_its_marks() {
        let diagram = Diagram {
            corner: DVec2::new(10.0, 20.0),
            size: DVec2::new(200.0, 100.0),
            x: Axis::up_to(4.0),
            y: Axis::up_to(2.0),
        };
        assert_eq!(diagram.at(DVec2::ZERO), DVec2::new(10.0, 120.0));
        assert_eq!(diagram.at(DVec2::new(4.0, 2.0)), DVec2::new(210.0, 20.0));
        let line = diagram.line([DVec2::ONE, DVec2::NAN].into_iter(), "");
        assert!(line.contains("points=\"60.0,70.0\""), "{line}");
        assert!(diagram.grid("a < b", "c", 50.0).contains("a &lt; b"));
    }
}
