//! What every section of the report promises.

use servotwin::job::manifest::Manifest;
use servotwin::job::outcomes::{Basis, FlownSuite};
use servotwin::job::results::SubjectResult;
use servotwin::job::{Results, Subject, results};
use servotwin::learn::Evaluation;
use servotwin::learn::detection::{Curve, Detection, Least};
use servotwin::learn::metrics::Rate;
use servotwin::learn::protocol::{Protocol, ProtocolResult};
use servotwin::measure;
use servotwin::measure::outcome::RunOutcome;
use servotwin::records::Comparison;
use servotwin::study::{Scenario, Study};
use servotwin_diagnosis::diagnoser::Tuning;
use servotwin_diagnosis::diagnoser::tuning::BASELINE_CORRECTED;
use servotwin_report::words::healthy_flights;
use servotwin_report::{CHAPTERS, Material, Section, document};
use servotwin_view::document::Document;
use servotwin_view::render::page;
use std::collections::BTreeSet;

/// The report as a page.
fn render(material: &Material) -> String {
    page(&document(material))
}

/// What a study without hierarchies, flights and examples gives to a report.
fn results_alone<'a>(
    study: &'a Study,
    results: &'a Results,
    manifest: &'a Manifest,
) -> Material<'a> {
    Material {
        study,
        results,
        hierarchies: &[],
        flights: None,
        sealed: None,
        healthy: &[],
        constants: &[],
        calibrations: &[],
        examples: &[],
        manifest,
    }
}

fn manifest() -> Manifest {
    Manifest {
        format: servotwin::job::manifest::FORMAT.into(),
        version: "0".into(),
        study: "paper".into(),
        inputs: vec![],
        seed: 0,
        solver: String::new(),
        equations: String::new(),
        data_sets: vec![],
        outputs: vec![],
    }
}

#[test]
fn fitted_twins_are_reported_as_they_were_measured() {
    let (study, manifest) = (Study::default(), manifest());
    let results =
        Results { format: results::FORMAT.into(), study: "paper".into(), subjects: vec![] };
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
        sealed: None,
        healthy: &[],
        constants: &[],
        calibrations: &calibrations,
        examples: &[],
        manifest: &manifest,
    };
    let html = render(&material);
    // One row for both actuators.
    // Long names may be broken behind their parts.
    for text in [
        "<td>servo_<wbr>valve.<wbr>null_<wbr>bias</td>",
        "<td class=\"number\">40</td>",
        "95.00 % [",
    ] {
        assert!(html.contains(text), "{text}");
    }
    // What was not measured is not told.
    let none = Material { calibrations: &[], ..material };
    assert!(!render(&none).contains("id=\"twin\""));
}

/// The healthy flights of a scenario, the largest evidence of which spreads evenly up to 0.5 of its limit.
fn healthy_run() -> FlownSuite {
    let flight = |environment: u64| RunOutcome {
        environment,
        duration_s: 300.0,
        is_finished: true,
        evidence: 0.001 * environment as f64,
        ..RunOutcome::default()
    };
    FlownSuite {
        suite: "healthy".into(),
        scenario: "realistic".into(),
        seed: 3,
        runs: String::new(),
        basis: Basis {
            diagnoser_sha256: String::new(),
            study_sha256: String::new(),
            system_sha256: String::new(),
        },
        calibration: None,
        outcomes: (0..500).map(flight).collect(),
    }
}

#[test]
fn constants_have_a_label_and_environments_without_alarm_a_bound() {
    let (study, manifest) = (Study::default(), manifest());
    let results =
        Results { format: results::FORMAT.into(), study: "paper".into(), subjects: vec![] };
    let usual = || Tuning::default().constants(Some(&BASELINE_CORRECTED));
    let by_hand = Tuning { clip_nats: 7.0, ..Tuning::default() }.constants(None);
    let constants = [(Scenario::Noise, usual()), (Scenario::Realistic, usual())];
    let alone = results_alone(&study, &results, &manifest);
    let html = render(&Material { constants: &constants, ..alone });
    assert!(html.contains("scenario noise and realistic"), "both have the same constants");
    assert!(html.contains("corrected off allowance nats") && html.contains("tuned on seed 9"));
    assert!(html.contains(">physical<") && html.contains(">statistical<"));
    assert!(!html.contains("not the usual value"));
    let constants = [(Scenario::Noise, usual()), (Scenario::Realistic, by_hand)];
    let alone = results_alone(&study, &results, &manifest);
    let html = render(&Material { constants: &constants, ..alone });
    assert_eq!(html.matches("not the usual value").count(), 1);
    let lines = healthy_flights(&healthy_run()).1;
    assert_eq!(lines[0], "false alarms in 0 of 500 environments, at most 0.597 % of them (95 %)");
    assert!(lines[1].contains("0.499 of its limit; by the tail of 50 of 500 flights"), "{lines:?}");
    assert!(lines[3].contains("too few flights come near it"), "{lines:?}");
}

