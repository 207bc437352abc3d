//! A compiled step is the step of the lists, bit by bit.

use servotwin::built_in;
use servotwin::compiled::Compiled;
use servotwin::ensemble::{Ensemble, Later, Variant};
use servotwin::system::System;
use servotwin_model::lanes::{self, Level};
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{SolverFailure, Statistics};

const VARIANTS: usize = 21;

type Run = Result<(Statistics, Vec<Vec<u64>>), SolverFailure>;

/// Faults of all kinds at growing intensity, some of them healed on the way, while every input swings and then
/// stays; all that can be recorded.
fn runs(system: &System, level: Level, compiled: Option<&Compiled>) -> Vec<Run> {
    let program = &system.program;
    let inputs: Vec<Piecewise> = (program.network().inputs.iter())
        .map(|input| {
            let swing = if input.default == 0.0 { 1e-3 } else { 0.05 * input.default };
            let there = [input.default, 10.0 * swing, -60.0 * swing, 50.0 * swing];
            let stay = [input.default + 0.45 * swing, 0.0, 0.0, 0.0];
            Piecewise::new(vec![0.0, 0.1], vec![there, stay]).expect("two pieces")
        })
        .collect();
    let faults: Vec<(usize, usize)> = (program.network().components.iter().enumerate())
        .flat_map(|(c, instance)| (0..instance.component.faults.len()).map(move |fault| (c, fault)))
        .collect();
    let fault = |job: usize| {
        let (component, fault) = faults[job * faults.len() / VARIANTS];
        FaultAt { component, fault, intensity: job as f64 / VARIANTS as f64 }
    };
    let healed = Later { time_s: 0.12, ..Later::default() };
    let variant = |job: usize| Variant {
        faults: if job == 0 { vec![] } else { vec![fault(job)] },
        later: if job.is_multiple_of(3) { vec![healed.clone()] } else { vec![] },
        inputs: inputs.iter().collect(),
        ..Variant::default()
    };
    let ensemble = Ensemble {
        compiled,
        level,
        threads: 1,
        record: program.observables().iter().map(|observable| observable.slot).collect(),
        duration_s: 0.2,
        ..Ensemble::new(program)
    };
    let mut runs: Vec<Option<Run>> = vec![None; VARIANTS];
    ensemble.run(
        VARIANTS,
        variant,
        |_| Vec::<Vec<f64>>::new(),
        |job, samples, outcome| {
            let bits = |column: &Vec<f64>| column.iter().map(|value| value.to_bits()).collect();
            let run = outcome.map(|work| (work, samples.iter().map(bits).collect()));
            runs[job] = Some(run);
        },
    );
    runs.into_iter().map(|run| run.expect("every variant ends")).collect()
}

#[test]
fn it_gives_the_bits_of_the_lists_in_every_built_in_system() {
    for (name, text) in built_in::SYSTEMS {
        let system = System::parse(text, name).unwrap();
        let compiled = Compiled::at_once();
        let level = Level::best();
        assert!(compiled.steps(&system.program, level).is_some(), "{name}: a C compiler");
        let lists = runs(&system, level, None);
        assert!(lists.iter().filter(|run| run.is_ok()).count() > VARIANTS / 2, "{name}");
        assert!(lists == runs(&system, level, Some(&compiled)), "{name}");
    }
}

#[test]
fn it_gives_the_bits_of_the_lists_in_lanes_of_every_kind_and_beside_a_clock() {
    let (name, text) = built_in::SYSTEMS[1];
    let controller = "kind = \"position_controller\"";
    assert!(text.contains(controller));
    let text = text.replace(controller, "kind = \"sampled_position_controller\"");
    let system = System::parse(&text, name).unwrap();
    assert_eq!(system.program.clock_periods_s().count(), 1);
    let lists = runs(&system, Level::Portable, None);
    for level in lanes::ALL.into_iter().filter(|level| level.available()) {
        let compiled = Compiled::at_once();
        assert!(compiled.steps(&system.program, level).is_some(), "a C compiler");
        assert!(lists == runs(&system, level, Some(&compiled)), "{}", level.name());
        assert!(lists == runs(&system, level, None), "{} without", level.name());
    }
}
