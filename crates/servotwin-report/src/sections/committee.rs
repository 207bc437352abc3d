//! The committee beside the trees, and what may stay not isolated.

use crate::Material;
use crate::lines;
use crate::vocabulary::Vocabulary;
use crate::words::{chosen, count_of, share, spoken};
use servotwin::job::results::SubjectResult;
use servotwin::learn::isolation::LEVEL;
use servotwin::learn::metrics::Rate;
use servotwin::learn::protocol::ProtocolResult;
use servotwin::measure::{self, Measure};
use servotwin_view::document::{Document, Table};

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
    isolation(&results, words, page);
}

/// Writes what trees and committee decide together if a fault may stay not isolated.
fn isolation(results: &[&SubjectResult], words: &Vocabulary, page: &mut Document) {
    let mut grid = Table::headed(heads(words));
    let mut wrong = vec![];
    for result in results {
        for isolation in &result.evaluation.isolation {
            grid.push(row(result, isolation, words));
            wrong.extend(wrong_kinds(result, isolation, words));
        }
    }
    if grid.is_empty() {
        return;
    }
    page.heading("Faults that may stay not isolated");
    page.text(format!(
        "A fault of an unknown kind has no right class. It should stay “not isolated”: something is wrong with this \
         {}, nothing is {} because of it, and a person or the limits of the system decide. A fault is isolated where \
         trees and committee agree, and training rows of their answer resemble it, in units of the scatter of faults \
         of one kind and intensity.",
        words.actuator(),
        words.switched_off(),
    ));
    page.table(
        "",
        grid.captioned(format!(
            "Counts are of detected faults. The limit of resemblance leaves {} % of held-out known faults unlike the \
             training rows of their own answer, and nothing else sets it.{}",
            chosen(100.0 * LEVEL),
            match words.has_off() {
                true => format!(
                    " A {} also counts as missed if the fault is not isolated.",
                    words.off()
                ),
                false => String::new(),
            },
        )),
    );
    wrong.into_iter().for_each(|text| _ = page.text(text));
}

/// The number of wrongly decided kinds that are named.
const WRONG_KINDS: usize = 5;

/// The kinds of fault that are decided wrongly, in words; `None` without any.
fn wrong_kinds(
    result: &SubjectResult,
    isolation: &ProtocolResult,
    words: &Vocabulary,
) -> Option<String> {
    let kinds = isolation.wrong_kinds();
    let named =
        |(kind, [wrong, of]): &(&str, [u64; 2])| format!("{} ({wrong} of {of})", spoken(kind));
    let named: Vec<String> = kinds.iter().take(WRONG_KINDS).map(named).collect();
    (!named.is_empty()).then(|| {
        format!(
            "Scenario {}, {}: some faults of {} kinds are decided wrongly, most often {}.",
            result.title,
            words.adapted(&isolation.title),
            kinds.len(),
            named.join(", ")
        )
    })
}

fn heads(words: &Vocabulary) -> Vec<String> {
    let titles = ["scenario".to_owned(), "held out".to_owned()];
    titles.into_iter().chain(measures().map(|measure| words.measure(measure))).collect()
}

fn measures() -> impl Iterator<Item = &'static Measure> {
    measure::OF_ISOLATED.into_iter().chain(lines::SAFETY)
}

fn row(result: &SubjectResult, isolation: &ProtocolResult, words: &Vocabulary) -> Vec<String> {
    let titles = [result.title.clone(), words.adapted(&isolation.title)];
    let rates = measures().map(|measure| counted(isolation.rates.counted(measure)));
    titles.into_iter().chain(rates).collect()
}

/// A share with its count below it.
fn counted(rate: Option<Rate>) -> String {
    rate.map_or_else(String::new, |own| format!("{}\n{}", share(rate), count_of(own)))
}
