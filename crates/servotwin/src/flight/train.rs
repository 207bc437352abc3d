//! Trains bands, trees and committee from flights, for each kind of window.

use super::windows::{self, Kind};
use crate::evaluation::data_set::Row;
use crate::evaluation::{
    self, DataSet, EvaluationError, FeatureInfo, Settings, bands, committee, run,
};
use crate::parallel::{self, Workers};
use crate::study::{Flights, Role, Setting, Study};
use crate::table::Table;
use servotwin_diagnosis::diagnoser::decision::Allowances;
use servotwin_diagnosis::diagnoser::environment::{Environment, Input};
use servotwin_diagnosis::diagnoser::novelty::QUANTILE;
use servotwin_diagnosis::diagnoser::{self, Diagnoser, Length, decision};
use servotwin_diagnosis::hierarchy::Names;
use servotwin_diagnosis::panel::{Panel, SensorBand};
use servotwin_learning::classifiers::{self, boosted_trees};
use servotwin_learning::hierarchy::Settings as Training;
use servotwin_learning::novelty;
use servotwin_learning::tree::Criterion;

/// Margin of an input's valid range beyond the training flights, in parts of their range.
const MARGIN: f64 = 0.25;

/// Maximum depth of the trees. Windows of many environments differ more than records of one command. With fewer
/// questions, some actuators would lack the late ones.
const DEPTH: usize = 11;

/// The trees use one hard negative in this many, because neighboring windows are alike and trees count rows.
const TREES_EVERY: usize = 10;

/// Learning rate of the committee, which has the maximum number and depth of trees. The 60 trees of depth 4 for records
/// cannot hold some hundred thousand windows. The rate is slightly higher to match.
const LEARNING_RATE: f64 = 0.2;

/// Allowances subtracted from the evidence against health in every window with tolerances, in nats: for any action, and
/// for a shutdown. In 42 hours of 500 healthy specimens under the most violent commands (tuning flights), the evidence
/// for a shutdown then reached at most 0.26 of its limit. Other actions do less harm, and warnings cover weak faults:
/// with 6 nats only a tenth of the warnings is raised.
const ALLOWANCES_NATS: (f64, f64) = (3.0, 5.0);

/// Cost of a false alarm of any other action with tolerances. Every window counts in full, so the same evidence more
/// than doubles. The limit of about 16 nats is raised in proportion.
const WITH_TOLERANCES_COST: f64 = 3e8;

/// Evidence against health that the allowances leave in two of five fault windows, in nats. A diagnosis trained on few
/// flights is less certain and would otherwise raise nothing. At full size these windows give 9.4 nats or more, so the
/// full allowances apply.
const LEFT_NATS: f64 = 2.0;

/// The same allowances in baseline-corrected windows, where tolerances show less.
const BASELINE_CORRECTED_ALLOWANCES_NATS: (f64, f64) = (0.0, 2.0);

/// Allowance against health without tolerances, in nats. Even with none the highest evidence was 0.02 of the limit.
const NOISE_ALLOWANCE_NATS: f64 = 0.5;

/// Allowance between two actions, in nats. It is 0 between actions of one actuator in baseline-corrected windows, so
/// that the likelier of two similar actions is named eventually.
const PAIRS_NATS: f64 = 0.2;

/// Log-likelihood margin required in every window before a shutdown may be raised against the other actuator, in nats.
/// Without it, one of 1,389 tuning flights shut down the healthy actuator after four seconds, at about two nats per
/// window. Clear faults give much more.
const OTHER_ACTUATOR_NATS: f64 = 1.5;

/// Training settings for windows of flights. Bands are learned. Windows carry the noise of their flight, so they need
/// no augmentation.
pub fn settings() -> Settings {
    let training = evaluation::trees(Criterion::Entropy, DEPTH);
    let committee = Training::all(classifiers::Settings::BoostedTrees(boosted_trees::Settings {
        trees: boosted_trees::MAX_TREES,
        max_depth: boosted_trees::MAX_DEPTH,
        learning_rate: LEARNING_RATE,
        ..boosted_trees::Settings::default()
    }));
    Settings { learned_bands: true, training, committee, ..Settings::default() }
}

