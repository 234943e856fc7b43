//! The same numbers for any number of threads, any order of pixels, any split into passes, and any
//! crop.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking"
)]

use super::harness::{Estimate, full_crop, scene, with};
use abbe::film::{Crop, Film};
use abbe::integrator::{SensorJob, Workspace, sample_pixel};
use abbe::io::part::{self, Part, PartHeader, PassRange, Resumed, merge, read, write};
use abbe::math::hash::combine;
use abbe::render::{OutputRequest, Render, Session, SessionOptions};
use abbe::scene::settings::IntegratorKind::{Bdpt, Path};
use abbe::scene::{Scene, Settings};
use abbe::transport::Target;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

const SCENE: &str = r#"
[render]
max_depth = 6
[[sensor]]
resolution = [40, 24]
perspective = { eye = [0, 1.5, 4], target = [0, 0.6, 0], fov_deg = 45 }
[medium.flint]
glass = "schott:N-SF11"
[material.white]
diffuse = { reflectance = 0.7 }
[material.clear]
dielectric = {}
[[object]]
quad = { center = [0, 0, 0], u = [0, 0, 3], v = [3, 0, 0] }
material = "white"
[[object]]
sphere = { center = [0, 0.7, 0], radius = 0.6 }
material = "clear"
interior = "flint"
[[object]]
sphere = { center = [0.6, 2.2, 0.3], radius = 0.3 }
emission = "D65"
[[light]]
point = { position = [-1, 2, 1], intensity = 1 }
"#;

fn threads<T: Send>(count: usize, run: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .build()
        .unwrap()
        .install(run)
}

fn sums(scene: &Arc<Scene>, settings: &Settings, crop: Crop, passes: Range<u32>) -> Vec<i128> {
    let mut render = Render::new(scene, 0, settings, crop, &OutputRequest::default());
    passes.for_each(|pass| render.add_pass(pass));
    render.outputs().image.sums()
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let (scene, settings) = scene(SCENE);
    let crop = full_crop(&scene);
    let [one, two, five] = [1, 2, 5].map(|n| threads(n, || sums(&scene, &settings, crop, 0..4)));
    assert!(one.iter().any(|&v| v != 0));
    assert!(one == two && one == five);
    let other = Settings {
        seed: settings.seed + 1,
        ..settings
    };
    assert!(
        one != sums(&scene, &other, crop, 0..4),
        "another seed gives the same image"
    );
}

#[test]
fn any_order_of_pixels_gives_the_same_bytes() {
    let (scene, settings) = scene(SCENE);
    let crop = full_crop(&scene);
    let request = OutputRequest::default();
    let render = Render::new(&scene, 0, &settings, crop, &request);
    let mut frame = SensorJob::new(&scene, 0, &settings, &crop, false);
    frame.strategies.factors = render.factors().map(|found| &found.factors);
    frame.strategies.tries = render.tries().map(|found| &found.tries);
    assert!(frame.strategies.factors.is_some());
    let film = Film::new(crop, scene.sensors[0].filter, 3);
    let mut workspace = Workspace::default();
    // backwards, the passes too, and splats after the pixel's own sum
    for pass in (0..3).rev() {
        let pass = render.pass_settings(pass);
        let half = (pass.index & 1) as usize;
        for (x, y) in (0..crop.x1)
            .rev()
            .flat_map(|x| (0..crop.y1).rev().map(move |y| (x, y)))
        {
            let response = sample_pixel(&frame, &pass, (x, y), request.response, &mut workspace);
            let mut own = [0.0; 3];
            for contribution in &workspace.contributions {
                if contribution.target == Target::OwnPixel {
                    let xyz = response.xyz(&contribution.lanes);
                    (0..3).for_each(|c| own[c] += xyz[c]);
                }
            }
            film.add_pixel(x, y, half, &own);
            for contribution in workspace.contributions.iter().rev() {
                if let Target::Splat(raster) = contribution.target {
                    let xyz = response.xyz(&contribution.lanes);
                    film.add_splat(raster, (x, y), half, &xyz);
                }
            }
        }
    }
    assert!(film.sums() == sums(&scene, &settings, crop, 0..3));
}

#[test]
fn merged_parts_equal_one_run() {
    let (scene, settings) = scene(SCENE);
    let crop = full_crop(&scene);
    let part = |passes: Range<u32>| {
        let range = PassRange {
            seed: 0,
            start: u64::from(passes.start),
            end: u64::from(passes.end),
        };
        let header = PartHeader {
            version: "test".to_owned(),
            scene_hash: scene.hash,
            settings_hash: 0,
            sensor: "sensor-0".to_owned(),
            width: crop.x1,
            height: crop.y1,
            crop: [crop.x0, crop.y0, crop.x1, crop.y1],
            channels: 3,
            blocks: 0,
            exponent: 0,
            pilot: 0,
            image: BTreeMap::new(),
            passes: vec![range],
            unfinished: None,
            companions: Vec::new(),
            spectral: None,
        };
        Part {
            header,
            sums: sums(&scene, &settings, crop, passes),
            unfinished: None,
        }
    };
    let folder = tempfile::tempdir().unwrap();
    let files = ["late", "early"].map(|name| folder.path().join(name));
    write(&files[0], &part(3..8)).unwrap();
    write(&files[1], &part(0..3)).unwrap();
    let merged = merge(files.iter().map(|f| read(f).unwrap())).unwrap();
    let whole = part(0..8);
    assert!(merged == whole);

    // resumed
    let request = OutputRequest::default();
    let mut render = Render::new(&scene, 0, &settings, crop, &request);
    render.restore(&[0, 1, 2], &part(0..3).sums).unwrap();
    (3..8).for_each(|pass| render.add_pass(pass));
    assert!(render.outputs().image.sums() == whole.sums);
    assert_eq!(render.pass_counts(), [4, 4]);
}

