//! `servotwin fit`: from a log to a system file, and logs that are refused.

use super::{Folder, SPRING, json, servotwin, stderr, stdout};
use servotwin::table::{Column, Table};

const STUDY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../studies/spring_actuator.toml");

/// A record of a spring actuator whose friction is 8 % higher.
fn log(folder: &Folder, more: &[&str]) -> String {
    let text = std::fs::read_to_string(SPRING).unwrap();
    let changed =
        text.replace("kind = \"cylinder\"", "kind = \"cylinder\"\ncoulomb_friction_n = 540");
    assert_ne!(text, changed);
    let (plant, log) = (folder.file("plant.toml"), folder.file("log.csv"));
    std::fs::write(&plant, changed).unwrap();
    let first = ["simulate", &plant, "--command", "noise:rms=4deg,bandwidth=1Hz,seed=5"];
    let rest = ["--duration", "15s", "--out", &log, "-q"];
    let output = servotwin(&[&first, more, &rest].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    log
}

#[test]
fn a_log_gives_a_system_file_with_its_parameters() {
    let folder = Folder::new("fit");
    let log = log(&folder, &[]);
    let fitted = folder.file("fitted.toml");
    let result = json(&["fit", &log, "--study", STUDY, "--out", &fitted, "--json"]);
    assert_eq!(result["verdict"]["is_update"], true, "{result}");
    let friction = &result["parameters"][1];
    assert_eq!(friction["name"], "cylinder.coulomb_friction_n");
    let (value, error) =
        (friction["value"].as_f64().unwrap(), friction["standard_error"].as_f64().unwrap());
    assert!((value - 540.0).abs() < 2.0 * error && error < 20.0, "{value} ± {error}");
    assert!(stdout(&servotwin(&["check", &fitted])).contains("no mistakes"));
    // The fitted file is a system: fitted again, nothing changes.
    let again = json(&[
        "fit",
        &log,
        &fitted,
        "--study",
        STUDY,
        "--json",
        "--parameters",
        "null_bias,coulomb_friction_n",
    ]);
    let second = again["parameters"][1]["value"].as_f64().unwrap();
    assert!((second - value).abs() < 0.5 * error, "{second} {value}");
    let text = stdout(&servotwin(&["fit", &log, "--study", STUDY, "-q"]));
    assert_eq!(text, "");
    let people = stdout(&servotwin(&["fit", &log, "--study", STUDY]));
    assert!(people.contains("well known from the record"), "{people}");
}

/// The same log with dates for times: as CSV, as Parquet and as lines of JSON objects.
fn dated(folder: &Folder, log: &str) -> [String; 3] {
    let table = Table::read(log).unwrap();
    let date = |s: &f64| format!("2026-11-22T10:00:{s:09.6}Z");
    let dates: Vec<String> = table.f64("time_s").unwrap().iter().map(date).collect();
    let columns = table.columns().iter().map(|column| match &*column.name {
        "time_s" => Column::new("time", "", dates.clone()),
        _ => column.clone(),
    });
    let table = Table::from_columns(columns.collect()).unwrap();
    let [csv, parquet, lines] =
        ["dated.csv", "dated.parquet", "dated.jsonl"].map(|name| folder.file(name));
    table.write(&csv).unwrap();
    table.write(&parquet).unwrap();
    let object = |row: usize| {
        let value = |column: &Column| match column.numbers() {
            Ok(numbers) => serde_json::json!(numbers[row]),
            Err(_) => serde_json::json!(dates[row]),
        };
        let pairs = table.columns().iter().map(|column| (column.name.clone(), value(column)));
        serde_json::Value::Object(pairs.collect()).to_string() + "\n"
    };
    std::fs::write(&lines, (0..table.row_count()).map(object).collect::<String>()).unwrap();
    [csv, parquet, lines]
}

#[test]
fn dates_are_times_in_every_kind_of_log() {
    let folder = Folder::new("fit-dates");
    let log = log(&folder, &[]);
    let fitted =
        |log: &str| json(&["fit", log, "--study", STUDY, "--json", "-q"])["parameters"].clone();
    let expected = fitted(&log);
    assert!(expected[1]["value"].as_f64().unwrap() > 500.0, "{expected:?}");
    for dated in dated(&folder, &log) {
        assert_eq!(fitted(&dated), expected, "{dated}");
    }
}

/// The same log as another logger keeps it: milliseconds, names and units of its own; and the map that says which are which.
fn foreign(folder: &Folder, log: &str) -> [String; 2] {
    let table = Table::read(log).unwrap();
    let mut map = "format = 1\n[time]\ncolumn = \"clock\"\nunit = \"ms\"\n".to_string();
    let mut sensors = "[sensors]\n".to_string();
    let mut column = |(place, column): (usize, &Column)| {
        let endings = [
            ("_pa", "bar", 1e5),
            ("_m", "mm", 1e-3),
            ("_rad", "deg", std::f64::consts::PI / 180.0),
            ("_s", "ms", 1e-3),
        ];
        let known = endings.into_iter().find(|(ending, ..)| column.name.ends_with(ending));
        let (ending, unit, size) = known.expect("a unit");
        let shown = column.numbers().unwrap().iter().map(|value| value / size).collect::<Vec<_>>();
        let name = if place == 0 { "clock".to_string() } else { format!("channel {place}") };
        let id = column.name.strip_suffix(ending).unwrap();
        let line = format!("{id} = {{ column = \"{name}\", unit = \"{unit}\" }}\n");
        match id {
            "time" => {}
            "command" => map += &format!("[inputs]\n{line}"),
            _ => sensors += &line,
        }
        Column::new(name, "", shown)
    };
    let columns = table.columns().iter().enumerate().map(&mut column).collect();
    let [csv, toml] = ["foreign.csv", "map.toml"].map(|name| folder.file(name));
    Table::from_columns(columns).unwrap().write(&csv).unwrap();
    std::fs::write(&toml, map + &sensors).unwrap();
    [csv, toml]
}

#[test]
fn a_map_says_what_the_columns_of_a_record_are() {
    let folder = Folder::new("fit-map");
    let log = log(&folder, &[]);
    let [foreign, map] = foreign(&folder, &log);
    let values = |arguments: &[&str]| -> Vec<f64> {
        let result = json(&[&["fit"], arguments, &["--study", STUDY, "--json", "-q"]].concat());
        let parameters = result["parameters"].as_array().unwrap().clone();
        parameters.iter().map(|parameter| parameter["value"].as_f64().unwrap()).collect()
    };
    let (own, mapped) = (values(&[&log]), values(&[&foreign, "--map", &map]));
    // Numbers of another unit are rounded otherwise.
    let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-6 * a.abs().max(1e-9);
    assert!(!own.is_empty() && own.iter().zip(&mapped).all(close), "{own:?} {mapped:?}");
    let unmapped = servotwin(&["fit", &foreign, "--study", STUDY]);
    assert_eq!(unmapped.status.code(), Some(3), "{}", stderr(&unmapped));
    let other = servotwin(&["fit", &log, "--map", &map, "--study", STUDY]);
    let told = stderr(&other);
    assert_eq!(other.status.code(), Some(3), "{told}");
    assert!(told.contains("map.toml:3:10") && told.contains("'clock'"), "{told}");
    // In a history a log that the map does not fit is told and left out; here it is the only one.
    let logs = folder.file("logs");
    std::fs::create_dir_all(&logs).unwrap();
    std::fs::copy(&log, format!("{logs}/1.csv")).unwrap();
    let none = servotwin(&["history", &logs, "--map", &map, "--study", STUDY]);
    let told = stderr(&none);
    assert_eq!(none.status.code(), Some(3), "{told}");
    assert!(told.contains("none of its logs can be used") && told.contains("'clock'"), "{told}");
    std::fs::copy(&foreign, format!("{logs}/1.csv")).unwrap();
    let one = servotwin(&["history", &logs, "--map", &map, "--study", STUDY]);
    assert!(one.status.success(), "{}", stderr(&one));
}

#[test]
fn what_a_log_lacks_and_what_no_sensor_shows_is_told() {
    let folder = Folder::new("fit-spike");
    let log = log(&folder, &["--record", "command,p_a,x_p"]);
    let mut lines: Vec<String> =
        std::fs::read_to_string(&log).unwrap().lines().map(str::to_owned).collect();
    let mut cells: Vec<&str> = lines[700].split(',').collect();
    cells[3] = "-1";
    lines[700] = cells.join(",");
    std::fs::write(&log, lines.join("\n")).unwrap();
    let output = servotwin(&["fit", &log, "--study", STUDY]);
    let told = stderr(&output);
    assert!(output.status.success(), "{told}");
    assert!(told.contains("has no column for the sensors p_b_pa, x_v_m, p_s_pa"), "{told}");
    assert!(told.contains("x_p_m has -1 m (line 701), which its sensor cannot show"), "{told}");
    let result = json(&["fit", &log, SPRING, "--study", "spring_actuator", "--json", "-q"]);
    assert_eq!(result["left_out"][0]["count"], 1);
    assert_eq!(result["verdict"]["is_update"], true);
}

#[test]
fn a_fault_is_no_update_and_its_intensity_is_found() {
    let folder = Folder::new("fit-fault");
    let log = log(&folder, &["--fault", "leakage_a.leakage=0.4"]);
    let fitted = folder.file("fitted.toml");
    let output = servotwin(&["fit", &log, "--study", STUDY, "--out", &fitted]);
    assert_eq!(output.status.code(), Some(1));
    let message = stdout(&output);
    assert!(message.contains("no update") && message.contains("leakage_a.leakage"), "{message}");
    assert!(!std::path::Path::new(&fitted).exists());
    let found = json(&[
        "fit",
        &log,
        "--study",
        STUDY,
        "--json",
        "--faults",
        "leakage_b.leakage,leakage_a.leakage",
    ]);
    assert_eq!(found["faults"][0]["fault"], "leakage_a.leakage");
    assert!((found["faults"][0]["intensity"].as_f64().unwrap() - 0.4).abs() < 0.02, "{found}");
}

#[test]
fn wrong_logs_and_names_are_told() {
    let folder = Folder::new("fit-wrong");
    let log = log(&folder, &[]);
    let text = std::fs::read_to_string(&log).unwrap();
    let short = folder.file("short.csv");
    std::fs::write(&short, text.lines().take(100).collect::<Vec<_>>().join("\n")).unwrap();
    let timeless = folder.file("timeless.csv");
    std::fs::write(&timeless, text.replace("time_s", "row")).unwrap();
    let cases: &[(&[&str], i32, &str)] = &[
        (&["fit", "/nowhere.csv"], 3, "/nowhere.csv"),
        (&["fit", &short, "--study", STUDY], 3, "short.csv: the record is too short"),
        (&["fit", &timeless, "--study", STUDY], 3, "no column 'time_s'"),
        (&["fit", &log, "press_axis"], 3, "'press_axis' does not belong: give --study press_axis"),
        (&["fit", &log, "--study", STUDY, "--parameters", "nul_bias"], 2, "nul_bias"),
        (&["fit", &log, "--study", STUDY, "--parameters", "null_bias,null_bias"], 2, "given twice"),
        (&["fit", &log, "--study", STUDY, "--faults", "leak"], 2, "no fault 'leak'"),
    ];
    for (arguments, code, message) in cases {
        let output = servotwin(arguments);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(*code), "{arguments:?}: {text}");
        assert!(text.contains(message), "{arguments:?}: {text}");
    }
}

