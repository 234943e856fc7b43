//! Chains that are solved for: alone, in the sum, and in every lane.

use super::equality::compare;
use super::harness::{Measured, measure, measure_under, scene, scene_in};
use abbe::integrator::{SensorJob, Workspace, sample_pixel};
use abbe::scene::regularization::{Reason, decide};
use abbe::scene::settings::{Aiming, Regularize};
use abbe::scene::{Scene, Settings};
use abbe::spectrum::SensorResponse;
use abbe::transport::PassSettings;
use abbe::transport::aim::tries::{Origin, Tries};
use std::path::Path;
use std::sync::Arc;

fn aimed(settings: &Settings, aim: Aiming, lanes: usize) -> Settings {
    Settings {
        aim,
        lanes,
        ..settings.clone()
    }
}

/// Measures with these probabilities of tries, by origin and kind, where chains are solved for.
fn measure_tried(
    scene: &Arc<Scene>,
    settings: &Settings,
    passes: u32,
    classes: &[&str],
    share: impl Fn(Origin, usize) -> f32,
) -> Measured {
    let kinds = scene.chains().kinds().len();
    let of = |origin| {
        let share = &share;
        (0..kinds).map(move |kind| share(origin, kind))
    };
    let shares: Vec<f32> = Origin::all().flat_map(of).collect();
    let all = Tries::new(kinds, shares).expect("one for each");
    measure_under(scene, settings, (16, passes), classes, |choices| {
        if let Some(tries) = &mut choices.tries {
            tries.tries = all.clone();
        }
    })
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
fn the_sky_and_a_beam_are_lights_that_chains_lead_to() {
    let beam = "beam = { position = [0.4, 4, -0.2], direction = [-0.1, -1, 0.05], radius = 2, \
                waist = 1.6, irradiance = 3 }";
    // behind a ball, where it is focused, a chain alone has no variance
    let slab = block("box = { min = [-1, -1, -1], max = [1, 1, 1] }");
    for (what, text, light, passes) in [
        ("sky", BALL, "environment = { radiance = 1 }", [60, 14]),
        ("beam", &slab, beam, [40, 12]),
    ] {
        let lamp = text.rfind("    [[object]]").expect("the lamp is the last");
        let text = format!("{}    [[light]]\n    {light}\n", &text[..lamp]);
        let (scene, settings) = scene(&text);
        let classes = ["LSSDE", "LSDE", "LDSSE"];
        let [plain, found] = [Aiming::Off, Aiming::All].map(|aim| {
            let passes = passes[usize::from(aim == Aiming::All)];
            let settings = aimed(&settings, aim, 4);
            measure_tried(&scene, &settings, passes, &classes, |_, _| 1.0)
        });
        for (i, class) in classes.iter().enumerate() {
            compare(what, class, &found.classes[i], &plain.classes[i], 0.08);
        }
        let (alone, _) = found.strategies[&("LSSDE".to_owned(), 1, 2)];
        alone.assert_is(what, plain.classes[0].mean, 0.1);
    }
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
        let found = measure_tried(&scene, &settings, 24, &classes, share);
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

/// Mirrors in the order of their names, and a floor between them under a lamp without extent.
const MIRRORS: &str = r#"
    [render]
    max_depth = 4
    [[sensor]]
    resolution = [8, 8]
    perspective = { eye = [0, 1, 2], target = [0, 0.5, 0], fov_deg = 40 }
    [material.floor]
    diffuse = { reflectance = 0.6 }
    [material.mirror]
    mirror = { reflectance = 0.9 }
    [[object]]
    quad = { center = [0, 0, 0], u = [0, 0, 2], v = [2, 0, 0] }
    material = "floor"
    [[object]]
    name = "left"
    quad = { center = [-2, 1, 0], u = [0, 1, 0], v = [0, 0, 2] }
    material = "mirror"
    [[light]]
    point = { position = [0.3, 1.5, 0], intensity = 1 }
"#;

#[test]
fn cones_are_off_where_chains_make_what_they_would() {
    let right = r#"
    [[object]]
    name = "right"
    quad = { center = [2, 1, 0], u = [0, 1, 0], v = [0, 0, 2] }
    material = "mirror"
"#;
    let ball = r#"
    [[object]]
    sphere = { center = [0, 0.3, 0], radius = 0.3 }
    material = "mirror"
"#;
    // all but the rim of it is behind the mirror on the left
    let rim = r#"
    [[object]]
    disk = { center = [-2.7, 1, -1.5], normal = [0, 0, 1], radius = 1 }
    material = "mirror"
"#;
    let decided = |text: &str, aim: Aiming, max_depth: Option<u32>| {
        let (scene, mut settings) = scene(text);
        settings.regularization.mode = Regularize::Auto;
        let settings = Settings {
            aim,
            max_depth,
            ..settings
        };
        decide(&scene, 0, &settings)
    };
    let facing = format!("{MIRRORS}{right}");
    let reason = decided(MIRRORS, Aiming::Auto, None).reason;
    assert_eq!(reason, Reason::Chains, "light meets one mirror once");
    let reason = decided(&facing, Aiming::Auto, Some(5)).reason;
    assert_eq!(
        reason,
        Reason::Chains,
        "four reflections in a row are listed"
    );
    for (what, text, aim, max_depth) in [
        ("longer rows", &facing, Aiming::Auto, Some(6)),
        ("rows of any length", &facing, Aiming::Auto, None),
        ("a rim", &format!("{MIRRORS}{rim}"), Aiming::Auto, Some(3)),
        ("a ball", &format!("{MIRRORS}{ball}"), Aiming::Auto, Some(3)),
        ("no aims", &MIRRORS.to_owned(), Aiming::Off, None),
    ] {
        let decision = decided(text, aim, max_depth);
        assert!(decision.mode.is_some(), "{what}: {decision}");
    }
}

#[test]
fn chains_are_chosen_by_the_names_that_are_listed() {
    let (scene, _) = scene(BALL);
    let mut scene = Arc::into_inner(scene).expect("nobody else has it");
    let all = scene.chains().kinds().len();
    let names = ["T ball, T ball".to_owned()];
    scene.keep_chains(&names).expect("is listed");
    let kinds = scene.chains().kinds();
    assert!(kinds.len() == 1 && all > 1 && kinds[0].len() == 2);
    assert_eq!(scene.chains().find(&kinds[0]), Some(0));
    let wrong = scene.keep_chains(&["T ball, T bull".to_owned()]);
    let message = wrong.expect_err("there is no bull").to_string();
    assert_eq!(
        message,
        "no kind of chains is called `T ball, T bull` (did you mean `T ball, T ball`?)"
    );
    assert_eq!(scene.chains().kinds().len(), 1);
}

/// Contributions of chains near a fold, whose density is without bound, are no larger than those
/// that light sub-paths make there.
#[test]
fn no_weighted_chain_is_larger_than_what_light_sub_paths_bring() {
    let (scene, settings) = scene(BALL);
    let settings = aimed(&settings, Aiming::All, 4);
    let crop = scene.sensors[0].whole_film();
    let mut job = SensorJob::new(&scene, 0, &settings, &crop, false);
    job.detailed = true;
    let mut workspace = Workspace::default();
    let (mut chains, mut splats) = ([0.0_f64; 2], 0);
    for index in 0..60 {
        let pass = PassSettings {
            index,
            ..PassSettings::default()
        };
        for pixel in (0..crop.pixels() as u32).map(|i| (i % crop.width(), i / crop.width())) {
            let response = sample_pixel(&job, &pass, pixel, SensorResponse::Xyz, &mut workspace);
            for made in &workspace.contributions {
                if made.class.to_string() != "LSSDE" || made.aimed.is_none() && made.t != 1 {
                    continue;
                }
                splats += usize::from(made.aimed.is_none());
                let largest = &mut chains[usize::from(made.aimed.is_none())];
                *largest = largest.max(response.brightness(&made.lanes));
            }
        }
    }
    let [by_chain, by_light] = chains;
    println!("largest by a chain {by_chain:.4}, by {splats} light sub-paths {by_light:.4}");
    assert!(splats > 1000 && by_chain > 0.0);
    assert!(
        by_chain <= by_light,
        "{by_chain} by a chain, {by_light} by light"
    );
}
