//! Pictures for the page, and files to save: the same development, and the same bytes, as on the
//! command line.

use super::http::{Request, Response};
use super::stage::Subject;
use super::studio::Studio;
use crate::develop::{Development, Exposure, ToneCurve, White};
use crate::io::exr::{self, ExrImage, MetadataValue};
use crate::io::image::development;
use crate::io::png::{Depth, picture_bytes};
use crate::math::named::Named;
use std::path::Path;
use std::str::FromStr;

/// Largest number of stops, as on the command line.
const MAX_STOPS: f64 = 1000.0;

fn refused(message: &str) -> Response {
    Response::refusal(400, message)
}

fn nothing() -> Response {
    Response::refusal(409, "there is no picture yet")
}

/// The development that a query asks for, over that of the sensor.
fn chosen(request: &Request, base: Development) -> Result<Development, Response> {
    let value = |name: &str| {
        let value = request.query.get(name).map(String::as_str);
        value.filter(|value| !value.is_empty())
    };
    let exposure = match value("exposure") {
        None | Some("auto") => base.exposure,
        Some(text) => {
            let stops = text.parse().ok().filter(|s: &f64| s.abs() <= MAX_STOPS);
            Exposure::Stops(stops.ok_or_else(|| refused("exposure: expected auto or stops"))?)
        }
    };
    let tone = match value("tone") {
        None => base.tone,
        Some(name) => ToneCurve::named(name).ok_or_else(|| refused("no such tone curve"))?,
    };
    let white = match value("white") {
        None => base.white,
        Some(text) => White::from_str(text).map_err(|e| refused(&e))?,
    };
    Ok(Development {
        exposure,
        tone,
        white,
        ..base
    })
}

fn png(image: &ExrImage, layer: Option<&str>, request: &Request) -> Result<Response, Response> {
    let xyz = match layer {
        None => image.xyz(),
        Some(name) => image.layer_xyz(name),
    };
    let xyz = xyz.ok_or_else(|| refused("no such layer"))?;
    let mut base = development(image);
    if matches!(layer, Some("error" | "bias" | "depth")) {
        // no light; where one is unknown, it is infinite, hence black
        base = Development::MEASUREMENT;
    }
    let size = (image.crop.width(), image.crop.height());
    let mut response = developed(size, &xyz, &chosen(request, base)?)?;
    if let Some(MetadataValue::Text(flux)) = image.metadata.get("flux") {
        response.headers.push(("X-Flux", flux.clone()));
    }
    Ok(response)
}

fn developed(
    size: (u32, u32),
    xyz: &[f64],
    development: &Development,
) -> Result<Response, Response> {
    let picture = development.develop(xyz);
    let bytes = picture_bytes(size, &picture, development.display, Depth::Eight);
    let bytes = bytes.map_err(|e| Response::refusal(500, &e.to_string()))?;
    let mut response = Response::of("image/png", bytes);
    let about = [("X-Stops", picture.stops), ("X-Clipped", picture.clipped)];
    let about = about.map(|(name, value)| (name, format!("{value:.4}")));
    response.headers.extend(about);
    Ok(response)
}

/// A picture of what is looked at (its first look before the first pass), or of the snapshot.
pub fn show(request: &Request, studio: &Studio) -> Result<Response, Response> {
    let layer = request.query.get("layer").map(String::as_str);
    let layer = layer.filter(|name| !name.is_empty());
    if request.query.get("of").is_some_and(|of| of == "snapshot") {
        let snapshot = studio.snapshot().ok_or_else(Response::nothing_yet)?;
        return png(&snapshot.image, None, request);
    }
    let stage = studio.stage().ok_or_else(Response::nothing_yet)?;
    let image = match layer {
        Some(layer) => stage.image_with(layer),
        None => stage.image(),
    };
    if let Some(image) = image {
        return png(&image, layer, request);
    }
    let look = match &stage.subject {
        Subject::Look(look) => Some(look),
        Subject::Render { look, .. } => look.as_ref(),
        Subject::Image(_) => None,
    };
    // light that only merged photons bring is not in it
    let look = look.filter(|look| !look.is_black());
    let look = look.ok_or_else(Response::nothing_yet)?;
    let base = if stage.is_detector {
        Development::MEASUREMENT
    } else {
        Development::PHOTOGRAPH
    };
    developed(
        (look.width, look.height),
        &look.xyz,
        &chosen(request, base)?,
    )
}

/// The picture as a file to save.
pub fn save_png(request: &Request, studio: &Studio) -> Result<Response, Response> {
    let image = studio.stage().and_then(|stage| stage.image());
    let response = png(&image.ok_or_else(nothing)?, None, request)?;
    Ok(download(response, "abbe.png"))
}

/// The image as a file to save.
pub fn save_exr(studio: &Studio) -> Result<Response, Response> {
    let image = studio.stage().and_then(|stage| stage.whole_image());
    let bytes = exr::encoded(Path::new("the image"), &image.ok_or_else(nothing)?);
    let bytes = bytes.map_err(|e| Response::refusal(500, &e.to_string()))?;
    Ok(download(Response::of("image/x-exr", bytes), "abbe.exr"))
}

/// A response that the browser saves under a name.
fn download(mut response: Response, name: &str) -> Response {
    let disposition = format!("attachment; filename=\"{name}\"");
    response.headers.push(("Content-Disposition", disposition));
    response
}
