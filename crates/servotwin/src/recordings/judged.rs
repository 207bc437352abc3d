//! Learns the targets of a study from its windows, and judges every window by a classifier that has not seen its group.
//!
//! Windows of a group are on one side of every split. Without groups, every run of rows is cut into as many consecutive
//! parts as there are folds. Nominal values are learned anew for every fold, from the healthy rows of its training
//! windows.
//!
//! A target is learned by the trainer of simulated studies. Its values take the places of actuators, so that stage A
//! decides in one question which of them a window has, or that it is healthy. A stage of its own for health would cost
//! three of a hundred answers on the LiU engine bench.

use super::novelty::NoveltyResult;
use super::windows::{NominalFit, Windows, joined};
use super::{RecordingError, RecordingStudy, Target};
use crate::files::write_text;
use crate::job::{Among, Folder, JobError};
use crate::learn::data_set::{coded, in_order};
use crate::learn::metrics::Rate;
use crate::learn::run::{RowOutcome, Scope, ask, fit_stages};
use crate::learn::{EvaluationError, model_file};
use crate::measure::outcome::RunOutcome;
use crate::measure::{Answers, OF_WINDOWS, RIGHT_ANSWER, Rates};
use crate::parallel::{self, Workers};
use crate::table::{Column, Table};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::{ALL, ClassifierKind};
use servotwin_diagnosis::diagnoser::{Diagnoser, Novelty};
use servotwin_diagnosis::hierarchy::{FAULTY, Hierarchy, Names};
use servotwin_learning::classifiers;
use servotwin_learning::hierarchy::{Examples, HierarchySettings};
use servotwin_learning::splits::{Split, grouped_k_fold};

/// The seed of the folds.
const SEED: u64 = 1;

/// The files of results that every study of recordings writes, beside its diagnosers.
const FILES: [&str; 3] = ["windows.parquet", "outcomes.parquet", "recordings.json"];

/// The result of a study of recordings.
#[derive(Debug, Clone)]
pub struct JudgedRecordings {
    /// The text of the study.
    pub(crate) study: String,
    /// The results.
    pub results: RecordingResults,
    /// The data set: for each window its first row and fold, the kept columns and the features.
    pub windows: Table,
    /// One row for each judged window, target and classifier: record, group, fold, truth, answer.
    pub outcomes: Table,
    /// The diagnosers learned from all windows, with the names of their files: one for each target, and one of the
    /// novelty.
    pub diagnosers: Vec<(String, Diagnoser)>,
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
    pub(crate) unlabeled: usize,
    /// The measures of windows, with intervals over groups. A value that is not the healthy one is a fault.
    pub rates: Rates,
    /// The values of the target, each with the right answers among its windows.
    pub classes: Vec<(String, Rate)>,
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
    /// The class without a fault, if there is one.
    healthy: Option<u32>,
    /// The class of each window; `None` without a value.
    of_window: Vec<Option<u32>>,
}

impl<'s> Labels<'s> {
    fn new(target: &'s Target, windows: &Table) -> Result<Self, RecordingError> {
        let (mut classes, codes) = coded(windows.text(&target.column)?.to_vec(), Ord::cmp);
        // The empty text is the first.
        let missing = u32::from(classes.first().is_some_and(String::is_empty));
        classes.drain(..missing as usize);
        let healthy = target.healthy.as_ref().and_then(|value| classes.binary_search(value).ok());
        let of_window = codes.into_iter().map(|code| code.checked_sub(missing)).collect();
        Ok(Labels { target, classes, healthy: healthy.map(|class| class as u32), of_window })
    }

    /// The windows among these that have a value.
    fn known(&self, windows: &[usize]) -> Vec<usize> {
        windows.iter().copied().filter(|&window| self.of_window[window].is_some()).collect()
    }

    /// The classes of faults, which take the places of actuators.
    fn faults(&self) -> Vec<u32> {
        (0..self.classes.len() as u32).filter(|class| Some(*class) != self.healthy).collect()
    }

    /// All windows with their labels. Those without a value must not teach.
    fn examples(&self, windows: &Windows) -> Result<Examples, EvaluationError> {
        let faults = self.faults();
        let names = faults.iter().map(|&class| self.classes[class as usize].clone()).collect();
        let fault = |class: &Option<u32>| match class {
            Some(class) => faults.iter().position(|fault| fault == class),
            None => Some(0),
        };
        windows.examples(names, self.of_window.iter().map(fault))
    }

