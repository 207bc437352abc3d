//! File formats as data: one declaration of a section gives the struct that a file fills, its reader with the places of
//! all mistakes, its JSON Schema and its table in the book.

/// What the declaration of a section names.
pub use crate::toml_text::{Collector, Entry, TextSpan, get};
use crate::toml_text::{Diagnostic, Quantities, TomlText};
use crate::units;
use serde_json::{Value as Json, json};
use servotwin_model::spec::Unit;
use std::borrow::Borrow;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::ops::Deref;

/// The pattern of names in a system.
pub(crate) const ID: &str = "^[a-z0-9_]+$";

/// A key of a table.
#[derive(Clone, Copy)]
pub struct Key {
    /// Name of the key.
    pub name: &'static str,
    /// Kind of its value.
    pub value: Value,
    /// Whether the key is required.
    pub(crate) obligatory: bool,
    /// One line for the documentation.
    pub summary: &'static str,
}

/// Kind of a key's value.
#[derive(Clone, Copy)]
pub enum Value {
    /// A number from the first to the second, with its unit.
    Number(f64, f64, &'static str),
    /// A whole number from the first to the second.
    Whole(f64, f64),
    /// Two numbers, the lower one first.
    Range,
    /// True or false.
    Flag,
    /// A text.
    Text,
    /// The name of a part of a system: small letters, digits and `_`.
    Id,
    /// One of a list of words.
    Word(fn() -> Vec<&'static str>),
    /// A unit of SI.
    Unit,
    /// A signal: a text, or a number for a constant.
    Signal,
    /// A list with at least this many elements.
    List(usize, &'static Value),
    /// A table of freely named entries, with at least this many.
    Names(usize, &'static Value),
    /// A table of entries that are named as parts of a system.
    Ids(&'static Value),
    /// A table with known keys.
    Table(&'static [Key]),
    /// What its reader alone understands: its JSON Schema, and its description.
    Other(fn() -> Json, &'static str),
}

/// A required key.
pub const fn must(name: &'static str, value: Value, summary: &'static str) -> Key {
    Key { name, value, obligatory: true, summary }
}

/// An optional key.
pub const fn may(name: &'static str, value: Value, summary: &'static str) -> Key {
    Key { name, value, obligatory: false, summary }
}

/// A value with its place in the file. It compares and sorts by the value alone.
#[derive(Clone, Debug, Default)]
pub struct At<T> {
    /// The value.
    pub value: T,
    /// Its place: the key of a table or of a name, otherwise the value.
    pub at: TextSpan,
}

impl<T> At<T> {
    /// A value that stands for that of another place.
    pub fn new(value: T, at: TextSpan) -> Self {
        Self { value, at }
    }
}

impl<T> Deref for At<T> {
    type Target = T;
    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T: PartialEq> PartialEq for At<T> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl Eq for At<String> {}

impl PartialOrd for At<String> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for At<String> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.value.cmp(&other.value)
    }
}

impl Borrow<str> for At<String> {
    fn borrow(&self) -> &str {
        &self.value
    }
}

/// Entries with names of their own, sorted by name.
pub type Names<T> = BTreeMap<At<String>, T>;

/// Parts of a system by their ids, in the order of the file.
#[derive(Clone, Debug)]
pub(crate) struct Ids<T>(pub Vec<(At<String>, T)>);

impl<T> Default for Ids<T> {
    fn default() -> Self {
        Self(vec![])
    }
}

/// A table that another reader understands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Raw;

/// A value that can be read from a file.
pub trait Read: Sized {
    /// The kind of value that the type implies, unless a range or a list of words narrows it.
    const VALUE: Value;

    /// Reads the value of a key; `None` if it has mistakes, which are noted.
    fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self>;
}

impl Key {
    /// The key as that of the elements of its value.
    fn of(self, value: &Value) -> Self {
        Key { value: *value, ..self }
    }

    /// A number within the range of this key.
    fn within(self, entry: &Entry, value: f64, mistakes: &mut Collector) -> Option<f64> {
        let (min, max, unit) = self.value.range();
        if (min..=max).contains(&value) {
            return Some(value);
        }
        let mistake = Diagnostic::out_of_range(entry.key, value, (min, max), unit, self.summary);
        mistakes.note(&entry.value_at(), mistake);
        None
    }

    /// Notes a list or a table with too few entries.
    fn enough(self, entry: &Entry, count: usize, mistakes: &mut Collector) {
        let (Value::List(least, _) | Value::Names(least, _)) = self.value else { return };
        if count < least {
            let mistake = match least {
                1 => format!("'{}' is empty", entry.key),
                _ => format!("'{}' needs at least {least} entries", entry.key),
            };
            let is_list = matches!(self.value, Value::List(..));
            let at = if is_list { entry.value_at() } else { entry.at.clone() };
            mistakes.note(&at, Diagnostic::new(mistake));
        }
    }
}

impl Read for f64 {
    const VALUE: Value = Value::Number(f64::NEG_INFINITY, f64::INFINITY, "");

    fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self> {
        let number = mistakes.number(entry)?;
        key.within(entry, number, mistakes)
    }
}

/// Whole numbers up to 2⁵³ are exact as f64.
macro_rules! whole {
    ($($type:ty)*) => {$(
        impl Read for $type {
            const VALUE: Value = Value::Whole(0.0, 9_007_199_254_740_992.0);

            fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self> {
                let number = mistakes.number(entry)?;
                if !entry.is_whole() {
                    let mistake = format!("{} = {number} must be a whole number", entry.key);
                    mistakes.note(&entry.value_at(), Diagnostic::new(mistake));
                    return None;
                }
                key.within(entry, number, mistakes).map(|number| number as $type)
            }
        }
    )*};
}
whole!(u32 u64 usize);

impl Read for [f64; 2] {
    const VALUE: Value = Value::Range;

    fn read(entry: &Entry, _key: Key, mistakes: &mut Collector) -> Option<Self> {
        let list = mistakes.list(entry)?;
        let [low, high] = &list[..] else {
            return mistakes.wanted(entry, None, "two numbers");
        };
        let [low, high] = [mistakes.number(low)?, mistakes.number(high)?];
        if low > high {
            mistakes.note(&entry.value_at(), not_in_order(entry.key, low, high));
            return None;
        }
        Some([low, high])
    }
}

/// The mistake of two numbers in the wrong order.
pub(crate) fn not_in_order(key: &str, low: f64, high: f64) -> Diagnostic {
    Diagnostic::new(format!("'{key}' goes from {low} to {high}: the lower number comes first"))
}

impl Read for bool {
    const VALUE: Value = Value::Flag;

    fn read(entry: &Entry, _key: Key, mistakes: &mut Collector) -> Option<Self> {
        mistakes.wanted(entry, entry.value.get_ref().as_bool(), "true or false")
    }
}

impl Read for String {
    const VALUE: Value = Value::Text;

    fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self> {
        let word = mistakes.text(entry)?;
        match key.value {
            Value::Word(words) if !words().contains(&word) => {
                let message = format!("'{}' cannot be '{word}'", entry.key);
                let mistake = Diagnostic::unknown(message, word, words());
                mistakes.note(&entry.value_at(), mistake);
                return None;
            }
            Value::Id => check_id(word, &entry.value_at(), mistakes),
            _ => {}
        }
        Some(word.to_owned())
    }
}

impl Read for Unit {
    const VALUE: Value = Value::Unit;

    fn read(entry: &Entry, _key: Key, mistakes: &mut Collector) -> Option<Self> {
        let word = mistakes.text(entry)?;
        let unit = units::find_si(word);
        if unit.is_none() {
            let help = match units::meant(word) {
                Some(unit) => format!("files are in SI: \"{}\"", units::word(unit)),
                None => {
                    let known: Vec<&str> = Unit::ALL.into_iter().map(units::word).collect();
                    format!("known: {} (1: a pure number)", known.join(", "))
                }
            };
            let mistake = Diagnostic::new(format!("unknown unit '{word}'")).with_help(help);
            mistakes.note(&entry.value_at(), mistake);
        }
        unit
    }
}

impl Read for Raw {
    const VALUE: Value = Value::Other(|| json!({ "type": "object" }), "a table");

    fn read(entry: &Entry, _key: Key, mistakes: &mut Collector) -> Option<Self> {
        mistakes.table(entry).map(|_| Raw)
    }
}

impl<T: Read> Read for Option<T> {
    const VALUE: Value = T::VALUE;

    fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self> {
        T::read(entry, key, mistakes).map(Some)
    }
}

impl<T: Read> Read for At<T> {
    const VALUE: Value = T::VALUE;

    fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self> {
        Some(At { value: T::read(entry, key, mistakes)?, at: entry.place() })
    }
}

impl<T: Read> Read for Vec<T> {
    const VALUE: Value = Value::List(0, &T::VALUE);

    fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self> {
        let Value::List(_, of) = key.value else { panic!("'{}' is no list", key.name) };
        let list = mistakes.list(entry)?;
        key.enough(entry, list.len(), mistakes);
        let read = list.iter().map(|one| T::read(one, key.of(of), mistakes));
        whole(read.collect())
    }
}

/// All values, if none of them has mistakes; every one was read to note them.
fn whole<T>(read: Vec<Option<T>>) -> Option<Vec<T>> {
    read.into_iter().collect()
}

/// The entries of a table with names of their own.
fn named<T: Read>(
    entry: &Entry,
    (key, of): (Key, &Value),
    mistakes: &mut Collector,
) -> Option<Vec<(At<String>, T)>> {
    let all = mistakes.table(entry)?;
    key.enough(entry, all.len(), mistakes);
    let read = |named: &Entry| {
        let value = T::read(named, key.of(of), mistakes)?;
        Some((At::new(named.key.to_owned(), named.at.clone()), value))
    };
    whole(all.iter().map(read).collect())
}

impl<T: Read> Read for Names<T> {
    const VALUE: Value = Value::Names(0, &T::VALUE);

    fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self> {
        let Value::Names(_, of) = key.value else { panic!("'{}' has no names", key.name) };
        named(entry, (key, of), mistakes).map(Self::from_iter)
    }
}

impl<T: Read> Read for Ids<T> {
    const VALUE: Value = Value::Ids(&T::VALUE);

    fn read(entry: &Entry, key: Key, mistakes: &mut Collector) -> Option<Self> {
        let Value::Ids(of) = key.value else { panic!("'{}' has no ids", key.name) };
        let all = named(entry, (key, of), mistakes)?;
        all.iter().for_each(|(id, _)| check_id(id, &id.at, mistakes));
        Some(Ids(all))
    }
}

/// Whether a text matches [`ID`].
pub(crate) fn is_id(name: &str) -> bool {
    let is_good = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    !name.is_empty() && name.chars().all(is_good)
}

/// Keys of a component that cannot be names.
const RESERVED: [&str; 4] = ["kind", "assembly", "fluid", "faults"];

/// Notes that a name cannot be that of a part of a system.
pub(crate) fn check_id(name: &str, at: &TextSpan, mistakes: &mut Collector) {
    let (message, help) = if RESERVED.contains(&name) {
        (format!("the name '{name}' has a meaning of its own"), "choose another")
    } else if !is_id(name) {
        (format!("'{name}' cannot be a name"), "names have small letters, digits and '_'")
    } else {
        return;
    };
    mistakes.note(at, Diagnostic::new(message).with_help(help));
}

/// A section in which every key has its default.
///
/// # Panics
/// A key is required.
pub fn usual<T: Read>() -> T {
    let mut mistakes = Collector::default();
    let text = TomlText::parse("usual = {}", 0, &mut mistakes).expect("TOML");
    let key = may("usual", T::VALUE, "");
    T::read(&text.root()[0], key, &mut mistakes).expect("no key is required")
}

/// Declares a section of a file once: the struct that a file fills, and its keys as data. The reader, the JSON Schema,
/// the book's table and the fields' documentation all come from this declaration.
///
/// A field has `must` or `may`, a name, a type, the kind of value unless the type implies it, behind `=>` the default
/// unless the type implies it, and a summary. A field with `with` is another section, whose keys stand among those of
/// this one.
#[macro_export]
macro_rules! section {
    (
        $(#[$attribute:meta])*
        $vis:vis struct $Name:ident {
            $(
                $(#[$on_field:meta])*
                $need:ident $field_vis:vis $field:ident: $type:ty $(= $value:expr)? $(=> $default:expr)?, $summary:literal;
            )*
        }
    ) => {
        #[derive(Clone, Debug)]
        $(#[$attribute])*
        $vis struct $Name {
            $(
                #[doc = $summary]
                $(#[$on_field])*
                $field_vis $field: $type,
            )*
        }

        impl $Name {
            /// The keys of each field.
            const OF_FIELDS: &'static [&'static [$crate::format::Key]] = &[
                $($crate::section!(@keys $need $field $type, $summary $(, $value)?)),*
            ];

            /// The keys of this section.
            pub(crate) const KEYS: &'static [$crate::format::Key] = &$crate::format::joined::<
                { $crate::format::count(Self::OF_FIELDS) },
            >(Self::OF_FIELDS);

            /// Reads the entries of a table, `None` if they have mistakes; `place` locates it in messages.
            pub(crate) fn of(
                all: &[$crate::format::Entry],
                place: (&$crate::format::TextSpan, &str),
                mistakes: &mut $crate::format::Collector,
            ) -> Option<Self> {
                $crate::format::only(Self::KEYS, all, place.1, mistakes);
                Self::of_known(all, place, mistakes)
            }

            /// The same, where other sections check which keys there are.
            pub(crate) fn of_known(
                all: &[$crate::format::Entry],
                place: (&$crate::format::TextSpan, &str),
                mistakes: &mut $crate::format::Collector,
            ) -> Option<Self> {
                let mut keys = Self::OF_FIELDS.iter();
                // Only required keys tell their place.
                let _ = place;
                $(
                    let keys_of_field = *keys.next().expect("a list for each field");
                    let $field: Option<$type> =
                        $crate::section!(@read $need $type, keys_of_field, all, place, mistakes $(, $default)?);
                )*
                Some(Self { $($field: $field?),* })
            }
        }

        impl $crate::format::Read for $Name {
            const VALUE: $crate::format::Value = $crate::format::Value::Table(Self::KEYS);

            fn read(
                entry: &$crate::format::Entry,
                _key: $crate::format::Key,
                mistakes: &mut $crate::format::Collector,
            ) -> Option<Self> {
                let place = format!("'{}'", entry.key);
                Self::of(&mistakes.table(entry)?, (&entry.at, &place), mistakes)
            }
        }
    };
    (@keys with $field:ident $type:ty, $summary:literal) => { <$type>::KEYS };
    (@keys $need:ident $field:ident $type:ty, $summary:literal $(, $value:expr)?) => {
        &[$crate::format::$need(
            $crate::format::name(stringify!($field)),
            $crate::section!(@value $type $(, $value)?),
            $summary,
        )]
    };
    (@read with $type:ty, $keys:ident, $all:ident, $place:ident, $mistakes:ident) => {
        {
            // The section looks its own keys up.
            let _ = $keys;
            <$type>::of_known($all, $place, $mistakes)
        }
    };
    (@read $need:ident $type:ty, $keys:ident, $all:ident, $place:ident, $mistakes:ident $(, $default:expr)?) => {
        match $crate::format::get($all, $keys[0].name) {
            Some(entry) => $crate::format::Read::read(entry, $keys[0], $mistakes),
            None => $crate::section!(@missing $need $keys, $all, $place, $mistakes $(, $default)?),
        }
    };
    (@value $type:ty) => { <$type as $crate::format::Read>::VALUE };
    (@value $type:ty, $value:expr) => { $value };
    (@missing must $keys:ident, $all:ident, $at:ident, $mistakes:ident) => { $crate::format::missing($keys[0], $all, $at, $mistakes) };
    (@missing may $keys:ident, $all:ident, $at:ident, $mistakes:ident) => { Some(Default::default()) };
    (@missing may $keys:ident, $all:ident, $at:ident, $mistakes:ident, $default:expr) => { Some($default) };
}
pub use section;

/// Declares the words of a type in files, as an iterator over the words with their values.
macro_rules! words {
    ($type:ty, $pairs:expr) => {
        impl $crate::format::Read for $type {
            const VALUE: $crate::format::Value =
                $crate::format::Value::Word(|| $pairs.map(|(word, _): (_, $type)| word).collect());

            fn read(
                entry: &$crate::format::Entry,
                key: $crate::format::Key,
                mistakes: &mut $crate::format::Collector,
            ) -> Option<Self> {
                let word = String::read(entry, key, mistakes)?;
                $pairs.find(|(known, _)| *known == word).map(|(_, value)| value)
            }
        }
    };
}
pub(crate) use words;

/// The name of a field as a key: `r#return` is written `return`.
pub const fn name(field: &'static str) -> &'static str {
    match field.as_bytes() {
        [b'r', b'#', ..] => field.split_at(2).1,
        _ => field,
    }
}

/// The number of keys in some lists.
pub const fn count(lists: &[&[Key]]) -> usize {
    let (mut list, mut all) = (0, 0);
    while list < lists.len() {
        all += lists[list].len();
        list += 1;
    }
    all
}

/// The keys of some lists, which are [`count`]ed, in one.
///
/// # Panics
/// There are other keys than `N`.
pub const fn joined<const N: usize>(lists: &[&[Key]]) -> [Key; N] {
    let mut keys = [may("", Value::Flag, ""); N];
    let (mut list, mut all) = (0, 0);
    while list < lists.len() {
        let mut key = 0;
        while key < lists[list].len() {
            keys[all] = lists[list][key];
            (key, all) = (key + 1, all + 1);
        }
        list += 1;
    }
    assert!(all == N);
    keys
}

/// Notes the entries of a table that no key declares.
pub fn only(keys: &[Key], all: &[Entry], place: &str, mistakes: &mut Collector) {
    for entry in all.iter().filter(|entry| keys.iter().all(|key| key.name != entry.key)) {
        let known = keys.iter().map(|key| key.name);
        let mistake = match slip(entry, keys) {
            Some(slip) => slip.mistake(entry.key),
            None => Diagnostic::unknown_key(entry.key, place, known),
        };
        mistakes.note(&entry.at, mistake);
    }
}

/// The key that was meant by one with another unit at its end.
fn slip(entry: &Entry, keys: &[Key]) -> Option<units::Slip> {
    let measured = keys.iter().filter_map(|key| match key.value {
        Value::Number(_, _, unit) => Some((key.name, units::find_si(unit)?)),
        _ => None,
    });
    units::slip(entry, measured)
}

/// Notes a required key that is missing, unless it was written with another unit.
pub fn missing<T>(
    key: Key,
    all: &[Entry],
    (at, place): (&TextSpan, &str),
    mistakes: &mut Collector,
) -> Option<T> {
    if all.iter().any(|entry| slip(entry, &[key]).is_some()) {
        return None;
    }
    let write = format!("{} ({})", key.value.example(key.name), key.summary);
    mistakes.note(at, Diagnostic::missing(place, key.name, write));
    None
}

impl Value {
    /// The range of a number, and its unit.
    pub(crate) fn range(self) -> (f64, f64, &'static str) {
        match self {
            Value::Number(min, max, unit) => (min, max, unit),
            Value::Whole(min, max) => (min, max, ""),
            _ => (f64::NEG_INFINITY, f64::INFINITY, ""),
        }
    }

    /// An example of a key with such a value.
    fn example(&self, name: &str) -> String {
        match self {
            Value::Number(min, max, unit) if max.is_finite() => {
                format!("{name} = …, {}", Quantities(*min, *max, unit))
            }
            Value::Number(..) => format!("{name} = 0.0"),
            Value::Whole(..) => format!("{name} = 1"),
            Value::Range => format!("{name} = [0, 1]"),
            Value::Flag => format!("{name} = true"),
            Value::Text => format!("{name} = \"…\""),
            Value::Id => format!("{name} = \"my_actuator\""),
            Value::Word(words) => format!("{name} = \"{}\"", words().join("\" or \"")),
            Value::Unit => format!("{name} = \"Pa\", or \"1\" for a pure number"),
            Value::Signal => format!("{name} = \"step:size=…\""),
            Value::List(..) => format!("{name} = […]"),
            Value::Names(..) | Value::Ids(_) => format!("{name}.… = …"),
            Value::Table(_) | Value::Other(..) => format!("{name} = {{ … }}"),
        }
    }

    /// The JSON Schema of the value.
    pub(crate) fn schema(&self) -> Json {
        match *self {
            Value::Number(min, max, _) => number(min, max),
            Value::Whole(min, max) => json!({ "type": "integer", "minimum": min, "maximum": max }),
            Value::Range => json!({
                "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2,
            }),
            Value::Flag => json!({ "type": "boolean" }),
            Value::Text => json!({ "type": "string" }),
            Value::Id => json!({ "type": "string", "pattern": ID }),
            Value::Word(words) => json!({ "type": "string", "enum": words() }),
            Value::Unit => json!({ "type": "string", "enum": units::spellings_of_si() }),
            Value::Signal => json!({ "type": ["string", "number"] }),
            Value::List(least, of) => {
                json!({ "type": "array", "items": of.schema(), "minItems": least })
            }
            Value::Names(least, of) => json!({
                "type": "object", "additionalProperties": of.schema(), "minProperties": least,
            }),
            Value::Ids(of) => json!({
                "type": "object", "propertyNames": { "pattern": ID },
                "additionalProperties": of.schema(),
            }),
            Value::Table(keys) => object(keys),
            Value::Other(schema, _) => schema(),
        }
    }

    /// A description of the value for the documentation.
    pub fn words(&self) -> String {
        match self {
            Value::Number(min, max, unit) if max.is_finite() => {
                Quantities(*min, *max, unit).to_string()
            }
            Value::Number(..) => "a number".into(),
            Value::Whole(min, max) => format!("whole number, {}", Quantities(*min, *max, "")),
            Value::Range => "two numbers, the lower one first".into(),
            Value::Flag => "true or false".into(),
            Value::Text => "a text".into(),
            Value::Id => "small letters, digits and `_`".into(),
            Value::Word(words) => words().join(", "),
            Value::Unit => "an SI unit, or `1` for a pure number".into(),
            Value::Signal => "a signal".into(),
            Value::List(_, of) => format!("a list: {}", of.words()),
            Value::Names(_, of) | Value::Ids(of) => {
                format!("your own names, each with {}", of.words())
            }
            Value::Table(_) => "a table".into(),
            Value::Other(_, words) => (*words).into(),
        }
    }
}

/// A number within a range, as JSON Schema.
pub(crate) fn number(min: f64, max: f64) -> Json {
    let mut schema = json!({ "type": "number" });
    for (word, limit) in [("minimum", min), ("maximum", max)] {
        if limit.is_finite() {
            schema[word] = json!(limit);
        }
    }
    schema
}

/// A table with known keys, as JSON Schema.
pub(crate) fn object(keys: &[Key]) -> Json {
    let mut properties = serde_json::Map::new();
    for key in keys {
        let mut schema = key.value.schema();
        let unit = match key.value {
            Value::Number(_, _, unit) if !unit.is_empty() => format!(", {unit}"),
            _ => String::new(),
        };
        schema["description"] = json!(format!("{}{unit}", key.summary));
        properties.insert(key.name.into(), schema);
    }
    let required: Vec<&str> =
        keys.iter().filter(|key| key.obligatory).map(|key| key.name).collect();
    json!({
        "type": "object", "properties": properties, "required": required,
        "additionalProperties": false,
    })
}

/// The JSON Schema of a file with these keys; their kinds refer to the definitions.
pub(crate) fn schema(
    title: &str,
    keys: &[Key],
    definitions: serde_json::Map<String, Json>,
) -> Json {
    let mut schema = object(keys);
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!(title);
    schema["$defs"] = Json::Object(definitions);
    schema
}

/// All keys as a Markdown table; keys of inner tables have dots. A table whose keys were listed before refers to them.
pub fn markdown(keys: &[Key]) -> String {
    let mut text = String::from("| key | value | meaning |\n|---|---|---|\n");
    rows(keys, "", &mut vec![], &mut text);
    text
}

fn rows(keys: &[Key], before: &str, listed: &mut Vec<(&'static [Key], String)>, text: &mut String) {
    for key in keys {
        let name = format!("{before}{}", key.name);
        let must = if key.obligatory { ", required" } else { "" };
        let (inner, dots) = match &key.value {
            Value::Table(keys) => (Some(*keys), ""),
            Value::List(_, Value::Table(keys)) => (Some(*keys), "[]"),
            Value::Names(_, Value::Table(keys)) | Value::Ids(Value::Table(keys)) => {
                (Some(*keys), ".NAME")
            }
            _ => (None, ""),
        };
        let first = inner.and_then(|inner| listed.iter().find(|(keys, _)| are_alike(keys, inner)));
        let reference = first.map_or(String::new(), |(_, name)| format!("; keys as in `{name}`"));
        let words = key.value.words();
        *text += &format!("| `{name}` | {words}{must} | {}{reference} |\n", key.summary);
        if let Some(inner) = inner
            && reference.is_empty()
        {
            let name = format!("{name}{dots}");
            listed.push((inner, name.clone()));
            rows(inner, &format!("{name}."), listed, text);
        }
    }
}

/// Whether two tables have the same keys.
fn are_alike(one: &[Key], other: &[Key]) -> bool {
    let line = |key: &Key| (key.name, key.summary, key.obligatory);
    one.iter().map(line).eq(other.iter().map(line))
}
