//! Trees and boosted trees: every leaf, both sides of every threshold, and missing values at every test.

use super::ProofEvidence;
use super::library::{Compiled, Diagnosis, LibraryPlace};
use super::rows::{Rows, TestRow};
use crate::error::ExportError;
use crate::precision::Precision;
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::diagnoser::{Diagnoser, Length};
use servotwin_diagnosis::hierarchy::{self, Hierarchy, Scratch, Stage};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::tree::Branches;

/// The largest difference of a probability or a novelty in single precision that rounding alone explains.
const ROUNDING: f64 = 1e-4;

/// Compares all stages of all window lengths, and random rows through the whole hierarchy of each, until there are
/// enough differences. In single precision a single tree must decide the same for every row, and boosted trees must reach
/// the same leaves; only the sums of their values are rounded differently.
pub(super) fn compare(
    diagnoser: &Diagnoser,
    (compiled, precision): (&Compiled, Precision),
    random_rows: usize,
    evidence: &mut ProofEvidence,
) -> Result<(), ExportError> {
    for (length, of_length) in diagnoser.lengths.iter().enumerate() {
        let panel = &of_length.panel;
        for (is_committee, hierarchy) in [(false, &panel.trees), (true, &panel.committee)] {
            let at = LibraryPlace { is_committee, length };
            for place in 0..hierarchy.stages.len() {
                compare_stage(hierarchy, (at, place), (compiled, precision), evidence)?;
            }
            compare_hierarchy((of_length, at), (compiled, precision), random_rows, evidence)?;
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
    (0..branches.len()).filter(|node| branches.split(*node).is_none())
}

fn compare_stage(
    hierarchy: &Hierarchy,
    (at, place): (LibraryPlace, usize),
    (compiled, precision): (&Compiled, Precision),
    evidence: &mut ProofEvidence,
) -> Result<(), ExportError> {
    let stage = &hierarchy.stages[place];
    let mut compared = ComparedStage {
        stage,
        at,
        place,
        compiled,
        precision,
        scratch: hierarchy.scratch(),
        row: vec![0.0; hierarchy.names.features.len()],
    };
    let mut leaves_before = 0;
    for (tree, branches) in trees(&stage.model).into_iter().enumerate() {
        let own: Vec<usize> = leaves(branches).collect();
        let mut reached = vec![false; branches.len()];
        let Rows { rows, unreachable, .. } = Rows::of(branches, precision);
        for row in &rows {
            if evidence.has_enough() {
                return Ok(());
            }
            compared.set_row(row);
            let leaf = compared.leaf(branches);
            reached[leaf] = true;
            let number = own.binary_search(&leaf).map_or(-1, |k| (leaves_before + k) as i32);
            let said = compiled.leaf(at, place, tree, &compared.row)?;
            if said != number {
                let node = row.node;
                let what = format!("tree {tree}, node {node}: leaf {said} instead of {number}");
                evidence.differ(compared.name(), what);
            }
            compared.values((tree, leaf), number, evidence)?;
            compared.answers(evidence)?;
        }
        // A tree that is a single leaf has no test.
        let all = own.iter().filter(|leaf| own.len() > 1 && !unreachable.contains(leaf));
        evidence.leaves_not_reached += all.filter(|leaf| !reached[**leaf]).count() as u64;
        evidence.unreachable_nodes += unreachable.len() as u64;
        evidence.leaves += own.len() as u64;
        evidence.thresholds += (branches.len() - own.len()) as u64;
        evidence.rows += rows.len() as u64;
        leaves_before += own.len();
    }
    Ok(())
}

/// A stage with the row that both sides are asked about.
struct ComparedStage<'a> {
    stage: &'a Stage,
    at: LibraryPlace,
    place: usize,
    compiled: &'a Compiled,
    precision: Precision,
    scratch: Scratch,
    row: Vec<f64>,
}

impl ComparedStage<'_> {
    /// Whether sums of values decide, which may be nearly equal.
    fn may_tie(&self) -> bool {
        self.precision == Precision::F32 && matches!(self.stage.model, Model::BoostedTrees(_))
    }

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
    fn values(
        &self,
        (tree, leaf): (usize, usize),
        number: i32,
        evidence: &mut ProofEvidence,
    ) -> Result<(), ExportError> {
        let Model::BoostedTrees(model) = &self.stage.model else { return Ok(()) };
        let outputs = model.outputs().len();
        for output in 0..outputs {
            let right = self.precision.nearest(model.trees[tree].values[leaf * outputs + output]);
            let said = self.compiled.value(self.at.length, self.place, (number, output))?;
            if said.to_bits() != right.to_bits() {
                let what = format!("tree {tree}, leaf {number} adds {said} instead of {right}");
                evidence.differ(self.name(), what);
            }
        }
        Ok(())
    }

    /// Compares decision and probabilities.
    fn answers(&mut self, evidence: &mut ProofEvidence) -> Result<(), ExportError> {
        let said = self.compiled.decide(self.at, self.place, &self.row)?;
        let right = self.stage.answer(&self.row, &mut self.scratch);
        let is_near = match self.may_tie() {
            true => is_near(self.precision, said.probability, right.probability, evidence),
            // A leaf of a single tree has its probability as a constant.
            false => {
                let nearest = self.precision.nearest(right.probability);
                said.probability.to_bits() == nearest.to_bits()
            }
        };
        let is_decided = said.decided == right.class as i32;
        let is_tie = !is_decided && is_near && self.may_tie();
        evidence.ties += u64::from(is_tie);
        if !is_near || !(is_decided || is_tie) {
            evidence.differ(self.name(), format!("{said:?} instead of {right:?}"));
        }
        if self.at.is_committee {
            let mut shares = vec![0.0; self.stage.classes.len()];
            self.compiled.shares(self.at.length, self.place, &self.row, &mut shares)?;
            let right = self.stage.probabilities(&self.row, &mut self.scratch);
            if !are_near(self.precision, &shares, right, evidence) {
                let what = format!("shares {shares:?} instead of {right:?}");
                evidence.differ(self.name(), what);
            }
        }
        Ok(())
    }
}

