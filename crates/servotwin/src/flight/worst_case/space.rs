//! The space of a search: everything that varies between flights, as a list of numbers.

use crate::flight::margin::SearchObjective;
use crate::run::{RunError, RunName};
use crate::shown::shown;
use crate::signal::random::NormalDeviates;
use crate::study::{ChosenEnvironment, EnvironmentRanges, MAX_DEVIATION, Scenario, Seed, Study};

/// Numbers of a point are rounded to this many steps per unit, so that a line of text holds them exactly.
const STEPS_PER_UNIT: f64 = 1000.0;

/// How a number is distributed in the flights of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Distribution {
    /// One of so many choices, all alike; the number is the index.
    Choice(usize),
    /// A place in a range, even from 0 to 1.
    Share,
    /// A tolerance in standard deviations, normal and within [`MAX_DEVIATION`].
    Deviation,
}

impl Distribution {
    /// The ends of its values.
    pub(crate) fn ends(self) -> [f64; 2] {
        match self {
            Distribution::Choice(count) => [0.0, count as f64 - 1.0],
            Distribution::Share => [0.0, 1.0],
            Distribution::Deviation => [-MAX_DEVIATION, MAX_DEVIATION],
        }
    }

    /// Draws a value.
    pub(crate) fn draw(self, random: &mut NormalDeviates) -> f64 {
        match self {
            Distribution::Choice(count) => {
                ((random.unit() * count as f64) as usize).min(count - 1) as f64
            }
            Distribution::Share => random.unit(),
            Distribution::Deviation => random.normal(),
        }
    }

    /// A value within the ends, rounded so that text holds it exactly.
    pub(crate) fn rounded(self, value: f64) -> f64 {
        let [low, high] = self.ends();
        (value.clamp(low, high) * STEPS_PER_UNIT).round() / STEPS_PER_UNIT
    }
}

/// A number of every point.
#[derive(Debug, Clone, PartialEq)]
pub struct Dimension {
    /// Its name; of an input or parameter the system's.
    pub name: String,
    /// Its distribution.
    pub(crate) distribution: Distribution,
    /// What 0 and 1 stand for, SI; `None` for a choice, a tolerance, or a number of a command.
    pub(crate) range: Option<[f64; 2]>,
    /// What the choices stand for.
    pub choices: Vec<String>,
}

impl Dimension {
    fn new(name: impl Into<String>, distribution: Distribution) -> Self {
        Dimension { name: name.into(), distribution, range: None, choices: vec![] }
    }

    fn choice(name: &str, choices: Vec<String>) -> Self {
        Dimension {
            choices: choices.clone(),
            ..Dimension::new(name, Distribution::Choice(choices.len()))
        }
    }
}

/// The largest number of a point.
pub(crate) const MAX_POINTS: usize = 200_000;

/// A point of a space.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchPoint {
    /// Its number, from which noise, draws and the random part of the command follow.
    pub(crate) number: usize,
    /// One value for each dimension.
    pub values: Vec<f64>,
}

/// The space of a search.
#[derive(Debug, Clone)]
pub struct SearchSpace {
    /// What the search looks for.
    pub objective: SearchObjective,
    /// Every number of a point.
    pub dimensions: Vec<Dimension>,
    /// What varies between environments.
    pub ranges: EnvironmentRanges,
    /// For each choice of the dimension `fault`, the fault's index in the study.
    faults: Vec<usize>,
    /// Where the numbers of commands, of ranges and of tolerances begin.
    begins: [usize; 3],
}

/// A tolerance of so many standard deviations is named in words, and the most that are.
const LARGE: f64 = 2.0;
const MAX_TOLERANCES: usize = 4;

/// What the names of suites begin with whose flights a search chose.
const SUITES: &str = "worst_";

/// The places of the first dimensions.
const FAULT: usize = 0;
const ONSET: usize = 1;
const COMMAND: usize = 2;

