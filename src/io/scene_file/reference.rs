//! The reference of all keys of scene files, from the declarations that the reader itself follows:
//! as tables to read, and as a JSON Schema for editors (draft 7, which most of them understand).

use super::keys::{FINITE, Form, Key, Keys, Kind, Range};
use super::scene::SceneKeys;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;

/// Every kind of table, each after one that it may stand in.
fn kinds() -> Vec<Kind> {
    fn visit(form: &Form, out: &mut Vec<Kind>) {
        match form {
            Form::Tuple(of, _) | Form::List(of) | Form::Map(of) => visit(of, out),
            Form::Any(forms) => forms.iter().for_each(|form| visit(form, out)),
            Form::Table(kind) if out.iter().all(|k| k.name != kind.name) => {
                out.push(*kind);
                for key in (kind.keys)() {
                    visit(&key.form, out);
                }
            }
            _ => {}
        }
    }
    let mut out = Vec::new();
    visit(&Form::Table(SceneKeys::KIND), &mut out);
    out
}

/// The lines of a doc comment as one.
fn joined(lines: &str) -> String {
    let lines: Vec<&str> = lines.lines().map(str::trim).collect();
    lines.join(" ").trim().to_owned()
}

/// Values that are allowed, in words.
fn words(form: &Form) -> String {
    match form {
        Form::Number(_) => "number".to_owned(),
        Form::Integer | Form::OneOf(_) => "whole number".to_owned(),
        Form::Boolean => "true or false".to_owned(),
        Form::Text(what) => (*what).to_owned(),
        Form::Names(_) => "name".to_owned(),
        Form::Tuple(of, n) => match words(of).as_str() {
            "number" => format!("[{n} numbers]"),
            "whole number" => format!("[{n} whole numbers]"),
            other => format!("[{n} times {other}]"),
        },
        Form::List(of) => format!("list: {}", words(of)),
        Form::Map(of) => format!("by name: {}", words(of)),
        Form::Table(kind) => format!("table `{}`", kind.name),
        Form::Any(forms) => {
            let all: Vec<String> = forms.iter().map(words).collect();
            all.join(", or ")
        }
    }
}

/// The unit of a form's numbers.
fn unit(form: &Form) -> &'static str {
    match form {
        Form::Number(unit) => unit,
        Form::Tuple(of, _) | Form::List(of) => unit(of),
        Form::Any(forms) => forms.iter().map(unit).find(|u| !u.is_empty()).unwrap_or(""),
        _ => "",
    }
}

/// The range of a key, or its names.
fn range(key: &Key) -> String {
    fn names(form: &Form) -> Option<String> {
        match form {
            Form::Names(names) => {
                let all: Vec<String> = names
                    .iter()
                    .map(|(name, help)| format!("`\"{name}\"` ({help})"))
                    .collect();
                Some(all.join(", "))
            }
            Form::OneOf(numbers) => {
                let all: Vec<String> = numbers.iter().map(i64::to_string).collect();
                Some(all.join(", "))
            }
            Form::Any(forms) => forms.iter().find_map(names),
            _ => None,
        }
    }
    let text = key.range.map_or("", |range| range.text).to_owned();
    text.is_empty()
        .then(|| names(&key.form))
        .flatten()
        .unwrap_or(text)
}

/// The row of a key: key, type, unit, range, default, meaning.
fn row(key: &Key) -> String {
    let default = match &key.default {
        None => "required".to_owned(),
        Some(text) => text.clone(),
    };
    let unit = key.unit.unwrap_or(unit(&key.form));
    let cells = [
        format!("`{}`", key.name),
        words(&key.form),
        unit.to_owned(),
        range(key),
        default,
        joined(key.help),
    ];
    let mut row = String::from("|");
    for cell in cells {
        _ = write!(row, " {}{}|", cell, if cell.is_empty() { "" } else { " " });
    }
    row
}

/// The tables of all kinds, in Markdown: for each a heading, what it is, and a row per key.
#[must_use]
pub fn markdown() -> String {
    let mut text = String::new();
    for kind in kinds() {
        text += &section(&kind);
        text.push('\n');
    }
    text
}

/// Heading, help and table of a kind.
fn section(kind: &Kind) -> String {
    let mut text = format!("### `{}`\n\n{}\n\n", kind.name, joined(kind.help));
    text += "| key | type | unit | range | default | meaning |\n|---|---|---|---|---|---|\n";
    for key in (kind.keys)() {
        text += &row(&key);
        text.push('\n');
    }
    text
}

/// The JSON Schema of scene files.
#[must_use]
pub fn json_schema() -> Value {
    let definitions: Map<String, Value> = kinds()
        .iter()
        .map(|kind| (kind.name.to_owned(), table_schema(kind)))
        .collect();
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "Scene file of abbe",
        "allOf": [{ "$ref": reference(&SceneKeys::KIND) }],
        "definitions": definitions,
    })
}

fn reference(kind: &Kind) -> String {
    format!("#/definitions/{}", kind.name.replace(' ', "%20"))
}

fn table_schema(kind: &Kind) -> Value {
    let keys = (kind.keys)();
    let required: Vec<&str> = keys
        .iter()
        .filter(|key| key.default.is_none())
        .map(|key| key.name)
        .collect();
    let properties: Map<String, Value> = keys
        .iter()
        .map(|key| (key.name.to_owned(), key_schema(key)))
        .collect();
    json!({
        "type": "object",
        "description": joined(kind.help),
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    })
}

