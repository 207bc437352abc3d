//! The tables of a window length: its models, its bands, and the limits of its evidence.

use super::hierarchy;
use crate::error::ExportError;
use crate::language::Language;
use crate::notation::{COUNT, Notation};
use servotwin_diagnosis::diagnoser::decision::IsNovel;
use servotwin_diagnosis::diagnoser::{Diagnoser, Length, Novelty};

/// Writes the arrays of a length, and returns its entry in the array of lengths.
pub(super) fn write(
    text: &mut String,
    notation: Notation,
    place: usize,
    diagnoser: &Diagnoser,
) -> Result<String, ExportError> {
    let length = &diagnoser.lengths[place];
    let Some(panes) = length.span.panes else {
        let why = "a window over the whole record has no fixed size, so it cannot be exported";
        return Err(ExportError::Unsupported(why));
    };
    let [trees, committee] = ["trees", "committee"].map(|kind| format!("{kind}_{place}"));
    hierarchy::write(text, notation, &trees, &length.panel.trees)?;
    hierarchy::write(text, notation, &committee, &length.panel.committee)?;
    *text += &format!("\n/* window length {} */\n", place + 1);
    let bands = length.panel.bands.iter().map(|band| band.half_width);
    notation.write_numbers(text, &format!("bands_{place}"), bands);
    known(text, notation, place, &length.novelty);
    let limits = diagnoser.limits_of(length);
    notation.write_numbers(text, &format!("limits_{place}"), limits.of_pairs().iter().copied());
    let allowances = limits.allowances_nats().iter().copied();
    notation.write_numbers(text, &format!("allowances_{place}"), allowances);
    Ok(entry(notation, place, panes, diagnoser, length))
}

/// The entry of a length.
fn entry(
    notation: Notation,
    place: usize,
    panes: u32,
    diagnoser: &Diagnoser,
    length: &Length,
) -> String {
    let pane = length.span.pane_samples;
    let share = f64::from(pane) / (u64::from(pane) * u64::from(panes)) as f64;
    let tuning = diagnoser.tuning_of(length);
    let nats = |novel| IsNovel { novel, share_of_known: 1.0 - length.novelty.quantile }.nats();
    let number = |number| notation.number(number);
    let array = |what: &str| notation.array(&format!("{what}_{place}"));
    let hierarchy = |what: &str| notation.pointer(&format!("{what}_{place}"));
    let span = [("pane_samples", pane.to_string()), ("panes", panes.to_string())];
    notation.record(
        "Length",
        &[
            ("span", notation.record("Span", &span)),
            ("share", number(share)),
            ("views", diagnoser.views_of(length).to_string()),
            ("bands", array("bands")),
            ("trees", hierarchy("trees")),
            ("committee", hierarchy("committee")),
            ("least_confidence", number(length.panel.least_confidence.unwrap_or(0.0))),
            (COUNT, length.novelty.classes.len().to_string()),
            ("known", array("known")),
            ("weight", number(tuning.weight(share))),
            ("limits", array("limits")),
            ("allowances", array("allowances")),
            ("limit_of_change", number(diagnoser.limits_of(length).of_change)),
            ("allowance", number(tuning.allowance_nats)),
            ("allowed_change", number(tuning.change_allowance_nats())),
            ("novel_nats", number(nats(true))),
            ("known_nats", number(nats(false))),
        ],
    )
}

fn known(text: &mut String, notation: Notation, place: usize, novelty: &Novelty) {
    let mut entries = Vec::new();
    for (class, known) in novelty.classes.iter().enumerate() {
        let lists = [("lows", &known.lows), ("highs", &known.highs), ("widths", &known.widths)];
        let mut fields = vec![(COUNT, known.lows.len().to_string())];
        for (what, list) in lists {
            let name = format!("{what}_{place}_{class}");
            notation.write_numbers(text, &name, list.iter().copied());
            fields.push((what, notation.array(&name)));
        }
        fields.push(("limit", notation.number(known.limit)));
        entries.push(notation.record("Known", &fields));
    }
    if entries.is_empty() && notation.language == Language::C {
        entries.push("{ 0, 0, 0, 0, 0x1p+0 }".into());
    }
    notation.write_array(text, "Known", &format!("known_{place}"), entries);
}
