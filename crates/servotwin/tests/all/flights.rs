//! The twin at work, on a study small enough for a test: flights, what is learned in them, and what
//! is said and done.

use crate::folder::Folder as Scratch;
use servotwin::flight::unseen_faults::{self, UnseenFaultMetrics};
use servotwin::job::{Crew, Job};
use servotwin::job::{Folder, JobError};
use servotwin::learn::model_file::write_model;
use servotwin::learn::training_windows::LeftOut;
use servotwin::live::closed_loop::{self, ClosedLoop, FlightRecord};
use servotwin::measure;
use servotwin::measure::flights::{FlightGroup, FlightMetrics};
use servotwin::measure::outcome::{Needed, RunOutcome};
use servotwin::measure::unseen;
use servotwin::parallel::Workers;
use servotwin::run::other_plant::OtherPlants;
use servotwin::run::part::PARTS;
use servotwin::run::{Observer, RunError, Runner, plan};
use servotwin::signal::Signal;
use servotwin::signal::bus::sent;
use servotwin::study::suites::{
    HARD_NEGATIVES, HEALTHY, JUDGE, LEARN, OTHER_STRUCTURE, OTHER_STRUCTURE_FITTED, UNSEEN,
};
use servotwin::study::{Scenario, Study, Suite};
use servotwin::table::Table;
use servotwin_diagnosis::diagnoser::{Diagnoser, Session};
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// What follows the beginning that all tiny studies have.
const STUDY: &str = r#"
[[classes]]
detail = "control_valve"
action = "shut_down"
faults = ["servo_valve.bias_positive", "servo_valve.bias_negative"]
[[classes]]
detail = "cylinder_pressure_sensor"
action = "change_mode"
faults = ["sensor_pressure_a.bias_positive"]
[[classes]]
detail = "valve_displacement_sensor"
action = "warning"
faults = ["sensor_spool.bias_positive"]
[realistic]
healthy = 2
[flights]
duration_s = 5
onset_s = [1.5, 2]
windows_s = [0.5]
commands = ["noise:rms={2..4}deg,bandwidth={0.5..1}Hz,seed={n}"]
inputs.load_factor = [0.5, 1]
[suites]
learn = { environments = 3, repeats = 3, healthy = 2 }
hard_negatives = { environments = 4, healthy_duration_s = 10 }
held_out = { environments = 3 }
judge = { environments = 2, repeats = 1, healthy = 1, healthy_duration_s = 20 }
unseen = { repeats = 1 }
[reactions]
shut_down = { switches_off = true, actuator_inputs = { mode = 0 } }
"#;

pub fn study() -> &'static Study {
    static MADE: OnceLock<Study> = OnceLock::new();
    let head = include_str!("../tiny.toml").replace("[0.4, 0.6, 0.8, 1.0]", "[0.6, 1.0]");
    MADE.get_or_init(|| Study::parse(&format!("{head}{STUDY}"), "tiny.toml").unwrap())
}

fn learned(folder: &Scratch, scenario: Scenario, threads: usize) -> Diagnoser {
    job(study(), &Folder::new(&folder.0), threads).learn(scenario).unwrap()
}

fn job<'j>(study: &'j Study, folder: &'j Folder, threads: usize) -> Job<'j> {
    Job { crew: Crew::quiet(Workers::new(threads)), ..Job::new(study, folder) }
}

pub fn diagnoser() -> &'static Arc<Diagnoser> {
    static MADE: OnceLock<Arc<Diagnoser>> = OnceLock::new();
    MADE.get_or_init(|| Arc::new(learned(&Scratch::new("learned"), Scenario::Noise, 2)))
}

fn suite(name: &str) -> &'static Suite {
    study().suite(name).unwrap()
}

/// The outcomes of a suite, watched by the diagnoser.
fn outcomes(name: &str, threads: usize) -> Vec<RunOutcome> {
    let scratch = Scratch::new(&format!("outcomes-{name}-{threads}"));
    let folder = Folder::new(&scratch.0);
    write_model(folder.diagnoser(Scenario::Noise), &**diagnoser()).unwrap();
    job(study(), &folder, threads).fly(suite(name), Scenario::Noise).unwrap().outcomes
}

