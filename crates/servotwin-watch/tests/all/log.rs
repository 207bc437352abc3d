//! Logs and streams: maps with their mistakes, samples put in order, what a watch says, and that it goes on
//! where it stopped. What watches is a stand-in that finds a sensor off its default.

use crate::folder::Folder;
use proptest::prelude::*;
use servotwin::study::Study;
use servotwin::system::System;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::spread::Spread;
use servotwin_watch::checkpoint::Checkpoint;
use servotwin_watch::counts::{Irregularity, WatchCounts};
use servotwin_watch::map::{Map, Trust, guess};
use servotwin_watch::player::PlayerRecord;
use servotwin_watch::sequencer::{Sequencer, SequencerRules, Stamped, Tick};
use servotwin_watch::sink::events::Events;
use servotwin_watch::sink::strip::Strip;
use servotwin_watch::sink::threads::{SinkKind, SinkRules, SinkThreads};
use servotwin_watch::sink::{CheckpointFile, Sample, Scene, Sink, SinkError, Watched};
use servotwin_watch::source::{Address, LogColumn, LogRow, Read, Source, SourceError};
use servotwin_watch::watchdog::{Notice, WatchEvent, WatchdogRules};
use servotwin_watch::{
    DiagnosisState, End, Finding, Observation, Observer, Phase, Watch, WatchError,
};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const SPRING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../systems/spring_actuator.toml");

fn spring() -> System {
    System::read(SPRING).unwrap()
}

fn spring_study() -> Study {
    Study::read("spring_actuator").unwrap()
}

/// Sums the first sensor; says *detected* while it is above 1, *isolated* from the third sample on.
#[derive(Default)]
struct Fake {
    sum: f64,
    above: u32,
    zeros: Vec<f64>,
    residuals: Vec<f64>,
    finding: Finding,
    restarts: usize,
}

impl Observer for Fake {
    fn push(&mut self, _: f64, _: &[f64], measured: &[f64]) -> Observation<'_> {
        self.zeros.resize(measured.len(), 0.0);
        self.residuals.clear();
        self.residuals.extend_from_slice(measured);
        if !measured[0].is_nan() {
            self.sum += measured[0];
        }
        self.above = if measured[0] > 1.0 { self.above + 1 } else { 0 };
        self.finding.state = match self.above {
            0 => DiagnosisState::Healthy,
            1 | 2 => DiagnosisState::Detected,
            _ => DiagnosisState::Isolated,
        };
        self.finding.phase = if self.above > 2 { Phase::Raised } else { Phase::None };
        self.finding.actuator_number = (self.above > 2).then_some(1);
        // Any difference in what was summed shows.
        self.finding.detail = if self.above > 0 { format!("{:e}", self.sum) } else { "".into() };
        Observation { twin: &self.zeros, residuals: &self.residuals, finding: &self.finding }
    }

    fn restart(&mut self) {
        *self = Fake { restarts: self.restarts + 1, ..Fake::default() };
    }

    fn save(&self) -> String {
        format!("{} {}", self.sum.to_bits(), self.above)
    }

    fn restore(&mut self, saved: &str) -> Result<(), String> {
        let (sum, above) = saved.split_once(' ').ok_or("too short")?;
        self.sum = f64::from_bits(sum.parse().map_err(|_| "sum")?);
        self.above = above.parse().map_err(|_| "above")?;
        Ok(())
    }
}

/// Keeps every sample.
#[derive(Default)]
struct Kept(Vec<(f64, Vec<f64>, Vec<f64>)>);

impl Sink for Kept {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        self.0.push((sample.time_s, sample.inputs.to_vec(), sample.measured.to_vec()));
        Ok(())
    }
}

const MAP: &str = r#"
format = 1
[time]
column = "t"
unit = "ms"
[inputs]
command = { column = "cmd", unit = "deg", factor = -1 }
supply_pressure = { value = 200, unit = "bar" }
[sensors]
p_a = { column = "PA", unit = "bar" }
x_p = { column = "x", unit = "mm", offset = 2, hold_s = 0.02 }
"#;

fn watch_file(path: &Path, map: &Map) -> (Kept, WatchCounts, Fake) {
    let mut source = Address::File(path.to_path_buf()).open(map.wanted()).unwrap();
    let (mut fake, mut kept) = (Fake::default(), Kept::default());
    let mut watch = Watch::new(&mut *source, map, &mut fake, 0.01);
    watch.sink(&mut kept);
    assert_eq!(watch.run(&AtomicBool::new(false), &mut |_, _| ()).unwrap(), End::Complete);
    let counts = watch.counts().clone();
    (kept, counts, fake)
}

