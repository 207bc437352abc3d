//! Hand-written TOML files: values with their places, and mistakes shown at their places.
//!
//! A reader walks through the [`Entry`]s of a file, collects every mistake in a [`Collector`] and continues. At the end
//! the mistakes are sorted by place and shown as
//!
//! ```text
//! systems/x.toml:7:1: unknown kind of component 'orifise'
//!    |
//!  7 | kind = "orifise"
//!    |        ^^^^^^^^^
//!    = nearest: 'orifice'
//! ```

use crate::files::FileError;
use crate::nearest::nearest;
use crate::sanitize;
use std::fmt;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeInteger, DeTable, DeValue};

/// A range of bytes in the text.
pub type TextSpan = Range<usize>;

/// Longer lists of known names are left out of messages.
const MAX_LISTED: usize = 50;

/// The known name nearest to a word, or all of them if none is near and they are few.
fn suggest<'n>(word: &str, known: impl IntoIterator<Item = &'n str>) -> Option<String> {
    let known: Vec<&str> = known.into_iter().collect();
    match nearest(word, known.iter().copied()) {
        Some(name) => Some(format!("nearest: '{name}'")),
        None if known.is_empty() || known.len() > MAX_LISTED => None,
        None => Some(format!("known: {}", known.join(", "))),
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

/// A mistake in a file. Its place is known after [`Collector::locate`].
#[derive(Clone, Debug, Default, PartialEq)]
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
    /// A mistake, in one line.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), ..Self::default() }
    }

    /// The same with advice.
    #[must_use]
    pub fn with_help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }

    /// A mistake about a word, with the known ones that are near.
    pub fn unknown<'n>(
        message: impl Into<String>,
        word: &str,
        known: impl IntoIterator<Item = &'n str>,
    ) -> Self {
        Self { help: suggest(word, known), ..Self::new(message) }
    }

    /// A key that its table does not have.
    pub fn unknown_key<'n>(
        key: &str,
        place: &str,
        known: impl IntoIterator<Item = &'n str>,
    ) -> Self {
        Self::unknown(format!("unknown key '{key}' in {place}"), key, known)
    }

    /// A required key that is missing, and how to write it.
    pub fn missing(place: &str, key: &str, write: impl fmt::Display) -> Self {
        Self::new(format!("{place} lacks '{key}'")).with_help(format!("write: {write}"))
    }

    /// A number outside its range, in SI; `summary` explains its meaning.
    pub fn out_of_range(
        key: &str,
        value: f64,
        (min, max): (f64, f64),
        unit: &str,
        summary: &str,
    ) -> Self {
        let (value, allowed) = (NumberWithUnit(value, unit), Quantities(min, max, unit));
        let message = format!("{key} = {value} is out of range: allowed are {allowed}");
        let help = Some(format!("{key}: {summary}"));
        Self { help, range: Some((min, max)), ..Self::new(message) }
    }

    /// A value outside what words allow.
    pub fn not_allowed(key: &str, value: impl fmt::Display, allowed: impl Into<String>) -> Self {
        let allowed = allowed.into();
        let message = format!("{key} = {value} is out of range: allowed are {allowed}");
        Self { allowed: Some(allowed), ..Self::new(message) }
    }

    /// The mistake at its place; `breaks` are the byte positions of all line ends.
    fn at(self, text: &str, breaks: &[usize], span: &TextSpan) -> Self {
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
            message: sanitize::clip(self.message),
            help: self.help.map(sanitize::clip),
            ..self
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

/// Why a file that a person writes cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TomlError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file has mistakes.
    #[error(fmt = write_mistakes)]
    Mistakes {
        /// The path of the file as the caller gave it.
        path: String,
        /// All mistakes, in the order of the file.
        mistakes: Vec<Diagnostic>,
    },
}

