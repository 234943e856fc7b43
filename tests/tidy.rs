//! Rules of the source tree that no compiler checks.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use regex::Regex;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The modules of each floor, from the ground up.
const FLOORS: [&[&str]; 9] = [
    &["math"],
    &["spectrum"],
    &["geometry", "texture"],
    &[
        "bsdf", "camera", "film", "light", "material", "medium", "sampler",
    ],
    &["scene"],
    &["transport"],
    &["integrator"],
    &["io", "render"],
    &["cli"],
];
/// The only uses between modules of one floor.
const SIBLINGS: [(&str, &str); 1] = [("material", "bsdf")];
/// Lower floors that a module does not know all the same.
const STRANGERS: [(&str, &str); 3] = [
    ("geometry", "spectrum"),
    ("bsdf", "geometry"),
    ("transport", "film"),
];
const MAX_LINES: usize = 700;
/// Crates that only some files may name, so that replacing one touches only those.
const CRATES: [(&str, &[&str]); 8] = [
    ("obvhs", &["geometry/tree_build.rs"]),
    (
        "toml",
        &["io/scene_file/", "spectrum/read.rs", "spectrum/library.rs"],
    ),
    (
        "exr",
        &["io/exr.rs", "io/exr_header.rs", "io/image_file/open_exr.rs"],
    ),
    ("png", &["io/png.rs", "io/image_file/png.rs"]),
    ("palette", &["spectrum/xyz.rs"]),
    ("gltf", &["io/gltf/"]),
    ("moxcms", &["io/image_file/icc.rs"]),
    ("clap", &["cli/"]),
];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// All files below `folder` with one of the extensions: path relative to it, and text.
fn files(folder: &str, extensions: &[&str]) -> Vec<(String, String)> {
    fn walk(folder: &Path, out: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.file_name().is_some_and(|n| n == "target") {
                continue;
            }
            if path.is_dir() {
                walk(&path, out);
            } else {
                out.push(path);
            }
        }
    }
    let base = root().join(folder);
    let mut paths = Vec::new();
    walk(&base, &mut paths);
    paths.sort();
    paths.retain(|p| {
        p.extension()
            .is_some_and(|e| extensions.iter().any(|x| e == *x))
    });
    assert!(!paths.is_empty());
    let relative = |p: &Path| {
        p.strip_prefix(&base)
            .unwrap()
            .to_str()
            .unwrap()
            .replace('\\', "/")
    };
    paths
        .iter()
        .map(|p| (relative(p), fs::read_to_string(p).unwrap()))
        .collect()
}

/// Source files without their tests and comments: path relative to `src`, and numbered lines.
fn program() -> Vec<(String, Vec<(usize, String)>)> {
    let sources = files("src", &["rs"]);
    // files that are modules of tests only
    let test_module = Regex::new(r"(?m)^#\[cfg\(test\)\]\n(?:pub )?mod (\w+);").unwrap();
    let mut tests = BTreeSet::new();
    for (path, text) in &sources {
        let folder = match path.strip_suffix("/mod.rs") {
            Some(folder) => folder,
            None => path.strip_suffix(".rs").unwrap(),
        };
        tests.extend(
            test_module
                .captures_iter(text)
                .map(|c| format!("{folder}/{}", &c[1])),
        );
    }
    let mut out = Vec::new();
    for (path, text) in sources {
        let is_test = |module: &String| {
            path.strip_prefix(module)
                .is_some_and(|rest| rest == ".rs" || rest.starts_with('/'))
        };
        if tests.iter().any(is_test) {
            continue;
        }
        // inline tests end the file
        let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
        let lines = text[..end].lines().enumerate();
        let code = lines
            .filter(|(_, line)| !line.trim_start().starts_with("//"))
            .map(|(i, line)| (i + 1, line.to_owned()))
            .collect();
        out.push((path, code));
    }
    out
}

fn report(what: &str, found: &[String]) {
    assert!(found.is_empty(), "{what}:\n{}", found.join("\n"));
}

fn floor(module: &str) -> Option<usize> {
    FLOORS.iter().position(|modules| modules.contains(&module))
}

fn module_of(path: &str) -> &str {
    path.split('/').next().unwrap().trim_end_matches(".rs")
}

