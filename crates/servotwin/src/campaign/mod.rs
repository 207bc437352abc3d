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

pub(crate) use calibration::Overrides;
pub use calibration::{Calibrated, Calibrating, Comparison, calibration_file, calibrations};
pub use columns::largest_column;
pub use data_set::{DataFeature, FOLDS, data_features};
pub use effort::Effort;
pub use missing::{MissingParts, MissingRows, missing_parts};
pub use part::{Part, runs};
pub use prepared::Prepared;
pub use shard::Row;

use crate::ensemble::{Ensemble, Rows, Variant};
use crate::files::{FileError, create_folder};
use crate::study::{
    Calibration, FaultCase, Lot, OperatingCase, Plants, Realism, Role, Section, Setting, Study,
};
use crate::table::{self, Column, Table, TableError, Values};
use images::Images;
use servotwin_model::program::{FaultAt, Slot};
use servotwin_model::solver::{Failure, Settings, Statistics};
use shard::{Collector, Shards, variants_of};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use watch::{Observer, Twin, Watch};

/// The format of shards; shards of another format are simulated again.
const SHARD_FORMAT: &str = "windows 3";

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
    pub solver: Settings,
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
pub struct Outcome {
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

/// Why a campaign failed or stopped.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// A folder or file could not be written.
    #[error(transparent)]
    File(FileError),
    /// A data set could not be read or written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The study has neither faults nor healthy specimens.
    #[error("the study has no faults: add [[classes]] with 'faults'")]
    NoVariants,
    /// The study lacks sections that a scenario needs.
    #[error("{}", lacking_sections(*.setting, .lacks))]
    NoSection {
        /// The scenario.
        setting: Setting,
        /// The missing sections.
        lacks: Vec<Section>,
    },
    /// A specimen's twin could not be fitted.
    #[error("the twin of specimen {specimen} cannot be fitted: {reason}")]
    Calibration {
        /// The specimen's index, from zero.
        specimen: usize,
        /// The reason.
        reason: String,
    },
    /// Data sets were requested of an incomplete campaign.
    #[error("{}", unfinished(*.missing, .damaged.as_deref()))]
    Unfinished {
        /// Number of missing variants.
        missing: usize,
        /// A damaged file that contains some of them.
        damaged: Option<PathBuf>,
    },
    /// The run was stopped.
    #[error("cancelled")]
    Cancelled,
    /// Symmetry was assumed, but the units are not alike.
    #[error("the actuators are not alike enough for variants to be shown by others")]
    NotAlike,
    /// The plants of `[flights.other_plant]` are impossible.
    #[error("the system is impossible with the kinds of [flights.other_plant]")]
    OtherPlant,
    /// The healthy twin could not be simulated.
    #[error("the healthy system cannot be simulated in case {case}: {reason}")]
    Twin {
        /// The name of the operating case.
        case: String,
        /// The reason.
        reason: String,
    },
}

impl CampaignError {
    /// The error for a study that lacks sections needed by a scenario.
    pub fn no_section(setting: Setting, study: &Study) -> Self {
        CampaignError::NoSection { setting, lacks: setting.lacks(study) }
    }
}

fn lacking_sections(setting: Setting, lacks: &[Section]) -> String {
    let names: Vec<String> = lacks.iter().map(|section| format!("[{}]", section.name)).collect();
    let examples: String = lacks.iter().map(|section| format!("\n  {}", section.example)).collect();
    format!(
        "the study lacks {}, which setting '{}' needs; for example, above its first section:{examples}",
        names.join(" and "),
        setting.name()
    )
}

fn unfinished(missing: usize, damaged: Option<&Path>) -> String {
    match damaged {
        Some(path) => format!(
            "{} is damaged: 'servotwin campaign' simulates its variants again ({missing} are missing)",
            path.display()
        ),
        None => format!(
            "{missing} variants of this study have not been simulated: run 'servotwin campaign'"
        ),
    }
}

/// An ensemble of the study's system that records the measured signals.
pub fn ensemble(study: &Study) -> Ensemble<'_> {
    let program = &study.system.program;
    let slot = |&sensor: &usize| -> Slot {
        let name = &study.system.sensors[sensor].signal;
        program.observable(name).expect("a sensor's signal is an output").slot
    };
    Ensemble {
        record: study.measured.iter().map(slot).collect(),
        duration_s: study.duration_s,
        sample_period_s: study.sample_period_s,
        ..Ensemble::of(&study.system)
    }
}

