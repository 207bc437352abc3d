//! A merge with missing parts, and the shell line that runs them.

use servotwin::campaign::MissingParts;
use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;

/// The missing parts of a merge, with the shell line that runs them.
#[derive(Debug)]
pub(crate) struct Incomplete {
    /// The output folder.
    pub folder: PathBuf,
    /// The scenario given to the merge.
    pub scenario: Option<String>,
    /// Descriptions of the campaigns with missing parts.
    pub names: Vec<String>,
    /// The missing rows of each campaign.
    pub missing: MissingParts,
}

impl Incomplete {
    /// The missing parts as JSON.
    pub(crate) fn to_json(&self) -> serde_json::Value {
        let rows = self.missing.campaigns.iter().map(|rows| {
            serde_json::json!({
                "scenarios": rows.scenarios.iter().map(|s| s.name()).collect::<Vec<_>>(),
                "training": rows.purpose == servotwin::study::Purpose::Train,
                "missing": rows.missing,
                "variants": rows.variants,
                "shares": rows.shares,
            })
        });
        serde_json::json!({
            "of": self.missing.of,
            "shares": self.missing.shares,
            "campaigns": rows.collect::<Vec<_>>(),
            "resubmit": self.resubmit(),
        })
    }

    /// One shell line that runs the missing parts.
    fn resubmit(&self) -> String {
        let MissingParts { of, shares, .. } = &self.missing;
        let folder = quoted(&self.folder.to_string_lossy()).into_owned();
        let mut command = format!("servotwin campaign {folder} --out {folder}");
        if let Some(scenario) = &self.scenario {
            command += &format!(" --scenario {scenario}");
        }
        match shares[..] {
            [share] => format!("{command} --share {share}/{of}"),
            _ => {
                let list: Vec<String> = shares.iter().map(usize::to_string).collect();
                format!("for share in {}; do {command} --share $share/{of}; done", list.join(" "))
            }
        }
    }
}

impl fmt::Display for Incomplete {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let MissingParts { of, campaigns, damaged, .. } = &self.missing;
        write!(out, "parts of the campaign are missing")?;
        for (name, rows) in self.names.iter().zip(campaigns) {
            let (missing, variants, shares) = (rows.missing, rows.variants, ranges(&rows.shares));
            let share = if rows.shares.len() == 1 { "share" } else { "shares" };
            write!(out, "\n  {name}: {missing} of {variants} rows, {share} {shares} of {of}")?;
        }
        if let Some(path) = damaged {
            write!(out, "\n  {} is damaged and counts as missing", path.display())?;
        }
        write!(out, "\nresubmit: {}", self.resubmit())
    }
}

/// Ascending numbers in the notation of job arrays: `2,5-7`.
fn ranges(numbers: &[usize]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b).map(|run| match run {
        [first, .., last] => format!("{first}-{last}"),
        _ => run.iter().map(usize::to_string).collect(),
    });
    runs.collect::<Vec<_>>().join(",")
}

/// Quotes a path for a POSIX shell.
fn quoted(path: &str) -> Cow<'_, str> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+".contains(c);
    match !path.is_empty() && path.chars().all(is_plain) {
        true => path.into(),
        false => format!("'{}'", path.replace('\'', "'\\''")).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_written_as_arrays_and_paths_as_a_shell_reads_them() {
        assert_eq!(ranges(&[2, 5, 6, 7, 9, 10]), "2,5-7,9-10");
        assert_eq!(quoted("/out/a-1"), "/out/a-1");
        assert_eq!(quoted("it's $here"), "'it'\\''s $here'");
    }
}
