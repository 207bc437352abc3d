//! What is refused of a log before it is judged, and what its times mean: the inputs of the cases 15 to 35, made here.

use crate::folder::Folder;
use servotwin::fit::FitRecord;
use servotwin::live::watcher::Watcher;
use servotwin::prelude::Simulation;
use servotwin::study::Study;
use servotwin::table::{Column, Table};
use servotwin_watch::guard::{self, IntakeError, LogPlan, Opened};
use servotwin_watch::intake::{self, Whole};
use servotwin_watch::map::{Map, Trust, guess};
use servotwin_watch::shipped;
use servotwin_watch::sink::{Sink, SinkError};
use servotwin_watch::source::table::{TableRows, table_columns};
use servotwin_watch::source::{Address, LogColumn, LogRow, Read, Source, SourceError};
use servotwin_watch::span::LogSpan;
use servotwin_watch::watchdog::Notice;
use servotwin_watch::{End, Finding, Observation, Observer, Watch, WatchError};
use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn press() -> Study {
    Study::read("press_axis").unwrap()
}

/// Six seconds of a healthy axis.
fn healthy(study: &Study) -> Table {
    let command = "noise:rms=25mm,bandwidth=0.7Hz,limit=100mm,seed=5";
    let simulation = Simulation::new(&study.system).input("command", command);
    simulation.run().unwrap().table().unwrap()
}

/// Says of every sample what the twin showed in a recorded one.
struct Replayed {
    twin: Vec<Vec<f64>>,
    next: usize,
    empty: Vec<f64>,
    finding: Finding,
}

impl Replayed {
    fn new(study: &Study, table: &Table) -> Self {
        let sensors = &study.system.sensors;
        let name = |id: &str| table.names().find(|name| name.starts_with(id)).unwrap().to_owned();
        let columns: Vec<Vec<f64>> = sensors
            .iter()
            .map(|sensor| table.f64(&name(&sensor.id)).unwrap().into_owned())
            .collect();
        let row = |row: usize| columns.iter().map(|column| column[row]).collect();
        let twin = (0..table.row_count()).map(row).collect();
        let empty = vec![f64::NAN; sensors.len()];
        Replayed { twin, next: 0, empty, finding: Finding::default() }
    }
}

impl Observer for Replayed {
    fn push(&mut self, _: f64, _: &[f64], _: &[f64]) -> Observation<'_> {
        self.next += 1;
        let twin = &self.twin[(self.next - 1).min(self.twin.len() - 1)];
        let Replayed { empty, finding, .. } = self;
        Observation { twin, residuals: empty, finding }
    }

    fn restart(&mut self) {}

    fn save(&self) -> String {
        String::new()
    }

    fn restore(&mut self, _: &str) -> Result<(), String> {
        Ok(())
    }
}

/// The plan and the trial of a text with rows: the refusal, if any.
fn tried(study: &Study, folder: &Folder, text: &str) -> Result<LogPlan, String> {
    let log = Address::File(folder.write("log.csv", text));
    let columns = log.columns().map_err(|error| error.to_string())?;
    let plan = guard::plan("log.csv", &columns, study, true).map_err(|error| error.to_string())?;
    let twin = healthy(study);
    let mut open = |map: &Map| -> Result<Opened, WatchError> {
        Ok((log.open(map.wanted())?, Box::new(Replayed::new(study, &twin))))
    };
    let found = guard::trial(&mut open, &plan.map, study, 0.01).unwrap().contradictions;
    if found.is_empty() { Ok(plan) } else { Err(found.join("; ")) }
}

/// What the trial says of a table beside a recorded twin.
fn tried_table(study: &Study, map: &Map, table: &Table, twin: &Table) -> Vec<String> {
    let mut open = |map: &Map| -> Result<Opened, WatchError> {
        let rows = TableRows::of_table("log", table, map.wanted())?;
        Ok((Box::new(rows), Box::new(Replayed::new(study, twin))))
    };
    guard::trial(&mut open, map, study, 0.01).unwrap().contradictions
}

/// A source that says that it is live.
struct Live(TableRows);

impl Source for Live {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        self.0.read(row)
    }

    fn counted(&self) -> &'static str {
        "row"
    }

    fn is_live(&self) -> bool {
        true
    }
}

/// Keeps what a watch reports besides findings.
#[derive(Default)]
struct Reported(Vec<String>);

impl Sink for Reported {
    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        self.0.extend(notice.words());
        Ok(())
    }
}

