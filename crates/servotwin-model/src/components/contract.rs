//! Promises that every component keeps, checked over [`ALL`].
//!
//! Each component is wired alone, once with every port connected, once with
//! the optional ones open, and once with only the last of these open. The wiring shows what each input of a
//! block is (a pressure, a position, …), and therefore the range of its test values.

use super::{ALL, BlockKind, Component, Visitor, description};
use crate::dual::{Dual, Partial};
use crate::equation::{Equation, Given};
use crate::fluid::Fluid;
use crate::lanes::{self, Kernel, dispatch};
use crate::network::PortOf;
use crate::scalar::Lanes;
use crate::spec::{PortKind, Start, Unit};
use crate::wiring::{Block, Collected, Node, Role, Sum, Variable, Wiring};
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

const TEMPERATURE_K: f64 = 313.15;
const SAMPLES: usize = 64;

/// Uniform numbers in 0 … 1 from a seed (xorshift64*).
pub(crate) struct UniformNumbers(pub u64);

impl UniformNumbers {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// The declared parameters; a parameter without a default gets a value within its range.
pub(crate) fn parameters(spec: &Component) -> Vec<f64> {
    let values = spec.parameters.iter().map(|p| match p.default {
        Some(value) => value,
        None if p.min > 0.0 => libm::sqrt(p.min * p.max),
        None => p.max * 1e-3,
    });
    values.collect()
}

/// The constants of a component's block with its default parameters and the given changes.
pub(crate) fn constants<E, const I: usize, const O: usize, const C: usize>(
    _: E,
    component: &Component,
    changes: &[(&str, f64)],
    which: usize,
) -> [f64; C]
where
    E: Equation<I, O, C>,
{
    let mut parameters = parameters(component);
    for &(name, value) in changes {
        parameters[component.parameter(name).expect("a declared parameter")] = value;
    }
    E::constants(&Given {
        parameters: &parameters,
        fluid: &Fluid::default().at(TEMPERATURE_K),
        which,
    })
}

/// The optional ports that stay open.
#[derive(Clone, Copy)]
enum Open {
    None,
    /// The last signal without a default parameter.
    Last,
    All,
}

/// A component wired without neighbors.
struct Alone {
    spec: &'static Component,
    parameters: Vec<f64>,
    collected: Collected,
    states: Vec<(Variable, Sum)>,
    nodes: Vec<Option<Node>>,
}

impl Alone {
    fn new(spec: &'static Component, open: Open) -> Self {
        let parameters = parameters(spec);
        let mut collected = Collected::default();
        let state = |state| {
            let variable = collected.variable(Role::State { component: 0, state });
            let rate = collected.variable(Role::Derivative { component: 0, state });
            (variable, Sum(rate.0))
        };
        let states: Vec<_> = (0..spec.states.len()).map(state).collect();
        let may_be_open = |port: &crate::spec::Port| port.optional && !port.kind.sets();
        let last = spec.ports.iter().rposition(|port| {
            may_be_open(port) && matches!(port.kind, PortKind::SignalIn { default: None, .. })
        });
        let node = |(place, port): (usize, &crate::spec::Port)| {
            let connected = !match open {
                Open::None => false,
                Open::Last => last == Some(place),
                Open::All => may_be_open(port),
            };
            connected.then(|| Node {
                first: collected.variable(Role::Unset),
                second: collected.variable(Role::Unset),
                sum: Sum(collected.variable(Role::Sum).0),
            })
        };
        let nodes: Vec<_> = spec.ports.iter().enumerate().map(node).collect();
        (spec.connect)(&mut Wiring {
            collected: &mut collected,
            component: 0,
            kind: spec.kind,
            ports: spec.ports,
            nodes: &nodes,
            states: (spec.states, &states),
            parameters: (spec.parameters, &parameters),
        });
        let ports = nodes
            .iter()
            .enumerate()
            .filter_map(|(port, &node)| node.map(|node| (PortOf { component: 0, port }, node)));
        collected.nodes = ports.collect();
        Self { spec, parameters, collected, states, nodes }
    }

