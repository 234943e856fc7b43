//! Films behind lenses: where they stand, how their pictures lie, and how bright and colored these
//! are, against traces of the same prescription.

use crate::harness::{Estimate, line_images, measure, scene_in, test_scale};
use crate::lens::{lenses, read, transmittance};
use abbe::film::Crop;
use abbe::math::hash::combine;
use abbe::optics::paraxial::Paraxial;
use abbe::optics::{Passage, Prescription, Ray, System};
use abbe::render::{OutputRequest, Render};
use abbe::scene::{Scene, Settings};
use abbe::spectrum::SpectralChannels;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::Arc;

const D_NM: f64 = 587.5618;
const LENS: &str = "double_gauss.zmx";

/// Distance of the image behind the last surface, by Newton's form of the lens equation.
fn image_distance(lens: &Prescription, object: f64) -> f64 {
    let first = Paraxial::new(lens, D_NM).first_order();
    first.bfl + first.efl * first.efl / (object + first.ffl)
}

#[test]
fn films_stand_in_focus_and_pictures_are_upright() {
    let text = r#"
unit = "cm"
[render]
integrator = "path"
max_depth = 10
wavelengths = { line_nm = 587.5618 }
[[sensor]]
resolution = [180, 120]
film = { lens = "taking", width = 3.6, height = 2.4, focus_distance = 100, defocus = 0.01 }
[[lens]]
name = "taking"
file = "double_gauss.zmx"
barrel = 31
transform = [{ scale = 1 }, { rotate = { axis = [0, 1, 0], deg = 90 } }, { translate = [5, 6, 7] }]
[[object]]
quad = { center = [-95, 10, 1], u = [0, 0, -0.5], v = [0, 0.5, 0] }
emission = 1.0
"#;
    let (scene, settings) = scene_in(&lenses(), text);
    let lens = read(LENS);
    let image = image_distance(&lens, 1000.0);
    let last = lens.frames()[lens.last()].origin.z;
    let place = scene.sensors[0]
        .camera
        .transform()
        .at(0.0)
        .to_world
        .translation;
    // the axis, +z of the lens, is +x of the scene
    let expected = DVec3::new(50.0 + last + image + 0.1, 60.0, 70.0) * 1e-3;
    assert!((place - expected).length() < 1e-12, "{place} {expected}");
    let image_of = line_images(&scene, 0, &settings, 1, 8).remove(0).remove(0);
    let total: f64 = image_of.iter().sum();
    let at = |i: usize| DVec2::new((i % 180) as f64 + 0.5, (i / 180) as f64 + 0.5);
    let lit = image_of.iter().enumerate();
    let centroid = lit.map(|(i, v)| *v * at(i)).sum::<DVec2>() / total;
    // 40 mm above the axis, and 60 mm to the right for who looks from the lens along -x
    let first = Paraxial::new(&lens, D_NM).first_order();
    let scale = first.efl / (1000.0 + first.ffl);
    let expected = DVec2::new(90.0 + 60.0 * scale / 0.2, 60.0 - 40.0 * scale / 0.2);
    // distortion, and the plane is not quite in focus: below a pixel
    assert!(
        (centroid - expected).length() < 1.0,
        "{centroid} {expected}"
    );
}

/// Irradiance of a film under light of radiance 1 from everywhere, by rays from points of the film
/// back through the lens: the integral of transmittance times cosine over the rear element.
fn illumination(lens: &Prescription, image: f64, off_axis: f64) -> f64 {
    let last = lens.last();
    let route = (0..=last).rev().chain([last + 1]).map(|surface| Passage {
        surface,
        backward: surface <= last,
        reflects: false,
    });
    let system = System::along(lens, D_NM, route.collect());
    let indices = system.indices();
    let vertex = lens.frames()[last].origin.z;
    let n = 100;
    let half = 1.1 * lens.surfaces[last].shape.aperture.extent();
    let cell = 2.0 * half / f64::from(n);
    let from = DVec3::new(off_axis, 0.0, vertex + image);
    let through = |i: i32| {
        let at = DVec2::new(f64::from(i % n), f64::from(i / n)) + 0.5;
        let way = (at * cell - half).extend(vertex) - from;
        let mut passes = 1.0;
        let ray = Ray {
            o: from,
            d: way.normalize(),
        };
        let arrived = system.trace(ray, true, |e| {
            if e.surface <= last {
                passes *= transmittance(e, indices[e.surface], indices[e.surface + 1]);
            }
        });
        let cos = image / way.length();
        let solid = cell * cell * cos / way.length_squared();
        if arrived.is_ok() {
            passes * cos * solid
        } else {
            0.0
        }
    };
    (0..n * n).map(through).sum()
}

