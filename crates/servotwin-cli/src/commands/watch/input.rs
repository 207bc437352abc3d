//! What is watched: a source, its map, and the twin with its diagnosis. Shared by the commands that watch.

use crate::Global;
use crate::commands::{SpanOptions, diagnoser_at_hand, note, warn};
use crate::failure::Failure;
use servotwin::job::{Folder, flights};
use servotwin::live::watcher::Watcher;
use servotwin::moment;
use servotwin::study::{Scenario, Study};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_watch::guard::{self, LogPlan, Opened, Trial};
use servotwin_watch::intake;
use servotwin_watch::map::Map;
use servotwin_watch::source::{Address, Source};
use servotwin_watch::span::LogSpan;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a source is read and judged.
#[derive(clap::Args, Clone)]
pub(crate) struct InputOptions {
    /// The diagnoser, a file written by `servotwin study --suite flights` [default: out/diagnoser-realistic.json, or
    /// for the built-in aileron the one that comes with the program].
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// The map file, which assigns columns to signals.
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    #[command(flatten)]
    span: SpanOptions,
}

/// The path of a source that is a file.
pub(crate) fn log_of(source: &str) -> Option<PathBuf> {
    match Address::parse(source) {
        Ok(Address::File(path)) => Some(path),
        _ => None,
    }
}

impl InputOptions {
    /// Opens a source, or the part of it that the options name, with the map of its columns. `is_study_named` states
    /// whether the user named the study.
    pub(crate) fn open(
        &self,
        address: &Address,
        study: &Study,
        is_study_named: bool,
        global: Global,
    ) -> Result<(Map, Box<dyn Source>), Failure> {
        let map = self.map(address, study, is_study_named, global)?;
        let source = self.rows(address, &map)?;
        Ok((map, source))
    }

    fn rows(&self, address: &Address, map: &Map) -> Result<Box<dyn Source>, Failure> {
        let opened = intake::open(address, map, self.span(address)?);
        opened.map_err(|error| Failure::of_intake(&address.to_string(), error))
    }

    /// Tries the first minute of a log with its map, and refuses one that contradicts it, before anything is judged.
    pub(crate) fn try_log(
        &self,
        address: &Address,
        map: &Map,
        study: &Study,
        (path, diagnoser): (&Path, &Arc<Diagnoser>),
        global: Global,
    ) -> Result<(), Failure> {
        let mut open = |map: &Map| -> Result<Opened, Failure> {
            Ok((self.rows(address, map)?, Box::new(observer(study, (path, diagnoser.clone()))?)))
        };
        let Trial { contradictions, zone_s } =
            guard::trial(&mut open, map, study, diagnoser.period_s)?;
        if let Some(zone_s) = zone_s {
            let zone = moment::zone_in_words(zone_s);
            note(
                global,
                &format!("times are on the clock of the log, {zone}, and so are --from and --to"),
            );
        }
        match contradictions.is_empty() {
            true => Ok(()),
            false => Err(Failure::input(format!("{address}: {}", contradictions.join("; ")))),
        }
    }

    /// The part of a file to read.
    fn span(&self, address: &Address) -> Result<LogSpan, Failure> {
        match address.is_live() && !self.span.is_whole() {
            true => Err(Failure::usage("--from and --to are for files: a live stream has no part")),
            false => self.span.read(),
        }
    }

    /// Reads the given map, or makes one from the names of the columns.
    fn map(
        &self,
        address: &Address,
        study: &Study,
        is_study_named: bool,
        global: Global,
    ) -> Result<Map, Failure> {
        let log = address.to_string();
        let refused = |error| Failure::of_intake(&log, error);
        if let Some(path) = &self.map {
            let map = Map::read(path, &study.system)?;
            let unmeasured: Vec<&str> = map.unmeasured().collect();
            if !unmeasured.is_empty() {
                note(global, &format!("without a column: {}", unmeasured.join(", ")));
            }
            // Columns that the map names are read without a header.
            let has_header = !address.is_live() && map.wanted().columns.is_empty();
            let columns = if has_header { address.columns()? } else { vec![] };
            guard::require(&log, &columns, &map, study).map_err(refused)?;
            return Ok(map);
        }
        if address.is_live() {
            return Err(Failure::usage(
                "a live stream needs --map FILE; --make-map FILE writes one",
            ));
        }
        let plan = guard::plan(&log, &address.columns()?, study, is_study_named);
        let LogPlan { map, warnings, notes } = plan.map_err(refused)?;
        tell(&warnings, &notes, global);
        Ok(map)
    }
}

/// Prints warnings and notes.
pub(crate) fn tell(warnings: &[String], notes: &[String], global: Global) {
    warn(global, warnings);
    notes.iter().for_each(|text| note(global, text));
}

/// Builds the twin and the diagnosis.
pub(crate) fn observer<'s>(
    study: &'s Study,
    (path, diagnoser): (&Path, Arc<Diagnoser>),
) -> Result<Watcher<'s>, Failure> {
    Watcher::new(study, diagnoser).map_err(|error| Failure::of_diagnoser(path, &error))
}

/// Warns of sensors that the diagnoser reads and the map lacks.
pub(crate) fn warn_of_lacking(map: &Map, needed: &[&str], global: Global) {
    let lacking: Vec<&str> = map.unmeasured().filter(|id| needed.contains(id)).collect();
    if !lacking.is_empty() {
        let lacking = lacking.join(", ");
        let text = format!(
            "less can be judged without {lacking}, which the diagnoser reads; a map file says which columns they are, \
             --make-map writes one"
        );
        warn(global, &[text]);
    }
}

/// The path of the default diagnoser.
pub(crate) fn usual_diagnoser() -> PathBuf {
    Folder::new("out").diagnoser(Scenario::Realistic)
}

/// The diagnoser of the default output folder. If it is missing, the built-in aileron has a shipped one.
pub(crate) fn diagnoser(study: &Study, global: Global) -> Result<Diagnoser, Failure> {
    let (folder, scenario) = (Folder::new("out"), Scenario::Realistic);
    match diagnoser_at_hand((&folder, study), scenario, true, global)? {
        Some(diagnoser) => Ok(diagnoser),
        None => Ok(flights::diagnoser(&folder, scenario)?),
    }
}
