//! `serve`: a server that ends with whoever started it, and sources that cannot be shown.

use super::{Folder, fails};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

#[test]
fn a_server_ends_with_its_standard_input_if_it_is_to() {
    let mut server = Command::new(env!("CARGO_BIN_EXE_servotwin"))
        .args(["serve", "--port", "0", "--end-with-stdin"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut link = String::new();
    BufReader::new(server.stdout.take().unwrap()).read_line(&mut link).unwrap();
    assert!(link.starts_with("http://127.0.0.1:"), "{link}");
    assert_eq!(server.try_wait().unwrap(), None, "it runs while its input is open");
    drop(server.stdin.take());
    assert!(server.wait().unwrap().success());
}

#[test]
fn a_source_that_cannot_be_shown_says_why_before_anything_is_trained() {
    let folder = Folder::new("serve-source");
    let log = folder.file("other.csv");
    std::fs::write(&log, "a,b\n1,2\n").unwrap();
    for (arguments, code, reason) in [
        (vec!["--source", "nothing.csv"], 2, "nothing.csv is a file, and --source shows a stream"),
        (vec!["--source", &log], 2, "--html FILE writes its page"),
        (vec!["--source", "udp://127.0.0.1:0"], 2, "a live stream needs --map"),
        (vec!["--source", "-", "--specimen", "1"], 2, "cannot be used with"),
        (vec!["--source", "-", "--end-with-stdin"], 2, "--source - reads standard input"),
    ] {
        let message = fails(&[&["serve", "--port", "0"], &arguments[..]].concat(), code);
        assert!(message.contains(reason), "{message}");
    }
}
