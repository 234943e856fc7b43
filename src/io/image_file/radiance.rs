//! Radiance HDR pictures (.hdr, .pic): 8-bit red, green, blue with one exponent, in run-length code
//! (G. Ward, "Real Pixels", Graphics Gems II, 1991; the header and both codes as the manual of
//! Radiance, "filefmts", has them).

use super::primaries::{Primaries, xyz_to_linear_srgb};
use super::{Decoded, Encoding, Limits, check_size, floats};
use glam::DMat3;

/// Longest header.
const MAX_HEADER: usize = 1 << 16;
/// Widths of scan lines that may be in the newer code, a run-length code for each component.
const NEW_WIDTHS: std::ops::Range<usize> = 8..32768;

/// Contents of the header.
struct Header {
    /// Product of all exposures: pixels were multiplied by it.
    exposure: [f64; 3],
    map: Option<DMat3>,
    width: usize,
    height: usize,
    axes: Axes,
}

/// Where the first pixel is, and which way the scan lines run.
#[derive(Clone, Copy, Debug)]
struct Axes {
    /// Scan lines are columns.
    columns: bool,
    from_bottom: bool,
    from_right: bool,
}

fn bad(what: &str) -> String {
    format!("not a readable Radiance image ({what})")
}

pub fn decode(bytes: &[u8], encoding: Encoding, limits: Limits) -> Result<Decoded, String> {
    let (header, mut rest) = header(bytes)?;
    let (width, height) = (header.width, header.height);
    check_size(width as u64, height as u64, bytes.len(), limits)?;
    let (length, lines) = if header.axes.columns {
        (height, width)
    } else {
        (width, height)
    };
    let mut values = vec![[0.0f32; 3]; width * height];
    let mut line = vec![[0u8; 4]; length];
    for j in 0..lines {
        scan_line(&mut rest, &mut line)
            .ok_or_else(|| bad(&format!("scan line {j} of {lines} is cut short or damaged")))?;
        for (i, &pixel) in line.iter().enumerate() {
            let (x, y) = if header.axes.columns { (j, i) } else { (i, j) };
            let x = if header.axes.from_right {
                width - 1 - x
            } else {
                x
            };
            let y = if header.axes.from_bottom {
                height - 1 - y
            } else {
                y
            };
            values[y * width + x] = real(pixel, header.exposure);
        }
    }
    floats::image((width as u32, height as u32), values, header.map, encoding)
}

/// A pixel as real numbers: mantissas of 8 bits in the middle of their step, and the exponent less
/// 128.
fn real([r, g, b, e]: [u8; 4], exposure: [f64; 3]) -> [f32; 3] {
    if e == 0 {
        return [0.0; 3];
    }
    let scale = f64::from(i32::from(e) - (128 + 8)).exp2();
    let mantissas = [r, g, b].map(f64::from);
    std::array::from_fn(|c| (mantissas[c] * scale / exposure[c]) as f32)
}

