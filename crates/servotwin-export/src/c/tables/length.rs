//! The tables of a window length: its models, its bands, and the limits of its evidence.

use super::super::literal::{array, numbers};
use super::hierarchy;
use crate::error::ExportError;
use servotwin_diagnosis::diagnoser::decision::IsNovel;
use servotwin_diagnosis::diagnoser::{Diagnoser, Length, Novelty};
use servotwin_model::c_source::hexadecimal;
use std::fmt::Write;

/// Writes the arrays of a length, and returns its entry in the array of lengths.
pub(super) fn write(
    c: &mut String,
    place: usize,
    diagnoser: &Diagnoser,
) -> Result<String, ExportError> {
    let length = &diagnoser.lengths[place];
    let Some(panes) = length.span.panes else {
        let why = "a window over the whole record has no fixed size, so it cannot be exported";
        return Err(ExportError::Unsupported(why));
    };
    let [trees, committee] = ["trees", "committee"].map(|kind| format!("{kind}_{place}"));
    hierarchy::write(c, &trees, &length.panel.trees)?;
    hierarchy::write(c, &committee, &length.panel.committee)?;
    let _ = writeln!(c, "\n/* window length {} */", place + 1);
    let bands = length.panel.bands.iter().map(|band| band.half_width);
    numbers(c, &format!("bands_{place}"), bands);
    known(c, place, &length.novelty);
    let limits = diagnoser.limits_of(length);
    numbers(c, &format!("limits_{place}"), limits.of_pairs().iter().copied());
    numbers(c, &format!("allowances_{place}"), limits.allowances_nats().iter().copied());
    Ok(entry(place, panes, diagnoser, length))
}

/// The entry of a length.
fn entry(place: usize, panes: u32, diagnoser: &Diagnoser, length: &Length) -> String {
    let pane = length.span.pane_samples;
    let share = f64::from(pane) / (u64::from(pane) * u64::from(panes)) as f64;
    let tuning = diagnoser.tuning_of(length);
    let nats = |novel| IsNovel { novel, share_of_known: 1.0 - length.novelty.quantile }.nats();
    let numbers = [
        tuning.weight(share),
        diagnoser.limits_of(length).of_change,
        tuning.allowance_nats,
        tuning.change_allowance_nats(),
        nats(true),
        nats(false),
    ];
    let [weight, of_change, allowance, allowed_change, novel, not_novel] = numbers.map(hexadecimal);
    format!(
        "    {{ {{ {pane}, {panes} }}, {}, {}, bands_{place}, &trees_{place}, &committee_{place}, {}, {}, known_{place},\n      \
         {weight}, limits_{place}, allowances_{place},\n      {of_change}, {allowance}, {allowed_change}, {novel}, {not_novel} }},",
        hexadecimal(share),
        diagnoser.views_of(length),
        hexadecimal(length.panel.least_confidence.unwrap_or(0.0)),
        length.novelty.classes.len(),
    )
}

fn known(c: &mut String, place: usize, novelty: &Novelty) {
    let mut entries = Vec::new();
    for (class, known) in novelty.classes.iter().enumerate() {
        let name = |what: &str| format!("{what}_{place}_{class}");
        for (what, list) in
            [("lows", &known.lows), ("highs", &known.highs), ("widths", &known.widths)]
        {
            numbers(c, &name(what), list.iter().copied());
        }
        entries.push(format!(
            "{{ {}, {}, {}, {}, {} }}",
            known.lows.len(),
            name("lows"),
            name("highs"),
            name("widths"),
            hexadecimal(known.limit)
        ));
    }
    if entries.is_empty() {
        entries.push("{ 0, 0, 0, 0, 0x1p+0 }".into());
    }
    array(c, "servotwin_known", &format!("known_{place}"), entries);
}
