//! The logs and streams that a page shows.

use super::super::progress::Stages;
use super::super::warn;
use super::super::watch::input::{usual_diagnoser, warn_of_lacking};
use super::{Options, diagnoser};
use crate::failure::Failure;
use crate::{Global, stop};
use servotwin::study::{Scenario, Study};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_serve::measured::Log;
use servotwin_serve::{LiveSource, Measured, SavedSession, ServeError, Stream};
use servotwin_watch::End;
use servotwin_watch::guard::{self, accepted_ranges, needed};
use servotwin_watch::map::Map;
use servotwin_watch::source::{Address, Source as Rows};
use servotwin_watch::watchdog::WatchdogRules;
use std::sync::Arc;

/// A source that can be read.
struct Opened {
    address: Address,
    map: Map,
    rows: Box<dyn Rows>,
}

/// Opens all sources. A log is read to its end first, so that its replay can jump.
pub(crate) fn open<'s>(
    options: &Options,
    study: &'s Study,
    global: Global,
) -> Result<Vec<Box<dyn LiveSource + 's>>, Failure> {
    let opened = |source: &String| -> Result<Opened, Failure> {
        let address = options.input.address(source)?;
        let (map, rows) = options.input.open(&address, study, options.study.is_named(), global)?;
        Ok(Opened { address, map, rows })
    };
    // A source that cannot be opened fails before training takes its time.
    let opened = options.source.iter().map(opened).collect::<Result<Vec<_>, _>>()?;
    let diagnoser = diagnoser(options, study, Scenario::Realistic, global)?;
    opened.into_iter().map(|opened| source(options, study, opened, &diagnoser, global)).collect()
}

fn source<'s>(
    options: &Options,
    study: &'s Study,
    Opened { address, map, mut rows }: Opened,
    diagnoser: &Arc<Diagnoser>,
    global: Global,
) -> Result<Box<dyn LiveSource + 's>, Failure> {
    warn_of_lacking(&map, &needed(diagnoser, &study.system), global);
    let measured = Measured {
        title: format!("{}: {address}", study.system.title),
        study,
        diagnoser: diagnoser.clone(),
        map,
        accepted_ranges: accepted_ranges(diagnoser, &study.system),
    };
    if address.is_live() {
        let silence = WatchdogRules::of_period(diagnoser.period_s);
        return Ok(Box::new(Stream::new(measured, rows, silence)));
    }
    let path = options.input.model.clone().unwrap_or_else(usual_diagnoser);
    options.input.try_log(&address, &measured.map, study, (&path, diagnoser), global)?;
    Ok(Box::new(log(&address, &measured, &mut *rows, global)?))
}

/// Reads a log.
fn log(
    address: &Address,
    measured: &Measured,
    rows: &mut dyn Rows,
    global: Global,
) -> Result<SavedSession, Failure> {
    let stages = Stages::new(global);
    let mut show = |_: f64, share: Option<f64>| {
        stages.show(&format!("reading {address}"), share.unwrap_or(0.0));
    };
    let log = measured.read(rows, stop::flag(), &mut show);
    stages.end();
    let Log { session, end, counts } = log.map_err(ServeError::from)?;
    if end == End::Stopped {
        return Err(Failure::stopped());
    }
    if counts.samples == 0 {
        return Err(Failure::input(format!(
            "{address}: {}",
            guard::nothing(&measured.map, &counts)
        )));
    }
    if end == End::Contradicted {
        let text = "it contradicts its map, and is shown up to there; servotwin watch reports why";
        warn(global, &[format!("{address}: {text}")]);
    }
    if counts.judged == 0 {
        warn(global, &[format!("{address}: nothing could be judged; servotwin watch reports why")]);
    }
    let too_long =
        "the log has too many events for one page: show a part of it with --from and --to";
    session.ok_or_else(|| Failure::usage(too_long))
}
