//! An optical bench on the command line: planes that share light paths, the flux in the images,
//! spots.

use super::{assert_same, fail, json, succeed};
use abbe::io::exr::{self, MetadataValue};
use tempfile::TempDir;

const BENCH: &str = r#"
unit = "mm"
[render]
spp = 16
integrator = "light"
wavelengths = { lines_nm = [486.1327, 656.2725] }
[[sensor]]
name = "near"
resolution = [24, 24]
detector = { center = [0, 0, 20], u = [-6, 0, 0], v = [0, 6, 0], transparent = true }
[[sensor]]
name = "far"
resolution = [32, 32]
detector = { center = [0, 0, 30], u = [-4, 0, 0], v = [0, 4, 0] }
[[lens]]
surface = [
    { radius = 60, thickness = 2, glass = "schott:N-SF66", semi_diameter = 10 },
    { radius = -60, semi_diameter = 10 },
]
[[light]]
beam = { position = [1, 0, -5], direction = [0, 0, 1], radius = 4, irradiance = 1 }
"#;

fn bench() -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    std::fs::write(folder.path().join("bench.toml"), BENCH).expect("writes");
    folder
}

#[test]
fn planes_share_light_paths_and_tell_their_flux() {
    let dir = bench();
    let ghost = "class:^LT(1)R(2)R(1)T(2)E$";
    let options = format!("--aov direct,ghosts,{ghost} --spectral 1");
    let stdout = succeed(
        dir.path(),
        &format!("render bench.toml --together {options} --stats bench.json"),
    );
    assert!(
        stdout.contains("lm of direct") && stdout.contains("W at 486.1327 nm"),
        "{stdout}"
    );
    // the one with most pixels leads
    succeed(
        dir.path(),
        &format!("render bench.toml --sensor far -o alone.exr -q {options}"),
    );
    assert_same(&dir, "alone.exr", "bench.far.exr");
    let stats = json(&String::from_utf8_lossy(&super::bytes(&dir, "bench.json")));
    for (i, name) in ["far", "near"].into_iter().enumerate() {
        let image = exr::read(&dir.path().join(format!("bench.{name}.exr"))).expect("an image");
        let flux = |of: &str| match image.metadata.get(of) {
            Some(MetadataValue::Text(text)) => text.clone(),
            other => panic!("{of}: {other:?}"),
        };
        let value = |of: &str| -> f64 {
            let text = flux(of);
            let number = text.split(' ').next().and_then(|n| n.parse().ok());
            number.unwrap_or_else(|| panic!("{text}"))
        };
        assert!(
            flux("flux").contains(" lm, standard error "),
            "{}",
            flux("flux")
        );
        let (all, direct, ghosts) = (value("flux"), value("flux:class0"), value("flux:class1"));
        assert!(direct > 0.0 && ghosts > 0.0 && value("flux:class2") > 0.0);
        assert!(
            ((direct + ghosts) / all - 1.0).abs() < 1e-9,
            "{all} {direct} {ghosts}"
        );
        let told = &stats["sensors"][i]["flux"];
        assert_eq!(told["luminous_lm"]["value"].as_f64(), Some(all));
        assert_eq!(told["classes_lm"][1]["value"].as_f64(), Some(ghosts));
        assert_eq!(told["classes_lm"][2]["class"], ghost["class:".len()..]);
        let spectral = dir.path().join(format!("bench.{name}.spectral.exr"));
        let spectral = exr::read(&spectral).expect("an image");
        let red = spectral.metadata.get("flux:656.2725nm");
        assert!(matches!(red, Some(MetadataValue::Text(t)) if t.contains(" W, standard error ")));
    }
    for (arguments, code, part) in [
        ("--together --integrator bdpt", 1, "only light tracing can"),
        ("--together --sensor far", 2, "cannot be used with"),
        (
            "--aov class:^LT(3)E$",
            2,
            "no lens of the scene has a surface 3",
        ),
        (
            "--aov class:^LR(\"lid\")E$",
            2,
            "there is no object \"lid\"",
        ),
        ("--aov ghosts --integrator vcm", 2, "without photons"),
    ] {
        let message = fail(dir.path(), &format!("render bench.toml {arguments}"), code);
        assert!(message.contains(part), "{arguments}: {message}");
    }
}

