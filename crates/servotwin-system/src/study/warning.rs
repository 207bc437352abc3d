//! Warnings about valid but probably unintended entries of a study.

use super::faults::full_name;
use super::reader::Reader;
use super::{Study, training};
use crate::document::{Collector, Diagnostic, Explained, NumberWithUnit, Quantities};
use crate::signal::{Argument, Signal, Sort};
use servotwin_model::spec::Unit;
use std::collections::BTreeSet;
use std::fmt;

/// A valid but probably unintended entry.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// A fault that changes nothing, because its law leaves the parameter as it is, e.g. a factor of one.
    InertFault {
        /// The fault's full name.
        fault: String,
        /// The component on which it acts.
        component: String,
        /// The parameter that it should change.
        parameter: &'static str,
        /// The parameter's value, healthy and at every intensity, SI.
        value: f64,
        /// The parameter's unit.
        unit: Unit,
    },
    /// A range of draws that exceeds the range of its input. Short flights or few draws may still keep the input
    /// within its range.
    BeyondInput {
        /// The parameter of the signal.
        parameter: &'static str,
        /// The value in the range of draws that exceeds the input's range.
        value: f64,
        /// The name of the input.
        input: String,
        /// The input's minimum.
        min: f64,
        /// The input's maximum.
        max: f64,
        /// The unit of all three values.
        unit: Unit,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Warning::InertFault { fault, component, parameter, value, unit } => {
                let value = NumberWithUnit(*value, unit.symbol());
                write!(
                    out,
                    "the fault '{fault}' changes nothing: '{parameter}' of '{component}' stays {value} at every intensity"
                )
            }
            Warning::BeyondInput { parameter, value, input, min, max, unit } => {
                let (value, unit) = (NumberWithUnit(*value, unit.symbol()), unit.symbol());
                let range = Quantities(*min, *max, unit);
                write!(
                    out,
                    "'{parameter}' is drawn up to {value}, but '{input}' may only become {range}"
                )
            }
        }
    }
}

impl Explained for Warning {}

impl Study {
    /// Lists valid but probably unintended entries with their places in the file.
    pub fn warnings(&self) -> Vec<Diagnostic> {
        let reader = self.reader();
        let mut found = Collector::new();
        let mut told = BTreeSet::new();
        for case in &self.faults {
            if told.insert((case.at.component, case.at.fault))
                && let Some(warning) = self.inert(case.at.component, case.at.fault)
            {
                found.note(&reader.place_of_fault(case), warning);
            }
        }
        self.beyond_input(&reader, &mut found);
        found.locate(&self.text)
    }

    /// Notes draws that would leave the range of their input in a long enough flight.
    fn beyond_input(&self, reader: &Reader, found: &mut Collector<Warning>) {
        let (training, flights) = (self.parsed.training.iter(), self.flights.iter());
        let draws = training.flat_map(|text| text.patterns());
        let flown = flights.flat_map(|flights| flights.varied.patterns());
        for (at, pattern) in draws.chain(flown) {
            let at_end = |end: f64| training::filled_at(pattern, 1, |_| end).parse().ok();
            let signals = [0.0, 1.0].into_iter().filter_map(at_end);
            for warning in signals.flat_map(|signal: Signal| self.larger_than_input(&signal)) {
                found.note(&reader.span(&at), warning);
            }
        }
    }

    /// The values of a signal whose magnitude exceeds the range of the driven input.
    fn larger_than_input(&self, signal: &Signal) -> Vec<Warning> {
        let input = &self.system.network().inputs[self.command_input];
        let (min, max) = self.system.network().input_range(self.command_input);
        let given = signal.terms().iter().flat_map(|term| {
            let spec = term.kind().spec();
            let is_value = |name| {
                let declared = spec.parameter(name).map(|place| &spec.parameters[place]);
                declared.is_some_and(|declared| declared.sort == Sort::Value)
            };
            term.arguments().filter(move |(name, _)| is_value(name))
        });
        let larger = given.filter_map(|(parameter, argument)| match argument {
            Argument::Quantity(given) if given.si().abs() > min.abs().max(max.abs()) => {
                let (value, input, unit) = (given.si(), input.id.clone(), input.unit);
                Some(Warning::BeyondInput { parameter, value, input, min, max, unit })
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

    fn inert(&self, component: usize, fault: usize) -> Option<Warning> {
        let instance = &self.system.network().components[component];
        let spec = instance.component.spec();
        let declared = &spec.faults[fault];
        let place = spec.parameter(declared.parameter)?;
        let value = instance.parameters[place];
        let is_inert = declared.law.apply(value, 1.0, instance.fault_full[fault]) == value;
        (is_inert && !self.varies(component, place)).then(|| Warning::InertFault {
            fault: format!("{}.{}", instance.id, declared.name),
            component: instance.id.clone(),
            parameter: declared.parameter,
            value,
            unit: spec.parameters[place].unit,
        })
    }

    /// Whether the study varies the parameter elsewhere, so that the fault may have an effect.
    fn varies(&self, component: usize, parameter: usize) -> bool {
        let at = (component, parameter);
        let tolerances = self.realism.iter().flat_map(|realism| realism.tolerances());
        // A relative deviation of zero is zero.
        let mut absolute = tolerances.filter(|tolerance| tolerance.absolute);
        let flown = self.flights.iter().flat_map(|flights| flights.varied.parameters());
        let mut flown = flown.flat_map(|name| self.units.iter().map(|unit| full_name(unit, name)));
        absolute.any(|tolerance| tolerance.parameters.contains(&at))
            || flown.any(|name| self.system.parameter(&name) == Some(at))
            || self.reactions.change(at)
    }
}
