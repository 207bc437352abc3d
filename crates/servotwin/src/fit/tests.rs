//! Fits records of specimens with known parameters.

use super::knowledge::Knowledge;
use super::*;
use crate::ensemble::{Ensemble, Variant};
use crate::recording::with_suffix;
use crate::run::SensorChain;
use crate::signal::Signal;
use crate::study::{Seed, Stream, Tolerance};
use crate::system::NewValue;
use servotwin_model::program::FaultAt;

/// The command of the calibration flight.
const COMMAND: &str = "noise:rms=4deg,bandwidth=1Hz,seed=77";

/// A record of a specimen as a logger writes it: sensors with noise, commands as samples.
fn record(
    study: &Study,
    specimen: Option<usize>,
    faults: Vec<FaultAt>,
    duration_s: f64,
) -> FitRecord {
    flown(study, COMMAND, (specimen, specimen.unwrap_or(0)), faults, duration_s)
}

/// The same with another command, and with different noise in each flight of the specimen.
fn flown(
    study: &Study,
    command: &str,
    (specimen, flight): (Option<usize>, usize),
    faults: Vec<FaultAt>,
    duration_s: f64,
) -> FitRecord {
    let system = &study.system;
    let mut inputs = system.default_inputs();
    let unit = system.network().inputs[study.command_input].unit;
    let signal: Signal = command.parse().unwrap();
    inputs[study.command_input] = signal.build(unit, duration_s).unwrap();
    let sensors = study.measured[..study.base_sensors()].to_vec();
    let ensemble = Ensemble {
        record: system.sensor_slots(&sensors),
        duration_s,
        sample_period_s: study.sample_period_s,
        ..Ensemble::new(&system.program)
    };
    let realism = study.realism.as_ref().unwrap();
    let own = |number: usize| realism.specimen(study, seed(study, number), 1.0);
    let overrides = specimen.map(own).unwrap_or_default();
    let variant =
        Variant { faults, overrides, inputs: inputs.iter().collect(), ..Variant::default() };
    let (columns, _) = ensemble.run_one(&variant).unwrap();
    let row = |row: usize| columns.iter().map(move |column| column[row]);
    let mut measured: Vec<f64> = (0..columns[0].len()).flat_map(row).collect();
    let noise = seed(study, flight).stream(Stream::Sensors);
    let mut chain = SensorChain::new(study, sensors.len(), Some(noise));
    measured.chunks_exact_mut(sensors.len()).for_each(|sample| chain.measure(sample));
    FitRecord::logged("record", &inputs, sensors, study.sample_period_s, measured)
}

fn seed(study: &Study, number: usize) -> Seed {
    study.seed_of("training", number)
}

/// The true unknowns of a specimen.
fn truth(study: &Study, unknowns: &[Unknown], specimen: usize) -> Vec<f64> {
    let values = study.realism.as_ref().unwrap().specimen(study, seed(study, specimen), 1.0);
    let of = |unknown: &Unknown| {
        let (component, parameter, nominal) = unknown.members[0];
        let value = values.iter().find(|v| (v.0, v.1) == (component, parameter)).unwrap().2;
        (value - nominal) / unknown.per_sigma(nominal)
    };
    unknowns.iter().map(of).collect()
}

/// The second study: one actuator against a spring, quick to simulate.
fn spring() -> Study {
    Study::read("../../studies/spring_actuator.toml").unwrap()
}

fn fault(study: &Study, id: &str, intensity: f64) -> FaultAt {
    let (component, fault) = study.system.program.find_fault(id).unwrap();
    FaultAt { component, fault, intensity }
}

