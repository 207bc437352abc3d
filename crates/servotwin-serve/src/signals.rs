//! What a frame contains: the signals with their names, units and bands, and how a sample fills them.

use serde::Serialize;
use servotwin::flight::closed_loop::ClosedLoopFlight;
use servotwin::flight::runtime::Runtime;
use servotwin::flight::tracking::{TrackedQuantities, force_fight_n};
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::{Diagnoser, Raised, Session};
use servotwin_diagnosis::features::Quantity;
use servotwin_model::program::Slot;
use servotwin_model::spec::Unit;

/// The part of the page that shows a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PagePart {
    /// Command, what follows it, and the same without a diagnosis.
    Motion,
    /// The force fight, with and without a diagnosis.
    Fight,
    /// A sensor reading.
    Reading,
    /// A residual, in percent of its sensor's scale, and of its spread if that grows.
    Residual,
    /// The evidence for an action of an actuator, in parts of the limit to raise it.
    Evidence,
    /// The fluid left in a reservoir.
    Fluid,
    /// Whether an actuator is on.
    Mode,
}

/// A signal of a frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Signal {
    /// The id, unique in a frame.
    pub id: String,
    /// The name to be shown.
    pub label: String,
    /// The unit of the values.
    pub unit: String,
    /// The part of the page.
    pub group: PagePart,
    /// The index of the actuator; `None` if it belongs to none.
    pub actuator: Option<usize>,
    /// Half the width of the band, in the signal's unit.
    pub band: Option<f64>,
    /// What a sensor measures, as study files call it; `None` for other signals.
    pub quantity: Option<&'static str>,
    /// The scale of a sensor, in the signal's unit; `None` for other signals.
    pub scale: Option<f64>,
}

impl Signal {
    fn new(id: &str, label: &str, unit: &str, group: PagePart) -> Self {
        Signal {
            id: id.into(),
            label: label.into(),
            unit: unit.into(),
            group,
            actuator: None,
            band: None,
            quantity: None,
            scale: None,
        }
    }
}

/// Where a value comes from.
#[derive(Clone, Copy, Debug)]
enum Source {
    Input(usize, Unit),
    Variable(Slot, Unit),
    Ghost(Slot, Unit),
    Fight,
    GhostFight,
    Reading(usize, Unit),
    Residual(usize),
    Evidence(usize, usize),
    Fluid(usize),
    GhostFluid(usize),
}

/// A sample of which a frame shows the signals. All values are SI.
pub struct ShownSample<'s> {
    /// The inputs, in the order of the system.
    pub inputs: &'s [f64],
    /// The sensor values, in the order of the diagnoser.
    pub measured: &'s [f64],
    /// The values that the twin expects, in the same order.
    pub expected: &'s [f64],
    /// The diagnosis.
    pub session: &'s Session,
    /// The action of this sample. What it reacts to is forgotten, and its evidence with it.
    pub raised: Option<Raised>,
    /// Where the other quantities come from.
    pub beside: Beside<'s>,
}

/// What there is besides inputs, sensors and the diagnosis.
pub enum Beside<'s> {
    /// A simulated flight and its ghost, which know every quantity of the plant.
    Flights(&'s ClosedLoopFlight<'s>, &'s ClosedLoopFlight<'s>),
    /// The twin of an actuator that is measured.
    Twin(&'s Runtime<'s>),
}

impl<'s> ShownSample<'s> {
    /// The last sample of a flight and its ghost.
    pub fn of_flights(
        flight: &'s ClosedLoopFlight,
        ghost: &'s ClosedLoopFlight,
        raised: Option<Raised>,
    ) -> Self {
        ShownSample {
            inputs: flight.inputs(),
            measured: flight.measured(),
            expected: flight.expected(),
            session: flight.session(),
            raised,
            beside: Beside::Flights(flight, ghost),
        }
    }

    /// A variable of the plant, or of the twin where no plant is simulated.
    fn variable(&self, slot: Slot) -> f64 {
        match self.beside {
            Beside::Flights(flight, _) => flight.plant(slot),
            Beside::Twin(runtime) => runtime.value(slot),
        }
    }

