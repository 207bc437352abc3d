//! Units as people write them.

use servotwin::units::{NamedUnit, exactly, find, misread, misreadings, within};
use servotwin_model::spec::Unit;
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
    let named =
        |unit, value, range| within(NamedUnit::of_si(unit), value, range).map(|unit| unit.spoken);
    assert_eq!(named(Unit::Metre, -37.5, (-0.1, 0.07)), Some("mm"));
    assert_eq!(named(Unit::Pascal, 210.0, (150e5, 280e5)), Some("bar"));
    assert_eq!(named(Unit::Radian, 12.0, (-0.3, 0.3)), Some("degrees"));
    assert_eq!(named(Unit::Metre, 1e12, (-0.1, 0.1)), None);
    // 37.5 m that were read as mm.
    let in_mm = within(exactly("mm").unwrap(), 37.5e-3, (1.0, 100.0)).unwrap();
    assert_eq!(in_mm.symbol, "m");
}

#[test]
fn a_ratio_names_the_unit_that_was_misread_unless_a_faulty_sensor_may_show_it() {
    let named = |declared: &str, ratio: f64| {
        let found = misread(exactly(declared).unwrap(), ratio)?;
        Some((found.actual[0].symbol, found.read_as.symbol))
    };
    assert_eq!(named("m", 1000.0), Some(("mm", "m")));
    assert_eq!(named("mm", 0.0394), Some(("in", "mm")));
    assert_eq!(named("cm", 1.0 / 2.54), Some(("in", "cm")));
    assert_eq!(named("m", 0.0394), Some(("in", "mm")), "a conversion before the log");
    assert_eq!(named("rad", 57.0), Some(("deg", "rad")));
    assert_eq!(named("deg", 1.0 / 57.0), Some(("rad", "deg")));
    assert_eq!(named("psi", 0.07), Some(("bar", "psi")));
    assert_eq!(named("Pa", 1.45e-4), Some(("psi", "Pa")));
    for ratio in [0.45, 0.5, 0.8, 1.0, 1.02, 1.5, 2.2] {
        for declared in ["m", "mm", "deg", "bar", "psi"] {
            assert_eq!(named(declared, ratio), None, "{declared} {ratio}");
        }
    }
    // A pressure in bar is one in kgf/cm² as far as a twin can say.
    let same = misread(exactly("MPa").unwrap(), 10.0).unwrap().actual;
    assert!(same.iter().any(|unit| unit.symbol == "kgf/cm2"), "{same:?}");
    let factors =
        misreadings(exactly("rad").unwrap()).iter().map(|m| m.factor()).collect::<Vec<_>>();
    assert!(factors.len() > 3 && (factors[0] / (PI / 180.0) - 1.0).abs() < 1e-12, "{factors:?}");
}
