//! OpenEXR images of XYZ values and of spectra (design of the channels: Fichet, Pacanowski, Wilkie,
//! "An OpenEXR Layout for Spectral Images", JCGT 2021).
//!
//! Channels are 32-bit floats in ZIP-compressed scan lines, lossless. The chromaticities (1,0),
//! (0,1), (0,0) with white (1/3,1/3) say that the numbers are XYZ.

use super::atomic::{FileError, write_atomic};
use super::exr_blocks;
use super::exr_header::sort_attributes;
use super::files::read_regular;
use super::identity::PIXEL_ASPECT;
use crate::film::Crop;
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, ReadChannels, ReadLayers, Text, Vec2, WritableImage,
};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Largest file that is read.
pub const MAX_EXR_BYTES: u64 = 8 << 30;
/// Most samples (pixels × channels) of an image that is read.
pub const MAX_SAMPLES: u64 = 1 << 30;

/// A value of the image's metadata.
#[derive(Clone, Debug, PartialEq)]
pub enum MetadataValue {
    /// Text.
    Text(String),
    /// A whole number; beyond 32 bits it is written as text.
    Integer(i64),
    /// A real number.
    Real(f64),
    /// Two real numbers, kept in single precision.
    Pair([f32; 2]),
}

/// Attributes of the image, in the order given (readers sort by name).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImageMetadata {
    /// (name, value).
    pub entries: Vec<(String, MetadataValue)>,
}

impl ImageMetadata {
    /// The value of an entry.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&MetadataValue> {
        self.entries.iter().find(|e| e.0 == name).map(|e| &e.1)
    }
}

/// One channel: its name and a value per pixel of the crop, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name, `layer.name` for one of a layer.
    pub name: String,
    /// Values.
    pub values: Vec<f32>,
}

/// An image: the pixels of `crop` of a film of `width` × `height`.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrImage {
    /// Columns of the whole film.
    pub width: u32,
    /// Rows of the whole film.
    pub height: u32,
    /// The pixels that are there.
    pub crop: Crop,
    /// Channels.
    pub channels: Vec<Channel>,
    /// Metadata.
    pub metadata: ImageMetadata,
}

/// The channels of a color image.
const XYZ: [&str; 3] = ["X", "Y", "Z"];

impl ExrImage {
    /// The values of a channel.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        let channel = self.channels.iter().find(|c| c.name == name)?;
        Some(&channel.values)
    }

    /// The interleaved values of X, Y and Z, if all are there.
    #[must_use]
    pub fn xyz(&self) -> Option<Vec<f64>> {
        self.interleaved(XYZ.map(|name| self.channel(name)))
    }

    /// The interleaved X, Y and Z of a layer; of one with a single channel three times its values.
    #[must_use]
    pub fn layer_xyz(&self, layer: &str) -> Option<Vec<f64>> {
        let channels = XYZ.map(|name| self.channel(&format!("{layer}.{name}")));
        let single = channels.iter().flatten().next().copied();
        match channels.iter().flatten().count() {
            1 => self.interleaved([single; 3]),
            _ => self.interleaved(channels),
        }
    }

    fn interleaved(&self, channels: [Option<&[f32]>; 3]) -> Option<Vec<f64>> {
        let mut xyz = vec![0.0; 3 * self.crop.pixels() as usize];
        for (c, channel) in channels.into_iter().enumerate() {
            for (pixel, value) in channel?.iter().enumerate() {
                xyz[3 * pixel + c] = f64::from(*value);
            }
        }
        Some(xyz)
    }
}

/// Why an image could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ExrError {
    /// The file system.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not an OpenEXR file, or a broken one.
    #[error("{}: not a readable OpenEXR image ({message})", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Message of the decoder.
        message: String,
    },
    /// An image that cannot be encoded.
    #[error("{}: cannot be encoded as OpenEXR ({message})", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// Message of the encoder.
        message: String,
    },
    /// More than is read.
    #[error("{}: {what} is {size} (allowed: at most {limit})", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Quantity that is too large.
        what: &'static str,
        /// How large it is.
        size: u64,
        /// The limit.
        limit: u64,
    },
    /// No channel of that name.
    #[error("{}: no channel \"{channel}\" (there: {there})", path.display())]
    NoChannel {
        /// The file.
        path: PathBuf,
        /// The channel.
        channel: String,
        /// The channels of the file.
        there: String,
    },
    /// A channel whose number of values is not the number of pixels.
    #[error("{}: channel \"{channel}\" has {found} values for {expected} pixels", path.display())]
    ChannelSize {
        /// The file.
        path: PathBuf,
        /// The channel.
        channel: String,
        /// Values.
        found: usize,
        /// Pixels.
        expected: u64,
    },
}