#[test]
fn a_log_comes_in_as_its_map_says() {
    let folder = Folder::new("log-map");
    let system = spring();
    let map = Map::parse(MAP, "map.toml", &system).unwrap();
    let log = folder.write(
        "log.csv",
        "a log of the rig\nx;PA;t;cmd\n1;2,5;0;10\n;NaN;10;20\n;;20;30\n;;30;\n5;3;50;40",
    );
    let (kept, counts, _) = watch_file(&log, &map);
    let times: Vec<f64> = kept.0.iter().map(|(time_s, ..)| *time_s).collect();
    assert_eq!(times, [0.0, 0.01, 0.02, 0.03, 0.04, 0.05]);
    let (_, inputs, measured) = &kept.0[0];
    assert_eq!(inputs, &[-10_f64.to_radians(), 2e7]);
    let sensor = |id: &str| system.sensors.iter().position(|s| s.id == id).unwrap();
    let (p_a, x_p) = (sensor("p_a"), sensor("x_p"));
    assert_eq!((measured[p_a], measured[x_p]), (2.5e5, 0.003));
    assert!(measured.iter().enumerate().all(|(k, v)| v.is_nan() == (k != p_a && k != x_p)));
    // A value stands for 20 ms, then it is missing; a constant is there even in a gap.
    let held: Vec<bool> = kept.0.iter().map(|(_, _, m)| !m[x_p].is_nan()).collect();
    assert_eq!(held, [true, true, true, false, false, true]);
    assert!(kept.0.iter().all(|(_, inputs, _)| inputs[1] == 2e7));
    assert!(kept.0[3].1[0].is_nan());
    let met: Vec<(Irregularity, u64, u64)> =
        counts.met().map(|(k, t)| (k, t.count, t.first)).collect();
    assert_eq!(met, [(Irregularity::NoHeader, 1, 1), (Irregularity::Gap, 1, 5)]);
    assert_eq!((counts.frames, counts.samples), (6, 6));
    assert_eq!(counts.missing[0], 2, "the command");
}

#[test]
fn mistakes_of_a_map_are_shown_where_they_are() {
    let system = spring();
    let text = "\
format = 1
[time]
unit = \"bar\"
[inputs.comand]
column = \"a\"
[sensors.p_a]
column = \"a\"
value = 1
unit = \"mm\"
[sensors.x_p]
column = \"x\"
unit = \"furlong\"
facter = 2
[samples]
wait_s = -1
";
    let refused = |text: &str, expected: &[&str]| {
        let error = Map::parse(text, "map.toml", &system).unwrap_err().to_string();
        for expected in expected {
            assert!(error.contains(expected), "{expected}\n---\n{error}");
        }
    };
    let unknown = ["map.toml:13:1: unknown key 'facter' in 'x_p'", "= nearest: 'factor'"];
    let range = "map.toml:15:10: wait_s = -1 s is out of range: allowed are 0 … 10 s";
    refused(text, &[unknown[0], unknown[1], range, "map.toml: 2 mistakes"]);
    // Where every value can be read, names are looked up.
    let names = [
        "map.toml:2:2: [time] needs either 'column' or 'rate_hz'",
        "map.toml:4:9: the system has no input 'comand'",
        "= nearest: 'command'",
        "map.toml:6:10: 'p_a' needs either 'column' or 'value'",
        "map.toml:9:8: 'mm' is no unit of 'p_a', which is in Pa",
        "map.toml:12:8: unknown unit 'furlong'",
        "map.toml: 6 mistakes",
    ];
    refused(&text.replace("-1", "1"), &[&unknown[..], &names[..]].concat());
    let one = "[sensors]\np_a = { column = \"p\" }\np_b = { column = \"p\" }\n";
    let one = format!("format = 1\n[time]\nrate_hz = 10\n{one}");
    let error = Map::parse(&one, "m", &system).unwrap_err().to_string();
    assert!(error.contains("m:6:1: 'p_a' and 'p_b' have the same column 'p'"), "{error}");
    let error = Map::parse("format = 1\n[time]\nrate_hz = 10\n", "m", &system).unwrap_err();
    assert!(error.to_string().contains("nothing to watch"), "{error}");
}

#[test]
fn a_column_that_the_log_has_not_is_shown_in_the_map() {
    let folder = Folder::new("log-lacking");
    let map = Map::parse(MAP, "map.toml", &spring()).unwrap();
    let log = folder.write("log.csv", "t,cmd,PAA,y\n0,1,2,3\n");
    let error = Address::File(log).open(map.wanted()).err().unwrap();
    assert!(matches!(error, SourceError::Lacking { .. }));
    let text = map.explain(error).unwrap().to_string();
    for expected in ["map.toml:10:18", "no column 'PA'", "nearest: 'PAA'", "no column 'x'"] {
        assert!(text.contains(expected), "{expected}\n---\n{text}");
    }
    let missing = Address::parse("/nowhere/log.csv").unwrap().open(map.wanted()).err().unwrap();
    assert_eq!(missing.to_string(), "/nowhere/log.csv: no such file");
}

