//! The names behind the indices of an export, in their order.

use super::ProofEvidence;
use super::library::Compiled;
use crate::error::ExportError;
use crate::tables::names;
use servotwin_diagnosis::diagnoser::Diagnoser;

/// Compares all lists of names.
pub(super) fn compare(
    diagnoser: &Diagnoser,
    compiled: &Compiled,
    evidence: &mut ProofEvidence,
) -> Result<(), ExportError> {
    for (what, names) in names(diagnoser) {
        let list = format!("servotwin_{}_names", what.to_ascii_lowercase());
        let said = compiled.names(&list, names.len())?;
        for (index, (said, name)) in said.iter().zip(&names).enumerate() {
            if said != name {
                evidence
                    .differ(format!("{list}[{index}]"), format!("'{said}' instead of '{name}'"));
            }
        }
    }
    Ok(())
}
