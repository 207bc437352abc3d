//! `watch` beside live streams: silence, other senders, outputs that fail.

use super::flights::learned;
use super::watch::flight;
use super::{Folder, met, servotwin, stderr, stdout};
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::net::UdpSocket;
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// A log with its map, a study and a diagnoser.
struct Rig {
    folder: Folder,
    log: String,
    map: String,
    study: String,
    model: String,
}

impl Rig {
    fn new(name: &str) -> Self {
        let folder = Folder::new(name);
        let (log, map) = (flight(&folder), folder.file("map.toml"));
        assert!(servotwin(&["watch", &log, "--make-map", &map]).status.success());
        let [study, model] = learned(&folder);
        Rig { folder, log, map, study, model }
    }

    /// The arguments of a watch.
    fn watch<'a>(&'a self, source: &'a str, more: &[&'a str]) -> Vec<&'a str> {
        let first = ["watch", source, "--map", &self.map, "--study", &self.study];
        [&first[..], &["--model", &self.model], more].concat()
    }

    /// Pipes the log into a watch of standard input, by way of a shell that may set limits.
    #[cfg(target_os = "linux")]
    fn piped(&self, limits: &str, more: &[&str]) -> Output {
        let script = format!("{limits} exec \"$0\" \"$@\"");
        let mut child = Command::new("sh")
            .args(["-c", &script, env!("CARGO_BIN_EXE_servotwin")])
            .args(self.watch("-", more))
            .args(["--json", "--heartbeat", "0s"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let log = std::fs::read(&self.log).unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let written = std::thread::spawn(move || stdin.write_all(&log));
        let output = child.wait_with_output().unwrap();
        let _ = written.join();
        output
    }
}

/// The changes among lines of JSON.
fn changes(text: &str) -> Vec<&str> {
    text.lines().filter(|line| line.starts_with("{\"time_s\"")).collect()
}

fn summary(text: &str) -> Value {
    let last: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    last.clone()
}

/// A watch that runs, and what it writes.
struct Running {
    child: Child,
    lines: Receiver<Value>,
}

impl Running {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_servotwin"))
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (send, lines) = channel();
        let out = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || {
            for line in out.lines() {
                let value = serde_json::from_str(&line.unwrap()).unwrap();
                if send.send(value).is_err() {
                    break;
                }
            }
        });
        Running { child, lines }
    }

    /// Feeds it until it writes a line of a kind.
    fn feed_until(&self, feed: &mut dyn FnMut(), is_wanted: impl Fn(&Value) -> bool) -> Value {
        // Many times what it takes on a busy machine; an error, not a measure.
        for _ in 0..60_000 {
            feed();
            if let Ok(line) = self.lines.recv_timeout(Duration::from_millis(2))
                && is_wanted(&line)
            {
                return line;
            }
        }
        panic!("what is waited for does not come");
    }

    fn interrupt(mut self) -> (i32, Value) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        let status = self.child.wait().unwrap();
        (status.code().unwrap(), self.lines.iter().last().unwrap().clone())
    }
}

fn is_event(name: &'static str) -> impl Fn(&Value) -> bool {
    move |line| line["event"] == name
}

/// Sends the rows of a log one after the other and again from its beginning, at times that go on.
struct Feeder {
    header: String,
    rows: Vec<Vec<String>>,
    sent: usize,
    socket: UdpSocket,
    to: String,
}

impl Feeder {
    fn new(log: &str, to: &str) -> Self {
        let text = std::fs::read_to_string(log).unwrap();
        let cells = |line: &str| line.split(',').map(str::to_owned).collect();
        Feeder {
            header: text.lines().next().unwrap().into(),
            rows: text.lines().skip(1).map(cells).collect(),
            sent: 0,
            socket: UdpSocket::bind("127.0.0.1:0").unwrap(),
            to: to.into(),
        }
    }

    /// The next row, without the value of a column.
    fn send(&mut self, left_out: Option<&str>) {
        let mut cells = self.rows[self.sent % self.rows.len()].clone();
        cells[0] = format!("{:.2}", 0.02 * self.sent as f64);
        for (cell, name) in cells.iter_mut().zip(self.header.split(',')) {
            if Some(name) == left_out {
                cell.clear();
            }
        }
        self.sent += 1;
        let datagram = format!("{}\n{}\n", self.header, cells.join(","));
        // Before it is listened to nobody takes it.
        let _ = self.socket.send_to(datagram.as_bytes(), &self.to);
    }
}

