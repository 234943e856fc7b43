//! Tests of what scene files become, and of how much is told of their faults.

use super::*;
use crate::camera::CameraKind;
use crate::scene::Scene;
use crate::scene::description::WavelengthChoice;
use glam::DVec3;
use std::path::Path;

fn description(text: &str) -> SceneDescription {
    let sensor = "[[sensor]]\nperspective = { eye = [1, 2, 3], target = [1, 2, -7], fov_deg = 90, f_number = 2, \
                  focal_length = 50, focus_distance = 100 }\n";
    let text = format!("unit = \"mm\"\n{sensor}{text}");
    parse_str(&text, Path::new("/nonexistent"))
        .unwrap_or_else(|e| panic!("{e}"))
        .description
}

fn near(a: DVec3, b: [f64; 3]) {
    let off = (a - DVec3::from_array(b)).length();
    assert!(off < 1e-15, "{a} is not {b:?}");
}

#[test]
fn cameras_look_along_minus_z() {
    let scene = description("");
    let CameraKind::Perspective(camera) = &scene.sensors[0].camera.kind else {
        panic!("another kind")
    };
    let to_world = scene.sensors[0].camera.transform().at(0.0).to_world;
    near(
        to_world.transform_point3(DVec3::ZERO),
        [0.001, 0.002, 0.003],
    );
    near(to_world.transform_vector3(DVec3::X), [1.0, 0.0, 0.0]);
    near(to_world.transform_vector3(DVec3::Y), [0.0, 1.0, 0.0]);
    near(to_world.transform_vector3(DVec3::Z), [0.0, 0.0, 1.0]);
    let lens = camera.lens().expect("an aperture");
    assert!((lens.radius_m - 0.0125).abs() < 1e-15 && (lens.focus_distance_m - 0.1).abs() < 1e-15);
}

#[test]
fn canonical_shapes_land_where_the_file_says() {
    let objects = description(
        "[[object]]\ncylinder = { from = [0, 0, 0], to = [4, 0, 0], radius = 1 }\nemission = 1\n\
         [[object]]\nquad = { center = [1, 0, 0], u = [2, 0, 0], v = [0, 3, 0] }\nemission = 1\n\
         [[object]]\nbox = { min = [0, 0, 0], max = [2, 4, 6] }\nemission = 1\n\
         [[object]]\ndisk = { normal = [0, -1, 0], radius = 2 }\nemission = 1\n\
         [[object]]\nsphere = { radius = 1 }\nemission = 1\ntransform = [{ scale = [2, 1, 1] }, { rotate = { axis = [0, 0, 1], deg = 90 } }, { translate = [10, 0, 0] }]\n",
    )
    .objects;
    let at = |i: usize, p: [f64; 3]| {
        let to_world = objects[i].transform.at(0.0).to_world;
        to_world.transform_point3(DVec3::from_array(p))
    };
    near(at(0, [0.0, 0.0, 1.0]), [0.004, 0.0, 0.0]);
    near(at(0, [0.0, 0.0, -1.0]), [0.0; 3]);
    near(at(1, [1.0, 1.0, 0.0]), [0.003, 0.003, 0.0]);
    near(at(2, [-1.0; 3]), [0.0; 3]);
    near(at(2, [1.0; 3]), [0.002, 0.004, 0.006]);
    near(at(3, [0.0, 0.0, 0.5]).normalize(), [0.0, -1.0, 0.0]);
    // scaled, then turned, then moved
    near(at(4, [1.0, 0.0, 0.0]), [0.01, 0.002, 0.0]);
}

#[test]
fn detectors_face_u_cross_v() {
    let text = "[[sensor]]\nname = \"d\"\ndetector = { center = [0, 0, 0], normal = [0, 0, 2], width = 20, height = 10, pitch = 0.5 }\n\
                [render]\nwavelengths = { lines_nm = [656, 486, 656] }\n";
    let scene = description(text);
    let camera = &scene.sensors[1].camera;
    let to_world = camera.transform().at(0.0).to_world;
    near(
        to_world.transform_vector3(DVec3::X).normalize(),
        [1.0, 0.0, 0.0],
    );
    near(
        to_world.transform_vector3(DVec3::Y).normalize(),
        [0.0, 1.0, 0.0],
    );
    let size = camera.resolution();
    assert_eq!([size.width, size.height], [40, 20]);
    assert_eq!(
        scene.wavelengths.choice,
        WavelengthChoice::Lines(vec![486.0, 656.0])
    );
}

