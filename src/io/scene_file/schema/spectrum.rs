//! A spectrum, wherever one may stand: `0.5`, `[r, g, b]`, `"D65"`, or a table.

use super::At;
use super::texture::TextureSource;
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use std::fmt;

/// A spectrum as written.
#[derive(Debug)]
pub enum Spectrum {
    /// The same value at every wavelength.
    Number(f64),
    /// Linear sRGB.
    Rgb([f64; 3]),
    /// A name of `[spectrum.NAME]` or of the library.
    Name(String),
    /// All else.
    Table(std::boxed::Box<SpectrumTable>),
}

/// One source of a spectrum (exactly one of the first seven keys) and its scale.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpectrumTable {
    pub value: Option<At<f64>>,
    pub rgb: Option<At<[f64; 3]>>,
    pub name: Option<At<String>>,
    pub file: Option<At<String>>,
    pub blackbody_k: Option<At<f64>>,
    pub lines: Option<At<Vec<[f64; 2]>>>,
    pub texture: Option<At<TextureSource>>,
    pub scale: Option<At<f64>>,
    pub luminance: Option<At<f64>>,
}

impl<'de> Deserialize<'de> for Spectrum {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AnyForm;
        impl<'de> Visitor<'de> for AnyForm {
            type Value = Spectrum;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a spectrum: a number, [r, g, b], a name or a table")
            }
            fn visit_f64<E>(self, value: f64) -> Result<Spectrum, E> {
                Ok(Spectrum::Number(value))
            }
            fn visit_i64<E>(self, value: i64) -> Result<Spectrum, E> {
                Ok(Spectrum::Number(value as f64))
            }
            fn visit_str<E>(self, name: &str) -> Result<Spectrum, E> {
                Ok(Spectrum::Name(name.to_owned()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Spectrum, A::Error> {
                <[f64; 3]>::deserialize(SeqAccessDeserializer::new(seq)).map(Spectrum::Rgb)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Spectrum, A::Error> {
                let table = SpectrumTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Spectrum::Table(std::boxed::Box::new(table)))
            }
        }
        deserializer.deserialize_any(AnyForm)
    }
}
