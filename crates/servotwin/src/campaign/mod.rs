//! The campaign: simulates every fault in every operating case on all cores, directly into windows.
//!
//! One simulation serves all scenarios with the same plants ([`Scenario::groups`]), and all healthy specimens of a case
//! that differ by the noise of their sensors alone.
//!
//! Variants are written in *parts*. A part is a Parquet file that appears when all its variants have ended. A resumed
//! campaign skips existing parts. Every variant has the same bits whenever it runs, so the result has the same bytes.
//! Parts are simulated in rounds and joined one after the other. Memory holds the twins of a round, its open lanes and
//! unfinished parts, and about 40 bytes of the plan for every variant; it does not grow with the length of faulty runs.
//!
//! A part contains windows, not features. The data set is made from the parts, so features can be changed without new
//! simulations.

mod calibration;
pub mod columns;
mod data_set;
mod effort;
mod join;
mod missing;
mod part;
mod prepared;
mod runner;

pub use crate::run::{CampaignError, ensemble};
pub use calibration::{Comparison, calibration_file, calibrations};
pub use columns::largest_column;
pub use data_set::{DataFeature, FOLDS, data_features};
pub use effort::VariantEffort;
pub use missing::{MissingParts, MissingRows, missing_parts};
pub use part::{PARTS, PartRow, Share};
pub use prepared::PreparedCampaign;

use crate::ensemble::{Ensemble, Variant};
use crate::files::create_folder;
use crate::run::{Overrides, SpecimenDraw, Twins, simulate_twins};
use crate::study::{FaultCase, OperatingCase, Plants, Role, Scenario, Seed, Study};
use crate::table::{self, Column, Table, Values};
use servotwin_model::program::FaultAt;
use servotwin_model::solver::{SolverSettings, Statistics};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// The settings of a campaign.
pub struct Campaign<'s> {
    /// The study to simulate.
    pub study: &'s Study,
    /// Whether the diagnosis is judged on it or trained on it.
    pub role: Role,
    /// The scenarios, one of the groups of [`Scenario::groups`].
    pub scenarios: Vec<Scenario>,
    /// The solver's settings.
    pub solver: SolverSettings,
    /// The number of worker threads.
    pub threads: usize,
    /// The output folder.
    pub folder: PathBuf,
    /// Whether to store the time series as well.
    pub keep_traces: bool,
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
    /// Number of healthy specimens in one scenario that differ from a simulated one only by sensor noise.
    pub alike: usize,
    /// The solver's work in this run.
    pub statistics: Statistics,
    /// Variants that failed, with the reason.
    pub failed: Vec<(Scenario, usize, String)>,
    /// Variants that began without a steady state, in every scenario.
    pub on_the_move: Vec<OnTheMove>,
    /// Whether it was stopped early.
    pub cancelled: bool,
}

/// A variant for which, or for whose twin, no steady state was found.
#[derive(Clone, Debug, PartialEq)]
pub struct OnTheMove {
    /// The scenario.
    pub scenario: Scenario,
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
        let OnTheMove { scenario, variant, fault, case, limit_cycle } = self;
        let why = if *limit_cycle { "limit cycle measured" } else { "no steady state found" };
        write!(out, "{} variant {variant} ({fault}, {case}): {why}", scenario.name())
    }
}

/// The campaigns of a study: training commands and judged cases for each group of scenarios.
pub fn runs(study: &Study, choice: impl Fn(Scenario) -> bool) -> Vec<(Role, Vec<Scenario>)> {
    let groups = Scenario::groups(study, choice).into_iter();
    let of =
        |scenarios: Vec<Scenario>| study.roles().into_iter().map(move |r| (r, scenarios.clone()));
    groups.flat_map(of).collect()
}

