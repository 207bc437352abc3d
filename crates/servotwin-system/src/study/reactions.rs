//! The reactions of the flight control computer to raised actions.
//!
//! ```toml
//! [reactions]
//! shut_down = { switches_off = true, unit_inputs = { mode = 0 } }
//! "change_mode/displacement_sensor" = { unit_parameters = { "position_selector.select" = 1 }, takes_out = ["ram"] }
//! ```
//!
//! A reaction belongs to an action, or to an action for one fault class, which takes precedence. Keys with `unit_`
//! refer to the faulty actuator.

use super::faults::full_name;
use super::keys::QUANTITY;
use super::reader::{Noted, OF_A_CLASS, Reader};
use crate::document::KeyPath;
use crate::format::{Value, section};
use servotwin_diagnosis::features::Quantity;
use std::collections::BTreeMap;

section! {
    /// A reaction as the study file declares it.
    #[derive(Default)]
    #[serde(default)]
    pub(super) struct Text {
        may switches_off: bool, "true: the action switches the channel off";
        may unit_inputs: BTreeMap<String, f64>, "values for inputs of the faulty channel";
        may unit_parameters: BTreeMap<String, f64>, "values for parameters of the faulty channel";
        may parameters: BTreeMap<String, f64>, "values for parameters of the system";
        may takes_out: Vec<String> = Value::List(0, &QUANTITY),
            "quantities whose sensors are ignored after the action";
    }
}

/// The reaction to a fault of one actuator.
#[derive(Clone, Debug, Default, PartialEq)]
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

/// The reactions of a study.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reactions {
    /// Reactions by `action` or `action/fault class`, with one entry for each actuator.
    list: Vec<(String, Vec<Reaction>)>,
}

impl Reactions {
    pub(super) fn new(texts: &BTreeMap<String, Text>, reader: &Reader) -> Result<Self, Noted> {
        let classes = &reader.text.classes;
        let commands = classes.iter().map(|class| class.command.clone());
        let both = classes.iter().map(|class| format!("{}/{}", class.command, class.detail));
        let known: Vec<String> = commands.chain(both).collect();
        let mut list = vec![];
        for (name, text) in texts {
            if !known.contains(name) && !known.is_empty() {
                let known = known.iter().map(String::as_str);
                reader.unknown(&KeyPath::of(&["reactions", name]).name(), OF_A_CLASS, name, known);
                continue;
            }
            let units = 0..reader.text.units.len();
            let section = KeyPath::of(&["reactions", name]);
            let of_units = units.map(|unit| text.reaction(reader, &section, unit));
            list.push((name.clone(), reader.sound(of_units)));
        }
        Ok(Reactions { list })
    }

    /// The reaction for an actuator, or no changes if the study defines none.
    pub fn of(&self, unit: usize, command: &str, detail: Option<&str>) -> Reaction {
        let find = |name: &str| self.list.iter().find(|(known, _)| known == name);
        let special = detail.and_then(|detail| find(&format!("{command}/{detail}")));
        let found = special.or_else(|| find(command));
        found.and_then(|(_, units)| units.get(unit)).cloned().unwrap_or_default()
    }

    /// Whether any reaction changes a parameter (component, parameter).
    pub(super) fn change(&self, at: (usize, usize)) -> bool {
        let all = self.list.iter().flat_map(|(_, units)| units);
        let mut changed = all.flat_map(|reaction| &reaction.parameters);
        changed.any(|&(component, parameter, _)| (component, parameter) == at)
    }

    /// Whether an action switches the actuator off.
    pub fn switches_off(&self, command: &str) -> bool {
        self.of(0, command, None).switches_off
    }
}

impl Text {
    fn reaction(&self, reader: &Reader, section: &KeyPath, unit: usize) -> Result<Reaction, Noted> {
        let name = &reader.text.units[unit];
        let mut reaction = Reaction { switches_off: self.switches_off, ..Reaction::default() };
        for (input, value) in &self.unit_inputs {
            let at = section.key("unit_inputs").key(input);
            let place = reader.input(&at.name(), &full_name(name, input))?;
            reader.constant(&at, place, *value)?;
            reaction.inputs.push((place, *value));
        }
        let own = self.unit_parameters.iter();
        let own = own.map(|(p, value)| (name.as_str(), "unit_parameters", p, value));
        let common = self.parameters.iter().map(|(p, value)| ("", "parameters", p, value));
        for (unit, of, parameter, &value) in own.chain(common) {
            let at = section.key(of).key(parameter);
            let (component, place) = super::realism::find(reader, &at.name(), unit, parameter)?;
            reader.parameter(&at, (component, place), value)?;
            reaction.parameters.push((component, place, value));
        }
        let (_, sensors) = reader.sensors()?;
        for (n, word) in self.takes_out.iter().enumerate() {
            let at = section.key("takes_out").element(n);
            let known = || Quantity::ALL.iter().map(|(_, word)| *word);
            let found = Quantity::ALL.iter().find(|(_, known)| known == word);
            let (quantity, _) =
                found.ok_or_else(|| reader.unknown(&at, "quantity", word, known()))?;
            reaction.takes_out.extend(sensors.find(*quantity, unit));
        }
        Ok(reaction)
    }
}
