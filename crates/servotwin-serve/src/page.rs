//! The page: its parts, which the server sends one by one, and one file that holds all of them with a session.
//!
//! The file plays its session in any browser without a server: `saved.js` stands in for it. Its content security policy
//! allows no request to anywhere and no script but those of this page. Nothing of the session is HTML: all of it is
//! base64, and the page shows names and titles as text. The drawing of the system is SVG, in which the policy allows no
//! script.
//!
//! The session in the file is gzip of: the length of a header in bytes (u32), the header as JSON, and the samples. The
//! header holds `about`, the number of samples of each frame, and events and states, each with the number of the frame
//! that follows it. The samples are 32-bit floats, signal by signal, which takes a fifth less than sample by sample;
//! differences between samples or bytes sorted by place save nothing more, because noise fills the values. All numbers
//! are little-endian.

use crate::feed::{Frame, Message};
use crate::session::SavedSession;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use base64::write::EncoderStringWriter;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::{Value, json};
use servotwin_watch::sink::timeline::{CHARTS_SCRIPT, CHARTS_STYLE};
use sha2::{Digest, Sha256};
use std::io::Write;

/// A file beside the page.
pub(crate) struct Part {
    /// The name by which the page loads it.
    pub name: &'static str,
    /// The media type.
    pub media_type: &'static str,
    /// The content.
    pub text: &'static str,
}

/// The page itself. It loads parts by one tag each.
pub(crate) const HTML: &str = include_str!("../page/index.html");
/// The page of a fleet.
pub(crate) const FLEET: &str = include_str!("../page/fleet.html");
/// Styles and scripts of both.
pub(crate) const PARTS: [Part; 6] = [
    style("uplot.css", CHARTS_STYLE),
    style("page.css", include_str!("../page/page.css")),
    script("uplot.js", CHARTS_SCRIPT),
    script("common.js", include_str!("../page/common.js")),
    script("page.js", include_str!("../page/page.js")),
    script("fleet.js", include_str!("../page/fleet.js")),
];
/// What replaces the server in a file.
const STAND_IN: &str = include_str!("../page/saved.js");

const fn style(name: &'static str, text: &'static str) -> Part {
    Part { name, media_type: "text/css", text }
}

const fn script(name: &'static str, text: &'static str) -> Part {
    Part { name, media_type: "text/javascript", text }
}

impl Part {
    /// The tag by which a page loads the part.
    fn tag(&self) -> String {
        match self.media_type {
            "text/css" => format!("<link rel=\"stylesheet\" href=\"{}\">", self.name),
            _ => format!("<script src=\"{}\"></script>", self.name),
        }
    }
}

/// A page that holds a session and plays it without a server.
pub fn saved_page(session: &SavedSession) -> String {
    let mut about = session.about.clone();
    // Whatever it was when it was saved, it is now a session that is replayed.
    about["kind"] = json!("session");
    page_of(&about, session)
}

/// The same with a description by which a server offers the session, too.
pub(crate) fn page_of(about: &Value, session: &SavedSession) -> String {
    let mut html = HTML.to_owned();
    let mut policy = "default-src 'none'; base-uri 'none'; form-action 'none'; \
                      style-src 'unsafe-inline'; script-src"
        .to_owned();
    for part in PARTS.iter().filter(|part| HTML.contains(&part.tag())) {
        let element = match part.media_type {
            "text/css" => format!("<style>{}</style>", part.text),
            _ => inlined(part.text, &mut policy),
        };
        html = html.replacen(&part.tag(), &element, 1);
    }
    let stand_in = inlined(STAND_IN, &mut policy);
    let charset = "<meta charset=\"utf-8\">\n";
    let policy =
        format!("{charset}<meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\n");
    let html = html.replacen(charset, &policy, 1);
    // Browsers run scripts in their order, and the stand-in must be there before the page asks for a server.
    let (head, scripts) = html.split_once("<script>").expect("the page has a script");
    let data = packed(about, session);
    let opened = "<script type=\"application/octet-stream\" id=\"session\">";
    [head, opened, &data, "</script>\n", &stand_in, "\n<script>", scripts].concat()
}

/// A script as an element, which the policy allows by its hash.
fn inlined(script: &str, policy: &mut String) -> String {
    let hash = BASE64_STANDARD.encode(Sha256::digest(script));
    policy.push_str(&format!(" 'sha256-{hash}'"));
    format!("<script>{script}</script>")
}

/// The session as the file holds it: base64 of gzip. An hour has 60 MB of values, which are not copied as a whole.
fn packed(about: &Value, session: &SavedSession) -> String {
    let (mut frames, mut texts, mut values) = (vec![], vec![], vec![]);
    for message in &session.messages {
        let text = match message {
            Message::Frame(bytes) => {
                frames.push(Frame::samples_in(bytes));
                values.extend(Frame::values_in(bytes));
                continue;
            }
            Message::Event(event) => format!("{{\"event\":{event}}}"),
            Message::State(state) => format!("{{\"state\":{state}}}"),
        };
        texts.push(json!([frames.len(), text]));
    }
    let header = json!({ "about": about, "frames": frames, "texts": texts }).to_string();
    let width = about["signals"].as_array().map_or(0, Vec::len);
    let base64 = EncoderStringWriter::new(&BASE64_STANDARD);
    let mut gzip = GzEncoder::new(base64, Compression::default());
    let mut write = || {
        gzip.write_all(&(header.len() as u32).to_le_bytes())?;
        gzip.write_all(header.as_bytes())?;
        (0..width).try_for_each(|signal| gzip.write_all(&values_of(signal, &values, width)))
    };
    let written = write().and_then(|()| gzip.finish());
    written.expect("a string takes all that is written").into_inner()
}

