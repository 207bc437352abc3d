//! A diagnosis as C, exported and proven as users do it.

use super::flights::learned;
use super::{Folder, fails, stderr, succeeds};
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// A folder with a trained diagnoser, and its export.
fn exported(name: &str) -> (Folder, String, String) {
    let folder = Folder::new(name);
    learned(&folder);
    let (model, out) = (folder.file("out/diagnoser-noise.json"), folder.file("export"));
    succeeds(&["export", "c", "--model", &model, "--out", &out]);
    (folder, model, out)
}

#[test]
fn an_export_is_proven_until_a_digit_of_it_changes() {
    let (_folder, _, out) = exported("export-proven");
    let text = succeeds(&["prove", &out, "--hours", "0.02", "--mutants", "6"]);
    assert!(text.contains("same bits  gcc") && text.contains("6 of 6 mistakes found"), "{text}");
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
    let message = fails(&["prove", &out, "--hours", "0"], 1);
    assert!(message.contains("decides otherwise than its diagnoser"), "{message}");
    let proof = fs::read_to_string(&certificate).unwrap();
    assert!(proof.contains("\"holds\": false"), "a refused export keeps no good certificate");
}

#[test]
fn the_small_main_reads_samples_and_names_a_broken_line() {
    let (_folder, _, out) = exported("export-main");
    let sources = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path());
    let sources = sources.filter(|path| path.extension().is_some_and(|ending| ending == "c"));
    let program = Path::new(&out).join("diagnose");
    let flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-O1"];
    let mut compiler = Command::new("cc");
    compiler.args(flags).args(sources).arg("-o").arg(&program).arg("-lm");
    let compiled = compiler.output().unwrap();
    assert!(compiled.status.success(), "{}", stderr(&compiled));
    let mut run = Command::new(&program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    run.stdin.take().unwrap().write_all(b"nan 1 2\n").unwrap();
    let output = run.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).starts_with("the last line has 3 of "), "{}", stderr(&output));
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
    let other = folder.file("other.json");
    fs::write(&other, fs::read_to_string(&model).unwrap() + "\n").unwrap();
    let message = fails(&["prove", &out, "--model", &other], 3);
    assert!(message.contains("is not the one that was exported"), "{message}");
    let message = fails(&["export", "c", "--model", &folder.file("none.json"), "--out", &out], 3);
    assert!(message.contains("none.json"), "{message}");
    assert!(Path::new(&out).join("servotwin_session.c").exists(), "the earlier export stays");
}
