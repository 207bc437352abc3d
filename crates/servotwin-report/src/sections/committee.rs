//! The committee compared with the trees: its right answers, the calibration of its confidence, and
//! the gain from its abstentions.

use crate::Material;
use crate::lines::{self, Who};
use crate::looks;
use crate::page::{Alignment, HtmlTable, Page};
use crate::vocabulary::Vocabulary;
use crate::words::{by_kind, chosen, number, percent, share, spoken, stacked};
use servotwin::evaluation::abstention::{Abstention, Level};
use servotwin::evaluation::isolation::{Isolation, IsolationRates, IsolationRule, RULE};
use servotwin::evaluation::metrics::Rate;
use servotwin::evaluation::protocol::ALL;
use servotwin::job::results::SubjectResult;
use servotwin_plot::Figure;
use servotwin_plot::SemanticColor;
use servotwin_plot::lines::{Curve, Lines};

/// Reads a share of a level with the ends of its interval.
type Reading<'r> = &'r dyn Fn(&Level) -> Option<(f64, f64, f64)>;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
    let results: Vec<&SubjectResult> = lines::settings(material.results)
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
        page.table(&beside_trees(result, words), &format!(
                "Setting: {}. Trees and committee under the same protocols, with 95 % intervals from \
                 drawing kinds of fault at their intensities; “by kind” draws whole kinds.",
                result.title
            ));
    }
    believed(&results, words, page);
    silence(&results, words, page);
    isolation(&results, words, page);
}

