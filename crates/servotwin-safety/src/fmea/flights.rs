//! Closed-loop flights as evidence: every fault of the study is flown with a flight control computer that reacts to the
//! diagnosis, and again with one that does not.
//!
//! The flights are stored in `safety/fmea-flights.csv` with the basis of their diagnoser, so a sheet is filled again
//! without flying. One healthy flight per file is the reference.

use super::fields::actuator_of;
use crate::error::SafetyError;
use crate::results::{EvidenceBasis, FOLDER, StudyResultsFolder};
use servotwin::files::create_folder;
use servotwin::flight::closed_loop::{self, ClosedLoop, FlightRecord};
use servotwin::flight::tracking::{TrackedQuantities, first_report_s};
use servotwin::job::flights::diagnoser;
use servotwin::parallel::{self, Workers};
use servotwin::study::Study;
use servotwin::table::{self, Column, Table, TableError};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::program::{FaultAt, Slot};
use std::path::Path;
use std::sync::Arc;

/// The file of the flights.
pub(crate) const FILE: &str = "fmea-flights.csv";

/// How every fault is flown.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FlightPlan {
    /// Intensities of each fault.
    pub intensities: Vec<f64>,
    /// When the fault begins, s.
    pub onset_s: f64,
    /// Duration of the flight, s.
    pub duration_s: f64,
}

impl FlightPlan {
    /// Half and full intensity, in flights as the study judges them: of their length, with an onset in the middle of
    /// their range.
    pub(crate) fn of(study: &Study) -> Self {
        let (duration_s, onset_s) = match &study.flights {
            Some(flights) => (flights.duration_s, flights.onset_s.iter().sum::<f64>() / 2.0),
            // The flight of `servotwin fly`.
            None => (20.0, 6.0),
        };
        FlightPlan { intensities: vec![0.5, 1.0], onset_s, duration_s }
    }
}

/// A flight of a fault with the diagnosis, and the same without it. Times count from the onset. NaN stands for what does
/// not exist: a time of something that did not happen, an error of a quantity that the system lacks.
#[derive(Debug, Clone, PartialEq)]
pub struct FlownFault {
    /// The fault, or `healthy`.
    pub fault: String,
    /// Its intensity; 0 without a fault.
    pub intensity: f64,
    /// The first report of a fault, s.
    pub report_s: f64,
    /// The first action after the onset, s.
    pub action_s: f64,
    /// That action with its actuator; empty without one.
    pub action: String,
    /// Whether it was the right action for the right actuator.
    pub is_right: bool,
    /// The actuators that were switched off, separated by spaces.
    pub lanes_off: String,
    /// Whether an action changed inputs or parameters.
    pub changes_mode: bool,
    /// Root mean square of the command since the onset, SI.
    pub command_rms: f64,
    /// Root mean square and largest tracking error without the diagnosis, SI.
    pub error_alone: [f64; 2],
    /// The same with the diagnosis.
    pub error_reacting: [f64; 2],
    /// Root mean square of the force fight without the diagnosis and with it, N.
    pub force_fight_n: [f64; 2],
    /// The largest difference of the faulty actuator's rod force from the healthy flight, without the diagnosis, N.
    pub force_difference_n: f64,
    /// The largest difference of its piston's position from the healthy flight, without the diagnosis, m.
    pub travel_difference_m: f64,
    /// Why the flight could not be simulated; empty otherwise.
    pub failure: String,
}

/// The flights of a folder.
#[derive(Debug, Clone, PartialEq)]
pub struct FmeaFlights {
    /// One entry per fault and intensity, the healthy flight first.
    pub list: Vec<FlownFault>,
    /// The operating case that was flown.
    pub case: String,
    /// The scenario of the diagnoser.
    pub scenario: String,
    /// What changed since the flights; `None` if they are of this model.
    pub stale: Option<String>,
}

/// The columns of numbers, in the order of [`numbers`].
const NUMBERS: [&str; 14] = [
    "intensity",
    "report_s",
    "action_s",
    "command_rms",
    "rms_error_alone",
    "largest_error_alone",
    "rms_error_reacting",
    "largest_error_reacting",
    "rms_force_fight_alone_n",
    "rms_force_fight_reacting_n",
    "largest_force_difference_n",
    "largest_travel_difference_m",
    "is_right",
    "changes_mode",
];