#[test]
fn columns_are_found_by_their_names() {
    let system = System::default();
    // As `simulate --out` names them, and as test rigs do.
    let own: Vec<String> = std::iter::once("time_s".to_owned())
        .chain(system.network().inputs.iter().map(|i| format!("{}{}", i.id, i.unit.suffix())))
        .chain(system.sensors.iter().map(|s| format!("{}{}", s.id, s.unit.suffix())))
        .collect();
    let study = Study::default();
    let columns =
        |names: &[String]| -> Vec<LogColumn> { names.iter().map(LogColumn::named).collect() };
    let found = guess(&columns(&own), &study, Trust::Certain);
    assert!(found.time && found.inputs.is_empty() && found.sensors.is_empty(), "{}", found.text);
    assert!(found.assumed.is_empty() && found.unused.is_empty(), "{found:?}");
    let map = Map::parse(&found.text, "map", &system).unwrap();
    assert_eq!(map.unmeasured().count(), 0);
    // Ids with points may be quoted or tables in tables.
    let nested = found.text.replace("\"actuator_1.mode\" =", "actuator_1.mode =");
    assert_ne!(nested, found.text);
    assert!(Map::parse(&nested, "map", &system).is_ok());
    assert_eq!(map.wanted().names.len(), own.len());

    let rig = ["Time [ms]", "Command (deg)", "PA1 [bar]", "p_B1 / bar", "xv2", "oil \"level\""];
    let found = guess(&columns(&rig.map(String::from)), &study, Trust::Certain);
    assert_eq!(found.assumed, ["xv2 in m"]);
    assert_eq!(found.unused, ["oil \"level\""]);
    assert!(found.text.contains("p_a_1 = { column = \"PA1 [bar]\", unit = \"bar\" }"));
    assert!(found.text.contains("x_v_1 = { column = \"?\""), "{}", found.text);
    assert!(found.text.contains("unit = \"ms\""));
    let map = Map::parse(&found.text, "map", &system).unwrap();
    assert_eq!(map.wanted().names.len(), 5, "{}", found.text);
}

/// What a sequencer gives for some samples of one value: the times in periods, `None` for a restart.
fn sequence(
    samples: &[(f64, f64)],
    rules: SequencerRules,
) -> (Vec<Option<(f64, f64)>>, WatchCounts) {
    let mut counts = WatchCounts::new("row", 1);
    let mut sequencer = Sequencer::new(0.01, 1, rules);
    let mut out = vec![];
    let mut take = |sequencer: &mut Sequencer, counts: &mut WatchCounts| {
        while let Some(tick) = sequencer.next(counts) {
            out.push(match tick {
                Tick::Sample { time_s, values, .. } => Some((time_s, values[0])),
                Tick::Restart => None,
            });
        }
    };
    for (place, &(time_s, value)) in samples.iter().enumerate() {
        let place = 1 + place as u64;
        sequencer.push(Stamped { place, time_s, values: vec![value] }, &mut counts);
        take(&mut sequencer, &mut counts);
    }
    sequencer.end(&mut counts);
    take(&mut sequencer, &mut counts);
    (out, counts)
}

fn count(counts: &WatchCounts, kind: Irregularity) -> u64 {
    counts.of(kind).count
}

#[test]
fn samples_out_of_order_are_put_in_order() {
    let time = |k: usize| 3.0 + k as f64 * 0.01;
    let order = [0, 1, 3, 2, 4, 5, 5, 7, 8, 6, 9, 10, 11, 12, 13, 14, 15, 16, 4];
    let samples: Vec<(f64, f64)> = order.map(|k| (time(k), k as f64)).to_vec();
    let (out, counts) = sequence(&samples, SequencerRules::default());
    let values: Vec<f64> = out.iter().map(|tick| tick.unwrap().1).collect();
    assert_eq!(values, (0..17).map(f64::from).collect::<Vec<_>>());
    assert!(out.iter().enumerate().all(|(k, tick)| tick.unwrap().0 == time(k)));
    let met: Vec<(Irregularity, u64, u64)> =
        counts.met().map(|(k, t)| (k, t.count, t.first)).collect();
    assert_eq!(
        met,
        [
            (Irregularity::Reordered, 2, 4),
            (Irregularity::Doubled, 1, 7),
            (Irregularity::Late, 1, 19)
        ]
    );
}

#[test]
fn a_faster_log_gives_the_nearest_samples_and_a_slower_one_gaps() {
    let fast: Vec<(f64, f64)> = (0..100).map(|k| (f64::from(k) * 0.0025, f64::from(k))).collect();
    let (out, counts) = sequence(&fast, SequencerRules::default());
    assert_eq!(out.len(), 26);
    assert!(out.iter().take(25).enumerate().all(|(k, tick)| tick.unwrap().1 == 4.0 * k as f64));
    assert_eq!(count(&counts, Irregularity::Surplus), 74);
    let slow: Vec<(f64, f64)> = (0..10).map(|k| (f64::from(k) * 0.03, f64::from(k))).collect();
    let (out, counts) = sequence(&slow, SequencerRules::default());
    assert_eq!((out.len(), count(&counts, Irregularity::Gap)), (28, 18));
    assert!(out[1].unwrap().1.is_nan() && out[3].unwrap().1 == 1.0);
}

