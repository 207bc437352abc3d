//! Units as people write them.

use servotwin_model::spec::Unit;
use servotwin_system::units::{exactly, find, within};
use std::f64::consts::PI;

#[test]
fn large_and_small_letters_are_alike_but_where_both_are_units() {
    let of = |text: &str| find(text).map(|row| (row.symbol, row.unit));
    assert_eq!(of("l/min"), Some(("L/min", Unit::CubicMetrePerSecond)));
    assert_eq!(of("degC"), Some(("°C", Unit::Kelvin)));
    assert_eq!(of("Degrees"), Some(("deg", Unit::Radian)));
    assert_eq!(of("kN m"), Some(("kN m", Unit::NewtonMetre)));
    assert_eq!(of("kn_m"), Some(("kN/m", Unit::NewtonPerMetre)));
    assert_eq!(of("rad_s"), Some(("rad/s", Unit::RadianPerSecond)));
    assert_eq!(exactly("rad/s").unwrap().to(Unit::Hertz), Some((0.5 / PI, 0.0)));
    assert_eq!((exactly("mPa"), exactly("kn")), (None, None));
    assert_eq!(of("furlong"), None);
}

#[test]
fn gauge_pressures_have_their_zero_at_the_atmosphere_however_they_are_spelled() {
    let pa = |text: &str, value: f64| {
        let (factor, offset) = find(text).unwrap_or_else(|| panic!("{text}")).to(Unit::Pascal)?;
        Some((value * factor + offset).round())
    };
    for text in
        ["barg", "bar(g)", "bar (g)", "BARG", "bar_g", "bar gauge", "barG", "bar rel", "barü"]
    {
        assert_eq!(pa(text, 0.0), Some(101_325.0), "{text}");
        assert_eq!(pa(text, 209.0), Some(21_001_325.0), "{text}");
    }
    for text in ["bara", "bar(a)", "bar abs", "bar_a", "bar absolute"] {
        assert_eq!(pa(text, 210.0), Some(21e6), "{text}");
    }
    assert_eq!(pa("psig", 3000.0), Some(20_785_597.0));
    assert_eq!(pa("psia", 3000.0), Some(20_684_272.0));
    assert_eq!(pa("kgf/cm²", 1.0), pa("kg/cm2", 1.0));
    assert_eq!(pa("kgf/cm2 (g)", 0.0), Some(101_325.0));
    assert_eq!(pa("N/mm²", 21.0), Some(21e6));
    assert_eq!(pa("MPa(g)", 1.0), Some(1_101_325.0));
    assert_eq!(
        find("°F").unwrap().to(Unit::Kelvin).map(|(f, o)| (32.0 * f + o).round()),
        Some(273.0)
    );
    assert_eq!(find("bar (furlong)"), None);
    for text in ["a", "g", "(g)", "p_a", "rel", "abs"] {
        assert!(find(text).is_none_or(|row| row.unit != Unit::Pascal), "{text}");
    }
}

#[test]
fn a_value_outside_of_its_range_is_in_the_unit_in_which_it_is_inside() {
    let named = |unit, value, range| within(unit, value, range).map(|(_, unit)| unit);
    assert_eq!(named(Unit::Metre, -37.5, (-0.1, 0.07)), Some("mm"));
    assert_eq!(named(Unit::Pascal, 210.0, (150e5, 280e5)), Some("bar"));
    assert_eq!(named(Unit::Radian, 12.0, (-0.3, 0.3)), Some("degrees"));
    assert_eq!(named(Unit::Metre, 1e12, (-0.1, 0.1)), None);
}
