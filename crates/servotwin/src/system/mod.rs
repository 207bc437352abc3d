//! System files: a system of catalogue components as data.
//!
//! The format is described in `docs/system-format.md`. A file is read to a
//! [`Network`] and compiled; every mistake is reported at its place, and as
//! many as possible at once.
//!
//! ```
//! use servotwin::system::System;
//!
//! let system = System::parse(
//!     r#"
//!     format = 1
//!     name = "leaking_volume"
//!     [components.supply]
//!     kind = "pressure_source"
//!     [components.leak]
//!     kind = "orifice"
//!     area_m2 = 1e-7
//!     [components.chamber]
//!     kind = "volume"
//!     volume_m3 = 1e-4
//!     [system]
//!     connections = [["supply.port", "leak.a"], ["leak.b", "chamber.port"]]
//!     "#,
//!     "leaking_volume.toml",
//! )?;
//! assert_eq!(system.program.states()[0].name, "chamber.pressure_pa");
//! # Ok::<(), servotwin::system::SystemError>(())
//! ```

mod check;
mod mistake;
mod read;
mod rewrite;
mod scope;
pub(crate) mod units;

pub use mistake::Mistake;
pub use rewrite::{NewValue, RewriteError};

use crate::document::Located;
use crate::files::{self, FileError};
use servotwin_model::network::Network;
use servotwin_model::program::Program;
use servotwin_model::spec::Unit;
use std::fmt;
use std::path::Path;

/// The format of system files that this version reads.
pub const FORMAT: u32 = 1;

/// The system that is used where none is named: an aileron with two actuators.
const DEFAULT: &str = include_str!("../../../../systems/aileron_dual.toml");

/// A measured signal, compared with the virtual twin's.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// The id, unique among sensors, e.g. `p_a_1`.
    pub id: String,
    /// What figures and tables show, e.g. `p_A1`.
    pub label: String,
    /// The component's output, as a program observes it.
    pub signal: String,
    /// The component.
    pub component: usize,
    /// The unit of the signal.
    pub unit: Unit,
    /// What residuals are divided by.
    pub scale: f64,
}

/// A system that can be simulated.
pub struct System {
    /// The name in files and commands.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// The compiled equations.
    pub program: Program,
    /// The measured signals, in the order of the file.
    pub sensors: Vec<Sensor>,
    /// The file's text, to be kept beside results.
    pub text: String,
}

/// Why there is no system.
#[derive(Debug)]
pub enum SystemError {
    /// The file cannot be read.
    File(FileError),
    /// The file has mistakes.
    Mistakes {
        /// The file, as it was named.
        path: String,
        /// All that were found, in the order of the file.
        mistakes: Vec<Located<Mistake>>,
    },
}

impl fmt::Display for SystemError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SystemError::File(error) => write!(out, "{error}"),
            SystemError::Mistakes { path, mistakes } => {
                for mistake in mistakes {
                    mistake.write(out, path)?;
                    writeln!(out)?;
                }
                let count = mistakes.len();
                write!(out, "{path}: {count} mistake{}", if count == 1 { "" } else { "s" })
            }
        }
    }
}

impl std::error::Error for SystemError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            SystemError::File(error) => Some(error),
            SystemError::Mistakes { .. } => None,
        }
    }
}

impl System {
    /// Reads a system from a text; `path` is only shown in mistakes.
    ///
    /// # Errors
    /// Every mistake that was found.
    pub fn parse(text: &str, path: &str) -> Result<Self, SystemError> {
        let mut reader = read::Reader::new();
        reader.read(text);
        // Of a file that could not be read at all, nothing more is said.
        let readable = !reader.scope.parts.is_empty() || reader.mistakes.is_empty();
        let program = if readable { check::compile(&mut reader) } else { None };
        match program {
            Some(program) => Ok(Self {
                name: reader.name,
                title: reader.title,
                program,
                sensors: reader.sensors,
                text: text.into(),
            }),
            None => {
                let mistakes = reader.mistakes.locate(text);
                Err(SystemError::Mistakes { path: path.into(), mistakes })
            }
        }
    }

    /// Reads a system file.
    ///
    /// # Errors
    /// The file cannot be read, or has mistakes.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, SystemError> {
        let path = path.as_ref();
        let text = files::read_text(path).map_err(SystemError::File)?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Components, connections and inputs.
    pub fn network(&self) -> &Network {
        self.program.network()
    }

    /// A sensor by id.
    pub fn sensor(&self, id: &str) -> Option<&Sensor> {
        self.sensors.iter().find(|sensor| sensor.id == id)
    }
}

impl Default for System {
    /// The aileron with two actuators of `systems/aileron_dual.toml`.
    fn default() -> Self {
        let system = Self::parse(DEFAULT, "systems/aileron_dual.toml");
        system.unwrap_or_else(|error| panic!("the embedded system is wrong:\n{error}"))
    }
}
