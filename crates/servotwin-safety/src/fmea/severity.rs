//! The severity of a fault by a stated rule. It is about this system alone: which failure condition of the aircraft or
//! machine a fault leads to, and how that is classified, is for people to decide.
//!
//! Let g be the growth of the tracking error without the diagnosis: the root mean square error of the flight with the
//! fault at its largest flown intensity, less that of the healthy flight, divided by the root mean square of the
//! command. The first line that holds gives the level:
//!
//! | level | rule |
//! |---|---|
//! | S4 | no lane is left in a flight with the diagnosis, or g ≥ 0.5 |
//! | S3 | a lane is switched off in a flight with the diagnosis, or g ≥ 0.1 |
//! | S2 | an action changes the mode in a flight with the diagnosis, or g ≥ 0.01 |
//! | S1 | none of these |
//!
//! A flown fault is rated by its flights alone. Without flights the rule reads what the study's action would do.

use servotwin::text::number;

/// The growth of the tracking error from which on a level holds.
const GROWTHS: [(f64, &str); 3] = [(0.5, "S4"), (0.1, "S3"), (0.01, "S2")];

/// The level without any effect.
const LEAST: &str = "S1";

/// What the rule reads.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SeverityInputs {
    /// The growth of the tracking error; `None` if it was not measured.
    pub growth: Option<f64>,
    /// The most lanes that are switched off at once.
    pub lanes_off: usize,
    /// Number of lanes.
    pub lanes: usize,
    /// Whether an action changes inputs or parameters.
    pub changes_mode: bool,
}

/// The level of a fault, and the clauses of the rule that hold for it.
pub fn level(inputs: SeverityInputs) -> (&'static str, String) {
    let SeverityInputs { growth, lanes_off, lanes, changes_mode } = inputs;
    let mut clauses: Vec<(&str, String)> = vec![];
    match lanes_off {
        0 => {}
        off if off >= lanes.max(1) => clauses.push(("S4", "no lane is left".into())),
        off => clauses.push(("S3", format!("{off} of {lanes} lanes switched off"))),
    }
    let by_growth = |growth: f64| GROWTHS.into_iter().find(|(least, _)| growth >= *least);
    if let Some((growth, (least, level))) = growth.and_then(|g| Some((g, by_growth(g)?))) {
        clauses.push((level, format!("g = {} ≥ {least}", number(growth, 3))));
    }
    if changes_mode {
        clauses.push(("S2", "an action changes the mode".into()));
    }
    // The names of the levels ascend.
    let level = clauses.iter().map(|(level, _)| *level).max().unwrap_or(LEAST);
    let held = clauses.iter().filter(|(own, _)| *own == level).map(|(_, words)| words.as_str());
    match held.collect::<Vec<_>>().join(", ") {
        none if none.is_empty() => (level, "no clause of S2 to S4 holds".into()),
        held => (level, held),
    }
}
