//! Ranges and word lists shared by several sections of a study file.

use crate::format::{Read, Value, words};
use servotwin_diagnosis::features::Quantity;

words!(Quantity, Quantity::ALL.into_iter().map(|(quantity, word)| (word, quantity)));

/// Upper limit on specimens, to catch typing errors.
pub(super) const MAX_SPECIMENS: f64 = 10_000.0;
/// Longest run, s: a suite has thousands of runs.
pub(super) const LONGEST_S: f64 = 1e4;
/// A count of specimens.
pub(super) const SPECIMENS: Value = Value::Whole(0.0, MAX_SPECIMENS);
/// A count of specimens, at least one.
pub(super) const SOME_SPECIMENS: Value = Value::Whole(1.0, MAX_SPECIMENS);
/// The length of a run, s; it may be very short.
pub(super) const RUN_S: Value = Value::Number(0.1, LONGEST_S, "s");
/// The length of a flight, s.
pub(super) const FLIGHT_S: Value = Value::Number(1.0, 1e4, "s");
/// A sampling rate, Hz.
pub(super) const SAMPLE_HZ: Value = Value::Number(1.0, 1e4, "Hz");
/// Upper limit on environments.
pub const MAX_ENVIRONMENTS: usize = 100_000;
/// A count of flights.
pub(super) const FLIGHT_COUNT: Value = Value::Whole(0.0, MAX_ENVIRONMENTS as f64);

/// The same list with at least one element.
pub(super) const fn some<T: Read>() -> Value {
    match T::VALUE {
        Value::List(_, of) => Value::List(1, of),
        Value::Names(_, of) => Value::Names(1, of),
        other => other,
    }
}
