//! Simulates the records of parts into windows.

use super::row::PartRow;
use super::{Plants, Records, RecordsOutcome, RunError, VariantEffort};
use crate::run::compute::{Kept, Round, Take, compute};
use crate::run::part::PartFiles;
use crate::run::runner::{Runner, View};
use crate::run::{Observer, Overrides, Run, describe, plan};
use crate::study::{Scenario, Study, Suite};
use crate::table::{Table, TableError};
use servotwin_diagnosis::residual::Window;
use servotwin_model::solver::{SolverFailure, Statistics};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

impl Records<'_> {
    /// Simulates the records of parts whose files are absent or unusable. It writes no data set.
    ///
    /// # Errors
    /// See [`Records::run`].
    pub fn run_parts(
        &self,
        wanted: &[usize],
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<RecordsOutcome, RunError> {
        let fitted = if self.plants() == Plants::Pool { self.fitted_twins()? } else { vec![] };
        let simulated = Simulated { records: self, fitted, work: Mutex::default() };
        let counts = compute(&simulated, wanted, self.workers, progress)?;
        Ok(RecordsOutcome {
            purpose: self.suite.purpose,
            scenarios: self.scenarios.clone(),
            duration_s: self.suite.duration_s,
            seconds: 0.0,
            variants: counts.all,
            resumed: counts.resumed,
            statistics: simulated.work.into_inner().unwrap_or_else(PoisonError::into_inner),
            failed: vec![],
            on_the_move: 0,
        })
    }
}

/// Records with what simulates them.
struct Simulated<'r> {
    records: &'r Records<'r>,
    /// The parameters of the twins of the pool; empty without one.
    fitted: Vec<Overrides>,
    /// The solver's work.
    work: Mutex<Statistics>,
}

impl Kept for Simulated<'_> {
    type Row = PartRow;

    fn place(&self) -> (&Study, &Suite, Scenario) {
        (self.records.study, &self.records.suite, self.records.scenarios[0])
    }

    fn files(&self) -> &[PartFiles] {
        &self.records.files
    }

    fn fly(&self, round: &Round, take: Take<PartRow>) -> Result<(), RunError> {
        let Simulated { records, fitted, work } = self;
        let Records { study, suite, scenarios, workers, .. } = records;
        let runs = round.numbers().map(|number| plan::run(study, suite, number)).collect();
        let mut runner = Runner::of_records(study, suite, scenarios, (runs, fitted), *workers)?;
        runner.stop = Some(&round.stop);
        let scales = study.scales();
        runner.fly_views(
            |_, _| (),
            |run, scenario| self.observer((run, scenario), round, &scales),
            |views, ended| {
                if let Ok(done) = &ended {
                    *work.lock().unwrap_or_else(PoisonError::into_inner) += *done;
                }
                for View { run, scenario, observer: Seen { window, .. } } in views {
                    take(
                        self.place_of(scenario),
                        run.number,
                        self.row(&runner, run, window, &ended),
                    );
                }
            },
        );
        Ok(())
    }

    fn table(&self, rows: BTreeMap<usize, PartRow>) -> Result<Table, TableError> {
        PartRow::to_table(&rows)
    }
}

impl Simulated<'_> {
    /// The index of a scenario among those of the records.
    fn place_of(&self, scenario: Scenario) -> usize {
        let mut known = self.records.scenarios.iter();
        known.position(|known| *known == scenario).expect("a scenario of these")
    }

    /// The observer of a run in a scenario that lacks it.
    fn observer<'w>(
        &self,
        (run, scenario): (&Run, Scenario),
        round: &Round,
        scales: &'w [f64],
    ) -> Option<Seen<'w>> {
        let study = self.records.study;
        round.lacks(self.place_of(scenario), run.number).then(|| Seen {
            scales,
            window: Window::watching(study.measured.len(), study.base_sensors()),
        })
    }

    fn row(
        &self,
        runner: &Runner,
        run: &Run,
        window: Window,
        ended: &Result<Statistics, SolverFailure>,
    ) -> PartRow {
        let plant = (ended.as_ref().ok(), run.duration_s);
        let twin = (runner.twin(run), self.records.suite.longest_s());
        let program = &self.records.study.system.program;
        let failure = ended.as_ref().err().map(|failure| describe(program, failure));
        PartRow {
            failure: failure.unwrap_or_default(),
            effort: VariantEffort::of(plant, twin),
            window,
        }
    }
}

/// The data kept of a run in a scenario.
struct Seen<'w> {
    scales: &'w [f64],
    window: Window,
}

impl Observer for Seen<'_> {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        self.window.add(measured, twin, self.scales);
    }
}