#[test]
fn one_wrong_time_is_dropped_and_ten_are_another_clock() {
    let rules = SequencerRules::default();
    let steady = |from: f64, count: usize| (0..count).map(move |k| (from + k as f64 * 0.01, from));
    let mut samples: Vec<(f64, f64)> = steady(0.0, 50).collect();
    samples.extend([(1e9, -1.0), (3.0, -1.0)]);
    samples.extend(steady(0.5, 20));
    let (out, counts) = sequence(&samples, rules);
    assert_eq!((out.len(), count(&counts, Irregularity::Outlier)), (70, 2));
    assert!(out.iter().all(|tick| tick.unwrap().1 != -1.0));

    for (to, kind) in [
        (1e9, Irregularity::ClockForward),
        (-500.0, Irregularity::ClockBack),
        (0.2, Irregularity::ClockBack),
    ] {
        let mut samples: Vec<(f64, f64)> = steady(0.0, 50).collect();
        samples.extend(steady(to, 30));
        let (out, counts) = sequence(&samples, rules);
        assert_eq!(count(&counts, kind), 1, "{to}");
        assert_eq!(counts.of(kind).first, 51);
        assert_eq!(out.iter().position(Option::is_none), Some(50), "what waited comes before");
        assert_eq!(out[51].unwrap(), (to, to));
        assert_eq!(out.len(), 81, "none of the witnesses is lost");
    }
    // A gap that is not too long is one of missing values.
    let gap = steady(0.0, 10).chain(steady(5.0, 10)).collect::<Vec<_>>();
    let (out, counts) = sequence(&gap, rules);
    assert_eq!((out.len(), count(&counts, Irregularity::Gap)), (510, 490));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever times come: no panic, time goes on by one period but at restarts, and every sample is
    /// somewhere: given on, merged with another, or counted.
    #[test]
    fn no_sample_is_lost_uncounted(
        times in prop::collection::vec(prop_oneof![
            6 => 0..400_i32, 1 => -2_000_000..2_000_000_i32, 1 => 390..410_i32,
        ], 1..300),
        wait_s in 0.0..0.1_f64,
        longest_gap_s in 0.01..3.0_f64,
        witnesses in 2..12_usize,
    ) {
        let rules = SequencerRules { wait_s, longest_gap_s, witnesses };
        let samples: Vec<(f64, f64)> =
            times.iter().map(|&t| (f64::from(t) * 0.004, f64::from(t))).collect();
        let (out, counts) = sequence(&samples, rules);
        let given = out.iter().flatten().filter(|(_, value)| !value.is_nan()).count() as u64;
        let dropped = [Irregularity::Doubled, Irregularity::Surplus, Irregularity::Late, Irregularity::Outlier];
        let dropped: u64 = dropped.iter().map(|&kind| count(&counts, kind)).sum();
        prop_assert_eq!(given + dropped, samples.len() as u64);
        prop_assert_eq!(out.iter().flatten().count() as u64, counts.samples);
        for pair in out.windows(2) {
            if let [Some((before, _)), Some((after, _))] = pair {
                prop_assert!((after - before - 0.01).abs() < 1e-9);
            }
        }
        let restarts = count(&counts, Irregularity::ClockBack) + count(&counts, Irregularity::ClockForward);
        prop_assert_eq!(out.iter().filter(|tick| tick.is_none()).count() as u64, restarts);
    }
}

fn simple_map(system: &System) -> Map {
    let text = "format = 1\n[time]\ncolumn = \"t\"\n[sensors]\np_a = { column = \"p\" }\n";
    Map::parse(text, "map", system).unwrap()
}

/// A log in which the sensor is high for a while now and then.
fn episodes(rows: usize) -> String {
    let mut text = String::from("t,p\n");
    for k in 0..rows {
        let value = if k % 97 > 90 { 2.0 + k as f64 / 7.0 } else { 1.0 / (k + 1) as f64 };
        text += &format!("{:?},{value:?}\n", k as f64 * 0.01);
    }
    text
}

#[test]
fn a_watch_goes_on_where_it_stopped() {
    let folder = Folder::new("log-resume");
    let log = folder.write("log.csv", episodes(5000));
    let system = spring();
    let map = simple_map(&system);
    let events = |stop_at: Option<usize>| {
        let (mut lines, path) = (vec![], folder.0.join("checkpoint.json"));
        let stop = AtomicBool::new(false);
        for part in 0..2 {
            let mut source = Address::File(log.clone()).open(map.wanted()).unwrap();
            let mut stopping =
                Stopping { source: &mut *source, left: stop_at.filter(|_| part == 0), stop: &stop };
            let (mut fake, mut sink) = (Fake::default(), Events::new(&mut lines));
            let mut file = CheckpointFile(path.clone());
            let mut watch = Watch::new(&mut stopping, &map, &mut fake, 0.01);
            watch.sink(&mut sink);
            watch.sink(&mut file);
            watch.save_every(1_000_000);
            if part == 1 {
                watch.resume(Checkpoint::read(&path).unwrap()).unwrap();
            }
            stop.store(false, Ordering::Relaxed);
            if watch.run(&stop, &mut |_, _| ()).unwrap() == End::Complete {
                let counts = watch.counts().clone();
                return (String::from_utf8(lines).unwrap(), counts);
            }
        }
        panic!("it does not end");
    };
    let (whole, counts) = events(None);
    assert!(whole.lines().count() > 100);
    for stop_at in [1, 2, 777, 3003] {
        let (parts, of_parts) = events(Some(stop_at));
        assert_eq!(parts, whole, "stopped at {stop_at}");
        assert_eq!(of_parts, counts);
    }
}

/// Asks to stop after some rows, once.
struct Stopping<'s> {
    source: &'s mut dyn Source,
    left: Option<usize>,
    stop: &'s AtomicBool,
}

impl Source for Stopping<'_> {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        if let Some(left) = &mut self.left {
            *left = left.saturating_sub(1);
            if *left == 0 {
                self.left = None;
                self.stop.store(true, Ordering::Relaxed);
            }
        }
        self.source.read(row)
    }

    fn counted(&self) -> &'static str {
        self.source.counted()
    }
}

