//! The solver's effort for simulations. Steps depend only on the error control, so they are equal for any number of
//! threads and lanes. They reveal ringing of internal states that no sensor may show.

use crate::run::RecordedRun;
use crate::table::{Column, Table, TableError, Values};
use servotwin_model::solver::Statistics;

/// A variant rings if it takes this many times the steps of its twin.
///
/// In the aileron, a valve without any damping takes at least fifteen times as many steps, without end: a limit cycle.
/// Decaying oscillations (nine tenths of the damping gone, under some commands) and cavitation take at most four times
/// as many.
const RINGING: f64 = 5.0;

const STEPS: &str = "steps_per_s";
const TWIN_STEPS: &str = "twin_steps_per_s";
const MOVING: &str = "began_on_the_move";
const LIMIT_CYCLE: &str = "limit_cycle";

/// The effort of simulating a variant and the twin that it is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct VariantEffort {
    /// Steps per simulated second; 0 if the variant was not simulated to the end.
    pub(crate) steps_per_s: f64,
    /// Steps per simulated second of the twin.
    pub(crate) twin_steps_per_s: f64,
    /// Whether no steady state was found at the inputs of time zero, for the variant or for its twin.
    pub(crate) began_on_the_move: bool,
    /// Whether the variant was found to be in a limit cycle there.
    pub(crate) limit_cycle: bool,
}

/// Steps per simulated second of a run, without those of the search for the steady state.
fn steps_per_s(work: &Statistics, duration_s: f64) -> f64 {
    (work.steps - work.settling) as f64 / duration_s
}

impl VariantEffort {
    /// The effort of a variant and its twin with their durations; `work` is `None` if it did not run to the end.
    pub(super) fn of(
        (work, duration_s): (Option<&Statistics>, f64),
        (twin, twin_s): (&RecordedRun, f64),
    ) -> Self {
        VariantEffort {
            steps_per_s: work.map_or(0.0, |work| steps_per_s(work, duration_s)),
            twin_steps_per_s: steps_per_s(&twin.work, twin_s),
            began_on_the_move: work.is_some_and(|work| twin.is_on_the_move(work)),
            limit_cycle: work.is_some_and(|work| work.limit_cycles > 0),
        }
    }

    /// Whether the variant takes more than five times the steps of its twin, i.e. something in it oscillates too fast
    /// for the sensors to show it. An oscillation as slow as the command costs no additional steps.
    pub(crate) fn rings(&self) -> bool {
        self.steps_per_s > RINGING * self.twin_steps_per_s
    }

    /// The columns of a part.
    pub(super) fn to_columns(efforts: &[Self]) -> Vec<Column> {
        let twins = efforts.iter().map(|effort| effort.twin_steps_per_s).collect();
        let mut columns = told(efforts);
        columns.push(Column::new(TWIN_STEPS, "1/s", Values::Float(twins)));
        columns
    }

    /// Reads the columns written by [`VariantEffort::to_columns`].
    pub(super) fn from_table(table: &Table) -> Result<Vec<Self>, TableError> {
        let (steps, twins) = (table.f64(STEPS)?, table.f64(TWIN_STEPS)?);
        let (moving, cycles) = (table.bool(MOVING)?, table.bool(LIMIT_CYCLE)?);
        let of = |row: usize| VariantEffort {
            steps_per_s: steps[row],
            twin_steps_per_s: twins[row],
            began_on_the_move: moving[row],
            limit_cycle: cycles[row],
        };
        Ok((0..table.row_count()).map(of).collect())
    }
}

/// The columns common to parts and data sets.
fn told(efforts: &[VariantEffort]) -> Vec<Column> {
    let steps = efforts.iter().map(|effort| effort.steps_per_s).collect();
    let moving = efforts.iter().map(|effort| effort.began_on_the_move).collect();
    let cycles = efforts.iter().map(|effort| effort.limit_cycle).collect();
    vec![
        Column::new(STEPS, "1/s", Values::Float(steps))
            .described("Solver steps in each simulated second, 0 if `failure` is not empty."),
        Column::new(MOVING, "", Values::Flag(moving))
            .described("No steady state was found at the inputs of time zero."),
        Column::new(LIMIT_CYCLE, "", Values::Flag(cycles))
            .described("The variant has a measured limit cycle at time zero."),
    ]
}

/// The columns of a data set.
pub(super) fn effort_columns(efforts: &[VariantEffort]) -> Vec<Column> {
    let rings = efforts.iter().map(VariantEffort::rings).collect();
    let mut columns = told(efforts);
    let rings = Column::new("rings", "", Values::Flag(rings));
    columns.push(rings.described("More than five times the solver steps of the twin."));
    columns
}
