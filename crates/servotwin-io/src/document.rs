//! Hand-written TOML files: values with their places, and mistakes shown at their places.
//!
//! A reader walks through [`entries`] in the order of the file, collects every mistake in a [`Collector`] and
//! continues. At the end the mistakes are sorted by place and shown as
//!
//! ```text
//! systems/x.toml:7:1: unknown kind of component 'orifise'
//!    |
//!  7 | kind = "orifise"
//!    |        ^^^^^^^^^
//!    = nearest: 'orifice'
//! ```

use crate::sanitize;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeInteger, DeTable, DeValue};

/// A range of bytes in the text.
pub type TextSpan = Range<usize>;

/// The display of a mistake in a file, in one line, and advice.
pub trait Explained: fmt::Display {
    /// The advice, in one line.
    fn help(&self) -> Option<String> {
        None
    }

    /// For a number out of range, the smallest and largest allowed values, SI.
    fn range(&self) -> Option<(f64, f64)> {
        None
    }

    /// The allowed values in words, if two numbers cannot express them.
    fn allowed(&self) -> Option<String> {
        None
    }
}

/// Mistakes that any TOML file can contain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a kind names its fields")]
pub enum TomlMistake {
    /// The text is not TOML.
    #[error("not valid TOML: {message}")]
    Syntax { message: String },
    /// This version does not know the file's format version.
    #[error("format {found} is not known: this version reads format {supported}")]
    Format { found: f64, supported: u32 },
    /// The file has another purpose.
    #[error("this is {is}, not {wanted}")]
    OtherKind { is: &'static str, wanted: &'static str, help: String },
    /// The value must have another type.
    #[error("'{key}' must be {wanted}, not {found}")]
    WrongType { key: String, wanted: &'static str, found: &'static str },
    /// A number is infinite, not a number, or too large.
    #[error("'{key}' must be a finite number")]
    NotFinite { key: String },
    /// A number is outside its range; `summary` explains its meaning.
    #[error(
        "{key} = {} is out of range: allowed are {}",
        NumberWithUnit(*.value, .unit), Quantities(*.min, *.max, .unit)
    )]
    OutOfRange {
        key: String,
        value: f64,
        min: f64,
        max: f64,
        unit: &'static str,
        summary: &'static str,
    },
    /// A number must be whole.
    #[error("{key} = {value} must be a whole number")]
    NotWhole { key: String, value: f64 },
    /// A list or a table has fewer entries than `least`.
    #[error("{}", too_few(.key, *.least))]
    TooFew { key: String, least: usize },
    /// The two numbers of a range are in the wrong order.
    #[error("'{key}' goes from {low} to {high}: the lower number comes first")]
    NotInOrder { key: String, low: f64, high: f64 },
    /// A signal cannot be read.
    #[error("{message}")]
    Signal { message: String },
    /// A word is none of the allowed ones.
    #[error("'{key}' cannot be '{word}'")]
    UnknownWord { key: String, word: String, nearest: Option<String>, known: Vec<String> },
    /// A required key is missing.
    #[error("{place} lacks '{key}'")]
    Missing { place: String, key: &'static str, write: String },
    /// No reader knows the key.
    #[error("unknown key '{key}' in {place}")]
    UnknownKey { key: String, place: String, nearest: Option<String>, known: Vec<String> },
}

fn too_few(key: &str, least: usize) -> String {
    match least {
        1 => format!("'{key}' is empty"),
        _ => format!("'{key}' needs at least {least} entries"),
    }
}

impl Explained for TomlMistake {
    fn help(&self) -> Option<String> {
        match self {
            TomlMistake::OutOfRange { key, summary, .. } => Some(format!("{key}: {summary}")),
            TomlMistake::OtherKind { help, .. } => Some(help.clone()),
            TomlMistake::Missing { write, .. } => Some(format!("write: {write}")),
            TomlMistake::UnknownKey { nearest, known, .. }
            | TomlMistake::UnknownWord { nearest, known, .. } => Some(suggest(nearest, known)),
            _ => None,
        }
    }

