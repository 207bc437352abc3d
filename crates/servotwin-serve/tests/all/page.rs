//! Scripts of the page in Node, where there is one: what the page keeps of an hour.

use serde_json::Value;
use std::process::Command;

#[test]
fn a_page_keeps_a_minute_of_an_hour_and_draws_its_peaks() {
    let folder = env!("CARGO_MANIFEST_DIR");
    let scripts = ["/../servotwin-watch/page/player.js", "/page/page.js"];
    let scripts = scripts.map(|name| format!("{folder}{name}"));
    let mut node = Command::new("node");
    let Ok(output) = node.arg(format!("{folder}/tests/all/page.cjs")).args(scripts).output() else {
        eprintln!("note: without node the scripts of the page are not tested");
        return;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let of = |key: &str| found[key].as_u64().unwrap();
    // A quarter more than a minute is kept before the oldest samples go, and a frame.
    assert!((6000..=7506).contains(&of("most")), "{found}");
    assert!(of("drawn") <= 2 * 700 && of("peak") == 7, "{found}");
}
