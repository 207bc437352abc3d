//! Tables of named columns, and their file formats.
//!
//! Records, a data set and an evaluation are stored as [`Table`]s. A column's name ends with its physical unit
//! (`pressure_a_pa`). The unit itself is a text beside it (`Pa`), which goes into the file if the format supports
//! units.
//!
//! [`ALL`] lists the formats; [`Table::read`] and [`Table::write`] choose one by the file's extension.

pub mod csv;
mod error;
pub mod parquet;

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::nearest::nearest;
pub use error::{ContentError, TableError};

/// A file format for tables.
#[derive(Debug)]
pub struct Format {
    /// The name shown to users.
    pub name: &'static str,
    /// The file name's extension, without the dot and in lower case.
    pub extension: &'static str,
    /// Reads a whole file.
    pub read: fn(&Path) -> Result<Table, TableError>,
    /// Writes a whole file, atomically.
    pub write: fn(&Path, &Table) -> Result<(), TableError>,
}

/// Every known format, the preferred one first.
pub const ALL: [&Format; 2] = [&parquet::FORMAT, &csv::FORMAT];

impl Table {
    /// Reads a table; the file's extension names the format (`.csv`, `.parquet`).
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, TableError> {
        let path = path.as_ref();
        Ok((format_of(path)?.read)(path)?.read_from(path))
    }

    /// Writes the table atomically; the file's extension names the format.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), TableError> {
        let path = path.as_ref();
        (format_of(path)?.write)(path, self)
    }
}

/// Reads a table of another program.
///
/// Unsupported columns of a Parquet file, and those above the [limits](parquet::Limits) of decoding, are left out and
/// listed in [`Origin::left_out`]. [`Table::read`] rejects such a file.
pub fn read_usable(path: impl AsRef<Path>) -> Result<Table, TableError> {
    read_wanted(path, &|_| true)
}

/// As [`read_usable`], with the columns whose names `is_wanted` accepts. The others of a Parquet file are not decoded.
pub fn read_wanted(
    path: impl AsRef<Path>,
    is_wanted: &dyn Fn(&str) -> bool,
) -> Result<Table, TableError> {
    let path = path.as_ref();
    match format_of(path)?.extension == parquet::FORMAT.extension {
        true => Ok(parquet::read_wanted(path, is_wanted)?.read_from(path)),
        false => Table::read(path),
    }
}

/// The format that a file's extension names.
pub fn format_of(path: &Path) -> Result<&'static Format, TableError> {
    let extension = path.extension().and_then(|text| text.to_str());
    let extension = extension.map(str::to_ascii_lowercase);
    let found = ALL.into_iter().find(|format| Some(format.extension) == extension.as_deref());
    found.ok_or_else(|| TableError::UnknownFormat { path: path.to_path_buf() })
}

/// Declares the kinds of columns, one per row: variant, type of a value, and name in messages.
macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident($value:ty) = $name:literal;)*) => {
        /// The kind of a column's values.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum ColumnKind {
            $($(#[$doc])* $kind,)*
        }

        impl ColumnKind {
            /// The kind in words, for messages.
            pub(crate) fn name(self) -> &'static str {
                match self {
                    $(ColumnKind::$kind => $name,)*
                }
            }
        }

        /// The values of one column.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Values {
            $($(#[$doc])* $kind(Vec<$value>),)*
        }

        impl Values {
            /// An empty column of a kind.
            pub(crate) fn empty(kind: ColumnKind) -> Self {
                match kind {
                    $(ColumnKind::$kind => Values::$kind(Vec::new()),)*
                }
            }

            /// The kind of the values.
            pub fn kind(&self) -> ColumnKind {
                match self {
                    $(Values::$kind(_) => ColumnKind::$kind,)*
                }
            }

            /// The number of values.
            pub fn len(&self) -> usize {
                match self {
                    $(Values::$kind(values) => values.len(),)*
                }
            }

            /// Whether there are no values.
            pub fn is_empty(&self) -> bool {
                self.len() == 0
            }

            /// The values of some rows.
            pub fn rows(&self, rows: Range<usize>) -> Self {
                match self {
                    $(Values::$kind(values) => Values::$kind(values[rows].to_vec()),)*
                }
            }

            /// Appends values of the same kind; returns `false` and does nothing if the kinds differ.
            pub(crate) fn append(&mut self, other: Values) -> bool {
                match (self, other) {
                    $((Values::$kind(own), Values::$kind(more)) => own.extend(more),)*
                    _ => return false,
                }
                true
            }
        }

        $(impl From<Vec<$value>> for Values {
            fn from(values: Vec<$value>) -> Self {
                Values::$kind(values)
            }
        })*
    };
}

