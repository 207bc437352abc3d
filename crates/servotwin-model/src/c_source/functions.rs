//! The functions of a step of the solver, traced: name, arrays, and the value of every entry that they write.

use super::parameter_symbols;
use super::printer::Stores;
use crate::program::Program;
use crate::scalar::Scalar;
use crate::solver::tableau::Tableau;
use crate::symbol::tangent::tangents;
use crate::symbol::{Expression, Graph, Operand, Symbol};
use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

/// A function that writes entries of arrays.
pub(super) struct Traced<'g> {
    pub(crate) name: String,
    /// Arrays that it only reads.
    pub(crate) reads: &'static [&'static str],
    /// Arrays that it writes, and may read.
    pub(crate) writes: &'static [&'static str],
    /// (array, index, value).
    pub(crate) entries: Vec<(&'static str, usize, Symbol<'g>)>,
}

impl Traced<'_> {
    /// The entries that receive each value.
    pub(crate) fn stores(&self) -> Stores {
        let mut stores = Stores::new();
        for &(array, place, value) in &self.entries {
            // An entry that keeps its value needs no store.
            if value.expression() != Some(Expression::Variable(array, place as u32)) {
                stores.entry(value.operand()).or_default().push((array, place));
            }
        }
        stores
    }
}

/// The entries of an external array.
fn array<'g>(graph: &'g Graph, name: &'static str, length: usize) -> Vec<Symbol<'g>> {
    (0..length).map(|index| graph.variable(name, index)).collect()
}

/// Values for the entries of an array, from its first on.
fn entries<'g>(
    array: &'static str,
    values: impl IntoIterator<Item = Symbol<'g>>,
) -> impl Iterator<Item = (&'static str, usize, Symbol<'g>)> {
    values.into_iter().enumerate().map(move |(place, value)| (array, place, value))
}

/// The variable array with `given` external entries. The others are filled by the function.
fn variables<'g>(graph: &'g Graph, program: &Program, given: usize) -> Vec<Symbol<'g>> {
    let mut variables = array(graph, "variables", given);
    variables.resize(program.memory(), Symbol::constant(0.0));
    variables
}

/// External gradients, and the two entries that never change.
fn gradients<'g>(graph: &'g Graph, program: &Program) -> Vec<Symbol<'g>> {
    let mut gradients = array(graph, "gradients", program.jacobian().slots());
    program.jacobian().set_fixed(&mut gradients);
    gradients
}

/// The constants. Those that no parameter changes become numbers. Among constants with the same formula of the same
/// parameters only the first is read, because eight lanes of a number take eight times its space in the nearest cache.
fn constants<'g>(graph: &'g Graph, program: &Program) -> Vec<Symbol<'g>> {
    let of_parameters = Graph::new();
    let values = program.block_constants(&parameter_symbols(program, &of_parameters));
    let mut first = BTreeMap::new();
    let constant = |(place, value): (usize, &Symbol)| match value.operand() {
        Operand::Constant(bits) => Symbol::constant(f64::from_bits(bits)),
        node => graph.variable("constants", *first.entry(node).or_insert(place)),
    };
    values.iter().enumerate().map(constant).collect()
}

/// The sums of an evaluation. Variables that only clocks write are not among them.
fn sums_of<'g>(
    program: &Program,
    variables: &[Symbol<'g>],
) -> Vec<(&'static str, usize, Symbol<'g>)> {
    let untouched = Symbol::constant(0.0).operand();
    let sums = program.sums().filter(|&place| variables[place].operand() != untouched);
    sums.map(|place| ("variables", place, variables[place])).collect()
}

/// Evaluates all equations.
pub(super) fn evaluate<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    let constants = &constants(graph, program);
    let mut variables = variables(graph, program, program.sums().start);
    program.trace(constants, &mut variables);
    let entries = sums_of(program, &variables);
    Traced { name: "evaluate".into(), reads: &["constants"], writes: &["variables"], entries }
}

/// Evaluates all equations and their gradients.
pub(super) fn begin<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    let constants = &constants(graph, program);
    let mut variables = variables(graph, program, program.sums().start);
    let mut gradients = gradients(graph, program);
    program.trace_with_jacobian(constants, &mut variables, &mut gradients);
    let rows = program.jacobian().read_places();
    let rows = rows.into_iter().map(|place| ("gradients", place, gradients[place]));
    Traced {
        name: "begin".into(),
        reads: &["constants"],
        writes: &["variables", "gradients"],
        entries: sums_of(program, &variables).into_iter().chain(rows).collect(),
    }
}

/// The directional derivatives of all sums, with the derivatives of states and inputs in `seeds`.
pub(super) fn tangent<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    let traced = evaluate(graph, program);
    let values: Vec<Symbol> = traced.entries.iter().map(|&(_, _, value)| value).collect();
    let known = program.externals().end;
    let tangents = tangents(graph, &values, |array, index| {
        let is_known = array == "variables" && (index as usize) < known;
        is_known.then(|| graph.variable("seeds", index as usize))
    });
    let places = traced.entries.iter().map(|&(_, place, _)| place);
    Traced {
        name: "tangent".into(),
        reads: &["constants", "variables", "seeds"],
        writes: &["tangents"],
        entries: places.zip(tangents).map(|(place, value)| ("tangents", place, value)).collect(),
    }
}

