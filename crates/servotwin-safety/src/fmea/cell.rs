//! A cell of the sheet: a text and its evidence.

use servotwin::text::number;
use servotwin_learning::metrics::Rate;

/// A cell with evidence, or the one that says what is missing.
pub(crate) type Filled = Result<FmeaCell, FmeaCell>;

/// A cell of the sheet.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FmeaCell {
    /// The text; empty where only a person or a table of the user can fill it.
    pub(crate) text: String,
    /// The file and row, run or figure behind it. Empty if the text is.
    pub(crate) evidence: String,
    /// Whether the cell has no evidence: its text says what is missing.
    pub(crate) is_missing: bool,
}

impl FmeaCell {
    /// A filled cell.
    pub fn new(text: impl Into<String>, evidence: impl Into<String>) -> Self {
        FmeaCell { text: text.into(), evidence: evidence.into(), is_missing: false }
    }

    /// A cell without evidence: what is missing, and what would fill it.
    pub fn missing(what: &str, remedy: impl Into<String>) -> Self {
        FmeaCell { text: what.into(), evidence: remedy.into(), is_missing: true }
    }
}

/// A share with its count and its 95 % interval.
pub(crate) fn rate_in_words(rate: &Rate) -> String {
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    match rate.share {
        None => "no run".into(),
        Some(share) => format!(
            "{} of {}: {} % ({} … {} %)",
            rate.count,
            rate.of,
            percent(share),
            percent(rate.low),
            percent(rate.high)
        ),
    }
}

/// The smallest and the largest of some numbers in one text, with a unit.
pub(crate) fn span_in_words(values: impl Iterator<Item = f64>, unit: &str) -> Option<String> {
    let mut ends: Option<(f64, f64)> = None;
    for value in values.filter(|value| value.is_finite()) {
        let (low, high) = ends.unwrap_or((value, value));
        ends = Some((low.min(value), high.max(value)));
    }
    let (low, high) = ends?;
    let [low, high] = [low, high].map(|end| number(end, 3));
    Some(if low == high { format!("{low} {unit}") } else { format!("{low} … {high} {unit}") })
}
