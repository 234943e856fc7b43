//! Jobs: folders that workers share, workers that die, folders that lie.

use super::{assert_same, bytes, command, fail, folder, json, succeed};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;
use tempfile::TempDir;

fn names(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut paths: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
    paths.sort();
    paths
}

fn edit(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).expect("text");
    assert!(text.contains(from), "{from}: {text}");
    fs::write(path, text.replace(from, to)).expect("writes");
}

#[test]
fn workers_that_are_killed_leave_the_bytes_of_one_run() {
    let dir = folder();
    let out = succeed(
        dir.path(),
        "job new scene.toml -o job --spp 200 --chunk 10 --lease 300ms",
    );
    assert!(out.contains("20 chunks of 10 passes"), "{out}");
    // a frozen job does not look at the scene again
    edit(
        &dir.path().join("scene.toml"),
        "reflectance = 0.7",
        "reflectance = 0.2",
    );
    for round in 0..5 {
        let mut workers: Vec<_> = (0..2)
            .map(|_| {
                command(dir.path(), "job run job --threads 1 -q")
                    .stdout(Stdio::null())
                    .stderr(Stdio::null())
                    .spawn()
                    .expect("runs")
            })
            .collect();
        sleep(Duration::from_millis(40 + 37 * round));
        for worker in &mut workers {
            worker.kill().expect("is killed");
            worker.wait().expect("ends");
        }
    }
    succeed(dir.path(), "job run job --worker last");
    let status = json(&succeed(dir.path(), "job status job --json"));
    assert_eq!(status["done"], 20, "{status}");
    succeed(dir.path(), "job collect job -o job.exr --part job.part");

    edit(
        &dir.path().join("scene.toml"),
        "reflectance = 0.2",
        "reflectance = 0.7",
    );
    succeed(
        dir.path(),
        "render scene.toml --spp 200 -o one.exr --part one.part -q",
    );
    assert_same(&dir, "job.exr", "one.exr");
    assert_same(&dir, "job.png", "one.png");
}

#[test]
fn a_job_ends_at_its_target_error() {
    let dir = folder();
    succeed(
        dir.path(),
        "job new scene.toml -o job --target-error 0.5 --chunk 4",
    );
    succeed(dir.path(), "job run job -q");
    let status = json(&succeed(dir.path(), "job status job --json"));
    let error = status["error"].as_f64().expect("an error");
    assert!(error <= 0.5, "{status}");
    // one chunk before, it was not reached: no more than that is beyond the target
    let passes = status["passes_done"].as_u64().expect("passes");
    let before = passes - 4;
    if before >= 4 {
        succeed(
            dir.path(),
            &format!("render scene.toml --spp {before} -o before.exr --stats before.json -q"),
        );
        let stats = json(&String::from_utf8_lossy(&bytes(&dir, "before.json")));
        let error = stats["sensors"][0]["error"]["relative"].as_f64();
        assert!(error.is_none_or(|e| e > 0.4), "{stats}");
    }
}

/// A job of four passes that are done.
fn done() -> TempDir {
    let dir = folder();
    succeed(dir.path(), "job new scene.toml -o job --spp 4 --chunk 1 -q");
    succeed(dir.path(), "job run job -q");
    dir
}

#[test]
fn a_damaged_part_is_set_aside_and_its_chunks_rendered_again() {
    let dir = done();
    succeed(dir.path(), "job collect job -o first.exr -q");
    for path in names(&dir.path().join("job/parts")) {
        let mut content = fs::read(&path).expect("a part");
        let middle = content.len() / 2;
        content[middle] ^= 1;
        fs::write(&path, content).expect("writes");
    }
    let said = succeed(dir.path(), "job run job");
    assert_eq!(
        names(&dir.path().join("job/damaged")).is_empty(),
        false,
        "{said}"
    );
    succeed(dir.path(), "job collect job -o second.exr -q");
    assert_same(&dir, "first.exr", "second.exr");
}

#[test]
fn jobs_of_others_are_input_like_any_other() {
    let refused = |from: &str, to: &str, said: &[&str]| {
        let dir = done();
        edit(&dir.path().join("job/job.json"), from, to);
        let message = fail(dir.path(), "job run job", 1);
        for word in said {
            assert!(message.contains(word), "{word}: {message}");
        }
    };
    let own = concat!("\"version\": \"", env!("CARGO_PKG_VERSION"), "\"");
    let both = ["0.0.1", env!("CARGO_PKG_VERSION")];
    refused(own, "\"version\": \"0.0.1\"", &both);
    refused(
        "\"scene.toml\"",
        "\"../scene.toml\"",
        &["leads out of the job"],
    );
    refused(
        "\"scene.toml\"",
        "\"/scene.toml\"",
        &["leads out of the job"],
    );
    refused("\"lease_ms\": 60000", "\"lease_ms\": 1", &["lease"]);

    // a copy that is not what its name says, and one that is a link
    let dir = folder();
    succeed(dir.path(), "job new scene.toml -o job --spp 4 --chunk 1 -q");
    let copies = names(&dir.path().join("job/files"));
    let scene = copies
        .iter()
        .find(|path| fs::read_to_string(path).is_ok_and(|text| text.contains("[[sensor]]")));
    let scene = scene.expect("the copy of the scene");
    let text = fs::read_to_string(scene).expect("text");
    fs::write(scene, text.replace("0.7", "0.6")).expect("writes");
    let message = fail(dir.path(), "job run job", 1);
    assert!(message.contains("files"), "{message}");
    #[cfg(unix)]
    {
        fs::remove_file(scene).expect("is removed");
        std::os::unix::fs::symlink(dir.path().join("scene.toml"), scene).expect("links");
        let message = fail(dir.path(), "job run job", 1);
        assert!(message.contains("link"), "{message}");
    }
    // nothing is overwritten, and nothing names this machine
    let message = fail(dir.path(), "job new scene.toml -o job --spp 4", 1);
    assert!(message.contains("job"), "{message}");
    let manifest = String::from_utf8_lossy(&bytes(&dir, "job/job.json")).into_owned();
    let place = dir.path().to_string_lossy();
    assert!(!manifest.contains(place.as_ref()), "{manifest}");
}
