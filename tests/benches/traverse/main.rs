//! Rays per CPU second through the two-level tree, on one thread: a mesh of a million triangles,
//! the Cornell box, a thousand instances, a mesh that changes its form, a thousand spheres, a lens.
//!
//! ```sh
//! cargo bench --bench traverse                      # all sets; a word keeps those that contain it
//! cargo bench --bench traverse -- --export FOLDER   # scenes and rays as files for other programs
//! cargo bench --bench traverse -- --serve           # for `tests/peers/rays/compare.py`
//! ```
//!
//! CPU time of the thread is counted, so that a busy machine matters little.

mod export;
mod scenes;
mod sets;

use cpu_time::ThreadTime;
use scenes::Scene;
use sets::{Query, Set, hits};
use std::io::{self, BufRead, Write};
use std::path::Path;

/// Rounds over all sets, of which the medians are printed.
const ROUNDS: usize = 11;
const SCENES: [fn() -> Scene; 6] = [
    scenes::million,
    scenes::cornell,
    scenes::instances,
    scenes::moving,
    scenes::spheres,
    scenes::lens,
];

/// Hits of a set and the CPU time it took, in seconds.
fn measure(scene: &Scene, set: &Set, query: Query) -> (usize, f64) {
    let start = ThreadTime::now();
    let hits = hits(scene, set, query);
    (hits, start.elapsed().as_secs_f64())
}

fn report(out: &mut impl Write, only: Option<&str>) -> io::Result<()> {
    let (set, query) = ("set", "query");
    writeln!(out, "{set:20} {query:10} {:>7} {:>10}", "hit", "Mrays/s")?;
    for scene in SCENES.map(|scene| scene()) {
        for set in sets::of(&scene) {
            let name = format!("{}/{}", scene.name, set.name);
            if only.is_some_and(|only| !name.contains(only)) {
                continue;
            }
            for query in Query::ALL {
                let mut times = Vec::new();
                let mut share = 0.0;
                for _ in 0..ROUNDS {
                    let (hits, time) = measure(&scene, &set, query);
                    share = hits as f64 / set.rays.len() as f64;
                    times.push(time);
                }
                times.sort_by(f64::total_cmp);
                let rate = set.rays.len() as f64 / times[ROUNDS / 2] / 1e6;
                writeln!(
                    out,
                    "{name:20} {:10} {:6.1}% {rate:10.2}",
                    query.name(),
                    100.0 * share
                )?;
            }
        }
    }
    Ok(())
}

/// Writes the scenes that other programs can have, and the rays of each.
fn write_files(folder: &Path) -> io::Result<()> {
    std::fs::create_dir_all(folder)?;
    for scene in SCENES.map(|scene| scene()) {
        if !scene.is_shared {
            continue;
        }
        export::scene(&folder.join(format!("{}.scene", scene.name)), &scene)?;
        for set in sets::of(&scene) {
            let name = format!("{}-{}.rays", scene.name, set.name);
            export::rays(&folder.join(name), &set)?;
        }
    }
    Ok(())
}

/// Answers each line "SCENE SET QUERY" with hits and seconds.
fn serve(out: &mut impl Write) -> io::Result<()> {
    let mut loaded: Option<(Scene, Vec<Set>)> = None;
    for line in io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let unknown = || io::Error::other(format!("what is \"{line}\"?"));
        let [scene_name, set_name, query_name] = words[..] else {
            return Err(unknown());
        };
        if loaded.as_ref().is_none_or(|(s, _)| s.name != scene_name) {
            let mut scenes = SCENES.iter().map(|scene| scene());
            let scene = scenes.find(|scene| scene.name == scene_name);
            let scene = scene.ok_or_else(unknown)?;
            let sets = sets::of(&scene);
            loaded = Some((scene, sets));
        }
        let (scene, sets) = loaded.as_ref().ok_or_else(unknown)?;
        let set = sets.iter().find(|set| set.name == set_name);
        let query = Query::ALL.into_iter().find(|q| q.name() == query_name);
        let (set, query) = set.zip(query).ok_or_else(unknown)?;
        let (hits, time) = measure(scene, set, query);
        writeln!(out, "{hits} {time:.9}")?;
        out.flush()?;
    }
    Ok(())
}

fn main() -> io::Result<()> {
    // cargo says that this is a benchmark
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|w| w != "--bench")
        .collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let out = &mut io::stdout();
    match words[..] {
        ["--export", folder] => write_files(Path::new(folder)),
        ["--serve"] => serve(out),
        [only] if !only.starts_with('-') => report(out, Some(only)),
        [] => report(out, None),
        _ => Err(io::Error::other(
            "allowed: --export FOLDER, --serve, or part of a set's name",
        )),
    }
}
