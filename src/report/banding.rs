//! Bands: what sharing wavelengths and times in a pass does, photon merging beside bidirectional
//! path tracing.
//!
//! After figure 6 and table 1 of Bouchard, Iehl, Ostromoukhov and Poulin, "Improving Robustness of
//! Monte-Carlo Global Illumination with Directional Regularization" (2013). All renders are without
//! regularization and with the box filter, so that the errors of pixels are independent where paths
//! are.

use super::ReportError;
use super::compare::{ColorLines, Xyz, bands, bands_json};
use super::html::{self, escape, png_url};
use crate::develop::Development;
use crate::film::{Crop, Filter};
use crate::io::loaded::{self, Loaded};
use crate::io::png::developed_bytes;
use crate::math::banding::Banding;
use crate::math::image_error::image_error;
use crate::render::session::NO_LIMIT;
use crate::render::{Render, Session, SessionOptions, SharedWavelengths};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::ops::{ControlFlow, Range};
use std::path::PathBuf;
use std::sync::Arc;

/// The page.
const TEMPLATE: &str = include_str!("banding.html");
/// Pixels between the pictures of the comparison.
const GAP: usize = 4;
/// The film of the memory table.
const FULL_HD: u64 = 1920 * 1080;
/// Light vertices as other programs store them, in bytes, and what the paper's table 1 says of a
/// film of 1920 x 1080.
const OTHERS: [(&str, u64, f64); 2] = [("LuxRender", 250, 1900e6), ("SmallVCM", 120, 920e6)];

/// The comparison asked for.
#[derive(Clone, Debug)]
pub struct BandingStudy {
    /// The scene file.
    pub scene: PathBuf,
    /// Keys of the scene file that all renders replace.
    pub overrides: Vec<(String, String)>,
    /// The sensor; `None`: the first.
    pub sensor: Option<String>,
    /// Numbers of passes after which images are compared, in any order.
    pub passes: Vec<u32>,
    /// Passes of the reference.
    pub reference_passes: u32,
    /// Where colors run.
    pub lines: ColorLines,
}

/// One image.
#[derive(Debug)]
struct Shot {
    method: &'static str,
    passes: usize,
    /// CPU seconds of all threads.
    seconds: f64,
    xyz: Xyz,
    shared: Option<SharedWavelengths>,
}

/// A shot and what was measured in it.
#[derive(Debug)]
struct Row {
    shot: Shot,
    bands: [Banding; 3],
    rel_mse: f64,
}

/// Memory of light vertices.
#[derive(Debug)]
struct Memory {
    bytes_per_vertex: u64,
    vertices_per_path: f64,
}

/// Choices that all renders of the comparison have in common.
struct Plan<'a> {
    study: &'a BandingStudy,
    /// Keys of the scene file that all of them replace.
    overrides: Vec<(String, String)>,
    sensor: usize,
    crop: Crop,
    /// Numbers of passes, ascending.
    passes: Vec<u32>,
}

/// The images and their bands.
#[derive(Debug)]
pub struct Findings {
    rows: Vec<Row>,
    memory: Memory,
    size: (u32, u32),
    passes: Vec<u32>,
    title: String,
    reference_passes: u32,
}

impl BandingStudy {
    /// Renders everything and measures it.
    ///
    /// # Errors
    /// Where the scene does not load, or the region is not on its film or has no bands.
    pub fn run(&self) -> Result<Findings, ReportError> {
        let plan = Plan::new(self)?;
        let (merged, memory) = plan.merging("vcm", "hero")?;
        let (stratified, _) = plan.merging("vcm, stratified passes", "stratified")?;
        let (equal_passes, equal_time) = plan.bdpt(&merged)?;
        // another seed: its errors must not be those of the images
        let loaded = plan.load("bdpt", "hero", 1)?;
        let mut session = plan.session(&loaded, 0..self.reference_passes)?;
        session.run();
        let reference = image(&session.render());
        let mut rows = Vec::new();
        let shots = merged
            .into_iter()
            .zip(stratified)
            .zip(equal_passes)
            .zip(equal_time);
        for shot in shots.flat_map(|(((a, b), c), d)| [a, b, c, d]) {
            rows.push(plan.row(shot, &reference)?);
        }
        let title = self.scene.file_stem().unwrap_or_default();
        Ok(Findings {
            rows,
            memory,
            size: (plan.crop.width(), plan.crop.height()),
            passes: plan.passes,
            title: title.to_string_lossy().into_owned(),
            reference_passes: self.reference_passes,
        })
    }
}

fn image(render: &Render) -> Xyz {
    let crop = render.crop();
    Xyz {
        size: (crop.width(), crop.height()),
        values: render.xyz(),
        of: [None, None],
    }
}