    fn range(&self) -> Option<(f64, f64)> {
        match self {
            TomlMistake::OutOfRange { min, max, .. } => Some((*min, *max)),
            _ => None,
        }
    }
}

/// The nearest known name, or all of them if none is near.
pub fn suggest(nearest: &Option<String>, known: &[String]) -> String {
    match nearest {
        Some(name) => format!("nearest: '{name}'"),
        None if known.is_empty() => "nothing may stand here".into(),
        None => format!("known: {}", known.join(", ")),
    }
}

/// A count with a regular singular or plural noun.
pub fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// A number with its unit.
pub struct NumberWithUnit<'a>(pub f64, pub &'a str);

impl fmt::Display for NumberWithUnit<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_number(out, self.0)?;
        if self.1.is_empty() { Ok(()) } else { write!(out, " {}", self.1) }
    }
}

/// A range with its unit.
pub struct Quantities<'a>(pub f64, pub f64, pub &'a str);

impl fmt::Display for Quantities<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_number(out, self.0)?;
        write!(out, " … {}", NumberWithUnit(self.1, self.2))
    }
}

/// Uses exponents only for very small or large numbers.
fn write_number(out: &mut fmt::Formatter<'_>, value: f64) -> fmt::Result {
    let size = value.abs();
    if size == 0.0 || (1e-3..1e6).contains(&size) {
        write!(out, "{value}")
    } else {
        write!(out, "{value:e}")
    }
}

/// A mistake at its place in a file, as text.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// The line, from 1.
    pub line: usize,
    /// The column in characters, from 1.
    pub column: usize,
    /// The number of marked characters, at least 1.
    pub width: usize,
    /// The line's text, or the surroundings of the mistake in a long line.
    pub source: String,
    /// The number of characters of the line before `source`.
    pub skipped: usize,
    /// The mistake, in one line.
    pub message: String,
    /// The advice, in one line.
    pub help: Option<String>,
    /// The smallest and the largest number allowed, SI.
    pub range: Option<(f64, f64)>,
    /// The allowed values in words, if two numbers cannot express them.
    pub allowed: Option<String>,
}

impl Diagnostic {
    /// `breaks` are the byte positions of all line ends.
    fn new(text: &str, breaks: &[usize], span: &TextSpan, mistake: &impl Explained) -> Self {
        let start = floor(text, span.start);
        let before = breaks.partition_point(|&at| at < start);
        let begin = before.checked_sub(1).map_or(0, |last| breaks[last] + 1);
        let end = breaks.get(before).copied().unwrap_or(text.len());
        let stop = floor(text, span.end).clamp(start, end);
        let column = 1 + text[begin..start].chars().count();
        let skipped = if column - 1 > MAX_EXCERPT - 20 { column - 21 } else { 0 };
        let line = text[begin..end].trim_end().chars();
        Self {
            line: 1 + before,
            column,
            width: text[start..stop].chars().count().max(1),
            source: line.skip(skipped).take(MAX_EXCERPT).collect(),
            skipped,
            message: sanitize::clip(mistake.to_string()),
            help: mistake.help().map(sanitize::clip),
            range: mistake.range(),
            allowed: mistake.allowed(),
        }
    }
}

/// The nearest character boundary at or before a byte.
fn floor(text: &str, byte: usize) -> usize {
    let byte = byte.min(text.len());
    (0..=byte).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0)
}

/// The most characters of a source line in a message.
const MAX_EXCERPT: usize = 100;

