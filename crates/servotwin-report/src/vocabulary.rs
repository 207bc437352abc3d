//! The words in a study's report that depend on the study, all in one place.
//!
//! Actuators and actions have the names that the study gives them. With a single actuator no other can be wrongly
//! accused. Only the paper's study refers to the paper's figures.

use super::words::{chosen, spoken};
use servotwin::measure::Measure;
use servotwin::measure::flights::STRONG;
use servotwin::study::Study;
use servotwin_diagnosis::hierarchy::{FAULTY, HEALTHY, Question};

/// The name of the study that the seed paper reports on.
pub const PAPER: &str = "paper";

/// The words of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vocabulary {
    /// The name of one actuator, e.g. `actuator`.
    actuator: String,
    actuators: usize,
    /// The actions that switch an actuator off.
    off: Vec<String>,
    is_paper: bool,
}

impl Vocabulary {
    /// Collects the words of a study.
    pub fn of(study: &Study) -> Self {
        Vocabulary {
            actuator: common_name(&study.actuators),
            actuators: study.actuators.len(),
            off: study.shutdowns(),
            is_paper: study.name == PAPER,
        }
    }

    /// What the study calls its actuators: `actuator` for `actuator_1` and `actuator_2`.
    pub fn actuator(&self) -> &str {
        &self.actuator
    }

    /// The plural of [`Vocabulary::actuator`].
    pub(crate) fn actuators(&self) -> String {
        format!("{}s", self.actuator)
    }

    /// Refers to two actuators: `both` if there are exactly two, else `two`.
    pub(crate) fn two(&self) -> &'static str {
        if self.actuators == 2 { "both" } else { "two" }
    }

    /// Whether one actuator can be confused with another.
    pub fn has_several(&self) -> bool {
        self.actuators > 1
    }

    /// The text if there are several actuators, else an empty string.
    pub(crate) fn several<'t>(&self, text: &'t str) -> &'t str {
        if self.has_several() { text } else { "" }
    }

    /// Whether any action switches an actuator off. Safety figures exist only then.
    pub(crate) fn has_off(&self) -> bool {
        !self.off.is_empty()
    }

    /// The action that switches an actuator off: `shutdown`, or the study's name for it.
    pub(crate) fn off(&self) -> String {
        match self.off.as_slice() {
            [one] if one == "shut_down" => "shutdown".into(),
            [one] => format!("“{}”", spoken(one)),
            _ => "switch-off".into(),
        }
    }

    /// The clause about the number of actuators that must stay on; empty if all may be switched off.
    pub(crate) fn kept_on(&self, least_on: u32) -> String {
        let actuator = &self.actuator;
        match (least_on, self.actuators) {
            _ if !self.has_off() => String::new(),
            (0, _) => String::new(),
            (1, 2) => format!(", and once one {actuator} is off no other can be switched off"),
            (1, _) => format!(", and the last {actuator} that is on can never be switched off"),
            (kept, _) => format!(", and {kept} {actuator}s can never be switched off"),
        }
    }

    /// The participle for a switched-off actuator, e.g. `shut down`.
    pub(crate) fn switched_off(&self) -> &'static str {
        match self.off.as_slice() {
            [one] if one == "shut_down" => "shut down",
            _ => "switched off",
        }
    }

    /// The text if this is the paper's own study, else an empty string.
    pub(crate) fn paper<'t>(&self, text: &'t str) -> &'t str {
        if self.is_paper { text } else { "" }
    }

    /// Names the fixed band of ±3 %.
    pub(crate) fn fixed_band(&self) -> &'static str {
        if self.is_paper { "the seed paper's band of ±3 %" } else { "the fixed band of ±3 %" }
    }

    /// What the study calls a run of the diagnosis in operation.
    pub fn run(&self) -> &'static str {
        if self.is_paper { "flight" } else { "run" }
    }

    /// What every answer names: the action and, with several actuators, the actuator.
    pub(crate) fn action(&self) -> String {
        match self.has_several() {
            true => format!("{} and action", self.actuator),
            false => "action".into(),
        }
    }

    /// What happens in a measure without a limit on latency.
    pub(crate) fn measure(&self, measure: &Measure) -> String {
        let [sentence, _] = self.describe_measure(measure, &[]);
        sentence
    }

    /// Describes a measure: what happened, and in which faults. `limits_s` are the limits on latency of the
    /// scenarios.
    pub fn describe_measure(&self, measure: &Measure, limits_s: &[f64]) -> [String; 2] {
        let mut limits: Vec<String> = limits_s.iter().map(|&limit| chosen(limit)).collect();
        limits.dedup();
        let limit = match limits.as_slice() {
            [one] => format!("{one} s"),
            _ => "the limit".into(),
        };
        [measure.sentence, measure.of.words].map(|text| {
            text.replace("{action}", &self.action())
                .replace("{off}", &self.off())
                .replace("{actuator}", self.actuator())
                .replace("{switched_off}", self.switched_off())
                .replace("{limit}", &limit)
                .replace("{strong}", &chosen(STRONG))
        })
    }

    /// What a question of the hierarchy determines. For a single actuator that is whether it is faulty.
    pub(crate) fn question(&self, question: Question) -> String {
        match question {
            Question::Actuator if self.has_several() => format!("the {}", self.actuator),
            Question::Actuator => "healthy or faulty".into(),
            Question::Action => "the action".into(),
            Question::Detail => "the detail".into(),
        }
    }

    /// A question of the hierarchy, as a question.
    pub fn asks(&self, question: Question) -> String {
        match question {
            Question::Actuator if self.has_several() => format!("which {}?", self.actuator),
            Question::Actuator => "is something wrong?".into(),
            Question::Action => "what is to be done?".into(),
            Question::Detail => "what is broken?".into(),
        }
    }

    /// Names an answer to a question. A single actuator is `faulty` or healthy, whatever its name.
    pub(crate) fn class<'t>(&self, question: Question, name: &'t str) -> &'t str {
        match question {
            Question::Actuator if !self.has_several() && name != HEALTHY => FAULTY,
            _ => name,
        }
    }

    /// Adapts the toolkit's text about actuators to the study: actuators get the study's name, a single
    /// one has no number, and only the paper's study refers to the paper.
    pub(crate) fn adapted(&self, text: &str) -> String {
        let of_paper = " (the paper's)";
        let text = text.replace(of_paper, self.paper(of_paper));
        let text = match self.has_several() {
            true => text,
            false => text.replace(", actuator 1", "").replace(" of each actuator", ""),
        };
        text.replace("actuator", &self.actuator)
    }

    /// The answer for an unseen fault. It does not name the actuator if there is only one.
    pub(crate) fn said(&self, word: &str) -> String {
        match (word, self.has_several()) {
            ("actuator", false) => FAULTY.into(),
            ("wrong actuator", false) => "action though healthy".into(),
            _ => self.adapted(word),
        }
    }
}

