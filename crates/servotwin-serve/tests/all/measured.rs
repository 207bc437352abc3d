//! Streams on the page: the same samples, the same action, and gaps that stay gaps.

use crate::viewer::{
    FAULT, diagnoser, event_of, get, join, live, messages, own, save, served_from, study, wait_for,
};
use serde_json::{Value, json};
use servotwin::live::closed_loop::{ClosedLoop, ClosedLoopFlight};
use servotwin::study::Study;
use servotwin::table::Table;
use servotwin::units;
use servotwin_model::program::FaultAt;
use servotwin_serve::Stream;
use servotwin_watch::map::Map;
use servotwin_watch::source::{LogRow, Read, Source, SourceError};
use servotwin_watch::watchdog::WatchdogRules;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

/// The sample at which the fault begins.
const ONSET: usize = 200;

/// A map whose columns have the names of inputs and sensors, in SI.
fn map(study: &Study) -> Map {
    let line = |id: &str, unit| {
        format!("{id:?} = {{ column = {id:?}, unit = {:?} }}\n", units::word(unit))
    };
    let inputs = study.system.network().inputs.iter();
    let inputs: String = inputs.map(|input| line(&input.id, input.unit)).collect();
    let sensors = study.system.sensors.iter();
    let sensors: String = sensors.map(|sensor| line(&sensor.id, sensor.unit)).collect();
    let text = format!(
        "format = 1\n[time]\ncolumn = \"time\"\nunit = \"s\"\n[inputs]\n{inputs}[sensors]\n{sensors}"
    );
    Map::parse(&text, "map.toml", &study.system).unwrap()
}

/// The rows of a flight with a fault, in the order of the map's columns.
fn flown(study: &Study, map: &Map, samples: usize) -> Vec<Vec<f64>> {
    let (live, diagnoser) = (live(), diagnoser());
    let scenario = ClosedLoop {
        study,
        inputs: live.inputs,
        faults: vec![],
        duration_s: live.duration_s,
        specimen: None,
        reacts: false,
    };
    let mut flight = ClosedLoopFlight::new(&scenario, &diagnoser).unwrap();
    let (component, fault) = study.system.find_fault(FAULT).unwrap();
    let column = |name: &str, flight: &ClosedLoopFlight, k: usize| {
        let input = study.system.network().inputs.iter().position(|input| input.id == name);
        let sensor =
            study.measured.iter().position(|&place| study.system.sensors[place].id == name);
        match (input, sensor) {
            (Some(input), _) => flight.inputs()[input],
            (_, Some(sensor)) => flight.measured()[sensor],
            _ if name == "time" => k as f64 * diagnoser.period_s,
            _ => f64::NAN,
        }
    };
    let row = |k: usize| {
        if k == ONSET {
            flight.inject(vec![FaultAt { component, fault, intensity: 1.0 }]);
        }
        flight.sample().unwrap();
        map.wanted().names.iter().map(|name| column(name, &flight, k)).collect()
    };
    (0..samples).map(row).collect()
}

/// Rows one after the other.
struct Rows(std::vec::IntoIter<Vec<f64>>, u64);

impl Source for Rows {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        let Some(values) = self.0.next() else { return Ok(Read::End) };
        self.1 += 1;
        *row = LogRow { place: self.1, values, ..LogRow::default() };
        Ok(Read::Row)
    }

    fn counted(&self) -> &'static str {
        "row"
    }
}

/// Rows as a sender sends them.
struct Sent(Receiver<Vec<f64>>, u64);

impl Source for Sent {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        match self.0.recv_timeout(Duration::from_millis(20)) {
            Ok(values) => {
                self.1 += 1;
                *row = LogRow { place: self.1, values, ..LogRow::default() };
                Ok(Read::Row)
            }
            Err(RecvTimeoutError::Timeout) => Ok(Read::Pause),
            Err(RecvTimeoutError::Disconnected) => Ok(Read::End),
        }
    }

    fn counted(&self) -> &'static str {
        "row"
    }

    fn is_live(&self) -> bool {
        true
    }
}

fn stream<'s>(study: &'s Study, title: &str, rows: impl Source + 'static) -> Stream<'s> {
    let no_data_after = Duration::from_millis(300);
    Stream {
        title: title.into(),
        study,
        diagnoser: diagnoser(),
        map: map(study),
        rows: Mutex::new(Box::new(rows)),
        silence: WatchdogRules { no_data_after, ..WatchdogRules::default() },
    }
}

