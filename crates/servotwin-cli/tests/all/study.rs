//! The main job and its stages, run as users run them, on a study small enough for a test.

use super::{Folder, Shared, copy_folder, servotwin, stderr, stdout, succeeds};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

/// The paper's study with few faults, two short runs, and every section of the file in use.
fn tiny(classes: &str) -> String {
    format!(
        r#"{}
[extra_sensor]
id = "x_p_3"
title = "third stroke sensor"
{classes}
[realistic]
healthy = 4
tolerances = [
    {{ parameters = ["servo_valve.null_bias"], sigma = 0.0067, absolute = true }},
    {{ parameters = ["cylinder.coulomb_friction_n"], sigma = 0.1 }},
]
[fitted]
command = "noise:rms=4deg,bandwidth=1Hz,seed=9"
duration_s = 5
judge = 4
learn = 4
in_each_case = 2
[training]
duration_s = 2
healthy = 3
load = [0.5, 1.0]
intensity_spread = 0.05
draws = [{{ count = 3, signal = "noise:rms={{3..6}}deg,bandwidth=1Hz,seed=1{{n}}" }}]
signals.step = "step:size=5deg,at=0.5s"
[flights]
duration_s = 3
onset_s = [1, 1.5]
windows_s = [0.5]
commands = ["noise:rms={{2..4}}deg,bandwidth={{0.5..1}}Hz,seed={{n}}"]
inputs.load_factor = [0.5, 1]
[suites]
learn = {{ environments = 3, repeats = 1, healthy = 2 }}
held_out = {{ environments = 0 }}
judge = {{ environments = 2, repeats = 1, healthy = 1 }}
unseen = {{ repeats = 1 }}
[reactions]
shut_down = {{ switches_off = true, actuator_inputs = {{ mode = 0 }} }}
"#,
        include_str!("../../../servotwin/tests/tiny.toml")
    )
}

const CLASSES: &str = include_str!("../../../servotwin/tests/tiny_classes.toml");

fn write_study(folder: &Folder, classes: &str) -> String {
    let path = folder.file("tiny.toml");
    std::fs::write(&path, tiny(classes)).unwrap();
    path
}

/// The results of the whole study in one go, on one thread.
fn whole() -> &'static Path {
    static WHOLE: Shared = Shared::new("study-whole");
    filled(&WHOLE, &["study", "--fitted", "--threads", "1"])
}

/// The records of all scenarios but the fitted one.
fn all_records() -> &'static Path {
    static RECORDS: Shared = Shared::new("study-records");
    filled(&RECORDS, &["study", "--suite", "records"])
}

/// The records of the ideal scenario.
fn ideal() -> &'static Path {
    static IDEAL: Shared = Shared::new("study-ideal");
    filled(&IDEAL, &["study", "--suite", "records", "--scenario", "ideal"])
}

/// What a command over the tiny study leaves in a folder.
fn filled(shared: &'static Shared, command: &[&str]) -> &'static Path {
    shared.get(|path| {
        let folder = Folder::new(shared.name);
        let study = write_study(&folder, CLASSES);
        run(&[command, &[&study, "--out", path.to_str().unwrap()]].concat());
    })
}

/// A copy of such a folder.
fn copy_of(shared: &Path, folder: &Folder) -> String {
    let out = folder.file("out");
    copy_folder(shared, Path::new(&out));
    out
}

fn run(arguments: &[&str]) -> Output {
    let output = servotwin(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    output
}

/// Every file of a folder, in which files may come and go.
fn files(folder: &Path) -> BTreeSet<PathBuf> {
    let mut files = BTreeSet::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.insert(path.strip_prefix(folder).unwrap().to_path_buf());
            }
        }
    }
    files
}

/// Every file of a folder and what is in it.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let with_bytes = |file: PathBuf| {
        let bytes = std::fs::read(folder.join(&file)).unwrap();
        (file, bytes)
    };
    files(folder).into_iter().map(with_bytes).collect()
}

fn assert_same(a: &BTreeMap<PathBuf, Vec<u8>>, b: &BTreeMap<PathBuf, Vec<u8>>) {
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (path, bytes) in a {
        assert!(bytes == &b[path], "{} differs", path.display());
    }
}