kinds! {
    /// Floats, including NaN and infinities.
    Float(f64) = "numbers";
    /// Whole numbers.
    Integer(i64) = "whole numbers";
    /// Counts, indices and seeds.
    Unsigned(u32) = "non-negative whole numbers";
    /// True or false.
    Flag(bool) = "true or false";
    /// Text.
    Text(String) = "text";
}

/// A named column with its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// The name, ending with the unit's suffix if there is a unit.
    pub name: String,
    /// The unit as text (`Pa`, `m³/s`), empty if the column has none.
    pub unit: String,
    /// One sentence about the column, empty if it has none. Kept by Parquet, not by CSV.
    pub description: String,
    /// The values.
    pub values: Values,
}

impl Column {
    /// A column from its parts.
    pub fn new(
        name: impl Into<String>,
        unit: impl Into<String>,
        values: impl Into<Values>,
    ) -> Self {
        let description = String::new();
        Self { name: name.into(), unit: unit.into(), description, values: values.into() }
    }

    /// A column with a value of each of some rows.
    pub fn of<R, V>(
        name: impl Into<String>,
        unit: impl Into<String>,
        rows: impl IntoIterator<Item = R>,
        value: impl FnMut(R) -> V,
    ) -> Self
    where
        Values: From<Vec<V>>,
    {
        Column::new(name, unit, rows.into_iter().map(value).collect::<Vec<V>>())
    }

    /// The column with a description.
    #[must_use]
    pub fn described(self, description: impl Into<String>) -> Self {
        Self { description: description.into(), ..self }
    }

    /// A column with the same name, unit and description, and other values.
    pub fn with_values(&self, values: impl Into<Values>) -> Self {
        Column::new(&self.name, &self.unit, values).described(&self.description)
    }

    /// The numbers of the column as floats; whole numbers are converted.
    pub fn numbers(&self) -> Result<Cow<'_, [f64]>, TableError> {
        Ok(match &self.values {
            Values::Float(values) => Cow::Borrowed(values),
            Values::Integer(values) => values.iter().map(|value| *value as f64).collect(),
            Values::Unsigned(values) => values.iter().map(|value| f64::from(*value)).collect(),
            _ => return Err(wrong_kind(self, ColumnKind::Float)),
        })
    }
}

/// The places of a table's rows in the file that it was read from. It is no part of the table's value: all origins are
/// equal.
#[derive(Debug, Clone, Default)]
pub struct Origin {
    /// Rows at which the line numbers jump, with their lines; empty without lines.
    leaps: Vec<(usize, usize)>,
    /// A description of the text format if it differs from this toolkit's.
    pub dialect: Option<String>,
    /// Columns of the file that are not in the table, with the reason.
    left_out: Vec<(String, String)>,
    /// Columns of the file that were not requested.
    unread: Vec<String>,
    /// The file, if there is one.
    file: Option<PathBuf>,
    /// The unit of places if they are not lines.
    counted: Option<&'static str>,
}

impl PartialEq for Origin {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Origin {
    /// The place of a row, counted from 0: `line 17`, or `row 16` in a file without lines.
    pub fn place(&self, row: usize) -> String {
        let leap = self.leaps.iter().rev().find(|(first, _)| *first <= row);
        match leap {
            Some((first, line)) => {
                format!("{} {}", self.counted.unwrap_or("line"), line + row - first)
            }
            None => format!("row {}", row + 1),
        }
    }

    /// The place with the file: `log.csv: line 17`.
    pub fn place_in_file(&self, row: usize) -> String {
        let place = self.place(row);
        self.file.as_ref().map_or(place.clone(), |file| format!("{}: {place}", file.display()))
    }

    /// The columns of the file that the table lacks, each with the reason.
    pub fn left_out(&self) -> &[(String, String)] {
        &self.left_out
    }

