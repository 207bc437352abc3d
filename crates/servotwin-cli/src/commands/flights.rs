//! `servotwin flights`: trains and evaluates the diagnosis in operation in many flights.

use super::StudyOptions;
use super::evaluate::workers;
use super::progress::Stages;
use crate::failure::Failure;
use crate::render::json;
use crate::{Global, stop};
use serde_json::json;
use servotwin::evaluation::metrics::Rate;
use servotwin::flight::fitted_twins::CalibrationRecords;
use servotwin::flight::healthy::HealthyPlants;
use servotwin::flight::judge::FlightMetrics;
use servotwin::flight::unseen_faults::{UnseenFaultOutcome, set_names};
use servotwin::job::flights::{self, Crew, FlightResults, settings};
use servotwin::job::healthy::{self, HealthyRun};
use servotwin::job::sealed::OpeningRecord;
use servotwin::job::{Folder, manifest};
use servotwin::study::flights::MAX_HEALTHY;
use servotwin::study::{Flights, HealthyDraw, Setting, Study};
use servotwin_report::lines;
use servotwin_report::vocabulary::Vocabulary;
use servotwin_report::words::{by_environment_and_tail, rate};
use std::fmt::Write;

/// Train the diagnosis on flights in which faults begin, and measure how fast and how reliable it is.
///
/// Writes `diagnoser-<scenario>.json`, which `servotwin watch` and `servotwin fly` read, and `flights.json` into the
/// output folder.
#[derive(clap::Args)]
pub struct Options {
    #[command(flatten)]
    study: StudyOptions,
    /// Run only this scenario. The results of the other scenario stay if its flights had the same sizes.
    #[arg(long, value_name = "SETTING", value_parser = ["noise", "realistic"])]
    setting: Option<String>,
    /// Only measure the cost of losing a sensor. The diagnosers in the folder judge the same flights again, once
    /// without each sensor. Writes `missing_sensors.json`.
    #[arg(long)]
    missing_sensors: bool,
    /// Judge the diagnosers in the folder in sealed environments: drawn with a seed that no study file can declare. Learns
    /// nothing. Every opening adds a line to sealed/openings.csv of the repository, or to sealed-openings.csv in the
    /// output folder, before the first flight. Writes `flights-sealed.json`.
    #[arg(long, conflicts_with = "missing_sensors")]
    sealed: bool,
    /// Only fly these challenge sets with the diagnosers in the folder: faults that training does not contain, separated
    /// by commas, or `all`. Writes `challenge_sets.json`.
    #[arg(long, value_name = "SETS", value_delimiter = ',', conflicts_with_all = ["missing_sensors", "sealed", "healthy"],
          value_parser = challenge_names())]
    challenge: Vec<String>,
    /// Only fly this many healthy flights with the diagnosers in the folder, each in an environment of its own, and bound
    /// the rate of false alarms by environment. With --other-plant, in the plants of `[flights.other_plant]`. An
    /// interrupted run goes on where it was last stored. Writes `outcomes-healthy-<scenario>.parquet`.
    #[arg(long, value_name = "FLIGHTS", conflicts_with_all = ["missing_sensors", "sealed"],
          value_parser = clap::value_parser!(u32).range(1..=MAX_HEALTHY as i64))]
    healthy: Option<u32>,
    /// Seed of the environments of `--healthy`, 0 to 999.
    #[arg(long, value_name = "SEED", default_value_t = 0, requires = "healthy",
          value_parser = clap::value_parser!(u64).range(0..=999))]
    seed: u64,
    /// Only judge the diagnoser of the scenario `realistic` in the folder, in the plants of `[flights.other_plant]`.
    #[arg(long, conflicts_with_all = ["missing_sensors", "setting", "sealed", "challenge"])]
    other_plant: bool,
    /// With --other-plant, fit the twin of every plant to its calibration flight first.
    #[arg(long, requires = "other_plant", conflicts_with = "healthy")]
    fitted: bool,
}

