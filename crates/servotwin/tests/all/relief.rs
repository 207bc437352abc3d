//! The aileron's relief valves, beside an aileron whose relief valves never open.

use servotwin::ensemble::{Ensemble, Variant};
use servotwin::signal::Signal;
use servotwin::system::System;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;

const BAR: f64 = 1e5;
const DURATION_S: f64 = 20.0;

/// The aileron, and the aileron whose relief valves never open.
fn with_and_without() -> [System; 2] {
    let text = include_str!("../../../../systems/aileron_dual.toml");
    let shut = text.replace("set_pa = 21.994e6", "set_pa = 99e6");
    assert_eq!(text.matches("set_pa = 21.994e6").count(), 2);
    [text, &shut]
        .map(|text| System::parse(text, "aileron.toml").unwrap_or_else(|error| panic!("{error}")))
}

/// The paper's S2 at full load, with faults at their full intensity: samples of what is recorded.
fn fly(system: &System, record: &[&str], faults: &[&str]) -> Vec<Vec<f64>> {
    let program = &system.program;
    let command: Signal = "noise:rms=5deg,bandwidth=1Hz,seed=2".parse().unwrap();
    let inputs = &system.network().inputs;
    let constant = |input: &servotwin_model::network::ExternalInput| {
        Piecewise::constant(input.default).unwrap()
    };
    let mut signals: Vec<Piecewise> = inputs.iter().map(constant).collect();
    let place = inputs.iter().position(|input| input.id == "command").unwrap();
    signals[place] = command.build(inputs[place].unit, DURATION_S).unwrap();
    let fault = |id: &&str| {
        let (component, fault) = program.find_fault(id).unwrap_or_else(|| panic!("{id}"));
        FaultAt { component, fault, intensity: 1.0 }
    };
    let variant = Variant {
        faults: faults.iter().map(fault).collect(),
        inputs: signals.iter().collect(),
        ..Variant::default()
    };
    let mut ensemble = Ensemble::new(program);
    ensemble.duration_s = DURATION_S;
    let slot = |id: &&str| program.observable(id).unwrap_or_else(|| panic!("{id}")).slot;
    ensemble.record = record.iter().map(slot).collect();
    ensemble.run_one(&variant).unwrap_or_else(|failure| panic!("{failure:?}")).0
}

fn highest(samples: &[f64]) -> f64 {
    samples.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// The chambers of both actuators.
const CHAMBERS: [&str; 4] = [
    "actuator_1.cylinder.pressure_a_pa",
    "actuator_1.cylinder.pressure_b_pa",
    "actuator_2.cylinder.pressure_a_pa",
    "actuator_2.cylinder.pressure_b_pa",
];

/// The drop at which the valves begin to open, and are open; and the return line's pressure.
fn set_open_and_return_pa(system: &System) -> [f64; 3] {
    let value = |id: &str| {
        let (component, parameter) = system.parameter(id).unwrap_or_else(|| panic!("{id}"));
        system.network().components[component].parameters[parameter]
    };
    let (set, range) = (value("actuator_1.relief_a.set_pa"), value("actuator_1.relief_a.range_pa"));
    [set, set + range, value("actuator_1.tank.pressure_pa")]
}

#[test]
fn in_healthy_flight_the_valves_are_shut() {
    let [relieved, plain] = with_and_without();
    let ids: Vec<&str> = plain.sensors.iter().map(|sensor| &*sensor.signal).collect();
    let [set_pa, _, return_pa] = set_open_and_return_pa(&relieved);
    for chamber in fly(&relieved, &CHAMBERS, &[]) {
        assert!(highest(&chamber) < set_pa + return_pa, "{}", highest(&chamber) / BAR);
    }
    // What does not flow changes nothing: the solvers' steps are the same, sums are formed in another order.
    let (without, with) = (fly(&plain, &ids, &[]), fly(&relieved, &ids, &[]));
    for ((sensor, one), other) in plain.sensors.iter().zip(&without).zip(&with) {
        let difference = one.iter().zip(other).map(|(a, b)| (a - b).abs() / sensor.scale);
        let worst = difference.fold(0.0, f64::max);
        assert!(worst < 1e-9, "{}: {worst:.1e}", sensor.id);
    }
}

#[test]
fn behind_a_clogged_edge_a_relief_valve_holds_the_pressure() {
    let [relieved, plain] = with_and_without();
    let [set_pa, open_pa, return_pa] = set_open_and_return_pa(&relieved);
    for (fault, chamber, without_bar) in [
        ("actuator_1.servo_valve.clogging_at", CHAMBERS[0], 400.0),
        ("actuator_1.servo_valve.clogging_bt", CHAMBERS[1], 400.0),
        // The return line's pressure also takes the pilot stage its drop: the spool slows down, and the ram with it.
        ("actuator_1.tank_valve.stuck", CHAMBERS[0], 250.0),
    ] {
        let [without_pa, with_pa] =
            [&plain, &relieved].map(|system| highest(&fly(system, &[chamber], &[fault])[0]));
        println!("{fault}: {:.0} bar, with valves {:.0} bar", without_pa / BAR, with_pa / BAR);
        // Nothing but the other actuator's strength bounds it without them.
        assert!(without_pa > without_bar * BAR, "{fault}: {without_pa}");
        assert!(with_pa > set_pa + return_pa, "{fault}: the valve opens");
        assert!(with_pa < open_pa + return_pa, "{fault}: and need not open fully: {with_pa}");
    }
    // A worn spring protects at a lower pressure, from the same fault.
    let worn = ["actuator_1.servo_valve.clogging_at", "actuator_1.relief_a.set_pressure_loss"];
    let [new_pa, worn_pa] =
        [&worn[..1], &worn].map(|faults| highest(&fly(&relieved, &CHAMBERS[..1], faults)[0]));
    assert!(worn_pa < new_pa - 20.0 * BAR, "{worn_pa} {new_pa}");
}