/// Watches a table beside a recorded twin: how the watch ends, what contradicts the map, and what is reported.
fn watched(
    study: &Study,
    (map, table, twin): (&Map, &Table, &Table),
    is_live: bool,
) -> (End, Vec<String>, Vec<String>) {
    let rows = TableRows::of_table("log", table, map.wanted()).unwrap();
    let mut source: Box<dyn Source> = if is_live { Box::new(Live(rows)) } else { Box::new(rows) };
    let (mut observer, mut reported) = (Replayed::new(study, twin), Reported::default());
    let mut watch = Watch::new(&mut *source, map, &mut observer, 0.01);
    watch.expect(study, &[]);
    watch.sink(&mut reported);
    let end = watch.run(&AtomicBool::new(false), &mut |_, _| ()).unwrap();
    let found = watch.contradictions();
    drop(watch);
    (end, found, reported.0)
}

/// A table whose columns are changed from a row on: `change` gets the columns, the name and the row.
fn changed(table: &Table, change: impl Fn(&dyn Fn(&str) -> f64, &str, usize) -> f64) -> Table {
    let columns = table.columns().iter().map(|column| {
        let value =
            |row: usize| change(&|name: &str| table.f64(name).unwrap()[row], &column.name, row);
        let values: Vec<f64> = (0..table.row_count()).map(value).collect();
        Column::new(column.name.clone(), column.unit.clone(), values)
    });
    Table::from_columns(columns.collect()).unwrap()
}

