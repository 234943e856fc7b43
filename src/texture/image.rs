//! Images in memory: bytes as they were decoded, or floats; filtered in linear light.

use std::ops::Range;
use std::sync::LazyLock;

/// Most texels of an image (a square of 16384).
pub const MAX_TEXELS: u64 = 1 << 28;

/// Linear value of every sRGB byte (IEC 61966-2-1).
static SRGB: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| srgb_to_linear(i as f64 / 255.0)));

/// Linear value of every sRGB number of 16 bits.
static SRGB_WORDS: LazyLock<Vec<f32>> = LazyLock::new(|| {
    (0..=u16::MAX)
        .map(|i| srgb_to_linear(f64::from(i) / 65535.0))
        .collect()
});

fn srgb_to_linear(v: f64) -> f32 {
    (if v <= 0.04045 {
        v / 12.92
    } else {
        ((v + 0.055) / 1.055).powf(2.4)
    }) as f32
}

/// Why numbers are no image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// No texels, or more than are kept.
    #[error("{width} x {height} texels (allowed: 1 to {MAX_TEXELS} in all)")]
    Size {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
    },
    /// The number of values is not that of the texels.
    #[error("{found} values for {expected} texels")]
    Count {
        /// Values given.
        found: usize,
        /// Texels.
        expected: usize,
    },
    /// A value is negative, infinite or not a number.
    #[error("texel {0} is not a finite number >= 0")]
    Value(usize),
}

#[derive(Clone, Debug, PartialEq)]
enum Texels {
    /// Red, green, blue, coverage. Colors are sRGB-encoded where `srgb`.
    Bytes { values: Vec<[u8; 4]>, srgb: bool },
    /// The same in 16 bits.
    Words { values: Vec<[u16; 4]>, srgb: bool },
    /// Linear red, green, blue; coverage 1.
    Floats(Vec<[f32; 3]>),
}

/// One level of a pyramid.
#[derive(Clone, Debug, PartialEq)]
struct Level {
    width: usize,
    height: usize,
    texels: Texels,
}

impl Level {
    fn texel(&self, x: usize, y: usize) -> [f32; 4] {
        let i = y * self.width + x;
        match &self.texels {
            Texels::Bytes { values, srgb } => {
                let [r, g, b, a] = values[i];
                let a = f32::from(a) / 255.0;
                if *srgb {
                    let table = &*SRGB;
                    [
                        table[usize::from(r)],
                        table[usize::from(g)],
                        table[usize::from(b)],
                        a,
                    ]
                } else {
                    [
                        f32::from(r) / 255.0,
                        f32::from(g) / 255.0,
                        f32::from(b) / 255.0,
                        a,
                    ]
                }
            }
            Texels::Words { values, srgb } => {
                let [r, g, b, a] = values[i];
                let plain = |v: u16| f32::from(v) / 65535.0;
                if *srgb {
                    let [r, g, b] = [r, g, b].map(|v| SRGB_WORDS[usize::from(v)]);
                    [r, g, b, plain(a)]
                } else {
                    [r, g, b, a].map(plain)
                }
            }
            Texels::Floats(values) => {
                let [r, g, b] = values[i];
                [r, g, b, 1.0]
            }
        }
    }

    /// Half the size: every texel the mean of (up to) four.
    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mean = |x: usize, y: usize| {
            let mut sum = [0.0f32; 4];
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let texel = self.texel(
                    (2 * x + dx).min(self.width - 1),
                    (2 * y + dy).min(self.height - 1),
                );
                for (s, t) in sum.iter_mut().zip(texel) {
                    *s += 0.25 * t;
                }
            }
            [sum[0], sum[1], sum[2]]
        };
        // floats: encoding means as bytes again would lose dark ones
        let texels = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| mean(x, y))
            .collect();
        Self {
            width,
            height,
            texels: Texels::Floats(texels),
        }
    }
}

/// An image; row 0 is the top one.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    levels: Vec<Level>,
}

impl Image {
    /// From 8-bit red, green, blue and coverage; `srgb`: colors are sRGB-encoded, else linear.
    ///
    /// # Errors
    /// If the size is 0 or too large, or does not match the values.
    pub fn from_bytes(
        width: u32,
        height: u32,
        values: Vec<[u8; 4]>,
        srgb: bool,
    ) -> Result<Self, ImageError> {
        check_size(width, height, values.len())?;
        Ok(Self::new(width, height, Texels::Bytes { values, srgb }))
    }

    /// The same from 16 bits a channel.
    ///
    /// # Errors
    /// If the size is 0 or too large, or does not match the values.
    pub fn from_words(
        width: u32,
        height: u32,
        values: Vec<[u16; 4]>,
        srgb: bool,
    ) -> Result<Self, ImageError> {
        check_size(width, height, values.len())?;
        Ok(Self::new(width, height, Texels::Words { values, srgb }))
    }

    /// From linear red, green, blue.
    ///
    /// # Errors
    /// If the size is 0 or too large or does not match the values, or a value is negative or not
    /// finite.
    pub fn from_floats(width: u32, height: u32, values: Vec<[f32; 3]>) -> Result<Self, ImageError> {
        check_size(width, height, values.len())?;
        let bad = |t: &[f32; 3]| !t.iter().all(|v| v.is_finite() && *v >= 0.0);
        if let Some(i) = values.iter().position(bad) {
            return Err(ImageError::Value(i));
        }
        Ok(Self::new(width, height, Texels::Floats(values)))
    }

    fn new(width: u32, height: u32, texels: Texels) -> Self {
        Self {
            levels: vec![Level {
                width: width as usize,
                height: height as usize,
                texels,
            }],
        }
    }

