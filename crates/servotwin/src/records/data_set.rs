//! The data set of records: labels, plant, recommended split, detection and features, one row per variant.
//!
//! The recommended split is the protocol *new command*: the training commands teach, the judged ones test. Beside it
//! every row has a fold. All rows of a kind of fault at an intensity have the same fold, in every data set of a study, so
//! that a fault held out of training is held out under every command and in both actuators.

use super::columns::{DIMENSIONLESS, Shown, fault_columns, feature_columns, largest_columns, seen};
use super::effort::effort_columns;
use super::{PartRow, Records, Scenario, SpecimenDraw, Study};
use crate::run::{Run, fitted_specimen, plan};
use crate::study::{Plants, Purpose};
use crate::table::{Column, Table, Values};
use servotwin_diagnosis::features::{self, Feature};
use servotwin_diagnosis::residual::Window;
use std::collections::BTreeSet;

/// Number of folds of the recommended split.
pub const FOLDS: usize = 5;

/// The fold that tests where a study has no training commands.
const TESTED_FOLD: usize = 0;

/// A feature of the data set.
#[derive(Clone, Debug, PartialEq)]
pub struct DataFeature {
    /// The feature with its name and unit.
    pub feature: Feature,
    /// The family that computes it.
    pub family: &'static str,
    /// Whether it needs the study's extra sensor.
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
            list.push(DataFeature { feature, family: family.name, extra });
        }
    }
    list
}

/// The inputs for making a data set, some variants after the other.
pub(super) struct Maker<'m> {
    pub(crate) records: &'m Records<'m>,
    pub(crate) scenario: Scenario,
}

