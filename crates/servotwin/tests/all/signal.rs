//! Tests of values, statistics and errors.

use servotwin::format::{Read, Value, must};
use servotwin::signal::Signal;
use servotwin_io::toml_text::{Collector, Entry, TomlText};
use servotwin_model::signal::Piecewise;
use servotwin_model::spec::Unit;
use std::f64::consts::{PI, TAU};

const DEGREE: f64 = PI / 180.0;

fn curve(text: &str, duration_s: f64) -> Piecewise {
    let signal: Signal = text.parse().unwrap_or_else(|e| panic!("{text}: {e}"));
    signal.build(Unit::Radian, duration_s).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn mistake(text: &str) -> String {
    let built = text.parse::<Signal>().and_then(|signal| signal.build(Unit::Radian, 5.0));
    built.expect_err(text).to_string()
}

#[test]
fn a_step_comes_from_rest() {
    let step = curve("step:size=10deg,at=100ms", 1.0);
    assert_eq!([-1.0, 0.0, 0.0999].map(|t| step.value(t)), [0.0; 3]);
    assert_eq!(step.value(0.1), 10.0 * DEGREE);
    let unsaid = curve("step:size=10deg", 1.0);
    assert_eq!([unsaid.value(0.0), unsaid.value(0.1)], [0.0, 10.0 * DEGREE]);
    let at_once = curve("step:size=10deg,at=0s", 1.0);
    assert_eq!(at_once.value(0.0), 10.0 * DEGREE);
    assert_eq!(at_once.value(-1e-9), 0.0);
}

#[test]
fn a_ramp_stops_where_it_shall() {
    let ramp = curve("ramp:rate=-20deg/s,to=-15deg,at=1s", 5.0);
    assert_eq!(ramp.value(1.0), 0.0);
    assert!((ramp.value(1.5) + 10.0 * DEGREE).abs() < 1e-15);
    assert_eq!(ramp.value(4.0), -15.0 * DEGREE);
    assert_eq!(curve("ramp:rate=2", 5.0).value(3.0), 6.0);
}

#[test]
fn a_sine_is_within_1e_9_of_its_amplitude() {
    let sine = curve("sine:amplitude=2,frequency=1.7Hz,phase=30deg,at=0.25s", 4.0);
    let exact = |t: f64| 2.0 * (TAU * 1.7 * (t - 0.25) + PI / 6.0).sin();
    let worst = (0..40_000).map(|i| 0.25 + 3.75 * f64::from(i) / 4e4);
    let worst = worst.map(|t| (sine.value(t) - exact(t)).abs()).fold(0.0, f64::max);
    assert!(worst < 2e-9, "{worst:e}");
    assert!((sine.value(0.0) - 1.0).abs() < 1e-12);
}

#[test]
fn sweeps_are_within_1e_9_of_their_amplitude() {
    for (law, from, to) in [("log", 0.1_f64, 10.0), ("log", 8.0, 0.01), ("linear", 0.1, 10.0)] {
        let text = format!("sweep:amplitude=1,from={from}Hz,to={to}Hz,law={law}");
        let (sweep, length) = (curve(&text, 20.0), 20.0);
        let rate = (to / from).ln() / length;
        let periods = |t: f64| match law {
            "log" => from * ((rate * t).exp() - 1.0) / rate,
            _ => from * t + (to - from) * t * t / (2.0 * length),
        };
        let times = (0..100_000).map(|i| length * f64::from(i) / 1e5);
        let worst = times.map(|t| (sweep.value(t) - (TAU * periods(t)).sin()).abs());
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 1e-9, "{text}: {worst:e}");
    }
}

#[test]
fn noise_has_its_rms_its_limit_and_starts_from_rest() {
    for (rms, bandwidth) in [(3.0, 0.5), (5.0, 1.0), (2.0, 2.0)] {
        for seed in 0..5 {
            let text = format!("noise:rms={rms}deg,bandwidth={bandwidth}Hz,seed={seed}");
            let noise = curve(&text, 90.0);
            let realised = noise.mean_square(0.0, 90.0).sqrt() / DEGREE;
            assert!((realised / rms - 1.0).abs() < 1e-9, "{text}: {realised}");
            // Another section of the same noise agrees within its statistics.
            let longer = curve(&text, 2000.0);
            let realised = longer.mean_square(90.0, 2000.0).sqrt() / DEGREE;
            assert!((realised / rms - 1.0).abs() < 0.25, "{text}: {realised}");
            assert_eq!(noise.value(0.0), 0.0);
            let peak = noise.pieces().iter().map(|p| p[0].abs()).fold(0.0, f64::max) / DEGREE;
            assert!(peak < 22.0 && peak > 2.0 * rms, "{text}: {peak}");
        }
    }
}

