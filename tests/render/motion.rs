//! Things that move while the shutter is open: the integrators against each other, streaks and
//! sweeps against closed forms, and a shutter that is open for a moment against things at rest.

use super::equality::{Case, compare, run};
use super::harness::{
    Estimate, Measured, full_crop, line_images, line_mean, mean, measure, scene, test_scale, with,
};
use super::regularized::regularized;
use abbe::render::{OutputRequest, Render};
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path};
use abbe::scene::settings::Regularize::Mis;
use abbe::scene::{Scene, Settings};
use std::f64::consts::{FRAC_PI_4, TAU};
use std::sync::Arc;

/// A closed room, seen from inside, with the shutter open for a second.
macro_rules! room {
    ($settings:literal, $camera:literal, $contents:literal) => {
        concat!(
            "[render]\n",
            $settings,
            r#"
[[sensor]]
resolution = [16, 16]
shutter = [0, 1]
perspective = { eye = [0, 1, 0.95], target = [0, 0.9, 0], fov_deg = 80, aperture_radius = 0.02, focus_distance = 1 }
"#,
            $camera,
            r#"
[material.white]
diffuse = { reflectance = 0.6 }
[material.red]
diffuse = { reflectance = [0.6, 0.1, 0.1] }
[material.glass]
dielectric = {}
[material.mirror]
mix = [{ weight = 0.6, mirror = {} }, { weight = 0.4, diffuse = { reflectance = 0.5 } }]
[medium.flint]
glass = "schott:N-SF11"
[[object]]
box = { min = [-1, 0, -1], max = [1, 2, 1] }
material = "white"
"#,
            $contents
        )
    };
}

/// With cones so narrow that their bias (of the square of their half-aperture) is below what is
/// resolved, path, light and bdpt agree with bdpt without cones. Light paths reach the camera
/// through glass and over mirrors only so.
fn agree_with_cones(
    case: &Case,
    (scene, settings, truth): (Arc<Scene>, Settings, Measured),
    passes: [u32; 3],
) {
    for ((kind, passes), epsilon) in [Path, Light, Bdpt]
        .into_iter()
        .zip(passes)
        .zip([0.02, 0.1, 0.02])
    {
        let settings = with(&regularized(&settings, Mis, epsilon), kind);
        let found = measure(&scene, &settings, 16, passes * test_scale(), case.classes);
        let what = format!("{kind:?} with cones");
        let (whole, part) = if kind == Light {
            (0.02, 0.2)
        } else {
            (0.006, 0.06)
        };
        compare(case.name, &what, &found.y, &truth.y, whole);
        for (i, class) in case.classes.iter().enumerate() {
            let (a, b) = (&found.classes[i], &truth.classes[i]);
            compare(case.name, &format!("{what} {class}"), a, b, part);
        }
    }
}

#[test]
fn moving_light_and_mirror_and_a_turning_mesh() {
    let case = Case {
        name: "moving light and mirror",
        text: room!(
            "max_depth = 4",
            "",
            r#"
[[object]]
mesh = { obj = "assets/smooth_sphere.obj" }
transform = [{ scale = [0.5, 0.3, 0.4] }]
material = "white"
motion = [
    { keys = [{ time = 0, rotate = { axis = [0.2, 1, 0.5], deg = 0 } }, { time = 1, rotate = { axis = [0.2, 1, 0.5], deg = 500 } }] },
    { keys = [{ time = -1, translate = [-0.7, 0.5, -0.3] }, { time = 1, translate = [-0.1, 0.7, -0.1] }] },
]
[[object]]
quad = { center = [0.5, 0.6, -0.4], u = [0.35, 0, 0.1], v = [0, 0.4, 0] }
material = "mirror"
motion = [{ about = [0.5, 0.6, -0.4], keys = [{ time = 0, rotate = { axis = [0, 1, 0], deg = -40 } }, { time = 1, rotate = { axis = [0, 1, 0], deg = 30 } }] }]
[[object]]
name = "light that moves and grows along one side"
quad = { center = [0, 1.9, 0.4], u = [0.3, 0, 0], v = [0, 0, 0.4] }
emission = 8
motion = [{ about = [0, 1.9, 0.4], interpolation = "cubic", keys = [
    { time = -0.5, translate = [-0.4, 0, 0], scale = [0.6, 1, 1] },
    { time = 0.4, translate = [0.1, -0.1, 0], scale = [1.5, 1, 0.8], rotate = { axis = [0, 0, 1], deg = 10 } },
    { time = 1.2, translate = [0.3, 0, 0.2], scale = [1, 1, 1.2], rotate = { axis = [1, 0, 0], deg = 15 } },
] }]
"#
        ),
        batches: 16,
        passes: [200, 50, 60],
        classes: &["LDE", "LDDE", "LDSE", "LSDE"],
        specular_in_view: true,
        resolution: 2e-3,
    };
    let found = run(&case);
    agree_with_cones(&case, found, [70, 34, 8]);
}