impl<'s> Campaign<'s> {
    /// The campaign of one scenario with existing parts in a folder, with the default settings.
    pub fn stored(folder: &Path, study: &'s Study, scenario: Scenario, role: Role) -> Self {
        Campaign {
            study,
            role,
            scenarios: vec![scenario],
            solver: SolverSettings::campaign(),
            threads: 1,
            folder: folder.into(),
            keep_traces: false,
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
        if self.scenarios.iter().any(|scenario| scenario.has_noise()) {
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
        let prepared = self.prepared()?;
        let all: Vec<usize> = (0..prepared.part_count()).collect();
        let mut outcome = self.run_parts(&prepared, &all, progress)?;
        if !outcome.cancelled {
            self.write_data_sets(&prepared, &mut outcome)?;
        }
        Ok(outcome)
    }

    /// Simulates a share of the parts, and writes no data set. `parts_before` is the number of parts in the study's
    /// earlier campaigns. Returns the number of parts of this campaign.
    ///
    /// # Errors
    /// See [`Campaign::run`].
    pub fn run_share(
        &self,
        share: Share,
        parts_before: usize,
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<(CampaignOutcome, usize), CampaignError> {
        let prepared = self.prepared()?;
        let count = prepared.part_count();
        let own: Vec<usize> = (0..count).filter(|part| share.holds(parts_before + part)).collect();
        Ok((self.run_parts(&prepared, &own, progress)?, count))
    }

    /// How plants and twins are paired, common to all scenarios of a group.
    fn plants(&self) -> Plants {
        self.first_setting().plants()
    }

    fn first_setting(&self) -> Scenario {
        self.scenarios.first().copied().unwrap_or(Scenario::Ideal)
    }

    fn ensemble(&self) -> Ensemble<'_> {
        let Campaign { solver, threads, cancel, .. } = *self;
        Ensemble { settings: solver, threads, cancel, ..ensemble(self.study) }
    }

    /// The twin that a variant is compared with: its case, and its specimen in the pool (0 without a pool).
    fn beside(&self, variant: usize, planned: Planned) -> TwinKey {
        let pool = self.study.calibration.as_ref().filter(|_| self.plants() == Plants::Pool);
        let specimen = pool.map_or(0, |calibration| {
            calibration.specimen(self.role, planned.case, self.seed_of(variant))
        });
        (planned.case, specimen)
    }

    /// Simulates the healthy twins of the variants, each with the fitted parameters of its specimen.
    fn twins(
        &self,
        wanted: BTreeSet<TwinKey>,
        fitted: &[Overrides],
    ) -> Result<Twins<TwinKey>, CampaignError> {
        let cases = self.cases();
        let twin = |(case, specimen): TwinKey| Variant {
            overrides: fitted.get(specimen).cloned().unwrap_or_default(),
            inputs: cases[case].inputs.iter().collect(),
            ..Variant::default()
        };
        simulate_twins(&self.ensemble(), wanted, twin, |(case, _)| &cases[case].name)
    }

    /// The specimen that flies a variant: from the pool, or of the variant itself.
    fn specimen(&self, variant: usize, planned: Planned) -> SpecimenDraw<'_> {
        match self.plants() {
            Plants::Pool => self.pooled(self.beside(variant, planned).1),
            _ => self.draw(self.first_setting(), variant),
        }
    }

    /// The number of the specimen that flies a variant; 0 for one that equals its twin.
    fn specimen_number(&self, variant: usize, planned: Planned) -> usize {
        match self.plants() {
            Plants::Twin => 0,
            Plants::Specimens => variant,
            Plants::Pool => self.beside(variant, planned).1,
        }
    }

    /// The random numbers of a variant in a scenario.
    fn draw(&self, scenario: Scenario, variant: usize) -> SpecimenDraw<'_> {
        SpecimenDraw { study: self.study, scenario, seed: self.seed_of(variant) }
    }

    fn seed_of(&self, variant: usize) -> Seed {
        self.study.seed_of(self.role.draws(), variant)
    }

    fn variant(&self, index: usize, planned: Planned) -> Variant<'_> {
        let intensity = planned.intensity;
        let fault = planned.fault.map(|f| FaultAt { intensity, ..self.study.faults[f].at });
        Variant {
            faults: fault.into_iter().collect(),
            overrides: self.specimen(index, planned).parameters(1.0),
            inputs: self.cases()[planned.case].inputs.iter().collect(),
            duration_s: Some(self.lasting_s(planned)),
            ..Variant::default()
        }
    }

    /// Duration of a variant, s. Healthy specimens, from which bands are learned, last as long as judged ones.
    fn lasting_s(&self, planned: Planned) -> f64 {
        planned.fault.map_or(self.study.duration_s, |_| self.duration_s())
    }

    fn write_trace(
        &self,
        scenario: Scenario,
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
        let name = format!("{}{}-{variant:05}.parquet", scenario.name(), self.role.suffix());
        Ok(table::write(folder.join(name), &Table::from_columns(columns)?)?)
    }
}

/// The case of a twin, and its specimen in the pool.
type TwinKey = (usize, usize);