#[test]
fn noise_is_gaussian_noise_behind_a_butterworth_filter() {
    // Mean periodogram of many stretches against 1/(1 + (f/f_c)^8).
    let noise = curve("noise:rms=1,bandwidth=5Hz,limit=1000,seed=11,window=3000s", 3000.0);
    let (stretch, sampling) = (1000, 100.0);
    let power = |frequency: f64| {
        let stretches = (0..299).map(|s| {
            let (mut re, mut im) = (0.0, 0.0);
            for k in 0..stretch {
                let x = (k as f64 + 0.5) / stretch as f64;
                let window = (PI * x).sin().powi(2);
                let value = window * noise.value((s * stretch + k + 100) as f64 / sampling);
                let (sin, cos) = (TAU * frequency * k as f64 / sampling).sin_cos();
                re += value * cos;
                im += value * sin;
            }
            re * re + im * im
        });
        stretches.sum::<f64>()
    };
    // Averages several neighboring frequencies, so that the statistical error is about 3 %.
    let band = |f: f64| (-3..=3).map(|i| power(f + 0.2 * f64::from(i))).sum::<f64>();
    let (pass, corner, stop) = (band(2.0), band(5.0), band(10.0));
    assert!((corner / pass - 0.5).abs() < 0.06, "{}", corner / pass);
    let warped = (PI * 0.1).tan() / (PI * 0.05).tan();
    let expected = 1.0 / (1.0 + warped.powi(8));
    assert!(stop / pass < 2.0 * expected && stop / pass > 0.5 * expected, "{}", stop / pass);
}

#[test]
fn seeds_decide() {
    let text = |seed: u32| curve(&format!("noise:rms=5deg,bandwidth=1Hz,seed={seed}"), 20.0);
    assert_eq!(text(7), text(7));
    assert_ne!(text(7), text(8));
    assert_eq!(
        curve("noise:rms=5deg,bandwidth=1Hz", 9.0),
        curve("noise:rms=5deg,bandwidth=1Hz,seed=1", 9.0)
    );
}

#[test]
fn terms_are_added() {
    let sum = curve("5deg + step:size=-2deg,at=1s + ramp:rate=1e+0deg/s", 5.0);
    assert!((sum.value(0.5) - 5.5 * DEGREE).abs() < 1e-15);
    assert!((sum.value(2.0) - 5.0 * DEGREE).abs() < 1e-15);
}

#[test]
fn units_follow_the_input() {
    let build = |text: &str, unit| text.parse::<Signal>().unwrap().build(unit, 1.0);
    assert_eq!(build("200bar", Unit::Pascal).unwrap().value(0.0), 2e7);
    assert_eq!(build("50%", Unit::None).unwrap().value(0.0), 0.5);
    assert_eq!(build("20mm", Unit::Metre).unwrap().value(0.0), 0.02);
    assert_eq!(build("150m/s", Unit::MetrePerSecond).unwrap().value(0.0), 150.0);
    assert_eq!(build("36km/h", Unit::MetrePerSecond).unwrap().value(0.0), 10.0);
    assert_eq!(build("60L/min", Unit::CubicMetrePerSecond).unwrap().value(0.0), 1e-3);
    assert_eq!(build("1L/s", Unit::CubicMetrePerSecond).unwrap().value(0.0), 1e-3);
    assert!("20°C".parse::<Signal>().unwrap_err().to_string().contains("has a wrong unit"));
    assert_eq!(build("ramp:rate=10bar/s", Unit::Pascal).unwrap().value(0.5), 5e5);
    let error = build("5deg", Unit::Pascal).unwrap_err().to_string();
    assert_eq!(
        error,
        "constant: 'value=5deg' has a wrong unit; allowed: bar, Pa, MPa, kPa, psi, mbar, GPa, ksi, \
         kgf/cm2, atm, mmHg, inHg, a plain number (SI)"
    );
}

#[test]
fn mistakes_say_what_is_possible() {
    let cases = [
        ("", "a signal is missing; known kinds: constant, step"),
        ("5deg + ", "a signal is missing"),
        ("stp:size=1", "unknown kind of signal 'stp'; known: constant, step, ramp"),
        ("step", "step: 'size' is missing, e.g. step:size=10deg,at=0.1s"),
        ("step:", "step: 'size' is missing"),
        ("step:10deg", "step: '10deg' is not of the form name=value"),
        ("step:size=1,", "step: '' is not of the form name=value"),
        ("step:sise=10deg", "step has no parameter 'sise'; it has: size, at"),
        ("step:size=1,size=2", "step: 'size' is given twice"),
        ("step:size=ten", "step: 'size' needs a number, not 'ten'"),
        ("step:size=", "step: 'size' needs a number, not ''"),
        ("step:size=nan", "step: 'size' needs a number, not 'nan'"),
        ("step:size=1e999", "step: 'size' needs a number"),
        ("step:size=10grad", "step: 'size=10grad' has a wrong unit; allowed: rad, deg"),
        (
            "step:size=10bar",
            "'size=10bar' has a wrong unit; allowed: rad, deg, mrad, a plain number",
        ),
        (
            "step:size=1,at=2Hz",
            "step: 'at=2Hz' has a wrong unit; allowed: s, ms, us, ns, min, h, d, a plain",
        ),
        ("step:size=1,at=-2s", "step: 'at=-2s' is out of range: 0 or greater (s)"),
        ("ramp:rate=20deg", "ramp: 'rate=20deg' has a wrong unit; allowed: rad/s, deg/s"),
        ("ramp:rate=20deg/s,to=-5deg", "ramp: 'rate' must not be zero and must have the sign"),
        ("sine:amplitude=1,frequency=0", "out of range: 0.0001 to 1000 (Hz)"),
        ("sweep:amplitude=1,from=1,to=2,law=exp", "'law' cannot be 'exp'; it is log or linear"),
        ("noise:rms=0,bandwidth=1", "noise: 'rms=0' is out of range: greater than 0"),
        ("noise:rms=1,bandwidth=60Hz", "'bandwidth' must be at most 0.4 times 'sampling'"),
        ("noise:rms=15deg,bandwidth=1", "'rms' must be at most half of 'limit'"),
        ("noise:rms=0.1,bandwidth=1,seed=1.5", "'seed=1.5' is out of range: 0 to 9007199254740992"),
    ];
    for (text, expected) in cases {
        let message = mistake(text);
        assert!(message.contains(expected), "{text}: {message}");
    }
    let signal: Signal = "1".parse().unwrap();
    let error = signal.build(Unit::None, 0.0).unwrap_err().to_string();
    assert_eq!(error, "a run of 0 s is impossible: greater than 0 is needed");
}

