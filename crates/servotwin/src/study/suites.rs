//! Suites: experiments as data. A suite says how many runs there are, of what, in which environments and for what
//! purpose.
//!
//! Some names are known (`KNOWN`), with a purpose and usual values. A suite of another name is for judging only. A
//! suite that is `like` another has its environments, numbers, specimens and noise, so the two differ only by what the
//! suite itself says.

use super::flights::{DrawnRanges, Environment, EnvironmentRanges, Flights, Varied};
pub use super::keys::MAX_ENVIRONMENTS;
use super::keys::{FLIGHT_COUNT, FLIGHT_S};
use super::reader::{Noted, Reader};
use super::seed::Seed;
use super::{Scenario, Study};
use crate::format::{At, Key, Read, Value, section};
use crate::toml_text::{Collector, Diagnostic, Entry, TextSpan, TomlError, TomlText, get};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;

section! {
    /// A suite in a study file.
    #[derive(Default)]
    pub(super) struct Text {
        may like: Option<At<String>>,
            "suite whose environments, numbers, specimens and noise this one has";
        may environments: Option<usize> = FLIGHT_COUNT, "number of environments; 0: the suite is not flown";
        may pub(super) repeats: Option<At<usize>> = FLIGHT_COUNT,
            "number of flights of every fault at every intensity; default 0";
        may unseen: bool,
            "true: flights with faults that training does not contain, in each environment";
        may healthy: Option<usize> = FLIGHT_COUNT,
            "number of healthy flights in each environment; default 0";
        may duration_s: Option<f64> = FLIGHT_S,
            "length of a flight with a fault; default: that of [flights]";
        may healthy_duration_s: Option<f64> = FLIGHT_S,
            "length of a healthy flight; default: duration_s";
        may onset_s: Option<At<[f64; 2]>>, "range of the onset, s; default: that of [flights]";
        may from_start: Option<bool>, "true: faults are present before the first sample";
        may scenarios: Option<Vec<Scenario>>, "scenarios; default: noise and realistic";
        may plants: Option<String> = Value::Word(plants),
            "specimens with tolerances and draws (the default), or plants of another structure";
        may fitted: bool, "true: the twin of every plant is fitted to its calibration flight";
        may scatter: f64 = Value::Number(0.0, 10.0, "") => 1.0,
            "factor of all tolerances and draws; default 1";
        may missing: bool, "true: every flight is judged once without each sensor";
        may closed_loop: bool,
            "true: every fault of the system is flown in the operating cases with a flight control computer that \
             reacts, and without";
        may commands: Option<Vec<At<String>>>, "commands in place of those of [flights]";
        with drawn: DrawnRanges, "ranges in place of those of [flights]";
        may on_request: bool, "true: flown only when it is named";
    }
}

/// The keys that a suite in closed loop cannot have.
const NOT_IN_CLOSED_LOOP: [&str; 10] = [
    "like",
    "unseen",
    "plants",
    "fitted",
    "scatter",
    "missing",
    "commands",
    "inputs",
    "actuator_inputs",
    "actuator_parameters",
];

/// A suite with the usual values of its name.
#[derive(Clone, Debug, Default)]
pub(super) struct NamedText(pub Text);

impl NamedText {
    /// Reads a suite by its name and its own entries.
    fn of((name, at): (&str, &TextSpan), own: &[Entry], mistakes: &mut Collector) -> Option<Self> {
        let known = KNOWN.iter().find(|(known, ..)| *known == name);
        let usual = known.map_or("", |(.., usual)| usual);
        let usual = TomlText::parse(usual, 0, &mut Collector::default()).expect("TOML");
        let all = layered(own, &usual.root());
        let flag = get(&all, "closed_loop");
        let is_closed_loop = flag.and_then(|flag| flag.value.get_ref().as_bool()).unwrap_or(false);
        if let Some(flag) = flag.filter(|_| known.is_some() && is_closed_loop != (name == EFFECTS))
        {
            let message = "of the suites with a known name 'effects' alone is flown in closed loop";
            mistakes.note(&flag.place(), Diagnostic::new(message));
        } else if is_closed_loop
            && let Some(entry) = NOT_IN_CLOSED_LOOP.iter().find_map(|key| get(own, key))
        {
            let message = format!("a suite in closed loop has no '{}'", entry.key);
            mistakes.note(&entry.place(), Diagnostic::new(message));
        }
        let mut text = Text::of(&all, (at, &format!("'{name}'")), mistakes)?;
        if let Some(like) = text.like.as_mut().filter(|_| get(own, "like").is_none()) {
            like.at = at.clone();
        }
        Some(NamedText(text))
    }
}