fn numbers(flown: &FlownFault) -> [f64; 14] {
    [
        flown.intensity,
        flown.report_s,
        flown.action_s,
        flown.command_rms,
        flown.error_alone[0],
        flown.error_alone[1],
        flown.error_reacting[0],
        flown.error_reacting[1],
        flown.force_fight_n[0],
        flown.force_fight_n[1],
        flown.force_difference_n,
        flown.travel_difference_m,
        f64::from(u8::from(flown.is_right)),
        f64::from(u8::from(flown.changes_mode)),
    ]
}

impl FmeaFlights {
    /// The rows of a fault, with their numbers in the file from 1.
    pub(crate) fn of(&self, fault: &str) -> Vec<(usize, &FlownFault)> {
        let numbered = self.list.iter().enumerate().map(|(place, flown)| (place + 1, flown));
        let own =
            |(_, flown): &(usize, &FlownFault)| flown.fault == fault && flown.failure.is_empty();
        numbered.filter(own).collect()
    }

    /// The healthy flight.
    pub(crate) fn healthy(&self) -> Option<&FlownFault> {
        self.list.first().filter(|flown| flown.intensity == 0.0)
    }

    /// Reads the stored flights of a folder; `None` without any in the quoted scenario.
    ///
    /// # Errors
    /// The file is damaged.
    pub(crate) fn read(results: &StudyResultsFolder) -> Result<Option<Self>, SafetyError> {
        let path = results.artefact(FILE);
        if !path.exists() {
            return Ok(None);
        }
        let table = Table::read(&path)?;
        let list = from_table(&table)?;
        let one = |name: &str| -> Result<String, TableError> {
            Ok(table.text(name)?.first().cloned().unwrap_or_default())
        };
        let stale = match EvidenceBasis::parse(&one("basis")?) {
            Some(basis) => results.basis.changes_since(&basis),
            None => Some("their model is not recorded".into()),
        };
        let scenario = one("scenario")?;
        let own = FmeaFlights { list, case: one("case")?, scenario, stale };
        Ok(Some(own).filter(|own| own.scenario == results.scenario.name()))
    }

    /// Whether all of these faults were flown, or tried.
    pub(crate) fn covers(&self, faults: &[String]) -> bool {
        faults.iter().all(|fault| self.list.iter().any(|flown| flown.fault == *fault))
    }

    /// Flies faults of the study's system and stores the flights.
    ///
    /// # Errors
    /// Nothing flies in the scenario; there is no diagnoser; the healthy flight cannot be simulated; the file cannot be written.
    pub(crate) fn fly(
        results: &StudyResultsFolder,
        plan: &FlightPlan,
        faults: &[String],
        workers: Workers,
    ) -> Result<Self, SafetyError> {
        let scenario = results.flown_setting()?;
        let diagnoser = Arc::new(diagnoser(&results.folder, scenario)?);
        let specimen = scenario.has_tolerances().then_some(0);
        let study = &results.study;
        let flying = FaultFlyer {
            study,
            plan,
            diagnoser,
            specimen,
            kept: TrackedQuantities::of(study),
            pistons: pistons(study),
        };
        let healthy = flying.fly(None, false).map_err(|error| SafetyError::Flight {
            fault: "healthy".into(),
            intensity: 0.0,
            error,
        })?;
        let faults: Vec<FlyingFault> =
            faults.iter().filter_map(|id| FlyingFault::of(study, id)).collect();
        let mut tasks: Vec<(Option<&FlyingFault>, f64)> = vec![(None, 0.0)];
        for fault in &faults {
            tasks.extend(plan.intensities.iter().map(|&intensity| (Some(fault), intensity)));
        }
        let flown = parallel::map(&tasks, workers, |&(fault, intensity)| {
            flying.both(fault, intensity, &healthy)
        });
        let list = flown.map_err(|_| SafetyError::Cancelled)?;
        let flights = FmeaFlights {
            list,
            case: study.cases[0].name.clone(),
            scenario: scenario.name().into(),
            stale: None,
        };
        create_folder(results.folder.path().join(FOLDER))?;
        flights.write(&results.artefact(FILE), &results.basis)?;
        Ok(flights)
    }

    fn write(&self, path: &Path, basis: &EvidenceBasis) -> Result<(), SafetyError> {
        let text = |name: &str, of: &dyn Fn(&FlownFault) -> String| {
            Column::new(name, "", self.list.iter().map(of).collect::<Vec<String>>())
        };
        let mut columns = vec![text("fault", &|flown| flown.fault.clone())];
        for (place, name) in NUMBERS.iter().enumerate() {
            let values: Vec<f64> = self.list.iter().map(|flown| numbers(flown)[place]).collect();
            columns.push(Column::new(*name, "", values));
        }
        columns.extend([
            text("action", &|flown| flown.action.clone()),
            text("lanes_off", &|flown| flown.lanes_off.clone()),
            text("failure", &|flown| flown.failure.clone()),
            text("case", &|_| self.case.clone()),
            text("scenario", &|_| self.scenario.clone()),
            text("basis", &|_| basis.in_words()),
        ]);
        Ok(table::write(path, &Table::from_columns(columns)?)?)
    }
}