/// A table as CSV, every number as `cell` writes it: its column, row and value.
fn csv(table: &Table, cell: impl Fn(&str, usize, f64) -> String) -> String {
    let mut text = table.names().collect::<Vec<_>>().join(",") + "\n";
    for row in 0..table.row_count() {
        let value = |name: &str| table.f64(name).unwrap()[row];
        let cells: Vec<String> = table.names().map(|name| cell(name, row, value(name))).collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

#[test]
fn a_log_that_contradicts_its_map_is_refused_before_it_is_judged() {
    let (study, folder) = (press(), Folder::new("guard-contradictions"));
    let table = healthy(&study);
    let plain = csv(&table, |_, _, value| format!("{value:?}"));
    let sound = tried(&study, &folder, &plain).unwrap();
    assert!(sound.warnings.is_empty(), "{:?}", sound.warnings);
    let gauge = csv(&table, |name, _, value| match name.ends_with("_pa") {
        true => format!("{}", value - 101_325.0),
        false => format!("{value}"),
    });
    let coarse = csv(&table, |name, row, value| match name {
        "time_s" => format!("{}", (1e5 + (row / 10) as f64) / 10.0),
        _ => format!("{value}"),
    });
    let millimetres = csv(&table, |name, _, value| match name {
        "x_p_m" => format!("{}", 1e3 * value),
        _ => format!("{value}"),
    });
    let renamed = |one: &str, other: &str| {
        let (head, rows) = plain.split_once('\n').unwrap();
        format!("{}\n{rows}", head.replace(one, "?").replace(other, one).replace('?', other))
    };
    for (log, parts) in [
        (renamed("p_a_pa", "p_b_pa"), vec!["p_a and p_b look exchanged"]),
        (renamed("p_a_pa", "p_s_pa"), vec!["p_a and p_s look exchanged"]),
        (gauge.clone(), vec!["p_a, p_b, p_s are all one atmosphere below the twin", "barg"]),
        (millimetres, vec!["x_p seems to be in mm, not m: it is 1000 times"]),
        (coarse, vec!["have the time of another and other values", "rate_hz = 100 instead"]),
    ] {
        let told = tried(&study, &folder, &log).err().unwrap_or_default();
        assert!(parts.iter().all(|part| told.contains(part)), "{parts:?}: {told}");
        assert!(!told.contains("sign"), "{told}");
    }
    // Times in another unit are seen in the first rows.
    let milliseconds = csv(&table, |name, row, value| match name {
        "time_s" => format!("{}", 10 * row),
        _ => format!("{value}"),
    });
    let told = tried(&study, &folder, &milliseconds).err().unwrap_or_default();
    assert!(told.starts_with("its times seem to be in ms"), "{told}");
    // The same gauge pressures, said to be such.
    let said = gauge.replacen("p_a_pa", "p_a [Pag]", 1).replacen("p_b_pa", "p_b [Pa(g)]", 1);
    tried(&study, &folder, &said.replacen("p_s_pa", "p_s_pag", 1)).unwrap();
}

#[test]
fn a_fit_refuses_exchanged_columns_and_gauge_pressures_with_the_same_words() {
    let (study, folder) = (press(), Folder::new("guard-fit"));
    let table = healthy(&study);
    let swap = |name: &str| match name {
        "p_a_pa" => "p_b_pa".to_owned(),
        "p_b_pa" => "p_a_pa".to_owned(),
        name => name.to_owned(),
    };
    let gauge = csv(&table, |name, _, value| match name.ends_with("_pa") {
        true => format!("{}", value - 101_325.0),
        false => format!("{value}"),
    });
    let plain = csv(&table, |_, _, value| format!("{value}"));
    let (head, rows) = plain.split_once('\n').unwrap();
    let head = head.split(',').map(swap).collect::<Vec<_>>().join(",");
    for (log, part) in [
        (format!("{head}\n{rows}"), "p_a_pa and p_b_pa look exchanged"),
        (gauge, "all one atmosphere below the twin"),
    ] {
        let log = folder.write("log.csv", log);
        let whole = intake::read(&log, None, LogSpan::default(), &study).unwrap();
        let record = FitRecord::from_table("log", &whole.table, &study.system).unwrap();
        let problem = servotwin::fit::Fit::of_study(&study, vec![record]);
        let told = problem.check().unwrap_err().to_string();
        assert!(told.contains(part), "{told}");
    }
}

fn columns(names: &[&str]) -> Vec<LogColumn> {
    names.iter().map(|name| LogColumn::named(*name)).collect()
}

#[test]
fn an_unknown_unit_and_two_columns_of_one_meaning_are_no_signal() {
    let study = press();
    let plan = |names: &[&str]| guard::plan("log", &columns(names), &study, true);
    let told = plan(&["time_s", "command_m", "p_a [furlong]"]).err().unwrap().to_string();
    for part in ["unknown unit 'furlong'", "known: Pa, bar", "barg"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    // A pressure in parts of something is none in Pa.
    for (column, said) in [("p_a [%]", "'%' is no unit of 'p_a'"), ("p_a [-]", "'-'")] {
        let told = plan(&["time_s", "command_m", column]).err().unwrap().to_string();
        assert!(told.contains(said) && told.contains("Pa, bar"), "{column}: {told}");
    }
    let plan = plan(&["time_s", "command_m", "p_a_pa", "p_a [bar]", "p_b_pa"]).unwrap();
    let unmeasured: Vec<&str> = plan.map.unmeasured().collect();
    assert!(unmeasured.contains(&"p_a") && !unmeasured.contains(&"p_b"), "{unmeasured:?}");
    let doubt = r#"p_a may be "p_a_pa" or "p_a [bar]": a map file says which"#;
    assert!(plan.warnings.iter().any(|warning| warning == doubt), "{:?}", plan.warnings);
    // Words in brackets that are no unit, and units of pure numbers, are not refused.
    let names = ["Time (UTC)", "command [mm]", "p_a(1) [bar]", "p_b [bar]", "mode [on/off]"];
    let sound = guess(&columns(&names), &study, Trust::Certain);
    assert!(Map::parse(&sound.text, "map", &study.system).is_ok(), "{}", sound.text);
}

#[test]
fn columns_of_one_name_are_named_apart_and_none_is_taken() {
    let (study, folder) = (press(), Folder::new("guard-doubled"));
    let text = "time_s,command_m,p_a_pa,p_a_pa,p_b_pa\n0,0,1,2,3\n0.01,0,1,2,3\n";
    let log = folder.write("log.csv", text);
    let read = |map: Option<&str>| {
        let map = map.map(|text| Map::parse(text, "map.toml", &study.system).unwrap());
        intake::read(&log, map.as_ref(), LogSpan::default(), &study)
    };
    let whole = read(None).unwrap();
    assert!(whole.table.f64("p_a_pa").is_err() && whole.table.f64("p_b_pa").is_ok());
    let map = |column: &str| {
        format!(
            "format = 1\n[time]\ncolumn = \"time_s\"\n[sensors]\np_a = {{ column = \"{column}\" }}\n"
        )
    };
    let told = read(Some(&map("p_a_pa"))).unwrap_err().to_string();
    assert!(told.contains("no column 'p_a_pa'") && told.contains("'p_a_pa#"), "{told}");
    let second = read(Some(&map("p_a_pa#2"))).unwrap();
    assert_eq!(second.table.f64("p_a_pa").unwrap()[..], [2.0, 2.0]);
}

#[test]
fn rows_of_two_times_are_refused_unless_the_map_uses_one_of_them() {
    let (study, folder) = (press(), Folder::new("guard-rasters"));
    let mut text = "time_s,command_m,p_a_pa,time_2_s,p_b_pa\n".to_owned();
    for k in 0..300 {
        let _ = writeln!(text, "{},0,1e6,{},2e6", 0.01 * f64::from(k), 0.02 * f64::from(k));
    }
    let log = folder.write("log.csv", text);
    let told = intake::read(&log, None, LogSpan::default(), &study).unwrap_err();
    assert!(matches!(told, IntakeError::Refused { .. }), "{told}");
    for part in ["'time_s' and 'time_2_s'", "rasters of their own", "'p_b_pa'"] {
        assert!(told.to_string().contains(part), "{told}");
    }
    let map = |time: &str, sensor: &str| {
        let text = format!(
            "format = 1\n[time]\ncolumn = \"{time}\"\n[sensors]\n{sensor} = {{ column = \"{sensor}_pa\" }}\n"
        );
        let map = Map::parse(&text, "map.toml", &study.system).unwrap();
        intake::read(&log, Some(&map), LogSpan::default(), &study).map(|whole| whole.counts.samples)
    };
    // Nor is one whose clock runs two seconds behind, nor the second of a name that pandas numbers.
    let other = |name: &str, time_s: fn(f64) -> f64| {
        let mut text = format!("time_s,command_m,p_a_pa,{name},p_b_pa\n");
        for k in (0..300).map(f64::from) {
            let _ = writeln!(text, "{},0,1e6,{},2e6", 0.01 * k, time_s(0.01 * k));
        }
        intake::read(&folder.write("other.csv", text), None, LogSpan::default(), &study)
    };
    assert!(other("time_2_s", |time_s| time_s + 2.0).is_err());
    assert!(other("time_s.1", |time_s| 2.0 * time_s).is_err());
    assert!(other("utc_s", |time_s| time_s + 1.79e9).is_ok(), "the same times from another zero");
    assert_eq!(map("time_s", "p_a").unwrap(), 300);
    assert_eq!(map("time_2_s", "p_b").unwrap(), 300);
    assert!(map("time_s", "p_b").is_err());
}

/// A log of 800 rows with times as `time` writes them.
fn timed(folder: &Folder, time: impl Fn(u32) -> String) -> Result<Whole, IntakeError> {
    let mut text = "Time,command_m,p_a_pa\n".to_owned();
    for k in 0..800 {
        let wave = (0.05 * f64::from(k)).sin();
        let _ = writeln!(text, "{},{},{}", time(k), 1e-2 * wave, 7e6 + 1e5 * wave);
    }
    intake::read(&folder.write("timed.csv", text), None, LogSpan::default(), &press())
}

#[test]
fn what_a_time_means_is_decided_once_from_its_text() {
    let folder = Folder::new("guard-times");
    let begin = |time: &dyn Fn(u32) -> String| {
        let whole = timed(&folder, time).unwrap();
        let times_s = whole.table.f64("time_s").unwrap();
        assert_eq!((times_s.len(), whole.counts.met().count()), (800, 0), "{}", time(0));
        assert!((times_s[799] - times_s[0] - 7.99).abs() < 1e-5, "{}", time(0));
        times_s[0]
    };
    let clock = |k: u32, first: u32| {
        let hundredths = (first * 100 + k) % 8_640_000;
        let (hours, minutes) = (hundredths / 360_000, hundredths / 6000 % 60);
        format!("{hours:02}:{minutes:02}:{:05.2}", f64::from(hundredths % 6000) / 100.0)
    };
    assert_eq!(begin(&|k| clock(k, 86_396)), 86_396.0, "past midnight");
    assert_eq!(begin(&|k| format!("{:.2}", (86_396.0 + 0.01 * f64::from(k)) % 86_400.0)), 86_396.0);
    let date = 1_795_219_200.0;
    assert_eq!(begin(&|k| format!("2026-11-21 {} PM", clock(k, 10_800))), date + 54_000.0);
    assert_eq!(begin(&|k| format!("2026-11-21 {} UTC", clock(k, 54_000))), date + 54_000.0);
    let east = begin(&|k| format!("2026-11-21T{}+02:00", clock(k, 54_000)));
    assert_eq!(east, date + 54_000.0, "on the clock of the log");
    let excel = begin(&|k| format!("{:.10}", 46_347.625 + f64::from(k) / 8_640_000.0));
    assert!((excel - date - 54_000.0).abs() < 1e-4, "{excel}");
    assert_eq!(begin(&|k| format!("{:02}:{}", k / 6000 + 7, &clock(k, 0)[6..])), 420.0, "minutes");
    let basic = |k| format!("20261121T{}", clock(k, 54_000).replacen(':', "", 2));
    assert_eq!(begin(&basic), date + 54_000.0);
    let told = timed(&folder, |k| k.to_string()).unwrap_err().to_string();
    for part in ["'Time' counts rows or milliseconds", "rate_hz = 100 instead of column"] {
        assert!(told.contains(part), "{told}");
    }
    let told = timed(&folder, |k| format!("row {k}")).unwrap_err().to_string();
    assert!(
        told.contains("write times as numbers, 08:15:02.5") && !told.contains("unit"),
        "{told}"
    );
    let told = timed(&folder, |k| format!("11/21/2026 {}", clock(k, 54_000))).unwrap_err();
    let told = told.to_string();
    assert!(
        told.contains("(line 2: '11/21/2026 15:00:00.00': the order of day and month"),
        "{told}"
    );
}

#[test]
fn a_part_of_a_log_with_a_zone_is_named_on_its_clock() {
    let folder = Folder::new("guard-zone");
    let text: String = (0..800).fold("Time,command_m,p_a_pa\n".to_owned(), |text, k| {
        text + &format!("2026-11-21T15:00:{:05.2}+02:00,0,1e6\n", 0.01 * f64::from(k))
    });
    let (log, study) = (folder.write("zone.csv", text), press());
    let samples = |from: &str| {
        let span = LogSpan::parse(Some(from), None).unwrap();
        intake::read(&log, None, span, &study).map(|whole| whole.counts.samples)
    };
    for from in ["2026-11-21T15:00:05", "2026-11-21T15:00:05+02:00", "2026-11-21T13:00:05Z", "5"] {
        assert_eq!(samples(from).unwrap(), 300, "{from}");
    }
    let told = samples("2026-11-21T15:01:00").unwrap_err().to_string();
    assert!(told.contains("2026-11-21 15:00:07.990 UTC+02:00"), "{told}");
}

#[test]
fn rows_of_one_time_and_other_values_are_no_repetitions() {
    let folder = Folder::new("guard-coarse");
    let told = timed(&folder, |k| format!("{}", 10_000.0 + f64::from(k / 10) / 10.0));
    let told = told.unwrap_err().to_string();
    for part in ["720 lines", "too few digits", "rate_hz = 100 instead of column"] {
        assert!(told.contains(part), "{told}");
    }
    // Sent twice is still sent twice.
    let text: String = (0..400).fold("Time,command_m,p_a_pa\n".to_owned(), |text, k| {
        text + &format!("{},{k},1e6\n", 0.01 * f64::from(k)).repeat(2)
    });
    let log = folder.write("twice.csv", text);
    let whole = intake::read(&log, None, LogSpan::default(), &press()).unwrap();
    assert_eq!(whole.counts.met().next().unwrap().0.words().0, "doubled");
}

#[test]
fn files_of_other_writers_give_the_columns_and_rows_of_a_plain_one() {
    let (study, folder) = (press(), Folder::new("guard-writers"));
    let plain: String = (0..300).fold("time_s,command_m,p_a_pa\n".to_owned(), |text, k| {
        text + &format!("{},{},{}\n", 0.01 * f64::from(k), 1e-3 * f64::from(k % 7), 7e6)
    });
    let rows = |from: &str, to: &str| plain.replace(from, to);
    let objects: String = plain.lines().skip(1).fold("[\n".to_owned(), |text, line| {
        let cells: Vec<&str> = line.split(',').collect();
        text + &format!(
            "{{\"time_s\": {}, \"command_m\": {}, \"p_a_pa\": {}}},\n",
            cells[0], cells[1], cells[2]
        )
    });
    for (name, text) in [
        ("plain", plain.clone()),
        ("mark", format!("# recorded by a rig, on a day\n# {plain}")),
        ("mark without a blank", format!("#{plain}")),
        ("blanks", format!("# {}", rows(",", " "))),
        ("CR", rows("\n", "\r")),
        ("CR LF", rows("\n", "\r\n")),
        ("separators at the ends", rows("\n", ";;\n").replace(',', ";").replacen(";;", "", 1)),
        ("header with a separator at its end", plain.replacen('\n', ",\n", 1)),
        ("quoted", rows("\n", "\"\n\"").replace(',', "\", \"").replacen("time_s", "\"time_s", 1)),
        ("groups", rows(",", ";").replace(";7000000", ";7,000,000.0")),
        ("array", objects.trim_end().trim_end_matches(',').to_owned() + "]\n"),
        ("cut first line", format!("7,0.2,7e\n{plain}")),
        ("a line that a spreadsheet made as wide", format!("Logger,V1,\n{plain}")),
    ] {
        let log = folder.write("log.csv", text.trim_end_matches('"'));
        let whole = intake::read(&log, None, LogSpan::default(), &study)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(whole.counts.samples, 300, "{name}");
        assert_eq!(whole.table.f64("p_a_pa").unwrap()[299], 7e6, "{name}");
        assert_eq!(whole.table.f64("command_m").unwrap()[6], 6e-3, "{name}");
    }
    let told = |text: &str| {
        let log = folder.write("log.csv", text);
        intake::read(&log, None, LogSpan::default(), &study).unwrap_err().to_string()
    };
    let numbers = told("\n0.01,0.2,7e6\n0.02,0.2,7e6\n");
    assert!(
        numbers.contains("line 2 is '0.01,0.2,7e6'") && numbers.contains("[samples]"),
        "{numbers}"
    );
    let pretty = told("[\n  {\n    \"time_s\": 0\n  }\n]\n");
    assert!(pretty.contains("line 1 is '['; JSON needs one object a line"), "{pretty}");
    let recording = told("MDF     4.10    asammdf\0");
    assert!(recording.contains("a recording in MDF, which asammdf writes as CSV"), "{recording}");
}

#[test]
fn a_table_in_memory_is_a_log_like_its_file() {
    let (study, folder) = (press(), Folder::new("guard-table"));
    let table = healthy(&study);
    let path = folder.write("log.csv", csv(&table, |_, _, value| format!("{value:?}")));
    let plan = guard::plan("the table", &table_columns(&table), &study, true).unwrap();
    let mut rows = TableRows::of_table("the table", &table, plan.map.wanted()).unwrap();
    let mut lines = Address::File(path).open(plan.map.wanted()).unwrap();
    let read = |source: &mut dyn Source| {
        let mut row = servotwin_watch::source::LogRow::default();
        let mut found = vec![];
        loop {
            match source.read(&mut row).unwrap() {
                servotwin_watch::source::Read::Row => found.push(row.values.clone()),
                servotwin_watch::source::Read::End => return found,
                _ => {}
            }
        }
    };
    assert_eq!(read(&mut rows), read(&mut *lines));
    assert_eq!(tried_table(&study, &plan.map, &table, &table), Vec::<String>::new());
}

#[test]
fn a_second_time_is_one_only_with_a_raster_of_its_own() {
    let study = press();
    let column = |name: &str, value: &dyn Fn(f64) -> f64| {
        let head = (0..200).map(|k| value(f64::from(k))).collect();
        LogColumn { head, ..LogColumn::named(name) }
    };
    let refusal = |name: &str, time: &dyn Fn(f64) -> f64| {
        let columns = [
            column("time_s", &|k| 0.01 * k),
            column("command_m", &|_| 1.0),
            column(name, time),
            column("p_a_pa", &|_| 1.0),
        ];
        let plan = guard::plan("log", &columns, &study, true);
        plan.err().map(|error| error.to_string())
    };
    type Time = fn(f64) -> f64;
    let others: [(&str, Time); 4] = [
        ("time_2", |k| 0.02 * k),
        ("t2 [ms]", |k| 12.5 * k),
        ("time_s#2", |k| 0.01 * k + 0.004),
        ("fcc time", |k| 0.01 * k * 1.02),
    ];
    for (name, time) in others {
        let reason = refusal(name, &time).unwrap_or_else(|| panic!("{name}"));
        assert!(reason.contains("'time_s'") && reason.contains(name), "{reason}");
    }
    let same: [(&str, Time); 5] = [
        ("time [ms]", |k| 10.0 * k),
        ("Timestamp", |k| 1.7e9 + 0.01 * k),
        ("time_s#2", |k| 0.01 * k),
        ("t_oil_c", |k| 40.0 + 0.02 * k),
        ("travel", |k| 0.02 * k),
    ];
    for (name, time) in same {
        assert_eq!(refusal(name, &time), None, "{name}");
    }
}

#[test]
fn a_mistake_of_the_column_of_the_command_is_undone_by_the_twin() {
    let study = Study::default();
    let diagnoser = Arc::new(shipped::diagnoser(&study).unwrap());
    let command = "noise:rms=4deg,bandwidth=1Hz,limit=15deg,seed=7";
    let simulation = Simulation::new(&study.system).input("command", command).noise(3);
    let healthy = simulation.run().unwrap().table().unwrap();
    let tried = |table: &Table, unit: &str| {
        let columns = table_columns(table);
        let guess = guess(&columns, &study, Trust::Certain).text;
        let text = guess.replace(
            "command = { column = \"command_rad\", unit = \"rad\" }",
            &format!("command = {{ column = \"command_rad\", unit = \"{unit}\" }}"),
        );
        let map = Map::parse(&text, "map", &study.system).unwrap();
        let mut open = |map: &Map| -> Result<Opened, WatchError> {
            let rows = TableRows::of_table("log", table, map.wanted())?;
            let watcher = Watcher::new(&study, diagnoser.clone()).unwrap();
            Ok((Box::new(rows), Box::new(watcher)))
        };
        guard::trial(&mut open, &map, &study, 0.01).unwrap().contradictions.join("; ")
    };
    let changed = |change: &dyn Fn(&str) -> Vec<f64>| {
        let columns = healthy.columns().iter().map(|column| {
            Column::new(column.name.clone(), column.unit.clone(), change(&column.name))
        });
        Table::from_columns(columns.collect()).unwrap()
    };
    let of = |name: &str| healthy.f64(name).unwrap().into_owned();
    let scaled = |scaled: &str, factor: f64| {
        changed(&|name| match name == scaled {
            true => of(name).into_iter().map(|value| value * factor).collect(),
            false => of(name),
        })
    };
    assert_eq!(tried(&healthy, "rad"), "");
    let said = tried(&healthy, "deg");
    assert!(said.starts_with("command seems to be in rad, not degrees: the twin then"), "{said}");
    let said = tried(&scaled("command_rad", 1f64.to_degrees()), "rad");
    assert!(said.starts_with("command seems to be in degrees, not rad"), "{said}");
    // Nor does a minute at rest before it hide the mistake.
    let at_rest = 7000;
    let late = changed(&|name| {
        let (mut values, own) = (vec![], of(name));
        match name {
            "time_s" => values.extend((0..at_rest + own.len()).map(|k| 0.01 * k as f64)),
            name => {
                let begin = if name == "command_rad" { 0.0 } else { own[0] };
                values.resize(at_rest, begin);
                values.extend(own);
            }
        }
        values
    });
    assert_eq!(tried(&late, "rad"), "");
    assert!(tried(&late, "deg").starts_with("command seems to be in rad"));
    let exchanged = changed(&|name| match name {
        "command_rad" => of("x_p_1_m"),
        "x_p_1_m" => of("command_rad"),
        name => of(name),
    });
    let said = tried(&exchanged, "rad");
    assert!(said.starts_with("command and x_p_1 look exchanged"), "{said}");
    // A command that stands still, unless the map says that it does, or a fault moves the actuator.
    let still = changed(&|name| match name {
        "command_rad" => vec![0.0; healthy.row_count()],
        name => of(name),
    });
    let said = tried(&still, "rad");
    assert!(said.starts_with("command stands still while the sensors move"), "{said}");
    let runaway = Simulation::new(&study.system).input("command", "constant:value=2deg").noise(3);
    let runaway = runaway.fault_from("actuator_1.controller.bias_positive", 1.0, 2.0);
    assert_eq!(tried(&runaway.run().unwrap().table().unwrap(), "rad"), "");
    // Nor is the gain of a faulty sensor a mistake of the command.
    for gain in [0.5, 0.8, 1.2] {
        assert_eq!(tried(&scaled("x_p_1_m", gain), "rad"), "", "{gain}");
    }
}

#[test]
fn columns_that_are_exchanged_within_a_log_end_it_and_are_reported_by_a_stream() {
    let study = press();
    let command = "noise:rms=25mm,bandwidth=0.7Hz,limit=100mm,seed=5";
    let simulation = Simulation::new(&study.system).input("command", command).duration_s(24.0);
    let twin = simulation.noise(3).run().unwrap().table().unwrap();
    let map = guard::plan("log", &table_columns(&twin), &study, true).unwrap().map;
    let exchanged = |from: usize| {
        changed(&twin, |of, name, row| match (name, row >= from) {
            ("p_a_pa", true) => of("p_b_pa"),
            ("p_b_pa", true) => of("p_a_pa"),
            _ => of(name),
        })
    };
    let (end, found, reported) = watched(&study, (&map, &exchanged(900), &twin), false);
    let said = "from 10.00 s (row 1001) on, p_a and p_b look exchanged: each follows the twin of the other";
    assert_eq!((end, &found[..]), (End::Contradicted, &[said.to_owned()][..]));
    // Actions before do not count.
    let taken_back = |said: &str| format!("{said}; no finding and no action since then counts");
    assert_eq!(reported, [taken_back(said)]);
    // A stream goes on.
    let (end, found, reported) = watched(&study, (&map, &exchanged(900), &twin), true);
    assert_eq!((end, found, reported), (End::Complete, vec![said.into()], vec![taken_back(said)]));
    let (_, _, reported) = watched(&study, (&map, &exchanged(0), &twin), true);
    let said = "p_a and p_b look exchanged: each follows the twin of the other";
    assert_eq!(reported, [taken_back(said)]);
    let (end, found, reported) = watched(&study, (&map, &twin, &twin), false);
    assert_eq!((end, found.len(), reported.len()), (End::Complete, 0, 0));
    // A fit names no fault that is nearest to it.
    let record = FitRecord::from_table("log", &exchanged(900), &study.system).unwrap();
    let told = servotwin::fit::Fit::of_study(&study, vec![record]).check().unwrap_err();
    let said =
        "log: from 9.00 s on, p_a_pa and p_b_pa look exchanged: each follows the twin of the other";
    assert_eq!(told.to_string(), said);
    // An actuator that moves beside a resting twin may have a fault.
    let resting = changed(
        &twin,
        |of, name, row| if row < 900 { of(name) } else { twin.f64(name).unwrap()[900] },
    );
    let (end, found, reported) = watched(&study, (&map, &twin, &resting), false);
    assert_eq!((end, found.len(), reported.len()), (End::Complete, 0, 1));
    assert!(reported[0].contains("the actuator moves while the twin stands still"), "{reported:?}");
}

/// Watches a log of the aileron whose command stands still from a row on, with the shipped diagnosis.
fn with_frozen_command(command: &str, from: usize, is_live: bool) -> (End, Vec<String>) {
    let study = Study::default();
    let simulation = Simulation::new(&study.system).input("command", command).noise(3);
    let log = simulation.duration_s(40.0).run().unwrap().table().unwrap();
    let map = guard::plan("log", &table_columns(&log), &study, true).unwrap().map;
    let frozen = changed(&log, |of, name, row| match name {
        "command_rad" if row >= from => log.f64(name).unwrap()[from],
        name => of(name),
    });
    let rows = TableRows::of_table("log", &frozen, map.wanted()).unwrap();
    let mut source: Box<dyn Source> = if is_live { Box::new(Live(rows)) } else { Box::new(rows) };
    let diagnoser = Arc::new(shipped::diagnoser(&study).unwrap());
    let (mut observer, mut reported) =
        (Watcher::new(&study, diagnoser).unwrap(), Reported::default());
    let mut watch = Watch::new(&mut *source, &map, &mut observer, 0.01);
    watch.expect(&study, &[]);
    watch.sink(&mut reported);
    let end = watch.run(&AtomicBool::new(false), &mut |_, _| ()).unwrap();
    drop(watch);
    (end, reported.0)
}

#[test]
fn a_command_that_freezes_while_the_actuator_moves_on_is_no_column_of_the_command() {
    let steps = "step:size=6deg,at=1s + step:size=-12deg,at=7s + step:size=10deg,at=12s + step:size=-9deg,at=17s \
                 + step:size=12deg,at=22s + step:size=-9deg,at=27s + step:size=9deg,at=32s";
    for (command, from, is_live) in [
        ("noise:rms=4deg,bandwidth=1Hz,limit=15deg,seed=7", 600, false),
        ("sine:amplitude=8deg,frequency=0.2Hz", 600, true),
        (steps, 600, false),
        (steps, 0, false),
    ] {
        let (end, reported) = with_frozen_command(command, from, is_live);
        let ends = if is_live { End::Complete } else { End::Contradicted };
        let last = reported.last().unwrap();
        assert_eq!(end, ends, "{command}: {reported:?}");
        let begin = format!("from {:.2} s", 0.01 * from as f64);
        assert!(last.starts_with(&begin), "{last}");
        assert!(last.contains("command stands still while the sensors move"), "{last}");
        assert!(last.ends_with("no finding and no action since then counts"), "{last}");
    }
}

const INTENSITIES: [f64; 7] = [0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0];

/// What the trial says of each fault of a study's system, at several intensities, and the watch of one that begins in
/// flight.
fn contradicted_by_faults(study: &Study, command: &str) -> Vec<String> {
    let short = Simulation::new(&study.system).input("command", command).noise(3);
    let long = short.clone().duration_s(14.0);
    let [twin, long_twin] = [&short, &long].map(|healthy| healthy.run().unwrap().table().unwrap());
    let map = guard::plan("twin", &table_columns(&twin), study, true).unwrap().map;
    let mut found = vec![];
    for fault in study.system.fault_list() {
        let mut add = |said: Vec<String>| {
            found.extend(said.iter().map(|text| format!("{}: {text}", fault.id)));
        };
        // A fault may end a simulation.
        if let Ok(runs) = short.run_sweep(&fault.id, &INTENSITIES) {
            let tables = (0..INTENSITIES.len()).filter_map(|run| runs.table_of_run(run).ok());
            tables.for_each(|table| add(tried_table(study, &map, &table, &twin)));
        }
        if let Ok(late) = long.clone().fault_from(&fault.id, 1.0, 4.0).run() {
            add(watched(study, (&map, &late.table().unwrap(), &long_twin), false).1);
        }
    }
    found
}

#[test]
#[ignore = "slow: ./check --all"]
fn no_fault_of_a_shipped_study_is_taken_for_a_mistake_of_columns() {
    let none: [String; 0] = [];
    for command in ["noise:rms=25mm,bandwidth=0.7Hz,limit=100mm,seed=5", "constant:value=20mm"] {
        assert_eq!(contradicted_by_faults(&press(), command), none, "{command}");
    }
    for study in [Study::default(), Study::read("../../studies/spring_actuator.toml").unwrap()] {
        for command in [
            "noise:rms=4deg,bandwidth=1Hz,seed=7",
            "step:size=5deg",
            "sine:amplitude=5deg,frequency=0.5Hz",
        ] {
            assert_eq!(contradicted_by_faults(&study, command), none, "{command}");
        }
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn no_fault_that_moves_an_actuator_in_gusts_is_taken_for_a_frozen_command() {
    let study = Study::default();
    let simulation = Simulation::new(&study.system).input("command", "constant:value=8deg");
    let simulation =
        simulation.input("load_factor", "150% + noise:rms=50%,bandwidth=0.4Hz,limit=140%,seed=3");
    let simulation = simulation.noise(3).duration_s(24.0);
    let twin = simulation.run().unwrap().table().unwrap();
    let map = guard::plan("twin", &table_columns(&twin), &study, true).unwrap().map;
    for fault in study.system.fault_list() {
        if let Ok(late) = simulation.clone().fault_from(&fault.id, 1.0, 4.0).run() {
            let (_, found, _) = watched(&study, (&map, &late.table().unwrap(), &twin), false);
            assert_eq!(found, [] as [String; 0], "{}", fault.id);
        }
    }
}
