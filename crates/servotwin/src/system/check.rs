//! Checks that need the whole system: missing and unused items, and mistakes of the compilation, reported at their
//! places in the file.

use super::read::{Named, Reader};
use super::scope::{Input, ONE_SOURCE, Part, Scope};
use crate::toml_text::{Collector, Diagnostic, NumberWithUnit, Quantities, TextSpan};
use servotwin_model::fluid::own::LEAST_BULK_MODULUS_PA;
use servotwin_model::fluid::{Fluid, FluidKind};
use servotwin_model::network::{self, PortOf};
use servotwin_model::program::Program;
use servotwin_model::spec::{PortKind, Unit};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

/// Compiles the system that was read.
pub(super) fn compile(reader: &mut Reader) -> Option<Program> {
    let fluids = choose_fluids(reader);
    missing_parameters(&mut reader.scope, &mut reader.mistakes);
    signals(&reader.scope, &mut reader.mistakes);
    let mut program = None;
    // If a component or connection is missing, everything next to it would seem open.
    if reader.scope.complete {
        match reader.scope.network(&fluids).compile() {
            Ok(compiled) => program = Some(compiled),
            Err(mistakes) => explain(reader, &fluids, &mistakes),
        }
    }
    if reader.mistakes.is_empty() {
        unused(reader);
    }
    program.filter(|_| reader.mistakes.is_empty())
}

/// Assigns a fluid to every source, and lists the fluids.
fn choose_fluids(reader: &mut Reader) -> Vec<Fluid> {
    let only = (reader.fluids.len() == 1).then_some(0);
    let mut told = BTreeSet::new();
    for part in reader.scope.parts.iter_mut().filter(|part| part.component.reference) {
        part.fluid = part.fluid.or(only);
        match part.fluid {
            Some(index) => reader.fluids[index].used = true,
            None if reader.fluids.len() > 1 && part.sound && once(&mut told, &part.at, 0) => {
                let known: Vec<&str> = reader.fluids.iter().map(|f| f.name.as_str()).collect();
                let message = format!("several fluids are declared, but '{}' names none", part.id);
                let help = format!("add: fluid = \"…\"; known: {}", known.join(", "));
                reader.mistakes.note(&part.at, Diagnostic::new(message).with_help(help));
            }
            None => {}
        }
    }
    let fluids: Vec<Option<Fluid>> =
        reader.fluids.iter().map(|fluid| fluid.value.clone()).collect();
    let usual = Fluid::default();
    let mut told = BTreeSet::new();
    for part in reader.scope.parts.iter().filter(|part| part.component.reference && part.sound) {
        let fluid = part.fluid.map_or(Some(&usual), |index| fluids[index].as_ref());
        let (Some(fluid), Some(kelvin)) = (fluid, temperature_k(part)) else {
            continue;
        };
        let (min, max) = fluid.range_k();
        if !(min..=max).contains(&kelvin) && once(&mut told, &part.at, 0) {
            let mistake = match fluid.too_soft_pa(kelvin) {
                Some(pa) => {
                    let [pa, least] =
                        [pa, LEAST_BULK_MODULUS_PA].map(|pa| NumberWithUnit(pa, "Pa").to_string());
                    Diagnostic::new(format!(
                        "'{}' is at {kelvin} K, where the bulk modulus of its liquid would be {pa}: allowed are {min} \
                         … {max} K",
                        part.id
                    ))
                    .with_help(format!(
                        "by its bulk_modulus_pa at 40 °C and bulk_modulus_change; at least {least}"
                    ))
                }
                None => Diagnostic::new(format!(
                    "'{}' is at {kelvin} K, but the liquid '{}' is only known for {min} … {max} K",
                    part.id,
                    liquid(part, &reader.fluids)
                )),
            };
            let mistake = Diagnostic { range: Some((min, max)), ..mistake };
            reader.mistakes.note(&part.at, mistake);
        }
    }
    fluids.into_iter().map(Option::unwrap_or_default).collect()
}

/// The name of a source's liquid; the file's name for liquids defined by numbers or by a table.
fn liquid(part: &Part, fluids: &[Named<Option<Fluid>>]) -> String {
    let declared = part.fluid.map(|index| &fluids[index]);
    let kind = declared.and_then(|declared| declared.value.as_ref()).map(|fluid| fluid.kind);
    match (kind.unwrap_or(Fluid::default().kind), declared) {
        (FluidKind::Own | FluidKind::Table, Some(declared)) => declared.name.clone(),
        (kind, _) => kind.name().into(),
    }
}

fn temperature_k(part: &Part) -> Option<f64> {
    part.component.parameter("temperature_k").map(|index| part.parameters[index])
}

/// Whether this was not reported before: instances of an assembly share its places.
fn once(told: &mut BTreeSet<(usize, usize)>, at: &TextSpan, which: usize) -> bool {
    told.insert((at.start, which))
}