/// Evaluates the derivatives of the states.
pub(super) fn motion<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    let constants = &constants(graph, program);
    let mut variables = variables(graph, program, program.sums().start);
    program.motion().trace(constants, &mut variables);
    let derivatives = program.derivatives().map(|place| ("variables", place, variables[place]));
    let entries = derivatives.collect();
    Traced { name: "motion".into(), reads: &["constants"], writes: &["variables"], entries }
}

/// Factors `diagonal · I − J`.
pub(super) fn factor<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    let gradients = gradients(graph, program);
    let mut factors = vec![Symbol::constant(0.0); program.lu().slots()];
    program.lu().factor(graph.variable("diagonal", 0), &gradients, &mut factors);
    Traced {
        name: "factor".into(),
        reads: &["diagonal", "gradients"],
        writes: &["factors"],
        entries: entries("factors", factors).collect(),
    }
}

/// Solves the first stage, whose right-hand side starts at zero.
pub(super) fn solve_first<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    let right = vec![Symbol::constant(0.0); program.states().len()];
    solution(graph, program, "solve_first", right)
}

/// Solves any other stage.
pub(super) fn solve<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    solution(graph, program, "solve", array(graph, "right", program.states().len()))
}

fn solution<'g>(
    graph: &'g Graph,
    program: &Program,
    name: &str,
    mut right: Vec<Symbol<'g>>,
) -> Traced<'g> {
    let derivatives = program.derivatives().map(|place| graph.variable("variables", place));
    let derivatives: Vec<Symbol> = derivatives.collect();
    let factors = array(graph, "factors", program.lu().slots());
    let slope_factor = graph.variable("slope_factor", 0);
    let gradients = gradients(graph, program);
    program.solve_stage(&derivatives, slope_factor, &gradients, &factors, &mut right);
    Traced {
        name: name.into(),
        reads: &["variables", "slope_factor", "gradients", "factors"],
        writes: &["right"],
        entries: entries("right", right).collect(),
    }
}

/// The argument and the right-hand side of a stage.
pub(super) fn sums<'g>(
    graph: &'g Graph,
    program: &Program,
    tableau: &Tableau,
    stage: usize,
) -> Traced<'g> {
    let n = program.states().len();
    let mut states = array(graph, "variables", n);
    let mut right = vec![Symbol::constant(0.0); n];
    let (stages, y) = (array(graph, "stages", stage * n), array(graph, "y", n));
    let reciprocal = graph.variable("reciprocal", 0);
    tableau.sum_stages(stage, &mut states, &y, &mut right, reciprocal, &stages);
    Traced {
        name: format!("sums_{stage}"),
        reads: &["reciprocal", "y", "stages"],
        writes: &["variables", "right"],
        entries: entries("variables", states).chain(entries("right", right)).collect(),
    }
}

/// A tick of a clock after an evaluation: what the clock computes, and in `next` the values that it holds from now on.
pub(super) fn tick<'g>(graph: &'g Graph, program: &Program, index: usize) -> Traced<'g> {
    let constants = &constants(graph, program);
    let clock = &program.clocks()[index];
    let mut variables = variables(graph, program, program.slots());
    clock.sequence.trace(constants, &mut variables);
    let next = clock.exchanges.iter().map(|&(from, _)| variables[from as usize]);
    let next: Vec<Symbol> = next.collect();
    let computed = program.sums().map(|place| ("variables", place, variables[place]));
    Traced {
        name: format!("tick_{index}"),
        reads: &["constants"],
        writes: &["variables", "next"],
        entries: computed.chain(entries("next", next)).collect(),
    }
}

/// Applies all faults of the catalog, component by component, to parameters without a fault.
pub(super) fn faults<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    let mut parameters = parameter_symbols(program, graph);
    let mut number = 0;
    program.apply_faults(&mut parameters, |_| {
        number += 1;
        graph.variable("intensities", number - 1)
    });
    Traced {
        name: "faults".into(),
        reads: &["intensities"],
        writes: &["parameters"],
        entries: entries("parameters", parameters.into_iter().flatten()).collect(),
    }
}

/// The constants of a variant, from its parameters with the faults applied.
pub(super) fn block_constants<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    let values = program.block_constants(&parameter_symbols(program, graph));
    Traced {
        name: "constants".into(),
        reads: &["parameters"],
        writes: &["constants"],
        entries: entries("constants", values).collect(),
    }
}

/// What stands in for open signal inputs. Values held by clocks stay as they are.
pub(super) fn stand_ins<'g>(graph: &'g Graph, program: &Program) -> Traced<'g> {
    let first = program.stand_ins().start;
    let values = program.stand_in_values(&parameter_symbols(program, graph));
    let own = values.into_iter().enumerate().filter(|(index, _)| !program.is_held(*index));
    let entries = own.map(|(index, value)| ("variables", first + index, value)).collect();
    Traced { name: "stand_ins".into(), reads: &["parameters"], writes: &["variables"], entries }
}
