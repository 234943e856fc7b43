//! The loop over passes: when it ends, what it restores, what a cancelled pass leaves, and what
//! others may read meanwhile.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::harness::{full_crop, scene, with};
use abbe::film::Crop;
use abbe::io::part::{self, Resumed};
use abbe::render::session::NO_LIMIT;
use abbe::render::{
    Cancel, OutputRequest, Render, Session, SessionError, SessionOptions, StopReason, StopRules,
};
use abbe::scene::Settings;
use abbe::scene::settings::IntegratorKind;
use regex::Regex;
use std::convert::Infallible;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};
use std::sync::{Arc, mpsc};
use std::time::Duration;

const SCENE: &str = r#"
[render]
max_depth = 4
spp = 5
[[sensor]]
resolution = [40, 20]
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
[[light]]
point = { position = [-1, 2, 1], intensity = 1 }
"#;
/// Tiles of its film, of 8 x 8 pixels.
const TILES: u64 = 15;

/// Films of every kind.
fn all_films() -> OutputRequest {
    OutputRequest {
        strategies: true,
        classes: vec![Regex::new("^L.*D.*E$").unwrap().into()],
        shares: true,
        class_table: true,
        ..OutputRequest::default()
    }
}

/// The sums of every film.
fn sums(render: &Render) -> Vec<Vec<i128>> {
    let outputs = render.outputs();
    let mut all = vec![outputs.image.sums()];
    all.extend(outputs.classes.iter().map(|(_, film)| film.sums()));
    all.extend(outputs.shares.iter().flatten().map(|film| film.sums()));
    let strategies = outputs.strategies.as_ref().unwrap().read().unwrap();
    all.extend(strategies.values().map(|film| film.sums()));
    all
}

#[test]
fn passes_are_those_of_the_settings_and_the_same_bytes_as_one_by_one() {
    let (scene, settings) = scene(SCENE);
    let options = |live| SessionOptions {
        outputs: all_films(),
        live,
        ..SessionOptions::default()
    };
    let mut one_by_one = Render::new(&scene, 0, &settings, full_crop(&scene), &all_films());
    (0..5).for_each(|pass| one_by_one.add_pass(pass));
    for live in [false, true] {
        let mut session = Session::new(Arc::clone(&scene), &settings, options(live)).unwrap();
        assert_eq!(session.passes_left(), 5);
        assert_eq!(session.run(), StopReason::Passes);
        let render = session.render();
        assert_eq!(render.passes(), [0, 1, 2, 3, 4]);
        assert!(sums(&render) == sums(&one_by_one), "live: {live}");
        let rows = |r: &Render| -> Vec<_> { r.table().rows().map(|(k, v)| (*k, v.hits)).collect() };
        assert_eq!(rows(&render), rows(&one_by_one));
        assert_eq!(render.counters().paths, one_by_one.counters().paths);
        drop(render);
        let after = session.step();
        assert_eq!((after.pass, after.stop), (None, Some(StopReason::Passes)));
        assert_eq!((after.added, after.passes), (5, 5));
    }
}

#[test]
fn rules_and_drivers_end_a_session() {
    let (scene, settings) = scene(SCENE);
    let session = |stop: StopRules, passes| {
        let options = SessionOptions {
            stop,
            passes: Some(passes),
            ..SessionOptions::default()
        };
        Session::new(Arc::clone(&scene), &settings, options).unwrap()
    };
    let time = StopRules {
        time: Some(Duration::ZERO),
        target_error: None,
    };
    let mut short = session(time, 3..9);
    assert_eq!(short.run(), StopReason::Time);
    assert_eq!(short.render().passes(), [3], "at least one pass");
    let error = StopRules {
        time: None,
        target_error: Some(1e9),
    };
    let mut crude = session(error, 0..NO_LIMIT);
    assert_eq!(crude.run(), StopReason::Error);
    assert_eq!(crude.render().passes().len(), 4, "not trusted before");
    assert!(crude.forecast(None).unwrap().0 > 0.0);
    let mut driven = session(StopRules::default(), 0..NO_LIMIT);
    let mut seen = Vec::new();
    let reason = driven.run_with(|session, progress| {
        seen.push((progress.pass.unwrap(), session.render().passes().len()));
        Ok::<_, Infallible>(if progress.passes == 3 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        })
    });
    assert_eq!(reason, Ok(StopReason::Driver));
    assert_eq!(seen, [(0, 1), (1, 2), (2, 3)]);
    let failing = driven.run_with(|_, _| Err("disk full"));
    assert_eq!(failing, Err("disk full"));
}

