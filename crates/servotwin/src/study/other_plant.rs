//! Plants that differ from their twin in more than the tolerances: other kinds of component, and parameters far from
//! those of the twin. A diagnosis is judged on them and never learns from them.
//!
//! Every specimen draws its values anew, on top of its tolerances and of its environment. A factor is drawn evenly in its
//! logarithm, an offset evenly. A name without its actuator stands for one of every actuator, each with its own draw. A kind
//! that stands for another has its ports and the faults of the study, so a new structural difference is one line.
//!
//! Draws directly below `[flights]` have the same form, without other kinds. They belong to the realistic scenario:
//! the diagnosis learns from them.

use super::faults::full_name;
use super::keys::some;
use super::reader::{Noted, Reader};
use crate::format::{At, Names, section};
use crate::signal::random::NormalDeviates;
use crate::toml_text::{Diagnostic, NumberWithUnit};
use servotwin_model::components::{self, Component};
use servotwin_model::math::{exp, ln};
use servotwin_model::network::Instance;

section! {
    /// The section of a study file.
    pub(super) struct Text {
        may kinds: Names<At<String>>,
            "kinds that stand for others, by the component's name without its actuator";
        may pub(super) latency_s: At<[f64; 2]>, "range of a sensor's latency, at most one sample";
        may draws: Vec<At<DrawText>>, "ranges from which each specimen draws parameters";
    }
}

section! {
    /// A draw of parameters.
    pub(super) struct DrawText {
        must parameters: Vec<At<String>> = some::<Vec<At<String>>>(),
            "parameters that vary together, without the name of the actuator";
        may times: Option<At<[f64; 2]>>, "range of a factor, drawn evenly in its logarithm";
        may plus: Option<At<[f64; 2]>>, "range of an offset, in the parameter's unit";
    }
}

/// How the plants of a study differ from their twin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OtherPlant {
    /// Components of another kind.
    pub(crate) kinds: Vec<(usize, &'static str)>,
    /// The range of a sensor's latency, s.
    pub(crate) latency_s: [f64; 2],
    /// What each specimen draws.
    pub(crate) draws: Vec<PlantDraw>,
}

/// Parameters that share one draw in each specimen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlantDraw {
    /// Names as (component, parameter): a component of another kind has parameters that the twin lacks.
    pub(crate) parameters: Vec<(usize, String)>,
    /// The range of the draw.
    pub(crate) range: [f64; 2],
    /// Whether it is a factor, rather than an offset in the parameter's unit.
    pub(crate) is_factor: bool,
}

impl OtherPlant {
    pub(super) fn new(text: &Text, reader: &Reader) -> Result<Self, Noted> {
        let known = text.kinds.iter().map(|(name, kind)| kinds(reader, name, kind));
        let known = reader.sound(known);
        let period_s = 1.0 / reader.text.sample_hz;
        let At { value: [from_s, to_s], at } = text.latency_s.clone();
        let allowed =
            format!("two times from 0 s to {}, one sample", NumberWithUnit(period_s, "s"));
        let is_allowed = from_s >= 0.0 && to_s <= period_s;
        let latency = reader.range(("latency_s", &at), to_s, is_allowed, allowed);
        // Which parameters there are depends on the kinds.
        if known.len() < text.kinds.len() {
            return Err(Noted);
        }
        let kinds: Vec<_> = known.into_iter().flatten().collect();
        let draws = draws(reader, &text.draws, &kinds);
        latency?;
        Ok(Self { latency_s: [from_s, to_s], kinds, draws })
    }
}