    /// Records the line of the next row.
    fn push_line(&mut self, row: usize, line: usize) {
        let expected = self.leaps.last().map(|(first, start)| start + row - first);
        if expected != Some(line) {
            self.leaps.push((row, line));
        }
    }
}

/// Named columns of equal length, with key-value metadata.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    columns: Vec<Column>,
    /// Index of each column by its name; only for look-ups, so its order has no influence.
    places: HashMap<String, usize>,
    origin: Origin,
    /// Notes about the whole table (study, seed, version); kept by Parquet, not by CSV.
    pub metadata: BTreeMap<String, String>,
}

impl Table {
    /// A table without columns.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates a table from columns with different names and equal lengths.
    pub fn from_columns(columns: Vec<Column>) -> Result<Self, TableError> {
        let mut table = Table::new();
        columns.into_iter().try_for_each(|column| table.push(column))?;
        Ok(table)
    }

    /// Appends a column on the right.
    pub fn push(&mut self, column: Column) -> Result<(), TableError> {
        let name = &column.name;
        if self.has(name) {
            return Err(TableError::Unsuitable(format!("there is already a column '{name}'")));
        }
        let (found, expected) = (column.values.len(), self.row_count());
        if found != expected && !self.columns.is_empty() {
            let message = format!("column '{name}' has {found} rows, the others have {expected}");
            return Err(TableError::Unsuitable(message));
        }
        self.places.insert(column.name.clone(), self.columns.len());
        self.columns.push(column);
        Ok(())
    }

    /// Adds a metadata entry.
    pub fn with_metadata(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.metadata.insert(key.into(), value.into());
        self
    }

    /// The columns from left to right.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The columns from left to right; consumes the table.
    pub fn into_columns(self) -> Vec<Column> {
        self.columns
    }