#[test]
fn restored_passes_are_not_done_again() {
    let (scene, settings) = scene(SCENE);
    let options = || SessionOptions {
        passes: Some(0..5),
        ..SessionOptions::default()
    };
    let new = || Session::new(Arc::clone(&scene), &settings, options()).unwrap();
    let mut whole = new();
    whole.run();
    let crop = full_crop(&scene);
    let mut before = Render::new(&scene, 0, &settings, crop, &OutputRequest::default());
    [0, 3, 7].into_iter().for_each(|pass| before.add_pass(pass));
    let mut resumed = new();
    let wrong = resumed.restore(&[0], &[1, 2, 3]).unwrap_err();
    assert_eq!(wrong.to_string(), "the film has 4800 sums, the part has 3");
    assert_eq!(resumed.passes_left(), 5);
    resumed
        .restore(before.passes(), &before.outputs().image.sums())
        .unwrap();
    assert_eq!(resumed.passes_left(), 3);
    assert_eq!(resumed.run(), StopReason::Passes);
    assert_eq!(resumed.render().passes(), [0, 3, 7, 1, 2, 4]);
    // pass 7 is one more than the whole has
    let mut seventh = Render::new(&scene, 0, &settings, crop, &OutputRequest::default());
    seventh.add_pass(7);
    let film = |render: &Render| render.outputs().image.sums();
    let extra = film(&seventh);
    let expected: Vec<i128> = film(&whole.render())
        .iter()
        .zip(extra)
        .map(|(a, b)| a + b)
        .collect();
    assert!(film(&resumed.render()) == expected);
}

#[test]
fn a_cancelled_pass_leaves_no_trace_in_the_films() {
    let (scene, settings) = scene(SCENE);
    // with photons: their phase comes first
    for integrator in [IntegratorKind::Bdpt, IntegratorKind::Vcm] {
        let settings = with(&settings, integrator);
        let cancel = Cancel::default();
        let options = SessionOptions {
            outputs: all_films(),
            cancel: cancel.clone(),
            live: true,
            ..SessionOptions::default()
        };
        let mut session = Session::new(Arc::clone(&scene), &settings, options).unwrap();
        session.step();
        let state = |session: &Session| {
            let render = session.render();
            (
                sums(&render),
                render.passes().to_vec(),
                render.counters().paths,
            )
        };
        let before = state(&session);
        let tiles = Arc::new(AtomicU64::new(0));
        let (count, asked) = (Arc::clone(&tiles), cancel.clone());
        session.observe(move |done| {
            assert_eq!((done.pass, done.all), (1, TILES));
            count.fetch_add(1, SeqCst);
            // from the first tile on: no thread begins another
            asked.request();
        });
        // each of the two threads has at most one tile in hand
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
        let cancelled = pool.unwrap().install(|| session.step());
        assert_eq!(
            (cancelled.pass, cancelled.stop),
            (None, Some(StopReason::Interrupted))
        );
        let done = tiles.load(SeqCst);
        assert!(0 < done && done < TILES, "{done} tiles of {TILES}");
        assert!(state(&session) == before);
        // nothing happens while the request stands
        assert_eq!(session.step().pass, None);
        cancel.clear();
        session.observe(|_| {});
        assert_eq!(session.run(), StopReason::Passes);
        let mut whole = Render::new(&scene, 0, &settings, full_crop(&scene), &all_films());
        (0..5).for_each(|pass| whole.add_pass(pass));
        assert!(sums(&session.render()) == sums(&whole));
    }
}

