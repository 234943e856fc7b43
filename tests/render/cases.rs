//! Files as other programs write them (`tests/models/cases`): each looks as its specification says.

use super::harness::{full_crop, scene_in};
use abbe::io::gltf::PER_NIT;
use abbe::io::scene_file::{self, parse_str};
use abbe::render::{OutputRequest, Render};
use abbe::scene::{Scene, Settings};
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn folder(case: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/models/cases")
        .join(case)
}

/// Y of every pixel after some passes.
fn luminances(scene: &Arc<Scene>, settings: &Settings, passes: u32) -> Vec<f64> {
    let crop = full_crop(scene);
    let mut render = Render::new(scene, 0, settings, crop, &OutputRequest::default());
    for pass in 0..passes {
        render.add_pass(pass);
    }
    let xyz = render.outputs().image.image(u64::from(passes));
    xyz.as_chunks::<3>().0.iter().map(|p| p[1]).collect()
}

/// Y of every pixel of a case's `file`, where `from` stands for `to`.
fn picture(case: &str, file: &str, (from, to): (&str, &str), passes: u32) -> Vec<f64> {
    let folder = folder(case);
    let text = std::fs::read_to_string(folder.join(file)).expect("the case has the file");
    assert!(text.contains(from), "{file} has no {from}");
    let (scene, settings) = scene_in(&folder, &text.replace(from, to));
    luminances(&scene, &settings, passes)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[track_caller]
fn near(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{what}: {found}, expected {expected}"
    );
}

/// Notes on a model of a case, without the model's own name before each line.
fn notes(case: &str, file: &str) -> Vec<String> {
    let loaded = scene_file::load(&folder(case).join(file), &[]).unwrap_or_else(|e| panic!("{e}"));
    let own = |n: &String| n.strip_prefix(&format!("{file}: ")).map(str::to_owned);
    loaded.warnings.iter().filter_map(own).collect()
}

#[test]
fn a_solid_that_is_inside_out_is_turned_and_named() {
    let picture = |obj| picture("inward-solid", "scene.toml", ("outward.obj", obj), 16);
    let (outward, inward) = (picture("outward.obj"), picture("inward.obj"));
    assert!(mean(&outward) > 0.1);
    // the order of corners is another, and with it the numbers of the last digit
    near("Y", mean(&inward), mean(&outward), 1e-3 * mean(&outward));
    let folder = folder("inward-solid");
    let text = std::fs::read_to_string(folder.join("scene.toml")).expect("the case has it");
    let loaded = parse_str(&text.replace("outward", "inward"), &folder).expect("valid");
    let scene = Scene::build(loaded.description).expect("a scene");
    let note = "object \"wedge\": its mesh is inside out";
    assert!(
        scene.notes.iter().any(|n| n.starts_with(note)),
        "{:?}",
        scene.notes
    );
}

#[test]
fn panes_of_mtl_let_through_what_their_statements_say() {
    for (case, own, file, expected) in [
        ("mtl-statements", "halo.obj", "halo.obj", 0.4),
        ("mtl-statements", "halo.obj", "kd_one.obj", 0.75),
        ("mtl-statements", "halo.obj", "ni_one.obj", 1.0),
        ("mtl-d-and-tr", "both_same.obj", "both_same.obj", 0.0),
        ("mtl-d-and-tr", "both_same.obj", "d1_lower.obj", 0.75),
        ("mtl-d-and-tr", "both_same.obj", "opaque_both_max.obj", 0.0),
        ("mtl-d-and-tr", "both_same.obj", "tr075.obj", 0.75),
    ] {
        let found = mean(&picture(case, "scene.toml", (own, file), 64));
        // coverage is a factor of one path: 1024 samples of 0 or 1 are within 0.016 (1 sigma),
        // those of wavelengths alone closer
        near(file, found, expected, 0.065);
    }
}