fn measured(rows: &[RunOutcome]) -> FlightMetrics {
    let [suite, scenario, missing] = [JUDGE, "noise", ""].map(String::from);
    FlightMetrics::of(study(), FlightGroup { suite, scenario, missing }, 1.0, rows)
}

#[test]
fn all_actions_that_switch_off_are_judged_together() {
    let watched = outcomes(JUDGE, 2);
    let judged = |off: &[&str]| {
        let needs_shutdown = |row: &RunOutcome| off.contains(&row.action.as_str());
        let rows = watched
            .iter()
            .map(|row| RunOutcome { needs_shutdown: needs_shutdown(row), ..row.clone() });
        let rows: Vec<RunOutcome> = rows.collect();
        let metrics = measured(&rows);
        [
            metrics.rates.of(&measure::ISOLATED_IN_TIME).of,
            metrics.rates.of(&measure::VISIBLE_IN_TIME).count,
        ]
    };
    let [one, other] = ["shut_down", "change_mode"].map(|action| judged(&[action]));
    assert!(one[0] > 0 && other[0] > 0, "{one:?} {other:?}");
    let sum: Vec<u64> = one.iter().zip(other).map(|(one, other)| one + other).collect();
    assert_eq!(judged(&["shut_down", "change_mode"])[..], sum);
}

fn text(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap()
}

#[test]
fn threads_do_not_change_what_is_learned_nor_what_is_measured() {
    assert!(
        text(&learned(&Scratch::new("alone"), Scenario::Noise, 1)) == text(&**diagnoser()),
        "another diagnoser"
    );
    let [one, two] = [1, 2].map(|threads| text(&measured(&outcomes(JUDGE, threads))));
    assert_eq!(one, two);
    assert_eq!(text(&outcomes(UNSEEN, 1)), text(&outcomes(UNSEEN, 2)));
}

#[test]
fn a_diagnoser_states_the_healthy_flights_behind_its_margin() {
    let evidence = diagnoser().healthy_evidence.unwrap();
    assert_eq!((evidence.learned, evidence.held_out), (7, 3));
    assert!(evidence.largest <= diagnoser().tuning.pending_share, "{evidence:?}");
    assert_eq!(evidence.scatter, 1.5);
    let wider = diagnoser().with_shutdown_margin(2.0);
    let limits = [&**diagnoser(), &wider].map(|d| d.limits_of(&d.lengths[0]));
    let added = limits[1].allowances_nats().iter().zip(limits[0].allowances_nats());
    let added: Vec<f64> = added.map(|(wider, usual)| wider - usual).collect();
    let grown: Vec<usize> = (0..added.len()).filter(|&place| added[place] != 0.0).collect();
    assert!(
        grown.iter().all(|&place| (added[place] - 2.0).abs() < 1e-12) && !grown.is_empty(),
        "{added:?}"
    );
    let hypotheses = (added.len() as f64).sqrt() as usize;
    assert!(grown.iter().all(|place| place % hypotheses == 0), "only against health: {grown:?}");
}

/// What a session sees: for each full window the samples so far, the length and the bits of its values.
struct Seen {
    session: Session,
    windows: BTreeMap<(usize, usize), Vec<u64>>,
    onset: usize,
}

impl Observer for Seen {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        self.session.push(inputs, measured, twin);
        for (length, known) in self.session.diagnoser().lengths.iter().enumerate() {
            // In training, the baseline follows until the onset; in a session, until the fault is suspected.
            let is_same = known.baseline_corrected.is_none() || index < self.onset;
            if self.session.is_full(length) && is_same {
                let values = self.session.window(length).to_values();
                let bits = values.into_iter().map(f64::to_bits).collect();
                self.windows.insert((index + 1, length), bits);
            }
        }
    }
}