    /// The same image with its pyramid of halved levels, down to one texel. (Coverage is kept in
    /// level 0 only.)
    #[must_use]
    pub fn with_pyramid(mut self) -> Self {
        while let Some(last) = self.levels.last()
            && (last.width > 1 || last.height > 1)
        {
            self.levels.push(last.halved());
        }
        self
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.levels[0].width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.levels[0].height
    }

    /// Levels there are; 1 without a pyramid.
    #[must_use]
    pub fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// Columns and rows of a level.
    pub(super) fn level_size(&self, level: usize) -> (usize, usize) {
        (self.levels[level].width, self.levels[level].height)
    }

    /// Linear red, green, blue and coverage of a texel.
    #[must_use]
    pub fn texel(&self, level: usize, x: usize, y: usize) -> [f32; 4] {
        self.levels[level].texel(x, y)
    }

    /// How many texels have a channel of `channels` (0 red ... 3 coverage) above `limit`, and
    /// column and row of the first.
    #[must_use]
    pub fn above(&self, limit: f32, channels: Range<usize>) -> Option<(usize, [usize; 2])> {
        let level = &self.levels[0];
        if limit >= 1.0 && !matches!(level.texels, Texels::Floats(_)) {
            return None;
        }
        let width = level.width;
        let exceeds = |&i: &usize| {
            let texel = level.texel(i % width, i / width);
            texel[channels.clone()].iter().any(|v| *v > limit)
        };
        let mut found = (0..width * level.height).filter(exceeds);
        let first = found.next()?;
        Some((1 + found.count(), [first % width, first / width]))
    }

    /// Memory held, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let level = |l: &Level| match &l.texels {
            Texels::Bytes { values, .. } => size_of_val(values.as_slice()),
            Texels::Words { values, .. } => size_of_val(values.as_slice()),
            Texels::Floats(values) => size_of_val(values.as_slice()),
        };
        self.levels.iter().map(level).sum()
    }
}

fn check_size(width: u32, height: u32, found: usize) -> Result<(), ImageError> {
    let (width, height) = (u64::from(width), u64::from(height));
    let texels = width * height;
    if texels == 0 || texels > MAX_TEXELS {
        return Err(ImageError::Size { width, height });
    }
    if found as u64 != texels {
        return Err(ImageError::Count {
            found,
            expected: texels as usize,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_decoded_and_floats_kept() {
        let image = Image::from_bytes(1, 1, vec![[188, 0, 255, 128]], true).expect("valid");
        let [r, g, b, a] = image.texel(0, 0, 0);
        assert!((r - 0.5).abs() < 3e-3 && g == 0.0 && b == 1.0);
        assert!((a - 128.0 / 255.0).abs() < 1e-7);
        let linear = Image::from_bytes(1, 1, vec![[51, 0, 0, 0]], false).expect("valid");
        assert!((linear.texel(0, 0, 0)[0] - 0.2).abs() < 1e-7);
        let words =
            Image::from_words(1, 1, vec![[48_316, 0, 65_535, 13_107]], true).expect("valid");
        let [r, g, b, a] = words.texel(0, 0, 0);
        assert!((r - 0.502_886).abs() < 1e-5 && g == 0.0 && b == 1.0 && (a - 0.2).abs() < 1e-7);
        let bright = Image::from_floats(1, 1, vec![[1e4, 0.0, 2.0]]).expect("valid");
        assert_eq!(bright.texel(0, 0, 0), [1e4, 0.0, 2.0, 1.0]);
        assert_eq!(bright.bytes(), 12);
    }

    #[test]
    fn texels_above_a_limit_are_counted() {
        let values = vec![[0.5, 1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.5]];
        let image = Image::from_floats(1, 3, values).expect("valid");
        assert_eq!(image.above(1.0, 0..3), Some((2, [0, 1])));
        assert_eq!(image.above(1.0, 1..2), None);
        assert_eq!(image.above(0.4, 0..1), Some((2, [0, 0])));
        let bytes = Image::from_bytes(1, 1, vec![[255; 4]], false).expect("valid");
        assert_eq!(
            (bytes.above(1.0, 0..3), bytes.above(0.5, 3..4)),
            (None, Some((1, [0, 0])))
        );
    }

    #[test]
    fn bad_images_are_refused() {
        let size = Image::from_bytes(0, 4, Vec::new(), true);
        assert!(matches!(size, Err(ImageError::Size { .. })));
        let large = Image::from_bytes(1 << 20, 1 << 20, Vec::new(), true);
        assert!(matches!(large, Err(ImageError::Size { .. })));
        let count = Image::from_floats(2, 1, vec![[0.0; 3]]);
        assert!(matches!(
            count,
            Err(ImageError::Count {
                found: 1,
                expected: 2
            })
        ));
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            let image = Image::from_floats(2, 1, vec![[0.0; 3], [0.0, bad, 0.0]]);
            assert_eq!(image.err(), Some(ImageError::Value(1)));
        }
    }

    #[test]
    fn a_pyramid_keeps_the_mean() {
        let values = (0..12)
            .map(|i| [i as f32, 1.0, (i * i) as f32])
            .collect::<Vec<_>>();
        let image = Image::from_floats(4, 3, values[..12].to_vec())
            .expect("valid")
            .with_pyramid();
        assert_eq!(image.level_count(), 3);
        // 4 x 3 -> 2 x 2 (the last row counts twice) -> 1 x 1
        let top = image.texel(2, 0, 0);
        assert_eq!(top[1], 1.0);
        let mean = (values[..8].iter().map(|v| v[0]).sum::<f32>()
            + 2.0 * values[8..].iter().map(|v| v[0]).sum::<f32>())
            / 16.0;
        assert!((top[0] - mean).abs() < 1e-5);
    }
}
