//! Trains trees, committee and bands for each kind of window from flights.

use super::training_windows::WindowData;
use super::windows::WindowDesign;
use crate::learn::data_set::DataRow;
use crate::learn::{self, DataSet, EvaluationError, EvaluationSettings, bands, committee};
use crate::parallel::{self, Workers};
use crate::run::{RunError, ensemble};
use crate::study::suites::HARD_NEGATIVES;
use crate::study::{Scenario, Study};
use servotwin_diagnosis::diagnoser::decision::{Allowances, Costs};
use servotwin_diagnosis::diagnoser::environment::{InputChecks, InputRange};
use servotwin_diagnosis::diagnoser::tuning::{
    BASELINE_CORRECTED, WITH_TOLERANCES_COST, WRONG_ACTUATOR_COST,
};
use servotwin_diagnosis::diagnoser::{
    self, DiagnosedSensor, Diagnoser, Length, Novelty, Scatter, Tuning,
};
use servotwin_diagnosis::hierarchy::Names;
use servotwin_diagnosis::panel::{Panel, SensorBand};
use servotwin_diagnosis::sliding::WindowSpan;
use servotwin_diagnosis::windows::WindowKind;
use servotwin_learning::classifiers::{self, boosted_trees};
use servotwin_learning::hierarchy::HierarchySettings as Training;
use servotwin_learning::tree::Criterion;
use std::collections::BTreeMap;

/// Tree depth for flights: windows from many environments are more diverse than records of one command. In shallower
/// trees, the last questions are not asked for every actuator.
const DEPTH: usize = 11;

/// Every n-th hard negative is used for training the trees: neighboring windows are similar, and a tree counts rows.
const TREES_EVERY: usize = 10;

/// The committee uses the largest number and depth of trees. Several hundred thousand windows of flights contain more
/// information than 60 trees of depth 4, which suffice for records, can represent. The learning rate is then also
/// slightly higher.
const LEARNING_RATE: f64 = 0.2;

/// The evidence that must remain, of that which two of five fault windows exceed. A diagnosis trained on few flights is
/// less certain, and would otherwise raise nothing. With the full number of flights this evidence is at least 9.4 nats,
/// so the whole allowance applies.
const LEFT_NATS: f64 = 2.0;

/// The same against health with a fitted twin; without any allowance, the evidence reached at most 0.02 of its limit.
const NOISE_ALLOWANCE_NATS: f64 = 0.5;

/// The share of healthy tests that may end with an action, by the committee's probabilities.
const TEST_FALSE_ALARMS: f64 = 0.05;

/// The share of tests of a faulty actuator that may end with another action, likewise.
const TEST_WRONG_ISOLATION: f64 = 0.1;

/// The largest evidence of a test: its only window may decide alone.
const TEST_CLIP_NATS: f64 = 100.0;

/// Settings for windows of flights: bands are learned as well. Windows contain the noise of their flight, so they need
/// no perturbation.
pub(crate) fn settings() -> EvaluationSettings {
    let training = learn::trees(Criterion::Entropy, DEPTH);
    let committee = Training::all(classifiers::Settings::BoostedTrees(boosted_trees::Settings {
        trees: boosted_trees::MAX_TREES,
        max_depth: boosted_trees::MAX_DEPTH,
        learning_rate: LEARNING_RATE,
        ..boosted_trees::Settings::default()
    }));
    EvaluationSettings { learned_bands: true, training, committee, ..EvaluationSettings::default() }
}

