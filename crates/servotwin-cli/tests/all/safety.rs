//! Artefacts for a safety case, made as users make them, from a study small enough for a test.

use super::flights::learned;
use super::{Folder, Shared, copy_folder, fails, stderr, stdout, succeeds};
use servotwin::job::Crew;
use servotwin::measure::{END_TO_END_OF_ALL, RIGHT_ACTION_OF_ALL, VISIBLE};
use servotwin::parallel::Workers;
use servotwin::table::Table;
use servotwin::table::csv::texts::{self, Texts};
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::sensors::runs::SensorRuns;
use servotwin_safety::sensors::{SensorSet, SensorTrade};
use std::fs;
use std::path::Path;
use std::process::Command;

const RATES: &str = "fault,rate,unit,source\n\
                     servo_valve.bias_positive,100,FIT,a handbook\n\
                     servo_valve.bias_negative,100,FIT,a handbook\n\
                     sensor_pressure_a.bias_positive,1,1/(1e6 h),field data\n";

const HOURS: [&str; 6] = ["--flight-hours", "2", "--repair-hours", "10", "--check-hours", "100"];

/// A folder with a study's judged flights, and a table of rates.
fn flown(name: &str) -> (Folder, String, String) {
    let folder = Folder::new(name);
    learned(&folder);
    let (out, rates) = (folder.file("out"), folder.file("rates.csv"));
    fs::write(&rates, RATES).unwrap();
    (folder, out, rates)
}

/// The same with the flights of an FMEA, which are flown once for all tests.
fn flown_in_closed_loop(name: &str) -> (Folder, String, String) {
    static FLOWN: Shared = Shared::new("fmea-flown");
    let folder = Folder::new(name);
    let made = FLOWN.get(|path| {
        let (learned, out, _) = flown("fmea-flown");
        succeeds(&["fmea", &out, "--quiet"]);
        copy_folder(&learned.0, path);
    });
    copy_folder(made, &folder.0);
    let (out, rates) = (folder.file("out"), folder.file("rates.csv"));
    (folder, out, rates)
}

fn cell(sheet: &Texts, fault: &str, column: &str) -> String {
    let place = sheet.column(column).unwrap_or_else(|| panic!("no column {column}"));
    let row = sheet.rows.iter().find(|row| row.cells[0] == fault).unwrap();
    row.cells[place].clone()
}

#[test]
fn fault_trees_are_written_and_the_same_twice() {
    let (_folder, out, rates) = flown("fault-tree");
    let arguments = [&["fault-tree", &out, "--rates", &rates][..], &HOURS].concat();
    let text = succeeds(&arguments);
    assert!(text.contains("\nLoss of both lanes in a flight"), "{text}");
    let safety = Path::new(&out).join("safety");
    let read = || {
        let mut files: Vec<_> = fs::read_dir(&safety).unwrap().map(|e| e.unwrap().path()).collect();
        files.sort();
        files.into_iter().map(|path| (path.clone(), fs::read(path).unwrap())).collect::<Vec<_>>()
    };
    assert!(text.contains("\nbetween checks       100 h\ntests on the ground  none\n"), "{text}");
    assert!(fails(&["fault-tree", &out, "--template", &rates], 2).contains("stays as it is"));
    let first = read();
    assert_eq!(first.len(), 11, "{:?}", first.iter().map(|file| &file.0).collect::<Vec<_>>());
    succeeds(&arguments);
    assert!(read() == first, "the second run gave other bytes");
    let json = fs::read_to_string(safety.join("fault-tree.json")).unwrap();
    let numbers: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(numbers["tops"].as_array().unwrap().len(), 3);
    assert!(
        fs::read_to_string(safety.join("fault-tree-loss_of_both_lanes.svg"))
            .unwrap()
            .starts_with("<svg")
    );
}

