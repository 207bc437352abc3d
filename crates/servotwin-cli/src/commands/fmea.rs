//! `servotwin fmea`: fills an FMEA from the results of a study.

use super::{learned, note, workers};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run, stop};
use servotwin::files::create_folder;
use servotwin::job::{Among, Folder};
use servotwin::study::{Scenario, Study};
use servotwin_safety::fmea::fields::{FIELDS, FmeaSources};
use servotwin_safety::fmea::sheet::{self, FmeaSheet};
use servotwin_safety::fmea::{self, WeightedCoverage, weighted_coverage};
use servotwin_safety::results::{FOLDER, StudyResultsFolder};
use servotwin_view::document::{Document, Value, Verdict, line};
use std::path::{Path, PathBuf};

/// Fill an FMEA (failure mode and effects analysis) from the results of a study.
///
/// The sheet has one row for every fault that the system can have. Every filled cell names its evidence: a file and
/// its runs, or a figure. A cell without evidence names what is missing. Every fault of the system is flown in closed
/// loop with the diagnosis and without it: the suite effects, whose flights outcomes-effects-SCENARIO.parquet stores.
/// If the diagnoser is missing, the command learns it first. Edit the sheet freely: cells that you fill in stay when
/// the command runs again, and it marks their rows as stale when the system, the study or the models change. With a
/// study instead of a folder, the sheet holds declarations only.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of a study, a study file, or the name of a built-in study.
    #[arg(value_name = "STUDY", default_value = "out")]
    input: PathBuf,
    /// The sheet, .csv [default: safety/fmea.csv in the output folder, fmea.csv without one].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// A table of failure rates: fault, rate, unit, source ('servotwin fault-tree --template FILE' writes one).
    #[arg(long, value_name = "FILE")]
    rates: Option<PathBuf>,
    /// The scenario whose results are quoted: ideal, noise, fitted or realistic [default: the most realistic one].
    #[arg(long, value_name = "SCENARIO", value_parser = super::scenario())]
    scenario: Option<Scenario>,
    /// Fly nothing; use stored flights as they are.
    #[arg(long)]
    no_flights: bool,
    /// Number of threads [default: all processors; the sheet does not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

impl Run for Options {
    // The command also reads the sheet that it writes. The formats of a sheet are checked with a message of their own.
    fn paths(&self) -> Paths {
        let paths = Paths::default().read("--rates", &self.rates);
        paths.write("--out", Format::Any, &self.out)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        self.out.iter().try_for_each(|path| sheet::check(path))?;
        stop::heed();
        match self.input.is_dir() {
            true => of_folder(self, global),
            false => of_study(self),
        }
    }
}

fn of_folder(options: &Options, global: Global) -> Result<Document, Failure> {
    let folder = Folder::new(&options.input);
    let mut results = StudyResultsFolder::open(folder.clone(), options.scenario)?;
    let _hold = folder.hold(Among::Nobody)?;
    if !options.no_flights
        && !fmea::can_fly(&results)
        && let Ok(scenario) = results.flown_setting()
    {
        if results.study.flights.is_none() {
            note(global, "not flown: the study has no [flights] to learn a diagnoser from");
        } else {
            learned((&folder, &results.study), scenario, options.threads, global)?;
            // The basis names the diagnoser, too.
            results = StudyResultsFolder::open(folder.clone(), options.scenario)?;
        }
    }
    let rates = options.rates.as_deref();
    let sources = fmea::sources(&results, rates, !options.no_flights, workers(options.threads))?;
    stop::check()?;
    let default = folder.path().join(FOLDER).join("fmea.csv");
    write(options, &sources, &default)
}

fn of_study(options: &Options) -> Result<Document, Failure> {
    if options.scenario.is_some() {
        return Err(Failure::usage("--scenario is for folders with results"));
    }
    let study = Study::read(&options.input)?;
    let sources = fmea::declared_sources(&study, options.rates.as_deref())?;
    write(options, &sources, Path::new("fmea.csv"))
}

fn write(options: &Options, sources: &FmeaSources, default: &Path) -> Result<Document, Failure> {
    let path = options.out.as_deref().unwrap_or(default);
    let earlier = Some(path).filter(|path| path.exists());
    let sheet = fmea::sheet(sources, earlier)?;
    if options.out.is_none()
        && let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty())
    {
        create_folder(folder)?;
    }
    sheet.write(path)?;
    Ok(summary(path, &sheet, sources))
}

/// What the sheet holds.
fn summary(path: &Path, sheet: &FmeaSheet, sources: &FmeaSources) -> Document {
    let cells = sheet.rows.iter().flat_map(|row| &row.texts);
    let filled = cells.filter(|text| !text.is_empty()).count();
    let without_evidence: usize = sheet.rows.iter().map(|row| row.missing).sum();
    let verdict = line(
        "{sheet}: {rows} faults, {fields} fields: {cells_filled} cells filled, {cells_without_evidence} without evidence, \
         {cells_by_person} filled in by people, {rows_stale} rows stale",
        [
            ("sheet", path.into()),
            ("rows", sheet.rows.len().into()),
            ("fields", FIELDS.len().into()),
            ("cells_filled", (filled - without_evidence).into()),
            ("cells_without_evidence", without_evidence.into()),
            ("cells_by_person", sheet.person_cells().into()),
            ("rows_stale", sheet.stale_rows().into()),
        ],
    );
    let mut document = Document::new("fmea", Verdict::neutral(verdict));
    let coverage = weighted_coverage(sources).map(|WeightedCoverage { share, flown, rated }| {
        let text = format!("{:.1} % ({flown} of {rated} rated faults flown)", 100.0 * share);
        Value::number(share, text)
    });
    document.fact(
        "diagnostic_coverage",
        "diagnostic coverage, weighted by failure rates",
        coverage,
    );
    document
}
