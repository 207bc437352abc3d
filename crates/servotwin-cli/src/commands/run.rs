//! `servotwin run`: one run of a suite again, and what the diagnosis answered.

use super::workers;
use crate::failure::Failure;
use crate::render::{Side, TextTable, json};
use crate::{Global, stop};
use serde_json::json;
use servotwin::flight::outcome::{self, FirstAction, FlightOutcome, Needed};
use servotwin::flight::worst_case::space::SearchSpace;
use servotwin::job::{self, Folder, Subject, flights, outcomes, worst_case};
use servotwin::nearest::UnknownName;
use servotwin::run::RunName;
use servotwin::study::{Purpose, Study};
use servotwin_report::explain::{
    ExplainedAnswer, ExplainedVerdict, Explanation, explain, variants,
};
use servotwin_report::vocabulary::Vocabulary;
use servotwin_report::words::{number, of_unit, percent, spoken};
use std::fmt::Write;
use std::path::PathBuf;

/// Run one run of a suite again, or explain the trees' answer for a record.
///
/// A run has the name suite#number@scenario, and the number is that of the suite's table. A flight, such as
/// judge#17@realistic, is flown with the diagnoser in the folder, to the bit as among all others of its suite, and
/// its outcome is printed; the flights of a worst-case search have names, too. Of a record, such as cases#17@realistic, every question of the trees is shown with its
/// value and its threshold.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The name of the run.
    #[arg(value_name = "RUN")]
    name: RunName,
    /// The output folder of its study.
    #[arg(value_name = "FOLDER", default_value = "out")]
    folder: PathBuf,
    /// Explain the answer with the extra sensor of the study.
    #[arg(long)]
    extra_sensor: bool,
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.folder);
    let study = folder.read_study()?;
    match study.records(Purpose::Test).name == options.name.suite {
        true => record((&folder, &study), options, global),
        false => flight((&folder, &study), options, global),
    }
}

/// Flies a run and describes its outcome, with the columns of the table of outcomes.
fn flight(
    (folder, study): (&Folder, &Study),
    Options { name, threads, .. }: &Options,
    global: Global,
) -> Result<String, Failure> {
    stop::heed();
    let is_full = flights::results(folder)?.is_some_and(|results| results.is_full);
    let space = SearchSpace::of_run(study, name);
    let flown = match space {
        Some(space) => worst_case::fly_again(folder, study, (name, &space), workers(*threads)),
        None => outcomes::fly_run(folder, (study, is_full), name, workers(*threads)),
    };
    stop::check()?;
    let flown = flown?;
    if global.json {
        return Ok(json(&json!(flown)));
    }
    let mut text = String::new();
    for row in &flown {
        let _ = writeln!(text, "{name}: {}", flight_in_words(row));
        let fields = json!(row);
        let columns = outcome::table(&[]);
        let known = columns.columns().iter().map(|column| (&column.name, &fields[&column.name]));
        for (column, value) in known.filter(|(_, value)| !value.is_null() && **value != "") {
            let _ = writeln!(text, "  {column}: {value}");
        }
    }
    Ok(text)
}

/// What happened in a flight, and what the diagnosis did.
fn flight_in_words(row: &FlightOutcome) -> String {
    let truth = match row.onset_s {
        None => "no fault".into(),
        Some(onset_s) => {
            let right = match row.needed {
                _ if !row.action.is_empty() => &row.action,
                Needed::Shutdown => "any shutdown",
                Needed::NoShutdown => "any action but a shutdown",
                Needed::Any => "any action",
                // No class of the study lists the fault.
                Needed::Nothing | Needed::ItsAction => "not known",
            };
            format!(
                "{}, intensity {}, from {} s on; right is: {}",
                spoken(&row.event),
                row.intensity,
                number(onset_s),
                spoken(right)
            )
        }
    };
    let answer = match (row.first, row.first_action_s) {
        _ if !row.is_finished => "the flight could not be simulated to its end".into(),
        (FirstAction::None, _) | (_, None) => "no action after the onset".into(),
        (first, Some(after_s)) => {
            let judged = match first {
                FirstAction::Right => "right",
                FirstAction::OtherActuator => "WRONG, against a healthy actuator",
                _ if row.needed == Needed::Nothing => "nothing to compare with",
                _ => "another action than the right one",
            };
            let of = [&row.first_action, &row.first_actuator].map(|name| spoken(name)).join(" ");
            format!("first action {} s after the onset: {} ({judged})", number(after_s), of.trim())
        }
    };
    format!("{truth}\n  {answer}")
}

