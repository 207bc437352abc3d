//! The binary is run as its users run it: results, messages, exit codes.

#![expect(clippy::too_many_lines, reason = "a test may list many cases")]

mod actuators;
mod book;
mod cache;
mod documents;
mod export;
mod first_hour;
mod fit;
mod flights;
mod hostile;
mod house;
mod live;
mod paths;
mod reading;
mod readme;
mod safety;
#[cfg(feature = "serve")]
mod serve;
mod study;
mod watch;

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

const SPRING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../systems/spring_actuator.toml");

fn servotwin(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_servotwin"));
    command.args(arguments).output().expect("the binary can be run")
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

/// Runs a command that must end well; what it printed.
fn succeeds(arguments: &[&str]) -> String {
    let output = servotwin(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    stdout(&output)
}

/// Runs a command that must end with this code; its message.
fn fails(arguments: &[&str], code: i32) -> String {
    let output = servotwin(arguments);
    let text = stderr(&output) + &stdout(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    assert!(!text.contains("panicked"), "{text}");
    text
}

fn json(arguments: &[&str]) -> serde_json::Value {
    let output = servotwin(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    serde_json::from_slice(&output.stdout).expect("valid JSON")
}

/// A kind of irregularity in the document of a watch; null if it was not met.
fn met<'w>(watched: &'w serde_json::Value, kind: &str) -> &'w serde_json::Value {
    let mut all = watched["met"].as_array().unwrap().iter();
    all.find(|one| one["kind"] == kind).unwrap_or(&serde_json::Value::Null)
}

/// Tests run simultaneously, and two may choose the same name.
static MADE: AtomicUsize = AtomicUsize::new(0);

/// A folder of its own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let (program, number) = (std::process::id(), MADE.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(format!("servotwin-{program}-{number}-{name}"));
        std::fs::create_dir_all(&path).expect("a temporary folder");
        Self(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }
}

/// A folder that the first test to need it fills, and that all tests read or copy. It stays until the next run of the
/// tests, because nobody knows who is the last.
struct Shared {
    name: &'static str,
    filled: OnceLock<PathBuf>,
}

impl Shared {
    const fn new(name: &'static str) -> Self {
        Self { name, filled: OnceLock::new() }
    }

    /// The folder; `fill` is called once.
    fn get(&self, fill: impl FnOnce(&Path)) -> &Path {
        self.filled.get_or_init(|| {
            let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(self.name);
            let _ = std::fs::remove_dir_all(&path);
            std::fs::create_dir_all(&path).expect("a temporary folder");
            fill(&path);
            path
        })
    }
}

/// Copies a folder with everything in it.
fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy_folder(&from, &to);
        } else {
            std::fs::copy(from, to).unwrap();
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn a_step_is_followed_and_written() {
    let folder = Folder::new("step");
    let (csv, parquet, svg) =
        (folder.file("a.csv"), folder.file("a.parquet"), folder.file("a.svg"));
    let run = |out: &str| {
        json(&[
            "simulate",
            "--command",
            "step:size=10deg,at=0.1s",
            "--load",
            "0%",
            "--duration",
            "1s",
            "--record",
            "aileron,x_p_1,command",
            "--json",
            "--quiet",
            "--out",
            out,
            "--plot",
            &svg,
        ])
    };
    let summary = run(&csv);
    assert_eq!(summary, run(&parquet), "a run gives the same twice");
    let recorded = summary["recorded"].as_array().unwrap();
    let angle = recorded.iter().find(|r| r["name"] == "aileron.angle_rad").unwrap();
    // physics.md 7.1: 10.00° at no load.
    let end_deg = angle["end"].as_f64().unwrap().to_degrees();
    assert!((end_deg - 10.0).abs() < 0.1, "{end_deg}");
    assert_eq!(summary["samples"], 101);
    let from_csv = servotwin::table::Table::read(&csv).unwrap();
    let from_parquet = servotwin::table::Table::read(&parquet).unwrap();
    assert_eq!(from_csv.row_count(), 101);
    assert_eq!(from_csv.f64("x_p_1_m").unwrap(), from_parquet.f64("x_p_1_m").unwrap());
    assert!(std::fs::read_to_string(&svg).unwrap().starts_with("<svg"));
    let files = std::fs::read_dir(&folder.0).unwrap().count();
    assert_eq!(files, 3, "no temporary file is left");
}

#[test]
fn a_fault_changes_the_result() {
    let run = |more: &[&str]| {
        let first = ["simulate", SPRING, "--command", "5deg", "--json", "-q"];
        json(&[&first, more, &["--duration", "200ms"]].concat())
    };
    let healthy = run(&[]);
    let zero = run(&["--fault", "servo_valve.clogging_pa=0"]);
    assert_eq!(zero["recorded"], healthy["recorded"], "zero intensity is healthy");
    let faulty = run(&["--fault", "servo_valve.bias_positive=50%"]);
    assert_eq!(faulty["faults"][0]["intensity"], 0.5);
    assert_ne!(faulty["recorded"], healthy["recorded"]);
}

#[test]
fn faults_are_listed_in_two_forms() {
    let list = json(&["describe", "--faults", "--json"]);
    let list = list["faults"].as_array().unwrap();
    assert!(list.len() > 80, "{}", list.len());
    let clogging = list.iter().find(|f| f["id"] == "actuator_1.servo_valve.clogging_pa").unwrap();
    assert_eq!(clogging["category"], "clogging");
    assert_eq!(clogging["unit"], "m");
    let ratio =
        clogging["at_intensity_1"].as_f64().unwrap() / clogging["healthy"].as_f64().unwrap();
    assert!((ratio - 0.05).abs() < 1e-12);
    let text = stdout(&servotwin(&["describe", "--faults"]));
    assert!(text.contains(&format!("{} faults", list.len())));
}

#[test]
fn a_system_is_described() {
    let folder = Folder::new("describe");
    let svg = folder.file("schematic.svg");
    let description = json(&["describe", SPRING, "--json", "--schematic", &svg]);
    let states = description["states"].as_array().unwrap().len();
    let eigenvalues = description["eigenvalues_per_s"].as_array().unwrap();
    assert_eq!(eigenvalues.len(), states);
    let stable = eigenvalues.iter().all(|value| value[0].as_f64().unwrap() < 1e-6);
    assert!(stable, "{eigenvalues:?}");
    assert!(std::fs::read_to_string(&svg).unwrap().contains("servo_valve"));
    let text = stdout(&servotwin(&["describe", SPRING]));
    for part in ["Components", "States at rest", "Inputs", "Sensors", "Eigenvalues"] {
        assert!(text.contains(part), "{part}");
    }
}

#[test]
fn files_are_checked_with_their_places() {
    let folder = Folder::new("check");
    let good = servotwin(&["check", SPRING]);
    assert!(good.status.success() && stdout(&good).contains("no mistakes"), "{}", stderr(&good));
    let wrong = folder.file("wrong.toml");
    let text = std::fs::read_to_string(SPRING)
        .unwrap()
        .replace("kind = \"cylinder\"", "kind = \"cilinder\"");
    std::fs::write(&wrong, text).unwrap();
    let output = servotwin(&["check", &wrong]);
    assert_eq!(output.status.code(), Some(3));
    assert!(
        stderr(&output).contains("wrong.toml:") && stderr(&output).contains("cilinder"),
        "{}",
        stderr(&output)
    );
    let output = servotwin(&["check", &wrong, "--json"]);
    assert_eq!(output.status.code(), Some(3));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["document"], &report["exit_code"]), (&"failure".into(), &3.into()));
    assert!(report["mistakes"][0]["line"].as_u64().unwrap() > 1);
}

