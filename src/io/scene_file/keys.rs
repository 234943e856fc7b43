//! Keys: what a table may hold. One declaration ([`keys!`]) is read by the reader and printed by
//! the reference, so that neither can know a key that the other does not.

use super::document::Node;
use super::error::Problem;
use super::reader::Reader;
use std::ops::Range as Span;
use toml::de::DeTable;

/// An interval of numbers, and how to say it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// In words.
    pub text: &'static str,
    /// Least number.
    pub low: f64,
    /// Largest number.
    pub high: f64,
    /// Whether `low` itself is left out.
    pub above_low: bool,
    /// Whether `high` itself is left out.
    pub below_high: bool,
}

impl Range {
    /// `low` to `high`, both included.
    pub const fn closed(low: f64, high: f64, text: &'static str) -> Self {
        Self {
            text,
            low,
            high,
            above_low: false,
            below_high: false,
        }
    }

    /// Above `low`, at most `high`.
    pub const fn above(low: f64, high: f64, text: &'static str) -> Self {
        Self {
            above_low: true,
            ..Self::closed(low, high, text)
        }
    }

    /// Whether the number is in the interval; never true of NaN.
    pub fn contains(&self, value: f64) -> bool {
        let above = value > self.low || value == self.low && !self.above_low;
        above && (value < self.high || value == self.high && !self.below_high)
    }
}

/// Beyond this, squares and products of lengths overflow.
const LARGEST: f64 = 1e30;
/// Any number that may be computed with.
pub const FINITE: Range = Range::closed(-LARGEST, LARGEST, "a finite number");
/// Sizes.
pub const POSITIVE: Range = Range::above(1.0 / LARGEST, LARGEST, "a finite number > 0");
/// Amounts.
pub const NON_NEGATIVE: Range = Range::closed(0.0, LARGEST, "a finite number >= 0");
/// Fractions.
pub const UNIT_INTERVAL: Range = Range::closed(0.0, 1.0, "0 to 1");

/// The key that a value stands under: its name, and the range of its numbers where they have one.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// Name of the key.
    pub name: &'static str,
    /// Range of its numbers; `None`: that of the type of value.
    pub range: Option<Range>,
}

