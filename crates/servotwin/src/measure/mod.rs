//! What came of runs, and the measures of it.
//!
//! - [`outcome`]: what was simulated and what a diagnosis did, a row for each run
//! - this module: the measures, in one list. A measure is the share of some outcomes in which something happened; every
//!   file, table and page that gives such a share counts it here. A new measure is one entry.
//! - [`flights`]: the measures of a suite of flights, with latencies and false alarms
//! - [`unseen`]: those of faults that training does not contain

pub mod flights;
pub mod outcome;
pub mod unseen;

use crate::study::Study;
use flights::STRONG;
use outcome::{FirstAction, RunOutcome};
use serde::{Deserialize, Serialize};
use servotwin_learning::metrics::{Rate, Trial};
use std::collections::BTreeMap;

/// A share of outcomes.
///
/// In its words `{action}` stands for what an answer names, `{off}` for a shutdown, `{actuator}` for an actuator,
/// `{switched_off}` for shut down, `{limit}` for the limit on latency, and `{strong}` for [`STRONG`].
pub struct Measure {
    /// The key in files.
    pub name: &'static str,
    /// What happened.
    pub sentence: &'static str,
    /// In which runs it is counted.
    pub of: CountedRuns,
    /// Whether it happened; the second argument is the limit on latency, s.
    holds: fn(&RunOutcome, f64) -> bool,
}

impl Measure {
    /// In how many runs it happened, and in how many it is counted. Nothing is late here.
    pub fn count<'o>(&self, runs: impl Iterator<Item = &'o RunOutcome>) -> [u64; 2] {
        let counted = runs.filter(|row| (self.of.counts)(row));
        counted.fold([0, 0], |[count, of], row| {
            [count + u64::from((self.holds)(row, f64::INFINITY)), of + 1]
        })
    }
}

/// What a diagnosis can answer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Answers {
    /// Whether there are several actuators.
    pub(crate) has_several: bool,
    /// Whether an action switches an actuator off.
    pub(crate) has_shutdown: bool,
}

impl Answers {
    fn of(study: &Study) -> Self {
        Answers {
            has_several: study.actuators.len() > 1,
            has_shutdown: !study.shutdowns().is_empty(),
        }
    }
}

/// The runs in which a measure is counted.
pub struct CountedRuns {
    /// The runs in words.
    pub words: &'static str,
    /// Whether a diagnosis with these answers can have such a measure.
    applies: fn(Answers) -> bool,
    /// Whether a run is counted.
    counts: fn(&RunOutcome) -> bool,
}

impl CountedRuns {
    const fn new(words: &'static str, counts: fn(&RunOutcome) -> bool) -> Self {
        CountedRuns { words, applies: |_| true, counts }
    }
}

const EVERY_FAULT: CountedRuns =
    CountedRuns::new("all faults and intensities, also those that never become visible", |row| {
        row.is_fault()
    });
const VISIBLE_FAULT: CountedRuns =
    CountedRuns::new("all faults and intensities that become visible", is_visible);
const STRONG_FAULT: CountedRuns =
    CountedRuns::new("all faults of intensity {strong} and more that become visible", |row| {
        is_visible(row) && row.intensity >= STRONG
    });
const STRONG_SHUTDOWN_OF_ALL: CountedRuns = CountedRuns::new(
    "{off} faults of intensity {strong} and more, also those that never become visible",
    is_strong_shutdown,
);
const STRONG_SHUTDOWN: CountedRuns = CountedRuns::new(
    "{off} faults of intensity {strong} and more that become visible",
    is_visible_strong_shutdown,
);

const HEALTHY: CountedRuns = CountedRuns::new("runs without a fault", |row| !row.is_fault());

/// The right action for the right actuator came first.
pub const RIGHT_ACTION_OF_ALL: Measure = Measure {
    name: "right_action_of_all",
    sentence: "right {action} first",
    of: EVERY_FAULT,
    holds: |row, _| row.is_isolated(),
};

/// A shutdown was needed, and was not the first action.
pub const SHUTDOWN_MISSED_OF_ALL: Measure = Measure {
    name: "shutdown_missed_of_all",
    sentence: "{off} missed (of all)",
    of: CountedRuns::new(
        "{off} faults of all intensities, also those that never become visible",
        |row| row.needs_shutdown,
    ),
    holds: |row, _| !row.is_isolated(),
};