#[test]
fn the_rate_of_the_function_is_that_of_the_counts_and_the_same_twice() {
    let (folder, out, rates) = flown("function-rate");
    let arguments = [&["fault-tree", &out, "--rates", &rates][..], &HOURS].concat();
    let text = succeeds(&[&arguments[..], &["--details"]].concat());
    assert!(text.starts_with("With the hybrid twin the function begins to fail "), "{text}");
    assert!(
        text.contains("\nall intensities") && text.contains("wear: all failure rates times 10"),
        "{text}"
    );
    let read = |name: &str| fs::read(Path::new(&out).join("safety").join(name)).unwrap();
    let first = ["function-rate.csv", "function-rate-inputs.csv"].map(read);
    let json = succeeds(&[&arguments[..], &["--json"]].concat());
    assert!(["function-rate.csv", "function-rate-inputs.csv"].map(read) == first, "other bytes");
    let found: serde_json::Value = serde_json::from_str(&json).unwrap();
    let whole = &found["function_rate"]["conditions"][0];
    let number = |of: &str, name: &str| whole[of][name].as_f64().unwrap();
    // Two kinds of fault in each of two actuators need a shutdown, at 100 FIT each.
    assert!((number("nobody", "begins_per_h") / 4e-7 - 1.0).abs() < 1e-3, "{whole}");
    let hidden = |hours: f64| 4e-7 * (2.0 + hours / 2.0);
    assert!((number("nobody", "failed") / hidden(98.0) - 1.0).abs() < 1e-3, "{whole}");
    let [low, point, high] = ["low", "point", "high"].map(|end| number("twin_failed", end));
    assert!(low <= point && point <= high && point <= number("nobody", "failed"), "{whole}");
    let inputs = texts::read(&Path::new(&out).join("safety/function-rate-inputs.csv")).unwrap();
    assert!(
        inputs.rows.iter().any(|row| row.cells[0] == "failure rate: servo_valve.bias_positive")
    );
    assert!(inputs.rows.iter().any(|row| row.cells[0] == "check interval, h"));
    drop(folder);
}

#[test]
#[ignore = "needs scram: ./check --all"]
fn scram_computes_the_same_probabilities() {
    let scram = Command::new("scram").arg("--version").output();
    scram.expect("SCRAM runs (apt-get install scram)");
    let (_folder, out, rates) = flown("scram");
    succeeds(&[&["fault-tree", &out, "--rates", &rates][..], &HOURS].concat());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../peers/scram.py");
    let output = Command::new("python3").args([script, &out]).output().expect("python3 runs");
    assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
    assert!(stdout(&output).contains("numbers compared"), "{}", stdout(&output));
}

