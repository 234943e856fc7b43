//! The findings as picture, table, JSON and page.

use super::{Findings, Memory, Row};
use crate::develop::Development;
use crate::io::png::developed_bytes;
use crate::math::banding::Banding;
use crate::report::cost::Spread;
use crate::report::html::{self, escape, png_url};
use crate::report::readable::counted;
use serde_json::{Value, json};
use std::fmt::Write as _;

const TEMPLATE: &str = include_str!("page.html");
/// Pixels between the pictures of the comparison.
const GAP: usize = 4;
/// The film of the memory table.
const FULL_HD: u64 = 1920 * 1080;
/// Light vertices as other programs store them, in bytes, and what the paper's table 1 says of a
/// film of 1920 x 1080.
const OTHERS: [(&str, u64, f64); 2] = [("LuxRender", 250, 1900e6), ("SmallVCM", 120, 920e6)];

impl Row {
    /// Over the seeds.
    fn spread(&self, value: impl Fn(&super::Measured) -> f64) -> Spread {
        Spread::of(self.measured.iter().map(value))
    }

    fn f_ratio(&self, channel: usize) -> Spread {
        self.spread(|m| m.bands[channel].f_ratio)
    }

    fn coherent(&self) -> Spread {
        self.spread(|m| m.bands[1].coherent_rms)
    }

    /// Share of the lines that have their energy; `None` where a seed has none.
    fn participation(&self, channel: usize) -> Option<Spread> {
        let shares = self.measured.iter().map(|m| m.bands[channel].participation);
        Some(Spread::of(shares.collect::<Option<Vec<f64>>>()?))
    }

    /// Distinct wavelengths and the largest gap between them (nm), of the first seed.
    fn wavelengths(&self) -> (String, String) {
        match self.shared {
            Some(shared) => (
                shared.distinct.to_string(),
                format!("{:.0}", shared.largest_gap_nm),
            ),
            None => ("one for each path".to_owned(), "-".to_owned()),
        }
    }

    fn bands_json(&self) -> Value {
        let mut bands = serde_json::Map::new();
        for (channel, name) in ["X", "Y", "Z"].into_iter().enumerate() {
            let of = |value: fn(&Banding) -> f64| self.spread(|m| value(&m.bands[channel]));
            let lines = self.measured.first().map(|m| m.bands[channel].groups);
            let bands_of_channel = json!({
                "f_ratio": of(|b| b.f_ratio),
                "coherent_rms": of(|b| b.coherent_rms),
                "participation": self.participation(channel),
                "lines": lines,
            });
            bands.insert(name.to_owned(), bands_of_channel);
        }
        Value::Object(bands)
    }
}

/// A mean with its standard error, where there are several seeds.
fn text(spread: Spread, digits: usize) -> String {
    match spread.error {
        Some(e) => format!("{:.digits$} ± {e:.digits$}", spread.mean),
        None => format!("{:.digits$}", spread.mean),
    }
}

/// The same where values may be of any size.
fn scientific(spread: Spread) -> String {
    match spread.error {
        Some(e) => format!("{:.2e} ± {e:.0e}", spread.mean),
        None => format!("{:.2e}", spread.mean),
    }
}

impl Findings {
    /// The images of the first seed side by side, one line for each number of passes, as size and
    /// PNG.
    ///
    /// # Errors
    /// Where the picture is too large for the encoder.
    pub fn picture(&self, exposure_ev: f64) -> std::io::Result<((usize, usize), Vec<u8>)> {
        let (rows, columns) = (&self.rows, self.methods.len());
        let (w, h) = (self.size.0 as usize, self.size.1 as usize);
        let width = columns * (w + GAP) - GAP;
        let height = rows.len() / columns * (h + GAP) - GAP;
        let mut xyz = vec![1.0; 3 * width * height];
        for (i, row) in rows.iter().enumerate() {
            let (left, top) = (i % columns * (w + GAP), i / columns * (h + GAP));
            for (y, line) in row.image.values.chunks(3 * w).enumerate() {
                let to = 3 * ((top + y) * width + left);
                xyz[to..to + 3 * w].copy_from_slice(line);
            }
        }
        let development = Development::linear(exposure_ev);
        let png = developed_bytes((width as u32, height as u32), &xyz, &development)?;
        Ok(((width, height), png))
    }

