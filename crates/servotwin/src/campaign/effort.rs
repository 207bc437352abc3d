//! What simulations take. The solver's steps follow from its error control alone, so they are the same for any
//! number of threads and lanes, and tell what of a run no sensor need show: that a part of it rings.

use super::watch::Twin;
use crate::table::{Column, Table, TableError, Values};
use servotwin_model::solver::Statistics;

/// How many times the steps of its twin a variant that rings takes.
///
/// In the aileron a valve whose damping is all gone takes fifteen times as many and more for ever: a limit cycle.
/// What dies out (nine tenths of the damping gone, under some commands) or cavitates takes at most four times as many.
const RINGING: f64 = 5.0;

const STEPS: &str = "steps_per_s";
const TWIN_STEPS: &str = "twin_steps_per_s";
const MOVING: &str = "began_on_the_move";
const LIMIT_CYCLE: &str = "limit_cycle";

/// What the simulation of a variant took, and that of the twin with which it is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effort {
    /// Steps for each simulated second; 0 where the variant was not simulated to the end.
    pub steps_per_s: f64,
    /// The twin's.
    pub twin_steps_per_s: f64,
    /// Whether no rest was found at the inputs of time zero, for the variant or for its twin.
    pub began_on_the_move: bool,
    /// Whether the variant was measured to swing for ever there.
    pub limit_cycle: bool,
}

/// Steps for each simulated second of a run, without those of the search for rest.
pub(super) fn steps_per_s(work: &Statistics, duration_s: f64) -> f64 {
    (work.steps - work.settling) as f64 / duration_s
}

impl Effort {
    /// Of a variant; without `work` it did not run to its end.
    pub(super) fn of(work: Option<&Statistics>, duration_s: f64, twin: &Twin) -> Self {
        Effort {
            steps_per_s: work.map_or(0.0, |work| steps_per_s(work, duration_s)),
            twin_steps_per_s: twin.steps_per_s,
            began_on_the_move: work.is_some_and(|work| work.unsettled > 0 || twin.is_moving),
            limit_cycle: work.is_some_and(|work| work.limit_cycles > 0),
        }
    }

    /// Whether the variant takes more than five times the steps of its twin: something in it oscillates so
    /// fast that the samples of sensors need not show it. A swing as slow as the command costs no steps.
    pub fn rings(&self) -> bool {
        self.steps_per_s > RINGING * self.twin_steps_per_s
    }

    /// As columns of a shard.
    pub(super) fn to_columns(efforts: &[Self]) -> Vec<Column> {
        let twins = efforts.iter().map(|effort| effort.twin_steps_per_s).collect();
        let mut columns = told(efforts);
        columns.push(Column::new(TWIN_STEPS, "1/s", Values::Float(twins)));
        columns
    }

    /// What [`Effort::to_columns`] has written.
    pub(super) fn from_table(table: &Table) -> Result<Vec<Self>, TableError> {
        let (steps, twins) = (table.f64(STEPS)?, table.f64(TWIN_STEPS)?);
        let (moving, cycles) = (table.bool(MOVING)?, table.bool(LIMIT_CYCLE)?);
        let of = |row: usize| Effort {
            steps_per_s: steps[row],
            twin_steps_per_s: twins[row],
            began_on_the_move: moving[row],
            limit_cycle: cycles[row],
        };
        Ok((0..table.row_count()).map(of).collect())
    }
}

/// The columns that shards and data sets have of it.
fn told(efforts: &[Effort]) -> Vec<Column> {
    let steps = efforts.iter().map(|effort| effort.steps_per_s).collect();
    let moving = efforts.iter().map(|effort| effort.began_on_the_move).collect();
    let cycles = efforts.iter().map(|effort| effort.limit_cycle).collect();
    vec![
        Column::new(STEPS, "1/s", Values::Float(steps)),
        Column::new(MOVING, "", Values::Flag(moving)),
        Column::new(LIMIT_CYCLE, "", Values::Flag(cycles)),
    ]
}

/// What a data set says of it.
pub(super) fn effort_columns(efforts: &[Effort]) -> Vec<Column> {
    let rings = efforts.iter().map(Effort::rings).collect();
    let mut columns = told(efforts);
    columns.push(Column::new("rings", "", Values::Flag(rings)));
    columns
}