#[test]
fn sections_have_names_and_stand_a_study_without_results() {
    let all: Vec<&Section> = CHAPTERS.iter().flat_map(|chapter| chapter.sections).collect();
    assert!(CHAPTERS.len() <= 16, "more chapters than anybody reads");
    let chapters = CHAPTERS.iter().map(|chapter| chapter.id);
    let ids: BTreeSet<&str> = all.iter().map(|section| section.id).chain(chapters).collect();
    let titles: BTreeSet<&str> = all.iter().map(|section| section.title).collect();
    assert_eq!(
        (ids.len(), titles.len()),
        (all.len() + CHAPTERS.len(), all.len()),
        "every name once"
    );
    let is_anchor = |id: &&str| !id.is_empty() && id.bytes().all(|b| b.is_ascii_lowercase());
    assert!(ids.iter().all(is_anchor), "{ids:?}");
    let study = Study::default();
    let results =
        Results { format: results::FORMAT.into(), study: "paper".into(), subjects: vec![] };
    let manifest = manifest();
    let material = results_alone(&study, &results, &manifest);
    for section in all {
        // Twice: a section may not depend on anything but its material.
        let write = || {
            let mut written = Document::default();
            (section.write)(&material, &mut written);
            page(&written)
        };
        assert_eq!(write(), write(), "{}", section.id);
    }
    let report = document(&material);
    let html = page(&report);
    assert!(html.contains("Table 1") || html.contains("table 1"));
    let names: Vec<&str> = report.figures().iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["schematic", "commands"]);
}

/// Two kinds of fault of the press: the leak is seen in most tests, the sensor's in one of four.
fn evaluation(has_stop: bool) -> Evaluation {
    let curve = |kind: &str, detail: &str, counts: [u64; 2]| Curve {
        kind: kind.into(),
        detail: detail.into(),
        points: vec![(0.25, Rate::new(counts[0], 2)), (1.0, Rate::new(counts[1], 2))],
    };
    let least = |fault: &str, case: &str, intensity| Least {
        fault: fault.into(),
        case: case.into(),
        intensity,
    };
    let judged = ProtocolResult {
        protocol: Protocol::NewCommand,
        title: Protocol::NewCommand.title().into(),
        splits: 1,
        stages: vec![],
        rates: [
            Some((&measure::END_TO_END, Rate::new(4, 5))),
            Some((&measure::RIGHT_ACTION, Rate::new(5, 5))),
            has_stop.then_some((&measure::SHUTDOWN_MISSED_OF_ALL, Rate::new(4, 8))),
        ]
        .into_iter()
        .flatten()
        .collect(),
        components: vec![],
        confused: vec![],
    };
    Evaluation {
        detection: Detection {
            curves: vec![
                curve("leakage_a.leakage", "leakage", [2, 2]),
                curve("sensor_ram.bias_positive", "position_sensor", [0, 1]),
            ],
            least: vec![
                least("leakage_a.leakage", "rough/idle", Some(0.25)),
                least("sensor_ram.bias_positive", "rough/idle", Some(1.0)),
                least("sensor_ram.bias_positive", "stroke/idle", None),
            ],
        },
        in_band: [(&measure::VISIBLE, Rate::new(5, 8))].into_iter().collect(),
        in_paper_band: [(&measure::VISIBLE, Rate::new(5, 8))].into_iter().collect(),
        bands: None,
        constant_features: vec![],
        protocols: vec![judged],
        committee: vec![],
        baseline: None,
        random_thirds: vec![],
        isolation: vec![],
        classifiers: vec![],
        stages: vec![],
        healthy: Default::default(),
    }
}

