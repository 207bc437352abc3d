//! What things are called in the report of a study: one home for every word that depends on it.
//!
//! Units and commands have the names that the study gives them, a study of one unit has no wrong unit
//! to be confused with, and only the paper's study may speak of the paper's figures.

use super::lines::PAPER;
use super::words::spoken;
use crate::study::Study;

/// The words of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vocabulary {
    /// One unit, e.g. `actuator`.
    unit: String,
    units: usize,
    /// The commands that switch their unit off.
    off: Vec<String>,
    is_paper: bool,
}

impl Vocabulary {
    /// The words of a study.
    pub fn of(study: &Study) -> Self {
        Vocabulary {
            unit: common_name(&study.units),
            units: study.units.len(),
            off: study.shutdowns(),
            is_paper: study.name == PAPER,
        }
    }

    /// What can fail as a whole: `actuator` where units are called `actuator_1`, `actuator_2`.
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// Several of them.
    pub fn units(&self) -> String {
        format!("{}s", self.unit)
    }

    /// Two units: `both` where there are no more.
    pub fn two(&self) -> &'static str {
        if self.units == 2 { "both" } else { "two" }
    }

    /// Whether one unit can be taken for another.
    pub fn has_several(&self) -> bool {
        self.units > 1
    }

    /// A text for studies of several units; nothing of one.
    pub fn several<'t>(&self, text: &'t str) -> &'t str {
        if self.has_several() { text } else { "" }
    }

    /// Whether any command switches its unit off, so that there are figures of safety.
    pub fn has_off(&self) -> bool {
        !self.off.is_empty()
    }

    /// What switches a unit off: `shutdown`, or the command as the study calls it.
    pub fn off(&self) -> String {
        match self.off.as_slice() {
            [one] if one == "shut_down" => "shutdown".into(),
            [one] => format!("“{}”", spoken(one)),
            _ => "switch-off".into(),
        }
    }

    /// How many units are never switched off, behind another half of the sentence; nothing where it may be all.
    pub fn kept_on(&self, least_on: u32) -> String {
        let unit = &self.unit;
        match (least_on, self.units) {
            _ if !self.has_off() => String::new(),
            (0, _) => String::new(),
            (1, 2) => format!(", and once a {unit} is off no other {unit} can be switched off"),
            (1, _) => format!(", and the last {unit} that is on can never be switched off"),
            (kept, _) => format!(", and {kept} {unit}s can never be switched off"),
        }
    }

    /// What is done to a unit by that: `shut down`.
    pub fn switched_off(&self) -> &'static str {
        match self.off.as_slice() {
            [one] if one == "shut_down" => "shut down",
            _ => "switched off",
        }
    }

    /// A text for the paper's own study; nothing in others.
    pub fn paper<'t>(&self, text: &'t str) -> &'t str {
        if self.is_paper { text } else { "" }
    }

    /// The fixed band of ±3 %.
    pub fn fixed_band(&self) -> &'static str {
        if self.is_paper { "the seed paper's band of ±3 %" } else { "the fixed band of ±3 %" }
    }

    /// What is judged at work.
    pub fn run(&self) -> &'static str {
        if self.is_paper { "flight" } else { "run" }
    }

    /// What every answer is about: the unit, where there are several, and the command.
    pub fn action(&self) -> String {
        match self.has_several() {
            true => format!("{} and command", self.unit),
            false => "command".into(),
        }
    }

    /// The same where one of them is wrong.
    pub fn action_wrong(&self) -> String {
        match self.has_several() {
            true => format!("{} or command", self.unit),
            false => "command".into(),
        }
    }

    /// A question of the hierarchy.
    pub fn question(&self, question: servotwin_diagnosis::hierarchy::Question) -> String {
        use servotwin_diagnosis::hierarchy::Question;
        match question {
            Question::Actuator => format!("the {}", self.unit),
            Question::Command => "the command".into(),
            Question::Detail => "the detail".into(),
        }
    }
}

/// `actuator` of `actuator_1` and `actuator_2`, and `unit` of `left` and `right`.
fn common_name(units: &[String]) -> String {
    let stem = |name: &String| {
        let stem = name.trim_end_matches(|last: char| last.is_ascii_digit());
        let is_numbered = stem.len() < name.len();
        is_numbered.then(|| stem.trim_end_matches(['_', '-', '.']).to_owned())
    };
    let first = units.first().and_then(stem).filter(|stem| !stem.is_empty());
    let is_common = |name: &String| units.iter().all(|unit| stem(unit).as_ref() == Some(name));
    first.filter(is_common).map_or_else(|| "unit".into(), |stem| spoken(&stem))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_called_what_they_have_in_common() {
        let cases: [(&[&str], &str); 5] = [
            (&["actuator_1", "actuator_2"], "actuator"),
            (&["left", "right"], "unit"),
            (&[""], "unit"),
            (&["axis_1", "pump_1"], "unit"),
            (&["1", "2"], "unit"),
        ];
        for (units, name) in cases {
            let units: Vec<String> = units.iter().map(|&unit| unit.into()).collect();
            assert_eq!(common_name(&units), name, "{units:?}");
        }
    }

    #[test]
    fn commands_keep_their_names() {
        let words = |off: &[&str]| Vocabulary {
            unit: "unit".into(),
            units: 1,
            off: off.iter().map(|&one| one.into()).collect(),
            is_paper: false,
        };
        assert_eq!(words(&["shut_down"]).off(), "shutdown");
        assert_eq!(
            (words(&["halt"]).off().as_str(), words(&["halt"]).switched_off()),
            ("“halt”", "switched off")
        );
        assert_eq!(words(&["halt", "vent"]).off(), "switch-off");
        assert!(!words(&[]).has_off() && words(&[]).action() == "command");
    }
}
