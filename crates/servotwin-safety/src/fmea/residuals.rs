//! The residuals of every fault in records.

use crate::error::SafetyError;
use crate::results::StudyResultsFolder;
use servotwin::measure::flights::STRONG;
use servotwin::study::Purpose;
use servotwin::table::{self, Table};
use servotwin_diagnosis::residual::BAND;
use std::collections::BTreeMap;

/// A run with a fault.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FaultRun {
    /// The row of the data set, from 1.
    pub(crate) row: usize,
    /// The nominal intensity.
    pub(crate) grade: f64,
    /// The largest absolute residual of every sensor, in parts of its scale.
    pub(crate) largest: Vec<f64>,
}

/// The runs of a data set, by fault.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ResidualRuns {
    /// The data set's file name.
    pub(crate) file: String,
    /// The labels of the sensors.
    pub(crate) sensors: Vec<String>,
    /// The half width of every sensor's band, in parts of scale.
    pub(crate) bands: Vec<f64>,
    /// Whether the bands were learned from healthy specimens; otherwise they are the paper's 3 %.
    pub(crate) are_learned: bool,
    runs: BTreeMap<String, Vec<FaultRun>>,
}

/// A sensor whose residual a fault moves.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MovedResidual {
    /// The sensor's label.
    pub(crate) sensor: String,
    /// The median of the largest residual, in parts of scale.
    pub(crate) median: f64,
    /// The number of strong runs in which it left its band.
    pub(crate) beyond: usize,
}

impl ResidualRuns {
    /// Reads the runs of the quoted scenario; `None` if it has no data set.
    ///
    /// # Errors
    /// The data set is damaged.
    pub(crate) fn read(results: &StudyResultsFolder) -> Result<Option<Self>, SafetyError> {
        let path = results.folder.data_set(results.scenario, Purpose::Test);
        if !path.exists() {
            return Ok(None);
        }
        let is_wanted = |name: &str| {
            ["fault", "grade", "failure"].contains(&name) || name.starts_with("largest:")
        };
        let table = table::read_wanted(&path, &is_wanted)?;
        let sensors: Vec<String> = table
            .names()
            .filter_map(|name| name.strip_prefix("largest:"))
            .map(str::to_owned)
            .collect();
        let learned = results.evaluated().filter(|result| result.settings.learned_bands);
        let learned = learned.and_then(|result| result.evaluation.bands.as_ref());
        let half_width = |sensor: &String| {
            let own = learned.and_then(|bands| bands.iter().find(|band| band.sensor == *sensor));
            own.map_or(BAND, |band| band.half_width)
        };
        Ok(Some(ResidualRuns {
            file: format!("dataset-{}.parquet", results.scenario.name()),
            bands: sensors.iter().map(half_width).collect(),
            are_learned: learned.is_some(),
            runs: runs(&table, &sensors)?,
            sensors,
        }))
    }

    /// The runs of a fault that were simulated to their end.
    pub(crate) fn of(&self, fault: &str) -> &[FaultRun] {
        self.runs.get(fault).map_or(&[], Vec::as_slice)
    }

    /// The strong runs of a fault.
    pub(crate) fn strong(&self, fault: &str) -> Vec<&FaultRun> {
        self.of(fault).iter().filter(|run| run.grade >= STRONG - 1e-9).collect()
    }

    fn is_beyond(&self, run: &FaultRun, sensor: usize) -> bool {
        run.largest[sensor] > self.bands[sensor]
    }

    /// The sensors whose residual leaves its band in at least half of a fault's strong runs, the farthest first.
    pub(crate) fn moved(&self, fault: &str) -> Vec<MovedResidual> {
        let strong = self.strong(fault);
        let of_sensor = |sensor: usize| {
            let beyond = strong.iter().filter(|run| self.is_beyond(run, sensor)).count();
            let mut sizes: Vec<f64> = strong.iter().map(|run| run.largest[sensor]).collect();
            sizes.sort_by(f64::total_cmp);
            let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
            (
                median / self.bands[sensor],
                MovedResidual { sensor: self.sensors[sensor].clone(), median, beyond },
            )
        };
        let mut moved: Vec<_> = (0..self.sensors.len()).map(of_sensor).collect();
        moved.retain(|(_, moved)| moved.beyond > 0 && 2 * moved.beyond >= strong.len());
        moved.sort_by(|a, b| b.0.total_cmp(&a.0));
        moved.into_iter().map(|(_, moved)| moved).collect()
    }
}

fn runs(table: &Table, sensors: &[String]) -> Result<BTreeMap<String, Vec<FaultRun>>, SafetyError> {
    let largest: Vec<_> = sensors
        .iter()
        .map(|sensor| table.f64(&format!("largest:{sensor}")))
        .collect::<Result<_, _>>()?;
    let (faults, grades) = (table.text("fault")?, table.f64("grade")?);
    let failures = table.text("failure")?;
    let mut found: BTreeMap<String, Vec<FaultRun>> = BTreeMap::new();
    for row in (0..table.row_count()).filter(|&row| failures[row].is_empty()) {
        let run = FaultRun {
            row: row + 1,
            grade: grades[row],
            largest: largest.iter().map(|column| column[row]).collect(),
        };
        found.entry(faults[row].clone()).or_default().push(run);
    }
    Ok(found)
}
