//! Beginning: scenes of `abbe new`, help, completions, manual pages.

use super::{bytes, fail, folder, run, succeed, text};

#[test]
fn new_scenes_render() {
    let dir = folder();
    for (kind, companion) in [
        ("lens", None),
        ("prism", Some("prism.obj")),
        ("room", None),
        ("model", Some("model.obj")),
    ] {
        let said = succeed(dir.path(), &format!("new {kind} {kind}.toml"));
        assert!(said.contains(&format!("{kind}.toml")), "{said}");
        if let Some(file) = companion {
            assert!(said.contains(file), "{said}");
            assert!(!bytes(&dir, file).is_empty());
        }
        let small = "--spp 4 --set sensor.0.resolution=[32,24] --threads 2 -q";
        let output = run(dir.path(), &format!("render {kind}.toml {small}"));
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        // neither a warning nor an image without light
        assert_eq!(text(&output.stderr), "", "{kind}");
        let found = succeed(dir.path(), &format!("info {kind}.toml"));
        assert!(!found.contains("warning"), "{kind}: {found}");
    }
}

#[test]
fn new_leaves_files_alone() {
    let dir = folder();
    let before = bytes(&dir, "scene.toml");
    let message = fail(dir.path(), "new room scene.toml", 1);
    let expected = "error: scene.toml: is there already (allowed: the name of a new file)\n";
    assert_eq!(message, expected);
    assert!(bytes(&dir, "scene.toml") == before);
    // also where only the mesh is there: nothing is written at all
    std::fs::write(dir.path().join("a.obj"), "v 0 0 0\n").expect("writes");
    let message = fail(dir.path(), "new prism a.toml", 1);
    assert!(message.contains("a.obj: is there already"), "{message}");
    assert!(!dir.path().join("a.toml").exists());
    assert_eq!(bytes(&dir, "a.obj"), b"v 0 0 0\n");
    for (name, expected) in [
        (
            "a.txt",
            "a.txt: is no name for a scene file (allowed: NAME.toml)",
        ),
        ("no/b.toml", "no/b.toml: the folder does not exist"),
    ] {
        let message = fail(dir.path(), &format!("new lens {name}"), 1);
        assert!(message.contains(expected), "{message}");
    }
    let message = fail(dir.path(), "new telescope a.toml", 2);
    assert!(message.contains("lens, prism, room, model"), "{message}");
}

#[test]
fn conversion_leaves_edited_scenes_alone() {
    let dir = folder();
    succeed(dir.path(), "new model scene_of_it.toml");
    let convert = "convert scene_of_it.obj -o own.toml";
    succeed(dir.path(), convert);
    let converted = bytes(&dir, "own.toml");
    std::fs::write(dir.path().join("own.toml"), "# edited\n").expect("writes");
    let message = fail(dir.path(), convert, 1);
    let expected =
        "error: own.toml: is there already (allowed: the name of a new file, or --overwrite)\n";
    assert_eq!(message, expected);
    assert_eq!(bytes(&dir, "own.toml"), b"# edited\n");
    succeed(dir.path(), &format!("{convert} --overwrite"));
    assert!(bytes(&dir, "own.toml") == converted);
    let message = fail(dir.path(), "convert scene_of_it.obj -o own.obj", 2);
    assert!(message.contains("a name that ends in .toml"), "{message}");
}

#[test]
fn help_of_a_command_is_its_own() {
    let dir = folder();
    let help = succeed(dir.path(), "help render");
    assert_eq!(help, succeed(dir.path(), "render --help"));
    assert!(help.contains("--target-error"), "{help}");
    assert_eq!(succeed(dir.path(), "help"), succeed(dir.path(), "--help"));
    fail(dir.path(), "help paint", 2);
}

