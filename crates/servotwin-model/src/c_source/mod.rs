//! A system as C: one printer with three dialects.
//!
//! Tracing the compiled program with [`Symbol`]s records its operations.
//! `printer` turns such a trace into statements, and a dialect spells the single operation.
//!
//! | function | dialect | purpose |
//! |---|---|---|
//! | [`write_equations`] | C99 for one number | simulators without Rust |
//! | [`write_step`] | macros for the lanes of a register | the compiled step of the solver |
//! | [`write_twin`], [`write_statements`] | C99 with hexadecimal literals | exported code that is proven |

mod equations;
mod functions;
mod helpers;
mod printer;
mod statements;
mod step;
mod twin;

pub use equations::{BadPrefix, write_equations};
pub use statements::{hexadecimal, write_statements};
pub use step::write_step;
pub use twin::{write_tangent, write_twin};

use crate::program::Program;
use crate::symbol::{Graph, Symbol};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// A name with its unit, safe inside a comment.
pub fn described(name: &str, unit: &str) -> String {
    let name = name.replace("*/", "* /");
    if unit.is_empty() { name } else { format!("{name}, {unit}") }
}

/// Returns the parameters of all components as variables of the array `parameters`.
fn parameter_symbols<'g>(program: &Program, graph: &'g Graph) -> Vec<Vec<Symbol<'g>>> {
    let mut index = 0;
    let components = program.network().components.iter();
    let mut next = |_: &f64| {
        index += 1;
        graph.variable("parameters", index - 1)
    };
    components.map(|c| c.parameters.iter().map(&mut next).collect()).collect()
}
