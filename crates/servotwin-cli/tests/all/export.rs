//! A diagnosis as C, exported and proven as users do it.

use super::flights::learned;
use super::{Folder, fails, servotwin, stderr, stdout, succeeds};
use servotwin::learn::model_file;
use servotwin::live::observer::Observer;
use servotwin::live::runtime::{between, defaults, slots};
use servotwin::live::watcher::Watcher;
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::{Diagnoser, IndexedFinding, Outcome};
use servotwin_model::program::FaultAt;
use servotwin_model::solver::{Knot, SolverSettings, Twin};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

/// A folder with a trained diagnoser, and its export.
fn exported(name: &str) -> (Folder, String, String) {
    let folder = Folder::new(name);
    learned(&folder);
    let (model, out) = (folder.file("out/diagnoser-noise.json"), folder.file("export"));
    succeeds(&["export", "c", "--model", &model, "--out", &out]);
    (folder, model, out)
}

/// A model that was changed on purpose: without the line that holds its checksum.
fn without_checksum(model: &str, folder: &Folder) -> String {
    let other = folder.file("other.json");
    let text = fs::read_to_string(model).unwrap();
    let others = text.lines().filter(|line| !line.contains("\"sha256\""));
    fs::write(&other, others.collect::<Vec<_>>().join("\n")).unwrap();
    other
}

/// A proof that fails says so on standard output, and why.
fn assert_not_proven(command: &[&str], why: &str) {
    let output = servotwin(command);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("NOT PROVEN: the folder") && text.contains(why), "{why}: {text}");
}

/// The paths of an export mean the same in any working folder.
#[test]
#[ignore = "slow: ./check --all"]
fn an_export_is_proven_from_another_working_folder() {
    let (folder, _, _) = exported("export-elsewhere");
    let run = |place: &str, arguments: &[&str]| {
        let binary = env!("CARGO_BIN_EXE_servotwin");
        let mut command = Command::new(binary);
        let output = command.current_dir(place).args(arguments).output().unwrap();
        assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
    };
    let elsewhere = folder.file("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    let short = ["--hours", "0.001", "--variants", "1", "--compiler", "gcc -O1"];
    for (place, model, out) in [
        (folder.file("out"), "diagnoser-noise.json", "../one"),
        (folder.file("."), "out/diagnoser-noise.json", "two"),
    ] {
        run(&place, &["export", "c", "--model", model, "--out", out]);
        let out = Path::new(&place).join(out);
        run(&elsewhere, &[&["prove", out.to_str().unwrap()][..], &short].concat());
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn an_export_is_proven_until_a_digit_of_it_changes() {
    let (folder, _, out) = exported("export-proven");
    let kept = folder.file("kept");
    let work = ["--hours", "0.02", "--variants", "1", "--keep", &kept];
    let text = succeeds(&[&["prove", out.as_str()][..], &work].concat());
    for fact in ["variants of the twin            1", "without a steady state  0", "4500"] {
        assert!(text.contains(fact), "{text}");
    }
    assert!(text.contains("same bits  gcc"), "{text}");
    let kept_files = ["servotwin_session.c", "prove.c", "export.so"];
    assert!(kept_files.iter().all(|name| Path::new(&kept).join("1").join(name).exists()));
    let certificate = Path::new(&out).join("proof.json");
    let proof: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&certificate).unwrap()).unwrap();
    assert!(
        proof["holds"] == true && proof["builds"][0]["samples"].as_u64() > Some(1000),
        "{proof}"
    );

    let tables = Path::new(&out).join("servotwin_tables.c");
    let whole = fs::read_to_string(&tables).unwrap();
    let at = whole.find("_thresholds[").unwrap();
    let digit = at + whole[at..].find("p-").unwrap() - 1;
    let other = if &whole[digit..=digit] == "0" { "1" } else { "0" };
    fs::write(&tables, [&whole[..digit], other, &whole[digit + 1..]].concat()).unwrap();
    let own = ["prove", &out, "--hours", "0", "--variants", "0", "--compiler", "gcc -O1"];
    let message = fails(&own, 1);
    assert!(message.contains("NOT PROVEN"), "{message}");
    let proof = fs::read_to_string(&certificate).unwrap();
    assert!(proof.contains("\"holds\": false"), "a refused export keeps no good certificate");
    fs::write(&tables, whole).unwrap();
    let text = succeeds(&own);
    assert!(text.contains("same bits  gcc") && text.contains(" -O1 "), "{text}");
}

/// The exported main, compiled.
fn compiled_main(out: &str) -> PathBuf {
    let sources = fs::read_dir(out).unwrap().map(|entry| entry.unwrap().path());
    let sources = sources.filter(|path| path.extension().is_some_and(|ending| ending == "c"));
    let program = Path::new(out).join("diagnose");
    let flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-O1"];
    let mut compiler = Command::new("cc");
    compiler.args(flags).args(sources).arg("-o").arg(&program).arg("-lm");
    let compiled = compiler.output().unwrap();
    assert!(compiled.status.success(), "{}", stderr(&compiled));
    program
}

fn run_main(program: &Path, samples: String) -> std::process::Output {
    let mut command = Command::new(program);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut run = command.spawn().unwrap();
    let mut stdin = run.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(samples.as_bytes()).unwrap());
    let output = run.wait_with_output().unwrap();
    writer.join().unwrap();
    output
}

