//! The aileron behaves as its physics says.
//!
//! The yardstick is a table of closed formulas and of an independent prototype's
//! results for the same parameters ("C3", "C11" …: the checks C1–C21 of the
//! project's physics notes). Tolerances are what the formulas neglect.

use crate::aileron::{constant, program, state, step, test};
use nalgebra::{Complex, DMatrix};
use servotwin_model::fluid::{Fluid, compressibility_per_pa};

use std::f64::consts::TAU;

const BAR: f64 = 1e5;
const AREA_M2: f64 = 2.2723e-3;
const ARM_M: f64 = 0.0525;
const STIFFNESS_N_M: f64 = 2.0e7;
const LITRE_PER_MINUTE: f64 = 1e-3 / 60.0;

const P_A_1: &str = "actuator_1.cylinder.pressure_a_pa";
const P_B_1: &str = "actuator_1.cylinder.pressure_b_pa";
const P_A_2: &str = "actuator_2.cylinder.pressure_a_pa";
const P_B_2: &str = "actuator_2.cylinder.pressure_b_pa";
const X_P_1: &str = "actuator_1.cylinder.position_m";
const ANGLE: &str = "aileron.angle_rad";

#[track_caller]
fn near(what: &str, value: f64, expected: f64, relative: f64) {
    println!("{what}: {value:.6e}, expected {expected:.6e}");
    let error = (value / expected - 1.0).abs();
    assert!(
        error <= relative,
        "{what}: {value} instead of {expected} (off by {error:.2e})"
    );
}

/// The mean rate of a signal while it crosses ± `limit`.
fn crossing_rate(time_s: &[f64], x: &[f64], limit: f64) -> f64 {
    let at = |level: f64| {
        let k = x
            .windows(2)
            .position(|w| w[0] < level && w[1] >= level)
            .expect("it crosses");
        time_s[k] + (level - x[k]) / (x[k + 1] - x[k]) * (time_s[k + 1] - time_s[k])
    };
    2.0 * limit / (at(limit) - at(-limit))
}

/// A moment on the hinge that does not depend on how the aileron stands, and no
/// friction of the hinge.
fn constant_moment(test: crate::aileron::Test, moment_nm: f64) -> crate::aileron::Test {
    let dynamic_pressure_pa = 10_227.6;
    let scale = dynamic_pressure_pa * 1.93 * 0.58 * 1.124_3;
    test.with("air.hinge_moment_zero", moment_nm / scale)
        .with("air.hinge_moment_incidence_per_rad", 0.0)
        .with("air.hinge_moment_deflection_per_rad", 0.0)
        .with("air.hinge_moment_rate_per_rad", 0.0)
        .with("aileron.friction_nm", 0.0)
        .with("aileron.viscous_nm_s", 0.0)
}

/// The aileron held fast, so that the rams push against their attachments.
fn blocked() -> crate::aileron::Test {
    test().load(0.0).with("aileron.inertia_kg_m2", 1e20)
}

// --------------------------------------------------------------------- actuator

#[test]
fn the_unloaded_ram_moves_at_the_rate_of_the_full_spool() {
    // C3: 91.60 mm/s is 100 °/s at the horn and 12.5 L/min.
    let moved = test()
        .load(0.0)
        .command(step(0.1, -0.42, 0.42))
        .lasting(0.8, 1e-3)
        .run(&[X_P_1]);
    let rate = crossing_rate(&moved.time_s, moved.of(X_P_1), 8e-3);
    near("rate m/s", rate, 91.60e-3, 2e-3);
}

#[test]
fn the_ram_slows_down_under_load_as_the_square_root_of_what_is_left() {
    // C3c: the steady solution of the valve's and the lines' equations.
    for (force_n, rate_m_s) in [
        (10e3, 80.3e-3),
        (20e3, 67.2e-3),
        (30e3, 51.1e-3),
        (40e3, 28.0e-3),
    ] {
        let moved = constant_moment(test(), -2.0 * ARM_M * force_n)
            .command(step(0.1, -0.3, 0.42))
            .lasting(1.2, 1e-3)
            .run(&[X_P_1]);
        let rate = crossing_rate(&moved.time_s, moved.of(X_P_1), 3e-3);
        near(&format!("rate at {force_n} N"), rate, rate_m_s, 0.01);
    }
}

