//! Statements of OBJ and MTL files: lines with their numbers.
//!
//! A backslash at the end of a line continues it, `#` at its start or after a blank begins a
//! comment, and lines end as on any system. Text that is not UTF-8 is taken as Latin-1, byte by
//! byte, so that different names stay different.

use std::borrow::Cow;

/// A statement: the line it begins on (from 1), its first word, and the rest without blanks around
/// it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Statement<'a> {
    /// Line, from 1.
    pub line: usize,
    /// First word.
    pub key: Cow<'a, str>,
    /// Text after the key.
    pub rest: Cow<'a, str>,
}

/// The statements of a file.
pub struct Statements<'a> {
    bytes: &'a [u8],
    line: usize,
}

impl<'a> Statements<'a> {
    /// Of a file's bytes.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        Self { bytes, line: 0 }
    }

    /// The next line as it is in the file, without its end.
    fn next_line(&mut self) -> Option<&'a [u8]> {
        if self.bytes.is_empty() {
            return None;
        }
        self.line += 1;
        let end = (self.bytes.iter()).position(|&b| b == b'\n' || b == b'\r');
        let end = end.unwrap_or(self.bytes.len());
        let (line, rest) = self.bytes.split_at(end);
        self.bytes = match rest {
            [b'\r', b'\n', after @ ..] | [_, after @ ..] => after,
            [] => rest,
        };
        Some(line)
    }
}

impl<'a> Iterator for Statements<'a> {
    type Item = Statement<'a>;

    fn next(&mut self) -> Option<Statement<'a>> {
        loop {
            let first = self.next_line()?;
            let line = self.line;
            let mut all = Cow::Borrowed(without_comment(first));
            while let Some(open) = all.trim_ascii_end().strip_suffix(b"\\") {
                let mut joined = open.to_vec();
                joined.push(b' ');
                let more = self.next_line();
                joined.extend_from_slice(without_comment(more.unwrap_or_default()));
                all = joined.into();
                if more.is_none() {
                    break;
                }
            }
            let split = |text: &[u8]| {
                let text = text.trim_ascii();
                let end = text.iter().position(u8::is_ascii_whitespace);
                end.unwrap_or(text.len())
            };
            let statement = match &all {
                Cow::Borrowed(bytes) => {
                    let (key, rest) = bytes.trim_ascii().split_at(split(bytes));
                    (decoded(key), decoded(rest.trim_ascii()))
                }
                Cow::Owned(bytes) => {
                    let (key, rest) = bytes.trim_ascii().split_at(split(bytes));
                    let owned = |text| Cow::Owned(decoded(text).into_owned());
                    (owned(key), owned(rest.trim_ascii()))
                }
            };
            let (key, rest) = statement;
            if !key.is_empty() {
                return Some(Statement { line, key, rest });
            }
        }
    }
}

fn without_comment(line: &[u8]) -> &[u8] {
    let begins = |i: usize| line[i] == b'#' && (i == 0 || line[i - 1].is_ascii_whitespace());
    let end = (0..line.len()).find(|&i| begins(i));
    &line[..end.unwrap_or(line.len())]
}

fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.into(),
        Err(_) => bytes
            .iter()
            .map(|&b| char::from(b))
            .collect::<String>()
            .into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Vec<(usize, String, String)> {
        Statements::new(bytes)
            .map(|s| (s.line, s.key.into_owned(), s.rest.into_owned()))
            .collect()
    }

    fn one(line: usize, key: &str, rest: &str) -> (usize, String, String) {
        (line, key.to_owned(), rest.to_owned())
    }

    #[test]
    fn lines_comments_and_continuations() {
        let text = b"\xef\xbb\xbf# head\nv 1 2 \\\r\n 3 # x\r\n\r\n  usemtl  a#b \rf 1 2 \\ \n# gap\n3\nend \\";
        assert_eq!(
            read(text),
            [
                one(2, "v", "1 2   3"),
                one(5, "usemtl", "a#b"),
                one(6, "f", "1 2"),
                one(8, "3", ""),
                one(9, "end", ""),
            ]
        );
    }

    #[test]
    fn other_encodings_keep_names_apart() {
        assert_eq!(
            read(b"usemtl gr\xfcn\nusemtl gr\xc3\xbcn\nusemtl gr\xf6n"),
            [
                one(1, "usemtl", "grün"),
                one(2, "usemtl", "grün"),
                one(3, "usemtl", "grön")
            ]
        );
    }
}
