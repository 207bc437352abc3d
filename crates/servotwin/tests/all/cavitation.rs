//! Fluid without air under tension: no absolute pressure falls below vapor pressure, and a cavity closes when the liquid
//! that it has lost is back.

use servotwin::ensemble::Ensemble;
use servotwin::ensemble::Variant;
use servotwin::signal::Signal;
use servotwin::system::System;
use servotwin::validity::{CrossedLimit, ValidityMonitor};
use servotwin_model::fluid::{Fluid, FluidKind, VAPOR_PRESSURE_PA, compressibility_per_pa};
use servotwin_model::solver::{Control, Method, SolverSettings};

const BAR: f64 = 1e5;
const PERIOD_S: f64 = 5e-5;
const SLAM: &str = include_str!("../cavitation/slam.toml");
const HAMMER: &str = include_str!("../cavitation/hammer.toml");

/// A run of a system whose valves move.
struct Case<'c> {
    text: &'c str,
    opening: &'c str,
    set: &'c [(&'c str, f64)],
    duration_s: f64,
}

impl Case<'_> {
    /// The samples of what is recorded.
    fn run(&self, record: &[&str]) -> Vec<Vec<f64>> {
        let system = System::parse(self.text, "case.toml").unwrap_or_else(|e| panic!("{e}"));
        let program = &system.program;
        let opening: Signal = self.opening.parse().unwrap();
        let opening = system.driven(0, &opening, self.duration_s).unwrap();
        let set = |&(id, value): &(&str, f64)| {
            let (component, parameter) = system.parameter(id).unwrap();
            (component, parameter, value)
        };
        let variant = Variant {
            overrides: self.set.iter().map(set).collect(),
            inputs: vec![&opening],
            ..Variant::default()
        };
        let mut ensemble = Ensemble::new(program);
        let control = Control::within(1e-5);
        ensemble.settings =
            SolverSettings { method: Method::Rodas4P2, control, land_on_samples: true };
        ensemble.duration_s = self.duration_s;
        ensemble.sample_period_s = PERIOD_S;
        ensemble.record = record.iter().map(|id| program.observable(id).unwrap().slot).collect();
        ensemble.run_one(&variant).unwrap_or_else(|failure| panic!("{failure:?}")).0
    }
}

/// The valves close in a millisecond at 1 m/s.
fn hard_slam() -> Case<'static> {
    Case {
        text: SLAM,
        opening: "ramp:rate=100,to=1,at=0.05s + ramp:rate=-2000,to=-1,at=0.15s",
        set: &[("valve_in.area_m2", 2e-5), ("valve_out.area_m2", 2e-5)],
        duration_s: 0.3,
    }
}

/// A valve closes at the end of a line at a low supply pressure.
fn parting_column() -> Case<'static> {
    Case {
        text: HAMMER,
        opening: "constant:value=1 + ramp:rate=-1000,to=-1,at=0.1s",
        set: &[("supply.pressure_pa", 2e6), ("valve.area_m2", 3e-5)],
        duration_s: 0.3,
    }
}

fn lowest(samples: &[f64]) -> f64 {
    samples.iter().copied().fold(f64::INFINITY, f64::min)
}

