//! `servotwin study --suite records`: simulates every fault of a study in every operating case, and writes data sets.

use super::progress::is_shown;
use super::study::Options;
use super::{flights, workers};
use crate::failure::Failure;
use crate::{Global, stop};
use indicatif::{ProgressBar, ProgressStyle};
use servotwin::campaign::{Campaign, CampaignError, CampaignOutcome, runs};
use servotwin::job::{data_card, manifest};
use servotwin::study::{Purpose, Scenario, Study};
use servotwin::toml_text::counted;
use servotwin_view::document::{Document, Line, Table, Value, Verdict, line};
use servotwin_view::row;
use std::time::Instant;

/// Simulates all records and writes the data sets, or a share of the parts.
pub(super) fn run(options: &Options, global: Global) -> Result<Document, Failure> {
    let place = &options.study;
    let study = place.read(global)?;
    stop::heed();
    let runs = chosen(&study, options.scenario.as_deref())?;
    if options.share.is_some() {
        let is_wanted = |scenario| runs.iter().any(|(_, own)| own.contains(&scenario));
        return flights::in_parts(options, (&study, &[]), is_wanted, global);
    }
    let folder = place.folder();
    let _hold = place.keep(&study, global)?;
    let mut table = Table::of(
        "scenarios: | training: | variants: | resumed: | steps: | rejected: | jacobians: | unsettled: | on_the_move:",
    );
    let (mut lines, mut failed) =
        (vec![], Table::of("scenario | variant | reason:not simulated to the end"));
    for (purpose, scenarios) in runs {
        let begin = Instant::now();
        let campaign = Campaign {
            keep_traces: options.keep_traces,
            workers: workers(place.threads),
            ..Campaign::new(folder.path(), &study, scenarios, purpose)
        };
        let outcome = simulate(&campaign, global)?;
        let seconds = begin.elapsed().as_secs_f64();
        lines.push(describe(&campaign, &outcome, seconds));
        table.push(counts(&campaign, &outcome));
        for (scenario, variant, reason) in &outcome.failed {
            failed.push(row![scenario.name(), *variant, reason]);
        }
    }
    data_card::write(&folder, &study)?;
    manifest::write(&folder, &study)?;
    let values = [("folder", folder.path().into()), ("failed", failed.rows.len().into())];
    let verdict = line("{folder}: the data sets are complete; {failed} rows failed.", values);
    let mut document = Document::new("records", Verdict::good(verdict));
    document.list("campaigns", lines);
    document.table("counts", table);
    document.table("failed", failed);
    Ok(document)
}

/// The campaigns of a study in a named scenario, or in the usual ones.
fn chosen(
    study: &Study,
    scenario: Option<&str>,
) -> Result<Vec<(Purpose, Vec<Scenario>)>, CampaignError> {
    let named = |candidate: Scenario| match scenario {
        Some(name) => name == candidate.name(),
        None => candidate.is_usual(),
    };
    let runs = runs(study, named);
    match Scenario::ALL.into_iter().find(|scenario| named(*scenario)) {
        // The study lacks a section that the named scenario needs.
        Some(scenario) if runs.is_empty() => Err(CampaignError::no_section(scenario, study)),
        _ => Ok(runs),
    }
}

/// Runs a campaign, with its progress on a terminal.
fn simulate(campaign: &Campaign, global: Global) -> Result<CampaignOutcome, Failure> {
    let bar = bar(&named(&campaign.scenarios, campaign.purpose), global);
    let outcome = campaign.run(|done, all| {
        bar.update(|state| {
            state.set_len(all as u64);
            state.set_pos(done as u64);
        });
    });
    bar.finish_and_clear();
    Ok(outcome?)
}

/// The progress bar of a campaign, in rows.
pub(super) fn bar(name: &str, global: Global) -> ProgressBar {
    if !is_shown(global) {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} rows, {eta} left");
    ProgressBar::no_length()
        .with_style(style.expect("a correct template"))
        .with_message(format!("simulating, {name}:"))
}

/// Describes a campaign by its scenarios and its purpose.
pub(super) fn named(scenarios: &[Scenario], purpose: Purpose) -> String {
    let names: Vec<&str> = scenarios.iter().map(|scenario| scenario.name()).collect();
    let training = if purpose == Purpose::Train { ", training commands" } else { "" };
    format!("{}{training}", names.join(" and "))
}

/// Describes the outcome of a campaign for readers.
pub(super) fn describe(campaign: &Campaign, outcome: &CampaignOutcome, seconds: f64) -> Line {
    let ran = outcome.variants - outcome.resumed;
    let mut text = format!(
        "{}, {}: {} rows of {} s, {ran} of them now in {seconds:.1} s; {} failed",
        campaign.study.name,
        named(&campaign.scenarios, campaign.purpose),
        outcome.variants,
        campaign.suite().duration_s,
        outcome.failed.len()
    );
    if outcome.on_the_move > 0 {
        text += &format!(
            "; {} began on the move, because no steady state was found: they teach no band, and manifest.json lists \
             them",
            counted(outcome.on_the_move, "variant")
        );
    }
    text.into()
}

fn counts(campaign: &Campaign, outcome: &CampaignOutcome) -> Vec<Value> {
    let CampaignOutcome { statistics, .. } = outcome;
    row![
        Value::list(campaign.scenarios.iter().map(|scenario| scenario.name())),
        campaign.purpose == Purpose::Train,
        outcome.variants,
        outcome.resumed,
        statistics.steps,
        statistics.rejected,
        statistics.jacobians,
        statistics.unsettled,
        outcome.on_the_move,
    ]
}
