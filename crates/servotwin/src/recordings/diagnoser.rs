//! The diagnoser of a study of recordings, and what it says of the windows of a new record.
//!
//! It is a [`Diagnoser`] as any other, with one window, whose verdict decides. In [`Recorded`] it keeps its study and the
//! nominal values, so that a log needs neither a map nor the study of a system.

use super::twin::TWIN;
use super::windows::Windows;
use super::{RecordingError, RecordingStudy};
use crate::learn::train;
use crate::system::System;
use crate::table::Table;
use servotwin_diagnosis::diagnoser::{
    DiagnosedSensor, Diagnoser, IndexedFinding, Nominals, Novelty, Recorded, Tuning,
};
use servotwin_diagnosis::error::{Error, require_sound};
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_diagnosis::panel::{Panel, SensorBand};

/// The period of records without a twin, whose rows may be anything, s.
const ROW_S: f64 = 1.0;

impl RecordingStudy {
    /// What a diagnoser keeps of the study and of what it learned besides trees.
    pub(super) fn recorded(&self, text: &str, records: &Table, nominals: Nominals) -> Recorded {
        let system = self.twin.as_ref().and_then(|_| records.metadata.get(TWIN).cloned());
        Recorded { study: text.into(), system, nominals }
    }

    /// A diagnoser that judges every window alone. No window is within its bands, so trees and committee are always
    /// asked.
    pub(super) fn diagnoser(
        &self,
        [trees, committee]: [Hierarchy; 2],
        novelty: Novelty,
        recorded: Recorded,
    ) -> Result<Diagnoser, RecordingError> {
        let learned = recorded.nominals.iter().map(|own| own.iter().flat_map(|own| own.values()));
        let scales = self.sensors.iter().zip(learned).map(|(sensor, mut learned)| {
            let learned = learned.next().map(|nominal| 100.0 * nominal.deviation);
            sensor.scale.or(learned).unwrap_or(1.0)
        });
        let scales: Vec<f64> = scales.collect();
        // Every part of a window has all sensors.
        let sensors = self.sensors().0.into_iter().zip(scales.iter().cycle());
        let sensors = sensors.map(|(seen, &scale)| DiagnosedSensor::new(seen, scale));
        let sensors: Vec<DiagnosedSensor> = sensors.collect();
        let band = |own: &DiagnosedSensor| SensorBand { sensor: own.name.clone(), half_width: 0.0 };
        let bands = sensors.iter().map(band).collect();
        let tuning = Tuning::usual(&trees.names, &[]);
        let panel = Panel { bands, least_confidence: None, trees, committee };
        let period_s = self.twin.as_ref().map_or(ROW_S, |twin| twin.period_s);
        let length = (self.part_rows() as u32, panel, novelty);
        let diagnoser = train::of_one_window((period_s, sensors), length, tuning);
        let diagnoser = Diagnoser { recorded: Some(recorded), ..diagnoser };
        diagnoser.check()?;
        Ok(diagnoser)
    }

    /// The study of a new record, whose labels are not known.
    fn unlabeled(self) -> Self {
        let (record, novelty) = (None, None);
        RecordingStudy { record, novelty, groups: vec![], keep: vec![], targets: vec![], ..self }
    }
}

/// The answers for the windows of a record.
#[derive(Debug, Clone)]
pub struct Answers {
    /// The windows.
    pub windows: Windows,
    /// The finding in each window.
    pub findings: Vec<IndexedFinding>,
    /// How unlike each window is what the diagnoser knows; above 1 it is unknown. Always 0 without `[novelty]`.
    pub distances: Vec<f64>,
}

impl Answers {
    /// Judges every window of a record alone. The committee answers: the last classifier of the study.
    ///
    /// # Errors
    /// As [`RecordingStudy::windows`]; the diagnoser is not of its study.
    pub fn of(
        diagnoser: &Diagnoser,
        recorded: &Recorded,
        record: &Table,
    ) -> Result<Self, RecordingError> {
        let study = RecordingStudy::parse(&recorded.study, "the study of the model")?.unlabeled();
        let mut record = record.clone();
        if let Some(text) = &recorded.system {
            let system = System::parse(text, "the twin of the model");
            let system = system.map_err(|error| RecordingError::System(Box::new(error)))?;
            study.add_twin(&mut record, &system)?;
        }
        require_sound(study.has_nominals(&recorded.nominals), "its nominal values are of others")?;
        let windows = study.windows(&record, &recorded.nominals)?;
        let features = windows.features().iter().map(|feature| &feature.name);
        let (names, length) = (diagnoser.names(), &diagnoser.lengths[0]);
        require_sound(features.eq(&names.features), "its features are not those of its study")?;
        let mut scratch = length.panel.committee.scratch();
        let judged = windows.values.iter().map(|row| -> Result<(IndexedFinding, f64), Error> {
            let said = length.panel.committee.diagnose(&[row], &mut scratch)?;
            let distance = length.novelty.score(said.action, row);
            let finding = match (said.actuator, said.action) {
                _ if distance > 1.0 => IndexedFinding::Unknown,
                (None, _) => IndexedFinding::Healthy,
                (Some(actuator), None) => IndexedFinding::Actuator { actuator },
                (Some(actuator), Some(action)) => IndexedFinding::Action { actuator, action },
            };
            Ok((finding, distance))
        });
        let judged: Vec<_> = judged.collect::<Result<_, _>>()?;
        let (findings, distances) = judged.into_iter().unzip();
        Ok(Answers { windows, findings, distances })
    }
}
