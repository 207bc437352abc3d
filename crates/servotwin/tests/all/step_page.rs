//! The drawing of one solver step shows the lengths of the arrays as they are.

use servotwin::system::System;
use servotwin_model::solver::{Method, SolverSettings};
use std::collections::BTreeSet;

const PAGE: &str = include_str!("../../../servotwin-model/src/solver/mod.rs");

/// (name, length) of everything that the drawing shows as `name [length]`.
fn drawn() -> BTreeSet<(String, usize)> {
    let drawing = PAGE.split("```text").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let lines = drawing.lines().map(|line| line.trim_start_matches("//!"));
    let pieces = lines.flat_map(|line| line.split(['|', '=']).flat_map(|part| part.split("  ")));
    let length = |piece: &str| {
        let (name, rest) = piece.trim().split_once(" [")?;
        Some((name.to_owned(), rest.strip_suffix(']')?.parse().ok()?))
    };
    pieces.filter_map(length).collect()
}

#[test]
fn the_drawing_of_a_step_shows_the_lengths_of_the_arrays() {
    let system = System::read("../../systems/valve_and_cylinder.toml").unwrap();
    let program = &system.program;
    let (jacobian, lu) = (program.jacobian(), program.lu());
    let states = program.states().len();
    let inputs = program.externals();
    let stand_ins = program.stand_in_values(&program.parameters(&[])).len();
    let derivatives = program.derivatives();
    let partials = jacobian.partial_range();
    let stages = |method: Method| method.tableau().map_or(0, |tableau| tableau.stages());
    let most_stages = Method::ALL.into_iter().map(stages).max().unwrap();
    let mut measured: Vec<(String, usize)> = [
        ("constants", program.constants()),
        ("y", states),
        ("variables", program.memory()),
        ("states", states),
        ("inputs", inputs.len()),
        ("stand-ins", stand_ins),
        ("sums", derivatives.start - inputs.end - stand_ins),
        ("derivatives", derivatives.len()),
        ("spare", program.memory() - program.slots()),
        ("equation blocks", program.blocks()),
        ("chain-rule products", jacobian.products()),
        ("gradients", jacobian.slots()),
        ("one and zero", jacobian.slope(0)),
        ("input slopes", inputs.len()),
        ("sum gradients", partials.start - jacobian.slope(inputs.len())),
        ("partials", partials.len()),
        ("Jacobian entries", jacobian.entries().len()),
        ("update products", lu.updates()),
        ("factors", lu.slots()),
        ("stages of the method", stages(SolverSettings::of_runs().method)),
        ("stages", most_stages * states),
        ("y_new", states),
    ]
    .map(|(name, length)| (name.to_owned(), length))
    .into();
    let shown_stages = [1, 2, most_stages];
    measured.extend(shown_stages.map(|stage| (format!("U_{stage}"), states)));
    assert_eq!(drawn(), measured.into_iter().collect());
}
