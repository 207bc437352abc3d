//! Learns the targets of a study from its windows, and judges every window by a classifier that has not seen its group.
//!
//! Windows of a group are on one side of every split. Without groups, every run of rows is cut into as many consecutive
//! parts as there are folds. Nominal values are learned anew for every fold, from the healthy rows of its training
//! windows.

use super::model::{FORMAT, RecordingModel, TargetModel};
use super::novelty::NoveltyResult;
use super::twin::TWIN;
use super::windows::{NominalFit, Windows, joined};
use super::{RecordingError, RecordingStudy, Target};
use crate::files::write_atomically;
use crate::job::{Among, Folder, JobError};
use crate::learn::data_set::{coded, in_order};
use crate::learn::metrics::{Prediction, Rate, Score};
use crate::learn::{EvaluationError, model_file};
use crate::parallel::{self, Workers};
use crate::table::{Column, Table};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::{ALL, ClassifierKind};
use servotwin_learning::Samples;
use servotwin_learning::classifiers::{Fit, Settings, predict};
use servotwin_learning::hierarchy::HierarchySettings;
use servotwin_learning::splits::{Split, grouped_k_fold};

/// The seed of the folds.
const SEED: u64 = 1;

/// The files of results that a study of recordings writes.
pub const FILES: [&str; 4] =
    ["windows.parquet", "outcomes.parquet", "model.json", "recordings.json"];

/// The result of a study of recordings.
#[derive(Debug, Clone)]
pub struct JudgedRecordings {
    /// The results.
    pub results: RecordingResults,
    /// The data set: for each window its first row and fold, the kept columns and the features.
    pub windows: Table,
    /// One row for each judged window, target and classifier: record, group, fold, truth, answer.
    pub outcomes: Table,
    /// The models learned from all windows.
    pub model: RecordingModel,
}

/// The results of a study of recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingResults {
    /// Rows of the records.
    pub rows: usize,
    /// Rows that are in no whole window.
    pub left_over_rows: usize,
    /// Rows within windows that lack a number.
    pub incomplete_rows: usize,
    /// Number of windows.
    pub windows: usize,
    /// Number of features of a window.
    pub features: usize,
    /// How windows are held out.
    pub split: String,
    /// How well the learned nominal values fit their healthy rows.
    pub nominals: Vec<NominalFit>,
    /// Every target with every classifier.
    pub targets: Vec<TargetResult>,
    /// The windows of each group that are unlike the first healthy groups.
    pub novelty: Option<NoveltyResult>,
}

/// The performance of a classifier on a target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TargetResult {
    /// The column.
    pub column: String,
    /// The classifier.
    pub classifier: ClassifierKind,
    /// Windows without a value of the target, which are not used.
    pub unlabeled: usize,
    /// Right answers, with an interval over groups.
    pub score: Score,
    /// Of the healthy windows: another answer than healthy.
    pub false_alarms: Option<Rate>,
    /// Of the other windows: the answer healthy.
    pub missed: Option<Rate>,
}

/// The windows of records with what all targets have in common.
struct Prepared {
    windows: Windows,
    groups: Vec<String>,
    group: Vec<u32>,
    splits: Vec<Split>,
    /// The windows with the nominal values of each fold; one for all if no nominal value is learned.
    of_folds: Vec<Windows>,
}

impl Prepared {
    fn of_fold(&self, fold: usize) -> &Windows {
        self.of_folds.get(fold).unwrap_or(&self.of_folds[0])
    }

    /// The fold in which each window is judged.
    fn folds(&self) -> Vec<u32> {
        let mut folds = vec![0; self.group.len()];
        for (fold, split) in (0..).zip(&self.splits) {
            split.test.iter().for_each(|&window| folds[window] = fold);
        }
        folds
    }
}

/// The values of a target in all windows.
struct Labels<'s> {
    target: &'s Target,
    classes: Vec<String>,
    /// The class of each window; `None` without a value.
    of_window: Vec<Option<u32>>,
}

impl<'s> Labels<'s> {
    fn new(target: &'s Target, windows: &Table) -> Result<Self, RecordingError> {
        let (mut classes, codes) = coded(windows.text(&target.column)?, Ord::cmp);
        // The empty text is the first.
        let missing = u32::from(classes.first().is_some_and(String::is_empty));
        classes.drain(..missing as usize);
        let of_window = codes.into_iter().map(|code| code.checked_sub(missing)).collect();
        Ok(Labels { target, classes, of_window })
    }

