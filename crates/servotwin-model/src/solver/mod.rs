//! The solver: many variants at once, each with its own time and step.
//!
//! A linearly implicit (Rosenbrock) step needs no iteration, so all lanes do the same work whatever their step sizes
//! are. Every lane therefore has its own time, error control and events. When a lane finishes, it takes
//! the next variant. No lane reads the numbers of another, so a variant returns the same bits alone, in any lane and on
//! any thread.
//!
//! - [`tableau`]: the coefficients of the methods
//! - `step`: the operations of a step that depend on the system, interpreted or compiled ([`CompiledStep`])
//! - [`StepMemory`]: the arrays of a few lanes, and one step over them
//! - `lane_state`: the time and the step of one variant
//! - `lane_stepper`: a step in which every lane has its own time and step
//! - `follow`: the solver's fallback when the steady-state search fails
//! - [`Twin`]: one variant that its user steps from sample to sample
//! - [`run`]: many variants, which lanes take from a [`JobSource`]
//!
//! # One step on a page
//!
//! The arrays of one step and their lengths, for the system `valve_and_cylinder` and the method of runs. Every
//! entry holds one number per lane.
//!
//! ```text
//!  constants [90]              y [6]
//!      |                         |  copy, with the inputs at the beginning of the step
//!      v                         v
//!  variables [29] = states [6] | inputs [1] | stand-ins [3] | sums [11] | derivatives [6] | spare [2]
//!      |
//!      |  evaluate_with_jacobian:  equation blocks [14]  fill sums, derivatives and partials;
//!      |                           chain-rule products [28]  fill the gradients of the sums
//!      v
//!  gradients [79] = one and zero [2] | input slopes [1] | sum gradients [27] | partials [49]
//!      |
//!      |  factor:  Jacobian entries [18]  ->  I/(gamma h) - J = L U,  update products [9]
//!      v
//!  factors [20]
//!      |
//!      |  in each of the  stages of the method [6]  i = 1, 2, ...
//!      |      sum_stages            y + sum of a_ij U_j -> states,   (sum of c_ij U_j)/h -> U_i
//!      |      evaluate_derivatives  states, inputs -> derivatives
//!      |      solve_stage           L U x = derivatives + U_i + h gamma_i df/dt,   x -> U_i
//!      v
//!  stages [48] = U_1 [6] | U_2 [6] | ... | U_8 [6]    (room for the method with most stages)
//!      |
//!      |  combine:  states + last U
//!      v
//!  y_new [6]      error: last U, over scale and error weight of each state
//!      |
//!      |  accept:  y_new -> y  in the lanes whose error is small enough
//!      v
//!  the next step
//! ```
//!
//! An index into an array never depends on a lane. The lists of `Sequence`, `SparseJacobian` and `SparseLu` hold the
//! entries that an operation reads, in groups of equal length. A compiled step has the same arrays and no lists.

mod compiled_step;
mod ensemble;
mod follow;
mod lane_state;
mod lane_stepper;
pub(crate) mod step;
mod step_memory;
pub mod tableau;
mod trim;
mod twin;

pub use compiled_step::{CompiledStep, CompiledSteps};
pub use ensemble::{Change, Job, JobSource, run};
pub use step_memory::StepMemory;
pub use trim::{settle, settle_counted};
pub use twin::{Between, Knot, Snapshot, Twin};

use crate::hash::{Canonical, Fingerprint};
use core::fmt;
use tableau::Tableau;

/// The integration method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Rosenbrock, order 3.
    Rodas3,
    /// Rosenbrock, order 4.
    Rodas4P2,
    /// Rosenbrock, order 5.
    Rodas5P,
    /// The classical explicit Runge–Kutta method, for cross-checks; fixed step.
    RungeKutta4,
}

impl Method {
    /// Every method.
    pub const ALL: [Method; 4] =
        [Method::Rodas3, Method::Rodas4P2, Method::Rodas5P, Method::RungeKutta4];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Method::Rodas3 => "rodas3",
            Method::Rodas4P2 => "rodas4p2",
            Method::Rodas5P => "rodas5p",
            Method::RungeKutta4 => "rk4",
        }
    }

    /// The coefficients; `None` for the explicit method.
    pub fn tableau(self) -> Option<&'static Tableau> {
        match self {
            Method::Rodas3 => Some(&tableau::RODAS3),
            Method::Rodas4P2 => Some(&tableau::RODAS4P2),
            Method::Rodas5P => Some(&tableau::RODAS5P),
            Method::RungeKutta4 => None,
        }
    }
}

