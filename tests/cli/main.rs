//! Runs the `abbe` program: exit codes, messages, files, interrupts, merging.

mod beginning;
mod bench;
#[cfg(all(unix, feature = "view"))]
mod browser;
mod develop;
#[cfg(unix)]
mod interrupts;
mod job;
mod measures;
mod outputs;
mod tev;
#[cfg(feature = "view")]
mod view;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// A glass ball on a wall under a lamp, small enough for many passes a second.
const SCENE: &str = r#"
[render]
spp = 8
max_depth = 6

[[sensor]]
name = "camera"
resolution = [24, 16]
perspective = { eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 40 }

[medium.crown]
glass = "N-BK7"

[material.white]
diffuse = { reflectance = 0.7 }
[material.clear]
dielectric = {}

[[object]]
name = "wall"
quad = { center = [0, 0, -1], u = [2, 0, 0], v = [0, 2, 0] }
material = "white"

[[object]]
name = "ball"
sphere = { radius = 0.6 }
material = "clear"
interior = "crown"

[[object]]
name = "lamp"
quad = { center = [0, 2.5, 0], u = [0, 0, 0.5], v = [0.5, 0, 0] }
emission = 5.0
two_sided = true
"#;

/// A folder with the scene in it.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    std::fs::write(folder.path().join("scene.toml"), SCENE).expect("writes");
    folder
}

fn command(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_abbe"));
    command
        .current_dir(folder)
        .args(arguments.split_whitespace());
    command
}

