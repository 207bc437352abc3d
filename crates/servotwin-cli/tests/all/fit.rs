//! `servotwin fit`: from a log to a system file, and logs that are refused.

use super::{Folder, SPRING, json, servotwin, stderr, stdout};

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
    assert_eq!(result["is_update"], true, "{result}");
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

#[test]
fn a_fault_is_no_update_and_its_intensity_is_found() {
    let folder = Folder::new("fit-fault");
    let log = log(&folder, &["--fault", "leakage_a.leakage=0.4"]);
    let fitted = folder.file("fitted.toml");
    let output = servotwin(&["fit", &log, "--study", STUDY, "--out", &fitted]);
    assert_eq!(output.status.code(), Some(1));
    let message = stderr(&output);
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
    assert_eq!(found[0]["fault"], "leakage_a.leakage");
    assert!((found[0]["intensity"].as_f64().unwrap() - 0.4).abs() < 0.02, "{found}");
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
        (&["fit", "/nowhere.csv"], 1, "/nowhere.csv"),
        (&["fit", &short, "--study", STUDY], 3, "short.csv: the record is too short"),
        (&["fit", &timeless, "--study", STUDY], 3, "no column 'time_s'"),
        (&["fit", &log, "--study", STUDY, "--parameters", "nul_bias"], 2, "nul_bias"),
        (&["fit", &log, "--study", STUDY, "--parameters", "mass_kg=0%"], 2, "greater than 0"),
        (&["fit", &log, "--study", STUDY, "--faults", "leak"], 2, "no fault 'leak'"),
    ];
    for (arguments, code, message) in cases {
        let output = servotwin(arguments);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(*code), "{arguments:?}: {text}");
        assert!(text.contains(message), "{arguments:?}: {text}");
    }
}