#[test]
fn every_fault_is_flown_once_and_a_persons_cells_survive() {
    let (folder, out, rates) = flown_in_closed_loop("fmea");
    let printed = succeeds(&["fmea", &out, "--rates", &rates]);
    let path = Path::new(&out).join("safety/fmea.csv");
    assert!(printed.contains("safety/fmea.csv: "), "{printed}");
    let sheet = texts::read(&path).unwrap();
    let fault = "actuator_1.servo_valve.bias_positive";
    assert!(
        cell(&sheet, fault, "effect_on_system")
            .starts_with("aircraft: rms surface error (aileron) ")
    );
    // The evidence names runs, and each can be flown again to the bit.
    let flights = Path::new(&out).join("outcomes-effects-realistic.parquet");
    let outcomes = Table::read(&flights).unwrap();
    let (numbers, events) = (outcomes.f64("number").unwrap(), outcomes.text("event").unwrap());
    let row = events.iter().rposition(|event| event == fault).unwrap();
    let number = numbers[row];
    let evidence = cell(&sheet, fault, "evidence: effect_on_system");
    let named =
        format!("outcomes-effects-realistic.parquet runs {}, {number} (case S1", number - 1.0);
    assert!(evidence.starts_with(&named), "{evidence}");
    let (study, name) = (folder.file("tiny.toml"), format!("effects#{number}@realistic"));
    let again = &super::json(&["run", &name, &out, "--json"])["outcomes"][0];
    for field in ["error_rms", "reacting_error_max", "force_fight_rms_n", "travel_difference_m"] {
        let value = outcomes.f64(field).unwrap()[row];
        assert!(value > 0.0 && again[field] == value, "{again}");
    }
    assert_eq!(cell(&sheet, fault, "failure_rate_per_h"), "1e-7");
    let severity = cell(&sheet, fault, "severity");
    let lost = cell(&sheet, fault, "effect_on_system");
    assert_eq!(
        severity.contains("lanes switched off"),
        lost.contains("lanes off at"),
        "{severity}"
    );
    let coverage = cell(&sheet, fault, "diagnostic_coverage");
    assert!(coverage.contains(" above false alarms: right action in "), "{coverage}");
    let latency = cell(&sheet, fault, "detection_latency");
    assert!(latency.contains("of 2 own flights"), "{latency}");
    assert!(latency.contains("; judged flights, all intensities: visible after "), "{latency}");
    // No class lists this fault.
    let unlisted = "actuator_1.servo_valve.gain_low";
    assert!(cell(&sheet, unlisted, "effect_on_system").contains("rms surface error"));
    assert_eq!(cell(&sheet, unlisted, "isolation"), "no right action to compare with");
    // The flights are stored: nothing flies again.
    let stored = fs::metadata(&flights).unwrap().modified().unwrap();
    let severity = sheet.column("severity").unwrap();
    let mut edited = sheet.clone();
    let row = edited.rows.iter_mut().find(|row| row.cells[0] == fault).unwrap();
    row.cells[severity] = "S4, by the board".into();
    write(&path, &edited);
    let printed = succeeds(&["fmea", &out, "--rates", &rates]);
    assert!(printed.contains(" 1 filled in by people, 0 rows stale"), "{printed}");
    let named = ["--suite", "effects", "--scenario", "realistic", "--quiet"];
    succeeds(&[&["study", &study, "--out", &out][..], &named].concat());
    assert_eq!(fs::metadata(&flights).unwrap().modified().unwrap(), stored, "flown again");
    let again = texts::read(&path).unwrap();
    assert_eq!(cell(&again, fault, "severity"), "S4, by the board");
    assert_eq!(cell(&again, fault, "filled_by_person"), "severity");
    // Another diagnoser makes the row stale, and its flights too.
    let diagnoser = Path::new(&out).join("diagnoser-realistic.json");
    fs::copy(Path::new(&out).join("diagnoser-noise.json"), &diagnoser).unwrap();
    succeeds(&["fmea", &out, "--no-flights"]);
    let evidence = cell(&texts::read(&path).unwrap(), fault, "evidence: effect_on_system");
    assert!(evidence.ends_with("; STALE: the model changed since they were flown"), "{evidence}");
    fs::remove_file(Path::new(&out).join("manifest.json")).unwrap();
    let message = fails(&["fmea", &out], 3);
    assert!(message.contains("there is no manifest.json here"), "{message}");
    drop(folder);
}

#[test]
fn a_sheet_quotes_flights_of_its_own_scenario() {
    let (folder, out, rates) = flown_in_closed_loop("fmea-scenario");
    // A diagnoser stands for results of the scenario.
    let diagnoser = |scenario: &str| Path::new(&out).join(format!("diagnoser-{scenario}.json"));
    fs::copy(diagnoser("noise"), diagnoser("ideal")).unwrap();
    let fault = "actuator_1.servo_valve.bias_positive";
    let sheet = |scenario: &str| {
        let path = folder.file(&format!("{scenario}.csv"));
        succeeds(&["fmea", &out, "--no-flights", "--scenario", scenario, "--out", &path]);
        texts::read(Path::new(&path)).unwrap()
    };
    let (noise, ideal) = (sheet("noise"), sheet("ideal"));
    assert_eq!(cell(&noise, fault, "effect_on_system"), "not flown");
    let judged = cell(&noise, fault, "evidence: isolation");
    assert!(judged.starts_with("flights.json, noise: kinds"), "{judged}");
    for column in ["effect_on_actuator", "detection_latency", "isolation", "diagnostic_coverage"] {
        assert_eq!(cell(&ideal, fault, column), "not flown in this scenario", "{column}");
    }
    for row in &ideal.rows {
        assert!(row.cells.iter().all(|cell| !cell.contains("flights.json")), "{:?}", row.cells);
    }
    let told = fails(&["worst-case", &out, "--scenario", "ideal"], 2);
    assert!(told.contains("nothing flies in the scenario 'ideal'"), "{told}");
    let trees =
        [&["fault-tree", &out, "--rates", &rates, "--scenario", "ideal"][..], &HOURS].concat();
    let told = fails(&trees, 2);
    assert!(
        told.contains("no results of the scenario 'ideal'; there are: noise, realistic"),
        "{told}"
    );
}

