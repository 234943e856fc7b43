//! Errors of scene files: every one has a place and says what is allowed.
//!
//! Variants are told apart by who must act: a typing mistake, a value, a file on disk.

use crate::io::files::FileProblem;
use std::fmt;
use strsim::levenshtein;

/// Fault at one place of a scene file.
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

/// Number as messages say it: with an exponent where it would be a row of zeros.
pub fn number_text(value: f64) -> String {
    match value.abs() {
        0.0 => value.to_string(),
        size if (1e-9..1e15).contains(&size) => value.to_string(),
        _ => format!("{value:e}"),
    }
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

    /// A file that is not there, named on the command line.
    #[must_use]
    pub fn no_file() -> Self {
        Self::Form("there is no such file (paths are relative to the working directory)".to_owned())
    }

    /// The problem behind a message of the TOML parser.
    #[must_use]
    pub fn from_message(message: &str) -> Self {
        let plain = message.trim_end().replace('\n', ", ");
        Self::Form(plain.replace("`\"`", "a quotation mark").replace('`', "\""))
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
        .filter(|k| k.len().abs_diff(name.len()) <= 4 * limit)
        .map(|k| (levenshtein(&typed, &k.to_lowercase()), k))
        .filter(|(d, _)| *d <= limit)
        .min()
        .map(|(_, k)| k.clone())
}

/// Most letters of an override in a message.
const MOST_SHOWN: usize = 200;

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
    /// The fault.
    pub problem: Problem,
}

impl fmt::Display for SceneFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Place::File => write!(f, "{}: {}", self.file, self.problem),
            Place::At { line, column } => {
                write!(f, "{}:{line}:{column}: {}", self.file, self.problem)
            }
            Place::Override(text) => {
                let shown: String = text.chars().take(MOST_SHOWN).collect();
                write!(f, "--set {shown}: {}", self.problem)
            }
        }
    }
}

/// All problems of a scene file, in the order of their places; never empty.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFileErrors {
    told: Vec<SceneFileError>,
    /// How many there are beyond those.
    more: usize,
}

impl SceneFileErrors {
    /// Sorts by place and drops repetitions; `more` were only counted. `None` when there are none.
    #[must_use]
    pub fn from_unsorted(mut told: Vec<SceneFileError>, more: usize) -> Option<Self> {
        told.sort_by(|a, b| a.place.cmp(&b.place));
        told.dedup();
        (!told.is_empty()).then_some(Self { told, more })
    }

    /// One problem of the file as a whole.
    #[must_use]
    pub fn whole_file(file: &str, problem: Problem) -> Self {
        Self::one(file, Place::File, problem)
    }

    /// One problem.
    #[must_use]
    pub fn one(file: &str, place: Place, problem: Problem) -> Self {
        Self {
            told: vec![SceneFileError {
                file: file.to_owned(),
                place,
                problem,
            }],
            more: 0,
        }
    }

    /// The same about a model, whose scene nobody has written: without places in that.
    #[must_use]
    pub fn of_model(self) -> Self {
        let told = self.told.into_iter().map(|error| {
            if matches!(error.place, Place::Override(_)) {
                return error;
            }
            let problem = match error.problem {
                Problem::File(FileProblem::Missing(_)) => Problem::no_file(),
                Problem::File(FileProblem::Bad { message, .. }) => Problem::Form(message),
                other => other,
            };
            SceneFileError {
                place: Place::File,
                problem,
                ..error
            }
        });
        Self {
            told: told.collect(),
            more: self.more,
        }
    }

    /// The problems.
    pub fn iter(&self) -> std::slice::Iter<'_, SceneFileError> {
        self.told.iter()
    }
}

impl std::error::Error for SceneFileErrors {}

impl fmt::Display for SceneFileErrors {
    /// One line each.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, error) in self.told.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{error}")?;
        }
        if self.more > 0 {
            write!(f, "\n... and {} more problems", self.more)?;
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
}
