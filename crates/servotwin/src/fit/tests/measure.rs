//! Measures the results quoted in docs/fit.md for the paper's study. They take minutes and run only on request:
//!
//! ```sh
//! cargo test --release -p servotwin --lib -- --ignored --nocapture measure_calibration_with_a_fault
//! cargo test --release -p servotwin --lib -- --ignored --nocapture measure_intensity
//! ```

use super::*;
use crate::ensemble::Rows;
use crate::experiment::calibration_record;
use crate::study::{Calibration, FaultCase};
use servotwin_learning::metrics::Rate;

fn setting(name: &str, default: usize) -> usize {
    std::env::var(name).map_or(default, |value| value.parse().expect("a number"))
}

fn percent(count: usize, of: usize) -> String {
    let rate = Rate::new(count as u64, of as u64);
    let share = 100.0 * count as f64 / of.max(1) as f64;
    format!("{count} of {of}: {share:.1} % ({:.1} … {:.1})", 100.0 * rate.low, 100.0 * rate.high)
}

/// Flies the calibration flight of a study for numbered specimens, each with its fault.
struct Rig<'s> {
    study: &'s Study,
    calibration: &'s Calibration,
    sensors: &'s [usize],
}

impl<'s> Rig<'s> {
    fn new(study: &'s Study) -> Self {
        let calibration = study.calibration.as_ref().expect("the study calibrates");
        Self { study, calibration, sensors: &study.measured[..study.base_sensors()] }
    }

    /// The sensors' samples without noise; `None` for variants that cannot be simulated.
    fn simulated(&self, specimens: &[(usize, Option<FaultAt>)]) -> Vec<Option<Vec<f64>>> {
        let Self { study, calibration, sensors } = *self;
        let realism = study.realism.as_ref().unwrap();
        let ensemble = Ensemble {
            record: study.system.sensor_slots(sensors),
            duration_s: calibration.duration_s,
            sample_period_s: study.sample_period_s,
            ..Ensemble::new(&study.system.program)
        };
        let mut all = vec![None; specimens.len()];
        ensemble.run(
            specimens.len(),
            |job| Variant {
                overrides: realism.specimen(study, Lot::Training, specimens[job].0),
                faults: specimens[job].1.into_iter().collect(),
                inputs: calibration.inputs.iter().collect(),
                ..Variant::default()
            },
            |_| Rows::default(),
            |job, rows, outcome| all[job] = outcome.is_ok().then_some(rows.0),
        );
        all
    }

    /// The samples with noise and quantization of the sensors.
    fn shown(&self, specimen: usize, mut samples: Vec<f64>) -> Vec<f64> {
        let noise = self.study.realism.as_ref().unwrap().noise(Lot::Training, specimen);
        let mut chain = SensorChain::new(self.study, self.sensors.len(), Some(noise));
        samples.chunks_exact_mut(self.sensors.len()).for_each(|sample| chain.measure(sample));
        samples
    }

    fn record(&self, measured: Vec<f64>) -> FitRecord {
        calibration_record(self.study, self.calibration, self.sensors.len(), measured)
    }

    /// The largest change of a sensor due to its fault, as a fraction of its scale.
    fn effect(&self, faulty: &[f64], healthy: &[f64]) -> f64 {
        let scales = self.study.scales();
        let pairs = faulty.iter().zip(healthy).enumerate();
        let parts = pairs.map(|(k, (f, h))| (f - h).abs() / scales[k % self.sensors.len()]);
        parts.fold(0.0, f64::max)
    }
}

/// All faults with at least the given intensity.
fn faults(study: &Study, least: f64) -> Vec<&FaultCase> {
    let is_strong = |fault: &&FaultCase| fault.at.intensity >= least - 1e-9;
    study.faults.iter().filter(is_strong).collect()
}

/// Limits of the effect classes, as fractions of a sensor's scale: noise is 0.2 %, the paper's band 3 %.
const EFFECTS: [f64; 5] = [0.002, 0.005, 0.01, 0.03, f64::INFINITY];

