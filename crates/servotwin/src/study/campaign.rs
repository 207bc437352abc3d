//! The campaign: every fault under every operating case, on all cores, straight
//! into features.
//!
//! Variants are written in *shards*, each a Parquet file that appears when all
//! its variants have ended. A campaign that was interrupted skips the shards
//! that exist: because every variant is the same bits whenever it runs, the
//! result is the same bytes. Memory holds one window per lane and the rows of
//! unfinished shards; it does not grow with the length of runs.
//!
//! A shard holds windows, not features: the data set is made from the shards,
//! so that features can be changed without simulating anything again.

use super::images::Images;
use super::realism::Imperfection;
use super::{Setting, Study};
use crate::ensemble::{Ensemble, Sink, Variant};
use crate::files::{FileError, create_folder};
use crate::signal::random::Random;
use crate::table::{self, Column, Table, TableError, Values};
use servotwin_diagnosis::features::{self, Feature};
use servotwin_diagnosis::residual::Window;
use servotwin_model::program::Slot;
use servotwin_model::solver::{Failure, Settings, Statistics};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Variants in one shard.
const SHARD: usize = 205;

/// What is in a shard; shards of another format are made anew.
const SHARD_FORMAT: &str = "windows 1";

/// What a campaign needs besides the study.
pub struct Campaign<'s> {
    /// The study.
    pub study: &'s Study,
    /// Ideal or realistic.
    pub setting: Setting,
    /// The solver's settings.
    pub settings: Settings,
    /// Number of threads.
    pub threads: usize,
    /// Where the files go.
    pub folder: PathBuf,
    /// Whether to keep the time series too.
    pub keep_traces: bool,
    /// Whether to simulate variants that are mirror images of others, too.
    pub simulate_images: bool,
    /// Set from elsewhere to stop.
    pub cancel: Option<&'s AtomicBool>,
}

/// One variant of the campaign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned {
    /// The operating case.
    pub case: usize,
    /// The fault; `None` for a healthy specimen.
    pub fault: Option<usize>,
}

/// Variants whose rows no shard holds.
struct Pending<'p> {
    plan: &'p [Planned],
    images: Option<&'p Images>,
    variants: &'p [usize],
}

/// What a campaign has done.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Variants in all.
    pub variants: usize,
    /// Variants that were found done.
    pub resumed: usize,
    /// Variants that are mirror images of simulated ones.
    pub images: usize,
    /// Work of those that ran now.
    pub statistics: Statistics,
    /// Variants that could not be finished, with the reason.
    pub failed: Vec<(usize, String)>,
    /// Whether it was stopped before the end.
    pub cancelled: bool,
}

/// Why a campaign stopped.
#[derive(Debug)]
pub enum CampaignError {
    /// A folder or file could not be written.
    File(FileError),
    /// A data set could not be read or written.
    Table(TableError),
    /// The study has neither faults nor healthy specimens.
    NoVariants,
    /// The study does not say what the realistic setting is.
    NoRealism,
    /// Features were asked for of a campaign that has not ended.
    Unfinished {
        /// Variants that are missing.
        missing: usize,
    },
    /// The healthy system could not be simulated.
    Twin {
        /// The operating case.
        case: String,
        /// Why.
        reason: String,
    },
}

impl fmt::Display for CampaignError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CampaignError::File(error) => write!(out, "{error}"),
            CampaignError::Table(error) => write!(out, "{error}"),
            CampaignError::NoVariants => {
                write!(out, "the study has no faults: add [[classes]] with 'faults'")
            }
            CampaignError::NoRealism => {
                write!(out, "the study has no [realistic] section for the realistic setting")
            }
            CampaignError::Unfinished { missing } => write!(
                out,
                "{missing} variants of this study have not been simulated: run 'servotwin campaign'"
            ),
            CampaignError::Twin { case, reason } => {
                write!(out, "the healthy system cannot be simulated in case {case}: {reason}")
            }
        }
    }
}

impl std::error::Error for CampaignError {}

impl From<TableError> for CampaignError {
    fn from(error: TableError) -> Self {
        CampaignError::Table(error)
    }
}

/// A feature of the data set.
#[derive(Clone, Debug, PartialEq)]
pub struct DataFeature {
    /// The feature.
    pub feature: Feature,
    /// The family that computes it.
    pub family: &'static str,
    /// Whether it needs the extra sensor.
    pub extra: bool,
}

