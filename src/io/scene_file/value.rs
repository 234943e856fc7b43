//! Values of general use: numbers, lengths, vectors, names, lists.

use super::document::Node;
use super::error::Problem;
use super::keys::{FINITE, Form, Spec, Table, Value};
use super::reader::Reader;
use crate::math::named::Named;
use glam::DVec3;
use std::ops::Range as Span;
use toml::de::DeValue;

/// A value with its place.
#[derive(Clone, Debug)]
pub struct At<T> {
    /// The value.
    pub value: T,
    /// Where it stands.
    pub at: Span<usize>,
}

impl<T: Value> Value for At<T> {
    fn form() -> Form {
        T::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let at = node.span();
        T::read(node, spec, cx).map(|value| Self { value, at })
    }
}

/// The number at a node, whatever its range.
fn plain_number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(text) => text.as_str().parse().ok(),
        DeValue::Integer(text) if text.radix() == 10 => text.as_str().parse().ok(),
        DeValue::Integer(text) => i64::from_str_radix(text.as_str(), text.radix())
            .ok()
            .map(|n| n as f64),
        _ => None,
    }
}

/// A number of the range of `spec` (finite where there is none), under a name for messages.
pub fn number(node: Node<'_>, spec: Spec, expected: &str, cx: &mut Reader<'_>) -> Option<f64> {
    let value = plain_number(node.get_ref());
    match value {
        Some(value) => cx.in_range(spec.name, value, &node.span(), spec.range.unwrap_or(FINITE)),
        None => cx.wrong_type(node, expected),
    }
    value
}

impl Value for f64 {
    fn form() -> Form {
        Form::Number("")
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        number(node, spec, "a number", cx)
    }

    fn show(&self) -> String {
        self.to_string()
    }
}

/// A length in meters.
#[derive(Clone, Copy, Debug)]
pub struct Length(pub f64);

impl Value for Length {
    fn form() -> Form {
        Form::Number("length")
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        f64::read(node, spec, cx).map(|v| Self(v * cx.unit_m))
    }

    fn show(&self) -> String {
        self.0.to_string()
    }
}

impl Value for i64 {
    fn form() -> Form {
        Form::Integer
    }

    /// Clamped to its range.
    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let value = match node.get_ref() {
            DeValue::Integer(n) => Self::from_str_radix(n.as_str(), n.radix()).ok(),
            _ => None,
        };
        let Some(value) = value else {
            cx.wrong_type(node, "a whole number");
            return None;
        };
        let Some(range) = spec.range else {
            return Some(value);
        };
        if !range.contains(value as f64) {
            cx.out_of_range(spec.name, value.to_string(), &node.span(), range.text);
        }
        Some(value.clamp(range.low as Self, range.high as Self))
    }

    fn show(&self) -> String {
        self.to_string()
    }
}

/// Wavelengths per path.
#[derive(Clone, Copy, Debug)]
pub struct Lanes(pub usize);

impl Value for Lanes {
    fn form() -> Form {
        Form::OneOf(&[1, 4, 8])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let value = i64::read(node, spec, cx)?;
        if ![1, 4, 8].contains(&value) {
            cx.out_of_range(spec.name, value.to_string(), &node.span(), "1, 4 or 8");
        }
        usize::try_from(value).ok().map(Self)
    }

    fn show(&self) -> String {
        self.0.to_string()
    }
}

impl Value for bool {
    fn form() -> Form {
        Form::Boolean
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let value = node.get_ref().as_bool();
        if value.is_none() {
            cx.wrong_type(node, "true or false");
        }
        value
    }

    fn show(&self) -> String {
        self.to_string()
    }
}

/// The text at a node.
fn text(node: Node<'_>, cx: &mut Reader<'_>) -> Option<String> {
    let text = node.get_ref().as_str();
    if text.is_none() {
        cx.wrong_type(node, "a string");
    }
    text.map(str::to_owned)
}

