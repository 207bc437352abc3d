//! Tables as Apache Parquet files, whole or streamed.
//!
//! Columns are written as required (never null). The file's key-value metadata holds the table's
//! own and each column's unit, under `unit:` and the column's name. The bytes depend on nothing but
//! the table: no time stamp, no version but our own format's. Compression is Snappy, in pure Rust.
//!
//! [`ParquetWriter`] appends rows without holding more than one row group in memory, and
//! [`ParquetReader`] gives them back table by table. Files of other writers are read if their
//! columns are numbers, booleans, text or dictionaries of these, without nulls; the codecs known
//! are Snappy, gzip, LZ4 and Zstandard.
//!
//! The library's Arrow layer is left out: it would take longer to compile than everything else
//! that a table needs.

mod zstd;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::parquet::basic::{
    Compression, ConvertedType, LogicalType, Repetition, TimeUnit, Type as Physical,
};
use ::parquet::column::page::PageReader;
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use ::parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FixedLenByteArray, Int32Type,
    Int64Type,
};
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::{
    ColumnChunkMetaData, KeyValue, ParquetMetaData, ParquetMetaDataReader,
};
use ::parquet::file::properties::{EnabledStatistics, WriterProperties};
use ::parquet::file::serialized_reader::SerializedPageReader;
use ::parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use ::parquet::schema::types::{BasicTypeInfo, Type, TypePtr};
use half::f16;

use super::{Column, ContentError, Format, Kind, Table, TableError, Values, unknown_column};
use crate::files::{AtomicFile, FileError};
use crate::manifest;

/// The format's entry in [`ALL`](super::ALL).
pub const FORMAT: Format = Format { name: "Parquet", extension: "parquet", read, write };

/// Rows in a row group: large enough to compress well, small enough to hold in memory.
const GROUP_ROWS: usize = 1 << 17;

/// Rows in a table that [`ParquetReader`] gives at a time.
const BATCH_ROWS: usize = 1 << 16;

/// A column's unit is kept in the file's metadata under this and the column's name.
const UNIT_PREFIX: &str = "unit:";

/// The key under which writers with an Arrow layer keep its schema.
const ARROW_KEY: &str = "ARROW:schema";

/// Reads a whole Parquet file.
pub fn read(path: &Path) -> Result<Table, TableError> {
    collect(ParquetReader::open(path)?)
}

/// Reads only some columns of a Parquet file, in the order asked for.
pub fn read_columns(path: &Path, names: &[&str]) -> Result<Table, TableError> {
    collect(ParquetReader::open_columns(path, names)?)
}

fn collect(mut reader: ParquetReader) -> Result<Table, TableError> {
    let mut table = reader.schema().clone();
    reader.try_for_each(|part| table.append(part?))?;
    Ok(table)
}

/// Writes a whole Parquet file atomically.
pub fn write(path: &Path, table: &Table) -> Result<(), TableError> {
    let mut writer = ParquetWriter::create(path, table)?;
    writer.append(table)?;
    writer.finish()
}

/// Writes a Parquet file piece by piece; the file appears only when finished.
#[derive(Debug)]
pub struct ParquetWriter {
    path: PathBuf,
    /// The rows of the row group begun.
    begun: Table,
    writer: SerializedFileWriter<AtomicFile>,
}

impl ParquetWriter {
    /// Opens a file for the columns and metadata of `schema`, whose rows are not written.
    pub fn create(path: impl AsRef<Path>, schema: &Table) -> Result<Self, TableError> {
        let path = path.as_ref().to_path_buf();
        let file = AtomicFile::create(&path)?;
        let properties = WriterProperties::builder()
            .set_created_by("servotwin".to_owned())
            .set_compression(Compression::SNAPPY)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_key_value_metadata(Some(notes_of(schema)))
            .build();
        let writer = schema_of(schema)
            .and_then(|fields| SerializedFileWriter::new(file, fields, Arc::new(properties)))
            .map_err(|error| parquet_error(&path, error))?;
        Ok(Self { path, begun: schema.without_rows(), writer })
    }

