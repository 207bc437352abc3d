//! The virtual twin: the sizes of its arrays, the tables of its steps, and its equations.

use super::known_answer;
use crate::error::ExportError;
use crate::notation::{place, record, sizes_text, write_commented_list, write_public};
use crate::twin::{ExportedReaction, ExportedTwin};
use servotwin_io::manifest::sha256_of_text;
use servotwin_model::c_source::{described, hexadecimal, write_twin};
use servotwin_model::program::{Program, Slot};
use servotwin_model::solver::tableau::Tableau;
use servotwin_model::solver::{Between, Control};
use servotwin_model::spec::Start;
use std::collections::BTreeSet;

/// The head of each file.
const HEAD: &str = "/* Written by servotwin; do not edit. */\n";

/// The test of the arithmetic with which the equations are compiled.
const KEEPS_RULES: &str = "
bool servotwin_equations_keeps_rules(void)
{
    return servotwin_keeps_rules();
}
";

/// The texts of three files: sizes, tables and equations.
pub(crate) fn texts(twin: &ExportedTwin) -> Result<[String; 3], ExportError> {
    let method = twin.settings.method;
    let explicit = ExportError::Unsupported("an explicit method has no counterpart in an export");
    let equations = write_twin(twin.program, method);
    let (tableau, mut equations) = method.tableau().zip(equations).ok_or(explicit)?;
    equations += KEEPS_RULES;
    let tables = tables(twin, tableau);
    let made_of = [
        ("SYSTEM", format!("{:016x}", twin.program.identity())),
        ("TABLES_SHA256", sha256_of_text(&tables)),
        ("EQUATIONS_SHA256", sha256_of_text(&equations)),
    ];
    let parameters = described_parameters(twin.program).map(|(name, ..)| name).collect();
    let indices = [("PARAMETER", parameters)];
    let sizes = sizes_text(HEAD, "SERVOTWIN_TWIN", &made_of, &sizes(twin, tableau), &indices);
    Ok([sizes, tables, equations])
}

/// Parameters without a fault: name, unit and value.
fn described_parameters(program: &Program) -> impl Iterator<Item = (String, &'static str, f64)> {
    let values = program.parameters(&[]);
    let components = program.network().components.iter().zip(values);
    components.flat_map(|(instance, values)| {
        let units = instance.component.parameters.iter().map(|own| own.unit.symbol());
        let named = instance.parameter_names().zip(units).zip(values);
        named.map(|((name, unit), value)| (name, unit, value)).collect::<Vec<_>>()
    })
}

