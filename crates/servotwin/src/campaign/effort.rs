//! Computational effort of simulations. The solver's error control alone determines its steps, so they are the same for
//! any number of threads and lanes. They can reveal ringing that no sensor shows.

use super::watch::Twin;
use crate::table::{Column, Table, TableError, Values};
use servotwin_model::solver::Statistics;

/// Minimum ratio between the steps of a ringing variant and those of its twin.
///
/// In the aileron, a valve without damping takes at least fifteen times as many steps forever: a limit cycle. A
/// decaying oscillation (nine tenths of the damping gone, under some commands) or cavitation takes at most four times
/// as many.
const RINGING: f64 = 5.0;

const STEPS: &str = "steps_per_s";
const TWIN_STEPS: &str = "twin_steps_per_s";
const MOVING: &str = "began_on_the_move";
const LIMIT_CYCLE: &str = "limit_cycle";

/// Effort of a variant's simulation and of its twin's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effort {
    /// Steps per simulated second; 0 if the variant was not simulated to the end.
    pub steps_per_s: f64,
    /// The twin's steps per simulated second.
    pub twin_steps_per_s: f64,
    /// Whether no steady state was found at the initial inputs, for the variant or for its twin.
    pub began_on_the_move: bool,
    /// Whether a limit cycle was measured at the initial inputs.
    pub limit_cycle: bool,
}

/// Steps per simulated second, without those of the search for a steady state.
pub(super) fn steps_per_s(work: &Statistics, duration_s: f64) -> f64 {
    (work.steps - work.settling) as f64 / duration_s
}

impl Effort {
    /// The effort of a variant; `work` is `None` if it was not simulated to the end.
    pub(super) fn of(work: Option<&Statistics>, duration_s: f64, twin: &Twin) -> Self {
        Effort {
            steps_per_s: work.map_or(0.0, |work| steps_per_s(work, duration_s)),
            twin_steps_per_s: twin.steps_per_s,
            began_on_the_move: work.is_some_and(|work| work.unsettled > 0 || twin.is_moving),
            limit_cycle: work.is_some_and(|work| work.limit_cycles > 0),
        }
    }

    /// Whether the variant takes more than five times the steps of its twin. Then a part oscillates so fast that sensor
    /// samples may not show it. An oscillation as slow as the command costs no steps.
    pub fn rings(&self) -> bool {
        self.steps_per_s > RINGING * self.twin_steps_per_s
    }

    /// The effort as columns of a shard.
    pub(super) fn to_columns(efforts: &[Self]) -> Vec<Column> {
        let twins = efforts.iter().map(|effort| effort.twin_steps_per_s).collect();
        let mut columns = told(efforts);
        columns.push(Column::new(TWIN_STEPS, "1/s", Values::Float(twins)));
        columns
    }

    /// Reads the columns that [`Effort::to_columns`] writes.
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

/// The columns that shards and data sets have in common.
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

/// The columns of a data set.
pub(super) fn effort_columns(efforts: &[Effort]) -> Vec<Column> {
    let rings = efforts.iter().map(Effort::rings).collect();
    let mut columns = told(efforts);
    columns.push(Column::new("rings", "", Values::Flag(rings)));
    columns
}