#[test]
#[ignore = "slow: ./check --all"]
fn the_small_main_names_a_broken_line() {
    let (_folder, _, out) = exported("export-main");
    let output = run_main(&compiled_main(&out), "nan 1 2\n".into());
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).starts_with("the last line has 3 of "), "{}", stderr(&output));
}

/// A flight with a sine as command and a leak from 4 s on; sometimes an input or a reading is missing or no possible value,
/// and for two seconds the inputs show that actuator 2 is off. Each sample has the inputs and the measured values.
fn flight(study: &Study, diagnoser: &Diagnoser) -> Vec<(Vec<f64>, Vec<f64>)> {
    let program = &study.system.program;
    let sensors = diagnoser.sensors.iter().map(|sensor| sensor.name.as_str());
    let slots = slots(study, sensors).unwrap();
    let (component, fault) = program.find_fault("actuator_1.leakage_a.leakage").unwrap();
    let leak = FaultAt { component, fault, intensity: 0.8 };
    let mut plant =
        Twin::new(program, SolverSettings::of_runs(), diagnoser.period_s, between(study));
    plant.load(&program.parameters(&[]));
    let mut samples = Vec::new();
    for k in 0..1200_usize {
        let angle = 2.0 * std::f64::consts::PI * 0.5 * k as f64 * diagnoser.period_s;
        let mut inputs = defaults(study);
        inputs[study.command_input] = Knot::from(0.08 * angle.sin());
        if k == 400 {
            plant.load(&program.parameters(&[leak]));
        }
        match k {
            0 => plant.settle(&inputs, &program.first_guess(&program.parameters(&[]))).unwrap(),
            _ => plant.step(&inputs).unwrap(),
        }
        let mut told: Vec<f64> = inputs.iter().map(|knot| knot.value).collect();
        let mut measured: Vec<f64> = slots.iter().map(|&slot| plant.value(slot)).collect();
        if k % 371 == 370 || (600..605).contains(&k) {
            told[study.command_input] = f64::NAN;
        }
        if k % 97 == 96 {
            measured[k % slots.len()] = f64::NAN;
        }
        // For half a second the first reading is far outside of its sensor's range, but near the twin in parts of scale.
        if (300..350).contains(&k) {
            measured[0] = 1e9;
        }
        if (700..900).contains(&k) {
            let off = study.reactions.of(1, "shut_down", None).inputs;
            off.iter().for_each(|&(input, value)| told[input] = value);
        }
        samples.push((told, measured));
    }
    samples
}

