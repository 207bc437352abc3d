//! The reactions of the flight control computer to raised actions.
//!
//! A reaction belongs to an action, or to an action for one fault class, which takes precedence. Keys with `unit_`
//! refer to the faulty actuator.

use super::faults::full_name;
use super::reader::{Noted, Reader};
use crate::format::{At, Names, section};
use serde::{Deserialize, Serialize};

section! {
    /// A reaction as the study file declares it.
    pub(super) struct Text {
        may switches_off: bool, "true: the action switches the actuator off";
        may actuator_inputs: Names<At<f64>>, "values for inputs of the faulty actuator";
        may actuator_parameters: Names<At<f64>>, "values for parameters of the faulty actuator";
        may parameters: Names<At<f64>>, "values for parameters of the system";
        may takes_out: Vec<At<String>>,
            "sensors that are ignored after the action; those of other actuators stay";
    }
}

/// The reaction to a fault of one actuator.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reaction {
    /// Whether it switches the actuator off.
    pub switches_off: bool,
    /// Indices of inputs with their new values, SI.
    pub inputs: Vec<(usize, f64)>,
    /// New values of parameters: (component, parameter, value in SI).
    pub parameters: Vec<(usize, usize, f64)>,
    /// Sensors to ignore afterwards, as indices into the study's list.
    pub takes_out: Vec<usize>,
}

impl Reaction {
    /// Whether it sets inputs or parameters.
    pub fn changes_mode(&self) -> bool {
        !self.inputs.is_empty() || !self.parameters.is_empty()
    }
}

/// The reactions of a study.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reactions {
    /// Reactions by `action` or `action/fault class`, with one entry for each actuator.
    list: Vec<(String, Vec<Reaction>)>,
}

impl Reactions {
    pub(super) fn new(texts: &Names<Text>, reader: &Reader) -> Result<Self, Noted> {
        let classes = &reader.text.classes;
        let actions = classes.iter().map(|class| class.action.value.clone());
        let both = classes.iter().map(|class| format!("{}/{}", *class.action, *class.detail));
        let known: Vec<String> = actions.chain(both).collect();
        let mut list = vec![];
        for (name, text) in texts {
            if !known.contains(name) && !known.is_empty() {
                let known = known.iter().map(String::as_str);
                let what = "action, or action/detail, of a class";
                reader.unknown(&name.at, (what, name), known);
                continue;
            }
            let actuators = 0..reader.text.actuators.len();
            let of_actuators = actuators.map(|actuator| text.reaction(reader, actuator));
            list.push((name.value.clone(), reader.sound(of_actuators)));
        }
        Ok(Reactions { list })
    }

    /// The reaction for an actuator, or no changes if the study defines none.
    pub fn of(&self, actuator: usize, action: &str, detail: Option<&str>) -> Reaction {
        let find = |name: &str| self.list.iter().find(|(known, _)| known == name);
        let special = detail.and_then(|detail| find(&format!("{action}/{detail}")));
        let found = special.or_else(|| find(action));
        found.and_then(|(_, actuators)| actuators.get(actuator)).cloned().unwrap_or_default()
    }

    /// Whether any reaction changes a parameter (component, parameter).
    pub(super) fn change(&self, at: (usize, usize)) -> bool {
        let all = self.list.iter().flat_map(|(_, actuators)| actuators);
        let mut changed = all.flat_map(|reaction| &reaction.parameters);
        changed.any(|&(component, parameter, _)| (component, parameter) == at)
    }

    /// Whether an action switches the actuator off.
    pub fn switches_off(&self, action: &str) -> bool {
        self.of(0, action, None).switches_off
    }
}

impl Text {
    fn reaction(&self, reader: &Reader, actuator: usize) -> Result<Reaction, Noted> {
        let name = &reader.text.actuators[actuator];
        let mut reaction = Reaction { switches_off: self.switches_off, ..Reaction::default() };
        for (input, value) in &self.actuator_inputs {
            let place = reader.input(&input.at, &full_name(name, input))?;
            reader.constant((input, &value.at), place, value.value)?;
            reaction.inputs.push((place, value.value));
        }
        let own = self.actuator_parameters.iter().map(|of| (name.as_str(), of));
        for (of_actuator, (parameter, value)) in
            own.chain(self.parameters.iter().map(|of| ("", of)))
        {
            let (component, place) = super::realism::find(reader, of_actuator, parameter)?;
            reader.parameter((parameter, &value.at), (component, place), value.value)?;
            reaction.parameters.push((component, place, value.value));
        }
        let (measured, sensors) = reader.sensors()?;
        let ids = || measured.iter().map(|&place| reader.system.sensors[place].id.as_str());
        for id in &self.takes_out {
            let found = ids().position(|known| known == **id);
            let unknown = || reader.unknown(&id.at, ("sensor of the study", id), ids());
            let place = found.ok_or_else(unknown)?;
            if sensors.0[place].actuator.is_none_or(|own| own == actuator) {
                reaction.takes_out.push(place);
            }
        }
        Ok(reaction)
    }
}

#[cfg(test)]
mod tests {
    use crate::study::Study;

    #[test]
    fn a_reaction_takes_out_the_named_sensors_of_the_faulty_actuator() {
        let study = Study::default();
        let named = |actuator: usize, class: &str| {
            let reaction = study.reactions.of(actuator, "change_mode", Some(class));
            let name = |&sensor: &usize| study.sensors.0[sensor].name.clone();
            reaction.takes_out.iter().map(name).collect::<Vec<_>>()
        };
        assert_eq!(named(0, "displacement_sensor"), ["x_p_1"]);
        assert_eq!(named(1, "cylinder_pressure_sensor"), ["p_a_2", "p_b_2"]);
        let wrong = study.text.replace("[\"x_p_1\", \"x_p_2\"]", "[\"x_p_1\", \"ram\"]");
        let error =
            Study::parse(&wrong, "wrong.toml").err().expect("a quantity is no sensor").to_string();
        assert!(error.contains("ram") && error.contains("sensor of the study"), "{error}");
    }
}