#[test]
fn a_checkpoint_of_something_else_is_refused() {
    let folder = Folder::new("log-checkpoint");
    let (system, path) = (spring(), folder.0.join("c.json"));
    let log = folder.write("log.csv", episodes(50));
    let map = simple_map(&system);
    let run = |map: &Map, log: &PathBuf, period_s, resume: bool| -> Result<End, WatchError> {
        let mut source = Address::File(log.clone()).open(map.wanted()).unwrap();
        let mut fake = Fake::default();
        let mut file = CheckpointFile(path.clone());
        let mut watch = Watch::new(&mut *source, map, &mut fake, period_s);
        watch.sink(&mut file);
        watch.save_every(100);
        if resume {
            watch.resume(Checkpoint::read(&path)?)?;
        }
        watch.run(&AtomicBool::new(false), &mut |_, _| ())
    };
    run(&map, &log, 0.01, false).unwrap();
    let other = Map::parse(&(map.text().to_owned() + "# other\n"), "map", &system).unwrap();
    let short = folder.write("short.csv", episodes(10));
    let next = folder.write("next.csv", episodes(50).replace("0.49,", "0.485,"));
    for (result, expected) in [
        (run(&other, &log, 0.01, true), "another map"),
        (run(&map, &log, 0.02, true), "another period"),
        (run(&map, &short, 0.01, true), "the log ends before row 51"),
        (run(&map, &next, 0.01, true), "another log"),
    ] {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    for (text, what) in [
        ("{\"format\": 2, \"sha256\": \"\"}", "format 2, this version reads 1"),
        ("{\"format\": 1, \"sha256\": \"\"}\n{}\n", "its checksum is wrong"),
        ("", "no checkpoint that can be used"),
        ("[]", "no checkpoint that can be used"),
    ] {
        folder.write("c.json", text);
        let error = run(&map, &log, 0.01, true).unwrap_err().to_string();
        assert!(error.contains(what), "{text}: {error}");
    }
    let folder_error = Checkpoint::read(&folder.0).unwrap_err().to_string();
    assert!(folder_error.contains("this is a folder, a file is needed"), "{folder_error}");
}

#[test]
fn a_mutated_checkpoint_gives_one_message_or_goes_on() {
    let folder = Folder::new("log-mutated");
    let (system, path) = (spring(), folder.0.join("c.json"));
    let map = simple_map(&system);
    let mut text = episodes(400);
    // Samples that wait, and some whose time is not believed so far.
    text += "900.0,1\n900.01,1\n900.02,1\n";
    let log = folder.write("log.csv", &text);
    let longer: String = (0..60).map(|k| format!("{:?},1\n", 4.0 + 0.01 * f64::from(k))).collect();
    let goes_on = || -> Result<End, WatchError> {
        let mut source = Address::File(log.clone()).open(map.wanted()).unwrap();
        let mut fake = Fake::default();
        let mut watch = Watch::new(&mut *source, &map, &mut fake, 0.01);
        watch.resume(Checkpoint::read(&path)?)?;
        watch.run(&AtomicBool::new(false), &mut |_, _| ())
    };
    let mut source = Address::File(log.clone()).open(map.wanted()).unwrap();
    let stop = AtomicBool::new(false);
    let mut stopping = Stopping { source: &mut *source, left: Some(404), stop: &stop };
    let mut fake = Fake::default();
    let mut file = CheckpointFile(path.clone());
    let mut watch = Watch::new(&mut stopping, &map, &mut fake, 0.01);
    watch.sink(&mut file);
    watch.save_every(1_000_000);
    assert_eq!(watch.run(&stop, &mut |_, _| ()).unwrap(), End::Stopped);
    drop(watch);
    let whole = std::fs::read(&path).unwrap();
    folder.write("log.csv", text.clone() + &longer);
    goes_on().unwrap();
    // Bytes that flip, and ends that are missing.
    let mut dice = Dice(11);
    for _ in 0..300 {
        let mut damaged = whole.clone();
        match dice.roll(4) {
            0 => damaged.truncate(dice.roll(whole.len() as u64) as usize),
            _ => damaged[dice.roll(whole.len() as u64) as usize] ^= 1 << dice.roll(8),
        }
        folder.write("c.json", &damaged);
        assert_message(&goes_on(), &format!("{:?}", String::from_utf8_lossy(&damaged)));
    }
}

/// Asserts that a refused checkpoint gives one line.
fn assert_message(outcome: &Result<End, WatchError>, what: &str) {
    if let Err(error) = outcome {
        let text = error.to_string();
        assert!(text.lines().count() == 1 && text.len() < 500, "{what}: {text}");
    }
}

/// A generator that needs no crate: the same bytes every time.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, sides: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % sides
    }
}

/// A stream of good lines between all sorts of bad ones.
fn damaged(frames: u64, seed: u64) -> Vec<u8> {
    let mut dice = Dice(seed);
    let mut bytes = b"t,p\n".to_vec();
    for k in 0..frames {
        let time_s = k as f64 * 0.01;
        let good = match dice.roll(2) {
            0 => format!("{time_s:?},{}\n", dice.roll(3)),
            _ => format!("{{\"t\": {time_s:?}, \"p\": {}}}\n", dice.roll(3)),
        };
        match dice.roll(12) {
            0 => bytes.extend((0..dice.roll(80)).map(|_| dice.0 as u8).collect::<Vec<_>>()),
            1 => bytes.extend(&good.as_bytes()[..dice.roll(good.len() as u64) as usize]),
            2 => bytes.extend(format!("{},{}\n", 1e9 * dice.roll(9) as f64, 1).bytes()),
            3 => bytes.extend(format!("{:?},nan\n", time_s - 0.01 * dice.roll(300) as f64).bytes()),
            4 => {
                let mut flipped = good.into_bytes();
                let at = dice.roll(flipped.len() as u64) as usize;
                flipped[at] ^= 1 << dice.roll(8);
                bytes.extend(flipped);
            }
            5 => {
                bytes.extend(format!("{time_s},1,{}\n", "2,".repeat(dice.roll(9) as usize)).bytes())
            }
            _ => bytes.extend(good.bytes()),
        }
    }
    bytes
}