    /// A window with its answer by a classifier that has not seen its group.
    fn judged(&self, RowOutcome { row, said, .. }: RowOutcome, names: &Names) -> JudgedWindow {
        let truth = self.of_window[row].unwrap_or_default();
        let answer = match said.actuator {
            None => self.healthy,
            Some(fault) => self.faults().get(fault as usize).copied(),
        };
        let is_fault = Some(truth) != self.healthy;
        let record = RunOutcome {
            number: row as u64,
            at_fault: self.classes[truth as usize].clone(),
            onset_s: is_fault.then_some(0.0),
            ..RunOutcome::default()
        };
        let outcome = record.seen(true).answered(&said, names, &[]);
        JudgedWindow { window: row, truth, answer, outcome }
    }
}

/// The answer of a classifier for a held-out window.
struct JudgedWindow {
    window: usize,
    truth: u32,
    answer: Option<u32>,
    /// What it counts as. A value that is not the healthy one is a fault.
    outcome: RunOutcome,
}

impl RecordingStudy {
    /// The names of the files that the study writes.
    pub fn files_written(&self) -> Vec<String> {
        let targets = self.targets.iter().map(|target| diagnoser_file(&target.column));
        let novelty = self.novelty.as_ref().map(|_| NOVELTY.to_owned());
        FILES.map(String::from).into_iter().chain(targets).chain(novelty).collect()
    }

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
        let (targets, outcomes) = self.judge_targets(&prepared, workers)?;
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
        let recorded = |nominals| self.recorded(text, records, nominals);
        let mut diagnosers = vec![];
        for target in &self.targets {
            let [trees, committee] = self.learn_target(target, windows, workers)?;
            let diagnoser =
                self.diagnoser([trees, committee], Novelty::none(), recorded(nominals.clone()))?;
            diagnosers.push((diagnoser_file(&target.column), diagnoser));
        }
        if let Some(known) = learned {
            let hierarchies = [known.trees.clone(), known.trees];
            let diagnoser = self.diagnoser(hierarchies, known.novelty, recorded(known.nominals))?;
            diagnosers.push((NOVELTY.into(), diagnoser));
        }
        let (study, windows) = (text.into(), data_set(&prepared)?);
        Ok(JudgedRecordings { study, results, windows, outcomes, diagnosers })
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
        let (groups, group) = in_order(joined(&windows.table, &self.groups)?);
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

    /// Judges every target with every classifier.
    fn judge_targets(
        &self,
        prepared: &Prepared,
        workers: Workers,
    ) -> Result<(Vec<TargetResult>, Table), RecordingError> {
        let windows = &prepared.windows.table;
        let (folds, fold_of): (Vec<usize>, _) =
            ((0..prepared.splits.len()).collect(), prepared.folds());
        let records = match &self.record {
            Some(record) => windows.text(record)?.to_vec(),
            None => vec![String::new(); windows.row_count()],
        };
        let mut results = vec![];
        let mut numbers: [Vec<u32>; 2] = Default::default();
        let mut texts: [Vec<String>; 6] = Default::default();
        for target in &self.targets {
            let labels = Labels::new(target, windows)?;
            for (classifier, settings) in self.classifiers() {
                let judge = |&fold: &usize| judge_fold(prepared, &labels, &settings, fold);
                let judged = parallel::map(&folds, workers, judge)?;
                let judged = judged.into_iter().collect::<Result<Vec<_>, RecordingError>>()?;
                let judged: Vec<JudgedWindow> = judged.into_iter().flatten().collect();
                for JudgedWindow { window, truth, answer, .. } in &judged {
                    let class = |class: u32| &*labels.classes[class as usize];
                    let answer = answer.map_or(FAULTY, class);
                    let group = &prepared.groups[prepared.group[*window] as usize];
                    let (record, name) = (&records[*window], classifier.id());
                    let row = [record, group, &target.column, name, class(*truth), answer];
                    texts.iter_mut().zip(row).for_each(|(column, text)| column.push(text.into()));
                    let places = [*window as u32, fold_of[*window]];
                    numbers.iter_mut().zip(places).for_each(|(column, place)| column.push(place));
                }
                results.push(result(prepared, &labels, classifier, &judged));
            }
        }
        let numbers = ["window", "fold"].into_iter().zip(numbers);
        let names = ["record", "group", "target", "classifier", "truth", "answer"];
        let numbers = numbers.map(|(name, values)| Column::new(name, "", values));
        let texts = names.into_iter().zip(texts).map(|(name, text)| Column::new(name, "", text));
        Ok((results, Table::from_columns(numbers.chain(texts).collect())?))
    }

