//! Warnings about valid but probably unintended entries of a study.

use super::faults::full_name;
use super::{Study, training};
use crate::signal::{Argument, Signal, Sort};
use crate::toml_text::{Collector, Diagnostic, NumberWithUnit, Quantities};

impl Study {
    /// Lists valid but probably unintended entries with their places in the file.
    pub fn warnings(&self) -> Vec<Diagnostic> {
        let reader = self.reader();
        let mut found = Collector::default();
        for case in &self.faults {
            if let Some(warning) = self.inert(case.at.component, case.at.fault) {
                found.note(&reader.place_of_fault(case), Diagnostic::new(warning));
            }
        }
        self.beyond_input(&mut found);
        found.locate(&self.text)
    }

    /// Notes draws that would leave the range of their input in a long enough flight. Short flights or few draws may
    /// still keep it within its range.
    fn beyond_input(&self, found: &mut Collector) {
        let draws = self.parsed.training.iter().flat_map(|text| text.patterns());
        let flown = self.flights.iter().flat_map(|flights| &flights.varied.commands);
        for pattern in draws.chain(flown) {
            let at_end = |end: f64| training::filled_at(pattern, 1, |_| end).parse().ok();
            let signals = [0.0, 1.0].into_iter().filter_map(at_end);
            for warning in signals.flat_map(|signal: Signal| self.larger_than_input(&signal)) {
                found.note(&pattern.at, Diagnostic::new(warning));
            }
        }
    }

    /// The values of a signal whose magnitude exceeds the range of the driven input.
    fn larger_than_input(&self, signal: &Signal) -> Vec<String> {
        let input = &self.system.network().inputs[self.command_input];
        let (min, max) = self.system.network().input_range(self.command_input);
        let given = signal.terms().iter().flat_map(|term| {
            let is_value = |name| {
                let declared = term.kind.parameter(name).map(|place| &term.kind.parameters[place]);
                declared.is_some_and(|declared| declared.sort == Sort::Value)
            };
            term.arguments().filter(move |(name, _)| is_value(name))
        });
        let larger = given.filter_map(|(parameter, argument)| match argument {
            Argument::Quantity(given) if given.si().abs() > min.abs().max(max.abs()) => {
                let unit = input.unit.symbol();
                let (value, range) = (NumberWithUnit(given.si(), unit), Quantities(min, max, unit));
                Some(format!(
                    "'{parameter}' is drawn up to {value}, but '{}' may only become {range}",
                    input.id
                ))
            }
            _ => None,
        });
        larger.collect()
    }

    /// The warnings as lines with path, line, column and message.
    pub fn warnings_in_words(&self) -> Vec<String> {
        let line = |Diagnostic { line, column, message, .. }| {
            format!("{}:{line}:{column}: {message}", self.path)
        };
        self.warnings().into_iter().map(line).collect()
    }

    /// The warning about a fault that changes nothing, because its law leaves the parameter as it is, e.g. a factor of
    /// one.
    fn inert(&self, component: usize, fault: usize) -> Option<String> {
        let instance = &self.system.network().components[component];
        let spec = instance.component;
        let declared = &spec.faults[fault];
        let place = spec.parameter(declared.parameter)?;
        let value = instance.parameters[place];
        let is_inert = declared.law.apply(value, 1.0, instance.fault_full[fault]) == value;
        (is_inert && !self.varies(component, place)).then(|| {
            format!(
                "the fault '{id}.{}' changes nothing: '{}' of '{id}' stays {} at every intensity",
                declared.name,
                declared.parameter,
                NumberWithUnit(value, spec.parameters[place].unit.symbol()),
                id = instance.id,
            )
        })
    }

    /// Whether the study varies the parameter elsewhere, so that the fault may have an effect.
    fn varies(&self, component: usize, parameter: usize) -> bool {
        let at = (component, parameter);
        let tolerances = self.realism.iter().flat_map(|realism| realism.tolerances());
        // A relative deviation of zero is zero.
        let mut absolute = tolerances.filter(|tolerance| tolerance.absolute);
        let flown =
            self.flights.iter().flat_map(|flights| flights.varied.drawn.actuator_parameters.keys());
        let mut flown =
            flown.flat_map(|name| self.actuators.iter().map(|actuator| full_name(actuator, name)));
        absolute.any(|tolerance| tolerance.parameters.contains(&at))
            || flown.any(|name| self.system.parameter(&name) == Some(at))
            || self.reactions.change(at)
    }
}
