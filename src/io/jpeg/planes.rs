//! Planes of samples at full size, and their colors.
//!
//! Chroma of half the size is interpolated by triangle filters, 3/4 of the nearer and 1/4 of the
//! farther sample, as libjpeg's "fancy" upsampling does it; other ratios are repeated. Colors by
//! JFIF 1.02.

use super::transform::samples;
use super::{ColorModel, Component, Frame};

/// Samples of a component, at its own size.
struct Plane {
    width: usize,
    height: usize,
    stride: usize,
    samples: Vec<u8>,
}

impl Plane {
    fn of(component: &Component, frame: &Frame) -> Result<Self, String> {
        let quantization = component
            .quantization
            .as_ref()
            .ok_or("a component has no scan")?;
        let stride = component.stride * 8;
        let mut plane = vec![0; component.blocks.len() * 64];
        for (i, block) in component.blocks.iter().enumerate() {
            let (column, row) = (i % component.stride, i / component.stride);
            let values = samples(block, quantization);
            for (y, line) in values.as_chunks::<8>().0.iter().enumerate() {
                let at = (row * 8 + y) * stride + column * 8;
                plane[at..at + 8].copy_from_slice(line);
            }
        }
        Ok(Self {
            width: (frame.width * component.h).div_ceil(frame.h_max),
            height: (frame.height * component.v).div_ceil(frame.v_max),
            stride,
            samples: plane,
        })
    }

    fn row(&self, y: usize) -> &[u8] {
        &self.samples[y * self.stride..][..self.width]
    }

    /// Row `y` of the image, from a plane `across` and `down` times smaller.
    fn full_row(&self, y: usize, across: usize, down: usize, out: &mut Vec<u8>) {
        let near = self.row((y / down).min(self.height - 1));
        let beside = |upper: bool| {
            let own = y / down;
            let other = if upper {
                own.saturating_sub(1)
            } else {
                (own + 1).min(self.height - 1)
            };
            self.row(other)
        };
        let upper = y.is_multiple_of(2);
        out.clear();
        match (across, down) {
            (1, 1) => out.extend_from_slice(near),
            (2, 1) if self.width > 2 => widened(near, 1, out),
            (2, 2) if self.width > 2 => {
                let far = beside(upper);
                let sums: Vec<u16> = near
                    .iter()
                    .zip(far)
                    .map(|(&n, &f)| 3 * u16::from(n) + u16::from(f))
                    .collect();
                widened(&sums, 4, out);
            }
            (1, 2) => {
                let far = beside(upper);
                let bias = if upper { 1 } else { 2 };
                let mixed =
                    |(&n, &f): (&u8, &u8)| ((3 * u16::from(n) + u16::from(f) + bias) >> 2) as u8;
                out.extend(near.iter().zip(far).map(mixed));
            }
            _ => out.extend(near.iter().flat_map(|&v| std::iter::repeat_n(v, across))),
        }
    }
}

/// Twice as many samples: 3/4 of the own and 1/4 of the one beside. Values are `scale` times too
/// large.
fn widened<T: Copy + Into<u32>>(values: &[T], scale: u32, out: &mut Vec<u8>) {
    let shift = 2 + scale.ilog2();
    // halves are rounded up and down in turn
    let (left_bias, right_bias) = if scale == 1 { (1, 2) } else { (8, 7) };
    let last = values.len() - 1;
    for (i, &v) in values.iter().enumerate() {
        let own: u32 = v.into();
        let mixed = |other: T, bias: u32| (3 * own + other.into() + bias) >> shift;
        // a border is its own neighbor, rounded as in the middle but for plain values
        let edge = |bias: u32| {
            if scale == 1 {
                own
            } else {
                (4 * own + bias) >> shift
            }
        };
        let left = if i == 0 {
            edge(left_bias)
        } else {
            mixed(values[i - 1], left_bias)
        };
        let right = if i == last {
            edge(right_bias)
        } else {
            mixed(values[i + 1], right_bias)
        };
        out.extend([left as u8, right as u8]);
    }
}

/// The colors of all pixels.
pub fn colors(frame: &Frame, model: ColorModel) -> Result<Vec<[u8; 3]>, String> {
    let planes = frame.components.iter().map(|c| Plane::of(c, frame));
    let planes: Vec<Plane> = planes.collect::<Result<_, _>>()?;
    let mut rows: Vec<Vec<u8>> = vec![Vec::new(); planes.len()];
    let mut colors = Vec::with_capacity(frame.width * frame.height);
    for y in 0..frame.height {
        for ((plane, component), row) in planes.iter().zip(&frame.components).zip(&mut rows) {
            let (across, down) = (frame.h_max / component.h, frame.v_max / component.v);
            plane.full_row(y, across, down, row);
        }
        let pixel = |x: usize| match (model, rows.as_slice()) {
            (ColorModel::Rgb, [r, g, b, ..]) => [r[x], g[x], b[x]],
            (ColorModel::Ycc, [l, b, r, ..]) => ycc(l[x], b[x], r[x]),
            // inks are stored as what they leave of the light, as Adobe began it
            (ColorModel::Cmyk, [c, m, y, k]) => [c[x], m[x], y[x]].map(|v| over_black(v, k[x])),
            (ColorModel::Ycck, [l, b, r, k]) => {
                ycc(l[x], b[x], r[x]).map(|v| over_black(255 - v, k[x]))
            }
            (_, [gray, ..]) => [gray[x]; 3],
            (_, []) => [0; 3],
        };
        colors.extend((0..frame.width).map(pixel));
    }
    Ok(colors)
}

/// The light that an ink and black together leave.
fn over_black(ink: u8, black: u8) -> u8 {
    let covered = u32::from(255 - ink) * u32::from(black) + 128;
    black - (((covered >> 8) + covered) >> 8) as u8
}

/// Red, green and blue of luma and chroma, in 16 bits of fixed point.
fn ycc(luma: u8, blue: u8, red: u8) -> [u8; 3] {
    const HALF: i32 = 1 << 15;
    const fn fixed(value: f64) -> i32 {
        (value * 65536.0 + 0.5) as i32
    }
    let (y, b, r) = (i32::from(luma), i32::from(blue) - 128, i32::from(red) - 128);
    [
        y + ((fixed(1.40200) * r + HALF) >> 16),
        y + ((-fixed(0.34414) * b - fixed(0.71414) * r + HALF) >> 16),
        y + ((fixed(1.77200) * b + HALF) >> 16),
    ]
    .map(|v| v.clamp(0, 255) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_interpolated() {
        let mut out = Vec::new();
        widened(&[0u8, 8, 16], 1, &mut out);
        assert_eq!(out, [0, 2, 6, 10, 14, 16]);
        out.clear();
        widened(&[0u16, 32, 64], 4, &mut out);
        assert_eq!(out, [0, 2, 6, 10, 14, 16]);
    }

    #[test]
    fn colors_of_the_standard() {
        assert_eq!(ycc(255, 128, 128), [255; 3]);
        // JFIF: red is 76.245, 84.97, 255.5
        assert_eq!(ycc(76, 85, 255), [254, 0, 0]);
        assert_eq!(over_black(255, 255), 255);
        assert_eq!((over_black(0, 255), over_black(255, 0)), (0, 0));
    }
}
