//! Logs as rigs and recorders write them: read whole as `fit` reads them, by the rules and maps of `watch`.

use crate::folder::Folder;
use servotwin::fit::FitRecord;
use servotwin::study::Study;
use servotwin_watch::counts::Irregularity;
use servotwin_watch::guard::IntakeError;
use servotwin_watch::intake::{self, Whole};
use servotwin_watch::map::{Guess, Map, Trust, guess};
use servotwin_watch::source::{Address, LogColumn, LogRow, Read, SourceError};
use servotwin_watch::span::LogSpan;
use std::fmt::Write as _;
use std::path::Path;

fn spring() -> Study {
    Study::read("spring_actuator").unwrap()
}

fn read(path: &Path, map: Option<&str>, study: &Study) -> Result<Whole, IntakeError> {
    let map = map.map(|text| Map::parse(text, "map.toml", &study.system).unwrap());
    intake::read(path, map.as_ref(), LogSpan::default(), study)
}

fn column(whole: &Whole, name: &str) -> Vec<f64> {
    whole.table.f64(name).unwrap().into_owned()
}

/// A command and a pressure that move, at a number of a sample.
fn command_deg(k: usize) -> f64 {
    (4.0 * (k as f64 * 0.05).sin() * 1e4).round() / 1e4
}

fn pressure_bar(k: usize) -> f64 {
    ((100.0 + 10.0 * (k as f64 * 0.05).cos()) * 1e3).round() / 1e3
}

const RIG_MAP: &str = r#"
format = 1
[time]
column = "Zeit"
unit = "s"
[inputs]
command = { column = "Sollwinkel", unit = "deg" }
[sensors]
p_a = { column = "PA1", unit = "bar" }
"#;

#[test]
fn a_rig_log_with_preamble_units_and_decimal_commas_gives_the_numbers_of_a_plain_one() {
    let folder = Folder::new("intake-rig");
    let mut plain = "time_s,command_rad,p_a_pa\n".to_owned();
    // The degree sign is one byte of Windows-1252.
    let mut rig = b"sep=;\nZeit;Sollwinkel;PA1;n\ns;\xb0;bar;-\nRekorder;FCC;Aktor 1;\n".to_vec();
    for k in 0..600 {
        let (t, c, p) = (0.01 * k as f64, command_deg(k), pressure_bar(k));
        let _ = writeln!(plain, "{t:.2},{:?},{:?}", c.to_radians(), p * 1e5);
        let row = format!("{t:.2};{c:.4};{p:.3};\n").replace('.', ",");
        rig.extend(row.as_bytes());
    }
    let (plain, rig) = (folder.write("plain.csv", plain), folder.write("rig.csv", &rig));
    let study = spring();
    let plain = read(&plain, None, &study).unwrap();
    let mapped = read(&rig, Some(RIG_MAP), &study).unwrap();
    for name in ["time_s", "command_rad", "p_a_pa"] {
        let pairs = column(&plain, name).into_iter().zip(column(&mapped, name));
        let far = pairs.map(|(a, b)| (a - b).abs() / a.abs().max(1e-3)).fold(0.0, f64::max);
        assert!(far < 1e-12, "{name}: {far}");
    }
    assert_eq!(plain.counts.met().count(), 0);
    // The header is no row of data, and nothing else is lost unsaid.
    assert_eq!((mapped.counts.frames, mapped.counts.samples), (603, 600));
    assert_eq!(mapped.counts.of(Irregularity::NoHeader).count, 1);
    let timeless = mapped.counts.of(Irregularity::NoTime);
    assert_eq!((timeless.count, timeless.first, timeless.detail.as_str()), (2, 3, "'s'"));
    // The row of units is read for a map that is made.
    let columns = Address::File(rig).columns().unwrap();
    let units: Vec<&str> = columns.iter().map(|column| column.unit.as_str()).collect();
    assert_eq!(units, ["s", "°", "bar", "-"]);
}

