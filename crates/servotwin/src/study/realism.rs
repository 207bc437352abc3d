//! Differences between reality and the twin: noise and quantization of the sensors, and
//! specimens that differ by their tolerances.

use super::faults::full_name;
use super::keys::{SPECIMENS, some};
use super::reader::{Noted, Reader};
use super::{Seed, Stream, Study};
use crate::format::{At, Value, section, words};
use servotwin_model::hash::{Canonical, Fingerprint};

section! {
    pub(super) struct Text {
        may pub(super) healthy: usize = SPECIMENS, "number of healthy specimens in each case";
        may pub(super) tolerances: Vec<ToleranceText>, "tolerances of the specimens";
    }
}

section! {
    pub(super) struct ToleranceText {
        must pub(super) parameters: Vec<At<String>> = some::<Vec<At<String>>>(),
            "parameters that vary together, without the name of the actuator";
        must sigma: f64 = Value::Number(0.0, 1.0, ""),
            "standard deviation, relative to the value unless `absolute`";
        may absolute: bool, "true: sigma is in the parameter's unit";
    }
}

/// Parameters that share one random deviation in each specimen.
#[derive(Clone, Debug)]
pub(crate) struct Tolerance {
    /// Indices (component, parameter).
    pub(crate) parameters: Vec<(usize, usize)>,
    /// One standard deviation.
    pub(crate) sigma: f64,
    /// Whether `sigma` is in the parameters' unit, rather than a share of their values.
    pub(crate) absolute: bool,
}

/// The differences that the realistic scenario adds to the ideal one.
#[derive(Clone, Debug)]
pub struct Realism {
    /// The number of fault-free specimens in each operating case.
    pub healthy: usize,
    tolerances: Vec<Tolerance>,
}

/// The scenario of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scenario {
    /// The plant equals the twin apart from its fault, and sensors are perfect; the seed paper's scenario.
    Ideal,
    /// The plant equals the twin apart from its fault; sensors have noise and quantization.
    Noise,
    /// Noise, quantization and tolerances. Every specimen has flown a calibration flight, and its twin
    /// is fitted to that record.
    Fitted,
    /// Noise, quantization and tolerances; the twin has nominal parameters.
    Realistic,
}

words!(Scenario, Scenario::ALL.into_iter().map(|scenario| (scenario.name(), scenario)));

/// The plants in a scenario, and their twins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Plants {
    /// The plant equals the twin.
    Twin,
    /// A new specimen for every variant, with the nominal twin.
    Specimens,
    /// Specimens from a pool, each with the twin that was fitted to it.
    Pool,
}

/// A section of a study file that a scenario needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section {
    /// The name of the section.
    pub(crate) name: &'static str,
    /// An example of the section in one line.
    pub(crate) example: &'static str,
}

pub(super) const REALISTIC: Section = Section {
    name: "realistic",
    example: "realistic = { healthy = 20, tolerances = [{ parameters = [\"…\"], sigma = 0.03 }] }",
};

const FITTED: Section = Section {
    name: "fitted",
    example: "fitted = { command = \"noise:rms=…,bandwidth=1Hz,seed=9\", duration_s = 30, judge = 24, learn = 24, in_each_case = 6 }",
};

impl Scenario {
    /// Every scenario, from the easiest to the hardest.
    pub const ALL: [Scenario; 4] =
        [Scenario::Ideal, Scenario::Noise, Scenario::Fitted, Scenario::Realistic];

