//! What the flight control computer does when a command is raised.
//!
//! ```toml
//! [reactions]
//! shut_down = { switches_off = true, unit_inputs = { mode = 0 } }
//! "change_mode/displacement_sensor" = { unit_parameters = { "position_selector.select" = 1 }, takes_out = ["ram"] }
//! ```
//!
//! A reaction belongs to a command, or to a command for one detail, which goes first. Inputs and
//! parameters with `unit_` are those of the faulty unit.

use super::faults::full_name;
use super::keys::QUANTITY;
use super::reader::{Noted, OF_A_CLASS, Reader};
use crate::document::Place;
use crate::format::{Value, section};
use servotwin_diagnosis::features::Quantity;
use std::collections::BTreeMap;

section! {
    /// A reaction as the study file says it.
    #[derive(Default)]
    #[serde(default)]
    pub(super) struct Text {
        may switches_off: bool, "whether the command switches the unit off";
        may unit_inputs: BTreeMap<String, f64>, "values for inputs of the unit at fault";
        may unit_parameters: BTreeMap<String, f64>, "values for parameters of the unit at fault";
        may parameters: BTreeMap<String, f64>, "values for parameters of the system";
        may takes_out: Vec<String> = Value::List(0, &QUANTITY),
            "quantities whose sensors are ignored afterwards";
    }
}

/// What is done about a fault of one unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reaction {
    /// Whether the unit is off then.
    pub switches_off: bool,
    /// Inputs of the system with their new values.
    pub inputs: Vec<(usize, f64)>,
    /// Parameters (component, parameter) with their new values.
    pub parameters: Vec<(usize, usize, f64)>,
    /// Sensors that nobody listens to any more, as places in the study's list.
    pub takes_out: Vec<usize>,
}

/// The reactions of a study.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reactions {
    /// By command, or `command/detail`: one reaction for each unit.
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
                reader.unknown(&Place::of(&["reactions", name]).name(), OF_A_CLASS, name, known);
                continue;
            }
            let units = 0..reader.text.units.len();
            let section = Place::of(&["reactions", name]);
            let of_units = units.map(|unit| text.reaction(reader, &section, unit));
            list.push((name.clone(), reader.sound(of_units)));
        }
        Ok(Reactions { list })
    }

    /// What is done about a unit; nothing where the study does not say.
    pub fn of(&self, unit: usize, command: &str, detail: Option<&str>) -> Reaction {
        let find = |name: &str| self.list.iter().find(|(known, _)| known == name);
        let special = detail.and_then(|detail| find(&format!("{command}/{detail}")));
        let found = special.or_else(|| find(command));
        found.and_then(|(_, units)| units.get(unit)).cloned().unwrap_or_default()
    }

    /// Whether any of them gives a parameter (component, parameter) another value.
    pub(super) fn change(&self, at: (usize, usize)) -> bool {
        let all = self.list.iter().flat_map(|(_, units)| units);
        let mut changed = all.flat_map(|reaction| &reaction.parameters);
        changed.any(|&(component, parameter, _)| (component, parameter) == at)
    }

    /// Whether a command switches its unit off.
    pub fn switches_off(&self, command: &str) -> bool {
        self.of(0, command, None).switches_off
    }
}

impl Text {
    fn reaction(&self, reader: &Reader, section: &Place, unit: usize) -> Result<Reaction, Noted> {
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
