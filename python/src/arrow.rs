//! The Arrow C data interface: tables as streams of one batch whose buffers are the table's own.
//!
//! Only texts (offsets and bytes) and truth values (bits) are written anew. The structures are those
//! of the interface's specification; whoever holds one calls its `release` when done.

use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use servotwin::table::{Table, Values};
use std::ffi::{CString, c_char, c_int, c_void};
use std::ptr::{null, null_mut};
use std::sync::Arc;

#[repr(C)]
struct ArrowSchema {
    format: *const c_char,
    name: *const c_char,
    metadata: *const c_char,
    flags: i64,
    n_children: i64,
    children: *mut *mut ArrowSchema,
    dictionary: *mut ArrowSchema,
    release: Option<unsafe extern "C" fn(*mut ArrowSchema)>,
    private_data: *mut c_void,
}

#[repr(C)]
struct ArrowArray {
    length: i64,
    null_count: i64,
    offset: i64,
    n_buffers: i64,
    n_children: i64,
    buffers: *mut *const c_void,
    children: *mut *mut ArrowArray,
    dictionary: *mut ArrowArray,
    release: Option<unsafe extern "C" fn(*mut ArrowArray)>,
    private_data: *mut c_void,
}

#[repr(C)]
struct ArrowArrayStream {
    get_schema: Option<unsafe extern "C" fn(*mut ArrowArrayStream, *mut ArrowSchema) -> c_int>,
    get_next: Option<unsafe extern "C" fn(*mut ArrowArrayStream, *mut ArrowArray) -> c_int>,
    get_last_error: Option<unsafe extern "C" fn(*mut ArrowArrayStream) -> *const c_char>,
    release: Option<unsafe extern "C" fn(*mut ArrowArrayStream)>,
    private_data: *mut c_void,
}

// SAFETY: all three own what they point to and are used by one thread at a time.
unsafe impl Send for ArrowSchema {}
// SAFETY: as above.
unsafe impl Send for ArrowArray {}
// SAFETY: as above.
unsafe impl Send for ArrowArrayStream {}

/// What a schema points to.
struct SchemaOwner {
    _format: CString,
    _name: CString,
    _metadata: Option<Vec<u8>>,
    children: Vec<*mut ArrowSchema>,
}

/// What an array points to.
struct ArrayOwner {
    _table: Option<Arc<Table>>,
    _own: Vec<Vec<u8>>,
    _offsets: Vec<i64>,
    buffers: Vec<*const c_void>,
    children: Vec<*mut ArrowArray>,
}

/// What a stream points to.
struct StreamOwner {
    table: Arc<Table>,
    is_told: bool,
}

fn text(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).expect("no zero is left")
}

/// Key and value pairs as the interface packs them.
fn packed(pairs: &[(&str, &str)]) -> Option<Vec<u8>> {
    if pairs.is_empty() {
        return None;
    }
    let mut bytes = (pairs.len() as i32).to_ne_bytes().to_vec();
    for text in pairs.iter().flat_map(|(key, value)| [key, value]) {
        bytes.extend((text.len() as i32).to_ne_bytes());
        bytes.extend(text.as_bytes());
    }
    Some(bytes)
}

impl ArrowSchema {
    fn new(format: &str, name: &str, pairs: &[(&str, &str)], children: Vec<ArrowSchema>) -> Self {
        let (format, name, metadata) = (text(format), text(name), packed(pairs));
        let children: Vec<*mut ArrowSchema> =
            children.into_iter().map(|child| Box::into_raw(Box::new(child))).collect();
        let mut owner =
            Box::new(SchemaOwner { _metadata: metadata, _format: format, _name: name, children });
        ArrowSchema {
            format: owner._format.as_ptr(),
            name: owner._name.as_ptr(),
            metadata: owner._metadata.as_ref().map_or(null(), |bytes| bytes.as_ptr().cast()),
            // No value is ever missing: 2 would say that it may be.
            flags: 0,
            n_children: owner.children.len() as i64,
            children: owner.children.as_mut_ptr(),
            dictionary: null_mut(),
            release: Some(release_schema),
            private_data: Box::into_raw(owner).cast(),
        }
    }

    fn of_table(table: &Table) -> Self {
        let children = table.columns().iter().map(|column| {
            let format = match &column.values {
                Values::Float(_) => "g",
                Values::Integer(_) => "l",
                Values::Unsigned(_) => "I",
                Values::Flag(_) => "b",
                Values::Text(_) => "U",
            };
            let facts = [("unit", column.unit.as_str()), ("description", &column.description)];
            let pairs: Vec<_> = facts.into_iter().filter(|(_, text)| !text.is_empty()).collect();
            ArrowSchema::new(format, &column.name, &pairs, vec![])
        });
        let pairs: Vec<(&str, &str)> =
            table.metadata.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
        ArrowSchema::new("+s", "", &pairs, children.collect())
    }
}

/// # Safety
/// By contract of the interface: a schema made here, released once.
unsafe extern "C" fn release_schema(schema: *mut ArrowSchema) {
    // SAFETY: see above; children are boxes that were made in `ArrowSchema::new`.
    unsafe {
        let owner = Box::from_raw((*schema).private_data.cast::<SchemaOwner>());
        for &child in &owner.children {
            drop(Box::from_raw(child));
        }
        (*schema).release = None;
    }
}

impl Drop for ArrowSchema {
    fn drop(&mut self) {
        if let Some(release) = self.release {
            // SAFETY: whoever has taken the content over has set `release` to nothing.
            unsafe { release(self) };
        }
    }
}

