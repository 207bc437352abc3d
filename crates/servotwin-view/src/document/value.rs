//! Values: what people read and what programs read, made from the same number.

use super::Call;
use crate::shown::shown;
use serde::Serialize;
use serde_json::{Value as Json, json};
use servotwin_io::text::{number, spoken};
use servotwin_model::spec::Unit;
use std::path::{Path, PathBuf};

/// A value for people and for programs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Value {
    /// For people, in display units with their symbol. Further lines are remarks in small type.
    pub text: String,
    /// For programs, in SI units.
    pub json: Json,
    /// The end of the key in JSON that names the unit, e.g. `_m`.
    pub suffix: &'static str,
    /// Whether it meets its target, if it has one.
    pub call: Option<Call>,
}

/// What stands for a missing value.
pub const NONE: &str = "–";

impl Value {
    /// A text for people, and its data for programs.
    pub fn of(text: impl Into<String>, data: &impl Serialize) -> Self {
        Value { text: text.into(), json: json!(data), ..Value::default() }
    }

    /// A value that does not exist: `null` for programs.
    pub fn missing() -> Self {
        Value { text: NONE.into(), ..Value::default() }
    }

    /// A name, as words for people: `shut_down`, `shut down`.
    pub fn name(name: &str) -> Self {
        Value::of(spoken(name), &name)
    }

    /// A number and what people read instead of it.
    pub fn number(number: f64, text: impl Into<String>) -> Self {
        Value::of(text, &number)
    }

    /// A number without a unit.
    pub fn digits(value: f64, digits: usize) -> Self {
        Value::number(value, number(value, digits))
    }

    /// A time or duration, s.
    pub fn seconds(value: f64, digits: usize) -> Self {
        let text = format!("{} s", number(value, digits));
        Value { suffix: Unit::Second.suffix(), ..Value::number(value, text) }
    }

    /// An SI value in a column of several units, beside which a column for programs names the unit.
    pub fn mixed(si: f64, unit: Unit) -> Self {
        Value::number(si, shown(si, unit))
    }

    /// A difference of such values, which has no offset: kelvins are not degrees Celsius.
    pub fn difference(si: f64, unit: Unit, digits: usize) -> Self {
        let text = format!("{} {}", number(unit.difference_to_shown(si), digits), unit.shown());
        Value::number(si, text.trim_end())
    }

    /// A share in percent.
    pub fn percent(share: f64, decimals: usize) -> Self {
        Value::number(share, format!("{:.decimals$} %", 100.0 * share))
    }

    /// Several values, separated by commas.
    pub fn list<V: Into<Value>>(values: impl IntoIterator<Item = V>) -> Self {
        let values: Vec<Value> = values.into_iter().map(Into::into).collect();
        let texts: Vec<&str> = values.iter().map(|value| value.text.as_str()).collect();
        Value::of(texts.join(", "), &values.iter().map(|value| &value.json).collect::<Vec<_>>())
    }

    /// The first line of the text.
    pub(crate) fn first_line(&self) -> &str {
        self.text.lines().next().unwrap_or_default()
    }

    /// The remarks below the first line.
    pub(crate) fn below(&self) -> Vec<&str> {
        self.text.lines().skip(1).collect()
    }

    /// The text in one line.
    pub(crate) fn in_line(&self) -> String {
        match self.text.split_once('\n') {
            None => self.text.clone(),
            Some((text, below)) => format!("{text} ({})", below.replace('\n', ", ")),
        }
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Value::of(text, &text)
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Value::from(text.as_str())
    }
}

impl From<&String> for Value {
    fn from(text: &String) -> Self {
        Value::from(text.as_str())
    }
}

impl From<&Path> for Value {
    fn from(path: &Path) -> Self {
        Value::from(path.display().to_string())
    }
}

impl From<&PathBuf> for Value {
    fn from(path: &PathBuf) -> Self {
        Value::from(path.as_path())
    }
}

impl From<bool> for Value {
    fn from(flag: bool) -> Self {
        Value::of(if flag { "yes" } else { "no" }, &flag)
    }
}

impl From<u64> for Value {
    fn from(count: u64) -> Self {
        Value::of(count.to_string(), &count)
    }
}

impl From<u32> for Value {
    fn from(count: u32) -> Self {
        u64::from(count).into()
    }
}

impl From<usize> for Value {
    fn from(count: usize) -> Self {
        (count as u64).into()
    }
}

impl<V: Into<Value>> From<Option<V>> for Value {
    fn from(value: Option<V>) -> Self {
        value.map_or_else(Value::missing, Into::into)
    }
}
