//! `servotwin study`: the main job, from nothing to a report.

use super::StudyOptions;
use super::campaign::{campaign, describe, simulate};
use super::evaluate::measure;
use super::flights::with_crew;
use super::progress::Notes;
use super::summary;
use crate::failure::Failure;
use crate::render::json;
use crate::{Global, stop};
use serde_json::json;
use servotwin::job::flights::settings;
use servotwin::job::{self, Folder, report};
use servotwin::study::Setting;
use servotwin::study::campaign::{CampaignError, runs};
use std::time::Instant;

/// Simulate a study, train and evaluate its diagnosis, and write the report.
///
/// Runs, one after the other, what `campaign`, `flights`, `train`, `evaluate` and `report` do
/// alone. An interrupted study goes on where it was; run again, it gives the same bytes.
#[derive(clap::Args)]
pub struct Options {
    #[command(flatten)]
    study: StudyOptions,
    /// Also the setting in which every specimen has a twin that was fitted to it in a calibration
    /// flight.
    #[arg(long)]
    fitted: bool,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let begin = Instant::now();
    let study = options.study.read(global)?;
    stop::heed();
    // What cannot be flown is told now, not after the campaigns.
    let flights = study.flights()?;
    if options.fitted && !Setting::Fitted.is_possible(&study) {
        return Err(CampaignError::no_section(Setting::Fitted, &study).into());
    }
    let wanted = |setting: Setting| setting.is_usual() || options.fitted;
    let folder = Folder::new(&options.study.out);
    let _hold = options.study.keep(&study, global)?;
    let flown = job::flights::results(&folder)?;
    let notes = Notes::new(global);
    for (role, settings) in runs(&study, wanted) {
        let begin = Instant::now();
        let campaign = campaign(&study, role, settings, &folder, options.study.threads);
        let outcome = simulate(&campaign, None, global)?;
        let seconds = begin.elapsed().as_secs_f64();
        notes.write(describe(&campaign, &outcome, seconds).trim_end());
    }
    stop::check()?;
    if flown.is_some_and(|results| results.is_full_of(&study)) {
        notes.write("kept what was measured in the full flights (without flights.json the small ones are flown)");
    } else if let Some(flights) = &flights {
        let flying = Instant::now();
        with_crew(options.study.threads, global, |crew| {
            job::flights::fly_all(&folder, &study, flights, &settings(&study), false, crew)
        })?;
        notes.write(&format!("flown in {:.1} s", flying.elapsed().as_secs_f64()));
    }
    let judging = Instant::now();
    let stage = job::train_and_evaluate_all;
    let results = measure(stage, &folder, &study, options.study.threads, global)?;
    notes.write(&format!("trained and evaluated in {:.1} s", judging.elapsed().as_secs_f64()));
    stop::check()?;
    report::write(&folder, &study)?;
    let path = folder.report().display().to_string();
    let seconds = begin.elapsed().as_secs_f64();
    Ok(match global {
        Global { json: true, .. } => json(&json!({
            "report": path,
            "evaluation": folder.results().display().to_string(),
            "manifest": folder.manifest().display().to_string(),
        })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{}\n{path}, after {seconds:.0} s\n", summary::text(&results, &study)),
    })
}