/// Trains a diagnoser from windows of flights, one data set for each kind. It accepts all inputs and knows no boundaries.
///
/// # Errors
/// Training fails.
pub(crate) fn diagnoser(
    design: &WindowDesign,
    learned: Vec<WindowData>,
    pools: &[usize],
    workers: Workers,
) -> Result<Diagnoser, EvaluationError> {
    let (study, scenario, kinds) = (design.study, design.scenario, design.kinds());
    let pairs: Vec<_> = kinds.iter().zip(&learned).collect();
    // All kinds in parallel: most of the time of a kind is the training of its largest stage, on one thread.
    let lengths = parallel::map(&pairs, workers, |(kind, learned)| {
        length(design, **kind, learned, pools, workers)
    });
    let lengths: Vec<LearnedLength> = lengths?.into_iter().collect::<Result<_, _>>()?;
    let scatter = lengths[0].widest.map(|(flights, median_excess)| Scatter {
        scenario: scenario.name().into(),
        flights,
        median_excess,
    });
    let evidence_quantile = |is_baseline_corrected: bool| {
        let of = kinds
            .iter()
            .zip(&lengths)
            .filter(|(kind, _)| kind.is_baseline_corrected == is_baseline_corrected);
        of.map(|(_, learned)| learned.evidence_quantile).fold(f64::INFINITY, f64::min)
    };
    let (evidence_quantile, baseline_corrected_quantile) =
        (evidence_quantile(false), evidence_quantile(true));
    let of = |(kind, LearnedLength { length, .. }): (&WindowKind, LearnedLength)| Length {
        baseline_corrected: kind
            .is_baseline_corrected
            .then(|| baseline_corrected_allowances(baseline_corrected_quantile)),
        ..length
    };
    let lengths: Vec<Length> = kinds.iter().zip(lengths).map(of).collect();
    let mut sensors = diagnosed(study, scenario, study.base_sensors());
    for (sensor, spread) in sensors.iter_mut().zip(&design.spreads) {
        sensor.spread = *spread;
    }
    let names = &lengths[0].panel.trees.names;
    let tuning = tuning((study, scenario), names, evidence_quantile);
    let diagnoser = assembled((study.sample_period_s, sensors), lengths, tuning);
    let tuning = match study.is_on_ground() {
        true => of_test(&diagnoser, study),
        false => diagnoser.tuning,
    };
    let diagnoser = Diagnoser { baseline: design.baseline(), scatter, tuning, ..diagnoser };
    diagnoser.check()?;
    Ok(diagnoser)
}

/// A diagnoser of records, as the seed paper has it: its only window is as long as a record. What bands, trees and
/// committee agree on at the end of a record is raised, without gathered evidence. It reads the first `sensors` measured
/// sensors.
///
/// # Errors
/// The models do not fit the sensors.
pub(crate) fn of_records(
    (study, scenario, sensors): (&Study, Scenario, usize),
    panel: Panel,
    novelty: Novelty,
) -> Result<Diagnoser, EvaluationError> {
    let tuning = tuning((study, scenario), &panel.trees.names, f64::INFINITY);
    let seen = (study.sample_period_s, diagnosed(study, scenario, sensors));
    let environment = within(study, &vec![NOT_FLOWN; study.system.network().inputs.len()]);
    let samples = ensemble(study).samples() as u32;
    let diagnoser = of_one_window(seen, (samples, panel, novelty), tuning);
    let diagnoser = Diagnoser { environment, ..diagnoser };
    diagnoser.check()?;
    Ok(diagnoser)
}

/// A diagnoser with one window of so many samples, which raises what trees and committee agree on in it. The sensors have a
/// sample in every period, s.
pub(crate) fn of_one_window(
    seen: (f64, Vec<DiagnosedSensor>),
    (pane_samples, panel, novelty): (u32, Panel, Novelty),
    tuning: Tuning,
) -> Diagnoser {
    let span = WindowSpan { pane_samples, panes: 1 };
    let length = Length { span, panel, novelty, baseline_corrected: None };
    let diagnoser = assembled(seen, vec![length], tuning);
    let once = deciding_once(&diagnoser, (3600.0, 1.0));
    Diagnoser { tuning: Tuning { least_limit_nats: f64::MIN_POSITIVE, ..once }, ..diagnoser }
}

/// The constants of a test on the ground: its only window decides, and begins with the first sample.
fn of_test(diagnoser: &Diagnoser, study: &Study) -> Tuning {
    let window_s = diagnoser.lengths[0].span.samples() as f64 * study.sample_period_s;
    let false_alarm_target_per_h = TEST_FALSE_ALARMS * 3600.0 / window_s;
    Tuning {
        clip_nats: TEST_CLIP_NATS,
        settle_s: 0.0,
        ..deciding_once(diagnoser, (false_alarm_target_per_h, TEST_WRONG_ISOLATION))
    }
}

/// The constants of a diagnosis that decides about each window alone: without allowances for what persists, and with
/// equal costs of all errors.
fn deciding_once(
    Diagnoser { tuning, lengths, .. }: &Diagnoser,
    (false_alarm_target_per_h, wrong_isolation): (f64, f64),
) -> Tuning {
    let is_off = vec![false; lengths[0].panel.trees.names.actions.len()];
    Tuning {
        false_alarm_target_per_h,
        wrong_isolation,
        allowance_nats: 0.0,
        health_allowance_nats: 0.0,
        off_allowance_nats: 0.0,
        other_allowance_nats: 0.0,
        costs: Costs::usual(&is_off),
        ..tuning.clone()
    }
}

