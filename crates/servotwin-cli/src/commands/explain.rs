//! `servotwin explain`: explains the trees' answer for one variant.

use crate::Global;
use crate::failure::Failure;
use crate::render::{Side, TextTable, json};
use serde_json::json;
use servotwin::job::{self, Folder, Subject};
use servotwin::nearest::UnknownName;
use servotwin_report::explain::{
    ExplainedAnswer, ExplainedVerdict, Explanation, explain, variants,
};
use servotwin_report::vocabulary::Vocabulary;
use servotwin_report::words::{of_unit, percent, spoken};
use std::path::PathBuf;

/// Explain the trees' answer for one variant.
///
/// Shows every question with its value and its threshold.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The number of the variant in the data set, counted from 0.
    variant: u32,
    /// The output folder of a campaign that `servotwin train` has processed.
    #[arg(long, value_name = "FOLDER", default_value = "out")]
    out: PathBuf,
    /// The data set, named by its scenario and sensors [default: realistic if it exists, else the last one of the
    /// report].
    #[arg(long, value_parser = Subject::ALL.map(Subject::name))]
    subject: Option<String>,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = Folder::new(&options.out);
    let study = folder.read_study()?;
    let subjects = job::subjects(&folder, &study)?;
    let found = match &options.subject {
        Some(name) => subjects.iter().find(|subject| subject.name() == name).copied(),
        None => Subject::default_among(&subjects),
    };
    let subject = found.ok_or_else(|| {
        let known = subjects.iter().map(|subject: &Subject| subject.name().into()).collect();
        let given = options.subject.clone().unwrap_or_default();
        Failure::from(UnknownName { what: "data set", given, known })
    })?;
    match explain(&folder, &study, subject, options.variant)? {
        Some(explanation) => Ok(match global.json {
            true => {
                let mut explained = json!(explanation);
                explained["scenario"] = subject.name().into();
                json(&explained)
            }
            false => {
                let words = people(&explanation, &Vocabulary::of(&study));
                format!("scenario {}: {words}", subject.title(&study))
            }
        }),
        None => {
            let last = variants(&folder, subject)?.saturating_sub(1);
            let range = format!("0 to {last} in this data set").into();
            Err(Failure::OutOfRange {
                option: "VARIANT",
                given: options.variant.to_string(),
                range,
            })
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
