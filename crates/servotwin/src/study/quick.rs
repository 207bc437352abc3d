//! The two sizes of a study: as its file declares it, and smaller for a first result.
//!
//! A study with the section `[quick]` runs in the smaller size unless `full = true` stands at the top of its file.
//! [`Study::full`] adds that line, so the text beside the results states their size.

use super::keys::{RUN_S, SPECIMENS};
use super::{FORMAT, Study};
use crate::format::section;
use crate::system::System;
use crate::toml_text::{Collector, TomlError, TomlText, get};

section! {
    /// The section of a study file.
    #[derive(Copy)]
    pub(super) struct Text {
        may duration_s: Option<f64> = RUN_S, "maximum length of a run";
        may draws: Option<usize> = SPECIMENS,
            "maximum number of training commands from each pattern";
        may healthy: Option<usize> = SPECIMENS, "maximum number of healthy specimens in each case";
    }
}

impl super::Text {
    pub(super) fn is_full(&self) -> bool {
        self.full || self.quick.is_none()
    }

    /// Returns the text with the sizes that apply.
    pub(super) fn in_its_size(mut self) -> Self {
        let Some(quick) = self.quick.filter(|_| !self.full) else { return self };
        at_most(&mut self.duration_s, quick.duration_s);
        if let Some(training) = &mut self.training {
            let training = &mut training.value;
            at_most(&mut training.duration_s.value, quick.duration_s);
            at_most(&mut training.healthy, quick.healthy);
            training.draws.iter_mut().for_each(|draws| at_most(&mut draws.count, quick.draws));
        }
        if let Some(realistic) = &mut self.realistic {
            at_most(&mut realistic.healthy, quick.healthy);
        }
        self
    }
}

fn at_most<T: PartialOrd>(value: &mut T, limit: Option<T>) {
    if let Some(limit) = limit.filter(|limit| limit < value) {
        *value = limit;
    }
}

impl Study {
    /// Returns the study in its full size.
    ///
    /// # Errors
    /// Mistakes that show only in the full size.
    pub fn full(&self) -> Result<Self, TomlError> {
        let system = System::parse(&self.system.text, &self.path)?;
        Self::parse_for(&self.full_text(), &self.path, system)
    }

    /// Whether the file also declares a smaller size.
    pub fn has_quick_size(&self) -> bool {
        self.parsed.quick.is_some()
    }

    /// The text of the study in its full size.
    pub(crate) fn full_text(&self) -> String {
        if self.is_full { self.text.clone() } else { with_flag(&self.text, "full") }
    }
}

/// The text of a study file with a key of its top level added or set to `true`.
pub(super) fn with_flag(text: &str, key: &str) -> String {
    let document = TomlText::parse(text, FORMAT, &mut Collector::default());
    let root = document.as_ref().map(TomlText::root).unwrap_or_default();
    match get(&root, key) {
        Some(entry) => {
            let mut text = text.to_owned();
            text.replace_range(entry.value_at(), "true");
            text
        }
        None => format!("{key} = true\n{text}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_full_size_is_what_the_file_declares() {
        let quick = Study::default();
        let draws = |study: &Study| study.training.as_ref().unwrap().cases.len();
        let quick_sizes = (quick.duration_s, draws(&quick), quick.text.clone());
        let full = quick.full().unwrap();
        assert!(full.is_full && full.duration_s > quick_sizes.0 && draws(&full) > quick_sizes.1);
        assert!(full.text.ends_with(&quick_sizes.2));
        // The stored text gives the same study again.
        let again = Study::parse(&full.text, "study.toml").unwrap();
        assert_eq!((again.duration_s, draws(&again)), (full.duration_s, draws(&full)));
        assert_eq!(again.full().unwrap().text, full.text);
    }

    #[test]
    fn full_replaces_a_false_that_stands_there() {
        let text = "name = \"a\"\nfull = false # not yet\n[command]\n";
        assert_eq!(with_flag(text, "full"), "name = \"a\"\nfull = true # not yet\n[command]\n");
    }
}
