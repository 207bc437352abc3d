//! The sheet: generated cells, those that people filled in, and how both survive the next generation.
//!
//! Every row carries a *seal*: a short hash of every generated cell, and of a number the number itself. A cell that no
//! longer fits its part of the seal was changed by a person. It keeps its text, and the column `filled_by_person` names it. A person's cell that is emptied is
//! generated again. So a sheet needs no file beside it and may travel. A program that only opens and saves the sheet changes
//! no hash, although it writes numbers in its own form and may know Windows-1252 alone.
//!
//! The column `basis` holds the hashes of system, study and model for which a person's cells were written. When they
//! change, the row's `status` becomes *stale* and stays so until a person writes `confirmed` into it. Generated cells
//! are never stale, because they are generated again; those of flights flown with another model say so.

use super::fields::{FIELDS, FmeaRow};
use crate::error::SafetyError;
use crate::rates::find_columns;
use crate::results::EvidenceBasis;
use servotwin::manifest::sha256_of_text;
use servotwin::table::csv::texts::{TextRow, Texts};
use servotwin::table::csv::{self, encoding::is_latin};
use servotwin::table::{Column, Table};
use std::path::Path;

/// The key of a row.
pub(crate) const FAULT: &str = "fault";
/// Whether a person's cells still fit the evidence.
pub const STATUS: &str = "status";
/// The fields that a person filled in.
pub(crate) const PERSON: &str = "filled_by_person";
/// What the row was made of.
pub(crate) const BASIS: &str = "basis";
/// Hashes of the generated cells.
pub const SEAL: &str = "seal";
/// The start of the columns with evidence.
pub(crate) const EVIDENCE: &str = "evidence: ";

/// The version of the seal: it changes with [`FIELDS`] and with what is hashed.
const SEAL_VERSION: &str = "3";
/// Digits of a hash in a seal.
const SEAL_DIGITS: usize = 6;
/// What a person writes into the status to accept a row for the present evidence.
pub(crate) const CONFIRMED: &str = "confirmed";

/// Whether a file's extension names a sheet.
///
/// # Errors
/// It does not.
pub fn check(path: &Path) -> Result<(), SafetyError> {
    match path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv")) {
        true => Ok(()),
        false => Err(SafetyError::SheetFormat { path: path.into() }),
    }
}

/// A row of the sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetRow {
    /// The fault's full name.
    pub fault: String,
    /// The text of every field, in the order of [`FIELDS`].
    pub texts: Vec<String>,
    /// The evidence of every field.
    pub evidence: Vec<String>,
    /// Which fields a person filled in.
    pub by_person: Vec<bool>,
    /// Whether the person's cells still fit the evidence, in words.
    pub status: String,
    /// Whether they do not.
    pub is_stale: bool,
    /// Number of cells without evidence that nobody filled in.
    pub missing: usize,
    basis: EvidenceBasis,
    seal: String,
    /// The cells of columns that a person added.
    pub others: Vec<String>,
}

/// The sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct FmeaSheet {
    /// The rows as they were generated; at the end those of faults that the system no longer has.
    pub rows: Vec<SheetRow>,
    /// The names of columns that a person added.
    pub other_columns: Vec<String>,
    /// The byte between two cells of a CSV file: that of the earlier sheet.
    pub separator: u8,
}

/// A sheet as it was read.
struct EarlierSheet {
    rows: Vec<EarlierRow>,
    other_columns: Vec<String>,
}

struct EarlierRow {
    fault: String,
    texts: Vec<String>,
    seal: Vec<String>,
    status: String,
    basis: Option<EvidenceBasis>,
    others: Vec<String>,
}

/// The hash of a text. A program for sheets that only saves it may change its spaces.
fn hash(text: &str) -> String {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    sha256_of_text(&text)[..SEAL_DIGITS].to_owned()
}

/// The seal of a generated text: a number as it is, behind `=`; of another text its hash, and the hash of what
/// Windows-1252 makes of it if that differs.
fn seal_of(text: &str) -> String {
    if text.parse::<f64>().is_ok() {
        return format!("={text}");
    }
    let replaced: String =
        text.chars().map(|letter| if is_latin(letter) { letter } else { '?' }).collect();
    match replaced == text {
        true => hash(text),
        false => format!("{}/{}", hash(text), hash(&replaced)),
    }
}

/// Whether a text is what a seal was made of, perhaps in the form in which a program for sheets saved it.
fn is_sealed(text: &str, seal: &str) -> bool {
    match seal.strip_prefix('=').and_then(|number| number.parse().ok()) {
        Some(number) => is_form_of(text, number),
        None => seal.split('/').any(|own| own == hash(text)),
    }
}

/// The fewest digits of a rounded number: programs for sheets show two behind the point, as in 1.85E-06. One with fewer
/// that is not equal is a person's estimate.
const MIN_SHOWN_DIGITS: usize = 3;

