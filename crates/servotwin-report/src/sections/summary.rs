//! The results on one screen: the limits that are missed, the scenarios side by side, and
//! separately the comparison with the seed paper.

use super::flights;
use crate::Material;
use crate::lines::{self, OF_PAPER};
use crate::vocabulary::{PAPER, Vocabulary};
use crate::words::{NONE, percent, rate, stacked, three_digits};
use servotwin::job::Subject;
use servotwin::job::results::SubjectResult;
use servotwin::learn::Evaluation;
use servotwin::learn::protocol::Protocol;
use servotwin::measure::{VISIBLE, VISIBLE_BY_CHANCE};
use servotwin_diagnosis::hierarchy::Question;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let scenarios = lines::scenarios(material.results);
    let (study, words) = (material.study, &material.words());
    let limits = material.flights.map(|results| flights::limits(study, results, words));
    let Some(hardest) = scenarios.last() else {
        limits.iter().for_each(|limits| _ = page.note(missed_limits(limits)));
        return;
    };
    page.text(format!(
        "The virtual twin ({}) is compared with plants that have one of {} faults each, in {} \
             operating cases. Intervals are 95 %.",
        study.system.title,
        study.faults.len(),
        study.cases.len(),
    ));
    page.table("", side_by_side(&scenarios, words).captioned(format!(
            "{} Intervals are from drawing kinds of fault at their intensities, because rows of one are not \
             independent; those of healthy specimens, and above of single kinds, are Wilson's. In shaded \
             rows less is better.",
            held_out(&hardest.evaluation)
        )));
    page.text(format!(
            "From the differences between measured and expected sensor signals (residuals), decision trees \
             say {}what must be done (B), and what is broken (C and what follows); a committee of boosted \
             trees says it too, and may be silent.",
            match words.has_several() {
                true => format!("which {} failed (A), ", words.actuator()),
                false if is_asked(hardest) => "whether something is wrong (A), ".into(),
                false => String::new(),
            }
        ));
    limits.iter().for_each(|limits| _ = page.note(missed_limits(limits)));
    page.note(bands_in_use(&scenarios, words));
    if let Some(remark) = tripping(material) {
        page.note(&remark);
    }
    seed_paper(material, page);
}

/// Whether the actuator stage decides between classes.
fn is_asked(result: &SubjectResult) -> bool {
    let mut protocols = result.evaluation.protocols.iter();
    protocols.any(|judged| {
        judged.stages.iter().any(|s| s.question == Question::Actuator && lines::decides(s))
    })
}

/// How the headline holds rows out.
fn held_out(evaluation: &Evaluation) -> &'static str {
    match evaluation.headline().map(|result| result.protocol) {
        Some(Protocol::NewCommand) => {
            "New commands: trees and committee learned from training commands, none of which is among \
             the operating cases on which they are judged."
        }
        _ => "The fault that is judged was never seen at its intensity.",
    }
}

/// Names the limits at work that are missed.
fn missed_limits(limits: &[flights::Limit]) -> String {
    let missed = limits.iter().filter(|limit| limit.is_missed());
    let missed: Vec<String> = missed.map(flights::Limit::in_words).collect();
    match missed.as_slice() {
        [] => "None of the limits at work is missed for certain.".to_owned(),
        missed => format!("Limits missed: {}.", missed.join("; ")),
    }
}

/// A table with measures in rows and scenarios in columns.
fn side_by_side(scenarios: &[&SubjectResult], words: &Vocabulary) -> Table {
    let heads = ["".to_owned(), "by".to_owned()];
    let titles = scenarios.iter().map(|result| result.title.clone());
    let mut grid = Table::headed(heads.into_iter().chain(titles));
    let mut last = String::new();
    for row in lines::headline(scenarios, words) {
        let title = if row.title == last { String::new() } else { row.title.clone() };
        last = row.title;
        let mut cells = vec![title, row.who.to_owned()];
        cells.extend(row.rates.iter().map(|value| stacked(*value)));
        grid.push_if(row.is_safety, cells);
    }
    grid
}

/// Describes the band that each scenario uses for detection.
fn bands_in_use(scenarios: &[&SubjectResult], words: &Vocabulary) -> String {
    let band = |result: &&SubjectResult| match lines::learned(result) {
        Some(bands) => {
            let widths = || bands.iter().map(|band| 100.0 * band.half_width);
            let (least, most) = (widths().fold(f64::MAX, f64::min), widths().fold(0.0, f64::max));
            format!(
                "{}: learned from healthy specimens, sensor by sensor, ±{} … {} % of scale",
                result.title,
                three_digits(least),
                three_digits(most)
            )
        }
        None => format!("{}: {} of scale for every sensor", result.title, words.fixed_band()),
    };
    format!("Bands in use. {}.", scenarios.iter().map(band).collect::<Vec<_>>().join("; "))
}

/// Reports how often tolerances alone leave the fixed band.
fn tripping(material: &Material) -> Option<String> {
    let ideal = material.results.of(Subject::Ideal)?;
    let realistic = material.results.of(Subject::Realistic)?;
    let [realistic, ideal] = [realistic, ideal].map(|own| &own.evaluation.in_paper_band);
    let alarms = realistic.counted(&VISIBLE_BY_CHANCE).filter(|alarms| alarms.count > 0)?;
    Some(format!(
        "{} of faults leave the fixed band of ±3 % in the scenario realistic, and {} in the scenario ideal. \
         Tolerances alone leave it in {} of the realistic specimens without a fault.",
        percent(realistic.of(&VISIBLE).share),
        percent(ideal.of(&VISIBLE).share),
        rate(Some(alarms)),
    ))
}

/// Writes the seed paper's own test, separate from the other results.
fn seed_paper(material: &Material, page: &mut Document) {
    let Some(ideal) = material.results.of(Subject::Ideal) else {
        return;
    };
    let evaluation = &ideal.evaluation;
    let Some(trees) = evaluation.protocol(Protocol::RandomThird) else { return };
    // Only the paper's study has published values to compare with.
    if material.study.name != PAPER {
        return;
    }
    let mut grid = Table::headed([
        "",
        "seed paper",
        "its trees here, mean of random thirds",
        "of them below the seed paper",
        "trees of this report",
    ]);
    for thirds in &evaluation.random_thirds {
        let (letter, all) = (thirds.stage.as_str(), thirds.accuracies.len());
        let title = if letter == "A" { "actuator" } else { "action" };
        let paper = OF_PAPER.iter().find(|known| known.0 == letter).map(|known| known.1);
        grid.push(vec![
            format!("{letter}  {title}"),
            percent(paper),
            format!("{} ± {:.2}", percent(Some(thirds.mean())), 100.0 * thirds.deviation()),
            paper.map_or_else(|| NONE.into(), |paper| format!("{} of {all}", thirds.below(paper))),
            rate(trees.stage(letter).map(|score| score.accuracy)),
        ]);
    }
    page.table("", grid.captioned("Apart: the seed paper's own test, which is another question. No noise, plants that \
        are the twin but for one fault, and a third of the variants held out at random, so that nearly \
        every one has a neighbour in training (the same fault at the same intensity in another operating \
        case). It is kind, and no figure in it compares with those above. The seed paper's features are \
        mean, variance and indicator of each residual, each actuator by itself; its trees have Gini's criterion \
        and a depth of seven. The paper reports one random third; its spread stands beside the mean of many."));
}