    /// The range of test values of a block's input.
    fn range(&self, variable: Variable) -> (f64, f64) {
        let variable = self.collected.resolve(variable);
        match self.collected.roles[variable.0 as usize] {
            Role::State { state, .. } => {
                let declared = &self.spec.states[state];
                usual(declared.unit).unwrap_or((-declared.scale, declared.scale))
            }
            Role::Parameter { parameter, .. } => {
                let value = self.parameters[parameter];
                (value, value)
            }
            Role::Temperature { .. } => (250.0, 380.0),
            _ => self.port_range(variable).unwrap_or((-1.0, 1.0)),
        }
    }

    fn port_range(&self, variable: Variable) -> Option<(f64, f64)> {
        let (port, node) =
            self.collected.nodes.iter().find(|(_, node)| {
                [node.first, node.second, node.sum.variable()].contains(&variable)
            })?;
        let kind = self.spec.ports[port.port].kind;
        let size = if variable == node.first {
            match kind {
                PortKind::Hydraulic { .. } => return usual(Unit::Pascal),
                PortKind::Translational { .. } => 1e-2,
                PortKind::Rotational { .. } => 0.4,
                PortKind::SignalIn { unit, default } => return Some(self.signal(unit, default)),
                PortKind::SignalOut { .. } => 1.0,
            }
        } else if variable == node.second {
            if matches!(kind, PortKind::Rotational { .. }) { 1.0 } else { 0.05 }
        } else {
            match kind {
                PortKind::Hydraulic { .. } => 3e-4,
                PortKind::Translational { .. } => 3e4,
                _ => 1e3,
            }
        };
        Some((-size, size))
    }

    /// A range around the default parameter, or else by unit.
    fn signal(&self, unit: Unit, default: Option<&str>) -> (f64, f64) {
        let value = default.map_or(0.0, |name| self.parameters[self.spec.parameter(name).unwrap()]);
        let by_unit = match unit {
            Unit::Metre => 1e-2,
            Unit::Radian => 0.4,
            Unit::MetrePerSecond => 0.05,
            _ => 1.0,
        };
        if value == 0.0 {
            usual(unit).unwrap_or((-by_unit, by_unit))
        } else {
            (0.5 * value, 1.5 * value)
        }
    }

    fn ranges(&self, block: &Block) -> Vec<(f64, f64)> {
        block.inputs.iter().map(|&v| self.range(v)).collect()
    }

    /// Pseudo-random inputs of a block.
    fn samples(&self, block: &Block) -> Vec<Vec<f64>> {
        let mut random = UniformNumbers(0x9e37_79b9_7f4a_7c15);
        let ranges = self.ranges(block);
        let sample = |_| {
            let values = ranges.iter().map(|(low, high)| low + (high - low) * random.next());
            values.collect()
        };
        (0..SAMPLES).map(sample).collect()
    }

    fn name(&self, block: &Block) -> String {
        format!("{} {:?} {}", self.spec.kind, block.equation(), block.which)
    }
}

/// The usual range of quantities that are never negative.
fn usual(unit: Unit) -> Option<(f64, f64)> {
    match unit {
        Unit::Pascal => Some((1e5, 2.2e7)),
        Unit::Kelvin => Some((250.0, 380.0)),
        _ => None,
    }
}

/// Every component, wired in every way.
fn all() -> impl Iterator<Item = Alone> {
    let ways = [Open::None, Open::Last, Open::All];
    ALL.iter().flat_map(move |&component| ways.map(|open| Alone::new(component, open)))
}

/// Every block of every component, wired in every way.
fn for_each_block(mut f: impl FnMut(&Alone, &Block)) {
    for alone in all() {
        for block in &alone.collected.blocks {
            f(&alone, block);
        }
    }
}

/// One block to evaluate for several inputs.
#[derive(Clone, Copy)]
struct OneBlock<'a> {
    kind: BlockKind,
    which: usize,
    parameters: &'a [f64],
    samples: &'a [Vec<f64>],
}

