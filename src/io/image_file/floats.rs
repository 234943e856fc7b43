//! Texels of real numbers: linear colors of any size.

use super::{Decoded, Encoding, texels};
use crate::texture::Image;
use glam::{DMat3, DVec3};

/// An image of `values`, mapped to linear sRGB where they are colors and `map` says how.
///
/// # Errors
/// A value is infinite or not a number.
pub fn image(
    (width, height): (u32, u32),
    mut values: Vec<[f32; 3]>,
    map: Option<DMat3>,
    encoding: Encoding,
) -> Result<Decoded, String> {
    let infinite = |t: &[f32; 3]| !t.iter().all(|v| v.is_finite());
    if let Some(first) = values.iter().position(infinite) {
        let count = values.iter().filter(|t| infinite(t)).count();
        let which = texels(count, first, width);
        return Err(format!("{which}: infinite or not a number"));
    }
    if let Some(map) = map.filter(|_| encoding != Encoding::Linear) {
        for texel in &mut values {
            let mapped = map * DVec3::from(texel.map(f64::from));
            *texel = mapped.to_array().map(|v| v as f32);
        }
    }
    let mut negative = None;
    for (i, texel) in values.iter_mut().enumerate() {
        // leftovers of filters or of another gamut
        if texel.iter().any(|v| *v < 0.0) {
            negative = Some(negative.map_or((1, i), |(n, first)| (n + 1, first)));
            *texel = texel.map(|v| v.max(0.0));
        }
    }
    let notes = negative
        .map(|(count, first)| {
            let which = texels(count, first, width);
            format!("{which}: negative numbers are taken as 0")
        })
        .into_iter()
        .collect();
    let image = Image::from_floats(width, height, values).map_err(|e| e.to_string())?;
    Ok(Decoded { image, notes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_kept_is_said_and_no_number_is_refused() {
        let values = |v: f32| vec![[1.0; 3], [0.0, v, 0.0], [2.0, 0.0, v]];
        let decoded = image((3, 1), values(-1.0), None, Encoding::Stated).expect("valid");
        assert_eq!(
            decoded.notes,
            ["2 texels, the first at column 1, row 0: negative numbers are taken as 0"]
        );
        assert_eq!(decoded.image.texel(0, 2, 0), [2.0, 0.0, 0.0, 1.0]);
        for bad in [f32::NAN, f32::INFINITY] {
            let error = image((3, 1), values(bad), None, Encoding::Stated).expect_err("no number");
            assert_eq!(
                error,
                "2 texels, the first at column 1, row 0: infinite or not a number"
            );
        }
    }
}