/// The channel name of a spectral image: `S0.` and the wavelength with a decimal comma.
#[must_use]
pub fn spectral_channel_name(lambda_nm: f64) -> String {
    format!("S0.{}nm", lambda_nm.to_string().replace('.', ","))
}

/// The wavelength in nm behind a name of [`spectral_channel_name`].
#[must_use]
pub fn spectral_channel_nm(name: &str) -> Option<f64> {
    name.strip_prefix("S0.")?
        .strip_suffix("nm")?
        .replace(',', ".")
        .parse()
        .ok()
}

/// Name of the channel with the noise of another one: one sample of its standard error in each
/// pixel, with a sign.
#[must_use]
pub fn noise_channel(name: &str) -> String {
    format!("noise.{name}")
}

/// The three channels of interleaved XYZ values.
#[must_use]
pub fn xyz_channels(xyz: &[f64]) -> Vec<Channel> {
    XYZ.iter()
        .enumerate()
        .map(|(c, n)| Channel {
            name: (*n).to_owned(),
            values: xyz.iter().skip(c).step_by(3).map(|v| *v as f32).collect(),
        })
        .collect()
}

/// Writes an image. A channel `name.x` stays in the one layer (viewers group by the dot).
///
/// # Errors
/// The file cannot be written, or a channel does not fit the crop. An older file of the name stays
/// in that case.
pub fn write(path: &Path, image: &ExrImage) -> Result<(), ExrError> {
    let bytes = encoded(path, image)?;
    write_atomic(path, |w| std::io::Write::write_all(w, &bytes))?;
    Ok(())
}

/// The bytes of an image's file; `path` names it in errors.
///
/// # Errors
/// A channel does not fit the crop.
pub fn encoded(path: &Path, image: &ExrImage) -> Result<Vec<u8>, ExrError> {
    let pixels = image.crop.pixels();
    for channel in &image.channels {
        if channel.values.len() as u64 != pixels {
            let (channel, found) = (channel.name.clone(), channel.values.len());
            return Err(ExrError::ChannelSize {
                path: path.to_owned(),
                channel,
                found,
                expected: pixels,
            });
        }
    }
    let mut attributes =
        LayerAttributes::default().with_position(Vec2(image.crop.x0 as i32, image.crop.y0 as i32));
    for (name, value) in &image.metadata.entries {
        if name != PIXEL_ASPECT {
            attributes.other.insert(utf8(name), to_attribute(value));
        }
    }
    let channels = image
        .channels
        .iter()
        .map(|c| AnyChannel::new(utf8(&c.name), FlatSamples::F32(c.values.clone())));
    let size = Vec2(
        (image.crop.x1 - image.crop.x0) as usize,
        (image.crop.y1 - image.crop.y0) as usize,
    );
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let layer = Layer::new(
        size,
        attributes,
        encoding,
        AnyChannels::sort(channels.collect()),
    );
    let mut file = Image::from_layer(layer);
    file.attributes.display_window =
        IntegerBounds::new((0, 0), (image.width as usize, image.height as usize));
    file.attributes.chromaticities = Some(Chromaticities {
        red: Vec2(1.0, 0.0),
        green: Vec2(0.0, 1.0),
        blue: Vec2(0.0, 0.0),
        white: Vec2(1.0 / 3.0, 1.0 / 3.0),
    });
    if let Some(aspect) = image.metadata.get(PIXEL_ASPECT).and_then(number) {
        file.attributes.pixel_aspect = aspect;
    }
    // encoded in memory: the encoder seeks, and an error of it must not leave a file
    let mut bytes = Cursor::new(Vec::new());
    file.write()
        .to_buffered(&mut bytes)
        .map_err(|e| ExrError::Encode {
            path: path.to_owned(),
            message: e.to_string(),
        })?;
    sort_attributes(bytes.get_mut());
    Ok(bytes.into_inner())
}

/// A value as a positive number, if it is one that OpenEXR allows for pixels.
fn number(value: &MetadataValue) -> Option<f32> {
    let number = match value {
        MetadataValue::Text(text) => text.parse().ok()?,
        MetadataValue::Real(number) => *number as f32,
        MetadataValue::Integer(_) | MetadataValue::Pair(_) => return None,
    };
    (1e-6..=1e6).contains(&number).then_some(number)
}

/// Reads all channels of the first layer that has samples, as 32-bit floats.
///
/// # Errors
/// The file cannot be read, is too large, or is not an OpenEXR image.
pub fn read(path: &Path) -> Result<ExrImage, ExrError> {
    let file_error = |e| ExrError::from(FileError::new(path, e));
    let bytes = read_regular(path, MAX_EXR_BYTES).map_err(file_error)?;
    decode(path, &bytes, MAX_SAMPLES)
}

