//! Display units: an actuator's travel in millimeters, an aircraft's altitude in meters.

use servotwin_model::network::Network;
use servotwin_model::spec::Unit;

/// An input with a range of at least this, SI, is not an actuator's travel or speed.
const FAR: f64 = 100.0;

/// The display unit of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    unit: Unit,
    /// Whether the value is displayed in the SI unit.
    is_far: bool,
}

impl Shown {
    /// The display unit for values up to `largest`, SI.
    pub fn of(unit: Unit, largest: f64) -> Self {
        let is_far = match unit {
            Unit::Metre | Unit::MetrePerSecond => largest.abs() >= 1.0,
            Unit::SquareMetre => largest.abs() >= 0.1,
            _ => false,
        };
        Self { unit, is_far }
    }

    /// The display unit of a network's external input, whatever its values are.
    pub fn of_input(network: &Network, input: usize) -> Self {
        let unit = network.inputs[input].unit;
        let (_, most) = network.input_range(input);
        let is_way = matches!(unit, Unit::Metre | Unit::MetrePerSecond);
        let is_far = is_way && most.is_finite() && most >= FAR;
        Self { unit, is_far }
    }

    /// Symbol of the display unit.
    pub fn symbol(self) -> &'static str {
        if self.is_far { self.unit.symbol() } else { self.unit.shown() }
    }

    /// Converts an SI value to the display unit.
    pub fn value(self, si: f64) -> f64 {
        if self.is_far { si } else { self.unit.to_shown(si) }
    }
}

/// A number with `digits` significant digits and no needless zeros.
pub fn number(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let size = value.abs();
    if !value.is_finite() || !(1e-4..1e7).contains(&size) {
        let text = format!("{value:.*e}", digits - 1);
        let Some((mantissa, exponent)) = text.split_once('e') else {
            return text;
        };
        return format!("{}e{exponent}", without_zeros(mantissa));
    }
    let before = size.log10().floor() as i64;
    let decimals = (digits as i64 - 1 - before).max(0) as usize;
    without_zeros(&format!("{value:.decimals$}")).to_string()
}

fn without_zeros(text: &str) -> &str {
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => text,
    }
}

/// An SI value as text in its display unit.
pub fn shown(si: f64, unit: Unit) -> String {
    let (text, unit) = number_and_unit(si, unit);
    if unit.is_empty() { text } else { format!("{text} {unit}") }
}

/// The number in the display unit as text, and the unit's symbol.
pub(crate) fn number_and_unit(si: f64, unit: Unit) -> (String, &'static str) {
    let shown = Shown::of(unit, si);
    (number(shown.value(si), 5), shown.symbol())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rams_move_in_millimetres() {
        assert_eq!(
            (Shown::of(Unit::Metre, 0.02).symbol(), Shown::of(Unit::Metre, -3.0).symbol()),
            ("mm", "m")
        );
        assert_eq!(Shown::of(Unit::Pascal, 2e7).symbol(), "bar");
    }

    #[test]
    fn numbers_are_short_and_keep_their_digits() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-1234.5678, "-1234.6"),
            (206.84, "206.84"),
            (0.001_234_56, "0.0012346"),
            (2.0e-14, "2e-14"),
            (1.23456e9, "1.2346e9"),
            (99999.96, "100000"),
            (f64::NAN, "NaN"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value, 5), text);
        }
    }
}
