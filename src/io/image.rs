//! Images of a render, with what they say of how they were made: XYZ, and spectra.
//!
//! An XYZ image is made from the film and a part header alone, so that merged parts and whole
//! renders give the same bytes.

use super::exr::{
    Channel, ExrError, ExrImage, ImageMetadata, MetadataValue, noise_channel, read as read_exr,
    spectral_channel_name, xyz_channels,
};
use super::identity::{self, Quantity};
use super::part::{self, Part, PartError, PartHeader, SpectralFilm};
use crate::camera::Resolution;
use crate::camera::far_field::FarField;
use crate::develop::Development;
use crate::film::{AddSumsError, Film, Filter};
use crate::render::flux::{SpectralFlux, Y};
use crate::render::{PixelMeasure, Render, Total};
use crate::spectrum::SpectralChannels;
use glam::DVec2;
use std::path::{Path, PathBuf};

/// The XYZ image of a render.
#[must_use]
pub fn of(render: &Render) -> ExrImage {
    xyz_image(&render.outputs().image, &identity::header(render))
}

/// The XYZ image of a part that holds one film.
///
/// # Errors
/// Where the sums do not fit the header.
pub fn of_part(part: &Part) -> Result<ExrImage, AddSumsError> {
    Ok(xyz_image(&film_of_part(part)?, &part.header))
}

/// The film of the image of a part that holds one sensor.
///
/// # Errors
/// Where the sums do not fit the header.
pub fn film_of_part(part: &Part) -> Result<Film, AddSumsError> {
    let header = &part.header;
    let (image, _) = split_sums(header, &part.sums);
    film_of_sums(header, header.channels as usize, image)
}

/// The sums of the image of a sensor, and those of its spectral film.
fn split_sums<'s>(header: &PartHeader, sums: &'s [i128]) -> (&'s [i128], &'s [i128]) {
    let count = header.image_sum_count().unwrap_or(0) as usize;
    sums.split_at(count.min(sums.len()))
}

fn film_of_sums(header: &PartHeader, channels: usize, sums: &[i128]) -> Result<Film, AddSumsError> {
    // nothing is splatted any more: the filter does not matter
    let film = Film::new(header.crop(), Filter::Box, channels);
    let film = film.with_exponent(header.exponent);
    let mut film = film.with_block_sums(header.blocks);
    film.add_sums(sums)?;
    Ok(film)
}

/// The films of the images of a part, in its order.
///
/// # Errors
/// Where the sums do not fit the header.
pub fn films_of_part(part: &Part) -> Result<Vec<Film>, AddSumsError> {
    let mut sums = &part.sums[..];
    let film = |header: PartHeader| {
        let count = header.sum_count().unwrap_or(0) as usize;
        let (own, rest) = sums.split_at(count.min(sums.len()));
        sums = rest;
        let (image, _) = split_sums(&header, own);
        film_of_sums(&header, header.channels as usize, image)
    };
    part.header.each().into_iter().map(film).collect()
}

/// Reads an image, or makes that of a part.
///
/// # Errors
/// Where the file cannot be read, or is a part without a whole pass.
pub fn read(path: &Path) -> Result<ExrImage, ReadError> {
    if !part::is_part(path)? {
        return Ok(read_exr(path)?);
    }
    let part = part::read(path)?;
    if part.header.pass_count() == 0 {
        return Err(ReadError::NoPass(path.to_owned()));
    }
    if !part.header.companions.is_empty() {
        return Err(ReadError::Several(path.to_owned()));
    }
    Ok(of_part(&part)?)
}