/// Describes why and where a run of a study's system ended early.
fn described(study: &Study, failure: &Failure) -> String {
    let state = &study.system.program.states()[failure.state].name;
    format!("{} at {:.4} s in {state}", failure.cause, failure.time_s)
}

impl<'s> Campaign<'s> {
    /// The campaign of one scenario with existing shards in a folder, with the default settings.
    pub fn stored(folder: &Path, study: &'s Study, setting: Setting, role: Role) -> Self {
        Campaign {
            study,
            role,
            settings: vec![setting],
            solver: Settings::campaign(),
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
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> Result<Outcome, CampaignError> {
        let mut prepared = self.prepared()?;
        let mut outcome = Outcome::default();
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
        self.settings.first().map_or(Plants::Twin, |setting| setting.plants())
    }

    fn shard_folder(&self) -> PathBuf {
        self.folder.join("shards")
    }

    fn shards(&self, prepared: &Prepared) -> Vec<Shards> {
        let Prepared { fingerprints, counts, .. } = prepared;
        let of = |(place, &setting): (usize, &Setting)| {
            let fingerprint = fingerprints[place].clone();
            Shards::new(&self.shard_folder(), setting, self.role, fingerprint, counts[place])
        };
        self.settings.iter().enumerate().map(of).collect()
    }

    /// Simulates the variants of the bundles whose rows no shard contains, round by round, unless cancelled.
    fn simulate(
        &self,
        prepared: &Prepared,
        mut bundles: Vec<Vec<usize>>,
        outcome: &mut Outcome,
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
        let Some(specimens) = (if is_pool { self.calibrated()? } else { Some(vec![]) }) else {
            outcome.cancelled = true;
            return Ok(());
        };
        let mut done = outcome.resumed;
        for round in self.rounds(prepared, &bundles) {
            let pending = shards.iter().zip(&missing).map(|(own, missing)| {
                let open = round.iter().filter(|shard| missing.contains(shard));
                open.flat_map(|&shard| own.variants_of(shard)).collect()
            });
            let pending: Vec<Vec<usize>> = pending.collect();
            let jobs = self.hardest_first(prepared, &pending);
            let twins = self.twins(&prepared.plan, &jobs, &specimens)?;
            if let (Some(twins), false) = (twins, self.is_cancelled()) {
                let collectors = shards.iter().zip(&pending);
                let collectors = collectors.map(|(s, p)| Collector::new(s, p)).collect();
                let run = Run { prepared, jobs: &jobs, twins: &twins };
                self.run_pending(&run, collectors, outcome, &mut done, progress)?;
            }
            if self.is_cancelled() {
                outcome.cancelled = true;
                break;
            }
        }
        Ok(())
    }

    /// Divides the shards of bundles into rounds; a round holds its twins and the rows of unfinished shards in memory.
    fn rounds(&self, prepared: &Prepared, bundles: &[Vec<usize>]) -> Vec<Vec<usize>> {
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
    fn beside(&self, variant: usize, planned: Planned) -> (usize, usize) {
        let Some((realism, calibration)) = self.pool() else { return (planned.case, 0) };
        (planned.case, calibration.specimen(realism, self.role, planned.case, variant))
    }

    /// The sections that define a pool; `None` in other scenarios.
    fn pool(&self) -> Option<(&Realism, &Calibration)> {
        let is_pool = self.plants() == Plants::Pool;
        let both = self.study.realism.as_ref().zip(self.study.calibration.as_ref());
        both.filter(|_| is_pool)
    }

    /// Simulates the healthy twins of the variants, each with the fitted parameters of its specimen; `None` if
    /// cancelled.
    fn twins(
        &self,
        plan: &[Planned],
        jobs: &[usize],
        specimens: &[Vec<(usize, usize, f64)>],
    ) -> Result<Option<Twins>, CampaignError> {
        let ensemble = self.ensemble();
        let cases = self.cases();
        let wanted: BTreeSet<(usize, usize)> =
            jobs.iter().map(|&variant| self.beside(variant, plan[variant])).collect();
        let wanted: Vec<(usize, usize)> = wanted.into_iter().collect();
        let mut twins = Twins::new();
        let mut failure = None;
        ensemble.run(
            wanted.len(),
            |twin| {
                let (case, specimen) = wanted[twin];
                Variant {
                    overrides: specimens.get(specimen).cloned().unwrap_or_default(),
                    inputs: cases[case].inputs.iter().collect(),
                    ..Variant::default()
                }
            },
            |_| Rows(Vec::with_capacity(ensemble.samples() * ensemble.record.len())),
            |twin, rows, result| match result {
                Ok(work) => {
                    let steps_per_s = effort::steps_per_s(&work, ensemble.duration_s);
                    let is_moving = work.unsettled > 0;
                    let twin_run = Twin { samples: rows.0, steps_per_s, is_moving };
                    twins.insert(wanted[twin], twin_run);
                }
                Err(error) => failure = Some((wanted[twin].0, self.describe(&error))),
            },
        );
        match failure {
            Some((case, reason)) => {
                Err(CampaignError::Twin { case: cases[case].name.clone(), reason })
            }
            None => Ok((twins.len() == wanted.len()).then_some(twins)),
        }
    }

    fn describe(&self, failure: &Failure) -> String {
        described(self.study, failure)
    }

    /// The specimen that flies a variant.
    fn specimen(&self, index: usize, planned: Planned) -> SpecimenOfVariant {
        let (number, overrides) = match (&self.study.realism, self.plants()) {
            (None, _) | (_, Plants::Twin) => (0, Vec::new()),
            (Some(realism), Plants::Specimens) => {
                (index, realism.specimen(self.study, self.role.into(), index))
            }
            (Some(realism), Plants::Pool) => {
                let (_, specimen) = self.beside(index, planned);
                (specimen, realism.specimen(self.study, Lot::pool(self.role), specimen))
            }
        };
        SpecimenOfVariant { number: number as u32, overrides }
    }

    fn variant(&self, index: usize, planned: Planned) -> Variant<'_> {
        let intensity = planned.intensity;
        let fault = planned.fault.map(|f| FaultAt { intensity, ..self.study.faults[f].at });
        Variant {
            faults: fault.into_iter().collect(),
            overrides: self.specimen(index, planned).overrides,
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
        outcome: &mut Outcome,
        done: &mut usize,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        let stop = AtomicBool::new(false);
        let Run { prepared, jobs, twins } = *run;
        let ensemble = self.ensemble();
        ensemble.prepare(jobs.len());
        stop.store(self.is_cancelled(), Ordering::Relaxed);
        let ensemble = Ensemble { cancel: Some(&stop), ..ensemble };
        let Prepared { plan, images, counts, .. } = prepared;
        let observer = Observer::new(self, images);
        let all = outcome.variants;
        let mut error = None;
        progress(*done, all);
        let statistics = &mut outcome.statistics;
        ensemble.run(
            jobs.len(),
            |job| self.variant(jobs[job], plan[jobs[job]]),
            |job| {
                let twin = &twins[&self.beside(jobs[job], plan[jobs[job]])];
                observer.watch(jobs[job], twin, counts)
            },
            |job, watch, result| {
                if let Ok(work) = &result {
                    *statistics += *work;
                }
                let duration_s = self.lasting_s(plan[jobs[job]]);
                let effort = Effort::of(result.as_ref().ok(), duration_s, watch.twin);
                let failure = result.err().map(|f| self.describe(&f)).unwrap_or_default();
                match self.keep(watch, &failure, effort, &mut collectors) {
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
            None => Ok(()),
        }
    }

    /// Stores the results of a simulation; returns the number of rows that were needed.
    fn keep(
        &self,
        watch: Watch,
        failure: &str,
        effort: Effort,
        collectors: &mut [Collector],
    ) -> Result<usize, CampaignError> {
        let mut wanted = 0;
        for view in watch.views {
            if let Some(trace) = view.trace {
                self.write_trace(self.settings[view.setting], view.variant, trace)?;
            }
            let row = Row { failure: failure.into(), effort, window: view.window };
            wanted += usize::from(collectors[view.setting].add(view.variant, row)?);
        }
        Ok(wanted)
    }

    /// The variants to simulate, those with full intensity first: a few of them take a hundred times as long as the
    /// others, and would occupy a single lane at the end.
    fn hardest_first(
        &self,
        Prepared { plan, images, .. }: &Prepared,
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

/// The specimen of a variant: its number in its lot, and the parameters that differ from the nominal ones.
struct SpecimenOfVariant {
    number: u32,
    overrides: Vec<(usize, usize, f64)>,
}

/// Twins by case and specimen ([`Campaign::beside`]).
type Twins = BTreeMap<(usize, usize), Twin>;

/// Variants without stored rows, and the inputs for simulating them.
struct Run<'r> {
    prepared: &'r Prepared,
    jobs: &'r [usize],
    twins: &'r Twins,
}