#[test]
#[ignore = "slow: ./check --all"]
fn true_parameters_lie_inside_of_their_intervals() {
    // Of 40 and 72 draws with 95 %, fewer have a probability below 1 in 1000.
    for (study, specimens, duration_s, least) in
        [(spring(), 20, 12.0, 34), (Study::default(), 2, 10.0, 62)]
    {
        let mut inside = 0;
        for specimen in 0..specimens {
            let record = record(&study, Some(specimen), vec![], duration_s);
            let problem = Fit::of_study(&study, vec![record]);
            let fitted = problem.solve().unwrap();
            assert!(fitted.is_update(), "{specimen}: {:?}", fitted.findings);
            let truth = truth(&study, &problem.unknowns, specimen);
            let error = |k: usize| (fitted.z[k] - truth[k]).abs() / fitted.known.error(k);
            inside += (0..truth.len()).filter(|&k| error(k) <= 1.96).count();
        }
        assert!(inside >= least, "{inside}");
    }
}

#[test]
fn the_record_and_not_the_prior_says_what_is_well_known() {
    let study = spring();
    let problem = Fit::of_study(&study, vec![record(&study, Some(3), vec![], 12.0)]);
    let fitted = problem.solve().unwrap();
    let truth = truth(&study, &problem.unknowns, 3);
    for (k, truth) in truth.iter().enumerate() {
        assert_eq!(fitted.known.each[k], Knowledge::Known);
        assert!(fitted.known.error(k) < 0.3, "{}", fitted.known.error(k));
        assert!((fitted.z[k] - truth).abs() < 4.0 * fitted.known.error(k));
    }
    // The error depends on the record: twice the duration gives a smaller one.
    let longer = Fit::of_study(&study, vec![record(&study, Some(3), vec![], 24.0)]);
    let longer = longer.solve().unwrap();
    assert!(longer.known.error(0) < 0.9 * fitted.known.error(0));
    // Two records determine an unknown better than one.
    let both = vec![record(&study, Some(3), vec![], 12.0), record(&study, Some(3), vec![], 12.0)];
    let both = Fit::of_study(&study, both).solve().unwrap();
    let ratio = both.known.error(0) / fitted.known.error(0);
    assert!((0.68..0.76).contains(&ratio), "a half of the variance: {ratio}");
}

#[test]
fn what_a_record_does_not_show_stays_and_what_is_the_same_trades_off() {
    let study = spring();
    let mut problem = Fit::of_study(&study, vec![record(&study, Some(1), vec![], 12.0)]);
    let tolerance = |id: &str, sigma: f64| {
        let (component, parameter) = id.rsplit_once('.').unwrap();
        let components = &study.system.network().components;
        let component = components.iter().position(|c| c.id == component).unwrap();
        let parameter = components[component].component.parameter(parameter).unwrap();
        let parameters = vec![(component, parameter)];
        Unknown::tolerance(&study.system, &Tolerance { parameters, sigma, absolute: false })
    };
    problem.suspects.clear();
    // No stop is ever reached, and the converter's step is not part of the equations.
    problem.unknowns.push(tolerance("servo_valve.stop_stiffness_per_s2", 0.1));
    // The flow at an edge is their product.
    problem.unknowns.push(tolerance("servo_valve.width_pa_m", 0.03));
    let mut copy = problem.unknowns[3].clone();
    copy.name = "copy".into();
    problem.unknowns.push(copy);
    let fitted = problem.solve().unwrap();
    assert_eq!(fitted.known.each[2], Knowledge::NotSeen);
    assert!(fitted.z[2].abs() < 1e-6 && (fitted.known.error(2) - 1.0).abs() < 1e-6);
    // A copy later in the list overrides the first: the first is not seen, the copy is.
    assert_eq!(fitted.known.each[3], Knowledge::NotSeen);
    assert_eq!(fitted.known.each[4], Knowledge::Known);
}

#[test]
fn threads_do_not_change_a_bit() {
    let study = spring();
    let solved = |threads: usize| {
        let records = vec![record(&study, Some(2), vec![], 8.0)];
        let problem = Fit { threads, ..Fit::of_study(&study, records) };
        let fitted = problem.solve().unwrap();
        (fitted.z.clone(), fitted.cost, fitted.suspects.clone(), fitted.known.covariance.clone())
    };
    assert_eq!(solved(1), solved(2));
}