#[test]
fn moving_dispersive_glass_before_a_moving_camera() {
    let case = Case {
        name: "moving glass and camera",
        text: room!(
            "max_depth = 6",
            r#"motion = [{ about = [0, 1, 0.95], keys = [{ time = 0, rotate = { axis = [0, 1, 0], deg = -12 } }, { time = 1, translate = [0.1, 0.2, 0], rotate = { axis = [0, 1, 0], deg = 12 } }] }]"#,
            r#"
[[object]]
sphere = { radius = 0.35 }
transform = [{ scale = [1, 1, 0.6] }]
material = "glass"
interior = "flint"
motion = [{ keys = [
    { time = 0, translate = [0.5, 0.6, 0], rotate = { axis = [0, 1, 0], deg = 0 } },
    { time = 1, translate = [-0.2, 0.6, 0.1], rotate = { axis = [1, 0, 0], deg = 70 } },
] }]
[[object]]
quad = { center = [0, 1.98, 0], u = [0.8, 0, 0], v = [0, 0, 0.8] }
emission = 3
"#
        ),
        batches: 16,
        passes: [80, 40, 36],
        classes: &["LDE", "LDDE", "LDSSE"],
        specular_in_view: true,
        resolution: 2.5e-3,
    };
    let found = run(&case);
    agree_with_cones(&case, found, [14, 280, 14]);
}

#[test]
fn everything_moves_at_once() {
    run(&Case {
        name: "everything moves",
        text: room!(
            "max_depth = 4",
            r#"motion = [{ interpolation = "cubic", keys = [{ time = 0, translate = [0, 0, 0] }, { time = 0.6, translate = [0.2, 0.1, -0.1] }, { time = 1, translate = [0, 0.2, 0] }] }]"#,
            r#"
[material.rough]
dielectric = { roughness = 0.3 }
[material.metal]
conductor = { metal = "Ag", roughness = 0.25 }
[[object]]
mesh = { frames = [{ time = -0.3, obj = "assets/smooth_sphere.obj" }, { time = 0.8, obj = "assets/bent_sphere.obj" }, { time = 1.5, obj = "assets/smooth_sphere.obj" }] }
transform = [{ scale = 0.3 }]
material = "red"
motion = [{ keys = [{ time = 0, translate = [-0.5, 0.4, -0.2] }, { time = 1, translate = [-0.3, 0.7, -0.2], rotate = { axis = [0, 0, 1], deg = 90 } }] }]
[[object]]
sphere = { radius = 0.3 }
material = "rough"
interior = "flint"
motion = [{ keys = [{ time = 0, translate = [0.5, 0.5, -0.2] }, { time = 1, translate = [0.3, 0.8, 0] }] }]
[[object]]
quad = { center = [0, 0.8, -0.9], u = [0.4, 0, 0], v = [0, 0.3, 0] }
material = "metal"
motion = [{ interpolation = "step", keys = [{ time = 0, translate = [0, 0, 0] }, { time = 0.5, translate = [0.2, 0.3, 0.1] }] }]
[[object]]
name = "a light that changes its form"
mesh = { frames = [{ time = 0, obj = "assets/bent_sphere.obj" }, { time = 1, obj = "assets/smooth_sphere.obj" }] }
transform = [{ scale = [0.4, 0.1, 0.3] }, { translate = [0, 1.7, 0] }]
material = "white"
emission = 4
[[light]]
point = { position = [0.8, 1.5, 0.5], intensity = 0.1 }
motion = [{ keys = [{ time = 0, translate = [0, 0, 0] }, { time = 1, translate = [-1.5, 0, 0] }] }]
[[light]]
spot = { position = [0, 1.2, 0.9], direction = [0, -1, -1], inner_deg = 15, outer_deg = 30, intensity = 0.5 }
motion = [{ about = [0, 1.2, 0.9], keys = [{ time = 0, rotate = { axis = [0, 1, 0], deg = -50 } }, { time = 1, rotate = { axis = [0, 1, 0], deg = 50 } }] }]
"#
        ),
        batches: 16,
        passes: [290, 240, 115],
        classes: &["LDE", "LDDE"],
        specular_in_view: false,
        resolution: 2.5e-3,
    });
}