    /// A variable of the ghost; NaN without one.
    fn ghost(&self, slot: Slot) -> f64 {
        match self.beside {
            Beside::Flights(_, ghost) => ghost.plant(slot),
            Beside::Twin(_) => f64::NAN,
        }
    }

    /// The fluid in a reservoir of the plant and of the ghost; NaN where none is simulated.
    fn fluid_m3(&self, reservoir: usize) -> [f64; 2] {
        match self.beside {
            Beside::Flights(flight, ghost) => {
                [flight, ghost].map(|flight| flight.fluid_m3().nth(reservoir).unwrap_or(f64::NAN))
            }
            Beside::Twin(_) => [f64::NAN; 2],
        }
    }
}

/// The signals of a frame.
pub struct Signals {
    /// The signals in the order of a frame.
    pub list: Vec<Signal>,
    sources: Vec<Source>,
    /// The rod forces of all actuators; empty if one has no rod.
    rods: Vec<Slot>,
    lengths: usize,
}

impl Signals {
    /// The signals of simulated flights.
    pub fn of_flights(study: &Study, diagnoser: &Diagnoser) -> Self {
        let mut signals = Signals::empty(diagnoser);
        signals.command(study);
        signals.motion(study);
        signals.sensors(study, diagnoser);
        signals.evidence(diagnoser);
        signals.fluid(study);
        signals.modes(study);
        signals
    }

    /// The signals of an actuator that is measured.
    pub(crate) fn of_measured(study: &Study, diagnoser: &Diagnoser) -> Self {
        let mut signals = Signals::empty(diagnoser);
        signals.command(study);
        signals.expected_answer(study);
        signals.sensors(study, diagnoser);
        signals.evidence(diagnoser);
        signals.modes(study);
        signals
    }

    fn empty(diagnoser: &Diagnoser) -> Self {
        let lengths = diagnoser.lengths.len();
        Signals { list: vec![], sources: vec![], rods: vec![], lengths }
    }

    fn push(&mut self, signal: Signal, source: Source) {
        self.list.push(signal);
        self.sources.push(source);
    }

    fn command(&mut self, study: &Study) {
        let input = &study.system.network().inputs[study.command_input];
        let signal = Signal::new("command", "command", input.unit.shown(), PagePart::Motion);
        self.push(signal, Source::Input(study.command_input, input.unit));
    }

    fn expected_answer(&mut self, study: &Study) {
        let unit = study.system.network().inputs[study.command_input].unit;
        if let Some(slot) = TrackedQuantities::of(study).following_slot() {
            let label = "answer expected by the twin";
            let signal = Signal::new("position_twin", label, unit.shown(), PagePart::Motion);
            self.push(signal, Source::Variable(slot, unit));
        }
    }

    fn motion(&mut self, study: &Study) {
        let unit = study.system.network().inputs[study.command_input].unit;
        let shown = |id: &str, label: &str| Signal::new(id, label, unit.shown(), PagePart::Motion);
        let tracked = TrackedQuantities::of(study);
        if let Some(slot) = tracked.following_slot() {
            self.push(shown("position", "answer"), Source::Variable(slot, unit));
            self.push(shown("position_ghost", "without diagnosis"), Source::Ghost(slot, unit));
        }
        self.rods = tracked.rod_slots(study).unwrap_or_default();
        if self.rods.len() > 1 {
            let newtons = |id: &str, label: &str| Signal::new(id, label, "kN", PagePart::Fight);
            self.push(newtons("fight", "force fight"), Source::Fight);
            self.push(newtons("fight_ghost", "without diagnosis"), Source::GhostFight);
        }
    }

    fn sensors(&mut self, study: &Study, diagnoser: &Diagnoser) {
        for (place, sensor) in diagnoser.sensors.iter().enumerate() {
            let declared = study.system.sensor(&sensor.name).expect("the diagnoser fits the study");
            let (id, label, unit) = (&declared.id, &declared.label, declared.unit);
            let actuator = sensor.actuator.map(|actuator| actuator as usize);
            let band = diagnoser.lengths[0].panel.bands.get(place);
            let quantity = Quantity::ALL.iter().find(|(known, _)| *known == sensor.quantity);
            let reading = Signal {
                actuator,
                quantity: quantity.map(|(_, name)| *name),
                scale: Some(unit.difference_to_shown(sensor.scale)),
                ..Signal::new(&format!("{id}.reading"), label, unit.shown(), PagePart::Reading)
            };
            let unit_of_residual = format!("% of {}", sensor.residual_divisor());
            let residual = Signal {
                actuator,
                band: band.map(|band| 100.0 * band.half_width),
                ..Signal::new(
                    &format!("{id}.residual"),
                    label,
                    &unit_of_residual,
                    PagePart::Residual,
                )
            };
            self.push(reading, Source::Reading(place, unit));
            self.push(residual, Source::Residual(place));
        }
    }

