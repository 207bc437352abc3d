//! Simulates parts: a queue of simulations over several parts, and files that are written beside it.

use super::row::PartRow;
use super::{
    Campaign, CampaignError, CampaignOutcome, Plants, PreparedCampaign, VariantEffort,
    calibration_file,
};
use crate::ensemble::Sink;
use crate::files::create_folder;
use crate::run::part::rounds;
use crate::run::runner::{Runner, View};
use crate::run::{Observer, Run, describe, fitted_specimen, plan};
use crate::study::Scenario;
use servotwin_diagnosis::residual::Window;
use servotwin_model::solver::{SolverFailure, Statistics};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};

/// Complete parts that wait for the disk.
const WAITING: usize = 4;

/// A complete part of a scenario.
type Complete = (usize, usize, BTreeMap<usize, PartRow>);

impl Campaign<'_> {
    /// Simulates the variants of parts whose rows no file contains. It writes no data set.
    ///
    /// # Errors
    /// See [`Campaign::run`].
    pub fn run_parts(
        &self,
        prepared: &PreparedCampaign,
        wanted: &[usize],
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<CampaignOutcome, CampaignError> {
        let mut outcome = CampaignOutcome::default();
        self.simulate_rounds(prepared, wanted, &mut outcome, &progress)?;
        Ok(outcome)
    }

    fn simulate_rounds(
        &self,
        prepared: &PreparedCampaign,
        wanted: &[usize],
        outcome: &mut CampaignOutcome,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        let files = &prepared.files;
        let missing: Vec<_> = files.iter().map(|own| own.missing(wanted.iter().copied())).collect();
        outcome.variants = files.iter().map(|own| own.runs_of(wanted)).sum();
        let open = files.iter().zip(&missing).map(|(own, open)| own.runs_of(open));
        outcome.resumed = outcome.variants - open.sum::<usize>();
        let open: BTreeSet<usize> = missing.iter().flatten().copied().collect();
        let is_pool = self.plants() == Plants::Pool;
        let is_told = !is_pool || calibration_file(&self.folder, self.purpose).exists();
        if open.is_empty() && is_told {
            return Ok(());
        }
        let fitted = if is_pool { self.fitted_twins()? } else { vec![] };
        let mut done = outcome.resumed;
        for round in self.rounds(prepared, &open) {
            let own = |open: &BTreeSet<usize>| {
                round.iter().copied().filter(|p| open.contains(p)).collect()
            };
            let pending = missing.iter().map(own).collect::<Vec<BTreeSet<usize>>>();
            let numbers = round.iter().flat_map(|&part| prepared.numbers(part));
            let runs = numbers.map(|&number| plan::run(self.study, &prepared.suite, number));
            let (runs, with) = ((runs.collect(), &fitted[..]), (self.solver, self.workers));
            let runner =
                Runner::of_records(self.study, &prepared.suite, &self.scenarios, runs, with)?;
            let run = Round::new(self, prepared, (&round, pending), &runner);
            self.run_round(run, outcome, &mut done, progress)?;
        }
        Ok(())
    }

    fn rounds(&self, prepared: &PreparedCampaign, open: &BTreeSet<usize>) -> Vec<Vec<usize>> {
        let (study, suite) = (self.study, &prepared.suite);
        let all: Vec<Vec<usize>> =
            (0..prepared.part_count()).map(|part| prepared.numbers(part).to_vec()).collect();
        let twin = |number: usize| {
            let run = plan::run(study, suite, number);
            (run.environment, fitted_specimen(study, suite, self.scenarios[0], &run))
        };
        rounds(&all, open, (suite.longest_s() / study.sample_period_s, twin))
    }

    fn run_round(
        &self,
        round: Round,
        outcome: &mut CampaignOutcome,
        done: &mut usize,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        create_folder(self.folder.join(super::PARTS)).map_err(CampaignError::File)?;
        let (sender, receiver) = sync_channel::<Complete>(WAITING);
        let (files, stop) = (&round.prepared.files, AtomicBool::new(false));
        let written = std::thread::scope(|scope| {
            let writer = scope.spawn(|| {
                let write = |(place, part, rows): Complete| {
                    Ok(files[place].write(part, PartRow::to_table(&rows)?)?)
                };
                let written = receiver.into_iter().try_for_each(write);
                // Nothing is simulated for a disk that takes nothing.
                stop.store(written.is_err(), Ordering::Relaxed);
                written
            });
            let simulated = round.simulate((sender, &stop), outcome, done, progress);
            let written = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            simulated.and(written)
        });
        written?;
        if self.is_cancelled() { Err(CampaignError::Cancelled) } else { Ok(()) }
    }

    pub(super) fn is_cancelled(&self) -> bool {
        self.workers.is_cancelled()
    }
}

