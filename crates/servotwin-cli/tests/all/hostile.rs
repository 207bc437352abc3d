//! Text of somebody else's files never reaches the terminal as something that it acts on: whatever a file calls its
//! columns, classes, titles and keys.

use crate::house::sources;
use crate::{Folder, servotwin, stderr, stdout};
use std::fs;
use std::path::Path;

/// Red, a window title, text from right to left, a control sequence of C1, delete and a carriage return.
const EVIL: &str = "d\u{1b}[31mRED\u{1b}]0;pwn\u{7}\u{202e}gnp.exe\u{2066}\u{9b}2J\u{7f}\rz";

fn is_active(character: &char) -> bool {
    let turns = ['\u{61c}', '\u{200e}', '\u{200f}'].contains(character)
        || ('\u{202a}'..='\u{202e}').contains(character)
        || ('\u{2066}'..='\u{2069}').contains(character);
    turns || (character.is_control() && !['\n', '\t'].contains(character))
}

/// Runs a command and checks what it prints; whether it ends well, and what it printed.
fn run(arguments: &[&str]) -> (bool, String) {
    let output = servotwin(arguments);
    let printed = stdout(&output) + &stderr(&output);
    let active = printed.chars().find(is_active);
    assert_eq!(active, None, "{arguments:?} prints {active:?}:\n{}", printed.escape_debug());
    (output.status.success(), printed)
}

fn succeeds(arguments: &[&str]) -> String {
    let (done, printed) = run(arguments);
    assert!(done, "{arguments:?}: {printed}");
    printed
}

fn fails(arguments: &[&str]) -> String {
    let (done, printed) = run(arguments);
    assert!(!done, "{arguments:?} ends well: {printed}");
    printed
}

#[test]
fn a_message_about_a_long_text_is_short() {
    let folder = Folder::new("hostile-long");
    let model = folder.file("long.json");
    fs::write(&model, format!("\"{}\"", "x".repeat(1_000_000))).unwrap();
    let message = fails(&["export", "c", "--model", &model, "--out", &folder.file("export")]);
    assert!(message.contains("no model of servotwin: invalid type: string"), "{message}");
    assert!(message.len() < 5000, "{}", message.len());
    let log = folder.file("long.csv");
    fs::write(&log, format!("\n{}", ",".repeat(1_100_000))).unwrap();
    let message = fails(&["watch", &log]);
    assert!(message.contains("line 2 is longer than 1 MiB"), "{message}");
}

#[test]
fn labels_and_columns_of_a_hostile_table_are_printed_escaped() {
    let folder = Folder::new("hostile-table");
    let table = folder.file("table.csv");
    let mut text = format!("\"{EVIL}\",\"group {EVIL}\",constant,\"class{EVIL}\"\n");
    for row in 0..24_u32 {
        let class = if row < 12 { format!("bad {EVIL}") } else { "good".into() };
        text += &format!("{},\"{EVIL}{}\",1,\"{class}\"\n", row % 2 * 5 + row % 3, row % 4);
    }
    fs::write(&table, text).unwrap();
    let (study, out) = (folder.file("traces.toml"), folder.file("out"));
    let evil: String = EVIL.chars().map(|c| format!("\\u{:04X}", u32::from(c))).collect();
    let of_label = |label: &str| {
        format!(
            "format = 1\nrecords = \"table.csv\"\nwindow_rows = 4\nkeep = [\"{label}{evil}\"]\nresiduals = [\"{evil}\"]\n"
        )
    };
    fs::write(&study, of_label("class")).unwrap();
    let judge = ["study", &study, "--out", &out];
    succeeds(&judge);
    let windows = servotwin::table::Table::read(format!("{out}/windows.parquet")).unwrap();
    assert!(windows.has(&format!("class{EVIL}")), "files keep what they hold");
    fs::write(&study, of_label("clas")).unwrap();
    fails(&judge);
    fails(&["fit", &table]);
    let log = fails(&["history", &table, &table]);
    assert!(!log.is_empty());
}

#[test]
fn names_of_hostile_files_are_printed_escaped() {
    let folder = Folder::new("hostile-names");
    let name = folder.file(&EVIL.replace('\r', ""));
    for arguments in [
        &["check", &name][..],
        &["describe", &name],
        &["fit", &name],
        &["watch", &name],
        &["run", "cases#1@ideal", &name],
        &["report", &name],
        &["report", &name],
    ] {
        fails(arguments);
    }
}

#[test]
fn titles_and_keys_of_hostile_studies_and_systems_are_printed_escaped() {
    let folder = Folder::new("hostile-study");
    let evil: String = EVIL.chars().map(|c| format!("\\u{:04X}", u32::from(c))).collect();
    let system = fs::read_to_string(crate::SPRING).unwrap();
    let title = system.lines().find(|line| line.starts_with("title =")).unwrap().to_owned();
    let path = folder.file("system.toml");
    fs::write(&path, system.replace(&title, &format!("title = \"{evil}\""))).unwrap();
    let printed = succeeds(&["describe", &path]);
    assert!(printed.contains(r"d\u001b[31mRED"), "{printed}");
    succeeds(&["check", &path]);
    let broken = folder.file("broken.toml");
    fs::write(&broken, system.replace(&title, &format!("title = \"a\"\n\"{evil}\" = \"{evil}\"")))
        .unwrap();
    fails(&["check", &broken]);
    let raw = folder.file("raw.toml");
    fs::write(&raw, system.replace(&title, &format!("title = \"{EVIL}\""))).unwrap();
    fails(&["check", &raw]);
    let study = folder.file("study.toml");
    fs::write(&study, format!("format = 1\nname = \"a\"\ntitle = \"{evil}\"\n\"{evil}\" = 1\n"))
        .unwrap();
    fails(&["check", &study]);
    fails(&["study", &study, "--out", &folder.file("out")]);
}

#[test]
fn keys_of_hostile_logs_are_printed_escaped() {
    let folder = Folder::new("hostile-log");
    let key = serde_json::to_string(EVIL).unwrap();
    let log = folder.file("log.jsonl");
    let line = |k: u32| format!("{{\"t\":{},{key}:{k},\"s\":{key}}}\n", f64::from(k) * 0.01);
    fs::write(&log, (0..300).map(line).collect::<String>()).unwrap();
    let map = folder.file("map.toml");
    run(&["watch", &log, "--make-map", &map]);
    run(&["watch", &log, "--make-map", &map, "--json"]);
    run(&["watch", &log, "--map", &map]);
    fails(&["fit", &log]);
}

/// A second writer would let hostile text through.
#[test]
fn every_command_writes_through_the_place_that_escapes() {
    let files = sources(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src")));
    assert!(files.len() > 30, "{} files", files.len());
    for file in files.into_iter().filter(|file| !file.ends_with("out.rs")) {
        let text = fs::read_to_string(&file).unwrap();
        for past in ["io::stdout", "io::stderr", "println!(", " print!(", "eprint"] {
            assert!(!text.contains(past), "{}: {past} (see out.rs)", file.display());
        }
    }
}
