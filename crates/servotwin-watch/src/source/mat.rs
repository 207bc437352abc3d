//! Reads MAT files of version 5 (MATLAB's `-v6` and `-v7`, Octave, SciPy).
//!
//! A column is a numeric vector: a variable, or a field of a structure (`log.p_a`). Columns of a matrix get a number
//! after the name (`p_1`, `p_2`), and so do elements of an array of structures (`signals_2.values`). Scalars, text,
//! cells, complex and sparse arrays are skipped. The reader follows the published description of the format; every
//! length is checked against the file.

use super::groups::{ColumnGroup, Groups, bytes};
use super::{LogColumn, Source, SourceError, Wanted};
use servotwin_io::files::{self, FileError};
use servotwin_io::sanitize;
use std::io::Read as _;
use std::path::Path;

/// The largest file that is read, bytes; the format ends at 2 GiB.
const MAX_FILE: u64 = 1 << 31;

/// The largest unzipped variable, bytes.
const MAX_VARIABLE: u64 = 1 << 30;

/// The longest name, bytes; MATLAB's have at most 63 characters.
const MAX_NAME: usize = 256;

/// The deepest nesting of structures that is followed.
const MAX_DEPTH: usize = 16;

/// The most columns that are collected.
const MAX_COLUMNS: usize = 100_000;

// Element types.
const MATRIX: u32 = 14;
const ZIPPED: u32 = 15;

// Array classes.
const STRUCTURE: u8 = 2;
const NUMBERS: std::ops::RangeInclusive<u8> = 6..=15;

/// Opens a file that must have the wanted columns, all of one length.
///
/// # Errors
/// It cannot be read, is damaged, or lacks a column.
pub(crate) fn open(path: &Path, wanted: &Wanted) -> Result<Box<dyn Source>, SourceError> {
    let address = path.display().to_string();
    let mut reader = Reader { wanted: Some(wanted), found: vec![] };
    reader.file(path)?;
    let names: Vec<String> = reader.found.iter().map(|column| column.name.clone()).collect();
    wanted.require(&address, &names)?;
    let (mut times, mut all) = (None, vec![]);
    let mut first: Option<(String, usize)> = None;
    for (place, name) in wanted.names.iter().enumerate() {
        let column = reader.found.iter_mut().find(|column| column.name == *name);
        let Some(column) = column else { continue };
        let values = std::mem::take(&mut column.values);
        let (other, rows) = first.get_or_insert_with(|| (name.clone(), values.len()));
        if values.len() != *rows {
            let cause = format!(
                "'{}' has {} values and '{}' {rows}; the columns of one map have one length",
                sanitize::text(name),
                values.len(),
                sanitize::text(other)
            );
            return Err(SourceError::unreadable(&address, &cause));
        }
        if wanted.time == Some(place) {
            times = Some(values.clone());
        }
        all.push((place, values));
    }
    Ok(Box::new(Groups::new(&address, wanted, vec![ColumnGroup::new(times, all)])?))
}

/// The columns of a file; the format stores no units.
///
/// # Errors
/// It cannot be read, is damaged, or has no column.
pub(crate) fn columns(path: &Path) -> Result<Vec<LogColumn>, SourceError> {
    let mut reader = Reader { wanted: None, found: vec![] };
    reader.file(path)?;
    if reader.found.is_empty() {
        let cause = "no numeric vector of two or more values";
        return Err(SourceError::unreadable(&path.display().to_string(), cause));
    }
    Ok(reader.found.into_iter().map(|column| LogColumn::named(column.name)).collect())
}

struct FoundColumn {
    name: String,
    /// Empty if only names are wanted, or another column.
    values: Vec<f64>,
}

struct Reader<'w> {
    wanted: Option<&'w Wanted>,
    found: Vec<FoundColumn>,
}

/// A sequence of elements, read one after the other.
#[derive(Clone, Copy)]
struct Elements<'d> {
    data: &'d [u8],
    is_big: bool,
}

/// The header of an array.
struct ArrayHead<'d> {
    class: u8,
    is_complex: bool,
    /// Rows and columns; further dimensions are folded into the columns.
    rows: usize,
    columns: usize,
    name: &'d [u8],
}

type Outcome<T> = Result<T, String>;

