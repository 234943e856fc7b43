//! Expressions that choose paths by their class: regular expressions over the labels of the
//! vertices from the light to the sensor (Heckbert 1990), and over the surfaces they lie on.
//!
//! The short form knows `L`, `S` (specular), `D` (anything else) and `E`. Where an expression names
//! `R` or `T`, specular vertices are reflections `R` or transmissions `T` (`S`: either), and a name
//! may say on which surface: `T(3)` on surface 3 of a lens, `R("mirror")` on an object. Then each
//! vertex is written as two characters, its letter and one for the object, so that `T` stands for
//! `T.` of the regular expression.

use crate::bsdf::Label;
use crate::scene::Scene;
use crate::scene::sequence::SurfaceName;
use crate::transport::class::PathClass;
use crate::transport::subpath::Event;
use regex::Regex;

/// Light that no surface reflects that also transmits: of a lens all but its ghosts.
pub const DIRECT: &str = "direct";
/// Smooth paths with a reflection at a surface that also transmits.
pub const GHOSTS: &str = "ghosts";
/// Code of the first object: plane 15, for private use, to which plane 16 joins.
const FIRST_SYMBOL: u32 = 0xF_0000;
/// Code that stands for no object.
const NO_OBJECT: char = '-';

/// A choice of paths.
#[derive(Clone, Debug)]
pub struct PathExpression {
    source: String,
    regex: Regex,
    by_events: bool,
}

impl From<Regex> for PathExpression {
    fn from(regex: Regex) -> Self {
        Self {
            source: regex.to_string(),
            regex,
            by_events: false,
        }
    }
}

impl PathExpression {
    /// Compiles an expression for the objects of a scene, or one of the names [`DIRECT`] and
    /// [`GHOSTS`].
    ///
    /// # Errors
    /// Fault, in words: not a regular expression, or a surface that does not exist.
    pub fn new(source: &str, scene: &Scene) -> Result<Self, String> {
        Self::compile(source, Some(scene))
    }

    /// Checks what can be checked without a scene.
    ///
    /// # Errors
    /// As [`PathExpression::new`], but for surfaces.
    pub fn check(source: &str) -> Result<(), String> {
        Self::compile(source, None).map(|_| ())
    }

    /// The expression as it was given.
    #[must_use]
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Whether it depends on more than the class: photons that are merged do not know it.
    #[must_use]
    pub fn needs_events(&self) -> bool {
        self.by_events
    }

    fn compile(source: &str, scene: Option<&Scene>) -> Result<Self, String> {
        let by_events = matches!(source, DIRECT | GHOSTS) || source.contains(['R', 'T', '"']);
        let text = match source {
            DIRECT => format!("^L.(?:T.|R[^{}])*E.$", glass(scene)),
            GHOSTS => format!("^L.(?:[RT].)*R[{}](?:[RT].)*E.$", glass(scene)),
            _ if by_events => translate(source, scene)?,
            _ => source.to_owned(),
        };
        let wrong = |e: regex::Error| {
            let text = e.to_string();
            let last = text.lines().last();
            last.unwrap_or("not a regular expression").to_owned()
        };
        Ok(Self {
            source: source.to_owned(),
            regex: Regex::new(&text).map_err(wrong)?,
            by_events,
        })
    }
}

/// A path as expressions see it, written out when it is first asked for.
#[derive(Debug)]
pub(super) struct PathText<'a> {
    class: PathClass,
    events: &'a [Event],
    short: Option<String>,
    long: Option<String>,
}

impl<'a> PathText<'a> {
    pub fn new(class: PathClass, events: &'a [Event]) -> Self {
        Self {
            class,
            events,
            short: None,
            long: None,
        }
    }

    /// Whether an expression chooses it.
    pub fn matches(&mut self, expression: &PathExpression) -> bool {
        let text = if expression.by_events {
            let events = self.events;
            self.long.get_or_insert_with(|| written(events))
        } else {
            let class = self.class;
            self.short.get_or_insert_with(|| class.to_string())
        };
        expression.regex.is_match(text)
    }
}

/// The long form of a path.
fn written(events: &[Event]) -> String {
    let mut text = format!("L{NO_OBJECT}");
    for event in events {
        text.push(match event.label {
            Label::NonSpecular => 'D',
            Label::SpecularReflect => 'R',
            Label::SpecularTransmit => 'T',
        });
        text.push(symbol(event.surface.0 as usize));
    }
    text.push('E');
    text.push(NO_OBJECT);
    text
}

/// Symbols of all surfaces that reflect and transmit, as the inside of a class, which must not be
/// empty: hence one that no vertex has.
fn glass(scene: Option<&Scene>) -> String {
    let objects = scene.map_or(&[][..], |scene| &scene.objects);
    let clear = objects.iter().enumerate().filter(|(_, o)| o.is_interface);
    clear.map(|(i, _)| symbol(i)).chain(['!']).collect()
}