impl SearchSpace {
    /// The space of a study in a scenario; `None` if the study has no flights, or no fault for the objective. Flights
    /// without a fault have the choice `none`, and an onset without effect.
    pub fn new(study: &Study, scenario: Scenario, objective: SearchObjective) -> Option<Self> {
        let ranges = study.environment_ranges()?;
        let faults = faults(study, objective);
        if faults.is_empty() && objective.has_fault(study) {
            return None;
        }
        let names = match faults[..] {
            [] => vec!["none".into()],
            _ => faults.iter().map(|&fault| study.faults[fault].id.clone()).collect(),
        };
        let patterns = ranges.commands.iter().map(|(pattern, _)| pattern.clone()).collect();
        let mut dimensions = vec![
            Dimension::choice("fault", names),
            Dimension {
                range: Some(ranges.onset_s),
                ..Dimension::new("onset_s", Distribution::Share)
            },
            Dimension::choice("command", patterns),
        ];
        let commands = dimensions.len();
        let most = ranges.commands.iter().map(|(_, count)| *count).max().unwrap_or(0);
        let numbers =
            (1..=most).map(|n| Dimension::new(format!("command.{n}"), Distribution::Share));
        dimensions.extend(numbers);
        let environment = dimensions.len();
        dimensions.extend(ranges.ranges.iter().map(|(name, range)| Dimension {
            range: Some(*range),
            ..Dimension::new(name, Distribution::Share)
        }));
        let tolerances = dimensions.len();
        let realism = study.realism.as_ref().filter(|_| scenario.has_tolerances());
        let parts = &study.system.network().components;
        for tolerance in realism.map_or(&[][..], |realism| realism.tolerances()) {
            let first = tolerance.parameters.first();
            let name = first.map_or("none".into(), |&(part, own)| parts[part].parameter_name(own));
            dimensions.push(Dimension::new(name, Distribution::Deviation));
        }
        let begins = [commands, environment, tolerances];
        Some(SearchSpace { objective, dimensions, ranges, faults, begins })
    }

    /// The name of the suite of its flights.
    pub fn suite(&self) -> String {
        format!("{SUITES}{}", self.objective.name())
    }

    /// The space of a run that a search chose; `None` of other runs.
    pub fn of_run(study: &Study, run: &RunName) -> Option<Self> {
        let name = run.suite.strip_prefix(SUITES)?;
        let objective = SearchObjective::ALL.into_iter().find(|own| own.name() == name)?;
        SearchSpace::new(study, run.scenario, objective)
    }

    /// A point from the distributions of the study.
    pub(crate) fn draw(&self, number: usize, random: &mut NormalDeviates) -> SearchPoint {
        let draw = |dimension: &Dimension| {
            let distribution = dimension.distribution;
            distribution.rounded(distribution.draw(random))
        };
        SearchPoint { number, values: self.dimensions.iter().map(draw).collect() }
    }

    /// A point as text, of which every number is read with the same bits.
    pub(crate) fn text_of(&self, point: &SearchPoint) -> String {
        let values = self.dimensions.iter().zip(&point.values);
        let values = values.map(|(dimension, value)| format!(" {}={value}", dimension.name));
        format!("number={}{}", point.number, values.collect::<String>())
    }

    /// The point of a text; `None` if it is none of this space.
    pub fn point_of(&self, text: &str) -> Option<SearchPoint> {
        let mut words = text.split(' ');
        let number = words.next()?.strip_prefix("number=")?.parse().ok()?;
        let values = words.zip(&self.dimensions).map(|(word, dimension)| {
            let value: f64 = word.strip_prefix(&dimension.name)?.strip_prefix('=')?.parse().ok()?;
            (dimension.distribution.rounded(value) == value).then_some(value)
        });
        let point = SearchPoint { number, values: values.collect::<Option<_>>()? };
        let is_whole = point.values.len() == self.dimensions.len() && self.text_of(&point) == text;
        (is_whole && number < MAX_POINTS).then_some(point)
    }