    /// The scenario with a name.
    pub fn named(name: &str) -> Option<Self> {
        Scenario::ALL.into_iter().find(|scenario| scenario.name() == name)
    }

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Scenario::Ideal => "ideal",
            Scenario::Noise => "noise",
            Scenario::Fitted => "fitted",
            Scenario::Realistic => "realistic",
        }
    }

    /// Whether sensors have noise and quantization.
    pub(crate) fn has_noise(self) -> bool {
        self != Scenario::Ideal
    }

    /// The scenario's plants and twins.
    pub(crate) fn plants(self) -> Plants {
        match self {
            Scenario::Ideal | Scenario::Noise => Plants::Twin,
            Scenario::Fitted => Plants::Pool,
            Scenario::Realistic => Plants::Specimens,
        }
    }

    /// Whether specimens differ by their tolerances.
    pub fn has_tolerances(self) -> bool {
        self.plants() != Plants::Twin
    }

    /// Whether the scenario is made by default.
    pub fn is_usual(self) -> bool {
        self != Scenario::Fitted
    }

    /// Whether a study has everything that the scenario needs.
    pub fn is_possible(self, study: &Study) -> bool {
        self.lacks(study).is_empty()
    }

    /// The sections that the scenario needs and the study lacks.
    pub(crate) fn lacks(self, study: &Study) -> Vec<Section> {
        let needed = [
            (REALISTIC, self.has_noise() && study.realism.is_none()),
            (FITTED, self.plants() == Plants::Pool && study.calibration.is_none()),
        ];
        needed.into_iter().filter(|(_, lacks)| *lacks).map(|(section, _)| section).collect()
    }

    /// The scenarios of a study that `choice` accepts. Scenarios in a group share their
    /// simulations.
    pub fn groups(study: &Study, choice: impl Fn(Scenario) -> bool) -> Vec<Vec<Scenario>> {
        let wanted = |scenario: &Scenario| scenario.is_possible(study) && choice(*scenario);
        let wanted: Vec<Scenario> = Scenario::ALL.into_iter().filter(wanted).collect();
        let groups = wanted.chunk_by(|a, b| a.plants() == b.plants());
        groups.map(<[Scenario]>::to_vec).collect()
    }
}

impl Realism {
    pub(super) fn new(text: &Text, reader: &Reader) -> Self {
        let mut tolerances = Vec::new();
        for ToleranceText { parameters, sigma, absolute } in &text.tolerances {
            for actuator in &reader.text.actuators {
                let found = parameters.iter().map(|name| find(reader, actuator, name));
                let parameters = reader.sound(found);
                tolerances.push(Tolerance { parameters, sigma: *sigma, absolute: *absolute });
            }
        }
        Self { healthy: text.healthy, tolerances }
    }

    /// The parameters of a specimen, as (component, parameter, value) within the allowed ranges. Its deviations are
    /// `scatter` times as large as declared.
    pub(crate) fn specimen(
        &self,
        study: &Study,
        seed: Seed,
        scatter: f64,
    ) -> Vec<(usize, usize, f64)> {
        let mut random = seed.stream(Stream::Tolerances);
        let deviations: Vec<f64> = self.tolerances.iter().map(|_| random.normal()).collect();
        self.specimen_with(study, &deviations, scatter)
    }

    /// The parameters of a specimen with these deviations, one for each tolerance, in standard deviations.
    pub(crate) fn specimen_with(
        &self,
        study: &Study,
        deviations: &[f64],
        scatter: f64,
    ) -> Vec<(usize, usize, f64)> {
        let components = &study.system.network().components;
        let mut values = Vec::new();
        for (tolerance, deviation) in self.tolerances.iter().zip(deviations) {
            // A specimen beyond three standard deviations would not be delivered.
            let deviation =
                deviation.clamp(-MAX_DEVIATION, MAX_DEVIATION) * scatter * tolerance.sigma;
            for &(component, parameter) in &tolerance.parameters {
                let instance = &components[component];
                let (min, max) = instance.range(parameter);
                let nominal = instance.parameters[parameter];
                let value = match tolerance.absolute {
                    true => nominal + deviation,
                    false => nominal * (1.0 + deviation),
                };
                values.push((component, parameter, value.clamp(min, max)));
            }
        }
        values
    }

    /// Every tolerance of every actuator, in the order of the file.
    pub(crate) fn tolerances(&self) -> &[Tolerance] {
        &self.tolerances
    }
}

impl Canonical for Realism {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        let Realism { healthy, tolerances } = self;
        fingerprint.add(healthy).add(tolerances);
    }
}

impl Canonical for Tolerance {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        let Tolerance { parameters, sigma, absolute } = self;
        fingerprint.add(parameters).add(sigma).add(absolute);
    }
}

/// The largest deviation of a specimen, in standard deviations.
pub(crate) const MAX_DEVIATION: f64 = 3.0;

/// Finds the component and parameter indices of a name.
pub(super) fn find(
    reader: &Reader,
    actuator: &str,
    name: &At<String>,
) -> Result<(usize, usize), Noted> {
    let id = full_name(actuator, name);
    reader.system.parameter(&id).ok_or_else(|| {
        if reader.system.parameter(name).is_some() {
            return reader.shared("parameter", actuator, name);
        }
        let all = reader.system.all_parameters();
        let known = all.iter().map(String::as_str);
        reader.unknown(&name.at, ("parameter in the system", &id), known)
    })
}
