//! Compiles a network into a program: sorts its blocks by their dependencies, splits them into sequences and lays
//! out its variables.

use super::{Observable, Program, Slot, StateOf, Ticking};
use crate::jacobian::SparseJacobian;
use crate::network::{Mistake, Network};
use crate::sequence::Sequence;
use crate::spec::{PortKind, Unit};
use crate::wiring::{Block, Collected, PortOf, Role, Variable};
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

impl Network {
    /// Compiles the network.
    ///
    /// # Errors
    /// The mistakes found.
    ///
    /// # Panics
    /// If a component does not wire what it declares.
    pub fn compile(&self) -> Result<Program, Vec<Mistake>> {
        let (collected, circuits) = self.wired()?;
        schedule(self, collected, circuits)
    }
}

/// Orders the blocks and lays out the variables.
fn schedule(
    network: &Network,
    mut collected: Collected,
    circuits: Vec<usize>,
) -> Result<Program, Vec<Mistake>> {
    resolve_aliases(&mut collected);
    let layout = Layout::new(network, &collected);
    if layout.states == 0 {
        return Err(vec![Mistake::Empty]);
    }
    if layout.slots >= Slot::MAX as usize {
        return Err(vec![Mistake::TooLarge]);
    }
    let blocks = core::mem::take(&mut collected.blocks);
    let (sampled, continuous): (Vec<Block>, Vec<Block>) =
        blocks.into_iter().partition(|b| b.clock.is_some());
    let continuous = in_order(continuous, &collected)?;
    let (motion, readings, needed) = parted(continuous, &layout);
    let mut constants = 0;
    let mut written = vec![false; layout.slots];
    let mut sequence = |blocks, written: &mut [bool]| {
        Sequence::new(blocks, layout.slots, &layout.slot_of, written, &mut constants)
    };
    let motion = sequence(motion, &mut written);
    let readings = sequence(readings, &mut written);
    let mut clocks = Vec::with_capacity(collected.clocks.len());
    for (clock, declared) in collected.clocks.iter().enumerate() {
        let own = |block: &&Block| block.clock == Some(clock);
        let blocks = sampled.iter().filter(own).cloned().collect();
        clocks.push(Ticking {
            period_s: declared.period_s,
            sequence: sequence(blocks, &mut vec![false; layout.slots]),
            exchanges: Vec::new(),
        });
    }
    for &(clock, from, to) in &collected.exchanges {
        let slot = |v: Variable| layout.slot_of[v.0 as usize];
        clocks[clock].exchanges.push((slot(from), slot(to)));
    }
    let sums = layout.sums.clone();
    let inputs = network.inputs.len();
    let too_large = || vec![Mistake::TooLarge];
    let jacobian = SparseJacobian::new(&motion, layout.states, inputs, sums.clone(), &needed);
    let jacobian = jacobian.ok_or_else(too_large)?;
    let lu = jacobian.lu().ok_or_else(too_large)?;
    Ok(Program {
        states: layout.list_states(network, &collected),
        observables: observables(network, &collected, &layout),
        stand_ins: layout.stand_ins,
        slots: layout.slots,
        sums,
        motion,
        readings,
        clocks,
        constants,
        jacobian,
        lu,
        circuits,
        identity: network.identity(),
        network: network.clone(),
    })
}

/// Splits ordered blocks into those that the derivatives depend on and the rest. Also returns
/// the sums that the derivatives depend on, including the derivatives.
fn parted(blocks: Vec<Block>, layout: &Layout) -> (Vec<Block>, Vec<Block>, BTreeSet<usize>) {
    let sums = &layout.sums;
    let mut needed: BTreeSet<usize> = (sums.end - layout.states..sums.end).collect();
    let slot = |variable: u32| layout.slot_of[variable as usize] as usize;
    let (mut motion, mut readings) = (Vec::new(), Vec::new());
    for block in blocks.into_iter().rev() {
        let mut ends = block.outputs.iter().flat_map(|o| [o.add, o.subtract]).flatten();
        if ends.any(|sum| needed.contains(&slot(sum.0))) {
            let inputs = block.inputs.iter().map(|input| slot(input.0));
            needed.extend(inputs.filter(|input| sums.contains(input)));
            motion.push(block);
        } else {
            readings.push(block);
        }
    }
    motion.reverse();
    readings.reverse();
    (motion, readings, needed)
}

