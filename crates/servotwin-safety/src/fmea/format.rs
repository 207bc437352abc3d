//! The sheet as a file: CSV, or XLSX with the feature `xlsx`.

use super::sheet::FmeaSheet;
use crate::error::SafetyError;
use servotwin::table::csv;
use servotwin::table::csv::texts::{self, Texts};
use std::path::Path;

/// The format of a sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SheetFormat {
    Csv,
    Xlsx,
}

/// The format that a file's extension names.
fn format_of(path: &Path) -> Result<SheetFormat, SafetyError> {
    let ending = path.extension().map(|text| text.to_string_lossy().to_ascii_lowercase());
    match ending.as_deref() {
        Some("csv") => Ok(SheetFormat::Csv),
        Some("xlsx") if cfg!(feature = "xlsx") => Ok(SheetFormat::Xlsx),
        Some("xlsx") => Err(SafetyError::Feature { path: path.into() }),
        _ => Err(SafetyError::SheetFormat { path: path.into() }),
    }
}

/// Whether a file's extension names a sheet that this program can write.
///
/// # Errors
/// It does not.
pub fn check(path: &Path) -> Result<(), SafetyError> {
    format_of(path).map(|_| ())
}

/// Reads a sheet.
///
/// # Errors
/// The file cannot be read, or is no table.
pub(crate) fn read(path: &Path) -> Result<Texts, SafetyError> {
    match format_of(path)? {
        SheetFormat::Csv => Ok(texts::read(path)?),
        SheetFormat::Xlsx => xlsx::read(path),
    }
}

/// Writes a sheet atomically.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, sheet: &FmeaSheet) -> Result<(), SafetyError> {
    match format_of(path)? {
        SheetFormat::Csv => Ok(csv::write_sheet(path, &sheet.table()?, sheet.separator)?),
        SheetFormat::Xlsx => xlsx::write(path, sheet),
    }
}

#[cfg(not(feature = "xlsx"))]
mod xlsx {
    use super::{FmeaSheet, Path, SafetyError, Texts};

    pub(crate) fn read(path: &Path) -> Result<Texts, SafetyError> {
        Err(SafetyError::Feature { path: path.into() })
    }

    pub(crate) fn write(path: &Path, _: &FmeaSheet) -> Result<(), SafetyError> {
        Err(SafetyError::Feature { path: path.into() })
    }
}

#[cfg(feature = "xlsx")]
mod xlsx {
    //! A workbook with one sheet. Every cell is a text, so no program reads a fault's name as a formula or a date.

    use super::super::fields::FIELDS;
    use super::super::sheet::EVIDENCE;
    use super::{FmeaSheet, Path, SafetyError, Texts};
    use calamine::{Data, Reader, Xlsx, open_workbook_from_rs};
    use rust_xlsxwriter::{
        Color, DocProperties, ExcelDateTime, Format, FormatAlign, Workbook, XlsxError,
    };
    use servotwin::files::{read_bytes, write_atomically};
    use servotwin::table::csv::texts::TextRow;
    use std::io::Cursor;

    /// The name of the sheet.
    const NAME: &str = "FMEA";

    pub(crate) fn write(path: &Path, sheet: &FmeaSheet) -> Result<(), SafetyError> {
        let wrong =
            |error: XlsxError| SafetyError::Xlsx { path: path.into(), problem: error.to_string() };
        let bytes = workbook(sheet).map_err(wrong)?;
        Ok(write_atomically(path, |out| out.write_all(&bytes))?)
    }

    fn workbook(sheet: &FmeaSheet) -> Result<Vec<u8>, XlsxError> {
        let mut workbook = Workbook::new();
        // A fixed time: equal sheets give equal bytes.
        let made = ExcelDateTime::from_ymd(2000, 1, 1)?;
        workbook.set_properties(&DocProperties::new().set_creation_datetime(&made));
        let text = Format::new().set_text_wrap().set_align(FormatAlign::Top);
        let head = text.clone().set_bold().set_background_color(Color::RGB(0xDD_E6_F0));
        let person = text.clone().set_background_color(Color::RGB(0xFF_F2_B3));
        let stale = text.clone().set_background_color(Color::RGB(0xF6_C6_C0));
        let page = workbook.add_worksheet();
        page.set_name(NAME)?;
        page.set_freeze_panes(1, 1)?;
        let columns = sheet.columns();
        for (place, name) in (0..).zip(&columns) {
            page.write_string_with_format(0, place, name, &head)?;
            page.set_column_width(place, if name.starts_with(EVIDENCE) { 24 } else { 30 })?;
        }
        let other = 1 + FIELDS.len() + sheet.other_columns.len();
        for (line, row) in (1..).zip(&sheet.rows) {
            for (place, cell) in row.cells().iter().enumerate() {
                let is_person = place > 0 && row.by_person.get(place - 1).is_some_and(|by| *by);
                let is_stale = row.is_stale && place == other;
                let format = if is_person {
                    &person
                } else if is_stale {
                    &stale
                } else {
                    &text
                };
                page.write_string_with_format(line, place as u16, cell, format)?;
            }
        }
        let last = (sheet.rows.len() as u32, columns.len() as u16 - 1);
        page.autofilter(0, 0, last.0, last.1)?;
        workbook.save_to_buffer()
    }

    pub(crate) fn read(path: &Path) -> Result<Texts, SafetyError> {
        let wrong = |problem: String| SafetyError::Xlsx { path: path.into(), problem };
        let bytes = read_bytes(path)?;
        let mut workbook: Xlsx<_> = open_workbook_from_rs(Cursor::new(bytes))
            .map_err(|error: calamine::XlsxError| wrong(error.to_string()))?;
        // A workbook that another program made of a CSV names its only sheet after the file.
        let names = workbook.sheet_names();
        let own = names.iter().find(|name| *name == NAME).or(names.first()).cloned();
        let name = own.ok_or_else(|| wrong("there is no sheet in it".into()))?;
        let range = workbook.worksheet_range(&name).map_err(|error| wrong(error.to_string()))?;
        let mut rows = range.rows();
        let columns: Vec<String> = rows.next().unwrap_or_default().iter().map(text_of).collect();
        let row = |(place, cells): (usize, &[Data])| TextRow {
            line: place + 2,
            cells: cells.iter().map(text_of).collect(),
        };
        Ok(Texts { columns, rows: rows.enumerate().map(row).collect(), separator: b',' })
    }

    fn text_of(cell: &Data) -> String {
        match cell {
            Data::Empty => String::new(),
            Data::Float(number) => format!("{number}"),
            other => other.to_string(),
        }
    }
}