/// The constants, and the outputs for each sample.
type Results = (Vec<f64>, Vec<Vec<f64>>);

impl Kernel for OneBlock<'_> {
    type Output = Results;
    fn run<V: Lanes>(self) -> Results {
        let parameters: Vec<V> = self.parameters.iter().map(|&p| V::constant(p)).collect();
        self.kind.visit(InLanes { block: self, parameters })
    }
}

struct InLanes<'a, V> {
    block: OneBlock<'a>,
    parameters: Vec<V>,
}

impl<V: Lanes> Visitor for InLanes<'_, V> {
    type Output = Results;
    fn visit<E, const I: usize, const O: usize, const C: usize>(self) -> Results
    where
        E: Equation<I, O, C>,
    {
        let constants = E::constants(&Given {
            parameters: &self.parameters,
            fluid: &Fluid::default().at(V::constant(TEMPERATURE_K)),
            which: self.block.which,
        });
        let mut outputs = Vec::new();
        for chunk in self.block.samples.chunks(V::WIDTH) {
            let last = chunk.len() - 1;
            let inputs = core::array::from_fn(|i| V::from_fn(|lane| chunk[lane.min(last)][i]));
            let results: [V; O] = E::evaluate(&constants, inputs);
            let lanes = (0..chunk.len()).map(|lane| results.map(|r| r.lane(lane)).to_vec());
            outputs.extend(lanes);
        }
        (constants.map(|c| c.lane(V::WIDTH - 1)).to_vec(), outputs)
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn names_are_unique() {
    let unique = |kind: &str, names: &mut dyn Iterator<Item = &'static str>| {
        let mut seen = BTreeSet::new();
        for name in names {
            assert!(seen.insert(name), "{kind}: '{name}' twice");
        }
    };
    unique("kinds", &mut ALL.iter().map(|c| c.kind));
    for &spec in ALL {
        unique(spec.kind, &mut spec.parameters.iter().map(|p| p.name));
        unique(spec.kind, &mut spec.faults.iter().map(|f| f.name));
        unique(spec.kind, &mut spec.ports.iter().map(|p| p.name));
        unique(spec.kind, &mut spec.states.iter().map(|s| s.name));
    }
}

#[test]
fn declarations_hold_together() {
    for &spec in ALL {
        let kind = spec.kind;
        assert!(!spec.summary.is_empty(), "{kind}");
        let text = description(kind).expect("a component of the list");
        assert!(text.contains("```text") && !text.contains("//!"), "{kind} has no equations");
        let last = text.rsplit("\n\n").next().expect("a paragraph");
        assert!(last.starts_with("Source: "), "{kind} does not say where its equations come from");
        for p in spec.parameters {
            assert!(p.min < p.max && !p.summary.is_empty(), "{kind}.{}", p.name);
            let fits = |value: f64| p.min <= value && value <= p.max;
            assert!(p.default.is_none_or(fits), "default of {kind}.{}", p.name);
        }
        for port in spec.ports {
            assert!(!port.summary.is_empty(), "{kind}.{}", port.name);
            if let PortKind::SignalIn { unit, default: Some(name) } = port.kind {
                let found = spec.parameter(name);
                let index = found.unwrap_or_else(|| panic!("{kind}.{}: '{name}'", port.name));
                assert_eq!(spec.parameters[index].unit, unit, "{kind}.{}", port.name);
            }
        }
        for state in spec.states {
            assert!(state.scale > 0.0 && !state.summary.is_empty(), "{kind}.{}", state.name);
            if let Start::Parameter(name) = state.start {
                let found = spec.parameter(name);
                let index = found.unwrap_or_else(|| panic!("{kind}.{}: '{name}'", state.name));
                assert_eq!(spec.parameters[index].unit, state.unit, "{kind}.{}", state.name);
            }
        }
        assert_eq!((spec.check)(&parameters(spec)), Ok(()), "{kind}");
    }
}

