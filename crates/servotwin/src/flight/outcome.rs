//! Outcomes: what was flown, and what a diagnosis did. One row for each flight and diagnosis; everything that is reported
//! of flights is counted from these rows.

use crate::campaign::columns::DIMENSIONLESS;
use crate::table::{Column, Table, TableError, Values};
use serde::{Deserialize, Serialize};
use serde_json::Value;

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

/// A flight, and what one diagnosis did in it. Times are seconds since the onset.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightOutcome {
    /// The number of the flight, from which specimen and noise follow.
    pub number: u64,
    /// The number of its environment.
    pub environment: u64,
    /// The full name of the fault, or the title of an event that is no fault of the study; `healthy` for none.
    pub event: String,
    /// The fault without its actuator, or the name of the challenge set; `healthy` for none.
    pub kind: String,
    /// The intensity of the fault, or the strength of the event; 0 for none.
    pub intensity: f64,
    /// How the fault develops; empty for none.
    pub profile: String,
    /// The onset, s since the beginning of the flight; `None` without a fault.
    pub onset_s: Option<f64>,
    /// Duration of the flight, s.
    pub duration_s: f64,
    /// The actuators at fault, separated by commas.
    pub at_fault: String,
    /// Healthy actuators whose twin reads a wrong boundary sensor, separated by commas.
    pub misinformed: String,
    /// What is right after the onset.
    pub needed: Needed,
    /// The action of the fault's class; empty for an event that has none.
    pub action: String,
    /// Whether that action switches the actuator off.
    pub needs_shutdown: bool,
    /// The sensor that the diagnosis lacks during the whole flight; empty for none.
    pub missing: String,
    /// The target rate of false alarms of the diagnosis, per hour.
    pub target_per_h: f64,
    /// Whether the flight was simulated to its end. If not, nothing below counts.
    pub is_finished: bool,
    /// When the fault became visible; `None` for never.
    pub visible_s: Option<f64>,
    /// How often a fault would have been called visible before the onset.
    pub visible_by_chance: u64,
    /// The first action.
    pub first: FirstAction,
    /// The name of the first action; empty for none.
    pub first_action: String,
    /// The actuator of the first action.
    pub first_actuator: String,
    /// When the first action was raised; `None` for never.
    pub first_action_s: Option<f64>,
    /// When a right action was raised first, whatever was raised before; `None` for never.
    pub right_action_s: Option<f64>,
    /// The most specific output.
    pub word: Word,
    /// When anything but health was reported first; `None` for never.
    pub first_word_s: Option<f64>,
    /// Number of actions before the onset.
    pub early_alarms: u64,
    /// Number of these that switch an actuator off.
    pub early_shutdowns: u64,
    /// Whether an actuator at fault was shut down.
    pub shutdown_at_fault: bool,
    /// Whether a misinformed actuator was shut down.
    pub shutdown_misinformed: bool,
    /// Whether any other healthy actuator was shut down.
    pub shutdown_healthy: bool,
    /// The largest evidence for any action in the whole flight, in parts of its limit.
    pub evidence: f64,
    /// The largest evidence for a shutdown in windows of uncorrected residuals, in parts of its limit.
    pub shutdown_evidence: f64,
    /// The same in windows of baseline-corrected residuals.
    pub corrected_shutdown_evidence: f64,
    /// The actuators that the flight control computer switched off, separated by commas; `all` for the only one. Empty in open
    /// loop, where nothing below is known either.
    pub switched_off: String,
    /// Whether a reaction changed inputs or parameters.
    pub changes_mode: bool,
    /// The root mean square of the command since the onset, rad or m.
    pub command_rms: Option<f64>,
    /// The root mean square of the tracking error since the onset without reactions, rad or m; `None` where nothing follows
    /// the command.
    pub error_rms: Option<f64>,
    /// The largest tracking error without reactions.
    pub error_max: Option<f64>,
    /// The root mean square of the tracking error with reactions.
    pub reacting_error_rms: Option<f64>,
    /// The largest tracking error with reactions.
    pub reacting_error_max: Option<f64>,
    /// The root mean square of the force fight without reactions, N; `None` of one actuator.
    pub force_fight_rms_n: Option<f64>,
    /// The same with reactions.
    pub reacting_force_fight_rms_n: Option<f64>,
    /// The largest difference of the faulty actuator's rod force from the healthy flight, without reactions, N; `None` without
    /// a rod or without a fault.
    pub force_difference_n: Option<f64>,
    /// The same of its piston's position, m.
    pub travel_difference_m: Option<f64>,
}

impl FlightOutcome {
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

    /// The largest evidence for a shutdown in windows of any kind.
    pub(crate) fn largest_shutdown_evidence(&self) -> f64 {
        self.shutdown_evidence.max(self.corrected_shutdown_evidence)
    }
}

