//! The tables of a window length: its models, its bands, and the limits of its evidence.

use super::hierarchy;
use crate::error::ExportError;
use crate::notation::{record, write_array, write_numbers};
use servotwin_diagnosis::diagnoser::decision::IsNovel;
use servotwin_diagnosis::diagnoser::{Diagnoser, Length, Novelty};
use servotwin_model::c_source::hexadecimal;

/// Writes the arrays of a length, and returns its entry in the array of lengths.
pub(super) fn write(
    text: &mut String,
    place: usize,
    diagnoser: &Diagnoser,
) -> Result<String, ExportError> {
    let length = &diagnoser.lengths[place];
    let panes = length.span.panes;
    let [trees, committee] = ["trees", "committee"].map(|kind| format!("{kind}_{place}"));
    hierarchy::write(text, &trees, &length.panel.trees)?;
    hierarchy::write(text, &committee, &length.panel.committee)?;
    *text += &format!("\n/* window length {} */\n", place + 1);
    let bands = length.panel.bands.iter().map(|band| band.half_width);
    write_numbers(text, &format!("bands_{place}"), bands);
    known(text, place, &length.novelty);
    let limits = diagnoser.limits_of(length);
    let of_pairs = limits.of_pairs().iter().copied();
    write_numbers(text, &format!("limits_{place}"), of_pairs);
    let allowances = limits.allowances_nats().iter().copied();
    write_numbers(text, &format!("allowances_{place}"), allowances);
    Ok(entry(place, panes, diagnoser, length))
}

/// The entry of a length.
fn entry(place: usize, panes: u32, diagnoser: &Diagnoser, length: &Length) -> String {
    let pane = length.span.pane_samples;
    let share = f64::from(pane) / (u64::from(pane) * u64::from(panes)) as f64;
    let tuning = diagnoser.tuning_of(length);
    let nats = |novel| IsNovel { novel, share_of_known: 1.0 - length.novelty.quantile }.nats();
    let number = hexadecimal;
    let array = |what: &str| format!("{what}_{place}");
    let hierarchy = |what: &str| format!("&{what}_{place}");
    record(&[
        record(&[pane.to_string(), panes.to_string()]),
        number(share),
        length.baseline_corrected.is_some().to_string(),
        diagnoser.views_of(length).to_string(),
        array("bands"),
        hierarchy("trees"),
        hierarchy("committee"),
        number(length.panel.least_confidence.unwrap_or(0.0)),
        length.novelty.classes.len().to_string(),
        array("known"),
        array("limits"),
        array("allowances"),
        number(diagnoser.limits_of(length).of_change),
        number(tuning.allowance_nats),
        number(tuning.change_allowance_nats()),
        number(nats(true)),
        number(nats(false)),
    ])
}

fn known(text: &mut String, place: usize, novelty: &Novelty) {
    let mut entries = Vec::new();
    for (class, known) in novelty.classes.iter().enumerate() {
        let lists = [("lows", &known.lows), ("highs", &known.highs), ("widths", &known.widths)];
        let mut values = vec![known.lows.len().to_string()];
        for (what, list) in lists {
            let name = format!("{what}_{place}_{class}");
            write_numbers(text, &name, list.iter().copied());
            values.push(name);
        }
        values.push(hexadecimal(known.limit));
        entries.push(record(&values));
    }
    if entries.is_empty() {
        entries.push("{ 0, 0, 0, 0, 0x1p+0 }".into());
    }
    write_array(text, "servotwin_known", &format!("known_{place}"), entries);
}
