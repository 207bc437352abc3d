//! Systems of one, two and three like actuators go the whole way, as users go it.

use super::{Folder, json, servotwin, stderr, stdout};
use servotwin::learn::model_file;
use servotwin::live::closed_loop::{self, ClosedLoop};
use servotwin::signal::Signal;
use servotwin::study::Study;
use servotwin::table::Table;
use servotwin_model::program::FaultAt;
use std::path::Path;
use std::sync::Arc;

const SYSTEM: &str = include_str!("../../../servotwin/tests/lanes_system.toml");
const STUDY: &str = include_str!("../../../servotwin/tests/lanes_study.toml");

/// The text without the lines of the actuators beyond the first so many of three.
fn of_actuators(text: &str, actuators: usize) -> String {
    let beyond = |line: &&str| {
        let names =
            |actuator: usize| [format!("lane_{actuator}"), format!("actuator = {actuator}")];
        !(actuators + 1..=3).flat_map(names).any(|name| line.contains(&name))
    };
    text.lines().filter(beyond).flat_map(|line| [line, "\n"]).collect()
}

/// A study of so many actuators, and beside it a folder for its results.
fn lanes(folder: &Folder, actuators: usize, changed: impl Fn(String) -> String) -> [String; 2] {
    let study = folder.file("lanes_study.toml");
    std::fs::write(folder.file("lanes_system.toml"), of_actuators(SYSTEM, actuators)).unwrap();
    std::fs::write(&study, changed(of_actuators(STUDY, actuators))).unwrap();
    [study, folder.file("out")]
}

fn run(arguments: &[&str]) -> String {
    let output = servotwin(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    stdout(&output)
}

fn results(out: &str, name: &str) -> serde_json::Value {
    let text = std::fs::read_to_string(Path::new(out).join(name)).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// A word with what stands around it.
fn around<'t>(text: &'t str, word: &str) -> &'t str {
    let at = text.find(word).unwrap_or(0);
    let near = |mut at: usize| {
        at = at.min(text.len());
        (0..=at).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0)
    };
    &text[near(at.saturating_sub(200))..near(at + 100)]
}

/// In how many cells of a row of the summary all cases are right: `100.0 %`, of few `12 of 12`.
fn all_of_them(row: &str) -> usize {
    let words: Vec<&str> = row.split_whitespace().collect();
    let counts = words.windows(3).filter(|w| w[1] == "of" && w[0] == w[2]).count();
    row.matches("100.0 %").count() + counts
}

