//! Display units: an actuator's travel in millimeters, an aircraft's altitude in meters.

use servotwin_io::text::number;
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
}
