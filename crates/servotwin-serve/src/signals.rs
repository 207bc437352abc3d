//! What a frame contains: the signals with their names, units and bands, and how a sample fills them.

use servotwin::live::closed_loop::ClosedLoopFlight;
use servotwin::live::tracking::{TrackedQuantities, force_fight_n};
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::{Diagnoser, Raised};
use servotwin_model::spec::Unit;
use servotwin_watch::player::{PlayerSignal, SignalGroup};

/// A sample of which a frame shows the signals.
pub struct ShownSample<'s> {
    /// The simulated flight.
    pub flight: &'s ClosedLoopFlight<'s>,
    /// The same flight without a diagnosis.
    pub ghost: &'s ClosedLoopFlight<'s>,
    /// The action of this sample. What it reacts to is forgotten, and its evidence with it.
    pub raised: Option<Raised>,
}

/// The value of a signal in a sample, in the unit that is shown.
type Value = Box<dyn Fn(&ShownSample) -> f64>;

/// The signals of a frame.
#[derive(Default)]
pub struct Signals {
    /// The signals in the order of a frame.
    pub(crate) list: Vec<PlayerSignal>,
    values: Vec<Value>,
}

impl Signals {
    /// The signals of simulated flights.
    pub fn of_flights(study: &Study, diagnoser: &Diagnoser) -> Self {
        let mut signals = Signals::default();
        signals.command(study);
        signals.answer(study);
        signals.fight(study);
        signals.sensors(study, diagnoser);
        signals.evidence(diagnoser);
        signals.fluid(study);
        signals.modes(study);
        signals
    }

    fn push(&mut self, signal: PlayerSignal, value: impl Fn(&ShownSample) -> f64 + 'static) {
        self.list.push(signal);
        self.values.push(Box::new(value));
    }

    fn command(&mut self, study: &Study) {
        let (place, unit) = command(study);
        let signal = PlayerSignal::new("command", "command", unit.shown(), SignalGroup::Motion);
        self.push(signal, move |sample| unit.to_shown(sample.flight.inputs()[place]));
    }

    fn answer(&mut self, study: &Study) {
        let (_, unit) = command(study);
        let shown =
            |id: &str, label| PlayerSignal::new(id, label, unit.shown(), SignalGroup::Motion);
        if let Some(slot) = TrackedQuantities::of(study).following_slot() {
            self.push(shown("position", "answer"), move |s| unit.to_shown(s.flight.plant(slot)));
            let ghost = shown("position_ghost", "without diagnosis");
            self.push(ghost, move |sample| unit.to_shown(sample.ghost.plant(slot)));
        }
    }

    /// The force fight between the rods, if there are several.
    fn fight(&mut self, study: &Study) {
        let rods = TrackedQuantities::of(study).rod_slots(study).unwrap_or_default();
        if rods.len() < 2 {
            return;
        }
        let fight_kn = |forces_n: Vec<f64>| force_fight_n(&forces_n).map_or(f64::NAN, |n| n / 1e3);
        let newtons = |id, label| PlayerSignal::new(id, label, "kN", SignalGroup::Fight);
        let ghosts = rods.clone();
        self.push(newtons("fight", "force fight"), move |sample| {
            fight_kn(rods.iter().map(|&slot| sample.flight.plant(slot)).collect())
        });
        self.push(newtons("fight_ghost", "without diagnosis"), move |sample| {
            fight_kn(ghosts.iter().map(|&slot| sample.ghost.plant(slot)).collect())
        });
    }

    fn sensors(&mut self, study: &Study, diagnoser: &Diagnoser) {
        for (place, sensor) in diagnoser.sensors.iter().enumerate() {
            let declared = study.system.sensor(&sensor.name).expect("the diagnoser fits the study");
            let (id, label, unit) = (&declared.id, &declared.label, declared.unit);
            let actuator = sensor.actuator.map(|actuator| actuator as usize);
            let id_of = |what| format!("{id}.{what}");
            let reading = SignalGroup::Reading;
            let reading = PlayerSignal::new(&id_of("reading"), label, unit.shown(), reading);
            let residual = PlayerSignal::residual(&id_of("residual"), label, diagnoser, id);
            self.push(PlayerSignal { actuator, ..reading }, move |sample| {
                unit.to_shown(sample.flight.measured()[place])
            });
            self.push(PlayerSignal { actuator, ..residual }, move |sample| {
                let (measured, twin) =
                    (sample.flight.measured()[place], sample.flight.expected()[place]);
                100.0 * sample.flight.session().residual(place, measured, twin)
            });
        }
    }

    /// The largest evidence of all lengths. An action that is raised in this sample has reached its limit.
    fn evidence(&mut self, diagnoser: &Diagnoser) {
        let (names, lengths) = (diagnoser.names(), diagnoser.lengths.len());
        for (actuator, own_name) in names.actuators.iter().enumerate() {
            for (action, name) in names.actions.iter().enumerate() {
                let words = format!("{own_name} {name}").trim().replace('_', " ");
                let id = format!("evidence.{own_name}.{name}");
                let signal = PlayerSignal::new(&id, &words, "of limit", SignalGroup::Evidence);
                let (own, band) = (Some(actuator), Some(1.0));
                let signal = PlayerSignal { actuator: own, band, ..signal };
                self.push(signal, move |sample| {
                    let raised = sample.raised.map(|r| (r.actuator as usize, r.action as usize));
                    let least = if raised == Some((actuator, action)) { 1.0 } else { 0.0 };
                    let of = |length| sample.flight.session().evidence(length, actuator, action);
                    (0..lengths).map(of).fold(least, f64::max)
                });
            }
        }
    }

    fn fluid(&mut self, study: &Study) {
        for (place, reservoir) in study.system.reservoirs.iter().enumerate() {
            let (id, label) = (format!("fluid.{}", reservoir.id), reservoir.id.replace('_', " "));
            let ghost_id = format!("{id}_ghost");
            let both = [(id, label.as_str()), (ghost_id, "without diagnosis")];
            for (which, (id, label)) in both.iter().enumerate() {
                let signal = PlayerSignal::new(id, label, "L", SignalGroup::Fluid);
                self.push(signal, move |sample| {
                    let flight = [sample.flight, sample.ghost][which];
                    1e3 * flight.fluid_m3().nth(place).unwrap_or(f64::NAN)
                });
            }
        }
    }

    fn modes(&mut self, study: &Study) {
        for (actuator, name) in study.actuators.iter().enumerate() {
            let id = if name.is_empty() { "mode".into() } else { format!("{name}.mode") };
            let inputs = &study.system.network().inputs;
            if let Some(place) = inputs.iter().position(|input| input.id == id) {
                let signal = PlayerSignal::new(&id, "mode", "", SignalGroup::Mode);
                let signal = PlayerSignal { actuator: Some(actuator), ..signal };
                self.push(signal, move |sample| sample.flight.inputs()[place]);
            }
        }
    }

    /// Appends the values of a sample, in shown units.
    pub fn fill(&self, sample: &ShownSample, out: &mut Vec<f32>) {
        out.extend(self.values.iter().map(|value| value(sample) as f32));
    }
}

/// The place and the unit of the command.
fn command(study: &Study) -> (usize, Unit) {
    let place = study.command_input;
    (place, study.system.network().inputs[place].unit)
}