/// Declares names: texts that mean different things.
macro_rules! texts {
    ($($(#[$meta:meta])* $type:ident: $what:literal;)+) => {
        $($(#[$meta])*
        #[derive(Clone, Debug)]
        pub struct $type(pub String);

        impl Value for $type {
            fn form() -> Form {
                Form::Text($what)
            }

            fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
                text(node, cx).map(Self)
            }
        })+
    };
}

texts! {
    /// Name of a thing.
    Name: "a name";
    /// Name of a file, relative to the scene file.
    FileName: "a file";
    /// Name of a glass of the library.
    GlassName: "a glass of the catalog";
    /// Name of a metal of the library.
    MetalName: "a metal of the library";
    /// Name of a spectrum of the library.
    SpectrumName: "a spectrum of the library";
    /// Name of a medium of the file.
    MediumName: "a `[medium.NAME]`";
    /// Name of a material of the file.
    MaterialName: "a `[material.NAME]`";
    /// Name of an animation of a model.
    AnimationName: "name or number of an animation";
    /// Kind of chains by its labels and objects.
    ChainName: "a kind of chains such as `T ball, T ball`";
}

impl<T: Named> Value for T {
    fn form() -> Form {
        Form::Names(T::ALL.iter().map(|v| (v.as_str(), v.help())).collect())
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let name = text(node, cx)?;
        let value = T::named(&name);
        if value.is_none() {
            let known = T::ALL.iter().map(|v| v.as_str());
            cx.error(&node.span(), || Problem::unknown("value", &name, known));
        }
        value
    }

    fn show(&self) -> String {
        format!("\"{}\"", self.as_str())
    }
}

/// The nodes of a list.
pub fn items<'d>(node: Node<'d>, expected: &str, cx: &mut Reader<'_>) -> Option<Vec<Node<'d>>> {
    match node.get_ref() {
        DeValue::Array(items) => Some(items.iter().collect()),
        DeValue::Table(_) => {
            let hint = "(a list of tables has two brackets: [[NAME]])";
            cx.wrong_type(node, &format!("{expected} {hint}"));
            None
        }
        _ => {
            cx.wrong_type(node, expected);
            None
        }
    }
}

impl<T: Value> Value for Vec<T> {
    fn form() -> Form {
        Form::List(Box::new(T::form()))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let items = items(node, "an array", cx)?;
        // all are read, also behind one that cannot be
        let read: Vec<Option<T>> = items.into_iter().map(|i| T::read(i, spec, cx)).collect();
        read.into_iter().collect()
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self::new())
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}

impl<T: Value, const N: usize> Value for [T; N] {
    fn form() -> Form {
        Form::Tuple(Box::new(T::form()), N)
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let expected = format!("an array of length {N}");
        let list = items(node, &expected, cx)?;
        if list.len() != N {
            cx.wrong_length(node, list.len(), &expected);
            return None;
        }
        let read: Vec<Option<T>> = list.into_iter().map(|i| T::read(i, spec, cx)).collect();
        let read: Option<Vec<T>> = read.into_iter().collect();
        read?.try_into().ok()
    }

    fn show(&self) -> String {
        let items: Vec<String> = self.iter().map(T::show).collect();
        format!("[{}]", items.join(", "))
    }
}

/// A point, or the vector between two, in meters.
#[derive(Clone, Copy, Debug)]
pub struct Point(pub DVec3);

impl Value for Point {
    fn form() -> Form {
        Form::Tuple(Box::new(Length::form()), 3)
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let all = <[f64; 3]>::read(node, spec, cx)?;
        Some(Self(DVec3::from_array(all) * cx.unit_m))
    }

    fn show(&self) -> String {
        self.0.to_array().show()
    }
}

/// A unit vector.
#[derive(Clone, Copy, Debug)]
pub struct Direction(pub DVec3);

impl Value for Direction {
    fn form() -> Form {
        <[f64; 3]>::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let v = DVec3::from_array(<[f64; 3]>::read(node, spec, cx)?);
        // scaled first: the square of a tiny or huge component leaves the range of f64
        let unit = (v / v.abs().max_element()).try_normalize();
        if unit.is_none() && v.is_finite() {
            let message = "has no direction (allowed: a vector other than zero)";
            cx.conflict(&node.span(), format!("{} {message}", spec.name));
        }
        unit.map(Self)
    }

    fn show(&self) -> String {
        self.0.to_array().show()
    }
}

/// Factors along the axes: one for all, or three.
#[derive(Clone, Copy, Debug)]
pub struct Factors(pub DVec3);

impl Value for Factors {
    fn form() -> Form {
        Form::Any(vec![f64::form(), <[f64; 3]>::form()])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        if node.get_ref().is_array() {
            return <[f64; 3]>::read(node, spec, cx).map(|v| Self(DVec3::from_array(v)));
        }
        number(node, spec, "a number or [x, y, z]", cx).map(|v| Self(DVec3::splat(v)))
    }
}