fn highest(samples: &[f64]) -> f64 {
    samples.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// The first stretch of samples at vapor pressure.
fn cavity(pressure: &[f64]) -> std::ops::Range<usize> {
    let is_parted = |pa: &f64| *pa <= VAPOR_PRESSURE_PA;
    let from = pressure.iter().position(is_parted).expect("a cavity");
    let length = pressure[from..].iter().position(|pa| !is_parted(pa)).expect("it closes");
    from..from + length
}

/// HLP 46 without air at 40 °C.
fn compressibility(pa: f64) -> f64 {
    let fluid = Fluid { kind: FluidKind::Hlp46, air_fraction: 0.0, ..Fluid::default() };
    compressibility_per_pa(&fluid.at::<f64>(313.15).bulk.to_array(), pa)
}

/// ∫ dp/E from `from` to `to`, by the midpoint rule.
fn strain(from: f64, to: f64) -> f64 {
    const PARTS: usize = 200;
    let step = (to - from) / PARTS as f64;
    let middle = |k: usize| from + (k as f64 + 0.5) * step;
    (0..PARTS).map(|k| compressibility(middle(k)) * step).sum()
}

#[test]
fn a_slammed_valve_never_pulls_a_chamber_below_vapor_pressure() {
    let samples = hard_slam().run(&["cylinder.pressure_a_pa", "cylinder.pressure_b_pa"]);
    for pressure in &samples {
        assert_eq!(lowest(pressure), VAPOR_PRESSURE_PA);
    }
    // The first compression is that of the energy of the load, with or without a cavity after it.
    assert!((highest(&samples[1]) / BAR - 447.8).abs() < 0.5, "{}", highest(&samples[1]) / BAR);
}

#[test]
fn a_gentle_stop_rings_as_a_mass_between_two_oil_springs() {
    let gentle = Case {
        opening: "ramp:rate=100,to=1,at=0.1s + ramp:rate=-2000,to=-1,at=0.3s",
        set: &[],
        duration_s: 0.6,
        ..hard_slam()
    };
    let samples =
        gentle.run(&["cylinder.pressure_a_pa", "cylinder.pressure_b_pa", "cylinder.velocity_m_s"]);
    let after = (0.31 / PERIOD_S) as usize;
    let (a, b, velocity) = (&samples[0][after..], &samples[1][after..], &samples[2][after..]);
    assert!((highest(b) / BAR - 140.6).abs() < 0.3, "{}", highest(b) / BAR);
    assert!((lowest(a) / BAR - 82.8).abs() < 0.4, "{}", lowest(a) / BAR);
    let turns = velocity.windows(2).filter(|v| v[0] < 0.0 && v[1] >= 0.0);
    let crossings: Vec<usize> =
        (1..velocity.len()).filter(|&k| velocity[k - 1] < 0.0 && velocity[k] >= 0.0).collect();
    assert_eq!(turns.count(), crossings.len());
    let (first, last) = (crossings[0], crossings[crossings.len() - 1]);
    let hertz = (crossings.len() - 1) as f64 / ((last - first) as f64 * PERIOD_S);
    assert!((hertz - 61.6).abs() < 0.1, "{hertz}");
    // Without friction and leakage the last swing is as large as the first.
    let part = velocity.len() / 4;
    let (early, late) = (highest(&velocity[..part]), highest(&velocity[3 * part..]));
    assert!((late / early - 1.0).abs() < 2e-3, "{early} {late}");
}

#[test]
fn mass_is_conserved_over_a_cavitation_cycle() {
    // No oil enters or leaves chamber B after the slam: wherever it is full, its pressure follows from its volume alone,
    // ln V + ∫ dp/E = constant, before, between and after its cavities.
    let samples = hard_slam().run(&["cylinder.pressure_b_pa", "cylinder.position_m"]);
    let (pressure, position) = (&samples[0], &samples[1]);
    let closed = (0.1515 / PERIOD_S) as usize;
    let content = |k: usize| (4e-4 - 2e-3 * position[k]).ln() + strain(1e5, pressure[k]);
    let full = (closed..pressure.len()).filter(|&k| pressure[k] > 10.0 * BAR);
    let contents: Vec<f64> = full.map(content).collect();
    let (least, most) = (lowest(&contents), highest(&contents));
    assert!(contents.len() > 1000 && most - least < 2e-5, "{least} {most}");
    // And it was a cavity in between, of more than a hundredth of the chamber.
    let parted = (closed..pressure.len()).filter(|&k| pressure[k] <= VAPOR_PRESSURE_PA);
    let gap = parted.map(|k| (4e-4 - 2e-3 * position[k]).ln() + strain(1e5, 20.0) - least);
    let gap = gap.fold(0.0, f64::max);
    assert!(gap > 0.01, "{gap}");
}

#[test]
fn a_parted_column_returns() {
    let record = ["line.pressure_pa", "line.flow_to_b_m3_s", "line.flow_m3_s"];
    let samples = parting_column().run(&record);
    let (pressure, flow) = (&samples[0], &samples[1]);
    let cavity = cavity(pressure);
    assert!(lowest(pressure) >= VAPOR_PRESSURE_PA);
    let after = highest(&pressure[cavity.end..]);
    assert!((20.0 * BAR..=80.0 * BAR).contains(&after), "{}", after / BAR);
    // The cavity lasts about as long as the supply pressure needs to turn the column round: t = 2 L_h q/Δp, with 20 m of oil
    // of 864.6 kg/m³ in a bore of 20 mm. A column that is elastic takes longer.
    let inertia = 864.6 * 20.0 / (std::f64::consts::FRAC_PI_4 * 4e-4);
    let mean_flow = (samples[2][cavity.start] + 2.0 * flow[cavity.start]) / 3.0;
    let expected_s = 2.0 * inertia * -mean_flow / 20e5;
    let lasted_s = cavity.len() as f64 * PERIOD_S;
    assert!((1.0..1.3).contains(&(lasted_s / expected_s)), "{lasted_s} s, expected {expected_s} s");
    // It closes when as much oil is back as has left it.
    let left: f64 = flow[cavity.clone()].iter().map(|q| q * PERIOD_S).sum();
    let moved: f64 = flow[cavity.clone()].iter().map(|q| q.abs() * PERIOD_S).sum();
    assert!(left.abs() < 2e-3 * moved, "{left:e} of {moved:e} m³");
}

#[test]
fn a_column_that_does_not_part_rings_at_its_first_mode() {
    let case = Case { set: &[], duration_s: 0.8, ..parting_column() };
    let pressure = &case.run(&["line.pressure_pa"])[0];
    // Two modes reach 1.468 times the rise ρ c v, which is 30.8 bar.
    assert!((104.5..106.0).contains(&(highest(pressure) / BAR)), "{}", highest(pressure) / BAR);
    let after = &pressure[(0.11 / PERIOD_S) as usize..];
    let middle = 60.0 * BAR;
    let crossings: Vec<usize> =
        (1..after.len()).filter(|&k| after[k - 1] < middle && after[k] >= middle).collect();
    let (first, last) = (crossings[0], crossings[crossings.len() - 1]);
    let hertz = (crossings.len() - 1) as f64 / ((last - first) as f64 * PERIOD_S);
    // The quarter wave of a sound speed of 1281 m/s has 16.0 Hz.
    assert!((hertz - 15.3).abs() < 0.15, "{hertz}");
}

#[test]
fn a_cavity_is_reported_with_its_place_and_time() {
    let system = System::parse(HAMMER, "hammer.toml").unwrap();
    let mut monitor = ValidityMonitor::new(&system, PERIOD_S, &[]);
    let names: Vec<String> = monitor
        .slots()
        .map(|slot| {
            let of = |o: &&servotwin_model::program::Observable| o.slot == slot;
            system.program.observables().iter().find(of).unwrap().name.clone()
        })
        .collect();
    assert!(names.contains(&"line.pressure_pa".into()), "{names:?}");
    let record: Vec<&str> = names.iter().map(String::as_str).collect();
    let samples = parting_column().run(&record);
    for index in 0..samples[0].len() {
        let values: Vec<f64> = samples.iter().map(|column| column[index]).collect();
        monitor.sample(index, &values);
    }
    let findings = monitor.findings();
    // The column parts in its middle too.
    let names: Vec<&str> = findings.iter().map(|finding| finding.name.as_str()).collect();
    assert_eq!(names, ["line.middle_pressure_pa", "line.pressure_pa"]);
    let finding = &findings[1];
    assert_eq!((finding.limit, finding.name.as_str()), (CrossedLimit::Vapor, "line.pressure_pa"));
    assert!((finding.first_s - 0.1411).abs() < 1e-3 && finding.duration_s > 0.04, "{finding:?}");
}
