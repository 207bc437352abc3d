//! The report: one HTML file for reliability engineers, and its figures as files.
//!
//! The file needs no network and no script, prints on paper, and is readable without color. A
//! section is one file in `sections/` and one line in [`CHAPTERS`]. A section without content for
//! a study (no third sensor, no realistic scenario) is left out. Results to act on come first; the
//! evidence behind them follows in an appendix. The same material gives the same bytes.

pub(crate) mod examples;
pub mod explain;
pub mod lines;
mod looks;
pub mod measured;
mod overview;
pub mod schematic;
mod sections;
mod stages;
pub mod table;
pub mod vocabulary;
pub mod words;
mod write;

use examples::Example;
use looks::Looks;
use sections::*;
use servotwin::campaign::Comparison;
use servotwin::job::flights::{FlightResults, SealedResults};
use servotwin::job::manifest::Manifest;
use servotwin::job::outcomes::FlownSuite;
use servotwin::job::results::SubjectResult;
use servotwin::job::{Results, Subject};
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
    pub write: fn(&Material, &mut Document),
}

/// Sections that answer the same question. On screen the reader picks one of them; on paper they follow one another.
pub struct Chapter {
    /// The anchor of the chapter in the HTML file.
    pub id: &'static str,
    /// The heading of the chapter.
    pub title: &'static str,
    /// Whether the chapter is evidence for other chapters and stands in the appendix.
    pub is_appendix: bool,
    /// The sections of the chapter. The first is shown in front.
    pub sections: &'static [Section],
}

/// The chapters of the report in their order. A new section is one file and one line here.
pub static CHAPTERS: &[Chapter] = &[
    Chapter {
        id: "findings",
        title: "Findings",
        is_appendix: false,
        sections: &[Section { id: "summary", title: "Summary", write: summary::write }],
    },
    Chapter {
        id: "setup",
        title: "System, faults and commands",
        is_appendix: false,
        sections: &[
            Section { id: "faults", title: "Faults", write: faults::write },
            Section { id: "system", title: "The system", write: system::write },
            Section { id: "commands", title: "Commands", write: commands::write },
        ],
    },
    Chapter {
        id: "visible",
        title: "Which faults are detected",
        is_appendix: false,
        sections: &[Section {
            id: "detectability",
            title: "Detectability",
            write: detectability::write,
        }],
    },
    Chapter {
        id: "errors",
        title: "What errors do",
        is_appendix: false,
        sections: &[
            Section { id: "safety", title: "Safety", write: safety::write },
            Section {
                id: "ambiguity",
                title: "Faults taken for each other",
                write: ambiguity::write,
            },
        ],
    },
    Chapter {
        id: "work",
        title: "Faults that begin at work",
        is_appendix: false,
        sections: &[
            Section { id: "flights", title: "The diagnosis at work", write: flights::write },
            Section { id: "unseen", title: "Faults never trained on", write: unseen::write },
        ],
    },
    Chapter {
        id: "limits",
        title: "Bands and the twin behind them",
        is_appendix: true,
        sections: &[
            Section { id: "bands", title: "Bands", write: bands::write },
            Section { id: "twin", title: "The twin and its confidence", write: twin::write },
        ],
    },
    Chapter {
        id: "decisions",
        title: "How the trees decide",
        is_appendix: true,
        sections: &[
            Section {
                id: "macrostructure",
                title: "How the trees hang together",
                write: macrostructure::write,
            },
            Section { id: "trees", title: "The trees", write: actuator_tree::write },
        ],
    },
    Chapter {
        id: "examples",
        title: "Examples",
        is_appendix: true,
        sections: &[Section {
            id: "residuals",
            title: "Residuals of examples",
            write: residuals::write,
        }],
    },
    Chapter {
        id: "rates",
        title: "Rates by scenario and protocol",
        is_appendix: true,
        sections: &[
            Section {
                id: "protocols",
                title: "The trees under every protocol",
                write: protocols::write,
            },
            Section { id: "committee", title: "The committee", write: committee::write },
            Section { id: "settings", title: "Settings", write: settings::write },
            Section {
                id: "uncertainty",
                title: "Answers that hang on less than a sensor shows",
                write: uncertainty::write,
            },
            Section { id: "confusion", title: "Confusion matrices", write: confusion::write },
            Section { id: "classifiers", title: "Classifiers compared", write: classifiers::write },
            Section { id: "ablation", title: "What carries the result", write: ablation::write },
        ],
    },
    Chapter {
        id: "origin",
        title: "The data and how it was made",
        is_appendix: true,
        sections: &[
            Section { id: "exclusions", title: "What was left out", write: exclusions::write },
            Section {
                id: "constants",
                title: "Constants of the diagnosis",
                write: constants::write,
            },
            Section { id: "making", title: "How this was made", write: making::write },
        ],
    },
];

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