/// Kind of a value.
#[derive(Clone, Debug)]
pub enum Form {
    /// A number, in a unit where the form has one.
    Number(&'static str),
    /// A whole number.
    Integer,
    /// One of a few whole numbers.
    OneOf(&'static [i64]),
    /// `true` or `false`.
    Boolean,
    /// Any text, and what it is.
    Text(&'static str),
    /// One of these names, each with a few words on it.
    Names(Vec<(&'static str, &'static str)>),
    /// A list of that many.
    Tuple(Box<Self>, usize),
    /// A list of any length.
    List(Box<Self>),
    /// A table of the kind.
    Table(Kind),
    /// A table of named things.
    Map(Box<Self>),
    /// Any of these.
    Any(Vec<Self>),
}

/// A kind of table.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Name.
    pub name: &'static str,
    /// Description of such a table.
    pub help: &'static str,
    /// Keys of the table.
    pub keys: fn() -> Vec<Key>,
}

/// A key for the reference.
#[derive(Clone, Debug)]
pub struct Key {
    /// Name.
    pub name: &'static str,
    /// Kind of its value.
    pub form: Form,
    /// Range of its numbers.
    pub range: Option<Range>,
    /// Unit, where it is not that of the form.
    pub unit: Option<&'static str>,
    /// Default, in words; `None`: the key is required.
    pub default: Option<String>,
    /// Meaning of the key.
    pub help: &'static str,
}

/// A type that a value of a scene file is read as.
pub trait Value: Sized {
    /// Kind of the value.
    fn form() -> Form;

    /// Reads it; `None` where it cannot be made sense of, which has been reported. (A number out of
    /// range is reported and given all the same.)
    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self>;

    /// Default of a key that is left out.
    fn absent(table: &Table<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        table.missing(spec.name, cx);
        None
    }

    /// Default in the words of the reference; `None`: the key is required.
    fn default_text() -> Option<String> {
        None
    }

    /// The value as a scene file would say it, for defaults.
    fn show(&self) -> String {
        String::new()
    }
}

impl<T: Value> Value for Option<T> {
    fn form() -> Form {
        T::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        T::read(node, spec, cx).map(Some)
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(None)
    }

    fn default_text() -> Option<String> {
        Some(String::new())
    }
}

/// The keys of a kind of table, as [`keys!`] declares them.
pub trait Keys: Sized {
    /// The kind.
    const KIND: Kind;
    /// Names of the keys.
    const NAMES: &'static [&'static str];

    /// Reads every key of the table. `None` where one is unknown, missing or makes no sense, all of
    /// which has been reported: what the keys say together is judged once each of them can be read.
    fn from_table(table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Self>;
}

/// A kind of table and what becomes of it.
pub trait Build: Keys {
    /// Part of the scene.
    type Output;

    /// Checks what the keys say together and makes the thing.
    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Self::Output>;
}

/// Values read from a table of the kind `K`.
pub struct Built<K: Build>(pub K::Output);

impl<K: Build> Value for Built<K> {
    fn form() -> Form {
        Form::Table(K::KIND)
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let table = Table::of(node, K::NAMES, cx)?;
        K::from_table(&table, cx)?.build(&table, cx).map(Self)
    }
}

/// As [`Built`], but what failed (and has been reported) counts as given, so that the table around
/// it can still be judged.
pub struct Given<K: Build>(pub Option<K::Output>);

impl<K: Build> Value for Given<K> {
    fn form() -> Form {
        Form::Table(K::KIND)
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        Some(Self(Built::<K>::read(node, spec, cx).map(|built| built.0)))
    }
}

/// The first that is given.
pub fn first_given<K>(choices: impl IntoIterator<Item = Option<K>>) -> Option<K> {
    choices.into_iter().flatten().next()
}

/// A table that is being read.
#[derive(Debug)]
pub struct Table<'d> {
    entries: &'d DeTable<'d>,
    /// Place of the table.
    pub at: Span<usize>,
    /// Whether it has keys that nobody asks for.
    strange: bool,
    errors_before: usize,
}

impl<'d> Table<'d> {
    /// The table at a node; reports anything else, and keys that are not among `known`.
    pub fn of(
        node: Node<'d>,
        known: &'static [&'static str],
        cx: &mut Reader<'_>,
    ) -> Option<Table<'d>> {
        let Some(entries) = node.get_ref().as_table() else {
            cx.wrong_type(node, "a table");
            return None;
        };
        Some(Self::new(entries, node.span(), known, cx))
    }

    /// As [`Table::of`], of the entries themselves.
    pub fn new(
        entries: &'d DeTable<'d>,
        at: Span<usize>,
        known: &'static [&'static str],
        cx: &mut Reader<'_>,
    ) -> Self {
        let errors_before = cx.error_count();
        let mut strange = false;
        for key in entries.keys() {
            let name = key.get_ref().as_ref();
            if !known.contains(&name) {
                strange = true;
                cx.error(&key.span(), || {
                    Problem::unknown("key", name, known.iter().copied())
                });
            }
        }
        Self {
            entries,
            at,
            strange,
            errors_before,
        }
    }

    /// Whether every key is known.
    pub fn is_plain(&self) -> bool {
        !self.strange
    }

    /// The value of a key.
    pub fn get(&self, name: &str) -> Option<Node<'d>> {
        self.entries.get(name)
    }

    /// The place of a key's value, or of the table.
    pub fn span(&self, name: &str) -> Span<usize> {
        self.get(name).map_or(self.at.clone(), |node| node.span())
    }

    /// Reports a key that is required. Where there are unknown keys, it may be one of them.
    pub fn missing(&self, name: &str, cx: &mut Reader<'_>) {
        if !self.strange {
            cx.conflict(&self.at, format!("key \"{name}\" is missing"));
        }
    }

    /// Which one of the keys is given; reports none and several.
    pub fn exactly_one(
        &self,
        keys: &[&'static str],
        owner: &str,
        cx: &mut Reader<'_>,
    ) -> Option<&'static str> {
        let mut given = keys.iter().copied().filter(|k| self.get(k).is_some());
        match (given.next(), given.next()) {
            (Some(key), None) => Some(key),
            (first, _) => {
                let found = first.map_or("none", |_| "more than one");
                let keys = keys.join(", ");
                cx.conflict(
                    &self.at,
                    format!("{owner} needs exactly one of {keys} (found {found})"),
                );
                None
            }
        }
    }

    /// `Some` if nothing was reported since reading of the table began: constructors of the
    /// renderer take valid values only.
    pub fn sound(&self, cx: &Reader<'_>) -> Option<()> {
        (cx.error_count() == self.errors_before).then_some(())
    }
}

