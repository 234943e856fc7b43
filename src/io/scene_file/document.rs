//! The scene file as a TOML document: places, overrides from the command line, and reading all of it even where parts are
//! wrong, so that every problem is reported at once.

use super::error::{Place, Problem, SceneFileError};
use crate::math::hash::{combine, hash_bytes};
use serde::de::DeserializeOwned;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue, ValueDeserializer};

/// More errors than this are noise.
const MAX_ERRORS: usize = 50;

/// A replaced value. Its text is set behind the file's and the earlier overrides', so that a span says which it is.
#[derive(Clone, Debug)]
struct Override {
    key: String,
    /// As typed: `KEY=VALUE`.
    typed: String,
    /// `v = VALUE` after as many blanks as there is text before it.
    padded: String,
}

/// The text that spans point into.
#[derive(Clone, Debug)]
pub struct Source {
    name: String,
    text: String,
    overrides: Vec<Override>,
}

impl Source {
    /// A file's text with overrides (key, value).
    #[must_use]
    pub fn new(name: &str, text: &str, overrides: &[(String, String)]) -> Self {
        let mut start = text.len();
        let overrides = overrides
            .iter()
            .map(|(key, value)| {
                let padded = format!("{}\nv = {}", " ".repeat(start), value_as_toml(value));
                start = padded.len();
                Override {
                    key: key.clone(),
                    typed: format!("{key}={value}"),
                    padded,
                }
            })
            .collect();
        Self {
            name: name.to_owned(),
            text: text.to_owned(),
            overrides,
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

    fn place(&self, offset: usize) -> Place {
        if offset > self.text.len()
            && let Some(o) = self.overrides.iter().find(|o| offset <= o.padded.len())
        {
            return Place::Override(o.typed.clone());
        }
        let before = self.text.get(..offset).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        Place::At {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }
}

/// A command-line value as TOML: as it stands where that is a TOML value, else as a string (`--set render.integrator=path`).
fn value_as_toml(value: &str) -> String {
    if !value.contains('\n') && DeValue::parse(value).is_ok() {
        value.to_owned()
    } else {
        format!("{value:?}")
    }
}

/// Parses the file. Syntax errors are all collected; nothing further is read where there are any.
pub fn parse(source: &Source) -> Result<DeTable<'_>, Vec<SceneFileError>> {
    let (document, errors) = DeTable::parse_recoverable(&source.text);
    if errors.is_empty() {
        return Ok(document.into_inner());
    }
    let place = |e: &toml::de::Error| {
        source.error(
            &e.span().unwrap_or(0..0),
            Problem::from_message(e.message()),
        )
    };
    Err(errors.iter().take(MAX_ERRORS).map(place).collect())
}

/// Replaces or adds the values of the source's overrides. A key is dotted (`render.spp`); a list element is named by its
/// index from 0 or by its `name` (`object.0.material`, `object.lens.material`). Whether the last key exists is left to the
/// schema, which reports unknown keys.
pub fn apply_overrides<'s>(
    document: &mut DeTable<'s>,
    source: &'s Source,
) -> Result<(), Vec<SceneFileError>> {
    let mut errors = Vec::new();
    for o in &source.overrides {
        let value = DeTable::parse(&o.padded)
            .map_err(|e| Problem::from_message(e.message()))
            .and_then(|t| {
                t.into_inner()
                    .into_iter()
                    .next()
                    .ok_or_else(|| Problem::Form("no value".to_owned()))
            });
        if let Err(problem) = value.and_then(|(_, value)| set(document, &o.key, value)) {
            errors.push(SceneFileError {
                file: source.name.clone(),
                place: Place::Override(o.typed.clone()),
                problem,
            });
        }
    }
    if errors.is_empty() {
        Ok(())
    } else {
        Err(errors)
    }
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

/// One step from the document's root to a value.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Key(String),
    Index(usize),
}

impl Step {
    /// The key; empty for an index.
    fn key(&self) -> &str {
        match self {
            Self::Key(key) => key,
            Self::Index(_) => "",
        }
    }
}

/// Reads `T` from the document. After each error the smallest entry around it is removed and reading starts again, so that
/// all errors are found; errors that only say that a removed entry is missing are passed over. Gives what could be read, and
/// the places of the tables and lists that something was removed from.
pub fn read_all<T: DeserializeOwned>(
    document: &DeTable<'_>,
    source: &Source,
    errors: &mut Vec<SceneFileError>,
) -> (Option<T>, Vec<Place>) {
    let mut removed_from = Vec::new();
    let value = read_rest(document.clone(), source, errors, &mut removed_from);
    (
        value,
        removed_from
            .iter()
            .map(|span| source.place(span.start))
            .collect(),
    )
}

fn read_rest<T: DeserializeOwned>(
    mut rest: DeTable<'_>,
    source: &Source,
    errors: &mut Vec<SceneFileError>,
    removed_from: &mut Vec<Range<usize>>,
) -> Option<T> {
    for _ in 0..2 * MAX_ERRORS {
        let value = Spanned::new(0..0, DeValue::Table(rest.clone()));
        let error = match T::deserialize(ValueDeserializer::from(value)) {
            Ok(value) => return Some(value),
            Err(error) => error,
        };
        let span = error.span().unwrap_or(0..0);
        let path = smallest_entry(&rest, &span);
        let here = path
            .as_ref()
            .and_then(|p| value_at(&mut rest, p))
            .map(|v| v.span());
        if !here.is_some_and(|h| removed_from.contains(&h)) {
            errors.push(source.error(&span, Problem::from_message(error.message())));
        }
        let (last, parents) = path.as_ref()?.split_last()?;
        match value_at(&mut rest, parents) {
            None => {
                rest.remove(last.key());
            }
            Some(parent) => {
                removed_from.push(parent.span());
                remove(parent.get_mut(), last);
            }
        }
        if errors.len() >= MAX_ERRORS {
            return None;
        }
    }
    None
}

/// The value at a path; `None` for the root and where there is none.
fn value_at<'t, 's>(
    document: &'t mut DeTable<'s>,
    path: &[Step],
) -> Option<&'t mut Spanned<DeValue<'s>>> {
    let (first, rest) = path.split_first()?;
    let mut at = document.get_mut(first.key())?;
    for step in rest {
        at = match (at.get_mut(), step) {
            (DeValue::Table(table), Step::Key(key)) => table.get_mut(key.as_str())?,
            (DeValue::Array(items), Step::Index(i)) => items.get_mut(*i)?,
            _ => return None,
        };
    }
    Some(at)
}

fn remove(parent: &mut DeValue<'_>, step: &Step) {
    match (parent, step) {
        (DeValue::Table(table), Step::Key(key)) => {
            table.remove(key.as_str());
        }
        (DeValue::Array(items), Step::Index(index)) => {
            let mut kept = DeArray::new();
            items
                .iter()
                .enumerate()
                .filter(|(i, _)| i != index)
                .for_each(|(_, item)| kept.push(item.clone()));
            *items = kept;
        }
        _ => {}
    }
}

/// The path of the smallest key or value whose span contains `span`. (The span of a `[header]` table is its header, so all
/// of the document is searched.)
fn smallest_entry(document: &DeTable<'_>, span: &Range<usize>) -> Option<Vec<Step>> {
    let mut best: Option<(usize, Vec<Step>)> = None;
    visit_table(document, &mut Vec::new(), &mut |path, at| {
        let contains = at.start <= span.start && span.end <= at.end;
        if contains && best.as_ref().is_none_or(|(size, _)| at.len() <= *size) {
            best = Some((at.len(), path.to_vec()));
        }
    });
    best.map(|(_, path)| path)
}

fn visit_table(
    table: &DeTable<'_>,
    path: &mut Vec<Step>,
    see: &mut impl FnMut(&[Step], Range<usize>),
) {
    for (key, value) in table {
        path.push(Step::Key(key.get_ref().to_string()));
        see(path, key.span());
        visit_value(value, path, see);
        path.pop();
    }
}

fn visit_value(
    value: &Spanned<DeValue<'_>>,
    path: &mut Vec<Step>,
    see: &mut impl FnMut(&[Step], Range<usize>),
) {
    see(path, value.span());
    match value.get_ref() {
        DeValue::Table(table) => visit_table(table, path, see),
        DeValue::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                path.push(Step::Index(i));
                visit_value(item, path, see);
                path.pop();
            }
        }
        _ => {}
    }
}

/// The names defined in section `section` (`[section.NAME]`), also of definitions that are wrong themselves.
#[must_use]
pub fn names(document: &DeTable<'_>, section: &str) -> Vec<String> {
    let table = document.get(section).and_then(|v| v.get_ref().as_table());
    table
        .map(|t| t.keys().map(|k| k.get_ref().to_string()).collect())
        .unwrap_or_default()
}

/// A hash of what the document says without its `[render]` table: comments, order of keys and layout do not matter.
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