#[test]
fn numbers_as_text_are_numbers_and_one_stale_sample_is_left_out_and_counted() {
    let folder = Folder::new("intake-text");
    let mut lines = String::new();
    let stale = 1_759_967_600_000_u64;
    for k in 0..301 {
        let ts = if k == 0 { stale } else { 1_760_000_000_000 + 10 * (k as u64 - 1) };
        let mode = if k == 7 { "stand-by" } else { "on" };
        let _ = writeln!(
            lines,
            r#"{{"ts": "{ts}", "fcc": {{"cmd": "{:.4}"}}, "act1": {{"p_a": "{:.3}"}}, "mode": {{"1": "{mode}"}}}}"#,
            command_deg(k),
            pressure_bar(k)
        );
    }
    let log = folder.write("payload.jsonl", lines);
    let map = "format = 1\n[time]\ncolumn = \"ts\"\nunit = \"ms\"\n[inputs]\n\
               command = { column = \"fcc.cmd\", unit = \"deg\" }\n\
               \"actuator_1.mode\" = { column = \"mode.1\", unit = \"1\", hold_s = 0.01 }\n\
               [sensors]\np_a_1 = { column = \"act1.p_a\", unit = \"bar\" }\n";
    let whole = read(&log, Some(map), &Study::default()).unwrap();
    assert_eq!(whole.counts.samples, 300);
    let outlier = whole.counts.of(Irregularity::Outlier);
    assert_eq!((outlier.count, outlier.first), (1, 1));
    assert_eq!(outlier.detail, "2025-10-08 23:53:20.000");
    let bad = whole.counts.of(Irregularity::BadValue);
    assert_eq!((bad.count, bad.detail.as_str()), (1, "column 'mode.1' has 'stand-by'"));
    assert!(column(&whole, "actuator_1.mode").iter().all(|mode| *mode == 1.0));
    assert_eq!(column(&whole, "p_a_1_pa")[0], pressure_bar(1) * 1e5);
    let columns = Address::File(log).columns().unwrap();
    let made = guess(&columns, &Study::default(), Trust::Likely);
    assert!(
        made.time && made.text.contains("column = \"ts\"\nunit = \"ms\"  # assumed"),
        "{}",
        made.text
    );
}

#[test]
fn channels_of_objects_are_found_wherever_they_begin() {
    let folder = Folder::new("intake-late");
    let mut lines = String::new();
    for k in 0..500 {
        let late =
            if k < 300 { String::new() } else { format!(", \"x_p_m\": {}", 1e-3 * k as f64) };
        let (t, c, p) = (0.01 * k as f64, command_deg(k).to_radians(), pressure_bar(k) * 1e5);
        let _ = writeln!(lines, r#"{{"time_s": {t}, "command_rad": {c}, "p_a_pa": {p}{late}}}"#);
    }
    let log = folder.write("late.jsonl", lines);
    let study = spring();
    let whole = read(&log, None, &study).unwrap();
    let error = FitRecord::from_table("late", &whole.table, &study.system).unwrap_err();
    let begins = "x_p_m has no value before line 301: --from 3 reads the record from there on";
    assert_eq!(error.to_string(), begins);
    let span = LogSpan::parse(Some("3"), None).unwrap();
    let rest = intake::read(&log, None, span, &study).unwrap();
    assert_eq!((rest.counts.samples, column(&rest, "x_p_m")[0]), (200, 0.3));
    assert_eq!(rest.table.origin().place(0), "line 301");
}

#[test]
fn a_row_of_units_with_an_empty_cell_keeps_the_dates_below_it() {
    let folder = Folder::new("intake-units");
    let rows = "2025-10-26 01:00:00;1,5;2;\n2025-10-26 01:00:01;1,5;2;\n";
    let head = "Date;PA1;XP1;n\n;[bar];mm;-\nRecorder;act 1;act 1;\n";
    let columns =
        Address::File(folder.write("units.csv", [head, rows].concat())).columns().unwrap();
    let units: Vec<&str> = columns.iter().map(|column| column.unit.as_str()).collect();
    assert_eq!(units, ["date", "bar", "mm", "-"]);
    assert_eq!((&columns[1].head[..], columns[0].head.len()), (&[1.5, 1.5][..], 2));
    let objects = concat!(
        r#"{"ts": "1759967600000", "m": {"p": 1}}"#,
        "\n",
        r#"{"ts": "1759967600010", "m": {"q": [NaN, "x"]}, "at": "2025-10-26"}"#,
    );
    let columns = Address::File(folder.write("log.jsonl", objects)).columns().unwrap();
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["ts", "m.p", "m.q.0", "m.q.1", "at"]);
    assert_eq!(columns[0].head[..2], [1_759_967_600_000.0, 1_759_967_600_010.0]);
    assert_eq!(columns[4].unit, "date");
}

