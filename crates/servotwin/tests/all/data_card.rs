//! What every data set promises to those who read it with other programs: units, descriptions, a split, and a card.

use crate::folder::Folder;
use servotwin::job::{Folder as Results, data_card};
use servotwin::parallel::Workers;
use servotwin::records::columns::{DIMENSIONLESS, feature_columns_of};
use servotwin::records::{FOLDS, Records, calibration_file};
use servotwin::study::{Purpose, Scenario, Study};
use servotwin::table::{Table, Values};
use std::collections::BTreeMap;

const TAIL: &str = "\n[[classes]]\ndetail = \"part\"\naction = \"warning\"\nfaults = \
    [\"servo_valve.gain_low\", \"leakage_a.leakage\"]\n\
    [realistic]\nhealthy = 6\n\
    tolerances = [{ parameters = [\"cylinder.coulomb_friction_n\"], sigma = 0.1 }]\n\
    [fitted]\ncommand = \"noise:rms=4deg,bandwidth=1Hz,seed=9\"\nduration_s = 8\n\
    judge = 4\nlearn = 4\nin_each_case = 2\n";

const TRAINING: &str = "\n[training]\nduration_s = 1\nhealthy = 2\nsignals.T1 = \"noise:rms=3deg,bandwidth=1Hz,seed=77\"\n\
    load = [0.5, 1]\n";

fn study(training: &str) -> Study {
    let text = include_str!("../tiny.toml");
    Study::parse(&format!("{text}{TAIL}{training}"), "tiny.toml").unwrap()
}

/// Simulates the data sets of a study, and reads them.
fn data_sets(
    study: &Study,
    folder: &Folder,
    threads: usize,
) -> BTreeMap<(Scenario, Purpose), Table> {
    let mut found = BTreeMap::new();
    for scenarios in Scenario::groups(study, |_| true) {
        for purpose in study.purposes() {
            let suite = (purpose, scenarios.clone());
            let records = Records::new(&folder.0, study, suite, Workers::new(threads)).unwrap();
            assert!(records.run(&|_, _| ()).unwrap().failed.is_empty());
            for &scenario in &scenarios {
                let file = Results::new(&folder.0).data_set(scenario, purpose);
                found.insert((scenario, purpose), Table::read(file).unwrap());
            }
        }
    }
    found
}

#[test]
fn every_column_has_a_unit_and_a_description_and_stands_in_the_book() {
    let (study, folder) = (study(TRAINING), Folder::new("units-of-columns"));
    let mut tables: Vec<Table> = data_sets(&study, &folder, 2).into_values().collect();
    assert_eq!(tables.len(), 8, "four scenarios, judged and for training");
    let book = include_str!("../../../../docs/data-set.md");
    for table in &tables {
        for name in table.names() {
            let family = name.split_once(':').map(|(family, _)| format!("`{family}:"));
            let entry = family.unwrap_or_else(|| format!("`{name}`"));
            assert!(book.contains(&entry), "docs/data-set.md lacks {entry}");
        }
    }
    tables.extend(
        Purpose::OF_RECORDS
            .map(|purpose| Table::read(calibration_file(&folder.0, purpose)).unwrap()),
    );
    for column in tables.iter().flat_map(Table::columns) {
        let (name, what) = (&column.name, &column.description);
        assert!(what.len() > 10 && what.ends_with('.'), "{name}: no description: '{what}'");
        let has_unit = !matches!(column.values, Values::Text(_) | Values::Flag(_));
        assert_eq!(!column.unit.is_empty(), has_unit, "{name}: unit '{}'", column.unit);
    }
}

#[test]
fn loads_and_specimens_are_what_was_flown() {
    let (study, folder) = (study(TRAINING), Folder::new("plants"));
    let tables = data_sets(&study, &folder, 2);
    let (input, parameters) =
        (study.load_input().unwrap(), ["p:actuator_1.cylinder.coulomb_friction_n"]);
    let load = format!("load:{}", study.system.network().inputs[input].id);
    for ((scenario, purpose), table) in &tables {
        let loads = table.columns().iter().find(|c| c.name.starts_with(&load)).unwrap();
        for (case, load) in table.text("case").unwrap().iter().zip(&*loads.numbers().unwrap()) {
            let flown = study.cases_of(*purpose).iter().find(|known| &known.name == case).unwrap();
            assert_eq!(flown.inputs[input].value(0.0), *load, "{case}");
        }
        for name in parameters {
            let (own, unit) = (table.f64(name).unwrap(), &table.column(name).unwrap().unit);
            let (c, p) = study.system.parameter(&name[2..]).unwrap();
            let nominal = study.system.network().components[c].parameters[p];
            let is_nominal = own.iter().all(|value| *value == nominal);
            assert_eq!((is_nominal, unit.as_str()), (!scenario.has_tolerances(), "N"), "{name}");
            assert!(own.iter().all(|value| (value / nominal - 1.0).abs() < 0.301), "{own:?}");
        }
        // Rows of one specimen are one plant, and rows of different specimens are not.
        let frictions = table.f64(parameters[0]).unwrap();
        let mut plants = BTreeMap::new();
        for (specimen, friction) in table.u32("specimen").unwrap().iter().zip(frictions.iter()) {
            assert_eq!(plants.entry(*specimen).or_insert(*friction), friction);
        }
        let expected = match scenario {
            Scenario::Ideal | Scenario::Noise => 1..=1,
            Scenario::Fitted => 2..=4,
            Scenario::Realistic => table.row_count()..=table.row_count(),
        };
        assert!(expected.contains(&plants.len()), "{scenario:?} {}", plants.len());
    }
}

