//! The unit in which people read a value: what an actuator moves by in millimetres, where an aircraft flies in metres.

use servotwin_model::network::Network;
use servotwin_model::spec::Unit;

/// An input whose range goes so far is no way or speed of an actuator, SI.
const FAR: f64 = 100.0;

/// How a value of some unit is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    unit: Unit,
    /// Whether the SI unit is the one that is read.
    is_far: bool,
}

impl Shown {
    /// As values are read of which `largest` is the largest, SI.
    pub fn of(unit: Unit, largest: f64) -> Self {
        let is_far = match unit {
            Unit::Metre | Unit::MetrePerSecond => largest.abs() >= 1.0,
            Unit::SquareMetre => largest.abs() >= 0.1,
            _ => false,
        };
        Self { unit, is_far }
    }

    /// As the external input of a network is read, whatever its values are.
    pub fn of_input(network: &Network, input: usize) -> Self {
        let unit = network.inputs[input].unit;
        let (_, most) = network.input_range(input);
        let is_way = matches!(unit, Unit::Metre | Unit::MetrePerSecond);
        let is_far = is_way && most.is_finite() && most >= FAR;
        Self { unit, is_far }
    }

    /// The symbol of the unit.
    pub fn symbol(self) -> &'static str {
        if self.is_far { self.unit.symbol() } else { self.unit.shown() }
    }

    /// An SI value in that unit.
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

/// An SI value with the unit that people read.
pub fn shown(si: f64, unit: Unit) -> String {
    let (text, unit) = number_and_unit(si, unit);
    if unit.is_empty() { text } else { format!("{text} {unit}") }
}

/// A value in the unit that people read, and the unit.
pub fn number_and_unit(si: f64, unit: Unit) -> (String, &'static str) {
    let shown = Shown::of(unit, si);
    (number(shown.value(si), 5), shown.symbol())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::System;

    #[test]
    fn aircraft_fly_in_metres_and_rams_move_in_millimetres() {
        let system = System::default();
        let network = system.network();
        let of = |id: &str| {
            let place = network.inputs.iter().position(|input| input.id == id).unwrap();
            Shown::of_input(network, place)
        };
        assert_eq!((of("altitude").symbol(), of("altitude").value(3000.0)), ("m", 3000.0));
        assert_eq!((of("air_speed").symbol(), of("air_speed").value(0.5)), ("m/s", 0.5));
        assert_eq!(of("command").symbol(), "°");
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