/// The entries of a table, and those of another that it lacks.
fn layered<'a>(upper: &[Entry<'a>], lower: &[Entry<'a>]) -> Vec<Entry<'a>> {
    let lower = lower.iter().filter(|entry| get(upper, entry.key).is_none());
    upper.iter().chain(lower).cloned().collect()
}

impl Read for NamedText {
    const VALUE: Value = Value::Table(Text::KEYS);

    fn read(entry: &Entry, _key: Key, mistakes: &mut Collector) -> Option<Self> {
        let own = mistakes.table(entry)?;
        Self::of((entry.key, &entry.at), &own, mistakes)
    }
}

const SPECIMENS: &str = "specimens";
const OTHER: &str = "other_structure";

fn plants() -> Vec<&'static str> {
    vec![SPECIMENS, OTHER]
}

/// Why a run exists. Only runs for training change what is learned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Purpose {
    /// Judging; of records those of the study's operating cases.
    #[default]
    Test,
    /// Training of trees, committee and bands; of records those of the training commands.
    Train,
    /// The margins of a trained diagnosis.
    Tune,
}

impl Purpose {
    /// The purposes of data sets.
    pub const OF_RECORDS: [Purpose; 2] = [Purpose::Test, Purpose::Train];

    /// The suffix in the names of a data set's files.
    pub fn suffix(self) -> &'static str {
        match self {
            Purpose::Train => "-training",
            _ => "",
        }
    }
}

/// Flights from which bands, trees and committee learn.
pub const LEARN: &str = "learn";
/// Healthy flights in many environments, of which training keeps the windows that leave the bands of [`LEARN`].
pub const HARD_NEGATIVES: &str = "hard_negatives";
/// Healthy flights that set the margin of a shutdown.
pub(crate) const HELD_OUT: &str = "held_out";
/// Flights with the faults of the study, and healthy ones.
pub const JUDGE: &str = "judge";
/// Flights with faults that training does not contain.
pub const UNSEEN: &str = "unseen";
/// The flights of [`JUDGE`] by plants that differ from their twin in structure.
pub const OTHER_STRUCTURE: &str = "other_structure";
/// The same beside twins that are fitted to these plants.
pub const OTHER_STRUCTURE_FITTED: &str = "other_structure_fitted";
/// The flights of [`JUDGE`], watched by a diagnosis without each sensor.
pub(crate) const MISSING_SENSORS: &str = "missing_sensors";
/// Healthy flights, each in an environment of its own.
pub const HEALTHY: &str = "healthy";
/// The same by plants that differ from their twin in structure.
pub(crate) const HEALTHY_OTHER_STRUCTURE: &str = "healthy_other_structure";

/// The name under which users run all suites of records.
pub const RECORDS: &str = "records";
/// The name under which users learn in flights and fly every suite that is not on request.
pub const FLIGHTS: &str = "flights";
/// The suites of the records on which a diagnosis is judged, and of those from which it learns.
pub(super) const OF_RECORDS: [&str; 2] = ["cases", "training"];

/// Flights in closed loop, which show what every fault of the system does.
pub const EFFECTS: &str = "effects";

/// The suites with a known name: purpose, and the usual values as in a study file. Where there is no shutdown in the 300
/// environments of `held_out`, at most 1 % of environments have one (95 %, rule of three). Their specimens differ one and
/// a half times as much as declared: the factor of safety between the loads that a structure may see and those that it
/// must withstand (CS 25.303).
pub(crate) const KNOWN: [(&str, Purpose, &str); 11] = [
    (LEARN, Purpose::Train, ""),
    (HARD_NEGATIVES, Purpose::Train, "healthy = 1"),
    (HELD_OUT, Purpose::Tune, "environments = 300\nhealthy = 1\nscatter = 1.5"),
    (JUDGE, Purpose::Test, ""),
    (UNSEEN, Purpose::Test, "like = 'judge'\nrepeats = 2\nunseen = true"),
    (OTHER_STRUCTURE, Purpose::Test, "like = 'judge'\nplants = 'other_structure'"),
    (
        OTHER_STRUCTURE_FITTED,
        Purpose::Test,
        "like = 'judge'\nplants = 'other_structure'\nfitted = true\non_request = true",
    ),
    (MISSING_SENSORS, Purpose::Test, "like = 'judge'\nmissing = true\non_request = true"),
    (HEALTHY, Purpose::Test, "environments = 1000\nhealthy = 1\non_request = true"),
    (
        HEALTHY_OTHER_STRUCTURE,
        Purpose::Test,
        "environments = 1000\nhealthy = 1\nplants = 'other_structure'\non_request = true",
    ),
    (
        EFFECTS,
        Purpose::Test,
        "environments = 1\nrepeats = 1\nhealthy = 1\nclosed_loop = true\non_request = true",
    ),
];

