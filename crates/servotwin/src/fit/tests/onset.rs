//! Faults that begin within a record, and records without an onset.

use super::super::intensity::intensity_and_onset;
use super::*;
use crate::ensemble::Later;

/// A record of a specimen in which a fault begins at `at_s`.
fn begun(study: &Study, specimen: usize, fault: FaultAt, at_s: f64, duration_s: f64) -> FitRecord {
    let later = vec![Later { time_s: at_s, faults: vec![fault], ..Later::default() }];
    let variant = Variant { later, ..Variant::default() };
    flown_as(study, COMMAND, (Some(specimen), specimen), variant, duration_s)
}

/// Fits a record of a study.
fn first(study: &Study, record: FitRecord) -> (Fit<'_>, FitResults) {
    let problem = Fit::of_study(study, vec![record]);
    let fitted = problem.solve().unwrap();
    (problem, fitted)
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_leak_that_begins_within_a_record_is_found_with_its_time_and_its_intensity() {
    let study = spring();
    let leak = fault(&study, "leakage_a.leakage", 0.3);
    let record = begun(&study, 2, leak, 12.0, 40.0);
    let (problem, fitted) = first(&study, record);
    let found = &fitted.suspects[0];
    println!("{:?}", fitted.findings.iter().map(|f| f.sentence(&problem)).collect::<Vec<_>>());
    let onset = found.onset.unwrap();
    assert_eq!(found.name, "leakage_a.leakage");
    assert!((onset.at_s - 12.0).abs() < 0.1, "{onset:?}");
    assert!((found.intensity - 0.3).abs() < 0.01, "{found:?}");
    let named = Fit { suspects: vec![], ..problem };
    let place = (leak.component, leak.fault);
    let named = &intensity_and_onset(&named, &[place]).unwrap()[0];
    assert!(named.interval.0 <= 0.3 && 0.3 <= named.interval.1, "{:?}", named.interval);
    let (low, high) = named.onset.unwrap().interval_s;
    assert!(low <= 12.0 && 12.0 <= high, "{low} {high}");
}

#[test]
fn a_sensor_that_is_set_to_zero_anew_is_named_with_its_time() {
    let study = spring();
    let bias = fault(&study, "sensor_ram.bias_positive", 0.04);
    let (_, fitted) = first(&study, begun(&study, 4, bias, 6.0, 12.0));
    let found = &fitted.suspects[0];
    assert_eq!(found.name, "sensor_ram.bias_positive");
    assert!((found.onset.unwrap().at_s - 6.0).abs() < 0.05, "{found:?}");
    assert!(!fitted.is_update());
}

#[test]
fn a_reading_that_shifts_in_the_log_alone_is_named_with_its_sensor_and_its_time() {
    let study = spring();
    let mut record = record(&study, Some(4), vec![], 12.0);
    let stroke = record.sensors.iter().position(|&s| study.system.sensors[s].id == "x_p").unwrap();
    let width = record.sensors.len();
    let from = (6.0 / record.period_s).round() as usize;
    record.measured.iter_mut().skip(from * width + stroke).step_by(width).for_each(|v| *v += 3e-4);
    let (problem, fitted) = first(&study, record);
    let verdict = problem.verdict(&fitted).unwrap();
    assert_eq!(verdict.name(), "unexplained");
    let sentence = verdict.sentence();
    assert!(sentence.contains("x_p shifts by 0.300 mm at 6.00 s"), "{sentence}");
    assert!(!fitted.is_update());
}