/// A session of three passes that pauses after every pixel or few.
fn pausing(scene: &Arc<abbe::scene::Scene>, settings: &Settings, part: Option<Resumed>) -> Session {
    let options = SessionOptions {
        live: true,
        pauses: true,
        save_interval: Some(Duration::ZERO),
        passes: Some(0..3),
        ..SessionOptions::default()
    };
    let mut session = Session::new(Arc::clone(scene), settings, options).unwrap();
    if let Some(part) = part {
        part.restore(&mut session).unwrap();
    }
    session
}

#[test]
fn what_is_done_of_a_pass_is_saved_and_gone_on_with() {
    let (scene, settings) = scene(SCENE);
    let crop = full_crop(&scene);
    let mut expected = Render::new(&scene, 0, &settings, crop, &OutputRequest::default());
    (0..3).for_each(|pass| expected.add_pass(pass));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.part");
    // every so many steps, all that is left of the session is its part
    let mut session = pausing(&scene, &settings, None);
    let (mut steps, mut saved_in_midst) = (0, 0);
    loop {
        let state = session.step();
        if state.stop.is_some() {
            break;
        }
        assert!(state.save_is_due);
        steps += 1;
        if steps % 97 == 0 {
            let part = part::of(&session);
            assert_eq!(part.header.pass_count(), state.passes);
            saved_in_midst += usize::from(part.unfinished.is_some());
            part::write(&file, &part).unwrap();
            session = pausing(&scene, &settings, Some(Resumed::read(&file).unwrap()));
        }
    }
    assert!(saved_in_midst > 0, "{steps} steps");
    let whole = part::of(&session);
    assert_eq!(whole.unfinished, None);
    assert_eq!(whole.header.pass_count(), 3);
    assert!(whole.sums == expected.outputs().image.sums());
}

#[test]
fn an_unfinished_pass_comes_first_or_is_told() {
    let (scene, settings) = scene(SCENE);
    let mut begun = pausing(&scene, &settings, None);
    begun.step();
    let mut unfinished = begun.unfinished().unwrap();
    let session = |passes, unfinished| {
        let options = SessionOptions {
            passes: Some(passes),
            ..SessionOptions::default()
        };
        let mut session = Session::new(Arc::clone(&scene), &settings, options).unwrap();
        session.restore_unfinished(unfinished).unwrap();
        session
    };
    // as if it had been the third
    unfinished.pass = 2;
    unfinished.done.fill(0);
    unfinished.sums.fill(0);
    let mut third_first = session(0..3, unfinished.clone());
    assert_eq!(third_first.stranded(), None);
    third_first.run();
    assert_eq!(third_first.render().passes(), [2, 0, 1]);
    let mut without = session(0..2, unfinished.clone());
    assert_eq!(without.stranded(), Some(2));
    without.run();
    assert_eq!(without.render().passes(), [0, 1]);
    assert!(without.unfinished().is_none());
    let mut at_its_end = session(0..0, unfinished.clone());
    assert_eq!(at_its_end.stranded(), None);
    at_its_end.run();
    assert!(at_its_end.unfinished().is_some(), "kept for another time");
    unfinished.done.pop();
    let error = at_its_end.restore_unfinished(unfinished).unwrap_err();
    assert_eq!(error.to_string(), "the film has 15 sums, the part has 14");
}

