//! `servotwin campaign`: every fault of a study under every operating case,
//! into a data set.

use super::StudyOptions;
use super::progress::is_shown;
use crate::failure::Failure;
use crate::{Global, stop};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use servotwin::job::{Folder, manifest};
use servotwin::study::campaign::{Campaign, Outcome};
use servotwin::study::{Setting, Study};
use servotwin_model::solver::Settings;
use std::time::Instant;

/// Simulate every fault of a study under every operating case, into a data set.
///
/// A campaign that was interrupted goes on where it was: shards that are
/// complete are taken over, and the result is the same bytes.
#[derive(clap::Args)]
pub struct Options {
    #[command(flatten)]
    study: StudyOptions,
    /// Only perfect sensors and a plant that is the twin (ideal), or only noise,
    /// quantisation and tolerances (realistic) [default: both].
    #[arg(long, value_parser = ["ideal", "realistic"])]
    setting: Option<String>,
    /// Write the time series of every variant, too (gigabytes).
    #[arg(long)]
    keep_traces: bool,
    /// Simulate also the variants that are mirror images of others (ideal
    /// setting, two units alike), whose rows are otherwise reflected.
    #[arg(long)]
    all: bool,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let study = options.study.read()?;
    stop::listen();
    let wanted = |setting: &Setting| {
        let named = options.setting.as_deref().is_none_or(|name| name == setting.name());
        named
            && (*setting == Setting::Ideal || study.realism.is_some() || options.setting.is_some())
    };
    let folder = Folder::new(&options.study.out);
    folder.keep_study(&study)?;
    let mut text = String::new();
    let mut results = Vec::new();
    for setting in Setting::ALL.into_iter().filter(wanted) {
        let begin = Instant::now();
        let campaign = Campaign {
            keep_traces: options.keep_traces,
            simulate_images: options.all,
            ..campaign(&study, setting, &folder, options.study.threads)
        };
        let outcome = simulate(&campaign, global)?;
        let seconds = begin.elapsed().as_secs_f64();
        text.push_str(&describe(&study, setting, &outcome, seconds));
        results.push(to_json(setting, &outcome));
    }
    manifest::write(&folder, &study)?;
    Ok(match global {
        Global { json: true, .. } => crate::render::json(&json!(results)),
        Global { quiet: true, .. } => String::new(),
        _ => text,
    })
}

/// A campaign that Ctrl-C stops.
pub fn campaign<'s>(
    study: &'s Study,
    setting: Setting,
    folder: &Folder,
    threads: Option<usize>,
) -> Campaign<'s> {
    let processors = std::thread::available_parallelism().map_or(1, |n| n.get());
    Campaign {
        study,
        setting,
        settings: Settings::campaign(),
        threads: threads.unwrap_or(processors).max(1),
        folder: folder.path().into(),
        keep_traces: false,
        simulate_images: false,
        cancel: Some(stop::flag()),
    }
}

/// Runs a campaign, with its progress on a terminal.
pub fn simulate(campaign: &Campaign, global: Global) -> Result<Outcome, Failure> {
    let bar = bar(campaign.setting, global);
    let (_, outcome) = campaign.run(|done, all| {
        bar.update(|state| {
            state.set_len(all as u64);
            state.set_pos(done as u64);
        });
    })?;
    bar.finish_and_clear();
    if outcome.cancelled { Err(Failure::Stopped) } else { Ok(outcome) }
}

fn bar(setting: Setting, global: Global) -> ProgressBar {
    if !is_shown(global) {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} variants, {eta} left");
    ProgressBar::no_length()
        .with_style(style.expect("a correct template"))
        .with_message(format!("simulating, {}:", setting.name()))
}

/// What a campaign has done, for people.
pub fn describe(study: &Study, setting: Setting, outcome: &Outcome, seconds: f64) -> String {
    let ran = outcome.variants - outcome.resumed;
    let mut text = format!(
        "{}, {}: {} variants of {} s, {ran} of them now in {seconds:.1} s; {} failed\n",
        study.name,
        setting.name(),
        outcome.variants,
        study.duration_s,
        outcome.failed.len()
    );
    if outcome.images > 0 {
        text.push_str(&format!(
            "  {} of them are mirror images of simulated ones (--all simulates them)\n",
            outcome.images
        ));
    }
    for (variant, reason) in &outcome.failed {
        text.push_str(&format!("  variant {variant}: {reason}\n"));
    }
    text
}

fn to_json(setting: Setting, outcome: &Outcome) -> serde_json::Value {
    let failed = outcome.failed.iter();
    json!({
        "setting": setting.name(),
        "variants": outcome.variants,
        "resumed": outcome.resumed,
        "images": outcome.images,
        "steps": outcome.statistics.steps,
        "rejected": outcome.statistics.rejected,
        "jacobians": outcome.statistics.jacobians,
        "failed": failed.map(|(v, r)| json!({"variant": v, "reason": r})).collect::<Vec<_>>(),
    })
}