/// A suite of a study, in one size.
#[derive(Clone, Debug, Default)]
pub struct Suite {
    /// Its name.
    pub name: String,
    /// What its runs are for.
    pub purpose: Purpose,
    /// The seed of everything that is drawn.
    pub seed: u64,
    /// The name from which its random numbers come: its own, or that of the suite that it is like.
    pub(crate) draws: String,
    /// The scenarios in which it is flown.
    pub(crate) scenarios: Vec<Scenario>,
    /// The number of environments.
    pub environments: usize,
    /// The number of flights of every fault at every intensity.
    pub repeats: usize,
    /// Whether its faults are those that training does not contain.
    pub(crate) is_unseen: bool,
    /// The number of healthy flights in each environment.
    pub(crate) healthy: usize,
    /// The length of a flight with a fault, s.
    pub(crate) duration_s: f64,
    /// The length of a healthy flight, s.
    pub(crate) healthy_duration_s: f64,
    /// The range of the onset, s; `None` if faults are present before the first sample.
    pub(crate) onset_s: Option<[f64; 2]>,
    /// Whether its plants have another structure than their twin.
    pub(crate) has_other_plants: bool,
    /// Whether the twin of every plant is fitted to its calibration flight.
    pub(crate) is_fitted: bool,
    /// The factor of all tolerances and draws.
    pub(crate) scatter: f64,
    /// Whether every flight is judged once without each sensor.
    pub(crate) misses_sensors: bool,
    /// Whether its runs are flown in closed loop. Their environments are the operating cases in turn; all runs of an
    /// environment have one specimen and one noise; and every fault of the system, whether a class lists it or not,
    /// begins at half and at full intensity in the middle of the range of the onset. No key says otherwise.
    pub(crate) is_closed_loop: bool,
    /// Whether it is flown only when it is named.
    pub(crate) is_on_request: bool,
    /// Whether its runs are the records of a data set. Their environments are operating cases, and every fault is simulated
    /// in each of them.
    pub(crate) is_records: bool,
    varied: Varied,
}

impl Suite {
    /// The root of the random numbers of a run.
    pub(crate) fn seed_of(&self, number: usize) -> Seed {
        Seed::of(self.seed, &self.draws, number as u64)
    }

    /// The root of the random numbers of an environment, and of a plant that makes all flights there.
    pub(crate) fn seed_of_environment(&self, number: usize) -> Seed {
        Seed::of(self.seed, &format!("{}/environment", self.draws), number as u64)
    }

    /// The root of the random numbers of a specimen whose twin is fitted: of the pool of records, or of an environment.
    pub(crate) fn seed_of_fitted(&self, number: usize) -> Seed {
        match self.is_records {
            true => Seed::of(self.seed, &format!("{}/pool", self.draws), number as u64),
            false => self.seed_of_environment(number),
        }
    }

    /// Whether every run has a twin of its own: an unseen fault may change what the twin reads.
    pub(crate) fn has_own_twins(&self) -> bool {
        self.is_unseen
    }

    /// The length of the longest run in an environment, s.
    pub(crate) fn longest_s(&self) -> f64 {
        if self.healthy > 0 || self.is_records {
            self.duration_s.max(self.healthy_duration_s)
        } else {
            self.duration_s
        }
    }