#[test]
#[ignore = "a measurement: minutes"]
fn measure_calibration_with_a_fault() {
    let study = Study::default();
    let rig = Rig::new(&study);
    let mut all = faults(&study, 0.3);
    all.truncate(setting("VARIANTS", all.len()));
    let solved_each = setting("SOLVE_EACH", 0);
    let first = rig.simulated(&[(0, None)]).remove(0).expect("a healthy specimen flies");
    let problem = Fit::of_study(&study, vec![rig.record(rig.shown(0, first))]);
    let fleet = fleet::Fleet::new(&problem).unwrap();
    // For each class of effect: variants with a fault, and those rejected or reported.
    let mut counts = [[0_usize; 2]; EFFECTS.len()];
    let (mut unstable, mut agree, mut solved) = (0, 0, 0);
    let mut missed = Vec::new();
    for (turn, cases) in all.chunks(64).enumerate() {
        let number = |place: usize| 64 * turn + place;
        let with: Vec<_> = (0..cases.len()).map(|n| (number(n), Some(cases[n].at))).collect();
        let without: Vec<_> = with.iter().map(|(n, _)| (*n, None)).collect();
        let (faulty, healthy) = (rig.simulated(&with), rig.simulated(&without));
        let mut flown = Vec::new();
        for (place, (faulty, healthy)) in faulty.into_iter().zip(healthy).enumerate() {
            let Some(faulty) = faulty else {
                unstable += 1;
                continue;
            };
            let effect = rig.effect(&faulty, &healthy.expect("a healthy specimen flies"));
            flown.push((place, effect, rig.shown(number(place), faulty)));
        }
        let measured: Vec<Vec<f64>> = flown.iter().map(|(.., measured)| measured.clone()).collect();
        let found = fleet.judge(&measured).unwrap();
        for ((place, effect, measured), found) in flown.into_iter().zip(found) {
            let record = rig.record(measured);
            let own = Fit::of_study(&study, vec![record]);
            let is_reported = found.as_ref().map_or(true, |one| !one.is_update());
            let is_told = is_reported || own.check().is_err();
            let size = EFFECTS.iter().position(|end| effect < *end).unwrap();
            counts[size][0] += 1;
            counts[size][1] += usize::from(is_told);
            if !is_told {
                let fault = cases[place];
                missed.push(format!(
                    "{} {:.1}: {:.2} %",
                    fault.id,
                    fault.at.intensity,
                    100.0 * effect
                ));
            }
            if solved_each > 0 && number(place) % solved_each == 0 {
                solved += 1;
                let is_found = own.solve().map_or(true, |fitted| !fitted.is_update());
                agree += usize::from(is_found == is_told);
            }
        }
    }
    let own = setting("HEALTHY_SOLVED", 8);
    let findings = (0..own).filter(|n| {
        let simulated = rig.simulated(&[(1000 + n, None)]).remove(0).unwrap();
        let record = rig.record(rig.shown(1000 + n, simulated));
        !Fit::of_study(&study, vec![record]).solve().unwrap().is_update()
    });
    println!("healthy, by a fit of its own: {} of {own} with a finding", findings.count());
    println!("{} variants, {unstable} of them could not be flown", all.len());
    let mut least = 0.0;
    for (end, [of, told]) in EFFECTS.iter().zip(counts) {
        println!(
            "effect {:.1} … {:.1} % of scale: {}",
            100.0 * least,
            100.0 * end,
            percent(told, of)
        );
        least = *end;
    }
    println!("not told:\n  {}", missed.join("\n  "));
    println!("a fit of its own says the same in {agree} of {solved}");
    let healthy: Vec<_> = (0..setting("HEALTHY", 200)).map(|n| (1000 + n, None)).collect();
    let measured: Vec<Vec<f64>> = healthy
        .chunks(64)
        .flat_map(|some| {
            let numbers = some.iter().map(|(n, _)| *n);
            numbers
                .zip(rig.simulated(some))
                .map(|(n, s)| rig.shown(n, s.unwrap()))
                .collect::<Vec<_>>()
        })
        .collect();
    let found = fleet.judge(&measured).unwrap();
    let told = found.iter().filter(|one| !one.as_ref().unwrap().is_update()).count();
    for one in found.iter().flatten().filter(|one| !one.is_update()) {
        let sentences: Vec<_> = one.findings.iter().map(|f| f.sentence(&problem)).collect();
        println!("  {:.3}: {}", one.specimen.last_gain, sentences.join("; "));
    }
    println!("healthy specimens with a finding: {}", percent(told, found.len()));
}

