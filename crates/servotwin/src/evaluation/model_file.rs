//! Model files: JSON with a format entry.
//!
//! A hierarchy's file has `format`, `names` (features, actuators, commands, details) and `stages`, in this order. Every
//! number in a stage is an index into one of these lists. A CART model has one entry per node in each of its arrays. A
//! node with `feature` 4294967295 is a leaf. A row goes `left` if its value is not above the `threshold`. Numbers are
//! written so that reading restores the same bits.

use super::error::EvaluationError;
use crate::{files, manifest};
use serde::Serialize;
use serde::de::DeserializeOwned;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_diagnosis::panel::Panel;
use std::path::Path;

/// Writes a value as JSON, atomically. The same value gives the same bytes.
pub fn write(path: impl AsRef<Path>, value: &impl Serialize) -> Result<(), EvaluationError> {
    let path = path.as_ref();
    let text = to_json(path, value)?;
    manifest::forget(path)?;
    Ok(files::write_atomically(path, |out| out.write_all(text.as_bytes()))?)
}

fn to_json(path: &Path, value: &impl Serialize) -> Result<String, EvaluationError> {
    let json = serde_json::to_string_pretty(value);
    let mut text =
        json.map_err(|source| EvaluationError::Model { path: path.to_path_buf(), source })?;
    text.push('\n');
    Ok(text)
}

/// Reads a value from JSON.
///
/// [`EvaluationError::File`], also if the file contradicts its manifest; [`EvaluationError::Model`] with line and
/// column.
pub fn read<T: DeserializeOwned>(path: impl AsRef<Path>) -> Result<T, EvaluationError> {
    let path = path.as_ref();
    manifest::check(path)?;
    let text = files::read_text(path)?;
    serde_json::from_str(&text)
        .map_err(|source| EvaluationError::Model { path: path.to_path_buf(), source })
}

/// Reads a panel and checks it.
///
/// # Errors
/// As [`read`]; [`EvaluationError::CorruptModel`].
pub fn read_panel(path: impl AsRef<Path>) -> Result<Panel, EvaluationError> {
    let path = path.as_ref();
    let panel: Panel = read(path)?;
    panel
        .check()
        .map_err(|source| EvaluationError::CorruptModel { path: path.to_path_buf(), source })?;
    Ok(panel)
}

/// Reads a diagnoser and checks it.
///
/// # Errors
/// As [`read`]; [`EvaluationError::CorruptModel`].
pub fn read_diagnoser(path: impl AsRef<Path>) -> Result<Diagnoser, EvaluationError> {
    let path = path.as_ref();
    let diagnoser: Diagnoser = read(path)?;
    diagnoser
        .check()
        .map_err(|source| EvaluationError::CorruptModel { path: path.to_path_buf(), source })?;
    Ok(diagnoser)
}

/// Reads a hierarchy and checks it.
///
/// # Errors
/// As [`read`]; [`EvaluationError::CorruptModel`].
pub fn read_hierarchy(path: impl AsRef<Path>) -> Result<Hierarchy, EvaluationError> {
    let path = path.as_ref();
    let hierarchy: Hierarchy = read(path)?;
    hierarchy
        .check()
        .map_err(|source| EvaluationError::CorruptModel { path: path.to_path_buf(), source })?;
    Ok(hierarchy)
}