/// A shutdown was needed for a visible fault, and was not the first action.
pub const SHUTDOWN_MISSED: Measure = Measure {
    name: "shutdown_missed",
    sentence: "{off} missed (of visible)",
    of: CountedRuns::new("{off} faults of all intensities that become visible", |row| {
        row.needs_shutdown && is_visible(row)
    }),
    holds: |row, _| !row.is_isolated(),
};

/// An actuator at fault was shut down, although its fault needs a milder action.
pub const NEEDLESS_SHUTDOWN: Measure = Measure {
    name: "needless_shutdown",
    sentence: "needless {off}",
    of: CountedRuns {
        words: "faults of all intensities that need no {off} and become visible",
        applies: |answers| answers.has_shutdown,
        counts: |row| !row.needs_shutdown && is_visible(row),
    },
    holds: |row, _| row.shutdown_at_fault,
};

/// A healthy actuator was shut down, at any time after the onset.
pub const WRONG_SHUTDOWN: Measure = Measure {
    name: "wrong_shutdown",
    sentence: "wrong {actuator} {switched_off}",
    of: CountedRuns {
        applies: |answers| answers.has_several && answers.has_shutdown,
        ..EVERY_FAULT
    },
    holds: |row, _| row.shutdown_healthy,
};

/// Windows left their bands for longer than chance allows.
pub const VISIBLE: Measure = Measure {
    name: "visible",
    sentence: "visible at any time",
    of: EVERY_FAULT,
    holds: |row, _| is_visible(row),
};

/// The right action came in time, of all strong faults that need a shutdown.
pub const ISOLATED_IN_TIME_OF_ALL: Measure = Measure {
    name: "isolated_in_time_of_all",
    sentence: "isolated within {limit} of the onset",
    of: STRONG_SHUTDOWN_OF_ALL,
    holds: |row, limit_s| is_soon(row.right_action_s, limit_s),
};

/// The right action came in time.
pub const ISOLATED_IN_TIME: Measure = Measure {
    name: "isolated_in_time",
    sentence: "isolated within {limit} of the onset",
    of: STRONG_SHUTDOWN,
    holds: |row, limit_s| is_soon(row.right_action_s, limit_s),
};

/// The fault was visible in time; if not, it could hardly be isolated.
pub const VISIBLE_IN_TIME: Measure = Measure {
    name: "visible_in_time",
    sentence: "visible within {limit} of the onset",
    of: STRONG_SHUTDOWN,
    holds: |row, limit_s| is_soon(row.visible_s, limit_s),
};

/// The right action came in time after the fault was visible.
pub const ISOLATED_SINCE_VISIBLE: Measure = Measure {
    name: "isolated_since_visible",
    sentence: "isolated within {limit} of becoming visible",
    of: STRONG_SHUTDOWN,
    holds: |row, limit_s| is_soon(row.waited_s(), limit_s),
};

/// The right action never came.
pub const NEVER_ISOLATED: Measure = Measure {
    name: "never_isolated",
    sentence: "never isolated",
    of: STRONG_SHUTDOWN,
    holds: |row, _| row.right_action_s.is_none(),
};

/// The right action came first, of strong faults.
pub const RIGHT_ACTION_OF_STRONG: Measure = Measure {
    name: "right_action_of_strong",
    sentence: "right {action} first",
    of: STRONG_FAULT,
    holds: |row, _| row.first == FirstAction::Right,
};

/// The right action came first, of visible faults.
pub const RIGHT_ACTION: Measure = Measure {
    name: "right_action",
    sentence: "right {action} first (of visible)",
    of: VISIBLE_FAULT,
    holds: |row, _| row.first == FirstAction::Right,
};

/// The right action came first and named the class of the fault: all that is asked of a diagnosis.
pub const END_TO_END: Measure = Measure {
    name: "end_to_end",
    sentence: "end to end right (of visible)",
    of: CountedRuns { counts: |row| has_class(row) && is_visible(row), ..VISIBLE_FAULT },
    holds: |row, _| row.is_right_class(),
};

