//! A twin stepped from sample to sample is a variant in a lane, bit for bit.

use crate::{allocations, rig};
use servotwin_model::lanes::Level;
use servotwin_model::program::{FaultAt, Program, Slot};
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{
    Between, Change, Job, JobSource, Knot, Snapshot, SolverFailure, SolverSettings, Statistics,
    Twin, run,
};

const PERIOD_S: f64 = 0.01;
const SAMPLES: usize = 60;

/// The command as values and slopes at the samples.
fn knot(k: usize) -> Knot {
    let t = k as f64 * PERIOD_S;
    Knot { value: 0.1 + 0.05 * (7.0 * t).sin(), slope_per_s: 0.35 * (7.0 * t).cos() }
}

/// Command, mode and altitude at a sample; the mode switches the actuator off at sample 40.
fn inputs(k: usize) -> [Knot; 3] {
    [knot(k), Knot::from(if k < 40 { 1.0 } else { 0.0 }), Knot::from(3000.0 + 10.0 * k as f64)]
}

const BETWEEN: [Between; 3] = [Between::Cubic, Between::Hold, Between::Line];

/// The same inputs as signals over the whole run.
fn signals() -> [Piecewise; 3] {
    let times: Vec<f64> = (0..=SAMPLES).map(|k| k as f64 * PERIOD_S).collect();
    let of = |f: fn([Knot; 3]) -> f64| (0..=SAMPLES).map(|k| f(inputs(k))).collect::<Vec<f64>>();
    [
        Piecewise::hermite(&times, &of(|i| i[0].value), &of(|i| i[0].slope_per_s)).unwrap(),
        Piecewise::steps(&times, &of(|i| i[1].value)).unwrap(),
        Piecewise::linear(&times, &of(|i| i[2].value)).unwrap(),
    ]
}

fn record(program: &Program) -> Vec<Slot> {
    program.observables().iter().map(|observable| observable.slot).collect()
}

struct One<'a> {
    job: Option<Job<'a>>,
    samples: Vec<Vec<f64>>,
}

impl<'a> JobSource<'a> for One<'a> {
    fn next(&mut self) -> Option<Job<'a>> {
        self.job.take()
    }
    fn sample(&mut self, _job: usize, _index: usize, values: &[f64]) {
        self.samples.push(values.to_vec());
    }
    fn finish(&mut self, _job: usize, outcome: Result<Statistics, SolverFailure>) {
        outcome.unwrap();
    }
}

/// All observables at all samples, computed in a lane.
fn by_ensemble(program: &Program, later: Option<(f64, &[FaultAt])>, level: Level) -> Vec<Vec<f64>> {
    let signals = signals();
    let parameters = program.parameters(&[]);
    let change = |(time_s, faults): (f64, &[FaultAt])| {
        let parameters = program.parameters(faults);
        let constants = program.block_constants(&parameters);
        Change { time_s, constants, stand_ins: program.stand_in_values(&parameters) }
    };
    let job = Job {
        number: 0,
        constants: program.block_constants(&parameters),
        stand_ins: program.stand_in_values(&parameters),
        inputs: signals.iter().collect(),
        start: program.first_guess(&parameters),
        settle: true,
        duration_s: SAMPLES as f64 * PERIOD_S,
        sample_period_s: PERIOD_S,
        changes: later.into_iter().map(change).collect(),
    };
    let mut one = One { job: Some(job), samples: Vec::new() };
    run(program, None, SolverSettings::of_runs(), &record(program), level, &mut one);
    one.samples
}

fn settled(program: &Program) -> Twin<'_> {
    let mut twin = Twin::new(program, SolverSettings::of_runs(), PERIOD_S, BETWEEN.to_vec());
    let parameters = program.parameters(&[]);
    twin.load(&parameters);
    twin.settle(&inputs(0), &program.first_guess(&parameters)).unwrap();
    twin
}

fn values(twin: &Twin) -> Vec<f64> {
    record(twin.program()).iter().map(|&slot| twin.value(slot)).collect()
}

#[test]
fn a_twin_gives_the_values_of_a_lane_bit_for_bit() {
    let program = rig::actuator();
    let expected = by_ensemble(&program, None, Level::best());
    let mut twin = settled(&program);
    for (k, expected) in expected.iter().enumerate() {
        if k > 0 {
            twin.step(&inputs(k)).unwrap();
        }
        assert_eq!(twin.sample(), k as u64);
        assert_eq!(&values(&twin), expected, "sample {k}");
    }
    assert_eq!(expected.len(), SAMPLES + 1);
}

#[test]
fn a_fault_that_begins_on_the_way_is_the_same_for_twin_and_lane() {
    let program = rig::actuator();
    let (component, fault) = program.find_fault("leakage.leakage").unwrap();
    let faults = [FaultAt { component, fault, intensity: 1.0 }];
    let onset = 30;
    let healthy = by_ensemble(&program, None, Level::Portable);
    let expected = by_ensemble(&program, Some((onset as f64 * PERIOD_S, &faults)), Level::best());
    assert_eq!(healthy[..onset], expected[..onset]);
    assert_ne!(healthy[SAMPLES], expected[SAMPLES]);
    let mut twin = settled(&program);
    for (k, expected) in expected.iter().enumerate().skip(1) {
        if k == onset {
            twin.load(&program.parameters(&faults));
        }
        twin.step(&inputs(k)).unwrap();
        assert_eq!(&values(&twin), expected, "sample {k}");
    }
}

#[test]
fn a_twin_goes_on_from_what_it_remembered() {
    let program = rig::actuator();
    let mut twin = settled(&program);
    let mut snapshot = Snapshot::default();
    for k in 1..=SAMPLES {
        twin.step(&inputs(k)).unwrap();
        if k == 33 {
            twin.save(&mut snapshot);
        }
    }
    let mut other = Twin::new(&program, SolverSettings::of_runs(), PERIOD_S, BETWEEN.to_vec());
    other.load(&program.parameters(&[]));
    other.restore(&snapshot).unwrap();
    for k in 34..=SAMPLES {
        other.step(&inputs(k)).unwrap();
    }
    assert_eq!(values(&other), values(&twin));
    snapshot.states.pop();
    assert_eq!(other.restore(&snapshot), Err("states"));
}

#[test]
fn a_step_allocates_nothing() {
    let program = rig::actuator();
    let mut twin = settled(&program);
    twin.step(&inputs(1)).unwrap();
    let before = allocations();
    for k in 2..=SAMPLES {
        twin.step(&inputs(k)).unwrap();
    }
    assert_eq!(allocations(), before);
}
