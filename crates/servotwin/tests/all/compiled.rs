//! A compiled step is the step of the lists, bit by bit.

use servotwin::built_in;
use servotwin::compiled::Compiled;
use servotwin::ensemble::{Ensemble, Variant};
use servotwin::system::System;
use servotwin_model::lanes::{self, Level};
use servotwin_model::program::{FaultAt, Slot};
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{Failure, Statistics};

const VARIANTS: usize = 21;

type Run = Result<(Statistics, Vec<Vec<u64>>), Failure>;

/// Faults of all kinds at growing intensity while every input swings; all that can be recorded.
fn runs(system: &System, level: Level, compiled: Option<&Compiled>) -> Vec<Run> {
    let program = &system.program;
    let inputs: Vec<Piecewise> = (program.network().inputs.iter())
        .map(|input| {
            let swing = 0.05 * input.default + if input.default == 0.0 { 1e-3 } else { 0.0 };
            Piecewise::new(
                vec![0.0],
                vec![[input.default, 10.0 * swing, -60.0 * swing, 50.0 * swing]],
            )
            .expect("one piece")
        })
        .collect();
    let faults: Vec<(usize, usize)> = (program.network().components.iter().enumerate())
        .flat_map(|(c, instance)| {
            (0..instance.component.spec().faults.len()).map(move |fault| (c, fault))
        })
        .collect();
    let variant = |job: usize| Variant {
        faults: (job > 0 && !faults.is_empty())
            .then(|| {
                let (component, fault) = faults[job * faults.len() / VARIANTS];
                FaultAt { component, fault, intensity: job as f64 / VARIANTS as f64 }
            })
            .into_iter()
            .collect(),
        inputs: inputs.iter().collect(),
        ..Variant::default()
    };
    let ensemble = Ensemble {
        compiled,
        level,
        threads: 1,
        record: (0..program.slots() as Slot).collect(),
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
        assert!(compiled.kernels(&system.program, level).is_some(), "{name}: a C compiler");
        let lists = runs(&system, level, None);
        assert!(lists.iter().filter(|run| run.is_ok()).count() > VARIANTS / 2, "{name}");
        assert!(lists == runs(&system, level, Some(&compiled)), "{name}");
    }
}

#[test]
fn it_gives_the_bits_of_the_lists_in_lanes_of_every_kind() {
    let (name, text) = built_in::SYSTEMS[1];
    let system = System::parse(text, name).unwrap();
    let lists = runs(&system, Level::Portable, None);
    for level in lanes::ALL.into_iter().filter(|level| level.available()) {
        let compiled = Compiled::at_once();
        assert!(compiled.kernels(&system.program, level).is_some(), "a C compiler");
        assert!(lists == runs(&system, level, Some(&compiled)), "{}", level.name());
        assert!(lists == runs(&system, level, None), "{} without", level.name());
    }
}
