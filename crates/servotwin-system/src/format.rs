//! File formats as data. Checks, the JSON Schema and the book's table of keys are derived from it.

use crate::document::{self, Entry, TextSpan, entries};
use crate::nearest::nearest;
use crate::signal::Signal;
use serde::Deserialize;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use toml::Spanned;
use toml::de::{DeValue, ValueDeserializer};

/// A key of a table.
pub struct Key {
    /// Name of the key.
    pub name: &'static str,
    /// Kind of its value.
    pub value: Value,
    /// Whether the key is required.
    pub obligatory: bool,
    /// One line for the documentation.
    pub summary: &'static str,
}

/// Kind of a key's value.
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
    /// One of a list of words.
    Word(fn() -> Vec<&'static str>),
    /// A signal: a text, a number, a table with `kind`, or a list of them.
    Signal,
    /// A list with at least this many elements.
    List(usize, &'static Value),
    /// A table of freely named entries, with at least this many.
    Names(usize, &'static Value),
    /// A table with known keys.
    Table(&'static [Key]),
}

/// A required key.
pub(crate) const fn must(name: &'static str, value: Value, summary: &'static str) -> Key {
    Key { name, value, obligatory: true, summary }
}

/// An optional key.
pub(crate) const fn may(name: &'static str, value: Value, summary: &'static str) -> Key {
    Key { name, value, obligatory: false, summary }
}

/// The kind of value that a field's type implies, unless a range or a list of words narrows it.
pub(crate) trait Described {
    /// The kind of value.
    const VALUE: Value;
}

impl Described for f64 {
    const VALUE: Value = Value::Number(f64::NEG_INFINITY, f64::INFINITY, "");
}

impl Described for [f64; 2] {
    const VALUE: Value = Value::Range;
}

impl Described for bool {
    const VALUE: Value = Value::Flag;
}

impl Described for String {
    const VALUE: Value = Value::Text;
}

impl Described for Signal {
    const VALUE: Value = Value::Signal;
}

impl<T: Described> Described for Option<T> {
    const VALUE: Value = T::VALUE;
}

impl<T: Described> Described for Vec<T> {
    const VALUE: Value = Value::List(0, &T::VALUE);
}

impl<T: Described> Described for BTreeMap<String, T> {
    const VALUE: Value = Value::Names(0, &T::VALUE);
}

/// Declares a section of a file once: the struct that serde fills, and its keys as data. Checks, JSON Schema, the
/// book's table and the fields' documentation all come from this declaration.
///
/// A field has `must` or `may`, a name, a type, the kind of value unless the type implies it, and a summary.
macro_rules! section {
    (
        $(#[$attribute:meta])*
        $vis:vis struct $Name:ident {
            $(
                $(#[$on_field:meta])*
                $need:ident $field_vis:vis $field:ident: $type:ty $(= $value:expr)?, $summary:literal;
            )*
        }
    ) => {
        #[derive(Clone, Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        $(#[$attribute])*
        $vis struct $Name {
            $(
                #[doc = $summary]
                $(#[$on_field])*
                $field_vis $field: $type,
            )*
        }

        impl $Name {
            /// The keys of this section.
            pub(crate) const KEYS: &'static [$crate::format::Key] = &[
                $($crate::format::$need(
                    stringify!($field),
                    $crate::format::section!(@value $type $(, $value)?),
                    $summary,
                )),*
            ];
        }

        impl $crate::format::Described for $Name {
            const VALUE: $crate::format::Value = $crate::format::Value::Table(Self::KEYS);
        }
    };
    (@value $type:ty) => { <$type as $crate::format::Described>::VALUE };
    (@value $type:ty, $value:expr) => { $value };
}
pub(crate) use section;

/// Receives mistakes with their places.
pub(crate) type Note<'n> = &'n mut dyn FnMut(&TextSpan, document::TomlMistake);

/// Checks the keys of a table; `at` and `place` locate it in messages.
pub(crate) fn check_table(keys: &[Key], at: &TextSpan, place: &str, all: &[Entry], note: Note) {
    for entry in all {
        match keys.iter().find(|key| key.name == entry.key) {
            Some(key) => key.value.check(key.summary, entry, note),
            None => {
                let known: Vec<String> = keys.iter().map(|key| key.name.to_owned()).collect();
                let nearest = nearest(entry.key, known.iter().map(String::as_str));
                let (key, place) = (entry.key.into(), place.into());
                let nearest = nearest.map(str::to_owned);
                note(&entry.at, document::TomlMistake::UnknownKey { key, place, nearest, known });
            }
        }
    }
    for key in keys.iter().filter(|key| key.obligatory) {
        if all.iter().all(|entry| entry.key != key.name) {
            let write = format!("{} ({})", key.value.example(key.name), key.summary);
            note(at, document::TomlMistake::Missing { place: place.into(), key: key.name, write });
        }
    }
}

impl Value {
    fn check(&self, summary: &'static str, entry: &Entry, note: Note) {
        if let Err(mistake) = self.checked(summary, entry, note) {
            // The value of a section is its whole text, so its key is the better place.
            let is_section = matches!(self, Value::Table(_) | Value::Names(..));
            let at = if is_section { entry.at.clone() } else { entry.value_at() };
            note(&at, mistake);
        }
    }

    fn checked(
        &self,
        summary: &'static str,
        entry: &Entry,
        note: Note,
    ) -> Result<(), document::TomlMistake> {
        let key = || entry.key.to_owned();
        let within = |value: f64, min: f64, max: f64, unit: &'static str| {
            if (min..=max).contains(&value) {
                return Ok(());
            }
            Err(document::TomlMistake::OutOfRange { key: key(), value, min, max, unit, summary })
        };
        match *self {
            Value::Number(min, max, unit) => within(entry.number()?, min, max, unit),
            Value::Whole(min, max) => {
                let value = entry.number()?;
                if value.fract() != 0.0 || !matches!(entry.value.get_ref(), DeValue::Integer(_)) {
                    return Err(document::TomlMistake::NotWhole { key: key(), value });
                }
                within(value, min, max, "")
            }
            Value::Range => {
                let list = entry.list()?;
                let [low, high] = list else { return Err(entry.wrong_type("two numbers")) };
                let [low, high] = [low, high].map(|of| Entry::element(entry.key, of).number());
                let (low, high) = (low?, high?);
                if low <= high {
                    return Ok(());
                }
                Err(document::TomlMistake::NotInOrder { key: key(), low, high })
            }
            Value::Flag => match entry.value.get_ref() {
                DeValue::Boolean(_) => Ok(()),
                _ => Err(entry.wrong_type("true or false")),
            },
            Value::Text => entry.text().map(drop),
            Value::Word(words) => {
                let word = entry.text()?.to_owned();
                let known = words();
                if known.contains(&word.as_str()) {
                    return Ok(());
                }
                let nearest = nearest(&word, known.iter().copied()).map(str::to_owned);
                let known = known.into_iter().map(str::to_owned).collect();
                Err(document::TomlMistake::UnknownWord { key: key(), word, nearest, known })
            }
            Value::Signal => signal(entry.value).map(drop),
            Value::List(least, of) => {
                let list = entry.list()?;
                for element in list {
                    of.check(summary, &Entry::element(entry.key, element), note);
                }
                enough(list.len(), least, entry)
            }
            Value::Names(least, of) => {
                let all = entries(entry.table()?);
                all.iter().for_each(|named| of.check(summary, named, note));
                enough(all.len(), least, entry)
            }
            Value::Table(keys) => {
                let all = entries(entry.table()?);
                check_table(keys, &entry.at, &format!("'{}'", entry.key), &all, note);
                Ok(())
            }
        }
    }

    /// A corrected copy of a value: without unknown keys, and with stand-ins for missing or invalid values. It lets the
    /// reader continue and report the mistakes elsewhere.
    fn mended(&self, value: Option<toml::Value>) -> toml::Value {
        use toml::Value as Toml;
        match (self, value) {
            (Value::Number(min, max, _), value) => {
                let number = value.as_ref().and_then(as_number);
                let number = number.filter(|number| (*min..=*max).contains(number));
                Toml::Float(number.unwrap_or(1.0_f64.clamp(*min, *max)))
            }
            (Value::Whole(min, max), value) => {
                let number = value.and_then(|value| value.as_integer());
                let number = number.filter(|number| (*min..=*max).contains(&(*number as f64)));
                Toml::Integer(number.unwrap_or(1.0_f64.clamp(*min, *max) as i64))
            }
            (Value::Range, value) => {
                let ends: Vec<f64> =
                    value.iter().flat_map(elements).filter_map(as_number).collect();
                match ends[..] {
                    [low, high] if low <= high => value.unwrap_or_else(|| list([low, high])),
                    _ => list([0.0, 1.0]),
                }
            }
            (Value::Flag, value) => {
                Toml::Boolean(value.and_then(|value| value.as_bool()).unwrap_or_default())
            }
            (Value::Text, Some(Toml::String(text))) => Toml::String(text),
            (Value::Text, _) => Toml::String(String::new()),
            (Value::Word(words), value) => {
                let words = words();
                let word = value.as_ref().and_then(Toml::as_str);
                let word = word.filter(|word| words.contains(word)).unwrap_or(words[0]);
                Toml::String(word.into())
            }
            (Value::Signal, Some(value)) if Signal::deserialize(value.clone()).is_ok() => value,
            (Value::Signal, _) => Toml::Float(0.0),
            (Value::List(least, of), value) => {
                let there = value.iter().flat_map(elements);
                let mut all: Vec<Toml> = there.map(|one| of.mended(Some(one.clone()))).collect();
                all.resize_with(all.len().max(*least), || of.mended(None));
                Toml::Array(all)
            }
            (Value::Names(_, of), Some(Toml::Table(table))) => {
                let all = table.into_iter().map(|(name, one)| (name, of.mended(Some(one))));
                Toml::Table(all.collect())
            }
            (Value::Names(..), _) => Toml::Table(toml::Table::new()),
            (Value::Table(keys), Some(Toml::Table(table))) => Toml::Table(mended(keys, table)),
            (Value::Table(keys), _) => Toml::Table(mended(keys, toml::Table::new())),
        }
    }

    /// An example of a key with such a value.
    fn example(&self, name: &str) -> String {
        match self {
            Value::Number(min, max, unit) => {
                format!("{name} = …, {}", document::Quantities(*min, *max, unit))
            }
            Value::Whole(..) => format!("{name} = 1"),
            Value::Range => format!("{name} = [0, 1]"),
            Value::Flag => format!("{name} = true"),
            Value::Text => format!("{name} = \"…\""),
            Value::Word(words) => format!("{name} = \"{}\"", words().join("\" or \"")),
            Value::Signal => format!("{name} = \"step:size=…\""),
            Value::List(..) => format!("{name} = […]"),
            Value::Names(..) => format!("{name}.… = …"),
            Value::Table(_) => format!("{name} = {{ … }}"),
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
            Value::Word(words) => json!({ "type": "string", "enum": words() }),
            Value::Signal => json!({ "$ref": "#/$defs/signal" }),
            Value::List(least, of) => {
                json!({ "type": "array", "items": of.schema(), "minItems": least })
            }
            Value::Names(least, of) => json!({
                "type": "object", "additionalProperties": of.schema(), "minProperties": least,
            }),
            Value::Table(keys) => object(keys),
        }
    }

    /// A description of the value for the documentation.
    pub(crate) fn words(&self) -> String {
        match self {
            Value::Number(min, max, unit) if max.is_finite() => {
                document::Quantities(*min, *max, unit).to_string()
            }
            Value::Number(..) => "a number".into(),
            Value::Whole(min, max) => {
                format!("whole number, {}", document::Quantities(*min, *max, ""))
            }
            Value::Range => "two numbers, the lower one first".into(),
            Value::Flag => "true or false".into(),
            Value::Text => "a text".into(),
            Value::Word(words) => words().join(", "),
            Value::Signal => "a signal".into(),
            Value::List(_, of) => format!("a list: {}", of.words()),
            Value::Names(_, of) => format!("your own names, each with {}", of.words()),
            Value::Table(_) => "a table".into(),
        }
    }
}

/// A table as it should be: see `Value::mended`.
pub(crate) fn mended(keys: &[Key], mut table: toml::Table) -> toml::Table {
    let there = keys.iter().filter_map(|key| {
        let value = table.remove(key.name);
        let wanted = key.obligatory || value.is_some();
        wanted.then(|| (key.name.to_owned(), key.value.mended(value)))
    });
    there.collect()
}

/// The keys with missing or invalid values. Unknown keys and unknown words do not count, because nothing else depends
/// on them.
pub(crate) fn doubtful(keys: &[Key], all: &[Entry]) -> Vec<&'static str> {
    use document::TomlMistake::{UnknownKey, UnknownWord};
    let is_doubtful = |key: &&Key| {
        let Some(entry) = all.iter().find(|entry| entry.key == key.name) else {
            return key.obligatory;
        };
        let mut wrong = false;
        key.value.check(key.summary, entry, &mut |_, mistake| {
            wrong |= !matches!(mistake, UnknownKey { .. } | UnknownWord { .. });
        });
        wrong
    };
    keys.iter().filter(is_doubtful).map(|key| key.name).collect()
}

fn as_number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

fn elements(value: &toml::Value) -> &[toml::Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn list<const N: usize>(numbers: [f64; N]) -> toml::Value {
    toml::Value::Array(numbers.map(toml::Value::Float).to_vec())
}

fn enough(count: usize, least: usize, entry: &Entry) -> Result<(), document::TomlMistake> {
    if count >= least {
        return Ok(());
    }
    Err(document::TomlMistake::TooFew { key: entry.key.into(), least })
}

/// Parses a signal.
fn signal(value: &Spanned<DeValue>) -> Result<Signal, document::TomlMistake> {
    Signal::deserialize(ValueDeserializer::from(value.clone())).map_err(|error| {
        let message = error.message().trim().to_owned();
        document::TomlMistake::Signal { message }
    })
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
            Value::Names(_, Value::Table(keys)) => (Some(*keys), ".NAME"),
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
