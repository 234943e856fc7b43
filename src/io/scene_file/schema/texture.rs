//! Images on surfaces: `{ texture = ... }` wherever a spectrum or number of a material may stand.

use super::{At, NameOr};
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, Error, MapAccess, SeqAccess, Visitor};
use std::fmt;

/// An image file, or a table that says how it lies on the surface.
pub type TextureSource = NameOr<Texture>;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Texture {
    pub file: At<String>,
    pub filter: Option<TextureFilter>,
    pub level: Option<At<f64>>,
    pub wrap: Option<TextureWrap>,
    pub scale: Option<At<[f64; 2]>>,
    pub rotate_deg: Option<At<f64>>,
    pub offset: Option<At<[f64; 2]>>,
    pub encoding: Option<Encoding>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TextureFilter {
    Nearest,
    Bilinear,
    Mipmap,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TextureWrap {
    Repeat,
    Mirror,
    Clamp,
}

/// How the bytes of a PNG or JPEG encode light.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    Srgb,
    Linear,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChannelName {
    #[default]
    R,
    G,
    B,
    A,
}

/// A number that may come from an image.
#[derive(Debug)]
pub enum Scalar {
    Number(f64),
    Pair([f64; 2]),
    Image(std::boxed::Box<ScalarImage>),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScalarImage {
    pub texture: At<TextureSource>,
    pub channel: Option<ChannelName>,
    pub factor: Option<At<f64>>,
}

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AnyForm;
        impl<'de> Visitor<'de> for AnyForm {
            type Value = Scalar;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, [x, y] or a table with a texture")
            }
            fn visit_f64<E>(self, value: f64) -> Result<Scalar, E> {
                Ok(Scalar::Number(value))
            }
            fn visit_i64<E>(self, value: i64) -> Result<Scalar, E> {
                Ok(Scalar::Number(value as f64))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Scalar, A::Error> {
                let list = Vec::<f64>::deserialize(SeqAccessDeserializer::new(seq))?;
                let length = list.len();
                let pair = <[f64; 2]>::try_from(list);
                pair.map(Scalar::Pair)
                    .map_err(|_| Error::invalid_length(length, &self))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Scalar, A::Error> {
                let image = ScalarImage::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Scalar::Image(std::boxed::Box::new(image)))
            }
        }
        deserializer.deserialize_any(AnyForm)
    }
}