/// A diagnoser that accepts all inputs and knows no boundaries.
fn assembled(
    (period_s, sensors): (f64, Vec<DiagnosedSensor>),
    lengths: Vec<Length>,
    tuning: Tuning,
) -> Diagnoser {
    Diagnoser {
        format: diagnoser::FORMAT.into(),
        period_s,
        sensors,
        boundaries: vec![],
        environment: InputChecks::default(),
        tuning,
        lengths,
        baseline: None,
        scatter: None,
        healthy_evidence: None,
        recorded: None,
    }
}

/// The certainty that a decision needs. Every window counts in full: noise is new in every pane, and the allowance
/// covers the repeated effect of tolerances.
fn tuning((study, scenario): (&Study, Scenario), names: &Names, evidence_quantile: f64) -> Tuning {
    let actions = names.actions.iter().map(String::as_str);
    let off_actions = actions.filter(|action| study.reactions.switches_off(action));
    let off_actions: Vec<&str> = off_actions.collect();
    let least_on = study.least_on();
    let mut settings = Tuning { least_on, ..Tuning::usual(names, &off_actions) };
    let of_off = settings.costs.other_actuator.iter_mut().zip(&names.actions);
    let of_off = of_off.filter(|(_, action)| off_actions.contains(&action.as_str()));
    of_off.for_each(|(cost, _)| *cost = WRONG_ACTUATOR_COST);
    let Tuning { health_allowance_nats, off_allowance_nats, .. } = settings;
    let against_health = (health_allowance_nats, health_allowance_nats + off_allowance_nats);
    if scenario.has_tolerances() {
        (settings.health_allowance_nats, settings.off_allowance_nats) =
            allowed(against_health, evidence_quantile);
        let of_healthy = settings.costs.same_actuator[0].iter_mut().skip(1).zip(&names.actions);
        let of_others = of_healthy.filter(|(_, name)| !off_actions.contains(&name.as_str()));
        of_others.for_each(|(cost, _)| *cost = WITH_TOLERANCES_COST);
    } else {
        settings.health_allowance_nats = NOISE_ALLOWANCE_NATS;
        settings.off_allowance_nats = 0.0;
    }
    settings
}

/// The allowance against health, and the additional one for an action that switches off, limited so that enough
/// evidence remains.
fn allowed((of_any, of_off): (f64, f64), evidence_quantile: f64) -> (f64, f64) {
    let most = (evidence_quantile - LEFT_NATS).max(0.0);
    (of_any.min(most), of_off.min(most) - of_any.min(most))
}

fn baseline_corrected_allowances(evidence_quantile: f64) -> Allowances {
    let Allowances { health_nats, off_nats, .. } = BASELINE_CORRECTED;
    let (health_nats, off_nats) = allowed((health_nats, health_nats + off_nats), evidence_quantile);
    Allowances { health_nats, off_nats, ..BASELINE_CORRECTED }
}

/// What windows of one length teach.
struct LearnedLength {
    length: Length,
    /// The evidence that two of five fault windows exceed, in nats.
    evidence_quantile: f64,
    /// The number of healthy flights, and the largest of their median excesses; `None` for too few.
    widest: Option<(u64, f64)>,
}

/// The smallest number of windows of a flight whose median counts. A fault flight gives one window before its onset.
const LEAST_OF_MEDIAN: usize = 2;

/// The number of healthy flights in ordinary environments, and the largest of the medians of their windows' excesses.
/// `flight_of` has the number of each variant's flight.
fn widest(
    data: &DataSet,
    flight_of: &[usize],
    is_further: impl Fn(&DataSet, &DataRow) -> bool,
) -> Option<(u64, f64)> {
    let is_own = |row: &&DataRow| row.is_healthy && !is_further(data, row);
    let mut flights: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for row in data.rows.iter().filter(is_own) {
        flights.entry(flight_of[row.variant]).or_default().push(row.excess);
    }
    flights.retain(|_, excesses| excesses.len() >= LEAST_OF_MEDIAN);
    let median = |excesses: &mut Vec<f64>| {
        excesses.sort_by(f64::total_cmp);
        excesses[excesses.len() / 2]
    };
    let largest = flights.values_mut().map(median).reduce(f64::max)?;
    Some((flights.len() as u64, largest))
}