#[test]
fn without_films_of_its_own_a_pass_is_finished_before_a_cancel_counts() {
    let (scene, settings) = scene(SCENE);
    let options = SessionOptions::default();
    let cancel = options.cancel.clone();
    let mut session = Session::new(Arc::clone(&scene), &settings, options).unwrap();
    let tiles = Arc::new(AtomicU64::new(0));
    let count = Arc::clone(&tiles);
    session.observe(move |_| {
        count.fetch_add(1, SeqCst);
        cancel.request();
    });
    assert_eq!(session.run(), StopReason::Interrupted);
    assert_eq!(tiles.load(SeqCst), TILES);
    assert_eq!(session.render().passes(), [0]);
}

#[test]
fn others_read_whole_passes_while_a_live_session_goes_on() {
    let (scene, settings) = scene(SCENE);
    let options = SessionOptions {
        live: true,
        ..SessionOptions::default()
    };
    let mut session = Session::new(Arc::clone(&scene), &settings, options).unwrap();
    let view = session.view();
    let (send, receive) = mpsc::channel();
    let send = std::sync::Mutex::new(send);
    session.observe(move |tiles| {
        // in the midst of a pass
        let render = view.read();
        let found = (
            tiles.pass,
            render.passes().len(),
            render.outputs().image.sums(),
        );
        send.lock().unwrap().send(found).unwrap();
    });
    session.run();
    drop(session);
    let crop = full_crop(&scene);
    let mut whole = Render::new(&scene, 0, &settings, crop, &OutputRequest::default());
    let mut expected = vec![whole.outputs().image.sums()];
    for pass in 0..5 {
        whole.add_pass(pass);
        expected.push(whole.outputs().image.sums());
    }
    let found: Vec<_> = receive.iter().collect();
    assert_eq!(found.len() as u64, 5 * TILES);
    for (pass, passes, sums) in found {
        assert_eq!(pass as usize, passes);
        assert!(sums == expected[passes], "pass {pass}");
    }
}

#[test]
fn a_range_without_passes_is_over_at_once() {
    let (scene, settings) = scene(SCENE);
    for (start, end) in [(3, 3), (5, 3)] {
        let options = SessionOptions {
            passes: Some(start..end),
            ..SessionOptions::default()
        };
        let mut session = Session::new(Arc::clone(&scene), &settings, options).unwrap();
        assert_eq!(session.passes_left(), 0);
        assert_eq!(session.run(), StopReason::Passes);
        assert!(session.render().passes().is_empty());
    }
}

#[test]
fn a_save_is_due_until_it_is_time() {
    let (scene, settings) = scene(SCENE);
    let due = |save_interval| -> Vec<bool> {
        let options = SessionOptions {
            save_interval,
            ..SessionOptions::default()
        };
        let mut session = Session::new(Arc::clone(&scene), &settings, options).unwrap();
        (0..5).map(|_| session.step().save_is_due).collect()
    };
    // not after the last pass: all is over then
    assert_eq!(due(Some(Duration::ZERO)), [true, true, true, true, false]);
    assert_eq!(due(Some(Duration::MAX)), [false; 5]);
    assert_eq!(due(None), [false; 5]);
}

#[test]
fn sensors_and_crops_that_there_are_not_are_refused() {
    let (scene, settings) = scene(SCENE);
    let refused = |options| {
        let session = Session::new(Arc::clone(&scene), &Settings::clone(&settings), options);
        session.err().unwrap()
    };
    let sensor = refused(SessionOptions {
        sensor: 1,
        ..SessionOptions::default()
    });
    assert_eq!(sensor, SessionError::Sensor { index: 1, count: 1 });
    for (x0, x1) in [(3, 3), (5, 4), (0, 41)] {
        let crop = Crop {
            x0,
            x1,
            y0: 0,
            y1: 20,
        };
        let found = refused(SessionOptions {
            crop: Some(crop),
            ..SessionOptions::default()
        });
        let expected = format!(
            "a crop of columns {x0}..{x1} and rows 0..20 is not on a film of 40 x 20 pixels"
        );
        assert_eq!(found.to_string(), expected);
    }
}
