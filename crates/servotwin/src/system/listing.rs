//! Lists the names of a system, and every fault of its components as a list and a table.

use super::System;
use crate::nearest::UnknownName;
use crate::table::{Column, Table};
use servotwin_model::network::Instance;
use servotwin_model::program::FaultAt;
use servotwin_model::spec::Unit;

/// A fault that a component of a system can have.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedFault {
    /// The id, e.g. `actuator_1.servo_valve.clogging_pa`.
    pub id: String,
    /// The id of the component.
    pub component: String,
    /// The component's kind.
    pub kind: &'static str,
    /// The category of the fault.
    pub category: &'static str,
    /// The parameter that it changes.
    pub parameter: &'static str,
    /// The unit of `healthy` and `full`.
    pub unit: Unit,
    /// The parameter's value without the fault.
    pub healthy: f64,
    /// Its value at intensity 1.
    pub full: f64,
    /// A one-line description.
    pub summary: &'static str,
}

impl System {
    /// All faults, in the order of components.
    pub fn fault_list(&self) -> Vec<ListedFault> {
        let mut list = Vec::new();
        let healthy = self.program.parameters(&[]);
        for (component, instance) in self.network().components.iter().enumerate() {
            let spec = instance.component;
            for (fault, declared) in spec.faults.iter().enumerate() {
                let place = spec.parameter(declared.parameter).expect("checked by the contract");
                let full = self.program.parameters(&[FaultAt { component, fault, intensity: 1.0 }]);
                list.push(ListedFault {
                    id: instance.fault_name(fault),
                    component: instance.id.clone(),
                    kind: spec.kind,
                    category: declared.category.name(),
                    parameter: declared.parameter,
                    unit: spec.parameters[place].unit,
                    healthy: healthy[component][place],
                    full: full[component][place],
                    summary: declared.summary,
                });
            }
        }
        list
    }

    /// The full names of all faults.
    pub fn all_faults(&self) -> Vec<String> {
        self.network().components.iter().flat_map(Instance::fault_names).collect()
    }

    /// A fault by its id, e.g. `actuator_1.servo_valve.clogging_pa`: (component, fault).
    ///
    /// # Errors
    /// The system has no such fault.
    pub fn find_fault(&self, id: &str) -> Result<(usize, usize), UnknownName> {
        let known = || self.all_faults();
        let found = self.program.find_fault(id);
        found.ok_or_else(|| UnknownName { what: "fault", given: id.into(), known: known() })
    }

    /// The index of an input.
    ///
    /// # Errors
    /// The system has no such input.
    pub fn find_input(&self, id: &str) -> Result<usize, UnknownName> {
        let inputs = &self.network().inputs;
        let known = || inputs.iter().map(|input| input.id.clone()).collect();
        let found = inputs.iter().position(|input| input.id == id);
        found.ok_or_else(|| UnknownName { what: "input", given: id.into(), known: known() })
    }

    /// A parameter by its id, e.g. `actuator_1.cylinder.area_a_m2`: (component, parameter).
    ///
    /// # Errors
    /// The system has no such parameter.
    pub fn find_parameter(&self, id: &str) -> Result<(usize, usize), UnknownName> {
        let known = || self.all_parameters();
        let found = self.parameter(id);
        found.ok_or_else(|| UnknownName { what: "parameter", given: id.into(), known: known() })
    }
}

/// A list of faults as a table.
pub fn fault_table(list: &[ListedFault]) -> Table {
    let columns = vec![
        Column::of("id", "", list, |fault| fault.id.clone()),
        Column::of("component", "", list, |fault| fault.component.clone()),
        Column::of("kind", "", list, |fault| fault.kind.to_owned()),
        Column::of("category", "", list, |fault| fault.category.to_owned()),
        Column::of("parameter", "", list, |fault| fault.parameter.to_owned()),
        Column::of("unit", "", list, |fault| fault.unit.symbol().to_owned()),
        Column::of("healthy", "", list, |fault| fault.healthy),
        Column::of("at_intensity_1", "", list, |fault| fault.full),
        Column::of("summary", "", list, |fault| fault.summary.to_owned()),
    ];
    Table::from_columns(columns).expect("names are different and columns of one length")
}