    /// Appends the rows of a table with the same columns. A row group is closed when full.
    pub fn append(&mut self, table: &Table) -> Result<(), TableError> {
        self.begun.require_same_columns(table)?;
        let mut first = 0;
        while first < table.row_count() {
            let fitting = GROUP_ROWS - self.begun.row_count();
            let end = table.row_count().min(first + fitting);
            self.begun.append(table.rows(first..end))?;
            first = end;
            if self.begun.row_count() == GROUP_ROWS {
                self.end_group()?;
            }
        }
        Ok(())
    }

    /// Closes the row group begun: what was appended so far leaves the memory.
    pub fn end_group(&mut self) -> Result<(), TableError> {
        if self.begun.row_count() == 0 {
            return Ok(());
        }
        write_group(&mut self.writer, &self.begun).map_err(|error| self.unwritten(error))?;
        self.begun = self.begun.without_rows();
        Ok(())
    }

    /// Writes the file's end and puts it in its place.
    pub fn finish(mut self) -> Result<(), TableError> {
        self.end_group()?;
        let file = self.writer.into_inner().map_err(|error| parquet_error(&self.path, error))?;
        manifest::forget(&self.path)?;
        Ok(file.commit()?)
    }

    /// The library may wrap the operating system's error; the file knows it.
    fn unwritten(&self, error: ParquetError) -> TableError {
        match self.writer.inner().failure() {
            Some(cause) => TableError::File(FileError::from_io(&self.path, cause)),
            None => parquet_error(&self.path, error),
        }
    }
}

/// The table's metadata and the units of its columns.
fn notes_of(table: &Table) -> Vec<KeyValue> {
    let own = table.metadata.iter().map(|(key, note)| KeyValue::new(key.clone(), note.clone()));
    let measured = table.columns().iter().filter(|column| !column.unit.is_empty());
    let units = measured
        .map(|column| KeyValue::new(format!("{UNIT_PREFIX}{}", column.name), column.unit.clone()));
    own.chain(units).collect()
}

fn schema_of(table: &Table) -> Result<TypePtr, ParquetError> {
    let fields = table.columns().iter().map(field_of).collect::<Result<_, _>>()?;
    Ok(Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?))
}

fn field_of(column: &Column) -> Result<TypePtr, ParquetError> {
    let (physical, logical) = match column.values.kind() {
        Kind::Float => (Physical::DOUBLE, None),
        Kind::Integer => (Physical::INT64, None),
        Kind::Unsigned => (Physical::INT32, Some(LogicalType::integer(32, false))),
        Kind::Flag => (Physical::BOOLEAN, None),
        Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
    };
    let field = Type::primitive_type_builder(&column.name, physical)
        .with_logical_type(logical)
        .with_repetition(Repetition::REQUIRED);
    field.build().map(Arc::new)
}

fn write_group(
    file: &mut SerializedFileWriter<AtomicFile>,
    table: &Table,
) -> Result<(), ParquetError> {
    let mut group = file.next_row_group()?;
    for column in table.columns() {
        let Some(mut writer) = group.next_column()? else {
            return Err(ParquetError::General("a column that the schema has not".to_owned()));
        };
        write_values(&mut writer, &column.values)?;
        writer.close()?;
    }
    group.close().map(|_| ())
}

fn write_values(
    writer: &mut SerializedColumnWriter,
    values: &Values,
) -> Result<usize, ParquetError> {
    match values {
        Values::Float(values) => writer.typed::<DoubleType>().write_batch(values, None, None),
        Values::Integer(values) => writer.typed::<Int64Type>().write_batch(values, None, None),
        Values::Unsigned(values) => {
            // The same 32 bits: Parquet has no type of its own for numbers without sign.
            let bits: Vec<i32> = values.iter().map(|value| value.cast_signed()).collect();
            writer.typed::<Int32Type>().write_batch(&bits, None, None)
        }
        Values::Flag(values) => writer.typed::<BoolType>().write_batch(values, None, None),
        Values::Text(values) => {
            let bytes: Vec<ByteArray> =
                values.iter().map(|text| ByteArray::from(text.as_str())).collect();
            writer.typed::<ByteArrayType>().write_batch(&bytes, None, None)
        }
    }
}