#[test]
fn the_windows_that_teach_are_those_that_a_session_sees_to_the_bit() {
    for scenario in [Scenario::Noise, Scenario::Realistic] {
        let folder = Scratch::new("seen");
        let diagnoser = Arc::new(learned(&folder, scenario, 2));
        let (suite, plants) = (suite(LEARN), (scenario, None));
        let runs = plan::runs(study(), suite, &(0..suite.environments));
        let flown = Runner::new(study(), suite, plants, runs, Workers::new(2)).unwrap();
        let mut seen = BTreeMap::new();
        flown.fly(
            |flight| Seen {
                session: Session::new(diagnoser.clone()).unwrap().at_rest(),
                windows: BTreeMap::new(),
                onset: (flight.onset_s / study().sample_period_s) as usize,
            },
            |flight, own, _| {
                seen.insert(flight.number as u32, own.windows);
            },
        );
        let part = format!("{PARTS}/windows-learn-{}-0000.parquet", scenario.name());
        let taken = Table::read(folder.0.join(part)).unwrap();
        let whole = |name: &str| taken.u32(name).unwrap();
        let (flights, kinds, at) = (whole("flight"), whole("kind"), whole("at_samples"));
        let values = |row: usize| -> Vec<u64> {
            let columns = taken.columns().iter().filter(|column| column.name.starts_with("w:"));
            columns.map(|column| column.numbers().unwrap()[row].to_bits()).collect()
        };
        let mut compared = vec![0; diagnoser.lengths.len()];
        for row in 0..taken.row_count() {
            let place = (at[row] as usize, kinds[row] as usize);
            let Some(own) = seen[&flights[row]].get(&place) else { continue };
            assert_eq!(values(row), *own, "{scenario:?} {place:?}");
            compared[place.1] += 1;
        }
        assert!(compared.iter().all(|&count| count > 10), "{scenario:?} {compared:?}");
    }
}

#[test]
fn hard_negatives_change_what_health_looks_like_and_no_band() {
    let text =
        STUDY.replace("hard_negatives = { environments = 4", "hard_negatives = { environments = 0");
    let head = include_str!("../tiny.toml").replace("[0.4, 0.6, 0.8, 1.0]", "[0.6, 1.0]");
    let few = Study::parse(&format!("{head}{text}"), "tiny.toml").unwrap();
    let folder =
        Folder::new(std::env::temp_dir().join(format!("servotwin-few-{}", std::process::id())));
    std::fs::create_dir_all(folder.path()).unwrap();
    let without = job(&few, &folder, 2).learn(Scenario::Noise).unwrap();
    std::fs::remove_dir_all(folder.path()).unwrap();
    let [with, without] = [&**diagnoser(), &without].map(|diagnoser| &diagnoser.lengths[0].panel);
    assert_eq!(with.bands, without.bands);
    assert!(with.committee != without.committee);
}

/// The content of the parts of a suite in a folder.
fn parts_of(folder: &Folder, suite: &str) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = std::fs::read_dir(folder.path().join(PARTS)).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let is_own = |path: &PathBuf| path.to_string_lossy().contains(suite);
    paths.filter(is_own).map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

#[test]
fn parts_that_are_lost_or_damaged_are_flown_again_to_the_same_bytes() {
    let folder = Scratch::new("parts");
    let results = Folder::new(&folder.0);
    let (job, scenario) = (job(study(), &results, 2), Scenario::Noise);
    // Hard negatives need the windows of all flights to learn from.
    let fly = |name: &str| {
        let tasks = job.tasks(&[name.into()], |own| own == scenario).unwrap();
        assert_eq!(tasks.len(), 1);
        job.run(&tasks)
    };
    let unfinished = fly(HARD_NEGATIVES);
    assert!(matches!(unfinished, Err(JobError::Run(RunError::Unfinished { .. }))));
    fly(LEARN).unwrap();
    let found = job.learn(scenario).unwrap();
    assert!(text(&found) == text(&**diagnoser()));
    let left_out = std::fs::read_to_string(results.left_out(scenario)).unwrap();
    assert_eq!(serde_json::from_str::<LeftOut>(&left_out).unwrap(), LeftOut::default());
    job.fly(suite(JUDGE), scenario).unwrap();
    let joined = || std::fs::read(results.outcomes(JUDGE, "noise")).unwrap();
    let (before, whole) = (joined(), parts_of(&results, "-noise-"));
    assert_eq!(whole.len(), 3, "learn, hard negatives, judge");
    for (path, content) in &whole {
        std::fs::write(path, &content[..content.len() / 2]).unwrap();
    }
    job.learn(scenario).unwrap();
    job.fly(suite(JUDGE), scenario).unwrap();
    assert!(parts_of(&results, "-noise-") == whole && joined() == before);
}

