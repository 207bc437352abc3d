//! The campaign: simulates every fault in every operating case on all cores, directly into windows.
//!
//! One simulation serves all variants with the same signals (`images`), in all scenarios with the same plants
//! ([`Setting::groups`]).
//!
//! Variants are written in *shards*. A shard is a Parquet file that appears when all its variants have ended. A resumed
//! campaign skips existing shards. Every variant has the same bits whenever it runs, so the result has the same bytes.
//! Shards are simulated in rounds and joined one after the other. Memory holds the twins of a round, its open lanes and
//! unfinished shards, and about 50 bytes of the plan for every variant; it does not grow with the length of faulty
//! runs.
//!
//! A shard contains windows, not features. The data set is made from the shards, so features can be changed without new
//! simulations.

mod calibration;
pub mod columns;
mod data_set;
mod effort;
mod images;
mod join;
mod missing;
mod part;
mod prepared;
mod shard;
mod watch;

pub use crate::experiment::{CampaignError, ensemble};
pub use calibration::{Comparison, calibration_file, calibrations};
pub use columns::largest_column;
pub use data_set::{DataFeature, FOLDS, data_features};
pub use effort::VariantEffort;
pub use missing::{MissingParts, MissingRows, missing_parts};
pub use part::{Part, runs};
pub use prepared::PreparedCampaign;
pub use shard::ShardRow;

use crate::ensemble::{Ensemble, Variant};
use crate::experiment::{Overrides, SpecimenDraw, Twins, describe, simulate_twins};
use crate::files::create_folder;
use crate::study::{FaultCase, OperatingCase, Plants, Role, Setting, Study};
use crate::table::{self, Column, Table, Values};
use images::Images;
use servotwin_model::program::FaultAt;
use servotwin_model::solver::{SolverSettings, Statistics};
use shard::{Collector, Shards, variants_of};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use watch::Views;

/// The format of shards; shards of another format are simulated again.
const SHARD_FORMAT: &str = "windows 1";

/// Shards in one round of a campaign: enough that lanes rarely wait for the last ones, and few enough to limit memory.
pub const ROUND_SHARDS: usize = 200;

/// The most twins in one round; each is as long as a run.
const ROUND_TWINS: usize = 256;

/// The settings of a campaign.
pub struct Campaign<'s> {
    /// The study to simulate.
    pub study: &'s Study,
    /// Whether the diagnosis is judged on it or trained on it.
    pub role: Role,
    /// The scenarios, one of the groups of [`Setting::groups`].
    pub settings: Vec<Setting>,
    /// The solver's settings.
    pub solver: SolverSettings,
    /// The number of worker threads.
    pub threads: usize,
    /// The output folder.
    pub folder: PathBuf,
    /// Number of shards processed at a time, usually [`ROUND_SHARDS`]. It affects the memory used, not the results.
    pub round_shards: usize,
    /// Whether to store the time series as well.
    pub keep_traces: bool,
    /// Whether to simulate also variants that another simulation serves.
    pub simulate_images: bool,
    /// Set by another thread to stop.
    pub cancel: Option<&'s AtomicBool>,
}

/// A planned variant of the campaign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned {
    /// The index of the operating case.
    pub case: usize,
    /// The index of the fault; `None` for a healthy specimen.
    pub fault: Option<usize>,
    /// Its intensity, which may differ from the study's in training; 0 for a healthy specimen.
    pub intensity: f64,
}

/// The result of a campaign.
#[derive(Clone, Debug, Default)]
pub struct CampaignOutcome {
    /// Number of variants in all scenarios.
    pub variants: usize,
    /// Number of variants that were already done.
    pub resumed: usize,
    /// Number of variants in one scenario that are symmetric copies of simulated ones.
    pub images: usize,
    /// Number of healthy specimens in one scenario that differ from a simulated one only by sensor noise.
    pub alike: usize,
    /// The solver's work in this run.
    pub statistics: Statistics,
    /// Variants that failed, with the reason.
    pub failed: Vec<(Setting, usize, String)>,
    /// Variants that began without a steady state, in every scenario.
    pub on_the_move: Vec<OnTheMove>,
    /// Whether it was stopped early.
    pub cancelled: bool,
}

