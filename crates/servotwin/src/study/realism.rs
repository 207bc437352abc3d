//! How reality differs from the twin: noise and quantisation of the sensors, and
//! specimens that differ by their tolerances.

use super::Study;
use super::faults::full_name;
use super::keys::{SEED, SPECIMENS, some};
use super::reader::{Noted, Reader};
use crate::document::Place;
use crate::format::{Value, section};
use crate::signal::random::Random;

section! {
    pub(super) struct Text {
        must seed: u64 = SEED, "seed of noise and specimens";
        #[serde(default)]
        may pub(super) healthy: usize = SPECIMENS, "healthy specimens per case";
        #[serde(default)]
        may tolerances: Vec<ToleranceText>, "the tolerances of the specimens";
    }
}

section! {
    struct ToleranceText {
        must parameters: Vec<String> = some::<Vec<String>>(),
            "parameters that vary together, without the unit";
        must sigma: f64 = Value::Number(0.0, 1.0, ""), "one standard deviation";
        #[serde(default)]
        may absolute: bool, "sigma is in the parameter's unit, not relative to it";
    }
}

impl Text {
    pub(super) fn has_no_tolerances(&self) -> bool {
        self.tolerances.is_empty()
    }
}

/// Parameters that vary together from specimen to specimen.
#[derive(Clone, Debug)]
pub struct Tolerance {
    /// (component, parameter).
    pub parameters: Vec<(usize, usize)>,
    /// One standard deviation.
    pub sigma: f64,
    /// Whether it is in the parameters' unit; otherwise a part of their values.
    pub absolute: bool,
}

/// What the realistic setting adds to the ideal one.
#[derive(Clone, Debug)]
pub struct Realism {
    /// The seed of noise and specimens.
    pub seed: u64,
    /// Fault-free specimens per operating case.
    pub healthy: usize,
    tolerances: Vec<Tolerance>,
}

/// Under which conditions a data set is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Setting {
    /// The plant is the twin with a fault; sensors are perfect. The paper's.
    Ideal,
    /// The plant is the twin with a fault; sensors have noise and quantisation.
    Noise,
    /// Noise, quantisation and tolerances; every specimen has flown a calibration flight, and its twin
    /// is fitted to it.
    Fitted,
    /// Noise and quantisation, and specimens that differ by their tolerances.
    Realistic,
}

/// Which plants are flown, beside which twin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plants {
    /// The twin itself.
    Twin,
    /// Another specimen for every variant, beside the nominal twin.
    Specimens,
    /// Specimens of a pool, each beside the twin that was fitted to it.
    Pool,
}

/// A section of a study that a setting needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section {
    /// Its name.
    pub name: &'static str,
    /// How it may be written, in one line.
    pub example: &'static str,
}

pub(super) const REALISTIC: Section = Section {
    name: "realistic",
    example: "realistic = { seed = 1, healthy = 20, tolerances = [{ parameters = [\"…\"], sigma = 0.03 }] }",
};

const FITTED: Section = Section {
    name: "fitted",
    example: "fitted = { command = \"noise:rms=…,bandwidth=1Hz,seed=9\", duration_s = 30, judge = 24, learn = 24, in_each_case = 6 }",
};

impl Setting {
    /// Every setting, from the kindest to the hardest.
    pub const ALL: [Setting; 4] =
        [Setting::Ideal, Setting::Noise, Setting::Fitted, Setting::Realistic];

    /// The word in file names.
    pub fn name(self) -> &'static str {
        match self {
            Setting::Ideal => "ideal",
            Setting::Noise => "noise",
            Setting::Fitted => "fitted",
            Setting::Realistic => "realistic",
        }
    }

    /// Whether sensors have noise and quantisation.
    pub fn has_noise(self) -> bool {
        self != Setting::Ideal
    }

    /// What is flown beside what.
    pub fn plants(self) -> Plants {
        match self {
            Setting::Ideal | Setting::Noise => Plants::Twin,
            Setting::Fitted => Plants::Pool,
            Setting::Realistic => Plants::Specimens,
        }
    }

    /// Whether specimens differ by their tolerances.
    pub fn has_tolerances(self) -> bool {
        self.plants() != Plants::Twin
    }

    /// Whether it is made without being asked for.
    pub fn is_usual(self) -> bool {
        self != Setting::Fitted
    }

    /// Whether a study says all that it needs.
    pub fn is_possible(self, study: &Study) -> bool {
        self.lacks(study).is_empty()
    }

    /// The sections that it needs and a study does not have.
    pub fn lacks(self, study: &Study) -> Vec<Section> {
        let needed = [
            (REALISTIC, self.has_noise() && study.realism.is_none()),
            (FITTED, self.plants() == Plants::Pool && study.calibration.is_none()),
        ];
        needed.into_iter().filter(|(_, lacks)| *lacks).map(|(section, _)| section).collect()
    }

    /// The settings of a study that a choice allows, in groups whose variants are the same
    /// simulations.
    pub fn groups(study: &Study, choice: impl Fn(Setting) -> bool) -> Vec<Vec<Setting>> {
        let wanted = |setting: &Setting| setting.is_possible(study) && choice(*setting);
        let wanted: Vec<Setting> = Setting::ALL.into_iter().filter(wanted).collect();
        let groups = wanted.chunk_by(|a, b| a.plants() == b.plants());
        groups.map(<[Setting]>::to_vec).collect()
    }
}

