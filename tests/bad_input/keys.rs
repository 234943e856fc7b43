//! The reference of keys: the tables of `docs/scene-files.md` are those of `abbe keys`, and the
//! JSON Schema accepts every scene there is and refuses what the reader does.

use abbe::io::scene_file::{parse_str, reference};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The tables of `abbe keys`, each from its heading on.
fn sections() -> Vec<String> {
    let text = reference::markdown();
    let parts = text.split("### ").skip(1);
    parts
        .map(|part| format!("### {}\n", part.trim_end()))
        .collect()
}

/// `UPDATE_GOLDEN=1` puts the tables into the page, under the headings that are there.
#[test]
fn the_docs_tell_every_key_as_the_reader_reads_it() {
    let path = root().join("docs/scene-files.md");
    let mut page = fs::read_to_string(&path).expect("page");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        for section in sections() {
            let heading = section.lines().next().expect("heading");
            let Some(start) = page.find(&format!("{heading}\n")) else {
                continue;
            };
            // the table is the last of a section
            let table = page[start..].find("\n|").map_or(start, |i| start + i + 1);
            let end = page[table..]
                .find("\n\n")
                .map_or(page.len(), |i| table + i + 1);
            page.replace_range(start..end, &section);
        }
        fs::write(&path, &page).expect("writes");
    }
    let all = sections();
    assert!(all.len() > 40, "{} tables", all.len());
    for section in &all {
        assert!(
            page.contains(section.as_str()),
            "docs/scene-files.md lacks:\n{section}"
        );
    }
    let told = page.lines().filter(|l| l.starts_with("### `")).count();
    assert_eq!(told, all.len(), "docs/scene-files.md has tables of no kind");
}

/// Why a value does not follow a schema, by the keywords that the schema uses.
fn refusal(schema: &Value, value: &Value, root: &Value) -> Option<String> {
    let keywords = schema.as_object().expect("a schema");
    keywords.iter().find_map(|(keyword, rule)| {
        let rules = || rule.as_array().expect("a list");
        let number = || value.as_f64().zip(rule.as_f64());
        let length = || value.as_array().map(Vec::len).zip(rule.as_u64());
        let holds = match keyword.as_str() {
            "$schema" | "title" | "description" | "default" | "definitions" => true,
            "$ref" => {
                let pointer = rule.as_str().expect("text").trim_start_matches('#');
                let target = root
                    .pointer(&pointer.replace("%20", " "))
                    .expect("a definition");
                return refusal(target, value, root);
            }
            "allOf" => return rules().iter().find_map(|rule| refusal(rule, value, root)),
            "anyOf" => rules()
                .iter()
                .any(|rule| refusal(rule, value, root).is_none()),
            "oneOf" => {
                let fits = rules()
                    .iter()
                    .filter(|rule| refusal(rule, value, root).is_none());
                fits.count() == 1
            }
            "enum" => rules().contains(value),
            "const" => rule == value,
            "type" => match rule.as_str().expect("text") {
                "object" => value.is_object(),
                "array" => value.is_array(),
                "string" => value.is_string(),
                "boolean" => value.is_boolean(),
                "number" => value.is_number(),
                "integer" => value.is_i64() || value.is_u64(),
                other => panic!("type {other}"),
            },
            "minimum" => number().is_none_or(|(v, least)| v >= least),
            "maximum" => number().is_none_or(|(v, most)| v <= most),
            "exclusiveMinimum" => number().is_none_or(|(v, least)| v > least),
            "exclusiveMaximum" => number().is_none_or(|(v, most)| v < most),
            "minItems" => length().is_none_or(|(n, least)| n as u64 >= least),
            "maxItems" => length().is_none_or(|(n, most)| n as u64 <= most),
            "items" => {
                let items = value.as_array().into_iter().flatten();
                return items.into_iter().find_map(|item| refusal(rule, item, root));
            }
            "required" => rules().iter().all(|key| {
                let key = key.as_str().expect("text");
                value
                    .as_object()
                    .is_none_or(|table| table.contains_key(key))
            }),
            "properties" => {
                let table = value.as_object().into_iter().flatten();
                return table.into_iter().find_map(|(key, value)| {
                    let found = refusal(rule.get(key)?, value, root)?;
                    Some(format!("{key}.{found}"))
                });
            }
            "additionalProperties" => {
                let known = schema.get("properties");
                let mut further = value.as_object().into_iter().flatten();
                return further.find_map(|(key, value)| {
                    if known.is_some_and(|known| known.get(key).is_some()) {
                        None
                    } else if rule.is_boolean() {
                        Some(format!("unknown key {key}"))
                    } else {
                        refusal(rule, value, root)
                    }
                });
            }
            other => panic!("keyword {other}"),
        };
        (!holds).then(|| format!("{keyword} {rule}: {value}"))
    })
}

fn refused(text: &str) -> Option<String> {
    let schema = reference::json_schema();
    let value: Value = toml::from_str(text).expect("TOML");
    refusal(&schema, &value, &schema)
}

fn scenes_below(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("folder") {
        let path = entry.expect("entry").path();
        if path.is_dir() && !path.ends_with("cases") {
            scenes_below(&path, out);
        } else if path.extension().is_some_and(|e| e == "toml") && !path.ends_with("Cargo.toml") {
            out.push(path);
        }
    }
}

#[test]
fn every_scene_follows_the_schema() {
    let mut paths = Vec::new();
    scenes_below(&root().join("scenes"), &mut paths);
    scenes_below(&root().join("tests"), &mut paths);
    assert!(paths.len() >= 20, "{} scenes", paths.len());
    for path in paths {
        let text = fs::read_to_string(&path).expect("scene");
        assert_eq!(refused(&text), None, "{}", path.display());
    }
}

#[test]
fn the_schema_refuses_what_the_reader_does() {
    let valid = include_str!("valid.toml");
    assert_eq!(refused(valid), None);
    for (from, to) in [
        ("spp = 16", "spq = 16"),
        ("spp = 16", "spp = 0"),
        ("spp = 16", "spp = 1.5"),
        ("lanes = 4", "lanes = 3"),
        ("\"bdpt\"", "\"bpdt\""),
        ("[64, 48]", "[64, 48, 3]"),
        ("fov_deg = 30", "fov_deg = 180"),
        ("radius = 5", "radius = 0"),
        ("radius = 5", "radius = \"5\""),
        ("radius = 5 }", "radios = 5 }"),
        ("sphere = { center = [0, 0, 0], radius = 5 }", "sphere = {}"),
        ("weight = 0.3", "weight = 1.3"),
    ] {
        let text = valid.replace(from, to);
        assert_ne!(text, valid, "{from}");
        assert!(refused(&text).is_some(), "{to}");
        assert!(parse_str(&text, Path::new(".")).is_err(), "{to}");
    }
}
