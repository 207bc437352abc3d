//! Study files: each broken one is told what is wrong, exactly as in the `.expected` file beside it.
//!
//! `UPDATE=1 cargo test -p servotwin study_mistakes` writes the expected files anew.

use servotwin::built_in;
use servotwin::files::{read_text, write_atomically};
use servotwin::study::{Study, StudyError};
use std::path::{Path, PathBuf};

#[test]
fn broken_studies_are_told_what_is_wrong() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken_studies");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("the folder of broken studies")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    assert!(files.len() >= 8, "{} broken studies", files.len());
    let update = std::env::var_os("UPDATE").is_some();
    let mut wrong = Vec::new();
    for path in files {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let text = read_text(&path).expect("readable");
        let found = match Study::parse(&text, &name) {
            Ok(_) => "no mistake was found".to_owned(),
            Err(error) => error.to_string(),
        };
        let golden = path.with_extension("expected");
        if update {
            write_atomically(&golden, |out| out.write_all(found.as_bytes())).expect("written");
        }
        let expected = read_text(&golden).unwrap_or_default();
        if found != expected {
            wrong.push(format!("--- {name}: expected\n{expected}\n--- found\n{found}\n"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
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
