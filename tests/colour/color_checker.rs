//! A rendered ColorChecker.

use crate::python::{check, python};
use crate::rendered::{Rendered, lamp, render, settings};
use abbe::render::OutputRequest;
use abbe::spectrum::{Library, xyz};
use serde_json::json;
use std::fmt::Write;
use std::time::Instant;

/// Side of a patch in pixels.
const PATCH: usize = 16;

/// The patches in the order of the file, which is that of ISO 17321-1.
pub fn patches() -> Vec<&'static str> {
    let table = include_str!("../../spectra/reflectance/colorchecker.csv");
    let header = table.lines().find(|l| l.starts_with("nm,")).unwrap();
    header.split(',').skip(1).collect()
}

/// Six columns by four rows of patches, and a fifth row of perfect white.
fn color_checker(illuminant: &str, spp: u32) -> Rendered {
    let mut scene = settings(spp) + &lamp(&format!("name = \"{illuminant}\""));
    let (width, height) = (6 * PATCH, 5 * PATCH);
    write!(
        scene,
        "[[sensor]]\nresolution = [{width}, {height}]\n\
         orthographic = {{ eye = [3, -2.5, 1], target = [3, -2.5, 0], height = 5 }}\n"
    )
    .unwrap();
    for (i, patch) in patches().into_iter().enumerate() {
        let (x, y) = ((i % 6) as f64 + 0.5, -((i / 6) as f64) - 0.5);
        write!(
            scene,
            "[material.\"{patch}\"]\ndiffuse = {{ reflectance = \"colorchecker/{patch}\" }}\n\
             [[object]]\nquad = {{ center = [{x}, {y}, 0], u = [0.5, 0, 0], v = [0, 0.5, 0] }}\nmaterial = \"{patch}\"\n"
        )
        .unwrap();
    }
    scene += "[material.perfect]\ndiffuse = { reflectance = 1.0 }\n[[object]]\n\
              quad = { center = [3, -4.5, 0], u = [3, 0, 0], v = [0, 0.5, 0] }\nmaterial = \"perfect\"\n";
    render(&scene, &OutputRequest::default())
}

#[test]
fn rendered_patches_and_white_agree_with_colour_science() {
    let Some(python) = python() else { return };
    let start = Instant::now();
    let mut cases = Vec::new();
    for illuminant in ["A", "D65", "F11"] {
        // 256 pixels of 16 passes: two halves of 2^11 strata of the wavelengths
        let image = color_checker(illuminant, 16);
        for (index, patch) in patches().into_iter().enumerate() {
            let (x, y) = (index % 6 * PATCH, index / 6 * PATCH);
            cases.push(json!({
                "kind": "patch", "name": format!("{patch} under {illuminant}"), "index": index,
                "illuminant": illuminant, "own_white": true, "xyz": image.mean(x..x + PATCH, y..y + PATCH),
            }));
        }
        cases.push(json!({
            "kind": "illuminant", "name": format!("white under {illuminant}"),
            "illuminant": illuminant, "own_white": true, "xyz": image.mean(0..6 * PATCH, 4 * PATCH..5 * PATCH),
        }));
    }
    let rendered = start.elapsed();
    let answers = check(&python, &cases);
    let mut worst = [0.0_f64; 2];
    for answer in &answers {
        let delta_e = answer["delta_e"].as_f64().unwrap();
        let is_white = answer["kind"] == "illuminant";
        assert!(delta_e < if is_white { 0.03 } else { 0.1 }, "{answer}");
        worst[usize::from(is_white)] = worst[usize::from(is_white)].max(delta_e);
    }
    let [patch, white] = worst;
    println!(
        "largest CIEDE2000 differences: {patch:.4} of patches, {white:.4} of white; rendered in {rendered:.1?}"
    );
}

/// A single pass: what a preview shows.
#[test]
fn one_pass_over_a_patch_has_its_color_almost() {
    let image = color_checker("D65", 1);
    let light = Library::embedded().curve("D65").unwrap();
    let white = xyz::white_point(&light);
    for (i, patch) in patches().into_iter().enumerate() {
        let (x, y) = (i % 6 * PATCH, i / 6 * PATCH);
        let reflectance = Library::embedded()
            .curve(&format!("colorchecker/{patch}"))
            .unwrap();
        let (got, want) = (
            image.mean(x..x + PATCH, y..y + PATCH),
            xyz::reflectance_to_xyz(&reflectance, &light),
        );
        for c in 0..3 {
            // one wavelength in each of 2^8 strata
            assert!(
                (got[c] - want[c]).abs() < 0.004 * white[c],
                "{patch}: {got:?} {want:?}"
            );
        }
    }
}