/// All features of a study's data set, in the order of its columns.
pub fn data_features(study: &Study) -> Vec<DataFeature> {
    let base = features::Sensors(study.sensors.0[..study.base_sensors()].to_vec());
    let mut list = Vec::new();
    for family in features::ALL {
        let known = family.features(&base);
        for feature in family.features(&study.sensors) {
            let extra = !known.iter().any(|k| k.name == feature.name);
            list.push(DataFeature { feature, family: family.name(), extra });
        }
    }
    list
}

/// The study's system, recording what its sensors measure.
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
        ..Ensemble::new(program)
    }
}

/// The virtual twin's signals in an operating case, sample after sample.
type Twin = Vec<f64>;

impl Campaign<'_> {
    /// The variants, in the order of the data set.
    pub fn plan(&self) -> Vec<Planned> {
        let healthy = match (self.setting, &self.study.realism) {
            (Setting::Realistic, Some(realism)) => realism.healthy,
            _ => 0,
        };
        let mut plan = Vec::new();
        for case in 0..self.study.cases.len() {
            let faults = (0..self.study.faults.len()).map(Some);
            let all = faults.chain((0..healthy).map(|_| None));
            plan.extend(all.map(|fault| Planned { case, fault }));
        }
        plan
    }

    /// Runs what is not done yet and gives the data set, also written to
    /// `dataset-<setting>.parquet`. `progress` is told the variants done and
    /// their number.
    ///
    /// # Errors
    /// A file cannot be written, the study is empty, or the healthy system
    /// cannot be simulated. Single variants that fail are in the outcome.
    pub fn run(
        &self,
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<(Option<Table>, Outcome), CampaignError> {
        let plan = self.plan();
        if plan.is_empty() {
            return Err(CampaignError::NoVariants);
        }
        if self.setting == Setting::Realistic && self.study.realism.is_none() {
            return Err(CampaignError::NoRealism);
        }
        let shards = self.folder.join("shards");
        create_folder(&shards).map_err(CampaignError::File)?;
        let mut outcome = Outcome { variants: plan.len(), ..Outcome::default() };
        let mut images = self.images(&plan);
        loop {
            let rows = self.rows(&plan, images.as_ref(), &shards, &mut outcome, &progress)?;
            let Some(rows) = rows else { return Ok((None, outcome)) };
            if images.as_ref().is_some_and(|i| !i.hold(|variant| &rows[variant].window)) {
                images = None;
                continue;
            }
            return Ok((
                Some(self.write_data_set(&plan, &rows, images.as_ref(), &mut outcome)?),
                outcome,
            ));
        }
    }

    /// The variants that need not be simulated; `None` if all are.
    fn images(&self, plan: &[Planned]) -> Option<Images> {
        let wanted = self.setting == Setting::Ideal && !self.keep_traces && !self.simulate_images;
        Images::of(self.study, plan).filter(|_| wanted)
    }

    /// The rows of all variants, simulated where no shard holds them; `None` if
    /// cancelled.
    fn rows(
        &self,
        plan: &[Planned],
        images: Option<&Images>,
        shards: &Path,
        outcome: &mut Outcome,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<Option<Vec<Row>>, CampaignError> {
        let fingerprint = self.fingerprint(images.is_some());
        outcome.resumed = 0;
        let pending = self.pending(plan, shards, &fingerprint, outcome);
        if !pending.is_empty() {
            let twins = self.twins()?;
            let collector = Collector::new(shards, self.setting, fingerprint, &pending);
            let pending = Pending { plan, images, variants: &pending };
            self.run_pending(&pending, &twins, collector, outcome, progress)?;
        }
        if self.is_cancelled() {
            outcome.cancelled = true;
            return Ok(None);
        }
        Ok(Some(self.collect(plan, shards)?))
    }

    /// Makes the data set anew from the shards of a campaign that has ended.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if shards are missing; a file cannot be read or written.
    pub fn features(&self) -> Result<(Table, Outcome), CampaignError> {
        let plan = self.plan();
        let shards = self.folder.join("shards");
        let mut outcome = Outcome { variants: plan.len(), ..Outcome::default() };
        let images = self.images(&plan);
        let mut missing = plan.len();
        for with_images in [true, false] {
            let images = images.as_ref().filter(|_| with_images);
            let fingerprint = self.fingerprint(images.is_some());
            outcome.resumed = 0;
            missing = missing.min(self.pending(&plan, &shards, &fingerprint, &mut outcome).len());
            if missing == 0 && !plan.is_empty() {
                let rows = self.collect(&plan, &shards)?;
                return Ok((self.write_data_set(&plan, &rows, images, &mut outcome)?, outcome));
            }
        }
        Err(CampaignError::Unfinished { missing })
    }

    fn write_data_set(
        &self,
        plan: &[Planned],
        rows: &[Row],
        images: Option<&Images>,
        outcome: &mut Outcome,
    ) -> Result<Table, CampaignError> {
        let failed = rows.iter().enumerate().filter(|(_, row)| !row.failure.is_empty());
        outcome.failed = failed.map(|(index, row)| (index, row.failure.clone())).collect();
        outcome.images = images.map_or(0, Images::count);
        let table = self.table(plan, rows, images);
        let path = self.folder.join(format!("dataset-{}.parquet", self.setting.name()));
        table::write(&path, &table)?;
        Ok(table)
    }

    /// What a shard must have been made from to be taken over.
    fn fingerprint(&self, images: bool) -> String {
        let mut text = format!("{SHARD_FORMAT} {images} {:?} {:?} ", self.setting, self.settings);
        text.push_str(&self.study.text);
        text.push_str(&self.study.system.text);
        text.push_str(env!("CARGO_PKG_VERSION"));
        format!("{:016x}", hash(text.as_bytes()))
    }

    /// Variants that no usable shard holds.
    fn pending(
        &self,
        plan: &[Planned],
        shards: &Path,
        fingerprint: &String,
        outcome: &mut Outcome,
    ) -> Vec<usize> {
        let mut pending = Vec::new();
        for (shard, first) in (0..plan.len()).step_by(SHARD).enumerate() {
            let variants = first..(first + SHARD).min(plan.len());
            let path = shard_path(shards, self.setting, shard);
            // A shard of another study, or one that cannot be read, is made anew.
            let done = path.exists()
                && table::read(&path).is_ok_and(|t| {
                    t.metadata.get("fingerprint") == Some(fingerprint)
                        && t.row_count() == variants.len()
                });
            if done {
                outcome.resumed += variants.len();
            } else {
                pending.extend(variants);
            }
        }
        pending
    }

    fn ensemble(&self) -> Ensemble<'_> {
        Ensemble {
            settings: self.settings,
            threads: self.threads,
            cancel: self.cancel,
            ..ensemble(self.study)
        }
    }

    /// Runs the healthy system in every operating case.
    fn twins(&self) -> Result<Vec<Twin>, CampaignError> {
        let ensemble = self.ensemble();
        let cases = &self.study.cases;
        let mut twins = vec![Twin::new(); cases.len()];
        let mut failure = None;
        ensemble.run(
            cases.len(),
            |case| Variant { inputs: cases[case].inputs.iter().collect(), ..Variant::default() },
            |_| Rows(Twin::with_capacity(ensemble.samples() * ensemble.record.len())),
            |case, rows, result| match result {
                Ok(_) => twins[case] = rows.0,
                Err(error) => failure = Some((case, self.describe(&error))),
            },
        );
        match failure {
            Some((case, reason)) => {
                Err(CampaignError::Twin { case: cases[case].name.clone(), reason })
            }
            None => Ok(twins),
        }
    }

    fn describe(&self, failure: &Failure) -> String {
        let state = &self.study.system.program.states()[failure.state].name;
        format!("{} at {:.4} s in {state}", failure.cause, failure.time_s)
    }

    fn variant(&self, index: usize, planned: Planned) -> Variant<'_> {
        let fault = planned.fault.map(|f| self.study.faults[f].at);
        let overrides = match (self.setting, &self.study.realism) {
            (Setting::Realistic, Some(realism)) => realism.specimen(self.study, index),
            _ => Vec::new(),
        };
        Variant {
            faults: fault.into_iter().collect(),
            overrides,
            inputs: self.study.cases[planned.case].inputs.iter().collect(),
            guess: None,
        }
    }

    fn run_pending(
        &self,
        pending: &Pending,
        twins: &[Twin],
        mut collector: Collector,
        outcome: &mut Outcome,
        progress: &(impl Fn(usize, usize) + Sync),
    ) -> Result<(), CampaignError> {
        let stop = AtomicBool::new(false);
        let ensemble = Ensemble { cancel: Some(&stop), ..self.ensemble() };
        let Pending { plan, images, .. } = *pending;
        let jobs = self.hardest_first(pending);
        let observer = Observer::new(self);
        let mut error = None;
        let mut done = outcome.resumed;
        progress(done, plan.len());
        let statistics = &mut outcome.statistics;
        ensemble.run(
            jobs.len(),
            |job| self.variant(jobs[job], plan[jobs[job]]),
            |job| observer.watch(jobs[job], &twins[plan[jobs[job]].case]),
            |job, watch, result| {
                if let Ok(work) = &result {
                    *statistics += *work;
                }
                let variant = jobs[job];
                let row = Row::new(self, &watch, result);
                let written = match watch.trace {
                    Some(trace) => self.write_trace(variant, trace),
                    None => Ok(()),
                };
                if let Err(failed) = written {
                    error.get_or_insert(failed);
                }
                let image = images.and_then(|images| images.image_of(variant));
                let reflected = images.zip(image).map(|(images, image)| {
                    let window = images.reflected(&row.window);
                    (image, Row { failure: row.failure.clone(), window })
                });
                for (variant, row) in reflected.into_iter().chain([(variant, row)]) {
                    match collector.add(variant, row) {
                        Ok(wanted) => done += usize::from(wanted),
                        Err(failed) => drop(error.get_or_insert(failed)),
                    }
                }
                if error.is_some() || self.is_cancelled() {
                    stop.store(true, Ordering::Relaxed);
                }
                progress(done, plan.len());
            },
        );
        match error {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    /// The variants to simulate, those of full intensity first: a few of them take
    /// a hundred times as long as the others and would keep one lane busy at the
    /// end.
    fn hardest_first(&self, pending: &Pending) -> Vec<usize> {
        let Pending { plan, images, variants } = *pending;
        let simulated = |&v: &usize| images.map_or(v, |images| images.simulated(v));
        let jobs: BTreeSet<usize> = variants.iter().map(simulated).collect();
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

    /// The rows of all shards.
    fn collect(&self, plan: &[Planned], shards: &Path) -> Result<Vec<Row>, CampaignError> {
        let mut rows = Vec::with_capacity(plan.len());
        for shard in 0..plan.len().div_ceil(SHARD) {
            let path = shard_path(shards, self.setting, shard);
            rows.extend(Row::from_table(self.study, &table::read(&path)?)?);
        }
        Ok(rows)
    }

    fn write_trace(&self, variant: usize, trace: Vec<Vec<f64>>) -> Result<(), CampaignError> {
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
        let path = folder.join(format!("{}-{variant:05}.parquet", self.setting.name()));
        Ok(table::write(&path, &Table::from_columns(columns)?)?)
    }

    /// The data set: labels, detection, features.
    fn table(&self, plan: &[Planned], rows: &[Row], images: Option<&Images>) -> Table {
        let mut columns = self.label_columns(plan);
        let reflected = |variant| images.is_some_and(|i| i.simulated(variant) != variant);
        let reflected = Values::Flag((0..plan.len()).map(reflected).collect());
        columns.push(Column::new("reflected", "", reflected));
        let float = |f: &dyn Fn(&Window) -> f64| {
            Values::Float(rows.iter().map(|row| f(&row.window)).collect())
        };
        let flag = |f: &dyn Fn(&Window) -> bool| {
            Values::Flag(rows.iter().map(|row| f(&row.window)).collect())
        };
        let period = self.study.sample_period_s;
        let first = |w: &Window| w.first_excursion().map_or(-1.0, |sample| sample as f64 * period);
        columns.push(Column::new("detectable", "", flag(&|w| w.first_excursion().is_some())));
        columns.push(Column::new("deviates", "", flag(&Window::deviates)));
        columns.push(Column::new("largest_residual", "", float(&Window::largest_of_all)));
        columns.push(Column::new("first_excursion_s", "s", float(&first)));
        let failures = rows.iter().map(|row| row.failure.clone()).collect();
        columns.push(Column::new("failure", "", Values::Text(failures)));
        columns.extend(self.feature_columns(rows));
        let table = Table::from_columns(columns).expect("columns of one length, named apart");
        table
            .with_metadata("fingerprint", self.fingerprint(images.is_some()))
            .with_metadata("study", self.study.name.clone())
            .with_metadata("setting", self.setting.name())
    }

    /// Each feature, and where the units correspond also its mirror image.
    fn feature_columns(&self, rows: &[Row]) -> Vec<Column> {
        let sensors = &self.study.sensors;
        let own: Vec<Vec<f64>> = rows.iter().map(|row| computed(sensors, &row.window)).collect();
        let mirrored: Option<Vec<Vec<f64>>> = sensors.exchanged(0, 1).map(|order| {
            rows.iter().map(|row| computed(sensors, &row.window.reordered(&order))).collect()
        });
        let mut columns = Vec::new();
        for (index, feature) in data_features(self.study).iter().enumerate() {
            let mut push = |view: &str, rows: &[Vec<f64>]| {
                let values = rows.iter().map(|row| row[index]).collect();
                let name = format!("{view}:{}", feature.feature.name);
                columns.push(Column::new(name, "", Values::Float(values)));
            };
            push("f", &own);
            if let Some(mirrored) = &mirrored {
                push("m", mirrored);
            }
        }
        columns
    }

    fn label_columns(&self, plan: &[Planned]) -> Vec<Column> {
        let study = self.study;
        let fault = |planned: &Planned| planned.fault.map(|f| &study.faults[f]);
        let class = |planned: &Planned| fault(planned).map(|f| &study.classes[f.class]);
        let intensity = |planned: &Planned| fault(planned).map_or(0.0, |f| f.at.intensity);
        let healthy = "healthy";
        let seed = study.realism.as_ref().map_or(0, |r| r.seed as u32);
        let variants = (0..plan.len() as u32).collect();
        let case = texts(plan, |p| &study.cases[p.case].name);
        let id = texts(plan, |p| fault(p).map_or(healthy, |f| &f.id));
        let kind = texts(plan, |p| fault(p).map_or(healthy, |f| &f.kind));
        let actuator = texts(plan, |p| fault(p).map_or(healthy, |f| &study.units[f.unit]));
        let command = texts(plan, |p| class(p).map_or(healthy, |c| &c.command));
        let detail = texts(plan, |p| class(p).map_or(healthy, |c| &c.detail));
        let mut columns = vec![
            Column::new("variant", "", Values::Unsigned(variants)),
            Column::new("case", "", case),
            Column::new("seed", "", Values::Unsigned(vec![seed; plan.len()])),
            Column::new("fault", "", id),
            Column::new("kind", "", kind),
            Column::new("intensity", "", Values::Float(plan.iter().map(intensity).collect())),
            Column::new("actuator", "", actuator),
            Column::new("command", "", command),
            Column::new("detail", "", detail),
        ];
        // The form of the paper's figure 8: each fault's intensity in its own column.
        let ids: BTreeSet<&String> = study.faults.iter().map(|fault| &fault.id).collect();
        for id in ids {
            let of = |p: &Planned| {
                if fault(p).is_some_and(|f| &f.id == id) { intensity(p) } else { 0.0 }
            };
            let values = Values::Float(plan.iter().map(of).collect());
            columns.push(Column::new(format!("i:{id}"), "", values));
        }
        columns
    }
}

/// One text for each variant.
fn texts<'s>(plan: &[Planned], text: impl Fn(&Planned) -> &'s str) -> Values {
    Values::Text(plan.iter().map(|planned| text(planned).to_owned()).collect())
}

/// The features of a window, in the order of [`data_features`].
fn computed(sensors: &features::Sensors, window: &Window) -> Vec<f64> {
    let mut values = Vec::new();
    for family in features::ALL {
        family.compute(sensors, window, &mut values);
    }
    values
}

/// FNV-1a, for fingerprints of files: not for secrets.
pub(crate) fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Keeps all samples.
struct Rows(Twin);

impl Sink for Rows {
    fn sample(&mut self, _index: usize, values: &[f64]) {
        self.0.extend_from_slice(values);
    }
}

/// Makes the sinks of variants.
struct Observer<'c> {
    campaign: &'c Campaign<'c>,
    scales: Vec<f64>,
    imperfections: Vec<Imperfection>,
}

