//! Like actuators with four sensors each and one at the surface, their faults, and a diagnoser
//! trained on recordings of them.

use servotwin_diagnosis::baseline;
use servotwin_diagnosis::diagnoser::environment::{InputDifference, InputRange};
use servotwin_diagnosis::diagnoser::{
    DiagnosedSensor, Diagnoser, FORMAT, InputChecks, Length, Tuning, decision,
};
use servotwin_diagnosis::features::Quantity;
use servotwin_diagnosis::hierarchy::Names;
use servotwin_diagnosis::panel::{Panel, SensorBand};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::residual::{DividedSample, Window};
use servotwin_diagnosis::sliding::{Sliding, WindowSpan};
use servotwin_diagnosis::spread::Spread;
use servotwin_learning::classifiers;
use servotwin_learning::hierarchy::{HierarchySettings, Label};
use std::sync::{Arc, OnceLock};

mod lessons;

use lessons::Lessons;

pub const PERIOD_S: f64 = 0.01;
/// Sensors of two actuators and their surface.
pub const SENSORS: usize = sensors_of(2);
pub const COMMANDS: [&str; 3] = ["shut_down", "change_mode", "warning"];
const NOISE: f64 = 0.002;
const BAND: f64 = 0.02;
const SPANS: [WindowSpan; 2] =
    [WindowSpan { pane_samples: 10, panes: 5 }, WindowSpan { pane_samples: 50, panes: 4 }];

pub const fn sensors_of(actuators: usize) -> usize {
    4 * actuators + 1
}

/// What is broken: the detail, each with its command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Both chambers lose pressure.
    Leak,
    /// The ram lags behind.
    Jam,
    /// One pressure sensor errs.
    Bias,
    /// The spool trembles.
    Wear,
}

pub const KINDS: [Kind; 4] = [Kind::Leak, Kind::Jam, Kind::Bias, Kind::Wear];