#[test]
#[ignore = "slow: ./check --all"]
fn shares_of_a_suite_join_to_the_bytes_of_an_undivided_one() {
    let (alone, shared) = (Scratch::new("alone"), Scratch::new("shared"));
    let scenario = Scenario::Noise;
    let many = suite(HEALTHY).clone().with_environments(300);
    let [alone, shared] = [&alone, &shared].map(|folder| Folder::new(&folder.0));
    for folder in [&alone, &shared] {
        write_model(folder.diagnoser(scenario), &**diagnoser()).unwrap();
    }
    job(study(), &alone, 2).fly(&many, scenario).unwrap();
    let changed = [many.clone()];
    let job = Job { changed: &changed, ..job(study(), &shared, 2) };
    let mut tasks = job.tasks(&[HEALTHY.into()], |own| own == scenario).unwrap();
    tasks.reverse();
    job.run(&tasks).unwrap();
    assert!(tasks.len() > 1 && parts_of(&shared, "healthy").len() == tasks.len());
    job.fly(&many, scenario).unwrap();
    let joined = |folder: &Folder| std::fs::read(folder.outcomes(HEALTHY, "noise")).unwrap();
    assert!(joined(&alone) == joined(&shared));
}

#[test]
fn environments_take_turns_between_the_phases_of_a_flight() {
    let study = Study::default();
    let suite = study.suite(JUDGE).unwrap();
    const COMMANDS: usize = 6;
    let place = |name: &str| {
        study.system.network().inputs.iter().position(|input| input.id == name).unwrap()
    };
    let [speed, altitude] = ["air_speed", "altitude"].map(place);
    let bounds =
        [([0.0, 110.0], [0.0, 3e3]), ([100.0, 170.0], [0.0, 9e3]), ([160.0, 240.0], [7e3, 12e3])];
    let environments = study.environments(suite, 0..6 * COMMANDS).unwrap();
    for (number, environment) in environments.iter().enumerate() {
        let (of_speed, of_altitude) = bounds[number / COMMANDS % bounds.len()];
        for ([low, high], input) in [(of_speed, speed), (of_altitude, altitude)] {
            let value = environment.inputs[input].value(0.0);
            assert!((low..=high).contains(&value), "{number}: {value} in {low} … {high}");
        }
    }
    // What a suite says itself replaces the phases.
    let own = "[suites]\ncold = { environments = 9, healthy = 1, inputs.air_speed = [20, 30] }\n";
    let text = include_str!("../../../../studies/paper.toml").replace("[suites]\n", own);
    let cold = Study::parse(&text, "cold.toml").unwrap();
    let suite = cold.suite("cold").unwrap();
    for environment in cold.environments(suite, 0..9).unwrap() {
        assert!((20.0..=30.0).contains(&environment.inputs[speed].value(0.0)));
    }
}

#[test]
fn faults_in_flights_are_found_and_healthy_flights_raise_nothing() {
    let metrics = measured(&outcomes(JUDGE, 2));
    assert_eq!((metrics.failed, metrics.flights), (0, 16));
    let wrong = metrics.rates.of(&measure::WRONG_SHUTDOWN);
    assert_eq!((metrics.healthy.alarms, wrong.count, wrong.of), (0, 0, 16));
    let shut_down = metrics.classes.iter().find(|class| class.action == "shut_down").unwrap();
    let visible = shut_down.rates.of(&measure::VISIBLE);
    assert_eq!(visible.count, visible.of);
    assert!(shut_down.rates.of(&measure::RIGHT_ACTION).count > 0, "{shut_down:?}");
}

