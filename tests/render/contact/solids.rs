//! Solids that are not what they seem, and media that are named.

use super::super::harness::scene;
use abbe::io::scene_file::parse_str;
use abbe::scene::{BuildError, Scene};
use std::path::Path;

fn build(text: &str) -> Result<Scene, BuildError> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/render");
    let loaded = parse_str(text, &folder).unwrap_or_else(|e| panic!("{e}"));
    Scene::build(loaded.description)
}

const WEDGE: &str = r#"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [4, 4]
perspective = { eye = [0.4, 0.6, 4], target = [0, 0, 0], fov_deg = 40 }
[medium.glass]
ior = 1.5
absorption = { color = [0.9, 0.5, 0.3], distance = 1 }
[material.clear]
dielectric = {}
[[object]]
name = "block"
mesh = { obj = "assets/FILE.obj" }
transform = [{ scale = [0.5, 0.7, 0.6] }, { euler_deg = [20, 30, 0] }]
material = "clear"
interior = "glass"
[[light]]
environment = { radiance = 1 }
"#;

/// A closed mesh wound inwards is the same solid, and a note says that it was turned.
#[test]
fn a_mesh_wound_inwards_is_turned() {
    let found = ["cube", "cube_inward"].map(|file| {
        let (scene, settings) = scene(&WEDGE.replace("FILE", file));
        let settings = super::with(&settings, super::Path);
        let found = super::measure(&scene, &settings, 4, 20, &[]);
        (found.y.mean, scene.notes.clone())
    });
    let [(outward, no_notes), (inward, notes)] = found;
    assert!(no_notes.is_empty(), "{no_notes:?}");
    assert_eq!(notes.len(), 1);
    assert!(
        notes[0].contains("\"block\"") && notes[0].contains("inside out"),
        "{notes:?}"
    );
    // the same numbers draw the same paths
    assert!(
        (outward / inward - 1.0).abs() < 1e-9,
        "{outward} and {inward}"
    );
}

/// Two detectors in one place are refused by both names.
#[test]
fn two_detectors_in_one_place_are_refused() {
    let detector = |name: &str, z: f64, more: &str| {
        format!(
            "[[sensor]]\nname = \"{name}\"\nresolution = [1, 1]\ndetector = {{ center = [0, 0, {z}], normal = [0, 0, 1], width = 1, height = 1{more} }}\n"
        )
    };
    let light = "[[light]]\npoint = { position = [0, 0, 1], intensity = 1 }\n";
    let text = |z, more| detector("one", 0.0, "") + &detector("two", z, more) + light;
    let error = build(&text(0.0, ""))
        .map(|_| ())
        .expect_err("both in one place");
    let message = error.to_string();
    assert!(
        message.contains("\"one\"") && message.contains("\"two\""),
        "{message}"
    );
    assert!(build(&text(0.0, ", transparent = true")).is_ok());
    assert!(build(&text(-1e-6, "")).is_ok());
}

/// A named medium is checked where rays can tell, and taken where they cannot.
#[test]
fn named_media_are_checked_and_taken() {
    let text = |medium: &str, half: f64| {
        format!(
            r#"
[medium.glass]
ior = 1.5
[material.clear]
dielectric = {{}}
[[object]]
box = {{ min = [-1, -1, -1], max = [{half}, 1, 1] }}
material = "clear"
interior = "glass"
[[sensor]]
name = "inside"
resolution = [1, 1]
{medium}
detector = {{ center = [0, 0, 0], normal = [0, 0, 1], width = 1, height = 1 }}
[[light]]
environment = {{ radiance = 1 }}
"#
        )
    };
    let stack = |text: &str| build(text).map(|scene| scene.sensors[0].stack.medium());
    let there = stack(&text("", 1.0)).expect("the detector is in glass");
    assert_eq!(stack(&text("medium = \"glass\"", 1.0)), Ok(there));
    let wrong = stack(
        &text("medium = \"air\"", 1.0)
            .replace("[medium.glass]", "[medium.air]\nior = 1\n[medium.glass]"),
    );
    let message = wrong.map(|_| ()).expect_err("it is not in air").to_string();
    assert!(
        message.contains("\"inside\"")
            && message.contains("\"glass\"")
            && message.contains("\"air\""),
        "{message}"
    );
    // the end of the glass cuts the detector
    assert!(matches!(
        stack(&text("", 0.2)),
        Err(BuildError::UnclearMedium { .. })
    ));
    assert_eq!(stack(&text("medium = \"glass\"", 0.2)), Ok(there));
}

/// A lamp that emits into two media is refused; so are more surfaces in a place than are told
/// apart.
#[test]
fn what_cannot_be_decided_where_things_touch_is_refused() {
    let head = r#"
[medium.glass]
ior = 1.5
[material.clear]
dielectric = {}
[material.gray]
diffuse = { reflectance = 0.5 }
[[sensor]]
resolution = [1, 1]
perspective = { eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 40 }
[[object]]
name = "block"
box = { min = [-1, -1, -1], max = [1, 1, 0] }
material = "clear"
interior = "glass"
[[object]]
name = "lamp"
quad = { center = [0, 0, HEIGHT], u = [0.5, 0, 0], v = [0, 0.5, 0] }
emission = 1
two_sided = SIDES
"#;
    let lamp = |height: &str, sides: &str| {
        build(&head.replace("HEIGHT", height).replace("SIDES", sides)).map(|_| ())
    };
    assert_eq!(lamp("0", "false"), Ok(()));
    assert_eq!(lamp("0.1", "true"), Ok(()));
    assert_eq!(lamp("-0.5", "true"), Ok(()));
    let message = lamp("0", "true").expect_err("glass behind it").to_string();
    assert!(message.contains("\"lamp\""), "{message}");

    let sheets = |count: usize| {
        let sheet = |i: usize| {
            let half = 0.5 + 0.1 * i as f64;
            format!(
                "[[object]]\nname = \"sheet {i}\"\nquad = {{ center = [{}, 0, 0], u = [{half}, 0, 0], v = [0, {half}, 0] }}\nmaterial = \"gray\"\n",
                0.05 * i as f64
            )
        };
        let text: String = (0..count).map(sheet).collect();
        build(&(head.replace("HEIGHT", "2").replace("SIDES", "false") + &text)).map(|_| ())
    };
    // the block is one of them
    assert_eq!(sheets(7), Ok(()));
    let message = sheets(8).expect_err("nine in a place").to_string();
    assert!(
        message.contains("more than 8") && message.contains("sheet"),
        "{message}"
    );
}
