//! The keys of a study file, declared as data.

use super::{FORMAT, evaluating};
use crate::format::{Key, Value, may, must};
use servotwin_diagnosis::features::{MAX_ACTUATORS, Quantity};
use servotwin_learning::classifiers::boosted_trees::{MAX_DEPTH, MAX_TREES};

const ANY: Value = Value::Number(f64::NEG_INFINITY, f64::INFINITY, "");
/// Upper limit on specimens, to catch typing errors.
const MOST: f64 = 10_000.0;
/// Longest run, s: a campaign has thousands of runs.
const LONGEST_S: f64 = 1e4;
/// Upper limit on flights.
const MOST_FLIGHTS: f64 = 100_000.0;
/// Whole numbers are read as f64, exact up to 2⁵³.
const SEED: Value = Value::Whole(0.0, 9_007_199_254_740_992.0);

fn quantities() -> Vec<&'static str> {
    Quantity::ALL.iter().map(|(_, word)| *word).collect()
}

/// The keys of a study file.
pub(crate) static STUDY: [Key; 19] = [
    must("format", Value::Whole(FORMAT as f64, FORMAT as f64), "version of the file format"),
    must("name", Value::Text, "name of the study in files"),
    must("title", Value::Text, "one line for readers"),
    must("system", Value::Text, "a built-in system, or a file in the same folder"),
    must("duration_s", Value::Number(0.1, LONGEST_S, "s"), "length of every run"),
    must("sample_hz", Value::Number(1.0, 1e4, "Hz"), "samples per second"),
    must("intensities", Value::List(0, &INTENSITY), "the intensities of every fault"),
    must(
        "units",
        Value::List(1, &Value::Text),
        "the channels that can fail; \"\" for a system of one",
    ),
    must("command", Value::Table(&COMMAND), "the commands of the evaluation"),
    may("load", Value::Table(&LOAD), "the loads at which every command runs"),
    must(
        "sensors",
        Value::Names(1, &Value::Table(&SENSOR)),
        "the sensors that the diagnosis reads",
    ),
    may("extra_sensor", Value::Table(&EXTRA), "an additional sensor to assess"),
    may(
        "classes",
        Value::List(0, &Value::Table(&CLASS)),
        "faults with the same cause and the same remedy",
    ),
    may("realistic", Value::Table(&REALISTIC), "how real specimens differ from the twin"),
    may("fitted", Value::Table(&FITTED), "specimens whose twins are fitted to them"),
    may("training", Value::Table(&TRAINING), "the commands that the diagnosis learns from"),
    may("evaluation", Value::Table(&EVALUATION), "training and evaluation, if not the defaults"),
    may("flights", Value::Table(&FLIGHTS), "flights with the onset of a fault"),
    may(
        "reactions",
        Value::Names(0, &Value::Table(&REACTION)),
        "the effect of each command of a class",
    ),
];

static INTENSITY: Value = Value::Number(1e-6, 1.0, "");

static COMMAND: [Key; 2] = [
    must("input", Value::Text, "the input that the commands drive"),
    must("signals", Value::Names(1, &Value::Signal), "the commands by name"),
];

static LOAD: [Key; 2] = [
    must("input", Value::Text, "the input that carries the load"),
    must("values", Value::Names(1, &ANY), "the loads by name, SI"),
];

static SENSOR: [Key; 3] = [
    must("quantity", Value::Word(quantities), "role of the sensor in the diagnosis"),
    must("unit", Value::Whole(0.0, 1e6), "its place in `units`, from 1; 0 for none"),
    may("follows", Value::Names(0, &ANY), "its slope against other sensors by a law, SI over SI"),
];

static EXTRA: [Key; 2] = [
    must("id", Value::Text, "id of the sensor in the system"),
    must("title", Value::Text, "its name in the report"),
];

static CLASS: [Key; 3] = [
    must("detail", Value::Text, "the component or group at fault"),
    must("command", Value::Text, "the action that the fault requires"),
    must("faults", Value::List(1, &Value::Text), "names of faults, without the unit"),
];

static REALISTIC: [Key; 3] = [
    must("seed", SEED, "seed of noise and specimens"),
    may("healthy", Value::Whole(0.0, MOST), "healthy specimens per case"),
    may("tolerances", Value::List(0, &Value::Table(&TOLERANCE)), "the tolerances of the specimens"),
];

static FITTED: [Key; 5] = [
    must("command", Value::Signal, "the calibration flight"),
    must("duration_s", Value::Number(5.0, 1e4, "s"), "length of the calibration flight"),
    must("judge", Value::Whole(1.0, MOST), "specimens whose records are judged"),
    must("learn", Value::Whole(1.0, MOST), "specimens that run training commands"),
    must("in_each_case", Value::Whole(1.0, MOST), "specimens of each group that run the same case"),
];

static TOLERANCE: [Key; 3] = [
    must(
        "parameters",
        Value::List(1, &Value::Text),
        "parameters that vary together, without the unit",
    ),
    must("sigma", Value::Number(0.0, 1.0, ""), "one standard deviation"),
    may("absolute", Value::Flag, "sigma is in the parameter's unit, not relative to it"),
];

static TRAINING: [Key; 6] = [
    must("duration_s", Value::Number(0.1, LONGEST_S, "s"), "length of the records with faults"),
    may("healthy", Value::Whole(0.0, MOST), "healthy specimens per command"),
    may("load", Value::Range, "range of the load"),
    may("intensity_spread", Value::Number(0.0, 0.5, ""), "spread around each intensity"),
    may("draws", Value::List(0, &Value::Table(&DRAWS)), "commands drawn from ranges"),
    may("signals", Value::Names(0, &Value::Signal), "further commands by name"),
];

