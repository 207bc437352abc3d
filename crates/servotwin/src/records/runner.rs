//! Simulates the records of parts into windows.

use super::row::PartRow;
use super::{Campaign, Plants, PreparedCampaign, RecordsOutcome, RunError, VariantEffort};
use crate::run::compute::{Kept, Round, Take, compute};
use crate::run::part::PartFiles;
use crate::run::runner::{Runner, View};
use crate::run::{Observer, Overrides, Run, describe, plan};
use crate::study::{Scenario, Study, Suite};
use crate::table::{Table, TableError};
use servotwin_diagnosis::residual::Window;
use servotwin_model::solver::{SolverFailure, Statistics};
use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};

impl Campaign<'_> {
    /// Simulates the variants of parts whose rows no file contains. It writes no data set.
    ///
    /// # Errors
    /// See [`Campaign::run`].
    pub fn run_parts(
        &self,
        prepared: &PreparedCampaign,
        wanted: &[usize],
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<RecordsOutcome, RunError> {
        let fitted = if self.plants() == Plants::Pool { self.fitted_twins()? } else { vec![] };
        let records = Records { campaign: self, prepared, fitted, work: Mutex::default() };
        let counts = compute(&records, wanted, self.workers, progress)?;
        Ok(RecordsOutcome {
            purpose: self.purpose,
            scenarios: self.scenarios.clone(),
            duration_s: prepared.suite.duration_s,
            seconds: 0.0,
            variants: counts.all,
            resumed: counts.resumed,
            statistics: records.work.into_inner().unwrap_or_else(PoisonError::into_inner),
            failed: vec![],
            on_the_move: 0,
        })
    }

    pub(super) fn is_cancelled(&self) -> bool {
        self.workers.is_cancelled()
    }
}

/// The windows of records.
struct Records<'r> {
    campaign: &'r Campaign<'r>,
    prepared: &'r PreparedCampaign,
    /// The parameters of the twins of the pool; empty without one.
    fitted: Vec<Overrides>,
    /// The solver's work.
    work: Mutex<Statistics>,
}

impl Kept for Records<'_> {
    type Row = PartRow;

    fn place(&self) -> (&Study, &Suite, Scenario) {
        (self.campaign.study, &self.prepared.suite, self.campaign.scenarios[0])
    }

    fn files(&self) -> &[PartFiles] {
        &self.prepared.files
    }

    fn fly(&self, round: &Round, take: Take<PartRow>) -> Result<(), RunError> {
        let Records { campaign, prepared, fitted, work } = self;
        let (study, suite) = (campaign.study, &prepared.suite);
        let runs = round.numbers().map(|number| plan::run(study, suite, number)).collect();
        let with = (campaign.solver, campaign.workers);
        let mut runner =
            Runner::of_records(study, suite, &campaign.scenarios, (runs, fitted), with)?;
        runner.stop = Some(&round.stop);
        let (scales, mut traced) = (study.scales(), Ok(()));
        runner.fly_views(
            |_, _| (),
            |run, scenario| self.observer((run, scenario), round, &scales),
            |views, ended| {
                if let Ok(done) = &ended {
                    *work.lock().unwrap_or_else(PoisonError::into_inner) += *done;
                }
                for View { run, scenario, observer: Seen { window, trace, .. } } in views {
                    if let (Some(trace), Ok(())) = (trace, &traced) {
                        traced = campaign.write_trace(scenario, run.number, trace);
                    }
                    take(
                        self.place_of(scenario),
                        run.number,
                        self.row(&runner, run, window, &ended),
                    );
                }
                if traced.is_err() {
                    round.stop.store(true, Ordering::Relaxed);
                }
            },
        );
        traced
    }

    fn table(&self, rows: BTreeMap<usize, PartRow>) -> Result<Table, TableError> {
        PartRow::to_table(&rows)
    }
}

impl Records<'_> {
    /// The index of a scenario in the campaign.
    fn place_of(&self, scenario: Scenario) -> usize {
        let mut known = self.campaign.scenarios.iter();
        known.position(|known| *known == scenario).expect("a scenario of these")
    }

    /// The observer of a run in a scenario that lacks it.
    fn observer<'w>(
        &self,
        (run, scenario): (&Run, Scenario),
        round: &Round,
        scales: &'w [f64],
    ) -> Option<Seen<'w>> {
        let study = self.campaign.study;
        let sensors = study.measured.len();
        round.lacks(self.place_of(scenario), run.number).then(|| Seen {
            scales,
            window: Window::watching(sensors, study.base_sensors()),
            trace: self.campaign.keep_traces.then(|| vec![Vec::new(); sensors]),
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
        let twin = (runner.twin(run), self.prepared.suite.longest_s());
        let program = &self.campaign.study.system.program;
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
    /// The measured values, if they are stored.
    trace: Option<Vec<Vec<f64>>>,
}

impl Observer for Seen<'_> {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        if let Some(trace) = &mut self.trace {
            crate::ensemble::Sink::sample(trace, index, measured);
        }
        self.window.add(measured, twin, self.scales);
    }
}
