//! The C source of a system returns the same bits as the system itself.

use crate::rig;
use servotwin_model::c_source::{self, BadPrefix};
use servotwin_model::program::{FaultAt, Observable, Program};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const CASES: usize = 200;

/// Numbers in −1 … 1 from a seed (xorshift64*).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
        bits as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// States, inputs and held values at which the equations are evaluated.
struct Point {
    states: Vec<f64>,
    inputs: Vec<f64>,
    held: Vec<f64>,
}

fn points(program: &Program, parameters: &[Vec<f64>]) -> Vec<Point> {
    let mut random = Random(7);
    let guess = program.first_guess(parameters);
    let held = program.stand_in_values(parameters);
    let point = |_| Point {
        states: (guess.iter().zip(program.states()))
            .map(|(guess, state)| guess + state.scale * random.next())
            .collect(),
        inputs: (program.network().inputs.iter())
            .map(|input| input.default * (1.0 + random.next()))
            .collect(),
        held: held.iter().map(|h| if *h == 0.0 { random.next() } else { *h }).collect(),
    };
    (0..CASES).map(point).collect()
}

/// The results in Rust: constants and stand-ins, then derivatives and outputs at each point.
fn expected(program: &Program, parameters: &[Vec<f64>], points: &[Point]) -> Vec<f64> {
    let constants = program.block_constants(parameters);
    let mut numbers = constants.clone();
    numbers.extend(program.stand_in_values(parameters));
    for point in points {
        let mut variables = [&point.states[..], &point.inputs, &point.held].concat();
        variables.resize(program.memory(), 0.0);
        program.evaluate(&constants, &mut variables);
        numbers.extend(&variables[program.derivatives()]);
        numbers.extend(program.observables().iter().map(|o| variables[o.slot as usize]));
    }
    numbers
}

const MAIN: &str = r#"
#include <inttypes.h>
#include <stdio.h>

static void read_all(double *numbers, int count)
{
    for (int i = 0; i < count; i++) {
        uint64_t bits;
        if (scanf("%" SCNx64, &bits) != 1) return;
        memcpy(&numbers[i], &bits, sizeof bits);
    }
}

static void print_all(const double *numbers, int count)
{
    for (int i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, &numbers[i], sizeof bits);
        printf("%" PRIx64 "\n", bits);
    }
}

int main(void)
{
    static double parameters[T_PARAMETERS], constants[T_CONSTANTS];
    static double states[T_STATES], inputs[T_INPUTS], held[T_HELD + 1];
    static double derivatives[T_STATES], outputs[T_OUTPUTS];
    read_all(parameters, T_PARAMETERS);
    t_constants(parameters, constants);
    print_all(constants, T_CONSTANTS);
    t_held(parameters, held);
    print_all(held, T_HELD);
    for (int i = 0; i < CASES; i++) {
        read_all(states, T_STATES);
        read_all(inputs, T_INPUTS);
        read_all(held, T_HELD);
        t_derivatives(constants, states, inputs, held, derivatives);
        print_all(derivatives, T_STATES);
        t_outputs(constants, states, inputs, held, outputs);
        print_all(outputs, T_OUTPUTS);
    }
    return 0;
}
"#;

fn compiled(program: &Program, name: &str, outputs: &[Observable], main: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (source, binary) = (folder.join(format!("{name}.c")), folder.join(name));
    let c = c_source::write_equations(program, "t", outputs).unwrap();
    std::fs::write(&source, format!("{c}{main}")).unwrap();
    let status = Command::new("cc")
        .args(["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"])
        .arg(format!("-DCASES={CASES}"))
        .args([Path::new("-o"), &binary, &source, Path::new("-lm")])
        .status()
        .expect("a C compiler");
    assert!(status.success());
    binary
}

