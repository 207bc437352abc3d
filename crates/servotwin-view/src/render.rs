//! The renderers of a [`Document`](crate::document::Document).

mod html;
mod json;
mod markdown;
mod terminal;

pub use html::page;
pub use json::json;
pub use markdown::markdown;
pub use terminal::terminal;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::{Document, Form, Table, Value, Verdict, fact, line};
    use crate::row;

    fn document() -> Document {
        let values =
            [("fault_class", Value::name("control_valve")), ("time", Value::seconds(1.39, 3))];
        let sentence = line("Stop: {fault_class}, since {time}.", values);
        let mut document = Document::new("watch", Verdict::act(sentence));
        let stroke = Value { suffix: "_m", ..Value::number(0.0125, "12.5 mm") };
        document.facts("", [fact("stroke", "stroke", stroke), fact("steps", "", 3_u32)]);
        let mut table = Table::new([("log", "log"), ("duration", "lasts"), ("", "remark")]);
        for flight in 0..12_u32 {
            let (name, duration) = (format!("log {flight}"), Value::seconds(f64::from(flight), 3));
            table.push(row![name, duration, "µ|"]);
        }
        document.table("logs", table);
        document.note("a limit");
        document.text("for the curious").detail();
        document
    }

    #[test]
    fn a_terminal_shows_the_verdict_first_and_the_beginning_of_a_long_table() {
        let text = terminal(&document(), false, None);
        let begin = "Stop: control valve, since 1.39 s.\nstroke  12.5 mm\n\nlog    lasts  remark\n\
                     log 0    0 s  µ|\n";
        assert!(text.starts_with(begin), "{text}");
        assert!(
            text.ends_with(
                "log 9    9 s  µ|\n… and 2 more: --details shows all\n\nnote: a limit\n"
            )
        );
        let whole = terminal(&document(), true, None);
        assert!(whole.contains("log 11   11 s") && whole.ends_with("for the curious\n"), "{whole}");
        assert_eq!(terminal(&document().formed(Form::Listing), false, None), whole);
    }

    #[test]
    fn a_wide_table_is_wrapped_to_the_terminal_and_whole_in_a_pipe() {
        let mut table = Table::of("part | remark");
        table.push(["servo valve", "a sentence that is longer than the terminal is wide"]);
        let mut document = Document::default();
        document.table("parts", table);
        let widest = |width| {
            let text = terminal(&document, true, width);
            text.lines().map(|line| line.chars().count()).max().unwrap()
        };
        assert!(widest(Some(40)) <= 40 && widest(None) > 40, "{:?}", widest(Some(40)));
    }

    #[test]
    fn json_has_every_row_in_si_units_with_their_suffix() {
        let text = json(&document());
        let read: serde_json::Value = serde_json::from_str(&text).unwrap();
        let verdict = &read["verdict"];
        assert_eq!(
            (&verdict["call"], &verdict["fault_class"]),
            (&"act".into(), &"control_valve".into())
        );
        assert_eq!((&verdict["time_s"], &read["stroke_m"]), (&1.39.into(), &0.0125.into()));
        assert_eq!(read["logs"].as_array().unwrap().len(), 12);
        assert_eq!(read["logs"][11], serde_json::json!({ "log": "log 11", "duration_s": 11.0 }));
        assert_eq!((&read["notes"][0], &read["steps"]), (&"a limit".into(), &3.into()));
        assert_eq!(json(&document().formed(Form::Line)).lines().count(), 1);
    }

    #[test]
    fn markdown_escapes_the_bars_of_tables() {
        let page = markdown(&document());
        assert!(
            page.starts_with("\n**Stop: control valve, since 1.39 s.**\n\n- stroke: 12.5 mm\n")
        );
        assert!(
            page.contains("| log | lasts | remark |\n|---|---|---|\n| log 0 | 0 s | µ\\| |\n"),
            "{page}"
        );
        assert!(page.contains("\n> a limit\n"), "{page}");
    }
}