/// Everything that can move does, with smooth glass and a mirror: path and bdpt agree, and light as
/// well with cones.
#[test]
fn everything_moves_with_glass_and_a_mirror() {
    let case = Case {
        name: "everything moves, specular",
        text: room!(
            "max_depth = 5",
            r#"motion = [{ keys = [{ time = 0, translate = [0, 0, 0] }, { time = 1, translate = [0.15, 0.1, -0.1] }] }]"#,
            r#"
[[object]]
mesh = { obj = "assets/smooth_sphere.obj" }
transform = [{ scale = [0.3, 0.2, 0.3] }]
material = "red"
motion = [{ keys = [{ time = 0, translate = [-0.5, 0.4, 0], rotate = { axis = [0, 0, 1], deg = 0 } }, { time = 1, translate = [-0.4, 0.6, -0.2], rotate = { axis = [0, 0, 1], deg = 200 } }] }]
[[object]]
sphere = { radius = 0.3 }
material = "glass"
interior = "flint"
motion = [{ keys = [{ time = 0, translate = [0.5, 0.5, -0.2] }, { time = 1, translate = [0.1, 0.6, 0] }] }]
[[object]]
quad = { center = [0, 0, 0], u = [0.4, 0, 0], v = [0, 0.4, 0] }
material = "mirror"
motion = [{ keys = [{ time = 0, rotate = { axis = [0, 1, 0], deg = -20 } }, { time = 1, rotate = { axis = [0, 1, 0], deg = 20 } }] }, { keys = [{ time = 0, translate = [0, 1.2, -0.7] }, { time = 1, translate = [-0.3, 1.1, -0.7] }] }]
[[object]]
quad = { center = [0, 1.9, 0], u = [0.6, 0, 0], v = [0, 0, 0.6] }
emission = 4
motion = [{ keys = [{ time = 0, translate = [-0.2, 0, 0] }, { time = 1, translate = [0.3, -0.1, 0.2] }] }]
"#
        ),
        batches: 16,
        passes: [140, 50, 55],
        classes: &["LDE", "LDDE", "LDSE", "LSDE"],
        specular_in_view: true,
        resolution: 3e-3,
    };
    let found = run(&case);
    agree_with_cones(&case, found, [75, 40, 20]);
}

#[test]
fn an_environment_that_turns() {
    run(&Case {
        name: "turning environment",
        text: r#"
[render]
max_depth = 3
[[sensor]]
resolution = [12, 12]
shutter = [0, 1]
perspective = { eye = [0, 1, 3], target = [0, 0.4, 0], fov_deg = 50, aperture_radius = 0.02, focus_distance = 3 }
[material.white]
diffuse = { reflectance = 0.7 }
[material.metal]
conductor = { metal = "Ag", roughness = 0.3 }
[[object]]
quad = { center = [0, 0, 0], u = [2, 0, 0], v = [0, 0, -2] }
material = "white"
[[object]]
sphere = { center = [0.3, 0.5, 0], radius = 0.5 }
material = "metal"
[[light]]
environment = { image = "builtin:studio", euler_deg = [0, 20, 0] }
motion = [{ keys = [{ time = 0, rotate = { axis = [0.3, 1, 0], deg = -30 } }, { time = 1, rotate = { axis = [0.3, 1, 0], deg = 100 } }] }]
"#,
        batches: 16,
        passes: [500, 0, 220],
        classes: &["LE", "LDE", "LDDE"],
        specular_in_view: false,
        resolution: 3e-3,
    });
}

