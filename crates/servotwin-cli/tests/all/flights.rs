//! Flights and the closed loop, run as users run them, on a study small enough for a test.

use super::{Folder, Shared, copy_folder, servotwin, stderr, stdout};
use servotwin::measure::outcome::{self, RunOutcome};
use servotwin::table::Table;
use std::path::Path;

/// What follows the beginning that all tiny studies have.
const STUDY: &str = include_str!("../../../servotwin/tests/tiny_flights.toml");

fn tiny() -> String {
    let head = include_str!("../../../servotwin/tests/tiny.toml");
    format!("{}{STUDY}", head.replace("[0.4, 0.6, 0.8, 1.0]", "[1.0]"))
}

/// Study and diagnoser. They are learned once, and copied into a folder.
pub fn learned(folder: &Folder) -> [String; 2] {
    static LEARNED: Shared = Shared::new("flights-learned");
    let learned = LEARNED.get(|path| {
        let (study, out) = (path.join("tiny.toml"), path.join("out"));
        std::fs::write(&study, tiny()).unwrap();
        let [study, out] = [&study, &out].map(|path| path.to_str().unwrap());
        let output = servotwin(&["study", study, "--suite", "flights", "--out", out]);
        assert!(output.status.success(), "{}", stderr(&output));
        std::fs::write(path.join("said.txt"), stdout(&output)).unwrap();
        std::fs::write(path.join("noted.txt"), stderr(&output)).unwrap();
    });
    copy_folder(learned, &folder.0);
    [folder.file("tiny.toml"), folder.file("out/diagnoser-realistic.json")]
}