/// What is said of a press axis that moves for 20 s, with a fault and with the numbers of some column changed.
fn said_of_press(
    folder: &Folder,
    fault: &[&str],
    changed: &dyn Fn(usize, &[f64]) -> Vec<f64>,
) -> String {
    let log = folder.file("press.csv");
    let first =
        ["simulate", "press_axis", "--noise", "4", "--duration", "20s", "--out", &log, "-q"];
    let command = ["--command", "noise:rms=25mm,bandwidth=0.7Hz,limit=100mm,seed=5"];
    let output = servotwin(&[&first[..], &command, fault].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let table = Table::read(&log).unwrap();
    let columns = table.columns().iter().enumerate().map(|(place, column)| {
        Column::new(column.name.clone(), "", changed(place, &column.numbers().unwrap()))
    });
    Table::from_columns(columns.collect()).unwrap().write(&log).unwrap();
    let output = servotwin(&["fit", &log, "--study", "press_axis"]);
    stdout(&output) + &stderr(&output)
}

#[test]
#[ignore = "slow: ./check --all"]
fn signs_shifts_and_faults_that_look_late_are_told_apart() {
    let folder = Folder::new("fit-late");
    const COMMAND: usize = 1;
    const STROKE: usize = 4;
    let turned = said_of_press(&folder, &[], &|place, v| {
        v.iter().map(|v| if place == STROKE { -v } else { *v }).collect()
    });
    assert!(turned.contains("x_p_m moves against the twin"), "{turned}");
    let shifted = said_of_press(&folder, &[], &|place, v| {
        let by = if place == COMMAND { 6 } else { 0 };
        (0..v.len()).map(|k| v[(k + by).min(v.len() - 1)]).collect()
    });
    assert!(shifted.contains("the sensors come 0.06 s too late"), "{shifted}");
    let drifting = said_of_press(&folder, &[], &|place, v| {
        let by = |k: usize| if place == COMMAND { k / 100 } else { 0 };
        (0..v.len()).map(|k| v[(k + by(k)).min(v.len() - 1)]).collect()
    });
    assert!(drifting.contains("clocks of inputs and sensors do not agree"), "{drifting}");
    let slow = ["--fault", "valve.gain_low=0.5"];
    let faulty = said_of_press(&folder, &slow, &|_, v| v.to_vec());
    assert!(faulty.contains("it looks like valve.gain_low of intensity 0.5"), "{faulty}");
}

/// Eight flights with a leak that grows by 0.05 in each, and a file that is no log.
fn flights(folder: &Folder) -> String {
    let logs = leaking(folder, &[0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4]);
    std::fs::write(format!("{logs}/flight_9.csv"), "a,b\n1,2\n").unwrap();
    logs
}

/// Flights from the first on, each with a leak.
fn leaking(folder: &Folder, leaks: &[f64]) -> String {
    let logs = folder.file("logs");
    std::fs::create_dir_all(&logs).unwrap();
    for (flight, leak) in (1..).zip(leaks) {
        let command = format!("noise:rms=4deg,bandwidth=1Hz,seed={flight}");
        let fault = format!("leakage_a.leakage={leak}");
        let out = format!("{logs}/flight_{flight}.csv");
        let first = ["simulate", SPRING, "--command", &command, "--fault", &fault];
        let output = servotwin(&[&first[..], &["--duration", "8s", "--out", &out, "-q"]].concat());
        assert!(output.status.success(), "{}", stderr(&output));
    }
    logs
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_history_tells_when_a_threshold_is_reached() {
    let folder = Folder::new("history");
    let logs = flights(&folder);
    let table = folder.file("history.csv");
    let start = ["history", &logs, "--study", STUDY];
    let output = servotwin(&[&start[..], &["--out", &table]].concat());
    assert_eq!(output.status.code(), Some(1));
    let text = stdout(&output);
    assert!(text.contains("leakage_a.leakage may reach 0.5 in"), "{text}");
    assert!(text.contains("flight_9.csv") && text.contains("reaches 0.5 in 2 flights"), "{text}");
    let rows = std::fs::read_to_string(&table).unwrap();
    assert_eq!(rows.lines().count(), 10);
    assert!(rows.contains("intensity:leakage_a.leakage"), "{rows}");
    // An alarm that is not wanted yet, of a fault that is named.
    let named = ["--faults", "leakage_a.leakage", "--within", "1", "--json"];
    let result = json(&[&start[..], &named].concat());
    assert_eq!(result["alarms"].as_array().unwrap().len(), 0);
    assert_eq!(result["flights"][8]["is_usable"], false);
    let trend = &result["tracks"][0];
    let left = trend["flights_to_threshold"].as_f64().unwrap();
    assert!((left - 2.0).abs() < 0.2, "{left}");
    let rate = trend["rate_per_flight"].as_f64().unwrap();
    assert!((rate - 0.05).abs() < 0.003, "{rate}");
}

#[test]
fn a_history_needs_logs_and_a_design_keeps_limits() {
    let folder = Folder::new("history-none");
    let none = folder.file("none");
    std::fs::create_dir_all(&none).unwrap();
    let output = servotwin(&["history", &none, "--study", STUDY]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let output = servotwin(&["history", &none, "--study", STUDY, "--threshold", "2"]);
    assert!(stderr(&output).contains("--threshold 2 is out of range"), "{}", stderr(&output));
    let design = ["fit", "--design", "--study", STUDY, "--duration", "10s", "--amplitude", "5deg"];
    let found = json(&[&design[..], &["--rate", "20deg/s", "--json"]].concat());
    let best = &found["commands"][0];
    assert!(best["amplitude_rad"].as_f64().unwrap() <= 5.001_f64.to_radians(), "{best}");
    assert!(best["rate"].as_f64().unwrap() <= 20.01_f64.to_radians(), "{best}");
    assert!(best["gain_bits"].as_f64().unwrap() > 1.0, "{best}");
    let people = stdout(&servotwin(&[&design[..], &["--rate", "20deg/s"]].concat()));
    assert!(people.contains("from the flight") && !people.contains("record"), "{people}");
    let output = servotwin(&[&design[..], &["--rate", "20s"]].concat());
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    // Limits are of a design, and a fit needs a log.
    assert_eq!(servotwin(&["fit", "--study", STUDY]).status.code(), Some(2));
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_repair_begins_a_new_trend_and_is_reported_with_its_flight() {
    let folder = Folder::new("history-repair");
    let logs = leaking(&folder, &[0.1, 0.2, 0.3, 0.4, 0.0, 0.03, 0.06, 0.09]);
    let history = ["history", &logs, "--study", STUDY, "--faults", "leakage_a.leakage"];
    let text = stdout(&servotwin(&[&history[..], &["--within", "1"]].concat()));
    let said =
        "leakage_a.leakage: repaired before flight 4 (flight_5.csv): the intensity falls by 0.4";
    assert!(text.contains(said), "{text}");
    let found = json(&[&history[..], &["--within", "1", "--json"]].concat());
    let track = &found["tracks"][0];
    assert_eq!(found["repairs"][0]["log"], "flight_5.csv");
    assert_eq!(found["repairs"][0]["is_confirmed"], true);
    // 0.5 is (0.5 − 0.09)/0.03 flights away.
    let end = |place: usize| track[["earliest_flights", "latest_flights"][place]].as_f64();
    let truth = 0.41 / 0.03;
    assert!(end(0).unwrap() <= truth && end(1).is_none_or(|latest| truth <= latest), "{track}");
    let expected = track["flights_to_threshold"].as_f64().unwrap();
    assert!((expected - truth).abs() < 1.0, "{expected}");
}

#[cfg(unix)]
#[test]
fn what_is_no_regular_file_is_skipped_and_named_and_the_other_logs_are_judged() {
    let folder = Folder::new("history-pipe");
    let logs = leaking(&folder, &[0.0, 0.0]);
    let made = std::process::Command::new("mkfifo").arg(format!("{logs}/a_pipe.csv")).status();
    assert!(made.unwrap().success());
    std::os::unix::fs::symlink("/nowhere/log.csv", format!("{logs}/broken.csv")).unwrap();
    let good = format!("{logs}/flight_1.csv");
    std::os::unix::fs::symlink(good, format!("{logs}/linked.csv")).unwrap();
    let output = servotwin(&["history", &logs, "--study", STUDY]);
    assert_eq!(output.status.code(), Some(0));
    let note = "note: skipped 2 entries that are no regular files: a_pipe.csv (named pipe), broken.csv (broken link)";
    assert!(stderr(&output).contains(note), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("flight_2.csv") && text.contains("linked.csv"), "{text}");
    assert!(!text.contains("pipe"), "{text}");
}

/// What `fit` writes to standard output of a record of the spring actuator with a fault.
fn fitted(folder: &Folder, fault: &[&str], duration: &str, more: &[&str]) -> String {
    let out = folder.file("record.csv");
    let command = ["simulate", SPRING, "--command", "noise:rms=4deg,bandwidth=1Hz,seed=5"];
    let rest = ["--noise", "3", "--duration", duration, "--out", &out, "-q"];
    let output = servotwin(&[&command[..], &rest, fault].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&servotwin(&[&["fit", &out, "--study", STUDY][..], more].concat()))
}

#[test]
fn the_verdict_comes_first_on_standard_output() {
    let folder = Folder::new("fit-verdict");
    let healthy = fitted(&folder, &[], "12s", &[]);
    assert!(healthy.starts_with("healthy: "), "{healthy}");
    let written = folder.file("fitted.toml");
    let updated = fitted(&folder, &[], "12s", &["--out", &written]);
    assert!(updated.lines().next().unwrap().contains("parameters updated in "), "{updated}");
    let leak = fitted(&folder, &["--fault", "leakage_a.leakage=0.3"], "12s", &[]);
    let first = leak.lines().next().unwrap();
    assert!(first.starts_with("fault: leakage_a.leakage at intensity 0.3"), "{first}");
    assert!(first.ends_with("from the first sample on"), "{first}");
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_fault_that_begins_within_a_record_is_reported_with_its_time() {
    let folder = Folder::new("fit-onset");
    let leak = ["--fault", "leakage_a.leakage=0.3@12s"];
    let text = fitted(&folder, &leak, "40s", &[]);
    let first = text.lines().next().unwrap();
    assert!(first.starts_with("fault: leakage_a.leakage at intensity 0.3"), "{first}");
    assert!(first.contains("from 12.0") || first.contains("from 11.9"), "{first}");
    let named = fitted(&folder, &leak, "40s", &["--faults", "leakage_a.leakage", "--json"]);
    let named: serde_json::Value = serde_json::from_str(&named).unwrap();
    assert!((named["faults"][0]["intensity"].as_f64().unwrap() - 0.3).abs() < 0.01, "{named}");
    assert!((named["faults"][0]["onset"]["at_s"].as_f64().unwrap() - 12.0).abs() < 0.1, "{named}");
}

#[test]
fn a_stroke_sensor_that_is_zeroed_within_a_record_is_named_with_the_time() {
    let folder = Folder::new("fit-zeroed");
    let zeroed = ["--fault", "sensor_ram.bias_positive=0.05@6s"];
    let text = fitted(&folder, &zeroed, "12s", &[]);
    let first = text.lines().next().unwrap();
    assert!(first.starts_with("fault: sensor_ram.bias_positive"), "{first}");
    assert!(first.contains("from 6.0") || first.contains("from 5.9"), "{first}");
}

#[test]
fn a_fault_begins_within_its_run_or_is_refused() {
    let run = |fault: &str| {
        servotwin(&["simulate", SPRING, "--duration", "2s", "--fault", fault, "--json"])
    };
    let output = run("leakage_a.leakage=0.3@1s");
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["faults"][0]["from_s"], 1.0);
    for (fault, message) in [
        ("leakage_a.leakage=0.3@2s", "a fault begins within the run, from 0 to 2 s"),
        ("leakage_a.leakage=0.3@-1s", "a fault begins within the run"),
        ("leakage_a.leakage=0.3@soon", "--fault"),
    ] {
        let output = run(fault);
        assert_eq!(output.status.code(), Some(2), "{fault}");
        assert!(stderr(&output).contains(message), "{}", stderr(&output));
    }
}