/// Character of an object. Objects beyond the planes for private use share the last one.
fn symbol(object: usize) -> char {
    let code = u32::try_from(object).ok();
    let code = code.and_then(|i| FIRST_SYMBOL.checked_add(i));
    code.and_then(char::from_u32).unwrap_or(char::MAX)
}

/// Labels that a letter stands for, as the inside of a class.
fn labels(letter: char) -> Option<&'static str> {
    Some(match letter {
        'L' => "L",
        'E' => "E",
        'D' => "D",
        'R' => "R",
        'T' => "T",
        'S' => "RT",
        '.' => "LEDRT",
        _ => return None,
    })
}

/// Regular expression over the long form: each letter, dot and class of letters becomes one over
/// two characters.
fn translate(source: &str, scene: Option<&Scene>) -> Result<String, String> {
    let mut text = String::new();
    let mut rest = source.chars().peekable();
    while let Some(c) = rest.next() {
        if c.is_whitespace() {
            continue;
        }
        if c == '[' {
            let inside: String = rest.by_ref().take_while(|c| *c != ']').collect();
            let (not, letters) = match inside.strip_prefix('^') {
                Some(letters) => ("^", letters),
                None => ("", inside.as_str()),
            };
            let each = letters.chars().map(|c| labels(c).filter(|_| c != '.'));
            let each: Option<String> = each.collect();
            let each = each.filter(|e| !e.is_empty());
            let each = each.ok_or("expected letters L, S, R, T, D, E between [ and ]")?;
            text += &format!("(?:[{not}{each}].)");
            continue;
        }
        let Some(labels) = labels(c) else {
            if !"^$*+?|(){},0123456789:".contains(c) {
                return Err(format!(
                    "`{c}` has no place in an expression over L, S, R, T, D, E and surfaces"
                ));
            }
            text.push(c);
            continue;
        };
        let mut ahead = rest.clone();
        let is_named = ahead.next() == Some('(')
            && ahead.next().is_some_and(|c| c.is_ascii_digit() || c == '"')
            && !matches!(c, 'L' | 'E');
        let on = if is_named {
            rest.next();
            let name: String = rest.by_ref().take_while(|c| *c != ')').collect();
            surfaces(name.trim(), scene)?
        } else {
            ".".to_owned()
        };
        text += &format!("(?:[{labels}]{on})");
    }
    Ok(text)
}

/// Class of the symbols of the objects that a name means.
fn surfaces(name: &str, scene: Option<&Scene>) -> Result<String, String> {
    let name = SurfaceName::new(name)?;
    let Some(scene) = scene else {
        return Ok("[!]".to_owned());
    };
    let found = name.find(scene.objects.iter().map(|object| object.name.as_str()))?;
    let symbols: String = found.into_iter().map(symbol).collect();
    Ok(format!("[{symbols}]"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::InstanceId;

    fn expression(source: &str) -> PathExpression {
        PathExpression::compile(source, None).unwrap_or_else(|e| panic!("{source}: {e}"))
    }

    /// A path of these labels on surfaces 0, 1, 2 ...
    fn is_chosen(source: &str, labels: &str) -> bool {
        let label = |c| match c {
            'R' => Label::SpecularReflect,
            'T' => Label::SpecularTransmit,
            _ => Label::NonSpecular,
        };
        let surface = |i| InstanceId(i as u32);
        let events: Vec<Event> = (labels.chars().enumerate())
            .map(|(i, c)| Event {
                label: label(c),
                surface: surface(i),
            })
            .collect();
        let mut class = PathClass::new();
        events
            .iter()
            .for_each(|e| class.push(e.label.is_specular()));
        PathText::new(class, &events).matches(&expression(source))
    }

    #[test]
    fn labels_are_chosen_by_letter_dot_and_class() {
        for (source, chosen, others) in [
            ("^LS+DE$", &["TD", "RTD"][..], &["D", "TDD"][..]),
            ("^L T* E$", &["", "T", "TT"], &["TR", "D"]),
            ("^L S R S E$", &["TRT", "RRR"], &["TTT", "RR"]),
            ("^L [RT]* D E$", &["D", "RTD"], &["DD", "T"]),
            ("^L [^R]* E$", &["TDT", ""], &["TRT"]),
            ("^L . R E$", &["DR", "TR"], &["R", "RRR"]),
            ("^L (T|R D){2} E$", &["TRD", "TT"], &["T", "RD"]),
            ("R", &["R", "TRT"], &["T", "", "D"]),
        ] {
            for labels in chosen {
                assert!(is_chosen(source, labels), "{source} {labels}");
            }
            for labels in others {
                assert!(!is_chosen(source, labels), "{source} {labels}");
            }
        }
    }

    #[test]
    fn faults_are_named() {
        for (source, fault) in [
            ("L T(", "unclosed group"),
            ("T(1x)", "`1x` names no surface"),
            ("T(\"back)", "`\"back` names no surface"),
            ("LT\\d", "`\\` has no place"),
            ("L[a]R", "between [ and ]"),
            ("L[]R", "between [ and ]"),
        ] {
            let error = PathExpression::check(source).expect_err(source);
            assert!(error.contains(fault), "{source}: {error}");
        }
    }
}
