//! The keys of a scene file, as serde reads them: names unresolved, numbers unchecked, every value with its place.
//!
//! No flattened, internally tagged or untagged tables: serde buffers those and loses the place of an error.

mod motion;
mod object;
mod optics;
mod render;
mod sensor;
mod spectrum;
mod texture;
mod transform;

pub use motion::{InterpolationName, Motion, MotionKey};
pub use object::{Environment, Light, Mesh, Model, Object, Quad};
pub use optics::{
    Absorption, Coated, Conductor, Dielectric, Diffuse, Lobe, Material, Medium, Mirror, Thin,
};
pub use render::{
    Epsilon, FilterName, HeuristicName, IntegratorName, LengthUnit, OutputUnits, RegularizeName,
    Render, SharingName, SingleRuleName, WavelengthName, WavelengthTable, Wavelengths,
};
pub use sensor::{Detector, Orthographic, Perspective, Sensor};
pub use spectrum::{Spectrum, SpectrumTable};
pub use texture::{ChannelName, Encoding, Scalar, TextureFilter, TextureSource, TextureWrap};
pub use transform::{Scale, TransformStep};

use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, MapAccess, Visitor};
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

/// A value with its place.
pub type At<T> = toml::Spanned<T>;
/// Definitions by name.
pub type Named<T> = BTreeMap<At<String>, T>;

/// A whole scene file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    pub unit: Option<LengthUnit>,
    pub ambient: Option<At<String>>,
    #[serde(default)]
    pub render: Render,
    #[serde(default)]
    pub sensor: Vec<At<Sensor>>,
    #[serde(default)]
    pub spectrum: Named<At<Spectrum>>,
    #[serde(default)]
    pub medium: Named<At<Medium>>,
    #[serde(default)]
    pub material: Named<At<Material>>,
    #[serde(default)]
    pub mesh: Named<Mesh>,
    #[serde(default)]
    pub model: Vec<At<Model>>,
    #[serde(default)]
    pub object: Vec<At<Object>>,
    #[serde(default)]
    pub light: Vec<At<Light>>,
}

/// A name, or a table that says it all.
#[derive(Debug)]
pub enum NameOr<T> {
    Name(String),
    Table(T),
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for NameOr<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrTable<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for NameOrTable<T> {
            type Value = NameOr<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a name or a table")
            }
            fn visit_str<E>(self, name: &str) -> Result<Self::Value, E> {
                Ok(NameOr::Name(name.to_owned()))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(NameOr::Table)
            }
        }
        deserializer.deserialize_any(NameOrTable(PhantomData))
    }
}
