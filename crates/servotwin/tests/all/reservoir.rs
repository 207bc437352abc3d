//! The reservoirs of the aileron: what a leak loses, what a shutdown keeps, and what happens when one is empty.

use servotwin::live::closed_loop::FlightRecord;
use servotwin::live::cost::Cost;
use servotwin::signal::Signal;
use servotwin::study::Study;
use servotwin::system::System;
use servotwin::system::reservoir::Level;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{Between, Knot, SolverSettings, Twin};

const PERIOD_S: f64 = 0.01;
const LITRE_M3: f64 = 1e-3;

struct Flight {
    system: System,
    fault: Option<(&'static str, f64)>,
    shut_down_s: f64,
    duration_s: f64,
}

/// What a flight leaves: the fluid of both reservoirs at each sample, and an observable.
struct Flown {
    fluid_m3: [Vec<f64>; 2],
    observed: Vec<f64>,
}

fn aileron(volume: &str) -> System {
    let text = include_str!("../../../../systems/aileron_dual.toml");
    let text = text.replace("volume_m3 = 12e-3", volume);
    System::parse(&text, "aileron.toml").unwrap_or_else(|error| panic!("{error}"))
}

impl Flight {
    fn healthy() -> Self {
        let system = aileron("volume_m3 = 12e-3");
        Flight { system, fault: None, shut_down_s: f64::INFINITY, duration_s: 15.0 }
    }

