//! The report: one HTML file for reliability engineers, and its figures as files.
//!
//! The file needs no network and no script, prints on paper, and is readable without color. A
//! section is one file in `sections/` and one line in [`CHAPTERS`]. A section without content for
//! a study (no third sensor, no realistic setting) is left out. Results to act on come first; the
//! evidence behind them follows in an appendix. The same material gives the same bytes.

pub mod examples;
pub mod excerpt;
pub mod explain;
pub mod lines;
mod looks;
pub mod measured;
mod overview;
pub mod page;
pub mod schematic;
mod sections;
mod stages;
pub mod table;
pub mod vocabulary;
pub mod words;
mod write;

use examples::Example;
use excerpt::Excerpt;
use looks::Looks;
use page::{ContentsEntry, Page};
use servotwin::campaign::Comparison;
use servotwin::flight::band::BandMerit;
use servotwin::job::flights::{FlightResults, SealedResults};
use servotwin::job::healthy::HealthyRun;
use servotwin::job::manifest::Manifest;
use servotwin::job::results::SubjectResult;
use servotwin::job::{Results, Subject};
use servotwin::study::{Setting, Study};
use servotwin_diagnosis::diagnoser::tuning::Constant;
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_plot::Figure;
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
    pub healthy: &'a [HealthyRun],
    /// The constants of the stored diagnosers, by scenario.
    pub constants: &'a [(Setting, Vec<Constant>)],
    /// The learned conditional bands and their figures of merit.
    pub bands: &'a [BandMerit],
    /// True and fitted parameters of the specimens in the fitted setting.
    pub calibrations: &'a [Comparison],
    /// Simulated example faults.
    pub examples: &'a [Example],
    /// An excerpt of the data set whose trees are drawn, with its setting.
    pub excerpt: Option<(Setting, &'a Excerpt)>,
    /// The origin of all results.
    pub manifest: &'a Manifest,
}

/// One section of the report.
pub trait Section: Sync {
    /// The anchor of the section in the HTML file.
    fn id(&self) -> &'static str;
    /// The heading of the section.
    fn title(&self) -> &'static str;
    /// Writes the section, or nothing if the study has no content for it.
    fn write(&self, material: &Material, page: &mut Page);
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
    pub sections: &'static [&'static dyn Section],
}

/// The chapters of the report in their order. A new section is one file and one line here.
pub static CHAPTERS: &[Chapter] = &[
    Chapter {
        id: "findings",
        title: "Findings",
        is_appendix: false,
        sections: &[&sections::summary::Summary],
    },
    Chapter {
        id: "setup",
        title: "System, faults and commands",
        is_appendix: false,
        sections: &[
            &sections::faults::Faults,
            &sections::system::System,
            &sections::commands::Commands,
        ],
    },
    Chapter {
        id: "visible",
        title: "Which faults are detected",
        is_appendix: false,
        sections: &[&sections::detectability::Detectability],
    },
    Chapter {
        id: "errors",
        title: "What errors do",
        is_appendix: false,
        sections: &[&sections::safety::Safety, &sections::ambiguity::Ambiguity],
    },
    Chapter {
        id: "work",
        title: "Faults that begin at work",
        is_appendix: false,
        sections: &[&sections::flights::Flights, &sections::foreign::Foreign],
    },
    Chapter {
        id: "limits",
        title: "Bands and the twin behind them",
        is_appendix: true,
        sections: &[&sections::bands::Bands, &sections::twin::Twin],
    },
    Chapter {
        id: "decisions",
        title: "How the trees decide",
        is_appendix: true,
        sections: &[
            &sections::macrostructure::Macrostructure,
            &sections::actuator_tree::ActuatorTree,
            &sections::leaves::Leaves,
        ],
    },
    Chapter {
        id: "examples",
        title: "Examples",
        is_appendix: true,
        sections: &[&sections::residuals::Residuals],
    },
    Chapter {
        id: "rates",
        title: "Rates by scenario and protocol",
        is_appendix: true,
        sections: &[
            &sections::protocols::Protocols,
            &sections::committee::Committee,
            &sections::settings::Settings,
            &sections::robustness::Robustness,
            &sections::uncertainty::Uncertainty,
            &sections::confusion::Confusion,
            &sections::classifiers::Classifiers,
            &sections::ablation::Ablation,
            &sections::commands_curve::CommandsCurve,
        ],
    },
    Chapter {
        id: "origin",
        title: "The data and how it was made",
        is_appendix: true,
        sections: &[
            &sections::data_set::DataSet,
            &sections::exclusions::Exclusions,
            &sections::effort::Effort,
            &sections::constants::Constants,
            &sections::making::Making,
        ],
    },
];

/// The subject whose trees are drawn: the one with noise, or the first if there is none. Trees that never saw noise
/// split on differences that no sensor resolves.
pub(crate) fn main_of(results: &Results) -> Option<&SubjectResult> {
    results.of(Subject::Noise).or(results.subjects.first())
}

impl Material<'_> {
    /// The study's vocabulary.
    pub fn words(&self) -> Vocabulary {
        Vocabulary::of(self.study)
    }

    /// The plot styles of the study's actuators, commands and failures.
    fn looks(&self) -> Looks {
        Looks::of(self.study)
    }

    /// The subject whose trees are drawn.
    pub fn main(&self) -> Option<&SubjectResult> {
        main_of(self.results)
    }

    /// The hierarchy of a subject, if the report has it.
    pub fn hierarchy(&self, subject: Subject) -> Option<&Hierarchy> {
        self.hierarchies.iter().find(|(own, _)| *own == subject).map(|(_, hierarchy)| hierarchy)
    }
}

/// Shows the last (hardest) setting, and folds the others.
fn hardest_first(
    results: &[&SubjectResult],
    page: &mut Page,
    show: &dyn Fn(&SubjectResult, &mut Page),
) {
    let Some((hardest, others)) = results.split_last() else { return };
    show(hardest, page);
    for result in others {
        page.folded(&format!("Setting: {}", result.title), |page| show(result, page));
    }
}

/// Returns the report as HTML, and its figures with their file names.
pub fn render(material: &Material) -> (String, Vec<(String, Figure)>) {
    let mut chapters = vec![];
    for chapter in CHAPTERS {
        let mut page = Page::default();
        page.section(chapter.id, chapter.title, |page| chapter.write(material, page));
        if !page.is_empty() {
            chapters.push((chapter, page));
        }
    }
    let mut page = Page::default();
    let entry = |(chapter, _): &(&Chapter, Page)| ContentsEntry {
        id: chapter.id.to_owned(),
        title: chapter.title.to_owned(),
        is_appendix: chapter.is_appendix,
    };
    let entries: Vec<ContentsEntry> = chapters.iter().map(entry).collect();
    overview::write(material, &mut page);
    page.contents(&entries);
    let mut in_appendix = false;
    for (chapter, written) in chapters {
        if chapter.is_appendix && !in_appendix {
            page.appendix();
            in_appendix = true;
        }
        page.append(written);
    }
    page.finish(&material.study.title)
}

impl Chapter {
    /// Writes the sections that have content. The reader chooses among several.
    fn write(&self, material: &Material, page: &mut Page) {
        let written = self.sections.iter().map(|section| {
            let mut inner = Page::default();
            section.write(material, &mut inner);
            (section.id(), section.title(), inner)
        });
        let written: Vec<_> = written.filter(|(.., inner)| !inner.is_empty()).collect();
        page.choices(self.id, written);
    }
}