    /// A flight in words: fault and onset, the command, the environment with its units, and the largest tolerances. `seed`
    /// is that of the search.
    ///
    /// # Errors
    /// The command cannot be flown.
    pub fn flight_in_words(
        &self,
        study: &Study,
        seed: u64,
        point: &SearchPoint,
    ) -> Result<String, RunError> {
        let flown = study.chosen_environments(&[self.chosen(seed, point)])?.unwrap_or_default();
        let fault = match self.fault(point) {
            Some(fault) => {
                format!("{} from {:.2} s", study.faults[fault].id, self.onset_s(point))
            }
            None => "no fault".into(),
        };
        let mut parts = vec![fault];
        parts.extend(flown.iter().map(|environment| format!("command {}", environment.command)));
        let values = flown.iter().flat_map(|environment| {
            self.environment().map(|(_, dimension)| {
                let (name, unit) = (&dimension.name, study.system.unit_of(&dimension.name));
                let value = environment.value_of(&study.system, name).unwrap_or(f64::NAN);
                format!("{name} {}", shown(value, unit))
            })
        });
        parts.extend(values);
        let begins = self.begins[2];
        let tolerances = self.dimensions[begins..].iter().zip(self.deviations(point));
        let mut largest: Vec<_> = tolerances.filter(|(_, size)| size.abs() >= LARGE).collect();
        largest.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        largest.truncate(MAX_TOLERANCES);
        parts.extend(largest.into_iter().map(|(own, size)| format!("{} {size:+.1} σ", own.name)));
        Ok(parts.join("; "))
    }

    /// The dimensions of the environment with their places: inputs and parameters.
    pub fn environment(&self) -> impl Iterator<Item = (usize, &Dimension)> {
        let [_, from, to] = self.begins;
        self.dimensions.iter().enumerate().skip(from).take(to - from)
    }

    pub(super) fn chosen<'p>(&self, seed: u64, point: &'p SearchPoint) -> ChosenEnvironment<'p> {
        let [commands, environment, tolerances] = self.begins;
        ChosenEnvironment {
            seed: Seed::of(seed, "worst_case/environment", point.number as u64),
            pattern: point.values[COMMAND] as usize,
            command: &point.values[commands..environment],
            shares: &point.values[environment..tolerances],
        }
    }

    pub(super) fn deviations<'p>(&self, point: &'p SearchPoint) -> &'p [f64] {
        &point.values[self.begins[2]..]
    }

    /// The index of the point's fault in the study; `None` for a flight without one.
    pub(super) fn fault(&self, point: &SearchPoint) -> Option<usize> {
        self.faults.get(point.values[FAULT] as usize).copied()
    }

    pub(super) fn onset_s(&self, point: &SearchPoint) -> f64 {
        let [from, to] = self.ranges.onset_s;
        from + (to - from) * point.values[ONSET]
    }
}

/// The faults that an objective flies, one of each kind and actuator: indices in the study.
fn faults(study: &Study, objective: SearchObjective) -> Vec<usize> {
    let shutdowns = study.shutdowns();
    let is_searched = |place: &usize| {
        let fault = &study.faults[*place];
        let is_first = study.faults.iter().position(|other| other.id == fault.id) == Some(*place);
        let needs_shutdown = shutdowns.contains(&study.classes[fault.class].action);
        is_first && (needs_shutdown || objective != SearchObjective::MissedShutdown)
    };
    let all = if objective.has_fault(study) { 0..study.faults.len() } else { 0..0 };
    all.filter(is_searched).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_read_as_it_was_written() {
        let study = Study::default();
        let objective = SearchObjective::WrongShutdown;
        let space = SearchSpace::new(&study, Scenario::Realistic, objective).unwrap();
        let point = space.draw(123, &mut NormalDeviates::stream(0, 1));
        let text = space.text_of(&point);
        assert!(text.starts_with("number=123 fault=") && text.contains(" command.1=0."), "{text}");
        assert_eq!(space.point_of(&text), Some(point));
        let run = format!("{}#7@realistic", space.suite()).parse().unwrap();
        assert_eq!(SearchSpace::of_run(&study, &run).unwrap().objective, objective);
        for (from, to) in [
            ("number=123", "number=x"),
            ("fault=", "fault=1000"),
            (" onset_s=", " onset="),
            ("command.1=0", "command.1=1"),
        ] {
            assert_eq!(space.point_of(&text.replacen(from, to, 1)), None, "{from} {to}");
        }
        assert_eq!(space.point_of(text.rsplit_once(' ').unwrap().0), None);
    }
}
