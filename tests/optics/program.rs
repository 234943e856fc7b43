//! The walk of a user: look a lens up, draw it, look a glass up, add a catalog.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn abbe(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_abbe"))
        .args(arguments)
        .current_dir(folder)
        .env_remove("ABBE_GLASS_PATH")
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn a_lens_is_shown_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let file = super::root().join("scenes/lenses/achromat.zmx");
    let file = file.to_str().unwrap();
    let drawings = [
        "--drawing",
        "cut.svg",
        "--spots",
        "spots.svg",
        "--fans",
        "fans.svg",
    ];
    let output = abbe(
        folder.path(),
        &[&["lens", file, "--json"][..], &drawings].concat(),
    );
    assert!(output.status.success(), "{}", text(&output.stderr));
    let value: Value = serde_json::from_slice(&output.stdout).unwrap();
    let d = &value["first_order"][1];
    assert!((d["efl"].as_f64().unwrap() - 100.0698).abs() < 1e-4);
    // a singlet of N-BK7 has F and C f / V = 1.56 mm apart
    let shift = |i: usize| value["chromatic_focal_shift"][i]["shift"].as_f64().unwrap();
    assert!((shift(0) - shift(2)).abs() < 1.56 / 8.0);
    assert_eq!(value["spots"].as_array().unwrap().len(), 9);
    for (name, least) in [("cut.svg", 15), ("spots.svg", 9 * 817), ("fans.svg", 18)] {
        let svg = std::fs::read_to_string(folder.path().join(name)).unwrap();
        let marks = svg.matches("<path").count() + svg.matches("<circle").count();
        assert!(
            svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>") && marks >= least,
            "{name} {marks}"
        );
    }
    let coated = abbe(
        folder.path(),
        &[
            "lens",
            file,
            "--json",
            "--coating",
            "mgf2",
            "--wavelengths",
            "d",
            "--fields",
            "0",
        ],
    );
    let coated: Value = serde_json::from_slice(&coated.stdout).unwrap();
    let through = |v: &Value| v["transmission"][0]["surfaces"].as_f64().unwrap();
    assert!(
        through(&coated) > through(&value) + 0.04,
        "{} {}",
        through(&coated),
        through(&value)
    );
    for (arguments, code, part) in [
        (&["--coating", "gold"][..], 2, "there is no coating `gold`"),
        (&["--coating", "silver"], 2, "lets no light through"),
        (&["--wavelengths", "q"], 2, "neither F, d, C nor nanometers"),
        (&["--fields", "1:2:3"], 2, "neither Y nor X:Y"),
        (&["--wavelengths", "150"], 1, "has data for"),
    ] {
        let output = abbe(folder.path(), &[&["lens", file][..], arguments].concat());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn ghosts_are_listed_by_power() {
    let folder = tempfile::tempdir().unwrap();
    let file = super::root().join("scenes/lenses/double_gauss.zmx");
    let file = file.to_str().unwrap();
    let run = |more: &[&str]| {
        let arguments = ["lens", file, "--fields", "0,10", "--ghosts", "4"];
        let output = abbe(folder.path(), &[&arguments[..], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let power = |field: &Value| field["power"].as_f64().unwrap();
    let bare: Value = serde_json::from_str(&run(&["--json"])).unwrap();
    let coated: Value = serde_json::from_str(&run(&["--json", "--coating", "broadband"])).unwrap();
    for i in 0..2 {
        let field = &bare["ghosts"][i];
        let powers: Vec<f64> = field["ghosts"]
            .as_array()
            .unwrap()
            .iter()
            .map(power)
            .collect();
        assert!(
            powers.len() == 4 && powers.is_sorted_by(|a, b| a >= b),
            "{powers:?}"
        );
        assert!(powers.iter().sum::<f64>() < power(field));
        assert!(power(&coated["ghosts"][i]) < 0.2 * power(field));
    }
    let sequence = bare["ghosts"][0]["ghosts"][0]["sequence"].as_str().unwrap();
    // the diaphragm, surface 6, is no glass
    assert!(
        sequence.starts_with("L T(1) ")
            && sequence.ends_with(" T(11) E")
            && !sequence.contains("(6)"),
        "{sequence}"
    );
    let table = run(&[]);
    assert!(table.contains("reflected by") && table.contains(&format!("--sequence '{sequence}'")));
}

#[test]
fn glasses_are_found_by_other_names_and_in_folders() {
    let folder = tempfile::tempdir().unwrap();
    for (name, part) in [
        ("acrylic", "material:PMMA"),
        ("silica", "material:FUSED-SILICA"),
        ("hoya:FCD11", "hoya:FCD1"),
    ] {
        let output = abbe(folder.path(), &["glass", name]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1));
        assert!(
            message.contains(part) && message.contains("catalogs: cdgm, hikari, hoya"),
            "{message}"
        );
    }
    let agf = "NM A1 2 0 1.5 60 0\nCD 1.25 0.01 0 0 0 0\nLD 0.3 2.5\n";
    std::fs::write(folder.path().join("lab.agf"), agf).unwrap();
    let output = abbe(folder.path(), &["glass", "lab:A1", "--glass-path", "."]);
    assert!(
        text(&output.stdout).starts_with("lab:A1\n"),
        "{}",
        text(&output.stderr)
    );
    std::fs::write(folder.path().join("lab.agf"), "NM A1 99\n").unwrap();
    let output = abbe(folder.path(), &["glass", "lab:A1", "--glass-path", "."]);
    assert!(
        text(&output.stderr).contains("lab.agf:1: dispersion formula 99 (1 to 13)"),
        "{}",
        text(&output.stderr)
    );
}
