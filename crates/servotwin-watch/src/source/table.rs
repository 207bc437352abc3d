//! Reads tables: Parquet files in batches, or a table in memory.

use super::survey::HEAD;
use super::{LogColumn, LogRow, Read, Source, SourceError, Wanted};
use servotwin_io::moment::Clock;
use servotwin_io::table::parquet::ParquetReader;
use servotwin_io::table::{Column, ColumnKind, Table, TableError, Values};
use std::path::Path;

/// Opens a Parquet file that must have the wanted columns.
///
/// # Errors
/// The file cannot be read, or lacks a column.
pub(super) fn open(path: &Path, wanted: &Wanted) -> Result<Box<dyn Source>, SourceError> {
    let known = ParquetReader::open(path)?;
    wanted.require(&path.display().to_string(), names_of(known.schema()))?;
    let names: Vec<&str> = wanted.names.iter().map(String::as_str).collect();
    let reader = ParquetReader::open_columns(path, &names)?;
    let rows = reader.row_count();
    Ok(Box::new(TableRows::new(Box::new(reader), rows, wanted)))
}

/// The rows of a table, of which only the wanted columns are read.
pub struct TableRows {
    batches: Box<dyn Iterator<Item = Result<Table, TableError>> + Send>,
    wanted: Wanted,
    rows: usize,
    clock: Clock,
    /// The wanted columns of the current batch.
    part: Vec<Values>,
    next: usize,
    place: u64,
}

impl TableRows {
    /// Reads a table in memory that must have the wanted columns; `name` is what messages call it.
    ///
    /// # Errors
    /// The table lacks a column.
    pub fn of_table(name: &str, table: &Table, wanted: &Wanted) -> Result<Self, SourceError> {
        wanted.require(name, names_of(table))?;
        let column = |name: &String| table.column(name).cloned();
        let columns = wanted.names.iter().map(column).collect::<Result<_, _>>()?;
        let table = Table::from_columns(columns)?;
        let rows = table.row_count();
        Ok(Self::new(Box::new(std::iter::once(Ok(table))), rows, wanted))
    }

    fn new(
        batches: Box<dyn Iterator<Item = Result<Table, TableError>> + Send>,
        rows: usize,
        wanted: &Wanted,
    ) -> Self {
        let (wanted, clock) = (wanted.clone(), Clock::default());
        TableRows { batches, wanted, rows, clock, part: vec![], next: 0, place: 0 }
    }
}

fn names_of(table: &Table) -> Vec<String> {
    table.names().map(String::from).collect()
}

impl Source for TableRows {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        while self.part.first().is_none_or(|column| column.len() == self.next) {
            let Some(table) = self.batches.next() else { return Ok(Read::End) };
            let columns = table?.into_columns();
            (self.part, self.next) = (columns.into_iter().map(|c| c.values).collect(), 0);
        }
        self.place += 1;
        row.place = self.place;
        row.begin(self.part.len());
        let TableRows { wanted, clock, next: at, .. } = self;
        for (column, values) in self.part.iter().enumerate() {
            match values {
                Values::Float(values) => row.put_number(column, values[*at]),
                Values::Integer(values) => row.put_number(column, values[*at] as f64),
                Values::Unsigned(values) => row.put_number(column, f64::from(values[*at])),
                Values::Flag(flags) => row.put_number(column, f64::from(u8::from(flags[*at]))),
                Values::Text(texts) => {
                    let text = texts[*at].trim();
                    let words = || wanted.number_of_words(column, text, clock);
                    row.put_text(column, text.parse().ok().or_else(words), text);
                }
            }
        }
        self.next += 1;
        self.wanted.continue_time(row, &mut self.clock);
        Ok(super::frame::with_time(&self.wanted, row))
    }

    fn counted(&self) -> &'static str {
        "row"
    }

    fn zone_s(&self) -> Option<f64> {
        self.clock.zone_s()
    }

    fn share(&self) -> Option<f64> {
        (self.rows > 0).then(|| self.place as f64 / self.rows as f64)
    }
}

/// The columns of a file with their units. If a column's first text is a date, its unit is `date`. Numbers are read
/// only from columns that may hold the time.
pub(crate) fn columns(path: &Path) -> Result<Vec<LogColumn>, SourceError> {
    let reader = ParquetReader::open(path)?;
    let columns = reader.schema().columns();
    let named = |is_read: &dyn Fn(&Column) -> bool| -> Vec<&str> {
        columns.iter().filter(|column| is_read(column)).map(|column| &*column.name).collect()
    };
    let is_text = |column: &Column| column.values.kind() == ColumnKind::Text;
    let texts = named(&is_text);
    // A text that exceeds the size limits is not a date; reading its column reports the error.
    let first = ParquetReader::open_columns(path, &texts)?.with_batch(1).next();
    let first = first.and_then(Result::ok);
    let times = named(&|column| !is_text(column) && super::survey::may_be_time(&column.name));
    let head = ParquetReader::open_columns(path, &times)?.with_batch(256).next().transpose()?;
    let beginning = |name: &str| {
        let found = |part: &'_ Option<Table>| part.as_ref()?.column(name).ok().cloned();
        found(&first).or_else(|| found(&head))
    };
    let column = |column: &Column| log_column(column, beginning(&column.name).as_ref());
    Ok(columns.iter().map(column).collect())
}

/// The columns of a table in memory.
pub fn table_columns(table: &Table) -> Vec<LogColumn> {
    table.columns().iter().map(|column| log_column(column, Some(column))).collect()
}

/// A column with its unit, and with its first numbers from `first`, if these were read.
fn log_column(column: &Column, first: Option<&Column>) -> LogColumn {
    let mut found = LogColumn { unit: column.unit.clone(), ..LogColumn::named(&column.name) };
    match first.map(|first| (&first.values, first.numbers())) {
        Some((Values::Text(texts), _)) => {
            texts.iter().take(HEAD).for_each(|text| found.take(text, None));
        }
        Some((_, Ok(numbers))) => found.head.extend(numbers.iter().take(HEAD)),
        _ => {}
    }
    found
}