impl<'c> Observer<'c> {
    fn new(campaign: &'c Campaign<'c>) -> Self {
        let study = campaign.study;
        let imperfections = study.measured.iter().map(|&s| Imperfection::of(study, s)).collect();
        Self { campaign, scales: study.scales(), imperfections }
    }

    fn watch<'w>(&'w self, variant: usize, twin: &'w Twin) -> Watch<'w> {
        let study = self.campaign.study;
        let count = study.measured.len();
        let noise = match (self.campaign.setting, &study.realism) {
            (Setting::Realistic, Some(realism)) => Some(realism.noise(variant)),
            _ => None,
        };
        Watch {
            observer: self,
            window: Window::watching(count, study.base_sensors()),
            twin,
            noise,
            measured: vec![0.0; count],
            trace: self.campaign.keep_traces.then(|| vec![Vec::new(); count]),
        }
    }
}

/// Compares one variant's sensors with the twin's as the samples come.
struct Watch<'w> {
    observer: &'w Observer<'w>,
    window: Window,
    twin: &'w Twin,
    noise: Option<Random>,
    measured: Vec<f64>,
    trace: Option<Vec<Vec<f64>>>,
}

impl Sink for Watch<'_> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        self.measured.copy_from_slice(values);
        if let Some(noise) = &mut self.noise {
            for (value, imperfection) in self.measured.iter_mut().zip(&self.observer.imperfections)
            {
                *value = imperfection.apply(*value, noise);
            }
        }
        if let Some(trace) = &mut self.trace {
            for (column, &value) in trace.iter_mut().zip(&self.measured) {
                column.push(value);
            }
        }
        let count = values.len();
        let twin = &self.twin[index * count..][..count];
        self.window.add(&self.measured, twin, &self.observer.scales);
    }
}