#[test]
fn a_blocked_ram_pushes_with_the_stall_force() {
    // C4: A (p_sup − p_tank) = 45 637 N, less what the pilot's flow loses in the
    // supply line.
    let rest = blocked().hold_deg(25.0).at_rest();
    let force = rest.of("actuator_1.cylinder.position_m") * STIFFNESS_N_M;
    near("force N", force, 45_561.0, 1e-3);
    assert!(force < 45_637.0);
    near(
        "spring m",
        rest.of("actuator_1.cylinder.position_m"),
        2.28e-3,
        2e-3,
    );
}

#[test]
fn without_load_both_chambers_stand_half_way_and_the_valve_leaks_at_null() {
    // C6 and C8.
    let rest = test().load(0.0).at_rest();
    let p_s = rest.of("actuator_1.manifold_supply.pressure_pa");
    let p_t = rest.of("actuator_1.manifold_tank.pressure_pa");
    for id in [P_A_1, P_B_1, P_A_2, P_B_2] {
        near(id, rest.of(id), 106.35 * BAR, 1e-4);
        near(id, rest.of(id), 0.5 * (p_s + p_t), 1e-4);
    }
    let flow =
        |rest: &crate::aileron::Rest| rest.of("actuator_1.tank.port.flow_m3_s") / LITRE_PER_MINUTE;
    near("null leakage L/min", flow(&rest), 0.441, 5e-3);
    let without_pilot = test()
        .load(0.0)
        .with("actuator_1.servo_valve.pilot_area_m2", 0.0)
        .at_rest();
    near("of the four edges", flow(&without_pilot), 0.129, 0.01);
}

#[test]
fn one_percent_of_spool_gives_most_of_the_pressure() {
    // C7: at a ram that stands still.
    let rest = blocked()
        .with_both("controller.gain_per_m", 0.0)
        .with_both("controller.pressure_gain", 0.0)
        .with_both("servo_valve.null_bias", 0.01)
        .at_rest();
    near(
        "spool",
        rest.of("actuator_1.servo_valve.spool_position_m"),
        10e-6,
        1e-6,
    );
    near(
        "pressure gain",
        rest.of(P_A_1) - rest.of(P_B_1),
        151.8 * BAR,
        3e-3,
    );
}

// --------------------------------------------------------------- eigenvalues

/// The eigenvalues of the rows and columns of some states, scaled.
fn eigenvalues(jacobian: &[Vec<f64>], states: &[usize]) -> Vec<Complex<f64>> {
    let scale = |k: usize| program().states()[states[k]].scale;
    let n = states.len();
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        jacobian[states[i]][states[j]] * scale(j) / scale(i)
    });
    matrix.complex_eigenvalues().iter().copied().collect()
}

/// Frequency in Hz and damping ratio of the pair nearest to a frequency.
fn mode(eigenvalues: &[Complex<f64>], near_hz: f64) -> (f64, f64) {
    let swinging = eigenvalues.iter().filter(|e| e.im > 0.0);
    let off = |e: &&Complex<f64>| (e.norm() / TAU / near_hz).ln().abs();
    let found = swinging
        .min_by(|a, b| off(a).total_cmp(&off(b)))
        .expect("a mode");
    (found.norm() / TAU, -found.re / found.norm())
}

fn ram_states(actuator: &str) -> Vec<usize> {
    [
        "pressure_a_pa",
        "pressure_b_pa",
        "position_m",
        "velocity_m_s",
    ]
    .map(|s| state(&format!("{actuator}.cylinder.{s}")))
    .to_vec()
}

/// No friction anywhere, at null, without load.
fn frictionless() -> Vec<Vec<f64>> {
    test()
        .load(0.0)
        .with_both("cylinder.coulomb_friction_n", 0.0)
        .with_both("cylinder.viscous_friction_n_s_m", 0.0)
        .with("aileron.friction_nm", 0.0)
        .with("aileron.viscous_nm_s", 0.0)
        .at_rest()
        .jacobian()
}

