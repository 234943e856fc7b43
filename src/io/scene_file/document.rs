//! The scene file as a TOML document: places, overrides from the command line, and its hash.

use super::error::{Place, Problem, SceneFileError, SceneFileErrors};
use super::reader::MAX_ERRORS;
use crate::io::files::MAX_SCENE_LISTS;
use crate::math::hash::{combine, hash_bytes};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value with its place.
pub type Node<'d> = &'d Spanned<DeValue<'d>>;

/// A replaced value. Its text counts as set behind the file's and the earlier overrides', so that a
/// span says which it is.
#[derive(Clone, Debug)]
struct Override {
    key: String,
    value: String,
    /// Where its text begins.
    start: usize,
}

/// Characters of an override that a message repeats.
const MOST_TOLD: usize = 120;

impl Override {
    /// As typed, `KEY=VALUE`, as far as it is read at a glance.
    fn typed(&self) -> String {
        let whole = format!("{}={}", self.key, self.value);
        match whole.char_indices().nth(MOST_TOLD) {
            Some((end, _)) => format!("{}...", &whole[..end]),
            None => whole,
        }
    }

    /// The value: as TOML where it is, else as a string (`--set render.integrator=path`).
    fn parse(&self) -> Spanned<DeValue<'_>> {
        match DeValue::parse(&self.value) {
            Ok(value) if !self.value.contains('\n') => moved(value, self.start),
            _ => {
                let text = DeValue::String(self.value.as_str().into());
                Spanned::new(self.start..self.start + self.value.len(), text)
            }
        }
    }
}

/// The same value at a place `by` further behind.
fn moved(value: Spanned<DeValue<'_>>, by: usize) -> Spanned<DeValue<'_>> {
    let shift = |span: Range<usize>| span.start + by..span.end + by;
    let span = shift(value.span());
    let value = match value.into_inner() {
        DeValue::Array(items) => {
            DeValue::Array(items.into_iter().map(|item| moved(item, by)).collect())
        }
        DeValue::Table(table) => {
            let entries = table.into_iter().map(|(key, value)| {
                let at = shift(key.span());
                (Spanned::new(at, key.into_inner()), moved(value, by))
            });
            DeValue::Table(entries.collect())
        }
        other => other,
    };
    Spanned::new(span, value)
}

/// The text that spans point into.
#[derive(Clone, Debug)]
pub struct Source {
    name: String,
    text: String,
    /// Where lines begin.
    lines: Vec<usize>,
    overrides: Vec<Override>,
}

impl Source {
    /// A file's text with overrides (key, value).
    #[must_use]
    pub fn new(name: &str, text: &str, overrides: &[(String, String)]) -> Self {
        // one more than the text, whose end is a place too
        let mut start = text.len() + 1;
        let overrides = overrides.iter().map(|(key, value)| {
            let at = start;
            start += value.len() + 1;
            Override {
                key: key.clone(),
                value: value.clone(),
                start: at,
            }
        });
        let breaks = text.match_indices('\n').map(|(i, _)| i + 1);
        Self {
            name: name.to_owned(),
            text: text.to_owned(),
            lines: std::iter::once(0).chain(breaks).collect(),
            overrides: overrides.collect(),
        }
    }

    /// A problem at a place.
    #[must_use]
    pub fn error(&self, span: &Range<usize>, problem: Problem) -> SceneFileError {
        SceneFileError {
            file: self.name.clone(),
            place: self.place(span.start),
            problem,
        }
    }

    /// The place of a byte.
    #[must_use]
    pub fn place(&self, offset: usize) -> Place {
        if offset > self.text.len()
            && let Some(o) = self.overrides.iter().rfind(|o| o.start <= offset)
        {
            return Place::Override(o.typed());
        }
        let line = self.lines.partition_point(|&start| start <= offset);
        let start = self.lines[line - 1];
        let before = self.text.get(start..offset).unwrap_or_default();
        Place::At {
            line,
            column: before.chars().count() + 1,
        }
    }
}

/// Number of tables and lists of a text, or more, by its brackets and the dots of its keys.
fn list_count(text: &str) -> usize {
    let bytes = text.as_bytes();
    let (mut count, mut before, mut in_key) = (0, b'\n', false);
    for (i, &byte) in bytes.iter().enumerate() {
        // what a line begins with tells keys from numbers of a list
        if before == b'\n' {
            in_key = byte.is_ascii_alphabetic() || matches!(byte, b'_' | b'"' | b'\'');
        }
        match byte {
            b'=' => in_key = false,
            b'{' => count += 1,
            b'[' => count += usize::from(before != b'['),
            // of numbers and names of files but few are followed by letters
            b'.' => {
                let next = bytes.get(i + 1).copied().unwrap_or_default();
                count += usize::from(in_key || !next.is_ascii_digit());
            }
            _ => {}
        }
        before = byte;
    }
    count
}

/// Parses the file. Syntax errors are all collected; nothing further is read where there are any.
pub fn parse(source: &Source) -> Result<DeTable<'_>, SceneFileErrors> {
    let lists = list_count(&source.text);
    if lists > MAX_SCENE_LISTS {
        let message = format!(
            "{lists} tables and lists (allowed: at most {MAX_SCENE_LISTS}; a model in glTF holds more objects)"
        );
        let error = source.error(&(0..0), Problem::Form(message));
        return Err(
            SceneFileErrors::from_unsorted(vec![error], 0).expect("invariant: there is an error")
        );
    }
    let (document, errors) = DeTable::parse_recoverable(&source.text);
    let place = |e: &toml::de::Error| {
        source.error(
            &e.span().unwrap_or(0..0),
            Problem::from_message(e.message()),
        )
    };
    let told = errors.iter().take(MAX_ERRORS).map(place).collect();
    match SceneFileErrors::from_unsorted(told, errors.len().saturating_sub(MAX_ERRORS)) {
        None => Ok(document.into_inner()),
        Some(errors) => Err(errors),
    }
}

