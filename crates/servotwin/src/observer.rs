//! What is fed with one sample after the other, and what it says.

use crate::text::spoken;
use serde::{Deserialize, Serialize, Serializer};

/// What is fed with one sample after the other.
pub trait Observer {
    /// One period: the external inputs of the system in its order and the measured sensor values, in SI;
    /// NaN is missing.
    fn push(&mut self, time_s: f64, inputs: &[f64], measured: &[f64]) -> Observation<'_>;

    /// The clock was set or the stream was away for long: what follows has nothing to do with what
    /// was.
    fn restart(&mut self);

    /// Everything it knows, to go on later from there.
    fn save(&self) -> Vec<u8>;

    /// Goes on from what was saved.
    ///
    /// # Errors
    /// In words why that is not possible.
    fn restore(&mut self, saved: &[u8]) -> Result<(), String>;

    /// The names of [`Observation::features`].
    fn features(&self) -> Vec<String> {
        vec![]
    }
}

/// What an observer says after a sample.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'o> {
    /// The twin's sensor values, SI.
    pub twin: &'o [f64],
    /// Measured less twin, divided by the sensors' scales.
    pub residuals: &'o [f64],
    /// Half the width of the band of each residual; NaN for none.
    pub bands: &'o [f64],
    /// What else is worth showing, as [`Observer::features`] names it.
    pub features: &'o [f64],
    /// What it means.
    pub finding: &'o Finding,
}

/// What the observer holds for true.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Nothing so far, or too little data.
    #[default]
    NoData,
    /// All is well.
    Healthy,
    /// All is held for well until there is enough evidence, and it is not likely any more.
    Undecided,
    /// Something is wrong.
    Detected,
    /// It is known what is wrong.
    Isolated,
    /// Something is wrong that is outside everything known.
    Unknown,
    /// The boundary values cannot be trusted, and so nothing can be said.
    EnvironmentInvalid,
}

impl State {
    /// All states, in the order of reports.
    pub const ALL: [State; 7] = [
        State::NoData,
        State::Healthy,
        State::Undecided,
        State::Detected,
        State::Isolated,
        State::Unknown,
        State::EnvironmentInvalid,
    ];

    /// Whether it says anything of the actuator: not without data, nor behind inputs that are not believed.
    pub fn is_judgement(self) -> bool {
        !matches!(self, State::NoData | State::EnvironmentInvalid)
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            State::NoData => "no data",
            State::Healthy => "healthy",
            State::Undecided => "undecided",
            State::Detected => "detected, not isolated",
            State::Isolated => "isolated",
            State::Unknown => "unknown",
            State::EnvironmentInvalid => "environment invalid",
        }
    }

    /// One character for a timeline of text.
    pub fn mark(self) -> char {
        match self {
            State::NoData => ' ',
            State::Healthy => '.',
            State::Undecided => '~',
            State::Detected => '?',
            State::Isolated => '#',
            State::Unknown => 'u',
            State::EnvironmentInvalid => 'e',
        }
    }
}

/// How far an alarm is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// No alarm.
    #[default]
    None,
    /// There is evidence, not enough so far.
    Pending,
    /// The command is given.
    Raised,
    /// The evidence is gone, the command stands.
    Recovering,
}

impl Phase {
    /// In words; nothing where there is no alarm.
    pub fn words(self) -> &'static str {
        match self {
            Phase::None => "",
            Phase::Pending => "pending",
            Phase::Raised => "raised",
            Phase::Recovering => "recovering",
        }
    }
}

/// The most reasons of a finding that is restored, and the most bytes of each of its words.
const MAX_EVIDENCE: usize = 1000;
const MAX_TEXT: usize = 10_000;

/// A finding: what is wrong, what to do, and why.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What is held for true.
    pub state: State,
    /// How far the alarm is.
    pub phase: Phase,
    /// The unit concerned, from 1.
    pub actuator: Option<u32>,
    /// What the study calls it; empty for the only one of a study that gives it no name, which is null in JSON.
    #[serde(default, serialize_with = "named")]
    pub unit: Option<String>,
    /// What to do; empty for nothing.
    pub command: String,
    /// What is wrong in particular; empty where that is not known.
    pub detail: String,
    /// How sure that is, from 0 to 1.
    pub confidence: f64,
    /// Why: residuals, the path through trees.
    pub evidence: Vec<String>,
    /// Whether what is asked of the actuator lies, or just lay, outside of what the band was learned from: there it
    /// promises nothing.
    #[serde(default)]
    pub is_outside: bool,
}

/// The name of a unit, if it has one.
fn named<S: Serializer>(unit: &Option<String>, out: S) -> Result<S::Ok, S::Error> {
    unit.as_ref().filter(|name| !name.is_empty()).serialize(out)
}

impl std::fmt::Display for Finding {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(&self.words())
    }
}

impl Finding {
    /// Whether another one differs in nothing but how sure it is and why. Healthy and undecided differ in nothing else.
    pub fn says_the_same(&self, other: &Finding) -> bool {
        let state = |f: &Finding| match f.state {
            State::Undecided => State::Healthy,
            state => state,
        };
        let said = |f: &Finding| (state(f), f.phase, f.actuator, f.is_outside);
        said(self) == said(other) && self.command == other.command && self.detail == other.detail
    }

    /// Whether its words are short, without control characters.
    pub fn is_text(&self) -> bool {
        let words =
            [&self.command, &self.detail].into_iter().chain(&self.unit).chain(&self.evidence);
        let mut words = words.map(String::as_str);
        self.evidence.len() <= MAX_EVIDENCE
            && words.all(|text| text.len() <= MAX_TEXT && !text.contains(char::is_control))
    }

    /// The unit concerned as people call it; empty for none, and where there is only one.
    pub fn unit_in_words(&self) -> String {
        match (&self.unit, self.actuator) {
            (Some(name), _) => spoken(name),
            (None, Some(number)) => format!("actuator {number}"),
            (None, None) => String::new(),
        }
    }

    /// In words: `isolated, raised: actuator 1, shutdown, supply valve`.
    pub fn words(&self) -> String {
        let outside =
            if self.is_outside { " (outside of what the band was learned from)" } else { "" };
        self.said() + outside
    }

    /// Says how sure it is, which decides between healthy and undecided.
    pub fn be_sure(&mut self, confidence: f64) {
        self.confidence = confidence;
        if let State::Healthy | State::Undecided = self.state {
            self.state = if confidence < 0.5 { State::Undecided } else { State::Healthy };
        }
    }

    /// The state and how far the alarm is, in words.
    pub fn state_in_words(&self) -> String {
        let state = self.state.words();
        match self.phase {
            Phase::None => state.into(),
            phase => format!("{state}, {}", phase.words()),
        }
    }

    fn said(&self) -> String {
        let state = self.state_in_words();
        let parts = [self.unit_in_words(), spoken(&self.command), spoken(&self.detail)];
        let parts: Vec<String> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        if parts.is_empty() { state } else { format!("{state}: {}", parts.join(", ")) }
    }
}
