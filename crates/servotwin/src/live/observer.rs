//! The interface of observers, which take one sample after the other, and their findings.

use crate::text::spoken;
use serde::{Deserialize, Serialize, Serializer};

/// Observes a system sample by sample.
pub trait Observer {
    /// Takes one sample in SI units: the inputs and the sensor values, in the order of the system; NaN is missing.
    fn push(&mut self, time_s: f64, inputs: &[f64], measured: &[f64]) -> Observation<'_>;

    /// Restarts, because the clock was set or the stream was interrupted: the next sample does not continue the last
    /// one.
    fn restart(&mut self);

    /// Withdraws everything that was raised. All is judged anew, also a fault that lasts.
    fn reset_alarm(&mut self) {}

    /// Saves the complete state as text.
    fn save(&self) -> String;

    /// Restores a saved state.
    ///
    /// # Errors
    /// The reason, as text.
    fn restore(&mut self, saved: &str) -> Result<(), String>;
}

/// The result of one sample.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'o> {
    /// The twin's sensor values, SI.
    pub twin: &'o [f64],
    /// Measured minus twin, divided by the sensors' scales and, where the diagnoser knows it, their spread.
    pub residuals: &'o [f64],
    /// The current finding.
    pub finding: &'o Finding,
}

/// State of the diagnosis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DiagnosisState {
    /// No sample yet, or too little data.
    #[default]
    NoData,
    /// No fault.
    Healthy,
    /// Treated as healthy for lack of evidence, although health is no longer likely.
    Undecided,
    /// A fault is detected, but not isolated.
    Detected,
    /// The fault is isolated.
    Isolated,
    /// A fault unlike any in training.
    Unknown,
    /// A boundary value is invalid, so the actuator is not judged.
    EnvironmentInvalid,
}

impl DiagnosisState {
    /// All states, in the order of reports.
    pub const ALL: [DiagnosisState; 7] = [
        DiagnosisState::NoData,
        DiagnosisState::Healthy,
        DiagnosisState::Undecided,
        DiagnosisState::Detected,
        DiagnosisState::Isolated,
        DiagnosisState::Unknown,
        DiagnosisState::EnvironmentInvalid,
    ];

    /// Whether the state judges the actuator: not without data, nor with invalid inputs.
    pub fn is_judgement(self) -> bool {
        !matches!(self, DiagnosisState::NoData | DiagnosisState::EnvironmentInvalid)
    }

    /// The state as text.
    pub fn words(self) -> &'static str {
        match self {
            DiagnosisState::NoData => "no data",
            DiagnosisState::Healthy => "healthy",
            DiagnosisState::Undecided => "undecided",
            DiagnosisState::Detected => "detected, not isolated",
            DiagnosisState::Isolated => "isolated",
            DiagnosisState::Unknown => "unknown",
            DiagnosisState::EnvironmentInvalid => "environment invalid",
        }
    }

    /// One character for a text timeline.
    pub fn mark(self) -> char {
        match self {
            DiagnosisState::NoData => ' ',
            DiagnosisState::Healthy => '.',
            DiagnosisState::Undecided => '~',
            DiagnosisState::Detected => '?',
            DiagnosisState::Isolated => '#',
            DiagnosisState::Unknown => 'u',
            DiagnosisState::EnvironmentInvalid => 'e',
        }
    }
}

/// Phase of an alarm.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// No alarm.
    #[default]
    None,
    /// There is evidence, but not enough.
    Pending,
    /// An action is raised.
    Raised,
    /// The evidence is gone, but the action remains raised.
    Recovering,
}

impl Phase {
    /// The phase as text; empty without an alarm.
    pub fn words(self) -> &'static str {
        match self {
            Phase::None => "",
            Phase::Pending => "pending",
            Phase::Raised => "raised",
            Phase::Recovering => "recovering",
        }
    }
}

/// Limits for restored findings: number of evidence lines, and bytes of each text.
const MAX_EVIDENCE: usize = 1000;
const MAX_TEXT: usize = 10_000;

