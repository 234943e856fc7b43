//! Strange and damaged images: right, or refused by name.

use abbe::io::image_file::{Decoded, Encoding, decode};
use std::path::Path;

fn read(case: &str) -> Result<Decoded, String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/models/cases")
        .join(case);
    decode(
        &std::fs::read(path).expect("the case is there"),
        Encoding::Stated,
    )
}

fn texel(case: &str, x: usize, y: usize) -> [f32; 3] {
    let decoded = read(case).unwrap_or_else(|e| panic!("{case}: {e}"));
    let [r, g, b, _] = decoded.image.texel(0, x, y);
    [r, g, b]
}

#[track_caller]
fn near(found: [f32; 3], expected: [f32; 3], tolerance: f32) {
    for c in 0..3 {
        assert!(
            (found[c] - expected[c]).abs() <= tolerance,
            "{found:?}, expected {expected:?}"
        );
    }
}

#[test]
fn open_exr_of_all_kinds_is_one_color() {
    let color = [0.5, 0.25, 0.125];
    for (file, tolerance) in [
        ("piz_half", 1e-6),
        ("pxr24_half", 1e-6),
        ("tiled", 1e-6),
        ("dwaa_half", 2e-3),
    ] {
        near(
            texel(&format!("exr-kinds/{file}.exr"), 0, 0),
            color,
            tolerance,
        );
    }
    let gray = texel("exr-kinds/y_only.exr", 1, 0);
    assert!(gray[0] == gray[1] && gray[1] == gray[2]);
    let error = read("exr-kinds/layered.exr").expect_err("no plain colors");
    assert!(
        error.starts_with("no channels R, G, B (there: ") && error.contains("ViewLayer.Combined.R"),
        "{error}"
    );
}

#[test]
fn open_exr_with_other_primaries_is_converted() {
    near(
        texel("exr-chromaticities/srgb.exr", 0, 0),
        [0.5, 0.25, 0.125],
        1e-6,
    );
    // XYZ 0.3345 0.2973 0.1418, as linear sRGB by the matrix of IEC 61966-2-1
    let [x, y, z] = [0.3345, 0.2973, 0.1418];
    let expected = [
        3.2406 * x - 1.5372 * y - 0.4986 * z,
        -0.9689 * x + 1.8758 * y + 0.0415 * z,
        0.0557 * x - 0.2040 * y + 1.0570 * z,
    ];
    near(texel("exr-chromaticities/p3.exr", 0, 0), expected, 1e-3);
}

#[test]
fn the_display_window_is_the_image() {
    let case = "damaged/exr_data_window.exr";
    let image = read(case).expect("valid").image;
    assert_eq!((image.width(), image.height()), (16, 8));
    let red: usize = (0..128)
        .filter(|i| image.texel(0, i % 16, i / 16)[0] > 0.1)
        .count();
    assert_eq!(red, 8);
    assert!(texel(case, 6, 3)[0] > 0.1 && texel(case, 9, 4)[0] > 0.1);
}

#[test]
fn what_is_no_number_is_refused_with_its_texel() {
    let error = read("damaged/exr_nan.exr").expect_err("not a number");
    assert!(error.ends_with(": infinite or not a number"), "{error}");
}

#[test]
fn jpeg_is_what_libjpeg_has() {
    let image = read("damaged/jpeg_scan_per_component.jpg")
        .expect("valid")
        .image;
    let mut sums = [0.0f64; 3];
    for i in 0..image.width() * image.height() {
        let texel = image.texel(0, i % image.width(), i / image.width());
        for (sum, linear) in sums.iter_mut().zip(texel) {
            let v = f64::from(linear);
            let encoded = if v <= 0.003_130_8 {
                12.92 * v
            } else {
                1.055 * v.powf(1.0 / 2.4) - 0.055
            };
            *sum += 255.0 * encoded;
        }
    }
    let count = (image.width() * image.height()) as f64;
    for (sum, expected) in sums.iter().zip([118.8, 155.8, 167.4]) {
        assert!((sum / count - expected).abs() < 0.6, "{sums:?}");
    }
    for (case, message) in [
        (
            "damaged/jpeg_cut_in_scan.jpg",
            "not a readable JPEG image (a scan is cut short)",
        ),
        (
            "damaged/jpeg_error_of_two_lines.jpg",
            "not a readable JPEG image (it is cut short)",
        ),
    ] {
        assert_eq!(read(case).err().as_deref(), Some(message), "{case}");
    }
}

#[test]
fn limits_of_a_key_hold_for_the_texels_that_stand_for_it() {
    let folder = tempfile::tempdir().expect("folder");
    let header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 3\n";
    // 1, 2 and 0.5 in all channels
    let texels = [
        [128, 128, 128, 129],
        [128, 128, 128, 130],
        [128, 128, 128, 128],
    ];
    let bytes = [header.as_bytes(), texels.as_flattened()].concat();
    std::fs::write(folder.path().join("x.hdr"), bytes).expect("file");
    let load = |material: &str| {
        let text = format!(
            "[[sensor]]\nresolution = [2, 2]\nperspective = {{ eye = [0, 0, 9], target = [0, 0, 0], fov_deg = 30 }}\n\
             [material.m]\n{material}\n[[object]]\nquad = {{ center = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }}\n\
             material = \"m\"\n[[light]]\nenvironment = {{ radiance = 1 }}\n"
        );
        abbe::io::scene_file::parse_str(&text, folder.path()).map(|_| ())
    };
    let texture = "{ texture = { file = \"x.hdr\" } }";
    for material in [
        format!("diffuse = {{ reflectance = {texture} }}"),
        format!("conductor = {{ metal = \"Au\", roughness = {texture} }}"),
    ] {
        let error = load(&material).expect_err(&material).to_string();
        let expected = "file \"x.hdr\": 1 texel is above 1 after the factor 1 (allowed: 0 to 1), the first at column 1, row 0";
        assert!(error.contains(expected), "{material}: {error}");
    }
    let half = "diffuse = { reflectance = { texture = { file = \"x.hdr\" }, scale = 0.5 } }";
    load(half).unwrap_or_else(|e| panic!("{e}"));
}