/// Random rows, whose values lie at or beside thresholds, through a whole hierarchy; of committees also the novelty.
fn compare_hierarchy(
    (of_length, at): (&Length, LibraryPlace),
    (compiled, precision): (&Compiled, Precision),
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
            .map(|_| thresholds.iter().map(|known| value(known, precision, &mut random)).collect())
            .collect();
        let said = compiled.diagnose(at, &views)?;
        let right = hierarchy.diagnose(&views, &mut scratch)?;
        let is_same = match precision {
            Precision::F64 => is_same(&said, &right),
            Precision::F32 => is_same_in_single(&said, &right, at, evidence),
        };
        if !is_same {
            evidence.differ(at.to_string(), format!("{said:?} instead of {right:?}"));
        }
        if at.is_committee {
            let asked = (compiled, precision, views.as_slice());
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
    (compiled, precision, views): (&Compiled, Precision, &[Vec<f64>]),
    scratch: &mut Scratch,
    evidence: &mut ProofEvidence,
) -> Result<(), ExportError> {
    let committee = &of_length.panel.committee;
    let count = 1 + committee.names.actuators.len() * committee.names.actions.len();
    let (mut said, mut right) = (vec![0.0; count], vec![0.0; count]);
    compiled.probabilities(at.length, views, &mut said)?;
    committee.probabilities_into(views, scratch, &mut right)?;
    if !are_near(precision, &said, &right, evidence) {
        evidence.differ(at.to_string(), format!("probabilities {said:?} instead of {right:?}"));
    }
    for known in 0..of_length.novelty.classes.len() {
        let action = known.checked_sub(1).map(|action| action as u32);
        let said = compiled.novelty(at.length, known, &views[0])?;
        let right = of_length.novelty.score(action, &views[0]);
        if !is_near(precision, said, right, evidence) {
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

fn value(thresholds: &[f64], precision: Precision, random: &mut Random) -> f64 {
    if thresholds.is_empty() {
        return 0.0;
    }
    let threshold = precision.not_above(thresholds[random.index(thresholds.len())]);
    match random.index(8) {
        0 => f64::NAN,
        1 => precision.next_down(threshold),
        2 => threshold,
        3 => precision.next_up(threshold),
        _ => precision.nearest(threshold + 0.1 * (random.unit() - 0.5)),
    }
}

/// Whether a number is the trained one: its bits in double precision; in single precision nearly it, and the largest
/// difference is noted.
fn is_near(precision: Precision, said: f64, right: f64, evidence: &mut ProofEvidence) -> bool {
    if precision == Precision::F64 {
        return said.to_bits() == right.to_bits();
    }
    let difference = (said - right).abs() / right.abs().max(1.0);
    evidence.largest_difference = evidence.largest_difference.max(difference);
    difference <= ROUNDING
}

fn are_near(
    precision: Precision,
    said: &[f64],
    right: &[f64],
    evidence: &mut ProofEvidence,
) -> bool {
    let pairs = said.iter().zip(right);
    said.len() == right.len()
        && pairs.fold(true, |near, (a, b)| is_near(precision, *a, *b, evidence) && near)
}

/// Whether a diagnosis is the trained one but for rounding. Boosted trees whose classes have nearly the same sum may decide
/// otherwise, which is counted; single trees may not.
fn is_same_in_single(
    said: &Diagnosis,
    right: &hierarchy::Diagnosis,
    at: LibraryPlace,
    evidence: &mut ProofEvidence,
) -> bool {
    let place = |index: Option<u32>| index.map_or(-1, |index| index as i32);
    let indices = [right.actuator, right.action, right.detail].map(place);
    if [said.actuator, said.action, said.detail] != indices {
        evidence.ties += u64::from(at.is_committee);
        return at.is_committee;
    }
    let (said, right) =
        ([said.confidence, said.detail_confidence], [right.confidence, right.detail_confidence]);
    are_near(Precision::F32, &said, &right, evidence)
}

/// Equality of bits; NaN equals itself, and zeros differ by sign.
pub(super) fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}