/// What a shard holds of one variant.
struct Row {
    failure: String,
    window: Window,
}

impl Row {
    fn new(campaign: &Campaign, watch: &Watch, result: Result<Statistics, Failure>) -> Self {
        let failure = result.err().map(|f| campaign.describe(&f)).unwrap_or_default();
        Self { failure, window: watch.window.clone() }
    }

    /// The rows of a shard.
    fn from_table(study: &Study, table: &Table) -> Result<Vec<Self>, TableError> {
        let (sensors, watched) = (study.measured.len(), study.base_sensors());
        let count = Window::watching(sensors, watched).to_values().len();
        let columns = (0..count).map(|place| table.f64(&window_column(place)));
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        let failures = table.text("failure")?;
        let row = |(row, failure): (usize, &String)| {
            let values: Vec<f64> = columns.iter().map(|column| column[row]).collect();
            let window = Window::from_values(sensors, watched, &values);
            Row { failure: failure.clone(), window: window.expect("as many values as counted") }
        };
        Ok(failures.iter().enumerate().map(row).collect())
    }

    /// The shard of some rows.
    fn to_table(rows: &BTreeMap<usize, Row>) -> Result<Table, TableError> {
        let failures = rows.values().map(|row| row.failure.clone()).collect();
        let mut columns = vec![
            Column::new("variant", "", Values::Unsigned(rows.keys().map(|&v| v as u32).collect())),
            Column::new("failure", "", Values::Text(failures)),
        ];
        let values: Vec<Vec<f64>> = rows.values().map(|row| row.window.to_values()).collect();
        for place in 0..values.first().map_or(0, Vec::len) {
            let column = values.iter().map(|row| row[place]).collect();
            columns.push(Column::new(window_column(place), "", Values::Float(column)));
        }
        Table::from_columns(columns)
    }
}