    /// The same suite with another seed.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Suite { seed, ..self }
    }

    /// The same suite with another number of environments. The first ones stay the same.
    #[must_use]
    pub fn with_environments(self, environments: usize) -> Self {
        Suite { environments, ..self }
    }

    fn new(
        reader: &Reader,
        flights: &Flights,
        (name, text): (&At<String>, &Text),
        (purpose, like): (Purpose, Option<&Suite>),
    ) -> Result<Self, Noted> {
        let usual = |own: Option<usize>, of: fn(&Suite) -> usize| own.or(like.map(of));
        let Some(environments) = usual(text.environments, |suite| suite.environments) else {
            return Err(reader.empty(&name.at, "environments"));
        };
        let duration_s =
            text.duration_s.or(like.map(|suite| suite.duration_s)).unwrap_or(flights.duration_s);
        let healthy_s = text.healthy_duration_s.or(like.map(|suite| suite.healthy_duration_s));
        let (own, at) = match &text.onset_s {
            Some(At { value, at }) => (Some(*value), at),
            None => (None, &name.at),
        };
        let onset_s = match text.from_start.unwrap_or(reader.text.on_ground) {
            true => None,
            false => own.or(like.and_then(|suite| suite.onset_s)).or(Some(flights.onset_s)),
        };
        if let Some([from, to]) = onset_s {
            let allowed = "two times inside of the flight, in order";
            reader.range(("onset_s", at), to, from >= 0.0 && to < duration_s, allowed)?;
        }
        let middle = |[from, to]: [f64; 2]| [(from + to) / 2.0; 2];
        let onset_s = if text.closed_loop { onset_s.map(middle) } else { onset_s };
        let is_other = text.plants.as_deref() == Some(OTHER);
        let flown = match reader.text.on_ground {
            true => vec![Scenario::Fitted],
            false => vec![Scenario::Noise, Scenario::Realistic],
        };
        let of_plants = move |scenario: &Scenario| !is_other || scenario.has_tolerances();
        let usual_scenarios = || flown.into_iter().filter(of_plants).collect();
        let scenarios = text.scenarios.clone().unwrap_or_else(usual_scenarios);
        let repeats = text.repeats.as_ref().map(|repeats| repeats.value);
        let healthy = usual(text.healthy, |suite| suite.healthy).unwrap_or(0);
        let suite = Suite {
            name: name.value.clone(),
            purpose,
            seed: reader.text.seed,
            draws: like.map_or(name.as_str(), |suite| &suite.name).into(),
            scenarios,
            environments,
            repeats: usual(repeats, |suite| suite.repeats).unwrap_or(0),
            is_unseen: text.unseen,
            healthy: if text.unseen { 0 } else { healthy },
            duration_s,
            healthy_duration_s: healthy_s.unwrap_or(duration_s),
            onset_s,
            has_other_plants: is_other,
            is_fitted: text.fitted,
            scatter: text.scatter,
            misses_sensors: text.missing,
            is_closed_loop: text.closed_loop,
            is_on_request: text.on_request,
            is_records: false,
            varied: {
                let base = like.map_or(&flights.varied, |suite| &suite.varied);
                base.with(text.commands.as_ref(), &text.drawn)
            },
        };
        suite.varied.check(reader)?;
        if text.commands.is_some() {
            suite.varied.check_commands(reader, suite.longest_s())?;
        }
        Ok(suite)
    }
}

/// The suites of a study, by name.
pub(super) type Suites = BTreeMap<String, Suite>;

/// All suites that a study can fly.
pub(super) fn suites(reader: &Reader, flights: &Flights) -> Result<Suites, Noted> {
    let mut texts: BTreeMap<At<String>, (Purpose, NamedText)> = BTreeMap::new();
    for (name, purpose, _) in KNOWN {
        let own = reader.text.suites.get_key_value(name);
        let own = own.map(|(name, own)| (name.clone(), own.clone()));
        let usual = NamedText::of((name, &(0..0)), &[], &mut Collector::default());
        let usual = usual.expect("the usual values are right");
        if is_possible(reader, flights, name, &usual.0) || own.is_some() {
            let (name, text) = own.unwrap_or((At::new(name.into(), 0..0), usual));
            texts.insert(name, (purpose, text));
        }
    }
    let mut has_failed = false;
    for (name, text) in &reader.text.suites {
        if [RECORDS, FLIGHTS].iter().chain(&OF_RECORDS).any(|taken| *taken == name.as_str()) {
            let message = format!(
                "'{}' is a name for suites that every study has: choose another one",
                **name
            );
            reader.note(&name.at, Diagnostic::new(message));
            has_failed = true;
        }
        texts.entry(name.clone()).or_insert_with(|| (Purpose::Test, text.clone()));
    }
    let mut suites = Suites::new();
    // Those that are like others come last.
    let (alone, alike): (Vec<_>, Vec<_>) =
        texts.iter().partition(|(_, (_, text))| text.0.like.is_none());
    for (name, (purpose, text)) in alone.into_iter().chain(alike) {
        let mut like = None;
        if let Some(other) = &text.0.like {
            let found = suites.get(other.as_str());
            like = found.filter(|suite| suite.draws == other.value).cloned();
            if like.is_none() {
                let known = suites.keys().map(String::as_str);
                let what = ("suite that is like no other", other.as_str());
                reader.unknown(&other.at, what, known);
                has_failed = true;
                continue;
            }
        }
        match Suite::new(reader, flights, (name, &text.0), (*purpose, like.as_ref())) {
            Ok(suite) => drop(suites.insert(name.value.clone(), suite)),
            Err(Noted) => has_failed = true,
        }
    }
    if has_failed { Err(Noted) } else { Ok(suites) }
}