    /// The column names from left to right.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|column| column.name.as_str())
    }

    /// The number of rows.
    pub fn row_count(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }

    /// The same columns without rows: the schema for a streaming writer.
    pub fn without_rows(&self) -> Table {
        self.rows(0..0)
    }

    /// A range of rows, with the columns and metadata.
    pub fn rows(&self, rows: Range<usize>) -> Table {
        let cut = |column: &Column| column.with_values(column.values.rows(rows.clone()));
        let columns = self.columns.iter().map(cut).collect();
        Table {
            columns,
            places: self.places.clone(),
            metadata: self.metadata.clone(),
            ..Table::default()
        }
    }

    /// Appends the rows of a table with the same column names and kinds in the same order.
    pub fn append(&mut self, other: Table) -> Result<(), TableError> {
        self.require_same_columns(&other)?;
        for (own, more) in self.columns.iter_mut().zip(other.columns) {
            own.values.append(more.values);
        }
        Ok(())
    }

    /// Checks that another table has the same column names and kinds in the same order.
    pub(crate) fn require_same_columns(&self, other: &Table) -> Result<(), TableError> {
        let (expected, found) = (self.columns.len(), other.columns.len());
        if expected != found {
            let message = format!("{found} columns cannot be appended to {expected}");
            return Err(TableError::Unsuitable(message));
        }
        for (own, given) in self.columns.iter().zip(&other.columns) {
            if own.name != given.name {
                let (found, expected) = (&given.name, &own.name);
                let message = format!("column '{found}' stands where '{expected}' is needed");
                return Err(TableError::Unsuitable(message));
            }
            let expected = own.values.kind();
            if given.values.kind() != expected {
                return Err(wrong_kind(given, expected));
            }
        }
        Ok(())
    }

    /// The column with a name; the error suggests the nearest one and lists the others.
    pub fn column(&self, name: &str) -> Result<&Column, TableError> {
        match self.place(name) {
            Some(place) => Ok(&self.columns[place]),
            None => Err(self.missing_column(name)),
        }
    }

    /// Removes a column and moves those after it one place to the left.
    pub fn take(&mut self, name: &str) -> Result<Column, TableError> {
        let Some(place) = self.places.remove(name) else {
            return Err(self.missing_column(name));
        };
        self.places.values_mut().filter(|other| **other > place).for_each(|other| *other -= 1);
        Ok(self.columns.remove(place))
    }

    fn missing_column(&self, name: &str) -> TableError {
        match self.origin.left_out.iter().find(|(column, _)| column == name) {
            Some((_, reason)) => TableError::Unsuitable(reason.clone()),
            None => unknown_column(
                name,
                self.names().chain(self.origin.unread.iter().map(String::as_str)),
            ),
        }
    }

    fn read_from(mut self, path: &Path) -> Self {
        self.origin.file = Some(path.into());
        self
    }

    /// Sets the places of the rows, in units of a log.
    pub fn with_places(mut self, counted: &'static str, places: impl Iterator<Item = u64>) -> Self {
        self.origin.counted = Some(counted);
        for (row, place) in places.enumerate() {
            self.origin.push_line(row, place as usize);
        }
        self
    }

    /// The places of its rows in the file that it was read from.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// The numbers of a column; whole numbers are converted.
    pub fn f64(&self, name: &str) -> Result<Cow<'_, [f64]>, TableError> {
        self.column(name)?.numbers()
    }

    /// The numbers of a column, which must not be NaN or infinite.
    pub fn finite_f64(&self, name: &str) -> Result<Cow<'_, [f64]>, TableError> {
        let values = self.f64(name)?;
        match values.iter().position(|value| !value.is_finite()) {
            Some(row) => {
                Err(self.bad_cell(name, row, format!("{} is no finite number", values[row])))
            }
            None => Ok(values),
        }
    }

    /// The error for a value that is not allowed in its column.
    fn bad_cell(&self, name: &str, row: usize, problem: String) -> TableError {
        let place = self.origin.place_in_file(row);
        TableError::Unsuitable(format!("{place}, column '{name}': {problem}"))
    }

    /// The whole numbers of a column.
    pub fn i64(&self, name: &str) -> Result<Cow<'_, [i64]>, TableError> {
        let column = self.column(name)?;
        Ok(match &column.values {
            Values::Integer(values) => Cow::Borrowed(values),
            Values::Unsigned(values) => values.iter().map(|value| i64::from(*value)).collect(),
            _ => return Err(wrong_kind(column, ColumnKind::Integer)),
        })
    }

    /// The non-negative whole numbers of a column; signed ones are converted if all of them are in range.
    pub fn u32(&self, name: &str) -> Result<Cow<'_, [u32]>, TableError> {
        let column = self.column(name)?;
        let convert = |(row, value): (usize, &i64)| {
            u32::try_from(*value).map_err(|_| {
                self.bad_cell(name, row, format!("{value} is not in 0 … {}", u32::MAX))
            })
        };
        Ok(match &column.values {
            Values::Unsigned(values) => Cow::Borrowed(values),
            Values::Integer(values) => {
                Cow::Owned(values.iter().enumerate().map(convert).collect::<Result<_, _>>()?)
            }
            _ => return Err(wrong_kind(column, ColumnKind::Unsigned)),
        })
    }

    /// The flags of a column.
    pub fn bool(&self, name: &str) -> Result<&[bool], TableError> {
        match self.column(name)? {
            Column { values: Values::Flag(values), .. } => Ok(values),
            column => Err(wrong_kind(column, ColumnKind::Flag)),
        }
    }

    /// The texts of a column.
    pub fn text(&self, name: &str) -> Result<&[String], TableError> {
        match self.column(name)? {
            Column { values: Values::Text(values), .. } => Ok(values),
            column => Err(wrong_kind(column, ColumnKind::Text)),
        }
    }

    /// Index of a column, from 0.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.places.get(name).copied()
    }

    /// Whether a column has this name.
    pub fn has(&self, name: &str) -> bool {
        self.places.contains_key(name)
    }
}

/// The error for an unknown column.
pub(crate) fn unknown_column<'a>(
    name: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> TableError {
    let known: Vec<&str> = known.into_iter().collect();
    let nearest = nearest(name, known.iter().copied()).map(str::to_owned);
    let known = known.into_iter().map(str::to_owned).collect();
    TableError::UnknownColumn { column: name.to_owned(), nearest, known }
}

fn wrong_kind(column: &Column, expected: ColumnKind) -> TableError {
    let (name, found, expected) = (&column.name, column.values.kind().name(), expected.name());
    TableError::Unsuitable(format!("column '{name}' holds {found}, needed are {expected}"))
}