/// Reads a Parquet file as a sequence of tables, in the order of the rows.
pub struct ParquetReader {
    path: PathBuf,
    file: Arc<File>,
    metadata: ParquetMetaData,
    schema: Table,
    sources: Vec<Source>,
    next_group: usize,
    /// The columns of the row group being read.
    columns: Vec<ColumnReader>,
    /// How many rows are left in that group.
    rows_left: usize,
    rows_read: usize,
}

/// Where a table's column comes from.
struct Source {
    /// The column's place in the file.
    place: usize,
    meaning: Meaning,
}

impl ParquetReader {
    /// Opens a file with all its columns.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, TableError> {
        Self::open_selected(path.as_ref(), None)
    }

    /// Opens a file with some of its columns, in the order asked for; the others are not read.
    pub fn open_columns(path: impl AsRef<Path>, names: &[&str]) -> Result<Self, TableError> {
        Self::open_selected(path.as_ref(), Some(names))
    }

    fn open_selected(path: &Path, names: Option<&[&str]>) -> Result<Self, TableError> {
        let content = |problem| content_error(path, problem);
        manifest::check(path)?;
        let file = open_marked(path)?;
        let parse = || Ok(ParquetMetaDataReader::new().parse_and_finish(&file)?);
        let metadata = guarded(parse).map_err(content)?;
        let fields = metadata.file_metadata().schema().get_fields();
        require_different_names(fields).map_err(content)?;
        let mut schema = Table { metadata: notes_in(&metadata), ..Table::new() };
        let mut sources = Vec::new();
        for field in chosen(fields, names)? {
            let (kind, meaning) = kind_of(field).map_err(content)?;
            let unit = schema.metadata.get(&format!("{UNIT_PREFIX}{}", field.name()));
            let of_moments = if matches!(meaning, Meaning::Moment { .. }) { "s" } else { "" };
            let unit = unit.cloned().unwrap_or_else(|| of_moments.into());
            schema.push(Column::new(field.name(), unit, Values::empty(kind)))?;
            let place = leaf_of(&metadata, field.name()).map_err(content)?;
            sources.push(Source { place, meaning });
        }
        schema.metadata.retain(|key, _| key != ARROW_KEY && !key.starts_with(UNIT_PREFIX));
        require_known_codecs(&metadata).map_err(content)?;
        Ok(Self {
            path: path.to_path_buf(),
            file: Arc::new(file),
            metadata,
            schema,
            sources,
            next_group: 0,
            columns: Vec::new(),
            rows_left: 0,
            rows_read: 0,
        })
    }

    /// The columns, without rows, and the metadata.
    pub fn schema(&self) -> &Table {
        &self.schema
    }

    /// The number of rows in the file.
    pub fn row_count(&self) -> usize {
        usize::try_from(self.metadata.file_metadata().num_rows()).unwrap_or(0)
    }

    fn next_part(&mut self) -> Result<Option<Table>, ContentError> {
        while self.rows_left == 0 {
            if self.next_group == self.metadata.num_row_groups() {
                return Ok(None);
            }
            self.open_group()?;
        }
        let rows = self.rows_left.min(BATCH_ROWS);
        let mut part = self.schema.without_rows();
        let readers = self.columns.iter_mut().zip(&self.sources);
        for (column, (reader, source)) in part.columns.iter_mut().zip(readers) {
            let place = Place { column: &column.name, first_row: self.rows_read };
            column.values = guarded(|| values_of(reader, source.meaning, rows, place))?;
        }
        self.rows_left -= rows;
        self.rows_read += rows;
        Ok(Some(part))
    }

    fn open_group(&mut self) -> Result<(), ContentError> {
        let group = self.metadata.row_group(self.next_group);
        let rows = usize::try_from(group.num_rows()).map_err(|_| ContentError::Unreadable)?;
        let open = |source: &Source| {
            let chunk = group.column(source.place);
            Ok(get_column_reader(chunk.column_descr_ptr(), pages_of(&self.file, chunk, rows)?))
        };
        self.columns = guarded(|| self.sources.iter().map(open).collect())?;
        (self.rows_left, self.next_group) = (rows, self.next_group + 1);
        Ok(())
    }
}

impl Iterator for ParquetReader {
    type Item = Result<Table, TableError>;