/// Whether a text is a number, perhaps with a decimal comma, rounded to the digits that the text has.
fn is_form_of(text: &str, number: f64) -> bool {
    let text = text.trim().replacen(',', ".", 1).to_ascii_lowercase();
    let Ok(written) = text.parse::<f64>() else { return false };
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let digits = mantissa.chars().filter(char::is_ascii_digit).skip_while(|digit| *digit == '0');
    let last = exponent.parse().unwrap_or(0) - decimals as i32;
    let is_rounded = digits.count() >= MIN_SHOWN_DIGITS
        && (written - number).abs() <= 0.5 * 10_f64.powi(last) * (1.0 + 1e-6);
    written == number || is_rounded
}

fn seal(row: &FmeaRow) -> String {
    let seals: Vec<String> = row.cells.iter().map(|cell| seal_of(&cell.text)).collect();
    format!("{SEAL_VERSION}: {}", seals.join(" "))
}

impl FmeaSheet {
    /// The sheet of generated rows, with the cells that people filled into an earlier one.
    ///
    /// # Errors
    /// The earlier sheet lacks a column or has a seal of another version.
    pub fn new(
        rows: &[FmeaRow],
        basis: &EvidenceBasis,
        earlier: Option<(&Path, &Texts)>,
    ) -> Result<Self, SafetyError> {
        let separator = earlier.map_or(b',', |(_, texts)| texts.separator);
        let earlier = match earlier {
            Some((path, texts)) => EarlierSheet::of(path, texts)?,
            None => EarlierSheet { rows: vec![], other_columns: vec![] },
        };
        let others = earlier.other_columns.len();
        let merged = |row: &FmeaRow| {
            let known = earlier.rows.iter().find(|known| known.fault == row.fault);
            SheetRow::merged(row, basis, known, others)
        };
        let mut sheet: Vec<SheetRow> = rows.iter().map(merged).collect();
        let is_gone = |known: &&EarlierRow| rows.iter().all(|row| row.fault != known.fault);
        sheet.extend(earlier.rows.iter().filter(is_gone).filter_map(EarlierRow::orphan));
        Ok(FmeaSheet { rows: sheet, other_columns: earlier.other_columns, separator })
    }

    /// The names of all columns, in their order.
    pub fn columns(&self) -> Vec<String> {
        let fields = FIELDS.iter().map(|field| field.name.to_owned());
        let mut names: Vec<String> = std::iter::once(FAULT.to_owned()).chain(fields).collect();
        names.extend(self.other_columns.iter().cloned());
        names.extend([STATUS, PERSON].map(str::to_owned));
        names.extend(FIELDS.iter().map(|field| format!("{EVIDENCE}{}", field.name)));
        names.extend([BASIS, SEAL].map(str::to_owned));
        names
    }

    /// Writes the sheet as CSV, whole or not at all.
    ///
    /// # Errors
    /// Two columns have the same name; the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), SafetyError> {
        let rows: Vec<Vec<String>> = self.rows.iter().map(SheetRow::cells).collect();
        let column =
            |(place, name): (usize, String)| Column::of(name, "", &rows, |row| row[place].clone());
        let columns = self.columns().into_iter().enumerate().map(column).collect();
        Ok(csv::write_sheet(path, &Table::from_columns(columns)?, self.separator)?)
    }

    /// The number of cells that a person filled in.
    pub fn person_cells(&self) -> usize {
        self.rows.iter().flat_map(|row| &row.by_person).filter(|by| **by).count()
    }

    /// The number of stale rows.
    pub fn stale_rows(&self) -> usize {
        self.rows.iter().filter(|row| row.is_stale).count()
    }
}

impl SheetRow {
    fn merged(
        row: &FmeaRow,
        basis: &EvidenceBasis,
        earlier: Option<&EarlierRow>,
        others: usize,
    ) -> Self {
        let by_person = match earlier {
            Some(earlier) => earlier.by_person(),
            None => vec![false; FIELDS.len()],
        };
        let of_person = |place: usize| earlier.filter(|_| by_person[place]);
        let text = |(place, cell): (usize, &super::cell::FmeaCell)| match of_person(place) {
            Some(earlier) => earlier.texts[place].clone(),
            None => cell.text.clone(),
        };
        let evidence = |(place, cell): (usize, &super::cell::FmeaCell)| match of_person(place) {
            Some(_) => "filled in by a person".to_owned(),
            None => cell.evidence.clone(),
        };
        let (status, is_stale, kept) = status(earlier, &by_person, basis);
        SheetRow {
            fault: row.fault.clone(),
            texts: row.cells.iter().enumerate().map(text).collect(),
            evidence: row.cells.iter().enumerate().map(evidence).collect(),
            status,
            is_stale,
            missing: row
                .cells
                .iter()
                .zip(&by_person)
                .filter(|(c, by)| c.is_missing && !**by)
                .count(),
            basis: kept,
            seal: seal(row),
            others: earlier.map_or_else(|| vec![String::new(); others], |e| e.others.clone()),
            by_person,
        }
    }

    /// The names of the fields that a person filled in.
    pub fn person_fields(&self) -> String {
        let named = FIELDS.iter().zip(&self.by_person).filter(|(_, by)| **by);
        named.map(|(field, _)| field.name).collect::<Vec<_>>().join(" ")
    }

