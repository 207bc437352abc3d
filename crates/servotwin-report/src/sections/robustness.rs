//! Training on one setting, testing on another.

use crate::Material;
use crate::lines::Who;
use crate::page::{Alignment, HtmlTable, Page};
use crate::vocabulary::Vocabulary;
use crate::words::stacked;
use servotwin::evaluation::metrics::Rate;
use servotwin::evaluation::protocol::ProtocolResult;
use servotwin::evaluation::robustness::Cross;
use servotwin_plot::Figure;
use servotwin_plot::value_map::ValueMap;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
    let crosses = &material.results.robustness;
    if crosses.is_empty() {
        return;
    }
    page.text(
            "Does what was learned in a kinder world hold in a harder one? A tree that never saw noise \
             may ask for differences that no sensor shows. So the diagnosis of each setting is asked \
             about the variants of every other, on new commands.",
        );
    let words = material.words();
    page.beside(|page| {
        for who in Who::ALL {
            for (name, what, error) in errors(&words) {
                page.figure(
                    &format!("robustness_{}_{name}", who.title()),
                    map(crosses, who, error),
                    &format!(
                        "{}, {what} (%): rows trained on, columns tested on.",
                        match who {
                            Who::Trees => "Trees",
                            Who::Committee => "Committee",
                        }
                    ),
                );
            }
        }
    });
    page.table(&grid(crosses, &words), "The same with 95 % intervals from drawing kinds of fault at their \
            intensities. Every setting detects with its own band, so that a row's tests are other faults \
            in each column.");
}

/// Returns an error as a share of the tests.
type Error = fn(&ProtocolResult) -> Option<f64>;

/// The errors shown: file name of the figure, title, and share.
fn errors(words: &Vocabulary) -> Vec<(&'static str, String, Error)> {
    let wrong: Error = |result| Some(1.0 - result.end_to_end?.share?);
    let mut errors = vec![("wrong", "wrong end to end".to_owned(), wrong)];
    if words.has_off() {
        let title = format!("{} missed, of detected faults", words.off());
        errors.push(("missed", title, |result| missed(result)?.share));
    }
    errors
}

fn missed(result: &ProtocolResult) -> Option<Rate> {
    Some(result.safety.as_ref()?.missed_shutdown)
}

fn of(cross: &Cross, who: Who) -> &ProtocolResult {
    match who {
        Who::Trees => &cross.trees,
        Who::Committee => &cross.committee,
    }
}

fn map(crosses: &[Cross], who: Who, error: Error) -> Figure {
    let mut names: Vec<&str> = vec![];
    for cross in crosses {
        if !names.contains(&cross.trained.as_str()) {
            names.push(&cross.trained);
        }
    }
    let value = |trained: &str, tested: &str| {
        let own = crosses.iter().find(|c| c.trained == trained && c.tested == tested)?;
        Some(100.0 * error(of(own, who))?)
    };
    let row = |trained: &&str| names.iter().map(|tested| value(trained, tested)).collect();
    // Trees and committee share one color scale.
    let all = crosses.iter().flat_map(|cross| Who::ALL.map(|who| error(of(cross, who))));
    let largest = all.flatten().fold(0.0, f64::max);
    ValueMap {
        title: String::new(),
        rows: names.iter().map(|name| format!("trained: {name}")).collect(),
        columns: names.iter().map(|name| (*name).to_owned()).collect(),
        values: names.iter().map(row).collect(),
        range: (0.0, 100.0 * largest),
        digits: 2,
        meaning: "% of answers; darker: more errors".into(),
        worst: None,
    }
    .draw()
}

fn grid(crosses: &[Cross], words: &Vocabulary) -> HtmlTable {
    let mut heads =
        vec![("trained on".to_owned(), Alignment::Left), ("tested on".to_owned(), Alignment::Left)];
    heads.extend(Who::ALL.map(|who| (format!("{}, end to end", who.title()), Alignment::Right)));
    if words.has_off() {
        let head =
            |who: Who| (format!("{}, {} missed", who.title(), words.off()), Alignment::Right);
        heads.extend(Who::ALL.map(head));
    }
    let mut grid = HtmlTable::new(heads);
    let mut last = "";
    for cross in crosses {
        let trained = if cross.trained == last { "" } else { &cross.trained };
        last = &cross.trained;
        let mut row = vec![trained.to_owned(), cross.tested.clone()];
        row.extend(Who::ALL.map(|who| stacked(of(cross, who).end_to_end)));
        if words.has_off() {
            row.extend(Who::ALL.map(|who| stacked(missed(of(cross, who)))));
        }
        match cross.trained == cross.tested {
            true => grid.push_strong(row),
            false => grid.push(row),
        }
    }
    grid
}