/// The bytes of one signal, of values that are given sample by sample.
fn values_of(signal: usize, values: &[f32], width: usize) -> Vec<u8> {
    let own = values.iter().skip(signal).step_by(width);
    own.flat_map(|value| value.to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::GzDecoder;
    use std::io::Read;

    const HOSTILE: &str = "</script><script>alert(1)</script><img src=x onerror=alert(2)>";

    /// Five samples of two signals in frames of three and two, with events and states around them.
    fn session() -> SavedSession {
        let signal = |id: &str| json!({ "id": id, "label": HOSTILE, "unit": "kN" });
        let about =
            json!({ "title": HOSTILE, "period_s": 0.01, "signals": [signal("a"), signal("b")] });
        let frame = |first: u64, values: &[f32]| {
            let mut frame = Frame::new(first, 2);
            frame.values().extend(values);
            Message::Frame(frame.bytes())
        };
        let event = || Message::Event(json!({ "kind": HOSTILE }).to_string().into());
        let messages = vec![
            event(),
            frame(0, &[0.1, -0.0, f32::NAN, 1e30, 0.3, -1e-40]),
            Message::State(r#"{"confidence":0.30000000000000004}"#.into()),
            frame(3, &[f32::MAX, f32::MIN, f32::INFINITY, 5.0]),
            event(),
        ];
        SavedSession { about, messages }
    }

    fn header_and_values(html: &str) -> (Value, Vec<u8>) {
        let (_, rest) = html.split_once("id=\"session\">").unwrap();
        let packed = BASE64_STANDARD.decode(rest.split_once('<').unwrap().0).unwrap();
        let mut bytes = vec![];
        GzDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
        let values =
            bytes.split_off(4 + u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize);
        (serde_json::from_slice(&bytes[4..]).unwrap(), values)
    }

    /// The values sample by sample, as `saved.js` sorts them.
    fn by_sample(bytes: &[u8], width: usize) -> Vec<u32> {
        let (words, _) = bytes.as_chunks::<4>();
        let at = |place: usize| words[place % width * (words.len() / width) + place / width];
        (0..words.len()).map(|place| u32::from_le_bytes(at(place))).collect()
    }

    #[test]
    fn a_saved_page_holds_the_session_to_the_bit() {
        let session = session();
        let (header, values) = header_and_values(&page_of(&session.about, &session));
        assert_eq!((&header["about"], &header["frames"]), (&session.about, &json!([3, 2])));
        let texts = header["texts"].as_array().unwrap();
        assert_eq!(texts.iter().map(|text| text[0].clone()).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(texts[1][1], r#"{"state":{"confidence":0.30000000000000004}}"#);
        let sent = session.messages.iter().filter_map(|message| match message {
            Message::Frame(bytes) => Some(Frame::values_in(bytes).map(f32::to_bits)),
            _ => None,
        });
        assert_eq!(by_sample(&values, 2), sent.flatten().collect::<Vec<_>>());
    }

    #[test]
    fn a_saved_page_loads_nothing_and_no_text_of_the_session_is_html() {
        let html = saved_page(&session());
        assert!(!html.contains("alert"), "texts of the session are packed");
        for part in PARTS.iter().filter(|part| HTML.contains(part.name)) {
            assert!(html.contains(part.text), "{} is inside", part.name);
        }
        for loaded in ["src=\"", "href=\"", "@import", "url("] {
            assert!(!html.contains(loaded), "{loaded}");
        }
        let scripts: Vec<&str> = html.split("<script>").skip(1).collect();
        assert_eq!(scripts.len(), 4, "the stand-in, the charts and both files of the page");
        for script in scripts {
            let script = script.split_once("</script>").unwrap().0;
            let hash = BASE64_STANDARD.encode(Sha256::digest(script));
            assert!(html.contains(&format!("'sha256-{hash}'")), "the policy allows it");
        }
        assert!(html.contains("default-src 'none'"));
        assert!(scripts_before_the_page(&html), "the stand-in comes first");
    }

    fn scripts_before_the_page(html: &str) -> bool {
        html.find(STAND_IN)
            .zip(html.find("\nconst KEPT_S"))
            .is_some_and(|(first, then)| first < then)
    }

    #[test]
    fn a_session_without_a_sample_is_a_page_too() {
        let session = SavedSession { messages: vec![], ..session() };
        let (header, values) = header_and_values(&saved_page(&session));
        assert_eq!((&header["frames"], values.len()), (&json!([]), 0));
    }
}