/// The values of `--challenge`.
fn challenge_names() -> Vec<&'static str> {
    [set_names(), vec![ALL_SETS]].concat()
}

/// Stands for all challenge sets.
const ALL_SETS: &str = "all";

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let (study, is_full) = (options.study.read(global)?, options.study.full);
    let sizes = if is_full { study.full_flights()? } else { study.flights()? };
    let Some(sizes) = sizes else { return Err(no_flights(&study)?) };
    let named =
        |setting: &Setting| options.setting.as_ref().is_none_or(|name| name == setting.name());
    let settings: Vec<Setting> = settings(&study).into_iter().filter(named).collect();
    if settings.is_empty() {
        return Err(Failure::Options("the study has no [realistic] for that setting"));
    }
    stop::heed();
    let folder = Folder::new(&options.study.out);
    let _hold = options.study.keep(&study, global)?;
    let threads = options.study.threads;
    let words = Vocabulary::of(&study);
    if options.missing_sensors {
        let merits = with_crew(threads, global, |crew| {
            flights::without_sensors(&folder, &study, &sizes, &settings, crew)
        })?;
        manifest::write(&folder, &study)?;
        return Ok(match global {
            Global { json: true, .. } => json(&json!(merits)),
            Global { quiet: true, .. } => String::new(),
            _ => merits.iter().fold(String::new(), |mut text, merit| {
                scenario(&mut text, merit, &words);
                text
            }),
        });
    }
    if !options.challenge.is_empty() {
        return challenge(options, (&study, &sizes), &settings, global);
    }
    if options.sealed {
        return sealed(options, &study, &settings, global);
    }
    if let Some(count) = options.healthy {
        return healthy(options, &study, (&settings, count as usize), global);
    }
    if options.other_plant {
        return other_plant(options, (&study, &sizes), global);
    }
    let results = with_crew(threads, global, |crew| {
        flights::fly_all(&folder, &study, &sizes, &settings, is_full, crew)
    })?;
    manifest::write(&folder, &study)?;
    Ok(match global {
        Global { json: true, .. } => json(&json!(results)),
        Global { quiet: true, .. } => String::new(),
        _ => text(&results, &study, &words),
    })
}

/// Flies challenge sets with the stored diagnosers.
fn challenge(
    options: &Options,
    (study, sizes): (&Study, &Flights),
    settings: &[Setting],
    global: Global,
) -> Result<String, Failure> {
    let folder = Folder::new(&options.study.out);
    let is_chosen =
        |set: &&str| options.challenge.iter().any(|name| name == set || name == ALL_SETS);
    let sets: Vec<&str> = set_names().into_iter().filter(is_chosen).collect();
    let metrics = with_crew(options.study.threads, global, |crew| {
        flights::fly_challenge_sets(&folder, study, sizes, settings, &sets, crew)
    })?;
    manifest::write(&folder, study)?;
    if metrics.iter().all(|metrics| metrics.sets.is_empty()) {
        return Err(Failure::Options(
            "no fault of these sets fits the study, or its [flights] judge none (foreign = 0)",
        ));
    }
    let (mut text, words) = (String::new(), Vocabulary::of(study));
    for metrics in &metrics {
        let _ = writeln!(text, "{}", metrics.setting);
        for set in &metrics.sets {
            let _ = writeln!(text, "  {}", challenge_line(set, &words));
        }
    }
    Ok(match global {
        Global { json: true, .. } => json(&json!(metrics)),
        Global { quiet: true, .. } => String::new(),
        _ => text,
    })
}

