//! Renders scenes whose radiance is known to the last digit: what is left is the noise of the
//! wavelengths.

use abbe::film::{Crop, Film};
use abbe::io::scene_file::parse_str;
use abbe::render::{OutputRequest, Render};
use abbe::scene::Scene;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Result of a render, as means over the passes.
pub struct Rendered {
    /// Columns.
    pub width: usize,
    /// XYZ by pixel.
    pub xyz: Vec<[f64; 3]>,
    /// Spectral channels by pixel (empty unless asked for).
    pub spectral: Vec<Vec<f64>>,
}

impl Rendered {
    /// Mean XYZ over the pixels of a rectangle.
    pub fn mean(&self, columns: Range<usize>, rows: Range<usize>) -> [f64; 3] {
        let count = (columns.len() * rows.len()) as f64;
        let pixels = rows.flat_map(|y| columns.clone().map(move |x| y * self.width + x));
        pixels.fold([0.0; 3], |sum, i| {
            std::array::from_fn(|c| sum[c] + self.xyz[i][c] / count)
        })
    }
}

/// Renders the first sensor of a scene file.
pub fn render(text: &str, request: &OutputRequest) -> Rendered {
    render_crop(text, None, request)
}

/// Renders part of the first sensor of a scene file.
pub fn render_crop(text: &str, crop: Option<Crop>, request: &OutputRequest) -> Rendered {
    let loaded = parse_str(text, Path::new(".")).unwrap_or_else(|e| panic!("{e}"));
    let scene = Arc::new(Scene::build(loaded.description).unwrap());
    let crop = crop.unwrap_or(scene.sensors[0].whole_film());
    let mut render = Render::new(&scene, 0, &loaded.settings, crop, request);
    let passes = loaded.settings.spp;
    (0..passes).for_each(|pass| render.add_pass(pass));
    let by_pixel = |film: &Film| -> Vec<Vec<f64>> {
        film.image(u64::from(passes))
            .chunks(film.channels())
            .map(<[f64]>::to_vec)
            .collect()
    };
    let outputs = render.outputs();
    Rendered {
        width: crop.width() as usize,
        xyz: by_pixel(&outputs.image)
            .into_iter()
            .map(|v| [v[0], v[1], v[2]])
            .collect(),
        spectral: outputs
            .spectral
            .as_ref()
            .map_or_else(Vec::new, |(_, film)| by_pixel(film)),
    }
}

/// `[render]` for scenes that are lit without noise: by camera paths of one reflection.
pub fn settings(spp: u32) -> String {
    format!(
        "[render]\nintegrator = \"path\"\nmax_depth = 1\nspp = {spp}\nseed = 7\nfilter = \"box\"\n"
    )
}

/// A parallel light at 45 degrees under which a perfect white diffuser, seen along -z, has the
/// luminance 1: the one connection to it is exact.
pub fn lamp(spectrum: &str) -> String {
    let y = std::f64::consts::PI * std::f64::consts::SQRT_2;
    format!(
        "[[light]]\ndirectional = {{ direction = [0, 1, -1], irradiance = {{ {spectrum}, luminance = {y} }} }}\n"
    )
}
