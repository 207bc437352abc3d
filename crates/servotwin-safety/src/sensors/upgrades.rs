//! Better sensors as candidates: other parameters of a sensor, such as its noise or its range.
//!
//! The runs of an upgrade are simulated with a system that has these parameters, and so are their twins. Specimens and
//! the draws of noise are those of the study, so its results differ from the others by the upgrade alone.

use super::candidates::{Candidates, SensorMask};
use crate::error::SafetyError;
use crate::rates::find_columns;
use crate::results::{EvidenceBasis, FOLDER, StudyResultsFolder};
use servotwin::job::flights::Crew;
use servotwin::job::run::{StudyEvent, StudyRun};
use servotwin::job::{Folder, JobError};
use servotwin::study::{Study, StudyError};
use servotwin::system::{NewValue, System};
use servotwin::table::csv::texts;
use std::path::Path;

/// The columns of a table of upgrades.
const COLUMNS: [&str; 6] = ["upgrade", "sensor", "parameter", "value", "cost", "source"];

/// Changed parameters of one or more sensors, which are bought together.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorUpgrade {
    /// Its name: letters, digits, `-` and `_`.
    pub name: String,
    /// The sensors that it changes.
    pub sensors: SensorMask,
    /// For each changed parameter, its sensor as an index of the candidates, its new value and what it costs.
    changes: Vec<(usize, NewValue, f64)>,
}

impl SensorUpgrade {
    /// Reads a table of upgrades. Rows with one name are one upgrade.
    ///
    /// # Errors
    /// A sensor or parameter does not exist; a value or a cost is out of range; a source is missing.
    pub(crate) fn read(
        path: &Path,
        study: &Study,
        candidates: &Candidates,
    ) -> Result<Vec<Self>, SafetyError> {
        let table = texts::read(path)?;
        let places = find_columns(path, &table, COLUMNS)?;
        let mut upgrades: Vec<SensorUpgrade> = vec![];
        for row in &table.rows {
            let cells = places.map(|place| row.cells[place].trim());
            let change = change(study, candidates, &cells).map_err(|(column, problem)| {
                SafetyError::Cell { path: path.into(), line: row.line, column, problem }
            })?;
            let name = cells[0];
            if upgrades.iter().all(|own| own.name != name) {
                upgrades.push(SensorUpgrade { name: name.into(), sensors: 0, changes: vec![] });
            }
            for own in upgrades.iter_mut().filter(|own| own.name == name) {
                own.sensors |= 1 << change.0;
                own.changes.push(change.clone());
            }
        }
        Ok(upgrades)
    }

    /// The candidates with the costs of the upgrade.
    pub(crate) fn priced(&self, candidates: &Candidates) -> Candidates {
        let mut priced = candidates.clone();
        for (sensor, _, cost) in &self.changes {
            priced.list[*sensor].cost += cost;
        }
        priced
    }

    /// Simulates the data sets of the quoted scenario with the upgrade, in a folder of their own in `safety`. Runs that
    /// are stored there are not simulated again.
    ///
    /// # Errors
    /// The system file cannot hold a parameter; a file cannot be written; the caller stopped the work.
    pub(crate) fn simulated(
        &self,
        results: &StudyResultsFolder,
        crew: &Crew,
    ) -> Result<StudyResultsFolder, SafetyError> {
        let StudyResultsFolder { folder, study, scenario, .. } = results;
        let folder = Folder::new(folder.path().join(FOLDER).join("upgrades").join(&self.name));
        let values: Vec<NewValue> = self.changes.iter().map(|(_, new, _)| new.clone()).collect();
        let head = format!("With the upgrade {} of its sensors.", self.name);
        let text = study.system.rewritten(&[head], &values)?;
        let path = folder.system().display().to_string();
        let system = System::parse(&text, &path).map_err(StudyError::System);
        let path = folder.study().display().to_string();
        let study = system.and_then(|system| Study::parse_for(&study.text, &path, system));
        let study = study.map_err(JobError::from)?;
        let what = format!("simulating the upgrade {}", self.name);
        let observer = |event: &StudyEvent| {
            if let StudyEvent::Rows { done, all, .. } = event {
                (crew.progress)(&what, *done as f64 / *all as f64);
            }
        };
        let run = StudyRun {
            folder: folder.clone(),
            replace: true,
            workers: crew.workers,
            observer: &observer,
            ..StudyRun::new(&study, folder.path())
        };
        run.data_sets(*scenario)?;
        let basis = EvidenceBasis::of_study(&study);
        let scenario = *scenario;
        Ok(StudyResultsFolder { folder, study, basis, evaluation: None, flights: None, scenario })
    }
}

