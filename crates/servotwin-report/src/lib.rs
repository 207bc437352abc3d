//! The report: one HTML file for reliability engineers, and its figures as files.
//!
//! The file needs no network and no script, prints on paper, and is readable without color. A
//! section is one file in `sections/` and one line in [`CHAPTERS`]. A section without content for
//! a study (no third sensor, no realistic scenario) is left out. Results to act on come first; the
//! evidence behind them follows in an appendix. The same material gives the same bytes.

pub mod behavior;
pub(crate) mod examples;
pub mod explain;
pub mod lines;
mod looks;
pub mod measured;
mod overview;
pub mod schematic;
mod sections;
pub mod stages;
pub mod vocabulary;
pub mod words;
mod write;

use examples::Example;
use looks::Looks;
use sections::*;
use servotwin::job::flights::{FlightResults, SealedResults};
use servotwin::job::manifest::Manifest;
use servotwin::job::outcomes::FlownSuite;
use servotwin::job::results::SubjectResult;
use servotwin::job::{Results, Subject};
use servotwin::records::Comparison;
use servotwin::study::{Scenario, Study};
use servotwin_diagnosis::diagnoser::tuning::Constant;
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_view::document::{Content, Document, Form};
use vocabulary::Vocabulary;
pub use write::write;

/// Everything that a report is made from.
pub struct Material<'a> {
    /// The study.
    pub study: &'a Study,
    /// The results of the evaluation.
    pub results: &'a Results,
    /// The hierarchy of each subject.
    pub hierarchies: &'a [(Subject, Hierarchy)],
    /// The results of the flights, if the study has any.
    pub flights: Option<&'a FlightResults>,
    /// The results in sealed environments, if any were opened.
    pub sealed: Option<&'a SealedResults>,
    /// Healthy flights, each in an environment of its own.
    pub healthy: &'a [FlownSuite],
    /// The constants of the stored diagnosers, by scenario.
    pub constants: &'a [(Scenario, Vec<Constant>)],
    /// True and fitted parameters of the specimens in the fitted scenario.
    pub calibrations: &'a [Comparison],
    /// Simulated example faults.
    pub examples: &'a [Example],
    /// The origin of all results.
    pub manifest: &'a Manifest,
}

/// One section of the report.
pub struct Section {
    /// The anchor of the section in the HTML file.
    pub id: &'static str,
    /// The heading of the section.
    pub title: &'static str,
    /// Writes the section, or nothing if the study has no content for it.
    pub write: SectionWriter,
}

/// Writes a section, or nothing if the study has no content for it.
pub(crate) type SectionWriter = fn(&Material, &mut Document);

/// Sections that answer the same question. On screen the reader picks one of them; on paper they follow one another.
pub struct Chapter {
    /// The anchor of the chapter in the HTML file.
    pub id: &'static str,
    /// The heading of the chapter.
    pub(crate) title: &'static str,
    /// Whether the chapter is evidence for other chapters and stands in the appendix.
    pub(crate) is_appendix: bool,
    /// The sections of the chapter. The first is shown in front.
    pub sections: &'static [Section],
}

/// The chapters of the report in their order. A new section is one file and one line here.
pub static CHAPTERS: &[Chapter] = &[
    chapter("findings", "Findings", &[section("summary", "Summary", summary::write)]),
    chapter(
        "setup",
        "System, faults and commands",
        &[
            section("faults", "Faults", faults::write),
            section("system", "The system", system::write),
            section("commands", "Commands", commands::write),
        ],
    ),
    chapter(
        "visible",
        "Which faults are detected",
        &[section("detectability", "Detectability", detectability::write)],
    ),
    chapter("errors", "What errors do", &[section("safety", "Safety", safety::write)]),
    chapter(
        "work",
        "Faults that begin at work",
        &[
            section("flights", "The diagnosis at work", flights::write),
            section("unseen", "Faults never trained on", unseen::write),
        ],
    ),
    appendix(
        "limits",
        "Bands and the twin behind them",
        &[
            section("bands", "Bands", bands::write),
            section("twin", "The twin and its confidence", twin::write),
        ],
    ),
    appendix(
        "decisions",
        "How the trees decide",
        &[
            section("macrostructure", "How the trees hang together", macrostructure::write),
            section("trees", "The trees", actuator_tree::write),
        ],
    ),
    appendix(
        "examples",
        "Examples",
        &[section("residuals", "Residuals of examples", residuals::write)],
    ),
    appendix(
        "rates",
        "Rates by scenario and protocol",
        &[
            section("protocols", "Trees and committee under every protocol", protocols::write),
            section("committee", "The committee", committee::write),
            section("settings", "Settings", settings::write),
            section("confusion", "Confusion matrices", confusion::write),
            section("classifiers", "Classifiers compared", classifiers::write),
        ],
    ),
    appendix(
        "origin",
        "The data and how it was made",
        &[
            section("exclusions", "What was left out", exclusions::write),
            section("constants", "Constants of the diagnosis", constants::write),
            section("making", "How this was made", making::write),
        ],
    ),
];

const fn section(id: &'static str, title: &'static str, write: SectionWriter) -> Section {
    Section { id, title, write }
}

const fn chapter(id: &'static str, title: &'static str, sections: &'static [Section]) -> Chapter {
    Chapter { id, title, is_appendix: false, sections }
}

const fn appendix(id: &'static str, title: &'static str, sections: &'static [Section]) -> Chapter {
    Chapter { id, title, is_appendix: true, sections }
}

impl Material<'_> {
    /// The study's vocabulary.
    pub(crate) fn words(&self) -> Vocabulary {
        Vocabulary::of(self.study)
    }

    /// The plot styles of the study's actuators, commands and failures.
    fn looks(&self) -> Looks {
        Looks::of(self.study)
    }

    /// The subject whose trees are drawn: the one with noise, or the first if there is none. Trees that never saw noise
    /// split on differences that no sensor resolves.
    pub(crate) fn main(&self) -> Option<&SubjectResult> {
        self.results.of(Subject::Noise).or(self.results.subjects.first())
    }

    /// The hierarchy of a subject, if the report has it.
    pub(crate) fn hierarchy(&self, subject: Subject) -> Option<&Hierarchy> {
        self.hierarchies.iter().find(|(own, _)| *own == subject).map(|(_, hierarchy)| hierarchy)
    }
}

/// Shows the last (hardest) scenario, and folds the others.
fn hardest_first(
    results: &[&SubjectResult],
    page: &mut Document,
    show: &dyn Fn(&SubjectResult, &mut Document),
) {
    let Some((hardest, others)) = results.split_last() else { return };
    show(hardest, page);
    for result in others {
        page.folded(&format!("Scenario: {}", result.title), |page| show(result, page));
    }
}

/// The report.
pub fn document(material: &Material) -> Document {
    let mut page = Document::section("report", material.study.title.as_str());
    overview::write(material, &mut page);
    for chapter in CHAPTERS {
        let written = chapter.document(material);
        if !written.is_empty() {
            page.push(chapter.id, Content::Section(written)).is_detail = chapter.is_appendix;
        }
    }
    page
}

impl Chapter {
    /// The sections that have content. The reader chooses among several.
    fn document(&self, material: &Material) -> Document {
        let mut chapter = Document::section(self.id, self.title).formed(Form::Choices);
        for section in self.sections {
            let mut inner = Document::section(section.id, section.title);
            (section.write)(material, &mut inner);
            chapter.add(inner);
        }
        chapter
    }
}