#[test]
fn a_fault_is_a_finding_and_no_update() {
    let study = spring();
    for id in [
        "leakage_a.leakage",
        "servo_valve.gain_low",
        "sensor_ram.bias_positive",
        "cylinder.internal_leakage",
    ] {
        let faults = vec![fault(&study, id, 0.5)];
        let problem = Fit::of_study(&study, vec![record(&study, Some(4), faults, 12.0)]);
        let fitted = problem.solve().unwrap();
        assert!(!fitted.is_update(), "{id}");
        assert!(fitted.suspects[0].score > 10.0, "{id}: {:?}", fitted.suspects[0]);
        assert!(
            fitted.suspects[..3].iter().any(|s| s.name == id),
            "{id}: {:?}",
            &fitted.suspects[..3]
        );
    }
    let problem = Fit::of_study(&study, vec![record(&study, Some(4), vec![], 12.0)]);
    assert!(problem.solve().unwrap().is_update());
}

#[test]
fn a_parameter_that_would_leave_its_tolerance_is_told() {
    let study = spring();
    let mut record = record(&study, None, vec![], 12.0);
    // A null shift of the valve by six standard deviations.
    let faults = vec![fault(&study, "servo_valve.bias_positive", 0.1)];
    record.measured = self::record(&study, None, faults, 12.0).measured;
    let mut problem = Fit::of_study(&study, vec![record]);
    problem.suspects.clear();
    let fitted = problem.solve().unwrap();
    let leaves = format!("{} would have to leave its tolerance", problem.unknowns[0].name);
    assert!(fitted.findings.iter().any(|own| own.starts_with(&leaves)), "{:?}", fitted.findings);
    assert_eq!(fitted.known.each[0], Knowledge::AtBound);
}

#[test]
fn the_intensity_of_a_fault_lies_in_its_interval() {
    let study = spring();
    let (mut inside, mut all) = (0, 0);
    for (number, id) in [
        "leakage_a.leakage",
        "servo_valve.clogging_pa",
        "sensor_ram.gain_high",
        "cylinder.internal_leakage",
    ]
    .into_iter()
    .enumerate()
    {
        for intensity in [0.2, 0.6] {
            let at = fault(&study, id, intensity);
            let records = vec![record(&study, Some(number), vec![at], 12.0)];
            let problem = Fit::of_study(&study, records);
            let other = fault(&study, "servo_valve.gain_low", 0.0);
            let candidates = [other, at].map(|fault| (fault.component, fault.fault));
            let found = problem.intensities(&candidates).unwrap();
            assert_eq!(found[0].name, id, "the likeliest");
            assert!(found[0].probability > 0.99);
            assert!((found[0].intensity - intensity).abs() < 0.05, "{id}: {}", found[0].intensity);
            inside += usize::from((found[0].interval.0..=found[0].interval.1).contains(&intensity));
            all += 1;
        }
    }
    assert!(all - inside <= 2, "{inside} of {all}");
}

#[test]
fn a_gain_beyond_the_end_of_a_sensors_range_has_an_interval_to_the_largest() {
    // With a range of 207 bar the supply sensor saturates already at an intensity of 0.1.
    let system = include_str!("../../../../systems/aileron_dual.toml");
    let system = system.replace("full_scale_pa = 344.74e5", "full_scale_pa = 206.84e5");
    let system = System::parse(&system, "aileron.toml").unwrap();
    let study = Study::parse_for(&Study::default().text, "paper.toml", system).unwrap();
    let at = fault(&study, "actuator_1.sensor_supply.gain_high", 0.6);
    let mut problem = Fit::of_study(&study, vec![record(&study, Some(0), vec![at], 6.0)]);
    problem.suspects.clear();
    let found = problem.intensities(&[(at.component, at.fault)]).unwrap();
    let (low, high) = found[0].interval;
    assert!((0.02..0.6).contains(&low) && high == 1.0, "{low} … {high}");
    assert!(found[0].error > 0.2, "{}", found[0].error);
}