fn beside_trees(result: &SubjectResult, words: &Vocabulary) -> HtmlTable {
    let heads = [("held out".to_owned(), Alignment::Left), ("by".to_owned(), Alignment::Left)];
    let right = lines::right(words);
    // With one actuator there is no actuator stage.
    let letters = if words.has_several() { &["A", "B"][..] } else { &["B"][..] };
    let stages = letters.iter().map(|letter| ((*letter).to_owned(), Alignment::Right));
    let measures = right.iter().map(|measure| (measure.title.clone(), Alignment::Right));
    let last = [("end to end, by kind".to_owned(), Alignment::Right)];
    let mut grid = HtmlTable::new(heads.into_iter().chain(stages).chain(measures).chain(last));
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
fn believed(results: &[&SubjectResult], words: &Vocabulary, page: &mut Page) {
    let mut lines = Lines::new("", "confidence", "share of right answers");
    lines.y_range = Some((0.0, 1.0));
    let mut grid = HtmlTable::new([
        ("setting", Alignment::Left),
        ("answers", Alignment::Right),
        ("in the most confident tenth", Alignment::Right),
        ("Brier score", Alignment::Right),
        ("calibration error", Alignment::Right),
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
        &format!(
            "Reliability: answers about {} on new commands, gathered by tenths of confidence. On the \
             straight line what is said with 90 % is right nine times in ten; points below it are too \
             sure. Points of low confidence stand for few answers.",
            words.action()
        ),
    );
    page.table(
        &grid,
        "The Brier score is the mean squared distance of confidence from being right (1) or wrong (0); \
         the calibration error the mean distance of confidence from the share of right answers over \
         the tenths. Both are best at zero.",
    );
}

/// Writes what the diagnosis gains when the committee abstains.
fn silence(results: &[&SubjectResult], words: &Vocabulary, page: &mut Page) {
    let mut begun = false;
    for result in results {
        let Some(abstention) = &result.evaluation.abstention else { continue };
        if !begun {
            page.heading("What its silence buys");
            page.text(
                "An answer that is withheld leaves the fault detected but not isolated: it is known \
                 that something is wrong, and not what. The least certain answers go first; rates are of the answers that are left.",
            );
            begun = true;
        }
        if abstention.levels.iter().all(is_flawless) {
            page.text(&format!(
                "Setting: {}. No answer about {} is wrong, none withheld or many: there is nothing to buy.",
                result.title,
                words.action_wrong()
            ));
            continue;
        }
        page.figure(
            &format!("silence_{}", result.subject.name()),
            trade(abstention, words),
            &format!(
                "Setting: {}. Errors of the committee on new commands among the answers that are left, \
                 against the share withheld; whiskers of the first curve: 95 %.",
                result.title
            ),
        );
        page.table(&levels(abstention, words), &format!(
            "Setting: {}. The same in numbers. The fixed confidence is the one that {} % of the answers \
             did not reach on training commands left out of training: chosen without looking at these.",
            result.title,
            chosen(100.0 * servotwin::evaluation::committee::WITHHELD)
        ));
    }
}

/// Writes what is decided if a fault may stay not isolated.
fn isolation(results: &[&SubjectResult], words: &Vocabulary, page: &mut Page) {
    let mut begun = false;
    for result in results {
        for isolation in &result.evaluation.isolation {
            if !begun {
                page.heading("Faults that may stay not isolated");
                page.text(&unknown_kinds(words));
                begun = true;
            }
            page.table(&rules(isolation, words), &format!(
                "Setting: {}; {}. Counts are of detected faults. The limit of resemblance leaves {} % of \
                 held-out known faults unlike the training rows of their own answer, and nothing else sets it.{}",
                result.title,
                words.adapted(&isolation.title),
                chosen(100.0 * isolation.level),
                match words.has_off() {
                    true => format!(" A {} also counts as missed if the fault is not isolated.", words.off()),
                    false => String::new(),
                },
            ));
            page.text(&wrong_kinds(isolation));
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
fn rules(isolation: &Isolation, words: &Vocabulary) -> HtmlTable {
    let (off, several) = (words.has_off(), words.has_off() && words.has_several());
    let mut heads = vec![
        ("decided".to_owned(), Alignment::Left),
        ("share decided".to_owned(), Alignment::Right),
        (format!("{} right, of decided", words.action()), Alignment::Right),
        ("right or not isolated".to_owned(), Alignment::Right),
    ];
    if several {
        heads
            .push((format!("healthy {} {}", words.unit(), words.switched_off()), Alignment::Right));
    }
    if off {
        heads.push((format!("{} missed", words.off()), Alignment::Right));
        heads.push((format!("needless {}", words.off()), Alignment::Right));
    }
    let mut grid = HtmlTable::new(heads);
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

fn is_flawless(level: &Level) -> bool {
    level.right_action.count == level.right_action.of
}

fn trade(abstention: &Abstention, words: &Vocabulary) -> Figure {
    let mut lines = Lines::new("", "answers withheld (%)", "of the answers that are left (%)");
    let curve = |name: &str, of: Reading| {
        let known = abstention.levels.iter().filter_map(|level| Some((level, of(level)?)));
        let known: Vec<_> = known
            .filter_map(|(level, values)| Some((100.0 * level.abstained.share?, values)))
            .collect();
        let percent = |share: f64| 100.0 * share;
        let points = known.iter().map(|&(at, (value, ..))| (at, percent(value))).collect();
        let ends = known.iter().map(|&(_, (_, low, high))| (percent(low), percent(high)));
        (Curve::new(name, points), ends.collect::<Vec<_>>())
    };
    let shown = |rate: Rate| Some((rate.share?, rate.low, rate.high));
    let missed = |level: &Level| shown(level.shutdown_answered_wrongly);
    let wrong_shutdown = |level: &Level| shown(level.wrong_actuator_shutdown);
    let wrong = |level: &Level| {
        let right = level.right_action;
        Some((1.0 - right.share?, 1.0 - right.high, 1.0 - right.low))
    };
    // The intervals of three curves at the same places would hide each other.
    let (worst, ends) = curve(&format!("{} wrong", words.action_wrong()), &wrong);
    lines = lines.with(worst.with_intervals(ends).looking(SemanticColor::Plain(0).look()));
    if words.has_off() {
        let title = format!("fault that calls for a {} answered wrongly", words.off());
        lines =
            lines.with(curve(&title, &missed).0.looking(SemanticColor::Command(0).look().at(1)));
    }
    if words.has_off() && words.has_several() {
        let title = format!("wrong {} {}", words.unit(), words.switched_off());
        lines = lines
            .with(curve(&title, &wrong_shutdown).0.looking(SemanticColor::Plain(1).look().at(2)));
    }
    lines.draw()
}

fn levels(abstention: &Abstention, words: &Vocabulary) -> HtmlTable {
    let mut heads = vec![
        ("answers only".to_owned(), Alignment::Left),
        ("withheld".to_owned(), Alignment::Right),
        (format!("{} right", words.action()), Alignment::Right),
    ];
    let (off, wrong_unit) = (words.has_off(), words.has_off() && words.has_several());
    if wrong_unit {
        let head = format!("wrong {} {}", words.unit(), words.switched_off());
        heads.push((head, Alignment::Right));
    }
    if off {
        heads.push((format!("{} fault answered wrongly", words.off()), Alignment::Right));
    }
    let mut grid = HtmlTable::new(heads);
    let mut push = |title: String, level: &Level| {
        // Without any abstention there is no rate to estimate.
        let withheld = match level.abstained.count {
            0 => "none".into(),
            _ => stacked(Some(level.abstained)),
        };
        let mut row = vec![title, withheld, stacked(Some(level.right_action))];
        row.extend(wrong_unit.then(|| stacked(Some(level.wrong_actuator_shutdown))));
        row.extend(off.then(|| stacked(Some(level.shutdown_answered_wrongly))));
        grid.push(row);
    };
    for (share, level) in servotwin::evaluation::abstention::SHARES.iter().zip(&abstention.levels) {
        let title = match *share {
            0.0 => "always".to_owned(),
            share => format!("but for the least certain {} %", chosen(100.0 * share)),
        };
        push(title, level);
    }
    if let Some((least, level)) = &abstention.fixed {
        push(format!("with a confidence of at least {}", number(*least)), level);
    }
    push("where the trees say the same".into(), &abstention.agreement);
    if let Some(both) = &abstention.both {
        push("with that confidence, and the trees agree".into(), both);
    }
    grid
}