#[test]
fn flights_are_learned_and_judged_and_a_flight_is_flown_with_what_was_learned() {
    let folder = Folder::new("flights");
    let ([study, _], out) = (learned(&folder), folder.file("out"));
    let text = std::fs::read_to_string(folder.file("said.txt")).unwrap();
    let summary = text.as_str();
    assert!(
        summary.starts_with("12 runs with a fault are judged, whether a sensor shows it"),
        "{summary}"
    );
    assert!(summary.lines().count() <= 10, "{summary}");
    let measures =
        ["right actuator and action first", "missed (of all)", "per hour (95 %: at most"];
    for measure in measures.into_iter().chain(["flown: "]) {
        assert!(summary.contains(measure), "{measure}: {summary}");
    }
    assert!(text.contains("outcomes-*.parquet") && text.contains("servotwin report"), "{text}");
    // Without a terminal, every stage has a line.
    for stage in ["noise: flights to learn from …", "realistic: suite judge …"] {
        let noted = std::fs::read_to_string(folder.file("noted.txt")).unwrap();
        assert!(noted.lines().any(|line| line == stage), "{noted}");
    }
    for scenario in ["noise", "realistic"] {
        let line = format!("\n{scenario}: 6 runs with a fault, 0 not finished\n");
        assert!(summary.contains(&line), "{text}");
        let rows = Table::read(Path::new(&out).join(format!("outcomes-unseen-{scenario}.parquet")));
        let rows = outcome::from_table(&rows.unwrap()).unwrap();
        assert_eq!(rows.iter().filter(|row| row.event == "spool jams where it is").count(), 2);
    }
    let read = |name: &str| std::fs::read_to_string(Path::new(&out).join(name)).unwrap();
    let results: serde_json::Value = serde_json::from_str(&read("flights.json")).unwrap();
    let judged = results["suites"].as_array().unwrap().iter().filter(|m| m["suite"] == "judge");
    assert_eq!(judged.count(), 2);
    assert!(read("manifest.json").contains("diagnoser-noise.json"));

    let fly = servotwin(&["fly", &study, "--out", &out, "--fault", "none", "--duration", "3s"]);
    assert!(fly.status.success(), "{}", stderr(&fly));
    assert!(stdout(&fly).contains("nothing had to be done"), "{}", stdout(&fly));
    assert!(stdout(&fly).contains("truth: no fault; right: no action was raised"));
    let fault = "actuator_1.servo_valve.bias_positive=0.7@2s";
    let command = "noise:rms=3deg,bandwidth=0.6Hz,seed=77";
    let fly = ["fly", &study, "--out", &out, "--fault", fault, "--command", command];
    let output = servotwin(&[&fly[..], &["--duration", "5s", "--json"]].concat());
    let flown: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(flown["actions"][0]["actuator"], "actuator_1", "{flown}");
    assert_eq!(flown["actions"][0]["action"], "shut_down", "{flown}");
    let truth = &flown["faults"][0];
    assert_eq!((&truth["actuator"], &truth["action"]), (&"actuator_1".into(), &"shut_down".into()));
    assert_eq!(
        (&truth["is_actuator_right"], &truth["is_action_right"]),
        (&true.into(), &true.into())
    );
    let [detected, acted] = ["detected_s", "action_s"].map(|key| truth[key].as_f64().unwrap());
    assert!(2.0 < detected && detected <= acted, "{truth}");
    assert_eq!(flown["false_alarms"], 0);
    let drawn = read("flight/flight.svg");
    let head = "actuator 1: servo valve: bias positive, intensity 0.7, at 2 s, reaction at ";
    assert!(drawn.contains(head), "the title says what happens");
    for mark in ["onset 2.00 s", "detection ", "reaction "] {
        assert!(drawn.contains(&format!(">{mark}")), "{mark}");
    }
    let text = stdout(&servotwin(&[&fly[..], &["--duration", "5s"]].concat()));
    assert!(text.contains("actuator right, action right (shut down), component "), "{text}");
    assert!(read("flight/flight-alone.csv").starts_with("time_s"));

    let two = ["--fault", "actuator_2.sensor_pressure_a.bias_positive=0.5@3s", "--fault", fault];
    let fly = ["fly", &study, "--out", &out, "--duration", "4s"];
    let output = servotwin(&[&fly[..], &two[..]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let titles = ["bias positive, intensity 0.7, at 2 s; ", "intensity 0.5, at 3 s"];
    assert!(titles.iter().all(|title| read("flight/flight.svg").contains(title)));
    let late =
        servotwin(&[&fly[..], &["--fault", "actuator_1.servo_valve.gain_low=1@4s"]].concat());
    assert_eq!(late.status.code(), Some(2));
    assert!(stderr(&late).contains("within the run, from 0 to 4 s"), "{}", stderr(&late));
}

#[test]
fn a_folder_of_flights_alone_has_a_report() {
    let folder = Folder::new("flights-report");
    let (_, out) = (learned(&folder), folder.file("out"));
    let output = servotwin(&["report", &out]);
    assert!(output.status.success(), "{}", stderr(&output));
    let html = std::fs::read_to_string(Path::new(&out).join("report.html")).unwrap();
    for part in ["Not in this report yet: ideal, noise, realistic.", ">The diagnosis at work<"] {
        assert!(html.contains(part), "{part}");
    }
    for part in [">What errors do<", ">Rates by scenario and protocol<"] {
        assert!(!html.contains(part), "{part}");
    }
    let output = servotwin(&["report", &out, "--markdown"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let page = stdout(&output);
    assert!(
        page.contains(
            "servotwin study tiny --suite flights --out out\nservotwin report out --markdown"
        ),
        "{page}"
    );
}

#[test]
fn a_run_by_its_name_is_to_the_bit_what_it_is_among_all_others() {
    let folder = Folder::new("one-run");
    learned(&folder);
    let out = folder.file("out");
    let fly = |name: &str| servotwin(&["run", name, &out, "--json"]);
    for suite in ["judge", "unseen"] {
        let path = folder.file(&format!("out/outcomes-{suite}-realistic.parquet"));
        let all = outcome::from_table(&Table::read(path).unwrap()).unwrap();
        for row in [&all[1], &all[all.len() - 1]] {
            let output = fly(&format!("{suite}#{}@realistic", row.number));
            assert!(output.status.success(), "{}", stderr(&output));
            let told: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
            let alone: Vec<RunOutcome> = serde_json::from_value(told["outcomes"].clone()).unwrap();
            assert_eq!(&alone[0], row);
            let name = format!("{suite}#{}@realistic", row.number);
            let words = stdout(&servotwin(&["run", &name, &out]));
            let truth = if row.onset_s.is_some() { " after the onset" } else { ": no fault" };
            assert!(words.starts_with(&name) && words.contains(truth), "{words}");
            assert!(words.contains("\nenvironment") && !words.contains("null"), "{words}");
        }
    }
    for wrong in ["judge#999@realistic", "learn#1@realistic", "judged#1@realistic"] {
        let text = stderr(&fly(wrong));
        assert!(text.contains("no such run") && text.contains(wrong), "{text}");
    }
    assert_eq!(fly("judge#1").status.code(), Some(2));
}

#[test]
fn healthy_flights_go_on_where_they_were_stored() {
    let folder = Folder::new("healthy-flights");
    let [study, diagnoser] = learned(&folder);
    let out = folder.file("out");
    let fly = |count: &str, seed: &str| {
        let more = ["--suite", "healthy", "--environments", count, "--seed", seed];
        let more = [&more[..], &["--scenario", "realistic"]].concat();
        let output = servotwin(&[&["study", &study, "--out", &out][..], &more].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        let path = folder.file("out/outcomes-healthy-realistic.parquet");
        (stdout(&output), Table::read(path).unwrap())
    };
    let learned = std::fs::read(&diagnoser).unwrap();
    let (text, three) = fly("3", "5");
    assert!(text.contains("realistic: 3 healthy flights of "), "{text}");
    assert!(text.contains(" of 3 environments, at most "), "{text}");
    assert!(text.contains("too few flights"), "{text}");
    let flights = |run: &Table| outcome::from_table(run).unwrap();
    let environments: Vec<u64> = flights(&three).iter().map(|one| one.environment).collect();
    assert_eq!(environments, [0, 1, 2]);
    let (_, five) = fly("5", "5");
    assert_eq!(flights(&five).len(), 5);
    assert_eq!(flights(&five)[..3], flights(&three)[..]);
    // Nothing is flown again.
    let part = Path::new(&out).join("parts/outcomes-healthy-realistic-0000.parquet");
    let stored = || std::fs::metadata(&part).unwrap().modified().unwrap();
    let before = stored();
    let (_, again) = fly("5", "5");
    assert!(stored() == before && flights(&again) == flights(&five));
    // Another seed has other environments, and the first one gives the same again.
    let (_, other) = fly("3", "6");
    assert_eq!((flights(&other).len(), other.metadata["seed"].as_str()), (3, "6"));
    let (_, again) = fly("5", "5");
    assert_eq!(flights(&again)[..3], flights(&three)[..]);
    assert_eq!(flights(&again)[3..], flights(&five)[3..]);
    assert_eq!(std::fs::read(&diagnoser).unwrap(), learned, "nothing is learned");
}

#[test]
fn shares_of_a_suite_are_joined_to_the_bytes_of_one_machine() {
    let folder = Folder::new("flight-shares");
    learned(&folder);
    let out = folder.file("out");
    let read =
        |suite: &str| std::fs::read(format!("{out}/outcomes-{suite}-noise.parquet")).unwrap();
    let study = |more: &[&str]| {
        let output = servotwin(&[&["study", &out, "--scenario", "noise"], more].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    study(&["--suite", "healthy", "--environments", "5"]);
    let whole = ["judge", "healthy"].map(read);
    for suite in ["judge", "healthy"] {
        std::fs::remove_file(format!("{out}/outcomes-{suite}-noise.parquet")).unwrap();
    }
    let part = |suite: &str| format!("{out}/parts/outcomes-{suite}-noise-0000.parquet");
    ["judge", "healthy"].iter().for_each(|suite| std::fs::remove_file(part(suite)).unwrap());
    let told = study(&["--suite", "judge,healthy", "--environments", "5", "--share", "1/2"]);
    assert!(told.contains("1 of 2 parts belong"), "{told}");
    let told = study(&["--suite", "learn,unseen", "--share", "2/3"]);
    assert!(told.contains("1 of 2 parts belong"), "{told}");
    study(&["--suite", "judge"]);
    study(&["--suite", "healthy", "--environments", "5", "--share", "1/1"]);
    let last = part("healthy");
    std::fs::write(&last, &std::fs::read(&last).unwrap()[..100]).unwrap();
    study(&["--suite", "healthy", "--environments", "5"]);
    assert!(["judge", "healthy"].map(read) == whole);
}

/// A plant whose twin is told a wrong temperature and whose cylinder has another friction law comes nearer to an alarm.
#[test]
fn healthy_flights_of_other_plants_are_other_flights() {
    let folder = Folder::new("healthy-other-plants");
    let [study, diagnoser] = learned(&folder);
    let fly = |study: &str, out: &str| {
        let more = ["--suite", "healthy_other_structure", "--environments", "3"];
        servotwin(&[&["study", study, "--out", out][..], &more].concat())
    };
    let none = fly(&study, &folder.file("out"));
    assert!(
        stderr(&none).contains("there are records, flights, effects, healthy, judge"),
        "{}",
        stderr(&none)
    );
    let plants = "[flights.other_plant]\nkinds = { cylinder = \"bristle_cylinder\" }\n\
                  draws = [{ parameters = [\"supply.temperature_k\"], plus = [20, 20] }]\n";
    let (wide, out) = (folder.file("wide.toml"), folder.file("wide"));
    let text = format!("{}\n{plants}", tiny());
    std::fs::write(&wide, &text).unwrap();
    // The diagnoser of the narrow study, in a folder of the wide one.
    std::fs::create_dir(&out).unwrap();
    std::fs::write(folder.file("wide/study.toml"), &text).unwrap();
    std::fs::copy(folder.file("out/system.toml"), folder.file("wide/system.toml")).unwrap();
    std::fs::copy(diagnoser, folder.file("wide/diagnoser-realistic.json")).unwrap();
    let output = fly(&wide, &out);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("healthy_other_structure, realistic: 3 healthy flights of "), "{text}");
    let evidence = |out: &str, suite: &str| -> f64 {
        let path = Path::new(out).join(format!("outcomes-{suite}-realistic.parquet"));
        Table::read(path).unwrap().f64("evidence").unwrap().iter().sum()
    };
    let usual = ["--scenario", "realistic", "--suite", "healthy", "--environments", "3"];
    servotwin(&[&["study", &wide, "--out", &out][..], &usual].concat());
    assert!(evidence(&out, "healthy_other_structure") > evidence(&out, "healthy"));
}

#[test]
#[ignore = "slow: ./check --all"]
fn settings_flown_one_after_the_other_are_those_flown_together() {
    let folder = Folder::new("one-scenario");
    let (study, together) = (folder.file("tiny.toml"), folder.file("together"));
    std::fs::write(&study, tiny()).unwrap();
    let apart = folder.file("apart");
    let fly = |out: &str, more: &[&str]| {
        let suite = if more.contains(&"--suite") { &[][..] } else { &["--suite", "flights"] };
        let output = servotwin(&[&["study", &study, "--out", out], suite, more].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        std::fs::read_to_string(Path::new(out).join("flights.json")).unwrap()
    };
    let of_both = fly(&together, &[]);
    let of_one = fly(&apart, &["--scenario", "realistic"]);
    assert!(of_one.contains("\"realistic\"") && !of_one.contains("\"noise\""), "{of_one}");
    assert_eq!(fly(&apart, &["--scenario", "noise"]), of_both);

    let text = fly(&apart, &["--suite", "missing_sensors", "--scenario", "noise"]);
    let mut flown: serde_json::Value = serde_json::from_str(&text).unwrap();
    let is_without = |m: &serde_json::Value| m["suite"] == "missing_sensors";
    let suites = flown["suites"].as_array_mut().unwrap();
    let without: Vec<_> = suites.extract_if(.., |m| is_without(m)).collect();
    assert_eq!(without.len(), 8, "{without:?}");
    let is_right = |m: &serde_json::Value| m["rates"]["wrong_shutdown"]["count"] == 0;
    assert!(without.iter().all(|m| m["flights"] == 6 && m["missing"] != "" && is_right(m)));
    // Everything else is what it was, and a suite that was flown is not flown again.
    let both: serde_json::Value = serde_json::from_str(&of_both).unwrap();
    for field in ["suites", "unseen"] {
        assert_eq!(flown[field], both[field], "{field}");
    }
    let nothing = folder.file("nothing");
    let judge = ["study", &study, "--out", &nothing, "--suite", "judge"];
    let output = servotwin(&judge);
    assert!(!output.status.success() && stderr(&output).contains("flights"), "{}", stderr(&output));
}

#[test]
#[ignore = "slow: ./check --all"]
fn what_was_measured_and_cannot_be_read_is_told_before_anything_is_flown() {
    let folder = Folder::new("unreadable");
    let (study, out) = (folder.file("tiny.toml"), folder.file("out"));
    std::fs::write(&study, tiny()).unwrap();
    let run =
        |command: &str| servotwin(&[command, &study, "--out", &out, "--quiet", "--threads", "1"]);
    let noise = ["--quiet", "--scenario", "noise"];
    let flown =
        servotwin(&[&["study", &study, "--suite", "flights", "--out", &out], &noise[..]].concat());
    assert!(flown.status.success(), "{}", stderr(&flown));
    let file = Path::new(&out).join("flights.json");
    let good = std::fs::read(&file).unwrap();
    let broken = [&good[..good.len() / 2], b"{}", b"\xff", b""];
    let refused = |command: &str, bytes: &[u8]| {
        std::fs::write(&file, bytes).unwrap();
        let output = run(command);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{text}");
        assert!(text.contains("flights.json: "), "{text}");
        assert_eq!(text.trim_end().lines().count(), 1, "{text}");
        assert_eq!(std::fs::read(&file).unwrap(), bytes);
        assert!(!Path::new(&out).join("diagnoser-realistic.json").exists(), "nothing was flown");
        assert!(!Path::new(&out).join("dataset-ideal.parquet").exists(), "nothing was simulated");
    };
    std::fs::remove_file(Path::new(&out).join("manifest.json")).unwrap();
    broken.iter().for_each(|bytes| refused("study", bytes));
    // It is counted from the outcomes of the flights, so it can be made anew.
    std::fs::write(&file, broken[0]).unwrap();
    let again = [&["study", &study, "--out", &out, "--suite", "judge"], &noise[..]].concat();
    assert!(servotwin(&again).status.success());
    assert_eq!(std::fs::read(&file).unwrap(), good);
}

#[test]
fn what_cannot_be_flown_is_told_in_one_line() {
    let folder = Folder::new("not-flown");
    let (study, out) = (folder.file("tiny.toml"), folder.file("out"));
    std::fs::write(&study, tiny().split("[flights]").next().unwrap()).unwrap();
    for command in [&["study", "--suite", "flights"][..], &["fly"]] {
        let output = servotwin(&[command, &[&study, "--out", &out]].concat());
        assert_eq!(output.status.code(), Some(2), "{command:?}");
        let text = stderr(&output);
        assert!(text.contains("no [flights]") && text.trim_end().lines().count() == 1, "{text}");
    }
    std::fs::write(&study, tiny()).unwrap();
    let output = servotwin(&["fly", &study, "--out", &out, "--duration", "never"]);
    assert!(!output.status.success() && stderr(&output).contains("--duration"), "{output:?}");
}

/// Runs a command in a folder, outside of any repository with a record.
fn in_folder(folder: &Folder, arguments: &[&str]) -> std::process::Output {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_servotwin"));
    command.current_dir(&folder.0).args(arguments).output().expect("the binary can be run")
}

#[test]
#[ignore = "slow: ./check --all"]
fn sealed_flights_are_recorded_before_they_are_flown_and_each_opening_has_other_environments() {
    let folder = Folder::new("sealed");
    let [study, _] = learned(&folder);
    let out = folder.file("out");
    let sealed = ["study", &study, "--sealed", "--out", &out, "--scenario", "noise"];
    let record =
        || std::fs::read_to_string(format!("{out}/sealed-openings.csv")).unwrap_or_default();
    let results = || -> serde_json::Value {
        let text = std::fs::read_to_string(format!("{out}/flights-sealed.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    };
    let before = std::fs::read(format!("{out}/flights.json")).unwrap();
    let output = in_folder(&folder, &sealed);
    assert!(output.status.success(), "{}", stderr(&output));
    let said = stdout(&output);
    assert!(said.starts_with("Sealed opening 1 of 1 (seed "), "{said}");
    assert!(said.contains("0 of 1 without a result"), "{said}");
    let first = results();
    assert_eq!(first["opening"]["number"], 1);
    let lines: Vec<String> = record().lines().map(str::to_owned).collect();
    assert_eq!(lines.len(), 3, "{lines:?}");
    let seed = first["opening"]["seed"].as_u64().unwrap();
    assert!(lines[1].starts_with("1,opened,") && lines[1].contains(&format!(",{seed},noise")));
    assert!(lines[2].starts_with("1,judged,") && lines[2].contains("healthy shutdowns"));
    assert_eq!(std::fs::read(format!("{out}/flights.json")).unwrap(), before);

    // An opening that cannot write its results counts, and the next one is another.
    std::fs::remove_file(format!("{out}/flights-sealed.json")).unwrap();
    std::fs::create_dir(format!("{out}/flights-sealed.json")).unwrap();
    assert!(!in_folder(&folder, &sealed).status.success());
    assert!(record().lines().last().unwrap().starts_with("2,opened,"), "{}", record());
    std::fs::remove_dir(format!("{out}/flights-sealed.json")).unwrap();
    let said = stdout(&in_folder(&folder, &sealed));
    assert!(said.contains("Sealed opening 3 of 3") && said.contains("1 of 3 without"), "{said}");
    let third = results();
    assert_ne!(third["opening"]["seed"], seed);
    // Other environments, specimens and noise: not all times are the same.
    let times = |of: &serde_json::Value| of["results"]["suites"][0]["classes"].clone();
    assert_ne!(times(&first), times(&third));

    // A mistake before the opening costs none, and a damaged record is named with its line.
    let all = record();
    let none = folder.file("none");
    let missing = ["study", &study, "--sealed", "--out", &none];
    let output = in_folder(&folder, &missing);
    assert!(stderr(&output).contains("diagnoser-noise.json"), "{}", stderr(&output));
    assert!(!Path::new(&none).join("sealed-openings.csv").exists());
    std::fs::write(format!("{out}/sealed-openings.csv"), all.replace("2,opened", "2,closed"))
        .unwrap();
    let output = in_folder(&folder, &sealed);
    assert!(stderr(&output).contains("line 4"), "{}", stderr(&output));
}

#[test]
fn in_a_repository_openings_are_recorded_there() {
    let folder = Folder::new("sealed-repository");
    let [study, _] = learned(&folder);
    let (out, inside) = (folder.file("out"), folder.0.join("deep/inside"));
    std::fs::create_dir_all(folder.0.join("sealed")).unwrap();
    std::fs::create_dir_all(&inside).unwrap();
    let head = include_str!("../../../../sealed/openings.csv").lines().next().unwrap();
    std::fs::write(folder.0.join("sealed/openings.csv"), format!("{head}\n")).unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_servotwin"));
    let sealed = ["study", &study, "--sealed", "--out", &out, "--scenario", "noise", "-q"];
    let output = command.current_dir(&inside).args(sealed).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let record = std::fs::read_to_string(folder.0.join("sealed/openings.csv")).unwrap();
    assert_eq!(record.lines().count(), 3, "{record}");
    assert!(!Path::new(&out).join("sealed-openings.csv").exists());
}

/// Specimens with a tolerance, and tests of two seconds on the ground.
const GROUND: &str = r#"
[ground_test]
command = "sine:amplitude=5deg,frequency=1Hz"
duration_s = 5
inputs.load_factor = [0, 0]
wear = [{ parameters = ["cylinder.coulomb_friction_n"], times = [0.9, 1.1] }]
[ground_test.suites]
learn = { environments = 4, repeats = 4, healthy = 2 }
judge = { environments = 2, repeats = 1, healthy = 1 }
"#;

#[test]
fn a_test_on_the_ground_decides_once_about_faults_that_were_there_before() {
    let folder = Folder::new("ground-test");
    let (study, out) = (folder.file("tiny.toml"), folder.file("out"));
    std::fs::write(&study, tiny()).unwrap();
    let without = servotwin(&["test", &study, "--out", &out]);
    assert!(!without.status.success());
    assert!(stderr(&without).contains("the study has no [ground_test]"), "{}", stderr(&without));
    assert!(!Path::new(&out).exists());
    let tolerances = "healthy = 2\ntolerances = [{ parameters = [\"servo_valve.null_bias\"], sigma = 0.005, absolute = true }]\n";
    std::fs::write(
        &study,
        tiny().replace("healthy = 2\n[flights]", &format!("{tolerances}[flights]")) + GROUND,
    )
    .unwrap();
    let tested = servotwin(&["test", &study, "--out", &out]);
    assert!(tested.status.success(), "{}", stderr(&tested));
    let text = stdout(&tested);
    assert!(text.contains("\nfitted: 6 runs with a fault, 0 not finished\n"), "{text}");
    let ground = format!("{out}/ground_test");
    let rows = Table::read(format!("{ground}/outcomes-judge-fitted.parquet")).unwrap();
    let rows = outcome::from_table(&rows).unwrap();
    assert_eq!(rows.len(), 8);
    // The decision comes at the end, and the strong bias of the valve is not missed.
    let decided = |row: &RunOutcome| row.first_word_s.is_none_or(|at| (at - 4.98).abs() < 1e-9);
    assert!(rows.iter().all(decided), "{rows:?}");
    let bias = rows.iter().filter(|row| row.kind.starts_with("servo_valve.bias"));
    assert!(bias.clone().all(|row| row.right_action_s.is_some()), "{rows:?}");
    assert!(rows.iter().all(|row| row.early_alarms == 0), "a healthy actuator passes its test");
    // The folder is that of a study: another suite of it is flown with what was learned, and a log is judged.
    let more = servotwin(&["study", &ground, "--suite", "healthy", "--environments", "2"]);
    assert!(more.status.success(), "{}", stderr(&more));
    let report = servotwin(&["report", &ground]);
    assert!(report.status.success(), "{}", stderr(&report));
    let results = stdout(&servotwin(&["report", &ground, "--markdown"]));
    let made = "servotwin test tiny --out out\nservotwin report out/ground_test --markdown";
    assert!(results.contains(made), "{results}");
    let model = format!("{ground}/diagnoser-fitted.json");
    let log = folder.file("log.csv");
    let simulated = [
        "simulate",
        "aileron_dual",
        "--command",
        "sine:amplitude=5deg,frequency=1Hz",
        "--input",
        "load_factor=0",
    ];
    let fault = [
        "--noise",
        "1",
        "--duration",
        "5s",
        "--fault",
        "actuator_1.servo_valve.bias_positive=1",
        "--out",
        &log,
    ];
    let simulated = servotwin(&[&simulated[..], &fault].concat());
    assert!(simulated.status.success(), "{}", stderr(&simulated));
    let watched = servotwin(&["watch", &log, "--study", &study, "--model", &model]);
    assert!(
        stdout(&watched).contains("4.98 s  isolated, raised: actuator 1, shut down"),
        "{}",
        stdout(&watched)
    );
    // A command that leaves the range of the test leaves nothing to judge.
    let large = ["--command", "sine:amplitude=9deg,frequency=1Hz", "--duration", "5s"];
    let output = servotwin(&[&["simulate", "aileron_dual"], &large[..], &["--out", &log]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let watched = servotwin(&["watch", &log, "--study", &study, "--model", &model]);
    let told = stderr(&watched);
    assert_eq!(watched.status.code(), Some(3), "{told}");
    assert!(told.contains("command lies outside of -0.131 … 0.131 rad by up to 0.026"), "{told}");
}