/// The fall of the light toward the corner: cosines and vignetting.
#[test]
fn relative_illumination() {
    let text = r#"
unit = "mm"
[render]
integrator = "path"
max_depth = 10
wavelengths = { line_nm = 587.5618 }
[[sensor]]
resolution = [3, 1]
film = { lens = "taking", width = 36, height = 0.2 }
[[lens]]
name = "taking"
file = "double_gauss.zmx"
barrel = 31
[[object]]
disk = { center = [0, 0, 40], radius = 1e5, inner_radius = 30.9 }
[[object]]
disk = { center = [0, 0, 200], radius = 1e5 }
[[light]]
environment = { radiance = 1 }
"#;
    let lens = read(LENS);
    let first = Paraxial::new(&lens, D_NM).first_order();
    let mut loaded = abbe::io::scene_file::parse_str(text, &lenses()).expect("a scene");
    // the trace leaves absorption out
    for medium in &mut loaded.description.media {
        medium.use_k = false;
    }
    let scene = Arc::new(Scene::build(loaded.description).expect("a scene"));
    let images = line_images(&scene, 0, &loaded.settings, 16, 4000);
    // pixels of 12 mm, by the midpoint rule
    let expected: Vec<f64> = [-12.0, 0.0, 12.0]
        .map(|middle| {
            let part = |k: i32| illumination(&lens, first.bfl, middle + 2.0 * f64::from(k) - 5.0);
            (0..6).map(part).sum::<f64>() / 6.0
        })
        .to_vec();
    for (pixel, expected) in expected.iter().enumerate() {
        let found: Vec<f64> = images.iter().map(|image| image[0][pixel]).collect();
        let found = Estimate::from_batches(&found);
        println!("film, pixel {pixel} of 3: {found:?}, traced {expected}");
        assert!(found.error < 5e-3 * expected, "{found:?}");
        // cells at the border of the trace's pupil are in or out: 0.3 % of it
        let off = (found.mean - expected).abs();
        assert!(
            off < 4.5 * found.error + 3e-3 * expected,
            "{found:?} {expected}"
        );
    }
    let corner = expected[0] / expected[1];
    assert!(
        (0.9..0.99).contains(&corner),
        "darker beside the middle: {corner}"
    );
}

/// Pixels of a crop, line by line, in independent batches.
fn crops(
    scene: &Arc<Scene>,
    settings: &Settings,
    crop: Crop,
    batches: u64,
    passes: u32,
) -> Vec<Vec<Vec<f64>>> {
    let lines: Vec<f64> = scene.wavelengths.atoms().map(|atom| atom.0).collect();
    let count = lines.len();
    let request = OutputRequest {
        spectral: Some(SpectralChannels::new([360.0, 830.0], 0, lines)),
        ..OutputRequest::default()
    };
    let batch = |batch: u64| {
        let seed = combine(settings.seed, batch + 1);
        let settings = Settings {
            seed,
            ..settings.clone()
        };
        let mut render = Render::new(scene, 0, &settings, crop, &request);
        (0..passes).for_each(|pass| render.add_pass(pass));
        let (_, film) = render.outputs().spectral.as_ref().expect("asked for");
        let image = film.image(u64::from(passes));
        let of = |line: usize| image.iter().skip(line).step_by(count).copied().collect();
        (0..count).map(of).collect()
    };
    (0..batches).into_par_iter().map(batch).collect()
}