#[test]
fn a_fault_is_neutral_at_zero_and_acts_at_one() {
    for alone in all() {
        let spec = alone.spec;
        for fault in spec.faults {
            let name = format!("{}.{}", spec.kind, fault.name);
            assert!(!fault.summary.is_empty(), "{name}");
            assert!(fault.full_min < fault.full_max, "{name}");
            assert!(fault.full_min <= fault.full && fault.full <= fault.full_max, "{name}");
            let index = spec.parameter(fault.parameter).unwrap_or_else(|| panic!("{name}"));
            let healthy = alone.parameters[index];
            for full in [fault.full, fault.full_max] {
                let neutral = fault.law.apply(healthy, 0.0, full);
                assert_eq!(neutral.to_bits(), healthy.to_bits(), "{name}");
            }
            let faulty = fault.law.apply(healthy, 1.0, fault.full);
            assert!(faulty.is_finite() && faulty != healthy, "{name}: {healthy} stays");
            assert!(
                alone.depends_on(index, faulty),
                "{name}: no equation reads {}",
                fault.parameter
            );
        }
    }
}

impl Alone {
    /// Whether another value of a parameter changes the constants of a block or
    /// a signal that the parameter replaces.
    fn depends_on(&self, parameter: usize, value: f64) -> bool {
        let mut changed = self.parameters.clone();
        changed[parameter] = value;
        let stands_in = self
            .collected
            .roles
            .iter()
            .any(|r| matches!(r, Role::Parameter { parameter: p, .. } if *p == parameter));
        stands_in
            || self.collected.blocks.iter().any(|block| {
                let constants = |parameters: &[f64]| {
                    let (kind, which) = (block.equation(), block.which);
                    OneBlock { kind, which, parameters, samples: &[] }.run::<f64>().0
                };
                bits(&constants(&self.parameters)) != bits(&constants(&changed))
            })
    }
}

#[test]
fn every_state_moves_and_every_set_port_is_set() {
    for alone in all() {
        let mut written: BTreeSet<u32> = BTreeSet::new();
        for block in &alone.collected.blocks {
            let ends = block.outputs.iter().flat_map(|o| [o.add, o.subtract]);
            written.extend(ends.flatten().map(|s| s.0));
        }
        for (state, (_, rate)) in alone.spec.states.iter().zip(&alone.states) {
            let name = format!("{}.{}", alone.spec.kind, state.name);
            assert!(written.contains(&rate.0), "{name} has no derivative");
        }
        for (port, node) in alone.spec.ports.iter().zip(&alone.nodes) {
            if let (true, Some(node)) = (port.kind.sets(), node) {
                let name = format!("{}.{}", alone.spec.kind, port.name);
                let role = alone.collected.roles[node.first.0 as usize];
                assert!(role != Role::Unset, "{name} is not set");
            }
        }
    }
}

#[test]
fn every_sensor_says_what_its_readings_span_and_nobody_else_does() {
    for alone in all() {
        let is_sensor = alone.spec.parameter("noise_sigma").is_some();
        let component = super::find(alone.spec.kind).expect("of the catalogue");
        let span = (component.span)(&alone.parameters);
        assert_eq!(span.is_some(), is_sensor, "{}", alone.spec.kind);
        let sound = |s: super::MeasuringSpan| s.full_scale > 0.0 && s.range >= s.full_scale;
        assert!(span.is_none_or(sound), "{}", alone.spec.kind);
    }
}

#[test]
fn lanes_equal_scalars_bit_for_bit() {
    for_each_block(|alone, block| {
        let samples = alone.samples(block);
        let (kind, which) = (block.equation(), block.which);
        let one = OneBlock { kind, which, parameters: &alone.parameters, samples: &samples };
        let (constants, outputs) = one.run::<f64>();
        for level in lanes::ALL.into_iter().filter(|level| level.available()) {
            let (lane_constants, lane_outputs) = dispatch(level, one);
            let name = alone.name(block);
            assert_eq!(bits(&constants), bits(&lane_constants), "{name} {level:?}");
            for (scalar, lanes) in outputs.iter().zip(&lane_outputs) {
                assert_eq!(bits(scalar), bits(lanes), "{name} {level:?}");
            }
        }
    });
}

