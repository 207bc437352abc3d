//! The hybrid twin: the virtual twin and the diagnosis beside an actuator, one call for each sample.

use crate::course::Knot;
use crate::session::{Outcome, Session};
use crate::sizes::SENSORS;
use crate::tables::{self, TUNING};
use crate::twin::Twin;
use crate::twin_sizes::{INPUTS, PARAMETERS};
use crate::twin_tables;
use crate::windows::Values;

/// The slope of a signal from its last two differences, such that it does not swing over.
fn slope_of(now: f64, before: f64) -> f64 {
    let (size, size_before) = (now.abs(), before.abs());
    let most = 3.0 * if size < size_before { size } else { size_before };
    let slope = 1.5 * now - 0.5 * before;
    let at_least = if slope < -most { -most } else { slope };
    if at_least > most { most } else { at_least }
}

/// A twin and a diagnosis.
#[derive(Clone)]
pub struct Hybrid {
    twin: Twin,
    session: Session,
    /// Whether the twin has found a beginning.
    is_settled: bool,
    /// Of the twin.
    parameters: [f64; PARAMETERS],
    /// Inputs as the twin received them.
    accepted: [Knot; INPUTS],
    /// The last value of each input on its bus, and its difference.
    last: [Option<f64>; INPUTS],
    difference_per_s: [f64; INPUTS],
    expected: Values,
}

impl Default for Hybrid {
    fn default() -> Self {
        Hybrid::new()
    }
}

impl Hybrid {
    /// A hybrid twin without samples. Use none where [`rounds_twice`](crate::rounds_twice) is false.
    pub const fn new() -> Self {
        Hybrid {
            twin: Twin::new(),
            session: Session::new(),
            is_settled: false,
            parameters: twin_tables::PARAMETERS,
            accepted: twin_tables::DEFAULTS,
            last: [None; INPUTS],
            difference_per_s: [0.0; INPUTS],
            expected: [0.0; SENSORS],
        }
    }

    /// Takes one sample: the inputs of the system and the values of the sensors, SI; NaN is a missing value. Returns `None`
    /// if the twin cannot be simulated; the next sample then starts it anew. The first sample searches for the steady state
    /// and takes longer.
    pub fn push(&mut self, inputs: &[f64; INPUTS], measured: &Values) -> Option<&Outcome> {
        for (input, told) in inputs.iter().enumerate() {
            self.accept_input(input, *told);
        }
        let done = match self.is_settled {
            true => self.twin.step(&self.accepted),
            false => self.twin.start(&self.parameters, &self.accepted),
        };
        self.is_settled = done.is_ok();
        if !self.is_settled {
            return None;
        }
        self.expected = twin_tables::SENSORS.map(|place| self.twin.variables()[place]);
        Some(self.session.push(inputs, measured, &self.expected))
    }

    /// From the next sample on, a parameter of the twin has this value, SI.
    ///
    /// # Panics
    /// If there is no such parameter.
    pub fn set_parameter(&mut self, parameter: usize, value: f64) {
        self.parameters[parameter] = value;
        self.twin.load(&self.parameters);
    }

    /// The diagnosis, for the commands of the flight control computer.
    pub fn session(&mut self) -> &mut Session {
        &mut self.session
    }

    /// What the twin expects of the sensors at the last sample, SI.
    pub fn expected(&self) -> &Values {
        &self.expected
    }

    /// Takes an input from its bus. The twin keeps the previous value of one that is not plausible.
    fn accept_input(&mut self, input: usize, told: f64) {
        let known = &tables::INPUTS[input];
        let fits = (known.least..=known.largest).contains(&told) && told.is_finite();
        let accepted = &mut self.accepted[input];
        let value = if fits { told } else { accepted.value };
        let last = self.last[input].replace(value).unwrap_or(value);
        let difference = (value - last) / TUNING.period_s;
        let before = core::mem::replace(&mut self.difference_per_s[input], difference);
        *accepted = Knot { value, slope_per_s: slope_of(difference, before) };
    }
}