    /// The hierarchies of the first and of the last classifier, learned from all windows.
    fn learn_target(
        &self,
        target: &Target,
        windows: &Windows,
        workers: Workers,
    ) -> Result<[Hierarchy; 2], RecordingError> {
        let labels = Labels::new(target, &windows.table)?;
        let examples = labels.examples(windows)?;
        let rows = labels.known(&(0..labels.of_window.len()).collect::<Vec<_>>());
        let learn = |settings| fit_stages(&examples, settings, &rows, Scope::Action, workers);
        let classifiers: Vec<_> = self.classifiers().collect();
        let [(_, first), .., (_, last)] = classifiers.as_slice() else {
            let only = learn(&classifiers[0].1)?;
            return Ok([only.clone(), only]);
        };
        Ok([learn(first)?, learn(last)?])
    }

    /// The classifiers with their usual settings; a tree has those of the trees of a simulated study.
    fn classifiers(&self) -> impl Iterator<Item = (ClassifierKind, HierarchySettings)> {
        let known = |word: &String| ALL.iter().find(|kind| kind.id() == *word);
        self.classifiers.iter().filter_map(known).map(|kind| (*kind, settings(*kind)))
    }
}

/// How a target is learned: the classifier decides all, for every fault has the same action.
pub(super) fn settings(kind: ClassifierKind) -> HierarchySettings {
    let mut settings = HierarchySettings { mirror: false, pool: false, ..Default::default() };
    if kind != ClassifierKind::Cart {
        settings.actuator = classifiers::Settings::default_of(kind);
    }
    settings
}

/// The file of the novelty.
const NOVELTY: &str = "diagnoser-novelty.json";

/// The file of a target.
fn diagnoser_file(column: &str) -> String {
    let letter = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    format!("diagnoser-of-{}.json", column.chars().map(letter).collect::<String>())
}

fn judge_fold(
    prepared: &Prepared,
    labels: &Labels,
    settings: &HierarchySettings,
    fold: usize,
) -> Result<Vec<JudgedWindow>, RecordingError> {
    let (windows, split) = (prepared.of_fold(fold), &prepared.splits[fold]);
    let (test, train) = (labels.known(&split.test), labels.known(&split.train));
    if test.is_empty() {
        return Ok(vec![]);
    }
    let examples = labels.examples(windows)?;
    let hierarchy = fit_stages(&examples, settings, &train, Scope::Action, Workers::new(1))?;
    let answers = ask(&examples, &hierarchy, &test)?;
    Ok(answers.into_iter().map(|own| labels.judged(own, examples.names())).collect())
}

fn result(
    prepared: &Prepared,
    labels: &Labels,
    classifier: ClassifierKind,
    judged: &[JudgedWindow],
) -> TargetResult {
    // Without groups, the windows of a fold depend on each other.
    let is_grouped = prepared.groups.len() > 1;
    let clusters = if is_grouped { prepared.group.clone() } else { prepared.folds() };
    let answers = Answers { has_several: false, has_shutdown: false };
    let rates = |choice: &dyn Fn(&JudgedWindow) -> bool| {
        let chosen = judged.iter().filter(|own| choice(own));
        let outcomes: Vec<&RunOutcome> = chosen.map(|own| &own.outcome).collect();
        Rates::count((OF_WINDOWS, 0.0), answers, &outcomes, |own| {
            let cluster = clusters[own.number as usize];
            Some((cluster, cluster))
        })
    };
    let classes =
        labels.classes.iter().zip(0..).map(|(name, class)| {
            (name.clone(), rates(&|own| own.truth == class).of(&RIGHT_ANSWER))
        });
    TargetResult {
        column: labels.target.column.clone(),
        classifier,
        unlabeled: labels.of_window.iter().filter(|class| class.is_none()).count(),
        rates: rates(&|_| true),
        classes: classes.collect(),
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
    /// Writes [`RecordingStudy::files_written`] and the text of the study, `study.toml`, into a folder.
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
        write_text(folder.study(), &self.study)?;
        let [windows, outcomes, results] = FILES.map(|name| folder.path().join(name));
        for (path, table) in [(windows, &self.windows), (outcomes, &self.outcomes)] {
            table.write(path).map_err(EvaluationError::from)?;
        }
        for (name, diagnoser) in &self.diagnosers {
            model_file::write_model(folder.path().join(name), diagnoser)?;
        }
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