impl Kind {
    pub fn action(self) -> u32 {
        match self {
            Kind::Leak | Kind::Jam => 0,
            Kind::Bias => 1,
            Kind::Wear => 2,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Fault {
    pub actuator: usize,
    pub kind: Kind,
    pub size: f64,
}

/// One recording: its command and specimen are drawn from a seed. `S` is the number of sensors.
pub struct Flight<const S: usize = SENSORS> {
    random: Random,
    phases: [f64; 4],
    tolerances: [f64; S],
    pub sample: u64,
}

impl Flight {
    pub fn new(seed: u64) -> Self {
        Flight::of(seed)
    }
}

impl<const S: usize> Flight<S> {
    pub fn of(seed: u64) -> Self {
        let mut random = Random::stream(17, seed);
        let phases = std::array::from_fn(|_| random.between(0.3, 1.7));
        let tolerances = std::array::from_fn(|_| random.between(-0.02, 0.02));
        Flight { random, phases, tolerances, sample: 0 }
    }

    fn noise(&mut self) -> f64 {
        NOISE * ((0..12).map(|_| self.random.unit()).sum::<f64>() - 6.0)
    }

    /// Values from outside, measured values and the twin's. Sensors: ram, spool, both chambers of
    /// each unit, and the surface.
    pub fn next(&mut self, fault: Option<Fault>) -> ([f64; 3], [f64; S], [f64; S]) {
        let t = self.sample as f64 * PERIOD_S;
        self.sample += 1;
        let [a, b, c, d] = self.phases;
        let ram = 0.5 * (a * t).sin() + 0.2 * (2.3 * b * t).sin();
        let spool = 0.3 * (a * t).cos() + 0.2 * (2.9 * c * t).cos();
        let load = 0.3 * (0.7 * d * t).sin();
        let of_unit = [ram, spool, 0.5 + 0.4 * load, 0.5 - 0.4 * load];
        let twin = std::array::from_fn(|i| if i == S - 1 { ram } else { of_unit[i % 4] });
        let mut measured: [f64; S] = twin;
        for (value, tolerance) in measured.iter_mut().zip(self.tolerances) {
            *value += tolerance;
        }
        if let Some(fault) = fault {
            let own = &mut measured[4 * fault.actuator..4 * fault.actuator + 4];
            match fault.kind {
                Kind::Leak => {
                    own[2] -= fault.size * (0.2 + 0.1 * spool);
                    own[3] -= fault.size * (0.2 - 0.1 * spool);
                }
                Kind::Jam => own[0] -= fault.size * (0.1 + 0.4 * ram),
                Kind::Bias => own[2] += 0.3 * fault.size,
                Kind::Wear => own[1] += 0.3 * fault.size * (40.0 * t).sin(),
            }
        }
        for value in &mut measured {
            *value += self.noise();
        }
        let supply = 2.1e7 + 1e4 * self.noise();
        ([supply, 5e5, 300.0 + 1e3 * self.noise()], measured, twin)
    }
}

pub fn names(actuators: usize) -> Names {
    let list = |words: &[&str]| words.iter().map(|&word| word.into()).collect();
    Names {
        features: vec![],
        actuators: (1..=actuators).map(|actuator| format!("actuator_{actuator}")).collect(),
        actions: list(&COMMANDS),
        details: list(&["leak", "jam", "bias", "wear"]),
    }
}

fn sensors(actuators: usize) -> Vec<DiagnosedSensor> {
    let quantities = [Quantity::Ram, Quantity::Spool, Quantity::PressureA, Quantity::PressureB];
    let sensor = |name: String, quantity, actuator| DiagnosedSensor {
        name,
        quantity,
        actuator,
        scale: 1.0,
        noise: NOISE,
        is_noisy: true,
        follows: vec![],
        spread: None,
    };
    let mut sensors = vec![];
    for actuator in 0..actuators as u32 {
        for (place, &quantity) in quantities.iter().enumerate() {
            let name = format!("s{place}_{}", actuator + 1);
            // So little that training need not know of it.
            let spool = quantities.len() as u32 * actuator + 1;
            let spread =
                (quantity == Quantity::PressureB).then_some(Spread { spool, growth: 0.01 });
            sensors.push(DiagnosedSensor { spread, ..sensor(name, quantity, Some(actuator)) });
        }
    }
    sensors.push(sensor("surface".into(), Quantity::Surface, None));
    sensors
}

fn environment() -> InputChecks {
    let input = |name: &str, least, largest, frozen_after_s| InputRange {
        name: name.into(),
        least,
        largest,
        frozen_after_s,
    };
    let (of, minus) = ("supply_pa".into(), "tank_pa".into());
    InputChecks {
        inputs: vec![
            input("supply_pa", 0.0, 4e7, Some(0.2)),
            input("tank_pa", 0.0, 4e7, None),
            input("oil_k", 200.0, 420.0, Some(1.0)),
        ],
        differences: vec![InputDifference { of, minus, least: 1e6, largest: 4e7 }],
    }
}

fn label(fault: Option<Fault>, actuators: usize) -> Label {
    match fault {
        None => Label { actuator: actuators as u32, action: 0, detail: 0 },
        Some(Fault { actuator, kind, .. }) => {
            let detail = KINDS.iter().position(|known| *known == kind).unwrap() as u32;
            Label { actuator: actuator as u32, action: kind.action(), detail }
        }
    }
}

/// The fault of a training flight, in the first unit only: the others learn by the mirror.
fn fault_of(flight: u32) -> Option<Fault> {
    let mut random = Random::stream(5, u64::from(flight));
    let size = random.between(0.3, 1.0);
    let kind = KINDS.get(flight as usize % 6).copied();
    kind.map(|kind| Fault { actuator: 0, kind, size })
}

/// Windows that left their bands, by length.
fn lessons<const S: usize>(empty: &Diagnoser, actuators: usize) -> Vec<Lessons> {
    const FLIGHTS: u32 = 90;
    const ONSET: u64 = 150;
    let new = || Lessons::new(empty.sensors_seen(), actuators).unwrap();
    let mut lessons = vec![new(), new()];
    for group in 0..FLIGHTS {
        let mut flight = Flight::<S>::of(u64::from(group));
        let mut sliding = Sliding::new(Window::watching(S, S - 1), &SPANS).unwrap();
        for k in 0..600 {
            let fault = fault_of(group).filter(|_| k >= ONSET);
            let (_, measured, twin) = flight.next(fault);
            let (judged, ones) = (&measured, &[1.0; S]);
            sliding.add(&DividedSample {
                judged,
                measured: judged,
                twin: &twin,
                scales: ones,
                spreads: ones,
            });
            for (length, lessons) in lessons.iter_mut().enumerate() {
                let is_thin = length == 1 || k / 10 % 3 == 0;
                let span = sliding.span(length);
                let window = span.window();
                let shows = window.largest_of_all() > BAND;
                if span.has_ended() && span.is_full() && is_thin && shows {
                    lessons.take(window, label(fault, actuators), group).unwrap();
                }
            }
        }
    }
    lessons
}

fn learn(span: WindowSpan, lessons: &Lessons, actuators: usize) -> Length {
    let examples = lessons.examples(&names(actuators)).unwrap();
    let rows: Vec<usize> = (0..examples.labels().len()).collect();
    let boosted = classifiers::boosted_trees::Settings {
        trees: 20,
        max_depth: 3,
        learning_rate: 0.3,
        ..Default::default()
    };
    let boosted = HierarchySettings::all(classifiers::Settings::BoostedTrees(boosted));
    let band = |s: DiagnosedSensor| SensorBand { sensor: s.name, half_width: BAND };
    let panel = Panel {
        bands: sensors(actuators).into_iter().take(4 * actuators).map(band).collect(),
        least_confidence: None,
        trees: HierarchySettings::default().fit(&examples, &rows).unwrap(),
        committee: boosted.fit(&examples, &rows).unwrap(),
    };
    let novelty =
        servotwin_learning::novelty::learn(&examples, &rows, lessons.groups(), 0.999).unwrap();
    Length { span, panel, novelty, baseline_corrected: None }
}

/// A trained diagnoser; trained once for each test binary.
pub fn diagnoser() -> Arc<Diagnoser> {
    static TRAINED: OnceLock<Arc<Diagnoser>> = OnceLock::new();
    TRAINED.get_or_init(|| train::<SENSORS>(2)).clone()
}

pub const BASELINE: baseline::BaselineSettings =
    baseline::BaselineSettings { settle_samples: 205, memory_samples: 2000 };
pub const ALLOWANCES: decision::Allowances =
    decision::Allowances { of_pairs_nats: 0.5, health_nats: 0.0, off_nats: 0.0, other_nats: 0.0 };

/// The trained diagnoser, of short windows beyond a reference too: the third length.
pub fn with_baseline() -> Diagnoser {
    let mut diagnoser = (*diagnoser()).clone();
    let baseline_corrected = Some(ALLOWANCES);
    diagnoser.lengths.push(Length { baseline_corrected, ..diagnoser.lengths[0].clone() });
    diagnoser.baseline = Some(BASELINE);
    diagnoser
}

/// The same for another number of actuators; `S` is that of their sensors.
pub fn train<const S: usize>(actuators: usize) -> Arc<Diagnoser> {
    let mut diagnoser = Diagnoser {
        format: FORMAT.into(),
        period_s: PERIOD_S,
        sensors: sensors(actuators),
        environment: environment(),
        boundaries: vec![],
        lengths: vec![],
        baseline: None,
        scatter: None,
        healthy_evidence: None,
        recorded: None,
        tuning: Tuning {
            allowance_nats: ALLOWANCES.of_pairs_nats,
            health_allowance_nats: ALLOWANCES.health_nats,
            off_allowance_nats: ALLOWANCES.off_nats,
            other_allowance_nats: ALLOWANCES.other_nats,
            ..Tuning::usual(&names(actuators), &["shut_down"])
        },
    };
    let lessons = lessons::<S>(&diagnoser, actuators);
    let pairs = SPANS.iter().zip(&lessons);
    diagnoser.lengths = pairs.map(|(&span, lessons)| learn(span, lessons, actuators)).collect();
    Arc::new(diagnoser)
}