/// Why there is no image in a file.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// An image that cannot be read.
    #[error(transparent)]
    Exr(#[from] ExrError),
    /// A part that cannot be read.
    #[error(transparent)]
    Part(#[from] PartError),
    /// A part whose sums do not fit its header.
    #[error(transparent)]
    Sums(#[from] AddSumsError),
    /// A part without a whole pass.
    #[error("{}: no pass of it is whole: there is no picture (render goes on with --resume)", .0.display())]
    NoPass(PathBuf),
    /// A part with several films.
    #[error("{}: holds several detectors: make their images by abbe merge", .0.display())]
    Several(PathBuf),
}

/// The development of an image by the kind of its sensor.
#[must_use]
pub fn development(image: &ExrImage) -> Development {
    let is_film = image.metadata.get(identity::FILM).is_some();
    match image.metadata.get(identity::SENSOR_KIND) {
        Some(MetadataValue::Text(kind)) if kind == identity::DETECTOR && !is_film => {
            Development::MEASUREMENT
        }
        _ => Development::PHOTOGRAPH,
    }
}

fn xyz_image(film: &Film, header: &PartHeader) -> ExrImage {
    let mut metadata = metadata(header);
    metadata.entries.extend(flux(film, header));
    ExrImage {
        width: header.width,
        height: header.height,
        crop: header.crop(),
        channels: xyz_channels(&film.image(header.pass_count())),
        metadata,
    }
}

/// Area or solid angle of the pixels of a detector; `None` for cameras.
fn measure(header: &PartHeader) -> Option<PixelMeasure> {
    let attribute = |name: &str| header.image.get(name);
    let PartHeader { width, height, .. } = *header;
    let resolution = Resolution { width, height };
    let [x0, y0, x1, y1] = header.crop;
    if let Some(text) = attribute(identity::PIXEL_ANGLE) {
        let pixel = DVec2::from_array(identity::angle_of_text(text)?).map(f64::to_radians);
        let size = DVec2::new(f64::from(width), f64::from(height));
        let field = FarField {
            half_rad: 0.5 * pixel * size,
        };
        let pixels = field.pixels(resolution, x0..x1, y0..y1);
        return Some(PixelMeasure::Each(pixels));
    }
    let pitch = attribute(identity::PIXEL_PITCH)?;
    let [along_u, along_v] = identity::pitch_of_text(pitch)?;
    let Some(radius) = attribute(identity::RADIUS) else {
        return Some(PixelMeasure::Uniform(along_u * along_v));
    };
    let curved = identity::curved_of_texts(radius, pitch, [width, height])?;
    let all = curved.stretches(resolution, x0..x1, y0..y1);
    let areas = all.into_iter().map(|s| s * along_u * along_v);
    Some(PixelMeasure::Each(areas.collect()))
}

/// Numbers of even and of odd passes.
fn halves(header: &PartHeader) -> [u64; 2] {
    let even = |end: u64| end.div_ceil(2);
    let passes = header.passes.iter();
    let even: u64 = passes.map(|p| even(p.end) - even(p.start)).sum();
    [even, header.pass_count() - even]
}

/// Attribute with the luminous flux through the film of a detector.
fn flux(film: &Film, header: &PartHeader) -> Option<(String, MetadataValue)> {
    let pixels = measure(header)?;
    let response = identity::response_of_unit(header.image.get(identity::UNIT)?);
    let scale = response.photometric_unit();
    let total = Total::of(film, Y, &pixels, scale, halves(header));
    Some(flux_entry("", &total, "lm"))
}

/// Attribute with a flux, of all light (`of` empty) or of what it is named after.
pub(super) fn flux_entry(of: &str, total: &Total, unit: &str) -> (String, MetadataValue) {
    let name = match of {
        "" => "flux".to_owned(),
        of => format!("flux:{of}"),
    };
    let error = total.error.map_or_else(String::new, |error| {
        format!(", standard error {error:.3e} {unit}")
    });
    let text = format!("{:e} {unit}{error}", total.value);
    (name, MetadataValue::Text(text))
}

/// Attributes of an image.
fn metadata(header: &PartHeader) -> ImageMetadata {
    let text = |name: &str, value: String| (name.to_owned(), MetadataValue::Text(value));
    let one_seed = header
        .passes
        .iter()
        .all(|p| p.seed == header.passes[0].seed);
    let ranges = header.passes.iter().map(|p| {
        let seed = if one_seed {
            String::new()
        } else {
            format!("{}:", p.seed)
        };
        format!("{seed}{}..{}", p.start, p.end)
    });
    let mut seeds: Vec<String> = header.passes.iter().map(|p| p.seed.to_string()).collect();
    seeds.dedup();
    let mut entries = vec![
        text("abbeVersion", header.version.clone()),
        text("sceneHash", format!("{:016x}", header.scene_hash)),
        text("sensor", header.sensor.clone()),
        text("passes", ranges.collect::<Vec<_>>().join(",")),
        text("seed", seeds.join(",")),
    ];
    entries.extend(
        header
            .image
            .iter()
            .map(|(name, value)| text(name, value.clone())),
    );
    ImageMetadata { entries }
}

/// The spectral image; `None` where none was kept. Bins hold the mean per nanometer, lines (layer
/// `line`) their power. `with_noise` adds that of each line, and of the rest as the irradiance
/// (radiance) of all bins.
#[must_use]
pub fn spectral_of(render: &Render, with_noise: bool) -> Option<ExrImage> {
    let (spectral, film) = render.outputs().spectral.as_ref()?;
    let header = identity::header(render);
    Some(spectral_image(spectral, film, &header, with_noise))
}

/// The spectral image of a part that holds one sensor; `None` where it has no spectral film.
///
/// # Errors
/// Where the sums do not fit the header.
pub fn spectral_of_part(part: &Part, with_noise: bool) -> Result<Option<ExrImage>, AddSumsError> {
    let header = &part.header;
    let spectral = header.spectral.as_ref().and_then(SpectralFilm::channels);
    let Some(spectral) = spectral else {
        return Ok(None);
    };
    let (_, sums) = split_sums(header, &part.sums);
    let film = film_of_sums(header, spectral.count(), sums)?;
    Ok(Some(spectral_image(&spectral, &film, header, with_noise)))
}

fn spectral_image(
    spectral: &SpectralChannels,
    film: &Film,
    header: &PartHeader,
    with_noise: bool,
) -> ExrImage {
    let bins = spectral.bin_centers_nm().map(spectral_channel_name);
    let lines = spectral
        .lines_nm()
        .iter()
        .map(|nm| format!("line.{}", spectral_channel_name(*nm)));
    let values = film.image(header.pass_count());
    let count = film.channels();
    let channels = bins.chain(lines).enumerate().map(|(c, name)| {
        let values = values.iter().skip(c).step_by(count);
        Channel {
            name,
            values: values.map(|&v| v as f32).collect(),
        }
    });
    let mut channels: Vec<Channel> = channels.collect();
    let halves = halves(header);
    if with_noise {
        channels.extend(spectral_noise(spectral, film, halves));
    }
    let mut metadata = metadata(header);
    let units = Quantity::of_attributes(&header.image).spectral_unit();
    // readers know a spectral image by these two; per nanometer is understood
    for (name, value) in [("spectralLayoutVersion", "1.0"), ("emissiveUnits", units)] {
        let value = MetadataValue::Text(value.to_owned());
        metadata.entries.push((name.to_owned(), value));
    }
    if let Some(pixels) = measure(header) {
        let flux = SpectralFlux::new(spectral, film, &pixels, halves);
        let lines = flux.lines_w.iter();
        let lines = lines.map(|(nm, watts)| flux_entry(&format!("{nm}nm"), watts, "W"));
        metadata.entries.extend(lines);
        let rest = flux.continuum_w.iter();
        let rest = rest.map(|watts| flux_entry("continuum", watts, "W"));
        metadata.entries.extend(rest);
    }
    // the one unit that the response has, whatever that of the XYZ image
    metadata.entries.retain(|(name, _)| name != "unit");
    ExrImage {
        width: header.width,
        height: header.height,
        crop: header.crop(),
        channels,
        metadata,
    }
}

/// Noise of the lines of a spectral image, and of the sum over its bins.
fn spectral_noise(spectral: &SpectralChannels, film: &Film, [even, odd]: [u64; 2]) -> Vec<Channel> {
    let lines = spectral.lines_nm();
    let bins = spectral.count() - lines.len();
    let pixels = film.crop().pixels() as usize;
    let noise = |channel| {
        let noise = film.noise(channel, even, odd);
        noise.unwrap_or_else(|| vec![f64::INFINITY; pixels])
    };
    let channel = |name: &str, noise: Vec<f64>| Channel {
        name: noise_channel(name),
        values: noise.into_iter().map(|v| v as f32).collect(),
    };
    let of_line = |(i, &nm): (usize, &f64)| {
        let name = format!("line.{}", spectral_channel_name(nm));
        channel(&name, noise(bins + i))
    };
    let mut channels: Vec<Channel> = lines.iter().enumerate().map(of_line).collect();
    if bins > 0 {
        let mut sum = vec![0.0; pixels];
        for bin in 0..bins {
            let more = noise(bin).into_iter();
            sum.iter_mut()
                .zip(more)
                .for_each(|(sum, more)| *sum += more);
        }
        let width = spectral.bin_width_nm();
        sum.iter_mut().for_each(|v| *v *= width);
        channels.push(channel("continuum", sum));
    }
    channels
}