/// A log with dates.
fn dated(date: impl Fn(usize) -> String) -> String {
    let mut text = "time,command_rad,p_a_pa\n".to_owned();
    for k in 0..800 {
        let (c, p) = (command_deg(k).to_radians(), pressure_bar(k) * 1e5);
        let _ = writeln!(text, "{},{c},{p}", date(k));
    }
    text
}

#[test]
fn dates_without_a_zone_are_literal_and_an_hour_set_back_is_named_as_daylight_saving() {
    let folder = Folder::new("intake-zones");
    let study = spring();
    let error_of = |name: &str, date: &dyn Fn(usize) -> String| {
        let log = folder.write(name, dated(date));
        let whole = read(&log, None, &study).unwrap();
        FitRecord::from_table(name, &whole.table, &study.system).map(|record| record.period_s)
    };
    let second = |k: usize| 0.01 * (k % 400) as f64;
    // The first 400 samples end at 03:00 of summer time, which is 02:00 of winter time.
    let naive = |k: usize| match k {
        0..400 => format!("2025-10-26 02:59:{:05.2}", 56.0 + second(k)),
        _ => format!("2025-10-26 02:00:{:05.2}", second(k)),
    };
    let error = error_of("naive.csv", &naive).unwrap_err();
    let told = error.to_string();
    for part in ["line 402", "is -3599.99 s, the others are 0.01 s", "daylight saving", "--from"] {
        assert!(told.contains(part), "{told}");
    }
    let offset = |k: usize| naive(k) + if k < 400 { "+02:00" } else { "+01:00" };
    assert!((error_of("offset.csv", &offset).unwrap() - 0.01).abs() < 1e-9);
    // In spring the hour that no clock shows is taken as it stands.
    let spring = |k: usize| format!("2025-03-30 02:00:{:05.2}", 0.01 * k as f64);
    assert!((error_of("spring.csv", &spring).unwrap() - 0.01).abs() < 1e-9);
    let lost = |k: usize| format!("2025-03-30 02:00:{:05.2}", 0.01 * (k + k / 500) as f64);
    let told = error_of("lost.csv", &lost).unwrap_err().to_string();
    assert!(
        told.contains("line 502 is 0.02 s") && told.contains("1 samples are missing"),
        "{told}"
    );
}

#[test]
fn a_part_is_read_by_seconds_or_dates_and_nothing_else() {
    let folder = Folder::new("intake-part");
    let study = spring();
    let log =
        folder.write("log.csv", dated(|k| format!("2025-03-30 02:00:{:05.2}Z", 0.01 * k as f64)));
    let part = |from: Option<&str>, to: Option<&str>| {
        let span =
            LogSpan::parse(from, to).map_err(|error| IntakeError::Source(SourceError::Cut(error)));
        span.and_then(|span| intake::read(&log, None, span, &study))
            .map(|whole| whole.counts.samples)
    };
    assert_eq!(part(None, None).unwrap(), 800);
    assert_eq!(part(Some("1"), Some("2s")).unwrap(), 101);
    assert_eq!(part(Some("2025-03-30T02:00:01"), Some("2025-03-30T04:00:02+02:00")).unwrap(), 101);
    assert_eq!(part(None, Some("0.995")).unwrap(), 100);
    let told = |from, to| part(from, to).unwrap_err().to_string();
    assert!(told(Some("soon"), None).contains("from 'soon' is no time"));
    let empty = told(Some("5"), Some("4"));
    assert!(
        empty.contains("reaches from 2025-03-30 02:00:00.000 to 2025-03-30 02:00:07.990"),
        "{empty}"
    );
    assert!(told(Some("02:00:01"), None).contains("a time of the same kind"));
}

#[test]
fn a_unit_in_the_name_of_the_time_is_a_claim_that_steps_may_contradict() {
    let folder = Folder::new("intake-claims");
    let study = spring();
    for (name, claimed, step, other) in
        [("Time [ms]", "ms", 0.01, "s"), ("time_s", "s", 10.0, "ms")]
    {
        let mut text = format!("{name},command_rad,p_a_pa\n");
        for k in 0..800 {
            let (c, p) = (command_deg(k).to_radians(), pressure_bar(k) * 1e5);
            let _ = writeln!(text, "{},{c},{p}", step * k as f64);
        }
        let log = folder.write("claims.csv", text);
        let made = guess(&Address::File(log.clone()).columns().unwrap(), &study, Trust::Likely);
        let line = format!("unit = \"{claimed}\"  # doubtful: samples would be ");
        assert!(made.text.contains(&line), "{}", made.text);
        assert!(made.doubts[0].contains(&format!("in {other} they are 0.01 s apart")), "{made:?}");
        let whole = read(&log, None, &study).unwrap();
        let error = FitRecord::from_table("log", &whole.table, &study.system).unwrap_err();
        let likely = format!("likely in {other}, in which samples are 0.01 s apart");
        assert!(error.to_string().contains(&likely), "{error}");
    }
}

