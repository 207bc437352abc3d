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
}