/// Trains a complete diagnoser from windows of flights, one table for each kind.
///
/// # Errors
/// Errors of training.
pub fn diagnoser(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    tables: Vec<Table>,
    pools: &[usize],
    workers: Workers,
) -> Result<Diagnoser, EvaluationError> {
    let kinds = windows::kinds(flights, setting);
    let tables = tables.into_iter().map(|table| [(Role::Training, table)]);
    let lessons: Vec<_> = kinds.iter().zip(tables).collect();
    // All kinds in parallel: most of the time of a kind goes into its largest stage, on one thread.
    let lengths = parallel::map(&lessons, workers, |(kind, tables)| {
        let (kind, usual) = (**kind, flights.learn.environments);
        length(study, (kind, usual), tables, pools, workers)
    });
    let lengths: Vec<(Length, f64)> = lengths?.into_iter().collect::<Result<_, _>>()?;
    let evidence_quantile = |is_baseline_corrected: bool| {
        let of = kinds
            .iter()
            .zip(&lengths)
            .filter(|(kind, _)| kind.is_baseline_corrected == is_baseline_corrected);
        of.map(|(_, (_, nats))| *nats).fold(f64::INFINITY, f64::min)
    };
    let (evidence_quantile, baseline_corrected_quantile) =
        (evidence_quantile(false), evidence_quantile(true));
    let of = |(kind, (length, _)): (&Kind, (Length, f64))| Length {
        baseline_corrected: kind
            .is_baseline_corrected
            .then(|| baseline_corrected_allowances(baseline_corrected_quantile)),
        ..length
    };
    let lengths: Vec<Length> = kinds.iter().zip(lengths).map(of).collect();
    let names = &lengths[0].panel.trees.names;
    let commands = names.actions.iter().map(String::as_str);
    let off: Vec<&str> = commands.filter(|command| study.reactions.switches_off(command)).collect();
    let diagnoser = Diagnoser {
        format: diagnoser::FORMAT.into(),
        period_s: study.sample_period_s,
        sensors: sensors(study),
        environment: environment(study, flights),
        decision: decision::Settings {
            least_on: study.least_on(),
            ..decision(setting, names, &off, evidence_quantile)
        },
        lengths,
        baseline: windows::baseline(flights, setting, study.sample_period_s),
        conditional_band: None,
    };
    diagnoser.check()?;
    Ok(diagnoser)
}

/// Cost of shutting down the healthy actuator. Every window counts in full, so the same evidence more than doubles, and
/// the limit is doubled (`ln 1e3 + ln 1e9 = 2 (ln 1e3 + ln 1e3)`).
const WRONG_ACTUATOR_COST: f64 = 1e9;

/// Decision settings. Every window counts in full: noise is new in every pane, and the allowances cover the repeated
/// effect of tolerances.
fn decision(
    setting: Setting,
    names: &Names,
    off_commands: &[&str],
    evidence_quantile: f64,
) -> decision::Settings {
    let mut settings = decision::Settings::usual(names, off_commands);
    settings.overlap_exponent = 0.0;
    settings.allowance_nats = PAIRS_NATS;
    settings.other_allowance_nats = OTHER_ACTUATOR_NATS;
    let of_off = settings.costs.other_actuator.iter_mut().zip(&names.actions);
    let of_off = of_off.filter(|(_, command)| off_commands.contains(&command.as_str()));
    of_off.for_each(|(cost, _)| *cost = WRONG_ACTUATOR_COST);
    if setting.has_tolerances() {
        (settings.health_allowance_nats, settings.off_allowance_nats) =
            allowed(ALLOWANCES_NATS, evidence_quantile);
        let of_healthy = settings.costs.same_actuator[0].iter_mut().skip(1).zip(&names.actions);
        let of_others = of_healthy.filter(|(_, name)| !off_commands.contains(&name.as_str()));
        of_others.for_each(|(cost, _)| *cost = WITH_TOLERANCES_COST);
    } else {
        settings.health_allowance_nats = NOISE_ALLOWANCE_NATS;
    }
    settings
}

/// Allowances against health, and in addition for shutdowns, limited so that `LEFT_NATS` remain.
fn allowed((of_any, of_off): (f64, f64), evidence_quantile: f64) -> (f64, f64) {
    let most = (evidence_quantile - LEFT_NATS).max(0.0);
    (of_any.min(most), of_off.min(most) - of_any.min(most))
}