/// What `main.c` prints of an outcome.
fn line(outcome: &Outcome, diagnoser: &Diagnoser) -> String {
    let names = diagnoser.names();
    let (finding, actuator, action, detail) = match outcome.finding {
        IndexedFinding::Unjudged => ("not judged", None, None, None),
        IndexedFinding::Healthy => ("healthy", None, None, None),
        IndexedFinding::Detected => ("detected, not isolated", None, None, None),
        IndexedFinding::Actuator { actuator } => ("actuator", Some(actuator), None, None),
        IndexedFinding::Action { actuator, action } => {
            ("action", Some(actuator), Some(action), None)
        }
        IndexedFinding::Detail { actuator, action, detail } => {
            ("detail", Some(actuator), Some(action), Some(detail))
        }
        IndexedFinding::Unknown => ("unknown", None, None, None),
        IndexedFinding::EnvironmentInvalid { .. } => ("input invalid", None, None, None),
    };
    let alarm = outcome.alarm.name();
    let name = |list: &[String], place: Option<u32>| {
        place.map_or("-".to_owned(), |place| list[place as usize].clone())
    };
    format!(
        "{:.3} s: {finding}; actuator {}, action {}, detail {}; alarm {alarm}; confidence {:.4}\n",
        outcome.sample as f64 * diagnoser.period_s,
        name(&names.actuators, actuator),
        name(&names.actions, action),
        name(&names.details, detail),
        outcome.confidence
    )
}

#[test]
fn twin_and_diagnosis_say_in_c_what_a_watch_says() {
    let (folder, model, out) = exported("export-hybrid");
    let program = compiled_main(&out);
    let study = Study::read(Path::new(&folder.file("tiny.toml"))).unwrap();
    let diagnoser = Arc::new(model_file::read_diagnoser(Path::new(&model)).unwrap());
    let mut watcher = Watcher::new(&study, diagnoser.clone()).unwrap();
    let (mut text, mut expected) = (String::new(), String::new());
    let place = |id: &str| study.system.sensors.iter().position(|s| s.id == id).unwrap();
    let places: Vec<usize> = diagnoser.sensors.iter().map(|sensor| place(&sensor.name)).collect();
    let (mut was_off, mut before) = (false, None);
    for (inputs, measured) in flight(&study, &diagnoser) {
        let values = inputs.iter().chain(&measured).map(|value| format!("{value:e}"));
        text += &(values.collect::<Vec<_>>().join(" ") + "\n");
        // A log's values that are not possible are missing.
        let mut of_system = vec![f64::NAN; study.system.sensors.len()];
        for (value, &place) in measured.into_iter().zip(&places) {
            let (low, high) = study.system.readable(place);
            of_system[place] = if (low..=high).contains(&value) { value } else { f64::NAN };
        }
        watcher.push(0.0, &inputs, &of_system);
        was_off |= watcher.runtime().session().is_off(1);
        let outcome = *watcher.outcome().unwrap();
        if before.replace((outcome.finding, outcome.alarm))
            != Some((outcome.finding, outcome.alarm))
        {
            assert_eq!(outcome.since_sample, outcome.sample);
            expected += &line(&outcome, &diagnoser);
        }
    }
    let output = run_main(&program, text);
    assert_eq!(String::from_utf8(output.stdout).unwrap(), expected);
    assert!(was_off);
    assert!(
        ["input invalid", "healthy", "alarm pending", "alarm no data"]
            .iter()
            .all(|word| expected.contains(word)),
        "{expected}"
    );
}

#[test]
fn another_system_is_not_the_exported_one() {
    let (_folder, _, out) = exported("export-study");
    let message = fails(&["prove", &out, "--study", "press_axis"], 3);
    assert!(message.contains("press_axis") && message.contains("sensor"), "{message}");
}