fn survives(frames: u64, seed: u64) {
    let folder = Folder::new(&format!("fuzz-{seed}"));
    let log = folder.write("log.csv", damaged(frames, seed));
    let system = spring();
    let (kept, counts, _) = watch_file(&log, &simple_map(&system));
    assert_eq!(counts.samples, kept.0.len() as u64);
    let met: Vec<Irregularity> = counts.met().map(|(kind, _)| kind).collect();
    for kind in [
        Irregularity::Noise,
        Irregularity::WrongColumns,
        Irregularity::BadObject,
        Irregularity::Late,
        Irregularity::Outlier,
    ] {
        assert!(met.contains(&kind), "{kind:?} of {met:?}");
    }
    // More than half of the lines were good.
    assert!(kept.0.len() as u64 > frames / 2, "{} of {frames}", kept.0.len());
    if frames > 100_000 {
        println!("{counts:#?}");
    }
}

#[test]
fn a_damaged_stream_is_counted_and_goes_on() {
    (1..=5).for_each(|seed| survives(3000, seed));
}

#[test]
#[ignore = "takes long"]
fn a_million_damaged_frames() {
    survives(1_000_000, 99);
}

/// The page of the aileron, watched by the shipped diagnosis or another one.
fn page_of(title: &str, change: impl Fn(&mut Diagnoser)) -> Watched<PlayerRecord> {
    let study = Study::default();
    let mut diagnoser = servotwin_watch::shipped::diagnoser(&study).unwrap();
    change(&mut diagnoser);
    let scene = Scene::of_study(title, &study, &diagnoser);
    let record = PlayerRecord::new(&scene.title, scene.period_s, scene.signals.clone());
    Watched::new(scene, record)
}

#[test]
fn an_hour_is_a_small_page() {
    let system = System::default();
    let (mut page, mut strip) = (page_of("An hour <of> flight", |_| ()), Strip::default());
    let mut dice = Dice(7);
    let mut noise = |count: usize| -> Vec<f64> {
        (0..count).map(|_| dice.roll(1000) as f64 / 500.0 - 1.0).collect()
    };
    let mut finding = Finding { state: DiagnosisState::Healthy, ..Finding::default() };
    let inputs = system.network().inputs.len();
    for k in 0..360_000_usize {
        let (inputs, sensors) = (noise(inputs), noise(13));
        if k == 200_000 {
            finding.state = DiagnosisState::Isolated;
            finding.action = "shutdown".into();
        }
        let observation = Observation { twin: &sensors, residuals: &sensors, finding: &finding };
        let changed = k == 0 || k == 200_000;
        let sample = Sample::new((k as f64 * 0.01, 0), &inputs, &sensors, &observation, changed);
        page.sample(&sample).unwrap();
        strip.sample(&sample).unwrap();
    }
    let html = page.screen.page("at the end", "row 3: '<x>'");
    assert!(html.len() < 3_000_000, "{}", html.len());
    assert!(html.contains("An hour &#60;of&#62; flight"));
    assert!(html.contains("row 3: &#39;&#60;x&#62;&#39;"));
    let html = html.replace("https://github.com/leeoniya/uPlot", "");
    for resource in ["http:", "https:", "src=", "@import", "url("] {
        assert!(!html.contains(resource), "{resource}");
    }
    assert_eq!(html.matches("</script>").count(), 5);
    let text = strip.text();
    assert!(text.contains("2000.00 s  isolated: shutdown"), "{text}");
    assert!(text.lines().next().unwrap().contains(".####"), "{text}");
}

#[test]
fn a_residual_that_is_divided_by_its_spread_is_no_share_of_scale() {
    let spread = Spread { spool: 3, growth: 1.0 };
    let page = page_of("a log", |diagnoser| diagnoser.sensors[3].spread = Some(spread));
    let html = page.screen.page("", "");
    assert_eq!(html.matches("\"% of scale and spread\"").count(), 1);
    assert_eq!(html.matches("\"% of scale\"").count(), 12);
}

/// Judges nothing: the environment is invalid while the command is large, and at one sample for another reason.
#[derive(Default)]
struct Doubting(Fake);

impl Observer for Doubting {
    fn push(&mut self, time_s: f64, inputs: &[f64], measured: &[f64]) -> Observation<'_> {
        let reason = match inputs[0] {
            command if command > 0.1 => "environment invalid / command / out of range",
            _ if (time_s - 0.5).abs() < 1e-9 => "environment invalid / supply_pressure / doubtful",
            _ => "",
        };
        self.0.push(time_s, inputs, measured);
        self.0.finding = Finding { evidence: vec![reason.into()], ..Finding::default() };
        if !reason.is_empty() {
            self.0.finding.state = DiagnosisState::EnvironmentInvalid;
        }
        Observation { twin: &self.0.zeros, residuals: &self.0.residuals, finding: &self.0.finding }
    }

    fn restart(&mut self) {}

    fn save(&self) -> String {
        String::new()
    }

    fn restore(&mut self, _: &str) -> Result<(), String> {
        Ok(())
    }
}