#[test]
fn the_piston_swings_on_its_oil() {
    // C5, C5a: the rest of the system (spools, aileron) held.
    let pressure_pa = 106.35 * BAR;
    let fluid = Fluid::default().at(313.15).bulk.to_array();
    let bulk_pa = 1.0 / compressibility_per_pa(&fluid, pressure_pa);
    near("bulk modulus Pa", bulk_pa, 1.347e9, 1e-3);
    let oil_n_m = 2.0 * bulk_pa * AREA_M2 * AREA_M2 / 65e-6;
    near("oil stiffness N/m", oil_n_m, 2.14e8, 2e-3);
    let formula_hz = ((oil_n_m + STIFFNESS_N_M) / 2.0).sqrt() / TAU;
    let (frequency_hz, _) = mode(
        &eigenvalues(&frictionless(), &ram_states("actuator_1")),
        1700.0,
    );
    near("piston on oil Hz", frequency_hz, 1721.6, 1e-3);
    near("piston on oil Hz", frequency_hz, formula_hz, 1e-3);
}

#[test]
fn the_aileron_swings_on_oil_and_attachments() {
    // C5b: spools frozen.
    let mut states = ram_states("actuator_1");
    states.extend(ram_states("actuator_2"));
    states.extend([state("aileron.angle_rad"), state("aileron.rate_rad_s")]);
    let (frequency_hz, damping) = mode(&eigenvalues(&frictionless(), &states), 30.0);
    near("load mode Hz", frequency_hz, 30.20, 2e-3);
    // Only the attachments' damping and the leakage at null are left.
    near("its damping ratio", damping, 0.0095, 0.1);
}

#[test]
fn at_every_hold_all_motions_die_out() {
    // Physics notes 6.1. The damping of the load mode at rest is that of the
    // hinge's smoothed dry friction, M_f/ω_f; the prototype's 0.30 is that of
    // ω_f = 0.02 rad/s, the system file has 0.05 (0.17).
    for (angle_deg, load_mode_hz, load_mode_damping) in [(0.0, 32.9, 0.30), (20.0, 31.4, 0.30)] {
        let jacobian = test()
            .hold_deg(angle_deg)
            .with("aileron.friction_smoothing_rad_s", 0.02)
            .at_rest()
            .jacobian();
        let all: Vec<usize> = (0..program().states().len()).collect();
        let eigenvalues = eigenvalues(&jacobian, &all);
        assert!(
            eigenvalues.iter().all(|e| e.re < 0.0),
            "{angle_deg}: {eigenvalues:?}"
        );
        let fastest = eigenvalues.iter().map(|e| e.re).fold(0.0, f64::min);
        near("fastest 1/s", fastest, -7.7e4, 0.02);
        let (frequency_hz, damping) = mode(&eigenvalues, 32.0);
        near("load mode Hz", frequency_hz, load_mode_hz, 0.02);
        near("its damping ratio", damping, load_mode_damping, 0.1);
    }
}

// -------------------------------------------------------------- position loop

#[test]
fn the_loop_follows_steps_at_its_velocity_gain() {
    // C9: K_v = 26.5 1/s, and the table 7.1: (load, step in degrees) → 10 to 90 %
    // in ms, settled to 2 % in ms, final angle in degrees.
    for (load, step_deg, rise_ms, settle_ms, final_deg) in [
        (0.0, 2.0_f64, 72.0, 147.0, 2.0),
        (0.0, 10.0, 98.0, 176.0, 10.0),
        (0.0, 20.0, 163.0, 242.0, 20.0),
        (1.0, 10.0, 121.0, 240.0, 9.17),
        (1.0, 20.0, 215.0, 358.0, 18.37),
    ] {
        let run = test()
            .load(load)
            .command(step(0.1, 0.0, step_deg.to_radians()))
            .lasting(0.9, 1e-3)
            .run(&[ANGLE]);
        let angle = run.of(ANGLE);
        let (first, last) = (angle[0], *angle.last().unwrap());
        let time_to = |share: f64| {
            let level = first + share * (last - first);
            let k = angle.iter().position(|a| *a >= level).unwrap();
            let fraction = (level - angle[k - 1]) / (angle[k] - angle[k - 1]);
            (run.time_s[k - 1] + 1e-3 * fraction - 0.1) * 1e3
        };
        let outside = angle
            .iter()
            .rposition(|a| (a - last).abs() > 0.02 * (last - first).abs());
        let settled_ms = (run.time_s[outside.unwrap()] - 0.1) * 1e3;
        println!("load {load} step {step_deg}: t63 {:.1}", time_to(0.632));
        near("final angle", last.to_degrees(), final_deg, 5e-3);
        near("10 to 90 % ms", time_to(0.9) - time_to(0.1), rise_ms, 0.05);
        near("settled ms", settled_ms, settle_ms, 0.1);
        if step_deg == 2.0 {
            near("63 % ms", time_to(0.632), 47.0, 0.05);
        }
    }
}