impl Maker<'_> {
    /// The data set of some variants with the given rows.
    pub(crate) fn table(&self, variants: &[usize], rows: &[PartRow]) -> Table {
        let run = |&number: &usize| plan::run(self.records.study, &self.records.suite, number);
        let runs: Vec<Run> = variants.iter().map(run).collect();
        let mut columns = self.label_columns(&runs);
        columns.extend(self.plant_columns(&runs));
        columns.extend(self.split_columns(&runs));
        columns.extend(self.detection_columns(rows));
        columns.extend(effort_columns(&rows.iter().map(|row| row.effort).collect::<Vec<_>>()));
        let failures = rows.iter().map(|row| row.failure.clone()).collect();
        columns.push(text("failure", failures, "Why the simulation ended early, empty otherwise."));
        columns.extend(self.feature_columns(rows));
        Table::from_columns(columns).expect("columns of one length, named apart")
    }

    fn detection_columns(&self, rows: &[PartRow]) -> Vec<Column> {
        let study = self.records.study;
        let float = |f: &dyn Fn(&Window) -> f64| rows.iter().map(|row| f(&row.window)).collect();
        let flags = |f: &dyn Fn(&Window) -> bool| rows.iter().map(|row| f(&row.window)).collect();
        let period = study.sample_period_s;
        let first = |w: &Window| w.first_excursion().map_or(-1.0, |sample| sample as f64 * period);
        let detectable = flags(&|w| w.first_excursion().is_some());
        let deviates = flags(&Window::deviates);
        let mut columns = vec![
            flag("detectable", detectable, "Some |r'| left the band of 3 % (equation 4)."),
            flag("deviates", deviates, "Mean or deviation left the band of equation 7."),
            number("largest_residual", DIMENSIONLESS, float(&Window::largest_of_all), LARGEST),
            number("first_excursion_s", "s", float(&first), FIRST_EXCURSION),
        ];
        let sensors = &study.sensors.0[..study.base_sensors()];
        let windows: Vec<&Window> = rows.iter().map(|row| &row.window).collect();
        columns.extend(largest_columns(sensors, &windows));
        columns
    }

    /// Each feature, and if the actuators correspond, also as seen from the other actuators.
    fn feature_columns(&self, rows: &[PartRow]) -> Vec<Column> {
        let study = self.records.study;
        let sensors = &study.sensors_in(self.scenario);
        let orders = sensors.rotations(study.actuators.len()).unwrap_or_default();
        let rows: Vec<_> = rows.iter().map(|row| seen(sensors, &orders, &row.window)).collect();
        let features = data_features(study);
        feature_columns(features.iter().map(|known| &known.feature), &rows)
    }

    fn label_columns(&self, runs: &[Run]) -> Vec<Column> {
        let study = self.records.study;
        let cases = study.cases_of(self.records.suite.purpose);
        let seed = study.seed as u32;
        let variants = runs.iter().map(|run| run.number as u32).collect();
        let of_case = |name: &str, of: &dyn Fn(usize) -> String, what: &str| {
            text(name, runs.iter().map(|run| of(run.environment)).collect(), what)
        };
        let mut columns = vec![
            whole("variant", variants, "Number of the variant, in the order of the plan."),
            of_case("case", &|case| cases[case].name.clone(), "Operating case: command and load."),
            of_case("flown", &|case| cases[case].command.clone(), "Command of the case."),
        ];
        if let Some((input, column)) = load_column(study) {
            let load = |run: &Run| cases[run.environment].inputs[input].value(0.0);
            columns.push(column.with_values(runs.iter().map(load).collect::<Vec<f64>>()));
        }
        columns.push(whole("seed", vec![seed; runs.len()], "Seed of noise and specimens."));
        let shown = |run: &Run| Shown { fault: run.fault, intensity: run.intensity };
        columns.extend(fault_columns(study, &runs.iter().map(shown).collect::<Vec<_>>()));
        // The form of the paper's figure 8: one column per fault with its intensity.
        let ids: BTreeSet<&String> = study.faults.iter().map(|fault| &fault.id).collect();
        for id in ids {
            let is_it = |run: &Run| run.fault.is_some_and(|fault| &study.faults[fault].id == id);
            let of = |run: &Run| if is_it(run) { run.intensity } else { 0.0 };
            let values = runs.iter().map(of).collect();
            let what = format!("Label: intensity of the fault {id}, 0 in all other rows.");
            columns.push(number(&format!("i:{id}"), DIMENSIONLESS, values, &what));
        }
        columns
    }

    /// The specimens of the plants, and their own parameters: every parameter with a tolerance.
    fn plant_columns(&self, runs: &[Run]) -> Vec<Column> {
        let Records { study, suite, .. } = self.records;
        let specimen = |run: &Run| match self.scenario.plants() {
            Plants::Twin => 0,
            Plants::Specimens | Plants::Pool => self.specimen(run) as u32,
        };
        let own = |run: &Run| SpecimenDraw::of(study, suite, self.scenario, run).parameters(1.0);
        let numbers: Vec<u32> = runs.iter().map(specimen).collect();
        let parameters: Vec<_> = runs.iter().map(own).collect();
        let mut columns = vec![whole("specimen", numbers, SPECIMEN)];
        for (component, parameter) in toleranced(study) {
            let instance = &study.system.network().components[component];
            let declared = &instance.component.parameters[parameter];
            let nominal = instance.parameters[parameter];
            let value = |overrides: &[(usize, usize, f64)]| {
                let is_it = |&&(c, p, _): &&(usize, usize, f64)| (c, p) == (component, parameter);
                overrides.iter().rev().find(is_it).map_or(nominal, |&(_, _, value)| value)
            };
            let values = parameters.iter().map(|parameters| value(parameters)).collect();
            let unit = symbol_or_one(declared.unit.symbol());
            let what = format!("Specimen's parameter, without its fault: {}.", declared.summary);
            let name = format!("p:{}.{}", instance.id, declared.name);
            columns.push(number(&name, unit, values, &what));
        }
        columns
    }

    /// The number of a run's specimen: in the pool, or without one that of the run.
    fn specimen(&self, run: &Run) -> usize {
        fitted_specimen(self.records.study, &self.records.suite, self.scenario, run)
            .unwrap_or(run.number)
    }

    fn split_columns(&self, runs: &[Run]) -> Vec<Column> {
        let Records { study, suite, .. } = self.records;
        let faults = study.faults.iter();
        let kinds: BTreeSet<&str> = faults.map(|fault| fault.kind.as_str()).collect();
        let folds: Vec<u32> = runs.iter().map(|run| self.fold(run, &kinds) as u32).collect();
        let has_training = !study.cases_of(Purpose::Train).is_empty();
        let teaches = |fold: u32| match has_training {
            true => suite.purpose == Purpose::Train,
            false => fold as usize != TESTED_FOLD,
        };
        let split = |&fold: &u32| if teaches(fold) { "train" } else { "test" }.to_owned();
        let split = folds.iter().map(split).collect();
        vec![text("split", split, SPLIT), whole("fold", folds, FOLD)]
    }

    /// The fold of a run. Rows of one kind and intensity share it; healthy rows of one specimen do.
    fn fold(&self, run: &Run, kinds: &BTreeSet<&str>) -> usize {
        let study = self.records.study;
        let Some(fault) = run.fault.map(|fault| &study.faults[fault]) else {
            return self.specimen(run) % FOLDS;
        };
        let kind = kinds.iter().position(|kind| *kind == fault.kind).unwrap_or(0);
        let same = |intensity: &f64| *intensity == fault.at.intensity;
        let intensity = study.intensities.iter().position(same).unwrap_or(0);
        (kind + intensity) % FOLDS
    }
}

