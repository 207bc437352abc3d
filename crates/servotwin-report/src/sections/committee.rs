//! The committee compared with the trees: its right answers, the calibration of its confidence, and what may stay not
//! isolated.

use crate::Material;
use crate::lines::{self, Who};
use crate::looks;
use crate::vocabulary::Vocabulary;
use crate::words::{by_kind, chosen, number, percent, share, spoken, stacked};
use servotwin::evaluation::isolation::{Isolation, IsolationRates, IsolationRule, RULE};
use servotwin::evaluation::metrics::Rate;
use servotwin::evaluation::protocol::ALL;
use servotwin::job::results::SubjectResult;
use servotwin_view::SemanticColor;
use servotwin_view::document::{Document, Table};
use servotwin_view::lines::{Curve, Lines};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let results: Vec<&SubjectResult> = lines::scenarios(material.results)
        .into_iter()
        .filter(|result| !result.evaluation.committee.is_empty())
        .collect();
    if results.is_empty() {
        return;
    }
    page.text(
            "Beside the trees stands a committee: boosted shallow trees at the same places, over the \
             same features. It cannot be read as a tree can, but it says how sure it \
             is. Its probabilities are calibrated on training commands that were left out of training. \
             The trees remain the first answer, the one that explains itself; where the committee says \
             something else, or is not sure enough, the outcome is “detected, not isolated”.",
        );
    let words = &material.words();
    for result in &results {
        page.table("", beside_trees(result, words).captioned(format!(
                "Scenario: {}. Trees and committee under the same protocols, with 95 % intervals from \
                 drawing kinds of fault at their intensities; “by kind” draws whole kinds.",
                result.title
            )));
    }
    believed(&results, words, page);
    isolation(&results, words, page);
}

fn beside_trees(result: &SubjectResult, words: &Vocabulary) -> Table {
    let heads = ["held out".to_owned(), "by".to_owned()];
    let right = lines::right(words);
    // With one actuator there is no actuator stage.
    let letters = if words.has_several() { &["A", "B"][..] } else { &["B"][..] };
    let stages = letters.iter().map(|letter| (*letter).to_owned());
    let measures = right.iter().map(|measure| measure.title.clone());
    let last = ["end to end, by kind".to_owned()];
    let mut grid = Table::headed(heads.into_iter().chain(stages).chain(measures).chain(last));
    for protocol in ALL {
        let Some(committee) = result.evaluation.committee(protocol) else { continue };
        for who in Who::ALL {
            let Some(judged) = who.under(&result.evaluation, protocol) else { continue };
            let title =
                if who == Who::Trees { words.adapted(&committee.title) } else { String::new() };
            let mut row = vec![title, who.title().to_owned()];
            let accuracy = |letter| stacked(judged.stage(letter).map(|score| score.accuracy));
            row.extend(letters.iter().map(|letter| accuracy(letter)));
            row.extend(right.iter().map(|measure| stacked((measure.rate)(judged))));
            row.push(by_kind(judged.end_to_end));
            match who {
                Who::Trees => grid.push(row),
                Who::Committee => grid.push_strong(row),
            }
        }
    }
    grid
}

/// Writes how well the confidence is calibrated.
fn believed(results: &[&SubjectResult], words: &Vocabulary, page: &mut Document) {
    let mut lines = Lines::new("", "confidence", "share of right answers");
    lines.y_range = Some((0.0, 1.0));
    let mut grid = Table::headed([
        "scenario",
        "answers",
        "in the most confident tenth",
        "Brier score",
        "calibration error",
    ]);
    for result in results {
        let Some(reliability) = &result.evaluation.reliability else { continue };
        let points = reliability.bins.iter().map(|&(mean, share, _)| (mean, share)).collect();
        lines =
            lines.with(Curve::new(&result.title, points).looking(looks::subject(result.subject)));
        let answers: u64 = reliability.bins.iter().map(|bin| bin.2).sum();
        let sure = reliability.bins.iter().filter(|bin| bin.0 >= 0.9).map(|bin| bin.2).sum::<u64>();
        grid.push(vec![
            result.title.clone(),
            answers.to_string(),
            percent((answers > 0).then(|| sure as f64 / answers as f64)),
            number(reliability.brier),
            number(reliability.calibration_error),
        ]);
    }
    if grid.is_empty() {
        return;
    }
    page.heading("How far its confidence can be believed");
    let ideal = Curve::new("as sure as right", vec![(0.0, 0.0), (1.0, 1.0)]).unmarked();
    let ideal = ideal.looking(SemanticColor::Plain(1).look());
    page.figure(
        "reliability",
        lines.with(ideal).draw(),
        format!(
            "Reliability: answers about {} on new commands, gathered by tenths of confidence. On the \
             straight line what is said with 90 % is right nine times in ten; points below it are too \
             sure. Points of low confidence stand for few answers.",
            words.action()
        ),
    );
    page.table("", grid.captioned("The Brier score is the mean squared distance of confidence from being right (1) or wrong (0); \
         the calibration error the mean distance of confidence from the share of right answers over \
         the tenths. Both are best at zero."));
}

