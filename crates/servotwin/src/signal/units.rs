//! The units that a signal's text may use.

use servotwin_model::spec::Unit;

/// A unit as it is written behind a number.
#[derive(Debug, PartialEq)]
pub struct TextUnit {
    /// Symbol as written.
    pub symbol: &'static str,
    /// The corresponding SI unit.
    pub unit: Unit,
    /// Factor to SI.
    pub si: f64,
}

const fn unit(symbol: &'static str, unit: Unit, si: f64) -> TextUnit {
    TextUnit { symbol, unit, si }
}

/// Every unit that text may use.
pub static UNITS: [TextUnit; 24] = [
    unit("rad", Unit::Radian, 1.0),
    unit("deg", Unit::Radian, std::f64::consts::PI / 180.0),
    unit("mm", Unit::Metre, 1e-3),
    unit("m", Unit::Metre, 1.0),
    unit("um", Unit::Metre, 1e-6),
    unit("cm", Unit::Metre, 1e-2),
    unit("km", Unit::Metre, 1e3),
    unit("bar", Unit::Pascal, 1e5),
    unit("Pa", Unit::Pascal, 1.0),
    unit("kPa", Unit::Pascal, 1e3),
    unit("MPa", Unit::Pascal, 1e6),
    unit("psi", Unit::Pascal, 6894.757293168),
    unit("K", Unit::Kelvin, 1.0),
    unit("N", Unit::Newton, 1.0),
    unit("kN", Unit::Newton, 1e3),
    unit("A", Unit::Ampere, 1.0),
    unit("mA", Unit::Ampere, 1e-3),
    unit("Hz", Unit::Hertz, 1.0),
    unit("kHz", Unit::Hertz, 1e3),
    unit("s", Unit::Second, 1.0),
    unit("ms", Unit::Second, 1e-3),
    unit("us", Unit::Second, 1e-6),
    unit("L/min", Unit::CubicMetrePerSecond, 1e-3 / 60.0),
    unit("%", Unit::None, 1e-2),
];

/// What a parameter measures: a unit, or that unit per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measure {
    /// The unit.
    pub unit: Unit,
    /// Whether it is per second.
    pub per_second: bool,
}

impl Measure {
    /// A unit itself; speeds are lengths or angles per second.
    pub fn of(unit: Unit) -> Self {
        match unit {
            Unit::MetrePerSecond => Self { unit: Unit::Metre, per_second: true },
            Unit::RadianPerSecond => Self { unit: Unit::Radian, per_second: true },
            _ => Self { unit, per_second: false },
        }
    }

    /// The allowed unit symbols, in the order of [`UNITS`]. Empty if only plain SI numbers are possible (a rate of a
    /// rate has no text).
    pub fn allowed(self) -> Vec<String> {
        let end = if self.per_second { "/s" } else { "" };
        let units = UNITS.iter().filter(|u| u.unit == self.unit);
        units.map(|u| format!("{}{end}", u.symbol)).collect()
    }
}

/// A unit by its text, with or without `/s`.
pub(super) fn find(text: &str) -> Option<(&'static TextUnit, bool)> {
    let (symbol, per_second) = match text.strip_suffix("/s") {
        Some(symbol) => (symbol, true),
        None => (text, false),
    };
    UNITS.iter().find(|unit| unit.symbol == symbol).map(|unit| (unit, per_second))
}
