//! Sealed environments: what a seed outside of the study's range draws, and what the record keeps.

use crate::folder::Folder;
use servotwin::job::sealed::{OpeningRecord, Openings, SEALED_SEEDS, SealedSubject};
use servotwin::study::suites::{JUDGE, LEARN};
use servotwin::study::{Study, Suite};
use std::collections::BTreeSet;
use std::path::Path;

fn study(seed: &str) -> Result<Study, String> {
    let text = [include_str!("../tiny.toml"), include_str!("../tiny_flights.toml")].concat();
    let text = text.replacen("duration_s", &format!("{seed}duration_s"), 1);
    Study::parse(&text, "tiny.toml").map_err(|error| error.to_string())
}

/// The commands and the loads of a suite's environments.
fn drawn(study: &Study, suite: &Suite) -> BTreeSet<String> {
    let all = study.environments(suite, 0..suite.environments).unwrap();
    all.iter().map(|one| format!("{} {:?}", one.command, one.inputs)).collect()
}

#[test]
fn another_seed_draws_other_environments_and_so_does_another_suite() {
    let study = study("").unwrap();
    let judge = study.suite(JUDGE).unwrap();
    let sealed = |seed: &u64| judge.clone().with_seed(*seed);
    let [first, last] = [SEALED_SEEDS.start(), SEALED_SEEDS.end()].map(sealed);
    let learn = study.suite(LEARN).unwrap();
    let suites = [judge, &first, &last, learn];
    let all: BTreeSet<String> = suites.iter().flat_map(|suite| drawn(&study, suite)).collect();
    let count: usize = suites.iter().map(|suite| suite.environments).sum();
    assert_eq!(all.len(), count, "no environment is drawn twice");
    assert_eq!(drawn(&study, &sealed(SEALED_SEEDS.start())), drawn(&study, &first));
}

#[test]
fn no_study_file_can_declare_a_sealed_seed() {
    let error = study(&format!("seed = {}\n", SEALED_SEEDS.start())).map(drop).unwrap_err();
    assert!(error.contains("seed") && error.contains("0 … 999"), "{error}");
    assert!(study("seed = 999\n").is_ok());
}

#[test]
fn an_opening_counts_from_its_first_line_on() {
    let folder = Folder::new("record");
    let record = OpeningRecord::find(&folder.0, &folder.0);
    assert_eq!(record.count().unwrap(), Openings::default());
    let subject = SealedSubject {
        study: "a, b\nc",
        study_text: "format = 1",
        diagnoser_sha256: "0".into(),
        judged: "small sizes: noise".into(),
    };
    let openings: Vec<_> = (0..3).map(|_| record.open(&subject).unwrap()).collect();
    assert_eq!(openings.iter().map(|one| one.number).collect::<Vec<_>>(), [1, 2, 3]);
    let seeds: BTreeSet<u64> = openings.iter().map(|one| one.seed).collect();
    assert!(seeds.len() == 3 && seeds.iter().all(|seed| SEALED_SEEDS.contains(seed)));
    record.close(&openings[1], "0 healthy, shutdowns").unwrap();
    assert_eq!(record.count().unwrap(), Openings { opened: 3, without_result: 2 });
    let text = std::fs::read_to_string(record.path()).unwrap();
    assert_eq!(text.lines().count(), 5);
    assert!(text.lines().all(|line| line.split(',').count() == 11), "{text}");
    // A line that no opening wrote is no reason to forget the others.
    std::fs::write(record.path(), format!("{text}4,opened\n")).unwrap();
    let error = record.open(&subject).unwrap_err().to_string();
    assert!(error.contains("line 6") && error.contains("only grows"), "{error}");
}

#[test]
fn the_record_of_a_repository_is_found_from_below() {
    let folder = Folder::new("repository");
    let (inside, out) = (folder.0.join("a/b"), Path::new("out"));
    std::fs::create_dir_all(&inside).unwrap();
    assert_eq!(OpeningRecord::find(&inside, out).path(), out.join("sealed-openings.csv"));
    std::fs::create_dir_all(folder.0.join("sealed")).unwrap();
    let file = folder.0.join("sealed/openings.csv");
    std::fs::write(&file, "").unwrap();
    assert_eq!(OpeningRecord::find(&inside, out).path(), file);
    // The record of this repository is one that the program reads.
    let own = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let own = OpeningRecord::find(own, out);
    assert!(own.path().ends_with("sealed/openings.csv"));
    own.count().unwrap();
}