/// Everything that a study gives, and everything that is done with it.
fn whole_way(actuators: usize) {
    let folder = Folder::new(&format!("lanes-{actuators}"));
    let [study, out] = &lanes(&folder, actuators, |text| text);
    let words = run(&["study", study, "--out", out, "--details"]);
    let stages = |name: &str| {
        let trained = results(out, name);
        let list = trained["lengths"][0]["panel"]["trees"]["stages"].as_array().unwrap().iter();
        list.map(|stage| stage["id"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    // Pooled: whatever the number of actuators, one stage for all of them.
    assert_eq!(stages("records-noise.json"), ["A", "B", "C", "D"]);
    let row = words.lines().find(|line| line.starts_with("end to end right")).unwrap();
    assert!(all_of_them(row) >= 2, "{words}");
    let html = std::fs::read_to_string(Path::new(out).join("report.html")).unwrap();
    assert_eq!(html.contains("two are then lost"), actuators == 3);
    assert_eq!(html.contains("both are then lost"), actuators == 2);
    let html = html.replace("Like actuators", "").replace("Like servo actuators", "");
    // Units are called as the study calls them, and of one alone nothing is said of others.
    assert!(!html.contains("actuator"), "{}", around(&html, "actuator"));
    for of_several in ["mirror image", "which lane has failed"] {
        assert_eq!(html.to_lowercase().contains(of_several), actuators > 1, "{of_several}");
    }
    let flown = results(out, "flights.json");
    let suites = flown["suites"].as_array().unwrap();
    for metrics in suites.iter().filter(|metrics| metrics["suite"] == "judge") {
        let rates = &metrics["rates"];
        // One alone has no other that could be shut down in its place.
        assert_eq!(rates.get("wrong_shutdown").is_some(), actuators > 1, "{metrics}");
        assert_eq!(rates["wrong_shutdown"]["count"].as_u64().unwrap_or(0), 0, "{metrics}");
        assert_eq!(metrics["flights"], 10 * actuators, "every fault of every actuator is flown");
        assert!(rates["isolated_in_time"]["count"].as_u64().unwrap() > 0, "{metrics}");
    }
    // A judged fault of the last actuator.
    let last_fault = format!("cases#{}@noise", 10 * actuators - 1);
    let explained = json(&["run", &last_fault, out, "--json"]);
    assert_eq!(explained["fault"], format!("lane_{actuators}.sensor_ram.bias_positive"));
    let last = format!("lane_{actuators}");
    let said = if actuators > 1 { last.as_str() } else { "faulty" };
    assert_eq!(explained["explanation"]["stages"][0]["said"], said);
    let words = run(&["run", &last_fault, out]);
    let asked = if actuators > 1 {
        format!("which lane?  lane {actuators} (")
    } else {
        "is something wrong?  faulty (".into()
    };
    assert!(words.contains(&asked) && !words.contains("actuator"), "{words}");
    let together = words.lines().find_map(|line| line.strip_prefix("together: ")).unwrap();
    assert_eq!(together.starts_with("lane"), actuators > 1, "{together}");
    for fault in ["servo_valve.bias_positive", "sensor_ram.bias_positive"] {
        let fault = format!("{last}.{fault}=1@2s");
        let command = "noise:rms=3deg,bandwidth=0.8Hz,seed=7";
        let fly = ["fly", study, "--out", out, "--duration", "5s", "--json"];
        let flown = json(&[&fly[..], &["--fault", &fault, "--command", command]].concat());
        assert_eq!(flown["actions"][0]["actuator"], last, "{flown}");
        let mut rows = flown["benefit"].as_array().unwrap().iter();
        let fight = rows.find(|row| row["quantity"] == "rms force fight");
        let fight = fight.map_or(&serde_json::Value::Null, |row| &row["without"]);
        assert_eq!(fight.as_f64().is_some(), actuators > 1, "{fight}");
    }
    watched(&folder, study, out);
}

/// A healthy log is watched.
fn watched(folder: &Folder, study: &str, out: &str) {
    let (log, system) = (folder.file("log.csv"), folder.file("lanes_system.toml"));
    let command = "noise:rms=3deg,bandwidth=0.8Hz,seed=7";
    run(&["simulate", &system, "--command", command, "--duration", "4s", "--out", &log]);
    let model = format!("{out}/diagnoser-noise.json");
    let text = run(&["watch", &log, "--study", study, "--model", &model, "--json"]);
    assert!(text.contains("\"state\":\"healthy\"") && !text.contains("raised"), "{text}");
}

#[test]
#[ignore = "slow: ./check --all"]
fn one_actuator_goes_the_whole_way() {
    whole_way(1);
}

#[test]
#[ignore = "slow: ./check --all"]
fn two_like_actuators_go_the_whole_way() {
    whole_way(2);
}

#[test]
#[ignore = "slow: ./check --all"]
fn three_like_actuators_go_the_whole_way() {
    whole_way(3);
}

/// One actuator after the other fails: two of three are switched off, and the last one never.
#[test]
#[ignore = "slow: ./check --all"]
fn of_three_actuators_that_fail_one_after_the_other_the_last_one_stays_on() {
    let folder = Folder::new("lanes-last");
    // Learned from so few flights, not every seed sees the second fault in time.
    let [study, out] = &lanes(&folder, 3, |text| text.replace("seed = 3\n", "seed = 1\n"));
    let told = run(&["study", study, "--suite", "flights", "--out", out]);
    assert!(told.contains("wrong lane ") && !told.contains("actuator"), "{told}");
    let study = Study::read(Path::new(study)).unwrap();
    let diagnoser =
        model_file::read_diagnoser(Path::new(out).join("diagnoser-noise.json")).unwrap();
    assert_eq!(diagnoser.tuning.least_on, 1);
    let duration_s = 14.0;
    let mut inputs = study.system.default_inputs();
    let signal: Signal = "noise:rms=3deg,bandwidth=0.8Hz,seed=9".parse().unwrap();
    let unit = study.system.network().inputs[study.command_input].unit;
    inputs[study.command_input] = signal.build(unit, duration_s).unwrap();
    let fault = |(place, &lane): (usize, &usize)| {
        let id = format!("lane_{lane}.servo_valve.bias_positive");
        let (component, fault) = study.system.program.find_fault(&id).unwrap();
        (2.0 + 4.0 * place as f64, FaultAt { component, fault, intensity: 1.0 })
    };
    let off = |least_on: u32| {
        let faults = [2, 3, 1].iter().enumerate().map(fault).collect();
        let mut diagnoser = diagnoser.clone();
        diagnoser.tuning.least_on = least_on;
        let (study, inputs) = (&study, inputs.clone());
        let scenario =
            ClosedLoop { study, inputs, faults, duration_s, specimen: None, reacts: true };
        let record = closed_loop::fly(&scenario, &Arc::new(diagnoser), &[]).unwrap();
        let off = record.actions.iter().filter(|action| action.reaction.switches_off);
        off.map(|action| action.raised.actuator).collect::<Vec<_>>()
    };
    assert_eq!(off(1), [1, 2]);
    assert_eq!(off(2), [1]);
}

/// Units whose sensors do not correspond are not seen from each other: every one is learned by itself.
#[test]
#[ignore = "slow: ./check --all"]
fn three_actuators_with_unlike_sensors_are_learned_one_by_one() {
    let folder = Folder::new("lanes-unlike");
    let without =
        |text: String| text.replace("p_b_3 = { quantity = \"pressure_b\", actuator = 3 }\n", "");
    let [study, out] = &lanes(&folder, 3, without);
    run(&["study", study, "--out", out]);
    let trained = results(out, "records-noise.json");
    let stages = trained["lengths"][0]["panel"]["trees"]["stages"].as_array().unwrap().iter();
    let ids: Vec<&str> = stages.map(|stage| stage["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["A", "B1", "B2", "B3", "C1", "C2", "C3", "D1", "D2", "D3"]);
    let table = Table::read(Path::new(out).join("dataset-ideal-training.parquet")).unwrap();
    assert!(!table.names().any(|name| name.starts_with("m:") || name.starts_with("m3:")));
    // Nothing takes turns: ten faults of three actuators under four commands.
    assert_eq!(table.row_count(), 120);
}

/// The only actuator of a system needs no name.
#[test]
#[ignore = "slow: ./check --all"]
fn one_actuator_without_a_name_is_healthy_or_faulty() {
    let folder = Folder::new("lanes-nameless");
    let nameless = |text: String| {
        let text = text.split("[flights]").next().unwrap().replace("\"lane_1\"", "\"\"");
        let parts = ["leakage_a", "servo_valve", "sensor_pressure_a", "sensor_ram", "cylinder"];
        let own =
            |text: String, part| text.replace(&format!("\"{part}."), &format!("\"lane_1.{part}."));
        parts.into_iter().fold(text, own)
    };
    let [study, out] = &lanes(&folder, 1, nameless);
    let told = run(&["study", study, "--suite", "records", "--out", out, "--scenario", "noise"]);
    assert!(!told.contains("another actuator"), "{told}");
    run(&["study", study, "--out", out]);
    let words = run(&["run", "cases#9@noise", out]);
    assert!(words.contains("is something wrong?  faulty (") && !words.contains(": ,"), "{words}");
    let explained = json(&["run", "cases#9@noise", out, "--json"]);
    assert_eq!(explained["explanation"]["verdict"]["actuator"], serde_json::Value::Null);
    assert_eq!(explained["explanation"]["stages"][0]["said"], "faulty");
    let html = std::fs::read_to_string(Path::new(out).join("report.html")).unwrap();
    assert!(!html.contains("which actuator has failed") && !html.contains("mirror image"));
}

/// Nor does a text leave a hole where the name would stand.
#[test]
#[ignore = "slow: ./check --all"]
fn one_actuator_without_a_name_is_flown_and_watched() {
    let folder = Folder::new("nameless-flown");
    let out = &folder.file("out");
    let fly = ["fly", "press_axis", "--out", out, "--fault", "valve.gain_low=0.8@2s"];
    let fly = [&fly[..], &["--duration", "6s"]].concat();
    let text = run(&fly);
    assert!(text.contains("carried out") && text.contains("stop"), "{text}");
    let flown = json(&[&fly[..], &["--json"]].concat());
    assert_eq!(flown["actions"][0]["action"], "stop");
    assert!(flown["actions"][0]["actuator"].is_null(), "{flown}");
    let (log, html) = (&folder.file("log.csv"), &folder.file("log.html"));
    let command = "noise:rms=25mm,bandwidth=0.7Hz,limit=100mm,seed=5";
    let simulate = ["simulate", "press_axis", "--command", command, "--noise", "4"];
    let more = ["--fault", "valve.gain_low=0.8", "--duration", "6s", "--out", log];
    run(&[&simulate[..], &more].concat());
    let model = &format!("{out}/diagnoser-noise.json");
    let watch = ["watch", log, "--study", "press_axis", "--model", model, "--html", html];
    let said = run(&watch);
    assert!(said.contains("raised: stop, valve"), "{said}");
    let page = std::fs::read_to_string(html).unwrap();
    assert!(page.contains("\"kind\":\"action\",\"at\":") && page.contains("\"action\":\"stop\""));
    let lines = run(&[&watch[..], &["--json"]].concat());
    assert!(
        lines.contains("\"actuator_number\":1,\"actuator\":null,\"action\":\"stop\""),
        "{lines}"
    );
}

#[test]
fn how_many_actuators_stay_on_is_said_by_the_study() {
    let folder = Folder::new("lanes-kept");
    let keep = |text: String, least_on: u32| {
        text.replace("windows_s", &format!("least_on = {least_on}\nwindows_s"))
    };
    let [study, out] = &lanes(&folder, 1, |text| keep(text, 1));
    let told = run(&["study", study, "--suite", "flights", "--out", out]);
    assert!(!told.contains("wrong lane") && !told.contains("actuator"), "{told}");
    let fly = ["fly", study, "--out", out, "--duration", "5s", "--fault"];
    let flown = run(&[&fly[..], &["lane_1.servo_valve.bias_positive=1@2s"]].concat());
    assert!(flown.contains("nothing had to be done"), "{flown}");
    let [study, _] = &lanes(&folder, 1, |text| keep(text, 2));
    let told = servotwin(&["check", study]);
    assert!(
        stdout(&told).contains("least_on")
            || stderr(&told).contains("0 … 1, as there are actuators")
    );
    assert_eq!(told.status.code(), Some(3));
}

#[test]
fn more_actuators_than_can_be_compared_are_refused() {
    let folder = Folder::new("lanes-many");
    let many: String = (4..=17).map(|lane| format!("    \"lane_{lane}\",\n")).collect();
    let more =
        |text: String| text.replace("    \"lane_3\",\n", &format!("    \"lane_3\",\n{many}"));
    let [study, _] = &lanes(&folder, 3, more);
    let told = servotwin(&["check", study]);
    assert_eq!(told.status.code(), Some(3));
    assert!(stderr(&told).contains("at most 16"), "{}", stderr(&told));
}
