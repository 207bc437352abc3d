//! Trees and boosted trees: every leaf, both sides of every threshold, and missing values at every test.

use super::ProofEvidence;
use super::library::{Compiled, Diagnosis, LibraryPlace};
use super::rows::{Rows, TestRow};
use crate::error::ExportError;
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::diagnoser::{Diagnoser, Length};
use servotwin_diagnosis::hierarchy::{self, Hierarchy, Scratch, Stage};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::tree::Branches;

/// Compares all stages of all window lengths, and random rows through the whole hierarchy of each, until there are
/// enough differences.
pub(super) fn compare(
    diagnoser: &Diagnoser,
    compiled: &Compiled,
    random_rows: usize,
    evidence: &mut ProofEvidence,
) -> Result<(), ExportError> {
    for (length, of_length) in diagnoser.lengths.iter().enumerate() {
        let panel = &of_length.panel;
        for (is_committee, hierarchy) in [(false, &panel.trees), (true, &panel.committee)] {
            let at = LibraryPlace { is_committee, length };
            for place in 0..hierarchy.stages.len() {
                compare_stage(hierarchy, (at, place), compiled, evidence);
            }
            compare_hierarchy((of_length, at), compiled, random_rows, evidence)?;
        }
    }
    Ok(())
}

/// The trees of a stage.
fn trees(model: &Model) -> Vec<&Branches> {
    match model {
        Model::Cart(tree) => vec![tree.branches()],
        Model::BoostedTrees(model) => model.trees.iter().map(|tree| &tree.branches).collect(),
        _ => Vec::new(),
    }
}

/// The leaves of a tree, ascending.
fn leaves(branches: &Branches) -> impl Iterator<Item = usize> + '_ {
    (0..branches.node_count()).filter(|node| branches.split(*node).is_none())
}

fn compare_stage(
    hierarchy: &Hierarchy,
    (at, place): (LibraryPlace, usize),
    compiled: &Compiled,
    evidence: &mut ProofEvidence,
) {
    let stage = &hierarchy.stages[place];
    let mut compared = ComparedStage {
        stage,
        at,
        place,
        compiled,
        scratch: hierarchy.scratch(),
        row: vec![0.0; hierarchy.names.features.len()],
    };
    let mut leaves_before = 0;
    for (tree, branches) in trees(&stage.model).into_iter().enumerate() {
        let own: Vec<usize> = leaves(branches).collect();
        let mut reached = vec![false; branches.node_count()];
        let Rows { rows, unreachable } = Rows::of(branches);
        for row in &rows {
            if evidence.has_enough() {
                return;
            }
            compared.set_row(row);
            let leaf = compared.leaf(branches);
            reached[leaf] = true;
            let number = own.binary_search(&leaf).map_or(-1, |k| (leaves_before + k) as i32);
            let said = compiled.leaf(at, place, tree, &compared.row);
            if said != number {
                let node = row.node;
                let what = format!("tree {tree}, node {node}: leaf {said} instead of {number}");
                evidence.differ(compared.name(), what);
            }
            compared.values((tree, leaf), number, evidence);
            compared.answers(evidence);
        }
        // A tree that is a single leaf has no test.
        let all = own.iter().filter(|leaf| own.len() > 1 && !unreachable.contains(leaf));
        evidence.leaves_not_reached += all.filter(|leaf| !reached[**leaf]).count() as u64;
        evidence.unreachable_nodes += unreachable.len() as u64;
        evidence.leaves += own.len() as u64;
        evidence.thresholds += (branches.node_count() - own.len()) as u64;
        evidence.rows += rows.len() as u64;
        leaves_before += own.len();
    }
}

/// A stage with the row that both sides are asked about.
struct ComparedStage<'a> {
    stage: &'a Stage,
    at: LibraryPlace,
    place: usize,
    compiled: &'a Compiled,
    scratch: Scratch,
    row: Vec<f64>,
}

impl ComparedStage<'_> {
    fn name(&self) -> String {
        format!("{}, stage {}", self.at, self.stage.id)
    }

    /// A row with the values of the stage's features, and zeros elsewhere.
    fn set_row(&mut self, row: &TestRow) {
        self.row.fill(0.0);
        for (&feature, &value) in &row.values {
            self.row[self.stage.columns[feature] as usize] = value;
        }
    }

    fn leaf(&self, branches: &Branches) -> usize {
        let own: Vec<f64> = self.stage.columns.iter().map(|&c| self.row[c as usize]).collect();
        branches.leaf_of(&own)
    }

    /// Compares what a leaf adds to each output of boosted trees.
    fn values(&self, (tree, leaf): (usize, usize), number: i32, evidence: &mut ProofEvidence) {
        let Model::BoostedTrees(model) = &self.stage.model else { return };
        let outputs = model.outputs().len();
        for output in 0..outputs {
            let right = model.trees[tree].values[leaf * outputs + output];
            let said = self.compiled.value(self.at.length, self.place, (number, output));
            if said.to_bits() != right.to_bits() {
                let what = format!("tree {tree}, leaf {number} adds {said} instead of {right}");
                evidence.differ(self.name(), what);
            }
        }
    }

    /// Compares decision and probabilities.
    fn answers(&mut self, evidence: &mut ProofEvidence) {
        let said = self.compiled.decide(self.at, self.place, &self.row);
        let right = self.stage.answer(&self.row, &mut self.scratch);
        let is_same = said.decided == right.class as i32
            && said.probability.to_bits() == right.probability.to_bits();
        if !is_same {
            evidence.differ(self.name(), format!("{said:?} instead of {right:?}"));
        }
        if self.at.is_committee {
            let (length, classes) = (self.at.length, self.stage.classes.len());
            let shares = self.compiled.shares(length, self.place, &self.row, classes);
            let right = self.stage.probabilities(&self.row, &mut self.scratch);
            if !same_bits(&shares, right) {
                let what = format!("shares {shares:?} instead of {right:?}");
                evidence.differ(self.name(), what);
            }
        }
    }
}

