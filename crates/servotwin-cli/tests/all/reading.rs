//! One intake of logs: what `watch` reads, `fit` and `history` read too, and times of dated logs are dates.

use super::flights::learned;
use super::{Folder, SPRING, json, met, servotwin, stderr, stdout, watch};
use servotwin::table::Table;
use std::fmt::Write;

const STUDY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../studies/spring_actuator.toml");

/// A flight of the aileron at 50 Hz, as rows of cells below their names.
fn flight(folder: &Folder) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(watch::flight(folder)).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

/// The counts at the end of a watch, and the events before.
fn watched(log: &str, more: &[&str]) -> (serde_json::Value, Vec<serde_json::Value>) {
    let output = servotwin(&[&["watch", log, "--json"], more].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    let mut lines: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    (lines.pop().unwrap().clone(), lines)
}

/// A column of a record, its name and unit in the log of a rig, and one of that unit in SI.
type RigColumn = (&'static str, &'static str, &'static str, f64);

/// A record of the spring actuator as a rig writes it: Windows-1252, three lines of header, decimal commas; and its map.
fn rig(folder: &Folder, log: &str) -> [String; 2] {
    let table = Table::read(log).unwrap();
    let columns: [RigColumn; 7] = [
        ("time_s", "Zeit", "s", 1.0),
        ("command_rad", "Sollwinkel", "\u{b0}", std::f64::consts::PI / 180.0),
        ("p_a_pa", "PA", "bar", 1e5),
        ("p_b_pa", "PB", "bar", 1e5),
        ("x_p_m", "XP", "mm", 1e-3),
        ("x_v_m", "XV", "mm", 1e-3),
        ("p_s_pa", "PS", "bar", 1e5),
    ];
    let join = |of: &dyn Fn(&RigColumn) -> String| -> String {
        columns.iter().map(of).collect::<Vec<_>>().join(";") + "\n"
    };
    let mut text = "sep=;\n".to_owned();
    text += &join(&|column| column.1.into());
    text += &join(&|column| column.2.into());
    text += &join(&|_| "Kanal".into());
    for row in 0..table.row_count() {
        let cell = |(name, _, _, size): &RigColumn| {
            format!("{:.6}", table.f64(name).unwrap()[row] / size).replace('.', ",")
        };
        text += &join(&cell);
    }
    // Every character is one byte.
    let bytes: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let [csv, map] = ["rig.csv", "rig.toml"].map(|name| folder.file(name));
    std::fs::write(&csv, bytes).unwrap();
    let mut lines = "format = 1\n[time]\ncolumn = \"Zeit\"\nunit = \"s\"\n[inputs]\n".to_owned();
    for (name, column, unit, _) in &columns[1..] {
        let id = name.rsplit_once('_').unwrap().0;
        let head = if id == "p_a" { "[sensors]\n" } else { "" };
        let _ = writeln!(lines, "{head}{id} = {{ column = \"{column}\", unit = \"{unit}\" }}");
    }
    std::fs::write(&map, lines).unwrap();
    [csv, map]
}

#[test]
fn fit_and_history_read_a_rig_log_with_the_map_of_watch_and_any_part_of_it() {
    let folder = Folder::new("reading-rig");
    let log = folder.file("log.csv");
    let command = ["--command", "noise:rms=4deg,bandwidth=1Hz,seed=5", "--duration", "12s"];
    let output = servotwin(&[&["simulate", SPRING], &command[..], &["--out", &log, "-q"]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let [rig, map] = rig(&folder, &log);
    let fitted = |arguments: &[&str]| -> Vec<(f64, f64)> {
        let result = json(&[&["fit"], arguments, &["--study", STUDY, "--json", "-q"]].concat());
        let of = |one: &serde_json::Value| {
            (one["value"].as_f64().unwrap(), one["standard_error"].as_f64().unwrap())
        };
        result["parameters"].as_array().unwrap().iter().map(of).collect()
    };
    let (own, mapped) = (fitted(&[&log]), fitted(&[&rig, "--map", &map]));
    let far = own.iter().zip(&mapped).map(|(own, mapped)| (own.0 - mapped.0).abs() / own.1);
    assert!(far.fold(0.0, f64::max) < 0.01, "{own:?} {mapped:?}");
    let output =
        servotwin(&["fit", &rig, "--map", &map, "--study", STUDY, "--from", "2", "--to", "10"]);
    assert!(output.status.success() && stdout(&output).contains(" 8 s "), "{output:?}");
    let told = stderr(&output);
    for part in ["became 801 samples", "before the names of the columns: dropped (1, first line 1)"]
    {
        assert!(told.contains(part), "{told}");
    }
    assert!(told.contains("no time: dropped (2, first line 3: 's')"), "{told}");
    let logs = folder.file("logs");
    std::fs::create_dir_all(&logs).unwrap();
    std::fs::copy(&rig, format!("{logs}/1.csv")).unwrap();
    let history = json(&["history", &logs, "--map", &map, "--study", STUDY, "--json", "-q"]);
    assert_eq!(history["flights"][0]["is_healthy"], true, "{history}");
    let none = servotwin(&["fit", &rig, "--map", &map, "--study", STUDY, "--from", "20"]);
    assert_eq!(none.status.code(), Some(3));
    assert!(stderr(&none).contains("it reaches from 0.00 s to 12.00 s"), "{}", stderr(&none));
    let wrong = servotwin(&["fit", &rig, "--map", &map, "--study", STUDY, "--to", "noon"]);
    assert_eq!(wrong.status.code(), Some(2), "{}", stderr(&wrong));
}

#[test]
fn times_of_a_dated_log_are_dates_and_a_clock_set_back_is_counted_once() {
    let folder = Folder::new("reading-dates");
    let rows = flight(&folder);
    let [study, model] = learned(&folder);
    let html = folder.file("dated.html");
    let with = ["--study", &study, "--model", &model];
    // An hour set back after four seconds.
    let date = |row: usize| match row {
        0..=200 => format!("2025-10-26 02:59:{:06.3}", 56.0 + 0.02 * (row - 1) as f64),
        _ => format!("2025-10-26 02:00:{:06.3}", 0.02 * (row - 201) as f64),
    };
    let mut text = String::new();
    for (row, cells) in rows.iter().enumerate() {
        let time = if row == 0 { "time".to_owned() } else { date(row) };
        let _ = writeln!(text, "{time},{}", cells[1..].join(","));
    }
    let log = folder.file("dated.csv");
    std::fs::write(&log, text).unwrap();
    let (summary, events) = watched(&log, &[&with[..], &["--html", &html]].concat());
    assert_eq!(summary["samples"], 401, "{summary}");
    let back = met(&summary, "clock_back");
    assert_eq!(back["count"], 1, "{summary}");
    let first = "line 202: from 2025-10-26 02:59:59.980 to 2025-10-26 02:00:00.000";
    assert_eq!(back["first"], first);
    assert!(met(&summary, "gap").is_null(), "{summary}");
    for event in &events {
        assert!(event["date"].as_str().unwrap().starts_with("2025-10-26 02:"), "{event}");
        assert!(event["time_s"].as_f64().unwrap() > 1.7e9, "{event}");
    }
    let page = std::fs::read_to_string(&html).unwrap();
    assert!(page.contains("from 2025-10-26 02:59:56.000 to 2025-10-26 02:00:04.000"));
    // A part of it, by dates.
    let part = ["--from", "2025-10-26 02:00", "--to", "2025-10-26 02:00:02"];
    let (summary, _) = watched(&log, &[&with[..], &part].concat());
    assert_eq!(summary["samples"], 101, "{summary}");
    let live = servotwin(&[&["watch", "-", "--map", &log, "--from", "1"], &with[..]].concat());
    assert!(!live.status.success());
}

#[test]
fn a_stale_sample_of_text_begins_a_segment_and_decides_nothing() {
    let folder = Folder::new("reading-stale");
    let rows = flight(&folder);
    let [study, model] = learned(&folder);
    let mut text = String::new();
    let mut object = |time_ms: u64, cells: &[String]| {
        let pairs = rows[0].iter().zip(cells).skip(1);
        let pairs: Vec<String> =
            pairs.map(|(name, cell)| format!("\"{name}\": \"{cell}\"")).collect();
        let _ = writeln!(text, "{{\"ts\": \"{time_ms}\", {}}}", pairs.join(", "));
    };
    object(1_759_967_600_000, &rows[300]);
    for (row, cells) in rows[1..].iter().enumerate() {
        object(1_760_000_000_000 + 20 * row as u64, cells);
    }
    let (log, map) = (folder.file("text.jsonl"), folder.file("text.toml"));
    std::fs::write(&log, text).unwrap();
    let made = json(&["watch", &log, "--make-map", &map, "--json"]);
    assert_eq!(
        (&made["time"], &made["verdict"]["sensors_found"]),
        (&true.into(), &13.into()),
        "{made}"
    );
    let map_text = std::fs::read_to_string(&map).unwrap();
    assert!(map_text.contains("column = \"ts\"\nunit = \"ms\""), "{map_text}");
    let (summary, events) = watched(&log, &["--map", &map, "--study", &study, "--model", &model]);
    assert_eq!(summary["samples"], 402, "one sample, and behind it the log: {summary}");
    assert_eq!(summary["met"].as_array().unwrap().len(), 1, "{summary}");
    assert_eq!(met(&summary, "clock_forward")["count"], 1, "{summary}");
    let later = |event: &serde_json::Value| event["time_s"].as_f64().unwrap() > 1_760_000_000.0;
    assert!(events.iter().all(later), "{events:?}");
}
