//! The stage: what the page shows, and all that it is told of it.

use super::settings::{self, Chosen};
use crate::io::exr::{ExrImage, MetadataValue};
use crate::io::layers::{self, Layer};
use crate::io::{identity, image};
use crate::math::named::Named;
use crate::render::Render;
use crate::render::guides::Guide;
use crate::render::look::Look;
use crate::render::session::View;
use serde_json::{Value, json};

/// Subject of the page: a first look, a render or an image.
#[derive(Debug)]
pub enum Subject {
    /// The first look at a render that is being prepared.
    Look(Look),
    /// A render, and what is shown until its first pass is done.
    Render { view: View, look: Option<Look> },
    /// An image of a file.
    Image(ExrImage),
}

/// Something to look at, and what is known of it.
#[derive(Debug)]
pub struct Stage {
    /// Grows with every stage.
    pub version: u64,
    /// File and sensor.
    pub name: String,
    pub subject: Subject,
    /// Columns and rows of the picture.
    pub size: (u32, u32),
    /// Choices of the page for a render; `None` where it has none.
    pub chosen: Option<Chosen>,
    /// Layers that a render keeps, and the first hits that they show.
    pub layers: Vec<Layer>,
    pub guides: Vec<Guide>,
    /// Whether irradiance is measured.
    pub is_detector: bool,
    /// Width and height of a pixel of a detector, meters.
    pub pitch_m: Option<[f64; 2]>,
    /// Photometric unit of Y.
    pub unit_name: &'static str,
    /// So many of them that a Y of 1 stands for.
    pub unit: f64,
}

impl Stage {
    /// An image that is there as it is.
    pub fn of_image(version: u64, name: String, image: ExrImage) -> Self {
        let text = |name: &str| match image.metadata.get(name) {
            Some(MetadataValue::Text(text)) => text.as_str(),
            _ => "",
        };
        let response = identity::response_of_unit(text(identity::UNIT));
        Self {
            version,
            name,
            size: (image.crop.width(), image.crop.height()),
            chosen: None,
            layers: Vec::new(),
            guides: Vec::new(),
            is_detector: text(identity::SENSOR_KIND) == identity::DETECTOR,
            pitch_m: identity::pitch_of_text(text(identity::PIXEL_PITCH)),
            unit_name: identity::photometric_unit(text(identity::UNIT)),
            unit: response.photometric_unit(),
            subject: Subject::Image(image),
        }
    }

    /// The image without layers of a render. `None` before the first pass.
    pub fn image(&self) -> Option<ExrImage> {
        match &self.subject {
            Subject::Look(_) => None,
            Subject::Image(image) => Some(image.clone()),
            Subject::Render { view, .. } => {
                let render = view.read();
                (!render.passes().is_empty()).then(|| image::of(&render))
            }
        }
    }

    /// The image with one of its layers.
    pub fn image_with(&self, layer: &str) -> Option<ExrImage> {
        let mut image = self.image()?;
        if let Subject::Render { view, .. } = &self.subject {
            let (kept, render) = (self.shown_layers(), view.read());
            let is_chosen = |name: &str| name == layer;
            layers::add_chosen(&mut image, &kept, &render, &self.guides, is_chosen);
        }
        Some(image)
    }

    /// The image as the command line writes it, with all layers that it asks for.
    pub fn whole_image(&self) -> Option<ExrImage> {
        let mut image = self.image()?;
        if let Subject::Render { view, .. } = &self.subject {
            layers::add(&mut image, &self.layers, &view.read(), &self.guides);
        }
        Some(image)
    }

    /// Layers of a render that can be shown: the error needs nothing to be kept.
    fn shown_layers(&self) -> Vec<Layer> {
        let mut layers = self.layers.clone();
        if !layers.iter().any(|l| matches!(l, Layer::Error)) {
            layers.insert(0, Layer::Error);
        }
        layers
    }

