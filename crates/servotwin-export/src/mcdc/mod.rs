//! Modified condition/decision coverage (MC/DC) of a C text: its decisions, and a copy that records each evaluation.
//!
//! A condition is shown if two evaluations have another value of it and another result, and no other condition masks it
//! (masking MC/DC). The copy has the same operations, so it gives the same bits.

mod decision;
mod syntax;
mod tokens;

pub(crate) use decision::{Decision, DecisionKind, Shown, Vector};

use crate::error::ExportError;
use crate::source_file::SourceFile;
use std::collections::BTreeSet;
use syntax::{Found, decisions, types_of};

/// The head of every copy.
const INCLUDE: &str = "#include \"mcdc.h\"\n";

/// What records the evaluations.
const RECORDER: [(&str, &str); 2] = [
    ("mcdc.h", include_str!("../../runtime/mcdc.h")),
    ("mcdc.c", include_str!("../../runtime/mcdc.c")),
];

/// Files of which some are copies that record.
pub(crate) struct Instrumented {
    pub files: Vec<SourceFile>,
    /// All decisions of the copies; their numbers are those of the recorder.
    pub decisions: Vec<Decision>,
}

/// Copies the files; those of these names record their evaluations.
///
/// # Errors
/// [`ExportError::NotUnderstood`] for a text whose decisions are not certain.
pub(crate) fn instrument(
    files: &[SourceFile],
    names: &[&str],
) -> Result<Instrumented, ExportError> {
    let mut types = BTreeSet::new();
    for file in files.iter().filter(|file| is_written_by_hand(file.name)) {
        types.extend(types_of(file.name, &file.text)?);
    }
    let (mut copies, mut all) = (Vec::new(), Vec::new());
    for SourceFile { name, text } in files {
        let text = match names.contains(name) {
            true => {
                let found = decisions(name, text, &types, all.len())?;
                let copy = recording(text, &found);
                all.extend(found.decisions);
                copy
            }
            false => text.clone(),
        };
        copies.push(SourceFile { name, text });
    }
    let sizes = format!("#define MCDC_DECISIONS {}\n", all.len().max(1));
    copies.push(SourceFile { name: "mcdc_sizes.h", text: sizes });
    copies.extend(RECORDER.map(|(name, text)| SourceFile { name, text: text.into() }));
    Ok(Instrumented { files: copies, decisions: all })
}

/// Generated files have no types, and many megabytes.
fn is_written_by_hand(name: &str) -> bool {
    !name.ends_with("_tables.c")
        && !name.ends_with("_features.c")
        && !name.ends_with("_equations.c")
}

/// The text with everything that records.
fn recording(text: &str, found: &Found) -> String {
    let mut inserts: Vec<(usize, &str)> =
        found.inserts.iter().map(|insert| (insert.at, insert.text.as_str())).collect();
    // Stable: at the same byte the order is that in which they were found.
    inserts.sort_by_key(|(at, _)| *at);
    let (mut copy, mut done) = (INCLUDE.to_owned(), 0);
    for (at, insert) in inserts {
        copy += &text[done..at];
        copy += insert;
        done = at;
    }
    copy + &text[done..]
}

#[cfg(test)]
mod tests;
