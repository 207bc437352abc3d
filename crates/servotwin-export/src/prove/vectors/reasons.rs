//! Why a condition cannot be shown for a diagnosis.

use crate::mcdc::Decision;
use servotwin_diagnosis::diagnoser::Diagnoser;

/// The reason for a condition, if one is known.
pub(super) fn of(_: &Decision, _: usize, _: &Diagnoser) -> Option<&'static str> {
    None
}