/// The signals under `key = …` of a file, or its mistakes.
fn read(text: &str) -> Result<Vec<Signal>, String> {
    let mut mistakes = Collector::default();
    let document = TomlText::parse(text, 1, &mut mistakes).expect("TOML");
    let key = must("a", Value::Signal, "a signal");
    let read = |entry: &Entry| Signal::read(entry, key, &mut mistakes);
    let signals = document.root().iter().filter_map(read).collect();
    match mistakes.locate(text)[..] {
        [] => Ok(signals),
        [ref first, ..] => Err(format!("line {}: {}", first.line, first.message)),
    }
}

#[test]
fn in_a_file_a_signal_is_a_text_or_a_number() {
    let signals = read("a = 'step:size=10deg,at=0.1s + 5deg'\nb = 3\n").unwrap();
    assert_eq!(signals[0].to_string(), "step:size=10deg,at=0.1s + constant:value=5deg");
    assert_eq!(signals[1].to_string(), "constant:value=3");
    let error = read("b = 1\na = 'step:sise=1'").unwrap_err();
    assert!(error.contains("line 2") && error.contains("no parameter 'sise'"), "{error}");
    for wrong in ["a = true", "a = []", "a = { kind = 'step' }"] {
        assert!(read(wrong).unwrap_err().contains("a signal: a text or a number"), "{wrong}");
    }
}

#[test]
fn recorded_signals_come_from_files() {
    let folder = std::env::temp_dir().join(format!("servotwin-signal-{}", std::process::id()));
    servotwin_io::files::create_folder(&folder).unwrap();
    let file = folder.join("log.csv");
    let write = |text: &str| std::fs::write(&file, text).unwrap();
    let build = |rest: &str, unit| {
        let text = format!("table:file={},{rest}", file.display());
        text.parse::<Signal>().unwrap().build(unit, 1.0).map_err(|e| e.to_string())
    };
    write("time_s,command_rad,angle_deg,plain\n0,0,0,1\n1,2,90,3\n");
    assert_eq!(build("column=command_rad", Unit::Radian).unwrap().value(0.5), 1.0);
    assert_eq!(build("column=command_rad,between=hold", Unit::Radian).unwrap().value(0.5), 0.0);
    assert_eq!(build("column=angle_deg", Unit::Radian).unwrap().value(1.0), 90.0 * DEGREE);
    assert_eq!(build("column=plain", Unit::None).unwrap().value(1.0), 3.0);
    let error = build("column=command_rad", Unit::Pascal).unwrap_err();
    assert_eq!(error, "column 'command_rad' is in rad, the input is in Pa");
    assert!(build("column=comand_rad", Unit::Radian).unwrap_err().contains("command_rad"));
    write("time_s,q_l_min,oil_c,x_min\n0,60,20,1\n1,60,20,1\n");
    assert_eq!(build("column=q_l_min", Unit::CubicMetrePerSecond).unwrap().value(0.5), 1e-3);
    assert_eq!(build("column=oil_c", Unit::Kelvin).unwrap().value(0.5), 293.15);
    // A letter or a word is a unit only where it measures what is wanted.
    assert_eq!(build("column=oil_c", Unit::Metre).unwrap().value(0.5), 20.0);
    assert_eq!(build("column=x_min", Unit::Metre).unwrap().value(0.5), 1.0);
    write("time_s,x\n0,1\n1,2\n1,3\n");
    let error = build("column=x", Unit::None).unwrap_err();
    assert!(error.ends_with("line 4: time 1 s is not after 1 s before it"), "{error}");
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(build("column=x", Unit::None).unwrap_err().contains("no such file"));
}
