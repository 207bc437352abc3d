//! No result takes the place of what it was made from, of another result, or the name of another kind of file.

use super::{Folder, SPRING, fails, servotwin, stderr};
use std::fs;
use std::process::Command;

/// A folder with files that commands read. They are refused before they would find that these are no logs.
fn inputs(name: &str) -> Folder {
    let folder = Folder::new(name);
    for input in ["a.csv", "b.html", "m.json", "own.toml", "c.jsonl"] {
        fs::write(folder.file(input), "time_s,command_rad\n0,0\n1,0\n").unwrap();
    }
    let study = "name = \"s\"\nsystem = \"own.toml\"\n[command]\ninput = \"command\"\n";
    fs::write(folder.file("study.toml"), study).unwrap();
    fs::hard_link(folder.file("a.csv"), folder.file("hard.html")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(folder.file("a.csv"), folder.file("soft.html")).unwrap();
    folder
}

#[test]
fn no_output_overwrites_an_input_or_another_output() {
    let folder = inputs("overwritten");
    let cases: &[(&str, &str)] = &[
        ("watch A/a.csv --html A/a.csv", "--html A/a.csv would overwrite the log A/a.csv"),
        ("watch A/a.csv --html A/hard.html", "would overwrite the log A/a.csv"),
        ("watch A/a.csv --html A/soft.html", "would overwrite the log A/a.csv"),
        ("watch A/c.jsonl --events A/./c.jsonl", "would overwrite the log A/c.jsonl"),
        ("watch A/a.csv --checkpoint A/a.csv", "--checkpoint A/a.csv would overwrite the log"),
        (
            "watch A/a.csv --model A/m.json --checkpoint A/m.json",
            "overwrite the diagnoser A/m.json",
        ),
        (
            "watch A/a.csv --events A/new.log --checkpoint A/./new.log",
            "--events A/new.log and --checkpoint A/./new.log are the same file",
        ),
        ("fit A/a.csv --out A/a.csv", "--out A/a.csv would overwrite LOG A/a.csv"),
        ("fit A/a.csv A/own.toml --out A/own.toml", "would overwrite SYSTEM A/own.toml"),
        ("fit A/a.csv --study A/study.toml --out A/own.toml", "the study's system A/own.toml"),
        ("history A --out A/a.csv", "--out A/a.csv would overwrite the log A/a.csv"),
        (
            "simulate --command table:file=A/a.csv,column=command_rad --out A/a.csv",
            "--out A/a.csv would overwrite the table A/a.csv",
        ),
        ("simulate --input load=table:file=A/a.csv,column=b --out A/a.csv", "the table A/a.csv"),
        ("describe A/own.toml --schematic A/own.toml", "would overwrite SYSTEM A/own.toml"),
        ("watch A/a.csv --html A/x.csv", "--html must end in .html, not as A/x.csv does"),
        ("fit A/a.csv --out A/x.csv", "--out must end in .toml, not as A/x.csv does"),
        ("simulate --plot A/x.pdf", "--plot must end in .svg, not as A/x.pdf does"),
    ];
    let read = || {
        let files = ["a.csv", "m.json", "own.toml", "c.jsonl", "study.toml"];
        files.map(|file| fs::read(folder.file(file)).unwrap())
    };
    let before = read();
    let root = folder.file("");
    let root = root.trim_end_matches('/');
    for (arguments, message) in cases {
        let own: Vec<String> =
            arguments.split(' ').map(|word| word.replace("A/", &format!("{root}/"))).collect();
        let own: Vec<&str> =
            own.iter().map(|word| if word == "A" { root } else { word.as_str() }).collect();
        let output = servotwin(&own);
        let text = stderr(&output);
        let wanted = message.replace("A/", &format!("{root}/"));
        assert_eq!(output.status.code(), Some(2), "{arguments}: {text}");
        assert!(text.contains(&wanted), "{arguments}: {text}");
    }
    assert_eq!(read(), before);
    assert!(!std::path::Path::new(&folder.file("new.log")).exists());
}

#[cfg(unix)]
#[test]
fn a_device_takes_several_outputs() {
    let step = ["simulate", SPRING, "--command", "1deg", "--duration", "50ms", "-q"];
    let folder = Folder::new("devices");
    let out = folder.file("a.csv");
    assert!(servotwin(&[&step[..], &["--out", &out]].concat()).status.success());
    let null = ["--html", "/dev/null", "--events", "/dev/null", "--checkpoint", "/dev/null"];
    let text = stderr(&servotwin(&[&["watch", &out][..], &null].concat()));
    assert!(!text.contains("same file") && !text.contains("overwrite"), "{text}");
}

/// A limit on the size of files is met as a full disk is: with the file's name, and without a file left behind.
#[cfg(unix)]
#[test]
fn a_limit_on_the_size_of_files_is_reported() {
    let folder = Folder::new("file-size");
    let run = ["simulate", "spring_actuator", "--command", "step:size=5deg", "--duration", "5s"];
    let out = folder.file("big.csv");
    let output = std::process::Command::new("sh")
        .args(["-c", "ulimit -f 20; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_servotwin")])
        .args(run)
        .args(["--compile", "never", "--out", &out])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let expected = format!("{out}: the file would exceed the limit of size");
    assert!(stderr(&output).contains(&expected), "{}", stderr(&output));
    assert_eq!(fs::read_dir(&folder.0).unwrap().count(), 0);
}

#[cfg(target_os = "linux")]
#[test]
fn a_device_or_a_pipe_is_no_document_no_model_and_no_log() {
    let folder = Folder::new("no-documents");
    let [log, pipe] = ["log.csv", "pipe"].map(|name| folder.file(name));
    fs::write(&log, "time_s,command_m,p_a_pa,p_b_pa,x_p_m\n0,0,0,0,0\n1,0,0,0,0\n").unwrap();
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    // A writer that writes nothing: whoever opens the pipe gets an end, and the test does not hang.
    let written = pipe.clone();
    std::thread::spawn(move || while fs::OpenOptions::new().write(true).open(&written).is_ok() {});
    for (file, kind) in
        [("/dev/zero", "device"), ("/dev/tty", "device"), (pipe.as_str(), "named pipe")]
    {
        for arguments in [
            &["check", file][..],
            &["describe", file],
            &["simulate", file, "--duration", "1s"],
            &["watch", &log, "--study", "press_axis", "--map", file],
            &["watch", &log, "--study", "press_axis", "--model", file],
            &["watch", file, "--study", "press_axis"],
            &["fit", file, "--study", "press_axis"],
            &["features", "--study", file],
        ] {
            let output = servotwin(arguments);
            let told = stderr(&output);
            assert_eq!(output.status.code(), Some(3), "{arguments:?}: {told}");
            let refusal = format!("this is a {kind}, a regular file is needed");
            assert!(told.contains(&refusal), "{arguments:?}: {told}");
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_place_that_takes_no_file_is_named_before_the_run() {
    let folder = Folder::new("no-place");
    let page = folder.file("report.html");
    fs::write(&page, "").unwrap();
    for (path, problem) in [
        ("/proc/x.html", "read-only, it cannot be written"),
        (&folder.file("none/x.html"), "the folder"),
        (&format!("{page}/x.html"), "a part of this path is a file"),
    ] {
        let told = fails(&["watch", &page, "--html", path], 1);
        assert!(told.contains(path) && told.contains(problem), "{told}");
    }
    let told = fails(&["study", "spring_actuator", "--out", "/proc/results"], 1);
    assert!(told.contains("/proc/results: read-only, it cannot be written"), "{told}");
}