/// The mean of the irradiances at rest over the angles that a turning environment goes through: by
/// midpoints, 24 of 90 degrees.
#[test]
fn an_environment_that_turns_gives_the_mean_of_those_at_rest() {
    let at = |shutter: &str, motion: &str, deg: f64| {
        let text = format!(
            r#"
[render]
integrator = "path"
wavelengths = {{ line_nm = 555 }}
lanes = 1
[[sensor]]
resolution = [4, 4]
{shutter}
detector = {{ center = [0, 0, 0], normal = [0.5, 0.5, 0.7], width = 1, height = 1 }}
[[light]]
environment = {{ image = "builtin:studio", euler_deg = [0, {deg}, 0] }}
{motion}
"#
        );
        scene(&text)
    };
    let turn = "motion = [{ keys = [{ time = 0, rotate = { axis = [0, 1, 0], deg = 20 } }, { time = 2, rotate = { axis = [0, 1, 0], deg = 110 } }] }]";
    let (moving, settings) = at("shutter = [0, 2]", turn, 0.0);
    assert!(moving.is_moving);
    let passes = 50 * test_scale();
    let found = line_mean(&moving, 0, &settings, 16, 24 * passes);
    let (mut sum, mut variance) = (0.0, 0.0);
    let mut range = (f64::MAX, 0.0_f64);
    for i in 0..24_u64 {
        // random numbers of its own, so that the errors are independent
        let own = Settings {
            seed: 1 + i,
            ..settings.clone()
        };
        let angle = 20.0 + 90.0 * (i as f64 + 0.5) / 24.0;
        let still = line_mean(&at("", "", angle).0, 0, &own, 8, passes);
        sum += still.mean / 24.0;
        variance += (still.error / 24.0).powi(2);
        range = (range.0.min(still.mean), range.1.max(still.mean));
    }
    assert!(
        range.1 > 1.2 * range.0,
        "the angle hardly matters: {range:?}"
    );
    let expected = Estimate {
        mean: sum,
        error: variance.sqrt(),
    };
    compare(
        "turning environment",
        "mean of those at rest",
        &found,
        &expected,
        2e-3,
    );
}

/// A mirror turns at a constant rate about an axis in its plane: the image of a point light runs
/// along a circle at twice that rate.
#[test]
fn a_turning_mirror_sweeps_the_image_of_a_point_light() {
    let text = r#"
[render]
wavelengths = { line_nm = 555 }
lanes = 1
max_depth = 1
[[sensor]]
resolution = [4, 4]
shutter = [0, 1]
detector = { center = [1.5, 0.3, 0], u = [0, 0, 0.5], v = [0, 0.5, 0] }
[material.mirror]
mirror = {}
[[object]]
quad = { center = [0, 0, 0], u = [0, 0, -9], v = [0, 9, 0] }
material = "mirror"
motion = [{ keys = [{ time = 0, rotate = { axis = [0, 0, 1], deg = -25 } }, { time = 1, rotate = { axis = [0, 0, 1], deg = 10 } }] }]
[[light]]
point = { position = [1, 0, 0], intensity = 1 }
"#;
    let (scene, settings) = scene(text);
    let middle = |i: i32, n: i32, low: f64, high: f64| {
        low + (high - low) * (f64::from(i) + 0.5) / f64::from(n)
    };
    // the detector faces -x: irradiance of a source at (x, y, 0)
    let arriving = |source: [f64; 2], y: f64, z: f64| {
        let d = [1.5 - source[0], y - source[1]];
        d[0] / (d[0] * d[0] + d[1] * d[1] + z * z).powf(1.5)
    };
    let (n, turns) = (40, 60);
    let mut exact = 0.0;
    for (i, k) in (0..n).flat_map(|i| (0..n).map(move |k| (i, k))) {
        let (y, z) = (middle(i, n, -0.2, 0.8), middle(k, n, -0.5, 0.5));
        exact += arriving([1.0, 0.0], y, z);
        for turn in 0..turns {
            let angle = middle(turn, turns, -25.0, 10.0).to_radians();
            exact +=
                arriving([-(2.0 * angle).cos(), -(2.0 * angle).sin()], y, z) / f64::from(turns);
        }
    }
    exact /= f64::from(n * n);
    for (kind, passes) in [(Light, 6000), (Bdpt, 3000)] {
        let found = line_mean(&scene, 0, &with(&settings, kind), 16, passes * test_scale());
        found.assert_is(&format!("swept image, {kind:?}"), exact, 5e-3);
    }
}