#[test]
fn the_split_keeps_every_fault_at_its_intensity_together() {
    let (study, folder) = (study(TRAINING), Folder::new("split"));
    let tables = data_sets(&study, &folder, 2);
    let mut groups: BTreeMap<(String, u64), u32> = BTreeMap::new();
    for ((_, purpose), table) in &tables {
        let side = if *purpose == Purpose::Train { "train" } else { "test" };
        assert!(table.text("split").unwrap().iter().all(|split| split == side));
        let (kinds, grades) = (table.text("kind").unwrap(), table.f64("grade").unwrap());
        for (row, &fold) in table.u32("fold").unwrap().iter().enumerate() {
            assert!((fold as usize) < FOLDS);
            let group = (kinds[row].clone(), grades[row].to_bits());
            if group.0 != "healthy" {
                assert_eq!(*groups.entry(group.clone()).or_insert(fold), fold, "{group:?}");
            }
        }
    }
    // The folds share the groups: none is empty, and none has most of them.
    let size = |fold| groups.values().filter(|own| **own == fold).count();
    let sizes: Vec<usize> = (0..FOLDS as u32).map(size).collect();
    assert!(sizes.iter().all(|size| (1..groups.len() / 2).contains(size)), "{sizes:?}");
    // Commands are on one side only.
    let flown = |purpose| {
        let own = tables.iter().filter(move |((_, own), _)| *own == purpose);
        own.flat_map(|(_, table)| table.text("flown").unwrap().to_vec()).collect::<Vec<_>>()
    };
    let learned = flown(Purpose::Train);
    assert!(flown(Purpose::Test).iter().all(|command| !learned.contains(command)));
}

#[test]
fn without_training_commands_one_fold_tests() {
    let (study, folder) = (study(""), Folder::new("one-fold"));
    let tables = data_sets(&study, &folder, 2);
    for table in tables.values() {
        let folds = table.u32("fold").unwrap();
        let expected = folds.iter().map(|&fold| if fold == 0 { "test" } else { "train" });
        assert!(table.text("split").unwrap().iter().eq(expected));
        assert!(folds.contains(&0) && folds.iter().any(|&fold| fold != 0));
    }
}

#[test]
fn the_card_counts_what_is_there_and_is_the_same_for_all_threads() {
    let study = study(TRAINING);
    let [calm, quick] = [("card-1", 1), ("card-3", 3)].map(|(name, threads)| {
        let folder = Folder::new(name);
        let tables = data_sets(&study, &folder, threads);
        data_card::write(&Results::new(&folder.0), &study).unwrap();
        (folder, tables)
    });
    let read = |folder: &Folder| std::fs::read_to_string(folder.file("data-card.md")).unwrap();
    let card = read(&calm.0);
    assert_eq!(card, read(&quick.0));
    for ((scenario, purpose), table) in &calm.1 {
        let name = format!("dataset-{}{}.parquet", scenario.name(), purpose.suffix());
        let bytes = |folder: &Folder| std::fs::read(folder.file(&name)).unwrap();
        assert!(bytes(&calm.0) == bytes(&quick.0), "{name}");
        let counts = format!("| {} | {} | 0 |", table.row_count(), table.columns().len());
        let line = card.lines().find(|line| line.starts_with(&format!("| `{name}`")));
        assert!(line.unwrap().ends_with(&counts), "{line:?} {counts}");
        let listed = |name: &str| card.contains(&format!("| `{name}` |"));
        let others =
            table.names().filter(|n| n.starts_with("f:") || feature_columns_of([*n]).is_empty());
        others.for_each(|name| assert!(listed(name), "{name}"));
    }
    let own = "| `p:actuator_1.cylinder.coulomb_friction_n` | f64 | N |";
    assert!(card.contains(own) && card.contains(&format!("| f64 | {DIMENSIONLESS} |")));
    assert!(card.contains(&format!("servotwin {}", env!("CARGO_PKG_VERSION"))));
    // The manifest lists what is among the results.
    let results = Results::new(&calm.0.0);
    assert!(results.results_there().unwrap().contains(&results.data_card()));
}

#[test]
fn a_folder_without_data_sets_gets_no_card() {
    let folder = Folder::new("no-card");
    data_card::write(&Results::new(&folder.0), &study("")).unwrap();
    assert!(!std::path::Path::new(&folder.file("data-card.md")).exists());
}

#[test]
fn no_column_that_holds_the_label_is_a_feature() {
    let others = ["variant", "fault", "kind", "grade", "i:actuator_1.leakage", "largest:p_a_1"];
    let malformed = ["f", "f:", "g:x", "mx:y", "feature"];
    assert!(feature_columns_of([&others[..], &malformed].concat()).is_empty());
    let features = ["f:mean_p_a_1", "m:mean_p_a_1", "m3:mean_p_a_1"];
    assert_eq!(feature_columns_of(features), features);
}