static DRAWS: [Key; 2] = [
    must("count", Value::Whole(0.0, MOST), "number of draws"),
    must("signal", Value::Text, "a signal; {a..b} is a number from a to b, {n} the draw"),
];

static EVALUATION: [Key; 9] = [
    may("seed", SEED, "seed of the splits into training and test"),
    may("random_thirds", ROUNDS, "repeats with a random third held out"),
    may("folds", FOLDS, "parts for holding out kinds and intensities"),
    may("learned_bands", SETTINGS, "scenarios with learned bands; the others use 3 %"),
    may("classifiers", SETTINGS, "scenarios in which classifiers are compared"),
    may("comparison", Value::Table(&COMPARISON), "how the comparison holds out rows"),
    may("ablation", SETTINGS, "scenarios of the ablation"),
    may("committee", Value::Table(&COMMITTEE), "the committee of boosted trees"),
    may("trees", Value::Names(0, &Value::Table(&TREES)), "the nine trees of a scenario"),
];

const ROUNDS: Value = Value::Whole(1.0, 1000.0);
const FOLDS: Value = Value::Whole(2.0, 1000.0);
const SETTINGS: Value = Value::List(0, &SETTING);
static SETTING: Value = Value::Word(evaluating::settings);

static COMPARISON: [Key; 2] = [
    may("random_thirds", ROUNDS, "repeats with a random third held out"),
    may("folds", FOLDS, "parts for holding out kinds and intensities"),
];

static COMMITTEE: [Key; 4] = [
    may("trees", Value::Whole(1.0, MAX_TREES as f64), "trees at each stage of the hierarchy"),
    may("depth", Value::Whole(1.0, MAX_DEPTH as f64), "questions on the longest path"),
    may("learning_rate", Value::Number(1e-3, 1.0, ""), "factor on the contribution of each tree"),
    may(
        "feature_share",
        Value::Number(1e-3, 1.0, ""),
        "share of the features that each tree may use",
    ),
];

static TREES: [Key; 3] = [
    may("criterion", Value::Word(evaluating::criteria), "the measure of impurity"),
    may("depth", Value::Whole(1.0, 100.0), "questions on the longest path"),
    may("leaf_rows", Value::Whole(1.0, MOST), "minimum number of rows in a leaf"),
];

static FLIGHTS: [Key; 13] = [
    may("seed", Value::Whole(0.0, 999.0), "seed of environments, specimens and noise"),
    must("duration_s", Value::Number(1.0, 1e4, "s"), "length of a flight with a fault"),
    must("onset_s", Value::Range, "range of the onset of a fault, s"),
    must("windows_s", Value::List(1, &WINDOW), "lengths of the sliding windows"),
    must("commands", Value::List(1, &Value::Text), "signals with {a..b} and {n}, used in turn"),
    may("inputs", Value::Names(0, &Value::Range), "ranges of inputs"),
    may("unit_inputs", Value::Names(0, &Value::Range), "ranges of inputs of every unit"),
    may("unit_parameters", Value::Names(0, &Value::Range), "ranges of parameters of every unit"),
    may(
        "least_on",
        Value::Whole(0.0, MAX_ACTUATORS as f64),
        "units that always stay on; default 1, or 0 for one unit",
    ),
    must("learn", Value::Table(&SIZE), "number of flights for training"),
    must("judge", Value::Table(&SIZE), "number of flights for the evaluation"),
    may("full", Value::Table(&FULL), "the sizes of `servotwin flights --full`"),
    may("limits", Value::Table(&LIMITS), "the targets of the diagnosis"),
];

static WINDOW: Value = Value::Number(1e-3, 1e4, "s");

static FULL: [Key; 2] = [
    must("learn", Value::Table(&SIZE), "number of flights for training"),
    must("judge", Value::Table(&SIZE), "number of flights for the evaluation"),
];

static SIZE: [Key; 7] = [
    must("environments", Value::Whole(1.0, MOST_FLIGHTS), "number of environments"),
    must("repeats", Value::Whole(0.0, MOST_FLIGHTS), "flights per fault and intensity"),
    must("healthy", Value::Whole(0.0, MOST_FLIGHTS), "healthy flights per environment"),
    may("healthy_duration_s", Value::Number(1.0, 1e4, "s"), "length of these flights"),
    may(
        "further",
        Value::Whole(0.0, MOST_FLIGHTS),
        "further environments with one healthy flight each",
    ),
    may("further_duration_s", Value::Number(1.0, 1e4, "s"), "length of these flights"),
    may("foreign", Value::Whole(0.0, MOST_FLIGHTS), "environments for faults without training"),
];

static LIMITS: [Key; 4] = [
    may(
        "latency_s",
        Value::Number(0.0, 1e4, "s"),
        "latency limit for 95 % of visible shutdown faults",
    ),
    may(
        "latency_unfitted_s",
        Value::Number(0.0, 1e4, "s"),
        "the same limit for a twin that is not fitted",
    ),
    may(
        "false_alarms_per_h",
        Value::Number(0.0, 1e4, "1/h"),
        "limit on false alarms of healthy actuators",
    ),
    may("wrong_shutdowns", Value::Number(0.0, 1e4, ""), "limit on shutdowns of the wrong actuator"),
];

static REACTION: [Key; 5] = [
    may("switches_off", Value::Flag, "whether the command switches the unit off"),
    may("unit_inputs", Value::Names(0, &ANY), "values for inputs of the unit at fault"),
    may("unit_parameters", Value::Names(0, &ANY), "values for parameters of the unit at fault"),
    may("parameters", Value::Names(0, &ANY), "values for parameters of the system"),
    may(
        "takes_out",
        Value::List(0, &Value::Word(quantities)),
        "quantities whose sensors are ignored afterwards",
    ),
];
