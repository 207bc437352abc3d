//! The virtual twin as C: its equations, and the tables of its steps.

use crate::error::ExportError;
use crate::language::Language;
use servotwin_model::c_source::{described, hexadecimal, write_twin};
use servotwin_model::program::{Program, Slot};
use servotwin_model::solver::tableau::Tableau;
use servotwin_model::solver::{Between, Control, Settings};
use servotwin_model::spec::Start;
use std::fmt::Write;

/// A virtual twin to be exported.
#[derive(Clone)]
pub struct Twin<'p> {
    /// Its system.
    pub program: &'p Program,
    /// Method and control of its steps.
    pub settings: Settings,
    /// The time between samples, s.
    pub period_s: f64,
    /// The course of each external input between samples.
    pub between: Vec<Between>,
    /// The least and the largest plausible value of each external input, SI.
    pub ranges: Vec<[f64; 2]>,
    /// The variables that the diagnosis compares with its sensors, in their order.
    pub sensors: Vec<Slot>,
}

impl Twin<'_> {
    /// Whether every step has the same length.
    pub fn has_fixed_step(&self) -> bool {
        matches!(self.settings.control, Control::Fixed { .. })
    }
}

const HEAD: &str = "/* Written by servotwin; do not edit. */\n";

/// `servotwin_twin_sizes.h`, `servotwin_twin_tables.c` and `servotwin_equations.c`.
pub(super) fn texts(twin: &Twin) -> Result<[String; 3], ExportError> {
    let method = twin.settings.method;
    let implicit = method.tableau().zip(write_twin(twin.program, method));
    let explicit = ExportError::Unsupported("an explicit method has no C counterpart");
    let (tableau, equations) = implicit.ok_or(explicit)?;
    Ok([sizes(twin.program, tableau), tables(twin, tableau), equations])
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

fn sizes(program: &Program, tableau: &Tableau) -> String {
    let clocks = program.clock_periods_s().count();
    let all = [
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
    ];
    Language::C.sizes(HEAD, "SERVOTWIN_TWIN", &all)
}

fn tables(twin: &Twin, tableau: &Tableau) -> String {
    let mut c = format!("{HEAD}#include \"servotwin_twin.h\"\n");
    control(&mut c, twin, tableau);
    states(&mut c, twin.program);
    inputs(&mut c, twin);
    let periods = twin.program.clock_periods_s();
    entries(&mut c, "double", "clock_periods_s[SERVOTWIN_TWIN_MOST_CLOCKS]", periods.map(plain));
    let parameters = parameters(twin.program).map(|(name, value)| (hexadecimal(value), name));
    entries(&mut c, "double", "parameters[SERVOTWIN_TWIN_PARAMETERS]", parameters);
    let sensors = twin.sensors.iter().map(|slot| (slot.to_string(), String::new()));
    let _ = writeln!(c, "\nextern const int32_t servotwin_twin_sensors[];");
    entries(&mut c, "int32_t", &format!("sensors[{}]", twin.sensors.len().max(1)), sensors);
    c
}

/// A number without a comment.
fn plain(value: f64) -> (String, String) {
    (hexadecimal(value), String::new())
}

/// Writes `const KIND servotwin_twin_NAME = { … };`: one line for each entry, with its comment if it has one.
fn entries(
    c: &mut String,
    kind: &str,
    name: &str,
    entries: impl Iterator<Item = (String, String)>,
) {
    let _ = writeln!(c, "\nconst {kind} servotwin_twin_{name} = {{");
    let line = |(entry, comment): (String, String)| match comment.is_empty() {
        true => format!("    {entry},\n"),
        false => format!("    {entry}, /* {comment} */\n"),
    };
    let mut lines = entries.map(line).peekable();
    if lines.peek().is_none() {
        c.push_str("    0\n");
    }
    c.extend(lines);
    c.push_str("};\n");
}

fn control(c: &mut String, twin: &Twin, tableau: &Tableau) {
    let list = |numbers: &[f64]| {
        let numbers: Vec<String> = numbers.iter().map(|&number| hexadecimal(number)).collect();
        format!("{{ {} }}", numbers.join(", "))
    };
    let (is_fixed, step_s, tolerance, max_step_s, limit) = match twin.settings.control {
        Control::Fixed { step_s } => (true, step_s, 1.0, 1.0, f64::MAX),
        Control::Adaptive { tolerance, max_step_s, attempt_rate_limit_per_s } => {
            (false, 0.0, tolerance, max_step_s, attempt_rate_limit_per_s.min(f64::MAX))
        }
    };
    let growth_exponent = -1.0 / f64::from(tableau.order);
    let numbers = [step_s, tolerance, max_step_s, limit, 1.0 / tableau.gamma, growth_exponent];
    let numbers = numbers.map(hexadecimal).join(", ");
    let _ = writeln!(
        c,
        "\nconst servotwin_step_control servotwin_twin_control = {{\n    {}, {is_fixed}, {numbers},\n    {},\n    {}\n}};",
        hexadecimal(twin.period_s),
        list(tableau.alpha),
        list(tableau.gamma_sum)
    );
}

fn states(c: &mut String, program: &Program) {
    let states = program.states();
    let components = &program.network().components;
    let first_parameter = |component: usize| -> usize {
        components[..component].iter().map(|instance| instance.parameters.len()).sum()
    };
    let guesses = states.iter().map(|state| {
        let spec = components[state.component].component.spec();
        let guess = match spec.states[state.state].start {
            Start::Value(value) => format!("{{ -1, {} }}", hexadecimal(value)),
            Start::Parameter(name) => {
                let place = spec.parameter(name).unwrap_or_default();
                format!("{{ {}, 0x0p+0 }}", first_parameter(state.component) + place)
            }
        };
        (guess, described(&state.name, state.unit.symbol()))
    });
    entries(c, "servotwin_guess", "guesses[SERVOTWIN_TWIN_STATES]", guesses);
    let reciprocal = |number: f64| plain(1.0 / number);
    for (name, values) in [
        ("scales", states.iter().map(|s| reciprocal(s.scale)).collect::<Vec<_>>()),
        ("allowances", states.iter().map(|s| reciprocal(s.scale * s.error_weight)).collect()),
        ("lowest", states.iter().map(|s| plain(s.lowest.max(-f64::MAX))).collect()),
    ] {
        let name = format!("{name}[SERVOTWIN_TWIN_STATES]");
        entries(c, "double", &name, values.into_iter());
    }
}

fn inputs(c: &mut String, twin: &Twin) {
    let inputs = &twin.program.network().inputs;
    let defaults = inputs.iter().map(|input| {
        let knot = format!("{{ {}, 0x0p+0 }}", hexadecimal(input.default));
        (knot, described(&input.id, input.unit.symbol()))
    });
    entries(c, "servotwin_knot", "defaults[SERVOTWIN_TWIN_INPUTS]", defaults);
    let course = |between: &Between| match between {
        Between::Hold => "SERVOTWIN_HOLD",
        Between::Line => "SERVOTWIN_LINE",
        Between::Cubic => "SERVOTWIN_CUBIC",
    };
    let courses = twin.between.iter().map(|between| (course(between).into(), String::new()));
    entries(c, "servotwin_between", "between[SERVOTWIN_TWIN_INPUTS]", courses);
    let slopes = (0..inputs.len()).map(|input| twin.program.jacobian().slope(input).to_string());
    let slopes = slopes.map(|slope| (slope, String::new()));
    entries(c, "int32_t", "slopes[SERVOTWIN_TWIN_INPUTS]", slopes);
}