impl ArrowArray {
    fn new(length: usize, owner: ArrayOwner) -> Self {
        let mut owner = Box::new(owner);
        ArrowArray {
            length: length as i64,
            null_count: 0,
            offset: 0,
            n_buffers: owner.buffers.len() as i64,
            n_children: owner.children.len() as i64,
            buffers: owner.buffers.as_mut_ptr(),
            children: owner.children.as_mut_ptr(),
            dictionary: null_mut(),
            release: Some(release_array),
            private_data: Box::into_raw(owner).cast(),
        }
    }

    fn of_column(table: &Arc<Table>, column: usize) -> Self {
        let (mut own, mut offsets) = (vec![], vec![]);
        let values = &table.columns()[column].values;
        let data: Vec<*const c_void> = match values {
            Values::Float(values) => vec![values.as_ptr().cast()],
            Values::Integer(values) => vec![values.as_ptr().cast()],
            Values::Unsigned(values) => vec![values.as_ptr().cast()],
            Values::Flag(values) => {
                own.push(bits(values));
                vec![own[0].as_ptr().cast()]
            }
            Values::Text(values) => {
                offsets.push(0);
                let mut bytes = vec![];
                for value in values {
                    bytes.extend(value.as_bytes());
                    offsets.push(bytes.len() as i64);
                }
                own.push(bytes);
                vec![offsets.as_ptr().cast(), own[0].as_ptr().cast()]
            }
        };
        let buffers = [null()].into_iter().chain(data).collect();
        let _table = Some(table.clone());
        let owner = ArrayOwner { _table, _own: own, _offsets: offsets, buffers, children: vec![] };
        ArrowArray::new(values.len(), owner)
    }

    fn of_table(table: &Arc<Table>) -> Self {
        let children = (0..table.columns().len())
            .map(|column| Box::into_raw(Box::new(ArrowArray::of_column(table, column))));
        let children = children.collect();
        let (_own, _offsets, buffers) = (vec![], vec![], vec![null()]);
        let owner = ArrayOwner { _table: None, _own, _offsets, buffers, children };
        ArrowArray::new(table.row_count(), owner)
    }
}

/// Truth values as bits, the first one lowest.
fn bits(values: &[bool]) -> Vec<u8> {
    let byte = |part: &[bool]| {
        part.iter().enumerate().fold(0, |byte, (place, &bit)| byte | u8::from(bit) << place)
    };
    values.chunks(8).map(byte).collect()
}

/// # Safety
/// By contract of the interface: an array made here, released once.
unsafe extern "C" fn release_array(array: *mut ArrowArray) {
    // SAFETY: see above; children are boxes that were made in `ArrowArray::of_table`. A child that
    // somebody has moved out has no `release` any more.
    unsafe {
        let owner = Box::from_raw((*array).private_data.cast::<ArrayOwner>());
        for &child in &owner.children {
            drop(Box::from_raw(child));
        }
        (*array).release = None;
    }
}

impl Drop for ArrowArray {
    fn drop(&mut self) {
        if let Some(release) = self.release {
            // SAFETY: as for schemas.
            unsafe { release(self) };
        }
    }
}

/// # Safety
/// By contract: a stream made here, and a place for a schema.
unsafe extern "C" fn get_schema(stream: *mut ArrowArrayStream, out: *mut ArrowSchema) -> c_int {
    // SAFETY: see above; `out` holds nothing that must be dropped.
    unsafe {
        let owner = &*(*stream).private_data.cast::<StreamOwner>();
        out.write(ArrowSchema::of_table(&owner.table));
    }
    0
}

/// # Safety
/// By contract: a stream made here, and a place for an array.
unsafe extern "C" fn get_next(stream: *mut ArrowArrayStream, out: *mut ArrowArray) -> c_int {
    // SAFETY: see above. The end of a stream is an array that is already released.
    unsafe {
        let owner = &mut *(*stream).private_data.cast::<StreamOwner>();
        if owner.is_told {
            out.write_bytes(0, 1);
        } else {
            owner.is_told = true;
            out.write(ArrowArray::of_table(&owner.table));
        }
    }
    0
}

unsafe extern "C" fn get_last_error(_: *mut ArrowArrayStream) -> *const c_char {
    null()
}

/// # Safety
/// By contract: a stream made here, released once.
unsafe extern "C" fn release_stream(stream: *mut ArrowArrayStream) {
    // SAFETY: see above.
    unsafe {
        drop(Box::from_raw((*stream).private_data.cast::<StreamOwner>()));
        (*stream).release = None;
    }
}

impl Drop for ArrowArrayStream {
    fn drop(&mut self) {
        if let Some(release) = self.release {
            // SAFETY: as for schemas.
            unsafe { release(self) };
        }
    }
}

/// A table as a stream, for `__arrow_c_stream__`.
pub(crate) fn stream<'py>(py: Python<'py>, table: &Arc<Table>) -> PyResult<Bound<'py, PyCapsule>> {
    let owner = Box::new(StreamOwner { table: table.clone(), is_told: false });
    let stream = ArrowArrayStream {
        get_schema: Some(get_schema),
        get_next: Some(get_next),
        get_last_error: Some(get_last_error),
        release: Some(release_stream),
        private_data: Box::into_raw(owner).cast(),
    };
    PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
}

/// The columns of a table, for `__arrow_c_schema__`.
pub(crate) fn schema<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyCapsule>> {
    PyCapsule::new_with_value(py, ArrowSchema::of_table(table), c"arrow_schema")
}

/// A table as schema and one batch, for `__arrow_c_array__`.
pub(crate) fn array<'py>(
    py: Python<'py>,
    table: &Arc<Table>,
) -> PyResult<(Bound<'py, PyCapsule>, Bound<'py, PyCapsule>)> {
    let batch = PyCapsule::new_with_value(py, ArrowArray::of_table(table), c"arrow_array")?;
    Ok((schema(py, table)?, batch))
}