fn from_table(table: &Table) -> Result<Vec<FlownFault>, TableError> {
    let columns: Vec<_> = NUMBERS.iter().map(|name| table.f64(name)).collect::<Result<_, _>>()?;
    let [fault, action, off, failure] = ["fault", "action", "lanes_off", "failure"];
    let (fault, action) = (table.text(fault)?, table.text(action)?);
    let (off, failure) = (table.text(off)?, table.text(failure)?);
    let flown = |row: usize| {
        let value = |place: usize| columns[place][row];
        FlownFault {
            fault: fault[row].clone(),
            intensity: value(0),
            report_s: value(1),
            action_s: value(2),
            command_rms: value(3),
            error_alone: [value(4), value(5)],
            error_reacting: [value(6), value(7)],
            force_fight_n: [value(8), value(9)],
            force_difference_n: value(10),
            travel_difference_m: value(11),
            is_right: value(12) > 0.5,
            changes_mode: value(13) > 0.5,
            action: action[row].clone(),
            lanes_off: off[row].clone(),
            failure: failure[row].clone(),
        }
    };
    Ok((0..table.row_count()).map(flown).collect())
}

/// A fault to be flown.
struct FlyingFault {
    id: String,
    at: FaultAt,
    /// Its actuator; for a shared component a name that no actuator has.
    unit: String,
    /// The right action; `None` if no class of the study lists the fault.
    action: Option<String>,
}

impl FlyingFault {
    fn of(study: &Study, id: &str) -> Option<Self> {
        let (component, fault) = study.system.program.find_fault(id)?;
        let case = study.faults.iter().find(|case| case.id == id);
        Some(FlyingFault {
            id: id.into(),
            at: FaultAt { component, fault, intensity: 1.0 },
            unit: actuator_of(study, id).unwrap_or("shared").into(),
            action: case.map(|case| study.classes[case.class].command.clone()),
        })
    }
}

struct FaultFlyer<'f> {
    study: &'f Study,
    plan: &'f FlightPlan,
    diagnoser: Arc<Diagnoser>,
    specimen: Option<usize>,
    kept: TrackedQuantities,
    /// For every actuator with a cylinder, its name and the slot of its piston's position; recorded behind `kept`.
    pistons: Vec<(String, Slot)>,
}