#[test]
fn modules_use_only_lower_floors() {
    let name = Regex::new(r"\bcrate::(\w+)").unwrap();
    let mut found = Vec::new();
    let mut uses = 0;
    for (path, lines) in program() {
        let here = module_of(&path);
        if ["lib", "main"].contains(&here) {
            continue;
        }
        let Some(level) = floor(here) else {
            found.push(format!("src/{path}: no floor is known for `{here}`"));
            continue;
        };
        for (number, line) in lines {
            if line.contains("crate::{") {
                found.push(format!(
                    "src/{path}:{number}: name each module in a `use` of its own"
                ));
            }
            for there in name
                .captures_iter(&line)
                .map(|c| c[1].to_owned())
                .filter(|there| there != here)
            {
                uses += 1;
                let allowed = match floor(&there) {
                    Some(other) => {
                        let pair = (here, there.as_str());
                        other < level && !STRANGERS.contains(&pair) || SIBLINGS.contains(&pair)
                    }
                    None => false,
                };
                if !allowed {
                    found.push(format!(
                        "src/{path}:{number}: `{here}` (floor {level}) names `{there}`"
                    ));
                }
            }
        }
    }
    report("higher floors, siblings or strangers", &found);
    assert!(uses > 100, "only {uses} uses seen");
}

#[test]
fn the_library_lists_its_modules_from_the_ground_up() {
    let text = fs::read_to_string(root().join("src/lib.rs")).unwrap();
    let module = Regex::new(r"(?m)^pub mod (\w+);").unwrap();
    let listed: Vec<String> = module
        .captures_iter(&text)
        .map(|c| c[1].to_owned())
        .collect();
    let expected: Vec<&str> = FLOORS.iter().flat_map(|f| f.iter().copied()).collect();
    assert_eq!(listed, expected);
}

#[test]
fn files_are_short_and_say_what_they_are() {
    let mut found = Vec::new();
    for folder in ["src", "tests"] {
        for (path, text) in files(folder, &["rs"]) {
            let lines = text.lines().count();
            if lines > MAX_LINES {
                found.push(format!(
                    "{folder}/{path}: {lines} lines, at most {MAX_LINES}"
                ));
            }
            let described = text.starts_with("//! ") || path.starts_with("fuzz/");
            if !described {
                found.push(format!("{folder}/{path}: no `//!` in the first line"));
            }
        }
    }
    report("files", &found);
}

#[test]
fn every_scene_is_in_the_list_of_scenes() {
    let list = fs::read_to_string(root().join("scenes/README.md")).unwrap();
    let missing: Vec<String> = files("scenes", &["toml"])
        .into_iter()
        .filter(|(path, _)| !list.contains(&format!("`{path}`")))
        .map(|(path, _)| path)
        .collect();
    report("not in scenes/README.md", &missing);
}

#[test]
fn only_the_command_line_prints() {
    let print = Regex::new(r"\b(e?println?|dbg)!").unwrap();
    let mut found = Vec::new();
    for (path, lines) in program() {
        if path.starts_with("cli/") || path == "main.rs" {
            continue;
        }
        let hits = lines.iter().filter(|(_, line)| print.is_match(line));
        found.extend(hits.map(|(number, line)| format!("src/{path}:{number}: {}", line.trim())));
    }
    report("prints", &found);
}

#[test]
fn crates_are_named_where_they_belong() {
    let mut found = Vec::new();
    for (name, allowed) in CRATES {
        // not a module of our own of that name (`io::exr`, `super::exr`)
        let pattern = Regex::new(&format!(r"(?:^|[^\w:])(?:::)?{name}::")).unwrap();
        let mut used = false;
        for (path, lines) in program() {
            for (number, line) in lines.iter().filter(|(_, line)| pattern.is_match(line)) {
                if allowed.iter().any(|a| path.starts_with(a)) {
                    used = true;
                } else if !["exr", "png"].contains(&name)
                    || !path.starts_with("cli/")
                    || line.contains("use ")
                {
                    found.push(format!("src/{path}:{number}: names the crate `{name}`"));
                }
            }
        }
        assert!(
            used,
            "no file names `{name}`: the pattern is wrong, or the crate is not needed"
        );
    }
    report("crates out of place", &found);
}

#[test]
fn nothing_is_left_for_later() {
    // spelled so that this file does not find itself
    let marks = ["TO", "FIX", "XX", "HA"]
        .iter()
        .zip(["DO", "ME", "X", "CK"]);
    let words: Vec<String> = marks.map(|(a, b)| format!("{a}{b}")).collect();
    let macros = ["todo", "unimplemented"].map(|m| format!(r"{m}!\("));
    let pattern = Regex::new(&format!(
        r"\b(?:{}|{})",
        words.join(r"\b|"),
        macros.join("|")
    ))
    .unwrap();
    let mut found = Vec::new();
    for folder in ["src", "tests", "scenes", "spectra"] {
        for (path, text) in files(folder, &["rs", "toml", "md", "py"]) {
            let hits = text
                .lines()
                .enumerate()
                .filter(|(_, line)| pattern.is_match(line));
            found.extend(
                hits.map(|(i, line)| format!("{folder}/{path}:{}: {}", i + 1, line.trim())),
            );
        }
    }
    report("left for later", &found);
}
