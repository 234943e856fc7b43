//! Image files of the program, read back by the reference library.

use crate::python::{python, read_exr};
use crate::rendered::render_crop;
use abbe::film::Crop;
use abbe::render::OutputRequest;
use abbe::spectrum::SpectralChannels;
use serde_json::{Value, json};
use std::process::Command;

const SCENE: &str = r#"
[render]
spp = 3
max_depth = 3
[[sensor]]
resolution = [13, 7]
perspective = { eye = [0, 0, 3], target = [0, 0, 0], fov_deg = 40 }
[material.gray]
diffuse = { reflectance = 0.5 }
[[object]]
sphere = { radius = 0.7 }
material = "gray"
[[light]]
environment = { radiance = 1.0 }
[[light]]
directional = { direction = [0, 0, -1], irradiance = { lines = [[587.5618, 20], [632.8, 30]] } }
"#;

/// The pixels that are rendered.
const CROP: Crop = Crop {
    x0: 2,
    y0: 1,
    x1: 11,
    y1: 6,
};

/// Whether a channel holds these 32-bit floats.
fn holds(file: &Value, channel: &str, values: impl Iterator<Item = f64>) -> bool {
    let found = &file["channels"][channel];
    let values: Vec<f32> = values.map(|v| v as f32).collect();
    let read: Vec<f32> = found["values"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap() as f32)
        .collect();
    found["type"] == "float32"
        && found["shape"] == json!([CROP.height(), CROP.width()])
        && read == values
}

fn names(file: &Value) -> Vec<&str> {
    file["channels"]
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect()
}

#[test]
fn the_reference_library_reads_what_was_rendered() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_abbe"))
        .current_dir(folder.path())
        .args("render scene.toml --crop 2,1,11,6 --aov error --spectral 4 -q".split(' '))
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let [image, spectral] = ["scene.exr", "scene.spectral.exr"]
        .map(|name| read_exr(&python, &folder.path().join(name)));

    let lines = [587.5618, 632.8];
    let channels = SpectralChannels::new([360.0, 830.0], 4, lines.to_vec());
    let request = OutputRequest {
        spectral: Some(channels),
        ..OutputRequest::default()
    };
    let rendered = render_crop(SCENE, Some(CROP), &request);
    assert!(rendered.xyz.iter().any(|pixel| pixel[1] > 0.0));
    assert_eq!(names(&image), ["X", "Y", "Z", "error.Y"]);
    for (c, name) in ["X", "Y", "Z"].into_iter().enumerate() {
        assert!(
            holds(&image, name, rendered.xyz.iter().map(|pixel| pixel[c])),
            "{name}"
        );
    }
    let channels = [
        "S0.418,75nm",
        "S0.536,25nm",
        "S0.653,75nm",
        "S0.771,25nm",
        "line.S0.587,5618nm",
        "line.S0.632,8nm",
    ];
    assert_eq!(names(&spectral), channels);
    for (c, name) in channels.into_iter().enumerate() {
        assert!(
            holds(
                &spectral,
                name,
                rendered.spectral.iter().map(|pixel| pixel[c])
            ),
            "{name}"
        );
    }

    let third = f64::from(1.0_f32 / 3.0);
    for file in [&image, &spectral] {
        let header = &file["header"];
        for (name, value) in [
            (
                "chromaticities",
                json!([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, third, third]),
            ),
            ("compression", json!("Compression.ZIP_COMPRESSION")),
            ("dataWindow", json!([[2, 1], [10, 5]])),
            ("displayWindow", json!([[0, 0], [12, 6]])),
            ("lineOrder", json!("LineOrder.INCREASING_Y")),
            ("pixelAspectRatio", json!(1.0)),
            ("screenWindowCenter", json!([0.0, 0.0])),
            ("screenWindowWidth", json!(1.0)),
            ("abbeVersion", json!(env!("CARGO_PKG_VERSION"))),
            ("integrator", json!("bdpt")),
            ("observer", json!("CIE 1931 2 degree")),
            ("passes", json!("0..3")),
            ("seed", json!("0")),
        ] {
            assert_eq!(header[name], value, "{name}");
        }
        assert!(header["sceneHash"].is_string() && header["wavelengths"].is_string());
    }
    assert!(image["header"]["unit"].is_string());
    assert_eq!(spectral["header"]["spectralLayoutVersion"], "1.0");
    assert_eq!(spectral["header"]["emissiveUnits"], "W.m^-2.sr^-1");
}
