//! Interrupts: work stops at once and is saved.

use super::{SCENE, assert_same, command, fail, folder, succeed};
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// Interrupts a render once its session begins; what it has printed.
fn interrupt(dir: &TempDir, arguments: &str, signals: &[&str]) -> String {
    let mut child = command(dir.path(), &format!("{arguments} -v"))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("runs");
    let mut stdout = BufReader::new(child.stdout.take().expect("piped"));
    let mut output = String::new();
    // the pilots are over
    while !output.contains("\n  weights ") {
        assert!(
            stdout.read_line(&mut output).expect("reads") > 0,
            "{output}"
        );
    }
    for signal in signals {
        let kill = Command::new("kill")
            .args([&format!("-{signal}"), &child.id().to_string()])
            .status();
        assert!(kill.expect("kill runs").success());
    }
    stdout.read_to_string(&mut output).expect("reads");
    let mut stderr = child.stderr.take().expect("piped");
    stderr.read_to_string(&mut output).expect("reads");
    assert_eq!(child.wait().expect("ends").code(), Some(130), "{output}");
    output
}

#[test]
fn an_interrupt_saves_the_image() {
    for signal in ["INT", "TERM"] {
        let dir = folder();
        succeed(
            dir.path(),
            "render scene.toml -q --spp 1 --part image.part -o first.exr",
        );
        let arguments = "render scene.toml --spp 1000000000 --part image.part --resume";
        let output = interrupt(&dir, arguments, &[signal]);
        assert!(
            output.contains("pass, interrupted") || output.contains("passes, interrupted"),
            "{output}"
        );
        assert!(
            output.contains("interrupted: stops now and saves"),
            "{output}"
        );
        let image = abbe::io::exr::read(&dir.path().join("scene.exr")).expect("reads");
        assert!(
            image
                .channels
                .iter()
                .any(|c| c.values.iter().any(|v| *v > 0.0))
        );
        let part = abbe::io::part::read(&dir.path().join("image.part")).expect("reads");
        assert!(part.header.pass_count() > 0);
    }
}

/// A pass is not waited for, what is done of it is kept, and whoever asks twice loses nothing.
#[test]
fn an_interrupted_pass_is_gone_on_with() {
    let dir = folder();
    let scene = SCENE.replace("[24, 16]", "[480, 320]");
    std::fs::write(dir.path().join("scene.toml"), scene).expect("writes");
    let render = "render scene.toml --spp 2 --part a.part -o a.exr --no-preview";
    let output = interrupt(&dir, render, &["INT", "INT"]);
    let part = abbe::io::part::read(&dir.path().join("a.part")).expect("reads");
    let passes = part.header.pass_count();
    assert_eq!(dir.path().join("a.exr").exists(), passes > 0, "{output}");
    if part.unfinished.is_some() && passes == 0 {
        assert!(
            output.contains("no pass is whole: the part holds what is done"),
            "{output}"
        );
        let message = fail(dir.path(), "merge a.part -o b.exr", 1);
        assert!(
            message.contains("pass 0 is not whole and left out"),
            "{message}"
        );
        let message = fail(dir.path(), "develop a.part", 1);
        assert!(message.contains("no pass of it is whole"), "{message}");
        let message = fail(dir.path(), render, 1);
        assert!(
            message.contains("holds a pass that is not whole: --resume goes on"),
            "{message}"
        );
    }
    succeed(dir.path(), &format!("{render} -q --resume"));
    succeed(
        dir.path(),
        "render scene.toml -q --spp 2 --part b.part -o b.exr --no-preview",
    );
    assert_same(&dir, "a.part", "b.part");
    assert_same(&dir, "a.exr", "b.exr");
}
