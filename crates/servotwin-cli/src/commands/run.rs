//! `servotwin run`: one run of a suite again, and what the diagnosis answered.

use super::workers;
use crate::failure::Failure;
use crate::{Global, Run, stop};
use servotwin::flight::worst_case::space::SearchSpace;
use servotwin::job::{self, Crew, Folder, Job, Subject};
use servotwin::measure::outcome::{self, FirstAction, Needed, RunOutcome};
use servotwin::nearest::UnknownName;
use servotwin::run::RunName;
use servotwin::study::{Purpose, Study};
use servotwin::text::{spoken, three_digits};
use servotwin_report::explain::{
    ExplainedAnswer, ExplainedVerdict, Explanation, explain, variants,
};
use servotwin_report::vocabulary::Vocabulary;
use servotwin_report::words::{of_unit, percent};
use servotwin_view::document::{Document, Fact, Table, Value, Verdict, fact};
use servotwin_view::row;
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
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

impl Run for Options {
    fn run(&self, _: Global) -> Result<Document, Failure> {
        let folder = Folder::new(&self.folder);
        let study = folder.read_study()?;
        match study.records(Purpose::Test).name == self.name.suite {
            true => record((&folder, &study), self),
            false => flight((&folder, &study), self),
        }
    }
}

/// Flies a run and describes its outcome, with the columns of the table of outcomes.
fn flight(
    (folder, study): (&Folder, &Study),
    Options { name, threads, .. }: &Options,
) -> Result<Document, Failure> {
    stop::heed();
    let space = SearchSpace::of_run(study, name);
    let job = Job { crew: Crew::quiet(workers(*threads)), ..Job::new(study, folder) };
    let flown = match space {
        Some(space) => job.fly_again(name, &space),
        None => job.fly_run(name),
    };
    stop::check()?;
    let flown = flown?;
    let answer = flown.first().map(flight_in_words).unwrap_or_default();
    let mut document = Document::new("run", Verdict::neutral(format!("{name}: {answer}")));
    flown.first().iter().for_each(|row| _ = document.facts("", conditions(row)));
    for row in flown.iter().skip(1) {
        let (target, answer) = (three_digits(row.target_per_h), flight_in_words(row));
        document.text(format!("with a target of {target} false alarms per hour: {answer}"));
    }
    let columns = outcome::table(&[]);
    let mut details = Table::of(":column | :value | :meaning");
    for row in &flown {
        let fields = serde_json::json!(row);
        for column in columns.columns() {
            let value = &fields[&column.name];
            if !value.is_null() && *value != "" {
                details.push(row![&column.name, value.to_string(), &column.description]);
            }
        }
    }
    document.table("", details).detail();
    document.data("outcomes", &flown);
    Ok(document)
}

/// In what a flight went on.
fn conditions(row: &RunOutcome) -> Vec<Fact> {
    let right = match row.needed {
        _ if !row.action.is_empty() => &row.action,
        Needed::Shutdown => "any shutdown",
        Needed::NoShutdown => "any action but a shutdown",
        Needed::Any => "any action",
        // No class of the study lists the fault.
        Needed::Nothing | Needed::ItsAction => "not known",
    };
    vec![
        fact("environment", "environment", row.environment),
        fact("event", "event", Value::name(&row.event)),
        fact("intensity", "intensity", Value::digits(row.intensity, 5)),
        fact("onset", "onset", row.onset_s.map(|time_s| Value::seconds(time_s, 4))),
        fact("right", "right is", row.onset_s.map(|_| Value::name(right))),
        fact("visible", "visible since", row.visible_s.map(|time_s| Value::seconds(time_s, 3))),
        fact("at_fault", "at fault", Value::name(&row.at_fault)),
        fact("duration", "duration", Value::seconds(row.duration_s, 4)),
    ]
}

