//! Numbers of the elements, in text or binary. In text an element is a line.

use super::header::{Format, Property, Scalar};

/// The bytes after the header.
pub struct Body<'a> {
    pub format: Format,
    pub rest: &'a [u8],
    /// Rest of the line of the element; text only.
    line: &'a [u8],
    /// Number of that line in the file.
    number: usize,
    /// Lines with more numbers than their element has, and the first.
    pub longer: Option<(usize, usize)>,
}

impl<'a> Body<'a> {
    pub fn new(format: Format, rest: &'a [u8], lines: usize) -> Self {
        Self {
            format,
            rest,
            line: &[],
            number: lines,
            longer: None,
        }
    }

    /// The next line that is not empty.
    fn advance(&mut self) -> Option<()> {
        loop {
            if self.rest.is_empty() {
                return None;
            }
            let end = self.rest.iter().position(|&b| b == b'\n');
            let (line, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
            self.rest = rest.get(1..).unwrap_or_default();
            self.number += 1;
            self.line = line.trim_ascii();
            if !self.line.is_empty() {
                return Some(());
            }
        }
    }

    /// Begins an element.
    pub fn begin(&mut self) -> Result<(), String> {
        if self.format != Format::Ascii {
            return Ok(());
        }
        self.advance().ok_or_else(ends)
    }

    /// Ends an element: further numbers on its line belong to nothing.
    pub fn end(&mut self) {
        if !self.line.is_empty() {
            let (count, first) = self.longer.unwrap_or((0, self.number));
            self.longer = Some((count + 1, first));
            self.line = &[];
        }
    }

    /// Rest after the last element, in words.
    pub fn leftover(mut self) -> Option<String> {
        if self.format == Format::Ascii {
            self.advance()?;
            return Some(format!(
                "line {}: more lines than elements: not read",
                self.number
            ));
        }
        let left = self.rest.len();
        (left > 0).then(|| format!("{left} bytes after the last element are not read"))
    }

    /// A message about the element that is being read.
    pub fn fault(&self, message: &str) -> String {
        match self.format {
            Format::Ascii => format!("line {}: {message}", self.number),
            _ => message.to_owned(),
        }
    }

    /// The next number.
    pub fn next(&mut self, kind: Scalar) -> Result<f64, String> {
        if self.format == Format::Ascii {
            let end = (self.line.iter())
                .position(u8::is_ascii_whitespace)
                .unwrap_or(self.line.len());
            let (word, rest) = self.line.split_at(end);
            self.line = rest.trim_ascii_start();
            if word.is_empty() {
                return Err(self.fault("fewer numbers than the element has"));
            }
            let number = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
            return number.ok_or_else(|| {
                let shown = word[..word.len().min(40)].escape_ascii();
                self.fault(&format!("\"{shown}\" is not a number"))
            });
        }
        let size = kind.size();
        let (bytes, rest) = self.rest.split_at_checked(size).ok_or_else(ends)?;
        self.rest = rest;
        let mut b = [0; 8];
        b[..size].copy_from_slice(bytes);
        if self.format == Format::Big {
            b[..size].reverse();
        }
        let [a0, a1, a2, a3, ..] = b;
        Ok(match kind {
            Scalar::I8 => f64::from(a0 as i8),
            Scalar::U8 => f64::from(a0),
            Scalar::I16 => f64::from(i16::from_le_bytes([a0, a1])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a0, a1])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a0, a1, a2, a3])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a0, a1, a2, a3])),
            Scalar::F32 => f64::from(f32::from_le_bytes([a0, a1, a2, a3])),
            Scalar::F64 => f64::from_le_bytes(b),
        })
    }

    /// A whole number from 0.
    pub fn whole(&mut self, kind: Scalar, what: &str) -> Result<u32, String> {
        let value = self.next(kind)?;
        if value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value) {
            Ok(value as u32)
        } else {
            Err(self.fault(&format!(
                "{what} is {value} (allowed: whole numbers from 0)"
            )))
        }
    }

    /// Passes over a property.
    pub fn skip(&mut self, property: &Property) -> Result<(), String> {
        let count = match property.list {
            None => 1,
            Some(kind) => self.whole(kind, "the length of a list")?,
        };
        for _ in 0..count {
            self.next(property.kind)?;
        }
        Ok(())
    }
}

fn ends() -> String {
    "the file ends before its last element".to_owned()
}