fn missing_parameters(scope: &mut Scope, mistakes: &mut Collector) {
    let mut told = BTreeSet::new();
    for part in &mut scope.parts {
        for (index, declared) in part.component.parameters.iter().enumerate() {
            if !part.parameters[index].is_nan() {
                continue;
            }
            part.parameters[index] = declared.min;
            part.sound = false;
            if once(&mut told, &part.at, index) {
                let range = Quantities(declared.min, declared.max, declared.unit.symbol());
                let place = format!("'{}' ({})", part.id, part.component.kind);
                let write = format!("{} = … ({}; {range})", declared.name, declared.summary);
                let mistake = Diagnostic::missing(&place, declared.name, write);
                mistakes.note(&part.at, mistake);
            }
        }
    }
}

/// Checks that every input feeds something, and nothing that already has a source.
fn signals(scope: &Scope, mistakes: &mut Collector) {
    let mut fed: Vec<(PortOf, usize)> = Vec::new();
    for (index, input) in scope.inputs.iter().enumerate() {
        if input.targets.is_empty() && scope.complete {
            let mistake = Diagnostic::new(format!("the input '{}' feeds nothing", input.id));
            let help = "list what it feeds, for example: to = [\"supply.pressure\"]";
            mistakes.note(&input.at, mistake.with_help(help));
        }
        for target in &input.targets {
            default_in_range(scope, input, target.port, mistakes);
            for port in scope.joined(target.port) {
                let other = fed.iter().find(|&&(of, by)| of == port && by != index);
                if let PortKind::SignalOut { .. } = scope.port(port).kind {
                    let mistake = scope.input_and_output(index, &scope.port_id(port));
                    mistakes.note(&target.at, mistake);
                } else if let Some(&(_, by)) = other {
                    mistakes.note(&target.at, scope.two_inputs(by, index));
                }
            }
            fed.push((target.port, index));
        }
    }
}

/// Checks that an input's default is within the range of a port.
fn default_in_range(scope: &Scope, input: &Input, port: PortOf, mistakes: &mut Collector) {
    let spec = scope.parts[port.component].component;
    let Some((min, max)) = spec.input_range(scope.port(port)) else { return };
    if (min..=max).contains(&input.default) || input.default.is_nan() {
        return;
    }
    let (unit, summary) = (input.unit.symbol(), scope.port(port).summary);
    let key = format!("default of '{}'", input.id);
    let mistake = Diagnostic::out_of_range(&key, input.default, (min, max), unit, summary);
    mistakes.note(&input.at, mistake);
}

fn unused(reader: &mut Reader) {
    let assemblies =
        reader.assemblies.iter().filter(|a| !a.used).map(|a| ("assembly", &a.name, &a.at));
    let fluids = reader.fluids.iter().filter(|f| !f.used).map(|f| ("fluid", &f.name, &f.at));
    for (what, name, at) in assemblies.chain(fluids) {
        let mistake = Diagnostic::new(format!("the {what} '{name}' is never used"));
        reader.mistakes.note(at, mistake.with_help(format!("remove the {what} or use it")));
    }
}

/// Reports the mistakes of a network at their places in the file.
fn explain(reader: &mut Reader, fluids: &[Fluid], found: &[network::Mistake]) {
    let Reader { scope, mistakes, .. } = reader;
    let key = |port: &PortOf| (port.component, port.port);
    let joined: BTreeSet<_> =
        scope.connections.iter().flatten().map(|end| key(&end.port)).collect();
    let mut open: Vec<(TextSpan, PortOf, Vec<String>)> = Vec::new();
    let mut places: BTreeMap<(usize, usize, usize), usize> = BTreeMap::new();
    for mistake in found {
        if let network::Mistake::OpenPort(port) = mistake {
            // A port that is joined to a port of another kind is reported as that mistake.
            if joined.contains(&key(port)) {
                continue;
            }
            let at = scope.parts[port.component].at.clone();
            // The same port of another instance of the assembly.
            match places.entry((at.start, at.end, port.port)) {
                Entry::Occupied(place) => open[*place.get()].2.push(scope.port_id(*port)),
                Entry::Vacant(place) => {
                    place.insert(open.len());
                    open.push((at, *port, Vec::new()));
                }
            }
        } else if let Some((at, mistake)) = explained(scope, fluids, mistake) {
            mistakes.note(&at, mistake);
        }
    }
    for (at, port, also) in open {
        let declared = scope.port(port);
        let (end, family) = (scope.port_id(port), declared.kind.family());
        let also = match also.is_empty() {
            true => String::new(),
            false => format!("; the same holds for {}", also.join(", ")),
        };
        let mistake = Diagnostic::new(format!("the {family} port '{end}' is connected to nothing"));
        let help = format!("the port is: {}{also}", declared.summary);
        mistakes.note(&at, mistake.with_help(help));
    }
}

