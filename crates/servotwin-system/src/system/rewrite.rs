//! Writes new parameter values into the text of a system file, with as few changes as possible.
//!
//! A value in the file is replaced in place. A missing one is written as a new line after the first line of its
//! component, or of the assembly's instance. The result is parsed again; if it differs from the intended system, an
//! error is returned.

use super::System;
use crate::document::{Entry, entries};
use servotwin_model::network::Network;
use toml::de::DeTable;

/// A parameter with its new value.
#[derive(Clone, Debug, PartialEq)]
pub struct NewValue {
    /// The index of the component.
    pub component: usize,
    /// The index of the parameter.
    pub parameter: usize,
    /// Its value, SI.
    pub value: f64,
    /// A one-line comment written after the value.
    pub comment: String,
}

/// The file's layout does not allow a parameter to be changed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{component}.{parameter} cannot be written into the system file as it is laid out: give the component a section of \
     its own"
)]
pub struct RewriteError {
    /// The component's id.
    pub component: String,
    /// The name of the parameter.
    pub parameter: &'static str,
}

/// A replacement of a range of text.
struct Edit {
    from: usize,
    to: usize,
    text: String,
}

impl System {
    /// The text of the system file with new values, and a head comment of several lines.
    ///
    /// # Errors
    /// A parameter cannot be written.
    pub fn rewritten(&self, head: &[String], values: &[NewValue]) -> Result<String, RewriteError> {
        let (root, _) = DeTable::parse_recoverable(&self.text);
        let root = entries(root.get_ref());
        let components = table(&root, "components").unwrap_or_default();
        let mut edits = Vec::new();
        for new in values {
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
        match System::parse(&text, "rewritten") {
            Ok(read) => self.says(&read, values).map(|()| text),
            Err(_) => Err(self.refusal(&values[0])),
        }
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
        let parameter = instance.component.spec().parameters[new.parameter].name;
        RewriteError { component: instance.id.clone(), parameter }
    }

    fn edit(&self, components: &[Entry], new: &NewValue) -> Option<Edit> {
        let instance = &self.network().components[new.component];
        let key = instance.component.spec().parameters[new.parameter].name;
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
        let first = own.first()?.at.start;
        let line = self.text[..first].rfind('\n').map_or(0, |n| n + 1);
        let before = &self.text[line..first];
        if before.contains('{') {
            return Some(Edit { from: first, to: first, text: format!("{path} = {value:?}, ") });
        }
        let end = own.first()?.value_at().end;
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
    let entry = all.iter().find(|entry| entry.key == key)?;
    entry.table().ok().map(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn new(system: &System, id: &str, parameter: &str, value: f64) -> NewValue {
        let components = &system.network().components;
        let component = components.iter().position(|c| c.id == id).unwrap();
        let parameter = components[component].component.spec().parameter(parameter).unwrap();
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
}