/// A shell runs the script, where there is such a shell.
fn loads(shell: &str, arguments: &[&str]) {
    let dir = folder();
    let script = succeed(dir.path(), &format!("completions {shell}"));
    for word in ["render", "integrator", "target-error", "develop"] {
        assert!(script.contains(word), "{shell}: {word}");
    }
    std::fs::write(dir.path().join("abbe.complete"), script).expect("writes");
    let run = std::process::Command::new(shell)
        .args(arguments)
        .current_dir(dir.path())
        .output();
    match run {
        Ok(output) => {
            let (out, err) = (text(&output.stdout), text(&output.stderr));
            assert!(output.status.success(), "{shell}: {out}{err}");
            assert!(
                out.contains("banding") && err.is_empty(),
                "{shell}: {out}{err}"
            );
        }
        Err(e) => assert_eq!(e.kind(), std::io::ErrorKind::NotFound, "{shell}: {e}"),
    }
}

#[test]
fn completions_load() {
    // the commands that begin with b, as the script completes them
    let bash = "source ./abbe.complete; COMP_WORDS=(abbe b); COMP_CWORD=1; _abbe abbe b abbe; \
                echo \"${COMPREPLY[@]}\"";
    loads("bash", &["--noprofile", "--norc", "-c", bash]);
    let zsh = "autoload -U compinit; compinit -u -D; source ./abbe.complete; \
               whence -w _abbe | grep -q function; functions _abbe_commands";
    loads("zsh", &["-f", "-c", zsh]);
    let fish = "source ./abbe.complete; complete -C 'abbe b'";
    loads("fish", &["--no-config", "-c", fish]);
    let dir = folder();
    let message = fail(dir.path(), "completions tcsh", 2);
    assert!(message.contains("bash"), "{message}");
}

#[test]
fn there_is_a_manual_page_for_each_command() {
    let dir = folder();
    let pages = dir.path().join("man");
    assert!(!fail(dir.path(), "man man", 1).is_empty());
    std::fs::create_dir(&pages).expect("folder");
    succeed(dir.path(), "man man");
    let help = succeed(dir.path(), "--help");
    let commands = help.lines().skip_while(|l| *l != "Commands:").skip(1);
    let commands = commands.take_while(|l| !l.is_empty());
    let names: Vec<&str> = commands
        .filter(|l| l.starts_with("  ") && !l.starts_with("   "))
        .filter_map(|l| l.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(names.len() > 10, "{names:?}");
    for name in &names {
        let page = std::fs::read_to_string(pages.join(format!("abbe-{name}.1"))).expect("page");
        assert!(page.contains(".SH SYNOPSIS"), "{name}: {page}");
    }
    assert!(pages.join("abbe.1").exists());
    assert_eq!(
        std::fs::read_dir(&pages).expect("folder").count(),
        names.len() + 1
    );
}

#[test]
fn the_walk_of_the_documentation_can_be_walked() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/start.md");
    let page = std::fs::read_to_string(page).expect("page");
    let block = page.split("```text\n").nth(1).expect("a transcript");
    let block = block.split("```").next().expect("its end");
    let steps: Vec<&str> = block.split("$ ").skip(1).collect();
    assert_eq!(steps.len(), 10, "{steps:?}");
    assert_eq!(steps[0], "cargo install --locked --path .\n");
    let dir = tempfile::tempdir().expect("temporary folder");
    for step in &steps[1..] {
        let (command, told) = step.split_once('\n').expect("a command");
        let command = command.strip_prefix("abbe ").expect("a command of abbe");
        // as it stands, but small
        let small = if command.starts_with("render") {
            " --set sensor.0.resolution=[32,24] --threads 2"
        } else {
            ""
        };
        let output = run(dir.path(), &format!("{command}{small}"));
        assert!(output.status.success(), "{}", text(&output.stderr));
        let said = text(&output.stderr) + &text(&output.stdout);
        let mut said_lines = said.lines();
        for line in told.lines() {
            // up to the first number
            let start = line.split(|c: char| c.is_ascii_digit()).next();
            let start = start.expect("a line").trim_end_matches(['+', '-']);
            let found = said_lines.any(|l| l.starts_with(start));
            assert!(
                found,
                "{command}: {line:?} is not told, in its place, in {said}"
            );
        }
    }
    for picture in [
        "room.png",
        "room-agx.png",
        "gem.png",
        "own.png",
        "own-dark.png",
    ] {
        assert!(
            bytes_of(dir.path(), picture).starts_with(b"\x89PNG"),
            "{picture}"
        );
    }
}

fn bytes_of(folder: &std::path::Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}
