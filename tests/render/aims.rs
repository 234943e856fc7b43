//! Chains that are solved for: alone, in the sum, and in every lane.

use super::equality::compare;
use super::harness::{measure, measure_under, scene, scene_in};
use abbe::scene::Settings;
use abbe::scene::settings::Aiming;
use abbe::transport::aim::tries::{Origin, Tries};
use std::path::Path;

fn aimed(settings: &Settings, aim: Aiming, lanes: usize) -> Settings {
    Settings {
        aim,
        lanes,
        ..settings.clone()
    }
}

/// A dispersive ball between a floor and a small lamp.
const BALL: &str = r#"
    [render]
    max_depth = 5
    filter = "box"
    [[sensor]]
    name = "camera"
    resolution = [24, 18]
    perspective = { eye = [0, 4, 8], target = [0, 0.5, 0], fov_deg = 40 }
    [medium.flint]
    glass = "schott:N-SF11"
    [material.floor]
    diffuse = { reflectance = 0.6 }
    [material.glass]
    dielectric = {}
    [[object]]
    name = "floor"
    quad = { center = [0, 0, 0], u = [0, 0, 5], v = [5, 0, 0] }
    material = "floor"
    [[object]]
    name = "ball"
    sphere = { center = [0, 1.2, 0], radius = 1 }
    material = "glass"
    interior = "flint"
    [[object]]
    name = "lamp"
    sphere = { center = [0.5, 5, 0.3], radius = 0.3 }
    material = "floor"
    emission = 20
"#;

/// Another shape in place of the ball of [`BALL`].
fn with_shape(shape: &str) -> String {
    let ball = "sphere = { center = [0, 1.2, 0], radius = 1 }";
    assert!(BALL.contains(ball));
    BALL.replace(ball, shape)
}

/// Lengths of the text before the ball, and before the lamp behind it.
fn before_ball_and_lamp() -> [usize; 2] {
    ["ball", "lamp"].map(|name| {
        let head = format!("    [[object]]\n    name = \"{name}\"");
        BALL.find(&head).expect("is there")
    })
}

/// The ball pressed flat.
fn flat() -> String {
    with_shape(
        r#"sphere = { center = [0, 0, 0], radius = 1 }
    transform = [
        { scale = [1.2, 0.4, 0.9] },
        { rotate = { axis = [1, 0, 1], deg = 20 } },
        { translate = [0, 1.2, 0] },
    ]"#,
    )
}

/// A lens in place of it.
fn lens() -> String {
    let [ball, lamp] = before_ball_and_lamp();
    let lens = r#"
    [[lens]]
    name = "lens"
    surface = [
        { radius = 1500, thickness = 300, glass = "schott:N-SF11", semi_diameter = 600 },
        { radius = -1500, semi_diameter = 600 },
    ]
    transform = [{ rotate = { axis = [1, 0, 0], deg = 90 } }, { translate = [0, 1.4, 0] }]
"#;
    [&BALL[..ball], lens, &BALL[lamp..]].concat()
}

/// A coarse mesh in place of it, whose normals are interpolated.
fn pebble() -> String {
    with_shape(
        r#"mesh = { obj = "assets/smooth_sphere.obj" }
    transform = [{ scale = [1.2, 0.5, 0.9] }, { translate = [0, 1.2, 0] }]"#,
    )
}

/// A glass block in place of it, as a box or as a mesh.
fn block(shape: &str) -> String {
    with_shape(&format!(
        "{shape}\n    transform = [{{ scale = [0.9, 0.6, 0.8] }}, {{ euler_deg = [20, 30, 40] }}, {{ translate = [0, 1.3, 0] }}]"
    ))
}

#[test]
fn facets_of_a_mesh_are_solved_for_like_faces_of_a_box() {
    let shapes = [
        "mesh = { obj = \"assets/cube.obj\" }",
        "box = { min = [-1, -1, -1], max = [1, 1, 1] }",
    ];
    // light and view through the block
    let classes = ["LSSDE", "LDSSE"];
    let mut kinds = Vec::new();
    for shape in shapes {
        let (scene, settings) = scene(&block(shape));
        kinds.push(scene.chains().kinds().len());
        let plain = measure(&scene, &aimed(&settings, Aiming::Off, 4), 16, 60, &classes);
        let found = measure(&scene, &aimed(&settings, Aiming::All, 4), 16, 12, &classes);
        for (i, class) in classes.iter().enumerate() {
            compare(shape, class, &found.classes[i], &plain.classes[i], 0.12);
        }
    }
    assert_eq!(kinds[0], kinds[1]);
    assert!(kinds[0] > 60, "{kinds:?}");
}

