//! `data-card.md`: what the data sets of a folder are, how they were made, and how to use them.
//!
//! The card is written with the data sets and states only what stands in them and in the study. It has no date, so the
//! same study gives the same bytes.

use super::folder::write_text;
use super::{Folder, JobError};
use crate::learn::EvaluationError;
use crate::manifest::sha256_of_text;
use crate::records::FOLDS;
use crate::records::columns::is_feature_column;
use crate::study::{Purpose, Scenario, Study};
use crate::table::parquet::ParquetReader;
use crate::table::{ColumnKind, Table, TableError};
use std::collections::BTreeMap;
use std::fmt::Write;

/// The columns that the card counts.
const COUNTED: [&str; 6] = ["kind", "action", "detail", "split", "fold", "failure"];

/// Writes the card of the folder's data sets. A folder without data sets gets none.
///
/// # Errors
/// A data set cannot be read, or the card cannot be written.
pub fn write(folder: &Folder, study: &Study) -> Result<(), JobError> {
    let mut files = vec![];
    for scenario in Scenario::ALL {
        for purpose in Purpose::OF_RECORDS {
            let path = folder.data_set(scenario, purpose);
            if path.exists() {
                let counted = DataFile::count(folder, scenario, purpose);
                let wrong =
                    |error| JobError::DataSet { path, error: EvaluationError::Table(error) };
                files.push(counted.map_err(wrong)?);
            }
        }
    }
    match files.is_empty() {
        true => Ok(()),
        false => write_text(&folder.data_card(), &text(study, &files)),
    }
}

/// A data set with its counts.
struct DataFile {
    name: String,
    scenario: Scenario,
    columns: Table,
    rows: usize,
    failed: usize,
    /// Rows by action, detail and kind.
    classes: BTreeMap<[String; 3], usize>,
    /// Rows by split.
    splits: BTreeMap<String, usize>,
    folds: [usize; FOLDS],
}

impl DataFile {
    fn count(folder: &Folder, scenario: Scenario, purpose: Purpose) -> Result<Self, TableError> {
        let path = folder.data_set(scenario, purpose);
        let mut file = DataFile {
            name: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            scenario,
            columns: ParquetReader::open(&path)?.schema().clone(),
            rows: 0,
            failed: 0,
            classes: BTreeMap::new(),
            splits: BTreeMap::new(),
            folds: [0; FOLDS],
        };
        // Read in parts: there may be millions of rows.
        for part in ParquetReader::open_columns(&path, &COUNTED)? {
            file.add(&part?)?;
        }
        Ok(file)
    }

    fn add(&mut self, part: &Table) -> Result<(), TableError> {
        let [kinds, actions, details, splits, reasons] =
            ["kind", "action", "detail", "split", "failure"].map(|name| part.text(name));
        let (kinds, actions, details) = (kinds?, actions?, details?);
        let (splits, reasons, folds) = (splits?, reasons?, part.u32("fold")?);
        for row in 0..part.row_count() {
            self.rows += 1;
            self.failed += usize::from(!reasons[row].is_empty());
            let class = [&actions[row], &details[row], &kinds[row]].map(Clone::clone);
            *self.classes.entry(class).or_default() += 1;
            *self.splits.entry(splits[row].clone()).or_default() += 1;
            self.folds[folds[row] as usize % FOLDS] += 1;
        }
        Ok(())
    }
}

fn text(study: &Study, files: &[DataFile]) -> String {
    let mut out = format!("# Data card: {}\n\n", study.title);
    out += "The data sets hold features of simulated sensor residuals of an actuator, one row for each run.\n\
        Every run is healthy or has one fault, and three labels name the actuator, the required action and the \
        faulty component.\n\
        They serve to train and compare methods of fault detection and isolation.\n\n";
    origin(&mut out, study, files);
    list_files(&mut out, files);
    list_classes(&mut out, files);
    explain_split(&mut out, study, files);
    list_columns(&mut out, files);
    out + LIMITS + &citation(study)
}