    /// The windows among these that have a value.
    fn known(&self, windows: &[usize]) -> Vec<usize> {
        windows.iter().copied().filter(|&window| self.of_window[window].is_some()).collect()
    }

    /// Windows that have a value, as samples.
    fn samples(&self, windows: &Windows, known: &[usize]) -> Result<Samples, RecordingError> {
        let mut values = vec![];
        for feature in windows.features() {
            let column = feature.numbers()?;
            values.extend(known.iter().map(|&window| column[window]));
        }
        let labels = known.iter().filter_map(|&window| self.of_window[window]).collect();
        let names = windows.features().iter().map(|feature| feature.name.clone()).collect();
        Ok(Samples::with_missing(names, self.classes.clone(), values, labels)?)
    }
}

/// The answer of a classifier for a held-out window.
#[derive(Clone, Copy)]
struct Judged {
    window: usize,
    fold: usize,
    truth: u32,
    answer: u32,
}

impl RecordingStudy {
    /// Learns and judges every target of the study, and the novelty of every group.
    ///
    /// # Errors
    /// As [`RecordingStudy::windows`]; there are fewer than two groups; a classifier cannot learn from the windows.
    pub fn judge(
        &self,
        text: &str,
        records: &Table,
        workers: Workers,
    ) -> Result<JudgedRecordings, RecordingError> {
        let healthy = self.healthy_rows(records)?;
        let novelty = self.novelty.as_ref().map(|choice| self.judge_novelty(choice, records));
        let (novelty, learned) = novelty.transpose()?.unzip();
        let nominals = match &learned {
            Some(known) if self.targets.is_empty() => known.nominals.clone(),
            _ => self.learn(records, &healthy)?,
        };
        let windows = self.windows(records, &nominals)?;
        let prepared = self.prepare(records, windows, &healthy, workers)?;
        let (targets, outcomes, models) = self.judge_targets(&prepared, workers)?;
        let Prepared { windows, groups, .. } = &prepared;
        let results = RecordingResults {
            rows: records.row_count(),
            left_over_rows: windows.left_over,
            incomplete_rows: windows.incomplete,
            windows: windows.starts.len(),
            features: windows.features().len(),
            split: self.split_in_words(prepared.splits.len(), groups.len()),
            nominals: self.fits(records, &nominals, &healthy)?,
            targets,
            novelty,
        };
        let features = windows.features().iter().map(|feature| feature.name.clone()).collect();
        let model = RecordingModel {
            format: FORMAT.into(),
            study: text.into(),
            system: self.twin.is_some().then(|| records.metadata.get(TWIN).cloned()).flatten(),
            features,
            nominals,
            targets: models,
            novelty: learned,
        };
        Ok(JudgedRecordings { results, windows: data_set(&prepared)?, outcomes, model })
    }

    fn split_in_words(&self, folds: usize, groups: usize) -> String {
        match (self.targets.is_empty(), self.groups.is_empty()) {
            (true, _) => "nothing is held out".into(),
            (_, true) => format!("{folds} folds of consecutive windows of every run of rows"),
            (_, false) => format!(
                "{folds} folds over {groups} groups ({}), each on one side of every split",
                self.groups.join(", ")
            ),
        }
    }

    /// Groups, folds, and the windows of every fold.
    fn prepare(
        &self,
        records: &Table,
        windows: Windows,
        healthy: &[usize],
        workers: Workers,
    ) -> Result<Prepared, RecordingError> {
        let (groups, group) = in_order(&joined(&windows.table, &self.groups)?);
        let splits = match (self.targets.is_empty(), self.groups.is_empty()) {
            (true, _) => vec![],
            (false, true) => consecutive(&windows, self.folds)?,
            (false, false) => grouped_k_fold(&group, self.folds.min(groups.len()).max(2), SEED)?,
        };
        let mut is_healthy = vec![false; records.row_count()];
        healthy.iter().for_each(|&row| is_healthy[row] = true);
        let of_fold = |split: &Split| {
            let rows = split.train.iter().flat_map(|&window| {
                let start = windows.starts[window];
                start..start + self.window_rows
            });
            let rows: Vec<usize> = rows.filter(|&row| is_healthy[row]).collect();
            self.windows(records, &self.learn(records, &rows)?)
        };
        let of_folds = match self.learns_nominals() && !splits.is_empty() {
            true => {
                parallel::map(&splits, workers, of_fold)?.into_iter().collect::<Result<_, _>>()?
            }
            false => vec![windows.clone()],
        };
        Ok(Prepared { windows, groups, group, splits, of_folds })
    }

