//! Trees, committee and bands for each kind of windows, learned from flights.

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

/// An input may leave the range of the flights that were learned from by this part of its width.
const MARGIN: f64 = 0.25;

/// Questions on the longest way of a tree of flights: windows of many environments are more different
/// than records of one command, and of fewer questions those that come last are not asked for every actuator.
const DEPTH: usize = 11;

/// Of the healthy windows that were sought because they leave their bands every so many-th teaches the trees: neighbours
/// are alike, and a tree counts rows.
const TREES_EVERY: usize = 10;

/// The committee's trees are the most and the deepest that there may be: some hundred thousand windows of flights teach much
/// more than 60 trees of depth 4, which are enough for records, can hold. They then learn a little faster, too.
const LEARNING_RATE: f64 = 0.2;

/// What evidence against health is reduced by in every window where specimens differ by their tolerances, in nats, and of a
/// command that switches off. In 42 hours of 500 healthy specimens under the most violent commands (tuning flights) the most
/// that any gathered for such a command was then 0.26 of its limit. Other commands do less harm, and warnings are for what
/// shows little: with 6 a tenth of them is raised.
const ALLOWANCES_NATS: (f64, f64) = (3.0, 5.0);

/// The cost of any other false alarm then: every window counts in full, the same evidence more than twice as much, so the
/// limit of about 16 nats is as much higher.
const WITH_TOLERANCES_COST: f64 = 3e8;

/// So much is left of what two of five windows of a fault say against health: a diagnosis that learned from few flights is
/// never as sure as one that learned from many, and would raise nothing. With the full sizes they say 9.4 nats or more, so
/// that all is taken off.
const LEFT_NATS: f64 = 2.0;

/// The same in windows of what residuals are beyond the specimen's own, which tolerances show less in.
const BASELINE_CORRECTED_ALLOWANCES_NATS: (f64, f64) = (0.0, 2.0);

/// The same against health beside a twin of the specimen, where the most was 0.02 with nothing at all.
const NOISE_ALLOWANCE_NATS: f64 = 0.5;

/// What is enough between two commands, and nothing between those of one actuator in relative windows: of two that look alike
/// the likelier one is to be named some day.
const PAIRS_NATS: f64 = 0.2;

/// What is taken off against another actuator for a command that switches off. What is hardly told apart (some two nats in every
/// window) had the healthy one shut down after four seconds in one of 1,389 tuning flights; what is seen well says much more.
const OTHER_ACTUATOR_NATS: f64 = 1.5;

/// How windows of flights are learned from: bands are learned too, and windows carry the noise of
/// their flight, so that they need no moves.
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

/// Learns from windows of flights, one table for each kind: everything that it takes to diagnose.
///
/// # Errors
/// What training says.
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
    // All at the same time: the most of a kind is the training of its largest stage, on one thread.
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

/// The cost of switching off the healthy actuator where every window counts in full: the same evidence then counts more
/// than twice as much, so the limit is twice as high (`ln 1e3 + ln 1e9 = 2 (ln 1e3 + ln 1e3)`).
const WRONG_ACTUATOR_COST: f64 = 1e9;

/// How sure a decision must be. Every window counts in full: noise is new in every pane, and what tolerances show
/// again and again is the allowance's.
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

/// What is taken off against health, and besides where a command switches off, so that enough is left.
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
    // What bands promise is promised of flights as they are, not of windows that were sought.
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

/// The inputs of the system: inside of what is declared for them, and where flights varied them not
/// far outside of where they were.
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
