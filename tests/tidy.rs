//! Rules of the source tree that no compiler checks.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use regex::Regex;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The modules of each floor, from the ground up.
const FLOORS: [&[&str]; 12] = [
    &["math"],
    &["spectrum"],
    &["develop", "optics"],
    &["geometry", "texture"],
    &[
        "bsdf", "camera", "film", "light", "material", "medium", "sampler",
    ],
    &["scene"],
    &["transport"],
    &["integrator"],
    &["render"],
    &["io"],
    &["job", "report"],
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
/// Lines that a reader takes in before the first render.
const README_LINES: usize = 150;
/// Crates that only some files may name, so that replacing one touches only those.
const CRATES: [(&str, &[&str]); 20] = [
    ("obvhs", &["geometry/tree_build.rs"]),
    (
        "toml",
        &["io/scene_file/", "spectrum/read.rs", "spectrum/library.rs"],
    ),
    (
        "exr",
        &["io/exr.rs", "io/exr_blocks.rs", "io/image_file/open_exr.rs"],
    ),
    ("tobj", &["io/mtl/statements.rs"]),
    ("png", &["io/png.rs", "io/image_file/png.rs"]),
    ("palette", &["spectrum/xyz.rs"]),
    ("gltf", &["io/gltf/"]),
    ("moxcms", &["io/image_file/icc.rs"]),
    ("flate2", &["io/part/format.rs"]),
    ("sha2", &["job/freeze.rs"]),
    ("clap", &["cli/"]),
    ("clap_complete", &["cli/"]),
    ("clap_mangen", &["cli/"]),
    ("console", &["cli/"]),
    ("ctrlc", &["cli/"]),
    ("tev_client", &["cli/tev.rs"]),
    ("httparse", &["cli/view/"]),
    ("getrandom", &["cli/view/"]),
    ("indicatif", &["cli/"]),
    ("signal_hook", &["cli/"]),
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

/// Source files of the crate without their tests and comments: path relative to `src`, and numbered
/// lines. (The Python module is a crate of its own.)
fn program() -> Vec<(String, Vec<(usize, String)>)> {
    let mut sources = files("src", &["rs"]);
    sources.retain(|(path, _)| !path.starts_with("python/"));
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

/// The anchor that a Markdown heading gets on GitHub.
fn anchor(heading: &str) -> String {
    heading
        .to_lowercase()
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

/// Relative links of a Markdown text, outside of code, and the anchors of its headings.
fn links_and_anchors(text: &str) -> (Vec<(usize, String)>, BTreeSet<String>) {
    let link = Regex::new(r"\]\(([^)\s]+)\)").unwrap();
    let code = Regex::new("`[^`]*`").unwrap();
    let (mut links, mut anchors) = (Vec::new(), BTreeSet::new());
    let mut fenced = false;
    for (i, line) in text.lines().enumerate() {
        if line.starts_with("```") {
            fenced = !fenced;
        } else if let Some(heading) = line.strip_prefix('#').filter(|_| !fenced) {
            anchors.insert(anchor(heading.trim_start_matches('#').trim()));
        } else if !fenced {
            // a link may have code for its text, but not for its target
            let line = code.replace_all(line, "");
            let targets = link.captures_iter(&line).map(|c| c[1].to_owned());
            let relative = targets.filter(|t| !t.contains("://") && !t.starts_with("mailto:"));
            links.extend(relative.map(|t| (i + 1, t)));
        }
    }
    (links, anchors)
}

#[test]
fn links_between_documents_lead_somewhere() {
    let texts = files("", &["md"]);
    let mut found = Vec::new();
    let mut followed = 0;
    for (path, text) in &texts {
        let folder = Path::new(path).parent().unwrap();
        for (line, target) in links_and_anchors(text).0 {
            followed += 1;
            let (file, fragment) = target.split_once('#').unwrap_or((&target, ""));
            let there = if file.is_empty() {
                root().join(path)
            } else {
                root().join(folder).join(file)
            };
            let anchored = fragment.is_empty()
                || fs::read_to_string(&there)
                    .is_ok_and(|text| links_and_anchors(&text).1.contains(fragment));
            if !there.exists() || !anchored {
                found.push(format!("{path}:{line}: {target}"));
            }
        }
    }
    report("links to nothing", &found);
    assert!(followed > 50, "only {followed} links seen");
}

#[test]
fn the_anchors_are_those_of_github() {
    for (heading, expected) in [
        ("8. Random numbers by name", "8-random-numbers-by-name"),
        ("Reports: `abbe cost`", "reports-abbe-cost"),
        ("2. Labels, and the factor A", "2-labels-and-the-factor-a"),
    ] {
        assert_eq!(anchor(heading), expected);
    }
}

/// The equations, such as `3.4`, that a comment tags with `[theory (3.4), (3.5)]`.
fn tagged_equations(text: &str) -> Vec<String> {
    let tags = text
        .split("[theory")
        .skip(1)
        .filter_map(|t| t.split(']').next());
    tags.flat_map(|tag| tag.split('(').skip(1))
        .filter_map(|e| Some(e.split(')').next()?.to_owned()))
        .collect()
}

#[test]
fn tags_of_equations_name_equations_of_the_theory() {
    let theory = fs::read_to_string(root().join("docs/theory.md")).unwrap();
    let equations: BTreeSet<&str> = theory
        .split("\\tag{")
        .skip(1)
        .filter_map(|t| t.split('}').next())
        .collect();
    let mut tags = 0;
    let mut wrong = Vec::new();
    for (path, text) in files("src", &["rs"]) {
        for equation in tagged_equations(&text) {
            tags += 1;
            if !equations.contains(equation.as_str()) {
                wrong.push(format!("{path}: there is no equation ({equation})"));
            }
        }
    }
    report("tags without an equation", &wrong);
    assert!(
        equations.len() > 40 && tags > 20,
        "{} {tags}",
        equations.len()
    );
    assert_eq!(
        tagged_equations("[theory (1.2), (9.9) left] (8.8)"),
        ["1.2", "9.9"]
    );
}

#[test]
fn the_readme_is_short() {
    let lines = fs::read_to_string(root().join("README.md"))
        .unwrap()
        .lines()
        .count();
    assert!(
        lines <= README_LINES,
        "README.md: {lines} lines, at most {README_LINES}"
    );
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
                    || !["cli/", "report/"].iter().any(|f| path.starts_with(f))
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
fn comments_wrap_like_the_code_and_begin_with_their_noun() {
    const COLUMNS: usize = 100;
    let vague = Regex::new(r"^//[/!] (?:What|Its|It|Who)\b").unwrap();
    let comment = |line: &&str| line.trim_start().starts_with("//");
    // a row of a table is one line
    let is_wide = |line: &str| line.chars().count() > COLUMNS && !line.contains("| ");
    let mut found = Vec::new();
    for folder in ["src", "tests"] {
        for (path, text) in files(folder, &["rs"]) {
            let lines = text.lines().enumerate();
            let bad = lines
                .filter(|(_, line)| comment(line))
                .filter(|(_, line)| is_wide(line) || vague.is_match(line.trim_start()));
            found.extend(bad.map(|(i, line)| format!("{folder}/{path}:{}: {line}", i + 1)));
        }
    }
    report("comments beyond 100 columns or without a noun", &found);
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

#[test]
fn whatever_is_fuzzed_is_also_mutated_in_the_suite() {
    let mutations: String = files("tests", &["rs"])
        .into_iter()
        .filter(|(path, _)| path.ends_with("mutation.rs"))
        .map(|(_, text)| text)
        .collect();
    let called = Regex::new(r"\b(fuzz_\w+)\(").unwrap();
    let targets = files("tests/fuzz/fuzz_targets", &["rs"]);
    let found: Vec<String> = targets
        .iter()
        .filter(|(_, text)| {
            let name = called.captures(text).map(|c| c[1].to_owned());
            name.is_none_or(|name| !mutations.contains(&name))
        })
        .map(|(path, _)| path.clone())
        .collect();
    report("fuzz targets that no mutation reaches", &found);
}

#[test]
fn actions_of_workflows_are_pinned() {
    let pinned = Regex::new(r"uses: [\w./-]+@[0-9a-f]{40} # v\d").unwrap();
    let found: Vec<String> = files(".github/workflows", &["yml"])
        .iter()
        .flat_map(|(path, text)| text.lines().map(move |line| (path, line)))
        .filter(|(_, line)| line.contains("uses:") && !pinned.is_match(line))
        .map(|(path, line)| format!("{path}: {}", line.trim()))
        .collect();
    report("actions without a hash", &found);
}