    /// Flies a moving command and records an observable.
    fn fly(&self, observable: &str) -> Flown {
        let system = &self.system;
        let program = &system.program;
        let inputs = &system.network().inputs;
        let place = |id: &str| inputs.iter().position(|input| input.id == id).unwrap();
        let command: Signal = "noise:rms=5deg,bandwidth=1Hz,seed=2".parse().unwrap();
        let command: Piecewise =
            command.build(inputs[place("command")].unit, self.duration_s).unwrap();
        let mut twin = Twin::new(
            program,
            SolverSettings::of_runs(),
            PERIOD_S,
            vec![Between::Hold; inputs.len()],
        );
        let faults: Vec<FaultAt> = self.fault.iter().map(|fault| named(system, *fault)).collect();
        let parameters = program.parameters_with(&[], &faults);
        twin.load(&parameters);
        let mut levels: Vec<Level> =
            system.reservoirs.iter().map(|reservoir| Level::full(system, reservoir)).collect();
        let slot = program.observable(observable).unwrap().slot;
        let mut flown = Flown { fluid_m3: [vec![], vec![]], observed: vec![] };
        for k in 0..(self.duration_s / PERIOD_S) as usize {
            let time_s = k as f64 * PERIOD_S;
            let mut values: Vec<f64> = inputs.iter().map(|input| input.default).collect();
            values[place("command")] = command.value(time_s);
            values[place("actuator_1.mode")] = f64::from(u8::from(time_s < self.shut_down_s));
            levels.iter().for_each(|level| level.limit(&mut values));
            let knots: Vec<Knot> = values.into_iter().map(Knot::from).collect();
            match k {
                0 => twin.settle(&knots, &program.first_guess(&parameters)).unwrap(),
                _ => twin.step(&knots).unwrap(),
            }
            for (level, fluid) in levels.iter_mut().zip(&mut flown.fluid_m3) {
                level.take(PERIOD_S, |slot| twin.value(slot));
                fluid.push(level.fluid_m3());
            }
            flown.observed.push(twin.value(slot));
        }
        flown
    }
}

fn named(system: &System, (id, intensity): (&str, f64)) -> FaultAt {
    let (component, fault) = system.program.find_fault(id).unwrap_or_else(|| panic!("{id}"));
    FaultAt { component, fault, intensity }
}

fn lost_m3(fluid: &[f64]) -> f64 {
    fluid[0] - fluid[fluid.len() - 1]
}

/// A record of 20 s without an action in which the first reservoir loses fluid from 5 s on, m³/s.
fn leaking(loss_m3_s: f64) -> FlightRecord {
    let time_s: Vec<f64> = (0..=2000).map(|k| f64::from(k) * PERIOD_S).collect();
    let first = time_s.iter().map(|time| (12e-3 - loss_m3_s * (time - 5.0).max(0.0)).max(0.0));
    let fluid_m3 = vec![first.collect(), vec![12e-3; time_s.len()]];
    FlightRecord { time_s, fluid_m3, ..FlightRecord::default() }
}

#[test]
fn the_cost_of_a_leak_is_its_fluid_and_the_time_that_is_left() {
    let study = Study::default();
    let cost = Cost::of(&study, &leaking(1e-5), 5.0);
    let [leaking_one, other] = &cost.fluids[..] else { panic!("two reservoirs") };
    assert!((leaking_one.lost_m3 - 15e-5).abs() < 1e-9);
    assert!((leaking_one.empty_s.unwrap() - 1200.0).abs() < 1.0, "12 L at 0.6 L/min");
    assert!(other.empty_s.is_none() && other.loss_m3_s < 1e-12);
    assert_eq!((cost.in_fault_s, cost.authority), (15.0, 1.0));
    // What would take longer than a day is no leak.
    assert_eq!(Cost::of(&study, &leaking(1e-7), 5.0).fluids[0].empty_s, None);
    // An empty reservoir takes its actuator the pressure, which is half of the authority.
    let empty = Cost::of(&study, &leaking(2e-3), 5.0);
    assert!((empty.fluids[0].empty_s.unwrap() - 6.0).abs() < 0.02);
    assert_eq!(empty.authority, 0.5);
}

/// Chambers and lines breathe with their pressures, which is some cubic centimetres.
const BREATHING_M3: f64 = 5e-6;

#[test]
fn a_healthy_actuator_gives_back_what_it_takes() {
    let flown = Flight::healthy().fly("actuator_1.cylinder.pressure_a_pa");
    for fluid in &flown.fluid_m3 {
        assert!(lost_m3(fluid).abs() < BREATHING_M3, "{:e}", lost_m3(fluid));
    }
}

#[test]
fn what_leaks_leaves_the_reservoir_of_its_own_system() {
    let flight = Flight { fault: Some(("actuator_1.leakage_a.leakage", 0.5)), ..Flight::healthy() };
    let flown = flight.fly("actuator_1.cylinder.pressure_a_pa");
    // The leak as an orifice in turbulent flow: C_d A sqrt(2 Δp / ρ), with C_d = 0.65 and ρ near 1,000 kg/m³.
    let area_m2 = 0.5 * 2e-7;
    let through = |pa: &f64| 0.65 * area_m2 * (2.0 * (pa - 101_325.0).max(0.0) / 1000.0).sqrt();
    let expected_m3: f64 = flown.observed.iter().map(through).sum::<f64>() * PERIOD_S;
    let [lost, other] = [lost_m3(&flown.fluid_m3[0]), lost_m3(&flown.fluid_m3[1])];
    println!("lost {:.4} L, expected {:.4} L", lost / LITRE_M3, expected_m3 / LITRE_M3);
    assert!((lost / expected_m3 - 1.0).abs() < 0.1, "{lost:e} {expected_m3:e}");
    assert!(other.abs() < BREATHING_M3, "{other:e}");
}

#[test]
fn a_shutdown_keeps_the_fluid_that_is_left() {
    let leak = Some(("actuator_1.leakage_supply.leakage", 0.5));
    let going_on = Flight { fault: leak, ..Flight::healthy() };
    let shut = Flight { fault: leak, shut_down_s: 5.0, ..Flight::healthy() };
    let [going_on, shut] =
        [going_on, shut].map(|flight| flight.fly("actuator_1.cylinder.pressure_a_pa"));
    let since = |flown: &Flown| lost_m3(&flown.fluid_m3[0][600..]);
    assert!(since(&going_on) > LITRE_M3, "{:e}", since(&going_on));
    assert!(since(&shut).abs() < BREATHING_M3, "{:e}", since(&shut));
}

#[test]
fn an_empty_reservoir_takes_its_actuator_the_pressure() {
    let system = aileron("volume_m3 = 0.5e-3");
    let fault = Some(("actuator_1.leakage_supply.leakage", 0.5));
    let flight = Flight { system, fault, ..Flight::healthy() };
    let flown = flight.fly("actuator_1.manifold_supply.pressure_pa");
    let [first, last] = [flown.observed[0], flown.observed[flown.observed.len() - 1]];
    assert!(first > 150e5, "{first}");
    assert!(last < 10e5, "{last}");
    assert!(flown.fluid_m3[0].last().is_some_and(|fluid| *fluid < 0.05 * 0.5e-3));
    assert!(flown.fluid_m3[1].iter().all(|fluid| (fluid - 0.5e-3).abs() < 2.0 * BREATHING_M3));
}
