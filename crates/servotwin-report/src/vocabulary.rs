//! What things are called in the report of a study: one home for every word that depends on it.
//!
//! Units and commands have the names that the study gives them, a study of one unit has no wrong unit
//! to be confused with, and only the paper's study may speak of the paper's figures.

use super::words::spoken;
use servotwin::study::Study;
use servotwin_diagnosis::hierarchy::{FAULTY, HEALTHY, Question};

/// The study whose results the seed paper has.
pub const PAPER: &str = "paper";

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
            (1, 2) => format!(", and once one {unit} is off no other can be switched off"),
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

    /// What a question of the hierarchy finds: of one unit alone whether anything is wrong with it.
    pub fn question(&self, question: Question) -> String {
        match question {
            Question::Actuator if self.has_several() => format!("the {}", self.unit),
            Question::Actuator => "healthy or faulty".into(),
            Question::Action => "the command".into(),
            Question::Detail => "the detail".into(),
        }
    }

    /// A question of the hierarchy as it is asked.
    pub fn asks(&self, question: Question) -> String {
        match question {
            Question::Actuator if self.has_several() => format!("which {}?", self.unit),
            Question::Actuator => "is something wrong?".into(),
            Question::Action => "what is to be done?".into(),
            Question::Detail => "what is broken?".into(),
        }
    }

    /// An answer to a question by its name: the only unit is `faulty` or healthy, whatever its name.
    pub fn class<'t>(&self, question: Question, name: &'t str) -> &'t str {
        match question {
            Question::Actuator if !self.has_several() && name != HEALTHY => FAULTY,
            _ => name,
        }
    }

    /// A text about actuators, as the toolkit says it, in the words of the study: units have its name for them,
    /// the only one no number, and only the paper's study speaks of the paper.
    pub fn adapted(&self, text: &str) -> String {
        let of_paper = " (the paper's)";
        let text = text.replace(of_paper, self.paper(of_paper));
        let text = match self.has_several() {
            true => text,
            false => text.replace(", actuator 1", "").replace(" of each actuator", ""),
        };
        text.replace("actuator", &self.unit)
    }

    /// What was said of a fault never trained on: of the only unit it is not asked which one it is.
    pub fn said(&self, word: &str) -> String {
        match (word, self.has_several()) {
            ("actuator", false) => FAULTY.into(),
            ("wrong actuator", false) => "command though healthy".into(),
            _ => self.adapted(word),
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
    fn the_only_unit_is_healthy_or_faulty() {
        let one = of_units("unit", 1);
        let names = ["", "lane_1", "healthy"].map(|name| one.class(Question::Actuator, name));
        assert_eq!(names, ["faulty", "faulty", "healthy"]);
        assert_eq!(one.class(Question::Action, "halt"), "halt");
        assert_eq!(one.asks(Question::Actuator), "is something wrong?");
        let two = of_units("lane", 2);
        assert_eq!(two.class(Question::Actuator, "lane_1"), "lane_1");
        assert_eq!(two.asks(Question::Actuator), "which lane?");
    }

    #[test]
    fn what_is_said_of_actuators_is_said_of_the_units_of_the_study() {
        let cases = [
            (
                "differential pressure, actuator 1",
                "differential pressure",
                "differential pressure, lane 1",
            ),
            ("pressure of each actuator", "pressure", "pressure of each lane"),
            ("a mean (the paper's)", "a mean", "a mean"),
        ];
        for (text, one, two) in cases {
            assert_eq!(of_units("unit", 1).adapted(text), one);
            assert_eq!(of_units("lane", 2).adapted(text), two);
            let paper = Vocabulary { is_paper: true, ..of_units("actuator", 2) };
            assert_eq!(paper.adapted(text), text);
        }
    }

    fn of_units(unit: &str, units: usize) -> Vocabulary {
        Vocabulary { unit: unit.into(), units, off: vec![], is_paper: false }
    }

    #[test]
    fn commands_keep_their_names() {
        let words = |off: &[&str]| Vocabulary {
            off: off.iter().map(|&one| one.into()).collect(),
            ..of_units("unit", 1)
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
