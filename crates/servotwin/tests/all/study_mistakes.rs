//! Study files: each broken one is told what is wrong, exactly as in the `.expected` file beside it.
//!
//! `UPDATE=1 cargo test -p servotwin study_mistakes` writes the expected files anew.

use crate::golden;
use servotwin::built_in;
use servotwin::study::{Study, StudyError};

#[test]
fn broken_studies_are_told_what_is_wrong() {
    let parse = |text: &str, name: &str| Study::parse(text, name).map(drop);
    golden::assert_mistakes("tests/broken_studies", 8, parse);
}

/// A damaged file is told, whatever is left of it, and nothing that is told is built from it.
#[test]
fn damaged_studies_are_no_reason_to_panic() {
    let whole = built_in::STUDIES[1].1;
    let lines: Vec<&str> = whole.lines().collect();
    let mut told = 0;
    for skipped in (0..lines.len()).step_by(5) {
        let rest = lines.iter().enumerate().filter(|&(i, _)| i != skipped).map(|(_, line)| *line);
        if let Err(error) = Study::parse(&rest.collect::<Vec<_>>().join("\n"), "skipped.toml") {
            told += 1;
            let StudyError::Mistakes { mistakes, .. } = error else { panic!("{error}") };
            assert!(mistakes.iter().all(|mistake| mistake.line >= 1));
        }
    }
    assert!(told > 5, "{told}");
}