#[cfg(unix)]
#[test]
fn a_silent_stream_says_no_data_and_a_second_sender_is_not_mixed_in() {
    let rig = Rig::new("live-udp");
    let free = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let (source, events) = (format!("udp://{free}"), rig.folder.file("events.jsonl"));
    let more = ["--json", "--no-data-after", "300ms", "--heartbeat", "200ms", "--events", &events];
    let watch = Running::start(&rig.watch(&source, &more));
    let (mut own, mut other) =
        (Feeder::new(&rig.log, &free.to_string()), Feeder::new(&rig.log, &free.to_string()));
    watch.feed_until(&mut || own.send(None), |line| !line["place"].is_null());
    let silent = watch.feed_until(&mut || (), is_event("no_data"));
    assert_eq!(silent["state"], "no_data");
    assert!(silent["silent_s"].as_f64().unwrap() >= 0.3, "{silent}");
    let beat = watch.feed_until(&mut || (), is_event("heartbeat"));
    assert_eq!(beat["state"], "no_data", "it lives and does not say healthy: {beat}");
    let mut both = || {
        own.send(None);
        other.send(None);
    };
    let again = watch.feed_until(&mut both, is_event("data_again"));
    assert_ne!(again["wall_time"], silent["wall_time"]);
    // One column stops while the others go on.
    let is_of_pressure =
        |event| move |line: &Value| line["event"] == event && line["channel"] == "p_a_1";
    watch.feed_until(&mut || own.send(Some("p_a_1_pa")), is_of_pressure("channel_no_data"));
    watch.feed_until(&mut || own.send(None), is_of_pressure("channel_data_again"));
    let (code, summary) = watch.interrupt();
    assert_eq!(code, 0, "{summary}");
    assert!(summary["silences"]["source"].as_u64().unwrap() >= 1, "{summary}");
    let foreign = met(&summary, "foreign_sender");
    let expected = other.socket.local_addr().unwrap().to_string();
    assert!(foreign["first"].as_str().unwrap().ends_with(&expected), "{summary}");
    let kept = std::fs::read_to_string(&events).unwrap();
    for event in ["no_data", "data_again", "heartbeat", "channel_no_data"] {
        assert!(kept.contains(&format!("{{\"event\":\"{event}\"")), "{event}");
    }
    let wrong: &[(&[&str], &str)] = &[
        (&["--no-data-after", "0s"], "0.1 s to 86,400 s"),
        (&["--no-data-after", "2bar"], "--no-data-after"),
    ];
    for (more, message) in wrong {
        let output = servotwin(&rig.watch(&source, more));
        assert_eq!(output.status.code(), Some(2), "{more:?}");
        assert!(stderr(&output).contains(message), "{more:?}: {}", stderr(&output));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_is_full_ends_no_live_diagnosis() {
    let rig = Rig::new("live-full");
    let whole = rig.piped("", &[]);
    let (told, warned) = (stdout(&whole), stderr(&whole));
    assert_eq!(whole.status.code(), Some(0), "{warned}");
    // No file may be larger than 8 KiB: the checkpoint does not fit.
    let limits = "trap '' XFSZ; ulimit -f 16;";
    let checkpoint = rig.folder.file("a.json");
    let cases: &[(&str, &[&str], &[&str])] = &[
        ("", &["--events", "/dev/full"], &["/dev/full"]),
        (limits, &["--checkpoint", &checkpoint], &[&checkpoint]),
        (
            limits,
            &["--events", "/dev/full", "--checkpoint", &checkpoint],
            &["/dev/full", &checkpoint],
        ),
    ];
    for (limits, more, failed) in cases {
        let output = rig.piped(limits, more);
        let (text, notes) = (stdout(&output), stderr(&output));
        assert_eq!(output.status.code(), Some(1), "{more:?}: {notes}");
        assert_eq!(changes(&text), changes(&told), "{more:?}: the findings stay");
        let summary = summary(&text);
        assert_eq!(summary["samples"], 401);
        let error = notes.lines().last().unwrap();
        for name in *failed {
            assert!(summary["failed"][name].is_string(), "{name}: {summary}");
            assert!(error.starts_with("error: not complete: ") && error.contains(name), "{notes}");
            assert!(notes.matches(&format!("{name} failed")).count() <= 1, "{notes}");
        }
    }
    let left = |entry: std::io::Result<std::fs::DirEntry>| {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        name.ends_with(".tmp") || name == "a.json"
    };
    assert!(!std::fs::read_dir(&rig.folder.0).unwrap().any(left), "nothing half-written");
    // A line that does not fit is not there by half.
    let events = rig.folder.file("events.jsonl");
    let limited = rig.piped("trap '' XFSZ; ulimit -f 1;", &["--events", &events]);
    let kept = std::fs::read_to_string(&events).unwrap();
    assert!(kept.is_empty() || kept.ends_with('\n'), "{kept}");
    assert!(told.starts_with(&kept), "{}", stderr(&limited));
    // A log can be read again: there it is an error, as it was.
    let output = servotwin(&rig.watch(&rig.log, &["--events", "/dev/full"]));
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("/dev/full: the disk is full"), "{}", stderr(&output));
}

#[test]
fn a_checkpoint_of_another_format_or_a_damaged_one_is_refused() {
    let rig = Rig::new("live-checkpoint");
    let checkpoint = rig.folder.file("c.json");
    let with = |more: &[&'static str]| {
        let first = rig.watch(&rig.log, &["--checkpoint", &checkpoint]);
        servotwin(&[&first[..], more].concat())
    };
    assert!(with(&[]).status.success());
    assert!(with(&["--resume"]).status.success());
    let whole = std::fs::read_to_string(&checkpoint).unwrap();
    let (head, body) = whole.split_once('\n').unwrap();
    let other = head.replace("\"format\":1", "\"format\":2");
    let zero = body.replace("\"period_s\":4", "\"period_s\":0");
    for (text, message) in [
        (&*other, "format 2, this version reads 1; begin anew without --resume"),
        (&format!("{head}\n{zero}"), "its checksum is wrong"),
        (&whole[..whole.len() / 2], "its checksum is wrong"),
        ("", "no checkpoint that can be used"),
    ] {
        std::fs::write(&checkpoint, text).unwrap();
        let output = with(&["--resume"]);
        assert_eq!(output.status.code(), Some(3), "{message}: {}", stderr(&output));
        assert!(stderr(&output).contains(message), "{}", stderr(&output));
        assert_eq!(stderr(&output).lines().count(), 1, "{}", stderr(&output));
    }
}