/// A number as a program for sheets shows and saves it, with some digits, in English or with a decimal comma; other texts
/// as they are. Excel saves what a column of its usual width shows, 1.85E-06; LibreOffice up to six digits and more.
fn as_shown(cell: &str, (digits, has_comma): (usize, bool)) -> String {
    let Ok(number) = cell.trim().parse::<f64>() else { return cell.to_owned() };
    let text = match number.abs() {
        small if small > 0.0 && small < 1e-4 => {
            let text = format!("{number:.*E}", digits - 1);
            let (mantissa, exponent) = text.split_once('E').unwrap();
            let exponent: i32 = exponent.parse().unwrap();
            format!("{mantissa}E-{:02}", -exponent)
        }
        _ => format!("{number}"),
    };
    if has_comma { text.replace('.', ",") } else { text }
}

#[test]
fn a_spreadsheet_that_only_saves_the_sheet_makes_no_cell_a_persons() {
    let folder = Folder::new("fmea-spreadsheet");
    let [rates, sheet] = ["rates.csv", "fmea.csv"].map(|name| folder.file(name));
    let table = |low: &str, leak: &str| {
        format!(
            "fault,rate,unit,source\n\
             valve.clogging_pa,{low},FIT,\"=HYPERLINK(\"\"http://127.0.0.1/\"\"&A2)\"\n\
             cylinder.internal_leakage,{leak},1/(1e6 h),+49 30 1234 (call of 3 May)\n\
             valve.gain_low,1.23456789e-7,1/h,\"@handbook\nsecond line\"\n\
             pump.flow_loss,55,FIT,-1+2\n"
        )
    };
    for form in [(6, false), (6, true), (3, false), (3, true)] {
        fs::write(&rates, table("120.2", "0.4321987")).unwrap();
        let _ = fs::remove_file(&sheet);
        succeeds(&["fmea", "press_axis", "--rates", &rates, "--out", &sheet]);
        let text = fs::read_to_string(&sheet).unwrap();
        assert!(text.starts_with("\u{feff}fault,"), "a spreadsheet reads UTF-8");
        for formula in ["'=HYPERLINK", "'+49", "'@handbook", "'-1+2"] {
            assert!(text.contains(&format!("\"{formula}")), "{formula} may be computed");
        }
        let mut saved = texts::read(Path::new(&sheet)).unwrap();
        assert_eq!(cell(&saved, "pump.flow_loss", "failure_rate_source"), "-1+2");
        let cells = saved.rows.iter_mut().flat_map(|row| &mut row.cells);
        cells.for_each(|cell| *cell = as_shown(cell, form));
        write(Path::new(&sheet), &saved);
        fs::write(&rates, table("9000", "7.7")).unwrap();
        let printed = succeeds(&["fmea", "press_axis", "--rates", &rates, "--out", &sheet]);
        assert!(printed.contains(" 0 filled in by people, 0 rows stale"), "{printed}");
        let again = texts::read(Path::new(&sheet)).unwrap();
        assert_eq!(again.separator, b';', "the separator of the saved sheet stays");
        assert_eq!(cell(&again, "valve.clogging_pa", "failure_rate_per_h"), "9e-6");
        assert_eq!(cell(&again, "valve.clogging_pa", "status"), "generated");
    }
}

