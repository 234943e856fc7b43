//! Numbers and spectra over a surface: the same everywhere, or from an image.

use super::{Image, ImageTexture};
use crate::spectrum::{Curve, SampledSpectrum, SampledWavelengths, upsample};
use glam::DVec2;
use std::sync::Arc;

/// A number that may vary over a surface.
#[derive(Clone, Debug)]
pub enum ScalarTexture {
    /// The same everywhere.
    Constant(f64),
    /// One channel (0 red ... 3 coverage) of an image.
    Image {
        /// The image.
        texture: ImageTexture,
        /// Which channel, 0..3.
        channel: usize,
    },
    /// The product of two.
    Product(Box<(Self, Self)>),
    /// One minus another.
    Complement(Box<Self>),
}

impl From<f64> for ScalarTexture {
    fn from(value: f64) -> Self {
        Self::Constant(value)
    }
}

impl ScalarTexture {
    /// The value at texture coordinates `uv`.
    #[must_use]
    #[inline]
    pub fn eval(&self, uv: DVec2) -> f64 {
        if let Self::Constant(value) = self {
            *value
        } else {
            self.eval_at(uv)
        }
    }

    fn eval_at(&self, uv: DVec2) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Image { texture, channel } => f64::from(texture.eval(uv)[*channel]),
            Self::Product(pair) => pair.0.eval(uv) * pair.1.eval(uv),
            Self::Complement(other) => 1.0 - other.eval(uv),
        }
    }

    /// The value, where it is the same everywhere.
    #[must_use]
    pub fn constant(&self) -> Option<f64> {
        match self {
            Self::Constant(value) => Some(*value),
            _ => None,
        }
    }

    /// The product; constants are multiplied out.
    #[must_use]
    pub fn times(self, other: impl Into<Self>) -> Self {
        match (self, other.into()) {
            (Self::Constant(a), Self::Constant(b)) => Self::Constant(a * b),
            (Self::Constant(a), b) | (b, Self::Constant(a)) if a == 1.0 => b,
            (Self::Constant(a), _) | (_, Self::Constant(a)) if a == 0.0 => Self::Constant(0.0),
            (a, b) => Self::Product(Box::new((a, b))),
        }
    }

    /// One minus the value.
    #[must_use]
    pub fn complement(&self) -> Self {
        match self {
            Self::Constant(value) => Self::Constant(1.0 - value),
            other => Self::Complement(Box::new(other.clone())),
        }
    }

    /// Appends the images behind it.
    pub fn append_images(&self, out: &mut Vec<Arc<Image>>) {
        match self {
            Self::Constant(_) => {}
            Self::Image { texture, .. } => out.push(texture.image.clone()),
            Self::Product(pair) => {
                pair.0.append_images(out);
                pair.1.append_images(out);
            }
            Self::Complement(other) => other.append_images(out),
        }
    }
}

/// A spectrum that may vary over a surface.
#[derive(Clone, Debug)]
pub enum SpectrumTexture {
    /// The same everywhere.
    Uniform(Curve),
    /// The linear sRGB of an image times `factor`, as a smooth spectrum (see
    /// [`upsample::rgb_lanes`]).
    Image {
        /// The image.
        texture: ImageTexture,
        /// Factor on red, green, blue; each in 0..1 for a reflectance.
        factor: [f32; 3],
    },
}

impl From<Curve> for SpectrumTexture {
    fn from(curve: Curve) -> Self {
        Self::Uniform(curve)
    }
}

impl From<f64> for SpectrumTexture {
    fn from(value: f64) -> Self {
        Self::Uniform(Curve::Constant(value))
    }
}

impl SpectrumTexture {
    /// The values at texture coordinates `uv` and at the wavelengths of a path; 0 in the lanes not
    /// in use.
    #[must_use]
    #[inline]
    pub fn sample(&self, uv: DVec2, wavelengths: &SampledWavelengths) -> SampledSpectrum {
        match self {
            Self::Uniform(curve) => curve.sample(wavelengths),
            Self::Image { texture, factor } => {
                let texel = texture.eval(uv);
                let rgb = std::array::from_fn(|c| texel[c] * factor[c]);
                upsample::rgb_lanes(rgb, wavelengths)
            }
        }
    }

    /// Whether it is the same number at every point and wavelength.
    #[must_use]
    pub fn is_constant(&self, value: f64) -> bool {
        matches!(self, Self::Uniform(Curve::Constant(v)) if *v == value)
    }

    /// Mean of red, green and blue over the image (1 where there is none): how bright a pattern of
    /// emission is.
    #[must_use]
    pub fn mean(&self) -> f64 {
        let Self::Image { texture, factor } = self else {
            return 1.0;
        };
        let image = &texture.image;
        let (w, h) = (image.width(), image.height());
        let mut sum = 0.0;
        for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
            let texel = image.texel(0, x, y);
            sum += (0..3).map(|c| f64::from(texel[c] * factor[c])).sum::<f64>();
        }
        sum / (3 * w * h) as f64
    }

    /// Appends the images behind it.
    pub fn append_images(&self, out: &mut Vec<Arc<Image>>) {
        if let Self::Image { texture, .. } = self {
            out.push(texture.image.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::WavelengthDistribution;

    fn half_red() -> ImageTexture {
        let image = Image::from_floats(1, 1, vec![[0.5, 0.25, 0.125]]).expect("valid");
        ImageTexture::new(Arc::new(image))
    }

    #[test]
    fn scalars_multiply_and_complement() {
        let image = ScalarTexture::Image {
            texture: half_red(),
            channel: 1,
        };
        let at = |t: &ScalarTexture| t.eval(DVec2::splat(0.3));
        assert!((at(&image) - 0.25).abs() < 1e-12);
        assert!((at(&image.complement()) - 0.75).abs() < 1e-12);
        let product = image.clone().times(0.5);
        assert!((at(&product) - 0.125).abs() < 1e-12);
        assert!((at(&product.complement()) - 0.875).abs() < 1e-12);
        assert_eq!(image.clone().times(0.0).constant(), Some(0.0));
        let square = image.clone().times(image);
        assert!((at(&square) - 0.0625).abs() < 1e-12);
    }

    #[test]
    fn gray_texels_are_exact() {
        let wavelengths = WavelengthDistribution::uniform([360.0, 830.0]).sample(0.3, 4);
        let image = Image::from_floats(1, 1, vec![[0.25; 3]]).expect("valid");
        let texture = SpectrumTexture::Image {
            texture: ImageTexture::new(Arc::new(image)),
            factor: [1.0; 3],
        };
        let values = texture.sample(DVec2::ZERO, &wavelengths);
        assert!((0..4).all(|lane| (values[lane] - 0.25).abs() < 1e-6));
        assert!(!texture.is_constant(0.25));
    }
}
