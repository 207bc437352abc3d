//! What is diagnosed: a data set, with or without the extra sensor.

use crate::evaluation::protocol::Protocol;
use crate::evaluation::{self, Settings};
use crate::study::{Setting, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::tree::Criterion;

/// A data set, and whether the extra sensor is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subject {
    /// Perfect sensors, a plant that is the twin with a fault: the paper's.
    Ideal,
    /// With noise and quantisation of the sensors.
    Noise,
    /// With noise, quantisation and tolerances.
    Realistic,
    /// As realistic, with a sensor more.
    ExtraSensor,
}

impl Subject {
    /// Every subject, in the order of reports.
    pub const ALL: [Subject; 4] =
        [Subject::Ideal, Subject::Noise, Subject::Realistic, Subject::ExtraSensor];

    /// The word in file names.
    pub fn name(self) -> &'static str {
        match self {
            Subject::Ideal => "ideal",
            Subject::Noise => "noise",
            Subject::Realistic => "realistic",
            Subject::ExtraSensor => "extra_sensor",
        }
    }

    /// What it is, for people.
    pub fn title(self, study: &Study) -> String {
        let extra = || study.extra_sensor.as_deref().unwrap_or("an extra sensor");
        match self {
            Subject::Ideal => "ideal".into(),
            Subject::Noise => "noise".into(),
            Subject::Realistic => "realistic".into(),
            Subject::ExtraSensor => format!("realistic, {}", extra()),
        }
    }

    /// The data set that it reads.
    pub fn setting(self) -> Setting {
        match self {
            Subject::Ideal => Setting::Ideal,
            Subject::Noise => Setting::Noise,
            Subject::Realistic | Subject::ExtraSensor => Setting::Realistic,
        }
    }

    /// Whether the extra sensor is used.
    pub fn extra_sensor(self) -> bool {
        self == Subject::ExtraSensor
    }

    /// How it is evaluated. Classifiers are compared where the paper compared them, parts are taken
    /// away where it is hardest to do without. The paper's band of 3 % judges perfect specimens, with
    /// and without noise; where specimens differ it would alarm one healthy one in eight, and learned
    /// bands do. Trees are as deep as the paper's; where specimens differ they need two questions more.
    /// Depth and criterion were chosen on training commands left out of training.
    pub fn settings(self) -> Settings {
        let defaults = Settings::default();
        let has_tolerances = self.setting().has_tolerances();
        let settings = Settings {
            training: match has_tolerances {
                true => evaluation::trees(Criterion::Gini, 9),
                false => defaults.training,
            },
            learned_bands: has_tolerances,
            ablation: self == Subject::Realistic,
            ..defaults
        };
        match self {
            Subject::Ideal => settings,
            Subject::ExtraSensor => Settings {
                classifiers: vec![],
                protocols: vec![Protocol::Grouped, Protocol::NewCommand],
                committee_protocols: vec![Protocol::NewCommand],
                ..settings
            },
            _ => Settings { classifiers: vec![], ..settings },
        }
    }
}
