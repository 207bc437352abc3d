//! What is no mistake in a study, but hardly what was meant.

use super::Study;
use super::faults::full_name;
use crate::document::{Collector, Located, Quantity};
use servotwin_model::spec::Unit;
use std::collections::BTreeSet;
use std::fmt;

/// What is hardly meant.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// A fault that changes nothing: its law leaves the parameter as it is, such as a factor one of zero.
    InertFault {
        /// The fault's full name.
        fault: String,
        /// The component on which it acts.
        component: String,
        /// The parameter that it shall change.
        parameter: &'static str,
        /// Its value, healthy and at every intensity.
        value: f64,
        /// The unit.
        unit: Unit,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Warning::InertFault { fault, component, parameter, value, unit } = self;
        let value = Quantity(*value, unit.symbol());
        write!(
            out,
            "the fault '{fault}' changes nothing: '{parameter}' of '{component}' stays {value} at every intensity"
        )
    }
}

impl Study {
    /// What is hardly meant, with its places in the file.
    pub fn warnings(&self) -> Vec<Located<Warning>> {
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
        found.locate(&self.text)
    }

    /// The same, one line for each: path, line, column and what it is.
    pub fn warnings_in_words(&self) -> Vec<String> {
        let line = |Located { line, column, mistake, .. }: Located<Warning>| {
            format!("{}:{line}:{column}: {mistake}", self.path)
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

    /// Whether something in the study gives a parameter another value, on which a fault may act.
    fn varies(&self, component: usize, parameter: usize) -> bool {
        let at = (component, parameter);
        let tolerances = self.realism.iter().flat_map(|realism| realism.tolerances());
        // A part of zero is zero.
        let mut absolute = tolerances.filter(|tolerance| tolerance.absolute);
        let flown = self.parsed.flights.iter().flat_map(|text| text.varied_parameters());
        let mut flown = flown.flat_map(|name| self.units.iter().map(|unit| full_name(unit, name)));
        absolute.any(|tolerance| tolerance.parameters.contains(&at))
            || flown.any(|name| self.system.parameter(&name) == Some(at))
            || self.reactions.change(at)
    }
}
