//! What a proof showed, as data and for readers.

use crate::comparison::FolderComparison;
use crate::description::Description;
use crate::prove::{ProofEvidence, RowDifference};
use crate::source_file::SourceFile;
use serde::Serialize;
use servotwin::view::document::{Document, Fact, Table, Value, Verdict, fact};
use servotwin::view::row;
use std::collections::BTreeMap;

/// What no proof compares.
const NEVER_COMPARED: [&str; 3] = [
    "compilers, flags and processors other than those of the builds",
    "the program that calls the code, and the inputs that a reaction sets in the plant",
    "samples beyond those that were drawn: equality is enumerated for the trees alone",
];

/// The result of a proof.
#[derive(Debug, Clone, Serialize)]
pub struct Certificate {
    /// Whether every build decides as the diagnoser.
    pub(crate) holds: bool,
    /// What was exported.
    pub(crate) export: Description,
    /// The SHA-256 of each file that was compiled.
    pub(crate) compiled_sha256: BTreeMap<String, String>,
    /// How the text differs from what servotwin exports; then nothing is compiled.
    pub(crate) differences: Vec<RowDifference>,
    /// What each build was compared on.
    pub(crate) builds: Vec<ProofEvidence>,
    /// What was not compared.
    pub(crate) not_compared: Vec<String>,
}

impl Certificate {
    /// The certificate of a proof.
    pub fn new(export: Description, folder: FolderComparison, builds: Vec<ProofEvidence>) -> Self {
        let FolderComparison { files, differences, mut not_compared } = folder;
        let holds =
            differences.is_empty() && !builds.is_empty() && builds.iter().all(ProofEvidence::holds);
        let compiled_sha256 = SourceFile::hashes(&files);
        if builds.first().is_some_and(|first| first.unsettled == 0) {
            not_compared.push("a twin without a steady state: no variant was one".into());
        }
        not_compared.extend(NEVER_COMPARED.map(String::from));
        Certificate { holds, export, compiled_sha256, differences, builds, not_compared }
    }

    /// The verdict in one sentence.
    pub(crate) fn verdict(&self) -> &'static str {
        match self.holds {
            true => "Every build gives the bits of the trained diagnosis.",
            false if self.differences.is_empty() => {
                "NOT PROVEN: a build decides differently than the trained diagnosis."
            }
            false => {
                "NOT PROVEN: the folder does not hold what servotwin exports for this diagnosis."
            }
        }
    }

    /// The certificate for readers.
    pub fn document(&self) -> Document {
        let verdict = self.verdict();
        let verdict = if self.holds { Verdict::good(verdict) } else { Verdict::act(verdict) };
        let mut document = Document::new("prove", verdict);
        document.title = "Proof of an export".into();
        document.list("differences", self.differences.iter().map(RowDifference::to_string));
        let mut builds = Table::of("verdict:_ | command:build | version: | leaves_not_reached");
        for build in &self.builds {
            let verdict = if build.holds() { "same bits" } else { "DIFFERENT" };
            builds.push(row![verdict, &build.command, &build.version, build.leaves_not_reached]);
        }
        document.table("builds", builds);
        let differences = self.builds.iter().flat_map(|build| build.differences.iter().take(3));
        document.list("differences_of_builds", differences.map(RowDifference::to_string));
        document.facts("compared", self.builds.first().map_or_else(Vec::new, compared));
        document.heading("Not compared").detail();
        document.list("not_compared", self.not_compared.iter().map(String::as_str)).detail();
        let Description { version, diagnoser, diagnoser_sha256, sources_sha256, .. } = &self.export;
        document.text(format!("Exported by servotwin {version}.")).detail();
        let own = BTreeMap::from([(diagnoser.display().to_string(), diagnoser_sha256.clone())]);
        let mut files = Table::headed(["file", "SHA-256"]);
        for (name, hash) in own.iter().chain(sources_sha256).chain(&self.compiled_sha256) {
            files.push([name, hash]);
        }
        document.table("", files.captioned("Diagnoser, sources and compiled files")).detail();
        document.data("certificate", self);
        document
    }
}

/// What a build was compared on.
fn compared(build: &ProofEvidence) -> Vec<Fact> {
    let raised = build.raised.iter().map(|(action, count)| format!("{action} {count}"));
    let raised = raised.collect::<Vec<_>>().join(", ");
    vec![
        fact("leaves", "leaves of trees", build.leaves),
        fact("thresholds", "thresholds", build.thresholds),
        fact("rows", "rows", build.rows),
        fact("random_rows", "random rows", build.random_rows),
        fact("points", "points of the twin", build.points),
        fact("variants", "variants of the twin", build.variants),
        fact("unsettled", "of them without a steady state", build.unsettled),
        fact("twin_samples", "samples of the twin", build.twin_samples),
        fact("samples", "samples of the diagnosis", build.samples),
        fact("hybrid_samples", "samples of both together", build.hybrid_samples),
        fact("raised", "raised on the way", Value::of(raised, &build.raised)),
    ]
}