fn key_schema(key: &Key) -> Value {
    let unit = key.unit.unwrap_or(unit(&key.form));
    let mut description = joined(key.help);
    if !unit.is_empty() {
        _ = write!(description, " ({unit})");
    }
    // beside a reference other keys would be ignored
    let mut schema = json!({
        "description": description,
        "allOf": [form_schema(&key.form, key.range)],
    });
    if let Some(default) = key.default.as_deref().and_then(|d| d.parse::<Value>().ok()) {
        schema["default"] = default;
    }
    schema
}

fn form_schema(form: &Form, range: Option<Range>) -> Value {
    match form {
        Form::Number(_) => number_schema("number", Some(range.unwrap_or(FINITE))),
        Form::Integer => number_schema("integer", range),
        Form::OneOf(numbers) => json!({ "enum": numbers }),
        Form::Boolean => json!({ "type": "boolean" }),
        Form::Text(what) => json!({ "type": "string", "description": what }),
        Form::Names(names) => {
            let each = |(name, help): &(&str, &str)| json!({ "const": name, "description": help });
            json!({ "oneOf": names.iter().map(each).collect::<Vec<_>>() })
        }
        Form::Tuple(of, n) => json!({
            "type": "array",
            "items": form_schema(of, range),
            "minItems": n,
            "maxItems": n,
        }),
        Form::List(of) => json!({ "type": "array", "items": form_schema(of, range) }),
        Form::Map(of) => json!({
            "type": "object",
            "additionalProperties": form_schema(of, range),
        }),
        Form::Table(kind) => json!({ "$ref": reference(kind) }),
        Form::Any(forms) => {
            let all: Vec<Value> = forms.iter().map(|form| form_schema(form, range)).collect();
            json!({ "anyOf": all })
        }
    }
}

fn number_schema(kind: &str, range: Option<Range>) -> Value {
    let mut schema = json!({ "type": kind });
    if let Some(range) = range {
        let (low, high) = (json!(range.low), json!(range.high));
        let (least, most) = (
            if range.above_low {
                "exclusiveMinimum"
            } else {
                "minimum"
            },
            if range.below_high {
                "exclusiveMaximum"
            } else {
                "maximum"
            },
        );
        schema[least] = low;
        schema[most] = high;
    }
    schema
}

#[cfg(test)]
mod tests {
    use super::super::{Problem, SceneFileErrors, read_str};
    use super::*;
    use std::path::Path;

    /// Scenes with `KEY` in place of an entry of each kind of table: one way to every kind.
    fn ways() -> Vec<(Kind, String)> {
        fn visit(form: &Form, around: &str, out: &mut Vec<(Kind, String)>) {
            match form {
                Form::Tuple(of, n) => {
                    let items = vec!["VALUE"; *n].join(", ");
                    visit(of, &around.replace("VALUE", &format!("[{items}]")), out);
                }
                Form::List(of) => visit(of, &around.replace("VALUE", "[VALUE]"), out),
                Form::Map(of) => visit(of, &around.replace("VALUE", "{ thing = VALUE }"), out),
                Form::Any(forms) => forms.iter().for_each(|form| visit(form, around, out)),
                Form::Table(kind) if out.iter().all(|(k, _)| k.name != kind.name) => {
                    out.push((*kind, around.replace("VALUE", "{ KEY }")));
                    for key in (kind.keys)() {
                        let entry = format!("{{ {} = VALUE }}", key.name);
                        visit(&key.form, &around.replace("VALUE", &entry), out);
                    }
                }
                _ => {}
            }
        }
        let mut out = Vec::new();
        visit(&Form::Table(SceneKeys::KIND), "VALUE", &mut out);
        out
    }

    fn errors(way: &str, entry: &str) -> SceneFileErrors {
        let text = way.replace("KEY", entry);
        // the outermost table is the file
        let text = text.trim().trim_start_matches('{');
        let text = text.strip_suffix('}').unwrap_or(text).trim();
        read_str(text, "scene", Path::new("/nonexistent"), &[]).expect_err(text)
    }

    #[test]
    fn the_reader_asks_for_every_key_of_the_reference() {
        let ways = ways();
        assert!(ways.len() > 40, "{} kinds", ways.len());
        for (kind, way) in &ways {
            for key in (kind.keys)() {
                let found = errors(way, &format!("{} = 1979-05-27", key.name)).to_string();
                assert!(
                    found.contains("invalid type: date"),
                    "{}.{}: {found}",
                    kind.name,
                    key.name
                );
            }
        }
    }

    #[test]
    fn the_reader_knows_no_key_beyond_the_reference() {
        for (kind, way) in &ways() {
            let names: Vec<String> = (kind.keys)().iter().map(|k| k.name.to_owned()).collect();
            let found = errors(way, "a_key_of_none = 1");
            let known = found.iter().find_map(|e| match &e.problem {
                Problem::Unknown { name, known, .. } if name == "a_key_of_none" => Some(known),
                _ => None,
            });
            assert_eq!(known, Some(&names), "{}", kind.name);
        }
    }

    #[test]
    fn every_default_can_be_told() {
        for kind in kinds() {
            for key in (kind.keys)() {
                let choice = key.default.as_deref() == Some("");
                let has_default = !choice || !key.help.contains("default");
                assert!(has_default && !key.help.trim().is_empty(), "{}", key.name);
                assert!(!row(&key).contains('\n'));
            }
        }
    }
}
