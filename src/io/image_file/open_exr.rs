//! OpenEXR images as textures: the display window of the first part that has colors (openexr.com,
//! "Technical Introduction").
//!
//! Pixels of the data window outside the display window are not seen, and what the data window
//! leaves open is black.

use super::primaries::{Primaries, xyz_to_linear_srgb};
use super::{Decoded, Encoding, Limits, MAX_TEXELS_PER_BYTE, check_size, floats};
use crate::io::exr_blocks;
use exr::meta::MetaData;
use exr::meta::attribute::Chromaticities;
use exr::prelude::{
    AnyChannel, AnyChannels, FlatSamples, IntegerBounds, Layer, ReadChannels, ReadLayers, Vec2,
};
use glam::DMat3;
use std::io::Cursor;

/// Most names of channels that a message lists.
const MAX_LISTED: usize = 40;

type Part = Layer<AnyChannels<FlatSamples>>;

pub fn decode(bytes: &[u8], encoding: Encoding, limits: Limits) -> Result<Decoded, String> {
    let text = |e: exr::error::Error| format!("not a readable OpenEXR image ({e})");
    // sizes first: the decoder allocates what the header promises
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), true).map_err(text)?;
    if meta.headers.iter().any(|h| h.deep) {
        return Err("an OpenEXR image of deep data (allowed: scan lines and tiles)".to_owned());
    }
    let samples = meta.headers.iter().map(|h| {
        let area = (h.layer_size.0 as u64).saturating_mul(h.layer_size.1 as u64);
        area.saturating_mul(h.channels.list.len() as u64)
    });
    let samples = samples.fold(0, u64::saturating_add);
    if samples > limits.samples {
        let limit = limits.samples;
        return Err(format!(
            "the number of samples is {samples} (allowed: at most {limit})"
        ));
    }
    if samples > (bytes.len() as u64).saturating_mul(MAX_TEXELS_PER_BYTE) {
        let there = bytes.len();
        return Err(format!(
            "claims {samples} samples in {there} bytes: truncated or damaged"
        ));
    }
    exr_blocks::check(bytes).map_err(text)?;
    let file = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(text)?;
    let parts = &file.layer_data;
    let (part, (colors, kind)) = parts
        .iter()
        .find_map(|p| Some((p, colors(p)?)))
        .ok_or_else(|| format!("no channels R, G, B (there: {})", listed(parts)))?;
    let mut notes = Vec::new();
    if parts.len() > 1 {
        notes.push(format!(
            "one of {} parts is read: {}",
            parts.len(),
            name(part).unwrap_or_else(|| "the first with colors".to_owned())
        ));
    }
    let transparent = |v: f32| v != 1.0;
    let alpha = part.channel_data.list.iter().find(|c| c.name == *"A");
    if alpha.is_some_and(|a| a.sample_data.values_as_f32().any(transparent)) {
        notes.push("channel A is not read: the image covers all".to_owned());
    }
    let window = file.attributes.display_window;
    let (width, height) = (window.size.0 as u64, window.size.1 as u64);
    check_size(width, height, bytes.len(), limits)?;
    let (values, outside) = windowed(part, colors, window);
    if outside {
        notes.push("pixels outside the display window are not read".to_owned());
    }
    let map = match (kind, file.attributes.chromaticities) {
        (Kind::Xyz, _) => Some(xyz_to_linear_srgb()),
        (Kind::Gray, _) | (Kind::Rgb, None) => None,
        (Kind::Rgb, Some(c)) => map_of(&c)?,
    };
    let size = (window.size.0 as u32, window.size.1 as u32);
    let mut decoded = floats::image(size, values, map, encoding)?;
    notes.append(&mut decoded.notes);
    decoded.notes = notes;
    Ok(decoded)
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Rgb,
    Xyz,
    Gray,
}

fn colors(part: &Part) -> Option<([&AnyChannel<FlatSamples>; 3], Kind)> {
    let pixels = part.size.area();
    let channel = |name: &str| {
        let mut all = part.channel_data.list.iter();
        all.find(|c| c.name == *name && c.sampling == Vec2(1, 1) && c.sample_data.len() == pixels)
    };
    let all = |names: [&str; 3]| {
        let [a, b, c] = names.map(channel);
        Some([a?, b?, c?])
    };
    if let Some(rgb) = all(["R", "G", "B"]) {
        return Some((rgb, Kind::Rgb));
    }
    if let Some(xyz) = all(["X", "Y", "Z"]) {
        return Some((xyz, Kind::Xyz));
    }
    // with differences of colors beside it, Y is no gray
    let colored = |c: &AnyChannel<FlatSamples>| c.name == *"RY" || c.name == *"BY";
    let gray = channel("Y").filter(|_| !part.channel_data.list.iter().any(colored))?;
    Some(([gray; 3], Kind::Gray))
}

fn name(part: &Part) -> Option<String> {
    let name = part.attributes.layer_name.as_ref()?;
    Some(format!("\"{name}\""))
}

fn listed(parts: &[Part]) -> String {
    let mut names: Vec<String> = Vec::new();
    for part in parts {
        let of = name(part).filter(|_| parts.len() > 1);
        for channel in &part.channel_data.list {
            let sampled = match channel.sampling {
                Vec2(1, 1) => "",
                _ => " (subsampled)",
            };
            let of = of.as_ref().map_or(String::new(), |n| format!("{n}: "));
            names.push(format!("{of}{}{sampled}", channel.name));
        }
    }
    let more = names.len().saturating_sub(MAX_LISTED);
    names.truncate(MAX_LISTED);
    if more > 0 {
        names.push(format!("and {more} more"));
    }
    names.join(", ")
}

/// The pixels of the display window, and whether there are others.
fn windowed(
    part: &Part,
    colors: [&AnyChannel<FlatSamples>; 3],
    window: IntegerBounds,
) -> (Vec<[f32; 3]>, bool) {
    let (width, height) = (window.size.0, window.size.1);
    let offset = |at: i32, origin: i32| i64::from(at) - i64::from(origin);
    let at = part.attributes.layer_position;
    let x0 = offset(at.0, window.position.0);
    let y0 = offset(at.1, window.position.1);
    let mut values = vec![[0.0; 3]; width * height];
    let inside = |start: i64, i: usize, size: usize| {
        let place = usize::try_from(start + i as i64).ok()?;
        (place < size).then_some(place)
    };
    let mut outside = false;
    let channels = colors.map(|c| &c.sample_data);
    for y in 0..part.size.1 {
        let row = inside(y0, y, height);
        for x in 0..part.size.0 {
            match (row, inside(x0, x, width)) {
                (Some(row), Some(column)) => {
                    let i = y * part.size.0 + x;
                    values[row * width + column] =
                        channels.map(|c| c.value_by_flat_index(i).to_f32());
                }
                _ => outside = true,
            }
        }
    }
    (values, outside)
}

fn map_of(c: &Chromaticities) -> Result<Option<DMat3>, String> {
    let pair = |v: Vec2<f32>| [f64::from(v.0), f64::from(v.1)];
    Primaries {
        red: pair(c.red),
        green: pair(c.green),
        blue: pair(c.blue),
        white: pair(c.white),
    }
    .to_linear_srgb()
}
