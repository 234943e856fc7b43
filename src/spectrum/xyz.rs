//! From spectra to CIE XYZ and to linear sRGB.
//!
//! XYZ is the sum over 360..830 nm against the 1931 2 degree observer at every whole nanometer (CIE
//! 15), divided by N_Y: a constant spectrum of 1 has Y = 1. Where the tables of a spectrum have
//! points between two whole nanometers, the integral stands for the sum there. Linear sRGB goes
//! through palette's published matrices (rounded at 1e-7) and serves previews and RGB input only,
//! as do Display P3 and Oklab.

use palette::convert::FromColorUnclamped;
use palette::rgb::Rgb;
use palette::white_point::D65;
use palette::{LinSrgb, Oklab, Xyz, encoding};

use super::integral::{cells, over_cell};
use super::{Curve, Emission, cie};

pub use super::cie::{N_Y, cmf};

/// XYZ of a spectrum given as a function of the wavelength, whose tables have the points `knots_nm`
/// (nanometers).
#[must_use]
pub fn spectrum_to_xyz(knots_nm: &[f64], f: impl Fn(f64) -> f64) -> [f64; 3] {
    let product = |nm: f64| cmf(nm).map(|matching| matching * f(nm));
    let half = |nm: f64| product(nm).map(|v| 0.5 * v);
    let mut observed = [0.0; 3];
    let mut add = |part: [f64; 3]| observed.iter_mut().zip(part).for_each(|(sum, v)| *sum += v);
    for (a, b) in cells([cie::FIRST_NM, cie::LAST_NM], knots_nm) {
        if b - a == 1.0 {
            // inside the cell: spectra may jump at its ends
            add(half(a.next_up()));
            add(half(b.next_down()));
        } else {
            add(over_cell((a, b), product));
        }
    }
    // the sum counts its first and last entry whole
    add(half(cie::FIRST_NM));
    add(half(cie::LAST_NM));
    observed.map(|v| v / N_Y)
}

/// XYZ of a radiance spectrum, per nanometer.
#[must_use]
pub fn curve_to_xyz(curve: &Curve) -> [f64; 3] {
    spectrum_to_xyz(&curve.knots_nm(), |l| curve.eval(l))
}

/// XYZ of an emission, continuous part and lines.
#[must_use]
pub fn emission_to_xyz(emission: &Emission) -> [f64; 3] {
    let mut xyz = emission.continuous.as_ref().map_or([0.0; 3], curve_to_xyz);
    for line in &emission.lines {
        for (sum, matching) in xyz.iter_mut().zip(cmf(line.lambda_nm)) {
            *sum += line.value * matching / N_Y;
        }
    }
    xyz.map(|v| emission.scale * v)
}

/// XYZ of a reflectance under an illuminant, scaled so that the perfect reflector has Y = 1.
#[must_use]
pub fn reflectance_to_xyz(reflectance: &Curve, illuminant: &Curve) -> [f64; 3] {
    let scale = 1.0 / curve_to_xyz(illuminant)[1];
    let mut knots = reflectance.knots_nm();
    illuminant.append_knots_nm(&mut knots);
    spectrum_to_xyz(&knots, |l| reflectance.eval(l) * illuminant.eval(l)).map(|v| v * scale)
}

/// XYZ of an illuminant with Y = 1.
#[must_use]
pub fn white_point(illuminant: &Curve) -> [f64; 3] {
    let xyz = curve_to_xyz(illuminant);
    xyz.map(|v| v / xyz[1])
}

/// Chromaticity (x, y); (0, 0) for black.
#[must_use]
pub fn chromaticity(xyz: [f64; 3]) -> [f64; 2] {
    let sum: f64 = xyz.iter().sum();
    if sum == 0.0 {
        [0.0; 2]
    } else {
        [xyz[0] / sum, xyz[1] / sum]
    }
}

/// XYZ to linear sRGB, no clamping and no adaptation.
#[must_use]
pub fn xyz_to_linear_srgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    let rgb = LinSrgb::from_color_unclamped(Xyz::<D65, f64>::new(x, y, z));
    [rgb.red, rgb.green, rgb.blue]
}

/// Linear sRGB to XYZ.
#[must_use]
pub fn linear_srgb_to_xyz([r, g, b]: [f64; 3]) -> [f64; 3] {
    let xyz: Xyz<D65, f64> = Xyz::from_color_unclamped(LinSrgb::new(r, g, b));
    [xyz.x, xyz.y, xyz.z]
}

/// XYZ to linear Display P3, no clamping and no adaptation.
#[must_use]
pub fn xyz_to_linear_p3([x, y, z]: [f64; 3]) -> [f64; 3] {
    type LinearP3 = Rgb<encoding::Linear<encoding::DisplayP3>, f64>;
    let rgb = LinearP3::from_color_unclamped(Xyz::<D65, f64>::new(x, y, z));
    [rgb.red, rgb.green, rgb.blue]
}

/// XYZ to Oklab (Ottosson 2020): lightness, and two opponent colors whose angle is the hue.
#[must_use]
pub fn xyz_to_oklab([x, y, z]: [f64; 3]) -> [f64; 3] {
    let lab = Oklab::from_color_unclamped(Xyz::<D65, f64>::new(x, y, z));
    [lab.l, lab.a, lab.b]
}

/// Oklab to XYZ.
#[must_use]
pub fn oklab_to_xyz([l, a, b]: [f64; 3]) -> [f64; 3] {
    let xyz: Xyz<D65, f64> = Xyz::from_color_unclamped(Oklab::new(l, a, b));
    [xyz.x, xyz.y, xyz.z]
}

#[cfg(test)]
mod tests {
    use super::super::library::Library;
    use super::*;

    #[test]
    fn equal_energy_has_unit_luminance() {
        let xyz = curve_to_xyz(&Curve::Constant(1.0));
        assert!((xyz[1] - 1.0).abs() < 1e-12);
        let [x, y] = chromaticity(xyz);
        assert!(
            (x - 1.0 / 3.0).abs() < 5e-5 && (y - 1.0 / 3.0).abs() < 5e-5,
            "{x} {y}"
        );
    }

    #[test]
    fn illuminants_have_their_published_chromaticities() {
        // CIE 015:2018, tables of the illuminants, five digits (F series over 380..780 nm).
        for (name, x, y) in [
            ("A", 0.44758, 0.40745),
            ("D50", 0.34567, 0.35851),
            ("D65", 0.31272, 0.32903),
            ("E", 0.33333, 0.33333),
            ("F2", 0.37208, 0.37529),
            ("F11", 0.38052, 0.37713),
        ] {
            let curve = Library::embedded().curve(name).unwrap();
            let [got_x, got_y] = chromaticity(curve_to_xyz(&curve));
            assert!(
                (got_x - x).abs() < 5e-5 && (got_y - y).abs() < 5e-5,
                "{name} {got_x} {got_y}"
            );
        }
    }

    #[test]
    fn srgb_and_xyz_are_inverse_without_clamping() {
        for rgb in [[1.0, 1.0, 1.0], [-0.2, 3.0, 0.1]] {
            let back = xyz_to_linear_srgb(linear_srgb_to_xyz(rgb));
            for c in 0..3 {
                assert!((back[c] - rgb[c]).abs() < 1e-6, "{back:?}");
            }
        }
    }
}