/// Explains the trees' answer for a record.
fn record(
    (folder, study): (&Folder, &Study),
    Options { name, extra_sensor, .. }: &Options,
    global: Global,
) -> Result<String, Failure> {
    let subjects = job::subjects(folder, study)?;
    let is_it = |subject: &&Subject| {
        subject.scenario() == name.scenario && subject.extra_sensor() == *extra_sensor
    };
    let subject = *subjects.iter().find(is_it).ok_or_else(|| {
        let known = subjects.iter().map(|subject: &Subject| subject.name().into()).collect();
        let given = match extra_sensor {
            true => Subject::ExtraSensor.name().into(),
            false => name.scenario.name().into(),
        };
        Failure::from(UnknownName { what: "data set", given, known })
    })?;
    match explain(folder, study, subject, name.number as u32)? {
        Some(explanation) => Ok(match global.json {
            true => {
                let mut explained = json!(explanation);
                explained["scenario"] = subject.name().into();
                json(&explained)
            }
            false => {
                let words = people(&explanation, &Vocabulary::of(study));
                format!("scenario {}: {words}", subject.title(study))
            }
        }),
        None => {
            let last = variants(folder, subject)?.saturating_sub(1);
            let range = format!("0 to {last} in this data set").into();
            Err(Failure::OutOfRange { option: "RUN", given: name.to_string(), range })
        }
    }
}

fn people(explanation: &Explanation, words: &Vocabulary) -> String {
    let Explanation { variant, case, fault, intensity, largest_residual, .. } = explanation;
    let mut text = format!(
        "variant {variant}: {fault}, intensity {intensity}, case {case}; largest residual {}\n",
        percent(Some(*largest_residual))
    );
    if !explanation.failure.is_empty() {
        text += &format!("not simulated to the end: {}\n", explanation.failure);
    }
    if !explanation.detectable {
        text += "not detected: no residual leaves its band, so nothing would be asked\n";
    }
    text += &verdict(&explanation.verdict, words);
    explanation.stages.iter().for_each(|answer| text += &stage(answer, words));
    text
}

/// Describes the combined answer of trees and committee.
fn verdict(verdict: &ExplainedVerdict, words: &Vocabulary) -> String {
    // With one actuator there is no actuator stage.
    let unit = verdict.actuator.as_deref().filter(|_| words.has_several());
    let said: Vec<String> =
        unit.into_iter().chain(verdict.command.as_deref()).map(spoken).collect();
    let said = if said.is_empty() { "nothing".into() } else { said.join(", ") };
    let sure = percent(verdict.confidence);
    match verdict.outcome {
        "isolated" => format!("together: {said}; the committee is {sure} sure\n"),
        "not_isolated" => {
            format!(
                "together: detected, but not isolated; the committee answers {said} with probability {sure}\n"
            )
        }
        _ => "together: healthy\n".into(),
    }
}

fn stage(answer: &ExplainedAnswer, words: &Vocabulary) -> String {
    let asks = words.asks(answer.question);
    let verdict = match answer.said == answer.truth {
        true => "right".to_owned(),
        false => format!("WRONG, it is {}", spoken(&answer.truth)),
    };
    let sure = answer.purity.map(|p| format!(", leaf {} pure", percent(Some(p))));
    let mut text = format!(
        "\n{}  {asks}  {} ({verdict}{})\n",
        answer.stage,
        spoken(&answer.said),
        sure.unwrap_or_default()
    );
    let mut grid = TextTable::new(&[
        ("", Side::Left),
        ("feature", Side::Left),
        ("value", Side::Right),
        ("", Side::Left),
        ("threshold", Side::Right),
        ("meaning", Side::Left),
    ]);
    for step in &answer.steps {
        grid.push(vec![
            "  ".into(),
            step.feature.clone(),
            of_unit(step.value, &step.unit),
            if step.above { ">" } else { "≤" }.into(),
            of_unit(step.threshold, &step.unit),
            step.meaning.clone(),
        ]);
    }
    if !answer.steps.is_empty() {
        text += &grid.text();
    }
    text
}
