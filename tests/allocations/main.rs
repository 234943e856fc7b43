//! Samples take no memory: once the buffers of a thread have grown, walks, connections, weights and
//! merging allocate nothing.
//!
//! The same samples are run twice, so that the second time every buffer is as large as it will be;
//! the count is exact, not a matter of speed. Each test counts on its own thread.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use abbe::integrator::{PhotonTracer, SensorJob, Workspace, sample_and_merge, sample_pixel};
use abbe::io::scene_file;
use abbe::scene::settings::IntegratorKind;
use abbe::scene::{Scene, Settings};
use abbe::spectrum::SensorResponse;
use abbe::transport::context::SharedSample;
use abbe::transport::{Cone, PassSettings, PhotonBuffer, PhotonMap};
use allocation_counter::measure;
use std::hint::black_box;
use std::path::Path;

const SAMPLES: u32 = 1000;

fn load(name: &str, overrides: &[(&str, &str)], integrator: IntegratorKind) -> (Scene, Settings) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name);
    let owned = |&(key, value): &(&str, &str)| (key.to_owned(), value.to_owned());
    let overrides: Vec<_> = overrides.iter().map(owned).collect();
    let loaded = scene_file::load(&path, &overrides).unwrap();
    let settings = Settings {
        integrator,
        ..loaded.settings
    };
    (Scene::build(loaded.description).unwrap(), settings)
}

/// Allocations of the second of two runs.
fn after_warm_up(mut run: impl FnMut()) -> u64 {
    run();
    measure(run).count_total
}

/// Calls `sample` for pixels all over the film.
fn spread(job: &SensorJob, mut sample: impl FnMut((u32, u32))) {
    let film = job.scene.sensors[job.sensor].camera.resolution();
    for i in 0..SAMPLES {
        // steps without a common factor with the size visit many pixels of each row and column
        sample(((i * 7919) % film.width, (i * 104_729) % film.height));
    }
}

/// Counts of the second of two runs over the same samples.
struct Run {
    allocations: u64,
    /// Samples with vertices whose densities differ between lanes.
    with_columns: usize,
}

/// Samples whose passes have a cone or not.
fn of_samples(name: &str, overrides: &[(&str, &str)], cone: Option<Cone>, planted: bool) -> Run {
    let (scene, settings) = load(name, overrides, IntegratorKind::Bdpt);
    let crop = scene.sensors[0].whole_film();
    let job = SensorJob::new(&scene, 0, &settings, &crop, false);
    let pass = PassSettings {
        cone,
        ..PassSettings::default()
    };
    let mut workspace = Workspace::default();
    let (mut found, mut with_columns) = (0, 0);
    let allocations = after_warm_up(|| {
        spread(&job, |pixel| {
            sample_pixel(&job, &pass, pixel, SensorResponse::Xyz, &mut workspace);
            found += workspace.contributions.len();
            with_columns += usize::from(!workspace.camera_subpath().columns.is_empty());
            if planted {
                black_box(Box::new(pixel));
            }
        });
    });
    assert!(
        found > SAMPLES as usize,
        "{name}: only {found} contributions"
    );
    Run {
        allocations,
        with_columns,
    }
}

#[test]
fn glass_with_a_cone_takes_no_memory() {
    let cone = Some(Cone::new(0.05));
    assert_eq!(
        of_samples("bench/caustic_lens.toml", &[], cone, false).allocations,
        0
    );
}

#[test]
fn rough_and_dispersive_glass_takes_no_memory() {
    // densities of these paths differ between lanes
    let rough = [("material.glass.dielectric.roughness", "0.2")];
    let run = of_samples("bench/motion.toml", &rough, None, false);
    assert_eq!(run.allocations, 0);
    assert!(run.with_columns > 20, "{}", run.with_columns);
}

#[test]
fn coated_lenses_take_no_memory() {
    let coated = [("lens.achromat.coating", "MgF2")];
    let run = of_samples("through_focus.toml", &coated, None, false);
    assert_eq!(run.allocations, 0);
}