    /// All cells, in the order of [`FmeaSheet::columns`].
    pub fn cells(&self) -> Vec<String> {
        let mut cells = vec![self.fault.clone()];
        cells.extend(self.texts.iter().cloned());
        cells.extend(self.others.iter().cloned());
        cells.extend([self.status.clone(), self.person_fields()]);
        cells.extend(self.evidence.iter().cloned());
        cells.extend([self.basis.in_words(), self.seal.clone()]);
        cells
    }
}

/// The status of a row, whether it is stale, and the basis of its person's cells.
fn status(
    earlier: Option<&EarlierRow>,
    by_person: &[bool],
    basis: &EvidenceBasis,
) -> (String, bool, EvidenceBasis) {
    let has_person = by_person.contains(&true) || earlier.is_some_and(EarlierRow::has_other_cells);
    let Some(earlier) = earlier.filter(|_| has_person) else {
        return ("generated".into(), false, basis.clone());
    };
    let changes = match &earlier.basis {
        Some(known) => basis.changes_since(known),
        None => Some("their system, study and model are not recorded".into()),
    };
    match changes {
        None => ("current".into(), false, basis.clone()),
        Some(_) if earlier.status.trim().eq_ignore_ascii_case(CONFIRMED) => {
            ("current".into(), false, basis.clone())
        }
        Some(changes) => {
            let status = format!(
                "stale: {changes} since a person filled cells in; look at them and write '{CONFIRMED}' here"
            );
            (status, true, earlier.basis.clone().unwrap_or_default())
        }
    }
}

impl EarlierSheet {
    fn of(path: &Path, texts: &Texts) -> Result<Self, SafetyError> {
        let [fault, status, basis, seal] = find_columns(path, texts, [FAULT, STATUS, BASIS, SEAL])?;
        let fields: Vec<Option<usize>> =
            FIELDS.iter().map(|field| texts.column(field.name)).collect();
        let is_own = |name: &str| {
            [FAULT, STATUS, BASIS, SEAL, PERSON].contains(&name)
                || name.starts_with(EVIDENCE)
                || FIELDS.iter().any(|field| field.name == name)
        };
        let others: Vec<usize> =
            (0..texts.columns.len()).filter(|&at| !is_own(&texts.columns[at])).collect();
        let mut rows: Vec<EarlierRow> = vec![];
        for row in texts.rows.iter().filter(|row| !row.cells[fault].trim().is_empty()) {
            let name = row.cells[fault].trim().to_owned();
            if rows.iter().any(|known| known.fault == name) {
                let problem = format!("'{name}' has a row already");
                return Err(SafetyError::Cell {
                    path: path.into(),
                    line: row.line,
                    column: FAULT,
                    problem,
                });
            }
            // A field whose column a person removed is generated again.
            let text =
                |place: &Option<usize>| place.map_or_else(String::new, |at| row.cells[at].clone());
            rows.push(EarlierRow {
                fault: name,
                texts: fields.iter().map(text).collect(),
                seal: read_seal(path, row, &row.cells[seal])?,
                status: row.cells[status].clone(),
                basis: EvidenceBasis::parse(&row.cells[basis]),
                others: others.iter().map(|&at| row.cells[at].clone()).collect(),
            });
        }
        let other_columns = others.into_iter().map(|at| texts.columns[at].clone()).collect();
        Ok(EarlierSheet { rows, other_columns })
    }
}

/// The hashes of a seal.
fn read_seal(path: &Path, row: &TextRow, text: &str) -> Result<Vec<String>, SafetyError> {
    let hashes = text.trim().strip_prefix(SEAL_VERSION).and_then(|rest| rest.strip_prefix(':'));
    let hashes: Vec<String> =
        hashes.unwrap_or_default().split_whitespace().map(str::to_owned).collect();
    match hashes.len() == FIELDS.len() {
        true => Ok(hashes),
        false => Err(SafetyError::Seal { path: path.into(), line: row.line }),
    }
}

impl EarlierRow {
    /// Which fields a person filled in: their text is there and not the generated one.
    fn by_person(&self) -> Vec<bool> {
        let cells = self.texts.iter().zip(&self.seal);
        cells.map(|(text, seal)| !text.trim().is_empty() && !is_sealed(text, seal)).collect()
    }

    /// Whether a person filled in cells of columns of their own.
    fn has_other_cells(&self) -> bool {
        self.others.iter().any(|text| !text.trim().is_empty())
    }

    /// The row of a fault that the system no longer has, if a person filled cells in.
    fn orphan(&self) -> Option<SheetRow> {
        let by_person = self.by_person();
        if !by_person.contains(&true) && !self.has_other_cells() {
            return None;
        }
        Some(SheetRow {
            fault: self.fault.clone(),
            texts: self.texts.clone(),
            evidence: vec!["of an earlier system".into(); FIELDS.len()],
            by_person,
            status:
                "stale: the system has no such fault any more; remove the row once nobody needs it"
                    .into(),
            is_stale: true,
            missing: 0,
            basis: self.basis.clone().unwrap_or_default(),
            seal: format!("{SEAL_VERSION}: {}", self.seal.join(" ")),
            others: self.others.clone(),
        })
    }
}