#[test]
fn another_model_makes_a_persons_row_stale() {
    let (_folder, out, _) = flown("fmea-stale");
    succeeds(&["fmea", &out, "--no-flights"]);
    let path = Path::new(&out).join("safety/fmea.csv");
    let mut sheet = texts::read(&path).unwrap();
    let remarks = sheet.column("remarks").unwrap();
    sheet.rows[0].cells[remarks] = "see hazard log".into();
    write(&path, &sheet);
    let manifest = Path::new(&out).join("manifest.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let diagnoser = Path::new(&out).join("diagnoser-noise.json");
    let known = servotwin::manifest::sha256(&diagnoser).unwrap();
    let changed = fs::read_to_string(&diagnoser).unwrap() + "\n";
    fs::write(&diagnoser, changed).unwrap();
    let now = servotwin::manifest::sha256(&diagnoser).unwrap();
    fs::write(&manifest, text.replace(&known, &now)).unwrap();
    let printed = succeeds(&["fmea", &out, "--no-flights"]);
    assert!(printed.contains(" 1 rows stale"), "{printed}");
    let sheet = texts::read(&path).unwrap();
    assert!(
        sheet.rows[0].cells[sheet.column("status").unwrap()]
            .starts_with("stale: the model changed")
    );
}

/// The press axis, with few short runs.
fn small_press(folder: &Folder) -> String {
    let study = include_str!("../../../../studies/press_axis.toml");
    let small = [
        ("duration_s = 10\n", "duration_s = 2\n"),
        ("[0.25, 0.5, 0.75, 1.0]", "[0.5, 1.0]"),
        ("healthy = 20\ntol", "healthy = 10\ntol"),
        ("count = 6", "count = 2"),
    ];
    let text = small.iter().fold(study.to_owned(), |text, (from, to)| text.replace(from, to));
    let [path, out] = ["press.toml", "out"].map(|name| folder.file(name));
    fs::write(&path, text).unwrap();
    succeeds(&["study", &path, "--suite", "records", "--out", &out]);
    out
}

#[test]
fn brute_force_confirms_the_search_over_sensors() {
    let folder = Folder::new("sensors");
    let out = small_press(&folder);
    let printed = succeeds(&["sensors", &out]);
    assert!(
        printed.contains("7 sets judged, 4 of them leave control possible, which needs "),
        "{printed}"
    );
    assert!(printed.contains("p_a (controller), p_b (controller), x_p (controller).\n"));
    assert!(printed.contains("control needs it"), "{printed}");
    let read = |name: &str| fs::read(Path::new(&out).join("safety").join(name)).unwrap();
    let first = ["sensors.csv", "pareto.svg"].map(read);
    succeeds(&["sensors", &out, "--threads", "1"]);
    assert!(["sensors.csv", "pareto.svg"].map(read) == first, "other bytes");

    let results = StudyResultsFolder::open(servotwin::job::Folder::new(&out), None).unwrap();
    let crew = Crew::quiet(Workers::new(1));
    let trade = SensorTrade::new(&results, &[], None, &crew).unwrap();
    let runs = SensorRuns::read(&results, &trade.candidates).unwrap();
    let table = Table::read(Path::new(&out).join("dataset-realistic.parquet")).unwrap();
    let largest = ["p_a", "p_b", "x_p", "x_v", "p_s"]
        .map(|name| table.f64(&format!("largest:{name}")).unwrap().to_vec());
    let (kinds, failures) = (table.text("kind").unwrap(), table.text("failure").unwrap());
    let faults =
        (0..table.row_count()).filter(|&r| kinds[r] != "healthy" && failures[r].is_empty());
    let faults: Vec<usize> = faults.collect();
    let needed = [true, true, true, false, false];
    let mut able = vec![];
    for set in 1_u64..32 {
        let holds = |sensor: &usize| set >> sensor & 1 == 1;
        let is_able = (0..5).all(|sensor| holds(&sensor) || !needed[sensor]);
        let Some(judged) = trade.of(set) else {
            assert!(!is_able, "a set that leaves control possible was not judged");
            continue;
        };
        let is_beyond = |row: &&usize| {
            (0..5).filter(holds).any(|sensor| largest[sensor][**row] > runs.bands[sensor])
        };
        let detected = faults.iter().filter(is_beyond).count() as u64;
        assert_eq!((judged.count(&VISIBLE), judged.keeps_control), (detected, is_able));
        assert!(judged.count(&END_TO_END_OF_ALL) <= judged.count(&RIGHT_ACTION_OF_ALL));
        assert!(judged.count(&RIGHT_ACTION_OF_ALL) <= detected);
        if is_able {
            able.push(judged);
        }
    }
    assert_eq!(able.len(), 4);
    let key = |set: &SensorSet| (set.cost, set.errors(), -(set.count(&RIGHT_ACTION_OF_ALL) as f64));
    for set in &able {
        let (cost, errors, lost) = key(set);
        let beats =
            |o: (f64, u64, f64)| o.0 <= cost && o.1 <= errors && o.2 <= lost && o != key(set);
        let is_beaten = able.iter().any(|other| beats(key(other)));
        assert_eq!(set.is_on_front, !is_beaten);
    }
    for best in trade.best_of_sizes() {
        let alike = able.iter().filter(|set| set.set.count_ones() == best.set.count_ones());
        assert!(alike.clone().all(|set| set.errors() >= best.errors()));
    }
}

/// Writes a sheet as a program for sheets does: semicolons between cells.
fn write(path: &Path, sheet: &Texts) {
    let line = |cells: &[String]| {
        let quoted: Vec<String> =
            cells.iter().map(|cell| format!("\"{}\"", cell.replace('"', "\"\""))).collect();
        quoted.join(";") + "\n"
    };
    let rows: String = sheet.rows.iter().map(|row| line(&row.cells)).collect();
    fs::write(path, line(&sheet.columns) + &rows).unwrap();
}

#[test]
fn wrong_input_is_told_with_its_place() {
    let (folder, out, rates) = flown("safety-wrong");
    let bad = folder.file("bad.csv");
    let faulttree = |rates: &str, hours: [&str; 6], code: i32| {
        fails(&[&["fault-tree", &out, "--rates", rates][..], &hours].concat(), code)
    };
    let cases = [
        (
            "fault,rate,unit\nx,1,FIT\n",
            "bad.csv: there is no column 'source'; needed are: fault, rate, unit, source",
        ),
        (
            "fault,rate,unit,source\nservo_valve.bias_positive,-1,FIT,x\n",
            "bad.csv: line 2, column 'rate': -1 is out of range: allowed is 0 … 1000000000 FIT",
        ),
        (
            "fault,rate,unit,source\nservo_valve.bias_positiv,1,FIT,x\n",
            "did you mean 'servo_valve.bias_positive'?",
        ),
        (
            "fault,rate,unit,source\nservo_valve.bias_positive,1,per year,x\n",
            "'per year' is no unit of a failure rate; allowed are 1/h, 1/(1e6 h), FIT",
        ),
        (
            "fault,rate,unit,source\nservo_valve.bias_positive,1,FIT,x\n",
            "4 faults of the tree have no rate: actuator_1.servo_valve.bias_negative",
        ),
        (
            "fault,rate,unit,source\n\"servo_valve.bias_positive,1,FIT,x\n",
            "line 2: a quote is opened and never closed",
        ),
        ("", "bad.csv: the file is empty"),
    ];
    for (text, message) in cases {
        fs::write(&bad, text).unwrap();
        let told = faulttree(&bad, HOURS, 3);
        assert!(told.starts_with("error: ") && told.contains(message), "{text}: {told}");
    }
    assert!(faulttree("/nowhere.csv", HOURS, 3).contains("/nowhere.csv: no such file"));
    let hours = ["--flight-hours", "2", "--repair-hours", "-1", "--check-hours", "100"];
    let hours = hours.map(|word| if word == "-1" { "1e9" } else { word });
    assert!(
        faulttree(&rates, hours, 2)
            .contains("--repair-hours 1000000000 is out of range: 0 … 100,000")
    );
    let hours = ["--flight-hours", "2", "--repair-hours", "0", "--check-hours", "1"];
    assert!(faulttree(&rates, hours, 2).contains("at least the duration of a flight"));
    assert!(fails(&["fault-tree", &out], 2).contains("--rates"));
    assert!(
        fails(&["fmea", &out, "--scenario", "fitted"], 2).contains("there are: noise, realistic")
    );
    assert!(
        fails(&["fmea", &out, "--out", &folder.file("a.ods")], 2).contains("a sheet ends in .csv")
    );
    let sheet = folder.file("sheet.csv");
    fs::write(&sheet, "fault,severity\na,b\n").unwrap();
    assert!(
        fails(&["fmea", &out, "--out", &sheet], 3)
            .contains("sheet.csv: there is no column 'status'")
    );
    assert!(fails(&["fmea", "nowhere"], 3).contains("nowhere"));
}

/// A folder whose diagnoser has a weakness: evidence must reach a much higher limit before an action is raised.
fn weakened(name: &str) -> (Folder, String) {
    let (folder, out, _) = flown(name);
    let path = Path::new(&out).join("diagnoser-noise.json");
    let text = fs::read_to_string(&path).unwrap();
    let mut diagnoser: serde_json::Value = serde_json::from_str(&text).unwrap();
    diagnoser["tuning"]["least_limit_nats"] = 100.0.into();
    diagnoser["tuning"]["evidence_cap"] = 3.0.into();
    diagnoser.as_object_mut().unwrap().remove("sha256");
    fs::write(&path, diagnoser.to_string()).unwrap();
    let path = Path::new(&out).join("manifest.json");
    let mut manifest: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    let is_kept = |output: &serde_json::Value| output["file"] != "diagnoser-noise.json";
    manifest["outputs"].as_array_mut().unwrap().retain(is_kept);
    fs::write(&path, manifest.to_string()).unwrap();
    (folder, out)
}

/// Searches a folder.
fn searched(out: &str, more: &[&str]) -> serde_json::Value {
    super::json(&[&["worst-case", out, "--scenario", "noise", "--json"], more].concat())
}

/// The flights of a search for an objective.
fn flown_for(out: &str, objective: &str) -> std::path::PathBuf {
    Path::new(out).join(format!("outcomes-worst_{objective}-noise.parquet"))
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_search_goes_on_and_gives_the_same_on_any_number_of_threads_and_its_findings_are_flown_again() {
    let (_folder, out, _) = flown("worst-case");
    let found = searched(&out, &["--runs", "24", "--threads", "1"]);
    let objectives = found["objectives"].as_array().unwrap();
    assert_eq!(objectives.len(), 4);
    let mut whole = vec![];
    for own in objectives {
        assert!(Path::new(own["figure"].as_str().unwrap()).exists(), "{own}");
        let path = flown_for(&out, own["objective"].as_str().unwrap());
        assert_eq!(Table::read(&path).unwrap().row_count(), 2 * 24, "flights of both methods");
        whole.push((fs::read(&path).unwrap(), path));
        let finding = &own["findings"][0];
        let run = finding["run"].as_str().unwrap();
        let again = super::json(&["run", run, &out, "--json", "--threads", "3"]);
        assert_eq!(again["outcomes"][0]["margin"], finding["margin"], "{finding}");
    }
    // Begun with fewer flights and on other threads, and then continued.
    whole.iter().for_each(|(_, path)| fs::remove_file(path).unwrap());
    searched(&out, &["--runs", "10", "--threads", "3"]);
    assert_eq!(searched(&out, &["--runs", "24", "--threads", "2"]), found);
    for (bytes, path) in &whole {
        assert!(fs::read(path).unwrap() == *bytes, "{}: other bytes", path.display());
    }
    // Nothing is flown again.
    let stored = |path: &Path| fs::metadata(path).unwrap().modified().unwrap();
    let before: Vec<_> = whole.iter().map(|(_, path)| stored(path)).collect();
    searched(&out, &["--runs", "24"]);
    assert_eq!(whole.iter().map(|(_, path)| stored(path)).collect::<Vec<_>>(), before);
    for run in ["worst_transient#99@noise", "worst_transient#0@realistic"] {
        let text = fails(&["run", run, &out], 2);
        assert!(text.contains("the study has no such run for judging"), "{text}");
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_search_comes_nearer_to_an_error_than_as_many_random_flights() {
    let (_folder, out) = weakened("weakness");
    for seed in ["1", "2"] {
        let arguments = ["--objective", "missed_shutdown", "--runs", "192", "--seed", seed];
        searched(&out, &arguments);
        let flown = Table::read(flown_for(&out, "missed_shutdown")).unwrap();
        let margins = flown.f64("margin").unwrap();
        let mean = |margins: &[f64]| margins.iter().sum::<f64>() / margins.len() as f64;
        // The flights of the search come first.
        let [search, random] = [mean(&margins[..192]), mean(&margins[192..])];
        println!("mean margin {search:.3} by search, {random:.3} at random");
        assert!(search < random - 0.02, "{search} {random}");
    }
}