/// A finding: the fault, the action and the reasons.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// State of the diagnosis.
    pub state: DiagnosisState,
    /// Phase of the alarm.
    pub phase: Phase,
    /// Number of the actuator concerned, from 1. Without a fault or data, this and the following are those of the
    /// raised action.
    pub actuator_number: Option<u32>,
    /// The actuator's name in the study. It is empty for an only actuator without a name, and null in JSON.
    #[serde(serialize_with = "named")]
    pub actuator: Option<String>,
    /// The action to carry out; empty for none.
    pub action: String,
    /// The fault class; empty if unknown.
    pub detail: String,
    /// Confidence, from 0 to 1.
    pub confidence: f64,
    /// The reasons as text, such as the worst residual or missing sensors.
    pub evidence: Vec<String>,
    /// The shutdowns that were raised and not reset since, as text.
    pub stands: Vec<String>,
}

/// Writes the name of an actuator, or null if it is empty.
fn named<S: Serializer>(actuator: &Option<String>, out: S) -> Result<S::Ok, S::Error> {
    actuator.as_ref().filter(|name| !name.is_empty()).serialize(out)
}

impl std::fmt::Display for Finding {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(&self.words())
    }
}

impl Finding {
    /// Whether two findings differ at most in confidence and evidence. Healthy and undecided count as the same state.
    pub fn says_the_same(&self, other: &Finding) -> bool {
        let state = |f: &Finding| match f.state {
            DiagnosisState::Undecided => DiagnosisState::Healthy,
            state => state,
        };
        let said = |f: &Finding| (state(f), f.phase, f.actuator_number);
        said(self) == said(other)
            && (&self.action, &self.detail, &self.stands)
                == (&other.action, &other.detail, &other.stands)
    }

    /// Whether its texts are short and without control characters.
    pub(crate) fn is_text(&self) -> bool {
        let lists = self.actuator.iter().chain(&self.evidence).chain(&self.stands);
        let mut words = [&self.action, &self.detail].into_iter().chain(lists).map(String::as_str);
        self.evidence.len().max(self.stands.len()) <= MAX_EVIDENCE
            && words.all(|text| text.len() <= MAX_TEXT && !text.contains(char::is_control))
    }

    /// Name of the actuator for people; empty for none, and for an only actuator without a name.
    pub(crate) fn actuator_in_words(&self) -> String {
        match (&self.actuator, self.actuator_number) {
            (Some(name), _) => spoken(name),
            (None, Some(number)) => format!("actuator {number}"),
            (None, None) => String::new(),
        }
    }

    /// The finding as text: `isolated, raised: actuator 1, shutdown, supply valve`.
    pub fn words(&self) -> String {
        let (state, action) = (self.state_in_words(), self.action_in_words());
        if action.is_empty() { state } else { format!("{state}: {action}") }
    }

    /// Sets the confidence, which decides between healthy and undecided.
    pub(crate) fn be_sure(&mut self, confidence: f64) {
        self.confidence = confidence;
        if let DiagnosisState::Healthy | DiagnosisState::Undecided = self.state {
            self.state =
                if confidence < 0.5 { DiagnosisState::Undecided } else { DiagnosisState::Healthy };
        }
    }

    /// State and phase as text, with the shutdowns that stand beside the action of the finding.
    pub(crate) fn state_in_words(&self) -> String {
        let mut words = self.state.words().to_owned();
        if self.phase != Phase::None {
            words += &format!(", {}", self.phase.words());
        }
        let own = self.action_in_words();
        let others: Vec<&str> =
            self.stands.iter().map(String::as_str).filter(|stands| *stands != own).collect();
        if !others.is_empty() {
            words += &format!(" ({} stands)", others.join("; "));
        }
        words
    }

    /// Actuator, action and fault class as text: `actuator 1, shutdown, supply valve`.
    pub(crate) fn action_in_words(&self) -> String {
        let parts = [self.actuator_in_words(), spoken(&self.action), spoken(&self.detail)];
        parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", ")
    }
}