/// Replaces aliases in all blocks.
fn resolve_aliases(collected: &mut Collected) {
    let mut blocks = core::mem::take(&mut collected.blocks);
    for block in &mut blocks {
        for input in &mut block.inputs {
            *input = collected.resolve(*input);
        }
    }
    collected.blocks = blocks;
}

/// The slot of each variable.
struct Layout {
    states: usize,
    slots: usize,
    sums: Range<usize>,
    stand_ins: Vec<Role>,
    /// Indexed by variable.
    slot_of: Vec<Slot>,
}

impl Layout {
    fn new(network: &Network, collected: &Collected) -> Self {
        let roles = &collected.roles;
        let states = roles.iter().filter(|r| matches!(r, Role::State { .. })).count();
        let mut slot_of = vec![Slot::MAX; roles.len()];
        let mut stand_ins = Vec::new();
        let externals = network.inputs.len();
        let mut next = states + externals;
        let mut assign = |wanted: &dyn Fn(Role) -> bool, next: &mut usize| {
            for (variable, &role) in roles.iter().enumerate() {
                if wanted(role) {
                    slot_of[variable] = (*next).min(Slot::MAX as usize) as Slot;
                    *next += 1;
                }
            }
        };
        assign(&|r| matches!(r, Role::State { .. }), &mut 0);
        let stands_in =
            |r| matches!(r, Role::Parameter { .. } | Role::Temperature { .. } | Role::Held);
        assign(&stands_in, &mut next);
        stand_ins.extend(roles.iter().copied().filter(|&r| stands_in(r)));
        let first_sum = next;
        assign(&|r| matches!(r, Role::Sum), &mut next);
        assign(&|r| matches!(r, Role::Derivative { .. }), &mut next);
        for (variable, &role) in roles.iter().enumerate() {
            if let Role::External(input) = role {
                slot_of[variable] = (states + input) as Slot;
            }
        }
        for variable in 0..roles.len() {
            if let Role::Alias(_) = roles[variable] {
                let target = collected.resolve(Variable(variable as u32));
                slot_of[variable] = slot_of[target.0 as usize];
            }
        }
        Self { states, slots: next, sums: first_sum..next, stand_ins, slot_of }
    }

    fn list_states(&self, network: &Network, collected: &Collected) -> Vec<StateOf> {
        let mut states = Vec::with_capacity(self.states);
        for &role in &collected.roles {
            if let Role::State { component, state } = role {
                let instance = &network.components[component];
                let declared = &instance.component.states[state];
                states.push(StateOf {
                    name: format!("{}.{}", instance.id, declared.name),
                    component,
                    state,
                    scale: declared.scale,
                    error_weight: declared.error_weight,
                    lowest: declared.lowest,
                    unit: declared.unit,
                });
            }
        }
        states
    }
}

/// Sorts blocks so that each runs after those that add to its inputs, and
/// groups blocks of one kind within a level.
fn in_order(blocks: Vec<Block>, collected: &Collected) -> Result<Vec<Block>, Vec<Mistake>> {
    let sums_of = |block: &Block| -> Vec<u32> {
        let ends = block.outputs.iter().flat_map(|o| [o.add, o.subtract]);
        ends.flatten().map(|s| collected.resolve(Variable(s.0)).0).collect()
    };
    let mut writers: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, block) in blocks.iter().enumerate() {
        for sum in sums_of(block) {
            writers.entry(sum).or_default().push(index);
        }
    }
    let mut level: Vec<Option<usize>> = vec![None; blocks.len()];
    let mut found = 0;
    while found < blocks.len() {
        let before = found;
        for index in 0..blocks.len() {
            if level[index].is_some() {
                continue;
            }
            let needed = blocks[index].inputs.iter().filter_map(|v| writers.get(&v.0)).flatten();
            let levels: Option<Vec<usize>> = needed.map(|&w| level[w]).collect();
            if let Some(levels) = levels {
                let after = levels.iter().map(|l| l + 1).max().unwrap_or(0);
                // Level zero belongs to the opening blocks.
                level[index] = Some(if blocks[index].is_opening { 0 } else { after.max(1) });
                found += 1;
            }
        }
        if found == before {
            return Err(vec![loop_among(&blocks, &level, &writers)]);
        }
    }
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by_key(|&i| (level[i], blocks[i].kind, blocks[i].subtracts(), i));
    let mut blocks: Vec<Option<Block>> = blocks.into_iter().map(Some).collect();
    Ok(order.into_iter().map(|i| blocks[i].take().expect("each once")).collect())
}

