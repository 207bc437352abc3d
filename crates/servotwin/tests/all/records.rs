//! The diagnoser of records in operation: at the end of a record it sees the features of the data set, and answers as
//! the data set's evaluation does.

use crate::folder::Folder;
use servotwin::job::{Folder as Results, Job, StudyRun, Subject, outcomes};
use servotwin::learn::model_file::read_diagnoser;
use servotwin::measure::VISIBLE;
use servotwin::parallel::Workers;
use servotwin::records::columns::{largest_column, view_column};
use servotwin::run::{Observer, Runner, plan};
use servotwin::study::{Purpose, Scenario, Study};
use servotwin::table::Table;
use servotwin_diagnosis::diagnoser::{IndexedFinding, Session};
use servotwin_diagnosis::panel::{Panel, PanelVerdict};
use std::sync::Arc;

const TAIL: &str = r#"
[[classes]]
detail = "valve"
action = "shut_down"
faults = ["servo_valve.bias_positive", "servo_valve.gain_low"]
[[classes]]
detail = "leak"
action = "warning"
faults = ["leakage_a.leakage"]
[realistic]
healthy = 6
[training]
duration_s = 2
healthy = 6
signals.T1 = "noise:rms=5deg,bandwidth=1Hz,seed=77"
signals.T2 = "noise:rms=4deg,bandwidth=1Hz,seed=78"
load = [0.5, 1]
[reactions]
shut_down = { switches_off = true, actuator_inputs = { mode = 0 } }
"#;

/// Watches a record with a session, which accepts these inputs.
struct Watched(Session, Vec<f64>);

impl Observer for Watched {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        self.0.push(&self.1, measured, twin);
    }
}

/// The verdict of a data set's row, and its features in both views.
fn of_row(table: &Table, panel: &Panel, row: usize) -> (PanelVerdict, Vec<Vec<f64>>) {
    let cell = |name: String| table.f64(&name).unwrap()[row];
    let features = &panel.trees.names.features;
    let view = |view| features.iter().map(|name| cell(view_column(view, name))).collect();
    let views: Vec<Vec<f64>> = (0..2).map(view).collect();
    let largest: Vec<f64> =
        panel.bands.iter().map(|band| cell(largest_column(&band.sensor))).collect();
    (panel.diagnose(&largest, &views, &mut panel.scratch()).unwrap(), views)
}

#[test]
fn a_session_that_watches_a_record_answers_as_the_data_set() {
    let study = Study::parse(&(include_str!("../tiny.toml").to_owned() + TAIL), "tiny.toml");
    let (study, folder) = (study.unwrap(), Folder::new("records"));
    let results = Results::new(&folder.0);
    let run = StudyRun::new(Job::new(&study, &results));
    drop(StudyRun { only: Some(Scenario::Noise), ..run }.run().unwrap());
    let diagnoser = Arc::new(read_diagnoser(results.records(Subject::Noise)).unwrap());
    assert!(diagnoser.record_s().is_some() && crate::flights::diagnoser().record_s().is_none());
    let table = Table::read(results.data_set(Scenario::Noise, Purpose::Test)).unwrap();
    let session = Session::new(diagnoser.clone()).unwrap().at_rest();

    let inputs: Vec<f64> = study.system.network().inputs.iter().map(|own| own.default).collect();
    let suite = study.records(Purpose::Test);
    let runs: Vec<_> =
        (0..plan::count(&study, &suite)).map(|number| plan::run(&study, &suite, number)).collect();
    assert_eq!(runs.len(), table.row_count());
    let (plants, workers) = ((Scenario::Noise, None), Workers::new(2));
    let flown = Runner::new(&study, &suite, plants, runs, workers).unwrap();
    let (mut healthy, mut isolated) = (0, 0);
    flown.fly(
        |_| Watched(session.clone(), inputs.clone()),
        |run, Watched(session, _), outcome| {
            assert!(outcome.is_ok());
            let (verdict, views) = of_row(&table, &diagnoser.lengths[0].panel, run.number);
            // A window within its bands asks no trees, so its features are not computed.
            for (seen, stored) in session.features(0).iter().zip(&views) {
                let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                let is_asked = verdict != PanelVerdict::Healthy;
                assert!(!is_asked || bits(seen) == bits(stored), "run {}", run.number);
            }
            let finding = session.outcome().finding;
            match verdict {
                PanelVerdict::Healthy => {
                    healthy += 1;
                    assert_eq!(finding, IndexedFinding::Healthy, "run {}", run.number);
                }
                PanelVerdict::Isolated(said) => {
                    isolated += 1;
                    let named = match finding {
                        IndexedFinding::Action { actuator, action }
                        | IndexedFinding::Detail { actuator, action, .. } => {
                            (Some(actuator), Some(action))
                        }
                        _ => panic!("run {}: {finding:?} beside {said:?}", run.number),
                    };
                    assert_eq!(named, (said.actuator, said.action), "run {}", run.number);
                }
                PanelVerdict::NotIsolated(_) => {}
            }
        },
    );
    assert!(healthy >= 6 && isolated >= 12, "{healthy} healthy, {isolated} isolated");

    // The same answers are rows of outcomes.
    let stored = outcomes::stored(&results, &suite.name, Scenario::Noise).unwrap().unwrap();
    assert_eq!(stored.outcomes.len(), table.row_count());
    let named = stored.outcomes.iter().filter(|row| !row.first_action.is_empty());
    let alarms = stored.outcomes.iter().filter(|row| row.early_alarms > 0);
    assert_eq!(named.count() + alarms.count(), isolated);
    let [visible, of] = VISIBLE.count(stored.outcomes.iter());
    let detectable = table.bool("detectable").unwrap();
    assert_eq!((visible, of), (detectable.iter().filter(|own| **own).count() as u64, 24));
}
