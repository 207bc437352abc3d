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
        let pending = self.pending(&plan, &shards, &mut outcome)?;
        if !pending.is_empty() {
            let twins = self.twins()?;
            self.run_pending(&plan, &pending, &twins, &shards, &mut outcome, progress)?;
        }
        if self.is_cancelled() {
            outcome.cancelled = true;
            return Ok((None, outcome));
        }
        Ok((Some(self.write_data_set(&plan, &shards, &mut outcome)?), outcome))
    }

    /// Makes the data set anew from the shards of a campaign that has ended.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if shards are missing; a file cannot be read or written.
    pub fn features(&self) -> Result<(Table, Outcome), CampaignError> {
        let plan = self.plan();
        let shards = self.folder.join("shards");
        let mut outcome = Outcome { variants: plan.len(), ..Outcome::default() };
        let missing = self.pending(&plan, &shards, &mut outcome)?.len();
        if missing > 0 || plan.is_empty() {
            return Err(CampaignError::Unfinished { missing });
        }
        Ok((self.write_data_set(&plan, &shards, &mut outcome)?, outcome))
    }

    fn write_data_set(
        &self,
        plan: &[Planned],
        shards: &Path,
        outcome: &mut Outcome,
    ) -> Result<Table, CampaignError> {
        let rows = self.collect(plan, shards)?;
        let failed = rows.iter().enumerate().filter(|(_, row)| !row.failure.is_empty());
        outcome.failed = failed.map(|(index, row)| (index, row.failure.clone())).collect();
        let table = self.table(plan, &rows);
        let path = self.folder.join(format!("dataset-{}.parquet", self.setting.name()));
        table::write(&path, &table)?;
        Ok(table)
    }

    fn shard_path(&self, shards: &Path, shard: usize) -> PathBuf {
        shards.join(format!("{}-{shard:04}.parquet", self.setting.name()))
    }

    /// What a shard must have been made from to be taken over.
    fn fingerprint(&self) -> String {
        let mut text = format!("{SHARD_FORMAT} {:?} {:?} ", self.setting, self.settings);
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
        plan: &[Planned],
        pending: &[usize],
        twins: &[Twin],
        shards: &Path,
        outcome: &mut Outcome,
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<(), CampaignError> {
        let stop = AtomicBool::new(false);
        let ensemble = Ensemble { cancel: Some(&stop), ..self.ensemble() };
        let pending = self.hardest_first(plan, pending);
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
                let row = Row::new(self, &watch, result);
                let written = match watch.trace {
                    Some(trace) => self.write_trace(pending[job], trace),
                    None => Ok(()),
                };
                if let Err(failed) = written {
                    error.get_or_insert(failed);
                }
                if let Err(failed) = collector.add(pending[job], row) {
                    error.get_or_insert(failed);
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

    /// The same variants, those of full intensity first: a few of them take a
    /// hundred times as long as the others and would keep one lane busy at the end.
    fn hardest_first(&self, plan: &[Planned], pending: &[usize]) -> Vec<usize> {
        let is_full = |&variant: &usize| {
            plan[variant].fault.is_some_and(|f| self.study.faults[f].at.intensity >= 1.0)
        };
        let (mut order, rest): (Vec<usize>, Vec<usize>) = pending.iter().partition(|v| is_full(v));
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
            let path = self.shard_path(shards, shard);
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
    fn table(&self, plan: &[Planned], rows: &[Row]) -> Table {
        let mut columns = self.label_columns(plan);
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
            .with_metadata("fingerprint", self.fingerprint())
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
        let healthy = "healthy";
        let seed = study.realism.as_ref().map_or(0, |r| r.seed as u32);
        let variants = (0..plan.len() as u32).collect();
        let intensity = plan.iter().map(|p| fault(p).map_or(0.0, |f| f.at.intensity)).collect();
        let case = texts(plan, |p| &study.cases[p.case].name);
        let id = texts(plan, |p| fault(p).map_or(healthy, |f| &f.id));
        let kind = texts(plan, |p| fault(p).map_or(healthy, |f| &f.kind));
        let actuator = texts(plan, |p| fault(p).map_or(healthy, |f| &study.units[f.unit]));
        let command = texts(plan, |p| class(p).map_or(healthy, |c| &c.command));
        let detail = texts(plan, |p| class(p).map_or(healthy, |c| &c.detail));
        vec![
            Column::new("variant", "", Values::Unsigned(variants)),
            Column::new("case", "", case),
            Column::new("seed", "", Values::Unsigned(vec![seed; plan.len()])),
            Column::new("fault", "", id),
            Column::new("kind", "", kind),
            Column::new("intensity", "", Values::Float(intensity)),
            Column::new("actuator", "", actuator),
            Column::new("command", "", command),
            Column::new("detail", "", detail),
        ]
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

/// Gathers rows until a shard is complete.
struct Collector<'c> {
    campaign: &'c Campaign<'c>,
    plan: &'c [Planned],
    shards: &'c Path,
    open: BTreeMap<usize, BTreeMap<usize, Row>>,
}

impl Collector<'_> {
    fn add(&mut self, variant: usize, row: Row) -> Result<(), CampaignError> {
        let shard = variant / SHARD;
        let rows = self.open.entry(shard).or_default();
        rows.insert(variant, row);
        let first = shard * SHARD;
        if rows.len() == SHARD.min(self.plan.len() - first) {
            let rows = self.open.remove(&shard).expect("just filled");
            let fingerprint = self.campaign.fingerprint();
            let table = Row::to_table(&rows)?.with_metadata("fingerprint", fingerprint);
            table::write(self.campaign.shard_path(self.shards, shard), &table)?;
        }
        Ok(())
    }
}
