//! The logs and streams that a page shows.

use super::super::progress::Stages;
use super::super::warn;
use super::super::watch::input::{accepted_ranges, needed, nothing, warn_of_lacking};
use super::{Options, diagnoser};
use crate::failure::Failure;
use crate::{Global, stop};
use servotwin::study::{Setting, Study};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_serve::measured::Log;
use servotwin_serve::{Measured, ServeError, Source, Stream};
use servotwin_watch::End;
use servotwin_watch::source::Address;
use servotwin_watch::watchdog::WatchdogRules;
use std::sync::Arc;

/// Opens all sources. A log is read to its end first, so that its replay can jump.
pub fn open<'s>(
    options: &Options,
    study: &'s Study,
    global: Global,
) -> Result<Vec<Box<dyn Source + 's>>, Failure> {
    let addresses = options.source.iter().map(|source| options.input.address(source));
    let addresses = addresses.collect::<Result<Vec<_>, _>>()?;
    // All sources are found before training takes its time.
    let diagnoser = diagnoser(options, study, Setting::Realistic, global)?;
    let one = |address: &Address| source(options, study, (address, &diagnoser), global);
    addresses.iter().map(one).collect()
}

fn source<'s>(
    options: &Options,
    study: &'s Study,
    (address, diagnoser): (&Address, &Arc<Diagnoser>),
    global: Global,
) -> Result<Box<dyn Source + 's>, Failure> {
    let is_study_named = options.study.is_named();
    let (map, mut rows) = options.input.open(address, study, is_study_named, global)?;
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
    let stages = Stages::new(global);
    let mut show = |_: f64, share: Option<f64>| {
        stages.show(&format!("reading {address}"), share.unwrap_or(0.0));
    };
    let log = measured.read(&mut *rows, stop::flag(), &mut show);
    stages.end();
    let Log { session, end, counts } = log.map_err(ServeError::from)?;
    if end == End::Stopped {
        return Err(Failure::Stopped);
    }
    if counts.samples == 0 {
        return Err(nothing(address, &counts));
    }
    if counts.judged == 0 {
        warn(global, &[format!("{address}: nothing could be judged; servotwin watch says why")]);
    }
    let too_long =
        "the log has too many events for one page: show a part of it with --from and --to";
    Ok(Box::new(session.ok_or(Failure::Options(too_long))?))
}
