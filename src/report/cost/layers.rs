//! The images of single strategies: a pyramid with a row for each number of vertices (after Veach
//! 1997, figure 10.2), and the share of the light that regularized strategies bring.

use crate::develop::Development;
use crate::io::exr::{self, ExrImage};
use crate::io::png::{developed_bytes, png_bytes};
use crate::report::ReportError;
use crate::report::html::png_url;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Vertices of paths whose strategies are shown.
const MOST_VERTICES: u32 = 8;
/// Luminance that the mean of a row's brightest strategy is brought to.
const GRAY: f64 = 0.2;
/// Stops, at most, by which a row is brightened.
const MOST_STOPS: f64 = 16.0;

/// How a strategy makes its paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    /// By an edge between two sub-paths, or a sub-path alone.
    Joined,
    /// By merging: one vertex counts for both sides.
    Merged,
    /// By a chain of specular vertices that is solved for, which s and t do not count.
    Aimed,
}

impl Kind {
    /// End of the names of its layers.
    fn mark(self) -> &'static str {
        match self {
            Self::Joined => "",
            Self::Merged => "merged",
            Self::Aimed => "aimed",
        }
    }
}

/// One strategy's image.
struct Layer {
    s: u32,
    t: u32,
    kind: Kind,
    xyz: Vec<f64>,
}

impl Layer {
    /// Mean luminance.
    fn mean(&self) -> f64 {
        let y = self.xyz.iter().skip(1).step_by(3);
        y.sum::<f64>() / (self.xyz.len() / 3).max(1) as f64
    }
}

/// s, t and kind of a channel such as `s2t1merged.Y`.
fn strategy(channel: &str) -> Option<(u32, u32, Kind)> {
    let name = channel.strip_suffix(".Y")?.strip_prefix('s')?;
    let marked = [Kind::Merged, Kind::Aimed].into_iter();
    let mut marked = marked.filter_map(|kind| Some((name.strip_suffix(kind.mark())?, kind)));
    let (plain, kind) = marked.next().unwrap_or((name, Kind::Joined));
    let (s, t) = plain.split_once('t')?;
    Some((s.parse().ok()?, t.parse().ok()?, kind))
}

/// The interleaved XYZ values of a layer.
fn layer_xyz(image: &ExrImage, layer: &str) -> Option<Vec<f64>> {
    let mut xyz = vec![0.0; 3 * image.crop.pixels() as usize];
    for (c, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
        let values = image.channel(&format!("{layer}.{axis}"))?;
        for (pixel, value) in values.iter().enumerate() {
            xyz[3 * pixel + c] = f64::from(*value);
        }
    }
    Some(xyz)
}

/// The strategies of an image by the number of vertices of their paths, those of solved chains, of
/// any length, last. Black ones are left out.
fn rows(image: &ExrImage) -> BTreeMap<(bool, u32), Vec<Layer>> {
    let mut rows: BTreeMap<(bool, u32), Vec<Layer>> = BTreeMap::new();
    for channel in &image.channels {
        let Some((s, t, kind)) = strategy(&channel.name) else {
            continue;
        };
        let name = channel.name.trim_end_matches(".Y");
        let Some(xyz) = layer_xyz(image, name) else {
            continue;
        };
        // a merge joins two walks at one place: its path has a vertex less than they have
        let vertices = s + t - u32::from(kind == Kind::Merged);
        let layer = Layer { s, t, kind, xyz };
        if vertices <= MOST_VERTICES && layer.mean() > 0.0 {
            let row = (kind == Kind::Aimed, vertices);
            rows.entry(row).or_default().push(layer);
        }
    }
    for row in rows.values_mut() {
        row.sort_by_key(|l| (l.kind, l.s));
    }
    rows
}

/// The part of the page, from the image with a layer for each strategy.
///
/// # Errors
/// Where the image cannot be read.
pub fn section(path: &Path) -> Result<String, ReportError> {
    let image = exr::read(path)?;
    let size = (image.crop.width(), image.crop.height());
    let bad = |e: std::io::Error| ReportError::file(path, e.to_string());
    let mut html = String::new();
    if let Some(share) = share(&image) {
        let gray: Vec<u8> = share
            .iter()
            .flat_map(|v| [(255.0 * v).round() as u8; 3])
            .collect();
        let png = png_bytes(size.0, size.1, &gray).map_err(bad)?;
        _ = write!(
            html,
            r#"<figure id="share"><img alt="share of regularized strategies" src="{}"><figcaption>Share of the light that strategies bring which join at mirrors or smooth glass: black none, white all.</figcaption></figure>"#,
            png_url(&png)
        );
    }
    html += r#"<div class="scroll" id="pyramid">"#;
    for ((is_aimed, vertices), row) in rows(&image) {
        let brightest = row.iter().map(Layer::mean).fold(0.0, f64::max);
        let stops = (GRAY / brightest)
            .log2()
            .round()
            .clamp(-MOST_STOPS, MOST_STOPS);
        let chains = if is_aimed { " and a solved chain" } else { "" };
        _ = write!(
            html,
            r#"<h3>{vertices} vertices{chains}, {stops:+} EV</h3><div class="row">"#
        );
        for layer in &row {
            let png =
                developed_bytes(size, &layer.xyz, &Development::linear(stops)).map_err(bad)?;
            let mut name = format!("s {}, t {}", layer.s, layer.t);
            if layer.kind != Kind::Joined {
                name += ", ";
                name += layer.kind.mark();
            }
            _ = write!(
                html,
                r#"<figure><img alt="{name}" src="{}"><figcaption>{name}</figcaption></figure>"#,
                png_url(&png)
            );
        }
        html += "</div>";
    }
    Ok(html + "</div>")
}

/// Share of the regularized strategies per pixel; `None` where nothing is regularized.
fn share(image: &ExrImage) -> Option<Vec<f64>> {
    let part = image.channel("regularized.Y")?;
    if part.iter().all(|v| *v == 0.0) {
        return None;
    }
    let ratio = |(part, whole): (&f32, &f32)| {
        if *whole > 0.0 {
            f64::from(part / whole).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    Some(part.iter().zip(image.channel("Y")?).map(ratio).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strategies_are_read_from_names() {
        assert_eq!(strategy("s2t1.Y"), Some((2, 1, Kind::Joined)));
        assert_eq!(strategy("s12t3merged.Y"), Some((12, 3, Kind::Merged)));
        assert_eq!(strategy("s1t2aimed.Y"), Some((1, 2, Kind::Aimed)));
        for other in ["s2t1.X", "Y", "noise.Y", "st1.Y", "regularized.Y"] {
            assert_eq!(strategy(other), None, "{other}");
        }
    }
}
