//! Outputs: nothing that is read or not theirs is destroyed, nothing is lost.

use super::{SCENE, bytes, command, fail, folder, succeed, text};
use std::path::Path;

#[cfg(unix)]
fn make_pipe(dir: &tempfile::TempDir, name: &str) {
    let mut mkfifo = std::process::Command::new("mkfifo");
    let made = mkfifo.arg(dir.path().join(name)).status();
    assert!(made.expect("mkfifo runs").success());
}

#[test]
fn no_output_takes_the_place_of_an_input() {
    let dir = folder();
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models/cases/own-texture");
    for name in ["wood.toml", "wood.png"] {
        std::fs::copy(case.join(name), dir.path().join(name)).expect("copies");
    }
    std::fs::create_dir(dir.path().join("sub")).expect("folder");
    let texture = bytes(&dir, "wood.png");
    for (arguments, file) in [
        (
            "render scene.toml --stats sub/../scene.toml",
            "sub/../scene.toml",
        ),
        ("render scene.toml --part scene.toml", "scene.toml"),
        (
            "render scene.toml --part scene.toml --overwrite",
            "scene.toml",
        ),
        // the preview of the default image
        ("render wood.toml", "wood.png"),
    ] {
        let message = fail(dir.path(), &format!("{arguments} --spp 1"), 2);
        let expected = format!(
            "error: {file} is read by this command: it would be lost (allowed: another file)\n"
        );
        assert_eq!(message, expected, "{arguments}");
    }
    assert_eq!(text(&bytes(&dir, "scene.toml")), SCENE);
    assert!(bytes(&dir, "wood.png") == texture);
    let message = fail(dir.path(), "render scene.toml -o a.exr --part ./a.exr", 2);
    assert_eq!(
        message,
        "error: ./a.exr would be written twice, also as a.exr\n"
    );
    succeed(
        dir.path(),
        "render scene.toml -q --spp 1 -o a.exr --part a.part",
    );
    let merging = fail(dir.path(), "merge a.part -o b.exr --part a.part", 2);
    assert!(
        merging.contains("a.part is read by this command"),
        "{merging}"
    );
}

#[test]
#[cfg(unix)]
fn only_files_are_replaced_and_links_are_followed() {
    let dir = folder();
    make_pipe(&dir, "pipe.exr");
    for (output, what) in [
        ("pipe.exr", "is a device or a pipe, not a file"),
        ("/dev/null", "is a device or a pipe, not a file"),
        ("/dev/stdout", "is a stream, not a file"),
    ] {
        for option in ["--stats", "--part"] {
            let arguments = format!("render scene.toml --spp 1 {option} {output}");
            let message = fail(dir.path(), &arguments, 1);
            assert_eq!(message, format!("error: {output}: {what}\n"));
        }
    }
    std::os::unix::fs::symlink("target.exr", dir.path().join("link.exr")).expect("link");
    succeed(
        dir.path(),
        "render scene.toml -q --spp 1 --no-preview -o link.exr",
    );
    assert!(dir.path().join("link.exr").is_symlink());
    abbe::io::exr::read(&dir.path().join("target.exr")).expect("an image");
}

#[test]
fn a_part_is_not_begun_anew_by_mistake() {
    let dir = folder();
    let render = "render scene.toml -q --spp 2 --part a.part";
    succeed(dir.path(), render);
    let before = bytes(&dir, "a.part");
    let message = fail(dir.path(), render, 1);
    assert_eq!(
        message,
        "error: a.part: holds 2 passes: --resume goes on with them, --overwrite begins anew\n"
    );
    assert!(bytes(&dir, "a.part") == before);
    succeed(dir.path(), &format!("{render} --resume"));
    succeed(dir.path(), &format!("{render} --overwrite"));
    assert!(bytes(&dir, "a.part") == before);
    std::fs::write(dir.path().join("a.part"), "a letter").expect("writes");
    let message = fail(dir.path(), render, 1);
    let expected = "error: a.part: is there and no part of this program: --overwrite replaces it\n";
    assert_eq!(message, expected);
}