fn origin(out: &mut String, study: &Study, files: &[DataFile]) {
    let system = &study.system;
    let needs_full = study.is_full && study.has_quick_size();
    let command = match (needs_full, files.iter().any(|file| !file.scenario.is_usual())) {
        (true, false) => "servotwin study STUDY --suite records --full --out FOLDER",
        (false, false) => "servotwin study STUDY --suite records --out FOLDER",
        (true, true) => {
            "servotwin study STUDY --suite records --full --scenario SCENARIO --out FOLDER"
        }
        (false, true) => "servotwin study STUDY --suite records --scenario SCENARIO --out FOLDER",
    };
    let facts = [
        ("study", format!("`{}`", study.name)),
        ("system", format!("`{}`: {}", system.name, system.title)),
        ("SHA-256 of `study.toml`", format!("`{}`", sha256_of_text(&study.text))),
        ("SHA-256 of `system.toml`", format!("`{}`", sha256_of_text(&system.text))),
        ("equations and parameters", format!("`{:016x}`", system.program.identity())),
        ("program", format!("servotwin {}", env!("CARGO_PKG_VERSION"))),
        ("command", format!("`{command}`")),
        ("seed of everything drawn", study.seed.to_string()),
        ("sampling", format!("{} Hz", 1.0 / study.sample_period_s)),
        ("length of a judged run", format!("{} s", study.duration_s)),
    ];
    *out += "## How they were made\n\n| fact | value |\n|---|---|\n";
    facts.iter().for_each(|(fact, value)| add(out, format_args!("| {fact} | {} |\n", cell(value))));
    *out += "\nThe same study and version give the same bytes on any machine and any number of threads.\n\n";
}

fn list_files(out: &mut String, files: &[DataFile]) {
    *out += "## Files\n\n| file | plant | rows | columns | failed rows |\n|---|---|---|---|---|\n";
    for file in files {
        let DataFile { name, rows, failed, .. } = file;
        let (plant, columns) = (plant(file.scenario), file.columns.columns().len());
        add(out, format_args!("| `{name}` | {plant} | {rows} | {columns} | {failed} |\n"));
    }
    *out += "\nA failed row has a text in `failure` and covers only the time before it.\n\n";
}

fn plant(scenario: Scenario) -> &'static str {
    match scenario {
        Scenario::Ideal => "the twin with a fault, perfect sensors",
        Scenario::Noise => "the twin with a fault, noisy sensors",
        Scenario::Fitted => "specimens of a pool, each beside a twin that was fitted to it",
        Scenario::Realistic => "a new specimen in every row, beside the nominal twin",
    }
}

fn list_classes(out: &mut String, files: &[DataFile]) {
    let mut classes: Vec<&[String; 3]> = files.iter().flat_map(|f| f.classes.keys()).collect();
    classes.sort();
    classes.dedup();
    let names: String = files.iter().map(|file| format!(" `{}` |", file.name)).collect();
    let rule = "---|".repeat(3 + files.len());
    add(out, format_args!("## Classes\n\n| `action` | `detail` | `kind` |{names}\n|{rule}\n"));
    for class in classes {
        let [action, detail, kind] = class;
        let counts = files.iter().map(|file| file.classes.get(class).copied().unwrap_or(0));
        let counts: String = counts.map(|count| format!(" {count} |")).collect();
        let labels = [action, detail, kind].map(|label| cell(label));
        add(out, format_args!("| {} |{counts}\n", labels.join(" | ")));
    }
    *out += "\nThe counts follow from the fault list of the study, not from how often a fault occurs in service.\n\n";
}

