//! The subject of a diagnosis: a data set, with or without the extra sensor.

use crate::learn::data_set::TrainingFilter;
use crate::learn::protocol::{Holding, Protocol};
use crate::learn::{self, EvaluationSettings};
use crate::study::{Plants, Scenario, Study};
use serde::{Deserialize, Serialize};
use servotwin_learning::tree::Criterion;

/// A data set, and whether the extra sensor is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subject {
    /// Perfect sensors, and a plant that equals the twin apart from its fault; the seed paper's scenario.
    Ideal,
    /// Sensors with noise and quantization.
    Noise,
    /// Noise, quantization and tolerances; twins are fitted to their specimens.
    Fitted,
    /// Noise, quantization and tolerances.
    Realistic,
    /// Like `Realistic`, with the extra sensor.
    ExtraSensor,
}

impl Subject {
    /// Every subject, in the order of reports.
    pub const ALL: [Subject; 5] =
        [Subject::Ideal, Subject::Noise, Subject::Fitted, Subject::Realistic, Subject::ExtraSensor];

    /// The subject of a scenario without the extra sensor.
    pub fn of(scenario: Scenario) -> Self {
        match scenario {
            Scenario::Ideal => Subject::Ideal,
            Scenario::Noise => Subject::Noise,
            Scenario::Fitted => Subject::Fitted,
            Scenario::Realistic => Subject::Realistic,
        }
    }

    /// The subject shown by default: realistic if available, else the last in the order of reports. The extra sensor is
    /// chosen only if nothing else is available, because the system does not have it.
    pub fn default_among(subjects: &[Subject]) -> Option<Subject> {
        let place = |subject: &Subject| Subject::ALL.iter().position(|known| known == subject);
        let own = subjects.iter().filter(|subject| !subject.extra_sensor());
        own.max_by_key(|subject| place(subject)).or(subjects.last()).copied()
    }

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Subject::ExtraSensor => "extra_sensor",
            subject => subject.scenario().name(),
        }
    }

    /// The title for readers.
    pub fn title(self, study: &Study) -> String {
        let extra = || study.extra_sensor.as_deref().unwrap_or("an extra sensor");
        match self {
            Subject::ExtraSensor => format!("{}, {}", self.scenario().name(), extra()),
            subject => subject.name().into(),
        }
    }

    /// The scenario of its data set.
    pub fn scenario(self) -> Scenario {
        match self {
            Subject::Ideal => Scenario::Ideal,
            Subject::Noise => Scenario::Noise,
            Subject::Fitted => Scenario::Fitted,
            Subject::Realistic | Subject::ExtraSensor => Scenario::Realistic,
        }
    }

    /// The number of measured sensors that the diagnosis reads.
    pub(crate) fn sensors(self, study: &Study) -> usize {
        if self.extra_sensor() { study.measured.len() } else { study.base_sensors() }
    }

    /// Whether the extra sensor is used.
    pub fn extra_sensor(self) -> bool {
        self == Subject::ExtraSensor
    }

    /// The settings of training and evaluation. A quick study leaves some parts out.
    pub fn settings(self, study: &Study) -> EvaluationSettings {
        let usual = self.usual();
        let settings = if study.is_full { usual } else { usual.quick() };
        EvaluationSettings { shutdowns: study.shutdowns(), ..settings }
    }

    /// The usual settings of training and evaluation.
    ///
    /// Classifiers are compared on the ideal scenario, like in the seed paper. Perfect specimens are judged with the paper's band of 3 %. On specimens
    /// with tolerances that band would alarm for one healthy specimen in eight, so bands are learned there.
    ///
    /// Trees are as deep as the paper's for specimens that equal their twin. With tolerances they need two more
    /// questions. Beside fitted twins they need three more, because the bands are as narrow as noise permits and
    /// reveal weaker faults. There nearly every healthy specimen comes close to the bands, so only those that leave
    /// them are used for training. Depth, criterion and training filter were chosen on training commands held out of
    /// training (decision 015).
    ///
    /// Evaluation records are longer than training records and so reveal weaker faults. For specimens that equal
    /// their twin, weakened copies of a fault are therefore used down to a quarter of the band.
    fn usual(self) -> EvaluationSettings {
        let defaults = EvaluationSettings::default();
        let usually = defaults.holding.lessons;
        let lessons = match self.scenario().plants() {
            Plants::Pool => TrainingFilter { healthy: 1.0, ..usually },
            Plants::Specimens => usually,
            Plants::Twin => TrainingFilter { weaker: 0.25, ..usually },
        };
        let settings = EvaluationSettings {
            training: match self.scenario().plants() {
                Plants::Specimens => learn::trees(Criterion::Gini, 9),
                Plants::Pool => learn::trees(Criterion::Entropy, 10),
                Plants::Twin => defaults.training,
            },
            holding: Holding { lessons, ..defaults.holding },
            learned_bands: self.scenario().has_tolerances(),
            ..defaults
        };
        match self {
            Subject::Ideal => settings,
            Subject::ExtraSensor => EvaluationSettings {
                classifiers: vec![],
                protocols: vec![Protocol::UnseenIntensity, Protocol::NewCommand],
                committee_protocols: vec![Protocol::NewCommand],
                ..settings
            },
            _ => EvaluationSettings { classifiers: vec![], ..settings },
        }
    }
}
