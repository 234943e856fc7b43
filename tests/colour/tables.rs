//! Noise-free XYZ values of the tables against colour-science.

use crate::color_checker::patches;
use crate::python::{check, python};
use abbe::spectrum::{Curve, Emission, Library, xyz};
use serde_json::{Value, json};

fn cases() -> Vec<Value> {
    let library = Library::embedded();
    let mut cases = Vec::new();
    for name in ["A", "D50", "D65", "E", "F2", "F11"] {
        let light = library.curve(name).unwrap();
        cases.push(json!({
            "kind": "illuminant", "name": name, "illuminant": name, "xyz": xyz::white_point(&light),
        }));
        // The same numbers, summed by the reference.
        let values: Vec<f64> = (360..=830).map(|l| light.eval(f64::from(l))).collect();
        cases.push(json!({
            "kind": "samples", "name": format!("{name} at 1 nm"), "values": values,
            "xyz": xyz::white_point(&light),
        }));
    }
    for temp_k in [1500.0, 2856.0, 5000.0, 6504.0, 20000.0] {
        let body = Curve::Blackbody { temp_k, scale: 1.0 };
        cases.push(json!({
            "kind": "blackbody", "name": format!("{temp_k} K"), "temp_k": temp_k,
            "xyz": xyz::white_point(&body),
        }));
    }
    for (index, patch) in patches().into_iter().enumerate() {
        let reflectance = library.curve(&format!("colorchecker/{patch}")).unwrap();
        for illuminant in ["A", "D65", "F11"] {
            let light = library.curve(illuminant).unwrap();
            cases.push(json!({
                "kind": "patch", "name": format!("{patch} under {illuminant}"), "index": index,
                "illuminant": illuminant, "xyz": xyz::reflectance_to_xyz(&reflectance, &light),
            }));
        }
    }
    for rgb in [[1.0, 1.0, 1.0], [0.9, 0.2, 0.1], [0.05, 0.4, 0.8]] {
        cases.push(json!({
            "kind": "srgb", "name": format!("{rgb:?}"), "rgb": rgb,
            "xyz": xyz::emission_to_xyz(&Emission::from_rgb(rgb)),
        }));
    }
    cases
}

#[test]
fn xyz_agrees_with_colour_science() {
    let Some(python) = python() else { return };
    let answers = check(&python, &cases());
    let mut worst = 0.0_f64;
    for answer in &answers {
        let delta_e = answer["delta_e"].as_f64().unwrap();
        let relative = answer["relative"].as_f64().unwrap();
        // sRGB: the standard's white (0.3127, 0.3290) is not exactly that of the D65 table.
        let (delta_e_limit, relative_limit) = match answer["kind"].as_str().unwrap() {
            "samples" => (1e-6, 1e-9),
            "srgb" => (0.05, 1e-3),
            _ => (0.01, 1e-4),
        };
        assert!(
            delta_e < delta_e_limit && relative < relative_limit,
            "{answer}"
        );
        worst = worst.max(delta_e);
    }
    println!(
        "{} colors, largest CIEDE2000 difference {worst:.2e}",
        answers.len()
    );
}

/// The same numbers, frozen: needs no Python.
#[test]
fn xyz_agrees_with_the_frozen_values() {
    let expected = include_str!("expected.csv");
    let cases = cases();
    let mut seen = 0;
    for row in expected.lines().filter(|l| !l.starts_with('#')).skip(1) {
        let mut fields = row.split(',');
        let name = fields.next().unwrap();
        let want: Vec<f64> = fields.map(|f| f.parse().unwrap()).collect();
        let case = cases.iter().find(|c| c["name"] == name).unwrap();
        let largest = want.iter().copied().fold(0.0, f64::max);
        for (c, want) in want.iter().enumerate() {
            let got = case["xyz"][c].as_f64().unwrap();
            assert!((got - want).abs() < 1e-4 * largest, "{name}: {got} {want}");
        }
        seen += 1;
    }
    assert_eq!(seen, 6 + 5 + 24 * 3);
}

#[test]
fn the_check_finds_a_wrong_color() {
    let Some(python) = python() else { return };
    let mut cases = cases();
    cases.truncate(1);
    cases[0]["xyz"][0] = json!(cases[0]["xyz"][0].as_f64().unwrap() * 1.001);
    assert!(check(&python, &cases)[0]["delta_e"].as_f64().unwrap() > 0.01);
}