/// Parts of detectors that share light paths hold all of their films: merged or gone on with, they
/// are the images of one run, byte for byte.
#[test]
fn parts_hold_all_detectors() {
    let dir = bench();
    succeed(
        dir.path(),
        "render bench.toml --together --spectral 2 -q -o whole.exr --no-preview",
    );
    for (range, name) in [("0..5", "a"), ("5..16", "b")] {
        let part = format!("--passes {range} --part {name}.part -o {name}.exr");
        succeed(
            dir.path(),
            &format!("render bench.toml --together --spectral 2 -q --no-preview {part}"),
        );
    }
    succeed(
        dir.path(),
        "merge a.part b.part -o merged.exr --part all.part --no-preview",
    );
    succeed(
        dir.path(),
        "render bench.toml --together --spectral 2 -q --no-preview --part a.part --resume -o resumed.exr",
    );
    for film in ["far", "near", "far.spectral", "near.spectral"] {
        for of in ["merged", "resumed"] {
            assert_same(
                &dir,
                &format!("whole.{film}.exr"),
                &format!("{of}.{film}.exr"),
            );
        }
    }
    assert_same(&dir, "a.part", "all.part");
    // so does a job, whose chunks are merged by fours
    let new = "job new bench.toml --together --spectral 2 -o job --chunk 3 -q";
    succeed(dir.path(), new);
    succeed(dir.path(), "job run job -q");
    let status = json(&succeed(dir.path(), "job status job --json"));
    let error = status["error"].as_f64();
    assert!(status["done"] == 6 && error > Some(0.0), "{status}");
    succeed(dir.path(), "job collect job -o job.exr --part job.part");
    assert_same(&dir, "a.part", "job.part");
    for film in ["far", "near", "far.spectral", "near.spectral"] {
        assert_same(
            &dir,
            &format!("whole.{film}.exr"),
            &format!("job.{film}.exr"),
        );
    }
    let message = fail(dir.path(), &format!("{new} --sensor far"), 2);
    assert!(message.contains("cannot be used with"), "{message}");
    let message = fail(
        dir.path(),
        "job new bench.toml --together -o other --set render.integrator=path",
        1,
    );
    assert!(message.contains("only light tracing can"), "{message}");
    let message = fail(
        dir.path(),
        "render bench.toml --together --part a.part --resume -q",
        1,
    );
    assert!(
        message.contains("another spectral image (--spectral)"),
        "{message}"
    );
    let message = fail(
        dir.path(),
        "render bench.toml --sensor far --part a.part --resume -q",
        1,
    );
    assert!(
        message.contains("another set of detectors (--together)"),
        "{message}"
    );
    let message = fail(dir.path(), "develop a.part -o a.png", 1);
    assert!(
        message.contains("make their images by abbe merge"),
        "{message}"
    );
}

/// Held to the ghost of the lens, detectors get nothing else; images, parts and `info` say so.
#[test]
fn paths_are_held_to_sequences() {
    let dir = bench();
    let ghost = "LT(1)R(2)R(1)T(2)E";
    let options = "--together --aov direct,ghosts -q";
    for (sequence, name) in [(ghost, "named"), ("ghosts", "all")] {
        let arguments = format!("render bench.toml --sequence {sequence} {options} -o {name}.exr");
        succeed(dir.path(), &arguments);
    }
    // the only pair there is, by the same random numbers
    for film in ["near", "far"] {
        let read = |name: &str| {
            exr::read(&dir.path().join(format!("{name}.{film}.exr"))).expect("an image")
        };
        let [named, all] = ["named", "all"].map(read);
        let value = |of: &str| match named.metadata.get(of) {
            Some(MetadataValue::Text(text)) => text.clone(),
            other => panic!("{of}: {other:?}"),
        };
        assert_eq!(value("sequences"), ghost);
        let power = |of: &str| {
            value(of)
                .split(' ')
                .next()
                .and_then(|n| n.parse::<f64>().ok())
        };
        assert!(power("flux") > Some(0.0) && power("flux") == power("flux:class1"));
        assert_eq!(power("flux:class0"), Some(0.0));
        let values = [&named, &all].map(|image| image.xyz().expect("XYZ"));
        assert_eq!(values[0], values[1]);
    }
    let info = "info bench.toml --set render.sequences=ghosts";
    let told = succeed(dir.path(), info);
    let expected = "sequences\n  1 sequence, each with the same share of the samples\n  L T(1) R(2) R(1) T(2) E\n";
    assert!(told.contains(expected), "{told}");
    assert!(!told.contains("integrator merges"), "{told}");
    let told = json(&succeed(dir.path(), &format!("{info} --json")));
    assert_eq!(told["sequences"][0], "L T(1) R(2) R(1) T(2) E");
    // parts of all paths do not go on with some
    let part = "--passes 0..1 --sensor far --part a.part -q --no-preview";
    succeed(dir.path(), &format!("render bench.toml {part}"));
    for (arguments, code, message) in [
        (format!("{part} --resume --sequence {ghost}"), 1, "a.part"),
        ("--sequence LT(1)D(2)E".to_owned(), 2, "`D` has no place"),
        ("--sequence LT(3)E".to_owned(), 1, "--set render.sequences"),
        ("--sequence LT(3)E".to_owned(), 1, "has a surface 3"),
        (
            "--sequence LTTE --sequence LT(1)T(2)E".to_owned(),
            1,
            "hold the same paths",
        ),
        (
            "--sequence LE --integrator vcm".to_owned(),
            1,
            "made by walks alone (allowed with them: integrator",
        ),
        (
            "--sequence LE --regularize mis".to_owned(),
            1,
            "regularize = \"off\"",
        ),
        ("--sequence LE --aim all".to_owned(), 1, "aim = \"off\""),
        (
            "--set render.sequences={ghosts=[\"rear\"]}".to_owned(),
            1,
            "lens \"rear\" is not defined (allowed: \"lens 0\")",
        ),
    ] {
        let found = fail(dir.path(), &format!("render bench.toml {arguments}"), code);
        assert!(found.contains(message), "{arguments}: {found}");
    }
}

