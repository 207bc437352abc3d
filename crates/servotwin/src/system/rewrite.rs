//! Writes new parameter values into the text of a system file, with as few changes as possible.
//!
//! A value in the file is replaced in place. A missing one is written as a new line after the first line of its
//! component, or of the assembly's instance. The temperature, bulk modulus and air content of a circuit are written at
//! all its sources and tanks. The result is parsed again; if it differs from the intended system, an error is returned.

use super::{FORMAT, System};
use crate::toml_text::{Collector, Entry, TomlError, TomlText, get};
use servotwin_model::network::{FLUID_PARAMETERS, Network};

/// A parameter with its new value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NewValue {
    /// The index of the component.
    pub(crate) component: usize,
    /// The index of the parameter.
    pub(crate) parameter: usize,
    /// Its value, SI.
    pub(crate) value: f64,
    /// A one-line comment written after the value.
    pub(crate) comment: String,
}

/// Why a system file cannot have new values.
#[derive(Debug, thiserror::Error)]
pub enum RewriteError {
    /// The file's layout does not allow a parameter to be changed.
    #[error(
        "{component}.{parameter} cannot be written into the system file as it is laid out: give the component a \
         section of its own"
    )]
    Layout {
        /// The component's id.
        component: String,
        /// The name of the parameter.
        parameter: &'static str,
    },
    /// The rewritten file has mistakes.
    #[error("the system file cannot have the new values:\n{0}")]
    Mistakes(#[source] TomlError),
}

/// A replacement of a range of text.
struct Edit {
    from: usize,
    to: usize,
    text: String,
}

impl System {
    /// The text of the system file with new values, and a head comment of several lines. Of several values of one
    /// parameter the last counts, as in a simulation.
    ///
    /// # Errors
    /// The layout of the file does not allow a parameter to be written, or the system is impossible with the values.
    pub(crate) fn rewritten(
        &self,
        head: &[String],
        values: &[NewValue],
    ) -> Result<String, RewriteError> {
        let document = TomlText::parse(&self.text, FORMAT, &mut Collector::default());
        let root = document.as_ref().map(TomlText::root).unwrap_or_default();
        let components = table(&root, "components").unwrap_or_default();
        let values = self.in_whole_circuits(values);
        let mut edits = Vec::new();
        for new in &values {
            let edit = self.edit(&components, new).ok_or_else(|| self.refusal(new))?;
            edits.push(edit);
        }
        // Edits are applied from the end, so that earlier offsets stay valid; edits at one place keep their order.
        edits.reverse();
        edits.sort_by_key(|edit| std::cmp::Reverse(edit.from));
        let mut text = self.text.clone();
        for edit in edits {
            text.replace_range(edit.from..edit.to, &edit.text);
        }
        let head: String = head.iter().map(|line| format!("# {line}\n")).collect();
        let text = format!("{head}{text}");
        let read = System::parse(&text, "rewritten file").map_err(RewriteError::Mistakes)?;
        self.says(&read, &values)?;
        Ok(text)
    }

    /// The values with one for each parameter. A value of a circuit's fluid is repeated for all sources and tanks of
    /// the circuit; that of the one which determines the fluid counts.
    fn in_whole_circuits(&self, values: &[NewValue]) -> Vec<NewValue> {
        let components = &self.network().components;
        let source = |component| self.program.fluid_source(component);
        let is_of_fluid = |new: &NewValue| {
            let spec = components[new.component].component;
            spec.reference && FLUID_PARAMETERS.contains(&spec.parameters[new.parameter].name)
        };
        let determines = |new: &&NewValue| source(new.component) == new.component;
        let (of_fluid, others): (Vec<_>, Vec<_>) = values.iter().partition(|new| is_of_fluid(new));
        let (decisive, following): (Vec<_>, Vec<_>) = of_fluid.into_iter().partition(determines);
        let mut all: Vec<NewValue> = Vec::new();
        let mut put = |new: NewValue| match all
            .iter_mut()
            .find(|own| (own.component, own.parameter) == (new.component, new.parameter))
        {
            Some(own) => *own = new,
            None => all.push(new),
        };
        others.into_iter().for_each(|new| put(new.clone()));
        for new in following.into_iter().chain(decisive) {
            let name = components[new.component].component.parameters[new.parameter].name;
            for (component, instance) in components.iter().enumerate() {
                let spec = instance.component;
                let is_in_circuit = spec.reference && source(component) == source(new.component);
                if let Some(parameter) = spec.parameter(name).filter(|_| is_in_circuit) {
                    put(NewValue { component, parameter, ..new.clone() });
                }
            }
        }
        all
    }

    /// Checks that a parsed system equals this one with the new values.
    fn says(&self, read: &System, values: &[NewValue]) -> Result<(), RewriteError> {
        let mut wanted: Vec<Vec<f64>> = parameters(self.network());
        for new in values {
            wanted[new.component][new.parameter] = new.value;
        }
        for (component, (wanted, found)) in
            wanted.iter().zip(parameters(read.network())).enumerate()
        {
            let differs = |(a, b): (&f64, &f64)| a.to_bits() != b.to_bits();
            if let Some(parameter) = wanted.iter().zip(&found).position(differs) {
                let (value, comment) = (wanted[parameter], String::new());
                return Err(self.refusal(&NewValue { component, parameter, value, comment }));
            }
        }
        Ok(())
    }

