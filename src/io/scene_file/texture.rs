//! Images on surfaces: files, how they lie on the surface, and numbers from images.

use super::document::Node;
use super::keys::{Form, Keys, NON_NEGATIVE, Spec, Table, UNIT_INTERVAL, Value, keys};
use super::reader::Reader;
use super::value::{At, FileName, number};
use crate::io::image_file::{self, MAX_IMAGE_BYTES, decode};
use crate::math::named::named;
use crate::texture::{Filter, Image, ImageTexture, ScalarTexture, Wrap};
use glam::{DAffine2, DVec2};
use std::ops::Range as Span;
use std::sync::Arc;
use toml::de::DeValue;

named! {
    /// How texels are read.
    pub enum TextureFilter {
        Nearest = "nearest": "The nearest texel",
        Bilinear = "bilinear": "Between the four nearest",
        Mipmap = "mipmap": "Means of 2^level x 2^level texels, linear in between",
    }
}

named! {
    /// Rule for what lies beyond the borders.
    pub enum TextureWrap {
        Repeat = "repeat": "The image again",
        Mirror = "mirror": "The image mirrored",
        Clamp = "clamp": "The border",
    }
}

named! {
    /// How the bytes of a PNG or JPEG encode light. OpenEXR and Radiance HDR are linear.
    pub enum Encoding {
        Srgb = "srgb": "As the file says, as sRGB does where it says nothing",
        Linear = "linear": "In proportion",
    }
}

named! {
    /// A channel of an image.
    pub enum Channel {
        Red = "r": "Red",
        Green = "g": "Green",
        Blue = "b": "Blue",
        Alpha = "a": "Alpha",
    }
}

keys! {
    /// How an image lies on a surface: its coordinates are scaled, turned and moved in this order.
    TextureKeys = "texture" {
        /// PNG, JPEG, OpenEXR or Radiance HDR, at most 2^28 texels and 1 GB.
        file: At<FileName>;
        /// How texels are read.
        filter: TextureFilter, default TextureFilter::Bilinear;
        /// Level of the mipmap, with `filter = "mipmap"`.
        level: Option<f64>, in NON_NEGATIVE, or "0";
        /// Rule for what lies beyond the borders.
        wrap: TextureWrap, default TextureWrap::Repeat;
        /// Factors on the coordinates, not 0.
        scale: [f64; 2], default [1.0; 2];
        /// Turns the coordinates.
        rotate_deg: f64, unit "degrees", default 0.0;
        /// Moves the coordinates.
        offset: [f64; 2], default [0.0; 2];
        /// How bytes encode light.
        encoding: Option<Encoding>, or "`\"srgb\"`; of numbers and normals `\"linear\"`";
    }
}

/// An image on a surface; `SRGB`: what its bytes are taken for unless the file says otherwise.
#[derive(Clone, Debug)]
pub struct Texture<const SRGB: bool> {
    /// `None` where it cannot be had, which has been reported.
    pub texture: Option<ImageTexture>,
    /// File of the image, and where it is named.
    pub file: At<FileName>,
}

impl<const SRGB: bool> Value for Texture<SRGB> {
    fn form() -> Form {
        Form::Any(vec![FileName::form(), Form::Table(TextureKeys::KIND)])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        match node.get_ref() {
            DeValue::String(_) => {
                let name = At::<FileName>::read(node, spec, cx)?;
                let image = image(&name, SRGB, false, cx);
                let texture = image.map(|image| ImageTexture {
                    image,
                    map: DAffine2::IDENTITY,
                    wrap: [Wrap::Repeat; 2],
                    filter: Filter::Bilinear,
                });
                Some(Self {
                    texture,
                    file: name,
                })
            }
            DeValue::Table(_) => {
                let table = Table::of(node, TextureKeys::NAMES, cx)?;
                let keys = TextureKeys::from_table(&table, cx)?;
                Some(Self {
                    texture: texture(&keys, &table, SRGB, cx),
                    file: keys.file,
                })
            }
            _ => {
                cx.wrong_type(node, "a name or a table");
                None
            }
        }
    }
}

impl<const SRGB: bool> Texture<SRGB> {
    /// Holds the texels that stand for a key to its limit of 1, after a factor.
    pub fn hold(&self, factor: f64, channels: Span<usize>, cx: &mut Reader<'_>) {
        // a rounding above 1 is no fault of the file
        let limit = (1.0 + 1e-6) / factor.max(f64::MIN_POSITIVE);
        let image = self.texture.as_ref().map(|texture| &texture.image);
        let Some((count, [column, row])) = image.and_then(|i| i.above(limit as f32, channels))
        else {
            return;
        };
        let texels = if count == 1 { "texel is" } else { "texels are" };
        let message = format!(
            "{count} {texels} above 1 after the factor {factor} (allowed: 0 to 1), the first at \
             column {column}, row {row}"
        );
        cx.bad_file(&self.file, message);
    }
}

