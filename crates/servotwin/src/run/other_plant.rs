//! Plants that differ from their twin in structure: a system of its own, whose specimens are named as those of the
//! twin's system and mapped to it by name.

use super::RunError;
use crate::compiled::Compiled;
use crate::ensemble::{Later, Variant};
use crate::study::other_plant::apply_draws;
use crate::study::{OtherPlant, Seed, Stream, Study, Suite};
use crate::system::System;
use servotwin_model::components;
use servotwin_model::network::Instance;
use servotwin_model::program::FaultAt;

/// The plants of a study's section `[flights.other_plant]`.
pub struct OtherPlants {
    /// The plants' system: the twin's, with components of other kinds at the same positions.
    pub(crate) system: System,
    differences: OtherPlant,
    period_s: f64,
}

impl OtherPlants {
    /// The plants of a suite; `None` if they have the structure of their twins.
    ///
    /// # Errors
    /// As `OtherPlants::new`.
    pub fn of(study: &Study, suite: &Suite) -> Result<Option<Self>, RunError> {
        let differences = study.flights.as_ref().and_then(|flights| flights.other_plant.as_ref());
        let differences = differences.filter(|_| suite.has_other_plants);
        differences.map(|differences| OtherPlants::new(study, differences)).transpose()
    }

    /// Compiles the plants' system.
    ///
    /// # Errors
    /// The system is impossible with its other kinds.
    pub(crate) fn new(study: &Study, differences: &OtherPlant) -> Result<Self, RunError> {
        let mut network = study.system.network().clone();
        for &(place, kind) in &differences.kinds {
            let other = components::find(kind).expect("the study checked it");
            network.components[place] = stand_in(&network.components[place], other);
        }
        let program = network.compile().map_err(|_| RunError::OtherPlant)?;
        let system = System {
            name: study.system.name.clone(),
            title: study.system.title.clone(),
            program,
            sensors: study.system.sensors.clone(),
            reservoirs: study.system.reservoirs.clone(),
            text: study.system.text.clone(),
            compiled: Compiled::default(),
        };
        let differences = differences.clone();
        Ok(Self { system, differences, period_s: study.sample_period_s })
    }

    /// Changes a variant of the twin's system to one of these plants, with the draws of a specimen.
    pub(super) fn alter(&self, study: &Study, seed: Seed, variant: &mut Variant) {
        let twins = &study.system.network().components;
        let parts = &self.system.network().components;
        // A parameter that the other kind lacks has no counterpart in the plant.
        let value = |&(place, parameter, value): &(usize, usize, f64)| {
            let name = twins[place].component.parameters[parameter].name;
            Some((place, parts[place].component.parameter(name)?, value))
        };
        let fault = |fault: &FaultAt| {
            let name = twins[fault.component].component.faults[fault.fault].name;
            let other = parts[fault.component].component.fault(name);
            FaultAt { fault: other.expect("the study checked it"), ..*fault }
        };
        variant.overrides = variant.overrides.iter().filter_map(value).collect();
        variant.faults = variant.faults.iter().map(fault).collect();
        let later = variant.later.iter().map(|later| Later {
            time_s: later.time_s,
            faults: later.faults.iter().map(fault).collect(),
            overrides: later.overrides.iter().filter_map(value).collect(),
        });
        variant.later = later.collect();
        let mut random = seed.stream(Stream::OtherPlant);
        apply_draws(&self.differences.draws, 1.0, parts, &mut random, &mut variant.overrides);
    }

    /// The latency of each sensor of a specimen, in samples.
    pub(super) fn latencies(&self, seed: Seed, sensors: usize) -> Vec<f64> {
        let mut random = seed.stream(Stream::OtherPlant);
        // The first numbers belong to the parameters.
        self.differences.draws.iter().for_each(|_| {
            random.unit();
        });
        let [low, high] = self.differences.latency_s;
        (0..sensors).map(|_| (low + (high - low) * random.unit()) / self.period_s).collect()
    }
}

/// A component of another kind with the values of the component that it stands for.
fn stand_in(own: &Instance, other: &'static components::Component) -> Instance {
    let (own_spec, spec) = (own.component, other);
    let mut instance = Instance::new(own.id.clone(), other);
    for (place, parameter) in spec.parameters.iter().enumerate() {
        if let Some(known) = own_spec.parameter(parameter.name) {
            instance.parameters[place] = own.parameters[known];
        }
    }
    for (place, fault) in spec.faults.iter().enumerate() {
        if let Some(known) = own_spec.fault(fault.name) {
            instance.fault_full[place] = own.fault_full[known];
        }
    }
    instance.fluid = own.fluid.clone();
    instance
}