/// The same, of all faults.
pub const END_TO_END_OF_ALL: Measure = Measure {
    name: "end_to_end_of_all",
    sentence: "end to end right (of all)",
    of: CountedRuns { counts: has_class, ..EVERY_FAULT },
    holds: |row, _| row.is_right_class() && is_visible(row),
};

/// Another action for the right actuator came first.
pub const OTHER_ACTION: Measure = Measure {
    name: "other_action",
    sentence: "another action first",
    of: VISIBLE_FAULT,
    holds: |row, _| row.first == FirstAction::OtherAction,
};

/// An action for a healthy actuator came first.
pub const WRONG_ACTUATOR: Measure = Measure {
    name: "wrong_actuator",
    sentence: "wrong {actuator} first",
    of: CountedRuns { applies: |answers| answers.has_several, ..VISIBLE_FAULT },
    holds: |row, _| row.first == FirstAction::OtherActuator,
};

/// Another class than that of the fault was named, and surely so.
pub const WRONG_CLASS_SURE: Measure = Measure {
    name: "wrong_class_sure",
    sentence: "another class named with 99 % and more",
    of: CountedRuns::new("faults whose class is named first with 99 % and more", |row| {
        has_class(row)
            && !row.first_class.is_empty()
            && row.first_confidence.is_some_and(|confidence| confidence >= 0.99)
    }),
    holds: |row, _| !row.is_right_class(),
};

/// No action came.
pub const SILENT: Measure = Measure {
    name: "silent",
    sentence: "silent",
    of: VISIBLE_FAULT,
    holds: |row, _| row.first == FirstAction::None,
};

/// The fault did not stay not isolated.
pub const ISOLATED: Measure = Measure {
    name: "isolated",
    sentence: "fault isolated",
    of: VISIBLE_FAULT,
    holds: |row, _| row.first != FirstAction::None,
};

/// The right action for the right actuator, of the faults that were isolated.
pub(crate) const RIGHT_OF_ISOLATED: Measure = Measure {
    name: "right_of_isolated",
    sentence: "{action} right, of isolated",
    of: CountedRuns::new(
        "all faults and intensities that become visible and are isolated, rightly or wrongly",
        |row| is_visible(row) && row.first != FirstAction::None,
    ),
    holds: |row, _| row.first == FirstAction::Right,
};

/// The right action for the right actuator, or none.
pub const RIGHT_OR_NOT_ISOLATED: Measure = Measure {
    name: "right_or_not_isolated",
    sentence: "{action} right or not isolated",
    of: VISIBLE_FAULT,
    holds: |row, _| matches!(row.first, FirstAction::Right | FirstAction::None),
};

/// The right answer: the right action first for a fault, and none without one.
pub const RIGHT_ANSWER: Measure = Measure {
    name: "right_answer",
    sentence: "right answer",
    of: CountedRuns::new("all runs, with a fault and without one", |_| true),
    holds: |row, _| if row.is_fault() { row.is_isolated() } else { row.early_alarms == 0 },
};

/// Windows left their bands, although nothing was wrong.
pub const VISIBLE_BY_CHANCE: Measure = Measure {
    name: "visible_by_chance",
    sentence: "visible by chance",
    of: HEALTHY,
    holds: |row, _| row.visible_by_chance > 0,
};

/// An action was raised, although nothing was wrong.
pub const FALSE_ALARM: Measure = Measure {
    name: "false_alarm",
    sentence: "false alarm",
    of: HEALTHY,
    holds: |row, _| row.early_alarms > 0,
};

/// An actuator was shut down, although nothing was wrong.
pub const FALSE_SHUTDOWN: Measure = Measure {
    name: "false_shutdown",
    sentence: "false {off}",
    of: CountedRuns { applies: |answers| answers.has_shutdown, ..HEALTHY },
    holds: |row, _| row.early_shutdowns > 0,
};

