//! The unknowns of a fit: parameters that vary together, or the intensity of a fault.
//!
//! Every unknown is a number z. For parameters, z counts standard deviations of their tolerance:
//!
//! (FU1)  p = p₀ + z σ  (absolute),  p = p₀ (1 + z σ)  (relative),  |z| ≤ 3
//!
//! and p stays within the range that its component declares. For a fault, z is its intensity.

use crate::ensemble::Variant;
use crate::study::{PlantDraw, Study, Tolerance};
use crate::system::System;
use servotwin_model::program::FaultAt;
use servotwin_model::spec::Unit;

/// Specimens outside this many standard deviations are not delivered.
pub(crate) const TOLERANCE_SIGMAS: f64 = 3.0;
/// The step of differences for a parameter, in standard deviations of its tolerance. It must be large compared with the
/// solver's errors.
const PARAMETER_STEP: f64 = 0.5;
/// The step of differences for the intensity of a fault.
const FAULT_STEP: f64 = 0.05;
/// Prior of an intensity: nearly none, but the equations must have a solution even if the record carries no
/// information.
const FAULT_PRIOR: f64 = 1e-6;

/// One number to be estimated.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    /// Its first parameter, e.g. `actuator_1.servo_valve.width_pa_m`, or the fault.
    pub name: String,
    /// The unit of its first parameter; [`Unit::None`] for a fault.
    pub unit: Unit,
    /// Parameters that vary together: (component, parameter, nominal value). None for a fault.
    pub members: Vec<(usize, usize, f64)>,
    /// One standard deviation of their tolerance, in their unit if it `is_absolute`, or as a fraction of their nominal
    /// values.
    pub sigma: f64,
    /// See above.
    pub is_absolute: bool,
    /// The fault whose intensity it is: (component, fault).
    fault: Option<(usize, usize)>,
    /// The prior information: 1/variance of z.
    pub(super) prior: f64,
    /// The range of z.
    pub range: (f64, f64),
    /// The step of finite differences, in z.
    pub step: f64,
}

impl Unknown {
    /// The unknowns of all tolerances of a study, in the study's order.
    pub fn of_study(study: &Study) -> Vec<Self> {
        let tolerances = study.realism.iter().flat_map(|realism| realism.tolerances());
        tolerances.map(|tolerance| Self::tolerance(&study.system, tolerance)).collect()
    }

    /// The unknown of a tolerance.
    pub(crate) fn tolerance(system: &System, tolerance: &Tolerance) -> Self {
        let components = &system.network().components;
        let member = |&(component, parameter): &(usize, usize)| {
            (component, parameter, components[component].parameters[parameter])
        };
        let members: Vec<_> = tolerance.parameters.iter().map(member).collect();
        let (instance, first) = (&components[members[0].0], members[0].1);
        let mut unknown = Self {
            name: instance.parameter_name(first),
            unit: instance.component.parameters[first].unit,
            members,
            sigma: tolerance.sigma,
            is_absolute: tolerance.absolute,
            fault: None,
            prior: 1.0,
            range: (-TOLERANCE_SIGMAS, TOLERANCE_SIGMAS),
            step: PARAMETER_STEP,
        };
        unknown.range = unknown.declared_range(system);
        unknown
    }

    /// The unknowns of what every plant draws on top of its tolerances (`[flights].draws`), in the study's order.
    /// Parameters that have a tolerance are left out.
    pub fn of_draws(study: &Study) -> Vec<Self> {
        let tolerances = Self::of_study(study);
        let draws = study.flights.iter().flat_map(|flights| &flights.draws);
        let draws = draws.map(|draw| Self::draw(&study.system, draw));
        draws.filter(|draw| !tolerances.iter().any(|own| own.has_any(&draw.places()))).collect()
    }

    /// The unknown of a draw, whose range is that of the draw. Its standard deviation is that of an even distribution:
    /// the width of the range over √12.
    fn draw(system: &System, draw: &PlantDraw) -> Self {
        let [low, high] = draw.range;
        let sigma = (high - low) / 12f64.sqrt();
        let parameter = |(component, name): &(usize, String)| {
            let spec = system.network().components[*component].component;
            (*component, spec.parameter(name).expect("the study checked it"))
        };
        let parameters = draw.parameters.iter().map(parameter).collect();
        let unknown =
            Self::tolerance(system, &Tolerance { parameters, sigma, absolute: !draw.is_factor });
        let nominal = if draw.is_factor { 1.0 } else { 0.0 };
        let [low, high] = draw.range.map(|end| (end - nominal) / sigma);
        let whole = Self { range: (low, high), ..unknown };
        Self { range: whole.declared_range(system), ..whole }
    }

    /// The intensity of a fault, without prior knowledge.
    pub(super) fn fault(system: &System, component: usize, fault: usize) -> Self {
        Self {
            name: system.network().components[component].fault_name(fault),
            unit: Unit::None,
            members: vec![],
            sigma: 1.0,
            is_absolute: true,
            fault: Some((component, fault)),
            prior: FAULT_PRIOR,
            range: (0.0, 1.0),
            step: FAULT_STEP,
        }
    }

    /// Its parameters: (component, parameter).
    fn places(&self) -> Vec<(usize, usize)> {
        self.members.iter().map(|member| (member.0, member.1)).collect()
    }

    /// Whether one of its parameters is among these: (component, parameter).
    pub(crate) fn has_any(&self, places: &[(usize, usize)]) -> bool {
        self.places().iter().any(|own| places.contains(own))
    }

    /// The range of z, limited so that all parameters stay within their declared ranges.
    fn declared_range(&self, system: &System) -> (f64, f64) {
        let (mut low, mut high) = self.range;
        for &(component, parameter, nominal) in &self.members {
            let (min, max) = system.network().components[component].range(parameter);
            let per_sigma = self.per_sigma(nominal);
            if per_sigma != 0.0 {
                let ends = [min, max].map(|end| (end - nominal) / per_sigma);
                low = low.max(ends[0].min(ends[1]));
                high = high.min(ends[0].max(ends[1]));
            }
        }
        (low.min(0.0), high.max(0.0))
    }

    /// One standard deviation in the unit of a parameter with this nominal value; 1 for a fault.
    pub fn per_sigma(&self, nominal: f64) -> f64 {
        if self.is_absolute { self.sigma } else { nominal * self.sigma }
    }

    /// Nominal value of its first parameter; zero for a fault.
    pub fn nominal(&self) -> f64 {
        self.members.first().map_or(0.0, |member| member.2)
    }

    /// The value of its first parameter, or the intensity.
    pub fn value(&self, z: f64) -> f64 {
        self.nominal() + z * self.per_sigma(self.nominal())
    }

    /// The deviation of its first parameter in a list of overrides, in standard deviations of the tolerance; 0 if it is
    /// not in the list.
    pub(crate) fn sigmas(&self, overrides: &[(usize, usize, f64)]) -> f64 {
        let (component, parameter, nominal) = self.members[0];
        let own = overrides.iter().find(|own| (own.0, own.1) == (component, parameter));
        own.map_or(0.0, |own| (own.2 - nominal) / self.per_sigma(nominal))
    }

    /// Adds the unknown to a variant.
    pub(super) fn apply(&self, z: f64, variant: &mut Variant) {
        let moved = self.members.iter().map(|&(component, parameter, nominal)| {
            (component, parameter, nominal + z * self.per_sigma(nominal))
        });
        variant.overrides.extend(moved);
        let fault = self.fault.map(|(component, fault)| FaultAt { component, fault, intensity: z });
        variant.faults.extend(fault);
    }
}
