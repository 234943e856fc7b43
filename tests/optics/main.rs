//! Prescriptions, rays and coatings against optiland, ray-optics and tmm (numbers frozen by
//! `freeze.py` and `freeze_rays.py`), and hostile lens files.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod assembly;
mod mutation;
mod program;

use abbe::io::lens;
use abbe::optics::Polarization;
use abbe::optics::coating::Films;
use abbe::optics::paraxial::Paraxial;
use abbe::optics::{Interaction, Ray, System};
use abbe::spectrum::Library;
use glam::DVec3;
use num_complex::Complex64;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn frozen() -> Value {
    let text = std::fs::read_to_string(root().join("tests/optics/frozen.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn read(path: &Path) -> abbe::optics::Prescription {
    lens::read(path, Library::embedded()).unwrap()
}

fn vector(v: &Value) -> DVec3 {
    let c: Vec<f64> = v
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c.as_f64().unwrap())
        .collect();
    DVec3::new(c[0], c[1], c[2])
}

#[test]
fn paraxial_data_and_real_rays_are_those_of_optiland() {
    let mut points = 0;
    let frozen = frozen();
    let lenses = frozen["lenses"].as_array().unwrap();
    assert!(lenses.len() >= 8);
    for entry in lenses {
        let file = entry["file"].as_str().unwrap();
        let lens = read(&root().join("scenes/lenses").join(file));
        let tilted = lens.surfaces.iter().any(|s| !s.before.is_empty());
        let folded = lens
            .surfaces
            .iter()
            .any(|s| s.interaction == Interaction::Reflect);
        for expected in entry["first_order"].as_array().unwrap() {
            let get = |key: &str| expected[key].as_f64().unwrap();
            let data = Paraxial::new(&lens, get("nm")).first_order();
            // optiland's focal length has the sign of the last direction of travel
            let sign = if folded { -1.0 } else { 1.0 };
            if !tilted || folded {
                assert!(
                    (data.efl * sign / get("efl") - 1.0).abs() < 1e-9,
                    "{file} {data:?} {expected}"
                );
                assert!(
                    (data.bfl / get("bfl") - 1.0).abs() < 1e-9,
                    "{file} {data:?} {expected}"
                );
            }
        }
        for at in entry["rays"].as_array().unwrap() {
            let system = System::new(&lens, at["nm"].as_f64().unwrap());
            for row in at["rays"].as_array().unwrap() {
                let ray = Ray {
                    o: vector(&row["o"]),
                    d: vector(&row["d"]),
                };
                let (path, arrived) = system.path(ray, false);
                let expected = row["points"].as_array().unwrap();
                assert!(arrived && path.len() == expected.len(), "{file}");
                for (point, expected) in path.iter().zip(expected) {
                    let error = (*point - vector(expected)).length();
                    assert!(error < 1e-9, "{file}: {point} {expected} {error:e}");
                    points += 1;
                }
            }
        }
    }
    assert!(points > 1500, "{points}");
}

#[test]
fn real_rays_are_those_of_ray_optics() {
    let text = std::fs::read_to_string(root().join("tests/optics/frozen_rays.json")).unwrap();
    let frozen: Value = serde_json::from_str(&text).unwrap();
    let rays = frozen["rays"].as_array().unwrap();
    assert_eq!(rays.len(), 6 * 3 * 8);
    for row in rays {
        let file = row["file"].as_str().unwrap();
        let lens = read(&root().join("scenes/lenses").join(file));
        let system = System::new(&lens, row["nm"].as_f64().unwrap());
        let ray = Ray {
            o: vector(&row["o"]),
            d: vector(&row["d"]),
        };
        let expected = row["points"].as_array().unwrap();
        assert_eq!(expected.len(), lens.surfaces.len());
        let mut met = Vec::new();
        system.trace(ray, false, |e| met.push(e.point)).unwrap();
        for (point, expected) in met.iter().zip(expected) {
            let error = (*point - vector(expected)).length();
            assert!(error < 1e-9, "{file}: {point} {expected} {error:e}");
        }
        assert_eq!(met.len(), expected.len());
    }
}

#[test]
fn coatings_are_those_of_tmm() {
    let frozen = frozen();
    let complex = |v: &Value| Complex64::new(v[0].as_f64().unwrap(), v[1].as_f64().unwrap());
    let rows = frozen["coatings"].as_array().unwrap();
    assert_eq!(rows.len(), 60);
    for row in rows {
        let thick = row["nm_thick"].as_array().unwrap().iter();
        let layers = row["n"].as_array().unwrap().iter().zip(thick);
        let films = Films {
            layers: layers
                .map(|(n, d)| (complex(n), d.as_f64().unwrap()))
                .collect(),
        };
        let cos = row["degrees"].as_f64().unwrap().to_radians().cos();
        let substrate = complex(&row["substrate"]);
        for (key, polarization) in [("s", Polarization::S), ("p", Polarization::P)] {
            let response = films.response(
                row["nm"].as_f64().unwrap(),
                1.0,
                substrate,
                cos,
                polarization,
            );
            let (r, t) = (row[key][0].as_f64().unwrap(), row[key][1].as_f64().unwrap());
            assert!((response.r - r).abs() < 1e-10, "{row} {response:?}");
            // into a metal tmm counts the power of the crossed terms of p too: only reflection is
            // compared there
            if substrate.im == 0.0 {
                assert!((response.t - t).abs() < 1e-10, "{row} {response:?}");
            }
            assert!((response.r + response.t + response.a - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn a_lens_is_the_same_from_code_v_and_from_zemax() {
    let folder = root().join("scenes/lenses");
    let (zmx, seq) = (
        read(&folder.join("cooke_triplet.zmx")),
        read(&folder.join("cooke_triplet.seq")),
    );
    assert_eq!(zmx.surfaces.len(), seq.surfaces.len());
    for (a, b) in zmx.surfaces.iter().zip(&seq.surfaces) {
        assert_eq!(
            (&a.shape, &a.medium, a.thickness),
            (&b.shape, &b.medium, b.thickness)
        );
    }
    assert_eq!(
        (zmx.stop, zmx.primary_nm().round()),
        (seq.stop, seq.primary_nm().round())
    );
}

#[test]
fn bad_lens_files_say_where() {
    let text = std::fs::read_to_string(root().join("scenes/lenses/cooke_triplet.zmx")).unwrap();
    let library = Library::embedded();
    for (from, to, part) in [
        ("GLAS F2", "GLAS F3X", "unknown glass `F3X`"),
        (
            "DIAM 9.5",
            "DIAM 40",
            "the aperture reaches 40 mm from the vertex",
        ),
        ("DISZ 6.00755", "DISZ 0.01", "crosses surface 3"),
        ("DISZ 6.00755", "DISZ nan", "`nan` is not a finite number"),
        (
            "TYPE STANDARD",
            "TYPE FRESNELS",
            "surface type FRESNELS is not read",
        ),
        ("  STOP\n", "", "no surface is the STOP"),
        ("UNIT MM", "UNIT PARSEC", "unit `PARSEC`"),
        ("MODE SEQ", "MODE NSC", "only sequential"),
        ("ENPD 10", "ENPD 0", "entrance pupil diameter 0"),
        ("WAVM 1 0.4861327", "WAVM 1 0.1", "has data for"),
        ("FTYP 0", "FTYP 3", "field type 3"),
    ] {
        assert!(text.contains(from), "{from}");
        let bad = text.replacen(from, to, 1);
        let error = lens::parse(bad.as_bytes(), lens::Format::Zmx, library).unwrap_err();
        assert!(error.message.contains(part), "{from}: {error}");
        assert!(error.line >= 1);
    }
    // line of the glass
    let bad = text.replacen("GLAS F2", "GLAS F3X", 1);
    let line = 1 + bad.lines().position(|l| l.contains("F3X")).unwrap();
    let error = lens::parse(bad.as_bytes(), lens::Format::Zmx, library).unwrap_err();
    assert_eq!(error.line, line);
}
