//! The measures of flights with faults that training does not contain. Every such flight has an onset.

use super::outcome::{FirstAction, Needed, RunOutcome, Word};
use super::{Answers, CountedRuns, Measure, Rates};

const EVERY_FLIGHT: CountedRuns =
    CountedRuns::new("all faults that training does not contain", RunOutcome::is_fault);

/// A measure of all flights.
const fn of_all(
    name: &'static str,
    sentence: &'static str,
    holds: fn(&RunOutcome, f64) -> bool,
) -> Measure {
    Measure { name, sentence, of: EVERY_FLIGHT, holds }
}

/// The first action was right; where no action is right, there was none.
pub const RIGHT_RESPONSE: Measure =
    of_all("right_response", "right action first, or none where none is right", |row, _| {
        row.is_right()
    });

/// The first action was not right, against whatever actuator.
pub const OTHER_RESPONSE: Measure =
    of_all("other_response", "other action first", |row, _| !is_silent(row) && !row.is_right());

/// There was no action where one is right.
pub const NO_RESPONSE: Measure = of_all("no_response", "no action where one is right", |row, _| {
    is_silent(row) && row.needed != Needed::Nothing
});

/// No actuator at fault was shut down, although the fault needs it.
pub const NEVER_SHUT_DOWN: Measure = Measure {
    name: "never_shut_down",
    sentence: "no {off} of a faulty {actuator}",
    of: CountedRuns::new("faults that training does not contain and that need a {off}", |row| {
        row.needs_shutdown
    }),
    holds: |row, _| !row.shutdown_at_fault,
};

/// An actuator at fault was shut down.
pub const SHUTDOWN_AT_FAULT: Measure =
    of_all("shutdown_at_fault", "faulty {actuator} {switched_off}", |row, _| row.shutdown_at_fault);

/// A healthy actuator was shut down at any time, although its boundary sensors are right.
pub const SHUTDOWN_HEALTHY: Measure =
    of_all("shutdown_healthy", "healthy {actuator} {switched_off}", |row, _| {
        row.shuts_down_healthy()
    });

/// A healthy actuator was shut down, because its twin reads a wrong supply or return pressure.
pub const SHUTDOWN_MISINFORMED: Measure = Measure {
    name: "shutdown_misinformed",
    sentence: "healthy {actuator} {switched_off}",
    of: CountedRuns::new("boundary sensors that mislead the twin", |row| {
        !row.misinformed.is_empty()
    }),
    holds: |row, _| row.shutdown_misinformed,
};

/// An action was raised before the onset.
pub const EARLY_ALARM: Measure =
    of_all("early_alarm", "false alarm before the onset", |row, _| row.early_alarms > 0);

/// No action was raised, and nothing was reported.
pub const SAID_HEALTHY: Measure =
    of_all("said_healthy", "healthy", |row, _| says(row, Word::Healthy));

/// No action was raised, but readings were reported as missing.
pub const SAID_NO_DATA: Measure =
    of_all("said_no_data", "no data", |row, _| says(row, Word::NoData));

/// No action was raised, but an input was reported as invalid.
pub const SAID_INPUT_INVALID: Measure =
    of_all("said_input_invalid", "input invalid", |row, _| says(row, Word::EnvironmentInvalid));

/// What was said, the best answer first. Every flight counts once: by its first action, or without one by its most
/// specific output.
pub const ANSWERS: [&Measure; 9] = [
    &of_all("said_needed", "needed action", |row, _| row.first == FirstAction::Right),
    &of_all("said_other", "other action", |row, _| row.first == FirstAction::OtherAction),
    &of_all("said_actuator", "actuator", |row, _| says(row, Word::Actuator)),
    &of_all("said_unknown", "unknown", |row, _| says(row, Word::Unknown)),
    &SAID_INPUT_INVALID,
    &SAID_NO_DATA,
    &of_all("said_detected", "detected", |row, _| says(row, Word::Detected)),
    &SAID_HEALTHY,
    &of_all("said_wrong", "wrong actuator", |row, _| row.first == FirstAction::OtherActuator),
];

const OTHERS: [&Measure; 8] = [
    &RIGHT_RESPONSE,
    &OTHER_RESPONSE,
    &NO_RESPONSE,
    &EARLY_ALARM,
    &SHUTDOWN_AT_FAULT,
    &SHUTDOWN_HEALTHY,
    &NEVER_SHUT_DOWN,
    &SHUTDOWN_MISINFORMED,
];

/// All of them.
pub(crate) fn all() -> impl Iterator<Item = &'static Measure> {
    ANSWERS.into_iter().chain(OTHERS)
}

/// The measures of finished flights, which are independent of each other.
pub(crate) fn rates(flights: &[&RunOutcome]) -> Rates {
    let answers = Answers { has_several: true, has_shutdown: true };
    Rates::count((&all().collect::<Vec<_>>(), f64::INFINITY), answers, flights, |_| None)
}

fn is_silent(row: &RunOutcome) -> bool {
    row.first == FirstAction::None
}

fn says(row: &RunOutcome, word: Word) -> bool {
    is_silent(row) && row.word == word
}