#[test]
fn what_mtl_and_obj_do_not_say_is_named() {
    assert_eq!(
        notes("mtl-statements", "unknown_usemtl.obj"),
        [
            "halo.mtl:3: material \"pane\": -halo is not read: d 0.6 from all sides",
            "line 6: material \"nowhere\" is in no material file: light gray is used"
        ]
    );
    assert_eq!(notes("mtl-statements", "empty_usemtl.obj"), [""; 0]);
    assert_eq!(
        notes("mtl-statements", "halo.obj"),
        ["halo.mtl:3: material \"pane\": -halo is not read: d 0.6 from all sides"]
    );
    assert_eq!(
        notes("damaged", "obj_vertex_colors.obj"),
        ["line 1: vertex colors are not read (3 times in all)"]
    );
    assert_eq!(
        notes("damaged", "obj_latin1.obj"),
        ["line 4: material \"grün\" is in no material file: light gray is used"]
    );
    let error = scene_file::load(&folder("damaged").join("obj_error_place.obj"), &[]);
    let error = error.expect_err("vertex 9 of 3").to_string();
    let expected = "obj_error_place.obj: line 5: a face refers to vertex 9, but there are 3";
    assert!(error.ends_with(expected), "{error}");
}

/// Triangles of a scene with one mesh.
fn triangles(case: &str, file: &str) -> usize {
    let text = format!(
        "[[sensor]]\nresolution = [2, 2]\nperspective = {{ eye = [0, 0, 9], target = [0, 0, 0], fov_deg = 30 }}\n\
         [[object]]\nmesh = {{ {} = \"{file}\" }}\n[[light]]\nenvironment = {{ radiance = 1 }}\n",
        if file.ends_with("ply") { "ply" } else { "obj" }
    );
    let loaded = parse_str(&text, &folder(case)).unwrap_or_else(|e| panic!("{file}: {e}"));
    match &loaded.description.objects[0].shape {
        abbe::geometry::Shape::Mesh(mesh) => mesh.triangle_count() + mesh.dropped(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn lines_and_points_are_no_surfaces() {
    for file in ["l4.obj", "l5.obj"] {
        assert_eq!(triangles("obj-polylines", file), 1);
        let found = picture("obj-polylines", "scene.toml", ("l4.obj", file), 16);
        // the sky alone, whatever its wavelengths
        near(file, mean(&found), 1.0, 0.02);
    }
}

#[test]
fn continued_lines_and_comments_are_the_same_cube() {
    let files = [
        "plain.obj",
        "wrapped.obj",
        "wrapped_crlf.obj",
        "trailing_comment.obj",
    ];
    let pictures = files.map(|file| {
        assert_eq!(triangles("obj-wrapped-lines", file), 12, "{file}");
        let own = ("wrapped.obj", file);
        picture("obj-wrapped-lines", "scene.toml", own, 2)
    });
    assert!(pictures.iter().all(|p| *p == pictures[0]));
}

#[test]
fn further_values_of_ply_lines_belong_to_no_face() {
    for file in ["plain.ply", "extra_values.ply"] {
        assert_eq!(triangles("ply-extra-values", file), 12, "{file}");
    }
}

#[test]
fn map_coordinates_keep_what_the_file_says() {
    let local = picture(
        "map-coordinates",
        "local.toml",
        ("local.obj", "local.obj"),
        2,
    );
    let utm = picture(
        "map-coordinates",
        "utm_obj.toml",
        ("utm.obj", "utm.obj"),
        16,
    );
    for (i, (a, b)) in local.iter().zip(&utm).enumerate() {
        let row = i / 4;
        // rows in fours: sky, strip
        let sky = row % 8 < 4;
        assert!((*a > 0.5) == sky && (*b > 0.5) == sky, "row {row}: {a} {b}");
    }
}

#[test]
fn an_infinite_index_reflects_all() {
    for (file, expected) in [
        ("ior0.gltf", 1.0),
        ("specgloss.gltf", 0.5),
        ("ior15.gltf", 0.04),
    ] {
        let found = mean(&picture(
            "gltf-ior-zero",
            "scene.toml",
            ("ior0.gltf", file),
            32,
        ));
        // 2048 samples of four wavelengths under a constant sky: the smooth layer alone is seen
        near(file, found, expected, 0.03 * expected);
    }
}

#[test]
fn spots_fall_off_as_the_extension_recommends() {
    let path = folder("gltf-spot-falloff").join("spot.gltf");
    let changes = [
        ("model.0.resolution".to_owned(), "[80, 4]".to_owned()),
        ("render.filter".to_owned(), "\"box\"".to_owned()),
    ];
    let loaded = scene_file::load(&path, &changes).unwrap_or_else(|e| panic!("{e}"));
    let scene = Scene::build(loaded.description).unwrap_or_else(|e| panic!("{e}"));
    let scene = Arc::new(scene);
    let found = luminances(&scene, &loaded.settings, 256);
    for (column, expected) in [
        (40, 31.81),
        (48, 25.51),
        (56, 13.85),
        (64, 4.88),
        (72, 0.826),
    ] {
        let rows = [0, 1, 2, 3].map(|y| found[80 * y + column]);
        // 1024 samples whose wavelengths spread Y by less than its size: 4.5 standard errors of 3 %
        // each are 14 %, and a smooth step gives from 1 % to twice as much
        near("column", mean(&rows) / PER_NIT, expected, 0.1 * expected);
    }
}

#[test]
fn a_file_of_a_camera_alone_is_read() {
    let found = picture(
        "gltf-camera-alone",
        "camera.toml",
        ("camera.gltf", "camera.gltf"),
        16,
    );
    near("center", found[8 * 4 + 4], 1.0, 0.1);
}

#[test]
fn textures_without_an_image_are_named() {
    for (file, expected) in [
        (
            "optional.gltf",
            "texture 0 is not read: its image is named by EXT_texture_webp only",
        ),
        ("blank.gltf", "texture 0 is not read: it has no image"),
    ] {
        let notes = notes("gltf-texture-without-source", file);
        assert!(notes.iter().any(|n| n == expected), "{notes:?}");
    }
    let path = folder("gltf-texture-without-source").join("required.gltf");
    let error = scene_file::load(&path, &[])
        .expect_err("required")
        .to_string();
    assert!(error.contains("not supported: EXT_texture_webp"), "{error}");
}

#[test]
fn chunks_are_found_where_they_are() {
    for file in ["aligned", "extra_after", "unaligned", "unknown_second"] {
        let file = format!("{file}.glb");
        let loaded = scene_file::load(&folder("glb-chunks").join(&file), &[]);
        let loaded = loaded.unwrap_or_else(|e| panic!("{file}: {e}"));
        assert_eq!(loaded.description.objects.len(), 1, "{file}");
    }
}

#[test]
fn turns_do_not_depend_on_the_sign_of_their_quaternions() {
    let files = ["same_sign.gltf", "opposite.gltf", "both_neg.gltf"];
    let pictures = files.map(|file| {
        let own = ("opposite.gltf", file);
        picture("motion-quaternion-sign", "scene.toml", own, 2)
    });
    assert!(pictures.iter().all(|p| *p == pictures[0]));
}

#[test]
fn attenuation_is_that_of_the_distance_in_the_world() {
    for (file, green) in [
        ("att1.gltf", 0.5),
        ("att_mirror.gltf", 0.5),
        ("att_scaled.gltf", 0.25),
    ] {
        let found = mean(&picture(
            "gltf-attenuation",
            "scene.toml",
            ("att1.gltf", file),
            32,
        ));
        // Y of linear sRGB 0.1, 0.5, 0.9, or of the squared spectrum, which is near the squares
        let [r, b] = [0.1f64, 0.9].map(|v| if green < 0.5 { v * v } else { v });
        let expected = 0.2126 * r + 0.7152 * green + 0.0722 * b;
        near(file, found, expected, 0.08 * expected);
    }
}

#[test]
fn mirrored_lamps_shine_to_the_front() {
    let path = folder("gltf-mirrored-lamp").join("mirrored_lamp.gltf");
    let loaded = scene_file::load(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
    let lamps = (loaded.description.objects.iter()).filter(|o| o.emission.is_some());
    let determinants: Vec<bool> = lamps
        .map(|o| o.transform.at(0.0).to_world.matrix3.determinant() > 0.0)
        .collect();
    assert_eq!(determinants.len(), 2);
    assert_ne!(
        determinants[0], determinants[1],
        "one of the two is mirrored"
    );
}
