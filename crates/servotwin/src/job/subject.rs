//! What is diagnosed: a data set, with or without the extra sensor.

use crate::evaluation::{DataSet, Settings};
use crate::study::{Setting, Study};
use serde::{Deserialize, Serialize};

/// A data set, and whether the extra sensor is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subject {
    /// Perfect sensors, a plant that is the twin with a fault: the paper's.
    Ideal,
    /// With noise, quantisation and tolerances.
    Realistic,
    /// As ideal, with a sensor more.
    ExtraSensor,
}

impl Subject {
    /// Every subject, in the order of reports.
    pub const ALL: [Subject; 3] = [Subject::Ideal, Subject::Realistic, Subject::ExtraSensor];

    /// The word in file names.
    pub fn name(self) -> &'static str {
        match self {
            Subject::Ideal => "ideal",
            Subject::Realistic => "realistic",
            Subject::ExtraSensor => "extra_sensor",
        }
    }

    /// What it is, for people.
    pub fn title(self, study: &Study) -> String {
        let extra = || study.extra_sensor.as_deref().unwrap_or("an extra sensor");
        match self {
            Subject::Ideal => "ideal".into(),
            Subject::Realistic => "realistic".into(),
            Subject::ExtraSensor => format!("ideal, {}", extra()),
        }
    }

    /// The data set that it reads.
    pub fn setting(self) -> Setting {
        match self {
            Subject::Ideal | Subject::ExtraSensor => Setting::Ideal,
            Subject::Realistic => Setting::Realistic,
        }
    }

    /// Whether the extra sensor is used.
    pub fn extra_sensor(self) -> bool {
        self == Subject::ExtraSensor
    }

    /// How it is evaluated: parts are taken away, and other classifiers compared, only where the
    /// paper's sensors are used. No tree asks what a sensor could not resolve.
    pub fn settings(self, data: &DataSet) -> Settings {
        let mut settings = Settings::default();
        settings.training.resolutions = data.resolutions(settings.residual_error);
        match self.extra_sensor() {
            true => Settings { classifiers: vec![], ablation: false, ..settings },
            false => settings,
        }
    }
}
