//! Trees and boosted trees: every leaf, both sides of every threshold, and missing values at every test.

use super::library::{Compiled, Place};
use super::rows::Rows;
use super::{Difference, Evidence};
use crate::error::ExportError;
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::hierarchy::{Hierarchy, Scratch, Stage};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::tree::Branches;

/// Rows of random values for the whole hierarchy of each window length.
const RANDOM_ROWS: usize = 20_000;

/// Compares all stages of all window lengths.
pub(super) fn compare(
    diagnoser: &Diagnoser,
    compiled: &Compiled,
    evidence: &mut Evidence,
) -> Result<(), ExportError> {
    for (length, of_length) in diagnoser.lengths.iter().enumerate() {
        let panel = &of_length.panel;
        for (is_committee, hierarchy) in [(false, &panel.trees), (true, &panel.committee)] {
            let at = Place { is_committee, length };
            for place in 0..hierarchy.stages.len() {
                compare_stage(hierarchy, (at, place), compiled, evidence)?;
            }
            compare_hierarchy(hierarchy, at, compiled, evidence)?;
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
    (at, place): (Place, usize),
    compiled: &Compiled,
    evidence: &mut Evidence,
) -> Result<(), ExportError> {
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
        let mut reached = vec![false; branches.len()];
        let Rows { rows, unreachable } = Rows::of(branches);
        for row in &rows {
            compared.row.fill(0.0);
            for (&feature, &value) in &row.values {
                compared.row[stage.columns[feature] as usize] = value;
            }
            let leaf = compared.leaf(branches);
            reached[leaf] = true;
            let number = own.binary_search(&leaf).map_or(-1, |k| (leaves_before + k) as i32);
            let said = compiled.leaf(at, place, tree, &compared.row)?;
            if said != number {
                let what =
                    format!("tree {tree}, node {}: leaf {said} instead of {number}", row.node);
                evidence.differ(stage, at, what);
            }
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
    at: Place,
    place: usize,
    compiled: &'a Compiled,
    scratch: Scratch,
    row: Vec<f64>,
}

impl ComparedStage<'_> {
    fn leaf(&self, branches: &Branches) -> usize {
        let own: Vec<f64> = self.stage.columns.iter().map(|&c| self.row[c as usize]).collect();
        branches.leaf_of(&own)
    }

    /// Compares decision and probabilities.
    fn answers(&mut self, evidence: &mut Evidence) -> Result<(), ExportError> {
        let said = self.compiled.decide(self.at, self.place, &self.row)?;
        let right = self.stage.answer(&self.row, &mut self.scratch);
        let same = said.decided == right.class as i32
            && said.probability.to_bits() == right.probability.to_bits();
        if !same {
            evidence.differ(self.stage, self.at, format!("{said:?} instead of {right:?}"));
        }
        if self.at.is_committee {
            let mut shares = vec![0.0; self.stage.classes.len()];
            self.compiled.shares(self.at.length, self.place, &self.row, &mut shares)?;
            let right = self.stage.probabilities(&self.row, &mut self.scratch);
            if !same_bits(&shares, right) {
                evidence.differ(self.stage, self.at, format!("shares {shares:?}, not {right:?}"));
            }
        }
        Ok(())
    }
}

/// Random rows, whose values lie at or beside thresholds, through the whole hierarchy.
fn compare_hierarchy(
    hierarchy: &Hierarchy,
    at: Place,
    compiled: &Compiled,
    evidence: &mut Evidence,
) -> Result<(), ExportError> {
    let thresholds = thresholds(hierarchy);
    let mut random = Random::new(at.length as u64);
    let mut scratch = hierarchy.scratch();
    let count = 1 + hierarchy.names.actuators.len() * hierarchy.names.actions.len();
    let (mut said, mut right) = (vec![0.0; count], vec![0.0; count]);
    for _ in 0..RANDOM_ROWS {
        let views: Vec<Vec<f64>> = (0..hierarchy.views())
            .map(|_| thresholds.iter().map(|known| value(known, &mut random)).collect())
            .collect();
        let diagnosis = compiled.diagnose(at, &views)?;
        let expected = hierarchy.diagnose(&views, &mut scratch)?;
        let place = |index: Option<u32>| index.map_or(-1, |index| index as i32);
        let same = [diagnosis.actuator, diagnosis.action, diagnosis.detail]
            == [expected.actuator, expected.action, expected.detail].map(place)
            && same_bits(
                &[diagnosis.confidence, diagnosis.detail_confidence],
                &[expected.confidence, expected.detail_confidence],
            );
        if !same {
            evidence.differences.push(Difference {
                place: super::name_of(at),
                what: format!("{diagnosis:?} instead of {expected:?}"),
            });
        }
        if at.is_committee {
            compiled.probabilities(at.length, &views, &mut said)?;
            hierarchy.probabilities_into(&views, &mut scratch, &mut right)?;
            if !same_bits(&said, &right) {
                evidence.differences.push(Difference {
                    place: super::name_of(at),
                    what: format!("probabilities {said:?} instead of {right:?}"),
                });
            }
        }
        evidence.random_rows += 1;
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
