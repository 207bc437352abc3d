//! Faults that the diagnosis confuses with each other.

use crate::lines;
use crate::words::{percent, spoken};
use crate::{Material, hardest_first};
use servotwin::job::results::SubjectResult;
use servotwin_view::document::{Document, Table};

/// The maximum number of pairs shown for each subject.
const SHOWN: usize = 20;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let words = material.words();
    let show = |result: &SubjectResult, page: &mut Document| {
        let ambiguity = &result.evaluation.ambiguity;
        let mut grid = Table::headed(["fault", "taken for", "wrong was", "times", "of its tests"]);
        for pair in ambiguity.pairs.iter().take(SHOWN) {
            grid.push(vec![
                spoken(&pair.kind),
                spoken(&pair.taken_for),
                words.question(pair.question),
                pair.count.to_string(),
                percent(Some(pair.share)),
            ]);
        }
        if grid.is_empty() {
            page.text(format!("Scenario: {}. No fault was taken for another.", result.title));
            return;
        }
        page.table("", grid.captioned(format!(
                "Scenario: {}, grouped. {}: a fault, and the fault that fills the leaf in which it ended \
                 wrongly.",
                result.title,
                most_frequent(ambiguity.pairs.len())
            )));
        for group in &ambiguity.groups {
            let names: Vec<String> = group.iter().map(|kind| spoken(kind)).collect();
            page.note(format!(
                "Confused among each other (from 5 % of the tests on): {}.",
                names.join("; ")
            ));
        }
    };
    hardest_first(&lines::scenarios(material.results), page, &show);
}

/// Describes which of the confusions are shown.
fn most_frequent(pairs: usize) -> String {
    match pairs {
        1 => "The only confusion".into(),
        all if all <= SHOWN => format!("All {all} confusions, the most frequent first"),
        more => format!("The {SHOWN} most frequent of {more} confusions"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_of_many_confusions_are_the_most_frequent() {
        assert_eq!(most_frequent(1), "The only confusion");
        assert_eq!(most_frequent(3), "All 3 confusions, the most frequent first");
        assert_eq!(most_frequent(21), "The 20 most frequent of 21 confusions");
    }
}
