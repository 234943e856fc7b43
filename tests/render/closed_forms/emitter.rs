//! A uniform emitter that fills the view reads 1 in every pixel, whatever the filter and the film.

use crate::harness::{Estimate, Y_OF_555_NM, assert_close, scene, test_scale, with};
use abbe::film::Crop;
use abbe::math::hash::combine;
use abbe::render::{OutputRequest, Render};
use abbe::scene::settings::IntegratorKind::{self, Bdpt, Light, Path};
use abbe::scene::{Scene, Settings};
use std::sync::Arc;

const BATCHES: u32 = 32;

/// Y of every pixel of a crop, in batches.
fn pixels(scene: &Arc<Scene>, settings: &Settings, crop: Crop, passes: u32) -> Vec<Estimate> {
    let mut values = vec![Vec::new(); crop.pixels() as usize];
    for batch in 0..BATCHES {
        let settings = Settings {
            seed: combine(settings.seed, u64::from(batch)),
            ..settings.clone()
        };
        let mut render = Render::new(scene, 0, &settings, crop, &OutputRequest::default());
        for pass in 0..passes {
            render.add_pass(pass);
        }
        let image = render.outputs().image.image(u64::from(passes));
        for (value, y) in values.iter_mut().zip(image.iter().skip(1).step_by(3)) {
            value.push(*y / Y_OF_555_NM);
        }
    }
    values.iter().map(|v| Estimate::from_batches(v)).collect()
}

fn check(camera: &str, filter: &str, resolution: [u32; 2], crop: Crop, kind: IntegratorKind) {
    // as large as the filters reach (1.5 pixels from the centre of the last), seen from every point
    // of the lens
    let half = |pixels: u32| 0.5 * (f64::from(pixels) + 2.2) / f64::from(resolution[1]) + 0.05;
    let text = SCENE
        .replace("HALF_X", &half(resolution[0]).to_string())
        .replace("HALF_Y", &half(resolution[1]).to_string())
        .replace("FILTER", filter)
        .replace("WIDTH", &resolution[0].to_string())
        .replace("HEIGHT", &resolution[1].to_string())
        .replace("CAMERA", camera);
    let (scene, settings) = scene(&text);
    let per_pixel = if resolution == [1, 1] { 600 } else { 4000 };
    let passes = if kind == Path {
        4
    } else {
        per_pixel / crop.pixels() as u32 * test_scale()
    };
    for (i, pixel) in pixels(&scene, &with(&settings, kind), crop, passes)
        .iter()
        .enumerate()
    {
        let what = format!("{camera}, {filter}, {resolution:?}, {crop:?}, {kind:?}, pixel {i}");
        if kind == Path {
            assert_close(&what, pixel.mean, 1.0, 1e-5);
        } else {
            pixel.assert_is(&what, 1.0, 4e-2);
        }
    }
}

fn check_all(camera: &str, filters: &[&str]) {
    for filter in filters {
        for kind in [Path, Light, Bdpt] {
            check(camera, filter, [1, 1], Crop::whole(1, 1), kind);
            check(camera, filter, [7, 5], Crop::whole(7, 5), kind);
            check(
                camera,
                filter,
                [7, 5],
                Crop {
                    x0: 5,
                    y0: 1,
                    x1: 7,
                    y1: 3,
                },
                kind,
            );
        }
    }
}

#[test]
fn fills_every_pixel_of_a_pinhole() {
    check_all(
        "perspective = { eye = [0, 0, 0], target = [0, 0, -1], fov_deg = 53.13 }",
        &["box", "tent", "gaussian"],
    );
}

#[test]
fn fills_every_pixel_of_a_thin_lens() {
    check_all(
        "perspective = { eye = [0, 0, 0], target = [0, 0, -1], fov_deg = 53.13, aperture_radius = 0.1, focus_distance = 1.3 }",
        &["gaussian"],
    );
}

#[test]
fn fills_every_pixel_of_an_orthographic_camera() {
    check_all(
        "orthographic = { eye = [0, 0, 0], target = [0, 0, -1], height = 1 }",
        &["gaussian"],
    );
}

const SCENE: &str = r#"
[render]
filter = "FILTER"
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [WIDTH, HEIGHT]
CAMERA
[[object]]
quad = { center = [0, 0, -1], u = [HALF_X, 0, 0], v = [0, HALF_Y, 0] }
emission = 1
"#;