/// Values and partial derivatives of one block, `[output][input]`.
struct WithPartials<'a> {
    block: OneBlock<'a>,
}

impl Visitor for WithPartials<'_> {
    type Output = Vec<(f64, Vec<f64>)>;
    fn visit<E, const I: usize, const O: usize, const C: usize>(self) -> Self::Output
    where
        E: Equation<I, O, C>,
    {
        let constants = E::constants(&Given {
            parameters: self.block.parameters,
            fluid: &Fluid::default().at(TEMPERATURE_K),
            which: self.block.which,
        });
        let inputs = core::array::from_fn(|i| Dual::input(self.block.samples[0][i], i));
        let outputs: [Dual<f64, I>; O] = E::evaluate(&constants, inputs);
        outputs.iter().map(|o| (o.value, o.partials.map(Partial::number).to_vec())).collect()
    }
}

/// The central difference by Richardson's extrapolation; `None` at a kink.
fn difference(f: &dyn Fn(f64) -> f64, x: f64, h: f64, noise: f64) -> Option<f64> {
    let (ahead, behind) = ((f(x + h) - f(x)) / h, (f(x) - f(x - h)) / h);
    let size = ahead.abs() + behind.abs();
    if (ahead - behind).abs() > 1e-3 * size + noise {
        return None;
    }
    let half = (f(x + 0.5 * h) - f(x - 0.5 * h)) / h;
    Some((4.0 * half - 0.5 * (ahead + behind)) / 3.0)
}

#[test]
fn partial_derivatives_agree_with_differences() {
    let mut tried: BTreeMap<BlockKind, (usize, usize)> = BTreeMap::new();
    for_each_block(|alone, block| {
        let name = alone.name(block);
        let samples = alone.samples(block);
        let ranges = alone.ranges(block);
        let (kind, which) = (block.equation(), block.which);
        let parameters: &[f64] = &alone.parameters;
        let values =
            |samples: &[Vec<f64>]| OneBlock { kind, which, parameters, samples }.run::<f64>().1;
        let all = values(&samples);
        let largest = |o: usize| all.iter().fold(0.0, |m: f64, v| m.max(v[o].abs()));
        let (kept, total) = tried.entry(kind).or_default();
        for sample in &samples {
            let block =
                OneBlock { kind, which, parameters, samples: core::slice::from_ref(sample) };
            let exact = kind.visit(WithPartials { block });
            for (i, (low, high)) in ranges.iter().enumerate().filter(|(_, r)| r.0 < r.1) {
                for (o, (_, partials)) in exact.iter().enumerate() {
                    let moved = |x: f64| {
                        let mut sample = sample.clone();
                        sample[i] = x;
                        values(&[sample])[0][o]
                    };
                    let width = high - low;
                    let noise = 1e-7 * largest(o) / width;
                    *total += 1;
                    let Some(slope) = difference(&moved, sample[i], 1e-6 * width, noise) else {
                        continue;
                    };
                    *kept += 1;
                    let error = (partials[i] - slope).abs();
                    assert!(
                        error <= 1e-5 * slope.abs() + noise,
                        "{name}, output {o}, input {i}: {} but {slope} at {sample:?}",
                        partials[i]
                    );
                }
            }
        }
    });
    for (kind, (kept, total)) in tried {
        assert!(2 * kept >= total, "{kind:?}: kinks at {} of {total}", total - kept);
    }
}

#[test]
fn all_numbers_are_finite_at_zero_and_in_range() {
    for_each_block(|alone, block| {
        let mut samples = alone.samples(block);
        samples.push(vec![0.0; block.inputs.len()]);
        for sample in &samples {
            let one = OneBlock {
                kind: block.equation(),
                which: block.which,
                parameters: &alone.parameters,
                samples: core::slice::from_ref(sample),
            };
            for (value, partials) in block.equation().visit(WithPartials { block: one }) {
                let finite = value.is_finite() && partials.iter().all(|p| p.is_finite());
                assert!(finite, "{}: {value} {partials:?} at {sample:?}", alone.name(block));
            }
        }
    });
}