impl Diagnostic {
    /// Writes the message with its source line.
    fn write(&self, out: &mut fmt::Formatter<'_>, path: &str) -> fmt::Result {
        let Self { line, column, message, source, skipped, .. } = self;
        writeln!(out, "{path}:{line}:{column}: {message}")?;
        let number = line.to_string();
        let margin = " ".repeat(number.len() + 1);
        // Keep tabs, so that the caret stands below its character.
        let before = source.chars().take(column - 1 - skipped);
        let indent: String = before.map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
        let room = (MAX_EXCERPT + skipped + 1).saturating_sub(*column).max(1);
        writeln!(out, "{margin}|")?;
        writeln!(out, "{number} | {source}")?;
        writeln!(out, "{margin}| {indent}{}", "^".repeat(self.width.min(room)))?;
        match &self.help {
            Some(help) => writeln!(out, "{margin}= {help}"),
            None => Ok(()),
        }
    }
}

/// Maximum number of mistakes shown. The next run shows the others after these are fixed.
const MAX_SHOWN: usize = 20;

/// Writes the first mistakes of a file and their total number.
pub fn write_mistakes(
    path: &str,
    mistakes: &[Diagnostic],
    out: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    for mistake in mistakes.iter().take(MAX_SHOWN) {
        mistake.write(out, path)?;
        writeln!(out)?;
    }
    let count = mistakes.len();
    write!(out, "{path}: {}", counted(count, "mistake"))?;
    if count <= MAX_SHOWN {
        return Ok(());
    }
    write!(out, ", of which the first {MAX_SHOWN} are shown")
}

/// A collector takes no more mistakes than this: a damaged file may have one at every byte.
const MAX_FOUND: usize = 100;

/// The first mistakes found.
#[derive(Clone, Debug)]
pub struct Collector<M> {
    found: Vec<(TextSpan, M)>,
    /// For each place, the indices of its mistakes in `found`.
    at: BTreeMap<(usize, usize), Vec<usize>>,
}

impl<M: PartialEq> Collector<M> {
    /// An empty collector.
    pub fn new() -> Self {
        Self { found: Vec::new(), at: BTreeMap::new() }
    }

    /// Adds a mistake; the same one at the same place only once.
    pub fn note(&mut self, span: &TextSpan, mistake: impl Into<M>) {
        if self.found.len() == MAX_FOUND {
            return;
        }
        let mistake = mistake.into();
        let here = self.at.entry((span.start, span.end)).or_default();
        if here.iter().all(|&known| self.found[known].1 != mistake) {
            here.push(self.found.len());
            self.found.push((span.clone(), mistake));
        }
    }

    /// Whether a condition holds for all mistakes.
    pub fn all(&self, holds: impl Fn(&M) -> bool) -> bool {
        self.found.iter().all(|(_, mistake)| holds(mistake))
    }

    /// Whether a place has a mistake.
    pub fn knows(&self, span: &TextSpan) -> bool {
        self.at.contains_key(&(span.start, span.end))
    }

    /// Number of mistakes.
    pub fn len(&self) -> usize {
        self.found.len()
    }

    /// Whether there are no mistakes.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Returns all mistakes in the order of the file.
    pub fn locate(mut self, text: &str) -> Vec<Diagnostic>
    where
        M: Explained,
    {
        self.found.sort_by_key(|(span, _)| span.start);
        let breaks: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).collect();
        self.found.iter().map(|(span, m)| Diagnostic::new(text, &breaks, span, m)).collect()
    }
}

impl<M: PartialEq> Default for Collector<M> {
    fn default() -> Self {
        Self::new()
    }
}

/// Parses a text as far as it is TOML, and notes where it is not.
pub fn parse<'t, M>(text: &'t str, mistakes: &mut Collector<M>) -> Spanned<DeTable<'t>>
where
    M: PartialEq + From<TomlMistake>,
{
    let (root, errors) = DeTable::parse_recoverable(text);
    for error in errors.iter().take(MAX_FOUND) {
        let message = error.message().trim().replace('\n', ", ");
        mistakes.note(&error.span().unwrap_or(0..0), TomlMistake::Syntax { message });
    }
    root
}