/// Judges the stored diagnosers in sealed environments.
fn sealed(
    options: &Options,
    study: &Study,
    settings: &[Setting],
    global: Global,
) -> Result<String, Failure> {
    let (folder, is_full) = (Folder::new(&options.study.out), options.study.full);
    let here = std::env::current_dir().unwrap_or_default();
    let record = OpeningRecord::find(&here, folder.path());
    let sealed = with_crew(options.study.threads, global, |crew| {
        flights::fly_sealed(&folder, study, settings, is_full, &record, crew)
    })?;
    manifest::write(&folder, study)?;
    Ok(match global {
        Global { json: true, .. } => json(&json!(sealed)),
        Global { quiet: true, .. } => String::new(),
        _ => {
            let text = text(&sealed.results, study, &Vocabulary::of(study));
            let recorded = format!("Recorded in {}.", record.path().display());
            format!("{}\n{recorded}\n{text}", sealed.in_words(None))
        }
    })
}

/// Flies healthy flights of the stored diagnosers, each in an environment of its own.
fn healthy(
    options: &Options,
    study: &Study,
    (settings, count): (&[Setting], usize),
    global: Global,
) -> Result<String, Failure> {
    let folder = Folder::new(&options.study.out);
    let draw = HealthyDraw { seed: options.seed, is_full: options.study.full };
    let plants: Vec<HealthyPlants> = match options.other_plant {
        true if study.other_plant()?.is_none() => return Err(no_other_plant()),
        true => vec![HealthyPlants::Other],
        false => settings.iter().copied().map(HealthyPlants::Of).collect(),
    };
    let runs = with_crew(options.study.threads, global, |crew| {
        let fly = |plants| healthy::fly(&folder, study, plants, (count, draw), crew).transpose();
        plants.into_iter().filter_map(fly).collect::<Result<Vec<_>, _>>()
    })?;
    manifest::write(&folder, study)?;
    Ok(match global {
        Global { json: true, .. } => json(&json!(runs.iter().map(to_json).collect::<Vec<_>>())),
        Global { quiet: true, .. } => String::new(),
        _ => runs.iter().map(of_healthy).collect(),
    })
}

fn to_json(run: &HealthyRun) -> serde_json::Value {
    json!({
        "setting": run.setting,
        "seed": run.seed,
        "duration_s": run.duration_s,
        "flown": run.outcomes.len(),
        "failed": run.failed(),
        "summary": run.summary(),
    })
}

/// Describes the healthy flights of a scenario.
fn of_healthy(run: &HealthyRun) -> String {
    let HealthyRun { setting, seed, duration_s, outcomes, .. } = run;
    let (flown, failed, summary) = (outcomes.len(), run.failed(), run.summary());
    let mut out = format!(
        "{setting}: {flown} healthy flights of {duration_s} s, each in an environment of its own (seed {seed}), \
         {failed} not finished; {:.1} h\n",
        summary.hours
    );
    for line in by_environment_and_tail(&summary) {
        let _ = writeln!(out, "  {line}");
    }
    out
}

fn no_other_plant() -> Failure {
    Failure::Options(
        "the study has no [flights.other_plant]: docs/study-format.md describes this section",
    )
}

/// Judges the stored diagnoser in plants that differ from their twin in structure.
fn other_plant(
    options: &Options,
    (study, sizes): (&Study, &Flights),
    global: Global,
) -> Result<String, Failure> {
    let (folder, is_full) = (Folder::new(&options.study.out), options.study.full);
    let (mut text, words) = (String::new(), Vocabulary::of(study));
    let value = if options.fitted {
        let judged = with_crew(options.study.threads, global, |crew| {
            flights::fly_fitted_other_plant(&folder, study, sizes, is_full, crew)
        })?;
        let judged = judged.ok_or_else(no_other_plant)?;
        scenario(&mut text, &judged.merit, &words);
        text += &fitted_plants(&judged.calibration);
        json!(judged)
    } else {
        let merit = with_crew(options.study.threads, global, |crew| {
            flights::fly_other_plant(&folder, study, sizes, is_full, crew)
        })?;
        let merit = merit.ok_or_else(no_other_plant)?;
        scenario(&mut text, &merit, &words);
        json!(merit)
    };
    manifest::write(&folder, study)?;
    Ok(match global {
        Global { json: true, .. } => json(&value),
        Global { quiet: true, .. } => String::new(),
        _ => text,
    })
}