#[test]
fn two_processes_do_not_share_a_part() {
    let dir = folder();
    let part = dir.path().join("a.part");
    let lock = abbe::io::lock::FileLock::acquire(&part).expect("free");
    let render = "render scene.toml -q --spp 2 --part a.part";
    let message = fail(dir.path(), render, 1);
    assert_eq!(
        message,
        "error: a.part: another process writes it now (allowed: another file)\n"
    );
    drop(lock);
    succeed(dir.path(), render);
    assert!(!dir.path().join("a.part.lock").exists());
}

/// A folder that is gone for a while costs nothing.
#[test]
#[cfg(unix)]
fn saving_is_tried_again() {
    let dir = folder();
    let out = dir.path().join("out");
    std::fs::create_dir(&out).expect("folder");
    // long enough to move the folder away before the only save, which is the last
    let arguments = "render scene.toml --time 2 -o out/a.exr --part out/a.part";
    let mut child = command(dir.path(), arguments)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("runs");
    let mut stdout = std::io::BufReader::new(child.stdout.take().expect("piped"));
    let mut line = String::new();
    std::io::BufRead::read_line(&mut stdout, &mut line).expect("reads");
    std::fs::rename(&out, dir.path().join("gone")).expect("moves");
    let mut stderr = std::io::BufReader::new(child.stderr.take().expect("piped"));
    let mut told = String::new();
    while !told.contains("cannot save") {
        let read = std::io::BufRead::read_line(&mut stderr, &mut told).expect("reads");
        assert!(read > 0, "it ended: {told}");
    }
    std::fs::rename(dir.path().join("gone"), &out).expect("moves back");
    assert!(child.wait().expect("ends").success());
    let part = abbe::io::part::read(&out.join("a.part")).expect("a part");
    assert!(part.header.pass_count() > 0);
    abbe::io::exr::read(&out.join("a.exr")).expect("an image");
}

#[test]
fn names_in_any_script_do_not_cost_the_image() {
    let dir = folder();
    let scene = SCENE.replace("\"camera\"", "\"\u{4e2d}\"");
    std::fs::write(dir.path().join("scene.toml"), scene).expect("writes");
    succeed(dir.path(), "render scene.toml -q --spp 1");
    let image = abbe::io::exr::read(&dir.path().join("scene.exr")).expect("an image");
    let named = |value: &abbe::io::exr::MetadataValue| {
        *value == abbe::io::exr::MetadataValue::Text("\u{4e2d}".to_owned())
    };
    assert!(image.metadata.entries.iter().any(|(_, value)| named(value)));
}

#[test]
#[cfg(target_os = "linux")]
fn what_does_not_fit_is_told_before() {
    let dir = folder();
    let scene = SCENE.replace("[24, 16]", "[65536, 4096]");
    std::fs::write(dir.path().join("scene.toml"), scene).expect("writes");
    // 48 GiB of films in 6 GB of address space
    let abbe = env!("CARGO_BIN_EXE_abbe");
    let script = format!("ulimit -v 6000000; exec {abbe} render scene.toml --spp 1 --threads 1");
    let output = std::process::Command::new("sh")
        .current_dir(dir.path())
        .args(["-c", &script])
        .output()
        .expect("runs");
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(
        message.starts_with("error: program and scene "),
        "{message}"
    );
    assert!(message.contains("this machine has 5."), "{message}");
}

#[test]
#[cfg(unix)]
fn what_is_no_file_is_not_read() {
    let dir = folder();
    make_pipe(&dir, "pipe");
    make_pipe(&dir, "pipe.zmx");
    for (arguments, name) in [
        ("info /dev/zero", "/dev/zero"),
        ("info pipe", "pipe"),
        ("compare pipe pipe", "pipe"),
        ("merge pipe -o a.exr", "pipe"),
        ("lens pipe.zmx", "pipe.zmx"),
    ] {
        let message = fail(dir.path(), arguments, 1);
        assert!(
            message.contains(name) && message.contains("not a file"),
            "{arguments}: {message}"
        );
    }
}