impl<'a> Plan<'a> {
    /// Finds the sensor; what is wrong with the options is found before anything is rendered.
    fn new(study: &'a BandingStudy) -> Result<Self, ReportError> {
        let fixed = [("render.regularize", "off"), ("render.filter", "box")];
        let fixed = fixed.map(|(key, value)| (key.to_owned(), value.to_owned()));
        let mut overrides: Vec<_> = study.overrides.iter().cloned().chain(fixed).collect();
        let loaded = loaded::load(&study.scene, &overrides)?;
        let sensor = loaded.sensor(study.sensor.as_deref())?;
        let seen_by = &loaded.scene.sensors[sensor];
        if seen_by.filter != Filter::Box {
            // it has a filter of its own
            overrides.push((format!("sensor.{sensor}.filter"), "box".to_owned()));
        }
        let crop = seen_by.whole_film();
        study.lines.region((crop.width(), crop.height()))?;
        let mut passes = study.passes.clone();
        passes.sort_unstable();
        passes.dedup();
        Ok(Self {
            study,
            overrides,
            sensor,
            crop,
            passes,
        })
    }

    /// The scene as one method renders it; `seed` is added to the scene's.
    fn load(&self, integrator: &str, sharing: &str, seed: u64) -> Result<Loaded, ReportError> {
        let method = [
            ("render.integrator", integrator),
            ("render.sharing", sharing),
        ];
        let method = method.map(|(key, value)| (key.to_owned(), value.to_owned()));
        let overrides: Vec<_> = self.overrides.iter().cloned().chain(method).collect();
        let mut loaded = loaded::load(&self.study.scene, &overrides)?;
        loaded.settings.seed = loaded.settings.seed.wrapping_add(seed);
        Ok(loaded)
    }

    fn session(&self, loaded: &Loaded, passes: Range<u32>) -> Result<Session, ReportError> {
        let options = SessionOptions {
            sensor: self.sensor,
            passes: Some(passes),
            ..SessionOptions::default()
        };
        let scene = Arc::clone(&loaded.scene);
        Ok(Session::new(scene, &loaded.settings, options)?)
    }

    /// Images with merging after each number of passes, ascending.
    fn merging(
        &self,
        method: &'static str,
        sharing: &str,
    ) -> Result<(Vec<Shot>, Memory), ReportError> {
        let loaded = self.load("vcm", sharing, 0)?;
        let last = self.passes.last().copied().unwrap_or(0);
        let mut session = self.session(&loaded, 0..last)?;
        let mut shots = Vec::new();
        session.run_with(|session, progress| {
            if self.passes.contains(&(progress.passes as u32)) {
                let render = session.render();
                shots.push(Shot {
                    method,
                    passes: progress.passes as usize,
                    seconds: progress.time.cpu_seconds(),
                    xyz: image(&render),
                    shared: render.shared_wavelengths(),
                });
            }
            Ok::<_, ReportError>(ControlFlow::Continue(()))
        })?;
        let render = session.render();
        let counters = render.counters();
        let memory = Memory {
            bytes_per_vertex: render.bytes_per_photon().unwrap_or(0),
            vertices_per_path: counters.photons as f64 / counters.paths.max(1) as f64,
        };
        Ok((shots, memory))
    }

    /// Images without merging: after the same passes, and after the same CPU time.
    fn bdpt(&self, merged: &[Shot]) -> Result<(Vec<Shot>, Vec<Shot>), ReportError> {
        let loaded = self.load("bdpt", "hero", 0)?;
        let mut session = self.session(&loaded, 0..NO_LIMIT)?;
        let (mut by_passes, mut by_time) = (Vec::new(), Vec::new());
        session.run_with(|session, progress| {
            let seconds = progress.time.cpu_seconds();
            let shot = |method| Shot {
                method,
                passes: progress.passes as usize,
                seconds,
                xyz: image(&session.render()),
                shared: None,
            };
            if self.passes.contains(&(progress.passes as u32)) {
                by_passes.push(shot("bdpt, as many passes"));
            }
            while merged
                .get(by_time.len())
                .is_some_and(|m| m.seconds <= seconds)
            {
                by_time.push(shot("bdpt, as much time"));
            }
            let done = by_passes.len() == self.passes.len() && by_time.len() == merged.len();
            Ok::<_, ReportError>(if done {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            })
        })?;
        Ok((by_passes, by_time))
    }

    fn row(&self, shot: Shot, reference: &Xyz) -> Result<Row, ReportError> {
        let width = self.crop.width() as usize;
        let error = image_error(&shot.xyz.channel(1), &reference.channel(1), width);
        Ok(Row {
            bands: bands(&shot.xyz, Some(reference), &self.study.lines)?,
            rel_mse: error.rel_mse,
            shot,
        })
    }
}

