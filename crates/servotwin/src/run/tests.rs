//! Small experiments in the paper's system.

use super::twins::record_runs;
use super::*;
use crate::ensemble::{Sink, Variant};
use crate::study::{Scenario, Stream};
use std::collections::BTreeSet;
use std::sync::atomic::AtomicBool;

/// An ensemble of four samples.
fn short(study: &Study) -> Ensemble<'_> {
    Ensemble { duration_s: 3.0 * study.sample_period_s, threads: 2, ..ensemble(study) }
}

/// The healthy variant of the first case; one with a broken parameter ends early.
fn variant(study: &Study, is_broken: bool) -> Variant<'_> {
    let inputs = study.cases[0].inputs.iter().collect();
    let broken = study.system.parameter("actuator_1.cylinder.coulomb_friction_n").unwrap();
    let overrides = is_broken.then_some((broken.0, broken.1, f64::NAN)).into_iter().collect();
    Variant { inputs, overrides, ..Variant::default() }
}

/// All samples that an observer receives.
#[derive(Default)]
struct Received(Vec<Vec<f64>>);

impl Observer for Received {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        self.0.extend([measured, twin, inputs].map(Vec::from));
    }

    fn track(&mut self, _index: usize, plant: &[f64], twin: &[f64]) {
        self.0.extend([plant, twin].map(Vec::from));
    }
}

#[test]
fn an_observer_receives_sensors_in_their_order_then_what_is_tracked_and_the_inputs() {
    let study = Study::default();
    let case = |_| study.cases[0].name.as_str();
    let (keys, twin) = (BTreeSet::from(["calm"]), |_| variant(&study, false));
    let twins = simulate_twins(&short(&study), keys, twin, case).unwrap();
    let twin = &twins["calm"];
    let width = study.measured.len();
    assert_eq!(twin.samples.len(), 4 * width);
    // Two sensors, one tracked variable; the remaining ones stand for inputs.
    let chain = SensorChain::new(&study, 2, None).with_latencies(vec![0.5, 0.0]);
    let mut watch = Watch::new(twin, 2, chain, Received::default());
    watch.sample(2, &[10.0, 20.0, 30.0]);
    watch.sample(3, &[11.0, 24.0, 31.0]);
    let expected = |index: usize, plant: f64, measured: [f64; 2]| {
        let row = twin.at(index).to_vec();
        let sensors = vec![row[0], row[1]];
        [vec![plant], vec![row[2]], measured.into(), sensors, row[3..].into()]
    };
    let all = [expected(2, 30.0, [10.0, 20.0]), expected(3, 31.0, [10.5, 24.0])].concat();
    assert_eq!(watch.observer.0, all);
}

#[test]
fn the_first_run_that_fails_is_reported_and_a_cancelled_one_is_no_result() {
    let study = Study::default();
    let error = |specimen, reason| RunError::Calibration { specimen, reason };
    let runs = |ensemble: &Ensemble, broken: &[usize]| {
        record_runs(ensemble, 5, |run| variant(&study, broken.contains(&run)), error)
    };
    assert_eq!(runs(&short(&study), &[]).unwrap().len(), 5);
    match runs(&short(&study), &[4, 2]) {
        Err(RunError::Calibration { specimen: 2, reason }) => {
            assert!(reason.contains(" s in actuator_1."), "{reason}");
        }
        other => panic!("{:?}", other.map(|runs| runs.len())),
    }
    let cancelled = Ensemble { cancel: Some(&AtomicBool::new(true)), ..short(&study) };
    assert!(matches!(runs(&cancelled, &[]), Err(RunError::Cancelled)));
}

#[test]
fn a_draw_has_the_tolerances_and_the_noise_of_its_scenario() {
    let study = &Study::default();
    let seed = study.seed_of("training", 3);
    let draw = |scenario| SpecimenDraw { study, scenario, seed };
    let realism = study.realism.as_ref().unwrap();
    for scenario in Scenario::ALL {
        let drawn = draw(scenario);
        let own = realism.specimen(study, seed, 1.0);
        let tolerant = if scenario.has_tolerances() { own } else { vec![] };
        assert_eq!(drawn.parameters(1.0), tolerant, "{scenario:?}");
        let chosen = drawn.parameters_with(&vec![0.0; realism.tolerances().len()]);
        assert_eq!(chosen.len(), tolerant.len(), "{scenario:?}");
        let noise = scenario.has_noise().then(|| seed.stream(Stream::Sensors).normal());
        assert_eq!(drawn.noise(Stream::Sensors).map(|mut random| random.normal()), noise);
    }
}