/// The draws of a section.
pub(super) fn draws(
    reader: &Reader,
    texts: &[At<DrawText>],
    kinds: &[(usize, &'static str)],
) -> Vec<PlantDraw> {
    let draws = texts.iter().map(|draw| of_draw(reader, draw, kinds));
    reader.sound(draws).into_iter().flatten().collect()
}

/// Draws values for a specimen of a system, on top of those that its overrides already have. Offsets and the logarithms
/// of factors are `scatter` times as large as drawn.
///
/// `parts` are the components of the system.
/// An override is a component, a parameter of it, and the value in the parameter's unit.
///
/// # Panics
/// The draws were read for a system with other components.
pub(crate) fn apply_draws(
    draws: &[PlantDraw],
    scatter: f64,
    parts: &[Instance],
    random: &mut NormalDeviates,
    overrides: &mut Vec<(usize, usize, f64)>,
) {
    for draw in draws {
        let ([low, high], share) = (draw.range, random.unit());
        let drawn = match draw.is_factor {
            true => exp(scatter * (ln(low) + (ln(high) - ln(low)) * share)),
            false => scatter * (low + (high - low) * share),
        };
        for (place, name) in &draw.parameters {
            let part = &parts[*place];
            let parameter = part.component.parameter(name).expect("the study checked it");
            let is_same = |other: &&(usize, usize, f64)| (other.0, other.1) == (*place, parameter);
            let before = overrides.iter().rfind(is_same).map(|found| found.2);
            let before = before.unwrap_or(part.parameters[parameter]);
            let after = if draw.is_factor { before * drawn } else { before + drawn };
            let (min, max) = part.range(parameter);
            overrides.push((*place, parameter, after.clamp(min, max)));
        }
    }
}

/// The components that a name stands for: one of every actuator, or one that all share.
fn named(reader: &Reader, name: &str) -> Vec<usize> {
    let parts = &reader.system.network().components;
    let find = |id: &str| parts.iter().position(|instance| instance.id == id);
    let of_actuators =
        reader.text.actuators.iter().filter_map(|actuator| find(&full_name(actuator, name)));
    let of_actuators: Vec<usize> = of_actuators.collect();
    if of_actuators.is_empty() { find(name).into_iter().collect() } else { of_actuators }
}

/// Components with the kind that stands for theirs.
fn kinds(
    reader: &Reader,
    name: &At<String>,
    kind: &At<String>,
) -> Result<Vec<(usize, &'static str)>, Noted> {
    let found = named(reader, name);
    if found.is_empty() {
        let all = reader.system.network().components.iter().map(|part| part.id.as_str());
        return Err(reader.unknown(&name.at, ("component in the system", name), all));
    }
    let component = components::find(kind).ok_or_else(|| {
        let all = components::ALL.iter().map(|component| component.kind);
        reader.unknown(&kind.at, ("kind of component", kind), all)
    })?;
    let own = reader.system.network().components[found[0]].component;
    let Some((what, missing)) = lacking(own, component) else {
        return Ok(found.into_iter().map(|place| (place, component.kind)).collect());
    };
    let own = own.kind;
    let message = format!("'{}' cannot stand for '{own}': it has no {what} '{missing}'", **kind);
    Err(reader.note(&kind.at, Diagnostic::new(message)))
}

/// The first port or fault of a component that another lacks.
fn lacking(own: &Component, other: &Component) -> Option<(&'static str, &'static str)> {
    let same_port = |name: &str| other.port(name).map(|port| other.ports[port].kind.family());
    let port = own.ports.iter().find(|port| same_port(port.name) != Some(port.kind.family()));
    let fault = own.faults.iter().find(|fault| other.fault(fault.name).is_none());
    let port = port.map(|port| ("port", port.name));
    port.or(fault.map(|fault| ("fault", fault.name)))
}

/// A draw of each actuator, or one draw of what all share.
fn of_draw(
    reader: &Reader,
    At { value: text, at }: &At<DrawText>,
    kinds: &[(usize, &'static str)],
) -> Result<Vec<PlantDraw>, Noted> {
    let (range, is_factor) = match (&text.times, &text.plus) {
        (Some(range), None) => (range, true),
        (None, Some(range)) => (range, false),
        _ => {
            let help = "times = [0.9, 1.1] is a range of factors, plus = [-10, 10] of offsets";
            let mistake = Diagnostic::new("a draw has either 'times' or 'plus'");
            return Err(reader.note(at, mistake.with_help(help)));
        }
    };
    let At { value: range, at } = range.clone();
    let is_allowed = !is_factor || range[0] > 0.0;
    reader.range(("times", &at), range[0], is_allowed, "two factors above 0, in order")?;
    let mut draws: Vec<PlantDraw> = vec![];
    for name in &text.parameters {
        for (actuator, parameter) in parameters(reader, name, kinds)?.into_iter().enumerate() {
            match draws.get_mut(actuator) {
                Some(draw) => draw.parameters.push(parameter),
                None => draws.push(PlantDraw { parameters: vec![parameter], range, is_factor }),
            }
        }
    }
    Ok(draws)
}

/// The parameters that a name stands for, in plants of the given kinds.
fn parameters(
    reader: &Reader,
    name: &At<String>,
    kinds: &[(usize, &'static str)],
) -> Result<Vec<(usize, String)>, Noted> {
    let (part, parameter) = name.rsplit_once('.').unwrap_or((name, ""));
    let spec = |place: usize| {
        let other = kinds.iter().find(|(swapped, _)| *swapped == place);
        let own = reader.system.network().components[place].component;
        other.and_then(|(_, kind)| components::find(kind)).unwrap_or(own)
    };
    let found = named(reader, part);
    let has = |place: &usize| spec(*place).parameter(parameter).is_some();
    if found.is_empty() || !found.iter().all(has) {
        let of_part: Vec<String> = match found.first() {
            Some(&place) => {
                let all = spec(place).parameters.iter();
                all.map(|parameter| format!("{part}.{}", parameter.name)).collect()
            }
            None => reader.system.all_parameters(),
        };
        let known = of_part.iter().map(String::as_str);
        let what = ("parameter in these plants", name.as_str());
        return Err(reader.unknown(&name.at, what, known));
    }
    Ok(found.into_iter().map(|place| (place, parameter.to_owned())).collect())
}