/// The measures of flights, in the order of pages; those of the same runs stand together.
pub const OF_FLIGHTS: &[&Measure] = &[
    &RIGHT_ACTION_OF_ALL,
    &END_TO_END_OF_ALL,
    &WRONG_SHUTDOWN,
    &VISIBLE,
    &SHUTDOWN_MISSED_OF_ALL,
    &SHUTDOWN_MISSED,
    &NEEDLESS_SHUTDOWN,
    &ISOLATED_IN_TIME_OF_ALL,
    &ISOLATED_IN_TIME,
    &VISIBLE_IN_TIME,
    &ISOLATED_SINCE_VISIBLE,
    &NEVER_ISOLATED,
    &RIGHT_ACTION_OF_STRONG,
    &RIGHT_ACTION,
    &END_TO_END,
    &OTHER_ACTION,
    &WRONG_ACTUATOR,
    &SILENT,
    &WRONG_CLASS_SURE,
    &VISIBLE_BY_CHANCE,
    &FALSE_ALARM,
    &FALSE_SHUTDOWN,
];

/// The measures of faults that may stay not isolated.
pub const OF_ISOLATED: [&Measure; 3] = [&ISOLATED, &RIGHT_OF_ISOLATED, &RIGHT_OR_NOT_ISOLATED];

/// All measures.
pub fn all() -> impl Iterator<Item = &'static Measure> {
    OF_FLIGHTS.iter().copied().chain(OF_ISOLATED).chain([&RIGHT_ANSWER]).chain(unseen::all())
}

/// What bands alone show of records.
pub(crate) const OF_BANDS: &[&Measure] = &[&VISIBLE, &VISIBLE_BY_CHANCE];

/// The measures of healthy records.
pub(crate) const OF_HEALTHY: &[&Measure] = &[&VISIBLE_BY_CHANCE, &FALSE_ALARM, &FALSE_SHUTDOWN];

/// The measures of windows that are judged alone.
pub(crate) const OF_WINDOWS: &[&Measure] =
    &[&RIGHT_ANSWER, &RIGHT_ACTION_OF_ALL, &SILENT, &FALSE_ALARM];

/// The measures of records, each judged once at its end.
pub(crate) const OF_RECORDS: &[&Measure] = &[
    &RIGHT_ACTION_OF_ALL,
    &END_TO_END_OF_ALL,
    &WRONG_SHUTDOWN,
    &SHUTDOWN_MISSED_OF_ALL,
    &SHUTDOWN_MISSED,
    &NEEDLESS_SHUTDOWN,
    &RIGHT_ACTION,
    &END_TO_END,
    &WRONG_ACTUATOR,
];

/// The measures of records in which a fault may stay not isolated.
pub(crate) const OF_ISOLATION: &[&Measure] = &[
    &ISOLATED,
    &RIGHT_OF_ISOLATED,
    &RIGHT_OR_NOT_ISOLATED,
    &RIGHT_ACTION_OF_ALL,
    &WRONG_SHUTDOWN,
    &SHUTDOWN_MISSED_OF_ALL,
    &SHUTDOWN_MISSED,
    &NEEDLESS_SHUTDOWN,
    &RIGHT_ACTION,
    &WRONG_ACTUATOR,
];

/// The measures of records some of which are judged repeatedly or not at all.
pub(crate) const OF_SOME_RECORDS: &[&Measure] =
    &[&SHUTDOWN_MISSED, &NEEDLESS_SHUTDOWN, &RIGHT_ACTION, &END_TO_END, &WRONG_ACTUATOR];

/// The measures that head every summary.
pub const FIRST: &[&Measure] = &[&RIGHT_ACTION_OF_ALL, &SHUTDOWN_MISSED_OF_ALL, &WRONG_SHUTDOWN];

/// The measures of some runs, by name. Those that count no run are left out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Rates(BTreeMap<String, Rate>);

impl<'m> FromIterator<(&'m Measure, Rate)> for Rates {
    fn from_iter<T: IntoIterator<Item = (&'m Measure, Rate)>>(rates: T) -> Self {
        Rates(rates.into_iter().map(|(measure, rate)| (measure.name.to_owned(), rate)).collect())
    }
}