fn texture(
    keys: &TextureKeys,
    table: &Table<'_>,
    srgb: bool,
    cx: &mut Reader<'_>,
) -> Option<ImageTexture> {
    let srgb = keys.encoding.map_or(srgb, |e| e == Encoding::Srgb);
    let filter = match keys.filter {
        TextureFilter::Nearest => Filter::Nearest,
        TextureFilter::Bilinear => Filter::Bilinear,
        TextureFilter::Mipmap => Filter::Mipmap {
            level: keys.level.unwrap_or(0.0),
        },
    };
    let pyramid = matches!(filter, Filter::Mipmap { .. });
    if keys.level.is_some() && !pyramid {
        cx.conflict(
            &table.span("level"),
            "level is for filter = \"mipmap\" only",
        );
    }
    let [scale, offset] = [keys.scale, keys.offset].map(DVec2::from);
    if scale.x == 0.0 || scale.y == 0.0 {
        let message = "the scale of a texture is 0 (allowed: any other number)";
        cx.conflict(&table.span("scale"), message);
    }
    let wrap = match keys.wrap {
        TextureWrap::Repeat => Wrap::Repeat,
        TextureWrap::Mirror => Wrap::Mirror,
        TextureWrap::Clamp => Wrap::Clamp,
    };
    Some(ImageTexture {
        image: image(&keys.file, srgb, pyramid, cx)?,
        map: DAffine2::from_scale_angle_translation(scale, keys.rotate_deg.to_radians(), offset),
        wrap: [wrap; 2],
        filter,
    })
}

/// The image of a file, decoded once for each encoding.
pub fn image(
    name: &At<FileName>,
    srgb: bool,
    pyramid: bool,
    cx: &mut Reader<'_>,
) -> Option<Arc<Image>> {
    let path = cx.find(name, MAX_IMAGE_BYTES)?;
    let key = (path.clone(), srgb, pyramid);
    if let Some(image) = cx.images.get(&key).cloned() {
        cx.named_again(&path);
        return image;
    }
    let encoding = if srgb {
        image_file::Encoding::Stated
    } else {
        image_file::Encoding::Linear
    };
    let bytes = cx.bytes(name, &path);
    let image = bytes.and_then(|bytes| match decode(&bytes, encoding) {
        Ok(decoded) => {
            cx.file_notes(name, decoded.notes);
            let image = decoded.image;
            Some(Arc::new(if pyramid { image.with_pyramid() } else { image }))
        }
        Err(message) => {
            cx.bad_file(name, message);
            None
        }
    });
    cx.images.insert(key, image.clone());
    image
}

keys! {
    /// A number from an image: a channel times a factor.
    ScalarKeys = "number from an image" {
        /// The image.
        texture: Texture<false>;
        /// The channel.
        channel: Channel, default Channel::Red;
        /// Factor on the values.
        factor: f64, in UNIT_INTERVAL, default 1.0;
    }
}

/// A number of a material, which may come from an image.
#[derive(Clone, Debug)]
pub struct Scalar {
    /// The number.
    pub value: ScalarTexture,
    /// The largest that it can be.
    pub largest: f64,
    /// Where an image is named.
    pub image_at: Option<Span<usize>>,
}

impl Scalar {
    fn constant(value: f64) -> Self {
        Self {
            value: value.into(),
            largest: value,
            image_at: None,
        }
    }

    fn from_image(node: Node<'_>, cx: &mut Reader<'_>) -> Option<Self> {
        let table = Table::of(node, ScalarKeys::NAMES, cx)?;
        let keys = ScalarKeys::from_table(&table, cx)?;
        let channel = match keys.channel {
            Channel::Red => 0,
            Channel::Green => 1,
            Channel::Blue => 2,
            Channel::Alpha => 3,
        };
        keys.texture.hold(keys.factor, channel..channel + 1, cx);
        let texture = keys.texture.texture?;
        Some(Self {
            value: ScalarTexture::Image { texture, channel }.times(keys.factor),
            largest: keys.factor,
            image_at: Some(keys.texture.file.at),
        })
    }
}

impl Value for Scalar {
    fn form() -> Form {
        Form::Any(vec![f64::form(), Form::Table(ScalarKeys::KIND)])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        if node.get_ref().is_table() {
            return Self::from_image(node, cx);
        }
        number(node, spec, "a number or a table with a texture", cx).map(Self::constant)
    }
}

/// A number along each of two axes.
#[derive(Clone, Debug)]
pub struct Scalars(pub [Scalar; 2]);

impl Default for Scalars {
    fn default() -> Self {
        Self([Scalar::constant(0.0), Scalar::constant(0.0)])
    }
}

impl Value for Scalars {
    fn form() -> Form {
        let image = Form::Table(ScalarKeys::KIND);
        Form::Any(vec![f64::form(), <[f64; 2]>::form(), image])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        const EXPECTED: &str = "a number, [x, y] or a table with a texture";
        match node.get_ref() {
            DeValue::Table(_) => Scalar::from_image(node, cx).map(|s| Self([s.clone(), s])),
            DeValue::Array(items) if items.len() != 2 => {
                cx.wrong_length(node, items.len(), EXPECTED);
                None
            }
            DeValue::Array(_) => {
                <[f64; 2]>::read(node, spec, cx).map(|pair| Self(pair.map(Scalar::constant)))
            }
            _ => {
                let value = number(node, spec, EXPECTED, cx)?;
                Some(Self([Scalar::constant(value), Scalar::constant(value)]))
            }
        }
    }

    fn show(&self) -> String {
        self.0[0].largest.to_string()
    }
}
