//! An export beside what its diagnoser and its twin are exported as.

use crate::description::{DESCRIPTION, Description};
use crate::prove::RowDifference;
use crate::source_file::SourceFile;
use servotwin_io::sanitize;
use std::collections::{BTreeMap, BTreeSet};

/// The SHA-256 of files, by name.
type Hashes = BTreeMap<String, String>;

/// How a folder differs from what its diagnoser and its twin are exported as.
#[derive(Debug, Clone, Default)]
pub struct FolderComparison {
    /// The files as they are now.
    pub files: Vec<SourceFile>,
    /// Differences of the text and of the description.
    pub differences: Vec<RowDifference>,
    /// What is there and was not compared.
    pub not_compared: Vec<String>,
}

impl FolderComparison {
    pub(crate) fn differ(&mut self, place: &str, what: &str) {
        self.differences.push(RowDifference { place: place.into(), what: what.into() });
    }

    pub(crate) fn description(&mut self, exported: &Description, right: &Description) {
        if exported.version != right.version {
            let what = format!("exported by {}, not by {}", exported.version, right.version);
            self.differ("servotwin", &what);
        }
        if exported.diagnoser_sha256 != right.diagnoser_sha256 {
            let what = format!(
                "the diagnoser {} is not the one that was exported",
                right.diagnoser.display()
            );
            self.differ(DESCRIPTION, &what);
        }
        // A study and a diagnoser may have moved since.
        let twin =
            |description: &Description| (description.twin.system, description.twin.has_fixed_step);
        if twin(exported) != twin(right) {
            self.differ(DESCRIPTION, "the study has another system");
        }
        let sources = (&exported.sources_sha256, &right.sources_sha256);
        self.hashes(sources, "the file beside the diagnoser");
        self.hashes((&exported.files_sha256, &right.files_sha256), "its text");
    }

    /// Compares lists of hashes, in both directions.
    fn hashes(&mut self, (exported, right): (&Hashes, &Hashes), of: &str) {
        let names: BTreeSet<&String> = exported.keys().chain(right.keys()).collect();
        for name in names {
            if exported.get(name) != right.get(name) {
                self.differ(DESCRIPTION, &format!("the SHA-256 of {name} is not that of {of}"));
            }
        }
    }

    /// Compares the text of a file line by line.
    pub(crate) fn file(&mut self, right: &SourceFile, text: String) {
        if text != right.text {
            let pairs = text.split('\n').zip(right.text.split('\n'));
            let line = pairs.take_while(|(a, b)| a == b).count();
            let pair = [&text, &right.text].map(|text| text.split('\n').nth(line));
            let (said, wanted) = (pair[0].unwrap_or_default(), pair[1].unwrap_or_default());
            let same = said.chars().zip(wanted.chars()).take_while(|(a, b)| a == b).count();
            let shown = pair.map(|line| match line {
                Some(line) => {
                    let part: String = line.chars().skip(same.saturating_sub(20)).collect();
                    format!("'{}'", sanitize::text(&part))
                }
                None => "nothing".into(),
            });
            let place = format!("{}, line {}", right.name, line + 1);
            self.differ(&place, &format!("{} instead of {}", shown[0], shown[1]));
        }
        self.files.push(SourceFile { name: right.name, text });
    }
}
