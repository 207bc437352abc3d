//! Units for a model description: exponents of SI base units, and what people read.

use servotwin::shown::Shown;
use servotwin_model::spec::Unit;
use std::fmt::Write;

/// Exponents of the base units of a symbol such as `m³/(s Pa)`; `None` if it has a part that is no SI unit.
fn exponents(symbol: &str) -> Option<[i32; 5]> {
    let mut all = [0; 5];
    let (above, below) = symbol.split_once('/').unwrap_or((symbol, ""));
    for (part, sign) in [(above, 1), (below, -1)] {
        for factor in part.trim_matches(['(', ')']).split_whitespace().filter(|f| *f != "1") {
            let name = factor.trim_end_matches(['²', '³', '⁶']);
            let power = match &factor[name.len()..] {
                "²" => 2,
                "³" => 3,
                "⁶" => 6,
                _ => 1,
            };
            for (total, exponent) in all.iter_mut().zip(of_factor(name)?) {
                *total += sign * power * exponent;
            }
        }
    }
    Some(all)
}

/// Exponents of kg, m, s, K and A.
fn of_factor(name: &str) -> Option<[i32; 5]> {
    Some(match name {
        "kg" => [1, 0, 0, 0, 0],
        "m" => [0, 1, 0, 0, 0],
        "s" => [0, 0, 1, 0, 0],
        "K" => [0, 0, 0, 1, 0],
        "A" => [0, 0, 0, 0, 1],
        "N" => [1, 1, -2, 0, 0],
        "Pa" => [1, -1, -2, 0, 0],
        "Hz" => [0, 0, -1, 0, 0],
        "rad" => [0; 5],
        _ => return None,
    })
}

/// The element of a unit; `None` for a pure number. Both versions of FMI spell it alike.
pub(super) fn element(unit: Unit) -> Option<String> {
    let symbol = unit.symbol();
    if symbol.is_empty() {
        return None;
    }
    let mut text = format!("    <Unit name=\"{symbol}\">\n");
    if let Some(exponents) = exponents(symbol) {
        text += "      <BaseUnit";
        for (name, exponent) in ["kg", "m", "s", "K", "A"].iter().zip(exponents) {
            if exponent != 0 {
                let _ = write!(text, " {name}=\"{exponent}\"");
            }
        }
        // An angle is a pure number, as the base unit states.
        text += if symbol.contains("rad") { " rad=\"1\"/>\n" } else { "/>\n" };
    }
    let (shown, factor, offset) = (unit.shown(), unit.difference_to_shown(1.0), unit.to_shown(0.0));
    if shown != symbol {
        let _ = write!(text, "      <DisplayUnit name=\"{shown}\" factor=\"{factor:e}\"");
        if offset != 0.0 {
            let _ = write!(text, " offset=\"{offset}\"");
        }
        text += "/>\n";
    }
    Some(text + "    </Unit>\n")
}

/// The name of the unit that people read values up to `largest` in, where it is another one.
pub(super) fn display(unit: Unit, largest: f64) -> Option<&'static str> {
    Some(Shown::of(unit, largest).symbol()).filter(|shown| *shown != unit.symbol())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_made_of_base_units() {
        for unit in Unit::ALL {
            assert!(exponents(unit.symbol()).is_some(), "{unit:?}: {}", unit.symbol());
        }
        assert_eq!(exponents("m³/(s Pa)"), Some([-1, 4, 1, 0, 0]));
        assert_eq!(exponents("N s/m"), Some([1, 0, -1, 0, 0]));
        assert!(element(Unit::Kelvin).is_some_and(|text| text.contains("offset=\"-273.15\"")));
    }
}
