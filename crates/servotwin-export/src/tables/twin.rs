//! The virtual twin: the sizes of its arrays, the tables of its steps, and its equations.

use crate::error::ExportError;
use crate::notation::{place, record, sizes_text, write_commented_list, write_public};
use crate::twin::ExportedTwin;
use servotwin_model::c_source::{described, hexadecimal, write_twin};
use servotwin_model::program::Program;
use servotwin_model::solver::tableau::Tableau;
use servotwin_model::solver::{Between, Control};
use servotwin_model::spec::Start;

/// The head of each file.
const HEAD: &str = "/* Written by servotwin; do not edit. */\n";

/// The texts of three files: sizes, tables and equations.
pub(crate) fn texts(twin: &ExportedTwin) -> Result<[String; 3], ExportError> {
    let method = twin.settings.method;
    let explicit = ExportError::Unsupported("an explicit method has no counterpart in an export");
    let equations = write_twin(twin.program, method);
    let (tableau, equations) = method.tableau().zip(equations).ok_or(explicit)?;
    let sizes = sizes_text(HEAD, "SERVOTWIN_TWIN", &sizes(twin.program, tableau));
    Ok([sizes, tables(twin, tableau), equations])
}

/// Parameters without a fault, with their names and units.
fn parameters(program: &Program) -> impl Iterator<Item = (String, f64)> {
    let values = program.parameters(&[]);
    let components = program.network().components.iter().zip(values);
    components.flat_map(|(instance, values)| {
        let declared = instance.component.spec().parameters.iter();
        let named =
            declared.map(|p| described(&format!("{}.{}", instance.id, p.name), p.unit.symbol()));
        named.zip(values).collect::<Vec<_>>()
    })
}

fn sizes(program: &Program, tableau: &Tableau) -> [(&'static str, usize); 13] {
    let clocks = program.clock_periods_s().count();
    [
        ("STATES", program.states().len()),
        ("INPUTS", program.externals().len()),
        ("HELD", program.stand_ins().end - program.externals().start),
        ("SUMS_END", program.derivatives().end),
        ("VARIABLES", program.memory()),
        ("PARAMETERS", parameters(program).count()),
        ("FAULTS", program.faults().count()),
        ("CONSTANTS", program.constants()),
        ("GRADIENTS", program.jacobian().slots()),
        ("FACTORS", program.lu().slots()),
        ("STAGES", tableau.stages()),
        ("CLOCKS", clocks),
        ("MOST_CLOCKS", clocks.max(1)),
    ]
}

/// The text of the tables.
fn tables(twin: &ExportedTwin, tableau: &Tableau) -> String {
    let mut text = [HEAD, "#include \"servotwin_twin.h\"\n\n"].concat();
    write_public(&mut text, "servotwin_step_control", "twin_control", &control(twin, tableau));
    states(&mut text, twin.program);
    inputs(&mut text, twin);
    let periods = twin.program.clock_periods_s().map(plain);
    write_entries(&mut text, "double", "clock_periods_s", "MOST_CLOCKS", periods.collect());
    let parameters = parameters(twin.program).map(|(name, value)| (hexadecimal(value), name));
    write_entries(&mut text, "double", "parameters", "PARAMETERS", parameters.collect());
    // The header of the hybrid twin declares these too.
    text += "\nextern const int32_t servotwin_twin_sensors[];\n";
    let count = twin.sensors.len().max(1).to_string();
    let sensors: Vec<_> =
        twin.sensors.iter().map(|slot| (slot.to_string(), String::new())).collect();
    write_commented_list(&mut text, "int32_t", ("twin_sensors", &count), &sensors);
    text
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

fn states(text: &mut String, program: &Program) {
    let states = program.states();
    let components = &program.network().components;
    let first_parameter = |component: usize| -> usize {
        components[..component].iter().map(|instance| instance.parameters.len()).sum()
    };
    let guesses = states.iter().map(|state| {
        let spec = components[state.component].component.spec();
        let (parameter, value) = match spec.states[state.state].start {
            Start::Value(value) => (None, value),
            Start::Parameter(name) => {
                let number = spec.parameter(name).unwrap_or_default();
                (Some(first_parameter(state.component) + number), 0.0)
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
