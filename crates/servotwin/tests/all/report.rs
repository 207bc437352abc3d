//! Table 1, and what every section of the report promises.

use servotwin::flight::band::BandMerit;
use servotwin::job::manifest::Manifest;
use servotwin::job::{Results, results};
use servotwin::report::page::Page;
use servotwin::report::{ALL, Material, render, table};
use servotwin::study::Study;
use servotwin::study::campaign::Comparison;
use servotwin_diagnosis::field::{Covariate, Field, Source};
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

/// A band of one sensor that is wider for a high load.
fn band() -> BandMerit {
    let field = Field {
        covariates: vec![Covariate {
            name: "load_factor".into(),
            source: Source::Input { input: 0 },
            edges: vec![0.5],
            range: (0.0, 1.0),
        }],
        base: vec![0.004],
        factors: vec![vec![vec![0.8, 1.25]]],
        scale: 5.0,
        share: 0.05,
        calibrated_on: 39,
    };
    let fixed = Field { covariates: vec![], factors: vec![vec![]], ..field.clone() };
    BandMerit {
        setting: "fitted".into(),
        sensors: vec!["p_a_1".into()],
        duration_s: 20.0,
        field,
        fixed,
        healthy: 200,
        left: [4, 6],
        outside: 3,
        faults: 400,
        detected: [380, 360],
    }
}

#[test]
fn the_twin_and_its_confidence_are_reported_as_they_were_measured() {
    let (study, manifest, bands) = (Study::default(), manifest(), [band()]);
    let results = Results {
        format: results::FORMAT.into(),
        study: "paper".into(),
        subjects: vec![],
        robustness: vec![],
    };
    // Of twenty fits of each actuator one is off by three standard errors.
    let fit = |n: usize| Comparison {
        parameter: format!("actuator_{}.servo_valve.null_bias", 1 + n / 20),
        true_sigma: 0.5,
        fitted_sigma: if n.is_multiple_of(20) { 0.8 } else { 0.6 },
        error_sigma: 0.1,
    };
    let calibrations: Vec<Comparison> = (0..40).map(fit).collect();
    let material = Material {
        study: &study,
        results: &results,
        hierarchies: &[],
        flights: None,
        bands: &bands,
        calibrations: &calibrations,
        examples: &[],
        manifest: &manifest,
    };
    let (html, figures) = render(&material);
    assert!(figures.iter().any(|(name, _)| name == "field-fitted"));
    // One row for both actuators; healthy flights that leave the field and the fixed band; half widths.
    for text in ["<td>servo_valve.null_bias</td>", "<td class=\"number\">40</td>", "95.00 % ("] {
        assert!(html.contains(text), "{text}");
    }
    for text in ["2.00 % (", "3.00 % (", "90.00 % (", "1.60 … 2.50"] {
        assert!(html.contains(text), "{text}");
    }
    assert!(html.contains("3 of the healthy flights were flown at points outside"), "{html}");
    // What was not measured is not told.
    let none = Material { bands: &[], calibrations: &[], ..material };
    assert!(!render(&none).0.contains("id=\"twin\""));
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
        bands: &[],
        calibrations: &[],
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