fn explained(
    scope: &Scope,
    fluids: &[Fluid],
    mistake: &network::Mistake,
) -> Option<(TextSpan, Diagnostic)> {
    let place = |component: usize| scope.parts[component].at.clone();
    let id = |component: usize| &scope.parts[component].id;
    let port_id = |port: PortOf| scope.port_id(port);
    let family = |port: PortOf| scope.port(port).kind.family();
    let (at, message, help) = match *mistake {
        network::Mistake::OpenPort(_) => return None,
        network::Mistake::MixedKinds { connection, first, second } => {
            let end = scope.connections[connection].iter().find(|end| end.port == second)?;
            let [first, second] =
                [first, second].map(|port| format!("'{}' is {}", port_id(port), family(port)));
            let help = "a connection joins ports of one kind";
            (end.at.clone(), format!("{first}, but {second}"), help)
        }
        network::Mistake::MixedUnits { from, to } => return mixed_units(scope, from, to),
        network::Mistake::TwoSources { first, second } => {
            let (verb, help, _) = setting(family(second));
            let [one, other] = [first, second].map(port_id);
            let message = format!("both '{one}' and '{other}' {}", verb.replacen("s ", " ", 1));
            (scope.mention(second), message, help)
        }
        network::Mistake::NoSource(port) => {
            let (verb, _, help) = setting(family(port));
            let ends = quote_all(scope.joined(port).into_iter().map(port_id));
            (scope.mention(port), format!("nothing {verb} where {ends} meet"), help)
        }
        network::Mistake::NoReference { component } => {
            let id = id(component);
            let message =
                format!("the hydraulic circuit of '{id}' has neither a source nor a tank");
            (place(component), message, "connect a pressure_source or a tank")
        }
        network::Mistake::TwoFluids { first, second } => {
            let parts = [first, second].map(|c| &scope.parts[c]);
            if parts.iter().any(|part| !part.sound) {
                return None;
            }
            let [one, other] = parts.map(|part| told_fluid(part, fluids));
            let help = "fluid and temperature are the same throughout a circuit";
            (place(second), format!("{other} is in one circuit with {one}"), help)
        }
        network::Mistake::AlgebraicLoop { ref components } => {
            let ids = quote_all(components.iter().map(|&component| id(component).clone()));
            let help =
                "break the loop with a component that has a state, such as a low_pass_filter";
            let message = format!("the signals of {ids} depend on each other at once");
            (place(components[0]), message, help)
        }
        network::Mistake::Impossible { component, ref reason } => {
            let mistake = Diagnostic::new(format!("'{}' is impossible: {reason}", id(component)));
            return scope.parts[component].sound.then(|| (place(component), mistake));
        }
        network::Mistake::Empty => (
            0..0,
            "the system has nothing that moves: no state variable".into(),
            "add a component that stores something, such as a volume",
        ),
        network::Mistake::TooLarge => {
            return Some((0..0, Diagnostic::new("the system is too large for one program")));
        }
    };
    Some((at, Diagnostic::new(message).with_help(help)))
}

/// What one component does with a node of this family; help against two of them, and against none.
fn setting(family: &str) -> (&'static str, &'static str, &'static str) {
    let motion = "join them with a mass, a cylinder rod or an inertia";
    match family {
        "hydraulic" => (
            "sets the pressure",
            "put a valve, an orifice or a line between them",
            "join them with a volume, a cylinder chamber, a source or a tank",
        ),
        "signal" => (
            "gives the signal",
            ONE_SOURCE,
            "join them with an output of a component or an input of the system",
        ),
        "translational" => (
            "sets the motion",
            "put an attachment between them (port a to the one, b to the other), or make them one mass",
            motion,
        ),
        _ => (
            "sets the motion",
            "make them one inertia, or let a rod with an attachment and a lever move one of them",
            motion,
        ),
    }
}

fn quote_all(names: impl Iterator<Item = String>) -> String {
    let quoted: Vec<String> = names.map(|name| format!("'{name}'")).collect();
    match quoted.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => quoted.concat(),
    }
}

fn mixed_units(scope: &Scope, from: Option<PortOf>, to: PortOf) -> Option<(TextSpan, Diagnostic)> {
    let unit_of = |port: PortOf| match scope.port(port).kind {
        PortKind::SignalIn { unit, .. } | PortKind::SignalOut { unit } => Some(unit),
        _ => None,
    };
    let (at, id, unit) = match from {
        Some(source) => (scope.mention(to), scope.port_id(source), unit_of(source)?),
        None => {
            let node = scope.joined(to);
            let feeds =
                |input: &&Input| input.targets.iter().any(|target| node.contains(&target.port));
            let input = scope.inputs.iter().find(feeds)?;
            (input.unit_at.clone(), input.id.clone(), input.unit)
        }
    };
    let words = |unit: Unit| if unit == Unit::None { "pure numbers" } else { unit.symbol() };
    let (reader, read) = (scope.port_id(to), words(unit_of(to)?));
    let message = format!("'{id}' is in {}, but '{reader}' reads {read}", words(unit));
    Some((at, Diagnostic::new(message)))
}

/// Describes a source with its liquid and temperature.
fn told_fluid(part: &Part, fluids: &[Fluid]) -> String {
    let kind = part.fluid.map_or_else(|| Fluid::default().kind, |index| fluids[index].kind);
    match temperature_k(part) {
        Some(kelvin) => format!("'{}' ({} at {kelvin} K)", part.id, kind.name()),
        None => format!("'{}' ({})", part.id, kind.name()),
    }
}