fn header(bytes: &[u8]) -> Result<(Header, &[u8]), String> {
    let mut rest = bytes;
    let mut number = 0;
    let mut line = || -> Result<(usize, &str), String> {
        let end = rest.iter().take(MAX_HEADER).position(|&b| b == b'\n');
        let end = end.ok_or_else(|| bad("the header has no end"))?;
        let text = std::str::from_utf8(&rest[..end]).unwrap_or_default().trim();
        rest = &rest[end + 1..];
        number += 1;
        Ok((number, text))
    };
    let mut exposure = [1.0f64; 3];
    let mut primaries = None;
    let mut format = None;
    line()?;
    loop {
        let (number, text) = line()?;
        if text.is_empty() {
            break;
        }
        let Some((key, value)) = text.split_once('=') else {
            continue;
        };
        let numbers = || -> Result<Vec<f64>, String> {
            let parse = |w: &str| w.parse::<f64>().ok().filter(|v| v.is_finite());
            let words: Option<Vec<f64>> = value.split_whitespace().map(parse).collect();
            words.ok_or_else(|| bad(&format!("line {number}: \"{text}\"")))
        };
        match key.trim() {
            "FORMAT" => format = Some(value.trim().to_owned()),
            "EXPOSURE" => match *numbers()? {
                [v] if v > 0.0 => exposure = exposure.map(|e| e * v),
                _ => return Err(bad(&format!("line {number}: \"{text}\""))),
            },
            "COLORCORR" => match *numbers()? {
                [r, g, b] if r > 0.0 && g > 0.0 && b > 0.0 => {
                    exposure = [exposure[0] * r, exposure[1] * g, exposure[2] * b];
                }
                _ => return Err(bad(&format!("line {number}: \"{text}\""))),
            },
            "PRIMARIES" => match *numbers()? {
                [rx, ry, gx, gy, bx, by, wx, wy] => {
                    primaries = Some(Primaries {
                        red: [rx, ry],
                        green: [gx, gy],
                        blue: [bx, by],
                        white: [wx, wy],
                    });
                }
                _ => return Err(bad(&format!("line {number}: \"{text}\""))),
            },
            _ => {}
        }
    }
    let map = match format.as_deref() {
        None | Some("32-bit_rle_rgbe") => match primaries {
            None => None,
            Some(p) => p.to_linear_srgb()?,
        },
        Some("32-bit_rle_xyze") => Some(xyz_to_linear_srgb()),
        Some(other) => return Err(bad(&format!("FORMAT={other}"))),
    };
    if !exposure.iter().all(|e| e.is_finite() && *e > 0.0) {
        return Err(bad("its exposures multiply to no number"));
    }
    let (_, text) = line()?;
    let unknown = || bad(&format!("resolution \"{text}\""));
    let words: Vec<&str> = text.split_whitespace().collect();
    let &[axis0, size0, axis1, size1] = words.as_slice() else {
        return Err(unknown());
    };
    let size = |text: &str| text.parse::<u32>().map_err(|_| unknown());
    let (size0, size1) = (size(size0)? as usize, size(size1)? as usize);
    let columns = axis0.ends_with('X');
    let (x, y) = if columns {
        (axis0, axis1)
    } else {
        (axis1, axis0)
    };
    if !["+X", "-X"].contains(&x) || !["+Y", "-Y"].contains(&y) {
        return Err(unknown());
    }
    let (width, height) = if columns {
        (size0, size1)
    } else {
        (size1, size0)
    };
    let axes = Axes {
        columns,
        from_bottom: y == "+Y",
        from_right: x == "-X",
    };
    let header = Header {
        exposure,
        map,
        width,
        height,
        axes,
    };
    Ok((header, rest))
}

