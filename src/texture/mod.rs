//! Textures: numbers and spectra that vary over a surface.
//!
//! A lookup depends on the texture coordinates alone, never on the direction or distance it is seen
//! from: every strategy that makes a path finds the same value at a vertex. Coordinates have v
//! upward; row 0 of an image is its top.

mod image;
mod lookup;
mod value;

pub use image::{Image, ImageError, MAX_TEXELS};
pub use lookup::{Filter, ImageTexture, Wrap};
pub use value::{ScalarTexture, SpectrumTexture};
