//! Checks that need the whole system: missing and unused items, and mistakes of the compilation, reported at their
//! places in the file.

use super::mistake::SystemMistake;
use super::read::{Named, Reader};
use super::scope::{Input, Part, Scope};
use crate::document::{self, Collector, Quantities, TextSpan};
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
    for part in reader.scope.parts.iter_mut().filter(|part| part.spec().reference) {
        part.fluid = part.fluid.or(only);
        match part.fluid {
            Some(index) => reader.fluids[index].used = true,
            None if reader.fluids.len() > 1 && part.sound && once(&mut told, &part.at, 0) => {
                let known = reader.fluids.iter().map(|fluid| fluid.name.clone()).collect();
                let id = part.id.clone();
                reader.mistakes.note(&part.at, SystemMistake::WhichFluid { id, known });
            }
            None => {}
        }
    }
    let fluids: Vec<Option<Fluid>> =
        reader.fluids.iter().map(|fluid| fluid.value.clone()).collect();
    let usual = Fluid::default();
    let mut told = BTreeSet::new();
    for part in reader.scope.parts.iter().filter(|part| part.spec().reference && part.sound) {
        let fluid = part.fluid.map_or(Some(&usual), |index| fluids[index].as_ref());
        let (Some(fluid), Some(kelvin)) = (fluid, temperature_k(part)) else {
            continue;
        };
        let (min, max) = fluid.range_k();
        if !(min..=max).contains(&kelvin) && once(&mut told, &part.at, 0) {
            let (id, range_k) = (part.id.clone(), (min, max));
            let liquid = liquid(part, &reader.fluids);
            let mistake = match fluid.too_soft_pa(kelvin) {
                Some(pa) => SystemMistake::FluidTooSoft { id, kelvin, pa, range_k },
                None => SystemMistake::FluidTemperature { id, kelvin, liquid, range_k },
            };
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
    part.spec().parameter("temperature_k").map(|index| part.parameters[index])
}

/// Whether this was not reported before: instances of an assembly share its places.
fn once(told: &mut BTreeSet<(usize, usize)>, at: &TextSpan, which: usize) -> bool {
    told.insert((at.start, which))
}

fn missing_parameters(scope: &mut Scope, mistakes: &mut Collector<SystemMistake>) {
    let mut told = BTreeSet::new();
    for part in &mut scope.parts {
        for (index, declared) in part.spec().parameters.iter().enumerate() {
            if !part.parameters[index].is_nan() {
                continue;
            }
            part.parameters[index] = declared.min;
            part.sound = false;
            if once(&mut told, &part.at, index) {
                let range = Quantities(declared.min, declared.max, declared.unit.symbol());
                let mistake = document::TomlMistake::Missing {
                    place: format!("'{}' ({})", part.id, part.spec().kind),
                    key: declared.name,
                    write: format!("{} = … ({}; {range})", declared.name, declared.summary),
                };
                mistakes.note(&part.at, mistake);
            }
        }
    }
}

/// Checks that every input feeds something, and nothing that already has a source.
fn signals(scope: &Scope, mistakes: &mut Collector<SystemMistake>) {
    let mut fed: Vec<(PortOf, usize)> = Vec::new();
    for (index, input) in scope.inputs.iter().enumerate() {
        if input.targets.is_empty() && scope.complete {
            mistakes.note(&input.at, SystemMistake::InputUnused { id: input.id.clone() });
        }
        for target in &input.targets {
            default_in_range(scope, input, target.port, mistakes);
            for port in scope.joined(target.port) {
                let other = fed.iter().find(|&&(of, by)| of == port && by != index);
                if let PortKind::SignalOut { .. } = scope.port(port).kind {
                    let (input, output) = (input.id.clone(), scope.port_id(port));
                    mistakes.note(&target.at, SystemMistake::InputAndOutput { input, output });
                } else if let Some(&(_, by)) = other {
                    let first = scope.inputs[by].id.clone();
                    let second = input.id.clone();
                    mistakes.note(&target.at, SystemMistake::TwoInputs { first, second });
                }
            }
            fed.push((target.port, index));
        }
    }
}

/// Checks that an input's default is within the range of a port.
fn default_in_range(
    scope: &Scope,
    input: &Input,
    port: PortOf,
    mistakes: &mut Collector<SystemMistake>,
) {
    let spec = scope.parts[port.component].spec();
    let Some((min, max)) = spec.input_range(scope.port(port)) else { return };
    if (min..=max).contains(&input.default) || input.default.is_nan() {
        return;
    }
    let (unit, summary) = (input.unit.symbol(), scope.port(port).summary);
    let (key, value) = (format!("default of '{}'", input.id), input.default);
    let mistake = document::TomlMistake::OutOfRange { key, value, min, max, unit, summary };
    mistakes.note(&input.at, mistake);
}

fn unused(reader: &mut Reader) {
    let assemblies =
        reader.assemblies.iter().filter(|a| !a.used).map(|a| ("assembly", &a.name, &a.at));
    let fluids = reader.fluids.iter().filter(|f| !f.used).map(|f| ("fluid", &f.name, &f.at));
    for (what, name, at) in assemblies.chain(fluids) {
        reader.mistakes.note(at, SystemMistake::Unused { what, name: name.clone() });
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
        mistakes
            .note(&at, SystemMistake::OpenPort { end, family, summary: declared.summary, also });
    }
}

fn explained(
    scope: &Scope,
    fluids: &[Fluid],
    mistake: &network::Mistake,
) -> Option<(TextSpan, SystemMistake)> {
    let place = |component: usize| scope.parts[component].at.clone();
    let id = |component: usize| scope.parts[component].id.clone();
    let port_id = |port: PortOf| scope.port_id(port);
    let family = |port: PortOf| scope.port(port).kind.family();
    Some(match *mistake {
        network::Mistake::OpenPort(_) => return None,
        network::Mistake::MixedKinds { connection, first, second } => {
            let end = scope.connections[connection].iter().find(|end| end.port == second)?;
            let told = |port: PortOf| (port_id(port), family(port));
            (end.at.clone(), SystemMistake::MixedKinds { first: told(first), second: told(second) })
        }
        network::Mistake::MixedUnits { from, to } => mixed_units(scope, from, to)?,
        network::Mistake::TwoSources { first, second } => {
            let (at, family) = (scope.mention(second), family(second));
            (
                at,
                SystemMistake::TwoSources {
                    first: port_id(first),
                    second: port_id(second),
                    family,
                },
            )
        }
        network::Mistake::NoSource(port) => {
            let ends = scope.joined(port).into_iter().map(port_id).collect();
            (scope.mention(port), SystemMistake::NoSource { ends, family: family(port) })
        }
        network::Mistake::NoReference { component } => {
            (place(component), SystemMistake::NoReference { id: id(component) })
        }
        network::Mistake::TwoFluids { first, second } => {
            let parts = [first, second].map(|c| &scope.parts[c]);
            if parts.iter().any(|part| !part.sound) {
                return None;
            }
            let [first, second] = parts.map(|part| told_fluid(part, fluids));
            (parts[1].at.clone(), SystemMistake::TwoFluids { first, second })
        }
        network::Mistake::AlgebraicLoop { ref components } => {
            let ids = components.iter().map(|&c| id(c)).collect();
            (place(components[0]), SystemMistake::AlgebraicLoop { ids })
        }
        network::Mistake::Impossible { component, ref reason } => {
            if !scope.parts[component].sound {
                return None;
            }
            (
                place(component),
                SystemMistake::Impossible { id: id(component), reason: reason.clone() },
            )
        }
        network::Mistake::Empty => (0..0, SystemMistake::Empty),
        network::Mistake::TooLarge => (0..0, SystemMistake::TooLarge),
    })
}

fn mixed_units(
    scope: &Scope,
    from: Option<PortOf>,
    to: PortOf,
) -> Option<(TextSpan, SystemMistake)> {
    let unit_of = |port: PortOf| match scope.port(port).kind {
        PortKind::SignalIn { unit, .. } | PortKind::SignalOut { unit } => Some(unit),
        _ => None,
    };
    let read: (String, Unit) = (scope.port_id(to), unit_of(to)?);
    if let Some(source) = from {
        let from = (scope.port_id(source), unit_of(source)?);
        return Some((scope.mention(to), SystemMistake::MixedUnits { from, to: read }));
    }
    let node = scope.joined(to);
    let feeds = |input: &&Input| input.targets.iter().any(|target| node.contains(&target.port));
    let input = scope.inputs.iter().find(feeds)?;
    let from = (input.id.clone(), input.unit);
    Some((input.unit_at.clone(), SystemMistake::MixedUnits { from, to: read }))
}

/// Describes a source with its liquid and temperature.
fn told_fluid(part: &Part, fluids: &[Fluid]) -> String {
    let kind = part.fluid.map_or_else(|| Fluid::default().kind, |index| fluids[index].kind);
    match temperature_k(part) {
        Some(kelvin) => format!("'{}' ({} at {kelvin} K)", part.id, kind.name()),
        None => format!("'{}' ({})", part.id, kind.name()),
    }
}