impl FaultFlyer<'_> {
    fn fly(
        &self,
        fault: Option<FaultAt>,
        reacts: bool,
    ) -> Result<FlightRecord, servotwin::flight::runtime::RuntimeError> {
        let flight = ClosedLoop {
            study: self.study,
            inputs: self.study.cases[0].inputs.clone(),
            faults: fault.map(|fault| (self.plan.onset_s, fault)).into_iter().collect(),
            duration_s: self.plan.duration_s,
            specimen: self.specimen,
            reacts,
        };
        let pistons = self.pistons.iter().map(|(_, slot)| *slot);
        let slots: Vec<Slot> = self.kept.slots.iter().copied().chain(pistons).collect();
        closed_loop::fly(&flight, &self.diagnoser, &slots)
    }

    fn both(
        &self,
        fault: Option<&FlyingFault>,
        intensity: f64,
        healthy: &FlightRecord,
    ) -> FlownFault {
        let at = fault.map(|fault| FaultAt { intensity, ..fault.at });
        let flown = self.fly(at, true).and_then(|with| Ok((with, self.fly(at, false)?)));
        let name = fault.map_or("healthy", |fault| fault.id.as_str());
        match flown {
            Ok((with, alone)) => self.measured(name, (fault, intensity), [&with, &alone], healthy),
            Err(error) => FlownFault {
                fault: name.into(),
                intensity,
                failure: error.to_string(),
                ..FlownFault::empty()
            },
        }
    }

    fn measured(
        &self,
        name: &str,
        (fault, intensity): (Option<&FlyingFault>, f64),
        [with, alone]: [&FlightRecord; 2],
        healthy: &FlightRecord,
    ) -> FlownFault {
        let since = with.time_s.iter().position(|time_s| *time_s >= self.plan.onset_s).unwrap_or(0);
        let error = |record| {
            let error = self.kept.tracking_error(self.study, record);
            error.map_or([f64::NAN; 2], |error| [rms(&error[since..]), largest(&error[since..])])
        };
        let fight = |record| {
            self.kept.force_fight(self.study, record).map_or(f64::NAN, |n| rms(&n[since..]))
        };
        let unit = fault.map(|fault| fault.unit.as_str());
        let action = with.actions.iter().find(|action| action.time_s >= self.plan.onset_s);
        let names = self.diagnoser.names();
        let actuator =
            |action: &closed_loop::Action| &names.actuators[action.raised.actuator as usize];
        let command = |action: &closed_loop::Action| &names.actions[action.raised.action as usize];
        let right = fault.and_then(|fault| fault.action.as_ref());
        let mut off: Vec<&str> = vec![];
        for action in with.actions.iter().filter(|action| action.reaction.switches_off) {
            if !off.contains(&actuator(action).as_str()) {
                off.push(actuator(action));
            }
        }
        let [force_difference_n, travel_difference_m] =
            self.differences(unit, alone, healthy, since);
        FlownFault {
            fault: name.into(),
            intensity,
            report_s: first_report_s(with, self.plan.onset_s)
                .map_or(f64::NAN, |s| s - self.plan.onset_s),
            action_s: action.map_or(f64::NAN, |action| action.time_s - self.plan.onset_s),
            action: action.map_or_else(String::new, |a| {
                format!("{} {}", command(a), actuator(a)).trim().into()
            }),
            is_right: action.is_some_and(|a| {
                unit.is_some_and(|unit| unit == actuator(a))
                    && right.is_some_and(|right| right == command(a))
            }),
            lanes_off: off
                .iter()
                .map(|name| if name.is_empty() { "all" } else { name })
                .collect::<Vec<_>>()
                .join(" "),
            changes_mode: with.actions.iter().any(|action| action.reaction.changes_mode()),
            command_rms: rms(&with.inputs[self.study.command_input][since..]),
            error_alone: error(alone),
            error_reacting: error(with),
            force_fight_n: [fight(alone), fight(with)],
            force_difference_n,
            travel_difference_m,
            failure: String::new(),
        }
    }

    /// The largest differences from the healthy flight: of the rod force, N, and of the piston's position, m.
    fn differences(
        &self,
        unit: Option<&str>,
        alone: &FlightRecord,
        healthy: &FlightRecord,
        since: usize,
    ) -> [f64; 2] {
        let force = |record| self.kept.rod_force(unit?, record);
        let piston = |record: &'_ FlightRecord| {
            let place = self.pistons.iter().position(|(of, _)| Some(of.as_str()) == unit)?;
            Some(record.plant[self.kept.slots.len() + place].clone())
        };
        let farthest = |with: &[f64], without: &[f64]| {
            let pairs = with.iter().zip(without).skip(since);
            pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
        };
        let of_force = force(alone).zip(force(healthy)).map(|(a, b)| farthest(a, b));
        let of_piston = piston(alone).zip(piston(healthy)).map(|(a, b)| farthest(&a, &b));
        [of_force, of_piston].map(|found| found.unwrap_or(f64::NAN))
    }
}

/// The position of the first cylinder of every actuator.
fn pistons(study: &Study) -> Vec<(String, Slot)> {
    let of_unit = |unit: &String| {
        let own = if unit.is_empty() { String::new() } else { format!("{unit}.") };
        let mut components = study.system.network().components.iter();
        let cylinder = components.find(|instance| {
            instance.id.starts_with(&own) && instance.component.spec().kind.contains("cylinder")
        })?;
        let name = format!("{}.position_m", cylinder.id);
        Some((unit.clone(), study.system.program.observable(&name)?.slot))
    };
    study.units.iter().filter_map(of_unit).collect()
}

impl FlownFault {
    /// Number of actuators that were switched off.
    pub(crate) fn lane_count(&self) -> usize {
        self.lanes_off.split_whitespace().count()
    }

    pub(super) fn empty() -> Self {
        FlownFault {
            fault: String::new(),
            intensity: 0.0,
            report_s: f64::NAN,
            action_s: f64::NAN,
            action: String::new(),
            is_right: false,
            lanes_off: String::new(),
            changes_mode: false,
            command_rms: f64::NAN,
            error_alone: [f64::NAN; 2],
            error_reacting: [f64::NAN; 2],
            force_fight_n: [f64::NAN; 2],
            force_difference_n: f64::NAN,
            travel_difference_m: f64::NAN,
            failure: String::new(),
        }
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}
