//! `servotwin study`, `watch` and `export` of recordings: learns targets and novelty from the windows of measured
//! records, answers for those of a new one, and writes the trees as C.

use super::features::{read_recording_study, remarks};
use super::{StudyOptions, read_table, workers};
use crate::Global;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use servotwin::files;
use servotwin::learn::metrics::Rate;
use servotwin::recordings::judged::{FILES, RecordingResults, TargetResult};
use servotwin::recordings::model::{Answers, FORMAT, RecordingModel};
use servotwin::recordings::novelty::NoveltyResult;
use servotwin_export::recording;
use servotwin_report::words::{percent, share_of};
use servotwin_view::document::{Document, Line, Table, Value, Verdict, line};
use servotwin_view::row;
use std::io::Read;
use std::path::Path;

/// Learns and judges a study of recordings.
pub(crate) fn run(path: &Path, options: &StudyOptions) -> Result<Document, Failure> {
    if options.full {
        return Err(Failure::option("--full", "a study of recordings has one size"));
    }
    let in_study = |error| Failure::of_recordings(path, error);
    let out = options.folder();
    let text = files::read_toml(path)?;
    let study = read_recording_study(path)?;
    let written = FILES.map(|name| out.path().join(name)).into_iter().filter(|file| file.exists());
    let folder = path.parent().unwrap_or(Path::new(""));
    let read = study.files().map(|file| folder.join(file));
    Paths::default().read("the records", read).write("--out", Format::Any, written).check()?;
    let records = study.read(folder).map_err(in_study)?;
    let judged = study.judge(&text, &records, workers(options.threads)).map_err(in_study)?;
    judged.write(&out)?;
    let mut document = described(&judged.results);
    document.files([out.path().join("recordings.json")]);
    Ok(document)
}

/// The verdicts, what they are based on, and the figures of every class and group.
fn described(results: &RecordingResults) -> Document {
    let novelty = results.novelty.as_ref().map(of_novelty);
    let mut verdicts = results.targets.iter().map(verdict).chain(novelty);
    let first = verdicts.next().unwrap_or_default();
    let mut document = Document::new("recordings", Verdict::neutral(first));
    verdicts.for_each(|line| _ = document.text(line));
    let RecordingResults { rows, windows, features, split, .. } = results;
    document.text(line(
        "{rows} rows, {windows} windows of {features} features; {split}",
        [
            ("rows", Value::of(rows.to_string(), rows)),
            ("windows", Value::of(windows.to_string(), windows)),
            ("features", Value::of(features.to_string(), features)),
            ("split", Value::of(split.to_string(), split)),
        ],
    ));
    remarks(&mut document, results.left_over_rows, results.incomplete_rows, &results.nominals);
    document.table("classes", classes(&results.targets));
    document.table("groups", results.novelty.as_ref().map(groups).unwrap_or_default());
    document.data("results", results);
    document
}

/// How often a classifier is right, in one sentence.
fn verdict(target: &TargetResult) -> Line {
    let TargetResult { column, classifier, score, false_alarms, missed, .. } = target;
    let accuracy = score.accuracy;
    let (low, high) = (percent(Some(accuracy.low)), percent(Some(accuracy.high)));
    let health = false_alarms.zip(*missed).map_or(String::new(), |(alarms, missed)| {
        format!(
            "; {} of healthy windows are false alarms, {} of the others are missed",
            share_of(alarms).text,
            share_of(missed).text
        )
    });
    let text = format!(
        "{column}: {} answers {} held-out windows right (95 % interval {low} to {high}){health}",
        classifier.id(),
        share_of(accuracy).text,
    );
    text.into()
}

fn of_novelty(novelty: &NoveltyResult) -> Line {
    let learned = novelty.groups.iter().filter(|group| group.is_learned).count();
    let text = format!(
        "novelty: unlike the first {learned} healthy groups are {} of the windows of later healthy groups, which are \
         false alarms, and {} of the others",
        share_of(novelty.false_alarms).text,
        share_of(novelty.alarms).text
    );
    text.into()
}

/// The windows of every class, and how many of them each classifier answers right.
fn classes(targets: &[TargetResult]) -> Table {
    let mut table = Table::of("target | class | by | right");
    for target in targets {
        for (class, name) in target.score.classes.iter().enumerate() {
            let counts = &target.score.confusion[class];
            let rate = Rate::new(counts[class], counts.iter().sum());
            table.push(row![&target.column, name, target.classifier.id(), share_of(rate)]);
        }
    }
    table
}

/// The novelty of every group in its order.
fn groups(novelty: &NoveltyResult) -> Table {
    let mut table = Table::of("group | state:_ | unlike | mean_distance");
    for group in &novelty.groups {
        let state = match (group.is_healthy, group.is_learned) {
            (_, true) => "healthy, learned",
            (true, false) => "healthy",
            (false, false) => "",
        };
        let distance = Value::digits(group.mean_distance, 3);
        table.push(row![&group.group, state, share_of(group.unknown), distance]);
    }
    table
}

/// Whether a file holds the model of a study of recordings.
pub(crate) fn is_model(path: &Path) -> bool {
    let mut begin = vec![];
    let read = files::open(path).map(|file| file.take(200).read_to_end(&mut begin));
    matches!(read, Ok(Ok(_))) && String::from_utf8_lossy(&begin).contains(FORMAT)
}

/// Answers for the windows of a log. Windows that follow each other with the same answer are one row for people.
pub(crate) fn watch(log: &Path, model: &Path, global: Global) -> Result<Document, Failure> {
    let known = RecordingModel::read(model)?;
    let answers = known.answer(&read_table(log, global)?);
    let answers = answers.map_err(|error| Failure::of_recordings(log, error))?;
    let (starts, rows) = (&answers.windows.starts, answers.windows.rows);
    let answered: Vec<String> = (0..starts.len()).map(|place| answer(&answers, place)).collect();
    let verdict = format!("{}: answers for {} windows", log.display(), starts.len());
    let mut document = Document::listing("watch", verdict);
    let mut place = 0;
    let lines = answered.chunk_by(|a, b| a == b).map(|same| {
        let (first, last) = (starts[place], starts[place + same.len() - 1] + rows);
        place += same.len();
        format!("rows {} to {last}: {}", first + 1, same[0])
    });
    let lines: Vec<String> = lines.collect();
    document.list("answers", lines);
    let mut windows = Table::of("first_row: | rows: | distance:");
    for (column, _) in &answers.targets {
        windows.column(format!("answer:{column}"), "");
    }
    for (place, start) in starts.iter().enumerate() {
        let distance = answers.distances.as_ref().map(|distances| distances[place]);
        let mut row = row![start + 1, rows, Value::of("", &distance)];
        row.extend(answers.targets.iter().map(|(_, own)| Value::of("", &own[place])));
        windows.push(row);
    }
    document.table("windows", windows);
    remarks(&mut document, answers.windows.left_over, answers.windows.incomplete, &[]);
    Ok(document)
}

/// Writes the trees of a model as C.
pub(crate) fn export(model: &Path, out: &Path) -> Result<Document, Failure> {
    let sources = recording::files(&RecordingModel::read(model)?)?;
    files::create_folder(out)?;
    for source in &sources {
        files::write_atomically(out.join(source.name), |file| {
            file.write_all(source.text.as_bytes())
        })?;
    }
    let values = [("folder", out.into()), ("model", model.into())];
    let verdict = Verdict::good(line("{folder}: the trees of {model}", values));
    let mut document = Document::new("export", verdict);
    document.files(sources.map(|source| source.name)).detail();
    Ok(document)
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
