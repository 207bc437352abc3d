//! What a new user does in the first hour: the catalogue, a template, checks, variations of a run.

use super::{Folder, SPRING, json, servotwin, stderr, stdout};

const STEP: [&str; 6] = ["--command", "step:size=2deg", "--duration", "300ms", "-q", "--json"];

#[test]
fn components_are_listed_described_and_found() {
    let list = stdout(&servotwin(&["catalog"]));
    let all = json(&["catalog", "--json"]);
    let all = all["components"].as_array().unwrap();
    assert!(all.len() >= 30, "{}", all.len());
    for one in all {
        assert!(list.contains(one["kind"].as_str().unwrap()), "{}", one["kind"]);
    }
    let valve = stdout(&servotwin(&["catalog", "servo_valve"]));
    for part in ["(W1)", "spool_position", "clogging_pa", "natural_frequency_hz", "2000 Hz"] {
        assert!(valve.contains(part), "{part}:\n{valve}");
    }
    let found = stdout(&servotwin(&["catalog", "stribeck"]));
    assert!(found.contains("cylinder:") && !found.contains("tank:"), "{found}");
    let pages = stdout(&servotwin(&["catalog", "--markdown"]));
    // A page each, one of all of them, which has no line before it, and one on fluids.
    assert_eq!(pages.matches("\n## ").count(), all.len() + 1);
    let oils = stdout(&servotwin(&["catalog", "hlp"]));
    assert!(oils.contains("hlp_46") && !oils.contains("phosphate_ester"), "{oils}");
    let wrong = servotwin(&["catalog", "servo_vlave"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(stderr(&wrong).contains("did you mean 'servo_valve'?"), "{}", stderr(&wrong));
    let word = servotwin(&["catalog", "pmp"]);
    assert!(stderr(&word).contains("did you mean 'pump'?"), "{}", stderr(&word));
    // A kind of fluid is described by its keys.
    let own = stdout(&servotwin(&["catalog", "own"]));
    assert!(own.contains("keys of [fluids.NAME]") && own.contains("viscosity_40_m2_s"), "{own}");
    let points = stdout(&servotwin(&["catalog", "table"]));
    assert!(points.contains("keys of each of its points:\nkey"), "{points}");
}

#[test]
fn a_template_says_what_it_is_and_what_else_there_is() {
    let folder = Folder::new("like");
    let init =
        |name: &str| stdout(&servotwin(&["init", name, "--out", &folder.0.display().to_string()]));
    let servo = "both are of a servo actuator against a spring; --like aileron_dual writes two servo actuators on one load \
                 instead; --like press_axis writes the axis of a press instead";
    assert!(init("presse").contains(servo));
    assert!(init("my_press").contains("both are of the axis of a press; --like servo_actuator"));
}

#[test]
fn a_state_at_rest_has_no_digits_of_noise() {
    for system in ["aileron_dual", "spring_actuator", "press_axis"] {
        let text = stdout(&servotwin(&["describe", system]));
        let states = text.split("States at rest").nth(1).unwrap().split("\n\n").next().unwrap();
        let noise = states.lines().filter(|line| {
            let rest = line.split_whitespace().nth(1).unwrap_or_default();
            rest.parse::<f64>().is_ok_and(|rest| rest != 0.0 && rest.abs() < 1e-15)
        });
        assert_eq!(noise.count(), 0, "{states}");
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_template_is_checked_simulated_and_studied() {
    let folder = Folder::new("init");
    let place = folder.0.display().to_string();
    let made = json(&["init", "axis", "--out", &place, "--json"]);
    let (system, study) = (made["system"].as_str().unwrap(), made["study"].as_str().unwrap());
    for file in [system, study] {
        let checked = servotwin(&["check", file]);
        assert!(checked.status.success(), "{}", stderr(&checked));
    }
    let run = json(&[&["simulate", system], &STEP[..]].concat());
    assert_eq!(run["system"], "axis");
    // Nothing of the user's is overwritten.
    let again = servotwin(&["init", "axis", "--out", &place]);
    assert_eq!(again.status.code(), Some(2));
    assert!(stderr(&again).contains("axis.toml is there already"), "{}", stderr(&again));
    assert_eq!(servotwin(&["init", "My Press"]).status.code(), Some(2));
    // A short version of the study, to its report.
    let text = std::fs::read_to_string(study).unwrap();
    let short = [
        ("duration_s = 10", "duration_s = 4"),
        ("duration_s = 10", "duration_s = 4"),
        ("intensities = [0.25, 0.5, 0.75, 1.0]", "intensities = [0.5, 1.0]"),
        ("healthy = 20", "healthy = 4"),
        ("healthy = 10", "healthy = 4"),
    ];
    let text = short.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    });
    std::fs::write(study, text).unwrap();
    let out = folder.file("out");
    let done = servotwin(&["study", study, "--out", &out, "--threads", "1"]);
    assert!(done.status.success(), "{}", stderr(&done));
    assert!(std::path::Path::new(&out).join("report.html").is_file());
}

#[test]
fn built_in_names_stand_wherever_a_file_is() {
    assert_eq!(
        json(&[&["simulate", "spring_actuator"], &STEP[..]].concat()),
        json(&[&["simulate", SPRING], &STEP[..]].concat())
    );
    assert_eq!(json(&["describe", "valve_and_cylinder", "--json"])["name"], "valve_and_cylinder");
    for (name, kind) in [("aileron_dual", "system"), ("paper", "study")] {
        assert_eq!(json(&["check", name, "--json"])[kind]["name"], name);
    }
    // Of a name that stands for both, both are told, in one document.
    let both = json(&["check", "press_axis", "--json"]);
    assert!(["system", "study"].iter().all(|kind| both[*kind]["name"] == "press_axis"), "{both}");
    let traces = concat!(env!("CARGO_MANIFEST_DIR"), "/../../studies/liu_engine.toml");
    let told = json(&["check", traces, "--json"]);
    assert_eq!(told["recordings"]["sensors"], 42);
    let told = servotwin(&["study", traces, "--suite", "records"]);
    assert!(stderr(&told).contains("this is a study of recordings, not a study"), "{told:?}");
}

#[test]
fn studies_are_checked_with_their_places() {
    let folder = Folder::new("check_study");
    let wrong = folder.file("wrong.toml");
    let text = include_str!("../../../../studies/spring_actuator.toml")
        .replace("input = \"command\"", "input = \"comand\"")
        .replace("\"leakage_a.leakage\"", "\"leakage_x.leakage\"");
    let nameless = text.replacen("detail = \"", "detail = \"\" # \"", 1);
    std::fs::write(&wrong, nameless).unwrap();
    let told = stderr(&servotwin(&["check", &wrong]));
    assert!(told.contains("'detail' is empty") && told.contains("3 mistakes"), "{told}");
    std::fs::write(&wrong, text).unwrap();
    let output = servotwin(&["check", &wrong]);
    assert_eq!(output.status.code(), Some(3));
    let told = stderr(&output);
    for part in ["wrong.toml:18:9: there is no input of the system 'comand'", "nearest: 'command'"]
    {
        assert!(told.contains(part), "{told}");
    }
    assert!(told.contains("'leakage_x.leakage'") && told.contains("2 mistakes"), "{told}");
    let output = servotwin(&["check", &wrong, "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["mistakes"].as_array().unwrap().len(), 2);
    assert_eq!(report["mistakes"][0]["line"], 18);
}

#[test]
fn a_fault_that_changes_nothing_is_told_with_its_place() {
    let folder = Folder::new("inert");
    let (system, study) = (folder.file("system.toml"), folder.file("study.toml"));
    let text = include_str!("../../../../systems/spring_actuator.toml");
    let cylinder = "kind = \"cylinder\"\n";
    assert!(text.contains(cylinder));
    let smooth = text.replace(cylinder, &format!("{cylinder}coulomb_friction_n = 0\n"));
    std::fs::write(&system, smooth).unwrap();
    let class = "[[classes]]\ndetail = \"friction\"\naction = \"warning\"\nfaults = [\n\
                 \"cylinder.friction\",\n\"cylinder.viscous_friction\"]\n\n[[classes]]";
    let text = include_str!("../../../../studies/spring_actuator.toml")
        .replace("system = \"spring_actuator\"", "system = \"system.toml\"")
        .replacen("[[classes]]", class, 1);
    std::fs::write(&study, &text).unwrap();
    let line = 1 + text.lines().position(|line| line == "\"cylinder.friction\",").unwrap();
    let says = "the fault 'cylinder.friction' changes nothing: 'coulomb_friction_n' of 'cylinder' stays 0 N at \
                every intensity";
    let output = servotwin(&["check", &study, "--json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let sentence = format!("warning: {study}:{line}:1: {says}");
    let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        told["study"]["warnings"],
        serde_json::json!([{ "sentence": sentence, "line": line, "column": 1, "message": says }])
    );
    assert!(stdout(&servotwin(&["check", &study])).contains(&sentence));
    assert!(stdout(&servotwin(&["check", &study, "--quiet"])).is_empty());
    // Where it runs, it is told as well; this one cannot go on, because its folder is a file.
    let begun = servotwin(&["study", &study, "--out", &study]);
    assert!(stderr(&begun).starts_with("warning: ") && stderr(&begun).contains(says));
    // In specimens whose friction is not exactly zero the fault acts.
    let tolerance = "[\"cylinder.coulomb_friction_n\"], sigma = ";
    let absolute =
        text.replace(&format!("{tolerance}0.1"), &format!("{tolerance}1, absolute = true"));
    assert_ne!(text, absolute);
    std::fs::write(&study, absolute).unwrap();
    let output = servotwin(&["check", &study]);
    assert!(!stdout(&output).contains("warning"), "{}", stdout(&output));
    for study in ["paper", "spring_actuator", "press_axis"] {
        let output = servotwin(&["check", study]);
        assert!(!stdout(&output).contains("warning"), "{study}: {}", stdout(&output));
    }
}

#[test]
fn the_first_twenty_mistakes_are_shown() {
    let folder = Folder::new("many");
    let wrong = folder.file("wrong.toml");
    let parts = (0..50).map(|n| format!("[components.v{n}]\nkind = \"volum\"\n"));
    std::fs::write(&wrong, format!("format = 1\nname = \"many\"\n{}", parts.collect::<String>()))
        .unwrap();
    let told = stderr(&servotwin(&["check", &wrong]));
    assert_eq!(told.matches("unknown kind of component").count(), 20, "{told}");
    assert!(told.contains("50 mistakes, of which the first 20 are shown"), "{told}");
}

#[test]
fn parameters_are_set_and_swept() {
    let run = |more: &[&str]| json(&[&["simulate", SPRING], &STEP[..], more].concat());
    let nominal = run(&[]);
    let same = run(&["--set", "spring.stiffness_n_m=5.3e5"]);
    assert_eq!(same["recorded"], nominal["recorded"], "the nominal value changes nothing");
    let stiff = run(&["--set", "spring.stiffness_n_m=9e5", "--set", "controller.gain_per_m=200"]);
    assert_ne!(stiff["recorded"], nominal["recorded"]);
    assert_eq!(stiff["set"][1]["value"], 200.0);

    // A run of a sweep is the run with that value.
    let swept = run(&["--sweep", "spring.stiffness_n_m=5.3e5:9e5:3"]);
    let of = |swept: &serde_json::Value, value: f64| {
        let rows = swept["recorded"].as_array().unwrap().iter();
        let own = rows.filter(|row| row["value"] == value).cloned();
        let without = own.map(|mut row| {
            row.as_object_mut().unwrap().remove("value");
            row
        });
        serde_json::Value::Array(without.collect())
    };
    assert_eq!(of(&swept, 5.3e5), nominal["recorded"]);
    assert_eq!(of(&swept, 9e5), run(&["--set", "spring.stiffness_n_m=9e5"])["recorded"]);
    let faulty = run(&["--sweep", "servo_valve.clogging_pa=0:1:2"]);
    let worst = run(&["--fault", "servo_valve.clogging_pa=1"]);
    assert_eq!(of(&faulty, 0.0), nominal["recorded"]);
    assert_eq!(of(&faulty, 1.0), worst["recorded"]);

    let folder = Folder::new("sweep");
    let (csv, svg) = (folder.file("a.csv"), folder.file("a.svg"));
    let sweep = ["--sweep", "supply.pressure_pa=150bar:200bar:2", "--record", "x_p"];
    run(&[&sweep[..], &["--out", &csv, "--plot", &svg]].concat());
    let table = servotwin::table::Table::read(&csv).unwrap();
    assert_eq!(table.row_count(), 2 * 31);
    assert_eq!(table.f64("supply.pressure_pa").unwrap()[31], 2e7);
    assert!(std::fs::read_to_string(&svg).unwrap().contains("x_p at 200 bar"));
    let people =
        stdout(&servotwin(&[&["simulate", SPRING, "--duration", "50ms"], &sweep[..]].concat()));
    assert!(people.contains("150 bar") && people.contains("supply.pressure_pa"), "{people}");
}

#[test]
fn impossible_parameters_and_inputs_are_refused() {
    let cases: &[(&[&str], &str)] = &[
        (&["--set", "spring.stiffness_n_m=-1"], "allowed are 0 … 1e12 N/m"),
        (&["--set", "spring.stifness_n_m=1"], "did you mean 'spring.stiffness_n_m'?"),
        (&["--set", "controller.gain=3"], "did you mean 'controller.gain_per_m'?"),
        (&["--set", "supply.pressure_pa=20mm"], "wrong unit"),
        (&["--set", "supply.temperature_k=300"], "'supply' and 'tank' are in one circuit"),
        (&["--set", "supply.temperature_k=470", "--set", "tank.temperature_k=470"], "out of range"),
        (&["--set", "cylinder.stroke_half_m=1"], "impossible"),
        (&["--sweep", "spring.stiffness_n_m=0:1"], "such as 0:1:5"),
        (&["--sweep", "spring.stiffness_n_m=0:1:1"], "from 2 to 1000"),
        (&["--sweep", "servo_valve.clogging_pa=0:1.5:3"], "allowed are 0 … 1"),
        (&["--sweep", "servo_valve.clogging=0:1:3"], "did you mean 'servo_valve.clogging_"),
        (
            &["--sweep", "servo_valve.clogging_pa=0:1:3", "--fault", "servo_valve.clogging_pa=1"],
            "given twice",
        ),
        (&["--command", "1000deg"], "'command' becomes 1000 °, but allowed are -90 … 90 °"),
        (
            &["--input", "supply_pressure=-100bar"],
            "'supply_pressure' becomes -100 bar, but allowed are 0.1 … 1000 bar",
        ),
    ];
    for (more, message) in cases {
        let output =
            servotwin(&[&["simulate", "spring_actuator", "--duration", "50ms"], *more].concat());
        let told = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{more:?}: {told}");
        assert!(told.contains(message), "{more:?}: {told}");
    }
    // The aileron's inputs as the issue has them: mode 2, 50 km, faster than sound.
    for input in ["actuator_1.mode=2", "altitude=50000m", "air_speed=400m/s"] {
        let output = servotwin(&["simulate", "--duration", "50ms", "--input", input]);
        assert_eq!(output.status.code(), Some(2), "{input}: {}", stderr(&output));
    }
}

#[test]
fn schemas_are_written() {
    for format in ["system", "study"] {
        let schema = json(&["tools", "schema", format]);
        assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    }
}

#[test]
fn what_cannot_be_is_told_with_the_exit_code_of_the_help() {
    let folder = Folder::new("codes");
    let (ragged, nan) = (folder.file("ragged.csv"), folder.file("nan.csv"));
    std::fs::write(&ragged, "a,b\n1,2\n3\n").unwrap();
    std::fs::write(&nan, "a,mode\n1,x\n2,y\n3,x\n4,y\n5,x\n6,y\n7,x\n8,y\n9,x\n1,y\n").unwrap();
    let study = |name: &str, records: &str, measured: &str| {
        let text = format!(
            "format = 1\nrecords = \"{records}\"\nwindow_rows = 2\n\
             [[sensors]]\nname = \"p\"\nmeasured = \"{measured}\"\nnominal_from = []\n"
        );
        let path = folder.file(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let broken = study("broken.toml", "ragged.csv", "a");
    let other = study("other.toml", "nan.csv", "pressure");
    let unhealthy = study("unhealthy.toml", "nan.csv", "a");
    let (empty, unusable) = (folder.file("empty"), folder.file("unusable"));
    for path in [&empty, &unusable] {
        std::fs::create_dir_all(path).unwrap();
    }
    std::fs::write(format!("{unusable}/a.csv"), "").unwrap();
    let cases: &[(&[&str], i32, &str)] = &[
        (&["study", &broken], 3, "line 3"),
        (&["study", &other], 3, "there is no column 'pressure'"),
        (&["study", &unhealthy], 3, "but no row is healthy: name them in [healthy]"),
        (&["history", "/nowhere"], 3, "error: /nowhere: no such folder"),
        (&["history", &empty], 3, "the folder has no logs"),
        (&["history", &unusable], 3, "none of its logs can be used; a.csv: the file is empty"),
        (&["simulate", SPRING, "--duration", "-1"], 2, "--duration -1 is out of range"),
        (
            &["simulate", SPRING, "--command", "noise:rms=1deg,bandwidth=1Hz,window=90000s"],
            2,
            "'window' must hold at most 1000000 samples",
        ),
        (
            &["simulate", SPRING, "--command", "noise:rms=1deg,bandwidth=1Hz,window=1e15s"],
            2,
            "more than 10 million points",
        ),
        (
            &[
                "simulate",
                SPRING,
                "--command",
                "sine:amplitude=1deg,frequency=1kHz",
                "--duration",
                "1e6s",
            ],
            2,
            "more than 10 million points",
        ),
        (
            &[
                "simulate",
                SPRING,
                "--command",
                "sweep:amplitude=1deg,from=1Hz,to=1000Hz",
                "--duration",
                "1e6s",
            ],
            2,
            "more than 10 million points",
        ),
        (
            &["simulate", SPRING, "--method", "rk4", "--step", "1000us", "--duration", "1s"],
            1,
            "a value became infinite or not a number",
        ),
    ];
    for (arguments, code, message) in cases {
        let output = servotwin(arguments);
        let told = stderr(&output);
        assert_eq!(output.status.code(), Some(*code), "{arguments:?}: {told}");
        assert!(told.contains(message), "{arguments:?}: {told}");
        assert!(!told.contains("panicked"), "{arguments:?}: {told}");
    }
}

/// Whenever a study is asked to end, it says so, with the exit code of the help.
#[cfg(unix)]
/// Waits until a program catches SIGINT: on a busy machine that may take longer than any fixed time.
fn wait_for_handler(id: u32) {
    const SIGINT: u64 = 1 << 1;
    let catches = || {
        let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:"))?;
        Some(u64::from_str_radix(mask.trim(), 16).ok()? & SIGINT != 0)
    };
    while catches() == Some(false) {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_study_that_is_stopped_early_says_so() {
    let folder = Folder::new("stopped");
    for (signal, after_ms) in [("-INT", 60), ("-INT", 250), ("-TERM", 400), ("-INT", 700)] {
        let wait = || std::thread::sleep(std::time::Duration::from_millis(after_ms));
        let last = last_words_of_stopped_study(&folder.file("early"), signal, wait);
        // Before it is at work there is nothing to go on with.
        assert!([ON_THE_WAY, "stopped"].contains(&&*last), "{signal} after {after_ms} ms: {last}");
    }
    let out = folder.file("late");
    let wait = || {
        while !std::path::Path::new(&out).join("study.toml").exists() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    };
    assert_eq!(last_words_of_stopped_study(&out, "-INT", wait), ON_THE_WAY);
}

const ON_THE_WAY: &str = "stopped; the same command again goes on where it was";

/// The last line of a study that gets a signal after a wait.
fn last_words_of_stopped_study(out: &str, signal: &str, wait: impl Fn()) -> String {
    let child = std::process::Command::new(env!("CARGO_BIN_EXE_servotwin"))
        .args(["study", "--out", out])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    wait_for_handler(child.id());
    wait();
    let kill = std::process::Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(kill.unwrap().success());
    let output = child.wait_with_output().unwrap();
    let told = stderr(&output);
    assert_eq!(output.status.code(), Some(130), "{signal}: {told}");
    assert!(output.stdout.is_empty());
    told.trim_end().lines().last().unwrap_or_default().to_owned()
}

/// Figures of safety belong to the commands that the study says switch off, whatever their name.
#[test]
fn safety_does_not_hang_on_a_name() {
    let folder = Folder::new("safety");
    let study = |name: &str, reaction: &str| {
        let text = include_str!("../../../../studies/spring_actuator.toml")
            .replace("duration_s = 30", "duration_s = 4")
            .replace("[0.2, 0.4, 0.6, 0.8, 1.0]", "[0.4, 0.6, 0.8, 1.0]")
            .replace("values.low = 17.0e6", "")
            .replace("healthy = 20", "healthy = 3")
            .replace("shut_down = { switches_off = true }", reaction)
            .replace("\"shut_down\"", &format!("\"{name}\""));
        let path = folder.file(&format!("{name}.toml"));
        std::fs::write(&path, text).unwrap();
        let out = folder.file(name);
        let output = servotwin(&["study", &path, "--out", &out, "-q"]);
        assert!(output.status.success(), "{}", stderr(&output));
        let results = std::fs::read_to_string(format!("{out}/evaluation.json")).unwrap();
        let results: serde_json::Value = serde_json::from_str(&results).unwrap();
        let protocols = results["subjects"][0]["evaluation"]["protocols"].as_array().unwrap();
        let unseen = protocols.iter().find(|p| p["protocol"] == "unseen_intensity").unwrap();
        ["shutdown_missed_of_all", "shutdown_missed", "needless_shutdown"]
            .map(|measure| unseen["rates"][measure].clone())
    };
    let usual = study("shut_down", "shut_down = { switches_off = true }");
    assert!(usual[0]["of"].as_u64().unwrap() > 0, "{usual:?}");
    assert_eq!(study("a_stop", "a_stop = { switches_off = true }"), usual);
    // A study that says of no command that it switches off has no figures of safety.
    assert!(study("nothing", "").iter().all(serde_json::Value::is_null));
}

#[test]
fn a_run_that_does_not_begin_at_rest_says_so() {
    // A loop that is sampled too slowly for its gain swings for ever.
    let folder = Folder::new("on-the-move");
    let place = folder.0.display().to_string();
    json(&["init", "sampled", "--out", &place, "--json"]);
    let path = folder.file("sampled.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let sampled = "kind = \"sampled_position_controller\"\nperiod_s = 0.05";
    let text = text.replace("kind = \"position_controller\"", sampled);
    std::fs::write(&path, text).unwrap();
    let first = ["simulate", &path, "--command", "3deg", "--duration", "50ms", "--json"];
    let sampled = |gain: &str| {
        servotwin(&[&first[..], &["--set", &format!("controller.gain_per_m={gain}")]].concat())
    };
    let told = |output: &std::process::Output| stdout(output).contains("no rest was found");
    let at_rest = |output: &std::process::Output| -> serde_json::Value {
        let run: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        run["starts_at_rest"].clone()
    };
    let (usual, swinging) = (sampled("250"), sampled("4000"));
    assert!(!told(&usual) && told(&swinging), "{}", stderr(&swinging));
    assert!(stdout(&swinging).contains("a limit cycle was measured"), "{}", stdout(&swinging));
    assert_eq!((at_rest(&usual), at_rest(&swinging)), (true.into(), false.into()));
    // A loop whose sensor answers late and a valve that rings have a rest, and it is found.
    for fault in ["actuator_1.sensor_ram.lag=1", "actuator_1.servo_valve.damping_loss=0.7"] {
        let first = ["simulate", "--command", "5deg", "--duration", "50ms", "--json"];
        let run = servotwin(&[&first[..], &["--fault", fault]].concat());
        assert!(!told(&run) && at_rest(&run) == true, "{}", stderr(&run));
    }
}

#[test]
fn no_run_begins_below_vacuum() {
    // Implicit steps on the way to rest would end there, and the run would stay.
    let pressures = "cylinder.pressure_a_pa,cylinder.pressure_b_pa,accumulator.pressure_pa";
    let tail = ["--record", pressures, "--duration", "50ms", "--json"];
    let starved: [&[&str]; 2] = [
        &["--fault", "pump.set_pressure_loss=1", "--input", "process_force=-30kN"],
        &["--set", "pump.flow_m3_s=0", "--command", "step:size=100mm"],
    ];
    for how in starved {
        let run = json(&[&["simulate", "press_axis"], how, &tail].concat());
        for pressure in run["recorded"].as_array().unwrap() {
            assert!(pressure["min"].as_f64().unwrap() > 0.0, "{how:?}: {pressure}");
        }
    }
}

/// Whoever gives one file where the other is wanted is told that, and nothing else.
#[test]
fn a_system_is_told_from_a_study() {
    let folder = Folder::new("kinds");
    let (system, study) = (folder.file("system.toml"), folder.file("study.toml"));
    std::fs::write(&system, include_str!("../../../../systems/spring_actuator.toml")).unwrap();
    std::fs::write(&study, include_str!("../../../../studies/spring_actuator.toml")).unwrap();
    let cases: &[(&[&str], &str, &str)] = &[
        (&["study", &system], "this is a system, not a study", "'servotwin init' writes one"),
        (&["study", "aileron_dual"], "this is a system, not a study", "aileron_dual.toml:1:1"),
        (&["simulate", &study], "this is a study, not a system", "of the system 'spring_actuator'"),
        (&["describe", "paper"], "this is a study, not a system", "of the system 'aileron_dual'"),
        (
            &["fit", "/nowhere.csv", "--study", &system],
            "this is a system, not a study",
            "1 mistake",
        ),
    ];
    for (arguments, what, help) in cases {
        let output = servotwin(arguments);
        let told = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{arguments:?}: {told}");
        assert!(told.contains(what) && told.contains(help), "{arguments:?}: {told}");
        assert!(
            told.ends_with(
                ": 1 mistake
"
            ),
            "{arguments:?}: {told}"
        );
    }
}

#[test]
fn what_an_aircraft_flies_is_shown_in_metres() {
    let run = servotwin(&[
        "simulate",
        "--input",
        "altitude=3000m",
        "--input",
        "air_speed=150m/s",
        "--duration",
        "50ms",
        "--record",
        "altitude,air_speed,x_p_1",
        "-q",
    ]);
    assert!(run.status.success(), "{}", stderr(&run));
    let text = stdout(&servotwin(&[
        "simulate",
        "--input",
        "altitude=3000m",
        "--duration",
        "50ms",
        "--record",
        "altitude,air_speed,x_p_1",
    ]));
    let unit = |name: &str| {
        let line = text.lines().rfind(|line| line.starts_with(name)).unwrap();
        let cells: Vec<&str> = line.split_whitespace().collect();
        (cells[1].to_owned(), cells[2].to_owned())
    };
    assert_eq!(unit("altitude "), ("3000".into(), "m".into()));
    assert_eq!(unit("air_speed "), ("150".into(), "m/s".into()));
    assert_eq!(unit("x_p1").1, "mm");
    let told = stderr(&servotwin(&["simulate", "--duration", "50ms", "--input", "altitude=50km"]));
    assert!(told.contains("becomes 50000 m, but allowed are -2000 … 20000 m"), "{told}");
}

#[test]
fn a_press_begins_as_a_press() {
    let folder = Folder::new("init-press");
    let place = folder.0.display().to_string();
    for (name, more) in [("press", &[][..]), ("mine", &["--like", "press_axis"])] {
        let made = json(&[&["init", name, "--out", &place, "--json"], more].concat());
        let (system, study) = (made["system"].as_str().unwrap(), made["study"].as_str().unwrap());
        let checked = json(&["check", study, "--json"]);
        let checked = &checked["study"];
        assert_eq!((&checked["system"], &checked["name"]), (&name.into(), &name.into()));
        let described = json(&["describe", system, "--json"]);
        assert_eq!(described["name"], name);
        let text = std::fs::read_to_string(study).unwrap();
        assert!(
            !text.contains("press_axis") && text.contains(&format!("{name}_study.toml")),
            "{text}"
        );
    }
    let told = stdout(&servotwin(&["init", "my_press", "--out", &place]));
    assert!(told.contains("my_press.toml --command step:size=50mm"), "{told}");
    let run = json(&[
        "simulate",
        &folder.file("press.toml"),
        "--command",
        "step:size=50mm",
        "--duration",
        "1s",
        "-q",
        "--json",
    ]);
    let ram =
        run["recorded"].as_array().unwrap().iter().find(|one| one["name"] == "x_p_m").unwrap();
    assert!((ram["end"].as_f64().unwrap() - 0.05).abs() < 2e-3, "{ram}");
}

#[test]
fn two_actuators_begin_as_an_assembly() {
    let folder = Folder::new("init-dual");
    let place = folder.0.display().to_string();
    let made = json(&["init", "twins", "--like", "aileron_dual", "--out", &place, "--json"]);
    let (system, study) = (made["system"].as_str().unwrap(), made["study"].as_str().unwrap());
    let checked = json(&["check", study, "--json"]);
    let checked = &checked["study"];
    assert_eq!((&checked["system"], &checked["name"]), (&"twins".into(), &"twins".into()));
    let text = std::fs::read_to_string(system).unwrap();
    assert_eq!(text.matches("kind = \"servo_valve\"").count(), 1, "each part is written once");
    let ends = |more: &[&str]| {
        let fixed =
            ["simulate", system, "--command", "step:size=5deg", "--duration", "2s", "-q", "--json"];
        let run = json(&[&fixed[..], more].concat());
        let recorded = run["recorded"].as_array().unwrap().clone();
        ["x_p_1_m", "x_p_2_m"].map(|name| {
            let found = recorded.iter().find(|one| one["name"] == name).unwrap();
            found["end"].as_f64().unwrap()
        })
    };
    let [first, second] = ends(&[]);
    assert!((first - 4.357e-3).abs() < 1e-5 && (first - second).abs() < 1e-9, "{first} {second}");
    // One that is shut off is dragged along.
    let [dragged, alone] = ends(&["--input", "actuator_1.mode=0"]);
    assert!(alone > 4.3e-3 && dragged > 4.0e-3, "{dragged} {alone}");
}

/// What sensors show is what they declare: noise, the steps of their converters, and the same for the same seed.
#[test]
fn sensors_show_their_noise() {
    let run = |more: &[&str]| {
        let folder = Folder::new(&format!("noise{}", more.join("")));
        let csv = folder.file("a.csv");
        let first =
            ["simulate", SPRING, "--command", "2deg", "--duration", "10s", "-q", "--out", &csv];
        let output = servotwin(&[&first, more].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        servotwin::table::Table::read(&csv).unwrap()
    };
    let values =
        |table: &servotwin::table::Table, name: &str| table.f64(name).unwrap().into_owned();
    let [clean, noisy, again, other] =
        [run(&[]), run(&["--noise", "1"]), run(&["--noise", "1"]), run(&["--noise", "2"])];
    let system = servotwin::system::System::read(SPRING).unwrap();
    for sensor in &system.sensors {
        let name = servotwin::recording::with_suffix(&sensor.id, sensor.unit);
        let (a, b) = (values(&clean, &name), values(&noisy, &name));
        let square = a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64;
        let instance = &system.network().components[sensor.component];
        let at = |name: &str| instance.parameters[instance.component.parameter(name).unwrap()];
        let span = (instance.component.span)(&instance.parameters).unwrap();
        let step = span.range / 2_f64.powf(at("bits"));
        let declared = ((at("noise_sigma") * span.full_scale).powi(2) + step * step / 12.0).sqrt();
        // A thousand samples know it to three percent.
        assert!(
            (square.sqrt() / declared - 1.0).abs() < 0.12,
            "{name}: {} {declared}",
            square.sqrt()
        );
        assert!(
            b.iter().all(|value| ((value / step).round() * step - value).abs() < 1e-9 * step),
            "{name}"
        );
        assert_eq!(b, values(&again, &name));
        assert_ne!(b, values(&other, &name));
    }
    assert_eq!(values(&clean, "command_rad"), values(&noisy, "command_rad"), "no sensor");
    // A sensor's noise does not depend on what else is recorded.
    let alone = run(&["--noise", "1", "--record", "x_p"]);
    assert_eq!(values(&alone, "x_p_m"), values(&noisy, "x_p_m"));
}

/// A run that leaves the range of validity ends with a note, not with a number below zero.
#[test]
fn a_cavity_is_noted_with_place_time_and_duration() {
    let folder = Folder::new("cavity");
    let slam = include_str!("../../../servotwin/tests/cavitation/slam.toml");
    std::fs::write(folder.file("slam.toml"), slam).unwrap();
    let system = folder.file("slam.toml");
    let opening = "opening=ramp:rate=100,to=1,at=0.05s + ramp:rate=-2000,to=-1,at=0.15s";
    let hard = ["--set", "valve_in.area_m2=2e-5", "--set", "valve_out.area_m2=2e-5"];
    let run = ["simulate", &system, "--input", opening, "--duration", "0.2s", "--rate", "20kHz"];
    let told = stdout(&servotwin(&[&run[..], &hard].concat()));
    assert!(told.contains("cylinder.b.pressure_pa is at vapor pressure for 0.0"), "{told}");
    let hard = json(&[&run[..], &hard, &["-q", "--json", "--record", "cylinder"]].concat());
    let outside = hard["outside_validity"].as_array().unwrap();
    let names: Vec<&str> = outside.iter().map(|one| one["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["cylinder.a.pressure_pa", "cylinder.b.pressure_pa"]);
    assert!((outside[1]["first_s"].as_f64().unwrap() - 0.158).abs() < 1e-3, "{outside:?}");
    let least = hard["recorded"].as_array().unwrap().iter().filter(|one| one["unit"] == "Pa");
    assert!(least.clone().count() == 4 && least.clone().all(|one| one["min"] == 20.0), "{hard}");
    let gentle = json(&[&run[..], &["-q", "--json"]].concat());
    assert_eq!(gentle["outside_validity"].as_array().unwrap().len(), 0, "{gentle}");
}
