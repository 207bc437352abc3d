//! Sheets that people and programs for sheets have changed.

use servotwin::table::csv::texts::{TextRow, Texts};
use servotwin_safety::fmea::cell::FmeaCell;
use servotwin_safety::fmea::fields::{FIELDS, FmeaRow};
use servotwin_safety::fmea::sheet::{FmeaSheet, SEAL, STATUS, SheetRow};
use servotwin_safety::results::EvidenceBasis;
use std::path::Path;

fn generated(mark: &str) -> Vec<FmeaRow> {
    let cells = |fault: &str| {
        let cell = |n: usize| FmeaCell::new(format!("{fault} {n} {mark}"), "a file, row 1");
        let mut cells: Vec<FmeaCell> = (0..FIELDS.len()).map(cell).collect();
        cells[3] = FmeaCell::new("area 1 … 2 m² → λ", "a file, row 1");
        cells[14] = FmeaCell::new("1.23457e-7", "rates.csv line 2");
        cells[FIELDS.len() - 1] = FmeaCell::default();
        cells
    };
    ["a.x", "b.y"].map(|fault| FmeaRow { fault: fault.into(), cells: cells(fault) }).to_vec()
}

fn basis(model: &str) -> EvidenceBasis {
    EvidenceBasis { system: "s".into(), study: "t".into(), model: model.into() }
}

/// The sheet as a program for sheets would give it back.
fn stored(sheet: &FmeaSheet) -> Texts {
    let row = |(n, row): (usize, &SheetRow)| TextRow { line: n + 2, cells: row.cells() };
    let rows = sheet.rows.iter().enumerate().map(row).collect();
    Texts { columns: sheet.columns(), rows, separator: b',' }
}

fn again(texts: &Texts, mark: &str, model: &str) -> FmeaSheet {
    FmeaSheet::new(&generated(mark), &basis(model), Some((Path::new("f.csv"), texts))).unwrap()
}

fn set(texts: &mut Texts, row: usize, column: &str, text: &str) {
    let at = texts.column(column).unwrap();
    texts.rows[row].cells[at] = text.into();
}

fn field(sheet: &FmeaSheet, row: usize, name: &str) -> String {
    let place = FIELDS.iter().position(|field| field.name == name).unwrap();
    sheet.rows[row].texts[place].clone()
}

fn first() -> Texts {
    stored(&FmeaSheet::new(&generated("one"), &basis("m"), None).unwrap())
}

#[test]
fn a_persons_cell_survives_and_the_others_are_generated_again() {
    let mut texts = first();
    set(&mut texts, 1, "severity", "S4, by the safety board");
    set(&mut texts, 1, "remarks", "see hazard log 7");
    let sheet = again(&texts, "two", "m");
    assert_eq!(field(&sheet, 1, "severity"), "S4, by the safety board");
    assert_eq!(field(&sheet, 1, "remarks"), "see hazard log 7");
    assert_eq!(field(&sheet, 1, "isolation"), "b.y 10 two");
    assert_eq!(sheet.rows[1].person_fields(), "severity remarks");
    assert_eq!(sheet.rows[1].evidence[13], "filled in by a person");
    assert_eq!((sheet.rows[1].status.as_str(), sheet.stale_rows()), ("current", 0));
    assert_eq!((sheet.rows[0].status.as_str(), sheet.person_cells()), ("generated", 2));
    // And once more, from what was just written.
    let third = again(&stored(&sheet), "three", "m");
    assert_eq!(field(&third, 1, "severity"), "S4, by the safety board");
    assert_eq!(field(&third, 0, "severity"), "a.x 13 three");
}

#[test]
fn a_row_is_stale_until_a_person_confirms_it() {
    let mut texts = first();
    set(&mut texts, 0, "severity", "S1");
    let changed = again(&texts, "two", "other");
    assert!(
        changed.rows[0].status.starts_with("stale: the model changed"),
        "{}",
        changed.rows[0].status
    );
    assert_eq!(changed.stale_rows(), 1);
    // Generating again does not make it current; a person does.
    let mut texts = stored(&again(&stored(&changed), "two", "other"));
    assert!(texts.rows[0].cells[texts.column(STATUS).unwrap()].starts_with("stale"));
    set(&mut texts, 0, STATUS, "Confirmed");
    let confirmed = again(&texts, "two", "other");
    assert_eq!((confirmed.rows[0].status.as_str(), confirmed.stale_rows()), ("current", 0));
    assert_eq!(again(&stored(&confirmed), "two", "other").stale_rows(), 0);
}