    /// Judges every target with every classifier, and learns from all windows.
    fn judge_targets(
        &self,
        prepared: &Prepared,
        workers: Workers,
    ) -> Result<(Vec<TargetResult>, Table, Vec<TargetModel>), RecordingError> {
        let windows = &prepared.windows.table;
        let every: Vec<usize> = (0..windows.row_count()).collect();
        let folds: Vec<usize> = (0..prepared.splits.len()).collect();
        let records = match &self.record {
            Some(record) => windows.text(record)?.to_vec(),
            None => vec![String::new(); every.len()],
        };
        let (mut results, mut models) = (vec![], vec![]);
        let mut numbers: [Vec<u32>; 2] = Default::default();
        let mut texts: [Vec<String>; 6] = Default::default();
        for target in &self.targets {
            let labels = Labels::new(target, windows)?;
            for classifier in self.classifiers() {
                let judge = |&fold: &usize| judge_fold(prepared, &labels, &classifier, fold);
                let judged = parallel::map(&folds, workers, judge)?;
                let judged = judged.into_iter().collect::<Result<Vec<_>, RecordingError>>()?;
                let judged = judged.concat();
                for Judged { window, fold, truth, answer } in &judged {
                    let [truth, answer] = [truth, answer].map(|&c| &*labels.classes[c as usize]);
                    let group = &prepared.groups[prepared.group[*window] as usize];
                    let name = classifier.kind().id();
                    let row = [&records[*window], group, &target.column, name, truth, answer];
                    texts.iter_mut().zip(row).for_each(|(column, text)| column.push(text.into()));
                    numbers.iter_mut().zip([window, fold]).for_each(|(n, v)| n.push(*v as u32));
                }
                results.push(result(prepared, &labels, classifier.kind(), &judged));
                let known = labels.known(&every);
                let model = classifier.fit(&labels.samples(&prepared.windows, &known)?)?;
                let (column, classes) = (target.column.clone(), labels.classes.clone());
                models.push(TargetModel { column, classes, model });
            }
        }
        let numbers = ["window", "fold"].into_iter().zip(numbers);
        let names = ["record", "group", "target", "classifier", "truth", "answer"];
        let numbers = numbers.map(|(name, values)| Column::new(name, "", values));
        let texts = names.into_iter().zip(texts).map(|(name, text)| Column::new(name, "", text));
        Ok((results, Table::from_columns(numbers.chain(texts).collect())?, models))
    }

    /// The classifiers with their usual settings; a tree has those of the trees of a simulated study.
    fn classifiers(&self) -> impl Iterator<Item = Settings> {
        let known = |word: &String| ALL.iter().find(|kind| kind.id() == *word);
        self.classifiers.iter().filter_map(known).map(|kind| match kind {
            ClassifierKind::Cart => HierarchySettings::default().actuator,
            kind => Settings::default_of(*kind),
        })
    }
}

fn judge_fold(
    prepared: &Prepared,
    labels: &Labels,
    classifier: &Settings,
    fold: usize,
) -> Result<Vec<Judged>, RecordingError> {
    let (windows, split) = (prepared.of_fold(fold), &prepared.splits[fold]);
    let test = labels.known(&split.test);
    if test.is_empty() {
        return Ok(vec![]);
    }
    let model = classifier.fit(&labels.samples(windows, &labels.known(&split.train))?)?;
    let samples = labels.samples(windows, &test)?;
    let answers = predict(&model, &samples)?.into_iter().zip(samples.labels());
    let judged = answers.zip(&test);
    Ok(judged.map(|((answer, &truth), &window)| Judged { window, fold, truth, answer }).collect())
}

fn result(
    prepared: &Prepared,
    labels: &Labels,
    classifier: ClassifierKind,
    judged: &[Judged],
) -> TargetResult {
    let prediction = |&Judged { window, fold, truth, answer }: &Judged| {
        // Without groups, the windows of a fold depend on each other.
        let is_grouped = prepared.groups.len() > 1;
        let cluster = if is_grouped { prepared.group[window] } else { fold as u32 };
        Prediction { cluster, kind: cluster, truth, said: Some(answer) }
    };
    let healthy = labels.target.healthy.as_ref();
    let healthy = healthy.and_then(|value| labels.classes.binary_search(value).ok());
    // Of the windows that are healthy, or of the others, those that are answered otherwise.
    let wrong = |is_healthy: bool| {
        let healthy = healthy? as u32;
        let among = judged.iter().filter(|own| (own.truth == healthy) == is_healthy);
        let is_wrong = |own: &&Judged| (own.answer == healthy) != is_healthy;
        Some(Rate::of(&among.collect::<Vec<_>>(), is_wrong))
    };
    TargetResult {
        column: labels.target.column.clone(),
        classifier,
        unlabeled: labels.of_window.iter().filter(|class| class.is_none()).count(),
        score: Score::of(
            labels.classes.clone(),
            &judged.iter().map(prediction).collect::<Vec<_>>(),
        ),
        false_alarms: wrong(true),
        missed: wrong(false),
    }
}