/// The session of rows that come at once.
fn read(study: &Study, rows: Vec<Vec<f64>>) -> Table {
    let found = OnceLock::new();
    served_from(&stream(study, "rows", Rows(rows.into_iter(), 0)), |address| {
        while !get(address, "/events", &address.to_string(), "").1.contains("\"end\"") {
            std::thread::sleep(Duration::from_millis(20));
        }
        found.set(save(address)).unwrap();
        let about = own(address, "/about");
        assert_eq!(about["kind"], "stream");
        let faults = about["components"].as_array().unwrap().iter();
        assert!(faults.map(|one| one["faults"].as_array().unwrap()).all(Vec::is_empty));
    });
    found.into_inner().unwrap()
}

fn events(session: &Table) -> Vec<Value> {
    messages(session)
        .iter()
        .map(|text| text["event"].clone())
        .filter(|event| !event.is_null())
        .collect()
}

#[test]
fn rows_are_shown_sample_by_sample_with_the_action_of_their_fault() {
    let study = study();
    let map = map(&study);
    let rows = flown(&study, &map, 500);
    let session = read(&study, rows.clone());
    let place = map.wanted().names.iter().position(|name| name == "p_a_1").unwrap();
    // Pressures are shown in bar.
    let logged: Vec<f64> = rows.iter().map(|row| row[place] / 1e5).collect();
    let shown = session.f64("reading.p_a_1").unwrap();
    assert_eq!(shown.len(), logged.len());
    assert!(shown.iter().zip(&logged).all(|(one, other)| (one - other).abs() < 1e-4 * other.abs()));
    let residual = session.f64("residual.x_v_1").unwrap();
    let largest = |part: &[f64]| part.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    assert!(largest(&residual[ONSET..]) > 3.0 * largest(&residual[..ONSET]));
    let events = events(&session);
    let action = events.iter().find(|event| event["kind"] == "action").unwrap();
    assert_eq!(
        (&action["actuator"], &action["action"]),
        (&json!("actuator_1"), &json!("shut_down"))
    );
    let at_s = action["time_s"].as_f64().unwrap();
    assert!(at_s > ONSET as f64 * diagnoser().period_s && at_s < 10.0, "{action}");
    assert_eq!(events[0]["kind"], "begin");
}

#[test]
fn a_gap_stays_one_and_a_longer_one_begins_anew() {
    let study = study();
    let rows = flown(&study, &map(&study), ONSET);
    let (time, period_s) = (map(&study).wanted().time.unwrap(), diagnoser().period_s);
    let without = |from: usize, to: usize, later_s: f64| -> Vec<Vec<f64>> {
        let kept = rows.iter().enumerate().filter(|(k, _)| !(from..to).contains(k));
        let moved = |(k, row): (usize, &Vec<f64>)| {
            let mut row = row.clone();
            row[time] += if k >= to { later_s } else { 0.0 };
            row
        };
        kept.map(moved).collect()
    };
    let gap = read(&study, without(60, 70, 0.0));
    let shown = gap.f64("reading.p_a_1").unwrap();
    let missing: Vec<usize> = (0..shown.len()).filter(|&k| shown[k].is_nan()).collect();
    assert_eq!((shown.len(), missing), (ONSET, (60..70).collect()));
    let long = read(&study, without(60, 70, 100.0));
    let shown = long.f64("reading.p_a_1").unwrap();
    let missing: Vec<usize> = (0..shown.len()).filter(|&k| shown[k].is_nan()).collect();
    assert_eq!((shown.len(), missing), (ONSET - 9, vec![60]));
    let events = events(&long);
    let begins: Vec<&str> = events
        .iter()
        .filter(|event| event["kind"] == "begin")
        .map(|event| event["at"].as_str().unwrap())
        .collect();
    assert_eq!(begins.len(), 2, "{begins:?}");
    assert!(period_s > 0.0 && begins[0] != begins[1]);
}

#[test]
fn streams_are_watched_as_they_come_and_silence_is_no_health() {
    let study = study();
    let rows = flown(&study, &map(&study), 400);
    let (sender, sent) = channel();
    let stream = stream(&study, "<left>", Sent(sent, 0));
    served_from(&stream, |address| {
        let mut viewer = join(address);
        rows.into_iter().for_each(|row| sender.send(row).unwrap());
        let action = wait_for(&mut viewer, |said| event_of(said, "action"));
        assert_eq!(action["action"], "shut_down");
        wait_for(&mut viewer, |said| (said["state"]["is_silent"] == true).then_some(()));
        let about = own(address, "/about");
        assert_eq!((&about["kind"], &about["title"]), (&json!("stream"), &json!("<left>")));
        drop(sender);
        wait_for(&mut viewer, |said| event_of(said, "end"));
    });
}
