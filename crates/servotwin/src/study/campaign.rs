//! The campaign: every fault under every operating case, on all cores, straight
//! into features.
//!
//! Variants are written in *shards*, each a Parquet file that appears when all
//! its variants have ended. A campaign that was interrupted skips the shards
//! that exist: because every variant is the same bits whenever it runs, the
//! result is the same bytes. Memory holds one window per lane and the rows of
//! unfinished shards; it does not grow with the length of runs.

use super::realism::Imperfection;
use super::{Setting, Study};
use crate::ensemble::{Ensemble, Sink, Variant};
use crate::files::{FileError, create_folder};
use crate::signal::random::Normals;
use crate::table::{self, Column, Table, TableError, Values};
use servotwin_diagnosis::features::{self, Feature};
use servotwin_diagnosis::residual::Window;
use servotwin_model::program::Slot;
use servotwin_model::solver::{Failure, Settings, Statistics};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Variants in one shard.
const SHARD: usize = 205;

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

/// What a campaign has done.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Variants in all.
    pub variants: usize,
    /// Variants that were found done.
    pub resumed: usize,
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

/// The virtual twin's signals in every operating case, sample by sample.
type Twin = Vec<Vec<f64>>;

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
        let pending = self.pending(&plan, &shards, &mut outcome)?;
        if !pending.is_empty() {
            let twins = self.twins()?;
            self.run_pending(&plan, &pending, &twins, &shards, &mut outcome, progress)?;
        }
        let cancelled = self.cancel.is_some_and(|c| c.load(Ordering::Relaxed));
        if cancelled {
            outcome.cancelled = true;
            return Ok((None, outcome));
        }
        let table = self.collect(&plan, &shards)?;
        let failures = self.failures(&table)?;
        outcome.failed = failures;
        let path = self.folder.join(format!("dataset-{}.parquet", self.setting.name()));
        table::write(&path, &table)?;
        Ok((Some(table), outcome))
    }

    fn shard_path(&self, shards: &Path, shard: usize) -> PathBuf {
        shards.join(format!("{}-{shard:04}.parquet", self.setting.name()))
    }

    /// What a shard must have been made from to be taken over.
    fn fingerprint(&self) -> String {
        let mut text = format!("{:?} {:?} ", self.setting, self.settings);
        text.push_str(&self.study.text);
        text.push_str(&self.study.system.text);
        text.push_str(env!("CARGO_PKG_VERSION"));
        format!("{:016x}", crate::study::campaign::hash(text.as_bytes()))
    }

    /// Variants that no usable shard holds.
    fn pending(
        &self,
        plan: &[Planned],
        shards: &Path,
        outcome: &mut Outcome,
    ) -> Result<Vec<usize>, CampaignError> {
        let fingerprint = self.fingerprint();
        let mut pending = Vec::new();
        for (shard, first) in (0..plan.len()).step_by(SHARD).enumerate() {
            let variants = first..(first + SHARD).min(plan.len());
            let path = self.shard_path(shards, shard);
            // A shard of another study, or one that cannot be read, is made anew.
            let done = path.exists()
                && table::read(&path).is_ok_and(|t| {
                    t.metadata.get("fingerprint") == Some(&fingerprint)
                        && t.row_count() == variants.len()
                });
            if done {
                outcome.resumed += variants.len();
            } else {
                pending.extend(variants);
            }
        }
        Ok(pending)
    }

    fn ensemble(&self) -> Ensemble<'_> {
        let program = &self.study.system.program;
        let slot = |&sensor: &usize| -> Slot {
            let name = &self.study.system.sensors[sensor].signal;
            program.observable(name).expect("a sensor's signal is an output").slot
        };
        Ensemble {
            settings: self.settings,
            threads: self.threads,
            record: self.study.measured.iter().map(slot).collect(),
            duration_s: self.study.duration_s,
            sample_period_s: self.study.sample_period_s,
            cancel: self.cancel,
            ..Ensemble::new(program)
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
            |_| Rows(Twin::with_capacity(ensemble.samples())),
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
        plan: &[Planned],
        pending: &[usize],
        twins: &[Twin],
        shards: &Path,
        outcome: &mut Outcome,
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<(), CampaignError> {
        let ensemble = self.ensemble();
        let observer = Observer::new(self);
        let mut collector = Collector { campaign: self, plan, shards, open: BTreeMap::new() };
        let mut error = None;
        let mut done = outcome.resumed;
        progress(done, plan.len());
        let statistics = &mut outcome.statistics;
        ensemble.run(
            pending.len(),
            |job| self.variant(pending[job], plan[pending[job]]),
            |job| observer.watch(pending[job], &twins[plan[pending[job]].case]),
            |job, watch, result| {
                if let Ok(work) = &result {
                    *statistics += *work;
                }
                done += 1;
                let row = Row::new(self, watch, result);
                if let Err(failed) = collector.add(pending[job], row) {
                    error.get_or_insert(failed);
                }
                progress(done, plan.len());
            },
        );
        match error {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    fn collect(&self, plan: &[Planned], shards: &Path) -> Result<Table, CampaignError> {
        let mut whole: Option<Table> = None;
        for shard in 0..plan.len().div_ceil(SHARD) {
            let part = table::read(self.shard_path(shards, shard))?;
            match &mut whole {
                None => whole = Some(part),
                Some(table) => table.append(part)?,
            }
        }
        Ok(whole.expect("at least one shard"))
    }

    fn failures(&self, table: &Table) -> Result<Vec<(usize, String)>, CampaignError> {
        let reasons = table.text("failure")?;
        let failed = reasons.iter().enumerate().filter(|(_, reason)| !reason.is_empty());
        Ok(failed.map(|(index, reason)| (index, reason.clone())).collect())
    }
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
        self.0.push(values.to_vec());
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
    noise: Option<Normals>,
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
        self.window.add(&self.measured, &self.twin[index], &self.observer.scales);
    }
}

/// What the data set holds of one variant.
struct Row {
    failure: String,
    features: Vec<f64>,
    mirrored: Vec<f64>,
    largest: f64,
    detectable: bool,
    deviates: bool,
    first_excursion_s: f64,
    trace: Option<Vec<Vec<f64>>>,
}

impl Row {
    fn new(campaign: &Campaign, watch: Watch, result: Result<Statistics, Failure>) -> Self {
        let sensors = &campaign.study.sensors;
        let compute = |window: &Window| {
            let mut values = Vec::new();
            for family in features::ALL {
                family.compute(sensors, window, &mut values);
            }
            values
        };
        let window = &watch.window;
        let mirrored = sensors.exchanged(0, 1).map(|order| compute(&window.reordered(&order)));
        let first = window.first_excursion();
        let period = campaign.study.sample_period_s;
        Self {
            failure: result.err().map(|f| campaign.describe(&f)).unwrap_or_default(),
            features: compute(window),
            mirrored: mirrored.unwrap_or_default(),
            largest: window.largest_of_all(),
            detectable: first.is_some(),
            deviates: window.deviates(),
            first_excursion_s: first.map_or(-1.0, |sample| sample as f64 * period),
            trace: watch.trace,
        }
    }
}

/// Gathers rows until a shard is complete.
struct Collector<'c> {
    campaign: &'c Campaign<'c>,
    plan: &'c [Planned],
    shards: &'c Path,
    open: BTreeMap<usize, BTreeMap<usize, Row>>,
}

