//! Scripts of the page in Node, where there is one: what the page keeps of an hour, and a page that holds its session.

use serde_json::{Value, json};
use servotwin_serve::feed::{Frame, Message};
use servotwin_serve::{SavedSession, saved_page};
use std::process::Command;

/// What `page.cjs` reports; `None` without Node.
fn report(arguments: &[&str]) -> Option<Value> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/all/page.cjs");
    let Ok(output) = Command::new("node").arg(script).args(arguments).output() else {
        eprintln!("note: without node the scripts of the page are not tested");
        return None;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

#[test]
fn a_page_keeps_a_minute_of_an_hour_and_draws_its_peaks() {
    let script = |name: &str| format!("{}/page/{name}", env!("CARGO_MANIFEST_DIR"));
    let Some(found) = report(&["hour", &script("common.js"), &script("page.js")]) else { return };
    let of = |key: &str| found[key].as_u64().unwrap();
    // A quarter more than a minute is kept before the oldest samples go, and a frame.
    assert!((6000..=7506).contains(&of("most")), "{found}");
    assert!(of("drawn") <= 2 * 700 && of("peak") == 7, "{found}");
}

/// Thirty samples of two signals in frames of five, with an event and a state before the second frame.
fn session() -> SavedSession {
    let signal = |id: &str| json!({ "id": id, "label": id, "unit": "kN" });
    let about =
        json!({ "title": "</script>", "period_s": 0.01, "signals": [signal("a"), signal("b")] });
    let frame = |first: u64| {
        let mut frame = Frame::new(first, 2);
        let value = |k: u64| if k == 13 { f32::NAN } else { (0.3 * k as f32).sin() };
        frame.values().extend((2 * first..2 * first + 10).map(value));
        Message::Frame(frame.bytes())
    };
    let mut messages: Vec<Message> = (0..6).map(|k| frame(5 * k)).collect();
    messages.insert(1, Message::State(r#"{"alarm":"raised"}"#.into()));
    messages.insert(1, Message::Event(r#"{"time_s":0.05,"kind":"inject"}"#.into()));
    SavedSession { about, messages }
}

#[test]
fn a_saved_page_plays_its_session_to_the_bit() {
    let session = session();
    let path = std::env::temp_dir().join(format!("servotwin-page-{}.html", std::process::id()));
    std::fs::write(&path, saved_page(&session)).unwrap();
    let found = report(&["saved", path.to_str().unwrap()]);
    std::fs::remove_file(&path).unwrap();
    let Some(found) = found else { return };
    let sent = session.messages.iter().filter_map(|message| match message {
        Message::Frame(bytes) => Some(Frame::values_in(bytes).map(f32::to_bits)),
        _ => None,
    });
    assert_eq!(found["values"], json!(sent.flatten().collect::<Vec<_>>()));
    assert_eq!((&found["title"], &found["jumped"]), (&json!("</script>"), &json!(60)));
    assert_eq!(found["isRefused"], true, "a replay takes no faults");
    let texts = found["texts"].as_array().unwrap();
    // Behind the first frame, as they were sent.
    assert!(texts.contains(&json!([{ "event": { "time_s": 0.05, "kind": "inject" } }, 5])));
    assert!(texts.contains(&json!([{ "state": { "alarm": "raised" } }, 5])));
    let begin = json!({ "events": [], "state": null });
    assert!(texts.iter().any(|text| text[0] == begin), "at the beginning nothing has happened");
}
