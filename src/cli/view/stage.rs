//! The stage: what the page shows, and all that it is told of it.

use super::settings;
use crate::io::exr::{ExrImage, MetadataValue};
use crate::io::layers::{self, Layer};
use crate::io::{identity, image};
use crate::math::named::Named;
use crate::render::Render;
use crate::render::look::Look;
use crate::render::session::View;
use crate::scene::Settings;
use crate::spectrum::SensorResponse;
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
    /// Settings of a render.
    pub settings: Option<Settings>,
    /// Whether irradiance is measured.
    pub is_detector: bool,
    /// Width and height of a pixel of a detector, meters.
    pub pitch_m: Option<[f64; 2]>,
    /// cd/m² or lux that a Y of 1 stands for.
    pub unit: f64,
}

impl Stage {
    /// An image that is there as it is.
    pub fn of_image(version: u64, name: String, image: ExrImage) -> Self {
        let text = |name: &str| match image.metadata.get(name) {
            Some(MetadataValue::Text(text)) => text.as_str(),
            _ => "",
        };
        let response = if text("unit").starts_with("photometric") {
            SensorResponse::Photometric
        } else {
            SensorResponse::Xyz
        };
        Self {
            version,
            name,
            size: (image.crop.width(), image.crop.height()),
            settings: None,
            is_detector: text(identity::SENSOR_KIND) == identity::DETECTOR,
            pitch_m: identity::pitch_of_text(text(identity::PIXEL_PITCH)),
            unit: response.photometric_unit(),
            subject: Subject::Image(image),
        }
    }

    /// The image as the command line writes it. `None` before the first pass.
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

    /// The image with its standard error, in the layer `error`.
    pub fn image_with_error(&self) -> Option<ExrImage> {
        let mut image = self.image()?;
        if let Subject::Render { view, .. } = &self.subject {
            layers::add(&mut image, &[Layer::Error], &view.read(), &[]);
        }
        Some(image)
    }

    /// Layers that can be shown, besides the picture itself.
    fn layers(&self) -> Vec<String> {
        match &self.subject {
            Subject::Look(_) | Subject::Render { .. } => vec!["error".to_owned()],
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
            "renders": self.settings.is_some(),
            "detector": self.is_detector,
            "pitch": self.pitch_m,
            "layers": self.layers(),
            "settings": self.settings.as_ref().map(settings::shown),
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
        let (xyz, spectrum) = match &self.subject {
            Subject::Image(image) => {
                let index = y as usize * width as usize + x as usize;
                let value = |name: &str| Some(f64::from(*image.channel(name)?.get(index)?));
                (["X", "Y", "Z"].map(|name| value(name).unwrap_or(0.0)), None)
            }
            Subject::Look(_) => return None,
            Subject::Render { view, .. } => render_pixel(&view.read(), x, y)?,
        };
        Some(json!({
            "x": x,
            "y": y,
            "xyz": xyz,
            "luminance": xyz[1] * self.unit,
            "unit": if self.is_detector { "lx" } else { "cd/m²" },
            "spectrum": spectrum,
        }))
    }
}

/// XYZ and spectrum of a pixel of a render.
fn render_pixel(render: &Render, x: u32, y: u32) -> Option<([f64; 3], Option<Value>)> {
    let crop = render.crop();
    let (x, y) = (crop.x0 + x, crop.y0 + y);
    let passes = render.passes().len() as u64;
    let xyz = render.outputs().image.pixel(x, y, passes)?;
    let spectrum = render.outputs().spectral.as_ref().and_then(|(channels, film)| {
        let values = film.pixel(x, y, passes)?;
        let nm: Vec<f64> = channels.bin_centers_nm().collect();
        let (bins, lines) = values.split_at(nm.len());
        Some(json!({ "nm": nm, "values": bins, "lines_nm": channels.lines_nm(), "lines": lines }))
    });
    Some((<[f64; 3]>::try_from(xyz).ok()?, spectrum))
}