impl Reader<'_> {
    fn file(&mut self, path: &Path) -> Result<(), SourceError> {
        let failed = |cause| FileError::from_io(path, cause);
        let address = path.display().to_string();
        let mut data = vec![];
        files::open(path)?.take(MAX_FILE + 1).read_to_end(&mut data).map_err(failed)?;
        if data.len() as u64 > MAX_FILE {
            return Err(SourceError::unreadable(
                &address,
                "longer than 2 GiB, the longest MAT file of version 5",
            ));
        }
        self.variables(&data).map_err(|cause| SourceError::unreadable(&address, &cause))
    }

    fn variables(&mut self, data: &[u8]) -> Outcome<()> {
        let is_big = byte_order(data)?;
        let mut elements = Elements { data: &data[128..], is_big };
        while let Some((kind, body)) = elements.next()? {
            match kind {
                MATRIX => self.array(Elements { data: body, is_big }, None, 0)?,
                ZIPPED => {
                    let unzipped = unzipped(body)?;
                    let mut inner = Elements { data: &unzipped, is_big };
                    if let Some((MATRIX, body)) = inner.next()? {
                        self.array(Elements { data: body, is_big }, None, 0)?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Reads an array. An array in a structure is named after its field.
    fn array(&mut self, mut inner: Elements, name: Option<&str>, depth: usize) -> Outcome<()> {
        let Some(head) = inner.head()? else { return Ok(()) };
        let own = String::from_utf8_lossy(head.name);
        let name = name.unwrap_or(&own);
        if head.class == STRUCTURE && depth < MAX_DEPTH {
            return self.structure(inner, &head, name, depth);
        }
        if !NUMBERS.contains(&head.class) || head.is_complex {
            return Ok(());
        }
        let Some((kind, body)) = inner.next()? else { return Ok(()) };
        let width = width(kind)?;
        let count = head
            .rows
            .checked_mul(head.columns)
            .filter(|count| count.checked_mul(width) == Some(body.len()));
        let Some(count) = count else {
            return Err(format!(
                "'{}' does not have the size that it states",
                sanitize::text(name)
            ));
        };
        let numbers = Numbers { body, kind, width, is_big: inner.is_big };
        if count < 2 {
            return Ok(());
        }
        if head.rows == 1 || head.columns == 1 {
            return self.column(name.to_owned(), numbers, 0..count);
        }
        for column in 0..head.columns {
            let range = column * head.rows..(column + 1) * head.rows;
            self.column(format!("{name}_{}", column + 1), numbers, range)?;
        }
        Ok(())
    }

    fn structure(
        &mut self,
        mut inner: Elements,
        head: &ArrayHead,
        name: &str,
        depth: usize,
    ) -> Outcome<()> {
        let damaged = || format!("the structure '{}' is damaged", sanitize::text(name));
        let (_, length) = inner.next()?.ok_or_else(damaged)?;
        let length =
            inner.number(length).filter(|length| (1..=MAX_NAME).contains(&(*length as usize)));
        let length = length.ok_or_else(damaged)?;
        let (_, names) = inner.next()?.ok_or_else(damaged)?;
        let fields: Vec<String> = names.chunks_exact(length as usize).map(text).collect();
        let count = head.rows.saturating_mul(head.columns);
        for element in 0..count {
            for field in &fields {
                // An unset field is stored as an empty array.
                let Some((kind, body)) = inner.next()? else { return Ok(()) };
                let number = if count > 1 { format!("_{}", element + 1) } else { String::new() };
                if kind == MATRIX {
                    let inside = Elements { data: body, is_big: inner.is_big };
                    self.array(inside, Some(&format!("{name}{number}.{field}")), depth + 1)?;
                }
            }
            if fields.is_empty() {
                break;
            }
        }
        Ok(())
    }

    fn column(
        &mut self,
        name: String,
        numbers: Numbers,
        range: std::ops::Range<usize>,
    ) -> Outcome<()> {
        if self.found.len() >= MAX_COLUMNS {
            return Err(format!("more than {MAX_COLUMNS} columns"));
        }
        let is_wanted = self.wanted.is_some_and(|wanted| wanted.names.contains(&name));
        let values =
            if is_wanted { range.map(|place| numbers.value(place)).collect() } else { vec![] };
        self.found.push(FoundColumn { name, values });
        Ok(())
    }
}

/// Whether the file is big-endian; rejects other formats.
fn byte_order(data: &[u8]) -> Outcome<bool> {
    let is_hdf = data.starts_with(b"MATLAB 7.3") || data.starts_with(b"\x89HDF");
    if is_hdf || data.get(512..516) == Some(b"\x89HDF") {
        return Err(
            "a MAT file of version 7.3 (HDF5), and version 5 is read; save it again with -v7: \
             save('log.mat', 'name', '-v7')"
                .into(),
        );
    }
    match data.get(124..128) {
        Some([0, 1, b'I', b'M']) => Ok(false),
        Some([1, 0, b'M', b'I']) => Ok(true),
        _ => {
            Err("no MAT file of version 5; save it with -v7: save('log.mat', 'name', '-v7')".into())
        }
    }
}

fn unzipped(packed: &[u8]) -> Outcome<Vec<u8>> {
    let mut found = vec![];
    let mut unzip = flate2::read::ZlibDecoder::new(packed).take(MAX_VARIABLE + 1);
    match unzip.read_to_end(&mut found) {
        Ok(length) if length as u64 <= MAX_VARIABLE => Ok(found),
        Ok(_) => Err("a variable of more than 1 GiB".into()),
        Err(_) => Err("a zipped variable is damaged".into()),
    }
}

fn text(name: &[u8]) -> String {
    let end = name.iter().position(|&byte| byte == 0).unwrap_or(name.len());
    String::from_utf8_lossy(&name[..end]).into_owned()
}

impl<'d> Elements<'d> {
    /// Decodes a four-byte number.
    fn number(&self, data: &[u8]) -> Option<u32> {
        let four = bytes(data, 0)?;
        Some(if self.is_big { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
    }

    /// The type and the bytes of the next element; `None` at the end.
    fn next(&mut self) -> Outcome<Option<(u32, &'d [u8])>> {
        if self.data.len() < 8 {
            return Ok(None);
        }
        let damaged = || "the file ends within a variable".to_owned();
        let kind = self.number(self.data).ok_or_else(damaged)?;
        // A small element packs its length beside its type, followed by its bytes.
        if kind >> 16 != 0 {
            let length = (kind >> 16) as usize;
            let body = self.data.get(4..4 + length).filter(|_| length <= 4).ok_or_else(damaged)?;
            self.data = &self.data[8..];
            return Ok(Some((kind & 0xffff, body)));
        }
        let length = self.number(&self.data[4..]).ok_or_else(damaged)? as usize;
        let body = self.data.get(8..8 + length).ok_or_else(damaged)?;
        // Elements are padded to multiples of eight, except after zipped ones.
        let padded = if kind == ZIPPED { length } else { length.next_multiple_of(8) };
        self.data = self.data.get(8 + padded..).unwrap_or_default();
        Ok(Some((kind, body)))
    }

    /// The header of an array; `None` for an empty one.
    fn head(&mut self) -> Outcome<Option<ArrayHead<'d>>> {
        let Some((_, flags)) = self.next()? else { return Ok(None) };
        let Some(flags) = self.number(flags) else { return Ok(None) };
        let Some((_, sizes)) = self.next()? else { return Ok(None) };
        let sizes: Vec<usize> = sizes
            .chunks_exact(4)
            .filter_map(|size| self.number(size))
            .map(|size| size as usize)
            .collect();
        let Some((_, name)) = self.next()? else { return Ok(None) };
        if name.len() > MAX_NAME {
            return Err("the name of a variable is damaged".into());
        }
        let (rows, others) =
            sizes.split_first().map_or((0, &[][..]), |(rows, others)| (*rows, others));
        Ok(Some(ArrayHead {
            class: flags as u8,
            is_complex: flags & 0x0800 != 0,
            rows,
            columns: others.iter().fold(1, |all, &size| all.saturating_mul(size)),
            name,
        }))
    }
}

/// The stored numbers of an array.
#[derive(Clone, Copy)]
struct Numbers<'d> {
    body: &'d [u8],
    kind: u32,
    width: usize,
    is_big: bool,
}

/// The size of a number type, bytes.
fn width(kind: u32) -> Outcome<usize> {
    match kind {
        1 | 2 => Ok(1),
        3 | 4 => Ok(2),
        5..=7 => Ok(4),
        9 | 12 | 13 => Ok(8),
        _ => Err(format!("numbers of the MAT type {kind}")),
    }
}

impl Numbers<'_> {
    fn value(&self, place: usize) -> f64 {
        let mut eight = [0; 8];
        let found = self.body.get(place * self.width..(place + 1) * self.width).unwrap_or_default();
        for (byte, &found) in eight.iter_mut().zip(found) {
            *byte = found;
        }
        if self.is_big {
            eight[..self.width].reverse();
        }
        let bits = u64::from_le_bytes(eight);
        match self.kind {
            1 => f64::from(bits as i8),
            3 => f64::from(bits as i16),
            5 => f64::from(bits as i32),
            7 => f64::from(f32::from_bits(bits as u32)),
            9 => f64::from_bits(bits),
            12 => bits as i64 as f64,
            _ => bits as f64,
        }
    }
}