/// Lateral color of a photograph: how far the pictures of a small lamp in two lines lie from one
/// another, within a tenth of a pixel of the trace.
#[test]
fn lateral_color_of_a_photograph() {
    let lens = read(LENS);
    let image = image_distance(&lens, 1000.0);
    let lines = [486.1327, 656.2725];
    let (x, object) = (150.0, 1000.0);
    let traced = lines.map(|nm| {
        let system = System::new(&lens, nm);
        let thickness = lens.surfaces[lens.last()].thickness;
        let indices = system.indices();
        let n = 160;
        let (mut sum, mut moment) = (0.0, 0.0);
        for i in 0..n * n {
            let at = DVec2::new(f64::from(i % n), f64::from(i / n)) + 0.5;
            let to = ((at / f64::from(n) * 2.0 - 1.0) * 32.0).extend(0.0);
            let o = DVec3::new(x, 0.0, -object);
            let mut passes = 1.0;
            let ray = Ray {
                o,
                d: (to - o).normalize(),
            };
            let end = system.trace(ray, true, |e| {
                if e.surface <= lens.last() {
                    passes *= transmittance(e, indices[e.surface], indices[e.surface + 1]);
                }
            });
            if let Ok(end) = end {
                let landed = end.o.x + end.d.x / end.d.z * (image - thickness);
                sum += passes;
                moment += passes * landed;
            }
        }
        moment / sum
    });
    let text = r#"
unit = "mm"
[render]
integrator = "path"
max_depth = 10
wavelengths = "even"
[[sensor]]
resolution = [900, 600]
film = { lens = "taking", width = 36, height = 24, focus_distance = 1000 }
[[lens]]
name = "taking"
file = "double_gauss.zmx"
barrel = 31
[[object]]
disk = { center = [150, 0, -1000], radius = 1, normal = [0, 0, 1] }
emission = { lines = [[486.1327, 1], [656.2725, 1]] }
"#;
    let (scene, settings) = scene_in(&lenses(), text);
    let pitch = 0.04;
    // the picture of +x is at the right; on the film it is at -x
    let column = 450.0 - traced[0] / pitch;
    assert!(column > 600.0);
    let (c, r) = (column as u32, 300);
    let crop = Crop {
        x0: c - 6,
        y0: r - 6,
        x1: c + 6,
        y1: r + 6,
    };
    let found = crops(&scene, &settings, crop, 16, 128 * test_scale());
    let centroid = |image: &Vec<f64>| {
        let at = |i: usize| f64::from(crop.x0) + (i % 12) as f64 + 0.5;
        let moment: f64 = image.iter().enumerate().map(|(i, v)| v * at(i)).sum();
        moment / image.iter().sum::<f64>()
    };
    let apart = |lines: &Vec<Vec<f64>>| centroid(&lines[1]) - centroid(&lines[0]);
    let found = Estimate::from_batches(&found.iter().map(apart).collect::<Vec<_>>());
    let expected = (traced[0] - traced[1]) / pitch;
    println!("red - blue: {found:?} pixels, traced {expected}");
    assert!(found.error < 0.03, "{found:?}");
    assert!((found.mean - expected).abs() < 0.1, "{found:?} {expected}");
    assert!(expected.abs() > 0.1, "there is color to see: {expected}");
}

/// A film sees what a plain detector in its place does, with less noise than one that is aimed at
/// the rear element; and a stop that is closed lets less light through.
#[test]
fn films_see_what_detectors_see() {
    let text = r#"
unit = "mm"
[render]
integrator = "path"
max_depth = 14
[[sensor]]
resolution = [12, 8]
SENSOR
[[lens]]
name = "taking"
file = "double_gauss.zmx"
barrel = 31
FURTHER
[[object]]
disk = { center = [0, 0, 40], radius = 1e5, inner_radius = 30.9 }
[[object]]
disk = { center = [60, 20, -700], radius = 90, normal = [0, 0, 1] }
emission = { name = "D65", luminance = 1 }
[[light]]
environment = { radiance = { name = "A", luminance = 0.2 } }
"#;
    let lens = read(LENS);
    let z = lens.frames()[lens.last()].origin.z;
    let center = z + image_distance(&lens, 700.0);
    let film = "film = { lens = \"taking\", width = 36, height = 24, focus_distance = 700 }";
    let detector = format!(
        "detector = {{ center = [0, 0, {center}], u = [18, 0, 0], v = [0, -12, 0], flip = true"
    );
    let aim = format!(", aim = {{ target = [0, 0, {z}], radius = 24 }} }}");
    let of = |sensor: &str, further: &str, passes: u32| {
        let text = text.replace("SENSOR", sensor).replace("FURTHER", further);
        let (scene, settings) = scene_in(&lenses(), &text);
        measure(&scene, &settings, 16, passes, &[]).y
    };
    let film_sees = of(film, "", 24);
    let aimed = of(&format!("{detector}{aim}"), "", 24);
    let plain = of(&format!("{detector} }}"), "", 96);
    println!("film {film_sees:?}, aimed {aimed:?}, plain {plain:?}");
    assert!(film_sees.error < 0.015 * film_sees.mean && plain.error < 0.05 * plain.mean);
    assert!(film_sees.deviation(&plain) < 4.5 && film_sees.deviation(&aimed) < 4.5);
    assert!(
        film_sees.error < 0.8 * aimed.error,
        "{film_sees:?} {aimed:?}"
    );
    // from f/4.76, which the stop of 10.5 mm is
    let closed = of(film, "f_number = 9.52", 24);
    let ratio = closed.mean / film_sees.mean;
    assert!(
        (0.2..0.3).contains(&ratio),
        "a quarter of the light, and vignetting: {ratio}"
    );
}