/// The report of a study of the press.
fn press_report(text: &str) -> String {
    let study = Study::parse(text, "studies/press_axis.toml").unwrap();
    let settings = servotwin::learn::EvaluationSettings::default();
    let subject = SubjectResult::new(
        Subject::Noise,
        &study,
        settings,
        evaluation(!study.shutdowns().is_empty()),
    );
    let results = Results::new(&study, vec![subject]);
    let manifest = manifest();
    let material = results_alone(&study, &results, &manifest);
    render(&material)
}

const PRESS: &str = include_str!("../../../studies/press_axis.toml");

#[test]
fn the_report_of_one_actuator_speaks_of_that_actuator_alone() {
    let html = press_report(PRESS).to_lowercase();
    for foreign in [
        "actuators",
        "another actuator",
        "other actuator",
        "which actuator",
        "wrong actuator",
        "aircraft",
        "flight",
        "flown",
        "seed paper",
        "shutdown",
        "shut down",
    ] {
        let at = html.find(foreign).map(|at| &html[at.saturating_sub(80)..at + 20]);
        assert_eq!(at, None, "'{foreign}' in the report of a press");
    }
    // The study calls what switches off a stop.
    assert!(html.contains("“stop” missed (of all)"));
}

#[test]
fn of_what_was_not_counted_nothing_is_said() {
    let html = press_report(PRESS);
    // No actuator but one, and no fault that calls for less: no such rows.
    for absent in ["needless “stop”", "wrong actuator", "</b> none"] {
        assert!(!html.contains(absent), "{absent}");
    }
    let (before, rest) = PRESS.split_once("[reactions]").unwrap();
    let (_, after) = rest.split_once("[realistic]").unwrap();
    let html = press_report(&format!("{before}[realistic]{after}"));
    assert!(html.contains("says of no action that it switches its actuator off"));
    for absent in ["missed (of", " 0.00 %", ">0.00 %", "</b> none", "healthy specimen switched off"]
    {
        assert!(!html.contains(absent), "{absent}");
    }
}

#[test]
fn the_first_screen_has_figures_with_counts_and_targets_and_the_weakest_faults() {
    let html = press_report(PRESS);
    let first = html.split("<nav").next().unwrap();
    let cards: Vec<&str> = first.split("<div class=\"card ").skip(1).collect();
    assert_eq!(cards.len(), 4, "missed, detected, isolated, action right");
    for card in &cards {
        assert!(card.contains(" of ") && card.contains("target: "), "{card}");
    }
    assert!(cards[0].starts_with("act") && cards[0].contains("4 of 8"));
    let weakest = first.split("<ol>").nth(1).unwrap();
    assert_eq!(weakest.matches("<li>").count(), 1, "the other kind is always detected");
    assert!(weakest.contains("(1 of 4)") && weakest.contains("It never shows in stroke/idle"));
    assert!(first.contains("id=\"figure-detected_noise\""));
}

#[test]
fn only_specimens_with_tolerances_are_compared_with_those_without() {
    let study = Study::parse(PRESS, "studies/press_axis.toml").unwrap();
    let subject = |subject: Subject, detected: u64| {
        let mut evaluation = evaluation(true);
        evaluation.detection.curves[1].points = vec![(1.0, Rate::new(detected, 40))];
        evaluation.in_band =
            [(&measure::VISIBLE, Rate::new(40 + detected, 80))].into_iter().collect();
        let settings = servotwin::learn::EvaluationSettings::default();
        SubjectResult::new(subject, &study, settings, evaluation)
    };
    let subjects = [(Subject::Ideal, 4), (Subject::Noise, 36), (Subject::Realistic, 4)];
    let subjects = subjects.map(|(which, detected)| subject(which, detected));
    let results = Results::new(&study, subjects.to_vec());
    let html = render(&results_alone(&study, &results, &manifest()));
    let first = html.split("<nav").next().unwrap();
    let weakest: Vec<&str> = first.split("<ol>").skip(1).collect();
    let quotes_noise = weakest.iter().map(|tab| tab.contains("In the scenario noise"));
    assert_eq!(quotes_noise.collect::<Vec<_>>(), [true, false, false], "{weakest:?}");
    assert!(!html.contains("may show"), "what was not measured is not said");
}
