//! `servotwin study`, `watch` and `export` of recordings: learns targets and novelty from the windows of measured
//! records, answers for those of a new one, and writes the trees as C.

use super::StudyOptions;
use super::features::{read_recording_study, remarks};
use super::read_table;
use super::workers;
use crate::Global;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::{Side, TextTable, json, number};
use serde_json::json;
use servotwin::evaluation::EvaluationError;
use servotwin::evaluation::metrics::Rate;
use servotwin::files;
use servotwin::recordings::RecordingError;
use servotwin::recordings::judged::{FILES, RecordingResults, TargetResult};
use servotwin::recordings::model::{Answers, FORMAT, RecordingModel};
use servotwin::recordings::novelty::NoveltyResult;
use servotwin_export::recording;
use servotwin_report::words::percent;
use std::io::Read;
use std::path::Path;

/// Returns the text for standard output.
pub(crate) fn run(path: &Path, options: &StudyOptions, global: Global) -> Result<String, Failure> {
    if options.full {
        return Err(Failure::Options("--full: a study of recordings has one size"));
    }
    let in_study = |error: RecordingError| match error {
        RecordingError::Evaluation(error @ EvaluationError::Cancelled) => error.into(),
        error => Failure::Recording { path: path.into(), error },
    };
    let out = options.folder();
    let text = files::read_document(path)?;
    let study = read_recording_study(path)?;
    let written = FILES.map(|name| out.path().join(name)).into_iter().filter(|file| file.exists());
    let folder = path.parent().unwrap_or(Path::new(""));
    let read = study.files().map(|file| folder.join(file));
    Paths::default().read("the records", read).write("--out", Format::Any, written).check()?;
    let records = study.read(folder).map_err(in_study)?;
    let judged = study.judge(&text, &records, workers(options.threads)).map_err(in_study)?;
    judged.write(&out)?;
    let results = &judged.results;
    Ok(match global {
        Global { json: true, .. } => json(&json!(results)),
        Global { quiet: true, .. } => String::new(),
        _ => in_words(results) + &format!("{}\n", out.path().join("recordings.json").display()),
    })
}

/// The verdicts, what they are based on, and the figures of every class and group.
fn in_words(results: &RecordingResults) -> String {
    let mut text: String = results.targets.iter().map(verdict).collect();
    text += &results.novelty.as_ref().map_or(String::new(), of_novelty);
    let RecordingResults { rows, windows, features, split, .. } = results;
    text += &format!("{rows} rows, {windows} windows of {features} features; {split}\n");
    text += &remarks(results.left_over_rows, results.incomplete_rows, &results.nominals);
    if !results.targets.is_empty() {
        text += &format!("\n{}", classes(&results.targets));
    }
    if let Some(novelty) = &results.novelty {
        text += &format!("\n{}", groups(novelty));
    }
    text + "\n"
}

/// How often a classifier is right, in one sentence.
fn verdict(target: &TargetResult) -> String {
    let TargetResult { column, classifier, score, false_alarms, missed, .. } = target;
    let accuracy = score.accuracy;
    let (low, high) = (percent(Some(accuracy.low)), percent(Some(accuracy.high)));
    let health = false_alarms.zip(*missed).map_or(String::new(), |(alarms, missed)| {
        format!(
            "; {} of healthy windows are false alarms, {} of the others are missed",
            share(alarms),
            share(missed)
        )
    });
    format!(
        "{column}: {} answers {} held-out windows right (95 % interval {low} to {high}){health}\n",
        classifier.id(),
        share(accuracy),
    )
}

/// `99.1 % (218 of 220)`.
fn share(rate: Rate) -> String {
    format!("{} ({} of {})", percent(rate.share), rate.count, rate.of)
}

fn of_novelty(novelty: &NoveltyResult) -> String {
    let learned = novelty.groups.iter().filter(|group| group.is_learned).count();
    format!(
        "novelty: unlike the first {learned} healthy groups are {} of the windows of later healthy groups, which are \
         false alarms, and {} of the others\n",
        share(novelty.false_alarms),
        share(novelty.alarms)
    )
}