#[test]
fn things_that_move_take_no_memory() {
    let cone = Some(Cone::new(0.05));
    assert_eq!(
        of_samples("bench/motion.toml", &[], cone, false).allocations,
        0
    );
}

#[test]
fn merging_takes_no_memory() {
    let (scene, settings) = load("bench/caustic_lens.toml", &[], IntegratorKind::Vcm);
    let crop = scene.sensors[0].whole_film();
    let job = SensorJob::new(&scene, 0, &settings, &crop, false);
    let radius = 0.01;
    let pass = PassSettings {
        merge_radius: Some(radius),
        shared: Some(SharedSample {
            u_wavelength: 0.3,
            heroes: job.heroes(),
            time: 0.0,
        }),
        ..PassSettings::default()
    };
    let mut tracer = PhotonTracer::default();
    let mut buffer = PhotonBuffer::default();
    let traced = after_warm_up(|| {
        buffer.clear();
        spread(&job, |pixel| tracer.trace(&job, &pass, pixel, &mut buffer));
    });
    assert_eq!(traced, 0);
    let photons =
        PhotonMap::build(buffer, job.lanes(), scene.accel.center(), radius, &|| false).unwrap();
    let mut workspace = Workspace::default();
    let count = after_warm_up(|| {
        spread(&job, |pixel| {
            let response = SensorResponse::Xyz;
            sample_and_merge(&job, &pass, Some(&photons), pixel, response, &mut workspace);
        });
    });
    assert!(workspace.counters.photons_found > 0);
    assert_eq!(count, 0);
}

#[test]
fn a_planted_allocation_is_seen() {
    let run = of_samples("bench/cornell_diffuse.toml", &[], None, true);
    assert_eq!(run.allocations, u64::from(SAMPLES));
}

/// Bytes per thing that a scene of many holds, and at most while it is read and built.
fn bytes_each(text: &str, count: usize) -> (f64, f64) {
    let mut scene = None;
    let read = measure(|| {
        let loaded = scene_file::parse_str(text, Path::new("/nonexistent")).unwrap();
        scene = Some(Scene::build(loaded.description).unwrap());
    });
    assert!(scene.is_some());
    let each = |bytes: f64| bytes / count as f64;
    (each(read.bytes_current as f64), each(read.bytes_max as f64))
}

#[test]
fn things_of_a_scene_take_a_kilobyte_and_a_few_while_they_are_read() {
    const COUNT: usize = 4000;
    let camera = "perspective = { eye = [0, 0, 9], target = [0, 0, 0], fov_deg = 30 }\n";
    let head = format!("[[sensor]]\n{camera}[[light]]\nenvironment = {{ radiance = 1 }}\n");
    let many = |thing: &dyn Fn(usize) -> String| (0..COUNT).map(thing).collect::<String>();
    let sphere = |i: usize| {
        let (x, y) = (i % 100 * 3, i / 100 * 3);
        format!("[[object]]\nsphere = {{ center = [{x}, {y}, -9], radius = 1 }}\n")
    };
    for (name, things) in [
        ("spheres", many(&sphere)),
        ("lamps", many(&|i| sphere(i) + "emission = 1\n")),
        (
            "lights",
            many(&|i| format!("[[light]]\npoint = {{ position = [{i}, 0, 9], intensity = 1 }}\n")),
        ),
        (
            "sensors",
            many(&|i| format!("[[sensor]]\nname = \"s{i}\"\nresolution = [1, 1]\n{camera}")),
        ),
    ] {
        let (held, read) = bytes_each(&format!("{head}{things}"), COUNT);
        println!("{name}: {held:.0} bytes each, {read:.0} while they are read");
        assert!(held < 1024.0, "{name}: {held} bytes each");
        assert!(read < 8.0 * 1024.0, "{name}: {read} bytes each while read");
    }
}
