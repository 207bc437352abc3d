//! Tests of properties that every kind of signal has.

use super::spec::Fallback;
use super::*;
use servotwin_model::signal::Smoothness;

const DURATION_S: f64 = 5.0;

fn examples() -> impl Iterator<Item = (&'static Kind, Signal, Piecewise)> {
    // A recorded signal needs a file and is tested elsewhere.
    ALL.iter().filter(|kind| kind.name != "table").map(|kind| {
        let signal: Signal = kind.example.parse().expect("the example is valid");
        let curve = signal.build(Unit::Radian, DURATION_S).expect("the example is possible");
        (*kind, signal, curve)
    })
}

#[test]
fn the_example_is_of_its_kind_and_its_text_comes_back() {
    for (spec, signal, _) in examples() {
        assert_eq!(signal.terms()[0].kind.name, spec.name);
        assert_eq!(signal.to_string(), spec.example);
        assert_eq!(spec.example.parse::<Signal>().unwrap(), signal);
    }
}

#[test]
fn only_a_step_jumps() {
    for (spec, _, curve) in examples() {
        let jump = (0..curve.breaks_s().len()).any(|k| curve.smoothness(k) == Smoothness::Jump);
        assert_eq!(jump, spec.name == "step", "{}", spec.name);
    }
}

#[test]
fn pieces_reach_the_end_and_breaks_begin_at_zero_or_before() {
    for (spec, _, curve) in examples() {
        assert!(curve.breaks_s()[0] <= 0.0, "{}", spec.name);
        assert!(curve.value(DURATION_S).is_finite(), "{}", spec.name);
    }
}

#[test]
fn a_longer_run_does_not_change_the_beginning() {
    // A sweep extends over the run unless its length is given.
    for (spec, signal, short) in examples().filter(|(spec, ..)| spec.name != "sweep") {
        let long = signal.build(Unit::Radian, 2.0 * DURATION_S).unwrap();
        for i in 0..500 {
            let t = 0.01 * f64::from(i);
            assert_eq!(short.value(t).to_bits(), long.value(t).to_bits(), "{}", spec.name);
        }
    }
}

#[test]
fn the_same_text_gives_the_same_bits() {
    for (_, signal, curve) in examples() {
        assert_eq!(signal.build(Unit::Radian, DURATION_S).unwrap(), curve);
    }
}

#[test]
fn declarations_are_complete() {
    for spec in ALL {
        assert_eq!(find(spec.name).unwrap().example, spec.example, "names are unique");
        for (place, parameter) in spec.parameters.iter().enumerate() {
            assert_eq!(spec.parameter(parameter.name), Some(place), "names are unique");
            assert!(!parameter.summary.is_empty());
            let choice = matches!(parameter.sort, Sort::Choice(_));
            assert!(!choice || matches!(parameter.fallback, Fallback::Word(_)));
            if let (Sort::Choice(words), Fallback::Word(word)) =
                (parameter.sort, parameter.fallback)
            {
                assert!(words.contains(&word));
            }
        }
        assert!(help().contains(spec.example));
    }
}