/// A key with its value.
#[derive(Clone, Debug)]
pub struct Entry<'a> {
    /// The key.
    pub key: &'a str,
    /// Byte range of the key.
    pub at: TextSpan,
    /// The value.
    pub value: &'a Spanned<DeValue<'a>>,
}

/// The entries of a table in the order of the file.
pub fn entries<'a>(table: &'a DeTable<'a>) -> Vec<Entry<'a>> {
    let mut entries: Vec<Entry<'a>> = (table.iter())
        .map(|(key, value)| Entry { key: key.get_ref(), at: key.span(), value })
        .collect();
    entries.sort_by_key(|entry| entry.at.start);
    entries
}

/// The path of keys and list positions by which a reader reached a value.
///
/// A reader builds it as it descends, and [`KeyPath::find`] follows it through the parsed file. No text is
/// searched, so a place is right even if the same text stands elsewhere in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeyPath<'p> {
    steps: Vec<Step<'p>>,
    /// Whether the place means the last key instead of its value.
    marks_key: bool,
}

#[derive(Clone, Debug, PartialEq)]
enum Step<'p> {
    Key(Cow<'p, str>),
    Element(usize),
}

impl<'p> KeyPath<'p> {
    /// A value below the file's root, by its keys.
    pub fn of(keys: &[&'p str]) -> Self {
        let steps = keys.iter().map(|&key| Step::Key(key.into())).collect();
        Self { steps, marks_key: false }
    }

    /// The value under a key of the table at this place.
    pub fn key(&self, key: impl Into<Cow<'p, str>>) -> Self {
        self.then(Step::Key(key.into()))
    }

    /// An element of the list at this place, counted from 0.
    pub fn element(&self, position: usize) -> Self {
        self.then(Step::Element(position))
    }

    /// The last key itself instead of its value.
    pub fn name(&self) -> Self {
        Self { marks_key: true, ..self.clone() }
    }

    fn then(&self, step: Step<'p>) -> Self {
        let mut steps = self.steps.clone();
        steps.push(step);
        Self { steps, marks_key: false }
    }

    /// The key at the file's root with which the path begins, or an empty text.
    pub fn section(&self) -> &str {
        match self.steps.first() {
            Some(Step::Key(key)) => key,
            _ => "",
        }
    }

    /// Finds the byte range at the end of the path in the parsed file. A table under a key is marked at the key. If the
    /// path leaves the file, the range is that of the last step inside it.
    pub fn find(&self, root: &DeTable) -> TextSpan {
        let mut found = 0..0;
        let mut table = Some(root);
        let mut list = None;
        for (position, step) in self.steps.iter().enumerate() {
            let (key, value) = match step {
                Step::Key(key) => match table.and_then(|table| table.get_key_value(key.as_ref())) {
                    Some((key, value)) => (Some(key.span()), value),
                    None => break,
                },
                Step::Element(at) => {
                    match list.and_then(|list: &toml::de::DeArray| list.get(*at)) {
                        Some(value) => (None, value),
                        None => break,
                    }
                }
            };
            table = value.get_ref().as_table();
            list = value.get_ref().as_array();
            let is_last = position + 1 == self.steps.len();
            let at_key = table.is_some() || (is_last && self.marks_key);
            found = key.filter(|_| at_key).unwrap_or_else(|| value.span());
        }
        found
    }
}

impl fmt::Display for KeyPath<'_> {
    /// The keys separated by dots, without list positions.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let keys = self.steps.iter().filter_map(|step| match step {
            Step::Key(key) => Some(key.as_ref()),
            Step::Element(_) => None,
        });
        write!(out, "{}", keys.collect::<Vec<_>>().join("."))
    }
}