/// A variant for which, or for whose twin, no steady state was found.
#[derive(Clone, Debug, PartialEq)]
pub struct OnTheMove {
    /// The scenario.
    pub setting: Setting,
    /// The variant's number.
    pub variant: usize,
    /// Its fault, or `healthy`.
    pub fault: String,
    /// The name of the operating case.
    pub case: String,
    /// Whether a limit cycle was detected.
    pub limit_cycle: bool,
}

impl std::fmt::Display for OnTheMove {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let OnTheMove { setting, variant, fault, case, limit_cycle } = self;
        let why = if *limit_cycle { "limit cycle measured" } else { "no steady state found" };
        write!(out, "{} variant {variant} ({fault}, {case}): {why}", setting.name())
    }
}

impl<'s> Campaign<'s> {
    /// The campaign of one scenario with existing shards in a folder, with the default settings.
    pub fn stored(folder: &Path, study: &'s Study, setting: Setting, role: Role) -> Self {
        Campaign {
            study,
            role,
            settings: vec![setting],
            solver: SolverSettings::campaign(),
            threads: 1,
            folder: folder.into(),
            round_shards: ROUND_SHARDS,
            keep_traces: false,
            simulate_images: false,
            cancel: None,
        }
    }
}

impl Campaign<'_> {
    /// The variants in the order of the data set: in each case all faults, then healthy specimens.
    ///
    /// For judging, every fault of every unit is simulated in every case. For training, like units alternate, because
    /// every row is also seen from each unit.
    pub fn plan(&self) -> Vec<Planned> {
        let cases = self.cases();
        let mut plan = Vec::new();
        for case in 0..cases.len() {
            let faults: Vec<usize> = match self.role {
                Role::Training if self.study.has_like_units() => self.in_turn(case),
                _ => (0..self.study.faults.len()).collect(),
            };
            plan.extend(faults.into_iter().map(|fault| {
                let of_study = self.study.faults[fault].at.intensity;
                let intensity = match (self.role, &self.study.training) {
                    // The intensity sequence is shifted from fault to fault and from case to case.
                    (Role::Training, Some(training)) => {
                        training.intensity(of_study, case + 7 * fault)
                    }
                    _ => of_study,
                };
                Planned { case, fault: Some(fault), intensity }
            }));
        }
        let healthy = match self.role {
            Role::Judged => self.study.realism.as_ref().map_or(0, |r| r.healthy),
            Role::Training => self.study.training.as_ref().map_or(0, |t| t.healthy),
        };
        if self.settings.iter().any(|setting| setting.has_noise()) {
            let specimens =
                |case| (0..healthy).map(move |_| Planned { case, fault: None, intensity: 0.0 });
            plan.extend((0..cases.len()).flat_map(specimens));
        }
        plan
    }

    /// Each fault in one of the units that can have it, alternating between faults and between cases.
    fn in_turn(&self, case: usize) -> Vec<usize> {
        let units = self.study.units.len();
        let of_unit = |unit: usize| {
            let own = |(_, fault): &(usize, &FaultCase)| fault.unit == unit;
            let faults = self.study.faults.iter().enumerate().filter(own);
            faults.map(|(place, _)| place).collect::<Vec<_>>()
        };
        let lists: Vec<Vec<usize>> = (0..units).map(of_unit).collect();
        let intensities = self.study.intensities.len().max(1);
        let turn = |place: usize| (case + place / intensities + place % intensities) % units;
        (0..lists[0].len()).map(|place| lists[turn(place)][place]).collect()
    }

    fn cases(&self) -> &[OperatingCase] {
        self.study.cases_of(self.role)
    }

    /// Duration of the runs with faults, s.
    pub fn duration_s(&self) -> f64 {
        match (self.role, &self.study.training) {
            (Role::Training, Some(training)) => training.duration_s,
            _ => self.study.duration_s,
        }
    }

    /// Simulates what is missing and writes the data sets. `progress` receives the number of rows done and their total.
    ///
    /// # Errors
    /// A file cannot be written, the study is empty, or the healthy system cannot be simulated. Failures of single
    /// variants are in the outcome.
    pub fn run(
        &self,
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<CampaignOutcome, CampaignError> {
        let mut prepared = self.prepared()?;
        let mut outcome = CampaignOutcome::default();
        loop {
            self.simulate(&prepared, prepared.bundles(), &mut outcome, &progress)?;
            if outcome.cancelled {
                return Ok(outcome);
            }
            if self.units_are_alike(&prepared)? {
                self.write_data_sets(&prepared, &mut outcome)?;
                return Ok(outcome);
            }
            prepared = self.without_images(prepared);
        }
    }

    /// Finds the variants that need no simulation.
    fn images(&self, plan: &[Planned]) -> Images {
        if self.plants() != Plants::Twin || self.keep_traces || self.simulate_images {
            return Images::none(plan);
        }
        Images::of(self.study, plan)
    }

    /// How plants and twins are paired, common to all scenarios of a group.
    fn plants(&self) -> Plants {
        self.first_setting().plants()
    }

    fn first_setting(&self) -> Setting {
        self.settings.first().copied().unwrap_or(Setting::Ideal)
    }

    fn shard_folder(&self) -> PathBuf {
        self.folder.join("shards")
    }

    fn shards(&self, prepared: &PreparedCampaign) -> Vec<Shards> {
        let PreparedCampaign { fingerprints, counts, .. } = prepared;
        let of = |(place, &setting): (usize, &Setting)| {
            let fingerprint = fingerprints[place].clone();
            Shards::new(&self.shard_folder(), setting, self.role, fingerprint, counts[place])
        };
        self.settings.iter().enumerate().map(of).collect()
    }

    /// Simulates the variants of the bundles whose rows no shard contains, unless cancelled.
    fn simulate(
        &self,
        prepared: &PreparedCampaign,
        bundles: Vec<Vec<usize>>,
        outcome: &mut CampaignOutcome,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        let simulated = self.simulate_rounds(prepared, bundles, outcome, progress);
        outcome.cancelled = matches!(simulated, Err(CampaignError::Cancelled));
        if outcome.cancelled { Ok(()) } else { simulated }
    }

    fn simulate_rounds(
        &self,
        prepared: &PreparedCampaign,
        mut bundles: Vec<Vec<usize>>,
        outcome: &mut CampaignOutcome,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        create_folder(self.shard_folder()).map_err(CampaignError::File)?;
        let shards = self.shards(prepared);
        let wanted = || bundles.iter().flatten().copied();
        let missing = shards.iter().map(|shards| shards.missing(wanted())).collect::<Vec<_>>();
        let of = |shards: &Shards, shard: usize| shards.variants_of(shard).len();
        let all = shards.iter().flat_map(|own| wanted().map(|shard| of(own, shard)));
        outcome.variants = all.sum();
        let both = shards.iter().zip(&missing);
        let open = both.flat_map(|(own, missing)| missing.iter().map(|&shard| of(own, shard)));
        outcome.resumed = outcome.variants - open.sum::<usize>();
        let is_pool = self.plants() == Plants::Pool;
        bundles.retain(|own| own.iter().any(|s| missing.iter().any(|open| open.contains(s))));
        let is_told = !is_pool || calibration_file(&self.folder, self.role).exists();
        if bundles.is_empty() && is_told {
            return Ok(());
        }
        let fitted = if is_pool { self.fitted_twins()? } else { vec![] };
        let mut done = outcome.resumed;
        for round in self.rounds(prepared, &bundles) {
            let pending = shards.iter().zip(&missing).map(|(own, missing)| {
                let open = round.iter().filter(|shard| missing.contains(shard));
                open.flat_map(|&shard| own.variants_of(shard)).collect()
            });
            let pending: Vec<Vec<usize>> = pending.collect();
            let jobs = self.hardest_first(prepared, &pending);
            let twins = self.twins(&prepared.plan, &jobs, &fitted)?;
            let collectors = shards.iter().zip(&pending);
            let collectors = collectors.map(|(s, p)| Collector::new(s, p)).collect();
            let run = Run { prepared, jobs: &jobs, twins: &twins };
            self.run_pending(&run, collectors, outcome, &mut done, progress)?;
        }
        Ok(())
    }

    /// Divides the shards of bundles into rounds; a round holds its twins and the rows of unfinished shards in memory.
    fn rounds(&self, prepared: &PreparedCampaign, bundles: &[Vec<usize>]) -> Vec<Vec<usize>> {
        let mut rounds: Vec<Vec<usize>> = vec![];
        let mut twins = BTreeSet::new();
        for bundle in bundles {
            let variants = bundle.iter().flat_map(|&shard| variants_of(shard, prepared.plan.len()));
            let own: BTreeSet<(usize, usize)> =
                variants.map(|variant| self.beside(variant, prepared.plan[variant])).collect();
            match rounds.last_mut() {
                Some(round)
                    if round.len() + bundle.len() <= self.round_shards
                        && twins.union(&own).count() <= ROUND_TWINS =>
                {
                    round.extend(bundle);
                    twins.extend(own);
                }
                _ => {
                    rounds.push(bundle.clone());
                    twins = own;
                }
            }
        }
        rounds
    }

    fn ensemble(&self) -> Ensemble<'_> {
        let Campaign { solver, threads, cancel, .. } = *self;
        Ensemble { settings: solver, threads, cancel, ..ensemble(self.study) }
    }

    /// The twin that a variant is compared with: its case, and its specimen in the pool (0 without a pool).
    fn beside(&self, variant: usize, planned: Planned) -> TwinKey {
        let both = self.study.realism.as_ref().zip(self.study.calibration.as_ref());
        let pool = both.filter(|_| self.plants() == Plants::Pool);
        let specimen = pool.map_or(0, |(realism, calibration)| {
            calibration.specimen(realism, self.role, planned.case, variant)
        });
        (planned.case, specimen)
    }

    /// Simulates the healthy twins of the variants, each with the fitted parameters of its specimen.
    fn twins(
        &self,
        plan: &[Planned],
        jobs: &[usize],
        fitted: &[Overrides],
    ) -> Result<Twins<TwinKey>, CampaignError> {
        let cases = self.cases();
        let twin = |(case, specimen): TwinKey| Variant {
            overrides: fitted.get(specimen).cloned().unwrap_or_default(),
            inputs: cases[case].inputs.iter().collect(),
            ..Variant::default()
        };
        let wanted = jobs.iter().map(|&variant| self.beside(variant, plan[variant])).collect();
        simulate_twins(&self.ensemble(), wanted, twin, |(case, _)| &cases[case].name)
    }

    /// The specimen that flies a variant: from the pool, or with the variant's number; 0 for one that equals its twin.
    fn specimen(&self, variant: usize, planned: Planned) -> SpecimenDraw<'_> {
        let number = match self.plants() {
            Plants::Twin => 0,
            Plants::Specimens => variant,
            Plants::Pool => return self.pooled(self.beside(variant, planned).1),
        };
        let (study, lot) = (self.study, self.role.into());
        SpecimenDraw { study, setting: self.first_setting(), lot, number }
    }

    fn variant(&self, index: usize, planned: Planned) -> Variant<'_> {
        let intensity = planned.intensity;
        let fault = planned.fault.map(|f| FaultAt { intensity, ..self.study.faults[f].at });
        Variant {
            faults: fault.into_iter().collect(),
            overrides: self.specimen(index, planned).parameters(),
            inputs: self.cases()[planned.case].inputs.iter().collect(),
            duration_s: Some(self.lasting_s(planned)),
            ..Variant::default()
        }
    }

    /// Duration of a variant, s. Healthy specimens, from which bands are learned, last as long as judged ones.
    fn lasting_s(&self, planned: Planned) -> f64 {
        planned.fault.map_or(self.study.duration_s, |_| self.duration_s())
    }

    fn run_pending(
        &self,
        run: &Run,
        mut collectors: Vec<Collector>,
        outcome: &mut CampaignOutcome,
        done: &mut usize,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        let stop = AtomicBool::new(false);
        let Run { prepared, jobs, twins } = *run;
        let ensemble = self.ensemble();
        ensemble.prepare(jobs.len());
        stop.store(self.is_cancelled(), Ordering::Relaxed);
        let ensemble = Ensemble { cancel: Some(&stop), ..ensemble };
        let (plan, scales) = (&prepared.plan, self.study.scales());
        let twin = |job: usize| &twins[&self.beside(jobs[job], plan[jobs[job]])];
        let all = outcome.variants;
        let mut error = None;
        progress(*done, all);
        let statistics = &mut outcome.statistics;
        ensemble.run(
            jobs.len(),
            |job| self.variant(jobs[job], plan[jobs[job]]),
            |job| self.watch(prepared, jobs[job], twin(job), &scales),
            |job, views, result| {
                if let Ok(work) = &result {
                    *statistics += *work;
                }
                let plant = (result.as_ref().ok(), self.lasting_s(plan[jobs[job]]));
                let effort = VariantEffort::of(plant, (twin(job), ensemble.duration_s));
                let failure = result.err().map(|f| describe(ensemble.program, &f));
                match self.keep(views, &failure.unwrap_or_default(), effort, &mut collectors) {
                    Ok(rows) => *done += rows,
                    Err(failed) => drop(error.get_or_insert(failed)),
                }
                if error.is_some() || self.is_cancelled() {
                    stop.store(true, Ordering::Relaxed);
                }
                progress(*done, all);
            },
        );
        match error {
            Some(error) => Err(error),
            None if self.is_cancelled() => Err(CampaignError::Cancelled),
            None => Ok(()),
        }
    }

    /// Stores the results of a simulation; returns the number of rows that were needed.
    fn keep(
        &self,
        views: Views,
        failure: &str,
        effort: VariantEffort,
        collectors: &mut [Collector],
    ) -> Result<usize, CampaignError> {
        let mut wanted = 0;
        for view in views.0.into_iter().map(|watch| watch.observer) {
            if let Some(trace) = view.trace {
                self.write_trace(self.settings[view.setting], view.variant, trace)?;
            }
            let row = ShardRow { failure: failure.into(), effort, window: view.window };
            wanted += usize::from(collectors[view.setting].add(view.variant, row)?);
        }
        Ok(wanted)
    }

    /// The variants to simulate, those with full intensity first: a few of them take a hundred times as long as the
    /// others, and would occupy a single lane at the end.
    fn hardest_first(
        &self,
        PreparedCampaign { plan, images, .. }: &PreparedCampaign,
        pending: &[Vec<usize>],
    ) -> Vec<usize> {
        let pending = pending.iter().flatten();
        let jobs: BTreeSet<usize> = pending.map(|&v| images.simulated(v)).collect();
        let is_full = |&variant: &usize| {
            plan[variant].fault.is_some_and(|f| self.study.faults[f].at.intensity >= 1.0)
        };
        let (mut order, rest): (Vec<usize>, Vec<usize>) = jobs.into_iter().partition(is_full);
        order.extend(rest);
        order
    }

    fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    }

    fn write_trace(
        &self,
        setting: Setting,
        variant: usize,
        trace: Vec<Vec<f64>>,
    ) -> Result<(), CampaignError> {
        let study = self.study;
        let folder = self.folder.join("traces");
        create_folder(&folder).map_err(CampaignError::File)?;
        let count = trace.first().map_or(0, Vec::len);
        let time = (0..count).map(|k| k as f64 * study.sample_period_s).collect();
        let mut columns = vec![Column::new("time_s", "s", Values::Float(time))];
        for (&sensor, values) in study.measured.iter().zip(trace) {
            let sensor = &study.system.sensors[sensor];
            let name = format!("{}{}", sensor.id, sensor.unit.suffix());
            columns.push(Column::new(name, sensor.unit.symbol(), Values::Float(values)));
        }
        let name = format!("{}{}-{variant:05}.parquet", setting.name(), self.role.suffix());
        Ok(table::write(folder.join(name), &Table::from_columns(columns)?)?)
    }
}

/// The case of a twin, and its specimen in the pool.
type TwinKey = (usize, usize);

/// Variants without stored rows, and the inputs for simulating them.
struct Run<'r> {
    prepared: &'r PreparedCampaign,
    jobs: &'r [usize],
    twins: &'r Twins<TwinKey>,
}