/// Writes what is decided if a fault may stay not isolated.
fn isolation(results: &[&SubjectResult], words: &Vocabulary, page: &mut Document) {
    let mut begun = false;
    for result in results {
        for isolation in &result.evaluation.isolation {
            if !begun {
                page.heading("Faults that may stay not isolated");
                page.text(unknown_kinds(words));
                begun = true;
            }
            page.table("", rules(isolation, words).captioned(format!(
                "Scenario: {}; {}. Counts are of detected faults. The limit of resemblance leaves {} % of \
                 held-out known faults unlike the training rows of their own answer, and nothing else sets it.{}",
                result.title,
                words.adapted(&isolation.title),
                chosen(100.0 * isolation.level),
                match words.has_off() {
                    true => format!(" A {} also counts as missed if the fault is not isolated.", words.off()),
                    false => String::new(),
                },
            )));
            page.text(wrong_kinds(isolation));
        }
    }
}

/// The kinds of fault that the rule decides wrongly, in words.
fn wrong_kinds(isolation: &Isolation) -> String {
    let named =
        |(kind, rate): &(String, Rate)| format!("{} ({} of {})", spoken(kind), rate.count, rate.of);
    let named: Vec<String> = isolation.wrong_kinds.iter().take(WRONG_KINDS).map(named).collect();
    match isolation.wrong_kinds.len() {
        0 => "The rule in bold decides no fault wrongly.".into(),
        all if all > WRONG_KINDS => format!(
            "The rule in bold decides some faults of {all} kinds wrongly, most often {}.",
            named.join(", ")
        ),
        _ => format!("The rule in bold decides some faults wrongly: {}.", named.join(", ")),
    }
}

/// The number of wrongly decided kinds that are named.
const WRONG_KINDS: usize = 5;

fn unknown_kinds(words: &Vocabulary) -> String {
    format!(
        "A fault of an unknown kind has no right class. It should stay “not isolated”: something is wrong \
         with this {}, nothing is {} because of it, and a person or the limits of the system decide. Each \
         rule below is stricter than the one before. The last two compare a fault with the training rows of \
         each answer, in units of the scatter of faults of one kind and intensity.",
        words.unit(),
        words.switched_off(),
    )
}

/// A table with one row for each rule.
fn rules(isolation: &Isolation, words: &Vocabulary) -> Table {
    let (off, several) = (words.has_off(), words.has_off() && words.has_several());
    let mut heads = vec![
        "decided".to_owned(),
        "share decided".to_owned(),
        format!("{} right, of decided", words.action()),
        "right or not isolated".to_owned(),
    ];
    if several {
        heads.push(format!("healthy {} {}", words.unit(), words.switched_off()));
    }
    if off {
        heads.push(format!("{} missed", words.off()));
        heads.push(format!("needless {}", words.off()));
    }
    let mut grid = Table::headed(heads);
    for rates in &isolation.rules {
        let mut row = vec![decided_where(rates).to_owned()];
        let shown = [rates.decided, rates.right_action, rates.right_or_not_isolated];
        row.extend(shown.map(counted));
        row.extend(several.then(|| counted(rates.wrong_actuator_shutdown)));
        row.extend(off.then(|| counted(rates.missed_shutdown)));
        row.extend(off.then(|| counted(rates.needless_shutdown)));
        match rates.rule {
            RULE => grid.push_strong(row),
            _ => grid.push(row),
        }
    }
    grid
}

fn decided_where(rates: &IsolationRates) -> &'static str {
    match rates.rule {
        IsolationRule::Always => "always, by the committee",
        IsolationRule::Agreement => "where the trees agree",
        IsolationRule::Explained => "and rows of the same answer resemble it",
        IsolationRule::ExplainedAlone => "and rows of no other answer do",
    }
}

/// A share with its count below it.
fn counted(rate: Rate) -> String {
    format!("{}\n{} of {}", share(Some(rate)), rate.count, rate.of)
}
