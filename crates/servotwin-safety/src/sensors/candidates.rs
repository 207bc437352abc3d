//! The sensors that a set may hold: which of them control needs, and what each costs.
//!
//! Control needs a sensor if a component reads it, that is if its signal is connected to another component. Nothing but
//! the diagnosis uses the others.

use crate::error::SafetyError;
use crate::rates::find_columns;
use servotwin::study::Study;
use servotwin::table::csv::texts;
use std::path::Path;

/// The columns of a table of costs.
const COLUMNS: [&str; 3] = ["sensor", "cost", "source"];

/// The most sensors that a search may leave out: it judges every set of them.
pub const MAX_FREE: usize = 8;

/// A set of candidates: bit `i` stands for candidate `i`.
pub type SensorMask = u64;

/// A sensor that may be in a set.
#[derive(Debug, Clone, PartialEq)]
pub struct CandidateSensor {
    /// The id in the study.
    pub id: String,
    /// The label, from which the names of features are built.
    pub label: String,
    /// The component that reads it, if one does: control needs it.
    pub read_by: Option<String>,
    /// Whether the system does not have it yet.
    pub is_extra: bool,
    /// Its cost, in the unit of the user's table; 1 without a table.
    pub cost: f64,
}

/// The candidates of a study, in the order of its sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidates {
    /// The sensors.
    pub list: Vec<CandidateSensor>,
    /// Those that every set holds.
    pub needed: SensorMask,
}

impl Candidates {
    /// The sensors of a study, without the extra one unless `extra` is set. Sets hold those that control needs and
    /// those that `keep` names.
    ///
    /// # Errors
    /// `keep` names no sensor; more than [`MAX_FREE`] sensors may be left out; the table of costs is wrong.
    pub fn new(
        study: &Study,
        extra: bool,
        keep: &[String],
        costs: Option<&Path>,
    ) -> Result<Self, SafetyError> {
        let base = study.base_sensors();
        let count = if extra { study.measured.len() } else { base };
        let mut list: Vec<CandidateSensor> = (0..count)
            .map(|place| CandidateSensor {
                id: study.system.sensors[study.measured[place]].id.clone(),
                label: study.sensors.0[place].name.clone(),
                read_by: reader(study, study.measured[place]),
                is_extra: place >= base,
                cost: 1.0,
            })
            .collect();
        let ids: Vec<String> = list.iter().map(|sensor| sensor.id.clone()).collect();
        if let Some(given) = keep.iter().find(|id| !ids.contains(id)) {
            return Err(SafetyError::NoSensor { given: given.clone(), known: ids });
        }
        if let Some(path) = costs {
            read_costs(path, &ids)?.into_iter().zip(&mut list).for_each(|(c, s)| s.cost = c);
        }
        let is_needed = |s: &CandidateSensor| s.read_by.is_some() || keep.contains(&s.id);
        let free = list.iter().filter(|sensor| !is_needed(sensor)).count();
        if free > MAX_FREE || list.len() >= SensorMask::BITS as usize {
            return Err(SafetyError::TooManySensors { free, most: MAX_FREE });
        }
        let needed = mask(list.iter().map(is_needed));
        Ok(Candidates { list, needed })
    }

    /// All candidates.
    pub fn all(&self) -> SensorMask {
        mask(self.list.iter().map(|_| true))
    }

    /// The sensors that the system has.
    pub fn base(&self) -> SensorMask {
        mask(self.list.iter().map(|sensor| !sensor.is_extra))
    }

    /// Whether a set leaves control possible.
    pub fn keeps_control(&self, set: SensorMask) -> bool {
        let read = mask(self.list.iter().map(|sensor| sensor.read_by.is_some()));
        set & read == read
    }

    /// The cost of a set.
    pub fn cost(&self, set: SensorMask) -> f64 {
        self.within(set).map(|sensor| self.list[sensor].cost).sum()
    }

    /// The candidates in a set, as indices.
    pub fn within(&self, set: SensorMask) -> impl Iterator<Item = usize> + '_ {
        (0..self.list.len()).filter(move |sensor| set >> sensor & 1 == 1)
    }

    /// The ids of a set.
    pub fn names(&self, set: SensorMask) -> String {
        self.within(set).map(|sensor| self.list[sensor].id.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// Every set that is judged: all that hold the needed sensors, and the system's own sensors without each single
    /// one.
    pub fn sets(&self) -> Vec<SensorMask> {
        let free = self.all() & !self.needed;
        let mut sets = vec![self.needed];
        let mut part: SensorMask = free;
        while part != 0 {
            sets.push(self.needed | part);
            part = (part - 1) & free;
        }
        sets.extend(self.within(self.base()).map(|sensor| self.base() & !(1 << sensor)));
        sets.retain(|&set| set != 0);
        sets.sort_unstable();
        sets.dedup();
        sets
    }
}

fn mask(holds: impl Iterator<Item = bool>) -> SensorMask {
    holds.enumerate().fold(0, |mask, (place, holds)| mask | u64::from(holds) << place)
}

/// The first component whose port is connected to a sensor's signal.
fn reader(study: &Study, sensor: usize) -> Option<String> {
    let sensor = &study.system.sensors[sensor];
    let network = study.system.network();
    let own = &network.components[sensor.component];
    let is_signal = |port: usize| {
        sensor.signal == format!("{}.{}", own.id, own.component.spec().ports[port].name)
    };
    let joined = network.connections.iter().find(|ends| {
        ends.iter().any(|end| end.component == sensor.component && is_signal(end.port))
    })?;
    let other = joined.iter().find(|end| end.component != sensor.component)?;
    Some(network.components[other.component].id.clone())
}

/// Reads a table of costs: one number for each sensor, in their order.
fn read_costs(path: &Path, ids: &[String]) -> Result<Vec<f64>, SafetyError> {
    let table = texts::read(path)?;
    let places = find_columns(path, &table, COLUMNS)?;
    let mut costs = vec![None; ids.len()];
    for row in &table.rows {
        let [sensor, cost, source] = places.map(|place| row.cells[place].trim());
        let wrong = |column: usize, problem: String| SafetyError::Cell {
            path: path.into(),
            line: row.line,
            column: COLUMNS[column],
            problem,
        };
        let place = ids.iter().position(|id| id == sensor);
        let known = || format!("there is no sensor '{sensor}'; there are: {}", ids.join(", "));
        let place = place.ok_or_else(|| wrong(0, known()))?;
        let value = cost.parse().ok().filter(|cost: &f64| cost.is_finite() && *cost >= 0.0);
        let value = value.ok_or_else(|| wrong(1, format!("'{cost}' is no cost of 0 or more")))?;
        if source.is_empty() {
            return Err(wrong(2, "a cost needs its source: an offer, or who estimated it".into()));
        }
        if costs[place].replace(value).is_some() {
            return Err(wrong(0, format!("'{sensor}' has a cost already")));
        }
    }
    let missing: Vec<String> = ids
        .iter()
        .zip(&costs)
        .filter(|(_, cost)| cost.is_none())
        .map(|(id, _)| id.clone())
        .collect();
    match missing.is_empty() {
        true => Ok(costs.into_iter().flatten().collect()),
        false => Err(SafetyError::NoCosts { path: path.into(), missing }),
    }
}