/// Writes the first mistakes of a file and their total number.
fn write_mistakes(
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
#[derive(Clone, Debug, Default)]
pub struct Collector {
    found: Vec<(TextSpan, Diagnostic)>,
}

impl Collector {
    /// Adds a mistake; the same one at the same place only once.
    pub fn note(&mut self, span: &TextSpan, mistake: Diagnostic) {
        let is_same = |(at, known): &(TextSpan, Diagnostic)| at == span && *known == mistake;
        if !self.is_full() && !self.found.iter().any(is_same) {
            self.found.push((span.clone(), mistake));
        }
    }

    /// The number of mistakes.
    pub fn count(&self) -> usize {
        self.found.len()
    }

    /// Whether further mistakes are dropped.
    pub fn is_full(&self) -> bool {
        self.found.len() == MAX_FOUND
    }

    /// Whether a place has a mistake.
    pub fn knows(&self, span: &TextSpan) -> bool {
        self.found.iter().any(|(at, _)| at == span)
    }

    /// Whether there are no mistakes.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// The error for a file with these mistakes.
    pub fn refuse(self, path: impl Into<String>, text: &str) -> TomlError {
        TomlError::Mistakes { path: path.into(), mistakes: self.locate(text) }
    }

    /// Returns all mistakes in the order of the file.
    pub fn locate(mut self, text: &str) -> Vec<Diagnostic> {
        self.found.sort_by_key(|(span, _)| span.start);
        let breaks: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).collect();
        self.found.into_iter().map(|(span, mistake)| mistake.at(text, &breaks, &span)).collect()
    }

    /// What was found under a key; notes that another type is needed if that is nothing.
    pub fn wanted<T>(&mut self, entry: &Entry, found: Option<T>, wanted: &str) -> Option<T> {
        if found.is_none() {
            let type_name = type_name(entry.value.get_ref());
            let mistake = format!("'{}' must be {wanted}, not {type_name}", entry.key);
            // The value of a section is its whole text, so its key is the better place.
            let at = if wanted == TABLE { entry.at.clone() } else { entry.value_at() };
            self.note(&at, Diagnostic::new(mistake));
        }
        found
    }

    /// The value as a text.
    pub fn text<'a>(&mut self, entry: &Entry<'a>) -> Option<&'a str> {
        self.wanted(entry, entry.text(), "a text in quotes")
    }

    /// The value as a table.
    pub fn table<'a>(&mut self, entry: &Entry<'a>) -> Option<Vec<Entry<'a>>> {
        self.wanted(entry, entry.table(), TABLE)
    }

    /// The value as a list of elements under the list's key.
    pub fn list<'a>(&mut self, entry: &Entry<'a>) -> Option<Vec<Entry<'a>>> {
        self.wanted(entry, entry.list(), "a list")
    }

    /// The value as a finite number.
    pub fn number(&mut self, entry: &Entry) -> Option<f64> {
        let number = self.wanted(entry, entry.number(), "a number")?;
        let is_finite = number.is_finite();
        if !is_finite {
            let mistake = format!("'{}' must be a finite number", entry.key);
            self.note(&entry.value_at(), Diagnostic::new(mistake));
        }
        is_finite.then_some(number)
    }
}

/// A parsed file.
pub struct TomlText<'t>(Spanned<DeTable<'t>>);

impl<'t> TomlText<'t> {
    /// Parses a text; `None` if it is not TOML or has another format, so that nothing else in it can be judged.
    pub fn parse(text: &'t str, format: u32, mistakes: &mut Collector) -> Option<Self> {
        let (root, errors) = DeTable::parse_recoverable(text);
        for error in errors.iter().take(MAX_FOUND) {
            let message = error.message().trim().replace('\n', ", ");
            let mistake = Diagnostic::new(format!("not valid TOML: {message}"));
            mistakes.note(&error.span().unwrap_or(0..0), mistake);
        }
        let all = entries(root.get_ref());
        if let Some(entry) = get(&all, "format")
            && let Some(found) = entry.number().filter(|found| *found != f64::from(format))
        {
            let mistake =
                format!("format {found} is not known: this version reads format {format}");
            mistakes.note(&entry.value_at(), Diagnostic::new(mistake));
        }
        drop(all);
        mistakes.is_empty().then_some(TomlText(root))
    }

    /// The entries of its root.
    pub fn root(&self) -> Vec<Entry<'_>> {
        entries(self.0.get_ref())
    }
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

const TABLE: &str = "a table";

/// The type of a value, in words.
fn type_name(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => TABLE,
    }
}

impl<'a> Entry<'a> {
    /// Byte range of the value.
    pub fn value_at(&self) -> TextSpan {
        self.value.span()
    }

    /// The place for messages: the key of a section, whose value is its whole text, and any other value itself.
    pub fn place(&self) -> TextSpan {
        if self.value.get_ref().is_table() { self.at.clone() } else { self.value_at() }
    }

    /// The value as a text.
    pub fn text(&self) -> Option<&'a str> {
        self.value.get_ref().as_str()
    }

    /// The value as a number, which need not be finite.
    pub fn number(&self) -> Option<f64> {
        match self.value.get_ref() {
            DeValue::Float(value) => Some(value.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Integer(value) => Some(rounded_integer(value)),
            _ => None,
        }
    }

    /// Whether the value is a whole number, written as one.
    pub fn is_whole(&self) -> bool {
        self.value.get_ref().is_integer()
    }

    /// The entries of a table in the order of the file.
    pub fn table(&self) -> Option<Vec<Entry<'a>>> {
        self.value.get_ref().as_table().map(entries)
    }

    /// The elements of a list, under its key.
    pub fn list(&self) -> Option<Vec<Entry<'a>>> {
        let element = |value: &'a Spanned<DeValue<'a>>| Entry { at: value.span(), value, ..*self };
        Some(self.value.get_ref().as_array()?.iter().map(element).collect())
    }
}

/// The entry of a key.
pub fn get<'e, 'a>(entries: &'e [Entry<'a>], key: &str) -> Option<&'e Entry<'a>> {
    entries.iter().find(|entry| entry.key == key)
}
