//! The page: its parts, which the server sends one by one, and the present flight as a page of its own.

use crate::feed::{Message, values_in};
use serde_json::Value;
use servotwin_watch::player::{
    CHARTS_SCRIPT, CHARTS_STYLE, PLAYER_SCRIPT, PLAYER_STYLE, PlayerRecord, PlayerSignal, Screen,
};

/// A file beside the page.
pub(crate) struct Part {
    /// The name by which the page loads it.
    pub(crate) name: &'static str,
    /// The media type.
    pub(crate) media_type: &'static str,
    /// The content.
    pub text: &'static str,
}

/// The page itself. It loads parts by one tag each.
pub(crate) const HTML: &str = include_str!("../page/index.html");
/// Its styles and scripts.
pub(crate) const PARTS: [Part; 6] = [
    style("uplot.css", CHARTS_STYLE),
    style("player.css", PLAYER_STYLE),
    style("page.css", include_str!("../page/page.css")),
    script("uplot.js", CHARTS_SCRIPT),
    script("player.js", PLAYER_SCRIPT),
    script("page.js", include_str!("../page/page.js")),
];

const fn style(name: &'static str, text: &'static str) -> Part {
    Part { name, media_type: "text/css", text }
}

const fn script(name: &'static str, text: &'static str) -> Part {
    Part { name, media_type: "text/javascript", text }
}

/// A flight as a page of its own: what its viewers saw of `signals`, and what happened.
pub(crate) fn page_of(
    title: &str,
    period_s: f64,
    signals: &[PlayerSignal],
    messages: &[Message],
) -> String {
    let mut record = PlayerRecord::new(title, period_s, signals.to_vec());
    let mut last_action = None;
    for message in messages {
        match message {
            Message::Frame(bytes) => {
                let values: Vec<f64> = values_in(bytes).map(f64::from).collect();
                for sample in values.chunks_exact(signals.len()) {
                    record.begin(record.now_s());
                    record.sample(sample.iter().copied());
                }
            }
            Message::Event(text) => {
                let event: Value = serde_json::from_str(text).unwrap_or_default();
                if event["kind"] == "action" {
                    last_action = Some(event.clone());
                }
                record.event(event);
            }
            Message::State(_) => {}
        }
    }
    let verdict = last_action.map_or("No action.".into(), |action| {
        let words = ["actuator", "action", "detail"].map(|key| action[key].as_str().unwrap_or(""));
        let words: Vec<String> = words
            .iter()
            .filter(|word| !word.is_empty())
            .map(|word| word.replace('_', " "))
            .collect();
        format!("{} at {:.2} s", words.join(", "), action["time_s"].as_f64().unwrap_or(f64::NAN))
    });
    record.page(&verdict, "")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feed::Frames;
    use serde_json::json;
    use servotwin_watch::player::SignalGroup;

    const HOSTILE: &str = "</script><script>alert(1)</script><img src=x onerror=alert(2)>";

    #[test]
    fn a_page_loads_nothing_and_no_text_of_the_flight_is_html() {
        let signal = PlayerSignal::new("a", HOSTILE, HOSTILE, SignalGroup::Reading);
        let frame = Frames::frame_of(0, 1, &[0.5, f32::NAN]);
        let event =
            json!({ "time_s": 0.01, "kind": "action", "actuator": HOSTILE, "action": "off" });
        let messages = [frame, Message::Event(event.to_string().into())];
        let html = page_of(HOSTILE, 0.01, &[signal], &messages);
        assert!(html.contains("alert(1)&#60;/script&#62;") && html.contains(", off at 0.01 s"));
        assert_eq!(html.matches("</script>").count(), 5, "the record and its scripts");
        for loaded in ["src=\"", "href=\"", "@import", "url(", "<img"] {
            assert!(!html.contains(loaded), "{loaded}");
        }
        assert!(html.contains("default-src 'none'") && html.matches("'sha256-").count() == 4);
    }

    #[test]
    fn a_flight_without_a_sample_is_a_page_too() {
        assert!(page_of("a flight", 0.01, &[], &[]).contains("No sample has come."));
    }
}