/// Step-size control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// A constant step, shortened only to end on events.
    Fixed {
        /// The step, s.
        step_s: f64,
    },
    /// The longest step for which the estimated error of every state stays below `tolerance` times
    /// its scale and `error_weight`.
    Adaptive {
        /// Permitted error per step, relative to the state's scale and `error_weight`.
        tolerance: f64,
        /// The longest step, s.
        max_step_s: f64,
        /// Attempted steps per second of simulated time above which a larger error is accepted. Such a rate marks
        /// a limit cycle, whose phase no tolerance can follow. Infinity disables the limit.
        attempt_rate_limit_per_s: f64,
    },
}

impl Control {
    /// Error control with the given tolerance and steps of at most 0.1 s.
    pub fn within(tolerance: f64) -> Self {
        Control::Adaptive { tolerance, max_step_s: 0.1, attempt_rate_limit_per_s: f64::INFINITY }
    }
}

/// Method and step-size control of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings {
    /// The method.
    pub method: Method,
    /// The step-size control.
    pub control: Control,
    /// Whether steps end on every sample. If `false`, the method's dense output interpolates
    /// samples, for long steps between frequent samples.
    pub land_on_samples: bool,
}

impl Canonical for SolverSettings {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        let SolverSettings { method, control, land_on_samples } = self;
        fingerprint.add(method.name()).add(land_on_samples);
        match *control {
            Control::Fixed { step_s } => fingerprint.add("fixed").add(&step_s),
            Control::Adaptive { tolerance, max_step_s, attempt_rate_limit_per_s } => {
                fingerprint.add("adaptive").add(&[tolerance, max_step_s, attempt_rate_limit_per_s])
            }
        };
    }
}

impl SolverSettings {
    /// For the runs of a study: keeps every state within 1e-4 of its scale, except where a valve oscillates forever (test
    /// `val_cvode_aileron_at_the_settings_of_runs`).
    pub fn of_runs() -> Self {
        Self {
            method: Method::Rodas4P2,
            control: Control::Adaptive {
                tolerance: 4e-6,
                max_step_s: 0.1,
                attempt_rate_limit_per_s: 500.0,
            },
            land_on_samples: true,
        }
    }

    /// For reference runs.
    pub fn reference() -> Self {
        Self { method: Method::Rodas5P, control: Control::within(1e-9), land_on_samples: true }
    }

    /// For real time: a fixed step of 1 ms.
    pub fn real_time() -> Self {
        Self {
            method: Method::Rodas3,
            control: Control::Fixed { step_s: 1e-3 },
            land_on_samples: true,
        }
    }
}

/// The computing effort of a variant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Accepted steps.
    pub steps: u64,
    /// Accepted steps of steady-state searches.
    pub settling: u64,
    /// Steps whose error was too large.
    pub rejected: u64,
    /// Evaluations of all equations without the Jacobian.
    pub evaluations: u64,
    /// Evaluations with the Jacobian, each followed by a factorization.
    pub jacobians: u64,
    /// Steady-state searches that failed, so that the run began in motion.
    pub unsettled: u64,
    /// Failed searches in which the system was found to oscillate forever.
    pub limit_cycles: u64,
}

impl core::ops::AddAssign for Statistics {
    fn add_assign(&mut self, other: Self) {
        self.steps += other.steps;
        self.settling += other.settling;
        self.rejected += other.rejected;
        self.evaluations += other.evaluations;
        self.jacobians += other.jacobians;
        self.unsettled += other.unsettled;
        self.limit_cycles += other.limit_cycles;
    }
}

/// Why a variant could not be finished.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverFailure {
    /// Time of the failure, s.
    pub time_s: f64,
    /// The state with the largest error, by its index in the program.
    pub state: usize,
    /// The cause.
    pub cause: Cause,
}

/// The cause of a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The error stayed too large down to the smallest step.
    StepTooSmall,
    /// A number was not finite.
    NotFinite,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Cause::StepTooSmall => "the error stayed too large down to the smallest step",
            Cause::NotFinite => "a value became infinite or not a number",
        })
    }
}

/// Events closer together than this count as one, s.
pub(crate) const SAME_TIME_S: f64 = 1e-9;
/// Lower limit of steps that no event shortens, s. A spool that hits its stop at full speed needs
/// 5e-9 s at a tolerance of 1e-7. After three hours, doubles are still only 2e-12 s apart.
pub(crate) const MIN_STEP_S: f64 = 1e-11;

#[cfg(test)]
mod tests {
    //! The order of the methods, measured on a nonlinear, time-dependent
    //! system: a volume filled through an orifice from an oscillating supply.

    use super::*;
    use crate::components;
    use crate::lanes::Level;
    use crate::network::{ExternalInput, Instance, Network, PortOf};
    use crate::program::Program;
    use crate::signal::Piecewise;
    use crate::spec::Unit;
    use alloc::vec;
    use alloc::vec::Vec;