fn sizes(twin: &ExportedTwin, tableau: &Tableau) -> [(&'static str, usize); 15] {
    let program = twin.program;
    let clocks = program.clock_periods_s().count();
    [
        ("STATES", program.states().len()),
        ("INPUTS", program.externals().len()),
        ("HELD", program.stand_ins().end - program.externals().start),
        ("SUMS_END", program.derivatives().end),
        ("VARIABLES", program.memory()),
        ("PARAMETERS", described_parameters(program).count()),
        ("FAULTS", program.faults().count()),
        ("CONSTANTS", program.constants()),
        ("GRADIENTS", program.jacobian().slots()),
        ("FACTORS", program.lu().slots()),
        ("STAGES", tableau.stages()),
        ("CLOCKS", clocks),
        ("MOST_CLOCKS", clocks.max(1)),
        ("REACTIONS", twin.reactions.len()),
        ("MOST_REACTIONS", twin.reactions.len() + 1),
    ]
}

/// The text of the tables.
fn tables(twin: &ExportedTwin, tableau: &Tableau) -> String {
    let mut text = [HEAD, "#include \"servotwin_twin.h\"\n\n#include <math.h>\n\n"].concat();
    write_public(&mut text, "servotwin_step_control", "twin_control", &control(twin, tableau));
    states(&mut text, twin);
    inputs(&mut text, twin);
    let periods = twin.program.clock_periods_s().map(plain);
    write_entries(&mut text, "double", "clock_periods_s", "MOST_CLOCKS", periods.collect());
    let parameters = described_parameters(twin.program)
        .map(|(name, unit, value)| (hexadecimal(value), described(&name, unit)));
    write_entries(&mut text, "double", "parameters", "PARAMETERS", parameters.collect());
    // The header of the hybrid twin declares these too.
    text += "\nextern const int32_t servotwin_twin_sensors[];\n";
    write_counted(&mut text, "int32_t", "sensors", twin.sensors.iter().map(Slot::to_string));
    let bound = |value: f64| match value.is_finite() {
        true => hexadecimal(value),
        false if value > 0.0 => "HUGE_VAL".into(),
        false => "-HUGE_VAL".into(),
    };
    let possible = twin.possible.iter().map(|&(low, high)| record(&[bound(low), bound(high)]));
    write_counted(&mut text, "servotwin_range", "possible", possible);
    reactions(&mut text, twin);
    text += &format!(
        "\nconst uint64_t servotwin_twin_known_answer = {};\n",
        known_answer::of_twin(twin)
    );
    text
}

/// What the flight control computer does after each action.
fn reactions(text: &mut String, twin: &ExportedTwin) {
    let (mut changes, mut entries) = (Vec::new(), Vec::new());
    let mut seen = BTreeSet::new();
    for known in &twin.reactions {
        let ExportedReaction { actuator, action, detail, reaction } = known;
        let first = changes.len();
        let is_seen = known.is_seen() && seen.insert(*actuator);
        let mut change = |kind: &str, at: usize, value| {
            changes.push(record(&[kind.into(), at.to_string(), hexadecimal(value)]));
        };
        reaction.inputs.iter().for_each(|&(at, value)| change("SERVOTWIN_SETS_INPUT", at, value));
        for &(component, parameter, value) in &reaction.parameters {
            change("SERVOTWIN_SETS_PARAMETER", twin.first_parameter(component) + parameter, value);
        }
        reaction.takes_out.iter().for_each(|&at| change("SERVOTWIN_TAKES_OUT", at, 0.0));
        let end = changes.len();
        let numbers = [actuator.to_string(), action.to_string(), place(*detail)];
        let [off, is_seen] = [reaction.switches_off, is_seen].map(|flag| flag.to_string());
        entries.push(record(
            &[&numbers[..], &[off, is_seen, first.to_string(), end.to_string()]].concat(),
        ));
    }
    write_counted(text, "servotwin_change", "changes", changes.into_iter());
    write_counted(text, "servotwin_reaction", "reactions", entries.into_iter());
}

/// Adds an array without comments, of its own length.
fn write_counted(
    text: &mut String,
    kind: &str,
    name: &str,
    entries: impl ExactSizeIterator<Item = String>,
) {
    let count = entries.len().max(1).to_string();
    let entries: Vec<_> = entries.map(|entry| (entry, String::new())).collect();
    write_commented_list(text, kind, (&format!("twin_{name}"), &count), &entries);
}

/// A number without a comment.
fn plain(value: f64) -> (String, String) {
    (hexadecimal(value), String::new())
}

/// Adds an array, one line for each entry, with its comment if it has one. Its length is a size of the twin.
fn write_entries(
    text: &mut String,
    kind: &str,
    name: &str,
    length: &str,
    entries: Vec<(String, String)>,
) {
    let (name, length) = (format!("twin_{name}"), format!("SERVOTWIN_TWIN_{length}"));
    write_commented_list(text, kind, (&name, &length), &entries);
}

fn states(text: &mut String, twin: &ExportedTwin) {
    let states = twin.program.states();
    let components = &twin.program.network().components;
    let guesses = states.iter().map(|state| {
        let spec = components[state.component].component;
        let (parameter, value) = match spec.states[state.state].start {
            Start::Value(value) => (None, value),
            Start::Parameter(name) => {
                let number = spec.parameter(name).unwrap_or_default();
                (Some(twin.first_parameter(state.component) + number), 0.0)
            }
        };
        let guess = record(&[place(parameter), hexadecimal(value)]);
        (guess, described(&state.name, state.unit.symbol()))
    });
    write_entries(text, "servotwin_guess", "guesses", "STATES", guesses.collect());
    let reciprocal = |number: f64| plain(1.0 / number);
    for (name, values) in [
        ("scales", states.iter().map(|s| reciprocal(s.scale)).collect::<Vec<_>>()),
        ("allowances", states.iter().map(|s| reciprocal(s.scale * s.error_weight)).collect()),
        ("lowest", states.iter().map(|s| plain(s.lowest.max(-f64::MAX))).collect()),
    ] {
        write_entries(text, "double", name, "STATES", values);
    }
}

fn inputs(text: &mut String, twin: &ExportedTwin) {
    let inputs = &twin.program.network().inputs;
    let defaults = inputs.iter().map(|input| {
        let knot = record(&[hexadecimal(input.default), hexadecimal(0.0)]);
        (knot, described(&input.id, input.unit.symbol()))
    });
    write_entries(text, "servotwin_knot", "defaults", "INPUTS", defaults.collect());
    let course = |between: &Between| match between {
        Between::Hold => "SERVOTWIN_HOLD",
        Between::Line => "SERVOTWIN_LINE",
        Between::Cubic => "SERVOTWIN_CUBIC",
    };
    let courses = twin.between.iter().map(|between| (course(between).into(), String::new()));
    write_entries(text, "servotwin_between", "between", "INPUTS", courses.collect());
    let slopes = (0..inputs.len()).map(|input| twin.program.jacobian().slope(input));
    let slopes = slopes.map(|slope| (slope.to_string(), String::new()));
    write_entries(text, "int32_t", "slopes", "INPUTS", slopes.collect());
}

/// The entry of the control of the steps.
fn control(twin: &ExportedTwin, tableau: &Tableau) -> String {
    let (is_fixed, step_s, tolerance, max_step_s, limit) = match twin.settings.control {
        Control::Fixed { step_s } => (true, step_s, 1.0, 1.0, f64::MAX),
        Control::Adaptive { tolerance, max_step_s, attempt_rate_limit_per_s } => {
            (false, 0.0, tolerance, max_step_s, attempt_rate_limit_per_s.min(f64::MAX))
        }
    };
    let growth_exponent = -1.0 / f64::from(tableau.order);
    let numbers = |numbers: &[f64]| {
        let numbers: Vec<String> = numbers.iter().map(|&number| hexadecimal(number)).collect();
        record(&numbers)
    };
    record(&[
        hexadecimal(twin.period_s),
        is_fixed.to_string(),
        hexadecimal(step_s),
        hexadecimal(tolerance),
        hexadecimal(max_step_s),
        hexadecimal(limit),
        hexadecimal(1.0 / tableau.gamma),
        hexadecimal(growth_exponent),
        numbers(tableau.alpha),
        numbers(tableau.gamma_sum),
    ])
}
