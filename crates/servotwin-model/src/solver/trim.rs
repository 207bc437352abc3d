//! The steady state that a run starts from.

use super::ensemble::{Job, JobSource, run};
use super::{SolverFailure, SolverSettings, Statistics};
use crate::lanes::Level;
use crate::program::{Program, Slot};
use alloc::vec::Vec;

/// The steady state of a variant at its inputs of time zero, from an initial
/// guess. For a system without one (a limit cycle, an integrator that drifts), the
/// state at the end of the search.
///
/// # Errors
/// The search met numbers that are not finite.
pub fn settle(program: &Program, job: Job) -> Result<Vec<f64>, SolverFailure> {
    settle_counted(program, job).map(|(states, _)| states)
}

/// [`settle`] with the computing effort, which shows whether the search failed ([`Statistics::unsettled`]) and whether
/// it then found a limit cycle.
///
/// # Errors
/// The search met numbers that are not finite.
pub fn settle_counted(
    program: &Program,
    job: Job,
) -> Result<(Vec<f64>, Statistics), SolverFailure> {
    struct Catch<'a> {
        job: Option<Job<'a>>,
        states: Vec<f64>,
        outcome: Result<Statistics, SolverFailure>,
    }
    impl<'a> JobSource<'a> for Catch<'a> {
        fn next(&mut self) -> Option<Job<'a>> {
            self.job.take()
        }
        fn sample(&mut self, _job: usize, _index: usize, values: &[f64]) {
            self.states = values.to_vec();
        }
        fn finish(&mut self, _job: usize, outcome: Result<Statistics, SolverFailure>) {
            self.outcome = outcome;
        }
    }
    let record: Vec<Slot> = (0..program.states().len() as Slot).collect();
    let job = Job { settle: true, duration_s: 0.0, ..job };
    let mut catch =
        Catch { job: Some(job), states: Vec::new(), outcome: Ok(Statistics::default()) };
    run(program, None, SolverSettings::of_runs(), &record, Level::best(), &mut catch);
    catch.outcome.map(|statistics| (catch.states, statistics))
}
