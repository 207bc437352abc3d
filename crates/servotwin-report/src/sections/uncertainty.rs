//! Answers that depend on differences below the sensors' uncertainty.

use crate::Material;
use crate::lines::{self, Who};
use crate::vocabulary::Vocabulary;
use crate::words::stacked;
use servotwin::job::results::SubjectResult;
use servotwin::learn::flips::Flips;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let results: Vec<(&SubjectResult, &(Flips, Flips))> = lines::scenarios(material.results)
        .into_iter()
        .filter_map(|result| Some((result, result.evaluation.flips.as_ref()?)))
        .collect();
    let Some((_, (first, _))) = results.first() else {
        return;
    };
    page.text(format!(
            "A question is only as good as what its feature can show. A window holds the means and \
             covariances of residuals and of the twin's signals; their uncertainty follows from the noise \
             and quantisation of a sample and the number of samples, and from the solver's error, which \
             stays the same throughout. Each window of a detected fault on the judged commands is moved \
             {} times within it, all statistics together (means by their standard error, covariances by \
             what such errors happen to have in common with each signal), its features are computed \
             anew, and trees and committee are asked again. The share of answers that change is the \
             flip rate, with its interval from drawing kinds of fault at their intensities. In the \
             scenario without noise only the solver's error moves a window.",
            first.draws
        ));
    page.text(
            "Training windows are moved in the same way, and each is learned with its moves: what does not \
             survive them teaches nothing. Every second move makes the fault weaker (with the tolerances and \
             the noise of another healthy specimen in place of what is taken away), because at work an \
             intensity is anything. The trees' later moves go farther than windows are uncertain, so that a threshold keeps its distance from what \
             was learned.",
        );
    let words = material.words();
    page.table(
        "",
        answers(&results, &words).captioned(format!(
            "Share of moves after which the answer is another one: {} (which is what is acted on); \
                 any part of the answer.",
            words.action_wrong()
        )),
    );
}

fn answers(results: &[(&SubjectResult, &(Flips, Flips))], words: &Vocabulary) -> Table {
    let mut heads = vec!["scenario".to_owned(), "by".to_owned(), "moves".to_owned()];
    if words.has_several() {
        heads.push(words.unit().to_owned());
    }
    heads.push(words.action_wrong());
    heads.push("any part".to_owned());
    let mut grid = Table::headed(heads);
    for (result, (trees, committee)) in results {
        for (who, flips) in Who::ALL.into_iter().zip([trees, committee]) {
            let title = if who == Who::Trees { result.title.clone() } else { String::new() };
            let mut row = vec![title, who.title().to_owned(), flips.answer.of.to_string()];
            let unit = words.has_several().then_some(flips.actuator);
            let shares = unit.into_iter().chain([flips.action, flips.answer]);
            row.extend(shares.map(|share| stacked(Some(share))));
            grid.push(row);
        }
    }
    grid
}