const LARGEST: &str = "Largest |r'| of all sensors, as a part of scale.";
const FIRST_EXCURSION: &str = "Time at which some |r'| first left the band, -1 for never.";
const SPECIMEN: &str =
    "Number of the plant's specimen: in `fitted` in the pool, in `realistic` the variant, else 0.";
const SPLIT: &str = "Recommended split: train or test.";
const FOLD: &str = "Fold from 0 to 4. All rows of a kind of fault at an intensity share it.";

/// The parameters that have a tolerance, as component and parameter, each once and in the order of the study.
fn toleranced(study: &Study) -> Vec<(usize, usize)> {
    let mut list = vec![];
    let tolerances = study.realism.as_ref().map_or(&[][..], |realism| realism.tolerances());
    for &at in tolerances.iter().flat_map(|tolerance| &tolerance.parameters) {
        if !list.contains(&at) {
            list.push(at);
        }
    }
    list
}

/// The input that carries the load, and an empty column for it; `None` for a study without loads.
fn load_column(study: &Study) -> Option<(usize, Column)> {
    let input = study.load_input()?;
    let declared = &study.system.network().inputs[input];
    let suffix = declared.unit.suffix();
    let suffix = if declared.id.ends_with(suffix) { "" } else { suffix };
    let name = format!("load:{}{suffix}", declared.id);
    let what = format!("Load of the case: value of the input {}.", declared.id);
    Some((input, number(&name, symbol_or_one(declared.unit.symbol()), vec![], &what)))
}

fn symbol_or_one(symbol: &'static str) -> &'static str {
    if symbol.is_empty() { DIMENSIONLESS } else { symbol }
}

fn number(name: &str, unit: &str, values: Vec<f64>, what: &str) -> Column {
    Column::new(name, unit, Values::Float(values)).described(what)
}

fn whole(name: &str, values: Vec<u32>, what: &str) -> Column {
    Column::new(name, DIMENSIONLESS, Values::Unsigned(values)).described(what)
}

fn flag(name: &str, values: Vec<bool>, what: &str) -> Column {
    Column::new(name, "", Values::Flag(values)).described(what)
}

fn text(name: &str, values: Vec<String>, what: &str) -> Column {
    Column::new(name, "", Values::Text(values)).described(what)
}
