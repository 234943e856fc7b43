//! Lamps of lines: their wavelengths are hit exactly.

use crate::rendered::{lamp, render, settings};
use abbe::render::OutputRequest;
use abbe::spectrum::{Library, xyz};

/// A wall of reflectance one half that fills the film.
pub const WALL: &str = r#"
[[sensor]]
resolution = [32, 32]
orthographic = { eye = [0, 0, 1], target = [0, 0, 0], height = 1 }
[material.gray]
diffuse = { reflectance = 0.5 }
[[object]]
quad = { center = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }
material = "gray"
"#;

#[test]
fn a_lamp_of_one_line_has_no_noise_at_all() {
    let scene = settings(1) + &lamp("lines = [[587.5618, 1]]") + WALL;
    let image = render(&scene, &OutputRequest::default());
    assert!(
        image.xyz.iter().all(|pixel| *pixel == image.xyz[0]),
        "pixels differ"
    );
    let [_, y, _] = xyz::cmf(587.5618);
    let want = xyz::cmf(587.5618).map(|c| 0.5 * c / y);
    for c in 0..3 {
        // lanes are single precision
        assert!(
            (image.xyz[0][c] - want[c]).abs() < 1e-6,
            "{:?} {want:?}",
            image.xyz[0]
        );
    }
}

#[test]
fn the_soft_light_of_one_line_has_no_color_noise() {
    let lamp = "[[object]]\nquad = { center = [0, 1, 1], u = [0.3, 0, 0], v = [0, -0.2, -0.2] }\n\
                emission = { lines = [[587.5618, 1]], luminance = 10 }\ntwo_sided = true\n";
    let scene = settings(1) + lamp + WALL;
    let image = render(&scene, &OutputRequest::default());
    let values = || image.xyz.iter().map(|p| p[1]);
    assert!(
        values().any(|y| y != image.xyz[0][1]),
        "there is noise of directions"
    );
    let [x, y, z] = xyz::cmf(587.5618);
    for pixel in image.xyz.iter().filter(|p| p[1] > 0.0) {
        assert!(
            (pixel[0] / pixel[1] - x / y).abs() < 1e-12
                && (pixel[2] / pixel[1] - z / y).abs() < 1e-12
        );
    }
}

#[test]
fn a_lamp_of_many_lines_has_its_color() {
    for name in ["Hg", "Na"] {
        let scene = settings(16) + &lamp(&format!("name = \"{name}\"")) + WALL;
        let got = render(&scene, &OutputRequest::default()).mean(0..32, 0..32);
        let want = xyz::emission_to_xyz(
            &Library::embedded()
                .emission(name)
                .unwrap()
                .with_luminance(0.5),
        );
        let largest = want.into_iter().fold(0.0, f64::max);
        for c in 0..3 {
            // two halves of 2^13 strata, of which each line cuts two
            assert!(
                (got[c] - want[c]).abs() < 3e-4 * largest,
                "{name}: {got:?} {want:?}"
            );
        }
    }
}