#[test]
fn faults_never_trained_on_are_counted_once_each() {
    let metrics = UnseenFaultMetrics::of(UNSEEN, "noise", &outcomes(UNSEEN, 2));
    // The study has no sensor of the supply pressure, and so no fault of one that needs it.
    assert!(metrics.faults.len() < unseen_faults::ALL.len() && !metrics.faults.is_empty());
    // Behind a wrong boundary sensor the actuator is healthy: its shutdowns are a figure of their own.
    for fault in &metrics.faults {
        let is_told_wrong = fault.title.contains("pressure at the twin is");
        let behind = fault.rates.counted(&unseen::SHUTDOWN_MISINFORMED);
        assert_eq!(behind.map(|rate| rate.of), is_told_wrong.then_some(fault.flights), "{fault:?}");
        assert!(!is_told_wrong || fault.count(&unseen::SHUTDOWN_AT_FAULT) == 0, "{fault:?}");
    }
    let behind = metrics.rates.of(&unseen::SHUTDOWN_MISINFORMED);
    assert!(behind.count <= behind.of && behind.of > 0, "{behind:?}");
    for fault in &metrics.faults {
        let said: u64 = unseen::ANSWERS.iter().map(|answer| fault.count(answer)).sum();
        assert_eq!(said, fault.flights, "{}", fault.title);
        let responses = [unseen::RIGHT_RESPONSE, unseen::OTHER_RESPONSE, unseen::NO_RESPONSE];
        let responses: u64 = responses.iter().map(|response| fault.count(response)).sum();
        assert_eq!(responses, fault.flights, "{}", fault.title);
    }
    for set in &metrics.sets {
        let titles = unseen_faults::ALL.iter().filter(|fault| fault.set == set.title);
        let titles: Vec<&str> = titles.map(|fault| fault.title).collect();
        let own = || metrics.faults.iter().filter(|o| titles.contains(&o.title.as_str()));
        assert_eq!(set.flights, own().map(|o| o.flights).sum::<u64>(), "{}", set.title);
        let missed = set.rates.of(&unseen::NEVER_SHUT_DOWN);
        assert_eq!(
            missed.of - missed.count,
            own()
                .filter(|o| o.needed == Some(Needed::Shutdown))
                .map(|o| o.count(&unseen::SHUTDOWN_AT_FAULT))
                .sum::<u64>(),
            "{}",
            set.title
        );
    }
    let intermittent = metrics.sets.iter().find(|set| set.title == "intermittent").unwrap();
    assert!(
        intermittent.count(&unseen::RIGHT_RESPONSE) > 0 && intermittent.latency.is_some(),
        "{intermittent:?}"
    );
    let of = |title: &str| metrics.faults.iter().find(|fault| fault.title == title).unwrap();
    let missing = of("no reading of a pressure sensor");
    assert_eq!(missing.count(&unseen::SAID_NO_DATA), missing.flights);
    let untold = of("the command at the twin is missing");
    assert_eq!(untold.count(&unseen::SAID_INPUT_INVALID), untold.flights);
    // Both actuators deviate alike, and neither is at fault.
    assert_eq!(of("the command at the twin freezes").count(&unseen::SHUTDOWN_HEALTHY), 0);
    let jam = of("spool jams where it is");
    assert!(jam.count(&unseen::SAID_HEALTHY) < jam.flights, "{jam:?}");
}

/// The tiny study with a section `[flights.other_plant]` and specimens that draw.
fn with_other_plant(section: &str) -> Study {
    let head = include_str!("../tiny.toml").replace("[0.4, 0.6, 0.8, 1.0]", "[0.6, 1.0]");
    let other = format!("[flights.other_plant]\n{section}\n[reactions]");
    Study::parse(&format!("{head}{}", STUDY.replace("[reactions]", &other)), "tiny.toml").unwrap()
}

/// The samples of a flight, one after the other: measured values and the twin's.
#[derive(Default)]
struct Samples(Vec<f64>, Vec<f64>);

impl Observer for Samples {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        self.0.extend_from_slice(measured);
        self.1.extend_from_slice(twin);
    }
}