#[test]
fn a_fleet_is_fitted_as_each_of_it_alone() {
    let study = spring();
    let records: Vec<FitRecord> = (0..12).map(|n| record(&study, Some(n), vec![], 12.0)).collect();
    let alone = |record: &FitRecord| Fit {
        suspects: vec![],
        ..Fit::of_study(&study, vec![record.clone()])
    };
    let problem = alone(&records[0]);
    let measured: Vec<Vec<f64>> = records.iter().map(|record| record.measured.clone()).collect();
    let (found, errors) = problem.fleet(&measured).unwrap();
    let (mut inside, mut all) = (0, 0);
    for (n, (specimen, record)) in found.iter().zip(&records).enumerate() {
        let z = &specimen.z;
        let truth = truth(&study, &problem.unknowns, n);
        let is_inside = |&k: &usize| (z[k] - truth[k]).abs() <= 1.96 * errors[k];
        inside += (0..truth.len()).filter(is_inside).count();
        all += truth.len();
        if n < 3 {
            let fitted = alone(record).solve().unwrap();
            for (k, (z, alone)) in z.iter().zip(&fitted.z).enumerate() {
                let apart = (z - alone).abs() / fitted.known.error(k);
                assert!(apart < 0.3, "{n}, {k}: {apart} standard errors");
            }
        }
    }
    assert!(inside >= all - 5, "{inside} of {all}");
}

#[test]
fn a_fit_reaches_all_that_a_plant_may_draw() {
    let study = Study::default();
    let unknowns = Unknown::of_draws(&study);
    let draws = &study.flights.as_ref().unwrap().draws;
    let bandwidth = |unknown: &&Unknown| unknown.name.ends_with("sensor_spool.bandwidth_hz");
    for unknown in unknowns.iter().filter(bandwidth) {
        let ends = [unknown.range.0, unknown.range.1].map(|z| unknown.value(z) / unknown.nominal());
        assert!((ends[0] - 0.3).abs() < 1e-12 && (ends[1] - 1.0).abs() < 1e-12, "{ends:?}");
    }
    assert!(unknowns.iter().any(|own| bandwidth(&own)) && draws.len() >= unknowns.len());
}

#[test]
fn a_parameter_that_drifts_inside_of_its_tolerance_is_an_update_and_told() {
    let study = spring();
    let problem = Fit { suspects: vec![], ..Fit::of_study(&study, vec![]) };
    // Friction grows by two standard deviations of its tolerance in thirty flights.
    let flight = |number: usize| {
        let mut worn = spring();
        let (component, parameter, nominal) = problem.unknowns[1].members[0];
        let value = nominal + 2.0 * number as f64 / 30.0 * problem.unknowns[1].per_sigma(nominal);
        let name = "cylinder.coulomb_friction_n";
        assert_eq!(problem.unknowns[1].name, name);
        let value = NewValue { component, parameter, value, comment: String::new() };
        let text = study.system.rewritten(&[], &[value]).unwrap();
        worn.system = System::parse(&text, "worn.toml").unwrap();
        let command = format!("noise:rms=4deg,bandwidth=1Hz,seed={}", 300 + number);
        (name.to_owned(), Ok(flown(&worn, &command, (None, number), vec![], 8.0)))
    };
    let history = problem.history((0..30).map(flight).collect(), &[]).unwrap();
    assert!(history.flights.iter().filter(|flight| flight.is_healthy()).count() >= 28);
    assert!(history.tracks.is_empty());
    assert_eq!(history.drifts.len(), 1);
    assert_eq!(history.drifts[0].unknown, 1);
    let rate = history.drifts[0].trend.last.rate;
    assert!((rate / (2.0 / 30.0) - 1.0).abs() < 0.3, "{rate}");
}

