//! Jobs: folders that workers share, workers that die, folders that lie.

use super::{assert_same, bytes, command, fail, folder, json, run, succeed, text};
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
        "job new scene.toml -o job --spp 200 --chunk 10 --lease 0.3s",
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
    let message = fail(dir.path(), "job run job --chunks 19..21", 2);
    assert!(message.contains("0 <= A < B <= 20"), "{message}");
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

/// The estimated error of the first passes.
fn error_after(dir: &Path, passes: u32) -> f64 {
    let name = format!("error{passes}.json");
    succeed(
        dir,
        &format!(
            "render scene.toml --set render.spp=640 --passes 0..{passes} -o error.exr --stats {name} -q"
        ),
    );
    let stats = json(&fs::read_to_string(dir.join(name)).expect("text"));
    let error = stats["sensors"][0]["relative_error"].as_f64();
    error.expect("an error")
}

#[test]
fn a_job_ends_at_its_target_error() {
    let dir = folder();
    // without caustics the error falls steadily
    edit(
        &dir.path().join("scene.toml"),
        "material = \"clear\"\ninterior = \"crown\"",
        "material = \"white\"",
    );
    let [before, after] = [48, 64].map(|passes| error_after(dir.path(), passes));
    assert!(after < before, "{before} {after}");
    // reached by the fourth chunk of 16 passes, not by three
    let target = (before * after).sqrt();
    let make = |job: &str| {
        let options = format!("--spp 640 --target-error {target} --chunk 16");
        let out = succeed(
            dir.path(),
            &format!("job new scene.toml -o {job} {options}"),
        );
        assert!(out.contains(": 640 passes in 40 chunks of 16"), "{out}");
    };
    let chunks_done = |job: &str| {
        let status = json(&succeed(dir.path(), &format!("job status {job} --json")));
        let error = status["error"].as_f64().expect("an error");
        assert!(error <= target, "{status}");
        assert_eq!(status["left_s"], 0.0, "{status}");
        status["done"].as_u64().expect("chunks")
    };
    make("one");
    let out = succeed(dir.path(), "job run one --threads 1");
    assert!(out.contains("; the error is "), "{out}");
    assert_eq!(chunks_done("one"), 4);
    // of two workers, each has one chunk more at most, of which one may be needed
    make("two");
    let workers = [0, 1].map(|_| {
        let mut worker = command(dir.path(), "job run two --threads 1 -q");
        worker.spawn().expect("runs")
    });
    for mut worker in workers {
        assert!(worker.wait().expect("ends").success());
    }
    let done = chunks_done("two");
    assert!((4..=6).contains(&done), "{done}");
    // without a number of passes the error alone ends it
    let new = "job new scene.toml -o endless --target-error 0.5 --chunk 4";
    let out = succeed(dir.path(), new);
    assert!(out.contains("endless: chunks of 4 passes"), "{out}");
    succeed(dir.path(), "job run endless -q");
    let status = json(&succeed(dir.path(), "job status endless --json"));
    assert!(status["chunks"].is_null(), "{status}");
    assert!(
        status["error"].as_f64().is_some_and(|e| e <= 0.5),
        "{status}"
    );
}

#[test]
fn nothing_is_left_of_a_job_that_cannot_be_made() {
    let dir = folder();
    let scenes = dir.path().join("scenes");
    fs::create_dir(&scenes).expect("a folder");
    let refused = |arguments: &str, code: i32, said: &str| {
        let message = fail(dir.path(), &format!("job new {arguments} --chunk 1"), code);
        assert!(message.contains(said), "{said}: {message}");
        let left: Vec<PathBuf> = names(dir.path());
        let left = left.iter().filter_map(|p| p.file_name()?.to_str());
        assert_eq!(left.collect::<Vec<_>>(), ["scene.toml", "scenes"]);
    };
    refused("scene.toml -o job --sensor other", 2, "unknown sensor");
    refused("scene.toml -o no/job", 1, "no folder to make a job in");
    refused("scene.toml -o scenes/../scene.toml", 1, "no empty folder");
    fs::write(scenes.join("bad.toml"), "[[sensor]]\n").expect("writes");
    refused("scenes/bad.toml -o job", 1, "bad.toml");
    #[cfg(unix)]
    {
        let text = fs::read_to_string(dir.path().join("scene.toml")).expect("text");
        let named = text.replace(
            "glass = \"N-BK7\"",
            "file = \"glass.csv\"\nextrapolate = true",
        );
        assert_ne!(text, named);
        fs::write(scenes.join("linked.toml"), named).expect("writes");
        fs::write(scenes.join("real.csv"), "400,1.53\n700,1.51\n").expect("writes");
        std::os::unix::fs::symlink("real.csv", scenes.join("glass.csv")).expect("links");
        refused("scenes/linked.toml -o job", 1, "no symbolic links");
    }
}

#[test]
fn what_killed_workers_leave_is_removed() {
    let dir = done();
    let stale = dir.path().join("job/parts/.abbe-killed.tmp");
    let make = || {
        let file = fs::File::create(&stale).expect("a file");
        let long_ago = std::time::SystemTime::now() - Duration::from_secs(1000);
        file.set_modified(long_ago).expect("a time");
    };
    for arguments in ["job run job -q", "job collect job -o a.exr -q"] {
        make();
        succeed(dir.path(), arguments);
        assert!(!stale.exists(), "{arguments}");
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
    let message = text(&run(dir.path(), "job status job --json").stderr);
    assert!(
        message.contains(".part: not a valid part file"),
        "{message}"
    );
    assert!(message.contains("set aside as"), "{message}");
    let said = succeed(dir.path(), "job run job");
    let damaged = names(&dir.path().join("job/damaged"));
    assert!(!damaged.is_empty(), "{said}");
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

    // another scene than the one that the job names
    let dir = done();
    let path = dir.path().join("job/job.json");
    let mut manifest = json(&fs::read_to_string(&path).expect("text"));
    let own = manifest["header"]["scene_hash"].as_u64().expect("a hash");
    manifest["header"]["scene_hash"] = 7.into();
    fs::write(&path, manifest.to_string()).expect("writes");
    let message = fail(dir.path(), "job run job", 1);
    let both = format!("scene (hash): {:016x} and {own:016x}", 7);
    assert!(message.contains(&both), "{message}");

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