/// The column of one of the window's values.
fn window_column(place: usize) -> String {
    format!("w:{place:03}")
}

fn shard_path(shards: &Path, setting: Setting, shard: usize) -> PathBuf {
    shards.join(format!("{}-{shard:04}.parquet", setting.name()))
}

/// Gathers rows until a shard is complete.
struct Collector<'c> {
    shards: &'c Path,
    setting: Setting,
    fingerprint: String,
    /// Rows that shards still wait for.
    missing: BTreeMap<usize, usize>,
    open: BTreeMap<usize, BTreeMap<usize, Row>>,
}

impl<'c> Collector<'c> {
    fn new(shards: &'c Path, setting: Setting, fingerprint: String, pending: &[usize]) -> Self {
        let mut missing = BTreeMap::new();
        for variant in pending {
            *missing.entry(variant / SHARD).or_default() += 1;
        }
        Self { shards, setting, fingerprint, missing, open: BTreeMap::new() }
    }

    /// Takes a row; `false` if its shard is there already.
    fn add(&mut self, variant: usize, row: Row) -> Result<bool, CampaignError> {
        let shard = variant / SHARD;
        let Some(missing) = self.missing.get_mut(&shard) else { return Ok(false) };
        *missing -= 1;
        let complete = *missing == 0;
        self.open.entry(shard).or_default().insert(variant, row);
        if complete {
            self.missing.remove(&shard);
            let rows = self.open.remove(&shard).expect("just filled");
            let table =
                Row::to_table(&rows)?.with_metadata("fingerprint", self.fingerprint.clone());
            table::write(shard_path(self.shards, self.setting, shard), &table)?;
        }
        Ok(true)
    }
}