fn baseline_corrected_allowances(evidence_quantile: f64) -> Allowances {
    let (health_nats, off_nats) = allowed(BASELINE_CORRECTED_ALLOWANCES_NATS, evidence_quantile);
    Allowances { of_pairs_nats: 0.0, health_nats, off_nats, other_nats: OTHER_ACTUATOR_NATS }
}

fn length(
    study: &Study,
    (kind, usual): (Kind, usize),
    tables: &[(Role, Table)],
    pools: &[usize],
    workers: Workers,
) -> Result<(Length, f64), EvaluationError> {
    let features = FeatureInfo::of_study(study, false);
    let data =
        DataSet::new(tables, features, &study.units, &study.commands())?.taught_to_windows()?;
    let settings = settings();
    let is_further = |data: &DataSet, row: &Row| {
        data.cases[row.case as usize].parse().is_ok_and(|environment: usize| environment >= usual)
    };
    // Bands are learned without the hard negatives, because their guarantee refers to ordinary flights.
    let bands = bands::learn(&data.without(|row| is_further(&data, row)), pools);
    let half_widths = bands.iter().flatten().map(|band| band.half_width).collect::<Vec<f64>>();
    let data = if bands.is_some() { data.with_bands(&half_widths) } else { data };
    let for_trees =
        data.without(|row| is_further(&data, row) && !row.variant.is_multiple_of(TREES_EVERY));
    let rows = for_trees.learnt_from(settings.holding.lessons)?;
    let trees = run::fit(&for_trees, &run::settled(&data, &settings.training), &rows, workers)?;
    let known = data.learnt_from(settings.committee_lessons)?;
    let committee = committee::train(&data.for_committee()?, &settings.committee, &known, workers)?;
    let groups: Vec<u32> = data.rows.iter().map(|row| row.flown).collect();
    let band = |band: bands::Band| SensorBand { sensor: band.sensor, half_width: band.half_width };
    let evidence_quantile =
        committee::evidence_quantile(&data, &committee.hierarchy, settings.committee_lessons)?;
    let length = Length {
        span: windows::span(kind.window_s, study.sample_period_s),
        novelty: novelty::learn(&data.examples, &known, &groups, QUANTILE)?,
        panel: Panel {
            bands: bands.unwrap_or_default().into_iter().map(band).collect(),
            least_confidence: committee.least_confidence,
            trees,
            committee: committee.hierarchy,
            ..Panel::default()
        },
        baseline_corrected: None,
    };
    Ok((length, evidence_quantile))
}

fn sensors(study: &Study) -> Vec<diagnoser::Sensor> {
    let seen = study.sensors.0[..study.base_sensors()].iter().zip(study.scales());
    let sensor = |(seen, scale): (&servotwin_diagnosis::features::Sensor, f64)| diagnoser::Sensor {
        name: seen.name.clone(),
        quantity: seen.quantity,
        actuator: seen.actuator.map(|unit| unit as u32),
        scale,
        noise: seen.noise,
        is_noisy: seen.is_noisy,
        follows: seen.follows.iter().map(|&(other, weight)| (other as u32, weight)).collect(),
    };
    seen.map(sensor).collect()
}

/// The valid ranges of the system's inputs: the declared range, narrowed to the flown range plus a margin if training
/// varied the input.
fn environment(study: &Study, flights: &Flights) -> Environment {
    let network = study.system.network();
    let input = |(place, known): (usize, &servotwin_model::network::ExternalInput)| {
        let signals = flights.learned.iter().map(|environment| &environment.inputs[place]);
        let ends = signals.flat_map(|signal| {
            let breaks = signal.breaks_s().iter().copied().chain([flights.duration_s]);
            breaks.map(|time_s| signal.value(time_s))
        });
        let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        let margin = MARGIN * (high - low);
        let (least, largest) = match high > low {
            true => (low - margin, high + margin),
            false => (-f64::MAX, f64::MAX),
        };
        let (declared_least, declared_largest) = network.input_range(place);
        Input {
            name: known.id.clone(),
            least: least.max(declared_least),
            largest: largest.min(declared_largest),
            frozen_after_s: None,
        }
    };
    let inputs = network.inputs.iter().enumerate().map(input).collect();
    Environment { inputs, differences: vec![] }
}