#[test]
fn the_sky_is_a_light_that_chains_lead_to() {
    let [_, lamp] = before_ball_and_lamp();
    let text = format!(
        "{}    [[light]]\n    environment = {{ radiance = 1 }}\n",
        &BALL[..lamp]
    );
    let (scene, settings) = scene(&text);
    let classes = ["LSSDE", "LDSSE", "LSDE"];
    let plain = measure(&scene, &aimed(&settings, Aiming::Off, 4), 16, 100, &classes);
    let found = measure(&scene, &aimed(&settings, Aiming::All, 4), 16, 24, &classes);
    for (i, class) in classes.iter().enumerate() {
        compare("sky", class, &found.classes[i], &plain.classes[i], 0.05);
    }
    let tried = |s, t| found.strategies[&("LSSDE".to_owned(), s, t)].0;
    // by the aim alone
    tried(1, 2).assert_is("sky through the ball", plain.classes[0].mean, 0.1);
}

#[test]
fn chains_that_may_be_missed_agree_with_joins() {
    // the lens is small as the camera sees it
    let cases = [
        ("ellipsoid", flat(), &["LSSDE", "LDSSE"][..]),
        ("lens", lens(), &["LSSDE"][..]),
        ("mesh", pebble(), &["LSSDE", "LDSSE"][..]),
    ];
    for (what, text, classes) in cases {
        let (scene, settings) = scene(&text);
        let kinds = scene.chains().kinds();
        assert!(kinds.iter().any(|kind| kind.len() == 2), "{what}");
        let plain = measure(&scene, &aimed(&settings, Aiming::Off, 4), 16, 80, classes);
        let found = measure(&scene, &aimed(&settings, Aiming::All, 4), 16, 14, classes);
        for (i, class) in classes.iter().enumerate() {
            compare(what, class, &found.classes[i], &plain.classes[i], 0.12);
        }
    }
}

#[test]
fn a_lamp_in_glass_seen_through_glass_needs_no_cone() {
    let bench = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/bench");
    let text = std::fs::read_to_string(bench.join("sds_point.toml")).expect("in the repository");
    let text = text.replace("[400, 300]", "[40, 30]");
    let (scene, settings) = scene_in(&bench, &text);
    let settings = aimed(&settings, Aiming::Auto, 1);
    let measured = measure(&scene, &settings, 16, 8, &["LSDSSE"]);
    // two independent computations of the same film: 0.2545 +- 0.0006, 0.2562 +- 2.8 %
    measured.classes[0].assert_is("lamp in a ball through a slab", 0.2545, 6e-3);
    for key in [(1, 4), (3, 1)] {
        let (raw, _) = &measured.strategies[&("LSDSSE".to_owned(), key.0, key.1)];
        raw.assert_is("by one aim alone", 0.2545, 1.5e-2);
    }
}

#[test]
fn aims_agree_with_joins_in_every_lane() {
    let (scene, settings) = scene(BALL);
    // the caustic, the floor through the ball, and off it
    let classes = ["LSSDE", "LDSSE", "LDSE", "LSDE"];
    let plain = measure(&scene, &aimed(&settings, Aiming::Off, 4), 16, 400, &classes);
    for lanes in [1, 4] {
        let settings = aimed(&settings, Aiming::All, lanes);
        let found = measure(&scene, &settings, 16, 28, &classes);
        for (i, class) in classes.iter().enumerate() {
            let what = format!("{class}, {lanes} lanes");
            compare("ball", &what, &found.classes[i], &plain.classes[i], 0.08);
        }
    }
}

#[test]
fn how_often_chains_are_tried_changes_no_mean() {
    let (scene, settings) = scene(BALL);
    let classes = ["LSSDE", "LDSSE"];
    let kinds = scene.chains().kinds().len();
    let plain = measure(&scene, &aimed(&settings, Aiming::Off, 4), 16, 120, &classes);
    let settings = aimed(&settings, Aiming::All, 4);
    let is_light = |origin| {
        matches!(
            origin,
            Origin::Vertex {
                at_sensor: true,
                ..
            }
        )
    };
    let is_camera = |origin| {
        matches!(
            origin,
            Origin::Vertex {
                at_sensor: false,
                ..
            }
        )
    };
    let check = |what: &str, share: &dyn Fn(Origin, usize) -> f32| {
        let of = |origin| (0..kinds).map(move |kind| share(origin, kind));
        let shares: Vec<f32> = Origin::all().flat_map(of).collect();
        let tries = Tries::new(kinds, shares).expect("one for each");
        let found = measure_under(&scene, &settings, (16, 24), &classes, |choices| {
            choices.tries.as_mut().expect("chains are solved for").tries = tries.clone();
        });
        for (i, class) in classes.iter().enumerate() {
            let what = format!("{class}, {what}");
            compare("ball", &what, &found.classes[i], &plain.classes[i], 0.035);
        }
    };
    check("a quarter of the tries", &|_, _| 0.25);
    check("all tries", &|_, _| 1.0);
    check("from camera vertices", &|origin, _| {
        f32::from(u8::from(is_camera(origin)))
    });
    check("from light vertices", &|origin, _| {
        f32::from(u8::from(is_light(origin)))
    });
    check("every second kind", &|_, kind| 0.5 * (kind % 2) as f32);
}
