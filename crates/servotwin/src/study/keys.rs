//! What a study file may say.

use super::{FORMAT, evaluating};
use crate::format::{Key, Value, may, must};
use servotwin_diagnosis::classifiers::boosted_trees::{DEEPEST, MOST_TREES};
use servotwin_diagnosis::features::{MOST_UNITS, Quantity};

const ANY: Value = Value::Number(f64::NEG_INFINITY, f64::INFINITY, "");
/// At most so many specimens, so that a slip of the finger is told.
const MOST: f64 = 10_000.0;
/// Nothing is simulated for longer, s: a campaign has thousands of runs.
const LONGEST_S: f64 = 1e4;
/// At most so many flights.
const MOST_FLIGHTS: f64 = 100_000.0;
/// Whole numbers are read as f64, exact up to 2⁵³.
const SEED: Value = Value::Whole(0.0, 9_007_199_254_740_992.0);

fn quantities() -> Vec<&'static str> {
    Quantity::ALL.iter().map(|(_, word)| *word).collect()
}

/// The keys of a study file.
pub(crate) static STUDY: [Key; 19] = [
    must("format", Value::Whole(FORMAT as f64, FORMAT as f64), "of this file"),
    must("name", Value::Text, "the name in files"),
    must("title", Value::Text, "one line for people"),
    must("system", Value::Text, "a built-in system, or a file beside this one"),
    must("duration_s", Value::Number(0.1, LONGEST_S, "s"), "length of every run"),
    must("sample_hz", Value::Number(1.0, 1e4, "Hz"), "samples per second"),
    must("intensities", Value::List(0, &INTENSITY), "the intensities of every fault"),
    must("units", Value::List(1, &Value::Text), "what can fail; \"\" for a system of one unit"),
    must("command", Value::Table(&COMMAND), "what the cases are driven by"),
    may("load", Value::Table(&LOAD), "at which loads every command is flown"),
    must("sensors", Value::Names(1, &Value::Table(&SENSOR)), "what the sensors measure"),
    may("extra_sensor", Value::Table(&EXTRA), "a sensor that the system could have"),
    may("classes", Value::List(0, &Value::Table(&CLASS)), "faults, and what must be done"),
    may("realistic", Value::Table(&REALISTIC), "how reality differs from the twin"),
    may("fitted", Value::Table(&FITTED), "specimens beside twins that are fitted to them"),
    may("training", Value::Table(&TRAINING), "commands to learn from"),
    may("evaluation", Value::Table(&EVALUATION), "how it is trained and judged, if not as usual"),
    may("flights", Value::Table(&FLIGHTS), "flights in which a fault begins"),
    may("reactions", Value::Names(0, &Value::Table(&REACTION)), "what a command does"),
];

static INTENSITY: Value = Value::Number(1e-6, 1.0, "");

static COMMAND: [Key; 2] = [
    must("input", Value::Text, "the input that is driven"),
    must("signals", Value::Names(1, &Value::Signal), "the commands by name"),
];

static LOAD: [Key; 2] = [
    must("input", Value::Text, "the input that is the load"),
    must("values", Value::Names(1, &ANY), "its values by name, SI"),
];

static SENSOR: [Key; 3] = [
    must("quantity", Value::Word(quantities), "what it measures"),
    must("unit", Value::Whole(0.0, 1e6), "the unit it belongs to, from 1; 0 for none"),
    may("follows", Value::Names(0, &ANY), "how far it moves for others by a law, SI over SI"),
];

static EXTRA: [Key; 2] = [
    must("id", Value::Text, "the sensor in the system"),
    must("title", Value::Text, "what it is, in words"),
];

static CLASS: [Key; 3] = [
    must("detail", Value::Text, "what is at fault"),
    must("command", Value::Text, "what must be done"),
    must("faults", Value::List(1, &Value::Text), "names of faults without the unit"),
];

static REALISTIC: [Key; 3] = [
    must("seed", SEED, "of noise and specimens"),
    may("healthy", Value::Whole(0.0, MOST), "fault-free specimens for each case"),
    may("tolerances", Value::List(0, &Value::Table(&TOLERANCE)), "how specimens differ"),
];

static FITTED: [Key; 5] = [
    must("command", Value::Signal, "the calibration flight"),
    must("duration_s", Value::Number(5.0, 1e4, "s"), "length of the calibration flight"),
    must("judge", Value::Whole(1.0, MOST), "specimens whose records are judged"),
    must("learn", Value::Whole(1.0, MOST), "specimens that fly training commands"),
    must("in_each_case", Value::Whole(1.0, MOST), "how many of them fly the same case"),
];

static TOLERANCE: [Key; 3] = [
    must("parameters", Value::List(1, &Value::Text), "that vary together, without the unit"),
    must("sigma", Value::Number(0.0, 1.0, ""), "one standard deviation"),
    may("absolute", Value::Flag, "sigma is in the parameters' unit, else a part of them"),
];

static TRAINING: [Key; 6] = [
    must("duration_s", Value::Number(0.1, LONGEST_S, "s"), "length of records of faults"),
    may("healthy", Value::Whole(0.0, MOST), "fault-free specimens for each command"),
    may("load", Value::Range, "between which values of the load commands are flown"),
    may("intensity_spread", Value::Number(0.0, 0.5, ""), "around each of the intensities"),
    may("draws", Value::List(0, &Value::Table(&DRAWS)), "commands that are drawn"),
    may("signals", Value::Names(0, &Value::Signal), "commands by name"),
];