fn explain_split(out: &mut String, study: &Study, files: &[DataFile]) {
    *out += "## Recommended split\n\n";
    *out += match study.cases_of(Purpose::Train).is_empty() {
        false => {
            "Train on rows with `split` = `train` and test on rows with `split` = `test`.\n\
             This is the protocol *new command* of the report: no command stands on both sides.\n"
        }
        true => {
            "Train on rows with `split` = `train` and test on rows with `split` = `test`.\n\
             The study has no training commands, so fold 0 tests and the other folds train.\n"
        }
    };
    *out += "To test on faults that training has not seen at their intensity, hold out one value of `fold` on both \
        sides.\n\
        All rows of a kind of fault at an intensity have the same fold in every file, in both actuators and under \
        every command.\n\
        Healthy rows of one specimen have the same fold.\n\
        In `fitted` a specimen also flies faults of other folds; group by `specimen` to keep plants apart.\n\
        Do not split rows at random: a copy of nearly every row would stand on both sides.\n\n";
    let folds: String = (0..FOLDS).map(|fold| format!(" fold {fold} |")).collect();
    let rule = "---|".repeat(3 + FOLDS);
    add(out, format_args!("| file | `train` | `test` |{folds}\n|{rule}\n"));
    for file in files {
        let of = |split: &str| file.splits.get(split).copied().unwrap_or(0);
        let folds: String = file.folds.iter().map(|count| format!(" {count} |")).collect();
        add(out, format_args!("| `{}` | {} | {} |{folds}\n", file.name, of("train"), of("test")));
    }
    out.push('\n');
}

fn list_columns(out: &mut String, files: &[DataFile]) {
    *out += "## Columns\n\n\
        Unit and description also stand in the metadata of each Parquet field, under `unit` and `description`.\n\
        Numbers without a dimension have the unit 1; text and truth values have no unit.\n\
        Only columns that begin with `f:`, `m:`, `m3:` and so on are features.\n\
        All others hold the answer or describe the simulation, and a classifier must not read them.\n\
        A column `m:NAME` is the feature `f:NAME` with actuator 2 in first place, `m3:NAME` with actuator 3.\n\n\
        | column | type | unit | description |\n|---|---|---|---|\n";
    let mut known: Vec<&str> = vec![];
    for column in files.iter().flat_map(|file| file.columns.columns()) {
        let is_other_view = is_feature_column(&column.name) && !column.name.starts_with("f:");
        if is_other_view || known.contains(&column.name.as_str()) {
            continue;
        }
        known.push(&column.name);
        let kind = match column.values.kind() {
            ColumnKind::Float => "f64",
            ColumnKind::Integer => "i64",
            ColumnKind::Unsigned => "u32",
            ColumnKind::Flag => "bool",
            ColumnKind::Text => "text",
        };
        let [name, unit, what] = [&column.name, &column.unit, &column.description].map(|t| cell(t));
        add(out, format_args!("| `{name}` | {kind} | {unit} | {what} |\n"));
    }
    *out += "\n```python\nimport pyarrow.parquet as pq\n\n\
        table = pq.read_table(\"";
    *out += &files[0].name;
    *out += "\")\nunits = {f.name: (f.metadata or {}).get(b\"unit\", b\"\").decode() for f in table.schema}\n```\n\n";
}

const LIMITS: &str = "## Known biases and limits\n\n\
    - Every value is simulated. No hardware was measured, and a result on these data is no result on hardware.\n\
    - The plants obey the same equations as their twin. Only parameters and sensors differ, and only by the \
    tolerances of the study.\n\
    - Every faulty row has exactly one fault, at constant intensity from the start of the run.\n\
    - All intensities and all kinds are equally frequent. Priors of service must come from elsewhere.\n\
    - The runs of one fault differ only by command, load and specimen, so rows are not independent. Intervals need \
    clusters by kind and intensity.\n\
    - Without tolerances, a fault of one of several like actuators gives the signals of the same fault of another one, \
    exchanged. Such rows are no new evidence.\n\
    - Faults of low intensity may be invisible. `detectable` marks the visible ones, by the paper's band of 3 %.\n\n";

fn citation(study: &Study) -> String {
    format!(
        "## License and citation\n\n\
         The data are under the license of the program: {}.\n\
         Cite the program, its version, the study and its SHA-256: \
         *servotwin {}, study {}, study.toml {}*.\n",
        env!("CARGO_PKG_LICENSE"),
        env!("CARGO_PKG_VERSION"),
        study.name,
        sha256_of_text(&study.text),
    )
}

/// A text as a cell of a Markdown table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace(['\n', '\r'], " ")
}

fn add(out: &mut String, line: std::fmt::Arguments) {
    out.write_fmt(line).expect("a string takes every text");
}
