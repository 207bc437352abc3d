//! The severity of a fault by a stated rule. It is about this system alone: which failure condition of the aircraft or
//! machine a fault leads to, and how that is classified, is for people to decide.
//!
//! Let g be the growth of the tracking error without the diagnosis: the root mean square error of the flight with the
//! fault at its largest flown intensity, less that of the healthy flight, divided by the root mean square of the
//! command. The first line that holds gives the level:
//!
//! | level | rule |
//! |---|---|
//! | S4 | no lane is left with the diagnosis, or g ≥ 0.5 |
//! | S3 | a lane is switched off with the diagnosis, the study's action switches it off, or g ≥ 0.1 |
//! | S2 | the study's action changes the mode, or g ≥ 0.01 |
//! | S1 | none of these |
//!
//! Without flights only the study's action is known, so the level is a lower bound.

/// The growth of the tracking error from which on a level holds.
pub const GROWTHS: [(f64, &str); 3] = [(0.5, "S4"), (0.1, "S3"), (0.01, "S2")];

/// The level without any effect.
pub const LEAST: &str = "S1";

/// What the rule reads.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SeverityInputs {
    /// The growth of the tracking error; `None` without flights.
    pub growth: Option<f64>,
    /// Lanes that the flight with the diagnosis switched off; `None` without flights.
    pub lanes_off: Option<usize>,
    /// Number of lanes.
    pub lanes: usize,
    /// Whether the study's action switches the lane off.
    pub switches_off: bool,
    /// Whether the study's action changes inputs or parameters.
    pub changes_mode: bool,
}

/// The level of a fault.
pub fn level(inputs: SeverityInputs) -> &'static str {
    let by_growth = inputs.growth.map_or(LEAST, |growth| {
        GROWTHS.into_iter().find(|(least, _)| growth >= *least).map_or(LEAST, |(_, level)| level)
    });
    let off = inputs.lanes_off.unwrap_or(0).max(usize::from(inputs.switches_off));
    let by_lanes = match off {
        off if off >= inputs.lanes.max(1) => "S4",
        0 => LEAST,
        _ => "S3",
    };
    let by_mode = if inputs.changes_mode { "S2" } else { LEAST };
    // The names of the levels ascend.
    by_growth.max(by_lanes).max(by_mode)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_of_error_lanes_and_action_decides() {
        let two = SeverityInputs {
            lanes: 2,
            growth: Some(0.0),
            lanes_off: Some(0),
            ..Default::default()
        };
        assert_eq!(level(two), "S1");
        assert_eq!(level(SeverityInputs { changes_mode: true, ..two }), "S2");
        assert_eq!(level(SeverityInputs { growth: Some(0.02), ..two }), "S2");
        assert_eq!(level(SeverityInputs { growth: Some(0.1), changes_mode: true, ..two }), "S3");
        assert_eq!(level(SeverityInputs { switches_off: true, ..two }), "S3");
        assert_eq!(level(SeverityInputs { lanes_off: Some(2), ..two }), "S4");
        assert_eq!(level(SeverityInputs { growth: Some(0.7), ..two }), "S4");
        // The only lane of a machine is its function.
        let one = SeverityInputs { lanes: 1, switches_off: true, ..Default::default() };
        assert_eq!(level(one), "S4");
    }
}