/// The common stem of the names: `lane` for `lane_1` and `lane_2`, else `actuator`.
fn common_name(actuators: &[String]) -> String {
    let stem = |name: &String| {
        let stem = name.trim_end_matches(|last: char| last.is_ascii_digit());
        let is_numbered = stem.len() < name.len();
        is_numbered.then(|| stem.trim_end_matches(['_', '-', '.']).to_owned())
    };
    let first = actuators.first().and_then(stem).filter(|stem| !stem.is_empty());
    let is_common =
        |name: &String| actuators.iter().all(|actuator| stem(actuator).as_ref() == Some(name));
    first.filter(is_common).map_or_else(|| "actuator".into(), |stem| spoken(&stem))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actuators_are_called_what_they_have_in_common() {
        let cases: [(&[&str], &str); 5] = [
            (&["actuator_1", "actuator_2"], "actuator"),
            (&["left", "right"], "actuator"),
            (&[""], "actuator"),
            (&["axis_1", "pump_1"], "actuator"),
            (&["1", "2"], "actuator"),
        ];
        for (actuators, name) in cases {
            let actuators: Vec<String> =
                actuators.iter().map(|&actuator| actuator.into()).collect();
            assert_eq!(common_name(&actuators), name, "{actuators:?}");
        }
    }

    #[test]
    fn the_only_unit_is_healthy_or_faulty() {
        let one = of_actuators("actuator", 1);
        let names = ["", "lane_1", "healthy"].map(|name| one.class(Question::Actuator, name));
        assert_eq!(names, ["faulty", "faulty", "healthy"]);
        assert_eq!(one.class(Question::Action, "halt"), "halt");
        assert_eq!(one.asks(Question::Actuator), "is something wrong?");
        let two = of_actuators("lane", 2);
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
            assert_eq!(of_actuators("actuator", 1).adapted(text), one);
            assert_eq!(of_actuators("lane", 2).adapted(text), two);
            let paper = Vocabulary { is_paper: true, ..of_actuators("actuator", 2) };
            assert_eq!(paper.adapted(text), text);
        }
    }

    fn of_actuators(actuator: &str, actuators: usize) -> Vocabulary {
        Vocabulary { actuator: actuator.into(), actuators, off: vec![], is_paper: false }
    }

    #[test]
    fn commands_keep_their_names() {
        let words = |off: &[&str]| Vocabulary {
            off: off.iter().map(|&one| one.into()).collect(),
            ..of_actuators("actuator", 1)
        };
        assert_eq!(words(&["shut_down"]).off(), "shutdown");
        assert_eq!(
            (words(&["halt"]).off().as_str(), words(&["halt"]).switched_off()),
            ("“halt”", "switched off")
        );
        assert_eq!(words(&["halt", "vent"]).off(), "switch-off");
        assert!(!words(&[]).has_off() && words(&[]).action() == "action");
    }
}