    fn next(&mut self) -> Option<Self::Item> {
        let part = self.next_part();
        if part.is_err() {
            // Nothing behind a mistake is read.
            (self.rows_left, self.next_group) = (0, self.metadata.num_row_groups());
        }
        part.map_err(|problem| content_error(&self.path, problem)).transpose()
    }
}

fn pages_of(
    file: &Arc<File>,
    chunk: &ColumnChunkMetaData,
    rows: usize,
) -> Result<Box<dyn PageReader>, ParquetError> {
    let pages = |chunk| SerializedPageReader::new(file.clone(), chunk, rows, None);
    if zstd::is_packed(chunk) {
        return Ok(Box::new(zstd::Unpacked::new(pages(&zstd::as_stored(chunk)?)?, chunk)));
    }
    Ok(Box::new(pages(chunk)?))
}

/// Opens a file that begins and ends with Parquet's mark.
fn open_marked(path: &Path) -> Result<File, TableError> {
    let system = |cause| TableError::File(FileError::from_io(path, cause));
    let mut file = File::open(path).map_err(system)?;
    let length = file.metadata().map_err(system)?.len();
    let problem = if length == 0 { ContentError::Empty } else { ContentError::NotParquet };
    let marked = length >= 12 && has_marks(&mut file).map_err(system)?;
    if marked {
        return Ok(file);
    }
    Err(TableError::Content { path: path.to_path_buf(), problem })
}

fn has_marks(file: &mut File) -> io::Result<bool> {
    let (mut first, mut last) = ([0; 4], [0; 4]);
    file.read_exact(&mut first)?;
    file.seek(SeekFrom::End(-4))?;
    file.read_exact(&mut last)?;
    file.rewind()?;
    Ok(&first == b"PAR1" && &last == b"PAR1")
}

fn notes_in(metadata: &ParquetMetaData) -> BTreeMap<String, String> {
    let notes = metadata.file_metadata().key_value_metadata().into_iter().flatten();
    notes.map(|note| (note.key.clone(), note.value.clone().unwrap_or_default())).collect()
}

fn require_different_names(fields: &[TypePtr]) -> Result<(), ContentError> {
    let mut known = BTreeSet::new();
    match fields.iter().find(|field| !known.insert(field.name())) {
        Some(twice) => Err(ContentError::DuplicateColumn { column: twice.name().to_owned() }),
        None => Ok(()),
    }
}

fn require_known_codecs(file: &ParquetMetaData) -> Result<(), ContentError> {
    let columns = file.row_groups().iter().flat_map(|group| group.columns());
    let unknown = columns.map(|column| (column, column.compression())).find(|(_, codec)| {
        use Compression as Codec;
        let known = [Codec::UNCOMPRESSED, Codec::SNAPPY, Codec::LZ4, Codec::LZ4_RAW];
        !known.contains(codec) && !matches!(codec, Codec::GZIP(_) | Codec::ZSTD(_))
    });
    match unknown {
        Some((column, codec)) => Err(ContentError::UnknownCodec {
            column: column.column_path().string(),
            codec: codec.to_string(),
        }),
        None => Ok(()),
    }
}

/// The fields asked for, or all.
fn chosen<'a>(
    fields: &'a [TypePtr],
    names: Option<&[&str]>,
) -> Result<Vec<&'a TypePtr>, TableError> {
    let Some(names) = names else { return Ok(fields.iter().collect()) };
    let find = |name: &&str| {
        let known = || fields.iter().map(|field| field.name());
        let found = fields.iter().find(|field| field.name() == *name);
        found.ok_or_else(|| unknown_column(name, known()))
    };
    names.iter().map(find).collect()
}

/// The place of a simple column among those that are stored.
fn leaf_of(file: &ParquetMetaData, name: &str) -> Result<usize, ContentError> {
    let stored = file.file_metadata().schema_descr().columns();
    let place = stored.iter().position(|column| column.path().parts() == [name]);
    place.ok_or(ContentError::Unreadable)
}

/// What a column's values stand for, beside the type in which they are stored.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meaning {
    /// Just what is stored.
    Stored,
    Signed,
    Unsigned,
    Text,
    /// A number of 16 bits.
    Half,
    /// A moment, as so many parts of a second since the beginning of 1970.
    Moment {
        parts: i64,
    },
    /// Something that has no place in a table, such as a list.
    Other,
}