/// Flies a fault and a healthy flight; with the plants of a section if there is one.
fn samples(section: Option<&str>) -> Vec<Samples> {
    let study = with_other_plant(section.unwrap_or_default());
    let suite = study.suite(OTHER_STRUCTURE).unwrap();
    let plants = OtherPlants::of(&study, suite).unwrap().filter(|_| section.is_some());
    let all = 0..suite.environments;
    let mut runs = plan::runs(&study, suite, &all);
    let last = runs.len() - 1;
    runs.retain(|run| [0, last].contains(&run.number));
    let (plants, workers) = ((Scenario::Realistic, plants.as_ref()), Workers::new(2));
    let flown = Runner::new(&study, suite, plants, runs, workers).unwrap();
    let mut found = vec![];
    flown.fly(
        |_| Samples::default(),
        |flight, samples, outcome| {
            outcome.unwrap();
            found.push((flight.number, samples));
        },
    );
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, samples)| samples).collect()
}

#[test]
fn plants_without_a_difference_are_those_of_the_twins_system() {
    let (own, same) = (samples(None), samples(Some("")));
    for (own, same) in own.iter().zip(&same) {
        assert!(own.0 == same.0 && own.1 == same.1 && !own.0.is_empty());
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn every_difference_moves_the_plant_and_never_its_twin() {
    let own = samples(None);
    let differences = [
        r#"kinds = { "cylinder" = "bristle_cylinder" }"#,
        r#"kinds = { "sensor_pressure_a" = "tapped_pressure_sensor" }"#,
        "latency_s = [0.01, 0.01]",
        r#"draws = [{ parameters = ["supply.temperature_k"], plus = [-10, -10] }]"#,
        r#"draws = [{ parameters = ["supply.bulk_modulus_factor"], times = [0.8, 0.8] }]"#,
        r#"draws = [{ parameters = ["air.hinge_moment_deflection_per_rad"], times = [1.1, 1.1] }]"#,
    ];
    for section in differences {
        let other = samples(Some(section));
        for (own, other) in own.iter().zip(&other) {
            assert!(own.1 == other.1, "{section}: another twin");
            let moved = own.0.iter().zip(&other.0).filter(|(a, b)| a != b).count();
            assert!(moved > own.0.len() / 20, "{section}: {moved} of {}", own.0.len());
        }
    }
}

/// A healthy flight of a plant with another hinge moment, beside a nominal twin or one that is fitted to it: the mean of
/// the squared residuals, in scales.
fn left_beside(is_fitted: bool) -> f64 {
    let draw = |range: &str| {
        format!(
            "draws = [{{ parameters = [\"air.hinge_moment_deflection_per_rad\"], times = {range} }}]"
        )
    };
    let head = include_str!("../tiny.toml").replace("[0.4, 0.6, 0.8, 1.0]", "[0.6, 1.0]");
    let flights = format!("{}\nonset_s", draw("[0.6, 1.6]"));
    let other = format!("[flights.other_plant]\n{}\n[reactions]", draw("[1.4, 1.4]"));
    let tolerant = "[realistic]\ntolerances = [\
                    { parameters = [\"cylinder.coulomb_friction_n\"], sigma = 0.05 }]";
    let rest = STUDY.replace("onset_s", &flights).replace("[reactions]", &other);
    let rest = rest.replace("[realistic]", tolerant);
    let fitted = "[fitted]\ncommand = \"noise:rms=4deg,bandwidth=1Hz,seed=9\"\nduration_s = 12\n\
                  judge = 4\nlearn = 4\nin_each_case = 2\n";
    let study = Study::parse(&format!("{head}{rest}{fitted}"), "tiny.toml").unwrap();
    let name = if is_fitted { OTHER_STRUCTURE_FITTED } else { OTHER_STRUCTURE };
    let suite = study.suite(name).unwrap();
    let (plants, all) = (OtherPlants::of(&study, suite).unwrap(), 0..suite.environments);
    let mut runs = plan::runs(&study, suite, &all);
    let healthy = runs.iter().rposition(|run| run.fault.is_none()).unwrap();
    runs.retain(|run| run.number == healthy);
    let (plants, workers) = ((Scenario::Realistic, plants.as_ref()), Workers::new(2));
    let flown = Runner::new(&study, suite, plants, runs, workers).unwrap();
    if let Some(records) = flown.calibration {
        assert_eq!((records.flown, records.rejected), (1, 0));
    }
    let mut left = 0.0;
    let observer = |_: &_| Samples::default();
    flown.fly(observer, |_, Samples(measured, twin), outcome| {
        outcome.unwrap();
        let sensors = &study.measured[..study.base_sensors()];
        let scale = |n: usize| study.system.sensors[sensors[n % sensors.len()]].scale;
        let pairs = measured.iter().zip(&twin).enumerate().skip(100 * sensors.len());
        let squares = pairs.map(|(n, (a, b))| ((a - b) / scale(n)).powi(2));
        left = squares.sum::<f64>() / measured.len() as f64;
    });
    left
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_twin_that_is_fitted_to_another_plant_leaves_less() {
    let [nominal, fitted] = [false, true].map(left_beside);
    println!("mean square {nominal:.3e}, beside a fitted twin {fitted:.3e}");
    assert!(fitted < 0.6 * nominal, "{fitted} {nominal}");
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_study_judges_other_plants_and_learns_nothing_from_them() {
    let study = with_other_plant("kinds = { \"cylinder\" = \"bristle_cylinder\" }");
    let path = std::env::temp_dir().join(format!("servotwin-other-{}", std::process::id()));
    std::fs::create_dir_all(&path).unwrap();
    let folder = Folder::new(&path);
    let results = job(&study, &folder, 2).fly_all(&[Scenario::Realistic]).unwrap();
    let taught = std::fs::read(folder.diagnoser(Scenario::Realistic)).unwrap();
    let other = results.of_suite(OTHER_STRUCTURE).next().unwrap();
    assert_eq!((other.group.scenario.as_str(), other.flights, other.failed), ("realistic", 16, 0));
    assert_eq!(other.rates.of(&measure::FALSE_ALARM).of, 2);
    let judged: Vec<_> = results.judged().collect();
    assert_eq!(judged.len(), 1, "it is no further scenario");
    assert!(text(&other.classes) != text(&judged[0].classes));
    // Without such plants the diagnoser is the same.
    job(self::study(), &folder, 2).learn(Scenario::Realistic).unwrap();
    assert!(taught == std::fs::read(folder.diagnoser(Scenario::Realistic)).unwrap());
    std::fs::remove_dir_all(&path).unwrap();
}

/// Flies for 8 s with a lively command.
pub fn fly(faults: Vec<(f64, FaultAt)>) -> FlightRecord {
    let study = study();
    let (duration_s, network) = (8.0, study.system.network());
    let signal: Signal = "noise:rms=3deg,bandwidth=0.8Hz,seed=9".parse().unwrap();
    let command = signal.build(network.inputs[study.command_input].unit, duration_s).unwrap();
    let constant = |value: f64| Piecewise::constant(value).unwrap();
    let mut inputs: Vec<Piecewise> = network.inputs.iter().map(|i| constant(i.default)).collect();
    inputs[study.command_input] =
        sent(|time_s| command.value(time_s), study.sample_period_s, duration_s).unwrap();
    let scenario = ClosedLoop { study, inputs, faults, duration_s, specimen: None, reacts: true };
    closed_loop::fly(&scenario, diagnoser(), &[]).unwrap()
}

pub fn fault(id: &str) -> FaultAt {
    let (component, fault) = study().system.program.find_fault(id).unwrap();
    FaultAt { component, fault, intensity: 1.0 }
}

#[test]
fn nothing_is_done_about_a_healthy_flight() {
    let record = fly(vec![]);
    assert!(record.actions.is_empty(), "{:?}", record.actions);
    assert_eq!(record.time_s.len(), 401);
}

#[test]
fn a_strong_fault_is_switched_off_and_the_other_actuator_never_is() {
    let second = "actuator_2.servo_valve.bias_negative";
    // By itself the second fault would be switched off, too.
    let alone = fly(vec![(2.0, fault(second))]);
    let off = |record: &FlightRecord| {
        let off = record.actions.iter().filter(|action| action.reaction.switches_off);
        off.map(|action| action.raised.actuator).collect::<Vec<_>>()
    };
    assert_eq!(off(&alone), [1]);
    let both =
        fly(vec![(2.0, fault("actuator_1.servo_valve.bias_positive")), (5.0, fault(second))]);
    assert_eq!(off(&both), [0]);
    assert!(both.actions[0].time_s > 2.0 && both.actions[0].time_s < 4.0);
}