/// The windows of every class, and how many of them each classifier answers right.
fn classes(targets: &[TargetResult]) -> String {
    let mut table = TextTable::new(&[
        ("target", Side::Left),
        ("class", Side::Left),
        ("by", Side::Left),
        ("windows", Side::Right),
        ("right", Side::Right),
        ("share", Side::Right),
    ]);
    for target in targets {
        for (class, name) in target.score.classes.iter().enumerate() {
            let counts = &target.score.confusion[class];
            let rate = Rate::new(counts[class], counts.iter().sum());
            table.push(vec![
                target.column.clone(),
                name.clone(),
                target.classifier.id().into(),
                rate.of.to_string(),
                rate.count.to_string(),
                percent(rate.share),
            ]);
        }
    }
    table.text()
}

/// The novelty of every group in its order.
fn groups(novelty: &NoveltyResult) -> String {
    let mut table = TextTable::new(&[
        ("group", Side::Left),
        ("", Side::Left),
        ("windows", Side::Right),
        ("unlike", Side::Right),
        ("share", Side::Right),
        ("mean distance", Side::Right),
    ]);
    for group in &novelty.groups {
        let state = match (group.is_healthy, group.is_learned) {
            (_, true) => "healthy, learned",
            (true, false) => "healthy",
            (false, false) => "",
        };
        table.push(vec![
            group.group.clone(),
            state.into(),
            group.unknown.of.to_string(),
            group.unknown.count.to_string(),
            percent(group.unknown.share),
            number(group.mean_distance, 3),
        ]);
    }
    table.text()
}

/// Whether a file holds the model of a study of recordings.
pub(crate) fn is_model(path: &Path) -> bool {
    let mut begin = vec![];
    let read = files::open(path).map(|file| file.take(200).read_to_end(&mut begin));
    matches!(read, Ok(Ok(_))) && String::from_utf8_lossy(&begin).contains(FORMAT)
}

/// Answers for the windows of a log. Returns the text for standard output.
pub(crate) fn watch(log: &Path, model: &Path, global: Global) -> Result<String, Failure> {
    let known = RecordingModel::read(model)?;
    let answers = known.answer(&read_table(log, global)?);
    let answers = answers.map_err(|error| Failure::Recording { path: log.into(), error })?;
    let (starts, rows) = (&answers.windows.starts, answers.windows.rows);
    if global.json {
        let window = |place: usize| {
            let told =
                answers.targets.iter().map(|(column, said)| (column.clone(), json!(said[place])));
            json!({
                "first_row": starts[place] + 1, "rows": rows,
                "answers": told.collect::<serde_json::Map<_, _>>(),
                "distance": answers.distances.as_ref().map(|distances| distances[place]),
            })
        };
        return Ok(json(&(0..starts.len()).map(window).collect()));
    }
    if global.quiet {
        return Ok(String::new());
    }
    let said: Vec<String> = (0..starts.len()).map(|place| answer(&answers, place)).collect();
    let mut text = String::new();
    let mut place = 0;
    for same in said.chunk_by(|a, b| a == b) {
        let (first, last) = (starts[place], starts[place + same.len() - 1] + rows);
        text += &format!("rows {} to {last}: {}\n", first + 1, same[0]);
        place += same.len();
    }
    Ok(text + &remarks(answers.windows.left_over, answers.windows.incomplete, &[]))
}

/// Writes the trees of a model as C. Returns the text for standard output.
pub(crate) fn export(model: &Path, out: &Path, global: Global) -> Result<String, Failure> {
    let sources = recording::files(&RecordingModel::read(model)?)?;
    files::create_folder(out)?;
    for source in &sources {
        files::write_atomically(out.join(source.name), |file| {
            file.write_all(source.text.as_bytes())
        })?;
    }
    Ok(match global {
        Global { json: true, .. } => json(&json!({ "files": sources.map(|source| source.name) })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{}: the trees of {}\n", out.display(), model.display()),
    })
}

/// What a window is, in words.
fn answer(answers: &Answers, window: usize) -> String {
    let targets = answers.targets.iter().map(|(column, said)| format!("{column} {}", said[window]));
    let novelty = answers.distances.as_ref().map(|distances| match distances[window] > 1.0 {
        true => "unlike the healthy records".to_owned(),
        false => "like the healthy records".to_owned(),
    });
    targets.chain(novelty).collect::<Vec<_>>().join(", ")
}