fn meaning_of(info: &BasicTypeInfo) -> Meaning {
    use ConvertedType as Old;
    use LogicalType as New;
    match (info.logical_type_ref(), info.converted_type()) {
        (Some(New::Integer(integer)), _) if integer.is_signed => Meaning::Signed,
        (Some(New::Integer(_)), _) => Meaning::Unsigned,
        (Some(New::String | New::Enum | New::Json), _) => Meaning::Text,
        (Some(New::Float16), _) => Meaning::Half,
        (Some(New::Timestamp(moment)), _) => match moment.unit {
            TimeUnit::MILLIS => Meaning::Moment { parts: 1_000 },
            TimeUnit::MICROS => Meaning::Moment { parts: 1_000_000 },
            TimeUnit::NANOS => Meaning::Moment { parts: 1_000_000_000 },
        },
        (Some(_), _) => Meaning::Other,
        (None, Old::NONE) => Meaning::Stored,
        (None, Old::INT_8 | Old::INT_16 | Old::INT_32 | Old::INT_64) => Meaning::Signed,
        (None, Old::UINT_8 | Old::UINT_16 | Old::UINT_32 | Old::UINT_64) => Meaning::Unsigned,
        (None, Old::UTF8 | Old::ENUM | Old::JSON) => Meaning::Text,
        (None, Old::TIMESTAMP_MILLIS) => Meaning::Moment { parts: 1_000 },
        (None, Old::TIMESTAMP_MICROS) => Meaning::Moment { parts: 1_000_000 },
        (None, _) => Meaning::Other,
    }
}

/// The kind of column that holds a field's values, and what they stand for.
fn kind_of(field: &Type) -> Result<(Kind, Meaning), ContentError> {
    let unsupported = || ContentError::UnsupportedType {
        column: field.name().to_owned(),
        found: type_name(field),
    };
    let info = field.get_basic_info();
    if !field.is_primitive() || info.repetition() == Repetition::REPEATED {
        return Err(unsupported());
    }
    let meaning = meaning_of(info);
    let kind = match (field.get_physical_type(), meaning) {
        (Physical::BOOLEAN, Meaning::Stored) => Kind::Flag,
        (Physical::INT32 | Physical::INT64, Meaning::Stored | Meaning::Signed) => Kind::Integer,
        (Physical::INT32, Meaning::Unsigned) => Kind::Unsigned,
        (Physical::INT64, Meaning::Unsigned) => Kind::Integer,
        (Physical::INT64, Meaning::Moment { .. }) => Kind::Float,
        (Physical::FLOAT | Physical::DOUBLE, Meaning::Stored) => Kind::Float,
        (Physical::FIXED_LEN_BYTE_ARRAY, Meaning::Half) => Kind::Float,
        (Physical::BYTE_ARRAY, Meaning::Text) => Kind::Text,
        _ => return Err(unsupported()),
    };
    Ok((kind, meaning))
}

/// A type's name in Parquet, without its details.
fn type_name(field: &Type) -> String {
    let info = field.get_basic_info();
    let name = match (info.logical_type_ref(), info.converted_type()) {
        (Some(logical), _) => format!("{logical:?}"),
        (None, ConvertedType::NONE) if field.is_group() => "group".to_owned(),
        (None, ConvertedType::NONE) => format!("{:?}", field.get_physical_type()),
        (None, converted) => format!("{converted:?}"),
    };
    name.split('(').next().unwrap_or_default().to_owned()
}

/// Where rows stand in their file, for messages.
#[derive(Clone, Copy)]
struct Place<'a> {
    column: &'a str,
    first_row: usize,
}

impl Place<'_> {
    /// The row, counted from 1 in the whole file.
    fn row(self, index: usize) -> usize {
        self.first_row + index + 1
    }
}