#[test]
fn a_resumed_render_keeps_the_weights_of_its_part() {
    let (scene, settings) = scene(SCENE);
    // 8 samples have a shorter pilot than 32
    let [short, long] = [8, 32].map(|spp| Settings {
        spp,
        ..settings.clone()
    });
    let with_pilot = |settings: &Settings, passes: Range<u32>, pilot| {
        let options = SessionOptions {
            passes: Some(passes),
            pilot,
            ..SessionOptions::default()
        };
        Session::new(Arc::clone(&scene), settings, options).unwrap()
    };
    let session = |settings: &Settings, passes| with_pilot(settings, passes, None);
    let rendered = |settings: &Settings, passes: Range<u32>| {
        let mut session = session(settings, passes);
        session.run();
        part::of(&session)
    };
    let (first, whole) = (rendered(&short, 0..2), rendered(&short, 0..4));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("first.part");
    write(&file, &first).unwrap();
    let part = Resumed::read(&file).unwrap();
    let mut resumed = with_pilot(&long, 0..4, Some(part.pilot));
    part.restore(&mut resumed).unwrap();
    resumed.run();
    assert!(part::of(&resumed) == whole);
    assert!(rendered(&long, 0..4).sums != whole.sums, "pilots agree");
    // passes with other weights are no parts of it
    let other = rendered(&long, 2..4);
    let message = merge([first.clone(), other]).unwrap_err().to_string();
    assert_eq!(
        message,
        "parts differ in passes of the pilot, by the samples per pixel of their renders: 1 and 4"
    );
    // a pilot that no render has
    let mut damaged = first;
    damaged.header.pilot = 1_000_000;
    write(&file, &damaged).unwrap();
    let message = Resumed::read(&file).unwrap_err();
    let expected = format!(
        "{}: cannot resume: it names a pilot of 1000000 passes",
        file.display()
    );
    assert_eq!(message.to_string(), expected);
}

const PART: Crop = Crop {
    x0: 9,
    y0: 5,
    x1: 31,
    y1: 20,
};

/// The sums of the pixels of `part` out of those of `whole`.
fn cut(sums: &[i128], whole: &Crop, part: &Crop) -> Vec<i128> {
    let (width, height) = (
        (whole.x1 - whole.x0) as usize,
        (whole.y1 - whole.y0) as usize,
    );
    let mut out = Vec::new();
    for half in 0..2 {
        for y in part.y0..part.y1 {
            for x in part.x0..part.x1 {
                let (column, row) = ((x - whole.x0) as usize, (y - whole.y0) as usize);
                let at = 3 * ((half * height + row) * width + column);
                out.extend(&sums[at..at + 3]);
            }
        }
    }
    out
}

#[test]
fn a_crop_of_path_has_the_pixels_of_the_whole() {
    let (scene, settings) = scene(SCENE);
    let settings = with(&settings, Path);
    let crop = full_crop(&scene);
    let whole = sums(&scene, &settings, crop, 0..4);
    assert!(cut(&whole, &crop, &PART) == sums(&scene, &settings, PART, 0..4));
}

#[test]
fn a_crop_of_bdpt_has_the_mean_of_the_whole() {
    let (scene, settings) = scene(SCENE);
    let whole = full_crop(&scene);
    let mean = |crop: Crop, passes: u32| {
        let batch = |seed: u64| {
            let settings = Settings {
                seed: combine(1, seed),
                ..with(&settings, Bdpt)
            };
            let sums = cut(&sums(&scene, &settings, crop, 0..passes), &crop, &PART);
            let y: i128 = sums.iter().skip(1).step_by(3).sum();
            y as f64 / 2.0_f64.powi(64) / (f64::from(passes) * PART.pixels() as f64)
        };
        Estimate::from_batches(&(0..16).map(batch).collect::<Vec<_>>())
    };
    let (a, b) = (mean(whole, 6), mean(PART, 15));
    let error = a.error.hypot(b.error) / a.mean;
    println!("crop: {a:?} {b:?}");
    // p = 7e-6
    assert!(a.deviation(&b) < 4.5, "{a:?} and {b:?}");
    assert!(error < 0.02, "standard error {error} of the mean");
}