/// Why a study has no flights of the requested sizes.
pub fn no_flights(study: &Study) -> Result<Failure, Failure> {
    Ok(Failure::Options(match study.flights()? {
        Some(_) => "the [flights] of the study have no full sizes, which --full asks for",
        None => "the study has no [flights]: docs/study-format.md describes this section",
    }))
}

/// Runs work with threads and its progress on a terminal. Ctrl-C stops it.
pub fn with_crew<T, E>(
    threads: Option<usize>,
    global: Global,
    work: impl FnOnce(&Crew) -> Result<T, E>,
) -> Result<T, Failure>
where
    Failure: From<E>,
{
    let stages = Stages::in_lines(global);
    let crew =
        Crew { workers: workers(threads), progress: &|what, share| stages.show(what, share) };
    let done = work(&crew);
    stages.end();
    stop::check()?;
    Ok(done?)
}

/// Describes the results for readers; the report has the details.
fn text(results: &FlightResults, study: &Study, words: &Vocabulary) -> String {
    let mut out = format!(
        "summary, of all {}s with a fault, whether a sensor shows it or not\n",
        words.run()
    );
    for merit in results.merits.iter().chain(results.of_other_plants()) {
        scenario(&mut out, merit, words);
    }
    if let Some(ranges) = lines::flown_ranges(study) {
        let _ = writeln!(out, "  flown: {ranges}");
    }
    out + "\nEvery flight is a row of the files outcomes-*.parquet; 'servotwin report' shows more.\n"
}

/// What a scenario shows, over all faults and intensities.
fn scenario(out: &mut String, merit: &FlightMetrics, words: &Vocabulary) {
    let FlightMetrics { setting, flights, failed, .. } = merit;
    let run = words.run();
    let _ = writeln!(out, "  {setting}: {flights} {run}s with a fault, {failed} not finished");
    let rates = lines::in_flight(merit, words);
    let of_rate = |(title, own): (String, Rate)| {
        format!("{title} {} ({} of {})", rate(Some(own)), own.count, own.of)
    };
    let rates: Vec<String> = rates.into_iter().map(of_rate).collect();
    let _ = writeln!(out, "    {}", rates.join("; "));
    let _ = writeln!(out, "    false alarms {}", lines::alarms_in_words(&merit.healthy));
    if let Some(line) = merit.without_steady_state() {
        let _ = writeln!(out, "    {line}");
    }
}

/// Describes the flights beside twins that are fitted to plants of another structure.
fn fitted_plants(calibration: &CalibrationRecords) -> String {
    let CalibrationRecords { flown, rejected, with_findings } = calibration;
    format!(
        "  of {flown} twins {rejected} stayed nominal, because their records were rejected; {with_findings} fits left \
         a deviation\n"
    )
}

/// Describes the flights of a challenge set in a line.
fn challenge_line(set: &UnseenFaultOutcome, words: &Vocabulary) -> String {
    let UnseenFaultOutcome { title, flights, right_action, other_action, .. } = set;
    let [need, missed] = set.missed_shutdowns;
    let wrong = match words.has_several() {
        true => format!(", shutdowns of a healthy {} {}", words.unit(), set.wrong_shutdowns()),
        false => String::new(),
    };
    let latency = set.latency.as_ref().map_or(String::new(), |latency| {
        format!("; right action after median {:.2} s, p95 {:.2} s", latency.median_s, latency.p95_s)
    });
    format!(
        "challenge {title}: of {flights} flights ({} failed) {right_action} right action first, {other_action} other action \
         first, {} no action; missed shutdowns {missed} of {need}{wrong}, false alarms before the onset {}{latency}",
        set.failed,
        set.without_action(),
        set.false_alarms,
    )
}