#[test]
fn an_invalid_environment_is_explained_where_nothing_could_be_judged() {
    let folder = Folder::new("log-environment");
    let study = spring_study();
    let command = |row: usize| match row % 3 {
        0 => 0.1 + 0.001 * row as f64,
        _ => 0.0,
    };
    let rows = (0..99).map(|row| format!("{:?},1e5,{:?}\n", row as f64 * 0.01, command(row)));
    let log = folder.write("log.csv", format!("t,p,c\n{}", rows.collect::<String>()));
    let text = "format = 1\n[time]\ncolumn = \"t\"\n[sensors]\np_a = { column = \"p\" }\n\
                [inputs]\ncommand = { column = \"c\", unit = \"rad\" }\n";
    let map = Map::parse(text, "map", &study.system).unwrap();
    let mut source = Address::File(log).open(map.wanted()).unwrap();
    let mut observer = Doubting::default();
    let mut watch = Watch::new(&mut *source, &map, &mut observer, 0.01);
    watch.expect(&study, &[(-0.1, 0.1), (1e4, 1e8)]);
    watch.run(&AtomicBool::new(false), &mut |_, _| ()).unwrap();
    let said = watch.doubts();
    let expected = "the environment was invalid in 33 of 99 periods: command lies outside of -0.1 … 0.1 rad by up to \
                    0.096 rad, environment invalid / supply_pressure / doubtful";
    assert!(said.iter().any(|sentence| sentence == expected), "{said:?}");
}

#[test]
fn parquet_and_csv_of_the_same_log_say_the_same() {
    use servotwin::table::Table;
    let folder = Folder::new("log-parquet");
    let system = spring();
    let map = simple_map(&system);
    let csv = folder.write("log.csv", episodes(300));
    let parquet = folder.0.join("log.parquet");
    Table::read(&csv).unwrap().write(&parquet).unwrap();
    let ((one, counts, _), (other, ..)) = (watch_file(&csv, &map), watch_file(&parquet, &map));
    let bits = |kept: &Kept| -> Vec<(u64, u64)> {
        kept.0.iter().map(|(t, _, m)| (t.to_bits(), m[0].to_bits())).collect()
    };
    assert_eq!(bits(&one), bits(&other));
    assert_eq!(counts.met().count(), 0);
    let values = Table::read(&csv).unwrap().f64("p").unwrap().into_owned();
    assert!(one.0.iter().zip(&values).all(|((_, _, m), v)| m[0].to_bits() == v.to_bits()));
}

/// A stream that is silent until the watch has said so, and once more.
struct Quiet {
    /// Rows between silences.
    left: Vec<usize>,
    rows: u64,
    said: Arc<Mutex<Vec<Notice>>>,
}

impl Source for Quiet {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        let count = |event: &WatchEvent| {
            let said = self.said.lock().unwrap();
            said.iter().filter(|notice| notice.event == *event).count()
        };
        match self.left.last_mut() {
            None => return Ok(Read::End),
            Some(0) => {
                // The second silence begins when the end of the first was reported; a silence lasts until a beat falls in it.
                std::thread::sleep(Duration::from_millis(1));
                let is_beat = |notice: &Notice| {
                    matches!(notice.event, WatchEvent::Heartbeat { .. })
                        && notice.state == DiagnosisState::NoData
                };
                let beats = self.said.lock().unwrap().iter().any(is_beat);
                if beats && count(&WatchEvent::NoData) > count(&WatchEvent::DataAgain) {
                    self.left.pop();
                }
                return Ok(Read::Pause);
            }
            Some(left) => *left -= 1,
        }
        self.rows += 1;
        row.place = self.rows;
        row.values = vec![self.rows as f64 * 0.01, 0.5];
        Ok(Read::Row)
    }

    fn counted(&self) -> &'static str {
        "line"
    }

    fn is_live(&self) -> bool {
        true
    }
}

/// Keeps every notice.
struct Heard(Arc<Mutex<Vec<Notice>>>);

impl Sink for Heard {
    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        self.0.lock().unwrap().push(notice.clone());
        Ok(())
    }
}

