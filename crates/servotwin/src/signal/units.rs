//! Units in the text of a signal.

use crate::units::{self, NamedUnit, TABLE, word};
use servotwin_model::spec::Unit;

/// What a parameter measures: a unit, or that unit per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measure {
    /// The base unit.
    pub(crate) unit: Unit,
    /// Whether it is per second.
    pub(crate) per_second: bool,
}

impl Measure {
    /// The measure of a unit; speeds become lengths or angles per second.
    pub(super) fn of(unit: Unit) -> Self {
        let (unit, per_second) = match unit {
            Unit::MetrePerSecond => (Unit::Metre, true),
            Unit::RadianPerSecond => (Unit::Radian, true),
            Unit::SquareMetrePerSecond => (Unit::SquareMetre, true),
            Unit::CubicMetrePerSecond => (Unit::CubicMetre, true),
            Unit::PerSecond => (Unit::None, true),
            unit => (unit, false),
        };
        Self { unit, per_second }
    }

    /// The measure of a unit, or of a unit per second.
    pub(super) fn per(unit: Unit, per_second: bool) -> Self {
        if per_second { Self { unit, per_second } } else { Self::of(unit) }
    }

    /// How its units are written, the most usual first.
    pub(super) fn allowed(self) -> Vec<String> {
        let own = known().filter(|row| Self::of(row.unit) == self).map(|row| row.symbol.to_owned());
        let rates = known().filter(|row| self.per_second && row.unit == self.unit);
        let mut all: Vec<String> = vec![];
        for text in rates.map(|row| format!("{}/s", row.symbol)).chain(own) {
            if !all.contains(&text) {
                all.push(text);
            }
        }
        all
    }
}

/// All units of signals. A signal is a sum, so units with an offset are excluded.
pub(super) fn known() -> impl Iterator<Item = &'static NamedUnit> {
    TABLE.iter().filter(|row| row.is_proportional() && row.symbol != word(Unit::None))
}

/// The units of usual inputs, for messages.
pub(super) fn usual() -> impl Iterator<Item = &'static NamedUnit> {
    known().filter(|row| units::is_usual(row.unit))
}

/// A unit by its text, with or without `/s`.
pub(super) fn find(text: &str) -> Option<(&'static NamedUnit, bool)> {
    let (symbol, per_second) = match text.strip_suffix("/s") {
        Some(symbol) => (symbol, true),
        None => (text, false),
    };
    let unit = units::exactly(symbol).filter(|unit| unit.is_proportional());
    unit.map(|unit| (unit, per_second))
}