#[test]
fn wrong_use_is_told_and_has_its_exit_code() {
    let cases: &[(&[&str], i32, &str)] = &[
        (&[], 2, "Usage"),
        (&["simulat"], 2, "simulate"),
        (&["check", "/nowhere.toml"], 3, "/nowhere.toml: no such file"),
        (&["simulate", "press_axs"], 3, "error: press_axs: no such file, and nothing is built in"),
        (&["check", "press_axs"], 3, "did you mean 'press_axis'?"),
        (&["study", "nosuch"], 3, "there are paper, spring_actuator, press_axis"),
        (&["study", "--threads", "0"], 2, "a number of threads is 1 or more"),
        (&["simulate", "--command", "stp:size=1"], 2, "unknown kind of signal 'stp'"),
        (&["simulate", "--command", "200bar"], 2, "--command: constant: 'value=200bar'"),
        (&["simulate", "--input", "mode"], 2, "--input needs NAME=VALUE"),
        (&["simulate", "--input", "comand=1"], 2, "did you mean 'command'?"),
        (&["simulate", "--command", "1deg", "--input", "command=1"], 2, "given twice"),
        (
            &["simulate", "--fault", "actuator_1.servo_valve.clogging_paa=1"],
            2,
            "did you mean 'actuator_1.servo_valve.clogging_pa'?",
        ),
        (
            &["simulate", "--fault", "actuator_1.servo_valve.clogging_pa=1.5"],
            2,
            "allowed are 0 … 1",
        ),
        (
            &["simulate", "--fault", "actuator_1.servo_valve.clogging_pa=x"],
            2,
            "'x' is not a number",
        ),
        (&["simulate", "--duration", "5Hz"], 2, "allowed: s, ms"),
        (&["simulate", "--duration=-5s"], 2, "--duration -5s is out of range"),
        (&["simulate", "--record", "x_p_9"], 2, "no quantity 'x_p_9'; did you mean"),
        (&["simulate", "--out", "a.xls"], 2, "a.xls"),
        (&["simulate", "--plot", "a.pdf"], 2, "a.pdf"),
        (&["simulate", "--method", "euler"], 2, "rodas4p2"),
        (&["simulate", "--method", "rk4"], 2, "give --step"),
        (&["simulate", "--step", "1ms", "--tolerance", "1e-3"], 2, "cannot be used with"),
        (
            &["simulate", "--duration", "1s", "--command", "table:file=/nowhere.csv,column=a"],
            3,
            "no such file",
        ),
        (&["simulate", SPRING, "--duration", "20ms", "--out", "/nowhere/a.csv"], 1, "/nowhere"),
        (
            &["simulate", SPRING, "--duration", "2s", "--method", "rk4", "--step", "10ms"],
            1,
            "the run stopped at",
        ),
    ];
    for (arguments, code, message) in cases {
        let output = servotwin(arguments);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(*code), "{arguments:?}: {text}");
        assert!(text.contains(message), "{arguments:?}: {text}");
        assert!(!text.contains("panicked"), "{arguments:?}: {text}");
    }
}

#[test]
fn a_reader_that_leaves_early_is_no_failure() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_servotwin"))
        .args(["describe"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let mut text = String::new();
    let mut errors = child.stderr.take().unwrap();
    errors.read_to_string(&mut text).unwrap();
    assert!(child.wait().unwrap().success());
    assert_eq!(text, "");
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_no_file() {
    let folder = Folder::new("interrupt");
    let out = folder.file("a.csv");
    let mut child = Command::new(env!("CARGO_BIN_EXE_servotwin"))
        .args(["simulate", "--duration", "100000s", "--rate", "10Hz"])
        .args(["--command", "sine:amplitude=1deg,frequency=0.1Hz", "--record", "x_p_1"])
        .args(["--out", &out])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 0);
}

#[test]
fn completions_know_the_commands() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let output = servotwin(&["tools", "completions", shell]);
        assert!(output.status.success());
        for command in ["simulate", "catalog", "describe", "check"] {
            assert!(stdout(&output).contains(command), "{shell} {command}");
        }
    }
}