    /// Names of the layers that can be shown, besides the picture itself.
    fn layers(&self) -> Vec<String> {
        match &self.subject {
            Subject::Look(_) => vec!["error".to_owned()],
            Subject::Render { view, .. } => layers::names(&self.shown_layers(), &view.read()),
            Subject::Image(image) => {
                let names = image.channels.iter();
                let names = names.filter_map(|c| Some(c.name.rsplit_once('.')?.0.to_owned()));
                let mut names: Vec<String> = names.collect();
                names.sort();
                names.dedup();
                names
            }
        }
    }

    /// Facts that the page is told.
    pub fn facts(&self) -> Value {
        let (width, height) = self.size;
        json!({
            "version": self.version,
            "name": self.name,
            "width": width,
            "height": height,
            "renders": self.chosen.is_some(),
            "detector": self.is_detector,
            "pitch": self.pitch_m,
            "layers": self.layers(),
            "settings": self.chosen.as_ref().map(settings::shown),
            "choices": settings::choices(),
            "tones": crate::develop::ToneCurve::ALL.iter().map(|t| t.as_str()).collect::<Vec<_>>(),
        })
    }

    /// A pixel from the top left: XYZ, luminance and spectrum.
    pub fn pixel(&self, x: u32, y: u32) -> Option<Value> {
        let (width, height) = self.size;
        if x >= width || y >= height {
            return None;
        }
        let (xyz, spectrum, sections) = match &self.subject {
            Subject::Image(image) => {
                let value = |name: &str, x: u32, y: u32| {
                    let index = y as usize * width as usize + x as usize;
                    let value = image.channel(name).and_then(|values| values.get(index));
                    value.map_or(0.0, |v| f64::from(*v))
                };
                let xyz = ["X", "Y", "Z"].map(|name| value(name, x, y));
                (xyz, None, self.sections((x, y), |x, y| value("Y", x, y)))
            }
            Subject::Look(_) => return None,
            Subject::Render { view, .. } => {
                let render = view.read();
                let (xyz, spectrum) = render_pixel(&render, x, y)?;
                let luminance = |x, y| render_xyz(&render, x, y).map_or(0.0, |xyz| xyz[1]);
                (xyz, spectrum, self.sections((x, y), luminance))
            }
        };
        Some(json!({
            "x": x,
            "y": y,
            "xyz": xyz,
            "luminance": xyz[1] * self.unit,
            "unit": self.unit_name,
            "spectrum": spectrum,
            "sections": sections,
        }))
    }

    /// Illuminance along the row and along the column of a pixel of a detector.
    fn sections(&self, (x, y): (u32, u32), value: impl Fn(u32, u32) -> f64) -> Option<Value> {
        if !self.is_detector {
            return None;
        }
        let (width, height) = self.size;
        let row: Vec<f64> = (0..width).map(|x| self.unit * value(x, y)).collect();
        let column: Vec<f64> = (0..height).map(|y| self.unit * value(x, y)).collect();
        Some(json!({ "row": row, "column": column }))
    }
}

/// XYZ of a pixel of a render.
fn render_xyz(render: &Render, x: u32, y: u32) -> Option<[f64; 3]> {
    let (crop, passes) = (render.crop(), render.passes().len() as u64);
    let film = &render.outputs().image;
    let xyz = film.pixel(crop.x0 + x, crop.y0 + y, passes)?;
    <[f64; 3]>::try_from(xyz).ok()
}

/// XYZ and spectrum of a pixel of a render.
fn render_pixel(render: &Render, x: u32, y: u32) -> Option<([f64; 3], Option<Value>)> {
    let xyz = render_xyz(render, x, y)?;
    let crop = render.crop();
    let (x, y) = (crop.x0 + x, crop.y0 + y);
    let passes = render.passes().len() as u64;
    let spectrum = render.outputs().spectral.as_ref().and_then(|(channels, film)| {
        let values = film.pixel(x, y, passes)?;
        let nm: Vec<f64> = channels.bin_centers_nm().collect();
        let (bins, lines) = values.split_at(nm.len());
        Some(json!({ "nm": nm, "values": bins, "lines_nm": channels.lines_nm(), "lines": lines }))
    });
    Some((xyz, spectrum))
}