impl Collector<'_> {
    fn add(&mut self, variant: usize, mut row: Row) -> Result<(), CampaignError> {
        if let Some(trace) = row.trace.take() {
            self.write_trace(variant, trace)?;
        }
        let shard = variant / SHARD;
        let rows = self.open.entry(shard).or_default();
        rows.insert(variant, row);
        let first = shard * SHARD;
        if rows.len() == SHARD.min(self.plan.len() - first) {
            let rows = self.open.remove(&shard).expect("just filled");
            let table = self.table(&rows);
            table::write(self.campaign.shard_path(self.shards, shard), &table)?;
        }
        Ok(())
    }

    fn write_trace(&self, variant: usize, trace: Vec<Vec<f64>>) -> Result<(), CampaignError> {
        let study = self.campaign.study;
        let folder = self.campaign.folder.join("traces");
        create_folder(&folder).map_err(CampaignError::File)?;
        let count = trace.first().map_or(0, Vec::len);
        let time = (0..count).map(|k| k as f64 * study.sample_period_s).collect();
        let mut columns = vec![Column::new("time_s", "s", Values::Float(time))];
        for (&sensor, values) in study.measured.iter().zip(trace) {
            let sensor = &study.system.sensors[sensor];
            let name = format!("{}{}", sensor.id, sensor.unit.suffix());
            columns.push(Column::new(name, sensor.unit.symbol(), Values::Float(values)));
        }
        let path = folder.join(format!("{}-{variant:05}.parquet", self.campaign.setting.name()));
        Ok(table::write(&path, &Table::from_columns(columns)?)?)
    }

    fn table(&self, rows: &BTreeMap<usize, Row>) -> Table {
        let mut columns = self.label_columns(rows);
        let float = |f: &dyn Fn(&Row) -> f64| Values::Float(rows.values().map(f).collect());
        let flag = |f: &dyn Fn(&Row) -> bool| Values::Flag(rows.values().map(f).collect());
        columns.push(Column::new("detectable", "", flag(&|r| r.detectable)));
        columns.push(Column::new("deviates", "", flag(&|r| r.deviates)));
        columns.push(Column::new("largest_residual", "", float(&|r| r.largest)));
        columns.push(Column::new("first_excursion_s", "s", float(&|r| r.first_excursion_s)));
        let failures = rows.values().map(|r| r.failure.clone()).collect();
        columns.push(Column::new("failure", "", Values::Text(failures)));
        for (index, feature) in data_features(self.campaign.study).iter().enumerate() {
            let name = &feature.feature.name;
            columns.push(Column::new(format!("f:{name}"), "", float(&|r| r.features[index])));
            if rows.values().all(|r| !r.mirrored.is_empty()) {
                columns.push(Column::new(format!("m:{name}"), "", float(&|r| r.mirrored[index])));
            }
        }
        let mut table = Table::from_columns(columns).expect("columns of one length, named apart");
        table.metadata.insert("fingerprint".into(), self.campaign.fingerprint());
        table.metadata.insert("study".into(), self.campaign.study.name.clone());
        table.metadata.insert("setting".into(), self.campaign.setting.name().into());
        table
    }

    fn label_columns(&self, rows: &BTreeMap<usize, Row>) -> Vec<Column> {
        let study = self.campaign.study;
        let fault = |variant: &usize| self.plan[*variant].fault.map(|f| &study.faults[f]);
        let text = |f: &dyn Fn(&usize) -> String| Values::Text(rows.keys().map(f).collect());
        let class = |v: &usize| fault(v).map(|f| &study.classes[f.class]);
        let case = |v: &usize| study.cases[self.plan[*v].case].name.clone();
        let seed = study.realism.as_ref().map_or(0, |r| r.seed as u32);
        let healthy = || "healthy".to_string();
        let variants = rows.keys().map(|&v| v as u32).collect();
        let intensity = rows.keys().map(|v| fault(v).map_or(0.0, |f| f.at.intensity)).collect();
        let actuator = |v: &usize| fault(v).map_or_else(healthy, |f| study.units[f.unit].clone());
        vec![
            Column::new("variant", "", Values::Unsigned(variants)),
            Column::new("case", "", text(&case)),
            Column::new("seed", "", Values::Unsigned(vec![seed; rows.len()])),
            Column::new("fault", "", text(&|v| fault(v).map_or_else(healthy, |f| f.id.clone()))),
            Column::new("kind", "", text(&|v| fault(v).map_or_else(healthy, |f| f.kind.clone()))),
            Column::new("intensity", "", Values::Float(intensity)),
            Column::new("actuator", "", text(&actuator)),
            Column::new(
                "command",
                "",
                text(&|v| class(v).map_or_else(healthy, |c| c.command.clone())),
            ),
            Column::new(
                "detail",
                "",
                text(&|v| class(v).map_or_else(healthy, |c| c.detail.clone())),
            ),
        ]
    }
}
