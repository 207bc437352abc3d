//! Model files: JSON with a format entry.
//!
//! A hierarchy has `names` (features, actuators, commands, details) and `stages`, in this order. Every
//! number in a stage is an index into one of these lists. A CART model has one entry per node in each of its arrays. A
//! node with `feature` 4294967295 is a leaf. A row goes `left` if its value is not above the `threshold`. Numbers are
//! written so that reading restores the same bits.
//!
//! The first line of a model is the SHA-256 of the file without this line, so a copy elsewhere is checked as well. A
//! model without that line is not checked: somebody has changed it on purpose.

use super::error::EvaluationError;
use crate::files::{self, FileError};
use crate::manifest;
use serde::Serialize;
use serde::de::DeserializeOwned;
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::borrow::Cow;
use std::path::Path;

/// What precedes the checksum, and what follows it.
const SEAL: (&str, &str) = ("{\n  \"sha256\": \"", "\",\n");
/// The number of digits of a checksum.
const DIGITS: usize = 64;

/// Writes a value as JSON, atomically. The same value gives the same bytes.
pub fn write(path: impl AsRef<Path>, value: &impl Serialize) -> Result<(), EvaluationError> {
    write_text(path.as_ref(), &to_json(path.as_ref(), value)?)
}

/// As [`write()`], with a checksum in the first line.
pub fn write_model(path: impl AsRef<Path>, model: &impl Serialize) -> Result<(), EvaluationError> {
    let plain = to_json(path.as_ref(), model)?;
    let sealed = plain.replacen(
        "{\n",
        &format!("{}{}{}", SEAL.0, manifest::sha256_of_text(&plain), SEAL.1),
        1,
    );
    write_text(path.as_ref(), &sealed)
}

fn write_text(path: &Path, text: &str) -> Result<(), EvaluationError> {
    manifest::forget(path)?;
    Ok(files::write_text(path, text)?)
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
/// [`EvaluationError::File`], also if the file contradicts its manifest or its checksum; [`EvaluationError::Model`]
/// with line and column.
pub fn read<T: DeserializeOwned>(path: impl AsRef<Path>) -> Result<T, EvaluationError> {
    let path = path.as_ref();
    manifest::check(path)?;
    parse(path, &files::read_text(path)?)
}

/// As [`read`], from the content of a file; `path` names it in errors.
pub fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, EvaluationError> {
    serde_json::from_str(&unsealed(path, text)?)
        .map_err(|source| EvaluationError::Model { path: path.to_path_buf(), source })
}

/// The text without the line of its checksum, which must be right.
fn unsealed<'t>(path: &Path, text: &'t str) -> Result<Cow<'t, str>, FileError> {
    let sealed = text.strip_prefix(SEAL.0).and_then(|rest| rest.split_at_checked(DIGITS));
    let Some((sum, rest)) = sealed.and_then(|(sum, rest)| Some((sum, rest.strip_prefix(SEAL.1)?)))
    else {
        let is_moved = text.contains("\"sha256\"");
        return if is_moved { Err(altered(path, "is not its first one")) } else { Ok(text.into()) };
    };
    let plain = format!("{{\n{rest}");
    if manifest::sha256_of_text(&plain) == sum {
        return Ok(plain.into());
    }
    Err(altered(path, "has the SHA-256 of another text"))
}

/// The error of a file whose checksum is wrong in some way.
fn altered(path: &Path, how: &str) -> FileError {
    let remedy =
        format!("its line \"sha256\" {how}; if you changed it on purpose, remove that line");
    FileError::Altered { path: path.into(), remedy }
}

/// Reads a diagnoser and checks it.
///
/// # Errors
/// As [`read`]; [`EvaluationError::CorruptModel`].
pub fn read_diagnoser(path: impl AsRef<Path>) -> Result<Diagnoser, EvaluationError> {
    let path = path.as_ref();
    let model: Diagnoser = read(path)?;
    let corrupt = |source| EvaluationError::CorruptModel { path: path.to_path_buf(), source };
    model.check().map_err(corrupt).map(|()| model)
}
