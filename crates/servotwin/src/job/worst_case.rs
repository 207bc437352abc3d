//! Worst-case searches in an output folder. Their flights are rows of outcomes, those of each objective a suite.
//!
//! A search is deterministic, so an interrupted one is drawn again from its beginning, and stored flights stand in for
//! new ones where their points agree. Flights of the search are numbered from 0, random ones from [`MAX_RUNS`].

use super::flights::diagnoser;
use super::outcomes::{FlownSuite, stored};
use super::{Folder, Job, JobError};
use crate::flight::worst_case;
use crate::flight::worst_case::cross_entropy::{CrossEntropy, GENERATION};
use crate::flight::worst_case::space::{MAX_POINTS, SearchPoint, SearchSpace};
use crate::measure::outcome::RunOutcome;
use crate::run::RunName;
use crate::study::{Scenario, Stream, Suite};
use servotwin_diagnosis::diagnoser::Session;
use std::path::PathBuf;
use std::sync::Arc;

/// The largest number of flights of the search, and of random flights.
pub const MAX_RUNS: usize = MAX_POINTS / 2;

/// A search for an objective with the diagnoser of a scenario.
struct Search<'s> {
    job: Job<'s>,
    scenario: Scenario,
    space: &'s SearchSpace,
    suite: Suite,
    session: Session,
    path: PathBuf,
    /// The flights that are stored, whenever some are added.
    flown: FlownSuite,
}

impl Job<'_> {
    /// Flies `runs` points of a search and as many random ones. What the folder has stored of the same search is not flown
    /// again, and every generation is stored. Returns the flights of the search and the random ones.
    ///
    /// # Errors
    /// The diagnoser is missing; a twin cannot be simulated; the file cannot be read or written; or the run was cancelled.
    pub fn search(
        &self,
        (scenario, space): (Scenario, &SearchSpace),
        (seed, runs): (u64, usize),
    ) -> Result<[Vec<RunOutcome>; 2], JobError> {
        let Job { study, folder, .. } = *self;
        let suite = worst_case::suite(study, space, seed).ok_or(JobError::NoFlights)?;
        let new = FlownSuite::new(folder, study, &suite, scenario)?;
        let path = folder.outcomes(&suite.name, scenario.name());
        let known = stored(folder, &suite.name, scenario)?;
        let flown = known.filter(|own| own.origin() == new.origin()).unwrap_or(new);
        let session = session(folder, scenario)?;
        let mut search = Search { job: *self, scenario, space, suite, session, path, flown };
        let mut found = [vec![], vec![]];
        for (method, rows) in found.iter_mut().enumerate() {
            let random = search.suite.seed_of(method).stream(Stream::Search);
            let mut points = CrossEntropy::new(space, random);
            for first in (0..runs).step_by(GENERATION) {
                let what = ["search", "random flights"][method];
                self.tell(
                    &format!("{}: {what}", space.objective.name()),
                    first as f64 / runs as f64,
                );
                let numbers = first..runs.min(first + GENERATION);
                let numbers = numbers.map(|number| method * MAX_RUNS + number);
                let drawn: Vec<(u64, SearchPoint)> =
                    numbers.map(|number| (number as u64, points.draw(number))).collect();
                let flown = search.fly(&drawn)?;
                if method == 0 {
                    let ranks = flown.iter().map(|row| space.objective.rank(row));
                    points.learn(drawn.into_iter().map(|(_, point)| point).zip(ranks).collect());
                }
                rows.extend(flown);
            }
        }
        Ok(found)
    }

    /// Flies a stored flight of a search again with the diagnoser that the folder has now.
    ///
    /// # Errors
    /// [`JobError::NoRun`]; the diagnoser is missing; a twin cannot be simulated.
    pub fn fly_again(
        &self,
        name: &RunName,
        space: &SearchSpace,
    ) -> Result<Vec<RunOutcome>, JobError> {
        let Job { study, folder, crew, .. } = *self;
        let none = || JobError::NoRun { name: name.to_string() };
        let stored = stored(folder, &name.suite, name.scenario)?.ok_or_else(none)?;
        let mut rows = stored.outcomes.iter();
        let row = rows.find(|row| row.number == name.number as u64).ok_or_else(none)?;
        let point = (row.number, space.point_of(&row.point).ok_or_else(none)?);
        let suite = worst_case::suite(study, space, stored.seed).ok_or(JobError::NoFlights)?;
        let (place, session) = ((study, &suite, name.scenario), session(folder, name.scenario)?);
        Ok(worst_case::fly(space, place, &session, &[point], crew.workers)?)
    }
}

fn session(folder: &Folder, scenario: Scenario) -> Result<Session, JobError> {
    let session = Session::new(Arc::new(diagnoser(folder, scenario)?));
    Ok(session.map_err(|error| JobError::Evaluation(error.into()))?.at_rest())
}

impl Search<'_> {
    /// Flies those of a generation's points that are not stored, and stores all.
    fn fly(&mut self, points: &[(u64, SearchPoint)]) -> Result<Vec<RunOutcome>, JobError> {
        let Search { job, scenario, space, suite, session, path, flown } = self;
        let rows = &mut flown.outcomes;
        let is_stored = |rows: &[RunOutcome], number: u64, point: &SearchPoint| {
            let text = space.text_of(point);
            rows.iter().any(|row| row.number == number && row.point == text)
        };
        let mut missing = points.to_vec();
        missing.retain(|(number, point)| !is_stored(rows, *number, point));
        if !missing.is_empty() {
            let place = (job.study, &*suite, *scenario);
            let new = worst_case::fly(space, place, session, &missing, job.crew.workers)?;
            rows.retain(|row| missing.iter().all(|(number, _)| *number != row.number));
            rows.extend(new);
            rows.sort_by_key(|row| row.number);
            flown.write(path)?;
        }
        let number = |number: &u64| flown.outcomes.iter().find(|row| row.number == *number);
        Ok(points.iter().filter_map(|(own, _)| number(own).cloned()).collect())
    }
}
