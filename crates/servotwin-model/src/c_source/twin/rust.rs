//! The functions of a twin in Rust: a module whose arrays have fixed lengths.

use super::super::functions::Traced;
use super::super::helpers::Frame;
use super::super::printer::line;
use super::super::statements::RustStatements;
use super::{Choice, TwinLanguage, is_one_of_several};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// Rust without its standard library.
#[derive(Clone, Copy)]
pub(super) struct Rust;

const HEADING: &str = "//! The equations of the system and the linear algebra of a step, written by servotwin for one system; do not edit. All
//! values are in SI units. One operation per statement, as in the same export in C.

use crate::twin_sizes::*;

";

const POWER: &str = "/// x^exponent for a positive, normal x.
pub fn power(x: f64, exponent: f64) -> f64 {
    let logarithm = log2(x);
    let product = logarithm * exponent;
    exp2(product)
}
";

/// What each function does.
const SUMMARIES: &[(&str, &str)] = &[
    (
        "faults",
        "Applies faults to the parameters of a healthy system. An intensity is 0 (healthy) to 1.",
    ),
    ("constants", "The constants of the equations, from parameters."),
    (
        "stand_ins",
        "Writes parameters and temperatures that stand in for open signal inputs into the variables.",
    ),
    (
        "evaluate",
        "Computes all sums, among them the derivatives, from states, inputs and held values.",
    ),
    ("begin", "The same, and the gradients."),
    ("motion", "Computes the derivatives of the states only."),
    ("factor", "Factors diagonal\\[0\\] * I - J."),
    ("solve_first", "Solves the first stage; the result replaces the right-hand side."),
    ("solve", "Solves any other stage; the result replaces the right-hand side."),
    ("sums", "Argument and right-hand side of a stage from the second (1) on."),
    (
        "tick",
        "Runs the sampled equations of a clock and stores the values that it holds. An evaluation must precede it.",
    ),
];

/// The line of documentation of a public function.
fn summary(name: &str) -> String {
    let known = SUMMARIES.iter().find(|(of, _)| *of == name);
    known.map_or(String::new(), |(_, text)| format!("/// {text}\n"))
}

/// The length of an array, as a constant of `twin_sizes` where it is one.
fn length(array: &str) -> &'static str {
    match array {
        "diagonal" | "slope_factor" | "reciprocal" => "1",
        "right" | "y" => "STATES",
        "stages" => "STAGES * STATES",
        "intensities" => "FAULTS",
        "constants" => "CONSTANTS",
        "variables" => "VARIABLES",
        "gradients" => "GRADIENTS",
        "factors" => "FACTORS",
        "parameters" => "PARAMETERS",
        _ => "NEXT",
    }
}

/// The arguments of a function.
fn arguments(reads: &[&str], writes: &[&str]) -> Vec<String> {
    let reads = reads.iter().map(|name| format!("{name}: &[f64; {}]", length(name)));
    let writes = writes.iter().map(|name| format!("{name}: &mut [f64; {}]", length(name)));
    reads.chain(writes).collect()
}

impl TwinLanguage for Rust {
    type Statements = RustStatements;

    fn statements(self) -> RustStatements {
        RustStatements
    }

    fn heading(self, most_held: Option<usize>) -> String {
        let next = most_held.map(|most| {
            format!("/// The most values that a clock passes on.\nconst NEXT: usize = {most};\n\n")
        });
        [HEADING, next.as_deref().unwrap_or_default()].concat()
    }

    fn frame(self) -> Frame<'static> {
        Frame::Rust
    }

    fn power(self) -> &'static str {
        POWER
    }

    fn begin(self, traced: &Traced) -> String {
        let linkage = if is_one_of_several(traced) { "" } else { "pub " };
        let arguments = arguments(traced.reads, traced.writes).join(", ");
        let names = traced.reads.iter().chain(traced.writes);
        let unused: String = names.map(|name| format!("\n    let _ = &{name};")).collect();
        let (name, summary) = (&traced.name, summary(&traced.name));
        format!("{summary}{linkage}fn {name}({arguments}) {{{unused}")
    }

    fn print_choice(self, c: &mut String, choice: &Choice) {
        let &Choice { name, number, reads, writes, own, .. } = choice;
        let mut head = arguments(reads, writes);
        head.insert(0, format!("{number}: usize"));
        let (head, summary) = (head.join(", "), summary(name));
        line(c, format_args!("{summary}pub fn {name}({head}) {{"));
        for array in reads.iter().chain(writes) {
            line(c, format_args!("    let _ = &{array};"));
        }
        let mut arrays: Vec<String> =
            reads.iter().chain(writes).map(|&array| array.into()).collect();
        if let Some((own, _)) = own {
            line(c, format_args!("    let mut {own} = [0.0; {}];", length(own)));
            arrays.push(format!("&mut {own}"));
        }
        line(c, format_args!("    match {number} {{"));
        for case in &choice.cases {
            let stores: String =
                case.stores.iter().map(|store| format!("            {store}\n")).collect();
            let (case, arrays) = (case.number, arrays.join(", "));
            line(c, format_args!("        {case} => {{"));
            line(c, format_args!("            {name}_{case}({arrays});\n{stores}        }}"));
        }
        line(c, format_args!("        _ => {{}}\n    }}\n}}\n"));
    }
}