/// What the diagnosis did in a flight.
fn flight_in_words(row: &RunOutcome) -> String {
    match (row.first, row.first_action_s) {
        _ if !row.is_finished => "the flight could not be simulated to its end".into(),
        (FirstAction::None, _) | (_, None) if row.onset_s.is_none() => {
            "no fault, and no action".into()
        }
        (FirstAction::None, _) | (_, None) => "no action after the onset".into(),
        (first, Some(after_s)) => {
            let judgement = match first {
                FirstAction::Right => "right",
                FirstAction::OtherActuator => "WRONG, against a healthy actuator",
                _ if row.needed == Needed::Nothing => "nothing to compare with",
                _ => "another action than the right one",
            };
            let of = [&row.first_action, &row.first_actuator].map(|name| spoken(name)).join(" ");
            format!(
                "first action {} s after the onset: {} ({judgement})",
                three_digits(after_s),
                of.trim()
            )
        }
    }
}

/// Explains the trees' answer for a record.
fn record(
    (folder, study): (&Folder, &Study),
    Options { name, .. }: &Options,
) -> Result<Document, Failure> {
    let subjects = job::subjects(folder, study)?;
    let subject = Subject::of(name.scenario);
    if !subjects.contains(&subject) {
        let known = subjects.iter().map(|subject| subject.name().into()).collect();
        let given = name.scenario.name().into();
        return Err(UnknownName { what: "data set", given, known }.into());
    }
    match explain(folder, study, subject, name.number as u32)? {
        Some(explanation) => {
            let mut document = explained(&explanation, &Vocabulary::of(study));
            let title = Value::of(subject.title(study), &subject.name());
            document.fact("scenario", "scenario", title);
            Ok(document)
        }
        None => {
            let last = variants(folder, subject)?.saturating_sub(1);
            Err(Failure::out_of_range("RUN", name, format!("0 to {last} in this data set")))
        }
    }
}

fn explained(explanation: &Explanation, words: &Vocabulary) -> Document {
    let Explanation { variant, case, fault, intensity, largest_residual, .. } = explanation;
    let mut document =
        Document::new("run", Verdict::neutral(together(&explanation.verdict, words)));
    document.fact("variant", "variant", *variant);
    document.fact("fault", "fault", fault);
    document.fact("intensity", "intensity", Value::number(*intensity, intensity.to_string()));
    document.fact("case", "case", case);
    document.fact(
        "largest_residual",
        "largest residual",
        Value::number(*largest_residual, percent(Some(*largest_residual))),
    );
    if !explanation.failure.is_empty() {
        document.note(format!("not simulated to the end: {}", explanation.failure));
    }
    if !explanation.detectable {
        document.note("not detected: no residual leaves its band, so nothing would be asked");
    }
    explanation.stages.iter().for_each(|answer| stage(answer, words, &mut document));
    document.data("explanation", explanation);
    document
}

/// Describes the combined answer of trees and committee.
fn together(verdict: &ExplainedVerdict, words: &Vocabulary) -> String {
    // With one actuator there is no actuator stage.
    let actuator = verdict.actuator.as_deref().filter(|_| words.has_several());
    let said: Vec<String> =
        actuator.into_iter().chain(verdict.action.as_deref()).map(spoken).collect();
    let said = if said.is_empty() { "nothing".into() } else { said.join(", ") };
    let sure = percent(verdict.confidence);
    match verdict.outcome {
        "isolated" => format!("together: {said}; the committee is {sure} sure"),
        "not_isolated" => {
            format!(
                "together: detected, but not isolated; the committee answers {said} with probability {sure}"
            )
        }
        _ => "together: healthy".into(),
    }
}

/// The way through the tree of a stage.
fn stage(answer: &ExplainedAnswer, words: &Vocabulary, document: &mut Document) {
    let asks = words.asks(answer.question);
    let verdict = match answer.said == answer.truth {
        true => "right".to_owned(),
        false => format!("WRONG, it is {}", spoken(&answer.truth)),
    };
    let sure = answer.purity.map(|p| format!(", leaf {} pure", percent(Some(p))));
    document.heading(format!(
        "{}  {asks}  {} ({verdict}{})",
        answer.stage,
        spoken(&answer.said),
        sure.unwrap_or_default()
    ));
    let mut table = Table::of(":feature | :value | :_ | :threshold | :meaning");
    for step in &answer.steps {
        let number = |value| Value::number(value, of_unit(value, &step.unit));
        let sign = if step.above { ">" } else { "≤" };
        let (value, threshold) = (number(step.value), number(step.threshold));
        table.push(row![&step.feature, value, sign, threshold, &step.meaning]);
    }
    document.table("", table);
}
