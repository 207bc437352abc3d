//! What a proof showed, as data and as a page.

use crate::comparison::FolderComparison;
use crate::description::Description;
use crate::prove::{ProofEvidence, RowDifference};
use crate::source_file::SourceFile;
use serde::Serialize;
use servotwin_io::text::escaped;
use std::collections::BTreeMap;
use std::fmt::Write;

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
    pub holds: bool,
    /// What was exported.
    pub export: Description,
    /// The SHA-256 of each file that was compiled.
    pub compiled_sha256: BTreeMap<String, String>,
    /// How the text differs from what servotwin exports; then nothing is compiled.
    pub differences: Vec<RowDifference>,
    /// What each build was compared on.
    pub builds: Vec<ProofEvidence>,
    /// What was not compared.
    pub not_compared: Vec<String>,
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
    pub fn verdict(&self) -> &'static str {
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

    /// The certificate as a page that needs no other file.
    pub(crate) fn page(&self) -> String {
        let mut page = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>Proof of an export</title>\n\
             <style>body {{ font: 16px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em }} \
             td, th {{ text-align: left; padding: 0 1em 0 0; vertical-align: top }} td {{ font-family: monospace; \
             overflow-wrap: break-word }}</style>\n<h1>Proof of an export</h1>\n<p><strong>{}</strong></p>\n",
            self.verdict()
        );
        write_list(&mut page, "Differences", self.differences.iter().map(RowDifference::to_string));
        self.write_builds(&mut page);
        write_list(&mut page, "Not compared", self.not_compared.iter().cloned());
        let Description { version, diagnoser, diagnoser_sha256, sources_sha256, .. } = &self.export;
        let own = BTreeMap::from([(diagnoser.display().to_string(), diagnoser_sha256.clone())]);
        let _ = writeln!(page, "<p>Exported by servotwin {}.</p>", escaped(version));
        for (title, hashes) in [
            ("Diagnoser", &own),
            ("System, study and data", sources_sha256),
            ("Compiled files", &self.compiled_sha256),
        ] {
            write_hashes(&mut page, title, hashes);
        }
        page + "</html>\n"
    }

    fn write_builds(&self, page: &mut String) {
        *page += "<h2>Builds</h2>\n<table>\n<tr><th>Same bits<th>Compiler<th>Leaves<th>Thresholds<th>Rows<th>Samples\
             <th>Points and variants of the twin<th>Without a steady state<th>Samples of variants\
             <th>Samples of both together\n";
        for build in &self.builds {
            let same = if build.holds() { "yes" } else { "no" };
            let (command, version) = (escaped(&build.command), escaped(&build.version));
            let _ = writeln!(
                page,
                "<tr><td>{same}<td>{command}<br>{version}<td>{}<td>{}<td>{}<td>{}<td>{}, {}<td>{}<td>{}<td>{}",
                build.leaves,
                build.thresholds,
                build.rows + build.random_rows,
                build.samples,
                build.points,
                build.variants,
                build.unsettled,
                build.twin_samples,
                build.hybrid_samples
            );
        }
        *page += "</table>\n";
        if let Some(first) = self.builds.first() {
            let raised = first.raised.iter().map(|(action, count)| format!("{action} {count}"));
            let raised = raised.collect::<Vec<_>>().join(", ");
            let _ = writeln!(page, "<p>Actions raised by the samples: {}.</p>", escaped(&raised));
        }
    }
}

fn write_list(page: &mut String, title: &str, items: impl Iterator<Item = String>) {
    let items: String = items.map(|item| format!("<li>{}\n", escaped(&item))).collect();
    if !items.is_empty() {
        let _ = writeln!(page, "<h2>{title}</h2>\n<ul>\n{items}</ul>");
    }
}

fn write_hashes(page: &mut String, title: &str, hashes: &BTreeMap<String, String>) {
    let _ = writeln!(page, "<h2>{title}</h2>\n<table>\n<tr><th>File<th>SHA-256");
    for (name, hash) in hashes {
        let _ = writeln!(page, "<tr><td>{}<td>{hash}", escaped(name));
    }
    *page += "</table>\n";
}
