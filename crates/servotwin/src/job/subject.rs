//! What is diagnosed: a data set, with or without the extra sensor.

use crate::evaluation::data_set::Lessons;
use crate::evaluation::protocol::{Holding, Protocol};
use crate::evaluation::{self, Settings};
use crate::study::{Plants, Setting, Study};
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
    /// With noise, quantisation and tolerances, beside twins that are fitted to their specimens.
    Fitted,
    /// With noise, quantisation and tolerances.
    Realistic,
    /// As realistic, with a sensor more.
    ExtraSensor,
}

impl Subject {
    /// Every subject, in the order of reports.
    pub const ALL: [Subject; 5] =
        [Subject::Ideal, Subject::Noise, Subject::Fitted, Subject::Realistic, Subject::ExtraSensor];

    /// The word in file names.
    pub fn name(self) -> &'static str {
        match self {
            Subject::ExtraSensor => "extra_sensor",
            subject => subject.setting().name(),
        }
    }

    /// What it is, for people.
    pub fn title(self, study: &Study) -> String {
        let extra = || study.extra_sensor.as_deref().unwrap_or("an extra sensor");
        match self {
            Subject::ExtraSensor => format!("{}, {}", self.setting().name(), extra()),
            subject => subject.name().into(),
        }
    }

    /// The data set that it reads.
    pub fn setting(self) -> Setting {
        match self {
            Subject::Ideal => Setting::Ideal,
            Subject::Noise => Setting::Noise,
            Subject::Fitted => Setting::Fitted,
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
    /// bands do. Trees are as deep as the paper's; where specimens differ from their twins they need two
    /// questions more, and three where bands are as narrow as noise allows, so that weaker faults are
    /// diagnosed. There every healthy specimen nearly leaves them, and only those that do teach. Depth,
    /// criterion and lessons were chosen on training commands left out of training (`job::tests`).
    pub fn settings(self) -> Settings {
        let defaults = Settings::default();
        let settings = Settings {
            training: match self.setting().plants() {
                Plants::Specimens => evaluation::trees(Criterion::Gini, 9),
                Plants::Pool => evaluation::trees(Criterion::Entropy, 10),
                Plants::Twin => defaults.training,
            },
            holding: match self.setting().plants() {
                Plants::Pool => {
                    let lessons = Lessons { healthy: 1.0, ..defaults.holding.lessons };
                    Holding { lessons, ..defaults.holding }
                }
                _ => defaults.holding,
            },
            learned_bands: self.setting().has_tolerances(),
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
