//! Simulates parts: a queue of simulations over several parts, and files that are written beside it.

use super::part::{PartFiles, PartRow};
use super::{
    Campaign, CampaignError, CampaignOutcome, PreparedCampaign, TwinKey, calibration_file,
};
use super::{Planned, Plants, VariantEffort};
use crate::ensemble::{Ensemble, Sink};
use crate::files::create_folder;
use crate::run::{Observer, RecordedRun, SensorChain, Twins, Watch, describe};
use crate::study::Stream;
use servotwin_diagnosis::residual::Window;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};

/// The most variants in one round, whose rows memory holds until their parts are complete.
const ROUND_VARIANTS: usize = 40_000;

/// The most twins in one round; each is as long as a run.
const ROUND_TWINS: usize = 256;

/// Complete parts that wait for the disk.
const WAITING: usize = 4;

/// A complete part of a scenario.
type Complete = (usize, usize, BTreeMap<usize, PartRow>);

impl Campaign<'_> {
    /// Simulates the variants of parts whose rows no file contains, unless cancelled. It writes no data set.
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
        let simulated = self.simulate_rounds(prepared, wanted, &mut outcome, &progress);
        outcome.cancelled = matches!(simulated, Err(CampaignError::Cancelled));
        if outcome.cancelled { Ok(outcome) } else { simulated.map(|()| outcome) }
    }

    fn simulate_rounds(
        &self,
        prepared: &PreparedCampaign,
        wanted: &[usize],
        outcome: &mut CampaignOutcome,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        let files = self.files(prepared);
        let missing: Vec<_> = files.iter().map(|own| own.missing(wanted.iter().copied())).collect();
        let rows = |own: &PartFiles, parts: &mut dyn Iterator<Item = usize>| -> usize {
            parts.map(|part| own.variants_of(part).len()).sum()
        };
        let all = files.iter().map(|own| rows(own, &mut wanted.iter().copied()));
        outcome.variants = all.sum();
        let open =
            files.iter().zip(&missing).map(|(own, open)| rows(own, &mut open.iter().copied()));
        outcome.resumed = outcome.variants - open.sum::<usize>();
        let open: BTreeSet<usize> = missing.iter().flatten().copied().collect();
        let is_pool = self.plants() == Plants::Pool;
        let is_told = !is_pool || calibration_file(&self.folder, self.role).exists();
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
            let jobs = self.jobs(prepared, &round);
            let wanted =
                jobs.iter().map(|job| self.beside(job[0], prepared.plan[job[0]])).collect();
            let twins = self.twins(wanted, &fitted)?;
            let run = Round { prepared, files: &files, pending, jobs, twins: &twins };
            self.run_round(run, outcome, &mut done, progress)?;
        }
        Ok(())
    }

    /// Divides parts into rounds; a round holds its twins and the rows of unfinished parts in memory.
    fn rounds(&self, prepared: &PreparedCampaign, parts: &BTreeSet<usize>) -> Vec<Vec<usize>> {
        let mut rounds: Vec<Vec<usize>> = vec![];
        let (mut variants, mut twins) = (0, BTreeSet::new());
        for &part in parts {
            let range = prepared.parts[part].clone();
            variants += range.len();
            let beside = |variant: usize| self.beside(variant, prepared.plan[variant]);
            twins.extend(range.clone().map(beside));
            let is_full = variants > ROUND_VARIANTS || twins.len() > ROUND_TWINS;
            match rounds.last_mut().filter(|_| !is_full) {
                Some(round) => round.push(part),
                None => {
                    variants = range.len();
                    twins = range.map(beside).collect();
                    rounds.push(vec![part]);
                }
            }
        }
        rounds
    }

    /// The variants of each simulation: one, or healthy specimens of a case that differ by the noise of their sensors
    /// alone. Those with full intensity come first: a few of them take a hundred times as long as the others, and would
    /// occupy a single lane at the end.
    fn jobs(
        &self,
        PreparedCampaign { plan, parts, .. }: &PreparedCampaign,
        round: &[usize],
    ) -> Vec<Vec<usize>> {
        let mut jobs: Vec<Vec<usize>> = vec![];
        for part in round {
            match self.is_shared(plan[parts[*part].start]) {
                true => jobs.push(parts[*part].clone().collect()),
                false => jobs.extend(parts[*part].clone().map(|variant| vec![variant])),
            }
        }
        let is_full = |fault: usize| self.study.faults[fault].at.intensity >= 1.0;
        jobs.sort_by_key(|job| !plan[job[0]].fault.is_some_and(is_full));
        jobs
    }

    /// Whether all healthy specimens of a case equal their twin.
    pub(super) fn is_shared(&self, planned: Planned) -> bool {
        planned.fault.is_none() && self.plants() == Plants::Twin
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
        let (files, stop) = (round.files, AtomicBool::new(false));
        let written = std::thread::scope(|scope| {
            let writer = scope.spawn(|| {
                let write = |(place, part, rows): Complete| files[place].write(part, &rows);
                let written = receiver.into_iter().try_for_each(write);
                // Nothing is simulated for a disk that takes nothing.
                stop.store(written.is_err(), Ordering::Relaxed);
                written
            });
            let simulated = self.simulate(&round, (sender, &stop), outcome, done, progress);
            let written = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            simulated.and(written)
        });
        written?;
        if self.is_cancelled() { Err(CampaignError::Cancelled) } else { Ok(()) }
    }

    fn simulate(
        &self,
        Round { prepared, files, pending, jobs, twins }: &Round,
        (sender, stop): (SyncSender<Complete>, &AtomicBool),
        outcome: &mut CampaignOutcome,
        done: &mut usize,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        let ensemble = self.ensemble();
        ensemble.prepare(jobs.len());
        let ensemble = Ensemble { cancel: Some(stop), ..ensemble };
        let (plan, scales) = (&prepared.plan, self.study.scales());
        let twin = |job: usize| &twins[&self.beside(jobs[job][0], plan[jobs[job][0]])];
        let all = outcome.variants;
        let mut open: BTreeMap<(usize, usize), BTreeMap<usize, PartRow>> = BTreeMap::new();
        let mut traced = Ok(());
        progress(*done, all);
        ensemble.run(
            jobs.len(),
            |job| self.variant(jobs[job][0], plan[jobs[job][0]]),
            |job| self.watch(prepared, pending, &jobs[job], twin(job), &scales),
            |job, Views(views), result| {
                if let Ok(work) = &result {
                    outcome.statistics += *work;
                }
                let plant = (result.as_ref().ok(), self.lasting_s(plan[jobs[job][0]]));
                let effort = VariantEffort::of(plant, (twin(job), ensemble.duration_s));
                let failure =
                    result.err().map(|f| describe(ensemble.program, &f)).unwrap_or_default();
                for View { place, variant, part, window, trace, .. } in
                    views.into_iter().map(|watch| watch.observer)
                {
                    if let Some(trace) = trace {
                        let scenario = self.scenarios[place];
                        traced = std::mem::replace(&mut traced, Ok(()))
                            .and_then(|()| self.write_trace(scenario, variant, trace));
                    }
                    let rows = open.entry((place, part)).or_default();
                    rows.insert(variant, PartRow { failure: failure.clone(), effort, window });
                    *done += 1;
                    if rows.len() == files[place].variants_of(part).len() {
                        let rows = open.remove(&(place, part)).expect("just filled");
                        // A writer that has stopped has the reason.
                        drop(sender.send((place, part, rows)));
                    }
                }
                if traced.is_err() || self.is_cancelled() {
                    stop.store(true, Ordering::Relaxed);
                }
                progress(*done, all);
            },
        );
        traced
    }

    /// The sink of a simulation, which serves some variants in every scenario that lacks them.
    fn watch<'w>(
        &self,
        PreparedCampaign { parts, counts, .. }: &PreparedCampaign,
        pending: &[BTreeSet<usize>],
        job: &[usize],
        twin: &'w RecordedRun,
        scales: &'w [f64],
    ) -> Views<'w> {
        let study = self.study;
        let sensors = study.measured.len();
        let part = parts.partition_point(|part| part.end <= job[0]);
        let mut views = Vec::new();
        for (place, &scenario) in self.scenarios.iter().enumerate() {
            let is_wanted =
                |&&variant: &&usize| variant < counts[place] && pending[place].contains(&part);
            views.extend(job.iter().filter(is_wanted).map(|&number| {
                let noise = self.draw(scenario, number).noise(Stream::Sensors);
                let view = View {
                    place,
                    variant: number,
                    part,
                    scales,
                    window: Window::watching(sensors, study.base_sensors()),
                    trace: self.keep_traces.then(|| vec![Vec::new(); sensors]),
                };
                Watch::new(twin, sensors, SensorChain::new(study, sensors, noise), view)
            }));
        }
        Views(views)
    }

    pub(super) fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    }
}

/// Parts that are simulated together.
struct Round<'r> {
    prepared: &'r PreparedCampaign,
    files: &'r [PartFiles],
    /// The parts that each scenario lacks.
    pending: Vec<BTreeSet<usize>>,
    /// The variants of each simulation.
    jobs: Vec<Vec<usize>>,
    twins: &'r Twins<TwinKey>,
}

/// The window of one variant in one scenario.
struct View<'w> {
    /// The index of the scenario in the campaign's list.
    place: usize,
    variant: usize,
    part: usize,
    scales: &'w [f64],
    window: Window,
    /// The measured values, if they are stored.
    trace: Option<Vec<Vec<f64>>>,
}

impl Observer for View<'_> {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        if let Some(trace) = &mut self.trace {
            trace.sample(index, measured);
        }
        self.window.add(measured, twin, self.scales);
    }
}

/// All variants that one simulation serves.
struct Views<'w>(Vec<Watch<'w, View<'w>>>);

impl Sink for Views<'_> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        self.0.iter_mut().for_each(|view| view.sample(index, values));
    }
}