/// The next rows of a column.
fn values_of(
    reader: &mut ColumnReader,
    meaning: Meaning,
    rows: usize,
    place: Place,
) -> Result<Values, ContentError> {
    use ColumnReader as Stored;
    Ok(match reader {
        Stored::BoolColumnReader(reader) => Values::Flag(stored(reader, rows, place)?),
        Stored::Int32ColumnReader(reader) if meaning == Meaning::Unsigned => {
            Values::Unsigned(converted(stored(reader, rows, place)?, i32::cast_unsigned))
        }
        Stored::Int32ColumnReader(reader) => {
            Values::Integer(converted(stored(reader, rows, place)?, i64::from))
        }
        Stored::Int64ColumnReader(reader) => {
            let values = stored(reader, rows, place)?;
            if let Meaning::Moment { parts } = meaning {
                return Ok(Values::Float(converted(values, |value| seconds(value, parts))));
            }
            if meaning == Meaning::Unsigned {
                require_63_bits(&values, place)?;
            }
            Values::Integer(values)
        }
        Stored::FloatColumnReader(reader) => {
            Values::Float(converted(stored(reader, rows, place)?, f64::from))
        }
        Stored::DoubleColumnReader(reader) => Values::Float(stored(reader, rows, place)?),
        Stored::ByteArrayColumnReader(reader) => {
            let texts = stored(reader, rows, place)?;
            let text = |bytes: &ByteArray| Ok(bytes.as_utf8()?.to_owned());
            Values::Text(texts.iter().map(text).collect::<Result<_, ParquetError>>()?)
        }
        Stored::FixedLenByteArrayColumnReader(reader) => {
            let half = |bytes: &FixedLenByteArray| match *bytes.data() {
                [low, high] => Ok(f16::from_le_bytes([low, high]).to_f64()),
                _ => Err(ContentError::Unreadable),
            };
            let halves = stored(reader, rows, place)?;
            Values::Float(halves.iter().map(half).collect::<Result<_, _>>()?)
        }
        Stored::Int96ColumnReader(_) => return Err(ContentError::Unreadable),
    })
}

/// A moment in seconds: whole ones and the rest, each of which is rounded less than a number of parts.
fn seconds(value: i64, parts: i64) -> f64 {
    value.div_euclid(parts) as f64 + value.rem_euclid(parts) as f64 / parts as f64
}

fn converted<A, B>(values: Vec<A>, convert: impl Fn(A) -> B) -> Vec<B> {
    values.into_iter().map(convert).collect()
}

/// The next rows as they are stored; all of them must be there.
fn stored<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    rows: usize,
    place: Place,
) -> Result<Vec<T::T>, ContentError> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    let (found, ..) = reader.read_records(rows, Some(&mut levels), None, &mut values)?;
    if let Some(index) = levels.iter().position(|level| *level == 0) {
        let column = place.column.to_owned();
        return Err(ContentError::Null { column, row: place.row(index) });
    }
    if found < rows {
        return Err(ParquetError::EOF("a column ends before its row group".to_owned()).into());
    }
    Ok(values)
}

fn require_63_bits(values: &[i64], place: Place) -> Result<(), ContentError> {
    match values.iter().position(|value| *value < 0) {
        Some(index) => Err(ContentError::TooLarge {
            column: place.column.to_owned(),
            row: place.row(index),
            value: values[index].cast_unsigned(),
        }),
        None => Ok(()),
    }
}

/// Calls the Parquet library so that a panic in it, which damaged lengths and offsets in a file
/// can cause (seen with version 60.1), becomes an error. What it worked on is not used again.
fn guarded<T>(call: impl FnOnce() -> Result<T, ContentError>) -> Result<T, ContentError> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or(Err(ContentError::Unreadable))
}

/// The operating system's error inside a Parquet error, if that is what it is.
fn system_error(error: ParquetError) -> Result<io::Error, ParquetError> {
    match error {
        ParquetError::External(inner) => {
            inner.downcast::<io::Error>().map(|cause| *cause).map_err(ParquetError::External)
        }
        other => Err(other),
    }
}

fn parquet_error(path: &Path, error: ParquetError) -> TableError {
    content_error(path, error.into())
}

fn content_error(path: &Path, problem: ContentError) -> TableError {
    let path = path.to_path_buf();
    let problem = match problem {
        ContentError::Damaged { source } => match system_error(source) {
            Ok(cause) => return TableError::File(FileError::from_io(&path, cause)),
            Err(source) => ContentError::Damaged { source },
        },
        other => other,
    };
    TableError::Content { path, problem }
}
