//! How texture coordinates find texels: map, wrap, filter.

use super::Image;
use glam::{DAffine2, DVec2};
use std::sync::Arc;

/// Rule for what lies beyond the borders of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image mirrored.
    Mirror,
    /// The border texels.
    Clamp,
}

impl Wrap {
    /// The texel of `0..n` that stands at place `i` of the endless row.
    fn apply(self, i: i64, n: i64) -> usize {
        (match self {
            Self::Repeat => i.rem_euclid(n),
            Self::Mirror => {
                let j = i.rem_euclid(2 * n);
                j.min(2 * n - 1 - j)
            }
            Self::Clamp => i.clamp(0, n - 1),
        }) as usize
    }
}

/// How values between texels are made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Filter {
    /// The texel that holds the point.
    Nearest,
    /// Linear between the centers of the four texels around it.
    #[default]
    Bilinear,
    /// Linear within and between two levels of the pyramid: texels are means of 2^level × 2^level
    /// of the image's.
    Mipmap {
        /// The level, 0 the image itself.
        level: f64,
    },
}

/// An image over a surface.
#[derive(Clone, Debug)]
pub struct ImageTexture {
    /// The image.
    pub image: Arc<Image>,
    /// From the coordinates of the surface to those of the image: (0, 0) its lower left corner, (1,
    /// 1) its upper right one.
    pub map: DAffine2,
    /// Beyond the borders, to the sides and up and down.
    pub wrap: [Wrap; 2],
    /// Between texels.
    pub filter: Filter,
}

impl ImageTexture {
    /// The whole image over the unit square, repeated, bilinear.
    #[must_use]
    pub fn new(image: Arc<Image>) -> Self {
        Self {
            image,
            map: DAffine2::IDENTITY,
            wrap: [Wrap::Repeat; 2],
            filter: Filter::Bilinear,
        }
    }

    /// Linear red, green, blue and coverage at `uv` of the surface.
    #[must_use]
    pub fn eval(&self, uv: DVec2) -> [f32; 4] {
        let p = self.map.transform_point2(uv);
        // rows run downward; what is not finite falls on texel 0
        let p = DVec2::new(p.x, 1.0 - p.y);
        match self.filter {
            Filter::Nearest => {
                let (w, h) = self.image.level_size(0);
                let at = |x: f64, n: usize| (x * n as f64).floor() as i64;
                self.texel(0, at(p.x, w), at(p.y, h))
            }
            Filter::Bilinear => self.bilinear(0, p),
            Filter::Mipmap { level } => {
                let last = self.image.level_count() - 1;
                let level = level.clamp(0.0, last as f64);
                let low = level as usize;
                let t = (level - low as f64) as f32;
                let a = self.bilinear(low, p);
                if t == 0.0 {
                    return a;
                }
                let b = self.bilinear((low + 1).min(last), p);
                std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
            }
        }
    }

    fn texel(&self, level: usize, x: i64, y: i64) -> [f32; 4] {
        let (w, h) = self.image.level_size(level);
        self.image.texel(
            level,
            self.wrap[0].apply(x, w as i64),
            self.wrap[1].apply(y, h as i64),
        )
    }

    fn bilinear(&self, level: usize, p: DVec2) -> [f32; 4] {
        let (w, h) = self.image.level_size(level);
        let q = p * DVec2::new(w as f64, h as f64) - 0.5;
        let corner = q.floor();
        let (x, y) = (corner.x as i64, corner.y as i64);
        let t = q - corner;
        let (x1, y1) = (x.saturating_add(1), y.saturating_add(1));
        let weighted = [
            (self.texel(level, x, y), (1.0 - t.x) * (1.0 - t.y)),
            (self.texel(level, x1, y), t.x * (1.0 - t.y)),
            (self.texel(level, x, y1), (1.0 - t.x) * t.y),
            (self.texel(level, x1, y1), t.x * t.y),
        ];
        let mut sum = [0.0; 4];
        for (texel, weight) in weighted {
            for (s, v) in sum.iter_mut().zip(texel) {
                *s += v * weight as f32;
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 x 2: top row 0 and 1, bottom row 2 and 3 in red.
    fn square() -> ImageTexture {
        let values = (0..4u8).map(|i| [f32::from(i), 0.0, 0.0]).collect();
        ImageTexture::new(Arc::new(Image::from_floats(2, 2, values).expect("valid")))
    }

    fn red(t: &ImageTexture, u: f64, v: f64) -> f32 {
        t.eval(DVec2::new(u, v))[0]
    }

    #[test]
    fn row_zero_is_the_top() {
        let mut t = square();
        for filter in [
            Filter::Nearest,
            Filter::Bilinear,
            Filter::Mipmap { level: 0.0 },
        ] {
            t.filter = filter;
            let corners = [
                (0.25, 0.75, 0.0),
                (0.75, 0.75, 1.0),
                (0.25, 0.25, 2.0),
                (0.75, 0.25, 3.0),
            ];
            for (u, v, want) in corners {
                assert!((red(&t, u, v) - want).abs() < 1e-6, "{filter:?} {u} {v}");
            }
        }
        t.filter = Filter::Bilinear;
        assert!((red(&t, 0.5, 0.5) - 1.5).abs() < 1e-6);
    }

    #[test]
    fn beyond_the_border() {
        let mut t = square();
        t.filter = Filter::Nearest;
        for (wrap, want) in [(Wrap::Repeat, 0.0), (Wrap::Mirror, 1.0), (Wrap::Clamp, 1.0)] {
            t.wrap = [wrap; 2];
            assert_eq!(red(&t, 1.25, 0.75), want, "{wrap:?}");
        }
        t.wrap = [Wrap::Mirror; 2];
        assert_eq!((red(&t, -0.25, 0.75), red(&t, 1.75, 0.75)), (0.0, 0.0));
        for odd in [f64::NAN, f64::INFINITY, -1e300, 1e300] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                t.wrap = [wrap; 2];
                for filter in [Filter::Nearest, Filter::Bilinear] {
                    t.filter = filter;
                    // the value does not matter
                    _ = red(&t, odd, odd);
                }
            }
        }
    }

    #[test]
    fn maps_and_pyramids() {
        let mut t = square();
        t.filter = Filter::Nearest;
        t.map =
            DAffine2::from_scale_angle_translation(DVec2::splat(0.5), 0.0, DVec2::new(0.5, 0.0));
        assert_eq!(red(&t, 0.1, 0.1), 3.0);
        let pyramid = Image::clone(&square().image).with_pyramid();
        t = ImageTexture::new(Arc::new(pyramid));
        t.filter = Filter::Mipmap { level: 1.0 };
        assert_eq!(red(&t, 0.9, 0.9), 1.5);
        t.filter = Filter::Mipmap { level: 0.5 };
        assert!((red(&t, 0.75, 0.75) - 1.25).abs() < 1e-6);
    }
}