#[test]
fn the_designed_flight_keeps_its_limits_and_tells_most() {
    let study = spring();
    let problem = Fit::of_study(&study, vec![]);
    let (amplitude, rate) = (6.0_f64.to_radians(), 15.0_f64.to_radians());
    let limits = design::Limits { amplitude, rate, duration_s: 12.0 };
    let found = problem.design(&study, limits).unwrap();
    assert!(found.len() > 1 && found.windows(2).all(|pair| pair[0].gain >= pair[1].gain));
    let unit = study.system.network().inputs[study.command_input].unit;
    for design in &found {
        let signal: Signal = design.command.text.parse().unwrap();
        let built = signal.build(unit, 12.0).unwrap();
        let values: Vec<f64> = (0..=12_000).map(|k| built.value(k as f64 * 1e-3)).collect();
        let largest = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let fastest = values.windows(2).map(|pair| (pair[1] - pair[0]).abs() * 1e3);
        assert!(largest <= amplitude * 1.001, "{}", design.command.text);
        assert!(fastest.fold(0.0, f64::max) <= rate * 1.01, "{}", design.command.text);
    }
    // A fit of the designed flight reaches the predicted errors.
    let best = &found[0];
    let record = flown(&study, &best.command.text, (Some(5), 5), vec![], 12.0);
    let fitted = Fit { suspects: vec![], ..Fit::of_study(&study, vec![record]) };
    let fitted = fitted.solve().unwrap();
    for k in 0..2 {
        let ratio = fitted.known.error(k) / best.known.error(k);
        assert!((0.7..1.4).contains(&ratio), "{k}: {ratio}");
    }
    // A tenth of the motion gives less information.
    let small = design::Limits { amplitude: 0.1 * amplitude, rate: 0.1 * rate, ..limits };
    assert!(problem.design(&study, small).unwrap()[0].gain < best.gain);
}

mod records {
    //! Unusable records, each with its own message.

    use super::*;
    use crate::table::{Column, Table, Values};

    fn table(study: &Study, record: &FitRecord) -> Table {
        let samples = record.samples();
        let times: Vec<f64> = (0..samples).map(|k| k as f64 * record.period_s).collect();
        let command: Vec<f64> =
            times.iter().map(|&t| record.inputs[study.command_input].value(t)).collect();
        let mut table = Table::new();
        table.push(Column::new("time_s", "s", times)).unwrap();
        table.push(Column::new("command_rad", "rad", command)).unwrap();
        for (place, &sensor) in record.sensors.iter().enumerate() {
            let sensor = &study.system.sensors[sensor];
            let values: Vec<f64> =
                record.measured.iter().skip(place).step_by(record.sensors.len()).copied().collect();
            table.push(Column::new(with_suffix(&sensor.id, sensor.unit), "", values)).unwrap();
        }
        table
    }

    /// The error with which a record is rejected.
    fn refusal(study: &Study, table: &Table) -> Option<RecordError> {
        let record = match FitRecord::from_table("log", table, &study.system) {
            Ok(record) => record,
            Err(error) => return Some(error),
        };
        match Fit::of_study(study, vec![record]).check() {
            Ok(()) => None,
            Err(FitError::Record { error, .. }) => Some(error),
            Err(other) => panic!("{other}"),
        }
    }

    fn changed(table: &Table, name: &str, change: impl Fn(usize, f64) -> f64) -> Table {
        let columns = table.columns().iter().map(|column| {
            let mut column = column.clone();
            if column.name == name {
                let Values::Float(values) = &mut column.values else { panic!() };
                values.iter_mut().enumerate().for_each(|(row, value)| *value = change(row, *value));
            }
            column
        });
        Table::from_columns(columns.collect()).unwrap()
    }