/// A map for columns with units, as a person would get it.
fn made(names: &[&str], study: &Study) -> Guess {
    let columns: Vec<LogColumn> = names.iter().map(|name| LogColumn::named(*name)).collect();
    guess(&columns, study, Trust::Likely)
}

/// That a sensor or an input is found in a column, with a remark to look at it.
fn assert_likely(found: &Guess, id: &str, column: &str) {
    let line = format!("\n{id} = {{ column = \"{column}\"");
    let rest = found.text.split_once(&line).map(|(_, rest)| rest.lines().next().unwrap());
    let rest = rest.unwrap_or_else(|| panic!("{id} is not {column}:\n{}", found.text));
    assert!(rest.contains("# likely by its name"), "{id}: {rest}");
}

#[test]
fn columns_of_a_rig_with_short_names_are_found_by_quantity_unit_and_number() {
    let study = Study::default();
    let mut names = vec!["TIME_S", "AIL_CMD_DEG", "XAIL_MM"];
    names.extend(["PCHA1_BAR", "PCHB1_BAR", "XRAM1_MM", "XSPOOL1_MM", "PSUP1_BAR", "PRET1_BAR"]);
    names.extend(["PCHA2_BAR", "PCHB2_BAR", "XRAM2_MM", "XSPOOL2_MM", "PSUP2_BAR", "PRET2_BAR"]);
    names.extend(["PSUP1_STATUS", "T_OIL_C"]);
    let found = made(&names, &study);
    assert!(found.sensors.is_empty(), "{}", found.text);
    for (id, column) in [
        ("command", "AIL_CMD_DEG"),
        ("p_a_1", "PCHA1_BAR"),
        ("p_b_2", "PCHB2_BAR"),
        ("x_p_1", "XRAM1_MM"),
        ("x_v_2", "XSPOOL2_MM"),
        ("p_s_1", "PSUP1_BAR"),
        ("p_t_2", "PRET2_BAR"),
        ("x_p_3", "XAIL_MM"),
    ] {
        assert_likely(&found, id, column);
    }
    assert_eq!(found.unused, ["PSUP1_STATUS", "T_OIL_C"]);
    assert!(found.text.contains("column = \"XRAM1_MM\", unit = \"MM\""), "{}", found.text);
    // Without being asked, a likely column is not taken.
    let columns: Vec<LogColumn> = names.iter().map(|name| LogColumn::named(*name)).collect();
    assert_eq!(guess(&columns, &study, Trust::Certain).sensors.len(), 13);
    assert!(Map::parse(&found.text, "map", &study.system).is_ok(), "{}", found.text);
}

#[test]
fn columns_with_long_english_names_are_found() {
    let of = |n: u32| {
        [
            format!("Actuator {n} Chamber A Pressure [bar]"),
            format!("Actuator {n} Chamber B Pressure [bar]"),
            format!("Actuator {n} Ram Position (mm)"),
            format!("Actuator {n} Servo Valve Spool Position (mm)"),
            format!("Actuator {n} Supply Line Pressure [psi]"),
            format!("Actuator {n} Return Line Pressure [psi]"),
        ]
    };
    let mut names = vec!["Elapsed Time [s]".to_owned(), "Aileron Position Demand [deg]".to_owned()];
    names.extend(of(1).into_iter().chain(of(2)));
    names.push("Aileron Surface Stroke [mm]".into());
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let found = made(&names, &Study::default());
    assert!(found.time && found.sensors.is_empty() && found.unused.is_empty(), "{}", found.text);
    assert_likely(&found, "command", "Aileron Position Demand [deg]");
    assert_likely(&found, "x_v_2", "Actuator 2 Servo Valve Spool Position (mm)");
    assert_likely(&found, "p_t_1", "Actuator 1 Return Line Pressure [psi]");
    assert_likely(&found, "x_p_3", "Aileron Surface Stroke [mm]");
}