/// A glowing edge goes 20 pixels to the right: a ramp of exactly that length.
#[test]
fn the_streak_of_a_moving_edge_is_speed_times_shutter() {
    let text = r#"
[render]
integrator = "path"
lanes = 1
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [32, 1]
filter = "box"
shutter = [2, 4.5]
orthographic = { eye = [0, 0, 5], target = [0, 0, 0], height = 0.125 }
[[object]]
quad = { center = [-3, 0, 0], u = [2, 0, 0], v = [0, 1, 0] }
emission = 1
# 1 / s: from pixel 7.7 at the opening to 27.7 at the closing
motion = [{ keys = [{ time = 0, translate = [-2.0375, 0, 0] }, { time = 10, translate = [7.9625, 0, 0] }] }]
"#;
    let (scene, settings) = scene(text);
    let passes = 16_384 * test_scale();
    let images = line_images(&scene, 0, &settings, 16, passes);
    // a pixel is an eighth: the edge is at -1 - 2.0375 + t, and the film begins at -2
    let (start, end) = ((-1.0375 + 2.0) * 8.0, (1.4625 + 2.0) * 8.0);
    assert!((end - start - 2.5 * 8.0_f64).abs() < 1e-12);
    // covered: the share of the shutter in which the edge is beyond a place, integrated over the
    // pixel
    let reached = |x: f64| {
        let u = ((end - x) / (end - start)).clamp(0.0, 1.0);
        // the antiderivative of the clamped ramp
        if x <= start {
            x - start
        } else {
            0.5 * (1.0 - u * u) * (end - start)
        }
    };
    let mut worst = 0.0_f64;
    for x in 0..32 {
        let exact = reached(f64::from(x + 1)) - reached(f64::from(x));
        let values: Vec<f64> = images.iter().map(|image| image[0][x as usize]).collect();
        let estimate = Estimate::from_batches(&values);
        worst = worst.max(estimate.error);
        assert!(estimate.error <= 3e-4, "pixel {x}: {estimate:?}");
        assert!(
            (estimate.mean - exact).abs() <= 1e-3,
            "pixel {x}: {estimate:?}, expected {exact}"
        );
    }
    println!("streak: largest standard error {worst:.1e}");
}

/// A point light flies over a detector along a straight line: the mean over the way of the
/// irradiance of a point light.
#[test]
fn a_light_that_moves_along_a_line_gives_the_integral_over_it() {
    let text = r#"
[render]
wavelengths = { line_nm = 555 }
lanes = 1
[[sensor]]
resolution = [4, 4]
shutter = [0, 4]
detector = { center = [0, 0, 0], u = [0.5, 0, 0], v = [0, 0, -0.5] }
[[light]]
point = { position = [-1.5, 0.8, 0.2], intensity = 1 }
motion = [{ keys = [{ time = 0, translate = [0, 0, 0] }, { time = 4, translate = [3, 0, 0] }] }]
"#;
    let (scene, settings) = scene(text);
    // over x of light and detector by midpoints, both smooth: to 1e-6
    let (height, n) = (0.8_f64, 200);
    let middle =
        |i: i32, low: f64, high: f64| low + (high - low) * (f64::from(i) + 0.5) / f64::from(n);
    let mut sum = 0.0;
    for x in (0..n).map(|i| middle(i, -0.5, 0.5)) {
        for z in (0..n).map(|i| middle(i, -0.5, 0.5)) {
            // the integral of h / (h² + s²)^(3/2) along the way, where h² = height² + (z - 0.2)²
            let h2 = height * height + (z - 0.2) * (z - 0.2);
            let part = |s: f64| s / (h2 * (h2 + s * s).sqrt());
            sum += height * (part(1.5 - x) - part(-1.5 - x)) / 3.0;
        }
    }
    let exact = sum / f64::from(n * n);
    for (kind, passes, resolution) in [(Path, 150, 1e-3), (Light, 5000, 5e-3), (Bdpt, 60, 2e-3)] {
        let estimate = line_mean(&scene, 0, &with(&settings, kind), 16, passes * test_scale());
        estimate.assert_is(&format!("moving light, {kind:?}"), exact, resolution);
    }
}

