//! `serve`: a session as one page, and a server that ends with whoever started it.

use super::{Folder, fails, succeeds};
use serde_json::json;
use servotwin_serve::SavedSession;
use servotwin_serve::feed::{Frame, Message};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// A saved session with one frame.
fn session(folder: &Folder) -> String {
    let signals = json!([{ "id": "position", "label": "answer", "unit": "mm" }]);
    let about = json!({ "title": "a flight", "period_s": 0.01, "signals": signals });
    let mut frame = Frame::new(0, 1);
    frame.values().extend([0.5, 1.0]);
    let session = SavedSession { about, messages: vec![Message::Frame(frame.bytes())] };
    let path = folder.file("session.parquet");
    session.write(path.as_ref()).unwrap();
    path
}

#[test]
fn a_session_becomes_one_page_and_never_a_folder() {
    let folder = Folder::new("saved-page");
    let (session, page) = (session(&folder), folder.file("session.html"));
    let said = succeeds(&["serve", "--replay", &session, "--html", &page]);
    assert_eq!(said.trim(), page);
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.starts_with("<!doctype html>") && html.contains("id=\"session\">"));
    std::fs::create_dir(folder.file("folder.html")).unwrap();
    let message = fails(&["serve", "--replay", &session, "--html", &folder.file("folder.html")], 1);
    assert!(message.contains("this is a folder"), "{message}");
    let message = fails(&["serve", "--html", &page], 2);
    assert!(message.contains("--replay"), "{message}");
    let names = std::fs::read_dir(&folder.0).unwrap().map(|entry| entry.unwrap().file_name());
    assert_eq!(names.count(), 3, "session, page and folder");
}

#[test]
fn a_server_ends_with_its_standard_input_if_it_is_to() {
    let folder = Folder::new("serve-stdin");
    let mut server = Command::new(env!("CARGO_BIN_EXE_servotwin"))
        .args(["serve", "--port", "0", "--end-with-stdin", "--replay", &session(&folder)])
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
        (vec!["--source", "nothing.csv"], 3, "nothing.csv: no such file"),
        (vec!["--source", &log], 3, "no column is a sensor"),
        (vec!["--source", "udp://127.0.0.1:0"], 2, "a live stream needs --map"),
        (vec!["--source", "-", "--specimen", "1"], 2, "cannot be used with"),
        (vec!["--source", "-", "--end-with-stdin"], 2, "--source - reads standard input"),
    ] {
        let message = fails(&[&["serve", "--port", "0"], &arguments[..]].concat(), code);
        assert!(message.contains(reason), "{message}");
    }
}
