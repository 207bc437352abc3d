//! Outcomes: what was simulated, and what a diagnosis did. One row for each run and diagnosis; everything that is reported
//! of runs is counted from these rows.

use crate::records::columns::DIMENSIONLESS;
use crate::table::{Column, Table, TableError, Values};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use servotwin_diagnosis::hierarchy::{Diagnosis, Names};

/// The first action that was raised after the onset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FirstAction {
    /// No action was raised.
    #[default]
    None,
    /// A right action against an actuator at fault.
    Right,
    /// Another action against an actuator at fault.
    OtherAction,
    /// An action against a healthy actuator.
    OtherActuator,
}

/// The action that is right after the onset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Needed {
    /// No action: no actuator is at fault.
    #[default]
    Nothing,
    /// The action of the fault's class.
    ItsAction,
    /// A shutdown: the actuator does not work properly.
    Shutdown,
    /// Any action but a shutdown: only a sensor is wrong.
    NoShutdown,
    /// Any action.
    Any,
}

/// The most specific output after the onset, the least specific first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Word {
    /// Nothing was reported.
    #[default]
    Healthy,
    /// Only a detection was reported, or a healthy actuator was named.
    Detected,
    /// Readings were reported as missing.
    NoData,
    /// An input was reported as invalid.
    EnvironmentInvalid,
    /// The fault was reported as unknown.
    Unknown,
    /// An actuator at fault was named.
    Actuator,
}

/// The unit of a command and of what follows it.
const COMMAND: &str = "rad or m";

