//! Novelty: what is unlike the first healthy groups, where only health is known.
//!
//! Nominal values and the known ranges of all features are learned from the first healthy groups. Each of these is
//! judged by what the others of them teach.

use super::judged::settings;
use super::windows::{Windows, joined};
use super::{NoveltyChoice, RecordingError, RecordingStudy};
use crate::learn::data_set::in_order;
use crate::learn::metrics::Rate;
use crate::learn::run::{Scope, fit_stages};
use crate::parallel::Workers;
use crate::table::Table;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::ClassifierKind;
use servotwin_diagnosis::diagnoser::tuning::Tuning;
use servotwin_diagnosis::diagnoser::{Nominals, Novelty};
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_learning::novelty;

/// What the first healthy groups look like.
pub(super) struct LearnedNovelty {
    /// The nominal values of their healthy rows.
    pub(crate) nominals: Nominals,
    /// The known ranges of the features.
    pub(crate) novelty: Novelty,
    /// Trees that know health alone.
    pub(crate) trees: Hierarchy,
}

impl LearnedNovelty {
    /// The distance of every window from what is known; above 1 a window is unknown.
    fn distances(&self, windows: &Windows) -> Vec<f64> {
        windows.values.iter().map(|row| self.novelty.score(None, row)).collect()
    }
}

/// The novelty of all groups.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NoveltyResult {
    /// The share of healthy windows that should be known.
    pub(crate) quantile: f64,
    /// Every group, in the order of the records.
    pub groups: Vec<GroupNovelty>,
    /// Of the windows of later healthy groups, those that are unlike the first ones.
    pub false_alarms: Rate,
    /// The same of the other groups.
    pub alarms: Rate,
}

/// The novelty of a group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GroupNovelty {
    /// The values of the group's columns.
    pub group: String,
    /// Whether all its windows are healthy.
    pub is_healthy: bool,
    /// Whether it is one of those that were learned from. Its figures come from what the others teach.
    pub is_learned: bool,
    /// Of its windows, those that are unlike what was learned.
    pub unknown: Rate,
    /// Mean distance of its windows from what was learned; above 1 a window is unknown.
    pub mean_distance: f64,
}

/// The groups of records in their order.
struct Groups {
    names: Vec<String>,
    /// The group of each row.
    of_row: Vec<u32>,
    is_healthy: Vec<bool>,
}

impl RecordingStudy {
    /// Learns from the first healthy groups and judges all of them.
    ///
    /// # Errors
    /// As [`RecordingStudy::windows`]; there are too few healthy groups.
    pub(super) fn judge_novelty(
        &self,
        choice: &NoveltyChoice,
        records: &Table,
    ) -> Result<(NoveltyResult, LearnedNovelty), RecordingError> {
        let groups = self.in_order(records)?;
        let healthy = (0..groups.names.len()).filter(|&group| groups.is_healthy[group]);
        let first: Vec<usize> = healthy.take(choice.healthy_groups).collect();
        if first.len() < choice.healthy_groups || first.len() < 2 {
            let what = format!("healthy_groups ({} are healthy)", first.len());
            let allowed = "at least 2, and as many as there are";
            return Err(RecordingError::OutOfRange { what, allowed });
        }
        let (learned, windows) = self.learn_novelty(records, &groups, &first)?;
        let mut scores = learned.distances(&windows);
        let of_window: Vec<u32> = windows.starts.iter().map(|&row| groups.of_row[row]).collect();
        for &own in &first {
            let others: Vec<usize> = first.iter().copied().filter(|group| *group != own).collect();
            let (of_others, windows) = self.learn_novelty(records, &groups, &others)?;
            let instead = of_others.distances(&windows);
            let of_own = (0..scores.len()).filter(|&window| of_window[window] as usize == own);
            of_own.for_each(|window| scores[window] = instead[window]);
        }
        let scores_of = |is_own: &dyn Fn(usize) -> bool| -> Vec<f64> {
            let own = of_window.iter().zip(&scores).filter(|(group, _)| is_own(**group as usize));
            own.map(|(_, score)| *score).collect()
        };
        let unknown = |scores: &[f64]| Rate::of(scores, |score| *score > 1.0);
        let one = |group: usize| {
            let own = scores_of(&|other| other == group);
            GroupNovelty {
                group: groups.names[group].clone(),
                is_healthy: groups.is_healthy[group],
                is_learned: first.contains(&group),
                unknown: unknown(&own),
                mean_distance: own.iter().sum::<f64>() / own.len().max(1) as f64,
            }
        };
        let of_later = |is_healthy: bool| {
            let is_own = |group| groups.is_healthy[group] == is_healthy && !first.contains(&group);
            unknown(&scores_of(&is_own))
        };
        let result = NoveltyResult {
            quantile: learned.novelty.quantile,
            false_alarms: of_later(true),
            alarms: of_later(false),
            groups: (0..groups.names.len()).map(one).collect(),
        };
        Ok((result, learned))
    }

    /// The groups in the order of the records.
    fn in_order(&self, records: &Table) -> Result<Groups, RecordingError> {
        let (names, of_row) = in_order(joined(records, &self.groups)?);
        let mut is_healthy_row = vec![false; of_row.len()];
        self.healthy_rows(records)?.into_iter().for_each(|row| is_healthy_row[row] = true);
        let mut is_healthy = vec![true; names.len()];
        for (&group, is_healthy_row) in of_row.iter().zip(is_healthy_row) {
            is_healthy[group as usize] &= is_healthy_row;
        }
        Ok(Groups { names, of_row, is_healthy })
    }

    /// Learns from some groups, and returns all windows with their nominal values.
    fn learn_novelty(
        &self,
        records: &Table,
        groups: &Groups,
        learned: &[usize],
    ) -> Result<(LearnedNovelty, Windows), RecordingError> {
        let is_learned = |row: &usize| learned.contains(&(groups.of_row[*row] as usize));
        let rows: Vec<usize> = (0..records.row_count()).filter(is_learned).collect();
        let nominals = self.learn(records, &rows)?;
        let windows = self.windows(records, &nominals)?;
        let count = windows.starts.len();
        let examples = windows.examples(vec![], (0..count).map(|_| None))?;
        let of_window: Vec<u32> = windows.starts.iter().map(|&row| groups.of_row[row]).collect();
        let taught: Vec<usize> =
            (0..count).filter(|&window| is_learned(&windows.starts[window])).collect();
        let quantile = Tuning::default().known_share;
        let novelty = novelty::learn(&examples, &taught, &of_window, quantile)?;
        let (settings, alone) = (settings(ClassifierKind::Cart), Workers::new(1));
        let trees = fit_stages(&examples, &settings, &taught, Scope::Action, alone)?;
        Ok((LearnedNovelty { nominals, novelty, trees }, windows))
    }
}