/// What a data set is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// The operating cases on which a diagnosis is judged.
    Judged,
    /// Other commands, from which it learns.
    Training,
}

impl Role {
    /// Both.
    pub const ALL: [Role; 2] = [Role::Judged, Role::Training];

    /// What it adds to file names.
    pub fn suffix(self) -> &'static str {
        match self {
            Role::Judged => "",
            Role::Training => "-training",
        }
    }
}

/// What specimens are made for: each lot has its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lot {
    /// Records of the cases that are judged.
    Judged,
    /// Records of training commands.
    Training,
    /// Flights to learn from.
    FlightsLearned,
    /// Flights to be judged in.
    FlightsJudged,
    /// The pool of the fitted setting whose records are judged.
    PoolJudged,
    /// The pool that flies training commands.
    PoolTraining,
    /// Calibration flights of the actuators whose flights are flown in the fitted setting; the last lot that random
    /// numbers have room for.
    FlightsCalibrated,
}

impl Lot {
    /// The pool of the fitted setting.
    pub fn pool(role: Role) -> Self {
        match role {
            Role::Judged => Lot::PoolJudged,
            Role::Training => Lot::PoolTraining,
        }
    }
}

impl From<Role> for Lot {
    fn from(role: Role) -> Self {
        match role {
            Role::Judged => Lot::Judged,
            Role::Training => Lot::Training,
        }
    }
}

impl Realism {
    pub(super) fn new(text: &Text, reader: &Reader) -> Result<Self, Noted> {
        let mut tolerances = Vec::new();
        for (position, tolerance) in text.tolerances.iter().enumerate() {
            let at = Place::of(&["realistic", "tolerances"]).element(position).key("parameters");
            let sigma = tolerance.sigma;
            for unit in &reader.text.units {
                let names = tolerance.parameters.iter().enumerate();
                let found = names.map(|(n, name)| find(reader, &at.element(n), unit, name));
                tolerances.push(Tolerance {
                    parameters: reader.sound(found),
                    sigma,
                    absolute: tolerance.absolute,
                });
            }
        }
        Ok(Self { seed: text.seed, healthy: text.healthy, tolerances })
    }

    /// The parameters of one specimen: (component, parameter, value), inside
    /// the ranges that are allowed for them.
    pub fn specimen(&self, study: &Study, lot: Lot, variant: usize) -> Vec<(usize, usize, f64)> {
        let mut random = Random::new(mix(self.seed, variant, 1 + 2 * lot as u64));
        let components = &study.system.network().components;
        let mut values = Vec::new();
        for tolerance in &self.tolerances {
            // A specimen outside its tolerance is not delivered.
            let deviation = random.normal().clamp(-3.0, 3.0) * tolerance.sigma;
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

    /// Every tolerance of every unit, in the order of the file.
    pub fn tolerances(&self) -> &[Tolerance] {
        &self.tolerances
    }

    /// The random numbers of one variant's sensors.
    pub(crate) fn noise(&self, lot: Lot, variant: usize) -> Random {
        Random::new(mix(self.seed, variant, 2 + 2 * lot as u64))
    }

    /// One of several things for a variant, drawn evenly.
    pub(super) fn dealt(&self, variant: usize, count: usize) -> usize {
        let draw = Random::new(mix(self.seed, variant, DEALING)).unit();
        ((draw * count as f64) as usize).min(count - 1)
    }

    /// A text that two equal ways to differ from the twin have in common.
    pub(crate) fn canonical(&self) -> String {
        format!("{self:?}")
    }
}

/// The purpose of random numbers that deal; those of lots are below.
const DEALING: u64 = 15;

/// A seed for each variant and purpose.
fn mix(seed: u64, variant: usize, purpose: u64) -> u64 {
    seed ^ (variant as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (purpose << 60)
}

/// The component and the parameter of a name at a place.
pub(super) fn find(
    reader: &Reader,
    at: &Place,
    unit: &str,
    name: &str,
) -> Result<(usize, usize), Noted> {
    let id = full_name(unit, name);
    reader.system.parameter(&id).ok_or_else(|| {
        if reader.system.parameter(name).is_some() {
            return reader.shared(at, "parameter", unit, name);
        }
        let all = reader.system.all_parameters();
        reader.unknown(at, "parameter in the system", &id, all.iter().map(String::as_str))
    })
}