fn length(
    design: &WindowDesign,
    kind: WindowKind,
    WindowData { data, flight_of }: &WindowData,
    pools: &[usize],
    workers: Workers,
) -> Result<LearnedLength, EvaluationError> {
    let study = design.study;
    let settings = settings();
    let is_further =
        |data: &DataSet, row: &DataRow| data.cases[row.case as usize].starts_with(HARD_NEGATIVES);
    // The guarantee of bands applies to ordinary flights, so hard negatives are excluded.
    let ordinary = data.without(|row| is_further(data, row));
    let mut bands = bands::learn(&ordinary, pools, design.alarms());
    if study.is_on_ground() {
        // Noise alone leaves these bands, so trees and committee judge every test.
        bands.iter_mut().flatten().zip(&study.sensors.0).for_each(|(band, sensor)| {
            band.half_width = sensor.noise;
        });
    }
    let half_widths = bands.iter().flatten().map(|band| band.half_width).collect::<Vec<f64>>();
    let data = if bands.is_some() { data.with_bands(&half_widths) } else { data.clone() };
    let widest = widest(&data, flight_of, is_further);
    let for_trees =
        data.without(|row| is_further(&data, row) && !row.variant.is_multiple_of(TREES_EVERY));
    let band = |band: bands::Band| SensorBand { sensor: band.sensor, half_width: band.half_width };
    let bands = bands.unwrap_or_default().into_iter().map(band).collect();
    let panel = learn::train_on(&for_trees, &data, bands, &settings, workers)?;
    let lessons = settings.committee_lessons;
    let evidence_quantile = committee::evidence_quantile(&data, &panel.committee, lessons)?;
    let length = Length {
        span: kind.span,
        novelty: learn::novelty(&data, &settings)?,
        panel,
        baseline_corrected: None,
    };
    Ok(LearnedLength { length, evidence_quantile, widest })
}

/// The first `count` measured sensors, as the features of a scenario see them.
fn diagnosed(study: &Study, scenario: Scenario, count: usize) -> Vec<DiagnosedSensor> {
    let sensors = study.sensors_in(scenario).0.into_iter().zip(study.scales());
    sensors.take(count).map(|(seen, scale)| DiagnosedSensor::new(seen, scale)).collect()
}

/// The least and largest value of an input before any is known.
const NOT_FLOWN: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

/// The accepted inputs: within their declared ranges, and not far outside of what the training flies: the ranges that its
/// suites declare, and the values that its commands reach.
///
/// # Errors
/// A command cannot be flown.
pub(crate) fn environment(study: &Study) -> Result<InputChecks, RunError> {
    let network = study.system.network();
    let mut flown = vec![NOT_FLOWN; network.inputs.len()];
    let mut reach = |input: usize, value: f64| {
        let (low, high) = &mut flown[input];
        (*low, *high) = (low.min(value), high.max(value));
    };
    for suite in study.training_suites() {
        for (name, range) in study.ranges_of(suite).ranges {
            if let Some(input) = network.inputs.iter().position(|input| input.id == name) {
                range.into_iter().for_each(|value| reach(input, value));
            }
        }
        for number in 0..suite.environments {
            let environment = study.environments(suite, number..number + 1)?.remove(0);
            let command = &environment.inputs[study.command_input];
            let breaks = command.breaks_s().iter().copied().chain([suite.longest_s()]);
            breaks.for_each(|time_s| reach(study.command_input, command.value(time_s)));
        }
    }
    Ok(within(study, &flown))
}

/// The accepted inputs: within their declared ranges, and not far outside of what is `flown`, from least to largest; an
/// input that never changes is free there.
fn within(study: &Study, flown: &[(f64, f64)]) -> InputChecks {
    let network = study.system.network();
    let margin = Tuning::default().input_margin;
    let input = |(place, known): (usize, &servotwin_model::network::ExternalInput)| {
        let (low, high) = flown[place];
        let margin = margin * (high - low);
        let (least, largest) = match high > low {
            true => (low - margin, high + margin),
            false => (-f64::MAX, f64::MAX),
        };
        let (declared_least, declared_largest) = network.input_range(place);
        InputRange {
            name: known.id.clone(),
            least: least.max(declared_least),
            largest: largest.min(declared_largest),
            frozen_after_s: None,
        }
    };
    let inputs = network.inputs.iter().enumerate().map(input).collect();
    InputChecks { inputs, differences: vec![] }
}
