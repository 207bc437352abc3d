//! `servotwin study`, `watch` and `export` of recordings: learns targets and novelty from the windows of measured
//! records, judges those of a new one, and writes the trees as C.

use super::features::read_recording_study;
use super::{StudyOptions, read_table, workers};
use crate::Global;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use servotwin::files;
use servotwin::measure::{FALSE_ALARM, RIGHT_ANSWER, SILENT};
use servotwin::recordings::judged::{RecordingResults, TargetResult};
use servotwin::recordings::novelty::NoveltyResult;
use servotwin::recordings::{Answers, NominalFit, NominalSource};
use servotwin::text::number;
use servotwin::toml_text::counted;
use servotwin_diagnosis::diagnoser::{Diagnoser, Recorded};
use servotwin_export::recording;
use servotwin_report::words::{percent, share_of};
use servotwin_view::document::{Document, Line, Table, Value, Verdict, line};
use servotwin_view::row;
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
    let written = study.files_written().into_iter().map(|name| out.path().join(name));
    let written = written.filter(|file| file.exists());
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
    let TargetResult { column, classifier, rates, .. } = target;
    let accuracy = rates.of(&RIGHT_ANSWER);
    let (low, high) = (percent(Some(accuracy.low)), percent(Some(accuracy.high)));
    let health = rates.counted(&FALSE_ALARM).zip(rates.counted(&SILENT));
    let health = health.map_or(String::new(), |(alarms, missed)| {
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
        for (name, right) in &target.classes {
            table.push(row![&target.column, name, target.classifier.id(), share_of(*right)]);
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

/// Judges the windows of a log. Windows that follow each other with the same finding are one row for people.
pub(crate) fn watch(
    log: &Path,
    (diagnoser, recorded): (&Diagnoser, &Recorded),
    global: Global,
) -> Result<Document, Failure> {
    let answers = Answers::of(diagnoser, recorded, &read_table(log, global)?);
    let Answers { windows, findings, distances } =
        answers.map_err(|error| Failure::of_recordings(log, error))?;
    let (starts, rows) = (&windows.starts, windows.rows);
    let verdict = format!("{}: findings in {} windows", log.display(), starts.len());
    let mut document = Document::listing("watch", verdict);
    let mut place = 0;
    let lines = findings.chunk_by(|a, b| a == b).map(|same| {
        let (first, last) = (starts[place], starts[place + same.len() - 1] + rows);
        place += same.len();
        format!("rows {} to {last}: {}", first + 1, diagnoser.describe(same[0]))
    });
    document.list("findings", lines.collect::<Vec<_>>());
    let mut table = Table::of("first_row: | rows: | finding: | distance:");
    for ((start, finding), distance) in starts.iter().zip(&findings).zip(&distances) {
        let finding = Value::of("", &diagnoser.describe(*finding));
        table.push(row![start + 1, rows, finding, Value::of("", distance)]);
    }
    document.table("windows", table);
    remarks(&mut document, windows.left_over, windows.incomplete, &[]);
    Ok(document)
}

/// Writes the trees of a diagnoser as C.
pub(crate) fn export(
    (diagnoser, model): (&Diagnoser, &Path),
    out: &Path,
) -> Result<Document, Failure> {
    let sources = recording::files(diagnoser)?;
    files::create_folder(out)?;
    for source in &sources {
        files::write_text(out.join(source.name), &source.text)?;
    }
    let values = [("folder", out.into()), ("model", model.into())];
    let verdict = Verdict::good(line("{folder}: the trees of {model}", values));
    let mut document = Document::new("export", verdict);
    document.files(sources.iter().map(|source| source.name)).detail();
    Ok(document)
}

/// What the windows do not show: rows that are not used, and how well nominal values fit.
fn remarks(document: &mut Document, left_over: usize, incomplete: usize, fits: &[NominalFit]) {
    let rows = |count| Value::of(counted(count, "row"), &count);
    document.fact("left_over_rows", "beyond whole windows, not used", rows(left_over));
    document.fact("incomplete_rows", "without a number of every sensor", rows(incomplete));
    let mut table = Table::of(
        "sensor | source:nominal value | rows:healthy rows | deviation:remaining deviation | r2:R²",
    );
    for NominalFit { sensor, source, rows, deviation, r2 } in fits {
        let (how, r2) = match source {
            NominalSource::Column(name) => (format!("the column {name}"), *r2),
            NominalSource::Regression(inputs, conditions) => {
                let (how, r2) = match inputs.as_slice() {
                    [] => ("the mean".into(), None),
                    inputs => (format!("a regression on {}", inputs.join(", ")), *r2),
                };
                match conditions {
                    1 => (how, r2),
                    more => (format!("{how} in each of {more} conditions"), r2),
                }
            }
        };
        let r2 = r2.map(|r2| Value::number(r2, format!("{r2:.3}")));
        let deviation = Value::number(*deviation, number(*deviation, 3));
        table.push(row![sensor, Value::of(how, source), *rows, deviation, r2]);
    }
    document.table("nominals", table);
}
