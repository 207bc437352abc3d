//! The runs on which sets of sensors are judged, and the features that a set leaves.

use super::candidates::{CandidateSensor, Candidates, SensorMask};
use crate::error::SafetyError;
use crate::results::StudyResultsFolder;
use servotwin::job::{self, Subject};
use servotwin::learn::{DataSet, EvaluationError, EvaluationSettings, banded};
use servotwin_diagnosis::features::{self, Feature, Sensor, Sensors};
use servotwin_diagnosis::residual::BAND;

/// The runs of a scenario, with a band for every candidate.
pub struct SensorRuns {
    /// All rows; [`servotwin::learn::data_set::DataRow::largest`] has one value for each candidate.
    pub(crate) data: DataSet,
    /// Half width of every candidate's band, in parts of scale.
    pub bands: Vec<f64>,
    /// How the study trains and judges.
    pub(crate) settings: EvaluationSettings,
    sensors: Sensors,
}

impl SensorRuns {
    /// Whether the scenario of the results has runs with the study's extra sensor.
    pub(crate) fn have_extra(results: &StudyResultsFolder) -> bool {
        results.study.extra_sensor.is_some()
            && subject(results, true).scenario() == results.scenario
    }

    /// Reads the runs of the quoted scenario.
    ///
    /// # Errors
    /// The data set is missing or damaged.
    pub fn read(
        results: &StudyResultsFolder,
        candidates: &Candidates,
    ) -> Result<Self, SafetyError> {
        let study = &results.study;
        let has_extra = candidates.list.iter().any(|sensor| sensor.is_extra);
        let subject = subject(results, has_extra);
        let mut whole = job::data_set(&results.folder, study, subject)?;
        let settings = subject.settings(study);
        let mut pools = job::pools(study);
        for sensor in candidates.list.iter().filter(|sensor| sensor.is_extra) {
            add_extra(&mut whole, sensor);
            pools.push(pools.len());
        }
        let (data, learned) = banded(&whole.taught()?, &settings, &pools);
        let bands = match learned.filter(|_| settings.learned_bands) {
            Some(bands) => bands.iter().map(|band| band.half_width).collect(),
            None => vec![BAND; candidates.list.len()],
        };
        Ok(SensorRuns { bands, settings, sensors: study.sensors_in(results.scenario), data })
    }

    /// The runs as a set of sensors shows them: with the bands of its sensors, and the features that it leaves.
    ///
    /// # Errors
    /// The set leaves no feature.
    pub(crate) fn left_by(
        &self,
        candidates: &Candidates,
        set: SensorMask,
    ) -> Result<DataSet, EvaluationError> {
        let band = |(sensor, &band): (usize, &f64)| match set >> sensor & 1 {
            1 => band,
            _ => f64::INFINITY,
        };
        let bands: Vec<f64> = self.bands.iter().enumerate().map(band).collect();
        let left = features_left(&self.sensors, &candidates.within(set).collect::<Vec<_>>());
        self.data.with_bands(&bands).with_features(|own| left.contains(&own.feature))
    }
}

/// The sensors that are left.
fn sensors_left(sensors: &Sensors, kept: &[usize]) -> Sensors {
    let place = |sensor: usize| kept.iter().position(|&own| own == sensor);
    let sensor = |&own: &usize| {
        let whole = &sensors.0[own];
        let law = whole.follows.iter().map(|&(other, change)| Some((place(other)?, change)));
        // A law needs all of its sensors.
        let follows = law.collect::<Option<Vec<_>>>().unwrap_or_default();
        Sensor { follows, ..whole.clone() }
    };
    Sensors(kept.iter().map(sensor).collect())
}

/// The features that the families compute of the sensors that are left. A feature of all sensors is the same one if it
/// is described by the same words: then it reads none of the others.
fn features_left(sensors: &Sensors, kept: &[usize]) -> Vec<Feature> {
    let sensors = sensors_left(sensors, kept);
    features::ALL.iter().flat_map(|family| family.features(&sensors)).collect()
}

/// The data set of the quoted scenario.
fn subject(results: &StudyResultsFolder, extra: bool) -> Subject {
    if extra { Subject::ExtraSensor } else { Subject::of(results.scenario) }
}

/// Adds the largest residual of the extra sensor, which is a feature like others.
fn add_extra(data: &mut DataSet, sensor: &CandidateSensor) {
    let name = format!("largest_{}", sensor.id);
    let Some(column) = data.features.iter().position(|own| own.feature.name == name) else {
        return;
    };
    let mut values = vec![0.0; data.features.len()];
    for (place, row) in data.rows.iter_mut().enumerate() {
        data.examples.row_into(0, place, &mut values);
        row.largest.push(values[column]);
    }
    data.sensors.push(sensor.id.clone());
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotwin::study::Study;
    use servotwin_diagnosis::random::Random;
    use servotwin_diagnosis::residual::Window;

    /// The values of all features by their descriptions.
    fn values(sensors: &Sensors, samples: &[Vec<f64>], kept: &[usize]) -> Vec<(Feature, f64)> {
        let mut window = Window::new(kept.len());
        for sample in samples {
            let measured: Vec<f64> = kept.iter().map(|&sensor| sample[sensor]).collect();
            let twin = vec![0.3 * sample[0].sin(); kept.len()];
            window.add(&measured, &twin, &vec![1.0; kept.len()]);
        }
        let sensors = sensors_left(sensors, kept);
        features::features(&sensors).into_iter().zip(features::values(&sensors, &window)).collect()
    }

    #[test]
    fn a_feature_that_is_left_reads_no_other_sensor() {
        let sensors = &Study::default().sensors;
        let all: Vec<usize> = (0..sensors.0.len()).collect();
        let mut random = Random::new(4);
        let sample = |_| all.iter().map(|_| random.between(-1.0, 1.0)).collect::<Vec<f64>>();
        let samples: Vec<Vec<f64>> = (0..50).map(sample).collect();
        let whole = values(sensors, &samples, &all);
        for left_out in 0..all.len() {
            let kept: Vec<usize> = all.iter().copied().filter(|own| *own != left_out).collect();
            let left = values(sensors, &samples, &kept);
            let same = left.iter().filter(|own| whole.contains(own)).count();
            let renamed = left.iter().filter(|(f, _)| whole.iter().all(|(g, _)| f != g)).count();
            assert_eq!(same + renamed, left.len(), "without {}", sensors.0[left_out].name);
            assert!(left.len() < whole.len() && same > left.len() / 2);
        }
    }
}