/// Declares the outcome with the columns of its table: the description of each is the comment above the field.
macro_rules! outcome {
    ($($(#[doc = $description:literal])+ $field:ident: $type:ty, $unit:expr;)+) => {
        /// A flight, and what one diagnosis did in it. Missing numbers are NaN in the table.
        #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct RunOutcome {
            $($(#[doc = $description])+ pub $field: $type,)+
        }

        /// The columns of the table: field, unit and description.
        const COLUMNS: &[(&str, &str, &str)] =
            &[$((stringify!($field), $unit, concat!($($description),+))),+];
    };
}

outcome! {
    /// The number of the flight, from which specimen and noise follow.
    number: u64, DIMENSIONLESS;
    /// The number of its environment.
    environment: u64, DIMENSIONLESS;
    /// The full name of the fault, or the title of an event that is no fault of the study; `healthy` for none.
    event: String, "";
    /// The fault without its actuator, or the name of the challenge set; `healthy` for none.
    kind: String, "";
    /// The intensity of the fault, or the strength of the event; 0 for none.
    intensity: f64, DIMENSIONLESS;
    /// How the fault develops; empty for none.
    profile: String, "";
    /// The onset, since the beginning of the flight.
    onset_s: Option<f64>, "s";
    /// Duration of the flight.
    duration_s: f64, "s";
    /// The actuators at fault, separated by commas.
    at_fault: String, "";
    /// Healthy actuators whose twin reads a wrong boundary sensor, separated by commas.
    misinformed: String, "";
    /// What is right after the onset.
    needed: Needed, "";
    /// The action of the fault's class; empty for an event that has none.
    action: String, "";
    /// Whether that action switches the actuator off.
    needs_shutdown: bool, "";
    /// The class of the fault; empty for an event that has none.
    class: String, "";
    /// The sensor that the diagnosis lacks during the whole flight; empty for none.
    missing: String, "";
    /// The target rate of false alarms of the diagnosis.
    target_per_h: f64, "1/h";
    /// Whether the flight was simulated to its end. If not, nothing below counts.
    is_finished: bool, "";
    /// When the fault became visible, since the onset.
    visible_s: Option<f64>, "s";
    /// How often a fault would have been called visible before the onset.
    visible_by_chance: u64, DIMENSIONLESS;
    /// The first action after the onset.
    first: FirstAction, "";
    /// The name of the first action; empty for none.
    first_action: String, "";
    /// The actuator of the first action.
    first_actuator: String, "";
    /// The class of fault that the first action named; empty for none.
    first_class: String, "";
    /// How sure the diagnosis was of actuator, action and class when it raised the first action.
    first_confidence: Option<f64>, DIMENSIONLESS;
    /// When the first action was raised, since the onset.
    first_action_s: Option<f64>, "s";
    /// When a right action was raised first, since the onset, whatever was raised before.
    right_action_s: Option<f64>, "s";
    /// The most specific output after the onset.
    word: Word, "";
    /// When anything but health was reported first, since the onset.
    first_word_s: Option<f64>, "s";
    /// Number of actions before the onset.
    early_alarms: u64, DIMENSIONLESS;
    /// Number of these that switch an actuator off.
    early_shutdowns: u64, DIMENSIONLESS;
    /// Whether an actuator at fault was shut down.
    shutdown_at_fault: bool, "";
    /// Whether a misinformed actuator was shut down.
    shutdown_misinformed: bool, "";
    /// Whether any other healthy actuator was shut down after the onset.
    shutdown_healthy: bool, "";
    /// The largest evidence for any action in the whole flight, in parts of its limit.
    evidence: f64, DIMENSIONLESS;
    /// The largest evidence for a shutdown in the whole flight, in parts of its limit.
    shutdown_evidence: f64, DIMENSIONLESS;
    /// What a search chose of the flight: the number from which specimen and noise follow, then the place of each
    /// number of the search in its range, or its choice; empty for other flights.
    point: String, "";
    /// The distance to the error that the search looks for, at most 0 for an error; of a transient minus the departure, SI.
    margin: Option<f64>, DIMENSIONLESS;
    /// The actuators that the flight control computer switched off, separated by commas; `all` for the only one.
    /// Empty in open loop, of which nothing below is known either.
    switched_off: String, "";
    /// Whether a reaction changed inputs or parameters.
    changes_mode: bool, "";
    /// The root mean square of the command since the onset.
    command_rms: Option<f64>, COMMAND;
    /// The root mean square of the tracking error since the onset without reactions; missing where nothing follows the
    /// command.
    error_rms: Option<f64>, COMMAND;
    /// The largest tracking error without reactions.
    error_max: Option<f64>, COMMAND;
    /// The root mean square of the tracking error with reactions.
    reacting_error_rms: Option<f64>, COMMAND;
    /// The largest tracking error with reactions.
    reacting_error_max: Option<f64>, COMMAND;
    /// The root mean square of the force fight without reactions; missing for one actuator.
    force_fight_rms_n: Option<f64>, "N";
    /// The same with reactions.
    reacting_force_fight_rms_n: Option<f64>, "N";
    /// The largest difference of the faulty actuator's rod force from the healthy flight, without reactions.
    force_difference_n: Option<f64>, "N";
    /// The same of its piston's position.
    travel_difference_m: Option<f64>, "m";
}

impl RunOutcome {
    /// Whether something was wrong.
    pub(crate) fn is_fault(&self) -> bool {
        self.onset_s.is_some()
    }

    /// The time without a fault, s.
    pub(crate) fn healthy_s(&self) -> f64 {
        self.onset_s.unwrap_or(f64::INFINITY).min(self.duration_s)
    }

    /// Whether the first action was right and the fault was visible.
    pub(crate) fn is_isolated(&self) -> bool {
        self.first == FirstAction::Right && self.visible_s.is_some()
    }

    /// Whether the right action came first and named the class of the fault.
    pub(crate) fn is_right_class(&self) -> bool {
        self.first == FirstAction::Right && self.first_class == self.class
    }

    /// A record that has ended, as one window that left its bands or not.
    pub(crate) fn seen(self, is_visible: bool) -> Self {
        let is_fault = self.is_fault();
        RunOutcome {
            is_finished: true,
            visible_s: (is_fault && is_visible).then_some(self.duration_s),
            visible_by_chance: u64::from(!is_fault && is_visible),
            ..self
        }
    }

    /// A record with what trees or committee say at its end. `shutdowns` are the actions that switch off.
    pub(crate) fn answered(self, said: &Diagnosis, names: &Names, shutdowns: &[u32]) -> Self {
        let Some(actuator) = said.actuator else { return self };
        let is_off = said.action.is_some_and(|action| shutdowns.contains(&action));
        if !self.is_fault() {
            let (early_shutdowns, word) = (u64::from(is_off), Word::Detected);
            return RunOutcome { early_alarms: 1, early_shutdowns, word, ..self };
        }
        let name = |of: &[String], place: Option<u32>| {
            place.map_or_else(String::new, |place| of[place as usize].clone())
        };
        let first_actuator = name(&names.actuators, Some(actuator));
        let first_action = name(&names.actions, said.action);
        let is_own = first_actuator == self.at_fault;
        let first = match is_own {
            true if first_action == self.action => FirstAction::Right,
            true => FirstAction::OtherAction,
            false => FirstAction::OtherActuator,
        };
        RunOutcome {
            word: if is_own { Word::Actuator } else { Word::Detected },
            first,
            first_action_s: Some(self.duration_s),
            right_action_s: (first == FirstAction::Right).then_some(self.duration_s),
            first_class: name(&names.details, said.detail),
            first_actuator,
            first_action,
            shutdown_at_fault: is_own && is_off,
            shutdown_healthy: !is_own && is_off,
            ..self
        }
    }

    /// Whether a fault was reported after the onset: detected, unknown or named. An invalid environment or missing
    /// readings report none.
    pub fn reports_fault(&self) -> bool {
        matches!(self.word, Word::Detected | Word::Unknown | Word::Actuator)
    }

    /// The time from visibility to the right action, s.
    pub(crate) fn waited_s(&self) -> Option<f64> {
        Some((self.right_action_s? - self.visible_s?).max(0.0))
    }

    /// Whether the first action was right, or none was and none is needed.
    pub(crate) fn is_right(&self) -> bool {
        match self.first {
            FirstAction::None => self.needed == Needed::Nothing,
            first => first == FirstAction::Right,
        }
    }

    /// Whether a healthy actuator with right boundary sensors was shut down at any time.
    pub fn shuts_down_healthy(&self) -> bool {
        self.shutdown_healthy || self.early_shutdowns > 0
    }
}

/// The table of outcomes, with a unit and a description for every column.
pub fn table(outcomes: &[RunOutcome]) -> Table {
    let value = |row: &RunOutcome| serde_json::to_value(row).expect("plain fields");
    let rows: Vec<Value> = outcomes.iter().map(value).collect();
    let kinds = value(&RunOutcome::default());
    let column = |&(field, unit, description): &(&str, &str, &str)| {
        let of = || rows.iter().map(|row| &row[field]);
        let values = match &kinds[field] {
            Value::Bool(_) => Values::Flag(of().map(|value| *value == true).collect()),
            Value::String(_) => {
                Values::Text(of().map(|value| value.as_str().unwrap_or_default().into()).collect())
            }
            kind if kind.is_u64() => {
                Values::Unsigned(of().map(|value| value.as_u64().unwrap_or(0) as u32).collect())
            }
            _ => Values::Float(of().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()),
        };
        Column::new(field, unit, values).described(description.trim())
    };
    Table::from_columns(COLUMNS.iter().map(column).collect()).expect("columns of one length")
}

/// The outcomes of a table.
///
/// # Errors
/// A column is missing, or a cell has no value that it may have.
pub fn from_table(table: &Table) -> Result<Vec<RunOutcome>, TableError> {
    let mut rows = vec![serde_json::Map::new(); table.row_count()];
    for &(field, ..) in COLUMNS {
        let column = table.column(field)?;
        for (place, row) in rows.iter_mut().enumerate() {
            let value: Value = match &column.values {
                Values::Flag(values) => values[place].into(),
                Values::Text(values) => values[place].clone().into(),
                Values::Unsigned(values) => values[place].into(),
                Values::Integer(values) => values[place].into(),
                Values::Float(values) => values[place].into(),
            };
            row.insert(field.into(), value);
        }
    }
    let read = |(place, row): (usize, _)| {
        let wrong = |error: serde_json::Error| {
            TableError::Unsuitable(format!("row {}: {error}", place + 1))
        };
        serde_json::from_value(Value::Object(row)).map_err(wrong)
    };
    rows.into_iter().enumerate().map(read).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_keeps_every_field_with_a_unit_and_a_description() {
        let calm =
            RunOutcome { number: 3, duration_s: 20.0, is_finished: true, ..RunOutcome::default() };
        let fault = RunOutcome {
            event: "actuator_1.leakage_a.leakage".into(),
            onset_s: Some(5.25),
            needed: Needed::ItsAction,
            visible_s: Some(0.5),
            first: FirstAction::OtherActuator,
            word: Word::EnvironmentInvalid,
            early_alarms: 2,
            evidence: 1.0 / 3.0,
            ..calm.clone()
        };
        let rows = [calm, fault];
        let made = table(&rows);
        assert_eq!(from_table(&made).unwrap(), rows);
        let fields = serde_json::to_value(&rows[0]).unwrap().as_object().unwrap().len();
        assert_eq!(fields, COLUMNS.len());
        for column in made.columns() {
            let is_number = matches!(column.values, Values::Float(_) | Values::Unsigned(_));
            assert!(!column.description.is_empty() && column.unit.is_empty() != is_number);
        }
        let wrong = Column::new("word", "", vec!["silence".to_owned(); 2]);
        let columns = made
            .columns()
            .iter()
            .map(|own| if own.name == "word" { wrong.clone() } else { own.clone() });
        let error = from_table(&Table::from_columns(columns.collect()).unwrap()).unwrap_err();
        assert!(error.to_string().contains("row 1") && error.to_string().contains("silence"));
    }
}