/// A mirror turns at a constant rate: the beam it reflects turns twice as fast and crosses a screen
/// with the density of a lighthouse.
#[test]
fn a_turning_mirror_sweeps_a_beam_like_a_lighthouse() {
    let text = r#"
[render]
integrator = "light"
wavelengths = { line_nm = 555 }
lanes = 1
[[sensor]]
resolution = [16, 1]
shutter = [0, 1]
detector = { center = [2, 0, 0], u = [0, 2, 0], v = [0, 0, -0.5] }
[material.mirror]
mirror = {}
[[object]]
disk = { center = [0, 0, 0], normal = [1, 0, 0], radius = 0.1 }
material = "mirror"
motion = [{ keys = [{ time = 0, rotate = { axis = [0, 0, 1], deg = 0 } }, { time = 1, rotate = { axis = [0, 0, 1], deg = 720 } }] }]
[[light]]
beam = { position = [1, 0, 0], direction = [-1, 0, 0], radius = 1e-5, irradiance = 1 }
"#;
    let (scene, settings) = scene(text);
    let images = line_images(&scene, 0, &settings, 16, 4096 * test_scale());
    // both sides reflect: in two turns of the mirror the beam goes four times around the circle,
    // evenly
    let flux = std::f64::consts::PI * 1e-10;
    let area_of_pixel = 4.0 / 16.0;
    for column in 0..16 {
        let y = |i: i32| (f64::from(i) / 16.0 * 4.0 - 2.0) / 2.0;
        let exact = (y(column + 1).atan() - y(column).atan()) / TAU / area_of_pixel;
        let values: Vec<f64> = images
            .iter()
            .map(|image| image[0][column as usize])
            .collect();
        let estimate = Estimate::from_batches(&values).scaled(1.0 / flux);
        estimate.assert_is(&format!("column {column}"), exact, 5e-3);
    }
    // everything within the screen's angle of a quarter turn arrives
    let total = mean(
        &images
            .iter()
            .map(|image| mean(&image[0]))
            .collect::<Vec<_>>(),
    ) * 4.0;
    let share = total / flux;
    assert!((share - 2.0 * FRAC_PI_4 / TAU).abs() < 2e-3, "{share}");
}

/// Sums of one render, to the last bit.
fn bits(text: &str, passes: u32) -> Vec<i128> {
    let (scene, settings) = scene(text);
    let mut render = Render::new(
        &scene,
        0,
        &settings,
        full_crop(&scene),
        &OutputRequest::default(),
    );
    (0..passes).for_each(|pass| render.add_pass(pass));
    assert_eq!(render.counters().non_finite, 0);
    render.outputs().image.sums()
}

const CONTENTS: &str = r#"
[material.white]
diffuse = { reflectance = 0.6 }
[material.glass]
dielectric = {}
[medium.flint]
glass = "schott:N-SF11"
[[object]]
box = { min = [-2, 0, -2], max = [2, 3, 2] }
material = "white"
"#;

fn instant(shutter: &str, [camera, ball, lamp, mesh, spot]: [&str; 5]) -> String {
    format!(
        r#"
[render]
max_depth = 6
[[sensor]]
resolution = [20, 20]
{shutter}
perspective = {{ eye = [0, 1, 1.5], target = [0, 1, 0], fov_deg = 60 }}
{camera}
{CONTENTS}
[[object]]
sphere = {{ center = [0.25, 0.75, 0], radius = 0.5 }}
material = "glass"
interior = "flint"
{ball}
[[object]]
quad = {{ center = [0, 2.5, 0], u = [0.5, 0, 0], v = [0, 0, 0.5] }}
emission = 5
{lamp}
[[object]]
mesh = {mesh}
transform = [{{ scale = 0.25 }}, {{ translate = [-0.75, 0.5, 0] }}]
material = "white"
[[light]]
spot = {{ position = [0, 2, 1], direction = [0, -1, -1], outer_deg = 30, intensity = 1 }}
{spot}
"#
    )
}