    fn refusal(&self, new: &NewValue) -> RewriteError {
        let instance = &self.network().components[new.component];
        let parameter = instance.component.parameters[new.parameter].name;
        RewriteError::Layout { component: instance.id.clone(), parameter }
    }

    fn edit(&self, components: &[Entry], new: &NewValue) -> Option<Edit> {
        let instance = &self.network().components[new.component];
        let key = instance.component.parameters[new.parameter].name;
        // A component of the system, otherwise one of an assembly's instance.
        if let Some(own) = table(components, &instance.id) {
            return self.in_table(&own, key, key, new);
        }
        let (of, part) = instance.id.split_once('.')?;
        let of = table(components, of)?;
        match table(&of, part).filter(|own| !own.is_empty()) {
            Some(own) => self.in_table(&own, key, key, new),
            None => self.in_table(&of, key, &format!("{part}.{key}"), new),
        }
    }

    /// Replaces the value of a key, or inserts it as `path` next to the first entry.
    fn in_table(&self, own: &[Entry], key: &str, path: &str, new: &NewValue) -> Option<Edit> {
        let NewValue { value, comment, .. } = new;
        if let Some(there) = own.iter().find(|entry| entry.key == key && key == path) {
            let span = there.value_at();
            let line_end =
                self.text[span.end..].find('\n').map_or(self.text.len(), |n| span.end + n);
            let rest = &self.text[span.end..line_end];
            // A value at the end of its line leaves room for a comment.
            let (to, behind) = match rest.trim_start().strip_prefix('#') {
                Some(old) => (line_end, format!("  # {comment}; {}", old.trim())),
                None if rest.trim().is_empty() => (line_end, format!("  # {comment}")),
                None => (span.end, String::new()),
            };
            return Some(Edit { from: span.start, to, text: format!("{value:?}{behind}") });
        }
        // A table may have a header of its own, beside which no other key can stand.
        let entry = own.iter().find(|entry| entry.table().is_none()).or(own.first())?;
        let first = entry.at.start;
        let line = self.text[..first].rfind('\n').map_or(0, |n| n + 1);
        let before = &self.text[line..first];
        if before.contains('{') {
            return Some(Edit { from: first, to: first, text: format!("{path} = {value:?}, ") });
        }
        let end = entry.value_at().end;
        let at = self.text[end..].find('\n').map(|n| end + n + 1);
        let text = format!("{before}{path} = {value:?}  # {comment}\n");
        match at {
            Some(at) => Some(Edit { from: at, to: at, text }),
            None => {
                let end = self.text.len();
                Some(Edit { from: end, to: end, text: format!("\n{text}") })
            }
        }
    }
}

fn parameters(network: &Network) -> Vec<Vec<f64>> {
    network.components.iter().map(|instance| instance.parameters.clone()).collect()
}

