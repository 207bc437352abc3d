//! Detects whether a text is a system, a study or a study of recordings, and finds the text of a path or a built-in name.

use crate::built_in;
use crate::files::{self, FileError};
use crate::nearest::nearest;
use crate::toml_text::{Collector, Diagnostic};
use std::borrow::Cow;
use std::path::Path;
use toml::de::DeTable;

/// The type of a toolkit file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileType {
    /// Components and their connections.
    System,
    /// Faults, cases and sensors of a system.
    Study,
    /// Measured signals with labels instead of a system.
    Recordings,
}

impl FileType {
    /// The type of a text by the keys of its root, also where it is not valid TOML; `None` if it matches none of them,
    /// or several.
    pub fn of(text: &str) -> Option<Self> {
        let (root, _) = DeTable::parse_recoverable(text);
        let has = |keys: &[&str]| keys.iter().any(|key| root.get_ref().contains_key(*key));
        let is_system = has(&["components", "assemblies", "fluids"]);
        let is_study = has(&["command", "classes", "intensities", "sample_hz", "duration_s"]);
        match (is_system, is_study, has(&["window_rows"])) {
            (true, false, false) => Some(FileType::System),
            (false, true, false) => Some(FileType::Study),
            (false, false, true) => Some(FileType::Recordings),
            _ => None,
        }
    }

    /// The text at a path, and its name in messages. Built-in texts come before files, and those of this type before
    /// the others.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read(self, path: &Path) -> Result<(Cow<'static, str>, String), FileError> {
        let systems = ("systems", &built_in::SYSTEMS[..]);
        let studies = ("studies", &built_in::STUDIES[..]);
        let folders = match self {
            FileType::System => [systems, studies],
            FileType::Study | FileType::Recordings => [studies, systems],
        };
        let shown = path.display();
        let known = |list| path.to_str().and_then(|name| built_in::find(list, name));
        for (folder, list) in folders {
            if let Some(text) = known(list) {
                return Ok((text.into(), format!("{folder}/{shown}.toml")));
            }
        }
        let text = files::read_toml(path).map_err(|error| self.named(error))?;
        Ok((text.into(), shown.to_string()))
    }

    /// Treats a missing path without extension as a misspelled built-in name.
    fn named(self, error: FileError) -> FileError {
        let FileError::Missing { path } = error else { return error };
        let list = match self {
            FileType::System => &built_in::SYSTEMS[..],
            FileType::Study => &built_in::STUDIES[..],
            FileType::Recordings => return FileError::Missing { path },
        };
        let is_name = path.extension().is_none() && path.components().count() == 1;
        let Some(name) = path.to_str().filter(|_| is_name) else {
            return FileError::Missing { path };
        };
        let known: Vec<&str> = list.iter().map(|(known, _)| *known).collect();
        let nearest = nearest(name, known.iter().copied());
        FileError::NotBuiltIn { nearest, known, path }
    }

    fn words(self) -> &'static str {
        match self {
            FileType::System => "a system",
            FileType::Study => "a study",
            FileType::Recordings => "a study of recordings",
        }
    }

    /// The single mistake of a text that has another type.
    pub(crate) fn wanted(self, text: &str) -> Option<Collector> {
        let is = FileType::of(text).filter(|is| *is != self)?;
        let help = match (is, named_system(text)) {
            (FileType::Study, Some(name)) => format!("it is a study of the system '{name}'"),
            (FileType::Study, None) => "a study names its system".into(),
            (FileType::Recordings, _) => {
                "'servotwin study FILE' reads it".into()
            }
            (FileType::System, _) => {
                "a study names a system, its commands, sensors and faults; 'servotwin init' writes one".into()
            }
        };
        let message = format!("this is {}, not {}", is.words(), self.words());
        let mut mistakes = Collector::default();
        mistakes.note(&(0..0), Diagnostic::new(message).with_help(help));
        Some(mistakes)
    }
}

/// The system named at the root of a study file, even if other lines are not valid TOML.
pub(crate) fn named_system(text: &str) -> Option<String> {
    let (root, _) = DeTable::parse_recoverable(text);
    Some(root.get_ref().get("system")?.get_ref().as_str()?.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in::{STUDIES, SYSTEMS};

    #[test]
    fn what_is_built_in_is_what_it_is() {
        assert!(SYSTEMS.iter().all(|(_, text)| FileType::of(text) == Some(FileType::System)));
        assert!(STUDIES.iter().all(|(_, text)| FileType::of(text) == Some(FileType::Study)));
        let recordings = include_str!("../../../studies/liu_engine.toml");
        assert_eq!(FileType::of(recordings), Some(FileType::Recordings));
        assert_eq!(FileType::of("format = 1\n"), None);
        let named = |text: &str| named_system(text);
        assert_eq!(named("name = 1\nsystem = 'a.toml'  # beside\n").as_deref(), Some("a.toml"));
        assert_eq!(named("system_of = \"b\"\n[other]\nsystem = \"c.toml\"\n"), None);
    }
}