#[test]
fn the_air_load_bends_the_attachments() {
    // C11: 10° commanded at 100 % load.
    let rest = test().hold_deg(10.0).at_rest();
    let angle = rest.of(ANGLE);
    near("angle deg", angle.to_degrees(), 9.171, 2e-4);
    let drop = |a: &str, b: &str| rest.of(a) - rest.of(b);
    near(
        "pressure difference 1",
        drop(P_A_1, P_B_1),
        65.1 * BAR,
        2e-3,
    );
    near(
        "pressure difference 2",
        drop(P_A_2, P_B_2),
        65.1 * BAR,
        2e-3,
    );
    let force = AREA_M2 * (drop(P_A_1, P_B_1) + drop(P_A_2, P_B_2));
    near(
        "hinge moment N m",
        ARM_M * angle.cos() * force,
        1532.95,
        5e-4,
    );
    // C11b: most of the droop is the attachments' compliance, the rest the
    // spool's offset against the leakage.
    let droop_deg = 10.0 - angle.to_degrees();
    near("droop deg", droop_deg, 0.829, 2e-3);
    let compliance_deg = (0.5 * force / (STIFFNESS_N_M * ARM_M * angle.cos())).to_degrees();
    near("compliance deg", compliance_deg, 0.808, 0.02);
    assert!(compliance_deg < droop_deg);
}

#[test]
fn actuators_rigged_apart_fight_and_the_equaliser_makes_peace() {
    // C12: ± k d/(2 A (1 + L)), L = k K_eq/A.
    let fight = |gain: f64| {
        let rest = test()
            .load(0.0)
            .with("actuator_1.controller.rig_offset_m", 1e-4)
            .with("equaliser.gain_m_pa", gain)
            .at_rest();
        [
            rest.of(P_A_1) - rest.of(P_B_1),
            rest.of(P_A_2) - rest.of(P_B_2),
        ]
    };
    let formula = |gain: f64| 0.5 * STIFFNESS_N_M * 1e-4 / (AREA_M2 + STIFFNESS_N_M * gain);
    for (gain, prototype) in [(0.0, 4.351 * BAR), (2.5e-10, 1.370 * BAR)] {
        let [first, second] = fight(gain);
        near("fight Pa", first, prototype, 5e-3);
        near("fight Pa", second, -prototype, 5e-3);
        // The formula takes the servo loops as stiff: 1 % too much.
        near("formula", first, formula(gain), 0.015);
    }
}

// --------------------------------------------------------------- damping mode

#[test]
fn one_active_actuator_drags_the_damped_one_at_seventy_millimetres_per_second() {
    // C13c.
    let run = test()
        .load(0.0)
        .input("actuator_2.mode", constant(0.0))
        .command(step(0.1, -0.42, 0.42))
        .lasting(0.9, 1e-3)
        .run(&[X_P_1, P_A_2, P_B_2]);
    let rate = crossing_rate(&run.time_s, run.of(X_P_1), 5e-3);
    near("rate m/s", rate, 70.1e-3, 0.01);
    let middle = run.of(X_P_1).iter().position(|x| *x > 0.0).unwrap();
    near(
        "damper Pa",
        run.of(P_B_2)[middle] - run.of(P_A_2)[middle],
        73.9 * BAR,
        0.02,
    );
}

#[test]
fn with_both_damped_the_aileron_floats_where_the_air_wants_it() {
    // C13b: −(C_0 + C_α α)/C_θ.
    let rest = test()
        .input("actuator_1.mode", constant(0.0))
        .input("actuator_2.mode", constant(0.0))
        .at_rest();
    near(
        "float angle deg",
        rest.of(ANGLE).to_degrees(),
        -2.2049,
        1e-3,
    );
    for id in [P_A_1, P_B_1, P_A_2, P_B_2] {
        near(id, rest.of(id), 15.0 * BAR, 0.01);
    }
}