fn table<'a>(all: &[Entry<'a>], key: &str) -> Option<Vec<Entry<'a>>> {
    get(all, key)?.table()
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotwin_model::network::Instance;

    fn new(system: &System, id: &str, parameter: &str, value: f64) -> NewValue {
        let components = &system.network().components;
        let component = components.iter().position(|c| c.id == id).unwrap();
        let parameter = components[component].component.parameter(parameter).unwrap();
        NewValue { component, parameter, value, comment: "± 1".into() }
    }

    #[test]
    fn two_instances_of_an_assembly_get_their_own_values() {
        let system = System::default();
        let values = [
            new(&system, "actuator_1.servo_valve", "width_pa_m", 2.41e-3),
            new(&system, "actuator_2.servo_valve", "width_pa_m", 2.2e-3),
            new(&system, "actuator_1.servo_valve", "null_bias", -0.00123),
            new(&system, "actuator_1.cylinder", "coulomb_friction_n", 512.5),
            new(&system, "equaliser", "gain_m_pa", 2.4e-10),
            new(&system, "lever", "arm_m", 0.052),
        ];
        let text = system.rewritten(&["Fitted.".into()], &values).unwrap();
        assert!(text.starts_with("# Fitted.\n# Two equal"));
        assert!(text.contains("servo_valve.width_pa_m = 0.00241  # ± 1\n"), "{text}");
        assert!(text.contains("gain_m_pa = 2.4e-10  # ± 1; [J]\n"), "{text}");
        // Once more, replacing the values that were just written.
        let again = System::parse(&text, "again").unwrap();
        let values = [
            new(&again, "actuator_1.servo_valve", "width_pa_m", 2.42e-3),
            new(&again, "actuator_1.servo_valve", "clearance_m", 3.9e-6),
        ];
        let text = again.rewritten(&[], &values).unwrap();
        assert!(text.contains("servo_valve.width_pa_m = 0.00242  # ± 1; ± 1\n"), "{text}");
        assert_eq!(text.matches("servo_valve.width_pa_m =").count(), 2);
    }

    #[test]
    fn tables_in_one_line_keep_their_line() {
        let text = r#"
            format = 1
            name = "leaking_volume"
            [components]
            supply = { kind = "pressure_source" }
            leak = { kind = "orifice", area_m2 = 1e-7 }
            chamber.kind = "volume"
            chamber.volume_m3 = 1e-4
            [system]
            connections = [["supply.port", "leak.a"], ["leak.b", "chamber.port"]]"#;
        let system = System::parse(text, "text").unwrap();
        let values = [
            new(&system, "supply", "pressure_pa", 2e7),
            new(&system, "leak", "area_m2", 2e-7),
            new(&system, "chamber", "volume_m3", 2e-4),
            new(&system, "chamber", "start_pa", 3e5),
        ];
        let text = system.rewritten(&[], &values).unwrap();
        assert!(
            text.contains(r#"supply = { pressure_pa = 20000000.0, kind = "pressure_source" }"#),
            "{text}"
        );
        assert!(text.contains("area_m2 = 2e-7 }"), "{text}");
        assert!(text.contains("chamber.start_pa = 300000.0  # ± 1\n"), "{text}");
    }

    #[test]
    fn every_parameter_of_every_shipped_system_can_be_written() {
        for (name, text) in crate::built_in::SYSTEMS {
            let system = System::parse(text, name).unwrap();
            let components = &system.network().components;
            // All first parameters at once, then all second ones, and so on: reading a file takes most of the time.
            for parameter in 0..components.iter().map(|c| c.parameters.len()).max().unwrap() {
                let has_it =
                    |(_, instance): &(usize, &Instance)| parameter < instance.parameters.len();
                let moved = |(component, instance): (usize, &Instance)| {
                    let (min, max) = instance.range(parameter);
                    let nominal = instance.parameters[parameter];
                    let step = 1e-3 * if nominal == 0.0 { max.min(1.0) } else { nominal.abs() };
                    let value = if nominal + step <= max { nominal + step } else { nominal - step };
                    assert!(value >= min && value != nominal, "{}", instance.id);
                    NewValue { component, parameter, value, comment: "moved".into() }
                };
                let values: Vec<_> =
                    components.iter().enumerate().filter(has_it).map(moved).collect();
                let text = system.rewritten(&[], &values);
                let text = text.unwrap_or_else(|refusal| panic!("{name}: {refusal}"));
                let read = System::parse(&text, name).unwrap();
                for NewValue { component, value, .. } in values {
                    let found = read.network().components[component].parameters[parameter];
                    assert_eq!(found, value, "{}, parameter {parameter}", components[component].id);
                }
            }
        }
    }

    #[test]
    fn sources_and_tanks_of_a_circuit_get_one_temperature() {
        let system = System::default();
        let supply = new(&system, "actuator_1.supply", "temperature_k", 311.0);
        let reserve = new(&system, "actuator_1.reserve", "temperature_k", 312.0);
        let values = [supply, reserve, new(&system, "actuator_2.tank", "air_factor", 1.1)];
        let text = system.rewritten(&[], &values).unwrap();
        for part in ["supply", "tank", "reserve"] {
            let line = format!("\n{part}.temperature_k = 311.0  # ± 1\n");
            assert_eq!(text.matches(&line).count(), 1, "{text}");
            let line = format!("\n{part}.air_factor = 1.1  # ± 1\n");
            assert_eq!(text.matches(&line).count(), 1, "{text}");
        }
    }

    #[test]
    fn the_last_of_several_values_counts() {
        let system = System::default();
        let width = |value| new(&system, "actuator_1.servo_valve", "width_pa_m", value);
        let text = system.rewritten(&[], &[width(2.3e-3), width(2.2e-3)]).unwrap();
        assert!(text.contains("servo_valve.width_pa_m = 0.0022  # ± 1\n"), "{text}");
    }

    #[test]
    fn a_part_with_a_header_before_its_instance_keeps_its_header() {
        let instance = "[components.actuator_1]\n";
        let part = "[components.actuator_1.cylinder]\nmass_kg = 2.5\n";
        let text = System::default().text.replace(instance, &format!("{part}{instance}"));
        let system = System::parse(&text, "text").unwrap();
        let values = [
            new(&system, "actuator_1.cylinder", "coulomb_friction_n", 510.0),
            new(&system, "actuator_1.servo_valve", "null_bias", 0.01),
        ];
        let text = system.rewritten(&[], &values).unwrap();
        assert!(text.contains("mass_kg = 2.5\ncoulomb_friction_n = 510.0"), "{text}");
        assert!(text.contains("assembly = \"actuator\"\nservo_valve.null_bias = 0.01"), "{text}");
    }

    #[test]
    fn values_that_are_impossible_are_refused_with_the_reason() {
        let system = System::default();
        let values = [new(&system, "actuator_1.cylinder", "volume_a_m3", 1e-6)];
        let reason = system.rewritten(&[], &values).unwrap_err().to_string();
        assert!(reason.contains("which must be below volume_a_m3 (1e-6)"), "{reason}");
    }
}