#[test]
#[ignore = "a measurement: many minutes"]
fn measure_intensity() {
    let study = Study::default();
    let rig = Rig::new(&study);
    let all = faults(&study, 0.2);
    // Neighboring cases have the same kind: a stride without a common factor covers all kinds and intensities.
    let (stride, most) = (setting("STRIDE", 31), setting("VARIANTS", 246));
    let threads = setting("THREADS", 2);
    let (mut of, mut inside, mut near) = (0, 0, 0);
    let (mut of_seen, mut inside_seen, mut near_seen) = (0, 0, 0);
    for place in 0..most.min(all.len()) {
        let number = place * stride % all.len();
        let case = all[number];
        let specimens = [(2000 + number, Some(case.at)), (2000 + number, None)];
        let flown = rig.simulated(&specimens);
        let [Some(faulty), Some(healthy)] = &flown[..] else {
            println!("{} {:.1}: cannot be flown", case.id, case.at.intensity);
            continue;
        };
        let effect = rig.effect(faulty, healthy);
        let record = rig.record(rig.shown(2000 + number, faulty.clone()));
        let problem = Fit { suspects: vec![], threads, ..Fit::of_study(&study, vec![record]) };
        let truth = case.at.intensity;
        let found = match intensity::intensity(&problem, &[(case.at.component, case.at.fault)]) {
            Ok(found) => found,
            Err(error) => {
                println!("{} {truth:.1} ({:.2} %): refused: {error}", case.id, 100.0 * effect);
                continue;
            }
        };
        let (value, interval) = (found[0].intensity, found[0].interval);
        let (is_inside, is_near) =
            ((interval.0..=interval.1).contains(&truth), (value - truth).abs() <= 0.05);
        println!(
            "{} {truth:.1} ({:.2} %): {value:.4} ({:.4} … {:.4}) {}",
            case.id,
            100.0 * effect,
            interval.0,
            interval.1,
            if is_inside { "" } else { "outside" }
        );
        (of, inside, near) = (of + 1, inside + usize::from(is_inside), near + usize::from(is_near));
        if effect > 0.03 {
            of_seen += 1;
            inside_seen += usize::from(is_inside);
            near_seen += usize::from(is_near);
        }
        if place % 10 == 9 || place + 1 == most {
            println!("all: within 0.05: {}; inside: {}", percent(near, of), percent(inside, of));
            let (near, inside) = (percent(near_seen, of_seen), percent(inside_seen, of_seen));
            println!("effect above 3 %: within 0.05: {near}; inside: {inside}");
        }
    }
}

#[test]
#[ignore = "a measurement: minutes"]
fn measure_coverage() {
    let study = Study::default();
    let begin = std::time::Instant::now();
    let specimens: usize = std::env::var("SPECIMENS").map_or(4, |n| n.parse().unwrap());
    let (inside, all, refused) = coverage(&study, 0..specimens, 60.0);
    println!(
        "{inside} of {all} inside ({:.2} %), {refused} refused, {:.1} s",
        100.0 * inside as f64 / all as f64,
        begin.elapsed().as_secs_f64()
    );
}

#[test]
#[ignore = "a measurement: minutes"]
fn measure_knowledge() {
    let study = Study::default();
    let problem = Fit::of_study(&study, vec![record(&study, Some(0), vec![], 60.0)]);
    let fitted = problem.solve().unwrap();
    let truth = truth(&study, &problem.unknowns, 0);
    for (k, unknown) in problem.unknowns.iter().enumerate() {
        println!(
            "{:50} {:7.3} ± {:.3} (true {:7.3}) {}",
            unknown.name,
            fitted.z[k],
            fitted.known.error(k),
            truth[k],
            fitted.known.sentence(&problem.unknowns, k)
        );
    }
    for direction in &fitted.known.directions {
        print!("{:.3e} ", direction.information);
    }
    println!();
    for suspect in &fitted.suspects {
        println!("{suspect}");
    }
}

#[test]
#[ignore = "a measurement: a minute"]
fn measure_fleet() {
    let (worst, inside, all) = fleet_beside_fits(&Study::default(), 64, 60.0, 4);
    println!("fleet: {worst:.3} standard errors apart, {inside} of {all} inside");
}
