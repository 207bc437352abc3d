//! State from which a stopped watch resumes: position in the log, sequencer, counts and observer state.
//!
//! Numbers are stored as their bits, so that a resumed watch gives the same results as an uninterrupted one.
//!
//! The file has two lines of JSON. The first holds the format and the SHA-256 of the second; the second holds the
//! content. A file that is damaged, or was changed by hand, has another checksum and is rejected with a message.

use super::Progress;
use super::map::Map;
use serde::{Deserialize, Serialize};
use servotwin::manifest::sha256_of_text;
use servotwin_io::files::{self, FileError};
use std::path::{Path, PathBuf};

/// The format of checkpoints that this version writes and reads.
const FORMAT: u32 = 1;

/// The first line of the file.
#[derive(Debug, Serialize, Deserialize)]
struct Head {
    format: u32,
    /// The checksum of the second line without its end.
    sha256: String,
}

/// The state of a watch between two rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// Fingerprint of the map file.
    map: String,
    #[serde(with = "super::bits::one")]
    period_s: f64,
    progress: Progress,
    /// The observer as it saved itself.
    pub(super) observer: String,
}

/// Why a checkpoint cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum CheckpointError {
    /// The file is missing or cannot be read.
    #[error(transparent)]
    Unreadable(FileError),
    /// The file is not a checkpoint, or it is damaged.
    #[error("{path}: no checkpoint that can be used: {cause}")]
    Content { path: PathBuf, cause: String },
    /// It was written with another map or period.
    #[error("the checkpoint was written with another {what}")]
    Other { what: &'static str },
    /// The log is shorter than it was.
    #[error("the log ends before row {needed}, where the checkpoint was written")]
    ShortLog { needed: u64 },
    /// The observer rejects its stored state.
    #[error("the diagnosis cannot go on from the checkpoint: {0}")]
    Observer(String),
}

impl Checkpoint {
    /// Captures the current state.
    pub(super) fn new(progress: &Progress, map: &Map, period_s: f64, observer: String) -> Self {
        let map = sha256_of_text(map.text());
        Checkpoint { map, period_s, progress: progress.clone(), observer }
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// The file cannot be read, or is no checkpoint.
    pub fn read(path: &Path) -> Result<Self, CheckpointError> {
        let text = files::read_text(path).map_err(CheckpointError::Unreadable)?;
        let path = path.to_path_buf();
        Self::parse(&text).map_err(|cause| CheckpointError::Content { path, cause })
    }

    /// A checkpoint from the text of its file.
    fn parse(text: &str) -> Result<Self, String> {
        let (first, body) = text.split_once('\n').unwrap_or((text, ""));
        let head: Head = serde_json::from_str(first).map_err(|error| error.to_string())?;
        if head.format != FORMAT {
            return Err(format!("format {}, this version reads {FORMAT}", head.format));
        }
        let body = body.trim_end();
        if sha256_of_text(body) != head.sha256 {
            return Err("its checksum is wrong: it is damaged, or was changed by hand".into());
        }
        serde_json::from_str(body).map_err(|error| error.to_string())
    }

    /// Writes a checkpoint, whole or not at all.
    pub(super) fn write(&self, path: &Path) -> Result<(), FileError> {
        let fill = |out: &mut dyn std::io::Write| {
            let body = serde_json::to_string(self)?;
            let head = Head { format: FORMAT, sha256: sha256_of_text(&body) };
            writeln!(out, "{}\n{body}", serde_json::to_string(&head)?)
        };
        files::write_atomically(path, fill)
    }

    /// How many changes the observer had reported.
    pub fn events(&self) -> u64 {
        self.progress.changes
    }

    pub(super) fn progress(&self, map: &Map, period_s: f64) -> Result<&Progress, CheckpointError> {
        let checks = [
            (self.map == sha256_of_text(map.text()), "map"),
            (self.period_s.to_bits() == period_s.to_bits(), "period"),
            (self.progress.held.len() == map.width(), "system"),
        ];
        match checks.into_iter().find(|(holds, _)| !holds) {
            Some((_, what)) => Err(CheckpointError::Other { what }),
            None => Ok(&self.progress),
        }
    }
}