/// Random rows, whose values lie at or beside thresholds, through a whole hierarchy; of committees also the novelty.
fn compare_hierarchy(
    (of_length, at): (&Length, LibraryPlace),
    compiled: &Compiled,
    random_rows: usize,
    evidence: &mut ProofEvidence,
) -> Result<(), ExportError> {
    let panel = &of_length.panel;
    let hierarchy = if at.is_committee { &panel.committee } else { &panel.trees };
    let thresholds = thresholds(hierarchy);
    let mut random = Random::new(at.length as u64);
    let mut scratch = hierarchy.scratch();
    for _ in 0..random_rows {
        if evidence.has_enough() {
            return Ok(());
        }
        let views: Vec<Vec<f64>> = (0..hierarchy.views())
            .map(|_| thresholds.iter().map(|known| value(known, &mut random)).collect())
            .collect();
        let said = compiled.diagnose(at, &views);
        let right = hierarchy.diagnose(&views, &mut scratch)?;
        if !is_same(&said, &right) {
            evidence.differ(at.to_string(), format!("{said:?} instead of {right:?}"));
        }
        if at.is_committee {
            let asked = (compiled, views.as_slice());
            compare_probabilities(of_length, at, asked, &mut scratch, evidence)?;
        }
        evidence.random_rows += 1;
    }
    Ok(())
}

fn is_same(said: &Diagnosis, right: &hierarchy::Diagnosis) -> bool {
    let place = |index: Option<u32>| index.map_or(-1, |index| index as i32);
    let indices = [right.actuator, right.action, right.detail].map(place);
    let confidences = [right.confidence, right.detail_confidence];
    [said.actuator, said.action, said.detail] == indices
        && same_bits(&[said.confidence, said.detail_confidence], &confidences)
}

/// Compares the probabilities of all hypotheses, and the novelty of the first view for every class.
fn compare_probabilities(
    of_length: &Length,
    at: LibraryPlace,
    (compiled, views): (&Compiled, &[Vec<f64>]),
    scratch: &mut Scratch,
    evidence: &mut ProofEvidence,
) -> Result<(), ExportError> {
    let committee = &of_length.panel.committee;
    let count = 1 + committee.names.actuators.len() * committee.names.actions.len();
    let mut right = vec![0.0; count];
    let said = compiled.probabilities(at.length, views, count);
    committee.probabilities_into((&views[0], views), scratch, &mut right)?;
    if !same_bits(&said, &right) {
        evidence.differ(at.to_string(), format!("probabilities {said:?} instead of {right:?}"));
    }
    for known in 0..of_length.novelty.classes.len() {
        let action = known.checked_sub(1).map(|action| action as u32);
        let said = compiled.novelty(at.length, known, &views[0]);
        let right = of_length.novelty.score(action, &views[0]);
        if said.to_bits() != right.to_bits() {
            evidence.differ(at.to_string(), format!("novelty {said} instead of {right}"));
        }
    }
    Ok(())
}

/// The thresholds of each feature.
fn thresholds(hierarchy: &Hierarchy) -> Vec<Vec<f64>> {
    let mut known = vec![Vec::new(); hierarchy.names.features.len()];
    for stage in &hierarchy.stages {
        for (feature, threshold) in trees(&stage.model).into_iter().flat_map(Branches::splits) {
            known[stage.columns[feature] as usize].push(threshold);
        }
    }
    known
}

fn value(thresholds: &[f64], random: &mut Random) -> f64 {
    if thresholds.is_empty() {
        return 0.0;
    }
    let threshold = thresholds[random.index(thresholds.len())];
    match random.index(8) {
        0 => f64::NAN,
        1 => threshold.next_down(),
        2 => threshold,
        3 => threshold.next_up(),
        _ => threshold + 0.1 * (random.unit() - 0.5),
    }
}

/// Equality of bits; NaN equals itself, and zeros differ by sign.
pub(super) fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}