fn run(folder: &Path, arguments: &str) -> Output {
    command(folder, arguments).output().expect("runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs and gives stdout; panics where the exit code is not 0.
fn succeed(folder: &Path, arguments: &str) -> String {
    let output = run(folder, arguments);
    assert_eq!(
        output.status.code(),
        Some(0),
        "abbe {arguments}: {}",
        text(&output.stderr)
    );
    text(&output.stdout)
}

/// Runs and gives stderr; panics where the exit code is another.
fn fail(folder: &Path, arguments: &str, code: i32) -> String {
    let output = run(folder, arguments);
    assert_eq!(
        output.status.code(),
        Some(code),
        "abbe {arguments}: {}",
        text(&output.stderr)
    );
    text(&output.stderr)
}

fn bytes(folder: &TempDir, name: &str) -> Vec<u8> {
    let path: PathBuf = folder.path().join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Compares files without printing them.
fn assert_same(folder: &TempDir, a: &str, b: &str) {
    assert!(bytes(folder, a) == bytes(folder, b), "{a} and {b} differ");
}

fn json(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

#[test]
fn help_lists_what_there_is() {
    let dir = folder();
    let help = succeed(dir.path(), "--help");
    for name in ["render", "info", "compare", "glass", "merge", "banding"] {
        assert!(help.contains(name), "{name}: {help}");
    }
    let render = succeed(dir.path(), "render --help");
    for option in [
        "--spp",
        "--passes",
        "--time",
        "--target-error",
        "--crop",
        "--aov",
        "--spectral",
        "--stats",
        "--part",
        "--regularize",
        "--epsilon",
        "vcm",
        "pssmlt",
        "--sharing",
        "--frame",
    ] {
        assert!(render.contains(option), "{option}: {render}");
    }
    let cost = succeed(dir.path(), "cost --help");
    for option in [
        "--budget", "--spp", "--seeds", "--vary", "methods", "effects",
    ] {
        assert!(cost.contains(option), "{option}: {cost}");
    }
    assert!(
        succeed(dir.path(), "--version")
            .starts_with(&format!("abbe {} (", env!("CARGO_PKG_VERSION")))
    );
}

#[test]
fn misuse_is_explained() {
    let dir = folder();
    let cases = [
        (
            "render scene.toml --passes 3",
            "expected A..B with 0 <= A < B: the passes A, A+1, ..., B-1",
        ),
        (
            "render scene.toml --crop 0,0,5",
            "expected X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1, in pixels from the top left",
        ),
        (
            "render scene.toml --crop 0,0,99,9",
            "error: crop 0,0,99,9 reaches beyond sensor \"camera\" of 24 x 16 pixels",
        ),
        (
            "render scene.toml --time -1",
            "expected a time above 0 such as 10s, 2m or 1h",
        ),
        (
            "render scene.toml --aov grain",
            "expected error, noise, strategies, regularized, unbiased, bias, depth, normal, albedo, direct, ghosts or class:REGEX",
        ),
        (
            "render scene.toml --sensor eye",
            "error: unknown sensor \"eye\" (the scene has: camera)",
        ),
        (
            "render scene.toml --lanes 3",
            "invalid value '3' for '--lanes <N>'",
        ),
        (
            "render scene.toml --wavelengths blue",
            "expected scene, uniform, visible, even, A..B or a list of wavelengths in nm",
        ),
        ("render scene.toml --resume", "--part <FILE>"),
        (
            "render scene.toml --frame 3",
            "error: --frame is for models (.gltf, .glb)",
        ),
        (
            "render a.glb --frame 3 --shutter half",
            "expected a number >= 0 of frames, or a time such as 0.02s or 20ms",
        ),
        ("render a.glb --shutter 1", "--frame <N>"),
        ("compare scene.exr", "<REFERENCE>"),
        (
            "compare scene.exr --banding --axis z",
            "expected x, y, or a pixel X,Y",
        ),
        ("render", "<SCENE>"),
        ("glass", "<NAME>"),
        ("draw scene.toml", "unrecognized subcommand 'draw'"),
    ];
    for (arguments, message) in cases {
        let stderr = fail(dir.path(), arguments, 2);
        assert!(stderr.contains(message), "abbe {arguments}: {stderr}");
    }
    assert_eq!(
        std::fs::read_dir(dir.path()).expect("folder").count(),
        1,
        "nothing was written"
    );
}

#[test]
fn failures_are_explained() {
    let dir = folder();
    std::fs::write(
        dir.path().join("bad.toml"),
        SCENE.replace("spp = 8", "spq = 8"),
    )
    .expect("writes");
    let cases = [
        (
            "render none.toml",
            "error: none.toml: there is no such file (paths are relative to the working directory)",
        ),
        (
            "render bad.toml",
            "error: bad.toml:3:1: unknown key \"spq\" (did you mean \"spp\"?)",
        ),
        (
            "render scene.toml -o no/a.exr",
            "error: no/a.exr: the folder does not exist",
        ),
        ("render scene.toml --max-memory 1K", "error: loading takes "),
        (
            "render scene.toml --max-memory 200M --set sensor.0.resolution=[1000,1000]",
            ", films 183.1 MiB, saving 95.4 MiB: together ",
        ),
        ("render scene.toml --set render.spp=0", "--set render.spp=0"),
        ("glass N-BK77", "unknown glass"),
        ("compare a.exr b.exr", "a.exr"),
        ("merge a.part -o a.exr", "a.part"),
    ];
    for (arguments, message) in cases {
        let stderr = fail(dir.path(), arguments, 1);
        assert!(stderr.contains(message), "abbe {arguments}: {stderr}");
        assert!(
            stderr.lines().all(|l| l.starts_with("error: ")),
            "abbe {arguments}: {stderr}"
        );
    }
    assert_eq!(
        std::fs::read_dir(dir.path()).expect("folder").count(),
        2,
        "nothing was written"
    );
}

#[test]
fn photons_take_the_memory_that_was_announced() {
    let dir = folder();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/bench/closed_room.toml");
    let render = |options: &str| {
        let scene = scene.display();
        let stdout = succeed(
            dir.path(),
            &format!("render {scene} -v --spp 1 --threads 2 --stats s.json -o a.exr {options}"),
        );
        let stats = std::fs::read_to_string(dir.path().join("s.json")).expect("stats");
        let stats: serde_json::Value = serde_json::from_str(&stats).expect("JSON");
        (stdout, stats)
    };
    let peak = |stats: &serde_json::Value| stats["peak_memory_bytes"].as_f64();
    let held = |stats: &serde_json::Value| stats["sensors"][0]["merging"]["bytes"].as_f64();
    let (stdout, all) = render("--integrator ppm");
    let all_held = held(&all).expect("bytes");
    let announced = stdout
        .split_once("about ")
        .and_then(|(_, rest)| rest.split_once(" MiB in a pass"))
        .and_then(|(number, _)| number.parse::<f64>().ok());
    let announced = announced.expect("a line about photons") * 1048576.0;
    // with room for half of them
    let need = stdout
        .lines()
        .find(|line| line.contains("program and scene"));
    let need = need.expect("a line about memory").split([' ', ',']);
    let need: f64 = need.filter_map(|word| word.parse::<f64>().ok()).sum();
    let limit = need * 1048576.0 - 0.5 * announced;
    let refused = format!(
        "render {} --spp 1 --threads 2 -o b.exr --integrator ppm --max-memory {limit:.0}",
        scene.display()
    );
    let message = fail(dir.path(), &refused, 1);
    assert!(message.contains(", photons "), "{message}");
    println!("announced {announced}, held {all_held}");
    // 550,000 vertices of 60 B; the pilot has 4096 light sub-paths, so a standard error of 1 %
    assert!(all_held > 3e7);
    assert!((announced / all_held - 1.0).abs() < 0.04);
    // beside a render with fewer: what else there is takes the same (with fewer still, saving the
    // image takes most)
    let (_, fewer) = render("--integrator ppm --set render.max_depth=3");
    let held = all_held - held(&fewer).expect("bytes");
    if let (Some(more), Some(less)) = (peak(&all), peak(&fewer)) {
        println!("process {more} and {less}, holding {held} more");
        // one batch of light sub-paths is held twice for a moment, and longer paths take scratch:
        // 0.6 to 0.9 MB
        assert!(more - less > 0.98 * held && more - less < 1.02 * held + 2e6);
    }
}

#[test]
fn an_unwritable_place_is_found_before_rendering() {
    let dir = folder();
    std::fs::create_dir(dir.path().join("scene.exr")).expect("folder");
    // 10^9 passes would take hours
    let stderr = fail(dir.path(), "render scene.toml --spp 1000000000", 1);
    assert!(
        stderr.contains("scene.exr: is a folder, not a file"),
        "{stderr}"
    );
}

#[test]
fn renders_and_says_so() {
    let dir = folder();
    let short = succeed(dir.path(), "render scene.toml --spp 2");
    let line = short.lines().next().unwrap_or_default();
    let effects = "dispersion, absorption, specular, regularization; memory ";
    assert!(
        line.starts_with(effects) && line.ends_with(" (-v tells why)"),
        "{short}"
    );
    let stdout = succeed(dir.path(), "render scene.toml --spp 2 -v");
    for part in [
        "dispersion     on",
        "scene.exr: 24 x 16 pixels, 2 passes, all passes done",
        "scene.png, exposure ",
        "error",
    ] {
        assert!(stdout.contains(part), "{part}: {stdout}");
    }
    assert_eq!(&bytes(&dir, "scene.png")[1..4], b"PNG");
    assert!(
        succeed(
            dir.path(),
            "render scene.toml --spp 2 --no-preview -q -o q.exr"
        )
        .is_empty()
    );
    assert!(!dir.path().join("q.png").exists());
    assert_same(&dir, "scene.exr", "q.exr");
}

#[test]
fn every_sensor_gets_an_image() {
    let dir = folder();
    let second = "[[sensor]]\nname = \"side\"\nresolution = [5, 4]\northographic = { eye = [3, 0, 0], target = [0, 0, 0], height = 2 }\n";
    std::fs::write(dir.path().join("two.toml"), format!("{SCENE}{second}")).expect("writes");
    succeed(dir.path(), "render two.toml -q --spp 1 --spectral 3");
    for name in [
        "two.camera.exr",
        "two.camera.png",
        "two.side.exr",
        "two.side.spectral.exr",
    ] {
        assert!(dir.path().join(name).exists(), "{name}");
    }
    succeed(
        dir.path(),
        "render two.toml -q --spp 1 --sensor side -o only.exr",
    );
    assert_same(&dir, "two.side.exr", "only.exr");
    let message = "error: --part holds one sensor, the scene has 2: add --sensor NAME (or \
                   --together, for detectors and the integrator light)\n";
    assert_eq!(
        fail(dir.path(), "render two.toml --part a.part", 2),
        message
    );
}

#[test]
fn threads_do_not_matter() {
    let dir = folder();
    let layers = "--aov error,strategies,depth,normal,albedo,class:LS+DE --spectral 5";
    succeed(
        dir.path(),
        &format!("render scene.toml -q --threads 1 -o one.exr {layers}"),
    );
    succeed(
        dir.path(),
        &format!("render scene.toml -q --threads 2 -o two.exr {layers}"),
    );
    assert_same(&dir, "one.exr", "two.exr");
    assert_same(&dir, "one.spectral.exr", "two.spectral.exr");
    let image = abbe::io::exr::read(&dir.path().join("one.exr")).expect("reads");
    let names: Vec<&str> = image.channels.iter().map(|c| c.name.as_str()).collect();
    for name in [
        "X", "Y", "Z", "error.Y", "s0t3.Y", "depth.Z", "normal.X", "albedo.Y", "class0.Y",
    ] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    let sum = |name: &str| -> f64 {
        let channel = image
            .channels
            .iter()
            .find(|c| c.name == name)
            .expect("there");
        channel.values.iter().map(|v| f64::from(*v)).sum()
    };
    let strategies: f64 = names
        .iter()
        .filter(|n| n.starts_with('s') && n.ends_with(".Y"))
        .map(|n| sum(n))
        .sum();
    let whole = sum("Y");
    assert!(
        whole > 0.0 && (strategies / whole - 1.0).abs() < 1e-5,
        "strategies {strategies}, image {whole}"
    );
}

#[test]
fn parts_merge_to_the_same_bytes() {
    let dir = folder();
    succeed(
        dir.path(),
        "render scene.toml -q --passes 0..8 -o whole.exr --part whole.part",
    );
    succeed(
        dir.path(),
        "render scene.toml -q --passes 0..3 -o a.exr --part a.part",
    );
    succeed(
        dir.path(),
        "render scene.toml -q --passes 3..8 -o b.exr --part b.part",
    );
    succeed(
        dir.path(),
        "merge b.part a.part -o merged.exr --part merged.part",
    );
    assert_same(&dir, "whole.exr", "merged.exr");
    assert_same(&dir, "whole.png", "merged.png");
    assert_same(&dir, "whole.part", "merged.part");
    assert!(bytes(&dir, "whole.exr") != bytes(&dir, "a.exr"));
    let twice = fail(dir.path(), "merge a.part a.part -o twice.exr", 1);
    assert_eq!(
        twice,
        "error: passes 0..3 of seed 0 are in more than one part\n"
    );
    succeed(
        dir.path(),
        "render scene.toml -q --passes 3..8 --lanes 1 -o c.exr --part c.part",
    );
    assert!(
        fail(dir.path(), "merge a.part c.part -o c.exr", 1).contains("parts differ in settings")
    );
}

#[test]
fn resuming_gives_the_whole() {
    let dir = folder();
    succeed(dir.path(), "render scene.toml -q -o whole.exr");
    succeed(
        dir.path(),
        "render scene.toml -q --passes 2..5 -o image.exr --part image.part",
    );
    succeed(
        dir.path(),
        "render scene.toml -q -o image.exr --part image.part --resume",
    );
    assert_same(&dir, "whole.exr", "image.exr");
    let stderr = fail(
        dir.path(),
        "render scene.toml -q --seed 4 -o image.exr --part image.part --resume",
        1,
    );
    assert!(
        stderr.contains("cannot resume: it holds passes of another seed than 4"),
        "{stderr}"
    );
    let stderr = fail(
        dir.path(),
        "render scene.toml -q --max-depth 4 -o image.exr --part image.part --resume",
        1,
    );
    assert!(
        stderr.contains("cannot resume: it was made with another settings"),
        "{stderr}"
    );
}

#[test]
fn time_and_error_end_a_render() {
    let dir = folder();
    assert!(succeed(dir.path(), "render scene.toml --time 0.2").contains("time used up"));
    assert!(
        succeed(dir.path(), "render scene.toml --target-error 0.9")
            .contains("target error reached")
    );
}

#[test]
fn statistics_hold_what_is_promised() {
    let dir = folder();
    succeed(
        dir.path(),
        "render scene.toml -q --spp 4 --threads 2 --filter box --stats stats.json",
    );
    let stats = json(&text(&bytes(&dir, "stats.json")));
    assert_eq!(stats["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(
        (&stats["integrator"], &stats["seed"], &stats["threads"]),
        (&"bdpt".into(), &0.into(), &2.into())
    );
    assert_eq!(stats["effects"].as_array().expect("list").len(), 6);
    let sensor = &stats["sensors"][0];
    assert_eq!(
        (&sensor["passes"], &sensor["paths"]),
        (&4.into(), &(4 * 24 * 16).into())
    );
    assert_eq!(
        (&sensor["non_finite"], &sensor["saturated"]),
        (&0.into(), &0.into())
    );
    for key in [
        "wall_seconds",
        "closest_rays",
        "shadow_rays",
        "connections_tried",
        "connections_made",
        "relative_error",
    ] {
        assert!(
            sensor[key].as_f64().is_some_and(|v| v > 0.0),
            "{key}: {sensor}"
        );
    }
    // weighted means of all classes and strategies are the image
    let rows = sensor["classes"].as_array().expect("list");
    let total: f64 = rows
        .iter()
        .map(|r| r["weighted_mean"].as_f64().expect("number"))
        .sum();
    let image = abbe::io::exr::read(&dir.path().join("scene.exr")).expect("reads");
    let y = &image
        .channels
        .iter()
        .find(|c| c.name == "Y")
        .expect("there")
        .values;
    let mean = y.iter().map(|v| f64::from(*v)).sum::<f64>() / y.len() as f64;
    // with a box filter, no splat is lost at the border
    assert!(
        (total / mean - 1.0).abs() < 1e-5,
        "table {total}, image {mean}"
    );
    let row = &rows[0];
    for key in ["class", "s", "t", "hits", "raw_mean", "weighted_mean"] {
        assert!(!row[key].is_null(), "{key}: {row}");
    }
}

#[test]
fn info_says_what_and_why() {
    let dir = folder();
    let info = succeed(dir.path(), "info scene.toml");
    for part in [
        "camera        perspective, 24 x 16 pixels",
        "schott:N-BK7, n_d 1.516800, V_d 64.17",
        "dispersion     on",
        "absorption     on",
        "motion         off",
    ] {
        assert!(info.contains(part), "{part}: {info}");
    }
    let value = json(&succeed(dir.path(), "info scene.toml --json"));
    assert_eq!(value["sensors"][0]["width"], 24);
    // of whole passes and of the one in flight
    assert_eq!(value["memory_bytes"]["films"], 2 * 24 * 16 * 3 * 32);
    let resized = json(&succeed(
        dir.path(),
        "info scene.toml --json --set sensor.0.resolution=[4,5]",
    ));
    assert_eq!(resized["sensors"][0]["height"], 5);
}

#[test]
fn glass_shows_the_catalog() {
    let dir = folder();
    let table = succeed(dir.path(), "glass n-bk7");
    assert!(table.contains("n_d  He   587.5618 nm  1.516800"), "{table}");
    let value = json(&succeed(dir.path(), "glass schott:N-SF11 --json"));
    assert!((value["n_d"].as_f64().expect("number") - 1.78472).abs() < 5e-6);
    assert!((value["V_d"].as_f64().expect("number") - 25.68).abs() < 5e-3);
    assert!(
        value["extrapolated_nm"][0][0]
            .as_f64()
            .is_some_and(|nm| nm == 360.0),
        "{value}"
    );
    assert!(
        succeed(dir.path(), "glass --list")
            .lines()
            .any(|l| l.starts_with("schott:N-SF11 "))
    );
    assert!(fail(dir.path(), "glass N-BK8", 1).contains("N-BK7"));
}

#[test]
fn compare_measures() {
    let dir = folder();
    succeed(dir.path(), "render scene.toml -q --spp 2 -o a.exr");
    succeed(dir.path(), "render scene.toml -q --spp 2 --seed 1 -o b.exr");
    succeed(
        dir.path(),
        "render scene.toml -q --spp 2 --crop 0,0,8,8 -o small.exr",
    );
    let same = json(&succeed(dir.path(), "compare a.exr a.exr --json"));
    assert_eq!(
        (&same["rel_mse"], &same["mean_ratio"]["Z"]),
        (&0.0.into(), &1.0.into())
    );
    let other = json(&succeed(dir.path(), "compare a.exr b.exr --json"));
    assert!(other["rmse"].as_f64().is_some_and(|v| v > 0.0), "{other}");
    assert!(succeed(dir.path(), "compare a.exr b.exr").starts_with("relMSE "));
    let size = fail(dir.path(), "compare small.exr a.exr", 1);
    assert_eq!(
        size,
        "error: small.exr: is 8 x 8, the reference 24 x 16 pixels\n"
    );
}

#[test]
fn merging_says_what_it_shares_and_stores() {
    let dir = folder();
    let stdout = succeed(
        dir.path(),
        "render scene.toml -v --integrator vcm --spp 3 --stats s.json",
    );
    for part in ["radius", "vertices of 60 B", "3 wavelengths, largest gap"] {
        assert!(stdout.contains(part), "{part}: {stdout}");
    }
    let stats = json(&String::from_utf8_lossy(&bytes(&dir, "s.json")));
    let merging = &stats["sensors"][0]["merging"];
    assert_eq!(merging["bytes_per_light_vertex"], 60);
    assert_eq!(merging["distinct_wavelengths"], 3);
    assert!(merging["light_vertices"].as_u64().is_some_and(|n| n > 0));
    succeed(dir.path(), "render scene.toml --spp 1 --stats n.json -q");
    let stats = json(&String::from_utf8_lossy(&bytes(&dir, "n.json")));
    assert!(stats["sensors"][0]["merging"].is_null());
}

#[test]
fn chains_are_named_as_info_lists_them() {
    let dir = folder();
    let with = |chains: &str| {
        let render = "[render]\n";
        let scene = SCENE.replace(render, &format!("{render}chains = {chains}\n"));
        std::fs::write(dir.path().join("chains.toml"), scene).expect("writes");
    };
    with(r#"["T ball, T ball", "R ball"]"#);
    let told = succeed(dir.path(), "info chains.toml");
    let listed = |name: &str| told.lines().any(|line| line.trim_end().ends_with(name));
    assert!(listed("T ball, T ball") && listed("R ball"), "{told}");
    assert!(!listed("T ball, R ball, T ball"), "{told}");
    with(r#"["T ball, T bull"]"#);
    let message = fail(dir.path(), "info chains.toml", 1);
    let place = "chains.toml:3:10: no kind of chains is called `T ball, T bull`";
    assert!(message.contains(place), "{message}");
}