static DRAWS: [Key; 2] = [
    must("count", Value::Whole(0.0, MOST), "how many"),
    must("signal", Value::Text, "a signal with {a..b} for a number between, {n} for the draw's"),
];

static EVALUATION: [Key; 9] = [
    may("seed", SEED, "of splits into training and test"),
    may("random_thirds", ROUNDS, "how often a random third is held out"),
    may("folds", FOLDS, "in how many parts kinds and intensities are held out"),
    may("learned_bands", SETTINGS, "settings whose bands healthy specimens teach; elsewhere 3 %"),
    may("classifiers", SETTINGS, "settings in which classifiers are compared"),
    may("comparison", Value::Table(&COMPARISON), "how rows are held out there"),
    may("ablation", SETTINGS, "settings in which parts are taken away"),
    may("committee", Value::Table(&COMMITTEE), "the boosted trees beside the nine"),
    may("trees", Value::Names(0, &Value::Table(&TREES)), "the nine trees of a setting"),
];

const ROUNDS: Value = Value::Whole(1.0, 1000.0);
const FOLDS: Value = Value::Whole(2.0, 1000.0);
const SETTINGS: Value = Value::List(0, &SETTING);
static SETTING: Value = Value::Word(evaluating::settings);

static COMPARISON: [Key; 2] = [
    may("random_thirds", ROUNDS, "how often a random third is held out"),
    may("folds", FOLDS, "in how many parts kinds and intensities are held out"),
];

static COMMITTEE: [Key; 4] = [
    may("trees", Value::Whole(1.0, MOST_TREES as f64), "at each place of the hierarchy"),
    may("depth", Value::Whole(1.0, DEEPEST as f64), "questions on the longest way"),
    may("learning_rate", Value::Number(1e-3, 1.0, ""), "factor on what each tree adds"),
    may("feature_share", Value::Number(1e-3, 1.0, ""), "of features from which each may choose"),
];

static TREES: [Key; 3] = [
    may("criterion", Value::Word(evaluating::criteria), "the measure of impurity"),
    may("depth", Value::Whole(1.0, 100.0), "questions on the longest way"),
    may("leaf_rows", Value::Whole(1.0, MOST), "rows on both sides of every question, at least"),
];

static FLIGHTS: [Key; 13] = [
    may("seed", Value::Whole(0.0, 999.0), "of environments, specimens and noise"),
    must("duration_s", Value::Number(1.0, 1e4, "s"), "length of a flight with a fault"),
    must("onset_s", Value::Range, "between which times a fault begins"),
    must("windows_s", Value::List(1, &WINDOW), "lengths of what is looked at"),
    must("commands", Value::List(1, &Value::Text), "signals with {a..b} and {n}, in turn"),
    may("inputs", Value::Names(0, &Value::Range), "ranges of inputs"),
    may("unit_inputs", Value::Names(0, &Value::Range), "ranges of inputs of every unit"),
    may("unit_parameters", Value::Names(0, &Value::Range), "ranges of parameters of every unit"),
    may(
        "least_on",
        Value::Whole(0.0, MOST_UNITS as f64),
        "units never switched off: 1, of a single unit 0",
    ),
    must("learn", Value::Table(&SIZE), "how many flights to learn from"),
    must("judge", Value::Table(&SIZE), "how many flights to be judged in"),
    may("full", Value::Table(&FULL), "the sizes of servotwin flights --full"),
    may("limits", Value::Table(&LIMITS), "what is asked of the diagnosis"),
];

static WINDOW: Value = Value::Number(1e-3, 1e4, "s");

static FULL: [Key; 2] = [
    must("learn", Value::Table(&SIZE), "how many flights to learn from"),
    must("judge", Value::Table(&SIZE), "how many flights to be judged in"),
];

static SIZE: [Key; 7] = [
    must("environments", Value::Whole(1.0, MOST_FLIGHTS), "different environments"),
    must("repeats", Value::Whole(0.0, MOST_FLIGHTS), "flights of each fault with each intensity"),
    must("healthy", Value::Whole(0.0, MOST_FLIGHTS), "healthy flights in each environment"),
    may("healthy_duration_s", Value::Number(1.0, 1e4, "s"), "how long these are"),
    may(
        "further",
        Value::Whole(0.0, MOST_FLIGHTS),
        "further environments, with a healthy flight in each",
    ),
    may("further_duration_s", Value::Number(1.0, 1e4, "s"), "how long these are"),
    may("foreign", Value::Whole(0.0, MOST_FLIGHTS), "environments with untrained faults"),
];

static LIMITS: [Key; 4] = [
    may("latency_s", Value::Number(0.0, 1e4, "s"), "for 95 % of visible shutdown faults"),
    may("latency_unfitted_s", Value::Number(0.0, 1e4, "s"), "the same with an unfitted twin"),
    may("false_alarms_per_h", Value::Number(0.0, 1e4, "1/h"), "of healthy actuators"),
    may("wrong_shutdowns", Value::Number(0.0, 1e4, ""), "of the wrong actuator"),
];

static REACTION: [Key; 5] = [
    may("switches_off", Value::Flag, "whether the unit is off then"),
    may("unit_inputs", Value::Names(0, &ANY), "inputs of the unit at fault"),
    may("unit_parameters", Value::Names(0, &ANY), "parameters of the unit at fault"),
    may("parameters", Value::Names(0, &ANY), "parameters of the system"),
    may("takes_out", Value::List(0, &Value::Word(quantities)), "sensors nobody listens to"),
];