#[test]
fn a_shutter_open_for_a_moment_gives_the_bytes_of_things_at_rest_there() {
    let key = |what: &str| {
        format!(
            "motion = [{{ keys = [{{ time = 0, {what} = VALUE0 }}, {{ time = 2, {what} = VALUE2 }}] }}]"
        )
    };
    let between =
        |what: &str, from: &str, to: &str| key(what).replace("VALUE0", from).replace("VALUE2", to);
    let turn = |deg: f64| format!("{{ axis = [0, 1, 0], deg = {deg} }}");
    let slide = between("translate", "[0, 0, 0]", "[0.5, 0.25, -0.25]");
    let frames = r#"{ frames = [{ time = 0.5, obj = "assets/smooth_sphere.obj" }, { time = 1, obj = "assets/bent_sphere.obj" }, { time = 3, obj = "assets/smooth_sphere.obj" }] }"#;
    let moving = |shutter: &str| {
        instant(
            shutter,
            [
                &slide,
                &between("rotate", &turn(0.0), &turn(720.0 + 64.0)),
                &between("scale", "[1, 1, 0.5]", "[1.5, 1, 1]"),
                frames,
                &between("translate", "[0, 0, 0]", "[1, 0, 0]"),
            ],
        )
    };
    let at_rest = instant(
        "",
        [
            "motion = [{ keys = [{ time = 0, translate = [0.25, 0.125, -0.125] }] }]",
            "transform = [{ rotate = { axis = [0, 1, 0], deg = 392 } }]",
            "transform = [{ scale = [1.25, 1, 0.75] }]",
            r#"{ obj = "assets/bent_sphere.obj" }"#,
            "motion = [{ keys = [{ time = 0, translate = [0.5, 0, 0] }] }]",
        ],
    );
    let expected = bits(&at_rest, 2);
    assert!(expected.iter().any(|&v| v != 0));
    assert!(bits(&moving("shutter = [1, 1]"), 2) == expected);
    assert!(
        bits(&moving("shutter = [1, 1.25]"), 2) != expected,
        "an open shutter changes nothing"
    );
}

#[test]
fn where_nothing_moves_an_open_shutter_changes_no_byte() {
    let still = |shutter: &str| {
        let mesh = r#"{ obj = "assets/smooth_sphere.obj" }"#;
        bits(&instant(shutter, ["", "", "", mesh, ""]), 2)
    };
    assert!(still("") == still("shutter = [0, 7]"));
}

#[test]
fn what_moves_into_another_medium_is_refused() {
    let text = |to: f64| {
        format!(
            r#"
[[sensor]]
shutter = [0, 1]
perspective = {{ eye = [0, 0, 3], target = [0, 0, 0], fov_deg = 40 }}
[medium.glass]
ior = 1.5
[material.clear]
dielectric = {{}}
[[object]]
sphere = {{ radius = 1 }}
material = "clear"
interior = "glass"
[[light]]
name = "lamp"
point = {{ position = [3, 0, 0], intensity = 1 }}
motion = [{{ keys = [{{ time = 0, translate = [0, 0, 0] }}, {{ time = 1, translate = [{to}, 0, 0] }}] }}]
"#
        )
    };
    let build = |to: f64| {
        let loaded = abbe::io::scene_file::parse_str(&text(to), std::path::Path::new("."));
        let description = loaded.expect("a valid file").description;
        abbe::scene::Scene::build(description).map(|scene| scene.is_moving)
    };
    assert_eq!(build(-1.0), Ok(true));
    let expected = abbe::scene::BuildError::ChangingMedium {
        subject: abbe::scene::Subject::Light(0),
        name: "lamp".to_owned(),
    };
    assert_eq!(build(-3.0), Err(expected));
}
