//! One variant that its user steps from sample to sample: the twin that runs beside an actuator.
//!
//! ```text
//! let mut twin = Twin::new(&program, Settings::of_runs(), 0.01, between);
//! twin.load(&program.parameters(&[]));
//! twin.settle(&inputs_at_rest)?;          // stands on sample 0
//! loop { twin.step(&inputs)?; twin.value(slot); }
//! ```
//!
//! Runs have the same code in their lanes, so a twin returns the bits of a
//! run with the same inputs. After [`Twin::new`], [`Twin::step`] allocates
//! nothing.

use super::compiled_step::CompiledSteps;
use super::lane_state::{LaneState, Moving, Phase};
use super::lane_stepper::{LaneStepper, Numbers};
use super::{MIN_STEP_S, SolverFailure, SolverSettings, Statistics};
use crate::program::{Program, Slot};
use crate::signal::hermite_piece;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// Interpolation of an input between samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// Holds the value of the preceding sample.
    Hold,
    /// A straight line.
    Line,
    /// A cubic with the given slopes at the samples.
    Cubic,
}

/// An input at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Knot {
    /// The value, in the input's SI unit.
    pub value: f64,
    /// Its slope per second; only [`Between::Cubic`] uses it.
    pub slope_per_s: f64,
}

impl From<f64> for Knot {
    /// A value with slope zero.
    fn from(value: f64) -> Self {
        Knot { value, slope_per_s: 0.0 }
    }
}

/// The complete state of a twin, from which it continues later with the same bits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Index of the current sample.
    pub sample: u64,
    /// The step that the error control requests, s.
    pub wanted_s: f64,
    /// The recent attempts per second of simulated time.
    pub attempt_rate_per_s: f64,
    /// The states.
    pub states: Vec<f64>,
    /// The external inputs, the stand-ins and the values held by clocks.
    pub held: Vec<f64>,
    /// For each clock, the index of its next tick.
    pub next_tick: Vec<u64>,
    /// The inputs at the current sample.
    pub inputs: Vec<Knot>,
}

/// A virtual twin in real time; see the module documentation.
pub struct Twin<'p> {
    stepper: LaneStepper<'p, f64>,
    between: Vec<Between>,
    period_s: f64,
    /// The inputs at the current sample.
    inputs: Vec<Knot>,
    /// Constants and stand-ins that apply from the next sample on.
    loaded: Option<(Vec<f64>, Vec<f64>)>,
}

/// The twin's only lane.
const LANE: usize = 0;

/// Latest permitted time of a snapshot, s: thirty years.
const MAX_TIME_S: f64 = 1e9;
/// Longest permitted step of a snapshot, s.
const MAX_STEP_S: f64 = 1e4;
/// Largest permitted attempt rate of a snapshot, 1/s.
const MAX_ATTEMPT_RATE_PER_S: f64 = 1e12;

impl<'p> Twin<'p> {
    /// A twin with samples every `period_s` seconds, and one `between` for each external input of the
    /// program. Steps end on samples, whatever the settings are.
    ///
    /// # Panics
    /// If the lengths of `between` and the program's inputs differ, the period is not positive, or the
    /// method is explicit. An explicit method cannot search for the steady state.
    pub fn new(
        program: &'p Program,
        settings: SolverSettings,
        period_s: f64,
        between: Vec<Between>,
    ) -> Self {
        assert_eq!(between.len(), program.externals().len(), "one way for each input");
        assert!(period_s > 0.0, "samples are apart");
        assert!(settings.method.tableau().is_some(), "the method is implicit");
        let settings = SolverSettings { land_on_samples: true, ..settings };
        let inputs = alloc::vec![Knot::default(); between.len()];
        let stepper = LaneStepper::new(program, settings, None);
        let mut twin = Self { stepper, between, period_s, inputs, loaded: None };
        twin.restart(false);
        twin
    }