/// Parts that are simulated together.
struct Round<'r> {
    campaign: &'r Campaign<'r>,
    prepared: &'r PreparedCampaign,
    /// The part of each run.
    part_of: BTreeMap<usize, usize>,
    /// The parts that each scenario lacks.
    pending: Vec<BTreeSet<usize>>,
    runner: &'r Runner<'r>,
}

impl<'r> Round<'r> {
    fn new(
        campaign: &'r Campaign,
        prepared: &'r PreparedCampaign,
        (parts, pending): (&[usize], Vec<BTreeSet<usize>>),
        runner: &'r Runner,
    ) -> Self {
        let of = |&part: &usize| prepared.numbers(part).iter().map(move |&number| (number, part));
        Round { campaign, prepared, part_of: parts.iter().flat_map(of).collect(), pending, runner }
    }

    fn simulate(
        &self,
        (sender, stop): (SyncSender<Complete>, &AtomicBool),
        outcome: &mut CampaignOutcome,
        done: &mut usize,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        let (campaign, all) = (self.campaign, outcome.variants);
        let scales = campaign.study.scales();
        let mut open: BTreeMap<(usize, usize), BTreeMap<usize, PartRow>> = BTreeMap::new();
        let mut traced = Ok(());
        progress(*done, all);
        self.runner.fly_views(
            (&self.runner.simulations(), Some(stop)),
            |_, _| (),
            |run, scenario| self.observer(run, scenario, &scales),
            |views, ended| {
                if let Ok(work) = &ended {
                    outcome.statistics += *work;
                }
                for View { run, scenario, observer } in views {
                    let Seen { window, trace, .. } = observer;
                    if let (Some(trace), Ok(())) = (trace, &traced) {
                        traced = campaign.write_trace(scenario, run.number, trace);
                    }
                    let (place, part) = self.place(run, scenario);
                    let rows = open.entry((place, part)).or_default();
                    rows.insert(run.number, self.row(run, window, &ended));
                    *done += 1;
                    if rows.len() == self.prepared.files[place].parts[part].len() {
                        let rows = open.remove(&(place, part)).expect("just filled");
                        // A writer that has stopped has the reason.
                        drop(sender.send((place, part, rows)));
                    }
                }
                if traced.is_err() || campaign.is_cancelled() {
                    stop.store(true, Ordering::Relaxed);
                }
                progress(*done, all);
            },
        );
        traced
    }

    /// The indices of a scenario in the campaign, and of the part of a run.
    fn place(&self, run: &Run, scenario: Scenario) -> (usize, usize) {
        let is_it = |known: &Scenario| *known == scenario;
        let place = self.campaign.scenarios.iter().position(is_it).expect("a scenario of these");
        (place, self.part_of[&run.number])
    }

    /// The observer of a run in a scenario that lacks it.
    fn observer<'w>(&self, run: &Run, scenario: Scenario, scales: &'w [f64]) -> Option<Seen<'w>> {
        let (place, part) = self.place(run, scenario);
        let study = self.campaign.study;
        let sensors = study.measured.len();
        let is_own = || self.prepared.files[place].parts[part].binary_search(&run.number).is_ok();
        (self.pending[place].contains(&part) && is_own()).then(|| Seen {
            scales,
            window: Window::watching(sensors, study.base_sensors()),
            trace: self.campaign.keep_traces.then(|| vec![Vec::new(); sensors]),
        })
    }

    fn row(&self, run: &Run, window: Window, ended: &Result<Statistics, SolverFailure>) -> PartRow {
        let plant = (ended.as_ref().ok(), run.duration_s);
        let twin = (self.runner.twin(run), self.prepared.suite.longest_s());
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
            trace.sample(index, measured);
        }
        self.window.add(measured, twin, self.scales);
    }
}