    #[test]
    fn each_mistake_has_its_message() {
        let study = spring();
        let record = record(&study, Some(1), vec![], 20.0);
        let good = table(&study, &record);
        assert_eq!(refusal(&study, &good), None);
        let held = record.measured[2];
        type Change<'c> = &'c dyn Fn(usize, f64) -> f64;
        let mistakes: [(&str, Change, &str); 14] = [
            (
                "p_a_pa",
                &|row, v| if row == 700 { f64::NAN } else { v },
                "no finite value at row 701",
            ),
            ("x_p_m", &|_, v| -v, "the sign seems"),
            ("command_rad", &|_, v| -v, "sign of the command"),
            ("p_s_pa", &|_, v| v * 1e-5, "to be in bar"),
            ("x_v_m", &|_, v| v * 1e3, "to be in mm"),
            ("command_rad", &|_, v| v.to_degrees(), "to be in degrees"),
            ("command_rad", &|_, _| 0.1, "no motion: no input varies"),
            ("x_p_m", &|row, v| if row > 900 { held } else { v }, "x_p_m is stuck: from 9.01 s on"),
            ("time_s", &|row, v| if row > 900 { v + 0.5 } else { v }, "50 samples are missing"),
            (
                "time_s",
                &|row, v| if row > 900 { v + 0.002 } else { v },
                "the times jitter: row 902",
            ),
            // Half of the steps are too long by as much as the others are too short.
            ("time_s", &|row, v| v + if row % 2 == 0 { 0.008 } else { 0.0 }, "rate_hz = 100"),
            ("time_s", &|_, v| 1e3 * v, "the times are likely in ms"),
            ("x_p_m", &|row, v| if row % 20 == 0 { 1.0 } else { v }, "(row 1 and 100 more)"),
            ("x_p_m", &|_, _| 1e300, "too many to leave out"),
        ];
        for (name, change, part) in mistakes {
            let told = refusal(&study, &changed(&good, name, change)).expect(part).to_string();
            assert!(told.contains(part), "{part}: {told}");
        }
        let short =
            good.columns().iter().map(|c| Column { values: c.values.rows(0..300), ..c.clone() });
        let short = Table::from_columns(short.collect()).unwrap();
        assert!(refusal(&study, &short).unwrap().to_string().contains("record is too short"));
    }

    #[test]
    fn what_a_fault_does_is_neither_a_sign_nor_a_unit() {
        let study = spring();
        let slow = "noise:rms=2deg,bandwidth=0.5Hz,seed=3";
        let good = table(&study, &flown(&study, slow, (Some(1), 1), vec![], 12.0));
        let rms = |name: &str| {
            let values = good.f64(name).unwrap();
            (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
        };
        // The bias of the spool sensor makes its rms look like inches.
        let bias = 39.0 * rms("x_v_m");
        assert!(bias < study.system.readable(3).1, "{bias}");
        assert_eq!(refusal(&study, &changed(&good, "x_v_m", |_, v| v + bias)), None);
        // A disturbance moves the ram, mostly against the command.
        let sway = 1.2 * rms("x_p_m");
        let swaying = changed(&good, "x_p_m", |row, v| sway * (0.031 * row as f64).sin() - v);
        assert_eq!(refusal(&study, &swaying), None);
    }

    #[test]
    fn a_column_that_is_missing_is_no_mistake_unless_all_are() {
        let study = spring();
        let mut good = table(&study, &record(&study, Some(1), vec![], 8.0));
        good.take("p_s_pa").unwrap();
        assert_eq!(refusal(&study, &good), None);
        for name in ["p_a_pa", "p_b_pa", "x_p_m", "x_v_m"] {
            good.take(name).unwrap();
        }
        let told = refusal(&study, &good).unwrap().to_string();
        assert!(told.starts_with("no column is a sensor of the system"), "{told}");
        good.take("time_s").unwrap();
        assert_eq!(refusal(&study, &good), Some(RecordError::no_time()));
    }

    #[test]
    #[ignore = "slow: ./check --all"]
    fn a_clock_that_runs_fast_is_a_finding() {
        let study = spring();
        let record = record(&study, Some(1), vec![], 40.0);
        // Both are on one clock that runs fast by 1 %: only the dynamics reveal it.
        let (inputs, stretch) = suspects::Cause::Clock.retimed(&record, -0.01);
        let fast = FitRecord { period_s: record.period_s * stretch, inputs, ..record };
        let problem = Fit::of_study(&study, vec![fast]);
        let fitted = problem.solve().unwrap();
        let clock = fitted.suspects.iter().find(|s| s.name == "clock").unwrap();
        assert!((clock.intensity - 0.01).abs() < 0.003 && clock.score > 5.0, "{clock:?}");
        assert!(!fitted.is_update());
    }
}