    /// The measures as text.
    #[must_use]
    pub fn table(&self) -> String {
        let mut table = format!(
            "{:<31}{:>7}{:>9}{:>16}{:>16}{:>16}{:>18}{:>18}  wavelengths\n",
            "", "passes", "s", "F of X", "F of Y", "F of Z", "coherent Y", "relMSE"
        );
        for row in &self.rows {
            let [x, y, z] = [0, 1, 2].map(|channel| text(row.f_ratio(channel), 2));
            _ = writeln!(
                table,
                "{:<31}{:>7.0}{:>9.2}{x:>16}{y:>16}{z:>16}{:>18}{:>18}  {}",
                row.method.name(),
                row.spread(|m| m.passes as f64).mean,
                row.spread(|m| m.seconds).mean,
                text(row.coherent(), 4),
                scientific(row.spread(|m| m.rel_mse)),
                row.wavelengths().0,
            );
        }
        table
    }

    /// The measures as JSON; means over the seeds with their standard errors.
    #[must_use]
    pub fn json(&self) -> Value {
        let memory = &self.memory;
        let row = |row: &Row| {
            json!({
                "method": row.method.name(),
                "passes": row.spread(|m| m.passes as f64),
                "cpu_seconds": row.spread(|m| m.seconds),
                "banding": row.bands_json(),
                "rel_mse": row.spread(|m| m.rel_mse),
                "distinct_wavelengths": row.shared.map(|s| s.distinct),
                "largest_gap_nm": row.shared.map(|s| s.largest_gap_nm),
            })
        };
        json!({
            "seeds": self.seeds,
            "rows": self.rows.iter().map(row).collect::<Vec<_>>(),
            "memory": {
                "bytes_per_light_vertex": memory.bytes_per_vertex,
                "light_vertices_per_path": memory.vertices_per_path,
                "bytes_at_1920_x_1080": memory.at_full_hd(),
            },
        })
    }

    /// The page, which needs no other file, around the picture.
    #[must_use]
    pub fn page(&self, png: &[u8]) -> String {
        let mut body = String::new();
        for row in &self.rows {
            let (count, gap) = row.wavelengths();
            let share = row.participation(1);
            let share = share.map_or_else(|| "-".to_owned(), |share| text(share, 2));
            let cells = [
                format!("{:.0}", row.spread(|m| m.passes as f64).mean),
                format!("{:.2}", row.spread(|m| m.seconds).mean),
                text(row.f_ratio(0), 2),
                text(row.f_ratio(1), 2),
                text(row.f_ratio(2), 2),
                text(row.coherent(), 4),
                share,
                scientific(row.spread(|m| m.rel_mse)),
                count,
                gap,
            ];
            body += &html::row(row.method.name(), cells);
        }
        let columns: Vec<&str> = self.methods.iter().map(|m| m.name()).collect();
        let passes: Vec<String> = self.passes.iter().map(u32::to_string).collect();
        let parts = [
            ("STYLE", html::STYLE.to_owned()),
            ("TITLE", escape(&self.title)),
            ("PICTURE", png_url(png)),
            ("WIDTH", (160 * columns.len()).to_string()),
            ("COLUMNS", columns.join("; ")),
            ("PASSES", passes.join(", ")),
            ("ROWS", body),
            ("SEEDS", counted(self.seeds.into(), "seed", "seeds")),
            ("REFERENCE", self.reference_passes.to_string()),
            ("MEMORY", self.memory.rows()),
        ];
        html::filled(TEMPLATE, &parts)
    }
}

impl Memory {
    fn at_full_hd(&self) -> f64 {
        self.bytes_per_vertex as f64 * self.vertices_per_path * FULL_HD as f64
    }

    /// Table 1 of the paper, continued.
    fn rows(&self) -> String {
        let megabytes = |bytes: f64| format!("{:.0}", bytes * 1e-6);
        let mut rows = String::new();
        for (program, bytes, total) in OTHERS {
            let name = format!("{program} (from the paper)");
            rows += &html::row(&name, [bytes.to_string(), String::new(), megabytes(total)]);
        }
        let vcm = [
            self.bytes_per_vertex.to_string(),
            format!("{:.2}", self.vertices_per_path),
            megabytes(self.at_full_hd()),
        ];
        rows += &html::row("abbe, vcm, this scene", vcm);
        rows + &html::row("abbe, bdpt", ["0".into(), String::new(), "0".into()])
    }
}