/// Follows the dependencies of an unplaced block until a block repeats.
fn loop_among(
    blocks: &[Block],
    level: &[Option<usize>],
    writers: &BTreeMap<u32, Vec<usize>>,
) -> Mistake {
    let waits_for = |index: usize| {
        let needed = blocks[index].inputs.iter().filter_map(|v| writers.get(&v.0)).flatten();
        needed.copied().find(|&w| level[w].is_none()).expect("an unplaced block waits")
    };
    let mut seen = vec![false; blocks.len()];
    let mut index = (0..blocks.len()).find(|&i| level[i].is_none()).expect("one is unplaced");
    while !seen[index] {
        seen[index] = true;
        index = waits_for(index);
    }
    let mut components = vec![blocks[index].component];
    let mut next = waits_for(index);
    while next != index {
        components.push(blocks[next].component);
        next = waits_for(next);
    }
    components.sort_unstable();
    components.dedup();
    Mistake::AlgebraicLoop { components }
}

fn observables(network: &Network, collected: &Collected, layout: &Layout) -> Vec<Observable> {
    let mut list = Vec::new();
    let mut push = |name: String, unit: Unit, variable: Variable| {
        let slot = layout.slot_of[collected.resolve(variable).0 as usize];
        if slot != Slot::MAX {
            list.push(Observable { name, unit, slot });
        }
    };
    for (variable, &role) in collected.roles.iter().enumerate() {
        if let Role::State { component, state } = role {
            let instance = &network.components[component];
            let declared = &instance.component.states[state];
            let name = format!("{}.{}", instance.id, declared.name);
            let variable = Variable(variable as u32);
            let shown = collected.shown.iter().find(|shown| shown.0 == variable);
            push(name, declared.unit, shown.map_or(variable, |shown| shown.1));
        }
    }
    for &(port, node) in &collected.nodes {
        let PortOf { component, port } = port;
        let instance = &network.components[component];
        let declared = &instance.component.ports[port];
        let name = format!("{}.{}", instance.id, declared.name);
        let sum = node.sum.variable();
        match declared.kind {
            PortKind::Hydraulic { sets: true } => {
                push(format!("{name}.pressure_pa"), Unit::Pascal, node.first);
                push(format!("{name}.flow_m3_s"), Unit::CubicMetrePerSecond, sum);
            }
            PortKind::Translational { sets: true } => {
                push(format!("{name}.position_m"), Unit::Metre, node.first);
                push(format!("{name}.velocity_m_s"), Unit::MetrePerSecond, node.second);
                push(format!("{name}.force_n"), Unit::Newton, sum);
            }
            PortKind::Rotational { sets: true } => {
                push(format!("{name}.angle_rad"), Unit::Radian, node.first);
                push(format!("{name}.rate_rad_s"), Unit::RadianPerSecond, node.second);
                push(format!("{name}.moment_nm"), Unit::NewtonMetre, sum);
            }
            PortKind::SignalOut { unit } => push(name, unit, node.first),
            _ => {}
        }
    }
    for (index, input) in network.inputs.iter().enumerate() {
        let slot = (layout.states + index) as Slot;
        list.push(Observable { name: input.id.clone(), unit: input.unit, slot });
    }
    list
}