#[test]
fn one_wavelength_has_a_spectral_image() {
    let dir = folder();
    let scene = "[render]\nwavelengths = { line_nm = 550 }\n[[sensor]]\nresolution = [2, 2]\n\
        detector = { center = [0, 0, -1], normal = [0, 0, 1], width = 0.2, height = 0.2 }\n[[light]]\n\
        beam = { position = [0, 0, 2], direction = [0, 0, -1], radius = 0.5, irradiance = 1 }\n";
    std::fs::write(dir.path().join("line.toml"), scene).expect("writes");
    succeed(dir.path(), "render line.toml -q --spp 1024 --spectral");
    let image = abbe::io::exr::read(&dir.path().join("line.spectral.exr")).expect("an image");
    let line = image.channels.iter().find(|c| c.name.starts_with("line."));
    let line = line.expect("a channel of the line");
    let mean = line.values.iter().sum::<f32>() / line.values.len() as f32;
    // at worst only walks from the light count, of which 5 % hit: 208 of 4096, 0.07 of standard
    // error
    assert!((mean - 1.0).abs() < 0.32, "{mean}");
    let unit = |text: &str| abbe::io::exr::MetadataValue::Text(text.to_owned());
    assert_eq!(image.metadata.get("emissiveUnits"), Some(&unit("W.m^-2")));
}

#[test]
fn messages_say_what_to_write_instead() {
    let dir = folder();
    let at = |name: &str| dir.path().join(name);
    std::fs::write(at("a.xyz"), "3\nwater\nO 0 0 0\n").expect("writes");
    std::fs::write(at("a.png"), b"\x89PNG\r\n\x1a\n").expect("writes");
    let other = SCENE.replace("radius = 0.6", "radius = 0.5");
    std::fs::write(at("other.toml"), other).expect("writes");
    for (arguments, code, expected) in [
        (
            "info none.obj",
            1,
            "error: none.obj: there is no such file (paths are relative to the working directory)\n",
        ),
        (
            "info a.xyz",
            1,
            "error: a.xyz: is no scene file (TOML), and its ending is none of a model's (allowed: .toml, .gltf, .glb, .obj, .ply)\n",
        ),
        (
            "render a.png",
            1,
            "error: a.png: is no scene file (TOML), and its ending is none of a model's (allowed: .toml, .gltf, .glb, .obj, .ply)\n",
        ),
        (
            "render scene.toml -o a.png",
            2,
            "error: a.png: images are OpenEXR files, beside which a PNG preview is written (allowed: a name that ends in .exr)\n",
        ),
        (
            "render scene.toml --stats a.txt",
            2,
            "error: a.txt: statistics are JSON files (allowed: a name that ends in .json)\n",
        ),
        (
            "render scene.toml --aov depth,error,depth",
            2,
            "error: the layer depth is asked for twice\n",
        ),
    ] {
        assert_eq!(fail(dir.path(), arguments, code), expected);
    }
    let message = fail(dir.path(), "render scene.toml --spp few", 2);
    assert!(
        message.contains("expected a whole number from 1 to 4294967295"),
        "{message}"
    );
    succeed(dir.path(), "render scene.toml -q --spp 1");
    succeed(dir.path(), "render other.toml -q --spp 1");
    let output = super::run(dir.path(), "compare scene.exr other.exr");
    let told = text(&output.stderr);
    assert_eq!(
        told,
        "warning: the images are of different scenes or sensors\n"
    );
    succeed(
        dir.path(),
        "render scene.toml -q --passes 0..2 -o p.exr --part p.part",
    );
    let output = super::run(
        dir.path(),
        "render scene.toml -q --passes 5..6 -o p.exr --part p.part --resume",
    );
    assert!(
        text(&output.stderr).contains("passes 2 to 4 will be missing"),
        "{output:?}"
    );
}

#[test]
#[cfg(unix)]
fn files_that_may_not_grow_are_an_error() {
    let dir = folder();
    let abbe = env!("CARGO_BIN_EXE_abbe");
    let script = format!("ulimit -f 1; exec {abbe} render scene.toml --spp 1 --no-preview");
    let output = std::process::Command::new("sh")
        .current_dir(dir.path())
        .args(["-c", &script])
        .output()
        .expect("runs");
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.starts_with("error: scene.exr: "), "{message}");
    assert!(!dir.path().join("scene.exr").exists());
}