#[test]
fn an_emptied_cell_is_generated_again_and_another_form_of_a_number_is_no_change() {
    // English and German forms, in full and rounded as a column shows them; Windows-1252 has no arrow and no Greek letters.
    for number in ["0.000000123457", "1,23457E-07", "1.23E-07", "1,2346E-07", "0,000000123457"] {
        let mut texts = first();
        set(&mut texts, 0, "severity", "");
        set(&mut texts, 0, "failure_rate_per_h", number);
        set(&mut texts, 0, "isolation", " a.x  10 one ");
        set(&mut texts, 0, "physical_range", "area 1 … 2 m² ? ?");
        let sheet = again(&texts, "one", "m");
        assert_eq!(sheet.person_cells(), 0, "{number}: {}", sheet.rows[0].person_fields());
        assert_eq!(field(&sheet, 0, "severity"), "a.x 13 one");
    }
}

#[test]
fn another_letter_or_another_number_is_a_persons() {
    for (column, text) in [
        ("physical_range", "area 1 … 2 m² ← λ"),
        ("physical_range", "area 1 … 2 m³ → λ"),
        ("failure_rate_per_h", "1.3e-7"),
        ("failure_rate_per_h", "1,24E-07"),
        ("failure_rate_per_h", "1.2346E-06"),
        // One digit is an estimate of a person, and so are more digits than were written.
        ("failure_rate_per_h", "1E-07"),
        ("failure_rate_per_h", "1.234567e-7"),
        ("failure_rate_per_h", "0.00"),
    ] {
        let mut texts = first();
        set(&mut texts, 0, column, text);
        let sheet = again(&texts, "two", "m");
        assert_eq!((sheet.rows[0].person_fields().as_str(), sheet.person_cells()), (column, 1));
        assert_eq!(field(&sheet, 0, column), text);
    }
}

#[test]
fn a_finding_that_begins_with_not_is_no_missing_cell() {
    let mut rows = generated("one");
    rows[0].cells[9] = FmeaCell::new("not detected at the largest intensity", "a file, row 1");
    rows[1].cells[9] = FmeaCell::missing("not evaluated", "a command");
    let sheet = FmeaSheet::new(&rows, &basis("m"), None).unwrap();
    assert_eq!([sheet.rows[0].missing, sheet.rows[1].missing], [0, 1]);
    let mut texts = stored(&sheet);
    set(&mut texts, 1, "smallest_detectable", "0.2, by test");
    let sheet = FmeaSheet::new(&rows, &basis("m"), Some((Path::new("f.csv"), &texts))).unwrap();
    assert_eq!((sheet.rows[1].missing, sheet.person_cells()), (0, 1));
}

#[test]
fn columns_of_a_person_and_rows_of_removed_faults_stay() {
    let mut texts = first();
    texts.columns.insert(3, "compensating provisions".into());
    texts.rows.iter_mut().for_each(|row| row.cells.insert(3, "none".into()));
    let mut gone = texts.rows[0].clone();
    gone.cells[0] = "c.z".into();
    texts.rows.push(gone);
    let sheet = again(&texts, "two", "m");
    assert_eq!(sheet.other_columns, ["compensating provisions"]);
    assert_eq!(sheet.rows[2].fault, "c.z");
    assert!(sheet.rows[2].is_stale && sheet.rows[2].others == ["none"]);
    assert_eq!(sheet.rows[0].status, "current");
}

#[test]
fn a_sheet_without_its_seal_is_refused_with_its_place() {
    let mut texts = first();
    set(&mut texts, 1, SEAL, "1: abc");
    let error = FmeaSheet::new(&generated("x"), &basis("m"), Some((Path::new("f.csv"), &texts)));
    assert!(error.unwrap_err().to_string().starts_with("f.csv: line 3: the seal"));
    texts.columns[0] = "failure".into();
    let error = FmeaSheet::new(&generated("x"), &basis("m"), Some((Path::new("f.csv"), &texts)));
    let error = error.unwrap_err().to_string();
    assert!(error.contains("there is no column 'fault'; needed are: fault, status"), "{error}");
}