fn in_c(binary: &Path, parameters: &[Vec<f64>], points: &[Point]) -> Vec<f64> {
    let points = points.iter().flat_map(|p| [&p.states, &p.inputs, &p.held]);
    let numbers = parameters.iter().chain(points).flatten();
    let mut text = String::new();
    for number in numbers {
        writeln!(text, "{:x}", number.to_bits()).unwrap();
    }
    let mut child =
        Command::new(binary).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    let lines = String::from_utf8(output.stdout).unwrap();
    lines.lines().map(|l| f64::from_bits(u64::from_str_radix(l, 16).unwrap())).collect()
}

fn assert_same(program: &Program, name: &str, faults: &[FaultAt]) {
    let parameters = program.parameters(faults);
    let points = points(program, &parameters);
    let expected = expected(program, &parameters, &points);
    let found = in_c(&compiled(program, name, program.observables(), MAIN), &parameters, &points);
    assert_eq!(expected.len(), found.len());
    assert!(expected.iter().all(|x| x.is_finite()));
    for (index, (a, b)) in expected.iter().zip(&found).enumerate() {
        assert_eq!(a.to_bits(), b.to_bits(), "number {index}: {a:e}, C has {b:e}");
    }
}

#[test]
fn a_filled_volume_is_the_same_in_c() {
    assert_same(&rig::filling(), "filling", &[]);
}

#[test]
fn a_faulty_actuator_is_the_same_in_c() {
    let program = rig::actuator();
    let fault = |id: &str, intensity| {
        let (component, fault) = program.find_fault(id).expect(id);
        FaultAt { component, fault, intensity }
    };
    let faults = [fault("sensor_a.gain_low", 0.7), fault("supply_valve.stuck", 0.3)];
    assert_same(&program, "actuator", &faults);
}

#[test]
fn without_outputs_there_is_no_function_for_them() {
    let c = c_source::write_equations(&rig::filling(), "t", &[]).unwrap();
    assert!(c.contains("void t_derivatives("));
    assert!(!c.contains("t_outputs("));
}

/// Prints the three currents that the actuator's controller holds after each
/// of three ticks. The controller's two open inputs follow them in the array.
const TICK: &str = r#"
#include <stdio.h>

int main(void)
{
    static double parameters[T_PARAMETERS], constants[T_CONSTANTS];
    static double states[T_STATES] = {0}, inputs[T_INPUTS] = {0.001, 1.0, 3000.0};
    static double held[T_HELD];
    int i;
    for (i = 0; i < T_PARAMETERS; i++) scanf("%lf", &parameters[i]);
    t_constants(parameters, constants);
    t_held(parameters, held);
    for (i = 0; i < 3; i++) {
        t_tick_0(constants, states, inputs, held, held);
        printf("%.17g %.17g %.17g\n", held[T_HELD - 5], held[T_HELD - 4], held[T_HELD - 3]);
    }
    return 0;
}
"#;

#[test]
fn a_tick_moves_the_held_values_on() {
    let program = rig::actuator();
    // With all states zero the sensors read −25 % and the position zero.
    let binary = compiled(&program, "tick", &[], TICK);
    let parameters: Vec<String> =
        program.parameters(&[]).iter().flatten().map(|p| format!("{p:e}")).collect();
    let mut child =
        Command::new(binary).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(parameters.join("\n").as_bytes()).unwrap();
    let output = String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap();
    let currents: Vec<f64> = output.split_whitespace().map(|x| x.parse().unwrap()).collect();
    // Both pressure readings are equal, so only the command acts; the delayed
    // currents follow tick by tick.
    let current = 272.0 * 0.0525 * 0.001;
    let expected = [current, 0.0, 0.0, current, current, 0.0, current, current, current];
    for (found, expected) in currents.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-8, "{currents:?}");
    }
    assert_eq!(currents.len(), expected.len());
}

#[test]
fn a_prefix_must_be_an_identifier() {
    let program = rig::filling();
    for prefix in ["", "1a", "a-b", "ä"] {
        assert_eq!(c_source::write_equations(&program, prefix, &[]), Err(BadPrefix(prefix.into())));
    }
}