    fn evidence(&mut self, diagnoser: &Diagnoser) {
        let names = diagnoser.names();
        for (actuator, unit) in names.actuators.iter().enumerate() {
            for (action, name) in names.actions.iter().enumerate() {
                let words = format!("{unit} {name}").trim().replace('_', " ");
                let id = format!("evidence.{unit}.{name}");
                let signal = Signal {
                    actuator: Some(actuator),
                    band: Some(1.0),
                    ..Signal::new(&id, &words, "of limit", PagePart::Evidence)
                };
                self.push(signal, Source::Evidence(actuator, action));
            }
        }
    }

    fn fluid(&mut self, study: &Study) {
        for (place, reservoir) in study.system.reservoirs.iter().enumerate() {
            let (id, label) = (format!("fluid.{}", reservoir.id), reservoir.id.replace('_', " "));
            let signal = Signal::new(&id, &label, "L", PagePart::Fluid);
            self.push(signal, Source::Fluid(place));
            let ghost =
                Signal::new(&format!("{id}_ghost"), "without diagnosis", "L", PagePart::Fluid);
            self.push(ghost, Source::GhostFluid(place));
        }
    }

    fn modes(&mut self, study: &Study) {
        for (actuator, unit) in study.units.iter().enumerate() {
            let id = if unit.is_empty() { "mode".into() } else { format!("{unit}.mode") };
            let inputs = &study.system.network().inputs;
            if let Some(place) = inputs.iter().position(|input| input.id == id) {
                let signal = Signal {
                    actuator: Some(actuator),
                    ..Signal::new(&id, "mode", "", PagePart::Mode)
                };
                self.push(signal, Source::Input(place, Unit::None));
            }
        }
    }

    /// Appends the values of a sample, in shown units.
    pub fn fill(&self, sample: &ShownSample, out: &mut Vec<f32>) {
        let fight_kn = |rod: &dyn Fn(Slot) -> f64| {
            let rods: Vec<f64> = self.rods.iter().map(|&slot| rod(slot)).collect();
            force_fight_n(&rods).map_or(f64::NAN, |newtons| newtons / 1e3)
        };
        let value = |source: &Source| match *source {
            Source::Input(input, unit) => unit.to_shown(sample.inputs[input]),
            Source::Variable(slot, unit) => unit.to_shown(sample.variable(slot)),
            Source::Ghost(slot, unit) => unit.to_shown(sample.ghost(slot)),
            Source::Fight => fight_kn(&|slot| sample.variable(slot)),
            Source::GhostFight => fight_kn(&|slot| sample.ghost(slot)),
            Source::Reading(sensor, unit) => unit.to_shown(sample.measured[sensor]),
            Source::Residual(sensor) => {
                let (measured, twin) = (sample.measured[sensor], sample.expected[sensor]);
                100.0 * sample.session.residual(sensor, measured, twin)
            }
            Source::Evidence(actuator, action) => {
                let of = |length| sample.session.evidence(length, actuator, action);
                let raises = |raised: Raised| {
                    (raised.actuator as usize, raised.action as usize) == (actuator, action)
                };
                let least = if sample.raised.is_some_and(raises) { 1.0 } else { 0.0 };
                (0..self.lengths).map(of).fold(least, f64::max)
            }
            Source::Fluid(reservoir) => 1e3 * sample.fluid_m3(reservoir)[0],
            Source::GhostFluid(reservoir) => 1e3 * sample.fluid_m3(reservoir)[1],
        };
        out.extend(self.sources.iter().map(|source| value(source) as f32));
    }
}