/// Cuts every run of windows with the same kept columns into consecutive parts, one for each fold.
fn consecutive(windows: &Windows, folds: usize) -> Result<Vec<Split>, RecordingError> {
    let names: Vec<String> = windows.table.names().take(windows.kept).map(str::to_owned).collect();
    let texts = joined(&windows.table, &names)?;
    let mut fold_of = vec![];
    for run in texts.chunk_by(|a, b| a == b) {
        fold_of.extend((0..run.len()).map(|place| place * folds / run.len()));
    }
    let split = |fold: usize| {
        let (test, train) = (0..fold_of.len()).partition(|&window| fold_of[window] == fold);
        Split { train, test }
    };
    Ok((0..folds).map(split).collect())
}

/// The windows with their first rows and folds.
fn data_set(prepared: &Prepared) -> Result<Table, RecordingError> {
    let first = prepared.windows.starts.iter().map(|&start| start as u32).collect::<Vec<_>>();
    let mut table = Table::new();
    table.push(Column::new("first_row", "", first).described("row of the records, from 0"))?;
    if !prepared.splits.is_empty() {
        let folds = Column::new("fold", "", prepared.folds());
        table.push(folds.described("the fold in which the window is judged"))?;
    }
    for column in prepared.windows.table.columns() {
        table.push(column.clone())?;
    }
    Ok(table)
}

impl JudgedRecordings {
    /// Writes [`FILES`] and the text of the study, `study.toml`, into a folder.
    ///
    /// # Errors
    /// The folder holds results of a simulated study; [`JobError::Busy`]; a file cannot be written.
    pub fn write(&self, folder: &Folder) -> Result<(), JobError> {
        let _hold = folder.hold(Among::Nobody)?;
        let there = folder.results_there()?;
        if !there.is_empty() {
            let (there, count) = ("a simulated study".into(), there.len());
            return Err(JobError::OtherResults { folder: folder.path().into(), there, count });
        }
        let text = &self.model.study;
        write_atomically(folder.study(), |out| out.write_all(text.as_bytes()))?;
        let [windows, outcomes, model, results] = FILES.map(|name| folder.path().join(name));
        for (path, table) in [(windows, &self.windows), (outcomes, &self.outcomes)] {
            table.write(path).map_err(EvaluationError::from)?;
        }
        model_file::write_model(model, &self.model)?;
        Ok(model_file::write(results, &self.results)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_out_group_does_not_teach_its_own_nominal_value() {
        let text = "format = 1\nwindow_rows = 2\ngroups = [\"tank\"]\nfamilies = [\"moments\"]\n\
            [[targets]]\ncolumn = \"state\"\nhealthy = \"none\"\n\
            [[sensors]]\nname = \"y\"\nmeasured = \"y\"\nnominal_from = []\nscale = 1.0\n";
        let study = RecordingStudy::parse(text, "study.toml").unwrap();
        let texts = |a: &str, b: &str| [a, a, b, b].map(str::to_owned).to_vec();
        let records = Table::from_columns(vec![
            Column::new("y", "", vec![0.0, 0.0, 10.0, 10.0]),
            Column::new("tank", "", texts("a", "b")),
            Column::new("state", "", texts("none", "none")),
        ]);
        let records = records.unwrap();
        let healthy = study.healthy_rows(&records).unwrap();
        let windows = study.windows(&records, &study.learn(&records, &healthy).unwrap()).unwrap();
        assert_eq!(windows.table.f64("mean_y").unwrap().as_ref(), [-5.0, 5.0]);
        let prepared = study.prepare(&records, windows, &healthy, Workers::new(1)).unwrap();
        let own = |window: usize| {
            let fold = prepared.folds()[window] as usize;
            prepared.of_fold(fold).table.f64("mean_y").unwrap()[window]
        };
        assert_eq!([own(0), own(1)], [-10.0, 10.0]);
    }
}
