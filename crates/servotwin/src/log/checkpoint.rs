//! Where a watch can go on after it was stopped: the place in the log, what the sequencer holds, what
//! was counted, and everything the observer knows.
//!
//! Numbers are kept by their bits: what comes after is the same as without the stop.

use super::Progress;
use super::map::Map;
use crate::files::{self, FileError};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use sha2::{Digest, Sha256};
use std::fmt;
use std::path::{Path, PathBuf};

/// The format of checkpoints that this version writes and reads.
const FORMAT: u32 = 2;

/// A watch between two rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    format: u32,
    /// The map file, as a number.
    map: String,
    #[serde(with = "super::bits::one")]
    period_s: f64,
    progress: Progress,
    /// The observer as it saved itself.
    #[serde(serialize_with = "to_hex", deserialize_with = "from_hex")]
    pub(super) observer: Vec<u8>,
}

/// Why a checkpoint cannot be written or used.
#[derive(Debug)]
pub enum CheckpointError {
    /// The file.
    File(FileError),
    /// It is no checkpoint, or damaged.
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        cause: String,
    },
    /// It was written with another map or period.
    Other {
        /// Which of them.
        what: &'static str,
    },
    /// The log is shorter than it was.
    ShortLog {
        /// The line or row at which it went on.
        needed: u64,
    },
    /// The observer cannot go on from it.
    Observer(String),
}

impl fmt::Display for CheckpointError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CheckpointError::File(error) => write!(out, "{error}"),
            CheckpointError::Content { path, cause } => {
                write!(out, "{}: no checkpoint that can be used: {cause}", path.display())
            }
            CheckpointError::Other { what } => {
                write!(out, "the checkpoint was written with another {what}")
            }
            CheckpointError::ShortLog { needed } => {
                write!(out, "the log ends before row {needed}, where the checkpoint was written")
            }
            CheckpointError::Observer(cause) => {
                write!(out, "the diagnosis cannot go on from the checkpoint: {cause}")
            }
        }
    }
}

impl std::error::Error for CheckpointError {}

impl Checkpoint {
    /// What is known now.
    pub(super) fn new(progress: &Progress, map: &Map, period_s: f64, observer: Vec<u8>) -> Self {
        let map = fingerprint(map);
        Checkpoint { format: FORMAT, map, period_s, progress: progress.clone(), observer }
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// The file cannot be read, or is no checkpoint.
    pub fn read(path: &Path) -> Result<Self, CheckpointError> {
        let text = files::read_text(path).map_err(CheckpointError::File)?;
        let content = |cause: String| CheckpointError::Content { path: path.into(), cause };
        let read: Checkpoint =
            serde_json::from_str(&text).map_err(|error| content(error.to_string()))?;
        match read.format {
            FORMAT => Ok(read),
            found => Err(content(format!("format {found}, this version reads {FORMAT}"))),
        }
    }

    /// Writes a checkpoint, whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), CheckpointError> {
        let fill = |out: &mut dyn std::io::Write| Ok(serde_json::to_writer(out, self)?);
        files::write_atomically(path, fill).map_err(CheckpointError::File)
    }

    /// How many changes the observer had told.
    pub fn events(&self) -> u64 {
        self.progress.changes
    }

    pub(super) fn progress(&self, map: &Map, period_s: f64) -> Result<Progress, CheckpointError> {
        if self.map != fingerprint(map) {
            return Err(CheckpointError::Other { what: "map" });
        }
        if self.period_s != period_s {
            return Err(CheckpointError::Other { what: "period" });
        }
        if !self.progress.has_width(map.width()) {
            return Err(CheckpointError::Other { what: "number of inputs and sensors" });
        }
        Ok(self.progress.clone())
    }
}

fn fingerprint(map: &Map) -> String {
    hex(&Sha256::digest(map.text().as_bytes()))
}

fn hex(bytes: &[u8]) -> String {
    use fmt::Write;
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

fn to_hex<S: Serializer>(bytes: &[u8], to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&hex(bytes))
}

fn from_hex<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<u8>, D::Error> {
    let text = String::deserialize(from)?;
    let pair = |pair: &[u8; 2]| {
        let text = std::str::from_utf8(pair).ok()?;
        u8::from_str_radix(text, 16).ok()
    };
    let (pairs, rest) = text.as_bytes().as_chunks();
    let bytes: Option<Vec<u8>> = pairs.iter().map(pair).collect();
    let wrong = || serde::de::Error::custom("the observer's part is no hexadecimal text");
    bytes.filter(|_| rest.is_empty()).ok_or_else(wrong)
}