/// Whether a study that does not mention a known suite has what it needs.
fn is_possible(reader: &Reader, flights: &Flights, name: &str, usual: &Text) -> bool {
    let has_judge = reader.text.suites.contains_key(JUDGE);
    let has_plants = usual.plants.is_none() || flights.other_plant.is_some();
    let has_calibration = !usual.fitted || reader.text.fitted.is_some() || reader.text.on_ground;
    match name {
        LEARN | JUDGE => true,
        HARD_NEGATIVES => false,
        // In a test no fault begins, and its twin is fitted; held-out tests would be fitted anew for every margin.
        HELD_OUT | UNSEEN | OTHER_STRUCTURE | HEALTHY_OTHER_STRUCTURE | EFFECTS
            if reader.text.on_ground =>
        {
            false
        }
        _ => has_judge && has_plants && has_calibration,
    }
}

impl Study {
    /// A suite of flights; `None` if the study does not have it.
    pub fn suite(&self, name: &str) -> Option<&Suite> {
        self.suites.get(name)
    }

    /// The suite of the records for a purpose: every fault in every operating case, then healthy specimens of each case.
    pub fn records(&self, purpose: Purpose) -> Suite {
        let training = self.training.as_ref().filter(|_| purpose == Purpose::Train);
        let cases = self.cases_of(purpose).len();
        let healthy = self.realism.as_ref().map_or(0, |realism| realism.healthy);
        let name = OF_RECORDS[usize::from(purpose == Purpose::Train)];
        Suite {
            name: name.into(),
            purpose,
            seed: self.seed,
            draws: name.into(),
            environments: cases,
            repeats: cases,
            healthy: training.map_or(healthy, |training| training.healthy),
            duration_s: training.map_or(self.duration_s, |training| training.duration_s),
            healthy_duration_s: self.duration_s,
            scatter: 1.0,
            is_records: true,
            ..Suite::default()
        }
    }

    /// All suites of flights, by name.
    pub(crate) fn suites(&self) -> impl Iterator<Item = &Suite> {
        self.suites.values()
    }

    /// The suites of flights from which a diagnosis learns, in their order.
    pub(crate) fn training_suites(&self) -> impl Iterator<Item = &Suite> {
        [LEARN, HARD_NEGATIVES].into_iter().filter_map(|name| self.suite(name))
    }

    /// The suites that are flown for judging without being named.
    pub(crate) fn usual_suites(&self) -> impl Iterator<Item = &Suite> {
        self.suites().filter(|suite| suite.purpose == Purpose::Test && !suite.is_on_request)
    }

    /// What varies between the environments of a suite.
    pub(crate) fn ranges_of(&self, suite: &Suite) -> EnvironmentRanges {
        let onset_s = suite.onset_s.unwrap_or_default();
        suite.varied.ranges(&self.actuators, onset_s, suite.duration_s)
    }

    /// Environments of a suite by their numbers: operating cases for records and in closed loop. Each depends on
    /// nothing but the suite's seed, what varies in it, and its number.
    ///
    /// # Errors
    /// A command cannot be flown.
    pub fn environments(
        &self,
        suite: &Suite,
        numbers: Range<usize>,
    ) -> Result<Vec<Environment>, TomlError> {
        if suite.is_records || suite.is_closed_loop {
            let cases = self.cases_of(suite.purpose);
            return Ok(numbers.map(|number| cases[number % cases.len()].clone()).collect());
        }
        let reader = self.reader();
        let all = suite.seed_of_environment(usize::MAX);
        let drawn = |number: usize| {
            let named = (format!("{}/{number:03}", suite.name), number, suite.longest_s());
            suite.varied.drawn(&reader, named, (all, suite.seed_of_environment(number)))
        };
        let drawn = numbers.map(drawn).collect();
        reader.finish(drawn)
    }
}