#[test]
fn columns_with_german_names_are_found() {
    let of = |n: u32| {
        [
            format!("Kammerdruck A Aktor {n} [bar]"),
            format!("Kammerdruck B Aktor {n} [bar]"),
            format!("Kolbenweg Aktor {n} [mm]"),
            format!("Schieberweg Aktor {n} [mm]"),
            format!("Versorgungsdruck Aktor {n} [bar]"),
            format!("Rücklaufdruck Aktor {n} [bar]"),
        ]
    };
    let mut names = vec!["Uhrzeit".to_owned(), "Sollwinkel Querruder [°]".to_owned()];
    names.extend(of(1).into_iter().chain(of(2)));
    names.extend(["Ruderweg [mm]".to_owned(), "Öltemperatur Versorgung [°C]".to_owned()]);
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let found = made(&names, &Study::default());
    assert!(found.time && found.sensors.is_empty(), "{}", found.text);
    assert_eq!(found.unused, ["Öltemperatur Versorgung [°C]"]);
    assert_likely(&found, "command", "Sollwinkel Querruder [°]");
    assert_likely(&found, "p_s_2", "Versorgungsdruck Aktor 2 [bar]");
    assert_likely(&found, "x_v_1", "Schieberweg Aktor 1 [mm]");
}

#[test]
fn nothing_is_taken_across_a_unit_twice_or_where_two_are_as_likely() {
    let names = ["t", "XRAM1 [bar]", "PSUP1 [mm]", "XRAM2 [mm]", "RAM2 POS [mm]", "PRET [bar]"];
    let found = made(&names, &Study::default());
    assert_eq!(found.sensors.len(), 13, "{}", found.text);
    let either =
        "# x_p_2 = { column = \"?\", unit = \"m\" }  # may be \"XRAM2 [mm]\" or \"RAM2 POS [mm]\"";
    assert!(found.text.contains(either), "{}", found.text);
    // One column is one signal.
    let found = made(&["t", "p_s_1_pa"], &Study::default());
    assert_eq!(found.text.matches("p_s_1_pa").count(), 1, "{}", found.text);
}

#[test]
fn a_log_without_time_or_sensors_is_refused_by_name() {
    let folder = Folder::new("intake-refused");
    let study = spring();
    let timeless = folder.write("timeless.csv", "row,command_rad,p_a_pa\n0,0,1\n");
    let error = read(&timeless, None, &study).unwrap_err();
    assert!(error.to_string().contains("no column 'time_s'"), "{error}");
    let alien = folder.write("alien.csv", "time,voltage\n0,0\n");
    let error = read(&alien, None, &study).unwrap_err();
    assert!(error.to_string().starts_with("no column is a sensor of the system"), "{error}");
    let error = read(&alien, Some(RIG_MAP), &study).unwrap_err().to_string();
    assert!(error.contains("map.toml:4:10") && error.contains("'Zeit'"), "{error}");
}

#[test]
fn a_source_counts_rows_that_are_cut_off_for_logs_without_times() {
    let folder = Folder::new("intake-rate");
    let text: String = (0..10).map(|k| format!("{k}\n")).collect();
    let log = folder.write("rate.csv", format!("PA1\n{text}"));
    let map =
        "format = 1\n[time]\nrate_hz = 10\n[sensors]\np_a = { column = \"PA1\", unit = \"bar\" }\n";
    let map = Map::parse(map, "map", &spring().system).unwrap();
    let source = Address::File(log).open(map.wanted()).unwrap();
    let span = LogSpan::parse(Some("0.5"), None).unwrap();
    let mut cut = servotwin_watch::cut::Cut::new(source, "log".into(), &map, span);
    let mut row = servotwin_watch::source::Source::read(&mut cut, &mut LogRow::default()).unwrap();
    let mut kept = LogRow::default();
    while row == Read::Nothing {
        row = servotwin_watch::source::Source::read(&mut cut, &mut kept).unwrap();
    }
    assert_eq!((kept.values[0], map.time_s(&kept, 0)), (5.0, 0.5));
}

#[test]
fn a_column_of_gigabytes_that_nobody_reads_does_not_stop_the_intake() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../servotwin-io/tests/foreign/unused_text.parquet");
    let columns = Address::File(path.clone()).columns().unwrap();
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["time_s", "command_rad", "x_p_1_m", "comment"]);
    let whole = read(&path, None, &Study::default()).unwrap();
    assert_eq!(whole.counts.samples, 60);
}