impl Findings {
    /// The images side by side, one line for each number of passes, as size and PNG.
    ///
    /// # Errors
    /// Where the picture is too large for the encoder.
    pub fn picture(&self, exposure_ev: f64) -> std::io::Result<((usize, usize), Vec<u8>)> {
        const COLUMNS: usize = 4;
        let rows = &self.rows;
        let (w, h) = (self.size.0 as usize, self.size.1 as usize);
        let width = COLUMNS * (w + GAP) - GAP;
        let height = rows.len() / COLUMNS * (h + GAP) - GAP;
        let mut xyz = vec![1.0; 3 * width * height];
        for (i, row) in rows.iter().enumerate() {
            let (left, top) = (i % COLUMNS * (w + GAP), i / COLUMNS * (h + GAP));
            for (y, line) in row.shot.xyz.values.chunks(3 * w).enumerate() {
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
        let mut text = format!(
            "{:<24}{:>7}{:>9}{:>9}{:>9}{:>9}{:>12}{:>8}  wavelengths\n",
            "", "passes", "s", "F of X", "F of Y", "F of Z", "coherent Y", "relMSE"
        );
        for row in &self.rows {
            let [x, y, z] = &row.bands;
            _ = writeln!(
                text,
                "{:<24}{:>7}{:>9.2}{:>9.2}{:>9.2}{:>9.2}{:>12.4}{:>8.4}  {}",
                row.shot.method,
                row.shot.passes,
                row.shot.seconds,
                x.f_ratio,
                y.f_ratio,
                z.f_ratio,
                y.coherent_rms,
                row.rel_mse,
                distinct(&row.shot).0,
            );
        }
        text
    }

    /// The measures as JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        let memory = &self.memory;
        let rows: Vec<Value> = self
            .rows
            .iter()
            .map(|row| {
                json!({
                    "method": row.shot.method,
                    "passes": row.shot.passes,
                    "cpu_seconds": row.shot.seconds,
                    "banding": bands_json(&row.bands),
                    "rel_mse": row.rel_mse,
                    "distinct_wavelengths": row.shot.shared.map(|s| s.distinct),
                    "largest_gap_nm": row.shot.shared.map(|s| s.largest_gap_nm),
                })
            })
            .collect();
        json!({
            "rows": rows,
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
        let memory = &self.memory;
        let mut body = String::new();
        for row in &self.rows {
            let [x, y, z] = &row.bands;
            let (count, gap) = distinct(&row.shot);
            let share = y.participation;
            let share = share.map_or_else(|| "-".to_owned(), |share| format!("{share:.2}"));
            _ = writeln!(
                body,
                "<tr><th>{}</th><td>{}</td><td>{:.2}</td><td>{:.2}</td><td>{:.2}</td><td>{:.2}</td><td>{:.4}</td><td>{share}</td><td>{:.4}</td><td>{count}</td><td>{gap}</td></tr>",
                row.shot.method,
                row.shot.passes,
                row.shot.seconds,
                x.f_ratio,
                y.f_ratio,
                z.f_ratio,
                y.coherent_rms,
                row.rel_mse,
            );
        }
        let mut table1 = String::new();
        for (program, bytes, total) in OTHERS {
            _ = writeln!(
                table1,
                "<tr><th>{program} (from the paper)</th><td>{bytes}</td><td></td><td>{:.0}</td></tr>",
                total * 1e-6
            );
        }
        _ = writeln!(
            table1,
            "<tr><th>abbe, vcm, this scene</th><td>{}</td><td>{:.2}</td><td>{:.0}</td></tr>\n<tr><th>abbe, bdpt</th><td>0</td><td></td><td>0</td></tr>",
            memory.bytes_per_vertex,
            memory.vertices_per_path,
            memory.at_full_hd() * 1e-6
        );
        let passes: Vec<String> = self.passes.iter().map(u32::to_string).collect();
        let parts = [
            ("STYLE", html::STYLE.to_owned()),
            ("TITLE", escape(&self.title)),
            ("PICTURE", png_url(png)),
            ("PASSES", passes.join(", ")),
            ("ROWS", body),
            ("REFERENCE", self.reference_passes.to_string()),
            ("MEMORY", table1),
        ];
        html::filled(TEMPLATE, &parts)
    }
}

fn distinct(shot: &Shot) -> (String, String) {
    match shot.shared {
        Some(shared) => (
            shared.distinct.to_string(),
            format!("{:.0}", shared.largest_gap_nm),
        ),
        None => ("one for each path".to_owned(), "-".to_owned()),
    }
}

impl Memory {
    fn at_full_hd(&self) -> f64 {
        self.bytes_per_vertex as f64 * self.vertices_per_path * FULL_HD as f64
    }
}