/// Reads an image and gives its interleaved XYZ values beside it.
///
/// # Errors
/// As [`read`], or a channel of X, Y, Z is missing.
pub fn read_xyz(path: &Path) -> Result<(ExrImage, Vec<f64>), ExrError> {
    let image = read(path)?;
    let Some(xyz) = image.xyz() else {
        let there: Vec<&str> = image.channels.iter().map(|c| c.name.as_str()).collect();
        let missing = XYZ.iter().find(|name| !there.contains(name));
        return Err(ExrError::NoChannel {
            path: path.to_owned(),
            channel: missing.map_or_else(String::new, |name| (*name).to_owned()),
            there: there.join(", "),
        });
    };
    Ok((image, xyz))
}

/// Decodes a file of at most `max_samples` samples; `path` is for messages.
pub(super) fn decode(path: &Path, bytes: &[u8], max_samples: u64) -> Result<ExrImage, ExrError> {
    // sizes first: the decoder allocates what the header promises
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), true)
        .map_err(|e| format_error(path, &e))?;
    let samples = meta.headers.iter().map(|h| {
        let area = (h.layer_size.0 as u64).saturating_mul(h.layer_size.1 as u64);
        area.saturating_mul(h.channels.list.len() as u64)
    });
    let samples = samples.fold(0, u64::saturating_add);
    if samples > max_samples {
        let what = "the number of samples";
        return Err(ExrError::TooLarge {
            path: path.to_owned(),
            what,
            size: samples,
            limit: max_samples,
        });
    }
    exr_blocks::check(bytes).map_err(|e| format_error(path, &e))?;
    let file = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| format_error(path, &e))?;
    let layer = file.layer_data;
    let window = file.attributes.display_window;
    let bad = |message: &str| ExrError::Format {
        path: path.to_owned(),
        message: message.to_owned(),
    };
    // windows may start anywhere: pixels are counted from the corner of the display window
    let corner = |at: i32, origin: i32| u32::try_from(i64::from(at) - i64::from(origin));
    let position = layer.attributes.layer_position;
    let (Ok(x0), Ok(y0)) = (
        corner(position.0, window.position.0),
        corner(position.1, window.position.1),
    ) else {
        return Err(bad("the data window starts outside the display window"));
    };
    let end = |start: u32, length: usize| {
        u32::try_from(length)
            .ok()
            .and_then(|l| start.checked_add(l))
    };
    let (Some(x1), Some(y1)) = (end(x0, layer.size.0), end(y0, layer.size.1)) else {
        return Err(bad("the data window is out of range"));
    };
    let (Some(width), Some(height)) = (end(0, window.size.0), end(0, window.size.1)) else {
        return Err(bad("the display window is out of range"));
    };
    let mut entries: BTreeMap<String, MetadataValue> = BTreeMap::new();
    for (name, value) in file.attributes.other.iter().chain(&layer.attributes.other) {
        entries.extend(from_attribute(value).map(|v| (name.to_string(), v)));
    }
    let channels = layer.channel_data.list.iter();
    let channels = channels.map(|c| Channel {
        name: from_utf8(&c.name),
        values: c.sample_data.values_as_f32().collect(),
    });
    let image = ExrImage {
        width,
        height,
        crop: Crop { x0, y0, x1, y1 },
        channels: channels.collect(),
        metadata: ImageMetadata {
            entries: entries.into_iter().collect(),
        },
    };
    if image
        .channels
        .iter()
        .any(|c| c.values.len() as u64 != image.crop.pixels())
    {
        return Err(bad("subsampled channels are not supported"));
    }
    Ok(image)
}

fn format_error(path: &Path, error: &exr::error::Error) -> ExrError {
    ExrError::Format {
        path: path.to_owned(),
        message: error.to_string(),
    }
}