#[test]
#[ignore = "slow: ./check --all"]
fn an_fmu_that_cannot_be_written_leaves_nothing() {
    let folder = Folder::new("export-fmu");
    let out = folder.file("none/aileron.fmu");
    let message = fails(&["export", "fmu", "--out", &out], 1);
    assert!(message.contains("none"), "{message}");
    let message = fails(&["export", "fmu", "no_such_study"], 3);
    assert!(message.contains("no_such_study"), "{message}");
    let out = folder.file("press.fmu");
    let text = succeeds(&["export", "fmu", "press_axis", "--fmi", "3", "--out", &out]);
    assert!(text.contains("variables") && fs::metadata(&out).unwrap().len() > 50_000, "{text}");
}

#[test]
fn what_is_no_export_is_named() {
    let (folder, model, out) = exported("export-wrong");
    let used = folder.file("used");
    fs::create_dir(&used).unwrap();
    fs::write(Path::new(&used).join("notes.txt"), "mine").unwrap();
    let message = fails(&["export", "c", "--model", &model, "--out", &used], 2);
    assert!(message.contains("this folder holds other files"), "{message}");
    let message = fails(&["prove", &used], 3);
    assert!(message.contains("there is no export here"), "{message}");
    let other = without_checksum(&model, &folder);
    assert_not_proven(&["prove", &out, "--model", &other], "is not the one that was exported");
    // What the description names is compared too, in both directions.
    let description = Path::new(&out).join("export.json");
    let whole = fs::read_to_string(&description).unwrap();
    let read: serde_json::Value = serde_json::from_str(&whole).unwrap();
    let sources = read["sources_sha256"].as_object().unwrap();
    assert!(sources.contains_key("study.toml"), "{whole}");
    let hash = read["diagnoser_sha256"].as_str().unwrap();
    for (change, place) in [
        (serde_json::json!({ "sources_sha256": {} }), "SHA-256 of study.toml"),
        (serde_json::json!({ "sources_sha256": { "invented.toml": hash } }), "of invented.toml"),
        (serde_json::json!({ "diagnoser_sha256": "0" }), "is not the one that was exported"),
        (serde_json::json!({ "files_sha256": {} }), "SHA-256 of servotwin_session.c"),
        (serde_json::json!({ "version": "0" }), "exported by 0"),
    ] {
        let mut other = read.clone();
        other.as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
        fs::write(&description, other.to_string()).unwrap();
        assert_not_proven(&["prove", &out], place);
    }
    // A description that cannot be read leaves no certificate of an earlier one.
    let (own, proof) =
        (Path::new(&out).join("servotwin_tables.c"), Path::new(&out).join("proof.json"));
    assert!(proof.exists());
    fs::write(&description, &whole[1..]).unwrap();
    assert!(fails(&["prove", &out], 2).contains("this describes no export"));
    assert!(!proof.exists());
    fs::write(&description, whole).unwrap();
    let swapped = fs::read_to_string(&own).unwrap().replace("\"shut_down\"", "\"warning\"");
    fs::write(&own, swapped).unwrap();
    for quiet in [&[][..], &["--quiet"]] {
        let failed = servotwin(&[&["prove", &out], quiet].concat());
        assert_eq!(failed.status.code(), Some(1));
        assert!(stdout(&failed).contains("NOT PROVEN: the folder"), "{}", stdout(&failed));
        let is_named = stdout(&failed).contains("\"warning\",' instead of");
        assert!(is_named || !quiet.is_empty(), "{}", stdout(&failed));
        assert!(fs::read_to_string(&proof).unwrap().contains("\"holds\": false"));
    }
    let message = fails(&["export", "c", "--model", &folder.file("none.json"), "--out", &out], 3);
    assert!(message.contains("none.json"), "{message}");
    assert!(Path::new(&out).join("servotwin_session.c").exists(), "the earlier export stays");
}