/// One message, an exit code, no panic.
fn fails(arguments: &[&str], code: i32, message: &str) {
    let output = servotwin(arguments);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    assert!(text.contains(message), "{arguments:?}: {text}");
    assert!(!text.contains("panicked"), "{arguments:?}: {text}");
    assert_eq!(text.trim_end().lines().count(), 1, "one message: {text}");
}

#[test]
fn a_study_is_the_same_bytes_in_one_go_stage_by_stage_and_on_any_threads() {
    let folder = Folder::new("study");
    let study = write_study(&folder, CLASSES);
    let staged = folder.file("staged");
    run(&["study", &study, "--suite", "records", "--out", &staged, "--threads", "3"]);
    run(&["study", &study, "--suite", "records", "--out", &staged, "--scenario", "fitted"]);
    run(&["study", &study, "--suite", "flights", "--out", &staged, "--threads", "2"]);
    run(&["study", &staged, "--threads", "2"]);
    run(&["report", &staged]);
    let first = contents(whole());
    assert_same(&first, &contents(Path::new(&staged)));
    report_is_sound(&String::from_utf8(first[Path::new("report.html")].clone()).unwrap());
    explains(&staged);
    lists_its_results(&staged);
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_finished_study_goes_on_with_data_sets_made_anew_to_the_same_bytes() {
    let folder = Folder::new("again");
    let (study, out) = (write_study(&folder, CLASSES), copy_of(whole(), &folder));
    run(&["study", &out, "--suite", "records"]);
    let output = run(&["study", &study, "--out", &out]);
    assert!(stdout(&output).contains("\nnew command\n"), "{}", stdout(&output));
    assert!(stdout(&output).contains("wrong actuator shut down"));
    assert_same(&contents(whole()), &contents(Path::new(&out)));
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_study_is_quick_first_and_a_full_one_is_never_lost_to_it() {
    let folder = Folder::new("quick");
    let (study, out) = (folder.file("tiny.toml"), folder.file("out"));
    let quick = "[quick]\nduration_s = 1\ndraws = 1\nhealthy = 2\n[reactions]";
    std::fs::write(&study, tiny(CLASSES).replace("[reactions]", quick)).unwrap();
    let there = |name: &str| Path::new(&out).join(name);
    let read = |name: &str| std::fs::read_to_string(there(name)).unwrap();
    let told = stderr(&run(&["study", &study, "--out", &out]));
    let (first, behind) = told.split_once("trained and evaluated").unwrap();
    assert!(!first.contains("report.html"), "{told}");
    assert!(behind.contains("report.html: noise: wrong actuator shut down"), "{told}");
    let report = read("report.html");
    assert!(report.contains("Quick study: records of 1 s, 2 training commands"));
    assert!(!report.contains("id=\"work\""), "no chapter without a section");
    assert!(!there("flights.json").exists());
    let told = stderr(&run(&["study", &study, "--out", &out, "--full"]));
    assert!(told.contains("result files of before the study was changed removed"), "{told}");
    assert!(read("study.toml").starts_with("full = true\n") && there("flights.json").exists());
    assert!(!read("report.html").contains("Quick study"));
    let full = contents(Path::new(&out));
    let told = stderr(&run(&["study", &study, "--out", &out]));
    assert!(told.contains("holds the full study, which goes on"), "{told}");
    assert_same(&full, &contents(Path::new(&out)));
    run(&["study", &study, "--out", &out, "--replace"]);
    assert!(read("report.html").contains("Quick study"));
}

#[test]
fn a_report_names_the_scenarios_that_are_still_to_come() {
    let folder = Folder::new("partial");
    let (study, out) = (write_study(&folder, CLASSES), folder.file("out"));
    let missing = |scenario| {
        run(&["study", &study, "--out", &out, "--scenario", scenario]);
        let report = std::fs::read_to_string(Path::new(&out).join("report.html")).unwrap();
        report
            .split_once("Not in this report yet: ")
            .unwrap()
            .1
            .split(". ")
            .next()
            .unwrap()
            .to_owned()
    };
    assert_eq!(missing("ideal"), "noise, realistic, runs in which faults begin");
    assert_eq!(missing("noise"), "realistic");
}

/// The page of results holds every rate of the JSON, each with its count, and changes nothing in the folder.
fn lists_its_results(out: &str) {
    let before = contents(Path::new(out));
    let page = stdout(&run(&["report", out, "--markdown"]));
    let json = run(&["report", out, "--markdown", "--json"]);
    assert_same(&before, &contents(Path::new(out)));
    assert!(
        page.starts_with("# Measured results\n") && page.contains("study tiny --fitted"),
        "{page}"
    );
    let measured: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    let sections = measured.as_object().unwrap();
    for title in ["ideal", "noise", "fitted", "realistic", "realistic, third stroke sensor"] {
        assert!(sections.contains_key(&format!("variants:{title}")), "{title}");
    }
    assert_eq!(sections.keys().filter(|key| key.starts_with("flights:")).count(), 2);
    let tables = sections.values().filter_map(|section| section.as_object());
    let rows = tables.flat_map(|section| section.values()).filter_map(|table| table.as_array());
    let mut rates = 0;
    for row in rows.flatten().filter_map(|row| row.as_object()) {
        let Some(measure) = row.get("measure") else { continue };
        assert!(page.contains(measure.as_str().unwrap()), "{measure}");
        for rate in row.values().filter(|cell| cell.is_object()) {
            let cell = format!("), {} of {}", rate["count"], rate["of"]);
            assert!(page.contains(&cell), "{rate}");
            rates += 1;
        }
    }
    assert!(rates > 50, "{rates}");
    let evaluation = std::fs::read_to_string(format!("{out}/evaluation.json")).unwrap();
    let evaluation: serde_json::Value = serde_json::from_str(&evaluation).unwrap();
    let detected = &evaluation["subjects"][1]["evaluation"]["in_band"]["visible"];
    let cell = format!("), {} of {} |", detected["count"], detected["of"]);
    assert!(page.contains(&format!(
        "| visible at any time | {:.2} %",
        100.0 * detected["share"].as_f64().unwrap()
    )));
    assert!(page.contains(&cell), "{cell}");
    fails(&["report", &format!("{out}/nowhere"), "--markdown"], 3, "nowhere");
}

/// One file that needs nothing from elsewhere, with every section and a text for every figure.
fn report_is_sound(html: &str) {
    for section in servotwin_report::CHAPTERS.iter().flat_map(|chapter| chapter.sections) {
        let anchor = format!("<div id=\"{}\"", section.id);
        assert!(html.contains(&anchor), "no section {}", section.id);
    }
    let figures = html.matches("<figure id=").count();
    assert!(figures > 10);
    assert_eq!(html.matches("<svg role=\"img\" aria-label=\"").count(), figures);
    for foreign in ["<script", "<link", "<img", "url(", "@import"] {
        assert!(!html.contains(foreign), "{foreign}");
    }
    let addresses = html.matches("http").count();
    assert_eq!(addresses, html.matches("xmlns=\"http://www.w3.org/2000/svg\"").count());
}

fn explains(out: &str) {
    let output = run(&["run", "cases#3@realistic", out]);
    let text = stdout(&output);
    assert!(text.starts_with("together: "), "{text}");
    assert!(text.contains("actuator_1.leakage_a.leakage"), "{text}");
    assert!(text.contains("which actuator?") && text.contains("what is broken?"), "{text}");
    fails(&["run", "cases#9999@realistic", out], 2, "RUN cases#9999@realistic is out of range");
}

/// Killed as soon as it has committed the first file of a kind, and begun again, until nothing is left to do.
#[test]
#[ignore = "slow: ./check --all"]
fn a_study_that_is_killed_behind_each_kind_of_file_ends_with_the_same_bytes() {
    let folder = Folder::new("killed");
    let (study, killed) = (write_study(&folder, CLASSES), folder.file("killed"));
    std::fs::create_dir(&killed).unwrap();
    // `records` of `records-noise.json`, `figures` of `figures/detected_noise.svg`.
    let kind = |file: PathBuf| {
        let name = file.to_str().unwrap();
        name.split(['-', '.', '/']).find(|part| !part.is_empty()).unwrap().to_owned()
    };
    let is_committed = |file: &PathBuf| file.extension().is_none_or(|ending| ending != "tmp");
    let there = || -> BTreeSet<String> {
        files(Path::new(&killed)).into_iter().filter(is_committed).map(kind).collect()
    };
    let mut kills = 0;
    loop {
        let before = there();
        let mut child = Command::new(env!("CARGO_BIN_EXE_servotwin"))
            .args(["study", &study, "--out", &killed, "--fitted"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let ended = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break Some(status);
            }
            if !there().is_subset(&before) {
                break None;
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        if let Some(status) = ended {
            assert!(status.success(), "{status}");
            break;
        }
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
    }
    assert!(kills > 10, "{kills}");
    assert_same(&contents(whole()), &contents(Path::new(&killed)));
}

#[test]
fn what_cannot_be_done_is_told_in_one_line_and_nothing_is_written() {
    let folder = Folder::new("refused");
    let out = folder.file("out");
    let none = write_study(&folder, "");
    let without_faults = |arguments: &[&str]| {
        let output = servotwin(arguments);
        assert_eq!(output.status.code(), Some(3), "{arguments:?}");
        assert!(
            stderr(&output).contains("tiny.toml:1:1: the study has no faults"),
            "{arguments:?}"
        );
    };
    without_faults(&["study", &none, "--out", &out]);
    without_faults(&["study", &none, "--suite", "records", "--out", &out]);
    without_faults(&["check", &none]);
    assert!(!Path::new(&out).exists());
    let study = write_study(&folder, CLASSES);
    // A file where a folder is needed, and a folder that nobody can write to.
    fails(&["study", &study, "--out", &study], 1, "tiny.toml");
    let spring = concat!(env!("CARGO_MANIFEST_DIR"), "/../../studies/spring_actuator.toml");
    let lacks = |arguments: &[&str], told: [&str; 2]| {
        let output = servotwin(arguments);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(told.iter().all(|told| text.contains(told)), "{text}");
    };
    let fitted = ["the study lacks [fitted], which scenario 'fitted' needs", "\n  fitted = {"];
    lacks(&["study", spring, "--out", &out, "--fitted"], fitted);
    lacks(&["study", spring, "--suite", "records", "--out", &out, "--scenario", "fitted"], fitted);
    assert!(!Path::new(&out).exists());
    fails(&["study", &study, "--out", "/proc/servotwin"], 1, "/proc/servotwin");
    std::fs::create_dir(&out).unwrap();
    fails(&["report", &out], 3, "there is no data set here; 'servotwin study --suite records");
}

#[test]
fn files_that_were_not_made_yet_are_named_with_what_makes_them() {
    let folder = Folder::new("broken");
    let out = copy_of(ideal(), &folder);
    let run = ["run", "cases#0@ideal", &out];
    fails(&run, 3, "records-ideal.json: no such file; 'servotwin study' writes it");
    fails(&["report", &out], 3, "evaluation.json: no such file; 'servotwin study' writes it");
}

/// Flips a bit in the middle of a file, in text that of a digit; what the file was.
fn flip(path: &Path) -> Vec<u8> {
    let before = std::fs::read(path).unwrap();
    let is_text = path.extension().is_some_and(|ending| ending == "json" || ending == "toml");
    let behind = before.len() / 2..before.len();
    let place = behind.into_iter().find(|&at| !is_text || before[at].is_ascii_digit()).unwrap();
    let mut after = before.clone();
    after[place] ^= 1;
    std::fs::write(path, after).unwrap();
    before
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_file_that_is_not_what_was_written_is_named_with_what_makes_it_anew() {
    let folder = Folder::new("flipped");
    let (study, out) = (write_study(&folder, CLASSES), copy_of(whole(), &folder));
    let file = |name: &str| Path::new(&out).join(name);
    let (log, diagnoser) = (folder.file("log.csv"), file("diagnoser-realistic.json"));
    run(&["simulate", "--duration", "1s", "--command", "step:size=1deg", "--out", &log]);
    let watch =
        ["watch", "--quiet", &log, "--study", &study, "--model", diagnoser.to_str().unwrap()];
    let fly = ["fly", &study, "--out", &out, "--fault", "none", "--duration", "3s"];
    let ideal = ["run", "cases#0@ideal", &out];
    let study_again = format!("study {out}");
    let [records, flights] =
        ["records", "flights"].map(|suite| format!("{study_again} --suite {suite}"));
    let records = records.as_str();
    for (name, command, again) in [
        ("dataset-realistic.parquet", &["run", "cases#0@realistic", &out][..], records),
        ("dataset-ideal.parquet", &ideal, records),
        ("records-ideal.json", &ideal, &study_again),
        ("records-noise.json", &["report", &out], &study_again),
        ("evaluation.json", &["report", &out], &study_again),
        ("flights.json", &["report", &out], &flights),
        ("diagnoser-realistic.json", &watch, &flights),
        ("diagnoser-noise.json", &fly, &flights),
        ("study.toml", &ideal, "study STUDY --suite records"),
        ("study.toml", &["report", &out], "study STUDY --suite records"),
        ("system.toml", &["report", &out], "study STUDY --suite records"),
    ] {
        let before = flip(&file(name));
        fails(command, 3, &format!("{name}: damaged, or changed since: its SHA-256"));
        fails(command, 3, &format!("'servotwin {again}"));
        std::fs::write(file(name), before).unwrap();
    }
    // A stage that does not read a file does not vouch for it; the command that is told makes it anew.
    let good = flip(&file("dataset-ideal.parquet"));
    run(&["study", &study, "--suite", "flights", "--out", &out, "--scenario", "noise"]);
    fails(&ideal, 3, "dataset-ideal.parquet: damaged");
    run(&["study", &out, "--suite", "records"]);
    assert!(std::fs::read(file("dataset-ideal.parquet")).unwrap() == good);
    run(&ideal);
    // Of a text too, and the results stay: they are still of the study that is given.
    let (good, results) =
        (flip(&file("study.toml")), std::fs::read(file("evaluation.json")).unwrap());
    run(&["study", &study, "--suite", "flights", "--out", &out, "--scenario", "noise"]);
    assert!(std::fs::read(file("study.toml")).unwrap() == good);
    assert!(std::fs::read(file("evaluation.json")).unwrap() == results);
    // A text that was changed and is given as the study is another study.
    std::fs::write(file("study.toml"), [&good[..], b"# changed\n"].concat()).unwrap();
    let changed = file("study.toml").display().to_string();
    let copy = folder.file("copy");
    std::fs::create_dir(&copy).unwrap();
    let copied = |name: &str| Path::new(&copy).join(name);
    for name in ["study.toml", "system.toml", "manifest.json", "evaluation.json"] {
        std::fs::copy(file(name), copied(name)).unwrap();
    }
    run(&["study", &changed, "--suite", "records", "--out", &copy, "--scenario", "ideal"]);
    assert!(!copied("evaluation.json").exists(), "it came from the text before");
    std::fs::write(file("study.toml"), good).unwrap();
    // Of a manifest that cannot be read too; without one nothing is compared.
    let manifest = std::fs::read_to_string(file("manifest.json")).unwrap();
    std::fs::write(file("manifest.json"), &manifest[..manifest.len() / 2]).unwrap();
    fails(&["report", &out], 3, "remove it, and the next stage writes it anew");
    std::fs::remove_file(file("manifest.json")).unwrap();
    let results = std::fs::read_to_string(file("evaluation.json")).unwrap();
    std::fs::write(file("evaluation.json"), results + "\n").unwrap();
    run(&["report", &out]);
    // But what is no data set is. (The report has written a manifest.)
    std::fs::remove_file(file("manifest.json")).unwrap();
    let good = std::fs::read(file("dataset-ideal.parquet")).unwrap();
    for bytes in [&b"not a Parquet file"[..], &good[..good.len() / 2], &[]] {
        std::fs::write(file("dataset-ideal.parquet"), bytes).unwrap();
        fails(&ideal, 3, "dataset-ideal.parquet");
    }
}

#[test]
fn only_one_program_and_the_parts_of_one_suite_work_in_a_folder() {
    let folder = Folder::new("held");
    let (study, out) = (write_study(&folder, CLASSES), copy_of(ideal(), &folder));
    let lock = Path::new(&out).join(servotwin::job::hold::NAME);
    let held = std::fs::File::options().write(true).open(&lock).unwrap();
    held.lock().unwrap();
    let before = contents(Path::new(&out));
    let part = [
        "study",
        &study,
        "--suite",
        "records",
        "--out",
        &out,
        "--scenario",
        "ideal",
        "--share",
        "1/1",
    ];
    let busy = "out: another servotwin is working in this folder";
    for command in ["study", "fly"] {
        fails(&[command, &study, "--out", &out], 1, busy);
    }
    for suite in ["records", "flights"] {
        fails(&["study", &out, "--suite", suite], 1, busy);
    }
    fails(&["report", &out], 1, busy);
    fails(&part, 1, busy);
    assert_same(&before, &contents(Path::new(&out)));
    // Who only reads need not wait.
    fails(&["run", "cases#0@ideal", &out], 3, "records-ideal.json: no such file");
    held.unlock().unwrap();
    held.lock_shared().unwrap();
    run(&part);
    fails(&["report", &out], 1, busy);
    held.unlock().unwrap();
    run(&["study", &out, "--suite", "records", "--scenario", "ideal"]);
    assert_same(&before, &contents(Path::new(&out)));
    assert!(!before[Path::new("manifest.json")].windows(4).any(|word| word == b"lock"));
}

#[test]
fn results_of_another_study_are_only_replaced_when_that_is_asked_for() {
    let folder = Folder::new("another");
    let (study, out) = (write_study(&folder, CLASSES), copy_of(ideal(), &folder));
    let before = contents(Path::new(&out));
    let other = folder.file("other.toml");
    std::fs::write(&other, tiny(CLASSES).replacen("name = \"", "name = \"another_", 1)).unwrap();
    for command in ["study", "fly"] {
        fails(&[command, &other, "--out", &out], 2, "--replace removes them");
    }
    for suite in ["records", "flights"] {
        let command = ["study", &other, "--suite", suite, "--out", &out];
        fails(&command, 2, "--replace removes them");
    }
    assert_same(&before, &contents(Path::new(&out)));
    let ideal = ["--out", &out, "--scenario", "ideal"];
    std::fs::write(&study, tiny(CLASSES).replace("0.4, 0.6", "0.5, 0.6")).unwrap();
    let edited = stderr(&run(&[&["study", &study, "--suite", "records"][..], &ideal].concat()));
    // Two data sets and their card.
    assert!(edited.contains("3 result files of before the study was changed removed"), "{edited}");
    run(&[&["study", &other, "--suite", "records", "--replace"][..], &ideal].concat());
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_study_of_one_class_is_a_study_of_the_actuator_only() {
    let folder = Folder::new("one-class");
    let class = "[[classes]]\ndetail = \"external_leakage\"\naction = \"shut_down\"\n\
                 faults = [\"leakage_a.leakage\"]\n";
    let study = write_study(&folder, class);
    let output = run(&["study", &study, "--out", &folder.file("out")]);
    assert!(stdout(&output).contains("end to end right"), "{}", stdout(&output));
}

#[test]
fn parts_simulated_apart_are_joined_to_the_bytes_of_one_suite() {
    let folder = Folder::new("parts");
    let study = write_study(&folder, CLASSES);
    let (whole, parts) = (copy_of(all_records(), &folder), folder.file("parts"));
    let records = ["study", &study, "--suite", "records", "--out"];
    let share = |share| [&records[..], &[&parts, "--share", share]].concat();
    // Shares of two submissions, and a part that is damaged; the join simulates what is missing.
    run(&share("3/4"));
    run(&[&share("2/9")[..], &["--threads", "1"]].concat());
    let first = std::fs::read_dir(Path::new(&parts).join("parts")).unwrap().next();
    let first = first.unwrap().unwrap().path();
    let bytes = std::fs::read(&first).unwrap();
    std::fs::write(&first, &bytes[..bytes.len() / 2]).unwrap();
    assert!(!Path::new(&parts).join("dataset-ideal.parquet").exists());
    run(&["study", &parts, "--suite", "records"]);
    assert_same(&contents(Path::new(&whole)), &contents(Path::new(&parts)));
    let fitted = ["--scenario", "fitted"];
    run(&[&records[..], &[&whole], &fitted].concat());
    run(&[&share("1/1")[..], &fitted].concat());
    assert!(!Path::new(&parts).join("dataset-fitted.parquet").exists());
    run(&[&["study", &parts, "--suite", "records"], &fitted[..]].concat());
    assert_same(&contents(Path::new(&whole)), &contents(Path::new(&parts)));

    let other = folder.file("other.toml");
    std::fs::write(&other, tiny(CLASSES).replace("0.4, 0.6", "0.5, 0.6")).unwrap();
    fails(
        &["study", &other, "--suite", "records", "--out", &parts, "--share", "1/2"],
        3,
        "another study lies here",
    );
    let wrong =
        servotwin(&["study", &study, "--suite", "records", "--out", &parts, "--share", "3/2"]);
    assert_eq!(wrong.status.code(), Some(2), "{}", stderr(&wrong));
}

#[test]
fn recordings_are_studied_and_a_new_log_is_watched_with_what_they_taught() {
    let folder = Folder::new("recordings");
    let (study, out) = (folder.file("study.toml"), folder.file("out"));
    let text = "format = 1\nrecords = \"log.csv\"\nwindow_rows = 4\ngroups = [\"run\"]\nresiduals = [\"y\"]\n\
        [healthy]\nquality = \"good\"\n[novelty]\nhealthy_groups = 4\n\
        [[targets]]\ncolumn = \"state\"\nhealthy = \"none\"\n";
    std::fs::write(&study, text).unwrap();
    let mut log = String::from("y,run,state,quality\n");
    for row in 0..6 * 22 {
        let (run, is_leak) = (row / 22, row % 22 >= 8);
        let state = if is_leak { "leak" } else { "none" };
        let y = (row * 5 % 7) as f64 / 100.0 - if is_leak { 1.0 } else { 0.0 };
        log += &format!("{y},{run},{state},good\n");
    }
    std::fs::write(folder.file("log.csv"), log).unwrap();
    let said = succeeds(&["study", &study, "--out", &out]);
    let verdict = "state: random_forest answers 100.00 % (30 of 30) held-out windows right";
    assert!(said.contains(verdict), "{said}");
    assert!(said.contains("5 folds over 6 groups (run)"), "{said}");
    assert!(said.contains("beyond whole windows, not used") && said.contains("12 rows"), "{said}");
    assert!(said.contains("0.00 % (0 of 10) of the windows of later healthy groups"), "{said}");
    let new = folder.file("new.csv");
    let healthy = "0.0\n0.05\n0.03\n0.01\n";
    let leak = "-0.94\n-0.96\n-0.98\n-1.0\n-0.95\n";
    std::fs::write(&new, format!("y\n{healthy}{healthy}{leak}")).unwrap();
    let [model, novelty] =
        ["of-state", "novelty"].map(|what| format!("{out}/diagnoser-{what}.json"));
    let said = succeeds(&["watch", &new, "--model", &model]);
    let expected = "\n  rows 1 to 8: healthy\n  rows 9 to 12: leak\n";
    assert!(said.contains(expected) && said.contains("1 row\n"), "{said}");
    let said = succeeds(&["watch", &new, "--model", &model, "--json"]);
    let windows: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(windows["windows"][2]["finding"], "leak");
    let said = succeeds(&["watch", &new, "--model", &novelty]);
    assert!(said.contains("\n  rows 1 to 12: healthy\n"), "leaks were among what is good: {said}");
    let c = folder.file("c");
    succeeds(&["export", "c", "--model", &model, "--out", &c]);
    let header = std::fs::read_to_string(format!("{c}/servotwin_recording.h")).unwrap();
    assert!(header.contains("int servotwin_class_of("), "{header}");
    let own = folder.file("own.toml");
    std::fs::write(&own, text.replace("log.csv", "out/windows.parquet")).unwrap();
    fails(&["study", &own, "--out", &out], 2, "would overwrite");
    let html = folder.file("w.html");
    fails(&["watch", &new, "--model", &model, "--html", &html], 2, "takes no other option");
    fails(&["study", &study, "--full", "--out", &out], 2, "has one size");
}