#[test]
fn spots_are_measured_line_by_line() {
    let dir = bench();
    succeed(
        dir.path(),
        "render bench.toml --sensor far -o far.exr --spectral 1 -q --spp 64",
    );
    let spots = succeed(dir.path(), "spot far.spectral.exr --drawing spot.svg");
    assert!(
        spots.contains("no standard errors: they need a render with --aov noise"),
        "{spots}"
    );
    assert!(
        spots.contains("486.1327 nm") && spots.contains("656.2725 nm"),
        "{spots}"
    );
    let svg = super::text(&super::bytes(&dir, "spot.svg"));
    assert!(
        svg.starts_with("<svg") && svg.matches("<polyline").count() == 6,
        "{svg}"
    );
    let found = json(&succeed(
        dir.path(),
        "spot far.spectral.exr --json --frequencies 0.5,1",
    ));
    let spot = |i: usize| &found["spots"][i];
    let number = |i: usize, key: &str| spot(i)[key].as_f64().expect("a number");
    // the beam is off the axis by 1 mm, red is bent less: farther from the axis, and larger
    let x = |i: usize| spot(i)["centroid"][0].as_f64().expect("a number");
    assert!(
        x(0).abs() < x(1).abs() && number(0, "rms") < number(1, "rms"),
        "{found:#}"
    );
    // both lines have the same power but for Fresnel's losses, of 65 536 paths
    assert!((number(0, "power") / number(1, "power") - 1.0).abs() < 0.05);
    // with the noise of the pixels all figures have errors, and other figures are no other
    succeed(
        dir.path(),
        "render bench.toml --sensor far -o noise.exr --spectral 1 -q --spp 64 --aov noise",
    );
    let told = json(&succeed(
        dir.path(),
        "spot noise.spectral.exr --json --frequencies 0.5,1",
    ));
    for i in 0..2 {
        let spot = &told["spots"][i];
        assert_eq!(spot["rms"], found["spots"][i]["rms"]);
        let error = spot["standard_error"]["rms"].as_f64().expect("a number");
        // of 23 000 rays in each line: their spread over the root of their number
        let rms = spot["rms"].as_f64().expect("a number");
        assert!((0.001..0.02).contains(&(error / rms)), "{spot:#}");
    }
    let whole = json(&succeed(
        dir.path(),
        "spot far.exr --json --window 0,0,32,32",
    ));
    assert_eq!(whole["power_unit"], "lm");
    let message = fail(dir.path(), "spot far.exr --window 0,0,33,2", 2);
    assert!(
        message.contains("reaches beyond an image of 32 x 32 pixels"),
        "{message}"
    );
    let message = fail(dir.path(), "spot far.exr --frequencies 900", 1);
    assert!(message.contains("too wide for 900 cycles"), "{message}");
}

/// The page's way from a lens file to a photograph and its resolution: each of its commands works,
/// and prints what the page says.
#[test]
fn from_a_lens_file_to_a_photograph() {
    let root = env!("CARGO_MANIFEST_DIR");
    let page = std::fs::read_to_string(format!("{root}/docs/optics.md")).expect("is there");
    let section = page.split("## From a lens file to a photograph").nth(1);
    let section = section
        .and_then(|s| s.split("\n## ").next())
        .expect("a section");
    let dir = tempfile::tempdir().expect("temporary folder");
    let mut said = String::new();
    let mut commands = 0;
    for block in section.split("```console\n").skip(1) {
        let block = block.split("```").next().unwrap_or_default();
        for line in block.lines() {
            let Some(command) = line.strip_prefix("$ abbe ") else {
                assert!(said.contains(line), "{line}: {said}");
                continue;
            };
            // as on the page, but for the number of samples
            let mut command = command.replace(" scenes/", &format!(" {root}/scenes/"));
            command = command.replace(" --spp 64", "");
            if command.starts_with("render") {
                command += " --spp 2 --set sensor.0.resolution=[90,60] -q";
            }
            said = succeed(dir.path(), &command);
            commands += 1;
        }
    }
    assert_eq!(commands, 4, "{section}");
    assert!(
        said.contains("587.5618 nm x") && said.contains("standard error"),
        "{said}"
    );
    let photograph = exr::read(&dir.path().join("photograph.exr")).expect("an image");
    let xyz = photograph.xyz().expect("three channels");
    let lit = xyz.iter().skip(1).step_by(3).filter(|y| **y > 0.0).count();
    assert!(lit > 90 * 60 / 2, "{lit} pixels have light");
}
