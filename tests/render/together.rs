//! Detectors that share light sub-paths: each gets what it would get by itself.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::harness::{Estimate, scene, with};
use abbe::render::{OutputRequest, Session, SessionError, SessionOptions};
use abbe::scene::settings::IntegratorKind;
use abbe::scene::{Scene, Settings};
use std::sync::Arc;

/// A beam through glass onto a white card, and another beside it: planes across the first, one of
/// them seen by the card as well, and one that only the card lights.
const SCENE: &str = r#"
[render]
integrator = "light"
max_depth = 5
spp = 4
[[sensor]]
name = "before"
resolution = [16, 16]
detector = { center = [0, 0, 1], u = [0.5, 0, 0], v = [0, 0.5, 0], transparent = true }
[[sensor]]
name = "behind"
resolution = [40, 24]
filter = "gaussian"
detector = { center = [0, 0, -0.6], u = [0.7, 0, 0], v = [0, 0.5, 0.1], transparent = true }
[[sensor]]
name = "beside"
resolution = [12, 20]
detector = { center = [1.2, 0, -0.5], u = [0, 0, 0.6], v = [0, 0.6, 0] }
[[sensor]]
name = "camera"
resolution = [8, 8]
perspective = { eye = [3, 1, 3], target = [0, 0, 0], fov_deg = 30 }
[medium.flint]
glass = "schott:N-SF11"
[material.white]
diffuse = { reflectance = 0.7 }
[material.clear]
dielectric = {}
[[object]]
sphere = { center = [0, 0, 0], radius = 0.4 }
material = "clear"
interior = "flint"
[[object]]
quad = { center = [0, 0, -1.2], u = [1, 0, 0], v = [0, 1, 0] }
material = "white"
[[light]]
beam = { position = [0, 0, 2], direction = [0, 0, -1], radius = 0.3, irradiance = 1 }
[[object]]
quad = { center = [-1, 0, 1], u = [0, 0, 0.3], v = [0, -0.3, 0] }
emission = 2.0
two_sided = true
"#;

/// The detector with most pixels leads.
const LEAD: usize = 1;
const OTHERS: [usize; 2] = [0, 2];

fn session(
    scene: &Arc<Scene>,
    settings: &Settings,
    sensor: usize,
    companions: &[usize],
    live: bool,
) -> Result<Session, SessionError> {
    let options = SessionOptions {
        sensor,
        companions: companions.to_vec(),
        live,
        outputs: OutputRequest {
            class_table: true,
            ..OutputRequest::default()
        },
        ..SessionOptions::default()
    };
    Session::new(Arc::clone(scene), settings, options)
}

fn flux(session: &Session) -> Vec<f64> {
    let render = session.render();
    let of_each = render.and_companions().map(|r| r.flux().unwrap());
    of_each.map(|flux| flux.luminous_lm.value).collect()
}

#[test]
fn companions_get_the_light_of_their_own_renders() {
    let (scene, settings) = scene(SCENE);
    const BATCHES: u64 = 32;
    let batches = |integrator, sensor: usize, companions: &[usize]| -> Vec<Estimate> {
        let of_seed = |seed| {
            let settings = Settings {
                seed,
                ..with(&settings, integrator)
            };
            let mut session = session(&scene, &settings, sensor, companions, false).unwrap();
            session.run();
            flux(&session)
        };
        let values: Vec<Vec<f64>> = (0..BATCHES).map(of_seed).collect();
        let of_film = |i| values.iter().map(|v: &Vec<f64>| v[i]).collect::<Vec<_>>();
        let films = 0..=companions.len();
        films.map(|i| Estimate::from_batches(&of_film(i))).collect()
    };
    let together = batches(IntegratorKind::Light, LEAD, &OTHERS);
    let sensors = [LEAD, OTHERS[0], OTHERS[1]];
    for (found, sensor) in together.iter().zip(sensors) {
        let alone = &batches(IntegratorKind::Bdpt, sensor, &[])[0];
        let name = &scene.sensors[sensor].name;
        println!("{name}: together {found:?}, bdpt {alone:?}");
        assert!(
            found.mean > 0.0 && found.error < 0.03 * found.mean,
            "{name}"
        );
        assert!(alone.error < 0.03 * alone.mean, "{name}");
        assert!(found.deviation(alone) < 4.5, "{name}: {found:?} {alone:?}");
    }
}

/// The lead's own film is that of its render alone, bit for bit, and no ray is traced but for
/// connections to the others; a live session, whose passes have films of their own, is the same.
#[test]
fn the_lead_is_what_it_is_alone() {
    let (scene, settings) = scene(SCENE);
    let run = |companions: &[usize], live| {
        let mut session = session(&scene, &settings, LEAD, companions, live).unwrap();
        session.run();
        session
    };
    let (alone, together, live) = (run(&[], false), run(&OTHERS, false), run(&OTHERS, true));
    let (alone, together, live) = (alone.render(), together.render(), live.render());
    assert_eq!(
        alone.outputs().image.sums(),
        together.outputs().image.sums()
    );
    assert_eq!(
        alone.counters().closest_rays,
        together.counters().closest_rays
    );
    for (a, b) in together.and_companions().zip(live.and_companions()) {
        assert_eq!(a.outputs().image.sums(), b.outputs().image.sums());
        assert_eq!(a.passes(), [0, 1, 2, 3]);
        assert_eq!(b.passes(), [0, 1, 2, 3]);
        let y = |(_, row): (_, &abbe::render::table::Row)| row.weighted;
        let (table, sum): (f64, f64) = (
            a.table().rows().map(y).sum(),
            a.xyz().iter().skip(1).step_by(3).sum(),
        );
        // the same light, pass by pass
        assert!((table / 4.0 / sum - 1.0).abs() < 1e-9, "{table} {sum}");
    }
}

#[test]
fn others_are_refused() {
    let (scene, settings) = scene(SCENE);
    let fault = |settings: &Settings, companion: usize| {
        let session = session(&scene, settings, LEAD, &[companion], false);
        session.map(|_| ()).unwrap_err().to_string()
    };
    assert_eq!(
        fault(&settings, 3),
        "sensors \"behind\" and \"camera\" cannot share light sub-paths: both must be detectors"
    );
    assert_eq!(
        fault(&settings, LEAD),
        "sensors \"behind\" and \"behind\" cannot share light sub-paths: they are one"
    );
    assert_eq!(
        fault(&with(&settings, IntegratorKind::Bdpt), 0),
        "sensors \"behind\" and \"before\" cannot share light sub-paths: only light tracing can, \
         for camera sub-paths belong to one sensor (render.integrator = \"light\", or each by itself)"
    );
    assert_eq!(
        fault(&settings, 9),
        "sensor 9 does not exist: the scene has 4"
    );
}
