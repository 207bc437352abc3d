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
pub(crate) const MAX_FREE: usize = 8;

/// A set of candidates: bit `i` stands for candidate `i`.
pub type SensorMask = u64;

/// A sensor that may be in a set.
#[derive(Debug, Clone, PartialEq)]
pub struct CandidateSensor {
    /// The id in the study, from which the names of features are built.
    pub id: String,
    /// The component that reads it, if one does: control needs it.
    pub read_by: Option<String>,
    /// Whether the system does not have it yet.
    pub is_extra: bool,
    /// Its cost, in the unit of the user's table; 1 without a table.
    pub(crate) cost: f64,
}

/// The candidates of a study, in the order of its sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidates {
    /// The sensors.
    pub list: Vec<CandidateSensor>,
    /// Those that every set holds.
    pub(crate) needed: SensorMask,
}

impl Candidates {
    /// The sensors of a study, without the extra one unless `extra` is set. Sets hold those that control needs and
    /// those that `keep` names.
    ///
    /// # Errors
    /// `keep` names no sensor; more than [`MAX_FREE`] sensors may be left out; the table of costs is wrong.
    pub(crate) fn new(
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
            read_costs(path, &list)?.into_iter().zip(&mut list).for_each(|(c, s)| s.cost = c);
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

    /// Whether a set holds all sensors that control needs, and those that are kept.
    pub(crate) fn keeps_control(&self, set: SensorMask) -> bool {
        set & self.needed == self.needed
    }

    /// The cost of a set.
    pub(crate) fn cost(&self, set: SensorMask) -> f64 {
        self.within(set).map(|sensor| self.list[sensor].cost).sum()
    }

    /// The candidates in a set, as indices.
    pub(crate) fn within(&self, set: SensorMask) -> impl Iterator<Item = usize> + '_ {
        (0..self.list.len()).filter(move |sensor| set >> sensor & 1 == 1)
    }

    /// The ids of a set.
    pub fn names(&self, set: SensorMask) -> String {
        self.within(set).map(|sensor| self.list[sensor].id.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// Every set that is judged: all that hold the needed sensors, and the system's own sensors without each single
    /// one.
    pub(crate) fn sets(&self) -> Vec<SensorMask> {
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
    let is_signal =
        |port: usize| sensor.signal == format!("{}.{}", own.id, own.component.ports[port].name);
    let joined = network.connections.iter().find(|ends| {
        ends.iter().any(|end| end.component == sensor.component && is_signal(end.port))
    })?;
    let other = joined.iter().find(|end| end.component != sensor.component)?;
    Some(network.components[other.component].id.clone())
}

/// The index of a sensor, or a message that lists all.
fn place_of(list: &[CandidateSensor], id: &str) -> Result<usize, String> {
    let ids: Vec<&str> = list.iter().map(|sensor| sensor.id.as_str()).collect();
    let place = ids.iter().position(|known| *known == id);
    place.ok_or_else(|| format!("there is no sensor '{id}'; there are: {}", ids.join(", ")))
}

/// Reads a table of costs: one number for each sensor, in their order.
fn read_costs(path: &Path, list: &[CandidateSensor]) -> Result<Vec<f64>, SafetyError> {
    let table = texts::read(path)?;
    let places = find_columns(path, &table, COLUMNS)?;
    let mut costs = vec![None; list.len()];
    for row in &table.rows {
        let [sensor, cost, source] = places.map(|place| row.cells[place].trim());
        let wrong = |column: usize, problem: String| SafetyError::Cell {
            path: path.into(),
            line: row.line,
            column: COLUMNS[column],
            problem,
        };
        let place = place_of(list, sensor).map_err(|problem| wrong(0, problem))?;
        let value = cost.parse().ok().filter(|cost: &f64| cost.is_finite() && *cost >= 0.0);
        let value = value.ok_or_else(|| wrong(1, format!("'{cost}' is no cost of 0 or more")))?;
        if source.is_empty() {
            return Err(wrong(2, "a cost needs its source: an offer, or who estimated it".into()));
        }
        if costs[place].replace(value).is_some() {
            return Err(wrong(0, format!("'{sensor}' has a cost already")));
        }
    }
    let missing: Vec<String> = list
        .iter()
        .zip(&costs)
        .filter(|(_, cost)| cost.is_none())
        .map(|(sensor, _)| sensor.id.clone())
        .collect();
    match missing.is_empty() {
        true => Ok(costs.into_iter().flatten().collect()),
        false => Err(SafetyError::NoCosts { path: path.into(), missing }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidates(study: &Study, costs: &str) -> Result<Candidates, SafetyError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), format!("sensor,cost,source\n{costs}")).unwrap();
        let path = (!costs.is_empty()).then_some(file.path());
        Candidates::new(study, study.extra_sensor.is_some(), &[], path)
    }

    #[test]
    fn control_needs_what_a_component_reads() {
        let aileron = candidates(&Study::default(), "").unwrap();
        assert_eq!(aileron.names(aileron.needed), "p_a_1 p_b_1 x_p_1 p_a_2 p_b_2 x_p_2");
        let read_by = |place: usize| aileron.list[place].read_by.as_deref();
        assert_eq!(read_by(2), Some("actuator_1.position_selector"));
        assert_eq!(read_by(3), None);
        // 2^7 sets leave control possible, and six more lack one sensor that control needs.
        let sets = aileron.sets();
        assert_eq!(sets.iter().filter(|&&set| aileron.keeps_control(set)).count(), 128);
        assert_eq!(sets.len(), 134);
        assert_eq!(aileron.names(aileron.all() & !aileron.base()), "x_p_3");
    }

    #[test]
    fn kept_sensors_are_in_every_set_and_many_free_ones_are_refused() {
        let study = Study::default();
        let keep = ["x_v_1".to_owned(), "p_s_2".to_owned()];
        let kept = Candidates::new(&study, false, &keep, None).unwrap();
        assert!(kept.keeps_control(kept.needed) && kept.needed.count_ones() == 8);
        let without = kept.all() & !(1 << 3);
        assert!(kept.sets().contains(&without) && !kept.keeps_control(without));
        let error = Candidates::new(&study, false, &["x_w".into()], None).unwrap_err();
        assert!(
            error.to_string().starts_with("there is no sensor 'x_w' to keep; there are: p_a_1, ")
        );
        let error = SafetyError::TooManySensors { free: 9, most: MAX_FREE }.to_string();
        assert!(error.contains("allowed are 8"), "{error}");
    }

    #[test]
    fn costs_add_up_and_wrong_ones_are_named() {
        let study = Study::parse(include_str!("../../../../studies/press_axis.toml"), "press.toml");
        let study = study.unwrap();
        let rows = "p_a,1,offer\np_b,1,offer\nx_p,5.5,offer\nx_v,2,offer\n";
        let priced = candidates(&study, &format!("{rows}p_s,0.5,offer\n")).unwrap();
        assert_eq!((priced.cost(priced.all()), priced.cost(priced.needed)), (10.0, 7.5));
        let cases = [
            (
                format!("{rows}p_s,-1,offer\n"),
                "line 6, column 'cost': '-1' is no cost of 0 or more",
            ),
            (format!("{rows}p_s,1,\n"), "column 'source': a cost needs its source"),
            (format!("{rows}p_x,1,offer\n"), "there is no sensor 'p_x'; there are: p_a, p_b, x_p"),
            (format!("{rows}p_a,1,offer\n"), "'p_a' has a cost already"),
            (rows.to_owned(), "sensors without a cost: p_s"),
        ];
        for (costs, message) in cases {
            let error = candidates(&study, &costs).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
