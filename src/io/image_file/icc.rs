//! Colors by an ICC profile, through moxcms.

use super::color::Values;
use moxcms::{ColorProfile, DataColorSpace, Layout, TransformOptions};

/// A profile this close to sRGB (of 65535) is sRGB: bytes stay bytes.
const SAME: i32 = 300;

/// Texels whose colors a profile describes, in sRGB.
///
/// # Errors
/// The profile cannot be followed.
pub fn to_srgb(values: &Values, profile: &[u8], gray: bool) -> Result<Values, String> {
    let bad = |what: String| {
        format!("its ICC profile cannot be followed ({what}): convert the image to sRGB first")
    };
    let source = ColorProfile::new_from_slice(profile).map_err(|e| bad(e.to_string()))?;
    let layout = match source.color_space {
        DataColorSpace::Rgb => Layout::Rgba,
        DataColorSpace::Gray if gray => Layout::GrayAlpha,
        other => return Err(bad(format!("it is for {other:?}"))),
    };
    let target = ColorProfile::new_srgb();
    let transform = source
        .create_transform_16bit(layout, &target, Layout::Rgba, TransformOptions::default())
        .map_err(|e| bad(e.to_string()))?;
    let run = |texels: &[[u16; 4]]| -> Result<Vec<[u16; 4]>, String> {
        let mut out = vec![[0u16; 4]; texels.len()];
        let narrowed: Vec<[u16; 2]>;
        let input = if layout == Layout::GrayAlpha {
            narrowed = texels.iter().map(|t| [t[0], t[3]]).collect();
            narrowed.as_flattened()
        } else {
            texels.as_flattened()
        };
        transform
            .transform(input, out.as_flattened_mut())
            .map_err(|e| bad(e.to_string()))?;
        Ok(out)
    };
    let probes = probes(layout == Layout::GrayAlpha);
    let near = |(a, b): (&[u16; 4], &[u16; 4])| {
        (0..3).all(|c| (i32::from(a[c]) - i32::from(b[c])).abs() <= SAME)
    };
    if probes.iter().zip(&run(&probes)?).all(near) {
        return Ok(values.clone());
    }
    run(&values.to_words()).map(Values::Words)
}

/// Colors that tell one color space from another: grays, and ramps of each primary.
fn probes(gray: bool) -> Vec<[u16; 4]> {
    let steps = (0..=16u32).map(|i| (i * 65535 / 16) as u16);
    let grays = steps.clone().map(|v| [v, v, v, u16::MAX]);
    let ramps = steps
        .flat_map(|v| {
            [
                [v, 0, 0, u16::MAX],
                [0, v, 0, u16::MAX],
                [0, 0, v, u16::MAX],
            ]
        })
        .filter(|_| !gray);
    grays.chain(ramps).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_of_srgb_changes_nothing() {
        let profile = ColorProfile::new_srgb().encode().expect("encodes");
        let values = Values::Bytes(vec![[1, 128, 254, 9]]);
        match to_srgb(&values, &profile, false).expect("valid") {
            Values::Bytes(same) => assert_eq!(same, [[1, 128, 254, 9]]),
            Values::Words(_) => panic!("changed"),
        }
    }

    #[test]
    fn display_p3_is_converted() {
        let profile = ColorProfile::new_display_p3().encode().expect("encodes");
        let values = Values::Bytes(vec![[188, 137, 99, 51]]);
        let Values::Words(words) = to_srgb(&values, &profile, false).expect("valid") else {
            panic!("not converted");
        };
        // by the matrix of primaries.rs: linear (0.5029, 0.2502, 0.1248) in P3 is (0.5598, 0.2395,
        // 0.1064) in sRGB
        let expected = [0.7741, 0.5267, 0.3612];
        for (word, e) in words[0].iter().zip(expected) {
            assert!((f64::from(*word) / 65535.0 - e).abs() < 2e-3, "{words:?}");
        }
        assert_eq!(words[0][3], 51 * 257);
    }

    #[test]
    fn no_profile_is_an_error() {
        let values = Values::Bytes(vec![[0; 4]]);
        let error = to_srgb(&values, b"no profile", false).expect_err("damaged");
        assert!(
            error.starts_with("its ICC profile cannot be followed"),
            "{error}"
        );
    }
}
