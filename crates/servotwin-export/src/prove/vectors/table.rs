//! What vectors show, as tables.

use super::{Entry, Row, Sequence, Spot, Step};
use crate::mcdc::{Decision, Shown};
use crate::prove::chain::integers;
use serde::Serialize;
use servotwin_diagnosis::diagnoser::{Diagnoser, Outcome};
use std::collections::BTreeMap;

/// The names of the integers of an outcome, in the order of `write_outcome` in the C text.
const INTEGERS: [&str; 18] = [
    "sample",
    "since_sample",
    "finding",
    "actuator",
    "action",
    "detail",
    "input",
    "why",
    "alarm",
    "is_raised",
    "raised_actuator",
    "raised_action",
    "raised_detail",
    "raised_sample",
    "raised_length",
    "length",
    "worst_sensor",
    "lost",
];

/// The names of its numbers.
const NUMBERS: [&str; 3] = ["confidence", "worst", "raised_confidence"];

/// The functions of the commands.
const COMMANDS: [&str; 6] =
    ["switched_off", "release", "inhibit", "resume", "take_out", "put_back"];

/// The coverage of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct FileCoverage {
    /// Its decisions.
    pub decisions: usize,
    /// Their conditions, with the cases of `switch`.
    pub conditions: usize,
    /// Conditions whose independent effect is shown.
    pub shown: usize,
    /// Conditions that are not shown, for a known reason.
    pub with_reason: usize,
    /// Conditions that no sequence showed.
    pub not_found: usize,
}

/// A condition that is not shown.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct OpenCondition {
    /// The file.
    pub file: &'static str,
    /// Number of the line, from 1.
    pub line: usize,
    /// The text of the decision.
    pub decision: String,
    /// That of the condition.
    pub condition: String,
    /// The value with which it never decided: true, false, or both.
    pub never: &'static str,
    /// Why it cannot be shown, where that is known.
    pub reason: Option<&'static str>,
}

/// An outcome as integers and numbers.
pub(super) fn outcome(outcome: &Outcome) -> ([i64; 18], [f64; 3]) {
    let raised = outcome.raised.map_or(0.0, |raised| raised.confidence);
    (integers(outcome), [outcome.confidence, outcome.excess, raised])
}

/// The actuator of the raised action, from the integers of an outcome.
pub(super) fn accused(integers: &[i64]) -> Option<usize> {
    (integers[9] == 1).then_some(integers[10] as usize)
}

/// The coverage of each file with decisions.
pub(super) fn by_file(
    decisions: &[Decision],
    rows: &[Row],
) -> BTreeMap<&'static str, FileCoverage> {
    let mut files: BTreeMap<&'static str, FileCoverage> = BTreeMap::new();
    for decision in decisions {
        files.entry(decision.file).or_default().decisions += 1;
    }
    for row in rows {
        let file = files.entry(decisions[row.decision].file).or_default();
        file.conditions += 1;
        match (row.is_shown(), row.reason) {
            (true, _) => file.shown += 1,
            (false, Some(_)) => file.with_reason += 1,
            (false, None) => file.not_found += 1,
        }
    }
    files
}

/// The conditions that are not shown.
pub(super) fn open(decisions: &[Decision], rows: &[Row]) -> Vec<OpenCondition> {
    let open = rows.iter().filter_map(|row| {
        let never = never(row.shown)?;
        let Decision { file, line, text, conditions, .. } = &decisions[row.decision];
        Some(OpenCondition {
            file,
            line: *line,
            decision: text.clone(),
            condition: conditions[row.condition].clone(),
            never,
            reason: row.reason,
        })
    });
    open.collect()
}

fn never(shown: Shown) -> Option<&'static str> {
    match shown {
        Shown::Missing { with_true: true, with_false: true } => Some("both"),
        Shown::Missing { with_true: true, .. } => Some("true"),
        Shown::Missing { .. } => Some("false"),
        _ => None,
    }
}

/// Sequences and samples count from 1 in all tables.
fn place((sequence, sample): Spot) -> String {
    format!("{},{}", sequence + 1, sample + 1)
}

/// The conditions as CSV.
pub(super) fn conditions(decisions: &[Decision], rows: &[Row]) -> String {
    let mut text = String::from(
        "file,function,line,column,kind,decision,condition,times true,times false,shown by,\
         true: sequence,true: sample,false: sequence,false: sample,never decided as,reason\n",
    );
    for row in rows {
        let Decision { file, function, line, column, kind, text: whole, conditions, .. } =
            &decisions[row.decision];
        let how = match row.shown {
            Shown::Pair(_) if row.is_unique_cause => "unique cause",
            Shown::Pair(_) => "masking",
            Shown::Case(_) => "case",
            Shown::Missing { .. } => "",
        };
        let mut places = row.spots.iter().map(|spot| place(*spot)).collect::<Vec<_>>();
        places.resize(2, ",".into());
        let [times_true, times_false] = row.counts;
        let never = never(row.shown).unwrap_or_default();
        let (decision, condition) = (quoted(whole), quoted(&conditions[row.condition]));
        let (places, reason) = (places.join(","), quoted(row.reason.unwrap_or_default()));
        let kind = kind.name();
        text += &format!(
            "{file},{function},{line},{column},{kind},{decision},{condition},{times_true},{times_false},{how},{places},{never},{reason}\n"
        );
    }
    text
}

fn quoted(text: &str) -> String {
    match text.contains([',', '"']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.into(),
    }
}

/// The sequences as CSV.
pub(super) fn sequences(all: &[Sequence], diagnoser: &Diagnoser) -> String {
    let inputs = diagnoser.environment.inputs.iter().map(|input| input.name.clone());
    let sensors = || diagnoser.sensors.iter().map(|sensor| sensor.name.as_str());
    let measured = sensors().map(|name| format!("measured {name}"));
    let twin = sensors().map(|name| format!("twin {name}"));
    let outcome = INTEGERS.iter().chain(&NUMBERS).map(|name| format!("outcome {name}"));
    let start = ["sequence", "entry", "command", "place"].map(String::from);
    let head: Vec<String> =
        start.into_iter().chain(inputs).chain(measured).chain(twin).chain(outcome).collect();
    let mut text = head.join(",") + "\n";
    for (number, sequence) in all.iter().enumerate() {
        let entry = match sequence.entry {
            Entry::Session => "session",
            Entry::Hybrid => "hybrid",
        };
        for (step, outcome) in sequence.steps.iter().zip(&sequence.outcomes) {
            text += &format!("{},{entry},{}\n", number + 1, line(step, outcome.as_ref()));
        }
    }
    text
}

fn line(step: &Step, outcome: Option<&([i64; 18], [f64; 3])>) -> String {
    let command = match step.command {
        Some((command, place)) => [COMMANDS[command].into(), place.to_string()],
        None => [String::new(), String::new()],
    };
    let sample = &step.sample;
    let values = sample.inputs.iter().chain(&sample.measured).chain(&sample.twin);
    let values = values.map(|value| number(*value));
    let outcome = match outcome {
        Some((integers, numbers)) => {
            let integers = integers.iter().map(i64::to_string);
            integers.chain(numbers.iter().map(|value| number(*value))).collect()
        }
        None => vec![String::new(); INTEGERS.len() + NUMBERS.len()],
    };
    command.into_iter().chain(values).chain(outcome).collect::<Vec<_>>().join(",")
}

/// The shortest decimal number with the same bits; C and Python read `nan` and `inf`.
fn number(value: f64) -> String {
    format!("{value:?}").to_lowercase()
}