#[test]
fn black_images_are_told_of() {
    let dir = folder();
    // a plate in front of the camera, and no lamp on its side
    let plate = "[[object]]\nquad = { center = [0, 0, 3.5], u = [9, 0, 0], v = [0, 9, 0] }\nmaterial = \"white\"\n";
    let scene = SCENE.replace("[0, 2.5, 0]", "[0, 2.5, -9]") + plate;
    std::fs::write(dir.path().join("dark.toml"), scene).expect("writes");
    for spp in [1, 20] {
        let output = super::run(dir.path(), &format!("render dark.toml -q --spp {spp}"));
        let told = text(&output.stderr);
        assert!(
            output.status.success() && told.lines().count() == 1,
            "{told}"
        );
        assert!(
            told.starts_with("warning: the image of sensor \"camera\" is black"),
            "{told}"
        );
    }
    let output = super::run(dir.path(), "render scene.toml -q --spp 2");
    assert_eq!(text(&output.stderr), "");
}

/// Results that cannot be printed cost no file.
#[test]
#[cfg(target_os = "linux")]
fn results_that_cannot_be_printed_are_an_error() {
    let dir = folder();
    let full = || std::fs::File::create("/dev/full").expect("opens");
    for arguments in [
        "info scene.toml",
        "keys",
        "glass N-BK7",
        "render scene.toml --spp 2",
    ] {
        let output = command(dir.path(), arguments).stdout(full()).output();
        let output = output.expect("runs");
        assert_eq!(output.status.code(), Some(1), "{arguments}");
        let message = text(&output.stderr);
        let expected = "error: standard output: No space left on device (os error 28)\n";
        assert_eq!(message, expected, "{arguments}");
    }
    abbe::io::exr::read(&dir.path().join("scene.exr")).expect("an image");
    // a reader that has gone
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let output = command(dir.path(), "keys").stdout(writer).output();
    let output = output.expect("runs");
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(text(&output.stderr), "");
}

#[test]
fn a_study_does_not_write_over_what_it_reads() {
    let dir = folder();
    std::fs::write(dir.path().join("cost.csv"), "400,1\n700,1\n").expect("writes");
    let scene = SCENE.replace("emission = 5.0", "emission = { file = \"cost.csv\" }");
    std::fs::write(dir.path().join("scene.toml"), scene).expect("writes");
    let message = fail(dir.path(), "cost scene.toml --spp 2 -o .", 1);
    assert!(
        message.contains("cost.csv: is read by this command and in the folder that it writes to"),
        "{message}"
    );
    assert_eq!(bytes(&dir, "cost.csv"), b"400,1\n700,1\n");
}

#[test]
fn images_of_detectors_say_how_large_they_are() {
    let dir = folder();
    let detector = "[[sensor]]\nname = \"screen\"\nresolution = [20, 5]\n\
                    detector = { center = [0, 0, 2], u = [0.5, 0, 0], v = [0, 0.25, 0] }\n";
    let scene = format!("{SCENE}{detector}");
    std::fs::write(dir.path().join("scene.toml"), scene).expect("writes");
    succeed(
        dir.path(),
        "render scene.toml -q --spp 1 --sensor screen -o a.exr --part a.part",
    );
    succeed(dir.path(), "merge a.part -q -o b.exr");
    super::assert_same(&dir, "a.exr", "b.exr");
    let file = bytes(&dir, "a.exr");
    let image = abbe::io::exr::read(&dir.path().join("a.exr")).expect("reads");
    let text = |name| image.metadata.get(name).cloned();
    let value = |text: &str| Some(abbe::io::exr::MetadataValue::Text(text.to_owned()));
    assert_eq!(text("detectorSize"), value("1 x 0.5 m"));
    assert_eq!(text("pixelPitch"), value("0.05 x 0.1 m"));
    let name = b"pixelAspectRatio\0float\0\x04\0\0\0";
    let at = file
        .windows(name.len())
        .position(|w| w == name)
        .expect("there")
        + name.len();
    assert_eq!(file[at..at + 4], 0.5_f32.to_le_bytes());
}
