//! Nominal values from a twin: the healthy system, simulated with the inputs of every record.
//!
//! The twin of a record begins in the steady state of its first inputs. Its sensors become columns named `twin.<sensor>`,
//! which a sensor of the study names as its `nominal`.

use super::windows::joined;
use super::{RecordingError, RecordingStudy};
use crate::format::{Names, Value, section};
use crate::simulate::Simulation;
use crate::system::System;
use crate::table::{Column, Table};
use std::ops::Range;
use std::path::Path;

/// What the names of the twin's columns begin with.
pub(super) const TWIN: &str = "twin.";

section! {
    /// The twin of every record.
    pub(super) struct TwinChoice {
        must system: String, "file of the system beside the study, or a built-in one";
        must pub(crate) period_s: f64 = Value::Number(1e-6, 1e3, "s"), "time between two rows";
        must pub(crate) inputs: Names<String>, "column of each driven input, SI; the others keep their defaults";
    }
}

impl RecordingStudy {
    /// Reads the system of the twin. `folder` is that of the study file. `None` if the study has no twin.
    ///
    /// # Errors
    /// The system cannot be read.
    pub(crate) fn system(&self, folder: &Path) -> Result<Option<System>, RecordingError> {
        let Some(twin) = &self.twin else { return Ok(None) };
        let beside = folder.join(&twin.system);
        let system = System::read(if beside.exists() { &beside } else { Path::new(&twin.system) });
        system.map(Some).map_err(|error| RecordingError::System(Box::new(error)))
    }

    /// Adds the twin's values of every sensor that has them as its nominal values.
    ///
    /// # Errors
    /// A column is missing, or the twin of a record cannot be simulated.
    pub(crate) fn add_twin(
        &self,
        records: &mut Table,
        system: &System,
    ) -> Result<(), RecordingError> {
        let Some(twin) = &self.twin else { return Ok(()) };
        let own = self.sensors.iter().filter_map(|sensor| sensor.nominal.as_deref());
        let ids: Vec<&str> = own.filter_map(|name| name.strip_prefix(TWIN)).collect();
        let inputs = twin.inputs.values().map(|name| records.f64(name).map(|c| held(&c)));
        let inputs = inputs.collect::<Result<Vec<Vec<f64>>, _>>()?;
        let names = joined(records, self.record.as_slice())?;
        let mut columns = vec![vec![]; ids.len()];
        let mut start = 0;
        for record in names.chunk_by(|a, b| a == b) {
            let rows = start..start + record.len();
            start = rows.end;
            let driven = twin.inputs.keys().map(|name| name.as_str()).zip(&inputs);
            let values = simulated(system, twin.period_s, &ids, driven, rows);
            let values = values.map_err(|error| RecordingError::Twin {
                record: record[0].clone(),
                error: Box::new(error),
            })?;
            columns.iter_mut().zip(values).for_each(|(column, values)| column.extend(values));
        }
        for (id, values) in ids.into_iter().zip(columns) {
            let name = format!("{TWIN}{id}");
            if records.has(&name) {
                records.take(&name)?;
            }
            records.push(Column::new(name, "", values))?;
        }
        Ok(())
    }
}

/// The values of the sensors in the rows of a record.
fn simulated<'i>(
    system: &System,
    period_s: f64,
    sensors: &[&str],
    inputs: impl Iterator<Item = (&'i str, &'i Vec<f64>)>,
    rows: Range<usize>,
) -> Result<Vec<Vec<f64>>, crate::simulate::SimulationError> {
    let count = rows.len();
    let simulation = Simulation::new(system)
        .record(sensors.iter().copied())
        .sample_period_s(period_s)
        .duration_s((count.max(2) - 1) as f64 * period_s);
    let driven = inputs.fold(simulation, |simulation, (id, values)| {
        let mut own = values[rows.clone()].to_vec();
        own.resize(count.max(2), own[0]);
        simulation.input(id, own)
    });
    let mut values = driven.run()?.runs.remove(0).values;
    values.iter_mut().for_each(|column| column.resize(count, f64::NAN));
    Ok(values)
}

/// A missing input keeps its last value.
fn held(values: &[f64]) -> Vec<f64> {
    let first = values.iter().copied().find(|value| value.is_finite()).unwrap_or(0.0);
    let hold = |last: &mut f64, value: &f64| {
        *last = if value.is_finite() { *value } else { *last };
        Some(*last)
    };
    values.iter().scan(first, hold).collect()
}
