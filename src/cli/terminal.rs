//! Writing to the terminal: results to stdout, what is told meanwhile to stderr. Lines break
//! between words where a terminal is narrower, and nothing in them controls it.

use super::CliError;
use console::Term;
use std::io::{self, Write};

/// Narrowest terminal that lines are broken for.
const NARROWEST: usize = 20;

/// Writes a line to stderr. Names from files may hold what would control a terminal.
pub fn tell(line: &str) {
    let text = wrapped(&harmless(line), width(&Term::stderr()));
    // where stderr is closed or full nobody is left to tell
    _ = writeln!(io::stderr().lock(), "{text}");
}

/// Writes to stdout.
///
/// # Errors
/// Where it is full, or its reader has closed it (`abbe info SCENE | head`). Work that is not done
/// yet goes on all the same: its caller remembers the error.
pub fn print(text: &str) -> Result<(), CliError> {
    let text = harmless(text);
    // JSON is for programs
    let text = if text.starts_with(['{', '[']) {
        text
    } else {
        wrapped(&text, width(&Term::stdout()))
    };
    print_raw(text.as_bytes())
}

/// Writes what is for programs to stdout, as it is.
///
/// # Errors
/// As [`print`].
pub fn print_raw(text: &[u8]) -> Result<(), CliError> {
    let mut stdout = io::stdout().lock();
    stdout
        .write_all(text)
        .and_then(|()| stdout.flush())
        .map_err(CliError::Stdout)
}

/// Columns of a terminal; `None` where there is none.
fn width(term: &Term) -> Option<usize> {
    let size = term.is_term().then(|| term.size_checked()).flatten();
    size.map(|(_, columns)| usize::from(columns).max(NARROWEST))
}

/// Text without control characters but line ends and tabs.
fn harmless(text: &str) -> String {
    let keep = |c: char| !c.is_control() || matches!(c, '\n' | '\t');
    let shown = |c: char| if keep(c) { c } else { '\u{fffd}' };
    text.chars().map(shown).collect()
}

/// The text in lines of at most `width` characters, as far as words are shorter; what follows the
/// first line of several is indented further.
fn wrapped(text: &str, width: Option<usize>) -> String {
    let Some(width) = width else {
        return text.to_owned();
    };
    let lines = text.split('\n').map(|line| wrapped_line(line, width));
    lines.collect::<Vec<_>>().join("\n")
}

fn wrapped_line(line: &str, width: usize) -> String {
    let indent = line.chars().take_while(|c| *c == ' ').count();
    let further = (indent + 4).min(width / 2);
    let (mut out, mut column) = (String::new(), 0);
    // a word with the blanks before it
    let mut rest = line;
    while !rest.is_empty() {
        let word = rest.len() - rest.trim_start_matches(' ').len();
        let end = rest[word..].find(' ').map_or(rest.len(), |at| word + at);
        let (piece, after) = rest.split_at(end);
        let length = piece.chars().count();
        if column > indent && column + length > width {
            out.push('\n');
            out.extend(std::iter::repeat_n(' ', further));
            out += &piece[word..];
            column = further + length - word;
        } else {
            out += piece;
            column += length;
        }
        rest = after;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_between_words() {
        let text =
            "warning: the image of the sensor is black\n  time      0.50 s, 0.49 s CPU\nshort\n";
        assert_eq!(wrapped(text, None), text);
        assert_eq!(
            wrapped(text, Some(20)),
            "warning: the image\n    of the sensor is\n    black\n  time      0.50 s,\n      0.49 s CPU\nshort\n"
        );
        // a word that is longer stands alone
        let path = "error: a/path/that/is/longer/than/the/terminal: no file";
        assert_eq!(
            wrapped(path, Some(20)),
            "error:\n    a/path/that/is/longer/than/the/terminal:\n    no file"
        );
        let widths = |text: &str| text.lines().map(|l| l.chars().count()).max();
        let long = "ä word ".repeat(40);
        assert_eq!(widths(&wrapped(&long, Some(30))), Some(29));
    }
}
