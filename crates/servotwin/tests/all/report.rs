//! Table 1, and what every section of the report promises.

use servotwin::job::manifest::Manifest;
use servotwin::job::{Results, results};
use servotwin::report::page::Page;
use servotwin::report::{ALL, Material, render, table};
use servotwin::study::Study;
use std::collections::BTreeSet;

#[test]
fn table_1_is_the_papers() {
    let study = Study::default();
    let expected = [
        ("shut_down", "external_leakage", 4, 40),
        ("shut_down", "control_valve", 1, 100),
        ("shut_down", "supply_valve", 1, 10),
        ("shut_down", "tank_valve", 1, 10),
        ("change_mode", "cylinder_pressure_sensor", 2, 80),
        ("change_mode", "displacement_sensor", 1, 40),
        ("warning", "internal_leakage", 1, 10),
        ("warning", "valve_displacement_sensor", 1, 40),
        ("warning", "supply_tank_pressure_sensor", 2, 80),
    ];
    let rows = table::rows(&study);
    let found: Vec<_> = rows
        .iter()
        .map(|row| (row.command.as_str(), row.detail.as_str(), row.components, row.faults))
        .collect();
    assert_eq!(found, expected);
    assert_eq!(table::sum(&study), (28, 820));
    assert_eq!(study.cases.len() * study.faults.len(), 4920);
}

fn manifest() -> Manifest {
    Manifest {
        format: servotwin::job::manifest::FORMAT.into(),
        version: "0".into(),
        study: "paper".into(),
        inputs: vec![],
        specimen_seed: None,
        split_seed: 1,
        solver: String::new(),
        data_sets: vec![],
        outputs: vec![],
    }
}

#[test]
fn sections_have_names_and_stand_a_study_without_results() {
    let ids: BTreeSet<&str> = ALL.iter().map(|section| section.id()).collect();
    let titles: BTreeSet<&str> = ALL.iter().map(|section| section.title()).collect();
    assert_eq!((ids.len(), titles.len()), (ALL.len(), ALL.len()), "every name once");
    let is_anchor = |id: &&str| !id.is_empty() && id.bytes().all(|b| b.is_ascii_lowercase());
    assert!(ids.iter().all(is_anchor), "{ids:?}");
    let study = Study::default();
    let results = Results {
        format: results::FORMAT.into(),
        study: "paper".into(),
        subjects: vec![],
        robustness: vec![],
    };
    let manifest = manifest();
    let material = Material {
        study: &study,
        results: &results,
        hierarchies: &[],
        flights: None,
        examples: &[],
        manifest: &manifest,
    };
    for section in ALL {
        // Twice: a section may not depend on anything but its material.
        let write = || {
            let mut page = Page::default();
            section.write(&material, &mut page);
            page.finish("").0
        };
        assert_eq!(write(), write(), "{}", section.id());
    }
    let (html, figures) = render(&material);
    assert!(html.contains("Table 1") || html.contains("table 1"));
    let names: Vec<&str> = figures.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["schematic", "commands"]);
}
