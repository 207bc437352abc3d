//! Plot styles of a study's actuators, actions and failures in the figures of its report.

use servotwin::study::Study;
use servotwin_diagnosis::hierarchy::Question;
use servotwin_view::{Look, SemanticColor};

/// The plot styles of a study's actuators, actions and failures.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Looks {
    actuators: Vec<String>,
    actions: Vec<String>,
    /// Fault classes, each with the index of its action.
    details: Vec<(String, usize)>,
}

impl Looks {
    /// Assigns styles to a study's actuators, actions and failures.
    pub(crate) fn of(study: &Study) -> Self {
        let actions = study.actions();
        let mut details: Vec<(String, usize)> = vec![];
        for class in &study.classes {
            let action = actions.iter().position(|action| *action == class.action);
            if details.iter().all(|(known, _)| *known != class.detail) {
                details.push((class.detail.clone(), action.unwrap_or(0)));
            }
        }
        Looks { actuators: study.actuators.clone(), actions, details }
    }

    /// The style of a class, by the question that it answers. Healthy is plain.
    pub(crate) fn class(&self, question: Question, name: &str) -> Look {
        let place = |names: &[String]| names.iter().position(|known| known == name);
        let found = match question {
            Question::Actuator => {
                place(&self.actuators).map(|place| SemanticColor::Actuator(place).look())
            }
            Question::Action => {
                place(&self.actions).map(|place| SemanticColor::Action(place).look())
            }
            Question::Detail => self.detail(name),
        };
        found.unwrap_or_else(|| SemanticColor::Plain(1).look())
    }

    fn detail(&self, name: &str) -> Option<Look> {
        let place = self.details.iter().position(|(known, _)| known == name)?;
        let action = self.details[place].1;
        let below = self.details[..place].iter().filter(|(_, other)| *other == action).count();
        // Without colors, every fault class still has its own look.
        Some(SemanticColor::Detail(action, below).look().at(place))
    }
}

/// Styles of two series that have no meaning in other figures.
pub(crate) fn plain() -> Vec<Look> {
    vec![SemanticColor::Plain(0).look(), SemanticColor::Plain(1).look()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_detail_of_the_paper_has_a_look_of_its_own() {
        let looks = Looks::of(&Study::default());
        let all: Vec<Look> = looks.details.iter().map(|d| looks.detail(&d.0).unwrap()).collect();
        for (place, look) in all.iter().enumerate() {
            assert!(!all[place + 1..].contains(look), "{} is drawn twice", looks.details[place].0);
        }
        let healthy = looks.class(Question::Actuator, "healthy");
        assert!(
            looks
                .actuators
                .iter()
                .all(|actuator| looks.class(Question::Actuator, actuator) != healthy)
        );
    }
}