/// Declares the keys of a kind of table: a struct with a field per key, which implements [`Keys`].
///
/// A field is `name: Type`, followed by `in RANGE`, `unit "..."`, `or "what holds without it"` (for
/// an `Option`) or `= default`, in this order. Its doc comment is its text in the reference.
macro_rules! keys {
    ($(#[doc = $kind_help:literal])+ $struct:ident = $kind:literal {
        $($(#[doc = $help:literal])+ $field:ident $(as $alias:literal)?: $type:ty
            $(, in $range:expr)? $(, unit $unit:literal)? $(, or $without:literal)?
            $(, default $default:expr)?;)+
    }) => {
        $(#[doc = $kind_help])+
        pub(in crate::io::scene_file) struct $struct {
            $($(#[doc = $help])+ pub $field: $type,)+
        }

        impl $crate::io::scene_file::keys::Keys for $struct {
            const KIND: $crate::io::scene_file::keys::Kind = $crate::io::scene_file::keys::Kind {
                name: $kind,
                help: concat!($($kind_help, "\n",)+),
                keys: || vec![$($crate::io::scene_file::keys::Key {
                    name: keys!(@name $field $($alias)?),
                    form: <$type as $crate::io::scene_file::keys::Value>::form(),
                    range: keys!(@option $($range)?),
                    unit: keys!(@option $($unit)?),
                    default: keys!(@text $type; $($without)?; $($default)?),
                    help: concat!($($help, "\n",)+),
                },)+],
            };
            const NAMES: &'static [&'static str] = &[$(keys!(@name $field $($alias)?),)+];

            fn from_table(
                table: &$crate::io::scene_file::keys::Table<'_>,
                cx: &mut $crate::io::scene_file::reader::Reader<'_>,
            ) -> Option<Self> {
                $(let $field = {
                    let spec = $crate::io::scene_file::keys::Spec {
                        name: keys!(@name $field $($alias)?),
                        range: keys!(@option $($range)?),
                    };
                    match table.get(spec.name) {
                        Some(node) => $crate::io::scene_file::keys::Value::read(node, spec, cx),
                        None => keys!(@absent table, spec, cx; $($default)?),
                    }
                };)+
                let all = Self { $($field: $field?,)+ };
                table.is_plain().then_some(all)
            }
        }
    };
    (@name $field:ident) => { stringify!($field) };
    (@name $field:ident $alias:literal) => { $alias };
    (@option) => { None };
    (@option $value:expr) => { Some($value) };
    (@text $type:ty; ; ) => { <$type as $crate::io::scene_file::keys::Value>::default_text() };
    (@text $type:ty; $without:literal; ) => { Some($without.to_owned()) };
    (@text $type:ty; ; $default:expr) => {
        Some(<$type as $crate::io::scene_file::keys::Value>::show(&$default))
    };
    (@absent $table:ident, $spec:ident, $cx:ident; ) => {
        $crate::io::scene_file::keys::Value::absent($table, $spec, $cx)
    };
    (@absent $table:ident, $spec:ident, $cx:ident; $default:expr) => { Some($default) };
}
pub(in crate::io::scene_file) use keys;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_keep_their_ends_apart() {
        let half_open = Range::above(0.0, 1.0, "above 0, at most 1");
        assert!(half_open.contains(1.0) && !half_open.contains(0.0));
        assert!(UNIT_INTERVAL.contains(0.0) && UNIT_INTERVAL.contains(1.0));
        for wrong in [f64::NAN, f64::INFINITY, -0.1, 1.1] {
            assert!(!UNIT_INTERVAL.contains(wrong), "{wrong}");
        }
        assert!(!POSITIVE.contains(0.0) && !FINITE.contains(f64::NEG_INFINITY));
    }
}
