//! The consequences of errors, by name.

use crate::lines::{self, Who};
use crate::vocabulary::Vocabulary;
use crate::words::{share, spoken, stacked};
use crate::{Material, hardest_first};
use servotwin::job::results::SubjectResult;
use servotwin::learn::protocol::{ComponentScore, ProtocolResult};
use servotwin::measure::{self, Measure};
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let scenarios = lines::scenarios(material.results);
    if scenarios.is_empty() {
        return;
    }
    let words = &material.words();
    match words.has_off() {
        true => about(words, page),
        false => {
            _ = page.text(
                "The study says of no action that it switches its actuator off ([reactions], \
                 switches_off): so nothing is counted about missed, needless or wrong switching.",
            )
        }
    }
    hardest_first(&scenarios, page, &|result, page| {
        let grid = grid(result, words);
        if !grid.is_empty() {
            page.table("", grid.captioned(format!(
                    "Scenario: {}. 95 % intervals from drawing kinds of fault at their intensities.",
                    result.title
                )));
        }
    });
    healthy(material, words, page);
    hardest_first(&scenarios, page, &|result, page| {
        if let Some(headline) = result.evaluation.headline() {
            components(headline, &result.title, words, page);
        }
    });
}

fn about(words: &Vocabulary, page: &mut Document) {
    let (actuator, off) = (words.actuator(), words.off());
    let mut text = String::from("Not every error is equally bad. ");
    if words.has_several() {
        text += &format!(
            "Worst is that a healthy {actuator} is {} because another one has a fault: {} are then lost. ",
            words.switched_off(),
            words.two()
        );
    }
    text += &format!(
        "To miss a {off} leaves a failed {actuator} in the loop; a needless one costs what the {actuator} does."
    );
    page.text(&text);
    page.text(format!(
        "A fault that is never detected is not {} either: so what is missed is given twice, of the \
         detected faults that call for a {off} and of all that do. Protocols that test some faults \
         several times or not at all have no second figure.",
        words.switched_off()
    ));
}

/// A table with one row for each protocol and classifier, and one column for each measure.
fn grid(result: &SubjectResult, words: &Vocabulary) -> Table {
    let answers = lines::answers(&result.evaluation);
    let is_counted = |measure: &&Measure| {
        answers.iter().any(|(_, judged)| judged.rates.counted(measure).is_some())
    };
    let safety: Vec<&Measure> = lines::SAFETY.into_iter().filter(is_counted).collect();
    let mut heads = vec!["held out".to_owned(), "by".to_owned()];
    heads.extend(safety.iter().map(|measure| words.measure(measure)));
    let mut grid = Table::headed(heads);
    for &(who, judged) in answers.iter().filter(|_| !safety.is_empty()) {
        let title = if who == Who::Trees { words.adapted(&judged.title) } else { String::new() };
        let mut row = vec![title, who.title().to_owned()];
        row.extend(safety.iter().map(|measure| stacked(judged.rates.counted(measure))));
        grid.push(row);
    }
    grid
}

/// Writes the answers for healthy specimens, one row for each scenario.
fn healthy(material: &Material, words: &Vocabulary, page: &mut Document) {
    let mut heads = vec!["scenario".to_owned(), "specimens".to_owned(), "alarm".to_owned()];
    for who in Who::ALL {
        heads.push(format!("faulty by {}", who.title()));
        if words.has_off() {
            heads.push(format!("{} by {}", words.switched_off(), who.title()));
        }
    }
    let mut grid = Table::headed(heads);
    for result in &material.results.subjects {
        let evaluation = &result.evaluation;
        let Some(alarms) = evaluation.in_band.counted(&measure::VISIBLE_BY_CHANCE) else {
            continue;
        };
        let mut row = vec![result.title.clone(), alarms.of.to_string(), stacked(Some(alarms))];
        for who in Who::ALL {
            let rates = who.of_healthy(evaluation);
            row.push(stacked(rates.counted(&measure::FALSE_ALARM)));
            row.extend(words.has_off().then(|| stacked(rates.counted(&measure::FALSE_SHUTDOWN))));
        }
        grid.push(row);
    }
    if !grid.is_empty() {
        page.table("", grid.captioned("Specimens without a fault, of the judged operating cases: share that leaves the bands in \
             use, and those that are then taken for faulty, always of all specimens. Trees and committee may answer “healthy”."));
    }
}

/// Writes the components whose faults are attributed to the wrong actuator, or not isolated.
fn components(result: &ProtocolResult, title: &str, words: &Vocabulary, page: &mut Document) {
    let actuator = words.actuator();
    let mut heads = vec!["component".to_owned(), "tests".to_owned()];
    let (several, off) = (words.has_several(), words.has_several() && words.has_off());
    if several {
        heads.push(format!("wrong {actuator}"));
    }
    if off {
        heads.push(format!("wrong {actuator} {}", words.switched_off()));
    }
    heads.push("end to end right".to_owned());
    let mut grid = Table::headed(heads);
    let mut list: Vec<_> = result.components.iter().collect();
    let right = |own: &ComponentScore| own.rates.of(&measure::END_TO_END);
    let right_share = |own: &ComponentScore| right(own).share.unwrap_or(1.0);
    list.sort_by(|a, b| right_share(a).total_cmp(&right_share(b)));
    for own in list {
        let mut row = vec![spoken(&own.component), right(own).of.to_string()];
        row.extend(several.then(|| share(own.rates.counted(&measure::WRONG_ACTUATOR))));
        row.extend(off.then(|| share(own.rates.counted(&measure::WRONG_SHUTDOWN))));
        row.push(stacked(Some(right(own))));
        grid.push(row);
    }
    if !grid.is_empty() {
        page.table("", grid.captioned(format!(
            "Scenario: {title}; trees; {}. Errors by the component that is broken, the worst first.",
            result.title
        )));
    }
}