/// Memory of a document is told by its text, before there is a document.
#[test]
fn tables_and_lists_are_counted_before_they_are_made() {
    const HEAD: &str = "[[sensor]]\nperspective = { eye = [0, 0, 5], target = [0, 0, 0], fov_deg = 40 }\n\
                        [[light]]\nenvironment = { radiance = 1 }\n";
    for (text, count) in [
        (
            format!("a = [{}]\n{HEAD}", "{b={}},".repeat(400_000)),
            800_007,
        ),
        (format!("a = [{}]\n{HEAD}", "[],".repeat(700_000)), 700_006),
        ("a.b.c = 1\n".repeat(400_000), 800_000),
    ] {
        let error = parse_str(&text, Path::new("/nonexistent")).expect_err("too many");
        let expected = format!(
            "scene:1:1: {count} tables and lists (allowed: at most 600000; a model in glTF holds more objects)"
        );
        assert_eq!(error.to_string(), expected);
    }
    // numbers are none
    let rows: String = (0..30_000).map(|i| format!("[{i}.0, 0.5],\n")).collect();
    let text = format!("{HEAD}x = [{rows}{}]\n", "1.5, ".repeat(700_000));
    let error = parse_str(&text, Path::new("/nonexistent")).expect_err("no key");
    assert!(!error.to_string().contains("tables and lists"), "{error}");
}

#[test]
fn crowds_in_one_place_are_refused() {
    let built = |count| {
        let text = format!(
            "[[sensor]]\nperspective = {{ eye = [0, 0, 5], target = [0, 0, 0], fov_deg = 40 }}\n\
             [[light]]\nenvironment = {{ radiance = 1 }}\n{}",
            "[[object]]\nsphere = { radius = 1 }\n".repeat(count)
        );
        let loaded = parse_str(&text, Path::new("/nonexistent")).expect("valid");
        crate::scene::Scene::build(loaded.description)
    };
    assert!(built(100).is_ok());
    let error = built(1500).expect_err("a crowd").to_string();
    assert!(
        error.ends_with("are two of too many in one place (allowed: 1000000 pairs that touch)"),
        "{error}"
    );
}

#[test]
fn a_hundred_problems_are_told_and_the_others_counted() {
    const COUNT: usize = 20_000;
    let objects: String = (0..COUNT)
        .map(|i| format!("[[object]]\nname = \"o{i}\"\nsphere = {{ radiuss = 1 }}\nemission = 1\n"))
        .collect();
    let text = format!(
        "[[sensor]]\nperspective = {{ eye = [0, 0, 5], target = [0, 0, 0], fov_deg = 40 }}\n{objects}"
    );
    let errors = parse_str(&text, Path::new("/nonexistent")).expect_err("wrong keys");
    assert_eq!(errors.iter().count(), reader::MAX_ERRORS);
    let last = errors.to_string();
    let last = last.lines().next_back();
    assert_eq!(last, Some("... and 19900 more problems"));
}

#[test]
fn a_description_that_is_no_scene_is_told_at_its_place() {
    let text = "[[sensor]]\nperspective = { eye = [0, 0, 5], target = [0, 0, 0], fov_deg = 40 }\nshutter = [0, 1]\n\
                [medium.glass]\nior = 1.5\n[material.clear]\ndielectric = {}\n\
                [[object]]\nsphere = { radius = 1 }\nmaterial = \"clear\"\ninterior = \"glass\"\n\
                [[light]]\npoint = { position = [0, 0, 0], intensity = 1 }\n\
                motion = [{ keys = [{ time = 0, translate = [0, 0, 0] }, { time = 1, translate = [9, 0, 0] }] }]\n";
    let loaded = parse_str(text, Path::new("/nonexistent")).expect("valid by itself");
    let error = Scene::build(loaded.description).expect_err("leaves the glass");
    assert_eq!(
        loaded
            .places
            .build_error(Path::new("a.toml"), &error)
            .to_string(),
        "a.toml:12:1: light \"light 0\" moves from one medium into another while the shutter is open"
    );
}

#[test]
fn a_long_override_is_told_as_far_as_it_is_read_at_a_glance() {
    let text = "[[sensor]]\nperspective = { eye = [0, 0, 5], target = [0, 0, 0], fov_deg = 40 }\n";
    let long = ("sensor.0.resolution".to_owned(), "ö".repeat(10_000));
    let error = read_str(text, "a.toml", Path::new("/nonexistent"), &[long]).expect_err("no size");
    let told = error.to_string();
    let expected = format!("--set sensor.0.resolution={}...: ", "ö".repeat(100));
    assert!(told.starts_with(&expected), "{told}");
}

#[test]
fn numbers_of_messages_are_no_rows_of_zeros() {
    for (value, text) in [
        (0.0, "0"),
        (-1.5, "-1.5"),
        (0.001, "0.001"),
        (1e6, "1000000"),
        (1e300, "1e300"),
        (-2.5e-30, "-2.5e-30"),
        (f64::INFINITY, "inf"),
    ] {
        assert_eq!(error::number_text(value), text);
    }
}