/// The column of a mistake, and what is wrong.
type CellMistake = (&'static str, String);

/// Reads a row: the sensor, its new parameter, and the cost.
fn change(
    study: &Study,
    candidates: &Candidates,
    &[name, id, parameter, value, cost, source]: &[&str; 6],
) -> Result<(usize, NewValue, f64), CellMistake> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || !name.chars().all(is_plain) {
        return Err(("upgrade", format!("'{name}' is no name of letters, digits, '-' and '_'")));
    }
    let sensor = candidates.place(id).map_err(|problem| ("sensor", problem))?;
    let component = study.system.sensors[study.measured[sensor]].component;
    let spec = study.system.network().components[component].component.spec();
    let Some(place) = spec.parameter(parameter) else {
        let known: Vec<&str> = spec.parameters.iter().map(|known| known.name).collect();
        let problem = format!("{id} has no parameter '{parameter}'; it has: {}", known.join(", "));
        return Err(("parameter", problem));
    };
    let (min, max) = (spec.parameters[place].min, spec.parameters[place].max);
    let number = |text: &str, column, min: f64, max: f64| {
        let known = text.parse().ok().filter(|value: &f64| (min..=max).contains(value));
        known.ok_or_else(|| (column, format!("'{text}' is out of range: {min} … {max}")))
    };
    let value = number(value, "value", min, max)?;
    let cost = number(cost, "cost", 0.0, f64::MAX)?;
    if source.is_empty() {
        return Err(("source", "a cost needs its source: an offer, or who estimated it".into()));
    }
    let comment = source.to_owned();
    Ok((sensor, NewValue { component, parameter: place, value, comment }, cost))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(rows: &str) -> Result<Vec<SensorUpgrade>, SafetyError> {
        let study = Study::default();
        let candidates = Candidates::new(&study, true, &[], None).unwrap();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), format!("{}\n{rows}", COLUMNS.join(","))).unwrap();
        SensorUpgrade::read(file.path(), &study, &candidates)
    }

    #[test]
    fn rows_of_one_name_are_one_upgrade_and_costs_add_up() {
        let rows = "quiet,p_a_1,noise_sigma,0.0005,30,offer\nwide,p_t_1,full_scale_pa,2e7,4,offer\n\
                    quiet,p_a_1,bits,16,5,offer\nquiet,p_a_2,noise_sigma,0.0005,30,offer\n";
        let upgrades = read(rows).unwrap();
        let names: Vec<&str> = upgrades.iter().map(|own| own.name.as_str()).collect();
        assert_eq!(names, ["quiet", "wide"]);
        assert_eq!((upgrades[0].sensors, upgrades[1].sensors), (1 << 0 | 1 << 6, 1 << 5));
        let candidates = Candidates::new(&Study::default(), true, &[], None).unwrap();
        let priced = upgrades[0].priced(&candidates);
        assert_eq!(priced.cost(1 << 0), 36.0);
        assert_eq!(priced.cost(priced.all()) - candidates.cost(candidates.all()), 65.0);
    }

    #[test]
    fn wrong_rows_are_named() {
        let cases = [
            ("a b,p_a_1,bits,16,1,offer", "column 'upgrade': 'a b' is no name"),
            (
                "a,p_x,bits,16,1,offer",
                "column 'sensor': there is no sensor 'p_x'; there are: p_a_1",
            ),
            ("a,p_a_1,bit,16,1,offer", "p_a_1 has no parameter 'bit'; it has: full_scale_pa, "),
            ("a,p_a_1,noise_sigma,-1,1,offer", "column 'value': '-1' is out of range: 0 … "),
            ("a,p_a_1,bits,16,free,offer", "column 'cost': 'free' is out of range: 0 … "),
            ("a,p_a_1,bits,16,1,", "column 'source': a cost needs its source"),
        ];
        for (row, message) in cases {
            let error = read(row).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