/// Text of OpenEXR is bytes, which are UTF-8 here; the crate takes them for Latin-1.
fn utf8(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

/// Text of a file, of Latin-1 where it is not UTF-8.
fn from_utf8(text: &Text) -> String {
    let utf8 = String::from_utf8(text.as_slice().to_vec());
    utf8.unwrap_or_else(|_| text.to_string())
}

fn to_attribute(value: &MetadataValue) -> AttributeValue {
    match value {
        MetadataValue::Text(text) => AttributeValue::Text(utf8(text)),
        MetadataValue::Integer(v) => match i32::try_from(*v) {
            Ok(small) => AttributeValue::I32(small),
            Err(_) => AttributeValue::Text(utf8(&v.to_string())),
        },
        MetadataValue::Real(v) => AttributeValue::F64(*v),
        MetadataValue::Pair(v) => AttributeValue::FloatVec2(Vec2(v[0], v[1])),
    }
}

fn from_attribute(value: &AttributeValue) -> Option<MetadataValue> {
    Some(match value {
        AttributeValue::Text(text) => MetadataValue::Text(from_utf8(text)),
        AttributeValue::I32(v) => MetadataValue::Integer(i64::from(*v)),
        AttributeValue::F32(v) => MetadataValue::Real(f64::from(*v)),
        AttributeValue::F64(v) => MetadataValue::Real(*v),
        AttributeValue::FloatVec2(v) => MetadataValue::Pair([v.0, v.1]),
        _ => return None,
    })
}

/// Decodes any bytes as an image: must not panic, nor allocate more than a few megabytes.
pub fn fuzz_exr(bytes: &[u8]) {
    _ = decode(Path::new("fuzz"), bytes, 1 << 20);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> ExrImage {
        let crop = Crop {
            x0: 2,
            y0: 1,
            x1: 7,
            y1: 4,
        };
        let xyz: Vec<f64> = (0..45).map(|i| f64::from(i) * 0.25 - 1.0).collect();
        let mut channels = xyz_channels(&xyz);
        channels.push(Channel {
            name: spectral_channel_name(587.5618),
            values: vec![1e-30; 15],
        });
        channels.push(Channel {
            name: "error.Y".to_owned(),
            values: vec![f32::MAX; 15],
        });
        channels.sort_by(|a, b| a.name.cmp(&b.name));
        let entries = vec![
            (
                "integrator".to_owned(),
                MetadataValue::Text("bdpt".to_owned()),
            ),
            ("passes".to_owned(), MetadataValue::Integer(64)),
            ("rangeNm".to_owned(), MetadataValue::Pair([360.0, 830.0])),
            ("scale".to_owned(), MetadataValue::Real(0.1)),
            (
                "sensor".to_owned(),
                MetadataValue::Text("\u{76f8}\u{673a}".to_owned()),
            ),
        ];
        ExrImage {
            width: 10,
            height: 8,
            crop,
            channels,
            metadata: ImageMetadata { entries },
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("a.exr");
        let image = sample();
        write(&path, &image).expect("writes");
        assert_eq!(read(&path).expect("reads"), image);
        let (_, xyz) = read_xyz(&path).expect("has XYZ");
        assert_eq!(xyz[3 * 4 + 1], f64::from(13) * 0.25 - 1.0);
        let meta = exr::meta::MetaData::read_from_file(&path, true).expect("valid");
        let white = meta.headers[0]
            .shared_attributes
            .chromaticities
            .expect("set");
        assert_eq!(
            (white.red, white.green, white.blue),
            (Vec2(1.0, 0.0), Vec2(0.0, 1.0), Vec2(0.0, 0.0))
        );
        assert_eq!(meta.headers[0].compression, Compression::ZIP16);
    }

    #[test]
    fn seeds_beyond_32_bits_survive_as_text() {
        let big = to_attribute(&MetadataValue::Integer(1 << 40));
        assert_eq!(
            from_attribute(&big),
            Some(MetadataValue::Text((1_u64 << 40).to_string()))
        );
    }

    #[test]
    fn spectral_names() {
        assert_eq!(spectral_channel_name(587.5618), "S0.587,5618nm");
        assert_eq!(spectral_channel_name(550.0), "S0.550nm");
        assert_eq!(spectral_channel_nm("S0.587,5618nm"), Some(587.5618));
        assert_eq!(spectral_channel_nm("Y"), None);
    }

    #[test]
    fn wrong_sizes_and_missing_channels_are_errors() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("a.exr");
        let mut image = sample();
        image.channels.retain(|c| c.name != "Y");
        write(&path, &image).expect("writes");
        assert!(
            matches!(read_xyz(&path), Err(ExrError::NoChannel { channel, .. }) if channel == "Y")
        );
        image.channels[0].values.pop();
        assert!(matches!(
            write(&path, &image),
            Err(ExrError::ChannelSize {
                found: 14,
                expected: 15,
                ..
            })
        ));
        let bytes = std::fs::read(&path).expect("still the old file");
        assert!(matches!(
            decode(&path, &bytes, 59),
            Err(ExrError::TooLarge { size: 60, .. })
        ));
        assert!(matches!(
            decode(&path, &bytes[..bytes.len() / 2], MAX_SAMPLES),
            Err(ExrError::Format { .. })
        ));
    }
}