/// Most parts of the key of an override.
const MAX_STEPS: usize = 32;

/// Replaces or adds the values of the source's overrides. A key is dotted (`render.spp`); a list
/// element is named by its index from 0 or by its `name` (`object.0.material`,
/// `object.lens.material`). Whether the last key exists is left to the reader, which reports
/// unknown keys.
pub fn apply_overrides<'s>(
    document: &mut DeTable<'s>,
    source: &'s Source,
) -> Result<(), SceneFileErrors> {
    let mut errors = Vec::new();
    for o in &source.overrides {
        if let Err(problem) = set(document, &o.key, o.parse()) {
            errors.push(source.error(&(o.start..o.start), problem));
        }
    }
    SceneFileErrors::from_unsorted(errors, 0).map_or(Ok(()), Err)
}

fn set<'s>(
    document: &mut DeTable<'s>,
    key: &str,
    value: Spanned<DeValue<'s>>,
) -> Result<(), Problem> {
    let steps: Vec<&str> = key.split('.').collect();
    if steps.iter().any(|s| s.is_empty()) {
        return Err(Problem::Form(
            "the key has an empty part (allowed: names and indices joined by dots)".to_owned(),
        ));
    }
    // what nests deeper than any scene would take the stack along
    if steps.len() > MAX_STEPS {
        return Err(Problem::Form(format!(
            "the key has {} parts (allowed: at most {MAX_STEPS})",
            steps.len()
        )));
    }
    let span = value.span();
    let new_table = || Spanned::new(span.clone(), DeValue::Table(DeTable::new()));
    let entry = |table: &mut DeTable<'s>, step: &str, new: Spanned<DeValue<'s>>| {
        let name = Spanned::new(span.clone(), step.to_owned().into());
        table.entry(name).or_insert(new);
    };
    let (first, rest) = steps
        .split_first()
        .expect("invariant: split yields at least one part");
    let is_index = |s: &&str| s.parse::<usize>().is_ok();
    if rest.first().is_some_and(is_index) && document.get(*first).is_none() {
        return Err(no_list(document, first));
    }
    entry(document, first, new_table());
    let mut at = document.get_mut(*first).expect("invariant: just inserted");
    for step in rest {
        at = match at.get_mut() {
            DeValue::Table(table) => {
                entry(table, step, new_table());
                table.get_mut(*step).expect("invariant: just inserted")
            }
            DeValue::Array(items) => {
                let count = items.len();
                let named = |v: &Spanned<DeValue<'s>>| {
                    v.get_ref().get("name").and_then(|n| n.get_ref().as_str()) == Some(step)
                };
                let index = step.parse().ok().or_else(|| items.iter().position(named));
                index.and_then(|i: usize| items.get_mut(i)).ok_or_else(|| {
                    Problem::Form(format!(
                        "no list element \"{step}\" (allowed: 0..{count}, or an element's name)"
                    ))
                })?
            }
            other => {
                let kind = other.type_str();
                return Err(Problem::Form(format!(
                    "\"{step}\" cannot be set inside a value of type {kind}"
                )));
            }
        };
    }
    *at = value;
    Ok(())
}

/// An index into a list that the file does not have.
fn no_list(document: &DeTable<'_>, name: &str) -> Problem {
    let lists: Vec<String> = document
        .iter()
        .filter(|(_, value)| value.get_ref().is_array())
        .map(|(key, _)| key.get_ref().to_string())
        .collect();
    let lists = if lists.is_empty() {
        "none".to_owned()
    } else {
        lists.join(", ")
    };
    Problem::Form(format!(
        "there is no list \"{name}\" to index (lists there are: {lists})"
    ))
}

/// A hash of what the document says without its `[render]` table: comments, order of keys and
/// layout do not matter.
#[must_use]
pub fn scene_hash(document: &DeTable<'_>) -> u64 {
    let scene = document.iter().filter(|(key, _)| key.get_ref() != "render");
    scene.fold(0, |hash, (key, value)| {
        combine(
            combine(hash, hash_bytes(key.get_ref().as_bytes())),
            hash_value(value.get_ref()),
        )
    })
}

fn hash_value(value: &DeValue<'_>) -> u64 {
    let (tag, hash) = match value {
        DeValue::String(s) => (1, hash_bytes(s.as_bytes())),
        DeValue::Integer(n) => (2, hash_bytes(n.to_string().as_bytes())),
        DeValue::Float(x) => (3, hash_bytes(x.as_str().as_bytes())),
        DeValue::Boolean(b) => (4, u64::from(*b)),
        DeValue::Datetime(d) => (5, hash_bytes(d.to_string().as_bytes())),
        DeValue::Array(items) => (
            6,
            items
                .iter()
                .fold(0, |h, v| combine(h, hash_value(v.get_ref()))),
        ),
        DeValue::Table(table) => (
            7,
            table.iter().fold(0, |h, (k, v)| {
                combine(
                    combine(h, hash_bytes(k.get_ref().as_bytes())),
                    hash_value(v.get_ref()),
                )
            }),
        ),
    };
    combine(tag, hash)
}
