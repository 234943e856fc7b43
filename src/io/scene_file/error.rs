//! Errors of scene files: every one has a place and says what is allowed.
//!
//! Variants are told apart by who must act: a typing mistake, a value, a file on disk.

use crate::io::files::FileProblem;
use std::fmt;
use strsim::levenshtein;

/// What is wrong at one place of a scene file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// Not TOML, or a value of the wrong type or form.
    #[error("{0}")]
    Form(String),
    /// A key or name that does not exist.
    #[error("unknown {what} \"{name}\"{}", hint(suggestion.as_deref(), known))]
    Unknown {
        /// Kind of name: "key", "material", ...
        what: &'static str,
        /// The name as written.
        name: String,
        /// The nearest known name, when one is near.
        suggestion: Option<String>,
        /// Every known name.
        known: Vec<String>,
    },
    /// A number outside its range.
    #[error("{what} is {value} (allowed: {allowed})")]
    Range {
        /// The key.
        what: String,
        /// The value as a number.
        value: String,
        /// The range in words.
        allowed: &'static str,
    },
    /// Keys that contradict each other or are missing.
    #[error("{0}")]
    Conflict(String),
    /// A file that cannot be had or used.
    #[error(transparent)]
    File(#[from] FileProblem),
}

fn hint(suggestion: Option<&str>, known: &[String]) -> String {
    match (suggestion, known) {
        (Some(near), _) => format!(" (did you mean \"{near}\"?)"),
        (None, []) => " (none is defined)".to_owned(),
        (None, known) if known.len() <= 24 => format!(" (known: {})", known.join(", ")),
        (None, known) => format!(" ({} are known)", known.len()),
    }
}

impl Problem {
    /// An unknown name, with the nearest of `known` as suggestion.
    #[must_use]
    pub fn unknown<'a>(
        what: &'static str,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
    ) -> Self {
        let known: Vec<String> = known.into_iter().map(str::to_owned).collect();
        let suggestion = nearest(name, &known);
        Self::Unknown {
            what,
            name: name.to_owned(),
            suggestion,
            known,
        }
    }

    /// The problem behind a message of serde or of the TOML parser.
    #[must_use]
    pub fn from_message(message: &str) -> Self {
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        for (prefix, what) in [("unknown field", "key"), ("unknown variant", "value")] {
            if message.starts_with(prefix)
                && let Some((name, known)) = quoted.split_first()
            {
                return Self::unknown(what, name, known.iter().copied());
            }
        }
        if message.starts_with("missing field")
            && let [name] = quoted[..]
        {
            return Self::Conflict(format!("key \"{name}\" is missing"));
        }
        let plain = message
            .trim_end()
            .replace('\n', ", ")
            .replace("`\"`", "a quotation mark")
            .replace('`', "\"");
        let plain = plain
            .replace("expected i64", "expected a whole number")
            .replace("expected f64", "expected a number");
        // the name of a struct of this program means nothing to the reader
        Self::Form(match plain.split_once("expected struct ") {
            Some((before, _)) => format!("{before}expected a table"),
            None => plain,
        })
    }
}

/// The name of `known` nearest to `name`: at most a third of its letters changed, case ignored.
fn nearest(name: &str, known: &[String]) -> Option<String> {
    // the distance costs the product of the lengths: nobody mistypes a name of 65 letters
    if name.len() > 64 {
        return None;
    }
    let typed = name.to_lowercase();
    let limit = (typed.chars().count() / 3).max(1);
    known
        .iter()
        .map(|k| (levenshtein(&typed, &k.to_lowercase()), k))
        .filter(|(d, _)| *d <= limit)
        .min()
        .map(|(_, k)| k.clone())
}

/// Where a problem is.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A place in the file, both counted from 1, columns in characters.
    At {
        /// Line.
        line: usize,
        /// Column.
        column: usize,
    },
    /// An override of the command line, as typed: `KEY=VALUE`.
    Override(String),
}

/// One problem and its place.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct SceneFileError {
    /// The file as given by the caller.
    pub file: String,
    /// Where.
    pub place: Place,
    /// What.
    pub problem: Problem,
}

impl fmt::Display for SceneFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Place::File => write!(f, "{}: {}", self.file, self.problem),
            Place::At { line, column } => {
                write!(f, "{}:{line}:{column}: {}", self.file, self.problem)
            }
            Place::Override(text) => write!(f, "--set {text}: {}", self.problem),
        }
    }
}

/// All problems of a scene file, in the order of their places; never empty.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFileErrors(Vec<SceneFileError>);

impl SceneFileErrors {
    /// Sorts by place and drops repetitions. `None` when there are none.
    #[must_use]
    pub fn from_unsorted(mut errors: Vec<SceneFileError>) -> Option<Self> {
        errors.sort_by(|a, b| a.place.cmp(&b.place));
        errors.dedup();
        (!errors.is_empty()).then_some(Self(errors))
    }

    /// One problem of the file as a whole.
    #[must_use]
    pub fn whole_file(file: &str, problem: Problem) -> Self {
        Self(vec![SceneFileError {
            file: file.to_owned(),
            place: Place::File,
            problem,
        }])
    }

    /// The problems.
    pub fn iter(&self) -> std::slice::Iter<'_, SceneFileError> {
        self.0.iter()
    }
}

impl std::error::Error for SceneFileErrors {}

impl fmt::Display for SceneFileErrors {
    /// One line each.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, error) in self.0.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{error}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suggests_only_near_names() {
        let known = ["N-BK7", "N-SF11", "WATER"];
        let text = |name| Problem::unknown("glass", name, known).to_string();
        assert_eq!(
            text("NBK7"),
            "unknown glass \"NBK7\" (did you mean \"N-BK7\"?)"
        );
        assert_eq!(
            text("water"),
            "unknown glass \"water\" (did you mean \"WATER\"?)"
        );
        assert_eq!(
            text("diamond"),
            "unknown glass \"diamond\" (known: N-BK7, N-SF11, WATER)"
        );
    }

    #[test]
    fn serde_messages_become_problems() {
        let p = Problem::from_message("unknown field `spq`, expected one of `spp`, `seed`");
        assert_eq!(p.to_string(), "unknown key \"spq\" (did you mean \"spp\"?)");
        let p = Problem::from_message("missing field `radius`");
        assert_eq!(p.to_string(), "key \"radius\" is missing");
    }
}
