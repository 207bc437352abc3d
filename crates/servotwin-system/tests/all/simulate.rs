//! Simulations by names: inputs within their ranges, what begins at time zero, and what leaves the model.

use servotwin_system::simulate::{InputSignal, Simulation};
use servotwin_system::system::System;
use servotwin_system::validity::CrossedLimit;

#[test]
fn every_kind_of_input_is_held_to_the_range_of_its_input() {
    let system = System::default();
    let inputs = &system.network().inputs;
    let of_supply = inputs.iter().position(|input| input.id.contains("supply_pressure")).unwrap();
    let (id, (_, most)) = (inputs[of_supply].id.clone(), system.network().input_range(of_supply));
    let refused = |signal: InputSignal| {
        let run = Simulation::new(&system).input(&id, signal).duration_s(0.1).run();
        run.err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert!(most.is_finite());
    let mut samples = vec![2e7; 11];
    assert_eq!(refused(samples.clone().into()), "");
    samples[5] = 2.0 * most;
    for signal in [InputSignal::from(2.0 * most), samples.into(), (-1.0).into()] {
        let error = refused(signal);
        assert!(error.starts_with(&id) && error.contains("bar"), "{error}");
    }
}

#[test]
fn a_step_and_a_fault_at_time_zero_begin_at_the_rest_before_them() {
    let system = System::read("spring_actuator").unwrap();
    let base = || Simulation::new(&system).duration_s(0.5).record(["cylinder.position_m"]);
    let position = |simulation: Simulation| simulation.run().unwrap().runs[0].values[0].clone();
    let late = position(base().input("command", "step:size=5deg,at=0.01s"));
    for at in ["0s", "1ns", "1us"] {
        let early = position(base().input("command", format!("step:size=5deg,at={at}")));
        assert!(early[0].abs() < 1e-6, "{at}: {}", early[0]);
        for (early, late) in early.iter().zip(&late[1..]) {
            assert!((early - late).abs() < 1e-5, "{at}: {early} {late}");
        }
    }
    let fault = system.all_faults().into_iter().find(|id| id.contains("bias_positive")).unwrap();
    let begins = position(base().fault_from(&fault, 1.0, 0.0));
    let has = position(base().fault(&fault, 1.0));
    assert!(begins[0].abs() < 1e-6 && has[0].abs() > 1e-4, "{} {}", begins[0], has[0]);
    assert!((begins[50] - has[50]).abs() < 1e-5);
}

#[test]
fn a_piston_behind_a_soft_end_stop_is_reported() {
    let system = System::read("press_axis").unwrap();
    let pushed = |stiffness_n_m: f64| {
        let base = Simulation::new(&system).duration_s(0.05);
        let stop = base.parameter("cylinder.stop_stiffness_n_m", stiffness_n_m);
        let mut run = stop.parameter("valve.null_bias", 2.0).run().unwrap().runs.remove(0);
        run.outside_validity.retain(|finding| finding.limit == CrossedLimit::Travel);
        run.outside_validity
    };
    assert_eq!(pushed(2e8), []);
    let found = pushed(1e5);
    assert_eq!(found.len(), 1);
    assert!(found[0].extreme > 0.2, "{:?}", found[0]);
    assert!(found[0].to_string().starts_with("cylinder.position_m is outside of the cylinder"));
}