/// Reads one scan line; `None` where it is cut short or damaged.
fn scan_line(rest: &mut &[u8], line: &mut [[u8; 4]]) -> Option<()> {
    let length = line.len();
    if let [2, 2, high, low, ..] = **rest
        && high < 128
        && NEW_WIDTHS.contains(&length)
    {
        if usize::from(high) << 8 | usize::from(low) != length {
            return None;
        }
        *rest = &rest[4..];
        for component in 0..4 {
            let mut at = 0;
            while at < length {
                let (&count, after) = rest.split_first()?;
                let (run, count) = (count > 128, usize::from(count & 127));
                // 128 itself is no run but 128 values
                let count = if count == 0 { 128 } else { count };
                let taken = if run { 1 } else { count };
                let (data, after) = after.split_at_checked(taken)?;
                let end = at + count;
                for (i, texel) in line.get_mut(at..end)?.iter_mut().enumerate() {
                    texel[component] = data[if run { 0 } else { i }];
                }
                (at, *rest) = (end, after);
            }
        }
        return Some(());
    }
    // the older code: a pixel of mantissas 1, 1, 1 repeats the one before; several in a row are
    // digits to the base 256
    let (mut at, mut shift) = (0, 0);
    while at < length {
        let (&pixel, after) = rest.split_first_chunk::<4>()?;
        *rest = after;
        if let [1, 1, 1, count] = pixel {
            let count = usize::from(count).checked_shl(shift)?;
            let before = *line.get(at.checked_sub(1)?)?;
            line.get_mut(at..at.checked_add(count)?)?.fill(before);
            at += count;
            shift = (shift + 8).min(32);
        } else {
            line[at] = pixel;
            at += 1;
            shift = 0;
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::{Image, MAX_TEXELS};

    fn read(bytes: &[u8]) -> Result<Image, String> {
        super::super::decode(bytes, Encoding::Stated).map(|d| d.image)
    }

    fn file(header: &str, resolution: &str, data: &[u8]) -> Vec<u8> {
        let text = format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n{resolution}\n");
        [text.as_bytes(), data].concat()
    }

    const TWO: [u8; 8] = [128, 64, 32, 129, 1, 2, 3, 130];

    #[test]
    fn plain_pixels_and_all_directions() {
        let image = read(&file("", "-Y 1 +X 2", &TWO)).expect("valid");
        assert_eq!(image.texel(0, 0, 0), [1.0, 0.5, 0.25, 1.0]);
        assert_eq!(
            image.texel(0, 1, 0),
            [4.0 / 256.0, 8.0 / 256.0, 12.0 / 256.0, 1.0]
        );
        let turned = read(&file("", "-Y 1 -X 2", &TWO)).expect("valid");
        assert_eq!(turned.texel(0, 1, 0), [1.0, 0.5, 0.25, 1.0]);
        let up = read(&file("", "+X 1 +Y 2", &TWO)).expect("valid");
        assert_eq!((up.width(), up.height()), (1, 2));
        assert_eq!(up.texel(0, 0, 1), [1.0, 0.5, 0.25, 1.0]);
    }

    #[test]
    fn exposure_and_color_correction_are_undone() {
        let header = "EXPOSURE=2\nEXPOSURE=2\nCOLORCORR=1 2 4\n";
        let image = read(&file(header, "-Y 1 +X 2", &TWO)).expect("valid");
        assert_eq!(image.texel(0, 0, 0), [0.25, 0.0625, 0.015_625, 1.0]);
    }

    #[test]
    fn both_run_length_codes() {
        // component by component: a run of 8, then 8 values
        let mut data = vec![2, 2, 0, 8];
        data.extend([128 + 8, 128]);
        data.extend([8, 1, 2, 3, 4, 5, 6, 7, 8]);
        data.extend([128 + 8, 0]);
        data.extend([128 + 8, 129]);
        let image = read(&file("", "-Y 1 +X 8", &data)).expect("valid");
        assert_eq!(image.texel(0, 7, 0), [1.0, 8.0 / 128.0, 0.0, 1.0]);
        let old = [128, 64, 32, 129, 1, 1, 1, 2, 1, 1, 1, 1, 0, 0, 0, 0];
        let image = read(&file("", "-Y 1 +X 260", &old)).expect("valid");
        assert_eq!(image.texel(0, 258, 0), [1.0, 0.5, 0.25, 1.0]);
        assert_eq!(image.texel(0, 259, 0)[0], 0.0);
    }

    #[test]
    fn faults_are_named() {
        for (bytes, message) in [
            (
                file("", "-Y 1 +X 3", &TWO),
                "scan line 0 of 1 is cut short or damaged",
            ),
            (file("", "-Y 1 +Z 3", &TWO), "resolution \"-Y 1 +Z 3\""),
            (
                file("EXPOSURE=0\n", "-Y 1 +X 2", &TWO),
                "line 2: \"EXPOSURE=0\"",
            ),
            (
                b"#?RADIANCE\nFORMAT=rgb\n\n-Y 1 +X 1\n".to_vec(),
                "FORMAT=rgb",
            ),
            (b"#?RADIANCE\n".to_vec(), "the header has no end"),
        ] {
            assert_eq!(read(&bytes).err(), Some(bad(message)));
        }
        let huge = file("", "-Y 60000 +X 60000", &TWO);
        let error = read(&huge).expect_err("too large");
        assert_eq!(
            error,
            format!("60000 x 60000 texels (allowed: 1 to {MAX_TEXELS} in all)")
        );
        let bomb = file("", "-Y 8000 +X 8000", &TWO);
        assert!(
            read(&bomb)
                .expect_err("bomb")
                .contains("truncated or damaged")
        );
    }
}