    /// The system.
    pub fn program(&self) -> &'p Program {
        self.stepper.program
    }

    /// Uses compiled functions from now on, if they are for [`Level::Single`](crate::lanes::Level). They return the
    /// same bits faster. Returns whether they are in use.
    pub fn use_compiled(&mut self, compiled: &'p CompiledSteps) -> bool {
        self.stepper.use_compiled(compiled)
    }

    /// Loads the parameters of a variant ([`Program::parameters`]). During a run they apply from the
    /// next sample on.
    pub fn load(&mut self, parameters: &[Vec<f64>]) {
        let program = self.stepper.program;
        let constants = program.block_constants(parameters);
        self.loaded = Some((constants, program.stand_in_values(parameters)));
    }

    /// Searches for the steady state at constant inputs, from an initial guess
    /// ([`Program::first_guess`]), and places the twin on sample 0.
    ///
    /// # Errors
    /// The search met numbers that are not finite.
    pub fn settle(&mut self, inputs: &[Knot], guess: &[f64]) -> Result<(), SolverFailure> {
        self.inputs.copy_from_slice(inputs);
        self.restart(true);
        self.take_loaded();
        self.stepper.set_states(LANE, guess);
        self.stepper.reset_held(LANE);
        for (external, knot) in self.inputs.iter().enumerate() {
            self.stepper.set_input(LANE, external, knot.value);
        }
        while self.lane_state().seeks_rest() {
            self.stepper.begin();
            if self.lane_state().seeks_rest() {
                self.attempt()?;
            }
        }
        self.stand();
        Ok(())
    }

    /// Simulates up to the next sample, at which the inputs are `inputs`.
    ///
    /// # Errors
    /// The solver could not continue. Only [`Twin::settle`] and [`Twin::restore`] clear this failure.
    pub fn step(&mut self, inputs: &[Knot]) -> Result<(), SolverFailure> {
        if let Some(failure) = self.lane_state().failure {
            return Err(failure);
        }
        self.lead_to(inputs);
        while !self.stepper.lane_states[LANE].is_at_sample() {
            self.attempt()?;
            if !self.stepper.lane_states[LANE].is_at_sample() {
                self.stepper.begin();
            }
        }
        self.inputs.copy_from_slice(inputs);
        self.stand();
        Ok(())
    }

    /// A variable at the current sample.
    pub fn value(&self, slot: Slot) -> f64 {
        self.stepper.variable(LANE, slot)
    }

    /// Index of the current sample.
    pub fn sample(&self) -> u64 {
        self.lane_state().next_sample - 1
    }

    /// Time since the steady state, s.
    pub fn time_s(&self) -> f64 {
        self.lane_state().time_s
    }

    /// The computing effort so far.
    pub fn statistics(&self) -> Statistics {
        self.lane_state().statistics
    }

    /// Saves the twin's state; reuses the memory of `snapshot`.
    pub fn save(&self, snapshot: &mut Snapshot) {
        let lane_state = self.lane_state();
        snapshot.sample = self.sample();
        snapshot.wanted_s = lane_state.wanted_s;
        snapshot.attempt_rate_per_s = lane_state.attempt_rate_per_s;
        snapshot.states.clear();
        snapshot.states.extend(self.stepper.states(LANE));
        snapshot.held.clear();
        snapshot.held.extend(self.stepper.held(LANE));
        snapshot.next_tick.clone_from(&lane_state.next_tick);
        snapshot.inputs.clone_from(&self.inputs);
    }

    /// Continues from the snapshot of a twin with the same program, settings and parameters.
    ///
    /// # Errors
    /// Names the part that does not fit: a list of another length, or a number that no twin can have at a sample.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), &'static str> {
        let held = self.stepper.held(LANE).count();
        let fits = |fits: bool, what| if fits { Ok(()) } else { Err(what) };
        fits(snapshot.states.len() == self.stepper.program.states().len(), "states")?;
        fits(snapshot.held.len() == held, "held values")?;
        fits(snapshot.next_tick.len() == self.stepper.clocks(), "clocks")?;
        fits(snapshot.inputs.len() == self.inputs.len(), "inputs")?;
        self.check_numbers(snapshot)?;
        self.inputs.copy_from_slice(&snapshot.inputs);
        self.take_loaded();
        self.restart(false);
        let lane_state = &mut self.stepper.lane_states[LANE];
        lane_state.wanted_s = snapshot.wanted_s;
        lane_state.attempt_rate_per_s = snapshot.attempt_rate_per_s;
        lane_state.next_sample = snapshot.sample;
        lane_state.time_s = lane_state.sample_time_s();
        lane_state.next_tick.copy_from_slice(&snapshot.next_tick);
        self.stepper.set_states(LANE, &snapshot.states);
        self.stepper.set_held(LANE, &snapshot.held);
        self.stand();
        Ok(())
    }

    /// Checks that a twin can continue from the numbers of a snapshot. A step of zero, or one too short to change
    /// the time, would never end.
    fn check_numbers(&self, snapshot: &Snapshot) -> Result<(), &'static str> {
        let fits = |fits: bool, what| if fits { Ok(()) } else { Err(what) };
        let time_s = snapshot.sample as f64 * self.period_s;
        let is_finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
        let mut inputs = snapshot.inputs.iter().flat_map(|knot| [knot.value, knot.slope_per_s]);
        // A clock has ticked up to the sample, and not beyond the tick after it.
        let is_next = |(&tick, &period_s): (&u64, &f64)| {
            let next_s = tick as f64 * period_s;
            (time_s - period_s..=time_s + 2.0 * period_s).contains(&next_s)
        };
        fits(time_s <= MAX_TIME_S, "time")?;
        fits((MIN_STEP_S..=MAX_STEP_S).contains(&snapshot.wanted_s), "step")?;
        fits(
            (0.0..=MAX_ATTEMPT_RATE_PER_S).contains(&snapshot.attempt_rate_per_s),
            "attempt rate",
        )?;
        fits(is_finite(&snapshot.states), "states")?;
        fits(is_finite(&snapshot.held), "held values")?;
        fits(inputs.all(f64::is_finite), "inputs")?;
        fits(snapshot.next_tick.iter().zip(self.stepper.periods_s()).all(is_next), "clocks")
    }

    fn lane_state(&self) -> &LaneState {
        &self.stepper.lane_states[LANE]
    }

    /// Starts a new run in which all inputs can change.
    fn restart(&mut self, settle: bool) {
        let moving = self.inputs.iter().enumerate().map(|(external, knot)| Moving {
            external,
            from_s: 0.0,
            until_s: f64::INFINITY,
            piece: [knot.value, 0.0, 0.0, 0.0],
        });
        let clocks = self.stepper.clocks();
        self.stepper.lane_states[LANE] =
            LaneState::new(settle, moving.collect(), self.period_s, clocks);
        self.stepper.find_moving();
    }

    fn take_loaded(&mut self) {
        if let Some((constants, stand_ins)) = self.loaded.take() {
            let numbers = Numbers { constants: &constants, stand_ins: &stand_ins };
            self.stepper.set_numbers(LANE, numbers);
        }
    }

    /// Evaluates at the sample just reached, with the known values and slopes of
    /// the inputs.
    fn stand(&mut self) {
        self.take_loaded();
        let lane_state = &mut self.stepper.lane_states[LANE];
        if lane_state.phase == Phase::Settled {
            lane_state.begin_running();
        }
        let from_s = lane_state.sample_time_s();
        for ((moving, knot), between) in
            lane_state.moving.iter_mut().zip(&self.inputs).zip(&self.between)
        {
            let slope = if *between == Between::Cubic { knot.slope_per_s } else { 0.0 };
            moving.from_s = from_s;
            moving.piece = [knot.value, slope, 0.0, 0.0];
        }
        self.stepper.begin();
        self.stepper.lane_states[LANE].next_sample += 1;
    }

    /// Sets the pieces of the inputs up to the next sample. The last evaluation remains valid,
    /// unless an input has a slope that was unknown then, as on a straight line.
    fn lead_to(&mut self, next: &[Knot]) {
        let lane_state = &mut self.stepper.lane_states[LANE];
        let to_s = lane_state.sample_time_s();
        let mut surprise = false;
        for (((moving, from), to), between) in
            lane_state.moving.iter_mut().zip(&self.inputs).zip(next).zip(&self.between)
        {
            let length_s = to_s - moving.from_s;
            let before = moving.piece;
            moving.piece = match between {
                Between::Hold => [from.value, 0.0, 0.0, 0.0],
                Between::Line => [from.value, (to.value - from.value) / length_s, 0.0, 0.0],
                Between::Cubic => hermite_piece(
                    length_s,
                    [from.value, to.value],
                    [from.slope_per_s, to.slope_per_s],
                ),
            };
            surprise |= before[..2] != moving.piece[..2];
        }
        if surprise {
            self.stepper.begin();
        } else {
            self.stepper.load_inputs();
        }
    }

    fn attempt(&mut self) -> Result<(), SolverFailure> {
        let (_, error) = self.stepper.attempt();
        self.stepper.conclude(error);
        self.lane_state().failure.map_or(Ok(()), Err)
    }
}