    fn filling() -> Program {
        let component = |id: &str, kind| Instance::new(id, components::find(kind).unwrap());
        let port = |component: usize, name: &str, network: &Network| PortOf {
            component,
            port: network.components[component].component.port(name).unwrap(),
        };
        let mut network = Network {
            components: vec![
                component("supply", "pressure_source"),
                component("orifice", "orifice").with("area_m2", 1e-6),
                component("volume", "volume").with("volume_m3", 1e-3),
            ],
            ..Network::default()
        };
        network.connections = vec![
            vec![port(0, "port", &network), port(1, "a", &network)],
            vec![port(1, "b", &network), port(2, "port", &network)],
        ];
        network.inputs = vec![ExternalInput {
            id: "pressure".into(),
            unit: Unit::Pascal,
            default: 1e7,
            targets: vec![port(0, "pressure", &network)],
        }];
        network.compile().unwrap()
    }

    struct Record<'a> {
        waiting: Vec<Job<'a>>,
        samples: Vec<Vec<f64>>,
        outcomes: Vec<Option<Result<Statistics, SolverFailure>>>,
    }

    impl<'a> JobSource<'a> for Record<'a> {
        fn next(&mut self) -> Option<Job<'a>> {
            self.waiting.pop()
        }
        fn sample(&mut self, job: usize, _index: usize, values: &[f64]) {
            self.samples[job].push(values[0]);
        }
        fn finish(&mut self, job: usize, outcome: Result<Statistics, SolverFailure>) {
            self.outcomes[job] = Some(outcome);
        }
    }

    fn pressures(settings: SolverSettings, level: Level, jobs: usize) -> Vec<Vec<f64>> {
        let program = filling();
        let swing = Piecewise::new(vec![0.0], vec![[2e7, -3e7, 4e7, -1e7]]).unwrap();
        let parameters = program.parameters(&[]);
        let job = |number| Job {
            number,
            constants: program.block_constants(&parameters),
            stand_ins: program.stand_in_values(&parameters),
            inputs: vec![&swing],
            start: vec![1e6 + 1e5 * number as f64],
            settle: false,
            duration_s: 1.0,
            sample_period_s: 0.25,
            changes: Vec::new(),
        };
        let mut record = Record {
            waiting: (0..jobs).rev().map(job).collect(),
            samples: vec![Vec::new(); jobs],
            outcomes: vec![None; jobs],
        };
        run(&program, None, settings, &[0], level, &mut record);
        assert!(record.outcomes.iter().all(|o| matches!(o, Some(Ok(_)))), "{:?}", record.outcomes);
        record.samples
    }

    fn fixed(method: Method, step_s: f64) -> f64 {
        let control = Control::Fixed { step_s };
        let settings = SolverSettings { method, control, land_on_samples: true };
        pressures(settings, Level::Portable, 1)[0][4]
    }

    #[test]
    fn every_method_converges_with_its_order() {
        let exact = pressures(SolverSettings::reference(), Level::Portable, 1)[0][4];
        for (method, order, step) in [
            (Method::Rodas3, 3.0, 0.005),
            (Method::Rodas4P2, 4.0, 0.01),
            (Method::Rodas5P, 5.0, 0.02),
            (Method::RungeKutta4, 4.0, 0.02),
        ] {
            let coarse = fixed(method, step) - exact;
            let fine = fixed(method, step / 2.0) - exact;
            let ratio = (coarse / fine).abs();
            let expected = crate::math::power(2f64, order);
            assert!(ratio > 0.75 * expected, "{}: {coarse:e} {fine:e}", method.name());
        }
    }

    #[test]
    fn a_variant_is_the_same_alone_in_any_lane_and_at_any_level() {
        let settings = SolverSettings { method: Method::Rodas4P2, ..SolverSettings::of_runs() };
        let together = pressures(settings, Level::Portable, 11);
        for level in crate::lanes::ALL.into_iter().filter(|l| l.available()) {
            assert_eq!(pressures(settings, level, 11), together, "{}", level.name());
        }
        assert_eq!(pressures(settings, Level::best(), 1)[0], together[0]);
    }

    #[test]
    fn dense_output_agrees_with_landing() {
        for method in [Method::Rodas4P2, Method::Rodas5P] {
            let control = Control::Adaptive {
                tolerance: 1e-9,
                max_step_s: 1.0,
                attempt_rate_limit_per_s: f64::INFINITY,
            };
            let landing = SolverSettings { method, control, land_on_samples: true };
            let dense = SolverSettings { land_on_samples: false, ..landing };
            let a = &pressures(landing, Level::best(), 1)[0];
            let b = &pressures(dense, Level::best(), 1)[0];
            for (a, b) in a.iter().zip(b) {
                assert!((a - b).abs() < 2e7 * 1e-6, "{}: {a} {b}", method.name());
            }
        }
    }
}