/// A whole number of any size as the nearest `f64`; infinite beyond its range.
fn rounded_integer(integer: &DeInteger) -> f64 {
    let digits = integer.as_str();
    if let Ok(value) = i64::from_str_radix(digits, integer.radix()) {
        return value as f64;
    }
    let radix = integer.radix();
    let add = |sum: f64, digit: u32| sum * f64::from(radix) + f64::from(digit);
    let by_digit = || digits.chars().filter_map(|c| c.to_digit(radix)).fold(0.0, add);
    digits.parse().unwrap_or_else(|_| by_digit())
}

/// The plain form of a parsed value. An integer beyond 64 bits becomes a float, so that the rest of the file stays
/// readable.
pub(crate) fn plain_value(value: &DeValue) -> toml::Value {
    use toml::Value;
    match value {
        DeValue::String(text) => Value::String(text.to_string()),
        DeValue::Integer(integer) => {
            let whole = i64::from_str_radix(integer.as_str(), integer.radix());
            whole.map_or_else(|_| Value::Float(rounded_integer(integer)), Value::Integer)
        }
        DeValue::Float(number) => Value::Float(number.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(flag) => Value::Boolean(*flag),
        DeValue::Datetime(moment) => Value::Datetime(*moment),
        DeValue::Array(list) => {
            Value::Array(list.iter().map(|one| plain_value(one.get_ref())).collect())
        }
        DeValue::Table(table) => Value::Table(plain_table(table)),
    }
}

/// The plain form of a parsed table.
pub fn plain_table(table: &DeTable) -> toml::Table {
    let all = table.iter();
    all.map(|(key, value)| (key.get_ref().to_string(), plain_value(value.get_ref()))).collect()
}

/// The type of a value, in words.
pub(crate) fn type_name(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}

impl<'a> Entry<'a> {
    /// An element of a list, under the list's key.
    pub fn element(key: &'a str, value: &'a Spanned<DeValue<'a>>) -> Self {
        Self { key, at: value.span(), value }
    }

    /// Byte range of the value.
    pub fn value_at(&self) -> TextSpan {
        self.value.span()
    }

    /// The mistake that another type is needed.
    pub fn wrong_type(&self, wanted: &'static str) -> TomlMistake {
        let found = type_name(self.value.get_ref());
        TomlMistake::WrongType { key: self.key.into(), wanted, found }
    }

    /// The value as a text.
    ///
    /// # Errors
    /// [`TomlMistake::WrongType`] for another type.
    pub fn text(&self) -> Result<&'a str, TomlMistake> {
        match self.value.get_ref() {
            DeValue::String(text) => Ok(text),
            _ => Err(self.wrong_type("a text in quotes")),
        }
    }

    /// The value as a finite number.
    ///
    /// # Errors
    /// [`TomlMistake::WrongType`] for another type, [`TomlMistake::NotFinite`] for an infinite number or NaN.
    pub fn number(&self) -> Result<f64, TomlMistake> {
        let value = match self.value.get_ref() {
            DeValue::Float(value) => value.as_str().parse().ok(),
            DeValue::Integer(value) => Some(rounded_integer(value)),
            _ => return Err(self.wrong_type("a number")),
        };
        let finite = value.filter(|value: &f64| value.is_finite());
        finite.ok_or_else(|| TomlMistake::NotFinite { key: self.key.into() })
    }

    /// The value as a table.
    ///
    /// # Errors
    /// [`TomlMistake::WrongType`] for another type.
    pub fn table(&self) -> Result<&'a DeTable<'a>, TomlMistake> {
        match self.value.get_ref() {
            DeValue::Table(table) => Ok(table),
            _ => Err(self.wrong_type("a table")),
        }
    }

    /// The value as a list.
    ///
    /// # Errors
    /// [`TomlMistake::WrongType`] for another type.
    pub fn list(&self) -> Result<&'a [Spanned<DeValue<'a>>], TomlMistake> {
        match self.value.get_ref() {
            DeValue::Array(list) => Ok(list),
            _ => Err(self.wrong_type("a list")),
        }
    }
}