impl Rates {
    /// Counts measures in runs. `cluster` gives the cluster of a fault, and the kind of fault that it belongs to; runs
    /// without one are independent. `limit_s` is the limit on latency.
    pub(crate) fn count<'o, 'm>(
        (measures, limit_s): (&[&'m Measure], f64),
        answers: Answers,
        runs: &[&'o RunOutcome],
        cluster: impl Fn(&RunOutcome) -> Option<(u32, u32)>,
    ) -> Self {
        let count = |&measure: &&'m Measure| {
            let of = runs.iter().copied().filter(|row| (measure.of.counts)(row));
            let of: Vec<&RunOutcome> = of.collect();
            let trial = |row: &&RunOutcome| {
                let (cluster, kind) = cluster(row)?;
                Some(Trial { cluster, kind, holds: (measure.holds)(row, limit_s) })
            };
            let rate = match of.iter().map(trial).collect::<Option<Vec<Trial>>>() {
                Some(trials) => Rate::clustered(&trials),
                None => Rate::of(&of, |row| (measure.holds)(row, limit_s)),
            };
            (!of.is_empty()).then_some((measure, rate))
        };
        let applies = |measure: &&&Measure| (measure.of.applies)(answers);
        measures.iter().filter(applies).filter_map(count).collect()
    }

    /// These measures, and others of the same runs.
    #[must_use]
    pub(crate) fn and(mut self, others: Rates) -> Self {
        self.0.extend(others.0);
        self
    }

    /// The share of one measure; `None` if it was not counted.
    pub fn counted(&self, measure: &Measure) -> Option<Rate> {
        self.0.get(measure.name).copied()
    }

    /// The share of one measure; of no run if it was not counted.
    pub fn of(&self, measure: &Measure) -> Rate {
        self.counted(measure).unwrap_or_else(|| Rate::new(0, 0))
    }
}

/// Whether there is a class to name; none where a record is asked for its action alone.
fn has_class(row: &RunOutcome) -> bool {
    !row.class.is_empty()
}

fn is_visible(row: &RunOutcome) -> bool {
    row.visible_s.is_some()
}

fn is_strong_shutdown(row: &RunOutcome) -> bool {
    row.needs_shutdown && row.intensity >= STRONG
}

fn is_visible_strong_shutdown(row: &RunOutcome) -> bool {
    is_strong_shutdown(row) && is_visible(row)
}

fn is_soon(time_s: Option<f64>, limit_s: f64) -> bool {
    time_s.is_some_and(|time_s| time_s <= limit_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_measure_has_a_name_and_words_of_its_own() {
        let names: BTreeSet<&str> = all().map(|measure| measure.name).collect();
        let words: BTreeSet<_> =
            all().map(|measure| (measure.of.words, measure.sentence)).collect();
        assert_eq!([names.len(), words.len()], [all().count(); 2]);
        let faults: BTreeSet<&str> = OF_FLIGHTS.iter().map(|measure| measure.of.words).collect();
        let groups = OF_FLIGHTS.chunk_by(|one, next| one.of.words == next.of.words).count();
        assert_eq!(groups, faults.len(), "same runs together");
    }

    #[test]
    fn what_never_became_visible_counts_as_missed_and_a_late_shutdown_as_no_first_action() {
        let row = |visible_s: Option<f64>, first: FirstAction| RunOutcome {
            onset_s: Some(1.0),
            needs_shutdown: true,
            intensity: 1.0,
            visible_s,
            first,
            right_action_s: (first == FirstAction::Right).then_some(1.5),
            ..RunOutcome::default()
        };
        let rows = [
            row(Some(1.0), FirstAction::Right),
            row(Some(3.0), FirstAction::None),
            row(None, FirstAction::Right),
            row(Some(1.0), FirstAction::OtherAction),
        ];
        let answers = Answers::of(&Study::default());
        let rates =
            Rates::count((OF_FLIGHTS, 2.0), answers, &rows.iter().collect::<Vec<_>>(), |_| None);
        let counted = |measure: &Measure| [rates.of(measure).count, rates.of(measure).of];
        assert_eq!(counted(&RIGHT_ACTION_OF_ALL), [1, 4]);
        assert_eq!(counted(&SHUTDOWN_MISSED_OF_ALL), [3, 4]);
        assert_eq!(counted(&VISIBLE_IN_TIME), [2, 3]);
        assert_eq!(counted(&ISOLATED_IN_TIME_OF_ALL), [2, 4]);
        assert_eq!(counted(&NEVER_ISOLATED), [2, 3]);
        assert_eq!(counted(&SILENT), [1, 3]);
    }
}