#[test]
fn a_silent_stream_is_no_longer_healthy_and_comes_back_healthy() {
    let system = spring();
    let map = simple_map(&system);
    let said = Arc::new(Mutex::new(vec![]));
    let mut source = Quiet { left: vec![50, 50, 50], rows: 0, said: said.clone() };
    let (mut fake, mut kept, mut heard) = (Fake::default(), Kept::default(), Heard(said.clone()));
    let (mut page, mut strip) = (page_of("a stream", |_| ()), Strip::default());
    let mut watch = Watch::new(&mut source, &map, &mut fake, 0.01);
    watch.sink(&mut kept);
    watch.sink(&mut strip);
    watch.sink(&mut page);
    watch.sink(&mut heard);
    watch.watchdog(WatchdogRules {
        no_data_after: Duration::from_millis(200),
        heartbeat: Some(Duration::from_millis(20)),
    });
    watch.run(&AtomicBool::new(false), &mut |_, _| ()).unwrap();
    assert!(watch.silences().source >= 3);
    drop(watch);
    for text in [strip.text(), page.screen.page("", "")] {
        assert!(text.contains("no data: the source is silent for 0."), "{text}");
    }
    // The wall clock has no part in what is given on.
    let times: Vec<f64> = kept.0.iter().map(|(time_s, ..)| *time_s).collect();
    assert_eq!(times.len(), 150);
    let said = said.lock().unwrap();
    let of = |event: WatchEvent| said.iter().filter(move |notice| notice.event == event);
    assert!(of(WatchEvent::NoData).all(|notice| notice.state == DiagnosisState::NoData));
    assert!(of(WatchEvent::NoData).all(|notice| notice.silent_s >= 0.2));
    assert!(of(WatchEvent::DataAgain).all(|notice| notice.state == DiagnosisState::Healthy));
    assert!(of(WatchEvent::DataAgain).count() >= 2);
    let is_beat = |notice: &&Notice| matches!(notice.event, WatchEvent::Heartbeat { .. });
    let silent = |notice: &&Notice| notice.state == DiagnosisState::NoData;
    assert!(said.iter().filter(is_beat).any(|notice| silent(&notice)), "it beats in silence");
}

/// Waits for a permission before each sample, and says which it got.
struct Slow {
    permits: Receiver<()>,
    got: Sender<(f64, bool)>,
}

impl Sink for Slow {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        let _ = self.permits.recv();
        let _ = self.got.send((sample.time_s, sample.changed));
        Ok(())
    }
}

/// Fails at its first sample.
struct Full;

impl Sink for Full {
    fn sample(&mut self, _: &Arc<Sample>) -> Result<(), SinkError> {
        Err(SinkError::Output(std::io::ErrorKind::StorageFull.into()))
    }
}

fn rules(name: &str, waits: bool, kind: SinkKind) -> SinkRules {
    SinkRules { name: name.into(), waits, kind }
}

/// Gives samples, of which every so many-th is a change, and says whether one of them failed.
fn give_all(sink: &mut dyn Sink, count: usize, every: usize) -> Result<(), SinkError> {
    let (values, finding) = ([0.5; 2], Finding::default());
    let observation = Observation { twin: &values, residuals: &values, finding: &finding };
    (0..count).try_for_each(|k| {
        let (time_s, place, changed) = (k as f64, k as u64, k % every == 0);
        let (inputs, measured) = (&values[..], &values[..]);
        sink.sample(&Sample::new((time_s, place), inputs, measured, &observation, changed))
    })
}

#[test]
fn a_sink_that_stands_still_delays_nobody_and_loses_its_own_samples_first() {
    for (kind, every) in [(SinkKind::Terminal, 100), (SinkKind::Changes, 1)] {
        let (permit, permits) = channel();
        let (got, slow_got) = channel();
        let (permit_all, all_permits) = channel();
        let (other_got, others) = channel();
        let mut threads = SinkThreads::new(true);
        threads.add(rules("slow", false, kind), Box::new(Slow { permits, got }));
        let other = Slow { permits: all_permits, got: other_got };
        threads.add(rules("other", true, kind), Box::new(other));
        drop(permit_all);
        // Nobody permits the slow one anything: this would stand still if it were waited for.
        give_all(&mut threads, 20_000, every).unwrap();
        drop(permit);
        let losses = threads.finish().unwrap();
        let found: Vec<(f64, bool)> = slow_got.iter().collect();
        assert_eq!(others.iter().count(), 20_000, "the other has lost none");
        assert!(found.len() <= 1025, "{}", found.len());
        if kind == SinkKind::Terminal {
            let changes = found.iter().filter(|(_, changed)| *changed).count();
            assert_eq!(changes, 200, "changes have places of their own");
            assert_eq!(losses, [], "what a terminal does not show is stored elsewhere");
        } else {
            assert_eq!((losses[1].lost, &losses[1].failure), (0, &None));
            assert_eq!(losses[0].lost, 20_000 - found.len() as u64);
        }
    }
}

#[test]
fn a_sink_that_fails_is_reported_once_and_the_others_go_on() {
    let (got, others) = channel();
    let (permit, permits) = channel();
    drop(permit);
    let mut threads = SinkThreads::new(true);
    threads.add(rules("full", false, SinkKind::Changes), Box::new(Full));
    threads.add(rules("other", true, SinkKind::Changes), Box::new(Slow { permits, got }));
    let mut failures = vec![];
    while failures.is_empty() {
        give_all(&mut threads, 100, 1).unwrap();
        failures = threads.failures();
    }
    assert_eq!(failures.len(), 1);
    assert_eq!(failures[0].0, "full");
    give_all(&mut threads, 100, 1).unwrap();
    assert_eq!(threads.failures(), []);
    let losses = threads.finish().unwrap();
    assert_eq!(losses[0].lost as usize, others.iter().count(), "all of them, the first included");
    assert!(losses[0].failure.is_some() && losses[1].failure.is_none());
    // A log can be read again: there it is an error.
    let mut threads = SinkThreads::new(false);
    threads.add(rules("full", true, SinkKind::Changes), Box::new(Full));
    let given = give_all(&mut threads, 100, 1);
    assert!(given.is_err() || threads.finish().is_err());
}
