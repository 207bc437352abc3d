//! One line of text that replays a flight of a search.

use crate::error::SafetyError;
use servotwin::flight::worst_case::SearchObjective;
use servotwin::flight::worst_case::space::SearchPoint;
use servotwin::study::Scenario;
use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

/// A flight of a search with its margin, as text. Numbers are written so that reading gives the same bits.
#[derive(Debug, Clone, PartialEq)]
pub struct FindingLine {
    /// What the search looked for.
    pub objective: SearchObjective,
    /// The scenario.
    pub scenario: Scenario,
    /// The seed of commands, noise and draws.
    pub seed: u64,
    /// The point.
    pub point: SearchPoint,
    /// The margin of the flight.
    pub margin: f64,
}

impl Display for FindingLine {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let FindingLine { objective, scenario, seed, point, margin } = self;
        let values: Vec<String> = point.values.iter().map(f64::to_string).collect();
        write!(
            out,
            "{} {} seed={seed} number={} margin={margin} at={}",
            objective.name(),
            scenario.name(),
            point.number,
            values.join(",")
        )
    }
}

impl FromStr for FindingLine {
    type Err = SafetyError;

    fn from_str(text: &str) -> Result<Self, SafetyError> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let [objective, name, seed, number, margin, at] = words[..] else {
            return Err(mistake(format!("it has {} words instead of 6", words.len())));
        };
        let known = SearchObjective::ALL.into_iter().find(|known| known.name() == objective);
        let scenario = Scenario::ALL.into_iter().find(|known| known.name() == name);
        let values = field::<String>(at, "at")?;
        let values = values.split(',').map(|value| parsed::<f64>(value, "at"));
        Ok(FindingLine {
            objective: known.ok_or_else(|| mistake(format!("'{objective}' is no objective")))?,
            scenario: scenario.ok_or_else(|| mistake(format!("'{name}' is no scenario")))?,
            seed: field(seed, "seed")?,
            point: SearchPoint {
                number: field(number, "number")?,
                values: values.collect::<Result<_, _>>()?,
            },
            margin: field(margin, "margin")?,
        })
    }
}

fn field<T: FromStr>(word: &str, name: &str) -> Result<T, SafetyError> {
    let value = word.strip_prefix(name).and_then(|rest| rest.strip_prefix('='));
    parsed(value.ok_or_else(|| mistake(format!("'{word}' stands where {name}=… belongs")))?, name)
}

fn parsed<T: FromStr>(value: &str, name: &str) -> Result<T, SafetyError> {
    value.parse().map_err(|_| mistake(format!("'{value}' is no value of {name}")))
}

/// A line that cannot be read.
pub(super) fn mistake(problem: String) -> SafetyError {
    SafetyError::FindingLine { problem }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_as_it_was_written() {
        let line = FindingLine {
            objective: SearchObjective::WrongShutdown,
            scenario: Scenario::Realistic,
            seed: 7,
            point: SearchPoint { number: 123, values: vec![3.0, 0.125, -2.999, 0.001] },
            margin: -0.123_456_789_012_345_67,
        };
        let text = line.to_string();
        assert!(
            text.starts_with("wrong-shutdown realistic seed=7 number=123 margin=-0.12345"),
            "{text}"
        );
        assert_eq!(text.parse::<FindingLine>().unwrap(), line);
        for (from, to) in
            [("wrong-", "false-"), ("seed=7", "seed=x"), ("number=", "n="), (" at=", " ")]
        {
            let error = text.replace(from, to).parse::<FindingLine>().unwrap_err().to_string();
            assert!(error.starts_with("the line of a finding: "), "{error}");
        }
    }
}