/// The unit of a command and of what follows it.
const COMMAND: &str = "rad or m";

/// The columns of the table: field, unit and description. Missing times are NaN.
const COLUMNS: [(&str, &str, &str); 44] = [
    ("number", DIMENSIONLESS, "Number of the flight, from which specimen and noise follow."),
    ("environment", DIMENSIONLESS, "Number of the environment."),
    ("event", "", "Full name of the fault, title of another event, or healthy."),
    ("kind", "", "Fault without its actuator, challenge set, or healthy."),
    ("intensity", DIMENSIONLESS, "Intensity of the fault or strength of the event, 0 for none."),
    ("profile", "", "How the fault develops."),
    ("onset_s", "s", "Onset since the beginning of the flight."),
    ("duration_s", "s", "Duration of the flight."),
    ("at_fault", "", "Actuators at fault."),
    ("misinformed", "", "Healthy actuators whose twin reads a wrong boundary sensor."),
    ("needed", "", "What is right after the onset."),
    ("action", "", "Action of the fault's class."),
    ("needs_shutdown", "", "Whether that action switches the actuator off."),
    ("missing", "", "Sensor that the diagnosis lacks."),
    ("target_per_h", "1/h", "Target rate of false alarms of the diagnosis."),
    ("is_finished", "", "Whether the flight was simulated to its end."),
    ("visible_s", "s", "When the fault became visible, since the onset."),
    ("visible_by_chance", DIMENSIONLESS, "How often a fault was called visible before the onset."),
    ("first", "", "First action after the onset."),
    ("first_action", "", "Name of that action."),
    ("first_actuator", "", "Its actuator."),
    ("first_action_s", "s", "When it was raised, since the onset."),
    ("right_action_s", "s", "When a right action was raised, since the onset."),
    ("word", "", "Most specific output after the onset."),
    ("first_word_s", "s", "When anything but health was reported, since the onset."),
    ("early_alarms", DIMENSIONLESS, "Actions before the onset."),
    ("early_shutdowns", DIMENSIONLESS, "Actions before the onset that switch an actuator off."),
    ("shutdown_at_fault", "", "Whether an actuator at fault was shut down."),
    ("shutdown_misinformed", "", "Whether a misinformed actuator was shut down."),
    ("shutdown_healthy", "", "Whether another healthy actuator was shut down after the onset."),
    ("evidence", DIMENSIONLESS, "Largest evidence for an action, in parts of its limit."),
    ("shutdown_evidence", DIMENSIONLESS, "The same for a shutdown, uncorrected windows."),
    ("corrected_shutdown_evidence", DIMENSIONLESS, "The same, baseline-corrected windows."),
    ("switched_off", "", "Actuators that were switched off; all for the only one."),
    ("changes_mode", "", "Whether a reaction changed inputs or parameters."),
    ("command_rms", COMMAND, "Root mean square of the command since the onset, in closed loop."),
    ("error_rms", COMMAND, "Root mean square of the tracking error without reactions."),
    ("error_max", COMMAND, "Largest tracking error without reactions."),
    ("reacting_error_rms", COMMAND, "Root mean square of the tracking error with reactions."),
    ("reacting_error_max", COMMAND, "Largest tracking error with reactions."),
    ("force_fight_rms_n", "N", "Root mean square of the force fight without reactions."),
    ("reacting_force_fight_rms_n", "N", "The same with reactions."),
    ("force_difference_n", "N", "Largest difference of the rod force from the healthy flight."),
    ("travel_difference_m", "m", "Largest difference of the piston from the healthy flight."),
];

/// The table of outcomes, with a unit and a description for every column.
pub fn table(outcomes: &[FlightOutcome]) -> Table {
    let value = |row: &FlightOutcome| serde_json::to_value(row).expect("plain fields");
    let rows: Vec<Value> = outcomes.iter().map(value).collect();
    let kinds = value(&FlightOutcome::default());
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
        Column::new(field, unit, values).described(description)
    };
    Table::from_columns(COLUMNS.iter().map(column).collect()).expect("columns of one length")
}

/// The outcomes of a table.
///
/// # Errors
/// A column is missing, or a cell has no value that it may have.
pub fn from_table(table: &Table) -> Result<Vec<FlightOutcome>, TableError> {
    let mut rows = vec![serde_json::Map::new(); table.row_count()];
    for (field, ..) in COLUMNS {
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
        let wrong = |error: serde_json::Error| TableError::BadRow {
            row: place + 1,
            reason: error.to_string(),
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
        let calm = FlightOutcome {
            number: 3,
            duration_s: 20.0,
            is_finished: true,
            ..FlightOutcome::default()
        };
        let fault = FlightOutcome {
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
